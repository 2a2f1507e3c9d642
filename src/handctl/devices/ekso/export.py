"""A log as other programs take it: OpenSim motion file, or CSV with SI units. Needs no device.

    motion file   one segment; angles in degrees, time in s from its first row; nothing is filled in
    csv           the log's columns; with `si` metres and radians, the names saying so

Joint conventions: hip and knee flexion are positive at the device. pelvis_tilt is -torso_pitch (forward lean is
negative there); models differ in the sign of knee flexion, so the sign is a parameter and stands in the file. Roll is
left out: nobody knows its sign.
"""

from __future__ import annotations

import csv
import json
import os
from array import array
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

from handctl.devices.ekso.log import LEAD, NAMED, RowLayout, parse, parse_fixed, to_si
from handctl.devices.ekso.map import DATA, boot_ms, state_text
from handctl.errors import UsageError
from handctl.files import NoFile, Spool, opened, read_text
from handctl.record.recording import schema
from handctl.record.source import MARK, clean, quoted
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
MOT_COLUMNS = ("time", *(name for name, _ in COORDINATES))


class Exported(NamedTuple):
    """A finished export: the lines of the file, or of JSON its rows; their number, seconds covered, remarks."""

    spool: Spool
    length: int
    seconds: float
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """The file's text, all of it."""
        return "".join(f"{line}\n" for line in self.spool.lines())

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, all of them, where they were made `as_rows`."""
        return [json.loads(line) for line in self.spool.lines()]


class Points:
    """The moments of a motion, 48 bytes each: ms from the first row, and the coordinates in hundredths of a degree."""

    def __init__(self) -> None:
        self.t_ms = array("q")
        self.coordinates = [array("q") for _ in COORDINATES]
        self.still = 0
        """Rows left out: BootTime did not advance."""

    def take(self, t_ms: int, values: Iterable[int]) -> None:
        """One more, unless the time has stood still."""
        if self.t_ms and t_ms <= self.t_ms[-1]:
            self.still += 1
            return
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
    points, number = _points(log, segment, knee_sign)
    remarks = list(_remarks(log))
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
        "endheader",
        "\t".join(MOT_COLUMNS),
    ]
    lines = _as_recorded(points) if rate is None else _resampled(points, rate)
    spool = Spool()
    if as_rows:
        spool.take(json.dumps(dict(zip(MOT_COLUMNS, map(float, line), strict=True))) for line in lines)
    else:
        spool.take(head)
        spool.take("\t".join(line) for line in lines)
    return Exported(spool, count, points.t_ms[-1] / 1000, tuple(remarks))


def _as_recorded(points: Points) -> Iterator[tuple[str, ...]]:
    for at, t_ms in enumerate(points.t_ms):
        yield (f"{t_ms / 1000:.3f}", *(f"{value / 100:.2f}" for value in points.values(at)))


def _points(log: LogFile, segment: int | None, knee_sign: int) -> tuple[Points, int]:
    """The points of the segment that is meant, and its number."""
    signs = [-1 if name == "pelvis_tilt" else knee_sign if name.startswith("knee") else 1 for name, _ in COORDINATES]
    wanted = 1 if segment is None else segment
    spans: dict[int, list[int]] = {}
    points = Points()
    for row in log.rows():
        span = spans.setdefault(row.segment, [row.t_ms, row.t_ms, 0])
        span[1:] = [row.t_ms, span[2] + 1]
        if row.segment == wanted:
            values = (sign * row.numbers[key] for sign, (_, key) in zip(signs, COORDINATES, strict=True))
            points.take(row.t_ms - span[0], values)
    known = ", ".join(f"{n}: {rows} rows, {(end - start) / 1000:.1f} s" for n, (start, end, rows) in spans.items())
    if segment is None and len(spans) > 1:
        raise UsageError(
            f"{log.path} has {plural(len(spans), 'segment')} (the device was restarted, its port was lost, or its clock and this computer's drifted apart), but a motion file can hold only one",
            hint=f"choose one with --segment N ({known})",
            code="segment",
        )
    if not points.t_ms:
        raise UsageError(
            f"{log.path} has no segment {segment}" if spans else f"{log.path} has no rows",
            hint=f"it has {known}" if spans else "",
            code="segment",
        )
    return points, wanted


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


def table(log: LogFile, *, segment: int | None, si: bool, as_rows: bool = False) -> Exported:
    """The log's own columns, all segments or one; with `si` in metres and radians."""
    layout = log.layout
    quantities = dict(zip(layout.columns, layout.shown, strict=True))
    plans = [(*to_si(name, quantities.get(name) if si else None), quantities.get(name)) for name in layout.names]
    names = [name for name, _, _ in plans]
    spool, count = Spool(), 0
    if not as_rows:
        spool.take([",".join(names) + "\r"])
    first = last = None
    for row in log.rows():
        if segment is not None and row.segment != segment:
            continue
        first, last = (row.t_ms if first is None else first), row.t_ms
        texts = [
            convert(row.numbers[quantity.name]) if convert and quantity else text
            for text, (_, convert, quantity) in zip(row.fields, plans, strict=True)
        ]
        count += 1
        if as_rows:
            spool.take([json.dumps(dict(zip(names, map(_value, names, texts), strict=True)), ensure_ascii=False)])
        else:
            spool.take([",".join(map(quoted, texts)) + "\r"])
    if first is None or last is None:
        raise UsageError(
            f"{log.path} has no {'rows' if segment is None else f'segment {segment}'}",
            hint="choose a segment that its sidecar lists",
            code="segment",
        )
    return Exported(spool, count, (last - first) / 1000, _remarks(log))


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


