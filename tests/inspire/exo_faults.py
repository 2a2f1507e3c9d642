"""Every fault of the simulator times every exo command: the exit codes, and one cell with all it must show."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path

from tests.inspire.exo_commands import COMMANDS, WRITING, Command, Truth, power_on_truth
from tests.support.cli import Result, Spy, fake, run, spying, writes

RIGHT = {0}
LINE_FAULTS: dict[str, set[int]] = {
    # the reply is there, perhaps late, in pieces, twice or among other bytes
    "healthy": RIGHT, "noise": RIGHT, "garble": RIGHT, "dribble": RIGHT, "split": RIGHT, "duplicate": RIGHT,
    "stale": RIGHT, "late": RIGHT, "slow": RIGHT, "echo": RIGHT,
    # nothing comes
    "silent": {4}, "deaf": {4},
    # bytes come, none of them a valid answer
    "truncate": {5}, "bad-checksum": {5}, "wrong-id": {5}, "loopback": {5}, "twin-id": {5},
    "disconnect": {3},
    "refuse": RIGHT,
}  # fmt: skip
LINE_EXCEPTIONS: dict[tuple[str, str], set[int]] = {
    # every acknowledged write is refused; force and position commands have no acknowledgement (exo §2.2.1)
    **{("refuse", command.name): {6} for command in WRITING if command.kind in ("write", "raw")},
    # two hands with one id: replies that do not jitter overlap to perfect frames (dossier 4.14)
    **{("twin-id", command.name): RIGHT for command in COMMANDS if command.fixed_registers},
    ("twin-id", "raw-write"): RIGHT,
    # a scan may name the suspicion beside the hand, or find no valid answer
    ("twin-id", "scan"): {0, 5},
}
DEVICE_FAULTS: dict[str, dict[str, int]] = {
    "strict": {}, "block-silent": {}, "no-late-frames": {}, "blocked": {},
    "save-fails": {"save": 6, "baud-save": 6},
    "fresh": {"diff": 7},
    "foreign": {"status-check": 7, "diff": 7, "save": 7, "baud-save": 7, "factory-reset": 7},
    "baud-at-1002": {"baud-new": 7, "baud-save": 7},
    "unknown-bits": {"status-check": 7, "clear-errors": 7},
    **{name: {"status-check": 7} for name in (
        "faults", "hot", "locked-rotor", "over-temperature", "over-current", "motor-abnormal", "communication",
    )},
}  # fmt: skip
CHANGED: dict[str, Truth] = {
    "fresh": {f"position_set.{f}": -1 for f in ("little", "ring", "middle", "index", "thumb")},
    "foreign": {
        "system_voltage": 0, "position_set.little": 3000, "position_set.ring": 3001, "position_set.middle": 3002,
        "position_set.index": 3003, "position_set.thumb": 3004,
    },
    "faults": {
        "error.little": 1, "error.ring": 2, "error.middle": 4, "error.index": 6, "error.thumb": 24,
        "temperature.ring": 78, "temperature.index": 78,
    },
    "hot": {
        **{f"error.{f}": 2 for f in ("little", "ring", "middle", "index", "thumb")},
        "temperature.little": 71, "temperature.ring": 72, "temperature.middle": 73, "temperature.index": 74,
        "temperature.thumb": 75,
    },
    "locked-rotor": {"error.little": 1},
    "over-temperature": {"error.ring": 2, "temperature.ring": 78},
    "over-current": {"error.middle": 4},
    "motor-abnormal": {"error.thumb": 8},
    "communication": {"error.thumb": 16},
    "unknown-bits": {"error.index": 160},
}  # fmt: skip
STAY_PUT = {"position_actual.little": 110, "position_actual.ring": 220, "position_actual.middle": 330,
            "position_actual.index": 440, "position_actual.thumb": 550}  # fmt: skip
VIRTUAL_SECONDS, REAL_SECONDS = 90.0, 30.0


def truth_of(fault: str) -> Truth:
    return {**power_on_truth(), **CHANGED.get(fault, {})}


def allowed(fault: str, command: Command, variant: str) -> set[int]:
    """Exit codes by the contract. A fault that befalls only some requests may also pass unnoticed (0), or hit a write
    whose fate the read-back then tells (7)."""
    if fault in DEVICE_FAULTS:
        return {DEVICE_FAULTS[fault].get(command.name, 0)}
    codes = LINE_EXCEPTIONS.get((fault, command.name), LINE_FAULTS[fault])
    if variant == "always" or codes == RIGHT:
        return codes
    partly = codes | {0}
    if command.kind == "write" and fault not in ("refuse", "disconnect"):
        partly = partly | {7} | LINE_FAULTS[fault]
    if command.kind == "scan":
        partly = partly | {4}  # an id that answered once and then not again is not counted
    return partly


def shown(command: Command, fault: str, stuck: bool) -> Truth:
    """What the command reports; `stuck` = the fingers do not follow."""
    expected = command.shows(truth_of(fault))
    return {name: STAY_PUT.get(name, value) for name, value in expected.items()} if stuck else expected


class Cell:
    """One command line against one fault."""

    def __init__(self, tmp_path: Path, command: Command, fault: str, *more: str, **options: int) -> None:
        self.command, self.fault = command, fault
        # Behind the look at who is there the command is the second request: refused in every variant, and nothing says so.
        refused = fault == "refuse" and command.kind == "command"
        self.stuck = command.name in ("calibrate", "move") and (fault == "blocked" or refused)
        self.effect = None if self.stuck or refused else command.effect
        self.trace = tmp_path / "trace.txt"
        for name in ("backup.json", "new.json", "trace.txt"):
            (tmp_path / name).unlink(missing_ok=True)
        self.link = fake(fault=fault, **options)
        args = ["exo", *command.words(tmp_path), "-p", self.link, "--json", "--trace", str(self.trace), *more]
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
        return f"exo {' '.join(self.command.args)} -p '{self.link}': {self.result!r}"

    def rows(self) -> list[dict[str, object]]:
        """The rows, whatever the format; the output is valid by the schema."""
        if self.command.kind == "stream":
            return self.result.stream[0]
        return self.result.rows

    def sound(self) -> None:
        """No traceback, valid JSON, one line of error, bounded time, no write twice."""
        assert self.result.code != 1, self
        assert "Traceback" not in self.result.err, self
        self.rows()
        assert self.seconds < REAL_SECONDS, self
        assert self.spy.now < VIRTUAL_SECONDS, (self.spy.now, self)
        twice = {data.hex(" "): count for data, count in Counter(writes(self.trace)).items() if count > 1}
        assert not twice, (twice, self)

    def truthful(self) -> None:
        """No value that is not the hand's: before or after the command's own effect."""
        before, after = truth_of(self.fault), shown(self.command, self.fault, self.stuck)
        for row in self.rows():
            if self.command.kind == "scan":
                assert (row["id"], row["baud"], row["system_voltage"]) == (1, 115200, before["system_voltage"]), self
            elif row.get("value") is not None and isinstance(row.get("name"), str):
                name = f"{row['name']}.{row['finger']}" if row.get("finger") else str(row["name"])
                if name in ("save", "calibrate", "factory_reset") and self.command.name != "dump":
                    good = ("saved", "accepted", "completed", "not reported")
                    reset = self.command.name == "factory-reset" and row["value"] == "accepted"
                    if reset and self.result.code:  # the hand took it, and who answers behind it is not known
                        (step,) = [step for step in self.result.json["writes"] if step["state"] != "not-sent"]
                        assert (step["state"], self.result.code) == ("confirmed", 4), self
                        continue
                    assert (row["value"] in good) is (self.result.code == 0), self
                    continue
                assert row["value"] in {before[name], after.get(name, before[name])}, (name, self)

    def complete(self) -> None:
        """Success: everything the command shows is there and right, and the hand holds what was written."""
        expected = shown(self.command, self.fault, self.stuck)
        got: Truth = {}
        for row in self.rows():
            if isinstance(row.get("value"), int) and isinstance(row.get("name"), str):
                got[f"{row['name']}.{row['finger']}" if row.get("finger") else str(row["name"])] = int(
                    str(row["value"])
                )
        assert got == expected, (got, self)
        if self.effect is not None:
            address, data = self.effect
            assert self.spy.byte_at(address, len(data)) == data, self
        if self.command.flash is not None:
            device = self.spy.lines[-1].device
            assert (device.flash["id"], device.flash["speed_code"]) == self.command.flash, self

    def holds(self, codes: set[int]) -> None:
        """The whole expectation."""
        self.sound()
        self.truthful()
        assert self.result.code in codes, (sorted(codes), self)
        if self.result.code == 0 and self.command.name != "raw-read":
            self.complete()
