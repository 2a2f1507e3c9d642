"""Bytes of other families: recognize whose they are.

Knows no bytes itself: each family's own code says what it recognises.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable

from handctl.errors import OTHER_DEVICE, DeviceRefused, HandctlError, joined
from handctl.families import FAMILIES


def renamed(error: HandctlError, own: str) -> HandctlError:
    """The same error, or exit code 6 with the right command if the received bytes belong to a family other than `own`."""
    if error.exit_code != 5 or not error.came:
        return error
    shown = {family: sign for family in FAMILIES if (sign := _sign(family, error.came))}
    if not shown or own in shown:
        return error
    commands = " or ".join(f"`handctl {family}`" for family in shown)
    return DeviceRefused(
        joined(error.text, f"The data contains {next(iter(shown.values()))}: this is another device than {own}"),
        hint=f"use {commands}",
        code=OTHER_DEVICE,
    )


def has_frame_of(data: bytes, families: Iterable[str]) -> bool:
    """Whether bytes hold a frame of one of these families."""
    return any(_sign(family, data) for family in families)


def _sign(family: str, came: bytes) -> str:
    return str(importlib.import_module(FAMILIES[family].codec).sign(came))
