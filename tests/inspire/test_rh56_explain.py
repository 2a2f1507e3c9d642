"""Recorded bytes of the RH56 hands in words: EB 90 of byte and of word addresses, Modbus RTU and TCP (rh56 §3, §4)."""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.devices.inspire.hand.explain_bytes import explainer
from handctl.devices.inspire.modbus_frames import to_memory
from handctl.model.explainer import DEVICE, HOST, ExplainedBytes
from tests.support.cli import run
from tests.support.each_row import each_row

FRAMES = [
    pytest.param("EB 90 01 04 11 0A 06 0C 32", "read angle_actual: 12 bytes at 1546, id 1", id="v1"),
    pytest.param("90 EB 01 09 11 46 06 01 02 04 06 18 00 8C", "error = 1 2 4 6 24 0 (little locked_rotor, ring over_temperature, middle over_current, index over_temperature, over_current, thumb_bend motor, communication), id 1", id="v14"),
    pytest.param("EB 90 01 04 12 ED 03 01 08", "write save = 1, id 1. On an RH56F1 and an RH5DG2: factory_reset", id="v30-save"),
    pytest.param("EB 90 01 04 12 EC 03 01 07", "write clear_errors = 1, id 1. On an RH56F1 and an RH5DG2: save", id="v30-clear"),
    pytest.param("EB 90 01 04 11 28 04 0C 4E", "read undocumented: 12 bytes at 1064, id 1. On an RH56F1: angle_actual. On an RH5DG2: default_force to stroke_set", id="v25"),
    pytest.param("EB 90 01 05 12 EF 03 01 00 0B", "write undocumented bytes 01 00, id 1. On an RH56F1 and an RH5DG2: calibrate_force", id="v27"),
    pytest.param("EB 90 01 04 11 70 04 02 8C", "read undocumented: 2 bytes at 1136, id 1. On an RH5DG2: angle_actual.m1", id="v28"),
    pytest.param("01 03 06 0A 00 06 E5 42", "read angle_actual: 6 registers at 1546, id 1", id="v36"),
    pytest.param("01 06 05 D4 01 2C C9 73", "accepted: write at 1492 angle_set.index, id 1", id="v43"),
    pytest.param("01 10 05 CE 00 06 0C FF FF FF FF FF FF 01 2C FF FF FF FF 08 3F", "write angle_set = -1 -1 -1 300 -1 -1 (little left as it is, ring left as it is, middle left as it is, thumb_bend left as it is, thumb_rotation left as it is) at 1486, id 1", id="v42"),
    pytest.param("01 83 02 C0 F1", "refused: exception 02, illegal address, id 1", id="v45"),
    pytest.param("00 05 00 00 00 06 FF 03 06 A4 00 02", "read ip_address: 2 registers at 1700, transaction 5", id="v49"),
    pytest.param("00 0B 00 00 00 06 FF 06 03 ED 00 01", "accepted: write at 1005 save, transaction 11", id="v53"),
]  # fmt: skip


@each_row(("frame", "meaning"), FRAMES)
def test_a_frame_in_words(frame: str, meaning: str) -> None:
    (piece,) = explainer().decode(bytes.fromhex(frame))
    assert piece.meaning == meaning
    assert piece.raw == bytes.fromhex(frame)


def told(*lines: str) -> list[ExplainedBytes]:
    """The pieces of a conversation; `! TEXT` is an event."""
    words, found = explainer(), list[ExplainedBytes]()
    for line in lines:
        mark, _, rest = line.partition(" ")
        if mark == "!":
            found += words.flush()
            words.event(rest)
        else:
            found += words.feed(HOST if mark == ">" else DEVICE, bytes.fromhex(rest))
    return [*found, *words.flush()]


def meanings(*lines: str) -> list[str]:
    return [piece.meaning for piece in told(*lines)]


def eb90(header: str, body: str) -> str:
    data = bytes.fromhex(body)
    inner = bytes([1, len(data)]) + data
    return f"{header} {(inner + bytes([sum(inner) % 256])).hex(' ')}"


