"""One pass through a recording: its segments with the fit of the two clocks, breaks, gaps and marks. Computed from the rows, not read
from the sidecar; only who times the rows by the sidecar's fits gives them, so that marks and rows are on one line.

    host = the host's clock at a segment's first row + a + b * (t_s - t_s of that row)

So each row has the host's time by the fit, which the round trips do not shake, beside the device's.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise, repeat
from math import inf
from operator import add, lt, sub
from typing import Any, NamedTuple

from handctl.model.device_clock import WITHIN_MS, Moment
from handctl.record import timeline
from handctl.record.csv_columns import MARK
from handctl.record.log_reader import LATEST_S, SAME_S, Block, LogFile, as_written, damaged
from handctl.record.timeline import BOOT_WRAP, MOST_PARTED, Place

NOTE = re.compile(r"\[(port lost|reboot|clocks [^]]*|gap [0-9]{1,9}[.][0-9]{3} s)\](?:; |$)")
"""What the recorder itself writes into a mark, before the text of a person."""
SMALLEST_MS = 0.0005
"""Clocks that part by less show no digit of it."""
BREAK, GAP, MARKED = "break", "gap", "mark"


class ClockLine(NamedTuple):
    """The clock fit of a segment: from its first row, which was at `utc_s` since 1970 by the host and at `t_ms`."""

    utc_s: float
    t_ms: int
    a: float = 0.0
    b: float = 1.0

    @classmethod
    def of(cls, fit: Mapping[str, float] | None, utc_s: float, t_ms: int) -> ClockLine:
        """That of a fit as `ClockFit.as_row` has it; without one the clocks run alike."""
        return cls(utc_s, t_ms, fit["a_s"], fit["b"]) if fit else cls(utc_s, t_ms)

    def as_fit(self) -> dict[str, float]:
        """Its part of `ClockFit.as_row`."""
        return {"a_s": self.a, "b": self.b}

    def utc_of(self, t_ms: int) -> float:
        """The host's time, seconds since 1970."""
        return self.all_utc([t_ms])[0]

    def all_utc(self, t_ms: Sequence[int]) -> list[float]:
        """The host's time of each."""
        at, b, begin = self.utc_s + self.a, self.b, float(self.t_ms)
        return [at + b * (ms - begin) / 1000.0 for ms in t_ms]


class Event(NamedTuple):
    """Something at a moment: seconds since 1970, what it is (BREAK, GAP or MARKED), the text, the row (from 1)."""

    utc_s: float
    kind: str
    text: str
    row: int


