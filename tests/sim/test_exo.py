"""The simulated exoskeleton hand: literal bytes in and out, on virtual time. Sections are those of the exo manual."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from handctl.sim import create
from handctl.sim.engine.line_and_faults import Line
from tests.support.each_row import each_row

READ_ID = "EB 90 01 04 11 E8 03 01 02"
ID_IS_1 = "90 EB 01 04 11 E8 03 01 02"
READ_VOLTAGE = "EB 90 01 04 11 C0 05 02 DD"
VOLTAGE = "90 EB 01 05 11 C0 05 2E 02 0C"
READ_POSITIONS = "EB 90 01 04 11 0A 06 0C 32"
POSITIONS = "90 EB 01 0F 11 0A 06 6E 00 DC 00 4A 01 B8 01 26 02 94 02 3D"
READ_ERRORS = "EB 90 01 04 11 46 06 05 67"
READ_SPEED = "EB 90 01 04 11 E9 03 01 03"
SAVE = "EB 90 01 04 12 ED 03 01 08"
SAVE_ACK = "90 EB 01 04 12 ED 03 01 08"
SAVED = "90 EB 01 04 11 ED 03 00 06"
CLEAR = "EB 90 01 04 12 EC 03 01 07"
CLEAR_ACK = "90 EB 01 04 12 EC 03 01 07"
CALIBRATE = "EB 90 01 04 12 F1 03 01 0C"
CALIBRATE_ACK = "90 EB 01 04 12 F1 03 01 0C"
CALIBRATED = "90 EB 01 04 11 02 00 00 18"
SPEED_1 = "EB 90 01 04 12 E9 03 01 04"
SPEED_1_ACK = "90 EB 01 04 12 E9 03 01 04"
ID_2 = "EB 90 01 04 12 E8 03 02 04"
DUMP_LIVE = "EB 90 01 04 11 C0 05 97 72"
DUMP_LIVE_REPLY = (
    "90 EB 01 9A 11 C0 05 2E 02 00 00 00 00 00 00 00 00 00 00 00 00 97 00 FC 00 61 01 C6 01 2B 02 00 00 C3 FF"
    " 3E 00 C1 FF 40 00 BF FF 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"
    " 00 00 00 00 00 00 00 00 00 00 00 6E 00 DC 00 4A 01 B8 01 26 02 94 02 00 00 00 00 00 00 00 00 00 00 00 00"
    " 00 00 00 00 00 00 00 00 00 00 00 00 F5 FF 0C 00 F3 FF 0E 00 F1 FF 00 00 15 00 16 00 17 00 18 00 19 00 00"
    " 00 00 00 00 00 00 00 00 00 00 00 00 00 1F 20 21 22 23 5C"
)


class Bench:
    """A line on virtual time; options as in a link, with _ for -."""

    def __init__(self, **options: object) -> None:
        self.line: Line = create("exo", {name.replace("_", "-"): str(value) for name, value in options.items()})
        self.now = 0.0
        self.line.advance(0.0)

    def ask(self, request: str) -> str:
        self.line.feed(bytes.fromhex(request))
        return self.heard()

    def heard(self) -> str:
        return self.line.take().hex(" ").upper()

    def wait(self, seconds: float) -> str:
        """Lets time pass at once; returns what came."""
        self.now += seconds
        self.line.advance(self.now)
        return self.heard()

    def numbers(self, address: int, count: int, size: int = 2) -> list[int]:
        """Signed values straight from memory, without a request."""
        data = bytes.fromhex(self.line.command(f"get {address} {count * size}"))
        return [int.from_bytes(data[at : at + size], "little", signed=size == 2) for at in range(0, count * size, size)]


# -- the bytes of a healthy hand --------------------------------------------------------------------------------------


@each_row(
    ("request_", "reply"),
    [
        pytest.param(READ_ID, ID_IS_1, id="id 2.2.3/2.3.1"),
        pytest.param(READ_VOLTAGE, VOLTAGE, id="presence probe 2.3"),
        pytest.param(
            "EB 90 01 04 11 E8 03 0A 0B",
            "90 EB 01 0D 11 E8 03 01 00 00 00 00 00 00 00 00 00 0B",
            id="dump, first read",
        ),
        pytest.param(DUMP_LIVE, DUMP_LIVE_REPLY, id="dump, second read"),
        pytest.param(READ_POSITIONS, POSITIONS, id="positions 2.3.9"),
        pytest.param(READ_ERRORS, "90 EB 01 08 11 46 06 00 00 00 00 00 66", id="no errors 2.3.12"),
        pytest.param(
            "EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0", "90 EB 01 04 12 CE 05 01 EB", id="positions 2.3.7"
        ),
        pytest.param("EB 90 01 05 12 D4 05 2C 01 1E", "90 EB 01 04 12 D4 05 01 F1", id="index only 2.3.7"),
        pytest.param(ID_2, "90 EB 02 04 12 E8 03 01 04", id="id change: ack from the new id 2.3.1"),
        pytest.param(SPEED_1, SPEED_1_ACK, id="speed code 2.3.2"),
        pytest.param(CLEAR, CLEAR_ACK, id="clear errors 2.3.3"),
        pytest.param(SAVE, SAVE_ACK, id="save 2.3.4"),
        pytest.param("EB 90 01 04 12 EE 03 01 09", "90 EB 01 04 12 EE 03 01 09", id="factory reset 2.3.5"),
        pytest.param(CALIBRATE, CALIBRATE_ACK, id="calibrate 2.3.6"),
        pytest.param(
            "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B",
            "90 EB 01 0D 31 6E 00 DC 00 4A 01 B8 01 26 02 94 02 4B",
            id="force command 2.2.1",
        ),
        pytest.param(
            "EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D",
            "90 EB 01 0B 32 F5 FF 0C 00 F3 FF 0E 00 F1 FF 2E",
            id="position command 2.2.2",
        ),
    ],
)
def test_request_gets_its_reply(request_: str, reply: str) -> None:
    bench = Bench()
    assert bench.ask(request_) == reply
    bytewise = Bench()
    for byte in bytes.fromhex(request_):
        bytewise.line.feed(bytes([byte]))
    assert bytewise.heard() == reply


def test_longest_read_has_length_byte_ff() -> None:
    """N = 252, exo §2.2.3."""
    reply = bytes.fromhex(Bench().ask("EB 90 01 04 11 C0 05 FC D7"))
    assert len(reply) == 260
    assert reply[3] == 255
    assert reply[7:158] == bytes.fromhex(DUMP_LIVE_REPLY)[7:158]
    assert reply[158:259] == bytes(101)
    assert sum(reply[2:259]) % 256 == reply[259]


def test_frames_printed_for_the_sibling() -> None:
    """Positions 100 100 100 100 1000 0."""
    bench = Bench()
    bench.line.command("set 1546 6400 6400 6400 6400 E803 0000")
    assert bench.ask(READ_POSITIONS) == "90 EB 01 0F 11 0A 06 64 00 64 00 64 00 64 00 E8 03 00 00 AC"


def test_new_id_answers_at_once_and_the_old_one_no_more() -> None:
    bench = Bench()
    bench.ask(ID_2)
    assert bench.ask(READ_ID) == ""
    assert bench.ask("EB 90 02 04 11 E8 03 01 03") == "90 EB 02 04 11 E8 03 02 04"


def test_ack_of_an_id_change_from_the_old_id() -> None:
    bench = Bench(ack_id="old")
    assert bench.ask(ID_2) == "90 EB 01 04 12 E8 03 01 03"
    assert bench.ask("EB 90 02 04 11 E8 03 01 03") == "90 EB 02 04 11 E8 03 02 04"


@each_row(
    ("options", "result"),
    [
        ({}, SAVED),
        ({"result_flag": 18}, "90 EB 01 04 12 ED 03 00 07"),
        ({"fault": "save-fails"}, "90 EB 01 04 11 ED 03 FF 05"),
        ({"fault": "save_fails", "result-flag": 18}, "90 EB 01 04 12 ED 03 FF 06"),
        ({"fault": "no-late-frames"}, ""),
    ],
)
def test_save_answers_twice(options: dict[str, object], result: str) -> None:
    """The second frame takes its second; 00 is success."""
    bench = Bench(**options)
    assert bench.ask(SAVE) == SAVE_ACK
    assert bench.line.next_event() == (1.0 if result else None)
    assert bench.wait(0.999) == ""
    assert bench.wait(0.001) == result
    assert bench.wait(10.0) == ""


def test_twin_of_the_save_result() -> None:
    """During the save's second a read of 1005 gives the same bytes as the result: why a host must not send it."""
    bench = Bench()
    bench.ask(SAVE)
    assert bench.ask("EB 90 01 04 11 ED 03 01 07") == SAVED


