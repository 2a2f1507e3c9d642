"""Quantities: ranges, special values, choices, bits, what users type, and names that are nearly right."""

from __future__ import annotations

import pytest

from handctl.errors import UsageError
from handctl.model.param import Param, ParamMap, bit_names
from handctl.number_parsing import typed_number
from tests.support.each_row import each_row

POSITION = Param(
    name="position", doc="d", source="x §1", low=0, high=1000, special={-1: "not commanded"}, access="rw",
    kind="command", acts="moves",
    elements=("little", "ring", "middle"),
)  # fmt: skip
SPEED = Param(
    name="speed", doc="d", source="x §2", choices={0: "115200 baud", 1: "57600 baud"}, access="rw", kind="setting"
)
ANGLE = Param(
    name="angle", doc="d", source="x §3", unit="°", low=-22.66, high=22.12, decimals=2, access="rw", kind="setting"
)
ERROR = Param(name="error", doc="d", source="x §4", bits=("locked", "hot", "current"), elements=("a", "b"))
START = Param(name="start", doc="d", source="x §5", access="rw", low=0, high=1, kind="trigger", verb="start")
VOLTAGE = Param(name="voltage", doc="d", source="x §6")
RESET = Param(name="reset", doc="d", source="x §7", access="w", low=0, high=1, kind="trigger", verb="reset")
MAP = ParamMap("toy", [POSITION, SPEED, ANGLE, ERROR, START, VOLTAGE, RESET])


# -- ranges -----------------------------------------------------------------------------------------------------------


@each_row(
    ("param", "value", "allowed"),
    [
        (POSITION, 0, True), (POSITION, 1000, True), (POSITION, -1, True), (POSITION, -2, False),
        (POSITION, 1001, False), (SPEED, 1, True), (SPEED, 2, False), (SPEED, -1, False), (ANGLE, -22.66, True),
        (ANGLE, -22.67, False), (ANGLE, 22.12, True), (ANGLE, 22.13, False), (VOLTAGE, -32768, True),
        (VOLTAGE, 32767, True),
    ],
)  # fmt: skip
def test_ends_of_a_range_belong_to_it(param: Param, value: float, allowed: bool) -> None:
    assert param.allowed(value) is allowed
    if allowed:
        param.check(value)
        return
    with pytest.raises(UsageError) as caught:
        param.check(value)
    assert (caught.value.exit_code, caught.value.code) == (2, "out-of-range")
    assert param.source in caught.value.hint


@each_row(
    ("param", "text"),
    [
        (POSITION, "-1, 0..1000"), (SPEED, "0 = 115200 baud, 1 = 57600 baud"), (ANGLE, "-22.66..22.12"),
        (ERROR, "bits 0..2"), (VOLTAGE, ""), (START, "0..1"),
    ],
)  # fmt: skip
def test_ranges_for_people(param: Param, text: str) -> None:
    assert param.range_text == text


def test_a_special_value_inside_the_range_is_not_listed_twice() -> None:
    inside = Param(name="p", doc="d", source="s", low=0, high=9, special={0: "off"})
    assert inside.range_text == "0..9"
    assert inside.label(0) == "off"


# -- what users type --------------------------------------------------------------------------------------------------


@each_row(
    ("param", "text", "value"),
    [
        (POSITION, "300", 300), (POSITION, " 300 ", 300), (POSITION, "0x12C", 300), (POSITION, "-1", -1),
        (POSITION, "+5", 5), (POSITION, "007", 7), (SPEED, "1", 1), (SPEED, "57600 baud", 1), (SPEED, "57600 BAUD", 1),
        (ANGLE, "-10", -10.0), (ANGLE, "10.05", 10.05), (ANGLE, "1e1", 10.0),
    ],
)  # fmt: skip
def test_values_that_are_understood(param: Param, text: str, value: float) -> None:
    assert param.parse(text) == value


@each_row(
    ("param", "text"),
    [
        (POSITION, ""), (POSITION, "x"), (POSITION, "1.5"), (POSITION, "1e2"), (POSITION, "0x"), (POSITION, "--1"),
        (POSITION, "1 2"), (POSITION, "1_0"), (POSITION, "½"), (POSITION, "1001"), (POSITION, "-2"), (SPEED, "2"),
        (SPEED, "fast"), (SPEED, "115200"), (ANGLE, "1.005"), (ANGLE, "nan"), (ANGLE, "inf"), (ANGLE, "-inf"),
        (ANGLE, "1e999"), (ANGLE, "1e-999"), (ANGLE, "0x10"), (ANGLE, "22.13"), (ANGLE, ""), (ANGLE, "1_0"),
    ],
)  # fmt: skip
def test_values_that_are_refused(param: Param, text: str) -> None:
    with pytest.raises(UsageError) as caught:
        param.parse(text, "here")
    assert caught.value.exit_code == 2
    assert "here" in caught.value.text


