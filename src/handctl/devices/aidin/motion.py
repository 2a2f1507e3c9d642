"""Movements of the AIDIN-hand: encoders, joints and fingertips on a ramp until they reach their targets; currents.

An object is sent every 20 ms; there is no acknowledge, so that feedback alone proves arrival (aidin, Modes). Currents go up a
ramp from 0, are held, go back to 0, and stop (aidin, Modes: current control): there is no position limit, so however it ends,
they go to 0 and the stop mode is sent.

Targets are typed in the manual's units (counts, degrees, mm) and become a complete vector, checked for each finger (aidin, Ranges):
out of range is refused, never clamped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, degrees, isfinite, radians

from handctl.devices.aidin.conversation import Feedback, Wire, values_of
from handctl.devices.aidin.device import (
    NO_ANGLE,
    AidinHand,
    in_force,
    object_of,
    outside,
    reading,
    step_of,
    stopped_if_cut_short,
    stopped_on_error,
)
from handctl.devices.aidin.exchange_settings import PERIOD
from handctl.devices.aidin.feedback_guard import ImplausibleFeedback
from handctl.devices.aidin.homing_and_bias import MAX_TORQUE_SECONDS, check_homed, connect_or_command, named
from handctl.devices.aidin.parameter_map import (
    AIDIN,
    CURRENTS,
    LARGEST_RADIAN,
    TIPS,
    AidinParam,
    Mode,
    Target,
    both_ranges,
)
from handctl.errors import Aftermath, CheckFailed, Hint, NoAnswer, UsageError
from handctl.model import movement
from handctl.model.movement import (
    ARRIVAL,
    REACHED,
    TARGET,
    UNREAD,
    Arrival,
    AxisReading,
    Stillness,
    Watch,
    failure_of_arrivals,
    listed,
)
from handctl.model.param import Number, Step, given
from handctl.model.prompts import CTRL_C, InterruptCount, Prompts
from handctl.model.result import Row, Table
from handctl.model.stop_sequence import Stopped
from handctl.number_parsing import real_in
from handctl.system.deadman_process import HEARTBEAT_TIMEOUT
from handctl.wording import some

RADIAN_STEP = 1e-6
COUPLED = "q4"
SHOWN = 4


@dataclass(frozen=True, slots=True)
class Goal:
    """Targets by index, in the command's unit; what is not in `named` keeps its place."""

    target: Target
    named: dict[int, float]

    @property
    def names_all(self) -> bool:
        """Whether nothing needs to be known of the hand."""
        return len(self.named) == self.target.command.count

    def complete(self, measured: Sequence[Number] | None) -> list[float]:
        """The whole vector: named elements, the others as measured (same order and unit).

        Raises UsageError without `measured` where it is needed; CheckFailed when what is kept is out of its range.
        """
        param = self.target.command
        if measured is None and not self.names_all:
            raise UsageError(
                "the elements that you did not give keep their position, which is unknown", hint="give all values"
            )
        kept = dict(enumerate(measured or ()))
        return [
            self.named[index] if index in self.named else _kept(param, index, float(kept[index]))
            for index in range(param.count)
        ]

    def wire(self, values: Sequence[float]) -> tuple[int, ...] | tuple[float, ...]:
        """The numbers of the command's array."""
        param = self.target.command
        if param.int_range is not None:
            return tuple(map(round, values))
        return tuple([float(param.to_wire(index, value)) for index, value in enumerate(values)])


def _kept(param: AidinParam, index: int, value: float) -> float:
    """A measured value that is commanded again: one that jitters outside its range is held at the limit."""
    limit = param.limit(index)
    if limit is not None and outside(param, index, value):
        raise CheckFailed(
            f"{param.elements[index]} would be kept at {value:g}, which is outside {limit[0]:g}..{limit[1]:g}",
            hint=Hint(
                "give a value for it as well, or run {} if the hand has not been homed since power-on. Nothing was sent.",
                "aidin home",
            ),
            code="kept-out-of-range",
        )
    return _at_limit(param, index, value)


