"""A simulated Inspire EH55BF1 exoskeleton hand: frames, registers, flash, late answers (exo §2.1 to §2.3).

Written from the manual alone, by other means than the host: decimal numbers, `struct`, a sum loop. Where the manual is
silent the behaviour is invented and the comment says so; nothing seen here is evidence about a real hand.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from handctl.sim.engine.simulated_device import Options, Random, Rows
from handctl.sim.exo.mechanics import Hand
from handctl.sim.inspire.actuator_faults import apply_faults, fault_help, start_hot
from handctl.sim.inspire.frames import SERIAL_OPTIONS, Serial, frame
from handctl.sim.inspire.memory import Element, Space, differ

# The second book of registers, exo §2.3: (word, address, bytes per element, elements, access, lowest, highest). 1006 is not
# in the manual's table (exo §2.3.5 gives no address); it is taken from the RH56 hand of the same maker.
REGISTERS = (
    ("id", 1000, 1, 1, "rw", 1, 254),
    ("speed", 1001, 1, 1, "rw", 0, 2),  # code
    ("clear", 1004, 1, 1, "rw", 0, 1),  # errors
    ("save", 1005, 1, 1, "rw", 0, 1),  # to flash
    ("reset", 1006, 1, 1, "w", 0, 1),  # factory defaults
    ("calibrate", 1009, 1, 1, "rw", 0, 1),
    ("voltage", 1472, 2, 1, "r", -32768, 32767),  # no unit given
    ("position-set", 1486, 2, 5, "rw", -1, 1000),
    ("force-set", 1498, 2, 5, "rw", -1000, 1000),
    ("position", 1546, 2, 6, "r", 0, 1000),  # thumb rotation last
    ("force", 1582, 2, 5, "r", -1000, 1000),
    ("current", 1594, 2, 5, "r", 0, 1000),  # mA
    ("error", 1606, 1, 5, "r", 0, 255),  # bits
    ("temperature", 1618, 1, 5, "r", 0, 100),  # °C
)
SPEED_AT_1002 = tuple(("speed", 1002, *row[2:]) if row[0] == "speed" else row for row in REGISTERS)
SPEEDS = (115200, 57600, 19200)  # speed codes 0, 1, 2 (exo §2.3.2)
TRIGGERS = ("clear", "save", "reset", "calibrate")  # act when 1 is written and read back as 0 (open on hardware)
FORCE, POSITION = 49, 50  # flags of the commands (exo §2.2.1, §2.2.2)
LONGEST = 1.0  # s; no movement takes longer
ALL_FAULTS = (1, 2, 4, 6, 24)  # error bytes of the state "faults"; the 6 is the example of exo §2.3.12

_OPTIONS = {
    **SERIAL_OPTIONS,
    "calibration": ((None, 3600.0), "seconds that a calibration takes (default about 12: waits and movements)"),
    "jitter": (False, "1: force, current and position jitter also at rest"),
    "limit": ((70, 40, 100), "temperature in °C that sets the over-temperature error (default 70)"),
    "gap": ((0.1, 3600.0), "seconds of silence after which an unfinished request is forgotten (default 0.1)"),
}
_FAULTS = {
    "strict": "silence instead of an ack for a write of anything that cannot be written or is out of range",
    "block-silent": "silence for reads that touch undocumented bytes",
    "no-late-frames": "no save result, no end of calibration",
    "save-fails": "the save result is FF and flash stays as it was",
    "fresh": "position set values are -1 at power-on",
    "foreign": "the registers do not look like this device (1472 is 0, values out of range)",
    "baud-at-1002": "the baud rate code is at 1002 as on the RH56, and 1001 ignores writes",
    "faults": "error bytes 01 02 04 06 18",
    "hot": "all actuators start above the limit and cool down",
    "blocked": "no finger can move",
    **fault_help(("the little finger", "the ring finger", "the middle finger", "the index finger", "the thumb")),
}


class Device(Serial):
    """The hand without its wire."""

    KIND = "exo"
    CONTROL = "handctl.sim.exo.control_commands"
    OPTIONS = Rows(_OPTIONS)
    FAULTS = _FAULTS
    FLAGS = {17: ("", False), 18: ("", True)}  # noqa: RUF012

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        self.speed = int(self.given["baud"])
        self.flash = {"id": self.given["id"], "speed_code": SPEEDS.index(self.speed)}
        self.hand = Hand(random, self.given["jitter"], float(self.given["limit"]))
        self.space = Space(REGISTERS, most=1000)
        self.spaces = {"": self.space}

    # -- power, time, faults ----------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.hand.now = now

    def advance(self, now: float) -> None:
        super().advance(now)
        self.hand.advance(now)

    def elapse(self, seconds: float) -> None:
        self.hand.advance(self.hand.now + max(seconds, LONGEST))

    def power(self, on: bool) -> None:
        """Id and speed come from flash (exo §2.3.1, §2.3.2), set points start anew, late frames are gone."""
        super().power(on)
        self.hand.power_on()
        if not on:
            return
        self.set_faults(self.faults)
        self.space.clear()
        self._defaults()
        self.space.put("id", [self.flash["id"]])
        self.space.put("speed", [self.flash["speed_code"]])
        self.speed = SPEEDS[self.flash["speed_code"]]
        start_hot(self.hand.fingers, self.faults)
        self.dirty = True

    def _defaults(self) -> None:
        """What a power-on shows, all different; also what the factory defaults are taken to be (open)."""
        foreign = "foreign" in self.faults
        positions = (3000, 3001, 3002, 3003, 3004) if foreign else (151, 252, 353, 454, 555)
        if "fresh" in self.faults and not foreign:
            positions = (-1, -1, -1, -1, -1)
        for word, values in (
            ("id", (1,)),
            ("speed", (0,)),
            ("voltage", (0 if foreign else 558,)),
            ("position-set", positions),
            ("force-set", (-61, 62, -63, 64, -65)),
        ):
            self.space.put(word, values)

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        self.space.use(SPEED_AT_1002 if "baud-at-1002" in faults else REGISTERS)
        for finger in self.hand.fingers if "blocked" in faults | before else ():
            finger.blocked = "blocked" in faults
        apply_faults(self.hand.fingers, faults, ALL_FAULTS)

    @property
    def id(self) -> int:  # type: ignore[override]
        return self.space.memory[1000]

    # -- requests ---------------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """Deaf while it calibrates: nothing is said about requests during the course, and this is the harshest reading."""
        return self.hand.calibrating

    def possible(self, flag: int, length: int) -> bool:
        """Commands have five values."""
        return length == 11 if flag in (FORCE, POSITION) else super().possible(flag, length)

    def answer(self, flag: int, body: bytes, hits: frozenset[str]) -> bytes | None:
        if flag in (FORCE, POSITION):
            return self._command(flag, struct.unpack("<5h", body), hits)
        return super().answer(flag, body, hits)

    def stored(self, accepted: Sequence[Element], hits: frozenset[str]) -> None:
        for element in accepted:
            self._store(*element, hits)

    def _store(self, word: str, number: int, value: int, place: int, raw: bytes, hits: frozenset[str]) -> None:
        """One register element that was written with a value in its range."""
        self.dirty = True
        if word in TRIGGERS:
            if value == 1:
                self._trigger(word, hits)
            return
        self.space.store(place, raw)
        if word == "position-set":  # exo §2.3.7: acts at once, -1 leaves the finger where it is
            self.hand.fingers[number].target = None if value == -1 else value
        elif word == "force-set":  # exo §2.3.8
            self.hand.fingers[number].force_goal = value

    def _trigger(self, word: str, hits: frozenset[str]) -> None:
        if word == "clear":
            for finger in self.hand.fingers:
                finger.clear()
        elif word == "save":
            # Flash is written at once, so that a client that leaves before the result finds it saved.
            if "save-fails" not in self.faults:
                self.flash = {"id": self.id, "speed_code": self.space.memory[self.space.place("speed")]}
            self.tell_saved(self.now + self.SAVE_TIME, 1005, hits)
        elif word == "reset":
            # RAM only: the id acts at once as after a write, the speed with a power cycle after a save (open).
            self._defaults()
        else:
            self.tell_calibrated(self.hand.calibrate(self.given["calibration"]), hits)

    def _command(self, flag: int, values: tuple[int, ...], hits: frozenset[str]) -> bytes | None:
        """exo §2.2.1 and §2.2.2: five set values; the reply tells positions, or forces, of this moment.

        They are taken to fill the set registers. A value out of range leaves its finger alone, -1 as a position too
        (the table starts at 0), or is met with silence in the state "strict".
        """
        word, low = ("force-set", -1000) if flag == FORCE else ("position-set", 0)
        good = [low <= value <= 1000 for value in values]
        if "strict" in self.faults and not all(good):
            return None
        answer = self.hand.positions() if flag == FORCE else self.hand.forces()
        for number, value in enumerate(values):
            if good[number] and "refuse" not in hits:
                self._store(word, number, value, self.space.place(word, number), struct.pack("<h", value), hits)
        return struct.pack(f"<{len(answer)}h", *answer)

    def publish(self, space: str = "") -> None:
        for word, values in self.hand.readings():
            self.space.put(word, values)

    def twin(self, data: bytes) -> bytes:
        """All that a command tells is measured."""
        if data[4] not in (FORCE, POSITION):
            return super().twin(data)
        body = bytearray(data[5:-1])
        for offset in range(0, len(body), 2):
            differ(body, offset, 1000)
        return frame(data[2], data[4], bytes(body))
