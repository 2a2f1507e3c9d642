"""Is there an EH55BF1? Two bytes of system_voltage are read at the link's present speed (exo §2.3). Read-only.

The hands of the same maker answer it as well: a wrist is looked for first, and what answers both is a wrist.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from handctl.devices.inspire import probing
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.identity import EXO
from handctl.devices.inspire.mishaps import SILENCE_HINT
from handctl.devices.inspire.scan import sweep
from handctl.devices.inspire.target import SPEEDS, Target, parse_ids
from handctl.devices.inspire.twins import same_id
from handctl.link import ByteLink, Deadline
from handctl.model.result import Journal, Row

__all__ = ["SPEEDS", "parse_ids", "sweep"]

FAMILY = "exo"
WIRES = ("serial", "tcp")
PING = "force_actual"
LIVE = (1582, 2)
"""What is measured again and again: a constant would be the same of two devices with one id."""
ECHOES = False
LONG = (1472, 151)
"""One long answer of documented registers (exo §2.3)."""
TARGET = Target(
    EXO,
    probe=(1472, 2),
    twin=(1546, 12),
    value="system_voltage",
    both_ways=True,  # RS-232 and Bluetooth (exo §1.1)
    silence_hint=SILENCE_HINT.replace("--id 1 at 115200 bit/s, `handctl exo scan`, ", ""),
)


def probe(
    link: ByteLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
) -> list[Row]:
    """Rows family, link, baud, id, evidence. Raises NoAnswer on silence, ProtocolError for what came instead."""
    return probing.asked(link, journal, deadline, ids, timeout, TARGET)


def ping(device: ExoHand) -> None:
    """One short read, asked once. Raises what the bus raises."""
    device.bus.read(*LIVE, retries=0)


def identify(device: ExoHand) -> tuple[str, str, str]:
    """Whether it is one: status, evidence, remedy of a check. Read-only. Raises what the bus raises."""
    return probing.identified(device, TARGET.own)


def ignores_speed(device: ExoHand) -> bool:
    """Whether it answers at another speed of the port as well. Read-only."""
    return probing.ignores_speed(device)


def measure(device: ExoHand, unasked: bytes) -> None:
    """What reading shows of the line, into the journal. Read-only."""
    probing.measure(device, LONG, TARGET.probe, unasked)


def further(device: ExoHand, answered: bool) -> Iterator[tuple[str, str, str, str]]:
    """Whether one device has this id: what only reading again and again shows. Read-only."""
    if answered or device.bus.journal.counters.bad_frames:
        yield same_id(device)


def overheard(data: bytes) -> list[int]:
    """The ids that others ask on this line, as what came unasked shows."""
    return probing.overheard(data, wrist=False)
