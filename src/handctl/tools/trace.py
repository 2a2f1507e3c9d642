"""`handctl trace`: explain recorded transcripts and single frames, without a device. Knows no family."""

from __future__ import annotations

import re
import shutil
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, islice
from typing import Any

import click

from handctl.command.command_tree import Group
from handctl.command.options import InFile
from handctl.command.run import Run
from handctl.errors import CheckFailed, HandctlError, UsageError
from handctl.families import FAMILIES
from handctl.fast_classes import NamedTuple, fast_dataclass, field
from handctl.files import BYTE_ORDER_MARK, text_lines
from handctl.model.command_settings import Settings
from handctl.model.explainer import DEVICE, HOST, ExplainedBytes, Value
from handctl.model.result import Cell, Column, Grid, Row, Sample, Table, hex_bytes
from handctl.screen.csv_output import csv_cell
from handctl.screen.sanitize import no_formula
from handctl.tools.trace_reader import (
    FAMILY_EVENT,
    Stamp,
    TranscriptReader,
    TranscriptRow,
    chosen,
    explainer_of,
    lines_of,
    opened,
    printable,
    row_text,
    statistics_text,
    wire,
)

# -- two transcripts, by their requests and replies, not by time or chunks ---------------------------------------------
#
# An exchange is a request with its answer, or something that came by itself. The exchanges of both sides are walked side
# by side; where they part, the nearest place within a window where they meet again is taken.


WINDOW = 200
"""Exchanges that are looked ahead for the place where both meet again."""


@fast_dataclass()
class Exchange:
    """key: what it is about, without values; request and answer in words, the reply as it came; line where it begins."""

    key: str
    line: int
    request: str = ""
    answer: str = ""
    values: dict[str, Value] = field(default_factory=dict)
    complete: bool = True
    reply: ExplainedBytes | None = None

    def same(self, other: Exchange) -> bool:
        """Whether both say the same."""
        return self.request == other.request and self.answer == other.answer

    @property
    def text(self) -> str:
        """Request and answer in one line."""
        return " -> ".join(filter(None, (self.request, self.answer)))


class Difference(NamedTuple):
    """One step of the comparison: in both ("same" or "changed"), or in one of them only."""

    status: str
    a: Exchange | None
    b: Exchange | None


def exchanges(told: Iterable[TranscriptRow]) -> Iterator[Exchange]:
    """Exchanges in the order of their requests."""
    line: deque[Exchange] = deque()
    asked: dict[str, Exchange] = {}
    for row in told:
        if row.comment:
            continue
        if row.unanswered is not None:
            waiting = asked.pop(row.unanswered.asks, None)
            if waiting is not None:
                waiting.complete, waiting.answer = True, "no reply"
        elif row.piece is None:
            # Where a scan looked counts as little as when.
            event = row.event.partition(" on ")[0] if row.event.startswith(FAMILY_EVENT) else row.event
            line.append(Exchange(f"event {event}", row.first.line, request=f"event: {event}"))
        elif row.request is not None and row.piece.answers in asked:
            waiting = asked.pop(row.piece.answers)
            waiting.complete, waiting.answer, waiting.reply = True, row.meaning, row.piece
            waiting.values |= _values(row.piece)
        else:
            line.append(_opened(row, row.piece, asked))
        while line and line[0].complete:
            yield line.popleft()
    yield from line


def _opened(row: TranscriptRow, piece: ExplainedBytes, asked: dict[str, Exchange]) -> Exchange:
    key = f"{piece.direction} {piece.title or piece.meaning}"
    if piece.direction != HOST:
        return Exchange(key, row.first.line, answer=row.meaning, values=_values(piece), reply=piece)
    opened = Exchange(key, row.first.line, request=row.meaning, values=_values(piece), complete=not piece.asks)
    if piece.asks:
        asked[piece.asks] = opened
    return opened


def _values(piece: ExplainedBytes) -> dict[str, Value]:
    return {value.name: value for value in piece.values}


