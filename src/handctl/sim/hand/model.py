"""One simulated RH56 hand without its wires: registers, flash, triggers, readings (RH56 dossier §3, §6, §10).

Several wires may lead to it at once. Addresses are bytes here, also those of F1 and DG2 (books.py). Written from the dossier
alone, by other means than the host. Where it says "open" the behaviour is invented and an option has the other one; nothing
seen here is evidence about a real hand.
"""

from __future__ import annotations

import struct

from handctl.sim.hand import books, tactile
from handctl.sim.hand.body import Body
from handctl.sim.hand.books import FACTORY_ADDRESS, MEMORY
from handctl.sim.hand.finger import Finger
from handctl.sim.hand.options import ALL_FAULTS, LATCHED
from handctl.sim.inspire.space import Space

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.engine.model import Random
    from handctl.sim.hand.setup import Setup
    from handctl.sim.inspire.space import Rows

RESERVED = (1003, 1007, 1008)  # of DF and TP: nothing is known to be there, or fingers move (dossier §3.1)
ACTS = (
    "clear", "save", "factory-reset", "calibrate", "run", "gesture", "reserved",
    "move", "speed", "force", "settings", "id", "baud", "ip", "stop",
)  # fmt: skip
"""What a hand can be made to do; each is counted."""
DANGERS = ("factory-reset", "run", "gesture", "reserved")


