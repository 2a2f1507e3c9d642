"""What a person sees of a BarrettHand: tables, and the GCL prompt with its keys, at a terminal; its keys on a real one."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest

from tests.barrett.commands import POWER_ON, SETTINGS, STATUS, sent_lines
from tests.support.cli import PATIENCE, Simulator, run, wait_until
from tests.support.each_row import each_row
from tests.support.person import person, pressed_at
from tests.support.screen import Screen, screen
from tests.support.terminal import Terminal

READY = "fake://barrett?initialized=1&clock=virtual"


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with Simulator("--pty", "--set", "initialized=1", kind="barrett") as simulator:
        yield simulator


# -- tables -----------------------------------------------------------------------------------------------------------


STROKES = {104233: "5956", 98712: "5640", 110003: "6285", 20117: "6489"}
"""Odometer in 1000 counts -> strokes: / 17.5 for a finger, / 3.1 for the spread (barrett §7.3)."""


@each_row("verb, columns", product(("dump", "status"), (40, 80, 200)))
def test_tables_at_any_width(verb: str, columns: int) -> None:
    """No line is wider than the terminal, no value and no mnemonic is cut, folded or left out. From 80 on it is a table."""
    shown = screen("barrett", verb, "-p", READY, columns=columns)
    assert shown.code == 0
    lines = shown.lines
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
    shown = screen("barrett", "status", "-p", "fake://barrett?fault=unknown-codes&clock=virtual")
    assert shown.code == 0
    text = shown.text.rstrip("\n")
    assert len(text.split("\n")) <= 24 and text.split("\n")[0].rstrip() == shown.display[0], "it scrolled"
    joined = " ".join(text.split())
    assert "41.2 °C" in joined and "1042" in joined and "4.33" in joined
    assert "Motor not initialized (4)" in joined and "(not used) (512)" in joined


def test_dump_marks_what_is_not_the_factorys(tmp_path: Path) -> None:
    port = f"{READY}&state={tmp_path / 's.json'}"
    assert run("barrett", "set", "DP.F2=4321", "-p", port).code == 0
    (line,) = [line for line in screen("barrett", "dump", "-p", port, columns=100).lines if "default_position" in line]
    assert "4321*" in line and line.count("*") == 1 and "8500/1575" in line
    assert SETTINGS["DP"][2] == (8500, 8500, 8500, 1575)


def moving(port: str) -> None:
    """Slow motors: the fingers take seconds."""
    assert run("barrett", "set", "MCV=20", "--force", "-p", port).code == 0


def test_an_interrupt_of_a_movement(tmp_path: Path) -> None:
    port = f"{READY}&state={tmp_path / 'state'}"
    moving(port)
    with pressed_at(1.0):
        shown = person("barrett", "close", "-p", port)
    text = " ".join(shown.text.split())
    assert shown.code == 130, text
    told = re.findall(r"(?:F\d|SPREAD) (\d+)", text.partition("Positions")[2])
    assert len(told) == 4 and 300 < int(told[0]) < 15000, text
    now = [row["value"] for row in run("barrett", "get", "P", "-p", port, "--json").rows]
    assert [abs(a - int(b)) <= 2 for a, b in zip(now, told, strict=True)] == [True] * 4


# -- the prompt -------------------------------------------------------------------------------------------------------


def prompt(*typed: str, port: str = READY, more: tuple[str | Path, ...] = ()) -> Screen:
    """`handctl barrett gcl` with a prompt, and what a person types there; then Ctrl-D."""
    shown = person("barrett", "gcl", "-p", port, *more, answers=typed)
    assert "Traceback" not in shown.text
    return shown


def test_commands_and_their_answers() -> None:
    shown = prompt("FGET P", "FOO", "12M 5000", "fget p", "1PGET TEMP", "?M")
    assert shown.code == 0
    _, asked, unknown, moved, where, prefix, explained, _ = shown.text.split("=> ")
    assert asked.endswith("\n0 0 0 0\n")
    assert unknown.endswith("\nERR 32: Unknown command (32)\n")
    assert (moved + where).endswith("\n5000 5000 0 0\n")
    assert "4096" in prefix and "prefix" in prefix
    assert "M Move" in explained and "0..20000" in explained and "§5.2.1" in explained


def test_what_it_does_not_carry(tmp_path: Path) -> None:
    """The prompt stays; the message names the command to use."""
    trace = tmp_path / "t.txt"
    shown = prompt("PSET BAUD 384", "RESET", "FSAVE", "n", "PGET SN", more=("--trace", trace))
    assert shown.code == 0
    _, speed, reset, save, serial, _ = shown.text.split("=> ")
    assert "handctl barrett baud" in " ".join(speed.split())
    assert "handctl barrett reset" in " ".join(reset.split())
    assert "[y/N] n\n" in save and serial.endswith("\n1042\n")
    assert sent_lines(trace) == ["PGET SN"]


def test_ctrl_c_in_the_middle_of_a_movement_keeps_the_prompt() -> None:
    with pressed_at(1.0):
        shown = prompt("FSET MCV 20", "GC", "FGET P", more=("--force",))
    assert shown.code == 0
    _, _, moved, where, _ = shown.text.split("=> ")
    assert "stopped" in moved and "16384" in moved, moved
    (place,) = re.findall(r"\n(\d+) \d+ \d+ \d+\n", where)
    assert 300 < int(place) < 15000


class Prompt(Terminal):
    """The prompt on a real terminal, with its keys; `ask` types a line and waits for the next prompt."""

    def __init__(self, folder: Path, port: str, *more: str | Path) -> None:
        super().__init__("barrett", "gcl", "-p", port, *more, env={"XDG_STATE_HOME": str(folder)})
        self.process.setecho(True)
        self.until("=> ")

    def __enter__(self) -> Prompt:
        return self

    def ask(self, keys: str) -> str:
        """What came after the keys, up to the next prompt at the start of a line."""
        before = len(self.text)
        self.send(keys)
        end = time.monotonic() + PATIENCE
        while True:
            came = self.text[before:].replace("\r", "")
            if came.endswith("\n=> "):
                return came
            assert self._take(0.05), self.text
            assert time.monotonic() < end, self.text


@pytest.mark.real
def test_keys_of_a_real_terminal_and_a_port_that_goes(tmp_path: Path) -> None:
    """History, here and in the next session; TAB for a command, behind a prefix and for parameters; Ctrl-C drops the line."""
    trace = tmp_path / "t.txt"
    with Simulator("--pty", "--set", "initialized=1", kind="barrett") as sim:
        with Prompt(tmp_path, sim.link, "--force", "--trace", trace) as prompt:
            for keys in ("PGET SN\r", "VERS\r", "\x1b[A\x1b[A\r", "12HO\t\r", "pg\t te\t\r", "FGET P LFAP\t\r"):
                prompt.ask(keys)
            prompt.ask("FSET MCV 20\r")
            prompt.send("GC\r")
            wait_until(lambda: sent_lines(trace)[-1] == "GC")
            assert "16384" in prompt.ask("\x03")
            prompt.send("\x04")
            assert prompt.finish() == 0
            assert "Traceback" not in prompt.text
        sent = [words for line in sent_lines(trace) if (words := " ".join(line.upper().split())) != "FGET P"]
        keyed = ["PGET SN", "VERS", "PGET SN", "12HOME", "PGET TEMP", "FGET P LFAP", "FSET MCV 20", "GC"]
        assert sent[: len(keyed)] == keyed
        with Prompt(tmp_path, sim.link, "--force", "--trace", trace) as prompt:
            prompt.ask("\x1b[A\x1b[A\r")
            prompt.send("FSET DP 1")
            prompt.until("FSET DP 1")
            prompt.ask("\x03")
            sim.stop()
            prompt.send("VERS\r")
            assert prompt.finish() == 3
            assert "Traceback" not in prompt.text
        assert sent_lines(trace)[0] == "FSET MCV 20" and "FSET DP 1" not in "".join(sent_lines(trace))
