"""Which cells the golden wire has: every command of every family, on each of its wires, times what is done to it.

A cell is named by words only: a command, its wire, a fault or a place between frames. No line of the source stands in it,
so a refactoring that keeps behaviour keeps its name. The arguments come from the facts of the contract; more command lines
from the harm matrix. Nothing here runs anything.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from handctl.families import FAMILIES
from handctl.sim import model_class
from handctl.sim.engine.can_line import CAN_FAULTS
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.contract.commands import ELSEWHERE, commands
from tests.contract.facts import Facts, facts_of
from tests.harm.lines import YES, examples

HERE = Path()
"""Every cell runs in its scratch folder: no path of a machine gets into an output."""
AT_ONCE, LATER = "", " after=3"
"""A fault from the first request on, and one behind those that look who is there."""
FORMATS = ("csv", "plain", "ndjson")


@dataclass(frozen=True)
class Bench:
    """A wire of a family, or another generation on it.

    options  of the simulator
    words    that a command needs there
    whole    every fault and every end is tried there, too; else a command runs, and no more
    """

    name: str = ""
    options: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    whole: bool = True

    @property
    def bus(self) -> str:
        """What the simulator calls the wire."""
        return next((option[4:] for option in self.options if option.startswith("bus=")), "serial")

    def on(self, command: str) -> str:
        """The command with its wire, as a cell names it."""
        return f"{command} on {self.name}" if self.name else command

    def faults(self, family: str) -> list[str]:
        """What its simulator can have there."""
        line = CAN_FAULTS if self.bus == "can" else LINE_FAULTS
        every = dict.fromkeys((*line, *model_class(family, self.bus).FAULTS))
        return [fault for fault in every if fault != "healthy"]


SERIAL = Bench()
BENCHES = {
    "wrist": (SERIAL, Bench("CAN", ("bus=can",))),
    "hand": (
        SERIAL,
        Bench("CAN", ("bus=can",)),
        Bench("Modbus RTU", ("speaks=modbus",)),
        Bench("Modbus TCP", ("model=tp", "bus=modbus-tcp")),
        *(Bench(model, (f"model={model}",), ("--model", model), whole=False) for model in ("tp", "f1", "dg2")),
    ),
}
"""Family -> its benches, where it has more than one serial wire."""
SKIPPED = ("--skip", "doctor", "--skip", "status", "--skip", "diagnose", "--skip", "watch", "--skip", "dump")
TOOLS = {
    "scan": ("scan",),
    "scan one family": ("scan", "--family", "{family}"),
    "doctor": ("doctor", "--family", "{family}", "--count", "3"),
    "stop": ("stop",),
}
"""The tools that open a link, tried at each family's simulator."""
OWN_LINES: dict[str, tuple[str, ...]] = {
    "prove": ("prove", "{family}"),
    "prove --list": ("prove", "{family}", "--list", "--level", "permanent"),
    "prove what is put back": ("prove", "{family}", "--level", "write-back", "-y", "--operator", "me"),
    "prove what moves, dry run": ("prove", "{family}", "--level", "move", "-n"),
    "prove what moves, unasked": ("prove", "{family}", "--level", "move"),
    "service": (
        "service",
        "--family",
        "{family}",
        "--skip",
        "doctor",
        "--count",
        "2",
        "--watch",
        "0.2",
        "--report",
        "report.html",
    ),
    "service without reading": ("service", "--family", "{family}", *SKIPPED, "--report", "report.html"),
    "twin check": ("twin", "check", "simulated-{family}.txt"),
    "twin check with facts": ("twin", "check", "simulated-{family}.txt", "--facts", "simulated-{family}.json"),
}
"""Lines of tools with a course of their own, at each family: as many as show it, for each takes long. Their faults and ends are
tried by their own tests."""
ENDED = {"prove": (f"fault=silent{LATER}", "Ctrl-C in the middle"), "service": ("fault=silent", "Ctrl-C in the middle")}
"""What is done to some of them besides."""
PLACES = ("behind the first frame", "in the middle", "behind the last writing frame")
ENDS = {"ctrl-c": "Ctrl-C", "other": "stop of another handctl"}


@dataclass(frozen=True)
class Cell:
    """One command line, and what is done to it.

    name    of the command with its wire, and of what is done, as golden.txt has them
    family  whose simulator it talks to; its facts tell which frames write
    words   all that is typed behind `handctl`, without the output format
    end     "ctrl-c", "other", "death" or "" ; `place` is where
    writes  whether it may write: else none of its frames does
    formats the output is shown in these instead of as people see it
    """

    name: str
    deed: str
    family: str
    command: str
    words: tuple[str, ...]
    end: str = ""
    place: str = ""
    writes: bool = False
    format: str = ""

    @property
    def key(self) -> str:
        """The cell's name in golden.txt."""
        return f"{self.name} | {self.deed}"


