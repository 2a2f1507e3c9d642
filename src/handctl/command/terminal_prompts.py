"""Messages, progress and questions on stderr and stdin. Knows no device and no data."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from handctl import interrupts
from handctl.errors import HandctlError, OutputError
from handctl.model.prompts import InterruptCount, Prompts, confirms
from handctl.screen.sanitize import short, shown
from handctl.wording import honest, sentence

if TYPE_CHECKING:
    from handctl.model.command_settings import Settings
    from handctl.model.write_ledger import Ledger


ROOM = 18
"""Columns that a progress line leaves at least for its own text behind the safety words."""


class TerminalPrompts(Prompts):
    """Talks with the person on stderr; asks only when stdin and stderr are terminals."""

    def __init__(self, quiet: bool) -> None:
        self.interactive = self.present = is_terminal(sys.stdin) and is_terminal(sys.stderr)
        self.moving = is_terminal(sys.stderr) and not quiet
        self._quiet = quiet
        self._line = ""
        """The progress line as it stands on the terminal."""
        self._warned = ""
        """Safety words that have a line of their own above it."""

    def say(self, text: str) -> None:
        """A line that stays."""
        if not self._quiet:
            self.instruct(text)

    def instruct(self, text: str) -> None:
        """See Prompts."""
        self._replace("")
        print_stderr(text)

    def progress(self, text: str, safety: str = "") -> None:
        """A line that replaces the last one, never wider than the terminal; only on a terminal.

        In a window too narrow for both, `safety` is said once on a line of its own, which stays above.
        """
        if not self.moving:
            return
        text = shown(text)
        if safety and safety != self._warned:
            if len(safety) + min(len(text), ROOM) + 1 < self._columns():
                text = f"{safety} {text}"
            else:
                self.say(safety)
                self._warned = safety
        self._replace(text)

    def done(self) -> None:
        """Remove the progress line."""
        self._replace("")
        self._warned = ""

    def _replace(self, text: str) -> None:
        """Never raises: a terminal that has gone must not keep a device from being stopped."""
        most = self._columns() - 1 if text or self._line else 0
        text = _cut(text, most)
        if text == self._line:
            return
        _unless_asked_to_end()
        blanks = " " * min(_cells(self._line) - _cells(text), most - _cells(text))
        try:
            sys.stderr.write(f"\r{text}{blanks}" + ("" if text else "\r"))
            sys.stderr.flush()
        except (OSError, ValueError):
            self.moving = False
        self._line = text

    def _columns(self) -> int:
        """Width of the terminal; a terminal that has gone has none, and gets no progress any more."""
        try:
            return _columns()
        except (OSError, ValueError):
            self.moving = False
            return 1

    @contextmanager
    def count_interrupts(self) -> Iterator[InterruptCount]:
        presses = InterruptCount()

        def press(_number: int, _frame: Any) -> None:
            presses.count += 1
            if presses.most is not None and presses.count > presses.most:
                raise KeyboardInterrupt

        with interrupts.on_interrupt(press):
            yield presses

    @contextmanager
    def without_interrupts(self) -> Iterator[None]:
        with self.count_interrupts():
            yield

    @contextmanager
    def stopping(self) -> Iterator[None]:
        with self.without_interrupts(), interrupts.stopping():
            yield

    @contextmanager
    def stop_if_slow(self, seconds: float, stop: Callable[[], HandctlError]) -> Iterator[None]:
        import threading

        from handctl.system import signals

        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def ring(_number: int, _frame: Any) -> None:
            raise stop()

        before = signals.alarm(ring, seconds)
        try:
            yield
        finally:
            signals.no_alarm(before)

    def wait_for_enter(self, text: str) -> bool:
        self.done()
        _discard_typed_ahead()
        print_stderr(text)
        return self.interactive and bool(sys.stdin.readline())

    def ask(self, question: str, word: str) -> bool:
        """Yes or no, or a word to be typed. End of input is a no."""
        _discard_typed_ahead()
        answer = self._answer(f"{question}.", f"Type {word!r} to go on: " if word else "Go on? [y/N] ")
        return confirms(answer, word) if word else answer.casefold() in ("y", "yes")

    def choose(self, question: str, words: Sequence[str]) -> str:
        _discard_typed_ahead()
        answer = self._answer(f"{question}?", f"Type {' or '.join(words)}: ").casefold() if self.present else ""
        return answer if answer in words else ""

    def text(self, question: str) -> str:
        return self._answer(question, "> ") if self.interactive else ""

    def _answer(self, text: str, prompt: str) -> str:
        self.done()
        print_stderr(text)
        sys.stderr.write(prompt)
        sys.stderr.flush()
        return sys.stdin.readline().strip()


def _discard_typed_ahead() -> None:
    """Before a question on whose answer something moves or is written: it is answered by who has read it."""
    from handctl.system.terminal import discard_typed_ahead

    discard_typed_ahead(sys.stdin)


def print_message(level: str, text: str, hint: str) -> None:
    """Print a message and its next step, each on one line even if text from a device contains line breaks."""
    print_stderr(f"handctl: {level}: {shown(sentence(text))}" + (f"\n  Next: {shown(sentence(hint))}" if hint else ""))


def print_writes(ledger: Ledger, settings: Settings, failure: HandctlError | None) -> None:
    """Print the record of writes; with -q only if a write is unconfirmed, or a stop was not sent."""
    in_json = settings.format in ("json", "ndjson") and not isinstance(failure, OutputError)
    if in_json or settings.dry_run or (settings.quiet and not ledger.unconfirmed):
        return
    said = failure is not None and honest(failure.hint) != failure.hint
    if lines := ([] if said and not ledger.began else ledger.text()):
        level = "warning" if ledger.unconfirmed else "note"
        print_stderr("\n".join((f"handctl: {level}: {lines[0]}", *map(shown, lines[1:]))))


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
    """Print to stderr. After an interrupt a message never waits for its reader, because a device may have to be stopped."""
    if interrupts.was_interrupted():
        interrupts.make_room(interrupts.waits(sys.stderr))


def _columns() -> int:
    """Width of the terminal on stderr; 80 if it does not know its own, like a serial console. Raises OSError."""
    return os.get_terminal_size(sys.stderr.fileno()).columns or 80


def _cells(text: str) -> int:
    """Columns that a text takes on a terminal: two for a wide letter of East Asia."""
    if text.isascii():
        return len(text)
    import unicodedata

    return sum(2 if unicodedata.east_asian_width(letter) in "WF" else 1 for letter in text)


def _cut(text: str, most: int) -> str:
    """The beginning of a text that fits into `most` columns."""
    text = text[: max(most, 0)]
    while _cells(text) > most:
        text = text[:-1]
    return text


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
