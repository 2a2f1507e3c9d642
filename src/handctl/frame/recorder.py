"""`log FILE` of every family: a recording of its device, with its sidecar. The recorder itself is in `record`.

A family whose rows are the values of its map gets the command with its map verbs; another one brings a `Source` of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Any

import click

from handctl import __version__
from handctl.errors import HandctlError, LinkError, OutputError
from handctl.frame.clikit import streaming
from handctl.frame.filetypes import OutFile
from handctl.frame.numbers import Seconds
from handctl.frame.run import Run
from handctl.model.result import Column, Table
from handctl.sentence import plural

if TYPE_CHECKING:
    from handctl.record.recording import Recording
    from handctl.record.source import Source
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
class Wishes:
    """The options that every recording has."""

    duration: float | None
    count: int | None
    rate: float
    mark: str
    silence: float
    force: bool


def log_options(body: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: FILE, and the options of `Wishes`."""
    options = (
        click.argument("file", type=OutFile(beside=(".json",))),
        streaming(0.0),
        click.option("--mark", metavar="TEXT", default="", help="Mark the first row with TEXT."),
        click.option(
            "--silence",
            type=Seconds(),
            default=60.0,
            show_default=True,
            metavar="S",
            help="End after S seconds without a valid reply. handctl also waits this long for a lost port to come back.",
        ),
        click.option("--force", is_flag=True, help="Overwrite FILE."),
    )
    return reduce(lambda made, option: option(made), reversed(options), body)


def log(run: Run, file: str, wishes: Wishes, source_of: Callable[[Callable[[], bool]], Source]) -> Table:
    """Record the source that `source_of` makes of the device; it is given what opens a lost port again."""
    from handctl.record import recording as files
    from handctl.record.keys import Keys

    assert run.family is not None
    path = files.file_name(file, run.family.kind)
    files.refuse_existing(path, wishes.force)
    source = source_of(lambda: _reopen(run))
    before = dict(source.settings())
    link = run.open_link()
    about = {
        "tool": {"name": "handctl", "version": __version__},
        "command": run.command,
        "simulated": run.simulated,
        **source.about(),
        "asked": {"rate_hz": wishes.rate or None, "rows": wishes.count, "duration_s": wishes.duration},
        "settings_before": before,
    }
    recording = files.Recording(path, link, source, about, rate=wishes.rate, force=wishes.force)
    try:
        with Keys(run.guide.interactive) as keys:
            run.guide.say(f"recording into {path}. {'a key sets a mark, ' if keys.heard else ''}Ctrl-C ends")
            failure = files.record(
                recording,
                files.Limits(wishes.rate, wishes.count, wishes.duration, wishes.silence, run.end),
                mark=_first(wishes.mark, keys.pressed),
                guide=run.guide,
                before=before,
            )
        failure = _finish(run, recording, before, failure)
    finally:
        recording.close()
    _tell(run, recording)
    return Table(rows=[recording.as_row()], columns=SUMMARY, plain=("rows", "rate"), failure=failure)


def of_map(run: Run, names: Sequence[str], again: Callable[[], bool]) -> Source:
    """The named quantities of the device, or those that change by themselves."""
    from handctl.frame.mapsource import MapSource
    from handctl.frame.verbs import select

    if names and run.family is not None and run.family.map_of is None:
        select(run.planner().map, names)  # a wrong name is told before the link is opened
    device = run.device()
    return MapSource(device, device.here(select(device.map, names or device.live)), again)


def _reopen(run: Run) -> bool:
    """Look once for the port that was lost; where only its path was known, tell that another device can get it."""
    again = run.hold is not None and run.hold.reopen()
    link = run.open_link()
    if again and not link.name.startswith(OWN_NAMES):
        run.journal.info(
            "by-path",
            f"{link.name}: the port that came back was recognized only by its path, which another device could have taken",
            hint="next time use usb:VID:PID:SERIAL, or its name in /dev/serial/by-id",
        )
    return again


def _first(text: str, pressed: Callable[[], str]) -> Callable[[], str]:
    """Marks: `text` for the first row, then the keys."""
    waiting = [text]
    return lambda: "; ".join(filter(None, [waiting.pop() if waiting else "", pressed()]))


def _finish(
    run: Run, recording: Recording, before: Mapping[str, Any], failure: HandctlError | None
) -> HandctlError | None:
    """Read the settings and the rest again, close the file, write the sidecar; returns what went wrong first."""
    from handctl.record.recording import changed, in_words, undisturbed

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
    with undisturbed():
        try:
            recording.finish(
                failure.code if failure is not None else "limit",
                settings_after=after,
                settings_changed=differing,
            )
        except OutputError as exc:
            return failure or exc
    return failure


def _tell(run: Run, recording: Recording) -> None:
    line, clock = recording.timeline, recording.source.clock_name
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
            " It may have been restarted, or replaced by another device."
            if any(s.rebooted is None for s in parted)
            else ""
        )
        run.journal.warn(
            "clocks-parted",
            f"{clock} and the clock of this computer disagreed {plural(len(parted), 'time')}, by up to {most:+.3f} s. Each jump "
            f"starts a new segment; times between segments are from this computer.{maybe}{unfit}",
        )
    if recording.skipped:
        run.journal.info(
            "skipped",
            f"{plural(recording.skipped, 'tick')} of --rate without a request: the device or this machine was late, or the port was gone",
        )
    if recording.lost:
        run.journal.warn(
            "lost", f"{plural(recording.lost, 'request')} without a valid reply: see the missing numbers in column seq"
        )
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
