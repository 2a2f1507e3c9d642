"""Every command of the tree with lines that can be run: those of the families' own lists, and what these lists lack.

The tree is read from the registry, so a new command or family is asked for by itself: `examples` raises for a command
that has no line, and the test of the matrix fails. Nothing here knows what a command does.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import click

from handctl import families
from handctl.tools.probes import family_of, probe_of
from tests.barrett import commands as barrett_commands
from tests.contract.commands import commands as commands_of
from tests.contract.commands import scratch_of
from tests.contract.facts import facts_of
from tests.ekso import commands as ekso_commands
from tests.inspire import exo_commands, wrist_commands

Path_ = tuple[str, ...]
YES = ("--yes", "-y")

LOCAL = {
    "ports": "lists what the system knows",
    "devices": "the configuration file",
    "sim": "serves simulators",
    "trace": "recorded bytes",
    "completion": "the shell's files",
    "help": "texts",
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


# What no list of the families has, because it takes files, time or an order of its own. {s19} is a firmware file.
MORE: dict[str, tuple[tuple[str, ...], ...]] = {
    "exo": (("report", "{dir}/report.html"), ("describe",), ("raw", "EB 90 01 04 11 C0 05 02 DD"), ("stop",)),
    "wrist": (("report", "{dir}/report.html"), ("describe",), ("stop",)),
    "barrett": (
        ("report", "{dir}/report.html"), ("firmware", "check", "{dir}/image.s19"),
        ("firmware", "download", "{dir}/image.s19", "--yes"), ("maintenance",), ("strain",), ("strain", "--open"),
        ("strain", "--live", "--count", "2"), ("fingertips",), ("fingertips", "--live", "--count", "2"), ("diagnose",),
        ("diagnose", "sticks-open"), ("diagnose", "sticks-open", "--move", "--yes"),
        ("realtime", "--count", "3"), ("realtime", "--velocity", "20", "--count", "3"), ("realtime", "--measure", "5"),
        ("gcl", "PSET BAUD 384"), ("gcl", "1C"), ("gcl", "LOOP"), ("gcl", "T"), ("watch", "--count", "2"),
    ),
    "ekso": (("report", "{dir}/report.html"), ("policy",), ("stop",), ("export", "{dir}/log.csv", "--format", "mot")),
    "aidin": (
        ("status",), ("status", "--check"), ("dump",), ("get", "motor_pos"), ("describe",), ("report", "{dir}/report.html"),
        ("watch", "motor_pos", "--count", "2"), ("home", "--yes"), ("initial", "--yes"), ("stop",), ("bias",),
        ("max-torque", "500"), ("max-torque", "0", "--yes"), ("encoders", "index.m1=200000"), ("joints", "index.q3=160"),
        ("fingertips", "index.x=10"), ("currents", "index.m1=100", "--duration", "0.3", "--yes"),
    ),
}  # fmt: skip


FIRMWARE = "S1132C40000102030405060708090A0B0C0D0E0F08\nS9032C4090\n"
"""A small S-record file: 16 bytes at 2C40, and the end record."""


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


def tree() -> dict[Path_, click.Command]:
    """Every command of the program that may reach a device."""
    return {
        path: command
        for name, (module, _) in families.COMMANDS.items()
        if name not in LOCAL
        for path, command in leaves(importlib.import_module(module).cli, (name,))
    }


def _listed() -> dict[str, Sequence[Any]]:
    """Family -> the rows of its own list of commands."""
    return {
        "exo": exo_commands.COMMANDS,
        "wrist": wrist_commands.COMMANDS,
        "barrett": (*barrett_commands.COMMANDS, *barrett_commands.OFFLINE),
        "ekso": ekso_commands.COMMANDS,
    }


def _tools() -> Iterator[tuple[str, ...]]:
    """Lines of the tools that look at any device, one for each family of the registry."""
    yield from (("scan",), ("scan", "--all"), ("scan", "--ids", "1-2"), ("doctor",))
    for name in families.FAMILIES:
        yield "scan", "--family", name
        yield "doctor", "--family", name, "--count", "3"
    if "stop" in families.COMMANDS:
        yield ("stop",)


def _speeds() -> Iterator[tuple[str, ...]]:
    """The connect of every family with a serial wire, at each of its speeds."""
    for name in families.FAMILIES:
        if family_of(name).baud is not None:
            for speed in probe_of(name).SPEEDS:
                yield name, "status", "--baud", str(speed)


LISTED = ("exo", "wrist", "barrett", "ekso", "aidin")
"""Families with lists of their own, which leave out what stands in MORE."""


def _by_the_contract(listed: Collection[Path_]) -> Iterator[tuple[tuple[str, ...], bool, bool, tuple[str, ...]]]:
    """Rows for the commands of a family that no list has, with the arguments that the contract knows."""
    for family in families.FAMILIES:
        facts = facts_of(family)
        for name, _ in commands_of(family):
            path = (family, *name.split())
            if path not in listed and (name in facts.writes or family not in LISTED):
                asks = name == "restore" or name in (facts.halts or {})
                yield (*path, *facts.words(name, Path("{dir}"))), name in facts.writes, asks, ()


READING_KINDS = ("read", "stream", "scan", "none", "log")
READING = {
    ("exo", "raw", "EB 90 01 04 11 C0 05 02 DD"), ("barrett", "strain"), ("barrett", "strain", "--live", "--count", "2"),
    ("barrett", "diagnose"), ("barrett", "diagnose", "sticks-open"),
}  # fmt: skip
"""Lines of commands that may write, and that only read."""


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
        for family, listed in _listed().items()
        for row in listed
    ]
    more = [(family, *words) for family, lines in MORE.items() for words in lines]
    rows += [(words, words not in READING, False, ()) for words in (*more, *_tools(), *_speeds())]
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
    assert not missing, f"no line in tests/harm/lines.py, nor in the families' lists, for: {', '.join(missing)}"
    return {path: tuple(dict.fromkeys(lines)) for path, lines in found.items()}


def lines_of(family: str) -> list[Line]:
    """All lines of one family's commands; of the tools for ""."""
    return [line for lines in examples().values() for line in lines if line.family == family]


def prepare(scratch: Path) -> None:
    """The input files that lines name."""
    preparing: Mapping[str, Callable[[Path], None]] = {
        "exo": exo_commands.prepare, "wrist": wrist_commands.prepare, "barrett": barrett_commands.prepare,
        "ekso": ekso_commands.prepare,
    }  # fmt: skip
    for family in families.FAMILIES:
        (scratch / family).mkdir()
        preparing.get(family, scratch_of)(scratch / family)
    (scratch / "barrett" / "image.s19").write_text(FIRMWARE, encoding="ascii")
