"""Check the feedback of an AIDIN-hand that is being driven: encoders that leap, and values that have frozen.

The encoders are incremental: a brown-out sets them to 0 wherever the fingers are (aidin, Modes: homing). A target is an absolute
count, so the hand would drive every finger too far by the counts that were lost. Nothing in the feedback says so, but no motor
gets that far in the time between two objects.

A hand may also repeat its last object: a movement then seems to have stopped, and a current that flowed seems to push. What shows
it is the noise of the fingertip sensors: where it was there before and nothing changes any more, the feedback is old.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees, inf

from handctl.devices.aidin.parameter_map import AIDIN, LARGEST_RADIAN, AidinParam, some
from handctl.errors import CheckFailed, Hint
from handctl.model.param import Number

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
NOISY = 5.0
"""So many times longer than the sensors ever stood still before."""
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


class FeedbackGuard:
    """Sees every object while the hand is driven. `fault` is what is wrong with them, None = nothing.

    changed       whether any value has changed so far
    sets_origin   time from which on the hand may set the origin, so that the encoders may leap
    """

    def __init__(self) -> None:
        self.fault: ImplausibleFeedback | None = None
        self.changed = False
        self.sets_origin = inf
        self._last: dict[str, Numbers] = {}
        self._at: dict[str, float] = {}
        self._begun: dict[str, tuple[float, int]] = {}  # the first object, and how many have come since
        self._change, self._same = 0.0, 0  # the last change of any value, and the objects with sensors since
        self._noise, self._noises, self._stood = (
            0.0,
            0,
            0.0,
        )  # the last change of the sensors, how many, the longest pause

    def note(self, where: str, at: float, good: Mapping[str, Numbers]) -> None:
        """Take the good values of the keys of one object, and when it came."""
        for param in POSITIONS:
            if param.key in good and at < self.sets_origin:
                self._check_leap(where, at, param, good[param.key])
        for key, now in good.items():
            begun, count = self._begun.get(key, (at, -1))
            if count >= 0 and now != self._last[key]:
                self.changed, self._change, self._same = True, at, 0
                if key == SENSORS:
                    self._stood = max(self._stood, at - self._noise)
                    self._noise, self._noises = at, self._noises + 1
            elif key == SENSORS:
                self._same += 1
                self._noise = self._noise if count >= 0 else at
            self._last[key], self._at[key], self._begun[key] = now, at, (begun, count + 1)
        stands = at - self._change
        if self._noises >= OBJECTS and self._same >= OBJECTS and stands > max(FROZEN, NOISY * self._stood):
            self.fault = self.fault or ImplausibleFeedback(
                f"{where}: the feedback has frozen: for {stands:.2f} s no value has changed, not even the noise of the sensors, so "
                "the position of the hand is unknown",
                hint=Hint("check the hand and the network, then check the feedback with {}", "aidin watch"),
                code="frozen-feedback",
            )

    def _check_leap(self, where: str, at: float, param: AidinParam, now: Numbers) -> None:
        before = self._last.get(param.key)
        if before is None or before == now:
            return
        if param.angles and any(abs(number) > LARGEST_RADIAN for number in (*before, *now)):
            return  # no radians: whoever reads them says so
        begun, count = self._begun[param.key]
        since = at - self._at[param.key]
        usual = (self._at[param.key] - begun) / count if count else 0.0  # several objects may come at once
        fastest = FASTEST_TO_0 if param.key == MOTOR_POS and not any(now) else FASTEST
        most = fastest * (max(since, usual) + JITTER)
        unit, sizes = (degrees(1.0) if param.angles else 1.0), RANGES[param.key]
        near = [
            abs(new - old) * unit < most * size - ROUNDED for old, new, size in zip(before, now, sizes, strict=True)
        ]
        if all(near):
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
