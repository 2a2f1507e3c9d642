"""RH56 hands and gateways that answer as no hand should: a right value or an honest error, and no write to an unproven hand.

The devices are those of `tests.support.odd_hands`, on virtual time. A link that does not end fails by itself.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest

from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.hand import motion
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.hand.register_map import BYTE_MAP
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.register_bus import RegisterBus
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from tests.inspire.wrist_support import ScriptedFrames
from tests.support.each_row import each_row
from tests.support.odd_hands import (
    CAN,
    DELAY,
    EB90,
    RTU,
    TCP,
    WIRES,
    Change,
    Odd,
    Pieces,
    as_it_is,
    eb90,
    golden,
    rtu,
    tcp,
    words_only,
)
from tests.support.scripted import ScriptedLink

FINGERS = BYTE_MAP["angle_actual"].elements
RIGHT = {
    "angle_actual": [110, 220, 330, 440, 550, 660],
    "stroke_actual": [211, 322, 433, 544, 655, 766],
    "force_actual": [-11, 12, -13, 14, -15, 16],
    "current": [21, -22, 23, 24, 25, 26],
    "status": [2, 1, 2, 3, 2, 0],
    "temperature": [31, 32, 33, 34, 35, 36],
}
MODBUS = (RTU, TCP)


def host(odd: Odd, *, typed: str | None = "tp", device_id: int = 1) -> Hand:
    """handctl's hand in front of this device."""
    journal = Journal()
    bus: RegisterBus
    if odd.wire == CAN:
        bus = CanBus(ScriptedFrames(odd.frame), device_id, journal, family="hand")
    elif odd.wire == EB90:
        bus = SerialBus(ScriptedLink(odd), device_id, journal, family="hand")
    else:
        bus = ModbusBus(
            ScriptedLink(odd, baud=None if odd.wire == TCP else 115200), device_id, journal, tcp=odd.wire == TCP
        )
    gate = ModelGate(typed, False)
    bus.gate = gate  # type: ignore[assignment]
    return Hand(bus, gate)


def values(hand: Hand, name: str) -> list[object]:
    """The values of a group, or the exit code of the error in place of one."""
    return [r.value if r.error is None else f"exit {r.error.exit_code}" for r in hand.read(hand.map[name].each)]


def outcome(ask: Callable[[], object]) -> object:
    """What `ask` returns, or the class and exit code of its error."""
    try:
        return ask()
    except HandctlError as exc:
        assert exc.hint, exc.text
        return f"exit {exc.exit_code}"


def codes(hand: Hand) -> list[str]:
    return [message.code for message in hand.journal.messages]


# -- the scripted hand is right -----------------------------------------------------------------------------------------


@each_row(("model", "wire"), [*(("tp", wire) for wire in WIRES), ("df", EB90), ("df", RTU), ("df", CAN)])
def test_without_hostility_every_wire_shows_the_golden_hand(model: str, wire: str) -> None:
    hand = host(Odd(wire, golden(model)), typed=None)
    assert {name: values(hand, name) for name in RIGHT} == RIGHT
    assert hand.found().model == model


# -- late answers -------------------------------------------------------------------------------------------------------


@each_row("wire", WIRES)
@each_row("late", [0.31, 0.35, 0.45, 0.51, 0.7, 1.2])
def test_a_hand_that_is_always_late_never_answers_the_question_before(wire: str, late: float) -> None:
    """Groups of the same size, asked one behind the other: the answer to one must not pass for the next."""
    hand = host(Odd(wire, golden("tp"), lambda _r, answer: [(late, answer)] if answer else []))
    for _ in range(3):
        for name, right in RIGHT.items():
            found = outcome(lambda name=name: values(hand, name))
            assert found in (right, "exit 4", "exit 5", ["exit 4"] * 6, ["exit 5"] * 6), (name, found)


@each_row("wire", WIRES)
@each_row("which", range(1, 9))
def test_one_late_answer_spoils_nothing(wire: str, which: int) -> None:
    odd = Odd(wire, golden("tp"))
    odd.change = lambda _r, answer: [(0.62 if odd.asked == which else DELAY, answer)] if answer else []
    hand = host(odd)
    for name, right in RIGHT.items():
        assert values(hand, name) == right, name


