"""`handctl ekso log FILE` and `handctl ekso export LOG`: recordings of GetData, and what other programs take of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import partial, update_wrapper
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from handctl import __version__
from handctl.errors import HandctlError, LinkError, NoAnswer, OutputError, ProtocolError, UsageError
from handctl.frame.clikit import Command, Group, streaming
from handctl.frame.filetypes import InFile, OutFile
from handctl.frame.numbers import FiniteRange, Seconds
from handctl.frame.options import SharedOption
from handctl.frame.run import Run
from handctl.model.result import Column, Table

if TYPE_CHECKING:
    from handctl.devices.ekso.dataport import DataPort
    from handctl.devices.ekso.device import Ekso
    from handctl.devices.ekso.log.export import Exported
    from handctl.devices.ekso.log.recording import Recording
    from handctl.devices.ekso.log.timeline import Hole

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


def add_log_commands(group: Group) -> None:
    """Add `log` and `export` to the family's group."""
    group.verb("log", "Files")(log)
    group.add_command(_own_format(group, "export", export))


# -- log ------------------------------------------------------------------------------------------------------------


class _Sample(NamedTuple):
    sent: float
    received: float
    words: tuple[int, ...]


def _sample(port: DataPort) -> _Sample:
    _, words = next(port.samples())
    return _Sample(port.sent_at, port.answered_at, words)


@click.argument("file", type=OutFile(beside=(".json",)))
@streaming(0.0)
@click.option("--raw", is_flag=True, help="Append the 27 words as they came.")
@click.option("--mark", metavar="TEXT", default="", help="Mark the first row.")
@click.option(
    "--silence",
    type=Seconds(),
    default=60.0,
    show_default=True,
    metavar="S",
    help="End after S seconds without a valid answer. A lost port is waited for as long.",
)
@click.option("--include-pilot-id", is_flag=True, help="Keep the wearer's number in the sidecar.")
@click.option("--force", is_flag=True, help="Overwrite FILE.")
def log(
    run: Run,
    file: str,
    duration: float | None,
    count: int | None,
    rate: float,
    raw: bool,
    mark: str,
    silence: float,
    include_pilot_id: bool,
    force: bool,
) -> Table:
    """Record GetData into FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.

    FILE may be a directory. On a terminal any letter or space sets a mark.
    """
    from handctl.devices.ekso.frames import Command as Request
    from handctl.devices.ekso.log import polling
    from handctl.devices.ekso.log import recording as files
    from handctl.devices.ekso.log.keys import Keys

    path = files.file_name(file)
    files.refuse_existing(path, force)
    ekso: Ekso = run.device()
    port = ekso.port
    read = partial(settings, port, include_pilot_id)
    before = read()
    about = {
        **_about(run, ekso),
        "asked": {"rate_hz": rate or None, "rows": count, "duration_s": duration},
        "settings_before": before,
    }
    recording = files.Recording(path, port.link, about, raw=raw, rate=rate, force=force)

    def feedback() -> tuple[int, ...]:
        return port.exchange(Request.GET_FEEDBACK).words  # once: the next row is worth more than a second try

    def reopen() -> bool:
        port.check_bound()
        again = run.hold is not None and run.hold.reopen()
        if again:
            port.reopened()
            if not port.link.name.startswith(OWN_NAMES):
                run.journal.info(
                    "by-path",
                    f"{port.link.name}: the port that came back was known by its path, which another device can get",
                    hint="next time give usb:VID:PID:SERIAL, or its name below /dev/serial/by-id",
                )
        return again

    def segment_began() -> None:
        with suppress(NoAnswer, ProtocolError):  # it has just started: the settings may come late
            recording.timeline.segments[-1].settings_changed = files.changed(before, read())

    try:
        with Keys(run.guide.interactive) as keys:
            run.guide.say(f"recording into {path}. {'a key sets a mark, ' if keys.heard else ''}Ctrl-C ends")
            failure = polling.record(
                recording,
                partial(_sample, port),
                port.link,
                polling.Limits(rate, count, duration, silence),
                mark=_first(mark, keys.pressed),
                on_segment=segment_began,
                guide=run.guide,
                feedback=feedback,
                reopen=reopen,
            )
        failure = _finish(run, port, recording, before, read, feedback, failure)
    finally:
        recording.close()
    _tell(run, recording)
    return Table(rows=[recording.as_row()], columns=SUMMARY, plain=("rows", "rate"), failure=failure)


