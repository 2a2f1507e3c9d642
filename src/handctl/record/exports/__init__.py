"""A recording as other programs take it, of any family: `formats` has a row for each format, and each writer is a module of its own here.

    blocks    the rows, each with the host's time by the fit; no writer holds them all
    survey    segments, clock fit, breaks, marks: after `blocks`, which finds them on its way. Asked before it, it costs a pass
              of its own; so does a log that was never closed, for its sidecar has no fit. A closed one has the fits that its
              recorder made, which is then that of rows, marks and ends alike; `log --check` compares it with the rows

A writer is `write(export)`; it raises OSError where the disk fails. What it needs of other packages is imported there alone.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from handctl import lazy_stdlib
from handctl.errors import UsageError
from handctl.files import as_text, writing
from handctl.model.export_formats import FORMATS
from handctl.record.clock_survey import ClockLine, Event, Survey, Surveyor, survey
from handctl.record.log_reader import Block, LogFile, a_number


@dataclass
class Export:
    """One recording on its way into another file. `segment` None = all of them; `rate` in Hz where the format takes one."""

    log: LogFile
    path: str
    tool: str
    segment: int | None = None
    rate: float | None = None
    rows: int = 0
    seconds: float = 0.0
    notes: list[str] = field(default_factory=list)
    """What was done to the rows."""
    remarks: list[str] = field(default_factory=list)
    """What is not whole, or does not fit into the format."""

    @cached_property
    def survey(self) -> Survey:
        """What one pass shows. Raises UsageError."""
        return survey(self.log)

    @property
    def segments(self) -> list[int]:
        """The numbers of those that are meant. Raises UsageError where there are none."""
        if self.segment not in (None, *self.survey.segments):
            raise self.log.without(self.segment)
        return list(self.survey.segments) if self.segment is None else [self.segment]

    @property
    def ends(self) -> tuple[float, float]:
        """The host's time of the first and the last row."""
        return self.survey.segments[self.segments[0]].ends[0], self.survey.segments[self.segments[-1]].ends[1]

    @property
    def events(self) -> list[Event]:
        """Those of the segments that are meant, in the order of time."""
        spans = [
            (one.first_row, one.first_row + one.rows) for one in map(self.survey.segments.get, self.segments) if one
        ]
        found = [one for one in self.survey.events if any(begin <= one.row < end for begin, end in spans)]
        return sorted(found, key=lambda one: one.utc_s)

    @property
    def nominal_hz(self) -> float | None:
        """The rate that was asked for if the log has it within 2 %, or else that of its rows; None where there is only one."""
        about = self.log.sidecar or {}
        reached = about.get("rate_hz") or self._reached_hz()
        asked = (about.get("asked") or {}).get("rate_hz")
        return asked if asked and reached and abs(reached - asked) <= 0.02 * asked else reached

    def _reached_hz(self) -> float | None:
        spent = sum(one.last.mono_s - one.first.mono_s for one in self.survey.segments.values())
        steps = self.survey.rows - len(self.survey.segments)
        return round(steps / spent, 2) if spent > 0 else None

    @property
    def even(self) -> bool:
        """Whether no row is missing between the first and the last, as a closed log says."""
        about = self.log.sidecar or {}
        if about.get("lost") or about.get("skipped") or not self.log.closed:
            return False
        if self.log.spans is not None and len(self.log.spans) == 1 and "gaps" in about:
            return not about["gaps"]
        return len(self.segments) == 1 and not self.survey.segments[self.segments[0]].gaps

    def blocks(
        self, say: Callable[[str, float], Any] = a_number, *, surveyed: bool = True
    ) -> Iterator[tuple[int, Block, Sequence[float]]]:
        """The rows: segment, rows of it, and the host's time of each by the clock fit, seconds since 1970.

        `say` as in `LogFile.blocks`; `surveyed`: the writer asks for the survey afterwards.
        """
        self.rows, lines = 0, dict[int, ClockLine]()
        first, fits = None, self._fits
        reading = Surveyor(self.log, fits)
        finding = surveyed and not self.surveyed
        if finding:
            self.survey = reading.found
        for whole in self.log.blocks(say):
            parts = {number: whole.of(number) for number in sorted(set(whole.segments))}
            if finding:
                reading.take(parts)
            for number, block in parts.items():
                if self.segment not in (None, number):
                    continue
                if number not in lines:
                    lines[number] = ClockLine.of(fits.get(number), block.floats("host_utc_s")[0], block.t_ms[0])
                utc = lines[number].all_utc(block.t_ms) if number in fits else block.floats("host_utc_s")
                self.rows += len(utc)
                first = utc[0] if first is None else first
                self.seconds = round(utc[-1] - first, 3)
                yield number, block, utc
        if not self.rows:
            raise self.log.without(self.segment)
        if finding:
            reading.end()

    @property
    def surveyed(self) -> bool:
        """Whether the survey is there already, or is being made."""
        return "survey" in self.__dict__

    @cached_property
    def _fits(self) -> Mapping[int, Mapping[str, float]]:
        """The clock fit by segment: from the sidecar, which spares a pass, or from the rows."""
        if not self.surveyed and (said := self.log.fits) is not None:
            return said
        return {number: one.line.as_fit() for number, one in self.survey.segments.items() if one.fit.count}

    def about(self) -> dict[str, Any]:
        """What the file says of its origin: the tool, and the log's own sidecar with the fit of each segment; without one, the fits."""
        if self.log.spans is not None:
            return {"tool": self.tool, "log": self.log.sidecar}
        fits = [self.survey.segments[number].as_export() for number in self.segments]
        return {"tool": self.tool, "log": self.log.sidecar, "segments": fits}


def write(export: Export, kind: str) -> None:
    """Write FILE. Raises UsageError and OutputError."""
    if library := FORMATS[kind].library:
        os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")  # its usual one keeps 13 MB for half a megabyte
        try:
            if library == "pyarrow" and lazy_stdlib.own_process:
                with suppress(ImportError), absent(("numpy",)):  # 11 MB; before version 18 it cannot do without
                    import_module(library)
            import_module(library)
        except ImportError as exc:
            raise UsageError(
                f"--to {kind} needs {library}, which is not installed",
                hint=f'install it with: pip install "handctl[{kind}]"',
                code="no-extra",
            ) from exc
    known = export.log.spans
    if known is not None and (not known or export.segment not in (None, *known)):  # at once, before hours are read
        raise export.log.without(export.segment)
    with writing(export.path):
        import_module(f"{__name__}.{kind}").write(export)
    export.remarks += export.log.remarks()


@contextmanager
def absent(names: Iterable[str], **instead: Any) -> Iterator[None]:
    """Modules that no import finds meanwhile, unless they are loaded already: what a library would load and use for nothing here.

    `instead` has what an import finds in place of others.
    """
    wanted: dict[str, Any] = {**dict.fromkeys(names), **instead}
    hidden = {name: wanted[name] for name in wanted if name not in sys.modules}
    sys.modules.update(hidden)
    try:
        yield
    finally:
        for name, module in hidden.items():
            if sys.modules.get(name, name) is module:
                del sys.modules[name]


def no_ssl() -> dict[str, Any]:
    """What takes the place of `ssl` where nobody else is in this process: pyarrow asks it for certificates as soon as it is loaded."""
    none = SimpleNamespace(cafile=None, capath=None)
    return {"ssl": SimpleNamespace(get_default_verify_paths=lambda: none)} if lazy_stdlib.own_process else {}


def name_of(export: Export) -> str:
    """The log's name, for a title."""
    return as_text(os.path.splitext(os.path.basename(export.log.path))[0]) or export.log.kind
