"""The pins of faults: on one line, on every kind of line, and under `handctl prove`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pins.replay import complete, groups, pinned, replay
from tests.search.suite import suites

MANY = "a case for each suite and family: so many pins are replayed"


@pytest.mark.parametrize(("name", "group"), groups(__file__))
def test_pins(name: str, group: str, tmp_path: Path) -> None:
    replay(name, group, tmp_path)


@pytest.mark.parametrize("name", [suite.name for suite in pinned(__file__)])
def test_what_needs_a_pin_has_one(name: str) -> None:
    complete(suites()[name])