def compare(a: Iterator[Exchange], b: Iterator[Exchange]) -> Iterator[Difference]:
    """The steps that lead through both. Memory: two windows."""
    left: deque[Exchange] = deque()
    right: deque[Exchange] = deque()
    while True:
        left.extend(islice(a, WINDOW - len(left)))
        right.extend(islice(b, WINDOW - len(right)))
        if not left or not right:
            break
        skip_a, skip_b = _meeting(left, right)
        for _ in range(skip_a):
            yield Difference("only-a", left.popleft(), None)
        for _ in range(skip_b):
            yield Difference("only-b", None, right.popleft())
        if left and right and left[0].key == right[0].key:
            one, other = left.popleft(), right.popleft()
            yield Difference("same" if one.same(other) else "changed", one, other)
    for rest in (left, a):
        yield from (Difference("only-a", single, None) for single in rest)
    for rest in (right, b):
        yield from (Difference("only-b", None, single) for single in rest)


def _meeting(left: deque[Exchange], right: deque[Exchange]) -> tuple[int, int]:
    """How many to pass over on each side until both are about the same: the fewest together."""
    if left[0].key == right[0].key:
        return 0, 0
    first: dict[str, int] = {}
    for place, exchange in enumerate(right):
        first.setdefault(exchange.key, place)
    best = (len(left), len(right))
    for place, exchange in enumerate(left):
        if place >= sum(best):
            break
        other = first.get(exchange.key)
        if other is not None and place + other < sum(best):
            best = (place, other)
    return best


def changes(one: Exchange, other: Exchange) -> list[tuple[str, str, str]]:
    """(name, in A, in B) of the values that differ; [] where the words differ otherwise."""
    names = [*one.values, *(name for name in other.values if name not in one.values)]
    found = []
    for name in names:
        a, b = (side.values.get(name) for side in (one, other))
        if a != b:
            found.append((name, _shown(a), _shown(b)))
    return found


def _shown(value: Value | None) -> str:
    if value is None:
        return "absent"
    return f"{value.value} {value.unit}" if value.unit else str(value.value)


# -- the commands --------------------------------------------------------------------------------------------------


AT_ONCE = 100
"""Rows of a recorded file that are handed on together."""
MOST_DIFFERENCES = 10_000
"""Differences that are shown; those beyond are counted."""

cli = Group(
    "trace",
    help="Show, compare and decode recorded transcripts, without a device.\n\nA transcript is a file that --trace FILE made.",
)
family_option = click.option(
    "--family",
    type=click.Choice(list(FAMILIES)),
    metavar="FAMILY",
    help="The family of the device (default: taken from the file, otherwise guessed from the bytes).",
)


@cli.verb("show", offline=True)
@click.argument("file", type=InFile())
@family_option
@click.option(
    "--only", type=click.Choice(["errors"]), help="Show only bad frames, refusals and requests without a reply."
)
@click.option(
    "--grep", "pattern", metavar="REGEX", help="Show only rows whose meaning or bytes match. Case is ignored."
)
def show(run: Run, file: str, family: str | None, only: str | None, pattern: str | None) -> Table | None:
    """Show every frame of FILE (-: stdin) in words, and statistics at the end.

    Each row has time, direction, bytes, meaning and round-trip time. `*` marks errors. Stray bytes are those outside of any frame.
    """
    told = _TranscriptPrinter(file, family)
    rows = _wanted(told.rows(run), only, pattern)
    match run.settings.format:
        case "json":
            return _collected(told, rows)
        case "table":
            _write_text(run, told, rows)
            return None
        case _:
            return _streamed(run, told, rows)


@cli.verb("diff", offline=True)
@click.argument("a", type=InFile())
@click.argument("b", type=InFile())
@family_option
def diff(run: Run, a: str, b: str, family: str | None) -> Table:
    """Compare the exchanges of two transcripts, A and B.

    An exchange is a request with its reply. Times, message numbers and the way data was split are ignored. `-` is stdin.
    Exit code 7 means that they differ.
    """
    if a == b == "-":
        raise UsageError("stdin can only be read once", hint="give a file for A or B")
    one = _TranscriptPrinter(a, family)
    rows_a = one.rows(run)
    first = next(rows_a, None)
    other = _TranscriptPrinter(b, family or one.family)
    rows_b = other.rows(run)
    counts = dict.fromkeys(("same", "changed", "only-a", "only-b"), 0)
    rows: list[Row] = []
    for step in compare(exchanges(chain([first] if first is not None else [], rows_a)), exchanges(rows_b)):
        counts[step.status] += 1
        if step.status != "same" and len(rows) < MOST_DIFFERENCES:
            rows.append(_difference_row(step))
    differing = sum(counts.values()) - counts["same"]
    text = f"{counts['same']} same, {counts['changed']} changed, {counts['only-a']} only in {a}, {counts['only-b']} only in {b}"
    if differing > len(rows):
        run.journal.warn("many", f"the first {len(rows)} of {differing} differences are shown")
    if not differing:
        run.journal.info("same", f"no difference in {counts['same']} exchanges")
    failure = CheckFailed(f"the transcripts differ: {text}", code="differ") if differing else None
    columns = (
        Column("status", "Status"), Column("line_a", "Line A", right=True), Column("line_b", "Line B", right=True),
        Column("name", "Name"), Column("a", "In A"), Column("b", "In B"),
    )  # fmt: skip
    return Table(rows=rows, columns=columns, text=_difference_text, failure=failure, extra={"statistics": counts})


