"""Procedures of the AIDIN-hand: what is sent when, what proves it, and what an interruption leaves behind."""

from __future__ import annotations

import itertools
from random import Random
from typing import Any

import pytest

from handctl.devices.aidin import homing_and_bias, motion
from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.motion import parse
from handctl.devices.aidin.parameter_map import ANGLES, ENCODERS, TIPS
from handctl.errors import CheckFailed, DeviceRefused, Interrupted, LinkError, NoAnswer, ProtocolError
from handctl.model import stop_on_interrupt
from handctl.model.prompts import Prompts
from handctl.model.stop_sequence import Stopped
from tests.aidin.support import (
    AT_ORIGIN,
    STOP,
    Content,
    Notes,
    Streamer,
    feedback,
    hand_on,
    line,
    objects,
    poller,
    simulated,
    stopped,
    stopped_behind,
    streamer,
)
from tests.support.cli import spying
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import ScriptedLink

HOME, INITIAL, BIAS = (b'{"hand_mode":%d}\n' % n for n in (1, 2, 4))
POLL = b"{}\n"
STILL: Content = {**AT_ORIGIN, "current_state": [0] * 15}


# -- homing -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("polled", [False, True], ids=["stream", "poll"])
def test_homing_is_held_for_3_5_s_and_nothing_comes_between(polled: bool) -> None:
    link = poller(AT_ORIGIN) if polled else streamer(AT_ORIGIN)
    notes = Notes()
    table = homing_and_bias.home(hand_on(link), notes)
    places = [n for n, data in enumerate(link.sent) if data == HOME]
    assert set(link.sent[places[0] : places[-1] + 1]) == {HOME}
    times = [link.sent_at[n] for n in places]
    assert times[-1] - times[0] > 3.4
    assert max(b - a for a, b in itertools.pairwise(times)) <= 0.0201
    assert min(b - a for a, b in itertools.pairwise(times)) >= 0.0199
    assert set(link.sent) <= {HOME, POLL}
    assert [row["value"] for row in table.rows] == [0] * 15
    assert "all fingers open" in notes.lines[0] and "Keep clear" in notes.lines[0]
    assert any("of 3.5 s" in text for text in notes.lines)


def test_homing_that_left_encoders_elsewhere_is_not_confirmed() -> None:
    table = homing_and_bias.home(hand_on(streamer(feedback(motor_pos=[0] * 5 + [85000] + [0] * 9))), Prompts())
    assert table.failure is not None and table.failure.code == "not-homed"
    assert table.rows[5]["verdict"] == "not at 0"
    assert "left in homing mode, and no stop was sent" in table.failure.hint


def test_a_hold_that_was_held_up_begins_again() -> None:
    link = streamer(AT_ORIGIN)
    hand = hand_on(link)
    write, held = link.write, []

    def slow(data: bytes, deadline: object) -> None:
        if data == HOME and link.clock > 2.0 and not held:
            held.append(link.clock)
            link.clock += 0.3
        write(data, deadline)  # type: ignore[arg-type]

    link.write = slow  # type: ignore[method-assign,assignment]
    homing_and_bias.home(hand, Prompts())
    assert link.sent_at[-1] - held[0] > 3.7
    assert "interrupted-hold" in [message.code for message in hand.journal.messages]


def test_homing_interrupted_is_not_homed_and_stopped() -> None:
    link = streamer(AT_ORIGIN)
    link.interrupt_at = 2.0
    with pytest.raises(Interrupted, match="not homed") as caught:
        homing_and_bias.home(hand_on(link), Prompts())
    assert stopped_behind(link.sent) == HOME
    assert caught.value.exit_code == 130


def test_homing_of_a_hand_that_only_answers_commands() -> None:
    link = poller(lambda request: AT_ORIGIN if b"hand_mode" in request else None)
    table = homing_and_bias.home(hand_on(link), Prompts())
    assert [row["value"] for row in table.rows] == [0] * 15
    first = link.sent.index(HOME)
    assert set(link.sent[first:]) == {HOME}


def test_homing_of_a_mute_hand_is_not_confirmed() -> None:
    link = ScriptedLink()
    with pytest.raises(NoAnswer, match="not confirmed"):
        homing_and_bias.home(hand_on(link), Prompts())
    assert link.clock < 6


def test_homing_into_damage_is_stopped() -> None:
    good, bad = line(AT_ORIGIN), b'{"motor_pos":[1,2\n'
    link = Streamer(lambda t: good if t < 1.5 else bad)
    with pytest.raises(ProtocolError) as caught:
        homing_and_bias.home(hand_on(link), Prompts())
    assert link.sent[-3:] == [STOP] * 3
    assert "is not confirmed" in caught.value.hint


