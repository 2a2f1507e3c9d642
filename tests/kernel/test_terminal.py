"""What a person sees: the live view, the questions, the guided calibration, Ctrl-C. Tables at any width are in test_screens.

In this process with a person before it, and what the system adds on a real pseudo-terminal, drawn by a terminal emulator.
"""

from __future__ import annotations

import fcntl
import os
import re
import struct
import subprocess
import termios
from contextlib import suppress
from pathlib import Path

import pytest

from tests.support.cli import (
    FINGERS,
    PATIENCE,
    POWER_ON,
    clean_environment,
    fake,
    frame,
    program,
    s16,
    sent,
    spying,
    writes,
)
from tests.support.each_row import each_row
from tests.support.person import once, person, pressed_at
from tests.support.screen import screen
from tests.support.terminal import Terminal

POWER_OFF = "Ctrl-C does not stop the hand. To stop it, switch its power off."
SPARKS = "▁▂▃▄▅▆▇█"


# -- tables -----------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_dump_at_80x24() -> None:
    with Terminal("exo", "dump", "--fake") as terminal:
        assert terminal.finish() == 0
        lines = terminal.lines
    for name, (_, _, values) in POWER_ON.items():
        (line,) = [text for text in lines if text.split()[:1] == [name]]
        shown = [f"{value:02X}" if name == "error" else str(value) for value in values]
        assert line.split()[2 : 2 + len(shown)] == shown
    assert "\x1b[" in terminal.data.decode()


@pytest.mark.real
def test_what_was_typed_before_a_question_is_no_answer_to_it() -> None:
    with Terminal("exo", "position", "1000", "1000", "1000", "1000", "1000", "-p", "fake://exo") as terminal:
        terminal.send("y\r")
        terminal.until("Go on? [y/N]")
        terminal.send("n\r")
        assert terminal.finish() == 8, terminal.text


def test_json_on_a_terminal_is_json() -> None:
    seen = screen("exo", "get", "id", "-p", fake(), "--json", columns=40)
    assert seen.code == 0 and "\x1b" not in seen.data
    assert '"value": 1' in seen.data


# -- the live view ----------------------------------------------------------------------------------------------------


@pytest.mark.real
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
    assert lines[-1].split() == [
        "q",
        "quit",
        "space",
        "freeze",
        "r",
        "record",
        "+",
        "-",
        "history",
        "S",
        "stop",
        "?",
        "help",
    ]
    first = next(index for index, line in enumerate(lines) if line.startswith("little"))
    course = lines.index("position_actual") + 1
    assert lines[first - 1].split() == ["actual", "actual", "[mA]", "[°C]"]
    bars = []
    for index, finger in enumerate(FINGERS):
        values = [POWER_ON[name][2][index] for name in ("position_actual", "force_actual", "current", "temperature")]
        line = lines[first + index]
        assert [word for word in line.split() if word.lstrip("-").isdigit()] == [str(value) for value in values], line
        bars.append(line[line.index("▕") : line.index("▏")].count("█"))
        below = lines[course + index]
        assert below.startswith(finger) and f"{values[0]}..{values[0]}" in below, below
        assert any(spark in below for spark in SPARKS), below
    assert bars == sorted(bars) and bars[0] < bars[-1]
    assert any(line.startswith("error") and "ok" in line for line in lines)
    assert "Traceback" not in after


def test_live_view_shows_minimum_and_maximum_of_a_motion() -> None:
    seen = screen("exo", "watch", "position_actual", "force_actual", "--count", "20", "-p", fake(jitter=1), rows=40)
    spans = re.findall(r"(-?\d+)\.\.(-?\d+)", "\n".join(seen.display))
    assert any(int(low) < int(high) for low, high in spans), seen.display


def test_live_view_of_errors_and_failures() -> None:
    sick = screen("exo", "watch", "error", "temperature", "--count", "3", "-p", fake(fault="faults"))
    text = "\n".join(sick.display)
    assert "over_temperature" in text and "locked_rotor" in text
    silent = screen("exo", "watch", "-p", fake(fault="silent", after=20), "--retries", "0")
    assert silent.code == 4 and "no reply" in silent.err
    assert silent.data.rindex("\x1b[?1049l") > silent.data.rindex("\x1b[?1049h"), "the screen is given back"
    assert silent.data.rindex("\x1b[?25h") > silent.data.rindex("\x1b[?25l"), "so is the cursor"


# -- questions --------------------------------------------------------------------------------------------------------


WRITE = frame("EB 90 01 05 12 D4 05 2C 01 1E")


@pytest.mark.real
@pytest.mark.parametrize(("key", "code"), [("y\r", 0), ("\x04", 8), ("\x03", 130)])
def test_set_asks_on_a_terminal(tmp_path: Path, key: str, code: int) -> None:
    trace = tmp_path / "t.txt"
    with Terminal("exo", "set", "position_set.index=300", "-p", "fake://exo", "--trace", trace) as terminal:
        terminal.until("[y/N]")
        assert not trace.exists() or writes(trace) == []
        terminal.send(key)
        assert terminal.finish() == code
    assert (writes(trace) if trace.exists() else []) == ([WRITE] if code == 0 else [])


