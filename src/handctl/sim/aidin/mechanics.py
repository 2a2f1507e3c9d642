"""The mechanics of the simulated AIDIN-hand: 15 motors, coupled joints, fingertips, currents, force sensors.

Knows units and time, no keys and no text. Motors count from 0 (open) to their stroke (closed), angles are degrees,
fingertips mm, currents per mille of the rated current, forces raw numbers. The manual gives ranges only (its list at
the end); geometry, speeds, currents and forces are invented so that those ranges come out. All of it is computed in
closed form from the time that passed, so a jump of virtual time gives the same as many small steps.
"""

from __future__ import annotations

import math

from handctl.sim.engine.simulated_device import NOTHING, Random

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

FINGERS = ("thumb", "index", "middle", "ring", "little")
STROKES = ((280000, 280000, 210000), *((440000, 440000, 170000),) * 4)
JOINTS = (((-13, 45), (-30, 30), (82, 154)), *(((-45, 45), (-30, 30), (115, 175)),) * 4)  # q1 q2 q3, degrees
TIPS = (((-51, 51), (45.5, 115.7), (13, 146.7)), *(((-51, 51), (2.6, 100), (0, 149.5)),) * 4)  # x y z, mm

# What a hand reads that has been on for a while: all different, so that a swap is seen.
READINGS = (
    70110, 61220, 52330, 110440, 100550, 41660, 150770, 170880, 30990, 220115, 190225, 60335, 201445, 240555, 70665,
)  # fmt: skip
ORIGINS = (1010, 2020, 3030, 4040, 5050, 6060, 7070, 8080, 9090, 10110, 11120, 12130, 13140, 14150, 15160)
RESTING = (3, -4, 5, -6, 7, -8, 9, -10, 11, -12, 13, -14, 15, -16, 17)  # zero errors of the current sensors
HOLDING = ((12, -8, 30), *((5, -4, 11),) * 4)  # current that holds a position against the weight of the finger
SENSOR = (0.02, -0.01, 0.35, 0.0004, -0.0002, 0.0001)  # Fx Fy Fz Tx Ty Tz before bias, thumb
SENSOR_STEP = (0.003, -0.002, 0.04, 0.00005, -0.00003, 0.00002)  # more on each further finger

LAG = 0.05  # s, first-order lag near the target
RUNNING = 400.0  # per mille for one stroke a second
HOMING = -200.0  # per mille: opens at half a stroke a second
STUCK = 0.001  # share of the stroke: a motor held farther than this from its target pushes with all it may
PRESS = 0.01  # force per per mille against an obstacle
STARTS = ("used", "homed", "open", "cold")


