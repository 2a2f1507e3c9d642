"""Values of the BarrettHand for people: words, findings, tables. Pure; sends nothing.

And what must hold for a value to mean what it seems to: initialized, a gauge, a firmware that has it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.gcl.status_codes import NOT_INITIALIZED, STATUS_CODES, explain_status, split_status
from handctl.devices.barrett.parameter_map import (
    BARRETT,
    POSITIONS,
    SENSIBLE_LIMIT,
    STROKE,
    TENTHS,
    TRAVEL,
    GclParam,
    careful,
    implausible,
    unmeasured,
)
from handctl.errors import HandctlError, Hint, NoAnswer, ProtocolError
from handctl.model.device import Device
from handctl.model.param import Element, Number
from handctl.model.result import Cell, Column, Finding, Grid, Journal, Row, Table

NAME, GCL, MOTOR = Column("name", "Name"), Column("parameter", "GCL"), Column("motor", "Motor")
VALUE, UNIT, LABEL = Column("value", "Value", right=True), Column("unit", "Unit"), Column("label", "Meaning")
STATUS, SECTION, DOUBT = Column("status", "Status"), Column("source", "Section"), Column("doubt", "Doubt")
CHECKED = (Column("check", "Check"), STATUS, Column("evidence", "Evidence"), Column("remedy", "Remedy"), SECTION)
"""Columns of a check: what was looked at, how it is, what was seen, what to do."""


def meaning(param: GclParam, value: Number, index: int) -> str | None:
    """What a value of motor `index` means: status in words, way in strokes, tenths as degrees, 255 as no gauge."""
    if param.mnemonic == "OD":
        return f"{int(value) * 1000 // STROKE[1 if index == 3 else 0]} strokes"
    if param.mnemonic == "S":
        return explain_status(int(value))
    if param.unit == TENTHS and not (param.mnemonic == "OTEMP" and value == 0):
        return f"{value / 10:.1f} °C"
    return param.label(value)


def heat_hint(now: int, limit: int) -> str:
    """What to do about 8192, from TEMP and OTEMP in 0.1 °C: cool it, or mend the setting."""
    from handctl.devices.barrett.maintenance.health_limits import SET_LIMIT, meant_in_degrees

    if 0 < limit < SENSIBLE_LIMIT:
        return Hint(
            f"run {{}}, because the setting is wrong. OTEMP is {limit / 10:.1f} °C, and the board is at "
            f"{now / 10:.1f} °C. The unit of OTEMP is 0.1 °C{meant_in_degrees(limit)}",
            SET_LIMIT,
        )
    at_most = f"{limit / 10:.1f} °C" if limit else "0 (off)"
    return Hint(
        f"let the hand cool, and free the spread with {{}}: TEMP is {now / 10:.1f} °C, OTEMP {at_most}",
        "barrett stop --motors S",
    )


def audit(rows: Sequence[Row]) -> Iterator[str]:
    """Values that the manual allows and warns of."""
    for row in rows:
        if "value" in row:
            element = Element(BARRETT[row["name"]], MOTORS.index(row["motor"]) if row["motor"] else 0)
            if (objection := careful(element, row["value"])) is not None:
                yield f"{row['motor'] or 'whole hand'}: {objection}"
    by = {(row["parameter"], row["motor"]): row.get("value") for row in rows}
    for motor in MOTORS:
        if None not in (high := by.get(("HSG", motor)), alias := by.get(("MSG", motor))) and high != alias:
            yield f"{motor}: HSG {high} and MSG {alias} differ, although they are the same value"


def unhealthy(rows: Sequence[Row]) -> Iterator[Finding]:
    """Findings: a code of several motors is one."""
    from handctl.devices.barrett.maintenance.health_limits import LIMIT, LIMIT_TENTHS

    at = {(row["parameter"], row["motor"]): row.get("value") for row in rows}
    for status in dict.fromkeys(at.get(("S", motor)) for motor in MOTORS):
        if status:
            motors = [motor for motor in MOTORS if at.get(("S", motor)) == status]
            keys = tuple(
                f"{STATUS_CODES[bit][0]} ({bit})" if bit in STATUS_CODES else "unknown"
                for bit in split_status(int(status))
            )
            yield Finding(f"{', '.join(motors)}: {explain_status(int(status))}", keys)
    for motor in MOTORS:
        if at.get(("EN", motor)) == 0:
            yield Finding(f"{motor} is disabled (EN 0): it moves only if it is named (--motors)", ("disabled",))
    temperature, limit, peak = (at.get((name, None)) for name in ("TEMP", "OTEMP", "PTEMP"))
    if temperature is not None and unmeasured(int(temperature)):
        text = f"temperature {temperature / 10:.1f} °C is impossible, so overheating cannot be detected"
        yield Finding(text, ("no-temperature",))
    elif temperature is not None and temperature > LIMIT_TENTHS:
        yield Finding(f"temperature {temperature / 10:.1f} °C, which must never exceed {LIMIT} (barrett §2)", ("hot",))
    if limit and temperature is not None and temperature > limit:
        text = f"temperature {temperature / 10:.1f} °C is above OTEMP {limit / 10:.1f} °C: motor commands fail"
        yield Finding(text, ("over-limit",), heat_hint(temperature, limit))
    if peak is not None and peak >= LIMIT_TENTHS:
        yield Finding(f"its peak temperature was {peak / 10:.1f} °C", ("was-hot",))


# -- how people see it -------------------------------------------------------------------------------------------


def parameters_view(rows: list[Row]) -> list[Grid]:
    """One line per parameter, motors side by side: settings, readings, what shapes RealTime blocks, what is the hand's.

    What differs from the factory is marked. Readings stand apart, for they are long and have no factory value: so each
    table fits 80 cells whatever it holds. Units stand below where a column of them would not.
    """
    names = list(dict.fromkeys(row["name"] for row in rows))
    groups: list[list[str]] = [[], [], [], []]
    for name in names:
        param, _ = BARRETT.find(name)
        motor = 1 if not param.writable else 2 if param.source.endswith("5.3.3") else 0
        groups[3 if param.is_global else motor].append(name)
    return [_parameter_grid([row for row in rows if row["name"] in group], group) for group in groups if group]


def _parameter_grid(rows: list[Row], names: list[str]) -> Grid:
    motors = [motor for motor in MOTORS if any(row["motor"] == motor for row in rows)]
    places: list[str | None] = [*motors] or [None]
    factory = any(_defaults({None: row}) not in ("", "1") for row in rows)
    lines: list[tuple[str | Cell, ...]] = []
    notes = []
    units: dict[str, list[str]] = {}
    for name in names:
        mine = {row["motor"]: row for row in rows if row["name"] == name}
        first = next(iter(mine.values()))
        cells = [_value_cell(mine.get(place)) for place in places]
        unit = first["unit"] or ""
        if motors and unit:
            units.setdefault(unit, []).append(first["parameter"])
        more = [_defaults(mine)] if factory or not motors else []
        lines.append((first["parameter"], name, *cells, *more, *([] if motors else [_unit(mine[None])])))
        error = next((row["error"] for row in mine.values() if "error" in row), None)
        if error is not None:
            notes.append(f"{first['parameter']}: {error}")
        doubtful = [row for row in mine.values() if row.get("doubt") and row["doubt"] != NO_GAUGE]
        if doubtful:
            whose = ", ".join(str(row["motor"]) for row in doubtful if row["motor"])
            notes.append(f"{first['parameter']}{f' {whose}' if whose else ''}: {doubtful[0]['doubt']}")
    notes += [f"{unit}: {' '.join(having)}" for unit, having in units.items()]
    headings = ["GCL", "Name", *(motors or ["Value"]), *(["Default"] if factory or not motors else [])]
    right = frozenset(range(2, len(headings)))
    return Grid((*headings, *([] if motors else ["Unit"])), tuple(lines), right=right, notes=tuple(notes))


def _unit(row: Row) -> str:
    """The unit of a value of the hand; values shown in degrees have none."""
    return "" if row["unit"] == TENTHS else str(row["unit"] or "")


def _value_cell(row: Row | None) -> str | Cell:
    if row is None:
        return ""
    if "error" in row:
        return Cell("?", "bad")
    changed = row.get("default") is not None and row["value"] != row["default"]
    text = str(row["label"]) if row["unit"] == TENTHS and row.get("label") else str(row["value"])
    if row.get("doubt"):
        return Cell(text if row["doubt"] == NO_GAUGE else f"{text}?", "dim")
    return Cell(f"{text}*", "warn") if changed else text


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
                str(row["label"]),
                "good" if row["value"] == 0 else ("warn" if row["value"] == NOT_INITIALIZED else "bad"),
            )
        if name == "SG" and row["value"] == 255:
            return Cell("none", "dim")
        if row.get("doubt"):
            return Cell(f"{row['value']}?", "dim")
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

    unknown = [motor for motor in MOTORS if at.get(("P", motor), {}).get("doubt")]
    hours = at.get(("UPSECS", None), {}).get("value")
    notes = (
        *([f"{', '.join(unknown)}: {at['P', unknown[0]]['doubt']}"] if unknown else []),
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


def row_of(name: str, parameter: str | None, motor: str | None, value: object, unit: str | None, **more: object) -> Row:
    """A row as in `get`, with additional keys."""
    return {"name": name, "parameter": parameter, "motor": motor, "value": value, "unit": unit, **more}


def live(
    hand: Device, read: Callable[[], list[Row]], *, rate: float, count: int | None, duration: float | None, **shown: Any
) -> Table:
    """Call `read` as a stream; a sample without a valid reply repeats the last rows with the error as value."""
    from handctl.model.sampling import Sampler

    rows: list[Row] = []

    def moment() -> tuple[list[Row], HandctlError | None]:
        nonlocal rows
        try:
            rows = read()
        except (NoAnswer, ProtocolError) as exc:
            kept = [{key: value for key, value in row.items() if key != "value"} for row in rows]
            return [{**row, "error": exc.text} for row in kept], exc
        return rows, None

    sampler = Sampler(hand.link, moment, rate=rate, count=count, duration=duration)
    return Table(samples=sampler.samples(), summary=sampler.summary, **shown)


# -- what must hold -----------------------------------------------------------------------------------------------------


NOT_HOMED = "not initialized: P counts from the position at power-on and means nothing before HI (barrett §5.2.1)"


def why_impossible(index: int) -> str:
    """What to say of a position that `implausible` refuses."""
    return f"impossible: {'the spread' if index == 3 else 'a finger'} travels about {TRAVEL[index == 3]} counts (barrett §5.3.2)"


def why_doubtful(param: GclParam, index: int, value: Number) -> str | None:
    """Why a value cannot be what it says: no joint gets there, or the manual has no such value. None where it can."""
    if param.mnemonic in POSITIONS:
        return why_impossible(index) if implausible(index, int(value)) else None
    return None if param.allowed(value) else f"outside its range {param.range_text}, so the RAM contents may be corrupt"


NO_GAUGE = "no gauge (barrett §5.3.2)"
FIRST = {"4.34": (4, 3, 4), "4.4": (4, 4, 0)}
"""Firmware that a parameter's `since` names, as numbers."""


