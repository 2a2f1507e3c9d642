"""stdout, stderr and pipes: how they write, and whether one takes something. Help loads it."""

from __future__ import annotations

import sys
from typing import Any

CHANGES_LINE_ENDS = sys.platform == "win32"
"""Whether a text stream writes other line ends than it is given, unless it is told not to."""


def settings(stream: Any) -> dict[str, str]:
    """What `reconfigure` is told of stdout and stderr: on Windows a pipe or a file gets UTF-8 and plain line ends, too."""
    if sys.platform == "win32" and not stream.isatty():
        return {"encoding": "utf-8", "newline": "\n"}
    return {}


def takes(descriptor: int, seconds: float | None) -> bool:
    """Wait until a pipe or a terminal takes something, or its reader is gone; None = for ever. Where it cannot be told: True."""
    if sys.platform == "win32":
        return True
    import select

    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)
    return bool(poll.poll(None if seconds is None else seconds * 1000))


def gives(descriptor: int, seconds: float | None) -> bool:
    """Wait until there is something to read, or the end, as long; a pipe that nobody has opened to write has no end yet."""
    if sys.platform == "win32":
        return True
    import select

    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    return bool(poll.poll(None if seconds is None else seconds * 1000))
