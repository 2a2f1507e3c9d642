"""Rows of a hand again and again at a rate: the stream behind the live views of care. Knows no parameter.

Keeps its phase when it is late instead of bursting, tells the true rate, and gives up after three failures in a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from handctl.errors import NoAnswer, ProtocolError
from handctl.link import Link
from handctl.result import Row, Sample

MOST_FAILURES = 3
ROUNDING = 1e-6
"""Seconds by which the sum of many periods may miss the duration."""


class Sampler:
    """Calls `take` for the rows of each moment, `rate` times a second (0 = as fast as the hand answers).

    Ends after `count` samples or `duration` seconds. A failed moment repeats the last rows with the error as value.
    """

    def __init__(
        self, link: Link, take: Callable[[], list[Row]], *, rate: float, count: int | None, duration: float | None
    ) -> None:
        self._link, self._take = link, take
        self._rate, self._count, self._duration = rate, count, duration
        self._taken = self._failed = self._late = 0
        self._last = 0.0

    def samples(self) -> Iterator[Sample]:
        """The stream. Raises what the first moment, or three in a row, failed with."""
        start = due = self._link.now()
        rows: list[Row] = []
        failures = 0
        while self._goes_on(self._link.now() - start):
            t = self._link.now() - start
            try:
                rows = shown = self._take()
                failures = 0
            except (NoAnswer, ProtocolError) as exc:
                failures += 1
                self._failed += 1
                if failures >= MOST_FAILURES or not rows:
                    raise
                shown = [_failed(row, exc.text) for row in rows]
            self._taken += 1
            self._last = t
            yield Sample(t, tuple(shown))
            due = self._wait(due, start)

    def _goes_on(self, t: float) -> bool:
        return (self._count is None or self._taken < self._count) and (
            self._duration is None or t < self._duration - ROUNDING
        )

    def _wait(self, due: float, start: float) -> float:
        """Sleep until the next moment is due; the moment after that."""
        if not self._rate:
            return due
        due += 1 / self._rate
        now = self._link.now()
        if now < due:
            end = start + self._duration if self._duration is not None else due
            if self._count is None or self._taken < self._count:
                self._link.sleep(min(due, end) - now)
            return due
        missed = int((now - due) * self._rate)
        self._late += missed > 0
        return due + missed / self._rate

    def summary(self) -> dict[str, Any]:
        """What goes into the closing envelope: samples, failures, true rate."""
        rate = (self._taken - 1) / self._last if self._taken > 1 and self._last > 0 else None
        return {
            "stream": {
                "samples": self._taken,
                "failed": self._failed,
                "late": self._late,
                "seconds": round(self._last, 3),
                "rate_hz": round(rate, 2) if rate is not None else None,
                "asked_hz": self._rate or None,
            }
        }


def _failed(row: Row, text: str) -> Row:
    return {**{key: value for key, value in row.items() if key != "value"}, "error": text}
