"""RealTime blocks of the BarrettHand as bytes (barrett §5.3.3, §6): every value is the manual's, or computed by hand."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handctl.devices.barrett.realtime.blocks import (
    CONTROL,
    FEEDBACK,
    Decoder,
    Feedback,
    Layout,
    LoopError,
    Selection,
    check_control,
    cycles,
    selections,
    velocity_unit,
)
from handctl.devices.barrett.realtime.loop_rows import Positions
from handctl.errors import ProtocolError, UsageError
from tests.support.each_row import each_row

ALL = Selection(("velocity", "gain"), ("velocity", "strain", "position", "delta"))
LATER = Selection(("velocity",), ("position", "breakaway_position", "analog"))
FACTORY = Layout(dict.fromkeys(range(4), ALL))
EXAMPLE = Layout(  # §6.4: 124LOOP
    {
        0: Selection(("velocity",), ("strain", "delta")),
        1: Selection(("velocity",), ("strain", "delta")),
        3: Selection((), ("delta",)),
    },
    2,
)
ERROR = b"\n\rERR 2048\n\r=> "


def deltas(*values: tuple[int, int] | int, temperature: int | None) -> Feedback:
    """(strain, delta), (strain, delta), delta of §6.4's motors."""
    (s1, d1), (s2, d2), d4 = values  # type: ignore[misc]
    return Feedback({0: {"strain": s1, "delta": d1}, 1: {"strain": s2, "delta": d2}, 3: {"delta": d4}}, temperature)


def answers(layout: Layout, asked: str, *chunks: bytes) -> list[Any]:
    """What a decoder makes of bytes that come in these pieces; `asked`: F feedback, a acknowledgement."""
    decoder = Decoder(layout)
    for letter in asked:
        decoder.expect(letter == "F")
    got = []
    for chunk in chunks:
        decoder.feed(chunk)
        while (answer := decoder.next()) is not None:
            got.append(answer)
    return got


# -- layouts ----------------------------------------------------------------------------------------------------------


@each_row(
    ("layout", "control", "feedback"),
    [
        (EXAMPLE, 3, 8),
        (FACTORY, 9, 21),
        (Layout(dict.fromkeys(range(4), ALL), 2), 9, 23),
        (Layout(dict.fromkeys(range(4), ALL), 1), 9, 22),  # 4.4: one byte
        (Layout(dict.fromkeys(range(4), Selection((), ("position",)))), 1, 9),
        (Layout(dict.fromkeys(range(4), Selection(("velocity",), ("position",)))), 5, 9),
        (Layout({2: LATER}, 1), 2, 1 + 2 + 2 + 1 + 1),
        (Layout({0: Selection((), ())}), 1, 1),
    ],
)
def test_sizes(layout: Layout, control: int, feedback: int) -> None:
    assert (layout.control_size, layout.feedback_size) == (control, feedback)


def test_control_of_the_example() -> None:
    """§6.4: +20 and +127 for motors 1 and 2; motor 4 has no control flag."""
    values = {0: {"velocity": 20}, 1: {"velocity": 127}, 3: {}}
    assert EXAMPLE.control(values).hex(" ").upper() == "43 14 7F"
    assert EXAMPLE.control(values, feedback=False).hex(" ").upper() == "63 14 7F"


def test_control_of_the_factory_flags() -> None:
    """LCV before LCPG, motors ascending, LCV signed, LCPG not (§6.2.1)."""
    values = {index: {"gain": 10, "velocity": 16} for index in range(3)} | {3: {"velocity": -16, "gain": 10}}
    assert FACTORY.control(values).hex(" ").upper() == "43 10 0A 10 0A 10 0A F0 0A"
    values[0] = {"velocity": -127, "gain": 255}
    assert FACTORY.control(values)[1:3].hex(" ").upper() == "81 FF"


@each_row(("name", "value"), [("velocity", 128), ("velocity", -128), ("gain", -1), ("gain", 256), ("velocity", 10**9)])
def test_values_that_do_not_fit_are_refused(name: str, value: int) -> None:
    with pytest.raises(UsageError) as caught:
        check_control(name, value)
    assert caught.value.code == "out-of-range" and str(value) in caught.value.text
    with pytest.raises(UsageError):
        FACTORY.control({index: {"velocity": 0, "gain": 0, name: value} for index in range(4)})


@each_row("value", [-127, 0, 127])
def test_values_that_fit(value: int) -> None:
    assert (check_control("velocity", value), check_control("gain", 255)) == (value, 255)


# -- feedback ---------------------------------------------------------------------------------------------------------

