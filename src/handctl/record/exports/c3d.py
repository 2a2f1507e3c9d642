"""A C3D file (the manual of c3d.org, floating point, Intel): frames at a constant rate on the host's clock.

    header (512 bytes) | parameters, in blocks of 512 | frames: a point (x, y, z, residual) per angle, then the analog channels

An angle is a point with its value as x, listed in POINT:ANGLES; every number of the device is an analog channel as well. A frame
between two neighbouring rows is interpolated linearly; a number without a unit could be a code and is that of the nearest
row. In a hole nothing is made up: the residual of its points is -1, its analog channels are 0, and `recorded` is 0.
"""

from __future__ import annotations

import shutil
import struct
import tempfile
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from itertools import accumulate, repeat
from math import inf, isnan
from operator import itemgetter, le, lt
from typing import IO, TYPE_CHECKING, Any

from handctl.errors import UsageError
from handctl.files import atomic_write
from handctl.record.log_reader import constant
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.record.exports import Export
    from handctl.record.log_reader import Channel

BLOCK = 512
MOST = 255
"""Entries of a list: its length is one byte."""
LARGEST = 32_000
"""Bytes of a parameter: the way to the next one is a signed word."""
HEADER_FRAMES = 0xFFFF
MOST_FRAMES = 1 << 26
"""Two weeks at 50 Hz; a file of them has some 10 GB."""
RECORDED = "recorded"
VALID, INVALID = 0.0, -1.0
PIECE = 1000
"""Frames that are made at once."""


def write(export: Export) -> None:
    """Write it, frame by frame."""
    channels = export.log.channels
    if len(channels) >= MOST:
        raise UsageError(
            f"{export.log.path} has {plural(len(channels), 'column')}, but a C3D file holds at most {MOST - 1}",
            hint="record fewer of them, or export to parquet, mcap or xdf",
            code="too-many",
        )
    rate = export.rate or round(export.nominal_hz or 0.0)
    if not rate:
        raise UsageError("the rate of the recording is unknown", hint="add --rate HZ", code="no-rate")
    angles = [at for at, channel in enumerate(channels) if channel.unit in ("deg", "°")]
    spans = (export.log.spans or {}).values()
    covered = max((one.end for one in spans), default=0) - min((one.begin for one in spans), default=0)
    if export.log.fits is None or covered * rate > 500 * MOST_FRAMES:
        _count(export, rate)  # a pass of its own
    with tempfile.TemporaryFile() as file:
        frames = Frames(export, rate, angles, _count(export, rate) if export.surveyed else MOST_FRAMES)
        frames.write(file)
        count = _count(export, rate)
        if count < frames.written:  # this computer's clock fell back
            file.seek(0)
            file.truncate()
            frames = Frames(export, rate, angles, count)
            frames.write(file)
        frames.rest(file, count)
        begin, _ = export.ends
        parameters = _parameters(export, rate, count, begin, [channels[at] for at in angles])
        header = struct.pack(
            "<BBHHHHHfHHf", 2, 0x50, len(angles), len(channels) + 1, 1, min(count, HEADER_FRAMES), 0, -1.0,
            2 + len(parameters) // BLOCK, 1, rate,
        )  # fmt: skip
        with atomic_write(export.path, "wb") as out:
            out.write(header.ljust(BLOCK, b"\0") + parameters)
            file.seek(0)
            shutil.copyfileobj(file, out)
    export.notes.append(
        f"resampled to {rate:g} Hz by this computer's clock: {count} frames, {frames.holes} of them marked as missing"
    )


def _count(export: Export, rate: float) -> int:
    """How many frames there are. Raises UsageError."""
    begin, end = export.ends
    count = int(max(0.0, end - begin) * rate + 1e-6) + 1
    if count > MOST_FRAMES:
        raise UsageError(
            f"{export.log.path} covers {end - begin:.0f} s, which is too long for a C3D file",
            hint="choose a segment with --segment N, or a lower --rate",
            code="too-many",
        )
    return count


