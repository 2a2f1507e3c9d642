"""Commands of every family as lines of one batch: what they show, send and refuse there is what they do alone."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from handctl.command.options import OutFile
from handctl.families import FAMILIES
from tests.contract.alone import alone, steady, words_of
from tests.contract.cell import wrote
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import facts_of, passed
from tests.support.cli import Result, check_schema, run

MANY = "a case for each command: a new one is a line of a batch without being added to a list"
NAMED = [(family, name) for family in FAMILIES for name, _ in commands(family) if (family, name) not in ELSEWHERE]
READING = [(family, name) for family, name in NAMED if name not in facts_of(family).writes]
WRITING = [(family, name) for family, name in NAMED if name in facts_of(family).writes]


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    return scratch_of(tmp_path)


def batch(lines: list[list[str]], folder: Path, *more: str) -> tuple[Result, list[list[dict[str, Any]]], list[Any]]:
    """Run the lines; the rows of each, and what closes each."""
    (folder / "trace.txt").unlink(missing_ok=True)
    script, env = "\n".join(map(shlex.join, lines)), {"XDG_STATE_HOME": str(folder / "state")}
    result = run("batch", "--json", "--trace", folder / "trace.txt", *more, stdin=script, env=env)
    rows: list[list[dict[str, Any]]] = [[]]
    ends = []
    for text in result.lines:
        row = json.loads(text)
        if "end" in row:
            check_schema(row["end"])
            ends.append(row)
            rows.append([])
        else:
            rows[-1].append(row)
    assert "Traceback" not in result.err and result.code != 1, result
    return result, rows, ends


@pytest.mark.parametrize(("family", "name"), READING)
def test_a_line_that_reads_shows_what_it_shows_alone(family: str, name: str, scratch: Path, tmp_path: Path) -> None:
    """Also behind another one, on a link that is open already."""
    link = facts_of(family).link(family, name)
    first = alone(words_of(family, name, scratch), scratch, "-p", link)
    (again := tmp_path / "again").mkdir()
    words = words_of(family, name, scratch_of(again))
    command = next(command for known, command in commands(family) if known == name)
    files = any(isinstance(param.type, OutFile) for param in command.params)
    result, rows, ends = batch([words, [family, "status"] if files else words], scratch, "-p", link, "--keep-going")
    assert result.code == first.code, (first, result)
    assert [end.get("line") for end in ends] == [1, 2, None]
    assert ends[-1]["end"]["lines"] == 2 and ends[-1]["end"]["failed"] == (2 - files) * (first.code != 0)
    assert steady(rows[0]) == steady(first.stream[0])
    assert files or name == "scan" or [sorted(row) for row in rows[1]] == [sorted(row) for row in rows[0]]
    assert not wrote(family, name, passed(scratch / "trace.txt"))


@pytest.mark.parametrize(("family", "name"), WRITING)
def test_a_line_that_writes_sends_what_it_sends_alone(family: str, name: str, scratch: Path) -> None:
    """Behind one that reads; its ledger is its own."""
    facts = facts_of(family)
    words, link = words_of(family, name, scratch), facts.link(family, name)
    first = alone(words, scratch, "-p", link, "-y")
    before = wrote(family, name, passed(scratch / "trace.txt"))
    (scratch / "b.json").unlink(missing_ok=True)
    state = scratch / "state"
    if state.exists():
        state.rename(scratch / "state-of-the-first")
    result, rows, ends = batch([[family, "describe"], words], scratch, "-p", link, "-y")
    assert result.code == first.code, (first, result)
    assert wrote(family, name, passed(scratch / "trace.txt")) == before
    assert [end["end"]["exit_code"] for end in ends] == [0, first.code, first.code]
    shown, envelope = first.stream
    assert [sorted(row) for row in rows[1]] == [sorted(row) for row in shown]
    known = [(step["bytes"], step["state"]) for step in envelope["writes"]]
    assert [(step["bytes"], step["state"]) for step in ends[1]["end"]["writes"]] == known


@pytest.mark.parametrize(("family", "name"), WRITING)
def test_what_asks_alone_holds_up_a_batch_before_its_first_line(family: str, name: str, scratch: Path) -> None:
    words, link = words_of(family, name, scratch), facts_of(family).link(family, name)
    first = alone(words, scratch, "-p", link)
    (scratch / "b.json").unlink(missing_ok=True)
    result, _, ends = batch([[family, "status"], words], scratch, "-p", link)
    assert result.code == first.code, (first, result)
    if first.code == 8:
        assert len(ends) == 1 and "line 2" in ends[0]["end"]["messages"][0]["text"].lower()
        assert passed(scratch / "trace.txt") == []
    else:
        assert len(ends) == 3


@pytest.mark.parametrize("family", FAMILIES)
def test_a_dry_run_of_a_batch_sends_nothing(family: str, scratch: Path) -> None:
    facts = facts_of(family)
    lines = [[family, "status"], *(words_of(family, name, scratch) for name in facts.writes if not facts.states)]
    result, _, _ = batch(lines, scratch, "-p", facts.link(family), "-n", "--keep-going")
    assert result.code == 0, result
    assert [entry for entry in passed(scratch / "trace.txt") if entry.mark == ">"] == []  # a hand may speak unasked
