"""The simulated wrist on both wires: literal bytes and frames in and out, on virtual time. Sections are those of the
wrist's manual; RH56 is the sibling hand's.
"""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.sim import create, kinds, model_class
from handctl.sim.engine.can_line import CAN_FAULTS, CanLine
from handctl.sim.engine.line_and_faults import LINE_FAULTS, Line
from tests.support.each_row import each_row

DUMP = "EB 90 01 04 30 FC 03 18 4C"
DUMP_REPLY = "90 EB 01 1B 30 FC 03 A7 FE 65 04 6F 00 DE 00 00 00 00 00 1F 22 00 00 00 00 4C 04 D4 FE BC 02 C7"
PROBE = "EB 90 01 04 30 FC 03 02 36"
PROBE_REPLY = "90 EB 01 05 30 FC 03 A7 FE DA"
CURRENTS = "EB 90 01 04 30 00 04 04 3D"
CURRENTS_REPLY = "90 EB 01 07 30 00 04 6F 00 DE 00 89"
ERRORS = "EB 90 01 04 30 04 04 03 40"
MOVE = "EB 90 01 07 31 0E 04 E8 03 18 FC 4A"  # yaw 10.00°, pitch -10.00°
MOVE_ACK = "90 EB 01 04 31 0E 04 01 49"
MOVE_TIMED = "EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37"  # the same in 1000 ms
VOLTAGE = "EB 90 01 04 11 C0 05 02 DD"  # 1472 of the hand
VOLTAGE_REPLY = "90 EB 01 05 11 C0 05 32 02 10"
READ_ID = "EB 90 01 04 11 E8 03 01 02"
ID_IS_1 = "90 EB 01 04 11 E8 03 01 02"
SAVE = "EB 90 01 04 12 ED 03 01 08"
SAVE_ACK = "90 EB 01 04 12 ED 03 01 08"
CLEAR = "EB 90 01 04 12 EC 03 01 07"
CLEAR_ACK = "90 EB 01 04 12 EC 03 01 07"
BYTE = 10 / 115200

CAN_DUMP = ["10FF0001 08", "11010001 08", "11030001 08"]
CAN_DUMP_REPLY = [
    "10FF0001 A7 FE 65 04 6F 00 DE 00",
    "11010001 00 00 00 00 1F 22 00 00",
    "11030001 00 00 4C 04 D4 FE BC 02",
]
CAN_MOVE = "15038001 E8 03 18 FC"
CAN_PROBE = "10FF0001 02"
CAN_PROBE_REPLY = "10FF0001 A7 FE"


def options_of(given: dict[str, object]) -> dict[str, str]:
    return {name.replace("_", "-"): str(value) for name, value in given.items()}


class Wired:
    """What both benches share: virtual time and a look into memory."""

    line: Any
    now = 0.0

    def heard(self) -> Any:
        raise NotImplementedError

    def wait(self, seconds: float) -> Any:
        """Lets time pass at once; returns what came."""
        self.now += seconds
        self.line.advance(self.now)
        return self.heard()

    def values(self, *addresses: int, space: str = "get") -> list[int]:
        """Signed 16-bit values straight from memory, without a request."""
        rows = [bytes.fromhex(self.line.command(f"{space} {address} 2")) for address in addresses]
        return [int.from_bytes(row, "little", signed=True) for row in rows]

    def angles(self) -> list[int]:
        """Pitch and yaw."""
        return self.values(1020, 1022)

    def errors(self) -> list[int]:
        return [bytes.fromhex(self.line.command(f"get {address} 1"))[0] for address in (1028, 1030)]

    def degrees(self) -> list[int]:
        return list(bytes.fromhex(self.line.command("get 1032 2")))


class Bench(Wired):
    """A serial line on virtual time; options as in a link, with _ for -."""

    def __init__(self, **options: object) -> None:
        self.line: Line = create("wrist", options_of(options))
        assert isinstance(self.line, Line)
        self.line.advance(0.0)

    def ask(self, request: str) -> str:
        self.line.feed(bytes.fromhex(request))
        return self.heard()

    def heard(self) -> str:
        return self.line.take().hex(" ").upper()


class CanBench(Wired):
    """A CAN bus on virtual time; a frame is written as 8 digits of identifier and the data."""

    def __init__(self, **options: object) -> None:
        self.line: CanLine = create("wrist", {"bus": "can", **options_of(options)})
        assert isinstance(self.line, CanLine)
        self.line.advance(0.0)

    def send(self, frame: str) -> None:
        self.line.feed_frame(int(frame[:8], 16), bytes.fromhex(frame[8:]))

    def ask(self, frame: str) -> list[str]:
        self.send(frame)
        return self.heard()

    def heard(self) -> list[str]:
        return [f"{number:08X} {data.hex(' ').upper()}".rstrip() for number, data in self.line.take_frames()]

    def run(self) -> list[tuple[float, str]]:
        """Drives the bus from event to event as a server does; what came, and when."""
        came: list[tuple[float, str]] = []
        while (event := self.line.next_event()) is not None:
            self.line.advance(event)
            frames = self.heard()
            came += [(event, frame) for frame in frames]
            after = self.line.next_event()
            assert after is None or after > event or frames, "an event that leads nowhere"
        return came


def on_both(**options: object) -> list[Any]:
    return [Bench(**options), CanBench(**options)]


def move(bench: Any, yaw: int, pitch: int, time: int | None = None) -> None:
    """One write of 1038.., with the means of the wire."""
    data = b"".join(value.to_bytes(2, "little", signed=value < 0) for value in (yaw, pitch, time) if value is not None)
    if isinstance(bench, CanBench):
        assert bench.ask(f"15038001 {data.hex()}") == ["15038001"]
        return
    body = bytes([1, len(data) + 3, 0x31, 0x0E, 0x04]) + data
    assert bench.ask((b"\xeb\x90" + body + bytes([sum(body) % 256])).hex()) == MOVE_ACK


def test_it_is_known() -> None:
    assert "wrist" in kinds()
    assert model_class("wrist") is not model_class("wrist", "can")
    assert model_class("wrist").KIND == model_class("wrist", "can").KIND == "wrist"


# -- serial: the bytes of a healthy wrist ------------------------------------------------------------------------------


