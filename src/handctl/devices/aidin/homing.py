"""Homing and the initial position of the AIDIN-hand (aidin, Modes), proved by the encoders.

The encoders are incremental: homing makes the open position their origin, and a power cycle loses it. The hand does not
tell whether it is homed.
"""

from __future__ import annotations

from handctl.devices.aidin.device import AidinHand, outside, reading
from handctl.devices.aidin.feedback import Feedback
from handctl.devices.aidin.map import AIDIN, AidinParam, Mode
from handctl.devices.aidin.stop import in_force, object_of, stop_after, stopped_if_cut_short
from handctl.devices.aidin.way import ExchangeMode
from handctl.errors import CheckFailed, HandctlError, NoAnswer, UsageError
from handctl.model.guide import CTRL_C, Guide
from handctl.model.param import Number, elements_of
from handctl.model.result import Table

HOLD = 3.5
"""Seconds of homing: the documented 3 and a reserve."""
LARGEST_GAP = 0.25
"""A longer pause between two homing objects may count as an interruption: the hold begins again."""
HOLDS = 3
INITIAL = 5.0
AT_ORIGIN = 0.01
AT_STOP = 0.02
"""Share of a stroke within which a motor counts as at its stop before homing."""
LEAP = 3
"""A motor that changes so many times faster than just before, from one look to the next, was not driven there."""
TICKS = 5
STILL = 0.001
"""Share of a stroke that a motor may change from one look to the next and still stand."""
LEFT = "the hand was left in homing mode, no stop was sent"
GOES_ON = "no stop was sent, the hand is expected to go on to its origin. `handctl aidin stop` frees it"
MOTOR_POS = AIDIN["motor_pos"]


def connect_or_command(hand: AidinHand) -> bool:
    """Find out how the hand speaks; True where that is not known: it only answers commands, or nobody is to look.

    Raises NotIdentified where nothing shows an AIDIN-hand.
    """
    hand.talk.identify()
    if hand.talk.way.exchange is ExchangeMode.COMMAND:
        hand.talk.exchange = ExchangeMode.COMMAND
        return True
    try:
        hand.talk.connect()
    except NoAnswer:
        hand.talk.check_bound()
        hand.journal.warn("unasked", "The hand sends nothing unless it is asked. Perhaps it answers commands only")
        return True
    return False


def home(hand: AidinHand, guide: Guide) -> Table:
    """Mode 1 for 3.5 s and nothing else in between, judged per motor (aidin, Modes: homing).

    Each must have moved, or have been at its stop already, and then be near 0: the hand sets 0 wherever a finger stands.
    Raises CheckFailed naming those that are not, NoAnswer when the hand says nothing, UsageError for a --deadline before its end.
    """
    bound = hand.talk.bound
    if bound is not None and bound.remaining < HOLD:
        raise UsageError(
            f"homing takes {HOLD:g} s, --deadline leaves less", hint="give a longer --deadline. Nothing was sent."
        )
    blind = connect_or_command(hand)
    seen = _Travel()
    if not blind:  # before the guard: a hand that has not been driven yet is not stopped
        seen.note(tuple(int(number) for number in hand.talk.need(MOTOR_POS)[0]))
    guide.say(f"Keep clear. Homing: all fingers open for {HOLD:g} s.")
    data = object_of(Mode.HOMING)
    mark = hand.journal.ledger.mark
    with stopped_if_cut_short(hand, guide, "homing failed, the hand is not homed. "):
        try:
            _hold(hand, data, guide, seen, blind=blind)
        except HandctlError as exc:
            stop_after(hand, exc)
            raise
        finally:
            guide.done()
        with in_force(LEFT):
            now = _origin(hand, data, blind=blind)
        seen.note(now)
    off = _away(now)
    if off:
        raise CheckFailed(
            f"{hand.link.name}: homing is not confirmed, encoders are not at 0: {named(MOTOR_POS, off, now)}",
            hint=f"{LEFT}. Free any blocked finger, look with `handctl aidin status`, and home again",
            code="not-homed",
        )
    _judge_travel(hand, seen, mark)
    return hand.table(hand.read(elements_of(MOTOR_POS))) if not blind else _last_known(hand)


