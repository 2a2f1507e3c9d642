"""A simulated RH56DFTP hand on Modbus TCP (RH56 dossier §2.3).

    transaction  protocol 0  length  unit  function  ...        numbers go high byte first; the length counts from the unit on

The unit is not used: an answer has that of its request. Requests are answered in their order.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Options, Random, Reply
from handctl.sim.hand import modbus
from handctl.sim.hand.model import Hand
from handctl.sim.hand.options import FAULTS, MODBUS_FAULTS, MODBUS_OPTIONS, OPTIONS, TCP_FAULTS
from handctl.sim.hand.wires import Front

LONGEST = 254  # unit and what follows it, by the standard
_OPTIONS = {**OPTIONS, **MODBUS_OPTIONS}
_FAULTS = {**FAULTS, **MODBUS_FAULTS, **TCP_FAULTS}


class Device(Front):
    """One connection to the hand."""

    BUS = "modbus-tcp"
    HEADER = b"\0\0\xff\x03"
    OPTIONS = _OPTIONS
    FAULTS = _FAULTS

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
    def host(self) -> str:
        return ".".join(str(part) for part in self.hand.address)

    @property
    def one_client(self) -> bool:
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
        pdu = modbus.answer(self, request[7:], hits)
        self.hand.events.clear()  # nothing on Modbus tells an end (dossier Q9)
        if pdu is None:
            return
        if "twin-ip" in self.faults and self._other:
            pdu = modbus.twin(self, request[7:], pdu)
        number = struct.unpack_from(">H", request)[0]
        if "txid-off" in self.faults:
            number = (number - 1) % 65536
        reply = struct.pack(">HHHB", number, 0, len(pdu) + 1, request[6]) + pdu
        self._asked = {reply: request[7:]}
        self._replies.append(Reply(self.now, reply, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        """There is no check sum: the length is another one."""
        return data[:5] + bytes([(data[5] + 1) % 256]) + data[6:]

    def readdress(self, data: bytes) -> bytes:
        """The answer to another transaction, of another unit."""
        return struct.pack(">H", (struct.unpack_from(">H", data)[0] + 257) % 65536) + data[2:6] + bytes([7]) + data[7:]

    def twin(self, data: bytes) -> bytes:
        request = self._asked.get(data)
        return data if request is None else data[:7] + modbus.twin(self, request, data[7:])


def _size(data: bytes | bytearray) -> int:
    """Bytes of the request that begins so, 0: not known yet."""
    return 6 + struct.unpack_from(">H", data, 4)[0] if len(data) >= 6 else 0
