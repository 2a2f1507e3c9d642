"""Modbus RTU and TCP of a simulated RH56 hand: words, exceptions, silences, what arrives in pieces (dossier §2.2, §2.3)."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from handctl.sim.engine.serve import Wires
from tests.sim.hand.bench import Bench
from tests.support.each_row import each_row

ANGLES = "01 03 06 0A 00 06 E5 42"
ANGLES_ARE = "01 03 0C 00 6E 00 DC 01 4A 01 B8 02 26 02 94 FA 22"
READ_ID = "EB 90 01 04 11 E8 03 01 02"
ID_IS_1 = "90 EB 01 04 11 E8 03 01 02"
SILENCE = 0.00175


def crc(data: bytes) -> bytes:
    """Table of one nibble, to be other than the simulator's own."""
    table = (0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401, 0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400)  # fmt: skip
    value = 0xFFFF
    for byte in data:
        value = value >> 4 ^ table[(value ^ byte) & 15]
        value = value >> 4 ^ table[(value ^ byte >> 4) & 15]
    return struct.pack("<H", value)


def rtu(body: str) -> str:
    data = bytes.fromhex(body)
    return (data + crc(data)).hex(" ").upper()


def tcp(body: str, number: int = 1, unit: int = 255) -> str:
    data = bytes.fromhex(body)
    return (struct.pack(">HHHB", number, 0, len(data) + 1, unit) + data).hex(" ").upper()


def pdu(wire: str, **options: object) -> Any:
    """Asks with what stands between unit and check sum; gives the same of the answer."""
    bench = Bench(**{"bus": "modbus-tcp"} if wire == "tcp" else {}, **options)

    def ask(body: str) -> str:
        answer = bench.ask(tcp(body) if wire == "tcp" else rtu("01" + body))
        if wire == "tcp":
            return answer[21:]
        assert not answer or answer == rtu(answer[:-6])
        return answer[3:-6]

    return ask


WIRES = pytest.mark.parametrize("wire", ["rtu", "tcp"])


@WIRES
@each_row(
    ("request_", "answer"),
    [
        pytest.param("03 06 0A 00 06", "03 0C 00 6E 00 DC 01 4A 01 B8 02 26 02 94", id="angles"),
        pytest.param("03 06 0A 00 00", "83 03", id="no register"),
        pytest.param("03 06 0A 00 7E", "83 03", id="126 registers"),
        pytest.param("03 FF FF 00 02", "83 02", id="behind the last one"),
        pytest.param("04 06 0A 00 06", "84 01", id="input registers"),
        pytest.param("2B 0E 01 00", "AB 01", id="device identification"),
        pytest.param("10 05 CE 00 01 04 00 00 00 00", "90 03", id="bytes for two registers"),
        pytest.param("10 05 CE 00 00 00", "90 03", id="writes nothing"),
        pytest.param("06 05 D4 01 2C", "06 05 D4 01 2C", id="one register"),
        pytest.param("03 05 D1 00 01", "03 02 FF FF", id="odd address, two halves"),
    ],
)
def test_requests(wire: str, request_: str, answer: str) -> None:
    assert pdu(wire)(request_) == answer


@WIRES
def test_all_readings_are_those_of_eb90(wire: str) -> None:
    """125 registers from 1500 on, against the bytes in memory."""
    bench = Bench()
    answer = bytes.fromhex(pdu(wire)("03 05 DC 00 7D"))
    swapped = b"".join(answer[place : place + 2][::-1] for place in range(2, len(answer), 2))
    assert list(swapped) == bench.bytes_at(1500, 250)


