"""The simulated EksoNR: literal bytes in and out, on virtual time. The sections are those of the EksoNR dossier; what
they say of the wire is manual section 6.
"""

from __future__ import annotations

from binascii import crc_hqx

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.sim import kinds, model_class
from handctl.sim.ekso.device import crc
from tests.sim.ekso_bench import (
    CANCEL,
    CANCEL_OK,
    DATE_4,
    GET_DATA,
    GET_DATE,
    GET_FEEDBACK,
    GET_SETTINGS,
    GET_TIME,
    POWER_ON,
    SET_OK,
    SET_STEP,
    SET_WRONG_STATE,
    SETTINGS,
    TIME_4,
    Bench,
    message,
)
from tests.support.each_row import each_row

TIME_3 = "96 03 00 C8 0E 05 25 A4 DD"
DATE_3 = "97 03 00 C9 1A 0B 14 F0 D6"
DATA = (
    "99 36 00 CB 01 C2 FF B5 00 5F 02 62 00 78 01 E0 FF CF 0E 10 00 62 0E 26 FF 47 08 A2 FF D8 03 48 00 D2 FD 85 FF C9"
    " 01 40 20 40 04 04 00 00 00 00 00 7D 00 01 00 0C 00 4C 4B 41 6F 01"
)
FEEDBACK = (
    "9A 22 00 CC 01 38 04 D8 02 8F 01 A9 01 2C 01 C2 01 3B 02 58 02 BC 02 6C 02 C6 00 98 00 9C 00 09 00 09 00 4C 4B 41"
    " F4 EC"
)
SET_SHIFT = "9B 04 00 CE 00 D0 FF B5 8B 67"
SET_SHIFT_OK = "9B 02 00 CE 00 00 7A 63"
CANCEL_1 = "9C 02 00 D0 00 01 FA 61"
CANCEL_1_OK = "9C 02 00 D0 00 00 EA 40"

WORD_OF_ID = {
    **{200 + place: place for place in range(10)},
    210: 11,
    211: 20,
    212: 10,
    213: 12,
    214: 21,
    215: 13,
    216: 14,
    217: 16,
    218: 15,
    219: 17,
}


# -- the transcripts of the dossier, section 8 -----------------------------------------------------------------------


def test_it_is_registered() -> None:
    assert "ekso" in kinds()
    assert model_class("ekso").KIND == "ekso"


def test_check_value() -> None:
    assert crc(b"123456789") == 0x29B1


@given(st.binary(max_size=80))
def test_crc_agrees_with_the_library(data: bytes) -> None:
    assert crc(data) == crc_hqx(data, 0xFFFF)


@each_row(
    ("request_", "reply"),
    [
        pytest.param(GET_TIME, TIME_4, id="GetTime, 4 bytes"),
        pytest.param(GET_DATE, DATE_4, id="GetDate, 4 bytes"),
        pytest.param(GET_SETTINGS, SETTINGS, id="GetSettings"),
        pytest.param(GET_DATA, DATA, id="GetData"),
        pytest.param(GET_FEEDBACK, FEEDBACK, id="GetFeedback"),
        pytest.param(SET_STEP, SET_OK, id="SetValue step_length"),
        pytest.param(SET_SHIFT, SET_SHIFT_OK, id="SetValue forward_shift"),
        pytest.param(CANCEL, CANCEL_OK, id="CancelAction 0100"),
        pytest.param(CANCEL_1, CANCEL_1_OK, id="CancelAction 0001"),
    ],
)
def test_transcripts(request_: str, reply: str) -> None:
    assert Bench(preset="vectors").ask(request_) == reply


def test_time_and_date_as_printed() -> None:
    bench = Bench(preset="vectors", time_body=3)
    assert bench.ask(GET_TIME) == TIME_3
    assert bench.ask(GET_DATE) == DATE_3