def _about(run: Run, ekso: Ekso) -> dict[str, Any]:
    """What the sidecar says of tool and device."""
    link = ekso.port.link
    return {
        "tool": {"name": "handctl", "version": __version__},
        "command": run.command,
        "simulated": run.simulated,
        "link": {"port": link.name, "baud": link.baud, "length_mode": ekso.port.mode},
        "device_time": _device_time(ekso),
    }


def settings(port: DataPort, personal: bool) -> dict[str, Any]:
    """The settings as the sidecar has them."""
    from handctl.devices.ekso.log.recording import settings_row

    return settings_row(port.settings_raw(), personal=personal)


def _device_time(ekso: Ekso) -> dict[str, Any] | None:
    """The device's clock beside the host's own time of day; None when it does not tell."""
    from datetime import datetime

    with suppress(NoAnswer, ProtocolError, ValueError):
        date, time = ekso.now()
        device = datetime.fromisoformat(f"{date['value']}T{time['value']}")
        host = datetime.fromtimestamp(ekso.link.wall())  # noqa: DTZ006 - the device tells no zone
        return {"device": device.isoformat(), "host_local": host.isoformat(timespec="seconds"), "offset_s": round((device - host).total_seconds(), 1)}  # fmt: skip
    return None


def _first(text: str, pressed: Callable[[], str]) -> Callable[[], str]:
    """Marks: `text` for the first row, then the keys."""
    waiting = [text]
    return lambda: "; ".join(filter(None, [waiting.pop() if waiting else "", pressed()]))


def _finish(
    run: Run,
    port: DataPort,
    recording: Recording,
    before: dict[str, Any],
    read: Callable[[], dict[str, Any]],
    feedback: Callable[[], tuple[int, ...]],
    failure: HandctlError | None,
) -> HandctlError | None:
    """Read the settings and the feedback again, close the file, write the sidecar; returns what went wrong first."""
    from handctl.devices.ekso.log.recording import changed, in_words, undisturbed

    after = None
    if not isinstance(failure, LinkError):
        try:
            after = read()
        except (HandctlError, KeyboardInterrupt) as exc:
            run.journal.warn(
                "settings-unread", f"the settings after the log are not known: {str(exc) or 'interrupted'}"
            )
    if after is not None and recording.rows:
        try:
            recording.feedback.add(feedback(), recording.timeline.last, recording.rows)
        except (HandctlError, KeyboardInterrupt):
            recording.feedback.unanswered += 1
    differing = changed(before, after) if after is not None else None
    if differing and after is not None:
        shown = ", ".join(f"{name} {in_words(before[name])} -> {in_words(after[name])}" for name in differing)
        run.journal.warn("settings-changed", f"settings changed during the log: {shown}")
    with undisturbed():
        try:
            recording.close()
            recording.write_sidecar(
                complete=True,
                ended=failure.code if failure is not None else "limit",
                settings_after=after,
                settings_changed=differing,
                counters={**run.journal.counters.as_row(), **port.counts.as_dict()},
                answer_length_mode=port.answer_mode,
            )
        except OutputError as exc:
            return failure or exc
    return failure


def _tell(run: Run, recording: Recording) -> None:
    line = recording.timeline
    if line.gaps:
        lengths = [gap.length_ms / 1000 for gap in line.gaps]
        run.journal.warn("gap", f"{len(lengths)} gaps, {sum(lengths):.3f} s in all, the longest {max(lengths):.3f} s")
    for hole in line.holes:
        run.journal.warn("port-lost", _hole_text(hole))
    if line.reboots:
        run.journal.warn("rebooted", f"the device was restarted {line.reboots} times: see column segment")
    if recording.skipped:
        run.journal.info(
            "skipped",
            f"{recording.skipped} ticks of --rate have no request: the device or this machine was late, or the port was gone",
        )
    if recording.lost:
        run.journal.warn("lost", f"{recording.lost} requests had no valid answer: see the holes in column seq")
    if line.standstill:
        run.journal.warn(
            "boot-time-still",
            f"BootTime did not advance in {line.standstill} rows",
            hint="give a lower --rate: BootTime ticks every 2 ms. Or the device's clock stands still",
        )


