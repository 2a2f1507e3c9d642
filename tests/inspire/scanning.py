"""Scanning on a line of simulated hands."""

from __future__ import annotations

from handctl.devices.inspire.exo.scan import scan
from handctl.model.guide import Guide
from handctl.model.result import Table
from tests.support.scripted import (
    ScriptedLink,
    hand_on,
)

ALL_IDS = list(range(1, 255))


def scan_on(link: ScriptedLink, **options: object) -> Table:
    return scan_hand(hand_on(link), **options)


def scan_hand(hand: object, **options: object) -> Table:
    wanted: dict[str, object] = {
        "ids": ALL_IDS, "speeds": [115200], "window": 8, "wait_ms": None, "find_all": True, **options,
    }  # fmt: skip
    return scan(hand, Guide(), **wanted)  # type: ignore[arg-type]
