"""Whole-process measurements and the figures made of them."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HANDCTL = str(Path(sysconfig.get_path("scripts")) / "handctl")
PASS = [sys.executable, "-c", "pass"]
WIRE = "wire"
LONGEST = 200
"""Characters of an error in the table."""


@dataclass(frozen=True)
class Figure:
    """One measured value beside its floor or peer, `against`: `ratio` = value / floor, at most `goal` (None = only reported).

    `failed`: the measurement itself came to an error, and `note` says to which.
    """

    name: str
    value: float
    floor: float
    unit: str
    goal: float | None
    note: str = ""
    against: str = WIRE
    failed: bool = False

    @classmethod
    def failure(cls, part: str, exc: Exception) -> Figure:
        """The row of a part that could not be measured."""
        text = " ".join(f"{type(exc).__name__}: {exc}".split())
        return cls(part, 0.0, 0.0, "", None, text[:LONGEST], "", failed=True)

    @property
    def ratio(self) -> float:
        """value / floor."""
        return self.value / self.floor

    @property
    def met(self) -> bool:
        """Whether the goal is reached; figures without one always are."""
        return not self.failed and (self.goal is None or self.ratio <= self.goal)

    def as_row(self) -> dict[str, Any]:
        """For the JSON file; four significant digits are more than a run repeats."""
        if self.failed:
            return {
                "name": self.name, "value": None, "unit": None, "against": None, "floor": None, "ratio": None, "goal": None,
                "verdict": "failed", "note": self.note,
            }  # fmt: skip
        return {
            "name": self.name,
            "value": rounded(self.value),
            "unit": self.unit,
            "against": self.against,
            "floor": rounded(self.floor),
            "ratio": rounded(self.ratio),
            "goal": None if self.goal is None else rounded(self.goal),
            "verdict": "reported" if self.goal is None else "met" if self.met else "missed",
            "note": self.note,
        }


def rounded(value: float) -> float:
    """Four significant digits."""
    return float(f"{value:.4g}")


def environment() -> dict[str, str]:
    """This process's environment without what changes how Python or handctl start: both as a user has them."""
    return {name: text for name, text in os.environ.items() if not name.startswith(("PYTHON", "HANDCTL_"))}


def quickest(commands: Sequence[Sequence[str]], runs: int) -> list[float]:
    """Seconds of the quickest run of each command, run in turn: what else the machine does only ever adds."""
    for command in commands:
        once(command)
    times = [[once(command) for command in commands] for _ in range(runs)]
    return [min(column) for column in zip(*times, strict=True)]


def once(command: Sequence[str]) -> float:
    """Seconds of a command."""
    started = time.perf_counter()
    subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True,
        env=environment(),
    )  # fmt: skip
    return time.perf_counter() - started


def handctl(*args: str) -> str:
    """Standard output of a run."""
    done = subprocess.run(
        [HANDCTL, *args], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True, env=environment()
    )
    return done.stdout


def peak_kilobytes(command: Sequence[str]) -> int:
    """Peak resident memory of a command, in a child of its own (the figure is the largest of a process's children)."""
    code = (
        "import os, sys\n"
        "pid = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ,\n"
        "    file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)])\n"
        "print(os.wait4(pid, 0)[2].ru_maxrss, file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *command], capture_output=True, text=True, check=True, env=environment()
    )
    return int(done.stderr.split()[-1])


@contextmanager
def served(kind: str, *options: str) -> Iterator[str]:
    """A simulated device as a process of its own; yields its link."""
    command = [HANDCTL, "sim", kind, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment()) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["link"]
        finally:
            process.terminate()


Event = tuple[float, str, bytes]
"""A line of a trace: seconds, `>` or `<`, bytes."""


def traced(*args: str) -> list[Event]:
    """What a run sent and received, by its own trace."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.txt"
        handctl(*args, "--trace", str(trace))
        lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return [(float(words[0]), words[1], _bytes(words[2:])) for words in lines if words[1] in "<>"]


def _bytes(words: Sequence[str]) -> bytes:
    """The bytes of a line; of a CAN frame the data only."""
    return bytes.fromhex("".join(words[3:] if words[:1] == ["can"] else words))


def session_milliseconds(link: str, kind: str, transactions: int) -> float:
    """`dump`: time between the first byte sent and the last received. The number of transactions must be this."""
    events = traced(kind, "dump", "-p", link, "--json")
    sent = [when for when, mark, _ in events if mark == ">"]
    if len(sent) != transactions:
        raise SystemExit(f"{kind} dump: {len(sent)} transactions instead of {transactions}")
    return (max(when for when, mark, _ in events if mark == "<") - min(sent)) * 1000


def dump_figure(name: str, link: str, kind: str, transactions: int, floor: float, goal: float | None, runs: int,
                wire: str) -> Figure:  # fmt: skip
    """The median of so many dumps beside the time of their bytes in ms."""
    sessions = [session_milliseconds(link, kind, transactions) for _ in range(runs)]
    note = f"{wire}; median of {runs}, best {min(sessions):.2f} ms"
    return Figure(name, statistics.median(sessions), floor, "ms", goal, note)
