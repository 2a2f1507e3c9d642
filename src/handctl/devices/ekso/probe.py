"""Detect an EksoNR: GetTime, the shortest read, with a valid CRC and our msgID in the reply (ekso §6). Read-only."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.device import Ekso
from handctl.devices.ekso.frames import Command
from handctl.link import ByteLink, Deadline
from handctl.model.result import Journal, Row

WIRES = ("serial", "tcp")
SPEEDS = (115200,)
PING = "GetTime"
TIMEOUT = 0.25


def probe(
    link: ByteLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
) -> list[Row]:
    """A row with the evidence. Raises NoAnswer, ProtocolError for what came instead.

    Asked twice: what another probe left in the device may swallow the first.
    """
    port = DataPort(link, journal, timeout=timeout or TIMEOUT, retries=1, bound=deadline)
    hour, minute, second = port.read(Command.GET_TIME).body[:3]
    return [{"evidence": f"GetTime reports {hour:02}:{minute:02}:{second:02}, CRC and msgID are correct"}]


def ping(device: Ekso) -> None:
    """GetTime, asked once. Raises what the port raises."""
    device.port.exchange(Command.GET_TIME)
