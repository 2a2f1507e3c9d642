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
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from handctl.errors import HandctlError, OutputError, UsageError
from handctl.files import atomic_write, has_content, opened, try_lock, writing
from handctl.model.device_clock import WITHIN_MS
from handctl.record.csv_columns import Stamp, clean
from handctl.record.marks import MOST, Heard
from handctl.record.timeline import CLOCKS, PORT_LOST, RESTART, Hole, Place, Timeline
from handctl.system import disk, signals

if TYPE_CHECKING:
    from handctl.record.row_source import Sample, Source

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

    Raises UsageError when a file of that name exists (unless `force`) or cannot be made. With `force` what was there, the sidecar
    too, is kept until there is a row.
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
        self.unread: Counter[str] = Counter()
        """In how many rows a column could not be read."""
        self.unread_why: dict[str, HandctlError] = {}
        """Why not, the last time."""
        self.pending: list[Heard] = []
        """The marks that the next row gets."""
        self.on_row: Callable[[float, str], None] | None = None
        """Is given each row that is in the file: when it was taken, by the link's clock, and its line."""
        self._reopened = False
        self._utc_offset = clock.wall() - clock.now()
        self.clock_set_s = 0.0
        """By how much the time of day was set during the log, or the computer slept: `host_utc_s` is by that of the start."""
        self._about = about
        self._size = 0
        self._on_disk = False
        self._first: Stamp | None = None
        self._last: Stamp | None = None
        self._file = open_new(path, force)
        self.kept = has_content(self._file)
        """Whether the file is still the one that was there before."""
        if self.kept:
            return
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
        heard = self.pending[:MOST]
        mark = _text(heard) if heard else ""
        text = self.source.layout.line(stamp, sample.values, "; ".join([*_notes(place), *([mark] if mark else [])]))
        with without_interrupts():
            if self.kept:
                self._replace()
            self._append(text)
            self.timeline.count(place)
            if sample.unread:
                self.unread.update(sample.unread.keys())
                self.unread_why |= sample.unread
            self._reopened = False
            self._first, self._last = self._first or stamp, stamp
            if heard:
                self._keep_marks(heard, self.rows)
        if self.on_row is not None:
            self.on_row(sample.moment.middle, text)
        return 0 < before < len(self.timeline.segments)

    def port_lost(self, lost: bool = True) -> None:
        """The port was lost: the next row is the first of a segment, and an end before it is a hole."""
        self._reopened = lost

    def _keep_marks(self, heard: Sequence[Heard], row: int | None) -> None:
        self.pending = self.pending[len(heard) :]
        if mark := _text(heard):
            last = self._last.place if self._last else None
            boot, t_ms = (last.boot_ms, last.t_ms / 1000) if last else (None, None)
            timed = {"heard": [one.as_row() for one in heard]} if any(one.by for one in heard) else {}
            self.marks.append({"row": row, "boot_ms": boot, "t_s": t_ms, "text": mark, **timed})

    def end(self, silent: float = 0.0) -> None:
        """No more rows: a mark that waits for one is kept by the sidecar alone, without a row; so is a hole, and a gap of the `silent` seconds at the end."""
        self._keep_marks(self.pending, None)
        self.timeline.end(round(silent * 1000))
        if self._reopened:
            self._reopened = False
            self.timeline.holes.append(Hole(None))

    def _replace(self) -> None:
        """Take the place of what was there before. Raises OutputError."""
        with writing(self.path, code="log-file"):
            os.ftruncate(self._file, 0)
        self.kept = False
        self._append(self.source.layout.header)
        self.write_sidecar()

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
        set_s = round(self.clock.wall() - self.clock.now() - self._utc_offset, 3)
        self.clock_set_s = set_s if abs(set_s) * 1000 > WITHIN_MS else 0.0
        try:
            self.close()
        except OutputError as exc:
            failure, ended = exc, exc.code if ended in AS_ASKED else ended
        try:
            self.write_sidecar(ended, **more)
        except OutputError:
            self._note_end(ended)
            raise
        if failure is not None:
            raise failure

    def missing(self, ended: str) -> list[str]:
        """What keeps the file from being whole: nothing lost, all of it on the disk, ended as asked."""
        reasons = {
            "lost": self.lost > 0,
            "unread": bool(self.unread),
            "port-lost": bool(self.timeline.holes),
            "not-synced": not self._on_disk,
            ended: ended not in AS_ASKED,
        }
        return [name for name, there in reasons.items() if there]

    def write_sidecar(self, ended: str | None = None, **more: Any) -> None:
        """Write the present state of the sidecar, with the keys of `more`; `ended` once the file is closed. Raises OutputError."""
        if self.kept:
            return
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
            "unread": self.unread,
            "standstill": line.standstill,
            **({"clock_set_s": self.clock_set_s} if self.clock_set_s else {}),
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

    def _note_end(self, ended: str) -> None:
        """Say in the sidecar of the open log how it ended, in the room that it has: no room is left for a new one. Never raises."""
        with contextlib.suppress(OSError, ValueError), open(self.sidecar, "r+b") as file:
            before = file.read()
            content = json.dumps({**json.loads(before), "ended": ended}, ensure_ascii=False, separators=(",", ":"))
            if len(data := content.encode()) < len(before):
                file.seek(0)
                file.write(data.ljust(len(before) - 1) + b"\n")

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


def is_recording(path: str) -> bool:
    """Whether there is a recording of this name, or it is the sidecar of one."""
    for sidecar in (path, f"{path}.json"):
        with contextlib.suppress(UsageError), opened(sidecar, "a sidecar") as file:
            if re.match(rb'\s*{\s*"schema"\s*:\s*"handctl-[a-z]+-log/', file.read(200)):
                return True
    return False


def _text(heard: Sequence[Heard]) -> str:
    """What a row says of its marks."""
    return clean("; ".join(mark.text for mark in heard))


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
    """A new file, descriptor for writing, or with `force` an existing one as it is; no other program records into it. Raises UsageError and OutputError."""
    refuse_existing(path, force)
    with writing(path, hint="choose another file", code="log-file"):
        try:
            file = os.open(path, os.O_WRONLY | os.O_CREAT | disk.BINARY | (0 if force else os.O_EXCL), 0o666)
        except FileExistsError as exc:
            raise UsageError(f"{path} exists", hint="choose another file", code="file-exists") from exc
    if not try_lock(file):
        os.close(file)
        hint = "end that recording first, or choose another file"
        raise UsageError(f"{path}: another handctl is recording into it", hint=hint, code="file-exists")
    return file


def in_words(setting: Mapping[str, Any]) -> str:
    """One value of `Source.settings` for people: ``Left Affected``, ``15.5 in``."""
    unit = f" {setting['unit']}" if setting["unit"] else ""
    return str(setting.get("label") or f"{setting['value']}{unit}")


def changed(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Names of the settings that differ."""
    return [name for name in before if before[name]["value"] != after.get(name, {}).get("value")]


# -- the loop -------------------------------------------------------------------------------------------------------
