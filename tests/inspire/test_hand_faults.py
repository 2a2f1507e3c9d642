"""Hands of other generations on a bad line. Every fault in every command is `tests/search/faults.py`."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from tests.contract.facts.outcomes.hand import ROWS
from tests.search.faults import Cell


class Row(NamedTuple):
    """One command line."""

    name: str
    kind: str
    args: tuple[str, ...]
    asks: bool = True


@pytest.mark.parametrize("model", ["df", "f1", "dg2"])
@pytest.mark.parametrize("wire", ["eb90", "rtu"])
def test_what_is_not_certain_is_not_written_to(tmp_path: Path, wire: str, model: str) -> None:
    faults = ("fault=healthy", "fault=silent", "fault=truncate", "fault=late", "fault=silent&every=2")
    rows = [row for row in ROWS if row.name in ("status", "dump", "set")]
    for fault in faults:
        for row in rows:
            asked = Row(row.name, row.kind, row.args)
            cell = Cell(
                "hand", wire, asked, tmp_path, f"model={model}", "seed=1", *fault.split("&"), words=("--timeout", "1")
            )
            assert cell.result.code in (0, 3, 4, 5, 6, 7) and cell.spy.now < 80.0, cell
            assert len(cell.errors) == (cell.result.code != 0), cell
            if model != "df" and row.name == "set":
                assert cell.result.code and not cell.written, cell
