"""Somebody works with the simulated wrist: it lifts, turns over and comes back. Loaded only when it is asked for.

Angles are well within the ranges of the set values (wrist §2.1: yaw ±25.5°, pitch -22.66° to 22.12°); the course is invented.
"""

from __future__ import annotations

from handctl.sim.wrist.body import PITCH, YAW

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from handctl.sim.wrist.model import Module

COURSE = (  # pitch and yaw in 0.01°, seconds to get there, seconds there
    (1500, -1250, 2.5, 0.8),
    (600, 1800, 3.0, 0.5),
    (-1400, 950, 2.5, 1.0),
    (-345, 1125, 2.0, 0.7),
)


def use(device: Module) -> Iterator[float]:
    """Each step tells for how long nothing else is done."""
    while True:
        for pitch, yaw, seconds, rest in COURSE:
            device.body.move({PITCH: pitch, YAW: yaw}, seconds)
            yield seconds + rest
