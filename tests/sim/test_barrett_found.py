"""The simulated hand as a client may find it, its boot told in one chunk or apart, and what its receiver makes of pulses.

Expectations are made by hand: bits on paper, bytes of the dossier; no host code is used.
"""

from __future__ import annotations

import pytest

from handctl.sim import create
from handctl.sim.barrett.shared_state import STATES
from handctl.sim.bus.wire_pair import resample
from tests.support.each_row import each_row


class Bench:
    """A hand in virtual time; every byte that came is kept with its moment."""

    def __init__(self, **options: object) -> None:
        self.line = create("barrett", {name.replace("_", "-"): str(value) for name, value in options.items()})
        self.line.client_baud = 9600
        self.now = 0.0
        self.line.advance(0.0)
        self.chunks: list[tuple[float, bytes]] = []
        self.wait(0.0)

    def wait(self, seconds: float) -> bytes:
        came, end = b"", self.now + seconds
        while True:
            if data := self.line.take():
                self.chunks.append((round(self.now, 3), data))
                came += data
            event = self.line.next_event()
            self.now = end if event is None else max(self.now, min(event, end))
            self.line.advance(self.now)
            if self.now >= end:
                data = self.line.take()
                if data:
                    self.chunks.append((round(self.now, 3), data))
                return came + data

    def send(self, data: bytes, seconds: float = 0.2) -> bytes:
        self.line.feed(data)
        return self.wait(seconds)

    def image(self) -> str:
        return str(self.line.command("image")).partition(",")[0]


BANNER = b"\n\rBarrettHand Firmware\n\rVersion 4.33"


def test_boot_apart() -> None:
    bench = Bench(found="boot", boot=0.4)
    bench.wait(1.0)
    assert bench.chunks == [(0.0, b":"), (0.4, BANNER + b"\n\r=> ")]


def test_boot_in_one_chunk() -> None:
    bench = Bench(found="boot", boot=0.4, boot_chunk="together")
    bench.wait(1.0)
    assert bench.chunks == [(0.4, b":" + BANNER + b"\n\r=> ")]
    bench.line.power_cycle()
    bench.wait(1.0)
    assert bench.chunks[1:] == [(1.4, b":" + BANNER + b"\n\r=> ")]


def test_banner_and_prompt_apart() -> None:
    bench = Bench(found="boot", boot=0.4, banner_gap=0.3)
    assert bench.wait(0.5) == BANNER  # its : came before
    assert bench.send(b"VERS\r", 0.1) == b""  # nothing is heard before the prompt
    assert bench.wait(0.2) == b"\n\r=> "
    assert bench.send(b"\r") == b"\n\r=> "


@each_row("window", [0.1, 0.5, 1.0, 2.0, 5.0])
def test_a_trigger_in_the_window_only(window: float) -> None:
    """FF and a whole byte count in the window begin a download; behind it they are noise of the line."""
    for moment, expected in ((window - 0.02, "image partial"), (window + 0.05, "image valid")):
        bench = Bench(found="boot", boot=window, window=window)
        bench.wait(moment)
        bench.send(b"\xff\xff\x00\x20\x08\xff\x55")
        assert bench.image() == expected


FOUND = {
    "ready": (b"\n\r=> ", b"\n\r=> "),
    "off": (b"", b""),
    "boot": (b"", b""),
    "monitor": (b"", b""),
    "record": (b"\r", b"\r"),  # our guess: what is no trigger comes back
    "loop": (b"\n\rERR 2048\n\r=> ", b"\n\r=> "),
    "loop-moving": (b"\n\rERR 2048\n\r=> ", b"\n\r=> "),
    "loop-block": (b"", b""),  # control data
    "moving": (b"", b""),
    "saving": (b"", b""),
    "typed": (b"\n\rERR 4\n\r=> ", b"\n\r=> "),  # C is carried out: a bare CR is no harmless question
}


def test_every_state_is_known() -> None:
    assert FOUND.keys() == set(STATES)


@each_row("state", FOUND)
def test_what_a_bare_return_meets(state: str) -> None:
    bench = Bench(found=state)
    first, second = FOUND[state]
    assert bench.send(b"\r", 0.05).removeprefix(b":") == first
    assert bench.send(b"\r", 0.05) == second
    assert bench.image() == ("image blank" if state in ("monitor", "record") else "image valid")


def test_moving_goes_on_by_itself() -> None:
    for state in ("moving", "loop-moving"):
        bench = Bench(found=state)
        bench.wait(0.5)
        first = bench.line.command("motors")
        bench.wait(0.5)
        assert "moving" in first
        assert bench.line.command("motors") != first


def test_found_by_control() -> None:
    bench = Bench()
    assert bench.line.command("found moving") == "found moving"
    assert "moving" in bench.line.command("motors")
    with pytest.raises(ValueError, match="unknown state 'asleep'"):
        bench.line.command("found asleep")


def test_blank_firmware_is_a_fault() -> None:
    bench = Bench(fault="blank-firmware")
    assert bench.image() == "image blank"
    assert bench.send(b"\r") == b""
    echoing = Bench(fault="blank-firmware", monitor_echo=1)
    assert echoing.send(b"~\r") == b"~\r"
    bench = Bench()
    bench.line.command("fault blank-firmware")
    assert bench.image() == "image blank"
    assert bench.send(b"\r") == b""


@each_row(
    ("data", "sent", "receiver", "expected"),
    [
        # 26 us low, then 26 high: in the middle of a bit of 104 us CR is low, at samples 3 5 7 it is low twice.
        ("0D", 38400, "mid", "FE"),
        ("0D", 38400, "sci", "FF"),
        ("03", 38400, "mid", "FF"),
        ("03", 38400, "sci", "FF"),
        ("7E", 38400, "mid", ""),  # high in the middle: a glitch
        ("7E", 38400, "sci", "FF"),
        ("21 0D", 38400, "mid", "F5"),
        ("21 0D", 38400, "sci", "F8"),
        ("21 0D", 19200, "mid", "9C"),
        ("21 0D", 19200, "sci", "38"),
        ("00", 9600, "sci", "00"),
        ("55 AA 00 FF", 9600, "sci", "55 AA 00 FF"),
    ],
)
def test_receivers_at_9600(data: str, sent: int, receiver: str, expected: str) -> None:
    assert resample(bytes.fromhex(data), sent, 9600, receiver).hex(" ").upper() == expected


@each_row("receiver", ["mid", "sci"])
def test_a_pulse_at_38400_is_a_trigger_at_9600(receiver: str) -> None:
    """^C of a client at 38400 in the boot window begins a download; the same at 9600 does nothing."""
    bench = Bench(found="boot", boot=2, uart=receiver, image_records=1)
    bench.line.client_baud = 38400
    for byte in b"\x03" * 7:
        bench.send(bytes([byte]), 0.01)
    assert bench.image() == "image partial"
    bench = Bench(found="boot", boot=2, uart=receiver)
    bench.send(b"\x03" * 7)
    assert bench.image() == "image valid"
