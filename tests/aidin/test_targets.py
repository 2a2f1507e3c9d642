"""Targets as a user types them: order, pairs, units, limits by finger, the ramp."""

from __future__ import annotations

import pytest

from handctl.devices.aidin.motion import Goal, axes_of, parse, ramp
from handctl.devices.aidin.parameter_map import ANGLES, CURRENTS, ENCODERS, TIPS
from handctl.errors import CheckFailed, UsageError
from handctl.model.movement import AxisReading, Stillness, Watch
from tests.support.each_row import each_row
from tests.support.refused import refused

FIFTEEN = ["10", "5", "118", "-4", "5", "165", "0", "5", "165", "4", "5", "165", "8", "5", "165"]
OPEN = [-13.0, 0.0, 154.0, 154.0] + [-45.0, 0.0, 175.0, 175.0] * 4


def test_joints_without_q4_are_mirrored() -> None:
    goal = parse(ANGLES, FIFTEEN)
    assert goal.names_all
    values = goal.complete(None)
    assert values[:8] == [10, 5, 118, 118, -4, 5, 165, 165]
    assert goal.wire(values)[:8] == (0.174533, 0.087266, 2.059489, 2.059489, -0.069813, 0.087266, 2.879793, 2.879793)


def test_joints_with_q4_go_as_given() -> None:
    goal = parse(
        ANGLES,
        [
            "10",
            "5",
            "118",
            "90",
            "-4",
            "5",
            "165",
            "91",
            "0",
            "5",
            "165",
            "92",
            "4",
            "5",
            "165",
            "93",
            "8",
            "5",
            "165",
            "94",
        ],
    )
    assert goal.complete(None)[3::4] == [90, 91, 92, 93, 94]


def test_pairs_keep_the_others_where_they_are() -> None:
    goal = parse(ANGLES, ["index.q3=160", "thumb.q1=-4.5"])
    assert not goal.names_all
    values = goal.complete(OPEN)
    assert values[:8] == [-4.5, 0, 154, 154, -45, 0, 160, 160]
    assert values[8:] == OPEN[8:]
    with pytest.raises(UsageError):
        goal.complete(None)
    with pytest.raises(KeyError):  # never a 0 in the place of what was not measured
        goal.complete([])


def test_names_are_not_case_sensitive() -> None:
    assert parse(ENCODERS, ["Index.M3=85000"]).named == {5: 85000}


def test_what_is_kept_may_jitter_at_its_stop_and_no_more() -> None:
    here = [0.0] * 15
    here[0] = -2800.0
    assert parse(ENCODERS, ["index.m3=1"]).complete(here)[0] == 0
    here[0] = -2801.0
    with refused(CheckFailed, "kept-out-of-range", "thumb.m1", "-2801"):
        parse(ENCODERS, ["index.m3=1"]).complete(here)
    here[0] = 282800.0
    assert parse(ENCODERS, ["index.m3=1"]).complete(here)[0] == 280000
    here[0] = 282801.0
    with refused(CheckFailed, "kept-out-of-range", "thumb.m1", "282801"):
        parse(ENCODERS, ["index.m3=1"]).complete(here)


def test_radians() -> None:
    goal = parse(ANGLES, ["thumb.q1=-0.226893", "index.q3=3.054327", "ring.q2=0.5"], rad=True)
    assert goal.wire(goal.complete(OPEN))[0] == -0.226892
    assert goal.named[6] == 175
    assert goal.wire(goal.complete(OPEN))[13] == 0.5


ALL_ZERO = ["0"] * 20
WRONG = [
    (ANGLES, ALL_ZERO, "all zeros"), (ANGLES, ["0.0"] * 15, "all zeros"),
    (ANGLES, ["index.q3=114.9"], "index.q3 = 114.9 deg is out of range"), (ANGLES, ["index.q3=175.1"], "out of range"),
    (ANGLES, ["thumb.q3=155"], "thumb.q3"), (ANGLES, ["thumb.q3=81"], "thumb.q3"), (ANGLES, ["thumb.q1=-14"], "thumb.q1"),
    (ANGLES, ["index.q1=-46"], "index.q1"), (ANGLES, ["ring.q2=31"], "ring.q2"),
    (ANGLES, ["index.q4=160"], "coupled"), (ANGLES, ["index.q3=nan"], "not a number"), (ANGLES, ["index.q3=1_0"], "not a number"),
    (ANGLES, ["index.q3=inf"], "not a number"), (ANGLES, ["index.q3="], "not a number"), (ANGLES, ["q3=160"], "has no element"),
    (ANGLES, ["index.q3=160", "index.q3=161"], "twice"), (ANGLES, ["index.q3=160", "10"], "mixed"),
    (ANGLES, ["1"] * 16, "16 values given, hand_joint_cmd takes 20 or 15"), (ANGLES, ["index.m1=5"], "has no element"),
    (ENCODERS, ["0"] * 14, "14 values given, hand_TP_cmd takes 15"), (ENCODERS, ["thumb.m1=280001"], "out of range"),
    (ENCODERS, ["index.m3=170001"], "out of range"), (ENCODERS, ["index.m3=-1"], "out of range"),
    (ENCODERS, ["index.m3=1.5"], "whole"),
    (TIPS, ["0"] * 15, "out of range"), (TIPS, ["thumb.y=45.4"], "thumb.y"), (TIPS, ["index.y=2.5"], "index.y"),
    (TIPS, ["thumb.z=12.9"], "thumb.z"), (TIPS, ["ring.x=51.5"], "ring.x"), (TIPS, ["ring.z=149.6"], "ring.z"),
    (CURRENTS, ["index.m1=1001"], "out of range"),
]  # fmt: skip


