"""Is there an RH56 hand? Its angles are read, then what tells it from an exoskeleton hand (rh56 §1.1). Read-only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from handctl.devices.inspire import canreg, probing
from handctl.devices.inspire.hand.field import address_of, fingerprint, further
from handctl.devices.inspire.hand.generation import AT, LABEL, look
from handctl.devices.inspire.hand.typed import spoken
from handctl.devices.inspire.identity import BYTE_HAND, Kind
from handctl.devices.inspire.mishaps import SILENCE_HINTS
from handctl.devices.inspire.scan import sweep
from handctl.devices.inspire.target import Target, parse_ids
from handctl.errors import NoAnswer
from handctl.link import ByteLink, Deadline, FrameLink
from handctl.model.result import Journal, Row

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand
    from handctl.devices.inspire.registers import RegisterBus

__all__ = [
    "address_of",
    "fingerprint",
    "further",
    "identify",
    "ignores_speed",
    "measure",
    "overheard",
    "parse_ids",
    "ping",
    "probe",
    "sweep",
]

FAMILY = "hand"
WIRES = ("serial", "tcp", "can")
SPEEDS = (115200,)
"""At the slower ones the question of the exoskeleton hand, which every hand answers, finds it (rh56 §2.1). 921600 reads as
a trigger to a BarrettHand in its boot window: only `handctl hand scan` asks there."""
ASIDE = True
"""On a line that a BarrettHand may be on, Modbus RTU waits until that was asked: 03 is its ^C, where the speed does not matter."""
PING = "angle_actual"
ECHOES = False
ANGLES = (1546, 4)
LIVE = (1534, 90)
"""One long answer of documented registers, and the gap between them (rh56 §5)."""
OWN_PORT = ":6000"


def who(bus: RegisterBus) -> tuple[Kind, str | None, str]:
    """Who answers, which generation, and what shows it."""
    found = look(bus)
    return found.kind, found.model, f"{found.words}: {found.evidence}"


TARGET = Target(
    BYTE_HAND,
    probe=(1472, 2),
    twin=AT,
    value="system_voltage",
    silence_hint=SILENCE_HINTS["hand"].replace("--id 1 at 115200 bit/s, `handctl hand scan`, ", ""),
    speeds=(115200, 921600, 57600, 19200),
    can=(canreg.READ_HAND, ANGLES),
    look=who,
    spoken=spoken,
)


def probe(
    link: ByteLink | FrameLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,),
    timeout: float | None = None,
) -> list[Row]:  # fmt: skip
    """Rows family, link, baud, id, evidence. Raises NoAnswer on silence, ProtocolError for what came instead."""
    if link.name.startswith("tcp://") and not link.name.endswith(OWN_PORT):
        # Whoever listens elsewhere may pass the bytes on to a serial line, where another device would act on them.
        raise NoAnswer(f"{link.name}: not tried: a hand uses Modbus TCP port 6000", hint=LABEL, code="not-asked")
    return probing.asked(link, journal, deadline, ids, timeout, TARGET)


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
