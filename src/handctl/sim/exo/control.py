"""Control commands and the state of the simulated exoskeleton hand. Loaded only when one of them is used."""

from __future__ import annotations

import struct
from typing import Any

from handctl.digits import whole
from handctl.sim.exo.device import MEMORY, SPEEDS, Device
from handctl.sim.exo.hand import FINGERS, Finger, Hand

HELP = "set ADDRESS HEX | get ADDRESS COUNT | temperature FINGER DEGREES | block FINGER | release FINGER"


def command(device: Device, words: list[str]) -> str:
    """One control command (see HELP); returns one line, raises ValueError."""
    match words:
        case ["help"]:
            return HELP
        case ["set", address, *digits] if digits:
            return _poke(device, whole(address, 0, MEMORY - 1), _hex("".join(digits)))
        case ["get", address, count]:
            device.publish()
            place = whole(address, 0, MEMORY - 1)
            return device.memory[place : place + whole(count, 1, MEMORY)].hex(" ").upper()
        case ["temperature", name, degrees]:
            _finger(device, name).set_temperature(whole(degrees, 0, 100))
        case ["block" | "release", name]:
            _finger(device, name).blocked = words[0] == "block"
        case _:
            raise ValueError(f"unknown command {' '.join(words)!r}. Known: {HELP}")
    device.dirty = True
    return " ".join(words)


def _poke(device: Device, address: int, data: bytes) -> str:
    """Writes memory past all rules; readings that are poked become the state of the hand."""
    if address + len(data) > MEMORY:
        raise ValueError(f"memory ends at {MEMORY - 1}")
    device.publish()
    before = bytes(device.memory)
    device.memory[address : address + len(data)] = data

    def changed(place: int, layout: str) -> int | None:
        """The new value of this reading, None if it is still the old one."""
        new: int = struct.unpack_from(layout, device.memory, place)[0]
        return None if new == struct.unpack_from(layout, before, place)[0] else new

    hand = device.hand
    for number, finger in enumerate((*hand.fingers, hand.rotation)):
        if (position := changed(1546 + 2 * number, "<h")) is not None:
            finger.position, finger.target = float(position), None
    for number, finger in enumerate(hand.fingers):
        if (force := changed(1582 + 2 * number, "<h")) is not None:
            finger.rest_force, finger.force, finger.force_goal = force, float(force), None
        if (current := changed(1594 + 2 * number, "<h")) is not None:
            finger.rest_current = current
        if (error := changed(1606 + number, "B")) is not None:
            finger.set_error(error)
        if (temperature := changed(1618 + number, "B")) is not None:
            finger.set_temperature(float(temperature))
    device.dirty = True
    return f"set {address} {data.hex(' ').upper()}"


def snapshot(device: Device) -> dict[str, Any]:
    """RAM as runs of bytes that are not all 0, flash, the port speed in force, and the body."""
    device.publish()
    runs, place = {}, 0
    while place < MEMORY:
        end = place
        while device.memory[place] and any(device.memory[end : end + 4]):  # a run may hold up to three zeros in a row
            end += 1
        if end > place:
            runs[str(place)] = device.memory[place:end].hex(" ").upper()
        place = end + 1
    return {"ram": runs, "flash": dict(device.flash), "port_speed": device.speed, **_body(device.hand)}


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    flash_id, code, speed = state["flash"]["id"], state["flash"]["speed_code"], state["port_speed"]
    if flash_id not in range(1, 255) or code not in (0, 1, 2) or speed not in SPEEDS:
        raise ValueError(f"impossible id {flash_id!r}, speed code {code!r} or port speed {speed!r}")
    memory = bytearray(MEMORY)
    for address, digits in state["ram"].items():
        data = bytes.fromhex(digits)
        place = whole(address, 0, MEMORY - len(data))
        memory[place : place + len(data)] = data
    _set_body(device.hand, state)
    device.memory, device.speed = memory, speed
    device.flash = {"id": flash_id, "speed_code": code}


def _body(hand: Hand) -> dict[str, Any]:
    both = (*hand.fingers, hand.rotation)
    return {
        "positions": [finger.position for finger in both],
        "targets": [finger.target for finger in both],
        "force_goals": [finger.force_goal for finger in hand.fingers],
        "force_zeros": [finger.rest_force for finger in hand.fingers],
        "temperatures": [finger.temperature for finger in hand.fingers],
        "errors": [finger.errors for finger in hand.fingers],
        "blocked": [finger.blocked for finger in hand.fingers],
    }


def _set_body(hand: Hand, state: dict[str, Any]) -> None:
    positions, targets = _row(state, "positions", 6, 0, 1000), _row(state, "targets", 6, 0, 1000, True)
    goals, zeros = _row(state, "force_goals", 5, -1000, 1000, True), _row(state, "force_zeros", 5, -32768, 32767)
    temperatures, errors = _row(state, "temperatures", 5, 0, 255), _row(state, "errors", 5, 0, 255)
    blocked = _row(state, "blocked", 5, 0, 1)
    for number, finger in enumerate((*hand.fingers, hand.rotation)):
        finger.position = float(positions[number])
        finger.target = targets[number]
    for number, finger in enumerate(hand.fingers):
        finger.force_goal, finger.rest_force = goals[number], zeros[number]
        finger.force = float(zeros[number] if goals[number] is None else goals[number])
        finger.errors, finger.blocked = int(errors[number]), bool(blocked[number])
        finger.set_temperature(float(temperatures[number]))


def _row(state: dict[str, Any], name: str, count: int, low: int, high: int, may_be_none: bool = False) -> list[Any]:
    """A list of numbers in a range."""
    values: list[Any] = state[name]
    if len(values) != count or not all((may_be_none and v is None) or low <= v <= high for v in values):
        raise ValueError(f"{name} are not {count} values from {low} to {high}")
    return values


def _finger(device: Device, name: str) -> Finger:
    if name not in FINGERS:
        raise ValueError(f"unknown finger {name!r}. Known: {', '.join(FINGERS)}")
    return device.hand.fingers[FINGERS.index(name)]


def _hex(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a row of hex bytes") from None
