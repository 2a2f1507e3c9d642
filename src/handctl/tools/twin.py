"""`handctl twin check`: plays a recorded conversation to simulators in this process, and compares the answers. Knows no family.

What the host sent goes to a simulator frame by frame, at its time, on virtual time. It never goes to a device: `simulated` refuses
any LINK but a simulator of this process.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import closing
from typing import Any

import click

from handctl.command.command_tree import Group
from handctl.command.options import InFile
from handctl.command.run import Run
from handctl.errors import CheckFailed, LinkError, UsageError
from handctl.fast_classes import fast_dataclass, field
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, Link, open_link
from handctl.link.fake import FakeLink, split_url
from handctl.link.transcript import Entry
from handctl.link.twin_values import values_of
from handctl.model.explainer import DEVICE, ExplainedBytes
from handctl.model.facts_file import read as read_facts
from handctl.model.result import Cell, Column, Grid, RoundTrips, Row, Table
from handctl.tools.trace import MOST_DIFFERENCES, Exchange, changes, compare, exchanges, family_option
from handctl.tools.trace_reader import CASE, TranscriptLine, TranscriptReader, TranscriptRow, chosen, lines_of, opened
from handctl.wording import some

SIMULATOR = "fake://"
PATIENCE = 2.0
"""Seconds that an answer may come later than the recorded one came. Virtual: they cost nothing."""
ROUNDED = 2e-6
"""Seconds by which two recorded moments may be off: they have six decimals."""
EQUAL, VALUES, RATE, FORM, NONE, EXTRA = "equal", "values", "rate", "form", "no_answer", "unexpected"
WORDS = {
    EQUAL: "equal", VALUES: "only values differ", RATE: "different rate", FORM: "different form", NONE: "missing reply", EXTRA: "unexpected reply",
}  # fmt: skip
MOST_FORMS = 50
"""Forms of the data of a stream that are kept."""
CLOSE = 0.1
"""Share by which the rates of a stream may differ and count as equal."""
SHOWN, SHOWN_VALUES = 20, 4
"""Differences that a person is shown, and values of each."""

cli = Group("twin", help="Compare the simulator of one particular device with its recording.")


def simulated(link: str, family: str, wire: str) -> str:
    """The LINK of a simulator in this process, on virtual time and the recorded `wire` ("" = serial). Raises UsageError for anything else.

    A transcript can hold movements and saves, so it must never reach a device by accident.
    """
    kind, options = split_url(link) if link.startswith(SIMULATOR) else ("", {})
    if kind != family:
        raise UsageError(
            f"{link}: not a simulator of {family} in this process. A recorded conversation is never sent to a device",
            hint=f"give {SIMULATOR}{family}, with options if needed",
            code="not-simulated",
        )
    from urllib.parse import quote

    options |= {"clock": "virtual"} | ({"bus": wire} if wire else {})
    options |= {"save": "never"} if "state" in options else {}

    return f"{SIMULATOR}{kind}?{'&'.join(f'{name}={quote(value)}' for name, value in options.items())}"


# -- playing ----------------------------------------------------------------------------------------------------------


class Player:
    """Sends the host's part of a recording to a simulator, and gives the conversation that results, as `--trace` would."""

    def __init__(self, link: Link, family: str, answered: Iterable[int], seconds: float) -> None:
        """`answered`: lines of the requests that the recorded device answered. The recording lasts `seconds`."""
        self.reader = TranscriptReader(family)
        self._link = link
        self._answered = set(answered)
        self._seconds = seconds
        self._start = link.now()
        self._late = 0.0  # by how much it is behind the recording, because an answer came later
        self._lost = False
        if isinstance(link, FakeLink) and link.speed is not None:  # who was understood spoke at the device's speed
            link.set_baud(link.speed)

    def rows(self, recorded: Iterable[TranscriptLine]) -> Iterator[TranscriptRow]:
        """What `trace show` would show of it."""
        return self.reader.tell(self._lines(recorded))

    def _lines(self, recorded: Iterable[TranscriptLine]) -> Iterator[TranscriptLine]:
        for line in recorded:
            entry = line.entry
            if entry is None:
                yield from [line] if line.comment.startswith(CASE) else ()
                continue
            if entry.mark == "<":
                continue
            if entry.text.startswith("baud"):  # what is not here by then comes at the new speed
                yield from self._heard((entry.time or 0.0) + self._late + ROUNDED)
            else:
                yield from self._until(entry.time)
            if entry.mark == "!":
                self._event(entry.text)
                yield line
            elif not self._lost:
                yield TranscriptLine(line.number, entry._replace(time=self._now))
                self._send(entry)
        yield from self._until(self._seconds)

    @property
    def _now(self) -> float:
        return self._link.now() - self._start

    def _until(self, moment: float | None) -> Iterator[TranscriptLine]:
        """What comes until this moment of the recording, and until what was answered by then is answered here, too."""
        due = self._now if moment is None else moment + self._late
        yield from self._heard(due)
        while not self._lost and (open_lines := self.reader.open_lines & self._answered):
            before = self._now
            yield from self._heard(due + PATIENCE, one=True)
            if self._now >= due + PATIENCE or self._now == before:
                self._answered -= open_lines
        if moment is not None:
            self._late = max(self._late, self._now - moment)

    def _heard(self, until: float, *, one: bool = False) -> Iterator[TranscriptLine]:
        """What comes until then, or the next `one` of it."""
        deadline = Deadline(self._link.now, self._start + until)
        while not self._lost:
            try:
                came: Any = self._link.read(deadline) if isinstance(self._link, ByteLink) else None
                came = self._link.receive(deadline) if isinstance(self._link, FrameLink) else came
            except LinkError:
                self._lost = True
                yield TranscriptLine(0, Entry(self._now, "!", b"", "disconnect"))
                return
            if not came:
                return
            can_id, data = (came.can_id, came.data) if isinstance(came, CanFrame) else (None, came)
            yield TranscriptLine(0, Entry(self._now, "<", data, "", can_id))
            if one:
                return

    def _send(self, entry: Entry) -> None:
        deadline = Deadline(self._link.now, float("inf"))
        try:
            if isinstance(self._link, FrameLink) and entry.can_id is not None:
                self._link.send(CanFrame(entry.can_id, entry.data), deadline)
            elif isinstance(self._link, ByteLink):
                self._link.write(entry.data, deadline)
        except LinkError:
            self._lost = True

    def _event(self, text: str) -> None:
        """What happened to the recorded line happens to this one."""
        word, _, number = text.partition(" ")
        if word == "power-cycle":
            self._link.power_cycle()
        elif word == "baud" and number.isdecimal() and isinstance(self._link, ByteLink):
            self._link.set_baud(int(number))


