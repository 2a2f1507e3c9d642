"""`aidin check`: a look at the hand at rest, then each motor a little way towards closed and back, alone (aidin, Ranges).

The way is a small share of the documented stroke from the open position. A motor that pushes without moving is sent back at
once, and its finger is left alone. A hand that goes where no way leads is stopped. What is judged, and by which limits, is in `check_findings`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import count
from math import degrees, inf

from handctl.devices.aidin import motion
from handctl.devices.aidin.check_findings import (
    AMOUNT,
    BEYOND,
    CURRENT,
    JOINTS,
    MOTORS,
    SENSORS,
    TURN,
    Rest,
    Trip,
    findings,
    pushes,
)
from handctl.devices.aidin.device import LARGEST_RADIAN, AidinHand, step_of, stop_after, stopped_if_cut_short
from handctl.devices.aidin.exchange_settings import ExchangeMode
from handctl.devices.aidin.feedback import Wire, values_of
from handctl.devices.aidin.map import ENCODERS
from handctl.devices.aidin.motion import ramp
from handctl.devices.aidin.procedures import AT_STOP, STILL, check_homed, moving, named, stroke
from handctl.devices.aidin.stopper import PERIOD
from handctl.devices.aidin.targets import Goal
from handctl.errors import CheckFailed, HandctlError
from handctl.model.checks import table_of
from handctl.model.param import Number, Step
from handctl.model.prompts import CTRL_C, Prompts
from handctl.model.result import Table

REST = 2.0
"""Seconds of looking at a hand that is not driven."""
HOLD = 0.2
"""Seconds at the present position before the first motor moves: its current without a movement is known then."""
ARRIVE = 0.5
"""Seconds after the end of a ramp in which a motor may still arrive."""
STANDS = 3
"""Looks in a row at which a motor that has arrived stands."""
ALMOST = STILL / 10
"""Share of a stroke that it may change meanwhile from one look to the next: it no longer comes nearer."""
LATE = 2
"""Looks after the end of a ramp: of a hand that speaks seldom, too, the end is seen."""
PUSHES = 2
"""Looks in a row at which a motor pushes without moving, or turns a joint while its encoder stands, until it is sent back."""
LEFT = "nothing more is sent, and the hand probably holds its position"
QUESTION = (
    f"Each motor will close its finger by {AMOUNT:.0%} of the stroke and open it again, one after the other. "
    "Keep hands and objects away from the fingers"
)


def goal_of(start: list[Number], index: int | None = None) -> Goal:
    """All motors where they are, but `index`, which is `AMOUNT` of its stroke further closed."""
    return Goal(ENCODERS, {} if index is None else {index: round(max(start[index], 0) + AMOUNT * stroke(index))})


def plan(device: Callable[[], AidinHand], end: bytes) -> list[Step]:
    """The far end of each motor's way and the way back, for --dry-run, from the position that the hand tells unasked."""
    hand = device()
    hand.conversation.connect(silent=True)
    start = motion.measured(hand, ENCODERS)
    steps = []
    for index, name in enumerate(MOTORS.elements):
        goal = goal_of(start, index)
        meaning = f"{name} closes by {AMOUNT:.0%} of its stroke, the last object of a ramp"
        steps.append(step_of(meaning, motion.target_object(goal, goal.complete(start)), end))
    return [*steps, _home(start, end)]


def _home(start: list[Number], end: bytes) -> Step:
    """All motors back where they were, which ends each way and the check."""
    goal = goal_of(start)
    return step_of(
        "all motors where they were, the last object of each way back",
        motion.target_object(goal, goal.complete(start)),
        end,
    )


def check(hand: AidinHand, prompts: Prompts) -> Table:
    """Look at the hand at rest, move each motor and bring it back, and judge what was seen; a finding is the table's failure.

    Raises CheckFailed before anything is sent where the hand is not homed, not open, moves or pushes; NoAnswer where it is silent.
    """
    check_homed(hand, assume=None)
    rest = _rest(hand, prompts)
    start = values_of(MOTORS, rest.encoders)
    ledger = hand.journal.ledger
    begun = ledger.mark
    ledger.plan([_home(start, hand.conversation.way.end)])
    with stopped_if_cut_short(hand, prompts):
        try:
            mover = _Mover(hand, prompts, start)
            trips = mover.all()
        except HandctlError as exc:  # nobody sees the fingers any more
            stop_after(hand, exc)
            raise
        finally:
            prompts.done()
    table = table_of(findings(rest, trips), causes=("motors",))
    if mover.back and any(trip.moved(trip.index) for trip in trips if trip is not None):
        ledger.confirm("motors moved there and back, according to the feedback", since=begun)
    hand.journal.info("left", LEFT, hint="`handctl aidin stop` frees the fingers")
    return table


