"""What a person sees: real pseudo-terminals, drawn by a terminal emulator.

Tables at several widths, the live view, the questions, the guided calibration, Ctrl-C.
"""

from __future__ import annotations

import fcntl
import os
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pexpect
import pytest

from tests.support.cli import (
    FINGERS,
    PATIENCE,
    POWER_ON,
    Simulator,
    clean_environment,
    frame,
    program,
    run,
    s16,
    sent,
    writes,
)
from tests.support.terminal import Terminal

pytestmark = pytest.mark.real

POWER_OFF = "Ctrl-C does not stop the hand. To stop it, switch its power off."
SPARKS = "▁▂▃▄▅▆▇█"


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with Simulator("--pty", "--set", "calibration=1.2") as simulator:
        yield simulator


# -- tables -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", [40, 80, 200])
@pytest.mark.parametrize("verb", ["dump", "status"])
def test_tables_at_any_width(verb: str, columns: int) -> None:
    """No line is wider than the terminal, no number is cut, folded or left out."""
    with Terminal("exo", verb, "--fake", columns=columns) as terminal:
        assert terminal.finish() == 0
        lines = terminal.text.split("\n")
    assert all(len(line) <= columns for line in lines), [line for line in lines if len(line) > columns]
    text = "\n".join(lines)
    assert "…" not in text
    assert "simulated" in text
    words = text.split()
    names = ("position_set", "force_set", "position_actual", "force_actual", "current", "temperature")
    for name in names:
        for value in POWER_ON[name][2]:
            assert str(value) in words, (name, value, text)
    for finger in FINGERS:
        assert finger in text.replace(":", " "), (finger, text)


def test_dump_at_80x24() -> None:
    with Terminal("exo", "dump", "--fake") as terminal:
        assert terminal.finish() == 0
        lines = terminal.lines
    for name, (_, _, values) in POWER_ON.items():
        (line,) = [text for text in lines if text.split()[:1] == [name]]
        shown = [f"{value:02X}" if name == "error" else str(value) for value in values]
        assert line.split()[2 : 2 + len(shown)] == shown
    assert "\x1b[" in terminal.data.decode()


def test_status_at_80x24() -> None:
    with Terminal("exo", "status", "-p", "fake://exo?fault=faults") as terminal:
        assert terminal.finish() == 0
        text = terminal.text
    assert all(len(line) <= 80 for line in text.split("\n"))
    for index, finger in enumerate(FINGERS):
        (line,) = [line for line in text.split("\n") if line.startswith(f"{finger} ")]
        assert line.split()[1:3] == [str(POWER_ON[name][2][index]) for name in ("position_actual", "position_set")]
    for word in ("locked_rotor", "over_temperature", "over_current", "motor_abnormal", "communication"):
        assert word in text


@pytest.mark.parametrize(("env", "more", "coloured"), [
    ({}, (), True), ({"NO_COLOR": "1"}, (), False), ({}, ("--color", "never"), False),
    ({"NO_COLOR": "1"}, ("--color", "always"), True),
])  # fmt: skip
def test_colour_on_a_terminal(env: dict[str, str], more: tuple[str, ...], coloured: bool) -> None:
    with Terminal("exo", "status", "--fake", *more, env=env) as terminal:
        assert terminal.finish() == 0
    colours = re.findall(rb"\x1b\[[0-9;]*(?:3[0-7]|4[0-7]|9[0-7])m", terminal.data)
    assert bool(colours) is coloured


def test_json_on_a_terminal_is_json() -> None:
    with Terminal("exo", "get", "id", "--fake", "--json", columns=40) as terminal:
        assert terminal.finish() == 0
    assert b"\x1b" not in terminal.data
    assert '"value": 1' in terminal.text


# -- the live view ----------------------------------------------------------------------------------------------------


def test_live_view_at_80x24() -> None:
    with Terminal("exo", "watch", "-p", "fake://exo", "--rate", "20") as terminal:
        lines = terminal.until_samples(12)
        assert terminal.screen.cursor.hidden
        terminal.send("\x03")
        assert terminal.finish() == 130
        assert not terminal.screen.cursor.hidden
        assert b"\x1b[?25h" in terminal.data
        after = terminal.text
    head = lines[0]
    assert "simulated" in head and "exo watch" in head
    (rate,) = re.findall(r"([0-9.]+) Hz", head)
    assert 0 < float(rate) <= 21
    (samples,) = re.findall(r"(\d+) samples", head)
    (foot,) = [line for line in lines if line.startswith("sent ")]
    for key in ("sent", "received", "retries", "bad_frames", "stray_bytes"):
        assert re.search(rf"\b{key} \d+", foot), foot
    assert abs(int(samples) - int(re.findall(r"sent (\d+)", foot)[0])) <= 3
    for name in ("position_actual", "force_actual", "current"):
        first = next(index for index, line in enumerate(lines) if line.startswith(name))
        bars = []
        for index, (value, finger) in enumerate(zip(POWER_ON[name][2], FINGERS, strict=False)):
            line = lines[first + index]
            assert finger in line
            numbers = line.partition("▏")[2] if line.count("▏") == 1 else line[line.rindex("▏") :]
            assert re.search(rf"(?<![0-9-]){value} ", numbers), line
            assert f"{value}..{value}" in line
            assert any(spark in numbers for spark in SPARKS), line
            bars.append(line[line.index("▕") : line.rindex("▏")].count("█"))
        if name == "position_actual":
            assert bars == sorted(bars) and bars[0] < bars[-1]
    assert any(line.startswith("error") and "ok" in line for line in lines)
    assert any(re.search(r"little 31 .*thumb 35 .*°C", line) for line in lines)
    assert "Traceback" not in after


