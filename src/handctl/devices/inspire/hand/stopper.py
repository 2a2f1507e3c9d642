"""The stop of an RH56 hand: speed 0 for every finger (rh56 §6). It is no emergency stop: a finger runs on a little.

One quick read shows whether a hand of byte addresses is there. The speeds of F1 and DG2 lie elsewhere: who shows itself twice as
one of these is stopped as such. Who shows itself as something else is not written to. Who is silent is, and is asked again
behind the acknowledgement.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

from handctl.devices.inspire import can_frames, modbus_frames
from handctl.devices.inspire.hand.detect_generation import KINDS
from handctl.devices.inspire.hand.model_and_protocol import map_of, over_tcp
from handctl.devices.inspire.hand.register_map import DG2, F1, MAPS, HandRegister
from handctl.devices.inspire.identity import STATES, TABLE, is_five_wide, is_six_wide, within
from handctl.devices.inspire.modbus_frames import RTU, TCP
from handctl.devices.inspire.register_bus import Span
from handctl.devices.inspire.register_map import NOISE
from handctl.devices.inspire.stop_requests import CAN, EB90, QUICK, TAKEN, Wire, check_again, lead
from handctl.errors import DeviceRefused, LinkError, NoAnswer, ProtocolError
from handctl.model.param import ParamMap
from handctl.model.stop_repetition import REPEAT_FOR, after_late_replies, repeat_until_answered
from handctl.model.stop_sequence import Pieces, Read, StopContext, Stopped, StopSequence, StopStep

BRIEF = 0.3
"""Seconds for each protocol where both are tried, before both are tried for longer."""
POWER = "Speed 0 does not replace the power switch. Switch the power off if the hand is still moving"
GOES_ON = "With a new speed the fingers may move on to their last target"
LABEL = "add --model f1 or dg2 if the label says so. Switch the power off if it is still moving"
REFUSED_IT = Stopped("the hand refused speed 0", POWER, DeviceRefused)
BY_GATEWAY = {
    modbus_frames.NO_PATH: Stopped("the gateway cannot reach the hand, so speed 0 did not arrive", POWER, LinkError),
    modbus_frames.NO_TARGET: Stopped(
        "the gateway sent speed 0 to the hand, but the hand did not reply", POWER, NoAnswer
    ),
}
"""Exception -> who says so: not the hand."""
ASKS = "ask whether a hand is there"


def stop_steps(context: StopContext) -> StopSequence:
    """Speed 0 on the wire of the LINK; on a serial line in the other protocol too, where the first brings no answer."""
    settings = context.settings
    protocol = settings.own.get("protocol") or "auto"
    if context.can:
        wires = [CAN]
    elif over_tcp(settings):
        wires = [TCP]
    else:
        wires = {"eb90": [EB90], "modbus": [RTU]}.get(protocol, [EB90, RTU])
    failed: list[Stopped] = []
    # who speaks the second protocol must not wait until the first has been given up
    turns = [
        (wire, seconds) for seconds in ((BRIEF, REPEAT_FOR) if len(wires) > 1 else (REPEAT_FOR,)) for wire in wires
    ]
    for wire, seconds in turns:
        stopped = yield from _stop(context._replace(within=seconds), wire)
        if stopped.heard or stopped.error not in (NoAnswer, ProtocolError):
            return stopped
        failed.append(stopped)
    return next((one for one in failed if one.error is ProtocolError), failed[-1])


def _stop(context: StopContext, name: str) -> Generator[StopStep, Pieces, Stopped]:
    hand, wire = map_of(context.settings), Wire(context, name, first=lead(context) if name == EB90 else b"")
    # CAN ids are the hand's own, and eight bytes tell nothing
    asks = hand["speed_set"].per == 1 and name != CAN and not context.proven
    states = (yield from _quick(wire, STATES)) if asks else None
    if states is not None and not _is_hand(states):
        shown = None if is_five_wide(within([(STATES[0], states)])) else (yield from _word_map(wire))
        return _other(states) if shown is None else (yield from _stop_by(context, wire, shown))
    if not asks or states is not None:
        return (yield from _stop_by(context, wire, hand))
    done = yield from _speed_0(context, wire, hand)
    if done.error is not None:
        return done
    step, found = wire.asking(*STATES, ASKS)
    states = yield from after_late_replies(
        context, (yield from repeat_until_answered(context, step, found, reads=True, ahead=wire.first))
    )
    if states is not None and _is_hand(states):
        return (yield from _lasting(wire, hand, done))
    if (shown := (yield from _word_map(wire))) is not None:
        return (yield from _stop_by(context, wire, shown))
    text = "a device acknowledged speed 0, but did not show that it is an RH56 hand with byte addresses"
    return Stopped(text, LABEL, ProtocolError)


def _stop_by(context: StopContext, wire: Wire, hand: ParamMap[Any]) -> Generator[StopStep, Pieces, Stopped]:
    """The stop of a hand whose map is known."""
    done = yield from _speed_0(context, wire, hand)
    return done if done.error is not None else (yield from _lasting(wire, hand, done))


def _speed_0(context: StopContext, wire: Wire, hand: ParamMap[Any]) -> Generator[StopStep, Pieces, Stopped]:
    """Speed 0 where this map has it; what shows that the hand has it, or an error.

    On CAN it takes several frames: each goes out before the first is repeated for longer, whatever became of the others.
    """
    register, failed = hand["speed_set"], list[Stopped]()
    zeros = b"".join(register.encode(0) for _ in range(register.count))
    size = can_frames.MAX_COUNT if wire.name == CAN else len(zeros)
    left = list(range(0, len(zeros), size))
    for turn in (context._replace(within=BRIEF), context) if len(left) > 1 else (context,):
        starts, left, failed = left, [], []
        for start in starts:
            place = (register.address + start) // register.per
            done = yield from _zeros(turn, wire, register, place, zeros[start : start + size])
            if done.error is not None:
                left.append(start)
                failed.append(done)
        if not left:
            return done
    return failed[0]


def _zeros(
    context: StopContext, wire: Wire, register: HandRegister, place: int, data: bytes
) -> Generator[StopStep, Pieces, Stopped]:
    """One frame of it. A hand that replies with an exception that leaves it open is believed when its speeds read 0."""
    step, verdict = wire.writing(place, data, "set the speed of every finger to 0")
    heard = yield from repeat_until_answered(context, step, verdict, final=TAKEN.__eq__, ahead=wire.first)
    said = yield from after_late_replies(context, heard)
    if said is None:
        return Stopped("speed 0 was sent but not acknowledged", POWER, ProtocolError if heard.came else NoAnswer)
    if said in modbus_frames.UNSURE:
        speeds = yield from _values(wire._replace(context=context._replace(within=REPEAT_FOR)), register)
        if speeds is not None and not any(speeds):
            text = f"every finger has speed 0 now, although the hand replied with exception {said:02X}"
            return Stopped(text, evidence="read back")
    if said != TAKEN:
        return BY_GATEWAY.get(said, REFUSED_IT)
    return Stopped("the hand acknowledged speed 0 for every finger")


def _lasting(wire: Wire, hand: ParamMap[Any], done: Stopped) -> Generator[StopStep, Pieces, Stopped]:
    """After an acknowledged speed 0: whether it lasts. The protocol is known by now, so a late hand gets the usual time."""
    wire = wire._replace(context=wire.context._replace(within=REPEAT_FOR))
    register = hand["speed_set"]
    stopped = done._replace(text=f"{done.text}. {GOES_ON}. {POWER}")
    places = lambda: _values(wire, hand["angle_actual"])  # noqa: E731
    stopped, _ = yield from check_again(stopped, places, lambda: _values(wire, register), [0] * register.count, NOISE)
    return stopped


def _quick(wire: Wire, span: Span) -> Generator[StopStep, Pieces, bytes | None]:
    """What is there, if it comes at once: it must not hold up the stop."""
    step, found = wire.asking(*span, ASKS)
    return found((yield StopStep(step, QUICK, lambda came: found(came) is not None, reads=True, ahead=wire.first)))


def _word_map(wire: Wire) -> Generator[StopStep, Pieces, ParamMap[Any] | None]:
    """The map of an F1 or DG2 that shows itself twice in a row (rh56 §1.1); None for anything else."""
    for model in (F1, DG2):
        sign = next(sign for sign in TABLE if sign.kind is KINDS[model])
        for _ in range(2):
            read = []
            for span in sign.reads:
                data = yield from _quick(wire, span)
                read += [] if data is None else [(span[0], data)]
            if not sign.shows(within(read)):
                break
        else:
            return MAPS[model]
    return None


def _is_hand(states: bytes) -> bool:
    return bool(is_six_wide(within([(STATES[0], states)])))


def _other(states: bytes) -> Stopped:
    """A device that answers and is no hand of byte addresses: nothing was written to it."""
    if is_five_wide(within([(STATES[0], states)])):
        text = "this looks like an EH55BF1 exoskeleton hand. Nothing was written"
        return Stopped(text, "stop it with `handctl exo stop`", DeviceRefused, stranger=True)
    text = "this device does not look like an RH56 hand with byte addresses. Nothing was written"
    return Stopped(text, LABEL, DeviceRefused, stranger=True)


def _values(wire: Wire, register: HandRegister) -> Read:
    """All elements of a register, None where they are not answered."""
    size = register.size * register.count
    span = can_frames.MAX_COUNT if wire.name == CAN else size
    data = b""
    for start in range(0, size, span):
        part = yield from wire.memory((register.address + start) // register.per, min(span, size - start))
        if part is None:
            return None
        data += part
    return [int(register.decode(data[at : at + register.size])) for at in range(0, size, register.size)]
