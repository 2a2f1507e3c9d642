"""Record a device into a CSV file with a sidecar: one complete row per valid reply, however the recording ends.

    gait.csv        header, then a row per answer, handed to the system at once
    gait.csv.json   written at the start ("closed": false) and at the end; always whole

A row is one write; a row cut short by a full disk is taken back. Reads only: nothing here can set anything.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil, inf
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from handctl.errors import HandctlError, Interrupted, LinkError, NoAnswer, OutputError, ProtocolError, UsageError
from handctl.files import atomic_write, writing
from handctl.model.prompts import Prompts
from handctl.record.marks import Heard
from handctl.record.source import Ended, Stamp, clean
from handctl.record.timeline import CLOCKS, PORT_LOST, RESTART, Hole, Place, Timeline
from handctl.system import disk, signals

if TYPE_CHECKING:
    from handctl.model.result import Row
    from handctl.record.source import Sample, Source

AS_ASKED = ("limit", "interrupted")
"""How a recording ends that ends as somebody wished."""


class Clock(Protocol):
    """The clock of the link, and its time of day."""

    def now(self) -> float: ...
    def wall(self) -> float: ...
    def sleep(self, seconds: float) -> None: ...


@contextlib.contextmanager
def without_interrupts() -> Iterator[None]:
    """Ctrl-C and its like wait until the body is through, so that file and counts stay in step."""
    with signals.held_back(signals.numbers()):  # what had arrived before is raised
        yield


class Recording:
    """One recording and its sidecar, being written.

    Raises UsageError when a file of that name exists (unless `force`) or cannot be made.
    """

    def __init__(
        self, path: str, clock: Clock, source: Source, about: dict[str, Any], *, rate: float, force: bool
    ) -> None:
        self.path = path
        self.clock = clock
        self.source = source
        self.timeline = Timeline(1000 / rate if rate else 0.0, source.period_ms)
        self.marks: list[dict[str, Any]] = []
        self.lost = 0
        """Requests without a valid answer, after the retries."""
        self.skipped = 0
        """Ticks of the rate without a request: the machine or the device was busy, or the port was gone."""
        self.pending: list[Heard] = []
        """The marks that the next row gets."""
        self.on_row: Callable[[float, str], None] | None = None
        """Is given each row that is in the file: when it was taken, by the link's clock, and its line."""
        self._reopened = False
        self._utc_offset = clock.wall() - clock.now()
        self._about = about
        self._size = 0
        self._on_disk = False
        self._first: Stamp | None = None
        self._last: Stamp | None = None
        self._file = open_new(path, force)
        try:
            self._append(source.layout.header)
            self.write_sidecar()
        except HandctlError:
            with contextlib.suppress(OutputError):
                self.close()
            with contextlib.suppress(OSError):
                os.unlink(path)  # a header alone would only be in the way of the next try
            raise

    @property
    def sidecar(self) -> str:
        return f"{self.path}.json"

    @property
    def rows(self) -> int:
        return self.timeline.rows

    @property
    def seq(self) -> int | None:
        """The number of the request that the last row answers."""
        return self._last.seq if self._last else None

    def add(self, sample: Sample, seq: int) -> bool:
        """Write the row of a sample, with the pending mark; True when a segment begins with it that is not the first. Raises OutputError."""
        before = len(self.timeline.segments)
        place = self.timeline.place(sample.device_ms, sample.moment, reopened=self._reopened)
        stamp = Stamp(sample.moment.middle + self._utc_offset, place, seq)
        mark = self._pending_text()
        text = self.source.layout.line(stamp, sample.values, "; ".join([*_notes(place), *([mark] if mark else [])]))
        with without_interrupts():
            self._append(text)
            self.timeline.count(place)
            self._reopened = False
            self._first, self._last = self._first or stamp, stamp
            self._keep_mark(self.rows)
        if self.on_row is not None:
            self.on_row(sample.moment.middle, text)
        return 0 < before < len(self.timeline.segments)

    def port_lost(self) -> None:
        """The port was lost: the next row is the first of a segment."""
        self._reopened = True

    def _pending_text(self) -> str:
        return clean("; ".join(mark.text for mark in self.pending))

    def _keep_mark(self, row: int | None) -> None:
        mark, heard, self.pending = self._pending_text(), self.pending, []
        if mark:
            last = self._last.place if self._last else None
            boot, t_ms = (last.boot_ms, last.t_ms / 1000) if last else (None, None)
            timed = {"heard": [one.as_row() for one in heard]} if any(one.by for one in heard) else {}
            self.marks.append({"row": row, "boot_ms": boot, "t_s": t_ms, "text": mark, **timed})

    def end(self) -> None:
        """No more rows: a mark that waits for one is kept by the sidecar alone, without a row; so is a hole."""
        self._keep_mark(None)
        if self._reopened:
            self._reopened = False
            self.timeline.holes.append(Hole(None))

    def _append(self, text: str) -> None:
        data = text.encode()
        with writing(self.path, hint="the rows before that are complete", code="log-file"):
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._file, data[written:])
            except OSError:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._file, self._size)
                raise
        self._size += len(data)

    def close(self) -> None:
        """Everything to the disk; the file is over. Raises OutputError."""
        if self._file < 0:
            return
        file, self._file = self._file, -1
        with writing(self.path, code="log-file"):
            try:
                try:
                    disk.sync(file)
                    self._on_disk = True
                finally:
                    os.close(file)
            except OSError as exc:
                if exc.errno not in (errno.EINVAL, errno.ENOTSUP):  # not every file system can sync
                    raise

    def finish(self, ended: str, **more: Any) -> None:
        """Close the file, and say in the sidecar what it holds and how it `ended`. Raises OutputError."""
        failure: OutputError | None = None
        try:
            self.close()
        except OutputError as exc:
            failure, ended = exc, exc.code if ended in AS_ASKED else ended
        self.write_sidecar(ended, **more)
        if failure is not None:
            raise failure

    def missing(self, ended: str) -> list[str]:
        """What keeps the file from being whole: nothing lost, all of it on the disk, ended as asked."""
        reasons = {
            "lost": self.lost > 0,
            "port-lost": bool(self.timeline.holes),
            "not-synced": not self._on_disk,
            ended: ended not in AS_ASKED,
        }
        return [name for name, there in reasons.items() if there]

    def write_sidecar(self, ended: str | None = None, **more: Any) -> None:
        """Write the present state of the sidecar, with the keys of `more`; `ended` once the file is closed. Raises OutputError."""
        line = self.timeline
        missing = self.missing(ended) if ended is not None else None
        content = {
            "schema": schema(self.source.kind),
            "complete": missing == [],
            "closed": ended is not None,
            "missing": missing,
            "ended": ended,
            "file": os.path.basename(self.path),
            **self._about,
            "columns": self.source.layout.as_rows(),
            "rows": line.rows if ended is not None else None,
            "start": _moment(self._first),
            "end": _moment(self._last),
            "duration_s": line.t_s,
            "rate_hz": line.rate_hz(),
            "interval_ms": line.interval_row(),
            "lost": self.lost,
            "skipped": self.skipped,
            "standstill": line.standstill,
            "gaps": [[gap.boot_ms, gap.length_ms] for gap in line.gaps],
            "holes": [hole.as_row() for hole in line.holes],
            "segments": [segment.as_row() for segment in line.segments],
            "marks": self.marks,
            **self.source.sidecar(),
            **more,
        }
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        with writing(self.sidecar, code="log-file"), atomic_write(self.sidecar) as file:
            file.write(text)

    def as_row(self) -> dict[str, Any]:
        line = self.timeline
        return {
            "file": self.path,
            "rows": line.rows,
            "duration": line.t_s,
            "rate": line.rate_hz(),
            "lost": self.lost,
            "skipped": self.skipped,
            "gaps": len(line.gaps),
            "holes": len(line.holes),
            "segments": len(line.segments),
            "marks": len(self.marks),
            "sidecar": self.sidecar,
        }


