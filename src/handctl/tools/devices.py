"""`handctl devices`: names for devices, kept in the configuration file; `handctl -d NAME FAMILY …` uses one.

Sends nothing to any device. Knows how a LINK is written, not what answers on it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

import click

from handctl.command import config_edit
from handctl.command.command_tree import Group
from handctl.command.config_edit import stable_name
from handctl.command.config_file import DEVICE_KEYS, Config, Device, check_name, read_config
from handctl.command.family import Family
from handctl.command.options import COMMAND_LINE, InFile, Source, command_line, own_options, refuse_lacking
from handctl.command.run import Run
from handctl.command.settings_and_checks import refuse_serial, resolve
from handctl.errors import Hint, UsageError
from handctl.families import FAMILIES, WIRES
from handctl.files import BYTE_ORDER_MARK, read_text, text_lines
from handctl.link import NoFrames, NoLink, is_can
from handctl.link.link_interface import SCHEMES, options_in, unknown_scheme, usb_address
from handctl.model.command_settings import Settings
from handctl.model.result import Column, Row, Table
from handctl.tools.family_probe import family_of

MOST = 1_000_000
"""Characters of the output of a scan."""
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


KEYS = ("id", "baud", "timeout", "deadline", "retries")
DONE = (Column("file", "File"), Column("result", "Result"))


def row_of(name: str, family: str, said: Mapping[str, Any]) -> Row:
    """One named device with the keys that rows of `scan` have."""
    return {"name": name, "family": family, "link": said["port"], **{key: said.get(key) for key in KEYS}}


def device_row(device: Device) -> Row:
    """The same of one that is in the file."""
    return row_of(device.name, device.kind, {key: entry.value for key, entry in device.entries.items()})


@cli.verb("list", offline=True)
def list_devices(run: Run) -> Table:
    """List the named devices."""
    config = read_config()
    rows = [device_row(device) for device in config.devices.values()]
    if not rows:
        run.journal.info(
            "no-devices",
            f"{config.path} has no named devices",
            "name one with `handctl devices add NAME FAMILY -p LINK`",
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
    check_name(name)
    given = _given(run)
    if scanned is not None:
        text = (
            sys.stdin.read(MOST).removeprefix(BYTE_ORDER_MARK)
            if scanned == "-"
            else read_text(scanned, "the output of a scan", MOST)
        )
        found = from_scan(text, family, given)
        family, given = str(found.pop("kind")), {**found, **given}
    if family is None:
        raise UsageError("no family given", hint=f"add one of {', '.join(FAMILIES)}, or --from-scan FILE")
    if "port" not in given:
        raise UsageError(
            "no LINK given", hint=f"add its link: `handctl devices add {name} {family} -p LINK`", code="no-link"
        )
    check(run, family, given)
    values = {"kind": family, **given}
    present = read_config()
    done = "replaced" if name in present.devices else "added"

    def edit(config: Config) -> str:
        _refuse_taken(config, name, force)
        return config_edit.put(config, name, values)

    changed = _changed(
        run, present, edit, values, {**row_of(name, family, given), "file": present.path, "result": done}
    )
    if not run.settings.dry_run:
        run.journal.info("next", f"{name!r} can be used now", Hint("try {}", f"-d {name} {family} status"))
    return changed


def _changed(run: Run, config: Config, edit: Callable[[Config], str], values: dict[str, Any], row: Row) -> Table:
    """The file edited, or with --dry-run only looked at; `values` are those of the device afterwards."""
    if run.settings.dry_run:
        config_edit.verified(config, edit(config), values, row["name"])
        run.journal.info("dry-run", "dry run: nothing was written")
    else:
        config_edit.change(row["file"], edit, values, row["name"])
    return Table(rows=[row], columns=(*COLUMNS, *DONE), plain=("name",))


@cli.verb("remove", writes=True, offline=True)
@click.argument("name")
def remove(run: Run, name: str) -> Table:
    """Delete a name from the configuration file. The rest of the file is unchanged."""
    config = read_config()
    device = config.find(name)
    default = config.values.get("device")
    if default is not None and default.value == name:
        raise UsageError(
            f"{config.path}, line {default.line}: {name!r} is the default device", hint="delete that line first"
        )
    row = {**device_row(device), "file": config.path, "result": "removed"}
    return _changed(run, config, lambda now: config_edit.drop(now, name), {}, row)


@cli.verb("show")
@click.argument("name", required=False)
def show(run: Run, name: str | None) -> Table:
    """Show every setting that `-d NAME` selects, and its source.

    Without NAME, show the settings of a command without -d. The source is the command line, the environment, the named
    device, the configuration file (with the line) or the default.
    """
    settings = resolve(run.context, WIRES, name or "")
    sources = command_line(run.context).sources
    own = {option.key: False if option.flag else None for option in own_options()}
    values = {key: getattr(settings, key) for key in Settings._fields if key != "own"}
    values |= {key: settings.own.get(key, own[key]) for key in sorted(own)}
    unsaid = Source("default", "")
    rows: list[Row] = []
    for key, value in values.items():
        source = sources.get(key, unsaid)
        rows.append({"name": key, "value": value, "origin": source.level, "where": source.where})
    columns = (
        Column("name", "Setting"),
        Column("value", "Value"),
        Column("origin", "Origin"),
        Column("where", "Where"),
    )
    return Table(rows=rows, columns=columns)


def _given(run: Run) -> dict[str, Any]:
    """What the command line itself says about the device; what comes from elsewhere is not copied into it."""
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


# -- what a named device may be: how a LINK is written, rows of a scan -------------------------------------------------


def check(run: Run, kind: str, given: dict[str, Any]) -> None:
    """Whether a device of this family can be at this LINK with these settings. Raises UsageError.

    A path that may name another adapter tomorrow gets a warning with the better name.
    """
    family, port = family_of(kind), str(given["port"])
    refuse_lacking(family, given)
    check_link(port, family)
    # the family itself refuses an id that it does not have
    family.open(NoFrames() if is_can(port) else NoLink(), run.settings._replace(**given), run.journal)
    stable = stable_name(port)
    if stable:
        run.journal.warn(
            "unstable-name", f"{port} may be a different adapter the next time one is plugged in", f"use -p {stable}"
        )


def check_link(link: str, family: Family) -> None:
    """The syntax of a LINK. Raises UsageError."""
    scheme, separator, rest = link.partition("://")
    refuse_serial(family, link)
    if link.startswith("usb:"):
        usb_address(link)
    elif link.startswith("can:"):
        if "can" not in family.wires:
            raise UsageError(
                f"{link}: {family.kind} has no CAN interface", hint="give a serial port, usb:VID:PID or tcp://HOST:PORT"
            )
        from handctl.link.can import split_link

        split_link(link)
    elif scheme == "tcp" and separator:
        from handctl.link.tcp import split_address

        split_address(link, family.tcp_port)
    elif scheme == "fake" and separator:
        from handctl.link.fake import split_url

        simulated, _ = split_url(link)
        if simulated != family.kind:
            raise UsageError(
                f"{link}: that is a simulated {simulated or 'nothing'}, not {family.kind}",
                hint=f"give fake://{family.kind}",
            )
    elif separator and scheme not in SCHEMES:
        raise unknown_scheme(link, scheme)
    elif separator and not rest and scheme != "loop":
        raise UsageError(f"{link}: the address is missing", hint="write for example socket://192.168.1.20:4001")
    elif separator and scheme != "hwgrep":  # a regular expression may have a question mark
        options_in(link, flags=True)
    elif not separator and not link.startswith("replay:"):
        _check_path(link)


def _check_path(link: str) -> None:
    if not link:
        raise UsageError("the LINK is empty", hint="give a port, such as `-p /dev/ttyUSB0`")
    if not os.path.isabs(link) and not (link.upper().startswith("COM") and link[3:].isdecimal()):
        raise UsageError(
            f"{link}: not a full path, and no link that handctl knows",
            hint="write for example /dev/ttyUSB0, COM3, usb:0403:6001 or tcp://192.168.1.20:8000",
        )


def from_scan(text: str, kind: str | None, given: dict[str, Any]) -> dict[str, Any]:
    """The only device in a scan's JSON that matches `kind` and the given settings: kind, port, id, baud.

    Takes the envelope, a list of rows, or one row a line. Raises UsageError when none fits, or several do.
    """
    rows = [row for row in _rows(text) if row.get("link") and "error" not in row]
    asked = {"family": kind, "link": given.get("port"), "id": given.get("id"), "baud": given.get("baud")}
    fits = [row for row in rows if all(value in (None, row.get(key)) for key, value in asked.items())]
    if len(fits) != 1:
        seen = "; ".join(
            " ".join(f"{key} {row[key]}" for key in asked if row.get(key) is not None) for row in fits or rows
        )
        raise UsageError(
            f"{len(fits)} devices of the scan fit" if fits else "no device of the scan fits",
            hint=f"choose one with FAMILY, -p LINK, --id or --baud. The scan found: {seen}" if seen else Hint("scan again with {}", "scan --json"),
            code="from-scan",
        )  # fmt: skip
    (row,) = fits
    types = {"family": str, "link": str, "id": int, "baud": int}
    bad = [key for key, kind_of in types.items() if row.get(key) is not None and type(row[key]) is not kind_of]
    if bad or row.get("family") not in FAMILIES:
        key = bad[0] if bad else "family"
        raise UsageError(
            f"the scan has {key} = {row.get(key)!r}, which cannot be used",
            hint="give the values as options",
            code="from-scan",
        )
    found = {"kind": row["family"], "port": row["link"], "id": row.get("id"), "baud": row.get("baud")}
    return {key: value for key, value in found.items() if value is not None}


def _rows(text: str) -> list[dict[str, Any]]:
    try:
        try:
            content = json.loads(text)
        except ValueError:
            content = [json.loads(line) for line in text_lines(text) if line.strip()]
    except (ValueError, RecursionError) as exc:
        raise UsageError(
            f"the scan is not JSON: {exc}", hint=Hint("make it with {}", "scan --json"), code="from-scan"
        ) from exc
    if isinstance(content, dict):
        content = content.get("rows", [content])
    if not isinstance(content, list):
        content = []
    return [row for row in content if isinstance(row, dict)]