@each_row(("target", "texts", "what"), WRONG)
def test_refused(target: object, texts: list[str], what: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse(target, texts)  # type: ignore[arg-type]
    assert what in caught.value.text


def test_all_zeros_are_refused_with_the_reason_and_both_ranges() -> None:
    with pytest.raises(UsageError) as caught:
        parse(ANGLES, ALL_ZERO)
    assert caught.value.exit_code == 2
    for words in ("q3", "82..154", "115..175", "180 is straight"):
        assert words in caught.value.hint


def test_the_other_unit_is_named_when_it_would_fit() -> None:
    with pytest.raises(UsageError) as caught:
        parse(
            ANGLES,
            [
                "0.17",
                "0.09",
                "2.06",
                "-0.07",
                "0.09",
                "2.88",
                "0",
                "0.09",
                "2.88",
                "0.07",
                "0.09",
                "2.88",
                "0.14",
                "0.09",
                "2.88",
            ],
        )
    assert "--rad" in caught.value.hint
    with pytest.raises(UsageError) as caught:
        parse(ANGLES, FIFTEEN, rad=True)
    assert "leave --rad out" in caught.value.hint


def test_the_cap_of_currents() -> None:
    assert parse(CURRENTS, ["index.m1=-300"], cap=300).named == {3: -300}
    with pytest.raises(UsageError, match="cap of 300"):
        parse(CURRENTS, ["index.m1=301"], cap=300)


def test_ramp() -> None:
    """60 degrees a second at 50 Hz are 1.2 degrees an object; the last one is the target itself."""
    goal = parse(ANGLES, ["index.q3=163", "thumb.q1=-7"])
    values = goal.complete(OPEN)
    way = ramp(goal, OPEN, values, 0.02)
    assert len(way) == 10
    assert way[-1] == tuple(values)
    assert [round(step[6], 4) for step in way] == [round(175 - 1.2 * n, 4) for n in range(1, 11)]
    assert [round(step[0], 4) for step in way][:2] == [-12.4, -11.8]
    assert ramp(goal, values, values, 0.02) == [tuple(values)]


def test_the_coupled_joint_does_not_set_the_pace() -> None:
    """q4 follows q3 whatever is sent: where it is told to be far from its target, the others are not slowed down."""
    goal = parse(ANGLES, ["index.q3=163"])
    values = goal.complete(OPEN)
    q4 = ANGLES.command.elements.index("index.q4")
    here = [*OPEN[:q4], 10.0, *OPEN[q4 + 1 :]]
    assert len(ramp(goal, here, values, 0.02)) == len(ramp(goal, OPEN, values, 0.02)) == 10


def test_a_ramp_begins_within_the_range() -> None:
    goal = parse(ENCODERS, ["0"] * 15)
    start = [-5000.0] + [0.0] * 14
    assert ramp(goal, start, goal.complete(None), 0.02) == [(0.0,) * 15]


def off(goal: Goal, values: list[float], here: list[float]) -> list[str]:
    """The elements that one look finds away from their targets."""
    watch = Watch(axes_of(goal, values), Stillness(samples=1, seconds=0.0), 0.0)
    watch.note(0.0, {name: AxisReading(place) for name, place in zip(goal.target.command.elements, here, strict=True)})
    return [one.goal.name for one in watch.arrivals() if one.verdict != "reached"]


def test_how_near_is_there() -> None:
    goal = parse(ANGLES, ["index.q3=160"])
    values = goal.complete(OPEN)
    assert off(goal, values, values) == []
    here = [*values[:6], 162.1, 0.0, *values[8:]]
    assert off(goal, values, here) == ["index.q3"]  # q4 does not count
    here[6] = 161.9
    assert off(goal, values, here) == []
    power = parse(CURRENTS, ["0"] * 14 + ["200"])
    assert off(power, [0.0] * 14 + [200.0], [20.0] * 14 + [159.0]) == ["little.m3"]