# -- requests a device must find, or leave alone --------------------------------------------------------------------------


@each_row(
    "noise",
    [
        "00 FF 12",
        "EB",
        "EB EB",
        "EB 90",
        "EB 90 EB 90",
        "EB 90 01",
        "EB 90 01 40 11",
        "EB 90 01 04 99",
        "EB 90 07 04 11 E8 03 01 08",
        "90 EB 01 04 11 E8 03 01 02",
        "EB 90 01 04 11 E8 03 01 03",
        "EB 90 01 0B 12 E8 03",  # a write of 8 bytes, cut: it ends with the request behind it and its sum is wrong
    ],
)
def test_request_behind_garbage(noise: str) -> None:
    """A candidate that fails costs one byte, never what follows."""
    for pieces in ([noise + READ_VOLTAGE], [noise, READ_VOLTAGE]):
        bench = Bench()
        assert "".join(bench.ask(piece) for piece in pieces) == VOLTAGE
        assert bench.ask(READ_ID) == ID_IS_1


def test_cut_request_is_forgotten_after_a_pause() -> None:
    bench = Bench()
    assert bench.ask("EB 90 01 FF 12 E8 03") == ""
    bench.wait(0.05)
    assert bench.ask(READ_ID) == ""  # taken for data of the long write
    bench.wait(0.2)
    assert bench.ask(READ_ID) == ID_IS_1


