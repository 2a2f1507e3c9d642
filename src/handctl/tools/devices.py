"""`handctl devices`: names for devices, kept in the configuration file; `handctl -d NAME FAMILY …` uses one.

Sends nothing to any device. Knows how a LINK is written, not what answers on it.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from handctl.errors import UsageError
from handctl.families import FAMILIES, WIRES
from handctl.files import read_text
from handctl.frame.clikit import Group
from handctl.frame.options import (
    COMMAND_LINE,
    Settings,
    Source,
    checks,
    config_path,
    own_options,
    read_config,
    said,
)
from handctl.frame.precedence import resolve
from handctl.frame.run import Run
from handctl.frame.types import InFile
from handctl.model.result import Column, Row, Table

if TYPE_CHECKING:
    from handctl.frame.config import Config, Device

cli = Group(
    "devices",
    help="Name devices in the configuration file. `handctl -d NAME FAMILY …` then knows the port, the id and the baud "
    "rate. To use another file, set HANDCTL_CONFIG.",
)

COLUMNS = (
    Column("name", "Name"),
    Column("family", "Family"),
    Column("link", "Link"),
    Column("id", "Id", right=True),
    Column("baud", "Baud", right=True),
    Column("timeout", "Timeout", right=True, unit="s"),
    Column("deadline", "Deadline", right=True, unit="s"),
    Column("retries", "Retries", right=True),
)


def row_of(device: Device) -> Row:
    """One named device with the keys that rows of `scan` have."""
    said = {key: entry.value for key, entry in device.entries.items()}
    keys = ("id", "baud", "timeout", "deadline", "retries")
    return {"name": device.name, "family": device.kind, "link": said["port"], **{key: said.get(key) for key in keys}}


@cli.verb("list", offline=True)
def list_devices(run: Run) -> Table:
    """List the named devices."""
    path = config_path()
    rows = [row_of(device) for device in read_config(path).devices.values()]
    if not rows:
        run.journal.info(
            "no-devices", f"{path} has no named devices", "name one with `handctl devices add NAME FAMILY -p LINK`"
        )
    return Table(rows=rows, columns=COLUMNS)


@cli.verb("add", writes=True)
@click.argument("name")
@click.argument("family", type=click.Choice(list(FAMILIES)), metavar=f"[{'|'.join(FAMILIES)}]", required=False)
@click.option(
    "--from-scan", "scanned", metavar="FILE", type=InFile(), help="Take family, link, id and baud rate from the output of `handctl scan --json` (-: stdin)."
)  # fmt: skip
@click.option("--force", is_flag=True, help="Replace the device that already has this name.")
def add(run: Run, name: str, family: str | None, scanned: str | None, force: bool) -> Table:
    """Give a device a name in the configuration file.

    Saves the family and, if given, --port, --id, --baud, --timeout, --deadline and --retries. Does not contact the device.
    """
    from handctl.frame import devicefile
    from handctl.frame.config import NAME_HELP, is_name
    from handctl.tools import naming

    if not is_name(name):
        raise UsageError(f"{name!r} cannot be the name of a device", hint=f"allowed: {NAME_HELP}")
    given = _given(run)
    if scanned is not None:
        found = naming.from_scan(_read(scanned), family, given)
        family, given = str(found.pop("kind")), {**found, **given}
    if family is None:
        raise UsageError("no family given", hint=f"add one of {', '.join(FAMILIES)}, or --from-scan FILE")
    if "port" not in given:
        raise UsageError(
            "no LINK given",
            hint=f"add its link: `handctl devices add {name} {family} -p LINK`",
            code="no-link",
        )
    naming.check(run, family, given)
    values = {"kind": family, **given}
    path = config_path()
    present = read_config(path)
    done = "replaced" if name in present.devices else "added"

    def edit(config: Config) -> str:
        _refuse_taken(config, name, force)
        return devicefile.put(config, name, values)

    if run.settings.dry_run:
        devicefile.verified(present, edit(present), checks(), values, name)
        run.journal.info("dry-run", "dry run: nothing was written")
    else:
        devicefile.change(path, checks(), edit, values, name)
        run.journal.info("next", f"{name!r} can be used now", f"try `handctl -d {name} {family} status`")
    keys = ("id", "baud", "timeout", "deadline", "retries")
    row = {"name": name, "family": family, "link": given["port"], **{key: given.get(key) for key in keys}}
    return Table(rows=[{**row, "file": path, "result": done}], columns=(*COLUMNS, *DONE), plain=("name",))


DONE = (Column("file", "File"), Column("result", "Result"))


@cli.verb("remove", writes=True, offline=True)
@click.argument("name")
def remove(run: Run, name: str) -> Table:
    """Delete a name from the configuration file. The rest of the file is unchanged."""
    from handctl.frame import devicefile

    path = config_path()
    config = read_config(path)
    device = config.find(name)
    default = config.values.get("device")
    if default is not None and default.value == name:
        raise UsageError(f"{path}, line {default.line}: {name!r} is the default device", hint="delete that line first")
    if run.settings.dry_run:
        devicefile.verified(config, devicefile.drop(config, name), checks(), {}, name)
        run.journal.info("dry-run", "dry run: nothing was written")
    else:
        devicefile.change(path, checks(), lambda now: devicefile.drop(now, name), {}, name)
    row = {**row_of(device), "file": path, "result": "removed"}
    return Table(rows=[row], columns=(*COLUMNS, *DONE), plain=("name",))


@cli.verb("show")
@click.argument("name", required=False)
def show(run: Run, name: str | None) -> Table:
    """Show every setting that `-d NAME` selects, and its source.

    Without NAME, show the settings of a command without -d. The source is the command line, the environment, the named
    device, the configuration file (with the line) or the default.
    """
    ctx = click.get_current_context()
    settings = resolve(ctx, WIRES, name or "")
    sources = said(ctx).sources
    own = {option.key: False if option.flag else None for option in own_options()}
    values = {key: getattr(settings, key) for key in Settings._fields if key != "own"}
    values |= {key: settings.own.get(key, own[key]) for key in sorted(own)}
    rows = [_setting(key, value, sources.get(key)) for key, value in values.items()]
    columns = (
        Column("name", "Setting"),
        Column("value", "Value"),
        Column("origin", "Origin"),
        Column("where", "Where"),
    )
    return Table(rows=rows, columns=columns)


def _setting(key: str, value: Any, source: Source | None) -> Row:
    return {
        "name": key,
        "value": value,
        "origin": source.level if source is not None else "default",
        "where": source.where if source is not None else "",
    }


def _given(run: Run) -> dict[str, Any]:
    """What the command line itself says about the device; what comes from elsewhere is not copied into it."""
    from handctl.frame.config import DEVICE_KEYS

    if run.sources.get("device") == COMMAND_LINE:
        raise UsageError("-d names an existing device, not the new one", hint="run the command without -d")
    said = {key: getattr(run.settings, key) for key in DEVICE_KEYS if run.sources.get(key) == COMMAND_LINE}
    if run.sources.get("fake") == COMMAND_LINE:
        raise UsageError(
            "--fake cannot be saved under a name", hint="give the simulator as a LINK, such as `-p fake://exo`"
        )
    return said


def _refuse_taken(config: Config, name: str, force: bool) -> None:
    if name in config.devices and not force:
        device = config.devices[name]
        raise UsageError(
            f"{name!r} is already used for {device.kind} on {device.entries['port'].value} "
            f"({config.path}, line {device.line})",
            hint="choose another name, or add --force to replace the device",
            code="name-taken",
        )


def _read(name: str) -> str:
    if name == "-":
        return sys.stdin.read(1_000_000)
    return read_text(name, "the output of a scan", 1_000_000)
