"""A log of an EksoNR read back: the values of its quantities, the name of its state and the words as they came have to agree."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from handctl.devices.ekso.parameter_map import DATA, Word, boot_ms, state_text
from handctl.devices.ekso.recording_source import LEAD, NAMED, RowLayout, parse
from handctl.files import opened
from handctl.record import log_reader
from handctl.record.csv_columns import MARK
from handctl.record.log_reader import (
    LONGEST_LINE,
    Block,
    Channel,
    Meanings,
    constant,
    cut_short,
    damaged,
    fields_of,
    forget,
    integers,
    parse_fixed,
    too_long,
)

CHUNK = 1 << 17
"""Bytes that are read at once."""
NAMES = [name for name, _ in LEAD]
STATE = next(quantity for quantity in DATA if quantity.name == NAMED)


def _word(text: str) -> int:
    """A word of 16 bit. Raises ValueError."""
    if not 0 <= (word := parse_fixed(text, 0)) <= 0xFFFF:
        raise ValueError(text)
    return word


def _value(quantity: Word) -> Callable[[str], float]:
    """What makes a text of a quantity its number, or raises ValueError."""
    scale = 10**quantity.decimals
    return lambda text: parse(quantity, text) / scale if scale > 1 else parse(quantity, text)


class LogFile(log_reader.LogFile):
    """A log of an EksoNR. Raises UsageError when it cannot be read, or is none."""

    def __init__(self, path: str) -> None:
        self._numbers: dict[tuple[int, bool], Meanings] = {}
        self._named = set[tuple[bytes, bytes]]()
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
        kinds: dict[tuple[int, bool], Callable[[str], float]] = {}
        for quantity in self.layout.shown:
            kinds.setdefault((quantity.decimals, quantity.signed), _value(quantity))
        self._readers = {
            column: kinds[quantity.decimals, quantity.signed]
            for quantity, column in zip(self.layout.shown, self.layout.columns, strict=True)
        } | dict.fromkeys(raw, _word)
        self.channels = (*own, *(Channel(name, name, "", 0) for name in raw))

    def _foreign(self, names: list[str]) -> RowLayout:
        for number, wanted in enumerate(RowLayout(raw=False).names):
            if number >= len(names) or names[number] != wanted:
                found = repr(names[number][:40]) if number < len(names) else "missing"
                raise damaged(self.path, 1, f"column {number + 1} is {found}, but in a log it is {wanted!r}")
        raise damaged(self.path, 1, "the header continues after the columns of a log")

    def numbers(self, quantity: Word) -> Meanings:
        """Integers of a quantity's last decimal by text: one table for all of the same decimals and sign."""
        kind = (quantity.decimals, quantity.signed)
        forget(self._numbers.values())
        return self._numbers.setdefault(kind, Meanings(lambda text: parse(quantity, text)))

    def reader(self, column: str) -> Callable[[str], float]:
        return self._readers[column]

    def _pieces(self) -> Iterator[bytes]:
        rest = b""
        with opened(self.path, "a log") as file:
            file.readline(LONGEST_LINE)
            while data := file.read(CHUNK):
                rest += data
                begin = 0
                while len(rest) - begin >= LONGEST_LINE:
                    end = rest.rfind(b"\n", begin, begin + LONGEST_LINE)
                    if end < 0:
                        raise too_long(self.path, self._line + rest.count(b"\n", 0, begin))
                    begin = end + 1
                whole, some, rest = rest.rpartition(b"\n")
                if some:
                    yield whole
        if rest and self.closed:
            raise cut_short(self.path, self._line)
        self.cut = bool(rest)

    def _right(self, block: Block) -> bool:
        if not super()._right(block):
            return False
        try:
            states, names = block.columns[f"{NAMED}_raw"], block.columns[f"{NAMED}_name"]
            some = 1 if constant(states) and constant(names) else len(states)
            new = set(zip(states[:some], names, strict=False)) - self._named
            if any(name.decode() != state_text(self.numbers(STATE)[state]) for state, name in new):
                return False
            self._named = (self._named if len(self._named) <= log_reader.MOST_KNOWN else set()) | new
            return not self.layout.raw or self._raw_fits(block)
        except ValueError:
            return False

    def _raw_fits(self, block: Block) -> bool:
        """Whether the words as they came are those of the columns. Raises ValueError."""
        names = self.layout.names
        words = [list(map(int, block.columns[name])) for name in names[names.index(MARK) + 1 :]]
        for quantity, column in zip(self.layout.shown, self.layout.columns, strict=True):
            numbers = self.numbers(quantity).of(block.columns[column])
            if list(map(quantity.raw_of, words[quantity.word])) != numbers:
                return False
        return list(map(boot_ms, zip(*words, strict=True))) == integers(b"\n".join(block.columns["boot_ms"]))

    def _fields(self, number: int, line: bytes) -> list[str]:
        names = self.layout.names
        fields = fields_of(self.path, number, line, len(names))
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
        return fields

    def _check_raw(self, texts: list[str], boot: int, numbers: dict[str, int]) -> None:
        words = [parse_fixed(text, 0) for text in texts]
        for quantity, word in zip(DATA, words, strict=True):
            if not 0 <= word <= 0xFFFF or numbers.get(quantity.name, quantity.raw_of(word)) != quantity.raw_of(word):
                raise ValueError(f"{word} does not fit {quantity.name}")
        if boot_ms(words) != boot:
            raise ValueError("they do not fit boot_ms")
