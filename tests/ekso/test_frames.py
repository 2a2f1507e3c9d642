"""DataPort frames: the dossier's bytes, every length convention, the decoder fed whole, byte by byte and with garbage."""

from __future__ import annotations

import pytest
from crcmod.predefined import mkPredefinedCrcFun
from hypothesis import given, settings
from hypothesis import strategies as st

from handctl.devices.ekso.frames import (
    LENGTH_MODES,
    Command,
    Decoder,
    Frame,
    cancel_body,
    crc,
    encode,
    name_of,
    set_value_body,
    status_text,
    unpack,
)
from handctl.errors import ProtocolError, UsageError
from tests.ekso.support import DATA, SET, TIME, frame, in_pieces
from tests.support.each_row import each_row
from tests.support.scripted import unhex

GET_DATA = unhex(
    "99 36 00 CB 01 C2 FF B5 00 5F 02 62 00 78 01 E0 FF CF 0E 10 00 62 0E 26 FF 47 08 A2 FF D8 03 48 00 D2 FD 85 FF C9 "
    "01 40 20 40 04 04 00 00 00 00 00 7D 00 01 00 0C 00 4C 4B 41 6F 01"
)
TIME_BODY, DATE_BODY = unhex("0E 05 25"), unhex("1A 0B 14")
SETTINGS_BODY = unhex(
    "06 A4 06 40 06 0E 00 C8 00 5A 00 32 01 F4 01 2C FF B5 00 7D 00 02 00 01 00 03 00 00 00 0A 00 0C 00 02 00 03 00 04 "
    "00 07 00 01 00 02"
)
FEEDBACK_BODY = unhex(
    "01 38 04 D8 02 8F 01 A9 01 2C 01 C2 01 3B 02 58 02 BC 02 6C 02 C6 00 98 00 9C 00 09 00 09 00 4C 4B 41"
)
PAD = b"\x00"
MODES = ("body", "n-4", "n-2", "frame")

# (command, msgID, body, {mode: length byte and CRC}): requests, then answers
REQUESTS = [
    (150, 0xC8, b"", "00/3D82 02/53E2 04/E142 06/8F22"),
    (151, 0xC9, b"", "00/5B17 02/3577 04/87D7 06/E9B7"),
    (152, 0xCA, b"", "00/BF9A 02/D1FA 04/635A 06/0D3A"),
    (153, 0xCB, b"", "00/D90F 02/B76F 04/05CF 06/6BAF"),
    (154, 0xCC, b"", "00/3234 02/5C54 04/EEF4 06/8094"),
    (155, 0xCD, unhex("00 CA 06 0E"), "04/5EFE 06/3E1D 08/0C95 0A/6C76"),
    (155, 0xCE, unhex("00 D0 FF B5"), "04/8B67 06/EB84 08/D90C 0A/B9EF"),
    (156, 0xCF, unhex("01 00"), "02/B623 04/7BA6 06/3F25 08/F08D"),
    (156, 0xD0, unhex("00 01"), "02/FA61 04/37E4 06/7367 08/BCCF"),
]
ANSWERS = [
    (150, 0xC8, TIME_BODY, "03/A4DD 05/293C 07/A27C 09/22DF"),
    (150, 0xC8, TIME_BODY + PAD, "04/312A 06/51C9 08/6341 0A/03A2"),
    (151, 0xC9, DATE_BODY, "03/F0D6 05/7D37 07/F677 09/76D4"),
    (151, 0xC9, DATE_BODY + PAD, "04/205B 06/40B8 08/7230 0A/12D3"),
    (152, 0xCA, SETTINGS_BODY, "2C/72E5 2E/F900 30/6574 32/EE91"),
    (153, 0xCB, GET_DATA[4:-2], "36/6F01 38/A090 3A/8F7B 3C/FF46"),
    (154, 0xCC, FEEDBACK_BODY, "22/F4EC 24/ED14 26/15A3 28/DEE4"),
    (155, 0xCD, unhex("00 00"), "02/2333 04/EEB6 06/AA35 08/659D"),
    (155, 0xCD, unhex("20 01"), "02/35F4 04/F871 06/BCF2 08/735A"),
    (155, 0xCD, unhex("00 02"), "02/0371 04/CEF4 06/8A77 08/45DF"),
    (155, 0xCD, unhex("00 03"), "02/1350 04/DED5 06/9A56 08/55FE"),
    (155, 0xCE, unhex("00 00"), "02/7A63 04/B7E6 06/F365 08/3CCD"),
    (156, 0xCF, unhex("00 00"), "02/8512 04/4897 06/0C14 08/C3BC"),
    (156, 0xCF, unhex("00 03"), "02/B571 04/78F4 06/3C77 08/F3DF"),
    (156, 0xD0, unhex("00 00"), "02/EA40 04/27C5 06/6346 08/ACEE"),
]