def test_request_in_two_pieces() -> None:
    bench = Bench()
    assert bench.ask(READ_ID[:11]) == ""
    bench.wait(0.09)
    assert bench.ask(READ_ID[12:]) == ID_IS_1


def test_requests_back_to_back() -> None:
    assert Bench().ask(READ_ID + READ_VOLTAGE + READ_ID) == f"{ID_IS_1} {VOLTAGE} {ID_IS_1}"


def test_id_change_counts_for_the_next_request_of_the_same_write() -> None:
    assert (
        Bench().ask(ID_2 + READ_ID + "EB 90 02 04 11 E8 03 01 03")
        == "90 EB 02 04 12 E8 03 01 04 90 EB 02 04 11 E8 03 02 04"
    )


@each_row(
    ("number", "request_", "reply"),
    [
        (235, "EB 90 EB 04 11 E8 03 01 EC", "90 EB EB 04 11 E8 03 EB D6"),
        (144, "EB 90 90 04 11 E8 03 01 91", "90 EB 90 04 11 E8 03 90 20"),
        (180, "EB 90 B4 04 11 C0 05 02 90", "90 EB B4 05 11 C0 05 2E 02 BF"),
    ],
)
def test_awkward_ids(number: int, request_: str, reply: str) -> None:
    """Ids 235 and 144 put a header at offset 1; the request to 180 ends in the header's first byte."""
    assert Bench(id=number).ask(request_) == reply
    assert Bench(id=number, fault="echo").ask(request_) == f"{request_} {reply}"


@each_row(
    "request_",
    [
        pytest.param("EB 90 02 04 11 E8 03 01 03", id="wrong id"),
        pytest.param("EB 90 01 04 11 E8 03 01 03", id="bad sum"),
        pytest.param("90 EB 01 04 11 E8 03 01 02", id="our own header"),
        pytest.param("EB 90 01 04 30 FC 03 02 36", id="flag of the wrist"),
        pytest.param("EB 90 01 07 31 0E 04 E8 03 18 FC 4A", id="write of the wrist"),
        pytest.param("EB 90 01 04 11 E8 03 00 01", id="count 0"),
        pytest.param("EB 90 01 04 11 C0 05 FD D8", id="count 253"),
        pytest.param("EB 90 01 04 11 FF FF 02 16", id="past the last address"),
        pytest.param("EB 90 01 03 12 E8 03 01", id="write of nothing"),
        pytest.param("EB 90 00 04 11 E8 03 01 01", id="id 0"),
    ],
)
def test_silence(request_: str) -> None:
    assert Bench().ask(request_) == ""


def test_last_address_reads_zero() -> None:
    assert Bench().ask("EB 90 01 04 11 FF FF 01 15") == "90 EB 01 04 11 FF FF 00 14"


# -- writes ---------------------------------------------------------------------------------------------------------------


@each_row(
    "request_",
    [
        pytest.param("EB 90 01 05 12 0A 06 01 01 2A", id="read-only position"),
        pytest.param("EB 90 01 04 12 EA 03 01 05", id="gap 1002"),
        pytest.param("EB 90 01 04 12 E8 03 00 02", id="id 0"),
        pytest.param("EB 90 01 04 12 E8 03 FF 01", id="id 255"),
        pytest.param("EB 90 01 04 12 E9 03 03 06", id="speed code 3"),
        pytest.param("EB 90 01 04 12 EC 03 02 08", id="clear errors 2"),
        pytest.param("EB 90 01 05 12 CE 05 E9 03 D7", id="position 1001"),
        pytest.param("EB 90 01 05 12 CE 05 FE FF E8", id="position -2"),
        pytest.param("EB 90 01 05 12 DA 05 17 FC 0A", id="force -1001"),
    ],
)
def test_impossible_write_changes_nothing(request_: str) -> None:
    """Acknowledged all the same; silence in the state strict."""
    bench = Bench()
    before = bench.ask(DUMP_LIVE)
    assert bench.ask(request_).startswith("90 EB 01 04 12 ")
    assert bench.wait(1.0) == ""
    assert bench.ask(DUMP_LIVE) == before
    assert bench.ask(READ_ID) == ID_IS_1
    assert Bench(fault="strict").ask(request_) == ""


