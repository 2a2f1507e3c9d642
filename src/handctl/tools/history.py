"""`handctl history`: what was written to devices earlier, from the lines that `command.write_history` keeps. Opens no link."""

from __future__ import annotations

import os
import re
from collections import deque
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta, timezone
from typing import Any

import click

from handctl.command import write_history
from handctl.command.command_tree import Command
from handctl.command.config_file import read_config
from handctl.command.options import COMMAND_LINE, WholeRange
from handctl.command.run import Run
from handctl.errors import Hint, UsageError
from handctl.families import FAMILIES
from handctl.files import why_unwritable
from handctl.misspellings import near
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.model.write_ledger import CONFIRMED, IN_WORDS

MEANINGS = 3
"""Steps of one command that the table names."""
UNITS = {"s": "seconds", "min": "minutes", "h": "hours", "d": "days", "w": "weeks"}
SINCE = "write yesterday, today, 2h, 3d, or a date such as 2026-11-25 or 2026-11-25T14:30"
COLUMNS = (
    Column("time", "Time"), Column("name", "Name"), Column("kind", "Family"), Column("link", "Link"), Column("id", "Id"),
    Column("line", "Command"), Column("written", "Written"), Column("exit_code", "Exit code", right=True),
    Column("user", "User"), Column("within", "Within"),
)  # fmt: skip


def _since(ctx: click.Context, param: click.Parameter, value: str | None) -> datetime | None:
    """A moment of the past in local time. Raises BadParameter."""
    found = None if value is None else _moment(value.strip().lower(), datetime.now().astimezone())
    if value is not None and found is None:
        raise click.BadParameter(f"{value!r} is not a time: {SINCE}", ctx, param)
    return found


def _moment(text: str, now: datetime) -> datetime | None:
    """What the text names, None if it names no time."""
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0, tzinfo=None)
    days = {"today": 0, "yesterday": 1}.get(text)
    if days is not None:
        return (midnight - timedelta(days)).astimezone()  # days, not hours: clocks change
    try:
        if ago := re.fullmatch(r"(\d{1,6}) ?(s|min|h|d|w)", text):
            return now - timedelta(**{UNITS[ago[2]]: int(ago[1])})
        found = datetime.fromisoformat(text.upper().replace("Z", "+00:00"))
        return found if found.tzinfo is not None else found.astimezone()
    except (ValueError, OverflowError, OSError):
        return None


@click.command("history", cls=Command, offline=True)
@click.argument("which", required=False, metavar="[DEVICE]")
@click.option("--since", callback=_since, metavar="WHEN", help=f"Only from then on: {SINCE.removeprefix('write ')}.")
@click.option("--last", type=WholeRange(min=1), metavar="N", help="Only the last N commands.")
def cli(run: Run, which: str | None, since: datetime | None, last: int | None) -> Table:
    """Show what handctl wrote to devices earlier, and when. The newest is last.

    DEVICE: a family, a device name or a LINK; without it, all devices. Each row is one command run under this user account, by
    you, a script or a Python program; --json has every step with its bytes. Simulated devices are left out unless
    --history all was given.
    """
    typed = run.sources.get("device") == COMMAND_LINE
    fits = _chooser(which or (run.settings.device if typed else None))
    rows = deque((row for row in _rows(since) if fits(row)), last)
    if not rows:
        run.journal.info("none", *_nothing())
    return Table(rows=list(rows), columns=COLUMNS, view=_view, plain=("time", "line"))


def _chooser(device: str | None) -> Callable[[Row], bool]:
    """Which rows are of this device. Raises UsageError for a name that nothing has."""
    if device is None:
        return lambda row: True
    if device in FAMILIES:
        return lambda row: row["kind"] == device
    named = read_config(passed=[]).devices
    if (
        device not in named
        and re.fullmatch(r"[\w-]+", device)
        and not any(device == row["name"] for row in _rows(None))
    ):
        hint = near(device, [*FAMILIES, *named])
        raise UsageError(
            f"{device!r} is neither a family nor a named device, and the history has no such name",
            hint=f"did you mean {hint[0]}?" if hint else Hint("{} shows the names", "devices list"),
        )
    entry = named[device].entries.get("port") if device in named else None
    link = entry.value if entry is not None else device
    return lambda row: row["name"] == device or link in (row["link"], *row["others"])


def _rows(since: datetime | None) -> Iterator[Row]:
    """One row for each command."""
    for entry in write_history.entries():
        if since is not None and _time(entry["time"]) < since:
            continue
        more, options = {key: value for key, value in entry["device"].items() if key != "fake"}, entry.get("options")
        yield {
            **dict.fromkeys(("time", "name", "kind", "link", "id")), **more, "time": entry["time"], "line": entry["line"],
            "written": _written(entry["writes"], entry.get("steps")),
            **{key: entry.get(key) for key in ("command", "exit_code", "user", "within", "steps", "writes")}, "failure": entry.get("error"),
            "others": [other for other in entry.get("others") or () if isinstance(other, str)],
            "options": [f"{key}={value}" for key, value in options.items()] if isinstance(options, dict) else [],
        }  # fmt: skip


def _time(text: str) -> datetime:
    try:
        found = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        return datetime.fromtimestamp(0, timezone.utc)
    return found if found.tzinfo is not None else found.replace(tzinfo=timezone.utc)


def _written(writes: list[Any], steps: Any) -> str:
    """The steps in words: ``set force to 500; save (sent, unconfirmed)``."""
    said = [
        f"{write.get('meaning') or write.get('bytes')}"
        + ("" if write.get("state") == CONFIRMED else f" ({IN_WORDS.get(str(write.get('state')), 'unknown')})")
        for write in writes
        if isinstance(write, dict)
    ]
    left = (steps if isinstance(steps, int) else len(said)) - MEANINGS
    return "; ".join(said[:MEANINGS]) + (f"; and {left} more" if left > 0 else "")


def _nothing() -> tuple[str, str]:
    """Why there is nothing to show, and what to do."""
    where = write_history.folder()
    there = next(one for one in (where, *where.parents) if os.path.exists(one))  # what is not there yet is made
    why = why_unwritable(str(there / "x"))
    text = f"no write is recorded in {where}"
    return (f"{text}, and none can be: {why}", "make it writable") if why else (text, "")


def _view(rows: list[Row]) -> list[Grid]:
    """Local time, and only what is not the same in each."""
    lines = tuple(
        (
            _local(row["time"]),
            row["name"] or f"{row['kind']} {row['link']}",
            row["line"] + (f" (in {row['within']})" if row["within"] else ""),
            row["written"],
            Cell(str(row["exit_code"]), "bad" if row["exit_code"] else ""),
        )
        for row in rows
    )
    return [Grid(("Time", "Device", "Command", "Written", "Exit code"), lines, right=frozenset({4}))] if lines else []


def _local(text: str) -> str:
    try:
        return _time(text).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    except (OverflowError, OSError, ValueError):  # a year that this system's clock does not have
        return text
