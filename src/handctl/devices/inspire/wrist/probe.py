"""Detect a wrist module: read two bytes of a current, and if it replies, two of pitch_actual (wrist §2.1). Read-only.

On a serial line nobody knows yet who listens, and at a BarrettHand's own speed 03 is ^C, which ends a movement: pitch_actual
lies at 1020, FC 03 on the line, the current at 1024, 00 04.
"""

from __future__ import annotations

from handctl.devices.inspire.identity import ITS_CURRENT, WRIST
from handctl.devices.inspire.scan import SCAN_BAUD_RATES as SPEEDS
from handctl.devices.inspire.scan import Probing, Target, ignores_speed, parse_ids, sweep
from handctl.devices.inspire.serial_bus import WIRING_HINT

__all__ = ["SPEEDS", "ignores_speed", "parse_ids", "sweep"]

WIRES = ("serial", "tcp", "can")
PING = "current_1024"
TARGET = Target(WRIST, probe=(1020, 2), twin=(1020, 4), value="pitch_raw", silence_hint=WIRING_HINT, can=(1020, 2))
OWN = Probing(TARGET, live=ITS_CURRENT, long=(1020, 24))
"""One of its currents, and one long answer (wrist §2.1)."""
probe, ping, identify, further = OWN.probe, OWN.ping, OWN.identify, OWN.further
measure, overheard = OWN.measure, OWN.overheard
