"""The pins of the contract's suites."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pins.replay import complete, groups, pinned, replay
from tests.search.suite import suites
from tests.support.each_row import each_row

MANY = "a case for each suite and family: so many pins are replayed"


@pytest.mark.parametrize(("name", "group"), groups(__file__))
def test_pins(name: str, group: str, tmp_path: Path) -> None:
    replay(name, group, tmp_path)


@each_row("name", [suite.name for suite in pinned(__file__)])
def test_what_needs_a_pin_has_one(name: str) -> None:
    complete(suites()[name])
