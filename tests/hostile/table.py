"""What the tests of the suite share: which cells an ordinary run takes, and the table at the end."""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence

import pytest

from tests.harm.table import Table
from tests.hostile.cell import Cell

SHARE = 160
"""An ordinary run of the whole suite takes one cell in so many."""
PROPERTY = "handctl-hostile"
HANGS = 3
"""So many commands that do not end are enough for one test: each costs its whole bound."""


def table() -> Table:
    """The plugin of pytest that prints it."""
    return Table(PROPERTY, "hostile suite", "kind of hostility", "failed", "HANDCTL_HOSTILE")


def share(config: pytest.Config, name: str, each: int = SHARE) -> bool:
    """Whether a cell is tried: `-m hostile`, or naming a file, tries all of them, or those that HANDCTL_HOSTILE_EACH=N leaves."""
    whole_suite = not config.option.file_or_dir or config.option.file_or_dir == ["tests"]
    if not whole_suite or "hostile" in config.option.markexpr.replace("not hostile", ""):
        each = int(os.environ.get("HANDCTL_HOSTILE_EACH", "1"))
    return zlib.crc32(name.encode("utf-8", "surrogateescape")) % each == 0


class Tried(list[Cell]):
    """The cells of one test; `note` tells them. It ends when too many of them hang."""

    def __init__(self, request: pytest.FixtureRequest) -> None:
        super().__init__()
        self._request = request

    def append(self, one: Cell) -> None:
        """One more."""
        super().append(one)
        if one.code is None and sum(cell.code is None for cell in self) == HANGS:
            note(self._request, self)


def note(request: pytest.FixtureRequest, tried: Sequence[Cell]) -> None:
    """The cells of a test go into the table; those that failed fail it."""
    rows = [cell.row() for cell in tried]
    request.node.user_properties.append((PROPERTY, rows))
    failed = [
        f"handctl {row['line']} ({row['state']}, exit {row['code']}): {row['harm']}" for row in rows if row["harm"]
    ]
    assert not failed, "\n".join(failed)
