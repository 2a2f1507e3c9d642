"""The stream behind every `watch`, on a clock of its own: when it asks, when it ends, what it counts, when it gives up."""

from __future__ import annotations

from itertools import islice
from typing import Any

import pytest

from handctl.errors import HandctlError, NoAnswer
from handctl.model.result import Row
from handctl.model.sampling import Sampler
from tests.support.each_row import each_row


class Clock:
    """The part of a link that a sampler uses."""

    def __init__(self) -> None:
        self.time, self.slept = 100.0, list[float]()

    def now(self) -> float:
        return self.time

    def wall(self) -> float:
        return 1e9 + self.time

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.slept.append(seconds)
        self.time += seconds


class Device:
    """Answers after `seconds`; the samples numbered in `dead` (from 0) hold no value."""

    def __init__(self, clock: Clock, seconds: float = 0.0, dead: tuple[int, ...] = ()) -> None:
        self.clock, self.seconds, self.dead = clock, seconds, dead
        self.asked = 0

    def take(self) -> tuple[list[Row], HandctlError | None]:
        self.clock.time += self.seconds
        number, self.asked = self.asked, self.asked + 1
        return [{"name": "n", "value": number}], NoAnswer(f"sample {number}") if number in self.dead else None


def sampler(
    device: Device, rate: float = 2.0, count: int | None = None, duration: float | None = None, **more: Any
) -> Sampler:
    """Of this device."""
    return Sampler(device.clock, device.take, rate=rate, count=count, duration=duration, **more)  # type: ignore[arg-type]


@each_row(("count", "duration", "times"), [
    (3, None, [0.0, 0.5, 1.0]),
    (None, 1.2, [0.0, 0.5, 1.0]),
    (None, 1.0, [0.0, 0.5]),  # the end is not a sample's
    (100, 1.2, [0.0, 0.5, 1.0]),  # the remainder of the time is no reason to hurry
    (2, 10.0, [0.0, 0.5]),
    (1, None, [0.0]),
])  # fmt: skip
def test_when_it_asks_and_ends(count: int | None, duration: float | None, times: list[float]) -> None:
    device = Device(Clock())
    stream = sampler(device, 2.0, count, duration)
    assert [sample.t for sample in stream.samples()] == times
    assert device.asked == len(times) and device.clock.slept == [0.5] * (len(times) - 1)
    told = stream.summary()["stream"]
    assert (told["samples"], told["seconds"], told["late"]) == (len(times), times[-1], 0)
    assert told["rate_hz"] == (2.0 if len(times) > 1 else None) and told["asked_hz"] == 2.0


def test_many_periods_do_not_add_up_to_one_more() -> None:
    assert len(list(sampler(Device(Clock()), 10.0, None, 30.0).samples())) == 300


def test_behind_it_keeps_its_phase_and_says_so() -> None:
    stream = sampler(Device(Clock(), seconds=0.7), 2.0, 4)
    assert [round(sample.t, 3) for sample in stream.samples()] == [0.0, 0.7, 1.4, 2.1]
    assert stream.summary()["stream"]["late"] == 1  # by a whole period: after the last of these
    slow = sampler(Device(Clock(), seconds=1.2), 2.0, 4)
    assert [round(sample.t, 3) for sample in slow.samples()] == [0.0, 1.2, 2.4, 3.6]
    told = slow.summary()["stream"]
    assert told["late"] > 0 and told["rate_hz"] == 0.83


def test_at_rate_zero_the_next_is_asked_for_before_this_one_is_shown() -> None:
    order: list[str] = []
    device = Device(Clock(), seconds=0.1)
    stream = sampler(device, 0.0, 3, ahead=lambda: order.append("ahead"))
    for sample in stream.samples():
        order.append(f"shown {sample.rows[0]['value']}")
    assert order == ["ahead", "shown 0", "ahead", "shown 1", "shown 2"]
    assert device.clock.slept == [] and stream.summary()["stream"]["asked_hz"] is None


def test_what_was_asked_for_ahead_is_taken_although_the_time_is_over() -> None:
    device = Device(Clock(), seconds=0.4)
    stream = sampler(device, 0.0, None, 1.0, ahead=lambda: setattr(device.clock, "time", device.clock.time + 0.5))
    assert [round(sample.t, 3) for sample in stream.samples()] == [0.0, 0.9]


def test_nothing_is_asked_for_ahead_at_a_rate() -> None:
    assert len(list(sampler(Device(Clock()), 5.0, 3, ahead=lambda: pytest.fail("asked ahead")).samples())) == 3


def test_the_first_failure_ends_it() -> None:
    device = Device(Clock(), dead=(0,))
    stream = sampler(device)
    with pytest.raises(NoAnswer, match="sample 0"):
        next(stream.samples())
    assert stream.summary()["stream"]["samples"] == 0 and stream.summary()["stream"]["failed"] == 1


def test_three_failures_in_a_row_end_it_and_two_do_not() -> None:
    device = Device(Clock(), dead=(1, 2, 4, 5, 6))
    stream, seen = sampler(device), list[Any]()
    with pytest.raises(NoAnswer, match="sample 6"):
        for sample in islice(stream.samples(), 20):
            seen.append(sample.rows[0]["value"])
    assert seen == [0, 1, 2, 3, 4, 5]  # failed ones are shown too, the last one is the error
    assert (stream.summary()["stream"]["samples"], stream.summary()["stream"]["failed"]) == (6, 5)
