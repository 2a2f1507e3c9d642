"""Every fault of the simulator times every exo command: the right value or the right exit code, within bounds.

Never a wrong value, a repeated write, a traceback or a hang. Runs the real `main()` against the simulator in virtual
time. `LINE_FAULTS` and `DEVICE_FAULTS` are the contract's table (exit codes by fault); what a command may show is in
`cli_commands`.

By default every fault meets every command while it is there always. What else can only come out otherwise by its order
in time is tried pairwise: faults that befall only some requests (line faults that harm, or that leave something behind
for the next request; a state of the device does not count requests), the default timeout, and the deadline. Each fault
and each command then comes up in each of these, in turns. With HANDCTL_SEEDS=N the whole product runs, N seeds a cell.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import pytest

from tests.inspire.exo_commands import COMMANDS, READING, WRITING, Command, Truth, power_on_truth, prepare
from tests.support.cli import Result, Spy, check_schema, fake, run, sent, spying, writes

# -- what the contract allows ---------------------------------------------------------------------------------------

pytestmark = pytest.mark.faults

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
VARIANTS: dict[str, dict[str, int]] = {"always": {}, "after-1": {"after": 1}, "every-2": {"every": 2}}
VIRTUAL_SECONDS, REAL_SECONDS = 90.0, 30.0

SEEDS = range(int(os.environ.get("HANDCTL_SEEDS", "1")))
"""Seeds of the simulator per cell; more of them belong into a long run."""
WHOLE = "HANDCTL_SEEDS" in os.environ
ORDER_MATTERS = (*(name for name, codes in LINE_FAULTS.items() if codes != RIGHT), "stale", "late", "refuse")
FAULTS = (*LINE_FAULTS, *DEVICE_FAULTS)


def tried(fault: str, command: Command, turn: int, turns: int) -> bool:
    """Whether it is the turn of this pair: of `turns` that follow each other for a fault, and for a command, one is."""
    return WHOLE or (FAULTS.index(fault) + COMMANDS.index(command)) % turns == turn


def pairs_of(turn: int, turns: int) -> list[object]:
    """Line faults and commands whose turn it is."""
    return [
        pytest.param(fault, command, id=f"{fault}-{command.name}")
        for fault in LINE_FAULTS
        for command in COMMANDS
        if tried(fault, command, turn, turns)
    ]


def cells() -> list[object]:
    """Fault, command, variant: "always" for all, the others by turns where the order matters."""
    rarer = [variant for variant in VARIANTS if variant != "always"]
    return [
        pytest.param(fault, command, variant, id=f"{fault}-{command.name}-{variant}")
        for fault in FAULTS
        for command in COMMANDS
        for variant in VARIANTS
        if variant == "always"
        or WHOLE
        or (fault in ORDER_MATTERS and tried(fault, command, rarer.index(variant), len(rarer)))
    ]


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


# -- one cell ---------------------------------------------------------------------------------------------------------


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


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the input files of the commands."""
    path = tmp_path_factory.mktemp("faults")
    prepare(path)
    return path


@pytest.mark.parametrize(("fault", "command", "variant"), cells())
def test_fault(scratch: Path, fault: str, command: Command, variant: str) -> None:
    for seed in SEEDS:
        cell = Cell(scratch, command, fault, "--timeout", "1", seed=seed, **VARIANTS[variant])
        cell.holds(allowed(fault, command, variant))


@pytest.mark.parametrize(("fault", "command"), pairs_of(0, 3))
def test_fault_with_default_timeout(scratch: Path, fault: str, command: Command) -> None:
    """Without --timeout a reply that is 0.6 s late may count as silence, and never as anything else."""
    cell = Cell(scratch, command, fault)
    codes = allowed(fault, command, "always")
    cell.holds(codes | {4} if fault == "late" else codes)


@pytest.mark.parametrize(("fault", "command"), pairs_of(1, 3))
def test_deadline_bounds_the_whole_command(scratch: Path, fault: str, command: Command) -> None:
    """--deadline counts for everything the command does: retries, fallbacks, probes at other speeds, waits."""
    cell = Cell(scratch, command, fault, "--deadline", "0.25", "--timeout", "1")
    cell.sound()
    cell.truthful()
    assert cell.spy.now <= 0.26, (cell.spy.now, cell)
    codes = allowed(fault, command, "after-1")
    assert cell.result.code in codes | {4, 5, 7}, cell


