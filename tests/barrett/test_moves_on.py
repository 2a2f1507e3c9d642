"""A hand that goes on behind ^C and T: whatever ends a command that drives it looks, and none tells that it stands."""

from __future__ import annotations

import signal
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from handctl.sim.barrett.device import Device
from handctl.sim.barrett.mechanics import Hand
from handctl.sim.barrett.realtime_loop import Loop
from tests.barrett.commands import fake
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.odd_barrett import odd, replaced
from tests.support.person import pressed_at

LOOP = ("realtime", "--motors", "1", "--velocity", "5", "--receive", "position")


def runaway(monkeypatch: pytest.MonkeyPatch) -> None:
    """F1 goes on, whatever it is told: it takes no velocity of 0, no ^C and no T."""
    act, stop = Loop._act, Hand.stop

    def acted(loop: Loop) -> None:
        if any(loop._block):
            act(loop)

    def stopped(hand: Hand, *code: int) -> None:
        stop(hand, *code)
        hand.motors[0].cruise(hand.now, 900.0)

    monkeypatch.setattr(Loop, "_act", acted)
    monkeypatch.setattr(Hand, "stop", stopped)
    monkeypatch.setattr(Hand, "terminate", lambda hand, _motors: hand.motors[0].cruise(hand.now, 900.0) or 0)


def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """F1 goes on behind the prompt of a movement, and behind ^C; it obeys T."""
    check = Device._check_movement

    def checked(device: Device) -> None:
        before = device.hand.movement
        check(device)
        if before is not None and device.hand.movement is None and not before.code:
            device.hand.motors[0].cruise(device.hand.now, -900.0)

    monkeypatch.setattr(Device, "_check_movement", checked)


def ended(way: str, words: tuple[str, ...], folder: Path) -> Result:
    """The command, with its own end, with --deadline, or with Ctrl-C."""
    more = {"deadline": ("--deadline", "0.5"), "own": (), "ctrl-c": ()}[way]
    with pressed_at(0.6, signal.SIGINT) if way == "ctrl-c" else nullcontext():
        return run("barrett", *words, *more, "-p", fake(wire="auto"), "--json", "--trace", folder / "trace.txt")


def looks(folder: Path) -> int:
    """How often the positions were read behind the last ^C."""
    lines = [line.split(" > ")[-1] for line in (folder / "trace.txt").read_text(encoding="utf-8").splitlines() if " > " in line]  # fmt: skip
    last = max(place for place, line in enumerate(lines) if line.endswith("03"))
    return sum(bytes.fromhex(line.replace(" ", "")).startswith(b"FGET P") for line in lines[last:])


WAYS = [
    ("own", (*LOOP, "--duration", "0.5"), 0),
    ("own", (*LOOP, "--duration", "0.5", "--hold"), 0),
    ("own", (*LOOP, "--measure", "20"), 0),
    ("own", (*LOOP, "--until", "P.F1 > 100"), 0),
    ("own", (*LOOP, "--duration", "0.5", "--log", "{}/loop.csv"), 0),
    ("ctrl-c", LOOP, 130),
    ("ctrl-c", (*LOOP, "--measure", "400"), 130),
    ("deadline", LOOP, 4),
    ("deadline", ("close", "--motors", "G"), 4),
    ("ctrl-c", ("close", "--motors", "G"), 130),
    ("deadline", ("gcl", "GC"), 4),
    ("ctrl-c", ("gcl", "GC"), 130),
    ("ctrl-c", ("terminal", "GC", "--yes"), 130),
    ("deadline", ("terminal", "GC", "--yes"), 5),
    ("own", ("terminal", "GC", "--yes", "--wait", "0.03"), 5),
    ("own", ("stop",), 0),
    ("own", ("stop", "--motors", "1"), 0),
]


@each_row("way, words, code", WAYS)
def test_a_hand_that_stands_is_seen_to(way: str, words: tuple[str, ...], code: int, tmp_path: Path) -> None:
    result = ended(way, tuple(word.format(tmp_path) for word in words), tmp_path)
    assert result.code == code, result
    assert looks(tmp_path) >= 2


