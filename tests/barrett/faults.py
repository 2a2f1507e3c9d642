"""Every fault of the simulator times every barrett command: the exit codes, and one cell with all it must show."""

from __future__ import annotations

import time
from collections import Counter
from functools import cached_property
from pathlib import Path

from tests.barrett.commands import (
    COMMANDS,
    MOTORS,
    MOVING,
    SETTING,
    Command,
    Key,
    Truth,
    fake,
    key_of,
    power_on,
    ram,
    written_lines,
)
from tests.support.cli import Result, Spy, run, spying

RIGHT = {0}
LINE_FAULTS: dict[str, set[int]] = {
    # the answer is there, perhaps late, in pieces or behind an older one; nothing of the same form can be meant
    "healthy": RIGHT, "garble": RIGHT, "dribble": RIGHT, "split": RIGHT, "stale": RIGHT, "late": RIGHT, "slow": RIGHT,
    "wrong-id": RIGHT, "twin-id": RIGHT,  # GCL has no ids
    # nothing comes
    "silent": {4}, "deaf": {4},
    # bytes come, none of them a valid answer
    "bad-checksum": {5}, "loopback": {5},
    "truncate": {0, 5},  # an answer that lost no more than the space of its prompt is whole; by luck at the third time
    "disconnect": {3},
    "refuse": RIGHT,
    # Junk bytes, every character twice: the echo differs (5), or is there all the same. Bytes that a line sends back
    # before the hand does look like its echo, and the hand's own echo like an answer.
    "noise": {0, 5}, "duplicate": {0, 5}, "echo": {0, 5},
}  # fmt: skip
REFUSED = {command.name: {6} for command in SETTING if command.name not in ("reset", "baud", "baud-save")}
EXCEPTIONS: dict[tuple[str, str], set[int]] = {
    **{("refuse", name): codes for name, codes in REFUSED.items()},
    # PSET BAUD answers after the switch-over: what became of it is told by the speed and the read-back
    **{("refuse", name): {3, 6, 7} for name in ("baud", "baud-save")},
    ("no-echo", "gcl-save"): {4, 5},  # nothing at all comes within the second that an echo may take (dossier 1.3)
    ("over-temperature", "baud-save"): {0, 6},  # to keep the count of saves the motors' settings are read
}
STALLS = dict.fromkeys(("move", "move-default", "step-close", "gcl-move"), 6)
"""M, HOME, IC and IO report 16 when they do not arrive (§5.5); O, C, TC and TO never do."""
MOTOR_MOVES = [command.name for command in MOVING if command.name != "stop"]
TOO_HOT = [command.name for command in COMMANDS if command.name not in (
    "get-hand", "version", "help", "baud-show", "set-hand", "baud", "baud-save", "reset")]  # fmt: skip
"""Whatever begins with a motor command; FGET and FSET are motor commands too (§5.4.1, sim notes)."""
DEVICE_FAULTS: dict[str, dict[str, int]] = {
    "no-echo": {command.name: 5 for command in COMMANDS if command.name != "reset"},  # its banner is proof enough
    "no-abort": {}, "strain": {}, "strain-offset": {}, "no-gauges": {}, "breakaway": {}, "eeprom-worn": {},
    "blocked": STALLS,
    "obstacle": {},
    "hot": {"status-check": 7},
    "over-temperature": {**dict.fromkeys(TOO_HOT, 6)},
    "not-homed": {**{name: 6 for name in MOTOR_MOVES if name != "init"}},
    "no-board": {"status-check": 7, **{name: 6 for name in MOTOR_MOVES
                 if name not in ("home", "torque-open", "gcl-move")}},
    "no-motor": {"status-check": 7, **{name: 6 for name in MOTOR_MOVES
                 if name not in ("home", "torque-open", "gcl-move", "move")}},
    "reversed": STALLS,
    "unknown-codes": {"status-check": 7},
}  # fmt: skip
HANG = {4, 5}
"""The echo came and then nothing ever again."""
ERRATIC = {0, 2, 5, 6, 7}
"""Commands that are unknown now and then; values with a wrong bit, some of them out of any range."""


