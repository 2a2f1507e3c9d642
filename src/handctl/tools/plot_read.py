"""The CSV files of `watch`, `log` and `realtime` read again as curves: of each pixel the lowest and the highest value.

A file of a recording is not held in memory. Knows no family and no picture.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, BinaryIO

from handctl import files
from handctl.charts.curves import PIXELS, Curve
from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.model.param import scale_of
from handctl.model.result import PARTS
from handctl.record.recording import schema
from handctl.screen.csv_output import of_column

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


@dataclass(slots=True)
class Track:
    """The curve of one column."""

    curve: Curve
    factor: float = 1.0


@dataclass(slots=True)
class Plotted:
    """What one file holds. `damaged` rows had another number of fields or no time; `kind` is the family, where a sidecar says it."""

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
        header = next(csv.reader([_text(file.readline(TAIL))]), [])
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


def _text(line: bytes) -> str:
    return line.decode("utf-8-sig", "replace").rstrip("\r\n")


def _seconds(text: str) -> float:
    """A time of a row: seconds, or a time of day. Raises ValueError."""
    if ":" in text:
        return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
    return float(text)


class _Reading:
    """One pass through a file, pixel by pixel."""

    def __init__(self, found: Plotted, header: list[str], time: int, file: BinaryIO) -> None:
        self._found, self._header, self._time, self._file = found, header, time, file
        self._mark = header.index("mark") if "mark" in header else -1
        self._tracks: dict[Any, Track | None] = {}

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
        found.curves = [track.curve for track in self._tracks.values() if track is not None and track.curve.count]

    def _rows(self) -> Iterator[list[str]]:
        """The whole rows."""
        width = len(self._header)
        for line in iter(lambda: self._file.readline(TAIL), b""):
            text = line.decode("utf-8", "replace").rstrip("\r\n")
            row = text.split(",") if '"' not in text else next(csv.reader([text]))
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
            row = next(csv.reader([_text(line)]), [])
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
                track.curve.hole()

    def _wide(self, block: list[list[str]], t: float) -> None:
        """The rows of a pixel: a column each."""
        for number, column in enumerate(zip(*block, strict=True)):
            name = self._header[number]
            if name not in self._tracks:
                self._tracks[name] = None if name in ABOUT else Track(Curve(*of_column(name)))
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
                self._tracks[key] = Track(curve, float(scale.of(1)) if scale else 1.0)
            self._add(key, t, column)

    def _add(self, key: Any, t: float, column: Iterable[str]) -> None:
        track = self._tracks[key]
        if track is None:
            return
        texts = set(column)
        failed = "" in texts
        texts.discard("")
        try:
            numbers = [float(text) * track.factor for text in texts]
        except ValueError:  # words, such as the name of a state
            self._tracks[key] = None
            return
        if numbers:
            track.curve.add(t, min(numbers), max(numbers), numbers[-1])
        if failed:
            track.curve.failed += 1
            track.curve.hole()


def _sidecar(found: Plotted) -> None:
    """What only the sidecar of a log says: the family, and whether it was simulated."""
    try:
        said = json.loads(files.read_text(f"{found.path}.json", "a sidecar", LARGEST_SIDECAR))
    except (UsageError, ValueError):
        return
    if isinstance(said, dict):
        found.simulated = said.get("simulated") is True
        found.kind = next((kind for kind in FAMILIES if said.get("schema") == schema(kind)), "")
