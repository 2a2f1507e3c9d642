"""A device that acknowledges its stop and goes on gets the whole stop once more, and no third time: each family, on each line.

A simulated device goes on behind its acknowledgements until it obeys. What one whole stop is, is seen without the second one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MethodType
from typing import Any, NamedTuple

import pytest

from handctl.devices.barrett import motion
from handctl.devices.barrett import stopper as barrett
from handctl.devices.barrett.device import BarrettHand
from handctl.errors import DeviceRefused
from handctl.families import FAMILIES
from handctl.link import open_link
from handctl.model import stop_sequence
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import (
    AGAIN,
    RunningStop,
    Stopped,
    StopPlan,
    TwoParts,
    context_for_link,
    stop_sequence_of,
)
from handctl.stop.stop_listener import STOP_SECONDS
from tests.barrett.support import simulated
from tests.contract.facts import facts_of, passed
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row
from tests.support.swap import swapped

AT_ONCE, NEVER = 0, 10**6
"""Stops that a device has to hear before the one that it obeys."""


class Row(NamedTuple):
    """A device that may not obey.

    goes_on  the simulated device, seconds: it has gone on for these, whatever it was told
    stop     what the last write of a stop has, with its identifier on CAN
    options  of the simulator: its wire and its state
    words    of the command line
    holds    that write begins with these bytes, and has the places where the device was read to be behind them
    """

    family: str
    goes_on: Callable[[Any, float], None]
    stop: bytes
    options: str = ""
    words: str = "stop"
    holds: int = 0

    def __str__(self) -> str:
        return " ".join(filter(None, (self.family, self.options, self.words)))


def fingers(device: Any, seconds: float) -> None:
    """Of an exo."""
    for finger in device.hand.fingers:
        finger.put(finger.position + 40 * seconds)


def axes(device: Any, seconds: float) -> None:
    """Of a wrist."""
    for axis in (0, 1):
        device.body.hold(axis, device.body.angles[axis] + 100 * seconds)


def one_finger(device: Any, seconds: float) -> None:
    """Of an RH56 hand: all the others obey."""
    finger = device.hand.body.fingers[2]
    finger.hold(finger.angle + 40 * seconds)


def motor(device: Any, seconds: float) -> None:
    """Of a BarrettHand."""
    device.hand.motors[0].place += 100 * seconds


def encoder(device: Any, seconds: float) -> None:
    """Of an AIDIN-hand, whose currents have vanished."""
    device.hand.motors[3].place += 20000 * seconds


ROWS = [
    Row("exo", fingers, bytes.fromhex("EB90010B32"), holds=5),
    Row("wrist", axes, bytes.fromhex("EB900107310E04"), holds=7),
    Row("wrist", axes, bytes.fromhex("15038001"), "bus=can", holds=4),
    Row("hand", one_finger, bytes.fromhex("EB90010F12F205")),
    Row("hand", one_finger, bytes.fromhex("EB90010F12F205"), "", "stop --protocol eb90"),
    Row("hand", one_finger, bytes.fromhex("011005F2"), "", "stop --protocol modbus"),
    Row("hand", one_finger, bytes.fromhex("1005F2"), "bus=modbus-tcp"),
    Row("hand", one_finger, bytes.fromhex("057E8001"), "bus=can"),
    Row("hand", one_finger, bytes.fromhex("EB90011D12"), "model=dg2", "stop --model dg2"),
    Row("barrett", motor, b"T\r", "initialized=1"),
    Row("barrett", motor, b"1T\r", "initialized=1", "stop --motors 1"),
    Row("barrett", motor, b"T\r", "found=moving"),
    Row("barrett", motor, b"T\r", "found=loop-moving"),
    Row("aidin", encoder, b'"hand_mode":3', "start=homed"),
    Row("aidin", encoder, b'"hand_mode":3', "start=homed&exchange=poll"),
]  # fmt: skip
NOT_SEEN = {"ekso": "it does not tell what CancelAction has cancelled, so nothing is seen that goes on (ekso §6)"}


def whole(can_id: int | None, data: bytes) -> bytes:
    """What is sent, with its identifier on CAN."""
    return data if can_id is None else can_id.to_bytes(4, "big") + data


def going_on(row: Row, obeys: int) -> Callable[[Any], None]:
    """What makes a device of a line that obeys after so many of its `row.stop`."""

    def made(line: Any) -> None:
        device, frames = line.device, hasattr(line, "feed_frame")
        advance, feed = device.advance, line.feed_frame if frames else line.feed
        heard, before = [0], list[float]()

        def advanced(_device: Any, now: float) -> None:
            advance(now)
            if before and heard[0] <= obeys:
                row.goes_on(device, now - before.pop())
            before[:] = [now]

        def fed(*given: Any, **more: Any) -> None:
            heard[0] += row.stop in (whole(*given[:2]) if frames else given[0])
            feed(*given, **more)

        device.advance = MethodType(advanced, device)
        setattr(line, "feed_frame" if frames else "feed", fed)

    return made


def stopped(row: Row, obeys: int, trace: Path) -> tuple[Result, list[bytes], float]:
    """The stop of such a device by its command: the result, what it wrote, and the seconds."""
    trace.unlink(missing_ok=True)
    link = f"fake://{row.family}?clock=virtual&{row.options}"
    with spying(going_on(row, obeys)) as spy:
        result = run(row.family, *row.words.split(), "-p", link, "--json", "--trace", trace)
    writes = facts_of(row.family).rule("stop")
    sent = [entry for entry in passed(trace) if writes(entry) and entry.mark == ">"]
    return result, [whole(one.can_id, one.data) for one in sent], spy.now


ONCE = lambda steps, context: steps(context)  # noqa: E731


def alone(row: Row, obeys: int, trace: Path) -> tuple[Result, list[bytes], float]:
    """The same without a second stop."""
    with swapped((stop_sequence, "once_more", ONCE), (barrett, "once_more", ONCE)):
        return stopped(row, obeys, trace)


def same(row: Row, frames: Sequence[bytes]) -> list[bytes]:
    """Without the places that a hold has."""
    held = [row.holds and frame.startswith(row.stop[: row.holds]) for frame in frames]
    return [frame[: row.holds] if one else frame for frame, one in zip(frames, held, strict=True)]


def test_each_family_is_here_or_says_why_not() -> None:
    assert {row.family for row in ROWS} | NOT_SEEN.keys() == set(FAMILIES)


@pytest.mark.parametrize("family", sorted({row.family for row in ROWS}))
def test_the_whole_stop_goes_out_once_more(family: str, tmp_path: Path) -> None:
    for row in [row for row in ROWS if row.family == family]:
        trace = tmp_path / "t.txt"
        healthy, obeyed, _ = alone(row, AT_ONCE, trace)
        refused, ignored, seconds = alone(row, NEVER, trace)
        assert (healthy.code, refused.code) == (0, 6), (row, healthy, refused)
        count = sum(row.stop in frame for frame in ignored)
        assert count, (row, ignored)

        result, sent, _ = stopped(row, count, trace)
        assert same(row, sent) == same(row, [*ignored, *obeyed]), (row, sent)
        assert (result.code, result.error["code"]) == (6, "refused"), (row, result)
        text = result.error["text"]
        assert f"{AGAIN}{'' if family == 'aidin' else ', and now it stands still'}: " in text, (row, text)
        holds = [frame for frame in sent if row.holds and frame.startswith(row.stop[: row.holds])]
        assert len(set(holds)) == (2 if row.holds else 0), (row, "each hold is where it is by then")

        result, sent, took = stopped(row, NEVER, trace)
        assert same(row, sent) == 2 * same(row, ignored), (row, sent)
        assert (result.code, result.error["code"]) == (6, "refused"), (row, result)
        text = result.error["text"]
        assert AGAIN in text and "does not obey" in text and "now it stands" not in text, (row, result)
        assert took < min(2 * seconds + 1.0, STOP_SECONDS), (row, took, seconds)


@pytest.mark.parametrize("family", sorted({row.family for row in ROWS}))
def test_a_deadline_that_ends_the_second_stop_leaves_what_the_first_one_has_seen(family: str, tmp_path: Path) -> None:
    """By the family's command, and by the one that finds the family. Whether the second one went out is not said."""
    for row in [row for row in ROWS if row.family == family]:
        _, _, first = alone(row, NEVER, tmp_path / "t.txt")
        _, _, both = stopped(row, NEVER, tmp_path / "t.txt")
        within = (first + both) / 2
        link = f"fake://{family}?clock=virtual&{row.options}"
        for words in [(family, *row.words.split()), *[("stop",)] * (row.words == "stop")]:
            with spying(going_on(row, NEVER)) as spy:
                result = run(*words, "-p", link, "--json", "--deadline", str(within))
            assert (result.code, spy.now <= within + 0.1) == (6, True), (row, words, result)
            text = result.error["text"]
            assert "does not obey" in text and "deadline passed" in text and AGAIN not in text, (row, words, text)


