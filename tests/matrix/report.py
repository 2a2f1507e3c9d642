"""The summary of the fault matrix: every command line that a test marked `faults` ran, by device and wire.

Knows pytest's hooks and `handctl.cli.main`, no device. Each run of a command is a cell: a line of arguments, its exit
code, its time. Cells travel with the reports of their tests, so that the summary is whole under pytest-xdist as well.
HANDCTL_MATRIX=FILE writes the summary and every cell as JSON.
"""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any
from unittest import mock

import pytest

from handctl import cli
from handctl.families import FAMILIES

HANG_SECONDS = 20.0
"""A command that has not ended by then is stopped and counted as a hang; the tests' own bounds are tighter."""
AGAIN = 5.0
BUSY = 3.0
PROPERTY = "handctl-cells"
DEVICES = tuple(FAMILIES)
CODES = (0, 2, 3, 4, 5, 6, 7, 8)
JUDGES = ("truthful", "complete", "harmless")
"""Functions of the tests that compare values: a test that fails there has seen a wrong one."""

Cell = dict[str, Any]


class Hang(BaseException):
    """A command that does not end. Not an Exception: handctl must not take it for one of its own."""


class Recorder:
    """The cells of the test that is running."""

    def __init__(self) -> None:
        self.cells: list[Cell] = []
        self.fault: str | None = None
        self.again = 0
        """Cells tried a second time, as a test may that runs on a busy machine; the table tells how many were."""

    def note(self, args: Sequence[str], code: int | None, seconds: float, *, traceback: bool, program: bool) -> None:
        """Remember a command line; `code` None: it did not end."""
        link = _link(args)
        own = "fake://" not in link or link.startswith("fake://bus")
        fault = self.fault if own else ",".join(re.findall(r"[?&]fault=([^&]*)", link))
        self.cells.append({
            "device": args[0], "wire": wire_of(link), "fault": fault or "healthy", "command": args[1] if args[1:] else "",
            "code": code, "seconds": round(seconds, 4), "traceback": traceback, "program": program,
        })  # fmt: skip


RECORDER = Recorder()


def _link(args: Sequence[str]) -> str:
    """What was given as --port."""
    for option, value in pairwise(args):
        if option in ("-p", "--port"):
            return value
    return ""


def wire_of(link: str) -> str:
    """How the device was reached, in words."""
    match link.partition(":")[0]:
        case "fake" if link.startswith("fake://bus"):
            return f"bus, {Path(link.partition('file=')[2].partition('&')[0]).stem}"
        case "fake":
            return "in process, CAN" if "bus=can" in link else "in process"
        case "can":
            return "slcan over TCP" if "socket://" in link else "slcan over pty"
        case "tcp":
            return "TCP"
        case _:
            return "pty" if link.startswith("/dev/") else "no device"


