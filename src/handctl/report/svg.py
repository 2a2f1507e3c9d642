"""Curves of a short watch as inline SVG: one small picture per element of a quantity. Knows neither page nor device.

The scale is that of the curve itself, but never finer than a few steps of the last digit: the flicker of one step must
not look like a movement.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape as escape_markup
from typing import Any

from handctl.model.result import Row, Sample

WIDTH, HEIGHT, MARGIN = 180, 48, 4
FINEST = 8
"""The picture's height is at least so many steps of the last digit."""
FINEST_PART = 0.01
"""The same where the digits do not tell the step: part of the largest value."""
MOST_LABELS = 3
PARTS = ("finger", "element", "motor")


def escape(text: str) -> str:
    """Text for the page: no markup, and nothing that HTML cannot hold."""
    return escape_markup(
        "".join(letter if letter.isprintable() or letter == "\n" else "\N{REPLACEMENT CHARACTER}" for letter in text)
    )


class Curve:
    """One element over time: `points` are (seconds, value), a value None where the read failed."""

    def __init__(self, row: Row, decimals: int) -> None:
        self.name = str(row["name"])
        self.part = " ".join(str(row[key]) for key in PARTS if row.get(key))
        self.unit = str(row.get("unit") or "")
        self.decimals = decimals
        self.points: list[tuple[float, float | None]] = []
        self.labels: dict[str, None] = {}

    def add(self, t: float, row: Row) -> None:
        """The value of this moment."""
        value = row.get("value")
        number = isinstance(value, int | float) and not isinstance(value, bool)
        self.points.append((t, float(value) if number and value is not None else None))
        if row.get("label"):
            self.labels[str(row["label"])] = None

    @property
    def values(self) -> list[float]:
        """The values that were read."""
        return [value for _, value in self.points if value is not None]

    def text(self, value: float) -> str:
        """A value with its decimals."""
        whole = value == int(value) and not self.decimals
        return f"{value:.{self.decimals}f}" if self.decimals or whole else f"{value:.6g}"

    @property
    def meaning(self) -> str:
        """What its values mean in words, as long as that is short."""
        return ", ".join(self.labels) if len(self.labels) <= MOST_LABELS else ""

    @property
    def summary(self) -> str:
        """``min 12, max 15, last 14``, ``14 all the time``, ``not read``."""
        values = self.values
        if not values:
            return "not read"
        if min(values) == max(values):
            text = f"{self.text(values[-1])} all the time"
        else:
            text = f"min {self.text(min(values))}, max {self.text(max(values))}, last {self.text(values[-1])}"
        failed = len(self.points) - len(values)
        return f"{text}, {failed} of {len(self.points)} not read" if failed else text


def curves(samples: Iterable[Sample], decimals: Mapping[str, int]) -> dict[str, list[Curve]]:
    """Quantity -> its elements' curves, in the order of the rows."""
    found: dict[tuple[Any, ...], Curve] = {}
    for sample in samples:
        for row in sample.rows:
            key = (row["name"], *(row.get(part) for part in PARTS))
            if key not in found:
                found[key] = Curve(row, decimals.get(str(row["name"]), 0))
            found[key].add(sample.t, row)
    groups: dict[str, list[Curve]] = {}
    for curve in found.values():
        groups.setdefault(curve.name, []).append(curve)
    return groups


def draw(curve: Curve, seconds: float) -> str:
    """The SVG of a curve over `seconds`; a gap where reads failed. Colours come from the page's style."""
    label = f"{curve.name} {curve.part}".strip() + f" over {seconds:.1f} s: {curve.summary}"
    lines = "".join(_line(run) for run in _runs(curve, seconds))
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label)}">'
        f'<path class="axis" d="M{MARGIN} {HEIGHT - 1}H{WIDTH - MARGIN}"/>{lines}</svg>'
    )


def _runs(curve: Curve, seconds: float) -> list[list[tuple[float, float]]]:
    """Stretches without a gap, as places in the picture."""
    values = curve.values
    if not values:
        return []
    low, high = min(values), max(values)
    span = max(high - low, _finest(curve, values))
    middle = (low + high) / 2
    runs: list[list[tuple[float, float]]] = [[]]
    for t, value in curve.points:
        if value is None:
            runs.append([])
            continue
        x = MARGIN + (t / seconds if seconds > 0 else 0.5) * (WIDTH - 2 * MARGIN)
        y = HEIGHT / 2 - (value - middle) / span * (HEIGHT - 2 * MARGIN - 2)
        runs[-1].append((x, y))
    return [run for run in runs if run]


def _finest(curve: Curve, values: Sequence[float]) -> float:
    if curve.decimals or all(value == int(value) for value in values):
        return FINEST * 10.0**-curve.decimals
    return FINEST_PART * max(map(abs, values))


def _line(places: Sequence[tuple[float, float]]) -> str:
    if len(places) == 1:
        return f'<circle class="curve" cx="{places[0][0]:.1f}" cy="{places[0][1]:.1f}" r="1.5"/>'
    return f'<polyline class="curve" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}"/>'
