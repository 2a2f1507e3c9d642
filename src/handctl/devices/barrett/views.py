"""What the BarrettHand's values mean to people: in words, as findings, as tables. Pure; sends nothing."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.barrett.health import LIMIT_TENTHS
from handctl.devices.barrett.language import MOTORS, explain_status
from handctl.devices.barrett.parameters import BARRETT, GclParam, careful
from handctl.param import Element, Number
from handctl.result import Cell, Grid, Row

STROKE = (17500, 3100)
"""Counts of one stroke of a finger and of the spread (barrett §7.3)."""
NEARLY_READY = 4


def meaning(param: GclParam, value: Number, index: int) -> str | None:
    """What a value of motor `index` means: status in words, way in strokes, tenths as degrees, 255 as no gauge."""
    if param.mnemonic == "OD":
        return f"{int(value) * 1000 // STROKE[1 if index == 3 else 0]} strokes"
    if param.mnemonic == "S":
        return explain_status(int(value))
    if param.unit == "0.1 °C" and not (param.mnemonic == "OTEMP" and value == 0):
        return f"{value / 10:.1f} °C"
    return param.label(value)


def audit(rows: Sequence[Row]) -> list[str]:
    """Values that the manual allows and warns of."""
    found = []
    for row in rows:
        if "value" not in row:
            continue
        index = MOTORS.index(row["motor"]) if row["motor"] else 0
        objection = careful(Element(BARRETT[row["name"]], index), row["value"])
        if objection is not None:
            found.append(f"{row['motor'] or 'hand'}: {objection}")
    by = {(row["parameter"], row["motor"]): row.get("value") for row in rows}
    found += [
        f"{motor}: HSG {by[('HSG', motor)]} and MSG {by[('MSG', motor)]} differ, they are one value"
        for motor in MOTORS
        if ("HSG", motor) in by and by[("HSG", motor)] != by.get(("MSG", motor))
    ]
    return found


def unhealthy(rows: Sequence[Row]) -> list[str]:
    """What a technician must look at. A hand that only waits for HI (status 4) is healthy."""
    found = []
    at = {(row["parameter"], row["motor"]): row.get("value") for row in rows}
    for motor in MOTORS:
        status = at.get(("S", motor))
        if status and int(status) & ~NEARLY_READY:
            found.append(f"{motor}: {explain_status(int(status))}")
        if at.get(("EN", motor)) == 0:
            found.append(f"{motor} is disabled (EN 0): it does not move without a prefix")
    temperature, limit, peak = (at.get((name, None)) for name in ("TEMP", "OTEMP", "PTEMP"))
    if temperature is not None and temperature >= LIMIT_TENTHS:
        found.append(f"temperature {temperature / 10:.1f} °C: never above 65 °C (barrett §2)")
    if limit and temperature is not None and temperature > limit:
        found.append(f"temperature {temperature / 10:.1f} °C is above OTEMP {limit / 10:.1f} °C: motor commands fail")
    if peak is not None and peak >= LIMIT_TENTHS:
        found.append(f"its peak temperature was {peak / 10:.1f} °C")
    return found


# -- how people see it -------------------------------------------------------------------------------------------


def parameters_view(rows: list[Row]) -> list[Grid]:
    """One line per parameter: GCL name, motors side by side; what differs from the factory is marked."""
    names = list(dict.fromkeys(row["name"] for row in rows))
    motors = [motor for motor in MOTORS if any(row["motor"] == motor for row in rows)]
    scalars = any(row["motor"] is None for row in rows)
    headings = ["GCL", "Name", *motors, *(["Hand"] if scalars else []), "Default", "Unit"]
    lines: list[tuple[str | Cell, ...]] = []
    notes = []
    for name in names:
        mine = {row["motor"]: row for row in rows if row["name"] == name}
        first = next(iter(mine.values()))
        cells = [_value_cell(mine.get(motor)) for motor in motors] + ([_value_cell(mine.get(None))] if scalars else [])
        lines.append((first["parameter"], name, *cells, _defaults(mine), first["unit"] or ""))
        error = next((row["error"] for row in mine.values() if "error" in row), None)
        if error is not None:
            notes.append(f"{first['parameter']}: {error}")
    right = frozenset(range(2, len(headings) - 2))
    return [Grid(tuple(headings), tuple(lines), right=right, notes=tuple(notes))]


def _value_cell(row: Row | None) -> str | Cell:
    if row is None:
        return ""
    if "error" in row:
        return Cell("?", "bad")
    changed = row.get("default") is not None and row["value"] != row["default"]
    return Cell(f"{row['value']}*", "warn") if changed else str(row["value"])


def _defaults(rows: dict[str | None, Row]) -> str:
    seen = list(dict.fromkeys(str(row["default"]) for row in rows.values() if row.get("default") is not None))
    return "/".join(seen)


def status_view(rows: list[Row]) -> list[Grid]:
    """Per motor, then the hand as a whole."""
    at = {(row["parameter"], row["motor"]): row for row in rows}

    def text(name: str, motor: str | None) -> str | Cell:
        row = at.get((name, motor))
        if row is None or "error" in row:
            return Cell("?", "bad")
        if name == "S":
            return Cell(
                str(row["label"]), "good" if row["value"] == 0 else ("warn" if row["value"] == NEARLY_READY else "bad")
            )
        if name == "SG" and row["value"] == 255:
            return Cell("none", "dim")
        return str(row["value"])

    def strokes(motor: str) -> str | Cell:
        label = at.get(("OD", motor), {}).get("label")
        return str(label).removesuffix(" strokes") if label else Cell("?", "bad")

    motors = tuple(
        (motor, text("P", motor), text("SG", motor), strokes(motor), text("EN", motor), text("S", motor))
        for motor in MOTORS
    )

    def degrees(name: str) -> str:
        row = at.get((name, None), {})
        return str(row.get("label") or row.get("value", "?"))

    def plain(name: str) -> str:
        return str(at.get((name, None), {}).get("value", "?"))

    hours = at.get(("UPSECS", None), {}).get("value")
    notes = (
        f"temperature {degrees('TEMP')}, limit {degrees('OTEMP')}, peak {degrees('PTEMP')}",
        f"serial number {plain('SN')}, firmware {plain('VERS')}, {plain('BAUD')}00 bit/s, "
        f"{f'{hours / 3600:.1f} h of operation' if isinstance(hours, int) else 'operation time ?'}",
    )
    return [
        Grid(
            ("Motor", "Position", "Strain", "Strokes", "Enabled", "Status"),
            motors,
            right=frozenset({1, 2, 3, 4}),
            notes=notes,
        )
    ]
