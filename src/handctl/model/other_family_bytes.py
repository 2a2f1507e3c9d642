"""Bytes of other families: recognize whose they are.

Knows no bytes itself: each family's own code says what it recognises.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable

from handctl.errors import OTHER_DEVICE, DeviceRefused, HandctlError, UsageError, joined
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


def refuse_for_strangers(data: bytes) -> None:
    """Refuse bytes for a device whose identity is only assumed, where a family never sends them to its own. Raises UsageError."""
    for row in FAMILIES.values():
        never_sent = getattr(importlib.import_module(row.codec), "never_sent", None)
        if never_sent is not None and (what := never_sent(data)):
            raise UsageError(
                f"these bytes contain {what}, and the device may be one: its identity was not checked, because of --assume-identity",
                hint="leave --assume-identity out. Nothing was sent.",
                code="never-sent",
            )


def has_frame_of(data: bytes, families: Iterable[str]) -> bool:
    """Whether bytes hold a frame of one of these families."""
    return any(_sign(family, data) for family in families)


def _sign(family: str, came: bytes) -> str:
    return str(importlib.import_module(FAMILIES[family].codec).sign(came))
