"""What the register maps of the Inspire devices share: what a register is, and values that mean the same on each.

The maps are in `exo.register_map`, `wrist.register_map` and `hand.register_map`, the only source for names and addresses.
Element k of a 2-byte group lies at address + 2k, of a 1-byte group at address + k. Knows no wire.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

from handctl.errors import UsageError
from handctl.fast_classes import fast_dataclass
from handctl.model.param import COMMAND, MOVES, Element, Number, Param

ERROR_BITS = ("locked_rotor", "over_temperature", "over_current", "motor_abnormal", "communication")
"""exo §2.3.12, bit 0 first."""
OVER_TEMPERATURE = 1 << ERROR_BITS.index("over_temperature")
"""Not clearable: goes away when the actuator has cooled (exo §2.3.3)."""

ALONE = -1
"""As a position, angle, force threshold or speed: leave this finger as it is (exo §2.3.7, rh56 §3.1)."""
DRAWN = 200
"""mA: a movement without a load draws 100 to 194 (rh56 §6). An actuator that stands and draws more pushes something."""

NEAR = 20
"""Counts of 1000 within which a finger is at its target: it may stop short without a fault (rh56 §6)."""
NOISE = 3
"""Counts of 1000: the reading of a resting finger changes by no more (45 to 47: rh56 §6)."""

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
        return range(self.address, self.address + self.size * len(self.each))

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


def register_of(element: Element) -> Register:
    """The register that an element of one of these maps belongs to."""
    assert isinstance(element.param, Register)
    return element.param


def outside(name: str, param: Param, value: Number) -> str:
    """A value outside its documented range, in words."""
    return f"{name} = {param.text(value)} is outside {param.range_text or 'the plausible range'} ({param.source})"


def u8(address: int, name: str, doc: str, source: str, **more: object) -> Register:
    return Register(address=address, name=name, doc=doc, source=source, size=1, signed=False, **more)  # type: ignore[arg-type]


def s16(address: int, name: str, doc: str, source: str, **more: object) -> Register:
    return Register(address=address, name=name, doc=doc, source=source, **more)  # type: ignore[arg-type]


MOVING: dict[str, Any] = {"access": "rw", "kind": COMMAND, "persistent": "unknown", "acts": MOVES}
"""A target of an exoskeleton hand or a wrist."""
