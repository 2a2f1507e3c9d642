"""Every fault of the simulator times every barrett command: the right value, or the right exit code.

Never a wrong value where the protocol can tell, a repeated write, a traceback or a hang. Runs the real `main()` against
the simulator in virtual time. GCL has no checksum: a flipped bit that leaves the echo, the number of lines and the
number of numbers intact cannot be noticed, so that under `erratic` no value is judged. The simulator's `bad-checksum`
flips bit 7, which no ASCII character has, and must be noticed.
"""

from __future__ import annotations

import time
from collections import Counter
from functools import cached_property
from pathlib import Path

import pytest

from tests.barrett.commands import (
    COMMANDS,
    MOTORS,
    MOVING,
    READING,
    SETTING,
    Command,
    Key,
    Truth,
    fake,
    key_of,
    power_on,
    prepare,
    ram,
    sent_lines,
    taken,
    written_lines,
)
from tests.support.cli import Result, Spy, run, spying

# -- what the contract allows ---------------------------------------------------------------------------------------

pytestmark = pytest.mark.faults

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
VARIANTS: dict[str, dict[str, int]] = {"always": {}, "after-2": {"after": 2}, "every-3": {"every": 3}}
ALIKE = ("status", "status-check", "get", "get-hand", "baud-show", "baud-save", "version", "set-all", "defaults", "diff",
         "step-open", "step-close", "home", "torque-open", "open", "move-default", "gcl-move", "gcl-save")  # fmt: skip
"""Commands that exchange what another one does: faults that befall only some requests are not tried again."""
HARMLESS = ("healthy", "garble", "dribble", "split", "slow", "wrong-id", "twin-id")
"""Faults that touch no byte of an answer: nothing else can come of them when they are rarer."""
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


