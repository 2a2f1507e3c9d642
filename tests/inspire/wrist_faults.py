"""Every fault of the simulator times every wrist command: the exit codes, and one cell with all it must show."""

from __future__ import annotations

import time
from collections import Counter
from functools import cached_property
from pathlib import Path

from tests.inspire.wrist_commands import (
    READING,
    WIRES,
    WRITING,
    Command,
    Truth,
    link,
    memory_of,
    power_on_truth,
    written_frames,
)
from tests.support.cli import Result, Spy, run, spying

RIGHT = {0}
LINE_FAULTS: dict[str, dict[str, set[int]]] = {
    "serial": {
        # the reply is there, perhaps late, in pieces, twice or among other bytes
        "healthy": RIGHT, "noise": RIGHT, "garble": RIGHT, "dribble": RIGHT, "split": RIGHT, "duplicate": RIGHT,
        "stale": RIGHT, "late": RIGHT, "slow": RIGHT, "echo": RIGHT,
        # nothing comes
        "silent": {4}, "deaf": {4},
        # bytes come, none of them a valid answer
        "truncate": {5}, "bad-checksum": {5}, "wrong-id": {5}, "loopback": {5}, "twin-id": {5},
        "disconnect": {3},
        "refuse": RIGHT,
    },
    "can": {
        # the reply is there, perhaps late, twice, or among frames of others
        "healthy": RIGHT, "noise": RIGHT, "duplicate": RIGHT, "stale": RIGHT, "late": RIGHT, "slow": RIGHT,
        "echo": RIGHT,
        # no frame comes: lost, destroyed on the bus, or never acknowledged
        "silent": {4}, "deaf": {4}, "twin-id": {4}, "no-ack": {4},
        # frames come, none of them a valid answer
        "truncate": {5}, "wrong-id": {5}, "loopback": {5},
        # the link is gone: its adapter, or the controller of it
        "disconnect": {3}, "bus-off": {3},
        "refuse": RIGHT,
    },
}  # fmt: skip
EXCEPTIONS: dict[tuple[str, str, str], set[int]] = {
    # the serial acknowledgement tells a refusal; CAN's is empty (wrist §2.3.2), so that only the read-back tells it
    **{("serial", "refuse", command.name): {6} for command in WRITING},
    **{("can", "refuse", command.name): {7} for command in WRITING},
    ("can", "refuse", "raw-write"): RIGHT,  # shows the acknowledgement and reads nothing back
    # two devices with one id: replies that do not jitter overlap to perfect ones (dossier 4.14); before a write the
    # pitch is read, which jitters
    **{(wire, "twin-id", command.name): RIGHT for wire in WIRES for command in READING if command.steady},
    # on CAN the collision destroys the wrist's frames, while its hand's, which do not jitter, come whole: a hand alone
    **{("can", "twin-id", command.name): {6} for command in WRITING},
    # a scan may name the suspicion beside the wrist, or find no valid answer
    ("serial", "twin-id", "scan"): {0, 5},
    # undocumented bytes are asked for by number, or with an error byte: on CAN a read has two bytes (dossier 4.12)
    **{(wire, "block-silent", "read"): {4} for wire in WIRES},
    **{("can", "block-silent", name): {0, 4} for name in ("status", "status-check", "dump", "get")},
}
MOVES = {command.name: 7 for command in WRITING if command.kind == "move"}
UNHEALTHY = {"status-check": 7}
DEVICE_FAULTS: dict[str, dict[str, int]] = {
    "strict": {}, "block-silent": {}, "save-fails": {},
    "blocked": MOVES,
    "foreign": {**UNHEALTHY, "move-pitch": 7, "move": 7, "center": 7},
    # a hand without a wrist is read in its own space only; what is to be written meets the look at who is there
    "no-wrist": {
        **{command.name: 0 if command.kind == "hand" else 4 for command in READING},
        **{command.name: 6 for command in WRITING},
    },
    "unknown-bits": UNHEALTHY, "faults": UNHEALTHY, "hot": UNHEALTHY, "locked-rotor": UNHEALTHY,
    "over-temperature": UNHEALTHY, "over-current": UNHEALTHY, "motor-abnormal": UNHEALTHY, "communication": UNHEALTHY,
}  # fmt: skip
CHANGED: dict[str, Truth] = {
    "foreign": {"pitch_actual": 30.0, "yaw_actual": 30.01},
    "faults": {"error_1": 1, "error_2": 4},
    "hot": {"error_1": 2, "error_2": 2, "temperature_1": 71, "temperature_2": 72},
    "locked-rotor": {"error_1": 1},
    "over-temperature": {"error_2": 2, "temperature_2": 78},
    "over-current": {"error_1": 4},
    "motor-abnormal": {"error_2": 8},
    "communication": {"error_1": 16},
    "unknown-bits": {"error_2": 160},
}
VIRTUAL_SECONDS, REAL_SECONDS = 60.0, 30.0
SEED = 1


