"""Calibration and motion until arrival, both on a worn hand, and Ctrl-C meanwhile (exo §2.2.2, §2.3.6)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from handctl.devices.inspire import exo_motion as procedures
from handctl.errors import DeviceRefused, HandctlError, NoAnswer
from handctl.guide import Guide
from tests.support import (
    NotedGuide,
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    message,
    unhex,
    zeros_to_reads,
)

CALIBRATE, CALIBRATE_ACK = "EB 90 01 04 12 F1 03 01 0C", "90 EB 01 04 12 F1 03 01 0C"
CALIBRATED = "90 EB 01 04 11 02 00 00 18"
HOLD_FLAG = 0x32


# -- calibration ------------------------------------------------------------------------------------------------------


def test_calibration_reports_its_end() -> None:
    hand, link = fake_hand()
    guide = NotedGuide()
    table = procedures.calibrate(hand, guide)
    assert table.rows[0]["value"] == "completed"
    assert table.rows[0]["seconds"] == pytest.approx(11.7, abs=0.1)
    assert changing(link.sent) == [CALIBRATE]
    assert [row["value"] for row in table.rows[1:]] == [500, 500, 500, 500, 400, 0, 0, 0, 0, 0, 0]
    assert any("calibrating" in text for text in guide.shown)


def test_nothing_is_sent_during_a_calibration() -> None:
    hand, link = fake_hand()
    procedures.calibrate(hand, Guide())
    assert hexed(link.sent[0]) == CALIBRATE
    assert link.sent_at[1] >= link.sent_at[0] + 11.7


def test_calibration_without_a_report_ends_after_30_seconds() -> None:
    hand, link = fake_hand("fault=no-late-frames")
    table = procedures.calibrate(hand, Guide())
    assert table.rows[0]["value"] == "not reported"
    assert 30.0 <= link.sent_at[1] < 31.0
    assert "no completion report" in message(hand, "no-completion")
    assert "undocumented" in message(hand, "no-completion")


def calibrating(*replies: tuple[float, str]) -> ScriptedLink:
    def answer(request: bytes) -> list[Reply]:
        if hexed(request) == CALIBRATE:
            return [(delay, unhex(data)) for delay, data in replies]
        return zeros_to_reads(request)

    return ScriptedLink(answer)


@pytest.mark.parametrize("moment", [0.01, 0.249, 0.2499, 0.25, 0.2501, 5.0, 9.75, 29.9])
@pytest.mark.parametrize("cut", [1, 2, 4, 8])
def test_end_of_calibration_in_two_pieces(moment: float, cut: int) -> None:
    """Bluetooth and USB adapters split frames anywhere (dossier 1.1); no moment may lose one."""
    data = CALIBRATED.split()
    link = calibrating((0.0, CALIBRATE_ACK), (moment, " ".join(data[:cut])), (moment + 0.02, " ".join(data[cut:])))
    table = procedures.calibrate(hand_on(link), Guide())
    assert table.rows[0]["value"] == "completed"


def test_ack_and_end_of_calibration_in_one_piece() -> None:
    link = calibrating((0.1, f"{CALIBRATE_ACK} {CALIBRATED}"))
    assert procedures.calibrate(hand_on(link), Guide()).rows[0]["value"] == "completed"


def test_calibration_refused_or_unanswered() -> None:
    with pytest.raises(DeviceRefused):
        procedures.calibrate(hand_on(calibrating((0.0, "90 EB 01 04 12 F1 03 00 0B"))), Guide())
    with pytest.raises(NoAnswer) as caught:
        procedures.calibrate(hand_on(link := calibrating()), Guide())
    assert changing(link.sent) == [CALIBRATE]
    assert "calibrat" in f"{caught.value.text} {caught.value.hint}", "it may be running: the wearer must know"


@pytest.mark.parametrize("moment", [0.01, 0.1, 3.0, 12.0])
def test_interrupted_calibration_says_that_it_goes_on(moment: float) -> None:
    link = calibrating((0.05, CALIBRATE_ACK))
    link.interrupt_at = moment
    with pytest.raises(HandctlError) as caught:
        procedures.calibrate(hand_on(link), Guide())
    assert caught.value.exit_code == 130
    assert "goes on calibrating" in caught.value.text
    assert [hexed(request) for request in link.sent] == [CALIBRATE]


# -- motion -----------------------------------------------------------------------------------------------------------

TARGET = [500, 400, 300, 200, 100]


def test_motion_is_watched_until_arrival() -> None:
    hand, link = fake_hand()
    table = procedures.move(hand, TARGET, Guide(), wait=5.0)
    assert [row["value"] for row in table.rows] == [*TARGET, 660]
    assert [row["target"] for row in table.rows] == [*TARGET, None]
    assert codes(hand) == []
    assert link.now() < 1.5
    assert len(changing(link.sent)) == 1


def test_blocked_motion_ends_short_of_its_target() -> None:
    hand, link = fake_hand("fault=blocked")
    table = procedures.move(hand, TARGET, Guide(), wait=5.0)
    assert [row["value"] for row in table.rows][:5] == [110, 220, 330, 440, 550]
    assert "short" in codes(hand)
    assert link.now() < 2.0


def test_motion_that_takes_longer_than_the_wait() -> None:
    hand, link = fake_hand()
    procedures.move(hand, [1000, 1000, 1000, 1000, 1000], Guide(), wait=0.2)
    assert "moving" in codes(hand)
    assert link.now() < 0.5
    assert len(changing(link.sent)) == 1


def test_interrupted_motion_is_held_where_it_is() -> None:
    hand, link = fake_hand()
    link.interrupt_at = 0.3
    with pytest.raises(HandctlError) as caught:
        procedures.move(hand, [1000, 1000, 1000, 1000, 1000], Guide(), wait=5.0)
    assert caught.value.exit_code == 130
    assert "hold at" in caught.value.text
    first, hold = changing(link.sent)
    assert hold.startswith("EB 90 01 0B 32 ")
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
        procedures.move(hand, [1000, 1000, 1000, 1000, 1000], Guide(), wait=5.0)
    assert getattr(caught.value, "exit_code", 130) == 130
    assert len(changing(link.sent)) == 2


def moving_at(positions: list[int], interrupt_after: float) -> ScriptedLink:
    """A hand that always reports these positions."""

    def answer(request: bytes) -> list[Reply]:
        if request[4] == HOLD_FLAG:
            return [(0.0, unhex("90 EB 01 0B 32 00 00 00 00 00 00 00 00 00 00 3E"))]
        data = b"".join(value.to_bytes(2, "little", signed=True) for value in positions)
        body = b"\x01\x0f\x11\x0a\x06" + data
        return [(0.0, b"\x90\xeb" + body + bytes([sum(body) % 256]))]

    link = ScriptedLink(answer)
    link.interrupt_at = interrupt_after
    return link


def test_hold_is_not_commanded_out_of_range() -> None:
    link = moving_at([1003, 500, 500, 500, -2, 500], 0.2)
    with pytest.raises(HandctlError) as caught:
        procedures.move(hand_on(link), TARGET, Guide(), wait=5.0)
    assert caught.value.exit_code == 130
    assert "switch the power off" in caught.value.text
    assert len(changing(link.sent)) == 1


def test_hold_that_fails_is_told() -> None:
    link = moving_at([1, 2, 3, 4, 5, 6], 0.2)
    plain: Callable[[bytes], list[Reply]] = link.answer  # type: ignore[assignment]

    def answer(request: bytes) -> list[Reply]:
        return [] if len(changing(link.sent)) == 2 else plain(request)

    link.answer = answer
    with pytest.raises(HandctlError) as caught:
        procedures.move(hand_on(link), TARGET, Guide(), wait=5.0)
    assert caught.value.exit_code == 130
    assert "could NOT be stopped" in caught.value.text
