"""The second book of registers of the RH56 hands (dossier §3), and what a hand shows when it is found.

Rows are those of sim/inspire/memory.py with byte addresses: DF and TP count bytes, F1 and DG2 count words of 16 bits, whose
address is doubled here. Knows numbers, no frames, no motion. Every register of the golden hand has another value, so that a
swap is seen (dossier §10).
"""

from __future__ import annotations

from handctl.sim.inspire.memory import Rows

Found = tuple[int, int, int, int, int, int]

MEMORY = 8192  # bytes; above, everything reads 0
LOW, HIGH = -32768, 32767
FINGERS = ("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation")
MOTORS = tuple(f"m{number}" for number in range(1, 14))

_DF_AND_TP: Rows = (
    ("id", 1000, 1, 1, "rw", 1, 254),
    ("clear", 1004, 1, 1, "w", 0, 1),
    ("save", 1005, 1, 1, "w", 0, 1),
    ("reset", 1006, 1, 1, "w", 0, 1),
    ("calibrate", 1009, 1, 1, "w", 0, 1),  # the force sensors
    ("default-speed", 1032, 2, 6, "rw", 0, 1000),
    ("stroke-set", 1474, 2, 6, "rw", -1, 2000),
    ("angle-set", 1486, 2, 6, "rw", -1, 1000),
    ("speed-set", 1522, 2, 6, "rw", -1, 1000),
    ("stroke", 1534, 2, 6, "r", LOW, HIGH),
    ("angle", 1546, 2, 6, "r", LOW, HIGH),
    ("force", 1582, 2, 6, "r", LOW, HIGH),
    ("current", 1594, 2, 6, "r", LOW, HIGH),
    ("error", 1606, 1, 6, "r", 0, 255),
    ("status", 1612, 1, 6, "r", 0, 255),
    ("temperature", 1618, 1, 6, "r", 0, 255),
)
DF: Rows = (
    *_DF_AND_TP,
    ("speed", 1002, 1, 1, "rw", 0, 2),  # code
    ("current-limit", 1020, 2, 6, "rw", 0, 1500),
    ("default-force", 1044, 2, 4, "rw", 0, 1000),
    ("default-force-thumb", 1052, 2, 2, "rw", 0, 1500),
    ("voltage", 1472, 2, 1, "r", LOW, HIGH),
    ("force-set", 1498, 2, 6, "rw", -1, 1000),
    ("action", 2000, 1, 3, "rw", 0, 255),  # stored: 90 EB, number of steps
    ("steps", 2016, 2, 152, "rw", LOW, HIGH),  # 8 times 19 words
    ("action-number", 2320, 1, 1, "rw", 0, 40),
    ("action-save", 2321, 1, 1, "w", 0, 1),
    ("run", 2322, 1, 1, "rw", 0, 1),
    ("force-adjust", 2324, 2, 1, "rw", LOW, HIGH),
)
TP: Rows = (
    *_DF_AND_TP,
    ("speed", 1002, 1, 1, "rw", 0, 3),
    ("default-force", 1044, 2, 6, "rw", 0, 3000),
    ("force-set", 1498, 2, 6, "rw", -1, 3000),
    ("address", 1700, 1, 4, "rw", 0, 255),
    ("tactile", 3000, 2, 1062, "r", 0, 65535),
)


def _words(*rows: tuple[str, int, int, str, int, int]) -> Rows:
    """Rows that count words: (word, address, elements, access, lowest, highest)."""
    return tuple((word, 2 * place, 2, count, access, low, high) for word, place, count, access, low, high in rows)


# Addresses on F1 and on DG2; 6 elements are one of each finger, and on DG2 one of each motor. Angles are 0.1°. The editions
# disagree about the ends of angles and forces: the widest are taken here.
_F1_AND_DG2 = (
    ("id", 1000, 1000, 1, "rw", 1, 254),
    ("speed", 1001, 1001, 1, "rw", 0, 3),
    ("clear", 1003, 1003, 1, "w", 0, 1),
    ("save", 1004, 1004, 1, "w", 0, 1),
    ("reset", 1005, 1005, 1, "w", 0, 1),
    ("calibrate", 1007, 1007, 1, "w", 0, 1),
    ("action-number", 2160, 2160, 1, "rw", 0, 40),
    ("run", 2162, 2162, 1, "rw", 0, 1),
    ("touch", 3000, 3000, 34, "r", 0, 65535),
    ("current-limit", 1016, 1024, 6, "rw", 0, 1500),
    ("default-force", 1028, 1052, 6, "rw", -1000, 12000),
    ("stroke-set", 1034, 1066, 6, "rw", -1, 2000),
    ("angle-set", 1040, 1080, 6, "rw", -1, 1800),
    ("force-set", 1046, 1094, 6, "rw", -1000, 12000),
    ("speed-set", 1052, 1108, 6, "rw", -1, 4000),
    ("stroke", 1058, 1122, 6, "r", LOW, HIGH),
    ("angle", 1064, 1136, 6, "r", LOW, HIGH),
    ("force", 1070, 1150, 6, "r", LOW, HIGH),
    ("current", 1076, 1164, 6, "r", LOW, HIGH),
    ("error", 1082, 1178, 6, "r", 0, 65535),
    ("status", 1088, 1192, 6, "r", 0, 65535),
    ("temperature", 1094, 1206, 6, "r", 0, 65535),
    ("mode", 1100, 1220, 6, "rw", 0, 2),
    ("pause", 1130, 1300, 1, "rw", 0, 1),
    ("stop", 1131, 1301, 1, "rw", 0, 1),
)
F1: Rows = _words(
    ("default-speed", 1022, 6, "rw", 0, 4000),
    *((word, place, count, access, low, high) for word, place, _, count, access, low, high in _F1_AND_DG2),
)
DG2: Rows = _words(
    ("default-speed", 1038, 13, "rw", 0, 2500),
    ("built-in-number", 1431, 1, "rw", 0, 40),
    ("run-built-in", 1432, 1, "rw", 0, 1),
    *(
        (word, place, 13 if count == 6 else count, access, low, high)
        for word, _, place, count, access, low, high in _F1_AND_DG2
    ),
)


