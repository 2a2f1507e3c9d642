"""Every fault of the simulated RH56 hand times commands on each wire: exit codes, and one cell with all it must show."""

from __future__ import annotations

import struct
import time
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from handctl.sim import create
from tests.support.cli import Result, Spy, run, spying

WIRES = ("eb90", "rtu", "tcp", "can")
OPTIONS = {"eb90": {}, "rtu": {}, "tcp": {"bus": "modbus-tcp"}, "can": {"bus": "can"}}
WORDS = {"eb90": ("--protocol", "eb90"), "rtu": ("--protocol", "modbus"), "tcp": (), "can": ()}
MODEL = "tp"
SEED = 1
ANGLES, STATUS = 1546, 1612


class Command(NamedTuple):
    """One command line; `effect` is what the hand holds behind it: address, bytes."""

    name: str
    kind: str
    args: tuple[str, ...]
    effect: tuple[int, bytes] | None = None


COMMANDS = (
    Command("status", "read", ("status",)),
    Command("status-check", "check", ("status", "--check")),
    Command("dump", "read", ("dump",)),
    Command("get", "read", ("get", "angle_actual", "error", "temperature.index")),
    Command("read", "read", ("read", "1546", "12")),
    Command("watch", "stream", ("watch", "angle_actual", "--count", "3", "--rate", "0")),
    Command("set", "write", ("set", "speed_set.index=300", "force_limit.little=200"), (1528, b"\x2c\x01")),
    Command("speed", "write", ("speed", "100", "-1", "-1", "300", "-1", "-1"), (1522, b"\x64\x00")),
    Command("angle", "move", ("angle", "-1", "-1", "-1", "300", "-1", "-1", "--wait", "5"), (1492, b"\x2c\x01")),
    Command("clear-errors", "write", ("clear-errors",)),
    Command("save", "write", ("save",)),
)
BY_NAME = {command.name: command for command in COMMANDS}
WRITES = frozenset(command.name for command in COMMANDS if command.kind in ("write", "move"))
LONGEST = {"read": 20.0, "check": 20.0, "stream": 30.0, "write": 40.0, "move": 60.0}
"""Virtual seconds that a command may take on the worst line."""

RIGHT = {0}
NOTHING = {4}
INVALID = {5}
SERIAL: dict[str, set[int]] = {
    "healthy": RIGHT, "noise": RIGHT, "garble": RIGHT, "dribble": RIGHT, "split": RIGHT, "duplicate": RIGHT, "stale": RIGHT,
    "late": RIGHT, "slow": RIGHT, "echo": RIGHT, "silent": NOTHING, "deaf": NOTHING, "truncate": INVALID,
    "bad-checksum": INVALID, "wrong-id": INVALID, "loopback": INVALID, "twin-id": INVALID, "disconnect": {3}, "refuse": RIGHT,
}  # fmt: skip
LINE_FAULTS: dict[str, dict[str, set[int]]] = {
    "eb90": SERIAL,
    "rtu": SERIAL,
    # no check sum and no id: a number that is wrong is warned of, junk hides where an answer begins
    "tcp": {**SERIAL, "wrong-id": RIGHT, "twin-id": RIGHT, "noise": INVALID},
    "can": {
        **dict.fromkeys(("healthy", "noise", "duplicate", "stale", "late", "slow", "echo", "refuse"), RIGHT),
        **dict.fromkeys(("silent", "deaf", "twin-id", "no-ack"), NOTHING),
        **dict.fromkeys(("truncate", "wrong-id", "loopback"), INVALID),
        **{name: {3} for name in ("disconnect", "bus-off")},
    },
}  # fmt: skip
UNTELLABLE = frozenset(
    {
        ("rtu", "high-half"),
        ("tcp", "high-half"),
        ("rtu", "stale"),
        ("tcp", "twin-id"),
        ("tcp", "twin-ip"),
        ("eb90", "twin-id"),
        ("rtu", "twin-id"),
    }
)
"""An RTU answer names no address, and answers that overlap may form a whole one: no frame shows that. Nor does a connection show
which of two hands with one IP address has taken it: `doctor` asks on two."""


