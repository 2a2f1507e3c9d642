"""Feedback that cannot be that of a hand in motion stops it: encoders that leap, values that have frozen."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from handctl.devices.aidin import homing_and_bias, motion
from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.exchange import Conversation
from handctl.devices.aidin.feedback_guard import FASTEST, FeedbackGuard
from handctl.devices.aidin.motion import parse
from handctl.devices.aidin.parameter_map import ANGLES, CURRENTS, ENCODERS
from handctl.errors import CheckFailed
from handctl.model.prompts import Prompts
from tests.aidin.support import STOP, Streamer, feedback, hand_on, line, simulated, stopped_behind
from tests.support.each_row import each_row
from tests.support.refused import refused

MID = [112000, 112000, 84000] + [176000, 176000, 68000] * 4
RUNS: dict[str, Callable[[AidinHand], object]] = {
    "encoders": lambda hand: motion.move(hand, parse(ENCODERS, ["index.m1=330000"]), Prompts(), assume_homed=False),
    "joints": lambda hand: motion.move(hand, parse(ANGLES, ["index.q1=44"]), Prompts(), assume_homed=False),
    "initial": lambda hand: homing_and_bias.initial(hand, Prompts(), assume_homed=False),
    "home": lambda hand: homing_and_bias.home(hand, Prompts()),
    "currents": lambda hand: motion.currents(hand, parse(CURRENTS, ["0"] * 15), Prompts(), seconds=3.0, cap=300),
}


def at(motors: list[int], t: float = 0.0, *, noise: bool = True) -> dict[str, object]:
    """Feedback with these encoders, and sensors that are never still."""
    sensors = [n / 100 + noise * 0.001 * ((int(t * 1000) * 7919 + n * 31) % 17) for n in range(30)]
    return feedback(motor_pos=motors, current_state=[0] * 15, sensor_state=sensors)


@pytest.mark.parametrize("command", RUNS)
@pytest.mark.parametrize("period", [0.01, 0.05])
def test_encoders_that_jump_to_0_stop_the_hand(command: str, period: float) -> None:
    link = Streamer(lambda t: line(at(MID if t < 1.5 else [0] * 15, t)), period)
    with refused(CheckFailed, "origin-lost", "thumb.m1 from 112000 to 0"):
        RUNS[command](hand_on(link))
    stopped_behind(link.sent)
    last = max(n for n, data in enumerate(link.sent) if data != STOP)
    assert link.sent_at[last] < 1.5 + period + 0.041, "nothing but the stop is sent behind the jump"


@pytest.mark.parametrize("command", RUNS)
def test_feedback_that_has_frozen_stops_the_hand(command: str) -> None:
    link = Streamer(lambda t: line({**at(MID, min(t, 1.5)), "current_state": [250] * 15}))
    with refused(CheckFailed, "frozen-feedback"):
        RUNS[command](hand_on(link))
    stopped_behind(link.sent)
    last = max(n for n, data in enumerate(link.sent) if data != STOP)
    assert link.sent_at[last] < 2.1


def test_one_motor_that_jumps_stops_the_hand() -> None:
    link = Streamer(lambda t: line(at([*MID[:3], MID[3] - 150000 * (t > 1.2), *MID[4:]], t)))
    with refused(CheckFailed, "origin-lost", "index.m1 from 176000 to 26000"):
        RUNS["encoders"](hand_on(link))


def test_an_origin_that_the_hand_sets_itself_is_none_that_is_lost() -> None:
    hand, link = simulated(start="used", noise=1)
    table = homing_and_bias.home(hand, Prompts())
    assert any(row["rest"] != 0 for row in table.rows) and all(row["value"] == 0 for row in table.rows)
    assert STOP not in link.sent


@pytest.mark.parametrize(
    "options", [{}, {"rate": 5}, {"rate": 2}, {"merge": 10}, {"exchange": "poll"}, {"objects": "separate"}]
)
def test_a_hand_that_moves_as_it_may_is_left_alone(options: dict[str, object]) -> None:
    """Slow, fast, in batches; with noise, and at its target with none."""
    for noise in (0, 1):
        hand, link = simulated(start="homed", noise=noise, **options)
        assert motion.move(hand, parse(ENCODERS, ["index.m1=330000"]), Prompts(), assume_homed=False).failure is None
        homing_and_bias.initial(hand, Prompts(), assume_homed=False)
        assert STOP not in link.sent


SLOW, LEAP = int(FASTEST * 440000 * 0.01), 440000


def seen(*looks: tuple[float, int], noise: int = 0) -> str:
    """What the guard says of the encoder index.m1 at these times; the code, "" for nothing."""
    guard = FeedbackGuard()
    for n, (when, place) in enumerate(looks):
        guard.note(
            "hand", when, {"motor_pos": (1, 1, 1, place, *[1] * 11), "sensor_state": (n % 2 * float(noise),) * 30}
        )
    return guard.fault.code if guard.fault is not None else ""


@each_row(
    "name, looks, wanted",
    lambda: [
        ("motion", [(0.01 * n, SLOW * n) for n in range(20)], ""),
        ("a leap up", [(0.01 * n, 0 if n < 9 else 200000) for n in range(10)], "origin-lost"),
        ("objects lost: two seconds without one", [(0.0, 0), (0.01, 0), (2.0, LEAP)], ""),
        ("a leap behind a lost object", [(0.0, 0), (0.01, 0), (0.03, 200000)], "origin-lost"),
        ("the first object", [(5.0, LEAP)], ""),
        ("several objects at once", [(0.0, 0), (0.2, 20000), (0.2, 40000), (0.4, 60000), (0.4, 80000)], ""),
    ],
)
def test_leaps(name: str, looks: list[tuple[float, int]], wanted: str) -> None:
    assert seen(*looks) == wanted, name


def test_values_that_stand_are_frozen_only_where_noise_was_seen() -> None:
    moves = [(0.01 * n, 1000 * n) for n in range(30)]
    stands = [(0.3 + 0.01 * n, 30000) for n in range(100)]
    assert seen(*moves, *stands) == "", "no noise: it may have arrived"
    assert seen(*moves, *stands, noise=1) == "", "noise: it lives"
    guard = FeedbackGuard()
    for n, (when, place) in enumerate([*moves, *stands]):
        guard.note("hand", when, {"motor_pos": (place,) * 15, "sensor_state": (float(min(n, 30)),) * 30})
    assert guard.fault is not None and guard.fault.code == "frozen-feedback"


def test_nothing_is_judged_while_the_hand_is_not_driven() -> None:
    link = Streamer(lambda t: line(at(MID if t < 1 else [0] * 15, t)))
    conversation: Conversation = hand_on(link).conversation
    conversation.refresh()
    link.sleep(2.0)
    conversation.refresh()
    assert conversation.guard is None
