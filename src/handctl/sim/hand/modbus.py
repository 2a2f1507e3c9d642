"""Modbus as the simulated RH56 hands have it: function codes 3, 6 and 16 on their registers (RH56 dossier §2.2, §2.3).

    request   3  first  count                     answer  3  bytes  data
              6  address  value                           6  address  value
             16  first  count  bytes  data               16  first  count
    refused   function + 128, exception 1 to 4

Numbers go high byte first. On DF and TP register a is the bytes a, low half, and a + 1, high half; on F1 and DG2 it is word a.
Knows what stands between unit and check sum; RTU frames are those of `rtu`, TCP has its own in device.py.
"""

from __future__ import annotations

import struct

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.hand.model import Front

READ, WRITE_ONE, WRITE = 3, 6, 16
BAD_FUNCTION, BAD_ADDRESS, BAD_VALUE, FAILED = 1, 2, 3, 4  # exceptions, by the standard: none was seen on a hand
MOST_READ = 125


def size_of(pdu: bytes | bytearray) -> int:
    """Bytes of the request that begins so; 0: too little to know, or of a function code that the hands do not have."""
    if pdu[:1] in (b"\x03", b"\x06"):
        return 5
    return 6 + pdu[5] if len(pdu) > 5 and pdu[0] == WRITE else 0


def answer(front: Front, pdu: bytes, hits: frozenset[str], unpacked: bool = False) -> bytes | None:
    """What follows the unit in the answer, None: silence."""
    function = pdu[0]
    if function not in (READ, WRITE_ONE, WRITE):
        return _exception(function, BAD_FUNCTION)
    if len(pdu) < 5 or (function == WRITE and len(pdu) < 6):
        return _exception(function, BAD_VALUE)
    first, count = struct.unpack_from(">HH", pdu, 1)
    if function == READ:
        if not 1 <= count <= MOST_READ:
            return _exception(function, BAD_VALUE)
        data = read(front, first * front.unit, count, unpacked) if first + count <= 65536 else None
        return _exception(function, BAD_ADDRESS) if data is None else bytes((READ, len(data))) + data
    words, most = pdu[3:5] if function == WRITE_ONE else pdu[6:], int(front.given["most-written"])
    if function == WRITE and (not 1 <= count <= most or pdu[5] != 2 * count or len(words) != 2 * count):
        return _exception(function, BAD_VALUE)
    done = front.write("", first * front.unit, _swapped(words), hits)
    return pdu[:5] if done else _exception(function, BAD_VALUE if done is None else FAILED)


def read(front: Front, address: int, count: int, unpacked: bool) -> bytes | None:
    """`count` registers from this byte address, as they stand on the wire."""
    hand = front.hand
    data = hand.read(address, 2 * count)
    if data is None:
        return None
    narrow = _narrow(front)
    if unpacked and address in narrow:
        return b"".join(
            struct.pack(">H", hand.space.memory[place] if place in narrow else 0)
            for place in range(address, address + count)
        )
    words = bytearray(_swapped(data))
    if "high-half" in front.faults:
        for place in range(address, address + 2 * count, 2):
            if place in narrow:
                words[place - address : place - address + 2] = data[place - address : place - address + 2]
    return bytes(words)


def _narrow(front: Front) -> range:
    """The bytes of which two share a register: error, status and temperature of DF and TP."""
    space = front.hand.space
    return range(space.place("error"), space.place("temperature", 6)) if front.unit == 1 else range(0)


def _swapped(words: bytes) -> bytes:
    return b"".join(words[place : place + 2][::-1] for place in range(0, len(words), 2))


def _exception(function: int, code: int) -> bytes:
    return bytes((function % 128 + 128, code))


def twin(front: Front, request: bytes, pdu: bytes) -> bytes:
    """The answer of a second hand to the same request: only what it measures differs."""
    if pdu[0] != READ or request[0] != READ:
        return pdu
    address = struct.unpack_from(">H", request, 1)[0] * front.unit
    return pdu[:2] + _swapped(front.second("", address, _swapped(pdu[2:])))


def crc(data: bytes | bytearray) -> bytes:
    """CRC-16 of Modbus, bit by bit: polynomial 8005 reflected, begun with all ones; low byte first on the wire."""
    register = 65535
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register // 2 ^ 40961 if register % 2 else register // 2
    return struct.pack("<H", register)


def rtu(number: int, pdu: bytes) -> bytes:
    """unit  function  ...  CRC"""
    body = bytes((number,)) + pdu
    return body + crc(body)
