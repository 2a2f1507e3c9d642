"""A process that was forked from one that has a device open: the link, its lock and its guard are those of the parent."""

from __future__ import annotations

import os
from contextlib import suppress

import pytest

import handctl
from handctl.errors import HandctlError, UsageError
from handctl.families import FAMILIES
from tests.support.cli import spying


def as_fork(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on this process has another number."""
    number = os.getpid() + 1
    monkeypatch.setattr(os, "getpid", lambda: number)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_fork_does_not_reach_the_device(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two processes would take each other's replies, with one lock between them. It would wait for ever for a thread that it has not."""
    with spying() as spy, handctl.simulate(family) as device:
        device.status()
        with monkeypatch.context() as other:
            as_fork(other)
            before = spy.requests
            for call in (device.status, device.dump):
                with pytest.raises(UsageError) as caught:
                    call()
                assert caught.value.code == "forked"
            assert spy.requests == before
            assert device.stop() and spy.requests > before  # which nothing holds up
        device.status()


@pytest.mark.parametrize("family", FAMILIES)
def test_the_end_of_a_fork_leaves_the_device_to_its_parent(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with spying() as spy, handctl.simulate(family) as device:
        device.status()
        before = spy.requests
        with monkeypatch.context() as other:
            as_fork(other)
            with suppress(RuntimeError, HandctlError), device:
                raise RuntimeError
            device.disconnect()
        assert spy.requests == before
        assert device.status()


def test_a_fork_takes_no_step_of_a_loop_and_does_not_leave_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with (
        spying() as spy,
        handctl.simulate("barrett", initialized=1) as hand,
        hand.realtime(motors="1", send="velocity", receive="position") as loop,
    ):
        loop.step(velocity=20)
        before = spy.requests
        with monkeypatch.context() as other:
            as_fork(other)
            with pytest.raises(UsageError) as caught:
                loop.step(velocity=5)
            loop.close()
        assert caught.value.code == "forked" and spy.requests == before
        assert loop.step(velocity=20)
