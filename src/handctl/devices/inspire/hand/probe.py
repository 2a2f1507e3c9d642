"""Detect an RH56 hand: read its angles, then what distinguishes it from an exoskeleton hand (rh56 §1.1). Read-only.

What users of these hands complain about are checks of `handctl doctor` (rh56 §5, §6, §7): each a row of name, status, evidence,
remedy. What the link itself does (holder, timer, errors) is checked elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from handctl.devices.inspire.duplicate_id import Row4, same_id
from handctl.devices.inspire.hand.detect_generation import AT, LABEL, detect
from handctl.devices.inspire.hand.model_and_protocol import asks_rtu, protocol_of_link
from handctl.devices.inspire.hand.register_map import BYTE_MAP, FINGERS, IP_ADDRESS, NO_MOVE_STATUS, STATUS, too_hot
from handctl.devices.inspire.identity import BYTE_HAND, Kind
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.register_bus import BETWEEN_PROTOCOLS, RegisterBus
from handctl.devices.inspire.register_map import DRAWN
from handctl.devices.inspire.scan import Probing, Target, ignores_speed, parse_ids, sweep
from handctl.devices.inspire.serial_bus import SILENCE_HINTS, SerialBus
from handctl.errors import HandctlError, Hint, NoAnswer, ProtocolError
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline, FrameLink
from handctl.model.device_picture import hint_for
from handctl.model.result import Finding, Journal, Row
from handctl.model.scan_task import NOT_ASKED

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

Values = Mapping[str, Mapping[str, int]]
"""Register -> finger -> value, of what could be read."""

ANSWERS = {"can": "on CAN", "eb90": "in EB90", "rtu": "in Modbus RTU", "tcp": "in Modbus TCP"}
SLOWLY = Hint("run {} before the first movement", "hand speed 100 100 100 100 100 100")
EACH_SLOWLY = Hint(
    "run {}, and the same for each other actuator, before the first movement", "hand set speed_set.m1=100"
)
MOST_CURRENT = 1500
OR_PAIR = ", or run `handctl hand pair`, which takes you through it"
REFRESH = 0.0307
"""Seconds from one refresh inside the hand to the next (rh56 §5)."""
REFRESH_SECONDS, REFRESH_STEP = 0.5, 0.004
"""How long it is looked at, and how often."""


def further(device: Hand, answered: bool) -> Iterator[Row4]:
    """The checks of a hand, `answered`: it has answered the doctor's reads. Raises nothing but LinkError."""
    twins = None if device.bus.wire == "tcp" else same_id(device, OR_PAIR)
    if not answered:
        if twins is not None and twins[1] == "fail":
            yield twins
        else:
            yield from _elsewhere(device)
        return
    yield protocol(device)
    if twins is not None:
        yield twins
    try:
        held = _held(device)
    except (NoAnswer, ProtocolError) as exc:
        yield "fingers", "warning", exc.text, exc.hint
        return
    yield fingers(held, swaps=device.bus.wire in ("rtu", "tcp") and device.bus.per == 1)
    yield first_movement(held)
    yield current_limit(held)
    yield refresh(device)


def address_of(device: Hand) -> str:
    """The address that the hand holds for its network, "" = it has none, or does not say. Raises nothing."""
    try:
        device.know()
        if IP_ADDRESS not in [one.name for one in device.has]:
            return ""
        octets = [reading.value for reading in device.read(device.map[IP_ADDRESS].each)]
    except HandctlError:
        return ""
    return "" if None in octets or not any(octets) else ".".join(map(str, octets))


def fingerprint(device: Hand) -> list[int]:
    """Readings that stay as they are while a hand rests, and that two hands do not share. Raises what the bus raises."""
    names = ("stroke_actual", "angle_actual")
    readings = device.read([element for name in names for element in device.map[name].each])
    return [int(reading.value or 0) for reading in readings]


# -- the line ---------------------------------------------------------------------------------------------------------


def protocol(device: Hand) -> Row4:
    """Which protocol the hand speaks; one that is silent in EB90 is a surprise to programs that speak nothing else."""
    wire = device.bus.wire
    if wire == "rtu" and any(message.code == "protocol" for message in device.journal.messages):
        remedy = "add --protocol modbus. Programs that only support EB90 cannot use this hand"
        return "protocol", "warning", "the hand replies in Modbus RTU, but not in EB90", remedy
    return "protocol", "ok", f"the hand replies {ANSWERS[wire]}", ""


def _arrives(bus: RegisterBus, address: int, count: int) -> bool:
    """Whether a read is answered. Raises LinkError where the line is lost."""
    try:
        bus.read(address, count, retries=0)
    except HandctlError as exc:
        if exc.code == "lost":
            raise
        return False
    return True


