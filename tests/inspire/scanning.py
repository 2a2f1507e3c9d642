"""Scanning on a line of simulated hands."""

from __future__ import annotations

from typing import Any

from handctl.devices.inspire.exo.probe import TARGET
from handctl.devices.inspire.id_search import Scanner, ScanRequest
from handctl.devices.inspire.scan import Target, sweep
from handctl.model.prompts import Prompts
from handctl.model.scan_task import ScanTask
from tests.support.scripted import ScriptedLink, hand_on

ALL_IDS = list(range(1, 255))
SILENCE = 5.0


def scan_on(link: ScriptedLink, **options: object) -> ScanTask:
    return scan_hand(hand_on(link), **options)


def scan_hand(device: Any, target: Target = TARGET, **options: object) -> ScanTask:
    """What a scan of its line came to: of all ids, with all patience, unless it is said otherwise."""
    task = ScanTask(**{"ids": ALL_IDS, "find_all": True, **options})  # type: ignore[arg-type]
    sweep(device.link, device.journal, device.bus.bound, task, [target])
    return task


def scanner(device: Any, prompts: Prompts | None = None, target: Target = TARGET, **options: Any) -> Scanner:
    """The scanner of a serial line alone."""
    wanted = {"find_all": True, "probe": target.probe, "twin": target.twin, "own": target.own, **options}
    return Scanner(device.bus, prompts or Prompts(), ScanRequest(**wanted))
