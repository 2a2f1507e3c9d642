"""The commands that every device with a parameter map has: status, dump, get, set, describe, watch, log, export, snapshot,
diff, restore, report.

Their meaning is in `verbs` and `stored`; here they become click commands of a family's group. A family that needs one of its own
leaves it out with `without` and defines it itself.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping
from functools import partial
from importlib import import_module
from typing import Any

import click

from handctl.command import get_set_watch
from handctl.command.command_tree import Group
from handctl.command.options import (
    ALWAYS,
    BOUNDS,
    LIMIT,
    REPLY_WAIT,
    SKIP,
    FiniteRange,
    InFile,
    OutFile,
    combined_options,
    ending,
    export_options,
    log_options,
    page_options,
    reads_option,
    scan_options,
    watch_options,
)
from handctl.command.run import PlannedAction, Run
from handctl.command.terminal_prompts import is_terminal
from handctl.families import COMMANDS
from handctl.model.param import COMMAND, ParamMap
from handctl.model.result import Table

NAMES = "[NAME]..."
PICTURE = "Draw the device, coloured by temperature, force or error."
SETPOINTS = click.option(
    "--setpoints",
    is_flag=True,
    help="Include set points: commanded positions and forces. Forces need a separate confirmation.",
)
"""Offered where a map has quantities whose writing commands something."""
IDS = click.option("--include-ids", is_flag=True, help="Include the serial number in `device` of the JSON.")
"""Offered where a device reports one."""


def add_map_verbs(
    group: Group,
    params: ParamMap[Any],
    *,
    part: str = "",
    example: str = "",
    setting: str = "",
    without: Collection[str] = (),
    set_asks: bool = False,
    typed_asks: bool = True,
    helps: Mapping[str, str] | None = None,
) -> None:
    """Add the verbs for `params`. `part` names an element for help ("FINGER"), `example` and `setting` show how.

    `set_asks`: what `set` writes is asked for first; `typed_asks`: so is what is typed and may write. `helps` has the help of `status`, `stop`, `diff` or `restore` where the usual one is not true of this family.
    """
    named = f"NAME[.{part}]" if part else "NAME"
    shown = f", such as `{example}`" if example else ""

    with_setpoints = (
        SETPOINTS
        if any(one.kind == COMMAND and one.writable and not one.optional for one in params)
        else combined_options()
    )
    with_ids = IDS if any(param.tells == "serial" for param in params) else combined_options()

    @click.option("--check", is_flag=True, help="Exit with code 7 if anything is unhealthy.")
    @click.option("--picture", "by", metavar="BY", is_flag=False, flag_value="", help=PICTURE)
    @LIMIT
    @with_ids
    def status(
        run: Run, check: bool, by: str | None = None, limits: tuple[str, ...] = (), include_ids: bool = False
    ) -> Table:
        """Show a health summary: the present values, with errors decoded."""
        run.said.include_ids = include_ids
        # A wrong name is told before the link is opened.
        seen = None if by is None else get_set_watch.picture(params.kind, by)
        bounds = get_set_watch.bounds_of(run, run.mapped(params), limits)
        table = get_set_watch.within(bounds, run.device().status(check))
        table.view = seen or table.view
        return table

    @LIMIT
    @with_ids
    def dump(run: Run, limits: tuple[str, ...] = (), include_ids: bool = False) -> Table:
        """Read every documented quantity."""
        run.said.include_ids = include_ids
        bounds = get_set_watch.bounds_of(run, run.mapped(params), limits)
        return get_set_watch.within(bounds, run.device().dump())

    get = partial(get_set_watch.get, params=params)
    click.argument("names", nargs=-1, required=True, metavar=f"{named}...")(LIMIT(get))
    get.__doc__ = f"Read quantities by name{shown}."

    @click.argument("assignments", nargs=-1, required=True, metavar=f"{named}=VALUE...")
    @ALWAYS
    def set_(run: Run, assignments: tuple[str, ...], always: bool = False) -> PlannedAction:
        return get_set_watch.set_values(run, run.mapped(params), assignments, always=always)

    set_.__doc__ = f"Write values by name and read them back.{f' Example: `{setting}`.' if setting else ''}"

    @click.argument("names", nargs=-1, metavar=NAMES)
    def describe(run: Run, names: tuple[str, ...]) -> Table:
        """List every quantity with address, type, range, access and manual section.

        Works without a device.
        """
        return get_set_watch.describe(run.mapped(params), names)

    @click.argument("names", nargs=-1, metavar=NAMES)
    @watch_options
    @BOUNDS
    def watch(
        run: Run,
        names: tuple[str, ...],
        rate: float,
        count: int | None,
        duration: float | None,
        limits: tuple[str, ...] = (),
        until: tuple[str, ...] = (),
    ) -> Table:
        """Show values as they change.

        A live view on a terminal (press ? for its keys), otherwise a stream of rows. Without names: everything that changes by itself.
        """
        from handctl.command.help_text import columns

        seen = run.settings.format == "table" and not run.settings.output and is_terminal(sys.stdout)
        seen = seen and columns() >= get_set_watch.BESIDE_COLUMNS
        bounds = get_set_watch.bounds_of(run, run.mapped(params), limits, until)
        table = get_set_watch.watch(
            run, run.mapped(params), names, rate=rate, count=count, duration=duration, seen=seen
        )
        return get_set_watch.within(bounds, table)

    @log_options
    @click.argument("names", nargs=-1, metavar=NAMES)
    def log(run: Run, file: str, names: tuple[str, ...], **wishes: Any) -> Table:
        """Record values to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.

        If FILE is a directory, handctl creates a new file in it. On a terminal, press any letter or the space bar to set a mark.
        Without names: everything that changes by itself.
        """
        from handctl.command import log_command

        return log_command.log(
            run,
            file,
            log_command.RequestedOptions(**wishes),
            run.mapped(params),
            lambda again: log_command.of_map(run, names, again, every=not wishes["rate"]),
        )

    @export_options
    def export(run: Run, log: str, kind: str | None, segment: int | None, rate: float | None) -> Table:
        """Turn a log into a file for pandas, BIDS, motion capture and other tools.

        Works without a device. -o names the file.
        """
        from handctl.command import export_command
        from handctl.record.log_reader import LogFile

        path = export_command.take_file(run)
        return export_command.export(run, path, LogFile(log, params.kind), kind, segment, rate)

    @click.argument("file", type=OutFile())
    def snapshot(run: Run, file: str) -> Table:
        """Save the settings of the device, and the set points that it keeps, to FILE.

        FILE also contains the device's identity, the handctl version, the time and a checksum. It replaces only another snapshot.
        By default, `diff` and `restore` use only the settings. Where they have --setpoints, it adds the set points.
        """
        from handctl.command import snapshots

        return snapshots.snapshot(run, file)

    @click.argument("a", required=False, type=InFile())
    @click.argument("b", required=False, type=InFile())
    @with_setpoints
    def diff(run: Run, a: str | None, b: str | None, setpoints: bool = False) -> Table:
        """Compare settings: two snapshots, a snapshot and the device, or two devices.

        Exit code 7 means that they differ. With -d LEFT,RIGHT and no file, it compares the two devices.
        """
        from handctl.command import snapshots

        return snapshots.diff(run, run.mapped(params), a, b, setpoints=setpoints)

    @click.argument("file", type=InFile())
    @with_setpoints
    @SKIP
    def restore(run: Run, file: str, setpoints: bool = False, skip: tuple[str, ...] = ()) -> PlannedAction:
        """Write the settings that differ from a snapshot, and read them back.

        Shows the plan first. If it is interrupted, you can safely run it again. A setting that this device does not have
        is refused before anything is written, unless --skip leaves it out.
        """
        from handctl.command import snapshots

        return snapshots.restore(run, run.mapped(params), file, setpoints=setpoints, skip=skip)

    @click.argument("file", type=OutFile(), metavar="FILE.html")
    @click.option(
        "--watch",
        type=FiniteRange(0, 600),
        default=3.0,
        show_default=True,
        metavar="S",
        help="Record curves for S seconds (0: none).",
    )
    @page_options
    def report(run: Run, file: str, watch: float, include_ids: bool, force: bool) -> Table:
        """Write one page for a service ticket: status, dump, findings, curves, bytes.

        Read-only.
        """
        from handctl import report as pages

        run.said.include_ids = include_ids
        return pages.report(run, run.mapped(params), file, pages.RequestedOptions(watch, include_ids, force))

    @reads_option
    def doctor(run: Run, count: int) -> Table:
        """Check this computer, the link and the device.

        Each row shows the evidence and a remedy. Read-only. If you do not know the family, use `handctl doctor -p LINK`. Exit code 7 means a warning or a failure.
        """
        from handctl.tools.doctor import checked

        return checked(run, params.kind, count)

    @ending("rows")
    @click.option(
        "--find-baud",
        is_flag=True,
        help="Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.",
    )
    def listen(run: Run, count: int | None, duration: float | None, find_baud: bool) -> Table:
        """Show what the device sends without a request, decoded. Sends nothing.

        You can start it before the device is switched on. Ctrl-C ends it, and a summary follows. --trace FILE keeps the bytes
        for `trace show` and -p replay:FILE. Exit code 4 means that not a single byte came.
        """
        from handctl.tools.listen import listen as heard

        return heard(run, count, duration, find_baud=find_baud)

    @click.argument("lines", nargs=-1, metavar="[LINE]...")
    @click.option("--hex", "as_hex", is_flag=True, help="Take lines as hexadecimal bytes, and show bytes as such.")
    @REPLY_WAIT
    def terminal(run: Run, lines: tuple[str, ...], as_hex: bool, wait: float) -> Table | PlannedAction:
        """Send typed lines, and show every byte that comes, in words.

        A line is hexadecimal bytes, on CAN a frame such as 1A3#DEADBEEF, and for a device that speaks text a line of text (there
        `hex` begins a line of bytes). Without LINE, the lines come from stdin. On a terminal, you type them. Otherwise they are a
        script: handctl checks every line before it sends the first. Ctrl-D ends the terminal and leaves the device as it is.
        Ctrl-C also stops the device if something was sent that may move it. --trace FILE keeps the bytes.
        """
        from handctl.tools.terminal import terminal as typed

        return typed(run, lines, wait, as_hex=as_hex)

    def stop(run: Run) -> Table:
        """Stop the device at once, even while another handctl command is using it.

        Never asks. Shows the bytes sent and the reply.
        """
        from handctl.stop import stop_command

        table = stop_command.stop_with_others(run)
        stop_command.tell_gone(run)
        return table

    @scan_options
    def scan(run: Run, ids: str | None, find_all: bool) -> Table:
        """Detect a device of this family, with its baud rate and id if it has them.

        Read-only. It tries the usual id at each baud rate first, then the other ids. On a silent line it ends after about
        6 s and lists what it skipped. With --all it tries everything, however long that takes.
        """
        found: Table = import_module(COMMANDS["scan"][0]).scan_family(run, ids, find_all)
        return found

    for usual in (status, stop, diff, restore):
        usual.__doc__ = (helps or {}).get(usual.__name__, usual.__doc__)
    verbs: tuple[tuple[str, str, Callable[..., Any], dict[str, Any]], ...] = (
        ("scan", "Service", scan, {}),
        ("listen", "Service", listen, {"streams": True}),
        ("terminal", "Service", terminal, {"writes": True, "asks": typed_asks}),
        ("stop", "Move", stop, {"writes": True, "stops": True}),
        ("status", "Inspect", status, {}),
        ("dump", "Inspect", dump, {}),
        ("get", "Inspect", get, {}),
        ("set", "Settings", set_, {"writes": True, "asks": set_asks}),
        ("describe", "Inspect", describe, {"offline": True}),
        ("watch", "Inspect", watch, {"streams": True}),
        ("log", "Files", log, {}),
        ("export", "Files", export, {"offline": True, "to_file": True}),
        ("snapshot", "Files", snapshot, {}),
        ("diff", "Files", diff, {"offline_when": lambda typed: typed.get("b") is not None}),
        ("restore", "Files", restore, {"writes": True, "asks": True}),
        ("report", "Service", report, {}),
        ("doctor", "Service", doctor, {}),
    )
    for name, heading, body, traits in verbs:
        if name not in without:
            group.verb(name, heading, **traits)(body)
