"""Feedback that cannot be that of a hand in motion stops it: encoders that leap, values that have frozen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from types import SimpleNamespace

import pytest

from handctl.devices.aidin import homing_and_bias, motion, motor_and_sensor_check, probe
from handctl.devices.aidin.conversation import Conversation
from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.feedback_guard import FASTEST, OBJECTS, FeedbackGuard, Liveness
from handctl.devices.aidin.motion import parse
from handctl.devices.aidin.parameter_map import ANGLES, CURRENTS, ENCODERS, TIPS
from handctl.devices.aidin.stopper import PAUSE
from handctl.errors import CheckFailed, HandctlError, NoAnswer
from handctl.link import ByteLink
from handctl.model.prompts import Prompts
from handctl.stop.device_access import context_at
from tests.aidin.support import STOP, Streamer, feedback, hand_on, line, poller, simulated, stopped, stopped_behind
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import ScriptedLink

MID = [112000, 112000, 84000] + [176000, 176000, 68000] * 4
RUNS: dict[str, Callable[[AidinHand], object]] = {
    "encoders": lambda hand: motion.move(hand, parse(ENCODERS, ["index.m1=330000"]), Prompts(), assume_homed=False),
    "joints": lambda hand: motion.move(hand, parse(ANGLES, ["index.q1=44"]), Prompts(), assume_homed=False),
    "initial": lambda hand: homing_and_bias.initial(hand, Prompts(), assume_homed=False),
    "home": lambda hand: homing_and_bias.home(hand, Prompts()),
    "currents": lambda hand: motion.currents(hand, parse(CURRENTS, ["0"] * 15), Prompts(), seconds=3.0, cap=300),
}

DRIVES: dict[str, Callable[[AidinHand], object]] = {
    **RUNS,
    "fingertips": lambda hand: motion.move(hand, parse(TIPS, ["index.z=120"]), Prompts(), assume_homed=False),
    "check": lambda hand: motor_and_sensor_check.check(hand, Prompts()),
    "bias": homing_and_bias.bias,
}
OPEN = ("check",)
"""Commands that need an open hand."""


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


# -- feedback that has frozen ------------------------------------------------------------------------------------------


def freezing(exchange: str, motors: list[int], after: int = 0) -> ScriptedLink:
    """A hand with noise that repeats its feedback from so many objects behind the first command on."""
    link: ScriptedLink
    numbers, told = count(1), [at(motors)]

    def content() -> dict[str, object]:
        if sum(b"hand_mode" in data for data in link.sent) <= after:
            told[0] = at(motors, 0.01 * next(numbers))
        return told[0]

    link = poller(lambda _: content()) if exchange == "poll" else Streamer(lambda _: line(content()))
    return link


@each_row("exchange", ["stream", "poll"])
@pytest.mark.parametrize("command", DRIVES)
def test_feedback_that_freezes_with_the_first_command_stops_the_hand(command: str, exchange: str) -> None:
    """The noise that came before the movement counts: a few objects are all there is of it."""
    link = freezing(exchange, [0] * 15 if command in OPEN else MID)
    with refused(CheckFailed, "frozen-feedback"):
        DRIVES[command](hand_on(link))
    stopped_behind(link.sent)
    times = [at for data, at in zip(link.sent, link.sent_at, strict=True) if b"hand_mode" in data and data != STOP]
    assert times[-1] - times[0] < 1.1, "nothing but the stop is sent once it is seen"


def test_a_hand_whose_feedback_has_frozen_before_is_not_driven() -> None:
    link = Streamer(lambda t: line(at([0] * 15, min(t, 0.5))))
    with refused(CheckFailed, "frozen-feedback"):
        DRIVES["check"](hand_on(link))
    assert not link.sent


def test_a_bias_is_no_noise() -> None:
    """Of a hand without noise the sensors change once; homing an open hand then changes nothing for 3 s."""
    hand, link = simulated(start="open", noise=0)
    homing_and_bias.bias(hand)
    homing_and_bias.home(hand, Prompts())
    assert STOP not in link.sent and hand.conversation.live.pause is None


@each_row(
    "name, sensors, places, pause",
    lambda: [
        ("one object", [1], [0], None),
        ("a change at rest", [1, 2], [0, 0], 0),
        ("a change while it moves", [1, 2], [0, 5], None),
        ("a change behind a pause", [1, 1, 1, 2], [0] * 4, None),
        ("many while it moves", range(OBJECTS + 1), range(OBJECTS + 1), 0),
        ("many with pauses", [1, 1, 1, 2, 2, 3, 4, 5, 6], [0] * 9, 2),
        ("none", [1] * 50, range(50), None),
    ],
)
def test_what_counts_as_noise(name: str, sensors: list[int], places: list[int], pause: int | None) -> None:
    live = Liveness()
    for when, (sensor, place) in enumerate(zip(sensors, places, strict=True)):
        live.note(0.01 * when, {"sensor_state": (sensor,) * 30, "motor_pos": (place,) * 15})
    assert live.pause == pause, name


# -- what a stop makes of it ---------------------------------------------------------------------------------------------


def noisy(until: float = 60.0, *, each: int = 1) -> ByteLink:
    """A streaming hand with noise until then, that sends each object so many times."""
    return Streamer(lambda t: line(at(MID, min(t, until))) * each)


def slow(until: float) -> ByteLink:
    return Streamer(lambda t: line(at(MID, min(t, until))), 0.1)


STANDS = "the motors are not moving"


@each_row(
    "name, link, own, error",
    lambda: [
        ("noise", noisy(), {}, None),
        ("noise, known before", noisy(), {PAUSE: 0}, None),
        ("noise, each object twice", noisy(each=2), {}, None),
        ("noise that ends", noisy(0.03), {}, NoAnswer),
        ("no noise, but there was some before", noisy(0.0), {PAUSE: 0}, NoAnswer),
        ("the same with pauses", noisy(0.0), {PAUSE: 3}, NoAnswer),
        ("the same, slowly", slow(0.0), {PAUSE: 0}, NoAnswer),
        ("noise, slowly", slow(60.0), {PAUSE: 0}, None),
        ("noise in each tenth object", Streamer(lambda t: line(at(MID, round(t, 1)))), {PAUSE: 0}, None),
    ],
)
def test_a_stop_believes_only_feedback_that_lives(
    name: str, link: ByteLink, own: dict[str, int], error: type[HandctlError] | None
) -> None:
    ended = stopped(link, **own)
    assert ended.error is error, (name, ended)
    assert (STANDS in ended.text) == (error is None), (name, ended)


def test_a_stop_of_a_hand_without_noise_does_not_say_that_it_stands() -> None:
    ended = stopped(noisy(0.0))
    assert ended.error is None and STANDS not in ended.text and ended.hint
    moves = stopped(Streamer(lambda t: line(at([round(place - 1e5 * min(t, 0.1)) for place in MID], noise=False))))
    assert moves.error is None and STANDS in moves.text, "it was seen to come to rest"


def test_interrupted_currents_are_not_stopped_by_old_feedback() -> None:
    link = freezing("stream", MID, after=20)
    link.interrupt_at = 0.8
    with refused(NoAnswer, "not-stopped"):
        RUNS["currents"](hand_on(link))
    stopped_behind(link.sent)


def test_a_stop_from_elsewhere_knows_what_the_command_knew() -> None:
    """What was seen of the noise, and whether a current flowed."""
    link = freezing("stream", MID)
    hand = hand_on(link)
    run = SimpleNamespace(opened=hand, journal=hand.journal, settings=hand.options)
    assert PAUSE not in context_at(run, link).settings.own, "nothing has been sent yet"  # type: ignore[arg-type]
    with refused(CheckFailed, "frozen-feedback"):
        RUNS["encoders"](hand)
    assert context_at(run, link).settings.own[PAUSE] == 0  # type: ignore[arg-type]


# -- what status and doctor make of it -------------------------------------------------------------------------------------


def seen_by_status(link: ByteLink) -> Iterator[str]:
    """The codes of what status --check tells of it."""
    hand = hand_on(link)
    table = hand.status(True)
    yield from (message.code for message in hand.journal.messages if message.code == "unchanged")
    if table.failure is not None:
        yield table.failure.code


@each_row(
    "name, link, codes, row",
    lambda: [
        ("noise", noisy, [], "ok"),
        ("noise that ends", lambda: noisy(0.01), ["unhealthy"], "fail"),
        ("noise, polled", lambda: freezing("poll", MID), [], "ok"),
        ("no noise", lambda: noisy(0.0), ["unchanged"], "skipped"),
        ("an object a second", lambda: Streamer(lambda _: line(at(MID)), 1.0), ["unchanged"], "skipped"),
    ],
)
def test_status_and_doctor_tell_it(name: str, link: Callable[[], ByteLink], codes: list[str], row: str) -> None:
    assert list(seen_by_status(link())) == codes, name
    hand = hand_on(link())
    hand.dump()
    (found,) = probe.further(hand, True)
    assert found[:2] == ("feedback", row) and bool(found[3]) == (row == "fail"), name
    assert not list(probe.further(hand, False))


def test_a_hand_without_sensors_is_not_said_to_send_seldom() -> None:
    """It sends a hundred objects a second, but none that could show noise."""
    link = Streamer(lambda _: line({key: value for key, value in at(MID).items() if key != "sensor_state"}))
    hand = hand_on(link)
    hand.dump()
    state, evidence = hand.liveness()
    assert (state, "sensor_state" in evidence, "seldom" in evidence) == ("skipped", True, False)
