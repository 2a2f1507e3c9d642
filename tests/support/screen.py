"""Screens without a terminal: handctl in this process, writing to a stream that says it is a terminal of a given size.

For tables and the live view only; what needs a keyboard runs on a real pseudo-terminal (`terminal.py`).
"""

from __future__ import annotations

import io
import re
import signal
import sys
from collections.abc import Mapping
from functools import cache
from unittest import mock

import pyte

from handctl import cli
from tests.support.cli import environment

# A window has thousands of characters, and few different ones: each would be made of its attributes again.
pyte.screens.Char._replace = cache(pyte.screens.Char._replace)
ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class FakeTerminal(io.TextIOWrapper):
    """A stream that is a terminal for whoever asks."""

    def isatty(self) -> bool:
        return True


class Screen:
    """What one run wrote: `data` with escape codes, `text` without, `err` beside it."""

    def __init__(self, code: int, data: str, err: str, columns: int, rows: int) -> None:
        self.code, self.data, self.err = code, data, err
        self.columns, self.rows = columns, rows
        self.text = ANSI.sub("", data)
        self.lines = [line.rstrip() for line in self.text.split("\n")]

    @property
    def display(self) -> list[str]:
        """The window as it stands at the end, drawn by a terminal emulator, without the empty lines below."""
        window = pyte.Screen(self.columns, self.rows)
        pyte.Stream(window).feed(self.data.replace("\n", "\r\n"))
        lines = [line.rstrip() for line in window.display]
        while lines and not lines[-1]:
            lines.pop()
        return lines


def screen(
    *args: str, columns: int = 80, rows: int = 24, env: Mapping[str, str] | None = None, terminal: bool = True
) -> Screen:
    """Run handctl in this process with stdout a terminal (or a pipe) of that size; stderr and stdin are none."""
    kind = FakeTerminal if terminal else io.TextIOWrapper
    out = kind(io.BytesIO(), encoding="utf-8", newline="")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="")
    size = {"TERM": "xterm-256color", "COLUMNS": str(columns), "LINES": str(rows)}
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    with (
        environment({**size, **(env or {})}),
        mock.patch.object(sys, "stdout", out),
        mock.patch.object(sys, "stderr", err),
        mock.patch.object(sys, "stdin", io.StringIO()),
    ):
        try:
            code = cli.main(list(args))
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
            out.flush()
            err.flush()
    texts = [stream.buffer.getvalue().decode() for stream in (out, err)]  # type: ignore[attr-defined]
    return Screen(code, texts[0], texts[1], columns, rows)
