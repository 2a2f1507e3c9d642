"""The book of the AIDIN-hand says the same as its simulator, which was made from the manual by itself.

The simulator is asked through bytes only; the objects are put together by hand here.
"""

from __future__ import annotations

import json
from math import radians
from typing import Any

import pytest

from handctl.devices.aidin.parameter_map import AIDIN, FEEDBACK, FINGERS, MODES, AidinParam, Mode
from handctl.sim import create
from tests.support.each_row import each_row

TARGETS = [pytest.param(AIDIN[name], mode, told, id=name) for name, mode, told in (
    ("hand_tp_cmd", 10, "motor_pos"), ("hand_joint_cmd", 22, "joint_pos"), ("hand_taskspace_cmd", 32, "task_space_pos"),
)]  # fmt: skip


class Simulated:
    """A simulated hand that is homed and answers each object."""

    def __init__(self, **options: str) -> None:
        self.line = create("aidin", {"exchange": "poll", "start": "open", **options})
        self.now = 0.0
        self.line.advance(0.0)

    def ask(self, content: dict[str, Any]) -> dict[str, Any]:
        """The feedback that answers an object."""
        self.line.feed(json.dumps(content).encode() + b"\n")
        return dict(json.loads(self.line.take()))

    def after(self, seconds: float) -> dict[str, Any]:
        """Feedback when some time has passed."""
        self.now += seconds
        self.line.advance(self.now)
        return self.ask({})


def middle(param: AidinParam) -> list[float]:
    """A vector in the middle of all ranges, as on the wire; q4 goes with q3."""
    values: list[float] = []
    for index in range(param.count):
        limit = param.limit(index)
        values.append(param.to_wire(index, round(sum(limit) / 2)) if limit is not None else values[-1])
    return values


def test_both_have_the_same_feedback() -> None:
    told = Simulated().ask({})
    assert {key: len(values) for key, values in told.items()} == {param.key: param.count for param in FEEDBACK}
    for param in FEEDBACK:
        assert all(isinstance(value, int) == (param.int_range is not None) for value in told[param.key]), param.key


@each_row("finger", range(5), ids=FINGERS)
@each_row(("param", "mode", "told"), TARGETS)
def test_both_count_the_elements_of_a_finger_alike(param: AidinParam, mode: int, told: str, finger: int) -> None:
    """What is commanded at an index of one finger arrives at that index, and nowhere else."""
    hand = Simulated()
    before = hand.ask({"hand_mode": mode, param.key: middle(param)}) and hand.after(4.0)[told]
    size = len(param.labels)
    changed = middle(param)
    index = finger * size + param.labels.index({"motor_pos": "m3", "joint_pos": "q3", "task_space_pos": "z"}[told])
    low, high = param.limit(index) or (0, 0)
    changed[index] = param.to_wire(index, round(low + (high - low) * 0.6))
    hand.ask({"hand_mode": mode, param.key: changed})
    after = hand.after(4.0)[told]
    moved = {n for n, (a, b) in enumerate(zip(before, after, strict=True)) if abs(a - b) > 0.01 * (abs(a) + 1)}
    assert index in moved and {n // size for n in moved} == {finger}
    assert after[index] == pytest.approx(changed[index], rel=0.01)
    assert param.finger_of(index) == FINGERS[finger]


def edges() -> list[object]:
    """Every documented end of every range, thumb and index."""
    found = []
    for param, mode, _ in (case.values for case in TARGETS):
        assert isinstance(param, AidinParam)
        for index in range(2 * len(param.labels)):
            for end in range(2) if param.limit(index) is not None else ():
                name = f"{param.elements[index]}-{'high' if end else 'low'}"
                found.append(pytest.param(param, mode, index, end, id=name))
    return found


@each_row(("param", "mode", "index", "end"), edges())
def test_both_have_the_same_limits(param: AidinParam, mode: int, index: int, end: int) -> None:
    """At the limit the hand takes the object, beyond it ignores it; the host would not send the latter."""
    limit = param.limit(index)
    assert limit is not None
    hand = Simulated()
    hand.ask({"hand_mode": mode, param.key: middle(param)})
    rest = hand.after(4.0)["motor_pos"]
    values = middle(param)
    beyond = limit[end] + (1 if end else -1) * (1 if param.int_range else 0.2)
    values[index] = int(beyond) if param.int_range else radians(beyond) if param.angles else beyond
    hand.ask({"hand_mode": mode, param.key: values})
    assert hand.after(0.5)["motor_pos"] == rest
    values[index] = param.to_wire(index, limit[end])
    hand.ask({"hand_mode": mode, param.key: values})
    assert hand.after(0.5)["motor_pos"] != rest


@each_row(("value", "taken"), [(0, True), (1000, True), (1001, False), (-1, False)])
def test_both_have_the_same_range_of_maxtorque(value: int, taken: bool) -> None:
    """Without torque nothing moves: 0 set before shows whether the value was taken."""
    assert AIDIN["maxtorque"].allowed(value) is taken
    param = AIDIN["hand_tp_cmd"]
    hand = Simulated(load="0")
    hand.ask({"hand_mode": 5, "maxtorque": 1000 if value == 0 else 0})
    hand.ask({"hand_mode": 5, "maxtorque": value})
    hand.ask({"hand_mode": 10, param.key: middle(param)})
    moves = any(hand.after(0.5)["motor_pos"])
    assert moves is (taken and value > 0)


def test_both_have_the_same_modes() -> None:
    assert {*MODES} == {*Mode} == {1, 2, 3, 4, 5, 10, 22, 32, 41}


def test_both_have_the_same_currents() -> None:
    param = AIDIN["hand_tt_cmd"]
    for index in (0, 5, 14):
        hand = Simulated()
        values = [0] * param.count
        values[index] = 300
        hand.ask({"hand_mode": 5, "maxtorque": 1000})
        hand.ask({"hand_mode": 41, param.key: values})
        told = hand.after(0.3)["current_state"]
        assert max(range(param.count), key=lambda n: abs(told[n])) == index
