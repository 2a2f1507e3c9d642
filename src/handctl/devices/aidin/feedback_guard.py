"""Check the feedback of an AIDIN-hand that is being driven or stopped: encoders that leap, and values that have frozen.

The encoders are incremental: a brown-out sets them to 0 wherever the fingers are (aidin, Modes: homing). A target is an absolute
count, so the hand would drive every finger too far by the counts that were lost. Nothing in the feedback says so, but no motor
gets that far in the time between two objects.

A hand may also repeat its last object: a movement then seems to have stopped, and a current that flowed seems to push. What shows
it is the noise of the fingertip sensors: where it was there before and nothing changes any more, the feedback is old.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, inf

from handctl.devices.aidin.parameter_map import AIDIN, LARGEST_RADIAN, AidinParam
from handctl.errors import CheckFailed, Hint
from handctl.model.param import Number
from handctl.wording import some

Numbers = tuple[Number, ...]

FASTEST, FASTEST_TO_0 = 3.0, 1.0
"""Ranges a second that no element passes, and that all motors together do not pass on their way to exactly 0. Ours: the manual has
no speeds. handctl's own ramps are 15 times slower than the first."""
JITTER = 0.04
"""Seconds by which an object may come later than the one before it: a server that writes in pieces waits for an acknowledgement."""
ROUNDED = 0.001
"""Degrees, more than rounding makes of a difference: beyond them the values are compared as people see them."""
FROZEN = 0.5
"""Seconds in which nothing changes, at least."""
OBJECTS = 5
"""Objects with the sensors that come meanwhile, at least; and changes of the sensors before that show their noise."""
SCARCE = 2
"""So many times longer where fewer changes were seen: each object differed from the one before it, but there were only a few."""
NOISY = 5
"""So many times more objects than the sensors ever stood still for before."""
NO_NOISE = "either the sensors of this hand have none, or it repeats old feedback"
OLD = "no value has changed, not even the noise of the sensors"
POSITIONS = (AIDIN["motor_pos"], AIDIN["joint_pos"], AIDIN["task_space_pos"])
MOTOR_POS, SENSORS = POSITIONS[0].key, AIDIN["sensor_state"].key
RANGES = {
    param.key: tuple(
        inf if (limit := param.limit(index)) is None else limit[1] - limit[0] for index in range(param.count)
    )
    for param in POSITIONS
}


class ImplausibleFeedback(CheckFailed):
    """Feedback that cannot be that of the moving hand: the hand has to be stopped, because nothing shows where it is."""


class Liveness:
    """Whether the feedback still changes. Sees every object of a connection, whether the hand is driven or not.

    changes  values that have changed so far
    same     objects with the sensors since the last change of any value
    """

    def __init__(self, pause: int | None = None) -> None:
        """`pause` is what was known of the noise before, see there."""
        self.changes = self.same = 0
        self._known, self._noises, self._calm, self._calmest = pause, 0, 0, 0
        self._last: dict[str, Sequence[object]] = {}
        self._change = inf
        self._at_rest = True
        """No encoder has changed since the last object with the sensors."""
        self._resting = 0
        """Changes of the sensors at rest: there they are noise, even one of them."""

    def note(self, at: float, values: Mapping[str, Sequence[object]]) -> None:
        """Take the values of the keys of one object, and when it came, in seconds."""
        changed = {key for key, now in values.items() if key in self._last and now != self._last[key]}
        self._at_rest = self._at_rest and MOTOR_POS not in changed
        if changed or self._change == inf:
            self.same, self._change = 0, at
        self.changes += len(changed)
        if SENSORS in changed:
            self._noises, self._resting = self._noises + 1, self._resting + self._at_rest
            self._calm, self._calmest = 0, max(self._calm, self._calmest)
        elif SENSORS in self._last and SENSORS in values:
            self._calm += 1
            self.same += not changed
        self._at_rest = self._at_rest or SENSORS in values
        self._last.update(values)

    @property
    def senses(self) -> bool:
        """Whether an object with the sensors has come."""
        return SENSORS in self._last

    @property
    def pause(self) -> int | None:
        """The most objects in which noisy sensors stood still before they changed again; None = no noise was seen."""
        seen = self._noises >= OBJECTS or (self._resting and not self._calmest)
        return max(self._calmest, self._known or 0) if seen or self._known is not None else None

    @property
    def silent(self) -> bool:
        """Whether nothing has changed for so many objects that what came last may be old."""
        return self.pause is not None and self.same > NOISY * self.pause

    def frozen(self, at: float) -> float:
        """Seconds for which nothing has changed, where that proves that the feedback is old; 0.0 = it does not."""
        enough = 1 if self._noises >= OBJECTS or self._known is not None else SCARCE
        stands = at - self._change
        return stands if self.silent and self.same >= OBJECTS and stands > enough * FROZEN else 0.0


