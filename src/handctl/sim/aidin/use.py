"""Somebody uses the simulated AIDIN-hand: a slow grasp, over and over. Loaded only when it is asked for.

Encoder values are shares of the strokes of the manual's list (0 open); the course and the pressure at the fingertips are
invented. The hand need not be homed: its motors are moved, no command is given.
"""

from __future__ import annotations

from math import cos, pi

from handctl.sim.aidin.hand import STROKES

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from handctl.sim.aidin.device import Device

STEP = 0.05  # s between two targets on the way
CLOSED = ((0.45, 0.5, 0.4), (0.55, 0.58, 0.55), (0.6, 0.6, 0.6), (0.62, 0.58, 0.55), (0.6, 0.52, 0.5))  # of the stroke
OPEN = ((0.1, 0.12, 0.1), (0.08, 0.1, 0.1), (0.06, 0.07, 0.08), (0.08, 0.06, 0.1), (0.12, 0.1, 0.12))
CLOSING, HOLDING, OPENING, RESTING = 3.0, 1.5, 2.5, 1.0  # s
PRESSURE = (3.0, 2.6, 2.2, 1.6, 1.2)  # Fz at each fingertip while it holds


def use(device: Device) -> Iterator[float]:
    """Each step tells the seconds until the next one."""
    while True:
        yield from _go(device, CLOSED, CLOSING)
        for part in (0.4, 0.8, 1.0, 0.8, 0.4, 0.0):
            for finger, most in enumerate(PRESSURE):
                device.hand.touch[6 * finger + 2] = part * most
            yield HOLDING / 6
        yield from _go(device, OPEN, OPENING)
        yield RESTING


def _go(device: Device, pose: tuple[tuple[float, ...], ...], seconds: float) -> Iterator[float]:
    """All motors set out slowly, arrive slowly, and together."""
    begin = device.hand.encoders()
    ends = [
        share * stroke
        for shares, row in zip(pose, STROKES, strict=True)
        for share, stroke in zip(shares, row, strict=True)
    ]
    count = round(seconds / STEP)
    for number in range(1, count + 1):
        done = 0.5 - 0.5 * cos(pi * number / count)
        device.hand.go([start + done * (end - start) for start, end in zip(begin, ends, strict=True)])
        yield STEP
