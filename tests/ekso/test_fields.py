"""The words of the EksoNR against the manual's tables, exact scaling for every raw value, names, codes, refusals."""

from __future__ import annotations

from decimal import Decimal

import pytest

from handctl.devices.ekso.parameter_map import (
    DATA,
    EKSO,
    FEEDBACK,
    MESSAGES,
    SETTINGS,
    Word,
    boot_ms,
    boot_text,
    plain,
    state_text,
)
from handctl.devices.ekso.status import hip, residuals
from handctl.errors import UsageError
from tests.support.each_row import each_row
from tests.support.refused import refused

# The manual's tables (ekso §6), typed apart from the code: name, scale.
MANUAL = {
    "settings": "Upper Leg Length 100|Lower Leg Length 100|Step Length 100|Step Height 100|Swing Time 100|Stand Time 100|Knee Flexion 100|Hip Flexion 100|Forward Shift 100|Lateral Shift 100|Walk 1|Stand 1|Target Sounds 1|Injury Mode 1|Left Swing Assistance 1|Right Swing Assistance 1|Left Stance Support 1|Right Stance Support 1|Swing Complete 1|PilotID 1|Sit 1|Lean Allowance 1",
    "data": "Torso Pitch Angle 100|Torso Roll Angle 100|Right Toe Pressure 1|Right Heel Pressure 1|Left Toe Pressure 1|Left Heel Pressure 1|Right Hip X Position 10|Right Hip Y Position 100|Left Hip X Position 10|Left Hip Y Position 100|Right Hip Current 100|Right Hip Angle 100|Right Knee Current 100|Right Knee Angle 100|Left Hip Current 100|Left Hip Angle 100|Left Knee Current 100|Left Knee Angle 100|State 1|Foot State 1|Min State 1|LCD Button State 1|Weight Shift 1000|HMI Data 1|VA Ref Time 10|BootTime (high bytes) 1|BootTime (low bytes) 1",
    "feedback": "StepsTaken 1|UprightTime 1|WalkTime 1|Max Fwd Assist, left 10|Assist Gain, left 10|Max Fwd Assist, right 10|Assist Gain, right 10|Hip stance support, left 10|Knee stance support, left 10|Hip stance support, right 10|Knee stance support, right 10|StepLength, left 10|StepLength, right 10|SwingTime, left 10|SwingTime, right 10|BootTime (high bytes) 1|BootTime (low bytes) 1",
}
IDS = "Upper Leg Length|Lower Leg Length|Step Length|Step Height|Swing Time|Stand Time|Knee Flexion|Hip Flexion|Forward Shift|Lateral Shift|Stand Mode|Sit Mode|Walk Mode|Target Sounds|Lean Allowance|Injury Mode|Left Swing Assist|Left Stance Support|Right Swing Assist|Right Stance Support"
SIGNED = {
    "settings": {"forward_shift", "lateral_shift"},
    "data": {"torso_pitch", "torso_roll", "weight_shift"} | {
        f"{side}_{what}" for side in ("left", "right")
        for what in ("hip_x", "hip_y", "hip_current", "hip_angle", "knee_current", "knee_angle")
    },
    "feedback": {f"{side}_{what}" for side in ("left", "right") for what in (
        "max_forward_assist", "assist_gain", "hip_stance_support", "knee_stance_support", "step_length", "swing_time",
    )},
}  # fmt: skip
ALL = [param for message in MESSAGES.values() for param in message]


def known_as(param: Word) -> set[str]:
    return {plain(name) for name in (param.name, *param.aliases)}


@each_row("message", MESSAGES)
def test_words_scales_and_signs_of_the_manual(message: str) -> None:
    rows = [row.rpartition(" ") for row in MANUAL[message].split("|")]
    params = MESSAGES[message]
    assert [param.word for param in params] == list(range(len(rows)))
    for (name, _, scale), param in zip(rows, params, strict=True):
        assert plain(name) in known_as(param), name
        assert 10**param.decimals == int(scale), name
        assert param.message == message
    assert {param.name for param in params if param.signed} == SIGNED[message]


def test_how_many() -> None:
    assert (len(SETTINGS), len(DATA), len(FEEDBACK), len(EKSO)) == (22, 27, 17, 64)