def _at_limit(param: AidinParam, index: int, value: float) -> float:
    """The value, or the limit of its range where it is beyond that."""
    low, high = param.limit(index) or (value, value)
    return min(max(value, low), high)


def parse(target: Target, texts: Sequence[str], *, rad: bool = False, cap: float | None = None) -> Goal:
    """``10 5 118 …`` (all in order; joints also without q4) or ``index.q3=160 thumb.q1=10``. Raises UsageError."""
    param = target.command
    driven = [index for index in range(param.count) if param.label_of(index) != COUPLED]
    named = given(
        texts,
        param.elements,
        what=param.key,
        noun="element",
        orders=[range(param.count)] if len(driven) == param.count else [range(param.count), driven],
        more=f". An element is FINGER.{'|'.join(param.labels)}",
    )
    if "=" in texts[0] and (coupled := [index for index in named if index not in driven]):
        raise UsageError(
            f"{param.elements[coupled[0]]}: q4 is coupled to q3 and cannot be commanded",
            hint="give q3 (aidin, Command keys)",
            code="coupled",
        )
    values = {index: _number(param, index, text) for index, text in named.items()}
    if rad:
        values = {index: _from_radians(param, index, value) for index, value in values.items()}
    elif param.angles and len(values) >= 15 and not any(values.values()):
        raise UsageError(
            "all zeros: q3 = 0 is out of range for every finger",
            hint=f"q3 is the angle between two links, 180 is straight. Allowed, in degrees: q3 {both_ranges(param.limits['q3'])} "
            "(aidin, Ranges). Nothing was sent.",
            code="out-of-range",
        )
    _check(param, values, rad=rad)
    if cap is not None:
        _check_cap(param, values, cap)
    if param.angles:
        for index in [index for index in values if param.label_of(index) == "q3"]:
            values.setdefault(index + 1, values[index])  # only q3 counts, but the slot of q4 should not contradict it
    return Goal(target, dict(sorted(values.items())))


def _number(param: AidinParam, index: int, text: str) -> float:
    name, value = param.elements[index], real_in(text)
    if not isfinite(value) or "_" in text:
        raise UsageError(f"{name} = {text!r} is not a number", hint="nothing was sent", code="not-a-number")
    if param.int_range is not None and value != int(value):
        raise UsageError(f"{name} = {text} is not a whole number", hint="nothing was sent", code="not-a-number")
    return value


def _from_radians(param: AidinParam, index: int, value: float) -> float:
    """Degrees; the wire's rounding of a limit counts as the limit (-13 deg is -0.226893 rad to 6 decimals)."""
    limit = param.limit(index)
    for end in limit or ():
        if abs(value - radians(end)) <= RADIAN_STEP:
            return end
    return degrees(value)


def _check(param: AidinParam, values: dict[int, float], *, rad: bool) -> None:
    wrong = []
    for index, value in values.items():
        limit = param.limit(index) or ((-180.0, 180.0) if param.angles else None)
        if limit is not None and not limit[0] <= value <= limit[1]:
            wrong.append((index, value, limit))
    if not wrong:
        return
    unit = f" {param.unit}" if param.unit else ""
    named = [f"{param.elements[index]} = {value:g}{unit}" for index, value, _ in wrong]
    ranges = [f"{param.elements[index]} {limit[0]:g}..{limit[1]:g}{unit}" for index, _, limit in wrong[:SHOWN]]
    ours = param is CURRENTS.command or any(param.limit(index) is None for index, _, _ in wrong[:SHOWN])
    source = "handctl's own limits, because the manual gives no range" if ours else "aidin, Ranges"
    hint = f"allowed: {', '.join(ranges)} ({source}). Nothing was sent."
    if param.angles and _fits(param, values, rad=rad):
        hint = f"as {'degrees: leave --rad out' if rad else 'radians they would be in range: add --rad'}. {hint}"
    raise UsageError(
        f"{some(named, SHOWN)} {'is' if len(named) == 1 else 'are'} out of range", hint=hint, code="out-of-range"
    )


