"""Every read that a scan or a connect may begin with, of every id at every speed, and every scan of many ids: whether a
BarrettHand in its boot window hears a trigger in it (`tests.barrett.line_receiver`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from tests.barrett import unanswered
from tests.barrett.test_boot_bytes import triggers
from tests.search.suite import Listed, bounded, parts

SECONDS = 120.0
SCANS = (
    ("scan", "--ids", "1-254"),
    *((family, "scan", *more) for family in ("exo", "wrist", "hand") for more in ((), ("--ids", "200-254,1-30"))),
    *((family, "scan", "--all") for family in ("exo", "wrist", "hand")),
)


class BootBytes(Listed):
    """An id, or a scan."""

    name = "boot-bytes"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for number in range(1, 255):
            yield ("id", number), number
        for words in SCANS:
            yield (" ".join(words),), words

    def tried(self, row: Any, folder: Path) -> str:
        with bounded(SECONDS, str(row)):
            ways = (
                unanswered.scans(range(row, row + 1)) if isinstance(row, int) else unanswered.commands(folder, (row,))
            )
            found = triggers(ways)
        assert not found, found
        return "quiet"

    def wanted(self) -> Iterable[str]:
        return ("id", *(" ".join(words) for words in SCANS))

    def shows(self, cell: str) -> Iterator[str]:
        yield parts(cell)[1]


SUITES = (BootBytes(),)
