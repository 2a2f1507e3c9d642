"""Control commands and the state of the simulated BarrettHand. Loaded only when one of them is used."""

from __future__ import annotations

from typing import Any

from handctl.digits import whole
from handctl.sim.barrett import found
from handctl.sim.barrett.device import Device
from handctl.sim.barrett.memory import Memory
from handctl.sim.barrett.monitor import Image
from handctl.sim.barrett.motor import NAMES, Motor
from handctl.sim.barrett.tables import ALIAS, BAUDS, STATUS

HELP = " | ".join(
    (
        "temperature TENTHS | block M | release M | obstacle M COUNTS | breakaway M COUNTS | strain M N|off",
        "position M COUNTS | jump M COUNTS (relative, while it moves in RealTime mode too) | push S COUNTS",
        "image | save-image FILE | erase | age SECONDS (without power) | download-at 0xADDRESS|+N|off",
        "motors | found STATE | ram NAME | eeprom NAME | saves [FSAVES PSAVES] (M: F1 F2 F3 S all, COUNTS as P shows them)",
    )
)
BODY = (  # of a motor, name -> (lowest, highest, may be None)
    ("place", -100000, 100000, False),
    ("origin", -100000, 100000, False),
    ("counts", 0, 5000000000000, False),
    ("jammed", 0, 1, False),
    ("obstacle", -100000, 100000, True),
    ("clutch", -100000, 100000, True),
    ("strain", 0, 255, True),
    ("initialized", 0, 1, False),
    ("powered", 0, 1, False),
    ("code", 0, 65535, False),
    ("broke", 0, 1, False),
    ("broke_at", -200000, 200000, False),
    ("reported", -200000, 200000, False),
)
HEAT = (("temperature", -550, 1250), ("ambient", -550, 1250), ("peak", 0, 1250), ("uptime", 0, 5000000000))


def command(device: Device, words: list[str]) -> str:
    """One control command (see HELP); returns one line, raises ValueError."""
    hand = device.hand
    match words:
        case ["help"]:
            return HELP
        case ["motors"]:
            return ", ".join(_line(device, motor) for motor in hand.motors)
        case ["ram" | "eeprom", name]:
            return _stored(device.memory, name.upper(), words[0] == "eeprom")
        case ["found", state]:
            found.put(device, state)
        case ["saves"]:
            return f"saves {device.memory.saves[0]} {device.memory.saves[1]}"
        case ["saves", motors, common]:
            device.memory.saves = [whole(motors, 0, 1000000), whole(common, 0, 1000000)]
        case ["image"]:
            return _image(device)
        case ["save-image", path]:
            with open(path, "wb") as file:
                file.write(device.monitor.image.flat())
            return _image(device)
        case ["erase"]:
            device.monitor.erase()
        case ["age", seconds]:
            if device.powered:
                raise ValueError("RAM does not age while the power is on")
            device.off_since -= whole(seconds, 0, 1000000000)
        case ["download-at", place]:
            device.monitor.aim(place)
        case ["temperature", tenths]:
            hand.set_temperature(whole(tenths, -550, 1250))
        case ["push", name, counts]:
            for motor in _motors(device, name):
                if not hand.push(motor.number, whole(counts, -30000, 30000)):
                    raise ValueError(f"{NAMES[motor.number]} cannot be pushed: only a spread without power yields")
        case ["block" | "release", name]:
            for motor in _motors(device, name):
                motor.jammed = words[0] == "block"
                if not motor.jammed:
                    motor.obstacle = motor.clutch = motor.strain = None
        case ["jump", name, counts]:
            for motor in _motors(device, name):
                if hand.movement is not None:
                    raise ValueError("a movement is under way")
                motor.jump(device.now, motor.position(device.now) + whole(counts, -30000, 30000))
        case ["obstacle" | "breakaway" | "position", name, counts]:
            for motor in _motors(device, name):
                _put(device, words[0], motor, whole(counts, -30000, 30000))
        case ["strain", name, text]:
            for motor in _motors(device, name):
                motor.strain = None if text == "off" else whole(text, 0, 255)
        case _:
            raise ValueError(f"unknown command {' '.join(words)!r}. Known: {HELP}")
    hand.disturbed()
    device.dirty = True
    return " ".join(words)


def _put(device: Device, what: str, motor: Motor, counts: int) -> None:
    if what == "position":
        if motor.drive is not None:
            raise ValueError(f"{NAMES[motor.number]} is moving")
        device.hand.put(motor.number, counts)
    elif what == "obstacle":
        motor.obstacle = motor.origin + counts
    else:
        motor.clutch = motor.origin + counts


def _line(device: Device, motor: Motor) -> str:
    """One motor in words: name, position, status, strain, power, whether it moves."""
    moving = " moving" if motor.drive is not None else ""
    position, strain = device.read("P", motor.number), device.read("SG", motor.number)
    power = "on" if motor.powered else "off"
    return f"{NAMES[motor.number]} P {position} S {device.read('S', motor.number)} SG {strain} power {power}{moving}"


