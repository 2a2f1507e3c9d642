"""A simulated RH56 hand on CAN: identifiers, reads and writes of up to 8 bytes (RH56 dossier §2.4).

    DF, TP   bit  28 27 26 | 25 ...... 14 | 13 ....... 0      flag 0 read, 1 write; the answer has the identifier of its request
                  flag     |   address    |   hand id
    F1, DG2  bit  28    | 27 .... 20 | 19 ..... 8 | 7 .. 0    those of CAN FD, here with 8 bytes at most as CAN 2.0 has them
                  write | length     | address    | id

A message is passed as its identifier in 4 bytes, high byte first, and then the data (engine/canline.py).
"""

from __future__ import annotations

from handctl.sim.engine.model import Options, Random
from handctl.sim.hand.model import Hand
from handctl.sim.hand.options import CAN_OPTIONS, FAULTS, OPTIONS
from handctl.sim.hand.wires import Front
from handctl.sim.inspire.frames import Can

_OPTIONS = {**OPTIONS, **CAN_OPTIONS}


class Device(Can, Front):
    """The hand on its CAN bus."""

    BUS = "can"
    OPTIONS = _OPTIONS
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
