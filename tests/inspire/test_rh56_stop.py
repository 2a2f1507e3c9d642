"""`stop` of an RH56 hand on each wire, against hands, gateways and lines that mean no good: said only what was seen."""

from __future__ import annotations

import struct
from collections.abc import Callable

from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.link import CanFrame
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import Sent, StopContext, Stopped, StopSequence, exchange_steps
from tests.inspire.wrist_support import ScriptedFrames
from tests.support.each_row import each_row
from tests.support.odd_hands import (
    CAN,
    DELAY,
    EB90,
    RTU,
    TCP,
    WIRES,
    Odd,
    Pieces,
    as_it_is,
    golden,
    rtu,
    tcp,
    words_only,
)
from tests.support.scripted import ScriptedLink

SPEEDS = slice(1522, 1534)


def sequence(wire: str, **own: object) -> StopSequence:
    """The stop that `handctl hand stop` holds on this wire."""
    from handctl.devices.inspire.hand.stopper import stop_steps

    return stop_steps(
        StopContext(
            Settings(port="tcp://192.168.11.210:6000" if wire == TCP else "/dev/ttyUSB7", own=own), can=wire == CAN
        )
    )


def stop(odd: Odd, **own: object) -> tuple[Stopped, list[Sent]]:
    sent: list[Sent] = []
    link = ScriptedFrames(odd.frame) if odd.wire == CAN else ScriptedLink(odd)
    return exchange_steps(link, sequence(odd.wire, **own), sent), sent


@each_row("wire", WIRES)
def test_every_finger_has_speed_0(wire: str) -> None:
    odd = Odd(wire, golden("tp"))
    stopped, _ = stop(odd)
    assert stopped.error is None and "the hand acknowledged speed 0" in stopped.text
    assert odd.memory[SPEEDS] == bytes(12)


@each_row("wire", WIRES)
@each_row("late", [0.04, 0.06, 0.2, 0.28])
def test_a_late_hand_is_stopped_and_known(wire: str, late: float) -> None:
    """The check has 50 ms. Who answers later is written to all the same, and asked again."""
    odd = Odd(wire, golden("tp"), lambda _r, answer: [(late, answer)] if answer else [])
    stopped, _ = stop(odd)
    assert stopped.error is None and "the hand acknowledged speed 0" in stopped.text, stopped
    assert odd.memory[SPEEDS] == bytes(12)


@each_row("wire", WIRES)
def test_silence_is_said(wire: str) -> None:
    stopped, sent = stop(Odd(wire, golden("tp"), lambda _r, _a: []))
    assert stopped.error is NoAnswer and "not acknowledged" in stopped.text and "power" in stopped.hint
    assert any(not one.reads for one in sent), "sent all the same"


def test_a_refused_speed_0_is_no_stop() -> None:
    def refused(request: bytes, answer: bytes) -> list[tuple[float, bytes]]:
        if request[4] != 0x12:
            return [(DELAY, answer)]
        body = answer[2:7] + b"\x00"  # accepted is 1
        return [(DELAY, answer[:2] + body + bytes([sum(body) & 0xFF]))]

    stopped, _ = stop(Odd(EB90, golden("tp"), refused))
    assert stopped.error is DeviceRefused, stopped


@each_row("wire", [EB90, RTU, TCP])
def test_an_echo_acknowledges_nothing(wire: str) -> None:
    stopped, _ = stop(Odd(wire, golden("tp"), lambda r, _a: [(DELAY, r)]))
    assert stopped.error is ProtocolError and "not acknowledged" in stopped.text


@each_row("wire", [EB90, RTU])
def test_a_line_with_echo_is_asked_in_both_protocols(wire: str) -> None:
    """What comes back to EB90 are only our own bytes: a hand that speaks Modbus RTU is stopped all the same."""
    odd = Odd(wire, golden("tp"))
    whole = odd.__call__

    def answer(request: bytes) -> list[tuple[float, bytes]]:
        ours = (request[:2] == b"\xeb\x90") == (wire == EB90)
        return [(0.0, request), *(whole(request) if ours else [])]

    link = ScriptedLink(answer)
    stopped = exchange_steps(link, sequence(wire), [])
    assert stopped.error is None and odd.memory[SPEEDS] == bytes(12), stopped