class Frames:
    """The frames, made of the rows of a block, column by column; no more than `most`."""

    def __init__(self, export: Export, rate: float, angles: Sequence[int], most: int) -> None:
        self.written = self.holes = 0
        self._export, self._rate, self._most = export, rate, most
        self._linear = [bool(channel.unit) for channel in export.log.channels]
        self._whole = [channel.decimals is not None for channel in export.log.channels]
        self._residuals = range(3, 4 * len(angles), 4)
        analog, points = 4 * len(angles), {column: 4 * at for at, column in enumerate(angles)}
        self._places = [
            (analog + at, points[at]) if at in points else (analog + at,) for at in range(len(self._linear))
        ]
        """Where in a frame each column is."""
        self._wide = analog + len(self._linear) + 1
        self._data = memoryview(
            bytearray(struct.pack(f"<{self._wide}f", *[VALID] * (self._wide - 1), 1.0) * PIECE)
        ).cast("f")
        """The frames that are made next, whose values are written over those of the frames before."""
        self._begin, self._time = 0.0, inf
        self._last: list[float] = []
        """The numbers of the row before, at `_time`."""
        self._done: dict[int, int] = {}
        """How many rows of each segment."""

    def write(self, file: IO[bytes]) -> None:
        """Those before the last row."""
        for number, block, utc in self._export.blocks():
            columns = [block.floats(channel.column) for channel in self._export.log.channels]
            if not self._last:
                self._begin, self._last = utc[0], [column[0] for column in columns]
            rows = [[last, *column] for last, column in zip(self._last, columns, strict=True)]
            for way in self._ways(number, utc):
                self._put(file, rows, way)
            self._time, self._last = utc[-1], [column[-1] for column in columns]

    def rest(self, file: IO[bytes], count: int) -> None:
        """Those after it: they repeat it."""
        rows = [[last, last] for last in self._last]
        while (some := min(count - self.written, PIECE)) > 0:
            self._put(file, rows, Way([0] * some, [0.0] * some, []))

    def _ways(self, number: int, utc: Sequence[float]) -> Iterator[Way]:
        """The next frames, as far as these rows go. Each is written before the next are asked for."""
        survey, done = self._export.survey, self._done.get(number, 0)
        row = survey.segments[number].first_row + done
        alone = {gap - row for gap in survey.gap_rows if row <= gap < row + len(utc)} | ({0} if not done else set())
        self._done[number] = done + len(utc)
        begin, rate, times = self._begin, self._rate, [self._time, *utc]
        ends = [time - 1e-9 for time in utc]
        if ends != sorted(ends):
            ends = list(accumulate(ends, max))
        most = min(self._most, int((ends[-1] - begin) * rate) + 2)
        while frames := range(self.written, min(most, self.written + PIECE)):
            moments = [begin + frame / rate for frame in frames]
            moments = moments[: bisect_left(moments, ends[-1])]
            if not moments:
                return
            before = _before(moments, ends)
            pick = _getter(before)
            parts = [
                (moment - earlier) / (time - earlier) if time > earlier else 0.0
                for moment, earlier, time in zip(moments, pick(times), pick(utc), strict=False)
            ]
            if not 0.0 <= min(parts) <= max(parts) <= 1.0:
                parts = [min(max(part, 0.0), 1.0) for part in parts]
            holes = []
            for at in [at for at, row in enumerate(before) if row in alone] if alone else ():
                parts[at] = 0.0
                if moments[at] - times[before[at]] > 0.5e-3 / rate:
                    holes.append(at)
            yield Way(before, parts, holes)

    def _put(self, file: IO[bytes], rows: Sequence[Sequence[float]], way: Way) -> None:
        """Write these frames."""
        count, missing = len(way.before), set(way.holes)
        frames, layout = self._data[: count * self._wide], struct.Struct(f"<{count}f")
        for column, linear, whole, places in zip(rows, self._linear, self._whole, self._places, strict=True):
            if constant(column):
                values = struct.pack("<f", column[0] + 0.0) * count
            else:
                values = layout.pack(*way.values(column, missing, linear=linear, whole=whole))
            for place in places:
                frames[place :: self._wide] = memoryview(values).cast("f")
        for at in way.holes:
            frames[at * self._wide : (at + 1) * self._wide] = memoryview(bytes(4 * self._wide)).cast("f")
        self._mark(missing, INVALID, 0.0)
        file.write(frames)
        self._mark(missing, VALID, 1.0)
        self.written += count
        self.holes += len(missing)

    def _mark(self, frames: set[int], residual: float, recorded: float) -> None:
        for at in frames:
            for place in self._residuals:
                self._data[at * self._wide + place] = residual
            self._data[(at + 1) * self._wide - 1] = recorded


