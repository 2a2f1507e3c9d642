"""A report as one HTML page: no script, nothing from outside, for a phone, a dark screen and A4 paper alike.

Everything that is not written in this file passes through `escape`. Knows what a report says, not where it comes from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape as escape_markup
from importlib.resources import files
from typing import Any

from handctl.errors import HandctlError
from handctl.families import FAMILIES
from handctl.model.result import Cell, Grid, Message, Row, Sample
from handctl.sentence import sentence


@dataclass(slots=True)
class Report:
    """What the page says; texts are final (redacted already), not yet escaped.

    problems   (section, error) in the order they happened; then the page is incomplete
    curves     quantity -> its elements; `words` are the quantities whose numbers are codes
    masked     what the device sent is left out of the transcript
    missing    why a section is empty, by its name
    """

    kind: str
    command: str
    version: str
    made: str
    simulated: bool
    facts: list[tuple[str, str]] = field(default_factory=list)
    problems: list[tuple[str, HandctlError]] = field(default_factory=list)
    findings: list[Message] = field(default_factory=list)
    checks: list[Grid] = field(default_factory=list)
    status: list[Grid] = field(default_factory=list)
    dump: list[Grid] = field(default_factory=list)
    curves: dict[str, list[Curve]] = field(default_factory=dict)
    words: frozenset[str] = frozenset()
    watched: str = ""
    seconds: float = 0.0
    counters: list[tuple[str, str]] = field(default_factory=list)
    environment: list[tuple[str, str]] = field(default_factory=list)
    transcript: list[str] = field(default_factory=list)
    privacy: str = ""
    masked: bool = False
    missing: dict[str, str] = field(default_factory=dict)


LEVELS = {"error": "Error", "warning": "Warning", "info": "Note"}
SECTIONS = ("Findings", "Status", "Watch", "Dump", "Counters", "Environment", "Transcript")
POLICY = "; ".join(("default-src 'none'", "style-src 'unsafe-inline'", "base-uri 'none'", "form-action 'none'"))
"""The browser itself refuses anything from outside."""


def page(report: Report) -> str:
    style = files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    title = f"{_name(report.kind)}: service report, {report.made}"
    bodies = (
        _findings(report),
        _grids(report.status, report, "Status"),
        _watch(report),
        _grids(report.dump, report, "Dump"),
        _facts(report.counters),
        _facts(report.environment),
        _transcript(report),
    )
    sections = "".join(
        f'<section id="{name.lower()}" aria-labelledby="h-{name.lower()}"><h2 id="h-{name.lower()}">{name}</h2>\n{body}</section>\n'
        for name, body in zip(SECTIONS, bodies, strict=True)
    )
    links = "".join(f'<li><a href="#{name.lower()}">{name}</a></li>' for name in SECTIONS)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f'<meta name="generator" content="handctl {escape(report.version)}">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f'{_header(report)}<nav aria-label="Sections"><ul>{links}</ul></nav>\n<main>\n{sections}</main>\n'
        f'<footer><p class="note">This page is {escape(report.privacy)}.</p></footer>\n</body>\n</html>\n'
    )


def _name(kind: str) -> str:
    """The device, without its wires: ``Inspire EH55BF1 exoskeleton hand``."""
    return FAMILIES[kind].help.partition(" (")[0] if kind in FAMILIES else kind


def _header(report: Report) -> str:
    mark = '<p class="mark">Simulated: these values are not from a device</p>\n' if report.simulated else ""
    facts = [*report.facts, ("made", report.made), ("tool", f"handctl {report.version} ({report.command})")]
    return f"<header>\n{mark}<h1>{escape(_name(report.kind))}: service report</h1>\n{_facts(facts)}{_problems(report)}</header>\n"


def _problems(report: Report) -> str:
    if not report.problems:
        return ""
    items = "".join(_item(f"<strong>{escape(section)}</strong>:", error) for section, error in report.problems)
    return f'<div class="problems"><p class="error">Incomplete: parts of the device could not be read</p><ul>{items}</ul></div>\n'


def _item(head: str, said: HandctlError | Message) -> str:
    hint = f'<br><span class="note">Next: {escape(sentence(said.hint))}</span>' if said.hint else ""
    return f"<li>{head} {escape(sentence(said.text))} [<code>{escape(said.code)}</code>]{hint}</li>"


def _findings(report: Report) -> str:
    items = "".join(
        _item(f'<span class="{escape(found.level)}">{LEVELS.get(found.level, "Note")}:</span>', found)
        for found in report.findings
    )
    if not items and "Findings" in report.missing:
        return _empty(report, "Findings")
    said = f"<ul>{items}</ul>\n" if items else ""
    if not items and not report.checks:
        said = "<p>Nothing unhealthy was found.</p>\n"
    return said + "".join(_table(grid) for grid in report.checks)


def _empty(report: Report, section: str) -> str:
    return f'<p class="note">{escape(report.missing.get(section, "nothing"))}</p>\n'


def _facts(facts: Iterable[tuple[str, str]]) -> str:
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in facts)
    return f"<dl>{rows}</dl>\n"


# -- tables -------------------------------------------------------------------------------------------------------


def _grids(grids: Sequence[Grid], report: Report, section: str) -> str:
    return "".join(_table(grid, f"{section} {number}") for number, grid in enumerate(grids, 1)) or _empty(
        report, section
    )


def _table(grid: Grid, name: str = "Checks") -> str:
    right = [' class="right"' if position in grid.right else "" for position in range(len(grid.headings))]
    heads = "".join(
        f'<th scope="col"{side}>{escape(text)}</th>' for text, side in zip(grid.headings, right, strict=True)
    )
    lines = "".join(f"<tr>{_cells(line, grid)}</tr>\n" for line in grid.lines)
    caption = f"<caption>{escape(grid.title)}</caption>" if grid.title else ""
    notes = "".join(f'<p class="note">{escape(note)}</p>\n' for note in grid.notes)
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(grid.title or name)}">'
        f"<table>{caption}<thead><tr>{heads}</tr></thead>\n<tbody>{lines}</tbody></table></div>\n{notes}"
    )


def _cells(line: Sequence[str | Cell], grid: Grid) -> str:
    cells = []
    for position, cell in enumerate(line):
        text, tone = (cell.text, cell.tone) if isinstance(cell, Cell) else (cell, "")
        names = " ".join(filter(None, (tone, "right" if position in grid.right else "")))
        cells.append(f"<td{f' class={chr(34)}{escape(names)}{chr(34)}' if names else ''}>{escape(text)}</td>")
    return "".join(cells)


# -- curves and bytes ---------------------------------------------------------------------------------------------


def _watch(report: Report) -> str:
    if not report.curves:
        return _empty(report, "Watch")
    parts = [f'<p class="note">{escape(report.watched)} Each picture has its own scale.</p>\n']
    for name, group in report.curves.items():
        unit = f" [{group[0].unit}]" if group[0].unit else ""
        parts.append(f"<h3>{escape(name + unit)}</h3>\n")
        parts.append(_words(group) if name in report.words else _plots(group, report.seconds))
    return "".join(parts)


def _plots(group: Sequence[Curve], seconds: float) -> str:
    figures = "".join(
        f"<figure>{draw(curve, seconds)}<figcaption>{escape(curve.part or curve.name)}"
        f"<span>{escape(curve.summary)}</span><span>{escape(curve.meaning)}</span></figcaption></figure>\n"
        for curve in group
    )
    return f'<div class="plots">{figures}</div>\n'


def _words(group: Sequence[Curve]) -> str:
    """Codes and bits: what they meant, in the order they came."""
    return _facts((curve.part or curve.name, ", ".join(curve.labels) or curve.summary) for curve in group)


def _transcript(report: Report) -> str:
    if not report.transcript:
        return _empty(report, "Transcript")
    said = "> is the host, < the device. Times are seconds since the link was opened. "
    said += (
        "The bytes of the device are left out because they hold ids. --include-ids keeps them."
        if report.masked
        else "-p replay:FILE plays it back."
    )
    return f'<p class="note">{escape(said)}</p>\n<pre>{escape(chr(10).join(report.transcript))}</pre>\n'


# -- curves of a short watch, as inline SVG: one small picture for each element of a quantity ----------------------------
#
# The scale is that of the curve itself, but never finer than a few steps of the last digit: the flicker of one step must
# not look like a movement.


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
