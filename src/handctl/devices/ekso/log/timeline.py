"""The time of a log: device ticks to seconds, reboots and lost ports to segments, long intervals to gaps, rate and clock fit.

Pure arithmetic over BootTime and host time; knows no file and no device.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from math import sqrt
from typing import Any, NamedTuple

BOOT_WRAP = 1 << 32
"""BootTime is 32 bit of milliseconds."""
GAP_PERIODS = 3
FIRST_PERIOD_MS = 20.0
"""Nominal period until the device's own is known: 50 Hz, as in the field."""
LEAST_PERIOD_MS = 5.0
"""A link without a line's speed may ask faster than BootTime ticks; the line itself needs 5.7 ms."""
LEARNED = 20
"""So many intervals make the device's own period known."""
SLACK_MS = 1000.0
"""Device and host clock may disagree by so much between two rows; more is a reboot."""


class Place(NamedTuple):
    """Where a row stands: its clocks, device time since the first row, its segment, what lies before it."""

    boot_ms: int
    mono_s: float
    rtt_ms: float
    t_ms: int
    segment: int
    rebooted: bool = False
    gap_ms: int = 0
    reopened: bool = False


class Gap(NamedTuple):
    """An interval that is too long: BootTime of its end, its length."""

    boot_ms: int
    length_ms: int


class Hole(NamedTuple):
    """A time in which the port was gone: the first row after it, its segment, ms without rows, whether the device restarted.

    The row is None where the port, or the device behind it, did not come back before the end.
    """

    row: int | None
    segment: int | None = None
    length_ms: int | None = None
    rebooted: bool | None = None

    def as_row(self) -> dict[str, Any]:
        """As it stands in the sidecar."""
        length = None if self.length_ms is None else self.length_ms / 1000
        return {"row": self.row, "segment": self.segment, "length_s": length, "rebooted": self.rebooted}


class ClockFit:
    """Least squares of host time over device time, point by point: host = a + b * boot, both from the first point."""

    def __init__(self) -> None:
        self.count = 0
        self._x = self._y = self._xx = self._xy = self._yy = 0.0

    def add(self, x: float, y: float) -> None:
        """Take a point; seconds."""
        self.count += 1
        dx, dy = x - self._x, y - self._y
        self._x += dx / self.count
        self._y += dy / self.count
        self._xx += dx * (x - self._x)
        self._xy += dx * (y - self._y)
        self._yy += dy * (y - self._y)

    def as_row(self) -> dict[str, float] | None:
        """`a` in seconds, `b`, and the residual in ms (root mean square); None without two moments."""
        if self._xx <= 0:
            return None
        b = self._xy / self._xx
        residual = sqrt(max(0.0, self._yy - b * self._xy) / self.count)
        return {"a_s": round(self._y - b * self._x, 6), "b": round(b, 9), "residual_ms": round(residual * 1000, 3)}


@dataclass(slots=True)
class Segment:
    """The rows from one power-on, or one return of the port, to the next."""

    number: int
    first_row: int
    boot_first: int
    mono_first: float
    t_first_ms: int
    boot_last: int = 0
    t_last_ms: int = 0
    rows: int = 0
    settings_changed: list[str] | None = None
    fit: ClockFit = field(default_factory=ClockFit)

    def as_row(self) -> dict[str, Any]:
        """As it stands in the sidecar."""
        return {
            "segment": self.number,
            "first_row": self.first_row,
            "rows": self.rows,
            "boot_ms": [self.boot_first, self.boot_last],
            "t_s": [self.t_first_ms / 1000, self.t_last_ms / 1000],
            "host_mono_s": round(self.mono_first, 6),
            "clock_fit": self.fit.as_row(),
            "settings_changed": self.settings_changed,
        }


