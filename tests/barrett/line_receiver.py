"""What a BarrettHand hears that listens at 9600 while others speak faster: its receiver, by the dossier alone (1.5, 13).

Independent of the simulator's. 16 samples a bit on the receiver's own clock: a byte begins at a falling edge that two of the
samples 3, 5 and 7 confirm, a bit is the majority of samples 8, 9 and 10, and a byte with a framing error counts too. Each phase
of that clock is tried, a clock that is a percent fast or slow, and what receivers differ in: an edge is behind one high sample
or three, the byte behind a framing error needs an edge of its own or begins where the line is low, and behind a glitch the next
edge counts at once or when it was recognised as one.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from math import gcd
from typing import NamedTuple

MONITOR = 9600
TRIGGER = 0xFF
"""Opens the boot monitor, and begins a record behind that (dossier 7.2)."""
SAMPLES = 16
IDLE = 12
"""Bits of the receiver behind which it has forgotten what was before: a byte and more."""
RULES = ((1, False, 1), (3, False, 1), (1, True, 1), (3, True, 1), (1, True, 7), (3, False, 7))
"""High samples before an edge; whether the byte behind a framing error does without; samples behind a glitch after which the
next edge is looked for."""
SKEWS = (0, -10, 10)
"""Thousandths by which the two clocks differ."""
FRAMES = [bytes((0, *(byte >> place & 1 for place in range(8)), 1)) for byte in range(256)]
BYTES = {frame[1:-1]: byte for byte, frame in enumerate(FRAMES)}


class Sent(NamedTuple):
    """One write: seconds, bit/s, bytes."""

    at: float
    baud: int
    data: bytes


def bursts(writes: Iterable[Sent], listens: int = MONITOR) -> Iterator[tuple[tuple[int, bytes, int], ...]]:
    """What a receiver hears in one go: (bit/s, bytes, bits of silence before them at that speed) of each write."""
    burst: list[tuple[int, bytes, int]] = []
    end = 0.0
    for at, baud, data in sorted(writes, key=lambda one: one.at):
        gap = max(0.0, at - end)
        if burst and gap * listens >= IDLE:
            yield tuple(burst)
            burst = []
        burst.append((baud, data, round(gap * baud) if burst else 0))
        end = max(at, end) + 10 * len(data) / baud
    if burst:
        yield tuple(burst)


def heard(data: bytes, baud: int, listens: int = MONITOR, skews: Sequence[int] = SKEWS) -> set[bytes]:
    """All that a receiver at `listens` can take `data` for that is sent at `baud` bit/s on an idle line."""
    return hears(((baud, data, 0),), listens, skews)


@cache
def hears(
    burst: tuple[tuple[int, bytes, int], ...], listens: int = MONITOR, skews: Sequence[int] = SKEWS
) -> set[bytes]:
    """The same for a burst; the phase and the clock are those of its first write."""
    first = burst[0][0]
    phases = min(8, first // gcd(first, SAMPLES * listens))
    lines = {_samples(burst, listens, skew, phase / phases) for skew in skews for phase in range(phases)}
    return {_bytes(line, levels, *rule) for line in lines for levels in [_levels(line)] for rule in RULES}


def _samples(burst: tuple[tuple[int, bytes, int], ...], listens: int, skew: int, phase: float) -> bytes:
    """The levels of the line, a byte each."""
    out = bytearray(b"\1" * 4)
    for baud, data, gap in burst:
        bits = b"\1" * gap + b"".join([FRAMES[byte] for byte in data])
        size = baud * (1 + skew / 1000) / (SAMPLES * listens)  # bits from one sample to the next
        places = _places(size, phase, len(bits).bit_length())
        out += bytes(map(bits.__getitem__, places[: bisect_left(places, len(bits))]))
    return bytes(out) + b"\1" * (SAMPLES * IDLE)


@cache
def _places(size: float, phase: float, digits: int) -> list[int]:
    """In which bit each sample is, for fewer than 2 ** `digits` bits."""
    return [int((number + phase) * size) for number in range(int((1 << digits) / size) + 1)]


def _levels(line: bytes) -> bytes:
    """At each sample the level of most of the three that begin there, of all at once: they are the digits of a number."""
    one = int.from_bytes(line, "little")
    two, three = one >> 8, one >> 16
    return (one & two | one & three | two & three).to_bytes(len(line), "little")


def _bytes(line: bytes, levels: bytes, edge: int, runs_on: bool, deaf: int) -> bytes:
    """The bytes in samples of the line."""
    falls, out = b"\1" * edge + b"\0", bytearray()
    start = line.find(falls) + edge
    while edge <= start <= len(line) - SAMPLES * 10:
        place = start + deaf - edge  # behind a glitch
        if line[start + 2] + line[start + 4] + line[start + 6] < 2:
            byte = BYTES[levels[start + SAMPLES + 7 : start + SAMPLES * 8 + 8 : SAMPLES]]
            out.append(byte)
            if runs_on and byte and not levels[start + SAMPLES * 9 + 7] and not line[start + SAMPLES * 10]:
                start += SAMPLES * 10
                continue
            place = start + SAMPLES * 9 + 9
        start = line.find(falls, place) + edge
    return bytes(out)
