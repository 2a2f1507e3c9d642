"""Places in time and on lines, one by one: scans of lines of every kind, and a BarrettHand met in every state and at every 20 ms of
its boot window."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from handctl.sim.barrett.shared_state import STATES
from handctl.sim.bus.wire_pair import RECEIVERS
from tests.barrett import test_states
from tests.barrett.sweep import LOADS, TOOLS, WINDOWS, files, leaves, outcome, starts
from tests.inspire import test_scan_lines
from tests.search.suite import Listed, Suite, key, parts

STEP = 0.02


class Scans(Listed):
    """One hand on one line: the right one at the right speed, or none."""

    name = "scan"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for line in test_scan_lines.GRID:
            yield ("exo", *line), line
        for cell in test_scan_lines.CELLS:
            yield ("late", *cell), cell

    def tried(self, row: Any, folder: Path) -> str:
        if isinstance(row, test_scan_lines.Cell):
            answer = row.asked(folder)
            assert row.right(answer), answer
            return "found"
        table, _ = test_scan_lines.found(row, folder)
        assert test_scan_lines.right(row, table), (table.rows, table.failure)
        return "found"


class Boot(Suite):
    """A BarrettHand as it is found: no command, and no connect, harms its image."""

    name = "boot"

    def cells(self) -> Iterator[str]:
        commands = [leaf for leaf in [*leaves(), *TOOLS] if leaf not in LOADS]
        for state in STATES:
            for leaf in commands if state not in ("monitor", "record") else ():
                yield key(self.name, "state", state, leaf)
        for window in WINDOWS:
            for receiver in RECEIVERS:
                for at in starts(window, STEP):
                    for number in range(len(test_states.WAYS)):
                        yield key(self.name, "connect", window, receiver, number, at)
                    for leaf in commands:
                        yield key(self.name, "command", window, receiver, leaf, at)

    def run(self, cell: str, folder: Path) -> str:
        _, kind, *rest = parts(cell)
        if kind == "connect":
            test_states.connected(float(rest[0]), rest[1], test_states.WAYS[int(rest[2])], float(rest[3]))
            return "found"
        scratch = files(folder)
        if kind == "state":
            return f"exit {test_states.unharmed(rest[0], rest[1], scratch)}"
        window, receiver, leaf, at = rest
        found = outcome("boot", leaf, scratch, float(at), boot=float(window), window=float(window), uart=receiver)
        assert found.whole and found.code != 1, found
        return f"exit {found.code}"


SUITES = (Scans(), Boot())
