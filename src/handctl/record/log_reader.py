"""A recording read back from its CSV file and its sidecar, block by block. Knows no family: one whose columns are more strictly defined has a subclass.

A file that is not a log, or not whole, is refused with the number of the line. The sidecar says whether the log was closed;
one that was not (power failure, kill) may end in the middle of a row, which is then left out.

Every field is checked, many rows at once: column by column, and a text that was found right is remembered. Only rows with something
unusual are checked one by one, which finds the line and the words for it.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import compress, islice, zip_longest
from math import isfinite, nan
from typing import Any, BinaryIO, NamedTuple

from handctl.errors import Hint, UsageError
from handctl.files import NoFile, as_text, opened, read_text
from handctl.record.csv_and_sidecar import schema
from handctl.record.csv_columns import MARK, lead
from handctl.wording import plural

ROWS = 1000
"""Rows of a block, where they are not cut by bytes."""
MOST_KNOWN = 1 << 15
"""Texts that are remembered."""
LONGEST_LINE = 65536
UNTOUCHED = "The file was not changed"
ERROR = "error"
SAME_S = 0.002
"""Seconds within which the first row and the sidecar have the same time: one of them is rounded to milliseconds."""
LATEST_S = 253_402_300_800.0
"""The end of the year 9999, seconds since 1970: no clock of a host is later."""


class Incomplete(UsageError):
    """The file has other rows than a closed recording's sidecar counts, or not all of the last one."""


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


def constant(column: Sequence[Any]) -> bool:
    """Whether all of a column is the same."""
    return bool(column[0] == column[-1] and column.count(column[0]) == len(column))


class Known(dict[Any, Any]):
    """What becomes of a value, by one way to make it: what is not known yet is made and remembered, for a device repeats itself."""

    def __init__(self, make: Callable[[Any], Any]) -> None:
        super().__init__()
        self._make = make

    def __missing__(self, value: Any) -> Any:
        made = self[value] = self._make(value)
        return made

    def of(self, column: Sequence[Any]) -> list[Any]:
        """That of a column."""
        return [self[column[0]]] * len(column) if constant(column) else list(map(self.__getitem__, column))


class Meanings(Known):
    """What a text says, by one way to read it. Raises ValueError as `read`."""

    def __init__(self, read: Callable[[str], Any]) -> None:
        super().__init__(lambda text: read(text.decode()))


class Checked(set[bytes]):
    """The texts that `say` leaves as they are, which is most of them: only others are replaced, so none is asked for. Raises ValueError as `say`."""

    def __init__(self, say: Callable[[str], bytes]) -> None:
        super().__init__()
        self._say = say

    def of(self, texts: Sequence[bytes]) -> Sequence[bytes]:
        """What is said for a column."""
        if self.issuperset(texts[:1] if constant(texts) else texts):
            return texts
        others: dict[bytes, bytes] = {}
        for text in set(texts).difference(self):
            if (said := self._say(text.decode())) == text:
                self.add(text)
            else:
                others[text] = said
        return list(map(others.get, texts, texts)) if others else texts


def forget(tables: Iterable[Known | Checked]) -> None:
    """Keep them small."""
    for table in tables:
        if len(table) > MOST_KNOWN:
            table.clear()


def a_number(_: str, number: float) -> float:
    """What a text says in most cases: its number."""
    return number


def as_written(text: str, _: float) -> bytes:
    """What it says where it is only checked: itself."""
    return text.encode()


def number_of(text: str) -> float:
    """A number, NaN where nothing was read. Raises ValueError."""
    if not isfinite(number := float(text or "0")):
        raise ValueError(f"{text!r} is not a number")
    return number if text else nan


