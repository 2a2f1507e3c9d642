"""The register maps of the Inspire family: the address of each name. The only source for names and addresses.

Finger order everywhere: little, ring, middle, index, thumb (exo §2.2.1). Element k of a 2-byte group lies at
address + 2k, of a 1-byte group at address + k. Knows no wire.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

from handctl.errors import UsageError
from handctl.fast_classes import fast_dataclass
from handctl.model.param import COMMAND, MOVES, PUSHES, SETTING, TRIGGER, Element, Number, Param, ParamMap

FINGERS = ("little", "ring", "middle", "index", "thumb")
DEGREES_OF_FREEDOM = (*FINGERS, "thumb_rotation")

ERROR_BITS = ("locked_rotor", "over_temperature", "over_current", "motor_abnormal", "communication")
"""exo §2.3.12, bit 0 first."""
OVER_TEMPERATURE = 1 << ERROR_BITS.index("over_temperature")
"""Not clearable: goes away when the actuator has cooled (exo §2.3.3)."""

ALONE = -1
"""As a position, angle, force threshold or speed: leave this finger as it is (exo §2.3.7, rh56 §3.1)."""
DRAWN = 200
"""mA: a movement without a load draws 100 to 194 (rh56 §6). An actuator that stands and draws more pushes something."""

BAUD_RATES = {0: 115200, 1: 57600, 2: 19200}
"""exo §2.3.2."""


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class Register(Param):
    """A Param with its place: `address` of element 0 in bytes, `size` in bytes of one element, `signed`.

    per  bytes at one address of the manual: 1, or 2 where it counts words (rh56 §3.2); the wire divides by it
    """

    address: int
    size: int = 2
    signed: bool = True
    per: int = 1

    @cached_property
    def span(self) -> range:
        """All byte addresses of the register group."""
        return range(self.address, self.address + self.size * self.count)

    @property
    def place(self) -> int:
        """Address of element 0 as the manual counts."""
        return self.address // self.per

    def address_of(self, index: int) -> int:
        """Address of element `index`."""
        return self.address + self.size * index

    @property
    def type_name(self) -> str:
        """``u8``, ``s16`` …"""
        return f"{'s' if self.signed else 'u'}{8 * self.size}"

    def decode(self, data: bytes) -> Number:
        """The value of one element's bytes (little-endian)."""
        return self.from_raw(int.from_bytes(data, "little", signed=self.signed))

    def encode(self, value: Number) -> bytes:
        """One element's bytes for a checked value."""
        return self.to_raw(value).to_bytes(self.size, "little", signed=self.signed)


@fast_dataclass(frozen=True, kw_only=True, eq=False)
class Angle(Register):
    """An angle of the wrist: 0.01 degree a count."""

    decimals: int = 2
    unit: str | None = "°"


def address_in(text: str) -> int:
    """``1486`` or ``0x5CE`` -> a register address (16 bits, exo §2.2.3; the manuals print both). Raises UsageError."""
    try:
        address = int(text, 16 if text[:2].lower() == "0x" else 10)
    except ValueError:
        address = -1
    if "_" in text or not 0 <= address <= 0xFFFF:
        raise UsageError(
            f"{text!r} is not a register address",
            hint="use 0 to 65535, decimal or hexadecimal, such as 1486 or 0x5CE. Nothing was sent.",
        )
    return address


def pushes(current: int) -> str:
    """What the current of a stopped actuator shows, in words; "" = nothing."""
    return f"it draws {current} mA" if abs(current) >= DRAWN else ""


def register_of(element: Element) -> Register:
    """The register that an element of one of these maps belongs to."""
    assert isinstance(element.param, Register)
    return element.param


def _u8(address: int, name: str, doc: str, source: str, **more: object) -> Register:
    return Register(address=address, name=name, doc=doc, source=source, size=1, signed=False, **more)  # type: ignore[arg-type]


def _s16(address: int, name: str, doc: str, source: str, **more: object) -> Register:
    return Register(address=address, name=name, doc=doc, source=source, **more)  # type: ignore[arg-type]


_SET: dict[str, Any] = {"access": "rw", "kind": SETTING, "persistent": "yes", "strands": True}
_DO: dict[str, Any] = {"access": "rw", "kind": TRIGGER, "low": 0, "high": 1}
_GO: dict[str, Any] = {"access": "rw", "kind": COMMAND, "persistent": "unknown", "acts": MOVES}
_SPEEDS = {code: f"{rate} baud" for code, rate in BAUD_RATES.items()}
_NOT_COMMANDED = {ALONE: "not commanded"}
_FIVE: dict[str, Any] = {"elements": FINGERS}
_SIX: dict[str, Any] = {"elements": DEGREES_OF_FREEDOM}

