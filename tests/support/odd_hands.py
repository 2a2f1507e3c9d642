"""An RH56 hand as a bare memory on each of its wires, so that a test can do to its answers what no simulator does.

Written from the dossier alone: own frames, own check sums. `Odd.change` gets (request, answer) and returns what arrives
instead: pieces with their delay. Everything that is no read is noted in `writes`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable

from handctl.link import CanFrame

Pieces = Iterable[tuple[float, bytes]]
Change = Callable[[bytes, bytes], Pieces]
EB90, RTU, TCP, CAN = "eb90", "rtu", "tcp", "can"
WIRES = (EB90, RTU, TCP, CAN)
DELAY = 0.001


def as_it_is(_request: bytes, answer: bytes) -> Pieces:
    """The answer, a millisecond after the question."""
    return [(DELAY, answer)] if answer else []


def golden(model: str) -> bytearray:
    """The memory of the golden hand, df or tp (rh56 §10)."""
    memory = bytearray(8192)

    def words(address: int, *values: int) -> None:
        struct.pack_into(f"<{len(values)}h", memory, address, *values)

    memory[1000] = 1
    words(1032, 701, 702, 703, 704, 705, 706)
    words(1044, 501, 502, 503, 504, 505, 506)
    words(1474, 111, 222, 333, 444, 555, 666)
    words(1486, -1, -1, -1, -1, -1, -1)
    words(1498, 401, 402, 403, 404, 405, 406)
    words(1522, 601, 602, 603, 604, 605, 606)
    words(1534, 211, 322, 433, 544, 655, 766)
    words(1546, 110, 220, 330, 440, 550, 660)
    words(1582, -11, 12, -13, 14, -15, 16)
    words(1594, 21, -22, 23, 24, 25, 26)
    memory[1612:1618] = bytes((2, 1, 2, 3, 2, 0))
    memory[1618:1624] = bytes((31, 32, 33, 34, 35, 36))
    if model == "df":
        words(1020, 901, 902, 903, 904, 905, 906)
        words(1472, 558)
    else:
        memory[1700:1704] = bytes((192, 168, 11, 210))
    return memory


def words_only() -> bytearray:
    """The memory of an RH56F1: word addresses, two bytes each (rh56 §3.2)."""
    memory = bytearray(16384)
    rows = {1000: (1,), 1064: (900, 1000, 1100, 1200, 1150, 700), 1088: (2,) * 6, 1094: (31, 32, 33, 34, 35, 36)}
    for address, values in rows.items():
        struct.pack_into(f"<{len(values)}h", memory, 2 * address, *values)
    return memory


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, bit by bit."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


def rtu(unit: int, pdu: bytes) -> bytes:
    """unit PDU CRC"""
    return bytes([unit]) + pdu + crc(bytes([unit]) + pdu)


def tcp(number: int, pdu: bytes, unit: int = 0xFF) -> bytes:
    """transaction 0 length unit PDU"""
    return struct.pack(">HHHB", number, 0, len(pdu) + 1, unit) + pdu


def eb90(device_id: int, flag: int, body: bytes) -> bytes:
    """90 EB id length flag body sum"""
    rest = bytes([device_id, len(body) + 1, flag]) + body
    return b"\x90\xeb" + rest + bytes([sum(rest) & 0xFF])


class Odd:
    """One hand behind a scripted link: call it with a request, as `ScriptedLink` and `ScriptedFrames` do."""

    def __init__(
        self, wire: str, memory: bytearray, change: Change = as_it_is, *, unit: int = 1, ids: Iterable[int] = (1,)
    ) -> None:
        self.wire = wire
        self.memory = memory
        self.change = change
        self.per = 2 if len(memory) > 8192 else unit
        self.ids = tuple(ids)
        self.asked = 0
        self.writes: list[bytes] = []

    def __call__(self, request: bytes | CanFrame) -> list[tuple[float, bytes]]:
        assert isinstance(request, bytes)
        self.asked += 1
        return list(self.change(request, getattr(self, f"_{self.wire}")(request)))

    def frame(self, request: CanFrame) -> list[tuple[float, CanFrame]]:
        """The same on a CAN bus."""
        self.asked += 1
        number, address, flag = request.can_id & 0x3FFF, request.can_id >> 14 & 0xFFF, request.can_id >> 26
        if number not in self.ids or flag not in (0, 1):
            return []
        if flag == 0:
            answer = bytes(self.memory[address : address + request.data[0]])
        else:
            self._write(address, request.data, bytes(request.data))
            answer = bytes([len(request.data)])
        return [(delay, CanFrame(request.can_id, data)) for delay, data in self.change(request.data, answer)]

    def _write(self, address: int, data: bytes, request: bytes) -> None:
        self.writes.append(request)
        self.memory[address : address + len(data)] = data

    def _eb90(self, request: bytes) -> bytes:
        if request[:2] != b"\xeb\x90" or request[2] not in self.ids:
            return b""
        flag, address, data = request[4], struct.unpack_from("<H", request, 5)[0], request[7:-1]
        if flag == 0x11:
            place = address * self.per
            return eb90(request[2], flag, request[5:7] + bytes(self.memory[place : place + data[0]]))
        if flag == 0x12:
            self._write(address * self.per, data, request)
            return eb90(request[2], flag, request[5:7] + b"\x01")
        return b""

    def _rtu(self, request: bytes) -> bytes:
        if request[0] not in self.ids or crc(request[:-2]) != request[-2:]:
            return b""
        pdu = self._pdu(request[1:-2], request)
        return rtu(request[0], pdu)

    def _tcp(self, request: bytes) -> bytes:
        return tcp(struct.unpack_from(">H", request)[0], self._pdu(request[7:], request), request[6])

    def _pdu(self, pdu: bytes, request: bytes) -> bytes:
        function, address, value = struct.unpack_from(">BHH", pdu)
        place = address * self.per
        if function == 3:
            return bytes([3, 2 * value]) + swapped(bytes(self.memory[place : place + 2 * value]))
        self._write(place, swapped(pdu[3:5] if function == 6 else pdu[6:]), request)
        return pdu[:5]


def swapped(data: bytes) -> bytes:
    """Each pair of bytes the other way round."""
    return b"".join(data[place : place + 2][::-1] for place in range(0, len(data), 2))