def test_msg_id_wraps() -> None:
    bench = Bench(rtc="2026-11-20T00:00:00")
    assert bench.ask("96 00 FF FF 78 C9") == "96 04 FF FF 00 00 00 00 BE 16"
    bench = Bench(rtc="2026-11-20T23:59:59")
    assert bench.ask("96 00 00 00 65 C6") == "96 04 00 00 17 3B 3B 00 16 B7"


@each_row(
    ("code", "reply"),
    [(1, SET_WRONG_STATE), (2, "9B 02 00 CD 00 02 03 71"), (3, "9B 02 00 CD 00 03 13 50")],
)
def test_refusals(code: int, reply: str) -> None:
    bench = Bench(preset="vectors", fault="refuse", refuse_status=code)
    assert bench.ask(SET_STEP) == reply
    assert bench.ask(GET_SETTINGS) == SETTINGS
    cancel = "20 01" if code == 1 else f"00 0{code}"
    assert bench.ask(CANCEL)[12:17] == cancel
    assert bench.ask(GET_TIME) == TIME_4


LENGTHS = {  # request head without its length and its body; per convention request length + CRC, answer length + CRC
    "GetTime": ("96", "00 C8", "", "0E 05 25", "02 53E2 05 293C", "04 E142 07 A27C", "06 8F22 09 22DF"),
    "GetTime, padded": ("96", "00 C8", "", "0E 05 25 00", "02 53E2 06 51C9", "04 E142 08 6341", "06 8F22 0A 03A2"),
    "GetDate": ("97", "00 C9", "", "1A 0B 14", "02 3577 05 7D37", "04 87D7 07 F677", "06 E9B7 09 76D4"),
    "GetDate, padded": ("97", "00 C9", "", "1A 0B 14 00", "02 3577 06 40B8", "04 87D7 08 7230", "06 E9B7 0A 12D3"),
    "GetSettings": ("98", "00 CA", "", SETTINGS[12:-6], "02 D1FA 2E F900", "04 635A 30 6574", "06 0D3A 32 EE91"),
    "GetData": ("99", "00 CB", "", DATA[12:-6], "02 B76F 38 A090", "04 05CF 3A 8F7B", "06 6BAF 3C FF46"),
    "GetFeedback": ("9A", "00 CC", "", FEEDBACK[12:-6], "02 5C54 24 ED14", "04 EEF4 26 15A3", "06 8094 28 DEE4"),
    "SetValue 202": ("9B", "00 CD", "00 CA 06 0E", "00 00", "06 3E1D 04 EEB6", "08 0C95 06 AA35", "0A 6C76 08 659D"),
    "SetValue 208": ("9B", "00 CE", "00 D0 FF B5", "00 00", "06 EB84 04 B7E6", "08 D90C 06 F365", "0A B9EF 08 3CCD"),
    "Cancel 0100": ("9C", "00 CF", "01 00", "00 00", "04 7BA6 04 4897", "06 3F25 06 0C14", "08 F08D 08 C3BC"),
    "Cancel 0001": ("9C", "00 D0", "00 01", "00 00", "04 37E4 04 27C5", "06 7367 06 6346", "08 BCCF 08 ACEE"),
}


@each_row("place", [0, 1, 2], ids=["n-4", "n-2", "frame"])
@each_row("name", LENGTHS)
def test_other_length_conventions(name: str, place: int) -> None:
    command, ident, body, answer, *conventions = LENGTHS[name]
    length, check, answer_length, answer_check = conventions[place].split()
    bench = Bench(preset="vectors", length=("n-4", "n-2", "frame")[place], time_body=4 if "padded" in name else 3)
    reply = bytes.fromhex(f"{command}{answer_length}{ident}{answer}{answer_check}").hex(" ").upper()
    assert bench.ask(f"{command}{length}{ident}{body}{check}") == reply


@each_row(("place", "status"), [(0, "2001 F871"), (1, "2001 BCF2"), (2, "2001 735A")])
def test_refused_in_other_conventions(place: int, status: str) -> None:
    bench = Bench(preset="vectors", length=("n-4", "n-2", "frame")[place], fault="refuse")
    length, check = LENGTHS["SetValue 202"][4 + place].split()[:2]
    answer_length = LENGTHS["SetValue 202"][4 + place].split()[2]
    expected = bytes.fromhex(f"9B{answer_length}00CD{status}").hex(" ").upper()
    assert bench.ask(f"9B{length}00CD00CA060E{check}") == expected