# -- initial position -------------------------------------------------------------------------------------------------


def test_initial_is_repeated_until_the_encoders_are_at_the_origin() -> None:
    link = Streamer(lambda t: line(feedback(motor_pos=[max(0, round(100000 * (1 - t)))] * 15)))
    hand = hand_on(link)
    table = homing_and_bias.initial(hand, Prompts(), assume_homed=False)
    assert set(link.sent) == {INITIAL}
    assert all(row["value"] == 0 for row in table.rows)


def test_initial_that_does_not_arrive() -> None:
    link = streamer(feedback(motor_pos=[50000] * 15))
    with refused(CheckFailed, "not-reached"):
        homing_and_bias.initial(hand_on(link), Prompts(), assume_homed=False)
    assert 5.0 <= link.clock < 5.3


def test_encoders_out_of_their_range_were_not_homed() -> None:
    content = feedback(motor_pos=[-50000] * 15)
    link = streamer(content)
    for call in (
        lambda hand: homing_and_bias.initial(hand, Prompts(), assume_homed=False),
        lambda hand: motion.move(hand, parse(ENCODERS, ["index.m1=5"]), Prompts(), assume_homed=False),
    ):
        with refused(CheckFailed, "not-homed"):
            call(hand_on(link))
    assert link.sent == []
    with refused(CheckFailed, "not-reached"):
        homing_and_bias.initial(hand_on(link), Prompts(), assume_homed=True)
    assert set(link.sent) == {INITIAL}


# -- stop -------------------------------------------------------------------------------------------------------------


@each_row("kind", ["stream", "poll", "command"])
def test_stop_goes_out_before_anything_else(kind: str) -> None:
    link = {
        "stream": lambda: streamer(STILL),
        "poll": lambda: poller(STILL),
        "command": lambda: poller(lambda request: STILL if b"hand_mode" in request else None),
    }[kind]()
    assert stopped(link).error is None
    assert set(link.sent) == {STOP} and len(link.sent) >= 3
    assert link.sent_at[0] == 0.0


def test_stop_to_a_mute_hand_is_sent_and_not_confirmed() -> None:
    link = ScriptedLink(baud=None)
    ended = stopped(link)
    assert ended.error is NoAnswer and "not confirmed" in ended.text
    assert set(link.sent) == {STOP}
    assert link.clock < 1.5


def test_a_stop_whose_connection_is_closed_says_what_ends_a_movement() -> None:
    """By a hand that serves another client, say."""
    hand = hand_on(streamer())

    def closed(deadline: object, size: int = 4096) -> bytes:
        raise LinkError("connection closed by the other end", hint="run the command again", code="lost")

    hand.link.read = closed  # type: ignore[method-assign,assignment,attr-defined]
    ended = hand.stop()
    assert ended.error is LinkError and "power off" in ended.hint and "un the command again" in ended.hint


def test_stop_that_leaves_currents() -> None:
    ended = stopped(streamer(feedback(current_state=[-400] + [0] * 14)))
    assert ended.error is CheckFailed and "currents up to 400" in ended.text


# -- bias and maximum torque ------------------------------------------------------------------------------------------


def test_bias() -> None:
    zero = {**STILL, "sensor_state": [0.0] * 30}
    link = ScriptedLink()
    link.answer = lambda request: [(0.001, line(zero if BIAS in link.sent else feedback()))]
    hand = hand_on(link)
    table = homing_and_bias.bias(hand)
    assert table.failure is None
    assert [(row["before"], row["value"]) for row in table.rows][:2] == [(0.01, 0.0), (0.02, 0.0)]
    assert 20 <= link.sent.count(BIAS) <= 26
    assert set(link.sent) == {BIAS, POLL}


def test_bias_without_effect() -> None:
    table = homing_and_bias.bias(hand_on(streamer(feedback())))
    assert table.failure is not None and table.failure.code == "not-biased"
    assert len(table.rows) == 30


def test_noise_about_zero_is_no_failure() -> None:
    values = iter([0.001, -0.002, 0.002, -0.001] * 300)
    link = Streamer(lambda _: line(feedback(sensor_state=[next(values)] * 30)))
    assert homing_and_bias.bias(hand_on(link)).failure is None


@pytest.mark.parametrize("seed", range(6))
def test_noise_that_hardly_changes_by_chance_is_no_failure(seed: int) -> None:
    random = Random(seed)

    def noisy(t: float) -> bytes:
        return line(feedback(sensor_state=[round(random.gauss(0, 0.001), 5) for _ in range(30)]))

    assert homing_and_bias.bias(hand_on(Streamer(noisy))).failure is None
    grows = Streamer(
        lambda t: line(feedback(sensor_state=[0.2 * (n == 8) * (1 + t) + random.gauss(0, 0.001) for n in range(30)]))
    )
    failure = homing_and_bias.bias(hand_on(grows)).failure
    assert failure is not None and "index.fz" in failure.text and "," not in failure.text


