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
from handctl.errors import NoAnswer, ProtocolError, UsageError
from handctl.link.link_interface import ByteLink, FrameLink
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
BROKEN = 0.05
"""Share of bytes with a framing error from which on a baud rate does not fit, whatever the bytes seem to say."""
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


LETTERS = bytes(range(32, 127)) + b"\t\r\n\0"
SPELLED = {byte: f"\\x{byte:02x}" for byte in range(256) if not 32 <= byte < 127} | {13: "\\r", 10: "\\n"}


def is_text(data: bytes) -> bool:
    """Whether bytes of no frame are text that a person can read, such as a banner."""
    return len(data) > 1 and not data.translate(None, LETTERS)


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
    return data.decode("latin-1").translate(SPELLED)


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
    """What was heard so far, and at which baud rate it made sense; on a CAN bus, at which bitrate whole frames came."""

    def __init__(self, run: Run, count: int | None, duration: float | None, *, find: bool) -> None:
        """Opens the link. Raises UsageError, LinkError."""
        self._run, self._most, self._find = run, count, find
        self._reader = Listener(run.family.kind)
        self._link = link = run.open_link(listening=find)
        self._can = link if isinstance(link, FrameLink) else None
        self.start, self._wall = link.now(), link.wall()
        self._seconds = min(end for end in (duration, run.settings.deadline, float("inf")) if end is not None)
        self._rate: int | None = getattr(link, "baud", None)
        self._rates = self._documented() if find else []
        self._counted = self._count()
        self._framing: Counter[int | None] = Counter()
        self._noisy: set[int] = set()
        self._since = self._last = 0.0
        self._silence, self._from = 0.0, 0.0
        self._rows = self._unknown = 0
        self._before: float | None = None
        self._kinds: Counter[str] = Counter()
        self._shares: dict[int | None, list[int]] = {}

    def _documented(self) -> list[int]:
        """The rates to try, that of the LINK first. Raises UsageError where the link has none, or cannot only listen."""
        from handctl.tools.family_probe import BITRATES, has_speed, probe_of

        if self._can is not None:
            given = self._can.bitrate or BITRATES[0]
            if self._can.only_listen(given) is None:
                socketcan = "set the interface itself: `sudo ip link set can0 type can bitrate N listen-only on`, while it is down"
                raise UsageError(
                    f"{self._link.name}: handctl cannot set the bitrate of this interface while it only listens",
                    hint=f"{socketcan if 'socketcan' in self._link.name else 'add ?bitrate=N to the LINK'}. Then leave out --find-baud",
                    code="no-listen-only",
                )
            self._rate = given
            return list(dict.fromkeys([given, *BITRATES]))
        if not has_speed(self._link):
            raise UsageError(
                f"{self._link.name}: the baud rate of this link cannot be set", hint="leave out --find-baud"
            )
        return list(dict.fromkeys([self._rate or 0, *probe_of(self._run.family.kind).SPEEDS]))

    def _count(self) -> int | None:
        """Framing errors of this port so far, None where they cannot be counted."""
        return self._link.framing_errors() if isinstance(self._link, ByteLink) else None

    def samples(self) -> Iterator[Sample]:
        """Each row as soon as it is complete. Raises NoAnswer if nothing came at all, ProtocolError if nothing but errors on the bus, LinkError when the link is lost."""
        try:
            yield from self._samples()
        finally:
            if self._rates and self._can is not None and self._run.session is not None:
                self._can.resume()  # other commands of a script or shell have this link after this one

    def _samples(self) -> Iterator[Sample]:
        run, link = self._run, self._link
        while (left := self.start + self._seconds - link.now()) > 0 and (self._most is None or self._rows < self._most):
            data, can_id = received(link, link.deadline(min(QUIET, left)))
            now = link.now() - self.start
            self._note_errors(silent=not data and can_id is None)
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
        if not any((*heard.count.values(), *heard.frames.values())) and not self._passed_over:
            if self._noisy:
                raise ProtocolError(
                    f"{link.name}: errors on the bus and not one whole frame, at {', '.join(map(str, sorted(self._noisy)))} bit/s",
                    hint="a device alone on a bus is acknowledged by nobody, so it is only heard without --find-baud, at its own bitrate (?bitrate=N). "
                    "Otherwise check the termination (120 ohm at both ends), CAN high and CAN low",
                    code="bus-errors",
                )
            raise NoAnswer(
                f"{link.name}: nothing was heard in {link.now() - self.start:.1f} s{self._place}",
                hint="many devices only speak when asked, or at power-on: power-cycle it while `listen` runs. "
                "`terminal` sends bytes, `scan` detects the device",
                code="nothing-heard",
            )

    @property
    def _place(self) -> str:
        settable = getattr(self._link, "can_set_baud", False) or (self._can is not None and self._rates)
        return f" at {self._rate} bit/s" if self._rate and settable else ""

    @property
    def _passed_over(self) -> int:
        return self._can.passed_over if self._can is not None else 0

    def _note_errors(self, *, silent: bool) -> None:
        """What the hardware says of the present rate: framing errors of a port, and in a silence of a bus that is searched its errors."""
        if (counted := self._count()) is not None:
            self._framing[self._rate] += counted - (self._counted or 0)
            self._counted = counted
        if silent and self._find and self._can is not None and self._can.bus_errors():
            self._noisy.add(self._rate or 0)

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
                share = self._shares.setdefault(self._rate, [0, 0])
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
        """Stay at a rate that fits; else go on to the next one when its time is over, or what comes makes no sense."""
        good, total = self._shares.get(self._rate, (0, 0))
        broken = self._framing[self._rate] > BROKEN * max(total, ENOUGH)
        if self._can is not None and (good or self._passed_over):  # a frame has a checksum: one is enough
            self._found(f"whole frames come at {self._rate} bit/s", f"add ?bitrate={self._rate} to the LINK")
        elif total >= ENOUGH and good >= FITS * total and not broken:
            self._found(f"{good} of {total} bytes make sense at {self._rate} bit/s", f"use --baud {self._rate}")
        elif now - self._since >= DWELL or total >= 4 * ENOUGH or broken or self._rate in self._noisy:
            self._since = now
            return self._reader.take(Entry(now, "!", b"", self._next_rate()))
        return []

    def _found(self, text: str, hint: str) -> None:
        self._find = False
        self._run.journal.info("baud-found", f"{self._link.name}: {text}", hint)

    def _next_rate(self) -> str:
        """Go on to the next rate that this end has; the event in words. What was heard at it before is forgotten."""
        at = self._rates.index(self._rate or 0) + 1
        following = [*self._rates[at:], *self._rates[:at]]  # the present one comes last: this end has it
        rate = next((rate for rate in following if self._can is None or self._can.only_listen(rate)), following[-1])
        self._rate = rate
        self._shares.pop(rate, None)
        self._framing.pop(rate, None)
        if self._can is None:
            self._link.set_baud(rate)  # type: ignore[attr-defined]
            return f"baud {rate}"
        self._link.event(f"bitrate {rate}")
        return f"bitrate {rate}"

    def _judge(self) -> None:
        """Say so where hardly anything of what came makes sense, and what the port itself says of its baud rate."""
        good, total = self._shares.get(self._rate, (0, 0))
        if self._can is None and total >= ENOUGH and good < GARBAGE * total:
            text = f"{self._link.name}: only {good} of {total} bytes make sense{self._place}{self._framed}"
            hint = (
                "add --find-baud to try the documented baud rates"
                if self._place and not self._find
                else "check family, cable and ground"
            )
            self._run.journal.warn("garbage", text, hint)

    @property
    def _framed(self) -> str:
        """How many framing errors the port has counted at this baud rate, or that it cannot count them."""
        if not self._place:
            return ""
        if self._counted is None:
            return ". This port does not count framing errors"
        return f", with {plural(self._framing[self._rate], 'framing error')}"

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
                {"baud": rate, "bytes": size, "good": good, "framing_errors": self._framing[rate] if self._counted is not None else None}
                for rate, (good, size) in self._shares.items()
                if rate and self._can is None
            ],
        }  # fmt: skip
        if self._can is not None:
            result["error_frames"] = self._can.error_frames
            if self._rates:
                result["bitrate"] = None if self._find else self._rate
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
        for row in heard["bauds"] if self._rates else ():
            framing = "" if row["framing_errors"] is None else f", {plural(row['framing_errors'], 'framing error')}"
            yield f"{row['baud']:<10} {row['good']} of {plural(row['bytes'], 'byte')} make sense{framing}"
        if self._rates and self._can is None and self._counted is None:
            yield "framing    this port does not count framing errors"


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
