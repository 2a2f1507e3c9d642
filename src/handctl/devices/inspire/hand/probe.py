"""Is there an RH56 hand? Its angles are read, then what tells it from an exoskeleton hand (rh56 §1.1). Read-only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from handctl.devices.inspire import canreg, probing
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.hand.field import address_of, fingerprint, further
from handctl.devices.inspire.hand.generation import LABEL, look
from handctl.devices.inspire.hand.typed import asks_rtu, is_modbus_tcp
from handctl.devices.inspire.modbusbus import BETWEEN_PROTOCOLS, ModbusBus
from handctl.errors import HandctlError, NoAnswer
from handctl.link import ByteLink, Deadline, FrameLink, Link
from handctl.model.result import Journal, Row

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand
    from handctl.devices.inspire.registers import RegisterBus

__all__ = ["address_of", "fingerprint", "further", "identify", "ignores_speed", "measure", "overheard", "ping", "probe"]

FAMILY = "hand"
WIRES = ("serial", "tcp", "can")
SPEEDS = (115200,)
"""At the slower ones the question of the exoskeleton hand, which every hand answers, finds it (rh56 §2.1). 921600 reads as
a trigger to a BarrettHand in its boot window: only `handctl hand scan` asks there."""
PING = "angle_actual"
ECHOES = False
ANGLES = (1546, 4)
LIVE = (1534, 90)
"""One long answer of documented registers, and the gap between them (rh56 §5)."""
OWN_PORT = ":6000"
WAIT = 0.12
"""Seconds for the answer of one id, with room for Bluetooth."""


def wires_of(link: Link, journal: Journal, deadline: Deadline | None, number: int, wait: float) -> list[RegisterBus]:
    if isinstance(link, FrameLink):
        flags = {"read_flag": canreg.READ_HAND, "write_flag": canreg.WRITE_HAND}
        return [CanBus(link, number, journal, retries=0, bound=deadline, timeout=wait, **flags)]
    assert isinstance(link, ByteLink)
    if is_modbus_tcp(link.name):
        return [ModbusBus(link, number, journal, tcp=True, retries=0, bound=deadline, timeout=max(wait, 0.5))]
    line: list[RegisterBus] = [Bus(link, number, journal, retries=0, bound=deadline, timeout=wait, family=FAMILY)]
    if asks_rtu(link):
        line.append(ModbusBus(link, number, journal, tcp=False, retries=0, bound=deadline, timeout=wait))
    return line


def probe(
    link: ByteLink | FrameLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,),
    timeout: float | None = None,
) -> list[Row]:  # fmt: skip
    """Rows family, link, baud, id, evidence. Raises NoAnswer on silence, ProtocolError for what came instead."""
    if link.name.startswith("tcp://") and not link.name.endswith(OWN_PORT):
        # Whoever listens elsewhere may pass the bytes on to a serial line, where another device would act on them.
        raise NoAnswer(f"{link.name}: not asked: Modbus TCP of a hand is port 6000", hint=LABEL, code="not-asked")
    rows: list[Row] = []
    first: HandctlError | None = None
    for number in ids:
        for bus in wires_of(link, journal, deadline, number, timeout or WAIT):
            try:
                bus.read(*ANGLES)
                found = look(bus)
            except HandctlError as exc:
                first = first or exc
                link.sleep(BETWEEN_PROTOCOLS)
                continue
            if found.kind.family != FAMILY:
                continue
            protocol = "Modbus" if isinstance(bus, ModbusBus) else "EB90"
            evidence = f"{found.words}, {protocol}: {found.evidence}"
            row: Row = {"family": FAMILY, "link": link.name, "baud": getattr(link, "baud", None), "id": number}
            rows.append({**row, "evidence": evidence})
            break
    if not rows:
        raise first or NoAnswer(f"{link.name}: no RH56 hand", hint=LABEL)
    return rows


def ping(device: Hand) -> None:
    """One short read, asked once; of a hand that is silent in EB90 also in Modbus. Raises what the bus raises."""
    device.answered(lambda: device.bus.read(*ANGLES, retries=0))


def ignores_speed(device: Hand) -> bool:
    """Whether it answers at another speed of the port as well. Read-only."""
    return probing.ignores_speed(device)


def measure(device: Hand, unasked: bytes) -> None:
    """What reading shows of the line, into the journal. Read-only."""
    probing.measure(device, LIVE, ANGLES, unasked)


def overheard(data: bytes) -> list[int]:
    """The ids that others ask on this line, as what came unasked shows."""
    return probing.overheard(data, wrist=False)


def identify(device: Hand) -> tuple[str, str, str]:
    """Whether it is one: status, evidence, remedy of a check. Read-only. Raises what the bus raises."""
    found = device.gate.seen(device.bus)
    if found.kind.family != FAMILY:
        return (
            "fail",
            f"this is {found.kind.words}: {found.evidence}",
            f"use `{found.kind.command}`, the command for it",
        )
    if found.model is None:
        return "warning", f"{found.words}: {found.evidence}", LABEL
    return "ok", f"{found.words}: {found.evidence}", ""
