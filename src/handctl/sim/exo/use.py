"""Somebody wears the simulated exoskeleton hand: a slow grasp, over and over. Loaded only when it is asked for.

Poses are positions, 0 bent to 1000 open (exo §2.3.7); the hand holds an object with forces far from their limit of 1000
(exo §2.3.8). How fast and how firm a person grasps is invented.
"""

from __future__ import annotations

from handctl.sim.exo.hand import CURRENTS

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from handctl.sim.exo.device import Device

STRAIGHT = (930, 945, 960, 950, 900, 700)
ROUND = (310, 285, 260, 300, 360, 830)  # around an object
CLOSING, OPENING, RESTING = 3.0, 2.5, 1.5  # s
PRESSES = (40, 90, 140, 160, 165, 165, 160, 140, 90, 40)  # force and mA above rest, every 0.2 s
PRESSED = 0.2  # s
SHARES = (0.6, 0.8, 1.0, 1.1, 1.3)  # of each finger


def use(device: Device) -> Iterator[float]:
    """Closes around an object, presses it, lets it go; each step tells for how long it takes."""
    while True:
        yield _aim(device, ROUND, CLOSING)
        for press in PRESSES:
            yield _press(device, press)
        _press(device, 0)
        yield _aim(device, STRAIGHT, OPENING)
        yield RESTING


def _aim(device: Device, pose: tuple[int, ...], seconds: float) -> float:
    """All fingers arrive together."""
    for finger, target in zip((*device.hand.fingers, device.hand.rotation), pose, strict=True):
        finger.speed = max(1.0, abs(target - finger.position) / seconds)
        finger.target = target
    return seconds


def _press(device: Device, press: int) -> float:
    """Positive is the user closing (exo §2.2.2 note 1)."""
    for finger, share in zip(device.hand.fingers, SHARES, strict=True):
        finger.force_goal = finger.rest_force + round(press * share)
        finger.rest_current = CURRENTS[finger.number] + round(press * share)
    return PRESSED
