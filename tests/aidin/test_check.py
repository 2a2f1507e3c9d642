"""`aidin check`: each fault is found where it is, a healthy hand has none, and a hand that is not ready is not moved."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from handctl.devices.aidin.motor_and_sensor_check import FINDINGS, check
from handctl.errors import CheckFailed, Interrupted, NoAnswer, ProtocolError
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from tests.aidin.support import AT_ORIGIN, STOP, feedback, hand_on, line, objects, simulated, stopped_behind, streamer
from tests.aidin.support import Streamer as Hand
from tests.support.cli import run, spying
from tests.support.each_row import each_row
from tests.support.refused import refused

FINGERS = ("thumb", "index", "middle", "ring", "little")
STROKES = [280000, 280000, 210000, *[440000, 440000, 170000] * 4]


def found(table: Table) -> dict[str, str]:
    """The findings of a table by the name of their check."""
    return {row["check"]: row["finding"] for row in table.rows if row["status"] in ("warning", "fail")}


def checked(**options: object) -> Table:
    hand, _ = simulated(**{"start": "open", "rate": 20, **options})
    return check(hand, Prompts())


# -- a healthy hand ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rate": 20, "noise": 1},
        {"rate": 3},
        {"rate": 100, "noise": 1},
        {"exchange": "poll", "noise": 1, "objects": "separate"},
        {"fault": "weak", "q4": "half", "load": 0},
    ],
    ids=str,
)
def test_a_healthy_hand_has_no_finding(options: dict[str, object]) -> None:
    table = checked(**options)
    assert (found(table), table.failure) == ({}, None)
    motors = [row for row in table.rows if row["check"].startswith("motor.")]
    assert [row["status"] for row in motors] == ["ok"] * 15
    assert all(abs(row["off"]) < 0.001 * stroke for row, stroke in zip(motors, STROKES, strict=True))


def test_of_a_hand_that_was_just_homed_too() -> None:
    hand, link = simulated(start="homed", noise=1, rate=20)
    from handctl.devices.aidin.homing_and_bias import home

    home(hand, Prompts())
    assert found(check(hand, Prompts())) == {}
    assert link.sent[-1] != STOP


def test_each_motor_moves_alone_and_within_its_range() -> None:
    hand, link = simulated(start="open", rate=20)
    check(hand, Prompts())
    sent = objects([data for data in link.sent if b"hand_TP_cmd" in data])
    assert {one["hand_mode"] for one in sent} == {10}
    targets = [one["hand_TP_cmd"] for one in sent]
    assert all(sum(value > 0 for value in one) <= 1 for one in targets)  # type: ignore[attr-defined]
    most = [max(one[at] for one in targets) for at in range(15)]  # type: ignore[index]
    assert most == [round(0.04 * stroke) for stroke in STROKES] and targets[-1] == [0] * 15


# -- faults -----------------------------------------------------------------------------------------------------------

FAULTS: dict[str, tuple[dict[str, object], dict[str, str]]] = {
    "dead motor": ({"fault": "dead-motor"}, {"motor.ring.m3": "no-current"}),
    "stuck encoder": ({"fault": "stuck"}, {"motor.index.m2": "encoder-stuck"}),
    "swapped fingers": (
        {"fault": "swapped"},
        {f"motor.{finger}.m{at}": "swapped" for finger in ("index", "middle") for at in (1, 2, 3)},
    ),
    "stiff motor": ({"fault": "stiff", "motor": 10, "noise": 1}, {"motor.ring.m2": "current-high"}),
    "stiff motor of the thumb, polled": ({"fault": "stiff", "motor": 0, "exchange": "poll"}, {"motor.thumb.m1": "current-high"}),
    "one way": ({"fault": "one-way", "motor": 5}, {"motor.index.m3": "not-back"}),
    "noisy sensor": ({"fault": "shaky-sensor", "noise": 1}, {"sensor.ring": "sensor-noisy"}),
    "still sensor": ({"fault": "numb-sensor", "noise": 1}, {"sensor.middle": "sensor-still"}),
    "drift": ({"drift": 300, "noise": 1}, dict.fromkeys((f"sensor.{finger}" for finger in FINGERS), "sensor-drift")),
    "blocked hand": ({"fault": "blocked"}, {f"motor.{finger}.m1": "blocked" for finger in FINGERS}),
    "not homed since power-on": ({"start": "cold"}, {"motors": "no-movement"}),
    "frozen feedback": ({"fault": "frozen"}, {"motors": "no-movement"}),
}  # fmt: skip


@each_row("name", FAULTS)
def test_each_fault_is_found_and_nothing_else(name: str) -> None:
    options, wanted = FAULTS[name]
    hand, link = simulated(**{"start": "open", "rate": 10, **options})
    table = check(hand, Prompts())
    assert found(table) == wanted
    assert table.failure is not None and table.failure.code == "findings"
    assert STOP not in link.sent and all(row["remedy"] for row in table.rows if row["check"] in wanted)


def test_swapped_channels_name_what_moved_instead() -> None:
    others = {row["check"]: row["others"] for row in checked(fault="swapped").rows if "others" in row}
    assert others["motor.index.m2"] == ["middle.m2"] and others["motor.middle.m2"] == ["index.m2"]


def at_once(change: Callable[[list[int]], list[int]], currents: Callable[[list[int]], list[int]] | None = None) -> Hand:
    """A hand that is where it was told to be at once, but for what `change` makes of its encoders."""
    target = [0] * 15
    link = Hand(
        lambda _: line(feedback(motor_pos=change(target), current_state=(currents or (lambda _: [0] * 15))(target))),
        period=0.05,
    )
    write = link.write

    def heard(data: bytes, deadline: object) -> None:
        if b"hand_TP_cmd" in data:
            target[:] = objects([data])[0]["hand_TP_cmd"]  # type: ignore[assignment,call-overload]
        write(data, deadline)  # type: ignore[arg-type]

    link.write = heard  # type: ignore[method-assign,assignment]
    return link


@pytest.mark.parametrize(
    ("change", "finding"),
    [
        (lambda at: [*at[:3], -at[3], *at[4:]], "reversed"),
        (lambda at: [*at[:3], at[3] // 2, *at[4:]], "short"),
        (lambda at: [*at[:4], at[4] + at[3], *at[5:]], "coupled"),
    ],
)
def test_a_motor_that_goes_elsewhere(change: Callable[[list[int]], list[int]], finding: str) -> None:
    assert found(check(hand_on(at_once(change)), Prompts())) == {"motor.index.m1": finding}


def test_a_motor_that_draws_hardly_any_current() -> None:
    moved = at_once(lambda at: at, lambda at: [0 if index == 7 else 60 * (value > 0) for index, value in enumerate(at)])
    assert found(check(hand_on(moved), Prompts())) == {"motor.middle.m2": "current-low"}


def test_a_blocked_finger_is_sent_back_at_once_and_left_alone() -> None:
    """Something holds the third motor of the index finger on its way; the rest of the hand is looked at all the same."""
    with spying() as spy:
        hand, link = simulated(start="open", rate=50)
    device = spy.lines[-1].device
    device.hand.motors[5].ceiling = 1000.0
    table = check(hand, Prompts())
    assert found(table) == {"motor.index.m3": "blocked"}
    assert max(one["hand_TP_cmd"][5] for one in objects(link.sent) if "hand_TP_cmd" in one) < 6800  # type: ignore[index]
    device.hand.motors[3].jammed = True
    table = check(hand, Prompts())
    assert found(table) == {"motor.index.m1": "blocked"}
    assert [row["finding"] for row in table.rows if row.get("finger") == "index" and "element" in row] == [
        "blocked",
        "left-alone",
        "left-alone",
    ]


# -- refused ----------------------------------------------------------------------------------------------------------


@each_row(
    ("content", "code"),
    [
        (feedback(motor_pos=[0] * 4 + [-50000] + [0] * 10), "not-homed"),
        (feedback(motor_pos=[500000] * 15), "not-homed"),
        (feedback(motor_pos=[0] * 5 + [4000] + [0] * 9), "not-open"),
        ({**AT_ORIGIN, "current_state": [0] * 14 + [-260]}, "loaded"),
    ],
)
def test_a_hand_that_is_not_ready_is_not_moved(content: dict[str, object], code: str) -> None:
    link = streamer(content)
    with refused(CheckFailed, code):
        check(hand_on(link), Prompts())
    assert link.sent == []


def test_a_finger_that_somebody_moves_is_not_driven() -> None:
    link = Hand(lambda t: line(feedback(motor_pos=[0] * 14 + [0 if t < 1.5 else 300])))
    with refused(CheckFailed, "moving"):
        check(hand_on(link), Prompts())
    assert link.sent == []


def test_a_silent_hand_is_not_moved_and_one_that_falls_silent_is_stopped() -> None:
    hand, link = simulated(start="open", exchange="mute")
    with refused(NoAnswer, "no-answer"):
        check(hand, Prompts())
    assert set(link.sent) <= {b"{}\n"}
    quiet = Hand(lambda t: line(AT_ORIGIN) if t < 3.0 else b"")
    with refused(NoAnswer, "no-answer"):
        check(hand_on(quiet), Prompts())
    assert b"hand_TP_cmd" in stopped_behind(quiet.sent)


def test_ctrl_c_stops_the_hand() -> None:
    hand, link = simulated(start="open", rate=20)
    link.interrupt_at = 5.0
    with pytest.raises(Interrupted) as caught:
        check(hand, Prompts())
    assert b"hand_TP_cmd" in stopped_behind(link.sent) and caught.value.exit_code == 130


def test_it_asks_first_and_a_dry_run_shows_each_motor() -> None:
    place = "fake://aidin?clock=virtual&start=open&rate=20"
    assert run("aidin", "check", "-p", place, "--json").code == 8
    shown = run("aidin", "check", "-n", "-p", place, "--json")
    assert (shown.code, len(shown.rows)) == (0, 16)
    done = run("aidin", "check", "-y", "-p", place, "--json")
    assert (done.code, [one["state"] for one in done.json["writes"]]) == (0, ["confirmed"])
    assert {row["finding"] for row in done.rows} <= {None, *FINDINGS}


# -- a hand that goes elsewhere ---------------------------------------------------------------------------------------

Seen = Callable[[int, list[int]], dict[str, object]]
"""Feedback of a hand that is where it was told to be, from how often a target with a motion came, and the target."""


def disturbed(seen: Seen) -> tuple[Hand, list[int]]:
    """Such a hand, and the target that it got last."""
    target, moved = [0] * 15, [0]
    link = Hand(lambda _: line(seen(moved[0], list(target))), period=0.05)
    write = link.write

    def heard(data: bytes, deadline: object) -> None:
        if b"hand_TP_cmd" in data:
            target[:] = objects([data])[0]["hand_TP_cmd"]  # type: ignore[assignment,call-overload]
            moved[0] += any(target)
        write(data, deadline)  # type: ignore[arg-type]

    link.write = heard  # type: ignore[method-assign,assignment]
    return link, target


def told(at: list[int], **changes: object) -> dict[str, object]:
    return feedback(motor_pos=at, current_state=[0] * 15, **changes)


def turned(at: list[int]) -> list[float]:
    """Joints of which one turns with a motor of another finger."""
    joints = [0.0] * 20
    joints[8] = at[3] / 440000 * 20
    return joints


ASTRAY: dict[str, Seen] = {
    "the encoder of a motor that stands jumps": lambda n, at: told([*at[:8], at[8] - 20000 * (n > 5), *at[9:]]),
    "that of the motor that moves": lambda n, at: told([at[0] - 35000 * (n > 5), *at[1:]]),
    "all encoders are set to 0 at the far end": lambda n, at: told([at[0] * (n < 10), *at[1:]]),
    "another motor runs away": lambda n, at: told([*at[:3], at[3] + min(n * 9000, 440000), *at[4:]]),
    "another finger turns": lambda n, at: told(at, joint_pos=turned(at)),
}


@each_row("name", ASTRAY)
def test_a_hand_that_goes_where_no_way_leads_is_stopped(name: str) -> None:
    link, _ = disturbed(ASTRAY[name])
    with refused(CheckFailed, "astray"):
        check(hand_on(link), Prompts())
    assert link.sent[-1] == STOP


@pytest.mark.parametrize("key", ["current_state", "joint_pos"])
def test_a_hand_that_no_longer_tells_what_is_judged_is_stopped(key: str) -> None:
    def seen(n: int, at: list[int]) -> dict[str, object]:
        return {name: value for name, value in told(at).items() if n == 0 or name != key}

    link, _ = disturbed(seen)
    with refused(ProtocolError, "missing-key"):
        check(hand_on(link), Prompts())
    assert link.sent[-1] == STOP


def test_a_motor_that_was_away_for_a_moment_moved_as_well() -> None:
    link, _ = disturbed(lambda n, at: told([*at[:8], at[8] + 5000 * (4 < n < 8), *at[9:]]))
    rows = {row["check"]: row["finding"] for row in check(hand_on(link), Prompts()).rows}
    assert rows["motor.thumb.m1"] == "coupled"


def test_a_finger_that_turns_unseen_is_sent_back_at_once_and_left_alone() -> None:
    hand, link = simulated(start="open", rate=50, fault="stuck")
    rows = {row["check"]: row["finding"] for row in check(hand, Prompts()).rows}
    assert (rows["motor.index.m2"], rows["motor.index.m3"]) == ("encoder-stuck", "left-alone")
    assert max(one["hand_TP_cmd"][4] for one in objects(link.sent) if "hand_TP_cmd" in one) < 0.03 * 440000  # type: ignore[index]


@pytest.mark.parametrize(("fault", "state"), [("", "confirmed"), ("&fault=one-way&motor=5", "sent")])
def test_only_a_hand_that_is_back_is_said_to_be(fault: str, state: str) -> None:
    done = run("aidin", "check", "-y", "--json", "-p", f"fake://aidin?clock=virtual&start=open&rate=20{fault}")
    assert [write["state"] for write in done.json["writes"]] == [state]


@each_row("rate", [7, 9])
def test_the_last_object_is_heard_of(rate: int) -> None:
    hand, link = simulated(start="open", rate=rate)
    assert found(check(hand, Prompts())) == {}
    assert hand.conversation.feedback_at == link.now()
