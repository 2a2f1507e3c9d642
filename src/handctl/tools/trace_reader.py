"""Read a transcript into explained rows: family, frames, the request of each reply, round-trip times.

Reads line by line and keeps what is open only, so that a file of any size needs little memory. Knows no protocol: a
family's explainer, found by name in `families`, makes the pieces.
"""

from __future__ import annotations

import io
import json
import sys
import textwrap
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain, starmap
from json.encoder import encode_basestring
from math import isfinite
from typing import IO, Any, NamedTuple

from handctl import files
from handctl.command.family import load
from handctl.errors import UsageError
from handctl.families import EXPLAIN_ORDER, FAMILIES
from handctl.fast_classes import fast_dataclass
from handctl.link.transcript import DIRECTIONS, Entry, as_written, parse_line
from handctl.model.explainer import HOST, SIDES, ExplainedBytes, Explainer, Value
from handctl.model.result import RoundTrips, Row
from handctl.screen.render import dumps
from handctl.wording import plural

LONGEST_LINE = 1 << 20
OPEN_REQUESTS = 64
"""Requests without an answer that are remembered; the oldest is given up beyond."""
MOST_TRIPS = 1_000_000
"""Round trips that go into the figures: those of the first hours of a long recording."""
CASE = "# case "
FAMILY_EVENT = "family "
"""A scan's trace says so before it asks as another family: ``! family exo on /dev/ttyUSB0``."""
PLAIN_HINT = "give a file that --trace FILE made. Its lines are `[SECONDS] > HEX BYTES`"


class Comment(NamedTuple):
    """A line of a transcript that says something to people."""

    text: str
    line: int


TranscriptLine = Entry | Comment


@contextmanager
def opened(path: str) -> Iterator[IO[str]]:
    """The transcript, ``-`` = stdin. Raises UsageError when it cannot be read."""
    if path == "-":
        yield sys.stdin
        return
    with io.TextIOWrapper(
        files.opened(path, "a transcript", hint=PLAIN_HINT, code="no-file"), "utf-8", "surrogateescape"
    ) as file:
        yield file


def lines_of(file: IO[str], source: str) -> Iterator[TranscriptLine]:
    """The lines of a transcript. Raises UsageError naming the line that is damaged."""
    number = 0
    while True:
        try:
            text = file.readline(LONGEST_LINE)
        except (OSError, ValueError) as exc:
            why = exc.strerror if isinstance(exc, OSError) else "not a text file"
            raise UsageError(f"{source}: cannot be read after line {number}: {why}", hint=PLAIN_HINT) from exc
        if not text:
            return
        text = text if number else text.removeprefix(files.BYTE_ORDER_MARK)
        number += 1
        if len(text) >= LONGEST_LINE:
            raise UsageError(f"{source}, line {number}: longer than {LONGEST_LINE} characters", hint=PLAIN_HINT)
        if (entry := as_written(text, number)) is not None:
            yield entry
            continue
        stripped = text.strip()
        if stripped.startswith("#"):
            yield Comment(printable(stripped), number)
            continue
        if not stripped:
            continue
        try:
            yield parse_line(stripped, number)
        except ValueError as exc:
            raise UsageError(
                f"{source}, line {number}: {printable(str(exc))}",
                hint="a line is: [SECONDS] > HEX BYTES",
                code="damaged",
            ) from exc


def printable(text: str) -> str:
    """The text without anything that a terminal would act on."""
    return text if text.isprintable() else "".join(letter if letter.isprintable() else "?" for letter in text)


def explainer_of(family: str) -> Explainer:
    """The explainer of a family. Raises UsageError for a name that is none."""
    if family not in FAMILIES:
        raise UsageError(f"{family!r} is not a device family", hint=f"use one of {', '.join(EXPLAIN_ORDER)}")
    made: Explainer = load(family, "explain_bytes").explainer()
    return made


def family_in(comment: str) -> str:
    """The family in the first line of a recorded trace, ``# handctl 0.1.0 exo dump, fake://exo``; "" = none."""
    words = comment.lstrip("# ").split()
    if len(words) < 3 or words[0] != "handctl":
        return ""
    if words[2].rstrip(",") in FAMILIES:
        return words[2].rstrip(",")
    named = words[-1].removeprefix("fake://").partition("?")[0]
    return named if named in FAMILIES else ""


