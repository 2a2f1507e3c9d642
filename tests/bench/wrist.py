"""The wrist against its wires: one serial read of everything at 115200, three CAN reads at 1 Mbit/s."""

from __future__ import annotations

import os
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.bench.measure import Figure, dump_figure, handctl, served

DUMP_BYTES = 9 + 32
"""[1020, 24]: a request of 9 bytes, a reply of n + 8."""
DUMP_FLOOR_MS = DUMP_BYTES * 10 / 115200 * 1000
CAN_DUMP_BITS = 3 * (67 + 8) + 3 * (67 + 64)
"""Three requests with one data byte, three replies with eight; extended frames of 67 bits + 8 a byte, no stuffing."""
CAN_DUMP_FLOOR_MS = CAN_DUMP_BITS / 1000


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures. The way through python-can, slcan and TCP is longer than the bus: only reported."""
    runs = 9 if quick else 25
    with served("wrist", "--pty", "--wire", "115200") as link:
        name = "wrist dump, 1 read at 115200"
        yield dump_figure(name, link, "wrist", 1, DUMP_FLOOR_MS, 1.10, runs, "pty, wire emulated")
    with served("wrist", "--slcan-tcp", "127.0.0.1:0", "--wire", "1") as link:
        name = "wrist dump, 3 CAN reads at 1 Mbit/s"
        yield dump_figure(name, link, "wrist", 3, CAN_DUMP_FLOOR_MS, None, runs, "slcan over TCP, bus emulated")
    with served("wrist", "--slcan-pty", "--wire", "1") as link:
        path = link.removeprefix("can:slcan:")
        floor = quickest_exchange(path, 40 * runs)
        yield slcan_figure(link, floor, 40 * runs)
        yield cold_figure(link, floor, 2 * runs)
        value = quickest_by_python_can(path, 10 * runs)
        note = "three frames and their answers, without a line of ours"
        yield Figure("the same by python-can alone", value, floor, "ms", None, note, "adapter")


def cold_figure(link: str, floor: float, runs: int) -> Figure:
    """The three reads of a process that has just started, by its own transcript: from the first frame to the last."""
    best = float("inf")
    with tempfile.TemporaryDirectory() as folder:
        for number in range(runs):
            trace = Path(folder) / f"{number}.txt"
            handctl("wrist", "dump", "-p", link, "--trace", str(trace))
            entries = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
            moments = [float(words[0]) for words in entries if words[1] in "<>"]
            best = min(best, moments[-1] - moments[0])
    name = "wrist dump, 3 CAN reads, slcan on a pty, cold process"
    return Figure(name, best * 1000, floor, "ms", 1.50, f"quickest of {runs}, first frame to last", "adapter")


def quickest_by_python_can(path: str, runs: int) -> float:
    """Milliseconds of the three reads by python-can's own slcan interface."""
    import can

    bus = can.Bus(interface="slcan", channel=path, bitrate=1000000, sleep_after_open=0)
    frames = [
        can.Message(arbitration_id=int(line[1:9], 16), data=bytes.fromhex(line[10:-1].decode()), is_extended_id=True)
        for line in SLCAN_DUMP
    ]

    def ask() -> None:
        for frame in frames:
            bus.send(frame, timeout=1.0)
            bus.recv(1.0)

    try:
        return quickest(ask, runs)
    finally:
        bus.shutdown()


def slcan_figure(link: str, floor: float, runs: int) -> Figure:
    """The three reads on one open link, beside the same lines by system calls alone: bus, adapter and pty without us."""
    from handctl.devices.inspire.can_bus import CanBus
    from handctl.link import FrameLink, open_link
    from handctl.model.result import Journal

    opened = open_link(link)
    assert isinstance(opened, FrameLink)
    bus = CanBus(opened, 1, Journal())
    value = quickest(lambda: bus.read(1020, 24), runs)
    opened.close()
    note = f"quickest of {runs}; bus alone {CAN_DUMP_FLOOR_MS:.2f} ms"
    return Figure("wrist dump, 3 CAN reads, slcan on a pty", value, floor, "ms", 1.50, note, "adapter")


def quickest_exchange(path: str, runs: int) -> float:
    """Milliseconds of three requests to an adapter, each with its acknowledgement and its answer."""
    port = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(port)

    def ask(request: bytes, ends: int) -> None:
        os.write(port, request)
        heard = b""
        while heard.count(b"\r") + heard.count(b"\a") < ends:
            heard += os.read(port, 200)

    try:
        ask(b"C\rS8\rO\r", 3)
        return quickest(lambda: [ask(request, 2) for request in SLCAN_DUMP], runs)
    finally:
        os.close(port)


def quickest(work: Callable[[], object], runs: int) -> float:
    """Milliseconds of the quickest run."""
    best = float("inf")
    for _ in range(runs):
        started = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - started)
    return best * 1000


SLCAN_DUMP = (b"T10FF0001108\r", b"T11010001108\r", b"T11030001108\r")
