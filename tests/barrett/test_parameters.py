"""The parameter map against the manual's tables, copied by hand (barrett §5.3, §5.4), and what is said of careful values."""

from __future__ import annotations

import pytest

from handctl.devices.barrett.parameter_map import BARRETT, SPEEDS, GclParam, check_careful, standard
from handctl.devices.barrett.status_and_parameter_views import audit
from handctl.errors import UsageError
from handctl.model.param import Element, scale_of
from tests.barrett.support import changes, elements, simulated
from tests.support.each_row import each_row

BIG = 65535
MOTOR = [
    # mnemonic, name, low, high, default of a finger, default of the spread, "ro" or "adv" or "", section
    ("DP", "default_position", 0, BIG, 8500, 1575, "", "5.3.1"),
    ("DS", "default_step", 0, BIG, 1700, 315, "", "5.3.1"),
    ("HSG", "strain_limit_high", 0, 256, 256, 256, "", "5.3.1"),
    ("LSG", "strain_limit_low", 0, 256, 256, 256, "", "5.3.1"),
    ("MOV", "max_open_velocity", 16, 4080, 100, 60, "", "5.3.1"),
    ("MCV", "max_close_velocity", 16, 4080, 100, 60, "", "5.3.1"),
    ("MSG", "strain_limit_high_alias", 0, 256, 256, 256, "", "5.3.1"),
    ("OD", "odometer", 0, 4294967296, None, None, "ro", "5.3.2"),
    ("P", "position", None, None, None, None, "ro", "5.3.2"),
    ("S", "status", 0, 65535, None, None, "ro", "5.3.2"),
    ("SG", "strain", 0, 255, None, None, "ro", "5.3.2"),
    ("LCV", "loop_control_velocity", 0, 1, 1, 1, "", "5.3.3"),
    ("LCVC", "loop_control_velocity_coefficient", 1, 255, 1, 1, "", "5.3.3"),
    ("LCPG", "loop_control_proportional_gain", 0, 1, 1, 1, "", "5.3.3"),
    ("LFV", "loop_feedback_velocity", 0, 1, 1, 1, "", "5.3.3"),
    ("LFVC", "loop_feedback_velocity_coefficient", 1, 255, 1, 1, "", "5.3.3"),
    ("LFS", "loop_feedback_strain", 0, 1, 1, 1, "", "5.3.3"),
    ("LFAP", "loop_feedback_absolute_position", 0, 1, 1, 1, "", "5.3.3"),
    ("LFDP", "loop_feedback_delta_position", 0, 1, 1, 1, "", "5.3.3"),
    ("LFDPC", "loop_feedback_delta_position_coefficient", 1, 255, 1, 1, "", "5.3.3"),
    ("ACCEL", "acceleration", 1, BIG, 4, 2, "adv", "5.3.4"),
    ("CT", "close_target", 0, BIG, 17000, 3150, "adv", "5.3.4"),
    ("EN", "enabled", 0, 1, 1, 1, "adv", "5.3.4"),
    ("FDZ", "filter_derivative_zero", 0, 255, 0, 0, "adv", "5.3.4"),
    ("FIP", "filter_integral_pole", 0, 255, 0, 0, "adv", "5.3.4"),
    ("FPG", "filter_proportional_gain", 0, 255, 10, 10, "adv", "5.3.4"),
    ("HOLD", "hold", 0, 1, 0, 1, "adv", "5.3.4"),
    ("IHIT", "init_hit_count", 0, BIG, 2, 0, "adv", "5.3.4"),
    ("IOFF", "init_offset", 0, BIG, 50, 0, "adv", "5.3.4"),
    ("IVEL", "init_velocity", 16, 4080, 300, 150, "adv", "5.3.4"),
    ("MPE", "max_position_error", 0, BIG, 50, 50, "adv", "5.3.4"),
    ("OT", "open_target", 0, BIG, 0, 0, "adv", "5.3.4"),
    ("SAMPLE", "sample_time", 15, 255, 31, 31, "adv", "5.3.4"),
    ("SGFLIP", "strain_flip", 0, 1, 0, 0, "adv", "5.3.4"),
    ("TSTOP", "stop_time", 0, BIG, 30, 30, "adv", "5.3.4"),
]
GLOBAL = [
    # mnemonic, name, low, high, default, "ro" or "adv" or "", section
    ("BAUD", "baud_rate", 6, 384, 96, "", "5.4.1"),
    ("LFT", "loop_feedback_temperature", 0, 1, 0, "", "5.4.1"),
    ("OTEMP", "over_temperature_limit", 0, 1250, 0, "", "5.4.1"),
    ("TEMP", "temperature", -550, 1250, None, "ro", "5.4.2"),
    ("PTEMP", "peak_temperature", 0, 1250, None, "ro", "5.4.2"),
    ("UPSECS", "uptime_seconds", 0, 4294967296, None, "ro", "5.4.2"),
    ("SN", "serial_number", 0, None, None, "ro", "5.4.2"),
    ("LFDPD", "loop_feedback_delta_discard", 0, 1, 0, "adv", "5.4.3"),
]
LATER = {"BD": "r", "BP": "r", "BS": "rw", "BDAT": "rw", "LCT": "rw", "LFBP": "rw", "LFAIN": "rw"}
UNITS = {
    "cts": "DP DS P CT IOFF MPE OT BP",
    "1/16 cts/sample": "MOV MCV IVEL",
    "1/256 cts/sample²": "ACCEL",
    "1000 cts": "OD",
    "ms": "TSTOP",
    "0.1 °C": "OTEMP TEMP PTEMP",
    "s": "UPSECS",
    "100 bit/s": "BAUD",
}


