"""A Parquet file: every column with its type, its unit and its decimals, the sidecar and the clock fit in the file. Needs pyarrow (`handctl[parquet]`).

Whole numbers are integers. Numbers with decimals are the nearest double, so rounding to `decimals` gives the recorded text.
"""

from __future__ import annotations

import json
import struct
import sys
from collections.abc import Iterator
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
    gaps = {*export.log.texts, *(one.column for one in export.log.channels if one.decimals is None)}
    columns = [Column(one.name, one.type, gaps=one.name in gaps) for one in fields]
    with (
        atomic_write(export.path, "wb") as file,
        parquet.ParquetWriter(file, schema, compression="snappy", use_dictionary=False) as writer,
    ):
        rows = 0
        for _, block, utc in export.blocks(surveyed=False):
            block.known[FIT] = utc
            for column in columns:
                column.take(block)
            rows += len(utc)
            if rows >= GROUP:
                writer.write_table(pyarrow.Table.from_arrays([one.array(rows) for one in columns], schema=schema))
                rows = 0
        if rows:
            writer.write_table(pyarrow.Table.from_arrays([one.array(rows) for one in columns], schema=schema))


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


class Column:
    """A column of the rows that wait for their row group. Numbers are the nearest doubles. `gaps`: values may be missing in it.

    Laid out here: for that, and to read a text, the library loads 50 MB of others.
    """

    def __init__(self, name: str, kind: Any, *, gaps: bool) -> None:
        self._name, self._kind, self._gaps = name, kind, gaps
        self._code = CODES.get(str(kind))
        self._begin()

    def _begin(self) -> None:
        self._data: list[bytes] = []
        self._lengths: list[int] = []
        """Of texts."""
        self._there: list[str] = []
        """A digit for each value, 0 where it is missing."""

    def take(self, block: Block) -> None:
        """More rows."""
        name, code = self._name, self._code
        if self._gaps:
            texts = block.columns[name]
            self._there += ["1" if text else "0" for text in texts] if b"" in texts else ["1" * len(texts)]
        if code is None:
            self._lengths += map(len, block.columns[name])
            self._data += block.columns[name]
        else:
            numbers = block.floats(name) if code == "d" else block.known.get(name) or block.integers(name)
            self._data.append(struct.pack(f"{len(numbers)}{code}", *numbers))

    def array(self, count: int) -> Any:
        """An array of the library of these rows, with a bit for each value that is there; the next ones begin another."""
        import pyarrow

        there = "".join(reversed("".join(self._there)))  # the last one is the highest
        bits = int(there, 2).to_bytes(-(-count // 8), "little") if "0" in there else None
        ends = struct.pack(f"{count + 1}i", *accumulate(self._lengths, initial=0)) if self._code is None else None
        buffers = [bits, *([ends] if ends else []), b"".join(self._data)]
        self._begin()
        return pyarrow.Array.from_buffers(
            self._kind, count, [None if one is None else pyarrow.py_buffer(one) for one in buffers]
        )