@contextmanager
def bounded(seconds: float, what: str = "") -> Iterator[None]:
    """Raise Hang in this process when the block takes longer, and again every `AGAIN` s: something may have caught it.

    Where others keep the machine busy, until it has had so much of a processor, but at most `BUSY` times as long.
    A thread calls, not SIGALRM: handctl uses the system's one alarm itself and switches it off.
    """
    over, caller = threading.Event(), threading.get_ident()

    def stop(number: int, frame: FrameType | None) -> None:
        if not over.is_set():
            raise Hang(f"no end within {seconds:g} s{what and f': {what}'}")

    began, used = time.monotonic(), time.process_time()

    def watch() -> None:
        wait = seconds
        while not over.wait(wait):
            left = began + BUSY * seconds - time.monotonic()
            wait = min(left, used + seconds - time.process_time())
            if wait <= 0:
                signal.pthread_kill(caller, signal.SIGUSR2)
                wait = AGAIN

    old = signal.signal(signal.SIGUSR2, stop)
    watcher = threading.Thread(target=watch, name="bound", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()
        signal.signal(signal.SIGUSR2, old)


@contextmanager
def recording() -> Iterator[list[Cell]]:
    """Collect the cells of one test; handctl runs as ever, but not for ever."""
    main = cli.main
    RECORDER.cells, RECORDER.fault, RECORDER.again = [], None, 0

    def observed(args: Sequence[str] | None = None) -> int:
        words, began, code = list(args or ()), time.monotonic(), None
        try:
            with bounded(HANG_SECONDS):
                code = main(args)
        except Hang as exc:
            raise AssertionError(f"handctl {' '.join(words)}: {exc}") from None
        finally:
            RECORDER.note(words, code, time.monotonic() - began, traceback=_traceback(code), program=False)
        return code

    with mock.patch.object(cli, "main", observed):
        yield RECORDER.cells


def _traceback(code: int | None) -> bool:
    """Whether the command that just ended failed by a bug of its own; looks at the stderr that the test captures."""
    sys.stderr.flush()
    buffer = getattr(sys.stderr, "buffer", None)
    text = buffer.getvalue() if hasattr(buffer, "getvalue") else b""
    return code == 1 or b"Traceback" in text


# -- pytest -----------------------------------------------------------------------------------------------------------


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Cells of a fault test go with its report."""
    if item.get_closest_marker("faults") is None:
        return (yield)
    with recording() as cells:
        try:
            return (yield)
        finally:
            item.user_properties += [(PROPERTY, cells), ("handctl-again", RECORDER.again)]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[pytest.TestReport]:
    """A failed fault test says whether it was a value that was wrong."""
    report = yield
    if call.when == "call" and call.excinfo is not None and item.get_closest_marker("faults") is not None:
        wrong = any(entry.name in JUDGES for entry in call.excinfo.traceback)
        report.user_properties = [*report.user_properties, ("handctl-failure", "value" if wrong else "outcome")]
    return report  # type: ignore[no-any-return]


class Summary:
    """All cells of a session."""

    def __init__(self) -> None:
        self.cells: list[Cell] = []
        self.tests = self.again = 0
        self.failed: Counter[str] = Counter()

    def add(self, report: pytest.TestReport) -> None:
        """Take a report; those of other tests carry nothing."""
        properties = dict(report.user_properties)
        if report.when != "call" or PROPERTY not in properties:
            return
        self.tests += 1
        self.again += properties["handctl-again"]
        if report.failed:
            self.failed[properties.get("handctl-failure", "outcome")] += 1
        for cell in properties[PROPERTY]:
            self.cells.append({**cell, "test": report.nodeid, "passed": report.passed})

    def rows(self) -> list[dict[str, Any]]:
        """One row per device and wire, in order, and the sum."""
        places: dict[tuple[str, str], list[Cell]] = {}
        for cell in self.cells:
            places.setdefault((cell["device"], cell["wire"]), []).append(cell)
        order = sorted(places, key=lambda place: (_rank(place[0]), place[1]))
        return [row(device, wire, places[device, wire]) for device, wire in order] + [row("all", "", self.cells)]

    def document(self) -> dict[str, Any]:
        """What goes into the JSON file."""
        return {
            "tests": self.tests, "tried_twice": self.again, "failed": sum(self.failed.values()), "wrong_values": self.failed["value"],
            "wrong_outcomes": self.failed["outcome"], "hangs": sum(cell["code"] is None for cell in self.cells),
            "tracebacks": sum(cell["traceback"] for cell in self.cells), "rows": self.rows(), "cells": self.cells,
        }  # fmt: skip


def _rank(device: str) -> int:
    return DEVICES.index(device) if device in DEVICES else len(DEVICES)


def row(device: str, wire: str, cells: Sequence[Cell]) -> dict[str, Any]:
    """Counts over some cells."""
    codes = Counter(cell["code"] for cell in cells)
    return {
        "device": device, "wire": wire, "cells": len(cells), "faults": len({cell["fault"] for cell in cells}),
        "commands": len({cell["command"] for cell in cells}), "codes": {str(k): v for k, v in codes.items()},
        "programs": sum(cell["program"] for cell in cells), "in_failed_tests": sum(not cell["passed"] for cell in cells),
        "hangs": codes[None], "tracebacks": sum(cell["traceback"] for cell in cells),
        "longest": max((cell["seconds"] for cell in cells), default=0.0),
    }  # fmt: skip


SUMMARY = Summary()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect; under xdist this runs in the process that has the terminal, too."""
    SUMMARY.add(report)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """The table, and the JSON file where one is asked for."""
    if not SUMMARY.cells:
        return
    document = SUMMARY.document()
    terminalreporter.write_sep("-", "fault matrix")
    for text in table(document):
        terminalreporter.write_line(text)
    if target := os.environ.get("HANDCTL_MATRIX"):
        Path(target).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        terminalreporter.write_line(f"written to {target}")


def table(document: dict[str, Any]) -> list[str]:
    """The summary as lines of text: exit codes across, devices and wires down."""
    used = [code for code in CODES if any(str(code) in row["codes"] for row in document["rows"])]
    heads = ["device", "wire", "cells", "faults", "verbs", *(f"exit {code}" for code in used), "other", "hangs",
             "tracebacks", "in failed tests", "longest"]  # fmt: skip
    lines = [heads]
    for entry in document["rows"]:
        counts = [entry["codes"].get(str(code), 0) for code in used]
        other = entry["cells"] - sum(counts) - entry["hangs"]
        numbers = [entry["cells"], entry["faults"], entry["commands"], *counts, other, entry["hangs"],
                   entry["tracebacks"], entry["in_failed_tests"], f"{entry['longest']:.2f} s"]  # fmt: skip
        lines.append([entry["device"], entry["wire"], *map(str, numbers)])
    widths = [max(len(line[column]) for line in lines) for column in range(len(heads))]
    text = ["  ".join(word.ljust(width) if column < 2 else word.rjust(width)
                      for column, (word, width) in enumerate(zip(line, widths, strict=True))).rstrip() for line in lines]  # fmt: skip
    total = document["rows"][-1]
    return [
        *text,
        f"{total['cells']} cells in {document['tests']} tests, {total['programs']} of them as programs: "
        f"{document['wrong_values']} wrong values, {document['wrong_outcomes']} other wrong outcomes, "
        f"{document['hangs']} hangs, {document['tracebacks']} tracebacks; {document['tried_twice']} tried twice",
    ]
