"""What a command returns: rows with named columns, tables for people, messages and counters.

Knows no terminal, no device and no file; imports only the standard library. Rows are plain dicts of JSON values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from handctl.light import NamedTuple, field, light
from handctl.model.line_quality import LineQuality
from handctl.model.write_ledger import Ledger
from handctl.wording import honest, utc

if TYPE_CHECKING:
    from handctl.errors import HandctlError
    from handctl.model.param import Bound
    from handctl.model.stop_sequence import Stopped

SCHEMA = "handctl/1"

Row = dict[str, Any]
PARTS = ("finger", "motor", "element")
"""Keys of a row that say which part of its quantity it is, where it has no path."""


def name_of(row: Row) -> str:
    """What a row is of: its path, or its name with its part where `get` does not know it."""
    return str(row.get("path") or ".".join(str(row[key]) for key in ("name", *PARTS) if row.get(key)))


class Column(NamedTuple):
    """One column: `key` into the row, `title` for people, `unit` where all its values share one, alignment."""

    key: str
    title: str = ""
    right: bool = False
    unit: str = ""

    @property
    def heading(self) -> str:
        """Title for people, e.g. ``Rate [Hz]``."""
        title = self.title or self.key
        return f"{title} [{self.unit}]" if self.unit else title

    @property
    def csv_name(self) -> str:
        """Header for CSV with the unit in it, e.g. ``t_s``."""
        return f"{self.key}_{self.unit}" if self.unit else self.key


class Cell(NamedTuple):
    """A text for people with a meaning: `tone` is one of "", "good", "warn", "bad", "dim"."""

    text: str
    tone: str = ""


class Grid(NamedTuple):
    """One table for people: finished texts, no numbers. `notes` are printed below it."""

    headings: tuple[str, ...]
    lines: tuple[tuple[str | Cell, ...], ...]
    title: str = ""
    right: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()

    def with_texts(self, say: Callable[[str], str]) -> Grid:
        """The same, each of its texts as `say` has it."""

        def told(cell: str | Cell) -> str | Cell:
            return cell._replace(text=say(cell.text)) if isinstance(cell, Cell) else say(cell)

        return self._replace(
            headings=tuple(map(say, self.headings)),
            lines=tuple(tuple(map(told, line)) for line in self.lines),
            title=say(self.title),
            notes=tuple(map(say, self.notes)),
        )


class Sample(NamedTuple):
    """One moment of a stream: `t` in seconds since its start, the rows read then, and the time of day in seconds since 1970."""

    t: float
    rows: tuple[Row, ...]
    wall: float | None = None

    @property
    def time(self) -> str | None:
        """The time of day as results have it."""
        return None if self.wall is None else utc(self.wall, 3)

    def stamped(self, clock: bool) -> list[Row]:
        """The rows, each with `t`, and where the `clock` is asked for with the time of day."""
        stamp: Row = {"time": self.time, "t": round(self.t, 6)} if clock else {"t": round(self.t, 6)}
        return [{**stamp, **row} for row in self.rows]


@light()
class Table:
    """The result of a command.

    rows      the data, one dict per row; for a stream leave it empty and give `samples`
    columns   which keys of a row are shown, in which order (CSV, plain, and the human table without `view`)
    view      rows -> grids for people, where the plain list of rows is not what a person wants to read
    plain     the keys that `--format plain` prints, when not all columns
    text      rows -> finished text, where the device's own words are the result
    failure   what went wrong although there are rows: sets the exit code, the rows are shown all the same
    steer     takes values for the next sample of a stream that can be given some, by their names
    samples   a stream; `summary` is called when it ends and goes into the closing envelope
    ranges    documented (low, high) per quantity name, for the bars of the live view
    scales    ends of the bars of other quantities: ours, so that nothing is wrong outside them
    decimals  decimals of a quantity's values, for the live view
    bounds    what a person set for readings: the live view marks what passes it
    remedies  what bits and codes mean and what to do, the most urgent first, for the live view
    highest   path -> documented value from which on a reading is bad, for the live view
    flags     names of quantities that are bits: the live view shows their words, of all others the numbers
    wide      in CSV a stream is usually a row a sample
    live      a person at a terminal sees a live view of the stream; else its rows
    cards     device -> what makes its own table, where rows are of several devices: the live view draws each as a card
    pictures  rows -> grids that the live view draws in place of a line for each row; the first that fits the window
    extra     further keys of the JSON envelope, e.g. the raw blocks of a dump
    spool     lines in place of `rows` and `text`, where there may be more of them than memory holds: JSON of rows, else the text
    """

    rows: list[Row] = field(default_factory=list)
    columns: tuple[Column, ...] = ()
    title: str = ""
    view: Callable[[list[Row]], list[Grid]] | None = None
    plain: tuple[str, ...] = ()
    text: Callable[[list[Row]], str] | None = None
    failure: HandctlError | None = None
    steer: Callable[[Mapping[str, Any]], None] | None = None
    samples: Iterable[Sample] | None = None
    summary: Callable[[], dict[str, Any]] | None = None
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    scales: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    decimals: dict[str, int] = field(default_factory=dict)
    bounds: tuple[Bound, ...] = ()
    flags: frozenset[str] = frozenset()
    remedies: Mapping[str, Any] = field(default_factory=dict)
    highest: Mapping[str, float] = field(default_factory=dict)
    wide: bool = False
    live: bool = True
    cards: Mapping[str, Callable[[], Table]] = field(default_factory=dict)
    pictures: tuple[Callable[[list[Row]], list[Grid]], ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)
    spool: Callable[[], Iterable[str]] | None = None


class Message(NamedTuple):
    """A message next to the data. `level` is "info", "warning" or "error"."""

    level: str
    code: str
    text: str
    hint: str = ""

    def as_row(self) -> Row:
        """The message for the JSON envelope."""
        return {"level": self.level, "code": self.code, "text": self.text, "hint": self.hint}


class Finding(NamedTuple):
    """Something wrong: what was seen, the keys of its remedies, and a next step that fits better than the table's."""

    text: str
    keys: tuple[str, ...]
    step: str = ""


