"""The host side of the RH56 hands against the simulator that was written apart from it: each generation on each wire."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from unittest import mock

import pytest

from handctl.devices.inspire import modbus_frames
from handctl.devices.inspire.hand import motion
from handctl.devices.inspire.hand.detect_generation import detect
from handctl.devices.inspire.hand.register_map import BYTE_MAP, DF, DG2, F1, MAPS, TP
from handctl.devices.inspire.hand.tactile import ZONES, chosen, tactile
from handctl.devices.inspire.register_device import encoded
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, NoAnswer, UsageError
from handctl.link import ByteLink, Deadline, open_link
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from handctl.sim.hand.register_maps import GENERATIONS
from tests.inspire.rh56_support import CAN, EB90, RTU, TCP, hand_on
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers
from tests.support.refused import refused

SPOKEN = [
    (DF, EB90),
    (DF, RTU),
    (DF, CAN),
    (TP, EB90),
    (TP, RTU),
    (TP, TCP),
    (TP, CAN),
    (F1, EB90),
    (F1, RTU),
    (DG2, EB90),
    (DG2, RTU),
]
TRANSCRIPTS = Path(__file__).parents[1] / "transcripts"


# -- reading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("model", "wire"), SPOKEN)
def test_every_generation_shows_the_golden_hand_on_every_wire(model: str, wire: str) -> None:
    """The values of the dossier's section 10; no two are alike, so a swap would be seen."""
    hand = hand_on(model, wire)
    values = {(row["name"], row["finger"]): row["value"] for row in hand.dump().rows}
    assert hand.found().model == model
    assert values["id", None] == 1 and values["baud_code", None] == 0
    first = "m1" if model == DG2 else "little"
    for name, value in {"default_speed": 701, "default_force": 501, "stroke_set": 111, "force_limit": 401, "speed_set": 601,
                        "stroke_actual": 211, "force_actual": -11, "current": 21, "error": 0, "status": 2, "temperature": 31}.items():  # fmt: skip
        assert values[name, first] == value, name
    if model in (DF, TP):
        assert [values["angle_actual", part] for part in BYTE_MAP["angle_actual"].elements] == [
            110,
            220,
            330,
            440,
            550,
            660,
        ]
        assert [values["status", part] for part in BYTE_MAP["status"].elements] == [2, 1, 2, 3, 2, 0]
        assert [values["temperature", part] for part in BYTE_MAP["temperature"].elements] == [31, 32, 33, 34, 35, 36]
    assert ("current_limit", first) in values or model == TP
    assert (("system_voltage", None) in values) is (model == DF)
    assert [values.get(("ip_address", part)) for part in "abcd"] == ([192, 168, 11, 210] if model == TP else [None] * 4)


@each_row("model", [DF, TP, F1, DG2])
def test_the_two_books_agree(model: str) -> None:
    """Addresses, sizes, counts: the host's map against the simulator's, which was written apart."""
    elements = {row[1] + k * row[2]: row[2] for row in GENERATIONS[model].rows for k in range(row[3])}
    for register in MAPS[model]:
        if model in register.models:
            for index in range(register.count):
                assert elements[register.address_of(index)] == register.size, register.name


def test_identification_and_dump_cost_what_the_dossier_says() -> None:
    hand = hand_on(DF, typed=DF)
    hand.dump()
    assert hand.journal.counters.sent == 2
    live = hand_on(TP, TCP, typed=TP)
    live.read([element for name in live.live for element in live.map[name].each])
    assert live.journal.counters.sent == 1


def test_a_hand_that_is_silent_to_eb90_is_asked_in_modbus() -> None:
    hand = hand_on(DF, both=True, speaks="modbus")
    assert hand.dump().failure is None
    assert [message.code for message in hand.journal.messages] == ["protocol"]
    with pytest.raises(NoAnswer):
        hand_on(DF, both=True, fault="silent").dump()


def test_bytes_that_come_one_to_a_register_are_taken_so() -> None:
    """Seen on one hand over RTU: the six temperatures tell (rh56 §2.2)."""
    hand = hand_on(TP, RTU, fault="rtu-unpacked")
    warm = hand.read(hand.map["temperature"].each)
    assert [reading.value for reading in warm] == [31, 32, 33, 34, 35, 36]
    assert [reading.value for reading in hand.read(hand.map["status"].each)] == [2, 1, 2, 3, 2, 0]


def test_a_wrong_transaction_is_warned_of_and_taken() -> None:
    hand = hand_on(TP, TCP, fault="txid-off")
    assert hand.dump().failure is None
    assert hand.dump().failure is None
    (warning,) = [message for message in hand.journal.messages if message.code == "transaction-id"]
    assert hand.journal.times == {"transaction-id": hand.journal.counters.received}
    assert f"({hand.journal.times['transaction-id']} times)" in warning.text


def test_what_a_generation_has_not_is_said() -> None:
    hand = hand_on(TP)
    (reading,) = hand.read([BYTE_MAP.find("system_voltage")[1][0]])
    assert reading.error is not None and reading.error.code == "not-on-model"


