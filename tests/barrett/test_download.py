"""The boot monitor's protocol, one record at a time (dossier 7.2): bytes, echoes, windows, every place of a fault."""

from __future__ import annotations

from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.barrett.firmware.srecords import READY, SELECT, TRIGGER, EchoError, Transfer
from tests.support.each_row import each_row
from tests.support.scripted import hexed


class Record(NamedTuple):
    address: int
    data: bytes


EXAMPLE = Record(0x2000, bytes.fromhex("11 22 33 44 55 66 FF 00"))  # S10B2000112233445566FF0070
HOST = "FF 00 20 08 FF 11 22 33 44 55 66 FF 00"
ECHO = "00 20 08 11 22 33 44 55 66 FF 00"


class Monitor:
    """The other side, made from the dossier: which bytes are echoed."""

    def __init__(self, record: Record, triggers: bool = False) -> None:
        self.plan = [triggers, True, True, True, triggers, *[True] * len(record.data)]
        self.heard = b""

    def hear(self, data: bytes) -> bytes:
        echo = bytes(byte for byte, back in zip(data, self.plan[len(self.heard) :], strict=False) if back)
        self.heard += data
        return echo


def carry(record: Record, window: int = 1, triggers: bool = False, piece: int | None = None) -> tuple[list[bytes], int]:
    """What the host sends, piece by piece, and the most bytes that were without their echo."""
    transfer, monitor = Transfer(record, window=window, triggers_echo=triggers), Monitor(record, triggers)
    sent, waiting, most = [], b"", 0
    while not transfer.done:
        out = transfer.take()
        if out:
            sent.append(out)
            echo = monitor.hear(out)
            if not triggers and out[0] == 0xFF and len(monitor.heard) - len(out) in (0, 4):
                assert waiting == b"", "all echoes are taken before a trigger (7.7)"
            waiting += echo
            most = max(most, len(waiting))
        assert out or waiting, "nothing to send and nothing to wait for"
        size = len(waiting) if piece is None else piece
        transfer.feed(waiting[:size])
        waiting = waiting[size:]
    assert transfer.take() == b"" and waiting == b""
    return sent, most


def test_constants() -> None:
    assert (SELECT, READY, TRIGGER) == (b"\x58", b"\x3a", b"\xff")


def test_the_record_of_the_dossier() -> None:
    """Low address byte first; each byte waits for its echo, the triggers do not."""
    sent, most = carry(EXAMPLE)
    assert hexed(b"".join(sent)) == HOST
    assert [hexed(data) for data in sent] == ["FF 00", "20", "08", "FF 11", "22", "33", "44", "55", "66", "FF", "00"]
    assert most == 1


def test_echoes_of_the_dossier() -> None:
    transfer = Transfer(EXAMPLE)
    for byte in bytes.fromhex(ECHO):
        assert not transfer.done
        assert transfer.take()
        assert transfer.take() == b""  # window 1
        transfer.feed(bytes([byte]))
    assert transfer.done and transfer.take() == b""


@each_row("window", [1, 2, 3, 4])
@each_row("triggers", [False, True])
def test_windows(window: int, triggers: bool) -> None:
    sent, most = carry(EXAMPLE, window, triggers, piece=1)
    assert hexed(b"".join(sent)) == HOST
    assert most == min(window, 8)


def test_an_echoed_trigger_is_a_byte_with_an_echo() -> None:
    transfer = Transfer(EXAMPLE, triggers_echo=True)
    assert transfer.take() == b"\xff" and transfer.take() == b""
    transfer.feed(b"\xff")
    assert transfer.take() == b"\x00"
    with pytest.raises(EchoError) as caught:
        transfer.feed(b"\xff")
    assert caught.value.code == "wrong-echo"


def test_a_trigger_alone_and_the_finding_that_it_is_echoed() -> None:
    """The first record: FF goes out alone, FF coming back changes the rest (7.3, step 7)."""
    transfer = Transfer(EXAMPLE)
    assert transfer.between
    assert transfer.trigger() == b"\xff" and not transfer.between
    transfer.triggers_echo = True
    sent = b""
    monitor = Monitor(EXAMPLE, True)
    monitor.hear(b"\xff")
    while not transfer.done:
        assert not transfer.between, "a trigger that is echoed is a byte like the others"
        out = transfer.take()
        sent += out
        transfer.feed(monitor.hear(out))
    assert hexed(b"\xff" + sent) == HOST


