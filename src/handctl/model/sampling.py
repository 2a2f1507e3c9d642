"""Read the same quantities at a fixed rate: the stream of every `watch`. Knows no device, no parameter.

Late samples keep the phase and are not made up for. It reports the true rate, and ends after three failures in a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from handctl.errors import HandctlError
from handctl.model.result import Row, Sample
from handctl.wording import utc

if TYPE_CHECKING:
    from handctl.link import Link


FAILURES_IN_A_ROW = 3
"""A stream gives up after so many samples without a valid answer."""
ROUNDING = 1e-6
"""Seconds by which the sum of many periods may miss the duration."""


def started(moment: float | None) -> dict[str, str]:
    """When `t` was 0, for the closing envelope; {} for a stream that never began."""
    return {} if moment is None else {"started": utc(moment, 3)}


ReadRows = Callable[[], tuple[Sequence[Row] | Callable[[], Sequence[Row]], HandctlError | None]]
"""Takes one sample: its rows or what makes them, and the error when none of them holds a value."""


class Sampler:
    """Calls `read` for the rows of each moment, `rate` times a second (0 = as fast as the device answers).

    Ends after `count` samples or `duration` seconds, whichever comes first; None = no such end. `ahead` is called after a
    sample that another one follows, before it is shown, when nothing is waited for: the line then works meanwhile.
    """

    def __init__(
        self,
        link: Link,
        read: ReadRows,
        *,
        rate: float,
        count: int | None,
        duration: float | None,
        ahead: Callable[[], object] | None = None,
    ) -> None:
        self._link, self._read, self._ahead = link, read, ahead if not rate else None
        self._rate, self._count, self._duration = rate, count, duration
        self._taken = self._failed = self._late = 0
        self._first = self._last = 0.0
        self._started: float | None = None

    def samples(self) -> Iterator[Sample]:
        """The stream. Raises what the first sample, or three in a row, failed with."""
        start = due = self._link.now()
        self._started = self._link.wall()
        failures = 0
        asked = False
        while asked or self._goes_on(self._link.now() - start):
            t = self._link.now() - start
            rows, error = self._read()
            failures = failures + 1 if error is not None else 0
            self._failed += error is not None
            if error is not None and (failures >= FAILURES_IN_A_ROW or self._failed > self._taken):
                raise error
            self._taken += 1
            self._first, self._last = (t if self._taken == 1 else self._first), t
            asked = self._ahead is not None and self._goes_on(self._link.now() - start)
            if self._ahead is not None and asked:
                self._ahead()
            yield Sample(t, tuple(rows() if callable(rows) else rows), self._started + t)
            if self._rate:
                due = self._next(due)
                if not self._goes_on(due - start):
                    return
                self._link.sleep(max(0.0, due - self._link.now()))

    def _goes_on(self, t: float) -> bool:
        return (self._count is None or self._taken < self._count) and (
            self._duration is None or t < self._duration - ROUNDING
        )

    def _next(self, due: float) -> float:
        """When the next sample is due. Late samples keep the phase and are not made up for; a person sees how many."""
        due += 1 / self._rate
        missed = int((self._link.now() - due) * self._rate)
        if self._link.now() < due:
            return due
        self._late += missed > 0
        return due + missed / self._rate

    def summary(self) -> dict[str, Any]:
        """What goes into the closing envelope: samples, failures, true rate."""
        seconds = self._last - self._first
        rate = (self._taken - 1) / seconds if self._taken > 1 and seconds > 0 else None
        return {
            **started(self._started),
            "stream": {
                "samples": self._taken,
                "failed": self._failed,
                "late": self._late,
                "seconds": round(seconds, 3),
                "rate_hz": round(rate, 2) if rate is not None else None,
                "asked_hz": self._rate or None,
            },
        }