class Block:
    """Some rows that follow each other: their texts by column, device times, segments. It is there until the next one is asked for.

    `known` is what the device's columns say, as `LogFile.blocks` was asked.
    """

    def __init__(self, columns: dict[str, Sequence[bytes]], lines: bytes = b"") -> None:
        self.columns = columns
        self._lines = lines
        self.t_ms: list[int] = []
        self.segments: list[int] = []
        self.known: dict[str, Sequence[Any]] = {}
        self.joined: dict[str, bytes] = {}
        """Columns of the recorder, a line each, where that was made to check them."""
        self._integers: dict[str, Sequence[int]] = {}

    @property
    def text(self) -> bytes:
        """All of it as the recorder wrote it, but for the last line's end; empty where something is quoted or unusual."""
        if not self._lines or b'"' in self._lines:
            return b""
        return self._lines if self._lines.endswith(b"\r") else self._lines.replace(b"\n", b"\r\n") + b"\r"

    def of(self, segment: int | None) -> Block:
        """Only the rows of a segment."""
        if segment is None or set(self.segments) == {segment}:
            return self
        keep = [number == segment for number in self.segments]
        found = Block({name: tuple(compress(texts, keep)) for name, texts in self.columns.items()})
        found.known = {name: list(compress(said, keep)) for name, said in self.known.items()}
        found.t_ms, found.segments = list(compress(self.t_ms, keep)), [segment] * sum(keep)
        return found

    def floats(self, name: str) -> Sequence[float]:
        """A column as numbers, NaN where nothing was read."""
        if name not in self.known:
            texts = self.columns[name]
            self.known[name] = [float(texts[0])] * len(texts) if constant(texts) else list(map(float, texts))
        return self.known[name]

    def integers(self, name: str) -> Sequence[int]:
        """A column as integers."""
        if name not in self._integers:
            texts = self.columns[name]
            self._integers[name] = [int(texts[0])] * len(texts) if constant(texts) else list(map(int, texts))
        return self._integers[name]

    def lines(self, name: str) -> bytes:
        """A column as it was written, a line each."""
        return self.joined.get(name) or b"\n".join(self.columns[name])


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
        self._say: Callable[[str, float], Any] = a_number
        self._tables: dict[object, Meanings | Checked] = {}
        self._line = 2
        with opened(path, "a log", hint=Hint("{} makes one", f"{kind} log {path}")) as file:
            header = file.readline(LONGEST_LINE).decode("utf-8-sig", "replace")
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
        about: dict[str, Any] = {str(one.get("column")): one for one in (self.sidecar or {}).get("columns") or []}
        for number, pair in enumerate(zip_longest(names[len(known) : -2], about) if about else (), len(known) + 1):
            if pair[0] != pair[1]:
                told = [repr(name) if name else "missing" for name in pair]
                raise damaged(self.path, 1, f"column {number} is {told[0]}, but in its sidecar {told[1]}")
        self.channels = tuple(
            Channel(name, str(one.get("name") or name), str(one.get("unit") or ""))
            for name in names[len(known) : -2]
            for one in [about.get(name, {})]
        )

    @property
    def clocked(self) -> bool:
        """Whether the device has a clock."""
        return bool(self.clock)

    @property
    def clock(self) -> str:
        """The column of the device's clock, "" where it has none."""
        return next((name for name, _ in self.lead if name not in dict(lead(""))), "")

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
    def fits(self) -> dict[int, dict[str, float]] | None:
        """The clock fit by segment as the sidecar of a closed log has it, without those that have none; None as with `spans`."""
        if self.sidecar is None or self.spans is None:
            return None
        try:
            said = {int(one["segment"]): one["clock_fit"] for one in self.sidecar["segments"]}
            return {
                number: fit | {"a_s": float(fit["a_s"]), "b": float(fit["b"])} for number, fit in said.items() if fit
            }
        except (LookupError, TypeError, ValueError):
            return None

    def remarks(self) -> tuple[str, ...]:
        """What a person is told of a log that is not whole. Complete only once it was read."""
        cut = ". Its last row was unfinished and was skipped" if self.cut else ""
        if self.sidecar is None:
            return (f"{self.path}.json is missing, so nothing shows that the log is complete{cut}",)
        if self.closed:
            whole = f"{self.path} is incomplete: {', '.join(self.missing)}. See its sidecar for details"
            return (whole,) if self.missing else ()
        full = "its sidecar could not be written at the end: the disk was probably full"
        why = full if self.sidecar.get("ended") else "handctl was killed or is still running"
        return (f"{self.path} was never closed, because {why}{cut}",)

    def without(self, segment: int | None) -> UsageError:
        """The error for a log that has no such rows."""
        return UsageError(
            f"{self.path} has no {'rows' if segment is None else f'segment {segment}'}",
            hint="" if segment is None else "choose a segment that its sidecar lists",
            code="segment",
        )

    def blocks(self, say: Callable[[str, float], Any] = a_number) -> Iterator[Block]:
        """All rows, some hundred at a time, each checked. Raises UsageError with the number of the line.

        `say` is what a text of a channel becomes in `Block.known`: `a_number`, or bytes that mostly are the text itself.
        """
        self._say, self._tables, self._line = say, {}, 2
        count = 0
        for block in self._blocks():
            if not count and self._began_elsewhere(block):
                raise damaged(self.path, 2, "its sidecar is of a recording that began at another time")
            count += len(block.t_ms)
            yield block
        if self.sidecar and self.closed and self.sidecar.get("rows") != count:
            counts = f"the file ends after {count} rows, its sidecar counts {self.sidecar.get('rows')}"
            raise damaged(self.path, count + 1, counts, Incomplete)

    def _began_elsewhere(self, block: Block) -> bool:
        """Whether the first row has another time than the sidecar says."""
        from datetime import datetime

        try:
            said = datetime.fromisoformat((self.sidecar or {})["start"]["utc"]).timestamp()
            return abs(said - float(block.columns["host_utc_s"][0])) > SAME_S
        except (LookupError, TypeError, ValueError, OverflowError, OSError):
            return False  # it says nothing of it

    def _blocks(self) -> Iterator[Block]:
        last = (0, 0)
        for data in self._pieces():
            block = self._block(data, last) or self._slowly(data, last)
            last = (block.segments[-1], block.t_ms[-1])
            self._line += len(block.t_ms)
            yield block
            block.columns.clear()  # so the next one finds memory that the processor still has at hand
            block.known.clear()
            forget(self._tables.values())

    def _pieces(self) -> Iterator[bytes]:
        """The lines below the header, many at once, all of them but for the last one's end; `_line` is that which comes next."""
        with opened(self.path, "a log") as file:
            file.readline(LONGEST_LINE)
            lines = self._whole_lines(file)
            while some := list(islice(lines, ROWS)):
                yield b"".join(some)[:-1]

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

    def _block(self, data: bytes, last: tuple[int, int]) -> Block | None:
        """These rows, checked column by column; None where something in them is unusual."""
        if not data.isascii():
            try:
                data.decode("utf-8")
            except UnicodeDecodeError:
                return None
        found = _columns(data, len(self.names))
        if found is None:
            return None
        block = Block(dict(zip(self.names, found, strict=True)), data)
        for name, decimals in self.lead:
            if (lines := joined(block.columns[name], decimals)) is None:
                return None
            block.joined[name] = lines
        segments = block.columns["segment"]
        if not constant(segments) or not self._right(block):
            return None
        block.t_ms = integers(block.joined["t_s"])
        block.segments = [int(segments[0])] * len(segments)
        follows = last <= (block.segments[0], block.t_ms[0]) and block.segments[0] <= last[0] + 1
        return block if follows and block.t_ms == sorted(block.t_ms) else None

    def _right(self, block: Block) -> bool:
        """Whether the device's columns are right; from then on it is known what they say."""
        try:
            for channel in self.channels:
                block.known[channel.column] = self._table(channel).of(block.columns[channel.column])
        except ValueError:
            return False
        return True

    def _table(self, channel: Channel) -> Meanings | Checked:
        """What the texts of a channel say: channels that are read in one way share it."""
        read, say = self.reader(channel.column), self._say
        if read not in self._tables:
            self._tables[read] = Meanings(read) if say is a_number else Checked(lambda text: say(text, read(text)))
        return self._tables[read]

    def reader(self, column: str) -> Callable[[str], float]:
        """What makes a text of a channel its number, or raises ValueError."""
        return number_of

    def _slowly(self, data: bytes, last: tuple[int, int]) -> Block:
        """These rows, checked one by one."""
        rows, places = [], []
        at_segment, at_time = map(self.names.index, ("segment", "t_s"))
        for at, line in enumerate(data.split(b"\n"), self._line):
            fields = self._fields(at, line)
            rows.append([field.encode() for field in fields])
            place = int(fields[at_segment]), parse_fixed(fields[at_time], 3)
            if place < last or place[0] > last[0] + 1:
                raise out_of_order(self.path, at)
            places.append(last := place)
        block = Block(dict(zip(self.names, zip(*rows, strict=True), strict=True)))
        block.segments, block.t_ms = map(list, zip(*places, strict=True))
        self._right(block)
        return block

    def _fields(self, number: int, line: bytes) -> list[str]:
        """The fields of a line, each looked at."""
        fields = fields_of(self.path, number, line, len(self.names))
        cells = dict(zip(self.names, fields, strict=True))
        name = ""
        try:
            for name, decimals in self.lead:
                parse_fixed(cells[name], decimals)
            for name, *_ in self.channels:
                number_of(cells[name])
        except ValueError as exc:
            raise damaged(self.path, number, f"{name}: {exc}") from exc
        return fields


