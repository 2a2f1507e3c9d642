"""Control commands of the simulated BarrettHand, its state, how a client finds it, and somebody who uses it. Loaded only when
one is used.

The fingers close until the strain of an object holds them (barrett §9.3.1), then open to their stops; the spread goes to
and fro. Speeds, in counts a second, and the object are invented.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from handctl.number_parsing import whole
from handctl.sim.barrett.boot_monitor import Image
from handctl.sim.barrett.device import Device
from handctl.sim.barrett.mechanics import NAMES, Motor
from handctl.sim.barrett.parameter_tables import ALIAS, BAUDS, NO_BOARD, NO_MOTOR, NOT_INITIALIZED, Bank, Memory
from handctl.sim.barrett.shared_state import OBSTACLES, STATES
from handctl.sim.engine.state_file import Fields, checked, columns, kept, replace, rows_of, spread

HELP = " | ".join(
    (
        "temperature TENTHS | block M | release M | obstacle M COUNTS | breakaway M COUNTS | strain M N|off",
        "position M COUNTS | jump M COUNTS (relative, while it moves in RealTime mode too) | push S COUNTS",
        "image | save-image FILE | erase | age SECONDS (without power) | download-at 0xADDRESS|+N|off",
        "motors | found STATE | ram NAME [M VALUE] | eeprom NAME | saves [FSAVES PSAVES] (M: F1 F2 F3 S all, COUNTS as P shows them)",
    )
)
BODY: Fields = {  # of a motor
    "place": ("place", float, -100000, 100000),
    "origin": ("origin", float, -100000, 100000),
    "counts": ("counts", float, 0, 5000000000000),
    "jammed": ("jammed", bool, 0, 1),
    "obstacle": ("obstacle", float, -100000, 100000, None),
    "clutch": ("clutch", float, -100000, 100000, None),
    "strain": ("strain", int, 0, 255, None),
    "initialized": ("initialized", bool, 0, 1),
    "powered": ("powered", bool, 0, 1),
    "code": ("code", int, 0, 65535),
    "broke": ("broke", bool, 0, 1),
    "broke_at": ("broke_at", int, -200000, 200000),
    "reported": ("reported", int, -200000, 200000),
}
HEAT: Fields = {
    "temperature": ("temperature", float, -550, 1250),
    "ambient": ("ambient", float, -550, 1250),
    "peak": ("peak", float, 0, 1250),
    "uptime": ("uptime", float, 0, 5000000000),
}
COUNTS: Fields = {"saves": ("saves", int, 0, 1000000)}
IMAGE: Fields = {
    "firmware": ("firmware", bool, 0, 1),
    "records": ("records", int, 0, 1000000),
    "partial": ("partial", bool, 0, 1),
    "spoiled": ("spoiled", bool, 0, 1),
    "decayed": ("decayed", bool, 0, 1),
}
COUNTED = {"UPSECS": "uptime", "PTEMP": "peak", "SN": "serial"}
CRUISE = 16  # LCV that somebody has left: 1 count a sample (§6.2.1)
FINGER, SPREAD = 2400.0, 350.0  # counts/s
GRASP, HOLD, RELEASE, REST = 4.5, 1.5, 4.5, 1.0  # s
SPREAD_SHARE = 0.6  # of the time of a grasp during which the spread moves


def command(device: Device, words: list[str]) -> str | None:
    """One control command (see HELP), as the engine wants it."""
    hand = device.hand
    match words:
        case ["motors"]:
            return ", ".join(_line(device, motor) for motor in hand.motors)
        case ["ram" | "eeprom", name]:
            return _stored(device.memory, name.upper(), words[0] == "eeprom")
        case ["ram", name, who, value]:
            _put_ram(device, name.upper(), who, value)
        case ["found", state]:
            find(device, state)
        case ["saves"]:
            return f"saves {device.memory.motor.saves} {device.memory.common.saves}"
        case ["saves", motors, common]:
            saves = whole(motors, 0, 1000000), whole(common, 0, 1000000)
            device.memory.motor.saves, device.memory.common.saves = saves
        case ["image"]:
            return _image(device)
        case ["save-image", path]:
            replace(path, device.monitor.image.flat())
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
            return ""
    hand.disturbed()
    return None


def _put(device: Device, what: str, motor: Motor, counts: int) -> None:
    if what == "position":
        if motor.drive is not None:
            raise ValueError(f"{NAMES[motor.number]} is moving")
        motor.jump(device.hand.now, counts)  # past all rules
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
    for bank in (memory.motor, memory.common):
        values = (bank.saved if saved else bank.values).get(ALIAS.get(name, name))
        if values is not None:
            return " ".join(str(value) for value in values)
    raise ValueError(f"no stored parameter {name!r}")


def _put_ram(device: Device, name: str, who: str, value: str) -> None:
    """A parameter of these motors or (M is -) of the whole hand, also one of those that only the hand itself counts."""
    if who == "-" and name in COUNTED:
        setattr(device.hand, COUNTED[name], whole(value, 0, 4294967295))
        return
    if who != "-" and name in STATE and name in device.memory.motor.rows:
        low, high = device.memory.motor.rows[name][1:3]
        for motor in _motors(device, who):
            STATE[name](motor, whole(value, low, high))
        return
    bank = device.memory.common if who == "-" else device.memory.motor
    numbers = (0,) if who == "-" else tuple(motor.number for motor in _motors(device, who))
    if bank.put(name, value, numbers):
        raise ValueError(f"no stored parameter {name!r} that takes {value}")
    device.settle()


def _put_counts(motor: Motor, thousands: int) -> None:
    motor.counts = 1000.0 * thousands


def _put_status(motor: Motor, code: int) -> None:
    """Where a board or a motor is missing nothing else shows."""
    motor.fault = code if code & (NO_BOARD | NO_MOTOR) else 0
    motor.initialized = not code & NOT_INITIALIZED
    motor.code = code & ~NOT_INITIALIZED


def _put_broke(motor: Motor, broke: int) -> None:
    motor.broke = bool(broke)


def _put_broke_at(motor: Motor, position: int) -> None:
    motor.broke_at = position


STATE = {"OD": _put_counts, "S": _put_status, "BD": _put_broke, "BP": _put_broke_at}
"""What a motor shows of itself; the rows of the parameters have the ranges."""


def snapshot(device: Device) -> dict[str, Any]:
    """RAM, EEPROM, wear, the body; a movement under way is kept as a standstill at its present place."""
    memory, hand = device.memory, device.hand
    body = kept(hand.motors, BODY)
    body["place"] = [motor.now_at(hand.now) for motor in hand.motors]
    return {
        "ram": _book(memory.motor.values, memory.common.values),
        "eeprom": _book(memory.motor.saved, memory.common.saved),
        "saves": [memory.motor.saves, memory.common.saves],
        "serial": hand.serial,
        "heat": rows_of(kept([hand], HEAT))[0],
        "motors": rows_of(body),
        "image": {
            **rows_of(kept([device.monitor.image], IMAGE))[0],
            "version": device.monitor.image.version,
            "ranges": [[start, data.hex()] for start, data in device.monitor.image.ranges()],
        },
    }


def _book(motor: dict[str, list[int]], common: dict[str, list[int]]) -> dict[str, Any]:
    return {"motor": motor, "global": {name: value for name, (value,) in common.items()}}


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    memory, hand = device.memory, device.hand
    books = []
    for book in (state["ram"], state["eeprom"]):
        common = {name: [value] for name, value in book["global"].items()}
        books.append((_values(memory.motor, book["motor"]), _values(memory.common, common)))
        if books[-1][1]["BAUD"][0] not in BAUDS:
            raise ValueError(f"BAUD is {books[-1][1]['BAUD'][0]}")
    saves = checked(state, COUNTS, 2)["saves"]
    serial = checked({"serial": [state["serial"]]}, {"serial": ("serial", int, 0, 65535)}, 1)["serial"][0]
    heat = checked(columns([state["heat"]], HEAT), HEAT, 1)
    body = checked(columns(state["motors"], BODY), BODY, 4)
    image = _image_of(state["image"], device.monitor.needed)
    (memory.motor.values, memory.common.values), (memory.motor.saved, memory.common.saved) = books
    memory.motor.saves, memory.common.saves = saves
    hand.serial, device.monitor.image = serial, image
    spread([hand], HEAT, heat)
    spread(hand.motors, BODY, body)
    device.settle()


def _image_of(state: dict[str, Any], needed: int) -> Image:
    image = Image(True, needed)
    spread([image], IMAGE, checked(columns([state], IMAGE), IMAGE, 1))
    image.version = state["version"]
    if not isinstance(image.version, str | None):
        raise ValueError(f"image: version {image.version!r}")
    for start, text in state["ranges"]:
        data = bytes.fromhex(text)
        if not isinstance(start, int) or not 0 <= start <= len(image.data) - len(data):
            raise ValueError(f"image: range at {start!r}")
        image.data[start : start + len(data)] = data
        image.written[start : start + len(data)] = b"\x01" * len(data)
    return image


def _values(bank: Bank, book: dict[str, list[Any]]) -> dict[str, list[int]]:
    """One set of parameters, checked; a parameter of another firmware is left out, a missing one has its default."""
    rows = {name: (name, int, *bank.rows[name][1:3]) for name in bank.values.keys() & book.keys()}
    return {**{name: list(values) for name, values in bank.values.items()}, **checked(book, rows, len(bank.all))}


def find(device: Device, state: str) -> None:
    """Puts the hand into one of STATES at once. Raises ValueError for a state that does not exist."""
    if state not in STATES:
        raise ValueError(f"unknown state {state!r}. Known: {', '.join(STATES)}")
    if state == "off":
        device.power(False)
        return
    if state in ("monitor", "record"):
        device.monitor.erase()
    if state in ("boot", "monitor", "record"):
        device.power(False)
        device.power(True)
        if state != "boot":
            device.monitor.until = None
            device.take()  # its ':' was said long ago
        if state == "record":
            device.feed(b"\xff")
            device.take()
        return
    if not device.powered:
        device.power(True)
    device.settle()
    for motor in device.hand.motors:
        motor.initialized = motor.initialized or state not in ("ready", "typed", "saving")
    lines = {"loop": b"LOOP\r", "moving": b"FSET MCV 16\rC\r", "saving": b"FSAVE\r", "typed": b"C"}
    line = lines.get(state.partition("-")[0], b"")
    device.feed(line)
    if state == "loop-block":
        device.feed(b"C" + bytes([CRUISE]))
    elif state == "loop-moving":
        device.feed(b"C" + (device.loop.block(CRUISE) if device.loop is not None else b""))
    device.take()


def use(device: Device) -> Iterator[float]:
    """As after HI: the motors are initialized, then act without any command on the line."""
    hand = device.hand
    for motor in hand.motors:
        motor.initialized = True
        if motor.number < 3:
            motor.obstacle = OBSTACLES[motor.number]
    hand.disturbed()
    while True:
        for sign, seconds, still in ((1.0, GRASP, HOLD), (-1.0, RELEASE, REST)):
            for motor in hand.motors:
                motor.cruise(hand.now, sign * (SPREAD if motor.number == 3 else FINGER))
            yield seconds * SPREAD_SHARE
            hand.motors[3].cruise(hand.now, 0.0)
            yield seconds * (1.0 - SPREAD_SHARE) + still