def family_of_event(entry: Entry) -> str:
    """The family whose bytes follow this event; "" = none."""
    name = entry.text.removeprefix(FAMILY_EVENT).partition(" ")[0]
    return name if entry.text.startswith(FAMILY_EVENT) and name in FAMILIES else ""


def chosen(lines: Iterator[TranscriptLine], family: str, source: str) -> tuple[str, bool, Iterator[TranscriptLine]]:
    """(family, whether it was told from the bytes, all lines): from the option, the first comment, the first bytes, or
    an event before them that names it.
    """
    seen: list[TranscriptLine] = []
    for line in lines:
        seen.append(line)
        if not family:
            family = (
                family_of_event(line) if isinstance(line, Entry) else family_in(line.text) if line.line == 1 else ""
            )
        if family or (isinstance(line, Entry) and line.data) or len(seen) > 10_000:
            break
    told = not family
    entry = next((line for line in seen if isinstance(line, Entry) and line.data), None)
    if not family and entry is not None:
        family = next((name for name in EXPLAIN_ORDER if explainer_of(name).recognises(entry.data, entry.can_id)), "")
    if not family:
        raise UsageError(
            f"{source}: cannot tell the device family from the first line or the bytes",
            hint=f"--family {'|'.join(EXPLAIN_ORDER)}",
            code="which-family",
        )
    return family, told, chain(seen, lines)


SIDE_TEXTS = {None: "null"} | {side: f'"{side}"' for side in SIDES}
OWN = frozenset(("t", "line", "direction", "kind", "bytes", "meaning", "problem", "request_line", "round_trip_ms"))
"""Keys of a row, which a family's own do not replace."""


class Stamp(NamedTuple):
    """When and where bytes were recorded."""

    t: float | None
    line: int


@fast_dataclass()
class TranscriptRow:
    """One row of `trace show`: explained bytes, an event, a comment, or a request without a reply.

    first, last   place and time of its first and last byte
    request       place and time of its request
    round_trip    seconds from there to its last byte, None without times
    unasked       a reply without a request
    """

    first: Stamp
    last: Stamp
    piece: ExplainedBytes | None = None
    event: str = ""
    comment: str = ""
    unanswered: ExplainedBytes | None = None
    request: Stamp | None = None
    round_trip: float | None = None
    unasked: bool = False

    @property
    def problem(self) -> str:
        """Code of what is wrong here, "" = nothing."""
        if self.piece is not None and self.piece.problem:
            return self.piece.problem
        return "no-answer" if self.unanswered is not None else "unasked" if self.unasked else ""

    @property
    def meaning(self) -> str:
        """In words."""
        if self.unanswered is not None:
            return printable(f"no reply to the request of line {self.first.line}: {self.unanswered.meaning}")
        text = self.event if self.piece is None else self.piece.meaning
        return printable(f"{text} (replies to no request)" if self.unasked else text)

    @property
    def kind(self) -> str:
        """``frame``, ``stray``, ``event`` or ``unanswered``."""
        if self.unanswered is not None:
            return "unanswered"
        return "event" if self.piece is None else "frame" if self.piece.frame else "stray"

    @property
    def bytes(self) -> str:
        """As a transcript has them, "" for what has none."""
        return "" if self.piece is None else wire(self.piece)

    def as_row(self) -> Row:
        """For JSON and CSV: the common keys and the family's own, without those that do not apply."""
        row: Row = json.loads(self.as_json())
        return row

    def as_line(self, between: str, say: Callable[[str], str]) -> str:
        """The row for tables: time, line, direction, round trip in ms, problem, bytes, and what `say` makes of the meaning."""
        shown, (t, line), trip = self.piece or self.unanswered, self.first, self.round_trip
        direction = "" if shown is None else shown.direction
        time, trip_ms = "" if t is None else t, "" if trip is None else round(trip * 1000, 3)
        return f"{time}{between}{line}{between}{direction}{between}{trip_ms}{between}{self.problem}{between}{self.bytes}{between}{say(self.meaning)}"

    def as_json(self, begin: str = "{", no_time: str = "", end: str = "}") -> str:
        """The row as JSON, for a recording of millions: an encoder of anything would take three times as long.

        `begin` and `end` are around the keys, `no_time` stands in the place of its time where it has none.
        """
        piece, t, request, trip = self.piece, self.first.t, "", ""
        kept = None if piece is None or self.unasked else piece.kept
        if kept is None:
            head, own = self._json_texts()
        else:
            if "json" not in kept:
                kept["json"] = self._json_texts()
            head, own = kept["json"]
        if self.request is not None:
            request = f', "request_line": {self.request.line}'
            if self.round_trip is not None:
                trip = f', "round_trip_ms": {round(self.round_trip * 1000, 3)!r}'
        stamp = no_time if t is None else f'"t": {t!r}, '
        return f'{begin}{stamp}"line": {self.first.line}, {head}{request}{trip}{own}{end}'

    def _json_texts(self) -> tuple[str, str]:
        """The keys that every row has, but for its line; and those of its family."""
        shown, own, problem = self.piece or self.unanswered, "", self.problem
        side = None if shown is None else shown.direction
        if shown is not None:
            for key, value in shown.fields.items():
                if value is not None and key not in OWN:
                    own += f', "{key}": {value if type(value) is int else _own_text(value)}'
            values = shown.values
            listed = ", ".join(values.texts(_value_text) if hasattr(values, "texts") else starmap(_number_text, values))
            if listed:
                own += f', "values": [{listed}]'
        head = (
            f'"direction": {SIDE_TEXTS[side]}, "kind": "{self.kind}", "bytes": "{self.bytes}", '
            f'"meaning": {_text(self.meaning)}, "problem": {_text(problem) if problem else "null"}'
        )
        return head, own