PLACES = [
    (0, "address low", 0x00), (1, "address high", 0x20), (2, "count", 0x08), (3, "2000h", 0x11), (4, "2001h", 0x22),
    (5, "2002h", 0x33), (9, "2006h", 0xFF), (10, "2007h", 0x00),
]  # fmt: skip


def up_to(place: int, triggers: bool = False) -> Transfer:
    """Everything before this echo has come."""
    transfer = Transfer(EXAMPLE, triggers_echo=triggers)
    monitor = Monitor(EXAMPLE, triggers)
    for _ in range(place):
        transfer.feed(monitor.hear(transfer.take()))
    return transfer


@each_row(("place", "where", "byte"), PLACES)
def test_a_wrong_echo_at_every_place(place: int, where: str, byte: int) -> None:
    transfer = up_to(place)
    assert where in transfer.where and transfer.awaited == byte
    transfer.take()
    with pytest.raises(EchoError) as caught:
        transfer.feed(bytes([byte ^ 0x40]))
    text = caught.value.text
    assert (caught.value.code, caught.value.exit_code) == ("wrong-echo", 5)
    assert where in text and f"sent {byte:02X}" in text and f"received {byte ^ 0x40:02X}" in text
    if place < 3:
        assert "2000h" in text, "the record is named"


@each_row(("place", "where", "byte"), PLACES)
def test_a_byte_nobody_awaited_at_every_place(place: int, where: str, byte: int) -> None:
    transfer = up_to(place)
    with pytest.raises(EchoError) as caught:
        transfer.feed(b"\x99")
    assert caught.value.code == "extra-byte" and "99" in caught.value.text and where in caught.value.text
    transfer = up_to(place)
    transfer.take()
    with pytest.raises(EchoError) as caught:
        transfer.feed(bytes([byte, byte]))
    assert caught.value.code == "extra-byte"


@each_row("triggers", [False, True])
def test_places_with_echoed_triggers(triggers: bool) -> None:
    """The trigger's echo does not shift the address that is named."""
    names = []
    transfer, monitor = Transfer(EXAMPLE, triggers_echo=triggers), Monitor(EXAMPLE, triggers)
    while not transfer.done:
        names.append(transfer.where)
        transfer.feed(monitor.hear(transfer.take()))
    wanted = [f"the {part} byte of the record at 2000h" for part in ("address low", "address high", "count")]
    wanted += [f"{0x2000 + place:04X}h" for place in range(8)]
    assert list(dict.fromkeys(names)) == wanted


@each_row("place", [1, 2, 3, 9])
def test_00_is_no_echo_of_anything_else(place: int) -> None:
    """The reference takes silence for 00 (7.5); here 00 is a byte like any other."""
    transfer = up_to(place)
    transfer.take()
    with pytest.raises(EchoError):
        transfer.feed(b"\x00")


def test_an_echo_before_anything_was_sent() -> None:
    with pytest.raises(EchoError):
        Transfer(EXAMPLE).feed(b"\x00")


@given(st.integers(0, 0xFF00), st.binary(min_size=1, max_size=255), st.integers(1, 4), st.booleans(), st.integers(1, 5))
def test_any_record(address: int, data: bytes, window: int, triggers: bool, piece: int) -> None:
    record = Record(address, data)
    sent, most = carry(record, window, triggers, piece)
    head = bytes([address & 255, address >> 8, len(data)])
    assert b"".join(sent) == b"\xff" + head + b"\xff" + data
    assert most <= window


@given(st.binary(min_size=1, max_size=8), st.integers(0, 30), st.integers(1, 255), st.integers(1, 4))
def test_no_wrong_echo_passes(data: bytes, place: int, flip: int, window: int) -> None:
    """The echo is the only check there is: whichever is wrong, it is found, with the bytes that were sent and came."""
    record = Record(0x1234, data)
    transfer, monitor = Transfer(record, window=window), Monitor(record)
    place %= 3 + len(data)
    seen = 0
    with pytest.raises(EchoError):
        while not transfer.done:
            for byte in monitor.hear(transfer.take()):
                transfer.feed(bytes([byte ^ (flip if seen == place else 0)]))
                seen += 1
        raise AssertionError("a wrong echo passed")
