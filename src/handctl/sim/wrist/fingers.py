"""The fingers of the hand behind the simulated wrist: they move to what is written, and calibrate (RH56 §2.4, chapter 3).

Knows the hand's memory, units and time, no frames. Angles run from 0 (bent) to 1000 (open), strokes of the actuators from
2000 to 0; speed 1000 is the whole way in 0.8 s without load. A finger that was not told to move keeps what its memory
shows. Computed in closed form from the time that passed.
"""

from __future__ import annotations

import struct

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from handctl.sim.wrist.memory import Space

COUNT = 6  # little, ring, middle, index, bending of the thumb, its rotation
STROKE_SET, ANGLE_SET, SPEED_SET = 1474, 1486, 1522
STROKE, ANGLE, FORCE, CURRENT, STATE = 1534, 1546, 1582, 1594, 1612
POWER_ON_SPEED = 1032
OPENING, CLOSING, ARRIVED = 0, 1, 2  # states
FULL_SPEED = 1250.0  # angle units a second at speed 1000
DRIVE = 150  # mA more than at rest while a finger moves
OPEN, BENT, HELD = 1000, 0, -1
POSES = (  # of the calibration: opens, closes four fingers, opens, bends the thumb, opens
    (OPEN,) * 6,
    (BENT, BENT, BENT, BENT, HELD, HELD),
    (OPEN, OPEN, OPEN, OPEN, HELD, HELD),
    (HELD, HELD, HELD, HELD, BENT, BENT),
    (HELD, HELD, HELD, HELD, OPEN, OPEN),
)
CALIBRATION = 6.0  # s, all poses


class Finger:
    """A finger on its way."""

    __slots__ = ("angle", "left", "rest_current", "stroke", "to_angle", "to_stroke")

    def __init__(self, angle: float, stroke: float, to_angle: int, to_stroke: int, left: float, rest: int) -> None:
        self.angle, self.stroke = angle, stroke
        self.to_angle, self.to_stroke = to_angle, to_stroke
        self.left = left  # s
        self.rest_current = rest

    def run(self, seconds: float) -> None:
        part = 1.0 if self.left <= seconds else seconds / self.left
        self.angle += (self.to_angle - self.angle) * part
        self.stroke += (self.to_stroke - self.stroke) * part
        self.left = max(0.0, self.left - seconds)