def _fits(param: AidinParam, values: dict[int, float], *, rad: bool) -> bool:
    """Whether the same numbers fit in the other unit."""
    other = radians if rad else degrees
    return not any(outside(param, index, other(value), 0.0) for index, value in values.items())


def _check_cap(param: AidinParam, values: dict[int, float], cap: float) -> None:
    for index, value in values.items():
        if abs(value) > cap:
            raise UsageError(
                f"{param.elements[index]} = {value:g} is beyond the cap of {cap:g}",
                hint="use --cap N to allow more, up to 1000. Nothing was sent.",
                code="beyond-cap",
            )


def axes_of(goal: Goal, values: Sequence[float]) -> Iterator[movement.Goal]:
    """What is watched, and how near is there: 1 % of stroke, 2 deg, 2 mm; currents 20 and a tenth of the target."""
    target, param = goal.target, goal.target.command
    unit = f" {param.unit}" if param.unit else ""
    for index, wanted in enumerate(values):
        if param.label_of(index) != COUPLED:
            near, places = (
                target.near(index) + (abs(wanted) * 0.1 if target is CURRENTS else 0.0),
                target.feedback.places,
            )
            yield movement.Goal(
                param.elements[index],
                wanted,
                near,
                jitter=near,
                decimals=places,
                unit=unit,
                direct=target is not TIPS,  # one coordinate has no way of its own
            )


# -- typed targets to a complete vector for the wire ------------------------------------------------------------------


ARRIVE = 3.0
"""Seconds after the ramp's end until a target counts as not reached."""
LOOKS = 50
"""Looks that these seconds have at least: a program that the system held up has not seen the hand yet."""
PUSHING = 200
"""Per mille of the rated current: a motor that stands and draws more pushes something. Ours, the manual has no figure."""
STILL = Stillness(samples=3, seconds=0.2, grace=ARRIVE, pushing=PUSHING, draws="a motor draws {} per mille")
"""A target is reached when the element was near it for so long: one that passes by, or still comes nearer, is not there."""
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
    (wire,) = hand.conversation.need(target.feedback)
    return values_of(target.feedback, wire)


def plan(device: Callable[[], AidinHand], goal: Goal, end: bytes) -> list[Step]:
    """The object that ends a movement, for --dry-run, with its terminator. What is kept is taken from a hand that tells it
    unasked: it is only listened to."""
    here = None
    if not goal.names_all:
        hand = device()
        hand.conversation.connect(silent=True)
        here = measured(hand, goal.target)
    return [last_step(goal, goal.complete(here), end)]


def ramp(goal: Goal, start: Sequence[Number], values: Sequence[float], period: float) -> list[tuple[float, ...]]:
    """The way from `start` to `values`, one vector a period, the last one `values` itself.

    The slowest element sets the pace. A start outside its range begins at the limit.
    """
    param = goal.target.command
    begin = [_at_limit(param, index, float(value)) for index, value in enumerate(start)]
    count = 1
    for index, (a, b) in enumerate(zip(begin, values, strict=True)):
        if param.label_of(index) != COUPLED:
            count = max(count, ceil(abs(b - a) / (goal.target.per_second(index) * period) - 1e-9))
    return [
        tuple([b if step == count else a + (b - a) * step / count for a, b in zip(begin, values, strict=True)])
        for step in range(1, count + 1)
    ]


def last_step(goal: Goal, values: list[float], end: bytes) -> Step:
    """The object that ends a movement, as a step."""
    meaning = f"mode {int(goal.target.mode)}, the last object of a ramp from the hand's current position"
    return step_of(meaning, target_object(goal, values), end)


