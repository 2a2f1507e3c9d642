"""Lines of control values as a program sends them, from stdin or a named pipe. Knows no values and no hand."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

from handctl.errors import NoAnswer, UsageError
from handctl.system import clock, disk
from handctl.system.waits import gives

LONGEST_LINE = 65_536
"""Bytes of one line."""
SILENCE = 30.0
"""Seconds without a line, before the hand is touched, after which nobody is there to send any."""


class Lines:
    """Lines of stdin ("-") or of a named pipe, without the buffering that would hold them back.

    Until `begun`, nothing is waited for longer than `seconds` in all, or, where that is None, than SILENCE at a time.
    """

    def __init__(self, path: str, seconds: float | None) -> None:
        self.begun = False
        self._path, self._seconds = path, seconds
        self._end = None if seconds is None else clock.now() + seconds

    def __iter__(self) -> Iterator[str]:
        """The lines. Raises UsageError for a line without end, NoAnswer where none comes in time."""
        try:
            descriptor = sys.stdin.fileno() if self._path == "-" else os.open(self._path, os.O_RDONLY | disk.AT_ONCE)
        except (OSError, ValueError, AttributeError):
            yield from sys.stdin
            return
        rest = b""
        try:
            while chunk := self._chunk(descriptor):
                *whole, rest = (rest + chunk).split(b"\n")
                for line in whole:
                    yield line.decode("utf-8", "replace")
                if len(rest) > LONGEST_LINE:
                    raise UsageError(
                        f"{self._path}: not control values: more than {LONGEST_LINE} bytes without a line end",
                        hint="send CSV or JSON lines, such as t,velocity.F1",
                    )
        finally:
            if self._path != "-":
                os.close(descriptor)
        if rest:
            yield rest.decode("utf-8", "replace")

    def _chunk(self, descriptor: int) -> bytes:
        """What has come; b"" at the end. A pipe that nobody has opened for writing has no end yet."""
        left = None if self.begun else SILENCE if self._end is None else max(0.0, self._end - clock.now())
        if not gives(descriptor, left):
            where = "stdin" if self._path == "-" else self._path
            raise NoAnswer(
                f"{where}: no control values arrived within {self._seconds or SILENCE:g} s",
                hint="start the program that writes them, or give a longer --deadline. Nothing was sent.",
                code="deadline",
            )
        return os.read(descriptor, 65536)
