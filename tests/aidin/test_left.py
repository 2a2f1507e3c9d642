"""What the AIDIN-hand is left with when a command ends early: stop goes out whatever comes, and the message says what is in force."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from handctl.devices.aidin import homing_and_bias as modes
from handctl.devices.aidin import motion
from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.motion import currents, parse
from handctl.devices.aidin.parameter_map import ANGLES, CURRENTS, ENCODERS, TIPS, Target
from handctl.errors import CheckFailed, HandctlError, Interrupted, LinkError, NoAnswer, ProtocolError, UsageError
from handctl.link import Deadline
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from tests.aidin.support import (
    AT_ORIGIN,
    STOP,
    Streamer,
    feedback,
    hand_on,
    line,
    simulated,
    stopped,
    stopped_behind,
    streamer,
)
from tests.support.cli import Simulator, clean_environment, program, wait_until
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import ScriptedLink

Act = Callable[[AidinHand], object]


def initial(hand: AidinHand) -> object:
    return modes.initial(hand, Prompts(), assume_homed=True)


def move(hand: AidinHand) -> object:
    return motion.move(hand, parse(ANGLES, ["index.q3=120"]), Prompts(), assume_homed=True)


def max_torque(hand: AidinHand) -> object:
    return modes.max_torque(hand, 900)


# -- stop --------------------------------------------------------------------------------------------------------------


def test_stop_is_sent_three_times_though_feedback_is_damaged() -> None:
    link = Streamer(lambda _: b'{"motor_pos":[1,]}\n')
    ended = stopped(link)
    assert link.sent.count(STOP) >= 3 and set(link.sent) == {STOP}
    assert ended.error is ProtocolError and "is not confirmed" in ended.text


@each_row("instead", [b"", b"[1,2]\n"])
def test_a_hand_that_falls_silent_at_the_stop_is_told_as_such(instead: bytes) -> None:
    """It told its currents once, perhaps before the stop: neither a confirmation nor "no currents"."""
    ended = stopped(Streamer(lambda t: line(CLOSED) if t < 0.04 else instead))
    assert ended.error is (ProtocolError if instead else NoAnswer), ended
    assert ("the feedback since then has no currents" if instead else "has sent nothing since") in ended.text


# -- what stays in force -----------------------------------------------------------------------------------------------


class Closing(Streamer):
    """A hand whose connection ends at `end`; with `silent` it falls silent instead."""

    def __init__(self, end: float, *, silent: bool = False) -> None:
        super().__init__(lambda t: line(CLOSED) if t < end else b"")
        self.end, self.silent = end, silent

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self.clock >= self.end:
            if not self.silent:
                raise LinkError(f"{self.name}: connection closed")
            self._pass_to(deadline.at)
            return b""
        return super().read(deadline, size)


CLOSED = feedback(motor_pos=[20000] * 15)
GOES_ON = "no stop was sent, so the hand probably continues"


@each_row("silent", [False, True], ids=["closed", "silent"])
@each_row(
    ("act", "end", "told"),
    [
        (initial, 0.3, f"{GOES_ON} to its origin"),
        (move, 0.3, f"{GOES_ON} to its last target"),
        (max_torque, 0.1, "maxtorque 900 was sent and may be in effect"),
        (modes.bias, 0.5, "the sensor bias was sent"),
    ],
)
def test_an_error_says_what_the_hand_has_got(act: Act, end: float, told: str, silent: bool) -> None:
    link = Closing(end, silent=silent)
    with pytest.raises((LinkError, NoAnswer)) as caught:
        act(hand_on(link))
    assert told in caught.value.hint.lower() and STOP not in link.sent


@pytest.mark.parametrize("silent", [False, True], ids=["closed", "silent"])
def test_homing_that_ends_unseen_says_what_the_hand_was_left_in(silent: bool) -> None:
    whole = streamer(AT_ORIGIN)
    modes.home(hand_on(whole), Prompts())
    link = Closing(whole.sent_at[-1] + 0.02, silent=silent)
    with pytest.raises((LinkError, NoAnswer)) as caught:
        modes.home(hand_on(link), Prompts())
    assert len(link.sent) == len(whole.sent)
    assert "the hand was left in homing mode, and no stop was sent" in caught.value.hint.lower()


def test_homing_that_was_not_begun_stops_nobody() -> None:
    """The hand falls silent, or tells no encoders, before the first object: what it holds is not let fall."""
    for content in (feedback(motor_pos={"a": 1}), feedback(motor_pos=[0] * 14)):
        link = streamer(content)
        with pytest.raises(ProtocolError, match="motor_pos"):
            modes.home(hand_on(link), Prompts())
        assert link.sent == []


@each_row("instead", [b"null\n", b"[1,2,3]\n", b'{"error":"motor fault"}\n', b'{"motor_pos":[0,0'])
@each_row("act", [initial, move, max_torque, modes.bias])
def test_what_comes_instead_of_feedback_is_no_silence(act: Act, instead: bytes) -> None:
    end = 0.45 if act is modes.bias else 0.1
    link = Streamer(lambda t: line(CLOSED) if t < end else instead)
    with pytest.raises(ProtocolError) as caught:
        act(hand_on(link))
    first = instead[:4].hex(" ").upper()
    assert first in caught.value.text or "corrupted" in caught.value.text, caught.value.text


@each_row(("act", "bound"), [(initial, 0.3), (max_torque, 0.1), (modes.bias, 0.4)])
def test_a_deadline_says_what_the_hand_has_got(act: Act, bound: float) -> None:
    link = streamer(CLOSED)
    with pytest.raises(NoAnswer, match="deadline") as caught:
        act(hand_on(link, bound=link.deadline(bound)))
    assert "sent" in caught.value.hint and "a longer --deadline" in caught.value.hint


@pytest.mark.parametrize(
    ("act", "told"), [(initial, f"{GOES_ON} to its origin"), (move, f"{GOES_ON} to its last target")]
)
def test_a_target_that_is_not_reached_is_still_driven_at(act: Act, told: str) -> None:
    link = streamer(CLOSED)
    with refused(CheckFailed, "not-reached") as caught:
        table = act(hand_on(link))
        assert isinstance(table, Table) and table.failure is not None
        raise table.failure
    assert told in caught.value.hint.lower() and STOP not in link.sent


def test_homing_is_not_begun_when_the_deadline_would_cut_it_off() -> None:
    link = streamer(AT_ORIGIN)
    with pytest.raises(UsageError, match=r"takes 3\.5 s"):
        modes.home(hand_on(link, bound=link.deadline(3.4)), Prompts())
    assert link.sent == []


@each_row(
    ("act", "at", "told"),
    [(max_torque, 0.1, "maxtorque 900 was sent and may be in effect"), (modes.bias, 0.45, "the sensor bias was sent")],
)
def test_an_interruption_says_what_the_hand_has_got(act: Act, at: float, told: str) -> None:
    link = streamer(AT_ORIGIN)
    link.interrupt_at = at
    with pytest.raises(Interrupted, match=told):
        act(hand_on(link))
    assert STOP not in link.sent, "nothing moves: what the hand holds is not dropped"


def test_before_anything_is_sent_nothing_is_said_to_have_been() -> None:
    with pytest.raises(HandctlError) as caught:
        modes.bias(hand_on(Closing(0.01, silent=True)))
    assert "was sent" not in caught.value.hint


def test_the_range_of_currents_is_not_said_to_be_the_manuals() -> None:
    with pytest.raises(UsageError) as caught:
        parse(CURRENTS, ["index.m1=1001"], cap=1000)
    assert "-1000..1000 (handctl's own limits, because the manual gives no range)" in caught.value.hint


# -- where a ramp begins -----------------------------------------------------------------------------------------------

ALL = ["10", "5", "118", "-4", "5", "165", "0", "5", "165", "4", "5", "165", "8", "5", "165"]


@each_row("assume", [False, True])
def test_a_ramp_does_not_begin_at_degrees_on_the_wire(assume: bool) -> None:
    hand, link = simulated(start="homed", fault="degrees")
    with pytest.raises(CheckFailed, match=r"joint_pos is not an angle in radians.*cannot start there") as caught:
        motion.move(hand, parse(ANGLES, ALL), Prompts(), assume_homed=assume)
    assert caught.value.code == "start-out-of-range" and link.sent == []


def test_a_ramp_begins_far_outside_only_when_that_is_wanted() -> None:
    angles = [0.1, 0.2, 2.1, 2.1, *[0.1, -0.1, 2.5, 2.5] * 4]
    angles[4] = -1.1  # -63 of -45 deg; a jump to -45 would be the first step
    link = streamer(feedback(joint_pos=angles))
    with refused(CheckFailed, "start-out-of-range", "index.q1 -63.0") as caught:
        motion.move(hand_on(link), parse(ANGLES, ALL), Prompts(), assume_homed=False)
    assert "--assume-homed skips homing" in caught.value.hint and link.sent == []
    assert motion.move(hand_on(link), parse(ANGLES, ALL), Prompts(), assume_homed=True).failure is not None
    assert link.sent
    angles[4] = -0.82  # -47 deg: the figures of the ranges need not be that exact
    near = streamer(feedback(joint_pos=angles))
    assert motion.move(hand_on(near), parse(ANGLES, ALL), Prompts(), assume_homed=False).failure is not None
    assert near.sent


# -- a second Ctrl-C in a real process ---------------------------------------------------------------------------------


@pytest.mark.real
def test_a_second_interrupt_cuts_the_way_back_of_currents_short(tmp_path: Path) -> None:
    """Whether the hand confirms the stop in time is a matter of virtual time: test_again.py."""
    trace = tmp_path / "trace"
    with Simulator("--tcp", "127.0.0.1:0", "--set", "start=homed", kind="aidin") as simulator:
        process = subprocess.Popen(
            program("aidin", "currents", "index.m3=300", "-y", "--ramp-down", "-p", simulator.link, "--trace", trace),
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=clean_environment(),
        )  # fmt: skip
        assert process.stderr is not None
        wait_until(lambda: trace.exists() and _largest(trace) == 300)
        process.send_signal(signal.SIGINT)
        assert b"Press Ctrl-C again to stop immediately" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and out == b""
    assert b"interrupted" in err and b"not been confirmed" not in err, err
    sent = _sent(trace)
    modes = [content["hand_mode"] for content in sent if "hand_mode" in content]
    assert modes.count(3) > 3 and set(modes[modes.index(3) :]) == {3}
    (*_, last) = [content["hand_TT_cmd"] for content in sent if "hand_TT_cmd" in content]
    assert max(last) > 50, "300 to 0 takes 1.5 s: it was not waited for"  # type: ignore[call-overload]


def _sent(trace: Path) -> list[dict[str, object]]:
    """The objects in a transcript that the host sent."""
    lines = [text.split(" > ") for text in trace.read_text(encoding="utf-8").splitlines()[:-1] if " > " in text]
    return [json.loads(bytes.fromhex(digits)) for _, digits in lines]


def _largest(trace: Path) -> int:
    """The largest current commanded so far."""
    targets = [content["hand_TT_cmd"] for content in _sent(trace) if "hand_TT_cmd" in content]
    return max((max(values) for values in targets if isinstance(values, list)), default=0)


# -- a hand that goes blind or silent while it is driven ----------------------------------------------------------------

WHEN = 0.9
"""Seconds: every command below is driving by then, and would go on for a second and a half at least."""
BOUND = 1.2
"""Seconds of further objects at the most: 1 s of silence, and the last period."""
DRIVES: dict[str, tuple[Act, str, str]] = {
    "home": (lambda hand: modes.home(hand, Prompts()), "motor_pos", "Stop was sent"),
    "initial": (initial, "motor_pos", f"{GOES_ON} to its origin"),
    "encoders": (lambda hand: _moved(hand, ENCODERS, "index.m1=200000"), "motor_pos", f"{GOES_ON} to its last target"),
    "joints": (lambda hand: _moved(hand, ANGLES, "index.q3=120"), "joint_pos", f"{GOES_ON} to its last target"),
    "fingertips": (lambda hand: _moved(hand, TIPS, "index.z=10"), "task_space_pos", f"{GOES_ON} to its last target"),
    "currents": (
        lambda hand: currents(hand, parse(CURRENTS, ["index.m1=200"], cap=300), Prompts(), seconds=3, cap=300),
        "current_state", "Stop was sent",
    ),
}  # fmt: skip
"""Command -> how it is run, the key that it goes by, and what must be said of the hand when that key goes wrong."""


def _moved(hand: AidinHand, target: Target, text: str) -> Table:
    return motion.move(hand, parse(target, [text]), Prompts(), assume_homed=True)


def _blinded(content: dict[str, object], key: str, how: str) -> dict[str, object]:
    """Feedback in which a key has gone wrong."""
    values = content[key]
    assert isinstance(values, list)
    spoilt = {"nan": [float("nan"), *values[1:]], "short": values[1:], "text": ["x", *values[1:]], "null": None}
    rest = {name: value for name, value in content.items() if name != key}
    return rest if how == "missing" else {**rest, key: spoilt[how]}


def _turning(exchange: str, key: str, how: str) -> ScriptedLink:
    """A hand that streams or answers, and goes blind or silent in the middle."""
    link: ScriptedLink
    sees, blind = line(CLOSED), b"" if how == "silent" else line(_blinded(CLOSED, key, how))

    def content() -> bytes:
        return sees if link.clock < WHEN else blind

    if exchange == "stream":
        link = Streamer(lambda _: content(), period=0.05)
    else:
        link = ScriptedLink(lambda _: [(0.001, data)] if (data := content()) else [])
    return link


@each_row("how", ["nan", "short", "text", "null", "missing", "silent"])
@each_row("exchange", ["stream", "poll"])
@each_row("name", DRIVES)
def test_a_hand_that_goes_blind_is_not_driven_on(name: str, exchange: str, how: str) -> None:
    """Soon no command follows, and the error says what the hand does now; the same whoever speaks first."""
    act, key, told = DRIVES[name]
    link = _turning(exchange, key, how)
    with pytest.raises((NoAnswer, ProtocolError)) as caught:
        act(hand_on(link))
    assert told in caught.value.hint, caught.value.hint
    stopped = told.startswith("Stop")
    assert stopped_behind(link.sent) if stopped else STOP not in link.sent
    driven = [at for data, at in zip(link.sent, link.sent_at, strict=True) if data != STOP]
    assert driven[-1] > WHEN - 0.3, "it was driving"
    assert driven[-1] < WHEN + BOUND
    if how != "silent":
        assert key in caught.value.text


@pytest.mark.parametrize(("act", "left"), [(max_torque, "mode 5"), (modes.bias, "mode 4")])
def test_the_mode_that_the_hand_is_left_in_is_said(act: Act, left: str) -> None:
    """It does what it did before no longer, for all that the manual says: also where the command was cut short."""
    hand = hand_on(streamer(AT_ORIGIN))
    act(hand)
    (message,) = [message for message in hand.journal.messages if message.code == "left"]
    assert left in message.text and "position" in message.text and message.hint
    link = streamer(AT_ORIGIN)
    link.interrupt_at = 0.45 if act is modes.bias else 0.1
    with pytest.raises(Interrupted, match=left):
        act(hand_on(link))
