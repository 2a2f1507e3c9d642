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
from handctl.devices.aidin.map import Target
from handctl.devices.aidin.stop import in_force, object_of, step_of, stopped_if_cut_short
from handctl.devices.aidin.targets import Goal, missed, ramp
from handctl.errors import CheckFailed, Left, NoAnswer
from handctl.model.guide import CTRL_C, Guide
from handctl.model.param import Number, Step, elements_of
from handctl.model.result import Column, Table

ARRIVE = 3.0
"""Seconds after the ramp's end until a target counts as not reached."""
GOES_ON = "no stop was sent, the hand is expected to go on to the last target it got. `handctl aidin stop` frees it"
HOLDS = "reached. Nothing more is sent, the hand is expected to hold"
FAR = 0.1
"""Share of a range: a start that is farther outside is no start of a ramp."""
SETTLED = 0.2
"""Seconds near the target until it counts as reached: a hand that passes by, or still comes nearer, is not there."""


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
    meaning = f"mode {int(goal.target.mode)}, the last object of a ramp from where the hand is"
    return step_of(meaning, target_object(goal, values), end)


def move(hand: AidinHand, goal: Goal, guide: Guide, *, assume_homed: bool) -> Table:
    """Go there on a ramp from where the hand is, and see it arrive; rows have `target` and `reached`.

    Raises CheckFailed naming what did not arrive within 3 s of the ramp's end; then sending has ended, too.
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
            arrived = _settle(hand, goal, values, guide)
        finally:
            guide.done()
        if not arrived:
            _tell_deadline(hand, goal, values)
    with in_force(HOLDS if arrived else GOES_ON):
        table = _result(hand, goal, values)
    if arrived and table.failure is None:
        ledger.confirm("arrived by its feedback", since=begun)
        hand.journal.info("reached", HOLDS)
    return table


def _check_start(hand: AidinHand, target: Target, here: list[Number], *, assume: bool) -> None:
    """Raise CheckFailed where a ramp cannot begin at what the hand tells: its first step would be a jump to a limit."""
    param, name = target.feedback, hand.link.name
    if param.angles and any(abs(value) > degrees(LARGEST_RADIAN) for value in here):
        raise CheckFailed(
            f"{name}: {param.key} {NO_ANGLE} A ramp cannot begin there",
            hint="look at `handctl aidin status`, and at its bytes with --trace FILE. Nothing was sent.",
            code="start-out-of-range",
        )
    far = [index for index, value in enumerate(here) if outside(param, index, value, FAR)]
    if far and not assume:
        raise CheckFailed(
            f"{name}: a ramp cannot begin where the hand is, far out of range: {named(param, far, here)}",
            hint="run `handctl aidin home` first. --assume-homed begins at the limit without it. Nothing was sent.",
            code="start-out-of-range",
        )


def _tell_deadline(hand: AidinHand, goal: Goal, values: list[float]) -> None:
    """Raise NoAnswer when --deadline is over, with what was not reached by then as far as it is known."""
    try:
        hand.talk.check_bound()
    except NoAnswer as exc:
        feedback, param = hand.talk.feedback, goal.target.feedback
        if param.key in feedback.values and param.key not in feedback.errors:
            now = values_of(param, feedback.values[param.key])
            exc.text += f"; not reached: {_shortfall(goal, values, now)}"
        raise


def _follow(hand: AidinHand, goal: Goal, way: list[tuple[float, ...]], guide: Guide) -> None:
    for number, values in enumerate(way, 1):
        hand.talk.tick(target_object(goal, values), by=goal.target.feedback)
        guide.progress(f"Moving {number * PERIOD:.1f} of {len(way) * PERIOD:.1f} s.", CTRL_C)


def _settle(hand: AidinHand, goal: Goal, values: list[float], guide: Guide) -> bool:
    """Repeat the target until everything has been near it for a while; False when that takes too long."""
    talk, data = hand.talk, target_object(goal, values)
    end = talk.deadline(ARRIVE)
    since: float | None = None
    while not end.expired:
        talk.tick(data, by=goal.target.feedback)
        guide.progress("Waiting for the arrival.", CTRL_C)
        if not _near(hand, goal, values):
            since = None
        elif since is None:
            since = hand.link.now()
        elif hand.link.now() - since >= SETTLED:
            return True
    return False


def _near(hand: AidinHand, goal: Goal, values: list[float]) -> bool:
    feedback, key = hand.talk.feedback, goal.target.feedback.key
    if key in feedback.errors or key not in feedback.values:
        return False
    return not missed(goal, values, values_of(goal.target.feedback, feedback.values[key]))


def _result(hand: AidinHand, goal: Goal, values: list[float]) -> Table:
    param = goal.target.feedback
    table = hand.table(hand.read(elements_of(param)))
    if table.failure is None:
        mark(hand, goal, values, table)
    if table.failure is not None:
        table.failure.leaves(Left(hint=GOES_ON))
    return table


def mark(hand: AidinHand, goal: Goal, values: list[float], table: Table) -> None:
    """Set each row beside its target; a target that was missed is a CheckFailed."""
    now = [row["value"] for row in table.rows]
    off = missed(goal, values, now)
    for index, row in enumerate(table.rows):
        row["target"] = round(values[index], 4)
        row["reached"] = index not in off
    table.columns = (*hand.columns[:4], Column("target", "Target", right=True), hand.columns[4])
    if off:
        table.failure = CheckFailed(
            f"{hand.link.name}: not reached: {_shortfall(goal, values, now)}",
            hint="unreachable together with the others, blocked, the maximum torque is too low, or the hand is not homed",
            code="not-reached",
        )


def _shortfall(goal: Goal, values: list[float], now: Sequence[Number]) -> str:
    """``index.q3 160.3 of 130.0 deg``, four elements at most."""
    param, off = goal.target.feedback, missed(goal, values, now)
    named = ", ".join(f"{param.elements[i]} {now[i]:.{param.places}f} of {values[i]:.{param.places}f}" for i in off[:4])
    more = f" and {len(off) - 4} more" if len(off) > 4 else ""
    return f"{named}{more}{f' {param.unit}' if param.unit else ''}"