# -- comparing --------------------------------------------------------------------------------------------------------


@fast_dataclass()
class Stream:
    """Data of one kind that came without a request: how often, in which forms, and from when to when."""

    count: int = 0
    forms: set[object] = field(default_factory=set)
    first: float | None = None
    last: float | None = None

    @property
    def rate(self) -> float | None:
        """Per second."""
        if self.first is None or self.last is None or self.last <= self.first:
            return None
        return (self.count - 1) / (self.last - self.first)

    def verdict(self, other: Stream) -> str:
        """How another one compares: by its forms, then by its rate, or by its count where there are few."""
        if not self.count or not other.count:
            return NONE if self.count else EXTRA
        if not self.forms & other.forms:
            return FORM
        a, b = (self.rate, other.rate) if min(self.count, other.count) > 9 else (self.count, other.count)
        return EQUAL if a is not None and b is not None and abs(a - b) <= CLOSE * max(a, b) else RATE


def asked(rows: Iterable[TranscriptRow], streams: dict[str, Stream]) -> Iterator[TranscriptRow]:
    """The rows without what came unasked, which goes to `streams` by its form."""
    for row in rows:
        if row.piece is None or row.piece.direction != DEVICE or row.request is not None:
            yield row
            continue
        title, form = form_of(row.piece)
        stream = streams.setdefault(title, Stream())
        stream.count += 1
        if len(stream.forms) < MOST_FORMS:
            stream.forms.add(form)
        stream.first, stream.last = row.last.t if stream.first is None else stream.first, row.last.t


_NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")


def form_of(piece: ExplainedBytes) -> tuple[str, object]:
    """An answer without its values: its title, what is wrong with it and what it holds; and its bytes, of text without numbers."""
    title = piece.title or _NUMBER.sub("#", piece.meaning.partition(" = ")[0])
    text = piece.raw.decode("ascii", "replace")
    plain = text.isascii() and all(letter.isprintable() or letter in "\r\n\t\0" for letter in text)
    names = ", ".join(value.name for value in piece.values)
    return f"{title}{f' ({piece.problem})' if piece.problem else ''}: {names}", (
        _NUMBER.sub("#", text) if plain else len(piece.raw)
    )


