"""Targets of the AIDIN-hand: encoders, joints, fingertips, on a ramp and watched until they arrive.

An object is sent every 20 ms; there is no acknowledge, so that feedback alone proves arrival (aidin, Modes).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from handctl.devices.aidin.device import LARGEST_RADIAN, NO_ANGLE, AidinHand, outside
from handctl.devices.aidin.exchange import PERIOD
from handctl.devices.aidin.feedback import Feedback, values_of
from handctl.devices.aidin.homing import check_homed, named
from handctl.devices.aidin.map import AIDIN, Target
from handctl.devices.aidin.stop import in_force, object_of, step_of, stopped_if_cut_short
from handctl.devices.aidin.targets import Goal, axes_of, ramp
from handctl.errors import CheckFailed, Left, NoAnswer
from handctl.model.guide import CTRL_C, Guide
from handctl.model.moving import (
    ARRIVAL,
    REACHED,
    TARGET,
    UNREAD,
    Arrival,
    Seen,
    Stillness,
    Watch,
    judged,
    listed,
)
from handctl.model.param import Number, Step, elements_of
from handctl.model.result import Row, Table

ARRIVE = 3.0
"""Seconds after the ramp's end until a target counts as not reached."""
STILL = Stillness(samples=1, seconds=0.2, grace=ARRIVE, passes=True)
"""A target is reached when the element was near it for so long: one that passes by, or still comes nearer, is not there."""
PUSHING = 200
"""Per mille of the rated current: a motor that stands and draws more pushes something. Ours, the manual has no figure."""
GOES_ON = "no stop was sent, so the hand probably continues to its last target. `handctl aidin stop` frees it"
HOLDS = "reached. Nothing more is sent, and the hand probably holds its position"
CURRENT = AIDIN["current_state"]
FAR = 0.1
"""Share of a range: a start that is farther outside is no start of a ramp."""


def target_object(goal: Goal, values: tuple[float, ...] | list[float]) -> bytes:
    """The object that sends a whole vector to its target."""
    return object_of(goal.target.mode, **{goal.target.command.key: goal.wire(values)})


def measured(hand: AidinHand, target: Target) -> list[Number]:
    """Where the hand is, in the target's unit. Raises ProtocolError when its key is missing or wrong."""
    (wire,) = hand.talk.need(target.feedback)
    return values_of(target.feedback, wire)


def plan(hand: AidinHand | None, goal: Goal, end: bytes) -> list[Step]:
    """The object that ends a movement, for --dry-run, with its terminator; `hand` is only listened to, where elements are kept."""
    here = None
    if hand is not None:
        hand.talk.connect(silent=True)
        here = measured(hand, goal.target)
    return [last_step(goal, goal.complete(here), end)]


def last_step(goal: Goal, values: list[float], end: bytes) -> Step:
    """The object that ends a movement, as a step."""
    meaning = f"mode {int(goal.target.mode)}, the last object of a ramp from the hand's current position"
    return step_of(meaning, target_object(goal, values), end)


def move(hand: AidinHand, goal: Goal, guide: Guide, *, assume_homed: bool, expect: str = REACHED) -> Table:
    """Go there on a ramp from where the hand is, and see it arrive; rows have `target`, `reached` and `arrival`.

    An element that is not near within 3 s of the ramp's end has not arrived; then sending has ended, too. What was not as
    expected is the table's failure.
    """
    talk = hand.talk
    check_homed(hand, assume=assume_homed)
    here = measured(hand, goal.target)
    values = goal.complete(here)
    _check_start(hand, goal.target, here, assume=assume_homed)
    ledger = hand.journal.ledger
    begun = ledger.mark
    ledger.plan([last_step(goal, values, talk.way.end)])
    with stopped_if_cut_short(hand, guide), in_force(GOES_ON):
        try:
            _follow(hand, goal, ramp(goal, here, values, PERIOD), guide)
            talk.feedback = Feedback()
            seen = Watch(axes_of(goal, values), STILL, hand.link.now())
            _settle(hand, goal, values, seen, guide)
        finally:
            guide.done()
        arrived = seen.reached
        if not arrived:
            _tell_deadline(hand, seen)
    with in_force(HOLDS if arrived else GOES_ON):
        table = hand.table(hand.read(elements_of(goal.target.feedback)))
    if table.failure is None:
        seen.note(hand.link.now(), _places(table))
        mark(hand, table, values, seen.arrivals(_pushing(hand, seen)), expect)
    if table.failure is not None:
        table.failure.leaves(Left(hint=GOES_ON))
    elif arrived:
        ledger.confirm("arrived, according to the feedback", since=begun)
        hand.journal.info("reached", HOLDS)
    return table


