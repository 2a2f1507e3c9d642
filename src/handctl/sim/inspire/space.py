"""The memory of a simulated Inspire device: a byte for every address, and which of them are registers.

Knows bytes and ranges, no frames and no motion. A register row is (address, bytes per element, elements, access, lowest,
highest); the values of a row whose lowest is negative are signed.
"""

from __future__ import annotations

import struct

from handctl.digits import whole

MEMORY = 4096  # bytes kept where nothing else is said; above, everything reads 0

Row = tuple[int, int, int, str, int, int]
Rows = tuple[Row, ...]


class Space:
    """One address space: a byte for every address, and which of them can be written."""

    def __init__(self, rows: Rows, size: int = MEMORY) -> None:
        self.rows = rows
        self.memory = bytearray(size)

    def read(self, address: int, count: int) -> bytes:
        """Undocumented bytes read 0."""
        return bytes(self.memory[address : address + count]).ljust(count, b"\0")

    def documented(self, address: int, count: int) -> bool:
        """Whether all these bytes belong to registers."""
        last = address + count
        known = sum(
            len(range(max(first, address), min(first + size * number, last)))
            for first, size, number, _, _, _ in self.rows
        )
        return known == count

    def plan(self, address: int, data: bytes, unchecked: bool = False) -> tuple[list[tuple[int, int, bytes]], int]:
        """What a write would do: (address, value, bytes) of each element it may set, and how many bytes that takes up.

        Gaps, read-only bytes and values out of range, unless `unchecked`, are left out; half an element is completed
        from memory.
        """
        accepted, covered = [], 0
        for first, size, count, access, low, high in self.rows:
            if "w" not in access or first + size * count <= address or address + len(data) <= first:
                continue
            for place in range(first, first + size * count, size):
                begin, end = max(place, address), min(place + size, address + len(data))
                if begin >= end:
                    continue
                old = bytes(self.memory[place : place + size])
                raw = old[: begin - place] + data[begin - address : end - address] + old[end - place :]
                layout = "B" if size == 1 else "<h" if low < 0 else "<H"
                value = struct.unpack(layout, raw)[0]
                if low <= value <= high or unchecked:
                    accepted.append((place, value, raw))
                    covered += end - begin
        return accepted, covered

    def twin(self, address: int, data: bytes) -> bytes:
        """What a second device would send for a read: every whole 16-bit reading differs by 3."""
        other = bytearray(data)
        for first, size, count, access, _, _ in self.rows:
            for place in range(first, first + size * count, size) if (size, access) == (2, "r") else ():
                if address <= place and place + 2 <= address + len(data):
                    value = struct.unpack_from("<h", other, place - address)[0]
                    struct.pack_into("<h", other, place - address, value + 3 if value <= 32764 else value - 3)
        return bytes(other)

    def runs(self) -> dict[str, str]:
        """What is not 0, for a state file: address -> hex bytes. A run may hold up to three zeros in a row."""
        runs, place, memory = {}, 0, self.memory
        while place < len(memory):
            end = place
            while end < len(memory) and memory[place] and any(memory[end : end + 4]):
                end += 1
            if end > place:
                runs[str(place)] = memory[place:end].hex(" ").upper()
            place = end + 1
        return runs

    def memory_of(self, runs: dict[str, str]) -> bytearray:
        """The memory with these runs; ValueError when they do not fit."""
        memory = bytearray(len(self.memory))
        for address, digits in runs.items():
            data = bytes.fromhex(digits)
            place = whole(address, 0, len(memory) - len(data))
            memory[place : place + len(data)] = data
        return memory


def hex_bytes(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a row of hex bytes") from None