# -- at rest ---------------------------------------------------------------------------------------------------------


def _rest(hand: AidinHand, prompts: Prompts) -> Rest:
    """Feedback of `REST` seconds in which nothing is sent. Raises CheckFailed where the hand is not open, moves or pushes."""
    rest, conversation = Rest(), hand.conversation
    end = conversation.deadline(REST)
    first: Wire | None = None
    while first is None or not end.expired:
        encoders, currents, sensors, _ = conversation.need(MOTORS, CURRENT, SENSORS, JOINTS)
        rest.note(hand.link.now(), encoders, currents, sensors)
        if first is None:
            first = encoders
            _check_open(hand, encoders)
        if restless := moving(first, encoders):
            raise CheckFailed(
                f"{hand.link.name}: {named(MOTORS, restless, encoders)} moves, although nothing was commanded",
                hint="wait until the hand stands, and keep hands off the fingers. If nobody moves it, its encoder loses counts: run `handctl aidin watch motor_pos`. Nothing was sent.",
                code="moving",
            )
        if pushing := [index for index, current in enumerate(currents) if pushes(current)]:
            raise CheckFailed(
                f"{hand.link.name}: {named(CURRENT, pushing, currents)}: the hand holds or pushes something",
                hint="take the object out, then run `handctl aidin initial`. Nothing was sent.",
                code="loaded",
            )
        prompts.progress("Reading the sensors at rest.", CTRL_C)
        if conversation.exchange is not ExchangeMode.STREAM:
            conversation.pause(PERIOD)
    conversation.check_bound()
    return rest


def _check_open(hand: AidinHand, encoders: Wire) -> None:
    if closed := [index for index, value in enumerate(encoders) if value > AT_STOP * stroke(index)]:
        raise CheckFailed(
            f"{hand.link.name}: the hand is not open: {named(MOTORS, closed, encoders)}",
            hint="this check needs an open, empty hand. Run `handctl aidin initial`, or `handctl aidin home` if the hand has not been homed since power-on. Nothing was sent.",
            code="not-open",
        )


def _reach(index: int) -> float:
    """Counts that a motor may be away from where it was: its way, and what it may pass it by."""
    return (AMOUNT + BEYOND) * stroke(index)


@cache
def _turn(index: int) -> float:
    """Degrees that a joint may be away from where it was; q4 has no range, so nothing is known of it."""
    limit = JOINTS.limit(index)
    return inf if limit is None else TURN * (limit[1] - limit[0])


# -- there and back --------------------------------------------------------------------------------------------------


