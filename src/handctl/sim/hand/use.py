"""Somebody works with the simulated RH56 hand: it grasps something, holds it and lets go. Loaded only when it is asked for.

Thousandths of the way of each finger, 1000 open. How fast and how firm is invented, well below what crushes anything.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from handctl.sim.hand.front import Front

STRAIGHT = (960, 955, 950, 945, 900, 700)
ROUND = (310, 285, 260, 300, 360, 830)
THING = 400  # where the fingers touch it
MOVING, HOLDING, RESTING = 2.5, 1.5, 1.5  # s


def use(device: Front) -> Iterator[float]:
    """Closes around an object, holds it, lets it go; each step tells for how long it takes."""
    fingers = device.hand.body.fingers
    for finger in fingers:
        finger.place(finger.closed + finger.span * THING / 1000.0)
    while True:
        for pose, rest in ((ROUND, MOVING + HOLDING), (STRAIGHT, MOVING + RESTING)):
            for number, finger in enumerate(fingers):
                goal = finger.closed + finger.span * pose[min(number, 5)] / 1000.0
                finger.forced = max(1, round(abs(goal - finger.angle) / MOVING / finger.rate))
                finger.aim(goal)
            yield rest
