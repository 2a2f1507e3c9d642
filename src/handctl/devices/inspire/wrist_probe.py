"""Is there a wrist module? Two bytes of pitch_actual are read, on the serial wire or on CAN (wrist §2.1). Read-only."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import eb90, probing
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.wrist import Wrist
from handctl.devices.inspire.wrist_scan import TARGET, scan_wrist
from handctl.guide import Guide
from handctl.link import ByteLink, Deadline, FrameLink
from handctl.result import Journal, Row

FAMILY = "wrist"
WIRES = ("serial", "tcp", "can")
SPEEDS = probing.SPEEDS
PING = "pitch_actual"
ECHOES = False


def probe(
    link: ByteLink | FrameLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,),
    timeout: float | None = None,
) -> list[Row]:  # fmt: skip
    """Rows family, link, baud, id, evidence. Raises NoAnswer on silence, ProtocolError for what came instead.

    One id after the other: on RS-485 an answer would collide with the next question.
    """
    own = probing.quiet(journal)
    if isinstance(link, FrameLink):
        bus: Bus | CanBus = CanBus(link, ids[0], own, retries=0, bound=deadline)
    else:
        bus = Bus(
            link,
            ids[0],
            own,
            retries=0,
            bound=deadline,
            read_flag=eb90.WRIST_READ,
            write_flag=eb90.WRIST_WRITE,
            family=FAMILY,
        )
    speed = link.baud if isinstance(link, ByteLink) else None
    table = scan_wrist(Wrist(bus), Guide(), ids, [speed or 0], 1, probing.window_ms(timeout, len(ids)), False)
    return probing.found(table, TARGET.value)


def ping(device: Wrist) -> None:
    """One short read, asked once. Raises what the bus raises."""
    device.bus.read(*TARGET.probe, retries=0)


def identify(device: Wrist) -> tuple[str, str, str]:
    """Whether it is one: status, evidence, remedy of a check. Read-only. Raises what the bus raises."""
    return probing.identified(device, TARGET.own)
