"""The fault matrix over real links: every device x wire x fault x command against served simulators, in real time.

`handctl sim DEVICE --pty|--tcp|--slcan-pty|--slcan-tcp` runs as a process of its own, faults are switched by its control
socket, and the real CLI is the client. What a cell must show is not written anew here: exit codes and values come from
the tables of the matrices in virtual time (test_faults_exo and its siblings); new are the links, the deadline by the
wall clock, the words that name the cause, and the next command, which must work once the fault is over.

A small choice runs by default. The whole is marked `long` too: python -m pytest -m "faults and long".
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import pytest

from handctl.sim.canline import CAN_FAULTS
from handctl.sim.line import LINE_FAULTS
from tests import barrett_commands, cli_commands, ekso_commands, wrist_commands
from tests import ekso_faults as ekso_table
from tests import test_faults_aidin as aidin
from tests import test_faults_barrett as barrett
from tests import test_faults_ekso as ekso
from tests import test_faults_exo as exo
from tests import test_faults_wrist as wrist
from tests.aidin_support import FINGERS
from tests.cli_support import Result, run, sent
from tests.matrix_report import RECORDER
from tests.served_support import Served

pytestmark = pytest.mark.faults
MARGIN = 0.7
"""Seconds beyond the deadline that a cell may take on a busy machine: what moves is stopped, what was written read."""

# -- what is tried ----------------------------------------------------------------------------------------------------

DEVICES: dict[str, tuple[str, ...]] = {
    "exo": ("pty", "tcp"),
    "wrist": ("pty", "tcp", "slcan-tcp", "slcan-pty"),
    "barrett": ("pty", "tcp"),
    "ekso": ("pty", "tcp"),
    "aidin": ("tcp",),
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
    "exo": pick(cli_commands.COMMANDS, "status", "get", "set", "move", "watch"),
    "wrist": {**pick(wrist_commands.COMMANDS, "status", "get", "set", "watch"), "center": SHORT_CENTER},
    "barrett": pick(barrett_commands.COMMANDS, "status", "get", "set-all", "step-close", "watch"),
    "ekso": pick(ekso_commands.COMMANDS, "data", "get", "set", "cancel", "watch-data"),
    "aidin": dict.fromkeys(("status", "get", "max-torque", "joints", "watch")),
}
"""Two that read, one that writes, one that moves (or, where nothing may, stops a movement), one stream."""


NOT_STEADY = {("exo", "hot", "status"), ("wrist", "hot", "status")}
"""Readings that fall while they are read: what they are at a moment only virtual time can say."""

SLOW = ("missing-key", "wrong-length", "nan", "wrong-type")
"""Damaged feedback is waited for 4 s before it is taken for damaged: one command that reads, one that moves."""


def commands_on(device: str, wire: str) -> list[str]:
    """All on the first wire, without one that reads and the one that moves on the others."""
    names = list(COMMANDS[device])
    return names if wire in (DEVICES[device][0], "slcan-tcp") else [names[1], names[2], names[4]]


def bus_of(wire: str) -> str:
    """The wire as the wrist's tables name it."""
    return "can" if wire.startswith("slcan") else "serial"


def faults_of(device: str, wire: str) -> list[str]:
    """All of the device's table on its first wire; on the second what the line does."""
    line = CAN_FAULTS if bus_of(wire) == "can" else LINE_FAULTS
    tables: dict[str, list[str]] = {
        "exo": [*exo.LINE_FAULTS, *exo.DEVICE_FAULTS],
        "wrist": [*wrist.LINE_FAULTS[bus_of(wire)], *wrist.DEVICE_FAULTS],
        "barrett": barrett.FAULTS,
        "ekso": list(ekso_table.FAULTS),
        "aidin": [name for name in aidin.FAULTS if name not in ("dribble", "weak")],  # 4 s an object; from power-on
    }
    first = wire in (DEVICES[device][0], "slcan-tcp")
    return [name for name in tables[device] if first or name in line]


# -- one cell ---------------------------------------------------------------------------------------------------------


