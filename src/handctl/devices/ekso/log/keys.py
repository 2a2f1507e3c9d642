"""Keys that set marks while a log runs. Knows the terminal, and nothing of the log."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from types import TracebackType
from typing import Any


class Keys:
    """Keys pressed on the terminal, without waiting for one. Only while this process is in the foreground."""

    def __init__(self, wanted: bool) -> None:
        self.heard = False
        self._wanted = wanted
        self._saved: list[Any] = []
        self._count = 0

    def __enter__(self) -> Keys:
        if self._wanted:
            self._terminal = sys.stdin.fileno()
            self._listen()
        return self

    def _listen(self) -> None:
        try:
            import termios
        except ImportError:
            return  # no such terminals here: marks come by --mark only
        if not self._foreground():
            return
        self._saved = termios.tcgetattr(self._terminal)
        mode = termios.tcgetattr(self._terminal)
        mode[3] &= ~(termios.ICANON | termios.ECHO)
        mode[6][termios.VMIN] = mode[6][termios.VTIME] = 0
        termios.tcsetattr(self._terminal, termios.TCSANOW, mode)
        self.heard = True

    def _foreground(self) -> bool:
        """Touching the terminal from the background would stop the process."""
        try:
            return os.tcgetpgrp(self._terminal) == os.getpgrp()
        except OSError:
            return False

    def pressed(self) -> str:
        """The text of a mark: the keys since the last call, a numbered word for space; "" for none."""
        if not self.heard or not self._foreground():
            return ""
        try:
            text = os.read(self._terminal, 64).decode("utf-8", "ignore")
        except OSError:
            return ""
        if not text.isprintable() or not text:
            return ""
        self._count += 1
        return text.strip() or f"mark {self._count}"

    def __exit__(self, kind: type[BaseException] | None, exc: BaseException | None, tb: TracebackType | None) -> None:
        if self._saved and self._foreground():
            import termios

            with suppress(termios.error):  # it went away
                termios.tcsetattr(self._terminal, termios.TCSANOW, self._saved)
