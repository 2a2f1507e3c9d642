"""Is there a wrist module? Two bytes of a current are read, and of pitch_actual where it is answered (wrist §2.1). Read-only.

On a serial line nobody knows yet who listens, and at a BarrettHand's own speed 03 is ^C, which ends a movement: pitch_actual
lies at 1020, FC 03 on the line, the current at 1024, 00 04.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from handctl.devices.inspire import eb90, probing
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.identity import ITS_CURRENT
from handctl.devices.inspire.scan_report import scan
from handctl.devices.inspire.twins import same_id
from handctl.devices.inspire.wrist.device import Wrist
from handctl.devices.inspire.wrist.scan import TARGET, scan_wrist
from handctl.link import ByteLink, Deadline, FrameLink
from handctl.model.guide import Progress
from handctl.model.result import Journal, Row

FAMILY = "wrist"
WIRES = ("serial", "tcp", "can")
SPEEDS = probing.SPEEDS
PING = "current_1024"
ECHOES = False
LONG = (1020, 24)
"""One long answer of documented registers (wrist §2.1)."""


def probe(
    link: ByteLink | FrameLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,),
    timeout: float | None = None,
) -> list[Row]:  # fmt: skip
    """Rows family, link, baud, id, evidence. Raises NoAnswer on silence, ProtocolError for what came instead.

    One id after the other: on RS-485 an answer would collide with the next question.
    """
    wait = probing.window_ms(timeout, len(ids))
    if isinstance(link, FrameLink):
        bus = CanBus(link, ids[0], journal, retries=0, bound=deadline)
        return probing.found(
            scan_wrist(Wrist(bus), Progress(journal.progress), ids, [0], 1, wait, False, len(ids) > 1), TARGET.value
        )
    line = Bus(
        link,
        ids[0],
        journal,
        retries=0,
        bound=deadline,
        read_flag=eb90.WRIST_READ,
        write_flag=eb90.WRIST_WRITE,
        family=FAMILY,
    )
    table = scan(line, TARGET, Progress(journal.progress), ids, [link.baud or 0], 1, wait, False, len(ids) > 1)
    return probing.found(table, TARGET.value)


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
