"""One command line against one device that means no good."""

from __future__ import annotations

import zlib

from tests.harm import lines
from tests.harm.cell import connected, link_of
from tests.hostile.cell import FORMATS, Folder, Tried, attempt
from tests.hostile.devices import Place

DEADLINE = 3.0
"""Seconds that every second cell has for the whole command."""
GRACE = 3.0
"""Seconds that the end of a write may take beyond."""
STOP_SECONDS = 15.0
"""A stop tries every speed whatever --deadline says, and is bounded by itself."""


HOWS = ("json", "table", "json", "csv", "json", "plain", "always")
"""The formats take turns."""


def how_of(place: Place, line: lines.Line) -> str:
    """The format of a cell."""
    return HOWS[zlib.crc32(f"{line}{place}".encode()) % len(HOWS)]


def lines_for(place: Place) -> list[lines.Line]:
    """One line a command, of the commands of its family and of those that are of none."""
    return [listed[0] for listed in lines.examples().values() if listed[0].family in ("", place.kind)]


def try_cell(place: Place, line: lines.Line, how: str, folder: Folder) -> Tried:
    """One line against one device."""
    words = line.can if place.wire == "can" and line.can else line.words
    words = tuple(word.replace("{dir}", str(folder.path / (line.family or "exo"))) for word in words)
    more = ("--yes",) if line.asks else ()
    hurry = zlib.crc32(f"{place}|{line}".encode()) % 2
    if hurry:
        more += ("--deadline", str(DEADLINE))
    with connected(place) as port:  # type: ignore[arg-type]
        done = attempt((*words, "-p", link_of(place), *more, *FORMATS[how]), how, folder)  # type: ignore[arg-type]
        took = port.line.now - 1.0
    bound = STOP_SECONDS if line.path[-1] == "stop" else DEADLINE + GRACE
    if not done.failure and hurry and took > bound:
        return done._replace(failure=f"{took:.1f} s on the clock of the link, with --deadline {DEADLINE:g}")
    return done
