"""The loop of a recording: ask for a row at its rate, open a lost port again, end where asked."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from math import ceil, inf
from typing import TYPE_CHECKING, Any, NamedTuple

from handctl.errors import HandctlError, Interrupted, LinkError, NoAnswer, ProtocolError
from handctl.model.prompts import Prompts
from handctl.record.csv_and_sidecar import Clock, Recording, changed
from handctl.record.marks import Heard
from handctl.record.row_source import Ended

if TYPE_CHECKING:
    from handctl.model.result import Row
    from handctl.record.row_source import Sample


PROGRESS_S = 0.25
PAUSE_S = 0.05
"""Between a request without an answer and the next where there are no ticks, so that a dead line costs no processor time."""
RETRY_S = 0.1
"""Between two looks for a port that was lost."""
SHORTEST_S = 0.005
"""No answer comes sooner on any line. Where the clock is virtual, and the line has no speed, none would pass otherwise."""
ENDS = "Ctrl-C ends the log."
SILENT_S = 1.0
"""Without a valid reply for so long before its end, a recording has not ended as asked."""
LOOK_S = 1.0
"""Between two looks beside the rows."""
LOOK_REST_S = 10.0
"""The same after one without an answer: each costs a timeout, in which no row is taken."""


class Limits(NamedTuple):
    """When a recording ends by itself, and how fast it goes.

    rate      requests per second, 0 = as fast as the device answers
    rows      rows of the file; None = no limit
    duration  seconds; None = no limit
    silence   seconds without an answer that end it
    bound     when --deadline has passed, by the clock of the link; None = never
    over      (rows, seconds from the first) -> whether these are the last; None = never
    """

    rate: float = 0.0
    rows: int | None = None
    duration: float | None = None
    silence: float = 60.0
    bound: float | None = None
    over: Callable[[Sequence[Row], float], bool] | None = None


class Pace:
    """The ticks of a recording, 1/rate apart from its start: one poll for a tick at the most, and none to catch up.

    A device somewhat slower than the rate is polled as it answers. A tick that would be late by more than half a period
    is skipped and counted, so that two polls are never closer than that. Without a rate there are no ticks.
    """

    def __init__(self, clock: Clock, rate: float) -> None:
        self.skipped = 0
        self._clock = clock
        self._rate = rate
        self._start = clock.now()
        self._next = 0

    def sent(self, moment: float) -> None:
        """A request went out at this moment: late, it is that of the tick nearest to it."""
        if self._rate:
            after = ceil((moment - self._start) * self._rate - 0.5 - 1e-6) + 1
            self.skipped += max(0, after - self._next)
            self._next = max(self._next, after)

    def wait(self, end: float) -> None:
        """Until the moment of the next poll, or `end` when that comes first."""
        while self._rate:
            now = self._clock.now()
            passed = (now - self._start) * self._rate
            if passed > self._next + 0.5:
                first = ceil(passed)
                self.skipped += first - self._next
                self._next = first
            due = min(self._start + self._next / self._rate, end)
            if due <= now:
                break
            self._clock.sleep(due - now)
            if self._clock.now() <= due + 0.5 / self._rate:  # otherwise the machine slept longer: look again
                break
        self._next += 1


class Loop:
    """One recording until a limit is reached, and what stays between two of its polls.

    mark     asked before each request for the marks that have come
    before   the settings at the start: those at the first row of a segment are compared with them
    """

    def __init__(
        self,
        recording: Recording,
        limits: Limits,
        mark: Callable[[], Sequence[Heard]],
        prompts: Prompts,
        before: dict[str, Any],
    ) -> None:
        self._recording, self._limits, self._mark, self._prompts = recording, limits, mark, prompts
        self._source, self._clock, self._before = recording.source, recording.clock, before
        clock = self._clock
        self.pace = Pace(clock, limits.rate)
        self._start = self._heard = self._shown = self._look_due = clock.now()
        self._end = inf if limits.duration is None else self._start + limits.duration
        self._seq = 0
        self._over = False
        self._asked = False
        """Whether a request is without its answer."""
        self._answer: Sample | None = None
        """What the last request was answered with."""
        self._failed: NoAnswer | ProtocolError | None = None
        """Why the last request has no valid reply."""

    def run(self) -> HandctlError | None:
        """Record; what ended it before a limit, if anything. Never raises."""
        recording = self._recording
        try:
            try:
                while self.wanted:
                    try:
                        self.step()
                    except LinkError as exc:
                        if exc.code != "lost" or not self.wait_for_port(exc):
                            raise
            except KeyboardInterrupt:
                self._write()
                raise
        except Ended:
            pass
        except KeyboardInterrupt:
            return Interrupted()
        except HandctlError as exc:
            return exc
        finally:
            self._source.ended()
            recording.skipped = self.pace.skipped
            with contextlib.suppress(OSError):
                self._prompts.done()
            silent = self._clock.now() - self._heard if self._failed is not None else 0.0
            recording.end(silent)
        if self._failed is None or silent < SILENT_S:
            return None
        since = f"after row {recording.rows}" if recording.rows else "since the start"
        return self._failed.reworded(f"{self._failed.text}. No row was recorded in the last {silent:.1f} s, {since}")

    @property
    def wanted(self) -> bool:
        """Whether no limit is reached."""
        rows = self._limits.rows
        more = not self._over and (rows is None or self._recording.rows < rows)
        return more and self._clock.now() < self._end

    def step(self) -> None:
        """One poll and its row. Raises what ends the log, and LinkError for a lost port."""
        self.pace.wait(self._end)
        if not self.wanted:
            return
        recording = self._recording
        recording.pending += self._mark()
        self._seq, self._answer = self._seq + 1, None
        self._asked = True
        try:
            self._answer = answer = self._source.sample()
        except (NoAnswer, ProtocolError) as exc:
            self._asked = False
            if exc.code == "deadline":  # it was not even sent
                raise
            self._failed = exc
            recording.lost += 1
            now, bound = self._clock.now(), self._limits.bound
            if now - self._heard >= self._limits.silence or (bound is not None and now >= bound):
                raise
            if not self._limits.rate:
                self._clock.sleep(PAUSE_S)
            return
        self._asked, self._failed = False, None
        if answer.moment.sent == answer.moment.answered:
            self._clock.sleep(SHORTEST_S)
        self._heard = self._clock.now()
        looks = self._source.is_next_look(due=self._heard >= self._look_due)
        lost = None if looks else self._ask_ahead()
        self.pace.sent(answer.moment.sent)
        if self._write():
            looks = self._begin_segment() or looks
        if lost is not None:
            raise lost
        if self._limits.over is not None:
            self._over = self._limits.over(self._source.made(answer).rows(), recording.timeline.t_s)
        if self._heard - self._shown >= PROGRESS_S:
            self._shown = self._heard
            with contextlib.suppress(OSError):  # a terminal that went away
                self._prompts.progress(_progress(recording, self._heard - self._start), ENDS)
        if looks:
            self._look()

    def _write(self) -> bool:
        """Write the row of what was answered, unless it is there already; see `Recording.add`."""
        answer, recording = self._answer, self._recording
        return answer is not None and recording.seq != self._seq and recording.add(self._source.made(answer), self._seq)

    def _ask_ahead(self) -> LinkError | KeyboardInterrupt | None:
        """Ask for the row after this one where it is wanted.

        A port that is lost, and an interrupt, are raised behind this row. Nothing is held back for it: that takes longer than all
        else between an answer and the next request, in which the line has nothing to do.
        """
        limits = self._limits
        last = self._heard >= self._end or (limits.rows is not None and self._recording.rows + 1 >= limits.rows)
        if limits.rate or limits.over is not None or last:
            return None
        try:
            self._source.ask_ahead()
        except (LinkError, KeyboardInterrupt) as exc:
            return exc
        return None

    def _begin_segment(self) -> bool:
        """Report a restart. After one, or a possible one, read again what it may have changed; returns whether to look as well."""
        segment = self._recording.timeline.segments[-1]
        if segment.rebooted:
            self._prompts.say(f"The device restarted: its clock started at 0. Segment {segment.number} starts")
        if segment.rebooted is False and not segment.first.reopened:
            return False
        self._look_due = self._heard
        with contextlib.suppress(NoAnswer, ProtocolError):  # it has just started: the settings may come late
            segment.settings_changed = changed(self._before, self._source.settings())
        return self._source.is_next_look(due=True)

    def _look(self) -> None:
        recording = self._recording
        try:
            restarted = self._source.look(recording.timeline.last, recording.rows)
        except (NoAnswer, ProtocolError) as exc:
            if exc.code == "deadline":
                raise
            self._source.unanswered()
            self._look_due = self._clock.now() + LOOK_REST_S
            return
        self._look_due = self._heard + LOOK_S
        if restarted:
            recording.timeline.restarted()

    def wait_for_port(self, lost: LinkError) -> bool:
        """Until the port is open again; False where it cannot be. Raises LinkError when the time for that is over."""
        over = min(self._heard + self._limits.silence, self._end)
        told = False
        self._recording.port_lost()  # before the port is closed: an interrupt at any moment from here finds it noted
        while True:
            try:
                if not self._source.reopen():
                    self._recording.port_lost(False)  # this link has no way back: that the log ended by it says all
                    return False
                break
            except LinkError as exc:
                if (left := over - self._clock.now()) <= 0:
                    raise self._gone(lost, exc) from exc
            if not told:
                told = True
                self._prompts.say(f"{lost.text}. Waiting up to {left:.0f} s for the same port")
            with contextlib.suppress(OSError):
                self._prompts.progress(f"the port is gone, {left:.0f} s left for its return", ENDS)
            self._clock.sleep(min(RETRY_S, left))
        self._recording.lost += self._asked
        self._asked = False
        self._prompts.say("The port is open again. The next row starts a segment")
        return True

    def _gone(self, lost: LinkError, last: LinkError) -> LinkError:
        if self._heard + self._limits.silence <= self._end:
            when = f"within the {self._limits.silence:g} s of --silence"
        else:
            when = "before the end of --duration"
        return LinkError(
            f"{lost.text}. It did not come back {when}. {last.text}", hint=last.hint or lost.hint, code="lost"
        )


def _progress(recording: Recording, seconds: float) -> str:
    line = recording.timeline
    rate = line.rate_hz()
    text = f"{seconds:.1f} s  {line.rows} rows" + (f"  {rate:.1f} Hz" if rate is not None else "")
    for name, count in (("gaps", len(line.gaps)), ("lost", recording.lost), ("marks", len(recording.marks))):
        text += f"  {count} {name}" if count else ""
    return text
