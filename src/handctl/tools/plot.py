"""`handctl plot`: the curves of recordings as one picture, without a device."""

from __future__ import annotations

import csv
import json
import os
import sys
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from math import isfinite
from typing import Any, BinaryIO

import click

from handctl import files
from handctl.charts.curves import PIXELS, SIDE, STYLE, Curve, Strip, escape, outline_svg, picture, unchanged
from handctl.command.command_tree import Command
from handctl.command.options import InFile
from handctl.command.run import Run
from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.misspellings import near
from handctl.model.param import scale_of
from handctl.model.result import PARTS, Column, Row, Table
from handctl.record.csv_and_sidecar import schema
from handctl.screen.csv_output import of_column
from handctl.wording import plural

# -- the CSV files of `watch`, `log` and `realtime` as curves: of each pixel the lowest and the highest value ------


TIME = "t_s"
ABOUT = frozenset(
    {
        TIME,
        "host_utc_s",
        "host_mono_s",
        "boot_ms",
        "time",
        "segment",
        "seq",
        "rtt_ms",
        "error",
        "mark",
        "doubt",
        "guard",
    }
)
"""Columns of which no curve is drawn."""
HOLES = ("[gap ", "[port lost]")
"""How the mark of a row begins before which a log has a hole."""
GAP_PERIODS, GAP_PIXELS = 3, 1.5
"""Rows of a file without marks that are so many usual intervals apart, and seen to be, have a hole between them."""
TAIL = 1 << 16
"""Bytes that are looked at for the last row; no row is longer."""
LARGEST_SIDECAR = 1 << 26
NEXT = "plot takes what `watch -o FILE.csv`, `log FILE.csv` or `realtime -o FILE.csv` wrote"


Track = tuple[Curve, float]
"""The curve of one column, and the factor from its unit to that of the curve."""


@dataclass(slots=True)
class Plotted:
    """What one file holds. `kind` is the family, where a sidecar says it.

    damaged  rows with another number of fields or no time, and values of a curve that are no numbers
    """

    path: str
    rows: int = 0
    seconds: float = 0.0
    curves: list[Curve] = field(default_factory=list)
    holes: list[tuple[float, float]] = field(default_factory=list)
    marks: list[tuple[float, str]] = field(default_factory=list)
    damaged: int = 0
    simulated: bool = False
    kind: str = ""


def read(path: str) -> Plotted:
    """The curves of a file. Raises UsageError."""
    found = Plotted(path)
    with files.opened(path, "a recording", hint=NEXT, code="no-file") as file:
        header = _fields(_text(file.readline(TAIL)))
        if not header:
            raise UsageError(f"{path} is empty", hint=NEXT, code="no-rows")
        time = next((name for name in (TIME, "time") if name in header), None)
        if time is None:
            what = "it holds one moment" if {"name", "value"} <= set(header) else f"it has no column {TIME}"
            raise UsageError(f"{path}: no curve can be drawn: {what}", hint=NEXT, code="no-time")
        _Reading(found, header, header.index(time), file).run()
    if not found.rows:
        raise UsageError(f"{path}: no row of it can be read", hint=NEXT, code="no-rows")
    _sidecar(found)
    return found


def _fields(text: str) -> list[str]:
    """The fields of a line; of one that is no CSV, as with a bare CR in it, the line as one field."""
    try:
        return next(csv.reader([text]), [])
    except csv.Error:
        return [text]


def _text(line: bytes) -> str:
    return line.decode("utf-8-sig", "replace").rstrip("\r\n")


def _seconds(text: str) -> float:
    """A time of a row: seconds, or a time of day. Raises ValueError."""
    if ":" in text:
        return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
    return _number(text)


def _number(text: str) -> float:
    """A number. Raises ValueError for a text that is none, for NaN and infinity too."""
    if isfinite(number := float(text)):
        return number
    raise ValueError(text)


def _numbers(texts: set[str]) -> tuple[dict[str, float], list[str]]:
    """The numbers among these texts, and the texts that are none."""
    numbers, others = dict[str, float](), list[str]()
    for text in texts:
        try:
            numbers[text] = _number(text)
        except ValueError:
            others.append(text)
    return numbers, others


