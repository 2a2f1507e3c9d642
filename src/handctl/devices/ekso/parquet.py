"""A log as a Parquet file: every column with its type, its unit and its decimals, the sidecar in the file. Needs pyarrow (`handctl[parquet]`)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from handctl.devices.ekso.export import remarks_of, without
from handctl.devices.ekso.log import LEAD, NAMED
from handctl.devices.ekso.log_file import LogFile
from handctl.errors import UsageError
from handctl.files import atomic_write, writing
from handctl.record.source import MARK

GROUP = 20_000
"""Rows of a row group, about."""


def write(log: LogFile, path: str, *, segment: int | None, tool: str) -> tuple[int, float, tuple[str, ...]]:
    """Write FILE; returns its rows, the seconds that they cover, and remarks. Raises UsageError and OutputError.

    Whole numbers are integers. Numbers with decimals are the nearest double, so rounding to `decimals` gives the recorded text.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as exc:
        raise UsageError(
            "--to parquet needs pyarrow, which is not installed",
            hint='install it with: pip install "handctl[parquet]"',
            code="no-extra",
        ) from exc
    if segment is not None and log.spans is not None and segment not in log.spans:
        raise without(log, segment)
    fields = [pyarrow.field(name, getattr(pyarrow, kind)(), metadata=about) for name, kind, about in _fields(log)]
    said = {"handctl": json.dumps({"tool": tool, "log": log.sidecar}, ensure_ascii=False)}
    schema = pyarrow.schema(fields, metadata=said)
    count, first, last = 0, None, 0
    with (
        writing(path),
        atomic_write(path, "wb") as file,
        parquet.ParquetWriter(file, schema, compression="snappy") as writer,
    ):
        waiting: list[Any] = []
        for whole in log.blocks():
            block = whole.of(segment)
            if not block.t_ms:
                continue
            first, last = block.t_ms[0] if first is None else first, block.t_ms[-1]
            count += len(block.t_ms)
            columns = [_values(block.columns[field.name], str(field.type)) for field in fields]
            waiting.append(pyarrow.record_batch(columns, schema=schema))
            if sum(batch.num_rows for batch in waiting) >= GROUP:
                writer.write_table(pyarrow.Table.from_batches(waiting))
                waiting = []
        if waiting:
            writer.write_table(pyarrow.Table.from_batches(waiting))
        if first is None:
            raise without(log, segment)
    return count, (last - first) / 1000, remarks_of(log)


def _fields(log: LogFile) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Name, Arrow type and metadata of each column."""
    lead = dict(LEAD)
    shown = dict(zip(log.layout.columns, log.layout.shown, strict=True))
    for name in log.layout.names:
        if name in lead:
            unit = next((unit for unit in ("ms", "s") if name.endswith(f"_{unit}")), "")
            yield name, "float64" if lead[name] else "int64", {"unit": unit, "decimals": str(lead[name])}
        elif name in (MARK, f"{NAMED}_name"):
            yield name, "string", {}
        elif (quantity := shown.get(name)) is not None:
            about = {"unit": quantity.unit or "", "decimals": str(quantity.decimals), "quantity": quantity.name}
            yield name, "float64" if quantity.decimals else "int32", about
        else:
            yield name, "int32", {"unit": "", "decimals": "0"}


def _values(texts: Any, kind: str) -> list[Any]:
    if kind == "string":
        return [text or None for text in texts]
    return list(map(float if kind == "double" else int, texts))
