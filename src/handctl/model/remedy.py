"""What is wrong with a device, and what to do: one table for each family, in its module `remedies`, the most urgent first.

A key is the name of an error bit, the label of a code, or a word for what the tool itself finds. Knows no device and no text for people
but that of the table.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from typing import NamedTuple

from handctl.families import FAMILIES
from handctl.model.result import Finding

UNKNOWN = "unknown_bit"
"""Begins the name of a bit that the manual does not have; its row of a table has this key."""


class Remedy(NamedTuple):
    """What a finding means, what to do about it, and where that is from."""

    meaning: str
    step: str
    source: str

    @property
    def hint(self) -> str:
        """The next step of a message."""
        return f"{self.step} ({self.source})"


def remedies_of(kind: str) -> Mapping[str, Remedy]:
    """The table of a family, {} where it has none."""
    try:
        found: Mapping[str, Remedy] = import_module(FAMILIES[kind].module("remedies")).REMEDIES
    except ModuleNotFoundError:
        return {}
    return found


def worst_of(table: Mapping[str, Remedy], keys: Iterable[str]) -> str:
    """The key whose row comes first; "" where none has one."""
    known = {UNKNOWN if key.startswith(UNKNOWN) else key for key in keys}
    return next((key for key in table if key in known), "")


def hint_of(kind: str, findings: Sequence[Finding]) -> str:
    """The next step for several: that of the most urgent one."""
    table = remedies_of(kind)
    worst = worst_of(table, (key for finding in findings for key in finding.keys))
    steps = [hint_for(kind, finding) for finding in findings if worst_of(table, finding.keys) == worst]
    return steps[0] if steps else ""


def hint_for(kind: str, finding: Finding) -> str:
    """The next step for a finding, "" where the table has none."""
    table = remedies_of(kind)
    key = worst_of(table, finding.keys)
    return finding.step or (table[key].hint if key else "")
