"""`aidin home` is judged per motor by where it rested before the hand set 0 there."""

from __future__ import annotations

from typing import Any

import pytest

from handctl.devices.aidin.homing_and_bias import NOT_ZEROED, ZEROED_THERE, Travel, Verdict, stroke
from handctl.devices.aidin.homing_and_bias import home as drive_home
from handctl.model.prompts import Prompts
from tests.aidin.support import Streamer, feedback, hand_on, line
from tests.support.cli import Result, run
from tests.support.each_row import each_row

ALL = 15


def home(**options: str) -> Result:
    query = "&".join(f"{key}={value}" for key, value in {"clock": "virtual", "rate": "20", **options}.items())
    said = ["--exchange", "command"] if options.get("exchange") == "command" else []  # such a hand shows nothing before
    return run("aidin", "home", "-y", "--json", "-p", f"fake://aidin?{query}", *said)


def states(result: Result) -> list[str]:
    return [step["state"] for step in result.json["writes"]]


def doubted(result: Result) -> dict[str, str]:
    """Motors that are not shown to be open, with their verdicts."""
    return {
        f"{row['finger']}.{row['element']}": row["verdict"]
        for row in result.rows
        if row["verdict"] not in ("open", "whole stroke")
    }


def test_fingers_that_rest_where_an_earlier_homing_set_0_are_homed() -> None:
    result = home(start="homed")
    assert (result.code, states(result)) == (0, ["confirmed"]), result
    assert "homed" in result.codes() and not doubted(result)
    assert all(row["way"] == row["from"] - row["rest"] for row in result.rows)


@pytest.mark.parametrize("exchange", ["stream", "poll", "command"])
@pytest.mark.parametrize("rate", ["100", "20", "5"])
def test_so_they_are_however_the_hand_speaks(exchange: str, rate: str) -> None:
    result = home(start="homed", exchange=exchange, rate=rate)
    assert (result.code, states(result)) == (0, ["confirmed"]), result


@pytest.mark.parametrize(
    "options", [{"start": "used"}, {"start": "cold"}, {"start": "open"}, {"start": "cold", "fault": "blocked"}]
)
def test_a_first_homing_proves_nothing(options: dict[str, str]) -> None:
    """Where the encoders counted from is not known, so a place where all rested is no evidence of the open stop."""
    result = home(**options)
    assert (result.code, states(result)) == (7, ["sent"]), result
    assert result.error["code"] == "homing-unproven"
    assert len(doubted(result)) == ALL and set(doubted(result).values()) == {"unproven"}
    assert "homed" not in result.codes()


def test_a_second_homing_confirms_the_first(tmp_path: Any) -> None:
    link = f"fake://aidin?clock=virtual&rate=20&start=cold&state={tmp_path / 'hand'}"
    assert run("aidin", "home", "-y", "-p", link).code == 7
    assert run("aidin", "encoders", *[f"{finger}.m{n}=40000" for finger in ("thumb", "index", "middle", "ring", "little") for n in (1, 2, 3)], "-p", link).code == 0  # fmt: skip
    assert run("aidin", "home", "-y", "-p", link).code == 0


def test_a_motor_that_never_left_its_0_proves_nothing(tmp_path: Any) -> None:
    """That another one came back to 0 shows nothing of it: an obstacle may hold it there since power-on."""
    link = f"fake://aidin?clock=virtual&start=open&state={tmp_path / 'hand'}"
    assert run("aidin", "encoders", "index.m1=20000", "-p", link).code == 0
    result = run("aidin", "home", "-y", "--json", "-p", link)
    assert (result.code, states(result), result.error["code"]) == (7, ["sent"], "homing-unproven"), result
    assert len(doubted(result)) == ALL - 1 and "index.m1" not in doubted(result)
    assert set(doubted(result).values()) == {"unproven"}


@pytest.mark.parametrize("start", ["used", "homed"])
def test_motors_that_never_moved_are_no_success(start: str) -> None:
    result = home(start=start, fault="blocked")
    assert (result.code, states(result), result.error["code"]) == (7, ["sent"], "not-homed"), result
    assert len(doubted(result)) == ALL


@pytest.mark.parametrize("start", ["used", "homed", "cold"])
def test_the_motor_that_did_not_move_is_named(start: str) -> None:
    result = home(start=start, fault="dead-motor")
    assert (result.code, result.error["code"]) == (7, "not-homed"), result
    assert doubted(result)["ring.m3"] == "hardly moved"
    assert "ring.m3" in result.error["text"]


