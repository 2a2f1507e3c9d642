"""The monotonic clock, and sleep: the same moments for links, deadlines and measurements."""

from __future__ import annotations

import sys
import time

SLICE = 0.02
"""Seconds between two looks, where a wait in the system cannot be ended by a wish to end (Windows)."""

wall = time.time
"""The time of day: seconds since 1970, UTC."""

if sys.platform == "win32":
    now = time.perf_counter
    """Seconds on a monotonic clock; `time.monotonic` ticks at 15.6 ms here, before Python 3.13."""

    def sleep(seconds: float) -> None:
        """Sleep in slices, so that interrupts are handled between them."""
        end = now() + seconds
        while (left := end - now()) > 0:
            time.sleep(min(left, SLICE))

else:
    now = time.monotonic
    """Seconds on a monotonic clock."""
    sleep = time.sleep
    """Let time pass; a signal's handler runs meanwhile."""
