"""Waiting for a descriptor, a socket or a pipe, until it is ready or the time is over; how stdout and stderr write."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable
from math import inf
from typing import Any


def _sliced(wait: Callable[[float], object], seconds: float) -> bool:
    """Whether `wait` finds something within so many seconds. In slices: see `clock.SLICE`."""
    from handctl.system.clock import SLICE, now

    end = now() + seconds
    while not (found := wait(min(seconds, SLICE))) and seconds > SLICE:
        seconds = max(0.0, end - now())
    return bool(found)


def readable(what: Any, seconds: float) -> bool:
    """Whether a descriptor or a socket has something, or is closed. On Windows only a socket."""
    return _sliced(lambda left: select.select([what], [], [], left)[0], seconds)


def writable(what: Any, seconds: float) -> bool:
    """The same for room to write."""
    return _sliced(lambda left: select.select([], [what], [], left)[1], seconds)


def _polled(descriptor: int, event: str, seconds: float | None) -> bool:
    """The same for a pipe or a terminal, as far as the system tells; None = for ever."""
    if sys.platform == "win32":
        return True
    poll = select.poll()
    poll.register(descriptor, getattr(select, event))
    return _sliced(lambda left: poll.poll(left * 1000), inf if seconds is None else seconds)


if sys.platform == "win32":
    import contextlib

    def connect(what: Any, address: Any, seconds: float) -> None:
        """Connect a socket, which does not block then. Raises OSError, TimeoutError where nothing answers."""
        import ctypes
        import socket

        what.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            what.connect(address)
        # One that was refused is not writable there.
        if not _sliced(lambda left: any(select.select([], [what], [what], left)), seconds):
            raise TimeoutError
        if code := what.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise ctypes.WinError(code)

else:

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
    return _polled(descriptor, "POLLOUT", seconds)


def gives(descriptor: int, seconds: float | None) -> bool:
    """Wait just as long for data or the end of input; a pipe that has no writer yet has not ended."""
    return _polled(descriptor, "POLLIN", seconds)
