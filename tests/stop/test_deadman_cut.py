"""The stop of a process that died, behind a frame that was cut off at any byte: the device hears it all the same.

The link completes a frame that the system took only a part of (test_link_deadman). Here the rest is lost for good, as on
a bad line: the shots by themselves bring the device back to where a frame begins.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any
from unittest import mock

import pytest

from handctl.devices.barrett.realtime.control_values import Controls
from handctl.devices.inspire import can_frames, eb90
from handctl.link import Deadline, Link, RawAccess, deadman
from handctl.link.can import _slcan_frame
from handctl.link.deadman import EarlyWrite, Guard
from handctl.model.device import Device
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


def die(link: Any, stop: Callable[[Link], object], first: Sequence[EarlyWrite] = ()) -> None:
    """What the child does, on the link of its parent."""
    link.put = lambda data, deadline: link.write(data, deadline) if data else None
    link.sleep_reading = link.sleep
    with mock.patch.object(deadman, "RawBytes", lambda _raw_access: link):
        deadman.stop_in_child(RawAccess(-1), stop, deadman._pack(b"", first))


def told_of(device: Device) -> Callable[[Link], object]:
    """The stop that a child of this device is given."""
    told: list[Any] = []
    with mock.patch.object(deadman, "guard_link", lambda *given, **_more: nullcontext(told.append(given))):
        device.guarded().__enter__()
    stop: Callable[[Link], object] = told[0][1]
    return stop


class Kept(Guard):
    """A guard that only keeps what it is told."""

    def __init__(self, stop: Callable[[Link], object]) -> None:
        super().__init__(None, stop, lambda *_words: None)
        self.stop = stop
        self.told: list[list[EarlyWrite]] = []

    def update(self, first: Sequence[EarlyWrite], heartbeat: float | None = None) -> None:
        self.told.append(list(first))


@pytest.mark.parametrize("cut", range(4))
def test_a_control_block_that_was_cut_off(monkeypatch: pytest.MonkeyPatch, cut: int) -> None:
    """Whatever the missing bytes make of what follows, the hand ends at its prompt, its motor without power."""
    controls = Controls({0: ("velocity", "gain")}, {(0, "velocity"): 30, (0, "gain"): 13})
    guards: list[Kept] = []
    monkeypatch.setattr(
        deadman, "guard_link", lambda _link, stop, _warn, **_more: nullcontext(guards.append(Kept(stop)) or guards[-1])
    )
    run = Run("wire=auto", receive={0: ("position",)}, temperature=False, controls=controls, motors=(0,), guards=()).go(
        5
    )
    assert run.error is None
    (guard,) = guards
    inside, last = guard.told
    assert last == [] and inside[1].data == b"c\x00\x0c", (
        "once in the loop: velocity 0; the gain is kept, and 13 is sent as 12"
    )
    link = run.link
    assert isinstance(link, Simulated)
    run.hand.line.ask("1FSET LCV 1 LCPG 1 LFV 0 LFS 0 LFAP 1 LFDP 0")
    for data in (b"1LOOP\r", b"C\x1e\x0d", b"C\x1e\x0d"[:cut]):
        link.write(data, Deadline(link.now, link.now() + 1))
        link.sleep(0.05)
    assert "moving" in run.control("motors") or "power on" in run.control("motors")
    die(link, guard.stop, inside)
    link.sleep(0.2)
    motors = run.control("motors")
    assert "power on" not in motors and "moving" not in motors, motors
    assert run.hand.line.ask("1T").status == 0, "it is at its prompt"


@each_row("cut", range(len(POSITION) + 1))
def test_a_command_of_the_exoskeleton_hand_that_was_cut_off(cut: int) -> None:
    hand, link = fake_hand()
    hand.command("position", [1000] * 5)
    hand.command("force", [300] * 5)
    link.sleep(0.3)
    link.write(POSITION[:cut], Deadline(link.now, link.now() + 1))
    die(link, told_of(hand))
    link.sleep(1.0)
    memory = device_of(link).space.memory
    assert memory[1498:1508] == bytes(10)
    assert memory[1486:1496] == memory[1546:1556] != b"\xe8\x03" * 5, "it stands where it was then"


@each_row("cut", range(len(MOVE) + 1))
def test_a_movement_of_the_wrist_that_was_cut_off(cut: int) -> None:
    wrist, link = fake_wrist("serial")
    link.write(MOVE[:cut], Deadline(link.now, link.now() + 1))  # type: ignore[union-attr]
    die(link, told_of(wrist))
    (pitch, yaw), memory = at(wrist), device_of(link).wrist.memory
    assert memory[1038:1042] == yaw.to_bytes(2, "little", signed=True) + pitch.to_bytes(2, "little", signed=True)


@each_row("cut", range(28))
def test_a_line_of_the_can_adapter_that_was_cut_off(cut: int) -> None:
    """The CR before a frame ends that line: the first is heard already."""
    wrist, _ = fake_wrist("can")
    line = create("wrist", {"bus": "can"})
    adapter = Adapter(line)
    pitch, yaw = at(wrist)
    identifier, data = can_frames.write_request(1, 1038, eb90.pack_s16([yaw, pitch]))
    move = _slcan_frame(bytes.fromhex("E80318FCE803"), 0x15038001)
    adapter.feed(b"S8\rO\r")
    adapter.feed(move[:cut])
    adapter.feed(_slcan_frame(data, identifier))
    line.advance(line.device.now + 0.02)
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
