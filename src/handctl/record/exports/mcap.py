"""An MCAP file: a JSON message for each row and each mark, with a schema that has the units. Needs mcap (`handctl[mcap]`).

`log_time` is the host's time by the clock fit, `publish_time` that at which the reply came.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from handctl.files import atomic_write

if TYPE_CHECKING:
    from handctl.record.exports import Export

NS = 1_000_000_000
MOST_KNOWN = 1 << 15
"""Texts of a column that are remembered."""


def write(export: Export) -> None:
    """Write it; the library writes each chunk when it is full."""
    from mcap.writer import Writer

    log = export.log
    numeric: dict[str, Any] = {"type": ["number", "null"]}
    rows = {name: {"type": "number"} for name, _ in log.lead}
    rows |= {one.column: numeric | {"description": one.name, "unit": one.unit} for one in log.channels}
    rows |= {name: {"type": "string"} for name in log.texts}
    with atomic_write(export.path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=export.tool)
        data = _channel(writer, f"/{log.kind}/data", rows)
        marks = _channel(writer, f"/{log.kind}/marks", {"kind": {"type": "string"}, "text": {"type": "string"}, "row": {"type": "integer"}})  # fmt: skip
        writer.add_metadata("handctl", {key: json.dumps(said) for key, said in export.about().items()})
        form = "{" + ", ".join(f"{json.dumps(name)}: ".replace("%", "%%") + "%s" for name in rows) + "}"
        kinds: dict[str, Any] = {name: float if decimals else int for name, decimals in log.lead}
        kinds |= {one.column: int if one.decimals == 0 else float for one in log.channels}
        known: dict[str, dict[str, str]] = {name: {} for name in (*(one.column for one in log.channels), *log.texts)}
        for _, block, utc in export.blocks():
            columns = [_told(block.columns[name], kinds.get(name, str), known.get(name)) for name in rows]
            came = [round(float(text) * NS) for text in block.columns["host_utc_s"]]
            asked = [int(text) & 0xFFFFFFFF for text in block.columns["seq"]]
            for time, at, number, row in zip(utc, came, asked, zip(*columns, strict=True), strict=True):
                writer.add_message(data, round(time * NS), (form % row).encode(), at, number)
        for at, one in enumerate(export.events):
            text = json.dumps({"kind": one.kind, "text": one.text, "row": one.row}).encode()
            time = round(one.utc_s * NS)
            writer.add_message(marks, time, text, time, at)
        writer.finish()


def _told(texts: Sequence[str], kind: Any, known: dict[str, str] | None) -> list[str]:
    """A column as JSON has it; `known` remembers what a device repeats."""
    if known is None:
        return list(map(repr, map(kind, texts)))
    if not all(map(known.__contains__, texts)):
        if len(known) > MOST_KNOWN:
            known.clear()
        nothing = '""' if kind is str else "null"
        known.update({one: json.dumps(kind(one)) if one else nothing for one in set(texts).difference(known)})
    return list(map(known.__getitem__, texts))


def _channel(writer: Any, topic: str, properties: dict[str, Any]) -> int:
    schema = json.dumps({"type": "object", "properties": properties}).encode()
    number = writer.register_schema(f"handctl{topic.replace('/', '.')}", "jsonschema", schema)
    found: int = writer.register_channel(topic, "json", number)
    return found
