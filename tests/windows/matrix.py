"""Each command line on Linux and on Windows: exit code, both streams and the files that it wrote, compared byte for byte."""

from __future__ import annotations

import difflib
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tests.harm.lines import prepare
from tests.support.cli import Simulator
from tests.windows.excuses import excuse_for, masked
from tests.windows.lines import PARTS, Line
from tests.windows.systems import Ended, Linux, System, Windows, Worker, on_windows

EQUAL, EXCUSED, WRONG, LEFT = "equal", "differs, with a reason", "wrong", "not reached in time"
WITHIN = "simulator"
"""The part whose lines run in one process on each system."""
FIRST_COM = 10
"""COM ports below are those of the other parts."""

ROWS, SHOWN = 6, 240
"""How many rows of a difference are shown, and how much of each."""


class Cell(NamedTuple):
    """One line on both systems."""

    line: Line
    verdict: str
    reason: str = ""
    difference: tuple[str, ...] = ()


def compare(
    lines: Sequence[Line], linux: Linux, windows: Windows, root: Path, until: float, told: Callable[[Cell], None]
) -> list[Cell]:
    """All lines, each `told` as it ends; those that begin after `until` (time.monotonic) are not run.

    A row for each part, at the same time. Those on simulators in virtual time run in one process, the others as programs of their own.
    """
    made = root / "made"
    made.mkdir()
    prepare(made)
    workers = {system: Worker(system) for system in (linux, windows)}

    def cell(number: int, line: Line) -> Cell:
        if time.monotonic() > until:
            return Cell(line, LEFT)
        ended = []
        for system in (linux, windows):
            folder = system.scratch / str(number)
            shutil.copytree(made, folder)
            try:
                if line.part == WITHIN:
                    ended.append(common(workers[system].run(line.words, folder), folder, ""))
                else:
                    ended.append(once(system, line, folder, FIRST_COM + number))
            except (AssertionError, OSError, subprocess.SubprocessError) as exc:
                return Cell(line, WRONG, f"on {system.name}: {exc}")
        return judged(line, *ended)

    def row(numbered: Sequence[tuple[int, Line]]) -> list[tuple[int, Cell]]:
        found = []
        for number, line in numbered:
            found.append((number, cell(number, line)))
            told(found[-1][1])
        return found

    numbered = list(enumerate(lines))
    parts = [[one for one in numbered if one[1].part == part] for part in PARTS]  # a busy machine reaches some of each
    with ThreadPoolExecutor(len(parts)) as pool:
        rows = list(pool.map(row, parts))
    for worker in workers.values():
        worker.stop()
    return [one for _, one in sorted((pair for row in rows for pair in row), key=lambda pair: pair[0])]


def once(system: System, line: Line, folder: Path, number: int) -> Ended:
    """One line on one system as a program, over its simulator if it has one."""
    if not line.served:
        return common(system.run(line.words, folder), folder, "")
    begin = [sys.executable, "-m", "handctl", "sim"]
    with Simulator(*line.served[1:], "--seed", "1", kind=line.served[0], begin=begin) as simulator:
        link = simulator.link
        before, place, port = link.rpartition("/dev/pts/")
        if place and isinstance(system, Windows):
            link = before + system.com(number, place + port)
        words = [word.replace("{port}", link) for word in line.words]
        return common(system.run(words, folder), folder, link.removeprefix("can:slcan:"))


def common(ended: Ended, folder: Path, link: str) -> Ended:
    """What was written, with common words for the folder and the link, and without what differs from run to run."""

    def text(data: bytes) -> bytes:
        theirs = on_windows(folder)
        for name in (theirs.replace("\\", "\\\\"), theirs, str(folder)):
            data = data.replace(name.encode(), b"HERE")
        data = re.sub(rb"HERE[\w.\\-]+", lambda found: re.sub(rb"\\+", b"/", found[0]), data)
        if link:
            data = data.replace(link.encode(), b"LINK")
        return masked(data)

    return Ended(ended.code, text(ended.out), text(ended.err), {name: text(data) for name, data in ended.files.items()})


def judged(line: Line, linux: Ended, windows: Ended) -> Cell:
    """Equal, excused or wrong."""
    excuse = excuse_for(str(line))
    if line.live:
        linux, windows = counted(linux), counted(windows)
    if linux == windows:
        return Cell(line, WRONG, "equal: the written reason is not needed") if excuse else Cell(line, EQUAL)
    shown = tuple(differences(linux, windows))
    if excuse and windows.code == (linux.code if excuse.code is None else excuse.code):
        rest = tuple(differences(without(linux, excuse.text), without(windows._replace(code=linux.code), excuse.text)))
        return (
            Cell(line, WRONG, f"beside what is excused ({excuse.reason})", rest)
            if rest
            else Cell(line, EXCUSED, excuse.reason, shown)
        )
    return Cell(line, WRONG, "", shown)


def without(ended: Ended, text: re.Pattern[bytes]) -> Ended:
    """A run without what a reason is about."""
    files = {name: text.sub(b"", data) for name, data in ended.files.items()}
    return Ended(ended.code, text.sub(b"", ended.out), text.sub(b"", ended.err), files)


def counted(ended: Ended) -> Ended:
    """A run of which only the exit code, the number of lines and the names of its files are left."""

    def lines(data: bytes) -> bytes:
        return b"%d lines" % data.count(b"\n") + b" and CR" * (b"\r" in data)

    return Ended(ended.code, lines(ended.out), b"", dict.fromkeys(ended.files, b""))


def differences(linux: Ended, windows: Ended) -> list[str]:
    """The lines that differ, those of Linux with - and those of Windows with +."""
    found = [] if linux.code == windows.code else [f"exit code {linux.code} on Linux, {windows.code} on Windows"]
    pairs = {"stdout": (linux.out, windows.out), "stderr": (linux.err, windows.err)}
    pairs |= {
        name: (linux.files.get(name, b""), windows.files.get(name, b"")) for name in {**linux.files, **windows.files}
    }
    for name, (one, other) in pairs.items():
        if one == other:
            continue
        if one == other.replace(b"\r\n", b"\n"):
            found.append(f"{name}: lines end with CR LF")
            continue
        texts = [data.decode("utf-8", "backslashreplace").splitlines() for data in (one, other)]
        rows = [row for row in difflib.unified_diff(*texts, n=0, lineterm="") if row[:3] not in ("---", "+++", "@@ ")]
        found += [f"{name}: {row[:SHOWN]}" for row in rows[:ROWS] or ["the same words, other bytes"]]
    return found
