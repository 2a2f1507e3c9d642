"""Every command of the tree with lines that can be run: those of the families' own lists, and what these lists lack.

The tree is read from the registry, so a new command or family is asked for by itself: `examples` raises for a command
that has no line, and the test of the matrix fails. Nothing here knows what a command does.
"""

from __future__ import annotations

import importlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import click

from handctl import families
from handctl.tools.family_probe import family_of, probe_of
from tests.contract.commands import commands as commands_of
from tests.contract.commands import scratch_of
from tests.contract.facts import facts_of

Path_ = tuple[str, ...]
YES = ("--yes", "-y")

LOCAL = {
    "ports": "lists what the system knows",
    "devices": "the configuration file",
    "sim": "serves simulators",
    "plot": "recordings",
    "trace": "recorded bytes",
    "twin": "recorded bytes, and simulators in this process",
    "completion": "the shell's files",
    "help": "texts",
    "history": "what other commands have kept",
    "top": "the watch of each named device, which is here",
    "shell": "other lines, typed at a terminal",
    "batch": "other lines, each of them here; tests/contract/test_batch.py says that it sends no more than they",
}
"""Commands at the top that open no link to a device, and why."""


@dataclass(frozen=True)
class Line:
    """One command line, without its link.

    path    where its command stands in the tree
    words   all of its words; {dir} is a scratch folder
    writes  the command says that it writes or moves
    asks    it needs a confirmation: without one not a byte is sent
    """

    path: Path_
    words: tuple[str, ...]
    writes: bool = False
    asks: bool = False
    can: tuple[str, ...] = ()
    """The words on a CAN bus where they differ."""

    @property
    def family(self) -> str:
        """Whose command it is; "" for the tools, which are nobody's."""
        return self.path[0] if self.path[0] in families.FAMILIES else ""

    def __str__(self) -> str:
        return " ".join(self.words)


def leaves(group: click.Command, path: Path_) -> Iterator[tuple[Path_, click.Command]]:
    """All commands below one, as they are typed."""
    if not isinstance(group, click.Group):
        yield path, group
        return
    context = click.Context(group)
    for name in group.list_commands(context):
        found = group.get_command(context, name)
        assert found is not None
        yield from leaves(found, (*path, name))


@cache
def tree() -> dict[Path_, click.Command]:
    """Every command of the program that may reach a device."""
    return {
        path: command
        for name, (module, _) in families.COMMANDS.items()
        if name not in LOCAL
        for path, command in leaves(importlib.import_module(module).cli, (name,))
    }


def _listed() -> Iterator[tuple[str, Any]]:
    """(family, row) of the families' own lists of commands."""
    for family in families.FAMILIES:
        if module := facts_of(family).rows_in:
            for row in importlib.import_module(module).COMMANDS:
                yield family, row


def _tools() -> Iterator[tuple[str, ...]]:
    """Lines of the tools that look at any device, one for each family of the registry."""
    yield from (("scan",), ("scan", "--all"), ("scan", "--ids", "1-2"), ("doctor",))
    for name in families.FAMILIES:
        yield "scan", "--family", name
        yield name, "scan"
        yield name, "listen", "--duration", "1"
        yield name, "export", "{dir}/log.csv", "--to", "xdf", "-o", "{dir}/log.xdf"
        yield "doctor", "--family", name, "--count", "3"
        yield "service", "--family", name, "--count", "3", "--follow", "--report", "{dir}/service.html"
        yield "prove", name
        yield name, "doctor", "--count", "3"
    if "stop" in families.COMMANDS:
        yield ("stop",)


def _speeds() -> Iterator[tuple[str, ...]]:
    """The connect of every family with a serial wire, at each of its speeds."""
    for name in families.FAMILIES:
        if family_of(name).baud is not None:
            for speed in probe_of(name).SPEEDS:
                yield name, "status", "--baud", str(speed)


def _by_the_contract(listed: Collection[Path_]) -> Iterator[tuple[tuple[str, ...], bool, bool, tuple[str, ...]]]:
    """Rows for the commands of a family that no list has, with the arguments that the contract knows."""
    for family in families.FAMILIES:
        facts = facts_of(family)
        for name, command in commands_of(family):
            path = (family, *name.split())
            if path not in listed and (name in facts.writes or not facts.lines):
                asks = command.asks is True or name in (facts.halts or {})
                yield (*path, *facts.words(name, Path("{dir}"))), name in facts.writes, asks, ()


READING_KINDS = ("read", "stream", "scan", "none", "log")


def _writes(row: Any) -> bool:
    """Whether a line of the families' lists writes or moves."""
    if row.kind in READING_KINDS:
        return False
    sent = next((getattr(row, name) for name in ("serial", "lines", "frames") if hasattr(row, name)), ())
    return row.kind not in ("raw", "gcl", "hand") or bool(sent)


@cache
def examples() -> dict[Path_, tuple[Line, ...]]:
    """Every command of the tree with its lines. Raises AssertionError, naming the commands that have none."""
    commands, found = tree(), {}
    rows: list[tuple[tuple[str, ...], bool, bool, tuple[str, ...]]] = [
        ((family, *row.args), _writes(row), getattr(row, "asks", False) is True, getattr(row, "on_can", ()))
        for family, row in _listed()
    ]
    for family in families.FAMILIES:
        facts = facts_of(family)
        rows += [((family, *words), words not in facts.looking, False, ()) for words in facts.lines]
    rows += [(words, True, False, ()) for words in (*_tools(), *_speeds())]
    rows += _by_the_contract({words[:size] for words, *_ in rows for size in (2, 3)})
    for words, writing, asks, on_can in rows:
        path = next((words[:size] for size in (3, 2, 1) if words[:size] in commands), None)
        if path is None:
            continue  # of a command that is not there (yet)
        plain = tuple(word for word in words if word not in YES)
        writes = bool(getattr(commands[path], "writes", False)) and writing
        line = Line(path, plain, writes, asks or len(plain) < len(words), (path[0], *on_can) if on_can else ())
        found.setdefault(path, []).append(line)
    missing = [" ".join(path) for path in commands if path not in found]
    assert not missing, f"no line in tests/contract/facts, nor in the families' lists, for: {', '.join(missing)}"
    return {path: tuple(dict.fromkeys(lines)) for path, lines in found.items()}


def lines_of(family: str) -> list[Line]:
    """All lines of one family's commands; of the tools for ""."""
    return [line for lines in examples().values() for line in lines if line.family == family]


def prepare(scratch: Path) -> None:
    """The input files that lines name."""
    for family in families.FAMILIES:
        (scratch / family).mkdir()
        module = facts_of(family).rows_in
        prepare_own = importlib.import_module(module).prepare if module else scratch_of
        prepare_own(scratch / family)
