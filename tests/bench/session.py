"""Many commands on one link against the wire: as a batch, from Python, as programs; and several devices at once."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import HANDCTL, Figure, environment, quickest, served

GET = ("exo", "get", "system_voltage")
WIRE_MS = (9 + 8 + 2) * 10 / 115200 * 1000
"""A request of 9 bytes, an answer of n + 8."""
PTY = "pty, wire emulated"
LOOP = """
import sys, time, handctl
with handctl.connect("exo", sys.argv[1]) as hand:
    hand.get("system_voltage")
    began = time.perf_counter()
    for _ in range(int(sys.argv[2])):
        hand.get("system_voltage")
    print(time.perf_counter() - began)
"""
PLAIN = """
import os, sys, time, tty
port, request, size = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY), bytes.fromhex(sys.argv[3]), int(sys.argv[4])
tty.setraw(port)
def get():
    os.write(port, request)
    reply = b""
    while len(reply) < size:
        reply += os.read(port, size - len(reply))
get()
began = time.perf_counter()
for _ in range(int(sys.argv[2])):
    get()
print(time.perf_counter() - began)
"""
"""The plainest loop that a user would write, without a timeout and without a check."""
PYSERIAL = """
import sys, time, serial
port, request, size = serial.Serial(sys.argv[1], 115200, timeout=1), bytes.fromhex(sys.argv[3]), int(sys.argv[4])
port.write(request); port.read(size)
began = time.perf_counter()
for _ in range(int(sys.argv[2])):
    port.write(request); port.read(size)
print(time.perf_counter() - began)
"""
VOLTAGE = ("EB 90 01 04 11 C0 05 02 DD", "10")
"""The request for system_voltage (1472, two bytes; exo §2.2.2), and the bytes of its reply."""
DEVICES = 8


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    count, tries = (200, 3) if quick else (1000, 5)
    with served("exo", "--pty", "--wire", "115200") as link:
        one, half, whole = (min(batch(link, lines) for _ in range(tries)) for lines in (1, count // 2, count))
        line = (whole - one) / (count - 1) * 1000
        yield Figure(f"batch, get of one exo register, {count} lines", line, WIRE_MS, "ms", 1.2, PTY)
        yield Figure(
            "batch, second half of the lines", (whole - half) * 1000, (half - one) * 1000, "ms", 1.1, PTY, "first half"
        )
        alone = [HANDCTL, *GET, "-p", link, "--json"]
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as script:
            script.write(" ".join(GET))
            script.flush()
            times = quickest([[HANDCTL, "batch", script.name, "-p", link, "--json"], alone], 5 if quick else 15)
        yield Figure("batch of one line", times[0] * 1000, times[1] * 1000, "ms", 1.1, PTY, "the command")
        yield Figure("the same lines, each run as a command of its own", times[1] * 1000, WIRE_MS, "ms", None, PTY)
        loops: tuple[tuple[str, str, tuple[str, ...], float | None], ...] = (
            ("a plain loop, get of one exo register", PLAIN, VOLTAGE, None),
            ("pyserial, get of one exo register", PYSERIAL, VOLTAGE, None),
            ("library, get of one exo register", LOOP, (), 1.12),
        )
        taken = [  # in turns: the machine changes while it is measured
            [looped(code, link, str(count), *words) / count * 1000 for _, code, words, _ in loops] for _ in range(tries)
        ]
        best = [min(column) for column in zip(*taken, strict=True)]
        for (name, _, _, goal), called in zip(loops, best, strict=True):
            yield Figure(name, called, WIRE_MS, "ms", goal, PTY)
        yield Figure("library get, against the plain loop", best[2], best[0], "ms", None, PTY, "the plain loop")
    yield several(5 if quick else 9)


def batch(link: str, lines: int) -> float:
    """Seconds of a batch of so many lines."""
    began = time.perf_counter()
    subprocess.run(
        [HANDCTL, "batch", "-p", link, "--json"], input=f"{' '.join(GET)}\n" * lines, stdout=subprocess.DEVNULL,
        text=True, check=True, env=environment(),
    )  # fmt: skip
    return time.perf_counter() - began


def looped(*words: str) -> float:
    """Seconds that a program of a few lines says its calls took."""
    command = [sys.executable, "-c", *words]
    return float(subprocess.run(command, capture_output=True, text=True, check=True, env=environment()).stdout)


def several(runs: int) -> Figure:
    """Eight simulated devices at once against one."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "config.toml"
        path.write_text(
            "".join(
                f'[devices.d{number}]\nkind = "exo"\nport = "fake://exo?wire=115200"\n' for number in range(DEVICES)
            )
        )
        words = ["/usr/bin/env", f"HANDCTL_CONFIG={path}", HANDCTL, "dump", "--json", "-d"]
        every, one = quickest([[*words, "*"], [*words, "d0"]], runs)
    return Figure(
        f"{DEVICES} simulated devices at once, dump",
        every * 1000,
        one * 1000,
        "ms",
        1.5,
        f"{os.cpu_count()} cores",
        "one device",
    )
