"""A recording read back from its CSV file and its sidecar, block by block. Knows no family: one whose columns are more strictly defined has a subclass.

A file that is not a log, or not whole, is refused with the number of the line. The sidecar says whether the log was closed;
one that was not (power failure, kill) may end in the middle of a row, which is then left out.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import compress, islice
from math import isfinite
from typing import Any, BinaryIO, NamedTuple

from handctl.errors import Hint, UsageError
from handctl.files import NoFile, opened, read_text
from handctl.record.recording import schema
from handctl.record.source import MARK, lead
from handctl.wording import plural

CHUNK = 1 << 17
"""Bytes that are read at once."""
ROWS = 1000
"""Rows of a block, where they are not cut by bytes."""
LONGEST_LINE = 65536
UNTOUCHED = "The file was not changed"
ERROR = "error"
SAME_S = 0.002
"""Seconds within which the first row and the sidecar have the same time: one of them is rounded to milliseconds."""
LATEST_S = 253_402_300_800.0
"""The end of the year 9999, seconds since 1970: no clock of a host is later."""


class Channel(NamedTuple):
    """A column with a number of the device.

    decimals  as many as each value has; None = they are written as they came, and a value may be missing
    """

    column: str
    name: str
    unit: str
    decimals: int | None = None


class Span(NamedTuple):
    """What a segment covers: device times of its first and last row, and their number."""

    begin: int
    end: int
    rows: int


class Block:
    """Some rows that follow each other: their texts by column, device times, segments; `text` = all of it where nothing is quoted."""

    def __init__(self, columns: dict[str, Sequence[str]], text: str = "") -> None:
        self.columns = columns
        self.text = text
        self.t_ms: list[int] = []
        self.segments: list[int] = []

    def like(self, columns: dict[str, Sequence[str]]) -> Block:
        """A block of the same log."""
        return Block(columns)

    def of(self, segment: int | None) -> Block:
        """Only the rows of a segment."""
        if segment is None or set(self.segments) == {segment}:
            return self
        keep = [number == segment for number in self.segments]
        found = self.like({name: tuple(compress(texts, keep)) for name, texts in self.columns.items()})
        found.t_ms, found.segments = list(compress(self.t_ms, keep)), [segment] * sum(keep)
        return found

    def values(self, channel: Channel) -> list[float | None]:
        """A column of the device as numbers, None where nothing was read."""
        number, texts = float if channel.decimals != 0 else int, self.columns[channel.column]
        return [number(text) if text else None for text in texts] if "" in texts else list(map(number, texts))


class LogFile:
    """A log on the disk. Raises UsageError when it cannot be read, or is none.

    names     of all columns, in the file's order
    lead      the columns of the recorder: name and decimals
    channels  those of the device
    texts     those with words
    """

    names: tuple[str, ...]
    lead: tuple[tuple[str, int], ...]
    channels: tuple[Channel, ...]
    texts: tuple[str, ...]

    def __init__(self, path: str, kind: str) -> None:
        self.path = path
        self.kind = kind
        self.sidecar = _load_sidecar(f"{path}.json", schema(kind))
        self.cut = False
        """True when an unfinished last row was left out."""
        with opened(path, "a log", hint=Hint("{} makes one", f"{kind} log {path}")) as file:
            header = file.readline(LONGEST_LINE).decode("utf-8", "replace")
        try:
            names = next(csv.reader([header.rstrip("\r\n")]), [])
        except csv.Error as exc:
            raise damaged(path, 1, f"not comma-separated text: {exc}") from exc
        self._header(names)

    def _header(self, names: list[str]) -> None:
        """Take the names of the columns. Raises UsageError for those of another file."""
        self.lead = lead("")
        known = [name for name, _ in self.lead]
        if names[: len(known)] != known or names[-2:] != [ERROR, MARK] or len(set(names)) < len(names):
            raise damaged(self.path, 1, f"the columns are not those of `handctl {self.kind} log`")
        self.names, self.texts = tuple(names), (ERROR, MARK)
        about: dict[str, Any] = {str(one.get("column")): one for one in (self.sidecar or {}).get("columns", [])}
        self.channels = tuple(
            Channel(name, str(one.get("name") or name), str(one.get("unit") or ""))
            for name in names[len(known) : -2]
            for one in [about.get(name, {})]
        )

    @property
    def clocked(self) -> bool:
        """Whether the device has a clock, with a column."""
        return self.lead != lead("")

    @property
    def closed(self) -> bool:
        """Whether the sidecar says that the log was closed; an older one calls that complete."""
        return bool(self.sidecar and self.sidecar.get("closed", self.sidecar.get("complete")))

    @property
    def missing(self) -> list[str]:
        """What keeps a closed log from being whole, as its sidecar says."""
        return [str(reason) for reason in (self.sidecar or {}).get("missing") or []]

    @property
    def simulated(self) -> bool:
        """Whether the sidecar says that a simulator was recorded."""
        return bool(self.sidecar and self.sidecar.get("simulated"))

    @property
    def spans(self) -> dict[int, Span] | None:
        """The segments as the sidecar of a closed log has them; None where it has none that can be used."""
        if not (self.sidecar and self.closed):
            return None
        try:
            return {
                int(one["segment"]): Span(round(one["t_s"][0] * 1000), round(one["t_s"][1] * 1000), int(one["rows"]))
                for one in self.sidecar["segments"]
            }
        except (LookupError, TypeError, ValueError):
            return None

    @property
    def fits(self) -> dict[int, tuple[float, float]] | None:
        """a and b of the clock fit by segment as the sidecar of a closed log has them, without those that have none; None as with `spans`."""
        if self.sidecar is None or self.spans is None:
            return None
        try:
            said = {int(one["segment"]): one["clock_fit"] for one in self.sidecar["segments"]}
            return {number: (float(fit["a_s"]), float(fit["b"])) for number, fit in said.items() if fit}
        except (LookupError, TypeError, ValueError):
            return None

    def remarks(self) -> tuple[str, ...]:
        """What a person is told of a log that is not whole. Complete only once it was read."""
        if self.sidecar is None:
            return (f"{self.path}.json is missing, so nothing shows that the log is complete",)
        if self.closed:
            whole = f"{self.path} is incomplete: {', '.join(self.missing)}. See its sidecar for details"
            return (whole,) if self.missing else ()
        cut = ". Its last row was unfinished and was skipped" if self.cut else ""
        return (f"{self.path} was never closed, because handctl was killed or is still running{cut}",)

    def without(self, segment: int | None) -> UsageError:
        """The error for a log that has no such rows."""
        return UsageError(
            f"{self.path} has no {'rows' if segment is None else f'segment {segment}'}",
            hint="" if segment is None else "choose a segment that its sidecar lists",
            code="segment",
        )

    def blocks(self) -> Iterator[Block]:
        """All rows, some hundred at a time, each checked. Raises UsageError with the number of the line."""
        count = 0
        for block in self._blocks():
            if not count and self._began_elsewhere(block):
                raise damaged(self.path, 2, "its sidecar is of a recording that began at another time")
            count += len(block.t_ms)
            yield block
        if self.sidecar and self.closed and self.sidecar.get("rows") != count:
            raise damaged(
                self.path, count + 1, f"the file ends after {count} rows, its sidecar counts {self.sidecar.get('rows')}"
            )

    def _began_elsewhere(self, block: Block) -> bool:
        """Whether the first row has another time than the sidecar says."""
        from datetime import datetime

        try:
            said = datetime.fromisoformat((self.sidecar or {})["start"]["utc"]).timestamp()
            return abs(said - float(block.columns["host_utc_s"][0])) > SAME_S
        except (LookupError, TypeError, ValueError, OverflowError, OSError):
            return False  # it says nothing of it

    def _blocks(self) -> Iterator[Block]:
        number, last = 2, (0, 0)
        with opened(self.path, "a log") as file:
            file.readline(LONGEST_LINE)
            lines = self._whole_lines(file)
            while some := list(islice(lines, ROWS)):
                rows = [self._fields(at, line) for at, line in enumerate(some, number)]
                block = Block(dict(zip(self.names, zip(*rows, strict=True), strict=True)))
                for at, texts in enumerate(zip(block.columns["segment"], block.columns["t_s"], strict=True), number):
                    segment, t_ms = int(texts[0]), parse_fixed(texts[1], 3)
                    if (segment, t_ms) < last or segment > last[0] + 1:
                        raise out_of_order(self.path, at)
                    last = (segment, t_ms)
                    block.segments.append(segment)
                    block.t_ms.append(t_ms)
                number += len(some)
                yield block

    def _whole_lines(self, file: BinaryIO) -> Iterator[bytes]:
        number = 1
        while line := file.readline(LONGEST_LINE):
            number += 1
            if not line.endswith(b"\n"):
                if len(line) == LONGEST_LINE:
                    raise too_long(self.path, number)
                if self.closed:
                    raise cut_short(self.path, number)
                self.cut = True
                return
            yield line

    def _fields(self, number: int, line: bytes) -> list[str]:
        """The fields of a line, each looked at."""
        fields = fields_of(self.path, number, line, len(self.names))
        cells = dict(zip(self.names, fields, strict=True))
        name = ""
        try:
            for name, decimals in self.lead:
                parse_fixed(cells[name], decimals)
            for name, *_ in self.channels:
                if cells[name] and not isfinite(float(cells[name])):
                    raise ValueError(f"{cells[name]!r} is not a number")
        except ValueError as exc:
            raise damaged(self.path, number, f"{name}: {exc}") from exc
        return fields


def fields_of(path: str, number: int, line: bytes, width: int) -> list[str]:
    """The fields of one line. Raises UsageError for another number of them."""
    try:
        text = line.decode("utf-8").rstrip("\r\n")
        fields = next(csv.reader([text], strict=True)) if '"' in text else text.split(",")
    except (UnicodeDecodeError, csv.Error, StopIteration) as exc:
        raise damaged(path, number, f"not comma-separated text: {exc}") from exc
    if len(fields) != width:
        raise damaged(path, number, f"{plural(len(fields), 'column')} instead of {width}")
    return fields


def parse_fixed(text: str, decimals: int) -> int:
    """A number with exactly `decimals` decimals, as an integer of its last decimal. Raises ValueError."""
    pattern = rf"-?[0-9]+\.[0-9]{{{decimals}}}" if decimals else "-?[0-9]+"
    if len(text) > 32 or not re.fullmatch(pattern, text, re.ASCII):
        raise ValueError(f"{text!r} is not a number with {decimals} decimals")
    return int(text.replace(".", ""))


def damaged(path: str, line: int, what: str) -> UsageError:
    """The error for a file that is not a whole log."""
    return UsageError(f"{path} line {line}: {what}", hint=f"not a log, or corrupted. {UNTOUCHED}", code="damaged-log")


def out_of_order(path: str, line: int) -> UsageError:
    """The error for a row that cannot come after the one before it."""
    return damaged(path, line, "segment or t_s does not follow from the row before")


def too_long(path: str, line: int) -> UsageError:
    """The error for a line that no recording has."""
    return damaged(path, line, f"longer than {LONGEST_LINE} bytes")


def cut_short(path: str, line: int) -> UsageError:
    """The error for a closed log whose last row has no end."""
    return damaged(path, line, "the row is cut short")


def _load_sidecar(path: str, wanted: str) -> dict[str, Any] | None:
    """The sidecar, None when there is none. Raises UsageError for one that is damaged or of another kind."""
    try:
        content = json.loads(read_text(path, "a sidecar", 16_000_000))
        json.dumps(content, ensure_ascii=False).encode()  # half a surrogate is no text
    except NoFile:
        return None
    except (ValueError, RecursionError) as exc:
        line = exc.lineno if isinstance(exc, json.JSONDecodeError) else 1
        raise damaged(path, line, f"not a sidecar: {exc}") from exc
    if not isinstance(content, dict) or content.get("schema") != wanted:
        found = content.get("schema") if isinstance(content, dict) else None
        raise damaged(path, 1, f"schema {found!r} instead of {wanted!r}")
    if not _shaped(content):
        raise damaged(path, 1, "not a sidecar: its columns, segments or marks are not lists of objects with numbers")
    return content


def _shaped(content: dict[str, Any]) -> bool:
    """Whether what is read of a sidecar has its kind."""

    def rows(one: Mapping[str, Any], key: str) -> Sequence[Any]:
        found = one.get(key) or []
        if not isinstance(found, list) or not all(isinstance(row, dict) for row in found):
            raise TypeError(key)
        return found

    try:
        if not isinstance(content.get("missing") or [], list):
            return False
        numbers = [content.get("rate_hz"), (content.get("asked") or {}).get("rate_hz")]
        rows(content, "columns")
        for mark in rows(content, "marks"):
            numbers += [mark.get("row"), *(heard.get("host_utc_s") for heard in rows(mark, "heard"))]
        for segment in rows(content, "segments"):
            numbers.append(segment.get("segment"))
            if fit := segment.get("clock_fit"):
                numbers += [fit["a_s"] + 0.0, fit["b"] + 0.0]
        return all(number is None or (isfinite(number + 0.0) and abs(number) < LATEST_S) for number in numbers)
    except (AttributeError, LookupError, TypeError, OverflowError):
        return False