def link_of(family: str, command: str, bench: Bench, *options: str) -> tuple[str, str]:
    """The options that lead to the simulator."""
    return "-p", facts_of(family).link(family, command, *bench.options, *options)


def _fault(text: str) -> tuple[str, ...]:
    """``silent after=3`` as options of the simulator."""
    return tuple(f"fault={text}".split())


def _deeds(
    name: str, family: str, command: str, words: tuple[str, ...], bench: Bench, *, writes: bool, tool: bool = False
) -> Iterator[Cell]:
    """A command in all ways; `words` are those without its link."""
    sure = ("-y",) if writes and not tool else ()
    to = link_of(family, command, bench)

    def cell(deed: str, *more: str, link: tuple[str, str] = to, **how: object) -> Cell:
        return Cell(bench.on(name), deed, family, command, (*words, *bench.words, *more, *link), writes=writes, **how)  # type: ignore[arg-type]

    yield cell("run", *sure)
    if writes:
        yield cell("dry run", "-n")
        yield cell("unasked")
    if not bench.whole:
        return
    for kind in FORMATS if not bench.name else ():
        yield cell(f"as {kind}", *sure, format=kind)
    if not bench.name:
        yield cell("verbose", *sure, "-v")
    for fault in bench.faults(family):
        for after in (AT_ONCE,) if tool else (LATER,) if bench.name else (AT_ONCE, LATER):
            yield cell(f"fault={fault}{after}", *sure, link=link_of(family, command, bench, *_fault(fault + after)))
    for end, what in ENDS.items():
        if end == "ctrl-c" or writes:
            for place in PLACES:
                yield cell(f"{what} {place}", *sure, end=end, place=place)
    if writes:
        yield cell("death", *sure, end="death", place=PLACES[2])


def _of_family(family: str) -> Iterator[Cell]:
    """Every command with the arguments of the facts, and then the other lines of it."""
    facts = facts_of(family)
    benches = BENCHES.get(family, (SERIAL,))
    for bench in benches:
        for command, _ in commands(family):
            if (family, command) in ELSEWHERE:
                continue
            words = (family, *command.split(), *facts.words(command, HERE))
            writes = command in facts.writes
            yield from _deeds(f"{family} {command}", family, command, words, bench, writes=writes)
        yield from _lines(family, facts, bench)


def _lines(family: str, _facts: Facts, bench: Bench) -> Iterator[Cell]:
    """The command lines of the harm matrix, each as it is typed."""
    if not bench.whole:
        return
    for path, lines in examples().items():
        if path[0] != family:
            continue
        for line in lines:
            typed = line.can if bench.bus == "can" and line.can else line.words
            words = tuple(word.replace("{dir}", family) for word in typed if word not in YES)
            command = " ".join(path[1:])
            more = (*bench.words, *link_of(family, command, bench))
            sure = ("-y",) if line.writes or line.asks else ()
            name = bench.on(shlex.join(typed))
            yield Cell(name, "line", family, command, (*words, *sure, *more))
            if line.writes and "-n" not in words:
                yield Cell(name, "line, dry run", family, command, (*words, "-n", *more))


def _tools() -> Iterator[Cell]:
    """The tools at the simulator of each family."""
    for family in FAMILIES:
        for bench in BENCHES.get(family, (SERIAL,)):
            for name, typed in TOOLS.items():
                words = tuple(word.format(family=family) for word in typed)
                writes = name == "stop"
                yield from _deeds(f"{name} at {family}", family, name, words, bench, writes=writes, tool=True)


def _own_lines() -> Iterator[Cell]:
    """The lines of tools with a course of their own."""
    for family in FAMILIES:
        for name, typed in OWN_LINES.items():
            words = tuple(word.format(family=family) for word in typed)
            offline = name.startswith("twin") or "--list" in words
            for deed in ("run", *ENDED.get(name, ())):
                fault = _fault(deed.removeprefix("fault=")) if deed.startswith("fault=") else ()
                to = () if offline else link_of(family, name, SERIAL, *fault)
                end, place = ("ctrl-c", PLACES[1]) if deed.startswith("Ctrl-C") else ("", "")
                writes = name.startswith("prove what")
                yield Cell(f"{name} at {family}", deed, family, name, (*words, *to), end, place, writes)


@cache
def cells() -> dict[str, Cell]:
    """Every cell by its name, in the order of golden.txt."""
    found: dict[str, Cell] = {}
    for cell in (*(cell for family in FAMILIES for cell in _of_family(family)), *_tools(), *_own_lines()):
        found.setdefault(cell.key, cell)
    return found


def groups(keys: list[str]) -> list[list[str]]:
    """The cells of one command behind each other: what its run says of its frames is asked for once."""
    found: dict[str, list[str]] = {}
    for key in keys:
        found.setdefault(key.rpartition(" | ")[0], []).append(key)
    return list(found.values())