@dataclass(slots=True)
class Segment(timeline.Segment):
    """A segment as its rows are. `notes` are those of the recorder at its first row: why it begins.

    utc_s     the host's time of its first row, seconds since 1970
    pause_s   since the last row of the segment before, by the host
    apart_ms  the most by which device and host contradict each other within it
    said      its fit as the sidecar has it, None = the rows are asked for it, for `apart_ms` and for `boots`
    boots     the device's clock at its first and last row, None = it has none, or the rows were not asked
    """

    utc_s: float = 0.0
    pause_s: float = 0.0
    notes: tuple[str, ...] = ()
    gaps: int = 0
    apart_ms: float = 0.0
    said: Mapping[str, float] | None = None
    boots: list[int | None] = field(default_factory=lambda: [None, None])

    def read(self, rows: Block, clock: str) -> None:
        """Take rows that follow each other; `clock` is the column of the device's clock, "" where it has none."""
        mono = rows.floats("host_mono_s")
        if self.said is None:
            if clock:
                self._follow(rows.integers(clock), rows.t_ms)
            self._compare(rows.t_ms, mono, rows.floats("rtt_ms"), clocked=bool(clock))
        self.rows += len(mono)
        half = float(rows.columns["rtt_ms"][-1]) / 2000
        self.last = Place(None, Moment(mono[-1] - half, mono[-1] + half), rows.t_ms[-1], self.number)

    def _follow(self, boots: Sequence[int], t_ms: Sequence[int]) -> None:
        """Find the most by which `t_s` is not that of the device's clock, which it is within a segment of a clock that is any witness."""
        self.boots = [boots[0] if self.boots[0] is None else self.boots[0], boots[-1]]
        ahead, half = (self.boots[0] or 0) - self.first.t_ms, BOOT_WRAP // 2
        others = set(map(sub, boots, t_ms)) - {ahead}
        if others and self.number <= MOST_PARTED:
            self.apart_ms = max([self.apart_ms, *((one - ahead + half) % BOOT_WRAP - half for one in others)], key=abs)

    def _compare(self, t_ms: Sequence[int], mono: Sequence[float], rtt: Sequence[float], *, clocked: bool) -> None:
        """Fit the clocks, and find by how much they part."""
        begin, at = self.first.t_ms, self.first.mono_s
        times = [ms - begin for ms in t_ms]
        sent = [(middle - trip / 2000) * 1000 - ms for ms, middle, trip in zip(times, mono, rtt, strict=True)]
        answered = list(map(add, sent, rtt))
        top, low = max(sent), min(answered)
        if clocked:
            self._contradicted(sent, answered, top, low)
            self.fit.extend([ms / 1000 for ms in times], [middle - at for middle in mono])
        self.sent_most, self.answered_least = max(self.sent_most, top), min(self.answered_least, low)

    def _contradicted(self, sent: Sequence[float], answered: Sequence[float], top: float, low: float) -> None:
        """Find the most by which these rows contradict those before them. What shows no more than is known needs no look at each."""
        known = max(abs(self.apart_ms), SMALLEST_MS)
        if max(max(self.sent_most, top) - low, top - min(self.answered_least, low)) <= known:
            return
        most = accumulate(sent, max, initial=self.sent_most) if top > self.sent_most else repeat(self.sent_most)
        least = (
            accumulate(answered, min, initial=self.answered_least)
            if low < self.answered_least
            else repeat(self.answered_least)
        )
        behind, ahead = list(map(sub, most, answered)), list(map(sub, sent, least))
        if max(*behind, *ahead) > SMALLEST_MS:
            offs = [(a if a > 0 else 0.0) - (b if b > 0 else 0.0) for a, b in zip(behind, ahead, strict=True)]
            self.apart_ms = max([self.apart_ms, *offs], key=abs)

    @property
    def clock_fit(self) -> Mapping[str, float] | None:
        """That of the sidecar, or of all rows that were read; None without two moments."""
        return self.said or self.fit.as_row()

    @property
    def line(self) -> ClockLine:
        """The clock fit from its first row."""
        return ClockLine.of(self.clock_fit, self.utc_s, self.first.t_ms)

    @property
    def ends(self) -> tuple[float, float]:
        """The host's time of the first and the last row: by the fit where the device has a clock."""
        line = self.line
        return line.utc_of(self.first.t_ms), line.utc_of(self.last.t_ms)

    @property
    def apart(self) -> bool:
        """Whether the clocks part by more than a segment allows."""
        return abs(self.apart_ms) > WITHIN_MS

    def as_export(self) -> dict[str, Any]:
        """As an export carries it."""
        return {
            "segment": self.number, "first_row": self.first_row, "rows": self.rows, "begins": list(self.notes),
            "t_s": [self.first.t_ms / 1000, self.last.t_ms / 1000], "host_utc_s": self.utc_s,
            "host_mono_s": round(self.first.mono_s, 6), "clock_fit": self.clock_fit, "gaps": self.gaps,
        }  # fmt: skip


@dataclass
class Survey:
    """All of it. `clocked`: the log has a clock of the device."""

    clocked: bool
    segments: dict[int, Segment] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    marks: dict[int, str] = field(default_factory=dict)
    """What stands in the column of marks, by row."""
    gap_rows: list[int] = field(default_factory=list)
    """The rows (from 1) before which rows are missing, within a segment."""

    @property
    def rows(self) -> int:
        return sum(segment.rows for segment in self.segments.values())


def survey(log: LogFile) -> Survey:
    """Read the log once. Raises UsageError as its `blocks` do, and for one without rows."""
    reading = Surveyor(log)
    for block in log.blocks(as_written):
        reading.take({number: block.of(number) for number in sorted(set(block.segments))})
    reading.end()
    return reading.found


