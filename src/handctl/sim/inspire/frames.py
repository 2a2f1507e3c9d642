"""Frames of the simulated Inspire devices, serial and CAN (exo §2.2, wrist §2.2, §2.3): requests found, answers built.

EB 90 starts what the host sends, 90 EB what the device sends. Which flags there are, and what a read and a write do, is the
business of each device: a flag is a row (space that it means, whether it writes).
"""

from __future__ import annotations

import struct

from handctl.sim.engine.simulated_device import Model, Reply

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any, ClassVar

    from handctl.sim.inspire.memory import Element, Space


def find(buffer: bytes | bytearray, device_id: int, possible: Callable[[int, int], bool]) -> tuple[int, int, int]:
    """The first request for this id: bytes before it, its size (0: none yet), bytes needed to be sure of it.

        EB 90  id  length  flag  ...  sum        the frame has length + 5 bytes (exo §2.2, wrist §2.2)

    Wrong id, a flag and length that are not `possible`, and a bad sum are no requests: silence (exo §2.1). A candidate
    that fails costs one byte, so that a request behind it, or inside it, is still found.
    """
    start = decided = 0
    while (start := buffer.find(b"\xeb\x90", start)) >= 0:
        head = buffer[start + 2 : start + 5]
        if not head or head[0] == device_id:
            if len(head) < 3:
                return start, 0, 0
            if possible(head[2], head[1]):
                size = head[1] + 5
                if len(buffer) < start + size:
                    return start, 0, 0
                decided = max(decided, start + size)
                if buffer[start + size - 1] == _sum(buffer[start + 2 : start + size - 1]):
                    return start, size, decided
        start += 1
    return len(buffer) - (1 if buffer[-1:] == b"\xeb" else 0), 0, 0


def frame(device_id: int, flag: int, body: bytes) -> bytes:
    """90 EB  id  length  flag  body  sum; the length counts flag and body (exo §2.2, wrist §2.2)."""
    inner = struct.pack("BBB", device_id, len(body) + 1, flag) + body
    return struct.pack("BB", 144, 235) + inner + struct.pack("B", _sum(inner))


def _sum(data: bytes | bytearray) -> int:
    """Low byte of the sum of everything between header and sum (exo §2.2.1 note 2, wrist §2.2)."""
    return sum(data) % 256


SERIAL_OPTIONS = {
    "id": ((1, 1, 254), "id at the first start, 1..254 (default 1)"),
    "baud": (("115200", "57600", "19200"), "baud rate at the first start: 115200, 57600 or 19200"),
    "ack-id": (("new", "old"), "the ack of an id change carries the id: new (default) or old"),
    "result-flag": (("17", "18"), "flag of the save result: 17 (11 hex, default) or 18 (12 hex)"),
}


