"""The FILE of a simulated bus: [line], [[device]] and [[master]], checked before anything starts.

Every complaint is a ValueError of one line: which key of which table, what is allowed.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from typing import Any

from handctl.number_parsing import number_in
from handctl.sim import folder_of, kinds, model_class
from handctl.sim.engine.line_and_faults import Plug
from handctl.sim.engine.slcan import ADAPTER_FAULTS

Value = str | int | float | bool

# Lines as they are met. The figures are typical ones, not of one product: 16 ms is the timer that USB serial adapters come with,
# 62 bytes what one of their USB packets holds; Bluetooth 4 carries 20 bytes a packet, and no serial speed.
MODELS: dict[str, dict[str, Value]] = {
    "clean": {"wire": "rs232"},
    "half-duplex": {"wire": "rs485", "half_duplex": True},
    "first-byte-lost": {"wire": "rs485", "half_duplex": True, "first_byte_lost": True},
    "usb-16ms": {"wire": "rs232", "coalesce_ms": 16, "packet": 62, "speed_ignored": False},
    "bluetooth": {
        "wire": "rs232", "latency_ms": 60, "spread_ms": 20, "packet": 20, "coalesce_ms": 4, "speed_ignored": True,
    },
    "serial-server": {"wire": "rs485", "half_duplex": True, "latency_ms": 4, "spread_ms": 4, "coalesce_ms": 50},
}  # fmt: skip

SAID: dict[str, str] = {
    "clean": "RS-232 without anything",
    "half-duplex": "RS-485 on two wires",
    "first-byte-lost": "the same with an adapter that switches to receiving too late",
    "usb-16ms": "RS-232 behind a USB adapter with its timer",
    "bluetooth": "a Bluetooth 4.0 link: slow, in packets, without a speed",
    "serial-server": "RS-485 behind a server in the network that gathers bytes",
}


if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

WIRES = ("rs485", "rs232", "can")
MOST = 100_000  # bytes of a file
UNPLUG = "AT:SECONDS[,AT:SECONDS]"
BUS_FAULTS: dict[str, str] = {
    "no-ack": "no device acknowledges a frame of a client",
    "bus-off": "a client's controller gives up with its first frame until it connects again",
    "bus-errors": "each frame of a device is destroyed on the bus",
}
LINE_KEYS: dict[str, tuple[Any, str]] = {
    "wire": (WIRES, "rs485, rs232 or can"),
    "model": (tuple(MODELS), f"a line by its name, which the other keys change: {', '.join(MODELS)}"),
    "baud": ((115200, 50, 20_000_000), "speed of the line, and of devices and masters without their own (default 115200, can 1000000)"),
    "latency_ms": ((0.0, 0.0, 10_000.0), "a round trip takes this much longer, half of it each way (default 0)"),
    "spread_ms": ((0.0, 0.0, 10_000.0), "at most this much more for each round trip, at random (default 0)"),
    "packet": ((0, 0, 65536), "largest packet in bytes. With packets the client's speed does not matter (default 0: none)"),
    "speed_ignored": (False, "true: the client's speed does not matter (default: whether there is a packet)"),
    "half_duplex": (False, "true: one pair of wires, and whoever sends hears nothing (default: true for rs485)"),
    "first_byte_lost": (False, "true: the client's adapter swallows the first byte after each sending (default false)"),
    "coalesce_ms": ((0.0, 0.0, 10_000.0), "the client gets bytes this long after the first of them (default 0)"),
    "echo": (False, "true: the client's adapter hears itself (default false)"),
    "unplug": (UNPLUG, f"{UNPLUG}: the adapters of all clients are unplugged AT seconds after the start, for SECONDS"),
    "fault": ([*BUS_FAULTS, *ADAPTER_FAULTS], f"faults of a CAN bus and of its adapters: {', '.join([*BUS_FAULTS, *ADAPTER_FAULTS])}"),
    "seed": ((0, 0, 4294967295), "start of the random generator (default 0)"),
}  # fmt: skip
DEVICE_KEYS: dict[str, str] = {
    "kind": "a simulated device with this wire, as in `handctl sim`",
    "id": "its id, where it has one",
    "unplug": f"{UNPLUG}: its plug is pulled from the bus. The device goes on",
    "KEY": "each further option of that device, such as turnaround, fault, state. See `handctl sim KIND -h`",
}
MASTER_KEYS: dict[str, str] = {
    "ask": "what another master sends: bytes in hex, on CAN an identifier and data, as 11000001#04",
    "every_ms": "how often",
}
EXAMPLE = """\
[line]
wire = "rs485"
latency_ms = 16

