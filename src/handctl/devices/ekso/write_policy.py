"""The limits of this tool for writing a setting, and `ekso policy`, which prints them. They are never limits of the device.

`setting_change`, `stillness` and `setting_writer` apply them. They are in the dossier (6.2, 6.3, 6.6).
"""

from __future__ import annotations

from handctl.devices.ekso.parameter_map import ASSIST, SETTINGS, Word
from handctl.fast_classes import NamedTuple
from handctl.model.device_clock import WITHIN_MS
from handctl.model.result import Column, Row, Table

READS_APART = 0.1
"""Seconds between the two readings that show whether the wearer moves."""
MOST_SPEED = 5.0
"""deg/s of a hip or knee; above, the wearer moves."""
BETWEEN_WRITES = 1.0
"""Seconds from one SetValue to the next."""
STEP_SECONDS = 10.0
"""A step is measured against each value of the last so many seconds."""


class WriteLimits(NamedTuple):
    """The limits of one setting.

    step     largest change of one write, in the setting's unit (codes: in codes, within 0..100 %); None = no limit
    sitting  written only while sitting
    firm     no override of its limits
    twice    labels that are confirmed a second time on entering or leaving
    """

    step: float | None = None
    sitting: bool = False
    firm: bool = False
    twice: tuple[str, ...] = ()


_LEG, _ASSIST, _STANCE = (
    WriteLimits(0.5, True, True),
    WriteLimits(2, twice=("Adapt", "Max")),
    WriteLimits(twice=("Flex", "Full")),
)
WRITE_LIMITS = {
    "upper_leg_length": _LEG, "lower_leg_length": _LEG, "step_length": WriteLimits(1.0), "step_height": WriteLimits(0.5),
    "swing_time": WriteLimits(0.1), "stand_time": WriteLimits(0.25), "knee_flexion": WriteLimits(2.0), "hip_flexion": WriteLimits(2.0),
    "forward_shift": WriteLimits(0.5), "lateral_shift": WriteLimits(0.5), "walk_mode": WriteLimits(sitting=True),
    "injury_mode": WriteLimits(sitting=True, twice=("2Free",)), "left_swing_assist": _ASSIST, "right_swing_assist": _ASSIST,
    "left_stance_support": _STANCE, "right_stance_support": _STANCE,
}  # fmt: skip


def write_limits_of(param: Word) -> WriteLimits:
    """The limits of a setting."""
    return WRITE_LIMITS.get(param.name, WriteLimits())


def largest_step(param: Word) -> str:
    """The largest step in words: ``10 %``, ``1.00 in``."""
    step = write_limits_of(param).step or 0
    return ASSIST[int(step)] if param.choices is ASSIST else param.shown(step)


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
    ("looks_apart", READS_APART, "s"),
    ("boot_time_within", WITHIN_MS, "ms"),
    ("settings_at_once", 1, None),
    ("between_writes", BETWEEN_WRITES, "s"),
    ("step_within", STEP_SECONDS, "s"),
)
"""What holds for every setting; no override. The audit log remembers the last writes, so it holds over several runs."""


def policy_table() -> Table:
    """Rows `name` ("*" = every setting), `id`, `rule`, `value`, `unit`, `override` (whether --override-step-limit lifts it).

    Rules of a setting: step (largest change at once), posture, asked_twice (labels), read_only.
    """
    rows = [_row(None, rule, value, unit) for rule, value, unit in GENERAL]
    return Table(rows=[*rows, *(row for param in SETTINGS for row in _rules(param))], columns=COLUMNS)


def _rules(param: Word) -> list[Row]:
    if not param.writable:
        return [_row(param, "read_only", param.note, None)]
    rows, limits = [], write_limits_of(param)
    if limits.step is not None:
        # a step in codes counts within 0 %..100 %, 5 % a code; of labels without order there is none
        value, unit = (limits.step * 5, "%") if param.choices else (limits.step, param.unit)
        rows.append(_row(param, "step", value, unit, override=not limits.firm))
    if limits.sitting:
        rows.append(_row(param, "posture", "sitting", None))
    if limits.twice:
        rows.append(_row(param, "asked_twice", ", ".join(limits.twice), None))
    return rows or [_row(param, "step", None, None)]


def _row(param: Word | None, rule: str, value: float | str | None, unit: str | None, *, override: bool = False) -> Row:
    name, number = (param.name, param.id) if param is not None else ("*", None)
    return {"name": name, "id": number, "rule": rule, "value": value, "unit": unit, "override": override}
