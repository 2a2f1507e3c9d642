"""An MCAP file: a JSON message for each row and each mark, with a schema that has the units. Needs mcap (`handctl[mcap]`).

`log_time` is the host's time by the clock fit, `publish_time` that at which the reply came.
"""

from __future__ import annotations

import json
import re
import struct
import zlib
from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, Sequence
from io import BytesIO
from itertools import accumulate, chain, repeat
from operator import mul, sub
from typing import IO, TYPE_CHECKING, Any

from handctl.files import atomic_write
from handctl.record.log_reader import Meanings, constant, forget

if TYPE_CHECKING:
    from handctl.record.exports import Export
    from handctl.record.log_reader import Block, LogFile

MAGIC = b"\x89MCAP0\r\n"
CHUNK = 1 << 20
HEAD = struct.Struct("<BQHIQQ")
"""Of a message: what it is, length, channel, sequence, log time, publish time."""
APART = 9
"""Bytes of it that the length does not count."""
ROOM = bytes(HEAD.size)
"""It is written when the length is known."""
MOST_ASKED = 0xFFFFFFFF
"""The highest sequence number of a message; each row has a higher one than the row before."""
NS = 1e9
LEVEL, HOW = -2, {"hash_log": 11, "min_match": 4}
"""Of the compression: with names that repeat in each message the file is about as small at twice the speed of the usual one. A message
goes back no further than the one before it, which needs few places, and its short numbers are found only as short matches."""
NUMBER = re.compile(r"-?(0|[1-9][0-9]*)([.][0-9]+)?([eE][-+]?[0-9]+)?", re.ASCII)
"""Of JSON."""


def write(export: Export) -> None:
    """Write it; the library writes each chunk when it is full."""
    log = export.log
    numeric: dict[str, Any] = {"type": ["number", "null"]}
    rows = {name: {"type": "number"} for name, _ in log.lead}
    rows |= {one.column: numeric | {"description": one.name, "unit": one.unit} for one in log.channels}
    rows |= {name: {"type": "string"} for name in log.texts}
    with atomic_write(export.path, "wb") as file:
        writer = Chunks(file, export.tool)
        data = writer.channel(f"/{log.kind}/data", rows)
        marks = writer.channel(f"/{log.kind}/marks", {"kind": {"type": "string"}, "text": {"type": "string"}, "row": {"type": "integer"}})  # fmt: skip
        writer.metadata("handctl", {key: json.dumps(said) for key, said in export.about().items()})
        heads = [b"%b%b:" % (b"," if at else b"{", json.dumps(name).encode()) for at, name in enumerate(rows)]
        texts = Meanings(lambda text: json.dumps(text).encode())
        for _, block, utc in export.blocks(_number):
            if (asked := block.integers("seq"))[-1] > MOST_ASKED:
                asked = [number & MOST_ASKED for number in asked]
            came = _ns(block.floats("host_utc_s"))
            writer.add(data, _ns(utc), _rows(log, heads, block, texts), came, asked)
            forget([texts])
        for at, one in enumerate(export.events):
            text = ROOM + json.dumps({"kind": one.kind, "text": one.text, "row": one.row}).encode()
            time = round(one.utc_s * NS)
            writer.add(marks, [time], [text], [time], [at])
        writer.finish()


