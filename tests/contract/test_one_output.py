"""One output, one writer: with -o the file holds what stdout would have got, whatever the command and the format."""

from __future__ import annotations

import re
import shutil
from itertools import cycle
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import facts_of
from tests.support.cli import run
from tests.support.each_row import each_row

FORMATS = ("json", "ndjson", "csv", "plain", "table")
MOMENTS = re.compile(
    r'"time": "[^"]*"|\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(\.\d+)?Z?|\b[0-9a-f]{64}\b'  # the sum of a page has its second in it
)
BATCH = "# two lines\nexo get id\nexo get system_voltage temperature\nexo status\n"
FAILS = "exo get id\nexo write 1006 01\n"


def both(words: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """Run it twice, each time with files and a state of its own, and compare."""
    results = []
    for name in ("stdout", "file"):
        (here := folder / name).mkdir(exist_ok=True)
        for old in here.iterdir():
            old.unlink() if old.is_file() else shutil.rmtree(old)
        monkeypatch.chdir(scratch_of(here))
        more = ["-o", "out"] if name == "file" else []
        results.append(run(*words, "--format", kind, *more, env={"XDG_STATE_HOME": str(here / "state")}))
    shown, kept = results
    there = Path("out").read_bytes().decode() if Path("out").exists() else ""
    assert MOMENTS.sub("", there) == MOMENTS.sub("", shown.out), f"{kind}: {' '.join(map(str, words))}"
    assert (kept.code, kept.out) == (shown.code, "")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_command(family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each in one of the formats, the next one in the next."""
    formats = cycle(FORMATS)
    for name, command in commands(family):
        if (family, name) in ELSEWHERE or any(param.name == "output" for param in command.params):
            continue
        facts = facts_of(family)
        yes = ["-y"] if command.writes else []
        link = [] if command.offline else ["-p", facts.link(family, name)]
        both([family, *name.split(), *facts.words(name, Path()), *yes, *link], tmp_path, monkeypatch, next(formats))


@each_row("script", [BATCH, FAILS])
@each_row("kind", FORMATS)
def test_a_batch(script: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows of all lines and the last line of JSON, also when a line has failed."""
    (tmp_path / "lines.txt").write_text(script)
    both(["batch", str(tmp_path / "lines.txt"), "-p", "fake://exo?clock=virtual"], tmp_path, monkeypatch, kind)
