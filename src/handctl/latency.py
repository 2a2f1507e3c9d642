"""Round-trip times: minimum, median, tail, histogram. Imports nothing of handctl; knows no clock and no device."""

from __future__ import annotations

from typing import Any

EDGES_MS = (0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100, 250, 1000)
"""Upper ends of the histogram's classes in ms; the last class has none."""
LATE_FACTOR = 2.0
"""A round trip that lasts more than this many medians is late."""


class RoundTrips:
    """Collects round trips in seconds."""

    def __init__(self) -> None:
        self._seconds: list[float] = []

    def add(self, seconds: float) -> None:
        """One more."""
        self._seconds.append(seconds)

    def __len__(self) -> int:
        return len(self._seconds)

    @property
    def late(self) -> int:
        """How many lasted more than twice the median."""
        limit = LATE_FACTOR * self.quantile(0.5)
        return sum(1 for seconds in self._seconds if seconds > limit)

    def quantile(self, part: float) -> float:
        """The value in seconds that `part` (0 to 1) of all do not exceed; 0 when there are none."""
        ordered = sorted(self._seconds)
        return ordered[min(len(ordered) - 1, int(part * len(ordered)))] if ordered else 0.0

    def as_row(self) -> dict[str, Any]:
        """Milliseconds for the JSON envelope: min, mean, median, p95, p99, max, late, histogram as [up to, count]."""
        if not self._seconds:
            return {"count": 0}
        return {
            "count": len(self),
            "min_ms": _ms(min(self._seconds)),
            "mean_ms": _ms(sum(self._seconds) / len(self)),
            "median_ms": _ms(self.quantile(0.5)),
            "p95_ms": _ms(self.quantile(0.95)),
            "p99_ms": _ms(self.quantile(0.99)),
            "max_ms": _ms(max(self._seconds)),
            "late": self.late,
            "histogram": self.histogram(),
        }

    def histogram(self) -> list[list[float | int | None]]:
        """[upper end in ms, count] of every class from the first to the last that holds any; None = no upper end."""
        counts = [0] * (len(EDGES_MS) + 1)
        for seconds in self._seconds:
            counts[next((i for i, edge in enumerate(EDGES_MS) if seconds * 1000 <= edge), len(EDGES_MS))] += 1
        used = [i for i, count in enumerate(counts) if count]
        if not used:
            return []
        return [[EDGES_MS[i] if i < len(EDGES_MS) else None, counts[i]] for i in range(used[0], used[-1] + 1)]


def _ms(seconds: float) -> float:
    return round(seconds * 1000, 3)
