"""The register map against the manual's table, copied by hand (exo §2.3), and values from and to their bytes."""

from __future__ import annotations

from handctl.devices.inspire.exo.register_map import EXO, FINGERS
from handctl.devices.inspire.register_map import BAUD_RATES, ERROR_BITS, OVER_TEMPERATURE, register_of
from tests.support.each_row import each_row
from tests.support.scripted import hexed, unhex

FIVE = ("little", "ring", "middle", "index", "thumb")

TABLE = [
    # name, address, bytes in all, access, low, high, unit, section (exo §2.3 and its subsections)
    ("id", 1000, 1, "rw", 1, 254, None, "2.3.1"),
    ("baud_code", 1001, 1, "rw", None, None, None, "2.3.2"),
    ("clear_errors", 1004, 1, "rw", 0, 1, None, "2.3.3"),
    ("save", 1005, 1, "rw", 0, 1, None, "2.3.4"),
    ("factory_reset", 1006, 1, "w", 0, 1, None, "2.3.5"),
    ("calibrate", 1009, 1, "rw", 0, 1, None, "2.3.6"),
    ("system_voltage", 1472, 2, "r", None, None, None, "2.3"),
    ("position_set", 1486, 10, "rw", 0, 1000, None, "2.3.7"),
    ("force_set", 1498, 10, "rw", -1000, 1000, None, "2.3.8"),
    ("position_actual", 1546, 12, "r", 0, 1000, None, "2.3.9"),
    ("force_actual", 1582, 10, "r", -1000, 1000, None, "2.3.10"),
    ("current", 1594, 10, "r", 0, 1000, "mA", "2.3.11"),
    ("error", 1606, 5, "r", None, None, None, "2.3.12"),
    ("temperature", 1618, 5, "r", 0, 100, "°C", "2.3.13"),
]


def test_the_map_is_the_manuals_table() -> None:
    assert [register.name for register in EXO] == [row[0] for row in TABLE]
    for name, address, size, access, low, high, unit, section in TABLE:
        register = EXO[name]
        assert (register.address, len(register.span), register.access) == (address, size, access), name
        assert (register.low, register.high, register.unit) == (low, high, unit), name
        assert f"§{section}" in register.source, name
        assert f"§{section}." not in register.source, name


def test_fingers_are_in_wire_order() -> None:
    """exo §2.2.1: little, ring, middle, index, thumb; the rotation of the thumb is measured only (exo §2.3.9)."""
    assert FINGERS == FIVE
    for name in ("position_set", "force_set", "force_actual", "current", "error", "temperature"):
        assert EXO[name].elements == FIVE
    assert EXO["position_actual"].elements == (*FIVE, "thumb_rotation")
    for name in ("id", "baud_code", "system_voltage", "save"):
        assert EXO[name].elements == ()


@each_row(
    ("name", "address"),
    [
        ("position_set.little", 1486), ("position_set.index", 1492), ("position_set.thumb", 1494),
        ("force_set.ring", 1500), ("position_actual.thumb_rotation", 1556), ("force_actual.middle", 1586),
        ("current.index", 1600), ("error.index", 1609), ("error.thumb", 1610), ("temperature.little", 1618),
        ("temperature.thumb", 1622), ("id", 1000),
    ],
)  # fmt: skip
def test_addresses_of_elements(name: str, address: int) -> None:
    """Rows of exo §2.3.7 to §2.3.13. 1609 is the index finger: the example ERROR(3) says so."""
    (element,) = EXO.find(name)[1]
    assert register_of(element).address_of(element.index) == address


def test_speed_codes() -> None:
    """exo §2.3.2."""
    assert BAUD_RATES == {0: 115200, 1: 57600, 2: 19200}
    assert {value: EXO["baud_code"].label(value) for value in range(3)} == {
        0: "115200 baud",
        1: "57600 baud",
        2: "19200 baud",
    }
    assert not EXO["baud_code"].allowed(3)


def test_error_bits() -> None:
    """exo §2.3.12; over temperature is the one that cannot be cleared (exo §2.3.3)."""
    assert ERROR_BITS == ("locked_rotor", "over_temperature", "over_current", "motor_abnormal", "communication")
    assert OVER_TEMPERATURE == 2
    assert EXO["error"].label(0x06) == "over_temperature, over_current"


@each_row(
    ("name", "value", "raw"),
    [
        ("position_set", -1, "FF FF"), ("position_set", 1000, "E8 03"), ("force_set", -1000, "18 FC"),
        ("force_set", 1000, "E8 03"), ("id", 254, "FE"), ("temperature", 100, "64"), ("system_voltage", 558, "2E 02"),
        ("error", 255, "FF"), ("current", 1000, "E8 03"), ("force_actual", -11, "F5 FF"),
    ],
)  # fmt: skip
def test_values_and_their_bytes(name: str, value: int, raw: str) -> None:
    assert hexed(EXO[name].encode(value)) == raw
    assert EXO[name].decode(unhex(raw)) == value


def test_types() -> None:
    assert {register.name for register in EXO if register.type_name == "u8"} == {
        "id", "baud_code", "clear_errors", "save", "factory_reset", "calibrate", "error", "temperature",
    }  # fmt: skip
    assert {register.type_name for register in EXO} == {"u8", "s16"}


def test_what_moves_strands_starts_and_stays() -> None:
    """Saving and the reset change the hand for good; id and speed are all that "can be saved" (exo §2.3.1, §2.3.2)."""
    assert {register.name for register in EXO if register.moves} == {"position_set", "force_set", "calibrate"}
    assert {register.name for register in EXO if register.strands} == {"id", "baud_code", "save", "factory_reset"}
    assert {register.name: register.verb for register in EXO if register.trigger} == {
        "clear_errors": "clear-errors",
        "save": "save",
        "factory_reset": "factory-reset",
        "calibrate": "calibrate",
    }
    assert {register.name for register in EXO if register.persistent == "yes"} == {"id", "baud_code"}


def test_what_is_uncertain_is_said() -> None:
    assert "scale unknown" in EXO["system_voltage"].note
    assert "undocumented" in EXO["factory_reset"].doc
    assert "RH56" in EXO["factory_reset"].source
    assert EXO["position_set"].label(-1) == "not commanded"
