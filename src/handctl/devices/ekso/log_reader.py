"""Reading a log back: every field of every row is checked, so that what is exported is what was recorded.

Some hundred rows are checked at once, column by column: a text that was found right once is not looked at again. Only where
something in them is unusual are they checked row by row, which finds the line and the words for it.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from operator import le
from typing import NamedTuple

from handctl.devices.ekso.log import LEAD, NAMED, RowLayout, parse
from handctl.devices.ekso.map import DATA, Word, boot_ms, state_text
from handctl.files import opened
from handctl.record import log_reader
from handctl.record.log_reader import (
    CHUNK,
    LONGEST_LINE,
    Channel,
    cut_short,
    damaged,
    fields_of,
    out_of_order,
    parse_fixed,
    too_long,
)
from handctl.record.source import MARK

MOST_KNOWN = 1 << 15
"""Texts of a format that are remembered."""
NAMES = [name for name, _ in LEAD]


class LogRow(NamedTuple):
    """One row: its fields as they stand there, device time, segment."""

    fields: list[str]
    t_ms: int
    segment: int


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


class Block(log_reader.Block):
    """Some rows, with the texts that were found right."""

    def __init__(self, columns: dict[str, Sequence[str]], known: Known, text: str = "") -> None:
        super().__init__(columns, text)
        self._known = known

    def like(self, columns: dict[str, Sequence[str]]) -> Block:
        return Block(columns, self._known)

    def of(self, segment: int | None) -> Block:
        found = super().of(segment)
        assert isinstance(found, Block)
        return found

    def numbers(self, quantity: Word, column: str) -> list[int]:
        """A column of the device as integers of its last decimal."""
        return list(map(self._known.numbers(quantity).__getitem__, self.columns[column]))

    def table(self, quantity: Word) -> Mapping[str, int]:
        """The number of each text of a quantity here."""
        return self._known.numbers(quantity)


def _columns(text: str, rows: int, width: int) -> Sequence[Sequence[str]] | None:
    """The fields of so many lines by column; None where one has another number of them."""
    if '"' not in text:
        flat = text.replace("\n", ",\n,").split(",")  # so the ends of the lines are a column as well
        ends = flat[width :: width + 1]
        if len(flat) != rows * (width + 1) - 1 or ends.count("\n") != rows - 1:
            return None
        return [flat[at :: width + 1] for at in range(width)]
    try:
        found = list(csv.reader(text.split("\n"), strict=True))
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


class LogFile(log_reader.LogFile):
    """A log of an EksoNR. Raises UsageError when it cannot be read, or is none."""

    def __init__(self, path: str) -> None:
        self._known = Known()
        super().__init__(path, "ekso")

    def _header(self, names: list[str]) -> None:
        self.layout = next(
            (layout for raw in (False, True) if (layout := RowLayout(raw=raw)).names == tuple(names)), None
        ) or (self._foreign(names))
        self.names, self.lead, self.texts = self.layout.names, LEAD, (f"{NAMED}_name", MARK)
        own = [
            Channel(column, quantity.name, quantity.unit or "", quantity.decimals)
            for column, quantity in zip(self.layout.columns, self.layout.shown, strict=True)
        ]
        raw = self.names[self.names.index(MARK) + 1 :]
        self.channels = (*own, *(Channel(name, name, "", 0) for name in raw))

    def _foreign(self, names: list[str]) -> RowLayout:
        for number, wanted in enumerate(RowLayout(raw=False).names):
            if number >= len(names) or names[number] != wanted:
                found = repr(names[number][:40]) if number < len(names) else "missing"
                raise damaged(self.path, 1, f"column {number + 1} is {found}, but in a log it is {wanted!r}")
        raise damaged(self.path, 1, "the header continues after the columns of a log")

    def blocks(self) -> Iterator[Block]:
        for block in super().blocks():
            assert isinstance(block, Block)
            yield block

    def _blocks(self) -> Iterator[Block]:
        last = (0, 0)
        for number, lines in self._lines():
            block = self._block(lines, last) or self._slowly(number, lines, last)
            last = (block.segments[-1], block.t_ms[-1])
            yield block
            self._known.forget()

    def _lines(self) -> Iterator[tuple[int, list[bytes]]]:
        """The lines below the header without their ends, and the number of the first of them."""
        number, rest = 2, b""
        with opened(self.path, "a log") as file:
            file.readline(LONGEST_LINE)
            while data := file.read(CHUNK):
                *lines, rest = (rest + data).split(b"\n")
                long = next((at for at, line in enumerate([*lines, rest]) if len(line) >= LONGEST_LINE), None)
                if long is not None:
                    raise too_long(self.path, number + long)
                if lines:
                    yield number, lines
                number += len(lines)
        if rest and self.closed:
            raise cut_short(self.path, number)
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
                raise out_of_order(self.path, at)
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
        names = self.layout.names
        fields = fields_of(self.path, number, data, len(names))
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
