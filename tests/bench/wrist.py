"""The wrist against its wires: one serial read of everything at 115200, three CAN reads at 1 Mbit/s."""

from __future__ import annotations

from collections.abc import Iterator

from tests.bench.measure import Figure, dump_figure, served

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