class _Reading:
    """One pass through a file, pixel by pixel."""

    def __init__(self, found: Plotted, header: list[str], time: int, file: BinaryIO) -> None:
        self._found, self._header, self._time, self._file = found, header, time, file
        self._mark = header.index("mark") if "mark" in header else -1
        self._tracks: dict[Any, Track | None] = {}
        self._words: Counter[Any] = Counter()
        """Values that are no numbers, by track: all of them where it is one of words, such as the name of a state."""

    def run(self) -> None:
        """Read it all."""
        first, last = self._span()
        found, pixel, pace = self._found, (last - first) / PIXELS, float("inf")
        long = {"name", "value"} <= set(self._header)
        flush = self._long if long else self._wide
        block: list[list[str]] = []
        edge, before = pixel, 0.0
        moments = 0
        for row in self._rows():
            try:
                t = _seconds(row[self._time]) - first
            except ValueError:
                found.damaged += 1
                continue
            if self._mark >= 0 and row[self._mark]:
                pace = 0.0 if row[self._mark].startswith(HOLES) else float("inf")
                self._marked(t, row[self._mark])
            if t != before or not found.rows:
                if t - before > pace and (self._mark >= 0 or t - before > GAP_PIXELS * pixel):
                    flush(block, before)
                    block.clear()
                    self._hole(before, t)
                moments += 1
                if self._mark >= 0:
                    pace = float("inf")
                elif moments > GAP_PERIODS:
                    pace = GAP_PERIODS * max(t, pixel / 1000) / moments
                if t >= edge:
                    flush(block, before)
                    block.clear()
                    edge = (int(t / pixel) + 1) * pixel if pixel else t + 1
                before = t
            block.append(row)
            found.rows += 1
        flush(block, before)
        found.seconds = before
        drawn = {key: track[0] for key, track in self._tracks.items() if track is not None and track[0].count}
        found.curves = list(drawn.values())
        found.damaged += sum(self._words[key] for key in drawn)

    def _rows(self) -> Iterator[list[str]]:
        """The whole rows."""
        width = len(self._header)
        for line in iter(lambda: self._file.readline(TAIL), b""):
            text = line.decode("utf-8", "replace").rstrip("\r\n")
            row = text.split(",") if '"' not in text else _fields(text)
            if len(row) == width:
                yield row
            elif text:
                self._found.damaged += 1

    def _span(self) -> tuple[float, float]:
        """The times of the first and the last row that have one."""
        start = self._file.tell()
        first = self._times(self._file.read(TAIL).splitlines(), first=True)
        size = self._file.seek(0, os.SEEK_END)
        self._file.seek(max(start, size - TAIL))
        last = self._times(self._file.read().splitlines(), first=False)
        self._file.seek(start)
        return first, max(first, last)

    def _times(self, lines: list[bytes], *, first: bool) -> float:
        for line in lines if first else reversed(lines):
            row = _fields(_text(line))
            if len(row) == len(self._header):
                try:
                    return _seconds(row[self._time])
                except ValueError:
                    continue
        return 0.0

    def _marked(self, t: float, text: str) -> None:
        words = "; ".join(part for part in text.split("; ") if not part.startswith("[gap "))
        if words:
            self._found.marks.append((t, words))

    def _hole(self, start: float, end: float) -> None:
        self._found.holes.append((start, end))
        for track in self._tracks.values():
            if track is not None:
                track[0].hole()

    def _wide(self, block: list[list[str]], t: float) -> None:
        """The rows of a pixel: a column each."""
        for number, column in enumerate(zip(*block, strict=True)):
            name = self._header[number]
            if name not in self._tracks:
                self._tracks[name] = None if name in ABOUT else (Curve(*of_column(name)), 1.0)
            self._add(name, t, column)

    def _long(self, block: list[list[str]], t: float) -> None:
        """The rows of a pixel: a value each."""
        values: dict[tuple[str, ...], list[str]] = {}
        keys = [self._header.index(key) for key in ("name", *PARTS, "unit") if key in self._header]
        value = self._header.index("value")
        for row in block:
            values.setdefault(tuple(row[key] for key in keys), []).append(row[value])
        for key, column in values.items():
            if key not in self._tracks:
                name, *parts = key
                unit = parts.pop() if "unit" in self._header else ""
                scale = scale_of(unit)
                curve = Curve(name, ".".join(filter(None, parts)), scale.unit if scale else unit)
                self._tracks[key] = (curve, float(scale.of(1)) if scale else 1.0)
            self._add(key, t, column)

    def _add(self, key: Any, t: float, column: Sequence[str]) -> None:
        track = self._tracks[key]
        if track is None:
            return
        curve, factor = track
        texts = set(column)
        with suppress(ValueError):  # most often all of them are numbers
            found = list(map(float, texts))
            if isfinite(sum(found)):
                curve.add(t, min(found) * factor, max(found) * factor, float(column[-1]) * factor)
                return
        numbers, others = _numbers(texts)
        if numbers:
            values = numbers.values()
            last = next(numbers[text] for text in reversed(column) if text in numbers)
            curve.add(t, min(values) * factor, max(values) * factor, last * factor)
        if others:
            self._words[key] += sum(map(column.count, filter(None, others)))
            curve.failed += 1
            curve.hole()


