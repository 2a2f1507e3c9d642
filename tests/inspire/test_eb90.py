"""EB 90 frames: literal bytes in and out, limits, the decoder fed in every way (exo §2.2)."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handctl.devices.inspire import eb90
from handctl.devices.inspire.eb90 import Decoder, Frame
from handctl.errors import ProtocolError, UsageError
from tests.support.each_row import each_row
from tests.support.scripted import hexed, unhex

VOLTAGE = "90 EB 01 05 11 C0 05 2E 02 0C"
VOLTAGE_PREFIX = "90 EB 01 05 11 C0 05"
POSITIONS = "90 EB 01 0F 11 0A 06 6E 00 DC 00 4A 01 B8 01 26 02 94 02 3D"


def hand_made(header: str, device_id: int, flag: int, payload: bytes) -> bytes:
    """A frame built without the code under test."""
    body = [device_id, len(payload) + 1, flag, *payload]
    total = 0
    for byte in body:
        total = (total + byte) % 256
    return unhex(header) + bytes(body) + bytes([total])


def run(decoder: Decoder, data: bytes) -> list[Frame | str]:
    """Feed `data`, take everything out; a ProtocolError appears as its code."""
    decoder.feed(data)
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


# -- encoding ---------------------------------------------------------------------------------------------------------


@each_row(
    ("made", "expected"),
    [
        pytest.param(eb90.read_request(1, 1000, 1), "EB 90 01 04 11 E8 03 01 02", id="read id 2.2.3"),
        pytest.param(eb90.read_request(1, 1472, 2), "EB 90 01 04 11 C0 05 02 DD", id="probe 2.2.3"),
        pytest.param(eb90.read_request(1, 1472, 151), "EB 90 01 04 11 C0 05 97 72", id="dump 2.2.3"),
        pytest.param(eb90.read_request(1, 1472, 252), "EB 90 01 04 11 C0 05 FC D7", id="largest read 2.2.3"),
        pytest.param(eb90.read_request(180, 1472, 2), "EB 90 B4 04 11 C0 05 02 90", id="sum is a header byte"),
        pytest.param(eb90.read_request(254, 65535, 1), "EB 90 FE 04 11 FF FF 01 12", id="last address"),
        pytest.param(eb90.read_request(1, 0, 1), "EB 90 01 04 11 00 00 01 17", id="first address"),
        pytest.param(eb90.read_request(1, 1020, 24, 0x30), "EB 90 01 04 30 FC 03 18 4C", id="other flag"),
        pytest.param(eb90.write_request(1, 1000, b"\x02"), "EB 90 01 04 12 E8 03 02 04", id="write id 2.2.4"),
        pytest.param(eb90.write_request(1, 1492, unhex("2C 01")), "EB 90 01 05 12 D4 05 2C 01 1E", id="write 2.2.4"),
        pytest.param(
            eb90.write_request(1, 1486, eb90.pack_s16([500, 500, -1, 0, 500])),
            "EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0",
            id="example of 2.3.7",
        ),
        pytest.param(
            eb90.command_request(1, 0x31, [100, -100, 0, 1000, -1000]),
            "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B",
            id="force 2.2.1",
        ),
        pytest.param(
            eb90.command_request(1, 0x32, [500, 400, 300, 200, 100]),
            "EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D",
            id="position 2.2.2",
        ),
    ],
)
def test_requests_are_these_bytes(made: bytes, expected: str) -> None:
    assert hexed(made) == expected


def test_longest_write_has_length_byte_ff() -> None:
    frame = eb90.write_request(1, 1000, bytes(252))
    assert len(frame) == 260
    assert hexed(frame[:7]) == "EB 90 01 FF 12 E8 03"
    assert frame[-1] == (0x01 + 0xFF + 0x12 + 0xE8 + 0x03) % 256


@each_row(
    ("call", "says"),
    [
        pytest.param(lambda: eb90.read_request(1, 1000, 253), "253 bytes do not fit", id="count 253"),
        pytest.param(lambda: eb90.read_request(1, 1000, 0), "0 bytes do not fit", id="count 0"),
        pytest.param(lambda: eb90.read_request(1, 1000, -1), "-1 bytes do not fit", id="count -1"),
        pytest.param(lambda: eb90.write_request(1, 1000, bytes(253)), "253 bytes do not fit", id="write 253"),
        pytest.param(lambda: eb90.write_request(1, 1000, b""), "0 bytes do not fit", id="write nothing"),
        pytest.param(lambda: eb90.read_request(0, 1000, 1), "id 0", id="id 0"),
        pytest.param(lambda: eb90.read_request(255, 1000, 1), "id 255", id="id 255"),
        pytest.param(lambda: eb90.read_request(-1, 1000, 1), "id -1", id="id -1"),
        pytest.param(lambda: eb90.write_request(0, 1000, b"\x01"), "id 0", id="write to id 0"),
        pytest.param(lambda: eb90.command_request(255, 0x31, [0] * 5), "id 255", id="command to id 255"),
        pytest.param(lambda: eb90.read_request(1, 65536, 1), "address 65536", id="address 65536"),
        pytest.param(lambda: eb90.read_request(1, -1, 1), "address -1", id="address -1"),
        pytest.param(lambda: eb90.read_request(1, 65535, 2), "past address 65535", id="read past the end"),
        pytest.param(lambda: eb90.write_request(1, 65400, bytes(137)), "past address 65535", id="write past the end"),
    ],
)
def test_impossible_requests_are_usage_errors(call: object, says: str) -> None:
    with pytest.raises(UsageError) as caught:
        call()  # type: ignore[operator]
    assert says in caught.value.text
    assert caught.value.exit_code == 2


def test_limits_themselves_are_allowed() -> None:
    assert len(eb90.read_request(1, 65284, 252)) == 9
    assert len(eb90.write_request(254, 65284, bytes(252))) == 260
    assert hexed(eb90.read_request(1, 1000, 1))[6:8] == "01"


def test_signed_values_are_little_endian() -> None:
    assert hexed(eb90.pack_s16([-1, -1000, 1000, -32768, 32767, 0])) == "FF FF 18 FC E8 03 00 80 FF 7F 00 00"
    assert eb90.unpack_s16(unhex("FF FF 18 FC E8 03 00 80 FF 7F 00 00")) == [-1, -1000, 1000, -32768, 32767, 0]
    assert eb90.unpack_s16(unhex("01 00 02")) == [1]


def test_prefixes_of_answers() -> None:
    assert hexed(eb90.read_reply_prefix(1, 1472, 2)) == VOLTAGE_PREFIX
    assert hexed(eb90.read_reply_prefix(254, 1472, 252)) == "90 EB FE FF 11 C0 05"
    assert hexed(eb90.write_ack_prefix(2, 1000)) == "90 EB 02 04 12 E8 03"
    assert hexed(eb90.command_reply_prefix(1, 0x31)) == "90 EB 01 0D 31"
    assert hexed(eb90.command_reply_prefix(1, 0x32)) == "90 EB 01 0B 32"


# -- decoding ---------------------------------------------------------------------------------------------------------


def decoder_for(prefix: str = VOLTAGE_PREFIX) -> Decoder:
    return Decoder([unhex(prefix)])


def test_frame_has_its_fields() -> None:
    (frame,) = run(decoder_for(), unhex(VOLTAGE))
    assert frame == Frame(unhex("90 EB"), 1, 0x11, unhex("C0 05 2E 02"))
    assert isinstance(frame, Frame)
    assert (frame.from_device, frame.address, hexed(frame.data)) == (True, 1472, "2E 02")
    assert hexed(frame.encode()) == VOLTAGE


def test_command_frames_have_no_address() -> None:
    force = Frame(unhex("90 EB"), 1, 0x31, bytes(12))
    assert force.address is None
    assert Frame(unhex("EB 90"), 1, 0x11, b"\x01").address is None
    assert not Frame(unhex("EB 90"), 1, 0x11, b"\x01").from_device


@pytest.mark.parametrize("offset", range(12))
def test_prefix_is_found_at_every_offset(offset: int) -> None:
    decoder = decoder_for()
    junk = unhex("90 EB 01 05 90 90 EB 01 04 11 C0 05")[:offset]
    (frame,) = run(decoder, junk + unhex(VOLTAGE))
    assert isinstance(frame, Frame)
    assert hexed(frame.data) == "2E 02"
    assert (decoder.skipped, decoder.pending) == (offset, 0)


@pytest.mark.parametrize("cut", range(1, 10))
def test_frame_in_two_pieces(cut: int) -> None:
    decoder = decoder_for()
    data = unhex(VOLTAGE)
    assert run(decoder, data[:cut]) == []
    assert decoder.pending == cut
    (frame,) = run(decoder, data[cut:])
    assert isinstance(frame, Frame)
    assert (hexed(frame.data), decoder.skipped) == ("2E 02", 0)


def test_bad_sum_costs_one_byte_only() -> None:
    decoder = decoder_for()
    # A spoiled frame whose last bytes are the beginning of the good one.
    found = run(decoder, unhex("90 EB 01 05 11 C0 05") + unhex(VOLTAGE))
    assert found[0] == "bad-checksum"
    assert isinstance(found[1], Frame)
    assert hexed(found[1].data) == "2E 02"
    assert decoder.skipped == 7


def test_bad_sum_is_told_with_both_values() -> None:
    decoder = decoder_for()
    decoder.feed(unhex("90 EB 01 05 11 C0 05 2E 02 0D"))
    with pytest.raises(ProtocolError) as caught:
        decoder.next()
    assert caught.value.code == "bad-checksum"
    assert "0D" in caught.value.text
    assert "0C" in caught.value.text
    assert decoder.next() is None


def test_false_header_of_length_40_hides_nothing() -> None:
    (frame,) = run(decoder_for(), unhex("90 EB 01 40 11") + unhex(VOLTAGE))
    assert isinstance(frame, Frame)
    assert hexed(frame.data) == "2E 02"


def test_false_header_hides_a_frame_from_the_sniffer_until_the_stream_ends() -> None:
    decoder = Decoder()
    assert run(decoder, unhex("90 EB 01 40 11") + unhex(VOLTAGE)) == []
    assert decoder.pending == 15
    (frame,) = decoder.finish()
    assert hexed(frame.encode()) == VOLTAGE
    assert (decoder.pending, decoder.skipped) == (0, 5)


def test_finish_returns_every_hidden_frame_and_empties_the_buffer() -> None:
    decoder = Decoder()
    data = unhex("90 EB 01 FF 11") + unhex(VOLTAGE) + unhex("EB") + unhex(POSITIONS) + unhex("90 EB 01 05")
    assert run(decoder, data) == []
    assert [hexed(frame.encode()) for frame in decoder.finish()] == [VOLTAGE, POSITIONS]
    assert decoder.pending == 0
    assert decoder.skipped == 5 + 1 + 4


@pytest.mark.parametrize(
    ("device_id", "request_", "reply"),
    [
        pytest.param(235, "EB 90 EB 04 11 E8 03 01 EC", "90 EB EB 04 11 E8 03 EB D6", id="235: 90 EB in the echo"),
        pytest.param(144, "EB 90 90 04 11 E8 03 01 91", "90 EB 90 04 11 E8 03 90 20", id="144: EB 90 in the reply"),
        pytest.param(180, "EB 90 B4 04 11 C0 05 02 90", "90 EB B4 05 11 C0 05 2E 02 BF", id="180: sum meets header"),
    ],
)
def test_reply_behind_the_echo_of_awkward_ids(device_id: int, request_: str, reply: str) -> None:
    for chunk in (1, 2, 3, 5, 100):
        decoder = Decoder([unhex(reply)[:7]])
        data = unhex(request_) + unhex(reply)
        found: list[Frame | str] = []
        for start in range(0, len(data), chunk):
            found += run(decoder, data[start : start + chunk])
        assert found == [Frame(unhex("90 EB"), device_id, 0x11, unhex(reply)[5:-1])]
        assert decoder.skipped == 9


def test_own_echo_is_never_a_reply() -> None:
    decoder = Decoder([eb90.read_reply_prefix(1, 1000, 1)])
    assert run(decoder, unhex("EB 90 01 04 11 E8 03 01 02")) == []


def test_other_address_count_id_and_flag_are_not_candidates() -> None:
    others = [
        "90 EB 01 05 11 C2 05 2E 02 0E",
        "90 EB 01 04 11 C0 05 2E 09",
        "90 EB 02 05 11 C0 05 2E 02 0D",
        "90 EB 01 05 12 C0 05 2E 02 0D",
    ]
    decoder = decoder_for()
    assert run(decoder, unhex(" ".join(others))) == []
    assert decoder.skipped == 39


def test_sniffer_sees_both_directions() -> None:
    found = run(Decoder(), unhex("00 EB 90 01 04 11 C0 05 02 DD 90") + unhex(VOLTAGE))
    assert [frame.from_device for frame in found if isinstance(frame, Frame)] == [False, True]


@each_row("prefixes", [[], [unhex("90 EB")], [unhex("EB 90")], [unhex("90 EB"), unhex("EB 90")]])
@each_row("data", ["90 EB 05 00 05", "EB 90 05 00 05"])
def test_length_0_is_no_frame(prefixes: list[bytes], data: str) -> None:
    """The length counts the flag, so it is 1 at least (exo §2.2): every frame must be the bytes that came."""
    found = run(Decoder(prefixes), unhex(data) + unhex(VOLTAGE))
    frames = [hexed(frame.encode()) for frame in found if isinstance(frame, Frame)]
    assert frames == ([] if prefixes == [unhex("EB 90")] else [VOLTAGE])


# -- properties -------------------------------------------------------------------------------------------------------

IDS = st.integers(1, 254)
JUNK = st.lists(st.sampled_from([*unhex("90 EB 01 05 11 C0 00 FF"), 0x40]) | st.integers(0, 255), max_size=40).map(
    bytes
)


@given(st.sampled_from(["EB 90", "90 EB"]), IDS, st.integers(0, 255), st.binary(max_size=254))
def test_frames_survive_the_round_trip(header: str, device_id: int, flag: int, payload: bytes) -> None:
    frame = Frame(unhex(header), device_id, flag, payload)
    wire = frame.encode()
    assert wire == hand_made(header, device_id, flag, payload)
    assert run(Decoder(), wire) == [frame]
    assert run(Decoder([wire[:5]]), wire) == [frame]


@given(
    st.lists(JUNK | st.just(unhex(VOLTAGE)) | st.just(unhex(VOLTAGE)[:4]) | st.just(unhex(VOLTAGE)[4:]), max_size=8),
    st.sampled_from([[], [unhex("90 EB")], [unhex(VOLTAGE_PREFIX)]]),
)
@example([b"\x90", unhex(VOLTAGE)[:4], unhex(VOLTAGE)[4:], b"\xeb"], [unhex(VOLTAGE_PREFIX)])
def test_any_stream_gives_frames_none_or_protocol_errors(chunks: list[bytes], prefixes: list[bytes]) -> None:
    decoder = Decoder(prefixes)
    seen = b""
    frames = []
    for chunk in chunks:
        seen += chunk
        frames += [frame for frame in run(decoder, chunk) if isinstance(frame, Frame)]
    frames += decoder.finish()
    assert all(frame.encode() in seen for frame in frames)
    assert decoder.pending == 0
    assert decoder.skipped + sum(len(frame.encode()) for frame in frames) == len(seen)


@given(IDS, st.integers(0, 65535), st.binary(min_size=1, max_size=30), JUNK, JUNK, st.integers(1, 50))
def test_a_frame_in_junk_is_found(
    device_id: int, address: int, data: bytes, before: bytes, after: bytes, chunk: int
) -> None:
    """In junk that does not hold its prefix, also not across the seam."""
    wire = hand_made("90 EB", device_id, 0x11, address.to_bytes(2, "little") + data)
    prefix = wire[:7]
    if prefix in before + wire[:6]:
        return
    decoder = Decoder([prefix])
    stream = before + wire + after
    found: list[Frame | str] = []
    for start in range(0, len(stream), chunk):
        found += run(decoder, stream[start : start + chunk])
    assert found
    assert isinstance(found[0], Frame)
    assert found[0].encode() == wire
