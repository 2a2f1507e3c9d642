"""What moves an RH56 hand: stroke and angle commands, and their end (rh56 §6, §9).

A hand closes within a second with up to 30 N. Before the question is asked, the hand is read: it tells what is going to
move, from where, how fast, and what forbids it. Stopping is speed 0, which some hands take with a run-on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from handctl.devices.inspire.hand.device import SETPOINT_PAIRS, STROKE, Hand
from handctl.devices.inspire.hand.register_map import (
    BYTE_MAP,
    NO_COMMAND,
    NO_MOVE_STATUS,
    RESTARTED,
    too_hot,
)
from handctl.devices.inspire.register_device import BEGINS, Movement
from handctl.devices.inspire.register_map import ALONE, DRAWN, NOISE
from handctl.errors import Aftermath, CheckFailed, DeviceRefused, HandctlError, Hint, joined
from handctl.model import device
from handctl.model.movement import REACHED, AxisReading, Goal, Stillness
from handctl.model.param import Changes, Element, Number, Reading, ValueChange
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from handctl.model.stop_on_interrupt import on_early_end

MOVED = {course.target: course.actual for course in SETPOINT_PAIRS}
"""What is commanded -> what shows where it is."""
NEAR = {course.target: course.near for course in SETPOINT_PAIRS}
STILL = Stillness(samples=4, seconds=1.0, refresh=0.031, dead=0.1, short=BEGINS, pushing=DRAWN)
"""The hand renews its state every 31 ms, and a movement begins 55 to 80 ms after its command (rh56 §5). Where a finger
stands and its status says that it moves, the hand gets a second to report what holds it."""
SLOWEST_CHANGE = (NOISE + 3) / 1.25
"""Seconds at speed 1 in which the reading of a moving finger must have changed by more than that of a resting one (rh56 §3.1: a
stroke in 0.8 s at speed 1000)."""
MOVING = frozenset({0, 1})
"""Status codes of a finger that moves, or whose command came while its speed was 0."""
FORCE_REACHED = 3


Before = dict[str, "Number | None"]
"""A hand before a movement: readings by full name."""


def fit_to_move(hand: Hand) -> Before:
    """Read what the question must show, and refuse what forbids a movement. Raises CheckFailed (rh56 §9)."""
    hand.identify()
    names = (*MOVED.values(), "force_limit", "speed_set", "error", "status", "temperature")
    readings = hand.read([element for name in names for element in hand.map[name].each])
    against = [text for reading in readings if (text := _against(reading))]
    if against:
        raise CheckFailed(
            f"{hand.bus.where}: handctl does not move this hand: {'; '.join(against)}",
            hint=Hint("run {}, free the finger or let it cool down. Nothing was written.", "hand clear-errors"),
            code="not-fit",
        )
    return {reading.element.full_name: reading.value for reading in readings}


def _against(reading: Reading) -> str:
    """What of a reading forbids a movement, in words."""
    name, value, part = reading.element.param.name, int(reading.required), reading.element.part
    if name == "error" and value:
        return f"{part} reports {reading.element.param.label(value)}"
    if name == "status" and value in NO_MOVE_STATUS:
        return f"{part} has status {value}, {reading.element.param.label(value)}"
    if name == "temperature" and too_hot(value):
        return f"{part} has {value} °C"
    return ""


def question(hand: Hand, changes: Sequence[tuple[Element, Number]], before: Before) -> tuple[str, Changes]:
    """What is asked before a movement, with fingers, from, to, speed and force limit that are set (rh56 §9).

    Further fingers that the same write lets go are in the table as well.
    """
    held = before | {element.full_name: value for element, value in changes}
    rows, others, speeds = [], [], []
    for element, value in changes:
        name, finger = element.param.name, element.part or ""
        if name not in MOVED:
            others.append(f"{element.full_name} = {value}")
            continue
        here = before.get(f"{MOVED[name]}.{finger}")
        speed, limit = held.get(f"speed_set.{finger}"), held.get(f"force_limit.{finger}")
        rows.append(ValueChange(finger, here, value, _held_to(speed, limit)))
        speeds.append(speed)
    count = len(hand.map["angle_set"].elements)
    side = f"the {hand.side} hand" if hand.side else "the hand"
    text = f"This moves {len(rows)} of {count} fingers of {side}" if rows else f"This moves {side}"
    still = "" if any(speeds) or not rows else (
        ". The speed is 0, so nothing moves until you set one with `handctl hand speed`"
    )  # fmt: skip
    more = f"{'. Also ' if rows else ': '}{', '.join(others)}" if others else ""
    waiting = _released(hand, changes)
    rows += [
        one.row(*_held_to(held.get(f"speed_set.{one.part}"), held.get(f"force_limit.{one.part}"))) for one in waiting
    ]
    return joined(f"{text}{more}{still}", device.question(waiting) if waiting else ""), Changes("Finger", rows=rows)


def _held_to(speed: Number | None, limit: Number | None) -> tuple[tuple[str, str], ...]:
    """How fast a finger is going to move, and what ends it before."""
    return (("Speed", f"{speed}"), ("Force limit", f"{limit} g"))


def releasing(hand: Hand, changes: Sequence[tuple[Element, Number]], question: str) -> tuple[str, Changes | None]:
    """The `question` of a write that commands no finger, with those that it lets go; None = none."""
    waiting = _released(hand, changes)
    return (joined(question, device.question(waiting)), device.pending_table(waiting)) if waiting else (question, None)


def _released(hand: Hand, changes: Sequence[tuple[Element, Number]]) -> list[device.PendingMove]:
    """Further fingers that the same write lets go."""
    commanded = {element.part for element, _ in changes if element.param.name in MOVED}
    return [one for one in hand.lets_go(changes) if one.part not in commanded]


def tell_no_speed(hand: Hand, changes: Sequence[tuple[Element, Number]], before: Before) -> None:
    """Warn about fingers that do not move because their speed is 0: the target waits for the next speed."""
    held = before | {element.full_name: value for element, value in changes}
    still = [e.part or "" for e, _ in changes if e.param.name in MOVED and held.get(f"speed_set.{e.part}") == 0]
    if still:
        hand.journal.warn(
            "no-speed",
            f"speed 0: {', '.join(still)} did not move, and will go to the target as soon as you set a speed",
            hint="set one with `handctl hand speed`, which asks first",
        )


def move(
    hand: Hand,
    group: str,
    changes: Sequence[tuple[Element, Number]],
    prompts: Prompts,
    *,
    wait: float,
    expect: str = REACHED,
    before: Before | None = None,
) -> Table:
    """Write set points once, then watch until the fingers have stopped or `wait` seconds have passed.

    `before` is what was read for the question, with the speeds: at 0 none will move. Ctrl-C sets the speed to 0. Rows have the target and what became of it; what was not as expected is the table's failure.
    """
    hand.identify()
    targets = {element.part or "": value for element, value in changes if value != ALONE}
    gripping = {part for part in targets if (before or {}).get(f"status.{part}") == FORCE_REACHED}
    obeyed: set[str] = set()

    def each(name: str) -> list[Element]:
        return [element for element in hand.map[name].each if element.part in targets]

    def seen(readings: Sequence[Reading]) -> dict[str, AxisReading]:
        at = {reading.element.full_name: reading for reading in readings}
        # the code of the movement before says nothing of this one
        gripping.difference_update([part for part in gripping if at[f"status.{part}"].value != FORCE_REACHED])
        obeyed.update(part for part in targets if at[f"status.{part}"].value not in (None, NO_COMMAND))
        found = {}
        for part in targets:
            place, status = at[f"{MOVED[group]}.{part}"], at[f"status.{part}"]
            restarted = status.value == NO_COMMAND and part in obeyed
            found[part] = _seen(place, status, RESTARTED if restarted else "", fresh=part not in gripping)
        return found

    this = Movement(
        [_goal(group, part, target, before) for part, target in targets.items()],
        STILL,
        [*each(MOVED[group]), *each("error"), *each("status")],
        seen,
        each("error"),
        each("current"),
        [element for element, value in changes if value != ALONE],
        pause=STILL.refresh,
    )
    return hand.moved(this, lambda: hand.write(changes), prompts, wait=wait, expect=expect)[0]


def _goal(group: str, part: str, target: Number, before: Before | None) -> Goal:
    speed = before.get(f"speed_set.{part}") if before is not None else None
    patience = SLOWEST_CHANGE / speed if speed and speed > 0 else 0.0
    return Goal(part, target, NEAR[group], speed, patience, NOISE * (STROKE if group == "stroke_set" else 1))


def _seen(place: Reading, status: Reading, fault: str, *, fresh: bool) -> AxisReading:
    """A finger by its place, its status code and what else is a `fault` since the command; `fresh`: so is the code."""
    code = None if status.value is None else int(status.value)
    blocked = status.element.param.label(code) or "" if code in NO_MOVE_STATUS else fault
    contact = status.element.param.label(code) or "" if code == FORCE_REACHED and fresh else ""
    return AxisReading(place.value, None if code is None else code in MOVING, blocked, contact)


NUDGE, NUDGE_SPEED, NUDGE_SECONDS = 80, 100, 3.0
"""Counts of the index finger's angle, slowly: enough to be seen, not enough to grip."""
NUDGED = "index"


