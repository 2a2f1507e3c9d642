"""The time of a recording: two clocks to seconds, segments, holes and gaps, rate and clock fit.

A device's clock and the host's are two witnesses. Within a segment they agree: no two rows of it contradict each other by more
than `device_clock.WITHIN_MS`, whatever the round trips. Where they part a segment begins, and its time is taken from the host's clock.
So is that of a device without a clock. Pure arithmetic; knows no file and no device.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, sqrt
from operator import mul, sub
from typing import Any, NamedTuple

from handctl.model.device_clock import WITHIN_MS, Moment, Span

BOOT_WRAP = 1 << 32
"""A device's clock is 32 bit of milliseconds."""
TORN_MS = 1 << 16
"""It comes in two 16-bit words: a device that takes them at different moments is off by one of the high word for a moment."""
GAP_PERIODS = 3
LEAST_PERIOD_MS = 5.0
"""A link without a line's speed may ask faster than a device's clock ticks; the line itself needs longer."""
LEARNED = 20
"""So many intervals make the device's own period known; where nothing else is known of it, FEW tell a little."""
FEW = 3
MOST_PARTED = 1000
"""A clock that parted from ours so often is no witness of anything: the host's alone tells the time from then on."""
PORT_LOST, RESTART, CLOCKS = "port-lost", "restart", "clocks"
"""Why a segment begins: the port was gone; the device restarted; its clock and ours parted."""


class Place(NamedTuple):
    """The times of a row.

    boot_ms   the device's clock, None = it has none
    moment    the host's
    t_ms      time since the first row: by the device within a segment, by the host at its first row. So it is never further than
              WITHIN_MS from the host's, and may fall by so much where a segment begins
    step_ms   since the row before
    why       why a segment begins here, () = none does
    off_ms    by how much the device's clock is ahead of the host's (above 0) or behind it, where they part
    rebooted  whether the device restarted since the row before: its clock counts from then, or it showed it otherwise; None = it may have
    gap_ms    what lies before it without a row, 0 = nothing
    """

    boot_ms: int | None
    moment: Moment
    t_ms: int
    segment: int
    step_ms: int = 0
    why: tuple[str, ...] = ()
    off_ms: int = 0
    rebooted: bool | None = False
    gap_ms: int = 0

    @property
    def mono_s(self) -> float:
        """The likeliest moment of the host's clock."""
        return self.moment.middle

    @property
    def rtt_ms(self) -> float:
        return (self.moment.answered - self.moment.sent) * 1000

    @property
    def reopened(self) -> bool:
        """Whether the port was gone before it."""
        return PORT_LOST in self.why


def is_torn(off_ms: float) -> bool:
    """Whether a jump of the device's clock is that of a torn read, there or back."""
    return abs(abs(off_ms) - TORN_MS) <= WITHIN_MS


def is_back(off_ms: float, now_ms: float) -> bool:
    """Whether the jump of now undoes the torn read of the one before, so that neither was a restart."""
    return is_torn(off_ms) and is_torn(now_ms) and (off_ms < 0) != (now_ms < 0)


class Gap(NamedTuple):
    """An interval that is too long: the device's clock at its end, None = it has none or no row came any more; its length."""

    boot_ms: int | None
    length_ms: int


@dataclass(slots=True)
class Hole:
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
    """Least squares of host time over device time: host = a + b * boot, both from the first point.

    What is summed is by how much the host is ahead: over hours the times themselves would leave no digit for the residual.
    """

    def __init__(self) -> None:
        self.count = 0
        self._x = self._ahead = self._xx = self._xa = self._aa = 0.0

    def add(self, x: float, y: float) -> None:
        """Take a point; seconds. As `extend` with one of each: a recording has one with every row."""
        total = self.count + 1
        off_x, off, weight = x - self._x, y - x - self._ahead, self.count / total
        self._xx += off_x * off_x * weight
        self._xa += off_x * off * weight
        self._aa += off * off * weight
        self._x += off_x / total
        self._ahead += off / total
        self.count = total

    def extend(self, x: Sequence[float], y: Sequence[float]) -> None:
        """Take points."""
        more, total = len(x), self.count + len(x)
        ahead = list(map(sub, y, x))
        middle_x, middle = sum(x) / more, sum(ahead) / more
        dx, da = [one - middle_x for one in x], [one - middle for one in ahead]
        off_x, off, weight = middle_x - self._x, middle - self._ahead, self.count * more / total
        self._xx += sum(map(mul, dx, dx)) + off_x * off_x * weight
        self._xa += sum(map(mul, dx, da)) + off_x * off * weight
        self._aa += sum(map(mul, da, da)) + off * off * weight
        self._x += off_x * more / total
        self._ahead += off * more / total
        self.count = total

    def as_row(self) -> dict[str, float] | None:
        """`a` in seconds, `b`, and the residual in ms (root mean square); None without two moments."""
        if self._xx <= 0:
            return None
        drift = self._xa / self._xx
        residual = sqrt(max(0.0, self._aa - drift * self._xa) / self.count)
        return {
            "a_s": round(self._ahead - drift * self._x, 6) + 0.0, "b": round(1 + drift, 9), "residual_ms": round(residual * 1000, 3),
        }  # fmt: skip