class Fingers:
    """All six; what they show is written to the hand's memory by `publish`."""

    def __init__(self, space: Space) -> None:
        self.space = space
        self.now = 0.0
        self._moving: list[Finger | None] = [None] * COUNT
        self._course: list[tuple[float, int]] = []  # of a calibration: seconds until, number of the pose or its end

    @property
    def calibrating(self) -> bool:
        return bool(self._course)

    def power_on(self) -> None:
        """They stay where they are, and forget where they were going."""
        self._moving = [None] * COUNT
        self._course = []

    # -- time -------------------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        seconds, self.now = max(0.0, now - self.now), now
        while self._course and self._course[0][0] <= seconds:
            until, pose = self._course.pop(0)
            self._course = [(when - until, number) for when, number in self._course]
            self._run(until)
            seconds -= until
            self._pose(pose)
        self._course = [(when - seconds, number) for when, number in self._course]
        self._run(seconds)

    def settle(self) -> None:
        """A long time has passed."""
        self.advance(self.now + 3600.0)

    def _run(self, seconds: float) -> None:
        for finger in self._moving:
            if finger is not None:
                finger.run(seconds)

    # -- commands ---------------------------------------------------------------------------------------------------------

    def written(self, place: int, value: int) -> None:
        """A register element of the hand was written: an angle or a stroke moves its finger at once, -1 does not.

        The hand carries out nothing of that while it calibrates (open).
        """
        for first, end in ((ANGLE_SET, 1000), (STROKE_SET, 2000)):
            if first <= place < first + 2 * COUNT and 0 <= value <= end and not self.calibrating:
                self._aim((place - first) // 2, value if first == ANGLE_SET else OPEN - value // 2)
        if SPEED_SET <= place < SPEED_SET + 2 * COUNT:
            number = (place - SPEED_SET) // 2
            finger = self._moving[number]
            if finger is not None and not self.calibrating:
                self._aim(number, finger.to_angle)

    def calibrate(self) -> float:
        """Begins the calibration; the moment of its end."""
        step = CALIBRATION / len(POSES)
        self._course = [(step * number, number) for number in range(1, len(POSES) + 1)]
        self._pose(0)
        return self.now + CALIBRATION

    def _pose(self, number: int) -> None:
        """The next pose of a calibration, at full speed; behind the last one the forces are zero."""
        if number == len(POSES):
            struct.pack_into("<6h", self.space.memory, FORCE, *(0,) * COUNT)
            return
        for finger, angle in enumerate(POSES[number]):
            if angle != HELD:
                self._aim(finger, angle, 1000)

    def _aim(self, number: int, angle: int, speed: int | None = None) -> None:
        """Sends a finger to this angle; at speed 0 it stands still."""
        memory = self.space.memory
        self.publish()
        finger = self._moving[number]
        at_angle, at_stroke, rest = (
            (*(self._value(first, number) for first in (ANGLE, STROKE)), self._value(CURRENT, number))
            if finger is None
            else (finger.angle, finger.stroke, finger.rest_current)
        )
        told = self._value(SPEED_SET, number) if speed is None else speed
        if not 0 <= told <= 1000:
            told = self._value(POWER_ON_SPEED, number)
        seconds = abs(angle - at_angle) / (FULL_SPEED * told / 1000) if told > 0 else float("inf")
        self._moving[number] = Finger(at_angle, at_stroke, angle, 2 * (OPEN - angle), seconds, int(rest))
        memory[STATE + number] = OPENING if angle > at_angle else CLOSING

    def _value(self, first: int, number: int) -> int:
        value: int = struct.unpack_from("<h", self.space.memory, first + 2 * number)[0]
        return value

    # -- readings ---------------------------------------------------------------------------------------------------------

    def publish(self) -> None:
        """Puts where the fingers are that move, or have just arrived, into the hand's memory."""
        memory = self.space.memory
        for number, finger in enumerate(self._moving):
            if finger is None:
                continue
            arrived = finger.left == 0.0
            struct.pack_into("<h", memory, ANGLE + 2 * number, round(finger.angle))
            struct.pack_into("<h", memory, STROKE + 2 * number, round(finger.stroke))
            moves = not arrived and finger.left != float("inf")
            struct.pack_into("<h", memory, CURRENT + 2 * number, finger.rest_current + (DRIVE if moves else 0))
            if arrived:
                memory[STATE + number] = ARRIVED
                self._moving[number] = None

    # -- state file -------------------------------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """Of each finger on its way: angle, stroke, where to, seconds left (-1: it stands), current at rest."""
        return {
            "moving": [
                None
                if finger is None
                else [
                    finger.angle, finger.stroke, finger.to_angle, finger.to_stroke,
                    -1 if finger.left == float("inf") else finger.left, finger.rest_current,
                ]
                for finger in self._moving
            ],
            "course": [list(step) for step in self._course],
        }  # fmt: skip

    @staticmethod
    def check(state: dict[str, Any]) -> tuple[list[Finger | None], list[tuple[float, int]]]:
        """What a snapshot holds; KeyError, TypeError or ValueError when it does not fit."""
        moving: list[Finger | None] = []
        for row in state["moving"]:
            angle, stroke, to_angle, to_stroke, left, rest = row or (0, 0, 0, 0, 0, 0)
            held = all(-32768 <= value <= 32767 for value in (angle, stroke, rest))
            if not (held and 0 <= to_angle <= 1000 and 0 <= to_stroke <= 2000 and (left == -1 or 0 <= left <= 3600)):
                raise ValueError("impossible way of a finger")
            left = float("inf") if left == -1 else float(left)
            moving.append(Finger(angle, stroke, to_angle, to_stroke, left, int(rest)) if row else None)
        course = [(float(when), int(number)) for when, number in state["course"]]
        if len(moving) != COUNT or not all(0 <= when <= CALIBRATION and 1 <= n <= len(POSES) for when, n in course):
            raise ValueError("impossible calibration or number of fingers")
        return moving, course

    def use(self, moving: list[Finger | None], course: list[tuple[float, int]]) -> None:
        """Takes what `check` gave."""
        self._moving, self._course = moving, course
