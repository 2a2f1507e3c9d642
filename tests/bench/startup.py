"""Start-up as multiples of `python -c pass`, peak memory, and the single file beside the installed program."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import HANDCTL, PASS, Figure, peak_kilobytes, quickest

COMMANDS = [
    ("start-up, --version", ["--version"], 2.5),
    ("start-up, -h", ["-h"], 4.5),
    ("start-up, exo dump --fake --json", ["exo", "dump", "--fake", "--json"], 6.0),
    ("start-up, exo dump --fake, rich table", ["exo", "dump", "--fake", "--color", "always"], 9.0),
]
SINGLE = [("-h", ["-h"]), ("exo dump --fake", ["exo", "dump", "--fake"])]


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures; the quickest of runs in turn."""
    runs = 9 if quick else 40
    for name, arguments, goal in COMMANDS:
        value, floor = quickest([[HANDCTL, *arguments], PASS], runs)
        note = f"quickest of {runs}"
        yield Figure(name, value * 1000, floor * 1000, "ms", goal, note, "python -c pass")
    dump = peak_kilobytes([HANDCTL, "exo", "dump", "--fake", "--json"])
    floor = peak_kilobytes(PASS)
    yield Figure("peak memory, exo dump --fake --json", dump / 1024, floor / 1024, "MiB", 2.5, "", "python -c pass")
    yield from single_file(9 if quick else 25)


def single_file(runs: int) -> Iterator[Figure]:
    """handctl.pyz in an isolated interpreter."""
    from handctl import build_zipapp

    with tempfile.TemporaryDirectory() as folder:
        pyz = Path(folder) / "handctl.pyz"
        build_zipapp.build(pyz)
        for name, arguments in SINGLE:
            single, installed = quickest(
                [[sys.executable, "-I", str(pyz), *arguments], [sys.executable, "-m", "handctl", *arguments]], runs
            )
            note = f"quickest of {runs}"
            yield Figure(
                f"start-up of handctl.pyz, {name}", single * 1000, installed * 1000, "ms", 1.5, note, "installed"
            )