def verdict(recorded: ExplainedBytes | None, here: ExplainedBytes | None) -> str:
    """How the simulator's answer compares with the recorded one; "" where neither answers."""
    if recorded is None or here is None:
        return NONE if recorded is not None else EXTRA if here is not None else ""
    if recorded.raw == here.raw:
        return EQUAL
    differ = list(recorded.values) != list(here.values)
    return VALUES if differ and form_of(recorded) == form_of(here) else FORM


@fast_dataclass()
class Comparison:
    """How one simulator answered: exchanges by verdict, streams, reply times, and the differences."""

    name: str
    link: str
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(WORDS, 0))
    trips: RoundTrips = field(default_factory=RoundTrips)
    differences: list[Row] = field(default_factory=list)
    made: str = ""
    """What became of the facts and values."""

    def note(self, kind: str, row: Row) -> None:
        """One exchange or stream."""
        if not kind:
            return
        self.counts[kind] += 1
        if kind != EQUAL and len(self.differences) < MOST_DIFFERENCES:
            self.differences.append({"verdict": kind, **row})

    @property
    def share(self) -> float | None:
        """Equal answers of all; None where nothing was answered."""
        total = sum(self.counts.values())
        return self.counts[EQUAL] / total if total else None

    def row(self) -> Row:
        """Its row."""
        share = None if self.share is None else round(self.share, 4)
        return {"name": self.name, "link": self.link, "share": share, **self.counts, **timing(self.trips)}


def timing(trips: RoundTrips) -> Row:
    """Reply times in ms."""
    parts = (("median_ms", 0.5), ("p90_ms", 0.9))
    return {key: round(1000 * trips.quantile(part), 3) if len(trips) else None for key, part in parts}


class Recording:
    """A transcript that is read as often as it takes."""

    def __init__(self, path: str, family: str | None) -> None:
        """Raises UsageError for a file that is none, or of several devices."""
        self.path, self.wire = path, ""
        with opened(path) as file:
            self.family = chosen(lines_of(file, path), family or "", path)[0]
        self.reader = TranscriptReader(self.family)
        self.answered: list[int] = []
        for row in self.reader.tell(self.lines()):
            if row.piece is not None and not self.wire:
                self.wire = "can" if row.piece.can_id is not None else str(row.piece.fields.get("wire") or "")
            if row.request is not None:
                self.answered.append(row.request.line)
        if len(self.reader.statistics.families) > 1:
            raise UsageError(
                f"{path}: holds several devices", hint="give a transcript of one device", code="several-devices"
            )

    def lines(self) -> Iterator[TranscriptLine]:
        """From the beginning."""
        with opened(self.path) as file:
            yield from lines_of(file, self.path)

    def against(self, name: str, link: str, options: dict[str, str]) -> Comparison:
        """Play it to the simulator at `link`, and compare."""
        found = Comparison(name, link)
        ours: dict[str, Stream] = {}
        theirs: dict[str, Stream] = {}
        with closing(open_link(link, simulator=options)) as simulator:
            player = Player(simulator, self.family, self.answered, self.reader.statistics.end or 0.0)
            recorded = exchanges(asked(TranscriptReader(self.family).tell(self.lines()), ours))
            for step in compare(recorded, exchanges(asked(player.rows(self.lines()), theirs))):
                found.note(*_exchange(step.a, step.b))
            found.made = getattr(simulator, "twin", "")
        found.trips = player.reader.statistics.trips
        for title in {**ours, **theirs}:
            a, b = ours.get(title, Stream()), theirs.get(title, Stream())
            found.note(a.verdict(b), {"line": None, "name": title, "recorded": _rate(a), "here": _rate(b)})
        return found


def _exchange(recorded: Exchange | None, here: Exchange | None) -> tuple[str, Row]:
    """Verdict and row of one exchange. A request that only one side understood as one has no counterpart."""
    some = recorded or here
    assert some is not None
    kind = verdict(*(one.reply if one is not None else None for one in (recorded, here)))
    row: Row = {"line": some.line, "name": some.request}
    row |= {side: one.answer if one is not None else "" for side, one in (("recorded", recorded), ("here", here))}
    if kind == VALUES and recorded is not None and here is not None:
        row["changes"] = [
            dict(zip(("name", "recorded", "here"), each, strict=True)) for each in changes(recorded, here)
        ]
    return kind, row