class Cell:
    """One command line against one fault on one wire."""

    def __init__(
        self, tmp_path: Path, wire: str, command: Command, fault: str, *more: str, model: str = MODEL, **options: object
    ) -> None:
        self.wire, self.command, self.fault = wire, command, fault
        self.trace = tmp_path / "trace.txt"
        self.trace.unlink(missing_ok=True)
        raw = {
            "model": model,
            **OPTIONS[wire],
            "fault": fault,
            "seed": str(SEED),
            **{k: str(v) for k, v in options.items()},
        }
        self.link = "fake://hand?clock=virtual&" + "&".join(f"{name}={value}" for name, value in raw.items())
        self.before = memory_of(create("hand", {name: text for name, text in raw.items() if name != "seed"}))
        args = [
            "hand",
            *command.args,
            *WORDS[wire],
            "-p",
            self.link,
            "--json",
            "--yes",
            "--trace",
            str(self.trace),
            *more,
        ]
        began = time.monotonic()
        with spying() as spy:
            self.result: Result = run(*args)
        self.spy: Spy = spy
        self.seconds = time.monotonic() - began
        self.after = memory_of(spy.lines[-1]) if spy.lines else self.before

    def __repr__(self) -> str:
        return f"hand {' '.join(self.command.args)} -p '{self.link}': {self.result!r}"

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, whatever the format; the output is valid by the schema."""
        return self.result.stream[0] if self.command.kind == "stream" else self.result.rows

    def sound(self) -> None:
        """No bug of ours, a next step, an end in time."""
        assert self.result.code in (0, 3, 4, 5, 6, 7), self
        assert "Traceback" not in self.result.err, self
        if self.result.code and self.command.kind != "stream":
            assert self.result.error["hint"], self
        assert self.spy.now < LONGEST[self.command.kind] + 60.0, (self.spy.now, self)

    def truthful(self) -> None:
        """No value that is not the hand's, before or behind the command; on its way a finger is between both."""
        if (self.wire, self.fault) in UNTELLABLE:
            return
        for row in self.rows:
            if row.get("value") is None or not row.get("raw") or not isinstance(row.get("address"), int):
                continue
            place, data = row["address"], bytes.fromhex(row["raw"])
            held = [memory[place : place + len(data)] for memory in (self.before, self.after)]
            if data in held or row["name"] in ("status", "force_actual", "current"):
                continue
            assert self.command.kind == "move" and row["name"] in ("angle_actual", "stroke_actual"), (row, self)
            ends = sorted(struct.unpack("<h", one)[0] for one in held)
            assert ends[0] <= row["value"] <= ends[1], (row, ends, self)

    def complete(self) -> None:
        """Success: what the command is for is done."""
        assert self.rows, self
        if self.command.effect is not None:
            place, data = self.command.effect
            assert self.after[place : place + len(data)] == data, self

    def holds(self, codes: set[int]) -> None:
        """The whole expectation."""
        self.sound()
        self.truthful()
        assert self.result.code in codes, (sorted(codes), self)
        if self.result.code == 0:
            self.complete()


def memory_of(line: Any) -> bytes:
    """What the simulated hand holds, past its wire."""
    if line.device.now == 0.0:
        line.advance(0.0)
    line.device.hand.publish()
    return bytes(line.device.hand.space.memory)


WIDE = ("status", "status-check", "dump")
UNHEALTHY = {"status-check": {7}, "angle": {7}}
DEVICE_FAULTS: dict[str, dict[str, set[int]]] = {
    **{name: {} for name in ("strict", "fresh", "force-deaf", "stops-short", "tactile-dead", "tactile-saturated")},
    **dict.fromkeys(("faults", "hot", "locked-rotor", "over-temperature", "over-current", "motor-abnormal", "communication"), UNHEALTHY),
    "unknown-bits": {**UNHEALTHY, "clear-errors": {7}},
    "blocked": {"angle": {7}},
    "foreign": {"status-check": {7}, **{name: {6} for name in WRITES}},
    "block-silent": {},
    "save-fails": {},
}  # fmt: skip
OF_WIRE: dict[str, dict[str, dict[str, set[int]]]] = {
    "eb90": {"save-fails": {"save": {6}}, "rtu-unpacked": {}, "no-late-frames": {}},
    # a register is two bytes, of which the second may be undocumented: what cannot be read says so beside the rest
    "rtu": {
        "block-silent": {name: {6} for name in WIDE},
        "high-half": {}, "rtu-unpacked": {}, "no-late-frames": {},
    },
    "tcp": {
        "block-silent": {name: {6} for name in WIDE},
        "high-half": {}, "txid-off": {}, "twin-ip": {}, "two-clients-drop": {},
    },
    "can": {"block-silent": {name: {4} for name in WIDE}},
}  # fmt: skip
EXCEPTIONS: dict[tuple[str, str, str], set[int]] = {
    **{(wire, "refuse", name): {6} for wire in WIRES for name in WRITES},
    # on CAN a collision destroys frames: what a look does not see is not written to
    **{("can", "twin-id", name): {4, 6} for name in WRITES},
    # an answer to the question before fits on this wire: the look at who is there may not be certain then
    **{("rtu", "stale", name): {0, 6} for name in WRITES},
}


def device_faults(wire: str) -> dict[str, dict[str, set[int]]]:
    """State of the device -> command -> exit codes, 0 where it is not named."""
    return {**DEVICE_FAULTS, **OF_WIRE[wire]}


def allowed(wire: str, fault: str, command: Command, variant: str) -> set[int]:
    """Exit codes by the contract. A fault that befalls only some requests may also pass unnoticed (0), hit a write whose
    fate the read-back tells (7), or the look at who is there, which then is not certain (6)."""
    if fault not in LINE_FAULTS[wire]:
        return device_faults(wire)[fault].get(command.name, RIGHT)
    plain = LINE_FAULTS[wire][fault]
    codes = EXCEPTIONS.get((wire, fault, command.name), plain)
    if (wire, fault, command.name) == ("rtu", "echo", "save") and variant != "always":
        return {0, 5}  # the answer to function 06 is its question again: an echo that comes and goes cannot be known
    if variant == "always" or codes == RIGHT:
        return codes
    partly = codes | {0} | plain
    if command.name in WRITES and fault not in ("refuse", "disconnect"):
        partly = partly | {6, 7}
    return partly