def test_the_map_holds_the_manuals_names_and_no_other() -> None:
    """35 motor parameters, 8 global ones, in the manual's order; 7 of later firmware behind them."""
    assert (len(MOTOR), len(GLOBAL)) == (35, 8)
    assert [param.mnemonic for param in standard()] == [row[0] for row in [*MOTOR, *GLOBAL]]
    assert {param.mnemonic: param.access for param in BARRETT if param.since} == LATER


@each_row("row", MOTOR, ids=lambda row: row[0])
def test_motor_parameters(row: tuple[str, str, int, int, int, int, str, str]) -> None:
    mnemonic, name, low, high, finger, spread, kind, section = row
    param = BARRETT.by_mnemonic(mnemonic)
    assert (param.name, param.low, param.high, param.source) == (name, low, high, f"barrett §{section}")
    assert [param.default_of(index) for index in range(4)] == [finger, finger, finger, spread]
    assert (param.access, param.advanced) == ("r" if kind == "ro" else "rw", kind == "adv")
    assert param.elements == ("F1", "F2", "F3", "SPREAD")
    assert not param.is_global


@each_row("row", GLOBAL, ids=lambda row: row[0])
def test_global_parameters(row: tuple[str, str, int, int, int, str, str]) -> None:
    mnemonic, name, low, high, default, kind, section = row
    param = BARRETT.by_mnemonic(mnemonic)
    assert (param.name, param.low, param.high, param.source) == (name, low, high, f"barrett §{section}")
    assert (param.default_of(0), param.access) == (default, "r" if kind == "ro" else "rw")
    assert param.advanced == (kind == "adv")
    assert param.elements == ()
    assert param.is_global


def test_units() -> None:
    units = {mnemonic: unit for unit, names in UNITS.items() for mnemonic in names.split()}
    assert {param.mnemonic: param.unit for param in BARRETT if param.unit} == units


def test_defaults_are_allowed_and_no_careful_values() -> None:
    for param in BARRETT:
        for index in range(param.count):
            default = param.default_of(index)
            if default is not None:
                assert param.allowed(default), param.mnemonic
                assert param.mnemonic == "OTEMP" or param.objection(index, default) is None, param.mnemonic


@each_row("row", [*MOTOR, *GLOBAL], ids=lambda row: row[0])
def test_ranges_are_hard(row: tuple[object, ...]) -> None:
    param = BARRETT.by_mnemonic(str(row[0]))
    if not param.writable or param.choices:
        return
    assert param.low is not None and param.high is not None
    for value in (param.low, param.high):
        param.check(value)
    for value in (param.low - 1, param.high + 1):
        with pytest.raises(UsageError):
            param.check(value)


def test_seven_speeds_and_no_other() -> None:
    param = BARRETT.by_mnemonic("BAUD")
    assert [value for value in range(1300) if param.allowed(value)] == [6, 12, 24, 48, 96, 192, 384]
    assert sorted(SPEEDS) == [600, 1200, 2400, 4800, 9600, 19200, 38400]
    assert param.strands
    assert [other.mnemonic for other in BARRETT if other.strands] == ["BAUD"]


@each_row("mnemonic", ["LCVC", "LFVC", "LFDPC", "ACCEL"])
def test_zero_is_refused_where_it_stops_or_divides(mnemonic: str) -> None:
    with pytest.raises(UsageError):
        changes(f"{mnemonic}=0")


def test_snapshot_covers_all_writable_values() -> None:
    """31 writable motor values for four motors, BAUD, LFT, OTEMP, LFDPD (dossier 3.3)."""
    names = [element.full_name for element in BARRETT.kept()]
    assert len(names) == 31 * 4 + 4
    assert {name for name in names if "." not in name} == {
        "baud_rate", "loop_feedback_temperature", "over_temperature_limit", "loop_feedback_delta_discard",
    }  # fmt: skip
    assert len(BARRETT.elements(*(param.mnemonic for param in standard()))) == 35 * 4 + 8


