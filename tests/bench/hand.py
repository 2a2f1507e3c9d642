"""The RH56 hands against their wires: the live state in one read, the dump in two, the skin, the search for id 1.

The floor of a read is the same request and answer by system calls alone, in turn with ours, on the same simulated line: the input is emptied, the
request written, the answer waited for with an end. Of both the quickest counts: what else the machine does only ever adds.
"""

from __future__ import annotations

import os
import select
import socket
import termios
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing

from handctl.devices.inspire import modbus_frames
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.hand.probe import TARGET
from handctl.devices.inspire.hand.register_map import DF, TP
from handctl.devices.inspire.hand.tactile import ZONES, tactile
from handctl.devices.inspire.id_search import FIRST_SECONDS, LATE_SECONDS
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.modbus_frames import RTU_SPEED
from handctl.devices.inspire.register_bus import RegisterBus
from handctl.devices.inspire.scan import sweep
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.link import ByteLink, open_link
from handctl.model.result import Journal
from handctl.model.scan_task import ScanTask
from tests.bench.measure import Figure, served

LIVE = (1534, 90)
"""Stroke to temperature."""
DUMP = ((1000, 56), (1472, 152))
"""What a DF documents, in two reads."""
READ = 9
ANSWER = 8
"""Bytes of an EB90 request, and of an answer beside what it carries."""
PTY = "pty, wire emulated"
BARE = "system calls"
CHUNK = 25
"""Exchanges of ours, then as many bare ones: the machine changes while it is measured."""
ZONE_READS = 17
RTU_SILENCE = FIRST_SECONDS + LATE_SECONDS
"""For which a speed is listened to in Modbus RTU: an answer over Bluetooth may be as late."""
SPEED_CHECK = 2 * 0.3
"""Two questions at another speed, and their timeouts: whether the speed matters."""


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures."""
    rounds = 4 if quick else 20
    for speed in (115200, 921600):
        with served("hand", "--model", "tp", "--pty", "--wire", "auto", "--set", f"baud={speed}") as link:
            ours, bare = side_by_side(link, speed, [LIVE], rounds)
            note = f"{PTY}; the bytes alone {wire_ms([LIVE], speed):.2f} ms"
            yield Figure(f"hand live state, 1 read at {speed}", ours, bare, "ms", 1.05, note, BARE)
    with served("hand", "--model", "df", "--pty", "--wire", "115200") as link:
        ours, bare = side_by_side(link, 115200, DUMP, rounds)
        note = f"{PTY}; the bytes alone {wire_ms(DUMP, 115200):.2f} ms; counted: {dump_reads(link)} reads"
        yield Figure("hand dump, 2 reads at 115200", ours, bare, "ms", 1.05, note, BARE)
    with served("hand", "--model", "tp", "--modbus-tcp", "127.0.0.1:0") as link:
        yield from over_tcp(link, rounds)
    yield searched()


def wire_ms(reads: Sequence[tuple[int, int]], speed: int) -> float:
    """The time of the bytes."""
    return sum(READ + count + ANSWER for _, count in reads) * 10 / speed * 1000


def request(address: int, count: int) -> bytes:
    """An EB90 read, made here."""
    inner = bytes([1, 4, 0x11, *address.to_bytes(2, "little"), count])
    return b"\xeb\x90" + inner + bytes([sum(inner) % 256])


def quickest(ours: Callable[[], object], bare: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Milliseconds of the quickest of each, in turn."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for call, found in zip((ours, bare), times, strict=True):
            call()  # the first after the other one finds a cold cache
            found += [milliseconds(call) for _ in range(CHUNK)]
    return min(times[0]), min(times[1])


def milliseconds(call: Callable[[], object]) -> float:
    """Of one call."""
    began = time.perf_counter()
    call()
    return (time.perf_counter() - began) * 1000


def side_by_side(link: str, speed: int, reads: Sequence[tuple[int, int]], rounds: int) -> tuple[float, float]:
    """Milliseconds of these reads by handctl, and by system calls on a port of their own."""
    opened = open_link(link, baud=speed)
    assert isinstance(opened, ByteLink)
    port = os.open(link, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(port)
    attributes = termios.tcgetattr(port)
    attributes[4] = attributes[5] = getattr(termios, f"B{speed}")
    termios.tcsetattr(port, termios.TCSANOW, attributes)
    bus = SerialBus(opened, 1, Journal())

    def ours() -> None:
        for address, count in reads:
            bus.read(address, count)

    def bare() -> None:
        for address, count in reads:
            while select.select([port], [], [], 0)[0]:
                os.read(port, 4096)
            os.write(port, request(address, count))
            missing = count + ANSWER
            while missing and select.select([port], [], [], 1.0)[0]:
                missing -= len(os.read(port, 4096))

    try:
        return quickest(ours, bare, rounds)
    finally:
        os.close(port)
        opened.close()


def hand_at(bus: RegisterBus, model: str | None) -> Hand:
    """The device as a command has it."""
    gate = ModelGate(model, False)
    bus.gate = gate
    return Hand(bus, gate)


def dump_reads(link: str) -> int:
    """Questions of a whole dump."""
    opened = open_link(link, baud=115200)
    assert isinstance(opened, ByteLink)
    with closing(opened):
        hand = hand_at(SerialBus(opened, 1, Journal()), DF)
        assert hand.dump().failure is None
        return hand.journal.counters.sent


def over_tcp(link: str, rounds: int) -> Iterator[Figure]:
    """The live state in one round trip, and the skin."""
    opened = open_link(link)
    assert isinstance(opened, ByteLink)
    host, _, port = link.removeprefix("tcp://").rpartition(":")
    with closing(opened), socket.create_connection((host, int(port))) as plain:
        plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        bus = ModbusBus(opened, 1, Journal(), tcp=True)
        asked = modbus_frames.tcp(1, modbus_frames.read_request(LIVE[0], LIVE[1] // 2))

        def bare() -> None:
            plain.sendall(asked)
            missing = modbus_frames.MBAP + 2 + LIVE[1]
            while missing:
                missing -= len(plain.recv(missing))

        ours, floor = quickest(lambda: bus.read(*LIVE), bare, 4 * rounds)
        yield Figure("hand live state over Modbus TCP", ours, floor, "ms", 10.0, "1 round trip", "send and recv")
        hand = hand_at(ModbusBus(opened, 1, Journal(), tcp=True), TP)
        hand.bus.read(*LIVE)
        before = hand.journal.counters.sent
        took = milliseconds(lambda: hand.bus.read(*LIVE))
        yield Figure(
            "the same, requests and replies",
            hand.journal.counters.sent - before,
            1,
            "round trip",
            1.0,
            f"{took:.2f} ms",
            "fewest",
        )
        before = hand.journal.counters.sent
        took = milliseconds(lambda: tactile(hand, ZONES))
        reads = hand.journal.counters.sent - before
        note = f"{sum(zone.size for zone in ZONES) // 2} values, {took:.1f} ms"
        yield Figure("hand skin over Modbus TCP, reads", reads, ZONE_READS, "reads", 1.0, note, "one per zone")


def searched() -> Figure:
    """Id 1 at each speed in each protocol: the slowest search. Raises AssertionError where one is not found."""
    slowest = 0.0
    for speed in TARGET.speeds:
        for protocol in ("eb90", "modbus"):
            options = ("--model", "tp", "--pty", "--set", f"baud={speed}", "--set", f"speaks={protocol}")
            # Modbus RTU is asked at one speed only, but where it is typed: a BarrettHand may act upon it.
            typed = "auto" if speed == RTU_SPEED else protocol
            with served("hand", *options, "--wire", "auto") as link:
                seconds, found = search(link, typed)
            assert found == [(speed, 1)], f"{protocol} at {speed}: {found}"
            slowest = max(slowest, seconds)
    note = f"slowest of {2 * len(TARGET.speeds)}; --protocol typed, but at {RTU_SPEED} bit/s"
    least = (len(TARGET.speeds) - 1) * RTU_SILENCE + SPEED_CHECK  # the last speed, in Modbus RTU
    return Figure("hand scan, id 1 at each speed and protocol", slowest, least, "s", 1.1, note, "waits")


def search(link: str, protocol: str) -> tuple[float, list[tuple[object, object]]]:
    """Seconds of a search that stops at the first hand, and (speed, id) of what it found."""
    opened = open_link(link, baud=115200)
    assert isinstance(opened, ByteLink)
    with closing(opened):
        task = ScanTask(ids=[1], own={"protocol": protocol})
        began = time.perf_counter()
        sweep(opened, Journal(), None, task, [TARGET])
        return time.perf_counter() - began, [(row["baud"], row["id"]) for row in task.rows]