@pytest.mark.parametrize("rows", [12, 24, 50])
def test_live_view_fits(rows: int) -> None:
    """Head and counters are on the screen whatever its height; with room every finger has its own line."""
    with Terminal("exo", "watch", "--fake", "--rate", "20", rows=rows) as terminal:
        lines = terminal.until_samples(8)
        terminal.send("\x03")
        assert terminal.finish() == 130
    assert "Hz" in lines[0], lines
    assert lines[-1].startswith("sent "), lines
    assert len(lines) <= rows
    for name in ("position_actual", "force_actual", "current", "error", "temperature"):
        assert any(line.startswith(name) for line in lines), (name, lines)
    if rows == 50:
        assert len(lines) >= 1 + 6 + 5 + 5 + 1 + 5 + 1


def test_live_view_shows_minimum_and_maximum_of_a_motion() -> None:
    def spread(lines: list[str]) -> bool:
        spans = re.findall(r"(-?\d+)\.\.(-?\d+)", "\n".join(lines))
        return any(int(low) < int(high) for low, high in spans)

    with Terminal("exo", "watch", "position_actual", "-p", "fake://exo?jitter=1", "force_actual") as terminal:
        terminal.until_screen(spread)
        terminal.send("\x03")
        assert terminal.finish() == 130


def test_live_view_of_errors_and_failures() -> None:
    with Terminal("exo", "watch", "error", "temperature", "-p", "fake://exo?fault=faults") as terminal:
        text = "\n".join(terminal.until_samples(3))
        terminal.send("\x03")
        assert terminal.finish() == 130
    assert "over_temperature" in text and "locked_rotor" in text
    link = "fake://exo?fault=silent&after=20"
    with Terminal("exo", "watch", "-p", link, "--rate", "50", "--timeout", "0.05", "--retries", "0") as terminal:
        assert terminal.finish() == 4
        assert not terminal.screen.cursor.hidden
        assert "no answer" in terminal.text


def test_live_view_ends_by_count() -> None:
    with Terminal("exo", "watch", "--fake", "--count", "5", "--rate", "20") as terminal:
        assert terminal.finish() == 0
        assert not terminal.screen.cursor.hidden
        assert "5 samples" in terminal.text


# -- questions --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("answer", "code"), [("y\r", 0), ("yes\r", 0), ("n\r", 8), ("\r", 8), ("maybe\r", 8),
                                              ("\x04", 8), ("\x03", 130)])  # fmt: skip
def test_set_asks(tmp_path: Path, sim: Simulator, answer: str, code: int) -> None:
    trace = tmp_path / "t.txt"
    with Terminal("exo", "set", "position_set.index=300", "-p", sim.link, "--trace", trace) as terminal:
        terminal.until("[y/N]")
        assert "moves" in terminal.text
        assert "EB 90 01 05 12 D4 05 2C 01 1E" in terminal.text.replace("\n", "")
        assert not trace.exists() or sent(trace) == []
        terminal.send(answer)
        assert terminal.finish() == code
    expected = [frame("EB 90 01 05 12 D4 05 2C 01 1E")] if code == 0 else []
    assert (writes(trace) if trace.exists() else []) == expected
    value = run("exo", "get", "position_set.index", "--format", "plain", "-p", sim.link).out
    assert value == ("300\n" if code == 0 else "454\n")


def test_stdin_that_is_no_terminal_is_not_asked(sim: Simulator) -> None:
    command = f"{sys.executable} -m handctl exo set id=9 -p {sim.link} < /dev/null; echo code=$?"
    process = pexpect.spawn("sh", ["-c", command], env=clean_environment(), timeout=PATIENCE)
    process.expect("code=8")
    process.close()


@pytest.mark.parametrize(("answer", "code"), [("reset\r", 0), ("y\r", 8), ("RESET\r", 8), ("\r", 8)])
def test_factory_reset_wants_the_word(tmp_path: Path, answer: str, code: int) -> None:
    backup, trace = tmp_path / "b.json", tmp_path / "t.txt"
    args = ("exo", "factory-reset", "--undocumented-address", "--backup", backup, "--fake", "--trace", trace)
    with Terminal(*args) as terminal:
        terminal.until("reset' to go on")
        terminal.send(answer)
        assert terminal.finish() == code
    assert backup.exists() is (code == 0)
    assert (writes(trace) if trace.exists() else []) == ([frame("EB 90 01 04 12 EE 03 01 09")] if code == 0 else [])


