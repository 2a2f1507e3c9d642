"""The fingers of a simulated RH56 hand: each moves, meets something soft or hard, and gets warm; together they calibrate.

Knows units and time, no addresses and no frames. Angles are those of the generation (larger is more open), strokes run from 0
(open) to 2000, forces are grams, currents mA, temperatures °C. Everything is computed in closed form from the time that
passed, so a jump of virtual time gives the same as many small steps. What the dossier does not give is invented, and says so.
"""

from __future__ import annotations

from copy import copy

from handctl.sim.engine.simulated_device import Random
from handctl.sim.hand.register_maps import Generation
from handctl.sim.inspire.actuator_faults import CLEARABLE, LOCKED_ROTOR, OVER_CURRENT, OVER_TEMPERATURE, Servo

OPENING, CLOSING, ARRIVED, FORCE_REACHED, PROTECTED, LOCKED, FAULTY, EMERGENCY = 0, 1, 2, 3, 5, 6, 7, 8  # status
DRIVE_CURRENT = 150.0  # mA more than at rest while a finger moves (100 to 194 were measured, dossier §6)
STALL_CURRENT = 880.0  # mA more than at rest against an obstacle, below the golden current limits
STALL_TIME = 0.3  # s against an obstacle until the locked-rotor error
STIFFNESS = 20.0  # g per thousandth of the way that an object is pressed
# Up to this speed none, then g per unit of speed: 100 g became 3453 g at 1000 (dossier §6).
GENTLE, OVERSHOOT = 25, 3.44
HOLDING = 0.3  # mA more than at rest for each g
STROKE = 2000
FULL_STROKE = {"df": 0.8, "tp": 0.6, "f1": 1.0, "dg2": 1.0}  # s from end to end at the highest speed, by generation


