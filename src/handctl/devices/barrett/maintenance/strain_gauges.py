"""Strain gauges without load: statistics against 100 to 140, and the view for turning the potentiometer (barrett §7.4, §9.4).

A reading is without load only when the fingers stand open at their stops; `prepare` moves them there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from handctl.devices.barrett import motion
from handctl.devices.barrett.device import BarrettHand, step_of
from handctl.devices.barrett.maintenance import symptoms
from handctl.devices.barrett.maintenance.health_limits import Finding
from handctl.devices.barrett.parameter_map import FINGERS, NO_GAUGE
from handctl.devices.barrett.status_and_parameter_views import NAME, STATUS, live, row_of
from handctl.errors import CheckFailed, Hint
from handctl.model.check_rows import FAIL, OK, SKIPPED, TONES, WARNING
from handctl.model.movement import ENDED
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.wording import plural

NO_LOAD = (100, 140)
"""Strain reading without load (§7.4)."""
READINGS = 20
OPEN_WITHIN = 250
"""Counts from the open target that count as open: two degrees of the inner link."""
PREPARATION = (
    ("HI", "initialize: the fingers open fully"),
    ("4T", "free the spread"),
    ("123O", "open the fingers against their stops"),
)
"""What §7.4 steps 1 and 2 and §9.4 ask for (HI, ST, GO)."""
COLUMNS = (
    NAME,
    Column("motor", "Finger"),
    Column("value", "Mean", right=True),
    Column("min", "Min", right=True),
    Column("max", "Max", right=True),
    STATUS,
    Column("evidence", "Seen"),
)


def no_load(readings: Mapping[str, Sequence[int]], *, check: str = "strain") -> list[Finding]:
    """Strain readings per finger against `NO_LOAD`. 255 everywhere is a hand without gauges, which is no defect."""
    if all(value == NO_GAUGE for values in readings.values() for value in values):
        return [Finding(check, SKIPPED, "no strain gauges: every reading is 255", source="barrett §5.3.2")]
    found = []
    for finger, values in readings.items():
        name, source = f"{check}.{finger}", "barrett §7.4"
        mean = sum(values) / len(values)
        shown = f"mean {mean:.1f}, {min(values)} to {max(values)} in {plural(len(values), 'reading')}"
        adjust = Hint("zero it at the balancing potentiometer: {}", "barrett strain --live")
        if max(values) >= NO_GAUGE or min(values) <= 0:
            remedy = "check the gauge, its wires and contact pins, and the finger's seat, then ask the vendor"
            found.append(Finding(name, FAIL, f"{shown}: at the end of the scale", remedy, "barrett §7.3, §9.4"))
        elif not NO_LOAD[0] <= mean <= NO_LOAD[1]:
            found.append(Finding(name, WARNING, f"{shown}: outside {NO_LOAD[0]} to {NO_LOAD[1]}", adjust, source))
        else:
            found.append(Finding(name, OK, shown, source=source))
    return found


def preparation_steps() -> list[Step]:
    """The exact bytes of the preparatory movements."""
    return [step_of(text)._replace(meaning=meaning) for text, meaning in PREPARATION]


def prepare(hand: BarrettHand, prompts: Prompts) -> None:
    """Initialize, free the spread, open the fingers. Raises what the hand refuses, Interrupted after Ctrl-C."""
    motion.moved(hand, "", "HI", None, prompts)
    motion.power_off(hand, "4")
    motion.moved(hand, "123", "O", None, prompts, ENDED)


def measure(hand: BarrettHand, count: int = READINGS) -> dict[str, list[int]]:
    """`count` readings of SG per finger, one line each."""
    readings: dict[str, list[int]] = {finger: [] for finger in FINGERS}
    for _ in range(count):
        at = hand.by_name("SG", motors=range(3))
        for finger, found in readings.items():
            found.append(at["SG", finger])
    return readings


def loaded_fingers(hand: BarrettHand) -> list[str]:
    """Why each finger's reading may not be without load: not initialized, or not open. Also warns of SGFLIP."""
    at = hand.by_name("P", "S", "OT", "SGFLIP", motors=range(3), dispensable=("SGFLIP", "OT"))
    flipped = [finger for finger in FINGERS if at.get(("SGFLIP", finger))]
    if flipped:
        hand.journal.warn(
            "strain-flip",
            f"SGFLIP is 1 for {', '.join(flipped)}, so the readings are inverted",
            hint=Hint("run {} before you adjust anything (barrett §5.3.4)", "barrett set SGFLIP=0"),
        )
    found = []
    for finger in FINGERS:
        if at["S", finger] & 4:
            found.append(f"{finger} is not initialized")
        elif abs(at["P", finger] - at.get(("OT", finger), 0)) > OPEN_WITHIN:
            found.append(f"{finger} is at {at['P', finger]}")
    return found


