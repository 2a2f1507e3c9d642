"""A Parquet file: every column with its type, its unit and its decimals, the sidecar and the clock fit in the file. Needs pyarrow (`handctl[parquet]`).

Whole numbers are integers. Numbers with decimals are the nearest double, so rounding to `decimals` gives the recorded text.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from handctl.files import atomic_write
from handctl.record.log_reader import LogFile

if TYPE_CHECKING:
    from handctl.record.exports import Export

GROUP = 5_000
"""Rows of a row group, about."""
FIT = "host_fit_s"


def write(export: Export) -> None:
    """Write it, row group by row group."""
    import pyarrow
    from pyarrow import parquet

    fields = [
        pyarrow.field(name, getattr(pyarrow, kind)(), metadata=about) for name, kind, about in _fields(export.log)
    ]
    said = {"handctl": json.dumps(export.about(), ensure_ascii=False)}
    schema = pyarrow.schema(fields, metadata=said)
    with (
        atomic_write(export.path, "wb") as file,
        parquet.ParquetWriter(file, schema, compression="snappy", dictionary_pagesize_limit=1 << 16) as writer,
    ):
        waiting: list[Any] = []
        for _, block, utc in export.blocks(surveyed=False):
            columns = [_column(block.columns[field.name], field.type) for field in fields[:-1]]
            waiting.append(pyarrow.record_batch([*columns, utc], schema=schema))
            if sum(batch.num_rows for batch in waiting) >= GROUP:
                writer.write_table(pyarrow.Table.from_batches(waiting))
                waiting = []
        if waiting:
            writer.write_table(pyarrow.Table.from_batches(waiting))


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


def _column(texts: Sequence[str], kind: Any) -> Any:
    """A column, by the library's own reading of numbers: the nearest double."""
    import pyarrow

    return pyarrow.array([text or None for text in texts] if "" in texts else texts, pyarrow.string()).cast(kind)
