"""What a named device may be: how a LINK is written, rows of a scan.

Opens nothing and sends nothing.
"""

from __future__ import annotations

import json
import os
from typing import Any

from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.frame.devicefile import stable_name
from handctl.frame.family import Family, load, refuse_missing, refuse_serial
from handctl.frame.run import Run
from handctl.link.base import SCHEMES


def check(run: Run, kind: str, given: dict[str, Any]) -> None:
    """Whether a device of this family can be at this LINK with these settings. Raises UsageError.

    A path that may name another adapter tomorrow gets a warning with the better name.
    """
    family: Family = load(kind, "cli").cli.family
    port = str(given["port"])
    refuse_missing(family, given)
    check_link(port, family)
    _ask_family(run, family, given)
    stable = stable_name(port)
    if stable:
        run.journal.warn("unstable-name", f"{port} may be another adapter after the next plugging", f"-p {stable}")


def check_link(link: str, family: Family) -> None:
    """The syntax of a LINK. Raises UsageError."""
    scheme, separator, rest = link.partition("://")
    refuse_serial(family, link)
    if link.startswith("usb:"):
        parts = link.split(":", 3)[1:]
        if len(parts) < 2 or not all(0 < len(part) <= 4 and _hex(part) for part in parts[:2]):
            raise UsageError(
                f"{link}: expected usb:VID:PID or usb:VID:PID:SERIAL, hexadecimal", hint="e.g. usb:0403:6001"
            )
    elif link.startswith("can:"):
        if "can" not in family.wires:
            raise UsageError(
                f"{link}: {family.kind} has no CAN wire", hint="give a serial port, usb:VID:PID or tcp://HOST:PORT"
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
        raise UsageError(
            f"{link}: {scheme}:// is not a known kind of link",
            hint=f"use tcp://, fake:// or a URL of pyserial: {', '.join(SCHEMES)}",
        )
    elif separator and not rest and scheme != "loop":
        raise UsageError(f"{link}: the address is missing", hint="write for example socket://192.168.1.20:4001")
    elif not separator and not link.startswith("replay:"):
        _check_path(link)


def _hex(text: str) -> bool:
    return all(char in "0123456789abcdefABCDEF" for char in text)


def _check_path(link: str) -> None:
    if not link:
        raise UsageError("the LINK is empty", hint="give a port, such as `-p /dev/ttyUSB0`")
    if not os.path.isabs(link) and not (link.upper().startswith("COM") and link[3:].isdecimal()):
        raise UsageError(
            f"{link}: not a full path, and no link that handctl knows",
            hint="write for example /dev/ttyUSB0, COM3, usb:0403:6001 or tcp://192.168.1.20:8000",
        )


def _ask_family(run: Run, family: Family, given: dict[str, Any]) -> None:
    """The family itself refuses an id that it does not have."""
    from handctl.link import NoFrames, NoLink, is_can

    settings = run.settings._replace(**given)
    family.open(NoFrames() if is_can(str(given["port"])) else NoLink(), settings, run.journal)


def from_scan(text: str, kind: str | None, given: dict[str, Any]) -> dict[str, Any]:
    """The one device that a scan's JSON tells of (and that fits `kind` and what is given): kind, port, id, baud.

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
            hint=f"choose one with FAMILY, -p LINK, --id or --baud. The scan found: {seen}" if seen else "scan again with `handctl scan --json`",
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
            content = [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError) as exc:
        raise UsageError(
            f"the scan is not JSON: {exc}", hint="make it with `handctl scan --json`", code="from-scan"
        ) from exc
    if isinstance(content, dict):
        content = content.get("rows", [content])
    if not isinstance(content, list):
        content = []
    return [row for row in content if isinstance(row, dict)]
