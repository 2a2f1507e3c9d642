"""The stop of an RH56 hand: speed 0 for every finger (rh56 §6). It is no emergency stop: a finger runs on a little.

One quick read shows whether a hand of byte addresses is there. Who shows itself as something else is not written to. Who is
silent is: then it is asked again behind the acknowledgement, since the speeds of F1 and DG2 lie elsewhere. There the
generation must have been typed, or named with the device.
"""

from __future__ import annotations

from collections.abc import Callable, Generator

from handctl.devices.inspire import canreg, eb90, modbus
from handctl.devices.inspire.hand.map import HandRegister
from handctl.devices.inspire.hand.typed import map_of, over_tcp
from handctl.devices.inspire.identity import STATES, is_five_wide, is_six_wide, within
from handctl.devices.inspire.stopping import QUICK, READS, Read, answer, lead, seen_since
from handctl.errors import DeviceRefused, LinkError, NoAnswer, ProtocolError
from handctl.model.param import Step
from handctl.model.stopping import WITHIN, Aim, Pieces, Say, Stopped, Talk, insist, settled, taken_over

BRIEF = 0.3
"""Seconds for each protocol where both are tried, before both are tried for longer."""
STILL = 15
"""Counts of 1000: what stands is read alike within so many."""
POWER = "Speed 0 does not replace the power switch. Switch the power off if the hand still moves"
GOES_ON = "With a new speed the fingers may move on to their last target"
LABEL = "add --model f1 or dg2 if the label says so. Switch the power off if it still moves"
EB90, RTU, TCP, CAN = "EB90", "Modbus RTU", "Modbus TCP", "CAN"
Verdict = Callable[[Pieces], Stopped | None]
"""What the pieces that came say of a write; None = nothing came that does."""

TAKEN = Stopped("taken")
REFUSED = Stopped("the hand refused speed 0", POWER, DeviceRefused)
BY_GATEWAY = {
    modbus.NO_PATH: Stopped("the gateway cannot reach the hand, so speed 0 did not arrive", POWER, LinkError),
    modbus.NO_TARGET: Stopped("the gateway sent speed 0 to the hand, but the hand did not answer", POWER, NoAnswer),
}
"""Exception -> who says so: not the hand."""


def stop_talk(aim: Aim) -> Talk:
    """Speed 0 on the wire of the LINK; on a serial line in the other protocol too, where the first brings no answer."""
    settings = aim.settings
    protocol = settings.own.get("protocol") or "auto"
    if aim.can:
        wires = [CAN]
    elif over_tcp(settings):
        wires = [TCP]
    else:
        wires = {"eb90": [EB90], "modbus": [RTU]}.get(protocol, [EB90, RTU])
    failed: list[Stopped] = []
    # who speaks the second protocol must not wait until the first has been given up
    turns = [(wire, seconds) for seconds in ((BRIEF, WITHIN) if len(wires) > 1 else (WITHIN,)) for wire in wires]
    for wire, seconds in turns:
        stopped = yield from _stop(aim._replace(within=seconds), wire)
        if stopped.error not in (NoAnswer, ProtocolError):
            return stopped
        failed.append(stopped)
    return next((one for one in failed if one.error is ProtocolError), failed[-1])


