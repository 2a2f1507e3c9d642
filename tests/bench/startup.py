"""Start-up as multiples of `python -c pass`, and peak memory."""

from __future__ import annotations

from collections.abc import Iterator

from tests.bench.measure import HANDCTL, PASS, Figure, pair, peak_kilobytes

COMMANDS = [
    ("start-up: --version", ["--version"], 2.5),
    ("start-up: -h", ["-h"], 6.0),
    ("start-up: exo dump --fake --json", ["exo", "dump", "--fake", "--json"], 7.0),
    ("start-up: exo dump --fake, rich table", ["exo", "dump", "--fake", "--color", "always"], 10.0),
]


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures; medians of paired runs."""
    for name, arguments, goal in COMMANDS:
        value, floor, ratio = pair([HANDCTL, *arguments], PASS, 7 if quick else 25)
        yield Figure(name, value * 1000, value * 1000 / ratio, "ms", goal, f"python -c pass {floor * 1000:.1f} ms")
    dump = peak_kilobytes([HANDCTL, "exo", "dump", "--fake", "--json"])
    yield Figure("peak memory: exo dump --fake --json", dump / 1024, peak_kilobytes(PASS) / 1024, "MiB", 2.5)
