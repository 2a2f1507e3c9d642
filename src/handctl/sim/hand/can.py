"""A simulated RH56 hand on CAN: identifiers, reads and writes of up to 8 bytes (RH56 dossier §2.4).

    DF, TP   bit  28 27 26 | 25 ...... 14 | 13 ....... 0      flag 0 read, 1 write; the answer has the identifier of its request
                  flag     |   address    |   hand id
    F1, DG2  bit  28    | 27 .... 20 | 19 ..... 8 | 7 .. 0    those of CAN FD, here with 8 bytes at most as CAN 2.0 has them
                  write | length     | address    | id

A message is passed as its identifier in 4 bytes, high byte first, and then the data (engine/canline.py).
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Options, Random, Reply
from handctl.sim.hand.front import Front
from handctl.sim.hand.model import Hand
from handctl.sim.hand.options import CAN_OPTIONS, FAULTS, OPTIONS

READ, WRITE = 0, 1  # flags
SPEEDS = (1000000, 500000)  # by speed code
_OPTIONS = {**OPTIONS, **CAN_OPTIONS}


class Device(Front):
    """The hand on its CAN bus."""

    OPTIONS = _OPTIONS
    FAULTS = FAULTS

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random, hand)
        options.choice("bus", "can", ("can",))
        code = SPEEDS.index(int(options.choice("bitrate", "1000000", tuple(str(value) for value in SPEEDS))))
        if hand is None:
            self.hand.flash_code = code
        self.speed = SPEEDS[code]
        self._counts = options.choice("ack", "count", ("count", "empty")) == "count"
        self._asked: dict[bytes, int] = {}  # answer to a read -> its byte address

    def power(self, on: bool) -> None:
        super().power(on)
        if on:
            self.restored()

    def restored(self) -> None:
        self.speed = SPEEDS[min(1, self.hand.speed_code)]

    def feed(self, data: bytes) -> None:
        identifier, body = struct.unpack_from(">I", data)[0], data[4:]
        unit = self.hand.generation.unit
        if unit == 1:
            flag, address, number = identifier >> 26, (identifier >> 14) % 4096, identifier % 16384
        else:
            flag, address, number = identifier >> 28, (identifier >> 8) % 4096, identifier % 256
            if (identifier >> 20) % 256 != len(body):
                return
        if number != self.hand.number or not _possible(flag, body):
            return
        hits = self.judge()
        if "deaf" in hits:
            return
        if flag == READ:
            answer = self.hand.read(address * unit, body[0])
        else:
            done = self.write(address * unit, body, hits)
            # The ack cannot tell a refusal but by its number: only reading back does (open).
            answer = None if done is None else bytes([(len(body) if unit == 1 else 1) if done else 0])
            answer = b"" if answer is not None and not self._counts else answer
        self.hand.events.clear()  # nothing on CAN tells an end (open)
        if answer is not None:
            if unit == 2:  # the length in the identifier is that of its own frame
                identifier = identifier - ((identifier >> 20) % 256 << 20) + (len(answer) << 20)
            reply = struct.pack(">I", identifier) + answer
            self._asked = {reply: address * unit} if flag == READ else {}
            self._replies.append(Reply(self.now, reply, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------------

    def readdress(self, data: bytes) -> bytes:
        """With another id."""
        identifier = struct.unpack_from(">I", data)[0]
        ids = 16384 if self.hand.generation.unit == 1 else 256
        return struct.pack(">I", identifier - identifier % ids + (identifier % ids + 1) % ids) + data[4:]

    def twin(self, data: bytes) -> bytes:
        address = self._asked.get(data)
        return data if address is None else data[:4] + self.twin_of(address, data[4:])


def _possible(flag: int, body: bytes) -> bool:
    """A read has one data byte, a count of 1 to 8; a write has 1 to 8. Else silence."""
    return (len(body) == 1 and 1 <= body[0] <= 8) if flag == READ else flag == WRITE and len(body) > 0