class Timeline:
    """Places row after row. `period_ms` is the period asked for, 0 = as fast as the device answers."""

    def __init__(self, period_ms: float = 0.0) -> None:
        self.segments: list[Segment] = []
        self.gaps: list[Gap] = []
        self.holes: list[Hole] = []
        self.reboots = 0
        self.rows = 0
        self.standstill = 0
        """Rows whose BootTime is that of the row before."""
        self._asked = period_ms
        self._recent: deque[int] = deque(maxlen=41)
        self._intervals: Counter[int] = Counter()
        """Those within a segment, and which of them are gaps."""
        self._within: list[int] = []
        self.last = Place(0, 0.0, 0.0, 0, 1)

    def place(self, boot_ms: int, mono_s: float, rtt_ms: float = 0.0, *, reopened: bool = False) -> Place:
        """Where a row of these clocks would stand; `count` it once it is written. `reopened`: the port was lost before it.

        A gap is an interval above three nominal periods. A reboot is a BootTime below the last one (unless it wrapped
        after 49.7 days), or one that has fallen behind the host clock by more than a second. A lost port is a gap as well.
        """
        if not self.rows:
            return Place(boot_ms, mono_s, rtt_ms, 0, 1, reopened=reopened)
        elapsed = (mono_s - self.last.mono_s) * 1000
        slack = SLACK_MS + (rtt_ms + self.last.rtt_ms) / 2
        delta = (boot_ms - self.last.boot_ms) % BOOT_WRAP
        t_ms, segment = self.last.t_ms, self.last.segment
        wrapped = boot_ms < self.last.boot_ms and abs(delta - elapsed) <= slack
        behind = delta > 0 and elapsed - delta > slack  # the very same BootTime again is a clock that stands
        if (boot_ms < self.last.boot_ms and not wrapped) or behind:
            after = max(1, round(elapsed))
            gap = after if reopened else 0
            return Place(boot_ms, mono_s, rtt_ms, t_ms + after, segment + 1, True, gap, reopened)
        if reopened:
            return Place(boot_ms, mono_s, rtt_ms, t_ms + delta, segment + 1, False, delta, reopened)
        gap = delta if delta > GAP_PERIODS * self.period_ms else 0
        return Place(boot_ms, mono_s, rtt_ms, t_ms + delta, segment, gap_ms=gap)

    def count(self, place: Place) -> None:
        """The row is written: count it."""
        self.reboots += place.rebooted
        if place.reopened:
            self.holes.append(Hole(self.rows + 1, place.segment, place.gap_ms, place.rebooted))
        if not self.rows or place.segment > self.last.segment:
            self.segments.append(Segment(place.segment, self.rows + 1, place.boot_ms, place.mono_s, place.t_ms))
        else:
            delta = place.t_ms - self.last.t_ms
            self._recent.append(delta)
            self._intervals[delta] += 1
            self.standstill += delta == 0
            if place.gap_ms:
                self._within.append(delta)
        if place.gap_ms:
            self.gaps.append(Gap(place.boot_ms, place.gap_ms))
        segment = self.segments[-1]
        segment.rows += 1
        segment.boot_last, segment.t_last_ms = place.boot_ms, place.t_ms
        segment.fit.add((place.t_ms - segment.t_first_ms) / 1000, place.mono_s - segment.mono_first)
        self.rows += 1
        self.last = place

    @property
    def period_ms(self) -> float:
        """The nominal period: the device's own (median of the last intervals), or the one asked for if that is longer."""
        if len(self._recent) < LEARNED:
            return max(self._asked, FIRST_PERIOD_MS)
        return max(self._asked, LEAST_PERIOD_MS, sorted(self._recent)[len(self._recent) // 2])

    @property
    def t_s(self) -> float:
        """Device time of the last row."""
        return self.last.t_ms / 1000

    def rate_hz(self) -> float | None:
        """Rows per second of recorded time: gaps, reboots and lost ports do not count."""
        count = sum(self._intervals.values()) - len(self._within)
        recorded = sum(delta * n for delta, n in self._intervals.items()) - sum(self._within)
        return round(count * 1000 / recorded, 2) if count > 0 and recorded > 0 else None

    def interval_row(self) -> dict[str, int] | None:
        """Median, 99th percentile and longest interval between rows of a segment, ms."""
        total = sum(self._intervals.values())
        if not total:
            return None
        return {
            "median": self._percentile((total + 1) // 2),
            "p99": self._percentile(-(-total * 99 // 100)),
            "max": max(self._intervals),
        }

    def _percentile(self, rank: int) -> int:
        seen = 0
        for delta in sorted(self._intervals):
            seen += self._intervals[delta]
            if seen >= rank:
                return delta
        raise AssertionError("rank beyond the number of intervals")
