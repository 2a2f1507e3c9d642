"""What the faults of a family's simulator must come to: exit codes by fault and command, and what a fault of the device changes.

One module a family, found by its name. What holds of every cell, whatever the family, is in `tests/search/faults.py`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from tests.contract.facts import facts_of

Codes = Collection[int]
RIGHT: Codes = frozenset({0})
CLEARED: Mapping[str, Callable[[Any], Any]] = {"clear-errors": lambda value: int(value) & 0b11100010}
"""Over-temperature (bit 1) and undefined bits stay (exo §2.3.3)."""
UNHEALTHY: Mapping[str, Codes] = {"status-check": {7}}
MOTOR_FAULTS = (
    *("faults", "hot", "locked-rotor", "over-temperature", "over-current", "motor-abnormal", "communication"),
)
"""States of the motors that the devices of Inspire share."""


LINE: Mapping[str, Codes] = {
    # the answer is there, perhaps late, in pieces, twice or among other bytes
    **dict.fromkeys(("healthy", "noise", "garble", "dribble", "split", "duplicate", "stale", "late", "slow", "echo"), RIGHT),
    "silent": {4}, "deaf": {4},
    **{key: {5} for key in ("truncate", "bad-checksum", "wrong-id", "loopback", "twin-id")},
    "disconnect": {3},
    "refuse": RIGHT,
}  # fmt: skip
"""What the faults of a serial line come to where nothing else is known."""

STOP = 1.9
"""Seconds that a stop takes at most: a second until it is acknowledged, and 0.9 s in which the device has to stand."""


@dataclass(frozen=True)
class Wire:
    """One way to reach the device.

    options  of the simulator, as in its link
    words    of every command on this wire
    line     fault of the line -> exit codes
    device   fault of the device -> command -> exit codes, 0 where it is not named
    """

    line: Mapping[str, Codes]
    device: Mapping[str, Mapping[str, Codes]]
    options: str = ""
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Variant:
    """When a fault befalls the line.

    options   of the simulator
    table     fault -> exit codes, 0 where it is not named; None = those of the wire, and what a rarer fault may come to
    faults    only these; None = those of the line
    commands  only these; None = all
    wires     only these; None = all
    words     of the command line; None = those of the family
    more      fault -> further exit codes
    bound     virtual seconds that the command may take, which then need not come to an end; 0 = any
    stop      further seconds for the stop of what it has set going
    """

    options: str = ""
    table: Mapping[str, Codes] | None = None
    faults: Collection[str] | None = None
    commands: Collection[str] | None = None
    wires: Collection[str] | None = None
    words: tuple[str, ...] | None = None
    more: Mapping[str, Codes] = field(default_factory=dict)
    bound: float = 0.0
    stop: float = 0.0


@dataclass(frozen=True)
class Outcomes:
    """One family.

    rows        its command lines: `name`, `kind`, `args`, perhaps `on_can`, `posture`
    wires       by name
    state       options of the simulator with which every command works
    words       of every command line
    variants    by name, besides "always"
    exceptions  (wire or "", fault, command) -> exit codes
    rarer       (wire, fault, row) -> codes to which a fault may come besides 0 where it befalls only some requests
    changed     fault of the device -> path -> value that it then reads
    settles     command -> what becomes of a value by it
    untold      (fault or "", command or "") of which nothing on the wire tells that a value, or what was written, is not so
    timed       beginnings of paths that count time
    erratic     faults that change the words of the host: nothing is said of what goes out
    again       commands that may repeat what they write
    lacks       faults by which the device lacks something: of no other one it may be told that its firmware does
    also        what this family must show besides
    seconds     virtual seconds that a command may take on the worst line
    """

    rows: Sequence[Any]
    wires: Mapping[str, Wire]
    state: str = ""
    words: tuple[str, ...] = ("--timeout", "1")
    variants: Mapping[str, Variant] = field(default_factory=dict)
    exceptions: Mapping[tuple[str, str, str], Codes] = field(default_factory=dict)
    rarer: Callable[[str, str, Any], Codes] = lambda wire, fault, row: ()
    changed: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    settles: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)
    untold: frozenset[tuple[str, str]] = frozenset()
    timed: tuple[str, ...] = ()
    erratic: frozenset[str] = frozenset()
    again: frozenset[str] = frozenset()
    lacks: frozenset[str] = frozenset()
    also: Callable[[Any], None] = lambda cell: None
    seconds: float = 90.0

    def codes(self, wire: str, fault: str, row: Any, variant: str) -> Codes:
        """The exit codes of one cell."""
        found = self.variants.get(variant, Variant())
        if found.table is not None:
            return found.table.get(fault, RIGHT)
        own = self.wires[wire]
        plain = own.line[fault] if fault in own.line else own.device[fault].get(row.name, RIGHT)
        keys = ((wire, fault, row.name), ("", fault, row.name))
        codes = next((self.exceptions[key] for key in keys if key in self.exceptions), plain)
        more = {*found.more.get(fault, ()), *({4, 5, 7} if found.bound else ())}
        if (not found.options and not found.bound) or fault in own.device or set(codes) == {0}:
            return {*codes, *more}
        return {0, *codes, *plain, *self.rarer(wire, fault, row), *more}

    def is_told(self, fault: str, command: str) -> bool:
        """Whether what is shown must be so."""
        return not {(fault, command), (fault, ""), ("", command)} & self.untold


class Row(NamedTuple):
    """A command line of a family that has no list of its own: `kind` read, stream, log, none or write, as in those lists."""

    name: str
    kind: str
    args: tuple[str, ...]


def rows_of(family: str) -> list[Row]:
    """The commands that the facts of a family name, with their arguments."""
    facts = facts_of(family)
    kinds = {"watch": "stream", "log": "log"}
    return [
        Row(
            name,
            "write" if name in facts.writes else kinds.get(name, "read"),
            (*name.split(), *facts.words(name, Path("{dir}"))),
        )
        for name in (*facts.reads, *facts.writes)
    ]


def outcomes_of(family: str) -> Outcomes:
    """The table of a family. Raises ModuleNotFoundError where there is none."""
    found: Outcomes = importlib.import_module(f"tests.contract.facts.outcomes.{family}").OUTCOMES
    return found
