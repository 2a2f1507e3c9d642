"""What a cell runs and what it costs, and the cheapest cells that together show all that a set of them shows."""

from __future__ import annotations

import heapq
import os
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import coverage

import handctl
from tests.search.suite import Suite, apart, run, told

SOURCES = os.path.join(os.path.dirname(handctl.__file__), "*")


class Shown(NamedTuple):
    """How a cell ended and what it showed: what needs a pin, its outcome, lines and branches; or what is wrong with it."""

    what: frozenset[Hashable] = frozenset()
    cost: int = 0
    """Calls of functions, about 5 million a second: the same in each run, as seconds are not."""
    wrong: str = ""


class Calls:
    """Counts calls."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, *_: object) -> None:
        self.count += 1


class Following:
    """Runs cells and follows them."""

    def __init__(self) -> None:
        warnings.simplefilter("ignore", coverage.exceptions.CoverageWarning)
        self._coverage = coverage.Coverage(data_file=None, branch=True, include=[SOURCES], config_file=False)

    def shown(self, suite: Suite, cell: str, *, lines: bool = True) -> Shown:
        """Run it. Where the suite follows its cells itself, what it ran is from there; nowhere without `lines`."""
        folder, calls = Path(tempfile.mkdtemp(prefix="cell")), Calls()
        own = type(suite).followed is not Suite.followed
        ran: set[Hashable] = set()
        try:
            if not lines:
                with counted(calls):
                    outcome = run(cell, folder)
            elif own:
                with counted(calls):
                    outcome, places = apart(suite.followed, cell, folder)
                ran = {(suite.name, place) for place in places}
            else:
                self._coverage.start()
                try:
                    with counted(calls):
                        outcome = run(cell, folder)
                finally:
                    self._coverage.stop()
                data = self._coverage.get_data()
                ran = {(path, arc) for path in data.measured_files() for arc in data.arcs(path) or ()}
                self._coverage.erase()
        except KeyboardInterrupt:
            raise
        except BaseException as exc:  # noqa: BLE001 - whatever gets out of a cell is wrong with it
            self._coverage.erase()
            return Shown(wrong=told(exc))
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        wanted = {(suite.name, "shows", what) for what in suite.shows(cell)}
        ended = (suite.name, "ended", suite.group(cell), outcome)
        return Shown(frozenset({*wanted, ended, *ran}), coarse(calls.count))


def arcs(data: str) -> frozenset[Hashable]:
    """What coverage saw run, of any tests."""
    found = coverage.CoverageData(data)
    found.read()
    return frozenset((path, arc) for path in found.measured_files() for arc in found.arcs(path) or ())


@contextmanager
def counted(calls: Calls) -> Iterator[None]:
    """Count the calls in the block."""
    sys.setprofile(calls)
    try:
        yield
    finally:
        sys.setprofile(None)


def coarse(count: int) -> int:
    """One digit of it: a cache that was filled, or a thread that ran sooner, makes no other choice."""
    size = 10 ** max(0, len(str(count)) - 1)
    return max(1, round(count / size)) * size


def cover(cells: Mapping[str, Shown]) -> list[str]:
    """Few cheap cells that show all that these show together: greedily, most that is new for a call first."""
    left = set().union(*(shown.what for shown in cells.values()))
    heap = [(-len(shown.what) / shown.cost, cell) for cell, shown in cells.items() if not shown.wrong]
    heapq.heapify(heap)
    chosen = []
    while left and heap:
        _, cell = heapq.heappop(heap)
        shown = cells[cell]
        worth = -len(shown.what & left) / shown.cost
        if heap and (worth, cell) > heap[0]:
            if worth:
                heapq.heappush(heap, (worth, cell))
            continue
        chosen.append(cell)
        left -= shown.what
    # What came early may have become needless.
    often = Counter(what for cell in chosen for what in cells[cell].what)
    for cell in sorted(chosen, key=lambda cell: (-cells[cell].cost, cell)):
        if all(often[what] > 1 for what in cells[cell].what):
            chosen.remove(cell)
            often.subtract(cells[cell].what)
    return sorted(chosen)
