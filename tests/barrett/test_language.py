"""The text protocol of the BarrettHand without a link: encoding, prefixes, status sums, answers (barrett §5.1)."""

from __future__ import annotations

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from handctl.devices.barrett.gcl import status_codes
from handctl.devices.barrett.gcl.codec import Answer, Decoder, batches, encode, motor_prefix, motors_of, values
from handctl.errors import ProtocolError, UsageError
from tests.barrett.support import gcl
from tests.support.each_row import each_row

STATUS = [
    # code, the manual's words (barrett §5.1.3, Table 3)
    (1, "No motor board found"), (2, "No motor found"), (4, "Motor not initialized"), (16, "Couldn't reach position"),
    (32, "Unknown command"), (64, "Unknown parameter name"), (128, "Invalid value"), (256, "Tried to write a read only parameter"),
    (1024, "Too many arguments for this command"), (2048, "Invalid RealTime control block header"),
    (4096, "Command can't have motor prefix"), (8192, "Overtemperature fault tripped"), (16384, "Cntl-C abort command received"),
]  # fmt: skip


def decode(command: str, data: bytes, pieces: int = 0) -> Answer | None:
    decoder = Decoder(command)
    for start in range(0, len(data), pieces or len(data) or 1):
        decoder.feed(data[start : start + (pieces or len(data))])
    return decoder.next()


def must(command: str, data: bytes) -> Answer:
    answer = decode(command, data)
    assert answer is not None
    return answer


# -- encode -----------------------------------------------------------------------------------------------------------


def test_a_command_ends_with_one_cr() -> None:
    assert encode("FGET P") == bytes.fromhex("46 47 45 54 20 50 0D")
    assert encode("") == b"\r"
    assert encode(" ~") == b" ~\r"


