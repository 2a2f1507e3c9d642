"""Joint angles from motor counts (barrett §9.5, Eq. 4 and 5), and those of the RealTime loop, from the counts of each block. Sends nothing by itself.

A clutch that lets go locks the inner link, and the outer link turns four times as fast; its angle means something only while the finger
moves. The loop does not show when that happens. So the outer angle is given only as long as it is certain that the clutch holds: the
firmware said so before the loop (BD 0), and the motor has not been driven to close since.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.realtime.blocks import Values
from handctl.devices.barrett.status_and_parameter_views import row_of
from handctl.model.result import Row

SPREAD = 3
BEFORE, AFTER, UNKNOWN = "before breakaway", "after breakaway", "breakaway unknown"


class Joints(NamedTuple):
    """Joint angles of one finger in degrees: spread (1), inner link (2), outer link (3); 0 = spread and finger open."""

    spread: float
    inner: float
    outer: float


def joints(finger: str, position: float, spread: float, breakaway: float | None = None) -> Joints:
    """Motor positions in counts -> joint angles (Eq. 4; Eq. 5 from `breakaway` on, the position where the clutch let go).

    After breakaway the inner link stands and the outer one turns four times as fast. F3 does not spread.
    """
    turned = 0.0 if finger == "F3" else spread * 2 / 35
    if breakaway is None:
        return Joints(turned, position / 125, position / 375)
    return Joints(turned, breakaway / 125, breakaway / 375 + (position - breakaway) * 4 / 375)


class Angles:
    """What is known of the clutches of one loop's fingers: `broken` is where one has let go, `certain` those that hold."""

    def __init__(self, broken: Mapping[int, int] = {}, certain: Sequence[int] = ()) -> None:
        self.broken = dict(broken)
        self._certain = set(certain)

    def driven(self, values: Values) -> None:
        """These control values went out: a finger that closes may meet something that makes its clutch let go."""
        self._certain -= {index for index, names in values.items() if names.get("velocity", 0) > 0}

    def state(self, index: int) -> str:
        """What is known of the clutch of a finger."""
        return AFTER if index in self.broken else BEFORE if index in self._certain else UNKNOWN

    def rows(self, positions: Mapping[int, int], doubts: Mapping[int, str]) -> Iterator[Row]:
        """The joints of each motor whose position is known, in degrees; None where the angle cannot be known."""
        for index, position in positions.items():
            motor, doubt = MOTORS[index], doubts.get(index) or None
            if index == SPREAD:
                yield _row("joint_spread", motor, joints("F1", 0, position).spread, doubt)
                continue
            state, place = self.state(index), self.broken.get(index)
            angles = joints(motor, position, 0, None if place is None or position < place else place)
            yield _row("joint_inner", motor, angles.inner, doubt, state=state)
            yield _row("joint_outer", motor, angles.outer if state == BEFORE else None, doubt, state=state)


def _row(name: str, motor: str, angle: float | None, doubt: str | None, **more: str) -> Row:
    return row_of(name, None, motor, None if angle is None else round(angle, 4), "°", doubt=doubt, **more)


def clutches(hand: BarrettHand, motors: Sequence[int]) -> Angles:
    """Read before LOOP what the hand reports of its clutches, and say where the outer angle stays empty. Raises what the read raises."""
    fingers = [index for index in motors if index != SPREAD]
    if not fingers:
        return Angles()
    at = hand.by_name("BD", "BP", motors=fingers, dispensable=("BD", "BP"))
    if len(at) < 2 * len(fingers):
        hand.journal.info(
            "breakaway-unknown",
            "this firmware does not report whether a clutch has let go, so joint_outer is empty. joint_inner is correct as long as the clutch holds (barrett §9.5)",
        )
        return Angles()
    broken = {index: at["BP", MOTORS[index]] for index in fingers if at["BD", MOTORS[index]]}
    gone = ", ".join(f"{MOTORS[index]} at {place}" for index, place in broken.items())
    told = f"clutch let go: {gone}. The joint_outer of such a finger is empty until the finger has been opened. "
    hand.journal.info(
        "breakaway",
        (told if broken else "")
        + "joint_outer is also empty once a finger has been driven to close: the loop does not show whether its clutch has let go (barrett §9.5)",
    )
    return Angles(broken, [index for index in fingers if index not in broken])
