"""One command line against one device that means no good."""

from __future__ import annotations

import os
import time
import zlib

from tests.harm import lines
from tests.harm.cell import connected, link_of
from tests.hostile.cell import FORMATS, Cell, Folder, attempt
from tests.hostile.devices import Place

DEADLINE = 3.0
"""Seconds that every second cell has for the whole command."""
GRACE = 3.0
"""Seconds that the end of a write may take beyond."""
STOP_SECONDS = 15.0
"""A stop tries every speed whatever --deadline says, and is bounded by itself."""


def lines_for(place: Place) -> list[lines.Line]:
    """One line a command, of the commands of its family and of those that are of none."""
    found = [listed[0] for listed in lines.examples().values() if listed[0].family in ("", place.kind)]
    return [line for line in found if str(line).startswith(os.environ.get("HANDCTL_HOSTILE_LINE", ""))]


def try_cell(place: Place, line: lines.Line, how: str, folder: Folder) -> Cell:
    """One line against one device."""
    words = line.can if place.wire == "can" and line.can else line.words
    words = tuple(word.replace("{dir}", str(folder.path / (line.family or "exo"))) for word in words)
    more = ("--yes",) if line.asks else ()
    hurry = zlib.crc32(f"{place}|{line}".encode()) % 2
    if hurry:
        more += ("--deadline", str(DEADLINE))
    began = time.process_time()
    with connected(place) as port:  # type: ignore[arg-type]
        code, failure = attempt((*words, "-p", link_of(place), *more, *FORMATS[how]), how, folder)  # type: ignore[arg-type]
        took = port.line._present() - 1.0
    bound = STOP_SECONDS if line.path[-1] == "stop" else DEADLINE + GRACE
    if not failure and hurry and took > bound:
        failure = f"{took:.1f} s on the clock of the link, with --deadline {DEADLINE:g}"
    return Cell(line.family or "tools", f"device: {place.hostility}", f"{line} --{how}", code, failure,
                time.process_time() - began)  # fmt: skip
