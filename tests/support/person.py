"""A person at a terminal, without a terminal: handctl in this process, stdin, stdout and stderr being one window.

For what asks, moves and is interrupted; tables and the live view are shown by `screen.py`. What the person sees decides what is typed and when a key is pressed: never a moment of real time. What the system does with
a terminal (its size, raw keys, a hang-up) is seen on a real one only (`terminal.py`).
"""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

from handctl import cli, interrupts
from handctl.command import terminal_prompts
from handctl.link import fake
from tests.support.cli import clean_environment
from tests.support.screen import ANSI, FakeTerminal, Screen

Answer = str | Callable[[str], str]
"""What is typed at a question, or a function that makes it of all that has been shown."""
Press = Callable[[str], int | None]
"""Of all that has been shown, after each piece of it: the signal that comes now, or None."""
MOST = 1_000_000
"""Characters that no command shows that ends."""


class _Window(FakeTerminal):
    """All that is shown, whichever stream it came by."""

    def __init__(self, press: Press) -> None:
        super().__init__(io.BytesIO(), encoding="utf-8", newline="")
        self.data = self.seen = ""
        self._press = press

    def show(self, text: str) -> None:
        self.data += text
        self.seen += ANSI.sub("", text)
        assert len(self.data) < MOST, "the command does not end"

    def write(self, text: str) -> int:
        self.show(text)
        if (number := self._press(self.seen)) is not None:
            signal.raise_signal(number)
        return len(text)


class _Keyboard(io.StringIO):
    """What is typed, a line a question; nothing behind the last answer. With no answers at all it is no terminal."""

    def __init__(self, window: _Window, answers: Iterable[Answer]) -> None:
        super().__init__()
        self._window, self._answers = window, list(answers)
        self._terminal = bool(self._answers)

    def isatty(self) -> bool:
        return self._terminal

    def readline(self, size: int | None = -1, /) -> str:
        if not self._answers:
            return ""
        answer = self._answers.pop(0)
        typed = answer if isinstance(answer, str) else answer(self._window.seen)
        self._window.show(f"{typed}\n")
        return f"{typed}\n"


def person(
    *args: str | Path,
    answers: Iterable[Answer] = (),
    press: Press = lambda _seen: None,
    columns: int = 80,
    rows: int = 24,
    env: Mapping[str, str] | None = None,
) -> Screen:
    """Run handctl with a person before it; what was shown, with the exit code."""
    window = _Window(press)
    size = {"TERM": "xterm-256color", "COLUMNS": str(columns), "LINES": str(rows)}
    numbers = [number for number in signal.valid_signals() if callable(signal.getsignal(number))]
    handlers = {
        number: signal.getsignal(number) for number in {*numbers, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP}
    }
    with ExitStack() as stack:
        for name, stream in (("stdout", window), ("stderr", window), ("stdin", _Keyboard(window, answers))):
            stack.enter_context(mock.patch.object(sys, name, stream))
        stack.enter_context(mock.patch.dict(os.environ, clean_environment({**size, **(env or {})}), clear=True))
        stack.enter_context(mock.patch.object(terminal_prompts, "_columns", lambda: columns))
        try:
            code = cli.main([str(arg) for arg in args])
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
            interrupts._state.__init__()  # type: ignore[misc]  # nobody has asked the next command to end
    return Screen(code, window.data, "", columns, rows)


def once(fits: Callable[[str], object], number: int = signal.SIGINT) -> Press:
    """A key that is pressed once: as soon as what is seen fits."""
    left = [number]
    return lambda seen: left.pop() if left and fits(seen) else None


@contextmanager
def pressed_at(seconds: float, number: int = signal.SIGINT) -> Iterator[None]:
    """A key that is pressed once, when a link on virtual time has been open for so long."""
    left, sleep = [number], fake._Simulated._sleep_until

    def until(link: Any, moment: float) -> float:
        if left and link._virtual is not None and moment >= seconds:
            now = sleep(link, seconds)
            signal.raise_signal(left.pop())
            return now
        return sleep(link, moment)

    with mock.patch.object(fake._Simulated, "_sleep_until", until):
        yield
    assert not left, f"it ended before {seconds} s"
