"""Control commands and the state of the simulated RH56 hands. Loaded only when one of them is used."""

from __future__ import annotations

import struct
from typing import Any

from handctl.digits import whole
from handctl.sim.engine.servo import OVER_TEMPERATURE
from handctl.sim.hand.books import MEMORY
from handctl.sim.hand.finger import Finger
from handctl.sim.hand.front import Front
from handctl.sim.hand.model import ACTS, Hand
from handctl.sim.inspire.space import hex_bytes

HELP = (
    "set ADDRESS HEX | get ADDRESS COUNT | temperature FINGER DEGREES | block FINGER | release FINGER"
    " | object FINGER THOUSANDTHS|none | acts | ip"
)


def command(device: Front, words: list[str]) -> str:
    """One control command (see HELP); returns one line, raises ValueError. COUNT is one of bytes."""
    hand = device.hand
    unit = hand.generation.unit
    match words:
        case ["help"]:
            return f"{HELP}. FINGER: {', '.join(hand.generation.names)}"
        case ["set", address, *digits] if digits:
            data = hex_bytes("".join(digits))
            poke(hand, whole(address, 0, MEMORY // unit - 1) * unit, data)
            device.dirty = True
            return f"set {address} {data.hex(' ').upper()}"
        case ["get", address, count]:
            hand.publish()
            place = whole(address, 0, MEMORY // unit - 1) * unit
            return hand.space.memory[place : place + whole(count, 1, MEMORY)].hex(" ").upper()
        case ["temperature", name, degrees]:
            _finger(hand, name).set_temperature(whole(degrees, 0, 100))
        case ["block" | "release", name]:
            _finger(hand, name).blocked = words[0] == "block"
        case ["object", name, "none"]:
            _finger(hand, name).place(None)
        case ["object", name, thousandths]:
            finger = _finger(hand, name)
            finger.place(finger.closed + finger.span * whole(thousandths, 0, 1000) / 1000.0)
        case ["acts"]:
            return " ".join(f"{name}={hand.acts[name]}" for name in ACTS)
        case ["ip"]:
            return ".".join(str(part) for part in hand.address)
        case _:
            raise ValueError(f"unknown command {' '.join(words)!r}. Known: {HELP}")
    hand.publish()
    device.dirty = True
    return " ".join(words)


def poke(hand: Hand, place: int, data: bytes) -> None:
    """Writes memory past all rules; readings that are poked become the state of the hand."""
    if place + len(data) > MEMORY:
        raise ValueError("the memory ends before")
    generation, memory = hand.generation, hand.space.memory
    hand.publish()
    before = bytes(memory)
    memory[place : place + len(data)] = data
    hand.felt = None

    def changed(word: str, number: int) -> int | None:
        """The new value of this reading, None if it is still the old one."""
        size = generation.size_of[word]
        at, layout = generation.places[word] + size * number, "B" if size == 1 else "<h"
        new: int = struct.unpack_from(layout, memory, at)[0]
        return None if new == struct.unpack_from(layout, before, at)[0] else new

    for number, finger in enumerate(hand.body.fingers):
        if (angle := changed("angle", number)) is not None:
            finger.hold(float(angle))
        if (stroke := changed("stroke", number)) is not None:
            finger.stroke = finger.stroke_goal = float(stroke)
        if (force := changed("force", number)) is not None:
            finger.rest_force, finger.object = force, None
        if (current := changed("current", number)) is not None:
            finger.rest_current = current
        if (error := changed("error", number)) is not None:
            finger.errors = error & ~(OVER_TEMPERATURE if finger.hot else 0)
        if (status := changed("status", number)) is not None:
            finger.state = status
        if (degrees := changed("temperature", number)) is not None:
            finger.set_temperature(float(degrees))
    hand.use_set_values()
    hand.number = memory[generation.places["id"]]


def _finger(hand: Hand, name: str) -> Finger:
    if name not in hand.generation.names:
        raise ValueError(f"unknown finger {name!r}. Known: {', '.join(hand.generation.names)}")
    return hand.body.fingers[hand.generation.names.index(name)]


def snapshot(device: Front) -> dict[str, Any]:
    """Memory as runs of bytes that are not all 0, flash, what is in force, and the body."""
    hand = device.hand
    hand.publish()
    return {
        "model": hand.generation.name,
        "memory": hand.space.runs(),
        "flash": [hand.flash_number, hand.flash_code, list(hand.flash_address)],
        "kept": {word: list(values) for word, values in hand.kept.items()},
        "in_force": [hand.number, hand.speed_code, list(hand.address)],
        "acts": dict(hand.acts),
        "fingers": hand.body.snapshot(),
    }  # fmt: skip


def restore(device: Front, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    hand, count = device.hand, device.hand.generation.count
    if state["model"] != hand.generation.name:
        raise ValueError(f"it is of a hand of generation {state['model']!r}, expected {hand.generation.name!r}")
    memory = hand.space.memory_of(state["memory"])
    flash, in_force = _identity(hand, state["flash"]), _identity(hand, state["in_force"])
    kept = {str(word): tuple(int(value) for value in values) for word, values in state["kept"].items()}
    if set(kept) != set(hand.kept) or any(
        len(values) != count or not all(-32768 <= value <= 32767 for value in values) for values in kept.values()
    ):
        raise ValueError("impossible kept values")
    acts = {str(name): int(number) for name, number in state["acts"].items()}
    if set(acts) != set(ACTS):
        raise ValueError("impossible acts")
    body = hand.body.check(state["fingers"])
    hand.space.memory, hand.kept, hand.acts, hand.felt = memory, kept, acts, None
    hand.flash_number, hand.flash_code, hand.flash_address = flash
    hand.number, hand.speed_code, hand.address = in_force
    hand.body.use(*body)
    hand.use_set_values()
    device.restored()


def _identity(hand: Hand, row: list[Any]) -> tuple[int, int, tuple[int, ...]]:
    """Id, speed code and IP address."""
    number, code, address = row
    if number not in range(1, 255) or code not in range(len(hand.generation.speeds)):
        raise ValueError(f"impossible id {number!r} or speed code {code!r}")
    if len(address) != 4 or not all(part in range(256) for part in address):
        raise ValueError(f"impossible IP address {address!r}")
    return number, code, tuple(address)
