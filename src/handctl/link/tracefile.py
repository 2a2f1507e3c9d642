"""Where the lines of a tap go: the file of `--trace`, and stderr for `-v`."""

from __future__ import annotations

import contextlib
import sys

from handctl import ending
from handctl.errors import OutputError
from handctl.files import at_once

READER_SECONDS = 0.3
"""How long a line waits for who reads along. No longer: a motor may turn meanwhile."""


class TraceFile:
    """A transcript that is being written. `failure` says why it ends early; what is on the line goes on all the same."""

    def __init__(self, path: str | None, header: str, verbose: bool) -> None:
        """Begin with a line of comment. Raises OutputError: nothing has been sent yet."""
        self.failure: OutputError | None = None
        self._path = path
        self._verbose = verbose
        self._stderr = ending.waits(sys.stderr)
        self._file = None
        self._waits = -1
        if path:
            try:
                self._file = open(  # noqa: SIM115 - until close
                    path, "w", encoding="utf-8", newline="\n", buffering=1, opener=at_once
                )
            except OSError as exc:
                raise OutputError(
                    f"{path}: the trace cannot be written: {exc.strerror or exc}",
                    hint="give --trace another file. Nothing was sent.",
                ) from exc
            self._waits = ending.watch(self._file, result=False)
            try:
                self._file.write(f"# {header}\n")
            except OSError as exc:
                raise self._failed(exc) from exc

    def write(self, line: str) -> None:
        """One line. Never raises: what stops a device passes here too; the failure ends up in the exit code."""
        patience = 0.0 if ending.asked() else READER_SECONDS  # a stop waits for nobody
        if self._file is not None and self.failure is None:
            try:
                if not ending.has_room(self._waits, patience):
                    ending.make_room(self._waits)
                    raise TimeoutError("its reader does not accept data")
                self._file.write(line)
            except (OSError, ValueError) as exc:
                self.failure = self._failed(exc)
        self._verbose = self._verbose and ending.has_room(self._stderr, patience)
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
            ending.forget(self._waits)

    def _failed(self, exc: Exception) -> OutputError:
        return OutputError(
            f"{self._path}: the trace cannot be written: {getattr(exc, 'strerror', None) or exc}",
            hint="make room or give --trace another file. The command continued, but the recording ends there",
        )
