"""What the messages of `handctl barrett` say at single faults of the simulator, and what comes of faults in a movement and a stream.

Every fault in every command is `tests/search/faults.py`; its exit codes are in `tests/contract/facts/outcomes/barrett.py`. GCL has
no checksum: a flipped bit that leaves the echo, the number of lines and the number of numbers intact cannot be noticed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.barrett.commands import fake, written_lines
from tests.contract.facts.outcomes.barrett import OUTCOMES
from tests.support.cli import run
from tests.support.each_row import each_row

SEED = 1


# -- what the message says --------------------------------------------------------------------------------------------

KINDS = [
    ("silent", "no-answer", 4), ("deaf", "no-answer", 4), ("loopback", "echo", 5), ("disconnect", "lost", 3),
    ("no-echo", "no-echo", 5), ("bad-checksum", "", 5), ("truncate", "", 5),
]  # fmt: skip


@pytest.mark.parametrize("args", [("get", "P"), ("dump",), ("close",), ("gcl", "VERS"), ("watch", "--count", "2")])
def test_error_names_the_kind(args: tuple[str, ...]) -> None:
    for fault, code, exit_code in KINDS:
        result = run("barrett", *args, "-p", fake(fault=fault, seed=SEED), "--json")
        envelope = result.stream[1] if args[0] == "watch" else result.json
        (message,) = [m for m in envelope["messages"] if m["level"] == "error"]
        assert result.code == exit_code and code in (message["code"], ""), (fault, result)
        assert message["hint"] and "fake://barrett" in message["text"], message
        if exit_code == 4:
            assert "600" in message["text"] and "38400" in message["text"], message  # what was tried
            assert "power" in message["hint"] and "cable" in message["hint"], message
        if exit_code == 5:
            words = message["text"].split()
            assert any(len(word) == 2 and set(word) <= set("0123456789ABCDEF") for word in words), message


def test_hints_name_commands_of_this_device() -> None:
    (wire,) = OUTCOMES.wires.values()
    for fault in {*wire.line, *wire.device} - {"hang", "erratic"}:
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
    assert moved.error["code"] == "err-8192"


def test_blocked_motors_are_told_one_by_one() -> None:
    """§5.5: M reports 16; C reports nothing, so that the end is told from the position."""
    for args, code, ended in (
        (("move", "3000"), 7, "stalled short of the target"),
        (("move", "3000", "--expect", "contact"), 0, "stalled short of the target"),
        (("close",), 7, "did not move"),
        (("close", "--expect", "contact"), 7, "did not move"),  # nothing shows that it touches anything
        (("close", "--expect", "any"), 7, "did not move"),  # and what never began did not end anywhere
        (("move", "3000", "--expect", "any"), 0, "stalled short of the target"),
    ):
        result = run("barrett", *args, "--motors", "12", "--json", "-p", fake(fault="blocked"))
        assert result.code == code, result
        assert [(row["motor"], row["value"], row["ended"]) for row in result.rows] == [
            ("F1", 0, ended),
            ("F2", 0, ended),
        ]


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


@each_row("fault", ["stale", "echo", "slow", "split"])
def test_a_left_over_answer_is_never_taken_for_the_next_one(fault: str) -> None:
    """TEMP falls by itself after HI's heat: each sample is of its own moment, or an error."""
    args = ("barrett", "watch", "UPSECS", "--rate", "0.5", "--count", "6", "--json")
    rows = run(*args, "-p", fake(fault=fault, seed=SEED)).stream[0]
    values = [row["value"] for row in rows if "value" in row]
    assert values == sorted(set(values)), values
