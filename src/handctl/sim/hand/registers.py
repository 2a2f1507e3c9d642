"""One simulated RH56 hand without its wires: registers, flash, triggers, readings, skin (RH56 dossier §3, §6, §10).

Several wires may lead to it at once. Addresses are bytes here, also those of F1 and DG2 (register_maps.py). Written from the dossier
alone, by other means than the host. Where it says "open" the behaviour is invented and an option has the other one; nothing
seen here is evidence about a real hand.
"""

from __future__ import annotations

import struct
from functools import lru_cache

from handctl.number_parsing import number_in
from handctl.sim.engine.simulated_device import Model, Options, Random
from handctl.sim.hand import MODELS, register_maps
from handctl.sim.hand.fingers import FULL_STROKE, Body, Finger
from handctl.sim.hand.register_maps import FACTORY_ADDRESS, GENERATIONS, MEMORY, Generation
from handctl.sim.inspire.actuator_faults import apply_faults, fault_help, start_hot
from handctl.sim.inspire.frames import Asked
from handctl.sim.inspire.memory import Space

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from handctl.sim.inspire.memory import Rows

OPTIONS = {
    "model": (("tp", MODELS), f"generation: {', '.join(MODELS)} (default tp)"),
    "bus": (("serial", ("serial", "modbus-tcp", "can")), "serial (EB90 and Modbus RTU, default), modbus-tcp (tp only) or can"),
    "id": ((1, 1, 254), "id at the first start, 1..254 (default 1)"),
    "ip": (None, "IP address at the first start (tp, default 192.168.11.210). With that of --modbus-tcp, the server moves with it"),
    "speed": (None, "speed of all fingers at the first start, as one that a program left there (default 601 to 606)"),
    "object": ((None, 0, 1000), "thousandths of the way (0 closed, 1000 open) at which all fingers touch something soft"),
    "refresh": ((0.0307, 60.0), "seconds from one refresh of the readings to the next (default 0.0307)"),
    "dead-time": ((0.066, 60.0), "seconds from a command to its movement (default 0.066)"),
    "calibration": ((6.0, 3600.0), "seconds that a calibration takes (default 6)"),
    "calibration-moves": (True, "1: a calibration moves all fingers (default), 0: the hand must be open, and stays still (open)"),
    "minus-one": (("stored", "kept"), "a written -1 is stored (default), or the old set value is kept (open). The finger stays as it is"),
    "out-of-range": (("ignored", "stored"), "a value out of range is ignored (default), or stored as it is (open)"),
    "set-points-kept": (False, "1: a save keeps angles, force limits and speeds too (open, default 0)"),
    "baud-kept": (True, "0: a save does not keep the baud rate code (editions differ, default 1)"),
    "baud-register": (("1002", "1001"), "1002 (default), or 1001 as some code has it (df and tp, open)"),
    "reset": (("flash", "ram"), "a factory reset changes flash (default), or ram only until a save (open)"),
    "gestures": (False, "1: a number written to 1008 moves the fingers, as in older firmware (df and tp, default 0)"),
    "tactile": (("numbered", "quiet"), "numbered (default: value i at index i) or quiet (0 where nothing is touched)"),
    "jitter": (False, "1: force, current and position jitter also at rest"),
    "limit": ((70, 40, 100), "temperature in °C that sets the over-temperature error (default 70)"),
}  # fmt: skip
SERIAL_OPTIONS = {
    "baud": (None, "baud rate at the first start: one of the model's (default 115200)"),
    "speaks": (("both", "eb90", "modbus"), "both (EB90 and Modbus RTU, default), eb90 or modbus"),
    "ack-id": (("new", "old"), "the acknowledgement of an id change carries the id: new (default) or old"),
    "result-flag": (("17", "18"), "flag of the save result: 17 (11 hex, default) or 18 (12 hex)"),
    "result-address": (("own", "1005"), "address in the save result: own (default) or 1005, on f1 and dg2 (one print)"),
    "gap": ((0.1, 3600.0), "seconds of silence after which an unfinished request is forgotten (default 0.1)"),
    "silence": ((0.00175, 1.0), "seconds of silence before and after a Modbus RTU request (default 0.00175)"),
}
MODBUS_OPTIONS = {
    "most-written": (("120", "123"), "most registers that one Modbus request writes: 120 (default) or 123 (editions differ)"),
}  # fmt: skip
CAN_OPTIONS = {
    "bitrate": (("1000000", "500000"), "bitrate at the first start: 1000000 (default) or 500000"),
    "ack": (("count", "empty"), "acknowledgement of a write: count (the bytes written, default) or empty"),
}

