"""Where the hips must be by the angles: a check of GetData against itself and the leg lengths. Knows no wire.

By a log of one unit, angles in degrees, lengths in inches: thigh = hip angle - torso pitch, shank = thigh - knee angle,
x = -upper sin(thigh) - lower sin(shank) + 2.75, y = upper cos(thigh) + lower cos(shank) + 4.00.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, radians, sin

FOOT_X, FOOT_Y = 2.75, 4.00
MOST_X, MOST_Y = 0.3, 0.1
"""Residuals in inches that a sound unit stays within (policy; the log's worst are 0.15 and 0.015)."""


def hip(upper: float, lower: float, pitch: float, hip_angle: float, knee_angle: float) -> tuple[float, float]:
    """(x, y) of one hip in inches before and above the sole."""
    thigh = radians(hip_angle - pitch)
    shank = thigh - radians(knee_angle)
    return (
        -upper * sin(thigh) - lower * sin(shank) + FOOT_X,
        upper * cos(thigh) + lower * cos(shank) + FOOT_Y,
    )


def residuals(values: Mapping[str, float], upper: float, lower: float) -> dict[str, tuple[float, float]]:
    """Side -> (x, y) told minus (x, y) by the angles, in inches. `values` are those of GetData by name."""
    found = {}
    for side in ("left", "right"):
        x, y = hip(
            upper, lower, values["torso_pitch"], values[f"{side}_hip_angle"], values[f"{side}_knee_angle"]
        )  # fmt: skip
        found[side] = (values[f"{side}_hip_x"] - x, values[f"{side}_hip_y"] - y)
    return found
