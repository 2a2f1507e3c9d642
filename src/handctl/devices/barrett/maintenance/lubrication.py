"""Maintenance: strokes and cycles from the odometer, greasing points with a journal, temperatures, periodic work (barrett §7).

The odometer is never reset, so "due" needs its value at the last greasing: the host's own journal keeps it, per serial
number and, where that is not unique, a name. Nothing here writes to the hand.
"""

from __future__ import annotations

from datetime import datetime, timezone
from typing import Any, NamedTuple

from handctl.devices.barrett import state_files
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.maintenance import health_limits
from handctl.devices.barrett.parameter_map import BARRETT, FINGERS, STROKE
from handctl.devices.barrett.status_and_parameter_views import (
    LABEL,
    MOTOR,
    NAME,
    SECTION,
    STATUS,
    UNIT,
    VALUE,
    row_of,
    why_doubtful,
)
from handctl.errors import CheckFailed, UsageError
from handctl.files import state_path
from handctl.model.check_rows import FAIL, OK, SKIPPED, TONES, WARNING
from handctl.model.result import Cell, Grid, Row, Table

FILE, WHAT = "barrett-greasing.json", "greasing journal"
STROKES_BETWEEN = 5000
"""Strokes between two greasings (Table 6)."""
SOON = 0.8
"""Share of an interval from which on the work is announced."""
NEVER = "no greasing recorded, counted from new"
WHOSE = "serial number 0, so the journal was not used (see --hand NAME), counted from new"


def due(strokes: float) -> str:
    """Status of a greasing point that has made `strokes` since its last greasing."""
    share = strokes / STROKES_BETWEEN
    return FAIL if share > 1 else WARNING if share >= SOON else OK


class GreasePoint(NamedTuple):
    """A lubrication point of Table 6."""

    name: str
    title: str
    motors: tuple[str, ...]
    source: str


POINTS = (
    GreasePoint("worm", "finger worm gears", FINGERS, "barrett §7.3, Figure 11"),
    GreasePoint("spur", "finger spur gears", FINGERS, "barrett §7.3 steps 1 to 9 (finger off)"),
    GreasePoint("motor-spur", "finger motor spur gears", FINGERS, "barrett §7.3 steps 1 to 9 (finger off)"),
    GreasePoint("palm", "palm spur gears", ("SPREAD",), "barrett §7.3, Figure 11"),
)
COLUMNS = (NAME, MOTOR, VALUE, UNIT, STATUS, LABEL, SECTION)
PERIODIC = (
    ("fastener_check", "monthly under heavy use: all external screws present and tight", "barrett §7.2"),
    ("cable_pretension", "when a fingertip has slack, after thousands of cycles", "barrett §7.1"),
    ("strain_zero", "when a no-load reading is outside 100 to 140: `handctl barrett strain`", "barrett §7.4"),
    ("firmware", "load it again after two days without power", "barrett §3.7"),
)


def chosen_points(text: str) -> list[tuple[GreasePoint, str]]:
    """``all``, ``worm``, ``spur.F1,palm`` -> points with their motor, in the order of Table 6. Raises UsageError."""
    wanted: set[tuple[str, str]] = set()
    known = {point.name: point for point in POINTS}
    for part in filter(None, text.lower().split(",")):
        name, dot, motor = part.partition(".")
        motors = known[name].motors if name in known else FINGERS
        finger = motor.upper() if not motor.isdecimal() else f"F{motor}"
        if part != "all" and (name not in known or (dot and finger not in motors)):
            raise UsageError(
                f"{part!r} is not a greasing point",
                hint=f"use all, or some of {', '.join(known)}, with a finger as in spur.F1 (barrett Table 6)",
            )
        wanted |= {
            (point.name, place)
            for point in POINTS
            for place in point.motors
            if part == "all" or (point.name == name and (not dot or place == finger))
        }
    if not wanted:
        raise UsageError("no greasing point given", hint=f"use all, or some of {', '.join(known)}")
    return [(point, motor) for point in POINTS for motor in point.motors if (point.name, motor) in wanted]


DISPENSABLE = ("TEMP", "PTEMP", "OTEMP", "UPSECS", "SN")
"""What a firmware may lack without harm to the rest."""