def _text(value: Any) -> str:
    """A value as JSON; texts are `printable`."""
    kind = type(value)
    if kind is str:
        return encode_basestring(value) if '"' in value or "\\" in value else f'"{value}"'
    if value is None:
        return "null"
    return repr(value) if kind is int or (kind is float and isfinite(value)) else dumps(value)


@lru_cache(1024)
def _own_text(value: str | int) -> str:
    """What stands behind a key of a family."""
    return _text(printable(value) if isinstance(value, str) else value)


def _value_text(value: Value) -> str:
    """One number of a frame as JSON, for what looks it up."""
    return _number_text.__wrapped__(*value)


@lru_cache(1 << 14, typed=True)
def _number_text(name: str, value: float | str | None, unit: str | None) -> str:
    """The same of name, value and unit; a long recording says the same again and again. 1 and 1.0 are told apart."""
    return f'{{"name": {_text(name)}, "value": {_text(value)}, "unit": {_text(unit)}}}'


def wire(piece: ExplainedBytes) -> str:
    """The bytes of a piece as a transcript has them."""
    kept = piece.kept
    if kept is not None and "bytes" in kept:
        known: str = kept["bytes"]
        return known
    text = piece.raw.hex(" ").upper()
    text = text if piece.can_id is None else f"can {piece.can_id:08X} [{len(piece.raw)}] {text}".rstrip()
    if kept is not None:
        kept["bytes"] = text
    return text


@dataclass(slots=True)
class Statistics:
    """What `trace show` counts. `families`: whose bytes they were taken for, in order."""

    families: dict[str, None] = field(default_factory=dict)
    frames: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SIDES, 0))
    count: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SIDES, 0))
    stray: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SIDES, 0))
    problems: dict[str, int] = field(default_factory=dict)
    requests: int = 0
    answered: int = 0
    start: float | None = None
    end: float | None = None
    trips: RoundTrips = field(default_factory=RoundTrips)

    @property
    def seconds(self) -> float | None:
        """From the first to the last byte with a time."""
        return None if self.start is None or self.end is None else self.end - self.start

    def note(self, told: TranscriptRow) -> None:
        """Count one row."""
        piece = told.piece
        if piece is None or piece.problem or told.unasked:
            if problem := told.problem:
                self.problems[problem] = self.problems.get(problem, 0) + 1
            if piece is None:
                return
        direction, size = piece.direction, len(piece.raw)
        self.count[direction] += size
        if piece.frame:
            self.frames[direction] += 1
        else:
            self.stray[direction] += size
        if piece.asks:
            self.requests += 1
        elif told.request is not None:
            self.answered += 1
            if told.round_trip is not None and len(self.trips) < MOST_TRIPS:
                self.trips.add(told.round_trip)

    def as_row(self) -> dict[str, Any]:
        """For the JSON envelope."""
        seconds = self.seconds
        return {
            "family": ", ".join(self.families), "frames": self.frames, "bytes": self.count, "stray_bytes": self.stray, "requests": self.requests,
            "answered": self.answered, "problems": self.problems,
            "seconds": None if seconds is None else round(seconds, 6),
            "bytes_per_second": None if not seconds else {side: round(self.count[side] / seconds, 1) for side in SIDES},
            "round_trip": self.trips.as_row(),
        }  # fmt: skip