def test_a_stop_that_may_pause_passes_its_deadline_on() -> None:
    with spying(going_on(ROWS[0], NEVER)):
        link = open_link("fake://exo?clock=virtual")
        sequence = TwoParts(partial(stop_sequence_of, "exo"))(context_for_link(link, Settings()))
        result = RunningStop(link, sequence, until=link.deadline(1.8)).finish()
    assert (result.error, result.goes_on, AGAIN in result.text) == (DeviceRefused, True, False), result


# -- the other ways of a BarrettHand, which has a stop for single motors ---------------------------------------------------

ONE_MOTOR = Row("barrett", motor, b"1T\r", "initialized=1")
REALTIME = "realtime --motors 1 --velocity 20 --receive position --count 20"


@each_row(
    ("more", "obeys", "ends"),
    [
        ("", 1, [b"1T\r", b"\x03", b"1T\r"]),
        ("", NEVER, [b"1T\r", b"\x03", b"1T\r"]),
        (" --hold", AT_ONCE, [b"\x03", b"1T\r"]),
        (" --hold", 1, [b"\x03", b"1T\r", b"\x03", b"1T\r"]),
        (" --hold", NEVER, [b"\x03", b"1T\r", b"\x03", b"1T\r"]),
    ],
)
def test_behind_realtime_the_whole_stop_goes_out_once_more(more: str, obeys: int, ends: list[bytes]) -> None:
    """The first one is velocity 0 and ^C, and T without --hold; at its prompt the hand gets ^C and T."""
    with TemporaryDirectory() as folder:
        result, sent, took = stopped(ONE_MOTOR._replace(words=REALTIME + more), obeys, Path(folder) / "t.txt")
    first = sent.index(b"c\x00")
    assert sent[first:] == [b"c\x00", b"\x03", *ends], sent
    _, end = result.stream
    error = next(one for one in end["messages"] if one["level"] == "error")
    assert (result.code, f"{AGAIN}, and now it stands still: " in error["text"]) == (6, obeys != NEVER), error
    assert took < 4.0


