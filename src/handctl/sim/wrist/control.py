"""Control commands and the state of the simulated wrist. Loaded only when one of them is used."""

from __future__ import annotations

import struct
from typing import Any

from handctl.digits import whole
from handctl.sim.hand.body import CALIBRATION
from handctl.sim.hand.control import poke
from handctl.sim.inspire.space import MEMORY, hex_bytes
from handctl.sim.wrist.body import AXES
from handctl.sim.wrist.memory import KEPT
from handctl.sim.wrist.model import Module

HELP = (
    "set ADDRESS HEX | get ADDRESS COUNT | hand-set ADDRESS HEX | hand-get ADDRESS COUNT"
    " | temperature 1|2 DEGREES | block pitch|yaw | release pitch|yaw"
)


def command(device: Module, words: list[str]) -> str:
    """One control command (see HELP); returns one line, raises ValueError."""
    match words:
        case ["help"]:
            return HELP
        case ["set" | "hand-set", address, *digits] if digits:
            _poke(device, words[0] == "set", whole(address, 0, MEMORY - 1), data := hex_bytes("".join(digits)))
            return f"{words[0]} {address} {data.hex(' ').upper()}"
        case ["get" | "hand-get", address, count]:
            device.publish()
            space = device.wrist if words[0] == "get" else device.hand
            place = whole(address, 0, MEMORY - 1)
            return space.memory[place : place + whole(count, 1, MEMORY)].hex(" ").upper()
        case ["temperature", "1" | "2" as number, degrees]:
            device.body.actuators[int(number) - 1].set_temperature(whole(degrees, 0, 100))
        case ["block", "pitch" | "yaw" as axis]:
            device.body.blocked[AXES.index(axis)] = True
        case ["release", "pitch" | "yaw" as axis]:
            device.body.release(AXES.index(axis))
        case _:
            raise ValueError(f"unknown command {' '.join(words)!r}. Known: {HELP}")
    device.dirty = True
    return " ".join(words)


def _poke(device: Module, of_wrist: bool, address: int, data: bytes) -> None:
    """Writes memory past all rules; readings that are poked become the state of what is behind them."""
    if address + len(data) > MEMORY:
        raise ValueError(f"memory ends at {MEMORY - 1}")
    device.publish()
    device.dirty = True
    if not of_wrist:
        number = device.hand.memory[1000]
        poke(device.carrier, address, data)
        device.id = device.id if device.hand.memory[1000] == number else device.hand.memory[1000]
        return
    space = device.wrist
    before = bytes(space.memory)
    space.memory[address : address + len(data)] = data

    def changed(place: int, layout: str) -> int | None:
        """The new value of this reading, None if it is still the old one."""
        new: int = struct.unpack_from(layout, space.memory, place)[0]
        return None if new == struct.unpack_from(layout, before, place)[0] else new

    body = device.body
    for axis, place in enumerate((1020, 1022)):
        if (angle := changed(place, "<h")) is not None:
            body.hold(axis, float(angle))
    rows = zip(body.actuators, (1026, 1024), (1028, 1030), (1032, 1033), strict=True)
    for actuator, current_place, error_place, heat_place in rows:
        if (current := changed(current_place, "<h")) is not None:
            actuator.rest_current = current
        if (error := changed(error_place, "B")) is not None:
            actuator.set_error(error)
        if (degrees := changed(heat_place, "B")) is not None:
            actuator.set_temperature(float(degrees))


def snapshot(device: Module) -> dict[str, Any]:
    """Both memories as runs of bytes that are not all 0, flash, the speed in force, and the body."""
    device.publish()
    body = device.body
    return {
        "wrist": device.wrist.runs(),
        "carrier": device.hand.runs(),
        "flash": {**device.flash, "kept": _kept(device).hex(" ").upper()},
        "id": device.id,
        "speed_code": device.speed_code,
        "angles": list(body.angles),
        "targets": list(body.targets),
        "movement": [body.duration, body.left],
        "blocked": list(body.blocked),
        "temperatures": [actuator.temperature for actuator in body.actuators],
        "errors": [actuator.errors for actuator in body.actuators],
        "rest_currents": [actuator.rest_current for actuator in body.actuators],
        "fingers": device.carrier.body.snapshot(),
    }


def restore(device: Module, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    flash_id, flash_code = state["flash"]["id"], state["flash"]["speed_code"]
    number, code, (low, high) = state["id"], state["speed_code"], device.IDS
    kept = bytes.fromhex(state["flash"]["kept"])
    codes = range(len(device.SPEEDS))
    if flash_id not in range(low, high + 1) or number not in range(low, high + 1):
        raise ValueError(f"impossible id {flash_id!r} or {number!r}")
    if flash_code not in codes or code not in codes or len(kept) != 36:
        raise ValueError(f"impossible speed code {flash_code!r} or {code!r}, or flash of {len(kept)} bytes")
    wrist, hand = device.wrist.memory_of(state["wrist"]), device.hand.memory_of(state["carrier"])
    angles, targets = _row(state, "angles", -32768, 32767), _row(state, "targets", -32768, 32767, True)
    movement, blocked = _row(state, "movement", 0, 65.535), _row(state, "blocked", 0, 1)
    temperatures, errors = _row(state, "temperatures", 0, 255), _row(state, "errors", 0, 255)
    currents = _row(state, "rest_currents", -32768, 32767)
    fingers = state.get("fingers", {})
    course = device.carrier.body.check(fingers, CALIBRATION) if "rows" in fingers else None  # an older file has no rows
    device.wrist.memory, device.hand.memory = wrist, hand
    if course is not None:
        device.carrier.body.use(*course)
    values = struct.unpack("<18h", kept)
    device.carrier.kept = {word: values[6 * place : 6 * place + 6] for place, word in enumerate(KEPT)}
    device.carrier.use_set_values()
    device.flash, device.id = {"id": flash_id, "speed_code": flash_code}, number
    device.use_speed(code)
    body = device.body
    body.angles, body.targets = [float(angle) for angle in angles], targets
    body.duration, body.left = movement
    body.blocked = [bool(value) for value in blocked]
    for place, actuator in enumerate(body.actuators):
        actuator.errors, actuator.rest_current = int(errors[place]), int(currents[place])
        actuator.set_temperature(float(temperatures[place]))


def _kept(device: Module) -> bytes:
    """What the hand's flash holds of limits, speeds and forces."""
    return struct.pack("<18h", *(value for word in KEPT for value in device.carrier.kept[word]))


def _row(state: dict[str, Any], name: str, low: float, high: float, may_be_none: bool = False) -> list[Any]:
    """Two numbers in a range."""
    values: list[Any] = state[name]
    if len(values) != 2 or not all((may_be_none and v is None) or low <= v <= high for v in values):
        raise ValueError(f"{name} are not 2 values from {low} to {high}")
    return values
