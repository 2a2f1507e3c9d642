"""What a command returns: rows with named columns, tables for people, messages and counters.

Knows no terminal, no device and no file; imports only the standard library. Rows are plain dicts of JSON values.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from handctl.errors import command_of
from handctl.fast_classes import NamedTuple, fast_dataclass, field
from handctl.model.write_ledger import Ledger
from handctl.wording import honest, utc

if TYPE_CHECKING:
    from handctl.errors import HandctlError
    from handctl.model.reading_limits import Bound
    from handctl.model.stop_sequence import Stopped


# -- what was measured of a line: round trip, echo, half duplex, traffic of others ------------------------------------

SLOW = 0.045
"""Seconds: no cable with an adapter takes so long for a short question; Bluetooth and networks do."""
LEAST = 8
"""Bytes: smaller pieces are those of a line as the computer happens to read it."""


class LineQuality:
    """Facts of one line, each None until it was measured.

    trips          seconds from a short question to its answer, bytes included
    speed_matters  whether the device is only reached at its own speed; not over Bluetooth, USB CDC or a network
    half_duplex    whether an answer is lost while something is sent
    echo           whether our own bytes come back
    others         whether frames were heard that answer nothing that was asked
    longest        bytes of the last long answer, whose pieces were looked at
    met            who has shown on this line that it is of the family that reads it; not of its row
    """

    def __init__(self) -> None:
        self.trips = RoundTrips()
        self.speed_matters: bool | None = None
        self.half_duplex: bool | None = None
        self.echo: bool | None = None
        self.others: bool | None = None
        self.longest: int | None = None
        self.met: set[Hashable] = set()
        self._size = self._alike = 0  # of the pieces of the last long answers, and how many in a row had it

    @property
    def round_trip(self) -> float | None:
        """The median in seconds."""
        return self.trips.quantile(0.5) if len(self.trips) else None

    @property
    def worst(self) -> float:
        """The longest in seconds, 0 where none was measured."""
        return self.trips.quantile(1.0) if len(self.trips) else 0.0

    @property
    def spread(self) -> float | None:
        """From the shortest to the longest, in seconds; None for less than two."""
        return self.worst - self.trips.quantile(0.0) if len(self.trips) > 1 else None

    @property
    def slow(self) -> bool:
        """Whether answers take as long as over Bluetooth or a network."""
        return (self.round_trip or 0.0) > SLOW

    def pieces(self, sizes: Sequence[int]) -> None:
        """Learn from the pieces in which a long answer came: a packet's size shows as that of all but the last, twice."""
        first, self.longest = sizes[0], sum(sizes)
        if first < LEAST or sizes[-1] > first or any(size != first for size in sizes[:-1]):
            first = 0
        self._alike = self._alike + 1 if first == self._size else 1
        self._size = first

    @property
    def packet(self) -> int | None:
        """Bytes of the packets in which long answers come, all of it where something on the way gathers them; None where
        none show. A cable has none: its pieces are those in which this computer reads."""
        told = self._size and self._alike > 1 and (self.slow or self.speed_matters is False)
        return self._size if told else None

    def as_row(self) -> dict[str, Any]:
        """`line` of the JSON envelope: null for what was not measured."""
        return {
            "round_trip_ms": _ms(self.round_trip),
            "spread_ms": _ms(self.spread),
            "speed_matters": self.speed_matters,
            "half_duplex": self.half_duplex,
            "echo": self.echo,
            "others": self.others,
        }

    def words(self) -> str:
        """One line for people, "" for a line about which there is nothing to say."""
        took = f"{1000 * (self.round_trip or 0.0):.0f} ms"
        if self.speed_matters is False:
            kind = "Bluetooth-like" if (self.round_trip or 0.0) > 0.02 else "USB or network"
            text = f"{kind}: {took}, speed ignored"
        elif self.slow:
            text = f"Slow line: {took}"
        elif self.half_duplex:
            text = f"Half duplex: {took}"
        else:
            return "Other programs use this line" if self.others else ""
        return f"{text}, half duplex" if self.half_duplex and "duplex" not in text.lower() else text


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1000 * seconds, 1)


# -- round trips ----------------------------------------------------------------------------------------------------


EDGES_MS = (0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100, 250, 1000)
"""Upper ends of the histogram's classes in ms; the last class has none."""
LATE_FACTOR = 2.0
"""A round trip that lasts more than this many medians is late."""


