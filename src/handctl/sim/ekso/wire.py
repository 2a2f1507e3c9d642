"""Messages of the simulated EksoNR DataPort: check value, length byte, where a request ends (manual §6).

Knows no field and no time. The CRC is computed bit by bit on purpose, other than a host would.
"""

from __future__ import annotations

TIME, DATE, SETTINGS, DATA, FEEDBACK, SET_VALUE, CANCEL = 150, 151, 152, 153, 154, 155, 156
MOVE, STATE_DATA, STEP_READY, EVENT = 157, 158, 159, 160  # met in the field, not in the manual
BODY_SIZES = {TIME: 0, DATE: 0, SETTINGS: 0, DATA: 0, FEEDBACK: 0, SET_VALUE: 4, CANCEL: 2, MOVE: 2}
LENGTHS = {"body": 0, "n-4": 2, "n-2": 4, "frame": 6}  # convention -> what the length byte counts beside the body


def crc(data: bytes) -> int:
    """CRC-CCITT: polynomial x^16 + x^12 + x^5 + 1, start FFFF, not reflected, no final XOR (manual §6, CRC table)."""
    register = 65535
    for byte in data:
        for place in (128, 64, 32, 16, 8, 4, 2, 1):
            top = register >= 32768
            register = register * 2 % 65536
            if top != bool(byte & place):
                register ^= 4129
    return register


def frame(command: int, ident: int, body: bytes, convention: str = "body") -> bytes:
    """A message in either direction; the length byte counts by this convention (the manual does not say by which)."""
    head = bytes([command, (len(body) + LENGTHS[convention]) % 256, ident // 256, ident % 256])
    return seal(head + body)


def seal(data: bytes) -> bytes:
    """The bytes with their check value, high byte first."""
    return data + crc(data).to_bytes(2, "big")


def size(length: int, convention: str) -> int | None:
    """Bytes of the whole message by its length byte; None when no message can be that short."""
    count = length - LENGTHS[convention]
    return None if count < 0 else count + 6
