"""stderr and stdin as a person meets them: messages, progress, questions. Knows no device and no data."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from handctl import ending
from handctl.model.guide import Guide, Presses
from handctl.screen.filter import short, shown

if TYPE_CHECKING:
    from handctl.errors import HandctlError


class TerminalGuide(Guide):
    """Talks with the person on stderr; asks only when stdin and stderr are terminals."""

    def __init__(self, quiet: bool) -> None:
        self.interactive = is_terminal(sys.stdin) and is_terminal(sys.stderr)
        self.moving = is_terminal(sys.stderr) and not quiet
        self._quiet = quiet
        self._width = 0

    def say(self, text: str) -> None:
        """A line that stays."""
        if not self._quiet:
            self.done()
            print_stderr(text)

    def progress(self, text: str) -> None:
        """A line that replaces the last one; only on a terminal."""
        if self.moving:
            text = shown(text)
            self._draw(lambda columns: f"\r{text[: columns - 1].ljust(self._width)}")
            self._width = len(text)

    def done(self) -> None:
        """Remove the progress line."""
        if self._width:
            self._draw(lambda columns: f"\r{' ' * min(self._width, columns - 1)}\r")
            self._width = 0

    def _draw(self, line: Callable[[int], str]) -> None:
        """Never raises: a terminal that has gone must not keep a device from being stopped."""
        _unless_asked_to_end()
        try:
            sys.stderr.write(line(_columns()))
            sys.stderr.flush()
        except (OSError, ValueError):
            self.moving = False

    @contextmanager
    def counting(self) -> Iterator[Presses]:
        presses = Presses()

        def press(_number: int, _frame: Any) -> None:
            presses.count += 1
            if presses.most is not None and presses.count > presses.most:
                raise KeyboardInterrupt

        with ending.on_interrupt(press):
            yield presses

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        with self.counting():
            yield

    @contextmanager
    def impatient(self, seconds: float, stop: Callable[[], HandctlError]) -> Iterator[None]:
        import signal
        import threading

        if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
            yield
            return

        def ring(_number: int, _frame: Any) -> None:
            raise stop()

        before = signal.signal(signal.SIGALRM, ring)
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)

    def wait_for_enter(self, text: str) -> bool:
        self.done()
        print_stderr(text)
        return self.interactive and bool(sys.stdin.readline())

    def ask(self, question: str, word: str) -> bool:
        """Yes or no, or a word to be typed. End of input is a no."""
        self.done()
        print_stderr(f"{question}.")
        sys.stderr.write(f"Type {word!r} to go on: " if word else "Go on? [y/N] ")
        sys.stderr.flush()
        answer = sys.stdin.readline().strip()
        return answer == word if word else answer.casefold() in ("y", "yes")


def print_message(level: str, text: str, hint: str) -> None:
    """A message with its next step. Neither can begin a line of its own: what a device said may stand in it."""
    print_stderr(f"handctl: {level}: {shown(text)}" + (f"\n  next: {shown(hint)}" if hint else ""))


def print_stderr(text: str) -> None:
    """One message, wrapped at words on a terminal; a closed stderr is not worth a second error."""
    text = "\n".join(map(short, shown(text, keep="\n").split("\n")))
    _unless_asked_to_end()
    try:
        if is_terminal(sys.stderr):
            text = _wrapped(text, _columns())
        sys.stderr.write(text + "\n")
        sys.stderr.flush()
    except (OSError, ValueError):
        return


def _unless_asked_to_end() -> None:
    """A message never waits for its reader when the command is to end: a device may have to be stopped behind it."""
    if ending.asked():
        ending.make_room(ending.waits(sys.stderr))


def _columns() -> int:
    """Width of the terminal behind stderr; 80 where it does not know its own, as a serial console. Raises OSError."""
    return os.get_terminal_size(sys.stderr.fileno()).columns or 80


def _wrapped(text: str, columns: int) -> str:
    """Lines longer than the terminal are broken at words, continued with an indent; frames of bytes are kept whole."""
    import textwrap

    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        lines += textwrap.wrap(
            line, max(columns, 20), subsequent_indent=indent + "  ", break_long_words=False, break_on_hyphens=False
        ) or [""]
    return "\n".join(lines)


def is_terminal(stream: Any) -> bool:
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False
