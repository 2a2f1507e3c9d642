"""Walks whose every contact is known: foot pressures and knee angles as an EksoNR would log them, with what goes wrong in a lab."""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from math import pi, sin

from handctl.devices.ekso.gait import SENSORS, SIDES, Stretch
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


@cache
def _chance(seed: int) -> list[float]:
    """Noise of deviation 1, as far as a walk has needed it. It is the same in every walk of a seed."""
    return []


def _noise(seed: int, count: int) -> list[float]:
    """The first so many of them."""
    made = _chance(seed)
    if len(made) < count:
        chance = random.Random(seed)
        made[:] = [chance.gauss(0, 1) for _ in range(count)]
    return made[:count]


def walk(plan: Plan) -> Made:
    """The samples, and what was walked."""
    contacts = _contacts(plan)
    t = [number / plan.rate for number in range(int(plan.seconds * plan.rate))]
    for begin, end in plan.holes:
        t = [moment for moment in t if not begin <= moment < end]
    gaps = [row for row, (a, b) in enumerate(pairwise(t), 1) if b - a > GAP_PERIODS / plan.rate]
    signals: dict[str, list[float]] = {}
    noisy = [f"{side}_{name}" for side in SIDES for name in SENSORS if f"{side}_{name}" not in plan.dead]
    noise = _noise(plan.seed + 1, len(noisy) * len(t))
    for side in SIDES:
        feet = _feet(t, contacts[side])
        for name in SENSORS:
            sensor = f"{side}_{name}"
            offset, drift = plan.offset.get(sensor, 20.0), plan.drift.get(sensor, 0.0)
            values = [offset + drift * moment / plan.seconds for moment in t]
            if sensor in noisy:
                gain, level, chances = plan.gain.get(sensor, GAIN), plan.noise, noise[noisy.index(sensor) :: len(noisy)]
                loads = [toe for _, toe, _ in feet] if name == "toe" else [heel for heel, _, _ in feet]
                rows = zip(values, loads, chances, strict=True)
                values = [value + load * gain + chance * level for value, load, chance in rows]
            signals[sensor] = [round(value) if value > 0 else 0 for value in values]
        bent = 0.0 if side in plan.stiff else 50.0
        signals[f"{side}_knee"] = [5.0 + bent * bend for _, _, bend in feet]
        signals[f"{side}_hip"] = [10.0 * sin(moment) for moment in t]
    strides = [(side, *one) for side in SIDES for one in contacts[side] if one[2] < t[-1]]
    return Made([Stretch(1, t, signals, gaps)], sorted(strides, key=lambda one: one[1]))


def _feet(t: list[float], contacts: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Of each moment the load of heel and toe, and how far the knee is bent, each 0 to 1."""
    feet, place, last = [], 0, len(contacts) - 1
    for moment in t:
        while place < last and contacts[place + 1][0] <= moment:
            place += 1
        on, off, end = contacts[place]
        if not on <= moment < off:
            feet.append((0.0, 0.0, sin(pi * (moment - off) / (end - off)) if off <= moment < end else 0.0))
            continue
        since, left, long = moment - on, off - moment, off - on
        loaded = since / LOADS if since < LOADS else 1.0
        lifted = left / LIFTS if left < LIFTS else 1.0
        part = since / long
        heel = loaded * (1.0 if since < 0.5 * long else max(0.25, 1.0 - 2 * (part - 0.5)))
        toe = 0.0 if part < 0.25 else 1.0 if part > 0.75 else (part - 0.25) * 2
        feet.append((heel * lifted, lifted * toe, 0.0))
    return feet
