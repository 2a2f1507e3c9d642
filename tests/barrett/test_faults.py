"""Every fault of the simulator times every barrett command: the right value, or the right exit code.

Never a wrong value where the protocol can tell, a repeated write, a traceback or a hang. Runs the real `main()` against
the simulator in virtual time. GCL has no checksum: a flipped bit that leaves the echo, the number of lines and the
number of numbers intact cannot be noticed, so that under `erratic` no value is judged. The simulator's `bad-checksum`
flips bit 7, which no ASCII character has, and must be noticed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.barrett.commands import (
    COMMANDS,
    READING,
    Command,
    fake,
    prepare,
    sent_lines,
    taken,
    written_lines,
)
from tests.barrett.faults import DEVICE_FAULTS, FAULTS, LINE_FAULTS, SEED, Cell, allowed
from tests.support.cli import run

pytestmark = pytest.mark.faults


VARIANTS: dict[str, dict[str, int]] = {"always": {}, "after-2": {"after": 2}, "every-3": {"every": 3}}
ALIKE = ("status", "status-check", "get", "get-hand", "baud-show", "baud-save", "version", "set-all", "defaults", "diff",
         "step-open", "step-close", "home", "torque-open", "open", "move-default", "gcl-move", "gcl-save")  # fmt: skip
"""Commands that exchange what another one does: faults that befall only some requests are not tried again."""
HARMLESS = ("healthy", "garble", "dribble", "split", "slow", "wrong-id", "twin-id")
"""Faults that touch no byte of an answer: nothing else can come of them when they are rarer."""


# -- one cell ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the input files of the commands, and the journal of saves."""
    path = tmp_path_factory.mktemp("faults")
    prepare(path)
    return path


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