@each_row("wire", WIRES)
@each_row("which", range(1, 9))
def test_an_answer_that_comes_late_again_and_again(wire: str, which: int) -> None:
    """A gateway with a queue: each answer comes behind the next question, from one of them on."""
    odd = Odd(wire, golden("tp"))
    odd.change = lambda _r, answer: [(0.55 if odd.asked >= which else DELAY, answer)] if answer else []
    hand = host(odd)
    for name, right in RIGHT.items():
        found = outcome(lambda name=name: values(hand, name))
        assert found in (right, "exit 4", "exit 5", ["exit 4"] * 6, ["exit 5"] * 6), (name, found)


def test_a_hand_whose_first_answer_is_late_is_identified_or_honestly_not() -> None:
    for wire in WIRES:
        odd = Odd(wire, golden("tp"))
        odd.change = lambda _r, answer, odd=odd: [(0.62 if odd.asked == 1 else DELAY, answer)] if answer else []
        hand = host(odd, typed=None)
        assert outcome(lambda hand=hand: hand.found().model) in ("tp", "exit 4", "exit 5"), wire
        always = host(Odd(wire, golden("tp"), lambda _r, answer: [(0.7, answer)] if answer else []), typed=None)
        assert outcome(lambda hand=always: hand.found().model) in ("tp", None, "exit 4", "exit 5"), wire


# -- transactions and units -----------------------------------------------------------------------------------------------


@each_row("number", [lambda n: n - 1, lambda n: 0, lambda n: n + 257, lambda n: 0xFFFF])
def test_a_hand_that_counts_wrongly_is_read_and_said_so(number: Callable[[int], int]) -> None:
    """One question is open: the order tells (rh56 §2.3)."""
    odd = Odd(
        TCP,
        golden("tp"),
        lambda r, a: [(DELAY, struct.pack(">H", number(struct.unpack_from(">H", r)[0]) & 0xFFFF) + a[2:])],
    )
    hand = host(odd)
    assert {name: values(hand, name) for name in RIGHT} == RIGHT
    assert "transaction-id" in codes(hand)


@each_row("apart", [0.0, 0.02])
@each_row("typed", ["tp", None])
def test_the_answer_before_comes_again_before_each_answer(typed: str | None, apart: float) -> None:
    """It names the question before, and the right one is behind it: groups of one size are not mixed up.

    Without --model short probes are the first questions: they wait for the right one as well.
    """
    old = [b""]

    def stale(_request: bytes, answer: bytes) -> Pieces:
        old.append(answer)
        again = old[-2] if len(old[-2]) == len(answer) else b""
        return [(0.0005, again), (0.0005 + apart, answer)] if again else [(0.0005, answer)]

    hand = host(Odd(TCP, golden("tp"), stale), typed=typed)
    assert {name: values(hand, name) for name in RIGHT} == RIGHT


@each_row("which", range(1, 7))
def test_a_hand_that_counts_wrongly_and_is_late_once(which: int) -> None:
    """After a lost answer two questions are open: the number decides, or nothing is taken."""
    odd = Odd(TCP, golden("tp"))
    odd.change = lambda r, a: [
        (0.62 if odd.asked == which else DELAY, struct.pack(">H", struct.unpack_from(">H", r)[0] - 1) + a[2:])
    ]
    hand = host(odd)
    for name, right in RIGHT.items():
        found = outcome(lambda name=name: values(hand, name))
        assert found in (right, "exit 4", "exit 5", ["exit 4"] * 6, ["exit 5"] * 6), (name, found)


@each_row("unit", [0, 1, 7, 247, 255])
def test_any_unit_may_answer_over_tcp(unit: int) -> None:
    odd = Odd(TCP, golden("tp"), lambda _r, a: [(DELAY, a[:6] + bytes([unit]) + a[7:])])
    assert values(host(odd), "angle_actual") == RIGHT["angle_actual"]


@each_row("wire", [EB90, RTU])
def test_the_answer_of_another_id_is_not_taken(wire: str) -> None:
    def other(request: bytes, answer: bytes) -> Pieces:
        if wire == RTU:
            return [(DELAY, rtu(7, answer[1:-2]))]
        return [(DELAY, eb90(7, answer[4], answer[5:-1]))]

    hand = host(Odd(wire, golden("tp"), other))
    with pytest.raises(ProtocolError) as caught:
        values(hand, "angle_actual")
    assert caught.value.code == "wrong-id" and "7" in caught.value.text


@each_row("wire", [EB90, RTU, CAN])
def test_a_hand_that_answers_for_two_ids_is_read_by_each_and_refused_as_a_free_id(wire: str) -> None:
    from handctl.devices.inspire.id_baud_save_reset import change_id
    from handctl.errors import CheckFailed

    odd = Odd(wire, golden("df"), ids=(1, 2))
    hand = host(odd, typed="df")
    assert values(hand, "angle_actual") == RIGHT["angle_actual"]
    with pytest.raises(CheckFailed, match="taken"):
        change_id(hand, 2)
    assert odd.writes == []