@pytest.mark.parametrize("pieces", [1, 300])
@pytest.mark.parametrize(("size", "answer"), [(256, "01 AB 01"), (257, "")])
def test_no_frame_is_longer_than_256_bytes(pieces: int, size: int, answer: str) -> None:
    """A function that the hands do not have tells no length. On a line that is never silent, what came would have no end."""
    bench = Bench()
    data = bytes.fromhex(rtu("01 2B" + " 00" * (size - 4)))
    step = -(-len(data) // pieces)
    came = "".join(bench.ask(data[at : at + step].hex(" ")) for at in range(0, len(data), step))
    assert came == (rtu(answer) if answer else "")


def test_words_of_an_f1_are_registers() -> None:
    assert pdu("rtu", model="f1")("03 04 28 00 06") == "03 0C 03 E9 03 F3 03 FD 04 07 04 BA 05 28"
    assert pdu("rtu", model="f1")("06 04 10 03 E8") == "06 04 10 03 E8"


@WIRES
@pytest.mark.parametrize(
    ("options", "request_", "answer"),
    [
        ({"fault": "strict"}, "06 05 CE 07 D0", "86 03"),
        ({"fault": "strict"}, "06 04 4C 00 01", "86 03"),
        ({"fault": "refuse"}, "06 05 CE 01 2C", "86 04"),
        ({"fault": "block-silent"}, "03 04 4C 00 01", "83 02"),
        ({"fault": "high-half"}, "03 06 52 00 03", "03 06 1F 20 21 22 23 24"),
        ({"fault": "high-half"}, "03 06 0A 00 01", "03 02 00 6E"),
    ],
)
def test_states_and_open_points(wire: str, options: dict[str, str], request_: str, answer: str) -> None:
    assert pdu(wire, **options)(request_) == answer


@WIRES
@pytest.mark.parametrize(("most", "count", "good"), [("120", 120, True), ("120", 121, False), ("123", 123, True)])
def test_most_registers_in_one_write(wire: str, most: str, count: int, good: bool) -> None:
    answer = pdu(wire, most_written=most)(f"10 08 00 {count:04X} {2 * count:02X}" + "00" * (2 * count))
    assert answer == (f"10 08 00 00 {count:02X}" if good else "90 03")


def test_unpacked_is_for_rtu_alone() -> None:
    assert pdu("rtu", fault="rtu-unpacked")("03 06 4C 00 06") == "03 0C 00 02 00 01 00 02 00 03 00 02 00 00"
    assert pdu("rtu", fault="rtu-unpacked")("03 06 0A 00 01") == "03 02 00 6E"
    with pytest.raises(ValueError, match="rtu-unpacked"):
        pdu("tcp", fault="rtu-unpacked")


# -- silences of RTU ------------------------------------------------------------------------------------------------------


def test_who_is_not_asked_is_silent() -> None:
    bench = Bench()
    for request in (rtu("02 03 06 0A 00 06"), "01 03 06 0A 00 06 E5 43", "01 03 06 0A"):
        assert bench.ask(request, 0.2) == ""
    assert bench.ask(ANGLES) == ANGLES_ARE


def test_an_answer_comes_behind_a_silence() -> None:
    bench = Bench()
    bench.line.feed(bytes.fromhex(ANGLES))
    assert bench.wait(SILENCE - 0.0001) == ""
    assert bench.wait(0.0002) == ANGLES_ARE


def test_a_request_without_a_silence_before_it_is_none() -> None:
    """Which is why the two protocols need some milliseconds between them (dossier §2.2)."""
    bench = Bench()
    assert bench.ask(READ_ID, 0.0005) == ID_IS_1
    assert bench.ask(ANGLES, 0.1) == ""
    assert bench.ask(ANGLES, 0.005) == ANGLES_ARE
    assert bench.ask(READ_ID, 0.0) == ID_IS_1
    assert bench.ask(rtu("02 03 06 0A 00 06") + ANGLES, 0.1) == "", "two at once are none"


def test_a_request_that_comes_in_pieces() -> None:
    bench = Bench()
    data = bytes.fromhex(ANGLES)
    for place in range(len(data)):
        bench.line.feed(data[place : place + 1])
        heard = bench.wait(0.005)
    assert heard == ANGLES_ARE


@each_row(("speaks", "eb90", "modbus"), [("both", True, True), ("eb90", True, False), ("modbus", False, True)])
def test_what_is_spoken(speaks: str, eb90: bool, modbus: bool) -> None:
    bench = Bench(speaks=speaks)
    assert (bench.ask(READ_ID) == ID_IS_1) == eb90
    assert (bench.ask(ANGLES) == ANGLES_ARE) == modbus


def test_wire_time_of_both() -> None:
    """Live state, the RH56 dossier §5: 9.29 ms on EB90, 8.94 and the silence on Modbus RTU."""
    for request, expected in (("EB 90 01 04 11 FE 05 5A 73", 9.29), ("01 03 05 FE 00 2D E4 EB", 8.94 + 1.75)):
        bench = Bench(wire="auto")
        bench.line.feed(bytes.fromhex(request))
        heard = b""
        while len(heard) < 95:
            when = bench.line.next_event()
            assert when is not None
            bench.line.advance(when)
            heard += bench.line.take()
            if bench.line.next_event() is None:
                break
        assert abs(when * 1000 - expected) < 0.02


# -- TCP --------------------------------------------------------------------------------------------------------------------


def test_unit_is_not_used_and_requests_keep_their_order() -> None:
    bench = Bench(bus="modbus-tcp")
    both = tcp("03 06 0A 00 01", 7, 0) + tcp("03 06 0B 00 01", 9, 33)
    assert bench.ask(both) == "00 07 00 00 00 05 00 03 02 00 6E 00 09 00 00 00 05 21 03 02 DC 00"


def test_requests_in_pieces_and_foreign_protocols() -> None:
    bench = Bench(bus="modbus-tcp")
    data = bytes.fromhex(tcp("03 06 0A 00 01"))
    for byte in data[:-1]:
        bench.line.feed(bytes([byte]))
        assert bench.wait(0.3) == ""
    bench.line.feed(data[-1:])
    assert bench.wait(0.0) == "00 01 00 00 00 05 FF 03 02 00 6E"
    assert bench.ask("00 01 00 07 00 06 FF 03 06 0A 00 01") == ""
    assert bench.ask("00 01 00 00 FF FF FF 03 06 0A 00 01" + "00" * 70000) == ""


# -- faults of the line on every wire -----------------------------------------------------------------------------------------


ASK = {
    "eb90": ({}, READ_ID.replace("E8 03 01 02", "0A 06 0C 32")),
    "rtu": ({}, ANGLES),
    "tcp": ({"bus": "modbus-tcp"}, tcp("03 06 0A 00 06")),
}


@each_row("name", ASK)
@each_row(
    "fault",
    [
        "silent",
        "noise",
        "truncate",
        "bad-checksum",
        "wrong-id",
        "echo",
        "duplicate",
        "twin-id",
        "stale",
        "late",
        "deaf",
    ],
)
def test_faults_of_the_line(name: str, fault: str) -> None:
    options, request = ASK[name]
    healthy = Bench(**options).ask(request, 0.01)
    bench = Bench(fault=fault, seed=3, **options)
    first, later = bench.ask(request, 0.01), bench.wait(1.0)
    assert bench.hand.acts["move"] == 0
    if fault == "late":
        assert (first, later) == ("", healthy)
    elif fault in ("silent", "deaf"):
        assert (first, later) == ("", "")
    elif fault == "echo":
        assert first == f"{request} {healthy}"
    elif fault == "duplicate":
        assert first == f"{healthy} {healthy}"
    elif fault == "stale":
        assert bench.ask(request, 0.01) == f"{healthy} {healthy}"
    elif fault == "noise":
        assert healthy in first
        assert first != healthy
    elif fault == "truncate":
        assert healthy.startswith(first)
        assert len(first) < len(healthy)
    else:
        assert len(first) == len(healthy)
        assert first != healthy
        if fault == "wrong-id" and name == "rtu":
            assert first == rtu(first[:-6])


def test_dribble_and_disconnect() -> None:
    for options, request in ASK.values():
        healthy = Bench(**options).ask(request, 0.01)
        bench = Bench(fault="dribble", **options)
        heard = [bench.ask(request, 0.002), *(bench.wait(0.003) for _ in range(len(healthy)))]
        assert max(len(part) for part in heard) <= 5
        assert " ".join(part for part in heard if part) == healthy
        bench = Bench(fault="disconnect", **options)
        bench.ask(request, 0.01)
        assert bench.line.hung_up


# -- several wires, several clients -----------------------------------------------------------------------------------------


def test_one_hand_on_two_wires() -> None:
    wires = Wires("hand", {"model": "tp", "fault": "txid-off,rtu-unpacked,tactile-dead"}, ["modbus-tcp", "serial"])
    network, pair = wires.lines
    wires.advance(0.0)
    network.feed(bytes.fromhex(tcp("06 05 D4 01 2C", 5)))  # type: ignore[union-attr]
    wires.advance(3.0)
    assert network.take().hex(" ").upper() == tcp("06 05 D4 01 2C", 4)  # type: ignore[union-attr]
    pair.feed(bytes.fromhex("EB 90 01 04 11 10 06 02 2E"))  # type: ignore[union-attr]
    assert pair.take()[7:9] == b"\x2c\x01"  # type: ignore[union-attr]
    pair.feed(bytes.fromhex("EB 90 01 04 12 E8 03 09 0B"))  # type: ignore[union-attr]
    assert wires.command("get 1000 1") == "09"
    assert wires.command("requests") == "requests 3"
    assert wires.command("acts") == wires.lines[1].command("acts")
    wires.power_cycle()
    assert wires.command("get 1000 1") == "01"
    assert wires.command("fault fresh") == "fault fresh"
    with pytest.raises(ValueError, match="unknown fault 'x'"):
        wires.command("fault x")


def test_each_client_has_its_own_end_and_the_faults_of_all() -> None:
    wires = Wires("hand", {"after": "1", "fault": "silent"}, ["modbus-tcp"])
    place = wires
    wires.advance(0.0)
    first, second = place.join(), place.join()
    wires.advance(0.1)
    first.feed(bytes.fromhex(tcp("03 06 0A 00 01"))[:7])
    second.feed(bytes.fromhex(tcp("03 06 0A 00 01", 2)))
    assert second.take() != b""
    first.feed(bytes.fromhex(tcp("03 06 0A 00 01"))[7:])
    assert first.take() != b""
    assert second.take() == b""
    place.leave(first)
    assert len(wires.lines) == 2


@each_row("fault", ["", "two-clients-drop"])
def test_a_second_client(fault: str) -> None:
    wires = Wires("hand", {"fault": fault} if fault else {}, ["modbus-tcp"])
    place = wires
    wires.advance(0.0)
    first, second = place.join(), place.join()
    assert first.hung_up == bool(fault)
    assert not second.hung_up