@each_row(("answer", "code"), [("y", 0), ("yes", 0), ("n", 8), ("", 8), ("maybe", 8)])
def test_set_asks(answer: str, code: int) -> None:
    with spying() as spy:
        seen = person("exo", "set", "position_set.index=300", "-p", fake(), answers=[answer])
    assert seen.code == code
    assert [line.device.space.memory[1492:1494] for line in spy.lines] == [s16(300) if code == 0 else s16(454)]
    asked = " ".join(seen.text.partition("[y/N]")[0].split())
    assert "Setting From To position_set.index 440 300 This moves" in asked and "EB 90" not in asked


def test_a_question_shows_bytes_with_v_alone() -> None:
    seen = person("exo", "set", "position_set.index=300", "-v", "-p", fake(), answers=["n"])
    assert f"position_set.index = 300 (address 1492): {WRITE.hex(' ').upper()}" in " ".join(seen.text.split())


def test_a_command_of_fingers_asks_with_a_table() -> None:
    seen = person("exo", "position", "ring=900", "index=100", "-p", fake(), answers=["n"])
    assert seen.code == 8
    assert "  Finger  From   To\n  ring     220  900\n  index    440  100\n" in seen.text.replace("\r", "")


def test_stdin_that_is_no_terminal_is_not_asked() -> None:
    assert person("exo", "set", "id=9", "-p", fake()).code == 8


@each_row(("answer", "code"), [("reset", 0), ("y", 8), ("RESET", 8), ("", 8)])
def test_factory_reset_wants_the_word(tmp_path: Path, answer: str, code: int) -> None:
    backup, trace = tmp_path / "b.json", tmp_path / "t.txt"
    args = ("exo", "factory-reset", "--undocumented-address", "--backup", backup, "-p", fake(), "--trace", trace)
    assert person(*args, answers=[answer]).code == code
    assert backup.exists() is (code == 0)
    assert (writes(trace) if trace.exists() else []) == ([frame("EB 90 01 04 12 EE 03 01 09")] if code == 0 else [])


# -- calibration ------------------------------------------------------------------------------------------------------


def test_calibration_asks_leads_and_reports() -> None:
    seen = person("exo", "calibrate", "-p", fake(calibration=9.2), answers=["y"])
    assert seen.code == 0
    asked = " ".join(seen.text.partition("[y/N]")[0].split())
    for number, seconds in enumerate((1, 2, 2, 2, 2), 1):
        step = asked.partition(f"step {number}: ")[2].partition(f"step {number + 1}: ")[0]
        assert re.search(rf"\b{seconds} s\b", step), asked
    for word in ("relax", "straight", "clenched", "palm", "thumb and index", "wear the hand", POWER_OFF):
        assert word in asked, word
    assert len(set(re.findall(r"calibrating +([0-9.]+) s", seen.text))) >= 3  # progress moves
    (seconds,) = re.findall(r"reported the end after ([0-9.]+) s", seen.text)
    assert float(seconds) >= 9.0
    assert any(line.startswith("position_actual") for line in seen.lines)


def test_calibration_refused() -> None:
    with spying() as spy:
        assert person("exo", "calibrate", "-p", fake(), answers=["n"]).code == 8
    assert spy.lines == [], "no port was opened"


def test_interrupted_calibration_says_that_nothing_stops_it(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    words = ("exo", "calibrate", "-y", "-p", fake(calibration=60), "--trace", trace)
    seen = person(*words, press=once(lambda shown: "calibrating" in shown))
    assert seen.code == 6, "no stop was acknowledged: it goes on"
    text = " ".join(seen.text.split())
    assert "still calibrating" in text
    assert f"{POWER_OFF} No documented command stops a calibration" in text
    assert writes(trace) == sent(trace)[-1:] == [frame("EB 90 01 04 12 F1 03 01 0C")]


# -- motion -----------------------------------------------------------------------------------------------------------


def test_ctrl_c_during_a_motion_holds_the_fingers(tmp_path: Path) -> None:
    """The manual has no stop: the fingers are commanded to where they are."""
    trace = tmp_path / "t.txt"
    targets = (1000, 1000, 1000, 1000, 0)
    with pressed_at(0.3):
        seen = person("exo", "position", *map(str, targets), "-y", "--wait", "30", "-p", fake(), "--trace", trace)
    assert seen.code == 130
    first, release, last = writes(trace)
    assert first == frame("EB 90 01 0B 32 E8 03 E8 03 E8 03 E8 03 00 00 EA")
    assert release == frame("EB 90 01 0B 31 00 00 00 00 00 00 00 00 00 00 3D")
    assert last[:5] == frame("EB 90 01 0B 32")
    held = [int.from_bytes(last[5 + 2 * i : 7 + 2 * i], "little") for i in range(5)]
    assert s16(*held) == last[5:15]
    ways = list(zip(POWER_ON["position_actual"][2], held, targets, strict=False))
    assert all(min(start, target) < value < max(start, target) for start, value, target in ways)


@pytest.mark.real
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
