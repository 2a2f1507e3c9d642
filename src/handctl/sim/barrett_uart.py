"""What a UART hears at a wrong speed: the bit stream of one speed, sampled at another (8N1, 10 bits a byte).

Knows bits only. Bytes with a framing error are delivered too.
"""

from __future__ import annotations


def resample(data: bytes, sent: int, heard: int) -> bytes:
    """`data`, sent back to back at `sent` bit/s on an idle line, as a receiver at `heard` bit/s takes it.

        idle  start  b0 b1 b2 b3 b4 b5 b6 b7  stop  idle
        1     0      least significant first  1     1

    The receiver starts at a falling edge, samples in the middle of its bits, and looks for the next edge from the
    middle of its stop bit on. One unit of time is 1 / (2 * sent * heard) s, so that everything is a whole number.
    """
    if sent <= 0 or heard <= 0:
        return b""
    bits = [bit for byte in data for bit in (0, *((byte >> place) % 2 for place in range(8)), 1)]

    def level(when: int) -> int:
        place = when // (2 * heard)
        return bits[place] if place < len(bits) else 1

    out, free = bytearray(), 0
    for place, bit in enumerate(bits):
        edge = place * 2 * heard
        if bit or (place and not bits[place - 1]) or edge < free:
            continue
        free = edge + sent
        if level(free):  # shorter than half a bit: a glitch, no start bit
            continue
        out.append(sum(level(edge + sent * (3 + 2 * number)) << number for number in range(8)))
        free = edge + sent * 19
    return bytes(out)
