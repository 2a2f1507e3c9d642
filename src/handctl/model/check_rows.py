"""Checks as rows: what was looked at, how it is, what shows that, and what to do. Knows no device and sends nothing."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

from handctl.errors import CheckFailed
from handctl.model.result import Cell, Column, Grid, Row, Table, command_key

OK, WARNING, FAIL, SKIPPED = "ok", "warning", "fail", "skipped"
TONES = {OK: "good", WARNING: "warn", FAIL: "bad", SKIPPED: "dim"}
COLUMNS = (
    Column("check", "Check"),
    Column("status", "Status"),
    Column("evidence", "Evidence"),
    Column("remedy", "Remedy"),
)


class Check(NamedTuple):
    """One row: `status` is ok, warning, fail or skipped; `numbers` are further keys of its row."""

    name: str
    status: str
    evidence: str
    remedy: str = ""
    numbers: tuple[tuple[str, Any], ...] = ()

    @property
    def bad(self) -> bool:
        """Whether somebody must act: a warning or a fail."""
        return self.status in (WARNING, FAIL)

    def as_row(self) -> Row:
        """The row of the contract: check, status, evidence, remedy."""
        row = {"check": self.name, "status": self.status, "evidence": self.evidence, "remedy": self.remedy or None}
        return {**row, **command_key(self.remedy), **dict(self.numbers)}


def table_of(checks: Sequence[Check], causes: Collection[str] = ()) -> Table:
    """The rows; a finding is a CheckFailed. Its next step is that of the worst one, of `causes` before what they cause."""
    findings = [check for check in checks if check.bad]
    result = Table(rows=[check.as_row() for check in checks], columns=COLUMNS, view=view, plain=("check", "status"))
    if findings:
        names = ", ".join(f"{check.name} ({check.status})" for check in findings)
        result.failure = CheckFailed(
            f"{len(findings)} of {len(checks)} checks found a problem: {names}",
            hint=min(findings, key=lambda check: (check.status != FAIL, check.name not in causes)).remedy,
            code="findings",
        )
    return result


def view(rows: list[Row]) -> list[Grid]:
    """Check and status side by side; the remedies below, so that nothing is cut at 80 columns."""
    lines = [(row["check"], Cell(row["status"], TONES[row["status"]]), row["evidence"]) for row in rows]
    told: dict[str, list[str]] = {}
    for row in rows:
        if row["remedy"]:
            told.setdefault(row["remedy"], []).append(row["check"])
    notes = [f"{', '.join(dict.fromkeys(names))}: {remedy}" for remedy, names in told.items()]
    return [Grid(("Check", "Status", "Evidence"), tuple(lines), notes=tuple(notes))]