# -- writing ----------------------------------------------------------------------------------------------------------


@each_row(("model", "wire"), [pair for pair in SPOKEN if pair[0] in (DF, TP)])
def test_a_write_is_read_back(model: str, wire: str) -> None:
    hand = hand_on(model, wire)
    hand.write([(element, 300 + element.index) for element in hand.map["default_speed"].each])
    assert [reading.value for reading in hand.read(hand.map["default_speed"].each)] == [
        300,
        301,
        302,
        303,
        304,
        305,
    ]


@pytest.mark.parametrize("wire", [EB90, RTU])
@pytest.mark.parametrize("model", [F1, DG2])
def test_nothing_is_written_to_a_hand_that_counts_words_unless_it_was_named(model: str, wire: str) -> None:
    """The same bytes do other things there: a save of one generation is the factory reset of the other."""
    for typed in (None, DF, TP):
        hand = hand_on(model, wire, typed=typed)
        with pytest.raises(HandctlError) as refused:
            hand.write(
                [
                    (
                        hand.map.find("default_speed.index")[1][0]
                        if "index" in hand.map["default_speed"].elements
                        else hand.map["default_speed"].each[0],
                        300,
                    )
                ]
            )
        assert refused.value.exit_code == 6 and hand.journal.counters.writes == 0
    named = hand_on(model, wire, typed=model)
    named.write([(named.map["default_speed"].each[0], 300)])
    assert named.read(named.map["default_speed"].each[:1])[0].value == 300


def test_a_model_that_the_hand_contradicts_is_refused() -> None:
    hand = hand_on(DF, typed=TP)
    with pytest.raises(DeviceRefused, match="--model tp"):
        hand.found()


@each_row(("address", "data"), [(1003, b"\1"), (1004, b"\1\1"), (1000, b"\2\0\0\0"), (1007, b"\1"), (1005, b"\1\1")])
def test_what_lies_beside_a_trigger_is_never_set_off_over_modbus(address: int, data: bytes) -> None:
    with pytest.raises(UsageError):
        hand_on(TP, TCP).bus.write_step(address, data, "")


# -- moving -----------------------------------------------------------------------------------------------------------


@each_row(("model", "wire"), [(DF, EB90), (TP, RTU), (TP, TCP), (TP, CAN)])
def test_a_finger_moves_to_its_angle_and_only_that(model: str, wire: str) -> None:
    hand = hand_on(model, wire)
    changes = [(hand.map.find("angle_set.index")[1][0], 300)]
    before = motion.fit_to_move(hand)
    question, shown = motion.question(hand, changes, before)
    assert shown.told(question).endswith("index 440 to 300 (speed 604, force limit 404 g)")
    rows = {row["name"]: row["value"] for row in motion.move(hand, "angle_set", changes, Prompts(), wait=3.0).rows}
    assert rows == {"angle_actual": 300, "status": 2}
    others = hand.read(hand.map["angle_set"].each)
    assert [reading.value for reading in others if reading.element.part != "index"] == [-1] * 5


def test_a_hand_with_errors_is_not_moved() -> None:
    with refused(CheckFailed, "not-fit"):
        motion.fit_to_move(hand_on(DF, fault="faults"))


@each_row("wire", [EB90, RTU, TCP, CAN])
def test_a_stop_sets_every_speed_to_zero(wire: str) -> None:
    hand = hand_on(TP, wire)
    assert hand.stop().error is None
    assert {reading.value for reading in hand.read(hand.map["speed_set"].each)} == {0}


def test_one_speed_that_does_not_stay_zero_is_told() -> None:
    hand = hand_on(TP, EB90)
    (index,) = hand.map.find("speed_set.index")[1]
    write = hand.link.write

    def written(data: bytes, deadline: Deadline) -> None:
        write(data, deadline)
        if data[4] == 0x12:  # behind the stop somebody else commands
            for part in hand.runs([(index, 300)]):
                write(hand.bus.write_step(*encoded(part), "").data, deadline)

    with mock.patch.object(hand.link, "write", written):
        stopped = hand.stop()
    assert stopped.error is DeviceRefused and "0 0 0 300 0 0" in stopped.text, stopped


# -- touch ------------------------------------------------------------------------------------------------------------


def test_zones_lie_as_the_dossier_has_them() -> None:
    assert len(ZONES) == 17 and sum(zone.size for zone in ZONES) == 2124
    assert all(one.address + one.size == two.address for one, two in pairwise(ZONES))
    assert ZONES[-1].place(0) == (8, 1) and ZONES[-1].place(7) == (1, 1) and ZONES[-1].place(8) == (8, 2)


def test_touch_over_tcp_in_few_reads_and_over_can_as_far_as_it_goes() -> None:
    hand = hand_on(TP, TCP, typed=TP)
    rows = tactile(hand, chosen([])).rows
    assert [row["value"] for row in rows] == list(range(1062))
    assert hand.journal.counters.sent <= 17
    can = hand_on(TP, CAN, typed=TP)
    assert {row["zone"] for row in tactile(can, chosen(["little", "palm"])).rows} == {
        "little_tip",
        "little_nail",
        "little_pad",
    }