def schema(kind: str) -> str:
    """The name of a family's format."""
    return f"handctl-{kind}-log/1"


def _notes(place: Place) -> list[str]:
    """Notes from the mark of a row."""
    words = {PORT_LOST: "[port lost]", RESTART: "[reboot]", CLOCKS: f"[clocks {place.off_ms / 1000:+.3f} s]"}
    notes = [words[reason] for reason in place.why]
    return [*notes, f"[gap {place.gap_ms / 1000:.3f} s]"] if place.gap_ms else notes


def _moment(stamp: Stamp | None) -> dict[str, Any] | None:
    from datetime import datetime, timezone

    if stamp is None:
        return None
    utc = datetime.fromtimestamp(stamp.utc_s, timezone.utc).isoformat(timespec="milliseconds")
    return {"utc": utc, "host_mono_s": round(stamp.place.mono_s, 6), "boot_ms": stamp.place.boot_ms}


def file_name(text: str, kind: str) -> str:
    """The file that is meant: in a directory, one named after the family and the moment (UTC)."""
    from datetime import datetime, timezone

    return (
        os.path.join(text, f"{kind}-{datetime.now(timezone.utc):%Y%m%dT%H%M%SZ}.csv") if os.path.isdir(text) else text
    )


def next_trial(path: str) -> tuple[str, int]:
    """The file of the next trial and its number: ``walk.csv``, then ``walk-2.csv``, one more than the highest that is there."""
    folder, name = os.path.split(path)
    stem, ending = os.path.splitext(name)
    trial = re.compile(f"{re.escape(stem)}(?:-([1-9][0-9]{{0,5}}))?{re.escape(ending)}(?:[.]json)?")
    try:
        found = [trial.fullmatch(one) for one in os.listdir(folder or os.curdir)]
    except OSError:  # told where the file is made
        found = []
    last = max((int(one[1] or 1) for one in found if one), default=0)
    return (path, 1) if not last else (os.path.join(folder, f"{stem}-{last + 1}{ending}"), last + 1)


