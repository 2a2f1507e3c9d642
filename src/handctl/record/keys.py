"""Keys that set marks while a log runs. Knows nothing of the log."""

from __future__ import annotations

import sys
from types import TracebackType

from handctl.system import terminal


class Keys:
    """Keys pressed on the terminal, without waiting for one. Only while this process is in the foreground."""

    def __init__(self, wanted: bool) -> None:
        self._wanted = wanted
        self._terminal: terminal.Keys | None = None
        self._descriptor = -1
        self._count = 0

    @property
    def heard(self) -> bool:
        """Whether a key sets a mark."""
        return self._terminal is not None

    def __enter__(self) -> Keys:
        if self._wanted:
            self._descriptor = sys.stdin.fileno()
            if terminal.in_front(self._descriptor):
                self._terminal = terminal.Keys(self._descriptor)
        return self

    def pressed(self) -> str:
        """The text of a mark: the keys since the last call, a numbered word for space; "" for none."""
        if self._terminal is None or not terminal.in_front(self._descriptor):
            return ""
        text = self._terminal.pressed()
        if not text.isprintable() or not text:
            return ""
        self._count += 1
        return text.strip() or f"mark {self._count}"

    def __exit__(self, kind: type[BaseException] | None, exc: BaseException | None, tb: TracebackType | None) -> None:
        if self._terminal is not None and terminal.in_front(self._descriptor):
            self._terminal.close()
