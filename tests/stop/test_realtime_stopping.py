"""What must reach the wire whatever happens to our own output: velocity 0, ^C and T of the RealTime loop."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.screen import render
from handctl.sim.engine.line_and_faults import Line
from tests.barrett.commands import fake
from tests.support.cli import clean_environment, run, wait_until
from tests.support.each_row import each_row
from tests.support.person import pressed_at

MOVING = ("barrett", "realtime", "--motors", "1", "--velocity", "30", "--receive", "position", "--timeout", "20")
STOP = [b"c\x00", b"\x03", b"1T\r"]


def started(*words: str, trace: Path) -> subprocess.Popen[bytes]:
    """A realtime loop that moves a motor, once its first control block is on the wire."""
    port = "fake://barrett?initialized=1&wire=auto"
    process = subprocess.Popen(
        [sys.executable, "-m", "handctl", *MOVING, "-p", port, "--baud", "9600", "--trace", str(trace), *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=clean_environment(),
    )  # fmt: skip
    reached(process, trace, "> 43 1E")
    return process


def reached(process: subprocess.Popen[bytes], trace: Path, line: str) -> None:
    """Waits until this is on the wire."""
    wait_until(lambda: process.poll() is not None or (trace.exists() and line in trace.read_text(encoding="utf-8")))
    assert process.poll() is None


def sent(trace: Path) -> list[bytes]:
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if " > " in line]
    return [bytes.fromhex("".join(words[2:])) for words in lines]


def stops(pieces: list[bytes]) -> bool:
    """Whether the stop stands behind the last block, in order: velocity 0, ^C, motor power off.

    Where the block before is not yet answered, as on a busy machine, ^C comes at once.
    """
    start = max(place for place, piece in enumerate(pieces) if piece[:1] in (b"C", b"c"))
    return [piece for piece in pieces[start:] if piece in STOP] in (STOP, STOP[1:])


@pytest.mark.real
def test_a_reader_that_sleeps_does_not_keep_a_motor_running(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    process = started("--json", trace=trace)
    assert process.wait(30) == 1
    assert process.stderr is not None and b"the motors were stopped" in process.stderr.read()
    assert stops(sent(trace))


@pytest.mark.real
def test_ctrl_backslash_stops_as_ctrl_c_does(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    process = started("--csv", "-o", str(tmp_path / "o.csv"), trace=trace)
    process.send_signal(signal.SIGQUIT)
    assert process.wait(30) == 130
    assert stops(sent(trace)), sent(trace)[-12:]


def test_a_trace_that_cannot_be_written_keeps_nothing_from_the_wire(monkeypatch: pytest.MonkeyPatch) -> None:
    real = open

    class Full:
        """A trace file whose disk is full behind its first lines."""

        def __init__(self) -> None:
            self.lines = 0

        def write(self, line: str) -> None:
            self.lines += 1
            if self.lines > 20:
                raise OSError(28, os.strerror(28))

        def fileno(self) -> int:
            return nothing

        def close(self) -> None:
            os.close(nothing)
            raise OSError(28, os.strerror(28))

    nothing, full = os.open(os.devnull, os.O_RDONLY), Full()
    monkeypatch.setattr(
        "handctl.link.transcript.open",
        lambda path, *rest, **more: full if path == "full" else real(path, *rest, **more),
        raising=False,
    )
    fed: list[bytes] = []
    feed = Line.feed

    def noted(line: Line, data: bytes) -> None:
        fed.append(data)
        feed(line, data)

    monkeypatch.setattr(Line, "feed", noted)
    result = run(*MOVING, "-p", fake(wire="auto"), "--count", "30", "--json", "--trace", "full")
    assert result.code == 1 and "cannot be written" in result.err
    assert len(result.stream[0]) >= 30 and result.stream[1]["exit_code"] == 1
    assert stops(fed) and full.lines == 21


@pytest.mark.real
def test_two_signals_at_once_are_one_wish(tmp_path: Path) -> None:
    """A closing terminal sends a hang-up, its service manager a SIGTERM behind it: the stop goes out all the same."""
    trace = tmp_path / "t.txt"
    process = subprocess.Popen(
        [sys.executable, "-m", "handctl", "barrett", "close", "--motors", "1", "-p", "fake://barrett?initialized=1",
         "--trace", str(trace)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=clean_environment(),
    )  # fmt: skip
    reached(process, trace, "> 31 43 0D")
    for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT):
        process.send_signal(number)
    assert process.wait(30) in (130, -signal.SIGTERM, -signal.SIGINT)  # the last may meet the interpreter at its end
    pieces = sent(trace)
    assert b"\x03" in pieces[pieces.index(b"1C\r") :]


class Gone:
    """A stderr whose terminal is no more."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return -1

    def write(self, text: str) -> int:
        raise OSError(5, os.strerror(5))

    def flush(self) -> None:
        raise OSError(5, os.strerror(5))


def test_a_guide_without_its_terminal_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Gone())
    prompts = TerminalPrompts(quiet=False)
    prompts.moving = True
    prompts.progress("moving")
    prompts.say("said")
    prompts.done()
    assert not prompts.moving


@each_row("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_result_is_shown_changes_nothing(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """The command is through: one whole envelope and its own exit code, not none, half a one or two."""
    show = render.show

    def shown(*what: Any) -> None:
        signal.raise_signal(number)
        show(*what)
        signal.raise_signal(number)

    monkeypatch.setattr(render, "show", shown)
    before = signal.getsignal(signal.SIGINT)
    try:
        done = run("exo", "get", "id", "-p", "fake://exo?clock=virtual", "--json")
    finally:
        signal.signal(signal.SIGINT, before)
    assert done.code == 0 and [row["value"] for row in done.rows] == [1] and not done.err


def test_an_answer_that_is_still_due_keeps_no_stop_waiting(tmp_path: Path) -> None:
    """The hand has fallen silent when Ctrl-C comes: ^C goes out within a second, however long --timeout lets an answer take."""
    trace, pressed = tmp_path / "t.txt", 0.8
    with pressed_at(pressed):
        result = run(*MOVING, "-p", fake(wire="auto", fault="silent", after=16), "--json", "--trace", trace)
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if " > " in line]
    first = next(float(moment) for moment, _, *digits in lines if float(moment) > pressed and digits == ["03"])
    assert first - pressed < 1.0, result
