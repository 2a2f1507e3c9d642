"""All fingers of a simulated RH56 hand: what is on its way to them, a calibration, an emergency stop, their readings.

Knows units and time, no addresses and no frames; those of finger.py.
"""

from __future__ import annotations

from copy import copy

from handctl.sim.engine.model import Random
from handctl.sim.hand.finger import ARRIVED, EMERGENCY, FIELDS, FORCE_REACHED, GOALS, Finger, fields_of

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from handctl.sim.hand.books import Generation

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
        self._course: list[tuple[float, int]] = []  # of a calibration: when, number of the pose or of their end

    def power_on(self) -> None:
        self._course = []
        self.stopped = False
        for finger in self.fingers:
            finger.power_on()

    @property
    def calibrating(self) -> bool:
        return bool(self._course)

    def advance(self, now: float) -> None:
        while (event := self.next_event()) is not None and event <= now:
            self._run(event - self.now)
            self.now = max(self.now, event)
            if self._course and self._course[0][0] <= event:
                self._pose(self._course.pop(0)[1])
            for finger in self.fingers:
                while finger.waiting and finger.waiting[0][0] <= event:
                    finger.aim(finger.waiting.pop(0)[1])
        self._run(now - self.now)
        self.now = max(self.now, now)

    def _run(self, seconds: float) -> None:
        if seconds > 0.0:
            for finger in self.fingers:
                finger.run(seconds)

    def next_event(self) -> float | None:
        """When a command reaches its motor, or the next pose of a calibration begins."""
        first = self._course[0][0] if self._course else None
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
            self._course = []
            for finger in self.fingers:
                finger.hold(finger.angle)
                finger.state = EMERGENCY
        elif self.stopped and not stopped:
            for finger in self.fingers:
                finger.state = ARRIVED
        self.stopped = stopped

    def calibrate(self, seconds: float, still: bool) -> float:
        """Begins a calibration, of the open and unloaded hand; the moment of its end."""
        step = seconds / len(COURSE)
        poses = 0 if still else len(COURSE)
        self._course = [(self.now + step * number, number) for number in range(poses)]
        self._course.append((self.now + seconds, len(COURSE)))
        if not still:
            self._pose(self._course.pop(0)[1])
        return self.now + seconds

    def _pose(self, pose: int) -> None:
        """The next pose, at the greatest speed; behind the last the forces are zero."""
        for number, finger in enumerate(self.fingers):
            if pose == len(COURSE):
                finger.rest_force = finger.forced = 0
            elif (way := COURSE[pose][min(number, 5)]) != HELD:
                finger.forced = self.generation.fast
                finger.aim(float(finger.open if way == OPEN else finger.closed))

    # -- state file -----------------------------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """Where the fingers are and go, and what is left of a calibration."""
        rows = [
            {
                **{name: getattr(finger, name) for name in (*FIELDS, *GOALS)},
                "waiting": [[when - self.now, angle] for when, angle in finger.waiting],
            }
            for finger in self.fingers
        ]
        return {"rows": rows, "course": [[when - self.now, number] for when, number in self._course]}

    def check(
        self, state: dict[str, Any], longest: float = 3600.0
    ) -> tuple[list[dict[str, Any]], list[tuple[float, int]]]:
        """What a snapshot holds; KeyError, TypeError or ValueError when it does not fit."""
        rows = [fields_of(row) for row in state["rows"]]
        course = [(float(when), int(number)) for when, number in state["course"]]
        if len(rows) != len(self.fingers) or not all(0 <= w <= longest and 0 <= n <= len(COURSE) for w, n in course):
            raise ValueError("impossible calibration or number of fingers")
        return rows, course

    def use(self, rows: list[dict[str, Any]], course: list[tuple[float, int]]) -> None:
        """Takes what `check` gave."""
        self._course = [(self.now + when, number) for when, number in course]
        for finger, row in zip(self.fingers, rows, strict=True):
            for name in (*FIELDS, *GOALS):
                if name != "temperature":
                    setattr(finger, name, row[name])
            finger.waiting = [(self.now + when, angle) for when, angle in row["waiting"]]
            finger.set_temperature(float(row["temperature"]))

    # -- readings, as the registers show them ---------------------------------------------------------------------------

    def strokes(self) -> list[int]:
        return [round(finger.stroke) for finger in self.fingers]

    def angles(self) -> list[int]:
        return [round(finger.angle) for finger in self.fingers]

    def jitters(self) -> None:
        """Before readings are taken: they jitter by the moment, not by what the wire did before."""
        self.random = Random(self._seed + int(1000 * self.now + 0.25))

    def forces(self) -> list[int]:
        return [_bound(finger.rest_force + round(finger.pressed()) + self._noise(finger, 2)) for finger in self.fingers]

    def currents(self) -> list[int]:
        return [_bound(round(finger.current()) + self._noise(finger, 3)) for finger in self.fingers]

    def errors(self) -> list[int]:
        return [finger.error() for finger in self.fingers]

    def statuses(self) -> list[int]:
        return [finger.status() for finger in self.fingers]

    def temperatures(self) -> list[int]:
        return [max(0, min(255, int(finger.temperature + 0.0001))) for finger in self.fingers]

    def _noise(self, finger: Finger, width: int) -> int:
        noisy = self.jitter is not None and (self.jitter or finger.moving)
        return self.random.between(-width, width) if noisy else 0


def _bound(value: int) -> int:
    return max(-32768, min(32767, value))
