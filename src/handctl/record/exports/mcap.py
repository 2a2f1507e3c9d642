"""An MCAP file: a JSON message for each row and each mark, with a schema that has the units. Needs mcap (`handctl[mcap]`).

`log_time` is the host's time by the clock fit, `publish_time` that at which the reply came.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from handctl.files import atomic_write

if TYPE_CHECKING:
    from handctl.record.exports import Export

NS = 1_000_000_000


def write(export: Export) -> None:
    """Write it; the library writes each chunk when it is full."""
    from mcap.writer import Writer

    log, events = export.log, export.events
    number: dict[str, Any] = {"type": ["number", "null"]}
    rows = {name: {"type": "number"} for name, _ in log.lead}
    rows |= {one.column: number | {"description": one.name, "unit": one.unit} for one in log.channels}
    rows |= {name: {"type": "string"} for name in log.texts}
    with atomic_write(export.path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=export.tool)
        data = _channel(writer, f"/{log.kind}/data", rows)
        marks = _channel(writer, f"/{log.kind}/marks", {"kind": {"type": "string"}, "text": {"type": "string"}, "row": {"type": "integer"}})  # fmt: skip
        writer.add_metadata("handctl", {key: json.dumps(said) for key, said in export.about().items()})
        kinds: list[Any] = [float if decimals else int for _, decimals in log.lead]
        for _, block, utc in export.blocks():
            columns: list[Iterable[Any]] = [
                map(kind, block.columns[name]) for kind, (name, _) in zip(kinds, log.lead, strict=True)
            ]
            columns += [block.values(channel) for channel in log.channels]
            columns += [block.columns[name] for name in log.texts]
            for time, row in zip(utc, zip(*columns, strict=True), strict=True):
                message = dict(zip(rows, row, strict=True))
                came = round(float(message["host_utc_s"]) * NS)
                writer.add_message(
                    data, round(time * NS), json.dumps(message).encode(), came, message["seq"] & 0xFFFFFFFF
                )
        for at, one in enumerate(events):
            text = json.dumps({"kind": one.kind, "text": one.text, "row": one.row}).encode()
            time = round(one.utc_s * NS)
            writer.add_message(marks, time, text, time, at)
        writer.finish()


def _channel(writer: Any, topic: str, properties: dict[str, Any]) -> int:
    schema = json.dumps({"type": "object", "properties": properties}).encode()
    number = writer.register_schema(f"handctl{topic.replace('/', '.')}", "jsonschema", schema)
    found: int = writer.register_channel(topic, "json", number)
    return found
