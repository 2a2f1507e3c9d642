"""Control commands of the simulated wrist, its state, and somebody who works with it. Loaded only when one is used.

Angles are well within the ranges of the set values (wrist §2.1: yaw ±25.5°, pitch -22.66° to 22.12°); the course is invented.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from handctl.number_parsing import whole
from handctl.sim.engine.state_file import Fields, checked, kept, spread
from handctl.sim.hand.control_commands import check_fingers, fingers_of, poke, use_fingers
from handctl.sim.hand.fingers import CALIBRATION
from handctl.sim.inspire.memory import MEMORY, poking
from handctl.sim.wrist.device import KEPT, Module
from handctl.sim.wrist.mechanics import AXES, PITCH, YAW

HELP = (
    "set ADDRESS HEX | get ADDRESS COUNT | hand-set ADDRESS HEX | hand-get ADDRESS COUNT"
    " | temperature 1|2 DEGREES | block pitch|yaw | release pitch|yaw"
)


OF_BODY: Fields = {  # of both axes; of the movement its duration and what is left of it
    "angles": ("angles", float, -32768, 32767),
    "targets": ("targets", int, -32768, 32767, None),
    "movement": ("movement", float, 0, 65.535),
    "blocked": ("blocked", bool, 0, 1),
}
OF_ACTUATORS: Fields = {
    "errors": ("errors", int, 0, 255),
    "rest_currents": ("rest_current", int, -32768, 32767),
    "temperatures": ("temperature", float, 0, 255),
}
COURSE = (  # pitch and yaw in 0.01°, seconds to get there, seconds there
    (1500, -1250, 2.5, 0.8),
    (600, 1800, 3.0, 0.5),
    (-1400, 950, 2.5, 1.0),
    (-345, 1125, 2.0, 0.7),
)


def command(device: Module, words: list[str]) -> str | None:
    """One control command (see HELP), as the engine wants it."""
    match words:
        case ["set" | "hand-set", address, *digits] if digits:
            place, data = poking(words[1:], MEMORY - 1)
            _poke(device, words[0] == "set", place, data)
            return f"{words[0]} {address} {data.hex(' ').upper()}"
        case ["get" | "hand-get", _, _]:
            device.publish()
            return device.spaces["wrist" if words[0] == "get" else "carrier"].peek(words[1:])
        case ["temperature", "1" | "2" as number, degrees]:
            device.body.actuators[int(number) - 1].temperature = whole(degrees, 0, 100)
        case ["block", "pitch" | "yaw" as axis]:
            device.body.blocked[AXES.index(axis)] = True
        case ["release", "pitch" | "yaw" as axis]:
            device.body.release(AXES.index(axis))
        case _:
            return ""
    return None


def _poke(device: Module, of_wrist: bool, address: int, data: bytes) -> None:
    """Writes memory past all rules; readings that are poked become the state of what is behind them."""
    device.publish()
    device.dirty = True
    if not of_wrist:
        number = device.hand.memory[1000]
        poke(device.carrier, address, data)
        device.id = device.id if device.hand.memory[1000] == number else device.hand.memory[1000]
        return
    body = device.body
    shown: list[tuple[str, list[Any], str]] = [("pitch", [body], "hold_pitch"), ("yaw", [body], "hold_yaw")]
    for number, actuator in enumerate(body.actuators, 1):
        shown += [
            (f"current-{number}", [actuator], "rest_current"),
            (f"error-{number}", [actuator], "set_error"),
            (f"temperature-{number}", [actuator], "temperature"),
        ]
    device.wrist.poke(address, data, shown)


def snapshot(device: Module) -> dict[str, Any]:
    """Both memories as runs of bytes that are not all 0, flash, the speed in force, and the body."""
    device.publish()
    values = [value for word in KEPT for value in device.carrier.kept[word]]
    return {
        "wrist": device.wrist.runs(),
        "carrier": device.hand.runs(),
        "flash": {**device.flash, "kept": struct.pack("<18h", *values).hex(" ").upper()},
        "id": device.id,
        "speed_code": device.speed_code,
        **{key: list(getattr(device.body, name)) for key, (name, *_) in OF_BODY.items()},
        **kept(device.body.actuators, OF_ACTUATORS),
        "fingers": fingers_of(device.carrier.body),
    }


def restore(device: Module, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    flash_id, flash_code = state["flash"]["id"], state["flash"]["speed_code"]
    number, code, (low, high) = state["id"], state["speed_code"], device.IDS
    saved = bytes.fromhex(state["flash"]["kept"])
    codes = range(len(device.SPEEDS))
    if flash_id not in range(low, high + 1) or number not in range(low, high + 1):
        raise ValueError(f"impossible id {flash_id!r} or {number!r}")
    if flash_code not in codes or code not in codes or len(saved) != 36:
        raise ValueError(f"impossible speed code {flash_code!r} or {code!r}, or flash of {len(saved)} bytes")
    wrist, hand = device.wrist.memory_of(state["wrist"]), device.hand.memory_of(state["carrier"])
    body, actuators = checked(state, OF_BODY, 2), checked(state, OF_ACTUATORS, 2)
    carrier, fingers = device.carrier, state.get("fingers", {})
    # an older file has no rows
    found = check_fingers(carrier.body, fingers, CALIBRATION) if "rows" in fingers else None
    device.wrist.memory, device.hand.memory = wrist, hand
    if found is not None:
        use_fingers(carrier.body, *found)
    values = struct.unpack("<18h", saved)
    carrier.kept = {word: values[6 * place : 6 * place + 6] for place, word in enumerate(KEPT)}
    carrier.use_set_values()
    device.flash, device.id = {"id": flash_id, "speed_code": flash_code}, number
    device.use_speed(code)
    for name, row in body.items():
        setattr(device.body, name, row)
    spread(device.body.actuators, OF_ACTUATORS, actuators)


def use(device: Module) -> Iterator[float]:
    """It lifts, turns over and comes back. Each step tells for how long nothing else is done."""
    while True:
        for pitch, yaw, seconds, rest in COURSE:
            device.body.move({PITCH: pitch, YAW: yaw}, seconds)
            yield seconds + rest
