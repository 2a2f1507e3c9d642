"""Forward kinematics of the BarrettHand: motor counts -> joint angles -> fingertip (barrett §9.5, §9.6). Pure arithmetic.

Angles in degrees, lengths in mm, in the frame of the palm's centre. The manual's closed form (Eq. 3) has three
misprints; what stands here is the product of the four matrices of Table 9:

    phi = r T1 - 90 j    a = T2 + P2    b = T3 + P3          r = -1 1 0, j = 1 1 -1 for F1 F2 F3
    rho = A1 + A2 cos a + A3 cos(a+b) - D3 sin(a+b)
    x = r AW + rho cos phi    y = rho sin phi    z = DW + A2 sin a + A3 sin(a+b) + D3 cos(a+b)

One encoder count is one degree of the motor (§9.5, note).
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import NamedTuple

AW, A1, A2, A3, DW, D3 = 25.0, 50.0, 70.0, 50.0, 84.0, 9.5
"""Link lengths and offsets in mm (Table 8)."""
PHI2, PHI3 = 2.46, 50.0
"""Angles of the links in the zero position in degrees (Table 8)."""
SIDES: dict[str, tuple[int, int]] = {"F1": (-1, 1), "F2": (1, 1), "F3": (0, -1)}
"""Finger -> (r, j) of Table 9."""
LIMITS = (180.0, 140.0, 48.0)
"""Largest angles of the spread, the inner and the outer link without an object (§9.6)."""
TOLERANCE = 0.4
"""Degrees beyond an end that are still at it: 50 counts of a finger, the factory's MPE (§5.3.4)."""


class Joints(NamedTuple):
    """Joint angles of one finger in degrees: spread (1), inner link (2), outer link (3); 0 = spread and finger open."""

    spread: float
    inner: float
    outer: float


class Point(NamedTuple):
    """A place in mm; z points out of the palm."""

    x: float
    y: float
    z: float


def joints(finger: str, position: float, spread: float, breakaway: float | None = None) -> Joints:
    """Motor positions in counts -> joint angles (Eq. 4; Eq. 5 from `breakaway` on, the position where the clutch let go).

    After breakaway the inner link stands and the outer one turns four times as fast. F3 does not spread.
    """
    turned = 0.0 if finger == "F3" else spread * 2 / 35
    if breakaway is None:
        return Joints(turned, position / 125, position / 375)
    return Joints(turned, breakaway / 125, breakaway / 375 + (position - breakaway) * 4 / 375)


def tip(finger: str, angles: Joints) -> Point:
    """Joint angles -> the tip of `finger` (F1, F2 or F3)."""
    r, j = SIDES[finger]
    phi = radians(r * angles.spread - 90 * j)
    a = radians(angles.inner + PHI2)
    ab = a + radians(angles.outer + PHI3)
    rho = A1 + A2 * cos(a) + A3 * cos(ab) - D3 * sin(ab)
    return Point(r * AW + rho * cos(phi), rho * sin(phi), DW + A2 * sin(a) + A3 * sin(ab) + D3 * cos(ab))


def beyond(angles: Joints, *, broken_away: bool) -> list[int]:
    """Numbers of the joints outside 0 to their limit (§9.6). The outer link's does not hold after breakaway."""
    return [
        number
        for number, (angle, limit) in enumerate(zip(angles, LIMITS, strict=True), 1)
        if not (-TOLERANCE <= angle <= limit + TOLERANCE) and not (number == 3 and broken_away)
    ]
