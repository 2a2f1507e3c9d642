"""The memory of a simulated Inspire device: a byte for every address, and which of them are registers.

Knows bytes and ranges, no frames and no motion. A register row is (word, address, bytes per element, elements, access,
lowest, highest); the values of a row whose lowest is negative are signed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

from handctl.number_parsing import whole

MEMORY = 4096  # bytes kept where nothing else is said; above, everything reads 0

Row = tuple[str, int, int, int, str, int, int]
Rows = tuple[Row, ...]
Element = tuple[str, int, int, int, bytes]
"""Of a write: word, number, value, address, bytes."""


class Space:
    """One address space: a byte for every address, and which of them can be written."""

    def __init__(self, rows: Rows, size: int = MEMORY, most: int = 32767) -> None:
        """`most` is the greatest value that a second device measures."""
        self.use(rows)
        self.memory = bytearray(size)
        self.most = most

    def use(self, rows: Rows) -> None:
        self.rows = rows
        self.row = {row[0]: row for row in reversed(rows)}

    def clear(self) -> None:
        self.memory = bytearray(len(self.memory))

    def place(self, word: str, number: int = 0) -> int:
        """Address of an element."""
        return self.row[word][1] + self.row[word][2] * number

    def put(self, word: str, values: Sequence[int]) -> None:
        """Fills a row, also beyond its ranges, or with more values than it has; nothing where there is no such row."""
        if (row := self.row.get(word)) is not None:
            layout = "B" if row[2] == 1 else "h" if min(values) < 0 else "H"
            struct.pack_into(f"<{len(values)}{layout}", self.memory, row[1], *values)

    def read(self, address: int, count: int) -> bytes:
        """Undocumented bytes read 0."""
        return bytes(self.memory[address : address + count]).ljust(count, b"\0")

    def documented(self, address: int, count: int) -> bool:
        """Whether all these bytes belong to registers."""
        last = address + count
        known = sum(
            len(range(max(first, address), min(first + size * number, last)))
            for _, first, size, number, _, _, _ in self.rows
        )
        return known == count

    def plan(self, address: int, data: bytes, unchecked: bool = False) -> tuple[list[Element], int]:
        """What a write would do: the elements it may set, and how many bytes they take up.

        Gaps, read-only bytes and values out of range, unless `unchecked`, are left out; half an element is completed
        from memory.
        """
        accepted, covered = [], 0
        for word, first, size, count, access, low, high in self.rows:
            if "w" not in access or first + size * count <= address or address + len(data) <= first:
                continue
            for number in range(count):
                place = first + size * number
                begin, end = max(place, address), min(place + size, address + len(data))
                if begin >= end:
                    continue
                old = bytes(self.memory[place : place + size])
                raw = old[: begin - place] + data[begin - address : end - address] + old[end - place :]
                layout = "B" if size == 1 else "<h" if low < 0 else "<H"
                value = struct.unpack(layout, raw)[0]
                if low <= value <= high or unchecked:
                    accepted.append((word, number, value, place, raw))
                    covered += end - begin
        return accepted, covered

    def store(self, place: int, raw: bytes) -> None:
        self.memory[place : place + len(raw)] = raw

    def twin(self, address: int, data: bytes) -> bytes:
        """What a second device would send for a read: every whole 16-bit reading differs by 3."""
        other = bytearray(data)
        for _, first, size, count, access, _, _ in self.rows:
            for place in range(first, first + size * count, size) if (size, access) == (2, "r") else ():
                if address <= place and place + 2 <= address + len(data):
                    differ(other, place - address, self.most)
        return bytes(other)

    def peek(self, words: Sequence[str], unit: int = 1) -> str:
        """The control command get ADDRESS COUNT."""
        place = whole(words[0], 0, len(self.memory) // unit - 1) * unit
        return self.memory[place : place + whole(words[1], 1, len(self.memory))].hex(" ").upper()

    def poke(self, place: int, data: bytes, shown: Iterable[tuple[str, Sequence[object], str]]) -> None:
        """Writes memory past all rules. `shown` are rows (word, things whose readings it shows, what takes another value)."""
        if place + len(data) > len(self.memory):
            raise ValueError(f"memory ends at {len(self.memory) - 1}")
        before = bytes(self.memory)
        self.store(place, data)
        for word, things, name in shown:
            _, first, size, *_ = self.row[word]
            for number, thing in enumerate(things):
                at, layout = first + size * number, "B" if size == 1 else "<h"
                new = struct.unpack_from(layout, self.memory, at)[0]
                if new != struct.unpack_from(layout, before, at)[0]:
                    taker = getattr(thing, name)
                    taker(new) if callable(taker) else setattr(thing, name, new)

    def runs(self) -> dict[str, str]:
        """What is not 0, for a state file: address -> hex bytes. A run may hold up to three zeros in a row."""
        import re  # with a state file only

        found = re.finditer(rb"[^\0](?:\0{0,3}[^\0])*", self.memory)
        return {str(run.start()): run[0].hex(" ").upper() for run in found}

    def memory_of(self, runs: dict[str, str]) -> bytearray:
        """The memory with these runs; ValueError when they do not fit."""
        memory = bytearray(len(self.memory))
        for address, digits in runs.items():
            data = bytes.fromhex(digits)
            place = whole(address, 0, len(memory) - len(data))
            memory[place : place + len(data)] = data
        return memory


def differ(data: bytearray, offset: int, most: int) -> None:
    """Another 16-bit value there."""
    value = struct.unpack_from("<h", data, offset)[0]
    struct.pack_into("<h", data, offset, value + 3 if value <= most - 3 else value - 3)


def poking(words: Sequence[str], last: int) -> tuple[int, bytes]:
    """Address and bytes of the control command set ADDRESS HEX; the bytes may be in groups."""
    place, digits = whole(words[0], 0, last), "".join(words[1:])
    try:
        return place, bytes.fromhex(digits)
    except ValueError:
        raise ValueError(f"{digits!r} is not a row of hex bytes") from None