class FeedbackGuard:
    """Sees every object while the hand is driven. `fault` is what is wrong with them, None = nothing.

    changed       whether any value has changed so far
    sets_origin   time from which on the hand may set the origin, so that the encoders may leap
    """

    def __init__(
        self, live: Liveness | None = None, at: float = 0.0, begin: Mapping[str, Numbers] | None = None
    ) -> None:
        """`live` has seen the connection so far, and `begin` is what came last, at the time `at`."""
        self.fault: ImplausibleFeedback | None = None
        self.sets_origin = inf
        self._live = live or Liveness()
        self._changes = self._live.changes
        self._last: dict[str, Numbers] = dict(begin or {})
        self._at = dict.fromkeys(self._last, at)
        self._begun = dict.fromkeys(self._last, (at, 0))  # the first object, and how many have come since

    @property
    def changed(self) -> bool:
        return self._live.changes > self._changes

    def note(self, where: str, at: float, good: Mapping[str, Numbers]) -> None:
        """Take the good values of the keys of one object, and when it came."""
        self._live.note(at, good)
        for param in POSITIONS:
            if param.key in good:
                if at < self.sets_origin:
                    self._check_leap(where, at, param, good[param.key])
                begun, count = self._begun.get(param.key, (at, -1))
                self._last[param.key], self._at[param.key] = good[param.key], at
                self._begun[param.key] = begun, count + 1
        self.check_frozen(where, at)

    def check_frozen(self, where: str, at: float) -> None:
        """Set `fault` where the feedback has frozen."""
        if stands := self._live.frozen(at):
            self.fault = self.fault or ImplausibleFeedback(
                f"{where}: the feedback has frozen: for {stands:.2f} s {OLD}, so the position of the hand is unknown",
                hint=Hint("check the hand and the network, then check the feedback with {}", "aidin watch"),
                code="frozen-feedback",
            )

    def _check_leap(self, where: str, at: float, param: AidinParam, now: Numbers) -> None:
        before = self._last.get(param.key)
        if before is None or before == now:
            return
        if param.angles and max(map(abs, (*before, *now))) > LARGEST_RADIAN:
            return  # no radians: whoever reads them says so
        begun, count = self._begun[param.key]
        since = at - self._at[param.key]
        usual = (self._at[param.key] - begun) / count if count else 0.0  # several objects may come at once
        fastest = FASTEST_TO_0 if param.key == MOTOR_POS and not any(now) else FASTEST
        most = fastest * (max(since, usual) + JITTER)
        unit, sizes = (degrees(1.0) if param.angles else 1.0), RANGES[param.key]
        places = zip(before, now, sizes, strict=True)
        if not [1 for old, new, size in places if old != new and abs(new - old) * unit >= most * size - ROUNDED]:
            return  # as nearly always, and each object of each movement passes here
        ends = zip(map(param.from_wire, before), map(param.from_wire, now), sizes, strict=True)
        leaps = [
            f"{param.elements[index]} from {old:.{param.places}f} to {new:.{param.places}f}"
            for index, (old, new, size) in enumerate(ends)
            if abs(new - old) > most * size
        ]
        if leaps:
            self.fault = self.fault or ImplausibleFeedback(
                f"{where}: {param.key} jumped within {since:.2f} s, farther than a motor moves in that time: {some(leaps)}. "
                "The encoders have probably lost their origin, for example because the power failed",
                hint=Hint("check the power supply, then run {} before you move the hand again", "aidin home"),
                code="origin-lost",
            )
