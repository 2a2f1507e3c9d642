"""Control commands of the simulated RH56 hands, their state, and somebody who works with one. Loaded only when one is used.

Poses are thousandths of the way of each finger, 1000 open. How fast and how firm somebody grasps is invented, well below what
crushes anything.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from handctl.number_parsing import whole
from handctl.sim.engine.state_file import checked, columns, kept, place_of, rows_of, spread
from handctl.sim.hand.fingers import COURSE, Body, Finger
from handctl.sim.hand.register_maps import MEMORY
from handctl.sim.hand.registers import ACTS, Front, Hand
from handctl.sim.inspire.memory import poking

FIELDS = {  # of a finger in a state file
    "angle": ("angle", float, -4000, 4000),
    "stroke": ("stroke", float, -4000, 4000),
    "stroke_goal": ("stroke_goal", float, -4000, 4000),
    "rest_force": ("rest_force", int, -32768, 32767),
    "rest_current": ("rest_current", int, -32768, 32767),
    "state": ("state", int, 0, 255),
    "blocked": ("blocked", bool, 0, 1),
    "errors": ("errors", int, 0, 255),
    "forced": ("forced", int, 0, 8000),
    "command": ("command", float, -4000, 4000, None),
    "goal": ("goal", float, -4000, 4000, None),
    "object": ("object", float, -4000, 4000, None),
    "thing": ("thing", float, -4000, 4000, None),
    "temperature": ("temperature", float, 0, 255),
}
STRAIGHT = (960, 955, 950, 945, 900, 700)
ROUND = (310, 285, 260, 300, 360, 830)
THING = 400  # where the fingers touch it
MOVING, HOLDING, RESTING = 2.5, 1.5, 1.5  # s

HELP = (
    "set ADDRESS HEX | get ADDRESS COUNT | temperature FINGER DEGREES | block FINGER | release FINGER"
    " | object FINGER THOUSANDTHS|none | acts | ip"
)


def command(device: Front, words: list[str]) -> str | None:
    """One control command (see HELP), as the engine wants it. COUNT is one of bytes."""
    hand = device.hand
    unit = hand.generation.unit
    match words:
        case ["set", address, *digits] if digits:
            place, data = poking(words[1:], MEMORY // unit - 1)
            poke(hand, place * unit, data)
            device.dirty = True
            return f"set {address} {data.hex(' ').upper()}"
        case ["get", _, _]:
            hand.publish()
            return hand.space.peek(words[1:], unit)
        case ["temperature", name, degrees]:
            _finger(hand, name).temperature = whole(degrees, 0, 100)
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
            return ""
    hand.publish()
    return None


def poke(hand: Hand, place: int, data: bytes) -> None:
    """Writes memory past all rules; readings that are poked become the state of the hand."""
    hand.publish()
    hand.felt = None
    takers = {
        "angle": "hold", "stroke": "put_stroke", "force": "rest_at", "current": "rest_current", "error": "show_error",
        "status": "state", "temperature": "temperature",
    }  # fmt: skip
    hand.space.poke(place, data, [(word, hand.body.fingers, taker) for word, taker in takers.items()])
    hand.use_set_values()
    hand.number = hand.space.memory[hand.space.place("id")]


def _finger(hand: Hand, name: str) -> Finger:
    return hand.body.fingers[place_of(name, hand.generation.names)]


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
        "fingers": fingers_of(hand.body),
    }


def restore(device: Front, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    hand, count = device.hand, device.hand.generation.count
    if state["model"] != hand.generation.name:
        raise ValueError(f"it is of a hand of generation {state['model']!r}, expected {hand.generation.name!r}")
    memory = hand.space.memory_of(state["memory"])
    flash, in_force = _identity(hand, state["flash"]), _identity(hand, state["in_force"])
    values_kept = {str(word): tuple(int(value) for value in values) for word, values in state["kept"].items()}
    if set(values_kept) != set(hand.kept) or any(
        len(values) != count or not all(-32768 <= value <= 32767 for value in values) for values in values_kept.values()
    ):
        raise ValueError("impossible kept values")
    acts = {str(name): int(number) for name, number in state["acts"].items()}
    if set(acts) != set(ACTS):
        raise ValueError("impossible acts")
    body = check_fingers(hand.body, state["fingers"])
    hand.space.memory, hand.kept, hand.acts, hand.felt = memory, values_kept, acts, None
    hand.flash_number, hand.flash_code, hand.flash_address = flash
    hand.number, hand.speed_code, hand.address = in_force
    use_fingers(hand.body, *body)
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


Course = list[tuple[float, int]]


def fingers_of(body: Body) -> dict[str, Any]:
    """Where the fingers are and go, and what is left of a calibration."""
    rows = rows_of(kept(body.fingers, FIELDS))
    for row, finger in zip(rows, body.fingers, strict=True):
        row["waiting"] = [[when - body.now, angle] for when, angle in finger.waiting]
    return {"rows": rows, "course": [[when - body.now, number] for when, number in body.course]}


def check_fingers(
    body: Body, state: dict[str, Any], longest: float = 3600.0
) -> tuple[dict[str, list[Any]], list[list[tuple[float, float]]], Course]:
    """What the file says of the fingers; KeyError, TypeError or ValueError when it does not fit."""
    found = checked(columns(state["rows"], FIELDS), FIELDS, len(body.fingers))
    waiting = [[(float(when), float(angle)) for when, angle in row["waiting"]] for row in state["rows"]]
    course = [(float(when), int(number)) for when, number in state["course"]]
    if not all(0 <= when <= longest and 0 <= number <= len(COURSE) for when, number in course):
        raise ValueError("impossible calibration")
    return found, waiting, course


def use_fingers(
    body: Body, found: dict[str, list[Any]], waiting: list[list[tuple[float, float]]], course: Course
) -> None:
    """Takes what `check_fingers` gave."""
    body.course = [(body.now + when, number) for when, number in course]
    spread(body.fingers, FIELDS, found)
    for finger, commands in zip(body.fingers, waiting, strict=True):
        finger.waiting = [(body.now + when, angle) for when, angle in commands]


def use(device: Front) -> Iterator[float]:
    """Closes around an object, holds it, lets it go; each step tells for how long it takes."""
    fingers = device.hand.body.fingers
    for finger in fingers:
        finger.place(finger.closed + finger.span * THING / 1000.0)
    while True:
        for pose, rest in ((ROUND, MOVING + HOLDING), (STRAIGHT, MOVING + RESTING)):
            for number, finger in enumerate(fingers):
                goal = finger.closed + finger.span * pose[min(number, 5)] / 1000.0
                finger.forced = max(1, round(abs(goal - finger.angle) / MOVING / finger.rate))
                finger.aim(goal)
            yield rest
