"""The golden wire as a suite: its pins are the part of it that the gate replays, `tests/wire/test_wire.py`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from handctl.families import FAMILIES
from handctl.sim.engine.can_line import CAN_FAULTS
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.messages.cells import messages
from tests.search.suite import Listed
from tests.wire.book import Lines, differing, golden
from tests.wire.cells import BENCHES, LATER, Cell, cells
from tests.wire.record import Record, Recorder

TOOLS = "the tools"
WHOLE = ("run", "line", "as ", "verbose")
"""How what is done begins where a command goes its own way to its end."""


class Wire(Listed):
    """A command with its wire, and what is done to it: all of it is as golden.txt has it.

    Every command needs a pin that runs it, every wire of a family one, every place of Ctrl-C and whatever else is done one in each
    family, a fault of the line one, and a fault of the device one in each family that has it.
    """

    name = "wire"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for cell in cells().values():
            yield (owner(cell), cell.name, cell.deed), cell

    def tried(self, row: Cell, folder: Path) -> str:
        record = Recorder(folder).record(row)
        found = (
            {row.key: record.line} if row.key in self.known else {}
        )  # else `test_every_cell_is_written_down` says so
        assert not (wrong := dict(differing(found, self.known))), f"{wrong}: python -m tests.wire --diff '{row.key}'"
        return ended(record)

    @cached_property
    def known(self) -> Lines:
        """What golden.txt has."""
        return golden()

    def shows(self, cell: str) -> Iterable[str]:
        row: Cell = self.table[cell]
        whose, bench, deed = owner(row), bench_of(row), row.deed.removesuffix(LATER)
        if deed.startswith(WHOLE):
            yield f"command {row.name.removesuffix(bench) if whose == TOOLS else f'{row.family} {row.command}'}"
        yield f"wire of {whose}{bench}"
        fault = deed.removeprefix("fault=")
        yield deed if fault in {*LINE_FAULTS, *CAN_FAULTS} else f"{whose if fault == deed else row.family}, {deed}"

    def wanted(self) -> Iterable[str]:
        return {what for cell in self.table for what in self.shows(cell)}


def owner(cell: Cell) -> str:
    """The family of a cell, or the tools."""
    first = cell.name.split()[0]
    return first if first in FAMILIES else TOOLS


def bench_of(cell: Cell) -> str:
    """How its name ends where it is on another wire than the usual one of its family."""
    names = [bench.on("") for bench in BENCHES.get(cell.family, ()) if bench.name]
    return next((name for name in names if cell.name.endswith(name)), "")


def ended(record: Record) -> str:
    """Its exit codes, and the codes of its errors."""
    told = [json.loads(one) for one in messages(record).splitlines()[1:]]
    return " ".join([*map(str, record.codes), *(one["code"] for one in told if one["level"] == "error")])


SUITES = (Wire(),)