def _rate(stream: Stream) -> str:
    return f"{stream.count} times" + (f", {stream.rate:.1f} Hz" if stream.rate is not None else "")


# -- the command ------------------------------------------------------------------------------------------------------


@cli.verb("check", offline=True)
@click.argument("transcript", type=InFile())
@click.option("--facts", type=InFile(), metavar="FILE", help="The facts of the twin (`handctl prove -o FILE`).")
@click.option(
    "--transcript", "values", type=InFile(), metavar="FILE",
    help="The transcript whose final values the twin shows (default: the initial values of TRANSCRIPT itself).",
)  # fmt: skip
@click.option(
    "--against", "base", metavar="LINK",
    help="The simulator, with options that both the simulator and the twin take, such as fake://hand?model=df (default: fake://FAMILY). Nothing but a simulator is accepted.",
)  # fmt: skip
@family_option
def check(
    run: Run, transcript: str, facts: str | None, values: str | None, base: str | None, family: str | None
) -> Table:
    """Play a recording to the twin of its device, and to the manual's simulator.

    The twin is the simulator with --facts and the values of a transcript. Each frame that the host sent goes to both, at its
    time, and their replies are compared with the recorded ones: equal, only values differ, different form, missing reply,
    unexpected reply. Unprompted data is compared by form and rate.

    Nothing is sent to a device. Exit code 7 means that the twin replies differently.
    """
    if "-" in (transcript, values):
        raise UsageError("a recording is read several times, so it cannot come from stdin", hint="give a file")
    family = family or (read_facts(facts)["family"] if facts is not None else None)
    recording = Recording(transcript, family)
    link = simulated(base or f"{SIMULATOR}{recording.family}", recording.family, recording.wire)
    known = {"values": values_of(recording.family, values or transcript, found=values is None)}
    known |= {"facts": facts} if facts is not None else {}
    twin, manual = (recording.against(*each) for each in (("twin", link, known), ("manual", link, {})))
    own: Row = {"name": "recording", "link": transcript, "share": None, **timing(recording.reader.statistics.trips)}
    table = Table(
        rows=[own, {**twin.row(), "differences": twin.differences}, manual.row()],
        columns=tuple(Column(key) for key in ("name", "share", *WORDS, "median_ms", "p90_ms")),
        view=lambda rows: [_side_by_side(rows), *_listed(twin)],
    )
    run.journal.info("twin", f"the twin has {twin.made}")
    if twin.share is None:
        run.journal.warn("nothing-answered", "neither the recorded device nor the twin replied to anything")
    elif twin.share < 1:
        told = ", ".join(f"{count} {WORDS[kind]}" for kind, count in twin.counts.items() if count)
        table.failure = CheckFailed(f"the twin replies differently: {told}", code="differ")
    return table


def _side_by_side(rows: list[Row]) -> Grid:
    def cell(row: Row, key: str) -> Cell | str:
        value = row.get(key, "")
        if key == "share" and value is not None:
            return Cell(f"{100 * value:.1f} %", "good" if value == 1 else "warn")
        return "–" if value is None else f"{value:g}" if isinstance(value, float) else str(value)

    titles = {
        "share": "equal replies",
        **WORDS,
        "median_ms": "reply time, median [ms]",
        "p90_ms": "reply time, 90 % below [ms]",
    }
    lines = tuple((title.capitalize(), *(cell(row, key) for row in rows)) for key, title in titles.items())
    return Grid(("", "Recording", "Twin", "Manual's simulator"), lines)


def _listed(twin: Comparison) -> list[Grid]:
    lines = tuple(
        (str(row["line"] or ""), WORDS[row["verdict"]], row["name"], _told(row, "recorded"), _told(row, "here"))
        for row in twin.differences[:SHOWN]
    )
    more = f", the first {SHOWN} of {len(twin.differences)}" if len(twin.differences) > SHOWN else ""
    title = f"Differences of the twin{more}"
    return [Grid(("Line", "Reply", "Request", "Recorded", "Twin"), lines, title)] if lines else []


def _told(row: Row, side: str) -> str:
    """An answer in words; of one whose values differ only those."""
    values = [f"{change['name']} {change[side]}" for change in row.get("changes", ())]
    return some(values, SHOWN_VALUES) or row[side] or "–"