@each_row("wire", [EB90, RTU])
def test_a_second_answer_from_the_second_id_behind_the_first(wire: str) -> None:
    def both(request: bytes, answer: bytes) -> Pieces:
        other = rtu(2, answer[1:-2]) if wire == RTU else eb90(2, answer[4], answer[5:-1])
        return [(DELAY, answer), (DELAY, other)]

    assert {name: values(hand, name) for hand in [host(Odd(wire, golden("tp"), both))] for name in RIGHT} == RIGHT


# -- gateways -------------------------------------------------------------------------------------------------------------


def exception(wire: str, code: int) -> Change:
    def refuse(request: bytes, _answer: bytes) -> Pieces:
        function = (request[7] if wire == TCP else request[1]) | 0x80
        pdu = bytes([function, code])
        return [(DELAY, tcp(struct.unpack_from(">H", request)[0], pdu) if wire == TCP else rtu(request[0], pdu))]

    return refuse


@each_row("wire", MODBUS)
@each_row(
    ("code", "kind"),
    [(1, DeviceRefused), (2, DeviceRefused), (3, DeviceRefused), (4, DeviceRefused), (6, DeviceRefused), (0x0A, LinkError), (0x0B, NoAnswer), (0x63, DeviceRefused)],
)  # fmt: skip
def test_an_exception_ends_as_what_it_says(wire: str, code: int, kind: type[HandctlError]) -> None:
    """0A and 0B come from a gateway: no way to the hand, and a hand that does not answer. No hand has refused anything."""
    hand = host(Odd(wire, golden("tp"), exception(wire, code)))
    with pytest.raises(HandctlError) as caught:
        values(hand, "angle_actual")
    assert type(caught.value) is kind and f"{code:02X}" in caught.value.text and caught.value.hint
    assert (kind is DeviceRefused) == ("refused" in caught.value.text)


@each_row("wire", MODBUS)
@each_row("code", [4, 5, 6])
@each_row("times", [1, 3])
def test_who_is_at_work_is_asked_again_and_is_no_other_device(wire: str, code: int, times: int) -> None:
    """04, 05 and 06 pass and say nothing about who refuses; an EH55BF1 speaks no Modbus at all."""
    odd, left = Odd(wire, golden("tp")), [times]
    refuse = exception(wire, code)

    def busy(request: bytes, answer: bytes) -> Pieces:
        left[0] -= 1
        return refuse(request, answer) if left[0] >= 0 else as_it_is(request, answer)

    odd.change = busy
    found = host(odd, typed=None).found()
    assert (found.kind.family, found.model) == ("hand", "tp")


@each_row("wire", MODBUS)
@each_row("code", [2, 4])
@each_row("six", [True, False])
def test_who_refuses_the_states_in_modbus_is_no_exo(wire: str, code: int, six: bool) -> None:
    """Whatever it is that does not show its states, nor its sixth finger elsewhere: an EH55BF1 speaks EB90 only."""
    memory, refused = golden("tp"), {(1606, 9)}
    if not six:
        memory[1623] = 0
        refused.add((1522, 12))

    def stateless(request: bytes, answer: bytes) -> Pieces:
        span = struct.unpack_from(">HH", request, 8 if wire == TCP else 2)
        return exception(wire, code)(request, answer) if span in refused else as_it_is(request, answer)

    hand = host(Odd(wire, memory, stateless), typed=None)
    try:
        assert hand.found().kind.family == "hand"
    except HandctlError as exc:
        assert exc.code != "other-device"


@each_row("wire", MODBUS)
def test_who_stays_at_work_is_not_named(wire: str) -> None:
    hand = host(Odd(wire, golden("tp"), exception(wire, 6)), typed=None)
    with pytest.raises(DeviceRefused) as caught:
        hand.found()
    assert caught.value.code == "modbus-6"


@each_row("wire", MODBUS)
@each_row(("code", "exit_code"), [(1, 6), (2, 6), (4, 6), (0x0A, 3), (0x0B, 4)])
def test_a_gateway_without_a_hand_is_never_written_to(wire: str, code: int, exit_code: int) -> None:
    odd = Odd(wire, golden("tp"), exception(wire, code))
    hand = host(odd, typed=None)
    with pytest.raises(HandctlError) as caught:
        hand.write([(hand.map["default_speed"].each[0], 300)])
    assert caught.value.exit_code == exit_code
    assert hand.journal.counters.writes == 0