@each_row("text", ["1.005", "nan", "inf", "abc", "", "1e999", "1e-999"])
def test_decimals_are_exact_or_an_error(text: str) -> None:
    with pytest.raises(ValueError):
        typed_number(text, 2)


def test_decimals_survive_the_way_to_raw_and_back() -> None:
    """Two decimals, no binary rounding in sight: 10.05 is 1005, not 1004."""
    for raw in range(-2266, 2213):
        value = ANGLE.from_raw(raw)
        assert ANGLE.to_raw(value) == raw
        assert ANGLE.to_raw(typed_number(f"{value:.2f}", 2)) == raw
    assert ANGLE.from_raw(1005) == 10.05
    assert POSITION.from_raw(-1) == -1
    assert isinstance(POSITION.to_raw(5), int)


# -- labels -----------------------------------------------------------------------------------------------------------


@each_row(
    ("value", "text"),
    [(0, "ok"), (1, "locked"), (2, "hot"), (6, "hot, current"), (7, "locked, hot, current"),
     (8, "unknown_bit_3"), (0x81, "locked, unknown_bit_7"), (0x100, "unknown_bit_8")],
)  # fmt: skip
def test_bits_by_name(value: int, text: str) -> None:
    assert bit_names(value, ERROR.bits) == text
    assert ERROR.label(value) == text


def test_labels() -> None:
    assert POSITION.label(-1) == "not commanded"
    assert POSITION.label(5) is None
    assert SPEED.label(1) == "57600 baud"
    assert VOLTAGE.label(0) is None


# -- the book ---------------------------------------------------------------------------------------------------------


def test_access_and_count() -> None:
    assert [p.readable for p in (POSITION, ERROR, START, RESET)] == [True, True, True, False]
    assert [p.writable for p in (POSITION, ERROR, START, RESET)] == [True, False, False, False]
    assert [p.count for p in (POSITION, VOLTAGE, ERROR)] == [3, 1, 2]
    assert [element.full_name for element in POSITION.each] == [
        "position.little",
        "position.ring",
        "position.middle",
    ]
    assert [element.full_name for element in VOLTAGE.each] == ["voltage"]
    assert VOLTAGE.each[0].part is None


def test_a_name_used_twice_is_a_mistake_in_the_map() -> None:
    with pytest.raises(ValueError):
        ParamMap("toy", [VOLTAGE, VOLTAGE])


def test_names_are_found() -> None:
    param, elements = MAP.find("position.ring")
    assert (param, [element.index for element in elements]) == (POSITION, [1])
    assert [element.index for element in MAP.find("position")[1]] == [0, 1, 2]
    assert "angle" in MAP
    assert "angles" not in MAP
    assert len(MAP) == 7
    assert MAP["speed"] is SPEED


@each_row(
    ("name", "hint"),
    [
        ("positon", "did you mean position"), ("Position", "did you mean position"), ("xyz", "describe"),
        ("position.pinky", "little, ring, middle"), ("position.", "little, ring, middle"), ("voltage.little", "single"),
        ("", "describe"), (".little", "describe"), ("position.little.x", "little, ring, middle"),
    ],
)  # fmt: skip
def test_unknown_names_come_with_near_ones(name: str, hint: str) -> None:
    with pytest.raises(UsageError) as caught:
        MAP.find(name)
    assert (caught.value.exit_code, caught.value.code) == (2, "unknown-name")
    assert hint in caught.value.hint


def pairs(*texts: str) -> list[tuple[str, float]]:
    return [(element.full_name, value) for element, value in MAP.assignments(texts)]


def test_assignments_come_in_wire_order() -> None:
    assert pairs("speed=1", "position.middle=3", "position.little=-1") == [
        ("position.little", -1),
        ("position.middle", 3),
        ("speed", 1),
    ]
    assert pairs("position=1,2,3") == [("position.little", 1), ("position.ring", 2), ("position.middle", 3)]
    assert pairs("angle=10.05") == [("angle", 10.05)]
    assert pairs("speed=57600 baud") == [("speed", 1)]


@each_row(
    "texts",
    [
        ["position"], ["position=1"], ["position=1,2"], ["position=1,2,3,4"], ["position.ring=1,2"], ["position=1,,3"],
        ["position=1,2,1001"], ["=5"], ["nothing=5"], ["voltage=5"], ["error=0"], ["start=1"], ["reset=1"],
        ["speed=1", "speed=1"], ["position=1,2,3", "position.ring=5"], ["speed="], ["speed=2"], [""],
    ],
)  # fmt: skip
def test_assignments_that_are_refused(texts: list[str]) -> None:
    with pytest.raises(UsageError) as caught:
        MAP.assignments(texts)
    assert caught.value.exit_code == 2
    assert caught.value.text


def test_a_trigger_names_its_command() -> None:
    with pytest.raises(UsageError) as caught:
        MAP.assignments(["start=1"])
    assert caught.value.code == "trigger"