@dataclass(slots=True)
class Segment:
    """Rows within which the port was there and both clocks agree. `why` and the rest as in `Place`."""

    number: int
    first_row: int
    first: Place
    rebooted: bool | None
    last: Place
    rows: int = 0
    settings_changed: list[str] | None = None
    fit: ClockFit = field(default_factory=ClockFit)
    sent_most: float = -inf
    answered_least: float = inf

    def off(self, ms: int, moment: Moment) -> float:
        """By how many ms a row that is `ms` of the device's clock after the first contradicts the rows before it."""
        return Span(moment.sent * 1000 - self.answered_least, moment.answered * 1000 - self.sent_most).off(ms)

    def take(self, place: Place, *, clocked: bool) -> None:
        """Take a row; `clocked`: its time comes from the device's clock."""
        self.rows += 1
        self.last = place
        ms = place.t_ms - self.first.t_ms
        if clocked:
            self.fit.add(ms / 1000, place.mono_s - self.first.mono_s)
        self.sent_most = max(self.sent_most, place.moment.sent * 1000 - ms)
        self.answered_least = min(self.answered_least, place.moment.answered * 1000 - ms)

    def as_row(self) -> dict[str, Any]:
        """As it stands in the sidecar."""
        first, last = self.first, self.last
        return {
            "segment": self.number,
            "why": list(first.why),
            "rebooted": self.rebooted,
            "clock_off_s": first.off_ms / 1000,
            "first_row": self.first_row,
            "rows": self.rows,
            "boot_ms": [first.boot_ms, last.boot_ms],
            "t_s": [first.t_ms / 1000, last.t_ms / 1000],
            "host_mono_s": round(first.mono_s, 6),
            "clock_fit": self.fit.as_row(),
            "settings_changed": self.settings_changed,
        }


