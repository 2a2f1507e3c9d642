"""A log as other programs take it: OpenSim motion file, or CSV with SI units. Needs no device.

    motion file   one segment; angles in degrees, time in s from its first row; nothing is filled in
    csv           the log's columns; with `si` metres and radians, the names saying so

Joint conventions: hip and knee flexion are positive at the device. pelvis_tilt is -torso_pitch (forward lean is
negative there); models differ in the sign of knee flexion, so the sign is a parameter and stands in the file. Roll is
left out: nobody knows its sign.
"""

from __future__ import annotations

import json
import os
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice, pairwise
from operator import lt, neg
from typing import Any, NamedTuple

from handctl.devices.ekso.log_reader import LogFile
from handctl.devices.ekso.parameter_map import DATA
from handctl.devices.ekso.recording_source import NAMED, column_of, to_si
from handctl.errors import UsageError
from handctl.files import Spool
from handctl.record.clock_survey import survey
from handctl.record.csv_columns import MARK, clean, quoted
from handctl.record.log_reader import Known, Span, as_written, forget
from handctl.record.timeline import GAP_PERIODS, LEAST_PERIOD_MS
from handctl.wording import plural

COORDINATES: tuple[tuple[str, str], ...] = (
    ("pelvis_tilt", "torso_pitch"),
    ("hip_flexion_r", "right_hip_angle"),
    ("knee_angle_r", "right_knee_angle"),
    ("hip_flexion_l", "left_hip_angle"),
    ("knee_angle_l", "left_knee_angle"),
)
"""OpenSim coordinate and the quantity it comes from. All are hundredths of a degree on the wire."""
PIECE = 4096
"""Rows that are made text at once."""
MOT_COLUMNS = ("time", *(name for name, _ in COORDINATES))


class Exported(NamedTuple):
    """A finished export: the lines of the file, or of JSON its rows; their number, seconds covered, remarks."""

    spool: Spool
    length: int
    seconds: float
    remarks: tuple[str, ...]


class Points:
    """The moments of a motion, 28 bytes each: ms from the first row, and the coordinates in hundredths of a degree."""

    def __init__(self) -> None:
        self.t_ms = array("q")
        self.coordinates = [array("i") for _ in COORDINATES]
        self.still = 0
        """Rows left out: BootTime did not advance."""

    def take(self, times: Sequence[int], coordinates: Sequence[Sequence[int]]) -> None:
        """More of them, but for those at which the time has stood still."""
        if not (self.t_ms and times[0] <= self.t_ms[-1]) and all(map(lt, times, times[1:])):
            self.t_ms.extend(times)
            for coordinate, values in zip(self.coordinates, coordinates, strict=True):
                coordinate.extend(values)
            return
        for t_ms, *values in zip(times, *coordinates, strict=True):
            if self.t_ms and t_ms <= self.t_ms[-1]:
                self.still += 1
                continue
            self.t_ms.append(t_ms)
            for coordinate, value in zip(self.coordinates, values, strict=True):
                coordinate.append(value)

    def values(self, at: int) -> tuple[int, ...]:
        """The coordinates of one moment."""
        return tuple(coordinate[at] for coordinate in self.coordinates)


def motion(
    log: LogFile, *, segment: int | None, knee_sign: int, rate: float | None, tool: str, as_rows: bool = False
) -> Exported:
    """One segment as an OpenSim motion file. Raises UsageError when it is not clear which segment is meant.

    With `rate` (Hz) resampled linearly, never across a gap. Rows at which BootTime did not advance are left out: times
    in a motion file rise strictly.
    """
    points, number, clock = _points(log, segment, knee_sign)
    remarks = list(log.remarks())
    if points.still:
        remarks.append(f"{plural(points.still, 'row')} left out: BootTime did not advance")
    count = len(points.t_ms) if rate is None else sum(1 for _ in _resampled(points, rate))
    name = clean(os.path.basename(log.path)).replace("=", " ") or "log"
    source = "; ".join((tool, f"{name}, segment {number}", *(["simulated"] if log.simulated else [])))
    head = [
        f"name {name}",
        "version=1",
        f"nRows={count}",
        f"nColumns={len(MOT_COLUMNS)}",
        "inDegrees=yes",
        f"source: {source}",
        f"sign: knee flexion is {'positive' if knee_sign > 0 else 'negative'}, pelvis_tilt is minus torso_pitch",
        *([f"clock: {clock}"] if clock else []),
        "endheader",
        "\t".join(MOT_COLUMNS),
    ]
    lines = _as_recorded(points) if rate is None else _resampled(points, rate)
    spool = Spool()
    if as_rows:
        spool.take(json.dumps(dict(zip(MOT_COLUMNS, map(float, line), strict=True))) for line in lines)
    else:
        spool.take(head)
        while some := list(islice(lines, PIECE)):
            spool.take(["\n".join(map("\t".join, some))])
    return Exported(spool, count, points.t_ms[-1] / 1000, tuple(remarks))


def _as_recorded(points: Points) -> Iterator[tuple[str, ...]]:
    texts = Known(lambda value: f"{value / 100:.2f}")
    for at in range(0, len(points.t_ms), PIECE):
        columns = [texts.of(coordinate[at : at + PIECE]) for coordinate in points.coordinates]
        forget([texts])
        yield from zip((f"{t_ms / 1000:.3f}" for t_ms in points.t_ms[at : at + PIECE]), *columns, strict=True)


