"""Homing, initial position, sensor bias and maximum torque of the AIDIN-hand (aidin, Modes), checked by its feedback.

The encoders are incremental: homing makes the open position their origin, and a power cycle loses it. The hand does not
tell whether it is homed: it sets 0 wherever a finger stands. So it counts where a motor rested before that, judged by what
else is known: the origin of an earlier homing, and the stroke of the manual (aidin, Modes: homing; Ranges).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from handctl.devices.aidin.conversation import Feedback, Wire
from handctl.devices.aidin.device import (
    LEFT_HINT,
    AidinHand,
    in_force,
    left_in,
    object_of,
    outside,
    reading,
    stopped_if_cut_short,
    stopped_on_error,
)
from handctl.devices.aidin.exchange_settings import ExchangeMode
from handctl.devices.aidin.feedback_guard import ImplausibleFeedback
from handctl.devices.aidin.parameter_map import AIDIN, MOTOR_POS, STILL, AidinParam, Mode, moving, stroke
from handctl.devices.aidin.remedies import ALL_ZERO, REMEDIES
from handctl.errors import Aftermath, CheckFailed, Hint, Interrupted, NoAnswer, UsageError, joined
from handctl.families import FAMILIES
from handctl.model.param import Number
from handctl.model.prompts import CTRL_C, Prompts
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.model.stop_on_interrupt import on_early_end
from handctl.wording import some

HOLD = 3.5
"""Seconds of homing: the documented 3 and a reserve."""
LARGEST_GAP = 0.25
"""A longer pause between two homing objects may count as an interruption: the hold begins again."""
HOLDS = 3
INITIAL = 5.0
TICKS = 5
ZEROED = 2.5
"""Seconds after which the hand may set the origin: the documented 3 and a reserve."""
WAY = (
    Column("from", "From", right=True),
    Column("way", "Way", right=True),
    Column("rest", "Rest", right=True),
    Column("verdict", "Verdict"),
)
LEFT = "the hand was left in homing mode, and no stop was sent"
NOT_ZEROED = "a motor that is not at 0 either has no origin yet or moved on after it was set, so nothing shows what it counts from"
ZEROED_THERE = (
    "motors to 0 where they came to rest, so if that was not the open stop, their targets are off by the difference"
)
GOES_ON = "no stop was sent, so the hand probably continues to its origin. `handctl aidin stop` frees it"


# -- what the way of a motor proves ---------------------------------------------------------------------------------

AT_ORIGIN = 0.01
"""Share of a stroke within which a motor counts as at 0."""
AT_STOP = 0.02
"""Share of a stroke within which a motor counts as at its open stop."""
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
class TravelDirection:
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
    """Readings of all encoders, each with its time."""

    def __init__(self) -> None:
        self._looks: list[tuple[float, Counts]] = []
        self._taken: tuple[Feedback, int] | None = None

    def note(self, at: float, encoders: Counts) -> None:
        """Encoders as they are at a time."""
        self._looks.append((at, encoders))

    def look(self, at: float, feedback: Feedback) -> bool:
        """The encoders of feedback, unless they are those of the last look or were refused; whether they are new."""
        key = MOTOR_POS.key
        count = feedback.good[key]
        new = self._taken is None or self._taken[0] is not feedback or self._taken[1] != count
        if key in feedback.values and key not in feedback.errors and new:
            self._taken = feedback, count
            self.note(at, tuple(int(number) for number in feedback.values[key]))
            return True
        return False

    @property
    def last(self) -> Counts | None:
        """The newest encoders, None before the first look."""
        return self._looks[-1][1] if self._looks else None

    @property
    def moved(self) -> bool:
        """Whether any motor was seen away from where it was at first."""
        return any(moving(self._looks[0][1], encoders) for _, encoders in self._looks)

    def ways(self, zeroed: float) -> list[TravelDirection]:
        """The way of each motor and its verdict; the hand may have set the origin from the time `zeroed` on."""
        ways = [self._way(index, zeroed) for index in range(MOTOR_POS.count)]
        known, went = _knows_origin(ways), any(abs(way.share(way.travelled)) > AT_STOP for way in ways)
        return [replace(way, verdict=_verdict(way, known, went)) for way in ways]

    def _way(self, index: int, zeroed: float) -> TravelDirection:
        history = [(at, encoders[index]) for at, encoders in self._looks]
        cut = self._jump(index, history, zeroed)
        at, rest = history[cut]
        earlier = [value for when, value in history[:cut] if when <= at - RESTED]
        still = bool(earlier) and abs(rest - earlier[-1]) <= stroke(index) * STILL
        return TravelDirection(index, history[0][1], rest, history[-1][1], still)

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


def _knows_origin(ways: Sequence[TravelDirection]) -> bool:
    """Whether the encoders counted from the open stop before: most motors that moved came to rest at 0.

    Just after power-on they are 0 wherever the fingers are, and so what moves comes to rest elsewhere.
    """
    went = [way for way in ways if abs(way.share(way.travelled)) > AT_STOP]
    return 2 * sum(abs(way.share(way.rest)) <= AT_STOP for way in went) > len(went)


def _verdict(way: TravelDirection, known: bool, went: bool) -> Verdict:
    """What it proves, where the origin of before is `known` or not and any motor `went` further than the play of a stop."""
    if abs(way.share(way.now)) > AT_ORIGIN:
        return Verdict.OFF
    if not way.still:
        return Verdict.MOVING
    if way.share(way.travelled) >= 1.0 - AT_STOP:
        return Verdict.STROKE
    # Each motor for itself: of one that never left its place nothing shows what holds it there.
    if known and abs(way.share(way.rest)) <= AT_STOP:
        return Verdict.OPEN if abs(way.share(way.travelled)) > AT_STOP else Verdict.UNPROVEN
    if abs(way.share(way.travelled)) <= AT_STOP and (went or abs(way.share(way.start)) > AT_STOP):
        return Verdict.STAYED
    if known:
        return Verdict.BEYOND if way.rest < 0 else Verdict.SHORT
    return Verdict.UNPROVEN


# -- homing ----------------------------------------------------------------------------------------------------------


def connect_or_command(hand: AidinHand) -> bool:
    """Find out how the hand speaks; True where that is not known: it only answers commands, or nobody is to look.

    Raises NotIdentified where nothing shows an AIDIN-hand.
    """
    hand.conversation.identify()
    if hand.conversation.way.exchange is ExchangeMode.COMMAND:
        hand.conversation.exchange = ExchangeMode.COMMAND
        return True
    try:
        hand.conversation.connect()
    except NoAnswer:
        hand.conversation.check_bound()
        hand.journal.warn("unasked", "The hand sends nothing without a request. Perhaps it replies only to commands")
        return True
    return False


def home(hand: AidinHand, prompts: Prompts) -> Table:
    """Mode 1 for 3.5 s and nothing else in between, judged per motor (aidin, Modes: homing).

    The hand sets 0 wherever a finger stands: `travel.Verdict` says what shows that each is open. A motor without such a
    proof is a CheckFailed of the table. Raises NoAnswer when the hand says nothing, UsageError for a --deadline before its end.
    """
    bound = hand.conversation.bound
    if bound is not None and bound.remaining < HOLD:
        raise UsageError(
            f"homing takes {HOLD:g} s, and --deadline is shorter", hint="use a longer --deadline. Nothing was sent."
        )
    blind = connect_or_command(hand)
    seen = Travel()
    if not blind:  # before the guard: a hand that has not been driven yet is not stopped
        first = hand.conversation.need(MOTOR_POS)[0]
        seen.note(hand.link.now(), tuple(int(number) for number in first))
    prompts.say(f"Keep clear. Homing: all fingers open for {HOLD:g} s.")
    data = object_of(Mode.HOMING)
    mark = hand.journal.ledger.mark
    with stopped_if_cut_short(hand, prompts, "homing failed, so the hand is not homed. "):
        with stopped_on_error(hand, prompts):
            begin = _hold(hand, data, prompts, seen, blind=blind)
        with in_force(LEFT):
            seen.note(hand.link.now(), _encoders(hand, data, f"homing was sent for {HOLD:g} s", blind=blind))
    return _judged(hand, seen.ways(begin + ZEROED), mark)


def _judged(hand: AidinHand, ways: list[TravelDirection], mark: int) -> Table:
    """A row a motor with its way and verdict; what went wrong, or is not shown, is the failure of the table."""
    values = tuple(way.now for way in ways)
    table = _motors(hand, values)
    for row, way in zip(table.rows, ways, strict=True):
        row |= {"from": way.start, "way": way.travelled, "rest": way.rest, "verdict": way.verdict.value}
    table.columns = (*hand.columns, *WAY)
    table.view = by_motor
    against = [way for way in ways if way.verdict.speaks_against]
    off = [way for way in against if way.verdict is Verdict.OFF]
    unproven = [way for way in ways if way.verdict is Verdict.UNPROVEN]
    if against:
        not_zeroed = NOT_ZEROED if off else ""
        zeroed = f"it set {'the other' if off else 'these'} {ZEROED_THERE}" if len(off) < len(against) else ""
        table.failure = CheckFailed(
            f"{hand.link.name}: homing is not confirmed for {_count(against)}: {_told(against)}",
            hint=joined(LEFT, not_zeroed, zeroed, "free any blocked finger and home again"),
            code="not-homed",
        )
    elif unproven:
        table.failure = CheckFailed(
            f"{hand.link.name}: homing is not confirmed for {_count(unproven)}, because nothing shows that they came to rest at their open stop: {_told(unproven)}",
            hint=f"{LEFT}. Check that all fingers are fully open and that nothing holds them; if so, the hand is homed. To have that confirmed, close the fingers all the way and home again: each motor must go its whole stroke, and the 0 of one that cannot is not its open stop",
            code="homing-unproven",
        )
    else:
        hand.journal.ledger.confirm(
            "each motor came to rest at an earlier 0 or behind its whole stroke, and is at 0", since=mark
        )
        hand.journal.info(
            "homed",
            "homed: each motor came to rest at the 0 of an earlier homing or at the end of its full stroke, and now reads 0. The hand was left in homing mode, and nothing more is sent",
            ""
            if all(way.verdict is Verdict.STROKE for way in ways)
            else "if the hand had not been homed before, check that all fingers are fully open: an obstacle at the 0 of its power-on looks the same",
        )
    return table


def _motors(hand: AidinHand, values: Wire) -> Table:
    """The last encoder values reported."""
    return hand.table([reading(hand.link.name, element, values) for element in MOTOR_POS.each])


def _count(ways: list[TravelDirection]) -> str:
    return f"{len(ways)} of {MOTOR_POS.count} motors"


def _told(ways: list[TravelDirection]) -> str:
    """``ring.m3 hardly moved (way 450, rested at 85000)``, four motors at most."""
    return some([
        f"{MOTOR_POS.elements[way.index]} {way.verdict.value} (way {way.travelled}, rested at {way.rest})" for way in ways
    ])  # fmt: skip


def by_motor(rows: list[Row]) -> list[Grid]:
    """One line a motor: where it was, how far it went, where it rested before 0 was set there, and what that proves."""
    lines: tuple[tuple[str | Cell, ...], ...] = tuple(
        (
            f"{row['finger']}.{row['element']}",
            *(str(row[key]) for key in ("from", "way", "rest", "value")),
            Cell(row["verdict"], "good" if Verdict(row["verdict"]).proof else "warn"),
        )
        for row in rows
    )
    return [Grid(("Motor", "From", "Way", "Rest", "Now", "Verdict"), lines, right=frozenset(range(1, 5)))]


def _hold(hand: AidinHand, data: bytes, prompts: Prompts, seen: Travel, *, blind: bool) -> float:
    """Send mode 1 until it was held; when that began."""
    link, conversation = hand.link, hand.conversation
    begin = last = link.now()
    if conversation.guard is not None:
        conversation.guard.sets_origin = begin + ZEROED
    holds = 1
    while link.now() - begin < HOLD:
        streams = hand.conversation.exchange is ExchangeMode.STREAM
        conversation.tick(data, blind=blind or streams, by=MOTOR_POS)
        if streams:
            conversation.check_alive()
        now = link.now()
        seen.look(now, conversation.feedback)
        if now - last > LARGEST_GAP:
            if holds == HOLDS:
                raise CheckFailed(
                    f"{link.name}: homing was delayed repeatedly, the last time by {now - last:.2f} s",
                    hint="close other programs and home again, because homing needs a command at least every 0.25 s",
                    code="interrupted-hold",
                )
            holds, begin = holds + 1, now
            hand.journal.warn("interrupted-hold", f"homing was delayed by {now - last:.2f} s and starts again")
        last = now
        prompts.progress(f"Homing {min(HOLD, now - begin):.1f} of {HOLD:g} s, the fingers are opening.", CTRL_C)
    return begin


def _encoders(hand: AidinHand, data: bytes, what: str, *, blind: bool) -> tuple[int, ...]:
    """The encoders from now on, `what` having been sent; a hand that only answers commands sends them with its reply to `data`.

    Raises NoAnswer, ProtocolError.
    """
    conversation = hand.conversation
    if not blind:
        found = conversation.refresh((MOTOR_POS,))[MOTOR_POS.key]
    else:
        conversation.feedback = Feedback()
        conversation.tick(data, blind=True)
        if MOTOR_POS.key not in conversation.feedback.seen:
            raise NoAnswer(
                f"{hand.link.name}: {what}, but the hand does not reply, so it is not confirmed",
                hint=f"check the address and the port ({FAMILIES['aidin'].tcp_port}), and that no other client is connected to the hand",
            )
        found = conversation.feedback.result(MOTOR_POS.key)
    return tuple(int(number) for number in conversation.usable(MOTOR_POS, found))


def _away(encoders: tuple[int, ...]) -> list[int]:
    """Motors that are not within 1 % of their stroke of the origin."""
    return [index for index, value in enumerate(encoders) if abs(value) > stroke(index) * AT_ORIGIN]


def named(param: AidinParam, indices: list[int], values: tuple[Number, ...] | list[Number]) -> str:
    return some([f"{param.elements[index]} {values[index]:.{param.places}f}" for index in indices])


def check_homed(hand: AidinHand, *, assume: bool | None) -> None:
    """Refuse position commands if encoders are outside their ranges, because the hand does not report whether it was homed.

    `assume` goes on all the same; None = the command cannot be told to.
    Raises CheckFailed; nothing has been sent then.
    """
    (encoders,) = hand.conversation.need(MOTOR_POS)
    wrong = [index for index, value in enumerate(encoders) if outside(MOTOR_POS, index, value)]
    if wrong and not assume:
        raise CheckFailed(
            f"{hand.link.name}: encoders are out of range, so the hand has not been homed since power-on: "
            f"{named(MOTOR_POS, wrong, encoders)}",
            hint=Hint(
                f"run {{}} first. {'' if assume is None else '--assume-homed continues without it. '}Nothing was sent.",
                "aidin home",
            ),
            code="not-homed",
        )
    if not any(encoders):
        hand.journal.warn("homed-unknown", ALL_ZERO, hint=REMEDIES["all-zero"].hint)
        return
    hand.journal.info(
        "homed-unknown",
        "The hand does not report whether it has been homed since power-on. This command needs a homed hand",
    )


def initial(hand: AidinHand, prompts: Prompts, *, assume_homed: bool) -> Table:
    """Mode 2 until every encoder is within 1 % of its stroke of 0, 5 s at most. Raises CheckFailed, NoAnswer."""
    conversation = hand.conversation
    blind = connect_or_command(hand)
    if not blind:
        check_homed(hand, assume=assume_homed)
    elif not assume_homed:
        raise NoAnswer(
            f"{hand.link.name}: the hand sends nothing without a request, so nothing shows that it is homed",
            hint=Hint("run {} first. --assume-homed continues without it. Nothing was sent.", "aidin home"),
        )
    data, end = object_of(Mode.INITIAL), conversation.deadline(INITIAL)
    seen, ledger = Travel(), hand.journal.ledger
    mark = ledger.mark
    with stopped_if_cut_short(hand, prompts), stopped_on_error(hand, prompts, ImplausibleFeedback, otherwise=GOES_ON):
        arrived = False
        while not arrived and not end.expired:
            before = seen.last
            for _ in range(TICKS):
                conversation.tick(data, blind=blind, by=MOTOR_POS)
            new = seen.look(conversation.link.now(), conversation.feedback)
            # two readings show that it stands still, not one reading twice
            arrived = new and seen.last is not None and not (_away(seen.last) or moving(before, seen.last))
            prompts.progress("Moving to the initial position.", CTRL_C)
        conversation.check_bound()
        now = _encoders(hand, data, "the initial position was commanded", blind=blind)
        seen.note(conversation.link.now(), now)
    if _away(now):
        raise CheckFailed(
            f"{hand.link.name}: the initial position was not reached: {named(MOTOR_POS, _away(now), now)}",
            hint=f"{GOES_ON}. A hand that has not been homed ignores the command. A blocked finger or a low maximum torque may also be the cause",
            code="not-reached",
        )
    if seen.moved:
        ledger.confirm("the motors moved and are at 0", since=mark)
    else:
        hand.journal.warn(
            "nothing-moved",
            "the encoders are at 0, but no motor moved. Either the fingers were already there, or the hand has not been homed since power-on and ignored the command",
            hint=Hint("check the fingers, and run {} if they are not open", "aidin home"),
        )
    return _motors(hand, now)


# -- sensor bias, maximum torque ------------------------------------------------------------------------------------


BIAS_SECONDS, MAX_TORQUE_SECONDS = 0.5, 0.2
"""How long the objects of these modes are sent."""
AT_REST = 0.2
"""Seconds between two looks at sensors and motors, and before the first behind a bias."""
CONFIRM = 1.0
NOISE = 4.0
"""A value so many times what it changes by itself is no noise."""
USUAL = 3.0
"""It may change so many times more than the median of its kind, the forces or the torques."""
SENSOR_STATE = AIDIN["sensor_state"]


def bias(hand: AidinHand) -> Table:
    """Mode 4 for 0.5 s; rows have the values `before` and after. Refused while a motor moves.

    Raises CheckFailed when a motor moves, or when a value did not come nearer to 0.
    """
    conversation = hand.conversation
    first, earlier = conversation.need(MOTOR_POS, SENSOR_STATE)
    hand.link.sleep(AT_REST)
    second, before = conversation.need(MOTOR_POS, SENSOR_STATE)
    restless = moving(first, second)
    if restless:
        raise CheckFailed(
            f"{hand.link.name}: {named(MOTOR_POS, restless, second)}: moving, so a load would be mistaken for the sensor offset",
            hint="wait until the hand has stopped and touches nothing. Nothing was sent.",
            code="moving",
        )
    ledger = hand.journal.ledger
    begun = ledger.mark
    sent = "the sensor bias was sent, so any load on the fingertips may read as 0 from now on"
    left = f"{sent}; {left_in(Mode.BIAS)}"
    stops = stopped_on_error(hand, Prompts(), ImplausibleFeedback, otherwise=left)  # nothing is shown meanwhile
    with conversation.guarded(leaps=False), on_early_end(Aftermath(hint=left), by=Interrupted), stops:
        data, end = object_of(Mode.BIAS), conversation.deadline(BIAS_SECONDS)
        while not end.expired:
            conversation.tick(data)
        conversation.check_bound()
        end = conversation.deadline(CONFIRM)
        table, worse = _compared(hand, before, earlier)
        while worse and not end.expired:
            hand.link.sleep(AT_REST)
            table, worse = _compared(hand, before, earlier)
        conversation.check_plausible()
    hand.journal.info("left", left_in(Mode.BIAS), LEFT_HINT)
    if worse and table.failure is None:
        table.failure = CheckFailed(
            f"{hand.link.name}: sensor values did not get closer to 0: {', '.join(worse[:4])}",
            hint=Hint("remove any load from the fingertips, then run {} again", "aidin bias"),
            code="not-biased",
        )
    nearer = any(abs(row["value"]) < abs(row["before"]) for row in table.rows if "value" in row)
    if table.failure is None and nearer:
        ledger.confirm("the sensor values got closer to 0", since=begun)
    elif table.failure is None:
        hand.journal.warn(
            "unproven",
            "The bias was sent, but no sensor value changed, so the feedback does not show that it took effect",
        )
    return table


def _compared(hand: AidinHand, before: Wire, earlier: Wire) -> tuple[Table, list[str]]:
    """The sensors now and `before`, and those that did not get closer to 0 than noise explains."""
    table = hand.table(hand.read(SENSOR_STATE.each))
    table.columns = (*hand.columns[:3], Column("before", "Before", right=True), *hand.columns[3:])
    worse = []
    changes = [abs(old - older) for old, older in zip(before, earlier, strict=True)]
    for index, (row, old) in enumerate(zip(table.rows, before, strict=True)):
        row["before"] = old
        kind = SENSOR_STATE.label_of(index)[
            0
        ]  # a force or a torque: one change by chance may be far smaller than the noise
        same = sorted(change for at, change in enumerate(changes) if SENSOR_STATE.label_of(at)[0] == kind)
        noise = NOISE * max(changes[index], USUAL * same[len(same) // 2])
        if "value" in row and abs(row["value"]) >= abs(old) and abs(row["value"]) > noise:
            worse.append(f"{row['finger']}.{row['element']} {old:g} to {row['value']:g}")
    return table, worse


def max_torque(hand: AidinHand, value: int) -> Table:
    """Mode 5 with `maxtorque`, for 0.2 s. No feedback shows it. Raises NoAnswer when the hand says nothing afterwards."""
    blind = connect_or_command(hand)
    data, end = object_of(Mode.MAXTORQUE, maxtorque=value), hand.conversation.deadline(MAX_TORQUE_SECONDS)
    sent = f"maxtorque {value} was sent and may be in effect, but it cannot be read back"
    with in_force(f"{sent}; {left_in(Mode.MAXTORQUE)}", moving=False):
        while not end.expired:
            hand.conversation.tick(data, blind=blind)
        if not blind:
            hand.conversation.check_answered()
        hand.conversation.check_bound()
    hand.journal.info("left", left_in(Mode.MAXTORQUE), LEFT_HINT)
    if blind and not hand.conversation.feedback.seen:
        raise NoAnswer(
            f"{hand.link.name}: maxtorque {value} was sent, but the hand does not reply",
            hint=f"check the address and the port ({FAMILIES['aidin'].tcp_port}), and that no other client is connected to the hand",
        )
    hand.journal.info(
        "not-read-back", "The maximum torque was sent. The hand does not report it, so it cannot be read back"
    )
    param = AIDIN["maxtorque"]
    row: Row = {
        "name": param.name,
        "key": param.key,
        "finger": None,
        "element": None,
        "value": value,
        "unit": param.unit,
    }
    return Table(rows=[row], columns=(hand.columns[0], *hand.columns[3:]), plain=("value",))