@each_row("wire", MODBUS)
@each_row("code", [5, 0x0B])
def test_an_exception_behind_a_write_that_leaves_it_open_makes_no_claim(wire: str, code: int) -> None:
    """0B: nobody knows whether it arrived; 05 acknowledges it. The read-back decides, and it did."""
    odd = Odd(wire, golden("tp"))
    refuse = exception(wire, code)
    odd.change = lambda r, a: refuse(r, a) if odd.writes and odd.writes[-1] is r else as_it_is(r, a)
    hand = host(odd)
    (reading,) = hand.write([(hand.map["default_speed"].each[0], 300)])
    assert reading.value == 300 and "ack-lost" in codes(hand)


@each_row("wire", MODBUS)
def test_a_hand_that_refuses_undocumented_addresses_is_read_and_known(wire: str) -> None:
    """Exception 02 for whatever touches a gap: nobody has seen it, and the standard asks for it (rh56 §2.2)."""
    documented = [
        range(1000, 1010),
        range(1032, 1056),
        range(1474, 1510),
        range(1522, 1558),
        range(1582, 1624),
        range(1700, 1704),
    ]

    def strict(request: bytes, answer: bytes) -> Pieces:
        first, count = struct.unpack_from(">HH", request, 8 if wire == TCP else 2)
        span = range(first, first + 2 * count)
        if any(span[0] in one and span[-1] in one for one in documented):
            return as_it_is(request, answer)
        return exception(wire, 2)(request, answer)

    hand = host(Odd(wire, golden("tp"), strict), typed=None)
    assert hand.found().model == "tp"
    rows = {(row["name"], row["finger"]): row.get("value") for row in hand.dump().rows}
    for name, right in RIGHT.items():
        assert [rows[name, finger] for finger in FINGERS] == right, name


# -- half answers, echoes, noise ------------------------------------------------------------------------------------------


@each_row("wire", [EB90, RTU, TCP])
@each_row("kept", range(1, 17))
def test_half_an_answer_is_called_that(wire: str, kept: int) -> None:
    hand = host(Odd(wire, golden("tp"), lambda _r, a: [(DELAY, a[:kept])]))
    with pytest.raises(ProtocolError) as caught:
        values(hand, "angle_actual")
    assert caught.value.code in ("cut-short", "garbage")
    if kept >= 9:
        assert caught.value.code == "cut-short"


@each_row("wire", [EB90, RTU, TCP])
def test_an_answer_in_two_halves_with_a_pause_is_taken(wire: str) -> None:
    hand = host(Odd(wire, golden("tp"), lambda _r, a: [(DELAY, a[:7]), (0.2, a[7:])]))
    assert values(hand, "angle_actual") == RIGHT["angle_actual"]


@each_row("wire", [EB90, RTU, TCP])
def test_only_an_echo_is_no_hand(wire: str) -> None:
    hand = host(Odd(wire, golden("tp"), lambda r, _a: [(DELAY, r)]), typed=None)
    with pytest.raises(ProtocolError) as caught:
        values(hand, "angle_actual")
    assert caught.value.code == "echo"
    with pytest.raises(HandctlError) as refused:
        hand.write([(hand.map["default_speed"].each[0], 300)])
    assert refused.value.exit_code == 5 and hand.journal.counters.writes == 0


@each_row("wire", [EB90, RTU])
def test_with_an_echo_before_each_answer_the_hand_is_read_and_written(wire: str) -> None:
    hand = host(Odd(wire, golden("tp"), lambda r, a: [(0.0, r), (DELAY, a)]))
    assert {name: values(hand, name) for name in RIGHT} == RIGHT
    assert hand.journal.line.echo
    hand.write([(element, 300) for element in hand.map["default_speed"].each])
    assert values(hand, "default_speed") == [300] * 6


def test_the_echo_of_a_write_is_not_its_acknowledgement() -> None:
    """The answer to function 06 equals the question: on a line with echo the second copy counts (rh56 §2.2)."""
    odd = Odd(RTU, golden("tp"))
    lost = False

    def echo(request: bytes, answer: bytes) -> Pieces:
        return [(0.0, request), *([] if lost and request[1] == 6 else [(DELAY, answer)])]

    odd.change = echo
    hand = host(odd)
    assert values(hand, "angle_actual") == RIGHT["angle_actual"]
    hand.bus.write(1004, b"\x01")
    lost = True
    with pytest.raises(ProtocolError) as caught:
        hand.bus.write(1004, b"\x01")
    assert caught.value.code == "echo"


