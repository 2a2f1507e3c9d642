"""Somebody uses the simulated BarrettHand: a slow grasp, over and over. Loaded only when it is asked for.

The fingers close until the strain of an object holds them (barrett §9.3.1), then open to their stops; the spread goes to
and fro. Speeds, in counts a second, and the object are invented.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from handctl.sim.barrett.device import Device

OBJECT = (9250.0, 9400.0, 9550.0)  # places at which each finger meets it
FINGER, SPREAD = 2400.0, 350.0  # counts/s
GRASP, HOLD, RELEASE, REST = 4.5, 1.5, 4.5, 1.0  # s
SPREAD_SHARE = 0.6  # of the time of a grasp during which the spread moves


def use(device: Device) -> Iterator[float]:
    """As after HI: the motors are initialized, then act without any command on the line."""
    hand = device.hand
    for motor in hand.motors:
        motor.initialized = True
        if motor.number < 3:
            motor.obstacle = OBJECT[motor.number]
    hand.disturbed()
    while True:
        for sign, seconds, still in ((1.0, GRASP, HOLD), (-1.0, RELEASE, REST)):
            for motor in hand.motors:
                motor.cruise(hand.now, sign * (SPREAD if motor.number == 3 else FINGER))
            yield seconds * SPREAD_SHARE
            hand.motors[3].cruise(hand.now, 0.0)
            yield seconds * (1.0 - SPREAD_SHARE) + still
