"""A simulated wrist module on CAN: identifiers, reads and writes of up to 8 bytes (wrist §2.3).

    bit  28 27 26 | 25 ...... 14 | 13 ....... 0
         flag     |   address    |   hand id        flag 4 read wrist, 5 write wrist, 0 read hand, 1 write hand

The reply carries the identifier of its request. A message is passed as its identifier in 4 bytes, high byte first,
and then the data (see canline.py). Knows one frame at a time; the bus is the line's.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Options, Random, Reply
from handctl.sim.wrist import model
from handctl.sim.wrist.model import Module

READ_HAND, WRITE_HAND, READ_WRIST, WRITE_WRIST = 0, 1, 4, 5  # flags

_OPTIONS = {
    **model.OPTIONS,
    "id": "id at the first start, 0..16383 (default 1)",
    "bitrate": "speed at the first start: 1000000 (default) or 500000",
    "ack-dlc": "data bytes of a write's acknowledgement: 0 (default), or 1 with the number of bytes written",
}


class Device(Module):
    """The module on its CAN bus."""

    OPTIONS = _OPTIONS
    SPEEDS = (1000000, 500000)  # wrist §2.3; the second speed code is that of the RH56 on CAN
    IDS = (0, 16383)

    def __init__(self, options: Options, random: Random) -> None:
        speed = int(options.choice("bitrate", "1000000", tuple(str(value) for value in self.SPEEDS)))
        super().__init__(options, random, self.SPEEDS.index(speed))
        self._counts = options.choice("ack-dlc", "0", ("0", "1")) == "1"

    def feed(self, data: bytes) -> None:
        identifier, body = struct.unpack_from(">I", data)[0], data[4:]
        flag, address, number = identifier >> 26, (identifier >> 14) % 4096, identifier % 16384
        if number != self.id or not _possible(flag, body):
            return
        hits = self.judge()
        if "deaf" in hits:
            return
        space = self.wrist if flag in (READ_WRIST, WRITE_WRIST) else self.hand
        if flag in (READ_WRIST, READ_HAND):
            answer = self.read(space, address, body[0])
        else:
            done = self.write(space, address, body, hits)
            # The manual's acknowledgement is empty and so cannot tell a refusal: only reading back does (open).
            written = bytes([len(body) if done else 0]) if self._counts else b""
            answer = None if done is None else written
        if answer is not None:
            # After an id change too the reply carries the identifier of its request (open).
            self._replies.append(Reply(self.now, data[:4] + answer, hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------

    def readdress(self, data: bytes) -> bytes:
        identifier = struct.unpack_from(">I", data)[0]
        number = identifier % 16384
        return struct.pack(">I", identifier - number + (number + 1) % 16384) + data[4:]

    def twin(self, data: bytes) -> bytes:
        """The second device got the same commands, so only what it measures differs."""
        identifier = struct.unpack_from(">I", data)[0]
        flag, address = identifier >> 26, (identifier >> 14) % 4096
        if flag not in (READ_WRIST, READ_HAND):
            return data
        space = self.wrist if flag == READ_WRIST else self.hand
        return data[:4] + space.twin(address, data[4:])


def _possible(flag: int, body: bytes) -> bool:
    """A read has one data byte, a count of 1 to 8; a write has 1 to 8 (wrist §2.3.1, §2.3.2). Else silence."""
    if flag in (READ_WRIST, READ_HAND):
        return len(body) == 1 and 1 <= body[0] <= 8
    return flag in (WRITE_WRIST, WRITE_HAND) and len(body) > 0
