"""The register map of the EH55BF1 exoskeleton hand (exo §2.3). The only source for its names and addresses. Knows no wire.

Finger order everywhere: little, ring, middle, index, thumb (exo §2.2.1).
"""

from __future__ import annotations

from typing import Any

from handctl.devices.inspire.register_map import ALONE, BAUD_RATES, ERROR_BITS, MOVING, Register, s16, u8
from handctl.model.param import MOVES, PUSHES, SETTING, TRIGGER, ParamMap

FINGERS = ("little", "ring", "middle", "index", "thumb")
DEGREES_OF_FREEDOM = (*FINGERS, "thumb_rotation")

_SET: dict[str, Any] = {"access": "rw", "kind": SETTING, "persistent": "yes", "strands": True}
_DO: dict[str, Any] = {"access": "rw", "kind": TRIGGER, "low": 0, "high": 1}
_SPEEDS = {code: f"{rate} baud" for code, rate in BAUD_RATES.items()}
_NOT_COMMANDED = {ALONE: "not commanded"}
_FIVE: dict[str, Any] = {"elements": FINGERS}
_SIX: dict[str, Any] = {"elements": DEGREES_OF_FREEDOM}

# fmt: off
EXO: ParamMap[Register] = ParamMap("exo", [
    u8(1000, "id", "id of the hand on its line", "exo §2.3.1", low=1, high=254, **_SET),
    u8(1001, "baud_code", "speed after save and power cycle", "exo §2.3.2", choices=_SPEEDS, **_SET),
    u8(1004, "clear_errors", "write 1: clear the clearable actuator errors", "exo §2.3.3", verb="clear-errors", **_DO),
    u8(1005, "save", "write 1: save the present parameters to flash", "exo §2.3.4", verb="save", strands=True, **_DO),
    u8(1006, "factory_reset", "write 1: restore factory defaults (undocumented address, taken from the RH56 hand)",
        "exo §2.3.5 (no address), RH56 §2.4.5", verb="factory-reset", strands=True, **(_DO | {"access": "w"})),
    u8(1009, "calibrate", "write 1: calibrate forces and positions while someone wears the hand", "exo §2.3.6", verb="calibrate", persistent="unknown", acts=MOVES, **_DO),
    s16(1472, "system_voltage", "supply voltage as the hand counts it", "exo §2.3", note="raw, scale unknown"),
    s16(1486, "position_set", "commanded position, 0 bent to 1000 open, -1 leaves a finger alone", "exo §2.3.7", low=0, high=1000, special=_NOT_COMMANDED, **_FIVE, **MOVING),
    s16(1498, "force_set", "commanded force, positive opens the hand, negative closes it", "exo §2.3.8", low=-1000, high=1000, **_FIVE, **(MOVING | {"acts": PUSHES})),
    s16(1546, "position_actual", "measured position, 0 bent to 1000 open, thumb rotation 0 inside the palm", "exo §2.3.9", low=0, high=1000, **_SIX),
    s16(1582, "force_actual", "measured force, positive when the user closes the hand, negative when opening it", "exo §2.3.10", low=-1000, high=1000, **_FIVE),
    s16(1594, "current", "actuator current", "exo §2.3.11", unit="mA", low=0, high=1000, **_FIVE),
    u8(1606, "error", "actuator error bits", "exo §2.3.12", bits=ERROR_BITS, **_FIVE),
    u8(1618, "temperature", "actuator temperature", "exo §2.3.13", unit="°C", low=0, high=100, **_FIVE),
])
# fmt: on
"""1609 is the index finger although §2.3.12 prints "thumb": its own example says so."""