@cli.verb("decode", offline=True)
@click.argument("family", type=click.Choice(list(FAMILIES)))
@click.argument("hex_bytes", metavar="HEX...", nargs=-1, required=True)
@click.option(
    "--from",
    "side",
    type=click.Choice(["host", "device"]),
    help="The sender of the frames (default: guessed from the bytes).",
)
def decode(run: Run, family: str, hex_bytes: tuple[str, ...], side: str | None) -> Table:
    """Explain frames field by field, for example from a manual or a scope.

    Accepts EB 90, 0xEB,0x90, \\xEB\\x90, xxd output, a line of a transcript, or a CAN frame such as 11000001#04. `-` reads stdin.
    If a checksum is wrong, the correct one is shown too. Exit code 7 means that no frame is valid.
    """
    from handctl.tools.family_probe import probe_of

    text = sys.stdin.read() if hex_bytes == ("-",) else " ".join(hex_bytes)
    explainer = explainer_of(family)
    pieces: list[ExplainedBytes] = []
    for given in parse_given(text):
        if given.can_id is not None and "can" not in probe_of(family).WIRES:
            raise UsageError(f"{family} has no CAN interface", hint="give the bytes alone")
        pieces += explainer.decode(given.data, side or given.side, given.can_id)
    columns = (Column("direction", "From"), Column("bytes", "Bytes"), Column("meaning", "Meaning"))
    table = Table(rows=[_piece_row(piece) for piece in pieces], columns=columns, view=_decoded_view)
    if not any(piece.frame for piece in pieces):
        table.failure = CheckFailed(
            f"nothing in these bytes is a valid frame of {family}",
            hint="`trace decode -h` lists the families",
            code="no-frame",
        )
    return table


# -- show -------------------------------------------------------------------------------------------------------------


class _TranscriptPrinter:
    """The rows of one transcript; `family` and `statistics` are known after the first row."""

    def __init__(self, path: str, family: str | None) -> None:
        self.path = path
        self.family = family or ""
        self.statistics: Any = None

    def rows(self, run: Run) -> Iterator[TranscriptRow]:
        """The rows; the file is open as long as they are read. Raises UsageError."""
        with opened(self.path) as source:
            self.family, by_bytes, lines = chosen(lines_of(source, self.path), self.family, self.path)
            if by_bytes:
                text = f"{self.path}: recognized as {self.family} from its contents"
                run.journal.info("family", text, hint="choose another with --family")
            teller = TranscriptReader(self.family)
            self.statistics = teller.statistics
            yield from teller.tell(lines)

    @property
    def extra(self) -> dict[str, Any]:
        """The statistics for the JSON envelope."""
        return {} if self.statistics is None else {"statistics": self.statistics.as_row()}


def _wanted(rows: Iterator[TranscriptRow], only: str | None, pattern: str | None) -> Iterator[TranscriptRow]:
    """Those that are shown."""
    try:
        wanted = re.compile(pattern, re.IGNORECASE) if pattern is not None else None
    except re.error as exc:
        raise UsageError(
            f"--grep {pattern!r}: {exc}",
            hint="write a regular expression, with \\ before . * + ( ) for the literal character",
        ) from exc

    if only is None and wanted is None:
        return rows

    def matches(row: TranscriptRow) -> bool:
        if row.comment:
            return False
        if only is not None and not row.problem:
            return False
        return wanted is None or bool(wanted.search(row.meaning) or (row.piece and wanted.search(wire(row.piece))))

    return filter(matches, rows)