def test_deadline_that_ends_a_wait_is_named() -> None:
    """Not waited for is not the same as not reported by the hand."""
    result = run("exo", "save", "-y", "--deadline", "0.25", "-p", fake(), "--json")
    assert result.code == 4, result
    assert "deadline" in result.error["text"] + result.error["hint"], result
    result = run("exo", "calibrate", "-y", "--deadline", "0.25", "-p", fake(), "--json")
    assert result.code == 4, result
    assert "30 s" not in str(result.json["messages"]), result


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_two_faults_at_once(scratch: Path, command: Command) -> None:
    """An echo, junk around every reply, and pieces: what a bad adapter really does."""
    for seed in range(6):
        Cell(scratch, command, "echo,noise,split", "--timeout", "1", seed=seed).holds(RIGHT)


@pytest.mark.parametrize("command", READING, ids=lambda command: command.name)
def test_reading_never_writes(scratch: Path, command: Command) -> None:
    cell = Cell(scratch, command, "healthy")
    assert cell.result.code == 0
    assert writes(cell.trace) == []
    assert sent(cell.trace), cell


# -- what the message says --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "code", "exit_code"),
    [
        ("silent", "no-answer", 4),
        ("deaf", "no-answer", 4),
        ("bad-checksum", "bad-checksum", 5),
        ("wrong-id", "wrong-id", 5),
        ("loopback", "echo", 5),
        ("disconnect", "lost", 3),
    ],
)
@pytest.mark.parametrize("args", [("get", "system_voltage"), ("dump",), ("status",), ("watch", "--count", "2")])
def test_error_names_the_kind(fault: str, code: str, exit_code: int, args: tuple[str, ...]) -> None:
    result = run("exo", *args, "-p", fake(fault=fault), "--json")
    assert result.code == exit_code
    envelope = result.stream[1] if args[0] == "watch" else result.json
    (message,) = [m for m in envelope["messages"] if m["level"] == "error"]
    assert message["code"] == code
    assert message["hint"]
    assert "fake://exo" in message["text"]
    if exit_code in (4, 5):
        assert "EB 90 01 04 11" in message["text"]  # what was sent
    if fault == "bad-checksum":
        assert "90 EB 01" in message["text"]  # what came
    if fault == "wrong-id":
        assert "id 2" in message["text"]


def test_truncated_answer_is_shown() -> None:
    seen = set()
    for seed in range(10):
        result = run("exo", "get", "system_voltage", "-p", fake(fault="truncate", seed=seed), "--json")
        assert result.code == 5
        seen.add(result.error["code"])
    assert "cut-short" in seen
    assert seen <= {"cut-short", "garbage", "bad-checksum"}


@pytest.mark.parametrize(
    "args", [("id", "2", "--yes"), ("get", "id"), ("dump",), ("raw", "EB90010512D4052C011E", "-y")]
)
@pytest.mark.parametrize("late", [0.35, 0.6, 0.95, 1.3])
def test_late_is_never_taken_for_another_speed(args: tuple[str, ...], late: float) -> None:
    """The reply to an earlier request, come after a speed change, is no answer at that speed."""
    result = run("exo", *args, "-p", fake(fault="late", late=late), "--json")
    assert "wrong-speed" not in result.codes(), result
    assert result.code in (0, 4, 5), result


def test_late_hand_at_another_speed_is_found_at_the_right_one() -> None:
    for speed in (57600, 19200):
        result = run("exo", "get", "id", "-p", fake(baud=speed), "--json")
        assert result.code == 5
        assert result.error["code"] == "wrong-speed"
        assert f"--baud {speed}" in result.error["hint"]
        assert run("exo", "get", "id", "-p", fake(baud=speed), "--json", "--baud", str(speed)).values == {"id": 1}


