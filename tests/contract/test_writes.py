"""Every command that writes, on its simulator: `writes` is what the transcript shows, whatever became of the line.

The frames are taken from the transcript by rules of this file, written from the manuals, not by handctl's own.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.command.family import load
from handctl.families import FAMILIES
from tests.contract.cell import go, judge
from tests.contract.commands import scratch_of, writing_commands
from tests.contract.facts import facts_of

FAULTS = [f"{fault}&after={after}" for fault in ("silent", "disconnect") for after in (0, 2, 4, 6)]


def test_every_command_that_writes_is_here_and_every_family_says_what_writes() -> None:
    for family in FAMILIES:
        missing = set(writing_commands(family)) - set(facts_of(family).writes)
        assert not missing, f"no arguments in tests/contract/facts/{family}.py for what writes: {sorted(missing)}"
    assert all(callable(load(name, "write_rules").words) for name in FAMILIES)


ASK_FIRST = {("wrist", "stop")}
"""It holds the angles that it reads: without an answer there is nothing to send."""


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    return scratch_of(tmp_path)


# -- the cells --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_on_a_healthy_device(family: str, tmp_path: Path) -> None:
    for command in writing_commands(family):
        result, writes, transcript = go(family, command, scratch_of(tmp_path))
        judge(family, command, writes, transcript)
        assert writes, result
        assert [step["meaning"] for step in writes if not step["meaning"]] == []
        if command not in facts_of(family).unproven:
            assert {step["state"] for step in writes} == {"confirmed"}, writes


@pytest.mark.parametrize("family", FAMILIES)
def test_a_dry_run_has_every_step_as_not_sent(family: str, scratch: Path) -> None:
    for command in writing_commands(family):
        result, writes, transcript = go(family, command, scratch, "", "-n")
        assert result.code == 0, result
        writing = facts_of(family).rule(command)
        assert {step["state"] for step in writes} == (set() if (family, command) in ASK_FIRST else {"not-sent"})
        assert not [entry for entry in transcript if entry.mark == ">" and writing(entry)]