@each_row(
    ("request_", "reply"),
    [
        pytest.param(DUMP, DUMP_REPLY, id="dump 2.1/2.2"),
        pytest.param(PROBE, PROBE_REPLY, id="presence probe, the request printed in 2.2"),
        pytest.param(CURRENTS, CURRENTS_REPLY, id="both currents 2.2"),
        pytest.param(MOVE, MOVE_ACK, id="angles as the text of 2.2.1 asks"),
        pytest.param("EB 90 01 07 31 0E 04 18 FC EB 03 4D", MOVE_ACK, id="angles as printed in 2.2.1"),
        pytest.param(MOVE_TIMED, MOVE_ACK, id="angles and time in one write 2.1/2.2.1"),
        pytest.param(ERRORS, "90 EB 01 06 30 04 04 00 00 00 3F", id="no errors 2.1"),
        pytest.param(VOLTAGE, VOLTAGE_REPLY, id="voltage of the hand, RH56"),
        pytest.param(READ_ID, ID_IS_1, id="id of the hand, RH56"),
        pytest.param("EB 90 01 04 11 10 06 02 2E", "90 EB 01 05 11 10 06 C9 03 F9", id="index angle of the hand, RH56"),
        pytest.param(SAVE, SAVE_ACK, id="save, RH56"),
        pytest.param(CLEAR, CLEAR_ACK, id="clear errors, RH56"),
        pytest.param(
            "EB 90 01 04 12 E8 03 02 04", "90 EB 02 04 12 E8 03 01 04", id="id change: ack from the new id, RH56"
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
    noisy = Bench()
    assert noisy.ask(f"00 EB 90 01 40 30 {request_} EB 90") == reply


def test_currents_of_the_manual_are_zero() -> None:
    bench = Bench()
    assert bench.line.command("set 1024 00 00 00 00") == "set 1024 00 00 00 00"
    assert bench.ask(CURRENTS) == "90 EB 01 07 30 00 04 00 00 00 00 3C"


def test_errors_of_the_state_faults() -> None:
    assert Bench(fault="faults").ask(ERRORS) == "90 EB 01 06 30 04 04 01 00 04 44"


def test_printed_write_is_yaw_minus_10_and_pitch_plus_10_03() -> None:
    """0x03EB is 1003, and 1038 is yaw."""
    bench = Bench()
    bench.ask("EB 90 01 07 31 0E 04 18 FC EB 03 4D")
    bench.wait(1.0)
    assert bench.angles() == [1003, -1000]


def test_write_of_8_bytes_is_done_and_does_harm() -> None:
    """An exo's force command, byte for byte: a wrist sets both angles and the time to 0 (1036 and 1037 are a gap)."""
    bench = Bench()
    assert bench.ask("EB 90 01 0B 31 0C 04 00 00 00 00 00 00 00 00 4D") == "90 EB 01 04 31 0C 04 01 47"
    assert bench.values(1038, 1040, 1042) == [0, 0, 0]
    assert bench.angles() == [0, 0]


def test_force_command_of_the_exo_lands_somewhere_else() -> None:
    """100, -100, 0, 1000, -1000 is a write of 8 bytes at 100."""
    bench = Bench()
    assert bench.ask("EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B") == "90 EB 01 04 31 64 00 01 9B"
    assert bench.ask(DUMP) == DUMP_REPLY


@each_row(
    "request_",
    [
        pytest.param("EB 90 02 04 30 FC 03 02 37", id="wrong id"),
        pytest.param("EB 90 01 04 30 FC 03 02 37", id="bad sum"),
        pytest.param("90 EB 01 05 30 FC 03 A7 FE DA", id="our own header"),
        pytest.param("90 EB 01 05 30 FC 03 00 00 00 00 35", id="reply as printed in 2.2"),
        pytest.param("EB 90 01 0B 32 F5 FF 0C 00 F3 FF 0E 00 F1 FF 2E", id="flag 32 of the exo"),
        pytest.param("EB 90 01 04 30 FC 03 00 34", id="count 0"),
        pytest.param("EB 90 01 04 30 FC 03 FD 31", id="count 253"),
        pytest.param("EB 90 01 04 30 FF FF 02 35", id="past the last address"),
        pytest.param("EB 90 01 03 31 0E 04 47", id="write of nothing"),
    ],
)
def test_silence(request_: str) -> None:
    bench = Bench()
    assert bench.ask(request_) == ""
    bench.wait(1.0)
    assert bench.heard() == ""
    assert bench.ask(DUMP) == DUMP_REPLY


def test_longest_read() -> None:
    """252 bytes; the length byte is FF."""
    reply = bytes.fromhex(Bench().ask("EB 90 01 04 30 FC 03 FC 30"))
    assert len(reply) == 260
    assert reply[3] == 255
    assert reply[7:31] == bytes.fromhex(DUMP_REPLY)[7:31]
    assert reply[31:259] == bytes(228)


def test_cut_request_is_forgotten_after_a_pause() -> None:
    bench = Bench()
    assert bench.ask("EB 90 01 FF 31 0E 04") == ""
    bench.wait(0.05)
    assert bench.ask(PROBE) == ""  # taken for data of the long write
    bench.wait(0.2)
    assert bench.ask(PROBE) == PROBE_REPLY


# -- CAN: the frames of a healthy wrist --------------------------------------------------------------------------------


@each_row(
    ("request_", "reply"),
    [
        pytest.param("11000001 04", "11000001 6F 00 DE 00", id="both currents 2.3.1"),
        *(pytest.param(*pair, id=f"dump 2.3.1 {pair[0]}") for pair in zip(CAN_DUMP, CAN_DUMP_REPLY, strict=True)),
        pytest.param(CAN_MOVE, "15038001", id="angles 2.3.2"),
        pytest.param("15038001 FC 18 03 EB", "15038001", id="angles as printed in 2.3.2"),
        pytest.param("01840001 02", "01840001 C9 03", id="index angle of the hand, field capture of an RH56"),
        pytest.param("05738001 F4 01 FF FF FF FF FF FF", "05738001", id="8 bytes at 1486 of the hand"),
        pytest.param("01700001 02", "01700001 32 02", id="voltage of the hand, RH56"),
    ],
)
def test_frame_gets_its_reply(request_: str, reply: str) -> None:
    bench = CanBench()
    assert bench.ask(request_) == [reply]
    assert bench.line.acknowledged
    assert bench.line.next_event() is None


def test_acknowledgement_with_a_count() -> None:
    """Seen on the sibling: one data byte, the number of bytes written."""
    bench = CanBench(ack_dlc=1)
    assert bench.ask(CAN_MOVE) == ["15038001 04"]
    assert bench.ask("05738001 F4 01 FF FF FF FF FF FF") == ["05738001 08"]
    assert bench.values(1486, 1488, 1490, 1492, 1494, space="hand-get") == [500, -1, -1, -1, 565]


def test_twin_on_can() -> None:
    """A 1-byte read of a value 01 equals its request; the 3-byte read does not."""
    bench = CanBench(fault="faults")
    assert bench.ask("11010001 01") == ["11010001 01"]
    assert bench.ask("11010001 03") == ["11010001 01 00 04"]


def test_printed_can_write_is_out_of_range() -> None:
    """FC 18 03 EB is yaw 63.96° and pitch -53.73°: acknowledged here, not done (open)."""
    bench = CanBench()
    bench.ask("15038001 FC 18 03 EB")
    bench.wait(1.0)
    assert bench.ask("11038001 08") == ["11038001 4C 04 D4 FE BC 02 00 00"]
    assert bench.angles() == [-345, 1125]
    assert CanBench(fault="strict").ask("15038001 FC 18 03 EB") == []


def test_padded_write_does_harm() -> None:
    """Padding a write of the angles to 8 bytes with FF sets the time to 65535."""
    bench = CanBench()
    assert bench.ask("15038001 E8 03 18 FC FF FF FF FF") == ["15038001"]
    assert bench.line.command("get 1038 8") == "E8 03 18 FC FF FF 00 00"


@each_row(
    ("identifier", "data", "extended", "remote"),
    [
        pytest.param(0x10FF0002, "02", True, False, id="another id"),
        pytest.param(0x10FF0001, "", True, False, id="no count"),
        pytest.param(0x10FF0001, "00", True, False, id="count 0"),
        pytest.param(0x10FF0001, "09", True, False, id="count 9"),
        pytest.param(0x10FF0001, "02 00", True, False, id="two data bytes"),
        pytest.param(0x10FF0001, "02 FF FF FF FF FF FF FF", True, False, id="padded count"),
        pytest.param(0x15038001, "", True, False, id="write of nothing"),
        pytest.param(0x08FF0001, "02", True, False, id="flag 2"),
        pytest.param(0x0CFF0001, "02", True, False, id="flag 3"),
        pytest.param(0x18FF0001, "02", True, False, id="flag 6"),
        pytest.param(0x1CFF0001, "02", True, False, id="flag 7"),
        pytest.param(0x001, "02", False, False, id="standard frame"),
        pytest.param(0x10FF0001, "02", True, True, id="remote frame"),
    ],
)
def test_silence_on_can(identifier: int, data: str, extended: bool, remote: bool) -> None:
    """Acknowledged by the controller all the same."""
    bench = CanBench()
    bench.line.feed_frame(identifier, bytes.fromhex(data), extended, remote)
    assert bench.heard() == []
    assert bench.line.acknowledged
    assert bench.line.requests == 0
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]


@each_row(("identifier", "size", "extended"), [(1 << 29, 0, True), (2048, 0, False), (1, 9, True), (-1, 0, True)])
def test_impossible_frame(identifier: int, size: int, extended: bool) -> None:
    with pytest.raises(ValueError, match="not a CAN frame"):
        CanBench().line.feed_frame(identifier, bytes(size), extended)


def test_id_of_14_bits() -> None:
    bench = CanBench(id=16383)
    assert bench.ask("10FF3FFF 02") == ["10FF3FFF A7 FE"]
    assert bench.ask(CAN_PROBE) == []
    assert bench.ask("00FA3FFF 01") == ["00FA3FFF FF"]


def test_id_change_on_can() -> None:
    """The acknowledgement still has the identifier of its request (open); the new id answers at once."""
    bench = CanBench()
    assert bench.ask("04FA0001 02") == ["04FA0001"]
    assert bench.ask(CAN_PROBE) == []
    assert bench.ask("10FF0002 02") == ["10FF0002 A7 FE"]


# -- both wires --------------------------------------------------------------------------------------------------------


def test_both_wires_show_the_same_wrist() -> None:
    serial, can = Bench(seed=3, fault="faults"), CanBench(seed=3, fault="faults")
    for bench in (serial, can):
        move(bench, -500, 2000, 1500)
        bench.wait(0.4)
    whole = bytes.fromhex(serial.ask(DUMP))[7:31]
    frames = [can.ask(request)[0] for request in CAN_DUMP]
    parts = b"".join(bytes.fromhex(frame[9:]) for frame in frames)
    # Currents of a moving wrist jitter with each reading; everything else is equal.
    assert parts[:4] + parts[8:] == whole[:4] + whole[8:]
    serial.wait(5.0)
    can.wait(5.0)
    assert (
        b"".join(bytes.fromhex(can.ask(request)[0][9:]) for request in CAN_DUMP)
        == bytes.fromhex(serial.ask(DUMP))[7:31]
    )
    assert serial.angles() == [2000, -500]


def test_registers_lie_where_the_manual_has_them() -> None:
    """18 documented bytes and 6 gap bytes; every value is different."""
    from handctl.sim.wrist.device import WRIST

    places = {place for _, first, size, count, *_ in WRIST for place in range(first, first + size * count)}
    assert sorted(set(range(1020, 1044)) - places) == [1029, 1031, 1034, 1035, 1036, 1037]
    bench = Bench()
    assert bench.values(1020, 1022, 1024, 1026, 1038, 1040, 1042) == [-345, 1125, 111, 222, 1100, -300, 700]
    assert bench.degrees() == [31, 34]
    assert bench.errors() == [0, 0]


def test_wrong_flag_reads_current_limits() -> None:
    """1020 to 1043 of the hand are current limits and power-on speeds (RH56 §2.4.7, §2.4.8)."""
    reply = Bench().ask("EB 90 01 04 11 FC 03 18 2D")
    limits_and_speeds = (1501, 1502, 1503, 1504, 1505, 1506, 901, 902, 903, 904, 905, 906)
    assert bytes.fromhex(reply)[7:31] == b"".join(value.to_bytes(2, "little") for value in limits_and_speeds)
    assert CanBench().ask("00FF0001 04") == ["00FF0001 DD 05 DE 05"]


def test_wrong_flag_damages_the_hand_and_a_save_keeps_it() -> None:
    """Yaw -10.00 with the hand's flag is the power-on speed of the index finger (RH56 §2.4.8)."""
    for bench, request, ack, save in (
        (Bench(), "EB 90 01 05 12 0E 04 18 FC 3E", "90 EB 01 04 12 0E 04 01 2A", SAVE),
        (CanBench(), "05038001 18 FC", ["05038001"], "04FB4001 01"),
    ):
        before = bench.angles()
        assert bench.values(1038, space="hand-get") == [904]
        assert bench.ask(request) == ack
        bench.wait(1.0)
        assert bench.values(1038, space="hand-get") == [-1000]
        assert bench.values(1038) == [1100]
        assert bench.angles() == before
        bench.line.power_cycle()
        assert bench.values(1038, space="hand-get") == [904]
        bench.ask(request)
        bench.ask(save)
        bench.line.power_cycle()
        assert bench.values(1038, space="hand-get") == [-1000]


def spans(*rows: tuple[int, int]) -> set[int]:
    """First and last address of some ranges."""
    return {place for first, last in rows for place in range(first, last + 1)}


def bytes_that_answer(flag: int) -> set[int]:
    """Addresses that a read of one byte reaches in the state block-silent: those of registers."""
    bench = CanBench(fault="block-silent")
    return {place for place in range(900, 1700) if bench.ask(f"{flag << 26 | place << 14 | 1:08X} 01")}


def bytes_that_can_be_written(flag: int) -> set[int]:
    """Addresses that a write of one byte 00 reaches in the state strict (0 is in every range but that of the id)."""
    bench = CanBench(fault="strict")
    return {place for place in range(900, 1700) if bench.ask(f"{flag << 26 | place << 14 | 1:08X} 00")}


def test_registers_of_the_wrist() -> None:
    """wrist §2.1."""
    assert bytes_that_answer(4) == spans((1020, 1028), (1030, 1030), (1032, 1033), (1038, 1043))
    assert bytes_that_can_be_written(5) == spans((1038, 1043))


def test_registers_of_the_hand() -> None:
    """RH56 §2.4."""
    settings = spans((1002, 1002), (1004, 1006), (1009, 1009), (1020, 1055))
    fingers = spans((1474, 1509), (1522, 1533))
    readings = spans((1472, 1473), (1534, 1557), (1582, 1623))
    assert bytes_that_answer(0) == settings | {1000} | fingers | readings
    assert bytes_that_can_be_written(1) == settings | fingers


def test_readings_of_the_hand() -> None:
    """From the voltage to the temperatures; what is not documented is 0."""
    heard = bytes.fromhex(Bench().line.command("hand-get 1472 152"))
    words = [int.from_bytes(heard[at : at + 2], "little", signed=True) for at in range(0, 134, 2)]
    assert words[:19] == [562, 1161, 1262, 1363, 1464, 1565, 1666, 161, 262, 363, 464, 565, 666, *range(501, 507)]
    assert words[19:31] == [0] * 6 + [901, 902, 903, 904, 905, 906]
    assert words[31:43] == [1121, 1133, 1145, 1169, 1157, 1181, 921, 933, 945, 969, 957, 981]
    assert words[43:55] == [0] * 12
    assert words[55:67] == [-21, 22, -23, 24, -25, 26, 41, 42, 43, 44, 45, 46]
    assert heard[134:] == bytes([0, 0, 0, 0, 0, 0, 2, 1, 3, 2, 0, 2, 36, 37, 38, 39, 40, 41])
    limits = bytes.fromhex(Bench().line.command("hand-get 1020 36"))
    assert [int.from_bytes(limits[at : at + 2], "little") for at in range(24, 36, 2)] == [401, 402, 403, 404, 405, 406]


def test_clearing_errors_clears_those_of_the_hand_too() -> None:
    bench = Bench()
    bench.line.command("hand-set 1605 07 01 02 04 08 10 11 12")
    bench.ask(CLEAR)
    assert bench.line.command("hand-get 1605 8") == "07 00 00 00 00 00 00 12"


def test_speed_code_shows() -> None:
    assert Bench(baud=19200).ask("EB 90 01 04 11 EA 03 01 04") == "90 EB 01 04 11 EA 03 02 05"
    bench = CanBench(bitrate=500000)
    assert bench.ask("00FA8001 01") == ["00FA8001 01"]
    bench.ask("04FB8001 01")
    assert bench.ask("00FA8001 01") == ["00FA8001 00"], "factory defaults"


@each_row("bench", on_both(), ids=["serial", "can"])
def test_hand_has_values_of_its_own_everywhere(bench: Any) -> None:
    rows = [
        bench.values(*range(first, first + 12, 2), space="hand-get") for first in (1474, 1486, 1498, 1522, 1534, 1546)
    ]
    rows += [bench.values(*range(first, first + 12, 2), space="hand-get") for first in (1020, 1032, 1044, 1582, 1594)]
    assert len({value for row in rows for value in row}) == 60, "all but the speeds, which are those of power-on"
    assert rows[3] == rows[7]
    assert bench.line.command("hand-get 1612 6") == "02 01 03 02 00 02"


def test_wrist_space_is_empty_outside_its_registers() -> None:
    bench = Bench()
    assert bench.ask("EB 90 01 04 30 C0 05 02 FC") == "90 EB 01 05 30 C0 05 00 00 FB"
    assert bench.ask("EB 90 01 04 30 E8 03 01 21") == "90 EB 01 04 30 E8 03 00 20"


@each_row(
    ("serial", "can"),
    [
        pytest.param("EB 90 01 05 31 FC 03 01 01 38", "14FF0001 01 01", id="read-only pitch"),
        pytest.param("EB 90 01 05 31 0C 04 01 01 49", "15030001 01 01", id="gap 1036"),
        pytest.param("EB 90 01 05 31 0E 04 F7 09 49", "15038001 F7 09", id="yaw 25.51"),
        pytest.param("EB 90 01 05 31 0E 04 09 F6 48", "15038001 09 F6", id="yaw -25.51"),
        pytest.param("EB 90 01 05 31 10 04 A5 08 F8", "15040001 A5 08", id="pitch 22.13"),
        pytest.param("EB 90 01 05 31 10 04 25 F7 67", "15040001 25 F7", id="pitch -22.67"),
    ],
)
def test_impossible_write_changes_nothing(serial: str, can: str) -> None:
    """Acknowledged all the same (open); silence in the state strict."""
    bench = Bench()
    assert bench.ask(serial)[:17] == "90 EB 01 04 31 " + serial[15:17]
    bench.wait(1.0)
    assert bench.ask(DUMP) == DUMP_REPLY
    bus = CanBench()
    assert bus.ask(can) == [can[:8]]
    bus.wait(1.0)
    assert [bus.ask(request)[0] for request in CAN_DUMP] == CAN_DUMP_REPLY
    assert Bench(fault="strict").ask(serial) == ""
    assert CanBench(fault="strict").ask(can) == []


@each_row("bench", on_both(fault="strict"), ids=["serial", "can"])
def test_limits_of_the_angles_can_be_reached(bench: Any) -> None:
    """wrist §1: yaw ±25.50, pitch -22.66 to 22.12."""
    move(bench, 2550, -2266, 100)
    bench.wait(0.1)
    assert bench.angles() == [-2266, 2550]
    move(bench, -2550, 2212, 100)
    bench.wait(0.1)
    assert bench.angles() == [2212, -2550]


# -- motion ------------------------------------------------------------------------------------------------------------


@each_row("bench", on_both(), ids=["serial", "can"])
def test_both_axes_move_linearly_and_arrive_together(bench: Any) -> None:
    move(bench, 1000, -1000, 1000)
    assert bench.angles() == [-345, 1125]
    for step in range(1, 10):
        bench.wait(0.1)
        assert bench.angles() == [round(-345 - 65.5 * step), round(1125 - 12.5 * step)]
    bench.wait(0.099)
    assert bench.angles() != [-1000, 1000]
    bench.wait(0.001)
    assert bench.angles() == [-1000, 1000]
    bench.wait(10.0)
    assert bench.angles() == [-1000, 1000]


@each_row("bench", on_both(), ids=["serial", "can"])
def test_movement_without_a_time_takes_700_ms(bench: Any) -> None:
    move(bench, 0, 355)
    bench.wait(0.35)
    assert bench.angles() == [5, 562]
    bench.wait(0.35)
    assert bench.angles() == [355, 0]


def test_set_values_of_power_on_move_nothing() -> None:
    bench = Bench()
    bench.wait(60.0)
    assert bench.ask(DUMP) == DUMP_REPLY


def test_one_axis_alone_leaves_the_other_where_it_is() -> None:
    bench = CanBench()
    bench.ask("15040001 00 00")
    bench.wait(5.0)
    assert bench.angles() == [0, 1125]
    assert bench.values(1038, 1040) == [1100, 0]


def test_second_write_makes_both_axes_arrive_anew() -> None:
    """Yaw is on its way for 0.5 of 1.0 s when pitch is written: both arrive 1.0 s later."""
    bench = CanBench()
    bench.ask("15048001 E8 03")
    bench.ask("15038001 65 FC")  # yaw from 1125 to -923
    bench.wait(0.5)
    assert bench.angles() == [-345, 101]
    bench.ask("15040001 67 00")  # pitch from -345 to 103
    bench.wait(0.5)
    assert bench.angles() == [-121, -411]
    bench.wait(0.5)
    assert bench.angles() == [103, -923]


def test_time_after_the_angles_is_for_the_next_movement() -> None:
    bench = CanBench()
    bench.ask(CAN_MOVE)
    bench.ask("15048001 60 EA")  # 60 s
    bench.wait(0.7)
    assert bench.angles() == [-1000, 1000]
    bench.ask("15038001 00 00")
    bench.wait(30.0)
    assert bench.angles() == [-1000, 500]


def test_time_is_unsigned_and_zero_is_at_once() -> None:
    bench = CanBench()
    move(bench, 0, 0, 0)
    assert bench.angles() == [0, 0]
    move(bench, 2550, 2000, 40000)
    bench.wait(20.0)
    assert bench.angles() == [1000, 1275]


def test_half_a_register() -> None:
    """The high byte of yaw's set value: 044C becomes 004C."""
    bench = CanBench()
    bench.ask("1503C001 00")
    assert bench.values(1038) == [76]
    bench.wait(0.7)
    assert bench.angles() == [-345, 76]


def test_many_small_steps_give_what_one_jump_gives() -> None:
    benches = [CanBench(), CanBench()]
    for bench in benches:
        move(bench, -2000, 2000, 1234)
    for _ in range(500):
        benches[0].wait(0.004)
    benches[1].wait(2.0)
    assert benches[0].line.command("get 1020 24") == benches[1].line.command("get 1020 24")
    assert benches[0].line.device.body.actuators[0].temperature == pytest.approx(
        benches[1].line.device.body.actuators[0].temperature
    )


@each_row("bench", on_both(), ids=["serial", "can"])
def test_currents_rise_while_it_moves(bench: Any) -> None:
    """1024 and 1026 by different amounts; which one belongs to which actuator is open."""
    move(bench, 0, 0, 1000)
    bench.wait(0.5)
    first, second = bench.values(1024, 1026)
    assert 111 + 170 - 3 <= first <= 111 + 170 + 3
    assert 222 + 140 - 3 <= second <= 222 + 140 + 3
    bench.wait(0.5)
    assert bench.values(1024, 1026) == [111, 222]


def test_jitter_only_on_request() -> None:
    bench = Bench(jitter=1)
    rows = {tuple(bench.values(1024, 1026)) for _ in range(30)}
    assert len(rows) > 10
    assert all(abs(first - 111) <= 3 and abs(second - 222) <= 3 for first, second in rows)


def test_long_movement_warms_and_rest_cools() -> None:
    bench = Bench()
    move(bench, -2000, -2000, 60000)
    bench.wait(59.0)
    assert bench.degrees() == [36, 40]
    bench.wait(600.0)
    assert bench.degrees() == [31, 34]


@each_row("bench", on_both(), ids=["serial", "can"])
def test_blocked_axis_stalls_draws_current_and_sets_bit_0(bench: Any) -> None:
    move(bench, 125, -345, 1000)
    bench.wait(0.5)
    assert bench.angles() == [-345, 625]
    assert bench.line.command("block yaw") == "block yaw"
    bench.wait(0.15)
    assert bench.angles() == [-345, 625]
    assert bench.values(1024, 1026) == [round(111 + 789 / 2), round(222 + 678 / 2)]
    assert bench.errors() == [0, 0]
    bench.wait(0.15)
    assert bench.values(1024, 1026) == [900, 900]
    assert bench.errors() == [1, 1]
    clear = CLEAR if isinstance(bench, Bench) else "04FB0001 01"
    assert bench.ask(clear) in (CLEAR_ACK, ["04FB0001"])
    assert bench.errors() == [0, 0]
    bench.wait(0.4)  # the cause is still there
    assert bench.errors() == [1, 1]
    bench.line.command("release yaw")
    bench.ask(clear)
    bench.wait(0.5)
    assert bench.angles() == [-345, 375]
    bench.wait(0.5)
    assert bench.angles() == [-345, 125]
    assert bench.errors() == [0, 0]


def test_other_axis_goes_on_while_one_is_blocked() -> None:
    bench = Bench()
    bench.line.command("block yaw")
    move(bench, 0, 0, 200)
    bench.wait(0.2)
    assert bench.angles() == [0, 1125]


def test_pressing_on_overheats_and_only_cooling_ends_it() -> None:
    bench = Bench(fault="blocked")
    move(bench, 0, 0, 100)
    bench.wait(300.0)
    assert bench.angles() == [-345, 1125]
    assert bench.errors() == [3, 3]
    assert min(bench.degrees()) >= 70
    bench.ask(CLEAR)
    assert bench.errors() == [2, 2]
    assert bench.line.command("fault none") == "fault none"
    bench.wait(0.1)
    assert bench.angles() == [0, 0]
    bench.ask(CLEAR)
    bench.wait(600.0)
    assert bench.errors() == [0, 0]


@each_row(
    ("fault", "errors"),
    [
        ("faults", [1, 4]),
        ("locked-rotor", [1, 0]),
        ("over-temperature", [0, 2]),
        ("over-current", [4, 0]),
        ("motor-abnormal", [0, 8]),
        ("communication", [16, 0]),
        ("unknown-bits", [0, 160]),
        ("hot", [2, 2]),
        ("locked_rotor,over_current,hot", [7, 2]),
    ],
)
def test_error_bits(fault: str, errors: list[int]) -> None:
    for bench in on_both(fault=fault):
        assert bench.errors() == errors
        bench.wait(0.5)
        assert bench.errors() == errors


def test_hot_cools_down_by_itself_and_over_temperature_stays() -> None:
    bench = Bench(fault="hot")
    assert bench.degrees() == [71, 72]
    bench.wait(60.0)
    assert bench.errors() == [0, 0]
    stays = Bench(fault="over-temperature")
    stays.ask(CLEAR)
    stays.wait(600.0)
    assert stays.errors() == [0, 2]
    assert stays.degrees() == [31, 78]
    assert Bench(fault="hot", limit=40).degrees() == [41, 42]


@each_row(("fault", "dump"), [("block-silent", False), ("no-wrist", False), ("healthy", True)])
def test_whole_dump_may_stay_silent(fault: str, dump: bool) -> None:
    bench, bus = Bench(fault=fault), CanBench(fault=fault)
    assert bool(bench.ask(DUMP)) is dump
    assert bool(bus.ask(CAN_DUMP[1])) is dump
    assert bool(bench.ask(PROBE)) is (fault != "no-wrist")
    assert bool(bus.ask(CAN_PROBE)) is (fault != "no-wrist")
    assert bool(bench.ask(MOVE)) is (fault != "no-wrist")
    assert bench.ask(VOLTAGE) == VOLTAGE_REPLY
    assert bus.ask("01700001 02") == ["01700001 32 02"]


def test_foreign_device_is_out_of_range() -> None:
    assert Bench(fault="foreign").angles() == [3000, 3001]


def test_refused_write() -> None:
    """Serial: 00 for 01. CAN: a count of 0, and nothing at all where the acknowledgement is empty."""
    bench = Bench(fault="refuse")
    assert bench.ask(MOVE) == "90 EB 01 04 31 0E 04 00 48"
    bench.wait(1.0)
    assert bench.ask(DUMP) == DUMP_REPLY
    counted, empty = CanBench(fault="refuse", ack_dlc=1), CanBench(fault="refuse")
    assert counted.ask(CAN_MOVE) == ["15038001 00"]
    assert empty.ask(CAN_MOVE) == ["15038001"]
    for bus in (counted, empty):
        bus.wait(1.0)
        assert [bus.ask(request)[0] for request in CAN_DUMP] == CAN_DUMP_REPLY


# -- id, speed, flash, power -------------------------------------------------------------------------------------------


@each_row(
    ("options", "result"),
    [
        ({}, "90 EB 01 04 11 ED 03 00 06"),
        ({"result_flag": 18}, "90 EB 01 04 12 ED 03 00 07"),
        ({"fault": "save-fails"}, "90 EB 01 04 11 ED 03 FF 05"),
        ({"fault": "no-late-frames"}, ""),
    ],
)
def test_save_answers_twice_on_the_serial_line(options: dict[str, object], result: str) -> None:
    bench = Bench(**options)
    assert bench.ask(SAVE) == SAVE_ACK
    assert bench.wait(0.999) == ""
    assert bench.wait(0.001) == result
    assert bench.wait(10.0) == ""


def test_id_acts_at_once_and_is_lost_unless_saved() -> None:
    bench = Bench()
    assert bench.ask("EB 90 01 04 12 E8 03 02 04") == "90 EB 02 04 12 E8 03 01 04"
    assert bench.ask(PROBE) == ""
    assert bench.ask("EB 90 02 04 30 FC 03 02 37") == "90 EB 02 05 30 FC 03 A7 FE DB"
    bench.line.power_cycle()
    assert bench.ask(PROBE) == PROBE_REPLY
    bench.ask("EB 90 01 04 12 E8 03 02 04")
    bench.ask("EB 90 02 04 12 ED 03 01 09")
    bench.line.power_cycle()
    assert bench.ask("EB 90 02 04 30 FC 03 02 37") == "90 EB 02 05 30 FC 03 A7 FE DB"
    assert Bench(ack_id="old").ask("EB 90 01 04 12 E8 03 02 04") == "90 EB 01 04 12 E8 03 01 03"
    failing = Bench(fault="save-fails")
    failing.ask("EB 90 01 04 12 E8 03 02 04")
    failing.ask("EB 90 02 04 12 ED 03 01 09")
    failing.line.power_cycle()
    assert failing.ask(PROBE) == PROBE_REPLY


@each_row("number", [235, 144, 180])
def test_awkward_ids(number: int) -> None:
    body = bytes([number, 4, 0x30, 0xFC, 3, 2])
    request = (b"\xeb\x90" + body + bytes([sum(body) % 256])).hex(" ").upper()
    body = bytes([number, 5, 0x30, 0xFC, 3, 0xA7, 0xFE])
    reply = (b"\x90\xeb" + body + bytes([sum(body) % 256])).hex(" ").upper()
    assert Bench(id=number).ask(request) == reply
    assert Bench(id=number, fault="echo").ask(request) == f"{request} {reply}"


def test_speed_code_lies_at_1002_and_acts_after_save_and_power_cycle() -> None:
    bench = Bench()
    bench.line.client_baud = 115200
    assert bench.ask("EB 90 01 04 12 EA 03 01 05") == "90 EB 01 04 12 EA 03 01 05"
    assert bench.ask(SAVE) == SAVE_ACK
    assert bench.ask(PROBE) == PROBE_REPLY  # still at the old speed
    bench.line.power_cycle()
    assert bench.ask(PROBE) == ""
    bench.line.client_baud = 57600
    assert bench.ask(PROBE) == PROBE_REPLY


def test_bitrate_of_500_k_on_can() -> None:
    bench = CanBench()
    bench.line.client_bitrate = 1000000
    assert bench.ask("04FA8001 01") == ["04FA8001"]
    assert bench.ask("04FB4001 01") == ["04FB4001"]
    assert bench.wait(5.0) == [], "no result frame on CAN"
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    bench.line.power_cycle()
    assert bench.ask(CAN_PROBE) == []
    assert not bench.line.acknowledged
    bench.line.client_bitrate = 500000
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    assert CanBench(bitrate=500000).line.device.speed == 500000


def test_factory_defaults_are_not_saved() -> None:
    bench = CanBench(id=7)
    bench.ask("05038007 18 FC")
    assert bench.ask("04FB8007 01") == ["04FB8007"]
    assert bench.values(1038, space="hand-get") == [904]
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    bench.line.power_cycle()
    assert bench.ask("10FF0007 02") == ["10FF0007 A7 FE"]


def test_triggers_read_back_as_zero() -> None:
    bench = CanBench()
    for request in ("04FB0001 01", "04FB4001 01", "04FB8001 01", "04FC4001 01"):
        assert bench.ask(request) == [request[:8]]
    assert bench.ask("00FA0001 08") == ["00FA0001 01 00 00 00 00 00 00 00"]
    assert bench.ask("00FC4001 01") == ["00FC4001 00"]


@each_row("request_", ["04FB0001 02", "04FB4001 02", "04FB8001 02", "04FC4001 02", "04FA8001 03", "04FA0001 FF"])
def test_settings_of_the_hand_have_ranges(request_: str) -> None:
    bench = CanBench()
    before = bench.line.command("hand-get 1000 10")
    assert bench.ask(request_) == [request_[:8]]
    assert bench.line.command("hand-get 1000 10") == before
    assert CanBench(fault="strict").ask(request_) == []


@each_row("bench", on_both(), ids=["serial", "can"])
def test_wrist_stays_where_it_is_without_power(bench: Any) -> None:
    move(bench, 125, 655, 1000)
    bench.wait(0.5)
    bench.line.power_cycle()
    bench.wait(5.0)
    assert bench.angles() == [155, 625]
    assert bench.values(1038, 1040, 1042) == [1100, -300, 700], "set values start anew"


def test_no_power_no_answer() -> None:
    bench, bus = Bench(), CanBench()
    for wired in (bench, bus):
        assert wired.line.command("power off") == "power off"
    assert bench.ask(PROBE) == ""
    assert bus.ask(CAN_PROBE) == []
    assert not bus.line.acknowledged
    assert bus.line.next_event() is None
    for wired in (bench, bus):
        wired.line.command("power on")
    assert bench.ask(PROBE) == PROBE_REPLY
    assert bus.ask(CAN_PROBE) == [CAN_PROBE_REPLY]


# -- serial: time and faults of the line -------------------------------------------------------------------------------


def test_dump_takes_its_41_bytes() -> None:
    bench = Bench(wire=115200)
    bench.line.feed(bytes.fromhex(DUMP))
    data = b""
    while (event := bench.line.next_event()) is not None:
        bench.line.advance(event)
        data += bench.line.take()
        end = event
    assert data == bytes.fromhex(DUMP_REPLY)
    assert end == pytest.approx(41 * BYTE)
    assert end * 1000 == pytest.approx(3.56, abs=0.005)


@each_row(
    ("fault", "heard"),
    [
        ("healthy", PROBE_REPLY),
        ("silent", ""),
        ("deaf", ""),
        ("bad-checksum", "90 EB 01 05 30 FC 03 A7 FE DB"),
        ("wrong-id", "90 EB 02 05 30 FC 03 A7 FE DB"),
        ("twin-id", "90 EB 01 05 30 FC 03 A2 FE D8"),  # A7 & AA, DA & DD
        ("echo", f"{PROBE} {PROBE_REPLY}"),
        ("loopback", PROBE),
        ("duplicate", f"{PROBE_REPLY} {PROBE_REPLY}"),
        ("late", ""),
        ("slow", ""),
        ("disconnect", "90 EB 01 05 30"),
        ("refuse", PROBE_REPLY),
        ("garble", PROBE_REPLY),
    ],
)
def test_line_faults(fault: str, heard: str) -> None:
    assert Bench(fault=fault).ask(PROBE) == heard


def test_line_faults_with_chance() -> None:
    for seed in range(20):
        noisy = Bench(fault="noise", seed=seed).ask(PROBE)
        assert PROBE_REPLY in noisy
        assert len(noisy) > len(PROBE_REPLY)
        cut = Bench(fault="truncate", seed=seed).ask(PROBE)
        assert PROBE_REPLY.startswith(cut)
        assert 0 < len(cut) < len(PROBE_REPLY)
    stale = Bench(fault="stale")
    assert [stale.ask(PROBE), stale.ask(CURRENTS)] == [PROBE_REPLY, f"{PROBE_REPLY} {CURRENTS_REPLY}"]


@each_row("fault", ["dribble", "split", "late", "slow"])
def test_line_faults_that_take_time(fault: str) -> None:
    bench = Bench(fault=fault)
    heard = [bench.ask(PROBE)]
    while (event := bench.line.next_event()) is not None:
        heard.append(bench.wait(event - bench.now))
    assert bytes.fromhex("".join(heard)) == bytes.fromhex(PROBE_REPLY)
    assert bench.now == {"dribble": pytest.approx(0.030), "late": 0.6, "slow": pytest.approx(0.020)}.get(
        fault, bench.now
    )
    assert len(heard) > 1


def test_silent_write_is_carried_out_and_deaf_is_not() -> None:
    silent, deaf = Bench(fault="silent"), Bench(fault="deaf")
    for bench in (silent, deaf):
        assert bench.ask(MOVE) == ""
        bench.wait(1.0)
    assert silent.angles() == [-1000, 1000]
    assert deaf.angles() == [-345, 1125]


# -- CAN: time and faults of the bus -----------------------------------------------------------------------------------


def test_dump_takes_three_frames_each_way() -> None:
    """0.618 ms: three requests of 75 bits and three replies of 131."""
    bench = CanBench(wire=1)
    came = []
    for request in CAN_DUMP:
        bench.send(request)
        came += bench.run()
    assert [frame for _, frame in came] == CAN_DUMP_REPLY
    assert came[0][0] == pytest.approx((75 + 131) / 1e6)
    assert came[-1][0] == pytest.approx(0.000618)


def test_frame_is_there_at_its_end() -> None:
    bench = CanBench(wire=1, turnaround=0.0001)
    bench.send(CAN_MOVE)
    bench.line.advance(0.000098)
    assert bench.values(1038) == [1100]
    bench.line.advance(0.000099)
    assert bench.values(1038) == [1000]
    bench.line.advance(0.000265)
    assert bench.heard() == []
    assert bench.line.next_event() == pytest.approx(0.000266)
    bench.line.advance(0.000266)
    assert bench.heard() == ["15038001"]
    assert bench.line.next_event() is None


def test_half_the_bitrate_takes_twice_the_time() -> None:
    bench = CanBench(wire="auto", bitrate=500000)
    bench.send(CAN_MOVE)
    assert bench.run() == [(pytest.approx(0.000332), "15038001")]


def test_frames_take_turns_and_the_lower_identifier_wins() -> None:
    """Probes of ids 1 to 3 back to back: the reply of id 1 goes before the probe of id 2 or 3, which is higher."""
    bench = CanBench(wire=1)
    for number in (1, 2, 3):
        bench.send(f"10FF000{number} 02")
    assert bench.run() == [(pytest.approx((75 + 83) / 1e6), CAN_PROBE_REPLY)]
    bench = CanBench(wire=1, id=3)
    for number in (3, 2, 1):
        bench.send(f"10FF000{number} 02")
    assert bench.run() == [(pytest.approx((3 * 75 + 83) / 1e6), "10FF0003 A7 FE")]


@each_row(("identifier", "wins"), [(0x43E, True), (0x43F, True), (0x440, False)])
def test_standard_frame_takes_the_bus_for_47_bits(identifier: int, wins: bool) -> None:
    """It contends with the reply 10FF0001, whose upper 11 bits are 43F; at equal bits a standard frame wins."""
    bench = CanBench(wire=1)
    bench.send(CAN_PROBE)
    bench.line.feed_frame(identifier, bytes(8), extended=False)
    assert bench.run()[0][0] == pytest.approx((75 + 83 + (47 + 64 if wins else 0)) / 1e6)


def test_remote_frame_has_no_data_on_the_bus() -> None:
    bench = CanBench(wire=1)
    bench.line.feed_frame(0x10FF0001, bytes(8), remote=True)
    bench.send(CAN_PROBE)
    assert bench.run()[0][0] == pytest.approx((67 + 75 + 83) / 1e6)


def test_probes_without_replies() -> None:
    """254 probes of 75 bits: 19.1 ms."""
    bench = CanBench(wire=1, id=300)
    for number in range(1, 255):
        bench.send(f"10FF{number:04X} 02")
    assert bench.run() == []
    assert bench.line._free == pytest.approx(0.01905)
    assert bench.line.requests == 0


@each_row(
    ("fault", "heard"),
    [
        ("healthy", [CAN_PROBE_REPLY]),
        ("silent", []),
        ("deaf", []),
        ("wrong-id", ["10FF0002 A7 FE"]),
        ("twin-id", []),
        ("echo", [CAN_PROBE, CAN_PROBE_REPLY]),
        ("loopback", [CAN_PROBE]),
        ("duplicate", [CAN_PROBE_REPLY, CAN_PROBE_REPLY]),
        ("late", []),
        ("slow", []),
        ("no-ack", []),
        ("bus-off", []),
        ("disconnect", []),
        ("refuse", [CAN_PROBE_REPLY]),
    ],
)
def test_bus_faults(fault: str, heard: list[str]) -> None:
    bench = CanBench(fault=fault)
    assert bench.ask(CAN_PROBE) == heard
    assert bench.line.acknowledged is (fault not in ("no-ack", "bus-off"))
    assert bench.line.hung_up is (fault == "disconnect")


@each_row(("fault", "when"), [("late", 0.6), ("slow", 0.020)])
def test_late_frames(fault: str, when: float) -> None:
    bench = CanBench(fault=fault)
    bench.send(CAN_PROBE)
    assert bench.run() == [(when, CAN_PROBE_REPLY)]
    shorter = CanBench(fault="late", late=0.05, turnaround=0.01)
    shorter.send(CAN_PROBE)
    assert shorter.run() == [(pytest.approx(0.06), CAN_PROBE_REPLY)]


def test_late_frame_comes_into_a_later_exchange() -> None:
    bench = CanBench(fault="late", after=1, every=1)
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    assert bench.ask("11000001 04") == []
    bench.line.command("fault none")
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    assert bench.wait(0.6) == ["11000001 6F 00 DE 00"]


def test_stale_frame_comes_first() -> None:
    bench = CanBench(fault="stale")
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    assert bench.ask("11000001 04") == [CAN_PROBE_REPLY, "11000001 6F 00 DE 00"]
    assert bench.ask(CAN_MOVE) == ["11000001 6F 00 DE 00", "15038001"]


def test_truncated_reply_is_shorter() -> None:
    whole = CAN_DUMP_REPLY[0]
    heard = [CanBench(fault="truncate", seed=seed).ask(CAN_DUMP[0])[0] for seed in range(60)]
    assert all(whole.startswith(frame) and frame != whole for frame in heard)
    assert {len(frame.split()) - 1 for frame in heard} == set(range(8))
    assert CanBench(fault="truncate").ask(CAN_MOVE) == ["15038001"]


def test_noise_is_foreign_traffic() -> None:
    for seed in range(30):
        heard = CanBench(fault="noise", seed=seed).ask(CAN_PROBE)
        place = heard.index(CAN_PROBE_REPLY)
        others = heard[:place] + heard[place + 1 :]
        assert 1 <= place <= 3
        assert 1 <= len(others) - place <= 3
        assert all(int(frame[:8], 16) % 16384 != 1 for frame in others)
        assert all(int(frame[:8], 16) < 1 << 29 for frame in others)
        lost = CanBench(fault="noise,silent", seed=seed).ask(CAN_PROBE)
        assert len(lost) >= 2
        assert CAN_PROBE_REPLY not in lost


def test_some_noise_differs_in_the_id_alone() -> None:
    heard = [frame for seed in range(30) for frame in CanBench(fault="noise", seed=seed).ask(CAN_PROBE)]
    near = [frame for frame in heard if int(frame[:8], 16) >> 14 == 0x10FF0001 >> 14 and frame != CAN_PROBE_REPLY]
    assert 10 < len(near) < len(heard) - 30
    assert {len(frame.split()) - 1 for frame in heard} == set(range(9))


def test_other_id_after_the_last_one_is_0() -> None:
    assert CanBench(fault="wrong-id", id=16383).ask("10FF3FFF 02") == ["10FF0000 A7 FE"]
    assert CanBench(fault="wrong-id", id=16382).ask("10FF3FFE 02") == ["10FF3FFF A7 FE"]


def test_traffic_of_others_comes_by_itself() -> None:
    """100 frames a second, none of them with the identifier of a request; they acknowledge without the device, too."""
    bench = CanBench(traffic=100, seed=4)
    bench.send(CAN_PROBE)
    bench.line.command("power off")
    came = []
    while bench.now < 0.995:
        came += bench.wait(0.0005)
    assert 99 <= len(came) <= 101
    assert CAN_PROBE_REPLY not in came
    assert all(int(frame[:8], 16) % 16384 != 1 for frame in came)
    assert bench.ask(CAN_PROBE) == []
    assert bench.line.acknowledged
    bench.line.command("power on")
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    assert bench.line.next_event() == pytest.approx(1.0)
    bench.line.client_bitrate = 500000
    assert bench.wait(1.0) == []
    bench.line.client_bitrate = None
    assert len(bench.wait(1000.0)) <= 1025


def test_twins_destroy_only_replies_that_differ() -> None:
    bench = CanBench(fault="twin-id")
    assert bench.ask("00FA0001 01") == ["00FA0001 01"]
    assert bench.ask(CAN_MOVE) == ["15038001"]
    assert bench.line.bus_errors == 0
    assert bench.ask("11000001 04") == []
    assert bench.ask("01700001 02") == []
    assert bench.line.bus_errors == 2


def test_nobody_acknowledges_at_a_wrong_bitrate() -> None:
    bench = CanBench()
    bench.line.client_bitrate = 500000
    assert bench.ask(CAN_MOVE) == []
    assert (bench.line.acknowledged, bench.line.unacknowledged, bench.line.requests) == (False, 1, 0)
    assert bench.line.next_event() is None
    bench.line.client_bitrate = 1000000
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    assert (bench.line.acknowledged, bench.line.unacknowledged) == (True, 1)


def test_bus_off_lasts_until_the_client_connects_anew() -> None:
    bench = CanBench(fault="bus-off", after=1, every=3)
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    for _ in range(2):
        assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]
    for _ in range(5):
        assert bench.ask(CAN_PROBE) == []
        assert bench.line.bus_off
    bench.line.reconnect()
    assert not bench.line.bus_off
    assert bench.ask(CAN_PROBE) == [CAN_PROBE_REPLY]


def test_lost_acknowledgements_are_counted_by_frames() -> None:
    bench = CanBench(fault="no-ack", after=1, every=2)
    assert [bool(bench.ask(CAN_PROBE)) for _ in range(6)] == [True, True, False, True, False, True]
    assert bench.line.command("requests") == "requests 4"


def test_after_and_every_on_can() -> None:
    bench = CanBench(fault="silent", after=2, every=2)
    assert [bool(bench.ask(CAN_PROBE)) for _ in range(6)] == [True, True, True, False, True, False]


def test_disconnect_takes_the_adapter_away() -> None:
    bench = CanBench(fault="disconnect", after=1, wire=1)
    bench.send(CAN_PROBE)
    bench.send(CAN_PROBE)
    assert [frame for _, frame in bench.run()] == [CAN_PROBE_REPLY]
    assert bench.line.hung_up
    assert bench.line.next_event() is None
    assert bench.ask(CAN_PROBE) == []
    bench.line.command("fault none")
    bench.line.reconnect()
    bench.send(CAN_PROBE)
    assert len(bench.run()) == 1


def test_power_off_takes_what_was_on_the_bus() -> None:
    bench = CanBench(turnaround=0.1)
    bench.send(CAN_PROBE)
    bench.line.power(False)
    assert bench.line.next_event() is None
    bench.line.power(True)
    assert bench.wait(1.0) == []


def test_echo_takes_the_time_of_the_frame() -> None:
    bench = CanBench(fault="echo", wire=1)
    bench.send(CAN_PROBE)
    assert bench.heard() == []
    assert bench.run() == [(pytest.approx(75e-6), CAN_PROBE), (pytest.approx(158e-6), CAN_PROBE_REPLY)]
    bench.line.feed_frame(1, b"", extended=False)
    assert bench.run() == [], "only extended data frames can be handed over"


def test_client_that_writes_without_end_does_not_make_it_grow() -> None:
    bench = CanBench(wire=1)
    for _ in range(5000):
        bench.send(CAN_PROBE)
    assert len(bench.line._host) <= 1024


def test_time_never_goes_back_and_may_start_anywhere() -> None:
    line = create("wrist", {"bus": "can", "wire": "1"})
    line.advance(123456.0)
    line.feed_frame(0x10FF0001, b"\x02")
    line.advance(5.0)
    assert line.take_frames() == []
    assert line.next_event() == pytest.approx(123456.000075, abs=1e-9)
    line.advance(123456.000157)
    assert line.take_frames() == []
    line.advance(123456.000158)
    assert line.take_frames() == [(0x10FF0001, b"\xa7\xfe")]
    fresh = create("wrist", {"bus": "can"})
    fresh.feed_frame(0x10FF0001, b"\x02")
    assert fresh.take_frames() == [(0x10FF0001, b"\xa7\xfe")]


@each_row("fault", sorted(CAN_FAULTS))
@each_row("wire", [0, 1])
def test_every_bus_fault_ends_and_repeats_with_its_seed(fault: str, wire: int) -> None:
    rows = []
    for _ in range(2):
        bench = CanBench(fault=fault, seed=5, wire=wire)
        bench.send(CAN_PROBE)
        bench.send(CAN_MOVE)
        first = bench.heard()
        rows.append((first, bench.run()))
        assert bench.line.next_event() is None
        times = [when for when, _ in rows[-1][1]]
        assert all(before <= after for before, after in pairwise(times))
    assert rows[0] == rows[1]


@each_row("fault", sorted(LINE_FAULTS))
@each_row("wire", [{}, {"wire": 115200}])
def test_every_line_fault_ends_and_repeats_with_its_seed(fault: str, wire: dict[str, object]) -> None:
    rows = []
    for _ in range(2):
        bench = Bench(fault=fault, seed=5, **wire)
        heard = [bench.ask(f"{DUMP} {MOVE}")]
        while (event := bench.line.next_event()) is not None and event < 100.0:
            heard.append(bench.wait(event - bench.now))
        rows.append(heard)
    assert rows[0] == rows[1]


# -- state file, control commands, options -----------------------------------------------------------------------------


@each_row(("first_bus", "second_bus"), [("serial", "can"), ("can", "serial")])
def test_state_goes_from_wire_to_wire(tmp_path: Path, first_bus: str, second_bus: str) -> None:
    """A movement that was under way goes on; the hand's damage that was not saved is still there until a power cycle."""
    state = tmp_path / "wrist.json"
    benches: dict[str, Any] = {"serial": Bench, "can": CanBench}
    first = benches[first_bus](state=state)
    move(first, 125, 655, 1000)
    first.wait(0.5)
    first.ask("EB 90 01 05 12 0E 04 18 FC 3E" if first_bus == "serial" else "05038001 18 FC")
    first.line.close()
    second = benches[second_bus](state=state)
    assert second.angles() == [155, 625]
    assert second.values(1038, 1040, 1042) == [125, 655, 1000]
    assert second.values(1038, space="hand-get") == [-1000]
    second.wait(0.25)
    assert second.angles() == [405, 375]
    second.wait(0.25)
    assert second.angles() == [655, 125]
    second.line.close()
    third = benches[first_bus](state=state, power_cycle=1)
    assert third.angles() == [655, 125]
    assert third.values(1038, 1040, 1042) == [1100, -300, 700]
    assert third.values(1038, space="hand-get") == [904]


def test_state_is_written_with_each_write(tmp_path: Path) -> None:
    state = tmp_path / "wrist.json"
    bench = CanBench(state=state)
    bench.ask(CAN_PROBE)
    assert not state.exists()
    bench.ask(CAN_MOVE)
    saved = json.loads(state.read_text())
    assert (saved["kind"], saved["simulated"], saved["id"]) == ("wrist", True, 1)
    assert saved["targets"] == [-1000, 1000]
    assert list(tmp_path.iterdir()) == [state]


def test_flash_heat_and_errors_are_kept(tmp_path: Path) -> None:
    state = tmp_path / "wrist.json"
    first = Bench(state=state, fault="blocked")
    first.ask("EB 90 01 05 12 0E 04 18 FC 3E")
    first.ask(SAVE)
    first.ask("EB 90 01 04 12 E8 03 02 04")
    body = "02 07 31 0E 04 00 00 00 00"
    first.ask(f"EB 90 {body} {sum(bytes.fromhex(body)) % 256:02X}")
    first.wait(300.0)
    first.line.close()
    second = Bench(state=state)
    assert second.errors() == [3, 3]
    assert min(second.degrees()) > 70
    assert second.line.device.id == 2
    second.line.power_cycle()
    assert second.line.device.id == 1
    assert second.values(1038, space="hand-get") == [-1000]
    assert second.errors() == [2, 2]


@each_row(
    ("key", "value"),
    [
        ("flash", {"id": 0, "speed_code": 0, "kept": ""}),
        ("flash", {"id": 1, "speed_code": 9, "kept": ""}),
        ("flash", {"id": 1, "speed_code": 0, "kept": "00"}),
        ("flash", 1),
        ("id", 255),
        ("speed_code", 3),
        ("wrist", {"4095": "01 02"}),
        ("carrier", {"x": "01"}),
        ("carrier", []),
        ("angles", [0]),
        ("angles", [0, 40000]),
        ("targets", [0, "x"]),
        ("movement", [0, None]),
        ("temperatures", None),
        ("errors", [0, 256]),
    ],
)
def test_impossible_state(tmp_path: Path, key: str, value: object) -> None:
    state = tmp_path / "wrist.json"
    Bench(state=state).line.close()
    good = json.loads(state.read_text())
    assert Bench(state=state).angles() == [-345, 1125]
    state.write_text(json.dumps({**good, key: value}))
    with pytest.raises(ValueError, match="damaged") as caught:
        Bench(state=state)
    assert "\n" not in str(caught.value)


def test_state_of_another_device(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    create("exo", {"state": str(state)}).close()
    with pytest.raises(ValueError, match="of 'exo'"):
        CanBench(state=state)


def test_poke_and_peek() -> None:
    bench = Bench()
    assert bench.line.command("set 1020 0000 E803") == "set 1020 00 00 E8 03"
    assert bench.line.command("set 1028 05 00 02") == "set 1028 05 00 02"
    assert bench.line.command("set 1032 28") == "set 1032 28"
    bench.line.command("set 1026 0700")
    bench.line.command("set 1034 01 02")
    bench.wait(0.1)
    assert bench.angles() == [0, 1000]
    assert bench.errors() == [5, 2]
    assert bench.degrees()[0] == 39, "it cools from there"
    assert bench.values(1024, 1026) == [111, 7]
    assert bench.line.command("get 1034 2") == "01 02"
    bench.line.command("set 1028 00 00 00")
    assert bench.errors() == [0, 0]
    assert bench.line.command("hand-set 1472 0000") == "hand-set 1472 00 00"
    assert bench.ask(VOLTAGE) == "90 EB 01 05 11 C0 05 00 00 DC"
    bench.line.command("hand-set 1000 09")
    assert bench.ask(PROBE) == ""
    assert bench.line.command("temperature 2 71") == "temperature 2 71"
    assert bench.errors() == [0, 2]
    assert "release pitch|yaw" in bench.line.command("help")


@each_row(
    "text",
    [
        "set",
        "set 1020",
        "set 1020 0",
        "set 4095 00 00",
        "hand-set x 00",
        "get 1020 0",
        "get -1 1",
        "temperature 3 40",
        "temperature 1 warm",
        "block",
        "block nose",
        "release both",
        "dance",
        "fault garbel",
    ],
)
def test_bad_command(text: str) -> None:
    for bench in on_both():
        with pytest.raises(ValueError, match=r"\S") as caught:
            bench.line.command(text)
        assert "\n" not in str(caught.value)


@each_row(
    ("options", "message"),
    [
        ({"bus": "usb"}, "bus=usb: not one of serial, can"),
        ({"bus": "can", "fault": "bad-checksum"}, "unknown fault 'bad-checksum'.*Known: .*no-ack"),
        ({"fault": "no-ack"}, "unknown fault 'no-ack'.*Known: .*bad-checksum"),
        ({"ack-dlc": "1"}, "unknown option 'ack-dlc'"),
        ({"bus": "can", "ack-dlc": "2"}, "ack-dlc=2: not one of 0, 1"),
        ({"bus": "can", "baud": "115200"}, "unknown option 'baud'"),
        ({"bus": "can", "bitrate": "250000"}, "bitrate=250000: not one of 1000000, 500000"),
        ({"bus": "can", "wire": "115200"}, "wire=115200"),
        ({"bus": "can", "id": "16384"}, "id=16384: out of range 0 to 16383"),
        ({"id": "255"}, "id=255: out of range 1 to 254"),
        ({"baud": "9600"}, "baud=9600"),
    ],
)
def test_bad_options(options: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        create("wrist", options)
    assert "\n" not in str(caught.value)


@pytest.mark.real
def test_it_starts_light() -> None:
    """Nothing that costs start-up time, and no model of another device; on CAN the rest of it."""
    source = Path(handctl.__file__).parent.parent
    code = (
        "import sys; before = set(sys.modules)\n"
        "from handctl.sim import create\n"
        "for options in ({}, {'bus': 'can'}):\n"
        "    line = create('wrist', options); line.advance(0.0)\n"
        "    print(*sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True, cwd=source)
    serial, can = (set(line.split()) for line in done.stdout.splitlines())
    heavy = {
        "random",
        "dataclasses",
        "typing",
        "asyncio",
        "logging",
        "argparse",
        "json",
        "socket",
        "re",
        "enum",
        "inspect",
    }
    assert not can & heavy
    assert "handctl.sim.exo.device" not in can
    assert "handctl.sim.engine.can_line" in can - serial


# -- the hand behind the wrist --------------------------------------------------------------------------------------------

CALIBRATE, CALIBRATE_ACK = "EB 90 01 04 12 F1 03 01 0C", "90 EB 01 04 12 F1 03 01 0C"  # RH56 chapter 3, example 5
CALIBRATED = "90 EB 01 04 11 02 00 00 18"
CLOSE_LITTLE = "EB 90 01 05 12 CE 05 00 00 EB"  # angle 0
ANGLES, STROKES, FORCES, CURRENTS_OF_HAND = (range(first, first + 12, 2) for first in (1546, 1534, 1582, 1594))
RESTING = [921, 933, 945, 969, 957, 981]


@each_row("bench", on_both(), ids=["serial", "can"])
def test_a_finger_goes_to_its_angle_and_the_others_stay(bench: Any) -> None:
    """Speed 1000 is 1000 units in 0.8 s; the little finger has speed 901 after power-on, so 921 units take 0.818 s."""
    bench.ask(CLOSE_LITTLE if isinstance(bench, Bench) else "05738001 00 00 FF FF FF FF FF FF")
    assert bench.values(*ANGLES, space="hand-get") == RESTING
    assert bench.line.command("hand-get 1612 6") == "01 01 03 02 00 02"  # closing
    bench.wait(0.4)
    assert bench.values(*ANGLES, space="hand-get") == [round(921 - 0.4 * 1250 * 0.901), *RESTING[1:]]
    assert bench.values(1594, 1596, space="hand-get") == [41 + 150, 42]
    bench.wait(0.5)
    assert bench.values(*ANGLES, space="hand-get") == [0, *RESTING[1:]]
    assert bench.values(1534, 1536, 1594, space="hand-get") == [2000, 1133, 41]
    assert bench.line.command("hand-get 1612 6") == "02 01 03 02 00 02"  # arrived
    bench.line.command("power-cycle")
    assert bench.values(*ANGLES, space="hand-get") == [0, *RESTING[1:]]


def test_a_stroke_moves_and_a_speed_counts_on_the_way() -> None:
    bench = Bench()
    bench.ask("EB 90 01 05 12 F2 05 64 00 73")  # speed of the little finger 100
    bench.ask("EB 90 01 05 12 C2 05 D0 07 B6")  # its stroke 2000: bent
    bench.wait(1.0)
    assert bench.values(1546, space="hand-get") == [921 - 125]
    bench.ask("EB 90 01 05 12 F2 05 E8 03 FA")  # 1000
    bench.wait(0.5)
    assert bench.values(1546, space="hand-get") == [921 - 125 - 625]
    bench.ask("EB 90 01 05 12 F2 05 00 00 0F")  # 0: it stands still
    bench.wait(5.0)
    assert bench.values(1546, 1594, space="hand-get") == [921 - 125 - 625, 41]
    bench.ask("EB 90 01 05 12 CE 05 FF FF E9")  # -1 moves nothing
    bench.ask("EB 90 01 05 12 CE 05 E9 03 D7")  # 1001 neither
    assert bench.values(1546, space="hand-get") == [921 - 125 - 625]


def test_calibration_moves_the_hand_and_tells_its_end() -> None:
    bench = Bench()
    assert bench.ask(CALIBRATE) == CALIBRATE_ACK
    seen = [bench.values(*ANGLES, space="hand-get")]
    for _ in range(5):
        assert bench.wait(1.1999) == ""
        seen.append(bench.values(*ANGLES, space="hand-get"))
        bench.ask(CLOSE_LITTLE)  # nothing is done meanwhile
        if len(seen) < 6:
            bench.wait(0.0001)
    assert seen == [
        RESTING,
        [1000] * 6,
        [0, 0, 0, 0, 1000, 1000],
        [1000] * 6,
        [1000, 1000, 1000, 1000, 0, 0],
        [1000] * 6,
    ]
    assert bench.values(*FORCES, space="hand-get") == [-21, 22, -23, 24, -25, 26]
    assert bench.wait(0.001) == CALIBRATED
    assert bench.values(*FORCES, space="hand-get") == [0] * 6
    assert bench.line.command("hand-get 1009 1") == "00"
    assert bench.wait(100.0) == ""
    bench.ask(CLOSE_LITTLE)
    bench.wait(2.0)
    assert bench.values(1546, space="hand-get") == [0]


def test_calibration_without_an_end_frame_and_on_can() -> None:
    bench = Bench(fault="no-late-frames")
    assert bench.ask(CALIBRATE) == CALIBRATE_ACK
    assert bench.wait(10.0) == ""
    assert bench.values(*FORCES, space="hand-get") == [0] * 6
    bus = CanBench()
    assert bus.ask("04FC4001 01") == ["04FC4001"]
    assert bus.wait(10.0) == []
    assert bus.values(*FORCES, *ANGLES, space="hand-get") == [0] * 6 + [1000] * 6


def test_a_finger_on_its_way_goes_on_from_the_state_file(tmp_path: Path) -> None:
    state = tmp_path / "wrist.json"
    first = Bench(state=state)
    first.ask(CLOSE_LITTLE)
    first.wait(0.4)
    first.line.close()
    second = Bench(state=state)
    assert second.values(1546, space="hand-get") == [round(921 - 0.4 * 1250 * 0.901)]
    second.wait(0.5)
    assert second.values(1546, space="hand-get") == [0]
    third = Bench(state=state, elapse=1)
    assert third.values(1546, space="hand-get") == [0]
    saved = json.loads(state.read_text())
    saved["fingers"]["course"] = [[7.0, 1]]
    state.write_text(json.dumps(saved))
    with pytest.raises(ValueError, match="is damaged or foreign"):
        Bench(state=state)
    del saved["fingers"]
    state.write_text(json.dumps(saved))
    Bench(state=state)