class Motor:
    """One motor with its incremental encoder; `place` and `goal` are counts from the open stop, unrounded."""

    def __init__(self, number: int) -> None:
        self.stroke = STROKES[number // 3][number % 3]
        self.place = self.origin = 0.0
        self.ceiling = float(self.stroke)  # an obstacle is lower
        self.floor = 0.0  # what holds the motor on its way to open is higher
        self.slip = 0.0  # counts a second that the encoder loses
        self.friction = 1.0  # so many times the usual current moves it
        self.one_way = False  # it closes and does not open
        self.holding, self.rest = 0, 0
        self.jammed = self.dead = False
        self.release()

    def release(self) -> None:
        """Motor power off: the finger moves freely."""
        self.drive, self.goal = "off", 0.0

    def obstruct(self, gives: float) -> None:
        """From here the motor opens by so many counts and no further."""
        self.floor = max(0.0, self.place - gives)

    def run(self, seconds: float, torque: int) -> None:
        """Lets time pass; `torque` is the current limit, which limits the speed as well."""
        self.origin += self.slip * seconds
        if self.drive == "off" or self.jammed or self.dead or torque == 0:
            return
        fastest = self.stroke * torque / 1000.0  # counts a second
        if self.drive == "current":
            speed = abs(self.goal) / RUNNING * self.stroke
            if speed > fastest:
                speed = fastest
            wanted = self.place + (speed * seconds if self.goal >= 0.0 else -speed * seconds)
        else:
            wanted = self._approach(fastest, seconds)
        floor = self.place if self.one_way or self.place < self.floor else self.floor
        ceiling = self.ceiling if self.ceiling > 0.0 else 0.0
        self.place = wanted if floor <= wanted <= ceiling else min(max(wanted, floor), ceiling)

    def _approach(self, fastest: float, seconds: float) -> float:
        """At full speed until the lag takes over; the last half count is made at once."""
        way = abs(self.goal - self.place)
        if way < 0.5:
            return self.goal
        cruise = min(seconds, max(0.0, way / fastest - LAG))
        way = (way - cruise * fastest) * math.exp(-(seconds - cruise) / LAG)
        return self.goal if way < 0.5 else self.goal - math.copysign(way, self.goal - self.place)

    def stalled(self) -> bool:
        """Pushing against a stop, an obstacle or a jam."""
        if self.drive == "off" or self.dead:
            return False
        way = self.goal if self.drive == "current" else self.goal - self.place
        if abs(way) <= (0.0 if self.drive == "current" else STUCK * self.stroke):
            return False
        return self.jammed or (self.place >= self.ceiling if way > 0 else self.place <= self.floor)

    def pull(self, torque: int) -> float:
        """The current in force, never above the limit."""
        if self.drive == "off" or self.dead:
            return 0.0
        if self.drive == "current":
            wanted = self.goal
        elif self.stalled():
            wanted = math.copysign(1000.0, self.goal - self.place)
        else:
            speed = (self.goal - self.place) / (LAG * self.stroke)
            wanted = RUNNING * self.friction * max(-torque / 1000.0, min(torque / 1000.0, speed)) + self.holding
        return max(-float(torque), min(float(torque), wanted))

    def current(self, torque: int) -> int:
        """What the current sensor reads."""
        if self.drive == "off" or self.dead:
            return self.rest
        if self.place == self.goal and self.drive == "position" and torque >= 1000:  # nothing drives it
            return self.holding + self.rest
        return round(max(-torque, min(torque, self.pull(torque) + self.rest)))


class Hand:
    """All five fingers, powered on."""

    def __init__(self, given: dict[str, Any], random: Random) -> None:
        """`given` are the options start, load, noise, drift (thousandths of a force unit a minute) and q4."""
        start = given["start"]
        self.random = random
        self.now = 0.0
        self.motors = [Motor(number) for number in range(15)]
        self.noise, self.drift, self.coupling = given["noise"], given["drift"] / 60000.0, given["q4"]
        self.offsets = [
            SENSOR[element] + (0 if start == "open" else finger) * SENSOR_STEP[element]
            for finger in range(5)
            for element in range(6)
        ]
        self.touch = [0.0] * 30
        self.bias = [0.0] * 30
        self.warm = 0.0  # s since power-on, for the drift
        self.torque = 1000
        self.homed = start in ("homed", "open")
        self.faults = NOTHING
        self.shaky: frozenset[int] = frozenset()  # channels of the force sensors that are twenty times as noisy
        self.numb: frozenset[int] = frozenset()  # channels that always read the same
        for number, motor in enumerate(self.motors):
            motor.holding = HOLDING[number // 3][number % 3] if given["load"] else 0
            motor.rest = 0 if start == "open" else RESTING[number]
            motor.origin = 0.0 if self.homed else float(ORIGINS[number])
            motor.place = 0.0 if start == "open" else motor.origin + READINGS[number]
        if start == "cold":
            self.power_on()

    def power_on(self) -> None:
        """The encoders are incremental: they start at 0 wherever the fingers are."""
        self.torque, self.homed, self.warm = 1000, False, 0.0
        self.bias = [0.0] * 30
        for motor in self.motors:
            motor.release()
            motor.origin = motor.place

    def advance(self, now: float) -> None:
        seconds, self.now = now - self.now, now
        if seconds > 0.0:
            self.warm += seconds
            for motor in self.motors:
                there = motor.place == motor.goal and motor.drive == "position" and 0.0 <= motor.place <= motor.ceiling
                if motor.slip or not (there or motor.drive == "off"):
                    motor.run(seconds, self.torque)

    # -- commands ------------------------------------------------------------------------------------------------------

    def release(self) -> None:
        for motor in self.motors:
            motor.release()

    def push(self, currents: list[float]) -> None:
        """Current control, per mille, positive closes."""
        for motor, current in zip(self.motors, currents, strict=True):
            motor.drive, motor.goal = "current", current

    def go(self, counts: list[float]) -> None:
        """Position control on encoder values; the stops of the mechanics may keep a motor from its target."""
        for motor, count in zip(self.motors, counts, strict=True):
            motor.drive, motor.goal = "position", count + motor.origin

    def zero(self) -> None:
        """The place of this moment becomes the origin."""
        self.homed = True
        for motor in self.motors:
            motor.origin = motor.place
            motor.release()

    def set_bias(self) -> None:
        """The values of this moment become 0, a load included."""
        self.bias = self._forces()

    # -- readings ------------------------------------------------------------------------------------------------------

    def encoders(self) -> list[int]:
        return [round(motor.place - motor.origin) for motor in self.motors]

    def poses(self) -> list[tuple[list[float], list[float]]]:
        """Of each finger, see `pose`."""
        return [pose(finger, counts, self.coupling) for finger, counts in by_finger(self.encoders())]

    def currents(self) -> list[int]:
        read = [motor.current(self.torque) for motor in self.motors]
        return [current + self.random.between(-1, 1) for current in read] if self.noise else read

    def sensors(self) -> list[float]:
        values = [force - zero for force, zero in zip(self._forces(), self.bias, strict=True)]
        if self.noise:
            scale = (0.0001, 0.0001, 0.0001, 0.000001, 0.000001, 0.000001)
            values = [value + self.random.between(-20, 20) * scale[at % 6] for at, value in enumerate(values)]
        for at in self.shaky:
            values[at] += self.random.between(-20, 20) * 0.002
        for at in self.numb:
            values[at] = SENSOR[at % 6]
        return values

    def _forces(self) -> list[float]:
        """Zero error, drift of the force channels, touch, and the pressure of a finger on an obstacle (Fz)."""
        values = [offset + touch for offset, touch in zip(self.offsets, self.touch, strict=True)]
        for place in range(30) if self.drift else ():
            if place % 6 < 3:
                values[place] += self.drift * self.warm * (1.0 + 0.1 * place)
        for finger, third in enumerate(self.motors[2::3]):
            if third.ceiling < third.stroke and third.stalled():
                values[6 * finger + 2] += PRESS * max(0.0, third.pull(self.torque))
        return values


def by_finger(counts: list[int]) -> Iterable[tuple[int, tuple[int, ...]]]:
    """Each finger, and its encoders."""
    motors = iter(counts)
    return enumerate(zip(motors, motors, motors, strict=True))


def pose(finger: int, counts: tuple[int, ...], coupling: str) -> tuple[list[float], list[float]]:
    """q1 q2 q3 q4 of a finger in degrees, and x y z of its tip in mm, in its own frame; from its encoders, as the firmware has to."""
    (m1, m2, m3), (long, _, short) = counts, STROKES[finger]
    # m1 and m2 together bend (0..1), their difference spreads (-1..1), m3 curls (0..1)
    u, v, s = (m1 + m2) / (2 * long), (m1 - m2) / long, m3 / short
    (low1, high1), _, (low3, high3) = JOINTS[finger]
    _, (low_y, high_y), (low_z, high_z) = TIPS[finger]
    q3 = high3 - s * (high3 - low3)
    q4 = {"same": q3, "half": 90.0 + q3 / 2.0, "zero": 0.0}[coupling]
    tip = [51.0 * v, low_y + u * (high_y - low_y), high_z - s * (high_z - low_z)]
    return [low1 + u * (high1 - low1), 30.0 * v, q3, q4], tip


def from_joints(degrees: list[float]) -> list[float]:
    """Encoder values for 20 joint angles; q4 is coupled and does not count."""
    counts: list[float] = []
    for finger in range(5):
        q1, q2, q3, _ = degrees[4 * finger : 4 * finger + 4]
        (low1, high1), _, (low3, high3) = JOINTS[finger]
        counts += _motors(finger, (q1 - low1) / (high1 - low1), q2 / 30.0, (high3 - q3) / (high3 - low3))
    return counts


def from_tips(mm: list[float]) -> list[float]:
    """Encoder values for 15 fingertip coordinates."""
    counts: list[float] = []
    for finger in range(5):
        x, y, z = mm[3 * finger : 3 * finger + 3]
        _, (low_y, high_y), (low_z, high_z) = TIPS[finger]
        counts += _motors(finger, (y - low_y) / (high_y - low_y), x / 51.0, (high_z - z) / (high_z - low_z))
    return counts


def _motors(finger: int, u: float, v: float, s: float) -> tuple[float, float, float]:
    long, _, short = STROKES[finger]
    return long * (u + v / 2.0), long * (u - v / 2.0), short * s
