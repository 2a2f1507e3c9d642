"""`listen` of every family: a record of what a device says by itself, in words. It sends nothing, and knows no family.

It opens the link and never the device, so it cannot ask anything. The family's explainer says what the bytes mean. The lock is
held, so a stop that another handctl command asks for goes out on this link.
"""

from __future__ import annotations

import shutil
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from handctl.command.terminal_prompts import is_terminal
from handctl.errors import NoAnswer, UsageError
from handctl.link.link_interface import FrameLink
from handctl.link.transcript import DIRECTIONS, Entry
from handctl.model.explainer import HOST, ExplainedBytes
from handctl.model.result import Column, Row, Sample, Table
from handctl.model.sampling import started
from handctl.tools.trace_reader import INDENT, Stamp, TranscriptReader, TranscriptRow, laid_out
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.command.run import Run
    from handctl.link import Deadline, Link

QUIET = 0.5
"""Seconds of silence after which bytes that are not complete are shown as they are."""
DWELL = 3.0
"""Seconds at one baud rate while the right one is being looked for."""
ENOUGH = 16
"""Bytes from which on the share of those that make sense says something about the baud rate."""
FITS, GARBAGE = 0.8, 0.5
"""Shares of bytes that make sense: from the one on a baud rate fits, below the other it does not."""
LINES, MARGIN = 3, 40
"""Lines of a terminal that a meaning takes at the most, and columns that are counted on for it."""
LISTED = 12
"""Kinds of frames that the summary shows."""
COLUMNS = (
    Column("direction"),
    Column("kind"),
    Column("gap", right=True, unit="s"),
    Column("problem"),
    Column("bytes"),
    Column("meaning"),
)


def received(link: Link, deadline: Deadline) -> tuple[bytes, int | None]:
    """What comes next, and its CAN identifier where it is a frame; b"" on silence until `deadline`."""
    if not isinstance(link, FrameLink):
        return link.read(deadline), None  # type: ignore[attr-defined]
    frame = link.receive(deadline)
    return (b"", None) if frame is None else (frame.data, frame.can_id)


def is_text(data: bytes) -> bool:
    """Whether bytes of no frame are text that a person can read, such as a banner."""
    return len(data) > 1 and all(32 <= byte < 127 or byte in b"\t\r\n\0" for byte in data)


def row_of(told: TranscriptRow, before: float | None) -> Row:
    """A row for scripts; `before` is when the one before it ended."""
    row = told.as_row()
    for key in ("line", "request_line"):
        row.pop(key, None)
    if told.unanswered is not None:
        row["meaning"] = f"no reply to: {told.unanswered.meaning}"
    piece = told.piece
    if piece is not None and not piece.frame and is_text(piece.raw):
        row |= {
            "kind": "text",
            "problem": None,
            "meaning": " | ".join(piece.raw.decode().replace("\0", "").split("\r")).strip(),
        }
    if told.first.t is not None and before is not None:
        row["gap"] = round(max(0.0, told.first.t - before), 6)
    return row


def shown_as_text(data: bytes) -> str:
    """Bytes as a person types them: ``FGET P\\r``."""
    return "".join(
        chr(byte) if 32 <= byte < 127 else {13: "\\r", 10: "\\n"}.get(byte, f"\\x{byte:02x}") for byte in data
    )


def line_of(row: Row, width: int | None, *, as_hex: bool = False) -> str:
    """The same for a person, on a terminal in a few lines; bytes that are text as text, unless `as_hex`."""
    mark = next(
        (mark for mark, side in DIRECTIONS.items() if side == row["direction"]), "!" if row["kind"] == "event" else " "
    )
    trip = f"+{row['round_trip_ms']:.3f} ms" if "round_trip_ms" in row else ""
    head = f"{row.get('t') or 0.0:11.6f} {mark}{'*' if row['problem'] else ' '}{trip:>11} "
    meaning, data, room = row["meaning"], row["bytes"], max((width or 0) - INDENT, MARGIN)
    if width is not None and len(meaning) > LINES * room:
        meaning = f"{meaning[: LINES * room - 2]} …"
    if not as_hex and not data.startswith("can ") and is_text(raw := bytes.fromhex(data)):
        data = shown_as_text(raw)
        tail = f" … ({plural(len(raw), 'byte')})"
        data = data if width is None or len(data) <= room else data[: room - len(tail)] + tail
    return laid_out(head, meaning, data, width)


def width_of(run: Run) -> int | None:
    """Columns of the terminal that the result goes to, None for a pipe or a file."""
    return shutil.get_terminal_size().columns if is_terminal(sys.stdout) and not run.settings.output else None


