"""The wires of a simulated wrist module: RS-232 or RS-485 with the late result of a save (wrist §2.2, RH56 §2.2), CAN (§2.3).

Flags 30 and 31 (hex) reach the wrist, 11 and 12 the hand that carries it; one id, the hand's. A write of 8 bytes looks like an
exo's force command; a wrist takes it for what it is here, a write (wrist §2.2.1). Written from the manual alone, by other means
than the host.
"""

from __future__ import annotations

from handctl.sim.inspire.frames import SERIAL_OPTIONS, Can, Serial
from handctl.sim.wrist import model
from handctl.sim.wrist.model import Module

_OPTIONS = {
    **model.OPTIONS,
    **SERIAL_OPTIONS,
    "gap": ((0.1, 3600.0), "seconds of silence after which an unfinished request is forgotten (default 0.1)"),
}
_FAULTS = {**model.FAULTS, "no-late-frames": "no save result, no end of a calibration"}


class Device(Serial, Module):
    """The module on its serial wire."""

    OPTIONS = _OPTIONS
    FAULTS = _FAULTS
    SPEEDS = (115200, 57600, 19200)  # speed codes 0, 1, 2 (RH56)
    FLAGS = {17: ("carrier", False), 18: ("carrier", True), 48: ("wrist", False), 49: ("wrist", True)}  # noqa: RUF012

    def saved(self, hits: frozenset[str]) -> None:
        self.tell_saved(self.now + self.SAVE_TIME, 1005, hits)

    def calibrates(self, end: float, hits: frozenset[str]) -> None:
        self.tell_calibrated(end, hits)


_CAN_OPTIONS = {
    **model.OPTIONS,
    "id": ((1, 0, 16383), "id at the first start, 0..16383 (default 1)"),
    "bitrate": (("1000000", "500000"), "bitrate at the first start: 1000000 (default) or 500000"),
    "ack-dlc": (False, "data bytes of a write's acknowledgement: 0 (default), or 1 with the number of bytes written"),
}


class CanDevice(Can, Module):
    """The module on its CAN bus: flag 4 reads the wrist, 5 writes it, 0 and 1 the hand."""

    OPTIONS = _CAN_OPTIONS
    SPEED = "bitrate"
    SPEEDS = (1000000, 500000)  # wrist §2.3; the second speed code is that of the RH56 on CAN
    FLAGS = {0: ("carrier", False), 1: ("carrier", True), 4: ("wrist", False), 5: ("wrist", True)}  # noqa: RUF012

    def ack(self, written: int) -> bytes:
        """The manual's acknowledgement is empty and so cannot tell a refusal: only reading back does (open)."""
        return bytes([written] if self.given["ack-dlc"] else [])
