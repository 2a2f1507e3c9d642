"""The mechanics of the simulated wrist: two axes, two actuators, heat, error bits.

Knows units and time, no addresses and no frames. Angles are in 0.01° (wrist §2.1), currents in mA, temperatures in °C
(assumed, as on the hand). Everything is computed in closed form from the time that passed, so a jump of virtual time
gives the same as many small steps.

Which actuator drives which axis is not said; here both work for either, so a stalled axis shows on both.
"""

from __future__ import annotations

from handctl.sim.engine.simulated_device import Random
from handctl.sim.inspire.actuator_faults import CLEARABLE, LOCKED_ROTOR, Servo

PITCH, YAW = 0, 1
AXES = ("pitch", "yaw")
# Power-on values, all different so that a swap is seen.
ANGLES = (-345.0, 1125.0)
CURRENTS = (222, 111)  # of actuators #1 and #2
TEMPERATURES = (31.0, 34.0)

DRIVES = (140.0, 170.0)  # mA more than at rest while the wrist moves, by actuator
STALL_CURRENT = 900.0  # mA against an obstacle
STALL_TIME = 0.3  # s against an obstacle until the locked-rotor error


class Actuator(Servo):
    """A servo actuator: current, heat, errors."""

    def __init__(self, number: int, limit: float) -> None:
        super().__init__(TEMPERATURES[number], limit)
        self.number = number
        self.drive = DRIVES[number]
        self.power_on()

    def power_on(self) -> None:
        """Forgets latched errors; heat is that of the body and stays."""
        self.errors = 0
        self.rest_current = CURRENTS[self.number]
        self._check_heat()


class Body:
    """Both axes and both actuators. A set value acts only once it was written."""

    def __init__(self, random: Random, jitter: bool, limit: float) -> None:
        self.random = random
        self.jitter = jitter
        self.actuators = (Actuator(0, limit), Actuator(1, limit))
        self.angles = list(ANGLES)
        self.targets: list[int | None] = [None, None]
        self.blocked = [False, False]
        self.duration = 0.0  # s, of the movement under way
        self.left = 0.0  # s until it arrives
        self.pressing = 0.0  # s against an obstacle
        self.now = 0.0

    def power_on(self) -> None:
        """Forgets commands and latched errors; angles and heat are those of the body and stay."""
        self.targets = [None, None]
        self.left = self.pressing = 0.0
        for actuator in self.actuators:
            actuator.power_on()

    def move(self, targets: dict[int, int], seconds: float) -> None:
        """Starts a movement: each axis given, and one still on its way, arrives after this time (wrist §2.1).

        Both arrive together. A time of 0 is taken as: at once (open).
        """
        for axis, target in targets.items():
            self.targets[axis] = target
        self.duration = self.left = seconds
        self._run(0.0)

    def release(self, axis: int) -> None:
        """Takes an obstacle away: the movement starts again."""
        self.blocked[axis] = False
        self.left = self.duration
        self._run(0.0)

    def hold(self, axis: int, angle: float) -> None:
        """Puts an axis there, without a command."""
        self.angles[axis], self.targets[axis] = float(angle), None

    def hold_pitch(self, angle: int) -> None:
        self.hold(PITCH, angle)

    def hold_yaw(self, angle: int) -> None:
        self.hold(YAW, angle)

    @property
    def movement(self) -> list[float]:
        """Seconds that the movement under way takes, and that are left of it."""
        return [self.duration, self.left]

    @movement.setter
    def movement(self, seconds: list[float]) -> None:
        self.duration, self.left = seconds

    def clear(self) -> None:
        """Clears what can be cleared; a cause that is still there brings its error back."""
        self.pressing = 0.0
        for actuator in self.actuators:
            actuator.errors &= ~CLEARABLE

    def _away(self, blocked: bool) -> bool:
        """Whether an axis is not where it was told to go, and cannot go there (`blocked`), or can."""
        for axis in (PITCH, YAW):
            if self.blocked[axis] == blocked and self.targets[axis] not in (None, self.angles[axis]):
                return True
        return False

    @property
    def moving(self) -> bool:
        return self._away(False)

    @property
    def stalled(self) -> bool:
        return self._away(True)

    def advance(self, now: float) -> None:
        seconds = now - self.now
        self.now = now
        if seconds <= 0.0:
            return
        if self.moving and self.left < seconds:  # up to the arrival, then from it on
            seconds -= self.left
            self._run(self.left)
        self._run(seconds)

    def _run(self, seconds: float) -> None:
        """Lets time pass that holds at most one arrival, at its end."""
        stalled = self.stalled
        for actuator in self.actuators:
            actuator.warm(seconds, STALL_CURRENT - actuator.rest_current if stalled else self._rise(actuator))
        self.pressing = self.pressing + seconds if stalled else 0.0
        if self.pressing >= STALL_TIME:
            for actuator in self.actuators:
                actuator.errors |= LOCKED_ROTOR
        for axis in (PITCH, YAW):
            target = self.targets[axis]
            if target is None or self.blocked[axis]:
                continue
            if self.left <= seconds:
                self.angles[axis] = float(target)
            else:
                self.angles[axis] += (target - self.angles[axis]) * seconds / self.left
        self.left = max(0.0, self.left - seconds)

    def _rise(self, actuator: Actuator) -> float:
        """mA above rest at this moment."""
        if self.stalled:
            return (STALL_CURRENT - actuator.rest_current) * min(1.0, self.pressing / STALL_TIME)
        return actuator.drive if self.moving else 0.0

    # -- readings, as the registers show them ---------------------------------------------------------------------

    def positions(self) -> list[int]:
        """Pitch and yaw, 0.01°."""
        return [round(angle) + (self.random.between(-2, 2) if self.jitter else 0) for angle in self.angles]

    def currents(self) -> list[int]:
        """Of actuators #1 and #2, mA."""
        noisy = self.jitter or self.moving
        noise = [self.random.between(-3, 3) if noisy else 0 for _ in self.actuators]
        shown = [round(a.rest_current + self._rise(a)) + more for a, more in zip(self.actuators, noise, strict=True)]
        return [max(-32768, min(32767, current)) for current in shown]
