"""Modbus as the RH56 hands speak it, bytes <-> frames. Sans I/O: knows no link, no clock, no register names.

    PDU                       function  then
    read request              03        address  words                        big-endian, 16 bits each
    read reply                03        bytes (1 byte)  word ...
    write one request, reply  06        address  word
    write many request        10        address  words  bytes (1 byte)  word ...
               reply          10        address  words
    exception                 function | 80   code (1 byte)

    RTU   unit  PDU  CRC-16/MODBUS, low byte first        rh56 §2.2
    TCP   transaction (2)  00 00  length (2)  unit  PDU   rh56 §2.3

The address is the number in the manual, without an offset. On byte maps (DF, TP) the word at address a is byte a as its
low half and byte a+1 as its high half; `to_memory` and `to_words` turn one order into the other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from handctl.devices.inspire import eb90
from handctl.errors import ProtocolError, UsageError
from handctl.families import FAMILIES
from handctl.fast_classes import NamedTuple
from handctl.model.frame_decoder import Stream

RTU, TCP = "rtu", "tcp"
"""The two envelopes."""
READ, WRITE_ONE, WRITE_MANY = 0x03, 0x06, 0x10
FAILED = 0x80
"""Added to the function of a request in the answer that refuses it."""
NO_PATH, NO_TARGET = 0x0A, 0x0B
"""A gateway says so: it has no way to the unit, or the unit is silent."""
RTU_SPEED = 115200
"""bit/s: the only one at which a BarrettHand acts upon nothing of a question in Modbus RTU."""
AT_WORK = (5, 6)
PASSING = (4, *AT_WORK)
"""Says nothing about which device refuses: the same question may be answered next."""
UNSURE = (5, NO_TARGET)
"""Behind a write, it may be carried out all the same: it goes on (05 acknowledges it), or nobody knows. 04 reports an error."""
EXCEPTIONS = {
    1: "illegal function", 2: "illegal address", 3: "illegal value", 4: "device failure", 5: "still at work", 6: "busy",
    NO_PATH: "gateway path unavailable", NO_TARGET: "gateway target failed to respond",
}  # fmt: skip
"""By the standard: no manual of these hands lists them, and nobody has seen one (rh56 §2.2)."""
MAX_WORDS = 125
"""Registers of one read (rh56 §2.3)."""
MAX_WRITTEN = 120
"""Registers of one write: one table of the manual says 120, another 123 (rh56 §2.3)."""
LAST = 0xFFFF
MBAP = 7
"""Bytes before the PDU on TCP, the unit included."""
ANY_UNIT = 0xFF
"""What is sent as the unit on TCP: the manual calls it not used, and any is accepted in an answer (rh56 §2.3)."""


@cache
def _crc() -> Callable[[bytes], int]:
    # Built once, and only when bytes are really sent: help and plans do without crcmod.
    import crcmod.predefined

    function: Callable[[bytes], int] = crcmod.predefined.mkPredefinedCrcFun("modbus")
    return function


class Answer(NamedTuple):
    """One answer without its envelope; `transaction` is None on a serial line."""

    unit: int
    pdu: bytes
    transaction: int | None = None

    def has_transaction(self, number: int) -> bool:
        """Whether it names this transaction id; on a serial line no answer names any."""
        return self.transaction in (None, number)

    @property
    def function(self) -> int:
        """The function that it answers."""
        return self.pdu[0] & ~FAILED

    @property
    def exception(self) -> int | None:
        """The code of a refusal."""
        return self.pdu[1] if self.pdu[0] & FAILED and len(self.pdu) > 1 else None

    @property
    def data(self) -> bytes:
        """The words of a read reply as they came, high half first."""
        return self.pdu[2:]


def crc(body: bytes) -> bytes:
    """CRC-16/MODBUS of everything before it, low byte first."""
    return _crc()(body).to_bytes(2, "little")


def _check(address: int, words: int, most: int) -> None:
    if not 1 <= words <= most:
        raise UsageError(
            f"{words} registers do not fit into one Modbus frame",
            hint=f"use 1 to {most} (rh56 §2.3). Nothing was sent.",
        )
    if not 0 <= address <= LAST or address + words > LAST + 1:
        raise UsageError(
            f"{words} registers at {address} run past address {LAST}", hint="addresses have 16 bits. Nothing was sent."
        )


def read_request(address: int, words: int) -> bytes:
    """The PDU that asks for 1..125 registers. Raises UsageError."""
    _check(address, words, MAX_WORDS)
    return bytes([READ]) + address.to_bytes(2, "big") + words.to_bytes(2, "big")


def write_request(address: int, data: bytes) -> bytes:
    """The PDU that writes 1..120 registers, `data` high half first: one by function 06, more by 16. Raises UsageError."""
    words, odd = divmod(len(data), 2)
    if odd:
        raise UsageError(
            f"{len(data)} byte{'s' * (len(data) != 1)}: not a whole number of registers",
            hint="give two bytes for each. Nothing was sent.",
        )
    _check(address, words, MAX_WRITTEN)
    place = address.to_bytes(2, "big")
    if words == 1:
        return bytes([WRITE_ONE]) + place + data
    return bytes([WRITE_MANY]) + place + words.to_bytes(2, "big") + bytes([len(data)]) + data


def only_reads(pdu: bytes) -> bool:
    """Whether a PDU is a read request."""
    return len(pdu) == 5 and pdu[0] == READ


def reply_size(pdu: bytes) -> int:
    """Bytes of the PDU that answers this request, unless it is refused."""
    return 2 + 2 * int.from_bytes(pdu[3:5], "big") if pdu[0] == READ else 5


def answers(pdu: bytes, request: bytes) -> bool:
    """Whether `pdu` can answer `request`: function and size, and the address of a write."""
    if not pdu or pdu[0] & ~FAILED != request[0]:
        return False
    if pdu[0] & FAILED:
        return len(pdu) == 2
    if request[0] == READ:
        return len(pdu) == reply_size(request) and pdu[1] == len(pdu) - 2
    # The printed answer to function 06 has 0000 where the standard repeats the value (rh56 §2.2).
    zero = request[:3] + b"\0\0" if request[0] == WRITE_ONE else b""
    return pdu in (request[:5], zero)


def rtu(unit: int, pdu: bytes) -> bytes:
    """A frame on a serial line."""
    body = bytes([unit]) + pdu
    return body + crc(body)


def tcp(transaction: int, pdu: bytes, unit: int = ANY_UNIT) -> bytes:
    """A frame on a TCP connection."""
    return transaction.to_bytes(2, "big") + b"\0\0" + (len(pdu) + 1).to_bytes(2, "big") + bytes([unit]) + pdu


def framed(mode: str, unit: int, transaction: int, pdu: bytes) -> bytes:
    """A frame in its envelope."""
    return tcp(transaction, pdu) if mode == TCP else rtu(unit, pdu)


def to_memory(data: bytes) -> bytes:
    """Words, high half first -> bytes in the order of their addresses; and the other way round. Half a word at the end stays."""
    swapped, whole = bytearray(data), len(data) & ~1
    swapped[0:whole:2], swapped[1:whole:2] = data[1:whole:2], data[0:whole:2]
    return bytes(swapped)


class RtuDecoder(Stream[Answer]):
    """Finds the answer to one request in a stream of a serial line: `feed` bytes, then call `next` until it returns None.

    A frame on this wire has no mark at its beginning. So a candidate is what begins with the unit and the function that
    was asked, at every offset, and counts only if its CRC fits. One that fails costs its first byte, never the buffer.
    `skipped` counts bytes that belonged to no answer.
    """

    def __init__(self, unit: int, request: bytes) -> None:
        super().__init__()
        self._unit = unit
        self._request = request

    def next(self) -> Answer | None:
        """The answer, or None until more bytes come. Raises ProtocolError for a whole candidate whose CRC is wrong."""
        buffer = self._buffer
        while buffer:
            size = self._size()
            if size is None:
                del buffer[:1]
                self.skipped += 1
                continue
            if len(buffer) < size:
                return None
            frame = bytes(buffer[:size])
            expected = crc(frame[:-2])
            if frame[-2:] == expected and answers(frame[1:-2], self._request):
                del buffer[:size]
                return Answer(frame[0], frame[1:-2])
            del buffer[:1]
            self.skipped += 1
            if frame[-2:] != expected:
                raise ProtocolError(
                    f"bad CRC {frame[-2:].hex(' ').upper()}, expected {expected.hex(' ').upper()}, "
                    f"in {frame.hex(' ').upper()}",
                    hint="check the cable, the ground and the baud rate",
                    code="bad-checksum",
                )
        return None

    def _size(self) -> int | None:
        """Bytes of the frame that may begin the buffer, None where none does."""
        buffer, function = self._buffer, self._request[0]
        if buffer[0] != self._unit:
            return None
        if len(buffer) < 2:
            return 3
        if buffer[1] == function | FAILED:
            return 5
        if buffer[1] != function:
            return None
        if function == READ and len(buffer) > 2 and buffer[2] != reply_size(self._request) - 2:
            return None
        return reply_size(self._request) + 3


class TcpDecoder(Stream[Answer]):
    """Cuts a TCP stream into answers: `feed` bytes, then call `next` until it returns None."""

    def next(self) -> Answer | None:
        """The next answer, or None until more bytes come. Raises ProtocolError for what cannot be a Modbus header.

        What follows such a header has no known beginning: all that came is dropped.
        """
        buffer = self._buffer
        if len(buffer) < MBAP + 1:
            return None
        length = int.from_bytes(buffer[4:6], "big")
        if buffer[2:4] != b"\0\0" or not 3 <= length <= 254:
            dropped = bytes(buffer)
            buffer.clear()
            self.skipped += len(dropped)
            raise ProtocolError(
                f"no Modbus header: {dropped[:MBAP].hex(' ').upper()}",
                hint=f"check the port: another service may reply there. The hand's is {FAMILIES['hand'].tcp_port}",
                code="garbage",
            )
        if len(buffer) < length + 6:
            return None
        frame = bytes(buffer[: length + 6])
        del buffer[: length + 6]
        return Answer(frame[6], frame[7:], int.from_bytes(frame[:2], "big"))


# -- whose bytes are these: Modbus stands beside EB 90 on one pair, and in one recording -------------------------------

FUNCTIONS = (READ, WRITE_ONE, WRITE_MANY)


def is_eb90(data: bytes | bytearray) -> bool:
    """Whether these bytes begin as an EB 90 frame does."""
    return bytes(data[:2]) in (eb90.HOST, eb90.DEVICE) or bytes(data[:2]) in (eb90.HOST[:1], eb90.DEVICE[:1])


def tcp_size(data: bytes | bytearray) -> int:
    """Bytes of the Modbus TCP frame that begins here; 0 where none does."""
    if len(data) < MBAP + 1 or data[2:4] != b"\0\0":
        return 0
    length = int.from_bytes(data[4:6], "big")
    fits = 3 <= length <= 254 and data[7] & ~FAILED in FUNCTIONS
    return length + 6 if fits else 0


def rtu_sizes(data: bytes | bytearray) -> list[int]:
    """Bytes that an RTU frame which begins here may have: as a question, as an answer, as a refusal."""
    if len(data) < 3 or data[0] not in eb90.IDS:
        return []
    function = data[1]
    if function & FAILED:
        return [5] if function & ~FAILED in FUNCTIONS else []
    if function == READ:
        return [8, data[2] + 5]
    if function == WRITE_ONE:
        return [8]
    if function == WRITE_MANY:
        return [8, *([data[6] + 9] if len(data) > 6 else [])]
    return []


def rtu_size(data: bytes | bytearray) -> int:
    """Bytes of the whole RTU frame that begins here, by its CRC; 0 where none does."""
    for size in rtu_sizes(data):
        if 5 <= size <= len(data) and crc(bytes(data[: size - 2])) == data[size - 2 : size]:
            return size
    return 0


def pdu_of(frame: bytes, mode: str) -> bytes:
    """What is inside the envelope."""
    return frame[MBAP:] if mode == TCP else frame[1:-2]


def mode_of(frame: bytes) -> str:
    """Which envelope a whole frame has; "" = none of Modbus."""
    if is_eb90(frame):
        return ""
    if tcp_size(frame) == len(frame):
        return TCP
    return RTU if rtu_size(frame) == len(frame) else ""
