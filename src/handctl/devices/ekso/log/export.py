"""A log as other programs take it: OpenSim motion file, or CSV with SI units. Needs no device.

    motion file   one segment; angles in degrees, time in s from its first row; nothing is filled in
    csv           the log's columns; with `si` metres and radians, the names saying so

Joint conventions: hip and knee flexion are positive at the device. pelvis_tilt is -torso_pitch (forward lean is
negative there); models differ in the sign of knee flexion, so the sign is a parameter and stands in the file. Roll is
left out: nobody knows its sign.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from handctl.devices.ekso.log.file import LogFile
from handctl.devices.ekso.log.format import NAMED, to_si
from handctl.errors import UsageError
from handctl.record.source import MARK, clean, quoted
from handctl.record.timeline import GAP_PERIODS, LEAST_PERIOD_MS
from handctl.sentence import plural

COORDINATES: tuple[tuple[str, str], ...] = (
    ("pelvis_tilt", "torso_pitch"),
    ("hip_flexion_r", "right_hip_angle"),
    ("knee_angle_r", "right_knee_angle"),
    ("hip_flexion_l", "left_hip_angle"),
    ("knee_angle_l", "left_knee_angle"),
)
"""OpenSim coordinate and the quantity it comes from. All are hundredths of a degree on the wire."""
MOT_COLUMNS = ("time", *(name for name, _ in COORDINATES))


class Exported(NamedTuple):
    """A finished export: the file's text, its rows by column for JSON, their number, seconds covered, remarks."""

    text: str
    rows: list[dict[str, Any]]
    length: int
    seconds: float
    remarks: tuple[str, ...]


class Point(NamedTuple):
    """One moment of a motion: ms from the first row, and the coordinates in hundredths of a degree."""

    t_ms: int
    values: tuple[int, ...]


def motion(log: LogFile, *, segment: int | None, knee_sign: int, rate: float | None, tool: str) -> Exported:
    """One segment as an OpenSim motion file. Raises UsageError when it is not clear which segment is meant.

    With `rate` (Hz) resampled linearly, never across a gap. Rows at which BootTime did not advance are left out: times
    in a motion file rise strictly.
    """
    points, number = _points(log, segment, knee_sign)
    moving = [point for i, point in enumerate(points) if i == 0 or point.t_ms > points[i - 1].t_ms]
    remarks = list(_remarks(log))
    if len(moving) < len(points):
        remarks.append(f"{plural(len(points) - len(moving), 'row')} left out: BootTime did not advance")
    if rate is None:
        lines = [(f"{p.t_ms / 1000:.3f}", *(f"{value / 100:.2f}" for value in p.values)) for p in moving]
    else:
        lines = list(_resampled(moving, rate))
    name = clean(os.path.basename(log.path)).replace("=", " ") or "log"
    source = "; ".join((tool, f"{name}, segment {number}", *(["simulated"] if log.simulated else [])))
    head = [
        f"name {name}",
        "version=1",
        f"nRows={len(lines)}",
        f"nColumns={len(MOT_COLUMNS)}",
        "inDegrees=yes",
        f"source: {source}",
        f"sign: knee flexion is {'positive' if knee_sign > 0 else 'negative'}, pelvis_tilt is minus torso_pitch",
        "endheader",
        "\t".join(MOT_COLUMNS),
    ]
    text = "\n".join([*head, *("\t".join(line) for line in lines)]) + "\n"
    rows = [dict(zip(MOT_COLUMNS, map(float, line), strict=True)) for line in lines]
    return Exported(text, rows, len(rows), moving[-1].t_ms / 1000, tuple(remarks))