def move(hand: AidinHand, goal: Goal, prompts: Prompts, *, assume_homed: bool, expect: str = REACHED) -> Table:
    """Go there on a ramp from where the hand is, and see it arrive; rows have `target`, `reached` and `arrival`.

    An element that is not near within 3 s of the ramp's end has not arrived; then sending has ended, too. What was not as
    expected is the table's failure.
    """
    conversation = hand.conversation
    check_homed(hand, assume=assume_homed)
    here = measured(hand, goal.target)
    values = goal.complete(here)
    _check_start(hand, goal.target, here, assume=assume_homed)
    before = _at_rest(hand, goal.target, here)
    ledger = hand.journal.ledger
    begun = ledger.mark
    ledger.plan([last_step(goal, values, conversation.way.end)])
    with stopped_if_cut_short(hand, prompts), stopped_on_error(hand, prompts, ImplausibleFeedback, otherwise=GOES_ON):
        _follow(hand, goal, ramp(goal, here, values, PERIOD), prompts)
        conversation.feedback = Feedback()
        seen = Watch(list(axes_of(goal, values)), STILL, hand.link.now(), before)
        _settle(hand, goal, values, seen, prompts)
        arrived, lives = seen.reached, conversation.guard is not None and conversation.guard.changed
        if not arrived:
            _tell_deadline(hand, seen)
    with in_force(HOLDS if arrived else GOES_ON):
        table = hand.table(hand.read(goal.target.feedback.each))
    if table.failure is None:
        seen.note(hand.link.now(), _places(table))
        mark(hand, table, values, seen.arrivals(_drawn(hand, seen.short)), expect)
        if not lives and not arrived:
            hand.journal.warn(
                "unchanged",
                "no value of the feedback changed during the movement, so the hand either ignored it or repeats old values",
            )
    if table.failure is not None:
        table.failure.add_aftermath(Aftermath(hint=GOES_ON))
    elif arrived:
        ledger.confirm("arrived, according to the feedback", since=begun)
        hand.journal.info("reached", HOLDS)
    return table


def _check_start(hand: AidinHand, target: Target, here: list[Number], *, assume: bool) -> None:
    """Raise CheckFailed if a ramp cannot begin at the reported positions: its first step would be a jump to a limit."""
    param, name = target.feedback, hand.link.name
    if param.angles and any(abs(value) > degrees(LARGEST_RADIAN) for value in here):
        raise CheckFailed(
            f"{name}: {param.key} {NO_ANGLE}. A ramp cannot start there",
            hint=Hint("check {}, and its bytes with --trace FILE. Nothing was sent.", "aidin status"),
            code="start-out-of-range",
        )
    far = [index for index, value in enumerate(here) if outside(param, index, value, FAR)]
    if far and not assume:
        raise CheckFailed(
            f"{name}: a ramp cannot start at the current position, which is far out of range: {named(param, far, here)}",
            hint=Hint(
                "run {} first. --assume-homed skips homing and starts the ramp at the limit. Nothing was sent.",
                "aidin home",
            ),
            code="start-out-of-range",
        )


def _tell_deadline(hand: AidinHand, seen: Watch) -> None:
    """Raise NoAnswer when --deadline has passed, with what was not reached by then as far as it is known."""
    try:
        hand.conversation.check_bound()
    except NoAnswer as exc:
        if off := [one for one in seen.arrivals() if one.verdict not in (REACHED, UNREAD)]:
            exc.text += f"; not reached: {listed(off)}"
        raise


def _follow(hand: AidinHand, goal: Goal, way: list[tuple[float, ...]], prompts: Prompts) -> None:
    for number, values in enumerate(way, 1):
        hand.conversation.tick(target_object(goal, values), by=goal.target.feedback)
        prompts.progress(f"Moving {number * PERIOD:.1f} of {len(way) * PERIOD:.1f} s.", CTRL_C)


def _settle(hand: AidinHand, goal: Goal, values: list[float], seen: Watch, prompts: Prompts) -> None:
    """Repeat the target until everything has been near it for a while, or that takes too long."""
    conversation, data, param = hand.conversation, target_object(goal, values), goal.target.feedback
    end = conversation.deadline(ARRIVE)
    ended, looks, looked_at = False, 0, -1.0
    while not ended and (looks < LOOKS or not end.expired):
        conversation.tick(data, by=param)
        looks += 1
        prompts.progress("Waiting for the hand to arrive.", CTRL_C)
        if conversation.feedback_at == looked_at:
            continue
        looked_at = conversation.feedback_at
        feedback, told = conversation.feedback, {}
        if param.key in feedback.values and param.key not in feedback.errors:
            places = values_of(param, feedback.values[param.key])
            told = {name: AxisReading(place) for name, place in zip(param.elements, places, strict=True)}
        ended = seen.note(looked_at, told)