class Surveyor:
    """Makes a survey of the blocks that somebody reads; `found` grows with them, and has its events at the end.

    Where the `fits` of the segments are given the rows are not asked for them.
    """

    def __init__(self, log: LogFile, fits: Mapping[int, Mapping[str, float]] | None = None) -> None:
        self.found = Survey(log.clocked)
        self._log = log
        self._fits = fits or {}
        self._said: Sequence[Mapping[str, Any]] = (log.sidecar or {}).get("marks") or []
        self._heard = {one.get("row"): one.get("heard") for one in self._said}
        self._marked: list[tuple[int, int, int, float, list[str], str]] = []
        self._row, self._last, self._seq = 1, -inf, -1
        self._ahead: float | None = None
        """By how much `host_utc_s` is ahead of `host_mono_s`: a recording reads the time of day once, at its start."""

    def take(self, parts: Mapping[int, Block]) -> None:
        """The next rows, by segment. Raises UsageError where the host's time cannot be."""
        for number, part in parts.items():
            mono, utc = map(part.floats, ("host_mono_s", "host_utc_s"))
            self._follow(mono, utc, part.integers("seq"))
            if (segment := self.found.segments.get(number)) is None:
                first = Place(None, Moment(mono[0], mono[0]), part.t_ms[0], number)
                before = self.found.segments.get(number - 1)
                pause = mono[0] - before.last.mono_s if before else 0.0
                segment = Segment(number, self._row, first, None, first, utc_s=utc[0], pause_s=pause)
                segment.said = self._fits.get(number)
                self.found.segments[number] = segment
            segment.read(part, self._log.clock)
            marks = part.columns[MARK]
            for at in [at for at, mark in enumerate(marks) if mark] if any(marks) else ():
                text = self.found.marks[self._row + at] = marks[at].decode()
                notes, rest = self._notes(text, self._row + at, segment)
                self._marked.append((self._row + at, number, part.t_ms[at], utc[at], notes, rest))
            self._row += len(mono)

    def _follow(self, mono: Sequence[float], utc: Sequence[float], seq: Sequence[int]) -> None:
        """Raise UsageError for a row at which the host's clock fell back, or is none, or which answers no later request."""
        if mono[0] < self._last or mono != sorted(mono) or not 0 <= min(utc) <= max(utc) < LATEST_S:
            last = self._last
            for at, (moment, wall) in enumerate(zip(mono, utc, strict=True), self._row + 1):
                if moment < last or not 0 <= wall < LATEST_S:
                    raise damaged(self._log.path, at, "the time of this computer does not follow from the row before")
                last = moment
        ahead = list(map(sub, utc, mono))
        self._ahead = ahead[0] if self._ahead is None else self._ahead
        if max(ahead) - self._ahead > SAME_S or self._ahead - min(ahead) > SAME_S:
            at = next(at for at, one in enumerate(ahead, self._row + 1) if abs(one - self._ahead) > SAME_S)
            raise damaged(self._log.path, at, "host_utc_s and host_mono_s disagree with the rows before")
        if seq[0] <= self._seq or not all(map(lt, seq, seq[1:])):
            at = next(at for at, (a, b) in enumerate(pairwise([self._seq, *seq]), self._row + 1) if b <= a)
            raise damaged(self._log.path, at, "seq does not follow from the row before")
        self._last, self._seq = mono[-1], seq[-1]

    def _notes(self, text: str, row: int, segment: Segment) -> tuple[list[str], str]:
        """What the recorder wrote into a mark, and the rest of it. A gap is known from here on."""
        rest, notes = text, []
        own = [str(one.get("text")) for one in self._heard.get(row) or ()]
        while match := NOTE.match(rest):
            if match[1].startswith("gap") and any(text.startswith(f"[{match[1]}]") for text in own):
                break  # a person wrote it
            if not match[1].startswith("gap") and row > segment.first_row:
                break  # the same: the recorder begins a segment there
            notes.append(match[1])
            rest = rest[match.end() :]
        for note in notes:
            gap = note.startswith("gap")
            if gap and row > segment.first_row:
                segment.gaps += 1
                self.found.gap_rows.append(row)
            elif not gap:
                segment.notes = (*segment.notes, note)
        return notes, rest

    def end(self) -> None:
        """There are no more rows. Raises UsageError where there were none."""
        if not self.found.segments:
            raise self._log.without(None)
        self.found.events = list(self._events())

    def _events(self) -> Iterator[Event]:
        """Breaks and gaps at their rows; marks at the time at which they came, where the sidecar has it."""
        for row, number, t_ms, came, notes, rest in self._marked:
            utc = self.found.segments[number].line.utc_of(t_ms) if self.found.clocked else came
            for note in notes:
                yield Event(utc, GAP if note.startswith("gap") else BREAK, note, row)
            yield from _marks(self._heard.get(row) or ([{"text": rest}] if rest else []), utc, row)
        late = [one for one in self._said if one.get("row") is None]  # after the last row: the file does not have them
        last = self.found.segments[max(self.found.segments)]
        for one in late:
            yield from _marks(one.get("heard") or [one], last.ends[1], last.first_row + last.rows - 1)


def _marks(said: Sequence[Mapping[str, Any]], utc_s: float, row: int) -> Iterator[Event]:
    for one in said:
        yield Event(one.get("host_utc_s") or utc_s, MARKED, str(one.get("text")), row)