def test_bias_is_refused_while_a_motor_moves() -> None:
    link = Streamer(lambda t: line(feedback(motor_pos=[0] * 4 + [round(t * 100000)] + [0] * 10)))
    with pytest.raises(CheckFailed, match=r"index\.m2"):
        homing_and_bias.bias(hand_on(link))
    assert link.sent == []


def test_max_torque() -> None:
    link = streamer()
    hand = hand_on(link)
    (row,) = homing_and_bias.max_torque(hand, 800).rows
    assert (row["name"], row["key"], row["value"], row["finger"]) == ("maxtorque", "maxtorque", 800, None)
    assert set(link.sent) == {b'{"hand_mode":5,"maxtorque":800}\n'}
    assert hand.journal.messages[-1].code == "not-read-back"
    with pytest.raises(NoAnswer):
        homing_and_bias.max_torque(hand_on(ScriptedLink()), 800)


# -- targets, against the simulator -----------------------------------------------------------------------------------


@pytest.mark.parametrize("exchange", ["stream", "poll"])
def test_joints_arrive_on_a_ramp(exchange: str) -> None:
    hand, link = simulated(start="homed", exchange=exchange)
    before = {
        f"{row['finger']}.{row['element']}": row["value"] for row in hand.dump().rows if row["name"] == "joint_pos"
    }
    table = motion.move(hand, parse(ANGLES, ["index.q3=130", "thumb.q1=10"]), Prompts(), assume_homed=False)
    assert table.failure is None
    at = {f"{row['finger']}.{row['element']}": row for row in table.rows}
    assert all(row["reached"] for row in table.rows)
    assert abs(at["index.q3"]["value"] - 130) <= 2 and at["index.q3"]["target"] == 130
    assert abs(at["ring.q1"]["value"] - before["ring.q1"]) <= 2
    commands = [data for data in objects(link.sent) if data]
    assert {data["hand_mode"] for data in commands} == {22}
    angles = [data["hand_joint_cmd"][6] for data in commands]  # type: ignore[index]
    steps = [b - a for a, b in itertools.pairwise(angles)]
    assert max(map(abs, steps)) <= 0.020945  # 1.2 degrees
    assert angles[-1] == 2.268928
    sent = [at for at, data in zip(link.sent_at, link.sent, strict=True) if data != POLL]
    assert min(b - a for a, b in itertools.pairwise(sent)) >= 0.0199


def test_encoders_and_fingertips_arrive() -> None:
    hand, _ = simulated(start="open")
    for goal in (parse(ENCODERS, ["index.m3=85000"]), parse(TIPS, ["little.z=120", "thumb.y=60"])):
        assert motion.move(hand, goal, Prompts(), assume_homed=False).failure is None


@pytest.mark.parametrize("behind", [27, 30, 33])
def test_a_program_that_was_held_up_looks_before_it_judges(behind: int) -> None:
    """By the system, for 4 s: near the end of the ramp, and after it."""
    hand, link = simulated(start="homed")
    tick, ticks = hand.conversation.tick, itertools.count()

    def held_up(*given: Any, **more: Any) -> None:
        tick(*given, **more)
        if next(ticks) == behind:
            link.sleep(4.0)

    hand.conversation.tick = held_up  # type: ignore[method-assign]
    table = motion.move(hand, parse(ANGLES, ["index.q3=130"]), Prompts(), assume_homed=False)
    assert table.failure is None, table.failure


def test_what_does_not_arrive_is_named() -> None:
    with spying() as spy:
        hand, link = simulated(start="homed", rate=20)
    spy.lines[-1].device.hand.motors[5].ceiling = 60000.0
    gripped = motion.move(hand, parse(ENCODERS, ["index.m3=85000"]), Prompts(), assume_homed=False, expect="contact")
    assert gripped.failure is None, "its current shows that it pushes"
    assert {row["element"]: row["arrival"] for row in gripped.rows if row["arrival"] != "reached"} == {"m3": "contact"}
    assert [row["element"] for row in gripped.rows if not row["reached"]] == ["m3"]
    again = motion.move(hand, parse(ENCODERS, ["index.m3=85000"]), Prompts(), assume_homed=False, expect="contact")
    assert again.failure is not None, "it pushed as much before, so this movement has met nothing"
    assert again.failure.exit_code == 7 and "index.m3" in again.failure.text and "60000 cts" in again.failure.text
    assert link.now() < 20


