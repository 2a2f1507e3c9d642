"""How a procedure talks to the person at the device: lines, progress, questions. The base class is silent, for tests and scripts.

Procedures get one and never print; those of a terminal are in `command.terminal_prompts`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from handctl.errors import Aftermath, HandctlError
    from handctl.model.param import Changes, Step

CTRL_C = "Ctrl-C stops."
"""Safety words of a movement that Ctrl-C stops."""


class InterruptCount:
    """How often the user asked to stop since it was made; one more than `most` is a KeyboardInterrupt."""

    count = 0
    most: int | None = None


class Prompts:
    """Silent. `interactive`: someone can answer. `moving`: progress is visible.

    present  someone is at the device, can see it and switch it off
    """

    interactive = False
    present = False
    moving = False
    nobody = "Confirmation needed, but this is not an interactive terminal"
    otherwise = "add --yes to confirm, or --dry-run to see the bytes"
    """What is said where nobody can answer, and what to do."""
    refused = "run the command again to confirm it"
    """What to do after a no."""
    unstoppable = ""
    """Why the wish of another process to stop the device is refused just now; "" where it is not."""
    goes_on: Callable[[], Aftermath | None] = staticmethod(lambda: None)
    """What no stop ends just now, such as a calibration; None = nothing. A stop is sent, but is never a success."""

    def say(self, text: str) -> None:
        """A line that stays, e.g. what the wearer has to do now."""

    def instruct(self, text: str) -> None:
        """The same where the command waits for what a person does next, or where that may do harm: said with -q, too."""
        self.say(text)

    def progress(self, text: str, safety: str = "") -> None:
        """A line that replaces the last progress line. Only a terminal shows it.

        `safety` says how the movement can be stopped: it stands first and is never cut off.
        """

    def done(self) -> None:
        """The progress line is over."""

    def ask(self, question: str, word: str) -> bool:
        """Ask yes or no, or for a word to type; without a person the answer is no."""
        return False

    def confirm(self, question: str, word: str, steps: Sequence[Step], changes: Changes | None) -> bool:
        """Ask about these steps, which were shown."""
        return self.ask(question, word)

    def choose(self, question: str, words: Sequence[str]) -> str:
        """The answer if it is one of `words`; "" for any other, and without a person."""
        return ""

    def text(self, question: str) -> str:
        """A line that is typed; "" without a person."""
        return ""

    def wait_for_enter(self, text: str) -> bool:
        """Show an instruction and wait for Enter; False without a person."""
        return False

    @contextmanager
    def count_interrupts(self) -> Iterator[InterruptCount]:
        """While it lasts Ctrl-C is counted instead of acted on: for a procedure that asks before it stops."""
        yield InterruptCount()

    @contextmanager
    def without_interrupts(self) -> Iterator[None]:
        """Delay Ctrl-C while the device is stopped and restored: every step in here has its own deadline."""
        yield

    @contextmanager
    def stopping(self) -> Iterator[None]:
        """The same around the stop itself: the wish of another process for a stop waits for it, too."""
        with self.without_interrupts():
            yield

    @contextmanager
    def stop_if_slow(self, seconds: float, stop: Callable[[], HandctlError]) -> Iterator[None]:
        """When what happens inside lasts longer than `seconds`, call `stop` and raise its error there.

        For output that a reader does not take while motors run. Where the system has no such alarm nothing happens.
        """
        yield


class Progress(Prompts):
    """Says nothing but how far it is, to `show`."""

    def __init__(self, show: Callable[[str], None]) -> None:
        self._show = show

    def progress(self, text: str, safety: str = "") -> None:
        """See Prompts."""
        self._show(text)


def confirms(answer: str, word: str) -> bool:
    """Whether the typed text is the requested word. A decimal may have fewer or more trailing zeros."""
    if answer == word:
        return True
    import re

    decimal = re.compile(r"([+-]?\d+)(?:\.(\d*))?")
    typed, asked = decimal.fullmatch(answer), decimal.fullmatch(word)
    if typed is None or asked is None or asked[2] is None:
        return False
    return typed[1] == asked[1] and (typed[2] or "").rstrip("0") == asked[2].rstrip("0")
