"""The audit log of everything that was sent to change an EksoNR: JSON lines, appended, on the disk before it goes out.

No log, no write. Knows files and nothing of the device.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
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
    """An append-only file; every entry is on the disk when `record` returns.

    `always` stands in every entry: operator, user, port, tool version.
    """

    def __init__(self, path: Path, always: dict[str, Any]) -> None:
        self.path = path
        self._always = always
        self._file: int | None = None

    def open(self) -> None:
        """Make sure that entries can be written, before anything is sent. Raises OutputError."""
        if self._file is not None:
            return
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            fresh = not self.path.exists()
            self._file = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o600)
            if fresh:
                _sync_folder(self.path.parent)
            elif _torn(self._file):  # a killed writer left half a line: the next entry starts a line of its own
                _write_all(self._file, b"\n")
        except OSError as exc:
            raise self._lost(exc) from exc

    def unfinished(self) -> dict[str, Any] | None:
        """The intent that the log ends with: a write whose result nobody noted. None when there is none."""
        if not self.path.is_file():  # reading a device or a pipe might never end
            return None
        try:
            with self.path.open("rb") as file:
                file.seek(max(0, os.fstat(file.fileno()).st_size - TAIL))
                lines = file.read(TAIL).split(b"\n")
        except OSError:
            return None  # no log, or none that can be read: `open` tells
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
        self.open()
        assert self._file is not None
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = {"event": event, "utc": now, "host_monotonic_s": round(host_s, 6), **self._always, **fields}
        try:
            _write_all(self._file, json.dumps(entry, ensure_ascii=False).encode() + b"\n")
            os.fsync(self._file)
        except OSError as exc:
            raise self._lost(exc) from exc

    def close(self) -> None:
        """Release the file. May be called twice."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _lost(self, exc: OSError) -> OutputError:
        return OutputError(
            f"{self.path}: the audit log cannot be written: {exc.strerror or exc}",
            hint="without it no setting is written; --audit FILE names another place",
            code="audit",
        )


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
