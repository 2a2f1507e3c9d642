"""`trace show` of a large transcript against a plain Python loop that reads the lines and decodes their hex; and its memory."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import HANDCTL, Figure, handctl, peak_kilobytes

SIZE = 32_000_000
GOAL = 20.0
MOST_MEGABYTES = 40.0
"""Of memory, however long the transcript is."""
FORMATS = ("table", "json", "ndjson", "csv", "plain")
PLAIN = """
import sys, time
start, count = time.process_time(), 0
with open(sys.argv[1], encoding="utf-8") as file:
    for line in file:
        words = line.split()
        if len(words) > 2 and words[1] in "<>":
            count += len(bytes.fromhex("".join(words[2:])))
print(time.process_time() - start)
"""
MOVING = "clock=virtual&use=on"
"""Someone uses the device: at rest a device says the same again and again, which is shown from memory."""
RECORDED = {
    "exo": f"fake://exo?jitter=1&{MOVING}",
    "wrist": f"fake://wrist?jitter=1&{MOVING}",
    "barrett": f"fake://barrett?initialized=1&{MOVING}",
    "ekso": f"fake://ekso?{MOVING}",
    "aidin": f"fake://aidin?{MOVING}",
    "hand": f"fake://hand?jitter=1&{MOVING}",
}
PIECES, REALTIME = "ekso, replies in pieces of 8 bytes", "barrett, RealTime"
RECORDED |= {PIECES: RECORDED["ekso"], REALTIME: RECORDED["barrett"]}
"""Each in whole replies with all that changes by itself; an EksoNR's are full answers to GetData."""
LOOP = "barrett", (
    "realtime", "--motors", "G", "--send", "velocity,gain", "--velocity", "5", "--gain", "20",
    "--receive", "velocity,strain,position", "--yes",
)  # fmt: skip
"""What drives the fingers."""
PIECE = 8


def in_pieces(line: str) -> str:
    """A line of a recording, a reply as an adapter hands it on: some bytes at a time."""
    moment, mark, *data = line.split()
    size = PIECE if mark == "<" else len(data)
    pieces = (" ".join(data[start : start + size]) for start in range(0, len(data), size))
    return "".join(f"{moment} {mark} {piece}\n" for piece in pieces)


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    size = SIZE // 8 if quick else SIZE
    for name, link in RECORDED.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "run.txt"
            family, words = LOOP if name == REALTIME else (name.partition(",")[0], ("watch", "--rate", "50"))
            more = ("--count", "4000", "--trace", str(file), "-o", str(Path(folder) / "out"), "-p", link)
            handctl(family, *words, *more)
            head, _, rest = file.read_text(encoding="utf-8").partition("\n")
            if name == PIECES:
                rest = "".join(map(in_pieces, rest.splitlines()))
            file.write_text(f"{head}\n" + rest * max(1, size // len(rest)), encoding="utf-8")
            plain = float(subprocess.check_output([sys.executable, "-c", PLAIN, str(file)]))
            note = f"{file.stat().st_size / 1e6:.0f} MB; user time of the whole process"
            for how in FORMATS:
                before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
                handctl("trace", "show", str(file), "--format", how, "-o", str(Path(folder) / "shown"))
                taken = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
                shown = f"trace show --format {how}, {name}" if how != "table" else f"trace show, {name}"
                yield Figure(shown, taken, plain, "s", GOAL, note, "plain loop")
            words = [HANDCTL, "trace", "show", str(file), "--json", "-o", str(Path(folder) / "json")]
            peak = peak_kilobytes(words) / 1024
            yield Figure(
                f"trace show --json, {name}, memory",
                peak,
                MOST_MEGABYTES,
                "MiB",
                1.0,
                note.partition(";")[0],
                "allowed",
            )