@each_row("text", ["HI\r", "HI\nO", "HI\x03", "\x1b[A", "M 5°", "HI\x7f", "M\t5", "\x00", "Ｏ"])
def test_only_printable_ascii_leaves(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        encode(text)
    assert caught.value.exit_code == 2


# -- motors -----------------------------------------------------------------------------------------------------------


@each_row(
    ("text", "digits"),
    [
        ("1", "1"), ("4", "4"), ("S", "4"), ("s", "4"), ("G", "123"), ("g", "123"), ("12S", "124"), ("S123", "1234"),
        ("123S", "1234"), ("321", "123"), ("11", "1"), ("GS", "1234"), ("SG", "1234"), ("3S", "34"), ("F1", "1"),
        ("f3", "3"), ("F1,F3", "13"), ("1,3", "13"), ("F2 SPREAD", "24"), ("spread", "4"), ("all", "1234"),
        ("ALL", "1234"), ("*", "1234"), ("G1", "123"), ("G4", "1234"), (" 1 ", "1"),
    ],
)  # fmt: skip
def test_motor_prefix(text: str, digits: str) -> None:
    """barrett §5.1.2, Table 2."""
    assert motor_prefix(text) == digits


@each_row("text", ["", " ", ",", "5", "0", "12X", "F5", "thumb", "1-3", "-1", "F", "C", "1C", "１"])
def test_no_motor_prefix(text: str) -> None:
    with pytest.raises(UsageError):
        motor_prefix(text)


def test_motors_of_a_prefix() -> None:
    assert motors_of("") == ["F1", "F2", "F3", "SPREAD"]
    assert motors_of("14") == ["F1", "SPREAD"]
    assert motors_of("2") == ["F2"]


# -- status sums ------------------------------------------------------------------------------------------------------


@each_row(("code", "words"), STATUS)
def test_status_codes(code: int, words: str) -> None:
    text = status_codes.explain_status(code)
    assert f"({code})" in text
    assert text == f"{words} ({code})", "the manual's wording, T3"
    assert status_codes.hint_for(code)
    assert "does not list" not in status_codes.hint_for(code)


def test_exactly_the_codes_of_the_table() -> None:
    assert list(status_codes.STATUS_CODES) == [code for code, _ in STATUS]
    assert sum(status_codes.STATUS_CODES) == 32247


@each_row(
    ("code", "text"),
    [
        (0, "ready"),
        (20, "Motor not initialized (4) + Couldn't reach position (16)"),
        (8196, "Motor not initialized (4) + Overtemperature fault tripped (8192)"),
        (8, "(not used) (8)"),
        (512, "(not used) (512)"),
        (520, "(not used) (8) + (not used) (512)"),
        (32768, "unknown (32768)"),
        (32772, "Motor not initialized (4) + unknown (32768)"),
        (1 << 40, "unknown (1099511627776)"),
    ],
)
def test_sums_keep_every_bit(code: int, text: str) -> None:
    assert status_codes.explain_status(code) == text


@given(st.integers(0, 1 << 64))
def test_split_status_is_exact(code: int) -> None:
    bits = status_codes.split_status(code)
    assert sum(bits) == code
    assert bits == sorted(set(bits))
    assert all(bit & (bit - 1) == 0 for bit in bits)


def test_a_hint_for_unknown_codes() -> None:
    assert "does not list" in status_codes.hint_for(8)
    assert "does not list" in status_codes.hint_for(0)
    assert "init" in status_codes.hint_for(8 | 4 | 16)


# -- answers ----------------------------------------------------------------------------------------------------------

SHAPES = [
    (b"FGET P\n\r0 1 2 3\n\r=> ", ("0 1 2 3",), 0),
    (b"FGET P\r\n0 1 2 3\r\n=> ", ("0 1 2 3",), 0),
    (b"FGET P\n\r0 1 2 3\n\r=>", ("0 1 2 3",), 0),
    (b"fget p\n\r0 1 2 3\n\r=> ", ("0 1 2 3",), 0),
    (b"FGET P\n\r=> ", (), 0),
    (b"FGET P\n\rERR 64\n\r=> ", (), 64),
    (b"FGET P\n\r0\n\rERR 64\n\r=> ", ("0",), 64),
    (b"FGET P\n\r\n\r0\n\r\n\r=> ", ("0",), 0),
    (b"FGET P\n\rERR  4\n\r=> ", (), 4),
    (b"FGET P\n\ra => b\n\r=> ", ("a => b",), 0),
    (b"FGET P\n\rERR x\n\rERR\n\rERR 4 5\n\r=> ", ("ERR x", "ERR", "ERR 4 5"), 0),
    (b"FGET P\n\r\xff\xfe\n\r=> ", ("\ufffd\ufffd",), 0),
]


@each_row("pieces", [0, 1, 3])
@each_row(("data", "lines", "status"), SHAPES)
def test_answers(data: bytes, lines: tuple[str, ...], status: int, pieces: int) -> None:
    answer = decode("FGET P", data, pieces)
    assert answer is not None
    assert (answer.command, answer.lines, answer.status) == ("FGET P", lines, status)


@each_row(
    "data",
    [
        b"", b"FGET", b"FGET P", b"FGET P\n\r0 1 2 3", b"FGET P\n\r0 1 2 3\n\r", b"FGET P\n\r0 1 2 3\n\r=", b"=> ",
        b"FGET P=> ", b"FGET P\n\rx=> ", b"FGET Q\n\r0\n\r=> ", b"FGET PP\n\r0\n\r=> ", b"\n\r0 1 2 3\n\r=> ",
    ],
)  # fmt: skip
def test_no_answer_yet(data: bytes) -> None:
    """The prompt stands on a line of its own behind the echo of this very command."""
    assert decode("FGET P", data) is None


def test_the_echo_of_err_3_is_no_error() -> None:
    """The trap of barrett §5.2.4: the echo looks like a status line."""
    answer = must("ERR 3", gcl("ERR 3", "1 No motor board found", "2 No motor found"))
    assert (answer.lines, answer.status) == (("1 No motor board found", "2 No motor found"), 0)
    assert must("ERR 3", gcl("ERR 3")).status == 0
    assert must("ERR 3", gcl("ERR 3", "ERR 128")).status == 128


@pytest.mark.parametrize("noise", [b"\xff", b"\x00\x80", b"\n\r=> ", b"9 9 9 9\n\r=> ", b"FGET\n\rERR 32\n\r=> "])
def test_noise_and_stale_answers_are_cut_off(noise: bytes) -> None:
    decoder = Decoder("FGET P")
    decoder.feed(noise + gcl("FGET P", "1 2 3 4"))
    answer = decoder.next()
    assert answer is not None
    assert (answer.lines, answer.status, decoder.skipped) == (("1 2 3 4",), 0, len(noise))


def test_a_stale_answer_to_a_longer_command_is_not_taken() -> None:
    """`GC` ends with `C`: its late answer is not the answer to `C` (dossier 1.1: the echo is exactly what was sent)."""
    assert decode("C", gcl("GC", "ERR 16384")) is None
    assert must("C", gcl("GC") + gcl("C", "ERR 8192")).status == 8192
    assert decode("T", gcl("ST", "ERR 4")) is None


def test_the_answer_ends_at_its_prompt() -> None:
    answer = must("FGET P", gcl("FGET P", "1 2 3 4") + b"FGET P\n\r5 6 7 8\n\r=> ")
    assert answer.lines == ("1 2 3 4",)
    assert answer.raw == gcl("FGET P", "1 2 3 4")


# -- values -----------------------------------------------------------------------------------------------------------


def table(names: int, motors: int, *lines: str) -> list[list[int]]:
    return values(must("FGET P", gcl("FGET P", *lines)), names, motors)


def test_values() -> None:
    assert table(1, 4, "1 2 3 4") == [[1, 2, 3, 4]]
    assert table(2, 1, "-5", "4000000000") == [[-5], [4000000000]]
    assert table(1, 2, "  1   2 ") == [[1, 2]]
    assert table(2, 1, "7", "ERR 64") == [[7]]


@each_row(
    ("names", "motors", "lines"),
    [
        (1, 4, ("1 2 3",)), (1, 4, ("1 2 3 4 5",)), (1, 4, ()), (2, 1, ("1",)), (1, 1, ("1", "2")), (1, 4, ("1 2 x 4",)),
        (1, 4, ("1 2 3 4", "noise")), (1, 1, ("1.5",)), (1, 1, ("0x10",)), (1, 1, ("P 7",)), (1, 1, ("1_0",)),
        (1, 1, ("9" * 5000,)),
    ],
)  # fmt: skip
def test_values_of_another_shape_are_refused(names: int, motors: int, lines: tuple[str, ...]) -> None:
    with pytest.raises(ProtocolError) as caught:
        table(names, motors, *lines)
    assert (caught.value.code, caught.value.exit_code) == ("bad-line", 5)


# -- batches ----------------------------------------------------------------------------------------------------------


def test_batches_of_names() -> None:
    assert batches("FGET", []) == []
    assert batches("12FGET", [("P",), ("SG",)]) == [("12FGET P SG", [("P",), ("SG",)])]
    lines = batches("FGET", [("LCV",)] * 19)
    assert [len(items) for _, items in lines] == [16, 3]
    assert len(lines[0][0]) == 4 + 16 * 4


def test_eighteen_arguments_at_most() -> None:
    assert [len(items) for _, items in batches("FGET", [("P",)] * 37)] == [18, 18, 1]
    assert [len(items) for _, items in batches("FSET", [("P", "1")] * 10)] == [9, 1]


def test_seventy_characters_at_most() -> None:
    exact = "A" * 31
    assert [text for text, _ in batches("PSET", [(exact, "0"), (exact, "0")])] == [f"PSET {exact} 0"] * 2
    shorter = "A" * 30
    (line,) = batches("PSET", [(shorter, "0"), (shorter, "1")])
    assert len(line[0]) <= 70
    (line,) = batches("FGET", [("B" * 32,), ("C" * 32,)])
    assert len(line[0]) == 70
    assert len(batches("FGET", [("B" * 32,), ("C" * 33,)])) == 2


@given(st.lists(st.tuples(st.text("ABCDEFG", min_size=1, max_size=6), st.integers(0, 65535).map(str)), max_size=80))
def test_batches_lose_nothing(pairs: list[tuple[str, str]]) -> None:
    lines = batches("124FSET", list(pairs))
    assert [pair for _, items in lines for pair in items] == pairs
    for text, items in lines:
        assert text == " ".join(["124FSET", *(word for pair in items for word in pair)])
        assert len(text) <= 70
        assert len(text.split()) - 1 <= 18


# -- any bytes --------------------------------------------------------------------------------------------------------

PIECES = [
    b"FGET P", b"C", b"ERR ", b"ERR 3", b"\n\r", b"\r\n", b"=> ", b"=>", b" ", b"0 1 2 3", b"-1", b"1_0", b"\xff", b"\x03",
    b"9" * 5000, b"16384", b"fget p", b"\x00",
]  # fmt: skip


def harmless(command: str, chunks: list[bytes]) -> None:
    """Whatever comes, there is an Answer, nothing, or a ProtocolError."""
    decoder = Decoder(command)
    for chunk in chunks:
        decoder.feed(chunk)
        try:
            answer = decoder.next()
            if answer is not None:
                assert isinstance(answer, Answer)
                assert answer.status >= 0
                assert b"=>" in answer.raw
                values(answer, 1, 4)
        except ProtocolError:
            pass
    assert decoder.received == b"".join(chunks)


@settings(deadline=None)
@given(
    st.sampled_from(["FGET P", "C", "ERR 3"]), st.lists(st.sampled_from(PIECES) | st.binary(max_size=20), max_size=20)
)
@example("FGET P", [b"FGET P\n\rERR " + b"9" * 5000 + b"\n\r=> "])
@example("C", [b"C\n\rERR \xb2\n\r=> "])
def test_any_bytes(command: str, chunks: list[bytes]) -> None:
    harmless(command, chunks)
