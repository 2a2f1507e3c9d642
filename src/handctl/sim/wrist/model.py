"""A simulated Inspire wrist module and the hand that carries it, without its wire (wrist §2.1, RH56 §2.4).

Both address spaces, flash, power and error states, the same behind the serial line (device.py) and behind CAN
(can.py). Where the manual is silent the behaviour is invented and the comment says so; nothing seen here is
evidence about a real wrist.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Model, Options, Random
from handctl.sim.hand.model import Hand
from handctl.sim.inspire.space import Space
from handctl.sim.wrist.body import PITCH, YAW, Body
from handctl.sim.wrist.memory import WRIST, carrier, power_on_wrist

TYPE_CHECKING = False
if TYPE_CHECKING:
    pass

LATCHED = {  # fault -> (actuator, error byte)
    "locked-rotor": (0, 1),
    "over-temperature": (1, 2),
    "over-current": (0, 4),
    "motor-abnormal": (1, 8),
    "communication": (0, 16),
    "unknown-bits": (1, 160),
}
OF_HAND = frozenset(("strict", "save-fails"))  # what its requests meet too
ALL_FAULTS = (1, 4)  # error bytes of the state "faults"

OPTIONS = {
    "bus": "serial (RS-232 or RS-485, default) or can",
    "jitter": "1: currents jitter also at rest",
    "limit": "temperature in °C that sets the over-temperature error (default 70)",
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
    "locked-rotor": "error bit 0 on actuator 1",
    "over-temperature": "error bit 1 on actuator 2, which stays hot",
    "over-current": "error bit 2 on actuator 1",
    "motor-abnormal": "error bit 3 on actuator 2",
    "communication": "error bit 4 on actuator 1",
    "unknown-bits": "error bits 5 and 7 on actuator 2",
}


class Module(Model):
    """Wrist and hand. The id, the speed and what is kept live in the hand's space: the wrist's manual has none."""

    KIND = "wrist"
    USE = "handctl.sim.wrist.use"
    CONTROL = "handctl.sim.wrist.control"
    OPTIONS = OPTIONS
    FAULTS = FAULTS
    SPEEDS: tuple[int, ...] = ()  # bit/s by speed code
    IDS = (1, 254)

    def __init__(self, options: Options, random: Random, speed_code: int) -> None:
        super().__init__(options, random)
        options.choice("bus", "serial", ("serial", "can"))
        self.id = options.integer("id", 1, *self.IDS)
        self.flash = {"id": self.id, "speed_code": speed_code}
        self.speed_code = speed_code  # the one in force
        jitter = options.choice("jitter", "0", ("0", "1")) == "1"
        self.body = Body(random, jitter, float(options.integer("limit", 70, 40, 100)))
        self.wrist = Space(WRIST)
        self.carrier = Hand(carrier(), random)
        self.hand = self.carrier.space

    # -- power, time, faults ----------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.body.now = now
        self.carrier.boot(now)

    def advance(self, now: float) -> None:
        self.now = now
        self.body.advance(now)
        self.carrier.advance(now)

    def elapse(self, seconds: float) -> None:
        self.body.advance(self.body.now + max(seconds, self.body.left))
        self.carrier.elapse(seconds)

    def power(self, on: bool) -> None:
        """Id and speed come from flash, set values start anew, late frames are gone; angles and heat stay."""
        self.publish()
        self.powered = on
        self._replies.clear()
        self.body.power_on()
        self.carrier.power(on)
        if not on:
            return
        power_on_wrist(self.wrist)
        self.use_id(self.flash["id"])
        self.hand.memory[1002] = self.flash["speed_code"]
        self.use_speed(self.flash["speed_code"])
        self.set_faults(self.faults)
        if "hot" in self.faults:
            for number, actuator in enumerate(self.body.actuators):
                actuator.set_temperature(actuator.limit + 1.0 + number)
        self.dirty = True

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        self.carrier.faults = faults & OF_HAND
        body = self.body
        if "blocked" in faults:
            body.blocked = [True, True]
        elif "blocked" in before:
            body.release(PITCH)
            body.release(YAW)
        for number, actuator in enumerate(body.actuators):
            byte = ALL_FAULTS[number] if "faults" in faults else 0
            for name, (place, bits) in LATCHED.items():
                if name in faults and place == number:
                    byte |= bits
            actuator.errors |= byte & ~2
            if byte & 2:
                actuator.overheat()
            else:
                actuator.cool_down()

    def use_id(self, number: int) -> None:
        """Acts at once. The id register has one byte, an id on CAN may have 14 bits: only the low ones show (open)."""
        self.id = number
        self.hand.memory[1000] = number % 256

    def use_speed(self, code: int) -> None:
        self.speed_code = code
        self.speed = self.SPEEDS[code]

    # -- requests ---------------------------------------------------------------------------------------------------

    def read(self, space: Space, address: int, count: int) -> bytes | None:
        """The bytes, or None: silence."""
        if space is self.wrist and "no-wrist" in self.faults:
            return None
        if "block-silent" in self.faults and not space.documented(address, count):
            return None
        if space is self.hand:
            self.carrier.publish()
        else:
            self._publish_wrist()
        return space.read(address, count)

    def write(self, space: Space, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """Whether the write is accepted, or None: silence.

        Gaps, read-only bytes and values out of range are ignored but acknowledged (open on hardware), or met with
        silence in the state "strict".
        """
        if space is self.hand:
            return self._write_hand(address, data, hits)
        if "no-wrist" in self.faults:
            return None
        accepted, covered = space.plan(address, data)
        if "strict" in self.faults and covered < len(data):
            return None
        if "refuse" in hits:
            return False
        self.dirty = True
        for place, _, raw in accepted:
            space.memory[place : place + len(raw)] = raw
        self._move({place: value for place, value, _ in accepted})
        return True

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
                    self.flash = {"id": self.id, "speed_code": self.hand.memory[1002]}
                self.saved(hits)
            else:
                self.calibrates(when, hits)
        hand.events.clear()
        return done

    def _move(self, values: dict[int, int]) -> None:
        """The time of the same write counts for its angles; a time alone is for the next movement (open)."""
        targets = {axis: values[place] for axis, place in ((YAW, 1038), (PITCH, 1040)) if place in values}
        if targets:
            self.body.move(targets, struct.unpack_from("<H", self.wrist.memory, 1042)[0] / 1000.0)

    def saved(self, hits: frozenset[str]) -> None:
        """A save was tried; a wire that reports the result overrides this."""

    def calibrates(self, end: float, hits: frozenset[str]) -> None:
        """The hand's calibration has begun and ends then; a wire that reports the end overrides this."""

    def publish(self) -> None:
        """Puts the readings of this moment into memory."""
        self.carrier.publish()
        self._publish_wrist()

    def _publish_wrist(self) -> None:
        body, memory = self.body, self.wrist.memory
        pitch, yaw = (3000, 3001) if "foreign" in self.faults else body.positions()
        struct.pack_into("<hh", memory, 1020, pitch, yaw)
        first, second = body.currents()
        # The register table has #2 before #1; the CAN example calls 1024 the first (wrist §2.1, §2.3.1: open).
        struct.pack_into("<hh", memory, 1024, second, first)
        memory[1028], memory[1030] = body.errors()
        memory[1032], memory[1033] = body.temperatures()