class Chunks:
    """The file, of the library's records: its own writer takes one message at a time, which costs more than all else.

    Each chunk ends with the message that makes it longer than CHUNK.
    """

    def __init__(self, file: IO[bytes], tool: str) -> None:
        from mcap import records
        from mcap.opcode import Opcode
        from zstandard import ZstdCompressionParameters, ZstdCompressor

        how = ZstdCompressionParameters.from_level(LEVEL, write_checksum=True, **HOW)
        self._records, self._opcode, self._compress = records, Opcode, ZstdCompressor(compression_params=how).compress
        self._file = file
        self._schemas: list[Any] = []
        self._channels: list[Any] = []
        self._metadata: list[Any] = []
        self._indexes: list[Any] = []
        self._counts: dict[int, int] = {}
        self._ends: list[tuple[int, int]] = []
        """The first and the last time of each chunk."""
        self._data = BytesIO()
        """The chunk, in front of what is left of a longer one: its memory is used again."""
        self._found: dict[int, tuple[list[int], list[int]]] = {}
        """Of this chunk, by channel: time and place of each message."""
        file.write(MAGIC)
        self._put(self._records.Header("", tool))

    def _put(self, *some: Any) -> bytes:
        data = _bytes(*some)
        self._file.write(data)
        return data

    def channel(self, topic: str, properties: dict[str, Any]) -> int:
        """Begin a channel of JSON; returns its number."""
        number, schema = len(self._channels) + 1, json.dumps({"type": "object", "properties": properties}).encode()
        name = f"handctl{topic.replace('/', '.')}"
        self._schemas.append(self._records.Schema(id=number, data=schema, encoding="jsonschema", name=name))
        self._channels.append(
            self._records.Channel(id=number, topic=topic, message_encoding="json", schema_id=number, metadata={})
        )
        self._data.write(_bytes(self._schemas[-1], self._channels[-1]))
        return number

    def metadata(self, name: str, said: dict[str, str]) -> None:
        """Names and texts about the file."""
        at = self._file.tell()
        length = len(self._put(self._records.Metadata(name=name, metadata=said)))
        self._metadata.append(self._records.MetadataIndex(offset=at, length=length, name=name))

    def add(
        self, channel: int, times: Sequence[int], texts: Sequence[bytes], came: Sequence[int], numbers: Sequence[int]
    ) -> None:
        """Messages: log time, content with ROOM in front of it, publish time, sequence."""
        lengths, done = list(map(len, texts)), 0
        self._counts[channel] = self._counts.get(channel, 0) + len(lengths)
        while done < len(lengths):
            places = list(accumulate(lengths[done:], initial=self._data.tell()))
            count = min(bisect_right(places, CHUNK, 1), len(places) - 1)
            some = slice(done, done + count)
            at, place = self._found.setdefault(channel, ([], []))
            at += times[some]
            place += places[:count]
            self._data.writelines(texts[some])
            left = map(sub, lengths[some], repeat(APART))
            with self._data.getbuffer() as data:
                deque(map(HEAD.pack_into, repeat(data), places, repeat(5), left, repeat(channel), numbers[some], times[some], came[some]), 0)  # fmt: skip
            done += count
            if self._data.tell() > CHUNK:
                self._close()

    def _close(self) -> None:
        """Write the chunk."""
        if not self._found:
            return
        size = self._data.tell()
        first = min(min(times) for times, _ in self._found.values())
        last = max(max(times) for times, _ in self._found.values())
        with self._data.getbuffer()[:size] as data:
            packed, at = self._compress(data), self._file.tell()
        length = len(
            self._put(
                self._records.Chunk(
                    compression="zstd", data=packed, message_start_time=first, message_end_time=last,
                    uncompressed_crc=0, uncompressed_size=size,  # the compressed data have a checksum of their own
                )
            )
        )  # fmt: skip
        offsets, indexes = {}, b""
        for channel, pair in self._found.items():
            found = list(chain.from_iterable(zip(*pair, strict=True)))
            offsets[channel] = at + length + len(indexes)
            indexes += struct.pack(f"<BQHI{len(found)}Q", 7, 6 + 8 * len(found), channel, 8 * len(found), *found)
        self._file.write(indexes)
        self._indexes.append(
            self._records.ChunkIndex(
                message_start_time=first, message_end_time=last, chunk_start_offset=at, chunk_length=length,
                message_index_offsets=offsets, message_index_length=len(indexes), compression="zstd",
                compressed_size=len(packed), uncompressed_size=size,
            )
        )  # fmt: skip
        self._ends.append((first, last))
        self._found = {}
        self._data.seek(0)

    def finish(self) -> None:
        """The last chunk, and the summary."""
        self._close()
        self._put(self._records.DataEnd(0))
        begin, data, offsets = self._file.tell(), b"", []
        statistics = self._records.Statistics(
            attachment_count=0, channel_count=len(self._channels), channel_message_counts=self._counts,
            chunk_count=len(self._indexes), message_count=sum(self._counts.values()), metadata_count=len(self._metadata),
            message_start_time=min(self._ends)[0], message_end_time=max(last for _, last in self._ends),
            schema_count=len(self._schemas),
        )  # fmt: skip
        groups: tuple[tuple[Any, list[Any]], ...] = (
            (self._opcode.SCHEMA, self._schemas), (self._opcode.CHANNEL, self._channels), (self._opcode.STATISTICS, [statistics]),
            (self._opcode.CHUNK_INDEX, self._indexes), (self._opcode.ATTACHMENT_INDEX, []), (self._opcode.METADATA_INDEX, self._metadata),
        )  # fmt: skip
        for code, some in groups:
            group = _bytes(*some)
            place = begin + len(data)
            offsets.append(self._records.SummaryOffset(group_opcode=code, group_start=place, group_length=len(group)))
            data += group
        end = begin + len(data)
        data += _bytes(*offsets)
        crc = zlib.crc32(struct.pack("<BQQQ", self._opcode.FOOTER, 20, begin, end), zlib.crc32(data))
        self._file.write(data)
        self._put(self._records.Footer(summary_start=begin, summary_offset_start=end, summary_crc=crc))
        self._file.write(MAGIC)


def _bytes(*some: Any) -> bytes:
    """Records of the library."""
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    for one in some:
        one.write(builder)
    data: bytes = builder.end()
    return data


def _ns(times: Iterable[float]) -> list[int]:
    """Times in seconds as whole nanoseconds."""
    return list(map(float.__round__, map(mul, times, repeat(NS))))


def _rows(log: LogFile, heads: Sequence[bytes], block: Block, texts: Meanings) -> list[bytes]:
    """The rows as JSON behind ROOM, each value after its head; neighbours that are the same in all rows are joined once."""
    columns = [_plain(block, name, decimals) for name, decimals in log.lead]
    columns += [block.known[one.column] for one in log.channels]
    columns += [texts.of(block.columns[name]) for name in log.texts]
    parts: list[Iterable[bytes]] = []
    same = ROOM
    for head, column in zip(heads, columns, strict=True):
        same += head
        if constant(column):
            same += column[0]
        else:
            parts += [repeat(same), column]
            same = b""
    return list(map(b"".join, zip(*parts, repeat(same + b"}", len(columns[0])), strict=False)))


def _number(text: str, number: float) -> bytes:
    """A number of the device as JSON: as it was written, if JSON knows that spelling."""
    if NUMBER.fullmatch(text):
        return text.encode()
    return repr(number).encode() if text else b"null"


def _plain(block: Block, name: str, decimals: int) -> Sequence[bytes]:
    """A column of the recorder as JSON: as it was written, but for zeros that only lead."""
    texts = block.columns[name]
    lines = b"\n" + (texts[0] if constant(texts) else block.lines(name))
    if b"-" not in lines and (b"\n0" not in lines or (decimals and lines.count(b"\n0") == lines.count(b"\n0."))):
        return texts
    return [repr(number).encode() for number in (block.floats(name) if decimals else block.integers(name))]