def test_scan_suspects_two_hands_with_one_id() -> None:
    result = run("exo", "scan", "--ids", "1-8", "-p", fake(fault="twin-id"), "--json")
    text = " ".join(m["text"] + m["hint"] for m in result.json["messages"]) + str(result.rows)
    assert "two hands" in text or "two devices" in text, result


def test_scan_suspects_a_twin_that_shows_now_and_then() -> None:
    result = run("exo", "scan", "--ids", "1-8", "-p", fake(fault="twin-id", every=2), "--json")
    assert result.code == 0
    assert [(row["id"], row["suspicion"]) for row in result.rows] == [(1, "two devices with this id?")]
    assert "twin-id" in result.codes()


@pytest.mark.parametrize("fault", ["loopback", "noise,deaf", "loopback,noise", "garble,deaf"])
def test_scan_finds_no_hand_in_echo_or_noise(fault: str) -> None:
    for seed in range(5):
        result = run("exo", "scan", "-p", fake(fault=fault, seed=seed), "--json")
        assert result.code == 5, result
        assert result.rows == []


def test_stream_goes_on_over_single_failures() -> None:
    """A watch gives a row with `error` for a sample that failed, and carries on (retries off)."""
    link = fake(fault="silent", after=2, every=4)
    result = run(
        "exo", "watch", "system_voltage", "--count", "9", "--rate", "0", "--retries", "0", "--json", "-p", link
    )
    rows, end = result.stream
    assert result.code == 0
    assert [row.get("value") for row in rows] == [558, 558, 558, 558, 558, None, 558, 558, 558]
    assert "error" in rows[5] and "value" not in rows[5]
    assert end["stream"]["failed"] == 1
    check_schema(end)


@pytest.mark.parametrize("fault", ["duplicate", "echo", "noise", "slow"])
def test_a_left_over_reply_is_never_taken_for_the_next_one(fault: str) -> None:
    """The same request again and again while the value changes: each sample is of its own moment.

    (A stale reply that comes after an equal request cannot be told: frames have no numbers.)
    """
    args = ("exo", "watch", "temperature.thumb", "--rate", "0.2", "--count", "8", "--json")
    clean = run(*args, "-p", fake(fault="hot")).stream[0]
    values = [row["value"] for row in clean]
    assert values[0] == 75 and values[-1] < 60 and values == sorted(values, reverse=True)
    assert [row["value"] for row in run(*args, "-p", fake(fault=f"hot,{fault}")).stream[0]] == values


def test_a_late_reply_is_not_kept_for_the_next_sample() -> None:
    """Each read is asked twice and answered twice; the second answer comes when nobody waits any more."""
    args = ("exo", "watch", "temperature.thumb", "--rate", "0.2", "--count", "8", "--json")
    clean = [row["value"] for row in run(*args, "-p", fake(fault="hot")).stream[0]]
    rows, end = run(*args, "-p", fake(fault="hot,late", late=0.35)).stream
    assert end["counters"]["retries"] >= 8
    assert all(abs(row["value"] - value) <= 1 for row, value in zip(rows, clean, strict=True)), (rows, clean)


def test_counters_tell_what_happened_on_the_line() -> None:
    def counters(fault: str, *more: str, **options: int) -> dict[str, int]:
        return dict(run("exo", "get", "id", "-p", fake(fault=fault, **options), "--json", *more).json["counters"])

    clean = {"sent": 1, "received": 1, "retries": 0, "bad_frames": 0, "stray_bytes": 0}
    assert counters("healthy") == clean
    assert counters("echo") == {**clean, "stray_bytes": 9}
    noisy = counters("noise")
    assert (noisy["sent"], noisy["received"]) == (1, 1) and 1 <= noisy["stray_bytes"] <= 12
    spoiled = counters("bad-checksum", "--baud", "115200")
    assert spoiled == {"sent": 3, "received": 0, "retries": 2, "bad_frames": 3, "stray_bytes": 27}
    assert counters("bad-checksum", every=2) == clean
    again = counters("silent", "--retries", "4", "--baud", "115200")
    assert again == {"sent": 5, "received": 0, "retries": 4, "bad_frames": 0, "stray_bytes": 0}
