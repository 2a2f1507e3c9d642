"""`export` of a recording against csv.reader, which only splits its lines: processor time without the start, in turns in one process, and memory."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from handctl.model.export_formats import FORMATS
from tests.bench.measure import HANDCTL, Figure, environment, handctl, peak_kilobytes

LINK = "fake://ekso?clock=virtual&posture=walking"
ROWS = 240_000
"""Two hours at 33 Hz."""
GOAL = 3.0
MOST_MEGABYTES = 80.0
TIMED = """
import csv, json, shutil, sys, time
from handctl.cli import main
short, log, out, runs, *words = sys.argv[1:]
def spent(call):
    began = time.process_time()
    call()
    return time.process_time() - began
def split():
    with open(log, newline="") as file:
        for row in csv.reader(file):
            pass
def export(path):
    shutil.rmtree(out, ignore_errors=True)
    sys.argv = ["handctl", "ekso", "export", path, *words, "-o", out, "--quiet"]
    try:
        code = main()
    except SystemExit as done:
        code = done.code
    if code:
        raise SystemExit(f"export: {code}")
export(short)
taken = [(spent(split), spent(lambda: export(log))) for _ in range(int(runs))]
print(json.dumps([min(column) for column in zip(*taken)]))
"""


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    with tempfile.TemporaryDirectory() as folder:
        short, log = (str(Path(folder) / f"{name}.csv") for name in ("short", "log"))
        rows = ROWS // 4 if quick else ROWS
        for path, count in ((short, 10), (log, rows)):
            handctl("ekso", "log", path, "--count", str(count), "-p", LINK, "--quiet")
        note = f"{rows:,} rows, {Path(log).stat().st_size / 1e6:.0f} MB"
        for kind in ("csv", "mot", *FORMATS):
            if kind in FORMATS and FORMATS[kind].library and not importlib.util.find_spec(FORMATS[kind].library):
                continue
            out, words = str(Path(folder) / f"out.{kind}"), ["--to", kind]
            code = [sys.executable, "-c", TIMED, short, log, out, "3", *words]
            done = subprocess.run(code, stdout=subprocess.PIPE, text=True, check=True, env=environment()).stdout
            floor, taken = json.loads(done.splitlines()[-1])
            yield Figure(f"export --to {kind}", taken, floor, "s", GOAL, f"{note}; without the start", "csv.reader")
            words += ["-o", str(Path(folder) / f"again.{kind}"), "--quiet"]
            peak = peak_kilobytes([HANDCTL, "ekso", "export", log, *words]) / 1024
            yield Figure(f"export --to {kind}, memory", peak, MOST_MEGABYTES, "MiB", 1.0, note, "allowed")
