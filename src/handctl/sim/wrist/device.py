"""A simulated wrist module on RS-232 or RS-485: frames, the late result of a save (wrist §2.2, RH56 §2.2).

Flags 30 and 31 (hex) reach the wrist, 11 and 12 the hand that carries it; one id, the hand's. Written from the manual
alone, by other means than the host.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.model import Options, Random, Reply
from handctl.sim.inspire.frames import find, frame
from handctl.sim.wrist import model
from handctl.sim.wrist.model import Module

READ_HAND, WRITE_HAND, READ_WRIST, WRITE_WRIST = 17, 18, 48, 49  # flags
SAVE_TIME = 1.0  # s from the ack to the result (RH56)

_OPTIONS = {
    **model.OPTIONS,
    "id": "id at the first start, 1..254 (default 1)",
    "baud": "speed at the first start: 115200, 57600 or 19200",
    "ack-id": "the ack of an id change carries the id: new (default) or old",
    "result-flag": "flag of the save result: 17 (11 hex, default) or 18 (12 hex)",
    "gap": "seconds of silence after which an unfinished request is forgotten (default 0.1)",
}
_FAULTS = {**model.FAULTS, "no-late-frames": "no save result, no end of a calibration"}


class Device(Module):
    """The module on its serial wire."""

    HEADER = b"\x90\xeb"
    OPTIONS = _OPTIONS
    FAULTS = _FAULTS
    SPEEDS = (115200, 57600, 19200)  # speed codes 0, 1, 2 (RH56)

    def __init__(self, options: Options, random: Random) -> None:
        speed = int(options.choice("baud", "115200", tuple(str(value) for value in self.SPEEDS)))
        super().__init__(options, random, self.SPEEDS.index(speed))
        self._old_id_acks = options.choice("ack-id", "new", ("new", "old")) == "old"
        self._result_flag = int(options.choice("result-flag", "17", ("17", "18")))
        self._gap = options.seconds("gap", 0.1, 3600.0)
        self._inbox = bytearray()
        self._heard = 0.0

    def advance(self, now: float) -> None:
        super().advance(now)
        if self._inbox and now - self._heard > self._gap:
            self._inbox.clear()

    def power(self, on: bool) -> None:
        self._inbox.clear()
        super().power(on)

    def due(self, pending: bytes) -> int | None:
        _, size, decided = find(self._inbox + pending, self.id, _possible)
        return decided - len(self._inbox) if size else None

    def feed(self, data: bytes) -> None:
        self._heard = self.now
        self._inbox += data
        while True:
            skip, size, _ = find(self._inbox, self.id, _possible)
            request = bytes(self._inbox[skip : skip + size])
            del self._inbox[: skip + size]
            if not request:
                return
            self._handle(request)

    def _handle(self, request: bytes) -> None:
        hits = self.judge()
        if "deaf" in hits:
            return
        flag, body, sender, before = request[4], request[5:-1], self.id, len(self._replies)
        address = struct.unpack_from("<H", body)[0]
        space = self.wrist if flag in (READ_WRIST, WRITE_WRIST) else self.hand
        if flag in (READ_WRIST, READ_HAND):
            # No count of 0 and none above 252 (the length byte is count + 3), none past the last address.
            answer = self.read(space, address, body[2]) if 1 <= body[2] <= 252 and address + body[2] <= 65536 else None
        else:
            done = self.write(space, address, body[2:], hits)
            answer = None if done is None else bytes([done])  # 01; 00 is taken to mean refused (open)
        if answer is not None:
            # An id change acts at once: the ack comes from the new id already (RH56), or from the old one (ack-id).
            # Ahead of what the request itself set off.
            answered_by = sender if self._old_id_acks else self.id
            reply = frame(answered_by, flag, struct.pack("<H", address) + answer)
            self._replies.insert(before, Reply(self.now, reply, hits))

    def saved(self, hits: frozenset[str]) -> None:
        """00 is saved, FF is failed (RH56 §2.2.2)."""
        if "no-late-frames" not in self.faults:
            result = struct.pack("<HB", 1005, 255 if "save-fails" in self.faults else 0)
            self._replies.append(Reply(self.now + SAVE_TIME, frame(self.id, self._result_flag, result), hits))

    def calibrates(self, end: float, hits: frozenset[str]) -> None:
        """The end is told with address 2 and a 00 of unknown meaning (RH56 chapter 3, example 5)."""
        if "no-late-frames" not in self.faults:
            self._replies.append(Reply(end, frame(self.id, READ_HAND, struct.pack("<HB", 2, 0)), hits))

    # -- faults that know the frame -----------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        return data[:-1] + bytes([(data[-1] + 1) % 256])

    def readdress(self, data: bytes) -> bytes:
        return frame(data[2] % 254 + 1, data[4], data[5:-1])

    def twin(self, data: bytes) -> bytes:
        """The second device got the same commands, so only what it measures differs."""
        if data[4] not in (READ_WRIST, READ_HAND):
            return data
        space = self.wrist if data[4] == READ_WRIST else self.hand
        address = struct.unpack_from("<H", data, 5)[0]
        return frame(data[2], data[4], data[5:7] + space.twin(address, data[7:-1]))


def _possible(flag: int, length: int) -> bool:
    """Whether a request can have this flag and length: reads 4, writes 3 + data.

    A write of 8 bytes looks like an exo's force command; a wrist takes it for what it is here, a write (wrist §2.2.1).
    """
    if flag in (WRITE_WRIST, WRITE_HAND):
        return length >= 4
    return flag in (READ_WRIST, READ_HAND) and length == 4