def test_what_never_moved_has_met_nothing() -> None:
    """However hard it pushes: a gear that is jammed does that too."""
    hand, _ = simulated(start="homed", fault="blocked", rate=20)
    table = motion.move(hand, parse(ENCODERS, ["index.m3=85000"]), Prompts(), assume_homed=False, expect="contact")
    assert {row["element"]: row["arrival"] for row in table.rows if row["arrival"] != "reached"} == {"m3": "unmoved"}
    assert table.failure is not None and table.failure.exit_code == 7


def test_passing_by_is_not_arriving() -> None:
    link = Streamer(lambda t: line(feedback(motor_pos=[0] * 5 + [round(abs(100000 * t % 340000 - 170000))] + [0] * 9)))
    table = motion.move(
        hand_on(link), parse(ENCODERS, ["0"] * 5 + ["85000"] + ["0"] * 9), Prompts(), assume_homed=False
    )
    assert table.failure is not None


@each_row(
    ("kind", "key", "wanted", "begin", "end"),
    [
        (ENCODERS, "motor_pos", "index.m3=85000", 51000, 70000),
        (ANGLES, "joint_pos", "index.q3=116", 2.74, 2.60),
        (TIPS, "task_space_pos", "index.z=20", 104.0, 90.0),
    ],
)
def test_what_stops_on_the_ramp_has_moved(kind: Any, key: str, wanted: str, begin: float, end: float) -> None:
    """It stands before the ramp has ended, and no current shows a push."""
    place = 6 if key == "joint_pos" else 5

    def told(t: float) -> bytes:
        now = feedback()
        now[key][place] = type(begin)(begin + (end - begin) * min(1.0, 2 * t))
        return line(now)

    for expect, code in (("reached", 7), ("any", 0)):
        table = motion.move(hand_on(Streamer(told)), parse(kind, [wanted]), Prompts(), assume_homed=True, expect=expect)
        assert {row["arrival"] for row in table.rows} == {"reached", "short", None} - (
            {None} if kind is not ANGLES else set()
        )
        assert (table.failure.exit_code if table.failure else 0) == code, table.failure


def test_an_interrupted_movement_is_stopped() -> None:
    hand, link = simulated(start="homed")
    link.interrupt_at = link.now() + 0.8
    with pytest.raises(Interrupted):
        motion.move(hand, parse(ANGLES, ["index.q3=120"]), Prompts(), assume_homed=False)
    assert b'"hand_mode":22' in stopped_behind(link.sent)


def test_a_hand_that_ignores_the_stop_is_told_apart() -> None:
    """It went on to the last target of the ramp and stands there with its currents at rest: nothing shows the stop."""
    hand, link = simulated(start="homed", load=0, fault="deaf", after=39)
    stops = list[Stopped]()
    hand.stop = lambda **given: stops.append(AidinHand.stop(hand, **given)) or stops[-1]  # type: ignore[func-returns-value, method-assign]
    link.interrupt_at = link.now() + 0.8
    with pytest.raises(Interrupted):
        motion.move(hand, parse(ENCODERS, ["index.m3=170000"]), Prompts(), assume_homed=False)
    assert [(one.error, one.evidence) for one in stops] == [(None, "")]


def test_a_hand_that_moves_on_behind_ctrl_c_is_no_success() -> None:
    """It creeps to its origin at a current that counts as none."""
    hand, link = simulated(start="homed", fault="deaf", after=20)
    homing_and_bias.max_torque(hand, 15)
    link.interrupt_at = link.now() + 1.0
    with refused(DeviceRefused, "not-stopped"):
        homing_and_bias.initial(hand, Prompts(), assume_homed=False)


def test_a_second_interrupt_and_a_lost_link_are_told() -> None:
    def again(data: bytes, deadline: object) -> None:
        raise KeyboardInterrupt

    def lost(data: bytes, deadline: object) -> None:
        raise LinkError("gone")

    for write, word, error in ((again, "interrupted again", NoAnswer), (lost, "gone", LinkError)):
        link = streamer()
        link.write = write  # type: ignore[method-assign,assignment]
        ended = stop_on_interrupt.stop_without_interrupts(hand_on(link).stop, Prompts())
        assert type(ended) is error and word in ended.text and ended.code == "not-stopped"


def test_feedback_that_stops_ends_a_movement() -> None:
    good = line(AT_ORIGIN)
    link = Streamer(lambda t: good if t < 0.4 else b"\n")
    with refused(NoAnswer, "no-answer"):
        motion.move(hand_on(link), parse(ENCODERS, ["index.m3=170000"]), Prompts(), assume_homed=False)
    assert link.clock < 2
    assert STOP not in link.sent  # the last small step of the ramp is held
