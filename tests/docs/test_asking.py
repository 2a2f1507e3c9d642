"""The table of handctl-safety(7) that says which commands ask first, by trying each where no one can answer."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from handctl import guides
from handctl.errors import NotConfirmed
from handctl.families import FAMILIES
from tests.contract.commands import scratch_of
from tests.contract.facts import facts_of
from tests.support.cli import run

TABLES = [block for block in guides.blocks(guides.source("safety")) if isinstance(block, guides.Table)]
(ASKING,) = [table.rows[1:] for table in TABLES if "asks first" in table.rows[0]]
NAMED = {row[0].strip("`"): tuple(re.findall(r"`([a-z][a-z -]*)`", cell) for cell in row[1:]) for row in ASKING}
OWN = {"firmware download": "firmware.S19", "pair": "--force", "terminal": "2A"}
"""A command that the facts of its family do not have, and an argument."""
FILE = "S10B2000112233445566FF0070\nS9030000FC\n"


def test_every_family_has_a_row() -> None:
    assert list(NAMED) == list(FAMILIES)


@pytest.mark.parametrize("family", NAMED)
def test_a_command_asks_or_begins_as_the_table_says(
    family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(scratch_of(tmp_path))
    (tmp_path / "firmware.S19").write_text(FILE, encoding="ascii")
    facts = facts_of(family)
    asking, at_once = NAMED[family]
    assert {*asking, *at_once} == {*facts.writes, *(set(OWN) & set(asking))}
    found = {}
    for command in (*asking, *at_once):
        words = facts.words(command, tmp_path) if command in facts.writes else [OWN[command]]
        done = run(family, *command.split(), *words, "-p", facts.link(family, command))
        assert done.code in (0, NotConfirmed.exit_code), (command, done)
        found[command] = done.code == NotConfirmed.exit_code
    assert found == {**dict.fromkeys(asking, True), **dict.fromkeys(at_once, False)}
