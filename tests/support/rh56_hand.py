"""A bare RH56 hand, which is of none of the families here and shares the frame of two of them (dossier rh56).

    host   EB 90 id length 11 address count sum        read, flag 11
    host   EB 90 id length 12 address data sum         write, flag 12; anything else is silence

`df` and `tp` have one address a byte, `f1` and `dg2` one a word (two bytes a register, lengths in bytes). What DF calls save
is F1's factory reset, and DF's clear is F1's save: a write meant for one of them strikes another. First values are those of
`foreign_devices`.
Only what a mistaken command could do is here: memory, fingers that move, flash, triggers, each write counted.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import Any, NamedTuple

from handctl.sim.engine.line_and_faults import Line
from handctl.sim.engine.simulated_device import Model, Options, Random, Reply
from handctl.sim.inspire.frames import find, frame
from tests.support.foreign_devices import DF, DG2, F1, TP

READ, WRITE = 0x11, 0x12
SPEED = 1250.0
"""Units of angle a second: a whole stroke in 800 ms (rh56 3.1)."""
Row = tuple[int, int, int, str]
"""First address, bytes a register, registers, access."""

BYTES: tuple[Row, ...] = (
    (1000, 1, 1, "rw"), (1002, 1, 1, "rw"), (1004, 1, 1, "t"), (1005, 1, 1, "t"), (1006, 1, 1, "t"), (1008, 1, 1, "t"),
    (1009, 1, 1, "t"), (1020, 2, 6, "rw"), (1032, 2, 6, "rw"), (1044, 2, 6, "rw"), (1474, 2, 6, "rw"), (1486, 2, 6, "rw"),
    (1498, 2, 6, "rw"), (1522, 2, 6, "rw"), (2322, 1, 1, "t"),
)  # fmt: skip
"""DF and TP (rh56 3.1, 3.3): what can be written. `t` acts and reads back as 0."""
WORDS: tuple[Row, ...] = (
    (1000, 2, 1, "rw"), (1001, 2, 1, "rw"), (1003, 2, 1, "t"), (1004, 2, 1, "t"), (1005, 2, 1, "t"), (1007, 2, 1, "t"),
    (1016, 2, 6, "rw"), (1022, 2, 6, "rw"), (1028, 2, 6, "rw"), (1034, 2, 6, "rw"), (1040, 2, 6, "rw"), (1046, 2, 6, "rw"),
    (1052, 2, 6, "rw"), (1100, 2, 1, "rw"), (1130, 2, 1, "rw"), (1131, 2, 1, "rw"), (2162, 2, 1, "t"),
)  # fmt: skip
"""F1 (rh56 3.2), word addresses."""
THIRTEEN: tuple[Row, ...] = (
    (1000, 2, 1, "rw"), (1001, 2, 1, "rw"), (1003, 2, 1, "t"), (1004, 2, 1, "t"), (1005, 2, 1, "t"), (1007, 2, 1, "t"),
    (1024, 2, 13, "rw"), (1038, 2, 13, "rw"), (1052, 2, 13, "rw"), (1066, 2, 13, "rw"), (1080, 2, 13, "rw"),
    (1094, 2, 13, "rw"), (1108, 2, 13, "rw"), (1220, 2, 1, "rw"), (1300, 2, 1, "rw"), (1301, 2, 1, "rw"),
)  # fmt: skip
"""DG2 (rh56 3.2), word addresses, thirteen actuators."""


class Generation(NamedTuple):
    """Its values at first, what can be written, bytes an address, where targets and angles lie, how many there are."""

    book: tuple[tuple[int, str, tuple[int, ...]], ...]
    rows: tuple[Row, ...]
    unit: int
    targets: int
    measured: int
    count: int = 6


GENERATIONS = {
    "df": Generation(DF, BYTES, 1, 1486, 1546),
    "tp": Generation(TP, BYTES, 1, 1486, 1546),
    "f1": Generation(F1, WORDS, 2, 1040, 1064),
    "dg2": Generation(DG2, THIRTEEN, 2, 1080, 1136, 13),
}


class Rh56(Model):
    """The hand without its wire."""

    KIND = "rh56"
    HEADER = b"\x90\xeb"

    generation = GENERATIONS["df"]

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        book, _, self._unit, _, measured, count = self.generation
        self.speed = 115200
        self.memory = bytearray(16384)
        for address, layout, values in book:
            struct.pack_into(layout, self.memory, address * self._unit, *values)
        first = struct.unpack_from(f"<{count}h", self.memory, measured * self._unit)
        self.angles = [float(angle) for angle in first]
        self.targets: list[float | None] = [None] * count
        self.pace = SPEED
        self.acted: Counter[int] = Counter()
        """How often each trigger was written with 1."""
        self.writes = 0
        self._inbox = bytearray()
        self._heard = 0.0

    # -- time ---------------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        seconds, self.now = max(0.0, now - self.now), now
        for finger, target in enumerate(self.targets):
            if target is not None:
                way = target - self.angles[finger]
                step = min(abs(way), self.pace * seconds)
                self.angles[finger] += step if way > 0 else -step
        if self._inbox and now - self._heard > 0.1:
            self._inbox.clear()

    def publish(self) -> None:
        """Puts the angles of this moment into memory."""
        place = self.generation.measured * self._unit
        struct.pack_into(f"<{len(self.angles)}h", self.memory, place, *(round(angle) for angle in self.angles))

    # -- requests -----------------------------------------------------------------------------------------------------

    @property
    def id(self) -> int:
        return self.memory[1000 * self._unit]

    def due(self, pending: bytes) -> int | None:
        _, size, decided = find(self._inbox + pending, self.id, _possible)
        return decided - len(self._inbox) if size else None

    def feed(self, data: bytes) -> None:
        self._heard = self.now
        self._inbox += data
        while True:
            skip, size, _ = find(self._inbox, self.id, _possible)
            request = bytes(self._inbox[skip : skip + size])
            del self._inbox[: skip + size]
            if not request:
                return
            if not self.judge() & {"deaf"}:
                self._handle(request[4], request[5:-1])

    def _handle(self, flag: int, body: bytes) -> None:
        address = struct.unpack_from("<H", body)[0]
        if flag == READ:
            self.publish()
            place = address * self._unit
            answer = bytes(self.memory[place : place + body[2]]).ljust(body[2], b"\0")
        else:
            self.writes += 1
            self._write(address * self._unit, body[2:])
            answer = b"\x01"
        self.replies.append(Reply(self.now, frame(self.id, flag, body[:2] + answer), frozenset()))

    def _write(self, begin: int, data: bytes) -> None:
        for address, size, count, access in self.generation.rows:
            for number in range(count):
                place = address * self._unit + number * size
                if not begin <= place <= begin + len(data) - size:
                    continue
                raw = data[place - begin : place - begin + size]
                if access == "t":
                    self.acted[address] += int.from_bytes(raw, "little") == 1
                    continue
                self.memory[place : place + size] = raw
                if address == self.generation.targets:
                    value = struct.unpack("<h", raw)[0]
                    self.targets[number] = None if value == -1 else float(value)


def _possible(flag: int, length: int) -> bool:
    return (flag == READ and length == 4) or (flag == WRITE and length >= 4)


def rh56_line(generation: str = "df", **options: Any) -> Line:
    """The hand at the end of a cable; options are those of the line."""
    model = type("Device", (Rh56,), {"generation": GENERATIONS[generation]})
    return Line(model, {name: str(value) for name, value in options.items()})