@pytest.mark.parametrize(
    ("options", "verdict"),
    [
        ({"fault": "held", "give": "450"}, "hardly moved"),
        ({"fault": "held", "give": "20000"}, "stopped short"),
        ({"fault": "held", "give": "120000"}, "stopped short"),
        ({"fault": "stall", "stall-at": "20"}, "stopped short"),
        ({"fault": "stall", "stall-at": "60"}, "stopped short"),
        ({"fault": "stall", "stall-at": "90"}, "stopped short"),
        ({"fault": "creep", "creep": "1000"}, "still moving"),
        ({"fault": "creep", "creep": "5000"}, "still moving"),
        ({"fault": "creep", "creep": "100000"}, "not at 0"),
    ],
)  # fmt: skip
def test_a_motor_that_disagrees_with_its_neighbours_is_named(options: dict[str, str], verdict: str) -> None:
    """A little, middling and much, on a motor with a long way."""
    result = home(start="homed", motor="9", **options)
    assert (result.code, states(result), result.error["code"]) == (7, ["sent"], "not-homed"), result
    assert doubted(result) == {"ring.m1": verdict}


@pytest.mark.parametrize("seed", ["1", "2", "3", "4"])
@pytest.mark.parametrize("start", ["used", "homed", "cold"])
def test_no_motor_that_is_held_on_its_way_is_homed(seed: str, start: str) -> None:
    for fault in ("held", "stall"):
        assert home(start=start, fault=fault, seed=seed).code == 7


def _travel(*places: tuple[float, int]) -> Verdict:
    """The verdict on ring.m1, whose neighbours all go from half their stroke to 0 in 2 s."""
    seen = Travel()
    for at, place in places:
        others = [round(max(0.0, 0.5 - at / 4) * stroke(index)) for index in range(ALL)]
        seen.note(at, tuple(place if index == 9 else other for index, other in enumerate(others)))
    return seen.ways(zeroed=2.5)[9].verdict


@each_row(
    ("places", "verdict"),
    [
        ([(0.0, 400000), (1.0, 200000), (2.0, 10000), (2.4, 8000), (3.0, 8000), (3.1, 0)], Verdict.OPEN),
        ([(0.0, 440000), (1.0, 200000), (2.0, 12000), (2.6, 12000), (3.0, 12000), (3.1, 0)], Verdict.SHORT),
        ([(0.0, 440000), (1.0, 200000), (2.0, 12000), (2.9, 8000), (3.0, 8000), (3.1, 0)], Verdict.MOVING),
        ([(0.0, 400000), (1.0, 200000), (2.0, -40000), (2.9, -40000), (3.0, -40000), (3.1, 0)], Verdict.STROKE),
        ([(0.0, 300000), (1.0, 200000), (2.0, -40000), (2.9, -40000), (3.0, -40000), (3.1, 0)], Verdict.BEYOND),
        ([(0.0, 300000), (3.0, 8000), (3.1, 0)], Verdict.MOVING),
        ([(0.0, 300000), (1.0, 0), (2.0, 0), (3.1, 5000)], Verdict.OFF),
    ],
)  # fmt: skip
def test_verdicts(places: list[tuple[float, int]], verdict: Verdict) -> None:
    assert _travel(*places) is verdict


@each_row(
    "name, rest, told, not_told",
    lambda: [
        ("none is at 0", [153565] * ALL, NOT_ZEROED, ZEROED_THERE),
        ("one is not at 0, and one gave a little", [153565, *[0] * (ALL - 1)], ZEROED_THERE, ""),
        ("one gave a little", [0] * ALL, ZEROED_THERE, NOT_ZEROED),
    ],
)
def test_only_a_motor_that_is_at_0_was_set_to_0_where_it_rested(
    name: str, rest: list[int], told: str, not_told: str
) -> None:
    """A slow hand goes on opening; what it shows then is neither 0 nor where it rested."""
    way = [280000, 280000, 210000, *[440000, 440000, 170000] * 4]
    begin = [way[0] // 2, way[1] // 4, *way[2:]]  # the thumb's m2 never moves, the others go their whole way

    def content(t: float) -> dict[str, object]:
        places = [round(full - min(t, 2.5) / 2.5 * full) for full in begin]
        places[1] = begin[1]
        return feedback(motor_pos=rest if t > 3.4 else places, current_state=[0] * ALL)

    table = drive_home(hand_on(Streamer(lambda t: line(content(t)))), Prompts())
    assert table.failure is not None and table.failure.code == "not-homed", name
    hint = table.failure.hint.casefold()
    assert told in hint, (name, hint)
    assert not not_told or not_told not in hint, (name, hint)
