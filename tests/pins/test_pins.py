"""Replay the pins: cells of the searched suites that are written down in this folder. A cell that is not pinned is not run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pins import file_of, pins
from tests.search.suite import Suite, command, run, suites, told

PINNED = [suite for suite in suites().values() if file_of(suite).exists()]
GROUPS = [(suite, group) for suite in PINNED for group in dict.fromkeys(map(suite.group, pins(suite)))]
MANY = "one test of each suite and family"


@pytest.mark.parametrize(("suite", "group"), GROUPS, ids=[f"{suite.name}-{group}" for suite, group in GROUPS])
def test_pins(suite: Suite, group: str, tmp_path: Path) -> None:
    wrong = []
    for number, cell in enumerate(cell for cell in pins(suite) if suite.group(cell) == group):
        folder = tmp_path / str(number)
        folder.mkdir()
        if why := suite.stale(cell):
            wrong.append(f"{cell}\n  {why}")
            continue
        try:
            run(cell, folder)
        except Exception as exc:  # noqa: BLE001 - every pin is tried, and what failed is named
            wrong.append(f"repeat: {command(cell)}\n  {told(exc)}")
    assert not wrong, f"{len(wrong)} failed\n" + "\n".join(wrong)


@pytest.mark.parametrize("suite", PINNED, ids=[suite.name for suite in PINNED])
def test_what_needs_a_pin_has_one(suite: Suite) -> None:
    shown = {what for cell in pins(suite) for what in suite.shows(cell)}
    missing = sorted(set(suite.wanted()) - shown)
    assert not missing, f"no pin for {missing}: `python -m tests.pins {suite.name} --only TEXT`"