def spelled(rows: list[tuple[int, int, bytes, str]]) -> list[tuple[int, int, bytes, str, bytes]]:
    """Each row in all four conventions: (command, msgID, body, mode, the frame)."""
    found = []
    for command, msg_id, body, texts in rows:
        for mode, text in zip(MODES, texts.split(), strict=True):
            length, check = text.split("/")
            found.append((command, msg_id, body, mode, bytes([command]) + unhex(length) + msg_id.to_bytes(2, "big") + body + unhex(check)))  # fmt: skip
    return found


def expecting(data: bytes) -> Decoder:
    """A decoder that waits for the answer `data`."""
    decoder = Decoder()
    decoder.expect(frame(data[0], int.from_bytes(data[2:4], "big"), bytes(4 if data[0] == SET else 0)))
    return decoder


def all_of(decoder: Decoder) -> list[Frame | str]:
    """Frames and codes of errors until nothing more comes."""
    found: list[Frame | str] = []
    while True:
        try:
            frame = decoder.next()
        except ProtocolError as exc:
            found.append(exc.code)
            continue
        if frame is None:
            return found
        found.append(frame)


# -- CRC and requests -------------------------------------------------------------------------------------------------


def test_the_check_value_of_the_manual() -> None:
    assert crc(b"123456789") == 0x29B1


@given(st.binary(max_size=300))
def test_crc_is_that_of_crcmod(data: bytes) -> None:
    assert crc(data) == mkPredefinedCrcFun("crc-ccitt-false")(data)
    assert crc(data + crc(data).to_bytes(2, "big")) == 0


@each_row(("command", "msg_id", "body", "mode", "data"), spelled(REQUESTS))
def test_requests_byte_for_byte(command: int, msg_id: int, body: bytes, mode: str, data: bytes) -> None:
    assert encode(Command(command), msg_id, body, mode) == data


def test_what_cannot_be_sent() -> None:
    for command, msg_id, body, mode in [
        (157, 1, b"\x00\x01", "body"), (158, 1, b"", "body"), (160, 1, b"\x00\x00", "body"), (149, 1, b"", "body"),
        (150, 1, b"\x00", "body"), (155, 1, b"\x00\xca", "body"), (150, 65536, b"", "body"), (150, -1, b"", "body"),
        (150, 1, b"", "n-3"),
    ]:  # fmt: skip
        with pytest.raises(UsageError):
            encode(command, msg_id, body, mode)  # type: ignore[arg-type]
    assert 157 not in set(Command)


def test_bodies() -> None:
    assert set_value_body(208, -75) == unhex("00 D0 FF B5")
    assert set_value_body(202, 65535) == unhex("00 CA FF FF")
    assert set_value_body(209, -32768) == unhex("00 D1 80 00")
    assert cancel_body() == unhex("01 00")
    assert cancel_body(1) == unhex("00 01")
    for parameter, raw in [(199, 0), (220, 0), (202, 65536), (208, -32769)]:
        with pytest.raises(UsageError):
            set_value_body(parameter, raw)
    for word in (0, 65536, -1):
        with pytest.raises(UsageError):
            cancel_body(word)


def test_words_and_status() -> None:
    assert unpack(unhex("FF FF 80 00 7F FF 00 01")) == (-1, -32768, 32767, 1)
    assert status_text(0x2000) == "accepted"
    assert status_text(0x2001) == "refused in the present state, state 0x20"
    assert status_text(2) == "value out of range"
    assert status_text(3) == "value or command not allowed"
    assert status_text(0x0109) == "unknown (9)"
    assert [name_of(code) for code in (150, 155, 160)] == ["GetTime", "SetValue", "command 160"]


# -- the decoder ------------------------------------------------------------------------------------------------------


@each_row("how", ["whole", "bytes", "threes"])
@each_row(("command", "msg_id", "body", "mode", "data"), spelled(ANSWERS))
def test_answers_in_every_convention(command: int, msg_id: int, body: bytes, mode: str, data: bytes, how: str) -> None:
    decoder = expecting(data)
    found: list[Frame | str] = []
    for piece in in_pieces(data, how):
        decoder.feed(piece)
        found += all_of(decoder)
    assert found == [Frame(command, msg_id, body, mode, data)]
    assert (decoder.pending, decoder.skipped, decoder.mode) == (0, 0, mode)


@each_row("how", ["whole", "bytes", "threes"])
@each_row("before", ["00 FF 12", "99", "99 36 00", "99 36 00 CA 01", "A0 02 00"])
@each_row("after", ["", "00", "99 36", "00 00 00 00"])
def test_garbage_around(before: str, after: str, how: str) -> None:
    decoder = expecting(GET_DATA)
    found: list[Frame | str] = []
    for piece in in_pieces(unhex(before) + GET_DATA + unhex(after), how):
        decoder.feed(piece)
        found += all_of(decoder)
    assert [entry for entry in found if isinstance(entry, Frame)] == [
        Frame(153, 0xCB, GET_DATA[4:-2], "body", GET_DATA)
    ]
    assert decoder.skipped + decoder.pending == len(unhex(before)) + len(unhex(after))