@light()
class Counters:
    """What passed on the wire: frames sent and received, repeated requests, frames rejected, bytes of no frame.

    `writes` counts the writing ones among those sent; what became of them stands in the ledger.
    `foreign_frames` counts the traffic of others on a CAN bus, None where there is no bus.
    `keys` has for each key of a device that tells them unasked how often it was bad, missing, or skipped: replaced by a
    newer value before it was shown. None for a device that is asked.
    """

    sent: int = 0
    received: int = 0
    retries: int = 0
    bad_frames: int = 0
    stray_bytes: int = 0
    writes: int = 0
    foreign_frames: int | None = None
    keys: dict[str, dict[str, int]] | None = None

    def as_row(self) -> dict[str, Any]:
        """The counters for the JSON envelope."""
        return {
            "sent": self.sent,
            "received": self.received,
            "retries": self.retries,
            "bad_frames": self.bad_frames,
            "stray_bytes": self.stray_bytes,
            **({} if self.foreign_frames is None else {"foreign_frames": self.foreign_frames}),
            **self.quality(),
            **({} if self.keys is None else {"keys": self.keys}),
        }

    def quality(self) -> dict[str, int]:
        """`bad`, `missing` and `skipped` of all keys together; {} for a device that is asked."""
        if self.keys is None:
            return {}
        return {word: sum(key[word] for key in self.keys.values()) for word in ("bad", "missing", "skipped")}


class Journal:
    """Collects messages, counters and writes of one command; devices write into it, the renderer reads it."""

    def __init__(
        self,
        on_message: Callable[[Message], None] | None = None,
        progress: Callable[[str], None] | None = None,
        line: LineQuality | None = None,
    ) -> None:
        """`progress` shows a line that the next one replaces, while something takes its time."""
        self.progress = progress or (lambda text: None)
        self.counters = Counters()
        self.line = line or LineQuality()
        self.ledger = Ledger()
        self.messages: list[Message] = []
        self.kept: Table | None = None
        self._blamed: tuple[HandctlError, int] | None = None
        self._moving: tuple[Callable[[], Stopped], int] | None = None
        self.on_message = on_message

    def keep(self, table: Table) -> None:
        """Keep what was read so far: it is shown when the command ends here. Of several the fullest stays."""
        if self.kept is None or len(table.rows) >= len(self.kept.rows):
            self.kept = table

    def moves(self, stop: Callable[[], Stopped]) -> None:
        """From now on, writes move the device and the movement goes on without this command. `stop` stops it and reports the result."""
        self._moving = stop, self._moving[1] if self._moving is not None else self.ledger.mark

    def still_moving(self) -> Callable[[], Stopped] | None:
        """How what was set going is stopped; None where nothing that moves was written."""
        stop, before = self._moving or (None, 0)
        return stop if self.ledger.mark > before else None

    def blame(self, error: HandctlError) -> HandctlError:
        """Keep why an exchange failed although something came: the next valid frame clears it. Returns the error."""
        if error.exit_code == 5:
            self._blamed = error, self.counters.received
        return error

    @property
    def blamed(self) -> HandctlError | None:
        """Bytes received instead of a reply since the last valid frame, None if there were none."""
        error, received = self._blamed or (None, 0)
        return error if received == self.counters.received else None

    def note(self, level: str, code: str, text: str, hint: str = "") -> None:
        """Record a message once; the same code and text again is dropped (streams repeat themselves)."""
        if self.ledger.began:
            text, hint = honest(text), honest(hint)
        message = Message(level, code, text, hint)
        if message in self.messages:
            return
        self.messages.append(message)
        if self.on_message is not None:
            self.on_message(message)

    def info(self, code: str, text: str, hint: str = "") -> None:
        """Record something worth knowing."""
        self.note("info", code, text, hint)

    def warn(self, code: str, text: str, hint: str = "") -> None:
        """Record something to be careful about."""
        self.note("warning", code, text, hint)


def hex_bytes(data: bytes) -> str:
    """Bytes as the field writes them: ``EB 90 01``."""
    return data.hex(" ").upper()
