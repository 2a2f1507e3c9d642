"""Table -> what reaches stdout: rich or aligned table, plain, CSV, JSON envelope, NDJSON.

The only module that knows how results look; rich is imported only for a terminal. Data goes to the sink and nowhere
else. A stream is written row by row and closed by an envelope without rows.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Protocol

from handctl import interrupts
from handctl.errors import HandctlError, Interrupted, OutputError
from handctl.files import appended, atomic_write, in_json, writing
from handctl.model.result import Cell, Column, Grid, Journal, Row, Sample, Table
from handctl.screen.sanitize import no_formula, shown, text_of, text_shown, utf8_stdout, value_shown
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.model.command_settings import Settings
    from handctl.screen.csv_output import Wide

    class Asked(Protocol):
        """What the user said, and where."""

        @property
        def settings(self) -> Settings: ...
        @property
        def sources(self) -> Mapping[str, object]: ...

    class Context(Asked, Protocol):
        """What rendering needs to know of the running command."""

        @property
        def journal(self) -> Journal: ...
        @property
        def simulated(self) -> bool: ...
        @property
        def command(self) -> str: ...
        @property
        def streams(self) -> bool: ...
        def link_name(self) -> str: ...
        def viewed(self, pressed: Callable[[str], bool]) -> contextlib.AbstractContextManager[bool]: ...
        @property
        def stop_key(self) -> str: ...
        def with_cause_named(self, error: HandctlError | None) -> HandctlError | None: ...
        def envelope(self, failure: HandctlError | None, extra: dict[str, Any] | None = None) -> dict[str, Any]: ...
        def closing(self, failure: HandctlError | None, extra: dict[str, Any] | None = None) -> dict[str, Any]: ...


# -- where it goes: stdout, or a file that is replaced only when complete ---------------------------------------------

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
        """What was written to a file appears, unless something went wrong."""
        assert self._atomic is not None
        atomic, self._atomic = self._atomic, None
        self.file = sys.stdout
        with writing(self._path):
            atomic.__exit__(kind, exc, tb)

    def flush(self) -> None:
        """Flush to the reader. If it sleeps, an interrupt is raised, and nothing is lost or written twice."""
        try:
            # All that is kept; to a pipe or a terminal piece by piece, as there is room.
            while self._size and not self.broken:
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
                if self._atomic is not None:
                    self._close(kind, exc, tb)
            finally:
                interrupts.forget(self._waits)


# -- what is written there --------------------------------------------------------------------------------------------

UNKNOWN = (1, 2, 8, 130)
"""Exit codes that say nothing of the device: to a monitoring system nothing is written then."""
NOTED = ("failed", "late", "bad", "missing", "skipped")
"""Counts of a stream that a person is told when they are not 0."""


def speaks(how: str, failure: HandctlError | None) -> bool:
    """Whether this format has something to say where there is no table."""
    told = how == "openmetrics" and failure is not None and failure.exit_code not in UNKNOWN
    return told or how in ("json", "ndjson")


def show(table: Table | None, failure: HandctlError | None, sink: Sink, context: Context) -> None:
    """Write a finished result, or only what went wrong (JSON says that too)."""
    how = context.settings.format
    if how == "json" and context.streams:
        how = "ndjson"
    failure = failure or (table.failure if table is not None else None)
    rows = table.rows if table is not None else []
    moment: Row = {"time": context.envelope(failure)["time"]} if context.settings.time else {}
    rows = [{**moment, **row} for row in rows] if moment else rows
    extra = table.extra if table is not None else {}
    blocks = table.spool() if table is not None and table.spool is not None else (f"{dumps(row)}\n" for row in rows)
    if how == "json":
        for piece in _json_envelope(context.envelope(failure, extra), blocks):
            sink.write(piece)
    elif how == "ndjson":
        for block in blocks:
            sink.write(block)
        sink.write(dumps(context.closing(failure, extra)) + "\n")
    elif how == "openmetrics":
        from handctl.screen import openmetrics

        sink.write(openmetrics.exposition(rows, context, failure))
    elif table is None:
        return
    elif how == "csv":
        from handctl.screen.csv_output import Wide, csv_lines, is_wide

        rows, failed = [_row_shown(row) for row in rows], any("error" in row for row in rows)
        if is_wide(context, rows, by_default=False):
            sink.write(Wide(rows, moment).line(rows, sink.guard, moment))
        else:
            columns = [*map(Column, moment), *table.columns]
            failed = failed or (context.settings.append and _has_values(columns))
            sink.write(csv_lines(columns, rows, sink.guard, header=True, with_errors=failed))
    elif how == "plain":
        for row in rows:
            sink.write(_plain_line(table, _row_shown(row), tuple(moment)))
    elif table.spool is not None:
        for block in blocks:
            sink.write(text_shown(block))
    elif table.text is not None:
        sink.write(text_shown(table.text(rows)))
    else:
        _grids(table, sink, context)


def _has_values(columns: Sequence[Column]) -> bool:
    """Whether a row can have an error in place of its value."""
    return any(column.key == "value" for column in columns)


def is_seen(how: str, sink: Sink, context: Context) -> bool:
    """Whether a person sees a stream as a live view: on the terminal, also while its rows go to a file."""
    if sink.terminal:
        return how == "table"
    settings = context.settings
    return bool(settings.output) and not settings.quiet and sys.stdout.isatty()


def _stream(table: Table, samples: Generator[Sample, None, None], how: str, sink: Sink, context: Context) -> None:
    if table.live and is_seen(how, sink, context):
        from handctl.screen.live_view import View, watched
        from handctl.screen.top_cards import TopCards

        samples = watched((TopCards if table.cards else View)(table, context), samples, context)
        if sink.terminal:
            for _ in samples:
                sink.samples += 1
            return
    with contextlib.closing(samples):
        if how == "openmetrics":
            from handctl.screen import openmetrics

            openmetrics.stream(samples, sink, context)
        if how == "csv":
            samples = _wide_lines(table, samples, sink, context)
        _stream_lines(table, samples, how, sink, context.settings.time)


def is_sheet(path: str | None) -> bool:
    """Whether a file named so is for a program that takes tables."""
    return bool(path) and str(path).lower().endswith(".csv")


def stream_format(asked: Asked) -> str:
    """The format of a stream: what was said, else CSV in a file that is named so."""
    settings = asked.settings
    named = settings.format == "table" and is_sheet(settings.output)
    return "csv" if named and "format" not in asked.sources else settings.format


def stream(table: Table, sink: Sink, context: Context) -> HandctlError | None:
    """Write a stream as it comes; returns what ended it, None for its natural end. A closed pipe ends it quietly."""
    assert table.samples is not None
    how = stream_format(context)
    failure: HandctlError | None = None
    samples = _told(iter(table.samples), how)
    try:
        try:
            _stream(table, samples, how, sink, context)
        except HandctlError as exc:
            failure = exc
        interrupts.device_done()  # the device has been left: only its reader can hold up the rest
    except KeyboardInterrupt:
        failure = failure or table.failure or Interrupted()  # how the device was left counts more
    interrupts.finish_on_signals()
    if isinstance(failure, OutputError) and failure.code == "reader":
        sink.abandon()
    failure = table.failure = context.with_cause_named(failure or table.failure)  # stands, should its end find no room
    summary = table.summary() if table.summary is not None else {}
    if "stream" in summary:
        summary["stream"]["samples"] = sink.samples
    if how == "openmetrics" and speaks(how, failure):
        from handctl.screen import openmetrics

        sink.write_whole(openmetrics.exposition([], context, failure))
    if table.closing is not None and how == "table":
        sink.write("".join(text_shown(f"{line}\n") for line in table.closing()))
    if how in ("json", "ndjson"):
        sink.write(dumps(context.closing(failure, summary)) + "\n")
    elif (
        "stream" in summary and not context.settings.quiet and not sink.broken and not isinstance(failure, OutputError)
    ):
        sink.flush()
        with contextlib.suppress(OSError):
            drawn = how == "table" and sink.terminal and table.live  # the live view has the mark in its head
            mark = ", simulated" if context.simulated and not drawn else ""
            quality = context.journal.counters.quality()
            sys.stderr.write(f"handctl: note: {__summary_text({**summary['stream'], **quality})}{mark}\n")
    return failure


def _told(samples: Iterator[Sample], how: str) -> Generator[Sample, None, None]:
    """The samples, for people without what would steer a terminal; closed with them, so that a device is left."""
    try:
        for sample in samples:
            yield sample if how in ("json", "ndjson") else sample._replace(rows=tuple(map(_row_shown, sample.rows)))
    finally:
        close = getattr(samples, "close", None)
        if close is not None:
            close()


def __summary_text(stats: dict[str, Any]) -> str:
    text = f"{plural(stats['samples'], 'sample')} in {stats['seconds']:.1f} s"
    if stats["rate_hz"] is not None:
        text += f", true rate {stats['rate_hz']:g} Hz" + (f" of {stats['asked_hz']:g}" if stats["asked_hz"] else "")
    return text + "".join(f", {stats[key]} {key}" for key in NOTED if stats.get(key))


def _wide_lines(
    table: Table, samples: Generator[Sample, None, None], sink: Sink, context: Context
) -> Generator[Sample, None, None]:
    """Write samples as one line each if requested; the returned ones are left for `_stream_lines`."""
    from handctl.screen.csv_output import Wide, is_wide

    usual = table.wide or is_sheet(context.settings.output)
    sheet: Wide | None = None
    for sample in samples:
        if sheet is None:
            if not is_wide(context, sample.rows, by_default=usual):
                yield sample
                yield from samples
                return
            sheet = Wide(sample.rows, _moment(sample, context.settings.time))
        sink.write_sample(sheet.line(sample.rows, sink.guard, _moment(sample, context.settings.time)))
        for name in sheet.left_out:
            context.journal.warn("column", f"{name} is missing in the first sample, so it has no column", "use --long")
        if sink.broken:
            return


def _moment(sample: Sample, clock: bool) -> Row:
    """The first columns of a line that holds a whole sample."""
    return {**({"time": sample.time} if clock else {}), "t_s": round(sample.t, 6)}


def _stream_lines(table: Table, samples: Iterator[Sample], how: str, sink: Sink, clock: bool) -> None:
    columns = (*([Column("time")] if clock else []), Column("t", "Time", right=True, unit="s"), *table.columns)
    if how == "csv":
        from handctl.screen.csv_output import csv_lines
    widths = [max(len(column.heading), 9 if column.key == "t" else 6) for column in columns]
    for sample in samples:
        lines = [sample.text]
        for row in sample.stamped(clock):
            if how in ("json", "ndjson"):
                lines.append(dumps(row) + "\n")
            elif how == "plain":
                lines.append("\t".join(text_of(row.get(column.key)) for column in columns) + "\n")
            elif how == "csv":
                values = _has_values(columns)
                header = bool(columns and widths)
                lines.append(csv_lines(columns, [row], sink.guard, header=header, with_errors=values))
                widths = []
            elif table.line is not None:
                lines.append(text_shown(table.line(row)) + "\n")
            else:
                if widths:
                    widths = [
                        max(width, *(len(text_of(r.get(column.key))) for r in sample.rows))
                        for width, column in zip(widths, columns, strict=True)
                    ]
                    lines.append(_aligned_line([column.heading for column in columns], widths, columns))
                    fixed, widths = widths, []
                cells = [f"{row[c.key]:.3f}" if c.key == "t" else text_of(row.get(c.key)) for c in columns]
                lines.append(_aligned_line(cells, fixed, columns))
        sink.write_sample("".join(lines))
        if sink.broken:
            return


# -- data formats -------------------------------------------------------------------------------------------------


_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False)  # what rows hold is a tree


def dumps(value: Any) -> str:
    """JSON that is UTF-8 whatever it holds."""
    return in_json(_ENCODER.encode(value))


NUMBERS = (int, float, bool, type(None))
"""What nothing can hide in, as most that a row holds."""


def _row_shown(row: Row) -> Row:
    return {key: value if type(value) in NUMBERS else value_shown(value) for key, value in row.items()}


def _json_envelope(envelope: dict[str, Any], blocks: Iterable[str]) -> Iterator[str]:
    """One object; a key a line and a row a line, so that people and `grep` can read it too."""
    yield "{\n"
    for key, value in envelope.items():
        if key not in ("messages", "counters"):
            yield f"  {dumps(key)}: {dumps(value)},\n"
    yield '  "rows": ['
    before = "\n    "
    for block in blocks:  # the sink joins them: by size, as a row of one family is as long as a hundred of another
        yield before + block[:-1].replace("\n", ",\n    ")
        before = ",\n    "
    yield "],\n" if before == "\n    " else "\n  ],\n"
    yield f'  "messages": {dumps(envelope["messages"])},\n  "counters": {dumps(envelope["counters"])}\n}}\n'


def _plain_line(table: Table, row: Row, before: tuple[str, ...]) -> str:
    keys = before + (table.plain or tuple(column.key for column in table.columns))
    return "\t".join("" if key == "value" and "error" in row else text_of(row.get(key)) for key in keys) + "\n"


# -- tables for people --------------------------------------------------------------------------------------------


def default_view(table: Table) -> list[Grid]:
    """The rows as they are, one column per Column that holds anything."""
    columns = [c for c in table.columns if any(text_of(row.get(c.key)) for row in table.rows)] or list(table.columns)
    lines = tuple(
        tuple(
            Cell("?", "bad") if column.key == "value" and "error" in row else text_of(row.get(column.key))
            for column in columns
        )
        for row in table.rows
    )
    notes = tuple(f"{row.get('name', '')}: {row['error']}" for row in table.rows if row.get("error"))
    right = frozenset(position for position, column in enumerate(columns) if column.right)
    return [Grid(tuple(column.heading for column in columns), lines, table.title, right, notes)]


def _grids(table: Table, sink: Sink, context: Context) -> None:
    if not table.rows:
        return  # a heading over nothing tells less than the message beside it
    grids = table.view(table.rows) if table.view is not None else default_view(table)
    grids = [grid.with_texts(shown) for grid in grids]
    mark = "simulated" if context.simulated else ""
    if sink.terminal or sink.color == "always":
        from handctl.screen.terminal_tables import print_grids

        print_grids(grids, sink, mark)
        return
    for number, grid in enumerate(grids):
        if number:
            sink.write("\n")
        lines = [
            grid.headings,
            *([cell.text if isinstance(cell, Cell) else cell for cell in line] for line in grid.lines),
        ]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        columns = [Column("", right=position in grid.right) for position in range(len(widths))]
        if grid.title:
            sink.write(f"{grid.title}{f'  ({mark})' if mark else ''}\n")
        sink.write("".join(_aligned_line(line, widths, columns) for line in lines))
        sink.write("".join(f"{note}\n" for note in grid.notes))
    if mark and not any(grid.title for grid in grids):
        sink.write(f"({mark})\n")


def _aligned_line(texts: Sequence[str], widths: Sequence[int], columns: Sequence[Column]) -> str:
    """One line: two spaces between its cells, none behind the last."""
    cells = (
        text.rjust(width) if column.right else text.ljust(width)
        for text, width, column in zip(texts, widths, columns, strict=True)
    )
    return "  ".join(cells).rstrip() + "\n"