def _sidecar(found: Plotted) -> None:
    """What only the sidecar of a log says: the family, and whether it was simulated."""
    try:
        said = json.loads(files.read_text(f"{found.path}.json", "a sidecar", LARGEST_SIDECAR))
    except (UsageError, ValueError):
        return
    if isinstance(said, dict):
        found.simulated = said.get("simulated") is True
        found.kind = next((kind for kind in FAMILIES if said.get("schema") == schema(kind)), "")


COLUMNS = (
    Column("file", "File"), Column("name", "Name"), Column("part", "Part"), Column("unit", "Unit"), Column("min", "Min", right=True),
    Column("max", "Max", right=True), Column("moved", "Moved"),
)  # fmt: skip
MOST_PARTS = 8
"""A quantity of more elements has a picture for each finger."""
LETTERS = 150
"""Of a line below the pictures of an SVG, which does not wrap."""


@click.command("plot", cls=Command, offline=True)
@click.argument("files", type=InFile(additional=(".json",)), nargs=-1, required=True, metavar="FILE...")
@click.option(
    "--only", "names", multiple=True, metavar="NAME", help="Plot only this quantity or element, such as temperature.index. Several: A,B, or repeat it."
)  # fmt: skip
@click.option("--open", "opens", is_flag=True, help="Open the plot in the browser.")
def cli(run: Run, files: Sequence[str], names: Sequence[str], opens: bool) -> Table | None:
    """Plot recordings as a picture (-o FILE.svg) or an HTML page (-o FILE.html).

    FILE is a CSV file that `watch`, `log` or `realtime` wrote. The plots of several files are stacked and share their
    axes. Values that never changed are listed, not drawn. --json prints the lowest and highest values instead.
    """
    rows_only = run.settings.format in ("json", "ndjson", "csv", "plain")
    if not (rows_only or opens or run.settings.output) and sys.stdout.isatty():
        raise UsageError("no output file given", hint="add -o plot.svg, -o plot.html or --open", code="no-output")
    found = [read(file) for file in files]
    _keep(found, [name for text in names for name in text.split(",")])
    for one in found:
        if one.damaged:
            what = f"{plural(one.damaged, 'damaged place')} left out: rows or values that could not be read"
            run.journal.warn("damaged", f"{one.path}: {what}")
    rows = [_row(one, curve) for one in found for curve in one.curves]
    moved = sum(row["moved"] for row in rows)
    run.journal.info(
        "plotted", f"{plural(sum(one.rows for one in found), 'row')}, {moved} of {plural(len(rows), 'curve')} changed"
    )
    table = Table(rows=rows, columns=COLUMNS)
    if opens or not rows_only:
        whole = opens or str(run.settings.output).lower().endswith((".html", ".htm"))
        text = drawn(found, whole=whole)
        if opens:
            _open(run, text)
            run.settings = run.settings._replace(output=None)
        else:
            table.text = lambda _: text
    return table


def _row(one: Plotted, curve: Curve) -> Row:
    return {
        "file": one.path, "name": curve.name, "part": curve.part or None, "unit": curve.unit or None, "min": curve.low,
        "max": curve.high, "moved": curve.moved,
    }  # fmt: skip


def _keep(found: Sequence[Plotted], names: Sequence[str]) -> None:
    """Leave only the curves of these names. Raises UsageError."""
    known = {name for one in found for curve in one.curves for name in (curve.name, f"{curve.name}.{curve.part}")}
    for name in names:
        if name not in known:
            like = near(name, known) or sorted({curve.name for one in found for curve in one.curves})
            raise UsageError(
                f"{', '.join(one.path for one in found)}: no column {name!r}",
                hint=f"use a name that the file has: {', '.join(like)}",
                code="no-column",
            )
    for one in found if names else ():
        one.curves = [curve for curve in one.curves if {curve.name, f"{curve.name}.{curve.part}"} & set(names)]


# -- the picture ----------------------------------------------------------------------------------------------------