def _check_start(hand: AidinHand, target: Target, here: list[Number], *, assume: bool) -> None:
    """Raise CheckFailed where a ramp cannot begin at what the hand tells: its first step would be a jump to a limit."""
    param, name = target.feedback, hand.link.name
    if param.angles and any(abs(value) > degrees(LARGEST_RADIAN) for value in here):
        raise CheckFailed(
            f"{name}: {param.key} {NO_ANGLE}. A ramp cannot start there",
            hint="check `handctl aidin status`, and its bytes with --trace FILE. Nothing was sent.",
            code="start-out-of-range",
        )
    far = [index for index, value in enumerate(here) if outside(param, index, value, FAR)]
    if far and not assume:
        raise CheckFailed(
            f"{name}: a ramp cannot start at the current position, which is far out of range: {named(param, far, here)}",
            hint="run `handctl aidin home` first. --assume-homed starts at the limit without it. Nothing was sent.",
            code="start-out-of-range",
        )


def _tell_deadline(hand: AidinHand, seen: Watch) -> None:
    """Raise NoAnswer when --deadline is over, with what was not reached by then as far as it is known."""
    try:
        hand.talk.check_bound()
    except NoAnswer as exc:
        if off := [one for one in seen.arrivals() if one.verdict not in (REACHED, UNREAD)]:
            exc.text += f"; not reached: {listed(off)}"
        raise


def _follow(hand: AidinHand, goal: Goal, way: list[tuple[float, ...]], guide: Guide) -> None:
    for number, values in enumerate(way, 1):
        hand.talk.tick(target_object(goal, values), by=goal.target.feedback)
        guide.progress(f"Moving {number * PERIOD:.1f} of {len(way) * PERIOD:.1f} s.", CTRL_C)


def _settle(hand: AidinHand, goal: Goal, values: list[float], seen: Watch, guide: Guide) -> None:
    """Repeat the target until everything has been near it for a while, or that takes too long."""
    talk, data, param = hand.talk, target_object(goal, values), goal.target.feedback
    end = talk.deadline(ARRIVE)
    ended = False
    while not ended and not end.expired:
        talk.tick(data, by=param)
        guide.progress("Waiting for the hand to arrive.", CTRL_C)
        feedback, told = talk.feedback, {}
        if param.key in feedback.values and param.key not in feedback.errors:
            places = values_of(param, feedback.values[param.key])
            told = {name: Seen(place) for name, place in zip(param.elements, places, strict=True)}
        ended = seen.note(hand.link.now(), told)


def _places(table: Table) -> dict[str, Seen]:
    return {element_of(row): Seen(row["value"]) for row in table.rows}


def element_of(row: Row) -> str:
    """``index.q3``."""
    return f"{row['finger']}.{row['element']}"


def _pushing(hand: AidinHand, seen: Watch) -> dict[str, Seen]:
    """Of elements that are off their targets: whether a motor of the same finger pushes, by the last currents that were told."""
    told = hand.talk.feedback
    if CURRENT.key in told.errors or CURRENT.key not in told.values:
        return {}
    currents = dict(zip(CURRENT.elements, map(int, told.values[CURRENT.key]), strict=True))
    found = {}
    for name in seen.short:
        finger = name.partition(".")[0]
        most = max((value for motor, value in currents.items() if motor.startswith(f"{finger}.")), key=abs)
        found[name] = Seen(None, contact=f"a motor draws {most} per mille" if abs(most) >= PUSHING else "")
    return found


def mark(
    hand: AidinHand, table: Table, values: list[float], arrivals: Sequence[Arrival], expect: str = REACHED
) -> None:
    """Set each row beside its target, with what became of it; what was not as expected is the table's failure."""
    at = {one.goal.name: one for one in arrivals}
    for value, row in zip(values, table.rows, strict=True):
        one = at.get(element_of(row))  # q4 goes with q3
        row["target"] = round(value, 4)
        row["reached"] = one is None or one.verdict == REACHED
        row["arrival"] = None if one is None else one.verdict
    table.columns = (*hand.columns[:4], TARGET, hand.columns[4], ARRIVAL)
    table.failure = judged(
        hand.link.name,
        arrivals,
        expect,
        hint="unreachable together with the others or blocked, or the maximum torque is too low, or the hand is not homed",
    )


def followed(hand: AidinHand, goal: Goal, values: list[float], table: Table) -> None:
    """The same for targets that are no places, by one look at them."""
    seen = Watch(axes_of(goal, values), Stillness(samples=1, seconds=0.0), hand.link.now())
    seen.note(hand.link.now(), _places(table))
    mark(hand, table, values, seen.arrivals())
