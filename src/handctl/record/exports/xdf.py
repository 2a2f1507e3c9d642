"""An XDF file (version 1.0 of the format): a stream of rows and one of marks, as LabRecorder writes them.

A stamp is the steady clock of the recording computer by the clock fit, the clock that the Lab Streaming Layer uses there. So
all clock offsets are 0: rows, marks and other streams of that computer share it. A recording with missing rows has no nominal
rate, for readers would spread its rows evenly over the time.
"""

from __future__ import annotations

import struct
from itertools import repeat
from typing import IO, TYPE_CHECKING
from xml.sax.saxutils import escape

from handctl.files import atomic_write
from handctl.record.csv_columns import clean
from handctl.record.exports import name_of

if TYPE_CHECKING:
    from handctl.record.exports import Export

FILE_HEADER, STREAM_HEADER, SAMPLES, CLOCK_OFFSET, BOUNDARY, STREAM_FOOTER = range(1, 7)
ROWS, MARKS = 1, 2
UUID = bytes.fromhex("43A546DCCBF5410FB30ED5467383CBE4")
"""Where a reader finds its way again after damage."""


def write(export: Export) -> None:
    """Write it, a chunk of samples for each block."""
    log = export.log
    # text columns stay out: a stream has one type
    labels = [(name, "ms" if name.endswith("_ms") else "s" if name.endswith("_s") else "") for name, _ in log.lead]
    labels += [(channel.column, channel.unit) for channel in log.channels]
    rate = (export.nominal_hz or 0.0) if export.even else 0.0
    with atomic_write(export.path, "wb") as file:
        file.write(b"XDF:")
        _chunk(file, FILE_HEADER, b'<?xml version="1.0"?><info><version>1.0</version></info>')
        name = f"handctl {log.kind}"
        channels = "".join(
            f"<channel><label>{escape(clean(label))}</label><unit>{escape(clean(unit))}</unit></channel>"
            for label, unit in labels
        )
        ahead, begin, row = None, 0.0, struct.Struct(f"<B{len(labels) + 1}d")
        for _, block, utc in export.blocks():
            if ahead is None:
                ahead = block.floats("host_utc_s")[0] - block.floats("host_mono_s")[0]
                begin = utc[0] - ahead
                about = f"<channels>{channels}</channels><handctl>{escape(_said(export, ahead))}</handctl>"
                _header(file, ROWS, name, "Motion", "double64", len(labels), rate, about)
                _header(file, MARKS, f"{name} marks", "Markers", "string", 1, 0.0, "")
                for stream in (ROWS, MARKS):
                    _chunk(file, CLOCK_OFFSET, struct.pack("<Idd", stream, begin, 0.0))
            columns = [block.floats(label) for label, _ in labels]
            rows = map(row.pack, repeat(8), [time - ahead for time in utc], *columns)
            _chunk(file, SAMPLES, struct.pack("<IBI", ROWS, 4, len(utc)) + b"".join(rows))
            _chunk(file, BOUNDARY, UUID)
        assert ahead is not None, "there are rows, or blocks would have raised"
        end = export.ends[1] - ahead
        marks = [(one.utc_s - ahead, f"[{one.text}]" if one.kind != "mark" else one.text) for one in export.events]
        data = b"".join(struct.pack("<BdBI", 8, time, 4, len(text.encode())) + text.encode() for time, text in marks)
        _chunk(file, SAMPLES, struct.pack("<IBI", MARKS, 4, len(marks)) + data)
        for stream, count in ((ROWS, export.rows), (MARKS, len(marks))):
            _chunk(file, CLOCK_OFFSET, struct.pack("<Idd", stream, end, 0.0))
            times = f"<first_timestamp>{begin!r}</first_timestamp><last_timestamp>{end!r}</last_timestamp>"
            footer = f'<?xml version="1.0"?><info>{times}<sample_count>{count}</sample_count></info>'
            _chunk(file, STREAM_FOOTER, struct.pack("<I", stream) + footer.encode())


def _said(export: Export, ahead: float) -> str:
    import json

    return json.dumps({"source": name_of(export), "utc_minus_stamp_s": round(ahead, 6), **export.about()})


def _header(file: IO[bytes], stream: int, name: str, kind: str, form: str, count: int, rate: float, about: str) -> None:
    text = (
        f'<?xml version="1.0"?><info><name>{escape(name)}</name><type>{kind}</type><channel_count>{count}</channel_count>'
        f"<nominal_srate>{rate}</nominal_srate><channel_format>{form}</channel_format><source_id>{escape(name)}</source_id>"
        f"<version>1.1</version><desc>{about}</desc></info>"
    )
    _chunk(file, STREAM_HEADER, struct.pack("<I", stream) + text.encode())


def _chunk(file: IO[bytes], tag: int, content: bytes) -> None:
    file.write(struct.pack("<BIH", 4, len(content) + 2, tag) + content)