def _judge_travel(hand: AidinHand, seen: _Travel, mark: int) -> None:
    """All encoders are at 0 now; whether the fingers are open is told by the way there. Raises CheckFailed."""
    first = seen.first or ()
    stood = [index for index in range(len(first)) if index not in seen.moved]
    held = [index for index in stood if abs(first[index]) > stroke(index) * AT_STOP]
    if held:
        raise CheckFailed(
            f"{hand.link.name}: not homed: {len(held)} of {len(first)} motors never moved, the hand set 0 where they "
            f"stood: {named(MOTOR_POS, held, first)} before",
            hint=f"every target of such a motor is off by what it was away from open. {LEFT}. Free the finger and home "
            "again. One that was fully open before homing passes then",
            code="not-homed",
        )
    if stood and not any(first):  # as after power-on: 0 wherever the fingers are
        who = "no motor moved" if len(stood) == len(first) else f"these did not move: {named(MOTOR_POS, stood, first)}"
        hand.journal.warn(
            "nothing-moved",
            f"not confirmed: the encoders were 0 before and are 0 now, and {who}. They were open already, or are blocked, "
            "or did not take the command (just switched on, the encoders are 0 wherever the fingers are)",
            hint="check that the fingers are fully open",
        )
        return
    hand.journal.ledger.confirm("each motor moved or was at its stop, and is at 0", since=mark)
    hand.journal.info(
        "homed",
        "homed: each motor moved or was at its stop already, and is at 0 now. The hand was left in homing mode, nothing "
        "more is sent",
    )


class _Travel:
    """The way of each encoder since it was first told. A jump to 0 is no way: so the hand sets the origin."""

    def __init__(self) -> None:
        self.first: tuple[int, ...] | None = None
        self.moved: set[int] = set()
        self._last: tuple[int, ...] = ()
        self._step: list[int] = []

    def note(self, encoders: tuple[int, ...] | None) -> None:
        """Encoders as they are now; None = not told."""
        if encoders is None:
            return
        if self.first is None:
            self.first, self._last, self._step = encoders, encoders, [0] * len(encoders)
        for index in moving(self._last, encoders):
            before, now = self._last[index], encoders[index]
            near = stroke(index) * AT_ORIGIN
            fast = abs(now - before) > LEAP * max(abs(self._step[index]), near)
            if not (fast and abs(now) <= near):
                self.moved.add(index)
        self._step = [now - before for before, now in zip(self._last, encoders, strict=True)]
        self._last = encoders


def _hold(hand: AidinHand, data: bytes, guide: Guide, seen: _Travel, *, blind: bool) -> None:
    link, talk = hand.link, hand.talk
    begin = last = link.now()
    holds = 1
    while link.now() - begin < HOLD:
        streams = hand.talk.exchange is ExchangeMode.STREAM
        talk.tick(data, blind=blind or streams, by=MOTOR_POS)
        if streams:
            talk.check_alive()
        seen.note(_encoders(talk.feedback))
        now = link.now()
        if now - last > LARGEST_GAP:
            if holds == HOLDS:
                raise CheckFailed(
                    f"{link.name}: homing was delayed again and again, the last time for {now - last:.2f} s",
                    hint="close other programs and home again: homing needs a command at least every 0.25 s",
                    code="interrupted-hold",
                )
            holds, begin = holds + 1, now
            hand.journal.warn("interrupted-hold", f"homing was delayed for {now - last:.2f} s and begins again")
        last = now
        guide.progress(f"Homing {min(HOLD, now - begin):.1f} of {HOLD:g} s, the fingers open.", CTRL_C)


def _origin(hand: AidinHand, data: bytes, *, blind: bool) -> tuple[int, ...]:
    """The encoders after the hold; a hand that only answers commands has told them with its answers."""
    talk = hand.talk
    if not blind:
        found = talk.refresh((MOTOR_POS,))[MOTOR_POS.key]
    else:
        talk.feedback = Feedback()
        talk.tick(data, blind=True)
        if MOTOR_POS.key not in talk.feedback.seen:
            raise NoAnswer(
                f"{hand.link.name}: homing was sent for {HOLD:g} s, but the hand says nothing: it is not confirmed",
                hint="check address and port (8000), and that no other client holds the hand",
            )
        found = talk.feedback.result(MOTOR_POS.key)
    return tuple(int(number) for number in talk.usable(MOTOR_POS, found))


def _away(encoders: tuple[int, ...]) -> list[int]:
    """Motors that are not within 1 % of their stroke of the origin."""
    return [index for index, value in enumerate(encoders) if abs(value) > stroke(index) * AT_ORIGIN]


def stroke(index: int) -> float:
    limit = MOTOR_POS.limit(index)
    assert limit is not None
    return limit[1] - limit[0]


