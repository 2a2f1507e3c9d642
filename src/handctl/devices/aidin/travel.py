"""The way of each motor during homing, and what it proves (aidin, Modes: homing; Ranges).

The hand sets 0 wherever a finger stands. So it counts where a motor rested before that, judged by what else is known:
the origin of an earlier homing, and the stroke of the manual. Knows looks and times; sends nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from handctl.devices.aidin.feedback import Feedback
from handctl.devices.aidin.map import AIDIN
from handctl.model.param import Number

MOTOR_POS = AIDIN["motor_pos"]
AT_ORIGIN = 0.01
"""Share of a stroke within which a motor counts as at 0."""
AT_STOP = 0.02
"""Share of a stroke within which a motor counts as at its open stop."""
STILL = 0.001
"""Share of a stroke that a motor may change from one look to the next and still stand."""
LEAP = 3
"""A motor that changes so many times faster than just before, from one look to the next, was not driven there."""
RESTED = 0.5
"""Seconds that a motor must stand before the origin is set."""

Counts = tuple[int, ...]


class Verdict(Enum):
    """What the way of one motor proves; `proof` = it is open."""

    OPEN = "open"
    STROKE = "whole stroke"
    UNPROVEN = "unproven"
    STAYED = "hardly moved"
    SHORT = "stopped short"
    BEYOND = "beyond the origin"
    MOVING = "still moving"
    OFF = "not at 0"

    @property
    def proof(self) -> bool:
        return self in (Verdict.OPEN, Verdict.STROKE)

    @property
    def speaks_against(self) -> bool:
        """Whether it shows that homing went wrong, and not only that nothing shows that it went well."""
        return not self.proof and self is not Verdict.UNPROVEN


@dataclass(frozen=True, slots=True)
class Way:
    """One motor: its encoder at first, where it rested before the origin was set, and now, in counts."""

    index: int
    start: int
    rest: int
    now: int
    still: bool
    verdict: Verdict = Verdict.UNPROVEN

    @property
    def travelled(self) -> int:
        """Counts towards open."""
        return self.start - self.rest

    def share(self, counts: float) -> float:
        return counts / stroke(self.index)


class Travel:
    """Looks at all encoders, each with its time."""

    def __init__(self) -> None:
        self._looks: list[tuple[float, Counts]] = []
        self._taken: tuple[Feedback, int] | None = None

    def note(self, at: float, encoders: Counts) -> None:
        """Encoders as they are at a time."""
        self._looks.append((at, encoders))

    def look(self, at: float, feedback: Feedback) -> None:
        """The encoders of feedback, unless they are those of the last look or were refused."""
        key = MOTOR_POS.key
        count = feedback.good.get(key, 0)
        new = self._taken is None or self._taken[0] is not feedback or self._taken[1] != count
        if key in feedback.values and key not in feedback.errors and new:
            self._taken = feedback, count
            self.note(at, encoders_of(feedback))

    @property
    def last(self) -> Counts | None:
        """The newest encoders, None before the first look."""
        return self._looks[-1][1] if self._looks else None

    @property
    def moved(self) -> bool:
        """Whether any motor was seen away from where it was at first."""
        return any(moving(self._looks[0][1], encoders) for _, encoders in self._looks)

    def ways(self, zeroed: float) -> list[Way]:
        """The way of each motor and its verdict; the hand may have set the origin from the time `zeroed` on."""
        ways = [self._way(index, zeroed) for index in range(MOTOR_POS.count)]
        known, went = _knows_origin(ways), any(abs(way.share(way.travelled)) > AT_STOP for way in ways)
        return [replace(way, verdict=_verdict(way, known, went)) for way in ways]

    def _way(self, index: int, zeroed: float) -> Way:
        history = [(at, encoders[index]) for at, encoders in self._looks]
        cut = self._jump(index, history, zeroed)
        at, rest = history[cut]
        earlier = [value for when, value in history[:cut] if when <= at - RESTED]
        still = bool(earlier) and abs(rest - earlier[-1]) <= stroke(index) * STILL
        return Way(index, history[0][1], rest, history[-1][1], still)

    @staticmethod
    def _jump(index: int, history: list[tuple[float, int]], zeroed: float) -> int:
        """The last look before the encoder jumped to 0; the last of all where it was near 0 anyway."""
        for place in range(len(history) - 1, 0, -1):
            (_, before), (at, now) = history[place - 1 : place + 1]
            if at < zeroed:
                break
            pace = abs(before - history[max(place - 2, 0)][1])
            fast = abs(now - before) > LEAP * max(pace, stroke(index) * STILL)
            if fast and abs(now) <= stroke(index) * AT_ORIGIN:
                return place - 1
        return len(history) - 1


def _knows_origin(ways: Sequence[Way]) -> bool:
    """Whether the encoders counted from the open stop before: most motors that moved came to rest at 0.

    Just after power-on they are 0 wherever the fingers are, and so what moves comes to rest elsewhere.
    """
    went = [way for way in ways if abs(way.share(way.travelled)) > AT_STOP]
    return 2 * sum(abs(way.share(way.rest)) <= AT_STOP for way in went) > len(went)


def _verdict(way: Way, known: bool, went: bool) -> Verdict:
    """What it proves, where the origin of before is `known` or not and any motor `went` further than the play of a stop."""
    if abs(way.share(way.now)) > AT_ORIGIN:
        return Verdict.OFF
    if not way.still:
        return Verdict.MOVING
    if way.share(way.travelled) >= 1.0 - AT_STOP:
        return Verdict.STROKE
    if known and abs(way.share(way.rest)) <= AT_STOP:
        return Verdict.OPEN
    if abs(way.share(way.travelled)) <= AT_STOP and (went or abs(way.share(way.start)) > AT_STOP):
        return Verdict.STAYED
    if known:
        return Verdict.BEYOND if way.rest < 0 else Verdict.SHORT
    return Verdict.UNPROVEN


def encoders_of(feedback: Feedback) -> Counts:
    return tuple(int(number) for number in feedback.values[MOTOR_POS.key])


def stroke(index: int) -> float:
    limit = MOTOR_POS.limit(index)
    assert limit is not None
    return limit[1] - limit[0]


def moving(before: tuple[Number, ...] | None, now: tuple[Number, ...]) -> list[int]:
    """Motors whose encoder has changed by more than jitter; all of them without a look before."""
    if before is None:
        return list(range(len(now)))
    return [i for i, (a, b) in enumerate(zip(before, now, strict=True)) if abs(b - a) > stroke(i) * STILL]
