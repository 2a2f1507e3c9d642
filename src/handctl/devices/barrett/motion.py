"""Movements: send one, wait for its prompt, report how it ended for each motor (barrett §5.2.1, §5.5).

A supervisory movement blocks the line: no position can be read while it runs. ^C ends it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS, Answer, encode, motor_prefix, split
from handctl.devices.barrett.gcl.status_codes import NOT_REACHED, OVER_TEMPERATURE, explain_status, hint_for
from handctl.devices.barrett.parameter_map import (
    BARRETT,
    NO_GAUGE,
    OFF,
    TRAVEL,
    gcl_name,
    implausible,
    quickest_opening,
    travel_seconds,
)
from handctl.devices.barrett.status_and_parameter_views import MOTOR, NOT_HOMED, row_of, why_impossible
from handctl.devices.barrett.stopper import CTRL_C_KEEPS_POWER, stands, stop_steps
from handctl.errors import Aftermath, CheckFailed, DeviceRefused, Hint, NoAnswer, ProtocolError, UsageError
from handctl.fast_classes import fast_dataclass
from handctl.model.movement import (
    ARRIVAL,
    ASTRAY,
    BLOCKED,
    CONTACT,
    REACHED,
    SHORT,
    UNMOVED,
    UNREAD,
    Arrival,
    Goal,
    failure_of_arrivals,
    is_astray,
)
from handctl.model.param import Reading, Step
from handctl.model.prompts import CTRL_C, Prompts
from handctl.model.result import Column, Row, Table
from handctl.model.stop_sequence import Stopped, run_stop, sent_again
from handctl.number_parsing import number_in

GOALS = {"C": "CT", "O": "OT", "M": "DP"}
"""Where a movement without argument goes."""
NEEDED = {
    "O": ("OT", "CT", "P"),
    "C": ("CT", "OT", "P"),
    "M": ("DP", "P"),
    "IO": ("P", "DS"),
    "IC": ("P", "DS"),
    "HOME": ("P",),
    "TO": ("P",),
    "TC": ("P",),
}
"""What is asked before a movement for its goal; IVEL and the velocity follow, for what would harm."""
VELOCITIES = {"O": ("MOV",), "IO": ("MOV",), "TO": ("MOV",), "HOME": ("MOV",), "M": ("MOV", "MCV"), "HI": ("IVEL",)}
"""Which velocity a movement uses (barrett §5.2.1); the others close, with MCV."""
COLUMNS = (
    MOTOR,
    Column("value", "Position", right=True),
    Column("target", "Target", right=True),
    Column("strain", "Strain", right=True),
    Column("ended", "Ended"),
    ARRIVAL,
)
TORQUE = {"TC": 1, "TO": -1}
"""Movements that end at a stall: they have no target (barrett §5.5). Which way they go: 1 closes."""


def command_text(prefix: str, name: str, argument: int | None) -> str:
    """The GCL line of a movement, checked: 0 to 20000 (barrett §5.2.1). Raises UsageError."""
    if argument is not None and not 0 <= argument <= 20000:
        raise UsageError(
            f"{name} {argument} is out of range",
            hint="use 0 to 20000 counts (barrett §5.2.1). Nothing was sent.",
            code="out-of-range",
        )
    return f"{prefix}{name}" + (f" {argument}" if argument is not None else "")


Goals = list[tuple[str, "int | None"]]
"""Motors as a prefix and where they go, None = where their parameter says. Those of one line move together."""


def goals_of(texts: Sequence[str], prefix: str, name: str) -> Goals:
    """``["9000"]`` for the motors of `prefix`, or ``["F1=9000", "F2=9000", "F3=500"]``: motors that go to the same place move together.

    Raises UsageError.
    """
    pairs = [(motor_prefix(motor), value) for motor, sign, value in (text.partition("=") for text in texts) if sign]
    if not pairs and len(texts) <= 1:
        return [(prefix, _counts(texts[0], name) if texts else None)]
    if prefix or len(pairs) < len(texts):
        hint = "give one value for all of --motors, or MOTOR=VALUE for each, such as F1=9000 F2=9000"
        raise UsageError("more than one value", hint=f"{hint}. Nothing was sent.", code="mixed")
    found: dict[int, str] = {}
    for motors, value in pairs:
        if again := set(motors) & set("".join(found.values())):
            raise UsageError(
                f"{MOTORS[int(min(again)) - 1]} is given twice", hint="leave one of them out. Nothing was sent."
            )
        counts = _counts(value, name)
        found[counts] = "".join(sorted(found.get(counts, "") + motors))
    return [(motors, counts) for counts, motors in found.items()]


def _counts(text: str, name: str) -> int:
    number = number_in(text)
    if number is None:
        raise UsageError(
            f"{name} {text}: not a whole number", hint="give counts. Nothing was sent.", code="not-a-number"
        )
    return number


def move_each(
    hand: BarrettHand, goals: Goals, name: str, prompts: Prompts, *, force: bool = False, expect: str = REACHED
) -> Table:
    """Run a movement for each, one after the other; what speaks against any of them is found before the first. It ends with the first that failed."""
    for motors, counts in goals[1:] and goals:
        _before(hand, name, counts, _indices(motors), force)
    rows: list[Row] = []
    for motors, counts in goals:
        table = move(hand, motors, name, counts, prompts, force=force, expect=expect)
        table.rows = rows = rows + table.rows
        if table.failure is not None:
            break
    return table


def _indices(prefix: str) -> list[int]:
    return [index for index in range(4) if not prefix or str(index + 1) in prefix]


@fast_dataclass()
class MovedTable(Table):
    """The rows of a movement, and the seconds from its command to its prompt."""

    seconds: float = 0.0


def move(
    hand: BarrettHand,
    prefix: str,
    name: str,
    argument: int | None,
    prompts: Prompts,
    *,
    force: bool = False,
    expect: str = REACHED,
) -> MovedTable:
    """Run a movement of `prefix` ("" = all enabled motors); rows per motor with position, goal, strain and how it ended.

    What the hand refuses, and a motor that did not end as expected, is the table's failure. Raises UsageError for an opening faster than IVEL may be, and for targets that turn it around, unless `force`;
    DeviceRefused for ERR 4 and other refusals; Interrupted after Ctrl-C, with where the motors are.
    """
    text = command_text(prefix, name, argument)
    motors = _indices(prefix)
    hand.line.connect()
    for index in motors:
        if argument is not None and argument > (most := TRAVEL[index == 3]):
            whose = "the spread" if index == 3 else "a finger"
            hand.journal.warn("beyond", f"{argument} is beyond the usual {most} counts of {whose}")
    goals, usual, starts = _before(hand, name, argument, motors, force)
    prompts.progress(f"{text}: moving. The hand sends nothing until it stops.", CTRL_C)
    with hand.driven(prompts, powered=CTRL_C_KEEPS_POWER):
        began = hand.link.now()
        answer = hand.line.ask(text, at_least=3 * usual)
        seconds = hand.link.now() - began
        hand.line.check_ended(text)
        strain = hand.read(BARRETT.elements("SG", motors=motors))  # first: it relaxes when the motor is off (dossier 5)
        check_standing_after(hand, answer)
        prompts.done()
        try:
            rows, arrivals = _result(hand, name, answer, strain, motors, goals, starts, all_motors=not prefix)
            if answer.status:
                _note_end(hand, answer, rows)
        except (NoAnswer, ProtocolError) as exc:
            exc.text = f"{text} ended with status {answer.status}, but the positions could not be read: {exc.text}"
            raise
    # That a place was not reached (16) is told for some movements only (barrett §5.5): each motor is judged by where it is.
    missed = answer.status == NOT_REACHED
    table = MovedTable(rows=rows, columns=COLUMNS, seconds=seconds)
    table.failure = hand.objection(answer._replace(status=0) if missed else answer)
    if table.failure is not None:
        hand.name_heat(table.failure)
        return table
    table.failure = failure_of_arrivals(hand.link.name, arrivals, expect, hint=hint_for(NOT_REACHED) if missed else "")
    if missed and expect == REACHED and table.failure is None:
        refusal = hand.refusal(answer)
        table.failure = CheckFailed(
            f"{refusal.text}, although each motor is within MPE of its target now", hint=refusal.hint, code=refusal.code
        )
    return table


def check_standing_after(hand: BarrettHand, answer: Answer) -> None:
    """After the prompt of a movement: raise ProtocolError, NoAnswer if the hand still moves, or does not show that it stands still.

    A hand that has ended the movement with an error may refuse to show its positions, as above OTEMP (dossier 8.43).
    """
    look = run_stop(hand.link, stands(hand.stop_context(), Stopped(f"{answer.command} has ended")))
    if look.error is None or (look.error is ProtocolError and answer.status):
        return
    if look.error is DeviceRefused:  # the prompt was wrong: nothing was refused
        raise ProtocolError(f"{hand.link.name}: {look.text}", hint=look.hint, code="moving")
    raise look.error(f"{hand.link.name}: {look.text}", hint=look.hint)


def _note_end(hand: BarrettHand, answer: Answer, rows: Sequence[Row]) -> None:
    """Into the record of writes: a movement that some motors have made was not refused, whatever its status."""
    step = Step(answer.command, encode(answer.command))
    ends = ", ".join(f"{row['motor']} {row['ended']}" for row in rows)
    if all(row["arrival"] in (BLOCKED, None) for row in rows):
        hand.journal.ledger.refuse(f"ERR {answer.status}: {ends}", step)
    else:
        hand.journal.ledger.doubt(f"carried out, ERR {answer.status}: {ends}", step)


def moved(
    hand: BarrettHand, prefix: str, name: str, argument: int | None, prompts: Prompts, expect: str = REACHED
) -> Table:
    """The same, where what went wrong is raised."""
    table = move(hand, prefix, name, argument, prompts, expect=expect)
    if table.failure is not None:
        raise table.failure
    return table


def _before(
    hand: BarrettHand, name: str, argument: int | None, motors: list[int], force: bool
) -> tuple[dict[int, int], float, dict[int, Start]]:
    """Goals by motor, the longest time of the movement in seconds at the set velocities, and how each motor is: one line of questions."""
    velocity = VELOCITIES.get(name, ("MCV",))
    wanted = [*NEEDED.get(name, ()), *(["IVEL"] if "MOV" in velocity else []), *velocity, "SAMPLE", "S"]
    if name in ("M", "IC", "IO") and argument is not None:
        wanted = [key for key in wanted if key not in ("DP", "DS")]
    by_motor: dict[int, dict[str, int]] = {index: {} for index in motors}
    for reading in hand.read(BARRETT.elements(*wanted, motors=motors)):
        if reading.value is not None:
            if gcl_name(reading.element) == "P" and implausible(reading.element.index, int(reading.value)):
                continue
            by_motor[reading.element.index][gcl_name(reading.element)] = int(reading.value)
    goals: dict[int, int] = {}
    slowest = 0.0
    for index, at in by_motor.items():
        goal = _goal(name, argument, at)
        if goal is not None:
            goals[index] = goal
        if not force:
            refuse_harm(name, index, at, goal)
        speeds = [at[key] for key in velocity if at.get(key)]
        if speeds and "SAMPLE" in at:
            slowest = max(slowest, travel_seconds(index, min(speeds), at["SAMPLE"]))
    return goals, slowest, {index: Start(at.get("P"), at.get("S", 0)) for index, at in by_motor.items()}


def refuse_typed_harm(hand: BarrettHand, line: str) -> None:
    """`refuse_harm` for a GCL line as it is typed, before it is sent: a hand that would open too fast does so for whoever tells it to.

    Asks the hand where the line is a movement that may open. Raises UsageError, NoAnswer, ProtocolError.
    """
    prefix, command, words = split(line)
    if command is None or command.name not in VELOCITIES or not all(word.isdecimal() for word in words[:1]):
        return
    argument = int(words[0]) if words else None
    _before(hand, command.name, argument, _indices(motor_prefix(prefix) if prefix else ""), force=False)


def refuse_harm(name: str, index: int, at: dict[str, int], goal: int | None) -> None:
    """What the hand would do and should not (§5.3.4 IVEL, OT, CT; dossier §8). Raises UsageError; nothing has moved."""
    motor = MOTORS[index]
    own = "IVEL" if name == "HI" else "MOV"
    limit = quickest_opening(index, at.get("IVEL"))
    opens = name in ("HI", "O", "TO") or (goal is not None and "P" in at and goal < at["P"])
    if opens and at.get(own, 0) > limit:
        raise UsageError(
            f"{motor}: {own} {at[own]} opens at {at[own] / 16:.1f} counts per sample, but IVEL allows only {limit / 16:.2f}: "
            "this may deform the clutch permanently",
            hint=Hint(
                "{}, or use --force to open that fast anyway (barrett §5.3.4 IVEL). Nothing moved.",
                f"barrett set {own}.{motor}={BARRETT.by_mnemonic(own).default_of(index)}",
            ),
            code="opening-speed",
        )
    if name in ("O", "C") and {"OT", "CT"} <= at.keys() and (at["OT"] >= at["CT"] or at["OT"] > TRAVEL[index == 3]):
        raise UsageError(
            f"{motor}: OT {at['OT']} and CT {at['CT']} keep {name} from moving the motor, or reverse the movement",
            hint=Hint(
                "{}, or use --force to send it anyway (barrett §5.3.4). Nothing moved.",
                f"barrett set OT.{motor}=0 CT.{motor}={BARRETT.by_mnemonic('CT').default_of(index)}",
            ),
            code="targets",
        )


def _goal(name: str, argument: int | None, at: dict[str, int]) -> int | None:
    """Where one motor goes, None for torque control or when its parameters are not known."""
    if name in ("HOME", "HI"):
        return 0
    if name == "M" and argument is not None:
        return argument
    if name in GOALS:
        return at.get(GOALS[name])
    step = argument if argument is not None else at.get("DS")
    if name in ("IC", "IO") and step is not None and "P" in at:
        return at["P"] + (step if name == "IC" else -step)
    return None


def _result(
    hand: BarrettHand,
    name: str,
    answer: Answer,
    strain: list[Reading],
    motors: list[int],
    goals: dict[int, int],
    starts: dict[int, Start],
    *,
    all_motors: bool,
) -> tuple[list[Row], list[Arrival]]:
    names = ["SG", "P", "S", "HSG", "LSG", "MPE", *(["EN"] if all_motors else [])]
    readings = [*hand.read(BARRETT.elements(*names, motors=motors)), *strain]
    at = {(gcl_name(reading.element), reading.element.index): reading.value for reading in readings}
    rows: list[Row] = []
    arrivals = []
    for index in motors:
        value = {key: at.get((key, index)) for key in names}
        numbers = {key: int(number) for key, number in value.items() if number is not None}
        lost = implausible(index, numbers.get("P", 0))
        now = {key: at for key, at in numbers.items() if key != "P" or not lost}
        ended = how_it_ended(name, now, goals.get(index), answer.status, starts[index])
        motor = MOTORS[index]
        more = {
            "target": goals.get(index),
            "strain": numbers.get("SG") if numbers.get("SG") != NO_GAUGE else None,
            "status": numbers.get("S"),
            "ended": ended.words,
            "arrival": ended.verdict,
            "doubt": NOT_HOMED if numbers.get("S", 0) & 4 else why_impossible(index) if lost else None,
        }
        rows.append(row_of("position", "P", motor, numbers.get("P"), "cts", **more))
        if ended.verdict is not None:
            why = "" if ended.verdict == REACHED else ended.words
            arrivals.append(Arrival(Goal(motor, goals.get(index)), numbers.get("P"), ended.verdict, why))
    return rows, arrivals


class Start(NamedTuple):
    """A motor before its movement: where it is, None = not known, and its status."""

    place: int | None = None
    status: int = 0


NOT_KNOWN = Start()


class Ended(NamedTuple):
    """What became of one motor: a verdict of `model.movement`, None where it was not driven, and the words of it."""

    verdict: str | None
    words: str


def how_it_ended(name: str, now: dict[str, int], goal: int | None, status: int, before: Start = NOT_KNOWN) -> Ended:
    """The termination case of §5.5, from position, strain, limits and status.

    A stall is told by ERR 16, and of O and C, which never answer 16, by a way that ended short of its goal (dossier 5).
    Of a motor that is ready its status is 0 (§5.3.2): whatever has been added to it speaks against the movement.
    """
    own, near, start = now.get("S", 0), now.get("MPE", 50), before.place
    new = own & ~before.status
    if now.get("EN") == 0:
        return Ended(None, "disabled (EN 0): did not move")
    if own & 3:
        return Ended(BLOCKED, explain_status(own))
    stayed = start is not None and "P" in now and abs(now["P"] - start) <= near
    if own & 4 or (status & 4 and stayed):
        return Ended(BLOCKED, "not initialized: did not move")
    if status & 16384 or own & 16384:
        return Ended(SHORT, "stopped by ^C")
    if (own | status) & OVER_TEMPERATURE:
        return Ended(BLOCKED, "over-temperature: did not move, or stopped")
    if new & ~NOT_REACHED:
        return Ended(BLOCKED, explain_status(new & ~NOT_REACHED))
    if "P" not in now:
        return Ended(UNREAD, "unknown: its position could not be read")
    if start is not None and (now["P"] - start) * TORQUE.get(name, 0) < -near:
        return Ended(ASTRAY, "moved the wrong way")
    if (
        start is not None
        and goal is not None
        and name not in (*TORQUE, "HI")
        and is_astray(start, goal, now["P"], near)
    ):  # HI sets a new origin, so a start from before says nothing
        return Ended(ASTRAY, "is not between its start and its target")
    strain, high, low = now.get("SG", NO_GAUGE), now.get("HSG", OFF), now.get("LSG", OFF)
    over, under = high < OFF and strain > high, low < OFF and strain < low
    if strain != NO_GAUGE and (over or under):
        return Ended(CONTACT, f"strain limit: {strain} is {f'above HSG {high}' if over else f'below LSG {low}'}")
    if goal is not None and name not in TORQUE and abs(now["P"] - goal) <= near:
        if new & NOT_REACHED:
            return Ended(SHORT, f"{explain_status(NOT_REACHED)}, although it is within MPE of its target now")
        return Ended(REACHED, "reached")
    if name in TORQUE:
        return Ended(CONTACT, "stalled on something, or at the joint stop")
    if not status & NOT_REACHED and stayed:
        return Ended(UNMOVED, "did not move")
    if name == "HI":
        return Ended(SHORT, "its position is not 0 after HI")
    if goal is None:
        return Ended(SHORT, "ended")
    if not status & NOT_REACHED and name not in ("O", "C"):
        return Ended(SHORT, "ended short of the target without ERR 16")
    return Ended(CONTACT, "stalled short of the target")


def power_off(hand: BarrettHand, prefix: str) -> str:
    """T for the motors of `prefix`, at whatever speed the hand is found; what it answered. Raises what speaks against it.

    It works although it may answer 4 for a motor that is not initialised.
    """
    answer = hand.line.ask(f"{prefix}T")
    error = hand.objection(answer)
    if error is not None and (not answer.status or answer.status & ~5):
        error.add_aftermath(Aftermath(hint="the motors may still have power. To be sure, switch the power supply off"))
        raise error
    if answer.status:
        hand.journal.ledger.confirm("ERR 4: its power is off", Step("T", encode(f"{prefix}T")))
    status = f" (status {answer.status}: {explain_status(answer.status)})" if answer.status else ""
    return f"the hand was found and ^C was sent. {prefix}T was acknowledged{status}: motor power is off"


def find_and_power_off(hand: BarrettHand, prefix: str) -> str:
    """The same for a hand that did not reply where it was looked for first, and whether it stands still afterwards. If it goes on, it gets
    the whole stop once more."""
    look = run_stop(hand.link, stands(hand.stop_context(), Stopped(power_off(hand, prefix))))
    if look.goes_on:
        again = run_stop(hand.link, stop_steps(hand.stop_context(), prefix), ledger=hand.journal.ledger)
        look = sent_again(look, again)
    if look.error is not None:
        raise look.error(f"{hand.link.name}: {look.text}", hint=look.hint)
    return look.text