# -- one cell ---------------------------------------------------------------------------------------------------------


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


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the input files of the commands, and the journal of saves."""
    path = tmp_path_factory.mktemp("faults")
    prepare(path)
    return path


FAULTS = [*LINE_FAULTS, *DEVICE_FAULTS, "hang", "erratic"]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """The cells of the matrix; the ordinary suite takes a share."""
    if metafunc.function is test_fault:
        cells = {f"{fault}-{command.name}": (fault, command) for fault in FAULTS for command in COMMANDS}
        names = taken(metafunc.config, list(cells), 4)
        metafunc.parametrize(("fault", "command"), [cells[name] for name in names], ids=names)


def test_fault(scratch: Path, fault: str, command: Command) -> None:
    """States of the device do not count requests: they are there always."""
    for variant, options in VARIANTS.items():
        if variant == "always" or (fault in LINE_FAULTS and fault not in HARMLESS and command.name not in ALIKE):
            Cell(scratch, command, fault, "--timeout", "1", **options).holds(allowed(fault, command, variant))


@pytest.mark.parametrize("fault", LINE_FAULTS)
def test_deadline_bounds_the_whole_command(scratch: Path, fault: str) -> None:
    """--deadline counts for everything a command does: the search for the speed, retries, the wait for a movement."""
    for name in ("dump", "status", "watch", "restore", "close", "baud", "reset", "gcl-read"):
        (command,) = [command for command in COMMANDS if command.name == name]
        cell = Cell(scratch, command, fault, "--deadline", "0.4", "--timeout", "1")
        cell.sound()
        assert cell.spy.now <= 0.4 + 1.6, (cell.spy.now, cell)  # and the ^C that stops what moves, to its prompt
        assert cell.result.code in allowed(fault, command, "after-2") | {4, 5, 7}, cell


@pytest.mark.parametrize("command", READING, ids=lambda command: command.name)
def test_reading_never_writes(scratch: Path, command: Command) -> None:
    cell = Cell(scratch, command, "healthy")
    assert cell.result.code == 0
    assert written_lines(cell.trace) == []
    assert sent_lines(cell.trace), cell


# -- what the message says --------------------------------------------------------------------------------------------

KINDS = [
    ("silent", "no-answer", 4), ("deaf", "no-answer", 4), ("loopback", "echo", 5), ("disconnect", "lost", 3),
    ("no-echo", "echo-differs", 5), ("bad-checksum", "", 5), ("truncate", "", 5),
]  # fmt: skip


@pytest.mark.parametrize(("fault", "code", "exit_code"), KINDS)
@pytest.mark.parametrize("args", [("get", "P"), ("dump",), ("close",), ("gcl", "VERS"), ("watch", "--count", "2")])
def test_error_names_the_kind(fault: str, code: str, exit_code: int, args: tuple[str, ...]) -> None:
    result = run("barrett", *args, "-p", fake(fault=fault, seed=SEED), "--json")
    assert result.code == exit_code
    envelope = result.stream[1] if args[0] == "watch" else result.json
    (message,) = [m for m in envelope["messages"] if m["level"] == "error"]
    assert code in (message["code"], "")
    assert message["hint"]
    assert "fake://barrett" in message["text"]
    for speed in ("600", "38400") if exit_code == 4 else ():
        assert speed in message["text"], message  # what was tried
    if exit_code == 4:
        assert "power" in message["hint"] and "cable" in message["hint"]
    if exit_code == 5:
        assert any(len(word) == 2 and set(word) <= set("0123456789ABCDEF") for word in message["text"].split()), message


def test_hints_name_commands_of_this_device() -> None:
    for fault in (*LINE_FAULTS, *DEVICE_FAULTS):
        for args in (("get", "P"), ("set", "DP=1"), ("close",), ("status", "--check")):
            for message in run("barrett", *args, "-p", fake(fault=fault, seed=SEED), "--json").json["messages"]:
                text = message["text"] + message["hint"]
                assert "exo" not in text and "wrist" not in text, (fault, args, message)


# -- single faults ----------------------------------------------------------------------------------------------------


def test_over_temperature_is_said_with_both_numbers() -> None:
    """§5.4.1: motor commands fail; TEMP and OTEMP can still be read and shown."""
    result = run("barrett", "status", "--json", "-p", fake(fault="over-temperature"))
    assert (result.code, result.error["code"]) == (6, "err-8192")
    values = {row["parameter"]: row.get("label") for row in result.rows if row["motor"] is None}
    assert (values["TEMP"], values["OTEMP"]) == ("70.2 °C", "60.0 °C")
    moved = run("barrett", "close", "--json", "-p", fake(fault="over-temperature"))
    assert (moved.code, moved.error["code"]) == (6, "err-8192")
    assert "Overtemperature fault tripped (8192)" in moved.error["text"]


def test_blocked_motors_are_told_one_by_one() -> None:
    """§5.5: M reports 16; C reports nothing, so that the end is told from the position."""
    for args, code in ((("move", "3000"), 6), (("close",), 0)):
        result = run("barrett", *args, "--motors", "12", "--json", "-p", fake(fault="blocked"))
        assert result.code == code, result
        assert [(row["motor"], row["value"], "short" in row["ended"]) for row in result.rows] == [
            ("F1", 0, True), ("F2", 0, True),
        ]  # fmt: skip


def test_a_strain_limit_ends_a_movement() -> None:
    state = run("barrett", "gcl", "2FSET HSG 200", "2M 3000", "2FGET SG", "--json", "-p", fake(fault="strain"))
    assert (state.code, state.rows[-1]["status"]) == (6, 16)


def test_unknown_status_bits_are_named_and_never_dropped() -> None:
    result = run("barrett", "status", "--check", "--json", "-p", fake(fault="unknown-codes"))
    labels = {row["motor"]: row["label"] for row in result.rows if row["parameter"] == "S"}
    assert labels["F3"] == "(not used) (8) + (not used) (512)"
    assert result.error["code"] == "unhealthy" and "(512)" in result.error["text"]


def test_a_movement_that_ends_in_silence_is_stopped(tmp_path: Path) -> None:
    """No prompt before the deadline: ^C goes out (dossier 1.3), and nothing is moved a second time."""
    moved = 0
    for after in range(2, 9):
        trace = tmp_path / f"{after}.txt"
        result = run("barrett", "close", "-p", fake(fault="silent", after=after), "--json", "--trace", trace)
        lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines()]
        sent = [bytes.fromhex("".join(words[2:])) for words in lines if len(words) > 1 and words[1] == ">"]
        assert sent.count(b"C\r") <= 1
        if b"C\r" in sent and result.code:
            moved += 1
            assert result.code in (4, 5)
            assert b"\x03" in b"".join(sent[sent.index(b"C\r") + 1 :]), sent
    assert moved


def test_a_save_that_cannot_be_counted_changes_nothing(tmp_path: Path) -> None:
    """Above OTEMP motor commands fail, FGET among them; BAUD and PSAVE are none. Half of it must not be done."""
    trace = tmp_path / "t.txt"
    args = ("barrett", "baud", "19200", "--save", "--yes", "--json", "--trace", trace)
    result = run(*args, "-p", fake(fault="over-temperature"), env={"XDG_STATE_HOME": str(tmp_path)})
    done = ["PSET BAUD 192", "PSAVE"] if result.code == 0 else []
    assert result.code in (0, 6) and written_lines(trace) == done, (written_lines(trace), result)


def test_stream_goes_on_over_single_failures() -> None:
    """A watch gives a row with `error` for a sample that failed, and carries on (retries off)."""
    link = fake(fault="silent", after=4, every=4)
    args = ("barrett", "watch", "TEMP", "--count", "9", "--rate", "0", "--retries", "0", "--json")
    rows, end = run(*args, "-p", link).stream
    failed = [number for number, row in enumerate(rows) if "error" in row]
    assert len(rows) == 9 and failed and end["stream"]["failed"] == len(failed)
    assert all(row["value"] == 412 for row in rows if "error" not in row)
    assert end["ok"] is True


@pytest.mark.parametrize("fault", ["stale", "echo", "slow", "split"])
def test_a_left_over_answer_is_never_taken_for_the_next_one(fault: str) -> None:
    """TEMP falls by itself after HI's heat: each sample is of its own moment, or an error."""
    args = ("barrett", "watch", "UPSECS", "--rate", "0.5", "--count", "6", "--json")
    rows = run(*args, "-p", fake(fault=fault, seed=SEED)).stream[0]
    values = [row["value"] for row in rows if "value" in row]
    assert values == sorted(set(values)), values