class Nudge(NamedTuple):
    """A small movement of the index finger, there and back: the changes in their order, and the question before them."""

    changes: tuple[tuple[Element, Number], ...]
    question: str


def plan_nudge(hand: Hand) -> Nudge:
    """Read the hand and plan a small movement. Raises CheckFailed or DeviceRefused if the hand is not fit for it."""
    before = fit_to_move(hand)
    if hand.map is not BYTE_MAP:
        raise DeviceRefused(
            f"{hand.bus.where}: the angle limits of {hand.found().words} are uncertain",
            hint="specify the side with --first left or --first right. Nothing was written.",
            code="not-on-model",
        )
    speed, angle = (hand.map.find(f"{name}.{NUDGED}")[1][0] for name in ("speed_set", "angle_set"))
    was, here = (before[f"{name}.{NUDGED}"] for name in ("speed_set", "angle_actual"))
    assert was is not None and here is not None
    back = min(1000, max(0, here))
    away = back + NUDGE if back + NUDGE <= 1000 else back - NUDGE
    return Nudge(
        ((speed, NUDGE_SPEED), (angle, away), (angle, back), (speed, was)),
        f"the {NUDGED} finger of {hand.bus.where} from {back} to {away} and back at speed {NUDGE_SPEED}",
    )


def nudge(hand: Hand, plan: Nudge, prompts: Prompts) -> None:
    """Carry it out: so a person sees which hand this is. Where it ends early, the finger keeps its low speed, or speed 0.

    A speed that was put back behind a stop would let the finger go on.
    """
    (low, away, back, was) = plan.changes
    before = f"speed_set.{NUDGED} is not {was[1]} any more, as it was before"
    left = Aftermath(before, Hint("set it with {}", f"hand set speed_set.{NUDGED}={was[1]}"), joint=". ")
    with on_early_end(left, since=hand.journal.counters, by=HandctlError):
        hand.write([low])
        for change in (away, back):
            move(hand, "angle_set", [change], prompts, wait=NUDGE_SECONDS)
    hand.write([was])