class Timeline:
    """Places row after row.

    period_ms   the period asked for, 0 = as fast as the device answers
    usual_ms    that of the device until its own is known, None = nothing is known of it
    """

    def __init__(self, period_ms: float = 0.0, usual_ms: float | None = None) -> None:
        self.segments: list[Segment] = []
        self.gaps: list[Gap] = []
        self.holes: list[Hole] = []
        self.rows = 0
        self.standstill = 0
        """Rows at which the device's clock is that of the row before."""
        self._asked = period_ms
        self._usual = usual_ms
        self._recent: deque[int] = deque(maxlen=41)
        self._intervals: Counter[int] = Counter()
        """Those between rows, but for what lies before a segment whose port was lost or whose device restarted."""
        self._recorded, self._recorded_s = 0, 0.0
        """How many of them are no gaps, and how long they took by the host's clock: the device's may stand still, or run wrong."""
        self._restarted = False
        self._parted = 0
        self.last = Place(None, Moment(0.0, 0.0), 0, 1)

    @property
    def reboots(self) -> int:
        """How often the device restarted."""
        return sum(segment.rebooted is True for segment in self.segments)

    @property
    def parted(self) -> list[Segment]:
        """The segments at which the clocks parted, and no restart explains it."""
        return [segment for segment in self.segments if CLOCKS in segment.first.why]

    @property
    def unfit(self) -> bool:
        """Whether the device's clock is not asked any more."""
        return self._parted >= MOST_PARTED

    def restarted(self) -> None:
        """Something else than its clock shows that the device restarted since it was asked last: the counters of its session.

        A segment that began since then is that of the restart; otherwise the next row begins one.
        """
        segment = self.segments[-1]
        if segment.number == 1 or segment.rows > 1:
            self._restarted = True
            return
        segment.rebooted = True
        for hole in self.holes:
            hole.rebooted = True if hole.segment == segment.number else hole.rebooted

    def place(self, boot_ms: int | None, moment: Moment, *, reopened: bool = False) -> Place:
        """The place of a row with these clock readings; `count` it once it is written. `reopened`: the port was lost before it.

        A gap is an interval above three periods. A restart is told where the device's clock says that it was switched on since the
        row before: it counts no more time than has passed since. A clock that fell back and yet counts more, or that parts from
        ours while the port was gone, is no proof: it may be another device.
        """
        if not self.rows:
            return Place(boot_ms, moment, 0, 1, why=(PORT_LOST,) * reopened)
        last, segment = self.last, self.segments[-1]
        elapsed = max(0, round((moment.middle - last.moment.middle) * 1000))
        t_ms = round((moment.middle - self.segments[0].first.moment.middle) * 1000)
        step, off = max(0, t_ms - last.t_ms), 0.0
        rebooted: bool | None = None if reopened and boot_ms is None else self._restarted
        parted = False
        if boot_ms is not None and last.boot_ms is not None and not self.unfit:
            step = (boot_ms - last.boot_ms + BOOT_WRAP // 2) % BOOT_WRAP - BOOT_WRAP // 2
            off = segment.off(last.t_ms - segment.first.t_ms + step, moment)
            parted = step < 0 or abs(off) > WITHIN_MS
            if parted and is_torn(off) and not reopened:
                back = is_back(segment.first.off_ms, off)
                rebooted = rebooted or (None if boot_ms < last.boot_ms and not back else False)
            elif parted and boot_ms <= moment.since(last.moment).most + WITHIN_MS:
                rebooted = True
            elif parted and (boot_ms < last.boot_ms or reopened):
                rebooted = rebooted or None
        why = (PORT_LOST,) * reopened + ((RESTART,) if rebooted else (CLOCKS,) * parted)
        if not why:
            gap = step if step > GAP_PERIODS * self.period_ms else 0
            return Place(boot_ms, moment, last.t_ms + step, last.segment, step, gap_ms=gap)
        gap = max(1, elapsed) if reopened or elapsed > GAP_PERIODS * self.period_ms else 0
        return Place(boot_ms, moment, t_ms, last.segment + 1, elapsed, why, round(off) if parted else 0, rebooted, gap)

    def count(self, place: Place) -> None:
        """The row is written: count it."""
        begins = not self.rows or place.segment > self.last.segment
        if place.reopened:
            self.holes.append(Hole(self.rows + 1, place.segment, place.gap_ms, place.rebooted))
        if self.rows and not (place.reopened or place.rebooted):
            elapsed = place.mono_s - self.last.mono_s
            still = place.boot_ms is not None and place.boot_ms == self.last.boot_ms
            interval = round(elapsed * 1000) if still else place.step_ms
            self._recent.append(interval)
            self._intervals[interval] += 1
            self.standstill += still
            if not place.gap_ms:
                self._recorded += 1
                self._recorded_s += elapsed
        if place.gap_ms:
            self.gaps.append(Gap(place.boot_ms, place.gap_ms))
        if begins:
            before = self.segments[-1] if self.segments else None
            if before is not None and before.rebooted is None and is_back(before.first.off_ms, place.off_ms):
                before.rebooted = False
            self.segments.append(Segment(place.segment, self.rows + 1, place, place.rebooted, place))
            self._restarted = False
            self._parted += CLOCKS in place.why
        self.segments[-1].take(place, clocked=place.boot_ms is not None and not self.unfit)
        self.rows += 1
        self.last = place

    def end(self, silent_ms: int) -> None:
        """No more rows: the time without a valid reply at the end is a gap as well, if it is too long."""
        period = self.period_ms
        if silent_ms > (GAP_PERIODS * period if period < inf else 0):
            self.gaps.append(Gap(None, silent_ms))

    @property
    def period_ms(self) -> float:
        """The nominal period: the device's own (median of the last intervals), or the one asked for if that is longer."""
        if len(self._recent) < (FEW if self._usual is None else LEARNED):
            return max(self._asked, inf if self._usual is None else self._usual)
        return max(self._asked, LEAST_PERIOD_MS, sorted(self._recent)[len(self._recent) // 2])

    @property
    def t_s(self) -> float:
        """Time of the last row."""
        return self.last.t_ms / 1000

    def rate_hz(self) -> float | None:
        """Rows per second of recorded time: gaps, restarts and lost ports do not count."""
        return round(self._recorded / self._recorded_s, 2) if self._recorded_s > 0 else None

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
