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
from pathlib import Path

import pytest

from tests.inspire.exo_commands import COMMANDS, READING, Command, prepare
from tests.inspire.exo_faults import DEVICE_FAULTS, LINE_FAULTS, RIGHT, Cell, allowed
from tests.support.cli import check_schema, fake, run, sent, writes

pytestmark = pytest.mark.faults

VARIANTS: dict[str, dict[str, int]] = {"always": {}, "after-1": {"after": 1}, "every-2": {"every": 2}}

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


# -- one cell ---------------------------------------------------------------------------------------------------------


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
    text = text.lower()
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
