"""The register map of the wrist module (wrist §2.1). The only source for its names and addresses. Knows no wire.

Actual angles lie pitch first, set angles yaw first; error bytes lie two apart.
"""

from __future__ import annotations

from handctl.devices.inspire.register_map import ERROR_BITS, MOVING, Register, s16, u8
from handctl.fast_classes import fast_dataclass
from handctl.model.param import COMMAND, ParamMap

PITCH_RANGE = (-22.66, 22.12)
YAW_RANGE = (-25.50, 25.50)
"""Degrees (wrist §1)."""
NEAR, NOISE = 50, 5
"""0.01 degrees: within them an axis is at its target, and the reading of a resting one changes by no more. Both are this tool's."""
_ASSUMED = "bit names assumed from the hand"
_RANGE = "wrist §2.1, range wrist §1"


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class Angle(Register):
    """An angle of the wrist: 0.01 degree a count."""

    decimals: int = 2
    unit: str | None = "°"


def _angle(address: int, name: str, doc: str, source: str, limits: tuple[float, float], **more: object) -> Register:
    low, high = limits
    return Angle(address=address, name=name, doc=doc, source=source, low=low, high=high, **more)  # type: ignore[arg-type]


# fmt: off
WRIST: ParamMap[Register] = ParamMap("wrist", [
    _angle(1020, "pitch_actual", "measured pitch", _RANGE, PITCH_RANGE),
    _angle(1022, "yaw_actual", "measured yaw", _RANGE, YAW_RANGE),
    s16(1024, "current_1024", "current of a servo actuator", "wrist §2.1, §2.3.1", unit="mA", note="actuator #2 by the register table, #1 by the CAN example"),
    s16(1026, "current_1026", "current of a servo actuator", "wrist §2.1, §2.3.1", unit="mA", note="actuator #1 by the register table, #2 by the CAN example"),
    u8(1028, "error_1", "error bits of actuator #1", "wrist §2.1", bits=ERROR_BITS, note=_ASSUMED),
    u8(1030, "error_2", "error bits of actuator #2", "wrist §2.1", bits=ERROR_BITS, note=_ASSUMED),
    u8(1032, "temperature_1", "temperature of actuator #1", "wrist §2.1", unit="°C", note="unit assumed"),
    u8(1033, "temperature_2", "temperature of actuator #2", "wrist §2.1", unit="°C", note="unit assumed"),
    _angle(1038, "yaw_set", "commanded yaw", _RANGE, YAW_RANGE, **MOVING),
    _angle(1040, "pitch_set", "commanded pitch", _RANGE, PITCH_RANGE, **MOVING),
    s16(1042, "move_time", "time of a movement from here to the target", "wrist §2.1, range by this tool",
        unit="ms", low=1, high=32767, signed=False, access="rw", kind=COMMAND, persistent="unknown"),
])
# fmt: on