def _collected(told: _TranscriptPrinter, rows: Iterator[TranscriptRow]) -> Table:
    from handctl.files import Spool

    spool = Spool()
    failure: HandctlError | None = None
    try:
        spool.take(row.as_json() for row in rows if not row.comment)
    except UsageError as exc:
        failure = exc
    return Table(spool=spool.blocks, failure=failure, extra=told.extra)


def _streamed(run: Run, told: _TranscriptPrinter, rows: Iterator[TranscriptRow]) -> Table:
    # Each sample is flushed: of a file several rows are one, what comes on stdin is shown as it comes.
    at_once = AT_ONCE if told.path != "-" else 1
    head, text_of_row = _texts(run.settings)

    def samples() -> Iterator[Sample]:
        some = [head]
        try:
            for row in rows:
                if not row.comment:
                    some.append(text_of_row(row))
                    if len(some) > at_once:
                        yield Sample(0.0, (), text="".join(some))
                        some = [""]
        except UsageError:
            yield from [Sample(0.0, (), text="".join(some))] if len(some) > 1 else ()
            raise
        yield from [Sample(0.0, (), text="".join(some))] if len(some) > 1 else ()

    return Table(samples=samples(), live=False, summary=lambda: told.extra)


COLUMNS = ("t_s", "line", "direction", "round_trip_ms", "problem", "bytes", "meaning")


def _texts(settings: Settings) -> tuple[str, Callable[[TranscriptRow], str]]:
    """What stands before all rows, and what makes one of them text: millions take no way round by dicts."""
    if settings.format == "ndjson":
        begin = '{"time": null, ' if settings.time else "{"
        return "", lambda row: row.as_json(begin, '"t": null, ', "}\n")
    if settings.format == "plain":
        begin = "\t" if settings.time else ""
        return "", lambda row: begin + row.as_line("\t", str) + "\n"
    begin = "," if settings.time else ""
    say = (lambda text: csv_cell(no_formula(text))) if settings.no_formulas else csv_cell
    head = ",".join((*(["time"] if settings.time else ()), *COLUMNS)) + "\r\n"
    return head, lambda row: begin + row.as_line(",", say) + "\r\n"


def _write_text(run: Run, told: _TranscriptPrinter, rows: Iterator[TranscriptRow]) -> None:
    from handctl.screen.render import Sink

    with Sink(run.settings) as sink:
        width = shutil.get_terminal_size().columns if sink.terminal else None
        for row in rows:
            sink.write(row_text(row, width) + "\n")
            if sink.broken:
                return
        for line in statistics_text(told.statistics):
            sink.write(line + "\n")


# -- diff and decode --------------------------------------------------------------------------------------------------


def _difference_row(step: Difference) -> Row:
    sides = {side: getattr(step, side) for side in ("a", "b")}
    shown = step.a or step.b
    assert shown is not None
    row: Row = {"status": step.status, "line_a": None, "line_b": None, "name": shown.key.partition(" ")[2]}
    for side, exchange in sides.items():
        row[side] = None if exchange is None else exchange.text
        if exchange is not None:
            row[f"line_{side}"] = exchange.line
    if step.a is not None and step.b is not None:
        row["changes"] = [dict(zip(("name", "a", "b"), change, strict=True)) for change in changes(step.a, step.b)]
    return row


def _difference_text(rows: list[Row]) -> str:
    lines: list[str] = []
    for row in rows:
        where = ", ".join(f"line {row[f'line_{side}']} of {side.upper()}" for side in "ab" if row[f"line_{side}"])
        lines.append(f"{row['status']}: {where}")
        if row.get("changes"):
            lines.append(f"  {row['name']}")
            lines += [f"    {change['name']}: {change['a']} -> {change['b']}" for change in row["changes"]]
            continue
        lines += [f"  {mark} {row[side]}" for mark, side in (("-", "a"), ("+", "b")) if row[side] is not None]
    return "".join(f"{line}\n" for line in lines)


def _piece_row(piece: ExplainedBytes) -> Row:
    nowhere = Stamp(None, 0)
    row = TranscriptRow(nowhere, nowhere, piece).as_row()
    del row["line"]
    row["parts"] = [{"bytes": hex_bytes(part.raw), "field": part.name, "meaning": part.meaning} for part in piece.parts]
    return row


