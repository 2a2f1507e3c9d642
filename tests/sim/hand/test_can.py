"""CAN of a simulated RH56 hand beyond its vectors: what is silent, what is acknowledged, faults (dossier §2.4)."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from handctl.sim import create
from tests.support.each_row import each_row

ANGLES = 0x01828001  # read from 1546, id 1
FOUR = struct.pack("<4h", 110, 220, 330, 440)


class Bus:
    def __init__(self, **options: object) -> None:
        self.line: Any = create("hand", {"bus": "can", **{name: str(value) for name, value in options.items()}})
        self.now = 0.0
        self.line.advance(0.0)

    def ask(self, identifier: int, data: bytes, seconds: float = 0.01) -> list[tuple[int, bytes]]:
        self.line.feed_frame(identifier, data)
        self.now += seconds
        self.line.advance(self.now)
        frames: list[tuple[int, bytes]] = self.line.take_frames()
        return frames


@each_row(
    ("identifier", "data"),
    [
        pytest.param(ANGLES + 1, b"\x08", id="another id"),
        pytest.param(ANGLES, b"\x00", id="no byte"),
        pytest.param(ANGLES, b"\x09", id="nine bytes"),
        pytest.param(ANGLES, b"\x08\x00", id="a read has one byte"),
        pytest.param(ANGLES + (4 << 26), b"\x08", id="flag of a wrist"),
        pytest.param(ANGLES + (1 << 26), b"", id="writes nothing"),
    ],
)
def test_silence(identifier: int, data: bytes) -> None:
    bus = Bus()
    assert bus.ask(identifier, data) == []
    assert bus.ask(ANGLES, b"\x08") == [(ANGLES, FOUR)]
    assert sum(bus.line.device.hand.acts.values()) == 0


@each_row(("ack", "data"), [("count", b"\x02"), ("empty", b"")])
def test_acknowledgement(ack: str, data: bytes) -> None:
    write = 0x05750001
    assert Bus(ack=ack).ask(write, struct.pack("<h", 600)) == [(write, data)]


def test_tactile_bytes_from_4096_on_are_out_of_reach() -> None:
    """12 bits of address: 4094 is the last word (dossier §2.4)."""
    bus = Bus(model="tp")
    last = 4094 << 14 | 1
    assert bus.ask(last, b"\x02") == [(last, struct.pack("<H", (4094 - 3000) // 2))]


def test_speed_code_1_is_500000_here() -> None:
    bus = Bus(model="tp", bitrate=500000)
    code = 1002 << 14 | 1
    assert bus.line.device.speed == 500000
    assert bus.ask(code, b"\x01") == [(code, b"\x01")]


@each_row("fault", ["silent", "wrong-id", "truncate", "duplicate", "echo", "late", "twin-id", "no-ack", "strict"])
def test_faults(fault: str) -> None:
    bus = Bus(fault=fault)
    heard = bus.ask(ANGLES, b"\x08")
    good = (ANGLES, FOUR)
    if fault in ("silent", "twin-id", "no-ack", "late"):
        assert heard == []
        assert bus.line.acknowledged == (fault != "no-ack")
        assert bus.line.bus_errors == (fault == "twin-id")
    elif fault == "wrong-id":
        assert heard == [(ANGLES + 1, FOUR)]
    elif fault == "truncate":
        assert FOUR.startswith(heard[0][1])
        assert heard[0][1] != FOUR
    else:
        assert heard == {"duplicate": [good, good], "echo": [(ANGLES, b"\x08"), good], "strict": [good]}[fault]
        assert bus.ask(0x05750001, b"\xd0\x07") == [] or fault != "strict"


def test_identifiers_of_can_fd_have_the_length_of_their_own_frame() -> None:
    bus = Bus(model="f1")
    assert bus.ask(0x00142A01, b"\x02") == [(0x00242A01, struct.pack("<h", 1021))]
    assert bus.ask(0x00242A01, b"\x02") == [], "it says two bytes and has one"
    assert bus.ask(0x10041201, b"") == []
