"""Measured properties of a line: round trip, echo, half duplex, traffic of others. Knows no device, does no I/O."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from typing import Any

SLOW = 0.045
"""Seconds: no cable with an adapter takes so long for a short question; Bluetooth and networks do."""
LEAST = 8
"""Bytes: smaller pieces are those of a line as the computer happens to read it."""


class LineQuality:
    """Facts of one line, each None until it was measured.

    trips          seconds from a short question to its answer, bytes included
    speed_matters  whether the device is only reached at its own speed; not over Bluetooth, USB CDC or a network
    half_duplex    whether an answer is lost while something is sent
    echo           whether our own bytes come back
    others         whether frames were heard that answer nothing that was asked
    longest        bytes of the last long answer, whose pieces were looked at
    met            who has shown on this line that it is of the family that reads it; not of its row
    """

    def __init__(self) -> None:
        self.trips = RoundTrips()
        self.speed_matters: bool | None = None
        self.half_duplex: bool | None = None
        self.echo: bool | None = None
        self.others: bool | None = None
        self.longest: int | None = None
        self.met: set[Hashable] = set()
        self._size = self._alike = 0  # of the pieces of the last long answers, and how many in a row had it

    @property
    def round_trip(self) -> float | None:
        """The median in seconds."""
        return self.trips.quantile(0.5) if len(self.trips) else None

    @property
    def worst(self) -> float:
        """The longest in seconds, 0 where none was measured."""
        return self.trips.quantile(1.0) if len(self.trips) else 0.0

    @property
    def spread(self) -> float | None:
        """From the shortest to the longest, in seconds; None for less than two."""
        return self.worst - self.trips.quantile(0.0) if len(self.trips) > 1 else None

    @property
    def slow(self) -> bool:
        """Whether answers take as long as over Bluetooth or a network."""
        return (self.round_trip or 0.0) > SLOW

    def pieces(self, sizes: Sequence[int]) -> None:
        """Learn from the pieces in which a long answer came: a packet's size shows as that of all but the last, twice."""
        first, self.longest = sizes[0], sum(sizes)
        if first < LEAST or sizes[-1] > first or any(size != first for size in sizes[:-1]):
            first = 0
        self._alike = self._alike + 1 if first == self._size else 1
        self._size = first

    @property
    def packet(self) -> int | None:
        """Bytes of the packets in which long answers come, all of it where something on the way gathers them; None where
        none show. A cable has none: its pieces are those in which this computer reads."""
        told = self._size and self._alike > 1 and (self.slow or self.speed_matters is False)
        return self._size if told else None

    def as_row(self) -> dict[str, Any]:
        """`line` of the JSON envelope: null for what was not measured."""
        return {
            "round_trip_ms": _ms(self.round_trip),
            "spread_ms": _ms(self.spread),
            "speed_matters": self.speed_matters,
            "half_duplex": self.half_duplex,
            "echo": self.echo,
            "others": self.others,
        }

    def words(self) -> str:
        """One line for people, "" for a line about which there is nothing to say."""
        took = f"{1000 * (self.round_trip or 0.0):.0f} ms"
        if self.speed_matters is False:
            kind = "Bluetooth-like" if (self.round_trip or 0.0) > 0.02 else "USB or network"
            text = f"{kind}: {took}, speed ignored"
        elif self.slow:
            text = f"Slow line: {took}"
        elif self.half_duplex:
            text = f"Half duplex: {took}"
        else:
            return "Other programs use this line" if self.others else ""
        return f"{text}, half duplex" if self.half_duplex and "duplex" not in text.lower() else text


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1000 * seconds, 1)


# -- round trips ----------------------------------------------------------------------------------------------------


EDGES_MS = (0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100, 250, 1000)
"""Upper ends of the histogram's classes in ms; the last class has none."""
LATE_FACTOR = 2.0
"""A round trip that lasts more than this many medians is late."""


class RoundTrips:
    """Collects round trips in seconds; counts each microsecond value, so that a loop of hours takes no more memory."""

    def __init__(self) -> None:
        self._counts: Counter[int] = Counter()
        self._count = 0
        self._total = 0.0
        self._sorted: list[int] = []
        self._fresh: list[int] = []  # values that are not among them yet
        self._median, self._below = 0, 0  # when it was last asked for, and how many have come that are smaller

    def add(self, seconds: float) -> None:
        """One more."""
        value = round(seconds * 1e6)
        if value not in self._counts:
            self._fresh.append(value)
        self._counts[value] += 1
        self._count += 1
        self._total += seconds
        self._below += value < self._median

    def __len__(self) -> int:
        return self._count

    @property
    def late(self) -> int:
        """How many lasted more than twice the median."""
        limit = LATE_FACTOR * self._quantile(0.5)
        return sum(count for value, count in self._counts.items() if value > limit)

    def quantile(self, part: float) -> float:
        """The value in seconds that `part` (0 to 1) of all do not exceed, to 1 us; 0 when there are none."""
        return self._quantile(part) / 1e6

    def _quantile(self, part: float) -> int:
        if not self._count:
            return 0
        if self._fresh:
            self._sorted = sorted(self._sorted + self._fresh)
            self._fresh.clear()
        if part in (0.0, 1.0):
            return self._sorted[-1 if part else 0]
        place, at, seen = min(self._count - 1, int(part * self._count)), 0, 0
        if part == 0.5 and self._median:  # it moves little: asked for with each line of a batch
            at, seen = self._sorted.index(self._median), self._below
            while seen > place:
                at -= 1
                seen -= self._counts[self._sorted[at]]
        while seen + self._counts[self._sorted[at]] <= place:
            seen += self._counts[self._sorted[at]]
            at += 1
        if part == 0.5:
            self._median, self._below = self._sorted[at], seen
        return self._sorted[at]

    def as_row(self) -> dict[str, Any]:
        """Milliseconds for the JSON envelope: min, mean, median, p95, p99, max, late, histogram as [up to, count]."""
        if not self._count:
            return {"count": 0}
        return {
            "count": self._count,
            "min_ms": min(self._counts) / 1000,
            "mean_ms": round(self._total / self._count * 1000, 3),
            "median_ms": self._quantile(0.5) / 1000,
            "p95_ms": self._quantile(0.95) / 1000,
            "p99_ms": self._quantile(0.99) / 1000,
            "max_ms": max(self._counts) / 1000,
            "late": self.late,
            "histogram": self.histogram(),
        }

    def histogram(self) -> list[list[float | int | None]]:
        """[upper end in ms, count] of every class from the first to the last that holds any; None = no upper end."""
        counts = [0] * (len(EDGES_MS) + 1)
        for value, count in self._counts.items():
            counts[next((i for i, edge in enumerate(EDGES_MS) if value <= edge * 1000), len(EDGES_MS))] += count
        used = [i for i, count in enumerate(counts) if count]
        if not used:
            return []
        return [[EDGES_MS[i] if i < len(EDGES_MS) else None, counts[i]] for i in range(used[0], used[-1] + 1)]
