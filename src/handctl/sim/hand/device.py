"""A simulated RH56 hand on its serial pair: EB90 and Modbus RTU (RH56 dossier §2.1, §2.2).

    EB 90  id  length  flag  address low  address high  count or data ...  sum        90 EB begins the answers
    unit  function  ...  CRC                                                           after a silence

An address counts bytes on DF and TP, words on F1 and DG2; a count is one of bytes on all of them. Written from the dossier
alone, by other means than the host.
"""

from __future__ import annotations

from handctl.sim.engine.model import Options, Random, Reply
from handctl.sim.hand import modbus
from handctl.sim.hand.model import Hand
from handctl.sim.hand.options import FAULTS, MODBUS_FAULTS, MODBUS_OPTIONS, OPTIONS, SERIAL_FAULTS, SERIAL_OPTIONS
from handctl.sim.hand.wires import Front
from handctl.sim.inspire.frames import Serial

_OPTIONS = {**OPTIONS, **SERIAL_OPTIONS, **MODBUS_OPTIONS}
_FAULTS = {**FAULTS, **MODBUS_FAULTS, **SERIAL_FAULTS}


class Device(Serial, Front):
    """The hand on RS-485 or RS-232."""

    BUS = "serial"
    FLAGS = {17: ("", False), 18: ("", True)}  # noqa: RUF012
    OPTIONS = _OPTIONS
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random, hand)
        speeds = self.hand.generation.speeds
        code = speeds.index(int(options.choice("baud", "115200", tuple(str(speed) for speed in speeds))))
        if hand is None:
            self.hand.flash_code = code
        self.speed = speeds[self.hand.flash_code]
        self._burst: bytearray | None = bytearray()  # of Modbus: what came since a silence; None: nothing of ours
        self._asked: dict[bytes, bytes] = {}  # answer of Modbus RTU -> its request, for the second hand with this id

    # -- power and time ---------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        super().advance(now)
        if now - self._heard > self.given["gap"]:
            self._burst = bytearray()

    def power(self, on: bool) -> None:
        self._burst = bytearray()
        super().power(on)
        self.restored()

    def restored(self) -> None:
        self.speed = self.hand.generation.speeds[self.hand.speed_code]

    # -- requests in --------------------------------------------------------------------------------------------------------

    def due(self, pending: bytes) -> int | None:
        """The nearer end of a request of either protocol."""
        ends = []
        if self.given["speaks"] != "modbus":
            ends.append(super().due(pending) or 0)
        if self.given["speaks"] != "eb90" and (burst := self._burst_now()) is not None:
            size = self._rtu_size(burst + pending)
            ends += [size - len(burst)] if 0 < size <= len(burst) + len(pending) else []
        return min((end for end in ends if end > 0), default=None)

    def feed(self, data: bytes) -> None:
        burst, self._heard = self._burst_now(), self.now
        if self.given["speaks"] != "eb90":
            self._burst = None if burst is None else burst + data
            self._answer_rtu()
        if self.given["speaks"] != "modbus":
            super().feed(data)

    def _burst_now(self) -> bytearray | None:
        """What belongs to the frame that the next byte continues: none of it behind a silence, unless half a request."""
        if self._burst and self._rtu_size(self._burst) >= 0:
            return self._burst
        return bytearray() if self.now - self._heard >= self.given["silence"] else self._burst

    def _handle(self, request: bytes) -> None:
        """The result of a save and the end of a calibration come later (dossier V9, V10)."""
        super()._handle(request)
        for event, when in self.hand.events:
            if event == "saved":
                own = self.given["result-address"] == "own"
                self.tell_saved(when, self.hand.space.place("save") // self.unit if own else 1005, self._hits)
            else:
                self.tell_calibrated(when, self._hits)
        self.hand.events.clear()

    # -- Modbus RTU ---------------------------------------------------------------------------------------------------------

    def _rtu_size(self, burst: bytes | bytearray) -> int:
        """Bytes of the request that begins so, 0: not known yet, -1: not for this hand."""
        if burst and burst[0] != self.id:
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
        number = self.id
        pdu = modbus.answer(self, request, hits, "rtu-unpacked" in self.faults)
        self.hand.events.clear()  # nothing on Modbus tells an end (dossier Q9)
        if pdu is not None:
            reply = modbus.rtu(number, pdu)
            self._asked = {reply: request}
            self._replies.append(Reply(self.now + self.given["silence"], reply, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------------

    def readdress(self, data: bytes) -> bytes:
        return super().readdress(data) if data[:2] == self.HEADER else modbus.rtu(data[0] % 254 + 1, data[1:-2])

    def twin(self, data: bytes) -> bytes:
        if data[:2] == self.HEADER:
            return super().twin(data)
        request = self._asked.get(data)
        return data if request is None else modbus.rtu(data[0], modbus.twin(self, request, data[1:-2]))
