"""Whose answer it is over Modbus: unit, function, register, and the checksum over all of them."""

from __future__ import annotations

import pytest

from handctl.devices.inspire import modbus_frames
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.modbus_frames import RtuDecoder, answers, rtu
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.model.result import Journal
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink

ONE = modbus_frames.write_request(1486, bytes.fromhex("0064"))
MANY = modbus_frames.write_request(1486, bytes.fromhex("0064 00C8"))


@each_row(
    ("request_", "answer"),
    [
        (ONE, "06 05CF 0064"),  # the register behind
        (ONE, "06 05CD 0064"),
        (ONE, "06 CE05 0064"),  # its bytes the other way round
        (ONE, "06 05CF 0000"),  # as it is printed, of another register
        (ONE, "06 05CE 0065"),  # another value
        (ONE, "10 05CE 0001"),
        (MANY, "10 05CF 0002"),
        (MANY, "10 05CE 0001"),
        (MANY, "06 05CE 0064"),
    ],
)
def test_an_acknowledgement_of_another_write_is_none(request_: bytes, answer: str) -> None:
    assert not answers(bytes.fromhex(answer), request_)


def test_its_own_acknowledgement_is_taken() -> None:
    assert answers(bytes.fromhex("06 05CE 0064"), ONE)
    assert answers(bytes.fromhex("06 05CE 0000"), ONE), "as the manual prints it"
    assert answers(bytes.fromhex("10 05CE 0002"), MANY)


@each_row("frame", [rtu(1, bytes.fromhex("06 05CF 0064")), rtu(2, ONE), rtu(1, ONE)[:-1] + b"\0"])
def test_a_write_is_acknowledged_by_its_own_unit_and_register_only(frame: bytes) -> None:
    """On the wire: what names another register or unit, or is damaged, leaves the write unknown, and it is not sent again."""
    link = ScriptedLink(lambda _: [(0.01, frame)])
    bus = ModbusBus(link, 1, Journal(), tcp=False)
    with pytest.raises((NoAnswer, ProtocolError)):
        bus.write(1486, bytes.fromhex("6400"))
    assert link.sent == [rtu(1, ONE)]


def test_an_acknowledgement_of_another_write_before_its_own_is_passed_over() -> None:
    decoder = RtuDecoder(1, ONE)
    decoder.feed(rtu(1, bytes.fromhex("06 05CF 0064")) + rtu(1, ONE))
    found = decoder.next()
    assert found is not None and found.pdu == ONE and decoder.skipped == 8


def test_an_exception_is_the_refusal_of_what_was_asked() -> None:
    link = ScriptedLink(lambda _: [(0.01, rtu(1, b"\x86\x02"))])
    with pytest.raises(HandctlError) as caught:
        ModbusBus(link, 1, Journal(), tcp=False).write(1486, bytes.fromhex("6400"))
    assert (caught.value.exit_code, caught.value.code) == (6, "modbus-2")