def _elsewhere(device: Hand) -> Iterator[Row4]:
    """Of a hand that is silent: whether it speaks the other protocol, and where it may be."""
    bus, link = device.bus, device.bus.link
    other: RegisterBus | None = None
    if isinstance(link, ByteLink) and bus.wire == "rtu":
        other = SerialBus(link, bus.id, device.journal, retries=0, timeout=bus.timeout, family="hand")
    elif isinstance(link, ByteLink) and bus.wire == "eb90" and asks_rtu(link):
        other = ModbusBus(link, bus.id, device.journal, tcp=False, retries=0, timeout=bus.timeout)
    if other is not None:
        link.sleep(BETWEEN_PROTOCOLS)
        names = {"eb90": "EB90", "rtu": "Modbus RTU"}
        silent, spoken = names[bus.wire], names[other.wire]
        if _arrives(other, *other.presence):
            word = "eb90" if other.wire == "eb90" else "modbus"
            yield "protocol", "fail", f"the hand replies in {spoken}, but not in {silent}", f"add --protocol {word}"
            return
        yield "protocol", "ok", f"the hand replies neither in {silent} nor in {spoken}", ""
    if bus.wire != "tcp":
        text = "a tactile hand (RH56DFTP) may reply only on its network"
        yield "network", "skipped", text, Hint("run {}", "hand doctor -p tcp://192.168.11.210")


def refresh(device: Hand) -> Row4:
    """How often the readings change: who asks more often reads the same again."""
    bus, register = device.bus, device.map["current"]
    link, seen, changes = bus.link, b"", list[float]()
    end = link.deadline(REFRESH_SECONDS)
    while not end.expired:
        link.sleep(REFRESH_STEP)
        with suppress(NoAnswer, ProtocolError):
            data = bus.read(register.address, min(len(register.span), bus.max_count), retries=0)
            if seen and data != seen:
                changes.append(link.now())
            seen = data
    often = f"more than {1 / REFRESH:.0f} reads per second return the same readings again"
    if len(changes) < 3:
        text = f"the readings of the resting hand did not change. It refreshes them every 31 ms: {often}"
        return "refresh", "ok", text, ""
    period = (changes[-1] - changes[0]) / (len(changes) - 1)
    text = f"the readings change every {1000 * period:.0f} ms: {often}"
    if period > 2 * REFRESH:
        return "refresh", "warning", text, "use a faster connection, or stop the other program that reads from the hand"
    return "refresh", "ok", text, ""


# -- the hand ---------------------------------------------------------------------------------------------------------


def _held(device: Hand) -> Values:
    """The values that the checks use. Raises NoAnswer, ProtocolError."""
    device.know()
    wanted = ("error", "status", "temperature", "speed_set", "default_speed", "current_limit")
    own = [register for register in device.has if register.name in wanted]
    held: dict[str, dict[str, int]] = {}
    for reading in device.read([element for register in own for element in register.each]):
        if reading.value is not None:
            held.setdefault(reading.element.param.name, {})[str(reading.element.part)] = int(reading.value)
    return held


def fingers(held: Values, *, swaps: bool = False) -> Row4:
    """Status 5 to 8, error bits and heat. `swaps`: two bytes share a word, which other programs read the wrong way round."""
    found: dict[str, list[str]] = {}
    keys: list[str] = []
    for part, code in held.get("status", {}).items():
        if code in NO_MOVE_STATUS:
            found.setdefault(part, []).append(f"status {code}, {STATUS[code]}")
            if not held.get("error", {}).get(part):  # its bits say more
                keys.append(STATUS[code])
    for part, bits in held.get("error", {}).items():
        if bits:
            found.setdefault(part, []).append(f"error 0x{bits:02X}")
            keys += (BYTE_MAP["error"].label(bits) or "").split(", ")
    for part, degrees in held.get("temperature", {}).items():
        if too_hot(degrees):
            found.setdefault(part, []).append(f"{degrees} °C")
            keys.append("hot")
    if not found:
        quiet = " The hand has had no command since power-up." if 255 in held.get("status", {}).values() else ""
        return "fingers", "ok", f"no finger reports an error, a blockage or overheating.{quiet}", ""
    text = "; ".join(f"{part}: {', '.join(words)}" for part, words in found.items())
    if swaps and (mirrored := _mirrored(held, found)):
        text += f". A program that swaps the two bytes of a word would show this on {mirrored}"
    return "fingers", "fail", text, hint_for("hand", Finding(text, tuple(keys)))


def _mirrored(held: Values, found: Mapping[str, object]) -> str:
    """The fingers that share a word with those found, where the swap would be seen."""
    order = list(held.get("status", {}))
    swapped = [order[order.index(part) ^ 1] for part in found if part in order]
    return ", ".join(swapped) if set(swapped) != set(found) else ""