def refuse_existing(path: str, force: bool, *, final: bool = False) -> None:
    """Raise UsageError when the file or its sidecar is there, unless `force`; `final` offers none. A device or pipe is never written to."""
    if path.endswith(("/", os.sep)):
        raise UsageError(f"{path}: no such folder", hint="create it, or give the name of a new file", code="log-file")
    for taken in (path, f"{path}.json"):
        if os.path.exists(taken) and not os.path.isfile(taken):
            raise UsageError(
                f"{taken} is not a file: a log is a file with its sidecar next to it",
                hint="give the name of a new file, or a directory",
                code="log-file",
            )
        if os.path.lexists(taken) and not force:
            raise UsageError(
                f"{taken} exists",
                hint="give another name" if final else "give another name, or --force to overwrite it",
                code="file-exists",
            )


def open_new(path: str, force: bool) -> int:
    """A new file, descriptor for writing. Never touches an existing one unless `force`. Raises UsageError and OutputError."""
    refuse_existing(path, force)
    with writing(path, hint="choose another file", code="log-file"):
        try:
            return os.open(path, os.O_WRONLY | os.O_CREAT | disk.BINARY | (os.O_TRUNC if force else os.O_EXCL), 0o666)
        except FileExistsError as exc:
            raise UsageError(f"{path} exists", hint="choose another file", code="file-exists") from exc


def in_words(setting: Mapping[str, Any]) -> str:
    """One value of `Source.settings` for people: ``Left Affected``, ``15.5 in``."""
    unit = f" {setting['unit']}" if setting["unit"] else ""
    return str(setting.get("label") or f"{setting['value']}{unit}")