class TranscriptReader:
    """Lines -> rows. `statistics` cover the rows returned so far.

    A comment ``# case NAME`` begins another conversation, as in a file of test vectors; an event ``! family NAME`` one
    with another device.
    """

    def __init__(self, family: str) -> None:
        self.statistics = Statistics(families={family: None})
        self._family = family
        self._explainer = explainer_of(family)
        self._stamps: dict[str, deque[list[Any]]] = {side: deque() for side in SIDES}
        self._open: dict[str, tuple[Stamp, ExplainedBytes]] = {}

    def tell(self, lines: Iterable[TranscriptLine]) -> Iterator[TranscriptRow]:
        """The rows, in the order in which they became complete."""
        for line in lines:
            if isinstance(line, Entry):
                yield from self.take(line)
                continue
            if line.text.startswith(CASE):
                yield from self.over()
                self._explainer = explainer_of(self._family)
            yield TranscriptRow(Stamp(None, line.line), Stamp(None, line.line), comment=line.text)
        yield from self.over()

    @property
    def open_lines(self) -> set[int]:
        """The lines of the requests without a reply so far."""
        return {stamp.line for stamp, _ in self._open.values()}

    @property
    def waits(self) -> bool:
        """Whether the reply to a request is missing."""
        return bool(self._open)

    def take(self, entry: Entry) -> list[TranscriptRow]:
        """The rows that this entry completes."""
        found = self._entry(entry)
        for told in found:
            self.statistics.note(told)
        return found

    def over(self) -> list[TranscriptRow]:
        """The conversation has ended: what is held back, and what stayed without an answer."""
        found = [*self._pieces(self._explainer.flush()), *self._given_up(0)]
        for told in found:
            self.statistics.note(told)
        return found

    def _entry(self, entry: Entry) -> list[TranscriptRow]:
        time, mark, data, text, can_id, line = entry
        stamp = Stamp(time, line)
        if mark == "!":
            found = [*self._pieces(self._explainer.flush()), *self._given_up(0)]
            self._explainer.event(text)
            if family := family_of_event(entry):
                self._family, self._explainer = family, explainer_of(family)
                self.statistics.families.setdefault(family)
            return [*found, TranscriptRow(stamp, stamp, event=text)]
        direction = DIRECTIONS[mark]
        if time is not None:
            statistics = self.statistics
            if statistics.start is None or time < statistics.start:
                statistics.start = time
            if statistics.end is None or time > statistics.end:
                statistics.end = time
        stamps, size = self._stamps[direction], len(data)
        pieces = self._explainer.feed(direction, data, can_id)
        whole = not stamps and len(pieces) == 1 and len(pieces[0].raw) == size and pieces[0].direction == direction
        if can_id is None and not whole:
            stamps.append([size, stamp])
        if not pieces:
            return []
        found = self._pieces(pieces, stamp if whole or can_id is not None else None)
        if len(self._open) > OPEN_REQUESTS:
            found += self._given_up(OPEN_REQUESTS)
        return found

    def _pieces(self, pieces: Iterable[ExplainedBytes], stamp: Stamp | None = None) -> list[TranscriptRow]:
        found: list[TranscriptRow] = []
        for piece in pieces:
            first, last = (stamp, stamp) if stamp is not None else self._span(piece)
            told = TranscriptRow(first, last, piece)
            if piece.asks:
                if piece.asks in self._open:
                    found.append(self._unanswered(piece.asks))
                self._open[piece.asks] = (last, piece)
            elif piece.answers:
                request = self._open.pop(piece.answers, None)
                told.unasked = request is None
                if request is not None:
                    told.request = request[0]
                    if request[0].t is not None and last.t is not None:
                        told.round_trip = max(0.0, last.t - request[0].t)
            found.append(told)
        return found

    def _span(self, piece: ExplainedBytes) -> tuple[Stamp, Stamp]:
        """Where the bytes of a piece were recorded: they are taken off the lines of their direction in order."""
        stamps, left = self._stamps[piece.direction], len(piece.raw)
        first = last = stamps[0][1] if stamps else Stamp(None, 0)
        while left and stamps:
            last = stamps[0][1]
            taken = min(left, stamps[0][0])
            left -= taken
            stamps[0][0] -= taken
            if not stamps[0][0]:
                stamps.popleft()
        return first, last

    def _unanswered(self, key: str) -> TranscriptRow:
        stamp, piece = self._open.pop(key)
        return TranscriptRow(stamp, stamp, unanswered=piece)

    def _given_up(self, keep: int) -> Iterator[TranscriptRow]:
        while len(self._open) > keep:
            yield self._unanswered(next(iter(self._open)))


