"""Do no harm: unless a command is of the device's family and confirmed, nothing on the device changes.

Every command line of every family against every device in every state, `tests/harm`; and every command that writes against
hands of another generation, where its bytes mean something else, `tests/inspire/generations.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from tests.harm import lines, states
from tests.harm.cell import cells, try_cell
from tests.inspire import generations
from tests.search.suite import Listed, parts


class Harm(Listed):
    """A pin for every command, every state of a device, and every excuse."""

    name = "harm"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        every = [line for found in lines.examples().values() for line in found]
        for state in states.states():
            for line, mode in cells(state, every):
                yield (state.owner or "nobody", state, line, mode), (state, line, mode)

    def tried(self, row: Any, folder: Path) -> str:
        lines.prepare(folder)
        cell = try_cell(*row, folder)
        assert not cell.harm, f"handctl {cell.line} ({cell.mode}, exit {cell.code}): {cell.harm}"
        return f"exit {cell.code}{' heard' if cell.fed else ''}{f' excused: {cell.excused}' if cell.excused else ''}"

    def wanted(self) -> Iterable[str]:
        return [*map(str, states.states()), *(" ".join(path) for path in lines.tree())]

    def shows(self, cell: str) -> Iterable[str]:
        if cell not in self.table:
            return ()
        state, line, _ = self.table[cell]
        return str(state), " ".join(line.path)


class Generations(Listed):
    """A pin for every command that writes, and every hand with what was typed of it."""

    name = "harm-generations"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for case in generations.cases():
            for name in generations.names():
                yield ("hand", name, *case), (name, *case)

    def tried(self, row: Any, folder: Path) -> str:
        return generations.tried(*row, folder)

    def wanted(self) -> Iterable[str]:
        return {what for cell in self.table for what in self.shows(cell)}

    def shows(self, cell: str) -> Iterable[str]:
        _, _, name, *case = parts(cell)
        return name, ", ".join(case)


SUITES = (Harm(), Generations())
