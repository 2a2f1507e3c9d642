"""The mechanics of the simulated exoskeleton hand: fingers, heat, error bits, the calibration course.

Knows units and time, no addresses and no frames. Positions run from 0 (bent) to 1000 (open), forces are raw numbers,
positive when the device opens the hand (exo §2.2.1 note 1), currents are mA, temperatures °C. Everything is computed
in closed form from the time that passed, so a jump of virtual time gives the same as many small steps.
"""

from __future__ import annotations

from handctl.sim.engine.simulated_device import Random
from handctl.sim.inspire.actuator_faults import CLEARABLE, LOCKED_ROTOR, Servo

FINGERS = ("little", "ring", "middle", "index", "thumb")
# Power-on values, all different so that a swapped finger is seen.
POSITIONS = (110, 220, 330, 440, 550)
ROTATION = 660
FORCES = (-11, 12, -13, 14, -15)
CURRENTS = (21, 22, 23, 24, 25)
TEMPERATURES = (31, 32, 33, 34, 35)

SPEED = 1250.0  # position units per second: 1000 units in 0.8 s
FORCE_RATE = 4000.0  # force units per second
DRIVE_CURRENT = 140.0  # mA more than at rest while a finger moves
STALL_CURRENT = 900.0  # mA against an obstacle
STALL_TIME = 0.3  # s against an obstacle until the locked-rotor error
STALL_FORCE = 400.0  # reaction of the obstacle


class Finger(Servo):
    """One actuator with the finger it moves. A set point acts only once it was written."""

    def __init__(self, number: int, limit: float) -> None:
        super().__init__(float(TEMPERATURES[number]), limit)
        self.number = number
        self.position = float(POSITIONS[number])
        self.blocked = False
        self.power_on()

    def power_on(self) -> None:
        """Forgets commands and latched errors; position and heat are those of the body and stay."""
        self.target: int | None = None
        self.force_goal: int | None = None
        self.speed = SPEED
        self.pressing = 0.0
        self.rest_force = FORCES[self.number]
        self.rest_current = CURRENTS[self.number]
        self.force = float(self.rest_force)
        self.errors = 0
        self._check_heat()

    @property
    def moving(self) -> bool:
        return self.target is not None and self.position != self.target and not self.blocked

    def current(self) -> float:
        if self.target is None or self.position == self.target:
            return float(self.rest_current)
        if not self.blocked:
            return self.rest_current + DRIVE_CURRENT
        return self.rest_current + (STALL_CURRENT - self.rest_current) * min(1.0, self.pressing / STALL_TIME)

    def run(self, seconds: float) -> None:
        """Lets time pass under the present command."""
        if self.moving and self.target is not None:
            way = self.target - self.position
            arrival = abs(way) / self.speed
            if arrival > seconds:
                self.position += self.speed * seconds if way > 0 else -self.speed * seconds
                self.warm(seconds, DRIVE_CURRENT)
            else:
                self.warm(arrival, DRIVE_CURRENT)
                self.position = float(self.target)
                self.warm(seconds - arrival, 0.0)
        elif self.blocked and self.target is not None and self.position != self.target:
            self.pressing += seconds
            if self.pressing >= STALL_TIME:
                self.errors |= LOCKED_ROTOR
            self.warm(seconds, STALL_CURRENT - self.rest_current)
        else:
            self.pressing = 0.0
            self.warm(seconds, 0.0)
        self._push(seconds)

    def _push(self, seconds: float) -> None:
        """The reading follows the force set value: the user's reaction has its sign (exo §2.2.2 note 1)."""
        goal = float(self.rest_force if self.force_goal is None else self.force_goal)
        if self.blocked and self.target is not None and self.position != self.target:
            goal = STALL_FORCE if self.target > self.position else -STALL_FORCE
        way = goal - self.force
        if not way:
            return
        step = min(abs(way), FORCE_RATE * seconds)
        self.force += step if way > 0 else -step

    def put(self, position: float) -> None:
        """Puts it there, without a command."""
        self.position, self.target = float(position), None

    def rest_at(self, force: int) -> None:
        """What its sensor shows without a command."""
        self.rest_force, self.force, self.force_goal = force, float(force), None

    def clear(self) -> None:
        """Clears what can be cleared (exo §2.3.3); a cause that is still there brings its error back."""
        self.errors &= ~CLEARABLE
        self.pressing = 0.0


