"""`aidin home` is judged per motor by the way of its encoder: the hand sets 0 wherever a finger stands."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.cli import Result, run

ALL = 15


def home(**options: str) -> Result:
    query = "&".join(f"{key}={value}" for key, value in {"clock": "virtual", **options}.items())
    said = ["--exchange", "command"] if options.get("exchange") == "command" else []  # such a hand shows nothing before
    return run("aidin", "home", "-y", "--json", "-p", f"fake://aidin?{query}", *said)


def states(result: Result) -> list[str]:
    return [step["state"] for step in result.json["writes"]]


@pytest.mark.parametrize("start", ["used", "homed", "cold"])
def test_fingers_that_move_to_their_stop_are_homed(start: str) -> None:
    result = home(start=start)
    assert (result.code, states(result)) == (0, ["confirmed"]), result
    assert "homed" in result.codes()


@pytest.mark.parametrize("exchange", ["stream", "poll", "command"])
@pytest.mark.parametrize("rate", ["100", "20"])
def test_so_they_are_however_the_hand_speaks(exchange: str, rate: str) -> None:
    result = home(start="used", exchange=exchange, rate=rate)
    assert (result.code, states(result)) == (0, ["confirmed"]), result


@pytest.mark.parametrize("start", ["used", "homed"])
def test_motors_that_never_moved_are_no_success(start: str) -> None:
    result = home(start=start, fault="blocked")
    assert (result.code, states(result)) == (7, ["sent"]), result
    assert result.error["code"] == "not-homed"
    assert "of 15 motors never moved" in result.error["text"]


def test_the_motor_that_did_not_move_is_named() -> None:
    result = home(start="used", fault="dead-motor")
    assert (result.code, states(result)) == (7, ["sent"]), result
    assert "1 of 15 motors never moved" in result.error["text"]
    assert "ring.m3" in result.error["text"]


def test_after_power_on_the_motors_that_did_not_move_are_a_note_with_names() -> None:
    result = home(start="cold", fault="dead-motor")
    assert (result.code, states(result)) == (0, ["sent"]), result
    (note,) = [message for message in result.json["messages"] if message["code"] == "nothing-moved"]
    assert "these did not move: ring.m3" in note["text"]


@pytest.mark.parametrize("options", [{"start": "cold", "fault": "blocked"}, {"start": "open"}])
def test_nothing_that_moved_at_0_proves_nothing(options: dict[str, Any]) -> None:
    result = home(**options)
    assert (result.code, states(result)) == (0, ["sent"]), result
    assert "nothing-moved" in result.codes()
    assert "homed" not in result.codes()