def _before(moments: Sequence[float], ends: Sequence[float]) -> Sequence[int]:
    """For each moment the first row that ends after it; mostly they follow each other, which is quicker to see than to look for each."""
    first = bisect_right(ends, moments[0])
    follow = range(first, first + len(moments))
    later = ends[first : follow.stop]
    if len(later) == len(moments) and all(map(le, later, moments[1:])) and all(map(lt, moments, later)):
        return follow
    return list(map(bisect_right, repeat(ends), moments))


def _getter(places: Sequence[int]) -> itemgetter[Any]:
    """What takes the items at these places, and perhaps one more; without a look at each where they follow each other."""
    return itemgetter(slice(places.start, places.stop)) if isinstance(places, range) else itemgetter(*places, 0)


class Way:
    """Some frames: for each the row before it, counted from the one before a block, and the part of the way to the next; which are in a hole."""

    def __init__(self, before: Sequence[int], parts: Sequence[float], holes: Sequence[int]) -> None:
        self.before, self.holes = before, holes
        near = [row if part < 0.5 else row + 1 for row, part in zip(before, parts, strict=True)]
        follow = isinstance(before, range)
        after = range(before[0] + 1, before[-1] + 2) if follow else [row + 1 for row in before]
        self._before, self._after = _getter(before), _getter(after)
        self._near = itemgetter(*near, 0)
        self._parts = parts

    def values(self, column: Sequence[float], missing: set[int], *, linear: bool, whole: bool) -> Sequence[float]:
        """Those of a column; the frames for which it has none are added to `missing`. `whole`: it has all."""
        values: list[float] = []
        if linear:
            values = [
                a + (b - a) * part
                for a, b, part in zip(self._before(column), self._after(column), self._parts, strict=False)
            ]
            if whole or not isnan(sum(column)):
                return values
        picked: Sequence[float] = self._near(column)[:-1]
        if whole:
            return picked
        near = [value or 0.0 for value in picked]
        values = [a if isnan(b) else b for a, b in zip(near, values, strict=True)] if linear else near
        for at in [at for at, value in enumerate(values) if isnan(value)] if isnan(sum(values)) else ():
            values[at] = 0.0
            missing.add(at)
        return values


# -- parameters -----------------------------------------------------------------------------------------------------------


