"""The stop of a process that died, behind a frame that was cut off at any byte: the device hears it all the same.

The link completes a frame that the system took only a part of (test_link_deadman). Here the rest is lost for good, as on
a bad line: the shots by themselves bring the device back to where a frame begins.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from handctl.devices.barrett.realtime import loop
from handctl.devices.barrett.realtime.schedule import Controls
from handctl.devices.inspire.exo import motion
from handctl.link import ByteLink, Deadline, Link
from handctl.link.can import _slcan_frame
from handctl.link.deadman import Guard, Shot
from handctl.sim import create
from handctl.sim.engine.slcan import Adapter
from tests.barrett.realtime import Run
from tests.barrett.support import Simulated
from tests.inspire.wrist_support import fake_wrist
from tests.support.each_row import each_row
from tests.support.scripted import fake_hand, unhex

POSITION = unhex("EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D")
"""Positions 500 400 300 200 100."""
MOVE = unhex("EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37")
"""Yaw 10, pitch -10, 1000 ms (wrist §2.1)."""


def send(link: ByteLink, shots: Sequence[Shot]) -> None:
    """As the child does."""
    for shot in shots:
        link.write(shot.data, Deadline(link.now, link.now() + 1))
        link.sleep(shot.pause)


class Kept(Guard):
    """A guard that only keeps what it is told."""

    def __init__(self) -> None:
        super().__init__(None)
        self.told: list[list[Shot]] = []

    def update(self, stop: Sequence[Shot]) -> None:
        self.told.append(list(stop))


@contextmanager
def kept(kept_here: list[Kept], stop: Sequence[Shot]) -> Iterator[Guard]:
    kept_here.append(Kept())
    kept_here[-1].update(stop)
    yield kept_here[-1]


def shots_of_a_loop(monkeypatch: pytest.MonkeyPatch, controls: Controls) -> tuple[list[Shot], Run]:
    """What the guard of a RealTime loop was told while blocks went out, and the loop."""
    guards: list[Kept] = []
    monkeypatch.setattr(loop, "guarding", lambda _link, stop, _warn: kept(guards, stop))
    run = Run("wire=auto", receive={0: ("position",)}, temperature=False, controls=controls, motors=(0,), guards=()).go(
        5
    )
    assert run.error is None
    (guard,) = guards
    first, *told, last = guard.told
    assert [shot.data for shot in first] == [shot.data for shot in last] == [b"\x03", b"1T\r"] * 3
    (inside,) = told
    assert inside[2:] == first, "once in the loop: velocity 0, and then the same"
    return inside, run


@pytest.mark.parametrize("cut", range(4))
def test_a_control_block_that_was_cut_off(monkeypatch: pytest.MonkeyPatch, cut: int) -> None:
    """Whatever the missing bytes make of the shots, the hand ends at its prompt, its motor without power."""
    controls = Controls({0: ("velocity", "gain")}, {(0, "velocity"): 30, (0, "gain"): 13})
    shots, run = shots_of_a_loop(monkeypatch, controls)
    assert shots[1].data == b"c\x00\x0d", "velocity 0; the gain is kept"
    link = run.link
    assert isinstance(link, Simulated)
    run.hand.line.ask("1FSET LCV 1 LCPG 1 LFV 0 LFS 0 LFAP 1 LFDP 0")
    for data in (b"1LOOP\r", b"C\x1e\x0d", b"C\x1e\x0d"[:cut]):
        link.write(data, Deadline(link.now, link.now() + 1))
        link.sleep(0.05)
    assert "moving" in run.control("motors") or "power on" in run.control("motors")
    send(link, shots)
    link.sleep(0.2)
    motors = run.control("motors")
    assert "power on" not in motors and "moving" not in motors, motors
    assert run.hand.line.ask("1T").status == 0, "it is at its prompt"


@each_row("cut", range(len(POSITION) + 1))
def test_a_command_of_the_exoskeleton_hand_that_was_cut_off(cut: int) -> None:
    hand, link = fake_hand()
    hand.command("position", [1000] * 5)
    hand.command("force", [300] * 5)
    shots = motion._last_shots(hand, [321, 322, 323, 324, 325, 0])
    link.write(POSITION[:cut], Deadline(link.now, link.now() + 1))
    send(link, shots)
    link.sleep(1.0)
    memory = device_of(link).memory
    assert memory[1498:1508] == bytes(10)
    assert memory[1486:1496] == b"".join(place.to_bytes(2, "little") for place in (321, 322, 323, 324, 325))


@each_row("cut", range(len(MOVE) + 1))
def test_a_movement_of_the_wrist_that_was_cut_off(cut: int) -> None:
    wrist, link = fake_wrist("serial")
    shots = wrist._last_shots(wrist.read(angles(wrist)))
    link.write(MOVE[:cut], Deadline(link.now, link.now() + 1))  # type: ignore[union-attr]
    send(link, shots)  # type: ignore[arg-type]
    (pitch, yaw), memory = at(wrist), device_of(link).wrist.memory
    assert memory[1038:1042] == yaw.to_bytes(2, "little", signed=True) + pitch.to_bytes(2, "little", signed=True)


@each_row("cut", range(28))
def test_a_line_of_the_can_adapter_that_was_cut_off(cut: int) -> None:
    """The CR before a frame ends that line: the first of the three is heard already."""
    wrist, _ = fake_wrist("can")
    line = create("wrist", {"bus": "can"})
    adapter = Adapter(line)
    shots = [_slcan_frame(shot.data, shot.can_id) for shot in wrist._last_shots(wrist.read(angles(wrist)))]
    move = _slcan_frame(bytes.fromhex("E80318FCE803"), 0x15038001)
    adapter.feed(b"S8\rO\r")
    adapter.feed(move[:cut])
    adapter.feed(shots[0])
    line.advance(line.device.now + 0.02)
    pitch, yaw = at(wrist)
    memory = line.device.wrist.memory
    assert memory[1038:1042] == yaw.to_bytes(2, "little", signed=True) + pitch.to_bytes(2, "little", signed=True)


def angles(wrist: Any) -> list[Any]:
    return [element for name in ("pitch_actual", "yaw_actual") for element in wrist.map.find(name)[1]]


def at(wrist: Any) -> tuple[int, int]:
    """Pitch and yaw in 0.01 degrees."""
    pitch, yaw = (round(reading.value * 100) for reading in wrist.read(angles(wrist)))
    return pitch, yaw


def device_of(link: Link | Any) -> Any:
    """The simulated device behind recorders and the fake link."""
    while hasattr(link, "inner"):
        link = link.inner
    return link._line.device