class Finger(Servo):
    """One actuator with the finger it moves. A set value acts only once it was written."""

    def __init__(
        self, ends: tuple[int, int], found: tuple[int, int, int, int, int, int], rate: float, limit: float
    ) -> None:
        """`found` are the readings of register_maps.py, `rate` the angle units a second for each unit of speed."""
        stroke, angle, force, current, status, degrees = found
        super().__init__(float(degrees), limit)
        self.closed, self.open = ends
        self.rate = rate
        self.angle, self.stroke = float(angle), float(stroke)
        self.rest_force, self.rest_current = force, current
        self.state = status
        self.thing: float | None = None  # angle at which there is something soft
        self.object: float | None = None  # the same, once the finger was beside it and not within
        self.blocked = False
        self.short = 0.0  # so much before its closed end it stands still, without a word of it
        self.stubborn = False  # at its force limit it takes no command until the limit is another
        self.speed = self.force_limit = self.current_limit = 0
        self.power_on()

    def power_on(self) -> None:
        """Forgets commands and latched errors; position and heat are those of the body and stay."""
        self._forget()
        self.pressing = 0.0
        self.forced = 0  # speed of a calibration
        self.errors = 0
        self._check_heat()

    def _forget(self) -> None:
        self.command: float | None = None  # where it was told to go
        self.goal: float | None = None  # where that ends, by its force limit
        self.stroke_goal = self.stroke
        self.waiting: list[tuple[float, float]] = []  # commands that have not reached the motor: when, where

    # -- what it does -----------------------------------------------------------------------------------------------------

    @property
    def span(self) -> int:
        return self.open - self.closed

    @property
    def halted(self) -> bool:
        """An error keeps it still until that is cleared (invented)."""
        return bool(self.error() & 31)

    @property
    def pace(self) -> float:
        """Angle units a second."""
        return self.rate * (self.forced or self.speed)

    @property
    def driven(self) -> bool:
        """The motor has somewhere to go."""
        return self.goal is not None and self.goal != self.angle and self.pace > 0.0 and not self.halted

    @property
    def moving(self) -> bool:
        return self.driven and not self.blocked

    def stroke_at(self, angle: float) -> float:
        return STROKE * (self.open - angle) / self.span

    def pressed(self) -> float:
        """What an object presses back, g."""
        depth = 0.0 if self.object is None else max(0.0, self.object - self.angle) * 1000.0 / self.span
        return STIFFNESS * depth

    def current(self) -> float:
        driven = self.driven
        if driven and self.blocked:
            return self.rest_current + STALL_CURRENT * min(1.0, self.pressing / STALL_TIME)
        return self.rest_current + self._rise(driven)

    def _rise(self, driven: bool) -> float:
        """mA above rest, but against an obstacle."""
        return (DRIVE_CURRENT if driven else 0.0) + HOLDING * self.pressed()

    def error(self) -> int:
        """The error byte; that of heat follows the temperature, or is what is left of one that is gone."""
        return self.errors | (OVER_TEMPERATURE if self.hot else 0)

    def status(self) -> int:
        """An error shows before all else (dossier §3.1)."""
        error = self.error() & 31
        if error:
            return LOCKED if error & LOCKED_ROTOR else PROTECTED if error & OVER_CURRENT else FAULTY
        return self.state

    # -- commands -------------------------------------------------------------------------------------------------------

    def aim(self, angle: float) -> None:
        """Sends it to this angle now; where its force limit ends the way is known before."""
        if self.halted or (self.stubborn and self.state == FORCE_REACHED and self.pressed() > 0.0):
            return
        self.command = self.goal = angle
        self.place(self.thing)
        if self.short and angle == self.closed:
            self.goal = min(self.open, angle + self.short)
        if self.object is not None and self.goal < self.object:
            grams = max(0, self.force_limit) + OVERSHOOT * max(0, (self.forced or self.speed) - GENTLE)
            self.goal = max(self.goal, self.object - grams / STIFFNESS * self.span / 1000.0)
            if angle < self.angle < self.goal:  # pressed harder than its limit already
                self.goal = self.angle
        self.stroke_goal = self.stroke_at(self.goal)
        if self.driven:
            self.state = OPENING if self.goal > self.angle else CLOSING
        elif self.goal == self.angle:
            self._arrive()

    def _arrive(self) -> None:
        self.stroke = self.stroke_goal
        grams = self.pressed()
        self.state = FORCE_REACHED if grams > 0.0 and grams > self.force_limit - 0.5 else ARRIVED

    def renew(self) -> None:
        """Speed or force limit are others now: a movement goes on with them."""
        if self.command is not None and self.goal != self.angle:
            self.aim(self.command)

    def place(self, thing: float | None) -> None:
        """Puts something soft there; a finger that is already beyond meets it when it closes the next time."""
        self.object = thing if thing is not None and (self.angle >= thing or self.object == thing) else None
        self.thing = thing

    def hold(self, angle: float) -> None:
        """Puts it there, without a command."""
        self.angle = float(angle)
        self._forget()

    # What somebody sees who pokes into memory.

    def put_stroke(self, stroke: float) -> None:
        self.stroke = self.stroke_goal = float(stroke)

    def rest_at(self, force: int) -> None:
        self.rest_force, self.object = force, None

    def show_error(self, error: int) -> None:
        self.errors = error & ~(OVER_TEMPERATURE if self.hot else 0)

    def clear(self) -> None:
        """Clears what can be cleared: not the heat. The finger stays where it is."""
        self.errors &= ~(CLEARABLE + OVER_TEMPERATURE)  # what is left of heat that is gone
        self.pressing = 0.0

    # -- time -----------------------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        """Lets time pass under the present command."""
        if self.object is None and (self.goal is None or self.goal == self.angle):
            self.warm(seconds, 0.0)
            return
        driven = self.driven
        if driven and self.blocked:
            self._press(seconds)
        elif driven and self.goal is not None:
            way = abs(self.goal - self.angle) / self.pace
            part = min(seconds, way)
            self.warm(part, self._rise(driven))
            self.stroke += (self.stroke_goal - self.stroke) * part / way
            if way <= seconds + 0.000000001:
                self.angle = self.goal
                self._arrive()
            else:
                self.angle += (self.goal - self.angle) * part / way
            self.warm(seconds - part, self._rise(self.driven))
        else:
            self.warm(seconds, self._rise(driven))
        if self.halted and self.goal is not None:
            self._forget()
            self.state = ARRIVED

    def _press(self, seconds: float) -> None:
        """Against an obstacle: the current rises until it is too much, or has lasted too long."""
        until = STALL_TIME
        if self.rest_current + STALL_CURRENT > self.current_limit > 0:
            until = STALL_TIME * max(0.0, self.current_limit - self.rest_current) / STALL_CURRENT
        self.pressing += seconds
        self.warm(seconds, STALL_CURRENT)
        if self.pressing >= until:
            self.errors |= LOCKED_ROTOR if until == STALL_TIME else OVER_CURRENT


CALIBRATION = 6.0  # s (dossier Q8)
HELD, OPEN, BENT = -1, 1, 0
COURSE = (  # opens, closes four fingers, opens, bends the thumb, opens (dossier Q8)
    (OPEN,) * 6,
    (BENT, BENT, BENT, BENT, HELD, HELD),
    (OPEN, OPEN, OPEN, OPEN, HELD, HELD),
    (HELD, HELD, HELD, HELD, BENT, BENT),
    (HELD, HELD, HELD, HELD, OPEN, OPEN),
)


