"""The first signs of harm, looked for before and after every movement of `first-light` and `prove` (barrett §2, §5.3.4, §5.4.1).

Heat by TEMP or by a motor's status, a harmful setting, a movement the wrong way, a position or a temperature that cannot be
read, and a line that was disturbed while something moved. Each is a `SignOfHarm`: nothing moves after it.
"""

from __future__ import annotations

from handctl.devices.barrett import motion
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.gcl.status_codes import NOT_INITIALIZED, OVER_TEMPERATURE, shows_heat
from handctl.devices.barrett.maintenance import health_limits
from handctl.devices.barrett.parameter_map import implausible, unmeasured
from handctl.errors import Aftermath, DeviceRefused, HandctlError, Hint, NoAnswer
from handctl.model.check_rows import FAIL
from handctl.model.movement import ENDED, REACHED
from handctl.model.prompts import Prompts
from handctl.model.proofs import SignOfHarm, damage
from handctl.model.result import Row

WRONG_WAY = 25
"""Counts to the other side of its start by which a motor has gone the wrong way: half of MPE as shipped."""
CHECK_CABLE = Hint("check the cable with {}, then run it again", "doctor")
READ_AGAIN = Hint(
    "check the cable with {}, then run the command again. Nothing moves until this value can be read", "doctor"
)
At = dict[tuple[str, "str | None"], int]


def refuse_heat(hand: BarrettHand, at: At) -> None:
    """Raise SignOfHarm where the status of a motor, among the values `at`, has the over-temperature bit."""
    if hot := [motor for motor in MOTORS if at.get(("S", motor), 0) & OVER_TEMPERATURE]:
        text = f"{hand.link.name}: the status of {', '.join(hot)} shows over-temperature ({OVER_TEMPERATURE}, barrett §5.4.1)"
        raise SignOfHarm(text, hint=health_limits.COOL, code="hot")


def heat(hand: BarrettHand) -> tuple[int, int]:
    """TEMP, and the limit that holds for this hand, in 0.1 °C. Raises SignOfHarm where TEMP is no temperature of a board."""
    at = hand.by_name("TEMP", "OTEMP", dispensable=("OTEMP",))
    now, limit = at["TEMP", None], at.get(("OTEMP", None), 0)
    if unmeasured(now):
        text = f"{hand.link.name}: TEMP {now / 10:.1f} °C is impossible, so overheating cannot be detected (barrett §5.4.2)"
        raise SignOfHarm(text, hint=health_limits.NO_SENSOR, code="unread")
    return now, health_limits.limit_of(limit)


def objections(at: At) -> list[str]:
    """Settings with which nothing is moved: beyond a limit that harms, outside their range, or not read (barrett §5.3.4)."""
    absent = [name for name in health_limits.NEEDED_TO_MOVE if any((name, motor) not in at for motor in MOTORS)]
    missing = [f"{', '.join(absent)} could not be read"] if absent else []
    return [*missing, *dict.fromkeys(one.evidence for one in health_limits.settings(at) if one.status == FAIL)]


def look_for_harm(hand: BarrettHand) -> At:
    """Everything that shows harm, read now: S, P and the harmful settings of all motors.

    Raises SignOfHarm for heat and for what this hand refuses to say; whatever the line raises.
    """
    try:
        now, limit = heat(hand)
        at = hand.by_name("S", "P", *health_limits.READ_BEFORE_MOVING, dispensable=health_limits.READ_BEFORE_MOVING)
    except DeviceRefused as exc:
        text = f"{exc.text}. Without this reading, handctl cannot detect damage"
        raise SignOfHarm(text, hint=READ_AGAIN, code="hot" if shows_heat(exc) else "unread") from exc
    if now > limit:
        text = f"{hand.link.name}: {now / 10:.1f} °C, and the limit is {limit / 10:.1f} °C (barrett §2)"
        raise SignOfHarm(text, hint=health_limits.COOL, code="hot")
    refuse_heat(hand, at)
    return at


def driven(
    hand: BarrettHand, prefix: str, name: str, argument: int | None, prompts: Prompts
) -> tuple[list[Row], float]:
    """One movement between two looks: its rows and seconds.

    Raises SignOfHarm, with the hand stopped; what the hand refuses, and a motor that ended as none should; Interrupted.
    """
    try:
        return _between_looks(hand, prefix, name, argument, prompts)
    except SignOfHarm as exc:
        stop(hand, exc)
        raise


def _between_looks(
    hand: BarrettHand, prefix: str, name: str, argument: int | None, prompts: Prompts
) -> tuple[list[Row], float]:
    before = _unharmed(hand)
    calm = damage(hand.journal.counters)
    table = motion.move(hand, prefix, name, argument, prompts, expect=ENDED)
    after = _unharmed(hand)
    text = f"{hand.link.name}: {motion.command_text(prefix, name, argument)}"
    if damage(hand.journal.counters) != calm:
        told = f"{text}: the line was disturbed during the movement, so how it ended is unknown"
        raise SignOfHarm(told, hint=CHECK_CABLE, code="disturbed")
    for row in table.rows:
        _judge_way(text, name, row, before, after)
    if table.failure is not None:
        raise table.failure
    return table.rows, table.seconds


def _unharmed(hand: BarrettHand) -> At:
    at = look_for_harm(hand)
    if harmful := objections(at):
        text = f"{hand.link.name}: handctl moves nothing with these settings: {'; '.join(harmful[:3])}"
        raise SignOfHarm(text, hint=Hint("{} lists checks and remedies", "barrett diagnose"), code="settings")
    return at


def _judge_way(text: str, name: str, row: Row, before: At, after: At) -> None:
    """Raise SignOfHarm for a motor that is where it cannot be, or on the other side of its start than was commanded."""
    motor, goal = row["motor"], row["target"]
    start, end = before["P", motor], after["P", motor]
    if after["S", motor] & NOT_INITIALIZED:  # its position means nothing
        return
    hint = Hint("switch the power supply off, then see {}", "barrett diagnose")
    if implausible(MOTORS.index(motor), end):
        raise SignOfHarm(f"{text}: {motor} reads {end}, where it cannot be", hint=hint, code="unread")
    if before["S", motor] & NOT_INITIALIZED or name == "HI" or row["arrival"] == REACHED:
        return
    way = motion.TORQUE.get(name) or (0 if goal is None else goal - start)
    gone = end - start if way < 0 else start - end
    if way and gone > WRONG_WAY:
        told = f"{text}: {motor} moved the wrong way, from {start} to {end}"
        raise SignOfHarm(told, hint=hint, code="wrong-way")


def stop(hand: BarrettHand, error: HandctlError) -> None:
    """^C, and the power off all motors, once for each `error`, which gets what the replies show of it, and no more."""
    if isinstance(error, SignOfHarm):
        if error.stopped:
            return
        error.stopped = True
    stopped = hand.stop()
    if stopped.error is None:
        text = f"The hand was stopped: {stopped.text}"
    elif issubclass(stopped.error, NoAnswer):
        text = "The stop was sent (^C and T), but the hand did not reply: it may still be moving"
    else:
        text = f"The stop was sent (^C and T), but no reply shows that it worked: the hand may still be moving. {stopped.text}"
    error.add_aftermath(Aftermath(text, stopped.hint))