def test_strict_answers_possible_writes() -> None:
    bench = Bench(fault="strict")
    assert bench.ask("EB 90 01 05 12 D4 05 2C 01 1E") == "90 EB 01 04 12 D4 05 01 F1"
    assert bench.ask("EB 90 01 0B 32 F4 01 F4 01 FF FF 00 00 F4 01 1B") == ""


def test_write_across_gap_takes_what_is_writable() -> None:
    """Six 16-bit values at 1486, as software for the sibling writes them: the sixth falls into a gap."""
    bench = Bench()
    ack = bench.ask("EB 90 01 0F 12 CE 05 01 00 02 00 03 00 04 00 05 00 06 00 0A")
    assert ack == "90 EB 01 04 12 CE 05 01 EB"
    assert bench.numbers(1486, 6) == [1, 2, 3, 4, 5, 0]


def test_half_a_register() -> None:
    """The low byte of the little finger's set value, 151 = 0097, becomes 0001."""
    bench = Bench()
    bench.ask("EB 90 01 04 12 CE 05 01 EB")
    assert bench.numbers(1486, 5) == [1, 252, 353, 454, 555]


def test_triggers_read_back_as_zero() -> None:
    bench = Bench()
    for request in (CLEAR, SAVE, "EB 90 01 04 12 EE 03 01 09"):
        bench.ask(request)
    bench.wait(2.0)
    assert bench.ask("EB 90 01 04 11 EC 03 06 0B") == "90 EB 01 09 11 EC 03 00 00 00 00 00 00 0A"


def test_refused_write_changes_nothing_and_reads_stay_healthy() -> None:
    bench = Bench(fault="refuse")
    assert bench.ask("EB 90 01 05 12 D4 05 2C 01 1E") == "90 EB 01 04 12 D4 05 00 F0"
    assert bench.ask(SAVE) == "90 EB 01 04 12 ED 03 00 07"
    assert bench.wait(3.0) == ""
    assert bench.ask(ID_2) == "90 EB 01 04 12 E8 03 00 02"
    assert bench.ask("EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B").startswith("90 EB 01 0D 31 6E 00")
    assert bench.ask(DUMP_LIVE) == DUMP_LIVE_REPLY


# -- id, speed, flash, power ----------------------------------------------------------------------------------------------


def test_unsaved_changes_are_lost_with_the_power() -> None:
    bench = Bench()
    bench.ask(SPEED_1)
    bench.ask(ID_2)
    bench.line.power_cycle()
    assert bench.ask(READ_ID) == ID_IS_1
    assert bench.ask(READ_SPEED) == "90 EB 01 04 11 E9 03 00 02"
    assert bench.line.device.speed == 115200


def test_speed_acts_after_save_and_power_cycle() -> None:
    bench = Bench()
    bench.line.client_baud = 115200
    assert bench.ask(SPEED_1) == SPEED_1_ACK
    assert bench.ask(READ_SPEED) == "90 EB 01 04 11 E9 03 01 03"
    assert bench.ask(SAVE) == SAVE_ACK
    assert bench.wait(1.0) == SAVED
    assert bench.ask(READ_ID) == ID_IS_1  # still at the old speed
    bench.line.power_cycle()
    assert bench.ask(READ_ID) == ""
    bench.line.client_baud = 57600
    assert bench.ask(READ_ID) == ID_IS_1


def test_failed_save_keeps_the_old_flash() -> None:
    bench = Bench(fault="save-fails")
    bench.ask(ID_2)
    bench.ask("EB 90 02 04 12 ED 03 01 09")
    bench.wait(2.0)
    bench.line.power_cycle()
    assert bench.ask(READ_ID) == ID_IS_1


def test_saved_id_survives() -> None:
    bench = Bench()
    bench.ask(ID_2)
    assert bench.ask("EB 90 02 04 12 ED 03 01 09") == "90 EB 02 04 12 ED 03 01 09"
    assert bench.wait(1.0) == "90 EB 02 04 11 ED 03 00 07"
    bench.line.power_cycle()
    assert bench.ask("EB 90 02 04 11 E8 03 01 03") == "90 EB 02 04 11 E8 03 02 04"


def test_power_cycle_drops_the_late_frame_and_the_set_points() -> None:
    bench = Bench()
    bench.ask("EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0")
    bench.ask(SAVE)
    bench.wait(0.5)
    bench.line.power_cycle()
    assert bench.wait(5.0) == ""
    assert bench.numbers(1486, 5) == [151, 252, 353, 454, 555]


def test_no_power_no_answer() -> None:
    bench = Bench()
    assert bench.line.command("power off") == "power off"
    assert bench.ask(READ_ID) == ""
    assert bench.line.next_event() is None
    assert bench.line.command("power on") == "power on"
    assert bench.ask(READ_ID) == ID_IS_1


