"""Reading a log back: every field of every row is checked, so that what is exported is what was recorded.

A file that is not a log, or not whole, is refused with the number of the line. The sidecar says whether the log was closed;
one that was not (power failure, kill) may end in the middle of a row, which is then left out.

Some hundred rows are checked at once, column by column: a text that was found right once is not looked at again. Only where
something in them is unusual are they checked row by row, which finds the line and the words for it.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import compress
from operator import le
from typing import Any, NamedTuple

from handctl.devices.ekso.log import LEAD, NAMED, RowLayout, parse, parse_fixed
from handctl.devices.ekso.map import DATA, Word, boot_ms, state_text
from handctl.errors import UsageError
from handctl.files import NoFile, opened, read_text
from handctl.record.recording import schema
from handctl.record.source import MARK
from handctl.wording import plural

CHUNK = 1 << 17
"""Bytes that are read at once."""
MOST_KNOWN = 1 << 15
"""Texts of a format that are remembered."""

LONGEST_LINE = 65536
UNTOUCHED = "the file was not changed"
SCHEMA = schema("ekso")
NAMES = [name for name, _ in LEAD]


class LogRow(NamedTuple):
    """One row: its fields as they stand there, device time, segment."""

    fields: list[str]
    t_ms: int
    segment: int


class Span(NamedTuple):
    """What a segment covers: device times of its first and last row, and their number."""

    begin: int
    end: int
    rows: int


class Known:
    """The texts that were found right, with their numbers; one table for all quantities of the same decimals and sign."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[int, bool], dict[str, int]] = {}
        self._named: set[tuple[str, str]] = set()
        self._words: set[str] = set()

    def numbers(self, quantity: Word) -> dict[str, int]:
        """Text -> number."""
        return self._numbers.setdefault((quantity.decimals, quantity.signed), {})

    def learn(self, quantity: Word, texts: Sequence[str]) -> bool:
        """Whether all of them are values of the quantity; they are known from then on."""
        known = self.numbers(quantity)
        if all(map(known.__contains__, texts)):
            return True
        try:
            for text in set(texts).difference(known):
                known[text] = parse(quantity, text)
        except ValueError:
            return False
        return True

    def named(self, block: Block) -> bool:
        """Whether the quantity that is also told in words is told rightly."""
        state, name = next(q for q in DATA if q.name == NAMED), f"{NAMED}_raw"
        new = set(zip(block.columns[name], block.columns[f"{NAMED}_name"], strict=True)) - self._named
        right = all(text == state_text(self.numbers(state)[number]) for number, text in new)
        self._named |= new if right and len(self._named) < MOST_KNOWN else set()
        return right

    def words(self, texts: Sequence[str]) -> bool:
        """Whether all of them are words of 16 bit."""
        new = set(texts) - self._words
        right = all(re.fullmatch("[0-9]{1,32}", text, re.ASCII) and int(text) <= 0xFFFF for text in new)
        self._words |= new if right else set()
        return right

    def forget(self) -> None:
        """Keep the tables small."""
        for known in self._numbers.values():
            if len(known) > MOST_KNOWN:
                known.clear()


class Block:
    """Some rows that follow each other: their texts by column, device times, segments; `text` = all of it where nothing is quoted."""

    def __init__(self, columns: dict[str, Sequence[str]], known: Known, text: str = "") -> None:
        self.columns = columns
        self.text = text
        self.t_ms: list[int] = []
        self.segments: list[int] = []
        self._known = known

    def numbers(self, quantity: Word, column: str) -> list[int]:
        """A column of the device as integers of its last decimal."""
        return list(map(self._known.numbers(quantity).__getitem__, self.columns[column]))

    def table(self, quantity: Word) -> Mapping[str, int]:
        """The number of each text of a quantity here."""
        return self._known.numbers(quantity)

    def of(self, segment: int | None) -> Block:
        """Only the rows of a segment."""
        if segment is None or set(self.segments) == {segment}:
            return self
        keep = [number == segment for number in self.segments]
        found = Block({name: tuple(compress(texts, keep)) for name, texts in self.columns.items()}, self._known)
        found.t_ms, found.segments = list(compress(self.t_ms, keep)), [segment] * sum(keep)
        return found


def _columns(text: str, rows: int, width: int) -> Sequence[Sequence[str]] | None:
    """The fields of so many lines by column; None where one has another number of them."""
    lines = text.split("\n")
    if '"' not in text:
        if any(line.count(",") != width - 1 for line in lines):
            return None
        flat = text.replace("\n", ",").split(",")
        return [flat[at::width] for at in range(width)]
    try:
        found = list(csv.reader(lines, strict=True))
    except csv.Error:
        return None
    return list(zip(*found, strict=True)) if len(found) == rows and set(map(len, found)) == {width} else None


