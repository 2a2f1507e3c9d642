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
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from itertools import islice, repeat
from math import inf, isnan
from operator import itemgetter
from typing import IO, TYPE_CHECKING

from handctl.errors import UsageError
from handctl.files import atomic_write
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
Place = tuple[int, int, float]


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
        if count < frames.written or export.refitted():  # the fit of the rows is not the sidecar's
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
    count = int((end - begin) * rate + 1e-6) + 1
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
        self._export, self._rate, self._angles, self._most = export, rate, angles, most
        self._linear = [bool(channel.unit) for channel in export.log.channels]
        self._wide = 4 * len(angles) + len(self._linear) + 1
        self._begin = self._time = 0.0
        self._last: list[float] = []
        """The numbers of the row before, at `_time`."""
        self._done: dict[int, int] = {}
        """How many rows of each segment."""

    def write(self, file: IO[bytes]) -> None:
        """Those before the last row."""
        for number, block, utc in self._export.blocks():
            columns = [block.floats(channel.column) for channel in self._export.log.channels]
            if not self._last:
                self._begin = utc[0]
            self._take(file, columns, self._places(number, utc))
            self._time, self._last = utc[-1], [column[-1] for column in columns]

    def rest(self, file: IO[bytes], count: int) -> None:
        """Those after it: they repeat it."""
        self._take(file, [()] * len(self._last), repeat((0, 0, 0.0), count - self.written))

    def _places(self, number: int, utc: Sequence[float]) -> Iterator[Place | None]:
        """Where the next frames are among these rows."""
        survey, done = self._export.survey, self._done.get(number, 0)
        row = survey.segments[number].first_row + done
        alone = {gap - row for gap in survey.gap_rows if row <= gap < row + len(utc)} | ({0} if not done else set())
        self._done[number] = done + len(utc)
        earlier, frame, begin, rate = self._time if self._last else inf, self.written, self._begin, self._rate
        for at, time in enumerate(utc):
            while frame < self._most and (moment := begin + frame / rate) < time - 1e-9:
                frame += 1
                if at not in alone:
                    part = (moment - earlier) / (time - earlier) if time > earlier else 0.0
                    yield at, at + 1, part if 0.0 <= part <= 1.0 else float(part > 1.0)
                else:
                    yield (at, at, 0.0) if moment - earlier <= 0.5e-3 / rate else None
            earlier = time

    def _take(self, file: IO[bytes], columns: Sequence[Sequence[float]], places: Iterator[Place | None]) -> None:
        """Write the frames at these places."""
        rows = [[column[0] if not self._last else self._last[at], *column] for at, column in enumerate(columns)]
        angles, wide, nowhere = len(self._angles), self._wide, (0, 0, 0.0)
        while some := list(islice(places, PIECE)):
            holes = [at for at, place in enumerate(some) if place is None]
            way = Way(*zip(*(place or nowhere for place in some), strict=True))
            there, count = [True] * len(some), struct.Struct(f"<{len(some)}f")
            data = bytearray(4 * wide * len(some))
            frames = memoryview(data).cast("f")
            for place, (column, linear) in enumerate(zip(rows, self._linear, strict=True)):
                values = way.values(column, there, linear=linear)
                for at in holes:
                    values[at] = 0.0
                packed = memoryview(count.pack(*values)).cast("f")
                frames[4 * angles + place :: wide] = packed
                if place in self._angles:
                    frames[4 * self._angles.index(place) :: wide] = packed
            for at in holes:
                there[at] = False
            residual = memoryview(count.pack(*[VALID if one else INVALID for one in there])).cast("f")
            for at in range(angles):
                frames[4 * at + 3 :: wide] = residual
            frames[wide - 1 :: wide] = memoryview(count.pack(*there)).cast("f")
            file.write(data)
            self.written += len(some)
            self.holes += there.count(False)


class Way:
    """Some places: for each frame the rows before and after it, counted from the one before a block, and the part of the way."""

    def __init__(self, one: Sequence[int], other: Sequence[int], parts: Sequence[float]) -> None:
        near = [a if part < 0.5 else b for a, b, part in zip(one, other, parts, strict=True)]
        self._one, self._other, self._near = (itemgetter(*numbers, numbers[0]) for numbers in (one, other, near))
        self._parts = parts

    def values(self, column: Sequence[float], there: list[bool], *, linear: bool) -> list[float]:
        """Those of a column; where it has none, `there` becomes False."""
        if column[0] == column[-1] and column.count(column[0]) == len(column):
            return [column[0] + 0.0] * len(self._parts)
        values = []
        if linear:
            values = [
                a + (b - a) * part
                for a, b, part in zip(self._one(column), self._other(column), self._parts, strict=False)
            ]
            if not isnan(sum(column)):
                return values
        near = [value or 0.0 for value in self._near(column)[:-1]]
        values = [a if isnan(b) else b for a, b in zip(near, values, strict=True)] if linear else near
        for at in [at for at, value in enumerate(values) if isnan(value)] if isnan(sum(values)) else ():
            there[at], values[at] = False, 0.0
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
