"""A bare RH56 hand, which is of none of the families here and shares the frame of two of them (dossier rh56).

    host   EB 90 id length 11 address count sum        read, flag 11
    host   EB 90 id length 12 address data sum         write, flag 12; anything else is silence

Three generations: `df` and `tp` have one address a byte, `f1` one address a word (two bytes a register, lengths in bytes).
What DF calls save is F1's factory reset, and DF's clear is F1's save: a write meant for one of them strikes another.
Only what a mistaken command could do is here: memory, fingers that move, flash, triggers, each write counted.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import Any

from handctl.sim.inspire_frames import find, frame
from handctl.sim.line import Line
from handctl.sim.model import Model, Options, Random, Reply

READ, WRITE = 0x11, 0x12
SPEED = 1250.0
"""Units of angle a second: a whole stroke in 800 ms (rh56 3.1)."""
FLEXED = (110, 220, 330, 440, 550, 660)
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
TARGETS = {"df": 1486, "tp": 1486, "f1": 1040}
MEASURED = {"df": 1546, "tp": 1546, "f1": 1064}


class Rh56(Model):
    """The hand without its wire."""

    KIND = "rh56"
    HEADER = b"\x90\xeb"

    def __init__(self, options: Options, random: Random, generation: str = "df") -> None:
        super().__init__(options, random)
        self.generation = generation
        self.rows = WORDS if generation == "f1" else BYTES
        self._unit = 2 if generation == "f1" else 1
        self.speed = 115200
        self.memory = bytearray(16384)
        self.angles = [float(angle) for angle in FLEXED]
        self.targets: list[float | None] = [None] * 6
        self.pace = SPEED
        self.acted: Counter[int] = Counter()
        """How often each trigger was written with 1."""
        self.writes = 0
        self._inbox = bytearray()
        self._heard = 0.0
        self._first_values()

    def _first_values(self) -> None:
        put = self._put
        put(1000, "<B", 1)
        if self.generation == "f1":  # angles in 0.1 degree, status, temperatures, as words
            put(1040, "<6h", *(-1,) * 6)
            put(1088, "<6H", 2, 1, 2, 3, 2, 0)
            put(1094, "<6H", 31, 32, 33, 34, 35, 36)
            self.angles = [1010.0, 1120.0, 1230.0, 1340.0, 1150.0, 1660.0]
            return
        put(1032, "<6h", *(901, 902, 903, 904, 905, 906))
        put(1044, "<6h", *(501, 502, 503, 504, 505, 506))
        put(1486, "<6h", *(-1,) * 6)
        put(1498, "<6h", *(501, 502, 503, 504, 505, 506))
        put(1522, "<6h", *(901, 902, 903, 904, 905, 906))
        put(1582, "<6h", -11, 12, -13, 14, -15, 16)
        put(1594, "<6h", 21, -22, 23, 24, 25, 26)
        put(1612, "<6B", 2, 1, 2, 3, 2, 0)
        put(1618, "<6B", 31, 32, 33, 34, 35, 36)
        if self.generation == "df":
            put(1020, "<6h", *(701, 702, 703, 704, 705, 706))
            put(1472, "<h", 558)
        else:
            put(1700, "<4B", 192, 168, 11, 210)

    def _put(self, address: int, layout: str, *values: int) -> None:
        struct.pack_into(layout, self.memory, address * self._unit, *values)

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
        self._put(MEASURED[self.generation], "<6h", *(round(angle) for angle in self.angles))

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
        self._replies.append(Reply(self.now, frame(self.id, flag, body[:2] + answer), frozenset()))

    def _write(self, begin: int, data: bytes) -> None:
        for address, size, count, access in self.rows:
            for number in range(count):
                place = address * self._unit + number * size
                if not begin <= place <= begin + len(data) - size:
                    continue
                raw = data[place - begin : place - begin + size]
                if access == "t":
                    self.acted[address] += int.from_bytes(raw, "little") == 1
                    continue
                self.memory[place : place + size] = raw
                if address == TARGETS[self.generation]:
                    value = struct.unpack("<h", raw)[0]
                    self.targets[number] = None if value == -1 else float(value)


def _possible(flag: int, length: int) -> bool:
    return (flag == READ and length == 4) or (flag == WRITE and length >= 4)


def rh56_line(generation: str = "df", **options: Any) -> Line:
    """The hand at the end of a cable; options are those of the line."""
    return Line(
        type("Device", (Rh56,), {"__init__": lambda self, o, r: Rh56.__init__(self, o, r, generation)}),
        {name: str(value) for name, value in options.items()},
    )
