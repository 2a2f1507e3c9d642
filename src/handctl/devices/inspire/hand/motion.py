"""What moves an RH56 hand: stroke and angle commands, and their end (rh56 §6, §9).

A hand closes within a second with up to 30 N. Before the question is asked, the hand is read: it tells what is going to
move, from where, how fast, and what forbids it. Stopping is speed 0, which some hands take with a run-on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from handctl.devices.inspire.hand.map import BLOCKED, BYTE_MAP, HOT, UNMEASURED
from handctl.devices.inspire.registers import may_still_move
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Left
from handctl.model.guide import CTRL_C, Guide
from handctl.model.leaving import leaving
from handctl.model.param import Element, Number, Reading, elements_of
from handctl.model.result import Column, Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

LEFT = -1
"""Leaves a finger as it is."""
MOVED = {"stroke_set": "stroke_actual", "angle_set": "angle_actual"}
"""What is commanded -> what shows where it is."""
NEAR = {"stroke_set": 40, "angle_set": 20}
"""Counts within which a finger has arrived; a finger may stop short without a fault (rh56 §6)."""
REFRESH_SECONDS = 0.031
"""The hand renews its state so often (rh56 §5): asking faster repeats values."""
DEAD_SECONDS = 0.1
"""A movement begins 55 to 80 ms after its command (rh56 §5)."""
MOVING = frozenset({0, 1})
STILL_SAMPLES = 3


class Before(NamedTuple):
    """A hand before a movement: readings by full name."""

    values: dict[str, Number | None]

    def of(self, name: str, fingers: Sequence[str]) -> str:
        """The values of a group for `fingers`, in words."""
        return " ".join(str(self.values.get(f"{name}.{finger}", "?")) for finger in fingers)


def fit_to_move(hand: Hand) -> Before:
    """Read what the question must show, and refuse what forbids a movement. Raises CheckFailed (rh56 §9)."""
    hand.identify()
    names = (*MOVED.values(), "force_limit", "speed_set", "error", "status", "temperature")
    readings = hand.read([element for name in names for element in elements_of(hand.map[name])])
    for reading in readings:
        if reading.error is not None:
            raise reading.error
    against = [text for reading in readings if (text := _against(reading))]
    if against:
        raise CheckFailed(
            f"{hand.bus.where}: the hand is not moved: {'; '.join(against)}",
            hint="run `handctl hand clear-errors`, free the finger or let it cool. Nothing was written.",
            code="not-fit",
        )
    return Before({reading.element.full_name: reading.value for reading in readings})


def _against(reading: Reading) -> str:
    """What of a reading forbids a movement, in words."""
    name, value, part = reading.element.param.name, int(reading.value or 0), reading.element.part
    if name == "error" and value:
        return f"{part} reports {reading.element.param.label(value)}"
    if name == "status" and value in BLOCKED:
        return f"{part} has status {value}, {reading.element.param.label(value)}"
    if name == "temperature" and value != UNMEASURED and value >= HOT:
        return f"{part} has {value} °C"
    return ""


def question(hand: Hand, changes: Sequence[tuple[Element, Number]], before: Before) -> str:
    """What is asked before a movement: fingers, from, to, speed and force limit that are set (rh56 §9)."""
    held = before.values | {element.full_name: value for element, value in changes}
    parts, others, speeds = [], [], []
    for element, value in changes:
        name, finger = element.param.name, element.part or ""
        if name not in MOVED:
            others.append(f"{element.full_name} = {value}")
            continue
        here = before.values.get(f"{MOVED[name]}.{finger}")
        speed, limit = held.get(f"speed_set.{finger}"), held.get(f"force_limit.{finger}")
        parts.append(f"{finger} {here} to {value} (speed {speed}, force limit {limit} g)")
        speeds.append(speed)
    count = len(hand.map["angle_set"].elements)
    side = f"the {hand.side} hand" if hand.side else "the hand"
    text = (
        f"This moves {len(parts)} of {count} fingers of {side}: {', '.join(parts)}" if parts else f"This moves {side}"
    )
    still = "" if any(speeds) or not parts else (
        ". The speed is 0, so nothing will move until `handctl hand speed` sets one"
    )  # fmt: skip
    more = f"{'. Also ' if parts else ': '}{', '.join(others)}" if others else ""
    return f"{text}{more}{still}"


def move(hand: Hand, group: str, changes: Sequence[tuple[Element, Number]], guide: Guide, *, wait: float) -> Table:
    """Write set-points once, then watch until the fingers stand still or `wait` seconds have passed.

    Ctrl-C sets the speed to 0. Returns targets against reached values, without a verdict, since an object may hold a
    finger; but a finger that reports that it is blocked is a failure.
    """
    hand.identify()
    with hand.driven(guide), may_still_move("the fingers"):
        hand.write(changes)
        reached = _settle(hand, group, {e.part or "": v for e, v in changes}, guide, wait)
    targets = {element.part: value for element, value in changes if value != LEFT}
    rows = [{**hand.row(reading), "target": targets.get(reading.element.part)} for reading in reached]
    rows = [row for row in rows if row["name"] != MOVED[group] or row["target"] is not None]
    table = Table(rows=rows, columns=(*hand.columns[:4], Column("target", "Target", right=True), *hand.columns[4:]))
    if blocked := [
        text for reading in reached if reading.element.param.name == "status" and (text := _against(reading))
    ]:
        table.failure = CheckFailed(
            f"{hand.bus.where}: the movement ended: {'; '.join(blocked)}",
            hint="free the finger, then run `handctl hand clear-errors`",
            code="blocked",
        )
    return table


def _settle(hand: Hand, group: str, targets: dict[str, Number], guide: Guide, wait: float) -> list[Reading]:
    """Read until every commanded finger has ended its movement, or `wait` is over."""
    bus = hand.bus
    elements = [e for name in (MOVED[group], "status") for e in elements_of(hand.map[name]) if _wanted(e, targets)]
    started, end = bus.link.now(), bus.link.deadline(wait)
    last: list[Number | None] = []
    equal = 0
    while True:
        bus.pause(REFRESH_SECONDS)
        readings = hand.read(elements)
        here = [reading.value for reading in readings if reading.element.param.name != "status"]
        codes = [reading.value for reading in readings if reading.element.param.name == "status"]
        equal = equal + 1 if here == last else 0
        last = here
        now = bus.link.now()
        guide.progress(f"{now - started:4.1f} s  {' '.join(map(str, here))}", CTRL_C)
        begun = now - started > DEAD_SECONDS
        if begun and equal >= STILL_SAMPLES and not any(code in MOVING for code in codes):
            break
        if end.expired:
            hand.journal.warn(
                "moving", f"the fingers still move after {wait:g} s", hint="`handctl hand status` shows where they are"
            )
            guide.done()
            return readings
        bus.out_of_time("the arrival. The fingers may still move")
    guide.done()
    wanted = [targets[reading.element.part or ""] for reading in readings if reading.element.param.name != "status"]
    off = [
        reading.element.part
        for reading, target in zip(readings, wanted, strict=False)
        if reading.value is None or abs(reading.value - target) > NEAR[group]
    ]
    if off:
        hand.journal.warn(
            "short",
            f"short of the target: {', '.join(str(part) for part in off)}",
            hint="look at status, error and current: an object, the force limit or speed 0 holds a finger",
        )
    return readings


NUDGE, NUDGE_SPEED, NUDGE_SECONDS = 80, 100, 3.0
"""Counts of the index finger's angle, slowly: enough to be seen, not enough to grip."""
NUDGED = "index"


