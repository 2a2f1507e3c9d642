"""The JSON codec of the AIDIN-hand: bytes out, objects in whatever the pieces, and never anything but ProtocolError."""

from __future__ import annotations

import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handctl.devices.aidin.json_codec import (
    LARGEST_IN,
    LARGEST_OUT,
    LONGEST_END,
    NEUTRAL,
    Decoder,
    MalformedObject,
    encode,
    numbers,
)
from handctl.errors import ProtocolError, UsageError
from tests.support.each_row import each_row

# -- out --------------------------------------------------------------------------------------------------------------

VECTORS = [
    ({"hand_mode": 1}, b'{"hand_mode":1}'),
    ({"hand_mode": 5, "maxtorque": 800}, b'{"hand_mode":5,"maxtorque":800}'),
    ({"hand_mode": 10, "hand_TP_cmd": (140000, 0, -5)}, b'{"hand_mode":10,"hand_TP_cmd":[140000,0,-5]}'),
    ({"a": (0.174533, 80.0, -0.0, 1e-6, -1e-7, 2.5e-05)}, b'{"a":[0.174533,80.0,0.0,0.000001,0.0,0.000025]}'),
    ({"a": 3.0}, b'{"a":3.0}'),
]


@each_row(("fields", "data"), VECTORS)
def test_encode(fields: dict[str, object], data: bytes) -> None:
    assert encode(fields) == data  # type: ignore[arg-type]


def test_the_neutral_object_has_no_key() -> None:
    assert NEUTRAL == b"{}"


@each_row("number", [float("nan"), float("inf"), float("-inf")])
def test_what_json_does_not_have_is_refused(number: float) -> None:
    with pytest.raises(UsageError):
        encode({"a": (1.0, number)})


def test_longest_object() -> None:
    key = "k" * (LARGEST_OUT - len(b'{"":1}') - LONGEST_END)
    assert len(encode({key: 1})) + LONGEST_END == 2047
    with pytest.raises(UsageError):
        encode({key + "k": 1})


# -- in ---------------------------------------------------------------------------------------------------------------


def drained(decoder: Decoder) -> list[object]:
    """Objects as dicts, what was dropped as bytes."""
    found: list[object] = []
    while True:
        try:
            content = decoder.next()
        except MalformedObject as exc:
            found.append(exc.data)
            continue
        if content is None:
            return found
        found.append(content)


def fed(*pieces: bytes) -> list[object]:
    decoder = Decoder()
    found: list[object] = []
    for piece in pieces:
        decoder.feed(piece)
        found += drained(decoder)
    return found


def objects(*pieces: bytes) -> list[object]:
    return [found for found in fed(*pieces) if isinstance(found, dict)]


A, B = {"motor_pos": [1, -2, 30]}, {"joint_pos": [0.5, -1.25], "s": '} " { \\ ä'}
RAW_A, RAW_B = b'{"motor_pos":[1,-2,30]}', json.dumps(B).encode()
STREAMS = {
    "newlines": RAW_A + b"\n" + RAW_B + b"\n",
    "glued": RAW_A + RAW_B,
    "nul": RAW_A + b"\0" + RAW_B + b"\0",
    "blanks": b" \t\r\n" + RAW_A + b"\r\n\r\n" + RAW_B,
    "indented": json.dumps(A, indent=2).encode() + b"\n" + json.dumps(B, indent=1).encode(),
    "unescaped utf-8": RAW_A + json.dumps(B, ensure_ascii=False).encode(),
}


@each_row("data", STREAMS.values(), ids=STREAMS)
@each_row("size", [1, 2, 3, 7, 1000])
def test_any_pieces(data: bytes, size: int) -> None:
    assert fed(*(data[at : at + size] for at in range(0, len(data), size))) == [A, B]


@each_row("data", STREAMS.values(), ids=STREAMS)
def test_cut_anywhere(data: bytes) -> None:
    for place in range(1, len(data)):
        assert fed(data[:place], data[place:]) == [A, B]


def test_a_cut_number_is_never_taken_early() -> None:
    decoder = Decoder()
    decoder.feed(b'{"current_state":[1,2,3,4,5,6,7,8,9,1')
    assert decoder.next() is None
    decoder.feed(b"0,11]}")
    assert decoder.next() == {"current_state": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]}
    assert decoder.next() is None


@each_row("junk", [b"xyz", b"\xff\xfe", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"}]", b"12,13]}", b'"'])
def test_junk_between_objects_is_dropped_and_told(junk: bytes) -> None:
    for size in (1, 1000):
        data = RAW_A + junk + RAW_B + junk
        found = fed(*(data[at : at + size] for at in range(0, len(data), size)))
        assert [item for item in found if isinstance(item, dict)] == [A, B]
        dropped = b"".join(item for item in found if isinstance(item, bytes))
        assert dropped.translate(None, b" \r\n\t\0") == (junk + junk).translate(None, b" \r\n\t\0")


@each_row("cut", range(1, len(RAW_A)))
@each_row("end", [b"\n", b""])
def test_a_truncated_object_costs_no_whole_one(cut: int, end: bytes) -> None:
    """With the next object at once, or, cut where a brace may stand, when the one after it comes."""
    data = RAW_A[:cut] + end + RAW_A + end + RAW_B + end + RAW_B + end
    assert objects(data)[-3:] == [A, B, B]
    assert objects(*(bytes([byte]) for byte in data))[-3:] == [A, B, B]


