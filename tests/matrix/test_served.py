"""The fault matrix over real links: every device x wire x fault x command against served simulators, in real time.

`handctl sim DEVICE --pty|--tcp|--slcan-pty|--slcan-tcp` runs as a process of its own, faults are switched by its control
socket, and the real CLI is the client. What a cell must show is not written anew here: exit codes and values come from
the tables of the matrices in virtual time (`tests.inspire.exo_faults` and its siblings); new are the links, the deadline by the
wall clock, the words that name the cause, and the next command, which must work once the fault is over.

A small choice runs by default. The whole is marked `long` too: python -m pytest -m "faults and long".
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from handctl.sim.engine.canline import CAN_FAULTS
from handctl.sim.engine.line import LINE_FAULTS
from tests.aidin import faults as aidin
from tests.barrett import commands as barrett_commands
from tests.barrett import faults as barrett
from tests.ekso import commands as ekso_commands
from tests.ekso import faults as ekso_table
from tests.inspire import exo_commands, wrist_commands
from tests.inspire import exo_faults as exo
from tests.inspire import hand_faults as hand
from tests.inspire import wrist_faults as wrist
from tests.matrix.report import RECORDER
from tests.matrix.served_cells import AFTERWARDS, CAUSES, CELLS, HAND_WIRES, bus_of
from tests.support.cli import run, run_program
from tests.support.served import Served

pytestmark = pytest.mark.faults

# -- what is tried ----------------------------------------------------------------------------------------------------

DEVICES: dict[str, tuple[str, ...]] = {
    "exo": ("pty", "tcp"),
    "wrist": ("pty", "tcp", "slcan-tcp", "slcan-pty"),
    "barrett": ("pty", "tcp"),
    "ekso": ("pty", "tcp"),
    "aidin": ("tcp",),
    "hand": ("pty", "tcp", "modbus-pty", "modbus-tcp", "slcan-tcp"),
}
SHORT_CENTER = replace(
    next(command for command in wrist_commands.COMMANDS if command.name == "center"),
    args=("center", "--time", "100"),
    serial=("EB 90 01 09 31 0E 04 00 00 00 00 64 00 B1",),
    can=("15038001 [6] 00 00 00 00 64 00",),
)


def pick(commands: Any, *names: str) -> dict[str, Any]:
    """Commands of a family by name."""
    return {command.name: command for command in commands if command.name in names}


COMMANDS: dict[str, dict[str, Any]] = {
    "exo": pick(exo_commands.COMMANDS, "status", "get", "set", "move", "watch"),
    "wrist": {**pick(wrist_commands.COMMANDS, "status", "get", "set", "watch"), "center": SHORT_CENTER},
    "barrett": pick(barrett_commands.COMMANDS, "status", "get", "set-all", "step-close", "watch"),
    "ekso": pick(ekso_commands.COMMANDS, "data", "get", "set", "cancel", "watch-data"),
    "aidin": dict.fromkeys(("status", "get", "max-torque", "joints", "watch")),
    "hand": pick(hand.COMMANDS, "status", "get", "set", "angle", "watch"),
}
"""Two that read, one that writes, one that moves (or, where nothing may, stops a movement), one stream."""


NOT_STEADY = {("exo", "hot", "status"), ("wrist", "hot", "status"), ("hand", "hot", "status")}
"""Readings that fall while they are read: what they are at a moment only virtual time can say."""

SLOW = ("missing-key", "wrong-length", "nan", "wrong-type")
"""Damaged feedback is waited for 4 s before it is taken for damaged: one command that reads, one that moves."""


def commands_on(device: str, wire: str) -> list[str]:
    """All on the first wire, without one that reads and the one that moves on the others."""
    names = list(COMMANDS[device])
    return names if wire in (DEVICES[device][0], "slcan-tcp") else [names[1], names[2], names[4]]


def faults_of(device: str, wire: str) -> list[str]:
    """All of the device's table on its first wire; on the second what the line does."""
    line = CAN_FAULTS if bus_of(wire) == "can" else LINE_FAULTS
    if device == "hand":  # what each of its wires knows
        of_wire = HAND_WIRES[wire]
        return [*hand.LINE_FAULTS[of_wire], *(hand.device_faults(of_wire) if wire != "tcp" else ())]
    tables: dict[str, list[str]] = {
        "exo": [*exo.LINE_FAULTS, *exo.DEVICE_FAULTS],
        "wrist": [*wrist.LINE_FAULTS[bus_of(wire)], *wrist.DEVICE_FAULTS],
        "barrett": barrett.FAULTS,
        "ekso": list(ekso_table.FAULTS),
        "aidin": [name for name in aidin.FAULTS if name not in ("dribble", "weak")],  # 4 s an object; from power-on
    }
    first = wire in (DEVICES[device][0], "slcan-tcp")
    return [name for name in tables[device] if first or name in line]


# -- the matrix -------------------------------------------------------------------------------------------------------