def moving(before: tuple[Number, ...] | None, now: tuple[Number, ...]) -> list[int]:
    """Motors whose encoder has changed by more than jitter; all of them without a look before."""
    if before is None:
        return list(range(len(now)))
    return [i for i, (a, b) in enumerate(zip(before, now, strict=True)) if abs(b - a) > stroke(i) * STILL]


def named(param: AidinParam, indices: list[int], values: tuple[Number, ...] | list[Number]) -> str:
    shown = ", ".join(f"{param.elements[index]} {values[index]:.{param.places}f}" for index in indices[:4])
    return shown + (f" and {len(indices) - 4} more" if len(indices) > 4 else "")


def _last_known(hand: AidinHand) -> Table:
    values = hand.talk.feedback.values[MOTOR_POS.key]
    return hand.table([reading(hand.link.name, element, values) for element in elements_of(MOTOR_POS)])


def check_homed(hand: AidinHand, *, assume: bool) -> None:
    """Refuse position commands to encoders outside their ranges: the hand cannot tell whether it was homed.

    Raises CheckFailed; nothing has been sent then.
    """
    (encoders,) = hand.talk.need(MOTOR_POS)
    wrong = [index for index, value in enumerate(encoders) if outside(MOTOR_POS, index, value)]
    if wrong and not assume:
        raise CheckFailed(
            f"{hand.link.name}: encoders are out of their range, the hand was not homed since power-on: "
            f"{named(MOTOR_POS, wrong, encoders)}",
            hint="run `handctl aidin home` first. --assume-homed goes on without it. Nothing was sent.",
            code="not-homed",
        )
    if not any(encoders):
        hand.journal.warn(
            "homed-unknown",
            "all encoders are exactly 0: as just after homing, and as just after power-on wherever the fingers are",
            hint="run `handctl aidin home` first unless it was homed since power-on",
        )
        return
    hand.journal.info(
        "homed-unknown", "The hand does not report whether it was homed since power-on. This command needs a homed hand"
    )


def initial(hand: AidinHand, guide: Guide, *, assume_homed: bool) -> Table:
    """Mode 2 until every encoder is within 1 % of its stroke of 0, 5 s at most. Raises CheckFailed, NoAnswer."""
    talk = hand.talk
    blind = connect_or_command(hand)
    if not blind:
        check_homed(hand, assume=assume_homed)
    elif not assume_homed:
        raise NoAnswer(
            f"{hand.link.name}: the hand sends nothing unasked, so nothing shows that it is homed",
            hint="run `handctl aidin home` first. --assume-homed goes on without it. Nothing was sent.",
        )
    data, end = object_of(Mode.INITIAL), talk.deadline(INITIAL)
    seen, ledger = _Travel(), hand.journal.ledger
    mark = ledger.mark
    now: tuple[int, ...] | None = None
    before: tuple[int, ...] | None = None
    with stopped_if_cut_short(hand, guide), in_force(GOES_ON):
        try:
            while not end.expired and (now is None or _away(now) or moving(before, now)):
                before = now
                for _ in range(TICKS):
                    talk.tick(data, blind=blind, by=MOTOR_POS)
                now = _encoders(talk.feedback) or now
                seen.note(now)
                guide.progress("Moving to the initial position.", CTRL_C)
        finally:
            guide.done()
        talk.check_bound()
        if now is None:
            raise NoAnswer(
                f"{hand.link.name}: the initial position was commanded, but the hand sends nothing",
                hint="check the link with `handctl aidin status`",
            )
    if _away(now):
        raise CheckFailed(
            f"{hand.link.name}: the initial position was not reached: {named(MOTOR_POS, _away(now), now)}",
            hint=f"{GOES_ON}. A hand that was not homed ignores the command. A blocked finger or a low maximum torque stops it too",
            code="not-reached",
        )
    if seen.moved:
        ledger.confirm("the motors moved and are at 0", since=mark)
    else:
        hand.journal.warn(
            "nothing-moved",
            "the encoders are at 0, but no motor moved: the fingers were there already, or the hand was not homed since "
            "power-on and ignored it",
            hint="look at the fingers, and run `handctl aidin home` if they are not open",
        )
    return hand.table(hand.read(elements_of(MOTOR_POS))) if not blind else _last_known(hand)


def _encoders(feedback: Feedback) -> tuple[int, ...] | None:
    if MOTOR_POS.key in feedback.errors or MOTOR_POS.key not in feedback.values:
        return None
    return tuple(int(number) for number in feedback.values[MOTOR_POS.key])
