"""The exo against the wire: dump time through an emulated 115200 line, and the full scan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from tests.bench.measure import Figure, dump_figure, handctl, served

DUMP_BYTES = 9 + 18 + 9 + 159
"""[1000, 10] and [1472, 151]: two requests of 9 bytes, replies of n + 8."""
DUMP_FLOOR_MS = DUMP_BYTES * 10 / 115200 * 1000
PROBE_SECONDS = {rate: 9 * 10 / rate for rate in (115200, 57600, 19200)}
PTY = "pty, wire emulated"


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures; the sequential scan only in a whole run."""
    with served("exo", "--pty", "--wire", "115200") as link:
        name = "exo dump, 2 transactions at 115200"
        yield dump_figure(name, link, "exo", 2, DUMP_FLOOR_MS, 1.10, 9 if quick else 25, PTY)
    with served("exo", "--pty", "--wire", "auto") as link:
        found = set()
        for name, window in (("8 ids a window", 8), *(() if quick else (("sequential", 1),))):
            envelope = scan(link, window)
            hits = ", ".join(f"id {row['id']} at {row['baud']}" for row in envelope["rows"])
            found.add(hits)
            note = f"{PTY}, 20 ms for a reply; found {hits}; {envelope['scan']['probes']} probes"
            yield Figure(
                f"exo scan, 254 ids x 3 speeds, {name}", envelope["scan"]["seconds"], floor(window), "s", 1.10, note
            )
        if len(found) != 1:
            raise SystemExit(f"the two scans found different hands: {found}")


def scan(link: str, window: int) -> dict[str, Any]:
    """The envelope of a full scan."""
    envelope: dict[str, Any] = json.loads(
        handctl("exo", "scan", "--all", "--json", "--reply-window", "20", "--window", str(window), "-p", link)
    )
    return envelope


def floor(window: int) -> float:
    """254 x 9 x 10 / baud + ceil(254 / k) x 20 ms, for the three speeds."""
    windows = -(-254 // window)
    return sum(254 * seconds + windows * 0.020 for seconds in PROBE_SECONDS.values())