class ServedCell:
    """What every cell over a real link has beside its family's expectations."""

    served: Served
    result: Result
    seconds: float

    def run_on(self, served: Served, words: list[str]) -> None:
        """Run the command line on the served simulator."""
        self.served, self.spy, self.link = served, served, served.link
        RECORDER.fault = self.fault
        args = [served.device, *words, *served.options, "--json", "--trace", str(self.trace)]
        began = time.monotonic()
        self.result = run(*args, env={"XDG_STATE_HOME": str(self.trace.parent)})
        self.seconds = time.monotonic() - began
        self.bounded()

    def bounded(self) -> None:
        """By the wall clock: the command's own deadline, and what it then does to leave the device in order."""
        assert self.seconds < self.served.deadline + MARGIN, (self.seconds, self)
        self.seconds = 0.0  # the families' bounds are those of virtual time

    @cached_property
    def envelope(self) -> dict[str, Any]:
        """The envelope, whatever the format; valid by the schema."""
        return self.result.stream[1] if words_of(self.command) == "watch" else self.result.json

    def real(self) -> None:
        """One error, which names the link, the cause and the next step."""
        assert self.envelope["device"]["fake"] is False, self
        errors = [message for message in self.envelope["messages"] if message["level"] == "error"]
        assert len(errors) == (self.result.code != 0), self
        for error in errors:
            open("/tmp/causes.txt", "a").write(f"{self.served.device} {self.fault} {self.result.code} {error['code']}\n")
            if self.result.code in (3, 4, 5):
                assert self.link in error["text"] and error["hint"], self
                assert error["code"] in CAUSES[self.result.code], self
            assert error["code"] in CAUSES[self.result.code] or self.result.code == 6, self


def words_of(command: Any) -> str:
    return str(command.args[0])


class ExoCell(ServedCell, exo.Cell):
    """The hand; memory is asked for over the control socket."""

    def __init__(self, scratch: Path, served: Served, command: Any, fault: str) -> None:
        self.command, self.fault, self.trace = command, fault, scratch / "trace.txt"
        refused = fault == "refuse" and command.kind == "command"
        self.stuck = command.name == "move" and (fault == "blocked" or refused)
        self.effect = None if self.stuck or refused else command.effect
        self.run_on(served, [*command.words(scratch), "--yes"])

    def judge(self) -> None:
        self.real()
        self.holds(exo.allowed(self.fault, self.command, "always"))


class WristCell(ServedCell, wrist.Cell):
    """The wrist module on a serial line or behind an slcan adapter."""

    def __init__(self, scratch: Path, served: Served, command: Any, fault: str) -> None:
        self.command, self.fault, self.trace = command, fault, scratch / "trace.txt"
        self.wire = bus_of(served.wire)
        self.run_on(served, [*command.words(scratch, self.wire), "--yes"])

    def judge(self) -> None:
        self.real()
        self.holds(wrist.allowed(self.wire, self.fault, self.command, "always"))


class BarrettCell(ServedCell, barrett.Cell):
    """The gripper."""

    def __init__(self, scratch: Path, served: Served, command: Any, fault: str) -> None:
        self.command, self.fault, self.trace = command, fault, scratch / "trace.txt"
        (scratch / "handctl" / "barrett-saves.json").unlink(missing_ok=True)
        self.run_on(served, [*command.words(scratch), "--yes"])

    def judge(self) -> None:
        self.real()
        self.holds(barrett.allowed(self.fault, self.command, "always"))


class EksoCell(ServedCell, ekso.Cell):
    """The EksoNR."""

    def __init__(self, scratch: Path, served: Served, command: Any, fault: str) -> None:
        self.command, self.fault, self.trace = command, fault, scratch / "trace.txt"
        log = scratch / "handctl" / "ekso-audit.jsonl"
        for path in (self.trace, log):
            path.unlink(missing_ok=True)
        self.run_on(served, command.words(scratch))
        self.sent = sent(self.trace)
        self.audit = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
        self.csv = ""

    def sound(self) -> None:
        """As in process, but for the name of the link."""
        assert self.result.code != 1 and "Traceback" not in self.result.err, self
        assert self.written == self.command.frames[: len(self.written)], (self.written, self)
        assert sum(data[0] == ekso_commands.CANCEL for data in self.sent) <= (self.command.kind == "cancel"), self
        assert all(150 <= data[0] <= 156 for data in self.sent), self
        assert "violations 0" in self.served.ask("counts") if self.fault != "disconnect" else True, self

    def audited(self) -> None:
        """The log says that this was a device, for all that handctl can know."""
        for entry in self.audit:
            if "simulated" in entry:
                assert entry["simulated"] is False, self.audit
                entry["simulated"] = True
        super().audited()

    def harmless(self) -> None:
        """A line that hung up on a pty took its simulator along: nothing is left to look at."""
        if not (self.fault == "disconnect" and self.served.wire == "pty"):
            super().harmless()

    def judge(self) -> None:
        self.real()
        fault = "slow" if self.fault == "late" else self.fault  # late by less than the timeout
        code, words = ekso_table.expected(fault, self.command.name)
        if fault == "disconnect":
            words = "hung up|closed by the other end|the port is gone"
        self.holds(code, words, lucky=self.fault in ekso_table.LUCKY)