def _places(table: Table) -> dict[str, AxisReading]:
    return {element_of(row): AxisReading(row["value"]) for row in table.rows}


def element_of(row: Row) -> str:
    """``index.q3``."""
    return f"{row['finger']}.{row['element']}"


def _at_rest(hand: AidinHand, target: Target, here: Sequence[Number]) -> dict[str, AxisReading]:
    """Each element before the movement."""
    flowing, names = _drawn(hand, target.feedback.elements), target.feedback.elements
    return {
        name: flowing.get(name, AxisReading(None))._replace(value=place)
        for name, place in zip(names, here, strict=True)
    }


def _drawn(hand: AidinHand, names: Sequence[str]) -> dict[str, AxisReading]:
    """The currents of the motors of each element's finger, as the hand reported them last; {} where they are not known."""
    told = hand.conversation.feedback
    if CURRENT.key in told.errors or CURRENT.key not in told.values:
        return {}
    currents = dict(zip(CURRENT.elements, map(int, told.values[CURRENT.key]), strict=True))
    found = {}
    for name in names:
        finger = name.partition(".")[0]
        flowing = tuple(value for motor, value in currents.items() if motor.startswith(f"{finger}."))
        found[name] = AxisReading(None, currents=flowing)
    return found


def mark(
    hand: AidinHand, table: Table, values: list[float], arrivals: Sequence[Arrival], expect: str = REACHED
) -> None:
    """Add target and result to each row; an unexpected result is the table's failure."""
    at = {one.goal.name: one for one in arrivals}
    for value, row in zip(values, table.rows, strict=True):
        one = at.get(element_of(row))  # q4 goes with q3
        row["target"] = round(value, 4)
        row["reached"] = one is None or one.verdict == REACHED
        row["arrival"] = None if one is None else one.verdict
    table.columns = (*hand.columns[:4], TARGET, hand.columns[4], ARRIVAL)
    table.failure = failure_of_arrivals(
        hand.link.name,
        arrivals,
        expect,
        hint="unreachable together with the others or blocked, or the maximum torque is too low, or the hand is not homed",
    )


def followed(hand: AidinHand, goal: Goal, values: list[float], table: Table) -> None:
    """The same for targets that are no places, by one look at them."""
    seen = Watch(list(axes_of(goal, values)), Stillness(samples=1, seconds=0.0), hand.link.now())
    seen.note(hand.link.now(), _places(table))
    mark(hand, table, values, seen.arrivals())


# -- currents ------------------------------------------------------------------------------------------------------


def currents(
    hand: AidinHand,
    goal: Goal,
    prompts: Prompts,
    *,
    seconds: float,
    cap: float,
    ramp_down: bool = False,
    heartbeat: float = HEARTBEAT_TIMEOUT,
) -> Table:
    """Mode 41: maxtorque 1000 first, a ramp from 0, held for `seconds`, back to 0, stop; rows have `target` and `reached`.

    Ctrl-C stops at once; with `ramp_down` it takes the currents back to 0 on the same ramp first, and a second one stops
    at once. Every error stops, and so does a `heartbeat` of seconds in which this process stands still, 0 = it may. Raises CheckFailed when the currents were not there.
    """
    blind = connect_or_command(hand)
    values = _values(hand, goal, cap, blind=blind)
    drive = _Drive(hand, goal, prompts)
    ledger = hand.journal.ledger
    ledger.plan([last_step(goal, values, hand.conversation.way.end)])
    with stopped_if_cut_short(hand, prompts, heartbeat=heartbeat, ends=False):
        with stopped_on_error(hand, prompts):
            try:
                table = drive.run(values, seconds, blind=blind)
                drive.to(drive.zero, "Currents return to 0,")
            except KeyboardInterrupt:
                if not ramp_down:
                    raise
                with prompts.count_interrupts() as presses:
                    prompts.instruct("Interrupted. The currents return to 0. Press Ctrl-C again to stop immediately.")
                    drive.to(drive.zero, "Currents return to 0,", presses)
                raise
        if table.failure is None:
            ledger.confirm("the currents followed", since=drive.begun)
        stopped = hand.stop()
    hand.conversation.check_bound()
    _tell_stop(hand, stopped)
    return table