# -- finding ----------------------------------------------------------------------------------------------------------


@each_row(
    ("name", "wanted"),
    [
        ("P", ["position.F1", "position.F2", "position.F3", "position.SPREAD"]), ("p.f1", ["position.F1"]),
        ("position.S", ["position.SPREAD"]), ("SG.4", ["strain.SPREAD"]), ("sg.1", ["strain.F1"]),
        ("strain.spread", ["strain.SPREAD"]), ("temp", ["temperature"]), ("OTEMP", ["over_temperature_limit"]),
        ("S.2", ["status.F2"]), ("bp.3", ["breakaway_position.F3"]),
    ],
)  # fmt: skip
def test_find(name: str, wanted: list[str]) -> None:
    assert [element.full_name for element in elements(name)] == wanted


@each_row("name", ["", "Q", "P.5", "P.", "P.F4", "P.G", "TEMP.1", "TEMP.F1", "P.F1.F2", ".", "XX.1"])
def test_not_found(name: str) -> None:
    with pytest.raises(UsageError) as caught:
        BARRETT.find(name)
    assert caught.value.code == "unknown-name"


def test_one_value_goes_to_all_motors() -> None:
    found = changes("MCV=80", "OTEMP=600", "HSG.F2=0x10")
    assert [(element.full_name, value) for element, value in found] == [
        ("strain_limit_high.F2", 16), ("max_close_velocity.F1", 80), ("max_close_velocity.F2", 80),
        ("max_close_velocity.F3", 80), ("max_close_velocity.SPREAD", 80), ("over_temperature_limit", 600),
    ]  # fmt: skip
    chosen = BARRETT.assignments_on(["DS=5", "LFT=1"], ["F1", "SPREAD"])
    assert [element.full_name for element, _ in chosen] == [
        "default_step.F1", "default_step.SPREAD", "loop_feedback_temperature",
    ]  # fmt: skip
    assert [value for _, value in changes("EN=1,0,1,0")] == [1, 0, 1, 0]


