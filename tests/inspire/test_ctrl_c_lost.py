"""Ctrl-C inside a movement with a frame lost: the device stands a second later, and 130 is claimed only where that was acknowledged."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from handctl.devices.inspire import eb90
from handctl.devices.inspire.exo import device as exo_motion
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.hand import motion as hand_motion
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import DeviceRefused, HandctlError
from handctl.link import ByteLink, Deadline, open_link
from handctl.model.param import Number
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from handctl.model.stop_on_interrupt import NOT_STOPPED
from tests.inspire.wrist_support import wrist_on
from tests.support.each_row import each_row
from tests.support.scripted import RecordedLink, changing, hand_on

FORCES = [100, 100, 100, 100, 100]
NOBODY = range(1, 1000)


class Losing(RecordedLink):
    """Frames to the device that come after Ctrl-C are lost where `lost` says so, the first one is 1."""

    def __init__(self, query: str, lost: range, after: float) -> None:
        super().__init__(open_link(f"fake://{query}clock=virtual", baud=115200))  # type: ignore[arg-type]
        self.lost, self.interrupt_at = lost, after
        self.since: list[bytes] | None = None

    def _check(self) -> None:
        try:
            super()._check()
        except KeyboardInterrupt:
            self.since = []
            raise

    def write(self, data: bytes, deadline: Deadline) -> None:
        if self.since is not None:
            self.since.append(data)
            if len(self.since) in self.lost:
                return
        super().write(data, deadline)


def rh56(link: ByteLink) -> Hand:
    bus, gate = SerialBus(link, 1, Journal()), ModelGate(None, False)
    bus.gate = gate  # type: ignore[assignment]
    return Hand(bus, gate, None)


def turn(hand: Hand) -> object:
    changes = [(element, 1000) for element in hand.map["angle_set"].each[:4]]
    return hand_motion.move(hand, "angle_set", changes, Prompts(), wait=5.0)


Kind = tuple[str, Callable[[ByteLink], Any], Callable[[Any], object], tuple[str, ...]]
DEVICES: dict[str, Kind] = {
    "exo": ("exo?", hand_on, lambda exo: exo_motion.move(exo, dict.fromkeys(range(5), 1000), Prompts(), wait=5.0), ("position_actual",)),
    "wrist": (
        "wrist?", wrist_on, lambda wrist: wrist.move(wrist.targets(20.0, -20.0, 2000), Prompts(), wait=None),
        ("pitch_actual", "yaw_actual"),
    ),
    "hand": ("hand?model=df&", rh56, turn, ("angle_actual",)),
}  # fmt: skip
"""The simulator, the device before it, a movement, and what tells where it stands."""


@each_row("nth", [1, 2, 3, 4])
@each_row("name", DEVICES)
def test_with_one_frame_lost_it_stands_all_the_same(name: str, nth: int) -> None:
    query, device_on, move, where = DEVICES[name]
    link = Losing(query, range(nth, nth + 1), 0.1)
    device = device_on(link)

    def places() -> list[Number | None]:
        elements = [element for one in where for element in device.map[one].each]
        return [reading.value for reading in device.read(elements)]

    before = places()
    with pytest.raises(HandctlError) as caught:
        move(device)
    assert link.since is not None and len(link.since) >= nth
    assert caught.value.exit_code == 130, caught.value.text
    link.sleep(1.0)
    stands = places()
    link.sleep(1.0)
    assert places() == stands != before


@each_row("name", DEVICES)
def test_a_stop_that_nobody_acknowledged_is_not_130(name: str) -> None:
    query, device_on, move, _ = DEVICES[name]
    device = device_on(Losing(query, NOBODY, 0.1))
    with pytest.raises(HandctlError) as caught:
        move(device)
    assert (caught.value.exit_code, caught.value.code) == (4, NOT_STOPPED)
    assert "power off" in caught.value.hint


def test_the_late_answer_of_a_force_is_not_that_of_the_release() -> None:
    """Both begin alike (exo §2.2.1); the release is lost, and the force would stay on the worn hand."""
    link = Losing("exo?turnaround=0.1&", range(1, 2), float("inf"))
    hand, write = hand_on(link), link.write

    def pressed(data: bytes, deadline: Deadline) -> None:
        write(data, deadline)
        if data[4] == 0x31 and link.since is None:
            link.interrupt_at = 0.0

    link.write = pressed  # type: ignore[method-assign]
    with pytest.raises(HandctlError) as caught:
        exo_motion.command(hand, "force", dict(enumerate(FORCES)), Prompts())
    left = [reading.value for reading in hand.read(EXO["force_set"].each)]
    assert (left, caught.value.exit_code) == ([0] * 5, 130), caught.value.text
    assert [frame[12:14] for frame in changing(link.sent)] == ["31", "32", "31", "32"]


TARGETS = b"\x11\xce\x05"
"""A read of position_set, which is asked for 0.3 s behind the hold."""
SPEEDS = b"\x11\xf2\x05"
"""Of speed_set, the same behind speed 0."""
FORCED = eb90.command_request(1, eb90.FORCE_COMMAND, FORCES)
FASTER = eb90.write_request(1, 1522, eb90.pack_s16([100] * 6))


@each_row(("name", "looks", "command"), [("exo", [TARGETS] * 2, FORCED), ("hand", [SPEEDS], FASTER)])
def test_who_commands_behind_the_stop_is_seen(name: str, looks: list[bytes], command: bytes) -> None:
    """Nothing moves, and no other place is commanded: forces and speeds tell. A hand is looked at behind its hold, too."""
    link = Losing(DEVICES[name][0], range(0), float("inf"))
    device, write, once, left = DEVICES[name][1](link), link.write, [command], list(looks)

    def another(data: bytes, deadline: Deadline) -> None:
        if left and data[4:].startswith(left[0]):
            left.pop()
        if once and not left:
            link.inner.write(once.pop(), deadline)
            link.inner.read(deadline)
        write(data, deadline)

    link.write = another  # type: ignore[method-assign]
    stopped = device.stop()
    assert not once and stopped.error is DeviceRefused and " 100 100 100 100 100" in stopped.text, stopped
