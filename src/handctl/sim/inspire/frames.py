"""Serial frames of the simulated Inspire devices (exo §2.2, wrist §2.2): requests found in a stream, answers built.

Knows bytes only. EB 90 starts what the host sends, 90 EB what the device sends. Which flags there are, and how long
their requests may be, is the business of each device.
"""

from __future__ import annotations

import struct

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable


def find(buffer: bytes | bytearray, device_id: int, possible: Callable[[int, int], bool]) -> tuple[int, int, int]:
    """The first request for this id: bytes before it, its size (0: none yet), bytes needed to be sure of it.

        EB 90  id  length  flag  ...  sum        the frame has length + 5 bytes (exo §2.2, wrist §2.2)

    Wrong id, a flag and length that are not `possible`, and a bad sum are no requests: silence (exo §2.1). A candidate
    that fails costs one byte, so that a request behind it, or inside it, is still found.
    """
    start = decided = 0
    while True:
        start = buffer.find(b"\xeb\x90", start)
        if start < 0:
            return len(buffer) - (1 if buffer[-1:] == b"\xeb" else 0), 0, 0
        head = buffer[start + 2 : start + 5]
        if head[0:1] and head[0] != device_id:
            start += 1
            continue
        if len(head) < 3:
            return start, 0, 0
        size = head[1] + 5
        if not possible(head[2], head[1]):
            start += 1
            continue
        if len(buffer) < start + size:
            return start, 0, 0
        decided = max(decided, start + size)
        if buffer[start + size - 1] == _sum(buffer[start + 2 : start + size - 1]):
            return start, size, decided
        start += 1


def frame(device_id: int, flag: int, body: bytes) -> bytes:
    """90 EB  id  length  flag  body  sum; the length counts flag and body (exo §2.2, wrist §2.2)."""
    inner = struct.pack("BBB", device_id, len(body) + 1, flag) + body
    return struct.pack("BB", 144, 235) + inner + struct.pack("B", _sum(inner))


def _sum(data: bytes | bytearray) -> int:
    """Low byte of the sum of everything between header and sum (exo §2.2.1 note 2, wrist §2.2)."""
    total = 0
    for byte in data:
        total += byte
    return total % 256