def _points(log: LogFile, segment: int | None, knee_sign: int) -> tuple[list[Point], int]:
    """The points of the segment that is meant, and its number."""
    signs = [-1 if name == "pelvis_tilt" else knee_sign if name.startswith("knee") else 1 for name, _ in COORDINATES]
    wanted = 1 if segment is None else segment
    spans: dict[int, list[int]] = {}
    points: list[Point] = []
    for row in log.rows():
        span = spans.setdefault(row.segment, [row.t_ms, row.t_ms, 0])
        span[1:] = [row.t_ms, span[2] + 1]
        if row.segment == wanted:
            values = (sign * row.numbers[key] for sign, (_, key) in zip(signs, COORDINATES, strict=True))
            points.append(Point(row.t_ms - span[0], tuple(values)))
    known = ", ".join(f"{n}: {rows} rows, {(end - start) / 1000:.1f} s" for n, (start, end, rows) in spans.items())
    if segment is None and len(spans) > 1:
        raise UsageError(
            f"{log.path} has {plural(len(spans), 'segment')} (the device was restarted, its port was lost, or its clock and that of the machine parted), a motion file holds one",
            hint=f"--segment N; {known}",
            code="segment",
        )
    if not points:
        raise UsageError(
            f"{log.path} has no segment {segment}" if spans else f"{log.path} has no rows",
            hint=f"it has {known}" if spans else "",
            code="segment",
        )
    return points, wanted


def _resampled(points: Sequence[Point], rate: float) -> Iterator[tuple[str, ...]]:
    """Lines at multiples of 1/rate between neighbouring points; none inside a gap."""
    intervals = sorted(b.t_ms - a.t_ms for a, b in pairwise(points))
    longest = GAP_PERIODS * max(LEAST_PERIOD_MS, intervals[len(intervals) // 2]) if intervals else 0
    at = 0
    step = 0
    while (t_ms := step * 1000 / rate) <= points[-1].t_ms:
        while at + 1 < len(points) and points[at + 1].t_ms <= t_ms:
            at += 1
        here, after = points[at], points[min(at + 1, len(points) - 1)]
        span = after.t_ms - here.t_ms
        if t_ms == here.t_ms or span <= longest:
            part = (t_ms - here.t_ms) / span if span else 0.0
            values = (a + (b - a) * part for a, b in zip(here.values, after.values, strict=True))
            yield (f"{t_ms / 1000:.6f}", *(f"{round(value / 100, 4) + 0.0:.4f}" for value in values))
        step += 1


def table(log: LogFile, *, segment: int | None, si: bool, as_rows: bool = False) -> Exported:
    """The log's own columns, all segments or one; with `si` in metres and radians. Rows are made when asked for."""
    layout = log.layout
    quantities = dict(zip(layout.columns, layout.shown, strict=True))
    plans = [(*to_si(name, quantities.get(name) if si else None), quantities.get(name)) for name in layout.names]
    names = [name for name, _, _ in plans]
    lines = [",".join(names) + "\r\n"]
    rows: list[dict[str, Any]] = []
    first = last = None
    for row in log.rows():
        if segment is not None and row.segment != segment:
            continue
        first, last = (row.t_ms if first is None else first), row.t_ms
        texts = [
            convert(row.numbers[quantity.name]) if convert and quantity else text
            for text, (_, convert, quantity) in zip(row.fields, plans, strict=True)
        ]
        if as_rows:
            rows.append(dict(zip(names, map(_value, names, texts), strict=True)))
        else:
            lines.append(",".join(map(quoted, texts)) + "\r\n")
    if first is None or last is None:
        raise UsageError(
            f"{log.path} has no {'rows' if segment is None else f'segment {segment}'}",
            hint="choose a segment that its sidecar lists",
            code="segment",
        )
    return Exported("".join(lines), rows, max(len(lines) - 1, len(rows)), (last - first) / 1000, _remarks(log))


def _value(name: str, text: str) -> Any:
    if name in (MARK, f"{NAMED}_name"):
        return text or None
    return float(text) if "." in text else int(text)


def _remarks(log: LogFile) -> tuple[str, ...]:
    if log.sidecar is None:
        return (f"{log.path}.json is missing, so nothing shows that the log is complete",)
    if log.closed:
        whole = f"{log.path} is incomplete: {', '.join(log.missing)}. See its sidecar for details"
        return (whole,) if log.missing else ()
    cut = ". Its last row was unfinished and was skipped" if log.cut else ""
    return (f"{log.path} was never closed, because handctl was killed or is still running{cut}",)
