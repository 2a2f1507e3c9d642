"""What a UART hears at a wrong speed: the bit stream of one speed, sampled at another (8N1, 10 bits a byte).

Knows bits only. Bytes with a framing error are delivered too. Two receivers are known; which one is in the hand decides
whether a short pulse at a high speed is a byte at all, so a claim that something is harmless holds only for both.

    mid   one sample in the middle of each bit, the start bit included; a byte begins at a falling edge
    sci   16 samples a bit, as the serial interface of the hand's own processor family: the start bit must be low at two
          of samples 3, 5, 7; a bit is the majority of samples 8, 9, 10; behind a framing error that is no break the next
          start bit needs no edge
"""

from __future__ import annotations

from functools import lru_cache

from handctl.sim.bus.wire_pair import BITS

RECEIVERS = ("mid", "sci")
SAMPLES = {"mid": ((8,), (8,)), "sci": ((5, 9, 13), (15, 17, 19))}
"""Receiver -> samples of the start bit, of the other bits; mid in 16ths of a bit, sci in 32nds: centre of each sample."""
PARTS = {"mid": 16, "sci": 32}


@lru_cache(4096)  # who looks for the hand asks the same at each speed
def resample(data: bytes, sent: int, heard: int, receiver: str = "mid") -> bytes:
    """`data`, sent back to back at `sent` bit/s on an idle line, as a receiver at `heard` bit/s takes it.

        idle  start  b0 b1 b2 b3 b4 b5 b6 b7  stop  idle
        1     0      least significant first  1     1

    One unit of time is 1 / (PARTS * sent * heard) s, so that everything is a whole number.
    """
    if sent <= 0 or heard <= 0:
        return b""
    parts = PARTS[receiver]
    at_start, at_bit = SAMPLES[receiver]
    bits, size = b"".join([BITS[byte] for byte in data]), parts * heard

    def level(when: int) -> int:
        place = when // size
        return bits[place] if place < len(bits) else 1

    def sample(edge: int, number: int, places: tuple[int, ...]) -> int:
        """Bit `number` behind the edge: the majority of its samples."""
        found = sum([level(edge + sent * (parts * number + place)) for place in places])
        return int(2 * found > len(places))

    def fall(free: int) -> int | None:
        """The first falling edge from `free` on."""
        place = -(-free // size)
        if not place and bits[:1] == b"\0":
            return 0
        place = bits.find(b"\1\0", max(0, place - 1))
        return None if place < 0 else (place + 1) * size

    out, edge = bytearray(), fall(0)
    while edge is not None:
        if sample(edge, 0, at_start):  # a glitch, no start bit
            edge = fall(edge + sent * (at_start[-1]))
            continue
        byte = sum(sample(edge, 1 + number, at_bit) << number for number in range(8))
        out.append(byte)
        framed = sample(edge, 9, at_bit)
        if receiver == "sci" and byte and not framed and not level(edge + sent * parts * 10):
            edge += sent * parts * 10
        else:
            edge = fall(edge + sent * (parts * 9 + at_bit[-1]))
    return bytes(out)