def mark_not_homed(rows: Sequence[Row]) -> None:
    """Mark positions that are not valid, by the status of their motors in the same table."""
    status = {row["motor"]: row.get("value") for row in rows if row.get("parameter") == "S"}
    for row in rows:
        code = status.get(row["motor"]) if row.get("parameter") == "P" and "value" in row else None
        if code is not None:
            row["doubt"] = NOT_HOMED if int(code) & 4 else row.get("doubt")


def later_settings(firmware: str, journal: Journal) -> list[str]:
    """Names of the settings that came with later firmware and this one has (dossier 6.5)."""
    later = [param for param in BARRETT if param.since and param.writable]
    if _version(firmware) is None:
        names = " ".join(param.mnemonic for param in later)
        journal.warn("later-firmware", f"the firmware does not report its version, so {names} were not read")
        return []
    had = later_names(firmware)
    return [param.name for param in later if param.mnemonic in had]


def later_names(firmware: str) -> list[str]:
    """Mnemonics of what came with later firmware and this one has, all of them where it does not report its version."""
    version = _version(firmware)
    return [param.mnemonic for param in BARRETT if param.since and (version is None or version >= FIRST[param.since])]


def _version(firmware: str) -> tuple[int, ...] | None:
    known = re.search(r"(\d+)\.(\d)(\d?)", firmware.replace("_", "."))
    return None if known is None else tuple(int(digit or 0) for digit in known.groups())
