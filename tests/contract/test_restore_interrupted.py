"""Ctrl-C in `restore` of every family that has it: what was written and what was not is told, and the rows are true."""

from __future__ import annotations

import signal
from itertools import count
from pathlib import Path
from unittest import mock

import pytest

from handctl.command import snapshots
from handctl.families import FAMILIES
from handctl.link import Deadline
from handctl.link.fake import FakeLink
from tests.contract.commands import scratch_of
from tests.contract.facts import facts_of
from tests.support.cli import Result, run

RESTORING = [family for family in FAMILIES if "restore" in facts_of(family).writes and facts_of(family).snapshot]


def link_of(family: str, folder: Path) -> str:
    state = facts_of(family).state
    return f"fake://{family}?clock=virtual&state={folder / 'state.json'}{'&' + state if state else ''}"


def restore(family: str, folder: Path, after: int) -> Result | None:
    """The command with Ctrl-C at its n-th write to the link, None = it ends before that; never with 0."""
    scratch_of(folder)
    (folder / "state.json").unlink(missing_ok=True)
    words = facts_of(family).writes["restore"].format(**{family: folder / f"{family}.json"}).split()
    times = 0
    write = FakeLink.write

    def pressed(self: FakeLink, data: bytes, deadline: Deadline) -> None:
        nonlocal times
        write(self, data, deadline)
        times += 1
        if times == after:
            signal.raise_signal(signal.SIGINT)

    with mock.patch.object(FakeLink, "write", pressed):
        result = run(family, "restore", *words, "-y", "-p", link_of(family, folder), "--json")
    return result if not after or times >= after else None


@pytest.mark.parametrize("family", RESTORING)
def test_an_interrupted_restore_tells_what_it_wrote(family: str, tmp_path: Path) -> None:
    whole = restore(family, tmp_path, 0)
    assert whole is not None and whole.code == 0 and whole.rows, whole
    wanted = {row["name"]: row["value"] for row in whole.rows}
    seen = set()
    for number in count(1):
        result = restore(family, tmp_path, number)
        if result is None:
            break
        if result.code == 0:  # behind the last exchange an interrupt changes nothing
            continue
        assert result.error["text"].removeprefix("Interrupted").strip(" ."), "not one word of what became of it"
        if not result.rows:
            assert not [row for row in result.json["writes"] if row["state"] != "not-sent"], result
            seen.add("before the first write")
            continue
        seen.add("while it writes")
        assert [row["name"] for row in result.rows] == list(wanted)
        read = run(family, "get", *wanted, "-p", link_of(family, tmp_path), "--json")
        held = [row["value"] for row in read.rows]
        assert [row["value"] for row in result.rows] == held, "what it tells is what the device holds"
        for row in result.rows:
            assert row["restored"] == (row["value"] == wanted[row["name"]]), row
            assert row["value"] is not None or row["error"], row
    assert seen == {"before the first write", "while it writes"}


def test_an_interrupted_restore_saves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--save` keeps what was to be restored, and not half of it."""
    from handctl.devices.barrett.device import BarrettHand
    from handctl.devices.barrett.gcl.line import GclLine

    asked: list[str] = []
    ask, write = GclLine.ask, BarrettHand.write

    def noted(self: GclLine, command: str, **more: float) -> object:
        asked.append(command)
        return ask(self, command, **more)

    def pressed(self: BarrettHand, changes: object) -> object:
        write(self, changes)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    monkeypatch.setattr(GclLine, "ask", noted)
    monkeypatch.setattr(BarrettHand, "write", pressed)
    scratch_of(tmp_path)
    snapshots.load(str(tmp_path / "barrett.json"), "barrett")
    result = run("barrett", "restore", tmp_path / "barrett.json", "--save", "-y", "-p", "fake://barrett?clock=virtual", "--json")  # fmt: skip
    assert result.code == 130 and result.rows, result
    assert not [command for command in asked if "SAVE" in command]