def _tell_stop(hand: AidinHand, stopped: Stopped) -> None:
    """Report the hand's feedback after the stop."""
    free = "Without power the fingers move freely. The maximum torque stays at 1000"
    if stopped.error is not None:
        hand.journal.warn("not-stopped", stopped.text, stopped.hint)
    elif stopped.evidence:
        text = f"the currents were ramped down to 0 and stop was sent. No current flows. {free}"
        hand.journal.info("stopped", text)
    else:
        hand.journal.info("stopped", f"the currents were ramped down to 0. {stopped.text}. {free}")


def _values(hand: AidinHand, goal: Goal, cap: float, *, blind: bool) -> list[float]:
    """The whole vector, the elements that are not given as measured. A hand that only answers commands needs it whole."""
    if blind:
        if not goal.names_all:
            raise NoAnswer(
                f"{hand.link.name}: the hand sends nothing without a request, so the currents that you did not give are unknown",
                hint="give all 15 values. Nothing was commanded.",
            )
        return goal.complete(None)
    values = goal.complete(measured(hand, goal.target))
    beyond = [f"{goal.target.command.elements[i]} {value:g}" for i, value in enumerate(values) if abs(value) > cap]
    if beyond:
        raise CheckFailed(
            f"{hand.link.name}: {', '.join(beyond)} would be kept, but the cap is {cap:g}",
            hint="give a value for it as well. Nothing was sent.",
            code="beyond-cap",
        )
    return values


class _Drive:
    """A ramp of currents; `at`: the currents sent last."""

    def __init__(self, hand: AidinHand, goal: Goal, prompts: Prompts) -> None:
        self._hand = hand
        self._goal = goal
        self._guide = prompts
        self.begun = 0  # in the ledger
        self.zero = [0.0] * goal.target.command.count
        self.at = self.zero

    def run(self, values: list[float], seconds: float, *, blind: bool) -> Table:
        """Up the ramp and hold; the currents that the hand told last. A hand of which nothing is known must answer first."""
        conversation = self._hand.conversation
        first, end = object_of(Mode.MAXTORQUE, maxtorque=1000), conversation.deadline(MAX_TORQUE_SECONDS)
        while not end.expired:
            conversation.tick(first, blind=blind)
        if blind:
            self._told()
        self.begun = self._hand.journal.ledger.mark
        self.to(values, "Currents rise,")
        data, end = target_object(self._goal, values), conversation.deadline(seconds)
        while not end.expired:
            conversation.tick(data, by=self._goal.target.feedback)
            self._guide.progress(f"Currents on, {end.remaining:.1f} s left.", CTRL_C)
        found, param = self._told(), self._goal.target.feedback
        table = self._hand.table([reading(self._hand.link.name, element, found) for element in param.each])
        followed(self._hand, self._goal, values, table)
        return table

    def to(self, values: list[float], what: str, presses: InterruptCount | None = None) -> None:
        """Go there on the ramp, until one of `presses` ends it. Raises NoAnswer when the hand falls silent meanwhile."""
        way = ramp(self._goal, self.at, values, PERIOD)
        for number, step in enumerate(way, 1):
            if presses is not None and presses.count:
                return
            self.at = list(step)
            self._hand.conversation.tick(target_object(self._goal, step), by=self._goal.target.feedback)
            self._guide.progress(f"{what} {number * PERIOD:.1f} of {len(way) * PERIOD:.1f} s.", CTRL_C)

    def _told(self) -> Wire:
        """The currents of the last feedback, without asking: nothing may come between the objects."""
        param, conversation = self._goal.target.feedback, self._hand.conversation
        if not conversation.feedback.seen:
            raise conversation.nothing_came()
        return conversation.usable(param, conversation.feedback.result(param.key))
