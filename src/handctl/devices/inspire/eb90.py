"""The EB 90 frame of the Inspire family, bytes <-> frames. Sans I/O: knows no link, no clock, no register names.

    byte            0    1    2    3      4     5        6        7 ...            last
    read  request   EB   90   id   04     11    addr_lo  addr_hi  n                sum
    read  reply     90   EB   id   n+3    11    addr_lo  addr_hi  d0 .. d(n-1)     sum
    write request   EB   90   id   n+3    12    addr_lo  addr_hi  d0 .. d(n-1)     sum
    write ack       90   EB   id   04     12    addr_lo  addr_hi  01               sum
    force command   EB   90   id   0B     31    5 x s16                            sum     exo §2.2.1
          reply     90   EB   id   0D     31    6 x s16, positions now             sum
    position comm.  EB   90   id   0B     32    5 x s16                            sum     exo §2.2.2
          reply     90   EB   id   0B     32    5 x s16, forces now                sum

The length byte counts from the flag up to, without, the sum, so a frame has length + 5 bytes. 16-bit values are
little-endian. The sum is the low byte of the sum of everything between header and sum (exo §2.2.1 note 2).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

from handctl.errors import ProtocolError, UsageError
from handctl.fast_classes import NamedTuple
from handctl.model.frame_decoder import Stream

IDS = range(1, 255)
"""Of a device (exo §2.3.1)."""
HOST = b"\xeb\x90"
DEVICE = b"\x90\xeb"
READ, WRITE = 0x11, 0x12
WRIST_READ, WRIST_WRITE = 0x30, 0x31
"""The wrist's own registers (wrist §2.2); 31 is the exo's force command in a longer frame."""
FORCE_COMMAND, POSITION_COMMAND = 0x31, 0x32
COMMANDS = {FORCE_COMMAND: "force", POSITION_COMMAND: "position"}
"""What the five values of such a frame are (exo §2.2.1, §2.2.2)."""
ACCEPTED = 0x01
CALIBRATION_END = 2
"""Address field of the frame that tells the end of a calibration (RH56 ch. 3 ex. 5)."""
MAX_COUNT = 252
"""Largest count of one read or write: its reply's length byte n + 3 must fit into 255."""
MIN_LENGTH = 1
READ_SIZE = 9
"""Bytes of a read request."""
OVERHEAD = 5
LONGEST_PREFIX = 7
_HEAD = re.compile(rb"\xeb(?:\x90|\Z)|\x90(?:\xeb|\Z)")


class Frame(NamedTuple):
    """One frame without its envelope: `payload` is what follows the flag, before the sum."""

    header: bytes
    id: int
    flag: int
    payload: bytes

    @property
    def from_device(self) -> bool:
        """Whether the header says that a device sent it."""
        return self.header == DEVICE

    @property
    def address(self) -> int | None:
        """The register address of a register frame, None for a command frame or a shorter one."""
        if self.flag in (FORCE_COMMAND, POSITION_COMMAND) and len(self.payload) >= 10:
            return None
        return int.from_bytes(self.payload[:2], "little") if len(self.payload) >= 2 else None

    @property
    def data(self) -> bytes:
        """What follows the address."""
        return self.payload[2:]

    def encode(self) -> bytes:
        """The frame as bytes on the wire."""
        body = bytes([self.id, len(self.payload) + 1, self.flag]) + self.payload
        return self.header + body + bytes([checksum(body)])


def checksum(body: bytes) -> int:
    """Low byte of the sum of everything between header and sum."""
    return sum(body) & 0xFF


def check_id(device_id: int) -> None:
    """Refuse ids that the manual does not define: 1..254 (exo §2.3.1, rh56 §3.1). Raises UsageError."""
    if device_id not in IDS:
        raise UsageError(f"id {device_id} is not valid", hint="use an id from 1 to 254. Nothing was sent.")


def check_span(address: int, count: int) -> None:
    """Refuse a register span that no frame can carry. Raises UsageError."""
    if not 0 <= address <= 0xFFFF:
        raise UsageError(f"address {address} is not a register address", hint="use an address from 0 to 65535, 16 bits")
    if not 1 <= count <= MAX_COUNT:
        raise UsageError(
            f"{count} bytes do not fit into one frame",
            hint=f"use 1 to {MAX_COUNT}: the reply's length byte is count + 3 and must stay below 256",
        )
    if address + count > 0x10000:
        raise UsageError(
            f"{count} bytes at {address} run past address 65535", hint="ask for fewer bytes: addresses have 16 bits"
        )


@lru_cache(256)
def read_request(device_id: int, address: int, count: int, flag: int = READ) -> bytes:
    """Ask for `count` bytes (1..252) from `address`. Raises UsageError."""
    check_id(device_id)
    check_span(address, count)
    return Frame(HOST, device_id, flag, address.to_bytes(2, "little") + bytes([count])).encode()


@lru_cache(256)
def only_reads(data: bytes) -> bool:
    """Whether `data` is nothing but whole read requests, which change no device of this maker. Asked for each frame again.

    What goes ahead of them and between them (`register_bus.question`) begins no frame.
    """
    found = False
    while data := data.lstrip(b"\0\xff"):
        one, data = data[:READ_SIZE], data[READ_SIZE:]
        found = len(one) == READ_SIZE and one[:2] == HOST and one[3] == 4 and one[4] in (READ, WRIST_READ)
        if not found or one[-1] != checksum(one[2:-1]):
            return False
    return found


