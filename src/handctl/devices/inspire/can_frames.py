"""Register access as CAN frames (wrist §2.3), registers <-> identifier and data. Sans I/O: knows no link, no names.

    identifier bit  28 27 26 | 25 ........ 14 | 13 ......... 0
                    flag     |  address (12)  |  hand id (14)      extended data frames only, 1 Mbit/s

    flag  4 read wrist, 5 write wrist, 0 read hand, 1 write hand
    read   request  data = byte count 1..8     reply  the same identifier, DLC = count, data little-endian
    write  request  data 1..8 bytes            reply  the same identifier, DLC 0 (wrist §2.3.2) or 1 (sibling hand)

Request and reply carry the same identifier: the direction cannot be read from a frame.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.errors import UsageError

READ_HAND, WRITE_HAND, READ_WRIST, WRITE_WRIST = 0, 1, 4, 5
MAX_COUNT = 8
"""Classic CAN carries 8 bytes; a longer span is several reads."""
MAX_ID = 0x3FFF
ANY_ID = 0x3FFF
"""Used by some client code as "any hand"; unproven, so never written to."""


class Access(NamedTuple):
    """What an identifier says."""

    flag: int
    address: int
    hand_id: int

    @property
    def writes(self) -> bool:
        """Whether it is a write (or the acknowledgement of one)."""
        return self.flag in (WRITE_HAND, WRITE_WRIST)

    @property
    def identifier(self) -> int:
        return self.flag << 26 | self.address << 14 | self.hand_id


def parse_identifier(identifier: int) -> Access:
    """The parts of a 29-bit identifier."""
    return Access(identifier >> 26 & 0x7, identifier >> 14 & 0xFFF, identifier & 0x3FFF)


def only_reads(identifier: int, data: bytes) -> bool:
    """Whether a frame is a read request: one byte of data, the count."""
    return parse_identifier(identifier).flag in (READ_HAND, READ_WRIST) and len(data) == 1


def acknowledges(data: bytes, written: bytes) -> bool:
    """Whether the data of a frame with the identifier of a write are its acknowledgement: none, or the number of bytes written.

    Our own one-byte write coming back is neither.
    """
    return len(data) <= 1 and (data != written or data == b"\x01")


def check_id(hand_id: int) -> None:
    """Refuse ids that an identifier cannot hold: 0..16383 (wrist §2.3). Raises UsageError."""
    if not 0 <= hand_id <= MAX_ID:
        raise UsageError(
            f"id {hand_id} is not valid on CAN", hint="use an id from 0 to 16383 (wrist §2.3). Nothing was sent."
        )


def _check(hand_id: int, address: int, count: int) -> None:
    check_id(hand_id)
    if not 0 <= address <= 0xFFF:
        raise UsageError(
            f"address {address} does not fit on CAN", hint="use an address from 0 to 4095, 12 bits (wrist §2.3)"
        )
    if not 1 <= count <= MAX_COUNT:
        raise UsageError(f"{count} bytes do not fit into one CAN frame", hint="use 1 to 8 bytes (wrist §2.3.1)")


def check_span(hand_id: int, address: int, count: int) -> None:
    """Refuse a span that several reads could not cover either. Raises UsageError."""
    _check(hand_id, address, 1)
    if count < 1 or address + count > 0x1000:
        raise UsageError(
            f"{count} bytes at {address} run past address 4095",
            hint="ask for fewer bytes: addresses have 12 bits on CAN (wrist §2.3)",
        )


def read_request(hand_id: int, address: int, count: int, flag: int = READ_WRIST) -> tuple[int, bytes]:
    """Identifier and data that ask for `count` bytes (1..8). Raises UsageError."""
    _check(hand_id, address, count)
    return Access(flag, address, hand_id).identifier, bytes([count])


def write_request(hand_id: int, address: int, data: bytes, flag: int = WRITE_WRIST) -> tuple[int, bytes]:
    """Identifier and data that write 1..8 bytes; never padded. Raises UsageError."""
    _check(hand_id, address, len(data))
    if hand_id == ANY_ID:
        raise UsageError("id 16383 may mean every hand on the bus", hint="write to one hand. Nothing was sent.")
    return Access(flag, address, hand_id).identifier, data
