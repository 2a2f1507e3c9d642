"""Detect an EH55BF1: two bytes of system_voltage are read at the link's present speed (exo §2.3). Read-only.

The hands of the same maker answer it as well: a wrist is looked for first, and what answers both is a wrist.
"""

from __future__ import annotations

from handctl.devices.inspire.identity import EXO
from handctl.devices.inspire.scan import SCAN_BAUD_RATES as SPEEDS
from handctl.devices.inspire.scan import Probing, Target, ignores_speed, parse_ids, sweep
from handctl.devices.inspire.serial_bus import SILENCE_HINT

__all__ = ["SPEEDS", "ignores_speed", "parse_ids", "sweep"]

WIRES = ("serial", "tcp")
PING = "force_actual"
TARGET = Target(
    EXO,
    probe=(1472, 2),
    twin=(1546, 12),
    value="system_voltage",
    both_ways=True,  # RS-232 and Bluetooth (exo §1.1)
    silence_hint=SILENCE_HINT.replace("--id 1 at 115200 bit/s, {}, ", ""),
)


OWN = Probing(TARGET, live=(1582, 2), long=(1472, 151))
"""One of its forces, and one long answer (exo §2.3)."""
probe, ping, identify, further = OWN.probe, OWN.ping, OWN.identify, OWN.further
measure, overheard = OWN.measure, OWN.overheard