@each_row(
    "bad", [b'{"a":[1,2}', b'{"a":{1,2,3}}', b'{"a":tru}', b'{"a":"\xff"}', b"{a:1}", b'{"a":1,}', b'{"a":"x\ny"}']
)
def test_what_is_no_json_is_dropped_alone(bad: bytes) -> None:
    found = fed(bad + RAW_A)
    assert found[-1] == A
    assert any(isinstance(item, bytes) for item in found)


def test_nested_values_of_unknown_keys_pass() -> None:
    data = b'{"status":{"text":"a } \\" {","list":[1,{}]},"motor_pos":[1]}'
    assert fed(data + RAW_A) == [json.loads(data), A]


def test_an_endless_object_is_given_up() -> None:
    decoder = Decoder()
    found: list[object] = []
    for _ in range(70):
        decoder.feed(b'{"a":[' + b"1," * 509 if not found and not decoder.pending else b"1," * 512)
        found += drained(decoder)
        assert len(decoder.pending) <= LARGEST_IN
    decoder.feed(RAW_A)
    assert [item for item in drained(decoder) if isinstance(item, dict)] == [A]


def test_endless_strings_numbers_and_depths() -> None:
    assert objects(b'{"' + b"a" * 5000 + RAW_A + b"\n") == [A]
    assert objects(b'{"a":' + b"9" * 5000 + b"}" + RAW_A) == [A]
    assert objects(b'{"a":' + b"[" * 60000 + b"}" + RAW_A) == [A]
    assert objects(b'{"a":' * 5000 + RAW_A + b"\n" + RAW_A) == [A, A]
    assert objects(b"{" * 70000 + RAW_A) == [A]


FRAGMENTS = st.sampled_from([
    b"{", b"}", b"[", b"]", b'"', b"\\", b":", b",", b"{}", b"1", b"-1.5e3", b"NaN", b"null", b"\n", b"\0", b"\xff", b" ",
    RAW_A, RAW_B, RAW_A[:9], RAW_B[:20], b'"motor_pos":[', b"{" * 40, b"1" * 300,
])  # fmt: skip


@given(st.lists(st.one_of(FRAGMENTS, st.binary(max_size=40)), max_size=30))
def test_fuzz_only_protocol_errors_and_a_bounded_buffer(pieces: list[bytes]) -> None:
    decoder = Decoder()
    for piece in pieces:
        decoder.feed(piece)
        for item in drained(decoder):
            assert isinstance(item, dict | bytes)
        assert len(decoder.pending) <= sum(map(len, pieces))
    # nothing that came before keeps two good objects away for ever
    decoder.feed(b"\n" + (RAW_A + b"\n") * 3)
    assert drained(decoder)[-1] == A


@given(st.lists(st.one_of(FRAGMENTS, st.binary(max_size=40)), max_size=20), st.integers(1, 9))
def test_fuzz_pieces_do_not_matter(pieces: list[bytes], size: int) -> None:
    data = b"".join(pieces)
    assert objects(data) == objects(*(data[at : at + size] for at in range(0, len(data), size)))


# -- arrays -----------------------------------------------------------------------------------------------------------


def test_numbers() -> None:
    assert numbers([1, 2.5, -3], 3) == (1.0, 2.5, -3.0)
    taken = numbers([1, 12.0, -3], 3, int_range=(-10, 20))
    assert taken == (1, 12, -3)
    assert all(isinstance(number, int) for number in taken)


@each_row(
    ("value", "int_range", "code"),
    [
        (None, None, "bad-type"), ("1,2,3", None, "bad-type"), ({"a": 1}, None, "bad-type"), (7, None, "bad-type"),
        ([1, 2], None, "bad-length"), ([1, 2, 3, 4], None, "bad-length"), ([], None, "bad-length"),
        ([1, "2", 3], None, "bad-type"), ([1, None, 3], None, "bad-type"), ([1, True, 3], None, "bad-type"),
        ([1, [2], 3], None, "bad-type"),
        ([1, float("nan"), 3], None, "not-finite"), ([1, float("inf"), 3], None, "not-finite"),
        ([1, 10**400, 3], None, "not-finite"), ([1, float("nan"), 3], (-5, 5), "not-finite"),
        ([1, 2.5, 3], (-5, 5), "bad-type"), ([1, 6, 3], (-5, 5), "bad-type"), ([1, -6, 3], (-5, 5), "bad-type"),
        ([1, 10**5000, 3], (-5, 5), "not-finite"),
    ],
)  # fmt: skip
def test_numbers_refused(value: object, int_range: tuple[int, int] | None, code: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        numbers(value, 3, int_range=int_range)
    assert caught.value.code == code


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text('aé\0"\\1'), lambda x: st.lists(x, max_size=4)
    )
    | st.lists(st.floats() | st.integers(), min_size=3, max_size=3)
)
@example([1, -2.5, 10**30])
def test_numbers_never_raises_anything_else(value: object) -> None:
    try:
        taken = numbers(value, 3)
    except ProtocolError:
        return
    assert len(taken) == 3
    assert all(abs(number) < float("inf") for number in taken)