def _image(device: Device) -> str:
    """The firmware in RAM in words: state, records, bytes, ranges, SHA-256 of the bytes from lowest to highest."""
    import hashlib

    image = device.monitor.image
    words = [name for name in ("valid", "partial", "spoiled", "decayed") if getattr(image, name)]
    if not image.firmware and not words:
        words = ["incomplete" if image.records else "blank"]
    runs = image.ranges()
    ranges = " ".join(f"{start:04X}-{start + len(data) - 1:04X}" for start, data in runs) or "none"
    known = sum(len(data) for _, data in runs)
    return (
        f"image {' '.join(words)}, version {device.version}, {image.records} records, {known} bytes, ranges {ranges},"
        f" sha256 {hashlib.sha256(image.flat()).hexdigest()}"
    )


def _motors(device: Device, name: str) -> list[Motor]:
    if name.lower() == "all":
        return device.hand.motors
    if name.upper() not in NAMES:
        raise ValueError(f"unknown motor {name!r}. Known: {', '.join(NAMES)}, all")
    return [device.hand.motors[NAMES.index(name.upper())]]


def _stored(memory: Memory, name: str, saved: bool) -> str:
    motor, common = (memory.saved_motor, memory.saved_common) if saved else (memory.motor, memory.common)
    if ALIAS.get(name, name) in motor:
        return " ".join(str(value) for value in motor[ALIAS.get(name, name)])
    if name in common:
        return str(common[name])
    raise ValueError(f"no stored parameter {name!r}")


def snapshot(device: Device) -> dict[str, Any]:
    """RAM, EEPROM, wear, the body; a movement under way is kept as a standstill at its present place."""
    memory, hand = device.memory, device.hand
    body = []
    for motor in hand.motors:
        row = {name: getattr(motor, name) for name, _, _, _ in BODY}
        if motor.drive is not None:
            row["place"] = motor.now_at(hand.now)
        body.append(row)
    return {
        "ram": {"motor": memory.motor, "global": memory.common},
        "eeprom": {"motor": memory.saved_motor, "global": memory.saved_common},
        "saves": memory.saves,
        "serial": hand.serial,
        "heat": {name: getattr(hand, name) for name, _, _ in HEAT},
        "motors": body,
        "image": device.monitor.image.snapshot(),
    }


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    memory, hand = device.memory, device.hand
    motor, common = _values(memory, state["ram"])
    saved_motor, saved_common = _values(memory, state["eeprom"])
    saves = [_number("saves", count, 0, 1000000) for count in state["saves"]]
    serial = _number("serial", state["serial"], 0, 65535)
    heat = {name: float(_number(name, state["heat"][name], low, high)) for name, low, high in HEAT}
    if len(saves) != 2 or len(state["motors"]) != 4:
        raise ValueError("there are not 2 counts of saves and 4 motors")
    body = [
        {
            name: None if optional and row[name] is None else _number(name, row[name], low, high)
            for name, low, high, optional in BODY
        }
        for row in state["motors"]
    ]
    image = Image.restored(state["image"], device.monitor.needed)
    memory.motor, memory.common = motor, common
    memory.saved_motor, memory.saved_common = saved_motor, saved_common
    memory.saves, hand.serial = saves, serial
    for name, degrees in heat.items():
        setattr(hand, name, degrees)
    for target, row in zip(hand.motors, body, strict=True):
        for name, value in row.items():
            setattr(target, name, value)
    device.monitor.image = image
    device.settle()


def _values(memory: Memory, book: dict[str, Any]) -> tuple[dict[str, list[int]], dict[str, int]]:
    """One set of parameters, checked; a parameter of another firmware is left out, a missing one has its default."""
    motor = {name: list(values) for name, values in memory.motor.items()}
    for name in motor.keys() & book["motor"].keys():
        row = memory.motor_rows[name]
        values = book["motor"][name]
        if len(values) != 4:
            raise ValueError(f"{name} has not 4 values")
        motor[name] = [int(_number(name, value, row[1], row[2])) for value in values]
    common = dict(memory.common)
    for name in common.keys() & book["global"].keys():
        row_ = memory.common_rows[name]
        if row_[4] != STATUS:
            common[name] = int(_number(name, book["global"][name], row_[1], row_[2]))
    if common["BAUD"] not in BAUDS:
        raise ValueError(f"BAUD is {common['BAUD']}")
    return motor, common


def _number(name: str, value: Any, low: int, high: int) -> Any:
    """A number in a range, booleans included."""
    if not isinstance(value, (int, float)) or not low <= value <= high:
        raise ValueError(f"{name} is {value!r}, not a number from {low} to {high}")
    return value
