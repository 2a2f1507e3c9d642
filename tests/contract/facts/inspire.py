"""What the two families of Inspire share."""

from __future__ import annotations

from typing import Any

from tests.contract.facts import Passed

ERRORS = {1: "locked_rotor", 2: "over_temperature", 4: "over_current", 8: "motor", 16: "communication", 32: "bit_5"}
"""The error bits of an actuator (exo §2.3.12, rh56 §3.1, wrist §2.1), and one that is not documented."""


def put(actuator: Any, bits: int) -> None:
    """Its error bits; that of heat comes with heat."""
    actuator.set_error(actuator.errors | bits)


def inspire(entry: Passed) -> bool:
    """Whether one of the frames in it is no read: flags 11 and 30, or CAN identifiers of type 0 and 4.

    00 goes ahead of a read, FF between two (`register_bus.question`).
    """
    if entry.can_id is not None:
        return entry.can_id >> 26 in (1, 5)
    rest = entry.data.lstrip(b"\0")
    while len(rest) >= 9 and rest[:2] == b"\xeb\x90" and rest[4] in (0x11, 0x30):
        rest = rest[rest[3] + 5 :].lstrip(b"\0\xff")
    return bool(rest)
