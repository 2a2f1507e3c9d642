"""The CAN wire against the simulated bus: what can be passed over is, the rest is named, nothing is written."""

from __future__ import annotations

import pytest

from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.hand.explain_bytes import words
from handctl.errors import HandctlError
from handctl.link import CanFrame, FrameLink
from handctl.link.transcript import observed
from handctl.model.result import Journal
from tests.inspire.wrist_support import ScriptedFrames, fake_wrist, writes_of
from tests.support.each_row import each_row
from tests.support.scripted import hexed, unhex


@each_row("fault", ["noise", "late", "slow", "duplicate", "stale", "echo"])
@each_row("seed", range(4))
def test_what_can_be_passed_over(fault: str, seed: int) -> None:
    wrist, _ = fake_wrist("can", f"fault={fault}&seed={seed}", timeout=1.0)
    for _ in range(3):
        assert hexed(wrist.bus.read(1020, 8)) == "A7 FE 65 04 6F 00 DE 00"
        assert hexed(wrist.bus.read(1038, 6)) == "4C 04 D4 FE BC 02"
    wrist.bus.write(1042, unhex("F4 01"))
    assert hexed(wrist.bus.read(1042, 2)) == "F4 01"


@each_row(
    ("fault", "code", "exit_code"),
    [
        ("silent", "no-answer", 4),
        ("deaf", "no-answer", 4),
        ("no-wrist", "no-answer", 4),
        ("twin-id", "no-answer", 4),
        ("no-ack", "no-ack", 4),
        ("bus-off", "bus-off", 3),
        ("truncate", "cut-short", 5),
        ("wrong-id", "wrong-id", 5),
        ("loopback", "echo", 5),
        ("disconnect", "lost", 3),
    ],
)
def test_faults_of_the_simulator_are_named(fault: str, code: str, exit_code: int) -> None:
    wrist, link = fake_wrist("can", f"fault={fault}")
    with pytest.raises(HandctlError) as caught:
        wrist.bus.read(1020, 2)
    assert (caught.value.code, caught.value.exit_code) == (code, exit_code)
    assert writes_of(link) == []


def test_busy_bus() -> None:
    """900 foreign frames a second: counted, and no value is disturbed."""
    wrist, _ = fake_wrist("can", "traffic=900&wire=auto")
    for _ in range(20):
        assert hexed(wrist.bus.read(1020, 8)) == "A7 FE 65 04 6F 00 DE 00"
        wrist.bus.pause(0.05)
    assert (wrist.journal.counters.foreign_frames or 0) > 500
    assert wrist.journal.counters.retries == 0


@each_row(
    ("second", "count", "told"),
    [("4C 04", 2, True), ("A7 FE", 2, False), ("4C", 2, False), ("02", 2, False)],
)
def test_a_second_reply_with_other_data_is_told(second: str, count: int, told: bool) -> None:
    """Two devices with one id, one behind the other: the first reply was shown, and nobody looked at the second."""

    def answer(request: CanFrame) -> list[tuple[float, CanFrame]]:
        return [(0.0, CanFrame(request.can_id, unhex("A7 FE"))), (0.001, CanFrame(request.can_id, unhex(second)))]

    journal = Journal()
    bus = CanBus(link := ScriptedFrames(answer), 1, journal)
    for _ in range(3):
        assert hexed(bus.read(1020, count)) == "A7 FE"
        link.sleep(0.01)
    assert [message.code for message in journal.messages] == ["two-replies"] * told


READ, WRITE = 0x00000001 | 1000 << 14, 0x04000001 | 1005 << 14
"""Of a hand with id 1 (rh56 §2.4)."""


@each_row(
    ("reads_first", "echoes", "acknowledges", "state", "code"),
    [
        (True, False, True, "confirmed", ""),
        (True, True, True, "confirmed", ""),
        (True, True, False, "sent", "echo"),  # our own 01 came back, and nothing else
        (True, False, False, "sent", "no-answer"),
        (False, False, True, "sent", ""),  # nothing has shown yet whether our own frames come back
        (False, True, False, "sent", ""),
        (False, True, True, "sent", ""),
    ],
)
def test_an_acknowledgement_that_equals_its_request_proves_nothing_by_itself(
    reads_first: bool, echoes: bool, acknowledges: bool, state: str, code: str
) -> None:
    """A save writes 01 and is acknowledged with 01, the number of bytes written, under the same identifier."""

    def answer(frame: CanFrame) -> list[tuple[float, CanFrame]]:
        own = [(0.001, frame)] if echoes else []
        if frame.can_id == READ:
            return [*own, (0.002, CanFrame(READ, b"\x01\x00"))]
        return [*own, *([(0.002, CanFrame(WRITE, b"\x01"))] if acknowledges else [])]

    journal = Journal()
    journal.ledger.words = words()
    link = observed(ScriptedFrames(answer), journal.ledger)
    assert isinstance(link, FrameLink)
    bus = CanBus(link, 1, journal, family="hand")
    if reads_first:
        bus.read(1000, 2)
    if code:
        with pytest.raises(HandctlError) as caught:
            bus.write(1005, b"\x01")
        assert caught.value.code == code
    else:
        bus.write(1005, b"\x01")
    assert [row["state"] for row in journal.ledger.rows()] == [state]
