"""`ekso status`: posture, joints, feet, currents, clocks, and whether the values are consistent.

The limits are this tool's policy, not the device's.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from math import cos, radians, sin
from typing import TYPE_CHECKING

from handctl.devices.ekso.parameter_map import DATA, EKSO, LEGS, NAMED, POSTURES, SETTINGS, Word, boot_ms, boot_text
from handctl.devices.ekso.write_policy import READS_APART, write_limits_of
from handctl.errors import HandctlError, LinkError
from handctl.model.device_clock import Span
from handctl.model.param import Reading
from handctl.model.result import Cell, Finding, Grid, Row, Table

if TYPE_CHECKING:
    from handctl.devices.ekso.device import Ekso


ANGLES = {"hip_angle": (-30.0, 140.0), "knee_angle": (-5.0, 135.0), "torso_pitch": (-60.0, 60.0), "torso_roll": (-60.0, 60.0)}  # fmt: skip
LEG_LENGTHS = (10.0, 25.0)
CLOCK_SECONDS = 60.0


def status(ekso: Ekso, check: bool) -> Table:
    """Read data twice, settings, feedback and clock. Raises the error of one that is not answered, unless this firmware lacks it."""
    first, moment = ekso.asked("data"), ekso.port.moment
    ekso.link.sleep(READS_APART)
    second, later = (ekso.readings("data") if first[0].value is not None else first), ekso.port.moment
    settings = ekso.asked("settings")
    feedback = ekso.asked("feedback")
    present = ekso.present([*second, *settings, *feedback])
    there = {id(reading) for reading in present if reading.error is None}
    data = second if id(second[0]) in there else []
    settings = [reading for reading in settings if id(reading) in there]
    feedback = [reading for reading in feedback if id(reading) in there]
    rows = [ekso.row(reading) for reading in (*data[:25], *feedback[:3], *settings)]
    findings = []
    if data:
        boot = boot_ms(_raws(data))
        rows.append(_row("boot_ms", boot, boot, "ms", boot_text(boot)))
        passed = (boot - boot_ms(_raws(first))) % 2**32
        findings += _boot(passed, later.since(moment), boot, boot_ms(_raws(feedback)) if feedback else boot)
    if data and settings:
        findings += unfit(_values(data), _values(settings))
        for text in _remarks(data, settings):
            ekso.journal.info("remark", text)
    unread = [reading for reading in present if reading.error is not None]
    rows += [ekso.row(reading) for reading in unread]
    table = Table(rows=rows, columns=ekso.columns, view=status_view, failure=unread[0].error if unread else None)
    try:
        rows += _clock(ekso)
    except HandctlError as exc:  # all the rest is known, and shown
        rows.append({"name": "clock", "word": None, "id": None, "error": exc.text, "unit": None})
        findings.append(Finding(f"date and time cannot be read: {exc.text}", ("clock",)))
        over = ekso.port.over
        table.failure = exc if over or isinstance(exc, LinkError) else table.failure
    return ekso.with_findings(table, findings, check)


def _raws(readings: list[Reading]) -> list[int]:
    return [int.from_bytes(reading.raw, "big") for reading in readings]


def _values(readings: list[Reading]) -> dict[str, float]:
    return {reading.element.param.name: float(reading.value or 0) for reading in readings}


def _row(name: str, value: int | float | str | None, raw: int | None, unit: str | None, label: str | None) -> Row:
    return {"name": name, "word": None, "id": None, "value": value, "raw": raw, "unit": unit, "label": label}


def _boot(passed: int, span: Span, data: int, feedback: int) -> list[Finding]:
    """Check that BootTime runs like the host's clock, and is the same in both messages."""
    found = []
    if passed == 0:
        found.append(Finding("BootTime does not advance, so the values are not fresh", ("boot-still",)))
    elif passed >= 2**31:
        found.append(Finding("BootTime went back: the device has restarted, or its words are swapped", ("boot-back",)))
    elif not span.fits(passed):
        found.append(Finding(f"BootTime advanced by {passed} ms in {span}", ("boot-off",)))
    apart = (feedback - data) % 2**32
    if min(apart, 2**32 - apart) > 5000:
        found.append(Finding(f"BootTime of data and feedback differ: {data} and {feedback} ms", ("boot-off",)))
    return found