def changed(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Names of the settings that differ."""
    return [name for name in before if before[name]["value"] != after.get(name, {}).get("value")]


# -- the loop -------------------------------------------------------------------------------------------------------


PROGRESS_S = 0.25
PAUSE_S = 0.05
"""Between a request without an answer and the next where there are no ticks, so that a dead line costs no processor time."""
RETRY_S = 0.1
"""Between two looks for a port that was lost."""
SHORTEST_S = 0.005
"""No answer comes sooner on any line. Where the clock is virtual, and the line has no speed, none would pass otherwise."""
ENDS = "Ctrl-C ends the log."
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
    bound     when --deadline is over, by the clock of the link; None = never
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
            return Interrupted("interrupted")
        except HandctlError as exc:
            return exc
        finally:
            self._source.ended()
            recording.skipped = self.pace.skipped
            with contextlib.suppress(OSError):
                self._prompts.done()
            recording.end()
        return None

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
            recording.lost += 1
            now, bound = self._clock.now(), self._limits.bound
            if now - self._heard >= self._limits.silence or (bound is not None and now >= bound):
                raise
            if not self._limits.rate:
                self._clock.sleep(PAUSE_S)
            return
        self._asked = False
        if answer.moment.sent == answer.moment.answered:
            self._clock.sleep(SHORTEST_S)
        self.pace.sent(answer.moment.sent)
        self._heard = self._clock.now()
        lost = self._ask_ahead()
        if self._write():
            self._begin_segment()
        if lost is not None:
            raise lost
        if self._limits.over is not None:
            self._over = self._limits.over(answer.rows(), recording.timeline.t_s)
        if self._heard - self._shown >= PROGRESS_S:
            self._shown = self._heard
            with contextlib.suppress(OSError):  # a terminal that went away
                self._prompts.progress(_progress(recording, self._heard - self._start), ENDS)
        if self._source.looks and self._heard >= self._look_due:
            self._look()

    def _write(self) -> bool:
        """Write the row of what was answered, unless it is there already; see `Recording.add`."""
        answer = self._answer
        return answer is not None and self._recording.seq != self._seq and self._recording.add(answer, self._seq)

    def _ask_ahead(self) -> LinkError | KeyboardInterrupt | None:
        """Ask for the row after this one where it is wanted, and nothing else is asked first.

        A port that is lost, and an interrupt, are raised behind this row. Nothing is held back for it: that takes longer than all
        else between an answer and the next request, in which the line has nothing to do.
        """
        limits = self._limits
        looks = self._source.looks and self._heard >= self._look_due
        last = self._heard >= self._end or (limits.rows is not None and self._recording.rows + 1 >= limits.rows)
        if limits.rate or limits.over is not None or looks or last:
            return None
        try:
            self._source.ask_ahead()
        except (LinkError, KeyboardInterrupt) as exc:
            return exc
        return None

    def _begin_segment(self) -> None:
        """Report a restart. After one, or a possible one, read again what it may have changed."""
        segment = self._recording.timeline.segments[-1]
        if segment.rebooted:
            self._prompts.say(f"The device restarted: its clock started at 0. Segment {segment.number} starts")
        if segment.rebooted is False and not segment.first.reopened:
            return
        self._look_due = self._heard
        with contextlib.suppress(NoAnswer, ProtocolError):  # it has just started: the settings may come late
            segment.settings_changed = changed(self._before, self._source.settings())

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
        while True:
            try:
                if not self._source.reopen():
                    return False
                break
            except KeyboardInterrupt:  # while the port that is gone was being closed
                self._recording.port_lost()
                raise
            except LinkError as exc:
                self._recording.port_lost()
                if (left := over - self._clock.now()) <= 0:
                    raise self._gone(lost, exc) from exc
            if not told:
                told = True
                self._prompts.say(f"{lost.text}. Waiting up to {left:.0f} s for the same port")
            with contextlib.suppress(OSError):
                self._prompts.progress(f"the port is gone, {left:.0f} s left for its return", ENDS)
            self._clock.sleep(min(RETRY_S, left))
        self._recording.port_lost()
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