class Nudge(NamedTuple):
    """A small movement of the index finger, there and back: the changes in their order, and the question before them."""

    changes: tuple[tuple[Element, Number], ...]
    question: str


def plan_nudge(hand: Hand) -> Nudge:
    """Read the hand, and what a small movement would write. Raises CheckFailed, DeviceRefused where it is not fit for one."""
    before = fit_to_move(hand)
    if hand.map is not BYTE_MAP:
        raise DeviceRefused(
            f"{hand.bus.where}: the angles of {hand.found().words} have no sure limits",
            hint="say which hand it is with --first left or --first right. Nothing was written.",
            code="not-on-model",
        )
    speed, angle = (hand.map.find(f"{name}.{NUDGED}")[1][0] for name in ("speed_set", "angle_set"))
    was, here = (before.values[f"{name}.{NUDGED}"] for name in ("speed_set", "angle_actual"))
    assert was is not None and here is not None
    back = min(1000, max(0, here))
    away = back + NUDGE if back + NUDGE <= 1000 else back - NUDGE
    return Nudge(
        ((speed, NUDGE_SPEED), (angle, away), (angle, back), (speed, was)),
        f"the {NUDGED} finger of {hand.bus.where} from {back} to {away} and back at speed {NUDGE_SPEED}",
    )


def nudge(hand: Hand, plan: Nudge, guide: Guide) -> None:
    """Carry it out: so a person sees which hand this is. Where it ends early, the finger keeps its low speed, or speed 0.

    A speed that was put back behind a stop would let the finger go on.
    """
    (low, away, back, was) = plan.changes
    before = f"speed_set.{NUDGED} is not {was[1]} any more, as it was before"
    left = Left(before, f"set it with `handctl hand set speed_set.{NUDGED}={was[1]}`", joint=". ")
    with leaving(left, since=hand.journal.counters, by=HandctlError):
        hand.write([low])
        for change in (away, back):
            move(hand, "angle_set", [change], guide, wait=NUDGE_SECONDS)
    hand.write([was])


def _wanted(element: Element, targets: dict[str, Number]) -> bool:
    return targets.get(element.part or "", LEFT) != LEFT
