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
    """The cells of a session; they travel with the reports of their tests, under `name`. HANDCTL_… names a file for them."""

    def __init__(
        self, name: str = PROPERTY, title: str = "harm matrix", first: str = "device and state", word: str = "harmed",
        variable: str = "HANDCTL_HARM",
    ) -> None:  # fmt: skip
        self.rows: list[Row] = []
        self.name, self.title, self.first, self.word, self.variable = name, title, first, word, variable

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect; under xdist in the process that has the terminal."""
        if report.when == "call":
            self.rows += [row for name, rows in report.user_properties if name == self.name for row in rows]

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """The table, and the cells as JSON where the variable names a file."""
        if not self.rows:
            return
        terminalreporter.write_sep("-", self.title)
        for text in lines(self.rows, self.first, self.word):
            terminalreporter.write_line(text)
        if target := os.environ.get(self.variable):
            Path(target).write_text(json.dumps(self.rows, indent=1) + "\n", encoding="utf-8")


def lines(rows: Sequence[Row], first: str = "device and state", word: str = "harmed") -> list[str]:
    """Cells and harmed (or failed) cells by state and family, exit codes by state, the exceptions, and the sum."""
    families = sorted({row["family"] for row in rows}, key=lambda name: (name == "", name))
    table = [[first, *(name or "tools" for name in families), word, "excused", "exit codes"]]
    for state in dict.fromkeys(row["state"] for row in rows):
        of_state = [row for row in rows if row["state"] == state]
        counts = [_count([row for row in of_state if row["family"] == name], word) for name in families]
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
    return [*text, f"{len(rows)} cells of {len({row['line'] for row in rows})} command lines, {harmed} {word}"]


def _count(rows: Sequence[Row], word: str) -> str:
    """``40``, or ``40 (3 harmed)``."""
    harmed = sum(bool(row["harm"]) for row in rows)
    return f"{len(rows)} ({harmed} {word})" if harmed else str(len(rows))
