"""Watch a movement until every axis has ended, and judge the result of each against --expect. Knows no device.

An axis has ended its movement when the device reports that something blocks it, or when it has stopped: a number of
equal readings over a time that the family defines (`Stillness`). At its target too: one that does not obey may be seen
exactly there as it passes by. Short of the target that time is longer: a movement may begin late, or pause. The result is one of

    reached   it is at its target
    contact   it stopped before its target, and the device reports an object or a stall, or its force shows a push, or its
              current has risen over what it was at rest before the movement
    short     it moved, and stopped before its target; the device gives no reason
    unmoved   it is not at its target, and no movement was detected; the device gives no reason
    astray    it stands beyond its target, or on the other side of its start: no obstacle explains that, and something else
              may be commanding it
    blocked   it has stopped, and the device reports a fault, such as a locked rotor
    moving    it was not seen at rest for that time when the wait was over: it may still move
    no-speed  it is not at its target, and its set speed is 0
    unread    its position could not be read

`--expect` selects which of these are a success. `reached`: every axis is at its target. `contact`: at least one axis
touches something, and the others touch something or are at their targets. `any`: each axis is one of the first three, however it ended. A movement that
never began has no end: `unmoved` is never a success, as a fault, an axis that still moves, has no speed or could not be read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest

from handctl.errors import CheckFailed, DeviceRefused, HandctlError, joined
from handctl.fast_classes import NamedTuple
from handctl.model.param import Number
from handctl.model.prompts import CTRL_C, Prompts
from handctl.model.result import Column, Row
from handctl.wording import some

REACHED, CONTACT, SHORT, UNMOVED, ASTRAY, BLOCKED, MOVING, NO_SPEED, UNREAD = (
    "reached", "contact", "short", "unmoved", "astray", "blocked", "moving", "no-speed", "unread",
)  # fmt: skip
ANY = "any"
EXPECTED = (REACHED, CONTACT, ANY)
"""What `--expect` takes."""
ENDED = "ended"
"""For who judges the rows himself: as `any`, and an axis that did not move has ended too."""
MET: Mapping[str, frozenset[str]] = {
    REACHED: frozenset({REACHED}),
    CONTACT: frozenset({REACHED, CONTACT}),
    ANY: frozenset({REACHED, CONTACT, SHORT}),
    ENDED: frozenset({REACHED, CONTACT, SHORT, UNMOVED}),
}
"""What is expected -> the verdicts that each axis may have."""
CODES = {ASTRAY: "astray", BLOCKED: "blocked", MOVING: "still-moving", UNREAD: "unread", NO_SPEED: "no-speed"}
"""Verdict -> code of the error where an axis has it, the worst first; else ``not-reached``."""
HINTS = {
    ASTRAY: "check whether another program is commanding it: `handctl ports` shows those that use the ports of this computer",
    BLOCKED: "find out which error it reports, and remove its cause",
    MOVING: "wait longer, or stop it",
    UNREAD: "check the link, then read its position again",
    NO_SPEED: "set a speed",
    UNMOVED: "check for an obstacle, and that its motors have power",
    SHORT: "check for an obstacle. --expect any accepts this",
    CONTACT: "--expect contact accepts this, for example to grip an object",
}
ARRIVAL = Column("arrival", "Arrival")
TARGET = Column("target", "Target", right=True)
SHOWN = 6
"""Axes that a message names."""


class Stillness(NamedTuple):
    """When an axis of a family counts as stopped.

    samples, seconds  so many readings in a row, over so long a time, do not differ by more than the goal's `jitter`
    refresh           seconds between two readings: asking faster only repeats values
    dead              seconds from the command until a movement begins: before that nothing has ended
    least             seconds that the movement takes: before that only standing exactly at its target is an end
    grace             seconds for which standing short of the target is no end yet
    short             seconds at rest that are an end short of the target, unless the device reports one: it may begin late, or pause
    pushing           current of an actuator that stands and pushes something; half of that it must have risen since the start
    draws             such a current in words
    """

    samples: int = 3
    seconds: float = 0.3
    refresh: float = 0.03
    dead: float = 0.0
    least: float = 0.0
    grace: float = 0.0
    short: float = 0.0
    pushing: Number = 0
    draws: str = "it draws {} mA"


class Goal(NamedTuple):
    """Where one axis is to go.

    target    None for a movement that ends where it meets something: contact is its goal then
    near      so far from the target it has arrived
    speed     its set speed, None where there is none or it is not known
    patience  seconds that it may seem to stand while it moves, at that speed
    jitter    how far its reading changes while it stands
    direct    it passes only places between its start and its target: anywhere else it is astray
    """

    name: str
    target: Number | None
    near: Number = 0
    speed: Number | None = None
    patience: float = 0.0
    jitter: Number = 0
    decimals: int = 0
    unit: str = ""
    direct: bool = True

    def text(self, value: Number | None) -> str:
        """A place of this axis for people."""
        return "?" if value is None else f"{value:.{self.decimals}f}{self.unit}"


class AxisReading(NamedTuple):
    """One axis at one moment.

    moves    what the device itself says of it; None = nothing
    blocked  what it reports against the movement, in words; "" = nothing
    contact  what shows that it has met something, in words; "" = nothing
    currents what its actuators draw, in the same order each time: one shows a contact where it is enough (`Stillness.pushing`),
             and has risen since before the movement
    """

    value: Number | None
    moves: bool | None = None
    blocked: str = ""
    contact: str = ""
    currents: tuple[Number, ...] = ()


class Arrival(NamedTuple):
    """What became of one axis, and why."""

    goal: Goal
    value: Number | None
    verdict: str
    why: str = ""

    @property
    def met(self) -> str:
        """The verdict to compare with --expect: without a target, contact counts as reached."""
        return REACHED if self.verdict == CONTACT and self.goal.target is None else self.verdict

    def __str__(self) -> str:
        here = self.goal.text(self.value)
        words = {
            REACHED: f"{self.goal.name} reached {here}",
            CONTACT: f"{self.goal.name} touched something at {here}",
            SHORT: f"{self.goal.name} stopped at {here}",
            UNMOVED: f"{self.goal.name} did not move from {here}",
            ASTRAY: f"{self.goal.name} went to {here}, which is not on the way to its target",
            BLOCKED: f"{self.goal.name} is blocked at {here}",
            MOVING: f"{self.goal.name} may still move, now at {here}",
            NO_SPEED: f"{self.goal.name} has speed 0 and stays at {here}",
            UNREAD: f"the position of {self.goal.name} could not be read",
        }[self.verdict]
        context = "" if self.goal.target is None else f", target {self.goal.text(self.goal.target)}"
        return f"{words}{context}{f' ({self.why})' if self.why else ''}"


def is_astray(start: Number, target: Number, value: Number, near: Number) -> bool:
    """Whether an axis is farther than `near` beyond its target, or on the other side of its start."""
    return not min(start, target) - near <= value <= max(start, target) + near


def stands(before: Number, now: Number, jitter: Number) -> bool:
    """Whether two readings of one axis differ by no more than those of a resting one."""
    return abs(now - before) <= jitter


def stands_still(
    before: Sequence[Number], now: Sequence[Number], jitter: Number, held: Sequence[Number | None] = ()
) -> bool:
    """Whether every axis stands between two readings of all.

    `held` are the positions where they were commanded to stay, None for an axis that was not: one that comes back to its
    own obeys, and one that goes on from it does not.
    """
    back = [
        place is not None and abs(there - place) < abs(here - place)
        for here, there, place in zip(before, now, held, strict=False)
    ]
    rest = [stands(here, there, jitter) for here, there in zip(before, now, strict=True)]
    return all(one or other for one, other in zip_longest(rest, back, fillvalue=False))


class _Axis:
    """What was seen of one axis so far. `anchor` is where it stood before, None where that is not known: a movement may be over
    before its first reading."""

    def __init__(self, goal: Goal, anchor: Number | None) -> None:
        self.goal = goal
        self.seen = AxisReading(None)
        self.equal = 0
        self.anchor = anchor
        self.since = 0.0
        self.moved = False

    def note(self, now: float, seen: AxisReading) -> None:
        self.seen = seen
        if seen.value is None:
            return
        left = self.anchor is not None and not stands(self.anchor, seen.value, self.goal.jitter)
        self.moved = self.moved or left
        if left or not self.equal:
            self.anchor, self.since, self.equal = seen.value, now, 0
        self.equal += 1

    @property
    def near(self) -> bool:
        value, target = self.seen.value, self.goal.target
        return value is not None and target is not None and abs(value - target) <= self.goal.near


class Watch:
    """Sees readings of the axes of a movement one after the other, and says when all have ended. Does no I/O.

    `before` is what was read of each axis before it was commanded; what is not in it is not known.
    """

    def __init__(
        self, goals: Sequence[Goal], still: Stillness, now: float, before: Mapping[str, AxisReading] | None = None
    ) -> None:
        self.still = still
        self._before = before or {}
        self.begun = self.now = now
        self._axes = {
            goal.name: _Axis(goal, self._before[goal.name].value if goal.name in self._before else None)
            for goal in goals
        }

    def note(self, now: float, seen: Mapping[str, AxisReading]) -> bool:
        """Take the readings of this moment; whether every axis has ended its movement."""
        self.now = now
        for name, axis in self._axes.items():
            axis.note(now, seen.get(name, AxisReading(None)))
        return all(self._ended(axis) for axis in self._axes.values())

    def _rests(self, axis: _Axis, *, explained: bool = False) -> bool:
        """Whether it has stood long enough to have ended. If the device reports that it has stopped, or what is read of it
        explains why, no more time is needed than at its target; its report that it moves is not enough by itself."""
        seen, goal = axis.seen, axis.goal
        need = 0.0 if seen.moves is False else max(self.still.seconds, goal.patience)
        reported = axis.near or explained or seen.contact or goal.speed == 0 or (seen.moves is False and axis.moved)
        if not reported:
            need = max(need, self.still.short)
        stood = self.now - axis.since
        slow = axis.equal > 1 and stood >= self.still.seconds  # a slow line brings fewer readings in that time
        return (slow or axis.equal >= self.still.samples) and stood >= need

    @staticmethod
    def _stopped_by_fault(axis: _Axis) -> bool:
        """A fault alone is no standstill: the reading has to stay as it is."""
        return bool(axis.seen.blocked) and axis.equal > 1

    def _ended(self, axis: _Axis) -> bool:
        lasted = self.now - self.begun
        if axis.seen.value is None or (self.still.dead and lasted <= self.still.dead):
            return False
        if self._stopped_by_fault(axis):
            return True
        least = 0.0 if axis.seen.value == axis.goal.target else self.still.least
        return self._rests(axis) and lasted >= max(least, 0.0 if axis.near else self.still.grace)

    @property
    def short(self) -> list[str]:
        """The axes that are not at their targets. A family may read more about them to give the reason."""
        return [name for name, axis in self._axes.items() if not axis.near]

    def arrivals(self, deeper: Mapping[str, AxisReading] | None = None) -> list[Arrival]:
        """What became of each axis; `deeper` is what was read of them once more, when it was over.

        What is blocked there speaks against an axis at its target too; the rest tells why one is `short`.
        """
        return [self._arrival(self._axes[name], (deeper or {}).get(name)) for name in self._axes]

    def _arrival(self, axis: _Axis, deeper: AxisReading | None) -> Arrival:
        value, goal, near = axis.seen.value, axis.goal, axis.near
        if value is None:
            fault = deeper.blocked if deeper is not None else ""
            return Arrival(goal, None, BLOCKED if fault else UNREAD, fault)
        if self._stopped_by_fault(axis):
            return Arrival(goal, value, BLOCKED, axis.seen.blocked)
        blocked, contact = "" if deeper is None else deeper.blocked, axis.seen.contact
        if near and not (axis.moved and not self._rests(axis)):
            return Arrival(goal, value, BLOCKED if blocked else REACHED, blocked)
        if goal.speed == 0 and not axis.moved:
            return Arrival(goal, value, NO_SPEED)
        before = self._before.get(goal.name, AxisReading(None))
        if deeper is not None and not near and axis.moved:  # else it has met nothing on its way, whatever it draws now
            contact = contact or self._pushes(before, deeper)
        known = before.value is not None and goal.target is not None and goal.direct and not near
        astray = known and is_astray(before.value, goal.target, value, goal.near)  # type: ignore[arg-type]
        if not self._rests(axis, explained=bool(blocked or contact or astray)):
            return Arrival(goal, value, MOVING, blocked)
        if blocked:
            return Arrival(goal, value, BLOCKED, blocked)
        if astray:
            return Arrival(goal, value, ASTRAY)
        verdict = CONTACT if contact else SHORT if axis.moved else UNMOVED
        return Arrival(goal, value, verdict, contact)

    def _pushes(self, before: AxisReading, now: AxisReading) -> str:
        """What the current of an axis that stands shows, in words; "" = no push, or it was as high before."""
        pushing = self.still.pushing
        for rest, current in zip(before.currents, now.currents, strict=False):
            if abs(current) >= pushing and abs(current) - abs(rest) >= pushing / 2:
                return self.still.draws.format(current)
        return ""

    @property
    def reached(self) -> bool:
        """Whether every axis is at its target now."""
        return all(one.verdict == REACHED for one in self.arrivals())

    def progress(self) -> str:
        """``1.4 s  ring 450 of 900, index 90 of 100``."""
        parts = []
        for name, axis in self._axes.items():
            goal = axis.goal
            context = "" if goal.target is None else f" of {goal.text(goal.target)}"
            parts.append(f"{name} {goal.text(axis.seen.value)}{context}")
        return f"{self.now - self.begun:4.1f} s  {', '.join(parts)}"


class Clock(NamedTuple):
    """Time as a line has it: `now`, `over` = whether the wait has ended, `tick` lets one reading's time pass.

    `tick` raises where --deadline ends the command.
    """

    now: Callable[[], float]
    over: Callable[[], bool]
    tick: Callable[[], None]


def watch(
    goals: Sequence[Goal],
    still: Stillness,
    look: Callable[[], Mapping[str, AxisReading]],
    prompts: Prompts,
    clock: Clock,
    before: Mapping[str, AxisReading] | None = None,
) -> Watch:
    """Look until every axis has ended its movement, or the wait is over."""
    seen = Watch(goals, still, clock.now(), before)
    while True:
        now_seen = look()
        ended = seen.note(clock.now(), now_seen)
        prompts.progress(seen.progress(), CTRL_C)
        if ended or clock.over():
            prompts.done()
            return seen
        clock.tick()


def failure_of_arrivals(
    where: str, arrivals: Sequence[Arrival], expect: str, *, hint: str = "", blocked: str = ""
) -> HandctlError | None:
    """The error where not every axis ended as it was expected to, with what became of those that did not.

    `hint` is the family's own next step, and comes first. `blocked` is the one for the faults that it reports.
    """
    off = [one for one in arrivals if one.met not in MET[expect]]
    if not off and expect == CONTACT and arrivals and all(one.verdict != CONTACT for one in arrivals):
        return CheckFailed(
            f"{where}: no contact: {listed(arrivals)}",
            hint="every target was reached. If that is right, run it without --expect contact",
            code="no-contact",
        )
    if not off:
        return None
    worst = next((verdict for verdict in HINTS if any(one.verdict == verdict for one in off)), SHORT)
    kind = DeviceRefused if worst == ASTRAY else CheckFailed
    return kind(
        f"{where}: {'the target was' if len(off) == 1 else 'targets were'} not reached: {listed(off)}",
        hint=joined(hint, blocked if blocked and worst == BLOCKED else HINTS[worst]),
        code=CODES.get(worst, "not-reached"),
    )


def by_whom(arrival: Arrival, told: Number | None) -> Arrival:
    """An axis that went astray, with what the device reports as its target; None = not known."""
    if told is None:
        return arrival
    if told == arrival.goal.target:
        return arrival._replace(why="its target is unchanged, so it does not obey, or something else moves it")
    return arrival._replace(why=f"its target is {arrival.goal.text(told)} now, so another program is commanding it")


def listed(arrivals: Sequence[Arrival]) -> str:
    """What became of these axes, a few of them in full."""
    return some([*map(str, arrivals)], SHOWN, "; ")


def marked(row: Row, arrival: Arrival | None) -> Row:
    """The row of an axis with its target, and what became of it; both None for one that was not sent anywhere."""
    if arrival is None:
        return {**row, "target": None, "arrival": None}
    return {**row, "target": arrival.goal.target, "arrival": arrival.verdict}


def with_arrival(columns: Sequence[Column]) -> tuple[Column, ...]:
    """The columns of a family's rows with the target behind the fourth, and the verdict last."""
    return (*columns[:4], TARGET, *columns[4:], ARRIVAL)
