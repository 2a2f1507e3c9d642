"""`handctl plot` of an hour at 50 Hz against csv.reader reading the same file; and the size of the picture."""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import Figure, handctl

RATE, SECONDS = 50, 3600
GOAL = 5.0
LARGEST_MB = 1.0
PLAIN = """
import csv, sys, time
start = time.process_time()
with open(sys.argv[1], encoding="utf-8", newline="") as file:
    for row in csv.reader(file):
        pass
print(time.process_time() - start)
"""


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    with tempfile.TemporaryDirectory() as folder:
        file, picture = Path(folder) / "hour.csv", Path(folder) / "hour.svg"
        handctl("hand", "log", str(file), "--count", "1", "-p", "fake://hand?clock=virtual")
        header = file.read_text(encoding="utf-8").partition("\n")[0].strip()
        columns = len(header.split(",")) - 8  # but time and numbers of a row, errors and mark
        with file.open("w", encoding="utf-8") as out:
            out.write(f"{header}\n")
            for row in range(RATE * SECONDS // (4 if quick else 1)):
                wave = [
                    str(int(500 + 400 * math.sin(row / 1500 + place) + row * 7919 % 13)) for place in range(columns)
                ]
                out.write(
                    f"{1.8e9 + row / RATE:.6f},{row / RATE:.6f},{row / RATE:.3f},1,{row},0.4,{','.join(wave)},,\n"
                )
        plain = float(subprocess.check_output([sys.executable, "-c", PLAIN, str(file)]))
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        handctl("plot", str(file), "-o", str(picture))
        taken = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        note = f"{file.stat().st_size / 1e6:.0f} MB, {columns} curves; user time of the whole process"
        yield Figure("plot, 1 h at 50 Hz", taken, plain, "s", GOAL, note, "csv.reader")
        yield Figure(
            "plot, size of the picture",
            picture.stat().st_size / 1e6,
            LARGEST_MB,
            "MB",
            1.0,
            "all curves move",
            "allowed",
        )
