"""What is promised for every device, and each family's exceptions from it. `tests/promises` checks every row."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from handctl.command.family import page_of
from handctl.docgen.readme_troubleshooting import SYMPTOMS
from handctl.families import FAMILIES

WORDS = {
    "verb": "every device has the command",
    "option": "every device accepts the option",
    "arrival": "a movement ends with exit code 7 if the target is not reached",
    "expect": "a movement command accepts `--expect`",
    "leave-alone": "-1 leaves a finger alone",
    "settings": "settings can be compared and restored",
    "model": "a device shows its model in JSON",
    **{row.key: f"the README's advice for {row.said}" for row in SYMPTOMS},
}
"""Key of a promise -> its text in the table of exceptions."""


class Exempt(NamedTuple):
    """An exception from a promise: the family, the commands or options, and the reason."""

    family: str
    promise: str
    where: str
    why: str


def exceptions(family: str = "") -> Iterator[Exempt]:
    """The exceptions of one family, or of all."""
    for name in [family] if family else FAMILIES:
        for promise, where, why in getattr(page_of(name), "EXCEPTIONS", ()):
            yield Exempt(name, promise, where, why)
