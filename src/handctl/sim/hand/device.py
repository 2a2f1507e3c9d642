"""The wires of a simulated RH56 hand: EB90 and Modbus RTU on its serial pair, CAN, Modbus TCP (RH56 dossier §2).

    EB 90  id  length  flag  address low  address high  count or data ...  sum        90 EB begins the answers
    unit  function  ...  CRC                                                           after a silence

An address counts bytes on DF and TP, words on F1 and DG2; a count is one of bytes on all of them. Written from the dossier
alone, by other means than the host.

Modbus has function codes 3, 6 and 16 on the registers (RH56 dossier §2.2, §2.3):

    request   3  first  count                     answer  3  bytes  data
              6  address  value                           6  address  value
             16  first  count  bytes  data               16  first  count
    refused   function + 128, exception 1 to 4

Numbers go high byte first. On DF and TP register a is the bytes a, low half, and a + 1, high half; on F1 and DG2 it is word a.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.simulated_device import Options, Random, Reply, Rows
from handctl.sim.hand.registers import (
    CAN_OPTIONS,
    FAULTS,
    MODBUS_FAULTS,
    MODBUS_OPTIONS,
    OPTIONS,
    SERIAL_FAULTS,
    SERIAL_OPTIONS,
    TCP_FAULTS,
    Front,
    Hand,
)
from handctl.sim.inspire.frames import Can, Serial

# -- Modbus between unit and check sum -------------------------------------------------------------------------------------

READ, WRITE_ONE, WRITE = 3, 6, 16
BAD_FUNCTION, BAD_ADDRESS, BAD_VALUE, FAILED = 1, 2, 3, 4  # exceptions, by the standard: none was seen on a hand
MOST_READ = 125


def modbus_size(pdu: bytes | bytearray) -> int:
    """Bytes of the request that begins so; 0: too little to know, or of a function code that the hands do not have."""
    if pdu[:1] in (b"\x03", b"\x06"):
        return 5
    return 6 + pdu[5] if len(pdu) > 5 and pdu[0] == WRITE else 0


def modbus_answer(front: Front, pdu: bytes, hits: frozenset[str], unpacked: bool = False) -> bytes | None:
    """What follows the unit in the answer, None: silence."""
    function = pdu[0]
    if function not in (READ, WRITE_ONE, WRITE):
        return _exception(function, BAD_FUNCTION)
    if len(pdu) < 5 or (function == WRITE and len(pdu) < 6):
        return _exception(function, BAD_VALUE)
    first, count = struct.unpack_from(">HH", pdu, 1)
    if function == READ:
        if not 1 <= count <= MOST_READ:
            return _exception(function, BAD_VALUE)
        data = _registers(front, first * front.unit, count, unpacked) if first + count <= 65536 else None
        return _exception(function, BAD_ADDRESS) if data is None else bytes((READ, len(data))) + data
    words, most = pdu[3:5] if function == WRITE_ONE else pdu[6:], int(front.given["most-written"])
    if function == WRITE and (not 1 <= count <= most or pdu[5] != 2 * count or len(words) != 2 * count):
        return _exception(function, BAD_VALUE)
    done = front.write("", first * front.unit, _swapped(words), hits)
    return pdu[:5] if done else _exception(function, BAD_VALUE if done is None else FAILED)


def _registers(front: Front, address: int, count: int, unpacked: bool) -> bytes | None:
    """`count` registers from this byte address, as they stand on the wire."""
    hand = front.hand
    data = hand.read(address, 2 * count)
    if data is None:
        return None
    narrow = _narrow(front)
    if unpacked and address in narrow:
        return b"".join(
            struct.pack(">H", hand.space.memory[place] if place in narrow else 0)
            for place in range(address, address + count)
        )
    words = bytearray(_swapped(data))
    if "high-half" in front.faults:
        for place in range(address, address + 2 * count, 2):
            if place in narrow:
                words[place - address : place - address + 2] = data[place - address : place - address + 2]
    return bytes(words)


def _narrow(front: Front) -> range:
    """The bytes of which two share a register: error, status and temperature of DF and TP."""
    space = front.hand.space
    return range(space.place("error"), space.place("temperature", 6)) if front.unit == 1 else range(0)


def _swapped(words: bytes) -> bytes:
    return b"".join(words[place : place + 2][::-1] for place in range(0, len(words), 2))


def _exception(function: int, code: int) -> bytes:
    return bytes((function % 128 + 128, code))


def modbus_twin(front: Front, request: bytes, pdu: bytes) -> bytes:
    """The answer of a second hand to the same request: only what it measures differs."""
    if pdu[0] != READ or request[0] != READ:
        return pdu
    address = struct.unpack_from(">H", request, 1)[0] * front.unit
    return pdu[:2] + _swapped(front.second("", address, _swapped(pdu[2:])))


def crc(data: bytes | bytearray) -> bytes:
    """CRC-16 of Modbus, bit by bit: polynomial 8005 reflected, begun with all ones; low byte first on the wire."""
    register = 65535
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register // 2 ^ 40961 if register % 2 else register // 2
    return struct.pack("<H", register)


LONGEST_RTU = 256
"""Bytes of the longest frame of Modbus RTU: what goes on behind them is none, whatever its function."""


def rtu(number: int, pdu: bytes) -> bytes:
    """unit  function  ...  CRC"""
    body = bytes((number,)) + pdu
    return body + crc(body)


# -- wires -----------------------------------------------------------------------------------------------------------------

_OPTIONS = {**OPTIONS, **SERIAL_OPTIONS, **MODBUS_OPTIONS}
_FAULTS = {**FAULTS, **MODBUS_FAULTS, **SERIAL_FAULTS}


class Device(Serial, Front):
    """The hand on RS-485 or RS-232."""

    BUS = "serial"
    FLAGS = {17: ("", False), 18: ("", True)}  # noqa: RUF012
    OPTIONS = Rows(_OPTIONS)
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

    def _handle(self, request: bytes) -> frozenset[str]:
        """The result of a save and the end of a calibration come later (dossier V9, V10)."""
        hits = super()._handle(request)
        for event, when in self.hand.events:
            if event == "saved":
                own = self.given["result-address"] == "own"
                self.tell_saved(when, self.hand.space.place("save") // self.unit if own else 1005, hits)
            else:
                self.tell_calibrated(when, hits)
        self.hand.events.clear()
        return hits

    # -- Modbus RTU ---------------------------------------------------------------------------------------------------------

    def _rtu_size(self, burst: bytes | bytearray) -> int:
        """Bytes of the request that begins so, 0: not known yet, -1: not for this hand."""
        if burst and burst[0] != self.id:
            return -1
        size = modbus_size(burst[1:])
        return size + 3 if size > 0 else size

    def _answer_rtu(self) -> None:
        """A request stands alone between two silences: what follows it at once makes it another one."""
        burst = self._burst
        if burst is None:
            return
        size = self._rtu_size(burst)
        whole = 4 <= len(burst) <= LONGEST_RTU and crc(burst[:-2]) == burst[-2:]
        if size < 0 or 0 < size <= len(burst) or whole or len(burst) >= LONGEST_RTU:
            self._burst = None
        if whole and size in (0, len(burst)):
            self._handle_rtu(bytes(burst[1:-2]))

    def _handle_rtu(self, request: bytes) -> None:
        hits = self.judge()
        if "deaf" in hits:
            return
        number = self.id
        pdu = modbus_answer(self, request, hits, "rtu-unpacked" in self.faults)
        self.hand.events.clear()  # nothing on Modbus tells an end (dossier Q9)
        if pdu is not None:
            reply = rtu(number, pdu)
            self._asked = {reply: request}
            self.replies.append(Reply(self.now + self.given["silence"], reply, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------------

    def readdress(self, data: bytes) -> bytes:
        return super().readdress(data) if data[:2] == self.HEADER else rtu(data[0] % 254 + 1, data[1:-2])

    def twin(self, data: bytes) -> bytes:
        if data[:2] == self.HEADER:
            return super().twin(data)
        request = self._asked.get(data)
        return data if request is None else rtu(data[0], modbus_twin(self, request, data[1:-2]))


_CAN_OPTIONS = {**OPTIONS, **CAN_OPTIONS}


class CanDevice(Can, Front):
    """The hand on its CAN bus (RH56 dossier §2.4).

    DF, TP   as on the wrist, flag 0 read, 1 write
    F1, DG2  bit  28    | 27 .... 20 | 19 ..... 8 | 7 .. 0    those of CAN FD, here with 8 bytes at most as CAN 2.0 has them
                  write | length     | address    | id
    """

    BUS = "can"
    OPTIONS = Rows(_CAN_OPTIONS)
    FAULTS = FAULTS

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random, hand)
        self.speed = int(self.given["bitrate"])
        if hand is None:
            self.hand.flash_code = self.SPEEDS.index(self.speed)
        self.IDS = (0, 16383 if self.unit == 1 else 255)

    def power(self, on: bool) -> None:
        super().power(on)
        self.restored()

    def restored(self) -> None:
        self.speed = self.SPEEDS[min(1, self.hand.speed_code)]

    def parts(self, identifier: int) -> tuple[int, int, int]:
        if self.unit == 1:
            return super().parts(identifier)
        return identifier >> 28, (identifier >> 8) % 4096, identifier % 256

    def possible(self, flag: int, identifier: int, body: bytes) -> bool:
        fits = self.unit == 1 or (identifier >> 20) % 256 == len(body)
        return fits and super().possible(flag, identifier, body)

    def ack(self, written: int) -> bytes:
        if self.given["ack"] == "empty":
            return b""
        return bytes([written if self.unit == 1 else min(1, written)])

    def replying(self, identifier: int, answer: bytes) -> int:
        """With that of CAN FD the length is that of its own frame."""
        return identifier if self.unit == 1 else identifier - ((identifier >> 20) % 256 - len(answer) << 20)

    def feed(self, data: bytes) -> None:
        super().feed(data)
        self.hand.events.clear()  # nothing on CAN tells an end (open)


LONGEST = 254  # unit and what follows it, by the standard
_TCP_OPTIONS = {**OPTIONS, **MODBUS_OPTIONS}
_TCP_FAULTS = {**FAULTS, **MODBUS_FAULTS, **TCP_FAULTS}


class TcpDevice(Front):
    """One connection to the hand (RH56 dossier §2.3).

        transaction  protocol 0  length  unit  function  ...      numbers go high byte first; the length counts from the unit on

    The unit is not used: an answer has that of its request. Requests are answered in their order.
    """

    BUS = "modbus-tcp"
    HEADER = b"\0\0\xff\x03"
    OPTIONS = Rows(_TCP_OPTIONS)
    FAULTS = _TCP_FAULTS

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random, hand)
        if "address" not in self.hand.generation.words:
            raise ValueError(f"option bus=modbus-tcp: a hand of generation {self.hand.generation.name} has no Ethernet")
        self.reached = self.hand.address  # where the client found it
        self._inbox = bytearray()
        self._other = False  # by another hand that has the same address
        self._asked: dict[bytes, bytes] = {}  # answer -> the request that it belongs to

    def power(self, on: bool) -> None:
        self._inbox.clear()
        super().power(on)

    def restored(self) -> None:
        self.reached = self.hand.address

    def reconnected(self) -> None:
        self._inbox.clear()
        self.reached = self.hand.address
        self.hand.connections += 1
        self._other = self.hand.connections % 2 == 0

    @property
    def host(self) -> str:  # type: ignore[override]
        return ".".join(str(part) for part in self.hand.address)

    @property
    def one_client(self) -> bool:  # type: ignore[override]
        return "two-clients-drop" in self.faults

    def due(self, pending: bytes) -> int | None:
        data = bytes(self._inbox) + pending
        size = _size(data)
        return size - len(self._inbox) if 0 < size <= len(data) else None

    def feed(self, data: bytes) -> None:
        if self.reached != self.hand.address:
            return  # it has another address since its last power-on
        self._inbox += data
        while 0 < (size := _size(self._inbox)) <= len(self._inbox):
            request = bytes(self._inbox[:size])
            del self._inbox[:size]
            protocol, length = struct.unpack_from(">HH", request, 2)
            if protocol == 0 and 2 <= length <= LONGEST:
                self._handle(request)
            else:
                self._inbox.clear()

    def _handle(self, request: bytes) -> None:
        hits = self.judge()
        if "deaf" in hits:
            return
        pdu = modbus_answer(self, request[7:], hits)
        self.hand.events.clear()  # nothing on Modbus tells an end (dossier Q9)
        if pdu is None:
            return
        if "twin-ip" in self.faults and self._other:
            pdu = modbus_twin(self, request[7:], pdu)
        number = struct.unpack_from(">H", request)[0]
        if "txid-off" in self.faults:
            number = (number - 1) % 65536
        reply = struct.pack(">HHHB", number, 0, len(pdu) + 1, request[6]) + pdu
        self._asked = {reply: request[7:]}
        self.replies.append(Reply(self.now, reply, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        """There is no check sum: the length is another one."""
        return data[:5] + bytes([(data[5] + 1) % 256]) + data[6:]

    def readdress(self, data: bytes) -> bytes:
        """The answer to another transaction, of another unit."""
        return struct.pack(">H", (struct.unpack_from(">H", data)[0] + 257) % 65536) + data[2:6] + bytes([7]) + data[7:]

    def twin(self, data: bytes) -> bytes:
        request = self._asked.get(data)
        return data if request is None else data[:7] + modbus_twin(self, request, data[7:])


def _size(data: bytes | bytearray) -> int:
    """Bytes of the request that begins so, 0: not known yet."""
    return 6 + struct.unpack_from(">H", data, 4)[0] if len(data) >= 6 else 0
