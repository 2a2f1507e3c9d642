"""`handctl ekso log FILE` and `handctl ekso export LOG`: recordings of GetData, and what other programs take of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import update_wrapper
from typing import TYPE_CHECKING, Any

import click

from handctl import __version__
from handctl.errors import UsageError
from handctl.frame.clikit import Command, Group, log_options
from handctl.frame.options import SharedOption
from handctl.frame.run import Run
from handctl.frame.types import FiniteRange, InFile, WholeRange
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.ekso.log.export import Exported
    from handctl.record.source import Source


def add_log_commands(group: Group) -> None:
    """Add `log` and `export` to the family's group."""
    group.verb("log", "Files")(log)
    group.add_command(_own_format(group, "export", export))


# -- log ------------------------------------------------------------------------------------------------------------


@log_options
@click.option("--raw", is_flag=True, help="Append the 27 raw words to each row.")
@click.option("--include-pilot-id", is_flag=True, help="Keep the wearer's number in the sidecar.")
def log(run: Run, file: str, raw: bool, include_pilot_id: bool, **wishes: Any) -> Table:
    """Record GetData to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.

    FILE can be a directory. On a terminal, press any letter or space to set a mark.
    """
    from handctl.frame import recorder

    def source(again: Callable[[], bool]) -> Source:
        from handctl.devices.ekso.log.source import EksoSource

        return EksoSource(run.device(), again, raw=raw, personal=include_pilot_id)

    return recorder.log(run, file, recorder.Wishes(**wishes), source)


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
    help="Output: mot (OpenSim motion file) or csv (the columns of the log). --format is the older name.",
)
@click.option("--si", is_flag=True, help="With csv: metres and radians instead of inches and degrees.")
@click.option("--segment", type=WholeRange(min=1), metavar="N", help="Only segment N. A motion file holds just one.")
@click.option(
    "--knee-sign",
    type=click.Choice(["1", "-1"]),
    help="With mot: sign of knee flexion in your model (default 1, as in the device; gait2392 needs -1).",
)
@click.option(
    "--rate",
    type=FiniteRange(min=0, min_open=True, max=1000),
    metavar="HZ",
    help="With mot: resample linearly, but never across a gap.",
)
def export(
    run: Run, log: str, kind: str | None, si: bool, segment: int | None, knee_sign: str | None, rate: float | None
) -> Table:
    """Turn a log into an OpenSim motion file or a table in SI units. Needs no device.

    The output goes to stdout, or to FILE with -o.
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
                "knee flexion is positive, as in the device",
                hint="use --knee-sign -1 for models like gait2392",
            )
        result = exports.motion(source, segment=segment, knee_sign=sign, rate=rate, tool=f"handctl {__version__}")
    if source.simulated:
        run.settings = run.settings._replace(port=None, fake=True)
        run.journal.info("simulated", f"{log}: this is a recording of a simulator, not of a device")
    return _shown(run, result, as_rows)


def _check_options(kind: str | None, *, si: bool, knee_sign: str | None, rate: float | None) -> None:
    if kind is None:
        raise UsageError("no format given", hint="use --to mot or --to csv")
    if kind == "csv" and (knee_sign is not None or rate is not None):
        raise UsageError("--knee-sign and --rate work only with --to mot", hint="leave them out")
    if kind == "mot" and si:
        raise UsageError("--si works only with --to csv", hint="leave it out: a motion file is in degrees")


def _shown(run: Run, result: Exported, as_rows: bool) -> Table:
    for remark in result.remarks:
        run.journal.warn("log", remark)
    run.journal.info("exported", f"{result.length} rows, {result.seconds:.3f} s")
    if not as_rows:  # --format names the file here; what the environment says of tables means nothing
        run.settings = run.settings._replace(format="table")
    return Table(rows=result.rows if as_rows else [], text=lambda _: result.text)
