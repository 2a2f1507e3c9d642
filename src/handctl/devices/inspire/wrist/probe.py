"""Is there a wrist module? Two bytes of a current are read, and of pitch_actual where it is answered (wrist §2.1). Read-only.

On a serial line nobody knows yet who listens, and at a BarrettHand's own speed 03 is ^C, which ends a movement: pitch_actual
lies at 1020, FC 03 on the line, the current at 1024, 00 04.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from handctl.devices.inspire import canreg, probing
from handctl.devices.inspire.identity import ITS_CURRENT, WRIST
from handctl.devices.inspire.scan import sweep
from handctl.devices.inspire.target import SPEEDS, Target, parse_ids
from handctl.devices.inspire.twins import same_id
from handctl.devices.inspire.wrist.device import WIRING_HINT, Wrist
from handctl.link import ByteLink, Deadline, FrameLink
from handctl.model.result import Journal, Row

__all__ = ["SPEEDS", "parse_ids", "sweep"]

FAMILY = "wrist"
WIRES = ("serial", "tcp", "can")
PING = "current_1024"
ECHOES = False
TARGET = Target(
    WRIST,
    probe=(1020, 2),
    twin=(1020, 4),
    value="pitch_raw",
    silence_hint=WIRING_HINT,
    can=(canreg.READ_WRIST, (1020, 2)),
)
LONG = (1020, 24)
"""One long answer of documented registers (wrist §2.1)."""


def probe(
    link: ByteLink | FrameLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,),
    timeout: float | None = None,
) -> list[Row]:  # fmt: skip
    """Rows family, link, baud, id, evidence. Raises NoAnswer on silence, ProtocolError for what came instead."""
    return probing.asked(link, journal, deadline, ids, timeout, TARGET)


def ping(device: Wrist) -> None:
    """One short read, asked once. Raises what the bus raises."""
    device.bus.read(*ITS_CURRENT, retries=0)


def identify(device: Wrist) -> tuple[str, str, str]:
    """Whether it is one: status, evidence, remedy of a check. Read-only. Raises what the bus raises."""
    return probing.identified(device, TARGET.own)


def ignores_speed(device: Wrist) -> bool:
    """Whether it answers at another speed of the port as well. Read-only."""
    return probing.ignores_speed(device)


def measure(device: Wrist, unasked: bytes) -> None:
    """What reading shows of the line, into the journal. Read-only."""
    probing.measure(device, LONG, TARGET.probe, unasked)


def further(device: Wrist, answered: bool) -> Iterator[tuple[str, str, str, str]]:
    """Whether one device has this id: what only reading again and again shows. Read-only."""
    if answered or device.bus.journal.counters.bad_frames:
        yield same_id(device)


def overheard(data: bytes) -> list[int]:
    """The ids that others ask on this line, as what came unasked shows."""
    return probing.overheard(data, wrist=True)
