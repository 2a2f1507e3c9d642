"""Control commands of the simulated AIDIN-hand, its state, and somebody who uses it. Loaded only when one is used.

A slow grasp, over and over: encoder values are shares of the strokes of the manual's list (0 open); the course and the pressure
at the fingertips are invented. The hand need not be homed: its motors are moved, no command is given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import cos, pi
from typing import Any

from handctl.sim.aidin.device import MODES, Device
from handctl.sim.aidin.mechanics import FINGERS, STROKES, Motor
from handctl.sim.engine.state_file import Fields, checked, kept, place_of, real, spread

HELP = " | ".join(
    (
        "state | get KEY | touch FINGER FX FY FZ [TX TY TZ] | sensors FINGER FX FY FZ TX TY TZ | block FINGER",
        "obstacle FINGER [COUNTS] | release FINGER | bend FINGER M1 M2 M3",
    )
)

MOTORS: Fields = {
    "places": ("place", float, 0, 440000),
    "origins": ("origin", float, -1e6, 1e6),
    "goals": ("goal", float, -1e15, 1e15),
    "ceilings": ("ceiling", float, 0, 440000),
    "jammed": ("jammed", bool, 0, 1),
    "floors": ("floor", float, 0, 440000),
}
SENSORS: Fields = {"touch": ("touch", float, -1000, 1000), "bias": ("bias", float, -1e6, 1e6)}
STEP = 0.05  # s between two targets on the way
CLOSED = ((0.45, 0.5, 0.4), (0.55, 0.58, 0.55), (0.6, 0.6, 0.6), (0.62, 0.58, 0.55), (0.6, 0.52, 0.5))  # of the stroke
OPEN = ((0.1, 0.12, 0.1), (0.08, 0.1, 0.1), (0.06, 0.07, 0.08), (0.08, 0.06, 0.1), (0.12, 0.1, 0.12))
CLOSING, HOLDING, OPENING, RESTING = 3.0, 1.5, 2.5, 1.0  # s
PRESSURE = (3.0, 2.6, 2.2, 1.6, 1.2)  # Fz at each fingertip while it holds


def command(device: Device, words: list[str]) -> str | None:
    """One control command (see HELP), as the engine wants it."""
    hand = device.hand
    match words:
        case ["state"]:
            homed = "homed" if hand.homed else "not homed"
            dropped = f"dropped {device.reader.dropped} ignored {device.ignored}"
            return f"mode {device.mode} {homed} maxtorque {hand.torque} {dropped}"
        case ["get", key]:
            return _get(device, key)
        case ["touch", name, *forces] if len(forces) in (3, 6):
            place = 6 * place_of(name, FINGERS)
            values = [real(force, -1000.0, 1000.0) for force in forces]
            hand.touch[place : place + 6] = [*values, 0.0, 0.0, 0.0][:6]
        case ["sensors", name, *forces] if len(forces) == 6:  # as the hand shows them, with its zero error and bias
            place, shown = 6 * place_of(name, FINGERS), hand.sensors()
            for at, force in enumerate(forces, place):
                hand.touch[at] += real(force, -1000.0, 1000.0) - shown[at]
        case ["block", name]:
            for motor in _motors(device, name):
                motor.jammed = True
        case ["obstacle", name]:
            motor = _motors(device, name)[2]
            motor.ceiling = motor.place
        case ["obstacle", name, counts]:  # an object that was not there before does not push the finger back
            motor = _motors(device, name)[2]
            motor.ceiling = max(motor.place, real(counts, 0.0, motor.stroke) + motor.origin)
        case ["release", name]:
            place = 6 * place_of(name, FINGERS)
            hand.touch[place : place + 6] = [0.0] * 6
            for motor in _motors(device, name):
                motor.jammed, motor.ceiling = False, float(motor.stroke)
        case ["bend", name, *counts] if len(counts) == 3:
            _bend(_motors(device, name), counts)
        case _:
            return ""
    return None


def _get(device: Device, key: str) -> str:
    """Feedback past the line; angles in degrees."""
    hand = device.hand
    readers: dict[str, Callable[[], Sequence[float]]] = {
        "motor_pos": hand.encoders,
        "joint_pos": lambda: [angle for joints, _ in hand.poses() for angle in joints],
        "task_space_pos": lambda: [place for _, tip in hand.poses() for place in tip],
        "current_state": hand.currents,
        "sensor_state": hand.sensors,
    }
    if key not in readers:
        raise ValueError(f"unknown key {key!r}. Known: {', '.join(readers)}")
    return " ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in readers[key]())


def _bend(motors: list[Motor], counts: list[str]) -> None:
    """Somebody moves the finger by hand to these encoder values; only without motor power."""
    places = [
        real(count, -motor.origin, motor.stroke - motor.origin) for count, motor in zip(counts, motors, strict=True)
    ]
    if any(motor.drive != "off" for motor in motors):
        raise ValueError("the motors of this finger are on. Use stop mode (3) to free them")
    for motor, place in zip(motors, places, strict=True):
        motor.place = place + motor.origin


def snapshot(device: Device) -> dict[str, Any]:
    """The hand stays switched on between two runs, so this is what it knows and does at the moment."""
    hand = device.hand
    return {
        "mode": device.mode,
        "homed": hand.homed,
        "maxtorque": hand.torque,
        "drives": [motor.drive for motor in hand.motors],
        **kept(hand.motors, MOTORS),
        **{name: list(getattr(hand, name)) for name in SENSORS},
        "warm": hand.warm,
    }


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    hand = device.hand
    motors = checked({"floors": [0.0] * 15, **state}, MOTORS, 15)  # older files have no floors
    sensors = checked(state, SENSORS, 30)
    warm = checked({"warm": [state["warm"]]}, {"warm": ("warm", float, 0, 1e12)}, 1)
    drives, mode, torque = state["drives"], state["mode"], state["maxtorque"]
    if len(drives) != 15 or not set(drives) <= {"off", "position", "current"}:
        raise ValueError("drives are not 15 known states")
    if mode not in (0, *MODES) or not isinstance(torque, int) or not 0 <= torque <= 65535:
        raise ValueError(f"impossible mode {mode!r} or maxtorque {torque!r}")
    # Homing cannot go on: nobody has held its mode meanwhile.
    hand.homed, hand.torque, device.mode = bool(state["homed"]), torque, mode
    hand.touch, hand.bias, (hand.warm,) = sensors["touch"], sensors["bias"], warm["warm"]
    spread(hand.motors, MOTORS, motors)
    for motor, drive in zip(hand.motors, drives, strict=True):
        motor.drive = drive
        if mode == 1:
            motor.release()


def _motors(device: Device, name: str) -> list[Motor]:
    place = 3 * place_of(name, FINGERS)
    return device.hand.motors[place : place + 3]


def use(device: Device) -> Iterator[float]:
    """Each step tells the seconds until the next one."""
    while True:
        yield from _go(device, CLOSED, CLOSING)
        for part in (0.4, 0.8, 1.0, 0.8, 0.4, 0.0):
            for finger, most in enumerate(PRESSURE):
                device.hand.touch[6 * finger + 2] = part * most
            yield HOLDING / 6
        yield from _go(device, OPEN, OPENING)
        yield RESTING


def _go(device: Device, pose: tuple[tuple[float, ...], ...], seconds: float) -> Iterator[float]:
    """All motors set out slowly, arrive slowly, and together."""
    begin = device.hand.encoders()
    ends = [
        share * stroke
        for shares, row in zip(pose, STROKES, strict=True)
        for share, stroke in zip(shares, row, strict=True)
    ]
    count = round(seconds / STEP)
    for number in range(1, count + 1):
        done = 0.5 - 0.5 * cos(pi * number / count)
        device.hand.go([start + done * (end - start) for start, end in zip(begin, ends, strict=True)])
        yield STEP
