"""Cells of the matrix, and what runs them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from handctl.command.command_tree import Command
from handctl.command.family import Family, load, map_of
from handctl.docgen.guide_tables import SYMPTOMS, exceptions
from handctl.families import FAMILIES
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import facts_of
from tests.support import own_state
from tests.support.cli import Result, run

Check = Callable[[Path], None]


class Cell(NamedTuple):
    """One promise, for one family and one command: it holds when `check` raises nothing. It is given a folder."""

    name: str
    check: Check


class Outcome(NamedTuple):
    """How many cells of a table were tried, and those that failed, with the reason."""

    cells: list[str]
    failed: dict[str, str]


def tried(cells: Iterable[Cell], folder: Path) -> Outcome:
    """Run every cell, with a state of its own."""
    names: list[str] = []
    failed: dict[str, str] = {}
    for number, cell in enumerate(cells):
        own_state.begin()
        names.append(cell.name)
        try:
            cell.check(folder / str(number))
        except (Exception, pytest.fail.Exception) as exc:  # noqa: BLE001 - each cell is tried, whatever the others did
            failed[cell.name] = f"{type(exc).__name__}: {' '.join(str(exc).split())[:300]}"
    doubled = {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else set()
    assert not doubled, doubled
    return Outcome(names, failed)


def hold(table: str, cells: Iterable[Cell], folder: Path) -> None:
    """Every cell holds."""
    names, failed = tried(cells, folder)
    assert names, table
    again = f"repeat: python -m tests.promises {table} --only"
    told = "\n".join(f"[{name}] {why}\n  {again} {shlex.quote(name)}" for name, why in failed.items())
    assert not failed, f"{len(failed)} of {len(names)} cells\n{told}"


# -- what there is to try -----------------------------------------------------------------------------------------------


def row_of(family: str) -> Family:
    """What the machinery knows of a family."""
    found: Family = load(family, "cli").cli.family
    return found


def reached(family: str) -> list[tuple[str, Command]]:
    """The commands of a family that reach a device and have facts."""
    return [
        (name, command) for name, command in commands(family) if not command.offline and (family, name) not in ELSEWHERE
    ]


def command_of(family: str, name: str) -> Command | None:
    """A command by its words."""
    return next((command for known, command in commands(family) if known == name), None)


def wires_of(family: str) -> dict[str, str]:
    """Wire of a family -> options of its simulator."""
    row = row_of(family)
    if not row.wires:
        return {"tcp" if row.tcp_port is not None else "serial": ""}
    return {wire: "" if place == 0 else f"bus={wire}" for place, wire in enumerate(row.wires)}


def has_serial(family: str) -> bool:
    return "serial" in wires_of(family)


@cache
def _exempt(family: str, promise: str) -> frozenset[str]:
    rows = [row for row in exceptions(family) if row.promise == promise]
    return frozenset(word for row in rows for word in re.findall(r"`([^`]+)`", row.where))


def exempt(family: str, promise: str, what: str) -> bool:
    """Whether the family has a written exception from this promise for this."""
    return what in _exempt(family, promise)


def unless(excused: bool, holds: Check) -> Check:
    """The check itself, or that an exception is still needed."""
    if not excused:
        return holds

    def needed(folder: Path) -> None:
        try:
            holds(folder)
        except (Exception, pytest.fail.Exception):  # noqa: BLE001 - that is what the exception says
            return
        pytest.fail("the promise holds: the exception is not needed")

    return needed


def made(folder: Path) -> Path:
    """The folder, with a snapshot of each family."""
    folder.mkdir(parents=True, exist_ok=True)
    return scratch_of(folder)


# -- how it is tried ----------------------------------------------------------------------------------------------------


def typed(family: str, name: str, folder: Path, link: str, *more: str) -> Result:
    """Run a command with its arguments from the facts, confirmed, on a link."""
    facts = facts_of(family)
    yes = ["-y"] if name in facts.writes else []
    env = {"XDG_STATE_HOME": str(folder / "state")}
    return run(family, *name.split(), *facts.words(name, folder), *yes, "-p", link, *more, env=env)


def link_of(family: str, *options: str) -> str:
    return facts_of(family).link(family, "", *filter(None, options))


def commands_in(text: str) -> Iterator[list[str]]:
    """The words behind `handctl` of each command that a text names, in backticks."""
    for span in re.findall(r"`handctl ([^`]+)`", text):
        yield span.split()


def step(key: str, family: str, link: str, number: int = 0) -> list[str]:
    """The words of a command of README's next step, for this family and this link."""
    (row,) = [row for row in SYMPTOMS if row.key == key]
    words = list(commands_in(row.step))[number]
    words = [family if word == next(iter(FAMILIES)) else word for word in words]
    return [link if words[place - 1] == "-p" else word for place, word in enumerate(words)]


def needs(result: Result, *codes: int, said: str = "") -> Result:
    """The result, if it ended so and said this. Raises AssertionError."""
    if result.code not in codes:
        pytest.fail(f"exit code {result.code}, expected {'/'.join(map(str, codes))}: {_last(result)}")
    if said and said not in result.said:
        pytest.fail(f"{said} expected: {result.said}")
    assert "Traceback" not in result.err, result
    return result


def _last(result: Result) -> str:
    lines = [line.strip() for line in result.err.splitlines() if "error" in line or "warning" in line]
    return (lines or ["nothing was said"])[-1][:300]


def found_in(result: Result) -> list[dict[str, Any]]:
    """The rows of a scan that name a family."""
    return [row for row in result.rows if row.get("family")]


def map_for(family: str) -> Iterable[Any]:
    """The quantities of a family."""
    return map_of(family) or ()
