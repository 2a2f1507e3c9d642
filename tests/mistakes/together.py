"""Jobs in processes of their own, some at once: each is forked from here, so that what is imported here is there at once."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

PATIENCE = 60.0
"""Seconds that one child may take: a mistake that lets a test hang is a bad row, and is named."""

Outcomes = dict[str, Any]
Job = Callable[[], Outcomes]


def together(
    jobs: Sequence[tuple[str, Job]], most: int, folder: Path, patience: float = PATIENCE
) -> Iterator[tuple[str, Outcomes]]:
    """The result of each job, at most so many running at once, in the order in which they end."""
    left, running = list(reversed(jobs)), dict[int, tuple[str, float]]()
    try:
        while left or running:
            while left and len(running) < most:
                name, job = left.pop()
                running[_forked(job, folder / name)] = (name, time.monotonic())
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                _end_late(running, patience)
                time.sleep(0.002)
                continue
            name, began = running.pop(pid)
            try:
                yield name, json.loads((folder / name).read_text(encoding="utf-8"))
            except (OSError, ValueError):
                took = time.monotonic() - began
                yield name, {"broken": [f"its process ended after {took:.1f} s with status {status:#x}"]}
    finally:
        for pid in running:
            os.kill(pid, signal.SIGKILL)


def _end_late(running: dict[int, tuple[str, float]], patience: float) -> None:
    for pid, (_, began) in running.items():
        if time.monotonic() - began > patience:
            os.kill(pid, signal.SIGKILL)


def _forked(job: Job, result: Path) -> int:
    """Start it; what it prints goes nowhere, what it returns into a file."""
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        return pid
    try:
        nowhere = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(nowhere, number)
        began = time.monotonic()
        try:
            told = job()
        except BaseException:  # noqa: BLE001  whatever it is, the parent tells it
            told = {"broken": [traceback.format_exc().splitlines()[-1]]}
        result.write_text(json.dumps({**told, "seconds": time.monotonic() - began}), encoding="utf-8")
    finally:
        os._exit(0)
