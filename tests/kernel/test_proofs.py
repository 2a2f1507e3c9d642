"""When an experiment shows a fact: the rules of `model.proofs`, on a device that is a list of answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.errors import DeviceRefused, HandctlError, Interrupted, LinkError, NoAnswer
from handctl.model.prompts import Prompts
from handctl.model.proofs import (
    AS_ASSUMED,
    DIFFERS,
    MOVE,
    NOT_SHOWN,
    PERMANENT,
    READ,
    REFUSED,
    WRITE_BACK,
    Observation,
    Outcome,
    Proof,
    SignOfHarm,
    carry_out,
)
from handctl.model.result import Journal
from handctl.model.stop_sequence import Stopped
from tests.support.each_row import each_row

FAILS = {
    "silent": NoAnswer("n", hint="h"),
    "refused": DeviceRefused("r", hint="h"),
    "lost": LinkError("l", hint="h"),
    "own": HandctlError("o", hint="h"),
    "harm": SignOfHarm("s", hint="h"),
}


def outcome(*answers: Any, level: str = READ, healthy: Callable[[], object] = lambda: None, **more: Any) -> Outcome:
    """What comes of answers in this order, the last of them again and again; a word of FAILS raises."""
    rest: Iterator[Any] = iter(answers)
    device = SimpleNamespace(journal=Journal(), last=None, stop=more.pop("stop", None))

    def ask(_device: Any, _prompts: Prompts | None = None) -> Observation:
        device.last = next(rest, device.last)
        if device.last in FAILS:
            raise FAILS[device.last]
        return Observation(device.last, "as asked")

    proof = Proof("fact", "not documented", more.pop("assumed", 4), "asked", ask, level, **more)
    return carry_out(proof, device, healthy, 3, Prompts())


def test_repetitions_that_disagree_show_nothing() -> None:
    assert outcome(4, 4, 4, 4, 5, 5).why == "disagrees"
    assert outcome(10, 10, 12, 12, 11, 11, measured=True).value == 11
    assert outcome(10, 10, 40, 40, measured=True).why == "disagrees"


def test_a_verdict_is_drawn_from_what_agrees() -> None:
    assert (outcome(4).verdict, outcome(4).times) == (AS_ASSUMED, 3)
    assert outcome(5).verdict == DIFFERS
    assert outcome(5, assumed=(4, 5)).verdict == outcome(5, assumed=()).verdict == AS_ASSUMED
    assert [outcome(value, limit="most").verdict for value in (3, 4, 5)] == [AS_ASSUMED, AS_ASSUMED, DIFFERS]
    assert [outcome(value, limit="least").verdict for value in (3, 4, 5)] == [DIFFERS, AS_ASSUMED, AS_ASSUMED]
    assert outcome(None).why == "no-sign"
    assert outcome("refused").verdict == REFUSED


def test_a_spoiled_attempt_is_made_again_a_few_times_only() -> None:
    assert outcome(4, 5, 4).verdict == AS_ASSUMED, "one attempt that did not end alike twice"
    assert outcome("silent", 4).verdict == AS_ASSUMED
    assert outcome("refused", "silent").verdict == NOT_SHOWN, "silence is no refusal"
    assert outcome(4, 5, 4, 5, 4, 5).verdict == NOT_SHOWN

    def unhealthy() -> None:
        raise FAILS["silent"]

    assert outcome(4, healthy=unhealthy).verdict == NOT_SHOWN


@each_row(("level", "attempts"), [(MOVE, 1), (PERMANENT, 1), (WRITE_BACK, 3)])
def test_what_moves_or_stays_is_not_done_again_on_a_disturbed_line(level: str, attempts: int) -> None:
    journal, asked = Journal(), []

    def ask(_device: Any, _prompts: Prompts | None = None) -> Observation:
        asked.append(level)
        journal.counters.stray_bytes += 1
        return Observation(4, "as asked")

    device = SimpleNamespace(journal=journal, stop=None)
    found = carry_out(Proof("fact", "", 4, "asked", ask, level), device, lambda: None, 3, Prompts())
    assert (found.verdict, found.why, len(asked)) == (NOT_SHOWN, "disturbed", attempts)


@each_row("level", [READ, WRITE_BACK, MOVE])
def test_a_sign_of_harm_ends_it_whatever_the_level(level: str) -> None:
    with pytest.raises(SignOfHarm):
        outcome("harm", level=level)


def test_what_writes_or_moves_fails_with_its_error() -> None:
    for level in (WRITE_BACK, MOVE):
        for word in ("silent", "refused", "own"):
            with pytest.raises(type(FAILS[word])):
                outcome(word, level=level)
    assert outcome("own").verdict == NOT_SHOWN
    with pytest.raises(LinkError):
        outcome("lost")


def test_ctrl_c_between_two_movements_stops_the_device() -> None:
    stopped: list[bool] = []

    def stop() -> Stopped:
        stopped.append(True)
        return Stopped("stopped")

    def pressed() -> None:
        raise KeyboardInterrupt

    with pytest.raises((Interrupted, KeyboardInterrupt)) as ended:
        outcome(4, level=MOVE, healthy=pressed, stop=stop)
    assert (stopped, ended.type) == ([True], Interrupted)
    with pytest.raises(KeyboardInterrupt):
        outcome(4, healthy=pressed, stop=stop)
    assert stopped == [True], "what only reads has nothing to stop"
