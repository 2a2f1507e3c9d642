"""What is promised for every device, and each family's exceptions from it. `tests/promises` checks every row."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from handctl.command.family import page_of
from handctl.families import FAMILIES


class Exempt(NamedTuple):
    """An exception from a promise: the family, the key of the promise, the commands or options, and what they do instead, and why."""

    family: str
    promise: str
    where: str
    why: str


def exceptions(family: str = "") -> Iterator[Exempt]:
    """The exceptions of one family, or of all."""
    for name in [family] if family else FAMILIES:
        for promise, where, why in getattr(page_of(name), "EXCEPTIONS", ()):
            yield Exempt(name, promise, where, why)