class Hand:
    """Five fingers, the measured rotation of the thumb (exo §2.3.9: no set value), and the calibration course."""

    def __init__(self, random: Random, jitter: bool, limit: float) -> None:
        self.random = random
        self.jitter = jitter
        self.fingers = [Finger(number, limit) for number in range(5)]
        self.rotation = Finger(4, limit)  # only its position is used
        self.rotation.position = float(ROTATION)
        self.both = (*self.fingers, self.rotation)
        self.now = 0.0
        self._course: list[tuple[float, tuple[int, int, int, int, int, int] | None]] = []

    def power_on(self) -> None:
        self._course = []
        for finger in self.both:
            finger.power_on()

    @property
    def calibrating(self) -> bool:
        return bool(self._course)

    def advance(self, now: float) -> None:
        while self._course and self._course[0][0] <= now:
            start, pose = self._course.pop(0)
            self._run(start - self.now)
            self.now = start
            if pose is None:
                self._end_calibration()
            else:
                self._aim(pose)
        self._run(now - self.now)
        self.now = now

    def _run(self, seconds: float) -> None:
        if seconds > 0.0:
            for finger in self.both:
                goal = finger.rest_force if finger.force_goal is None else finger.force_goal
                on_its_way = finger.target is not None and finger.position != finger.target
                if on_its_way or finger.pressing or finger.force != goal or finger.degrees != finger.ambient:
                    finger.run(seconds)

    def _aim(self, pose: tuple[int, int, int, int, int, int]) -> None:
        for finger, target in zip(self.both, pose, strict=True):
            finger.target = None if target < 0 else target

    def calibrate(self, total: float | None) -> float:
        """Starts the five steps of exo §2.3.6; returns the time of their end.

        The printed waits are 1 + 2 + 2 + 2 + 2 s; the movements between them come on top. `total` stretches or shrinks
        the whole course to that many seconds.
        """
        hold, open_, closed = -1, 1000, 0
        poses = (
            (hold, hold, hold, hold, hold, hold),  # relaxed, no force
            (open_, open_, open_, open_, open_, hold),  # straight
            (closed, closed, closed, closed, hold, hold),  # four fingers clenched
            (open_, open_, open_, open_, closed, closed),  # four straight, thumb bent and turned inside
            (500, 500, 500, 500, 400, hold),  # thumb touches index, the others bent alike
        )
        places = [finger.position for finger in self.both]
        when, starts = 0.0, []
        for pose, wait in zip(poses, (1.0, 2.0, 2.0, 2.0, 2.0), strict=True):
            starts.append(when)
            way = max(abs(target - place) if target >= 0 else 0.0 for target, place in zip(pose, places, strict=True))
            places = [place if target < 0 else float(target) for target, place in zip(pose, places, strict=True)]
            when += way / SPEED + wait
        scale = 1.0 if total is None else total / when
        end = self.now + when * scale
        for finger in self.both:
            finger.speed = SPEED / scale if scale > 0.0 else 1e9
            finger.force_goal = None
        self._course = [(self.now + start * scale, pose) for start, pose in zip(starts, poses, strict=True)]
        self._course.append((end, None))
        return end

    def _end_calibration(self) -> None:
        """The present force becomes zero; the fingers stay where they are until the next command."""
        for finger in self.both:
            finger.speed = SPEED
            finger.target = None
            finger.rest_force = 0
            finger.force = 0.0

    # -- readings, as the registers show them ---------------------------------------------------------------------

    def positions(self) -> list[int]:
        return [round(finger.position) for finger in self.both]

    def forces(self) -> list[int]:
        return [max(-1000, min(1000, round(f.force) + noise)) for f, noise in self._noisy(2)]

    def readings(self) -> list[tuple[str, list[int]]]:
        shaken = [place + (self.random.between(-1, 1) if self.jitter else 0) for place in self.positions()]
        return [
            ("position", [max(0, min(1000, place)) for place in shaken]),
            ("force", self.forces()),
            ("current", [max(0, min(1000, round(f.current()) + noise)) for f, noise in self._noisy(3)]),
            ("error", [finger.error() for finger in self.fingers]),
            ("temperature", [max(0, min(100, int(finger.degrees + 0.0001))) for finger in self.fingers]),
        ]

    def _noisy(self, width: int) -> list[tuple[Finger, int]]:
        """Each finger, and the noise of what it reads."""
        return [(f, self.random.between(-width, width) if self.jitter or f.moving else 0) for f in self.fingers]