def by_child(hand: BarrettHand) -> Stopped:
    """The death of handctl in a realtime loop."""
    return StopPlan("barrett", hand.stop_context(), partial(barrett.power_off, prefix="1"))(hand.link)


def by_ctrl_c(hand: BarrettHand) -> Stopped:
    """In a movement: the motors keep their power where ^C is obeyed."""
    return hand.stop(powered=True)


def found_elsewhere(hand: BarrettHand) -> Stopped:
    """A hand that was found in another way."""
    try:
        return Stopped(motion.find_and_power_off(hand, "1"))
    except DeviceRefused as exc:
        return Stopped(exc.text, error=DeviceRefused)


@each_row(
    ("way", "stop", "frames"),
    [
        (by_child, b"1T\r", [b"\x03", b"1T\r", b"\x03", b"1T\r"]),
        (by_ctrl_c, b"T\r", [b"\x03", b"\x03", b"T\r", b"\x03", b"T\r"]),
        (found_elsewhere, b"1T\r", [b"1T\r", b"\x03", b"1T\r"]),  # ^C has found it
    ],
)
def test_each_way_sends_the_whole_stop_once_more(
    way: Callable[[Any], Stopped], stop: bytes, frames: list[bytes]
) -> None:
    for obeys in (1, NEVER):
        with spying(going_on(ONE_MOTOR._replace(stop=stop), obeys)):
            hand, link = simulated("initialized=1")
            link.sent.clear()
            result = way(hand)
        assert [data for data in link.sent if data == b"\x03" or data.endswith(b"T\r")] == frames, obeys
        assert (result.error, f"{AGAIN}, and now it stands still: " in result.text) == (DeviceRefused, obeys == 1), (
            result
        )
