"""A simulated wrist module on RS-232 or RS-485: frames, the late result of a save (wrist §2.2, RH56 §2.2).

Flags 30 and 31 (hex) reach the wrist, 11 and 12 the hand that carries it; one id, the hand's. A write of 8 bytes looks like an
exo's force command; a wrist takes it for what it is here, a write (wrist §2.2.1). Written from the manual alone, by other means
than the host.
"""

from __future__ import annotations

from handctl.sim.inspire.frames import Serial
from handctl.sim.wrist import model
from handctl.sim.wrist.model import Module

_OPTIONS = {
    **model.OPTIONS,
    "id": ((1, 1, 254), "id at the first start, 1..254 (default 1)"),
    "baud": (("115200", "57600", "19200"), "speed at the first start: 115200, 57600 or 19200"),
    "ack-id": (("new", "old"), "the ack of an id change carries the id: new (default) or old"),
    "result-flag": (("17", "18"), "flag of the save result: 17 (11 hex, default) or 18 (12 hex)"),
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