class Bench:
    """The simulators of this process, each started when it is first needed."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.running: dict[tuple[str, str], Served] = {}

    def served(self, device: str, wire: str) -> Served:
        if (device, wire) not in self.running:
            place = self.directory / f"{device}-{wire}"
            place.mkdir()
            self.running[device, wire] = Served(device, wire, place)
        return self.running[device, wire]

    @cache  # noqa: B019  (one bench a module)
    def scratch(self, device: str) -> Path:
        """A directory with the input files of the device's commands."""
        path = self.directory / f"{device}-files"
        path.mkdir()
        return path


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    made = Bench(tmp_path_factory.mktemp("served"))
    yield made
    for served in made.running.values():
        served.stop()


WHOLE = [
    (device, wire, fault, name)
    for device, wires in DEVICES.items()
    for wire in wires
    for fault in faults_of(device, wire)
    for name in commands_on(device, wire)
    if (device, fault, name) not in NOT_STEADY
    and not (device == "aidin" and fault in SLOW and name not in ("get", "joints"))
]


@pytest.mark.long
@pytest.mark.parametrize(("device", "wire", "fault", "name"), [
    pytest.param(*cell, marks=pytest.mark.xdist_group("-".join((cell[0], cell[1], cell[3], str(number % 3)))))
    for number, cell in enumerate(WHOLE)
])  # fmt: skip
def test_fault_served(bench: Bench, device: str, wire: str, fault: str, name: str) -> None:
    """Ends as it must; then the fault is over, and the next command works and is right."""
    check(bench, device, wire, fault, name)


LINKS = [(device, wire) for device, wires in DEVICES.items() for wire in wires]
CHOSEN = [
    ("exo", "pty"),
    ("wrist", "tcp"),
    ("wrist", "slcan-tcp"),
    ("barrett", "pty"),
    ("ekso", "tcp"),
    ("aidin", "tcp"),
    ("hand", "modbus-tcp"),
]
TURNS = ("bad-checksum", "wrong-id", "truncate", "disconnect", "echo", "not-json", "silent")


def choice() -> list[tuple[str, str, str, str]]:
    """For each kind of link: health, a movement, a refused write, and one way to fail, by turns."""
    cells = []
    for (device, wire), fault in zip(CHOSEN, TURNS, strict=True):
        status, get, write, move, _ = COMMANDS[device]
        cells += [(device, wire, "healthy", status), (device, wire, fault, get), (device, wire, "refuse", write)]
        cells.append((device, wire, "healthy", move))
    return cells


@pytest.mark.parametrize(("device", "wire", "fault", "name"), choice())
def test_choice_served(bench: Bench, device: str, wire: str, fault: str, name: str) -> None:
    """The part of the matrix that belongs into every run."""
    check(bench, device, wire, fault, name)


@pytest.mark.long
@pytest.mark.parametrize("fault", ["healthy", "silent", "disconnect"])
@pytest.mark.parametrize(("device", "wire"), LINKS)
def test_program_served(bench: Bench, device: str, wire: str, fault: str) -> None:
    """The same as a program of its own: exit status, nothing but data on stdout, no traceback."""
    served = bench.served(device, wire)
    served.befall(fault)
    words = aidin.COMMANDS["get"] if device == "aidin" else COMMANDS[device]["get"].args
    args, began = [device, *words, *served.options, "--json"], time.monotonic()
    result = run_program(*args, timeout=served.deadline + 10)
    RECORDER.fault = fault
    RECORDER.note(args, result.code, time.monotonic() - began, traceback="Traceback" in result.err, program=True)
    assert (result.code, result.json["ok"]) == ({"healthy": 0, "silent": 4, "disconnect": 3}[fault], fault == "healthy")
    if result.code:
        assert result.error["code"] in CAUSES[fault] and result.error["hint"] and result.error["text"] in result.err
    served.calm()


BUSY = {"not-still", "no-answer"}
"""How handctl refuses, rightly, when this machine keeps it or the simulator waiting: such a cell is tried again."""
TRIES = 5


def check(bench: Bench, device: str, wire: str, fault: str, name: str) -> None:
    """One cell, and the next command once the fault is over."""
    served, scratch = bench.served(device, wire), bench.scratch(device)
    for tries in range(1, TRIES + 1):
        served.befall(fault)
        cell = CELLS[device](scratch, served, COMMANDS[device][name] or name, fault)
        try:
            cell.judge()
            break
        except AssertionError:
            met = {message["code"] for message in cell.envelope["messages"] if message["level"] == "error"}
            if tries == TRIES or not (BUSY & met or cell.late >= 0):
                raise
            RECORDER.again += 1
    if fault == "hang":  # until a power cycle
        return
    served.calm()
    after = AFTERWARDS[device]
    RECORDER.fault = "healthy"
    result = run(
        device,
        *(COMMANDS[device][after].args if device != "aidin" else aidin.COMMANDS[after]),
        *served.patient,
        "--json",
    )
    assert result.code == 0 and all("value" in row for row in result.rows), (fault, name, result)
