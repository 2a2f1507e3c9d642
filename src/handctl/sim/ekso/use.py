"""Somebody walks in the simulated EksoNR. Loaded only when it is asked for.

The gait, its times and the way to stand up are those of body.py; who sits stands up first.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from handctl.sim.ekso.device import Device

LOOK = 0.5  # s between two looks at whether the wearer is upright


def use(device: Device) -> Iterator[float]:
    """Each step tells the seconds until the next one."""
    body = device.body
    device.thaw()
    while True:
        if body.posture == "standing":
            body.walk(True)
        elif body.posture in ("sitting", "held"):
            body.move(1)
        yield LOOK