EXAMPLE_BLOCKS = [
    ("2A 78 14 78 7F 00 01 9C", deltas((120, 20), (120, 127), 0, temperature=412)),
    ("2A 78 00 78 00 00 FF C9", deltas((120, 0), (120, 0), 0, temperature=-55)),
    ("2A 2A 2A 2A 2A 2A 2A 2A", deltas((42, 42), (42, 42), 42, temperature=0x2A2A)),  # 2A is a value too
    ("2A FF 80 0A 0D FF 80 00", deltas((255, -128), (10, 13), -1, temperature=-32768)),
]
FACTORY_BLOCK = bytes.fromhex("2A 01 78 21 34 0A 01 76 21 2A 09 01 7E 21 3E 0B FF FF 06 27 F6")
FACTORY_VALUES = Feedback(
    {
        index: dict(zip(("velocity", "strain", "position", "delta"), values, strict=True))
        for index, values in enumerate(
            ((1, 120, 8500, 10), (1, 118, 8490, 9), (1, 126, 8510, 11), (-1, 255, 1575, -10))
        )
    },
    None,
)


@each_row(("text", "expected"), EXAMPLE_BLOCKS)
def test_feedback_whole_and_byte_by_byte(text: str, expected: Feedback) -> None:
    block = bytes.fromhex(text)
    assert answers(EXAMPLE, "F", block) == [expected]
    assert answers(EXAMPLE, "F", *(bytes([byte]) for byte in block)) == [expected]
    assert answers(EXAMPLE, "FF", block + block) == [expected, expected]
    assert answers(EXAMPLE, "FF", block[:3], block[3:] + block[:1], block[1:]) == [expected, expected]


def test_feedback_of_the_factory_flags() -> None:
    assert answers(FACTORY, "F", FACTORY_BLOCK) == [FACTORY_VALUES]


def test_feedback_of_later_firmware() -> None:
    """4.4: LFBP u16 and LFAIN u8 behind the others, the temperature one unsigned byte in whole degrees (dossier 6.5)."""
    layout = Layout({2: LATER}, 1)
    block = bytes.fromhex("2A 8D CC 17 70 4F 82")
    values = {"position": 0x8DCC, "breakaway_position": 6000, "analog": 79}
    assert answers(layout, "F", block) == [Feedback({2: values}, 1300)]


def test_acknowledgements_only() -> None:
    block = bytes.fromhex("2A 78 14 78 7F 00 01 9C")
    expected = EXAMPLE_BLOCKS[0][1]
    assert answers(EXAMPLE, "aFa", b"*", block, b"*") == [True, expected, True]
    assert answers(EXAMPLE, "aFa", b"*" + block + b"*") == [True, expected, True]


def test_what_is_outstanding() -> None:
    decoder = Decoder(EXAMPLE)
    assert (decoder.outstanding, decoder.acknowledged, decoder.received) == (0, False, b"")
    decoder.expect(True)
    decoder.expect(False)
    assert (decoder.outstanding, decoder.acknowledged) == (2, False)
    decoder.feed(b"*\x78")
    assert decoder.next() is None
    assert (decoder.outstanding, decoder.acknowledged, decoder.received) == (2, True, b"*\x78")
    decoder.feed(bytes.fromhex("14 78 7F 00 01 9C"))
    assert decoder.next() == EXAMPLE_BLOCKS[0][1]
    assert (decoder.outstanding, decoder.acknowledged) == (1, False)
    decoder.feed(b"*")
    assert decoder.next() is True and decoder.outstanding == 0


@each_row(
    ("data", "status"),
    [(ERROR, 2048), (b"\n\rERR 8192\n\r=>", 8192), (b"\r\nERR 20\r\n=> ", 20), (b"\n\r=> ", 0), (b"\n\r=>", 0)],
)
def test_errors_in_place_of_an_acknowledgement(data: bytes, status: int) -> None:
    assert answers(EXAMPLE, "F", data) == [LoopError(status)]
    assert answers(EXAMPLE, "FF", *(bytes([byte]) for byte in data.rstrip(b" "))) == [LoopError(status)]
    assert answers(EXAMPLE, "FF", bytes.fromhex("2A 78 14 78 7F 00 01 9C") + data) == [
        EXAMPLE_BLOCKS[0][1],
        LoopError(status),
    ]


def test_an_error_ends_all_that_was_asked() -> None:
    decoder = Decoder(EXAMPLE)
    decoder.expect(True)
    decoder.expect(True)
    decoder.feed(ERROR)
    assert decoder.next() == LoopError(2048)
    assert (decoder.outstanding, decoder.received) == (0, b"")


