"""The command `log FILE` of every family: record a device with a sidecar. The recorder itself is in `record`.

A family whose rows are the values of its map gets the command with its map verbs; another one brings a `Source` of its own.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from handctl import __version__
from handctl.command import export_command
from handctl.command.get_set_watch import bounds_of, select
from handctl.command.run import Run
from handctl.errors import HandctlError, LinkError, OutputError, UsageError
from handctl.model.device_clock import Moment
from handctl.model.param import Element, ParamMap, Reading
from handctl.model.result import Column, Table, name_of
from handctl.record.csv_and_sidecar import (
    Recording,
    changed,
    file_name,
    in_words,
    next_trial,
    refuse_existing,
    without_interrupts,
)
from handctl.record.csv_columns import RowsLayout
from handctl.record.marks import Heard, Marks
from handctl.record.marks import text_of as mark_text
from handctl.record.recording_loop import Limits, Loop
from handctl.record.row_source import Ended, Sample, Source
from handctl.record.timeline import TORN_MS, is_torn
from handctl.screen.csv_output import REMARKS, column_of, in_persons_unit
from handctl.screen.sanitize import text_of
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.model.device import Device
    from handctl.model.result import Row
    from handctl.model.result import Sample as Taken
    from handctl.record.log_reader import LogFile
    from handctl.record.timeline import Hole

SUMMARY = (
    Column("file", "File"),
    Column("rows", "Rows", right=True),
    Column("duration", "Duration", right=True, unit="s"),
    Column("rate", "Rate", right=True, unit="Hz"),
    Column("lost", "Lost", right=True),
    Column("gaps", "Gaps", right=True),
    Column("holes", "Holes", right=True),
    Column("segments", "Segments", right=True),
    Column("marks", "Marks", right=True),
)
OWN_NAMES = ("usb:", "/dev/serial/by-id/", "fake://")
"""Names of a port that no other device gets."""


@dataclass(frozen=True)
class RequestedOptions:
    """The options that every recording has. `force`: None = nothing is ever overwritten."""

    duration: float | None
    count: int | None
    rate: float
    mark: str
    mark_udp: int | None
    mark_stdin: bool
    silence: float
    force: bool | None
    limits: Sequence[str] = ()
    until: Sequence[str] = ()
    lsl: bool = False
    check: bool = False


def log(
    run: Run,
    file: str,
    wishes: RequestedOptions,
    params: ParamMap[Any],
    source_of: Callable[[Callable[[], bool]], Source],
    reading: Callable[[str], LogFile] | None = None,
) -> Table:
    """Record the source that `source_of` makes of the device; it is given what opens a lost port again. `params` has the names of limits.

    `reading` opens a log of the family, where its columns are not those of `RowsLayout`: with --check nothing is recorded.
    """

    if wishes.check:
        from handctl.record.log_reader import LogFile

        if wishes != RequestedOptions(None, None, 0.0, "", None, False, wishes.silence, False, check=True):
            raise UsageError("--check records nothing, so it takes no other option of log", hint="leave them out")
        return export_command.check(run, reading(file) if reading is not None else LogFile(file, run.family.kind))
    place = place_of(run, file, wishes)
    path, trial = place.path, place.trial
    bounds = bounds_of(run, params, wishes.limits, wishes.until)
    source = source_of(lambda: _reopen(run))
    before = dict(source.settings())
    link = run.open_link()
    about = {
        "tool": {"name": "handctl", "version": __version__},
        "command": run.command,
        "simulated": run.simulated,
        **({} if trial is None else {"trial": trial}),
        **source.about(),
        "asked": {"rate_hz": wishes.rate or None, "rows": wishes.count, "duration_s": wishes.duration},
        "settings_before": before,
    }
    over = bounds.over if bounds is not None else None
    with ExitStack() as end:
        with (
            closing(Keys(run.prompts.interactive)) as keys,
            closing(Marks(keys.pressed, port=wishes.mark_udp, lines=sys.stdin if wishes.mark_stdin else None)) as marks,
            ExitStack() as cleanup,
        ):
            by = ["Any key sets a mark"] if keys.heard else []
            by += [f"A datagram to 127.0.0.1:{marks.port} sets a mark"] if marks.port is not None else []
            take, on_row = marks.take, None
            if wishes.lsl:
                from handctl.record import lsl

                streams = cleanup.enter_context(closing(lsl.Streams(source, wishes.rate, marks.hear)))
                on_row, take = streams.row, lambda: streams.marks(marks.take())
                by.append(f"Rows and marks are sent on LSL as {streams.name!r}")
            while True:
                try:
                    recording = Recording(path, link, source, about, rate=wishes.rate, force=place.force)
                    break
                except UsageError as exc:
                    taken = path
                    if place.ours and exc.code == "file-exists":
                        path, number = next_trial(place.named)  # another program has begun this one meanwhile
                    if path == taken:
                        raise
                    if trial is not None:
                        about["trial"] = trial = number
            end.enter_context(closing(recording))
            recording.on_row = on_row
            where = f"{path}, trial {trial}" if trial else path
            run.prompts.say(". ".join((f"recording into {where}", *by, "Ctrl-C ends")))
            limits = Limits(wishes.rate, wishes.count, wishes.duration, wishes.silence, run.end, over)
            if source.paced:
                limits = Limits(silence=0.0, bound=run.end, over=over)
            marked = _first(wishes.mark, take, export_command.cells_of(run))
            failure = Loop(recording, limits, marked, run.prompts, before).run()
        failure = _finish(run, recording, before, failure) or _never_read(recording)
        failure = failure or (bounds.failure() if bounds is not None else None)
    _tell(run, recording)
    row = {**({} if trial is None else {"trial": trial}), **recording.as_row()}
    columns = SUMMARY if trial is None else (SUMMARY[0], Column("trial", "Trial", right=True), *SUMMARY[1:])
    return Table(rows=[row], columns=columns, plain=("rows", "rate"), failure=failure)


class Place(NamedTuple):
    """Where a recording goes: the name that was given, the file that is going to be made, the number of its trial.

    ours   the name is ours to choose, as that of a trial and of a file in a folder: there is always another one
    force  it replaces what is there
    """

    named: str
    path: str
    trial: int | None
    ours: bool
    force: bool


def place_of(run: Run, file: str, wishes: RequestedOptions) -> Place:
    """The place of a recording. Raises UsageError for what `log` cannot do."""
    if wishes.lsl:
        from handctl.record import lsl

        lsl.library()  # what is not installed is told before anything is sent
    named = file_name(file, run.family.kind)
    ours = run.settings.append or named != file
    path, trial = next_trial(named) if ours else (named, None)
    force = bool(wishes.force) and not ours
    refuse_existing(path, force, final=wishes.force is None)
    return Place(named, path, trial if run.settings.append else None, ours, force)


def of_map(run: Run, names: Sequence[str], again: Callable[[], bool], *, every: bool = False) -> Source:
    """The named quantities of the device, or those that change by themselves; `every` = all that it says unasked."""
    if names and run.family.map_of is None:
        select(run.planner().map, tuple(names))  # a wrong name is told before the link is opened
    device = run.device()
    if every:
        device.follow()
    blocks = {name: read for name in names if (read := device.block(name)) is not None}
    wanted = tuple(name for name in names if name not in blocks) if names else device.live
    return MapSource(device, device.of_this_device(select(device.map, wanted)), again, [*blocks.values()])


def _reopen(run: Run) -> bool:
    """Try once to reopen the lost port. If only its path is known, warn that another device can get it."""
    access = run.connection.device_access
    again = access is not None and access.reopen()
    link = run.open_link()
    if again and not link.name.startswith(OWN_NAMES):
        run.journal.info(
            "by-path",
            f"{link.name}: the port that came back was recognized only by its path, which another device could have taken",
            hint="next time use usb:VID:PID:SERIAL, or its name in /dev/serial/by-id",
        )
    return again


def _first(
    text: str, came: Callable[[], Sequence[Heard]], say: Callable[[str], str] = str
) -> Callable[[], Sequence[Heard]]:
    """Marks: `text` for the first row, then what comes, as `say` makes a cell of each."""
    waiting = [Heard(first)] if (first := mark_text(text)) else []
    return lambda: [
        one._replace(text=say(one.text)) for one in (*(waiting.pop() for _ in range(len(waiting))), *came())
    ]


def _finish(
    run: Run, recording: Recording, before: Mapping[str, Any], failure: HandctlError | None
) -> HandctlError | None:
    """Read the settings and the rest again, close the file, write the sidecar; returns what went wrong first."""
    source, after = recording.source, None
    if not isinstance(failure, LinkError):
        try:
            after = dict(source.settings())
        except (HandctlError, KeyboardInterrupt) as exc:
            run.journal.warn("settings-unread", f"the settings after the log are unknown: {str(exc) or 'interrupted'}")
    if after is not None and recording.rows and source.looks:
        try:
            source.look(recording.timeline.last, recording.rows)
        except (HandctlError, KeyboardInterrupt):
            source.unanswered()
    differing = changed(before, after) if after is not None else None
    if differing and after is not None:
        shown = ", ".join(f"{name} {in_words(before[name])} -> {in_words(after[name])}" for name in differing)
        run.journal.warn("settings-changed", f"settings changed during the log: {shown}")
    with without_interrupts():
        try:
            recording.finish(
                failure.code if failure is not None else "limit",
                settings_after=after,
                settings_changed=differing,
            )
        except OutputError as exc:
            return failure or exc
    return failure


def _never_read(recording: Recording) -> HandctlError | None:
    """The error for quantities that no row has."""
    never = [column for column, rows in recording.unread.items() if rows == recording.rows]
    if not never:
        return None
    error = recording.unread_why[never[0]]
    return error.reworded(f"{', '.join(never)}: not read in any of {plural(recording.rows, 'row')}. {error.text}")


def _tell(run: Run, recording: Recording) -> None:
    line, clock = recording.timeline, recording.source.clock_name
    if recording.kept:
        run.journal.warn("kept", f"no row was recorded, so {recording.path} is still the earlier recording")
    if line.gaps:
        lengths = [gap.length_ms / 1000 for gap in line.gaps]
        run.journal.warn(
            "gap", f"{plural(len(lengths), 'gap')}, {sum(lengths):.3f} s in all, the longest {max(lengths):.3f} s"
        )
    for hole in line.holes:
        run.journal.warn("port-lost", _hole_text(hole))
    if line.reboots:
        run.journal.warn("rebooted", f"the device was restarted {plural(line.reboots, 'time')}: see column segment")
    if parted := line.parted:
        most = max((segment.first.off_ms for segment in parted), key=abs) / 1000
        unfit = f" Segment {line.segments[-1].number} does not use {clock}." if line.unfit else ""
        maybe = (
            " The device may have been restarted, or replaced by another one."
            if any(s.rebooted is None for s in parted)
            else ""
        )
        if any(is_torn(s.first.off_ms) for s in parted):
            maybe += (
                f" A jump of {TORN_MS / 1000:.3f} s and back is a torn reading: the two 16-bit words of the clock were taken at "
                "different moments."
            )
        run.journal.warn(
            "clocks-parted",
            f"{clock} and the clock of this computer disagreed {plural(len(parted), 'time')}, by up to {most:+.3f} s. Each jump "
            f"starts a new segment; times between segments are from this computer.{maybe}{unfit}",
        )
    if moved := recording.clock_set_s:
        run.journal.warn(
            "clock-set",
            f"during the log, this computer's clock was set by {moved:+.3f} s, or the computer slept. All times in the log follow the clock as it was at the start",
        )
    if recording.skipped:
        run.journal.info(
            "skipped",
            f"{plural(recording.skipped, 'tick')} of --rate had no request: the device or this computer was late, or the port was gone",
        )
    if recording.lost:
        run.journal.warn(
            "lost", f"{plural(recording.lost, 'request')} without a valid reply: see the missing numbers in column seq"
        )
    if recording.unread:
        cells = ", ".join(f"{column} in {plural(rows, 'row')}" for column, rows in recording.unread.items())
        run.journal.warn("unread", f"not read: {cells}: see column error")
    if line.standstill:
        run.journal.warn(
            "boot-time-still",
            f"{clock} did not advance in {plural(line.standstill, 'row')}",
            hint=f"give a lower --rate: {clock} ticks every 2 ms. Otherwise the device's clock has stopped",
        )


def _hole_text(hole: Hole) -> str:
    if hole.row is None:
        return "The port was lost after the last row. No rows have been recorded since then"
    restarted = " The device restarted in between." if hole.rebooted else ""
    if hole.rebooted is None:
        restarted = " It is unknown whether the device restarted in between."
    seconds = (hole.length_ms or 0) / 1000
    return f"Before row {hole.row} the port was lost: {seconds:.3f} s have no rows. Segment {hole.segment} begins there.{restarted}"


class MapSource(Source):
    """`elements` of a device, and what each of `blocks` reads; `again` opens a lost port, see `Source.reopen`."""

    def __init__(
        self,
        device: Device,
        elements: Sequence[Element],
        again: Callable[[], bool],
        blocks: Sequence[Callable[[], list[Row]]] = (),
    ) -> None:
        self.kind = device.kind
        rows = [device.row(Reading(element, None, b"", None)) for element in elements]
        rows += [row for read in blocks for row in read()]
        columns = [column_of(row) for row in rows]
        self._blocks, self._columns = blocks, columns[: len(elements)]
        self.layout = RowsLayout(list(zip(columns, rows, strict=True)))
        self._device, self._elements, self._again = device, list(elements), again
        self._identity = device.identity()
        self._met = self._named = False
        self._settings = device.map.kept(setpoints=False, further=device.further(self._identity))

    def sample(self) -> Sample:
        device = self._device
        begun = device.link.now()
        readings = device.read(self._elements) if self._elements else []
        more = [row for read in self._blocks for row in read()]
        moment = device.reading_time() or Moment(begun, device.link.now())
        unread = {name: one.error for name, one in zip(self._columns, readings, strict=True) if one.error is not None}
        if readings and len(unread) == len(readings):
            raise unread[self._columns[0]]
        good = [one.error is None and one.value is not None for one in readings]
        texts = [
            text_of(in_persons_unit(device.value_keys(one))) if read else ""
            for one, read in zip(readings, good, strict=True)
        ]
        texts += [text_of(in_persons_unit(row)) for row in more]
        rows = cache(lambda: [*(device.row(reading) for reading in readings), *more])
        if not self._named:  # a row also keeps what it says of the device: its model, its firmware
            self._named = bool(rows())
        errors = (
            "; ".join(dict.fromkeys(f"{name_of(row)}: {row['error']}" for row in rows() if row.get("error")))
            if not all(good)
            else ""
        )
        return Sample(moment, (texts, errors), rows=rows, unread=unread)

    def settings(self) -> dict[str, dict[str, Any]]:
        if not self._settings and not self._met and self._elements:  # a stranger is seen before there is a file
            self._device.read(self._elements)
        self._met = True
        rows = [self._device.row(reading) for reading in self._device.read(self._settings)] if self._settings else []
        return {
            str(element.full_name): {"value": row.get("value"), "unit": row.get("unit")}
            for element, row in zip(self._settings, rows, strict=True)
        }

    def about(self) -> dict[str, Any]:
        device = self._device
        told = {"kind": device.kind, "model": device.about.get("model"), "id": self._identity.get("id")}
        return {"device": told, "link": {"port": device.link.name, "baud": getattr(device.link, "baud", None)}}

    def sidecar(self) -> dict[str, Any]:
        return {"counters": self._device.journal.counters.as_row()}

    def reopen(self) -> bool:
        return self._device.reopen(self._again)


class StreamSource(MapSource):
    """The samples of a stream, which has the device until it ends: settings are read before and after.

    samples   first one without values, which shows what its rows are; then each as it comes
    moment    when the last one was taken
    summary   further keys of the sidecar
    """

    paced = True

    def __init__(
        self,
        device: Device,
        samples: Iterator[Taken],
        moment: Callable[[], Moment],
        summary: Callable[[], dict[str, Any]],
    ) -> None:
        super().__init__(device, (), lambda: False)
        self._samples, self._moment, self._summary = samples, moment, summary

    def settings(self) -> dict[str, dict[str, Any]]:
        begun = self._met
        found = super().settings()
        if not begun:
            self.layout = RowsLayout([(column_of(row), row) for row in next(self._samples).rows])
        return found

    def sample(self) -> Sample:
        try:
            rows = next(self._samples).rows
        except StopIteration:
            raise Ended from None
        remarks = "; ".join(f"{name_of(row)}: {row[key]}" for row in rows for key in REMARKS if row.get(key))
        return Sample(self._moment(), ([text_of(in_persons_unit(row)) for row in rows], remarks), rows=lambda: rows)

    def ended(self) -> None:
        if isinstance(self._samples, Generator):
            self._samples.close()

    def sidecar(self) -> dict[str, Any]:
        return {**super().sidecar(), **self._summary()}


class Keys:
    """Keys pressed on the terminal, if `wanted`, as the texts of marks."""

    def __init__(self, wanted: bool) -> None:
        from handctl.stop.stop_listener import Keyboard

        self._waiting: deque[str] = deque()
        self._count = 0
        self._keyboard = Keyboard.on_terminal(lambda key, _frame: self._waiting.append(key)) if wanted else None

    @property
    def heard(self) -> bool:
        """Whether a key sets a mark."""
        return self._keyboard is not None

    def pressed(self) -> str:
        """The text of a mark: the keys since the last call, a numbered word for space; "" for none."""
        text = "".join(self._waiting.popleft() for _ in range(len(self._waiting)))
        if not text.isprintable() or not text:
            return ""
        self._count += 1
        return text.strip() or f"mark {self._count}"

    def close(self) -> None:
        """No keys any more."""
        if self._keyboard is not None:
            self._keyboard.close()