FAULTS = {
    "strict": "silence, or a Modbus exception, for a write of anything that cannot be written or is out of range",
    "block-silent": "silence for reads that touch undocumented bytes, on Modbus exception 2",
    "save-fails": "flash stays as it was, and the save result is FF",
    "fresh": "never commanded since power-on: status 255, set values -1",
    "foreign": "the registers do not look like this device (angles out of range)",
    "faults": "error bytes 01 02 04 06 18 00",
    "hot": "all fingers start above the limit and cool down",
    "blocked": "no finger can move",
    **fault_help([f"the {which} finger" for which in ("first", "second", "third", "fourth", "fifth")]),
    "force-deaf": "a finger at its force limit takes no command until the limit is another",
    "stops-short": "the second finger closes to 46 thousandths before its end, without an error",
    "tactile-dead": "zones without a sign of life: middle tip, thumb, palm",
    "tactile-saturated": "tactile values that are invalid (65280 and above)",
}
MODBUS_FAULTS = {"high-half": "the bytes of error, status and temperature words are swapped"}
SERIAL_FAULTS = {
    "rtu-unpacked": "Modbus RTU shows one error, status or temperature in each register",
    "no-late-frames": "no save result, no end of a calibration",
}
TCP_FAULTS = {
    "txid-off": "answers carry the transaction id of the request before",
    "twin-ip": "another hand has the same address and answers every second client, its readings a little different",
    "two-clients-drop": "a second client makes the hand drop the first",
}
ALL_FAULTS = (1, 2, 4, 6, 24, 0)  # error bytes of the state "faults" (dossier V14)

Values = dict[str, tuple[int, ...]]
RESERVED = (1003, 1007, 1008)  # of DF and TP: nothing is known to be there, or fingers move (dossier §3.1)
ACTS = (
    "clear", "save", "factory-reset", "calibrate", "run", "gesture", "reserved",
    "move", "speed", "force", "settings", "id", "baud", "ip", "stop",
)  # fmt: skip
"""What a hand can be made to do; each is counted."""