def test_answers_may_count_otherwise() -> None:
    bench = Bench(preset="vectors", answer_length="frame")
    assert bench.ask(GET_TIME) == "96 0A 00 C8 0E 05 25 00 03 A2"


@each_row(
    ("preset", "request_", "reply"),
    [
        (
            "order",
            "98 00 01 00 A2 C9",
            "98 2C 01 00 01 80 02 81 03 82 04 83 05 84 06 85 07 86 08 87 09 88 0A 89 0B 8A 0C 8B 0D 8C 0E 8D 0F 8E 10 8F"
            " 11 90 12 91 13 92 14 93 15 94 16 95 8D 4E",
        ),
        (
            "order",
            "99 00 01 01 C4 5C",
            "99 36 01 01 01 80 02 81 03 82 04 83 05 84 06 85 07 86 08 87 09 88 0A 89 0B 8A 0C 8B 0D 8C 0E 8D 0F 8E 10 8F"
            " 11 90 12 91 13 92 14 93 15 94 16 95 17 96 18 97 19 98 1A 99 1B 9A 8B E3",
        ),
        (
            "order",
            "9A 00 01 02 2F 67",
            "9A 22 01 02 01 80 02 81 03 82 04 83 05 84 06 85 07 86 08 87 09 88 0A 89 0B 8A 0C 8B 0D 8C 0E 8D 0F 8E 10 8F"
            " 11 90 62 CA",
        ),
        (
            "sign",
            "98 00 01 10 B0 F8",
            "98 2C 01 10 F0 00 F0 11 F0 22 F0 33 F0 44 F0 55 F0 66 F0 77 F0 88 F0 99 F0 AA F0 BB F0 CC F0 DD F0 EE F0 FF"
            " F1 10 F1 21 F1 32 F1 43 F1 54 F1 65 FB B0",
        ),
        (
            "sign",
            "99 00 01 11 D6 6D",
            "99 36 01 11 F0 00 F0 11 F0 22 F0 33 F0 44 F0 55 F0 66 F0 77 F0 88 F0 99 F0 AA F0 BB F0 CC F0 DD F0 EE F0 FF"
            " F1 10 F1 21 F1 32 F1 43 F1 54 F1 65 F1 76 F1 87 F1 98 F1 A9 F1 BA C7 B2",
        ),
        (
            "sign",
            "9A 00 01 12 3D 56",
            "9A 22 01 12 F0 00 F0 11 F0 22 F0 33 F0 44 F0 55 F0 66 F0 77 F0 88 F0 99 F0 AA F0 BB F0 CC F0 DD F0 EE F0 FF"
            " F1 10 64 5F",
        ),
    ],
)
def test_ladders(preset: str, request_: str, reply: str) -> None:
    command, ident = int(request_[:2], 16), int(request_[6:11].replace(" ", ""), 16)
    assert Bench(preset=preset).ask(message(command, ident).hex()) == reply


@each_row(
    ("request_", "word", "raw"),
    [
        pytest.param("9B 04 02 03 00 D1 FF FF CC 5B", 9, 0xFFFF, id="lateral_shift -0.01"),
        pytest.param("9B 04 02 04 00 D0 FF B5 75 31", 8, 0xFFB5, id="forward_shift -0.75"),
        pytest.param("9B 04 02 06 00 D1 FF 00 F1 FC", 9, 0xFF00, id="lateral_shift -2.56"),
        pytest.param("9B 04 02 07 00 D8 00 0A 67 89", 14, 10, id="left_swing_assist"),
        pytest.param("9B 04 02 08 00 DA 00 15 8F CE", 15, 21, id="right_swing_assist"),
        pytest.param("9B 04 02 09 00 D3 00 01 E9 BB", 20, 1, id="sit_mode"),
    ],
)
def test_writes_of_the_dossier(request_: str, word: int, raw: int) -> None:
    bench = Bench()
    ident = int.from_bytes(bytes.fromhex(request_)[2:4], "big")
    assert bench.ask(request_) == message(155, ident, b"\0\0").hex(" ").upper()
    wanted = list(POWER_ON)
    wanted[word] = raw
    assert bench.words(152) == wanted


