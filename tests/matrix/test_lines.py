"""The fault matrix over lines as they are: every family of the registry on every line model that it can stand on.

Generated from the registry, the presets of the simulated bus and the faults of a line; in process and on virtual time. A
cell is one command; on RS-485 a device of another family and a second one of the same family hang on the wires, too. What
must hold of each: a value is the right one, the exit code is a documented one, an end comes, and no device is written to
but the one that is meant.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pytest

from handctl.families import FAMILIES
from handctl.frame.family import load
from handctl.sim import folder_of, model_class
from handctl.sim.bus.models import MODELS, text
from handctl.sim.engine.canline import CAN_FAULTS
from handctl.sim.engine.line import LINE_FAULTS
from tests.contract.cell import CODES, judge, tried, wrote
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import facts_of
from tests.matrix.report import RECORDER, bounded
from tests.support.cli import spying

VIRTUAL_SECONDS = 900.0
SECONDS = 30.0
SHARE = 16
"""Each how manieth command of a cell an ordinary run tries."""


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
CLOCKS = ("boot_time", "uptime")
"""What only counts time is another value after each retry."""
OWN, OTHER = 1, 10
ASK, ASK_CAN = "EB 90 C8 04 11 E8 03 01 C9", "11003FC8#08"
"""Somebody asks for something of id 200, who is not there."""


@pytest.fixture
def each(request: pytest.FixtureRequest) -> int:
    """Each how manieth command of a cell is tried: an ordinary run of the suite and CI take a share of both."""
    config = request.config
    whole_suite = not config.option.file_or_dir or config.option.file_or_dir == ["tests"]
    asked = not whole_suite or "faults" in config.option.markexpr
    return int(os.environ.get("HANDCTL_FAULTS_EACH", "1")) if asked else SHARE


def wire_of(place: Place) -> str:
    return str({**MODELS[place.model], **place.keys}["wire"])


def has_id(family: str) -> bool:
    """Whether several of them can be on one pair of wires."""
    return "id" in model_class(family).OPTIONS


def stands_on(family: str, name: str) -> bool:
    """Two wires are shared by ids; a device without one may be alone behind the same adapter."""
    wire = "can" if wire_of(PLACES[name]) == "can" else "serial"
    return wire in folder_of(family).WIRES and (has_id(family) or name not in SHARED)


CELLS = [
    pytest.param(family, name, fault, id=f"{family}-{name}-{fault}")
    for family in FAMILIES
    for name in PLACES
    if stands_on(family, name)
    for fault in (CAN_FAULTS if wire_of(PLACES[name]) == "can" else LINE_FAULTS)
]


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
def usual(family: str, command: str, wire: str) -> tuple[int, dict[str, Any]]:
    """How the command ends on a healthy line of its own, and the values that hold still there, by path."""
    found: list[dict[str, Any]] = []
    for turnaround in ("0", "0.02", "0.11"):
        with TemporaryDirectory() as folder:
            bus = ["bus=can"] if wire == "can" else [f"{key}={value}" for key, value in still(family).items()]
            result, rows, _, _ = tried(
                family, command, scratch_of(Path(folder)), options=(*bus, f"turnaround={turnaround}")
            )
        found.append({row["path"]: row["value"] for row in rows if "value" in row and "path" in row})
    first, *others = found
    return result.code, {
        path: value for path, value in first.items() if all(path in o and o[path] == value for o in others)
    }


@pytest.mark.faults
@pytest.mark.parametrize(("family", "name", "fault"), CELLS)
def test_every_fault_on_every_line(family: str, name: str, fault: str, each: int, tmp_path: Path) -> None:
    wrong = []
    for number, (command, verb) in enumerate(commands(family)):
        cell = f"{family} {command} {name} {fault}"
        if (family, command) in ELSEWHERE or verb.offline or zlib.crc32(cell.encode()) % each:
            continue
        folder = tmp_path / str(number)
        folder.mkdir()
        after = 3 * (zlib.crc32(cell[::-1].encode()) % 2)
        try:
            with bounded(SECONDS, cell):
                one(family, name, command, f"{fault}&after={after}", folder)
        except AssertionError as exc:
            wrong.append(f"{cell}, after {after}: {exc}")
    assert not wrong, f"{len(wrong)} cells: " + "\n".join(wrong)


def one(family: str, name: str, command: str, fault: str, folder: Path) -> None:
    """One cell, and what must hold of it."""
    facts, wire = facts_of(family), wire_of(PLACES[name])
    RECORDER.fault = fault.partition("&")[0]
    path = file_of(family, name, command, f"fault={fault}", scratch_of(folder))
    with spying() as spy:
        result, rows, envelope, transcript = tried(
            family, command, folder, link=f"fake://bus?file={path}&clock=virtual"
        )
    kind = fault.partition("&")[0]
    assert result.code in CODES, result
    errors = [message["code"] for message in envelope["messages"] if message["level"] == "error"]
    assert len([code for code in errors if code != "leaving"]) == (result.code != 0), result
    if kind not in facts.confusing:
        if command in facts.writes:
            judge(family, command, envelope["writes"], transcript)
        else:
            assert not wrote(family, command, transcript), result
    code, truth = usual(family, command, "can" if wire == "can" else "serial")
    if kind == "healthy" and name not in DAMAGE:
        assert result.code == code, result
    for row in rows:
        assert not ("error" in row and "value" in row), row
        timed = str(row.get("name")).startswith(CLOCKS)
        if command not in facts.writes and "value" in row and not timed and row.get("path") in truth:
            assert row["value"] == truth[row["path"]], row
    if spy.lines:
        bus = getattr(spy.lines[-1], "bus", spy.lines[-1])
        assert (bus.now or 0.0) < VIRTUAL_SECONDS
        if command != "scan":
            assert [line.requests for line in bus.lines[1:]] == [0] * len(bus.lines[1:]), "somebody else was spoken to"
