"""A hand that goes on behind ^C and T: whatever ends a command that drives it looks, and none tells that it stands."""

from __future__ import annotations

import signal
from contextlib import nullcontext
from pathlib import Path

import pytest

from handctl.sim.barrett.mechanics import Hand
from handctl.sim.barrett.realtime_loop import Loop
from tests.barrett.commands import fake
from tests.support.cli import Result, run
from tests.support.each_row import each_row
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
    monkeypatch.setattr(Hand, "terminate", lambda _hand, _motors: 0)


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
