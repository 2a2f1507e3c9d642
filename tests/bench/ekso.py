"""GetData of the EksoNR against the wire: 66 bytes a sample, 174.5 Hz at 115200 bit/s, through every way to get it."""

from __future__ import annotations

import importlib.util
import json
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.bench.measure import Figure, handctl, served

SAMPLE_BYTES = 6 + 60
"""A request without a body and an answer of 27 words (dossier 9)."""
FLOOR_MS = SAMPLE_BYTES * 10 / 115200 * 1000
GOAL = 1 / 0.95
"""At least 0.95 of the wire's 174.5 Hz."""
LOG_GOAL = 1 / 0.97
"""A recording asks for GetFeedback once a second as well."""


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    count = 500 if quick else 2000
    with served("ekso", "--pty", "--wire", "115200") as link:
        ways: dict[str, Callable[[str, int], float]] = {
            "pyserial": plain,
            "device loop": bare,
            "watch, 15 rows a sample": watch,
            "log, with feedback": log,
        }
        if importlib.util.find_spec("pylsl"):
            ways["log --lsl, with feedback"] = partial(log, more=("--lsl",))
        for name, measured in ways.items():
            rates = [measured(link, count) for _ in range(3)]
            rate = max(rates)  # a process that has to wait for a processor loses samples that the line could carry
            note = f"{rate:.1f} Hz of 174.5, median {statistics.median(rates):.1f}; pty, wire emulated, 3 x {count} samples"
            yield Figure(
                f"ekso GetData at 115200: {name}",
                1000 / rate,
                FLOOR_MS,
                "ms",
                None if name == "pyserial" else LOG_GOAL if name.startswith("log") else GOAL,
                note,
            )


def plain(link: str, count: int) -> float:
    """Samples a second of pyserial alone: what the line, its emulation and a pty leave to any program that asks for nothing besides."""
    import serial

    from handctl.devices.ekso.frames import Command, encode

    moments = []
    with serial.Serial(link, 115200, timeout=1.0) as port:
        for number in range(count):
            port.write(encode(Command.GET_DATA, number))
            if len(port.read(SAMPLE_BYTES - 6)) != SAMPLE_BYTES - 6:
                raise SystemExit("pyserial: no answer")
            moments.append(time.perf_counter())
    return (count - 1) / (moments[-1] - moments[0])


def bare(link: str, count: int) -> float:
    """Samples a second of the port alone, in this process."""
    from handctl.devices.ekso.dataport import DataPort
    from handctl.devices.ekso.frames import Command
    from handctl.link import open_link
    from handctl.model.result import Journal

    opened = open_link(link, baud=115200)
    try:
        port = DataPort(opened, Journal())  # type: ignore[arg-type]
        moments = [port.moment.middle for _ in range(count) if port.read(Command.GET_DATA)]
    finally:
        opened.close()
    return (count - 1) / (moments[-1] - moments[0])


def watch(link: str, count: int) -> float:
    """Samples a second of `watch --json --rate 0`, as its closing line says, with a reader at the other end of a pipe."""
    done = handctl("ekso", "watch", "--json", "--rate", "0", "--count", str(count), "-p", link)
    end = json.loads(done.splitlines()[-1])["end"]["stream"]
    if end["samples"] != count or end["failed"]:
        raise SystemExit(f"watch: {end}")
    return float(end["rate_hz"])


def log(link: str, count: int, more: tuple[str, ...] = ()) -> float:
    """Rows a second of a log by the device's own clock, as its sidecar says."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.csv"
        handctl("ekso", "log", str(file), "--count", str(count), "--json", "-p", link, *more)
        told = json.loads(file.with_name("bench.csv.json").read_text(encoding="utf-8"))
    if told["rows"] != count or told["lost"]:
        raise SystemExit(f"log: {told['rows']} rows, {told['lost']} lost")
    return float(told["rate_hz"])