def _stop(aim: Aim, wire: str) -> Generator[Say, Pieces, Stopped]:
    hand = map_of(aim.settings)
    register = hand["speed_set"]
    asks = (
        register.per == 1 and wire != CAN and not aim.proven
    )  # CAN ids are the hand's own, and eight bytes tell nothing
    states = (yield from _states(aim, wire, once=QUICK)) if asks else None
    if states is not None and not _is_hand(states):
        return _other(states)
    zeros = b"".join(register.encode(0) for _ in range(register.count))
    size = canreg.MAX_COUNT if wire == CAN else len(zeros)
    for start in range(0, len(zeros), size):
        data = zeros[start : start + size]
        step, verdict = _writing(wire, aim.number, (register.address + start) // register.per, data)
        heard = yield from insist(aim, step, verdict, ahead=lead(aim) if wire == EB90 else b"")
        if (said := (yield from settled(aim, heard))) is None:
            return Stopped("speed 0 was sent but not acknowledged", POWER, ProtocolError if heard.came else NoAnswer)
        if said is not TAKEN:
            return said
    if asks and states is None:
        states = yield from _states(aim, wire)
        if states is None or not _is_hand(states):
            text = "a device acknowledged speed 0, but it does not look like an RH56 hand with byte addresses"
            return Stopped(text, LABEL, ProtocolError)
    stopped = Stopped(f"the hand acknowledged speed 0 for every finger. {GOES_ON}. {POWER}")
    against = yield from seen_since(
        lambda: _values(aim, wire, hand["angle_actual"]),
        lambda: _values(aim, wire, register),
        [0] * register.count,
        STILL,
    )
    return taken_over(stopped, against) if against else stopped


def _is_hand(states: bytes) -> bool:
    return bool(is_six_wide(within([(STATES[0], states)])))


def _other(states: bytes) -> Stopped:
    """A device that answers and is no hand of byte addresses: nothing was written to it."""
    if is_five_wide(within([(STATES[0], states)])):
        text = "this looks like an EH55BF1 exoskeleton hand. Nothing was written"
        return Stopped(text, "stop it with `handctl exo stop`", DeviceRefused)
    text = "this device does not look like an RH56 hand with byte addresses. Nothing was written"
    return Stopped(text, LABEL, DeviceRefused)


def _values(aim: Aim, wire: str, register: HandRegister) -> Read:
    """All elements of a register, None where they are not answered."""
    size = register.size * register.count
    span = canreg.MAX_COUNT if wire == CAN else size
    data = b""
    for start in range(0, size, span):
        part = yield from _memory(aim, wire, (register.address + start) // register.per, min(span, size - start))
        if part is None:
            return None
        data += part
    return [int(register.decode(data[at : at + register.size])) for at in range(0, size, register.size)]


def _states(aim: Aim, wire: str, once: float = 0.0) -> Generator[Say, Pieces, bytes | None]:
    """Errors, status codes and temperatures of six fingers, None where they are not answered."""
    return (yield from _memory(aim, wire, *STATES, once))


def _memory(aim: Aim, wire: str, address: int, count: int, once: float = 0.0) -> Generator[Say, Pieces, bytes | None]:
    """So many bytes, asked again for a second, or `once` and so many seconds; None where they are not answered."""
    number, can_id, first = aim.number, None, lead(aim) if wire == EB90 else b""
    pdu = modbus.read_request(address, count // 2)
    if wire == CAN:
        can_id, data = canreg.read_request(number, address, count, canreg.READ_HAND)
    else:
        data = eb90.read_request(number, address, count) if wire == EB90 else _modbus(wire, number, pdu)

    def answered(pieces: Pieces) -> bytes | None:
        if wire == CAN:
            return next((piece for piece in reversed(pieces) if len(piece) == count), None)
        if wire == EB90:
            frame = answer(pieces, eb90.read_reply_prefix(number, address, count))
            return frame.data if frame is not None else None
        told = _answer(wire, number, pieces, pdu)
        return modbus.to_memory(told.data) if told is not None and told.exception is None else None

    step = Step("ask whether a hand is there" if (address, count) == STATES else READS, data, can_id=can_id)
    if not once:
        return (yield from settled(aim, (yield from insist(aim, step, answered, reads=True, ahead=first))))
    return answered((yield Say(step, once, lambda came: answered(came) is not None, reads=True, ahead=first)))


def _modbus(wire: str, number: int, pdu: bytes) -> bytes:
    return modbus.tcp(1, pdu) if wire == TCP else modbus.rtu(number, pdu)


def _answer(wire: str, number: int, pieces: Pieces, pdu: bytes) -> modbus.Answer | None:
    decoder = modbus.TcpDecoder() if wire == TCP else modbus.RtuDecoder(number, pdu)
    decoder.feed(b"".join(pieces))
    while True:
        try:
            answer = decoder.next()
        except ProtocolError:
            continue
        if answer is None or modbus.answers(answer.pdu, pdu):
            return answer


def _writing(wire: str, number: int, address: int, data: bytes) -> tuple[Step, Verdict]:
    """The write, and what judges the pieces that come back."""
    meaning = "set the speed of every finger to 0"
    if wire == CAN:
        identifier, payload = canreg.write_request(number, address, data, canreg.WRITE_HAND)
        return Step(meaning, payload, can_id=identifier, moves=True), lambda pieces: _of_can(pieces, len(data))
    if wire == EB90:
        prefix = eb90.write_ack_prefix(number, address)

        def acknowledged(pieces: Pieces) -> Stopped | None:
            frame = answer(pieces, prefix)
            if frame is None:
                return None
            return TAKEN if frame.data == bytes([eb90.ACCEPTED]) else REFUSED

        return Step(meaning, eb90.write_request(number, address, data), moves=True), acknowledged
    pdu = modbus.write_request(address, modbus.to_memory(data))

    def answered(pieces: Pieces) -> Stopped | None:
        answer = _answer(wire, number, pieces, pdu)
        if answer is None:
            return None
        return TAKEN if answer.exception is None else BY_GATEWAY.get(answer.exception, REFUSED)

    return Step(meaning, _modbus(wire, number, pdu), moves=True), answered


def _of_can(pieces: Pieces, count: int) -> Stopped | None:
    """An acknowledgement is empty, or the number of bytes taken; longer is our own frame, which an adapter hands back."""
    short = [piece for piece in pieces if len(piece) < 2]
    if not short:
        return None
    return TAKEN if short[0] in (b"", bytes([count])) else REFUSED