def _points(log: LogFile, segment: int | None, knee_sign: int) -> tuple[Points, int, str]:
    """The points of the segment that is meant, its number, and what its time is by the host's clock."""
    signs = [-1 if name == "pelvis_tilt" else knee_sign if name.startswith("knee") else 1 for name, _ in COORDINATES]
    quantities = [next(q for q in DATA if q.name == key) for _, key in COORDINATES]
    wanted = 1 if segment is None else segment
    if (spans := log.spans) is not None:
        _refuse(log, spans, segment)  # before hours are read
    spans, points, begun = {}, Points(), ""
    for block in log.blocks(as_written):
        for number in sorted(set(block.segments)):
            part = block.of(number)
            span = spans.setdefault(number, Span(part.t_ms[0], 0, 0))
            spans[number] = span._replace(end=part.t_ms[-1], rows=span.rows + len(part.t_ms))
            if number == wanted:
                columns = (log.numbers(q).of(part.columns[column_of(q)]) for q in quantities)
                values = [list(map(neg, one)) if sign < 0 else one for sign, one in zip(signs, columns, strict=True)]
                points.take([t_ms - span.begin for t_ms in part.t_ms], values)
                begun = begun or part.columns["host_utc_s"][0].decode()
    _refuse(log, spans, segment)
    fits = log.fits if log.fits is not None else {n: one.line.as_fit() for n, one in survey(log).segments.items()}
    clock = "host UTC in s is {} + {a_s:.6f} + {b:.9f} * time".format(begun, **fits[wanted]) if wanted in fits else ""
    return points, wanted, clock


def _refuse(log: LogFile, spans: dict[int, Span], segment: int | None) -> None:
    """Raise UsageError when it is not clear which segment is meant, or there is none."""
    known = ", ".join(f"{n}: {one.rows} rows, {(one.end - one.begin) / 1000:.1f} s" for n, one in spans.items())
    if segment is None and len(spans) > 1:
        raise UsageError(
            f"{log.path} has {plural(len(spans), 'segment')} (the device was restarted, its port was lost, or its clock and this computer's drifted apart), but a motion file can hold only one",
            hint=f"choose one with --segment N ({known})",
            code="segment",
        )
    if (1 if segment is None else segment) not in spans:
        raise UsageError(
            f"{log.path} has no segment {segment}" if spans else f"{log.path} has no rows",
            hint=f"it has {known}" if spans else "",
            code="segment",
        )


def _resampled(points: Points, rate: float) -> Iterator[tuple[str, ...]]:
    """Lines at multiples of 1/rate between neighbouring points; none inside a gap."""
    times = points.t_ms
    intervals = array("q", sorted(b - a for a, b in pairwise(times)))
    longest = GAP_PERIODS * max(LEAST_PERIOD_MS, intervals[len(intervals) // 2]) if intervals else 0
    at = 0
    step = 0
    while (t_ms := step * 1000 / rate) <= times[-1]:
        while at + 1 < len(times) and times[at + 1] <= t_ms:
            at += 1
        after = min(at + 1, len(times) - 1)
        span = times[after] - times[at]
        if t_ms == times[at] or span <= longest:
            part = (t_ms - times[at]) / span if span else 0.0
            values = (a + (b - a) * part for a, b in zip(points.values(at), points.values(after), strict=True))
            yield (f"{t_ms / 1000:.6f}", *(f"{round(value / 100, 4) + 0.0:.4f}" for value in values))
        step += 1


def table(
    log: LogFile, *, segment: int | None, si: bool, as_rows: bool = False, say: Callable[[str], str] = str
) -> Exported:
    """The log's own columns, all segments or one; with `si` in metres and radians. `say` makes a cell of a text."""
    layout = log.layout
    quantities = dict(zip(layout.columns, layout.shown, strict=True))
    plans = [(*to_si(name, quantities.get(name) if si else None), quantities.get(name)) for name in layout.names]
    names = [name for name, _, _ in plans]
    converted = {
        name: Known(partial(_converted, convert, log.numbers(quantity)))
        for name, (_, convert, quantity) in zip(layout.names, plans, strict=True)
        if convert and quantity
    }
    if segment is not None and log.spans is not None and segment not in log.spans:
        raise log.without(segment)
    spool, count = Spool(), 0
    if not as_rows:
        spool.take([",".join(names) + "\r"])
    first = last = None
    for whole in log.blocks(as_written):
        if segment is not None and segment not in whole.segments:
            continue
        block = whole.of(segment)
        first, last = (block.t_ms[0] if first is None else first), block.t_ms[-1]
        count += len(block.t_ms)
        if block.text and not (si or as_rows) and block is whole and say is str:
            spool.take([block.text.decode()])
            continue
        columns = [
            converted[name].of(block.columns[name]) if name in converted else block.columns[name]
            for name in layout.names
        ]
        forget(converted.values())
        if as_rows:
            rows = (dict(zip(names, map(_value, names, row), strict=True)) for row in zip(*columns, strict=True))
            spool.take(json.dumps(row, ensure_ascii=False) for row in rows)
            continue
        for at in (names.index(MARK), names.index(f"{NAMED}_name")):
            said = {text: quoted(say(text.decode())).encode() for text in set(columns[at])}
            columns[at] = tuple(map(said.__getitem__, columns[at]))
        spool.take([b"\r\n".join(map(b",".join, zip(*columns, strict=True))).decode() + "\r"])
    if first is None or last is None:
        raise log.without(segment)
    return Exported(spool, count, (last - first) / 1000, log.remarks())


def _converted(convert: Callable[[int], str], numbers: Mapping[bytes, int], text: bytes) -> bytes:
    return convert(numbers[text]).encode()


def _value(name: str, text: bytes) -> Any:
    if name in (MARK, f"{NAMED}_name"):
        return text.decode() or None
    return float(text) if b"." in text else int(text)
