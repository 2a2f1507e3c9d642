"""`handctl exo scan`: read-only probes of system_voltage, which every hand of the family answers."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import scan_report
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.identity import EXO
from handctl.devices.inspire.mishaps import SILENCE_HINT
from handctl.devices.inspire.scan_report import Target
from handctl.model.guide import Guide
from handctl.model.result import Table

TARGET = Target(
    EXO,
    probe=(1472, 2),
    twin=(1546, 12),
    value="system_voltage",
    silence_hint=SILENCE_HINT.replace("--id 1 at 115200 bit/s, `handctl exo scan`, ", ""),
)


def scan(
    hand: ExoHand,
    guide: Guide,
    ids: Sequence[int],
    speeds: Sequence[int],
    window: int,
    wait_ms: float | None,
    find_all: bool,
    thorough: bool = True,
) -> Table:
    """Look for exo hands on the line of `hand`."""
    return scan_report.scan(hand.bus, TARGET, guide, ids, speeds, window, wait_ms, find_all, thorough)
