"""Control commands of the simulated exoskeleton hand, its state, and somebody who wears it. Loaded only when one is used.

Poses are positions, 0 bent to 1000 open (exo §2.3.7); the hand holds an object with forces far from their limit of 1000
(exo §2.3.8). How fast and how firm a person grasps is invented.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from handctl.number_parsing import whole
from handctl.sim.engine.state_file import checked, kept, place_of, spread
from handctl.sim.exo.device import SPEEDS, Device
from handctl.sim.exo.mechanics import CURRENTS, FINGERS, Finger
from handctl.sim.inspire.memory import MEMORY, poking

HELP = "set ADDRESS HEX | get ADDRESS COUNT | temperature FINGER DEGREES | block FINGER | release FINGER"
OF_BOTH = {"positions": ("position", float, 0, 1000), "targets": ("target", int, 0, 1000, None)}
OF_FINGERS = {
    "force_goals": ("force_goal", int, -1000, 1000, None),
    "force_zeros": ("rest_force", int, -32768, 32767),
    "errors": ("errors", int, 0, 255),
    "temperatures": ("temperature", float, 0, 255),
    "blocked": ("blocked", bool, 0, 1),
}
STRAIGHT = (930, 945, 960, 950, 900, 700)
ROUND = (310, 285, 260, 300, 360, 830)  # around an object
CLOSING, OPENING, RESTING = 3.0, 2.5, 1.5  # s
PRESSES = (40, 90, 140, 160, 165, 165, 160, 140, 90, 40)  # force and mA above rest, every 0.2 s
PRESSED = 0.2  # s
SHARES = (0.6, 0.8, 1.0, 1.1, 1.3)  # of each finger


def command(device: Device, words: list[str]) -> str | None:
    """One control command (see HELP), as the engine wants it."""
    match words:
        case ["set", _, _, *_]:
            place, data = poking(words[1:], MEMORY - 1)
            _poke(device, place, data)
            return f"set {place} {data.hex(' ').upper()}"
        case ["get", _, _]:
            device.publish()
            return device.space.peek(words[1:])
        case ["temperature", name, degrees]:
            _finger(device, name).temperature = whole(degrees, 0, 100)
        case ["block" | "release", name]:
            _finger(device, name).blocked = words[0] == "block"
        case _:
            return ""
    return None


def _poke(device: Device, place: int, data: bytes) -> None:
    """Writes memory past all rules; readings that are poked become the state of the hand."""
    device.publish()
    hand, device.dirty = device.hand, True
    shown = (
        ("position", hand.both, "put"),
        ("force", hand.fingers, "rest_at"),
        ("current", hand.fingers, "rest_current"),
        ("error", hand.fingers, "set_error"),
        ("temperature", hand.fingers, "temperature"),
    )
    device.space.poke(place, data, shown)


def _finger(device: Device, name: str) -> Finger:
    return device.hand.fingers[place_of(name, FINGERS)]


def snapshot(device: Device) -> dict[str, Any]:
    """RAM as runs of bytes that are not all 0, flash, the port speed in force, and the body."""
    device.publish()
    hand = device.hand
    body = {**kept(hand.both, OF_BOTH), **kept(hand.fingers, OF_FINGERS)}
    return {"ram": device.space.runs(), "flash": dict(device.flash), "port_speed": device.speed, **body}


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    flash_id, code, speed = state["flash"]["id"], state["flash"]["speed_code"], state["port_speed"]
    if flash_id not in range(1, 255) or code not in (0, 1, 2) or speed not in SPEEDS:
        raise ValueError(f"impossible id {flash_id!r}, speed code {code!r} or port speed {speed!r}")
    memory = device.space.memory_of(state["ram"])
    both, fingers = checked(state, OF_BOTH, 6), checked(state, OF_FINGERS, 5)
    spread(device.hand.both, OF_BOTH, both)
    spread(device.hand.fingers, OF_FINGERS, fingers)
    for finger in device.hand.fingers:
        finger.force = float(finger.rest_force if finger.force_goal is None else finger.force_goal)
    device.space.memory, device.speed = memory, speed
    device.flash = {"id": flash_id, "speed_code": code}


def use(device: Device) -> Iterator[float]:
    """Closes around an object, presses it, lets it go; each step tells for how long it takes."""
    while True:
        yield _aim(device, ROUND, CLOSING)
        for press in PRESSES:
            yield _press(device, press)
        _press(device, 0)
        yield _aim(device, STRAIGHT, OPENING)
        yield RESTING


def _aim(device: Device, pose: tuple[int, ...], seconds: float) -> float:
    """All fingers arrive together."""
    for finger, target in zip(device.hand.both, pose, strict=True):
        finger.speed = max(1.0, abs(target - finger.position) / seconds)
        finger.target = target
    return seconds


def _press(device: Device, press: int) -> float:
    """Positive is the user closing (exo §2.2.2 note 1)."""
    for finger, share in zip(device.hand.fingers, SHARES, strict=True):
        finger.force_goal = finger.rest_force + round(press * share)
        finger.rest_current = CURRENTS[finger.number] + round(press * share)
    return PRESSED
