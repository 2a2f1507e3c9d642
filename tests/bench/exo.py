"""The exo against the wire: dump time through an emulated 115200 line, and the full scan."""

from __future__ import annotations

import json
from collections.abc import Iterator

from tests.bench.measure import Figure, dump_figure, handctl, served

DUMP_BYTES = 9 + 18 + 9 + 159
"""[1000, 10] and [1472, 151]: two requests of 9 bytes, replies of n + 8."""
DUMP_FLOOR_MS = DUMP_BYTES * 10 / 115200 * 1000
SCAN_SECONDS = 6.0
PTY = "pty, wire emulated"


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    with served("exo", "--pty", "--wire", "115200") as link:
        name = "exo dump, 2 transactions at 115200"
        yield dump_figure(name, link, "exo", 2, DUMP_FLOOR_MS, 1.10, 9 if quick else 25, PTY)
    with served("exo", "--pty", "--wire", "auto") as link:
        envelope = json.loads(handctl("exo", "scan", "--all", "--json", "-p", link))
        hits = ", ".join(f"id {row['id']} at {row['baud']}" for row in envelope["rows"])
        note = f"{PTY}, 3 ms for an answer to begin; found {hits}; {envelope['scan']['probes']} probes"
        yield Figure(
            "exo scan, 254 ids x 3 baud rates", envelope["scan"]["seconds"], SCAN_SECONDS, "s", 1.0, note, "limit"
        )