class MaintenanceLog:
    """What one hand and the journal say about its care, read once."""

    def __init__(self, hand: BarrettHand, name: str = "") -> None:
        self.at = hand.by_name("OD", *DISPENSABLE, dispensable=DISPENSABLE)
        self._hand = hand
        self._path = state_path(FILE)
        self._journal = state_files.load(self._path, WHAT, _whole)
        serial = self.at.get(("SN", None), 0)
        self.ambiguous = serial == 0 and not name
        self._key = f"{'simulated-' if hand.link.fake else ''}{serial}{f'/{name}' if name else ''}"

    @property
    def entries(self) -> dict[str, Any]:
        """The journal's entries of this hand by ``point.motor``; none when its serial number says nothing."""
        return {} if self.ambiguous else dict(self._journal.get(self._key, {}))

    def grease(self, points: list[tuple[GreasePoint, str]]) -> None:
        """Record that `points` have been greased now. Raises UsageError for a serial number that many hands have."""
        if self.ambiguous:
            raise UsageError(
                "the serial number is 0, as on every hand upgraded in the field, so handctl cannot tell which hand this is",
                hint="name the hand with --hand NAME. Nothing was recorded.",
                code="which-hand",
            )
        date = datetime.now(timezone.utc).date().isoformat()
        new = {f"{point.name}.{motor}": {"odometer": self.at["OD", motor], "date": date} for point, motor in points}
        self._journal[self._key] = {**self.entries, **new}
        state_files.store(self._path, WHAT, self._journal)
        self._hand.journal.info("greased", f"recorded as greased today: {', '.join(new)}", hint=f"see {self._path}")

    def strokes(self, motor: str, counts: int | None = None) -> float:
        """Strokes of `motor` in `counts` thousands of encoder counts, of its life when not given (§7.3)."""
        thousands = self.at["OD", motor] if counts is None else counts
        return thousands * 1000 / STROKE[1 if motor == "SPREAD" else 0]

    def lubrication(self) -> list[Row]:
        """One row per point and motor: strokes since the last greasing, against 5,000."""
        rows = []
        for point in POINTS:
            for motor in point.motors:
                entry = self.entries.get(f"{point.name}.{motor}")
                if entry is not None and entry["odometer"] > self.at["OD", motor]:
                    self._hand.journal.warn(
                        "odometer-back",
                        f"{point.name}.{motor}: greased at odometer {entry['odometer']}, which now reads {self.at['OD', motor]}, so this is another hand or has new electronics. Counted from new",
                    )
                    entry = None
                rows.append(self._point(point, motor, entry))
        return rows

    def _point(self, point: GreasePoint, motor: str, entry: dict[str, Any] | None) -> Row:
        since = self.strokes(motor, self.at["OD", motor] - (entry["odometer"] if entry is not None else 0))
        left = int(STROKES_BETWEEN - since)
        never = WHOSE if self.ambiguous else NEVER
        when = f"greased {entry['date']}" if entry is not None else never
        name = f"lubrication_{point.name.replace('-', '_')}"
        label = f"{when}; {f'due in {left}' if left >= 0 else f'overdue by {-left}'}"
        done = _row(name, "OD", motor, int(since), "strokes", status=due(since), label=label, source=point.source)
        return done | {
            "point": f"{point.name}.{motor}",
            "title": point.title,
            "due_at": STROKES_BETWEEN,
            "greased": entry["date"] if entry is not None else None,
        }

    def rows(self) -> list[Row]:
        """Everything: way, greasing, temperatures, periodic work."""
        rows: list[Row] = []
        for motor in MOTORS:
            life = self.strokes(motor)
            rows += [
                _row("odometer", "OD", motor, self.at["OD", motor], "1000 cts", source="barrett §7.3"),
                _row("strokes", "OD", motor, int(life), "strokes", source="barrett §7.3"),
                _row("cycles", "OD", motor, round(life / 2), "cycles", label="closed and open", source="barrett §7.3"),
            ]
        rows += self.lubrication()
        for name, mnemonic, verdict in (
            ("temperature", "TEMP", health_limits.temperature),
            ("peak_temperature", "PTEMP", health_limits.peak),
            ("over_temperature_limit", "OTEMP", health_limits.over_temperature_limit),
        ):
            if (mnemonic, None) not in self.at:
                continue
            value = self.at[mnemonic, None]
            _, status, label, remedy, source = verdict(value)
            row = _row(name, mnemonic, None, value, "0.1 °C", status=status, label=label, source=source)
            rows.append(row | {"remedy": remedy or None})
        if ("UPSECS", None) in self.at:
            rows.append(_row("uptime_seconds", "UPSECS", None, self.at["UPSECS", None], "s", source="barrett §5.4.2"))
        for row in rows:
            if row["name"] in BARRETT and (doubt := why_doubtful(BARRETT[row["name"]], 0, row["value"])):
                row["doubt"] = doubt
        later = [(row_of(name, None, None, None, None), text, source) for name, text, source in PERIODIC]
        return rows + [row | {"status": SKIPPED, "label": text, "source": source} for row, text, source in later]


