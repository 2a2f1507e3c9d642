"""Waiting for a descriptor, a socket or a pipe, until it is ready or the time is over; how stdout and stderr write."""

from __future__ import annotations

import os
import select
import sys
from typing import Any

if sys.platform == "win32":
    import contextlib

    from handctl.system.clock import SLICE, now

    def _ready(reads: list[Any], writes: list[Any], fails: list[Any], seconds: float) -> bool:
        """Whether one is ready. Waits in slices, so that interrupts are handled between them."""
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
        import ctypes
        import socket

        what.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            what.connect(address)
        if not _ready([], [what], [what], seconds):  # one that was refused is not writable there
            raise TimeoutError
        if code := what.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise ctypes.WinError(code)

else:

    def _polled(descriptor: int, event: int, seconds: float | None) -> bool:
        poll = select.poll()
        poll.register(descriptor, event)
        return bool(poll.poll(None if seconds is None else seconds * 1000))

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


def ended(descriptor: int) -> bool:
    """Whether what was readable and gave nothing is at its end. A serial port gives nothing where another reader was faster, too:
    one that has gone is no terminal any more."""
    return not os.isatty(descriptor)


# -- stdin, stdout, stderr and pipes --------------------------------------------------------------------------------------


CHANGES_LINE_ENDS = sys.platform == "win32"
"""Whether a text stream writes other line ends than it is given, unless it is told not to."""


def takes(descriptor: int, seconds: float | None) -> bool:
    """Wait until a pipe or a terminal accepts data, or its reader is gone; None = for ever. True if that is not known."""
    return sys.platform == "win32" or _polled(descriptor, select.POLLOUT, seconds)


def gives(descriptor: int, seconds: float | None) -> bool:
    """Wait just as long for data or the end of input; a pipe that has no writer yet has not ended."""
    return sys.platform == "win32" or _polled(descriptor, select.POLLIN, seconds)