def test_parameter_ids_are_those_of_the_last_table() -> None:
    by_id = {param.id: param for param in SETTINGS if param.id is not None}
    assert list(range(200, 220)) == sorted(by_id)
    for number, name in enumerate(IDS.split("|"), 200):
        assert plain(name) in known_as(by_id[number]), name
        assert by_id[number].access == "rw"
    assert [param.id for param in SETTINGS[10:]] == [212, 210, 213, 215, 216, 218, 217, 219, None, None, 211, 214]
    assert [param.name for param in SETTINGS if param.id is None] == ["swing_complete", "pilot_id"]
    assert all(param.id is None and param.access == "r" for param in (*DATA, *FEEDBACK))


TYPES = {param.type_name: param for param in ALL}


def test_the_types_are_these() -> None:
    assert set(TYPES) == {"u16", "u16/10", "u16/100", "s16/10", "s16/100", "s16/1000"}


@pytest.mark.parametrize("param", TYPES.values(), ids=TYPES)
def test_every_raw_value_there_and_back(param: Word) -> None:
    scale = Decimal(10) ** param.decimals
    for word in range(0x10000):
        raw = word - 0x10000 if param.signed and word >= 0x8000 else word
        value = param.value_of(word)
        assert Decimal(repr(value)) * scale == raw
        assert param.to_raw(value) == raw
        assert param.raw_of(raw) == raw == param.raw_of(word)
    assert param.value_of(-1) == param.value_of(0xFFFF)


@pytest.mark.parametrize("param", [SETTINGS[2], SETTINGS[8]], ids=["unsigned", "signed"])
def test_every_typed_value_goes_out_as_its_raw_integer(param: Word) -> None:
    low = -0x8000 if param.signed else 0
    for raw in range(low, low + 0x10000, 7):
        assert param.to_raw(param.parse(f"{Decimal(raw) / 100}")) == raw


@each_row(
    ("name", "text", "raw"),
    [
        ("swing_time", "0.29", 29), ("step_length", "1.15", 115), ("step_length", "15.5", 1550), ("202", "15.50", 1550),
        ("forward_shift", "-0.75", -75), ("lateral_shift", "-0.01", -1), ("lateral_shift", "-327.68", -32768),
        ("lateral_shift", "327.67", 32767), ("step_height", "655.35", 65535), ("knee_flexion", "+2", 200),
        ("swing_time", "2.9e-1", 29), ("left_swing_assist", "50 %", 10), ("216", " 50% ", 10), ("216", "code:10", 10),
        ("right_swing_assist", "adapt", 21), ("right_swing_assist", "HIGH resist", 23), ("sit_mode", "Normal Lean", 1),
        ("Sit", "normal-lean", 1), ("walk_mode", "prostep+", 3), ("Walk", "ProStep", 2), ("walk_mode", "1", 1),
        ("injury_mode", "2free", 3), ("injury_mode", "2", 2), ("left_stance_support", "code:5", 5), ("lean", "", None),
    ],
)  # fmt: skip
def test_typed_values(name: str, text: str, raw: int | None) -> None:
    if raw is None:
        with pytest.raises(UsageError):
            EKSO.find(name)
        return
    param, _ = EKSO.find(name)
    assert param.to_raw(param.parse(text)) == raw
    ((element, value),) = EKSO.assignments([f"{name}={text}"])
    assert (element.param.name, param.to_raw(value)) == (param.name, raw)


