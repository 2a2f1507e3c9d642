"""Whole-process measurements and the figures made of them."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HANDCTL = str(Path(sysconfig.get_path("scripts")) / "handctl")
PASS = [sys.executable, "-c", "pass"]


@dataclass(frozen=True)
class Figure:
    """One measured value beside its floor: `ratio` = value / floor, to be at most `goal` (None = only reported)."""

    name: str
    value: float
    floor: float
    unit: str
    goal: float | None
    note: str = ""

    @property
    def ratio(self) -> float:
        """value / floor."""
        return self.value / self.floor

    @property
    def met(self) -> bool:
        """Whether the goal is reached; figures without one always are."""
        return self.goal is None or self.ratio <= self.goal

    def line(self) -> str:
        """One line for people."""
        goal = "" if self.goal is None else f"  goal {self.goal:g}  {'ok' if self.met else 'MISSED'}"
        return (
            f"{self.name:<44} {self.value:10.2f} {self.unit:<4} floor {self.floor:10.2f}  ratio {self.ratio:6.2f}{goal}"
            f"{f'  ({self.note})' if self.note else ''}"
        )

    def as_row(self) -> dict[str, Any]:
        """For the JSON file."""
        row = {"name": self.name, "value": self.value, "floor": self.floor, "unit": self.unit, "ratio": self.ratio}
        return {**row, "goal": self.goal, "met": self.met, "note": self.note}


def pair(command: Sequence[str], floor: Sequence[str], runs: int) -> tuple[float, float, float]:
    """Median seconds of both commands, run in turn, and the median of the ratios pair by pair."""
    _once(command)
    _once(floor)
    pairs = [(_once(command), _once(floor)) for _ in range(runs)]
    return (
        statistics.median(a for a, _ in pairs),
        statistics.median(b for _, b in pairs),
        statistics.median(a / b for a, b in pairs),
    )


def _once(command: Sequence[str]) -> float:
    started = time.perf_counter()
    subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    return time.perf_counter() - started


def peak_kilobytes(command: Sequence[str]) -> int:
    """Peak resident memory of a command, in a child of its own (the figure is the largest of a process's children)."""
    code = (
        "import os, sys\n"
        "pid = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ,\n"
        "    file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)])\n"
        "print(os.wait4(pid, 0)[2].ru_maxrss, file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *command], capture_output=True, text=True, check=True, env=os.environ
    )
    return int(done.stderr.split()[-1])