@each_row(
    ("asked", "data", "code"),
    [
        ("F", b"\x78", "bad-block"),
        ("a", b"C", "bad-block"),
        ("", b"*", "unasked"),
        ("a", b"**", "unasked"),
        ("F", b"\n\rERR x\n\r=> ", "bad-block"),
        ("F", b"\n\rERR -1\n\r=> ", "bad-block"),
        ("F", b"\n\rERR 1 2\n\r=> ", "bad-block"),
        ("F", b"\n\rERR " + b"9" * 11 + b"\n\r=> ", "bad-block"),
        ("F", b"\n\rhello\n\r=> ", "bad-block"),
        ("F", b"\n" + b"\x00" * 80, "bad-block"),
    ],
)
def test_bytes_that_can_be_no_answer(asked: str, data: bytes, code: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        answers(EXAMPLE, asked, data)
    assert caught.value.code == code and caught.value.exit_code == 5
    assert data.lstrip(b"*")[:1].hex().upper() in caught.value.text or data == b"**" or data == b"*"


def test_a_block_that_is_not_complete_is_awaited() -> None:
    for size in range(8):
        assert answers(EXAMPLE, "F", bytes.fromhex("2A 78 14 78 7F 00 01 9C")[:size]) == []
    for size in range(1, len(ERROR) - 2):
        assert answers(EXAMPLE, "F", ERROR[:size]) == []


@given(
    st.lists(st.binary(max_size=20) | st.sampled_from([b"*", b"*\x01\x02\x03\x04\x05\x06\x07", ERROR]), max_size=6),
    st.text("Fa", max_size=6),
)
@example([b"*\x01\x02\x03", b"\x04\x05\x06\x07*", ERROR], "Fa")
def test_any_bytes(chunks: list[bytes], asked: str) -> None:
    """Answers or ProtocolError, the same in any pieces, and never more than was asked for."""

    def outcome(*pieces: bytes) -> tuple[list[Any], str | None]:
        got: list[Any] = []
        decoder = Decoder(EXAMPLE)
        for letter in asked:
            decoder.expect(letter == "F")
        try:
            for piece in pieces:
                decoder.feed(piece)
                while (answer := decoder.next()) is not None:
                    got.append(answer)
        except ProtocolError as exc:
            return got, exc.code
        return got, None

    whole = b"".join(chunks)
    got, failed = outcome(*chunks)
    assert len([answer for answer in got if not isinstance(answer, LoopError)]) <= len(asked)
    if b"=>" not in whole and b"\n" not in whole and b"\r" not in whole:
        assert outcome(*(bytes([byte]) for byte in whole)) == (got, failed)


NAMES = st.sets(st.sampled_from(sorted(FEEDBACK))).map(lambda names: tuple(n for n in FEEDBACK if n in names))
LAYOUTS = st.builds(
    Layout,
    st.dictionaries(st.integers(0, 3), NAMES.map(lambda names: Selection((), names))).map(
        lambda motors: dict(sorted(motors.items()))
    ),
    st.sampled_from([0, 1, 2]),
)
RANGES = {
    "velocity": (-128, 127), "strain": (0, 255), "position": (-3150, 20000), "delta": (-128, 127),
    "breakaway_position": (-3150, 20000), "analog": (0, 255),
}  # fmt: skip


@given(LAYOUTS, st.data())
def test_any_layout_there_and_back(layout: Layout, data: st.DataObject) -> None:
    """Bytes made here from values, by the manual's order and sizes, are taken as those values."""
    block, values = bytearray(b"*"), {}
    for index, motor in layout.motors.items():
        values[index] = {name: data.draw(st.integers(*RANGES[name])) for name in motor.feedback}
        for name, value in values[index].items():
            size = 2 if "position" in name else 1
            block += (value % 256**size).to_bytes(size, "big")
    temperature = None
    if layout.temperature == 2:
        temperature = data.draw(st.integers(-550, 1250))
        block += (temperature % 65536).to_bytes(2, "big")
    elif layout.temperature == 1:
        temperature = 10 * data.draw(st.integers(0, 255))
        block.append(temperature // 10)
    assert layout.feedback_size == len(block)
    assert answers(layout, "F", bytes(block)) == [Feedback(values, temperature)]


# -- delta positions --------------------------------------------------------------------------------------------------


@each_row(
    ("start", "divisor", "block", "positions", "saturated"),
    [
        (1500, 2, "7F 7B 00", [1754, 2000, 2000], 1),  # §6.2.3
        (2000, 2, "80 86 00", [1744, 1500, 1500], 1),  # the way back (dossier 6.4)
        (1500, 2, "7F 00 00", [1754, 1754, 1754], 1),  # LFDPD 1: the rest is lost
        (0, 1, "7F 7F 80 01", [127, 254, 126, 127], 3),
        (100, 255, "FF 01 7E", [-155, 100, 100 + 126 * 255], 0),
    ],
)
def test_delta_positions(start: int, divisor: int, block: str, positions: list[int], saturated: int) -> None:
    layout = Layout({0: Selection((), ("delta",), delta_divisor=divisor)})
    places = Positions(layout, {0: start}, discards=False)
    found = []
    for byte in bytes.fromhex(block):
        (answer,) = answers(layout, "F", bytes([0x2A, byte]))
        found.append(places.update(answer)[0][0])
    assert (found, places.saturated) == (positions, saturated)


# -- floors -----------------------------------------------------------------------------------------------------------


@each_row(
    ("sizes", "at_9600", "at_38400"),
    [
        ((3, 8), (87.3, 106.7, 120.0), (349.1, 426.7, 480.0)),
        ((9, 23), (30.0, 40.0, 41.7), (120.0, 160.0, 167.0)),
        ((9, 21), (32.0, 43.6, 45.7), (128.0, 174.5, 182.9)),
        ((1, 23), (40.0, 40.0, 41.7), (160.0, 160.0, 167.0)),
        ((1, 9), (96.0, 96.0, 106.7), (384.0, 384.0, 426.7)),
        ((5, 9), (68.6, 96.0, 106.7), (274.3, 384.0, 426.7)),
    ],
)
def test_floors(sizes: tuple[int, int], at_9600: tuple[float, ...], at_38400: tuple[float, ...]) -> None:
    """Dossier 12, Hz: sequential, overlapped, pipelined."""
    for baud, expected in ((9600, at_9600), (38400, at_38400)):
        found = cycles(*sizes, baud)
        assert list(found) == ["sequential", "overlapped", "pipelined"]
        assert [1 / seconds for seconds in found.values()] == pytest.approx(expected, abs=0.06)


# -- what the user asks for -------------------------------------------------------------------------------------------


@each_row(
    ("texts", "motors", "expected"),
    [
        (["strain@12", "delta"], [0, 1, 3], {0: ("strain", "delta"), 1: ("strain", "delta"), 3: ("delta",)}),
        (["delta", " Strain "], [2], {2: ("strain", "delta")}),  # in wire order
        (["position@S"], [0, 3], {0: (), 3: ("position",)}),
        (["velocity@g"], [0, 1, 2], {0: ("velocity",), 1: ("velocity",), 2: ("velocity",)}),
        (["none"], [0, 1], {0: (), 1: ()}),
        ([], [0], {0: ()}),
        (["strain@1", "strain@2"], [0, 1], {0: ("strain",), 1: ("strain",)}),
        (["analog", "breakaway_position"], [1], {1: ("breakaway_position", "analog")}),
    ],
)
def test_selections(texts: list[str], motors: list[int], expected: dict[int, tuple[str, ...]]) -> None:
    assert selections(texts, FEEDBACK, motors, "--receive") == expected


@each_row(
    ("texts", "word"),
    [
        (["stran"], "stran"), (["strain@"], "strain@"), (["strain@5"], "strain@5"), (["strain@3"], "--motors"),
        (["gain"], "gain"), (["none@1"], "none"), ([""], "''"), (["strain@1x"], "strain@1x"),
    ],
)  # fmt: skip
def test_selections_that_are_refused(texts: list[str], word: str) -> None:
    with pytest.raises(UsageError) as caught:
        selections(texts, FEEDBACK, [0, 1], "--receive")
    assert word in caught.value.text + str(caught.value.hint) and "--receive" in caught.value.text


def test_names_and_flags() -> None:
    """§5.3.3; the last two are of 4.4."""
    assert CONTROL == {"velocity": "LCV", "gain": "LCPG"}
    assert list(FEEDBACK.items()) == [
        ("velocity", "LFV"), ("strain", "LFS"), ("position", "LFAP"), ("delta", "LFDP"),
        ("breakaway_position", "LFBP"), ("analog", "LFAIN"),
    ]  # fmt: skip


# -- the unit of LFV --------------------------------------------------------------------------------------------------


def test_the_unit_of_velocity_is_fitted() -> None:
    """244 counts in 10 ms at velocity 61: one unit is 400 counts a second, also on the way back."""
    there = [(0.01 * number, 244 * number, 61) for number in range(8)]
    back = [(0.07 + 0.01 * number, 1708 - 244 * number, -61) for number in range(8)]
    assert velocity_unit(there + back) == pytest.approx(400.0)


@each_row("points", [[], [(0.0, 0, 5)], [(0.01 * n, 0, 0) for n in range(50)], [(0.0, n, 5) for n in range(50)]])
def test_without_motion_there_is_no_unit(points: list[tuple[float, int, int]]) -> None:
    assert velocity_unit(points) is None
