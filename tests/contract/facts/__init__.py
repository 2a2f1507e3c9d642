"""What the contract must be told of a family: some ten lines in one module of this folder, found by the family's name.

Everything else it takes from the registry, the command tree, the map and the simulator.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from handctl.families import FAMILIES


class Passed(NamedTuple):
    """One line of a transcript: ">" what the host sent, "<" what came."""

    mark: str
    data: bytes
    can_id: int | None


Rule = Callable[[Passed], bool]
"""Whether an entry writes, by the manual and not by handctl; it is shown the whole transcript in order."""


class Waiting(NamedTuple):
    """A state of a simulated device in which something waits for a write that lets it go.

    by       the quantities whose writing may let it go
    asked    command lines that must ask, without their link
    places   the simulator -> where what moves is
    near     so far it may be off and has not moved
    goes     with a yes it moves; else nobody knows what a device would do
    """

    name: str
    by: tuple[str, ...]
    asked: tuple[str, ...]
    before: Callable[[Any], None]
    places: Callable[[Any], list[float]]
    options: Mapping[str, str] = MappingProxyType({})
    near: float = 5.0
    goes: bool = True


class Silent(NamedTuple):
    """How long a reading command takes to find that nothing replies on one wire.

    options  of the simulator
    words    of the command line
    seconds  at the most
    why      what takes longer than one exchange with its retries
    """

    options: str = ""
    words: tuple[str, ...] = ()
    seconds: float = 2.0
    why: str = ""


class Faulty(NamedTuple):
    """A movement that is waited for, and how its device gets error bits meanwhile.

    words    of the command line; it ends where a healthy device arrives
    element  full name of the error bits in the map
    bits     each of them that is documented -> the word of it that must be said; one that is not is added
    place    the simulator -> where what moves is
    target   where that ends
    put      sets the bits, and none takes them away
    options  of the simulator: its wire, its generation
    refused  with bits that are set before it the movement is not begun
    lasting  bits with which nothing is called reached, also where they are older than the movement
    stops    bits that tell of a stop short of the target, which is no fault: `--expect any` takes it
    """

    words: str
    element: str
    bits: Mapping[int, str]
    place: Callable[[Any], float]
    target: float
    put: Callable[[Any, int], None]
    options: str = ""
    refused: bool = False
    lasting: frozenset[int] = frozenset()
    stops: frozenset[int] = frozenset()


HERE = Path()


@dataclass(frozen=True)
class Facts:
    """One family.

    writes    command that writes -> arguments with which it works on the simulator: § is a blank in one of them, {dir} a
              scratch folder, {NAME} a snapshot of that family
    rule      command -> what tells the entries of a transcript that write
    goods     frames of both directions, whole
    likely    bytes of which its frames are made
    reads     command that only reads -> arguments; those that need none may be left out
    state     options of the simulator with which every command works, `states` of single ones
    snapshot  values that a file for `restore` and `diff` holds, none of them those at power-on
    unproven  writing commands that nothing the device tells can confirm, or not from that state
    plans     writing commands of several steps, of which each is sent when the one before is proved
    adapts    writing commands whose bytes depend on what the device tells: a dry run cannot know them all
    screens   commands whose whole output is looked at on terminals of every width
    moving    bytes that set it moving, from that state
    halts     command that moves -> the bytes that Ctrl-C must send; "" = of a test of its own
    unwatched  command line that ends while the device goes on -> the bytes that Ctrl-C must send; {dir} as in `writes`
    over      how the answer to a movement ends once it stands still; b"" = no answer waits for that
    idle      bytes of a stop that count as a write only while something moves
    drives    a command on which handctl is killed, what it sends meanwhile, and the bytes of the stop
    ends      writing command that needs no stop -> why
    confusing  faults under which `rule` cannot tell from the bytes what writes, since what comes belongs to older ones
    places    the simulator -> where what moves is, by the device itself; None = nothing that is written moves it
    near      so far it may be off and has not moved, or has arrived
    forces    of `halts` those that drive by force: where they end says nothing
    memory    the simulated device, full name of an element -> the raw number that it holds there
    power_on  full name -> value at power-on, in the unit, as its manual would print it
    refuses   lines that the codec must refuse
    broken_from  answers after which a fault can meet `dump` in the middle; 0 = one message holds all that it shows
    computed  names of rows that no `get` takes: handctl works them out of others, or of its own clock
    lines     for the harm matrix: command lines that need words of their own; {dir} holds the files of `prepare`
    looking   those of `lines` that only read, though their command may write
    rows_in   module with COMMANDS, lines with their kinds, and `prepare`, which makes the files that they name
    waiting   states in which something waits for a write that lets it go
    nothing_waits  why there are none
    faulty    movements that are waited for, on each wire, with their error bits
    reports_nothing  why there are none
    silent    how long a silent device takes, on each of its wires
    states_in  module whose `states` makes the states in which a command may meet its devices; "" = at rest, and moving
    """

    writes: Mapping[str, str]
    rule: Callable[[str], Rule]
    goods: Sequence[bytes]
    likely: bytes
    reads: Mapping[str, str]
    state: str = ""
    states: Mapping[str, str] | None = None
    snapshot: Mapping[str, float] | None = None
    unproven: frozenset[str] = frozenset()
    plans: frozenset[str] = frozenset({"set", "restore"})
    adapts: frozenset[str] = frozenset({"restore"})
    screens: tuple[str, ...] = ("status", "dump")
    moving: bytes = b""
    halts: Mapping[str, bytes] | None = None
    unwatched: Mapping[str, bytes] | None = None
    over: bytes = b""
    idle: bytes = b""
    drives: tuple[str, bytes, bytes] | None = None
    ends: Mapping[str, str] | None = None
    confusing: frozenset[str] = frozenset()
    places: Callable[[Any], list[float]] | None = None
    near: float = 20.0
    forces: frozenset[str] = frozenset()
    memory: Callable[[object, str], int] | None = None
    power_on: Mapping[str, float] | None = None
    refuses: Sequence[bytes] = ()
    broken_from: int = 1
    computed: frozenset[str] = frozenset()
    lines: Sequence[tuple[str, ...]] = ()
    looking: frozenset[tuple[str, ...]] = frozenset()
    waiting: tuple[Waiting, ...] = ()
    nothing_waits: str = ""
    faulty: tuple[Faulty, ...] = ()
    reports_nothing: str = ""
    rows_in: str = ""
    silent: tuple[Silent, ...] = (Silent(),)
    states_in: str = ""

    def words(self, command: str, folder: Path) -> list[str]:
        """The arguments of a command, with the files of `folder` in place."""
        text = self.writes.get(command, self.reads.get(command, ""))
        below = "" if folder == HERE else f"{folder}{os.sep}"
        files = {kind: f"{below}{kind}.json" for kind in FAMILIES}
        return [word.format(dir=folder, **files).replace("§", " ") for word in text.split()]

    def placed(self, line: Any) -> list[float]:
        """Where what moves is."""
        return list(self.places(line)) if self.places is not None else []

    def apart(self, one: Sequence[float], other: Sequence[float]) -> bool:
        """Whether these are different places."""
        return any(abs(a - b) > self.near for a, b in zip(one, other, strict=True))

    def link(self, family: str, command: str = "", *more: str) -> str:
        """The simulator in the state in which a command works, with or without its arguments, on virtual time; `more` are further options."""
        own = (state for name, state in (self.states or {}).items() if f"{command} ".startswith(f"{name} "))
        state = next(own, self.state)
        return f"fake://{family}?{'&'.join(filter(None, ['clock=virtual', state, *more]))}"


@cache
def facts_of(family: str) -> Facts:
    """The facts of a family of the registry. Raises ModuleNotFoundError where there are none."""
    facts: Facts = importlib.import_module(f"tests.contract.facts.{family}").FACTS
    return facts


def passed(trace: Path) -> list[Passed]:
    """A transcript, read without handctl."""
    found = []
    for line in trace.read_text(encoding="utf-8").splitlines() if trace.exists() else []:
        _, mark, rest = (*line.split(None, 2), "", "", "")[:3]
        if line.startswith("#") or mark not in ("<", ">"):
            continue
        if rest.startswith("can "):
            words = rest.split()
            found.append(Passed(mark, bytes.fromhex("".join(words[3:])), int(words[1], 16)))
        else:
            found.append(Passed(mark, bytes.fromhex(rest), None))
    return found
