"""Waiting for a descriptor or a socket, until it is ready or the time is over."""

from __future__ import annotations

import select
import sys
from typing import Any

if sys.platform == "win32":
    import contextlib
    import ctypes
    import socket

    from handctl.system.clock import SLICE, now

    def _ready(reads: list[Any], writes: list[Any], fails: list[Any], seconds: float) -> bool:
        """Whether one is; in slices: between two of them a wish to end is heard."""
        end = now() + seconds
        while True:
            left = max(0.0, end - now())
            if any(select.select(reads, writes, fails, min(left, SLICE))):
                return True
            if not left:
                return False

    def readable(what: Any, seconds: float) -> bool:
        """Whether a socket has something, or is closed."""
        return _ready([what], [], [], seconds)

    def writable(what: Any, seconds: float) -> bool:
        """The same for room to write."""
        return _ready([], [what], [], seconds)

    def connect(what: Any, address: Any, seconds: float) -> None:
        """Connect a socket, which does not block then. Raises OSError, TimeoutError where nothing answers."""
        what.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            what.connect(address)
        if not _ready([], [what], [what], seconds):  # one that was refused is not writable there
            raise TimeoutError
        if code := what.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise ctypes.WinError(code)

else:

    def readable(what: Any, seconds: float) -> bool:
        """Whether a descriptor or a socket has something, or is closed."""
        return bool(select.select([what], [], [], seconds)[0])

    def writable(what: Any, seconds: float) -> bool:
        """The same for room to write."""
        return bool(select.select([], [what], [], seconds)[1])

    def connect(what: Any, address: Any, seconds: float) -> None:
        """Connect a socket, which does not block then. Raises OSError, TimeoutError where nothing answers."""
        what.settimeout(seconds)
        what.connect(address)
        what.setblocking(False)
