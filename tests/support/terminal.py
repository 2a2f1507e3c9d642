"""handctl on a real pseudo-terminal, drawn by a terminal emulator: what a person sees and types."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import pexpect
import pyte

from tests.support.cli import clean_environment
from tests.support.screen import ANSI


class Terminal:
    """handctl on a pseudo-terminal; `screen` is what a person would see on it."""

    def __init__(self, *args: str | Path, columns: int = 80, rows: int = 24, env: dict[str, str] | None = None) -> None:
        self.columns, self.rows = columns, rows
        self.process = pexpect.spawn(
            sys.executable, ["-m", "handctl", *map(str, args)], dimensions=(rows, columns), timeout=30, echo=False,
            env={**clean_environment(), "TERM": "xterm-256color", **(env or {})},
        )  # fmt: skip
        self.screen = pyte.Screen(columns, rows)
        self._feed = pyte.ByteStream(self.screen)
        self.data = b""

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, kind: type[BaseException] | None, exc: BaseException | None, tb: TracebackType | None) -> None:
        self.process.close(force=True)

    def _take(self, seconds: float) -> bool:
        """Take what came; False at the end."""
        try:
            data = self.process.read_nonblocking(65536, timeout=seconds)
        except pexpect.TIMEOUT:
            return True
        except pexpect.EOF:
            return False
        self.data += data
        self._feed.feed(data)
        return True

    def run_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end and self._take(0.05):
            pass
        size = -1
        while size != len(self.data):  # not in the middle of a drawing
            size = len(self.data)
            self._take(0.02)

    def until(self, text: str, seconds: float = 30.0) -> None:
        """Wait until `text` has been written."""
        end = time.monotonic() + seconds
        while text not in self.text:
            assert self._take(0.05), f"ended without {text!r}:\n{self.text}"
            assert time.monotonic() < end, f"no {text!r}:\n{self.text}"

    def until_number(self, pattern: str, above: float, seconds: float = 30.0) -> float:
        """Wait until a number that is shown again and again, the group of `pattern`, is above this; it."""
        end = time.monotonic() + seconds
        while not (shown := [number for found in re.findall(pattern, self.text) if (number := float(found)) > above]):
            assert self._take(0.05), f"ended without a number above {above}:\n{self.text}"
            assert time.monotonic() < end, f"no number above {above}:\n{self.text}"
        return shown[-1]

    def until_screen(self, fits: Callable[[list[str]], object], seconds: float = 30.0) -> list[str]:
        """Wait until what a person sees fits; its lines that are not empty."""
        end = time.monotonic() + seconds
        while True:
            self.run_for(0.05)
            if fits(lines := [line for line in self.lines if line]):
                return lines
            assert time.monotonic() < end, self.text

    def until_samples(self, count: int) -> list[str]:
        """Wait until a live view is whole and has shown so many samples; its lines that are not empty."""

        def fits(lines: list[str]) -> bool:
            samples = re.findall(r"(\d+) samples", lines[0]) if lines else []
            return bool(samples) and int(samples[0]) >= count and lines[-1].startswith("q quit")

        return self.until_screen(fits)

    def finish(self) -> int:
        """Wait for the end; the exit code."""
        end = time.monotonic() + 30
        while self._take(0.2):
            assert time.monotonic() < end, self.text
        self.process.close()
        assert self.process.exitstatus is not None, self.text
        return int(self.process.exitstatus)

    def send(self, text: str) -> None:
        self.process.send(text)

    @property
    def text(self) -> str:
        """Everything that was written, without escape codes."""
        return ANSI.sub("", self.data.decode("utf-8", "replace")).replace("\r\n", "\n")

    @property
    def lines(self) -> list[str]:
        """The screen."""
        return [line.rstrip() for line in self.screen.display]
