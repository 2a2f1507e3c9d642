"""The wrist against its wires: one serial read of everything at 115200, three CAN reads at 1 Mbit/s."""

from __future__ import annotations

import json
import statistics
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.bench.measure import HANDCTL, Figure

DUMP_BYTES = 9 + 32
"""[1020, 24]: a request of 9 bytes, a reply of n + 8."""
DUMP_FLOOR_MS = DUMP_BYTES * 10 / 115200 * 1000
CAN_DUMP_BITS = 3 * (67 + 8) + 3 * (67 + 64)
"""Three requests with one data byte, three replies with eight; extended frames of 67 bits + 8 a byte, no stuffing."""
CAN_DUMP_FLOOR_MS = CAN_DUMP_BITS / 1000


@contextmanager
def served(*options: str) -> Iterator[str]:
    """A simulated wrist with wire time; yields its link."""
    command = [HANDCTL, "sim", "wrist", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield json.loads(process.stdout.readline())["link"]
        finally:
            process.terminate()


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    runs = 7 if quick else 25
    with served("--pty", "--wire", "115200") as link:
        sessions = [dump_milliseconds(link, 1) for _ in range(runs)]
        note = f"pty, wire emulated; best {min(sessions):.2f}"
        yield Figure("wrist dump, 1 read at 115200", statistics.median(sessions), DUMP_FLOOR_MS, "ms", 1.35, note)
    with served("--slcan-tcp", "127.0.0.1:0", "--wire", "1") as link:
        sessions = [dump_milliseconds(link, 3) for _ in range(runs)]
        note = f"slcan over TCP, bus time emulated; best {min(sessions):.2f}"
        yield Figure("wrist dump, 3 CAN reads", statistics.median(sessions), CAN_DUMP_FLOOR_MS, "ms", None, note)


def dump_milliseconds(link: str, transactions: int) -> float:
    """Time between the first byte sent and the last received, from the program's own trace."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.txt"
        subprocess.run(
            [HANDCTL, "wrist", "dump", "-p", link, "--json", "--trace", str(trace)],
            stdout=subprocess.DEVNULL,
            check=True,
        )
        lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    sent = [float(words[0]) for words in lines if words[1] == ">"]
    received = [float(words[0]) for words in lines if words[1] == "<"]
    if len(sent) != transactions:
        raise SystemExit(f"{len(sent)} transactions instead of {transactions}")
    return (max(received) - min(sent)) * 1000