class Body:
    """All fingers, what is on its way to them, and a calibration."""

    def __init__(self, random: Random, generation: Generation, jitter: bool | None, fingers: list[Finger]) -> None:
        self._seed = copy(random).between(0, 1 << 20)
        self.random = Random(self._seed)
        self.generation = generation
        self.jitter = jitter
        self.fingers = fingers
        self.now = 0.0
        self.stopped = False  # emergency stop
        self.course: list[tuple[float, int]] = []  # of a calibration: when, number of the pose or of their end

    def power_on(self) -> None:
        self.course = []
        self.stopped = False
        for finger in self.fingers:
            finger.power_on()

    @property
    def calibrating(self) -> bool:
        return bool(self.course)

    def advance(self, now: float) -> None:
        while (event := self.next_event()) is not None and event <= now:
            self._run(event)
            if self.course and self.course[0][0] <= event:
                self._pose(self.course.pop(0)[1])
            for finger in self.fingers:
                while finger.waiting and finger.waiting[0][0] <= event:
                    finger.aim(finger.waiting.pop(0)[1])
        self._run(now)

    def _run(self, now: float) -> None:
        if now > self.now:
            for finger in self.fingers:
                at_rest = finger.object is None and (finger.goal is None or finger.goal == finger.angle)
                if not at_rest or finger.degrees != finger.ambient:
                    finger.run(now - self.now)
            self.now = now

    def next_event(self) -> float | None:
        """When a command reaches its motor, or the next pose of a calibration begins."""
        first = self.course[0][0] if self.course else None
        for finger in self.fingers:
            if finger.waiting and (first is None or finger.waiting[0][0] < first):
                first = finger.waiting[0][0]
        return first

    # -- commands -------------------------------------------------------------------------------------------------------

    def command(self, number: int, angle: float, dead_time: float) -> None:
        """Sends a finger on its way, after the dead time. None moves while it calibrates or is stopped (invented)."""
        if self.calibrating or self.stopped:
            return
        if dead_time > 0.0:
            self.fingers[number].waiting.append((self.now + dead_time, angle))
        else:
            self.fingers[number].aim(angle)

    def use_speed(self, number: int, speed: int) -> None:
        """From now on; at 0 a finger stands still, and goes on when it has a speed again (open)."""
        self.fingers[number].speed = speed
        self.fingers[number].renew()

    def use_force(self, number: int, grams: int) -> None:
        """From now on; a finger that stands at its limit needs another command (open)."""
        finger = self.fingers[number]
        if finger.stubborn and finger.force_limit != grams and finger.state == FORCE_REACHED:
            finger.state = ARRIVED
        finger.force_limit = grams
        finger.renew()

    def stop(self, stopped: bool) -> None:
        """The emergency stop of F1 and DG2. Nothing moves on when it is released (open)."""
        if stopped and not self.stopped:
            self.course = []
            for finger in self.fingers:
                finger.hold(finger.angle)
                finger.state = EMERGENCY
        elif self.stopped and not stopped:
            for finger in self.fingers:
                finger.state = ARRIVED
        self.stopped = stopped

    def calibrate(self, seconds: float, moves: bool) -> float:
        """Begins a calibration, of the open and unloaded hand; the moment of its end."""
        step = seconds / len(COURSE)
        poses = len(COURSE) if moves else 0
        self.course = [(self.now + step * number, number) for number in range(poses)]
        self.course.append((self.now + seconds, len(COURSE)))
        if moves:
            self._pose(self.course.pop(0)[1])
        return self.now + seconds

    def _pose(self, pose: int) -> None:
        """The next pose, at the greatest speed; behind the last the forces are zero."""
        for number, finger in enumerate(self.fingers):
            if pose == len(COURSE):
                finger.rest_force = finger.forced = 0
            elif (way := COURSE[pose][min(number, 5)]) != HELD:
                finger.forced = self.generation.fast
                finger.aim(float(finger.open if way == OPEN else finger.closed))

    # -- readings, as the registers show them ---------------------------------------------------------------------------

    def jitters(self) -> None:
        """Before readings are taken: they jitter by the moment, not by what the wire did before."""
        self.random = Random(self._seed + int(1000 * self.now + 0.25))

    def readings(self, foreign: bool) -> list[tuple[str, list[int]]]:
        """Those of each word; of a `foreign` hand no angle can be."""
        fingers = self.fingers
        angles = range(3000, 3000 + len(fingers)) if foreign else [round(finger.angle) for finger in fingers]
        each = [(finger, self.jitter is not None and (self.jitter or finger.moving)) for finger in fingers]
        between = self.random.between
        shaken = [between(-1, 1) if self.jitter else 0 for _ in fingers]
        forces = [f.rest_force + round(f.pressed()) + (between(-2, 2) if shakes else 0) for f, shakes in each]
        currents = [round(f.current()) + (between(-3, 3) if shakes else 0) for f, shakes in each]
        return [
            ("stroke", [round(finger.stroke) + 2 * more for finger, more in zip(fingers, shaken, strict=True)]),
            ("angle", [angle + more for angle, more in zip(angles, shaken, strict=True)]),
            ("force", [max(-32768, min(32767, force)) for force in forces]),
            ("current", [max(-32768, min(32767, current)) for current in currents]),
            ("error", [finger.error() for finger in fingers]),
            ("status", [finger.status() for finger in fingers]),
            ("temperature", [max(0, min(255, int(finger.degrees + 0.0001))) for finger in fingers]),
        ]
