"""Registers as CAN frames: the identifier both ways, the limits of its fields, and what no frame can carry (wrist §2.3)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.inspire import can_frames
from handctl.devices.inspire.can_frames import Access, parse_identifier, read_request, write_request
from handctl.errors import HandctlError, UsageError
from tests.support.each_row import each_row
from tests.support.scripted import hexed, unhex

IDENTIFIERS = [
    # identifier, flag, address, id: wrist §2.3.1, §2.3.2 with the arithmetic errors of the print corrected
    (0x11000001, 4, 1024, 1),  # read both currents
    (0x10FF0001, 4, 1020, 1),
    (0x11010001, 4, 1028, 1),
    (0x11030001, 4, 1036, 1),
    (0x15038001, 5, 1038, 1),  # write yaw and pitch
    (0x15048001, 5, 1042, 1),
    (0x01840001, 0, 1552, 1),  # hand read, field capture of an RH56
    (0x05738001, 1, 1486, 1),  # hand write, field capture of an RH56
    (0x05038001, 1, 1038, 1),  # the wrist's address in the hand's space
    (0x1503BFFE, 5, 1038, 16382),
    (0x00000000, 0, 0, 0),
    (0x00003FFF, 0, 0, 16383),
    (0x03FFC000, 0, 4095, 0),
    (0x1C000000, 7, 0, 0),
    (0x1FFFFFFF, 7, 4095, 16383),
]


@each_row(("identifier", "flag", "address", "hand_id"), IDENTIFIERS)
def test_identifiers_both_ways(identifier: int, flag: int, address: int, hand_id: int) -> None:
    assert parse_identifier(identifier) == (flag, address, hand_id)
    assert Access(flag, address, hand_id).identifier == identifier


def test_identifier_as_the_manual_draws_it() -> None:
    """wrist §2.3.1: flag 4, address 010000000000, id 1, bits 28 to 0."""
    identifier, data = read_request(1, 1024, 4)
    assert (f"{identifier:029b}", hexed(data)) == ("100" + "010000000000" + "00000000000001", "04")


def test_the_printed_binary_numbers_are_something_else() -> None:
    """wrist §2.3.1 prints 28 bits for each: as numbers both read the hand (dossier W9)."""
    assert parse_identifier(0b0001_0001_0000_0000_0000_0000_0001) == (0, 1088, 1)
    assert parse_identifier(0b0000_0001_1000_0100_0000_0000_0000_0001) == (0, 1552, 1)


@each_row(
    ("flag", "writes"), [(0, False), (1, True), (2, False), (3, False), (4, False), (5, True), (6, False), (7, False)]
)
def test_which_flags_write(flag: int, writes: bool) -> None:
    """wrist §2.3: 0 and 4 read, 1 and 5 write, the rest is undefined."""
    assert Access(flag, 1020, 1).writes is writes


# -- requests ---------------------------------------------------------------------------------------------------------


@each_row(
    ("hand_id", "address", "count", "flag", "identifier", "data"),
    [
        (1, 1024, 4, 4, 0x11000001, "04"),
        (1, 1020, 8, 4, 0x10FF0001, "08"),
        (1, 1552, 2, 0, 0x01840001, "02"),
        (0, 0, 1, 4, 0x10000000, "01"),
        (16383, 4095, 1, 4, 0x13FFFFFF, "01"),
    ],
)
def test_read_requests(hand_id: int, address: int, count: int, flag: int, identifier: int, data: str) -> None:
    assert read_request(hand_id, address, count, flag) == (identifier, unhex(data))


@each_row(
    ("hand_id", "address", "data", "flag", "identifier"),
    [
        (1, 1038, "E8 03 18 FC", 5, 0x15038001),
        (1, 1042, "BC 02", 5, 0x15048001),
        (1, 1486, "F4 01 FF FF FF FF FF FF", 1, 0x05738001),
        (16382, 1038, "F6 09", 5, 0x1503BFFE),
        (0, 1038, "00", 5, 0x15038000),
    ],
)
def test_write_requests_are_never_padded(hand_id: int, address: int, data: str, flag: int, identifier: int) -> None:
    assert write_request(hand_id, address, unhex(data), flag) == (identifier, unhex(data))


def test_the_wrist_is_the_default() -> None:
    assert read_request(1, 1020, 2)[0] >> 26 == 4
    assert write_request(1, 1038, b"\0\0")[0] >> 26 == 5
    assert (can_frames.READ_HAND, can_frames.WRITE_HAND, can_frames.READ_WRIST, can_frames.WRITE_WRIST) == (0, 1, 4, 5)


# -- what no frame can carry ------------------------------------------------------------------------------------------


@each_row("hand_id", [-1, 16384, 1 << 29])
def test_impossible_ids(hand_id: int) -> None:
    """wrist §2.3: 14 bits, 16383 devices."""
    for ask in (
        lambda: can_frames.check_id(hand_id),
        lambda: read_request(hand_id, 1020, 2),
        lambda: write_request(hand_id, 1038, b"\0\0"),
    ):
        with pytest.raises(UsageError) as caught:
            ask()
        assert caught.value.exit_code == 2
        assert "wrist §2.3" in caught.value.hint


@each_row("hand_id", [0, 1, 255, 16382, 16383])
def test_possible_ids(hand_id: int) -> None:
    can_frames.check_id(hand_id)
    assert read_request(hand_id, 1020, 2)[0] & 0x3FFF == hand_id


@each_row("flag", [1, 5])
def test_nothing_is_written_to_id_3fff(flag: int) -> None:
    """Used by client code as "any", unproven (dossier W13)."""
    with pytest.raises(UsageError) as caught:
        write_request(16383, 1038, b"\0\0", flag)
    assert "every hand" in caught.value.text
    assert "Nothing was sent" in caught.value.hint


@each_row("address", [-1, 4096, 65535])
def test_impossible_addresses(address: int) -> None:
    """wrist §2.3: 12 bits."""
    for ask in (lambda: read_request(1, address, 2), lambda: write_request(1, address, b"\0\0")):
        with pytest.raises(UsageError) as caught:
            ask()
        assert "4095" in caught.value.hint


@each_row("count", [-1, 0, 9, 24, 255])
def test_impossible_counts(count: int) -> None:
    """wrist §2.3.1: a classic CAN frame has 8 bytes."""
    with pytest.raises(UsageError) as caught:
        read_request(1, 1020, count)
    assert "1 to 8" in caught.value.hint


@each_row("count", [0, 9, 10])
def test_impossible_writes(count: int) -> None:
    with pytest.raises(UsageError):
        write_request(1, 1020, bytes(count))


# -- properties -------------------------------------------------------------------------------------------------------

IDS, ADDRESSES, FLAGS = st.integers(0, 16382), st.integers(0, 4095), st.integers(0, 7)


@given(FLAGS, ADDRESSES, st.integers(0, 16383))
def test_round_trip(flag: int, address: int, hand_id: int) -> None:
    identifier = Access(flag, address, hand_id).identifier
    assert identifier == flag * 2**26 + address * 2**14 + hand_id
    assert 0 <= identifier < 2**29
    assert parse_identifier(identifier) == (flag, address, hand_id)


@given(st.integers(0, 2**29 - 1))
def test_every_identifier_says_something(identifier: int) -> None:
    assert parse_identifier(identifier).identifier == identifier


@given(IDS, ADDRESSES, st.integers(1, 8), st.sampled_from([0, 4]))
def test_reads_round_trip(hand_id: int, address: int, count: int, flag: int) -> None:
    identifier, data = read_request(hand_id, address, count, flag)
    assert (parse_identifier(identifier), data) == ((flag, address, hand_id), bytes([count]))


@given(IDS, ADDRESSES, st.binary(min_size=1, max_size=8), st.sampled_from([1, 5]))
def test_writes_round_trip(hand_id: int, address: int, data: bytes, flag: int) -> None:
    identifier, payload = write_request(hand_id, address, data, flag)
    assert (parse_identifier(identifier), payload) == ((flag, address, hand_id), data)


@given(st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20), st.integers(-300, 300), st.binary(max_size=20))
def test_anything_else_is_a_usage_error(hand_id: int, address: int, count: int, data: bytes) -> None:
    possible = 0 <= hand_id <= 16383 and 0 <= address <= 4095
    for ask, fits in (
        (lambda: read_request(hand_id, address, count), possible and 1 <= count <= 8),
        (lambda: write_request(hand_id, address, data), possible and hand_id != 16383 and 1 <= len(data) <= 8),
    ):
        try:
            identifier, _ = ask()
        except HandctlError as exc:
            assert isinstance(exc, UsageError)
            assert not fits
        else:
            assert fits
            assert 0 <= identifier < 2**29