def _parameters(export: Export, rate: float, count: int, begin: float, angles: Sequence[Channel]) -> bytes:
    """The groups and their parameters, in whole blocks."""
    channels = export.log.channels
    names = [*(channel.column for channel in channels), RECORDED]
    units = [*(channel.unit for channel in channels), ""]
    events = export.events
    if len(events) > MOST:
        export.remarks.append(f"a C3D file holds {MOST} events: the last {len(events) - MOST} were left out")
    events = events[:MOST]
    times = [part for one in events for part in divmod(max(0.0, one.utc_s - begin), 60.0)]
    fits = [
        f"segment {number}: host UTC {one.utc_s:.6f} s + {one.line.a:.6f} s + {one.line.b:.9f} * (t_s - {one.first.t_ms / 1000:.3f})"
        for number in export.segments
        for one in [export.survey.segments[number]]
    ]
    start = datetime.fromtimestamp(begin, timezone.utc).isoformat()
    point = [channel.column for channel in angles]
    groups: dict[str, dict[str, bytes]] = {
        "POINT": {
            "USED": _words([len(point)]), "SCALE": _floats([-1.0]), "RATE": _floats([rate]), "DATA_START": _words([0]),
            "FRAMES": _words([min(count, HEADER_FRAMES)]), "LONG_FRAMES": _floats([count]), "LABELS": _texts(point),
            "DESCRIPTIONS": _texts([channel.name for channel in angles]), "UNITS": _texts(["deg"] * len(point)),
            "ANGLES": _texts(point), "ANGLE_UNITS": _texts(["deg"]),
        },
        "ANALOG": {
            "USED": _words([len(names)]), "GEN_SCALE": _floats([1.0]), "SCALE": _floats([1.0] * len(names), many=True),
            "OFFSET": _words([0] * len(names), many=True), "RATE": _floats([rate]), "LABELS": _texts(names),
            "DESCRIPTIONS": _texts([*(channel.name for channel in channels), "1 where all values were recorded"]),
            "UNITS": _texts(units),
        },
        "TRIAL": {
            "ACTUAL_START_FIELD": _words([1, 0], many=True),
            "ACTUAL_END_FIELD": _words([count & 0xFFFF, count >> 16], many=True),
        },
        "EVENT": {
            "USED": _words([len(events)]), "CONTEXTS": _texts(["General"] * len(events)),
            "LABELS": _texts([one.kind for one in events]), "DESCRIPTIONS": _texts([one.text for one in events]),
            "TIMES": _floats(times, rows=2),
        },
        "MANUFACTURER": {"SOFTWARE": _texts([export.tool]), "COMPANY": _texts(["handctl"])},
        "HANDCTL": {
            "START_UTC": _texts([start]), "CLOCK_FIT": _texts(fits), "SIMULATED": _words([int(export.log.simulated)]),
            "RESAMPLED": _texts(["linear between neighbouring rows; numbers without a unit from the nearest row; none in holes"]),
        },
    }  # fmt: skip
    size = 4 + len(_packed(groups)) + 8
    blocks = -(-size // BLOCK)
    groups["POINT"]["DATA_START"] = _words([2 + blocks])
    if blocks > MOST:
        raise UsageError(
            f"the names and marks of {export.log.path} do not fit into a C3D file",
            hint="record fewer quantities, or export to another format",
            code="too-many",
        )
    return (struct.pack("<BBBB", 1, 0x50, blocks, 84) + _packed(groups)).ljust(blocks * BLOCK, b"\0")


def _packed(groups: dict[str, dict[str, bytes]]) -> bytes:
    data = b""
    for number, (group, parameters) in enumerate(groups.items(), 1):
        data += struct.pack("<Bb", len(group), -number) + group.encode() + struct.pack("<HB", 3, 0)
        for name, content in parameters.items():
            data += struct.pack("<Bb", len(name), number) + name.encode()
            data += struct.pack("<H", len(content) + 3) + content + b"\0"
    return data


def _texts(texts: Sequence[str]) -> bytes:
    """A list of texts of one width."""
    coded = [text.encode() for text in texts]
    width = max(1, min(max(map(len, coded), default=1), MOST, LARGEST // max(1, len(coded))))
    cut = [one[:width].decode("utf-8", "ignore").encode().ljust(width) for one in coded]
    return struct.pack("<bBBB", -1, 2, width, len(cut)) + b"".join(cut)


def _words(values: Sequence[int], *, many: bool = False) -> bytes:
    dimensions = bytes([1, len(values)]) if many else b"\0"
    return struct.pack("<b", 2) + dimensions + struct.pack(f"<{len(values)}H", *values)


def _floats(values: Sequence[float], *, many: bool = False, rows: int = 0) -> bytes:
    dimensions = bytes([2, rows, len(values) // rows]) if rows else bytes([1, len(values)]) if many else b"\0"
    return struct.pack("<b", 4) + dimensions + struct.pack(f"<{len(values)}f", *values)