def _hole_text(hole: Hole) -> str:
    if hole.row is None:
        return "After the last row the port was lost. No row was taken since"
    restarted = " The device restarted meanwhile." if hole.rebooted else ""
    seconds = (hole.length_ms or 0) / 1000
    return f"Before row {hole.row} the port was lost: {seconds:.3f} s have no rows. Segment {hole.segment} begins there.{restarted}"


# -- export ---------------------------------------------------------------------------------------------------------


class _ExportCommand(Command):
    """A command whose --format is the older name of --to, instead of the shared one."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        return [
            param
            for param in super().get_params(ctx)
            if not (isinstance(param, SharedOption) and "--format" in param.opts)
        ]


def _own_format(group: Group, name: str, body: Callable[..., Table]) -> click.Command:
    def call(*args: Any, **more: Any) -> Any:
        return body(click.get_current_context().obj, *args, **more)

    made: click.Command = click.command(name, cls=_ExportCommand, heading="Files", offline=True, family=group.family)(
        update_wrapper(call, body)
    )
    return made


@click.argument("log", metavar="LOG", type=InFile(beside=(".json",)))
@click.option(
    "--to",
    "--format",
    "kind",
    type=click.Choice(["mot", "csv"]),
    help="What to make: mot (OpenSim motion file) or csv (the log's columns). --format is the older name.",
)
@click.option("--si", is_flag=True, help="With csv: metres and radians instead of inches and degrees.")
@click.option(
    "--segment", type=click.IntRange(min=1), metavar="N", help="Only segment N. A motion file holds just one."
)
@click.option(
    "--knee-sign",
    type=click.Choice(["1", "-1"]),
    help="With mot: sign of knee flexion in your model (default 1, as in the device, gait2392 has -1).",
)
@click.option(
    "--rate",
    type=FiniteRange(min=0, min_open=True, max=1000),
    metavar="HZ",
    help="With mot: resample linearly, never across a gap.",
)
def export(
    run: Run, log: str, kind: str | None, si: bool, segment: int | None, knee_sign: str | None, rate: float | None
) -> Table:
    """Turn a log into an OpenSim motion file or a table in SI units. Needs no device.

    The output goes to stdout, or into FILE with -o.
    """
    from handctl.devices.ekso.log import export as exports
    from handctl.devices.ekso.log.file import LogFile

    as_rows = run.settings.format in ("json", "ndjson")
    kind = kind or ("csv" if run.settings.format == "csv" else None)
    _check_options(kind, si=si, knee_sign=knee_sign, rate=rate)
    if run.settings.output and os.path.realpath(run.settings.output) in map(os.path.realpath, (log, f"{log}.json")):
        raise UsageError("-o would overwrite the log itself", hint="give another name")
    source = LogFile(log)
    if kind == "csv":
        result = exports.table(source, segment=segment, si=si, as_rows=as_rows)
    else:
        sign = int(knee_sign or "1")
        if knee_sign is None:
            run.journal.warn(
                "knee-sign",
                "knee flexion is positive, as the device has it",
                hint="--knee-sign -1 for models like gait2392",
            )
        result = exports.motion(source, segment=segment, knee_sign=sign, rate=rate, tool=f"handctl {__version__}")
    if source.simulated:
        run.settings = run.settings._replace(port=None, fake=True)
        run.journal.info("simulated", f"{log}: a simulator was recorded, not a device")
    return _shown(run, result, as_rows)


def _check_options(kind: str | None, *, si: bool, knee_sign: str | None, rate: float | None) -> None:
    if kind is None:
        raise UsageError("which format?", hint="--to mot or --to csv")
    if kind == "csv" and (knee_sign is not None or rate is not None):
        raise UsageError("--knee-sign and --rate are for --to mot", hint="leave them out")
    if kind == "mot" and si:
        raise UsageError("--si is for --to csv", hint="a motion file is in degrees")


def _shown(run: Run, result: Exported, as_rows: bool) -> Table:
    for remark in result.remarks:
        run.journal.warn("log", remark)
    run.journal.info("exported", f"{result.length} rows, {result.seconds:.3f} s")
    if not as_rows:  # --format names the file here; what the environment says of tables means nothing
        run.settings = run.settings._replace(format="table")
    return Table(rows=result.rows if as_rows else [], text=lambda _: result.text)