def unfit(data: dict[str, float], settings: dict[str, float]) -> list[Finding]:
    """What cannot be: implausible angles and leg lengths, hips that do not fit the angles."""
    found = []
    for param in DATA:
        low, high = next((ANGLES[key] for key in ANGLES if param.name.endswith(key)), (None, None))
        if low is not None and high is not None and not low <= data[param.name] <= high:
            text = f"{param.name} {param.shown(data[param.name])} is implausible (policy: {low:g} to {high:g} deg)"
            found.append(Finding(text, ("angle",)))
    upper, lower = (settings[leg.name] for leg in LEGS)
    found += [
        Finding(f"{leg.name} {leg.shown(settings[leg.name])} is implausible (policy: 10 to 25 in)", ("leg-length",))
        for leg in LEGS
        if not LEG_LENGTHS[0] <= settings[leg.name] <= LEG_LENGTHS[1]
    ]
    off = {side: (x, y) for side, (x, y) in residuals(data, upper, lower).items() if abs(x) > MOST_X or abs(y) > MOST_Y}
    from handctl.devices.ekso.remedies import REMEDIES

    key = "hips" if len(off) == 2 else "hip"
    for side, (x, y) in off.items():
        text = f"the {side} hip is {x:+.2f}, {y:+.2f} in away from the position given by angles and leg lengths"
        found.append(Finding(text, (key,)))
    if off:
        found.append(
            Finding(f"{'both hips are' if len(off) == 2 else 'only one hip is'} off: {REMEDIES[key].meaning}", (key,))
        )
    return found


def _remarks(data: list[Reading], settings: list[Reading]) -> list[str]:
    """Remarks that are no faults: unknown codes, an unknown posture, unusual modes."""
    found = []
    for reading in settings:
        param = reading.element.param
        assert isinstance(param, Word)
        if reading.value is None or not param.choices:
            continue
        if reading.value not in param.choices:
            found.append(f"{param.name} is {param.label(reading.value)}, word {param.word}. Report it")
        elif param.choices[reading.value] in write_limits_of(param).twice:
            found.append(f"{param.name} is unusual: {param.label(reading.value)}")
    state = int(data[18].value or 0)
    if state >> 12 not in POSTURES:
        found.append(f"the posture is {DATA[18].label(state)}: its meaning is unknown. Report it")
    values = _values(settings)
    for what in ("swing_assist", "stance_support"):
        if values[f"left_{what}"] != values[f"right_{what}"]:
            left, right = (EKSO[name].label(int(values[name])) for name in (f"left_{what}", f"right_{what}"))
            found.append(f"{what} differs: left {left}, right {right}")
    return found


def _clock(ekso: Ekso) -> list[Row]:
    """The device's date and time, with their distance from the host's clock."""
    date, time = ekso.now()
    keys = ("name", "word", "id", "value", "raw", "unit", "label", "path")
    rows = [{key: row[key] for key in keys} for row in (date, time)]
    try:
        here = datetime.fromtimestamp(ekso.link.wall())  # noqa: DTZ006 - the device tells no zone
        offset = (datetime.fromisoformat(f"{date['value']}T{time['value']}") - here).total_seconds()
    except ValueError:
        return rows
    if abs(offset) > CLOCK_SECONDS:
        way = "ahead of" if offset > 0 else "behind"
        ekso.journal.info(
            "clock",
            f"the device's clock is {span_text(abs(offset))} {way} this computer's",
            hint="use the times of this computer: `handctl ekso log` records both",
        )
    return [*rows, _row("clock_offset", round(offset), None, "s", None)]