@each_row("wire", [EB90, RTU, TCP])
@each_row(
    "junk",
    [b"\x00", b"\xff", b"\x01", b"\x01\x03", b"\x90", b"\x90\xeb", b"\xeb\x90\x01\x04\x11", bytes(9), b"\x01\x83"],
)
def test_junk_before_an_answer_costs_no_value(wire: str, junk: bytes) -> None:
    hand = host(Odd(wire, golden("tp"), lambda _r, a: [(DELAY, junk + a)]))
    for name, right in RIGHT.items():
        found = outcome(lambda name=name: values(hand, name))
        assert found in (right, "exit 5", ["exit 5"] * 6), name
        assert wire != RTU or found == right


@each_row("wire", [EB90, RTU])
@each_row("place", range(17))
def test_one_flipped_bit_is_never_a_value(wire: str, place: int) -> None:
    for bit in range(8):

        def flip(_r: bytes, a: bytes, bit: int = bit) -> Pieces:
            return [(DELAY, a[: place % len(a)] + bytes([a[place % len(a)] ^ 1 << bit]) + a[place % len(a) + 1 :])]

        hand = host(Odd(wire, golden("tp"), flip))
        assert outcome(lambda hand=hand: values(hand, "angle_actual")) == "exit 5"


@each_row("length", [0, 1, 2, 255, 65535])
def test_a_header_with_an_impossible_length_ends(length: int) -> None:
    hand = host(Odd(TCP, golden("tp"), lambda _r, a: [(DELAY, a[:4] + struct.pack(">H", length) + a[6:])]))
    assert outcome(lambda: values(hand, "angle_actual")) == "exit 5"


def test_another_service_on_the_port_is_called_that() -> None:
    banner = b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n"
    hand = host(Odd(TCP, golden("tp"), lambda _r, _a: [(DELAY, banner)]))
    with pytest.raises(ProtocolError) as caught:
        values(hand, "angle_actual")
    assert "6000" in caught.value.hint and "speed" not in caught.value.hint


@each_row("echo", [False, True])
def test_a_hand_that_speaks_modbus_only_is_found_behind_eb90(echo: bool) -> None:
    """Also on a line with echo, where our own bytes come back to EB90 (rh56 §2.5)."""
    odd = Odd(RTU, golden("df"))
    link = ScriptedLink(lambda r: [*([(0.0, r)] if echo else []), *(odd(r) if r[:1] == b"\x01" else [])])
    journal, gate = Journal(), ModelGate(None, False)
    wires = SerialBus(link, 1, journal, family="hand"), ModbusBus(link, 1, journal, tcp=False)
    for wire in wires:
        wire.gate = gate  # type: ignore[assignment]
    hand = Hand(wires[0], gate, wires[1])
    assert {name: values(hand, name) for name in RIGHT} == RIGHT
    hand.write([(hand.map["default_speed"].each[0], 300)])
    assert hand.found().model == "df" and "protocol" in codes(hand)


# -- writes whose answers lie ---------------------------------------------------------------------------------------------


@each_row("wire", MODBUS)
def test_an_acknowledgement_of_another_quantity_is_none(wire: str) -> None:
    """FC 16 answers with the registers that it has written."""
    odd = Odd(wire, golden("tp"))

    def fewer(request: bytes, answer: bytes) -> Pieces:
        if (request[7] if wire == TCP else request[1]) != 16:
            return as_it_is(request, answer)
        pdu = (answer[7:] if wire == TCP else answer[1:-2])[:4] + b"\x02"
        return [(DELAY, tcp(struct.unpack_from(">H", request)[0], pdu) if wire == TCP else rtu(1, pdu))]

    odd.change = fewer
    with pytest.raises(ProtocolError):
        host(odd).bus.write(1032, bytes(12))