def read(address: int, values: list[int], size: int = 2) -> tuple[str, str]:
    """A question at an address of a frame, and its answer."""
    place = address.to_bytes(2, "little").hex()
    data = b"".join(value.to_bytes(size, "little", signed=value < 0) for value in values)
    return f"> {eb90('EB 90', f'11{place}{len(data):02x}')}", f"< {eb90('90 EB', f'11{place}{data.hex()}')}"


F1_ANGLES = [1010, 1120, 1230, 1340, 1150, 1560]
F1_STATES = [2, 1, 2, 3, 2, 0, 31, 32, 33, 34, 35, 36]
SAVE_F1 = ("> EB 90 01 05 12 EC 03 01 00 08", "< 90 EB 01 04 12 EC 03 01 07", "< 90 EB 01 04 12 EC 03 00 06")


def test_three_groups_of_words_show_an_f1_from_there_on() -> None:
    found = meanings(
        *read(1606, [0] * 18, 1), *read(1064, F1_ANGLES), *read(1088, F1_STATES), *read(1022, [701] * 6), *SAVE_F1
    )
    assert found[2].startswith("read undocumented: 12 bytes at 1064, id 1. On an RH56F1: angle_actual.")
    assert found[5].startswith("status = 2 1 2 3 2 0 (little position reached, ")
    assert found[6:8] == ["read default_speed: 12 bytes at 1022, id 1", "default_speed = 701 701 701 701 701 701, id 1"]
    assert found[8:] == [
        "write save = 1, id 1",
        "accepted: write at 1004 save, id 1",
        "result of the save: saved",
    ]


def test_thirteen_temperatures_and_angles_show_a_dg2() -> None:
    found = told(*read(1136, list(range(1000, 1013))), *read(1206, list(range(30, 43))), *read(1038, [7] * 13))
    assert found[3].meaning == f"temperature = {' '.join(map(str, range(30, 43)))} °C, id 1"
    assert [value.name for value in found[5].values] == [f"default_speed.m{number}" for number in range(1, 14)]


def test_states_of_six_fingers_show_a_hand_of_byte_addresses() -> None:
    """What the other generations have there is said no more."""
    states = [0] * 6 + [2, 1, 2, 3, 2, 0] + [31, 32, 33, 34, 35, 36]
    save = "> EB 90 01 04 12 ED 03 01 08"
    assert meanings(save)[0].endswith("On an RH56F1 and an RH5DG2: factory_reset")
    assert meanings(*read(1606, states, 1), save)[2] == "write save = 1, id 1"


def test_an_event_names_the_generation() -> None:
    assert meanings("! generation f1", *read(1022, [701] * 6), *read(1040, [-1] * 6))[1::2] == [
        "default_speed = 701 701 701 701 701 701, id 1",
        "angle_set = -1 -1 -1 -1 -1 -1 0.1 ° (little left as it is, ring left as it is, middle left as it is, "
        "index left as it is, thumb_bend left as it is, thumb_rotation left as it is), id 1",
    ]
    assert meanings("! generation tp", "> EB 90 01 04 12 ED 03 01 08") == ["write save = 1, id 1"]
    assert meanings("! baud 9600", "> EB 90 01 04 12 ED 03 01 08")[0].endswith("factory_reset")


def test_words_over_modbus_rtu() -> None:
    from handctl.devices.inspire import modbus_frames

    def asked(address: int, values: list[int]) -> tuple[str, str]:
        words = b"".join((value & 0xFFFF).to_bytes(2, "big") for value in values)
        request = modbus_frames.rtu(1, modbus_frames.read_request(address, len(values)))
        return f"> {request.hex()}", f"< {modbus_frames.rtu(1, bytes([3, len(words)]) + words).hex()}"

    found = meanings(*asked(1064, F1_ANGLES), *asked(1088, F1_STATES), *asked(1094, F1_STATES[6:]))
    assert found[0].startswith("read undocumented: 6 registers at 1064. On an RH56F1: angle_actual.")
    assert found[4:] == ["read temperature: 6 registers at 1094, id 1", "temperature = 31 32 33 34 35 36 °C, id 1"]