def _columns(data: bytes, width: int) -> Sequence[Sequence[bytes]] | None:
    """The fields of some lines by column; None where one has another number of them, or not the end that all have."""
    parted = data.replace(b"\n", b"\n,")  # so each line's end is that of its last field
    rows = len(parted) - len(data) + 1
    end, returns = (b"\r\n", rows) if data.endswith(b"\r") else (b"\n", 0)
    if len(data) - len(data.replace(b"\r", b"")) != returns:  # quicker than to count them
        return None
    if b'"' in data:
        try:
            lines = list(csv.reader(data.decode().removesuffix("\r").split(end.decode()), strict=True))
        except csv.Error:
            return None
        if len(lines) != rows or set(map(len, lines)) != {width}:
            return None
        return [[field.encode() for field in column] for column in zip(*lines, strict=True)]
    flat = parted.split(b",")
    ends = flat[width - 1 :: width]
    if ends.count(end) == rows - 1 and end.startswith(ends[-1] + b"\n"):  # no row has a mark, as mostly
        last = [b""] * rows
    else:
        last = b"".join(ends).removesuffix(b"\r").split(end)
    if len(flat) != rows * width or len(last) != rows:
        return None
    return [*(flat[at::width] for at in range(width - 1)), last]


DIGITS = bytes.maketrans(b"123456789", b"0" * 9)


