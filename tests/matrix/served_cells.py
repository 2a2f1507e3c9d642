"""One cell of the fault matrix over real links, by device: what it runs and what it must show.

Each is the family's cell of the matrix in virtual time (`tests.inspire.exo_faults` and its siblings) whose simulator is a
served one; added are the wall clock and the message codes that name the cause.
"""

from __future__ import annotations

import json
import time
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from tests.aidin import faults as aidin
from tests.aidin.support import FINGERS
from tests.barrett import faults as barrett
from tests.ekso import cell as ekso
from tests.ekso import commands
from tests.ekso import faults as ekso_table
from tests.inspire import exo_faults as exo
from tests.inspire import hand_faults as hand
from tests.inspire import wrist_faults as wrist
from tests.matrix.report import RECORDER
from tests.support.cli import Result, run, sent
from tests.support.served import Served

MARGIN = 0.7
"""Seconds beyond the deadline that a cell may take on a busy machine: what moves is stopped, what was written read."""


def bus_of(wire: str) -> str:
    """The wire as the wrist's tables name it."""
    return "can" if wire.startswith("slcan") else "serial"


class ServedCell:
    """What every cell over a real link has beside its family's expectations."""

    served: Served
    result: Result
    seconds: float
    late: float

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
        self.late = self.seconds - self.served.deadline - MARGIN
        self.seconds = 0.0  # the families' bounds are those of virtual time

    @cached_property
    def envelope(self) -> dict[str, Any]:
        """The envelope, whatever the format; valid by the schema."""
        return self.result.stream[1] if words_of(self.command) == "watch" else self.result.json

    def real(self) -> None:
        """In time. One error, which names the link, the cause and the next step."""
        assert self.late < 0, (self.late, self)
        assert self.envelope["device"]["fake"] is False, self
        errors = [message for message in self.envelope["messages"] if message["level"] == "error"]
        assert len(errors) == (self.result.code != 0), self
        for error in errors:
            if self.result.code in (3, 4, 5):
                assert self.link in error["text"] and error["hint"], self
            causes = causes_of(self.fault, self.served.device, self.served.wire)
            assert error["code"] in causes or self.result.code == 6, (error, self)


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
        codes = wrist.allowed(self.wire, self.fault, self.command, "always")
        if self.wire == "can" and self.fault == "twin-id" and codes == {6}:
            codes = {4}  # an adapter, unlike the bus in this process, reports that frames were destroyed
        self.holds(codes)


HAND_WIRES = {"pty": "eb90", "tcp": "eb90", "modbus-pty": "rtu", "modbus-tcp": "tcp", "slcan-tcp": "can"}


class HandCell(ServedCell, hand.Cell):
    """An RH56DFTP on each of its wires."""

    def __init__(self, scratch: Path, served: Served, command: Any, fault: str) -> None:
        self.command, self.fault, self.trace = command, fault, scratch / "trace.txt"
        self.wire = HAND_WIRES[served.wire]
        self.before = self.after = served.memory
        self.run_on(served, [*command.args, *hand.WORDS[self.wire], "--yes"])
        if fault != "disconnect":  # a pty that hung up took its simulator along
            self.after = served.memory

    def judge(self) -> None:
        self.real()
        self.holds(hand.allowed(self.wire, self.fault, self.command, "always"))


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
        assert sum(data[0] == commands.CANCEL for data in self.sent) <= (self.command.kind == "cancel"), self
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

    ELEMENTS: ClassVar = {
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
    "hand": HandCell,
}  # fmt: skip
AFTERWARDS: dict[str, str] = {
    "exo": "get",
    "wrist": "get",
    "barrett": "get",
    "ekso": "get",
    "aidin": "get",
    "hand": "get",
}


CAUSES: dict[str, set[str]] = {
    **{name: {"no-answer"} for name in ("silent", "no-wrist", "hang", "reboot", "block-silent")},
    "no-ack": {"no-ack"}, "bus-off": {"bus-off"},
    "deaf": {"no-answer"}, "deaf aidin": {"not-reached"},  # a stream goes on, and the hand does not move
    "disconnect": {"lost"}, "loopback": {"echo"}, "echo": {"echo-differs"}, "wrong-id": {"wrong-id"},
    "bad-checksum": {"bad-checksum"}, "bad-checksum aidin": {"bad-json"},
    "bad-checksum barrett": {"garbage"},  # GCL has no checksum, and no character with bit 7
    "truncate": {"cut-short", "garbage", "bad-checksum"}, "truncate aidin": {"bad-json"},
    "twin-id": {"bad-checksum"}, "twin-id can": {"no-answer", "bus-errors"},
    **{name: {"echo-differs"} for name in ("duplicate", "no-echo")},
    "duplicate barrett": {"echo-differs", "garbage"},  # the answer to the first question, twice, is none that fits
    "hang barrett": {"no-answer", "echo", "garbage"},  # it repeats what it hears, alone or behind what came before
    "noise": {"echo-differs", "garbage", "cut-short", "bad-line"},  # before, in or behind an answer, as chance has it
    "refuse": {"refused"}, "refuse can": {"read-back"}, "refuse aidin": {"not-reached"},
    **{name: {"not-reached"} for name in ("blocked", "foreign", "weak", "frozen", "swapped")},
    **{f"{name} wrist": {"not-arrived"} for name in ("blocked", "foreign")},
    **{f"{name} hand": {"not-fit"} for name in (
        "faults", "hot", "locked-rotor", "over-temperature", "over-current", "motor-abnormal", "communication", "unknown-bits")},
    "blocked hand": {"blocked"},
    # an answer of Modbus RTU ends with silence: a damaged one is not told from one that was cut off
    **{f"{name} modbus-pty": {"cut-short"} for name in ("bad-checksum", "twin-id")},
    "bad-checksum modbus-tcp": {"cut-short"},
    # EksoNR
    "acknowledge": {"acknowledged", "echo"}, "short-body": {"bad-length", "acknowledged", "bad-checksum"},
    "wrong-command": {"wrong-command"}, "not-taken": {"read-back"}, "neighbour": {"read-back"},
    "pendant": {"changed-meanwhile"},
    **{name: {"not-still"} for name in ("fidget", "unknown-state", "frozen-clock", "clock-jump")},
    # AIDIN-hand
    "missing-key": {"missing-key"}, "wrong-length": {"bad-length"}, "nan": {"not-finite"}, "wrong-type": {"bad-type"},
    "not-json": {"garbage"}, "braces": {"bad-json"}, "degrees": {"kept-out-of-range"},
    # BarrettHand: any word may be wrong
    "erratic": {"usage", "read-back", "echo-differs", "cut-short", "garbage", "bad-length"},
}  # fmt: skip
"""Message codes that name the cause, by fault, or by fault and device or bus where these say it otherwise; no word of it
where a code of the device says more (exit 6)."""


def causes_of(fault: str, device: str, wire: str) -> set[str]:
    """The codes that one cell may show; none for a fault that must pass unnoticed."""
    keys = (f"{fault} {wire}", f"{fault} {bus_of(wire)}", f"{fault} {device}", fault)
    return next((CAUSES[key] for key in keys if key in CAUSES), set())