def on_each(mnemonic: str, *values: int) -> Truth:
    return {(mnemonic, motor): value for motor, value in zip(MOTORS, values, strict=True)}


CHANGED: dict[str, Truth] = {
    "strain": {("SG", "F2"): 221},
    "strain-offset": {("SG", "F3"): 188},
    "no-gauges": on_each("SG", 255, 255, 255, 255),
    "hot": {("TEMP", None): 702, ("PTEMP", None): 702},
    "over-temperature": {("TEMP", None): 702, ("PTEMP", None): 702, ("OTEMP", None): 600},
    "not-homed": on_each("S", 4, 4, 4, 4),
    "no-board": {("S", "F2"): 1},
    "no-motor": {("S", "F3"): 2},
    "unknown-codes": {("S", "F3"): 520},
}
STOPS: dict[str, dict[str, dict[str, int]]] = {
    "blocked": {name: dict.fromkeys(MOTORS, 0) for name in MOTOR_MOVES},
    "obstacle": {"close": {"F1": 9200, "F2": 9350, "F3": 9500},
                 "torque-close": {"F1": 9200, "F2": 9350, "F3": 9500}},
}  # fmt: skip
"""Where movements end at a fault instead: where they press into the obstacle (350 counts at most), and not at all."""
NOT_JUDGED = ("breakaway", "reversed", "no-board", "no-motor", "not-homed")
"""What P counts after a movement is not the manual's to say: of a motor that slips, is missing or turns wrongly."""
VIRTUAL_SECONDS, REAL_SECONDS = 150.0, 30.0
SEED = 1


def allowed(fault: str, command: Command, variant: str) -> set[int]:
    """Exit codes by the contract. A fault that befalls only some requests may also pass unnoticed (0), or hit a write
    whose fate the read-back then tells (7); a repeated silence may be told as bytes that make no answer."""
    if fault == "hang":
        return HANG
    if fault == "erratic":
        return ERRATIC
    if fault in DEVICE_FAULTS:
        return EXCEPTIONS.get((fault, command.name), {DEVICE_FAULTS[fault].get(command.name, 0)})
    plain = LINE_FAULTS[fault]
    codes = EXCEPTIONS.get((fault, command.name), plain)
    if variant == "always" or codes == RIGHT:
        return codes
    partly = codes | {0}
    if fault in ("silent", "deaf", "truncate", "bad-checksum"):
        # which of a command's exchanges is hit decides: its echo, its prompt, or one after which it finds the hand again
        partly |= {4, 5}
    if command.kind in ("write", "baud", "move"):
        partly |= {7}
    return partly