class Asked(Model):
    """A device with address spaces that are read and written. `unit` is how many bytes one address counts."""

    FLAGS: ClassVar[dict[int, tuple[str, bool]]] = {}
    IDS = (1, 254)
    unit = 1
    id: int

    spaces: dict[str, Space]

    def publish(self, space: str = "") -> None:
        """Puts the readings of this moment into memory, of a device that does not do so from time to time."""

    def stored(self, accepted: Sequence[Element], hits: frozenset[str]) -> None:
        """Carries out what a write may set."""
        raise NotImplementedError

    def read(self, space: str, address: int, count: int) -> bytes | None:
        """The bytes from this byte address, None: silence."""
        if "block-silent" in self.faults and not self.spaces[space].documented(address, count):
            return None
        self.publish(space)
        return self.spaces[space].read(address, count)

    def write(self, space: str, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """Whether the write is accepted, None: silence. Gaps, read-only bytes and values out of range are ignored but
        acknowledged (open on hardware), or met with silence in the state "strict".
        """
        accepted, covered = self.spaces[space].plan(address, data)
        if "strict" in self.faults and covered < len(data):
            return None
        if "refuse" in hits:
            return False
        self.dirty = self.dirty or bool(accepted)
        self.stored(accepted, hits)
        return True

    def second(self, space: str, address: int, data: bytes) -> bytes:
        """What a second device with the same commands would answer to a read at this byte address."""
        return self.spaces[space].twin(address, data)


class Serial(Asked):
    """The device on its serial wire; it has the options ack-id, result-flag and gap."""

    HEADER = b"\x90\xeb"
    SAVE_TIME = 1.0  # s from the ack to the result (RH56)

    def __init__(self, *made: Any) -> None:
        super().__init__(*made)
        self._inbox = bytearray()
        self._heard = -1.0

    def advance(self, now: float) -> None:
        super().advance(now)
        if now - self._heard > self.given["gap"]:
            self._inbox.clear()

    def power(self, on: bool) -> None:
        self._inbox.clear()
        super().power(on)

    def possible(self, flag: int, length: int) -> bool:
        """Whether a request can have this flag and length: reads 4, writes 3 + data."""
        return flag in self.FLAGS and (length >= 4 if self.FLAGS[flag][1] else length == 4)

    def due(self, pending: bytes) -> int | None:
        _, size, decided = find(self._inbox + pending, self.id, self.possible)
        return decided - len(self._inbox) if size else None

    def feed(self, data: bytes) -> None:
        self._heard = self.now
        self._inbox += data
        while self._inbox:
            skip, size, _ = find(self._inbox, self.id, self.possible)
            request = bytes(self._inbox[skip : skip + size])
            del self._inbox[: skip + size]
            if not request:
                return
            self._handle(request)

    @property
    def busy(self) -> bool:
        """Whether it hears nothing just now."""
        return False

    def _handle(self, request: bytes) -> frozenset[str]:
        """Answers it; the faults that befall it."""
        hits = self.judge()
        if "deaf" in hits or self.busy:
            return hits
        flag, sender, before = request[4], self.id, len(self.replies)
        answer = self.answer(flag, request[5:-1], hits)
        if answer is not None:
            # An id change acts at once: the ack comes from the new id already (RH56), or from the old one (ack-id).
            # Ahead of what the request itself set off, a late frame that may be due at once.
            number = sender if self.given["ack-id"] == "old" else self.id
            self.replies.insert(before, Reply(self.now, frame(number, flag, answer), hits))
        return hits

    def answer(self, flag: int, body: bytes, hits: frozenset[str]) -> bytes | None:
        """The body of the answer, None: silence. An ack ends in 01; 00 is taken to mean refused (open)."""
        space, writes = self.FLAGS[flag]
        address: int = struct.unpack_from("<H", body)[0]
        if writes:
            done = self.write(space, address * self.unit, body[2:], hits)
            data = None if done is None else bytes([done])
        else:  # no count of 0 and none above 252 (the length byte is count + 3), none past the last address
            good = 1 <= body[2] <= 252 and address * self.unit + body[2] <= 65536 * self.unit
            data = self.read(space, address * self.unit, body[2]) if good else None
        return None if data is None else body[:2] + data

    def tell_saved(self, when: float, address: int, hits: frozenset[str]) -> None:
        """The result of a save: 00 is saved, FF is failed (RH56 §2.2.2)."""
        result = struct.pack("<HB", address, 255 if "save-fails" in self.faults else 0)
        self._tell(when, int(self.given["result-flag"]), result, hits)

    def tell_calibrated(self, when: float, hits: frozenset[str]) -> None:
        """The end of a calibration, with address 2 and a 00 of unknown meaning (RH56 chapter 3, example 5)."""
        self._tell(when, 17, struct.pack("<HB", 2, 0), hits)

    def _tell(self, when: float, flag: int, body: bytes, hits: frozenset[str]) -> None:
        if "no-late-frames" not in self.faults:
            self.replies.append(Reply(when, frame(self.id, flag, body), hits))

    def readdress(self, data: bytes) -> bytes:
        return frame(data[2] % 254 + 1, data[4], data[5:-1])

    def twin(self, data: bytes) -> bytes:
        """The second device got the same commands, so only what it measures differs."""
        space, writes = self.FLAGS[data[4]]
        if writes:
            return data
        address = struct.unpack_from("<H", data, 5)[0] * self.unit
        return frame(data[2], data[4], data[5:7] + self.second(space, address, data[7:-1]))


class Can(Asked):
    """The device on its CAN bus: reads and writes of up to 8 bytes (wrist §2.3).

        bit  28 27 26 | 25 ...... 14 | 13 ....... 0
             flag     |   address    |   hand id

    The reply carries the identifier of its request. A message is passed as its identifier in 4 bytes, high byte first, and
    then the data (engine/can_line.py).
    """

    SPEEDS = (1000000, 500000)  # by speed code
    IDS = (0, 16383)

    def parts(self, identifier: int) -> tuple[int, int, int]:
        """Flag, address and id."""
        return identifier >> 26, (identifier >> 14) % 4096, identifier % 16384

    def ack(self, written: int) -> bytes:
        """What follows the identifier when so many bytes were written. It cannot tell a refusal but by that (open)."""
        raise NotImplementedError

    def replying(self, identifier: int, answer: bytes) -> int:
        """The identifier of this answer; after an id change too that of its request (open)."""
        return identifier

    def feed(self, data: bytes) -> None:
        identifier, body = struct.unpack_from(">I", data)[0], data[4:]
        flag, address, number = self.parts(identifier)
        if number != self.id or flag not in self.FLAGS or not self.possible(flag, identifier, body):
            return
        hits = self.judge()
        if "deaf" in hits:
            return
        space, writes = self.FLAGS[flag]
        if writes:
            done = self.write(space, address * self.unit, body, hits)
            answer = None if done is None else self.ack(len(body) if done else 0)
        else:
            answer = self.read(space, address * self.unit, body[0])
        if answer is not None:
            self.replies.append(Reply(self.now, struct.pack(">I", self.replying(identifier, answer)) + answer, hits))

    def possible(self, flag: int, identifier: int, body: bytes) -> bool:
        """A read has one data byte, a count of 1 to 8; a write has 1 to 8 (wrist §2.3.1, §2.3.2). Else silence."""
        return len(body) > 0 if self.FLAGS[flag][1] else len(body) == 1 and 1 <= body[0] <= 8

    def readdress(self, data: bytes) -> bytes:
        identifier, ids = struct.unpack_from(">I", data)[0], self.IDS[1] + 1
        return struct.pack(">I", identifier - identifier % ids + (identifier % ids + 1) % ids) + data[4:]

    def twin(self, data: bytes) -> bytes:
        """The second device got the same commands, so only what it measures differs."""
        flag, address, _ = self.parts(struct.unpack_from(">I", data)[0])
        space, writes = self.FLAGS[flag]
        return data if writes else data[:4] + self.second(space, address * self.unit, data[4:])