@each_row("request_", ["9B 04 02 00 00 CC 00 1D FD 28", "9B 04 02 02 00 CA 00 73 86 63"])
def test_writes_below_the_invented_limits(request_: str) -> None:
    """Swing time 0.29 and step length 1.15 are good messages; the simulator's range is narrower."""
    assert Bench().ask(request_)[12:17] == "00 02"


# -- settings: places, limits, refusals --------------------------------------------------------------------------------


def test_power_on_values() -> None:
    bench = Bench()
    assert bench.words(152) == POWER_ON
    data, feedback = bench.words(153), bench.words(154)
    assert len(data) == 27
    assert len(set(data)) == 27
    assert len(feedback) == 17
    assert len(set(feedback)) == 17
    assert data[25:] == feedback[15:] == [116, 7654321 - 116 * 65536]


@each_row(("parameter", "word"), WORD_OF_ID.items())
def test_each_id_changes_its_word_only(parameter: int, word: int) -> None:
    bench = Bench(posture="sitting")
    raw = {200: 1700, 201: 1650, 202: 1500}.get(parameter, 100 if parameter <= 209 else 1 if POWER_ON[word] != 1 else 0)
    wanted = list(POWER_ON)
    wanted[word] = raw
    assert wanted != POWER_ON
    assert bench.set(parameter, raw) == (0, 0)
    assert bench.words(152) == wanted


@each_row("parameter", [0, 199, 220, 0xCA00, 65535])
def test_unknown_ids(parameter: int) -> None:
    bench = Bench()
    assert bench.set(parameter, 1) == (0, 3)
    assert bench.words(152) == POWER_ON


@each_row(
    ("parameter", "low", "high", "code"),
    [
        *((number, 1000, 2500, 2) for number in (200, 201)),
        (202, 400, 2400, 2),
        (203, 0, 600, 2),
        (204, 40, 250, 2),
        (205, 0, 500, 2),
        *((number, 0, 4000, 2) for number in (206, 207)),
        *((number, -500, 500, 2) for number in (208, 209)),
        *((number, 0, 1, 3) for number in (210, 211)),
        *((number, 0, 3, 3) for number in (212, 213, 215)),
        (214, 0, 2, 3),
        *((number, 0, 27, 3) for number in (216, 218)),
        *((number, 0, 5, 3) for number in (217, 219)),
    ],
)
def test_limits(parameter: int, low: int, high: int, code: int) -> None:
    bench = Bench()
    assert [bench.set(parameter, raw) for raw in (low, high)] == [(0, 0), (0, 0)]
    assert [bench.set(parameter, raw) for raw in (low - 1, high + 1)] == [(0, code), (0, code)]
    assert bench.words(152)[WORD_OF_ID[parameter]] == high % 65536


@each_row(("posture", "state"), [("rising", 0x30), ("lowering", 0x34), ("held", 0x30), ("walking", 0x44)])
def test_settings_are_refused_between_the_postures(posture: str, state: int) -> None:
    bench = Bench(posture=posture)
    assert bench.set(202, 1500) == (state, 1)
    assert bench.set(202, 9999) == (state, 1)
    assert bench.set(213, 9) == (0, 3)
    assert bench.words(152) == POWER_ON


def test_cancel_with_0_is_not_allowed() -> None:
    bench = Bench(posture="walking")
    assert bench.ask(message(156, 0xCF, b"\0\0").hex()) == "9C 02 00 CF 00 03 B5 71"
    assert bench.line.command("posture") == "posture walking state 4440"
    assert bench.ask(CANCEL) == CANCEL_OK
    assert bench.line.command("posture") == "posture standing state 2040"