def test_fingers_stay_where_they_are_without_power() -> None:
    bench = Bench()
    bench.ask("EB 90 01 05 12 D4 05 E8 03 DC")  # index to 1000
    bench.wait(0.2)
    bench.line.power_cycle()
    bench.wait(5.0)
    assert bench.numbers(1546, 6) == [110, 220, 330, 690, 550, 660]


def test_factory_reset_is_not_saved() -> None:
    bench = Bench(id=7)
    assert bench.ask("EB 90 07 04 12 EE 03 01 0F") == "90 EB 01 04 12 EE 03 01 09"
    assert bench.ask(READ_ID) == ID_IS_1
    bench.line.power_cycle()
    assert bench.ask(READ_ID) == ""
    assert bench.ask("EB 90 07 04 11 E8 03 01 08") == "90 EB 07 04 11 E8 03 07 0E"


def test_speed_code_where_the_sibling_has_it() -> None:
    bench = Bench(fault="baud-at-1002")
    assert bench.ask(SPEED_1) == SPEED_1_ACK
    assert bench.ask(READ_SPEED) == "90 EB 01 04 11 E9 03 00 02"
    bench.ask("EB 90 01 04 12 EA 03 01 05")
    assert bench.numbers(1001, 2, size=1) == [0, 1]


# -- motion, force, heat ------------------------------------------------------------------------------------------------------


def test_set_points_of_power_on_move_nothing() -> None:
    bench = Bench()
    bench.wait(60.0)
    assert bench.ask(DUMP_LIVE) == DUMP_LIVE_REPLY


def test_fingers_move_1250_units_a_second() -> None:
    """500, 500, -1, 0, 500 from 110, 220, 330, 440, 550: the example of exo §2.3.7."""
    bench = Bench()
    bench.ask("EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0")
    bench.wait(0.02)
    assert bench.numbers(1546, 6) == [135, 245, 330, 415, 525, 660]
    currents = bench.numbers(1594, 5)
    assert all(150 <= current <= 175 for current in currents[:2] + currents[3:]), currents
    assert currents[2] == 23
    bench.wait(0.38)
    assert bench.numbers(1546, 6) == [500, 500, 330, 0, 500, 660]
    assert bench.numbers(1594, 5) == [21, 22, 23, 24, 25]


def test_many_small_steps_give_what_one_jump_gives() -> None:
    benches = [Bench(), Bench()]
    for bench in benches:
        bench.ask("EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D")
    for _ in range(1000):
        benches[0].wait(0.0015)
    benches[1].wait(1.5)
    assert benches[0].numbers(1472, 75) == benches[1].numbers(1472, 75)
    assert benches[1].numbers(1546, 5) == [500, 400, 300, 200, 100]


def test_minus_one_stops_a_moving_finger() -> None:
    bench = Bench()
    bench.ask("EB 90 01 05 12 D4 05 E8 03 DC")  # index to 1000
    bench.wait(0.2)
    bench.ask("EB 90 01 05 12 D4 05 FF FF EF")
    bench.wait(1.0)
    assert bench.numbers(1552, 1) == [690]


def test_position_command_with_minus_one_leaves_the_finger_alone() -> None:
    bench = Bench()
    assert bench.ask("EB 90 01 0B 32 F4 01 F4 01 FF FF 00 00 F4 01 1B").startswith("90 EB 01 0B 32")
    bench.wait(1.0)
    assert bench.numbers(1546, 5) == [500, 500, 330, 0, 500]
    assert bench.numbers(1486, 5) == [500, 500, 353, 0, 500]


def test_force_command_moves_the_readings_to_the_set_values() -> None:
    """The user's reaction has the sign of the set value, exo §2.2.1 note 1 and §2.2.2 note 1."""
    bench = Bench()
    bench.ask("EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B")
    bench.wait(0.01)
    assert bench.numbers(1582, 5) == [29, -28, 0, 54, -55]
    bench.wait(1.0)
    assert bench.numbers(1582, 5) == [100, -100, 0, 1000, -1000]
    assert bench.numbers(1498, 5) == [100, -100, 0, 1000, -1000]
    assert bench.numbers(1546, 6) == [110, 220, 330, 440, 550, 660]


def test_blocked_finger_stops_draws_current_and_sets_bit_0() -> None:
    bench = Bench()
    bench.ask("EB 90 01 05 12 D4 05 E8 03 DC")  # index to 1000
    bench.wait(0.2)
    assert bench.line.command("block index") == "block index"
    bench.wait(0.15)
    assert bench.numbers(1552, 1) == [690]
    assert 400 < bench.numbers(1600, 1)[0] < 500
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"
    bench.wait(0.15)
    assert bench.numbers(1600, 1) == [900]
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 01 00 67"
    assert bench.ask(CLEAR) == CLEAR_ACK
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"
    bench.wait(0.4)  # the cause is still there
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 01 00 67"
    bench.line.command("release index")
    bench.ask(CLEAR)
    bench.wait(1.0)
    assert bench.numbers(1552, 1) == [1000]
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"