def span_text(seconds: float) -> str:
    """A difference between clocks in its two largest units: ``1 d 17 h``, ``2 min 5 s``."""
    left = round(seconds)
    parts: list[str] = []
    for unit, size in (("d", 86400), ("h", 3600), ("min", 60), ("s", 1)):
        number, left = divmod(left, size)
        if number or parts:
            parts.append(f"{number} {unit}")
    return " ".join(parts[:2]) or "0 s"


def status_view(rows: list[Row]) -> list[Grid]:
    """Posture and clocks, joints and feet by side, trunk, steps; then what can be set."""
    at = {row["name"]: row for row in rows}

    def text(name: str, unit: bool = True) -> str | Cell:
        row = at.get(name, {"error": ""})
        if "error" in row:
            return Cell("?", "bad")
        param = NAMED.get(name)
        if param is None:
            return str(row["label"] or row["value"])
        return param.shown(row["value"]) if unit else param.text(row["value"])

    def plain(name: str) -> str:
        cell = text(name)
        return cell.text if isinstance(cell, Cell) else cell

    sides = ("left", "right")
    joints = tuple(
        (f"{side} {joint}", text(f"{side}_{joint}_angle", False), text(f"{side}_{joint}_current", False))
        for side in sides
        for joint in ("hip", "knee")
    )
    feet = tuple(
        (side, text(f"{side}_toe_pressure", False), text(f"{side}_heel_pressure", False), text(f"{side}_hip_x", False), text(f"{side}_hip_y", False))
        for side in sides
    )  # fmt: skip
    general = (
        ("posture", plain("state")),
        ("trunk", f"pitch {plain('torso_pitch')}, roll {plain('torso_roll')}"),
        ("boot time", plain("boot_ms")),
        ("clock", f"{plain('date')} {plain('time')}"),
        ("steps", f"{plain('steps_taken')}, upright {plain('upright_time')}, walking {plain('walk_time')}"),
    )
    settings = tuple(
        (left.name, text(left.name), right.name, text(right.name))
        for left, right in zip(SETTINGS[:11], SETTINGS[11:], strict=True)
    )
    return [
        Grid(("State", ""), general),
        Grid(("Joint", "Angle [deg]", "Current [A]"), joints, right=frozenset({1, 2})),
        Grid(("Side", "Toe [raw]", "Heel [raw]", "Hip x [in]", "Hip y [in]"), feet, right=frozenset({1, 2, 3, 4})),
        Grid(("Setting", "", "Setting", ""), settings),
    ]


# -- where the hips must be by the angles -------------------------------------------------------------------------------
#
# By a log of one unit, angles in degrees, lengths in inches: thigh = hip angle - torso pitch, shank = thigh - knee angle,
# x = -upper sin(thigh) - lower sin(shank) + 2.75, y = upper cos(thigh) + lower cos(shank) + 4.00.


FOOT_X, FOOT_Y = 2.75, 4.00
MOST_X, MOST_Y = 0.3, 0.1
"""Residuals in inches that a sound unit stays within (policy; the log's worst are 0.15 and 0.015)."""


def hip(upper: float, lower: float, pitch: float, hip_angle: float, knee_angle: float) -> tuple[float, float]:
    """(x, y) of one hip in inches before and above the sole."""
    thigh = radians(hip_angle - pitch)
    shank = thigh - radians(knee_angle)
    return (-upper * sin(thigh) - lower * sin(shank) + FOOT_X, upper * cos(thigh) + lower * cos(shank) + FOOT_Y)


def residuals(values: Mapping[str, float], upper: float, lower: float) -> dict[str, tuple[float, float]]:
    """Side -> (x, y) told minus (x, y) by the angles, in inches. `values` are those of GetData by name."""
    found = {}
    for side in ("left", "right"):
        x, y = hip(upper, lower, values["torso_pitch"], values[f"{side}_hip_angle"], values[f"{side}_knee_angle"])
        found[side] = (values[f"{side}_hip_x"] - x, values[f"{side}_hip_y"] - y)
    return found
