"""The table of the harm matrix: device and state down, family of the command across. A plugin of pytest, see conftest."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

PROPERTY = "handctl-harm"
Row = dict[str, Any]


class Table:
    """The cells of a session; they travel with the reports of their tests."""

    def __init__(self) -> None:
        self.rows: list[Row] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect; under xdist in the process that has the terminal."""
        if report.when == "call":
            self.rows += [row for name, rows in report.user_properties if name == PROPERTY for row in rows]

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """The table, and the cells as JSON where HANDCTL_HARM names a file."""
        if not self.rows:
            return
        terminalreporter.write_sep("-", "harm matrix")
        for text in lines(self.rows):
            terminalreporter.write_line(text)
        if target := os.environ.get("HANDCTL_HARM"):
            Path(target).write_text(json.dumps(self.rows, indent=1) + "\n", encoding="utf-8")


def lines(rows: Sequence[Row]) -> list[str]:
    """Cells and harmed cells by state and family, exit codes by state, the exceptions, and the sum."""
    families = sorted({row["family"] for row in rows}, key=lambda name: (name == "", name))
    table = [["device and state", *(name or "tools" for name in families), "harmed", "excused", "exit codes"]]
    for state in dict.fromkeys(row["state"] for row in rows):
        of_state = [row for row in rows if row["state"] == state]
        counts = [_count([row for row in of_state if row["family"] == name]) for name in families]
        codes = Counter(row["code"] for row in of_state)
        table.append([
            state, *counts, str(sum(bool(row["harm"]) for row in of_state)), str(sum(bool(row["excused"]) for row in of_state)),
            " ".join(f"{code}:{codes[code]}" for code in sorted(codes, key=str)),
        ])  # fmt: skip
    widths = [max(len(line[column]) for line in table) for column in range(len(table[0]))]
    text = ["  ".join(word.ljust(width) for word, width in zip(line, widths, strict=True)).rstrip() for line in table]
    excused = Counter(row["excused"] for row in rows if row["excused"])
    text += [f"excused: {why}: {count}" for why, count in excused.items()]
    harmed = sum(bool(row["harm"]) for row in rows)
    return [*text, f"{len(rows)} cells of {len({row['line'] for row in rows})} command lines, {harmed} harmed"]


def _count(rows: Sequence[Row]) -> str:
    """``40``, or ``40 (3 harmed)``."""
    harmed = sum(bool(row["harm"]) for row in rows)
    return f"{len(rows)} ({harmed} harmed)" if harmed else str(len(rows))