[[device]]
kind = "exo"
id = 1

[[device]]
kind = "wrist"
id = 2
fault = "hot"

[[master]]
ask = "EB 90 02 04 30 FC 03 02 37"
every_ms = 100
"""
OF_LINE = ("wire", "clock", "bus", "traffic")  # options of a lone simulator that a bus has by itself


class Plan:
    """What stands in a file; what [line] says as attributes, times in seconds and without their _ms."""

    def __init__(self, path: str, line: dict[str, Any]) -> None:
        self.path = path
        for name, value in line.items():
            setattr(self, name.removesuffix("_ms"), value / 1000.0 if name.endswith("_ms") else value)
        self.devices: list[tuple[str, dict[str, str]]] = []  # kind, raw options
        self.plugs: list[str] = []  # the plan of each device's plug
        self.masters: list[tuple[bytes, int, float]] = []  # bytes, identifier on CAN, s

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def load(path: str) -> dict[str, Any]:
    """The tables of the file."""
    try:
        with open(path, "rb") as file:
            content = file.read(MOST + 1)
        if len(content) > MOST:
            raise ValueError(f"{path}: larger than {MOST // 1000} kB")
        tables: dict[str, Any] = tomllib.loads(content.decode("utf-8-sig"))
        return tables
    except OSError as exc:
        raise ValueError(f"{path}: cannot be read: {exc.strerror or exc}") from exc
    except UnicodeDecodeError as exc:
        raise ValueError(f"{path}: not UTF-8 text") from exc
    except tomllib.TOMLDecodeError as exc:
        raise ValueError(f"{path}: not TOML: {exc}") from exc


def on_can(path: str) -> bool:
    """Whether the bus of this file carries frames; one that cannot be used complains when it is opened."""
    try:
        line = load(path).get("line")
    except ValueError:
        return False
    return isinstance(line, dict) and line.get("wire") == "can"


def read(path: str, seed: str | None = None) -> Plan:
    """The bus in this file; `seed` replaces that of the file."""
    try:
        tables = load(path)
        if seed is not None:
            tables = {**tables, "line": {**_table(tables, "line"), "seed": _seed(seed)}}
        return _plan(path, tables)
    except ValueError as exc:
        raise exc if str(exc).startswith(path) else ValueError(f"{path}: {exc}") from exc


def _seed(text: str) -> int:
    if (number := number_in(text)) is None:
        raise ValueError(f"option seed={text}: not a whole number (0 to 4294967295)")
    return number


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    table = tables.get(name, {})
    if not isinstance(table, dict):
        raise ValueError(f"{name} is a table, [{name}]")
    return table


def _rows(tables: dict[str, Any], name: str) -> list[dict[str, Any]]:
    rows = tables.get(name, [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError(f"each {name} is a table of its own, [[{name}]]")
    return rows


def _plan(path: str, tables: dict[str, Any]) -> Plan:
    for name in tables:
        if name not in ("line", "device", "master"):
            raise ValueError(f"unknown table {name!r}. Known: [line], [[device]], [[master]]")
    given = _table(tables, "line")
    _check_keys("[line]", given, LINE_KEYS)
    if "model" in given:
        given = {**MODELS[_value("[line]", "model", tuple(MODELS), given["model"])], **given}
    if "wire" not in given:
        raise ValueError(f"[line] wire is missing: one of {', '.join(WIRES)}")
    can = given["wire"] == "can"
    if can and (beside := [key for key in _SERIAL if key in given]):
        raise ValueError(f'[line] {beside[0]} belongs to a serial line. Keys with wire = "can": {", ".join(_CAN)}')
    usual = {"baud": 1000000 if can else 115200, "half_duplex": given["wire"] == "rs485"}
    line = _values("[line]", LINE_KEYS, {**usual, "speed_ignored": bool(given.get("packet")), **given})
    if line["fault"] and not can:
        raise ValueError('[line] fault belongs to wire = "can". A device has its own in [[device]]')
    line["faults"] = line["fault"].intersection(BUS_FAULTS)
    line["adapter_faults"] = line["fault"].intersection(ADAPTER_FAULTS)
    plan = Plan(path, line)
    plan.devices = [_device(number, row, plan) for number, row in enumerate(_rows(tables, "device"), 1)]
    plan.masters = [_master(number, row, line["wire"]) for number, row in enumerate(_rows(tables, "master"), 1)]
    return plan


_SERIAL = ("packet", "speed_ignored", "half_duplex", "first_byte_lost", "coalesce_ms")
_CAN = ("baud", "latency_ms", "spread_ms", "echo", "unplug", "fault", "seed")


def _device(number: int, row: dict[str, Any], plan: Plan) -> tuple[str, dict[str, str]]:
    """Kind and raw options, which the device itself checks; its plug is the bus's."""
    where = f"[[device]] {number}"
    wire = "can" if plan.wire == "can" else "serial"
    fitting = [kind for kind in kinds() if wire in folder_of(kind).WIRES]
    kind = row.get("kind")
    if kind not in fitting:
        what = "kind is missing" if kind is None else f"kind = {kind!r}: no simulated device on {plan.wire}"
        raise ValueError(f"{where} {what}. Known: {', '.join(fitting)}")
    plan.plugs.append(_value(where, "unplug", UNPLUG, row.get("unplug", "")))
    raw: dict[str, str] = {}
    for key, given in row.items():
        name, value = key.replace("_", "-"), given
        if name in OF_LINE:
            raise ValueError(f"{where} {key}: give it in [line], for all")
        if isinstance(given, list) and all(isinstance(item, str) for item in given):
            value = ",".join(given)
        if not isinstance(value, str | int | float):
            raise ValueError(f"{where} {key}: a text or a number is allowed")
        if name not in ("kind", "unplug"):
            raw[name] = str(int(value)) if isinstance(value, bool) else str(value)
    speed = "bitrate" if wire == "can" else "baud"
    if wire == "can":
        raw["bus"] = "can"
    if speed not in raw and speed in model_class(str(kind), wire).OPTIONS:
        raw[speed] = str(plan.baud)
    return str(kind), raw


