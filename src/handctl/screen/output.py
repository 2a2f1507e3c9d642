"""The output of a command: stdout, or a file that is replaced only when complete. Knows nothing about the content."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from types import TracebackType
from typing import IO, TYPE_CHECKING

from handctl import interrupts
from handctl.errors import HandctlError, OutputError
from handctl.files import appended, atomic_write, writing
from handctl.screen.sanitize import no_formula, utf8_stdout

if TYPE_CHECKING:
    from handctl.model.settings import Settings

PIECE = 1024
"""Characters that a pipe with room takes without waiting, at up to 4 bytes each."""
MOST = 1 << 16
"""Characters that are kept until they are handed over."""


class Sink:
    """Where data goes: stdout, or a file that appears whole when everything is written.

    `samples` of a stream have been taken to be written: all their rows, and no row of another one.
    """

    def __init__(self, settings: Settings) -> None:
        self._path = settings.output
        self._appends = settings.append and settings.format == "csv"
        self._atomic: contextlib.AbstractContextManager[IO[str]] | None = None
        self.file: IO[str] = sys.stdout
        self.color = settings.color
        self.guard: Callable[[str], str] = no_formula if settings.no_formulas else str
        self._utf8 = settings.format in ("json", "ndjson", "openmetrics")
        self.broken = False
        self.samples = 0
        self._kept: list[str] = []
        self._size = 0
        self._waits = -1

    @property
    def terminal(self) -> bool:
        """Whether it is a terminal."""
        return not self._path and self.file.isatty()

    def __enter__(self) -> Sink:
        if self._path:
            self._open(self._path)
        elif self._utf8:
            utf8_stdout()
        self._waits = interrupts.watch(self.file, result=True)
        return self

    def write(self, text: str) -> None:
        """Write data. A closed pipe makes everything after it silent; a full disk is an OutputError."""
        if self.broken:
            return
        self._kept.append(text)
        self._size += len(text)
        if self._size >= MOST:
            self.flush()

    def write_sample(self, text: str) -> None:
        """Write and count all rows of one sample, or none of them if an interrupt comes."""
        with interrupts.handing_over():
            self._kept.append(text)
            self._size += len(text)
            self.samples += 1
        self.flush()

    def write_whole(self, text: str) -> None:
        """Write a sample that replaces the previous one: the file contains nothing else."""
        if self._path and self._atomic is None:
            self._open(self._path)
        self.write_sample(text)
        if self._atomic is not None:
            self._close(None, None, None)

    def _open(self, path: str) -> None:
        self._atomic = appended(path) if self._appends else atomic_write(path)
        with writing(path):
            self.file = self._atomic.__enter__()

    def _close(self, kind: type[BaseException] | None, exc: BaseException | None, tb: TracebackType | None) -> None:
        """What was written appears, unless something went wrong."""
        atomic, self._atomic = self._atomic, None
        if atomic is not None:
            self.file = sys.stdout
            with writing(self._path):
                atomic.__exit__(kind, exc, tb)

    def flush(self) -> None:
        """Flush to the reader. If it sleeps, an interrupt is raised, and nothing is lost or written twice."""
        try:
            while (
                self._size and not self.broken
            ):  # all that is kept; to a pipe or a terminal piece by piece, as there is room
                if self._waits >= 0:
                    interrupts.has_room(self._waits, None)
                with interrupts.handing_over(self._waits):
                    text = "".join(self._kept)
                    size = len(text) if self._waits < 0 else 4 * PIECE if text.isascii() else PIECE
                    self._kept, self._size = [text[size:]], len(text) - min(size, len(text))
                    self.file.write(text[:size])
                    self.file.flush()
            self.file.flush()
        except BrokenPipeError:
            self.broken = True
        except OSError as exc:
            raise OutputError(f"{self._path or 'stdout'}: cannot be written: {exc.strerror or exc}") from exc

    def abandon(self) -> None:
        """Write nothing more, also not what is kept: the reader sleeps, and waiting for it would never end."""
        self.broken = True
        self._kept, self._size = [], 0
        if not self._path:
            with contextlib.suppress(OSError, ValueError), open(os.devnull, "wb") as nowhere:
                os.dup2(nowhere.fileno(), self.file.fileno())

    def __exit__(self, kind: type[BaseException] | None, exc: BaseException | None, tb: TracebackType | None) -> None:
        try:
            if kind is None or (issubclass(kind, HandctlError) and not issubclass(kind, OutputError)):
                self.flush()  # what was read before an error is shown
        finally:
            try:
                self._close(kind, exc, tb)
            finally:
                interrupts.forget(self._waits)
