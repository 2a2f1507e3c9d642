"""The history of writes: a JSON line for each command that wrote to a device, in the user's state folder.

A line is made from the record of writes once the device has been served, and no command waits for it or fails because of it.
The newest files are kept: `history-7.jsonl` is begun when `history-6.jsonl` is full, so that two programs that find it full at
the same time begin the same next one, and no lock and no renaming is needed. Knows no device.
"""

from __future__ import annotations

import json
import os
import re
import stat
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from handctl.command.envelope import device_row
from handctl.families import HISTORY
from handctl.files import SPELLED, NoFile, in_turn, opened, state_path
from handctl.system import disk
from handctl.wording import utc

if TYPE_CHECKING:
    from pathlib import Path

    from handctl.command.settings_and_checks import Invocation
    from handctl.errors import HandctlError

DEVICES, ALL, OFF = HISTORY
MOST_BYTES = 1_000_000
"""A file of this size is full."""
KEPT = 4
"""Files, the one that is written among them."""
MOST_STEPS = 200
"""Steps of one command that are kept; `steps` counts all."""
MOST_TEXT = 400
"""Characters of one text."""
TURN_SECONDS = 0.05
"""No longer is another writer waited for, who may be suspended: where files are appended to in one piece, order is all that is lost."""
_NAME = re.compile(r"history-(\d{1,9})\.jsonl")


def keep(asked: Invocation, writes: list[dict[str, Any]], others: list[str], failure: HandctlError | None) -> None:
    """Add the line of a command that has ended with these `writes`, if they went to a device. Never raises.

    others   the further LINKs that it wrote to
    """
    # A full disk, a folder that may not be written: the command has done what it was asked to.
    with suppress(Exception):
        link, kept = asked.link, asked.settings.history
        simulated = link is not None and (link.fake or link.replayed)
        if writes and kept != OFF and (kept == ALL or not simulated):
            entry = {**_asked(asked), "others": others, **_result(writes, failure)}
            _append(json.dumps(entry, ensure_ascii=False).encode("utf-8", SPELLED))


def folder() -> Path:
    """Where the files are."""
    return state_path("history")


def files() -> list[Path]:
    """The files, the oldest first."""
    return [folder() / f"history-{number}.jsonl" for number in _numbers()]


def entries() -> Iterator[dict[str, Any]]:
    """What was kept, the oldest first; a line that is damaged is left out. Raises UsageError."""
    for path in files():
        with suppress(NoFile), opened(path, "a history") as file:  # another program has begun a new one meanwhile
            for line in iter(lambda: file.readline(4 * MOST_BYTES), b""):
                with suppress(ValueError, RecursionError):
                    entry = json.loads(line)
                    if _whole(entry):
                        yield entry


def _whole(entry: Any) -> bool:
    """Whether a line has what is read of one: another program may have written it."""
    if not isinstance(entry, dict) or not isinstance(device := entry.get("device"), dict):
        return False
    single = (
        *device.values(),
        *(entry.get(key) for key in ("command", "within", "user", "exit_code", "error", "steps")),
    )
    lists = (entry.get("writes"), entry.get("others") or [])
    return (
        all(isinstance(entry.get(key), str) for key in ("time", "line"))
        and all(one is None or isinstance(one, str | int) for one in single)
        and all(isinstance(one, list) for one in lists)
    )


# -- one line -------------------------------------------------------------------------------------------------------------


def _asked(asked: Invocation) -> dict[str, Any]:
    """Who asked for what, and the device."""
    user = next(filter(None, map(os.environ.get, ("SUDO_USER", "LOGNAME", "USER", "USERNAME"))), None)
    return {
        "time": utc(int(time.time())),
        "command": asked.command,
        "line": _cut(" ".join(map(_quoted, asked.said.words)) or asked.command),
        "within": asked.owner if asked.session is not None else None,
        "user": user,
        "device": {"name": asked.settings.device, **(device_row(asked) or {})},
        "options": {key: _cut(str(value)) for key, value in asked.settings.own.items() if value not in (None, False)},
    }


def _result(writes: list[dict[str, Any]], failure: HandctlError | None) -> dict[str, Any]:
    """What came of it."""
    return {
        "exit_code": failure.exit_code if failure is not None else 0,
        "error": _cut(failure.text) if failure is not None else None,
        "steps": len(writes),
        "writes": [{key: _cut(value) for key, value in row.items()} for row in writes[:MOST_STEPS]],
    }


def _cut(value: Any) -> Any:
    return f"{value[:MOST_TEXT]}…" if isinstance(value, str) and len(value) > MOST_TEXT else value


def _quoted(word: str) -> str:
    """A word as a shell would take it; plain ones stay as they are."""
    return word if re.fullmatch(r"[\w@%+=:,./*-]+", word) else "'" + word.replace("'", "'\"'\"'") + "'"


# -- the files ------------------------------------------------------------------------------------------------------------


def _numbers() -> list[int]:
    """The numbers of the files, the oldest first."""
    try:
        names = os.listdir(folder())
    except OSError:
        return []
    return sorted(int(found[1]) for name in names if (found := _NAME.fullmatch(name)))


def _append(line: bytes) -> None:
    """Add a line to the newest file, or to the next one if that is full; what is too old goes. Raises OSError."""
    where = folder()
    where.mkdir(mode=0o700, parents=True, exist_ok=True)
    numbers = _numbers()
    number = numbers[-1] if numbers else 1
    with suppress(FileNotFoundError):
        if os.stat(where / f"history-{number}.jsonl").st_size >= MOST_BYTES:
            number += 1
            for old in numbers[: max(0, len(numbers) + 1 - KEPT)]:
                with suppress(OSError):
                    os.unlink(where / f"history-{old}.jsonl")
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | disk.AT_ONCE | disk.BINARY
    file = os.open(where / f"history-{number}.jsonl", flags, 0o600)
    try:
        if not stat.S_ISREG(os.fstat(file).st_mode):
            return
        with in_turn(file, TURN_SECONDS):
            os.write(file, (b"\n" if disk.torn(file) else b"") + line + b"\n")
    finally:
        os.close(file)