# -- calibration ------------------------------------------------------------------------------------------------------


def test_calibration_asks_leads_and_reports(sim: Simulator) -> None:
    with Terminal("exo", "calibrate", "-p", sim.link) as terminal:
        terminal.until("[y/N]")
        asked = " ".join(terminal.text.split())
        for number, seconds in enumerate((1, 2, 2, 2, 2), 1):
            step = asked.partition(f"step {number}: ")[2].partition(f"step {number + 1}: ")[0]
            assert re.search(rf"\b{seconds} s\b", step), asked
        for word in ("relax", "straight", "clenched", "palm", "thumb and index", "worn", POWER_OFF):
            assert word in asked, word
        terminal.send("y\r")
        terminal.until("calibrating")
        assert terminal.finish() == 0
        text = terminal.text
    assert len(set(re.findall(r"calibrating +([0-9.]+) s", text))) >= 3  # progress moves
    (seconds,) = re.findall(r"reported the end after ([0-9.]+) s", text)
    assert float(seconds) >= 1.0
    assert "completed" in text
    shown = [line.split() for line in text.split("\n") if line.startswith("position_actual")]
    assert shown, text
    progress = [line for line in text.replace("\r", "\n").split("\n") if line.startswith("calibrating")]
    assert all(len(line) < 80 for line in progress), progress


def test_calibration_refused(sim: Simulator) -> None:
    with Terminal("exo", "calibrate", "-p", sim.link) as terminal:
        terminal.until("[y/N]")
        terminal.send("n\r")
        assert terminal.finish() == 8
    assert run("exo", "get", "position_actual", "--format", "plain", "-p", sim.link).lines[0] == "110"


def test_interrupted_calibration_says_that_nothing_stops_it(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    with (
        Simulator("--pty", "--set", "calibration=60") as sim,
        Terminal("exo", "calibrate", "-y", "-p", sim.link, "--trace", trace) as terminal,
    ):
        terminal.until("calibrating")
        terminal.send("\x03")
        assert terminal.finish() == 130
        text = " ".join(terminal.text.split())
    assert "goes on calibrating" in text
    assert f"{POWER_OFF} No documented command stops a calibration" in text
    assert writes(trace) == sent(trace)[-1:] == [frame("EB 90 01 04 12 F1 03 01 0C")]


# -- motion -----------------------------------------------------------------------------------------------------------


def test_ctrl_c_during_a_motion_holds_the_fingers(tmp_path: Path) -> None:
    """The manual has no stop: the fingers are commanded to where they are."""
    trace = tmp_path / "t.txt"
    targets = (1000, 1000, 1000, 1000, 0)
    args = ("position", *map(str, targets), "-y", "--wait", "30", "-p", "fake://exo", "--trace", trace)

    def in_the_middle() -> bool:
        """The whole way takes 0.7 s: on a busy machine Ctrl-C may come behind it."""
        trace.unlink(missing_ok=True)
        with Terminal("exo", *args) as terminal:
            terminal.until("positions")
            terminal.run_for(0.1)
            terminal.send("\x03")
            if terminal.finish() == 0:
                return False
            assert terminal.process.exitstatus == 130
        first, release, last = writes(trace)
        assert first == frame("EB 90 01 0B 32 E8 03 E8 03 E8 03 E8 03 00 00 EA")
        assert release == frame("EB 90 01 0B 31 00 00 00 00 00 00 00 00 00 00 3D")
        assert last[:5] == frame("EB 90 01 0B 32")
        held = [int.from_bytes(last[5 + 2 * i : 7 + 2 * i], "little") for i in range(5)]
        assert s16(*held) == last[5:15]
        ways = list(zip(POWER_ON["position_actual"][2], held, targets, strict=False))
        assert all(min(start, target) < value <= max(start, target) or value == target for start, value, target in ways)
        return all(min(start, target) < value < max(start, target) for start, value, target in ways)

    assert any(in_the_middle() for _ in range(10))


def test_a_terminal_that_does_not_know_its_size_is_taken_for_one_of_80_columns() -> None:
    """As a serial console, or a session that a script opened."""
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 0, 0, 0, 0))
    done = subprocess.Popen(
        program("exo", "get", "id", "-p", "fake://exo?fault=silent", "--timeout", "0.05"), env=clean_environment(),
        stdin=theirs, stdout=subprocess.DEVNULL, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    text = b""
    with suppress(OSError):  # the end of a pty
        while data := os.read(ours, 4096):
            text += data
    os.close(ours)
    assert done.wait(PATIENCE) == 4
    lines = text.decode().replace("\r", "").splitlines()
    assert max(map(len, lines)) > 60 and all(len(line) <= 80 for line in lines), lines
