"""A simulated RH56 hand on its serial pair: EB90 and Modbus RTU (RH56 dossier §2.1, §2.2).

    EB 90  id  length  flag  address low  address high  count or data ...  sum        90 EB begins the answers
    unit  function  ...  CRC                                                           after a silence

An address counts bytes on DF and TP, words on F1 and DG2; a count is one of bytes on all of them. Written from the dossier
alone, by other means than the host.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Options, Random, Reply
from handctl.sim.hand import modbus
from handctl.sim.hand.front import Front
from handctl.sim.hand.model import Hand
from handctl.sim.hand.options import FAULTS, MODBUS_FAULTS, MODBUS_OPTIONS, OPTIONS, SERIAL_FAULTS, SERIAL_OPTIONS
from handctl.sim.inspire.frames import find, frame

READ, WRITE = 17, 18  # flags
OLD_HEADER = b"\x90\xeb"
_OPTIONS = {**OPTIONS, **SERIAL_OPTIONS, **MODBUS_OPTIONS}
_FAULTS = {**FAULTS, **MODBUS_FAULTS, **SERIAL_FAULTS}


class Device(Front):
    """The hand on RS-485 or RS-232."""

    HEADER = OLD_HEADER
    OPTIONS = _OPTIONS
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random, hand)
        options.choice("bus", "serial", ("serial",))
        speeds = self.hand.generation.speeds
        code = speeds.index(int(options.choice("baud", "115200", tuple(str(speed) for speed in speeds))))
        if hand is None:
            self.hand.flash_code = code
        self.speed = speeds[self.hand.flash_code]
        self._speaks = options.choice("speaks", "both", ("both", "eb90", "modbus"))
        self._old_id_acks = options.choice("ack-id", "new", ("new", "old")) == "old"
        self._result_flag = int(options.choice("result-flag", "17", ("17", "18")))
        self._own_result = options.choice("result-address", "own", ("own", "1005")) == "own"
        self._most_written = int(options.choice("most-written", "120", ("120", "123")))
        self._gap = options.seconds("gap", 0.1, 3600.0)
        self._silence = options.seconds("silence", 0.00175, 1.0)
        self._inbox = bytearray()  # of EB90
        self._burst: bytearray | None = bytearray()  # of Modbus: what came since a silence; None: nothing of ours
        self._heard = -1.0
        self._asked: dict[bytes, bytes] = {}  # answer of Modbus RTU -> its request, for the second hand with this id

    # -- power and time ---------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        super().advance(now)
        if now - self._heard > self._gap:
            self._inbox.clear()
            self._burst = bytearray()

    def power(self, on: bool) -> None:
        self._inbox.clear()
        self._burst = bytearray()
        super().power(on)
        if on:
            self.restored()

    def restored(self) -> None:
        self.speed = self.hand.generation.speeds[self.hand.speed_code]

    # -- requests in --------------------------------------------------------------------------------------------------------

    def due(self, pending: bytes) -> int | None:
        """The nearer end of a request of either protocol."""
        ends = []
        if self._speaks != "modbus":
            _, size, decided = find(self._inbox + pending, self.hand.number, _possible)
            ends += [decided - len(self._inbox)] if size else []
        if self._speaks != "eb90" and (burst := self._burst_now()) is not None:
            size = self._rtu_size(burst + pending)
            ends += [size - len(burst)] if 0 < size <= len(burst) + len(pending) else []
        return min((end for end in ends if end > 0), default=None)

    def feed(self, data: bytes) -> None:
        burst = self._burst_now()
        self._heard = self.now
        if self._speaks != "eb90":
            self._burst = None if burst is None else burst + data
            self._answer_rtu()
        if self._speaks != "modbus":
            self._inbox += data
            self._answer_eb90()

    def _burst_now(self) -> bytearray | None:
        """What belongs to the frame that the next byte continues: none of it behind a silence, unless half a request."""
        if self._burst and self._rtu_size(self._burst) >= 0:
            return self._burst
        return bytearray() if self.now - self._heard >= self._silence else self._burst

    # -- EB90 -------------------------------------------------------------------------------------------------------------

    def _answer_eb90(self) -> None:
        while True:
            skip, size, _ = find(self._inbox, self.hand.number, _possible)
            request = bytes(self._inbox[skip : skip + size])
            del self._inbox[: skip + size]
            if not request:
                return
            self._handle(request)

    def _handle(self, request: bytes) -> None:
        hits = self.judge()
        if "deaf" in hits:
            return
        hand, flag, body, sender = self.hand, request[4], request[5:-1], self.hand.number
        address = struct.unpack_from("<H", body)[0]
        place = address * hand.generation.unit
        if flag == READ:
            # No count of 0 and none above 252 (the length byte is count + 3), none past the last address.
            good = 1 <= body[2] <= 252 and place + body[2] <= 65536 * hand.generation.unit
            answer = hand.read(place, body[2]) if good else None
        else:
            done = self.write(place, body[2:], hits)
            answer = None if done is None else bytes([done])  # 01; 00 is taken to mean refused (open)
        if answer is not None:
            # An id change acts at once: the ack comes from the new id already, or from the old one (ack-id).
            number = sender if self._old_id_acks else hand.number
            self._replies.append(Reply(self.now, frame(number, flag, struct.pack("<H", address) + answer), hits))
        self._tell_ends(hits)

    def _tell_ends(self, hits: frozenset[str]) -> None:
        """The result of a save and the end of a calibration come later (dossier V9, V10)."""
        hand = self.hand
        for event, when in hand.events:
            if "no-late-frames" in self.faults:
                continue
            if event == "saved":
                address = hand.generation.places["save"] // hand.generation.unit if self._own_result else 1005
                result = struct.pack("<HB", address, 255 if "save-fails" in self.faults else 0)
                late = frame(hand.number, self._result_flag, result)
            else:
                late = frame(hand.number, READ, struct.pack("<HB", 2, 0))
            self._replies.append(Reply(when, late, hits))
        hand.events.clear()

    # -- Modbus RTU ---------------------------------------------------------------------------------------------------------

    def _rtu_size(self, burst: bytes | bytearray) -> int:
        """Bytes of the request that begins so, 0: not known yet, -1: not for this hand."""
        if burst and burst[0] != self.hand.number:
            return -1
        size = modbus.size_of(burst[1:])
        return size + 3 if size > 0 else size

    def _answer_rtu(self) -> None:
        """A request stands alone between two silences: what follows it at once makes it another one."""
        burst = self._burst
        if burst is None:
            return
        size = self._rtu_size(burst)
        whole = len(burst) >= 4 and modbus.crc(burst[:-2]) == burst[-2:]
        if size < 0 or 0 < size <= len(burst) or whole:
            self._burst = None
        if whole and size in (0, len(burst)):
            self._handle_rtu(bytes(burst[1:-2]))

    def _handle_rtu(self, request: bytes) -> None:
        hits = self.judge()
        if "deaf" in hits:
            return
        number = self.hand.number
        pdu, _ = modbus.answer(self, request, hits, self._most_written, "rtu-unpacked" in self.faults)
        self.hand.events.clear()  # nothing on Modbus tells an end (dossier Q9)
        if pdu is not None:
            reply = modbus.rtu(number, pdu)
            self._asked = {reply: request}
            self._replies.append(Reply(self.now + self._silence, reply, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        return data[:-1] + bytes([(data[-1] + 1) % 256])

    def readdress(self, data: bytes) -> bytes:
        if data[:2] == OLD_HEADER:
            return frame(data[2] % 254 + 1, data[4], data[5:-1])
        return modbus.rtu(data[0] % 254 + 1, data[1:-2])

    def twin(self, data: bytes) -> bytes:
        """The second device got the same commands, so only what it measures differs."""
        if data[:2] != OLD_HEADER:
            request = self._asked.get(data)
            return data if request is None else modbus.rtu(data[0], modbus.twin(self, request, data[1:-2]))
        if data[4] != READ:
            return data
        place = struct.unpack_from("<H", data, 5)[0] * self.hand.generation.unit
        return frame(data[2], data[4], data[5:7] + self.twin_of(place, data[7:-1]))


def _possible(flag: int, length: int) -> bool:
    """Whether a request can have this flag and length: reads 4, writes 3 + data."""
    return length >= 4 if flag == WRITE else flag == READ and length == 4