def drawn(found: Sequence[Plotted], *, whole: bool) -> str:
    """The SVG of all quantities that moved, or the page with it."""
    seconds = max(one.seconds for one in found)
    named = [os.path.basename(one.path) for one in found]
    titles: dict[str, list[Strip]] = {}
    for one, name in zip(found, named, strict=True):
        for title, curves in grouped(one.curves).items():
            moving = {part: curve for part, curve in curves.items() if curve.moved}
            if moving:
                titles.setdefault(title, []).append(Strip(name, moving, one.holes, one.marks))
    head = " and ".join(
        f"{name} ({'simulated, ' if one.simulated else ''}{plural(one.rows, 'row')})"
        for name, one in zip(named, found, strict=True)
    )
    lines = [(name, unchanged(one.curves)) for name, one in zip(named, found, strict=True)]
    still = [f"{name} unchanged: {text}" for name, text in lines if text]
    pieces, top = [], 56
    for title, strips in titles.items():
        text, height = picture(title, strips, seconds, top=0 if whole else top)
        pieces.append(text)
        top += height + 14
    if whole:
        from handctl.report.html import plain_page

        notes = (f'<p class="note">{escape(line)}</p>\n' for line in still)
        return plain_page(head, [*map(_outlines, found), *pieces, *notes], STYLE)
    folded = [(14 if later else 0, line) for text in still for later, line in enumerate(textwrap.wrap(text, LETTERS))]
    below = "".join(
        f'<text class="small" x="{left}" y="{top + 16 * number}">{escape(line)}</text>\n'
        for number, (left, line) in enumerate(folded, 1)
    )
    high = top + 16 * len(folded) + 24
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-16 0 {SIDE + 32} {high}" width="{SIDE + 32}" height="{high}">\n'
        f"<style>{STYLE}</style>\n"
        f'<rect x="-16" width="100%" height="100%" fill="#fff"/>\n<text class="head" x="0" y="32">{escape(head)}</text>\n'
        f"{''.join(pieces)}{below}</svg>\n"
    )


def _outlines(one: Plotted) -> str:
    """The device of a log with the highest values of each finger, in its last position; "" where none is known."""
    from handctl.model.device_picture import outline_of

    outline = outline_of(one.kind) if one.kind else None
    if outline is None:
        return ""
    bent = outline.bend[0].partition(".")[0] if outline.bend else ""
    errors = outline.errors.partition("{")[0].rstrip("._")
    rows: list[Row] = [
        {
            "path": f"{curve.name}.{curve.part}" if curve.part else curve.name,
            "value": curve.last if curve.name == bent else max(curve.low, curve.high, key=abs),
            "unit": curve.unit or None,
            **({"errors": ["set"] if curve.high else []} if errors and curve.name.startswith(errors) else {}),
        }
        for curve in one.curves
    ]
    name = os.path.basename(one.path)
    figures = (outline_svg(outline, by, rows, f"{name}: highest") for by in outline.measures if by != "error")
    return f'<div class="outlines">{"".join(figures)}</div>\n'


def grouped(curves: Sequence[Curve]) -> dict[str, dict[str, Curve]]:
    """Heading -> part -> curve. A quantity of many elements has a picture a finger.

    Names without a part that end with the same word and unit share one: ``left_hip_angle`` and ``right_hip_angle``.
    """
    places: dict[str, list[tuple[str, Curve]]] = {}
    words: dict[tuple[str, str], int] = {}
    for curve in curves:
        if not curve.part:
            words[_word(curve)] = words.get(_word(curve), 0) + 1
    for curve in curves:
        name, part = curve.name, curve.part
        if not part and words[_word(curve)] > 1:
            name, part = _word(curve)[0], name.replace(_word(curve)[0], "").strip("_").replace("_", " ")
        places.setdefault(f"{name} [{curve.unit}]" if curve.unit else name, []).append((part, curve))
    found: dict[str, dict[str, Curve]] = {}
    for title, group in places.items():
        for part, curve in group:
            finger, _, element = part.partition(".")
            split = len(group) > MOST_PARTS and element
            found.setdefault(f"{finger}: {title}" if split else title, {})[element if split else part] = curve
    return found


def _word(curve: Curve) -> tuple[str, str]:
    """The word by which names are one quantity, and the unit: the last, or the first where the last is a number."""
    first, *rest = curve.name.split("_")
    return (first if not rest or rest[-1].isdecimal() else rest[-1]), curve.unit


def _open(run: Run, text: str) -> None:
    """Write the page and show it. Raises OutputError."""
    import tempfile
    import webbrowser
    from pathlib import Path

    from handctl.files import atomic_write, writing

    path = run.settings.output or os.path.join(tempfile.mkdtemp(prefix="handctl-"), "plot.html")
    with writing(path, hint="choose another file"), atomic_write(path) as file:
        file.write(text)
    if not webbrowser.open(Path(path).resolve().as_uri()):
        run.journal.warn("no-browser", "no browser could be started", hint=f"open {path} yourself")
