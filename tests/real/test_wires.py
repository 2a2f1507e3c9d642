"""Each kind of wire works once: a simulator in a process of its own, a command that reads, one that writes, and silence.

Every fault in every command over every wire is `tests/search/served.py`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.contract.facts.outcomes import outcomes_of
from tests.search.faults import prepare
from tests.search.served import ROWS, SERVED, Place, ServedCell
from tests.support.cli import run_program

pytestmark = pytest.mark.real

WIRES = (
    *(("wrist", "slcan-pty"), ("ekso", "tcp"), ("aidin", "tcp")),
    *(("hand", "pty"), ("hand", "modbus-pty"), ("hand", "modbus-tcp")),
)


@pytest.mark.parametrize(("family", "served"), WIRES)
def test_each_wire_works(tmp_path: Path, family: str, served: str) -> None:
    wire, table = SERVED[family][served], outcomes_of(family)
    rows = {row.name: row for row in table.rows}
    prepare(family, tmp_path)
    with Place(family, served, tmp_path) as place:
        for name in ROWS[family][1:3]:
            row = rows[name]
            cell = ServedCell(place, wire, row, "", tmp_path)
            assert cell.result.code == 0 and cell.envelope["device"]["fake"] is False, cell
            assert all("error" not in one for one in cell.rows), cell
        assert place.tell("fault silent")
        words = (family, *rows["get"].args, *table.wires[wire].words, *place.words("silent"), "--json")
        result = run_program(*words)
        assert (result.code, result.error["code"]) == (4, "no-answer"), result
        assert result.error["hint"] and result.error["text"] in result.err and "Traceback" not in result.err