@each_row(
    ("text", "code", "says"),
    [
        ("swing_time=0.295", "not-exact", "0.29 or 0.30"), ("forward_shift=-0.755", "not-exact", "-0.76 or -0.75"),
        ("forward_shift=327.68", "out-of-range", "-327.68..327.67"), ("lateral_shift=-327.69", "out-of-range", ""),
        ("lateral_shift=-328.00", "out-of-range", ""), ("step_length=-0.01", "out-of-range", "0..655.35"),
        ("step_length=655.36", "out-of-range", ""), ("step_length=nan", "not-a-number", ""),
        ("step_length=inf", "not-a-number", ""), ("step_length=", "not-a-number", ""), ("step_length=1_0", "not-a-number", ""),
        ("step_length=fast", "not-a-number", ""), ("step_length=1e40", "not-a-number", ""),
        ("left_swing_assist=50", "ambiguous", "50 %"), ("left_swing_assist=code:28", "out-of-range", "27 = High Assist"),
        ("left_swing_assist=53 %", "not-a-number", ""), ("left_swing_assist=High", "not-a-number", ""),
        *((f"left_swing_assist={text}", "not-a-number", "") for text in ("7,5 %", "-75 %", "1/5 %", "7 5%", "50 %%", "50 % up")),
        ("-202=15", "unknown-name", ""), ("2-02=15", "unknown-name", ""), ("step_length=\u0661\u0665", "not-a-number", ""),
        ("walk_mode=4", "out-of-range", "3 = ProStep+"), ("walk_mode=-1", "not-a-number", ""),
        ("walk_mode=1.0", "not-a-number", ""), ("swing_complete=1", "read-only", ""), ("PilotID=3", "read-only", ""),
        ("torso_pitch=1", "read-only", ""), ("steps_taken=0", "read-only", ""), ("199=1", "unknown-name", "200 to 219"),
        ("220=1", "unknown-name", ""), ("step_lenght=1", "unknown-name", "step_length"), ("step_length", "usage", ""),
    ],
)  # fmt: skip
def test_what_is_refused(text: str, code: str, says: str) -> None:
    with pytest.raises(UsageError) as caught:
        EKSO.assignments([text])
    assert caught.value.code == code
    assert says in caught.value.hint


def test_read_only_tells_why() -> None:
    with refused(UsageError, "read-only"):
        EKSO.assignments(["Swing Complete=1"])


def test_every_name_of_the_manual_finds_its_word() -> None:
    for message, text in MANUAL.items():
        for word, row in enumerate(text.split("|")):
            name = row.rpartition(" ")[0]
            if "BootTime" in name and message == "feedback":
                continue
            param, elements = EKSO.find(name)
            assert (param.message, param.word, len(elements)) == (message, word, 1)
    assert EKSO.find("MinGain, left")[0].name == "left_max_forward_assist"
    assert EKSO.find("thigh_length")[0].id == 200
    assert EKSO.find("219")[0].name == "right_stance_support"


def test_codes_that_nobody_knows_stay_numbers() -> None:
    for param in SETTINGS:
        if param.choices:
            assert param.label(17 if len(param.choices) < 10 else 28) == (
                "unknown (17)" if len(param.choices) < 10 else "unknown (28)"
            )
            param.check(61440)
    assert EKSO["left_swing_assist"].label(10) == "50 %"
    assert EKSO["swing_complete"].label(4) == "0.5"
    with pytest.raises(UsageError):
        EKSO["walk_mode"].check(65536)
    with pytest.raises(UsageError):
        EKSO["step_length"].check(15.505)


@each_row(
    ("state", "text"),
    [
        (0x1040, "sitting (0x1040)"), (0x2040, "standing (0x2040)"), (0x3040, "rising or sitting down (0x3040)"),
        (0x3440, "rising or sitting down, moving (0x3440)"), (0x4440, "unknown (0x4440)"), (0, "unknown (0x0000)"),
        (0xF00F, "unknown (0xF00F)"),
    ],
)  # fmt: skip
def test_states(state: int, text: str) -> None:
    assert state_text(state) == text
    assert EKSO["state"].label(state) == text


def test_boot_time() -> None:
    assert boot_ms([0x1A99, 0x1B9A]) == 446_241_690
    assert boot_ms([-3671, -3654]) == boot_ms([0xF1A9, 0xF1BA]) == 4_054_446_522
    assert boot_text(5_000_001) == "1 h 23 m 20.001 s"


@each_row(
    ("pitch", "hip_angle", "knee", "x", "y"),
    [(-10, 78, 103, -101, 2005), (20.8, 68, 54, -78, 3144), (5.8, -1, 0, 67, 3677), (4.5, 22.1, 8.4, -49, 3600)],
)
def test_kinematics_at_the_check_points(pitch: float, hip_angle: float, knee: float, x: int, y: int) -> None:
    got = hip(17, 16, pitch, hip_angle, knee)
    assert (round(got[0] * 10), round(got[1] * 100)) == (x, y)
    values = {"torso_pitch": pitch}
    for side in ("left", "right"):
        values |= {f"{side}_hip_angle": hip_angle, f"{side}_knee_angle": knee, f"{side}_hip_x": x / 10, f"{side}_hip_y": y / 100 + (side == "right")}  # fmt: skip
    found = residuals(values, 17, 16)
    assert abs(found["left"][0]) < 0.06
    assert abs(found["left"][1]) < 0.01
    assert abs(found["right"][1] - 1) < 0.01
