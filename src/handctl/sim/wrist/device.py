"""A simulated Inspire wrist module and the hand that carries it (wrist §2.1, RH56 §2.4).

Both address spaces, flash, power and error states, the same behind the serial line and behind CAN; below them the wires:
RS-232 or RS-485 with the late result of a save (wrist §2.2, RH56 §2.2), CAN (§2.3). Flags 30 and 31 (hex) reach the wrist, 11
and 12 the hand that carries it; one id, the hand's. A write of 8 bytes looks like an exo's force command; a wrist takes it for
what it is here, a write (wrist §2.2.1). Where the manual is silent the behaviour is invented and the comment says so; nothing
seen here is evidence about a real wrist. Written from the manual alone, by other means than the host.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.sim.engine.simulated_device import Options, Random, Rows
from handctl.sim.hand import register_maps
from handctl.sim.hand.registers import OPTIONS as OF_HAND
from handctl.sim.hand.registers import Hand
from handctl.sim.inspire.actuator_faults import apply_faults, fault_help, start_hot
from handctl.sim.inspire.frames import SERIAL_OPTIONS, Asked, Can, Serial
from handctl.sim.inspire.memory import Element, Space
from handctl.sim.wrist.mechanics import PITCH, YAW, Body

# wrist §2.1; angles in 0.01° with the ranges of wrist §1, currents in mA, time in ms.
WRIST = (
    ("pitch", 1020, 2, 1, "r", -2266, 2212),
    ("yaw", 1022, 2, 1, "r", -2550, 2550),
    ("current-2", 1024, 2, 1, "r", -32768, 32767),  # of actuator #2
    ("current-1", 1026, 2, 1, "r", -32768, 32767),  # of actuator #1
    ("error-1", 1028, 1, 1, "r", 0, 255),
    ("error-2", 1030, 1, 1, "r", 0, 255),
    ("temperature-1", 1032, 1, 1, "r", 0, 255),
    ("temperature-2", 1033, 1, 1, "r", 0, 255),
    ("yaw-set", 1038, 2, 1, "rw", -2550, 2550),  # yaw before pitch here
    ("pitch-set", 1040, 2, 1, "rw", -2266, 2212),
    ("time", 1042, 2, 1, "rw", 0, 65535),  # of a movement
)

# The hand behind the wrist, which the wrist's manual only mentions (wrist §2.3): that of RH56 §2.4, with ranges as wide as
# a register, so that a value meant for the wrist does its harm here.
_HAND = tuple(
    (word, place, size, count, access, register_maps.LOW, register_maps.HIGH)
    if size == 2
    else (word, place, size, count, access, low, high)
    for word, place, size, count, access, low, high in register_maps.DF
    if place < 2000
)
GENERATION = register_maps.Generation("df", _HAND, speeds=(115200, 57600, 19200))
# What is in the hand's flash when it leaves the factory: current limits, speeds and forces after power-on.
_FACTORY: dict[str, tuple[int, ...]] = {
    "current-limit": (1501, 1502, 1503, 1504, 1505, 1506),
    "default-speed": (901, 902, 903, 904, 905, 906),
    "default-force": (401, 402, 403, 404, 405, 406),
}
KEPT = tuple(_FACTORY)
_SET = {
    "voltage": (562,),
    "stroke-set": (1161, 1262, 1363, 1464, 1565, 1666),
    "angle-set": (161, 262, 363, 464, 565, 666),
    "force-set": (501, 502, 503, 504, 505, 506),
}
_READINGS = [  # of each finger: stroke, angle, force, current, state, temperature
    (1121, 921, -21, 41, 2, 36),
    (1133, 933, 22, 42, 1, 37),
    (1145, 945, -23, 43, 3, 38),
    (1169, 969, 24, 44, 2, 39),  # the angle as in a field capture of an RH56
    (1157, 957, -25, 45, 0, 40),
    (1181, 981, 26, 46, 2, 41),
]


ACTUATOR_FAULTS = {  # fault -> (actuator, error byte)
    "locked-rotor": (0, 1),
    "over-temperature": (1, 2),
    "over-current": (0, 4),
    "motor-abnormal": (1, 8),
    "communication": (0, 16),
    "unknown-bits": (1, 160),
}
HAND_FAULTS = frozenset(("strict", "save-fails"))  # what its requests meet too
ALL_FAULTS = (1, 4)  # error bytes of the state "faults"

OPTIONS = {
    "bus": (("serial", "can"), "serial (RS-232 or RS-485, default) or can"),
    "jitter": (False, "1: currents and angles jitter also at rest"),
    "limit": ((70, 40, 100), "temperature in °C that sets the over-temperature error (default 70)"),
}
FAULTS = {
    "strict": "silence instead of an acknowledgement for a write of anything that cannot be written or is out of range",
    "block-silent": "silence for reads that touch undocumented bytes",
    "no-wrist": "a hand without a wrist: silence for every request to the wrist's registers",
    "save-fails": "the flash stays as it was",
    "foreign": "the registers do not look like this device (angles out of range)",
    "faults": "error bytes 01 and 04",
    "hot": "both actuators start above the limit and cool down",
    "blocked": "neither axis can move",
    **fault_help(("actuator 1", "actuator 2"), ACTUATOR_FAULTS),
}

_OF_HAND = Rows(OF_HAND)


def carrier(random: Random) -> Hand:
    """The hand that carries the wrist: it moves at once and shows it at once, and begins as it was at every power-on."""
    given = {**_OF_HAND.defaults, "refresh": 0.0, "dead-time": 0.0, "reset": "ram", "jitter": None}
    return Hand(GENERATION, given, random, {**_FACTORY, **_SET}, _READINGS, _FACTORY, stays=True)


class Module(Asked):
    """Wrist and hand. The id, the speed and what is kept live in the hand's space: the wrist's manual has none."""

    KIND = "wrist"
    CONTROL = "handctl.sim.wrist.control_commands"
    OPTIONS = Rows(OPTIONS)
    FAULTS = FAULTS
    SPEEDS: tuple[int, ...] = ()  # bit/s by speed code
    SPEED = "baud"  # the option

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        self.id = self.given["id"]
        self.speed_code = self.SPEEDS.index(int(self.given[self.SPEED]))  # the one in force
        self.flash = {"id": self.id, "speed_code": self.speed_code}
        self.body = Body(random, self.given["jitter"], float(self.given["limit"]))
        self.carrier = carrier(random)
        self.wrist, self.hand = Space(WRIST), self.carrier.space
        self.spaces = {"wrist": self.wrist, "carrier": self.hand}

    # -- power, time, faults ----------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.body.now = now
        self.carrier.boot(now)

    def advance(self, now: float) -> None:
        super().advance(now)
        self.body.advance(now)
        self.carrier.advance(now)

    def elapse(self, seconds: float) -> None:
        self.body.advance(self.body.now + max(seconds, self.body.left))
        self.carrier.elapse(seconds)

    def power(self, on: bool) -> None:
        """Id and speed come from flash, set values start anew, late frames are gone; angles and heat stay."""
        self.publish()
        super().power(on)
        self.body.power_on()
        self.carrier.power(on)
        if not on:
            return
        self.wrist.clear()  # set values; they move nothing until they are written
        for word, value in (("yaw-set", 1100), ("pitch-set", -300), ("time", 700)):
            self.wrist.put(word, [value])
        self.use_id(self.flash["id"])
        self.hand.memory[1002] = self.flash["speed_code"]
        self.use_speed(self.flash["speed_code"])
        self.set_faults(self.faults)
        start_hot(self.body.actuators, self.faults)
        self.dirty = True

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        self.carrier.faults = faults & HAND_FAULTS
        body = self.body
        if "blocked" in faults:
            body.blocked = [True, True]
        elif "blocked" in before:
            body.release(PITCH)
            body.release(YAW)
        apply_faults(body.actuators, faults, ALL_FAULTS, ACTUATOR_FAULTS)

    def use_id(self, number: int) -> None:
        """Acts at once. The id register has one byte, an id on CAN may have 14 bits: only the low ones show (open)."""
        self.id = number
        self.hand.memory[1000] = number % 256

    def use_speed(self, code: int) -> None:
        self.speed_code = code
        self.speed = self.SPEEDS[code]

    # -- requests ---------------------------------------------------------------------------------------------------

    def read(self, space: str, address: int, count: int) -> bytes | None:
        return None if space == "wrist" and "no-wrist" in self.faults else super().read(space, address, count)

    def write(self, space: str, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        if space != "wrist":
            return self._write_hand(address, data, hits)
        return None if "no-wrist" in self.faults else super().write(space, address, data, hits)

    def stored(self, accepted: Sequence[Element], hits: frozenset[str]) -> None:
        """The time of the same write counts for its angles; a time alone is for the next movement (open)."""
        values = {}
        for word, _, value, place, raw in accepted:
            self.wrist.store(place, raw)
            values[word] = value
        targets = {axis: values[word] for axis, word in ((YAW, "yaw-set"), (PITCH, "pitch-set")) if word in values}
        if targets:
            place = self.wrist.place("time")
            self.body.move(targets, int.from_bytes(self.wrist.memory[place : place + 2], "little") / 1000.0)

    def _write_hand(self, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """What the hand does, and what of that concerns the wrist: the id, errors that are cleared, flash."""
        hand = self.carrier
        before = dict(hand.acts)
        done = hand.write(address, data, hits)
        did = {name for name, count in hand.acts.items() if count != before[name]}
        self.dirty = self.dirty or bool(done)
        if "id" in did:
            self.use_id(hand.number)
        if "clear" in did:  # taken to clear the wrist's errors as well: it has no register of its own for that
            self.body.clear()
        if "factory-reset" in did:  # RAM only: the id acts at once, the speed after a save and a power cycle (open)
            self.use_id(1)
        for event, when in hand.events:
            if event == "saved":
                # Flash is written at once, so that a client that leaves before the result finds it saved.
                if "save-fails" not in self.faults:
                    self.flash = {"id": self.id, "speed_code": self.carrier.code()}
                self.saved(hits)
            else:
                self.calibrates(when, hits)
        hand.events.clear()
        return done

    def saved(self, hits: frozenset[str]) -> None:
        """A save was tried; a wire that reports the result overrides this."""

    def calibrates(self, end: float, hits: frozenset[str]) -> None:
        """The hand's calibration has begun and ends then; a wire that reports the end overrides this."""

    def publish(self, space: str = "") -> None:
        """Those of one space, or of both."""
        if space != "wrist":
            self.carrier.publish()
        if space == "carrier":
            return
        body, put = self.body, self.wrist.put
        put("pitch", [3000, 3001] if "foreign" in self.faults else body.positions())  # yaw lies behind it
        # The register table has #2 before #1; the CAN example calls 1024 the first (wrist §2.1, §2.3.1: open).
        put("current-2", body.currents()[::-1])
        for number, actuator in enumerate(body.actuators, 1):
            put(f"error-{number}", [actuator.error()])
        put("temperature-1", [max(0, min(255, int(actuator.degrees + 0.0001))) for actuator in body.actuators])