# fmt: off
EXO: ParamMap[Register] = ParamMap("exo", [
    _u8(1000, "id", "id of the hand on its line", "exo §2.3.1", low=1, high=254, **_SET),
    _u8(1001, "baud_code", "speed after save and power cycle", "exo §2.3.2", choices=_SPEEDS, **_SET),
    _u8(1004, "clear_errors", "write 1: clear the clearable actuator errors", "exo §2.3.3", verb="clear-errors", **_DO),
    _u8(1005, "save", "write 1: save the present parameters to flash", "exo §2.3.4", verb="save", strands=True, **_DO),
    _u8(1006, "factory_reset", "write 1: restore factory defaults (undocumented address, taken from the RH56 hand)",
        "exo §2.3.5 (no address), RH56 §2.4.5", verb="factory-reset", strands=True, **(_DO | {"access": "w"})),
    _u8(1009, "calibrate", "write 1: calibrate forces and positions while someone wears the hand", "exo §2.3.6", verb="calibrate", persistent="unknown", acts=MOVES, **_DO),
    _s16(1472, "system_voltage", "supply voltage as the hand counts it", "exo §2.3", note="raw, scale unknown"),
    _s16(1486, "position_set", "commanded position, 0 bent to 1000 open, -1 leaves a finger alone", "exo §2.3.7", low=0, high=1000, special=_NOT_COMMANDED, **_FIVE, **_GO),
    _s16(1498, "force_set", "commanded force, positive opens the hand, negative closes it", "exo §2.3.8", low=-1000, high=1000, **_FIVE, **(_GO | {"acts": PUSHES})),
    _s16(1546, "position_actual", "measured position, 0 bent to 1000 open, thumb rotation 0 inside the palm", "exo §2.3.9", low=0, high=1000, **_SIX),
    _s16(1582, "force_actual", "measured force, positive when the user closes the hand, negative when opening it", "exo §2.3.10", low=-1000, high=1000, **_FIVE),
    _s16(1594, "current", "actuator current", "exo §2.3.11", unit="mA", low=0, high=1000, **_FIVE),
    _u8(1606, "error", "actuator error bits", "exo §2.3.12", bits=ERROR_BITS, **_FIVE),
    _u8(1618, "temperature", "actuator temperature", "exo §2.3.13", unit="°C", low=0, high=100, **_FIVE),
])
# fmt: on
"""EH55BF1 (exo §2.3). 1609 is the index finger although §2.3.12 prints "thumb": its own example says so."""


PITCH_RANGE = (-22.66, 22.12)
YAW_RANGE = (-25.50, 25.50)
"""Degrees (wrist §1)."""
_ASSUMED = "bit names assumed from the hand"


def _angle(address: int, name: str, doc: str, source: str, limits: tuple[float, float], **more: object) -> Register:
    low, high = limits
    return Angle(address=address, name=name, doc=doc, source=source, low=low, high=high, **more)  # type: ignore[arg-type]


_RANGE = "wrist §2.1, range wrist §1"

# fmt: off
WRIST: ParamMap[Register] = ParamMap("wrist", [
    _angle(1020, "pitch_actual", "measured pitch", _RANGE, PITCH_RANGE),
    _angle(1022, "yaw_actual", "measured yaw", _RANGE, YAW_RANGE),
    _s16(1024, "current_1024", "current of a servo actuator", "wrist §2.1, §2.3.1", unit="mA", note="actuator #2 by the register table, #1 by the CAN example"),
    _s16(1026, "current_1026", "current of a servo actuator", "wrist §2.1, §2.3.1", unit="mA", note="actuator #1 by the register table, #2 by the CAN example"),
    _u8(1028, "error_1", "error bits of actuator #1", "wrist §2.1", bits=ERROR_BITS, note=_ASSUMED),
    _u8(1030, "error_2", "error bits of actuator #2", "wrist §2.1", bits=ERROR_BITS, note=_ASSUMED),
    _u8(1032, "temperature_1", "temperature of actuator #1", "wrist §2.1", unit="°C", note="unit assumed"),
    _u8(1033, "temperature_2", "temperature of actuator #2", "wrist §2.1", unit="°C", note="unit assumed"),
    _angle(1038, "yaw_set", "commanded yaw", _RANGE, YAW_RANGE, **_GO),
    _angle(1040, "pitch_set", "commanded pitch", _RANGE, PITCH_RANGE, **_GO),
    _s16(1042, "move_time", "time of a movement from here to the target", "wrist §2.1, range by this tool",
        unit="ms", low=1, high=32767, signed=False, access="rw", kind=COMMAND, persistent="unknown"),
])
# fmt: on
"""Wrist module (wrist §2.1). Actual angles lie pitch first, set angles yaw first; error bytes lie two apart."""
