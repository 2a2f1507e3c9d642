"""A simulated wrist module on CAN (wrist §2.3): flag 4 reads the wrist, 5 writes it, 0 and 1 the hand."""

from __future__ import annotations

from handctl.sim.inspire.frames import Can
from handctl.sim.wrist import model
from handctl.sim.wrist.model import Module

_OPTIONS = {
    **model.OPTIONS,
    "id": ((1, 0, 16383), "id at the first start, 0..16383 (default 1)"),
    "bitrate": (("1000000", "500000"), "speed at the first start: 1000000 (default) or 500000"),
    "ack-dlc": (False, "data bytes of a write's acknowledgement: 0 (default), or 1 with the number of bytes written"),
}


class Device(Can, Module):
    """The module on its CAN bus."""

    OPTIONS = _OPTIONS
    SPEED = "bitrate"
    SPEEDS = (1000000, 500000)  # wrist §2.3; the second speed code is that of the RH56 on CAN
    FLAGS = {0: ("carrier", False), 1: ("carrier", True), 4: ("wrist", False), 5: ("wrist", True)}  # noqa: RUF012

    def ack(self, written: int) -> bytes:
        """The manual's acknowledgement is empty and so cannot tell a refusal: only reading back does (open)."""
        return bytes([written] if self.given["ack-dlc"] else [])
