"""The speed at which each port's hand was found last, in a small file below the user's state folder.

It saves the search, and nothing depends on it: a file that cannot be read or written is as good as none.
"""

from __future__ import annotations

import json

from handctl.devices.barrett.map import SPEEDS
from handctl.files import atomic_write, state_path
from handctl.link import ByteLink

NAME = "barrett-speeds.json"
MOST = 64
"""Ports that are remembered, the latest last."""


def recall(link: ByteLink) -> int | None:
    """The last known speed of the hand on this link, None when there is none, or none that a hand has."""
    return speed_of(link.name) if _counts(link) else None


def speed_of(name: str) -> int | None:
    """The same of a LINK that need not be open."""
    speed = _all().get(name)
    return speed if speed in SPEEDS else None


def remember(link: ByteLink) -> None:
    """This link's present speed is the hand's; 9600, which is tried first anyway, is forgotten."""
    if not _counts(link):
        return
    known = _all()
    before = known.pop(link.name, None)
    if link.baud != SPEEDS[0]:
        known[link.name] = link.baud
    elif before is None:
        return
    if before == link.baud:
        return
    path = state_path(NAME)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as file:
            json.dump(dict(list(known.items())[-MOST:]), file, indent=1)
    except OSError:
        return  # the next connect looks again


def _counts(link: ByteLink) -> bool:
    return link.can_set_baud and not link.fake and not link.replayed


def _all() -> dict[str, object]:
    try:
        content = json.loads(state_path(NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}
