"""Every fault of the simulator times every aidin command: the right value, or the right exit code.

Never a wrong value where the protocol can tell, an object between those of homing, a traceback or a hang. The protocol
has no checksum and no acknowledge: only the form of the JSON and feedback can tell.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from handctl.devices.aidin import stopper
from tests.aidin.faults import COMMANDS, FAULTS
from tests.support.cli import Result, run, spying

pytestmark = pytest.mark.faults

KEYS = {"status": 5, "get": 1, "watch": 1}
MODES = {"home": {1}, "initial": {2}, "stop": {3}, "bias": {4}, "max-torque": {5}, "encoders": {10}, "joints": {22},
         "currents": {5, 41, 3}}  # fmt: skip


POLLED = (
    "healthy",
    "silent",
    "disconnect",
    "noise",
    "split",
    "echo",
    "loopback",
    "truncate",
    "late",
    "nan",
    "not-json",
)
"""Faults that an exchange of questions and answers meets differently."""
ALIKE = ("get", "watch", "initial", "encoders", "max-torque")
"""Commands that do what another one does: only the faults of PLAIN are tried on them, too."""
PLAIN = ("healthy", "silent", "truncate", "wrong-type")
REAL_SECONDS, VIRTUAL_SECONDS = 30.0, 30.0


def fake(**options: object) -> str:
    made = {"clock": "virtual", "seed": 1, "rate": 12, **options}  # a slower stream costs the suite less
    return "fake://aidin?" + "&".join(f"{key}={value}" for key, value in made.items())


def asked(trace: Path) -> list[bytes]:
    """What the host sent; the long lines of a stream are not looked at."""
    with trace.open(encoding="utf-8") as file:
        return [bytes.fromhex(line.split("> ", 1)[1]) for line in file if ">" in line[:16]]


def cell(tmp_path: Path, name: str, allowed: int | set[int], **options: object) -> Result:
    """Run one command against one fault; check all that holds for every cell."""
    trace = tmp_path / "trace.txt"
    trace.unlink(missing_ok=True)
    began = time.monotonic()
    with spying() as spy:
        result = run("aidin", *COMMANDS[name], "-p", fake(**options), "--json", "--trace", trace)
    assert time.monotonic() - began < REAL_SECONDS
    assert spy.now < VIRTUAL_SECONDS
    assert "Traceback" not in result.err
    rows, envelope = result.stream if name == "watch" else ([], result.json)
    rows = envelope.get("rows", rows)
    errors = [message for message in envelope["messages"] if message["level"] == "error"]
    assert result.code in ({allowed} if isinstance(allowed, int) else allowed), result
    assert len(errors) == (result.code != 0), result
    if result.code:
        assert "fake://aidin" in errors[0]["text"] or result.code == 7, errors
        assert errors[0]["hint"], errors
    written = asked(trace)
    objects = [json.loads(data) for data in written]
    assert all(data.endswith(b"}\n") and len(data) <= 2047 for data in written)
    modes = [data["hand_mode"] for data in objects if data]
    assert set(modes) <= MODES.get(name, set()) | ({3} if result.code else set()), modes
    if name == "home":  # one run of the same object, the neutral one never in between
        places = [n for n, data in enumerate(objects) if data.get("hand_mode") == 1]
        assert not places or places == list(range(places[0], places[-1] + 1))
    for row in rows if name != "stop" else ():  # its rows are what went out
        assert ("error" in row) != ("value" in row), row
        if "error" in row:
            assert result.code or name == "watch", result
    return result


@pytest.mark.parametrize(
    ("fault", "name"), [(fault, name) for fault in FAULTS for name in COMMANDS if name not in ALIKE or fault in PLAIN]
)
def test_fault(tmp_path: Path, fault: str, name: str) -> None:
    cell(tmp_path, name, FAULTS[fault][name], start="homed", fault=fault)


@pytest.mark.parametrize("fault", POLLED)
def test_fault_polled(tmp_path: Path, fault: str) -> None:
    for name in ("status", "joints"):
        cell(tmp_path, name, FAULTS[fault][name], start="homed", exchange="poll", fault=fault)


@pytest.mark.parametrize("option", [
    "rate=10", "rate=500", "merge=5", "chunk=100", "between=none", "between=nul", "between=crlf", "layout=indented",
    "digits=17", "integers=1", "objects=separate", "reader=lines", "reader=naive", "homing=latched", "neutral=interrupts",
    "noise=1", "drift=10000", "q4=half", "q4=zero", "limits=obey",
])  # fmt: skip
def test_every_way_the_hand_may_be_made(tmp_path: Path, option: str) -> None:
    """What the manual leaves open must not matter (dossier 5)."""
    key, value = option.split("=")
    for exchange, name in (("stream", "joints"), ("poll", "get")):
        cell(tmp_path, name, 0, start="homed", exchange=exchange, **{key: value})


def test_a_hand_that_only_answers_commands(tmp_path: Path) -> None:
    """Nothing shows who is there: only the stop goes out. With --exchange command that is the user's word."""
    for name in COMMANDS:
        cell(tmp_path, name, 0 if name == "stop" else 4, start="homed", exchange="command")
    for name in ("home", "stop", "max-torque"):
        with spying():
            result = run(
                "aidin", *COMMANDS[name], "--exchange", "command", "-p", fake(start="homed", exchange="command")
            )
        assert result.code == 0, result


def test_a_mute_hand(tmp_path: Path) -> None:
    for name in COMMANDS:
        cell(tmp_path, name, 4, start="homed", exchange="mute")


def test_the_rest_of_a_damaged_answer_is_there(tmp_path: Path) -> None:
    result = cell(tmp_path, "status", 5, start="homed", fault="wrong-length")
    wrong = {row["key"] for row in result.rows if "error" in row}
    assert wrong == {"motor_pos", "task_space_pos"} and len(result.rows) == 95
    assert all(row["value"] is not None for row in result.rows if row["key"] not in wrong)


@pytest.mark.parametrize("fault", ["healthy", "silent", "dribble", "noise", "truncate", "unclosed"])
def test_deadline_bounds_the_whole_command(fault: str) -> None:
    for name in ("status", "home", "joints", "bias", "stop"):
        with spying() as spy:
            result = run(
                "aidin", *COMMANDS[name], "-p", fake(start="homed", fault=fault), "--deadline", "0.4", "--json"
            )
        # No deadline cuts a stop off: `stop` goes on until the hand tells that no current flows, and gives up by itself.
        limit = (stopper.TIMES + stopper.CONFIRM) * stopper.PERIOD if name == "stop" else 0.4 + 0.2
        assert spy.now <= limit + 0.001, (name, spy.now)  # and the stop that follows
        # homing is not begun when it cannot end
        assert result.code in ((2,) if name == "home" else (0, 4, 5)), (name, result)
