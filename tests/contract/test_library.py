"""The methods of the library are the commands: the same rows, the same errors, the same questions, for every family.

So each command is run, too: it ends as it should on a healthy device, and what only reads writes nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.api import methods
from handctl.command.family import load
from handctl.command.options import command_line
from handctl.errors import HandctlError
from handctl.families import FAMILIES
from tests.contract.alone import alone, steady, words_of
from tests.contract.cell import wrote
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import facts_of, passed

MANY = "a case for each command: a new one is called without being added to a list"
OPENS_NONE = {(family, name): command.offline for family in FAMILIES for name, command in commands(family)}
"""Whether a command has no use for a link: on the command line it says so, where the library has opened one for all methods."""
NAMED = [(family, name) for family in FAMILIES for name, _ in commands(family) if (family, name) not in ELSEWHERE]
WRITING = [(family, name) for family, name in NAMED if name in facts_of(family).writes]


def called(family: str, name: str, folder: Path, **more: Any) -> tuple[list[Any], int, str, Any]:
    """Call the method with the arguments of the command line: its rows, its exit code, its error, its envelope."""
    facts = facts_of(family)
    method = next(method for method in methods(family).values() if method.words == name)
    command = load(family, "cli").cli
    for word in name.split():
        command = command.commands[word]
    trace = folder / "trace.txt"
    trace.unlink(missing_ok=True)
    context = command.make_context(name, facts.words(name, folder))
    named = {
        argument.name: value
        for argument in method.arguments
        if (value := context.params.get(argument.key)) not in (None, ())
    }
    own = dict(command_line(context).own)
    with handctl.connect(family, facts.link(family, name), trace=str(trace), **own) as device:
        try:
            rows = getattr(device, method.name)(**named, **more)
            if command.streams:
                rows = [row for sample in rows for row in sample]
        except HandctlError as exc:
            return list(exc.rows), exc.exit_code, exc.text, device.envelope
        return rows, 0, "", device.envelope


@pytest.mark.parametrize(("family", "name"), NAMED)
def test_a_method_is_its_command(
    family: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    writes = name in facts_of(family).writes
    (one := tmp_path / "one").mkdir()
    (two := tmp_path / "two").mkdir()
    first = alone(
        words_of(family, name, scratch_of(one)),
        one,
        *([] if OPENS_NONE[family, name] else ["-p", facts_of(family).link(family, name)]),
        *(["-y"] if writes else []),
    )
    sent = wrote(family, name, passed(one / "trace.txt"))
    shown, closing = first.stream
    assert first.code == 0 or (first.code == 7 and shown), first
    assert writes or not sent
    monkeypatch.setenv("XDG_STATE_HOME", str(two / "state"))
    rows, code, _, envelope = called(family, name, scratch_of(two), **({"confirm": True} if writes else {}))
    assert code == first.code and envelope["exit_code"] == code, (first, envelope)
    assert steady(rows) == steady(shown)
    assert wrote(family, name, passed(two / "trace.txt")) == sent
    assert [message["code"] for message in envelope["messages"]] == [message["code"] for message in closing["messages"]]
    assert envelope["counters"]["sent"] == closing["counters"]["sent"]
    if writes:
        known = [(step["bytes"], step["state"]) for step in closing["writes"]]
        assert [(step["bytes"], step["state"]) for step in envelope["writes"]] == known
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("family", "name"), WRITING)
def test_what_asks_raises_without_confirm_and_sends_nothing(
    family: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (one := tmp_path / "one").mkdir()
    first = alone(words_of(family, name, scratch_of(one)), one, "-p", facts_of(family).link(family, name))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    rows, code, _, _ = called(family, name, scratch_of(tmp_path))
    assert code == first.code, first
    if code == 8:
        assert rows == [] and passed(tmp_path / "trace.txt") == []


@pytest.mark.parametrize(("family", "name"), WRITING)
def test_a_dry_run_returns_the_bytes(family: str, name: str, tmp_path: Path) -> None:
    (one := tmp_path / "one").mkdir()
    first = alone(words_of(family, name, scratch_of(one)), one, "-p", facts_of(family).link(family, name), "-n")
    rows, code, _, _ = called(family, name, scratch_of(tmp_path), dry_run=True)
    assert (code, rows) == (first.code, first.stream[0])
    assert [entry for entry in passed(tmp_path / "trace.txt") if entry.mark == ">"] == []
