"""Sensor bias and maximum torque of the AIDIN-hand (aidin, Modes)."""

from __future__ import annotations

from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.feedback import Wire
from handctl.devices.aidin.homing import connect_or_command, named
from handctl.devices.aidin.map import AIDIN, Mode
from handctl.devices.aidin.stop import in_force, object_of
from handctl.devices.aidin.travel import MOTOR_POS, moving
from handctl.errors import CheckFailed, NoAnswer
from handctl.model.param import elements_of
from handctl.model.result import Column, Row, Table

BIAS = 0.5
SHORT = 0.2
CONFIRM = 1.0
NOISE = 4.0
"""A value so many times what it changes by itself is no noise."""
SENSOR_STATE = AIDIN["sensor_state"]
LEFT_HINT = "use `handctl aidin joints …` to hold a position again, or `handctl aidin stop` to free the fingers"


def left_in(mode: Mode) -> str:
    """What the hand is left in by a mode that ended another one; the manual says nothing of it (dossier 5)."""
    return f"the hand is left in mode {int(mode)}. It is not documented whether it keeps holding its position"


def bias(hand: AidinHand) -> Table:
    """Mode 4 for 0.5 s; rows have the values `before` and after. Refused while a motor moves.

    Raises CheckFailed when a motor moves, or when a value did not come nearer to 0.
    """
    talk = hand.talk
    first, earlier = _look(hand)
    hand.link.sleep(SHORT)
    second, before = _look(hand)
    restless = moving(first, second)
    if restless:
        raise CheckFailed(
            f"{hand.link.name}: {named(MOTOR_POS, restless, second)} is moving, so a load would be taken for the offset",
            hint="wait until the hand has stopped and touches nothing. Nothing was sent.",
            code="moving",
        )
    ledger = hand.journal.ledger
    begun = ledger.mark
    sent = "the sensor bias was sent, so any load on the fingertips may read as 0 from now on"
    with in_force(f"{sent}; {left_in(Mode.BIAS)}", moving=False):
        data, end = object_of(Mode.BIAS), talk.deadline(BIAS)
        while not end.expired:
            talk.tick(data)
        talk.check_bound()
        end = talk.deadline(CONFIRM)
        table, worse = _compared(hand, before, earlier)
        while worse and not end.expired:
            hand.link.sleep(SHORT)
            table, worse = _compared(hand, before, earlier)
    hand.journal.info("left", left_in(Mode.BIAS), LEFT_HINT)
    if worse and table.failure is None:
        table.failure = CheckFailed(
            f"{hand.link.name}: sensor values did not get closer to 0: {', '.join(worse[:4])}",
            hint="remove any load from the fingertips, then run `handctl aidin bias` again",
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


def _look(hand: AidinHand) -> tuple[Wire, Wire]:
    """Encoders and sensors of one moment."""
    encoders, sensors = hand.talk.need(MOTOR_POS, SENSOR_STATE)
    return encoders, sensors


def _compared(hand: AidinHand, before: Wire, earlier: Wire) -> tuple[Table, list[str]]:
    """The sensors now beside those `before`, and which did not come nearer to 0 than noise explains."""
    table = hand.table(hand.read(elements_of(SENSOR_STATE)))
    table.columns = (*hand.columns[:3], Column("before", "Before", right=True), *hand.columns[3:])
    worse = []
    for row, old, older in zip(table.rows, before, earlier, strict=True):
        row["before"] = old
        if "value" in row and abs(row["value"]) >= abs(old) and abs(row["value"]) > NOISE * abs(old - older):
            worse.append(f"{row['finger']}.{row['element']} {old:g} to {row['value']:g}")
    return table, worse


def max_torque(hand: AidinHand, value: int) -> Table:
    """Mode 5 with `maxtorque`, for 0.2 s. No feedback shows it. Raises NoAnswer when the hand says nothing afterwards."""
    blind = connect_or_command(hand)
    data, end = object_of(Mode.MAXTORQUE, maxtorque=value), hand.talk.deadline(SHORT)
    sent = f"maxtorque {value} was sent and may be in effect, but it cannot be read back"
    with in_force(f"{sent}; {left_in(Mode.MAXTORQUE)}", moving=False):
        while not end.expired:
            hand.talk.tick(data, blind=blind)
        if not blind:
            hand.talk.check_answered()
        hand.talk.check_bound()
    hand.journal.info("left", left_in(Mode.MAXTORQUE), LEFT_HINT)
    if blind and not hand.talk.feedback.seen:
        raise NoAnswer(
            f"{hand.link.name}: maxtorque {value} was sent, but the hand does not reply",
            hint="check the address and the port (8000), and that no other client is connected to the hand",
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
