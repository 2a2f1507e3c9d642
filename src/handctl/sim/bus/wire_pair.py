"""A pair of wires: who drives it when, and what a receiver at its own speed makes of that.

    idle  start  b0 b1 b2 b3 b4 b5 b6 b7  stop  idle        8N1, 10 bits a byte (exo §2.1)
    1     0      least significant first  1     1

Who drives it at the same time makes a wired AND: a 0 wins. A byte with a framing error is delivered too, as a terminal without
parity checking does. Knows bits and time, no protocol and no device.

`Receiver` takes one sample in the middle of each bit. `resample` tells what is heard at a wrong speed by either of two known
receivers; which one is in the hand decides whether a short pulse at a high speed is a byte at all, so a claim that something is
harmless holds only for both.

    mid   one sample in the middle of each bit, the start bit included; a byte begins at a falling edge
    sci   16 samples a bit, as the serial interface of the hand's own processor family: the start bit must be low at two
          of samples 3, 5, 7; a bit is the majority of samples 8, 9, 10; behind a framing error that is no break the next
          start bit needs no edge
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from math import ceil, floor

EDGE = 0.000000001  # s, rounding
KEPT = 0.25  # s that a burst is remembered behind its end: ten bits at 50 bit/s are not longer


BITS = [bytes((0, *((byte >> place) % 2 for place in range(8)), 1)) for byte in range(256)]


class Burst:
    """Bytes that one sender puts on the pair back to back."""

    def __init__(self, sender: object, start: float, speed: int, data: bytes, fits_all: bool) -> None:
        self.sender = sender
        self.start = start
        self.speed = speed
        self.bit = 1.0 / speed
        self.data = data
        self.end = start + 10 * self.bit * len(data)
        self._bits: bytes | None = None  # made only when somebody must sample them
        self.fits_all = fits_all  # the sender's adapter talks at the speed of whoever listens

    def cut(self, now: float) -> None:
        """What has not been sent whole by now is gone."""
        self.data = self.data[: max(0, floor((now - self.start) / (10 * self.bit)))]
        self.end = self.start + 10 * self.bit * len(self.data)
        self._bits = None

    def _sampled(self) -> bytes:
        """A byte for each bit."""
        self._bits = b"".join([BITS[byte] for byte in self.data])
        return self._bits

    def whole(self, number: int) -> tuple[float, int, float, float]:
        """What `Ear.next` is to say of this byte when nothing disturbs it."""
        complete = self.start + number * (10 * self.bit) + 10 * self.bit
        return complete, self.data[number], complete - self.bit / 2, self.end

    def level(self, when: float) -> int:
        if not self.start <= when < self.end:
            return 1
        return (self._bits or self._sampled())[min(int((when - self.start) / self.bit), 10 * len(self.data) - 1)]

    def falls(self, since: float) -> Iterator[float]:
        """Its falling edges from `since` on."""
        bits = self._bits or self._sampled()
        place = max(0, ceil((since - self.start - EDGE) / self.bit))
        while (place := bits.find(0, place)) >= 0:
            if not place or bits[place - 1]:
                yield self.start + place * self.bit
            place += 1


class Pair:
    """What was put on the pair, in the order of time in which it was put."""

    def __init__(self) -> None:
        self.bursts: list[Burst] = []
        self.changes = 0  # how often something came or went

    def put(self, sender: object, when: float, speed: int, data: bytes, fits_all: bool = False) -> Burst:
        """Queues bytes of this sender, not before `when` and behind what it sends already."""
        for burst in reversed(self.bursts):
            if burst.sender is sender:
                when = max(when, burst.end)
                break
        burst = Burst(sender, when, speed, data, fits_all)
        self.bursts.append(burst)
        self.changes += 1
        return burst

    def cut(self, sender: object, now: float) -> None:
        """The sender falls silent: what it had not sent is gone."""
        for burst in self.bursts:
            if burst.sender is sender and burst.end > now:
                burst.cut(now)
        self.changes += 1

    def forget(self, now: float) -> None:
        if self.bursts and self.bursts[0].end < now - KEPT:
            self.bursts = [burst for burst in self.bursts if burst.end >= now - KEPT]
            self.changes += 1


class Receiver:
    """A receiver on a pair; `owner` hears nothing while it sends there itself, unless it has an `echo`."""

    def __init__(self, pair: Pair, owner: object, speed: int | None, echo: bool = False) -> None:
        self.pair = pair
        self.owner = owner
        self.echo = echo
        self.speed = speed  # bit/s; None: that of whoever sends
        self._free = -1.0e300  # from here on it waits for the next start bit
        self._seen = -1
        self._next: tuple[float, int, float, float] | None = None
        # That byte is this one of the only burst ahead, whole and undisturbed.
        self._amid: tuple[Burst, int] | None = None

    def tune(self, speed: int | None) -> None:
        """To another speed."""
        self.speed = speed
        self._seen = -1

    def next(self) -> tuple[float, int, float, float] | None:
        """The next byte by what is on the pair now: when it is complete, the byte, where it waits for a start bit then,
        and when the burst ends that it is part of."""
        if self._seen != self.pair.changes:
            self._seen = self.pair.changes
            self._next = self._find()
        return self._next

    def take(self) -> None:
        """Goes on behind that byte; the next one of an undisturbed burst needs no search."""
        if self._next is None:
            return
        self._free = self._next[2]
        if self._amid is None or self._seen != self.pair.changes:
            self._seen = -1
            return
        burst, number = self._amid[0], self._amid[1] + 1
        self._amid = burst, number
        self._next = burst.whole(number) if number < len(burst.data) else None

    def silence(self, now: float) -> None:
        """Forgets a byte that has begun."""
        self._free, self._seen = now, -1

    def _find(self) -> tuple[float, int, float, float] | None:
        if self.speed is not None and self.speed <= 0:
            return None  # a speed that no line has
        free, self._amid = self._free, None
        ahead = [burst for burst in self.pair.bursts if burst.end > free]
        own = [] if self.echo else [burst for burst in ahead if burst.sender is self.owner]
        others = [burst for burst in ahead if burst.sender is not self.owner] if own else ahead
        while True:
            heard = [burst for burst in others if burst.end > free + EDGE]
            if not heard:
                return None
            found = self._byte(free, heard)
            if found is None:
                return None
            begin, complete, byte, further, end = found
            deaf = next((burst for burst in own if burst.start < complete - EDGE and burst.end > begin + EDGE), None)
            if deaf is not None:
                free = max(deaf.end, free + EDGE)
                own.remove(deaf)
            elif byte is None:
                free = further
            else:
                if len(ahead) > 1:
                    self._amid = None
                return complete, byte, further, end

    def _byte(self, free: float, heard: list[Burst]) -> tuple[float, float, int | None, float, float] | None:
        """Where the next byte begins and is complete, itself (None: a glitch), where it goes on, the end of its burst."""
        first = heard[0] if len(heard) == 1 else min(heard, key=lambda burst: burst.start)
        if self.speed in (None, first.speed) or first.fits_all:
            step = 10 * first.bit
            place = max(0.0, (free - first.start) / step)
            part = place - floor(place)
            if part >= 0.9 or part < 0.000001:
                number = ceil(place - 0.000001)
                if number >= len(first.data):
                    return first.end, first.end, None, first.end, first.end
                begin = first.start + number * step
                beside = heard if len(heard) > 1 else ()
                if not any(b is not first and b.start < begin + step - EDGE and b.end > begin for b in beside):
                    self._amid = first, number
                    return begin, *first.whole(number)
        bit = 1.0 / (self.speed or first.speed)
        if len(heard) == 1:
            level, edge = first.level, next(first.falls(free), None)
        else:

            def level(when: float) -> int:
                return min([burst.level(when) for burst in heard])

            falls = [next((when for when in burst.falls(free) if level(when - EDGE)), None) for burst in heard]
            edge = min((when for when in falls if when is not None), default=None)
        if edge is None:
            return None
        if level(edge + 0.5 * bit):  # a glitch, no start bit
            return edge, edge + bit / 2, None, edge + bit / 2, edge
        byte = 0
        for place in range(8):
            byte |= level(edge + (1.5 + place) * bit) << place
        return edge, edge + 10 * bit, byte, edge + 9.5 * bit, max(first.end, edge + 10 * bit)


# -- what a UART hears at a wrong speed -------------------------------------------------------------------------------


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
