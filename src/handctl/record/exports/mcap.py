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
    from handctl.record.log_reader import Block

NS = 1_000_000_000
MOST_KNOWN = 1 << 15
"""Texts of a column that are remembered."""
PLAIN = 1 << 32
"""Below it doubles are closer than 6 decimals are, so that the text without its last zeros is the shortest one."""
UNIQUE = ("host_utc_s", "host_mono_s", "t_s", "seq")
"""Columns that do not repeat themselves."""


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
        kinds: dict[str, Any] = {name: float if decimals else int for name, decimals in log.lead}
        kinds |= {one.column: int if one.decimals == 0 else float for one in log.channels}
        own = [Told(name, kinds.get(name, str), known=name not in UNIQUE) for name in rows]
        for _, block, utc in export.blocks():
            columns = [one.column(block) for one in own]
            told = map(", ".join, zip(*columns, strict=True))
            came = [round(time * NS) for time in block.floats("host_utc_s")]
            asked = [int(text) & 0xFFFFFFFF for text in block.columns["seq"]]
            for time, at, number, row in zip(utc, came, asked, told, strict=True):
                writer.add_message(data, round(time * NS), f"{{{row}}}".encode(), at, number)
        for at, one in enumerate(export.events):
            text = json.dumps({"kind": one.kind, "text": one.text, "row": one.row}).encode()
            time = round(one.utc_s * NS)
            writer.add_message(marks, time, text, time, at)
        writer.finish()


class Told(dict[str, str]):
    """A column as JSON has it, with its name; a text that is not known yet is read and, with `known`, remembered."""

    def __init__(self, name: str, kind: Any, *, known: bool) -> None:
        super().__init__()
        self._name, self._head, self._kind, self._known = name, f"{json.dumps(name)}: ", kind, known

    def __missing__(self, text: str) -> str:
        nothing = '""' if self._kind is str else "null"
        told = self[text] = self._head + (json.dumps(self._kind(text)) if text else nothing)
        return told

    def column(self, block: Block) -> list[str]:
        """That of a block."""
        texts, head = block.columns[self._name], self._head
        if not self._known:
            numbers = block.floats(self._name) if self._kind is float else list(map(int, texts))
            if self._kind is float and _plain(numbers, texts):
                return [head + (one if one[-1] != "." else f"{one}0") for one in [text.rstrip("0") for text in texts]]
            return [f"{head}{number!r}" for number in numbers]
        if len(self) > MOST_KNOWN:
            self.clear()
        return list(map(self.__getitem__, texts))


def _plain(numbers: Sequence[float], texts: Sequence[str]) -> bool:
    """Whether the shortest text of each number is its own without the last zeros."""
    lines = "\n" + "\n".join(texts)
    return min(numbers) >= 0.001 and max(numbers) < PLAIN and lines.count("\n0") == lines.count("\n0.")


def _channel(writer: Any, topic: str, properties: dict[str, Any]) -> int:
    schema = json.dumps({"type": "object", "properties": properties}).encode()
    number = writer.register_schema(f"handctl{topic.replace('/', '.')}", "jsonschema", schema)
    found: int = writer.register_channel(topic, "json", number)
    return found