def test_our_own_question_that_comes_back() -> None:
    asked = "01 03 06 0A 00 06 E5 42"
    answered = "01 03 0C 00 6E 00 DC 01 4A 01 B8 02 26 02 94 FA 22"
    found = told(f"> {asked}", f"< {asked}", f"< {answered}")
    assert [(piece.problem, piece.meaning) for piece in found[1:]] == [
        ("echo", "our own bytes came back: read angle_actual: 6 registers at 1546, id 1"),
        ("", "angle_actual = 110 220 330 440 550 660, id 1"),
    ]
    assert found[0].asks == found[2].answers != "" == found[1].answers


@each_row(("frame", "fields"), [
    ("01 03 06 0A 00 06 E5 42", ["unit", "function", "address, count", "CRC"]),
    ("01 06 05 F2 E8 03 26 F4", ["unit", "function", "address, count", "speed_set.little", "CRC"]),
    ("00 05 00 00 00 06 FF 03 06 A4 00 02", ["header", "function", "address, count"]),
])  # fmt: skip
def test_modbus_field_by_field(frame: str, fields: list[str]) -> None:
    (piece,) = explainer().feed(HOST, bytes.fromhex(frame))
    assert [part.name for part in piece.parts] == fields
    assert b"".join(part.raw for part in piece.parts) == piece.raw


def test_a_recorded_trace_names_the_generation(tmp_path: Path) -> None:
    """Without a look at the states too: what is typed is recorded."""
    trace = tmp_path / "trace.txt"
    link = "fake://hand?model=f1&clock=virtual"
    done = run("hand", "get", "default_speed.little", "-p", link, "--model", "f1", "--trace", str(trace), "--json")
    assert done.code == 0, done
    assert done.json["device"]["model"] == "f1"
    assert "! generation f1\n" in trace.read_text()
    shown = run("trace", "show", str(trace), "--json")
    assert any(row["meaning"].startswith("default_speed = 701 702 703 ") for row in shown.rows)
    played = run("hand", "get", "default_speed.little", "-p", f"replay:{trace}", "--model", "f1", "--format", "plain")
    assert played.out == "701\n"


# -- which bytes write --------------------------------------------------------------------------------------------------


def test_a_save_of_an_f1_is_done_with_its_result_only() -> None:
    """1004 clears the errors of a DF and saves on an F1 (rh56 §6 Q4): 01 is not the end of it, 00 and FF are."""
    from handctl.devices.inspire.hand.explain_bytes import words

    def verdicts(*lines: str) -> list[tuple[bool, str]]:
        writes, found = words(), list[tuple[bool, str]]()
        for line in lines:
            mark, _, rest = line.partition(" ")
            data = bytes.fromhex(rest)
            if mark == ">":
                for frame in writes.sent(data, None):
                    found.append((False, writes.next(frame.data, None)))
            else:
                came = [(accepted, "") for _, accepted in writes.came(data, None)]
                found += came if found else []  # behind a write only
        return found

    shown = (*read(1064, F1_ANGLES), *read(1088, F1_STATES))
    failed = "< 90 EB 01 04 12 EC 03 FF 05"
    after = "switch the power off and on, then `handctl hand dump`"
    assert verdicts(*shown, *SAVE_F1) == [(False, after), (True, "")]
    assert verdicts(*shown, *SAVE_F1[:2], failed) == [(False, after), (False, "")]
    cleared = ("> EB 90 01 04 12 EC 03 01 07", "< 90 EB 01 04 12 EC 03 01 07")
    assert verdicts(*cleared) == [(False, "`handctl hand status`"), (True, "")]
    speed = f"> {eb90('EB 90', '12fe03' + '0100' * 6)}"
    assert verdicts(*shown, speed) == [(False, "`handctl hand get default_speed`")]
    assert verdicts(speed) == [(False, "`handctl hand get current_limit`")]


def test_half_a_register_is_explained() -> None:
    """A reply whose count was damaged ends in the middle of a register (Modbus TCP has no checksum)."""
    asked, damaged = "> 00 03 00 00 00 06 FF 03 06 46 00 09", "< 00 03 00 00 00 06 FF 03 03 02 01 05"
    pieces = told(asked, damaged)
    assert [piece.frame for piece in pieces] == [True, True]
    assert to_memory(bytes((1, 2, 3))) == bytes((2, 1, 3))
    assert to_memory(to_memory(bytes(range(7)))) == bytes(range(7))