class Listener(TranscriptReader):
    """Rows of a line on which nothing of ours goes out: no reply is missing, and what has the shape of a request comes from another program."""

    def _pieces(self, pieces: Iterable[ExplainedBytes], stamp: Stamp | None = None) -> list[TranscriptRow]:
        found = []
        for piece in pieces:
            first, last = (stamp, stamp) if stamp is not None else self._span(piece)
            asked = self._explainer.feed(HOST, piece.raw, piece.can_id) if piece.problem == "echo" else []
            found.append(TranscriptRow(first, last, asked[0] if len(asked) == 1 else piece))
        return found


class Record:
    """What was heard so far, and at which baud rate it made sense."""

    def __init__(self, run: Run, count: int | None, duration: float | None, *, find: bool) -> None:
        """Opens the link. Raises UsageError, LinkError."""
        self._run, self._most, self._find = run, count, find
        assert run.family is not None
        self._reader = Listener(run.family.kind)
        self._link = link = run.open_link()
        self.start, self._wall = link.now(), link.wall()
        self._seconds = min(end for end in (duration, run.settings.deadline, float("inf")) if end is not None)
        self._bauds = self._documented() if find else []
        self._since = self._last = 0.0
        self._silence, self._from = 0.0, 0.0
        self._rows = self._unknown = 0
        self._before: float | None = None
        self._kinds: Counter[str] = Counter()
        self._shares: dict[int | None, list[int]] = {}

    def _documented(self) -> list[int]:
        """The baud rates to try, that of the port first. Raises UsageError where the link has none."""
        from handctl.tools.family_probe import has_speed, probe_of

        assert self._run.family is not None
        if not has_speed(self._link):
            raise UsageError(
                f"{self._link.name}: the baud rate of this link cannot be set", hint="leave out --find-baud"
            )
        return list(dict.fromkeys([self._baud or 0, *probe_of(self._run.family.kind).SPEEDS]))

    @property
    def _baud(self) -> int | None:
        return getattr(self._link, "baud", None)

    def samples(self) -> Iterator[Sample]:
        """Each row as soon as it is complete. Raises NoAnswer if nothing came at all, LinkError when the link is lost."""
        run, link = self._run, self._link
        while (left := self.start + self._seconds - link.now()) > 0 and (self._most is None or self._rows < self._most):
            data, can_id = received(link, link.deadline(min(QUIET, left)))
            now = link.now() - self.start
            if data or can_id is not None:
                self._heard(now)
                told = self._reader.take(Entry(now, "<", data, "", can_id))
            else:
                told = self._reader.over()
                run.prompts.progress(
                    f"{plural(self._rows, 'row')}, {now:.0f} s. Listening{self._place}.", "Ctrl-C ends."
                )
            yield from self._noted(now, told)
            if self._find and (turned := self._turned(now)):
                yield from self._noted(now, turned)
            if link.over and not data:
                break
        yield from self._noted(link.now() - self.start, self._reader.over())
        run.prompts.done()
        heard = self._reader.statistics
        if not any((*heard.count.values(), *heard.frames.values())):
            raise NoAnswer(
                f"{link.name}: nothing was heard in {link.now() - self.start:.1f} s{self._place}",
                hint="many devices only speak when asked, or at power-on: power-cycle it while `listen` runs. "
                "`terminal` sends bytes, `scan` detects the device",
                code="nothing-heard",
            )

    @property
    def _place(self) -> str:
        baud = self._baud
        return f" at {baud} bit/s" if baud and getattr(self._link, "can_set_baud", False) else ""

    def _heard(self, now: float) -> None:
        if now - self._last > self._silence:
            self._silence, self._from = now - self._last, self._last
        self._last = now

    def _noted(self, now: float, told: list[TranscriptRow]) -> Iterator[Sample]:
        """Count and show these, as many as are wanted."""
        rows: list[Row] = []
        for one in told[: None if self._most is None else self._most - self._rows]:
            rows.append(row_of(one, self._before))
            self._before = one.last.t
            if (piece := one.piece) is not None:
                size, makes_sense = len(piece.raw), rows[-1]["kind"] != "stray"
                share = self._shares.setdefault(self._baud, [0, 0])
                share[0] += size * makes_sense
                share[1] += size
                self._unknown += size * (not makes_sense)
                if makes_sense:
                    name = (piece.title or piece.meaning.partition(" = ")[0]) if piece.frame else "text"
                    self._kinds[f"another program: {name}" if piece.direction == HOST else name] += 1
        self._rows += len(rows)
        if rows:
            self._run.prompts.done()
            yield Sample(rows[0].get("t", now), tuple(rows), self._wall + now)

    # -- the baud rate ------------------------------------------------------------------------------------------------

    def _turned(self, now: float) -> list[TranscriptRow]:
        """Stay at a baud rate that fits; else go on to the next one when its time is over, or what comes makes no sense."""
        good, total = self._shares.get(self._baud, (0, 0))
        if total >= ENOUGH and good >= FITS * total:
            self._find = False
            self._run.journal.info(
                "baud-found",
                f"{self._link.name}: {good} of {total} bytes make sense at {self._baud} bit/s",
                f"use --baud {self._baud}",
            )
        elif now - self._since >= DWELL or total >= 4 * ENOUGH:
            self._since = now
            baud = self._bauds[(self._bauds.index(self._baud or 0) + 1) % len(self._bauds)]
            self._shares.pop(baud, None)
            self._link.set_baud(baud)  # type: ignore[attr-defined]
            return self._reader.take(Entry(now, "!", b"", f"baud {baud}"))
        return []

    def _judge(self) -> None:
        """Say so where hardly anything of what came makes sense."""
        good, total = self._shares.get(self._baud, (0, 0))
        if total >= ENOUGH and good < GARBAGE * total:
            text = f"{self._link.name}: only {good} of {total} bytes make sense{self._place}"
            hint = (
                "add --find-baud to try the documented baud rates"
                if self._place and not self._find
                else "check family, cable and ground"
            )
            self._run.journal.warn("garbage", text, hint)

    # -- the summary --------------------------------------------------------------------------------------------------

    def summary(self) -> dict[str, Any]:
        """For the closing envelope."""
        self._judge()
        self._heard(self._link.now() - self.start)
        self.result = result = {
            "seconds": round(self._last, 3),
            **self._amounts(),
            "unknown_bytes": self._unknown,
            "longest_silence": round(self._silence, 3),
            "silence_from": round(self._from, 3),
            "kinds": dict(self._kinds.most_common()),
            "bauds": [
                {"baud": rate, "bytes": size, "good": good} for rate, (good, size) in self._shares.items() if rate
            ],
        }
        if isinstance(self._link, FrameLink):
            result["error_frames"] = self._link.error_frames
        return {**started(self._wall), "statistics": result}

    def _amounts(self) -> dict[str, Any]:
        """Bytes and frames, and the rate of both from the first byte to the last."""
        found = self._reader.statistics
        amounts = {"bytes": sum(found.count.values()), "frames": sum(found.frames.values())}
        seconds, count = found.seconds, self._rows  # the time of n rows is that of n - 1 periods
        rates = {
            f"{name}_per_second": round(size * (count - 1) / count / seconds, 1) if seconds and count > 1 else None
            for name, size in amounts.items()
        }
        return {**amounts, **rates}

    def closing(self) -> Iterator[str]:
        """The same for people."""
        heard = self.result
        rate = [f", {heard[key]:g}/s" if heard[key] else "" for key in ("bytes_per_second", "frames_per_second")]
        yield ""
        yield f"heard      {plural(heard['bytes'], 'byte')}{rate[0]}, in {heard['seconds']:.1f} s{', simulated' if self._run.simulated else ''}"
        yield f"frames     {heard['frames']}{rate[1]}"
        for name, count in self._kinds.most_common(LISTED):
            yield f"           {count} x {name}"
        if len(self._kinds) > LISTED:
            yield f"           and {plural(len(self._kinds) - LISTED, 'more kind')}"
        yield f"unknown    {plural(heard['unknown_bytes'], 'byte')}"
        if heard.get("error_frames"):
            yield f"errors     {plural(heard['error_frames'], 'error frame')} on the CAN bus"
        yield f"silence    {heard['longest_silence']:.3f} s at most, from {heard['silence_from']:.3f} s on"
        for row in heard["bauds"] if self._bauds else ():
            yield f"{row['baud']:<10} {row['good']} of {plural(row['bytes'], 'byte')} make sense"


def listen(run: Run, count: int | None, duration: float | None, *, find_baud: bool) -> Table:
    """The record as a stream of rows."""
    record, width = Record(run, count, duration, find=find_baud), width_of(run)
    return Table(
        columns=COLUMNS,
        samples=record.samples(),
        summary=record.summary,
        line=lambda row: line_of(row, width),
        closing=record.closing,
        live=False,
    )