def test_pressing_on_heats_until_bit_1_sets_and_only_cooling_clears_it() -> None:
    bench = Bench(fault="blocked")
    bench.ask("EB 90 01 05 12 D4 05 E8 03 DC")
    bench.wait(10.0)
    warm = bench.numbers(1621, 1, size=1)[0]
    assert 34 < warm < 50
    bench.wait(290.0)
    assert bench.numbers(1621, 1, size=1)[0] > 80
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 03 00 69"
    bench.ask("EB 90 01 05 12 D4 05 FF FF EF")  # let go
    bench.ask(CLEAR)
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 02 00 68"
    bench.wait(300.0)
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"


def test_jitter_only_on_request() -> None:
    bench = Bench(jitter=1)
    rows = {tuple(bench.numbers(1582, 11)) for _ in range(10)}
    assert len(rows) > 5
    assert all(abs(row[0] + 11) <= 2 for row in rows)


# -- device states ------------------------------------------------------------------------------------------------------------


@each_row(
    ("fault", "reply"),
    [
        ("faults", "90 EB 01 08 11 46 06 01 02 04 06 18 8B"),
        ("locked-rotor", "90 EB 01 08 11 46 06 01 00 00 00 00 67"),
        ("over-temperature", "90 EB 01 08 11 46 06 00 02 00 00 00 68"),
        ("over-current", "90 EB 01 08 11 46 06 00 00 04 00 00 6A"),
        ("motor-abnormal", "90 EB 01 08 11 46 06 00 00 00 00 08 6E"),
        ("communication", "90 EB 01 08 11 46 06 00 00 00 00 10 76"),
        ("motor-abnormal,communication", "90 EB 01 08 11 46 06 00 00 00 00 18 7E"),
        ("unknown-bits", "90 EB 01 08 11 46 06 00 00 00 A0 00 06"),
        ("hot", "90 EB 01 08 11 46 06 02 02 02 02 02 70"),
        ("hot,locked-rotor", "90 EB 01 08 11 46 06 03 02 02 02 02 71"),
    ],
)
def test_error_bits(fault: str, reply: str) -> None:
    bench = Bench(fault=fault)
    assert bench.ask(READ_ERRORS) == reply
    bench.wait(0.5)
    assert bench.ask(READ_ERRORS) == reply
    assert Bench(fault="fresh," + fault).ask(READ_ERRORS) == reply


def test_clear_errors_leaves_over_temperature() -> None:
    """exo §2.3.3: not clearable."""
    bench = Bench(fault="faults")
    assert bench.ask(CLEAR) == CLEAR_ACK
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 02 00 02 00 6A"
    assert bench.numbers(1618, 5, size=1) == [31, 78, 33, 78, 35]
    bench.wait(600.0)
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 02 00 02 00 6A"
    bench.line.command("fault none")
    bench.wait(600.0)
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"


def test_hot_cools_down_by_itself() -> None:
    bench = Bench(fault="hot")
    assert bench.numbers(1618, 5, size=1) == [71, 72, 73, 74, 75]
    bench.wait(10.0)
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 02 02 02 02 02 70"
    bench.wait(30.0)
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"
    bench.wait(1000.0)
    assert bench.numbers(1618, 5, size=1) == [31, 32, 33, 34, 35]


def test_fresh_shows_minus_one() -> None:
    assert Bench(fault="fresh").numbers(1486, 5) == [-1, -1, -1, -1, -1]


def test_foreign_device_is_out_of_range() -> None:
    bench = Bench(fault="foreign")
    assert bench.ask(READ_VOLTAGE) == "90 EB 01 05 11 C0 05 00 00 DC"
    assert bench.numbers(1486, 5) == [3000, 3001, 3002, 3003, 3004]


@each_row(
    ("request_", "answers"),
    [
        (READ_ID, True),
        ("EB 90 01 04 11 E8 03 02 03", True),  # 1000, 1001
        ("EB 90 01 04 11 E8 03 03 04", False),  # 1002 is not documented
        (READ_POSITIONS, True),
        (DUMP_LIVE, False),
    ],
)
def test_block_silent(request_: str, answers: bool) -> None:
    assert bool(Bench(fault="block-silent").ask(request_)) is answers


# -- calibration ----------------------------------------------------------------------------------------------------------------


