"""A Parquet file: every column with its type, its unit and its decimals, the sidecar and the clock fit in the file. Needs pyarrow (`handctl[parquet]`).

Whole numbers are integers. Numbers with decimals are the nearest double, so rounding to `decimals` gives the recorded text.
"""

from __future__ import annotations

import json
import struct
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from handctl.files import atomic_write
from handctl.record.log_reader import Block, LogFile

if TYPE_CHECKING:
    from handctl.record.exports import Export

GROUP = 5_000
"""Rows of a row group, about."""
REMOTE = ("pyarrow._s3fs", "pyarrow._gcsfs", "pyarrow._azurefs", "pyarrow._hdfs")
FIT = "host_fit_s"
CODES = {"double": "d", "int64": "q", "int32": "i"}
"""How `struct` names a type of numbers."""


def write(export: Export) -> None:
    """Write it, row group by row group."""
    import pyarrow

    parquet = _library()
    fields = [
        pyarrow.field(name, getattr(pyarrow, kind)(), metadata=about) for name, kind, about in _fields(export.log)
    ]
    said = {"handctl": json.dumps(export.about(), ensure_ascii=False)}
    schema = pyarrow.schema(fields, metadata=said)
    with (
        atomic_write(export.path, "wb") as file,
        parquet.ParquetWriter(file, schema, compression="snappy", use_dictionary=False) as writer,
    ):
        waiting: list[Any] = []
        whole = {name for name, _ in export.log.lead} | {
            one.column for one in export.log.channels if one.decimals is not None
        }
        for _, block, utc in export.blocks(surveyed=False):
            fitted = _array(pyarrow.float64(), None, ("d", utc))
            columns = [_column(block, one.name, one.type, whole=one.name in whole) for one in fields[:-1]]
            waiting.append(pyarrow.record_batch([*columns, fitted], schema=schema))
            if sum(batch.num_rows for batch in waiting) >= GROUP:
                writer.write_table(pyarrow.Table.from_batches(waiting))
                waiting = []
        if waiting:
            writer.write_table(pyarrow.Table.from_batches(waiting))


def _library() -> Any:
    """Its part for this format, without what reaches for files elsewhere: 4 MB that no file on this computer needs.

    Whoever imports `pyarrow.fs` afterwards gets all of it.
    """
    known = "pyarrow.fs" in sys.modules
    missing: dict[str, Any] = dict.fromkeys(REMOTE)
    before = {name: sys.modules[name] for name in REMOTE if name in sys.modules}
    sys.modules.update(missing | before)
    try:
        return import_module("pyarrow.parquet")
    finally:
        for name in REMOTE:
            if sys.modules[name] is None:
                del sys.modules[name]
        if not known:
            sys.modules.pop("pyarrow.fs", None)


def _fields(log: LogFile) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Name, Arrow type and metadata of each column."""
    lead, channels = dict(log.lead), {channel.column: channel for channel in log.channels}
    for name in log.names:
        if name in lead:
            unit = next((unit for unit in ("ms", "s") if name.endswith(f"_{unit}")), "")
            yield name, "float64" if lead[name] else "int64", {"unit": unit, "decimals": str(lead[name])}
        elif name in log.texts:
            yield name, "string", {}
        else:
            one = channels[name]
            about = {"unit": one.unit, "quantity": one.name}
            if one.decimals is not None:
                about["decimals"] = str(one.decimals)
            yield name, "int32" if one.decimals == 0 else "float64", about
    yield FIT, "float64", {"unit": "s", "decimals": "6"}


def _column(block: Block, name: str, kind: Any, *, whole: bool) -> Any:
    """A column; numbers are the nearest doubles. `whole`: nothing is missing in it.

    Laid out here: for that, and to read a text, the library loads 50 MB of others.
    """
    texts, code = block.columns[name], CODES.get(str(kind))
    there = None if whole or b"" not in texts else "".join("1" if text else "0" for text in reversed(texts))
    if code is None:
        return _array(kind, there, ("i", list(accumulate(map(len, texts), initial=0))), b"".join(texts))
    numbers = block.floats(name) if code == "d" else block.known.get(name) or list(map(int, texts))
    return _array(kind, there, (code, numbers))


def _array(kind: Any, there: str | None, numbers: tuple[str, Sequence[float]], *more: bytes) -> Any:
    """An array of the library, with a bit for each value that is there; the last is the highest."""
    import pyarrow

    code, values = numbers
    bits = there and int(there, 2).to_bytes(-(-len(there) // 8), "little")
    buffers = [bits, struct.pack(f"{len(values)}{code}", *values), *more]
    count = len(values) - len(more)  # texts end where the next one begins
    return pyarrow.Array.from_buffers(kind, count, [None if one is None else pyarrow.py_buffer(one) for one in buffers])