def _master(number: int, row: dict[str, Any], wire: str) -> tuple[bytes, int, float]:
    where = f"[[master]] {number}"
    _check_keys(where, row, MASTER_KEYS)
    ask = row.get("ask")
    allowed = 'ID#DATA in hex, as "11000001#04"' if wire == "can" else 'bytes in hex, as "EB 90 01 04 11 E8 03 01 02"'
    if not isinstance(ask, str):
        raise ValueError(f"{where} ask is {'missing' if ask is None else 'no text'}: {allowed}")
    identifier, digits = 0, ask
    try:
        if wire == "can":
            head, sign, digits = ask.partition("#")
            identifier = int(head, 16) if sign and head.strip().isalnum() else -1
        data = bytes.fromhex(digits)
    except ValueError:
        raise ValueError(f"{where} ask = {ask!r}: {allowed}") from None
    if not 0 <= identifier < 536870912 or (wire == "can" and len(data) > 8) or (wire != "can" and not data):
        raise ValueError(f"{where} ask = {ask!r}: {allowed}")
    every = _values(where, {"every_ms": ((None, 1.0, 3_600_000.0), "")}, row)["every_ms"]
    return data, identifier, every / 1000.0


def _check_keys(where: str, given: dict[str, Any], known: Collection[str]) -> None:
    for key in given:
        if key not in known:
            raise ValueError(f"{where} unknown key {key!r}. Known: {', '.join(known)}")


def _values(where: str, rows: Mapping[str, tuple[Any, str]], given: dict[str, Any]) -> dict[str, Any]:
    """The values of these keys, each by its form: True or False, the first of some words, (default, lowest, highest), some of
    several words, a plan to unplug."""
    found = {}
    for key, (form, _) in rows.items():
        usual = form if isinstance(form, bool) else form[0] if isinstance(form, tuple) else [] if form != UNPLUG else ""
        found[key] = _value(where, key, form, given.get(key, usual))
    return found


def _value(where: str, key: str, form: Any, value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    match form:
        case bool():
            good, wanted = isinstance(value, bool), "true or false"
        case (str(), *_) if isinstance(form, tuple):
            good, wanted = value in form, f"one of {', '.join(form)}"
        case (_, int(low), int(high)):
            good = isinstance(value, int) and number and low <= value <= high
            wanted = f"a whole number from {low} to {high}"
        case (_, float(low), float(high)):
            good, wanted = number and low <= value <= high, f"a number from {low:g} to {high:g}"
            if value is None:
                raise ValueError(f"{where} {key} is missing: {wanted}")
        case str():
            good, wanted = isinstance(value, str), f"a text, {UNPLUG}"
            if good:
                try:
                    Plug(value)
                except ValueError as exc:
                    raise ValueError(f"{where} {exc}") from exc
        case _:
            names = value.split(",") if isinstance(value, str) else value
            good, wanted = isinstance(names, list), f"some of {', '.join(form)}"
            value = frozenset(str(name).strip() for name in names) if good else names
            good = good and value <= set(form)
            value = value if good else names
    if not good:
        raise ValueError(f"{where} {key} = {value!r}: {wanted}")
    return value