def first_movement(held: Values) -> Row4:
    """The speed that a program has left: 0 looks as if the hand were dead, a high one surprises (rh56 §6)."""
    speeds, usual = held.get("speed_set", {}), held.get("default_speed", {})
    if not speeds:
        return "first_movement", "skipped", "the speed could not be read", ""
    remedy = SLOWLY if len(speeds) == len(FINGERS) else EACH_SLOWLY
    still = [part for part, speed in speeds.items() if speed == 0]
    if still:
        text = f"speed 0: {', '.join(still)}. These fingers would not move"
        return "first_movement", "warning", text, remedy
    quick = [part for part, speed in speeds.items() if speed > usual.get(part, speed)]
    if quick:
        text = f"speed {max(speeds[part] for part in quick)} was set by an earlier program: {', '.join(quick)}. "
        text += f"After power-up it is {min(usual[part] for part in quick)}"
        return "first_movement", "warning", text, remedy
    return "first_movement", "ok", f"the next movement has speed {min(speeds.values())} to {max(speeds.values())}", ""


def current_limit(held: Values) -> Row4:
    """Limits below what a movement draws end it with status 5; above the documented range they protect nothing."""
    limits = held.get("current_limit", {})
    if not limits:
        return "current_limit", "skipped", "this generation does not report current limits", ""
    remedy = "compare them with another hand of the same model, then run `handctl hand set current_limit.FINGER=MA`"
    low = [f"{part} {limit} mA" for part, limit in limits.items() if limit < DRAWN]
    if low:
        text = f"{', '.join(low)}: a movement without a load draws up to 194 mA and would end with status 5"
        return "current_limit", "warning", text, remedy
    high = [f"{part} {limit} mA" for part, limit in limits.items() if limit > MOST_CURRENT]
    if high:
        return "current_limit", "warning", f"{', '.join(high)}: outside 0 to {MOST_CURRENT} mA (rh56 §3.1)", remedy
    return "current_limit", "ok", f"{min(limits.values())} to {max(limits.values())} mA", ""


# -- what the tools ask of the family ---------------------------------------------------------------------------------

__all__ = ["address_of", "fingerprint", "further", "ignores_speed", "parse_ids", "sweep"]

WIRES = ("serial", "tcp", "can")
SPEEDS = (115200,)
"""At the slower ones the question of the exoskeleton hand, which every hand answers, finds it (rh56 §2.1). 921600 reads as
a trigger to a BarrettHand in its boot window: only `handctl hand scan` asks there."""
ASIDE = True
"""On a line that a BarrettHand may be on, Modbus RTU waits until that was asked: 03 is its ^C, where the speed does not matter."""
PING = "angle_actual"
ANGLES = (1546, 4)


def who(bus: RegisterBus) -> tuple[Kind, str | None, str]:
    """Who answers, which generation, and what shows it."""
    found = detect(bus)
    return found.kind, found.model, f"{found.words}: {found.evidence}"


TARGET = Target(
    BYTE_HAND,
    probe=(1472, 2),
    twin=AT,
    value="system_voltage",
    silence_hint=SILENCE_HINTS["hand"].replace("--id 1 at 115200 bit/s, {}, ", ""),
    speeds=(115200, 921600, 57600, 19200),
    can=(ANGLES[0], 2),
    look=who,
    spoken=protocol_of_link,
)

OWN = Probing(TARGET, live=ANGLES, long=(1534, 90))
"""Two of its angles, and one long answer of documented registers with the gap between them (rh56 §5)."""
ping, measure, overheard = OWN.ping, OWN.measure, OWN.overheard


def probe(
    link: ByteLink | FrameLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,),
    timeout: float | None = None,
) -> list[Row]:  # fmt: skip
    """Rows with family, link, baud, id and evidence. Raises NoAnswer on silence, ProtocolError for other data."""
    if link.name.startswith("tcp://") and not link.name.endswith(f":{FAMILIES['hand'].tcp_port}"):
        # Whoever listens elsewhere may pass the bytes on to a serial line, where another device would act on them.
        raise NoAnswer(
            f"{link.name}: not tried, because a hand uses Modbus TCP on port {FAMILIES['hand'].tcp_port}, and another port may lead to a serial line",
            hint=Hint(
                "if a hand uses Modbus TCP on this port, search for it alone: {}",
                f"hand scan --protocol modbus -p {link.name}",
            ),
            code=NOT_ASKED,
        )
    return OWN.probe(link, journal, deadline, ids, timeout)


def identify(device: Hand) -> tuple[str, str, str]:
    """Whether it is one: status, evidence, remedy of a check. Read-only. Raises what the bus raises."""
    found = device.gate.seen(device.bus)
    if found.kind.family != "hand":
        command = f"use `{found.kind.command}`, the command for it"
        return "fail", f"this is {found.kind.words}: {found.evidence}", command
    if found.model is None:
        return "warning", f"{found.words}: {found.evidence}", LABEL
    return "ok", f"{found.words}: {found.evidence}", ""
