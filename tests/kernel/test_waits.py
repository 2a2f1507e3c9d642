"""A wish to end that comes just before the system's wait begins does not end it: no wait is longer than a slice."""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.system import clock, waits

WAITS: dict[str, Callable[[float], object]] = {
    "sleep": lambda seconds: clock.sleep(seconds),  # noqa: PLW0108 - what it is then
    "readable": lambda seconds: waits.readable(0, seconds),
    "writable": lambda seconds: waits.writable(0, seconds),
    "takes": lambda seconds: waits.takes(0, seconds),
    "gives": lambda seconds: waits.gives(0, seconds),
    "gives for ever": lambda _: waits.gives(0, None),
}


class Kernel:
    """A system in which nothing is ever ready, and time passes in its waits alone."""

    def __init__(self) -> None:
        self.now = 100.0
        self.waited: list[float] = []

    def wait(self, seconds: float) -> None:
        self.waited.append(seconds)
        self.now += seconds

    def select(self, *asked: Any) -> tuple[list[int], ...]:
        self.wait(asked[3])
        return [], [], []

    def poll(self, ms: float) -> list[int]:
        self.wait(ms / 1000)
        if self.now > 130.0:
            raise KeyboardInterrupt
        return []


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    here = Kernel()
    monkeypatch.setattr(clock, "now", lambda: here.now)
    monkeypatch.setattr(time, "sleep", here.wait)
    monkeypatch.setattr(select, "select", here.select)
    monkeypatch.setattr(select, "poll", lambda: SimpleNamespace(register=lambda *_: None, poll=here.poll))
    return here


@pytest.mark.parametrize("name", WAITS)
def test_no_wait_is_longer_than_a_slice(name: str, kernel: Kernel) -> None:
    try:
        assert not WAITS[name](20.0)
    except KeyboardInterrupt:
        assert name == "gives for ever"
    assert max(kernel.waited) <= clock.SLICE < 0.2
    assert kernel.now == pytest.approx(130.0 if name == "gives for ever" else 120.0, abs=clock.SLICE)


def test_what_is_short_is_one_wait(kernel: Kernel) -> None:
    clock.sleep(0.05)
    assert kernel.waited == [0.05]
    clock.sleep(0.0)
    clock.sleep(-1.0)
    assert kernel.waited == [0.05]


def test_what_comes_in_a_later_slice_ends_the_wait(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(select, "select", lambda *_: (kernel.wait(0.1), [0] if kernel.now > 100.25 else [])[1:])
    assert waits.readable(0, 20.0) and len(kernel.waited) == 3


def test_a_signal_that_the_wait_did_not_see_ends_the_sleep(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """The system had taken it before the wait began, and sleeps to the end of the slice: then its handler runs."""

    def slept(seconds: float) -> None:
        kernel.wait(seconds)
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", slept)
    with pytest.raises(KeyboardInterrupt):
        clock.sleep(60.0)
    assert kernel.now <= 100.0 + clock.SLICE
