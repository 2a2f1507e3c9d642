"""The matrix: a table of promises a test."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.promises.cells import hold
from tests.promises.tables import TABLES


@pytest.mark.parametrize("table", TABLES)
def test_every_promise_holds(table: str, tmp_path: Path) -> None:
    hold(table, TABLES[table](), tmp_path)