@each_row("wire", MODBUS)
@each_row(("value", "taken"), [(b"\x00\x01", True), (b"\x00\x00", True), (b"\x00\x02", False), (b"\x01\x00", False)])
def test_an_acknowledgement_of_one_register_has_its_value_or_zero(wire: str, value: bytes, taken: bool) -> None:
    """The printed answer has 0000 where the standard repeats the value; another value is none (rh56 §2.2)."""
    odd = Odd(wire, golden("tp"))

    def other(request: bytes, answer: bytes) -> Pieces:
        pdu = (answer[7:] if wire == TCP else answer[1:-2])[:3] + value
        if (request[7] if wire == TCP else request[1]) != 6:
            return as_it_is(request, answer)
        return [(DELAY, tcp(struct.unpack_from(">H", request)[0], pdu) if wire == TCP else rtu(1, pdu))]

    odd.change = other
    found = outcome(lambda: host(odd).bus.write(1004, b"\x01"))
    assert found == (None if taken else "exit 5")


@each_row("wire", WIRES)
def test_a_write_that_is_acknowledged_and_not_done_is_found_by_reading(wire: str) -> None:
    odd = Odd(wire, golden("tp"))
    odd._write = lambda _address, _data, request: odd.writes.append(request)  # type: ignore[method-assign]
    hand = host(odd)
    assert outcome(lambda: hand.write([(hand.map["default_speed"].each[0], 300)])) == "exit 7"


# -- another hand behind the same address ---------------------------------------------------------------------------------


@each_row("wire", [EB90, RTU])
@each_row("typed", [None, "df", "tp", "dg2"])
def test_a_hand_of_another_generation_is_not_written_to(wire: str, typed: str | None) -> None:
    odd = Odd(wire, words_only())
    hand = host(odd, typed=typed)
    for name in ("default_speed", "angle_set", "save", "clear_errors"):
        element = hand.map[name].each[0]
        assert outcome(lambda element=element: hand.write([(element, 1)])) == "exit 6", name
    assert outcome(lambda: motion.fit_to_move(hand)) == "exit 6"
    assert odd.writes == []


@each_row("wire", [EB90, RTU])
@each_row("which", range(1, 7))
def test_hands_that_are_changed_while_they_are_looked_at_are_not_written_to(wire: str, which: int) -> None:
    """A DF at first, an F1 from one question on: either it is seen, or the write comes before it."""
    odd, other = Odd(wire, golden("df")), Odd(wire, words_only())

    def either(request: bytes) -> list[tuple[float, bytes]]:
        first.asked += 1
        return odd(request) if first.asked < which else other(request)

    first = Odd(wire, golden("df"))
    hand = host(odd, typed=None)
    hand.bus.link.answer = either  # type: ignore[attr-defined]
    found = outcome(lambda: hand.write([(hand.map["default_speed"].each[0], 300)]))
    if which <= LOOKS[wire]:
        assert found in ("exit 4", "exit 5", "exit 6"), found
        assert odd.writes == other.writes == []


LOOKS = {EB90: 6, RTU: 6}
"""Questions of a look that names a DF: states, angles, two for the words of an F1, an IP address, voltage, limits."""


@each_row("wire", WIRES)
@each_row("memory", [bytearray(8192), bytearray(b"\xff" * 8192), bytearray(range(256)) * 32])
def test_zeros_ones_and_counting_bytes_are_no_hand(wire: str, memory: bytearray) -> None:
    odd = Odd(wire, bytearray(memory))
    hand = host(odd, typed=None)
    assert outcome(lambda: hand.write([(BYTE_MAP.find("default_speed.index")[1][0], 300)])) in ("exit 5", "exit 6")
    assert odd.writes == []


# -- a hand that restarts ---------------------------------------------------------------------------------------------------


@each_row("wire", WIRES)
@each_row("which", range(1, 14))
def test_a_hand_that_restarts_in_a_movement_ends_honestly(wire: str, which: int) -> None:
    """It is gone for two seconds and comes back with its set-points forgotten. Nothing is written twice."""
    odd = Odd(wire, golden("tp"))
    gone: list[float] = []
    hand = host(odd, typed=None)

    def restart(request: bytes, answer: bytes) -> Pieces:
        now = hand.bus.link.now()
        if odd.asked == which:
            gone.append(now + 2.0)
            odd.memory[:] = golden("tp")
            odd.memory[1612:1618] = b"\xff" * 6
        return [] if gone and now < gone[0] else as_it_is(request, answer)

    odd.change = restart
    changes = [(hand.map.find("angle_set.index")[1][0], 300)]
    found = outcome(lambda: len(motion.move(hand, "angle_set", changes, Prompts(), wait=3.0).rows))
    assert found in ("exit 4", "exit 5", "exit 7", 2) or (found == "exit 6" and not odd.writes), found
    moved = [request for request in odd.writes if (request[-8:] and b"\x2c\x01" in request) or b"\x01\x2c" in request]
    assert len(moved) <= 1
