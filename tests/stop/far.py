"""A simulated device far away, on virtual time: frames are late, some are lost, and somebody else may command it, too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from operator import sub
from typing import Any

from handctl.link import ByteLink, Deadline, open_link

TICK = 0.02
"""Seconds from one look at the line to the next."""


@dataclass
class Weather:
    """What happens to the frames of a stop.

    lost     numbers of the frames that never arrive, from 1
    one_way  seconds that a piece needs to the other end
    deaf     whether a frame is not heard: (seconds since the stop began, its bytes)
    other    what somebody else sends every 50 ms
    """

    lost: tuple[int, ...] = ()
    one_way: float = 0.0
    deaf: Callable[[float, bytes], bool] = lambda _seconds, _data: False
    other: Callable[[], bytes] | None = None


@dataclass
class Seen:
    """Where the device was, with the moment since the stop began."""

    at: list[tuple[float, tuple[int, ...]]] = field(default_factory=list)

    @cached_property
    def _travelled(self) -> list[tuple[float, int]]:
        """How far the fastest of all axes goes in 0.1 s from each moment on, once all was seen."""
        pairs = zip(self.at, self.at[round(0.1 / TICK) :], strict=False)
        return [(moment, max(map(abs, map(sub, x, y)))) for (moment, x), (_, y) in pairs]

    def travel(self) -> float:
        """The fastest of all axes, in counts a second, over 0.1 s."""
        return max((way for _, way in self._travelled), default=0) / 0.1

    def driven_back(self) -> int:
        """The most that an axis has gone back, of those that went anywhere."""
        most = 0
        for axis in zip(*(places for _, places in self.at), strict=True):
            farthest = max(axis, key=lambda place: abs(place - axis[0]))
            most = max(most, abs(farthest - axis[-1]))
        return most

    def stood_from(self) -> float:
        """Since when it has been slower than a fifth of its fastest: on its slow way back to where it is held."""
        fastest = self.travel()
        return max((moment for moment, way in self._travelled if way > 0.02 * fastest), default=0.0)


class Far(ByteLink):
    """The line to a simulator."""

    can_set_baud = True

    def __init__(self, name: str, look: Callable[[Any], tuple[int, ...]], baud: int | None) -> None:
        self.name, self.baud = name, baud
        self.near: Any = open_link(name, baud=baud)
        self.weather = Weather()
        self.seen = Seen()
        self.sent: list[bytes] = []
        self._look, self._began, self._looked = look, 0.0, float("inf")
        self._going: list[tuple[float, bytes]] = []
        self._coming: list[tuple[float, bytes]] = []
        self._other_at = 0.0

    # -- the stop begins --

    def worsen(self, weather: Weather) -> None:
        """From now on it is stopped, in this weather."""
        self.weather, self._began, self._other_at = weather, self.now(), self.now()
        self.seen, self.sent = Seen(), []
        self._looked = -1.0
        self._coming.clear()

    def rest(self, seconds: float) -> None:
        """Time passes before that, and nobody looks or listens."""
        for _ in range(round(seconds / 0.1)):
            self.near.sleep(0.1)
            while self.near.read(self.near.deadline(0.0)):
                pass

    # -- a link --

    def now(self) -> float:
        return float(self.near.now())

    def sleep(self, seconds: float) -> None:
        self._until(self.now() + seconds, lambda: False)

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.sent.append(bytes(data))
        since = self.now() - self._began
        if len(self.sent) not in self.weather.lost and not self.weather.deaf(since, data):
            self._going.append((self.now() + self.weather.one_way, bytes(data)))
        self._pass(self.now())

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        self._until(deadline.at, lambda: bool(self._coming) and self._coming[0][0] <= self.now())
        if self._coming and self._coming[0][0] <= self.now():
            return self._coming.pop(0)[1]
        return b""

    def set_baud(self, baud: int) -> None:
        self.baud = baud
        self.near.set_baud(baud)

    def close(self) -> None:
        self.near.close()

    # -- as the link of a child --

    def put(self, data: bytes, deadline: Deadline) -> None:
        if data:
            self.write(data, deadline)

    def sleep_reading(self, seconds: float) -> None:
        end = self.deadline(seconds)
        while not end.expired:
            self.read(end)

    # -- time --

    def _until(self, moment: float, there: Callable[[], bool]) -> None:
        while not there() and self.now() < moment:
            self.near.sleep(min(TICK, moment - self.now()))
            self._pass(self.now())

    def _pass(self, now: float) -> None:
        other = self.weather.other
        if other is not None and now >= self._other_at:
            self._other_at = now + 0.05
            self.near.write(other(), self.near.deadline(1.0))
        while self._going and self._going[0][0] <= now:
            self.near.write(self._going.pop(0)[1], self.near.deadline(1.0))
        while data := self.near.read(self.near.deadline(0.0)):
            self._coming.append((now + self.weather.one_way, data))
        if now > self._looked:
            self._looked = now
            self.seen.at.append((now - self._began, self._look(self.near._line)))