def test_calibration_course() -> None:
    """exo §2.3.6: five poses, 9 s of waits and the movements between them, then one frame with address 0002."""
    bench = Bench()
    assert bench.ask(CALIBRATE) == CALIBRATE_ACK
    end = bench.line.next_event()
    assert end is not None
    # 890, 1000, 1000 and 500 units at 1250 per second
    assert end == pytest.approx(9.0 + 0.712 + 0.8 + 0.8 + 0.4)
    poses = {
        0.9: [110, 220, 330, 440, 550, 660],
        3.6: [1000, 1000, 1000, 1000, 1000, 660],
        6.4: [0, 0, 0, 0, 1000, 660],
        9.2: [1000, 1000, 1000, 1000, 0, 0],
        11.7: [500, 500, 500, 500, 400, 0],
    }
    for when, pose in poses.items():
        bench.wait(when - bench.now)
        assert bench.numbers(1546, 6) == pose, when
        assert bench.ask(READ_ID) == "", "deaf during the course"
    assert bench.wait(1.0) == CALIBRATED
    assert bench.ask(READ_ID) == ID_IS_1
    assert bench.numbers(1582, 5) == [0, 0, 0, 0, 0]
    bench.wait(5.0)
    assert bench.numbers(1546, 6) == [500, 500, 500, 500, 400, 0]


def test_calibration_time_can_be_set() -> None:
    bench = Bench(calibration=0.5)
    bench.ask(CALIBRATE)
    assert bench.line.next_event() == pytest.approx(0.5)
    assert bench.wait(0.499) == ""
    assert bench.wait(0.001) == CALIBRATED
    assert bench.numbers(1546, 6) == [500, 500, 500, 500, 400, 0]
    assert Bench(calibration=0).ask(CALIBRATE) == f"{CALIBRATE_ACK} {CALIBRATED}"


def test_calibration_without_end_frame() -> None:
    bench = Bench(fault="no-late-frames")
    assert bench.ask(CALIBRATE) == CALIBRATE_ACK
    assert bench.wait(60.0) == ""
    assert bench.ask(READ_ID) == ID_IS_1


def test_power_cycle_ends_a_calibration() -> None:
    bench = Bench()
    bench.ask(CALIBRATE)
    bench.wait(3.0)
    bench.line.power_cycle()
    assert bench.ask(READ_ID) == ID_IS_1
    assert bench.wait(30.0) == ""


# -- state file -------------------------------------------------------------------------------------------------------------------


def test_state_file_continues(tmp_path: Path) -> None:
    state = tmp_path / "hand.json"
    first = Bench(state=state)
    first.ask(SPEED_1)
    first.ask(SAVE)
    first.ask("EB 90 01 05 12 D4 05 2C 01 1E")  # index to 300, not awaited
    first.ask("EB 90 01 05 12 DA 05 F4 01 EC")  # force of the little finger 500
    first.ask(ID_2)
    first.line.close()
    second = Bench(state=state)
    assert second.ask("EB 90 02 04 11 E8 03 02 04") == "90 EB 02 05 11 E8 03 02 01 06"
    assert second.line.device.speed == 115200
    second.wait(1.0)
    assert second.numbers(1486, 5) == [151, 252, 353, 300, 555]
    assert second.numbers(1546, 6) == [110, 220, 330, 300, 550, 660]
    assert second.numbers(1582, 5) == [500, 12, -13, 14, -15]
    second.line.close()
    third = Bench(state=state, power_cycle=1)
    assert third.line.device.speed == 57600
    assert third.ask(READ_ID) == ID_IS_1  # the new id was not saved
    assert third.numbers(1546, 6) == [110, 220, 330, 300, 550, 660]
    assert third.numbers(1486, 5) == [151, 252, 353, 454, 555]


def test_state_is_written_with_each_write_even_without_close(tmp_path: Path) -> None:
    state = tmp_path / "hand.json"
    bench = Bench(state=state)
    bench.ask(READ_ID)
    assert not state.exists()
    bench.ask(ID_2)
    saved = json.loads(state.read_text())
    assert saved["kind"] == "exo"
    assert saved["simulated"] is True
    assert saved["flash"] == {"id": 1, "speed_code": 0}
    assert saved["ram"]["1000"].startswith("02")
    assert saved["positions"] == [110, 220, 330, 440, 550, 660]
    assert list(tmp_path.iterdir()) == [state], "no temporary file is left"


def test_heat_and_errors_are_kept(tmp_path: Path) -> None:
    state = tmp_path / "hand.json"
    first = Bench(state=state, fault="blocked")
    first.ask("EB 90 01 05 12 D4 05 E8 03 DC")
    first.wait(300.0)
    first.line.close()
    second = Bench(state=state)
    assert second.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 03 00 69"
    assert second.numbers(1621, 1, size=1)[0] > 80