def warn_if_loaded(hand: BarrettHand) -> list[str]:
    """Warn about fingers that are not open; returns them with the reason."""
    loaded = loaded_fingers(hand)
    if loaded:
        hand.journal.warn(
            "not-open",
            f"the gauges are unloaded only when the fingers are open: {', '.join(loaded)}",
            hint=Hint("{} opens them first", "barrett strain --open"),
        )
    return loaded


def table(hand: BarrettHand, *, check: bool) -> Table:
    """Statistics and verdict; with `check`, a reading outside is exit 7."""
    loaded = {text.partition(" ")[0]: text for text in warn_if_loaded(hand)}
    readings = measure(hand)
    verdicts = no_load(readings)
    rows = []
    for number, finger in enumerate(FINGERS):
        verdict = verdicts[number if len(verdicts) > 1 else 0]
        values = readings[finger]
        none = verdict.status == SKIPPED
        more = {
            "min": min(values),
            "max": max(values),
            "readings": len(values),
            "low": NO_LOAD[0],
            "high": NO_LOAD[1],
            "fingers_open": not loaded,
            "doubt": "no gauge" if none else f"may be loaded: {loaded[finger]}" if finger in loaded else None,
        }
        mean = None if none else round(sum(values) / len(values), 2)
        found = {key: value for key, value in verdict.row().items() if key != "check"}
        rows.append(row_of("strain_no_load", "SG", finger, mean, None, **more, **found))
    result = Table(rows=rows, columns=COLUMNS, view=view)
    bad = [finding for finding in verdicts if finding.bad]
    if check and bad:
        text = "; ".join(f"{finding.check}: {finding.evidence}" for finding in bad)
        hint = Hint("adjust the gauge: {}", "barrett strain --live")
        result.failure = CheckFailed(f"{hand.link.name}: {text}", hint=hint, code="strain")
    return result


def view(rows: list[Row]) -> list[Grid]:
    """One line per finger; the adjusting procedure below when a reading is outside."""
    lines = tuple(
        (
            row["motor"],
            "none" if row["value"] is None else f"{row['value']:.1f}",
            str(row["min"]),
            str(row["max"]),
            f"{row['low']}-{row['high']}",
            Cell(row["status"], TONES[row["status"]]),
        )
        for row in rows
    )
    notes = []
    if any(row["status"] == SKIPPED for row in rows):
        notes.append(f"{rows[0]['evidence']} ({rows[0]['source']})")
    notes += [f"{row['motor']}: {row['remedy']} ({row['source']})" for row in rows if row["remedy"]]
    if any(row["status"] == WARNING for row in rows):
        notes += symptoms.lines("strain")
    headings = ("Finger", "Mean", "Min", "Max", "No load", "Status")
    return [Grid(headings, lines, right=frozenset({1, 2, 3}), notes=tuple(notes))]


# -- adjusting ----------------------------------------------------------------------------------------------------


def _adjusting(hand: BarrettHand) -> list[Row]:
    """Rows of a moment: the reading, and how far it is outside the window."""
    at = hand.by_name("SG", motors=range(3))
    rows = []
    for finger in FINGERS:
        doubt = "no gauge" if at["SG", finger] == NO_GAUGE else None
        rows.append(row_of("strain", "SG", finger, at["SG", finger], None, doubt=doubt))
    for finger in FINGERS:
        outside, label = deviation(at["SG", finger])
        rows.append(row_of("beside_window", "SG", finger, outside, None, label=label))
    return rows


def deviation(value: int) -> tuple[int | None, str]:
    """How far a reading is outside 100 to 140, signed, and in words; None without a gauge."""
    low, high = NO_LOAD
    if value == NO_GAUGE:
        return None, "no gauge"
    if value > high:
        return value - high, f"{value - high} above 140"
    if value < low:
        return value - low, f"{low - value} below 100"
    return 0, "ok"


def stream(hand: BarrettHand, **timing: Any) -> Table:
    """Readings as a stream: the bar's ends are 100 and 140, and half full is the middle of the window."""
    warn_if_loaded(hand)
    low, high = NO_LOAD
    return live(
        hand,
        partial(_adjusting, hand),
        **timing,
        columns=(*hand.columns[:5], Column("label", "Window")),
        ranges={"strain": (float(low), float(high))},
        flags=frozenset({"beside_window"}),
    )