def _whole(entry: object) -> bool:
    return isinstance(entry, dict) and all(
        isinstance(point, dict) and isinstance(point.get("odometer"), int) and isinstance(point.get("date"), str)
        for point in entry.values()
    )


def _row(*cells: Any, status: str | None = None, label: str | None = None, source: str | None = None) -> Row:
    return row_of(*cells, status=status, label=label, source=source)


def table_of(hand: BarrettHand, care: MaintenanceLog, *, check: bool) -> Table:
    """The rows; with `check`, anything due or too hot is exit 7."""
    rows = care.rows()
    if care.ambiguous:
        hand.journal.warn(
            "which-hand",
            "the serial number is 0, as on every hand upgraded in the field, so the greasing journal was not used",
            hint="name the hand with --hand NAME",
        )
    elif any(row.get("due_at") and row["greased"] is None for row in rows):
        hand.journal.info(
            "never-greased",
            "no greasing is recorded for some points, so they are counted from the hand's first stroke",
            hint="`handctl barrett maintenance --greased POINT` records the work",
        )
    table = Table(rows=rows, columns=COLUMNS, view=view)
    bad = [row for row in rows if row["status"] in (WARNING, FAIL)]
    if check and bad:
        names = ", ".join(".".join(filter(None, (row["name"], row["motor"]))) for row in bad)
        table.failure = CheckFailed(
            f"{hand.link.name}: maintenance is due ({len(bad)}): {names}",
            hint="`handctl barrett maintenance --steps PROCEDURE` lists the work",
            code="care-due",
        )
    return table


def view(rows: list[Row]) -> list[Grid]:
    """Way per motor, greasing per point, then temperatures and periodic work as notes."""
    at = {(row["name"], row["motor"]): row["value"] for row in rows}
    way = tuple((motor, *(str(at[name, motor]) for name in ("odometer", "strokes", "cycles"))) for motor in MOTORS)
    points = [row for row in rows if row.get("due_at")]
    greasing = tuple(
        (row["point"], row["title"], f"{row['value']}", Cell(row["status"], TONES[row["status"]]), row["label"].partition("; ")[2])
        for row in points
    )  # fmt: skip
    whens = {row["label"].partition("; ")[0] for row in points}
    sections = tuple(
        f"{title}: {source}" for title, source in dict.fromkeys((row["title"], row["source"]) for row in points)
    )
    rest = tuple(
        f"{row['name'].replace('_', ' ')}: {row['label']}{_next(row)} ({row['source']})"
        for row in rows
        if row["label"] and row["name"] != "cycles" and not row.get("due_at")
    )
    when = (
        (f"last greasing: {whens.pop()}",) if len(whens) == 1 else tuple(f"{r['point']}: {r['label']}" for r in points)
    )
    return [
        Grid(("Motor", "Odometer", "Strokes", "Cycles"), way, right=frozenset({1, 2, 3})),
        Grid(
            ("Point", "Lubrication", "Strokes", "Status", f"Due at {STROKES_BETWEEN}"),
            greasing,
            right=frozenset({2}),
            notes=(*when, *sections),
        ),
        Grid(("Temperatures and periodic work",), (), notes=rest),
    ]


def _next(row: Row) -> str:
    return f". Next: {row['remedy']}" if row.get("remedy") else ""