def _decoded_view(rows: list[Row]) -> list[Grid]:
    grids = []
    for row in rows:
        lines = tuple(
            (
                part["bytes"],
                part["field"],
                Cell(printable(part["meaning"]), "bad" if "wrong" in part["meaning"] else ""),
            )
            for part in row["parts"]
        ) or ((row["bytes"], "", ""),)
        grids.append(Grid(("Bytes", "Field", "Meaning"), lines, f"from the {row['direction']}: {row['meaning']}"))
    return grids


# -- bytes as people have them: from a manual, a scope, a hex dump or a line of a transcript ---------------------------


_CAN = re.compile(r"^(?:can\s+)?(?:0x)?([0-9A-Fa-f]{1,8})\s*(?:#|\[(\d)\])\s*(.*)$", re.IGNORECASE)
_MARK = re.compile(r"^\s*(?:\d+(?:\.\d+)?\s+)?([<>])\s*(.*)$", re.DOTALL)
_XXD = re.compile(r"^\s*[0-9A-Fa-f]{4,8}:\s+((?:[0-9A-Fa-f]{2,4} )+)(?: .*)?$")
_HEXDUMP = re.compile(r"^\s*[0-9A-Fa-f]{4,8}\s\s+([0-9A-Fa-f ]+?)\s*\|.*\|?\s*$")
_OFFSET_ONLY = re.compile(r"^\s*[0-9A-Fa-f]{8}\s*$")


class Given(NamedTuple):
    """Bytes, who sent them if that was said ("" = not), and the identifier of a CAN frame."""

    data: bytes
    side: str = ""
    can_id: int | None = None


def parse_given(text: str) -> list[Given]:
    """``EB 90``, ``0xEB,0x90``, ``\\xeb\\x90``, ``EB:90``, ``{0xEB, 0x90}``, hex dumps, transcript lines, CAN frames, JSON.

    Lines of bytes are joined unless they say who sent them. Raises UsageError naming what is no byte.
    """
    if (text.lstrip().startswith("{") and '"' in text) or text.strip() == "{}":
        return [Given(text.strip().encode("utf-8", "replace"))]
    found: list[Given] = []
    plain = b""
    for line in text_lines(text.removeprefix(BYTE_ORDER_MARK)):
        marked = _MARK.match(line)
        side = "" if marked is None else HOST if marked[1] == ">" else DEVICE
        rest = line if marked is None else marked[2]
        can = _CAN.match(rest.strip())
        if can is not None:
            found.append(_can_frame(can, side))
        elif side:
            found.append(Given(_bytes_of(rest), side))
        else:
            plain += _bytes_of(_without_dump(rest))
    if plain:
        found.insert(0, Given(plain))
    if not found or not any(given.data or given.can_id is not None for given in found):
        raise UsageError("no bytes given", hint="write two hex digits per byte, such as `EB 90 01 04 11 E8 03 01 02`")
    return found


def _can_frame(match: re.Match[str], side: str) -> Given:
    can_id, data = int(match[1], 16), _bytes_of(match[3])
    announced = len(data) if match[2] is None else int(match[2])
    if can_id >= 1 << 29 or len(data) > 8 or announced != len(data):
        raise UsageError(
            f"{match[0].strip()!r} is not a CAN frame",
            hint="write a 29-bit identifier and up to 8 bytes, as many as announced: 11000001 [1] 04, or 11000001#04",
        )
    return Given(data, side, can_id)


def _without_dump(line: str) -> str:
    """A line of `xxd` or `hexdump -C` without its offset and its text column."""
    if _OFFSET_ONLY.match(line):
        return line
    match = _XXD.match(f"{line} ") or _HEXDUMP.match(line)
    return line if match is None else match[1]


def _bytes_of(text: str) -> bytes:
    cleaned = re.sub(r"\\x|\b0[xX]|[\s,;:_.{}\[\]()'\"-]|\bb(?=['\"])", " ", text)
    data = b""
    for word in cleaned.split():
        digits = word[:-1] if len(word) == 3 and word[-1] in "hH" else word
        digits = digits.zfill(2) if len(digits) == 1 else digits
        try:
            if not digits.isascii() or len(digits) % 2:
                raise ValueError(word)
            data += bytes.fromhex(digits)
        except ValueError as exc:
            raise UsageError(
                f"{word[:40]!r} is not hexadecimal bytes",
                hint="write two hex digits per byte, such as `EB 90 01`, `0xEB` or `\\xEB`",
            ) from exc
    return data