@each_row(
    "text",
    [
        "P=1", "TEMP=1", "OD.F1=0", "SN=1", "MCV=15", "MCV=4081", "HSG=257", "DP=65536", "DP=-1", "EN=2", "BAUD=100",
        "BAUD=9600", "OTEMP=1251", "MCV", "MCV=", "MCV=1_00", "MCV=80.5", "MCV=80,80", "IHIT=x", "NOPE=1", "LFT=2",
    ],
)  # fmt: skip
def test_assignments_refused(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        changes(text)
    assert caught.value.exit_code == 2


def test_given_twice() -> None:
    for pair in (["MCV=80", "MCV.F1=90"], ["DP.1=5", "default_position.F1=6"], ["LFT=1", "lft=1"]):
        with pytest.raises(UsageError):
            changes(*pair)


# -- careful values ---------------------------------------------------------------------------------------------------

CAREFUL = [
    # fine, needs --force, a word of the reason
    ("IVEL.F1=300", "IVEL.F1=301", "breakaway"),
    ("IVEL.SPREAD=150", "IVEL.SPREAD=151", "breakaway"),
    ("TSTOP.F2=30", "TSTOP.F2=31", "heat"),
    ("TSTOP.S=0", "TSTOP.S=10000", "heat"),
    ("IHIT.F3=5", "IHIT.F3=6", "5"),
    ("IOFF.F1=500", "IOFF.F1=501", "500"),
    ("SAMPLE.F1=31", "SAMPLE.F1=32", "not"),
    ("SAMPLE.F1=31", "SAMPLE.F1=15", "not"),
    ("SGFLIP.F1=0", "SGFLIP.F1=1", "legacy"),
    ("FIP.F1=0", "FIP.F1=1", "unstable"),
    ("OTEMP=300", "OTEMP=299", "29.9 °C"),
    ("OTEMP=600", "OTEMP=60", "6.0 °C"),
    ("OTEMP=0", "OTEMP=1", "0.1 °C"),
    ("DP.F1=18000", "DP.F1=18001", "travel"),
    ("DS.S=3150", "DS.S=3151", "travel"),
    ("MPE.F1=18000", "MPE.F1=65535", "travel"),
    ("MOV.F1=300", "MOV.F1=301", "clutch"),
    ("MOV.S=150", "MOV.S=151", "clutch"),
    ("MOV=40", "MOV=39", "may not move"),
    ("MCV=2032", "MCV=2033", "profile"),
    ("MCV=40", "MCV=16", "may not move"),
    ("CT.F1=18000", "CT.F1=18001", "stop"),
    ("CT.S=3150", "CT.S=20000", "stop"),
    ("CT=51", "CT=0", "nowhere to go"),
    ("OT.F1=17800", "OT.F1=60000", "closes"),
    ("OT.S=3150", "OT.S=3151", "closes"),
    ("LCVC.F1=2", "LCVC.F1=8", "IVEL"),
    ("LCVC.S=1", "LCVC.S=2", "IVEL"),
]


@each_row(("fine", "careful", "reason"), CAREFUL)
def test_careful_values_need_force(fine: str, careful: str, reason: str) -> None:
    """Dossier 3.1, 3.2: refused without --force, told with it."""
    assert check_careful(changes(fine), False) == []
    with pytest.raises(UsageError) as caught:
        check_careful(changes(careful), False)
    assert (caught.value.code, caught.value.exit_code) == ("careful", 2)
    assert reason in caught.value.text
    assert "--force" in caught.value.hint
    (objection,) = check_careful(changes(careful), True)
    assert reason in objection


def test_only_these_are_careful() -> None:
    known = {text.partition(".")[0].partition("=")[0] for _, text, _ in CAREFUL}
    assert {param.mnemonic for param in BARRETT if param.careful} == known


def test_one_objection_for_all_motors() -> None:
    assert len(check_careful(changes("TSTOP=100"), True)) == 1


# -- audit ------------------------------------------------------------------------------------------------------------


def row(param: GclParam, motor: str | None, value: int) -> dict[str, object]:
    return {"name": param.name, "parameter": param.mnemonic, "motor": motor, "value": value}


@each_row(
    ("mnemonic", "motor", "value", "words"),
    [
        ("TSTOP", "F3", 10000, "F3: TSTOP = 10000"), ("IVEL", "SPREAD", 300, "SPREAD: IVEL = 300"),
        ("OTEMP", None, 60, "OTEMP = 60"), ("SAMPLE", "F1", 30, "F1: SAMPLE = 30"),
    ],
)  # fmt: skip
def test_audit_finds(mnemonic: str, motor: str | None, value: int, words: str) -> None:
    (finding,) = audit([row(BARRETT.by_mnemonic(mnemonic), motor, value)])
    assert words in finding


def test_audit_of_a_hand_as_it_left_the_factory() -> None:
    rows = [
        row(param, element.part, param.default_of(element.index) or 0)
        for param in standard()
        for element in BARRETT.elements(param.mnemonic)
    ]
    assert list(audit(rows)) == []
    assert list(audit([{"name": "strain", "parameter": "SG", "motor": "F1", "error": "not read"}])) == []


def test_audit_compares_the_two_names_of_one_limit() -> None:
    rows = [row(BARRETT.by_mnemonic(name), "F2", value) for name, value in (("HSG", 150), ("MSG", 256))]
    (finding,) = audit(rows)
    assert "F2" in finding and "150" in finding and "256" in finding


# -- units of a person --------------------------------------------------------------------------------------------------


@each_row(
    ("text", "hint"),
    [
        ("over_temperature_limit=60.5", "60.5 °C is over_temperature_limit=605"), ("OTEMP=6.05", ""),
        ("MOV.F1=6.25", "6.25 cts/sample is max_open_velocity=100"), ("ACCEL.F1=0.5", "0.5 cts/sample² is acceleration=128"),
    ],
)  # fmt: skip
def test_a_value_in_the_unit_of_a_person_is_told_in_the_wires(text: str, hint: str) -> None:
    with pytest.raises(UsageError) as caught:
        changes(text)
    assert caught.value.exit_code == 2 and "whole number of" in caught.value.text
    assert caught.value.hint.startswith(hint) if hint else " is over_temp" not in caught.value.hint


@each_row("text", ["OTEMP=x", "DP.F1=1.5", "OTEMP=1.2.3", "OTEMP="])
def test_other_nonsense_stays_nonsense(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        changes(text)
    assert "whole number" in caught.value.text and "cts/sample" not in caught.value.hint


@each_row(
    "param", [param for param in BARRETT if scale_of(param.unit or "") is not None], ids=lambda param: param.mnemonic
)
def test_every_scaled_unit_is_exact(param: GclParam) -> None:
    hand, _ = simulated()
    (reading, *_) = hand.read([Element(param, 0)])
    row = hand.row(reading)
    assert row["scaled_unit"] in ("°C", "cts/sample", "cts/sample²", "bit/s", "cts")
    factor = {
        "0.1 °C": 0.1,
        "1/16 cts/sample": 1 / 16,
        "1/256 cts/sample²": 1 / 256,
        "100 bit/s": 100,
        "1000 cts": 1000,
    }
    assert row["scaled"] == pytest.approx(row["value"] * factor[row["unit"]], rel=1e-12)