@each_row("way, words, code", WAYS)
def test_a_hand_that_moves_on_is_no_success(
    way: str, words: tuple[str, ...], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 6, whatever has ended the command, and motor power off is among what was sent."""
    runaway(monkeypatch)
    result = ended(way, tuple(word.format(tmp_path) for word in words), tmp_path)
    assert result.code == 6, result
    assert "54 0D" in (tmp_path / "trace.txt").read_text(encoding="utf-8")


@each_row("words, off", [(("stop",), "54 0D"), (("stop", "--motors", "1"), "31 54 0D"), (("stop", "--motors", "123S"), "31 32 33 34 54 0D")])  # fmt: skip
def test_the_whole_stop_goes_out_once_more(
    words: tuple[str, ...], off: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also with --motors, and also where it is the stop of this command and not the one of `handctl stop`."""
    runaway(monkeypatch)
    result = ended("own", words, tmp_path)
    lines = (tmp_path / "trace.txt").read_text(encoding="utf-8").splitlines()
    sent = [line.split(" > ")[-1] for line in lines if " > " in line]
    assert result.code == 6 and [line for line in sent if line in ("03", off)] == ["03", off, "03", off], sent


UNREADABLE: list[tuple[dict[str, Any], int]] = [
    ({"P": "----"}, 5),
    ({"without": "P"}, 5),
    ({"every": replaced(b"\n\r0 0 0 0", b"\n\r0 0 0")}, 5),
    ({"every": replaced(b"\n\r0 0 0 0", b"\n\rP 0 0 0 0")}, 5),
]
"""Hands whose positions say nothing, as a missing finger, an older firmware or a limit of the temperature may have it."""


@each_row("how, code", UNREADABLE)
@each_row("words, off", [(("stop",), "54 0D"), (("stop", "--motors", "1"), "31 54 0D")])
def test_a_stop_without_readable_positions_is_no_success(
    words: tuple[str, ...], off: str, how: dict[str, Any], code: int, tmp_path: Path
) -> None:
    """^C and T were acknowledged: whether it stands still is not known (handctl-stopping(7))."""
    with odd(**how):
        result = ended("own", words, tmp_path)
    assert result.code == code, result
    assert (tmp_path / "trace.txt").read_text(encoding="utf-8").count(f" > {off}\n") == 1


@each_row("words", [("gcl", "GC"), ("gcl", "GC", "GO"), ("close", "--motors", "G"), ("move", "F1=3000", "F2=6000")])
def test_a_prompt_that_comes_before_the_end_ends_the_command(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guide promises it of every movement: what still moves behind its prompt is stopped, and no further movement is sent."""
    at_once(monkeypatch)
    result = ended("own", words, tmp_path)
    lines = (tmp_path / "trace.txt").read_text(encoding="utf-8").splitlines()
    sent = [bytes.fromhex(line.split(" > ")[-1].replace(" ", "")) for line in lines if " > " in line]
    assert result.code == 6 and sent[-1].startswith(b"FGET P"), (result, sent)
    last = max(place for place, data in enumerate(sent) if data == b"\x03")
    assert last > max(place for place, data in enumerate(sent) if data.split(b"\r")[0].split()[0][-1:] in (b"C", b"M"))
    assert b"GO\r" not in sent and not any(data.startswith(b"2M") for data in sent)


@each_row("words, how", [
    (("gcl", "GC"), {"P": "----"}), (("gcl", "GC"), {"without": "P"}), (("close", "--motors", "G"), {"without": "P"})
])  # fmt: skip
def test_a_movement_whose_end_cannot_be_seen_is_stopped(
    words: tuple[str, ...], how: dict[str, Any], tmp_path: Path
) -> None:
    """Its prompt alone is no sign that it stands still."""
    with odd(**how):
        result = ended("own", words, tmp_path)
    assert result.code == 5 and "54 0D" in (tmp_path / "trace.txt").read_text(encoding="utf-8"), result
