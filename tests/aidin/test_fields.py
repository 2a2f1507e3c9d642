"""The book of the AIDIN-hand against the manual's list of ranges, and the way of an angle to the wire."""

from __future__ import annotations

from math import radians

import pytest

from handctl.devices.aidin.parameter_map import (
    AIDIN,
    ANGLES,
    CURRENTS,
    ENCODERS,
    FEEDBACK,
    TIPS,
    AidinParam,
    Mode,
    Target,
)
from handctl.errors import UsageError
from tests.support.each_row import each_row

MODES = {1: "HOMING", 2: "INITIAL", 3: "STOP", 4: "BIAS", 5: "MAXTORQUE", 10: "ENCODER", 22: "JOINT", 32: "TASKSPACE", 41: "CURRENT"}  # fmt: skip
RANGES = {  # manual, last list: (thumb), (others)
    "m1": ((0, 280000), (0, 440000)), "m2": ((0, 280000), (0, 440000)), "m3": ((0, 210000), (0, 170000)),
    "q1": ((-13, 45), (-45, 45)), "q2": ((-30, 30), (-30, 30)), "q3": ((82, 154), (115, 175)),
    "x": ((-51, 51), (-51, 51)), "y": ((45.5, 115.7), (2.6, 100)), "z": ((13, 146.7), (0, 149.5)),
}  # fmt: skip
KEYS = {  # key: (type, elements of a finger)
    "motor_pos": ("int32[15]", "m1 m2 m3"), "joint_pos": ("double[20]", "q1 q2 q3 q4"),
    "task_space_pos": ("double[15]", "x y z"), "current_state": ("int16[15]", "m1 m2 m3"),
    "sensor_state": ("double[30]", "fx fy fz tx ty tz"), "hand_TP_cmd": ("int32[15]", "m1 m2 m3"),
    "hand_joint_cmd": ("double[20]", "q1 q2 q3 q4"), "hand_taskspace_cmd": ("double[15]", "x y z"),
    "hand_TT_cmd": ("int32[15]", "m1 m2 m3"),
}  # fmt: skip
WIRE = {  # dossier 4: degrees -> radians at 6 decimals, one step inward where rounding leads out
    ("thumb.q1", -13): -0.226892, ("thumb.q1", 45): 0.785398, ("index.q1", -45): -0.785398, ("ring.q2", -30): -0.523598,
    ("thumb.q2", 30): 0.523598, ("thumb.q3", 82): 1.431170, ("thumb.q3", 154): 2.687807, ("little.q3", 115): 2.007129,
    ("middle.q3", 175): 3.054326, ("index.q1", 0): 0.0, ("thumb.q1", 10): 0.174533,
}  # fmt: skip


def test_modes() -> None:
    assert {int(mode): mode.name for mode in Mode} == MODES
    assert set(AIDIN["hand_mode"].choices) == set(MODES)


@each_row("key", KEYS)
def test_arrays(key: str) -> None:
    param = AIDIN[key.lower()]
    kind, labels = KEYS[key]
    assert (param.key, param.type_name, " ".join(param.labels)) == (key, kind, labels)
    wanted = [
        f"{finger}.{label}" for finger in ("thumb", "index", "middle", "ring", "little") for label in labels.split()
    ]
    assert list(param.elements) == wanted
    assert [f"{param.finger_of(i)}.{param.label_of(i)}" for i in range(param.count)] == wanted


def test_feedback_can_be_read_and_commands_cannot() -> None:
    assert [param.key for param in FEEDBACK] == list(KEYS)[:5]
    assert [param.key for param in AIDIN if not param.readable] == ["hand_mode", "maxtorque", *list(KEYS)[5:]]
    assert not any(param.writable for param in AIDIN)


@each_row("target", [ENCODERS, ANGLES, TIPS], ids=lambda target: target.mode.name)
def test_limits_by_finger(target: Target) -> None:
    for param in (target.command, target.feedback):
        for index in range(param.count):
            both = RANGES.get(param.label_of(index))
            assert param.limit(index) == (None if both is None else both[0 if index < len(param.labels) else 1])


@each_row(("place", "wire"), WIRE.items(), ids=str)
def test_angles_on_the_wire(place: tuple[str, float], wire: float) -> None:
    param = ANGLES.command
    index = param.elements.index(place[0])
    assert param.to_wire(index, place[1]) == wire
    limit = param.limit(index)
    assert limit is not None
    assert radians(limit[0]) <= wire <= radians(limit[1])
    assert param.from_wire(wire) == pytest.approx(place[1], abs=1e-4)


def test_every_angle_within_the_limits_stays_within_on_the_wire() -> None:
    param = ANGLES.command
    for index in range(param.count):
        limit = param.limit(index)
        if limit is not None:
            for tenth in range(round(limit[0] * 10), round(limit[1] * 10) + 1):
                assert radians(limit[0]) <= param.to_wire(index, tenth / 10) <= radians(limit[1])


def test_parts_of_an_array() -> None:
    def names(text: str) -> list[str]:
        return [element.full_name for element in AIDIN.find(text)[1]]

    assert len(names("sensor_state")) == 30
    assert names("joint_pos.index") == [f"joint_pos.index.q{n}" for n in (1, 2, 3, 4)]
    assert names("motor_pos.m3") == [f"motor_pos.{f}.m3" for f in ("thumb", "index", "middle", "ring", "little")]
    assert names("task_space_pos.ring.z") == ["task_space_pos.ring.z"]
    assert names("hand_TP_cmd.thumb.m1") == ["hand_tp_cmd.thumb.m1"]
    for wrong in ("joint_pos.m1", "joint_pos.pinky", "joint_pos.index.", "joint_pos.", "joint", "maxtorque.x"):
        with pytest.raises(UsageError):
            AIDIN.find(wrong)


def test_speeds_and_tolerances() -> None:
    """Dossier 3: 60 deg/s, 60 mm/s, 20 % of stroke a second; 2 deg, 2 mm, 1 % of stroke; 200 a second."""
    assert (ANGLES.per_second(4), ANGLES.near(4), TIPS.per_second(1), TIPS.near(1)) == (60, 2, 60, 2)
    assert (ENCODERS.per_second(0), ENCODERS.near(0)) == (56000, 2800)
    assert (ENCODERS.per_second(3), ENCODERS.near(3)) == (88000, 4400)
    assert CURRENTS.per_second(0) == 200


def test_every_quantity_says_where_it_comes_from() -> None:
    for param in AIDIN:
        assert isinstance(param, AidinParam)
        assert param.doc and param.source.startswith("aidin, ")
