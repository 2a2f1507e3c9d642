"""`replay:FILE`: a transcript plays the device. Knows no protocol: it compares bytes.

Each recorded `>` is answered with the `<` lines that followed it, as long after it as they were recorded. A request is
looked up from where the last one was found, then from the start, so the same command gets the same course and a
repeated one gets an answer too: of a device that speaks unasked the latest, of others the first again.
What came before the first `>` was said unasked, and is again.
"""

from __future__ import annotations

import io
from collections import deque
from typing import NamedTuple

from handctl.errors import LinkError, UsageError
from handctl.files import opened
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, Link
from handctl.link.tap import Entry, parse


def open_replay(link: str, baud: int | None = None) -> Link:
    """The recorded device of `replay:FILE`, with serial bytes or with CAN frames. Raises UsageError."""
    path = link.removeprefix("replay:")
    try:
        with io.TextIOWrapper(opened(path, "a transcript"), "utf-8") as file:
            entries = parse(file, path)
    except (OSError, UnicodeDecodeError) as exc:
        why = exc.strerror if isinstance(exc, OSError) else "not a text file"
        raise UsageError(f"{link}: cannot read the transcript: {why}") from exc
    sent = [entry for entry in entries if entry.mark == ">"]
    if not sent and not any(entry.mark == "<" and entry.can_id is None for entry in entries):
        raise UsageError(f"{link}: the transcript holds no request (no line with >) and nothing that came unasked")
    return ReplayLink(link, entries, baud) if not sent or sent[0].can_id is None else ReplayFrames(link, entries)


Key = tuple[int | None, bytes]
"""A recorded line: CAN identifier (None for serial) and bytes."""
LOST: Key = (-1, b"")
"""Where `! disconnect` was recorded."""
Reply = tuple[float, Key]
"""What comes, and when: seconds after its request, or on the clock."""


class Exchange(NamedTuple):
    """A recorded request, the seconds since the one before it, and what followed."""

    request: Key
    pause: float
    replies: list[Reply]


class _Replayed(Link):
    """A recorded device, on virtual time: silence that was recorded costs nothing, and nothing comes before its time."""

    replayed = True

    def __init__(self, link: str, entries: list[Entry]) -> None:
        self.name = link
        unasked, self._exchanges = _exchanges(entries)
        self._cursor = 0
        self._clock = self._asked = 0.0
        self._incoming: deque[Reply] = deque(unasked)
        self._streams = any(key != LOST for _, key in unasked)

    def now(self) -> float:
        return self._clock

    def sleep(self, seconds: float) -> None:
        self._clock += max(0.0, seconds)

    def _ask(self, key: Key, text: str) -> None:
        count = len(self._exchanges)
        for step in range(count):
            index = (self._cursor + step) % count
            exchange = self._exchanges[index]
            if exchange.request != key:
                continue
            if index < self._cursor and self._streams and self._exchanges[self._cursor - 1].request == key:
                exchange = self._exchanges[self._cursor - 1]  # once more than recorded: it goes on saying the same
            else:
                self._cursor = index + 1
            if step == 0:  # the course that was recorded: as much time passes as did then
                self._clock = max(self._clock, self._asked + exchange.pause)
            self._asked = self._clock
            self._incoming.extend((self._clock + delay, reply) for delay, reply in exchange.replies)
            return
        raise LinkError(
            f"{self.name}: this request was never recorded: {text}",
            hint="replay the command that was traced, with the same options; --trace FILE records one",
            code="replay-miss",
        )

    def _next(self, deadline: Deadline) -> Key | None:
        """What comes next, the clock then; None when nothing comes before `deadline`."""
        if not self._incoming and self._streams and self._cursor < len(self._exchanges):
            self._go_on(self._exchanges[self._cursor], deadline)
        if self._incoming and self._incoming[0][0] <= max(self._clock, deadline.at):
            moment, key = self._incoming.popleft()
            self._clock = max(self._clock, moment)
            if key == LOST:
                raise LinkError(
                    f"{self.name}: the link is lost here, as it was when this was recorded",
                    hint="the transcript ends with it; the cable or the adapter was at fault then",
                    code="lost",
                )
            return key
        if deadline.at != float("inf"):
            self._clock = max(self._clock, deadline.at)
        return None

    def _go_on(self, exchange: Exchange, deadline: Deadline) -> None:
        """A device that speaks unasked does so at its time, also where the next recorded request stays away."""
        asked = self._asked + exchange.pause
        if exchange.replies and asked + exchange.replies[0][0] <= deadline.at:
            self._asked, self._cursor = asked, self._cursor + 1
            self._incoming.extend((asked + delay, reply) for delay, reply in exchange.replies)

    def close(self) -> None:
        self._incoming.clear()


class ReplayLink(_Replayed, ByteLink):
    """A recorded serial line."""

    def __init__(self, link: str, entries: list[Entry], baud: int | None = None) -> None:
        super().__init__(link, entries)
        self.baud = baud

    def write(self, data: bytes, deadline: Deadline) -> None:
        self._ask((None, data), data.hex(" ").upper())

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        key = self._next(deadline)
        if key is None:
            return b""
        data = key[1]
        if len(data) > size:
            self._incoming.appendleft((self._clock, (None, data[size:])))
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


def _exchanges(entries: list[Entry]) -> tuple[list[Reply], list[Exchange]]:
    """What came unasked, and each request with what followed it. Lines without a time come at once."""
    unasked: list[Reply] = []
    exchanges: list[Exchange] = []
    start = 0.0
    for entry in entries:
        if entry.mark == ">":
            before, start = start, entry.time or 0.0
            exchanges.append(Exchange((entry.can_id, entry.data), max(0.0, start - before), []))
        elif entry.mark == "<" or entry.text == "disconnect":
            delay = max(0.0, entry.time - start) if entry.time is not None else 0.0
            replies = exchanges[-1].replies if exchanges else unasked
            replies.append((delay, (entry.can_id, entry.data) if entry.mark == "<" else LOST))
    return unasked, exchanges