class Hand:
    """A hand that has been used a while when it is found, or came out of a power-on."""

    def __init__(
        self,
        generation: Generation,
        given: dict[str, Any],
        random: Random,
        golden: Values,
        readings: list[register_maps.Found],
        factory: Values,
        stays: bool = False,
    ) -> None:
        """`given` are the options. `golden` are the set values and `readings` the readings (register_maps.py) of the hand as it is
        found, also behind every power-on when it `stays` so; `factory` are its settings after a factory reset."""
        self.generation, self.given, self.golden, self.factory, self.stays = generation, given, golden, factory, stays
        self.now = 0.0
        self.powered = False
        self.dirty = False
        self.faults: frozenset[str] = frozenset()
        self.acts = dict.fromkeys(ACTS, 0)
        self.events: list[tuple[str, float]] = []  # "saved" or "calibrated", and when its end is told
        self.space = Space(self._rows(), MEMORY)
        fingers = [
            Finger(
                ends, found, (ends[1] - ends[0]) / FULL_STROKE[generation.name] / generation.fast, float(given["limit"])
            )
            for ends, found in zip(generation.ends, readings, strict=True)
        ]
        self.body = Body(random, generation, given["jitter"], fingers)
        if given["object"] is not None:
            for finger in fingers:
                finger.place(finger.closed + finger.span * given["object"] / 1000.0)
        self._used = True  # it was used a while since its power-on, before it is found
        self.number: int = given["id"]
        self.speed_code = 0  # the one in force
        self.address = _address(given["ip"])  # the one in force
        self.flash_number, self.flash_code, self.flash_address = self.number, 0, self.address
        words = ["current-limit", "default-speed", "default-force"]
        words += ["angle-set", "force-set", "speed-set"] if given["set-points-kept"] else []
        self.kept = {word: golden[word] for word in words if word in generation.words}
        self.connections = 0  # clients that came over the network so far
        self._told = 0.0  # when the readings were refreshed
        self.felt: object = None  # what the skin in memory shows

    def _rows(self) -> Rows:
        """Those of the generation; the speed code at its other place, and the gestures of older firmware."""
        old = self.generation.unit == 1
        other = self.given["baud-register"] == "1001" and old
        rows = [("speed", row[1] - 1, *row[2:]) if other and row[0] == "speed" else row for row in self.generation.rows]
        if self.given["gestures"] and old:
            rows.append(("gesture", 1008, 1, 1, "rw", 0, 40))
        return tuple(rows)

    # -- values by meaning ------------------------------------------------------------------------------------------------

    def values(self, word: str) -> tuple[int, ...]:
        """What a group of signed words shows."""
        return struct.unpack_from(f"<{self.generation.count}h", self.space.memory, self.space.place(word))

    def code(self) -> int:
        """The speed code in memory."""
        return self.space.memory[self.space.place("speed")]

    # -- power, time, faults ----------------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        self.now = self.body.now = self._told = now

    def advance(self, now: float) -> None:
        self.now = now
        if (refresh := self.given["refresh"]) > 0.0:
            told = self._told + int((now - self._told) / refresh + 0.000001) * refresh
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
        self.space.clear()
        self.felt = None
        self.number, self.speed_code, self.address = self.flash_number, self.flash_code, self.flash_address
        self.space.put("id", [self.number])
        self.space.memory[self.space.place("speed")] = self.flash_code
        self.space.put("voltage", [register_maps.VOLTAGE])
        self.space.put("address", self.address)
        if (self._used or self.stays) and "fresh" not in self.faults:
            self._start({"speed-set": self.kept["default-speed"], **self.golden, **self.kept})
        else:
            self._fresh()
        self._used = False
        self.set_faults(self.faults)
        start_hot(self.body.fingers, self.faults)
        self.publish()
        self.dirty = True

    def _start(self, values: dict[str, tuple[int, ...]]) -> None:
        for word, row in values.items():
            self.space.put(word, row)
        self.use_set_values()

    def _fresh(self) -> None:
        """Behind a power-on: what was kept, speeds and force limits from their defaults, nothing commanded."""
        none = (-1,) * self.generation.count
        if "fresh" in self.faults:
            self.kept = {**self.kept, **self.factory}
        values = {"stroke-set": none, "angle-set": none, **self.kept}
        values.setdefault("speed-set", self.kept["default-speed"])
        values.setdefault("force-set", self.kept["default-force"])
        self._start(values)
        for finger in self.body.fingers:
            finger.state = register_maps.NEVER_COMMANDED

    def use_set_values(self) -> None:
        """Tells the fingers what memory says of speeds and limits."""
        speeds, forces = self.values("speed-set"), self.values("force-set")
        limits = self.values("current-limit") if "current-limit" in self.space.row else (0,) * len(speeds)
        for finger, *said in zip(self.body.fingers, speeds, forces, limits, strict=True):
            finger.speed, finger.force_limit, finger.current_limit = said

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        for number, finger in enumerate(self.body.fingers):
            if "blocked" in faults or "blocked" in before:
                finger.blocked = "blocked" in faults
            finger.stubborn = "force-deaf" in faults
            finger.short = 0.046 * finger.span if "stops-short" in faults and number == 1 else 0.0
        apply_faults(self.body.fingers, faults, ALL_FAULTS)

    # -- requests ---------------------------------------------------------------------------------------------------------

    def read(self, address: int, count: int) -> bytes | None:
        """The bytes, or None: silence."""
        if "block-silent" in self.faults and not self.space.documented(address, count):
            return None
        if self.given["refresh"] <= 0.0:
            self.publish()
        return self.space.read(address, count)

    def write(self, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """Whether the write is accepted, or None: silence.

        Gaps, read-only bytes and values out of range are ignored but acknowledged (open), or met with silence in the state
        "strict".
        """
        accepted, covered = self.space.plan(address, data, self.given["out-of-range"] == "stored")
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
        for element in accepted:
            self._store(*element)
        return True

    def _store(self, word: str, number: int, value: int, place: int, raw: bytes) -> None:
        """One register element that was written with a value that it takes."""
        if word in _TRIGGERS:
            if value:
                self._trigger(word)
            return
        if value == -1 and self.given["minus-one"] == "kept" and word in _SET:
            return
        self.space.store(place, raw)
        act = {"id": "id", "speed": "baud", "address": "ip", "stop": "stop"}.get(word, "settings")
        if word in _SET:
            if not 0 <= value <= self.generation.most(word):
                return
            act = {"speed-set": "speed", "force-set": "force"}.get(word, "move")
        self.acts[act] += 1
        finger = self.body.fingers[number] if number < self.generation.count else self.body.fingers[0]
        if word == "id":
            self.number = value
        elif word == "stop":
            self.body.stop(value == 1)
        elif word == "angle-set":
            self._move(number, float(value))
        elif word == "stroke-set":
            self._move(number, finger.open - finger.span * value / 2000.0)
        elif word == "speed-set":
            self.body.use_speed(number, value)
        elif word == "force-set":
            self.body.use_force(number, value)
        elif word == "current-limit":
            finger.current_limit = value

    def _move(self, number: int, angle: float) -> None:
        """Acts at once, also with the same value again; beyond its ends a finger does not go."""
        finger = self.body.fingers[number]
        self.body.command(number, max(float(finger.closed), min(float(finger.open), angle)), self.given["dead-time"])

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
            self.events.append(
                ("calibrated", self.body.calibrate(self.given["calibration"], self.given["calibration-moves"]))
            )
        else:  # a stored action or a gesture: what it holds is not known, so all fingers close half
            for number, finger in enumerate(self.body.fingers):
                self.body.command(number, finger.open - finger.span / 2.0, self.given["dead-time"])

    def _save(self) -> None:
        """Flash is written at once, so that a client that leaves before the result finds it saved."""
        if "save-fails" in self.faults:
            return
        self.flash_number = self.number
        if self.given["baud-kept"]:
            self.flash_code = self.code()
        if "address" in self.space.row:
            place = self.space.place("address")
            self.flash_address = tuple(self.space.memory[place : place + 4])
        self.kept = {word: self.values(word) for word in self.kept}

    def _reset(self) -> None:
        """Id at once, speed and IP address with the next power-on; what else is kept comes back too (open)."""
        self._start(self.factory)
        self.number = 1
        self.space.put("id", [1])
        self.space.memory[self.space.place("speed")] = 0
        self.space.put("address", FACTORY_ADDRESS)
        if self.given["reset"] == "flash":
            self._save()

    # -- readings ---------------------------------------------------------------------------------------------------------

    def publish(self) -> None:
        """Puts the readings of this moment into memory."""
        self.body.jitters()
        for word, values in self.body.readings("foreign" in self.faults):
            self.space.put(word, values)
        row = self.space.row
        presses = tuple(finger.pressed() for finger in self.body.fingers if "tactile" in row or "touch" in row)
        if "tactile" in row:
            dead, saturated = "tactile-dead" in self.faults, "tactile-saturated" in self.faults
            if self.felt != (felt := (presses, dead, saturated)):
                shown = skin(presses, dead, saturated, self.given["tactile"] == "quiet")
                self.space.store(self.space.place("tactile"), shown)
                self.felt = felt
        elif presses:
            self.space.put("touch", touched(presses))


_SET = ("stroke-set", "angle-set", "force-set", "speed-set")
_TRIGGERS = ("clear", "save", "reset", "calibrate", "gesture", "run", "run-built-in")


def from_options(options: Options, given: dict[str, Any], random: Random) -> Hand:
    """The golden hand of a generation, with what the options say."""
    generation = GENERATIONS[given["model"]]
    golden = register_maps.golden(generation)
    if given["speed"] is not None:
        golden["speed-set"] = (options.integer("speed", 0, 0, generation.fast),) * generation.count
    readings = [register_maps.readings(generation, number) for number in range(generation.count)]
    return Hand(generation, given, random, golden, readings, register_maps.factory(generation))


def _address(text: str | None) -> tuple[int, ...]:
    if text is None:
        return FACTORY_ADDRESS
    parts = text.split(".")
    numbers = [number for part in parts if (number := number_in(part)) is not None and number < 256]
    if len(parts) != 4 or len(numbers) != 4:
        raise ValueError(f"option ip={text}: not an IP address, as 192.168.11.210")
    return tuple(numbers)


# What the skin feels: 17 zones of a TP, 34 words of F1 and DG2 (dossier §3.4, §3.2). A hand that touches nothing shows value i
# at index i, so that a swap is seen (dossier §10); what a finger grasps is added. Where on a zone an object lies is invented: in
# its middle, weaker towards the edge.
MOST = 4095
INVALID = 65535  # at 65280 and above a value is saturated or invalid (dossier §3.4)
VALUES = 1062
FINGER = ((3, 3), (12, 8), (10, 8))  # rows and columns of tip, nail, pad
THUMB = ((3, 3), (12, 8), (3, 3), (12, 8))  # tip, nail, middle, pad
PALM = (8, 14)


def _zones() -> list[tuple[int, int, int, int]]:
    """(finger 0..4 or 5 = palm, index of the first value, rows, columns), in the order of the addresses."""
    zones, first = [], 0
    for finger, shapes in enumerate((FINGER, FINGER, FINGER, FINGER, THUMB, (PALM,))):
        for rows, columns in shapes:
            zones.append((finger, first, rows, columns))
            first += rows * columns
    return zones


ZONES = _zones()
NAILS = (1, 4, 7, 10, 13)  # zones that an object within the hand does not touch
DEAD = (6, *range(12, 17))  # middle tip; thumb and palm (dossier §3.4)


@lru_cache(8)  # at first each hand touches nothing
def skin(presses: tuple[float, ...], dead: bool, saturated: bool, quiet: bool) -> bytes:
    """All values of a TP for what each of six fingers is pressed with, g; the palm feels what all press together."""
    values = [0] * VALUES if quiet else list(range(VALUES))
    felt = [*presses[:4], max(presses[4:6]), sum(presses) / 6.0]
    for number, (finger, first, rows, columns) in enumerate(ZONES):
        if dead and number in DEAD:
            values[first : first + rows * columns] = [0] * (rows * columns)
        elif felt[finger] > 0.0 and number not in NAILS:
            for place in range(rows * columns):
                share = _share(place // columns, rows) * _share(place % columns, columns)
                values[first + place] = min(MOST, values[first + place] + int(felt[finger] * share))
    if saturated:
        values[0], values[-1] = INVALID, INVALID - 255
    return struct.pack(f"<{VALUES}H", *values)


def _share(place: int, count: int) -> float:
    """1 in the middle, less towards the ends."""
    return 1.0 - abs(2.0 * place + 1.0 - count) / (count + 1.0)


def touched(presses: Sequence[float]) -> list[int]:
    """F1 and DG2: of five fingers normal and tangential force in 0.01 N, direction, proximity (24 bits); a palm of 3 x 3."""
    found = []
    for number in range(5):
        press = presses[number] if number < 4 else max(presses[4:])
        near = 8000000 if press > 0.0 else 1000 * (number + 1)
        normal = min(65535, round(0.98 * press)) or 11 * (number + 1)
        found += [normal, normal // 4, 65535 if press <= 0.0 else 15 * number, near % 65536, near // 65536]
    return found + [201 + place + round(0.98 * sum(presses) / 60.0) for place in range(9)]


class Front(Asked):
    """The hand as one of its wires shows it. A wire beside another one is made with that one's hand."""

    KIND = "hand"
    CONTROL = "handctl.sim.hand.control_commands"
    BUS = ""
    FLAGS = {0: ("", False), 1: ("", True)}  # noqa: RUF012

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random)
        options.choice("bus", self.BUS, (self.BUS,))
        self.alone = hand is None
        self.hand = from_options(options, self.given, random) if hand is None else hand
        self.spaces = {"": self.hand.space}
        self.unit = self.hand.generation.unit

    @property
    def id(self) -> int:  # type: ignore[override]
        return self.hand.number

    @property
    def about(self) -> str:
        return f"{super().about}. FINGER: {', '.join(self.hand.generation.names)}"

    def beside(self, model: type[Model]) -> type[Model]:
        """Another wire of this hand, of a class like this one."""
        hand = self.hand

        class Beside(model):  # type: ignore[valid-type, misc]
            def __init__(self, options: Options, random: Random) -> None:
                super().__init__(options, random, hand)

        return Beside

    def boot(self, now: float) -> None:
        super().boot(now)
        if self.alone:
            self.hand.boot(now)

    def advance(self, now: float) -> None:
        self.now = now
        self.hand.advance(max(now, self.hand.now))
        if self.alone and self.hand.dirty:
            self.dirty, self.hand.dirty = True, False

    def elapse(self, seconds: float) -> None:
        self.hand.elapse(seconds)

    def power(self, on: bool) -> None:
        """Late frames are gone; a wire that joins a hand that is on leaves it so."""
        super().power(on)
        if on != self.hand.powered:
            self.hand.faults = self.faults
            self.hand.power(on)
        self.dirty = self.dirty or on

    def set_faults(self, faults: frozenset[str]) -> None:
        self.faults = faults
        self.hand.set_faults(faults)
        self.hand.publish()

    def restored(self) -> None:
        """A state file has changed the hand."""

    def read(self, space: str, address: int, count: int) -> bytes | None:
        return self.hand.read(address, count)

    def write(self, space: str, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """A write, after which the state file is another one."""
        self.dirty = True
        return self.hand.write(address, data, hits)
