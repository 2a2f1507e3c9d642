"""What has a pulse is never silent for as long as its child waits: at any speed, at any rate, to its last frame."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from itertools import pairwise
from typing import Any

import pytest

from handctl.devices.aidin.motion import currents, parse
from handctl.devices.aidin.parameter_map import CURRENTS
from handctl.devices.barrett.parameter_map import SPEEDS
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.link import deadman
from handctl.link.deadman import EarlyWrite, Guard
from handctl.model.prompts import Prompts
from tests.aidin import support as aidin
from tests.barrett.realtime import Run
from tests.barrett.support import Simulated
from tests.support.each_row import each_row


class Heard(Guard):
    """The pulse as a child would hear it: the moments of what it is told, each with how long it waits from then on."""

    def __init__(self, link: Any, heartbeat: float) -> None:
        super().__init__(None, lambda _link: None, lambda *_words: None)
        self.link, self.beats = link, [(link.now(), heartbeat)]
        self._write = link.write
        link.write = self._written

    def _written(self, data: bytes, deadline: Any) -> None:
        self.beats.append((self.link.now(), self.beats[-1][1]))
        self._write(data, deadline)

    def update(self, first: Sequence[EarlyWrite], heartbeat: float | None = None) -> None:
        self.beats.append((self.link.now(), self.beats[-1][1] if heartbeat is None else heartbeat))

    def longest(self) -> float:
        """The longest silence, as a share of what the child waits."""
        return max((after - at) / heartbeat for (at, heartbeat), (after, _) in pairwise(self.beats) if heartbeat)


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[Heard]:
    found: list[Heard] = []

    def guard_link(link: Any, _stop: Any, _warn: Any, *, heartbeat: float = 0.0) -> Any:
        found.append(Heard(link, heartbeat))
        return nullcontext(found[-1])

    monkeypatch.setattr(deadman, "guard_link", guard_link)
    return found


@each_row("rate", [0.0, 1.0])
@each_row("speed", [max(SPEEDS), 9600, min(SPEEDS)])
def test_a_loop(heard: list[Heard], speed: int, rate: float) -> None:
    heard.clear()
    controls = Controls({0: ("velocity",)}, {(0, "velocity"): 20})
    link = Simulated(f"initialized=1&wire=auto&baud={speed}", speed)
    run = Run(receive={0: ("position",)}, temperature=False, controls=controls, motors=(0,), link=link)
    assert run.go(5, rate).error is None
    (guard,) = heard
    assert any(heartbeat for _, heartbeat in guard.beats) and guard.longest() < 0.9


def test_currents(heard: list[Heard]) -> None:
    hand, _ = aidin.simulated(start="homed")
    currents(hand, parse(CURRENTS, ["index.m1=50"], cap=300), Prompts(), seconds=0.5, cap=300)
    (guard,) = heard
    assert guard.beats[0][1] and guard.longest() < 0.9
