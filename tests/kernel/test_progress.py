"""Progress on a narrow terminal: one line that is replaced, with the safety words whole, in every family."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pyte
import pytest

from handctl.families import FAMILIES
from tests.support.each_row import each_row
from tests.support.person import person
from tests.support.screen import ANSI
from tests.support.terminal import Terminal

WIDTH = 40


def fake(family: str, **options: str) -> str:
    return f"fake://{family}?" + "&".join(["clock=virtual", *(f"{name}={value}" for name, value in options.items())])


STOPS = "Ctrl-C stops."
MOVEMENTS = {
    "aidin home": (("aidin", "home", "-p", fake("aidin", start="homed"), "-y"), STOPS, "of 3.5 s"),
    "aidin initial": (("aidin", "initial", "-p", fake("aidin", start="homed"), "-y"), STOPS, "Moving"),
    "barrett close": (("barrett", "close", "-p", fake("barrett", initialized="1"), "-y"), STOPS, "C: moving"),
    "exo position": (("exo", "position", "--wait", "3", "500", "500", "500", "500", "500", "-p", fake("exo"), "-y"), STOPS, " s  little"),
    "exo calibrate": (
        ("exo", "calibrate", "-p", fake("exo", calibration="1.5"), "-y"),
        "Ctrl-C does not stop the hand. To stop it, switch its power off.",
        "calibrating",
    ),
    "wrist move": (("wrist", "move", "--pitch", "10", "--time", "900", "-p", fake("wrist"), "-y"), STOPS, "pitch"),
    "hand angle": (("hand", "angle", "--wait", "3", "500", "500", "500", "500", "500", "500", "-p", fake("hand"), "-y"), STOPS, " s  "),
    "ekso log": (("ekso", "log", "FILE", "--duration", "1.5", "-p", "fake://ekso"), "Ctrl-C ends the log.", "rows"),
}  # fmt: skip
"""Command, safety words, and a word of the progress itself."""


def test_every_family_stands_here() -> None:
    assert {name.split()[0] for name in MOVEMENTS} == set(FAMILIES)


@each_row("name", [name for name in MOVEMENTS if name != "ekso log"])
def test_progress_is_one_line(name: str) -> None:
    args, safety, word = MOVEMENTS[name]
    seen = person(*args, columns=WIDTH)
    assert seen.code == 0
    judge(seen.data, safety, word)


@pytest.mark.real
def test_progress_of_a_log_is_one_line(tmp_path: Path) -> None:
    """On virtual time its stream has no pauses."""
    args, safety, word = MOVEMENTS["ekso log"]
    with Terminal(*(tmp_path / "log.csv" if one == "FILE" else one for one in args), columns=WIDTH) as terminal:
        assert terminal.finish() == 0
    judge(terminal.data.decode().replace("\r\n", "\n"), safety, word)


def judge(data: str, safety: str, word: str) -> None:
    text = ANSI.sub("", data)
    assert re.sub(r"\W+", " ", safety) in re.sub(r"\W+", " ", text), text
    pieces = [piece for line in text.split("\n") if "\r" in line for piece in line.split("\r")]
    shown = [piece for piece in pieces if word in piece]
    assert shown, text
    assert max(map(len, pieces)) < WIDTH, max(pieces, key=len)
    assert all(one.rstrip() != other.rstrip() for one, other in pairwise(shown)), shown
    window = pyte.Screen(WIDTH, 24)
    stream = pyte.Stream(window)
    for piece in re.findall(r"[^\r\n]+|[\r\n]", data):
        stream.feed(piece.replace("\n", "\r\n"))
        if piece == "\r":
            continue  # nothing is another in the window
        rows = [line for line in window.display if word in line and "next:" not in line]
        assert len(rows) <= 1, rows
