"""The simulated AIDIN-hand on virtual time: messages, modes, homing, motion, currents, forces, control, state."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from handctl.sim import create
from handctl.sim.engine.line_and_faults import Line
from tests.support.each_row import each_row

NEUTRAL = "{}"
HOMING = '{"hand_mode":1}'
INITIAL = '{"hand_mode":2}'
STOP = '{"hand_mode":3}'
BIAS = '{"hand_mode":4}'
MAXTORQUE_800 = '{"hand_mode":5,"maxtorque":800}'
ENCODERS = (
    '{"hand_mode":10,"hand_TP_cmd":[140000,140000,105000,220000,220000,85000,220000,220000,85000,220000,220000,85000,'
    "220000,220000,85000]}"
)
JOINTS = (
    '{"hand_mode":22,"hand_joint_cmd":[0.174533,0.087266,2.059489,2.059489,-0.069813,0.087266,2.879793,2.879793,0.0,'
    "0.087266,2.879793,2.879793,0.069813,0.087266,2.879793,2.879793,0.139626,0.087266,2.879793,2.879793]}"
)
ZERO_JOINTS = '{"hand_mode":22,"hand_joint_cmd":[' + ",".join(["0.0"] * 20) + "]}"
FINGERTIPS = (
    '{"hand_mode":32,"hand_taskspace_cmd":[0.0,80.0,90.0,0.0,50.0,120.0,0.0,50.0,120.0,0.0,50.0,120.0,0.0,50.0,120.0]}'
)
CURRENTS = '{"hand_mode":41,"hand_TT_cmd":[100,100,50,100,100,50,100,100,50,100,100,50,100,100,50]}'
MAXTORQUE_1000 = '{"hand_mode":5,"maxtorque":1000}'
OPEN = (
    '{"motor_pos":[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0],"joint_pos":[-0.226893,0.0,2.687807,2.687807,-0.785398,0.0,3.054326,'
    "3.054326,-0.785398,0.0,3.054326,3.054326,-0.785398,0.0,3.054326,3.054326,-0.785398,0.0,3.054326,3.054326],"
    '"task_space_pos":[0.0,45.5,146.7,0.0,2.6,149.5,0.0,2.6,149.5,0.0,2.6,149.5,0.0,2.6,149.5],"current_state":[0,0,0,'
    '0,0,0,0,0,0,0,0,0,0,0,0],"sensor_state":[0.02,-0.01,0.35,0.0004,-0.0002,0.0001,0.02,-0.01,0.35,0.0004,-0.0002,'
    "0.0001,0.02,-0.01,0.35,0.0004,-0.0002,0.0001,0.02,-0.01,0.35,0.0004,-0.0002,0.0001,0.02,-0.01,0.35,0.0004,-0.0002,"
    "0.0001]}\n"
)
MIDDLE = (
    '{"motor_pos":[140000,140000,105000,220000,220000,85000,220000,220000,85000,220000,220000,85000,220000,220000,85000],'
    '"joint_pos":[0.279253,0.0,2.059489,2.059489,0.0,0.0,2.530727,2.530727,0.0,0.0,2.530727,2.530727,0.0,0.0,2.530727,'
    '2.530727,0.0,0.0,2.530727,2.530727],"task_space_pos":[0.0,80.6,79.85,0.0,51.3,74.75,0.0,51.3,74.75,0.0,51.3,74.75,'
    '0.0,51.3,74.75],"current_state":[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0],"sensor_state":[0.02,-0.01,0.35,0.0004,-0.0002,'
    "0.0001,0.02,-0.01,0.35,0.0004,-0.0002,0.0001,0.02,-0.01,0.35,0.0004,-0.0002,0.0001,0.02,-0.01,0.35,0.0004,-0.0002,"
    "0.0001,0.02,-0.01,0.35,0.0004,-0.0002,0.0001]}\n"
)
REACHED = (
    '{"motor_pos":[134368,87701,105000,237111,163778,28333,256667,183333,28333,276222,202889,28333,295778,222444,28333],'
    '"joint_pos":[0.174533,0.087267,2.059489,2.059489,-0.069813,0.087266,2.879795,2.879795,0.0,0.087267,2.879795,2.879795,'
    "0.069813,0.087266,2.879795,2.879795,0.139626,0.087267,2.879795,2.879795],"
    '"task_space_pos":[8.5,73.338,79.85,8.5,46.971,124.584,8.5,51.3,124.584,8.5,55.629,124.584,8.5,59.958,124.584],'
    '"current_state":[12,-8,30,5,-4,11,5,-4,11,5,-4,11,5,-4,11],"sensor_state":[0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,'
    "0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0]}\n"
)
READINGS = [
    70110, 61220, 52330, 110440, 100550, 41660, 150770, 170880, 30990, 220115, 190225, 60335, 201445, 240555, 70665,
]  # fmt: skip
STROKES = [280000, 280000, 210000, *[440000, 440000, 170000] * 4]
SIZES = {"motor_pos": 15, "joint_pos": 20, "task_space_pos": 15, "current_state": 15, "sensor_state": 30}


class Bench:
    """A line on virtual time, polled; options as in a link, with _ for -."""

    def __init__(self, **options: object) -> None:
        raw = {name.replace("_", "-"): str(value) for name, value in {"exchange": "poll", **options}.items()}
        self.line: Line = create("aidin", raw)
        self.now = 0.0
        self.line.advance(0.0)

    def ask(self, text: str | bytes) -> str:
        self.line.feed(text.encode() if isinstance(text, str) else text)
        return self.heard()

    def heard(self) -> str:
        return self.line.take().decode()

    def wait(self, seconds: float) -> str:
        self.now += seconds
        self.line.advance(self.now)
        return self.heard()

    def hold(self, text: str, seconds: float, period: float = 0.02) -> None:
        """Repeats one object, as a host does that holds a mode; the last one is sent at the end."""
        for _ in range(round(seconds / period)):
            self.ask(text)
            self.wait(period)
        self.ask(text)

    def look(self) -> dict[str, Any]:
        """Feedback for a neutral object."""
        return dict(json.loads(self.ask(NEUTRAL)))

    def state(self) -> str:
        return self.line.command("state")


def command(mode: int, **data: object) -> str:
    return json.dumps({"hand_mode": mode, **data})


# -- the messages of the dossier and the manual -----------------------------------------------------------------------


def test_neutral_poll_of_an_open_hand() -> None:
    assert Bench(start="open").ask(NEUTRAL) == OPEN


def test_encoder_command_to_the_middle() -> None:
    bench = Bench(start="open", load=0)
    at_once = json.loads(bench.ask(ENCODERS))  # of this moment: the current is there, nothing has moved yet
    assert at_once == {**json.loads(OPEN), "current_state": [400] * 15}
    bench.wait(5.0)
    assert bench.ask(NEUTRAL) == MIDDLE


def test_joint_command_reached_after_bias() -> None:
    """The feedback is that of the exact angles; six decimals of a radian are worth up to one count."""
    degrees = [10, 5, 118, 118, -4, 5, 165, 165, 0, 5, 165, 165, 4, 5, 165, 165, 8, 5, 165, 165]
    bench = Bench(start="open")
    bench.ask(BIAS)
    bench.ask(command(22, hand_joint_cmd=[math.radians(degree) for degree in degrees]))
    bench.wait(5.0)
    assert bench.ask(NEUTRAL) == REACHED
    bench.ask(JOINTS)
    bench.wait(5.0)
    assert bench.look()["motor_pos"] == pytest.approx(json.loads(REACHED)["motor_pos"], abs=1.0)


def test_fingertip_command() -> None:
    bench = Bench(start="homed")
    bench.ask(FINGERTIPS)
    bench.wait(5.0)
    tips = bench.look()["task_space_pos"]
    assert tips == pytest.approx([0, 80, 90, *[0, 50, 120] * 4], abs=0.002)


@each_row("exchange", ["stream", "poll", "command", "mute"])
@each_row(
    ("text", "mode"),
    [(INITIAL, 2), (STOP, 3), (BIAS, 4), (MAXTORQUE_800, 5), (ENCODERS, 10), (JOINTS, 22), (FINGERTIPS, 32),
     (CURRENTS, 41), (HOMING, 1), (MAXTORQUE_1000, 5)],
)  # fmt: skip
def test_every_command_is_carried_out_in_every_exchange(exchange: str, text: str, mode: int) -> None:
    bench = Bench(start="homed", exchange=exchange)
    heard = bench.ask(text + "\n")
    torque = 800 if text == MAXTORQUE_800 else 1000
    assert bench.state() == f"mode {mode} homed maxtorque {torque} dropped 0 ignored 0"
    assert (heard != "") == (exchange in ("poll", "command"))
    assert bench.line.requests == 1


def test_command_exchange_needs_a_mode() -> None:
    bench = Bench(exchange="command")
    assert bench.ask(NEUTRAL) == ""
    assert bench.ask('{"maxtorque":800}') == ""
    assert set(json.loads(bench.ask(STOP))) == set(SIZES)


def test_power_on_values_differ() -> None:
    seen = Bench().look()
    assert {key: len(row) for key, row in seen.items()} == SIZES
    assert seen["motor_pos"] == READINGS
    for key, row in seen.items():
        assert len(set(row)) == (15 if key == "joint_pos" else len(row)), key  # q4 equals q3
    assert seen["joint_pos"][2::4] == seen["joint_pos"][3::4]
    assert all(0 <= value <= stroke for value, stroke in zip(seen["motor_pos"], STROKES, strict=True))


# -- the stream -------------------------------------------------------------------------------------------------------


def test_stream_keeps_its_rate_from_power_on() -> None:
    bench = Bench(exchange="stream", rate=50)
    assert bench.wait(0.0199) == ""
    assert set(json.loads(bench.wait(0.0002))) == set(SIZES)
    assert bench.wait(1.0).count("\n") == 50


def test_stream_does_not_wait_for_a_reader_for_ever() -> None:
    bench = Bench(exchange="stream")
    heard = bench.wait(3600.0)
    assert 100 <= heard.count("\n") <= 102
    assert bench.wait(0.1).count("\n") == 10


def test_stream_merged_in_pairs() -> None:
    bench = Bench(exchange="stream", merge=2)
    assert [bench.wait(0.01).count("\n") for _ in range(6)] == [0, 2, 0, 2, 0, 2]


def test_commands_in_a_stream_are_seen_in_it() -> None:
    bench = Bench(exchange="stream", start="open")
    assert bench.ask(ENCODERS) == ""
    assert json.loads(bench.wait(5.0).splitlines()[-1])["motor_pos"] == json.loads(MIDDLE)["motor_pos"]


# -- homing -----------------------------------------------------------------------------------------------------------


def test_homing_takes_three_seconds_of_mode_1() -> None:
    bench = Bench()
    bench.hold(HOMING, 2.96)
    seen = bench.look()["motor_pos"]  # open, but counted from the origin of the power-on
    assert seen[:9] == [-1010, -2020, -3030, -4040, -5050, -6060, -7070, -8080, -9090]
    assert seen[9:] == [-10110, -11120, -12130, -13140, -14150, -15160]
    assert "not homed" in bench.state()
    bench.hold(HOMING, 0.06)
    assert bench.look()["motor_pos"] == [0] * 15
    assert bench.state().startswith("mode 1 homed ")
    bench.hold(HOMING, 0.5)  # held longer than needed
    bench.wait(10.0)
    assert bench.look()["motor_pos"] == [0] * 15
    assert bench.look()["task_space_pos"][:6] == [0.0, 45.5, 146.7, 0.0, 2.6, 149.5]


def test_homing_opens_under_current_at_half_speed() -> None:
    bench = Bench()
    bench.hold(HOMING, 0.1)
    seen = bench.look()
    assert seen["motor_pos"][3] == pytest.approx(110440 - 440000 * 0.5 * 0.1, abs=2)
    assert seen["current_state"][3] == -206


@pytest.mark.parametrize(
    ("interruption", "pause", "options", "homed"),
    [
        pytest.param(STOP, 0.02, {}, False, id="stop"),
        pytest.param(BIAS, 0.02, {}, False, id="bias"),
        pytest.param('{"hand_mode":7}', 0.02, {}, False, id="a mode that is not listed"),
        pytest.param(None, 0.26, {}, False, id="a gap"),
        pytest.param(None, 0.24, {}, True, id="a short gap"),
        pytest.param(None, 0.26, {"homing": "latched"}, True, id="a gap, latched"),
        pytest.param(STOP, 0.02, {"homing": "latched"}, False, id="stop, latched"),
        pytest.param(NEUTRAL, 0.02, {}, True, id="a poll"),
        pytest.param(NEUTRAL, 0.02, {"neutral": "interrupts"}, False, id="a poll that interrupts"),
    ],
)
def test_homing_must_not_be_interrupted(
    interruption: str | None, pause: float, options: dict[str, str], homed: bool
) -> None:
    bench = Bench(**options)
    bench.hold(HOMING, 1.5)
    if interruption is not None:
        bench.ask(interruption)
    bench.wait(pause)
    bench.hold(HOMING, 1.6)
    assert ("not homed" not in bench.state()) is homed
    bench.hold(HOMING, 3.0)
    assert "not homed" not in bench.state()  # held once more


def test_one_object_homes_a_hand_that_latches_its_mode() -> None:
    bench = Bench(homing="latched")
    bench.ask(HOMING)
    bench.wait(2.99)
    assert "not homed" in bench.state()
    bench.wait(0.02)
    assert "not homed" not in bench.state()


def test_interrupted_homing_leaves_motors_off_and_the_old_origin() -> None:
    bench = Bench()
    bench.hold(HOMING, 0.1)
    bench.wait(0.25)
    there = bench.look()
    assert there["current_state"] == [3, -4, 5, -6, 7, -8, 9, -10, 11, -12, 13, -14, 15, -16, 17]
    bench.wait(5.0)
    assert bench.look() == there


def test_too_little_torque_homes_to_a_false_origin() -> None:
    bench = Bench()
    bench.ask(command(5, maxtorque=20))
    bench.hold(HOMING, 3.1)
    assert bench.look()["motor_pos"] == [0] * 15
    assert "not homed" not in bench.state()
    bench.hold(HOMING, 1.0)  # has not let go of the mode: nothing new
    bench.wait(0.3)
    bench.ask(MAXTORQUE_1000)
    bench.hold(HOMING, 1.0)
    assert bench.look()["motor_pos"][3] < -40000


def test_position_modes_before_homing() -> None:
    bench = Bench()
    for text in (INITIAL, ENCODERS, JOINTS, FINGERTIPS):
        bench.ask(text)
    bench.wait(3.0)
    assert bench.look()["motor_pos"] == READINGS
    assert bench.state() == "mode 0 not homed maxtorque 1000 dropped 0 ignored 4"
    bench = Bench(unhomed="obey")
    bench.ask(INITIAL)
    bench.wait(3.0)
    assert bench.look()["motor_pos"] == [0] * 15
    assert "not homed" in bench.state()


# -- modes and data ---------------------------------------------------------------------------------------------------


@each_row(
    "text",
    [
        '{"hand_mode":0}', '{"hand_mode":6}', '{"hand_mode":11}', '{"hand_mode":-1}', '{"hand_mode":2.5}',
        '{"hand_mode":"2"}', '{"hand_mode":null}', '{"hand_mode":true}', '{"hand_mode":[2]}', '{"hand_mode":NaN}',
        '{"hand_mode":1e999}', '{"hand_mode":' + "9" * 400 + "}", '{"hand_mode":5}', '{"hand_mode":5,"maxtorque":1001}',
        '{"hand_mode":5,"maxtorque":-1}', '{"hand_mode":5,"maxtorque":0.5}', '{"hand_mode":5,"maxtorque":[800]}',
        '{"hand_mode":5,"maxtorque":true}', '{"hand_mode":10}', '{"hand_mode":10,"hand_tp_cmd":' + str([5] * 15) + "}",
        command(10, hand_TP_cmd=[0] * 14), command(10, hand_TP_cmd=[0] * 16), command(10, hand_TP_cmd="0" * 15),
        command(10, hand_TP_cmd=[0.5] * 15), command(10, hand_TP_cmd=[280001, *[0] * 14]),
        command(10, hand_TP_cmd=[0] * 5 + [170001] + [0] * 9), command(10, hand_TP_cmd=[-1] + [0] * 14),
        command(10, hand_TP_cmd=[0] * 14 + [None]), command(10, hand_TP_cmd=dict.fromkeys(map(str, range(15)), 0)),
        ZERO_JOINTS, JOINTS.replace("0.174533", "10.0"), JOINTS.replace("0.174533", "-0.226893"),
        JOINTS.replace("0.139626", "NaN"), JOINTS.replace("2.059489,2.059489", "2.059489,Infinity"),
        command(32, hand_taskspace_cmd=[0.0] * 15), FINGERTIPS.replace("80.0", "45.4"),
        CURRENTS.replace("100", "1001"),
    ],
)  # fmt: skip
def test_bad_commands_change_nothing(text: str) -> None:
    bench = Bench(start="homed")
    before = bench.look()
    assert json.loads(bench.ask(text)) == before
    bench.wait(1.0)
    assert bench.look() == before
    assert bench.state() == "mode 0 homed maxtorque 1000 dropped 0 ignored 1"


@each_row("edge", ["-0.226892", "0.785398", repr(math.radians(-13)), repr(math.radians(45))])
def test_limits_themselves_are_inside(edge: str) -> None:
    bench = Bench(start="homed")
    bench.ask(JOINTS.replace("0.174533", edge).replace("0.087266", "0", 1))
    bench.wait(3.0)
    assert bench.look()["joint_pos"][0] == pytest.approx(float(edge), abs=0.00001)


def test_q4_does_not_count() -> None:
    bench = Bench(start="homed", q4="half")
    bench.ask(JOINTS.replace("2.059489,2.059489", "2.059489,0.0").replace("2.879793,2.879793", "2.879793,-9"))
    bench.wait(3.0)
    joints = bench.look()["joint_pos"]
    assert joints[2::4] == pytest.approx([2.059489, *[2.879795] * 4], abs=0.00001)
    assert joints[3] == pytest.approx(math.radians(90 + 118 / 2), abs=0.00001)
    zero = Bench(q4="zero").look()["joint_pos"]
    assert zero[3::4] == [0.0] * 5


@each_row(("policy", "place"), [("clamp", 280000), ("ignore", 70110), ("obey", 280000)])
def test_values_out_of_range(policy: str, place: int) -> None:
    bench = Bench(start="homed", limits=policy)
    bench.ask(command(10, hand_TP_cmd=[500000, *READINGS[1:]]))
    bench.wait(3.0)
    seen = bench.look()
    assert seen["motor_pos"] == [place, *READINGS[1:]]
    # Who obeys pushes against the end of the mechanics.
    assert seen["current_state"][0] == {"clamp": 15, "ignore": 3, "obey": 1000}[policy]


def test_corner_of_the_box_that_cannot_be_reached() -> None:
    """m1 and m2 move q1 and q2 together, so not every pair in the ranges exists."""
    bench = Bench(start="open")
    degrees = [-13, 30, 118, 118, *[0, 0, 165, 165] * 4]
    bench.ask(command(22, hand_joint_cmd=[math.radians(degree) for degree in degrees]))
    bench.wait(5.0)
    seen = bench.look()
    assert seen["motor_pos"][:2] == [140000, 0]
    assert math.degrees(seen["joint_pos"][1]) == pytest.approx(15, abs=0.01)
    assert seen["current_state"][:3] == [12, -1000, 30]


def test_stop_frees_the_fingers() -> None:
    bench = Bench(start="open")
    bench.ask(ENCODERS)
    bench.wait(0.1)
    bench.ask(STOP)
    there = bench.look()
    assert 0 < there["motor_pos"][3] < 220000
    assert there["current_state"] == [0] * 15
    bench.wait(1.0)
    assert bench.look() == there
    assert bench.line.command("bend index 1000 2000 3000") == "bend index 1000 2000 3000"
    assert bench.look()["motor_pos"][3:6] == [1000, 2000, 3000]
    bench.ask(ENCODERS)
    with pytest.raises(ValueError, match="stop mode"):
        bench.line.command("bend index 0 0 0")


def test_bias_takes_the_load_with_it() -> None:
    bench = Bench()
    assert bench.line.command("touch ring 1 2 3 0.1 0.2 0.3") == "touch ring 1 2 3 0.1 0.2 0.3"
    assert bench.look()["sensor_state"][18:24] == pytest.approx([1.029, 1.984, 3.47, 0.10055, 0.19971, 0.30016])
    bench.ask(BIAS)
    assert bench.look()["sensor_state"] == [0.0] * 30
    bench.line.command("release ring")
    assert bench.look()["sensor_state"][18:24] == [-1.0, -2.0, -3.0, -0.1, -0.2, -0.3]
    bench.line.command("power-cycle")
    assert bench.look()["sensor_state"][18:21] == [0.029, -0.016, 0.47]


def test_sensors_drift() -> None:
    bench = Bench(drift=60)
    bench.ask(BIAS)
    bench.wait(100.0)
    forces = bench.look()["sensor_state"]
    assert forces[:4] == [0.1, 0.11, 0.12, 0.0]
    assert forces[6] == 0.16


# -- motion and currents ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [1, 7, 500])
@pytest.mark.parametrize("torque", [1000, 300])
def test_motion_does_not_depend_on_the_steps_of_time(steps: int, torque: int) -> None:
    bench = Bench(start="open")
    bench.ask(command(5, maxtorque=torque))
    bench.ask(ENCODERS)
    for _ in range(steps):
        bench.wait(0.25 / steps)
    expected = 440000 * torque / 1000 * 0.25 if torque == 1000 else 33000
    assert bench.look()["motor_pos"][3] == pytest.approx(expected, abs=2)


def test_the_last_of_the_way_is_slow() -> None:
    """A stroke a second until 50 ms before the target, then a lag of 50 ms."""
    bench = Bench(start="open")
    bench.ask(ENCODERS)
    bench.wait(0.5)
    assert bench.look()["motor_pos"][3] == pytest.approx(220000 - 22000 / math.e, abs=2)


def test_maxtorque_limits_speed_and_current() -> None:
    bench = Bench(start="open")
    bench.ask(command(5, maxtorque=200))
    bench.ask(ENCODERS)
    bench.wait(0.1)
    assert bench.look()["current_state"][:4] == [92, 72, 110, 85]  # 400 per mille at full speed, a fifth of it here
    bench.ask(command(5, maxtorque=0))
    there = bench.look()["motor_pos"]
    bench.wait(5.0)
    assert bench.look()["motor_pos"] == there
    assert bench.look()["current_state"] == [0] * 15


def test_current_mode_needs_full_maxtorque() -> None:
    bench = Bench()
    bench.ask(MAXTORQUE_800)
    bench.ask(CURRENTS)
    bench.wait(1.0)
    assert bench.look()["motor_pos"] == READINGS
    bench.ask(command(41, hand_TT_cmd=[100] * 15, maxtorque=1000))
    assert "mode 5 " in bench.state()
    bench.ask(MAXTORQUE_1000)
    bench.ask(CURRENTS)
    bench.wait(0.2)
    seen = bench.look()
    assert seen["motor_pos"][3] == pytest.approx(110440 + 440000 * 0.25 * 0.2, abs=2)  # needs no homing
    assert seen["current_state"][:6] == [103, 96, 55, 94, 107, 42]
    bench.wait(60.0)
    assert bench.look()["motor_pos"][5] == 170000 - 6060  # the end of the mechanics
    bench.ask(STOP)
    assert abs(bench.look()["current_state"][3]) < 20


def test_current_mode_can_carry_its_maxtorque() -> None:
    bench = Bench(current_maxtorque="with")
    bench.ask(MAXTORQUE_800)
    bench.ask(command(41, hand_TT_cmd=[-100] * 15, maxtorque=1000))
    assert bench.state() == "mode 41 not homed maxtorque 1000 dropped 0 ignored 0"
    bench.wait(0.1)
    assert bench.look()["motor_pos"][0] == 70110 - 7000


def test_an_obstacle_stops_a_finger() -> None:
    bench = Bench(start="open")
    bench.line.command("obstacle middle 40000")
    bench.ask(ENCODERS)
    bench.wait(3.0)
    seen = bench.look()
    assert seen["motor_pos"][6:12] == [220000, 220000, 40000, 220000, 220000, 85000]
    assert seen["current_state"][6:12] == [5, -4, 1000, 5, -4, 11]
    assert seen["sensor_state"][14] == 0.35 + 10.0
    bench.ask(MAXTORQUE_800)
    assert bench.look()["sensor_state"][14] == 0.35 + 8.0
    bench.line.command("release middle")
    bench.wait(3.0)
    assert bench.look()["motor_pos"][8] == 85000
    assert bench.look()["sensor_state"][14] == 0.35


def test_a_blocked_finger_draws_the_full_current() -> None:
    bench = Bench(start="open")
    bench.line.command("block thumb")
    bench.ask(ENCODERS)
    bench.wait(3.0)
    seen = bench.look()
    assert seen["motor_pos"][:4] == [0, 0, 0, 220000]
    assert seen["current_state"][:4] == [1000, 1000, 1000, 5]


def test_noise_is_small_and_repeats_with_its_seed() -> None:
    def run(seed: int) -> list[dict[str, Any]]:
        bench = Bench(noise=1, seed=seed)
        return [bench.look() for _ in range(20)]

    assert run(1) == run(1)
    assert run(1) != run(2)
    rows = run(1)
    for place in range(30):
        values = [row["sensor_state"][place] for row in rows]
        assert 0 < max(values) - min(values) <= 0.004
    assert all(row["motor_pos"] == READINGS for row in rows)


# -- device faults, power, state --------------------------------------------------------------------------------------


def test_blocked_and_dead_motors() -> None:
    bench = Bench(start="homed", fault="blocked")
    bench.ask(ENCODERS)
    bench.wait(3.0)
    assert bench.look()["motor_pos"] == READINGS
    bench.line.command("fault dead-motor")
    bench.wait(3.0)
    seen = bench.look()
    assert seen["motor_pos"] == [*json.loads(MIDDLE)["motor_pos"][:11], READINGS[11], 220000, 220000, 85000]
    assert seen["current_state"][11] == -14


def test_homing_and_bias_that_do_nothing() -> None:
    bench = Bench(fault="no-homing,no-bias,weak")
    assert bench.state() == "mode 0 not homed maxtorque 100 dropped 0 ignored 0"
    bench.ask(MAXTORQUE_1000)
    bench.ask(BIAS)
    assert bench.look()["sensor_state"][2] == 0.35
    bench.hold(HOMING, 3.5)
    assert bench.look()["motor_pos"][:2] == [-1010, -2020]
    assert "not homed" in bench.state()


def test_touched_fault_is_taken_away_again() -> None:
    bench = Bench(fault="touched")
    assert bench.look()["sensor_state"][6:12] == pytest.approx([1.523, -2.512, 4.89, 0.01545, -0.02523, 0.03512])
    bench.line.command("fault none")
    assert bench.look()["sensor_state"][6] == 0.023


def test_power_cycle_loses_the_origin() -> None:
    bench = Bench(start="homed")
    bench.ask(MAXTORQUE_800)
    bench.line.command("power off")
    assert bench.ask(NEUTRAL) == ""
    assert bench.wait(1.0) == ""
    bench.line.command("power on")
    assert bench.look()["motor_pos"] == [0] * 15
    assert bench.state() == "mode 0 not homed maxtorque 1000 dropped 0 ignored 0"
    bench.hold(HOMING, 3.1)
    bench.ask(command(10, hand_TP_cmd=READINGS))
    bench.wait(3.0)
    assert bench.look()["motor_pos"] == READINGS
    assert Bench(start="cold").look()["motor_pos"] == [0] * 15


def test_stream_stops_without_power() -> None:
    bench = Bench(exchange="stream")
    bench.line.command("power off")
    assert bench.wait(1.0) == ""
    bench.line.command("power on")
    assert bench.wait(0.1).count("\n") == 10


def test_state_file_keeps_the_hand_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = Bench(start="open", state=path)
    bench.ask(BIAS)
    bench.ask(MAXTORQUE_800)
    bench.ask(ENCODERS)
    bench.wait(0.1)
    bench.line.command("touch little 1 1 1")
    before = bench.look()
    bench.line.close()
    again = Bench(start="open", state=path)
    assert again.look() == before
    again.wait(3.0)
    assert again.look()["motor_pos"] == json.loads(MIDDLE)["motor_pos"]
    again.line.close()
    assert Bench(state=path, power_cycle=1).look()["motor_pos"] == [0] * 15


@each_row(
    ("key", "value"),
    [("places", [0] * 14), ("places", [float("nan")] * 15), ("drives", ["on"] * 15), ("maxtorque", 70000), ("mode", 7),
     ("jammed", None), ("warm", "long"), ("touch", {})],
)  # fmt: skip
def test_damaged_state_file(tmp_path: Path, key: str, value: object) -> None:
    path = tmp_path / "hand.json"
    Bench(state=path).line.close()
    state = json.loads(path.read_text())
    path.write_text(json.dumps({**state, key: value}))
    with pytest.raises(ValueError, match="damaged or foreign"):
        Bench(state=path)


def test_homing_does_not_go_on_after_a_restart(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = Bench(state=path)
    bench.hold(HOMING, 0.1)
    bench.line.close()
    again = Bench(state=path)
    again.wait(5.0)
    assert again.look()["motor_pos"][3] == pytest.approx(88440, abs=5)


@each_row(
    "words",
    ["touch index", "touch toe 1 2 3", "touch index 1 2 x", "touch index 1 2 2000", "touch index nan 0 0", "get battery",
     "bend index 1 2", "bend index 1 2 9999999", "obstacle index -1", "block", "dance"],
)  # fmt: skip
def test_control_commands_that_make_no_sense(words: str) -> None:
    bench = Bench()
    before = bench.look()
    with pytest.raises(ValueError, match=r"unknown|is not|are not"):
        bench.line.command(words)
    assert bench.look() == before


def test_control_get() -> None:
    bench = Bench(start="open")
    assert bench.line.command("get joint_pos").split()[:4] == ["-13", "0", "154", "154"]
    assert bench.line.command("get motor_pos") == " ".join(["0"] * 15)
    assert "touch FINGER" in bench.line.command("help")
