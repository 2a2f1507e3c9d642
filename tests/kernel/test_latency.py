"""Round trips: the figures are those of the sorted list of all of them, and memory does not grow with their number."""

from __future__ import annotations

import statistics
import tracemalloc
from random import Random

import pytest

from handctl.model.result import RoundTrips
from tests.support.each_row import each_row


def trips(*milliseconds: float) -> RoundTrips:
    found = RoundTrips()
    for value in milliseconds:
        found.add(value / 1000)
    return found


def test_nothing_yet() -> None:
    assert trips().as_row() == {"count": 0}
    assert (len(trips()), trips().quantile(0.5), trips().late, trips().histogram()) == (0, 0.0, 0, [])


def test_figures_of_a_few() -> None:
    found = trips(1.5, 1.25, 4.0, 1.5, 1001.0)
    assert found.as_row() == {
        "count": 5, "min_ms": 1.25, "mean_ms": 201.85, "median_ms": 1.5, "p95_ms": 1001.0, "p99_ms": 1001.0,
        "max_ms": 1001.0, "late": 2,
        "histogram": [[2, 3], [3, 0], [4, 1], [6, 0], [8, 0], [12, 0], [16, 0], [24, 0], [32, 0], [48, 0], [64, 0],
                      [100, 0], [250, 0], [1000, 0], [None, 1]],
    }  # fmt: skip
    assert len(found) == 5 and found.quantile(0.25) == pytest.approx(0.0015)


def test_late_is_more_than_twice_the_median() -> None:
    assert trips(1.0, 1.0, 1.0, 2.0).late == 0
    assert trips(1.0, 1.0, 1.0, 2.001).late == 1


@each_row("seed", range(3))
def test_quantiles_are_those_of_the_sorted_list(seed: int) -> None:
    source = Random(seed)
    values = [source.randrange(1, 60_000) / 1000 for _ in range(source.randrange(1, 400))]
    found, ordered = trips(*values), sorted(values)
    for part in (0.0, 0.1, 0.5, 0.95, 0.99, 1.0):
        place = min(len(ordered) - 1, int(part * len(ordered)))
        assert found.quantile(part) * 1000 == pytest.approx(ordered[place], abs=1e-9)
    assert found.late == sum(value > 2 * found.quantile(0.5) * 1000 for value in values)
    assert found.as_row()["mean_ms"] == pytest.approx(statistics.mean(values), abs=0.001)


def test_a_long_loop_takes_no_more_memory() -> None:
    source, found = Random(1), RoundTrips()
    tracemalloc.start()
    for _ in range(50_000):
        found.add(0.010 + source.randrange(500) / 1e6)
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(found) == 50_000 and kept < 100_000
