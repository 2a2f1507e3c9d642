"""Where the lines of a tap go: the file of `--trace`, and stderr for `-v`."""

from __future__ import annotations

import contextlib
import sys

from handctl.errors import OutputError, UsageError
from handctl.files import at_once


class TraceFile:
    """A transcript that is being written. `failure` says why it ends early; what is on the line goes on all the same."""

    def __init__(self, path: str | None, header: str, verbose: bool) -> None:
        """Begin with a line of comment. Raises UsageError, OutputError: nothing has been sent yet, better not to begin."""
        self.failure: OutputError | None = None
        self._path = path
        self._verbose = verbose
        self._file = None
        if path:
            try:
                self._file = open(path, "w", encoding="utf-8", buffering=1, opener=at_once)  # noqa: SIM115 - until close
            except OSError as exc:
                raise UsageError(f"{path}: the trace cannot be written: {exc.strerror or exc}") from exc
            try:
                self._file.write(f"# {header}\n")
            except OSError as exc:
                raise self._failed(exc) from exc

    def write(self, line: str) -> None:
        """One line. Never raises: what stops a device passes here too; the failure ends up in the exit code."""
        if self._file is not None and self.failure is None:
            try:
                self._file.write(line)
            except (OSError, ValueError) as exc:
                self.failure = self._failed(exc)
        if self._verbose:
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.write(line)

    def close(self) -> None:
        """The end of the file. Never raises."""
        if self._file is not None:
            try:
                self._file.close()
            except OSError as exc:
                self.failure = self.failure or self._failed(exc)

    def _failed(self, exc: Exception) -> OutputError:
        return OutputError(
            f"{self._path}: the trace cannot be written: {getattr(exc, 'strerror', None) or exc}",
            hint="the device was served all the same; what is recorded ends there",
        )
