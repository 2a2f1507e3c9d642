"""The audit log of everything that was sent to change an EksoNR: JSON lines, appended, on the disk before it goes out.

No log, no write. Knows files and nothing of the device.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from handctl.errors import OutputError
from handctl.files import state_path

TAIL = 65536
"""Bytes at the end of the log that are searched for the last write."""


def default_path() -> Path:
    """ekso-audit.jsonl in the user's state folder."""
    return state_path("ekso-audit.jsonl")


class AuditLog:
    """An append-only file; every entry is on the disk when `record` returns, and nothing is held open between entries.

    `always` stands in every entry: operator, user, port, tool version.
    """

    def __init__(self, path: Path, always: dict[str, Any]) -> None:
        self.path = path
        self._always = always

    def check(self) -> None:
        """Make sure that entries can be written, before anything is sent. Raises OutputError."""
        with self._opened() as file:
            _torn(file)  # a pipe cannot tell, and would refuse an entry too

    @contextmanager
    def _opened(self) -> Iterator[int]:
        """The file, made when there is none; its descriptor is closed at the end. Raises OutputError."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            fresh = not self.path.exists()
            file = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o600)
            try:
                if fresh:
                    _sync_folder(self.path.parent)
                yield file
            finally:
                os.close(file)
        except OSError as exc:
            raise OutputError(
                f"{self.path}: the audit log cannot be written: {exc.strerror or exc}",
                hint="without it no setting is written; --audit FILE names another place",
                code="audit",
            ) from exc

    def unfinished(self) -> dict[str, Any] | None:
        """The intent that the log ends with: a write whose result nobody noted. None when there is none."""
        if not self.path.is_file():  # reading a device or a pipe might never end
            return None
        try:
            with self.path.open("rb") as file:
                file.seek(max(0, os.fstat(file.fileno()).st_size - TAIL))
                lines = file.read(TAIL).split(b"\n")
        except OSError:
            return None  # no log, or none that can be read: `check` tells
        for line in reversed(lines):
            with suppress(ValueError):  # half a line of a killed writer: its frame never went out
                entry = json.loads(line)
                if isinstance(entry, dict) and entry.get("event") in ("intent", "result"):
                    return entry if entry["event"] == "intent" else None
        return None

    def record(self, event: str, host_s: float, **fields: Any) -> None:
        """Append one entry and wait until it is on the disk; `host_s` is the link's monotonic clock.

        Raises OutputError.
        """
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = {"event": event, "utc": now, "host_monotonic_s": round(host_s, 6), **self._always, **fields}
        line = json.dumps(entry, ensure_ascii=False).encode() + b"\n"
        with self._opened() as file:
            # half a line of a killed writer, perhaps of another handctl: this entry starts a line of its own
            _write_all(file, b"\n" + line if _torn(file) else line)
            os.fsync(file)


def _torn(file: int) -> bool:
    size = os.lseek(file, 0, os.SEEK_END)
    return size > 0 and os.pread(file, 1, size - 1) != b"\n"


def _write_all(file: int, data: bytes) -> None:
    while data:
        data = data[os.write(file, data) :]


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