def joined(texts: Sequence[bytes], decimals: int) -> bytes | None:
    """All of a column, a line each, if `parse_fixed` takes them: texts that differ only in their digits are looked at once."""
    text = b"\n".join(texts)
    shape = text.translate(DIGITS) + b"\n"
    one, _, _ = shape.partition(b"\n")
    shapes = {one} if shape == (one + b"\n") * len(texts) else set(shape[:-1].split(b"\n"))
    try:
        for one in shapes:
            parse_fixed(one.decode(), decimals)
    except ValueError:
        return None
    return text


def integers(text: bytes) -> list[int]:
    """Numbers with a fixed number of decimals, a line each, as integers of the last one."""
    return list(map(int, text.replace(b".", b"").split(b"\n")))


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
    """A number with exactly `decimals` decimals and no more digits than 64 bit hold, as an integer of its last decimal. Raises ValueError."""
    if len(text) > 18 + bool(decimals) or not _fixed(decimals)(text):
        raise ValueError(f"{text!r} is not a number with {decimals} decimals")
    return int(text.replace(".", ""))


@cache
def _fixed(decimals: int) -> Callable[[str], object]:
    return re.compile(rf"-?[0-9]+\.[0-9]{{{decimals}}}" if decimals else "-?[0-9]+", re.ASCII).fullmatch


def damaged(path: str, line: int, what: str, kind: type[UsageError] = UsageError) -> UsageError:
    """The error for a file that is not a whole log."""
    return kind(
        f"{path} line {line}: {what}",
        hint=f"choose another file: this one is not a log, or is corrupted. {UNTOUCHED}",
        code="damaged-log",
    )


def out_of_order(path: str, line: int) -> UsageError:
    """The error for a row that cannot come after the one before it."""
    return damaged(path, line, "segment or t_s does not follow from the row before")


def too_long(path: str, line: int) -> UsageError:
    """The error for a line that no recording has."""
    return damaged(path, line, f"longer than {LONGEST_LINE} bytes")


def cut_short(path: str, line: int) -> UsageError:
    """The error for a closed log whose last row has no end."""
    return damaged(path, line, "the row is cut short", Incomplete)


def _load_sidecar(path: str, wanted: str) -> dict[str, Any] | None:
    """The sidecar, None when there is none. Raises UsageError for one that is damaged or of another kind."""
    try:
        text = read_text(path, "a sidecar", 16_000_000)
        content = json.loads(text)
        if "\\u" in text:
            for key in {"marks", "file", "link"} & content.keys() if isinstance(content, dict) else ():
                content[key] = json.loads(as_text(json.dumps(content[key], ensure_ascii=False)))  # older ones
        json.dumps(content, ensure_ascii=False, allow_nan=False).encode()  # half a surrogate is no text, NaN no number
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
        rates = [content.get("rate_hz"), (content.get("asked") or {}).get("rate_hz")]
        numbers = [*rates, *((content.get(end) or {}).get("boot_ms") for end in ("start", "end"))]
        rows(content, "columns")
        for mark in rows(content, "marks"):
            numbers += [mark.get("row"), *(heard.get("host_utc_s") for heard in rows(mark, "heard"))]
        for segment in rows(content, "segments"):
            numbers.append(segment.get("segment"))
            if fit := segment.get("clock_fit"):
                numbers += [fit["a_s"] + 0.0, fit["b"] + 0.0]
        fine = all(number is None or (isfinite(number + 0.0) and abs(number) < LATEST_S) for number in numbers)
        return fine and all(rate is None or rate >= 0 for rate in rates)
    except (AttributeError, LookupError, TypeError, OverflowError):
        return False
