"""A device as people see it: its fingers or joints as bars in their place, coloured by one quantity of them.

A family has its OUTLINE next to its remedies: `describe` loads those, so what draws is imported late. Knows rows, and no terminal and no page.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import import_module
from itertools import product

from handctl.errors import joined, reworded
from handctl.families import FAMILIES
from handctl.fast_classes import NamedTuple, fast_dataclass, field
from handctl.model.result import Cell, Finding, Grid, Row

UNKNOWN = "unknown_bit"
"""Begins the name of a bit that the manual does not have; its row of a table has this key."""

PASSES = frozenset(["over_temperature", "hot"])
"""Findings that time alone ends: what else is set has a next step of its own."""


class Remedy(NamedTuple):
    """What a finding means, what to do about it, and where that is from."""

    meaning: str
    step: str
    source: str

    @property
    def hint(self) -> str:
        """The next step of a message."""
        return reworded(self.step, f"{self.step} ({self.source})")


def remedies_of(kind: str) -> Mapping[str, Remedy]:
    """The table of a family, {} where it has none."""
    try:
        found: Mapping[str, Remedy] = import_module(FAMILIES[kind].module("remedies")).REMEDIES
    except ModuleNotFoundError:
        return {}
    return found


def worst_of(table: Mapping[str, Remedy], keys: Iterable[str]) -> str:
    """The key whose row comes first; "" where none has one."""
    known = {UNKNOWN if key.startswith(UNKNOWN) else key for key in keys}
    return next((key for key in table if key in known), "")


def hint_of(kind: str, findings: Sequence[Finding]) -> str:
    """The next step for several: that of the most urgent one."""
    table = remedies_of(kind)
    worst = worst_of(table, (key for finding in findings for key in finding.keys))
    steps = [hint_for(kind, finding) for finding in findings if worst_of(table, finding.keys) == worst]
    return steps[0] if steps else ""


def hint_for(kind: str, finding: Finding) -> str:
    """The next step for a finding, "" where the table has none. What passes by itself leaves the others their own step."""
    table = remedies_of(kind)
    key = worst_of(table, finding.keys)
    if finding.step or not key:
        return finding.step
    more = worst_of(table, set(finding.keys) - PASSES) if key in PASSES else ""
    return joined(table[key].hint, table[more].hint) if more else table[key].hint


MOST = 8
"""Letters of a value above a bar; a longer one, which is a list of error bits, stands below the picture."""


class Bar(NamedTuple):
    """One finger or joint: `foot` is the row at which it begins, 0 the upper edge of the palm; a negative `length` points down."""

    part: str
    foot: int
    length: int


class Measure(NamedTuple):
    """A quantity by which bars are coloured. `path` has {} for the part; `most` is the value from which on it is bad."""

    path: str
    most: float | None = None


@fast_dataclass(frozen=True)
class Outline:
    """bars      from left to right
    measures  what `--picture` takes -> the quantity, the usual one first
    errors    path of the error bits: a bar with one of them is bad, whatever its colour means
    bend      path of the position, and its values when a finger is bent and when it is straight; None = not known
    palm      how many rows the palm has
    note      how the drawing is meant
    """

    bars: tuple[Bar, ...]
    measures: Mapping[str, Measure]
    errors: str = ""
    bend: tuple[str, float, float] | None = None
    palm: int = 2
    note: str = ""
    ends: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class BarWithValue(NamedTuple):
    """A bar with its value: its row, {} = none; how far it is straight (0 to 1); the value as text; "good", "warn", "bad" or "dim"."""

    bar: Bar
    row: Row
    share: float
    text: str
    tone: str


def outline_of(kind: str) -> Outline | None:
    """The outline of a family, None where it has none."""
    try:
        found: Outline | None = getattr(import_module(FAMILIES[kind].module("outline")), "OUTLINE", None)
    except ModuleNotFoundError:
        return None
    return found


def highest_of(kind: str) -> dict[str, float]:
    """Path of a quantity -> the value from which on it is bad."""
    outline = outline_of(kind)
    return {
        measure.path.format(bar.part): measure.most
        for bar, measure in product(outline.bars, outline.measures.values()) if measure.most is not None
    } if outline is not None else {}  # fmt: skip


def hand(fingers: Sequence[str], thumb: Sequence[str]) -> tuple[Bar, ...]:
    """The bars of a hand: four fingers, little to index, then the actuators of the thumb, tip first."""
    lengths = dict(zip(fingers, (5, 6, 7, 6), strict=True))
    return (
        *(Bar(name, 0, length) for name, length in lengths.items()),
        *(Bar(name, -3, 4 - 2 * number) for number, name in enumerate(thumb)),
    )


def bars_with_values(outline: Outline, by: str, rows: Iterable[Row]) -> list[BarWithValue]:
    """The bars with the values of these rows; a bar that no row is of is dim."""
    at = {str(row.get("path")): row for row in rows}
    measure = outline.measures[by]
    return [_painted(outline, measure, bar, at) for bar in outline.bars]


def _painted(outline: Outline, measure: Measure, bar: Bar, at: Mapping[str, Row]) -> BarWithValue:
    from handctl.model.reading_limits import severity, shown_value

    row = at.get(measure.path.format(bar.part), {})
    wrong = at.get(outline.errors.format(bar.part), {}).get("errors") if outline.errors else None
    value = shown_value(row)
    if row.get("doubt"):
        row, value = {**row, "error": row["doubt"]}, None
    if value is None:
        text, tone = "?" if "error" in row else "-", "dim"
    else:
        text = str(row.get("label") or f"{value:g}") if "errors" in row else f"{value:g}"
        tone = ("good", "warn", "bad")[severity(abs(value), highest=measure.most)]
    return BarWithValue(bar, row, _share(outline, bar, at), text, "bad" if wrong or row.get("errors") else tone)


def _share(outline: Outline, bar: Bar, at: Mapping[str, Row]) -> float:
    if outline.bend is None:
        return 1.0
    from handctl.model.reading_limits import shown_value

    path, bent, straight = outline.bend
    bent, straight = outline.ends.get(bar.part, (bent, straight))
    row = at.get(path.format(bar.part), {})
    value = shown_value(row)
    if value is None or row.get("doubt"):
        return 1.0
    return min(1.0, max(0.0, (value - bent) / (straight - bent)))


def title(outline: Outline, by: str, rows: Iterable[Row]) -> str:
    """What the colours mean: the quantity with its unit."""
    path = outline.measures[by].path
    paths = {path.format(bar.part) for bar in outline.bars}
    unit = next((row.get("scaled_unit") or row.get("unit") for row in rows if row.get("path") in paths), None)
    return f"{by} [{unit}]" if unit else by


def outline_grid(outline: Outline, by: str, rows: Sequence[Row]) -> Grid:
    """The outline as a table: a column for each bar, its value on top. Nothing is drawn of other actuators."""
    bars = bars_with_values(outline, by, rows)
    if not any(one.row for one in bars):
        return Grid((), (), notes=("The places of its actuators are not known, so there is no picture.",))
    top = max(0, *(one.bar.foot + max(0, one.bar.length) for one in bars))
    low = min(-outline.palm, *(one.bar.foot + min(0, one.bar.length) for one in bars))
    palm = [number for number, one in enumerate(bars) if one.bar.foot == 0]
    long = [one for one in bars if len(one.text) > MOST]
    said = ["error" if one in long else one.text for one in bars]
    lines: list[tuple[str | Cell, ...]] = [tuple(Cell(text, one.tone) for text, one in zip(said, bars, strict=True))]
    full, _, inner = _characters()
    ground = [
        Cell(inner * max(len(full), len(said[number]), len(one.bar.part)), "dim")
        if palm and palm[0] <= number <= palm[-1]
        else ""
        for number, one in enumerate(bars)
    ]
    for row in range(top - 1, low - 1, -1):
        inside = -outline.palm <= row < 0
        lines.append(tuple(_cell(one, row) or (ground[number] if inside else "") for number, one in enumerate(bars)))
    return Grid(
        tuple(one.bar.part for one in bars),
        tuple(lines),
        title(outline, by, rows),
        notes=(*(f"{one.bar.part}: {one.text}" for one in long), *filter(None, (outline.note,))),
    )


@cache
def _characters() -> tuple[str, str, str]:
    """Of a bar, of what it lacks, and of the palm."""
    from handctl.system.terminal import FINE

    return ("████", "░░░░", "▒") if FINE else ("████", "....", ":")


def _cell(one: BarWithValue, row: int) -> Cell | None:
    """The piece of a bar in a row; None where it is not."""
    _, foot, length = one.bar
    place = row - foot if length > 0 else foot - 1 - row
    if not 0 <= place < abs(length):
        return None
    full, empty, _ = _characters()
    return Cell(full if place < max(1, round(one.share * abs(length))) else empty, one.tone)
