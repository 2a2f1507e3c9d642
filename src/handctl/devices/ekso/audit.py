"""The audit log of everything that was sent to change an EksoNR: JSON lines, appended, on the disk before it goes out.

No log, no write. The user's own log is always written, because the policy remembers by it; --audit names a further one.
Knows files and nothing of the device.
"""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from handctl.devices.ekso import gates
from handctl.devices.ekso.chain import Checked, check, held, linked
from handctl.errors import OutputError
from handctl.files import clash, in_turn, opened, state_path
from handctl.system import disk, locks

TURN_SECONDS = 0.2
"""No longer is another writer waited for, who may be stopped in the middle: CancelAction waits for its entry."""
TAIL = 65536
"""Bytes at the end of the log that are searched for the last write."""
FILE_HINT = "make it writable, or choose another file with --audit FILE. Without this log no setting is written"
OWN_HINT = "make it writable. handctl reads the last writes from this log, and writes no setting without it"


def default_path() -> Path:
    """ekso-audit.jsonl in the user's state folder."""
    return state_path("ekso-audit.jsonl")


def logs(file: str | Path | None, always: dict[str, Any]) -> AuditLog:
    """The log that a write is noted in: FILE, and whatever it is the user's own, which remembers for every port and FILE."""
    own = AuditLog(default_path(), always, own_hint=OWN_HINT)
    return own if file is None or clash(file, own.path) else AuditLog(Path(file), always, memory=own)


class AuditLog:
    """An append-only file; every entry is on the disk when `record` returns, and nothing is held open between entries.

    `always` stands in every entry: operator, user, host, port, the place it leads to, tool version.
    `memory` is a second log that gets every entry too.
    """

    def __init__(
        self, path: Path, always: dict[str, Any], *, memory: AuditLog | None = None, own_hint: str = FILE_HINT
    ) -> None:
        self.path = path
        self.always = always
        self.memory = memory
        self._hint = own_hint

    @property
    def every(self) -> tuple[AuditLog, ...]:
        """The logs that get each entry."""
        return (self,) if self.memory is None else (self.memory, self)

    def check(self) -> None:
        """Make sure that entries can be written, before anything is sent. Raises OutputError."""
        if self.memory is not None:
            self.memory.check()
        with self._opened() as file:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise OSError(errno.EINVAL, "not a regular file, so the policy cannot read the last writes from it")
            _torn(file)

    @contextmanager
    def _opened(self) -> Iterator[int]:
        """The file, made when there is none; its descriptor is closed at the end. Raises OutputError."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            fresh = not self.path.exists()
            file = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | disk.BINARY, 0o600)
            try:
                if fresh:
                    disk.sync_folder(self.path.parent)
                yield file
            finally:
                os.close(file)
        except OSError as exc:
            raise gates.refusal(
                gates.LOG,
                f"{self.path}: the audit log cannot be written: {exc.strerror or exc}",
                self._hint,
            ) from exc

    def unfinished(self) -> dict[str, Any] | None:
        """The intent that the log ends with: a write whose result nobody noted. None when there is none."""
        try:
            lines = self.tail()
        except OutputError:
            return None  # no log, or none that can be read: `check` tells
        for line in reversed(lines):
            with suppress(ValueError, RecursionError):  # half a line of a killed writer: its frame never went out
                entry = json.loads(line)
                if isinstance(entry, dict) and entry.get("event") in ("intent", "result"):
                    return entry if entry["event"] == "intent" else None
        return None

    def tail(self) -> list[bytes]:
        """The last lines, whole but perhaps the last; none where there is no log. Raises OutputError."""
        if not self.path.is_file():  # reading a device or a pipe might never end
            return []
        with self._opened() as file:
            return _tail(file)[0]

    def checked(self, *, whole: bool = False) -> Checked:
        """Its chain: of the last lines, or with `whole` of all of them. Raises OutputError, UsageError."""
        if whole:
            with opened(self.path, "an audit log") as content:
                return check(iter(lambda: content.readline(TAIL), b""))
        if not self.path.is_file():
            return check([])
        with self._opened() as file:
            lines, cut = _tail(file)
        return check(lines, whole=not cut)

    def changed_at(self) -> float:
        """When the file was changed last, by the wall clock. Raises OutputError."""
        with self._opened() as file:
            return os.fstat(file).st_mtime

    @contextmanager
    def alone(self) -> Iterator[None]:
        """While it lasts no other handctl writes a setting by these logs: what they say last holds until the next entry.

        Raises OutputError, LinkError (code "busy").
        """
        with self.memory.alone() if self.memory is not None else nullcontext(), self._opened() as file:
            try:
                locks.whole(file)
            except BlockingIOError as exc:
                raise gates.refusal(
                    gates.FREE,
                    f"{self.path}: another handctl is writing a setting",
                    "wait until it is done, then repeat the command. Nothing was sent.",
                ) from exc
            yield

    def record(self, event: str, host_s: float, **fields: Any) -> None:
        """Append one entry and wait until it is on the disk; `host_s` is the link's monotonic clock.

        Raises OutputError; what came of a write is noted in both logs as far as it can be.
        """
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        entry = {"event": event, "utc": now, "host_monotonic_s": round(host_s, 6), **self.always, **fields}
        text = json.dumps(entry, ensure_ascii=False).encode("utf-8", "backslashreplace")
        failure: OutputError | None = None
        for log in reversed(self.every):  # the memory last: what it holds was not refused by another log
            try:
                log._append(text)
            except OutputError as exc:
                failure = failure or exc
                if event == "intent":
                    break
        if failure is not None:
            raise failure

    def _append(self, text: bytes) -> None:
        with self._opened() as file:
            # one entry at a time, each chained to the one before; an entry is worth more than the order of two
            with in_turn(file, TURN_SECONDS):
                line = linked(text, held(reversed(_tail(file)[0]))) + b"\n"
                # half a line of a killed writer, perhaps of another handctl: this entry starts a line of its own
                _write_all(file, b"\n" + line if _torn(file) else line)
            disk.sync(file)


def _tail(file: int) -> tuple[list[bytes], bool]:
    """The last lines, and whether there are others before them."""
    size = os.fstat(file).st_size
    start = max(0, size - TAIL)
    lines = disk.read_at(file, size - start, start).split(b"\n")
    return (lines[1:], True) if start else (lines, False)


def _torn(file: int) -> bool:
    size = os.lseek(file, 0, os.SEEK_END)
    return size > 0 and disk.read_at(file, 1, size - 1) != b"\n"


def _write_all(file: int, data: bytes) -> None:
    while data:
        data = data[os.write(file, data) :]
