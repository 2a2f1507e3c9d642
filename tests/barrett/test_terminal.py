"""What a person sees of a BarrettHand: tables, and the GCL prompt with its keys, on a real pseudo-terminal."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.barrett.commands import POWER_ON, SETTINGS, STATUS, sent_lines
from tests.support.cli import Simulator, run
from tests.support.terminal import Terminal

pytestmark = pytest.mark.real

READY = "fake://barrett?initialized=1"


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with Simulator("--pty", "--set", "initialized=1", kind="barrett") as simulator:
        yield simulator


# -- tables -----------------------------------------------------------------------------------------------------------


STROKES = {104233: "5956", 98712: "5640", 110003: "6285", 20117: "6489"}
"""Odometer in 1000 counts -> strokes: / 17.5 for a finger, / 3.1 for the spread (barrett §7.3)."""


@pytest.mark.parametrize("columns", [40, 80, 200])
@pytest.mark.parametrize("verb", ["dump", "status"])
def test_tables_at_any_width(verb: str, columns: int) -> None:
    """No line is wider than the terminal, no value and no mnemonic is cut, folded or left out. From 80 on it is a table."""
    with Terminal("barrett", verb, "-p", READY, columns=columns) as terminal:
        assert terminal.finish() == 0
        lines = terminal.text.split("\n")
    assert all(len(line) <= columns for line in lines), [line for line in lines if len(line) > columns]
    text = " ".join(lines)
    assert "…" not in text and "simulated" in text
    if columns >= 80:
        assert any(
            line.split()[:3] == (["GCL", "Name", "F1"] if verb == "dump" else ["Motor", "Position", "Strain"])
            for line in lines
        )
    words = text.replace("(", " ").replace(",", " ").replace(")", " ").split()
    for mnemonic in POWER_ON if verb == "dump" else ():
        assert mnemonic in words, mnemonic
    shown = list(POWER_ON) if verb == "dump" else [name for name in STATUS if name not in ("EN", "BAUD", "UPSECS")]
    for mnemonic in shown:
        for value in POWER_ON[mnemonic][2]:
            if verb == "status" and mnemonic == "OD":
                assert STROKES[value] in words, (mnemonic, value, lines)
            elif mnemonic in ("TEMP", "PTEMP"):
                assert f"{value / 10:.1f}" in words, (mnemonic, lines)
            elif mnemonic == "P":
                assert {str(value), f"{value}?"} & set(words), (value, lines)  # before HI it means nothing
            elif mnemonic == "OTEMP" or (verb == "status" and (mnemonic == "S" or (mnemonic, value) == ("SG", 255))):
                continue
            elif mnemonic == "UPSECS":
                assert any(word.startswith("73456") and len(word) == 7 for word in words), lines
            else:
                assert str(value) in words, (mnemonic, value, lines)


def test_status_fits_80x24_and_is_in_words() -> None:
    with Terminal("barrett", "status", "-p", "fake://barrett?fault=unknown-codes") as terminal:
        assert terminal.finish() == 0
        text, screen = terminal.text.rstrip("\n"), terminal.lines
    assert len(text.split("\n")) <= 24 and text.split("\n")[0] == screen[0], "it scrolled"
    joined = " ".join(text.split())
    assert "41.2 °C" in joined and "1042" in joined and "4.33" in joined
    assert "Motor not initialized (4)" in joined and "(not used) (512)" in joined


def test_dump_marks_what_is_not_the_factorys(tmp_path: Path) -> None:
    port = f"fake://barrett?initialized=1&state={tmp_path / 's.json'}"
    assert run("barrett", "set", "DP.F2=4321", "-p", port).code == 0
    with Terminal("barrett", "dump", "-p", port, columns=100) as terminal:
        assert terminal.finish() == 0
        (line,) = [line for line in terminal.text.split("\n") if "default_position" in line]
    assert "4321*" in line and line.count("*") == 1 and "8500/1575" in line
    assert SETTINGS["DP"][2] == (8500, 8500, 8500, 1575)


def test_an_interrupt_of_a_movement(sim: Simulator) -> None:
    assert run("barrett", "set", "MCV=20", "--force", "-p", sim.link).code == 0
    with Terminal("barrett", "close", "-p", sim.link) as terminal:
        terminal.until("moving")
        terminal.run_for(0.5)
        terminal.send("\x03")
        assert terminal.finish() == 130
        text = " ".join(terminal.text.split())
    told = re.findall(r"(?:F\d|SPREAD) (\d+)", text.partition("Positions")[2])
    assert len(told) == 4 and 300 < int(told[0]) < 15000, text
    now = [row["value"] for row in run("barrett", "get", "P", "-p", sim.link, "--json").rows]
    assert [abs(a - int(b)) <= 2 for a, b in zip(now, told, strict=True)] == [True] * 4


# -- the prompt -------------------------------------------------------------------------------------------------------


class Prompt(Terminal):
    """`handctl barrett gcl` with a prompt; `ask` types a line and waits for the next prompt."""

    def __init__(self, tmp_path: Path, port: str = READY, *more: str) -> None:
        super().__init__("barrett", "gcl", "-p", port, *more, env={"XDG_STATE_HOME": str(tmp_path)})
        self.process.setecho(True)
        self.until("=> ")
        self.run_for(0.1)

    def __enter__(self) -> Prompt:
        return self

    def ask(self, keys: str) -> str:
        """What came after the keys, up to the next prompt at the start of a line."""
        before = len(self.text)
        self.send(keys)
        end = time.monotonic() + 30
        while True:
            came = self.text[before:].replace("\r", "")
            if came.endswith("\n=> "):
                return came
            assert self._take(0.05), self.text
            assert time.monotonic() < end, self.text


def test_a_command_and_its_answer(tmp_path: Path) -> None:
    with Prompt(tmp_path) as prompt:
        assert "\n0 0 0 0\n" in prompt.ask("FGET P\r")
        assert "\nERR 32: Unknown command (32)\n" in prompt.ask("FOO\r")
        assert "\n5000 5000 0 0\n" in prompt.ask("12M 5000\r") + prompt.ask("fget p\r")
        answer = prompt.ask("1PGET TEMP\r")
        assert "4096" in answer and "prefix" in answer
        prompt.send("\x04")
        assert prompt.finish() == 0
        assert "Traceback" not in prompt.text


def test_help_beside_the_manual(tmp_path: Path) -> None:
    with Prompt(tmp_path) as prompt:
        answer = prompt.ask("?M\r")
        assert "M Move" in answer
        assert "0..20000" in answer and "§5.2.1" in answer
        prompt.send("\x04")
        assert prompt.finish() == 0


def test_what_it_does_not_carry(tmp_path: Path) -> None:
    """The prompt stays; the message names the command to use."""
    trace = tmp_path / "t.txt"
    with Prompt(tmp_path, READY, "--trace", str(trace)) as prompt:
        assert "handctl barrett baud" in " ".join(prompt.ask("PSET BAUD 384\r").split())
        assert "handctl barrett reset" in " ".join(prompt.ask("RESET\r").split())
        prompt.send("FSAVE\r")
        prompt.until("[y/N]")
        prompt.ask("n\r")
        assert "1042" in prompt.ask("PGET SN\r")
        prompt.send("\x04")
        assert prompt.finish() == 0
    assert sent_lines(trace) == ["PGET SN"]


def test_history_here_and_in_the_next_session(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    with Prompt(tmp_path, READY, "--trace", str(trace)) as prompt:
        prompt.ask("PGET SN\r")
        prompt.ask("VERS\r")
        prompt.ask("\x1b[A\x1b[A\r")
        prompt.send("\x04")
        assert prompt.finish() == 0
    assert sent_lines(trace) == ["PGET SN", "VERS", "PGET SN"]
    with Prompt(tmp_path, READY, "--trace", str(trace)) as prompt:
        prompt.ask("\x1b[A\r")
        prompt.send("\x04")
        assert prompt.finish() == 0
    assert sent_lines(trace) == ["PGET SN"]


@pytest.mark.parametrize(
    ("keys", "sent"),
    [
        ("HO\t\r", "HOME"),  # a command
        ("12HO\t\r", "12HOME"),  # behind a prefix
        ("pg\t te\t\r", "PGET TEMP"),  # a parameter
        ("FGET P LFAP\t\r", "FGET P LFAP"),
    ],
)
def test_completion(tmp_path: Path, keys: str, sent: str) -> None:
    trace = tmp_path / "t.txt"
    with Prompt(tmp_path, READY, "--trace", str(trace)) as prompt:
        prompt.ask(keys)
        prompt.send("\x04")
        assert prompt.finish() == 0
    (line,) = sent_lines(trace)
    assert " ".join(line.upper().split()) == sent


def test_ctrl_c_in_the_middle_of_a_movement_keeps_the_prompt(tmp_path: Path, sim: Simulator) -> None:
    with Prompt(tmp_path, sim.link) as prompt:
        prompt.ask("FSET MCV 20\r")
        prompt.send("GC\r")
        prompt.run_for(0.5)
        answer = prompt.ask("\x03")
        assert "stopped" in answer and "16384" in answer, answer
        (place,) = re.findall(r"\n(\d+) \d+ \d+ \d+\n", prompt.ask("FGET P\r"))
        assert 300 < int(place) < 15000
        prompt.send("\x04")
        assert prompt.finish() == 0
        assert "Traceback" not in prompt.text


def test_ctrl_c_at_the_prompt_drops_the_line(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    with Prompt(tmp_path, READY, "--trace", str(trace)) as prompt:
        prompt.send("FSET DP 1")
        prompt.run_for(0.1)
        prompt.ask("\x03")
        prompt.ask("VERS\r")
        prompt.send("\x04")
        assert prompt.finish() == 0
    assert sent_lines(trace) == ["VERS"]


def test_a_hand_that_is_unplugged_ends_the_prompt(tmp_path: Path, sim: Simulator) -> None:
    with Prompt(tmp_path, sim.link) as prompt:
        prompt.ask("VERS\r")
        sim.stop()
        prompt.send("VERS\r")
        assert prompt.finish() == 3
        assert "Traceback" not in prompt.text
