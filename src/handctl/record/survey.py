"""One pass through a recording: its segments with the fit of the two clocks, breaks, gaps and marks. Computed from the rows, not read from the sidecar.

    host = the host's clock at a segment's first row + a + b * (t_s - t_s of that row)

So each row has the host's time by the fit, which the round trips do not shake, beside the device's.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple

from handctl.model.sampling import WITHIN_MS, Moment
from handctl.record import timeline
from handctl.record.log_file import LATEST_S, LogFile, damaged
from handctl.record.source import MARK
from handctl.record.timeline import Place

NOTE = re.compile(r"\[(port lost|reboot|clocks [^]]*|gap [0-9]{1,9}[.][0-9]{3} s)\](?:; |$)")
"""What the recorder itself writes into a mark, before the text of a person."""
BREAK, GAP, MARKED = "break", "gap", "mark"


class Line(NamedTuple):
    """The clock fit of a segment: from its first row, which was at `utc_s` since 1970 by the host and at `t_ms`."""

    utc_s: float
    t_ms: int
    a: float = 0.0
    b: float = 1.0

    def utc_of(self, t_ms: int) -> float:
        """The host's time, seconds since 1970."""
        return self.utc_s + self.a + self.b * (t_ms - self.t_ms) / 1000


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
    """

    utc_s: float = 0.0
    pause_s: float = 0.0
    notes: tuple[str, ...] = ()
    gaps: int = 0
    apart_ms: float = 0.0

    def read(self, t_ms: Sequence[int], mono: Sequence[float], rtt: Sequence[float], *, clocked: bool) -> None:
        """Take rows that follow each other."""
        for ms, middle, trip in zip(t_ms, mono, rtt, strict=True):
            moment = Moment(middle - trip / 2000, middle + trip / 2000)
            if clocked and self.rows:
                self.apart_ms = max(self.apart_ms, self.off(ms - self.first.t_ms, moment), key=abs)
            self.take(Place(None, moment, ms, self.number), clocked=clocked)

    @property
    def line(self) -> Line:
        """The fit of all rows that were read."""
        fit = self.fit.as_row()
        return Line(self.utc_s, self.first.t_ms, *((fit["a_s"], fit["b"]) if fit else ()))

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
            "host_mono_s": round(self.first.mono_s, 6), "clock_fit": self.fit.as_row(), "gaps": self.gaps,
        }  # fmt: skip


@dataclass
class Survey:
    """All of it. `clocked`: the log has a clock of the device."""

    clocked: bool
    segments: dict[int, Segment] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    gap_rows: list[int] = field(default_factory=list)
    """The rows (from 1) before which rows are missing, within a segment."""

    @property
    def rows(self) -> int:
        return sum(segment.rows for segment in self.segments.values())


def survey(log: LogFile) -> Survey:
    """Read the log once. Raises UsageError as its `blocks` do, and for one without rows."""
    found = Survey(log.clocked)
    marked: list[tuple[int, int, int, float, str]] = []
    row, last = 1, -inf
    for block in log.blocks():
        for number in sorted(set(block.segments)):
            part = block.of(number)
            mono, utc, rtt = (
                [float(text) for text in part.columns[name]] for name in ("host_mono_s", "host_utc_s", "rtt_ms")
            )
            if (segment := found.segments.get(number)) is None:
                first = Place(None, Moment(mono[0], mono[0]), part.t_ms[0], number)
                before = found.segments.get(number - 1)
                pause = mono[0] - before.last.mono_s if before else 0.0
                segment = found.segments[number] = Segment(number, row, first, None, first, utc_s=utc[0], pause_s=pause)
            for at, moment in enumerate(mono):
                if moment < last or not 0 <= utc[at] < LATEST_S:
                    raise damaged(
                        log.path, row + at + 1, "the time of this computer does not follow from the row before"
                    )
                last = moment
            segment.read(part.t_ms, mono, rtt, clocked=log.clocked)
            marks = part.columns[MARK]
            marked += [(row + at, number, part.t_ms[at], utc[at], mark) for at, mark in enumerate(marks) if mark]
            row += len(mono)
    if not found.segments:
        raise log.without(None)
    found.events = list(_events(found, marked, log))
    return found


def _events(found: Survey, marked: Sequence[tuple[int, int, int, float, str]], log: LogFile) -> Iterator[Event]:
    """Breaks and gaps at their rows; marks at the time at which they came, where the sidecar has it."""
    said: Sequence[Mapping[str, Any]] = (log.sidecar or {}).get("marks") or []
    heard = {one.get("row"): one.get("heard") for one in said}
    for row, number, t_ms, came, text in marked:
        segment = found.segments[number]
        utc = segment.line.utc_of(t_ms) if found.clocked else came
        rest, notes = text, []
        own = [str(one.get("text")) for one in heard.get(row) or ()]
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
                found.gap_rows.append(row)
            elif not gap:
                segment.notes = (*segment.notes, note)
            yield Event(utc, GAP if gap else BREAK, note, row)
        yield from _marks(heard.get(row) or ([{"text": rest}] if rest else []), utc, row)
    late = [one for one in said if one.get("row") is None]  # after the last row: the file does not have them
    last = found.segments[max(found.segments)]
    for one in late:
        yield from _marks(one.get("heard") or [one], last.ends[1], last.first_row + last.rows - 1)


def _marks(said: Sequence[Mapping[str, Any]], utc_s: float, row: int) -> Iterator[Event]:
    for one in said:
        yield Event(one.get("host_utc_s") or utc_s, MARKED, str(one.get("text")), row)
