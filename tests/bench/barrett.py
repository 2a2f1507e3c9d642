"""The BarrettHand against its wire: everything it has in four round trips, at 9600 and at 38400 bit/s."""

from __future__ import annotations

import json
import statistics
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.bench.measure import HANDCTL, Figure

DUMP_CHARACTERS = 720
"""Three FGET and one PGET with CR, and their answers with echo and prompt; echo and line overlap (dossier 12)."""


@contextmanager
def served(*options: str) -> Iterator[str]:
    """A simulated hand on a pty with wire time; yields its link."""
    command = [HANDCTL, "sim", "barrett", "--pty", "--wire", "auto", "--set", "initialized=1", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["link"]
        finally:
            process.terminate()


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    for speed in (9600, 38400):
        floor = DUMP_CHARACTERS * 10 / speed * 1000
        with served("--set", f"baud={speed}") as link:
            sessions = [dump_milliseconds(link, speed) for _ in range(5 if quick else 15)]
        times, characters = zip(*sessions, strict=True)
        note = f"pty, wire emulated; best {min(times):.1f}; {max(characters)} characters one after the other"
        yield Figure(f"barrett dump, 4 round trips at {speed}", statistics.median(times), floor, "ms", 1.10, note)


def dump_milliseconds(link: str, speed: int) -> tuple[float, int]:
    """Time from the first byte of the first FGET to the last byte received, from the program's own trace, and the
    characters of that time that cannot overlap: each line until its CR is echoed, then the rest of its answer."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.txt"
        subprocess.run(
            [HANDCTL, "barrett", "dump", "-p", link, "--baud", str(speed), "--json", "--trace", str(trace)],
            stdout=subprocess.DEVNULL,
            check=True,
        )
        lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if line[0] not in "#"]
    events = [(float(words[0]), words[1], bytes.fromhex("".join(words[2:]))) for words in lines if words[1] in "<>"]
    first = next(number for number, (_, mark, data) in enumerate(events) if mark == ">" and data[:4] == b"FGET")
    session = events[first:]
    asked = [data for _, mark, data in session if mark == ">"]
    if len(asked) != 4:
        raise SystemExit(f"{len(asked)} round trips instead of 4")
    received = sum(len(data) for _, mark, data in session if mark == "<")
    took = max(when for when, mark, _ in session if mark == "<") - session[0][0]
    return took * 1000, received + len(asked)