class Generation:
    """What one generation has.

    unit      bytes that one address counts
    names     of its fingers or motors
    ends      angle closed and open, of each finger
    fast      the speed at which fingers take `FULL_STROKE` s
    speeds    bit/s by speed code, on the serial pair
    """

    def __init__(
        self,
        name: str,
        rows: Rows,
        *,
        unit: int = 1,
        names: tuple[str, ...] = FINGERS,
        ends: tuple[tuple[int, int], ...] = ((0, 1000),) * 6,
        fast: int = 1000,
        speeds: tuple[int, ...],
        first: int = 0,
    ) -> None:
        self.name = name
        self.rows = rows
        self.words = {row[0] for row in rows}
        self.unit = unit
        self.names = names
        self.ends = ends
        self.fast = fast
        self.speeds = speeds
        self.first_angle = first

    @property
    def count(self) -> int:
        return len(self.names)

    def most(self, word: str) -> int:
        """Greatest set value that does anything."""
        if word == "angle-set":
            return max(1000, *(high for _, high in self.ends))
        return {"stroke-set": 2000, "speed-set": 4 * self.fast}.get(word, HIGH)


_NEW_SPEEDS = (115200, 57600, 19200, 921600)
_F1_ENDS = ((900, 1740),) * 4 + ((1100, 1400), (600, 1800))
GENERATIONS = {
    "df": Generation("df", DF, speeds=(115200, 57600, 19200)),
    "tp": Generation("tp", TP, speeds=_NEW_SPEEDS),
    "f1": Generation("f1", F1, unit=2, ends=_F1_ENDS, fast=2000, speeds=_NEW_SPEEDS, first=1001),
    "dg2": Generation(
        "dg2", DG2, unit=2, names=MOTORS, ends=((500, 1800),) * 13, fast=2000, speeds=_NEW_SPEEDS, first=1200
    ),
}

FACTORY_ADDRESS = (192, 168, 11, 210)  # left and right alike (dossier §2.3)
POWER_ON_SPEED, POWER_ON_FORCE, POWER_ON_ROTATION = 500, 500, 259  # of a hand as it is delivered (dossier §6)
VOLTAGE = 558  # of DF
NEVER_COMMANDED = 255  # status behind power-on (dossier §3.1)


def golden(generation: Generation) -> dict[str, tuple[int, ...]]:
    """The set values of a hand as it is found: in the middle of its use, no two alike (dossier §10)."""
    if generation.count == 6:
        strokes: tuple[int, ...] = (111, 222, 333, 444, 555, 666)
    else:
        strokes = tuple(111 * number for number in range(1, 14))
    return {
        "current-limit": tuple(range(901, 901 + generation.count)),
        "default-speed": tuple(range(701, 701 + generation.count)),
        "default-force": tuple(range(501, 501 + generation.count)),
        "stroke-set": strokes,
        "angle-set": (-1,) * generation.count,
        "force-set": tuple(range(401, 401 + generation.count)),
        "speed-set": tuple(range(601, 601 + generation.count)),
    }


def factory(generation: Generation) -> dict[str, tuple[int, ...]]:
    """Settings as one hand was delivered; the current limits are invented."""
    count = generation.count
    found = {
        "default-speed": (POWER_ON_SPEED,) * count,
        "default-force": (POWER_ON_FORCE,) * (count - 1) + (POWER_ON_ROTATION,),
    }
    return found | ({"current-limit": (1500,) * count} if "current-limit" in generation.words else {})


def readings(generation: Generation, number: int) -> Found:
    """Stroke, angle, force, current, status and temperature of one finger of the golden hand."""
    if number < 6:
        stroke = (211, 322, 433, 544, 655, 766)[number]
        angle = 110 * (number + 1)
        force = (-11, 12, -13, 14, -15, 16)[number]
        current = (21, -22, 23, 24, 25, 26)[number]
        status = (2, 1, 2, 3, 2, 0)[number]
    else:
        stroke, angle, force, current, status = 215 + 111 * number, 0, 50 + number, 70 + number, 2
    if generation.unit == 2:
        angle = generation.first_angle + (10 * number if number < 4 or generation.count > 6 else 110 * number - 231)
    return stroke, angle, force, current, status, 31 + number