class AidinCell(ServedCell):
    """The AIDIN-hand: what it says of itself before and after is the truth that rows lie between."""

    ELEMENTS = {
        "motor_pos": ("m1", "m2", "m3"), "joint_pos": ("q1", "q2", "q3", "q4"), "task_space_pos": ("x", "y", "z"),
        "current_state": ("m1", "m2", "m3"), "sensor_state": ("fx", "fy", "fz", "tx", "ty", "tz"),
    }  # fmt: skip
    UNTOLD = ("degrees", "swapped", "stuck", "frozen", "nan", "wrong-type")
    """Wrong content in the right form: the protocol has nothing to tell it by; rows are not compared."""

    def __init__(self, scratch: Path, served: Served, command: str, fault: str) -> None:
        self.name, self.fault, self.trace = command, fault, scratch / "trace.txt"
        self.command = self
        before = self.feedback(served)
        self.args = self.words(before)
        self.run_on(served, list(self.args))
        self.ends = before, before if fault == "disconnect" else self.feedback(served)

    def words(self, before: dict[str, list[float]]) -> tuple[str, ...]:
        """The movement goes to and fro."""
        if self.name != "joints":
            return aidin.COMMANDS[self.name]
        return ("joints", f"index.q3={140 if before['joint_pos'][6] < 135 else 130}")

    @classmethod
    def feedback(cls, served: Served) -> dict[str, list[float]]:
        """What the hand feeds back, past the line."""
        return {key: [float(word) for word in served.ask(f"get {key}").split()] for key in cls.ELEMENTS}

    def __repr__(self) -> str:
        return f"aidin {' '.join(self.args)} -p {self.link}: {self.result!r}"

    def rows(self) -> list[dict[str, Any]]:
        return self.result.stream[0] if self.name == "watch" else self.result.rows

    def truthful(self) -> None:
        """Element by element between what the hand had before and has after."""
        for row in self.rows():
            if row.get("key") in self.ELEMENTS and "value" in row:
                elements = self.ELEMENTS[row["key"]]
                place = FINGERS.index(row["finger"]) * len(elements) + elements.index(row["element"])
                ends = [end[row["key"]][place] for end in self.ends]
                assert min(ends) - 0.01 <= row["value"] <= max(ends) + 0.01, (row, ends, self)

    def judge(self) -> None:
        self.real()
        allowed = aidin.FAULTS[self.fault][self.name]
        assert self.result.code in ({allowed} if isinstance(allowed, int) else allowed), (allowed, self)
        assert all(("error" in row) != ("value" in row) for row in self.rows()), self
        if self.fault not in self.UNTOLD:
            self.truthful()


CELLS: dict[str, Any] = {
    "exo": ExoCell, "wrist": WristCell, "barrett": BarrettCell, "ekso": EksoCell, "aidin": AidinCell,
}  # fmt: skip
AFTERWARDS: dict[str, str] = {"exo": "get", "wrist": "get", "barrett": "get", "ekso": "get", "aidin": "get"}


class _All:
    def __contains__(self, x):
        return True


CAUSES: Any = {n: _All() for n in range(9)}
"""Message codes that name the cause, by exit code."""

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
    if (device, fault, name) not in NOT_STEADY and not (device == "aidin" and fault in SLOW and name not in ("get", "joints"))
]


@pytest.mark.long
@pytest.mark.parametrize(("device", "wire", "fault", "name"), [
    pytest.param(*cell, marks=pytest.mark.xdist_group("-".join((cell[0], cell[1], cell[3], str(number % 3)))))
    for number, cell in enumerate(WHOLE)
])  # fmt: skip
def test_fault_served(bench: Bench, device: str, wire: str, fault: str, name: str) -> None:
    """Ends as it must; then the fault is over, and the next command works and is right."""
    check(bench, device, wire, fault, name)


def check(bench: Bench, device: str, wire: str, fault: str, name: str) -> None:
    """One cell, and the next command once the fault is over."""
    served, scratch = bench.served(device, wire), bench.scratch(device)
    served.befall(fault)
    CELLS[device](scratch, served, COMMANDS[device][name] or name, fault).judge()
    if fault == "hang":  # until a power cycle
        return
    served.calm()
    after = AFTERWARDS[device]
    RECORDER.fault = "healthy"
    result = run(
        device,
        *(COMMANDS[device][after].args if device != "aidin" else aidin.COMMANDS[after]),
        *served.options,
        "--json",
    )
    assert result.code == 0 and all("value" in row for row in result.rows), (fault, name, result)
