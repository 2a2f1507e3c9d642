"""`replay:FILE`: a transcript plays the device. Knows no protocol: it compares bytes.

Each recorded `>` is answered with the `<` lines that followed it, as long after it as they were recorded. A request is
looked up from where the last one was found, then from the start, so the same command gets the same course and a
repeated one gets an answer too: of a device that speaks unasked the latest, of others the first again.
What came before the first `>` was said unasked, and is again.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from typing import BinaryIO

from handctl.errors import LinkError, UsageError
from handctl.files import transcript
from handctl.link.link_interface import ByteLink, CanFrame, Deadline, FrameLink, Link, unsent
from handctl.link.transcript import Entry, parse_line
from handctl.system import clock

LONGEST_LINE = 1 << 20


def open_replay(link: str, baud: int | None = None) -> Link:
    """The recorded device of `replay:FILE`, with serial bytes or with CAN frames. FILE may be a report. Raises UsageError."""
    path = link.removeprefix("replay:")
    recording = Recording(transcript(path), path)
    if not len(recording) and not recording.speaks:
        recording.close()
        raise UsageError(
            f"{link}: the transcript contains neither a request (a line with >) nor data that came without one",
            hint="record one with --trace FILE",
        )
    return ReplayFrames(link, recording) if recording.can else ReplayLink(link, recording, baud)


Key = tuple[int | None, bytes]
"""A recorded line: CAN identifier (None for serial) and bytes."""
BLANK = (b"\n", b"\r\n")
"""Lines that are passed over without a look: a file may have a million of them."""
LEFT_OUT = " left out"
"""The end of a comment of a report in place of bytes."""
LOST: Key = (-1, b"")
"""Where `! disconnect` was recorded."""
Reply = tuple[float, Key]
"""What comes, and when: seconds after its request, or on the clock."""


class Recording:
    """The exchanges of a transcript: the position of each request, and the data after it, read on demand.

    So a recording of hours needs little memory. Reads the file through once; raises UsageError for a damaged line, and
    LinkError for a report that does not have what the device sent.
    """

    _left_out = False
    """Whether a comment stands where the device sent something."""

    def __init__(self, file: BinaryIO, source: str) -> None:
        self._file = file
        self._source = source
        self._places = array("Q")  # where the line of each request begins
        self._hashes = array("q")  # of each request
        self.can = False
        """Whether the first line is a frame on CAN."""
        self.speaks = False
        """Whether the device said anything before the first request."""
        for place, entry in self._entries(0):
            self.can = self.can or (not (len(self) or self.speaks) and entry.can_id is not None)
            if entry.mark == ">":
                self._places.append(place)
                self._hashes.append(hash((entry.can_id, entry.data)))
            elif entry.mark == "<" and not len(self):
                self.speaks = True
        if self._left_out:
            raise LinkError(
                f"{source}: a report without what the device sent, because that holds its ids",
                hint="make the report with --include-ids to play it",
                code="left-out",
            )

    def __len__(self) -> int:
        return len(self._places)

    def find(self, request: Key, start: int) -> int | None:
        """The index of this request, looked for from `start` on, then from the beginning; None = never recorded."""
        wanted = hash(request)
        for first, last in ((start, len(self)), (0, start)):
            with suppress(ValueError):
                return self._hashes.index(wanted, first, last)
        return None

    def is_request_at(self, index: int, request: Key) -> bool:
        """Whether the request with this index is this one."""
        return index < len(self) and self._hashes[index] == hash(request)

    def pause(self, index: int) -> float:
        """Seconds from the request before to this one."""
        return max(0.0, self._time(index) - self._time(index - 1))

    def _time(self, index: int) -> float:
        """When a request was asked, 0 for that before the first."""
        return next(self._entries(self._places[index]))[1].time or 0.0 if index >= 0 else 0.0

    def replies(self, index: int) -> Iterator[Reply]:
        """The data after a request, -1 = before the first. Lines without a time arrive at once."""
        start, entries = 0.0, self._entries(self._places[index] if index >= 0 else 0)
        if index >= 0:
            start = next(entries)[1].time or 0.0
        for _, entry in entries:
            if entry.mark == ">":
                return
            if entry.mark == "<" or entry.text == "disconnect":
                delay = max(0.0, entry.time - start) if entry.time is not None else 0.0
                yield delay, (entry.can_id, entry.data) if entry.mark == "<" else LOST

    def _entries(self, place: int) -> Iterator[tuple[int, Entry]]:
        """(where its line begins, entry) of each entry from `place` on."""
        while True:
            self._file.seek(place)
            try:
                data = self._file.readline(LONGEST_LINE)
                while data in BLANK:
                    place += len(data)
                    data = self._file.readline(LONGEST_LINE)
                line = data.decode("utf-8" if place else "utf-8-sig").strip()
            except (OSError, UnicodeDecodeError) as exc:
                why = exc.strerror if isinstance(exc, OSError) else "not a text in UTF-8"
                raise UsageError(
                    f"{self._source}: cannot be read: {why}", hint="give a file that --trace made"
                ) from exc
            if not data:
                return
            start, place = place, place + len(data)
            if not line.startswith("#"):
                if line:
                    yield start, self._parsed(line, start)
            elif line.endswith(LEFT_OUT):
                self._left_out |= " < " in line

    def _parsed(self, line: str, start: int) -> Entry:
        try:
            return parse_line(line, 0)
        except ValueError as exc:
            self._file.seek(0)
            ends = (self._file.read(min(LONGEST_LINE, start - at)).count(b"\n") for at in range(0, start, LONGEST_LINE))
            number = 1 + sum(ends)
            raise UsageError(f"{self._source}, line {number}: {exc}", hint="a line is: [SECONDS] > HEX BYTES") from exc

    def close(self) -> None:
        """The end of the file."""
        self._file.close()


class Incoming:
    """What is still to come, in order: the replies of the requests so far."""

    def __init__(self) -> None:
        self._sources: deque[Iterator[Reply]] = deque()
        self._ahead: deque[Reply] = deque()

    def add(self, replies: Iterator[Reply], clock: float) -> None:
        """Replies that come so many seconds after `clock`."""
        self._sources.append((clock + delay, key) for delay, key in replies)

    def put_back(self, reply: Reply) -> None:
        """What was taken and not used up."""
        self._ahead.appendleft(reply)

    def first(self) -> Reply | None:
        """The next one; it stays."""
        while not self._ahead and self._sources:
            reply = next(self._sources[0], None)
            if reply is None:
                self._sources.popleft()
            else:
                self._ahead.append(reply)
        return self._ahead[0] if self._ahead else None

    def take(self) -> Reply:
        return self._ahead.popleft()

    def clear(self) -> None:
        """Nothing comes any more."""
        self._sources.clear()
        self._ahead.clear()


class _Replayed(Link):
    """A recorded device, on virtual time: silence that was recorded costs nothing, and nothing comes before its time."""

    replayed = True

    def __init__(self, link: str, recording: Recording) -> None:
        self.name = link
        self._recording = recording
        self._cursor = 0
        self._clock = self._asked = 0.0
        self._began = clock.wall()
        self._incoming = Incoming()
        self._incoming.add(recording.replies(-1), 0.0)
        self._streams = recording.speaks

    @property
    def over(self) -> bool:  # type: ignore[override]
        """See Link."""
        goes_on = self._streams and self._cursor < len(self._recording)
        return self._incoming.first() is None and not goes_on

    def now(self) -> float:
        return self._clock

    def wall(self) -> float:
        return self._began + self._clock

    def sleep(self, seconds: float) -> None:
        self._clock += max(0.0, seconds)

    def is_next_recorded(self, request: bytes) -> bool:
        return self._recording.is_request_at(self._cursor, (None, request))

    def _ask(self, key: Key, text: str) -> None:
        index = found = self._recording.find(key, self._cursor)
        if found is None or index is None:
            first = self._incoming.first()
            raise unsent(self._lost()) if first is not None and first[1] == LOST else self._never(text)
        if found < self._cursor and self._streams and self._recording.find(key, self._cursor - 1) == self._cursor - 1:
            index = self._cursor - 1  # once more than recorded: it goes on saying the same
        else:
            if found == self._cursor:  # the course that was recorded: as much time passes as did then
                self._clock = max(self._clock, self._asked + self._recording.pause(index))
            self._cursor = index + 1
        self._asked = self._clock
        self._incoming.add(self._recording.replies(index), self._clock)

    def _lost(self) -> LinkError:
        return LinkError(
            f"{self.name}: the link is lost at this point, as in the recording",
            hint="check the cable and the adapter used for the recording",
            code="lost",
        )

    def _never(self, text: str) -> LinkError:
        return LinkError(
            f"{self.name}: this request was never recorded: {text}",
            hint="run the command that was recorded, with the same options, or record this one with --trace FILE",
            code="replay-miss",
        )

    def _next(self, deadline: Deadline) -> Key | None:
        """What comes next, the clock then; None when nothing comes before `deadline`."""
        if self._incoming.first() is None and self._streams and self._cursor < len(self._recording):
            self._go_on(deadline)
        first = self._incoming.first()
        if first is not None and first[0] <= max(self._clock, deadline.at):
            moment, key = self._incoming.take()
            self._clock = max(self._clock, moment)
            if key == LOST:
                raise self._lost()
            return key
        if deadline.at != float("inf"):
            self._clock = max(self._clock, deadline.at)
        return None

    def _go_on(self, deadline: Deadline) -> None:
        """A device that speaks unasked does so at its time, also where the next recorded request stays away."""
        index, asked = self._cursor, self._asked + self._recording.pause(self._cursor)
        first = next(self._recording.replies(index), None)
        if first is not None and asked + first[0] <= max(self._clock, deadline.at):
            self._asked, self._cursor = asked, index + 1
            self._incoming.add(self._recording.replies(index), asked)

    def close(self) -> None:
        self._incoming.clear()
        self._recording.close()


class ReplayLink(_Replayed, ByteLink):
    """A recorded serial line."""

    def __init__(self, link: str, recording: Recording, baud: int | None = None) -> None:
        super().__init__(link, recording)
        self.baud = baud

    def write(self, data: bytes, deadline: Deadline) -> None:
        self._ask((None, data), data.hex(" ").upper())

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        key = self._next(deadline)
        if key is None:
            return b""
        data = key[1]
        if len(data) > size:
            self._incoming.put_back((self._clock, (None, data[size:])))
        return data[:size]

    def set_baud(self, baud: int) -> None:
        self.baud = baud


class ReplayFrames(_Replayed, FrameLink):
    """A recorded CAN bus."""

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self._ask((frame.can_id, frame.data), str(frame))

    def receive(self, deadline: Deadline) -> CanFrame | None:
        key = self._next(deadline)
        return None if key is None else CanFrame(key[0] or 0, key[1])