def test_a_loopback_of_the_adapter_is_no_refusal() -> None:
    odd = Odd(CAN, golden("tp"))

    def both(frame: CanFrame) -> list[tuple[float, CanFrame]]:
        return [(0.0, frame), *odd.frame(frame)]

    stopped = exchange_steps(ScriptedFrames(both), sequence(CAN), [])
    assert stopped.error is None and odd.memory[SPEEDS] == bytes(12), stopped
    alone = exchange_steps(ScriptedFrames(lambda frame: [(0.0, frame)]), sequence(CAN), [])
    assert alone.error is not None and alone.error is not DeviceRefused, alone


@each_row("lost", [(1522,), (1530,), (1522, 1530)])
def test_every_frame_of_a_stop_on_can_goes_out_whatever_became_of_the_first(lost: tuple[int, ...]) -> None:
    """Speed 0 takes two frames there: the thumb must not run on because the acknowledgement for the four fingers was lost."""
    odd = Odd(CAN, golden("tp"))

    def deaf(frame: CanFrame) -> list[tuple[float, CanFrame]]:
        replies = odd.frame(frame)
        return [] if frame.can_id >> 14 & 0xFFF in lost and len(frame.data) > 1 else replies

    stopped = exchange_steps(ScriptedFrames(deaf), sequence(CAN), [])
    assert stopped.error is NoAnswer and odd.memory[SPEEDS] == bytes(12), stopped


@each_row("wire", [RTU, TCP])
@each_row(("code", "error"), [(2, DeviceRefused), (6, DeviceRefused), (0x0A, LinkError), (0x0B, NoAnswer)])
def test_an_exception_is_told_as_what_it_is(wire: str, code: int, error: type[HandctlError]) -> None:
    def refuse(request: bytes, _answer: bytes) -> Pieces:
        pdu = bytes([(request[7] if wire == TCP else request[1]) | 0x80, code])
        return [(DELAY, tcp(struct.unpack_from(">H", request)[0], pdu) if wire == TCP else rtu(1, pdu))]

    stopped, _ = stop(Odd(wire, golden("tp"), refuse), protocol="modbus")
    assert stopped.error is error and ("gateway" in stopped.text) == (code > 6), stopped


@each_row("wire", [EB90, RTU])
@each_row("silent", [False, True])
@each_row("shown", [0, 1, 2])
def test_a_hand_that_counts_words_is_stopped_if_it_shows_itself_twice(wire: str, silent: bool, shown: int) -> None:
    """The speeds of an RH56F1 lie elsewhere. Who does not show itself is not claimed to stand, and who answers is not written to."""

    def change(request: bytes, answer: bytes) -> Pieces:
        address = struct.unpack_from("<H", request, 5)[0] if wire == EB90 else struct.unpack_from(">H", request, 2)[0]
        if address == 1064 and shown == 1:
            odd.memory[2 * 1064 : 2 * 1070] = bytes(12)
        return [] if silent and 1100 < address != 1522 else as_it_is(request, answer)

    own = {"protocol": "modbus" if wire == RTU else "eb90"}
    odd = Odd(wire, words_only(), change)
    if shown == 0:
        odd.memory[2 * 1064 : 2 * 1070] = bytes(12)
    stopped, _ = stop(odd, **own)
    if shown == 2:
        assert stopped.error is None and odd.memory[2 * 1052 : 2 * 1058] == bytes(12)
    else:
        assert stopped.error is (ProtocolError if silent else DeviceRefused) and "--model" in stopped.hint, stopped
    assert len(odd.writes) == silent + (shown == 2)
    odd = Odd(wire, words_only())
    assert stop(odd, model="f1", **own)[0].error is None
    assert odd.memory[2 * 1052 : 2 * 1058] == bytes(12) and len(odd.writes) == 1


EXO = {1606: bytes(5), 1612: bytes(6), 1618: bytes((31, 32, 33, 34, 35, 0))}


@each_row("wire", [EB90, RTU])
def test_an_exoskeleton_hand_is_not_written_to(wire: str) -> None:
    memory = bytearray(8192)
    for address, data in EXO.items():
        memory[address : address + len(data)] = data
    odd = Odd(wire, memory)
    stopped, _ = stop(odd, protocol="modbus" if wire == RTU else "eb90")
    assert stopped.error is DeviceRefused and odd.writes == [], stopped
    assert "handctl exo stop" in stopped.hint


@each_row("count", [lambda data: b"\x03", lambda data: b"\x00"])
def test_a_part_that_was_taken_on_can_is_said(count: Callable[[bytes], bytes]) -> None:
    odd = Odd(CAN, golden("tp"), lambda request, answer: [(DELAY, count(request) if len(request) > 1 else answer)])
    stopped, _ = stop(odd)
    assert stopped.error is DeviceRefused