def test_poked_memory_is_kept(tmp_path: Path) -> None:
    state = tmp_path / "hand.json"
    first = Bench(state=state)
    assert first.line.command("set 1612 01 02 03 00 00 00 07") == "set 1612 01 02 03 00 00 00 07"
    first.line.close()
    second = Bench(state=state)
    assert second.numbers(1612, 6, size=1) == [1, 2, 3, 0, 0, 0]


@each_row(
    "text",
    [
        "",
        "{",
        "[]",
        "{}",
        '{"format": "handctl-sim/1", "kind": "exo"}',
        '{"format": "handctl-sim/9", "kind": "exo"}',
        '{"format": "handctl-sim/1", "kind": "wrist"}',
        "\x00\xff",
    ],
)
def test_damaged_state_file(tmp_path: Path, text: str) -> None:
    state = tmp_path / "hand.json"
    state.write_text(text, encoding="latin-1")
    with pytest.raises(ValueError, match=r"hand\.json") as caught:
        Bench(state=state)
    assert "\n" not in str(caught.value)
    assert state.read_text(encoding="latin-1") == text


@each_row(
    ("key", "value"),
    [
        ("flash", {"id": 0, "speed_code": 0}),
        ("flash", {"id": 1, "speed_code": 3}),
        ("flash", 1),
        ("port_speed", 9600),
        ("ram", {"4090": "01 02 03 04 05 06 07"}),
        ("ram", {"x": "01"}),
        ("ram", []),
        ("ram", {"1000": "zz"}),
        ("positions", [0, 0, 0, 0, 0]),
        ("positions", [0, 0, 0, 0, 0, 1001]),
        ("targets", [0, 0, 0, 0, 0, "x"]),
        ("temperatures", None),
        ("errors", [0, 0, 0, 0, None]),
    ],
)
def test_impossible_state(tmp_path: Path, key: str, value: object) -> None:
    state = tmp_path / "hand.json"
    Bench(state=state).line.close()
    good = json.loads(state.read_text())
    state.write_text(json.dumps({**good, key: value}))
    with pytest.raises(ValueError, match="damaged"):
        Bench(state=state)


def test_state_file_without_a_directory(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no directory"):
        Bench(state=tmp_path / "nowhere" / "hand.json")


# -- control commands -----------------------------------------------------------------------------------------------------------------


def test_poke_and_peek() -> None:
    bench = Bench()
    assert bench.line.command("set 1472 52 03") == "set 1472 52 03"
    assert bench.line.command("get 1472 2") == "52 03"
    assert bench.ask(READ_VOLTAGE) == "90 EB 01 05 11 C0 05 52 03 31"
    bench.line.command("set 1582 E803")
    bench.line.command("set 1594 0700")
    bench.line.command("set 1606 06")
    bench.line.command("set 1556 0000")
    bench.wait(1.0)
    assert bench.numbers(1582, 2) == [1000, 12]
    assert bench.numbers(1594, 2) == [7, 22]
    assert bench.numbers(1606, 2, size=1) == [6, 0]
    assert bench.numbers(1554, 2) == [550, 0]


def test_temperature_command() -> None:
    bench = Bench()
    assert bench.line.command("temperature thumb 71") == "temperature thumb 71"
    assert bench.numbers(1618, 5, size=1) == [31, 32, 33, 34, 71]
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 02 68"
    bench.line.command("temperature thumb 40")
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 00 00 00 00 66"


def test_limit_option() -> None:
    bench = Bench(limit=50)
    bench.line.command("temperature ring 51")
    assert bench.ask(READ_ERRORS) == "90 EB 01 08 11 46 06 00 02 00 00 00 68"


@each_row(
    "text",
    [
        "set",
        "set 1472",
        "set x 00",
        "set 1472 0",
        "set 1472 xx",
        "set 4095 00 00",
        "set -1 00",
        "set 99999 00",
        "get 1472",
        "get 1472 0",
        "temperature elbow 40",
        "temperature thumb 400",
        "temperature thumb warm",
        "block",
        "block nose",
        "dance",
        "power",
        "fault",
        "fault dance",
    ],
)
def test_bad_command(text: str) -> None:
    with pytest.raises(ValueError, match=r"\S") as caught:
        Bench().line.command(text)
    assert "\n" not in str(caught.value)


@each_row("what", ["a pipe", "a device", "a folder", "too large"])
def test_a_state_that_may_be_without_end_is_not_read(what: str, tmp_path: Path) -> None:
    path = {"a device": "/dev/zero", "a folder": str(tmp_path)}.get(what, str(tmp_path / "state"))
    if what == "a pipe":
        os.mkfifo(path)
    elif what == "too large":
        os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 1 << 32)
    with pytest.raises(ValueError, match=r"cannot be read: (it is|larger than 4 MB)"):
        Bench(state=Path(path))
