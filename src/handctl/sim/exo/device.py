"""A simulated Inspire EH55BF1 exoskeleton hand: frames, registers, flash, late answers (exo §2.1 to §2.3).

Written from the manual alone, by other means than the host: decimal numbers, `struct`, a sum loop. Where the manual is
silent the behaviour is invented and the comment says so; nothing seen here is evidence about a real hand.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Model, Options, Random, Reply
from handctl.sim.exo.frames import FORCE, POSITION, READ, WRITE, find, frame
from handctl.sim.exo.hand import Hand

TYPE_CHECKING = False
if TYPE_CHECKING:
    pass

# The second book of registers, exo §2.3: (address, bytes per element, elements, access, lowest, highest). 1006 is not
# in the manual's table (exo §2.3.5 gives no address); it is taken from the RH56 hand of the same maker.
REGISTERS = (
    (1000, 1, 1, "rw", 1, 254),  # id
    (1001, 1, 1, "rw", 0, 2),  # speed code
    (1004, 1, 1, "rw", 0, 1),  # clear errors
    (1005, 1, 1, "rw", 0, 1),  # save to flash
    (1006, 1, 1, "w", 0, 1),  # factory defaults
    (1009, 1, 1, "rw", 0, 1),  # calibrate
    (1472, 2, 1, "r", -32768, 32767),  # system voltage, no unit given
    (1486, 2, 5, "rw", -1, 1000),  # position set values
    (1498, 2, 5, "rw", -1000, 1000),  # force set values
    (1546, 2, 6, "r", 0, 1000),  # positions, thumb rotation last
    (1582, 2, 5, "r", -1000, 1000),  # forces
    (1594, 2, 5, "r", 0, 1000),  # currents, mA
    (1606, 1, 5, "r", 0, 255),  # error bits
    (1618, 1, 5, "r", 0, 100),  # temperatures, °C
)
SPEEDS = (115200, 57600, 19200)  # speed codes 0, 1, 2 (exo §2.3.2)
MEMORY = 4096  # bytes kept; above, everything reads 0
TRIGGERS = (1004, 1005, 1006, 1009)  # act when 1 is written and read back as 0 (open on hardware)
LONGEST = 1.0  # s; no movement takes longer
SAVE_TIME = 1.0  # s from the ack to the result (RH56)
LATCHED = {  # fault -> (finger, error byte): another finger for each bit, so that a swap is seen
    "locked-rotor": (0, 1),
    "over-temperature": (1, 2),
    "over-current": (2, 4),
    "motor-abnormal": (4, 8),
    "communication": (4, 16),
    "unknown-bits": (3, 160),
}
ALL_FAULTS = (1, 2, 4, 6, 24)  # error bytes of the state "faults"; the 6 is the example of exo §2.3.12

_OPTIONS = {
    "id": "id at the first start, 1..254 (default 1)",
    "baud": "speed at the first start: 115200, 57600 or 19200",
    "ack-id": "the ack of an id change carries the id: new (default) or old",
    "result-flag": "flag of the save result: 17 (11 hex, default) or 18 (12 hex)",
    "calibration": "seconds that a calibration takes (default about 12: waits and movements)",
    "jitter": "1: force and current jitter also at rest",
    "limit": "temperature in °C that sets the over-temperature error (default 70)",
    "gap": "seconds of silence after which an unfinished request is forgotten (default 0.1)",
}
_FAULTS = {
    "strict": "silence instead of an ack for a write of anything that cannot be written or is out of range",
    "block-silent": "silence for reads that touch undocumented bytes",
    "no-late-frames": "no save result, no end of calibration",
    "save-fails": "the save result is FF and flash stays as it was",
    "fresh": "position set values are -1 at power-on",
    "foreign": "the registers do not look like this device (1472 is 0, values out of range)",
    "baud-at-1002": "the speed code is at 1002 as on the RH56, and 1001 ignores writes",
    "faults": "error bytes 01 02 04 06 18",
    "hot": "all actuators start above the limit and cool down",
    "blocked": "no finger can move",
    "locked-rotor": "error bit 0 on the little finger",
    "over-temperature": "error bit 1 on the ring finger, which stays hot",
    "over-current": "error bit 2 on the middle finger",
    "motor-abnormal": "error bit 3 on the thumb",
    "communication": "error bit 4 on the thumb",
    "unknown-bits": "error bits 5 and 7 on the index finger",
}


class Device(Model):
    """The hand without its wire."""

    KIND = "exo"
    USE = "handctl.sim.exo.use"
    CONTROL = "handctl.sim.exo.control"
    HEADER = b"\x90\xeb"
    OPTIONS = _OPTIONS
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        speed = int(options.choice("baud", "115200", tuple(str(value) for value in SPEEDS)))
        self.flash = {"id": options.integer("id", 1, 1, 254), "speed_code": SPEEDS.index(speed)}
        self._old_id_acks = options.choice("ack-id", "new", ("new", "old")) == "old"
        self._result_flag = int(options.choice("result-flag", "17", ("17", "18")))
        self._calibration = None if options.text("calibration") is None else options.seconds("calibration", 0.0, 3600.0)
        self._gap = options.seconds("gap", 0.1, 3600.0)
        jitter = options.choice("jitter", "0", ("0", "1")) == "1"
        self.hand = Hand(random, jitter, float(options.integer("limit", 70, 40, 100)))
        self.memory = bytearray(MEMORY)
        self._inbox = bytearray()
        self._heard = 0.0
        self.speed = speed

    # -- power, time, faults ----------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.hand.now = now

    def advance(self, now: float) -> None:
        self.now = now
        self.hand.advance(now)
        if self._inbox and now - self._heard > self._gap:
            self._inbox.clear()

    def elapse(self, seconds: float) -> None:
        self.hand.advance(self.hand.now + max(seconds, LONGEST))

    def power(self, on: bool) -> None:
        """Id and speed come from flash (exo §2.3.1, §2.3.2), set points start anew, late frames are gone."""
        self.powered = on
        self._inbox.clear()
        self._replies.clear()
        self.hand.power_on()
        if not on:
            return
        self.memory = bytearray(MEMORY)
        self._defaults()
        self.memory[1000] = self.flash["id"]
        self.memory[self._speed_address()] = self.flash["speed_code"]
        self.speed = SPEEDS[self.flash["speed_code"]]
        self.set_faults(self.faults)
        if "hot" in self.faults:
            for number, finger in enumerate(self.hand.fingers):
                finger.set_temperature(finger.limit + 1.0 + number)
        self.dirty = True

    def _defaults(self) -> None:
        """What a power-on shows, all different; also what the factory defaults are taken to be (open)."""
        self.memory[1000] = 1
        self.memory[self._speed_address()] = 0
        positions = (151, 252, 353, 454, 555)
        if "fresh" in self.faults:
            positions = (-1, -1, -1, -1, -1)
        if "foreign" in self.faults:
            positions = (3000, 3001, 3002, 3003, 3004)
        struct.pack_into("<h", self.memory, 1472, 0 if "foreign" in self.faults else 558)
        struct.pack_into("<5h", self.memory, 1486, *positions)
        struct.pack_into("<5h", self.memory, 1498, -61, 62, -63, 64, -65)

    def _speed_address(self) -> int:
        return 1002 if "baud-at-1002" in self.faults else 1001

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        for number, finger in enumerate(self.hand.fingers):
            if "blocked" in faults or "blocked" in before:
                finger.blocked = "blocked" in faults
            byte = ALL_FAULTS[number] if "faults" in faults else 0
            for name, (place, bits) in LATCHED.items():
                if name in faults and place == number:
                    byte |= bits
            finger.errors |= byte & ~2
            if byte & 2:
                finger.overheat()
            else:
                finger.cool_down()

    @property
    def id(self) -> int:
        return self.memory[1000]

    # -- frames in ---------------------------------------------------------------------------------------------------

    def due(self, pending: bytes) -> int | None:
        _, size, decided = find(self._inbox + pending, self.id)
        return decided - len(self._inbox) if size else None

    def feed(self, data: bytes) -> None:
        self._heard = self.now
        self._inbox += data
        while True:
            skip, size, _ = find(self._inbox, self.id)
            request = bytes(self._inbox[skip : skip + size])
            del self._inbox[: skip + size]
            if not request:
                return
            self._handle(request)

    def _handle(self, request: bytes) -> None:
        hits = self.judge()
        # Deaf while it calibrates: nothing is said about requests during the course, and this is the harshest reading.
        if "deaf" in hits or self.hand.calibrating:
            return
        flag, body, sender, before = request[4], request[5:-1], self.id, len(self._replies)
        if flag == READ:
            answer = self._read(*struct.unpack("<HB", body))
        elif flag == WRITE:
            answer = self._write(struct.unpack_from("<H", body)[0], body[2:], hits)
        else:
            answer = self._command(flag, struct.unpack("<5h", body), hits)
        if answer is not None:
            # An id change acts at once: the ack comes from the new id already (RH56), or from the old one (ack-id).
            answered_by = sender if self._old_id_acks else self.id
            # Ahead of what the request itself set off, a late frame that may be due at once.
            self._replies.insert(before, Reply(self.now, frame(answered_by, flag, answer), hits))

    def _reply(self, due: float, data: bytes, hits: frozenset[str]) -> None:
        self._replies.append(Reply(due, data, hits))

    # -- requests ---------------------------------------------------------------------------------------------------

    def _read(self, address: int, count: int) -> bytes | None:
        """exo §2.2.3. No count of 0 and none above 252 (the length byte is count + 3), none past the last address."""
        if not 1 <= count <= 252 or address + count > 65536:
            return None
        if "block-silent" in self.faults and not _documented(address, count):
            return None
        self.publish()
        return struct.pack("<H", address) + bytes(self.memory[address : address + count]).ljust(count, b"\0")

    def _write(self, address: int, data: bytes, hits: frozenset[str]) -> bytes | None:
        """exo §2.2.4. The ack ends in 01; 00 is taken to mean refused (open).

        Gaps, read-only bytes and values out of range are ignored but acknowledged (open on hardware), or met with
        silence in the state "strict".
        """
        accepted, covered = [], 0
        for listed, size, count, access, low, high in REGISTERS:
            first = self._speed_address() if listed == 1001 else listed
            for place in range(first, first + size * count, size) if "w" in access else ():
                begin, end = max(place, address), min(place + size, address + len(data))
                if begin >= end:
                    continue
                old = bytes(self.memory[place : place + size])
                raw = old[: begin - place] + data[begin - address : end - address] + old[end - place :]
                value = struct.unpack("<h" if size == 2 else "B", raw)[0]
                if low <= value <= high:
                    accepted.append((place, value, raw))
                    covered += end - begin
        if "strict" in self.faults and covered < len(data):
            return None
        if "refuse" in hits:
            return struct.pack("<HB", address, 0)
        for place, value, raw in accepted:
            self._store(place, value, raw, hits)
        return struct.pack("<HB", address, 1)

    def _store(self, place: int, value: int, raw: bytes, hits: frozenset[str]) -> None:
        """One register element that was written with a value in its range."""
        self.dirty = True
        if place in TRIGGERS:
            if value == 1:
                self._trigger(place, hits)
            return
        self.memory[place : place + len(raw)] = raw
        if 1486 <= place < 1496:  # exo §2.3.7: acts at once, -1 leaves the finger where it is
            self.hand.fingers[(place - 1486) // 2].target = None if value == -1 else value
        elif 1498 <= place < 1508:  # exo §2.3.8
            self.hand.fingers[(place - 1498) // 2].force_goal = value

    def _trigger(self, place: int, hits: frozenset[str]) -> None:
        if place == 1004:
            for finger in self.hand.fingers:
                finger.clear()
        elif place == 1005:
            # Flash is written at once, so that a client that leaves before the result finds it saved.
            fails = "save-fails" in self.faults
            if not fails:
                self.flash = {"id": self.id, "speed_code": self.memory[self._speed_address()]}
            if "no-late-frames" not in self.faults:
                result = struct.pack("<HB", 1005, 255 if fails else 0)
                self._reply(self.now + SAVE_TIME, frame(self.id, self._result_flag, result), hits)
        elif place == 1006:
            # RAM only: the id acts at once as after a write, the speed with a power cycle after a save (open).
            self._defaults()
        elif place == 1009:
            end = self.hand.calibrate(self._calibration)
            if "no-late-frames" not in self.faults:
                # Address field 0002 as the RH56 sends it; the meaning of its data byte is open.
                self._reply(end, frame(self.id, READ, struct.pack("<HB", 2, 0)), hits)

    def _command(self, flag: int, values: tuple[int, ...], hits: frozenset[str]) -> bytes | None:
        """exo §2.2.1 and §2.2.2: five set values; the reply tells positions, or forces, of this moment.

        They are taken to fill the set registers. A value out of range leaves its finger alone, -1 as a position too
        (the table starts at 0), or is met with silence in the state "strict".
        """
        first, low = (1498, -1000) if flag == FORCE else (1486, 0)
        good = [low <= value <= 1000 for value in values]
        if "strict" in self.faults and not all(good):
            return None
        answer = self.hand.positions() if flag == FORCE else self.hand.forces()
        for number, value in enumerate(values):
            if good[number] and "refuse" not in hits:
                self._store(first + 2 * number, value, struct.pack("<h", value), hits)
        return struct.pack(f"<{len(answer)}h", *answer)

    def publish(self) -> None:
        """Puts the readings of this moment into memory."""
        hand = self.hand
        struct.pack_into("<6h", self.memory, 1546, *hand.positions())
        struct.pack_into("<5h", self.memory, 1582, *hand.forces())
        struct.pack_into("<5h", self.memory, 1594, *hand.currents())
        struct.pack_into("<5B", self.memory, 1606, *hand.errors())
        struct.pack_into("<5B", self.memory, 1618, *hand.temperatures())

    # -- faults that know the frame -----------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        return data[:-1] + bytes([(data[-1] + 1) % 256])

    def readdress(self, data: bytes) -> bytes:
        return frame(data[2] % 254 + 1, data[4], data[5:-1])

    def twin(self, data: bytes) -> bytes:
        """The second device got the same commands, so only what it measures differs: every 16-bit reading by 3."""
        body = bytearray(data[5:-1])
        if data[4] == READ:
            address = struct.unpack_from("<H", body)[0]
            for first, size, count, access, _, _ in REGISTERS:
                for place in range(first, first + size * count, size) if (size, access) == (2, "r") else ():
                    if address <= place and place + 2 <= address + len(body) - 2:
                        _differ(body, place - address + 2)
        elif data[4] in (FORCE, POSITION):
            for offset in range(0, len(body), 2):
                _differ(body, offset)
        return frame(data[2], data[4], bytes(body))


def _documented(address: int, count: int) -> bool:
    """Whether all these bytes belong to registers of the manual."""
    places = range(address, address + count)
    known = sum(len(range(max(places.start, row[0]), min(places.stop, row[0] + row[1] * row[2]))) for row in REGISTERS)
    return known == count


def _differ(body: bytearray, offset: int) -> None:
    value = struct.unpack_from("<h", body, offset)[0]
    struct.pack_into("<h", body, offset, value + 3 if value <= 997 else value - 3)
