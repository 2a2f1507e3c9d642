"""Questions to a person: only a clear yes is one, a word must be typed as it stands, the end of input is a no."""

from __future__ import annotations

import io
import signal
import sys
import time

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.errors import OutputError
from handctl.model.prompts import confirms
from tests.support.each_row import each_row


class Screen(io.StringIO):
    """A terminal, or a pipe."""

    def __init__(self, text: str = "", *, terminal: bool = True) -> None:
        super().__init__(text)
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


def prompts(monkeypatch: pytest.MonkeyPatch, typed: str, *, stdin: bool = True, stderr: bool = True) -> TerminalPrompts:
    monkeypatch.setattr(sys, "stdin", Screen(typed, terminal=stdin))
    monkeypatch.setattr(sys, "stderr", Screen(terminal=stderr))
    return TerminalPrompts(quiet=False)


@each_row(
    ("typed", "yes"),
    [
        ("y\n", True), ("Y\n", True), ("yes\n", True), (" YES \n", True),
        ("\n", False), ("", False), ("n\n", False), ("ye\n", False), ("yess\n", False), ("ja\n", False), ("1\n", False),
    ],
)  # fmt: skip
def test_only_y_and_yes_are_a_yes(monkeypatch: pytest.MonkeyPatch, typed: str, yes: bool) -> None:
    assert prompts(monkeypatch, typed).ask("Move the hand", "") is yes


@each_row(
    ("typed", "yes"),
    [("reset\n", True), ("reset", True), ("\n", False), ("", False), ("y\n", False), ("yes\n", False), ("res\n", False),
     ("RESET\n", False), ("reset it\n", False)],
)  # fmt: skip
def test_a_word_must_be_typed_as_it_stands(monkeypatch: pytest.MonkeyPatch, typed: str, yes: bool) -> None:
    assert prompts(monkeypatch, typed).ask("Erase everything", "reset") is yes


def test_an_instruction_is_said_with_q_too(capsys: pytest.CaptureFixture[str]) -> None:
    quiet = TerminalPrompts(quiet=True)
    quiet.say("one")
    quiet.instruct("two")
    assert capsys.readouterr().err == "two\n"


@each_row(("stdin", "stderr"), [(True, True), (True, False), (False, True), (False, False)])
def test_a_person_is_there_when_both_ends_are_a_terminal(
    monkeypatch: pytest.MonkeyPatch, stdin: bool, stderr: bool
) -> None:
    made = prompts(monkeypatch, "\n", stdin=stdin, stderr=stderr)
    assert made.interactive is (stdin and stderr)
    assert made.wait_for_enter("Switch the hand off") is (stdin and stderr)


def test_the_end_of_input_is_no_enter(monkeypatch: pytest.MonkeyPatch) -> None:
    assert prompts(monkeypatch, "").wait_for_enter("Switch the hand off") is False


@each_row("name", ["SIGINT", "SIGQUIT", "SIGTERM", "SIGHUP", "SIGTSTP"])
def test_while_presses_are_counted_no_signal_ends_or_stops_the_program(name: str) -> None:
    """Asleep by Ctrl-Z in the middle of a stop, it would not finish stopping the device."""
    number = getattr(signal, name)
    before = signal.getsignal(number)
    with TerminalPrompts(quiet=True).count_interrupts() as presses:
        handler = signal.getsignal(number)
        assert callable(handler) and handler is not before
        handler(number, None)
        handler(number, None)
        assert presses.count == 2
    assert signal.getsignal(number) is before


@pytest.mark.real
def test_the_alarm_of_impatience_is_off_afterwards() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with TerminalPrompts(quiet=True).stop_if_slow(30.0, lambda: OutputError("late")):
        assert 29.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 30.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is before
    with (
        pytest.raises(OutputError, match="late"),
        TerminalPrompts(quiet=True).stop_if_slow(0.01, lambda: OutputError("late")),
    ):
        time.sleep(5)


@each_row(("typed", "word", "yes"), [
    ("15.50", "15.50", True), ("15.5", "15.50", True), ("15", "15.00", True), ("15.500", "15.5", True),
    ("15.05", "15.50", False), ("155.0", "15.50", False), ("16", "15.50", False), ("-15.5", "15.50", False),
    ("", "15.50", False), ("015.5", "15.50", False), ("1.55e1", "15.50", False), ("02", "2", False), ("2.0", "2", False),
    ("reset", "reset", True), ("Reset", "reset", False), ("", "reset", False),
])  # fmt: skip
def test_a_decimal_may_be_typed_with_fewer_or_more_zeros(typed: str, word: str, yes: bool) -> None:
    assert confirms(typed, word) is yes
