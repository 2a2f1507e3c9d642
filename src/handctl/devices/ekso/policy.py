"""`ekso policy`: every limit of this tool for writing a setting, as a table. Never a limit of the device.

It decides nothing: the limits are in `map` (the largest steps), `change` and `setting_writer`.
"""

from __future__ import annotations

from handctl.devices.ekso.audit import WINDOW, AuditLog, told
from handctl.devices.ekso.change import APART, MOST_SPEED
from handctl.devices.ekso.map import SETTINGS, Word
from handctl.devices.ekso.setting_writer import BETWEEN_WRITES
from handctl.errors import CheckFailed, UsageError
from handctl.model.result import Column, Journal, Row, Table
from handctl.model.sampling import WITHIN_MS

COLUMNS = (
    Column("name", "Setting"),
    Column("id", "ID", right=True),
    Column("rule", "Rule"),
    Column("value", "Value", right=True),
    Column("unit", "Unit"),
    Column("override", "Override"),
)
GENERAL: tuple[tuple[str, float | str, str | None], ...] = (
    ("posture", "sitting, standing", None),
    ("joint_speed_below", MOST_SPEED, "deg/s"),
    ("looks_apart", APART, "s"),
    ("boot_time_within", WITHIN_MS, "ms"),
    ("settings_at_once", 1, None),
    ("between_writes", BETWEEN_WRITES, "s"),
    ("step_within", WINDOW, "s"),
)
"""What holds for every setting; no override. The audit log remembers the last writes, so it holds over several runs."""


def policy() -> Table:
    """Rows `name` ("*" = every setting), `id`, `rule`, `value`, `unit`, `override` (whether --override-step-limit lifts it).

    Rules of a setting: step (largest change at once), posture, asked_twice (labels), read_only.
    """
    rows = [_row(None, rule, value, unit) for rule, value, unit in GENERAL]
    return Table(rows=[*rows, *(row for param in SETTINGS for row in _rules(param))], columns=COLUMNS)


MOST_TOLD = 3


def look_through(audit: AuditLog, journal: Journal) -> CheckFailed | None:
    """Check the audit log: a note if it is unchanged, otherwise the failure. Raises UsageError."""
    checked = audit.checked(whole=True)
    if checked.findings and not checked.chained + checked.unchained:
        raise UsageError(
            f"{audit.path}: not an audit log: {next(told(checked))}", hint="name the audit log with --audit FILE"
        )
    count = checked.unchained
    older = f" Entries from an older handctl, without a hash: {count}. These cannot be checked." if count else ""
    if not checked.findings:
        journal.info(
            "audit",
            f"{audit.path}: {checked.chained} entries, none was edited, removed or moved.{older} Entries removed from the end would not be noticed",
        )
        return None
    places = list(told(checked))
    more = f", and {len(places) - MOST_TOLD} more" if len(places) > MOST_TOLD else ""
    return CheckFailed(
        f"{audit.path}: the audit log was changed after it was written: {'; '.join(places[:MOST_TOLD])}{more}.{older}",
        hint="find out who has access to the file, and compare it with a backup. If you move the log away, a new one starts",
        code="audit-edited",
    )


def _rules(param: Word) -> list[Row]:
    if not param.writable:
        return [_row(param, "read_only", param.note, None)]
    rows = []
    if param.step is not None:
        # a step in codes counts within 0 %..100 %, 5 % a code; of labels without order there is none
        value, unit = (param.step * 5, "%") if param.choices else (param.step, param.unit)
        rows.append(_row(param, "step", value, unit, override=not param.firm))
    if param.sitting:
        rows.append(_row(param, "posture", "sitting", None))
    if param.twice:
        rows.append(_row(param, "asked_twice", ", ".join(param.twice), None))
    return rows or [_row(param, "step", None, None)]


def _row(param: Word | None, rule: str, value: float | str | None, unit: str | None, *, override: bool = False) -> Row:
    name, number = (param.name, param.id) if param is not None else ("*", None)
    return {"name": name, "id": number, "rule": rule, "value": value, "unit": unit, "override": override}
