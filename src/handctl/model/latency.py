"""Round-trip times: minimum, median, tail, histogram. Imports nothing of handctl; knows no clock and no device."""

from __future__ import annotations

from collections import Counter
from typing import Any

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

    def add(self, seconds: float) -> None:
        """One more."""
        self._counts[round(seconds * 1e6)] += 1
        self._count += 1
        self._total += seconds

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
        place, seen = min(self._count - 1, int(part * self._count)), 0
        for value in sorted(self._counts):
            seen += self._counts[value]
            if seen > place:
                return value
        return 0

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
