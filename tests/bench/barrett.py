"""The BarrettHand against its wire: the dump, the RealTime loop of §6.4's example, a firmware download."""

from __future__ import annotations

import json
import statistics
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.bench.measure import Event, Figure, handctl, served, traced

TRIPS = 5
"""VERS, which says what a hand has besides, three FGET and one PGET, with their answers; echo and line overlap (dossier 12)."""


@contextmanager
def hand(*options: str) -> Iterator[str]:
    """A simulated hand on a pty with wire time; yields its link."""
    with served("barrett", "--pty", "--wire", "auto", "--set", "initialized=1", *options) as link:
        yield link


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    for speed in (9600, 38400):
        with hand("--set", f"baud={speed}") as link:
            sessions = [dump_milliseconds(link, speed) for _ in range(5 if quick else 15)]
        times, characters = zip(*sessions, strict=True)
        floor = max(characters) * 10 / speed * 1000
        note = f"pty, wire emulated; best {min(times):.1f}; {max(characters)} characters one after the other"
        yield Figure(f"barrett dump, {TRIPS} round trips at {speed}", statistics.median(times), floor, "ms", 1.10, note)
    for speed in (9600, 38400):
        yield from loop_figures(speed, 150 if quick else 1500)
    for window in (1, 2):
        yield download_figure(2048 if quick else 8192, window)


def dump_milliseconds(link: str, speed: int) -> tuple[float, int]:
    """Time from the first byte of the first FGET to the last byte received, from the program's own trace, and the
    characters of that time that cannot overlap: each line until its CR is echoed, then the rest of its answer."""
    events = traced("barrett", "dump", "-p", link, "--baud", str(speed), "--json")
    first = next(number for number, (_, mark, data) in enumerate(events) if mark == ">" and data[:4] == b"FGET")
    session = events[first:]
    asked = [data for _, mark, data in session if mark == ">"]
    if len(asked) != TRIPS:
        raise ValueError(f"{len(asked)} round trips instead of {TRIPS}")
    received = sum(len(data) for _, mark, data in session if mark == "<")
    took = max(when for when, mark, _ in session if mark == "<") - session[0][0]
    return took * 1000, received + len(asked)


LOOP = ("--motors", "124", "--send", "velocity@12", "--receive", "strain@12,delta,temperature", "--velocity", "0")
CONTROL_BYTES, FEEDBACK_BYTES = 3, 8
"""The example of §6.4."""


LAW = (
    *LOOP[:2],
    *LOOP[4:6],
    "--law",
    "velocity.F1 = clamp((P.F1 - P.F1)/20, -40, 40)",
    "--law",
    "velocity.F2 = 0*N",
    "--delta-unit",
    "1",
)
"""The same blocks, their values made by laws: the position is the sum of the deltas."""
WATCH = ("--motors", "124", "--receive", "strain@12,delta,temperature")


def loop_figures(speed: int, blocks: int) -> Iterator[Figure]:
    """Milliseconds a block beside the floors of dossier 12: driving sequentially with all guards (the default), driving
    overlapped (asked for), with laws, and watching, where a block of control is one byte. Goals: 0.97 of the sequential rate, 0.95
    of the overlapped one and with laws, and 455 of the 480 Hz that 38400 bit/s allow a watcher."""
    byte = 10_000 / speed
    floors = {
        "sequential": (CONTROL_BYTES + FEEDBACK_BYTES) * byte,
        "overlapped": (1 + FEEDBACK_BYTES) * byte,
        "pipelined": FEEDBACK_BYTES * byte,
    }
    for name, words, floor, goal in (
        ("driving", LOOP, "sequential", 1 / 0.97),
        ("driving, --overlapped", (*LOOP, "--overlapped"), "overlapped", 1 / 0.95),
        ("driving, --law", LAW, "sequential", 1 / 0.95),
        ("watching", WATCH, "pipelined", 480 / 455),
    ):
        with hand("--set", f"baud={speed}") as link:
            more = ("-p", link, "--baud", str(speed), *words, "--measure", str(blocks), "--json")
            end = json.loads(handctl("barrett", "realtime", *more).splitlines()[-1])["end"]
        rate, latency = end["stream"]["rate_hz"], end["loop"]["latency"]
        note = ", ".join(f"{rate * milliseconds / 1000:.2f} of {each}" for each, milliseconds in floors.items())
        note = f"{rate:.1f} Hz: {note}; p99 {latency['p99_ms']:.1f} ms, {latency['late']} late"
        yield Figure(
            f"barrett realtime at {speed}, {name}", 1000 / rate, floors[floor], "ms", goal, note, f"{floor} wire"
        )


def download_figure(size: int, window: int) -> Figure:
    """Seconds from the first trigger to the last echo; 32 bytes a record, 9600 bit/s (dossier 7.7, 12)."""
    records = size // 32
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.s19"
        lines = [_record(0x2000 + 32 * number, bytes(32)) for number in range(records)]
        file.write_text("\n".join([*lines, "S9030000FC\n"]), encoding="ascii")
        with hand("--set", "switch=2,3", "--set", "download-end=quiet", "--set", "download-quiet=0.5") as link:
            words = ("-p", link, "--baud", "9600", "--yes", "--window", str(window))
            events = traced("barrett", "firmware", "download", str(file), *words)
    seconds = _download_seconds(events, 1 + records * 37)
    # Window 1: triggers and every byte twice; windows above overlap the echo with the next byte.
    characters = (1 + records * 72) if window == 1 else 1 + records * 39
    note = f"pty, wire emulated; {size} bytes, {size / seconds:.0f} bytes/s"
    return Figure(
        f"barrett firmware download, window {window}",
        seconds,
        characters * 10 / 9600,
        "s",
        1.15 if window == 1 else 1.30,
        note,
    )


def _record(address: int, data: bytes) -> str:
    body = bytes([len(data) + 3]) + address.to_bytes(2, "big") + data
    return f"S1{(body + bytes([~sum(body) & 255])).hex().upper()}"


def _download_seconds(events: list[Event], count: int) -> float:
    """From the first trigger behind `:` until the first answer after `count` bytes."""
    place = next(number for number, (_, mark, data) in enumerate(events) if mark == "<" and data.endswith(b":"))
    begun, sent = events[place + 1][0], 0
    for when, mark, data in events[place + 1 :]:
        if mark == ">":
            sent += len(data)
        elif sent >= count:
            return when - begun
    raise SystemExit(f"{sent} bytes instead of {count}")
