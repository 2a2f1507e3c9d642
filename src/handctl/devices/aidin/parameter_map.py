"""The map of the AIDIN-hand: JSON keys, their elements by finger, units, ranges, modes. Knows no bytes and no link.

Every array is ordered thumb, index, middle, ring, little (aidin, Command keys and Feedback keys). Angles are radians on
the wire and degrees everywhere else, as in the manual's ranges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from functools import cache, cached_property
from math import degrees, inf, nextafter, radians
from typing import Any

from handctl.errors import UsageError
from handctl.fast_classes import fast_dataclass, field
from handctl.model.param import COMMAND, MOVES, PUSHES, SETTING, TRIGGER, Element, Number, Param, ParamMap

FINGERS = ("thumb", "index", "middle", "ring", "little")
Range = tuple[float, float]


class Mode(IntEnum):
    """`hand_mode` (aidin, Modes). Others are not documented and never sent."""

    HOMING = 1
    INITIAL = 2
    STOP = 3
    BIAS = 4
    MAXTORQUE = 5
    ENCODER = 10
    JOINT = 22
    TASKSPACE = 32
    CURRENT = 41


MOST_RADIANS = radians(nextafter(inf, 0.0))
"""The largest angle whose degrees are finite."""
LARGEST_RADIAN = 6.3
"""An angle beyond this is none in radians (possibly degrees)."""


@fast_dataclass(frozen=True, kw_only=True)
class AidinParam(Param):
    """A Param with its JSON key.

    key     as it stands on the wire, case sensitive; the name is the same in lower case
    labels  elements of one finger, in wire order
    limits  label -> documented range of the thumb and of the other fingers, in `unit`; a label may have none
    int_range  range of the integer type on the wire, None for double
    angles  radians on the wire, degrees here
    places  decimals that people see
    """

    key: str
    labels: tuple[str, ...] = ()
    limits: Mapping[str, tuple[Range, Range]] = field(default_factory=dict)
    int_range: tuple[int, int] | None = None
    angles: bool = False
    places: int = 0

    @property
    def address(self) -> str:
        """Its key in an object."""
        return self.key

    @property
    def type_name(self) -> str:
        """The manual's data type, e.g. ``int32[15]``."""
        names = {None: "double", UINT16: "uint16", INT16: "int16", INT32: "int32"}
        return names[self.int_range] + (f"[{self.count}]" if self.elements else "")

    @property
    def range_text(self) -> str:
        """``thumb m1 0..280000, others 0..440000; …``"""
        if not self.limits:
            return super().range_text
        return "; ".join(f"{label} {both_ranges(ranges)}" for label, ranges in self.limits.items())

    def finger_of(self, index: int) -> str:
        """The finger of element `index`."""
        return FINGERS[index // len(self.labels)]

    def label_of(self, index: int) -> str:
        """The element within its finger: m1, q3, x, fz …"""
        return self.labels[index % len(self.labels)]

    def limit(self, index: int) -> Range | None:
        """The documented range of element `index` in `unit`, None where there is none."""
        both = self.limits.get(self.label_of(index)) if self.labels else None
        return None if both is None else both[0 if self.finger_of(index) == "thumb" else 1]

    @cached_property
    def most_on_wire(self) -> float:
        """The largest number on the wire that is still one in `unit`."""
        return MOST_RADIANS if self.angles else inf

    def from_wire(self, number: Number) -> Number:
        """The value in `unit`; degrees to 4 decimals, which is finer than the wire's 6 decimals of a radian."""
        return round(degrees(number), 4) if self.angles else number

    def to_wire(self, index: int, value: Number) -> Number:
        """The number on the wire of a checked value: angles in radians to 6 decimals, mm to 3.

        Rounding may lead a hair out of the range (30 deg is 0.5235987…, rounded 0.523599): then one step inward.
        """
        if self.int_range is not None:
            return int(value)
        if not self.angles:
            return round(float(value), 3)
        number = round(radians(value), 6)
        limit = self.limit(index)
        if limit is not None and number > radians(limit[1]):
            number = round(number - 1e-6, 6)
        elif limit is not None and number < radians(limit[0]):
            number = round(number + 1e-6, 6)
        return number


def both_ranges(ranges: tuple[Range, Range]) -> str:
    """``82..154 (thumb), 115..175 (others)``, or one range when they are the same."""
    thumb, others = (f"{low:g}..{high:g}" if high < 1e5 else f"{low:.0f}..{high:.0f}" for low, high in ranges)
    return thumb if thumb == others else f"{thumb} (thumb), {others} (others)"


UINT16, INT16, INT32 = (0, 65535), (-32768, 32767), (-(1 << 31), (1 << 31) - 1)
MOTORS, JOINTS, AXES = ("m1", "m2", "m3"), ("q1", "q2", "q3", "q4"), ("x", "y", "z")
SENSORS = ("fx", "fy", "fz", "tx", "ty", "tz")
MOTOR_LIMITS: dict[str, tuple[Range, Range]] = {
    "m1": ((0, 280000), (0, 440000)),
    "m2": ((0, 280000), (0, 440000)),
    "m3": ((0, 210000), (0, 170000)),
}
JOINT_LIMITS: dict[str, tuple[Range, Range]] = {
    "q1": ((-13, 45), (-45, 45)),
    "q2": ((-30, 30), (-30, 30)),
    "q3": ((82, 154), (115, 175)),
}
TIP_LIMITS: dict[str, tuple[Range, Range]] = {
    "x": ((-51, 51), (-51, 51)),
    "y": ((45.5, 115.7), (2.6, 100)),
    "z": ((13, 146.7), (0, 149.5)),
}
CURRENT_LIMITS: dict[str, tuple[Range, Range]] = dict.fromkeys(MOTORS, ((-1000, 1000), (-1000, 1000)))
MODES: dict[Number, str] = {
    Mode.HOMING: "homing, held for 3 s",
    Mode.INITIAL: "initial position",
    Mode.STOP: "stop, motor power off",
    Mode.BIAS: "sensor bias",
    Mode.MAXTORQUE: "maxtorque setup",
    Mode.ENCODER: "encoder position",
    Mode.JOINT: "joint angle",
    Mode.TASKSPACE: "taskspace",
    Mode.CURRENT: "current",
}
CURRENT_NOTE = "unit and range are not in the manual, per mille of the rated current is likely"
SENSOR_NOTE = "unit is not in the manual, N and N m are likely"
FRAME_NOTE = "in each finger's own frame, by the ranges, the manual's figures are missing"
COUPLED_NOTE = "q4 is coupled to q3: only q3 counts"


def _array(key: str, doc: str, source: str, labels: tuple[str, ...], **more: Any) -> AidinParam:
    elements = tuple(f"{finger}.{label}" for finger in FINGERS for label in labels)
    return AidinParam(
        key=key, name=key.lower(), doc=doc, source=f"aidin, {source}", labels=labels, elements=elements, **more
    )


def _command(key: str, verb: str, doc: str, labels: tuple[str, ...], **more: Any) -> AidinParam:
    more = {"access": "w", "kind": COMMAND, "verb": verb, "acts": MOVES, **more}
    return _array(key, doc, "Command keys", labels, **more)


class AidinMap(ParamMap[AidinParam]):
    """The book, with parts of an array by finger (`joint_pos.index`), by element (`joint_pos.q3`) or both."""

    def find(self, name: str) -> tuple[AidinParam, Sequence[Element]]:
        """``joint_pos.index`` -> the four of that finger. Raises UsageError with what there is."""
        base, dot, part = name.partition(".")
        base = base.lower()
        if base not in self or not dot or not self[base].labels:
            return super().find(base + dot + part)
        param = self[base]
        chosen = [
            element
            for element in param.each
            if part in (element.part, param.finger_of(element.index), param.label_of(element.index))
        ]
        if not chosen:
            raise UsageError(
                f"{base} has no part {part!r}",
                hint=f"use a finger ({', '.join(FINGERS)}), an element ({', '.join(param.labels)}), or both: "
                f"{base}.index.{param.labels[0]}",
                code="unknown-name",
            )
        return param, chosen


AIDIN = AidinMap("aidin", [
    _array("motor_pos", "motor encoders, 0 where homing left them", "Feedback keys", MOTORS, unit="cts", limits=MOTOR_LIMITS, int_range=INT32),
    _array("joint_pos", "joint angles", "Feedback keys", JOINTS, unit="deg", limits=JOINT_LIMITS, angles=True, places=1, note=COUPLED_NOTE),
    _array("task_space_pos", "fingertip coordinates", "Feedback keys", AXES, unit="mm", limits=TIP_LIMITS, places=1, note=FRAME_NOTE),
    _array("current_state", "motor currents", "Feedback keys", MOTORS, int_range=INT16, note=CURRENT_NOTE),
    _array("sensor_state", "fingertip forces and torques", "Feedback keys", SENSORS, places=5, note=SENSOR_NOTE),
    AidinParam(key="hand_mode", name="hand_mode", doc="operating mode", source="aidin, Modes", int_range=UINT16, choices=MODES, access="w", kind=TRIGGER, verb="home, initial, stop, bias …", acts=MOVES),
    AidinParam(key="maxtorque", name="maxtorque", doc="maximum current, 700 to 1000 recommended", source="aidin, Modes", unit="0.1 %", low=0, high=1000, int_range=UINT16, access="w", kind=SETTING, verb="max-torque", persistent="unknown"),
    _command("hand_TP_cmd", "encoders", "encoder targets", MOTORS, unit="cts", limits=MOTOR_LIMITS, int_range=INT32),
    _command("hand_joint_cmd", "joints", "joint angle targets", JOINTS, unit="deg", limits=JOINT_LIMITS, angles=True, places=1, note=COUPLED_NOTE),
    _command("hand_taskspace_cmd", "fingertips", "fingertip targets", AXES, unit="mm", limits=TIP_LIMITS, places=1, note=FRAME_NOTE),
    _command("hand_TT_cmd", "currents", "motor current targets", MOTORS, limits=CURRENT_LIMITS, int_range=INT32, acts=PUSHES, note=CURRENT_NOTE),
])  # fmt: skip
"""Feedback first, then commands."""

FEEDBACK = tuple(param for param in AIDIN if param.readable)
"""The five keys that the hand sends."""
MOTOR_POS = AIDIN["motor_pos"]
STILL = 0.001
"""Share of a stroke that a motor may change from one look to the next and still stand."""


@cache
def stroke(index: int) -> float:
    """The counts of a motor from open to closed."""
    limit = MOTOR_POS.limit(index)
    assert limit is not None
    return limit[1] - limit[0]


def moving(before: Sequence[Number] | None, now: Sequence[Number]) -> list[int]:
    """Motors whose encoder has changed by more than jitter; all of them without a look before."""
    if before is None:
        return list(range(len(now)))
    return [i for i, (a, b) in enumerate(zip(before, now, strict=True)) if abs(b - a) > stroke(i) * STILL]


@fast_dataclass(frozen=True)
class Target:
    """A kind of target: its mode, what is commanded and what shows that it was reached.

    speed      units a second of the ramp; a share of the range where `relative`
    tolerance  how near is there, likewise
    """

    mode: Mode
    command: AidinParam
    feedback: AidinParam
    speed: float
    tolerance: float
    relative: bool = False

    def per_second(self, index: int) -> float:
        """Units a second of the ramp for element `index`."""
        return self.speed * self._scale(index)

    def near(self, index: int) -> float:
        """How far from the target element `index` may be and count as there."""
        return self.tolerance * self._scale(index)

    def _scale(self, index: int) -> float:
        limit = self.command.limit(index)
        return limit[1] - limit[0] if self.relative and limit is not None else 1.0


ENCODERS = Target(Mode.ENCODER, AIDIN["hand_tp_cmd"], AIDIN["motor_pos"], 0.2, 0.01, relative=True)
ANGLES = Target(Mode.JOINT, AIDIN["hand_joint_cmd"], AIDIN["joint_pos"], 60.0, 2.0)
TIPS = Target(Mode.TASKSPACE, AIDIN["hand_taskspace_cmd"], AIDIN["task_space_pos"], 60.0, 2.0)
CURRENTS = Target(Mode.CURRENT, AIDIN["hand_tt_cmd"], AIDIN["current_state"], 200.0, 20.0)
