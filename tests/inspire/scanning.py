"""Scanning on a line of simulated hands."""

from __future__ import annotations

from typing import Any

from handctl.devices.inspire.exo.probe import TARGET
from handctl.devices.inspire.scan import Target, sweep
from handctl.devices.inspire.scanner import Scanner, Wanted
from handctl.model.guide import Guide
from handctl.model.quest import Quest
from tests.support.scripted import ScriptedLink, hand_on

ALL_IDS = list(range(1, 255))
SILENCE = 5.0


def scan_on(link: ScriptedLink, **options: object) -> Quest:
    return scan_hand(hand_on(link), **options)


def scan_hand(device: Any, target: Target = TARGET, **options: object) -> Quest:
    """What a scan of its line came to: of all ids, with all patience, unless it is said otherwise."""
    quest = Quest(**{"ids": ALL_IDS, "find_all": True, **options})  # type: ignore[arg-type]
    sweep(device.link, device.journal, device.bus.bound, quest, [target])
    return quest


def scanner(device: Any, guide: Guide | None = None, target: Target = TARGET, **options: Any) -> Scanner:
    """The scanner of a serial line alone."""
    wanted = {"find_all": True, "probe": target.probe, "twin": target.twin, "own": target.own, **options}
    return Scanner(device.bus, guide or Guide(), Wanted(**wanted))
