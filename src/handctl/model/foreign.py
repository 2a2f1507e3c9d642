"""Other devices than the one that is meant: whose bytes came, and upon which of ours one of them acts.

Knows no bytes itself: each family's own code says what it recognises, the registry what it acts upon.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from functools import lru_cache

from handctl.errors import DeviceRefused, HandctlError, joined
from handctl.families import FAMILIES


def renamed(error: HandctlError, own: str) -> HandctlError:
    """The error as it is; where its bytes show the protocol of another family than `own`, exit code 6 and its command."""
    if error.exit_code != 5 or not error.came:
        return error
    shown = {family: sign for family in FAMILIES if (sign := _sign(family, error.came))}
    if not shown or own in shown:
        return error
    commands = " or ".join(f"`handctl {family}`" for family in shown)
    return DeviceRefused(
        joined(error.text, f"The data contains {next(iter(shown.values()))}: this is another device than {own}"),
        hint=f"use {commands}",
        code="other-device",
    )


def pointed(error: HandctlError, link: str) -> HandctlError:
    """The error of a link on which nothing valid came, with the command that asks in every family's way."""
    advice = f"`handctl scan -p {link}` shows which device is there"
    if advice not in error.hint:
        error.hint = joined(error.hint, advice)
    return error


def signed(data: bytes, families: Iterable[str]) -> bool:
    """Whether bytes hold a frame of one of these families."""
    return any(_sign(family, data) for family in families)


def _sign(family: str, came: bytes) -> str:
    return str(importlib.import_module(FAMILIES[family].codec).sign(came))


@lru_cache(256)
def harmless(data: bytes, baud: int | None) -> bool:
    """Whether no device acts upon these bytes that is not meant; None = they reach whoever is there as they are.

    At a speed that is too fast for it, a device hears none of them as they are.
    """
    triggers = (row.trigger for row in FAMILIES.values() if row.trigger is not None)
    return not any(set(data) & set(bytes_) for most, bytes_ in triggers if baud is None or baud <= most)