# -- wires -----------------------------------------------------------------------------------------------------------

_OPTIONS = {
    **OPTIONS,
    **SERIAL_OPTIONS,
    "gap": ((0.1, 3600.0), "seconds of silence after which an unfinished request is forgotten (default 0.1)"),
}
_FAULTS = {**FAULTS, "no-late-frames": "no save result, no end of a calibration"}


class Device(Serial, Module):
    """The module on its serial wire."""

    OPTIONS = Rows(_OPTIONS)
    FAULTS = _FAULTS
    SPEEDS = (115200, 57600, 19200)  # speed codes 0, 1, 2 (RH56)
    FLAGS = {17: ("carrier", False), 18: ("carrier", True), 48: ("wrist", False), 49: ("wrist", True)}  # noqa: RUF012

    def saved(self, hits: frozenset[str]) -> None:
        self.tell_saved(self.now + self.SAVE_TIME, 1005, hits)

    def calibrates(self, end: float, hits: frozenset[str]) -> None:
        self.tell_calibrated(end, hits)


_CAN_OPTIONS = {
    **OPTIONS,
    "id": ((1, 0, 16383), "id at the first start, 0..16383 (default 1)"),
    "bitrate": (("1000000", "500000"), "bitrate at the first start: 1000000 (default) or 500000"),
    "ack-dlc": (False, "data bytes of a write's acknowledgement: 0 (default), or 1 with the number of bytes written"),
}


class CanDevice(Can, Module):
    """The module on its CAN bus: flag 4 reads the wrist, 5 writes it, 0 and 1 the hand."""

    OPTIONS = Rows(_CAN_OPTIONS)
    SPEED = "bitrate"
    SPEEDS = (1000000, 500000)  # wrist §2.3; the second speed code is that of the RH56 on CAN
    FLAGS = {0: ("carrier", False), 1: ("carrier", True), 4: ("wrist", False), 5: ("wrist", True)}  # noqa: RUF012

    def ack(self, written: int) -> bytes:
        """The manual's acknowledgement is empty and so cannot tell a refusal: only reading back does (open)."""
        return bytes([written] if self.given["ack-dlc"] else [])
