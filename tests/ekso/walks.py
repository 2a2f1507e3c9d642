"""Walks whose every contact is known: foot pressures and knee angles as an EksoNR would log them, with what goes wrong in a lab."""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import pi, sin

from handctl.devices.ekso.gait import SENSORS, SIDES, SIGNALS, Stretch
from handctl.record.timeline import GAP_PERIODS

RATE = 50.0
LOADS, LIFTS = 0.04, 0.06
"""Seconds in which the heel takes its load, and the toe loses it."""
GAIN = 900.0
"""Counts that a loaded sensor reads above its offset."""


@dataclass
class Made:
    """A walk. `strides` are (side, contact, off, next contact) of every stride that was walked whole."""

    stretches: list[Stretch]
    strides: list[tuple[str, float, float, float]]


@dataclass
class Plan:
    """How it is walked.

    stride   seconds of each stride
    stance   part of it with the foot on the ground, by side
    late     of the left foot's stride, the part at which the right foot comes down
    stands   (from, to) in which both feet stand still; strides go on behind
    holes    (from, to) without samples
    offset, gain, drift   counts by sensor; drift is added to the offset by the end
    """

    seconds: float = 40.0
    stride: float = 1.2
    stance: dict[str, float] = field(default_factory=lambda: {"left": 0.62, "right": 0.62})
    late: float = 0.5
    stands: tuple[tuple[float, float], ...] = ()
    holes: tuple[tuple[float, float], ...] = ()
    offset: dict[str, float] = field(default_factory=dict)
    gain: dict[str, float] = field(default_factory=dict)
    drift: dict[str, float] = field(default_factory=dict)
    dead: tuple[str, ...] = ()
    stiff: tuple[str, ...] = ()
    vary: float = 0.0
    noise: float = 1.0
    seed: int = 1
    rate: float = RATE

    def drifting(self, part: float) -> Plan:
        """The same walk, with every sensor drifting by this part of its gain."""
        sensors = (f"{side}_{name}" for side in SIDES for name in SENSORS)
        return replace(self, drift={sensor: part * self.gain.get(sensor, GAIN) for sensor in sensors})


def _contacts(plan: Plan) -> dict[str, list[tuple[float, float, float]]]:
    """(contact, off, next contact) of each foot. A standing phase lengthens the stance in which it begins."""
    chance = random.Random(plan.seed)
    made: dict[str, list[tuple[float, float, float]]] = {side: [] for side in SIDES}
    at = 0.35
    lefts = []
    while at < plan.seconds + 3:
        length = plan.stride * (1 + plan.vary * chance.uniform(-1, 1))
        stand = next((end - begin for begin, end in plan.stands if at <= begin < at + length), 0.0)
        lefts.append((at, length, stand))
        at += length + stand
    for (begin, length, stand), after in pairwise(lefts):
        made["left"].append((begin, begin + length * plan.stance["left"] + stand, after[0]))
        right = begin + length * plan.late + stand
        made["right"].append((right, 0.0, 0.0))
    rights = [contact for contact, _, _ in made["right"]]
    made["right"] = [
        (on, on + (end - on - held) * plan.stance["right"] + held, end)
        for on, end in pairwise(rights)
        for held in [
            next(
                (
                    s
                    for b, _, s in lefts
                    if s
                    and on < b + plan.late * plan.stride + s
                    and b < end <= b + s + 2 * plan.stride
                    and end - on > s
                ),
                0.0,
            )
        ]
    ]
    return made


def walk(plan: Plan) -> Made:
    """The samples, and what was walked."""
    chance = random.Random(plan.seed + 1)
    contacts = _contacts(plan)
    t: list[float] = []
    gaps: list[int] = []
    signals: dict[str, list[float]] = {name: [] for name in SIGNALS}
    place = dict.fromkeys(SIDES, 0)
    for number in range(int(plan.seconds * plan.rate)):
        moment = number / plan.rate
        if any(begin <= moment < end for begin, end in plan.holes):
            continue
        if t and moment - t[-1] > GAP_PERIODS / plan.rate:
            gaps.append(len(t))
        t.append(moment)
        for side in SIDES:
            while place[side] + 1 < len(contacts[side]) and contacts[side][place[side] + 1][0] <= moment:
                place[side] += 1
            heel, toe, bend = _foot(moment, *contacts[side][place[side]])
            for name, load in (("toe", toe), ("heel", heel)):
                sensor = f"{side}_{name}"
                value = plan.offset.get(sensor, 20.0) + plan.drift.get(sensor, 0.0) * moment / plan.seconds
                value += 0.0 if sensor in plan.dead else load * plan.gain.get(sensor, GAIN)
                signals[sensor].append(
                    round(max(0.0, value + (0 if sensor in plan.dead else chance.gauss(0, plan.noise))))
                )
            signals[f"{side}_knee"].append(5.0 + (0.0 if side in plan.stiff else 50.0 * bend))
            signals[f"{side}_hip"].append(10.0 * sin(moment))
    strides = [(side, *one) for side in SIDES for one in contacts[side] if one[2] < t[-1]]
    return Made([Stretch(1, t, signals, gaps)], sorted(strides, key=lambda one: one[1]))


def _foot(moment: float, on: float, off: float, end: float) -> tuple[float, float, float]:
    """Load of heel and toe, and how far the knee is bent, each 0 to 1."""
    if not on <= moment < off:
        return 0.0, 0.0, sin(pi * (moment - off) / (end - off)) if off <= moment < end else 0.0
    since, left, long = moment - on, off - moment, off - on
    heel = min(1.0, since / LOADS) * (1.0 if since < 0.5 * long else max(0.25, 1.0 - 2 * (since / long - 0.5)))
    toe = min(1.0, left / LIFTS) * min(1.0, max(0.0, (since / long - 0.25) * 2))
    return heel * min(1.0, left / LIFTS), toe, 0.0
