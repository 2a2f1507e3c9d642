"""The two address spaces of a simulated wrist module: its own registers, and those of the hand that carries it.

The second book of registers: (address, bytes per element, elements, access, lowest, highest). Both spaces use the
addresses 1020 to 1043 for different things (wrist §2.1 against RH56 §2.4.7, §2.4.8); which one a request means is told
by its flag alone. Knows bytes, no frames and no motion.
"""

from __future__ import annotations

import struct

MEMORY = 4096  # bytes kept; above, everything reads 0

# wrist §2.1; angles in 0.01° with the ranges of wrist §1, currents in mA, time in ms.
WRIST = (
    (1020, 2, 1, "r", -2266, 2212),  # actual pitch
    (1022, 2, 1, "r", -2550, 2550),  # actual yaw
    (1024, 2, 1, "r", -32768, 32767),  # current of actuator #2
    (1026, 2, 1, "r", -32768, 32767),  # current of actuator #1
    (1028, 1, 1, "r", 0, 255),  # error of actuator #1
    (1030, 1, 1, "r", 0, 255),  # error of actuator #2
    (1032, 1, 1, "r", 0, 255),  # temperature of actuator #1
    (1033, 1, 1, "r", 0, 255),  # temperature of actuator #2
    (1038, 2, 1, "rw", -2550, 2550),  # yaw set value: yaw before pitch here
    (1040, 2, 1, "rw", -2266, 2212),  # pitch set value
    (1042, 2, 1, "rw", 0, 65535),  # time of a movement
)

# The hand behind the wrist, as the RH56 has it. The wrist's manual only says that it is there (wrist §2.3).
HAND = (
    (1000, 1, 1, "rw", 1, 254),  # id
    (1002, 1, 1, "rw", 0, 2),  # speed code: here at 1002
    (1004, 1, 1, "rw", 0, 1),  # clear errors
    (1005, 1, 1, "rw", 0, 1),  # save to flash
    (1006, 1, 1, "rw", 0, 1),  # factory defaults
    (1009, 1, 1, "rw", 0, 1),  # calibrate
    (1020, 2, 6, "rw", -32768, 32767),  # current limits, mA
    (1032, 2, 6, "rw", -32768, 32767),  # speeds after power-on
    (1044, 2, 6, "rw", -32768, 32767),  # forces after power-on
    (1472, 2, 1, "r", -32768, 32767),  # system voltage
    (1474, 2, 6, "rw", -32768, 32767),  # actuator strokes, set
    (1486, 2, 6, "rw", -32768, 32767),  # finger angles, set
    (1498, 2, 6, "rw", -32768, 32767),  # finger forces, set
    (1522, 2, 6, "rw", -32768, 32767),  # finger speeds, set
    (1534, 2, 6, "r", -32768, 32767),  # actuator strokes
    (1546, 2, 6, "r", -32768, 32767),  # finger angles
    (1582, 2, 6, "r", -32768, 32767),  # finger forces
    (1594, 2, 6, "r", -32768, 32767),  # actuator currents, mA
    (1606, 1, 6, "r", 0, 255),  # error bits
    (1612, 1, 6, "r", 0, 255),  # states
    (1618, 1, 6, "r", 0, 255),  # temperatures, °C
)
TRIGGERS = (1004, 1005, 1006, 1009)  # act when 1 is written and read back as 0
PLACES = (1534, 1558)  # strokes and angles of the fingers
KEPT = (1020, 1056)  # the hand's bytes that a save keeps, beside id and speed code (RH56 §2.4.7 to §2.4.9)

# What the hand shows at power-on: all different, and nothing that could pass for a value of the wrist.
_HAND_VALUES = (
    (1472, "<h", (562,)),
    (1474, "<6h", (1161, 1262, 1363, 1464, 1565, 1666)),
    (1486, "<6h", (161, 262, 363, 464, 565, 666)),
    (1498, "<6h", (501, 502, 503, 504, 505, 506)),
    (1534, "<6h", (1121, 1133, 1145, 1169, 1157, 1181)),
    (1546, "<6h", (921, 933, 945, 969, 957, 981)),  # the index finger as in a field capture of an RH56
    (1582, "<6h", (-21, 22, -23, 24, -25, 26)),
    (1594, "<6h", (41, 42, 43, 44, 45, 46)),
    (1612, "<6B", (2, 1, 3, 2, 0, 5)),
    (1618, "<6B", (36, 37, 38, 39, 40, 41)),
)
# What is in the hand's flash when it leaves the factory: current limits, speeds and forces after power-on.
FACTORY = struct.pack(
    "<18h", 1501, 1502, 1503, 1504, 1505, 1506, 901, 902, 903, 904, 905, 906, 401, 402, 403, 404, 405, 406
)

Rows = tuple[tuple[int, int, int, str, int, int], ...]


class Space:
    """One address space: a byte for every address, and which of them can be written."""

    def __init__(self, rows: Rows) -> None:
        self.rows = rows
        self.memory = bytearray(MEMORY)

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

    def plan(self, address: int, data: bytes) -> tuple[list[tuple[int, int, bytes]], int]:
        """What a write would do: (address, value, bytes) of each element it may set, and how many bytes that takes up.

        Gaps, read-only bytes and values out of range are left out; half an element is completed from memory.
        """
        accepted, covered = [], 0
        for first, size, count, access, low, high in self.rows:
            for place in range(first, first + size * count, size) if "w" in access else ():
                begin, end = max(place, address), min(place + size, address + len(data))
                if begin >= end:
                    continue
                old = bytes(self.memory[place : place + size])
                raw = old[: begin - place] + data[begin - address : end - address] + old[end - place :]
                layout = "B" if size == 1 else "<h" if low < 0 else "<H"
                value = struct.unpack(layout, raw)[0]
                if low <= value <= high:
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


def power_on_hand(space: Space, kept: bytes) -> None:
    """The hand's memory after power-on; `kept` are its flash bytes from 1020 on. The fingers are where they were."""
    places = bytes(space.memory[PLACES[0] : PLACES[1]])
    space.memory = bytearray(MEMORY)
    for address, layout, values in _HAND_VALUES:
        struct.pack_into(layout, space.memory, address, *values)
    if any(places):
        space.memory[PLACES[0] : PLACES[1]] = places
    space.memory[KEPT[0] : KEPT[1]] = kept
    space.memory[1522:1534] = kept[12:24]  # the speeds in force are those kept for power-on


def power_on_wrist(space: Space) -> None:
    """Set values of the wrist after power-on; they move nothing until they are written."""
    space.memory = bytearray(MEMORY)
    struct.pack_into("<hhH", space.memory, 1038, 1100, -300, 700)