def write_request(device_id: int, address: int, data: bytes, flag: int = WRITE) -> bytes:
    """Write 1..252 bytes from `address` on. Raises UsageError."""
    check_id(device_id)
    check_span(address, len(data))
    return Frame(HOST, device_id, flag, address.to_bytes(2, "little") + data).encode()


def command_request(device_id: int, flag: int, values: Sequence[int]) -> bytes:
    """A force (0x31) or position (0x32) command: five signed 16-bit values, little to thumb (exo §2.2.1, §2.2.2)."""
    check_id(device_id)
    return Frame(HOST, device_id, flag, pack_s16(values)).encode()


def pack_s16(values: Iterable[int]) -> bytes:
    """Signed 16-bit values, little-endian."""
    return b"".join(value.to_bytes(2, "little", signed=True) for value in values)


def unpack_s16(data: bytes | None) -> list[int]:
    """The signed 16-bit values of `data`, little-endian; none where nothing was read."""
    data = data or b""
    return [int.from_bytes(data[i : i + 2], "little", signed=True) for i in range(0, len(data) - 1, 2)]


@lru_cache(256)
def read_reply_prefix(device_id: int, address: int, count: int, flag: int = READ) -> bytes:
    """The seven bytes with which the answer to a read begins."""
    return DEVICE + bytes([device_id, count + 3, flag]) + address.to_bytes(2, "little")


def write_ack_prefix(device_id: int, address: int, flag: int = WRITE) -> bytes:
    """The seven bytes with which the answer to a write begins."""
    return DEVICE + bytes([device_id, 4, flag]) + address.to_bytes(2, "little")


def command_reply_prefix(device_id: int, flag: int) -> bytes:
    """The five bytes with which the answer to a force or position command begins (6 or 5 values)."""
    length = 0x0D if flag == FORCE_COMMAND else 0x0B
    return DEVICE + bytes([device_id, length, flag])


class Decoder(Stream[Frame]):
    """Finds the expected frames in a stream: `feed` bytes, then call `next` until it returns None.

    Only frames that begin with one of `prefixes` (header, id, length, flag, and the address where there is one) are
    candidates, at every offset; a candidate counts only if its sum fits. One that fails costs its first byte, never
    the buffer, so an answer behind a false header, an echo or a stale reply is still found. With no `prefixes`, any
    frame of either direction is a candidate (for sniffing). With `of_any_id` they are those of id 1, and stand for each id.

    `rejected` is the last candidate with a wrong sum.
    """

    def __init__(self, prefixes: Sequence[bytes] = (), *, of_any_id: bool = False) -> None:
        known = tuple(prefixes) or (HOST, DEVICE)
        self._first = known[0] if len(known[0]) >= OVERHEAD else None  # its length is in it
        super().__init__()
        self._known, self._of_any_id = known, of_any_id
        self.rejected = b""

    def next(self) -> Frame | None:
        """The next frame, or None until more bytes come. Raises ProtocolError for a candidate whose sum is wrong."""
        if not (buffer := self._buffer):
            return None
        if self._first is None or not buffer.startswith(self._first):
            start = self._candidate()
            self.skipped += start
            del buffer[:start]
        if len(buffer) < 4 or len(buffer) < buffer[3] + OVERHEAD:
            return None
        end = buffer[3] + OVERHEAD
        frame = bytes(buffer[:end])
        expected = checksum(frame[2:-1])
        if frame[-1] != expected:
            del buffer[:1]
            self.skipped += 1
            self.rejected = frame
            raise ProtocolError(
                f"bad checksum {frame[-1]:02X}, expected {expected:02X}, in {frame.hex(' ').upper()}",
                hint="check the cable, the ground and the baud rate",
                code="bad-checksum",
            )
        del buffer[:end]
        return Frame(frame[:2], frame[2], frame[4], frame[5:-1])

    def _candidate(self) -> int:
        """Offset of the first place where one of the prefixes stands, or begins at the end; len(buffer) if there is none."""
        buffer, known, place = self._buffer, self._known, 0
        while found := _HEAD.search(buffer, place):
            place = found.start()
            if place + 3 >= len(buffer) or buffer[place + 3] >= MIN_LENGTH:
                tail = bytes(buffer[place : place + LONGEST_PREFIX])
                ends = place + len(tail) == len(buffer)
                if self._of_any_id and len(tail) > 2 and tail[2] in IDS:
                    tail = tail[:2] + bytes([IDS[0]]) + tail[3:]
                if tail.startswith(known) or (ends and any(one.startswith(tail) for one in known)):
                    return place
            place += 1
        return len(buffer)


# -- whose bytes are these ------------------------------------------------------------------------------------------


def sign(data: bytes) -> str:
    """Evidence in `data` for a device of this maker: a complete frame. The bytes do not show which device."""
    decoder = Decoder([DEVICE])
    decoder.feed(data)
    found = decoder.finish()
    return f"the frame {found[0].encode().hex(' ').upper()} of an Inspire device" if found else ""
