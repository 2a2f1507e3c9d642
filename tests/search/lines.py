"""Every family on every line model that it can stand on, in each of its commands, under each fault of the line.

Generated from the registry, the presets of the simulated bus and the faults of a line; on virtual time. On RS-485 a device of
another family and a second one of the same family hang on the wires, too. What must hold of each cell: a value is the right
one, the exit code is a documented one, an end comes, and no device is written to but the one that is meant.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from handctl.command.family import load
from handctl.families import FAMILIES
from handctl.sim import folder_of, model_class
from handctl.sim.bus.bus_file import MODELS
from handctl.sim.engine.can_line import CAN_FAULTS
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.contract.cell import CODES, judge, tried, wrote
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import facts_of
from tests.search.suite import Listed, bounded, parts
from tests.support.bus_file import text
from tests.support.cli import spying

VIRTUAL_SECONDS = 900.0
SECONDS = 30.0
AFTER = (0, 3)
"""A fault is there from the first request on, or from the fourth."""


class Place(NamedTuple):
    """One line, by a preset or with something added to one; `keys` go into [line]."""

    model: str
    keys: Mapping[str, Any]
    master: bool = False


PLACES = {
    **{name: Place(name, {}) for name in MODELS},
    "second-master": Place("half-duplex", {}, master=True),
    "can": Place("clean", {"wire": "can"}),
    "can-late": Place("clean", {"wire": "can", "latency_ms": 40, "spread_ms": 20}),
    "can-second-master": Place("clean", {"wire": "can"}, master=True),
}
SHARED = ("half-duplex", "first-byte-lost", "second-master")
"""Lines that are two wires for several, or nothing."""
DAMAGE = ("first-byte-lost", "second-master")
"""Lines on which a healthy device may be misunderstood."""
CLOCKS = ("boot_time", "uptime", "upright_time", "time", "date", "clock_offset")
"""What only counts time is another value after each retry."""
OWN, OTHER = 1, 10
ASK, ASK_CAN = "EB 90 C8 04 11 E8 03 01 C9", "11003FC8#08"
"""Somebody asks for something of id 200, who is not there."""


def wire_of(place: Place) -> str:
    return str({**MODELS[place.model], **place.keys}["wire"])


def has_id(family: str) -> bool:
    """Whether several of them can be on one pair of wires."""
    return "id" in model_class(family).OPTIONS


def stands_on(family: str, name: str) -> bool:
    """Two wires are shared by ids; a device without one may be alone behind the same adapter."""
    wire = "can" if wire_of(PLACES[name]) == "can" else "serial"
    return wire in folder_of(family).WIRES and (has_id(family) or name not in SHARED)


def still(family: str) -> dict[str, str]:
    """What keeps its body from moving by itself: values of another moment are then the same ones."""
    return {"sway": "0"} if "sway" in model_class(family).OPTIONS else {}


def speed_of(family: str, wire: str) -> dict[str, Any]:
    """The speed that it starts with, as on a line of its own."""
    baud = load(family, "cli").cli.family.baud
    return {"baud": baud} if baud and wire != "can" and "baud" in model_class(family).OPTIONS else {}


def file_of(family: str, name: str, command: str, options: str, folder: Path) -> Path:
    """The FILE of this bus."""
    place, facts = PLACES[name], facts_of(family)
    wire = wire_of(place)
    state = (facts.states or {}).get(command, facts.state)
    own: dict[str, Any] = {
        "kind": family,
        **speed_of(family, wire),
        **still(family),
        **dict(item.split("=") for item in f"{state}&{options}".split("&") if item),
    }
    others: list[dict[str, Any]] = []
    if has_id(family) and wire != "rs232":
        own["id"] = OWN
        neighbours = [family, *(kind for kind in FAMILIES if kind != family and has_id(kind) and stands_on(kind, name))]
        others = [{"kind": kind, "id": OTHER + count} for count, kind in enumerate(neighbours)]
    alone = {} if has_id(family) or wire != "rs485" else {"wire": "rs232", "half_duplex": False}
    masters = [{"ask": ASK_CAN if wire == "can" else ASK, "every_ms": 100}] if place.master else []
    path = folder / f"{name}.toml"
    path.write_text(text(place.model, [own, *others], masters, **{**place.keys, **alone}), encoding="utf-8")
    return path


@cache
def usual(family: str, command: str, wire: str) -> tuple[set[int], dict[str, Any]]:
    """How the command ends on a healthy line of its own, and the values that hold still there, by path."""
    found: list[dict[str, Any]] = []
    codes = set()
    for turnaround in ("0", "0.02", "0.11"):
        with TemporaryDirectory() as folder:
            bus = ["bus=can"] if wire == "can" else [f"{key}={value}" for key, value in still(family).items()]
            result, rows, _, _ = tried(
                family, command, scratch_of(Path(folder)), options=(*bus, f"turnaround={turnaround}")
            )
        codes.add(result.code)
        found.append({row["path"]: row["value"] for row in rows if "value" in row and "path" in row})
    first, *others = found
    return codes, {path: value for path, value in first.items() if all(path in o and o[path] == value for o in others)}


def one(family: str, name: str, command: str, fault: str, folder: Path) -> str:
    """One cell, and what must hold of it; its exit code and the codes of its errors."""
    facts, wire = facts_of(family), wire_of(PLACES[name])
    path = file_of(family, name, command, fault, scratch_of(folder))
    with spying() as spy:
        result, rows, envelope, transcript = tried(
            family, command, folder, link=f"fake://bus?file={path}&clock=virtual"
        )
    kind = fault.partition("&")[0].partition("=")[2]
    assert result.code in CODES, result
    errors = [message["code"] for message in envelope["messages"] if message["level"] == "error"]
    assert len([code for code in errors if code != "leaving"]) == (result.code != 0), result
    if kind not in facts.confusing:
        if command in facts.writes:
            judge(family, command, envelope["writes"], transcript)
        else:
            assert not wrote(family, command, transcript), result
    whole = kind == "healthy" and name not in DAMAGE
    measure = partial(usual, family, command, "can" if wire == "can" else "serial")
    assert not whole or result.code in measure()[0], result
    for row in rows:
        assert not ("error" in row and "value" in row), row
        timed = str(row.get("name")).startswith(CLOCKS) or str(row.get("value")).startswith("? (")  # not known
        if command not in facts.writes and "value" in row and not timed:
            assert row["value"] == measure()[1].get(row.get("path"), row["value"]), row
    if spy.lines:
        bus = getattr(spy.lines[-1], "bus", spy.lines[-1])
        assert (bus.now or 0.0) < VIRTUAL_SECONDS
        if command != "scan":
            assert [line.requests for line in bus.lines[1:]] == [0] * len(bus.lines[1:]), "somebody else was spoken to"
    return " ".join([f"exit {result.code}", *errors])


class Lines(Listed):
    """Family, command, line, fault, after how many requests."""

    name = "lines"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family in FAMILIES:
            for command in tried_commands(family):
                for line, place in PLACES.items():
                    faults = CAN_FAULTS if wire_of(place) == "can" else LINE_FAULTS
                    for fault in faults if stands_on(family, line) else ():
                        for after in AFTER:
                            row = (family, line, command, f"fault={fault}&after={after}")
                            yield (family, command, line, fault, f"after {after}"), row

    def tried(self, row: Any, folder: Path) -> str:
        with bounded(SECONDS, " ".join(row)):
            return one(*row, folder)

    def wanted(self) -> Iterable[str]:
        """Every command, every line, every fault of one."""
        return dict.fromkeys(what for cell in self.cells() for what in self.shows(cell))

    def shows(self, cell: str) -> Iterator[str]:
        _, family, command, line, fault, _ = parts(cell)
        yield from (f"command {family} {command}", f"line {line}", f"fault {fault}")


def tried_commands(family: str) -> list[str]:
    """Commands that ask a device, without those that have tests of their own."""
    return [name for name, verb in commands(family) if not verb.offline and (family, name) not in ELSEWHERE]


SUITES = (Lines(),)
