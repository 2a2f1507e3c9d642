"""The monotonic clock, and sleep: the same moments for links, deadlines and measurements."""

from __future__ import annotations

import sys
import time

SLICE = 0.02 if sys.platform == "win32" else 0.1
"""Seconds that the system waits at most without a look for a wish to end. None ends its wait on Windows; elsewhere one that comes
just before the wait begins does not."""

wall = time.time
"""The time of day: seconds since 1970, UTC."""

now = time.perf_counter if sys.platform == "win32" else time.monotonic
"""Seconds on a monotonic clock; `time.monotonic` ticks at 15.6 ms on Windows, before Python 3.13."""


def sleep(seconds: float) -> None:
    """Let time pass; a signal's handler runs meanwhile."""
    end = now() + seconds
    while seconds > SLICE:
        time.sleep(SLICE)
        seconds = end - now()
    if seconds > 0:
        time.sleep(seconds)