# -- reading a log back: every line checked, so that what is exported is what was recorded --------------------------------
#
# A file that is not a log, or not whole, is refused with the number of the line. The sidecar says whether the log was closed;
# one that was not (power failure, kill) may end in the middle of a row, which is then left out.


LONGEST_LINE = 65536
UNTOUCHED = "the file was not changed"
SCHEMA = schema("ekso")
NAMES = [name for name, _ in LEAD]


class LogRow(NamedTuple):
    """One row: its fields as they stand there, device time, segment, and the numbers of the shown words."""

    fields: list[str]
    t_ms: int
    segment: int
    numbers: dict[str, int]


def damaged(path: str, line: int, what: str) -> UsageError:
    """The error for a file that is not a whole log."""
    return UsageError(f"{path} line {line}: {what}", hint=f"not a log, or damaged. {UNTOUCHED}", code="damaged-log")


class LogFile:
    """A log on the disk. Raises UsageError when it cannot be read, or is none."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.sidecar = _load_sidecar(f"{path}.json")
        self.cut = False
        """True when an unfinished last row was left out."""
        with opened(path, "a log", hint=f"`handctl ekso log {path}` makes one") as file:
            header = file.readline(LONGEST_LINE).decode("utf-8", "replace")
        names = header.rstrip("\r\n").split(",")
        self.layout = next(
            (layout for raw in (False, True) if (layout := RowLayout(raw=raw)).names == tuple(names)), None
        ) or (self._foreign(names))

    @property
    def closed(self) -> bool:
        """Whether the sidecar says that the log was closed; an older one calls that complete."""
        return bool(self.sidecar and self.sidecar.get("closed", self.sidecar.get("complete")))

    @property
    def missing(self) -> list[str]:
        """What keeps a closed log from being whole, as its sidecar says."""
        return [str(reason) for reason in (self.sidecar or {}).get("missing") or []]

    @property
    def simulated(self) -> bool:
        """Whether the sidecar says that a simulator was recorded."""
        return bool(self.sidecar and self.sidecar.get("simulated"))

    def _foreign(self, names: list[str]) -> RowLayout:
        for number, wanted in enumerate(RowLayout(raw=False).names):
            if number >= len(names) or names[number] != wanted:
                found = repr(names[number][:40]) if number < len(names) else "missing"
                raise damaged(self.path, 1, f"column {number + 1} is {found}, but in a log it is {wanted!r}")
        raise damaged(self.path, 1, "the header continues after the columns of a log")

    def rows(self) -> Iterator[LogRow]:
        """Row after row, each checked. Raises UsageError with the number of the line."""
        count, last = 0, (0, 0)
        try:
            with opened(self.path, "a log") as file:
                file.readline(LONGEST_LINE)
                for number, data in enumerate(iter(lambda: file.readline(LONGEST_LINE), b""), 2):
                    if len(data) == LONGEST_LINE:
                        raise damaged(self.path, number, f"longer than {LONGEST_LINE} bytes")
                    if not data.endswith(b"\n"):
                        if self.closed:
                            raise damaged(self.path, number, "the row is cut short")
                        self.cut = True
                        break
                    row = self._row(number, data)
                    if (row.segment, row.t_ms) < last or row.segment > last[0] + 1:
                        raise damaged(self.path, number, "segment or t_s does not follow from the row before")
                    last = (row.segment, row.t_ms)
                    count += 1
                    yield row
        except OSError as exc:
            raise UsageError(
                f"{self.path}: cannot be read: {exc.strerror or exc}", hint="check the file and its permissions"
            ) from exc
        if self.sidecar and self.closed and self.sidecar.get("rows") != count:
            raise damaged(
                self.path, count + 1, f"the file ends after {count} rows, its sidecar counts {self.sidecar.get('rows')}"
            )

    def _row(self, number: int, data: bytes) -> LogRow:
        try:
            text = data.decode("utf-8").rstrip("\r\n")
            fields = next(csv.reader([text], strict=True)) if '"' in text else text.split(",")
        except (UnicodeDecodeError, csv.Error, StopIteration) as exc:
            raise damaged(self.path, number, f"not comma-separated text: {exc}") from exc
        names = self.layout.names
        if len(fields) != len(names):
            raise damaged(self.path, number, f"{plural(len(fields), 'column')} instead of {len(names)}")
        cells = dict(zip(names, fields, strict=True))
        name = ""
        try:
            lead = []
            for name, decimals in LEAD:
                lead.append(parse_fixed(cells[name], decimals))
            numbers = {}
            for quantity, name in zip(self.layout.shown, self.layout.columns, strict=True):
                numbers[quantity.name] = parse(quantity, cells[name])
            name = f"{NAMED}_name"
            if cells[name] != state_text(numbers[NAMED]):
                raise ValueError(f"{cells[name]!r} does not fit {NAMED}")
            if self.layout.raw:
                name = "raw columns"
                self._check_raw(fields[names.index(MARK) + 1 :], lead[NAMES.index("boot_ms")], numbers)
        except ValueError as exc:
            raise damaged(self.path, number, f"{name}: {exc}") from exc
        return LogRow(fields, lead[NAMES.index("t_s")], lead[NAMES.index("segment")], numbers)

    def _check_raw(self, texts: list[str], boot: int, numbers: dict[str, int]) -> None:
        words = [parse_fixed(text, 0) for text in texts]
        for quantity, word in zip(DATA, words, strict=True):
            if not 0 <= word <= 0xFFFF or numbers.get(quantity.name, quantity.raw_of(word)) != quantity.raw_of(word):
                raise ValueError(f"{word} does not fit {quantity.name}")
        if boot_ms(words) != boot:
            raise ValueError("they do not fit boot_ms")


def _load_sidecar(path: str) -> dict[str, Any] | None:
    """The sidecar, None when there is none. Raises UsageError for one that is damaged or of another kind."""
    try:
        content = json.loads(read_text(path, "a sidecar", 16_000_000))
    except NoFile:
        return None
    except (ValueError, RecursionError) as exc:
        line = exc.lineno if isinstance(exc, json.JSONDecodeError) else 1
        raise damaged(path, line, f"not a sidecar: {exc}") from exc
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        found = content.get("schema") if isinstance(content, dict) else None
        raise damaged(path, 1, f"schema {found!r} instead of {SCHEMA!r}")
    return content
