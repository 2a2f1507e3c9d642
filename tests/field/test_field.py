"""Every recording of this folder is decoded, shown, replayed and compared with its twin as its row says. See README.md here."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from handctl.families import FAMILIES
from handctl.sim.cli import cli as simulators
from tests.support.cli import run
from tests.support.each_row import each_row

HERE = Path(__file__).parent
ROWS: list[dict[str, Any]] = json.loads((HERE / "expected.json").read_text(encoding="utf-8"))
FILES = [row["file"] for row in ROWS]


def row_of(file: str) -> tuple[dict[str, Any], tuple[str | Path, ...]]:
    """The row of a recording, and the option for its facts."""
    row = next(row for row in ROWS if row["file"] == file)
    return row, ("--facts", HERE / row["facts"]) if row["facts"] else ()


def test_every_file_has_its_row_and_every_family_a_recording() -> None:
    named = [name for row in ROWS for name in (row["file"], row["facts"]) if name]
    there = {path.name for path in HERE.iterdir() if path.suffix in (".txt", ".json")} - {"expected.json"}
    assert sorted(named) == sorted(there)
    assert {row["family"] for row in ROWS} == set(FAMILIES)


def test_what_a_simulator_made_says_so_and_what_says_so_was_made_by_one() -> None:
    assert set(FAMILIES) <= set(simulators.commands)
    for row in ROWS:
        said = "made by a simulator" in (HERE / row["file"]).read_text(encoding="utf-8").splitlines()[1]
        facts = json.loads((HERE / row["facts"]).read_text(encoding="utf-8"))["simulated"] if row["facts"] else said
        assert said == facts == row["file"].startswith("simulated-") == row["from"].startswith("fake://"), row


@each_row("file", FILES)
def test_it_is_decoded(file: str) -> None:
    row, _ = row_of(file)
    shown = run("trace", "show", HERE / file, "--json")
    statistics = shown.json["statistics"]
    assert (shown.code, statistics["family"], statistics["problems"]) == (0, row["family"], row["problems"])


@each_row("file", FILES)
def test_it_is_replayed(file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row, facts = row_of(file)
    monkeypatch.chdir(tmp_path)
    for words, code in row["replay"].items():
        result = run(row["family"], *words.split(), "-p", f"replay:{HERE / file}", *facts)
        assert result.code == code, result
        assert "internal" not in result.err


@each_row("file", FILES)
def test_its_twin_answers_as_it_did(file: str) -> None:
    row, facts = row_of(file)
    result = run("twin", "check", HERE / file, "--family", row["family"], *facts, "--json")
    assert result.code in (0, 7), result
    assert row["share"] is None or result.rows[1]["share"] >= row["share"]
