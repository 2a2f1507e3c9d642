"""What handctl says of a device against what the device is: what moves it is marked, where it stands, what it refused, by which name.

The truth is that of the simulated device, its `places` (see `Facts`), and never handctl's own word.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from handctl.command.family import in_words
from handctl.docgen.read_command_tree import map_of
from handctl.families import FAMILIES
from handctl.model.explainer import DEVICE, HOST
from handctl.model.param import Param
from handctl.sim import model_class
from handctl.tools.trace_reader import explainer_of
from tests.contract.cell import in_bytes, tried
from tests.contract.commands import scratch_of, writing_commands
from tests.contract.facts import facts_of, passed
from tests.support.cli import Spy, run, spying

SECONDS = 10.0
"""Until whatever was set going has moved."""


def in_the_end(family: str, spy: Spy) -> list[float]:
    """Where the last device stands once whatever was set going has ended."""
    line = spy.lines[-1]
    line.advance(line.device.now + SECONDS)
    return facts_of(family).placed(line)


@cache
def healthy_end(family: str, command: str) -> list[float]:
    """Where a healthy device stands in the end."""
    with TemporaryDirectory() as folder, spying() as spy:
        tried(family, command, scratch_of(Path(folder)))
    return in_the_end(family, spy)


def set_by_name(family: str) -> Iterator[tuple[Param, str]]:
    """Each quantity that `set` takes, with assignments to both ends of its first element."""
    for param in map_of(family) or ():
        if (
            param.writable
            and not (param.trigger or param.optional)
            and param.low is not None
            and param.high is not None
        ):
            for end in (param.low, param.high):
                yield param, f"{param.each[0].path}={param.text(end)}"


# -- what moves it is marked ----------------------------------------------------------------------------------------------


def unmarked(family: str) -> list[str]:
    """Each assignment that is not said to move the device."""
    return [assignment for param, assignment in set_by_name(family) if not param.acts]


@pytest.mark.parametrize(
    "family", [family for family in FAMILIES if facts_of(family).places is not None and unmarked(family)]
)
def test_what_is_not_marked_moves_nothing(family: str) -> None:
    facts = facts_of(family)
    for assignment in unmarked(family):
        with spying() as spy:
            done = run(family, "set", assignment, "-y", "-p", facts.link(family), "--json")
        assert done.code in (0, 2, 7), done
        if spy.lines:
            (line,) = spy.lines
            before = facts.placed(line)
            line.advance(line.device.now + SECONDS)
            assert not facts.apart(before, facts.placed(line)), (
                f"{family} set {assignment} moves the device, and is not marked so"
            )


@pytest.mark.parametrize("family", [family for family in FAMILIES if facts_of(family).places is not None])
def test_a_plan_says_what_moves(family: str, tmp_path: Path) -> None:
    """Of a command behind which the device stands elsewhere, a step of the dry run is marked."""
    still = healthy_end(family, "status")
    for command in writing_commands(family):
        if facts_of(family).apart(still, healthy_end(family, command)):
            _, rows, _, _ = tried(family, command, scratch_of(tmp_path), "-n")
            assert any(row["moves"] for row in rows), (
                f"{family} {command} moves the device, and its plan does not say so"
            )


# -- where it stands ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", [family for family in FAMILIES if "blocked" in model_class(family).FAULTS])
def test_nothing_arrives_that_is_blocked(family: str, tmp_path: Path) -> None:
    """Where a movement ends elsewhere than on a healthy device, that is no success, and not every row has arrived."""
    facts = facts_of(family)
    for command in set(facts.halts or ()) - facts.forces:
        with spying() as spy:
            result, rows, envelope, _ = tried(family, command, scratch_of(tmp_path), options=("fault=blocked",))
        if facts.apart(healthy_end(family, command), in_the_end(family, spy)):
            assert result.code in (6, 7), result
            assert not rows or {row["arrival"] for row in rows if "arrival" in row} != {"reached"}, rows
            assert "arrived" not in str([step.get("evidence") for step in envelope["writes"]])


# -- what it refused ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_refused_is_told_as_refused(family: str, tmp_path: Path) -> None:
    """Where a command ends with "refused" its ledger says which step was, and nothing behind it is confirmed."""
    for command in writing_commands(family):
        result, _, envelope, _ = tried(family, command, scratch_of(tmp_path), options=("fault=refuse",))
        states = [step["state"] for step in envelope["writes"]]
        if command == "set":
            assert result.code == 6, result
        if result.code == 6:
            assert "refused" in states, envelope
            assert set(states[states.index("refused") :]) <= {"refused", "not-sent"}, envelope


# -- by which name --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_recorded_bytes_are_explained_by_the_names_of_the_map(family: str, tmp_path: Path) -> None:
    """Of what is read each value by its name; of what is set its name."""
    trace = tmp_path / "trace.txt"
    rows = run(family, "dump", "-p", facts_of(family).link(family), "--json", "--trace", trace).rows
    explainer, told = explainer_of(family), set[tuple[str, Any]]()
    for entry in passed(trace):
        for piece in explainer.feed(HOST if entry.mark == ">" else DEVICE, entry.data, entry.can_id):
            told |= {(value.name, value.value) for value in piece.values if piece.direction == DEVICE}
    for row in rows:
        names = {row.get("path"), row["name"]} if row["name"] not in facts_of(family).computed else set()
        assert not names or names & {name for name, value in told if value == row["value"]}, row
    every = {param.name for param in map_of(family) or ()}
    for param, assignment in set_by_name(family):
        planned = run(family, "set", assignment, "-n", "-p", facts_of(family).link(family), "--json")
        for row in planned.rows if planned.code == 0 else ():
            can_id = int(row["bytes"].split()[0], 16) if "[" in row["bytes"] else None
            said = in_words(family, in_bytes(row["bytes"]), can_id)
            named = [word for word in re.split(r"[ .,:]", said) if word in every]
            assert named[:1] == [param.name], (assignment, said)