class RoundTrips:
    """Collects round trips in seconds; counts each microsecond value, so that a loop of hours takes no more memory."""

    def __init__(self) -> None:
        self._counts: dict[int, int] = {}
        self._count = 0
        self._total = 0.0
        self._sorted: list[int] = []
        self._ordered = True
        self._median, self._at, self._below = 0, 0, 0  # when it was last asked for, its place, and how many are smaller

    def add(self, seconds: float) -> None:
        """One more."""
        value = round(seconds * 1e6)
        known, smaller = self._counts.get(value, 0), value < self._median
        if not known:
            self._sorted.append(value)
            self._ordered = False
            self._at += smaller
        self._counts[value] = known + 1
        self._count += 1
        self._total += seconds
        self._below += smaller

    def __len__(self) -> int:
        return self._count

    @property
    def late(self) -> int:
        """How many lasted more than twice the median."""
        limit = LATE_FACTOR * self._quantile(0.5)
        return sum(count for value, count in self._counts.items() if value > limit)

    def quantile(self, part: float) -> float:
        """The value in seconds that `part` (0 to 1) of all do not exceed, to 1 us; 0 when there are none."""
        return self._quantile(part) / 1e6

    def _quantile(self, part: float) -> int:
        if not self._count:
            return 0
        if not self._ordered:
            self._sorted.sort()
            self._ordered = True
        if part in (0.0, 1.0):
            return self._sorted[-1 if part else 0]
        place, at, seen = min(self._count - 1, int(part * self._count)), 0, 0
        if part == 0.5 and self._median:  # it moves little: asked for with each line of a batch
            at, seen = self._at, self._below
            while seen > place:
                at -= 1
                seen -= self._counts[self._sorted[at]]
        while seen + self._counts[self._sorted[at]] <= place:
            seen += self._counts[self._sorted[at]]
            at += 1
        if part == 0.5:
            self._median, self._at, self._below = self._sorted[at], at, seen
        return self._sorted[at]

    def as_row(self) -> dict[str, Any]:
        """Milliseconds for the JSON envelope: min, mean, median, p95, p99, max, late, histogram as [up to, count]."""
        if not self._count:
            return {"count": 0}
        return {
            "count": self._count,
            "min_ms": min(self._counts) / 1000,
            "mean_ms": round(self._total / self._count * 1000, 3),
            "median_ms": self._quantile(0.5) / 1000,
            "p95_ms": self._quantile(0.95) / 1000,
            "p99_ms": self._quantile(0.99) / 1000,
            "max_ms": max(self._counts) / 1000,
            "late": self.late,
            "histogram": self.histogram(),
        }

    def histogram(self) -> list[list[float | int | None]]:
        """[upper end in ms, count] of every class from the first to the last that holds any; None = no upper end."""
        counts = [0] * (len(EDGES_MS) + 1)
        for value, count in self._counts.items():
            counts[next((i for i, edge in enumerate(EDGES_MS) if value <= edge * 1000), len(EDGES_MS))] += count
        used = [i for i, count in enumerate(counts) if count]
        if not used:
            return []
        return [[EDGES_MS[i] if i < len(EDGES_MS) else None, counts[i]] for i in range(used[0], used[-1] + 1)]


# -- what a command returns -------------------------------------------------------------------------------------------

ENVELOPE_SCHEMA = "handctl/1"

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
        lines = (
            tuple(cell._replace(text=say(cell.text)) if isinstance(cell, Cell) else say(cell) for cell in line)
            for line in self.lines
        )
        return self._replace(
            headings=tuple(map(say, self.headings)),
            lines=tuple(lines),
            title=say(self.title),
            notes=tuple(map(say, self.notes)),
        )


class Sample(NamedTuple):
    """One moment of a stream: `t` in seconds since its start, the rows read then, and the time of day in seconds since 1970.

    text  in place of the rows: they are in the format that was chosen
    """

    t: float
    rows: tuple[Row, ...]
    wall: float | None = None
    text: str = ""

    @property
    def time(self) -> str | None:
        """The time of day as results have it."""
        return None if self.wall is None else utc(self.wall, 3)

    def stamped(self, clock: bool) -> list[Row]:
        """The rows, each with `t`, and where the `clock` is asked for with the time of day."""
        stamp: Row = {"time": self.time, "t": round(self.t, 6)} if clock else {"t": round(self.t, 6)}
        return [{**stamp, **row} for row in self.rows]


NONE: Mapping[str, Any] = MappingProxyType({})


