"""Control commands and the state of the simulated AIDIN-hand. Loaded only when one of them is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from handctl.sim.aidin.device import MODES, Device
from handctl.sim.aidin.hand import FINGERS, Motor

HELP = " | ".join(
    (
        "state | get KEY | touch FINGER FX FY FZ [TX TY TZ] | block FINGER",
        "obstacle FINGER [COUNTS] | release FINGER | bend FINGER M1 M2 M3",
    )
)


def command(device: Device, words: list[str]) -> str:
    """One control command (see HELP); returns one line, raises ValueError."""
    hand = device.hand
    match words:
        case ["help"]:
            return HELP
        case ["state"]:
            homed = "homed" if hand.homed else "not homed"
            dropped = f"dropped {device.reader.dropped} ignored {device.ignored}"
            return f"mode {device.mode} {homed} maxtorque {hand.torque} {dropped}"
        case ["get", key]:
            return _get(device, key)
        case ["touch", name, *forces] if len(forces) in (3, 6):
            place = 6 * _finger(name)
            values = [_number(force, -1000.0, 1000.0) for force in forces]
            hand.touch[place : place + 6] = [*values, 0.0, 0.0, 0.0][:6]
        case ["block", name]:
            for motor in _motors(device, name):
                motor.jammed = True
        case ["obstacle", name]:
            motor = _motors(device, name)[2]
            motor.ceiling = motor.place
        case ["obstacle", name, counts]:  # an object that was not there before does not push the finger back
            motor = _motors(device, name)[2]
            motor.ceiling = max(motor.place, _number(counts, 0.0, motor.stroke) + motor.origin)
        case ["release", name]:
            place = 6 * _finger(name)
            hand.touch[place : place + 6] = [0.0] * 6
            for motor in _motors(device, name):
                motor.jammed, motor.ceiling = False, float(motor.stroke)
        case ["bend", name, *counts] if len(counts) == 3:
            _bend(_motors(device, name), counts)
        case _:
            raise ValueError(f"unknown command {' '.join(words)!r}. Known: {HELP}")
    device.dirty = True
    return " ".join(words)


def _get(device: Device, key: str) -> str:
    """Feedback past the line; angles in degrees."""
    hand = device.hand
    readers: dict[str, Callable[[], Sequence[float]]] = {
        "motor_pos": hand.encoders,
        "joint_pos": hand.joints,
        "task_space_pos": hand.tips,
        "current_state": hand.currents,
        "sensor_state": hand.sensors,
    }
    if key not in readers:
        raise ValueError(f"unknown key {key!r}. Known: {', '.join(readers)}")
    return " ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in readers[key]())


def _bend(motors: list[Motor], counts: list[str]) -> None:
    """Somebody moves the finger by hand to these encoder values; only without motor power."""
    places = [
        _number(count, -motor.origin, motor.stroke - motor.origin) for count, motor in zip(counts, motors, strict=True)
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
        "places": [motor.place for motor in hand.motors],
        "origins": [motor.origin for motor in hand.motors],
        "drives": [motor.drive for motor in hand.motors],
        "goals": [motor.goal for motor in hand.motors],
        "ceilings": [motor.ceiling for motor in hand.motors],
        "jammed": [motor.jammed for motor in hand.motors],
        "floors": [motor.floor for motor in hand.motors],
        "touch": list(hand.touch),
        "bias": list(hand.bias),
        "warm": hand.warm,
    }


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    hand = device.hand
    places, ceilings = _row(state, "places", 15, 0.0, 440000.0), _row(state, "ceilings", 15, 0.0, 440000.0)
    origins, goals = _row(state, "origins", 15, -1e6, 1e6), _row(state, "goals", 15, -1e15, 1e15)
    floors = _row({"floors": [0.0] * 15, **state}, "floors", 15, 0.0, 440000.0)  # older files have none
    touch, bias = _row(state, "touch", 30, -1000.0, 1000.0), _row(state, "bias", 30, -1e6, 1e6)
    (warm,) = _row({"warm": [state["warm"]]}, "warm", 1, 0.0, 1e12)
    drives, jammed, mode, torque = state["drives"], state["jammed"], state["mode"], state["maxtorque"]
    if len(drives) != 15 or not set(drives) <= {"off", "position", "current"} or len(jammed) != 15:
        raise ValueError("drives or jammed are not 15 known states")
    if mode not in (0, *MODES) or not isinstance(torque, int) or not 0 <= torque <= 65535:
        raise ValueError(f"impossible mode {mode!r} or maxtorque {torque!r}")
    # Homing cannot go on: nobody has held its mode meanwhile.
    hand.homed, hand.torque, device.mode = bool(state["homed"]), torque, mode
    hand.touch, hand.bias, hand.warm = touch, bias, warm
    for number, motor in enumerate(hand.motors):
        motor.place, motor.origin, motor.ceiling = places[number], origins[number], ceilings[number]
        motor.drive, motor.goal, motor.jammed = drives[number], goals[number], bool(jammed[number])
        motor.floor = floors[number]
        if mode == 1:
            motor.release()


def _row(state: dict[str, Any], name: str, count: int, low: float, high: float) -> list[float]:
    values: list[float] = state[name]
    if len(values) != count or not all(low <= value <= high for value in values):
        raise ValueError(f"{name} are not {count} values from {low:g} to {high:g}")
    return [float(value) for value in values]


def _motors(device: Device, name: str) -> list[Motor]:
    place = 3 * _finger(name)
    return device.hand.motors[place : place + 3]


def _finger(name: str) -> int:
    if name not in FINGERS:
        raise ValueError(f"unknown finger {name!r}. Known: {', '.join(FINGERS)}")
    return FINGERS.index(name)


def _number(text: str, low: float, high: float) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a number") from None
    if not low <= value <= high:
        raise ValueError(f"{text} is not from {low:g} to {high:g}")
    return value