class Hand:
    """A hand that has been used a while when it is found, or came out of a power-on."""

    def __init__(self, setup: Setup, random: Random) -> None:
        self.setup = setup
        self.generation = generation = setup.generation
        self.now = 0.0
        self.powered = False
        self.dirty = False
        self.faults: frozenset[str] = frozenset()
        self.acts = dict.fromkeys(ACTS, 0)
        self.events: list[tuple[str, float]] = []  # "saved" or "calibrated", and when its end is told
        self.speed_place = generation.places["speed"] - (1 if setup.other_speed and generation.unit == 1 else 0)
        self.space = Space(self._rows(), MEMORY)
        rate = [(ends[1] - ends[0]) / generation.full / generation.fast for ends in generation.ends]
        fingers = [
            Finger(ends, setup.readings[number], rate[number], setup.limit)
            for number, ends in enumerate(generation.ends)
        ]
        self.body = Body(random, generation, setup.jitter, fingers)
        if setup.thing is not None:
            for finger in fingers:
                finger.place(finger.closed + finger.span * setup.thing / 1000.0)
        self._used = True  # it was used a while since its power-on, before it is found
        self.number = setup.number
        self.speed_code = 0  # the one in force
        self.address = setup.address  # the one in force
        self.flash_number, self.flash_code, self.flash_address = self.number, 0, self.address
        self.kept = {word: setup.golden[word] for word in self._kept_words()}
        self.connections = 0  # clients that came over the network so far
        self._told = 0.0  # when the readings were refreshed
        self.felt: object = None  # what the skin in memory shows

    def _rows(self) -> Rows:
        """Those of the generation; the speed code at its other place, and the gestures of older firmware."""
        places = self.generation.places
        rows = [(self.speed_place, *row[1:]) if row[0] == places["speed"] else row for row in self.generation.rows]
        if self.setup.gestures and "gesture" in places:
            rows.append((places["gesture"], 1, 1, "rw", 0, 40))
        return tuple(rows)

    def _kept_words(self) -> list[str]:
        words = ["current-limit", "default-speed", "default-force"]
        words += ["angle-set", "force-set", "speed-set"] if self.setup.saves_all else []
        return [word for word in words if word in self.generation.places]

    # -- values by meaning ------------------------------------------------------------------------------------------------

    def values(self, word: str) -> tuple[int, ...]:
        """What a group of signed words shows."""
        place, count = self.generation.places[word], self.generation.count
        return struct.unpack_from(f"<{count}h", self.space.memory, place)

    def put(self, word: str, values: tuple[int, ...] | list[int]) -> None:
        """Fills a group, of bytes or words as its row has it."""
        if word in self.generation.places:
            layout = "B" if self.generation.size_of[word] == 1 else "h" if min(values) < 0 else "H"
            struct.pack_into(f"<{len(values)}{layout}", self.space.memory, self.generation.places[word], *values)

    # -- power, time, faults ----------------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        self.now = self.body.now = self._told = now

    def advance(self, now: float) -> None:
        self.now = now
        if self.setup.refresh > 0.0:
            told = self._told + int((now - self._told) / self.setup.refresh + 0.000001) * self.setup.refresh
            if told > self._told:
                self._told = told
                self.body.advance(told)
                self.publish()
        self.body.advance(now)

    def elapse(self, seconds: float) -> None:
        """All movements have ended."""
        self.body.advance(self.body.now + max(seconds, 60.0))
        self.publish()

    def power(self, on: bool) -> None:
        """Id, speed and IP address come from flash, nothing moves by itself, no finger was commanded (dossier §6)."""
        self.powered = on
        self.events.clear()
        self.body.power_on()
        if not on:
            return
        self.space.memory, self.felt = bytearray(MEMORY), None
        self.number, self.speed_code, self.address = self.flash_number, self.flash_code, self.flash_address
        self.put("id", [self.number])
        self.space.memory[self.speed_place] = self.flash_code
        if "voltage" in self.generation.places:
            self.put("voltage", [self.setup.voltage])
        if "address" in self.generation.places:
            self.put("address", list(self.address))
        if (self._used or self.setup.stays) and "fresh" not in self.faults:
            self._start({"speed-set": self.kept["default-speed"], **self.setup.golden, **self.kept})
        else:
            self._fresh()
        self._used = False
        self.set_faults(self.faults)
        if "hot" in self.faults:
            for number, finger in enumerate(self.body.fingers):
                finger.set_temperature(finger.limit + 1.0 + number)
        self.publish()
        self.dirty = True

    def _start(self, values: dict[str, tuple[int, ...]]) -> None:
        for word, row in values.items():
            self.put(word, row)
        self.use_set_values()

    def _fresh(self) -> None:
        """Behind a power-on: what was kept, speeds and force limits from their defaults, nothing commanded."""
        none = (-1,) * self.generation.count
        if "fresh" in self.faults:
            self.kept = {**self.kept, **self.setup.factory}
        values = {"stroke-set": none, "angle-set": none, **self.kept}
        values.setdefault("speed-set", self.kept["default-speed"])
        values.setdefault("force-set", self.kept["default-force"])
        self._start(values)
        for finger in self.body.fingers:
            finger.state = books.NEVER_COMMANDED

    def use_set_values(self) -> None:
        """Tells the fingers what memory says of speeds and limits."""
        limits = self.values("current-limit") if "current-limit" in self.generation.places else None
        for number, finger in enumerate(self.body.fingers):
            finger.speed, finger.force_limit = self.values("speed-set")[number], self.values("force-set")[number]
            finger.current_limit = limits[number] if limits else 0

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        for number, finger in enumerate(self.body.fingers):
            if "blocked" in faults or "blocked" in before:
                finger.blocked = "blocked" in faults
            finger.stubborn = "force-deaf" in faults
            finger.short = 0.046 * finger.span if "stops-short" in faults and number == 1 else 0.0
            byte = ALL_FAULTS[number] if "faults" in faults and number < len(ALL_FAULTS) else 0
            for name, (place, bits) in LATCHED.items():
                byte |= bits if name in faults and place == number else 0
            finger.errors |= byte & ~2
            if byte & 2:
                finger.overheat()
            else:
                finger.cool_down()
        self.publish()

    # -- requests ---------------------------------------------------------------------------------------------------------

    def read(self, address: int, count: int) -> bytes | None:
        """The bytes, or None: silence."""
        if "block-silent" in self.faults and not self.space.documented(address, count):
            return None
        if self.setup.refresh <= 0.0:
            self.publish()
        return self.space.read(address, count)

    def write(self, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """Whether the write is accepted, or None: silence.

        Gaps, read-only bytes and values out of range are ignored but acknowledged (open), or met with silence in the state
        "strict".
        """
        accepted, covered = self.space.plan(address, data, self.setup.unchecked)
        if self.generation.unit == 1:
            self.acts["reserved"] += sum(
                place == address or (address < place < address + len(data) and data[place - address] != 0)
                for place in RESERVED
            )
        if "strict" in self.faults and covered < len(data):
            return None
        if "refuse" in hits:
            return False
        self.dirty = True
        for place, value, raw in accepted:
            self._store(place, value, raw)
        return True

    def _store(self, place: int, value: int, raw: bytes) -> None:
        """One register element that was written with a value that it takes."""
        places, words = self.generation.places, range(0, 2 * self.generation.count, 2)
        for word in ("clear", "save", "reset", "calibrate", "gesture", "run", "run-built-in"):
            if places.get(word) == place:
                if value:
                    self._trigger(word)
                return
        found = next((word for word, first in places.items() if place - first in words and word in _GROUPS), "")
        if value == -1 and self.setup.keeps and found in _SET:
            return
        self.space.memory[place : place + len(raw)] = raw
        number = (place - places[found]) // 2 if found else 0
        finger = self.body.fingers[number]
        if place == places["id"]:
            self.acts["id"] += 1
            self.number = value
        elif place == self.speed_place:
            self.acts["baud"] += 1
        elif 0 <= place - places.get("address", -1000) < 4:
            self.acts["ip"] += 1
        elif place == places.get("stop"):
            self.acts["stop"] += 1
            self.body.stop(value == 1)
        elif found in _SET and not 0 <= value <= self.generation.most(found):
            return
        elif found == "angle-set":
            self._move(number, float(value))
        elif found == "stroke-set":
            self._move(number, finger.open - finger.span * value / 2000.0)
        elif found == "speed-set":
            self.acts["speed"] += 1
            self.body.use_speed(number, value)
        elif found == "force-set":
            self.acts["force"] += 1
            self.body.use_force(number, value)
        else:
            self.acts["settings"] += 1
            finger.current_limit = value if found == "current-limit" else finger.current_limit

    def _move(self, number: int, angle: float) -> None:
        """Acts at once, also with the same value again; beyond its ends a finger does not go."""
        self.acts["move"] += 1
        finger = self.body.fingers[number]
        self.body.command(number, max(float(finger.closed), min(float(finger.open), angle)), self.setup.dead_time)

    def _trigger(self, word: str) -> None:
        self.acts[{"reset": "factory-reset", "run-built-in": "run"}.get(word, word)] += 1
        if word == "clear":
            for finger in self.body.fingers:
                finger.clear()
            self.publish()
        elif word == "save":
            self._save()
            self.events.append(("saved", self.now + 1.0))
        elif word == "reset":
            self._reset()
        elif word == "calibrate":
            self.events.append(("calibrated", self.body.calibrate(self.setup.calibration, self.setup.still)))
        else:  # a stored action or a gesture: what it holds is not known, so all fingers close half
            for number, finger in enumerate(self.body.fingers):
                self.body.command(number, finger.open - finger.span / 2.0, self.setup.dead_time)

    def _save(self) -> None:
        """Flash is written at once, so that a client that leaves before the result finds it saved."""
        if "save-fails" in self.faults:
            return
        self.flash_number = self.number
        if self.setup.saves_speed:
            self.flash_code = self.space.memory[self.speed_place]
        if "address" in self.generation.places:
            place = self.generation.places["address"]
            self.flash_address = tuple(self.space.memory[place : place + 4])
        self.kept = {word: self.values(word) for word in self._kept_words()}

    def _reset(self) -> None:
        """Id at once, speed and IP address with the next power-on; what else is kept comes back too (open)."""
        self._start(self.setup.factory)
        self.number = 1
        self.put("id", [1])
        self.space.memory[self.speed_place] = 0
        if "address" in self.generation.places:
            self.put("address", list(FACTORY_ADDRESS))
        if self.setup.resets_flash:
            self._save()

    # -- readings ---------------------------------------------------------------------------------------------------------

    def publish(self) -> None:
        """Puts the readings of this moment into memory."""
        body, generation = self.body, self.generation
        body.jitters()
        self.put("stroke", body.strokes())
        self.put("angle", [3000 + n for n in range(generation.count)] if "foreign" in self.faults else body.angles())
        self.put("force", body.forces())
        self.put("current", body.currents())
        self.put("error", body.errors())
        self.put("status", body.statuses())
        self.put("temperature", body.temperatures())
        presses = [finger.pressed() for finger in body.fingers]
        if "tactile" in generation.places:
            dead, saturated = "tactile-dead" in self.faults, "tactile-saturated" in self.faults
            if self.felt != (felt := (presses, dead, saturated)):
                self.put("tactile", tactile.skin(presses, dead, saturated, self.setup.quiet))
                self.felt = felt
        elif "touch" in generation.places:
            self.put("touch", tactile.words(presses))


_SET = ("stroke-set", "angle-set", "force-set", "speed-set")
_GROUPS = (*_SET, "current-limit", "default-speed", "default-force")