def test_movement_command_is_a_violation() -> None:
    bench = Bench()
    assert bench.ask(message(157, 1, b"\0\1").hex()) == message(157, 1, b"\0\3").hex(" ").upper()
    assert bench.line.command("counts") == "set 0 cancel 0 violations 1"
    assert bench.words(153)[18] == 0x2040


def test_field_commands() -> None:
    bench = Bench()
    assert bench.words(158) == [0x2040, 0, 0]
    assert bench.words(159) == [1]


# -- what makes no sense ---------------------------------------------------------------------------------------------


@each_row(
    "bad",
    [
        pytest.param("96 00 00 C8 82 3D", id="CRC low byte first"),
        pytest.param("96 00 00 C8 B9 42", id="CRC from 0000"),
        pytest.param("96 02 00 C8 53 E2", id="n-4"),
        pytest.param("96 06 00 C8 8F 22", id="frame"),
        pytest.param("00", id="one byte"),
        pytest.param("96 FF", id="waits for more"),
        pytest.param("9B 04 00 CD 00 CA 06 0F 5E FE", id="value changed"),
    ],
)
def test_silence_until_the_line_is_quiet(bad: str) -> None:
    bench = Bench(preset="vectors")
    assert bench.ask(bad) == ""
    assert bench.ask(GET_TIME) == ""
    assert bench.wait(0.09) == ""
    assert bench.ask(GET_TIME) == ""
    assert bench.wait(0.11) == ""
    assert bench.ask(GET_TIME) == TIME_4
    assert bench.ask(GET_SETTINGS) == SETTINGS
    assert bench.line.command("requests") == "requests 2"


def test_bad_crc_may_be_acknowledged() -> None:
    bench = Bench(preset="vectors", bad_crc="acknowledge")
    assert bench.ask("98 00 00 CA BF 9B") == "98 00 00 CA BF 9A"
    assert bench.ask(GET_TIME) == TIME_4


def test_length_that_cannot_be() -> None:
    bench = Bench(preset="vectors", length="frame")
    assert bench.ask(GET_TIME) == ""
    bench.wait(0.2)
    assert bench.ask("96 06 00 C8 8F 22") == "96 0A 00 C8 0E 05 25 00 03 A2"


def test_unknown_commands_and_sizes_are_acknowledged() -> None:
    bench = Bench()
    for command, body in ((1, b""), (149, b"abc"), (160, b""), (150, b"x"), (152, b"ab"), (155, b"\0\xca"), (156, b"")):
        assert bench.ask(message(command, 9, body).hex()) == message(command, 9).hex(" ").upper()
    assert bench.words(152) == POWER_ON
    assert Bench(unknown="silence").ask(message(1, 9).hex()) == ""


def test_requests_in_pieces_and_in_a_row() -> None:
    bench = Bench(preset="vectors")
    for byte in SET_STEP.split()[:-1]:
        assert bench.ask(byte) == ""
        bench.wait(0.05)
    assert bench.ask("FE") == SET_OK
    assert bench.ask(f"{GET_TIME} {GET_DATE} {GET_TIME[:9]}") == f"{TIME_4} {DATE_4}"


@given(st.lists(st.binary(max_size=40), max_size=6), st.sampled_from(["body", "n-4", "n-2", "frame"]))
def test_junk_never_raises_and_never_sets(chunks: list[bytes], length: str) -> None:
    bench = Bench(length=length)
    for chunk in chunks:
        bench.line.feed(chunk)
        bench.wait(0.02)
    assert bench.line.command("counts") == "set 0 cancel 0 violations 0"


@given(st.integers(0, 255), st.integers(0, 65535), st.binary(max_size=40))
def test_any_good_message_is_answered(command: int, ident: int, body: bytes) -> None:
    bench = Bench()
    bench.line.feed(message(command, ident, body))
    reply = bench.line.take()
    assert reply == message(command, ident, reply[4:-2])
    assert len(reply[4:-2]) == reply[1]
