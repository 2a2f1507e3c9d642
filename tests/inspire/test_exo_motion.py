"""Calibration and motion until arrival, both on a worn hand, and Ctrl-C meanwhile (exo §2.2.2, §2.3.6)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from handctl.devices.inspire import raw
from handctl.devices.inspire.exo import calibration
from handctl.devices.inspire.exo import device as procedures
from handctl.devices.inspire.exo.register_map import EXO
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, LinkError, NoAnswer
from handctl.model.prompts import Prompts
from handctl.model.stop_on_interrupt import NOT_STOPPED
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers
from tests.support.scripted import (
    NotedGuide,
    RecordedLink,
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    message,
    reply_to,
    unhex,
    zeros_to_reads,
)

CALIBRATE, CALIBRATE_ACK = "EB 90 01 04 12 F1 03 01 0C", "90 EB 01 04 12 F1 03 01 0C"
CALIBRATED = "90 EB 01 04 11 02 00 00 18"
WRITE_FLAG, RELEASE_FLAG, HOLD_FLAG = 0x12, 0x31, 0x32
FORCE_SET = b"\xda\x05"
RELEASE = "EB 90 01 0B 31 00 00 00 00 00 00 00 00 00 00 3D"
HELD = "EB 90 01 0B 32 6E 00 DC 00 4A 01 B8 01 26 02 B4"
UNMOVED = "EB 90 01 0D 12 CE 05 FF FF FF FF FF FF FF FF FF FF E9"


# -- calibration ------------------------------------------------------------------------------------------------------


def test_calibration_reports_its_end() -> None:
    hand, link = fake_hand()
    prompts = NotedGuide()
    table = calibration.calibrate(hand, prompts)
    assert table.rows[0]["value"] == "completed"
    assert table.rows[0]["seconds"] == pytest.approx(11.7, abs=0.1)
    assert changing(link.sent) == [CALIBRATE]
    assert [row["value"] for row in table.rows[1:]] == [500, 500, 500, 500, 400, 0, 0, 0, 0, 0, 0]
    assert any("calibrating" in text for text in prompts.shown)


def test_nothing_is_sent_during_a_calibration() -> None:
    hand, link = fake_hand()
    calibration.calibrate(hand, Prompts())
    assert hexed(link.sent[0]) == CALIBRATE
    assert link.sent_at[1] >= link.sent_at[0] + 11.7


def test_calibration_without_a_report_ends_after_30_seconds() -> None:
    hand, link = fake_hand("fault=no-late-frames")
    table = calibration.calibrate(hand, Prompts())
    assert table.rows[0]["value"] == "not reported"
    assert 30.0 <= link.sent_at[1] < 31.0
    assert "did not report that the calibration ended within 30 s" in message(hand, "no-completion")
    assert "not documented" in message(hand, "no-completion")


def calibrating(*replies: tuple[float, str]) -> ScriptedLink:
    def answer(request: bytes) -> list[Reply]:
        if hexed(request) == CALIBRATE:
            return [(delay, unhex(data)) for delay, data in replies]
        return zeros_to_reads(request)

    return ScriptedLink(answer)


@each_row("moment", [9.01, 9.249, 9.2499, 9.25, 9.2501, 14.0, 18.75, 29.9])
@each_row("cut", [1, 2, 4, 8])
def test_end_of_calibration_in_two_pieces(moment: float, cut: int) -> None:
    """Bluetooth and USB adapters split frames anywhere (dossier 1.1); no moment may lose one."""
    data = CALIBRATED.split()
    link = calibrating((0.0, CALIBRATE_ACK), (moment, " ".join(data[:cut])), (moment + 0.02, " ".join(data[cut:])))
    table = calibration.calibrate(hand_on(link), Prompts())
    assert table.rows[0]["value"] == "completed"


@each_row(
    ("end", "errors", "value", "code"),
    [
        (0x00, (0, 0, 0, 0, 0), "completed", None),
        (0xFF, (0, 0, 0, 0, 0), "ended", "not-calibrated"),  # a failed save reports FF
        (0x01, (0, 0, 0, 0, 0), "ended", "not-calibrated"),
        (0x00, (2, 2, 2, 2, 2), "ended", "not-calibrated"),
        (0x00, (0, 0, 1, 0, 0), "ended", "not-calibrated"),
        (None, (0, 0, 0, 0, 0), "not reported", None),
        (None, (0, 0, 0, 0, 16), "not reported", "not-calibrated"),
        (0x00, None, "completed", None),  # a firmware without error bits
        (0xFF, None, "ended", "not-calibrated"),
    ],
)
def test_calibration_is_judged_by_its_report_and_by_the_errors_after_it(
    end: int | None, errors: tuple[int, ...] | None, value: str, code: str | None
) -> None:
    reported = [] if end is None else [(12.0, f"90 EB 01 04 11 02 00 {end:02X} {(0x18 + end) % 256:02X}")]
    link = calibrating((0.0, CALIBRATE_ACK), *reported)
    plain: Callable[[bytes], list[Reply]] = link.answer  # type: ignore[assignment]

    def answer(request: bytes) -> list[Reply]:
        start, count = int.from_bytes(request[5:7], "little"), request[7]
        if request[4] != 0x11 or not start <= 1606 < start + count:
            return plain(request)
        if errors is None:
            return []
        memory = bytearray(count)
        memory[1606 - start : 1611 - start] = bytes(errors)
        return [(0.0, reply_to(request, bytes(memory)))]

    link.answer = answer
    table = calibration.calibrate(hand_on(link), Prompts())
    assert table.rows[0]["value"] == value
    assert (table.failure.code if table.failure else None) == code
    assert table.failure is None or table.failure.exit_code == 7
    assert [row["value"] for row in table.rows if row["name"] == "error"] == [one for one in errors or () if one]


def test_ack_and_end_of_calibration_in_one_piece() -> None:
    link = calibrating((0.1, f"{CALIBRATE_ACK} {CALIBRATED}"))
    calibration.calibrate(hand := hand_on(link), Prompts())
    assert codes(hand)[0] == "early-end"


FAILED = "90 EB 01 04 11 02 00 FF 17"


@each_row(
    ("reports", "value", "code", "until"),
    [
        ([(0.05, CALIBRATED)], "not reported", None, 30.0),
        ([(8.9, CALIBRATED)], "not reported", None, 30.0),
        ([(0.05, CALIBRATED), (12.0, CALIBRATED)], "completed", None, 12.0),
        ([(0.05, FAILED)], "ended", "not-calibrated", 30.0),
        ([(0.05, FAILED), (12.0, CALIBRATED)], "completed", None, 12.0),
    ],
)
def test_an_end_before_the_documented_steps_can_be_over_is_not_believed(
    reports: list[tuple[float, str]], value: str, code: str | None, until: float
) -> None:
    """The steps wait 9 s, and nothing is sent while they may be running (exo §2.3.6)."""
    link = calibrating((0.0, CALIBRATE_ACK), *reports)
    table = calibration.calibrate(hand := hand_on(link), Prompts())
    assert (table.rows[0]["value"], table.failure.code if table.failure else None) == (value, code)
    assert "early-end" in codes(hand) and link.sent_at[1] >= until
    assert table.failure is None or table.failure.exit_code == 7


def test_calibration_refused_or_unanswered() -> None:
    with pytest.raises(DeviceRefused):
        calibration.calibrate(hand_on(calibrating((0.0, "90 EB 01 04 12 F1 03 00 0B"))), Prompts())
    with pytest.raises(NoAnswer) as caught:
        calibration.calibrate(hand_on(link := calibrating()), Prompts())
    assert changing(link.sent) == [CALIBRATE]
    assert "calibrat" in f"{caught.value.text} {caught.value.hint}", "it may be running: the wearer must know"


@each_row("moment", [0.01, 0.1, 3.0, 12.0])
def test_interrupted_calibration_says_that_it_goes_on(moment: float) -> None:
    link = calibrating((0.05, CALIBRATE_ACK))
    link.interrupt_at = moment
    with pytest.raises(HandctlError) as caught:
        calibration.calibrate(hand_on(link), Prompts())
    assert (caught.value.exit_code, caught.value.code) == (6, NOT_STOPPED), "no stop was acknowledged: it goes on"
    assert "still calibrating" in caught.value.text
    assert [hexed(request) for request in link.sent] == [CALIBRATE]


# -- motion -----------------------------------------------------------------------------------------------------------

TARGET = dict(enumerate((500, 400, 300, 200, 100)))
OPEN = dict.fromkeys(range(5), 1000)


def test_motion_is_watched_until_arrival() -> None:
    hand, link = fake_hand()
    table = procedures.move(hand, TARGET, Prompts(), wait=5.0)
    assert [row["value"] for row in table.rows] == [*TARGET.values(), 660]
    assert [row["target"] for row in table.rows] == [*TARGET.values(), None]
    assert [row["arrival"] for row in table.rows] == ["reached"] * 5 + [None]
    assert table.failure is None and codes(hand) == []
    assert link.now() < 1.5
    assert len(changing(link.sent)) == 1


def test_blocked_motion_ends_short_of_its_target() -> None:
    hand, link = fake_hand("fault=blocked")
    table = procedures.move(hand, TARGET, Prompts(), wait=5.0)
    assert [row["value"] for row in table.rows][:5] == [110, 220, 330, 440, 550]
    assert isinstance(table.failure, CheckFailed) and table.failure.code == "blocked"
    assert link.now() < 2.0


def scripted_motion(
    place: Callable[[float], int], current: int = 25, error: int = 0, rest: int = 25, target: int = 900
) -> ScriptedLink:
    """A hand whose fingers are at `place`, by the seconds since its position command; its actuators draw `current` mA since then,
    and `rest` before. It reports `target` as the position that it is commanded to."""
    since: list[float] = []

    def answer(request: bytes) -> list[Reply]:
        if request[4] == HOLD_FLAG:
            since.append(link.now())
            return [(0.0, unhex("90 EB 01 0B 32 00 00 00 00 00 00 00 00 00 00 3E"))]
        memory = bytearray(2000)
        here = place(link.now() - since[0] if since else 0.0)
        memory[1546:1558] = here.to_bytes(2, "little", signed=True) * 6
        memory[1486:1496] = target.to_bytes(2, "little") * 5
        memory[1594:1604] = (current if since else rest).to_bytes(2, "little") * 5
        memory[1606:1611] = bytes([error] * 5)
        start = int.from_bytes(request[5:7], "little")
        return [(0.0, reply_to(request, bytes(memory[start : start + request[7]])))]

    link = ScriptedLink(answer)
    return link


def late(seconds: float) -> int:
    """It begins after a second, and then takes 0.8 s."""
    return 110 + round(min(max(seconds - 1.0, 0.0), 0.8) / 0.8 * 790)


def pausing(seconds: float) -> int:
    """Half of the way, a pause of 1.5 s, the other half."""
    return 110 + round((min(seconds, 0.4) + min(max(seconds - 1.9, 0.0), 0.4)) / 0.8 * 790)


def stalls(seconds: float) -> int:
    return 110 + round(min(seconds, 0.4) / 0.8 * 790)


def creeps(seconds: float) -> int:
    return 110 + round(seconds * 60)


NINE = dict.fromkeys(range(5), 900)


@each_row(
    ("place", "current", "error", "wait", "arrival"),
    [
        (late, 25, 0, 8.0, "reached"),
        (pausing, 25, 0, 8.0, "reached"),
        (late, 25, 0, 0.0001, "moving"),
        (late, 25, 0, 1.0, "moving"),  # it has stood still, but may begin yet
        (pausing, 25, 0, 1.5, "moving"),
        (lambda _: 110, 25, 0, 8.0, "unmoved"),
        (lambda _: 110, 200, 0, 8.0, "unmoved"),  # what it draws at rest is no contact
        (stalls, 900, 0, 8.0, "contact"),
        (stalls, 25, 0, 8.0, "short"),
        (lambda _: 110, 900, 1, 8.0, "blocked"),
        (creeps, 25, 2, 2.0, "moving"),  # an error alone is no standstill
    ],
)  # fmt: skip
def test_how_motion_ends(place: Callable[[float], int], current: int, error: int, wait: float, arrival: str) -> None:
    link = scripted_motion(place, current, error)
    table = procedures.move(hand_on(link), NINE, Prompts(), wait=wait)
    assert [row["arrival"] for row in table.rows] == [arrival] * 5 + [None]
    assert (table.failure is None) == (arrival == "reached")


def passing(seconds: float) -> int:
    """To 900 and on to 1000."""
    return 113 + round(min(seconds, 0.9) / 0.8 * 790)


def turning_back(seconds: float) -> int:
    """Up for a moment, and then to 0."""
    return max(0, 150 - round(200 * seconds)) if seconds > 0.2 else 110 + round(200 * seconds)


@each_row(
    ("place", "rest", "target", "arrival", "code", "asked"),
    [
        (stalls, 25, 900, "contact", 0, 0),
        (stalls, 700, 900, "contact", 0, 0),
        (stalls, 801, 900, "short", 0, 0),  # it drew as much at rest
        (stalls, 900, 900, "short", 0, 0),
        (stalls, 900, 300, "short", 0, 0),
        (lambda _: 110, 25, 900, "unmoved", 7, 0),  # whatever it draws, it has not met anything on its way
        (passing, 25, 999, "astray", 6, 1),
        (passing, 25, 900, "astray", 6, 1),
        (turning_back, 25, 0, "astray", 6, 1),
        (lambda seconds: 110 - min(20, round(90 * seconds)), 900, 900, "short", 0, 0),  # no farther than a target may be
    ],
)  # fmt: skip
def test_an_end_off_the_way_to_the_target_is_none_that_is_expected(
    place: Callable[[float], int], rest: int, target: int, arrival: str, code: int, asked: int
) -> None:
    """By current only what has risen counts; who commands is asked once, and only where a finger went astray."""
    link = scripted_motion(place, 900, rest=rest, target=target)
    table = procedures.move(hand_on(link), NINE, Prompts(), wait=8.0, expect="any")
    assert [row["arrival"] for row in table.rows] == [arrival] * 5 + [None]
    assert (table.failure.exit_code if table.failure else 0) == code
    assert code != 6 or (table.failure is not None and table.failure.code == "astray")
    assert sum(request[4:7] == b"\x11\xce\x05" for request in link.sent) == asked


@each_row(
    ("place", "error", "arrival"),
    [
        (lambda seconds: 110 if seconds < 0.3 else -1, 0, "unread"),
        (lambda _: -1, 0, "unread"),
        (lambda seconds: 110 if seconds < 0.3 else -1, 16, "blocked"),
        (lambda seconds: 110 if seconds < 0.3 else -2, 0, "reached"),  # a little past the end
        (lambda seconds: -1 if 0.3 < seconds < 0.5 else 0, 0, "reached"),
    ],
)
def test_no_value_is_not_the_closed_end(place: Callable[[float], int], error: int, arrival: str) -> None:
    """-1 means that there is no value (exo §2.3.7). It is as near to 0 as a finger that has arrived there."""
    table = procedures.move(
        hand_on(scripted_motion(place, error=error)), dict.fromkeys(range(5), 0), Prompts(), wait=4.0
    )
    assert [row["arrival"] for row in table.rows if row["finger"] != "thumb_rotation"][:5] == [arrival] * 5
    assert (table.failure.exit_code if table.failure else 0) == (0 if arrival == "reached" else 7)


@each_row(
    ("words", "moving"),
    [
        (("position", "ring=900"), True),
        (("set", "position_set.ring=900"), True),
        (("write", "1488", "8403"), True),
        (("force", "ring=100"), True),
        (("write", "1001", "01"), False),
        (("set", "baud_code=1"), False),
    ],
)
def test_a_movement_that_reads_back_as_another_may_be_going_on(words: tuple[str, ...], moving: bool) -> None:
    """A device with limits of its own, or a second master: the finger is on its way somewhere (exo §2.3.7)."""
    with odd_registers(holds={1488: b"\x20\x03", 1500: b"\x07\x00", 1001: b"\x02"}):
        result = run("exo", *words, "-p", "fake://exo?clock=virtual", "-y", "--json")
    assert (result.code, result.error["code"]) == (7, "read-back")
    assert ("may be moving" in result.error["text"], "handctl exo stop" in result.error["hint"]) == (moving, moving)


@each_row(
    ("error", "steps", "command"),
    [
        (1, ("free the finger",), "exo clear-errors"),
        (2, ("cool",), ""),
        (3, ("cool", "free the finger"), "exo clear-errors"),
    ],
)
def test_the_next_step_fits_the_error_that_stopped_it(error: int, steps: tuple[str, ...], command: str) -> None:
    failure = procedures.move(hand_on(scripted_motion(stalls, 25, error)), NINE, Prompts(), wait=8.0).failure
    assert failure is not None and failure.code == "blocked"
    for step in steps:
        assert step in failure.hint.casefold()
    assert ("clear-errors" in failure.hint) == bool(command)


def test_motion_that_takes_longer_than_the_wait() -> None:
    hand, link = fake_hand()
    table = procedures.move(hand, OPEN, Prompts(), wait=0.2, expect="any")
    assert isinstance(table.failure, CheckFailed) and table.failure.code == "still-moving"
    assert link.now() < 0.5
    assert len(changing(link.sent)) == 1


def test_interrupted_motion_is_held_where_it_is() -> None:
    hand, link = fake_hand()
    link.interrupt_at = 0.3
    with pytest.raises(HandctlError) as caught:
        procedures.move(hand, OPEN, Prompts(), wait=5.0)
    assert caught.value.exit_code == 130
    first, release, hold = changing(link.sent)
    assert release == RELEASE and hold.startswith("EB 90 01 0B 32 ")
    held = unhex(hold)[5:15]
    places = [int.from_bytes(held[i : i + 2], "little") for i in range(0, 10, 2)]
    assert all(start < place < 1000 for start, place in zip([110, 220, 330, 440, 550], places, strict=True))
    assert first != hold


def test_interrupt_before_the_reply_of_the_command_holds_too() -> None:
    """The hand moves as soon as it got the command (exo §2.3.7): Ctrl-C from then on stops it (cli contract, 7)."""
    hand, link = fake_hand("turnaround=0.2")
    send = link.write

    def write(data: bytes, deadline: object) -> None:
        send(data, deadline)  # type: ignore[arg-type]
        if data[4] == HOLD_FLAG and len(changing(link.sent)) == 1:
            link.interrupt_at = 0.0

    link.write = write  # type: ignore[method-assign]
    with pytest.raises(BaseException) as caught:
        procedures.move(hand, OPEN, Prompts(), wait=5.0)
    assert getattr(caught.value, "exit_code", 130) == 130
    _, *releases, hold = changing(link.sent)
    assert set(releases) == {RELEASE} and hold.startswith("EB 90 01 0B 32 ")


def moving_at(positions: list[int], interrupt_after: float) -> ScriptedLink:
    """A hand that always reports these positions."""
    data = b"".join(value.to_bytes(2, "little", signed=True) for value in positions)

    def answer(request: bytes) -> list[Reply]:
        if request[4] == HOLD_FLAG:
            return [(0.0, unhex("90 EB 01 0B 32 00 00 00 00 00 00 00 00 00 00 3E"))]
        if request[4] == RELEASE_FLAG:
            body = b"\x01\x0d\x31" + data
            return [(0.0, b"\x90\xeb" + body + bytes([sum(body) % 256]))]
        if request[4] == WRITE_FLAG:
            return [(0.0, unhex("90 EB 01 04 12 CE 05 01 EB"))]
        return [
            (
                0.0,
                reply_to(
                    request, data.ljust(request[7], b"\0")[: request[7]] if request[5:7] != FORCE_SET else bytes(10)
                ),
            )
        ]

    link = ScriptedLink(answer)
    link.interrupt_at = interrupt_after
    return link


def test_hold_is_not_commanded_out_of_range() -> None:
    """A little past an end is held at that end; a finger whose reading is no position is left alone, and named."""
    held = "EB 90 01 0B 32 E8 03 F4 01 F4 01 F4 01 00 00 08"
    partly = "EB 90 01 0D 12 CE 05 E8 03 F4 01 FF FF F4 01 FF FF C4"
    for positions, code, hold in (
        ([1003, 500, 500, 500, -2, 500], 130, held),
        ([1003, 500, 1100, 500, -1, 500], 7, partly),
        ([-1, -1, 1021, -21, -1, 500], 7, UNMOVED),
    ):
        link = moving_at(positions, 0.2)
        with pytest.raises(HandctlError) as caught:
            procedures.move(hand_on(link), TARGET, Prompts(), wait=5.0)
        assert (caught.value.exit_code, {*changing(link.sent)[1:]}) == (code, {RELEASE, hold}), positions
        assert code == 130 or caught.value.code == NOT_STOPPED


def test_hold_that_fails_is_told() -> None:
    link = moving_at([1, 2, 3, 4, 5, 6], 0.2)
    plain: Callable[[bytes], list[Reply]] = link.answer  # type: ignore[assignment]

    def answer(request: bytes) -> list[Reply]:
        return [] if request[4] == HOLD_FLAG and RELEASE in changing(link.sent) else plain(request)

    link.answer = answer
    with pytest.raises(HandctlError) as caught:
        procedures.move(hand_on(link), TARGET, Prompts(), wait=5.0)
    assert (caught.value.exit_code, caught.value.code) == (4, NOT_STOPPED)
    assert "power off" in caught.value.hint
    _, *stop = changing(link.sent)
    assert [frame[12:14] for frame in stop] == ["31", "32"] * (len(stop) // 2) and len(stop) > 4


# -- Ctrl-C while an answer is awaited --------------------------------------------------------------------------------


def interrupted(link: RecordedLink, act: Callable[[], object]) -> HandctlError:
    """What Ctrl-C ends in when the first write has been sent, and its answer has not come."""
    send = link.write

    def write(data: bytes, deadline: object) -> None:
        send(data, deadline)  # type: ignore[arg-type]
        if len(changing(link.sent)) == 1 and data == link.sent[-1] and data[4] != 0x11:
            link.interrupt_at = 0.0

    link.write = write  # type: ignore[method-assign]
    with pytest.raises(HandctlError) as caught:
        act()
    assert caught.value.exit_code == 130
    return caught.value


def test_interrupted_force_command_is_released() -> None:
    """The force would stay on the worn hand (exo §2.2.1); Ctrl-C stops it (cli contract, 5 and 7)."""
    hand, link = fake_hand("turnaround=0.2")
    interrupted(link, lambda: procedures.command(hand, "force", dict(enumerate((100, 0, 0, 0, -100))), Prompts()))
    first, *releases, hold = changing(link.sent)
    assert first == "EB 90 01 0B 31 64 00 00 00 00 00 00 00 9C FF 3C"
    assert set(releases) == {RELEASE} and hold == HELD


def test_interrupted_position_command_is_held() -> None:
    hand, link = fake_hand("turnaround=0.2")
    interrupted(link, lambda: procedures.command(hand, "position", dict.fromkeys(range(5), 900), Prompts()))
    _, *releases, hold = changing(link.sent)
    assert set(releases) == {RELEASE} and hold[12:14] == "32"


@each_row("text", ["position_set.index=900", "force_set.little=100"])
def test_interrupted_set_is_stopped(text: str) -> None:
    """`set`, `restore` and `write` move the hand as the commands do (exo §2.3.7, §2.3.8)."""
    hand, link = fake_hand("turnaround=0.2")
    interrupted(link, lambda: hand.write(EXO.assignments([text])))
    _, *releases, hold = changing(link.sent)
    assert set(releases) == {RELEASE} and hold[12:14] == "32"


def test_interrupted_write_by_address_is_stopped() -> None:
    hand, link = fake_hand("turnaround=0.2")
    interrupted(link, lambda: raw.write(hand, 1498, unhex("64 00")))
    _, *releases, hold = changing(link.sent)
    assert set(releases) == {RELEASE} and hold == HELD


def test_interrupted_write_of_what_does_not_move_is_told() -> None:
    hand, link = fake_hand("turnaround=0.2")
    error = interrupted(link, lambda: hand.write(EXO.assignments(["baud_code=1"])))
    assert error.text == "interrupted: it is not known whether baud_code was written"
    assert len(changing(link.sent)) == 1


def test_a_release_without_an_answer_is_told() -> None:
    link = ScriptedLink()
    link.interrupt_at = 0.1
    hand = hand_on(link)
    with pytest.raises(HandctlError) as caught:
        procedures.command(hand, "force", dict.fromkeys(range(5), 100), Prompts())
    assert (caught.value.exit_code, caught.value.code) == (4, NOT_STOPPED)
    where = "EB 90 01 04 11 0A 06 0C 32"
    assert [hexed(data) for data in link.sent[1:]] == [RELEASE] * 7 + [where], (
        "for a second, and no hold without a place"
    )
    assert "power off" in caught.value.hint


def test_the_deadline_does_not_keep_a_hand_from_being_stopped() -> None:
    hand, link = fake_hand("turnaround=0.2")
    hand.bus.bound = link.deadline(0.1)
    link.sleep(0.2)
    assert hand.bus.over and hand.stop().error is None
    assert hexed(link.sent[0]) == RELEASE


@each_row("which", ["force", "position"])
def test_a_lost_answer_of_a_command_says_that_the_hand_may_act(which: str) -> None:
    """Never blindly repeated: after a lost reply, read first (cli contract, 7)."""
    hand, link = fake_hand("fault=silent")
    with pytest.raises(NoAnswer):
        procedures.command(hand, which, dict(enumerate((1, 2, 3, 4, 5))), Prompts())
    assert "may still carry it out" in message(hand, "ack-lost")
    assert len(changing(link.sent)) == 1


def test_a_command_that_was_not_sent_is_not_said_to_act() -> None:
    hand, link = fake_hand()
    hand.bus.bound = link.deadline(0.0)
    link.sleep(0.1)
    with pytest.raises(NoAnswer):
        procedures.command(hand, "force", dict(enumerate((1, 2, 3, 4, 5))), Prompts())
    assert (link.sent, codes(hand)) == ([], [])


# -- a link that is lost, a hand that falls silent ----------------------------------------------------------------------


@each_row("fault", ["disconnect", "silent", "bad-checksum"])
def test_a_motion_that_cannot_be_watched_any_more_may_go_on(fault: str) -> None:
    hand, link = fake_hand(f"fault={fault}&after=3")
    with pytest.raises(HandctlError) as caught:
        procedures.move(hand, OPEN, Prompts(), wait=5.0)
    assert caught.value.exit_code == {"disconnect": 3, "silent": 4, "bad-checksum": 5}[fault]
    assert "The fingers may still move" in caught.value.text
    assert "power" in caught.value.hint and caught.value.left.moving
    written = changing(link.sent)
    assert all(one in (written[0], RELEASE) for one in written), "only the stop was tried behind it"
    assert RELEASE in written


def test_a_link_lost_during_a_command_or_a_write_is_told() -> None:
    hand, _ = fake_hand("fault=disconnect")
    with pytest.raises(LinkError) as caught:
        procedures.command(hand, "force", dict.fromkeys(range(5), 100), Prompts())
    assert "may still move" in caught.value.text
    hand, _ = fake_hand("fault=disconnect")
    with pytest.raises(LinkError) as caught:
        hand.write(EXO.assignments(["position_set.index=300"]))
    assert "It is not known whether position_set.index was written, and the device may move" in caught.value.text


def test_a_link_lost_during_a_calibration_says_that_it_goes_on() -> None:
    hand, _ = fake_hand("fault=disconnect")
    with pytest.raises(LinkError) as caught:
        calibration.calibrate(hand, Prompts())
    assert "still calibrating" in caught.value.text


@each_row(
    ("family", "address", "targets", "places", "code"),
    [
        ("exo", 1486, "FFFF FFFF FFFF FFFF FFFF", "0000", 8),
        ("exo", 1486, "FFFF FFFF FFFF F401 FFFF", "0000", 8),
        ("exo", 1486, "F401 F401 F401 F401 F401", "0000", 8),
        ("exo", 1486, "0000 0000 0000 0000 0000", "0000", 0),
        ("exo", 1486, "0000 0000 0000 0000 0000", "FEFF", 0),
        ("exo", 1486, "0000 0000 0000 0000 0000", "FFFF", 8),
        ("hand", 1474, "FFFF FFFF FFFF FFFF FFFF FFFF FFFF FFFF FFFF FFFF FFFF FFFF", "", 8),
    ],
)
def test_clearing_an_error_asks_where_a_target_or_place_is_not_shown(
    family: str, address: int, targets: str, places: str, code: int
) -> None:
    """An actuator with an error was driven: where its target or position reads -1, nobody knows whether it goes on (exo §2.3.7)."""
    holds = {address: unhex(targets), 1498: bytes(10), 1606: bytes([1] * 6)}
    if family == "exo":
        holds[1546] = unhex(places) * 6
    with odd_registers(holds=holds):
        result = run(family, "clear-errors", "-p", f"fake://{family}?clock=virtual", "--json")
    assert (result.code == 8) == (code == 8), result