# -- frames -----------------------------------------------------------------------------------------------------------


@each_row("wire", [RTU, TCP])
def test_the_host_makes_every_frame_of_the_vectors_and_takes_every_answer(wire: str) -> None:
    """The third book: transcripts/hand-rtu.txt and hand-tcp.txt."""
    seen = 0
    request = b""
    for line in (TRANSCRIPTS / f"hand-{wire}.txt").read_text(encoding="utf-8").splitlines():
        words = line.split()
        if not words or words[0] == "#" or not {">", "<"} & set(words[:2]):
            continue
        mark = words.index(">") if ">" in words[:2] else words.index("<")
        data = bytes.fromhex("".join(words[mark + 1 :]))
        if words[mark] == ">":
            request = data
            pdu = data[7:] if wire == TCP else data[1:-2]
            address = int.from_bytes(pdu[1:3], "big")
            if pdu[0] == modbus_frames.READ and int.from_bytes(pdu[3:5], "big") > modbus_frames.MAX_WORDS:
                request = b""
                continue  # more than the protocol allows: refused before it is sent
            body = pdu[3:] if pdu[0] == modbus_frames.WRITE_ONE else pdu[6:]
            made = (
                modbus_frames.read_request(address, int.from_bytes(pdu[3:5], "big"))
                if pdu[0] == modbus_frames.READ
                else modbus_frames.write_request(address, body)
            )
            transaction = int.from_bytes(data[:2], "big")
            assert (
                modbus_frames.tcp(transaction, made, data[6]) if wire == TCP else modbus_frames.rtu(data[0], made)
            ) == data, line
            seen += 1
        elif request:
            pdu = request[7:] if wire == TCP else request[1:-2]
            decoder = modbus_frames.TcpDecoder() if wire == TCP else modbus_frames.RtuDecoder(request[0], pdu)
            for byte in data:
                decoder.feed(bytes([byte]))
            answer = decoder.next()
            assert answer is not None and modbus_frames.answers(answer.pdu, pdu), line
    assert seen >= 8


class Hurried(SerialBus):
    """A computer that hears an answer late, unless it is given the patience of any read."""

    def read(self, address: int, count: int, *, retries: int | None = None) -> bytes:
        if self.timeout < 0.05:
            raise NoAnswer("late")
        return super().read(address, count, retries=retries)


@each_row("model", [DF, TP, F1, DG2])
def test_a_busy_computer_takes_no_late_answer_for_silence(model: str) -> None:
    link = open_link(f"fake://hand?model={model}&clock=virtual")
    assert isinstance(link, ByteLink)
    assert detect(Hurried(link, 1, Journal())).model == model


@pytest.mark.parametrize("model", ["df", "tp", "f1", "dg2"])
def test_a_generation_that_was_not_typed_has_the_same_quantities(model: str, tmp_path: Path) -> None:
    """An RH5DG2 has thirteen actuators: a name stands for all that the hand has, whether --model was typed or not."""
    link = ("-p", f"fake://hand?model={model}&clock=virtual", "--json")

    def seen(*words: str) -> list[tuple[object, object]]:
        result = run("hand", *words, *link)
        rows = result.stream[0] if words[0] == "watch" else result.rows
        assert result.code == 0, result
        return [(row["path"], row["value"]) for row in rows]

    for register in MAPS[model]:
        if register.readable and model in register.models and BYTE_MAP.get(register.name) is not None:
            assert seen("get", register.name) == seen("get", register.name, "--model", model)
    watched = seen("watch", "--count", "1")
    assert watched == seen("watch", "--count", "1", "--model", model)
    assert len(watched) == 7 * (13 if model == "dg2" else 6)
    assert run("hand", "snapshot", str(tmp_path / f"{model}.json"), *link).code == 0


def test_the_address_of_a_network_stands_in_one_piece() -> None:
    shown = run("hand", "dump", "-p", "fake://hand?clock=virtual").out.splitlines()
    assert "ip_address  192.168.11.210" in shown
    assert next(line for line in shown if line.startswith("Name  ")).split() == ["Name", "Value", "Meaning"]


@pytest.mark.parametrize("model", ["df", "tp", "f1", "dg2"])
@pytest.mark.parametrize(("option", "told"), [("fault=block-silent", []), ("speaks=modbus", ["protocol"])])
def test_a_hand_is_called_silent_in_eb90_only_where_it_is(model: str, option: str, told: list[str]) -> None:
    """A hand with word addresses may leave the first question unanswered, which asks for an address of the others."""
    result = run("hand", "get", "id", "-p", f"fake://hand?model={model}&clock=virtual&{option}", "--json")
    assert (result.code, result.rows[0]["value"], result.codes()) == (0, 1, told)


def test_a_temperature_that_was_not_measured_is_shown_as_none() -> None:
    with odd_registers(holds={1618: b"\xff" * 6}):
        done = run("hand", "status", "-p", "fake://hand?clock=virtual")
    assert (done.code, "255" in done.out) == (0, False), done