class _Mover:
    """Moves one motor after the other from `start` and back, and keeps what the feedback says meanwhile."""

    def __init__(self, hand: AidinHand, prompts: Prompts, start: list[Number]) -> None:
        self._hand, self._prompts, self._start = hand, prompts, start
        self._said = ""
        self._joints: Wire = ()
        self._judged = 0  # encoders that `_check_course` has looked at

    @property
    def back(self) -> bool:
        """Whether the hand was last seen where it was."""
        home = goal_of(self._start).complete(self._start)
        places = zip(self._told()[0], home, strict=True)
        return all(abs(at - value) <= ENCODERS.near(index) for index, (at, value) in enumerate(places))

    def all(self) -> list[Trip | None]:
        """A trip of each motor; None where its finger was blocked before, so that it was left alone."""
        self._said = "Holding the position."
        self._joints = self._told()[2]
        self._send(goal_of(self._start).complete(self._start), HOLD)
        trips: list[Trip | None] = []
        blocked = ""
        for index in range(MOTORS.count):
            finger = MOTORS.finger_of(index)
            if finger == blocked:
                trips.append(None)
                continue
            trip = self._trip(index)
            blocked = finger if trip.turned_back else ""
            trips.append(trip)
        return trips

    def _trip(self, index: int) -> Trip:
        self._said = f"Moving {MOTORS.elements[index]} and back ({index + 1} of {MOTORS.count})."
        told = self._told()
        goal = goal_of(self._start, index)
        trip = Trip(index, round(goal.named[index] - max(self._start[index], 0)), *told)
        home, there = goal_of(self._start).complete(self._start), goal.complete(self._start)
        self._go(trip, ramp(goal, home, there, PERIOD), index)
        trip.arrived(*self._told())
        self._go(trip, ramp(goal, trip.reached(there), home, PERIOD), index, back=True)
        trip.returned(self._told()[0])
        return trip

    def _go(self, trip: Trip, way: list[tuple[float, ...]], index: int, *, back: bool = False) -> None:
        """Follow the ramp and wait until the motor stands at its end; the way out ends where the motor pushes and stands."""
        pushing = standing = late = 0
        seen, (encoders, _, _) = self._heard, self._told()
        begin = before = best = encoders[index]
        arrive = round(ARRIVE / PERIOD)
        for number in count():
            values = way[min(number, len(way) - 1)]
            self._send(list(values), PERIOD)
            if self._heard != seen:  # nothing is judged twice
                seen, (encoders, currents, joints) = self._heard, self._told()
                at, off = encoders[index], abs(encoders[index] - values[index])
                change, before = abs(at - before) / stroke(index), at
                best = min(best, at) if back else max(best, at)
                if min(abs(at - best), abs(best - begin)) > BEYOND * stroke(index):
                    raise self._astray(named(MOTORS, [index], encoders), "moved against its direction")
                trip.look(encoders)
                late += number >= len(way)
                near = off <= ENCODERS.near(index)
                standing = standing + 1 if near and change <= ALMOST else 0
                if not back:
                    trip.note(currents)
                    pushed = pushes(currents[index]) and not near and change <= STILL
                    pushing = pushing + 1 if pushed or trip.turns_unseen(encoders, joints) else 0
                    if pushing >= PUSHES:
                        trip.turned_back = True
                        return
            if late >= LATE and (standing >= STANDS or number >= len(way) + arrive):
                return

    def _send(self, values: list[float], seconds: float) -> None:
        """The target every period for so long."""
        goal = Goal(ENCODERS, dict(enumerate(values)))
        for _ in range(max(1, round(seconds / PERIOD))):
            self._hand.conversation.tick(motion.target_object(goal, values), by=MOTORS)
            for param in (CURRENT, JOINTS):
                self._hand.conversation.check_sight(param)
            self._check_course()
            self._prompts.progress(self._said, CTRL_C)

    def _check_course(self) -> None:
        """Raise CheckFailed where a motor or a joint is where no way of this check leads: the hand is driven by something else."""
        if self._heard == self._judged:
            return
        self._judged = self._heard
        encoders, _, joints = self._told()
        for index, (at, start) in enumerate(zip(encoders, self._start, strict=True)):
            if not start - _reach(index) <= at <= max(start, 0) + _reach(index):
                raise self._astray(named(MOTORS, [index], encoders), "is further away than this check moves it")
        if any(abs(joint) > LARGEST_RADIAN for joint in (*joints, *self._joints)):
            return  # no angles in radians, so nothing is known of them
        for index, (one, other) in enumerate(zip(joints, self._joints, strict=True)):
            if abs(degrees(one - other)) > _turn(index):
                angles = [degrees(joint) for joint in joints]
                raise self._astray(named(JOINTS, [index], angles), "turned further than this check moves it")

    def _astray(self, what: str, how: str) -> CheckFailed:
        return CheckFailed(
            f"{self._hand.link.name}: {what} {how}",
            hint="either its encoder lost counts, or another client or a person moves the fingers, or channels are swapped. Home the hand, then run the check again",
            code="astray",
        )

    @property
    def _heard(self) -> int:
        """How often encoders have come."""
        return self._hand.conversation.feedback.good.get(MOTORS.key, 0)

    def _told(self) -> tuple[Wire, Wire, Wire]:
        """Encoders, currents and joint angles as the hand told them last."""
        conversation = self._hand.conversation
        one, two, three = (
            conversation.usable(param, conversation.feedback.result(param.key)) for param in (MOTORS, CURRENT, JOINTS)
        )
        return one, two, three