DIGITS = str.maketrans("123456789", "0" * 9)


def _shaped(texts: Sequence[str], decimals: int) -> bool:
    """Whether `parse_fixed` takes all of them: texts that differ only in their digits are looked at once."""
    shapes = set("\n".join(texts).translate(DIGITS).split("\n"))
    try:
        for shape in shapes:
            parse_fixed(shape, decimals)
    except ValueError:
        return False
    return True


def _integers(texts: Sequence[str]) -> list[int]:
    """Numbers with a fixed number of decimals as integers of the last one."""
    return list(map(int, "\n".join(texts).replace(".", "").split("\n")))


def damaged(path: str, line: int, what: str) -> UsageError:
    """The error for a file that is not a whole log."""
    return UsageError(f"{path} line {line}: {what}", hint=f"not a log, or corrupted. {UNTOUCHED}", code="damaged-log")


class LogFile:
    """A log on the disk. Raises UsageError when it cannot be read, or is none."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.sidecar = _load_sidecar(f"{path}.json")
        self.cut = False
        """True when an unfinished last row was left out."""
        self._known = Known()
        with opened(path, "a log", hint=f"`handctl ekso log {path}` makes one") as file:
            header = file.readline(LONGEST_LINE).decode("utf-8", "replace")
        names = header.rstrip("\r\n").split(",")
        self.layout = next(
            (layout for raw in (False, True) if (layout := RowLayout(raw=raw)).names == tuple(names)), None
        ) or (self._foreign(names))

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

    def _foreign(self, names: list[str]) -> RowLayout:
        for number, wanted in enumerate(RowLayout(raw=False).names):
            if number >= len(names) or names[number] != wanted:
                found = repr(names[number][:40]) if number < len(names) else "missing"
                raise damaged(self.path, 1, f"column {number + 1} is {found}, but in a log it is {wanted!r}")
        raise damaged(self.path, 1, "the header continues after the columns of a log")

    def blocks(self) -> Iterator[Block]:
        """All rows, some hundred at a time, each checked. Raises UsageError with the number of the line."""
        count, last = 0, (0, 0)
        try:
            for number, lines in self._lines():
                block = self._block(lines, last) or self._slowly(number, lines, last)
                last = (block.segments[-1], block.t_ms[-1])
                count += len(lines)
                yield block
                self._known.forget()
        except OSError as exc:
            raise UsageError(
                f"{self.path}: cannot be read: {exc.strerror or exc}", hint="check the file and its permissions"
            ) from exc
        if self.sidecar and self.closed and self.sidecar.get("rows") != count:
            raise damaged(
                self.path, count + 1, f"the file ends after {count} rows, its sidecar counts {self.sidecar.get('rows')}"
            )

    def _lines(self) -> Iterator[tuple[int, list[bytes]]]:
        """The lines below the header without their ends, and the number of the first of them."""
        number, rest = 2, b""
        with opened(self.path, "a log") as file:
            file.readline(LONGEST_LINE)
            while data := file.read(CHUNK):
                *lines, rest = (rest + data).split(b"\n")
                long = next((at for at, line in enumerate([*lines, rest]) if len(line) >= LONGEST_LINE), None)
                if long is not None:
                    raise damaged(self.path, number + long, f"longer than {LONGEST_LINE} bytes")
                if lines:
                    yield number, lines
                number += len(lines)
        if rest and self.closed:
            raise damaged(self.path, number, "the row is cut short")
        self.cut = bool(rest)

    def _block(self, lines: list[bytes], last: tuple[int, int]) -> Block | None:
        """These rows, checked column by column; None where something in them is unusual."""
        names = self.layout.names
        try:
            text = b"\n".join(lines).decode("utf-8").replace("\r\n", "\n").removesuffix("\r")
        except UnicodeDecodeError:
            return None
        found = None if "\r" in text else _columns(text, len(lines), len(names))
        if found is None:
            return None
        block = Block(dict(zip(names, found, strict=True)), self._known, "" if '"' in text else text)
        if not all(_shaped(block.columns[name], decimals) for name, decimals in LEAD):
            return None
        if not all(
            self._known.learn(q, block.columns[c]) for q, c in zip(self.layout.shown, self.layout.columns, strict=True)
        ):
            return None
        if not self._known.named(block) or (self.layout.raw and not self._raw_fits(block)):
            return None
        block.t_ms, block.segments = (_integers(block.columns[name]) for name in ("t_s", "segment"))
        same = block.segments[0] == block.segments[-1] and len(set(block.segments)) == 1
        follows = last <= (block.segments[0], block.t_ms[0]) and block.segments[0] <= last[0] + 1
        return block if same and follows and all(map(le, block.t_ms, block.t_ms[1:])) else None

    def _raw_fits(self, block: Block) -> bool:
        """Whether the words as they came are those of the columns."""
        names = self.layout.names
        texts = [block.columns[name] for name in names[names.index(MARK) + 1 :]]
        if not all(map(self._known.words, texts)):
            return False
        words = [list(map(int, column)) for column in texts]
        for quantity, column in zip(self.layout.shown, self.layout.columns, strict=True):
            if list(map(quantity.raw_of, words[quantity.word])) != block.numbers(quantity, column):
                return False
        return list(map(boot_ms, zip(*words, strict=True))) == _integers(block.columns["boot_ms"])

    def _slowly(self, number: int, lines: list[bytes], last: tuple[int, int]) -> Block:
        """These rows, checked one by one."""
        rows = []
        for at, data in enumerate(lines, number):
            row = self._row(at, data)
            if (row.segment, row.t_ms) < last or row.segment > last[0] + 1:
                raise damaged(self.path, at, "segment or t_s does not follow from the row before")
            last = (row.segment, row.t_ms)
            rows.append(row)
        columns: dict[str, Sequence[str]] = dict(
            zip(self.layout.names, zip(*(row.fields for row in rows), strict=True), strict=True)
        )
        for quantity, column in zip(self.layout.shown, self.layout.columns, strict=True):
            self._known.learn(quantity, columns[column])
        block = Block(columns, self._known)
        block.t_ms, block.segments = [row.t_ms for row in rows], [row.segment for row in rows]
        return block

    def _row(self, number: int, data: bytes) -> LogRow:
        try:
            text = data.decode("utf-8").rstrip("\r\n")
            fields = next(csv.reader([text], strict=True)) if '"' in text else text.split(",")
        except (UnicodeDecodeError, csv.Error, StopIteration) as exc:
            raise damaged(self.path, number, f"not comma-separated text: {exc}") from exc
        names = self.layout.names
        if len(fields) != len(names):
            raise damaged(self.path, number, f"{plural(len(fields), 'column')} instead of {len(names)}")
        cells = dict(zip(names, fields, strict=True))
        name = ""
        try:
            lead = []
            for name, decimals in LEAD:
                lead.append(parse_fixed(cells[name], decimals))
            numbers = {}
            for quantity, name in zip(self.layout.shown, self.layout.columns, strict=True):
                numbers[quantity.name] = parse(quantity, cells[name])
            name = f"{NAMED}_name"
            if cells[name] != state_text(numbers[NAMED]):
                raise ValueError(f"{cells[name]!r} does not fit {NAMED}")
            if self.layout.raw:
                name = "raw columns"
                self._check_raw(fields[names.index(MARK) + 1 :], lead[NAMES.index("boot_ms")], numbers)
        except ValueError as exc:
            raise damaged(self.path, number, f"{name}: {exc}") from exc
        return LogRow(fields, lead[NAMES.index("t_s")], lead[NAMES.index("segment")])

    def _check_raw(self, texts: list[str], boot: int, numbers: dict[str, int]) -> None:
        words = [parse_fixed(text, 0) for text in texts]
        for quantity, word in zip(DATA, words, strict=True):
            if not 0 <= word <= 0xFFFF or numbers.get(quantity.name, quantity.raw_of(word)) != quantity.raw_of(word):
                raise ValueError(f"{word} does not fit {quantity.name}")
        if boot_ms(words) != boot:
            raise ValueError("they do not fit boot_ms")


def _load_sidecar(path: str) -> dict[str, Any] | None:
    """The sidecar, None when there is none. Raises UsageError for one that is damaged or of another kind."""
    try:
        content = json.loads(read_text(path, "a sidecar", 16_000_000))
    except NoFile:
        return None
    except (ValueError, RecursionError) as exc:
        line = exc.lineno if isinstance(exc, json.JSONDecodeError) else 1
        raise damaged(path, line, f"not a sidecar: {exc}") from exc
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        found = content.get("schema") if isinstance(content, dict) else None
        raise damaged(path, 1, f"schema {found!r} instead of {SCHEMA!r}")
    return content
