"""A C3D file (the manual of c3d.org, floating point, Intel): frames at a constant rate on the host's clock.

    header (512 bytes) | parameters, in blocks of 512 | frames: a point (x, y, z, residual) per angle, then the analog channels

An angle is a point with its value as x, listed in POINT:ANGLES; every number of the device is an analog channel as well. A frame
between two neighbouring rows is interpolated linearly; a number without a unit could be a code and is that of the nearest
row. In a hole nothing is made up: the residual of its points is -1, its analog channels are 0, and `recorded` is 0.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING

from handctl.errors import UsageError
from handctl.files import atomic_write
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.record.exports import Export
    from handctl.record.log_file import Channel

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
Frame = tuple[bool, list[float]]


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
    begin, end = export.ends
    count = int((end - begin) * rate + 1e-6) + 1
    if count > MOST_FRAMES:
        raise UsageError(
            f"{export.log.path} covers {end - begin:.0f} s, which is too long for a C3D file",
            hint="choose a segment with --segment N, or a lower --rate",
            code="too-many",
        )
    angles = [at for at, channel in enumerate(channels) if channel.unit in ("deg", "°")]
    parameters = _parameters(export, rate, count, begin, [channels[at] for at in angles])
    header = struct.pack(
        "<BBHHHHHfHHf", 2, 0x50, len(angles), len(channels) + 1, 1, min(count, HEADER_FRAMES), 0, -1.0,
        2 + len(parameters) // BLOCK, 1, rate,
    )  # fmt: skip
    form = struct.Struct(f"<{4 * len(angles) + len(channels) + 1}f")
    holes = 0
    with atomic_write(export.path, "wb") as file:
        file.write(header.ljust(BLOCK, b"\0") + parameters)
        for there, values in _frames(export, rate, begin, count):
            holes += not there
            residual = VALID if there else INVALID
            points = [part for at in angles for part in (values[at], 0.0, 0.0, residual)]
            file.write(form.pack(*points, *values, float(there)))
    export.notes.append(
        f"resampled to {rate:g} Hz by this computer's clock: {count} frames, {holes} of them marked as missing"
    )


def _frames(export: Export, rate: float, begin: float, count: int) -> Iterator[Frame]:
    """Whether there is something to say of each frame, and its values."""
    linear = [bool(channel.unit) for channel in export.log.channels]
    nothing: Frame = (False, [0.0] * len(linear))
    gaps = set(export.survey.gap_rows)
    frame, half = 0, 0.5 / rate
    earlier: tuple[float, Sequence[float | None]] | None = None
    segment = 0
    row = export.survey.segments[export.segments[0]].first_row
    for number, block, utc in export.blocks():
        rows = zip(*(block.values(channel.column) for channel in export.log.channels), strict=True)
        for time, values in zip(utc, rows, strict=True):
            joined = earlier is not None and number == segment and row not in gaps
            while frame < count and (at := begin + frame / rate) < time - 1e-9:
                if joined and earlier is not None:
                    yield _between(earlier, (time, values), at, linear)
                elif earlier is not None and at - earlier[0] <= half * 1e-3:
                    yield _between(earlier, earlier, at, linear)
                else:
                    yield nothing
                frame += 1
            earlier, segment = (time, values), number
            row += 1
    while frame < count and earlier is not None:
        yield _between(earlier, earlier, begin + frame / rate, linear)
        frame += 1


def _between(
    one: tuple[float, Sequence[float | None]],
    other: tuple[float, Sequence[float | None]],
    at: float,
    linear: list[bool],
) -> Frame:
    long = other[0] - one[0]
    part = min(1.0, max(0.0, (at - one[0]) / long)) if long > 0 else 0.0
    values, there = [], True
    for a, b, smooth in zip(one[1], other[1], linear, strict=True):
        if smooth and a is not None and b is not None:
            values.append(a + (b - a) * part)
            continue
        near = a if part < 0.5 else b
        values.append(near or 0.0)
        there = there and near is not None
    return there, values


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
