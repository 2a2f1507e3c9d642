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
from handctl.record.exports import absent, no_ssl
from handctl.record.log_reader import Block, LogFile

if TYPE_CHECKING:
    from handctl.record.exports import Export

GROUP = 10_000
"""Rows of a row group, about: what a file holds of each stays in memory until its end."""
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
    # That of hours is long: only the library keeps it.
    schema = pyarrow.schema(fields, metadata={"handctl": json.dumps(export.about(), ensure_ascii=False)})
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
    """Its part for this format, without what reaches for files elsewhere: 9 MB that no file on this computer needs.

    Whoever imports `pyarrow.fs` afterwards gets all of it; the certificates only where this process is not ours alone.
    """
    known = "pyarrow.fs" in sys.modules
    with absent(REMOTE, **no_ssl()):
        found = import_module("pyarrow.parquet")
    if not known:
        sys.modules.pop("pyarrow.fs", None)
    return found


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
        self._data = bytearray()
        """Numbers, in memory that each row group uses again."""
        self._begin()

    def _begin(self) -> None:
        self._filled = 0
        """Bytes of `_data` with numbers of these rows."""
        self._texts: list[bytes] = []
        self._there: list[str] = []
        """A digit for each value, 0 where it is missing."""

    def take(self, block: Block) -> None:
        """More rows."""
        name, code = self._name, self._code
        if self._gaps:
            texts = block.columns[name]
            self._there += ["1" if text else "0" for text in texts] if b"" in texts else ["1" * len(texts)]
        if code is None:
            self._texts += block.columns[name]
        else:
            numbers = block.floats(name) if code == "d" else block.known.get(name) or block.integers(name)
            layout = struct.Struct(f"{len(numbers)}{code}")
            if (missing := self._filled + layout.size - len(self._data)) > 0:
                self._data += bytes(missing)
            layout.pack_into(self._data, self._filled, *numbers)
            self._filled += layout.size

    def array(self, count: int) -> Any:
        """An array of the library of these rows, with a bit for each value that is there; it is over once more rows are taken."""
        import pyarrow

        there = "".join(reversed("".join(self._there)))  # the last one is the highest
        bits = int(there, 2).to_bytes(-(-count // 8), "little") if "0" in there else None
        buffers: list[Any]
        if self._code is None:
            ends = struct.pack(f"{count + 1}i", *accumulate(map(len, self._texts), initial=0))
            buffers = [bits, ends, b"".join(self._texts)]
        else:
            buffers = [bits, memoryview(self._data)[: self._filled]]
        self._begin()
        return pyarrow.Array.from_buffers(
            self._kind, count, [None if one is None else pyarrow.py_buffer(one) for one in buffers]
        )
