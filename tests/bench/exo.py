"""The exo against the wire: dump time through an emulated 115200 line, and the full scan."""

from __future__ import annotations

import json
import statistics
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.bench.measure import HANDCTL, Figure

DUMP_BYTES = 9 + 18 + 9 + 159
"""[1000, 10] and [1472, 151]: two requests of 9 bytes, replies of n + 8."""
DUMP_FLOOR_MS = DUMP_BYTES * 10 / 115200 * 1000
PROBE_SECONDS = {rate: 9 * 10 / rate for rate in (115200, 57600, 19200)}


@contextmanager
def served(*options: str) -> Iterator[str]:
    """A simulated exo on a pty with wire time; yields its link."""
    command = [HANDCTL, "sim", "exo", "--pty", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["link"]
        finally:
            process.terminate()


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    with served("--wire", "115200") as link:
        sessions = [_dump_milliseconds(link) for _ in range(7 if quick else 25)]
        yield Figure(
            "exo dump, 2 transactions at 115200",
            statistics.median(sessions),
            DUMP_FLOOR_MS,
            "ms",
            1.10,
            "pty, wire emulated",
        )
    if quick:
        return
    with served("--wire", "auto") as link:
        found = set()
        for name, window, floor in (("sequential", 1, _floor(1)), ("8 ids a window", 8, _floor(8))):
            envelope = _scan(link, window)
            found.add(json.dumps(envelope["rows"]))
            yield Figure(
                f"exo scan, 254 ids x 3 speeds, {name}", envelope["scan"]["seconds"], floor, "s", 1.10, _hits(envelope)
            )
        if len(found) != 1:
            raise SystemExit(f"the two scans found different hands: {found}")


def _dump_milliseconds(link: str) -> float:
    """Time between the first byte sent and the last received, from the program's own trace."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.txt"
        subprocess.run(
            [HANDCTL, "exo", "dump", "-p", link, "--json", "--trace", str(trace)], stdout=subprocess.DEVNULL, check=True
        )
        lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    sent = [float(words[0]) for words in lines if words[1] == ">"]
    received = [float(words[0]) for words in lines if words[1] == "<"]
    if len(sent) != 2:
        raise SystemExit(f"{len(sent)} transactions instead of 2")
    return (max(received) - min(sent)) * 1000


def _scan(link: str, window: int) -> dict[str, dict[str, float]]:
    command = [HANDCTL, "exo", "scan", "--all", "--json", "--reply-window", "20", "--window", str(window), "-p", link]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    envelope: dict[str, dict[str, float]] = json.loads(done.stdout)
    return envelope


def _hits(envelope: dict[str, dict[str, float]]) -> str:
    hits = [f"id {row['id']} at {row['baud']}" for row in envelope["rows"] if isinstance(row, dict)]
    return f"found {', '.join(hits)}; {envelope['scan']['probes']} probes"


def _floor(window: int) -> float:
    """254 x 9 x 10 / baud + ceil(254 / k) x 20 ms, for the three speeds."""
    windows = -(-254 // window)
    return sum(254 * seconds + windows * 0.020 for seconds in PROBE_SECONDS.values())