class Cell:
    """One command line against one fault."""

    def __init__(self, tmp_path: Path, command: Command, fault: str, *more: str, **options: object) -> None:
        self.command, self.fault = command, fault
        self.trace = tmp_path / "trace.txt"
        for name in ("new.json", "trace.txt", "handctl/barrett-saves.json"):
            (tmp_path / name).unlink(missing_ok=True)
        self.link = fake(fault=fault, seed=SEED, **options)
        args = ["barrett", *command.words(tmp_path), "-p", self.link, "--json", "--trace", str(self.trace), *more]
        if command.asks:
            args.append("--yes")
        began = time.monotonic()
        with spying() as spy:
            self.result: Result = run(*args, env={"XDG_STATE_HOME": str(tmp_path)})
        self.spy: Spy = spy
        self.seconds = time.monotonic() - began

    def __repr__(self) -> str:
        return f"barrett {' '.join(self.command.words(Path('…')))} -p '{self.link}': {self.result!r}"

    @cached_property
    def rows(self) -> list[dict[str, object]]:
        """The rows, whatever the format; the output is valid by the schema."""
        return self.result.stream[0] if self.command.kind == "stream" else self.result.rows

    @cached_property
    def envelope(self) -> dict[str, object]:
        """The envelope, whatever the format."""
        return self.result.stream[1] if self.command.kind == "stream" else self.result.json

    @property
    def truth(self) -> Truth:
        """What the hand reads before the command."""
        return {**power_on(), **CHANGED.get(self.fault, {})}

    def sound(self) -> None:
        """No traceback, valid JSON, one line of error, bounded time, nothing written twice or unplanned."""
        assert self.result.code != 1, self
        assert "Traceback" not in self.result.err, self
        messages = [message for message in self.envelope["messages"] if message["level"] == "error"]  # type: ignore[attr-defined]
        assert len(messages) == (0 if self.result.code == 0 else 1), self
        assert self.seconds < REAL_SECONDS, self
        assert self.spy.now < VIRTUAL_SECONDS, (self.spy.now, self)
        written = written_lines(self.trace)
        if self.command.kind == "stop":
            # T takes power away, however often it comes: unanswered it goes out again, once a speed and once more at the
            # first one. Contract 7 forbids to repeat a write blindly, and what was acknowledged is not repeated.
            off = [line for line in written if line.strip("~\x7f")]
            answered = LINE_FAULTS.get(self.fault) == RIGHT
            assert len(off) <= (1 if answered else 8), (off, self)
            written = off[:1] if set(off) == set(self.command.lines) else off
        twice = {text: count for text, count in Counter(written).items() if count > 1}
        assert not twice, (twice, self)
        assert written == list(self.command.lines[: len(written)]) or self.fault == "erratic", (written, self)

    def truthful(self) -> None:
        """No value that is not the hand's: before or after the command's own effect, or where the fault stops it."""
        if self.fault == "erratic":
            return
        before, after = self.truth, self.command.shows(self.truth)
        for row in self.rows:
            key = key_of(row)
            if key is None or row.get("value") is None:
                continue
            if key[0] == "P" and self.command.kind == "move":
                ends = sorted((before[key], after.get(key, before[key])))
                if self.fault not in NOT_JUDGED:
                    assert ends[0] <= int(str(row["value"])) <= ends[1], (key, self)
            elif key[0] == "UPSECS":
                assert before[key] <= int(str(row["value"])) <= before[key] + VIRTUAL_SECONDS, self
            else:
                assert row["value"] in (before[key], after.get(key)), (key, self)

    def stop(self, key: Key) -> int:
        """Where a motor ends under this fault."""
        place = STOPS.get(self.fault, {}).get(self.command.name, {}).get(str(key[1]))
        return self.command.shows(self.truth).get(key, 0) if place is None else place

    def complete(self) -> None:
        """Success: everything the command shows is there and right, and the hand holds what was written."""
        got = {key: row.get("value") for row in self.rows if (key := key_of(row)) is not None}
        expected = self.command.shows(self.truth)
        assert set(got) == set(expected), (set(got) ^ set(expected), self)
        with_value = {key_of(row) for row in self.rows if "value" in row}
        if self.command.kind == "stream":  # goes on over single failures
            assert set(expected) <= with_value, self
        else:
            assert all("value" in row for row in self.rows if key_of(row)), self
        if self.command.kind == "move" and self.fault not in NOT_JUDGED:
            for key, place in got.items():
                assert abs(int(str(place)) - self.stop(key)) <= (350 if self.fault == "obstacle" else 0), (key, self)
        assert written_lines(self.trace) == list(self.command.lines), self
        for mnemonic, values in self.command.ram:
            assert ram(self.spy, mnemonic) == values, (mnemonic, self)

    def holds(self, codes: set[int]) -> None:
        """The whole expectation."""
        self.sound()
        self.truthful()
        assert self.result.code in codes, (sorted(codes), self)
        if self.result.code == 0 and self.fault != "erratic":
            self.complete()


FAULTS = [*LINE_FAULTS, *DEVICE_FAULTS, "hang", "erratic"]
