"""`handctl hand scan`: which id, at which speed, in which protocol. Read-only (rh56 §2.5).

Id 1 is asked at every speed in both protocols first; then all ids. Over TCP there is one hand behind an address.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.hand.generation import Found, look
from handctl.devices.inspire.hand.probe import ANGLES, wires_of
from handctl.devices.inspire.hand.typed import RTU_SPEED
from handctl.devices.inspire.identity import DAMAGED
from handctl.devices.inspire.modbusbus import BETWEEN_PROTOCOLS, ModbusBus
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.link import ByteLink
from handctl.model.guide import Guide
from handctl.model.result import Column, Row, Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand
    from handctl.devices.inspire.registers import RegisterBus

FIRST, EACH = 0.12, 0.03
"""Seconds for the answer of id 1, with room for Bluetooth, and of each id after it."""
SPEEDS = (115200, 921600, 57600, 19200)
COLUMNS = (
    Column("family", "Family"),
    Column("link", "Link"),
    Column("baud", "Baud", right=True),
    Column("id", "Id", right=True),
    Column("protocol", "Protocol"),
    Column("model", "Model"),
    Column("evidence", "Evidence"),
)


def scan(
    hand: Hand, guide: Guide, ids: Sequence[int], speeds: Sequence[int], find_all: bool, protocol: str = "auto"
) -> Table:
    """Look for hands on the link of `hand`, of a serial line in this `protocol`: auto, eb90 or modbus.

    Finding nothing is an error that says what was tried and what came instead.
    """
    link, bus = hand.link, hand.bus
    started, rows = link.now(), list[Row]()
    met: HandctlError | None = None
    asked = 0
    was = link.baud if isinstance(link, ByteLink) else None
    try:
        for place, number, wait in _questions(hand, ids, speeds, protocol):
            place.timeout = wait
            guide.progress(f"id {number} in {protocol_of(place)}{place.at_speed}, found {len(rows)}")
            asked += 1
            try:
                place.read(*ANGLES)
                found = look(place)
            except NoAnswer:
                found = None
            except ProtocolError as exc:
                found, met = None, met or exc
            if found is not None:
                rows.append(_row(place, found))
                if not find_all:
                    break
            if bus.over:
                break
    finally:
        guide.done()
        if was is not None and isinstance(link, ByteLink) and link.can_set_baud:
            link.set_baud(was)
    seconds = link.now() - started
    summary = f"{asked} question{'s' * (asked != 1)}, of ids {ids[0]} to {ids[-1]}, {seconds:.2f} s"
    hand.journal.info("scanned", summary, hint=_left_out(hand, speeds, protocol))
    table = Table(rows=rows, columns=COLUMNS)
    if not rows:
        table.failure = met or NoAnswer(
            f"{link.name}: no hand of this maker ({summary})",
            hint="check power (24 V), A and B of RS-485, and the wire: an RH56DFTP may speak Modbus TCP only",
            code="deadline" if bus.over else NoAnswer.default_code,
        )
    elif not find_all:
        hand.journal.info("first", "the scan ended at the first device", hint="add --all to look for more")
    return table


def _left_out(hand: Hand, speeds: Sequence[int], protocol: str) -> str:
    """What was not asked, and how to ask it: a BarrettHand could take its bytes for a command, or for firmware."""
    link = hand.link
    slow = ", ".join(str(speed) for speed in speeds if speed != RTU_SPEED)
    if protocol != "auto" or not slow or not isinstance(link, ByteLink) or not link.can_set_baud or link.replayed:
        return ""
    return f"Modbus RTU was asked at {RTU_SPEED} only. If no BarrettHand is on this line, --protocol modbus asks at {slow} too"


def _questions(
    hand: Hand, ids: Sequence[int], speeds: Sequence[int], protocol: str
) -> Iterator[tuple[RegisterBus, int, float]]:
    """(wire, id, seconds to wait) of each question."""
    link = hand.link
    can_set = isinstance(link, ByteLink) and link.can_set_baud
    rates: list[int | None] = list(speeds) if can_set else [None]
    passes = [([1], FIRST), ([number for number in ids if number != 1], EACH)] if 1 in ids else [(list(ids), EACH)]
    for numbers, wait in passes:
        for rate in rates:
            if rate is not None and isinstance(link, ByteLink):
                link.set_baud(rate)
            for wire in _spoken(hand, wires_of(link, hand.journal, hand.bus.bound, 1, wait), protocol, wait):
                for number in numbers:
                    yield wire.at(device_id=number), number, wait


def _spoken(hand: Hand, wires: Sequence[RegisterBus], protocol: str, wait: float) -> list[RegisterBus]:
    """Of the wires of a link those of the protocol that was typed; Modbus RTU then at slow speeds, too."""
    link = hand.link
    if protocol == "auto" or not isinstance(wires[0], Bus) or not isinstance(link, ByteLink):
        return list(wires)
    if protocol == "eb90":
        return [wires[0]]
    return [ModbusBus(link, 1, hand.journal, tcp=False, retries=0, bound=hand.bus.bound, timeout=wait)]


def ids_on(hand: Hand, guide: Guide) -> list[int]:
    """The ids that answer to `hand` at its speed, on its first wire that anybody answers on.

    One whose answers are damaged is among them: two hands may have it.
    """
    wires = hand.wires
    with suppress(NoAnswer, ProtocolError):  # nobody has this id, or two have it
        hand.know()
    wires.sort(key=lambda wire: wire is not hand.bus)
    return next((found for wire in wires if (found := _ids_of(wire, guide))), [])


def _ids_of(bus: RegisterBus, guide: Guide) -> list[int]:
    span = ANGLES if bus.per == 1 else bus.presence
    found: list[int] = []
    bus.pause(BETWEEN_PROTOCOLS)
    for number in range(1, 255):
        guide.progress(f"id {number} in {protocol_of(bus)}, found {len(found)}")
        place = bus.at(device_id=number)
        place.timeout = FIRST if number == bus.id else max(EACH, 2 * (bus.round_trip or 0.0))
        try:
            place.read(*span, retries=0)
        except NoAnswer:
            continue
        except ProtocolError as exc:
            if exc.code not in DAMAGED:
                continue
        found.append(number)
        bus.check_bound()
    guide.done()
    return found


def protocol_of(bus: RegisterBus) -> str:
    """``eb90``, ``can``, ``modbus-rtu`` or ``modbus-tcp``."""
    if isinstance(bus, CanBus):
        return "can"
    if isinstance(bus, Bus):
        return "eb90"
    return "modbus-tcp" if getattr(bus, "tcp", False) else "modbus-rtu"


def _row(bus: RegisterBus, found: Found) -> Row:
    link = bus.link
    settable = isinstance(link, ByteLink) and link.can_set_baud
    return {
        "family": found.kind.family,
        "link": link.name,
        "baud": link.baud if settable and isinstance(link, ByteLink) else None,
        "id": bus.id,
        "protocol": protocol_of(bus),
        "model": found.model,
        "evidence": found.evidence,
    }