def truth_of(fault: str) -> Truth:
    return {**power_on_truth(), **CHANGED.get(fault, {})}


def allowed(wire: str, fault: str, command: Command, variant: str) -> set[int]:
    """Exit codes by the contract. A fault that befalls only some requests may also pass unnoticed (0), or hit a write
    whose fate the read-back then tells (7)."""
    if fault in DEVICE_FAULTS:
        return EXCEPTIONS.get((wire, fault, command.name), {DEVICE_FAULTS[fault].get(command.name, 0)})
    plain = LINE_FAULTS[wire][fault]
    codes = EXCEPTIONS.get((wire, fault, command.name), plain)
    if variant == "always" or codes == RIGHT:
        return codes
    partly = codes | {0}
    writing = command in WRITING and command.kind != "raw"
    if writing and fault not in ("refuse", "disconnect"):
        partly = partly | {7} | plain
    if command.kind == "scan":
        partly = partly | {4, 5}  # an id that answered once and then not again is not counted
    return partly


class Cell:
    """One command line against one fault on one wire."""

    def __init__(self, tmp_path: Path, wire: str, command: Command, fault: str, *more: str, **options: int) -> None:
        self.wire, self.command, self.fault = wire, command, fault
        self.trace = tmp_path / "trace.txt"
        for name in ("new.json", "trace.txt"):
            (tmp_path / name).unlink(missing_ok=True)
        self.link = link(wire, fault=fault, seed=SEED, **options)
        args = ["wrist", *command.words(tmp_path, wire), "-p", self.link, "--json", "--trace", str(self.trace), *more]
        if command.asks:
            args.append("--yes")
        if command.kind == "scan" and fault == "late":
            args += ["--reply-window", "1000"]
        began = time.monotonic()
        with spying() as spy:
            self.result: Result = run(*args)
        self.spy: Spy = spy
        self.seconds = time.monotonic() - began

    def __repr__(self) -> str:
        words = self.command.words(Path("…"), self.wire)
        return f"wrist {' '.join(words)} -p '{self.link}': {self.result!r}"

    @cached_property
    def rows(self) -> list[dict[str, object]]:
        """The rows, whatever the format; the output is valid by the schema."""
        return self.result.stream[0] if self.command.kind == "stream" else self.result.rows

    def sound(self) -> None:
        """No traceback, valid JSON, one line of error, bounded time, nothing written twice or unplanned."""
        assert self.result.code != 1, self
        assert "Traceback" not in self.result.err, self
        assert isinstance(self.rows, list)
        assert self.seconds < REAL_SECONDS, self
        assert self.spy.now < VIRTUAL_SECONDS, (self.spy.now, self)
        written = written_frames(self.trace)
        twice = {text: count for text, count in Counter(written).items() if count > 1}
        assert not twice, (twice, self)
        assert set(written) <= set(self.command.frames(self.wire)), (written, self)

    def truthful(self) -> None:
        """No value that is not the wrist's: before or after the command's own effect; moving axes between both."""
        before, after = truth_of(self.fault), self.command.shows(truth_of(self.fault))
        for row in self.rows:
            if self.command.kind == "scan":
                speed = 115200 if self.wire == "serial" else None
                pitch = round(before["pitch_actual"] * 100)
                assert (row["family"], row["id"], row["baud"], row["pitch_raw"]) == ("wrist", 1, speed, pitch), self
            elif self.command.name == "hand-read":
                assert row["raw"] == "32 02", self
            elif row.get("value") is not None and isinstance(row.get("name"), str):
                value, name = float(str(row["value"])), str(row["name"])
                ends = sorted((before[name], after.get(name, before[name])))
                if self.command.kind == "move":
                    assert ends[0] <= value <= ends[1], (name, self)
                else:
                    assert value in ends, (name, self)

    def complete(self) -> None:
        """Success: everything the command shows is there and right, and the wrist holds what was written."""
        expected = self.command.shows(truth_of(self.fault))
        got = {
            str(row["name"]): row["value"]
            for row in self.rows
            if isinstance(row.get("value"), int | float) and isinstance(row.get("name"), str)
        }
        assert got == expected, (got, self)
        if self.command.kind == "scan" or self.command.name in ("hand-read", "raw-read"):
            assert self.rows, self
        if self.command.effect is not None:
            address, data = self.command.effect
            assert memory_of(self.spy, self.command.space, address, len(data)) == data, self

    def holds(self, codes: set[int]) -> None:
        """The whole expectation."""
        self.sound()
        if not (self.fault == "twin-id" and self.wire == "serial" and self.command.kind == "move"):
            self.truthful()  # overlapping replies may form a perfect frame of neither device: no frame shows that
        assert self.result.code in codes, (sorted(codes), self)
        hidden = self.command.name == "raw-write" and self.wire == "can" and self.fault == "refuse"
        if self.result.code == 0 and not hidden and self.fault != "twin-id":
            self.complete()