@fast_dataclass()
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
    line      row -> finished text, where a stream is a record to be read instead of a table; `closing` are the lines below it
    live      a person at a terminal sees a live view of the stream; else its rows
    cards     device -> what makes its own table, where rows are of several devices: the live view draws each as a card
    pictures  rows -> grids that the live view draws in place of a line for each row; the first that fits the window
    extra     further keys of the JSON envelope, e.g. the raw blocks of a dump
    spool     lines, some at once, in place of `rows` and `text`, where memory may not hold all: JSON of rows, else the text
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
    ranges: Mapping[str, tuple[float, float]] = NONE
    scales: Mapping[str, tuple[float, float]] = NONE
    decimals: Mapping[str, int] = NONE
    bounds: tuple[Bound, ...] = ()
    flags: frozenset[str] = frozenset()
    remedies: Mapping[str, Any] = NONE
    highest: Mapping[str, float] = NONE
    wide: bool = False
    line: Callable[[Row], str] | None = None
    closing: Callable[[], Iterable[str]] | None = None
    live: bool = True
    cards: Mapping[str, Callable[[], Table]] = NONE
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
        row = {"level": self.level, "code": self.code, "text": self.text, "hint": self.hint}
        return {**row, **command_key(self.hint)}


def command_key(hint: str) -> Row:
    """`command` of the row that has this next step; {} where the step names none."""
    return {"command": f"handctl {command}"} if (command := command_of(hint)) else {}


class Finding(NamedTuple):
    """Something wrong: what was seen, the keys of its remedies, and a next step that fits better than the table's."""

    text: str
    keys: tuple[str, ...]
    step: str = ""


@fast_dataclass()
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
        before: Journal | None = None,
    ) -> None:
        """`progress` shows a line that the next one replaces, while something takes its time. `before`: that of the same reading
        on the same line before."""
        self.progress = progress or (lambda text: None)
        self.counters = Counters()
        self.line: LineQuality = before.line if before is not None else LineQuality()
        self.ledger: Ledger = before.ledger if before is not None else Ledger()
        self.messages: list[Message] = []
        self.times: dict[str, int] = {}
        """Code of a warning that is counted -> how often it came."""
        self.kept: Table | None = None
        self._blamed: tuple[HandctlError, int] | None = None
        self._moving: tuple[Callable[[], Stopped], int] | None = None
        self.on_message = on_message
        self.set_going: Callable[[], object] | None = None
        """Called before what moves the device is written, in one of several commands. Raises LinkError."""

    def keep(self, table: Table) -> None:
        """Keep what was read so far: it is shown when the command ends here. Of several the fullest stays."""
        if self.kept is None or len(table.rows) >= len(self.kept.rows):
            self.kept = table

    def moves(self, stop: Callable[[], Stopped]) -> None:
        """From now on, writes move the device and the movement goes on without this command. `stop` stops it and reports the result.

        Raises LinkError where the device cannot be watched over: then nothing must be driven.
        """
        if self.set_going is not None:
            self.set_going()
        self.ledger.drives = True
        self._moving = stop, self._moving[1] if self._moving is not None else self.ledger.mark

    @property
    def drives(self) -> bool:
        """Whether the command has said that what it writes moves the device."""
        return self._moving is not None

    def still_moving(self) -> Callable[[], Stopped] | None:
        """How what was set going is stopped; None where nothing that moves was written."""
        if self._moving is None:
            return None
        stop, before = self._moving
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

    def count(self, code: str, text: str, hint: str = "") -> None:
        """Warn of what may happen with every reply: one message, with the number of times."""
        times = self.times[code] = self.times.get(code, 0) + 1
        self.messages[:] = [one for one in self.messages if one.code != code]
        self.note("warning", code, text if times == 1 else f"{text} ({times} times)", hint)

    def info(self, code: str, text: str, hint: str = "") -> None:
        """Record something worth knowing."""
        self.note("info", code, text, hint)

    def warn(self, code: str, text: str, hint: str = "") -> None:
        """Record something to be careful about."""
        self.note("warning", code, text, hint)


def hex_bytes(data: bytes) -> str:
    """Bytes as the field writes them: ``EB 90 01``."""
    return data.hex(" ").upper()


def hex_shown(data: bytes, most: int = 40) -> str:
    """The same, of long ones the first `most` and how many there are."""
    text = hex_bytes(data[:most])
    return text if len(data) <= most else f"{text} … ({len(data)} bytes)"