def test_the_convention_met_is_tried_first() -> None:
    """A 2-byte status under L = 2 is `body`; once `frame` was met, L = 8 is read so at once."""
    decoder = Decoder()
    for mode, length in (("frame", 8), ("n-4", 4), ("body", 2)):
        data = frame(SET, 7, unhex("00 03"), more=LENGTH_MODES[mode])
        assert data[1] == length
        decoder.expect(frame(SET, 7, bytes(4)))
        decoder.feed(data)
        (found,) = all_of(decoder)
        assert isinstance(found, Frame)
        assert (found.mode, found.body) == (mode, unhex("00 03"))


def test_our_own_request_comes_back() -> None:
    """Also where it is longer than an answer or looks like one."""
    for request in (frame(TIME, 5), frame(SET, 5, unhex("00 CA 06 0E")), frame(156, 5, unhex("01 00"))):
        for how in ("whole", "bytes"):
            decoder = Decoder()
            decoder.expect(request)
            found: list[Frame | str] = []
            for piece in in_pieces(request, how):
                decoder.feed(piece)
                found += all_of(decoder)
            assert [entry.data for entry in found if isinstance(entry, Frame)] == [request]


@each_row("place", range(4, 60))
def test_a_damaged_answer_is_refused_and_the_next_one_taken(place: int) -> None:
    broken = bytearray(GET_DATA)
    broken[place] ^= 0x10
    decoder = expecting(GET_DATA)
    decoder.feed(bytes(broken) + GET_DATA)
    found = all_of(decoder)
    assert found[0] == "bad-checksum"
    assert found[-1] == Frame(153, 0xCB, GET_DATA[4:-2], "body", GET_DATA)


def test_a_decoder_that_expects_nothing_gives_every_frame() -> None:
    decoder = Decoder()
    decoder.feed(b"\x99" + frame(TIME, 7, bytes(4)) + GET_DATA + b"\x96\x04\x00")
    assert [entry.command for entry in all_of(decoder) if isinstance(entry, Frame)] == [TIME, DATA]
    assert (decoder.skipped, decoder.pending) == (1, 3)


def test_a_body_of_another_size_is_refused() -> None:
    decoder = expecting(GET_DATA)
    decoder.feed(frame(DATA, 0xCB, GET_DATA[4:-4]))
    assert all_of(decoder)[0] == "bad-length"


def test_frames_of_others_are_given_whole() -> None:
    decoder = expecting(GET_DATA)
    others = [
        frame(160, 0, b"\x00\x01"),
        frame(158, 9, bytes(6)),
        frame(TIME, 0xCB, bytes(4)),
        frame(DATA, 0xCA, bytes(54)),
    ]
    decoder.feed(b"".join(others) + GET_DATA)
    found = all_of(decoder)
    assert [entry.data for entry in found if isinstance(entry, Frame)] == [*others, GET_DATA]
    assert decoder.skipped == 0


def test_a_false_beginning_hides_nothing_at_the_end() -> None:
    decoder = expecting(GET_DATA)
    decoder.feed(unhex("99 36 00 CB 55") + frame(TIME, 3, bytes(4)))
    assert all_of(decoder) == [], "it may still be the answer"
    assert [entry.command for entry in decoder.finish()] == [TIME]
    assert (decoder.pending, decoder.skipped) == (0, 5)


@settings(deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=40), st.just(GET_DATA), st.just(GET_DATA[:30])), max_size=6), st.data())
def test_anything_may_come(parts: list[bytes], data: st.DataObject) -> None:
    """Frames or ProtocolError, nothing else; every byte is counted once; what is returned was on the line."""
    stream = b"".join(parts)
    decoder = expecting(GET_DATA)
    found: list[Frame | str] = []
    at = 0
    while at < len(stream):
        size = data.draw(st.integers(1, 60))
        decoder.feed(stream[at : at + size])
        found += all_of(decoder)
        at += size
    found += decoder.finish()
    frames = [entry for entry in found if isinstance(entry, Frame)]
    assert all(entry.data in stream and crc(entry.data) == 0 for entry in frames)
    assert decoder.skipped + sum(len(entry.data) for entry in frames) == len(stream)
    assert decoder.pending == 0


@settings(deadline=None)
@given(st.binary(max_size=50), st.integers(0, 65535), st.sampled_from(MODES))
def test_an_answer_behind_junk_is_found(junk: bytes, msg_id: int, mode: str) -> None:
    answer = frame(DATA, msg_id, GET_DATA[4:-2], more=LENGTH_MODES[mode])
    decoder = expecting(answer)
    decoder.feed(junk)
    found = all_of(decoder)
    decoder.feed(answer)
    found += all_of(decoder) + list(decoder.finish())
    assert answer in [entry.data for entry in found if isinstance(entry, Frame)]