# -- told rows for people ----------------------------------------------------------------------------------------------


NARROW = 72
INDENT = 26
BAR = 30


def row_text(told: TranscriptRow, width: int | None) -> str:
    """One row as lines of text; `width` None = a pipe."""
    if told.comment:
        return told.comment
    piece = told.piece
    if piece is not None:
        mark, data = ">" if piece.direction == HOST else "<", wire(piece)
    else:
        mark, data = "!" if told.kind == "event" else " ", ""
    flag = "*" if told.problem else " "
    trip = "" if told.round_trip is None else f"+{told.round_trip * 1000:.3f} ms"
    return laid_out(f"{moment(told.first)} {mark}{flag}{trip:>11} ", told.meaning, data, width)


def laid_out(head: str, meaning: str, data: str, width: int | None) -> str:
    """A row: its head, what it means, its bytes below; on a pipe, where `width` is None, one line."""
    if width is None:
        return f"{head} {meaning}" + (f"  [{data}]" if data else "")
    lines = _wrapped(head, meaning, width)
    if data:
        indent = INDENT if width >= NARROW else 4
        lines.append(" " * indent + _elided(data, width - indent))
    return "\n".join(lines)


def moment(stamp: Stamp) -> str:
    """The time, or the line where there is none."""
    return f"{stamp.t:11.6f}" if stamp.t is not None else f"{f'line {stamp.line}':>11}"


def _wrapped(head: str, text: str, width: int) -> list[str]:
    if width < NARROW:
        return [head.rstrip(), *textwrap.wrap(text, max(20, width - 2), initial_indent="  ", subsequent_indent="  ")]
    indent = " " * INDENT
    return textwrap.wrap(text, width, initial_indent=f"{head:<{INDENT}}", subsequent_indent=indent) or [head]


def _elided(data: str, width: int) -> str:
    if len(data) <= width:
        return data
    head, bracket, rest = data.rpartition("] ")
    words = rest.split()
    tail = f" … ({plural(len(words), 'byte')})"
    room = max(0, (width - len(head + bracket) - len(tail) + 1) // 3)
    return f"{head}{bracket}{' '.join(words[:room])}{tail}"


def statistics_text(statistics: Statistics) -> Iterator[str]:
    """The closing lines."""
    row: dict[str, Any] = statistics.as_row()
    rates = row["bytes_per_second"]
    yield ""
    yield f"device      {row['family']}"
    for side in SIDES:
        rate = f", {rates[side]:g} bytes/s" if rates else ""
        stray = f", {row['stray_bytes'][side]} of them in no frame" if row["stray_bytes"][side] else ""
        yield f"{side:<11} {plural(row['frames'][side], 'frame')}, {plural(row['bytes'][side], 'byte')}{stray}{rate}"
    yield f"requests    {row['requests']}, {row['answered']} answered"
    if row["problems"]:
        yield f"problems    {', '.join(f'{code} {count}' for code, count in sorted(row['problems'].items()))}"
    trips = row["round_trip"]
    if not trips["count"]:
        return
    late = f", {trips['late']} longer than twice the median" if trips["late"] else ""
    yield f"round trip  min {trips['min_ms']:g}, median {trips['median_ms']:g}, max {trips['max_ms']:g} ms{late}"
    most = max(count for _, count in trips["histogram"])
    for edge, count in trips["histogram"]:
        label = f"to {edge:g} ms" if edge is not None else "longer"
        yield f"  {label:>12} {'#' * max(1 if count else 0, round(BAR * count / most)):<{BAR}} {count}".rstrip()
