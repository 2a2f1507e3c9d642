"""`replay:FILE`: a transcript plays the device. Knows no protocol: it compares bytes.

Each recorded `>` is answered with the `<` lines that followed it. A request is looked up from where the last one was
found, then from the start, so the same command gets the same course and a repeated one gets an answer too.
"""

from __future__ import annotations

from handctl.errors import LinkError, UsageError
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, Link
from handctl.link.tap import Entry, parse


def open_replay(link: str, baud: int | None = None) -> Link:
    """The recorded device of `replay:FILE`, with serial bytes or with CAN frames. Raises UsageError."""
    path = link.removeprefix("replay:")
    try:
        with open(path, encoding="utf-8") as file:
            entries = parse(file, path)
    except (OSError, UnicodeDecodeError) as exc:
        why = exc.strerror if isinstance(exc, OSError) else "not a text file"
        raise UsageError(f"{link}: cannot read the transcript: {why}") from exc
    sent = [entry for entry in entries if entry.mark == ">"]
    if not sent:
        raise UsageError(f"{link}: the transcript holds no request (no line with >)")
    return ReplayLink(link, entries, baud) if sent[0].can_id is None else ReplayFrames(link, entries)


Key = tuple[int | None, bytes]
"""A recorded line: CAN identifier (None for serial) and bytes."""


class _Replayed(Link):
    """A recorded device, on virtual time: silence that was recorded costs nothing."""

    replayed = True

    def __init__(self, link: str, entries: list[Entry]) -> None:
        self.name = link
        self._exchanges = _exchanges(entries)
        self._cursor = 0
        self._clock = 0.0
        self._incoming: list[Key] = []

    def now(self) -> float:
        return self._clock

    def sleep(self, seconds: float) -> None:
        self._clock += max(0.0, seconds)

    def _ask(self, key: Key, text: str) -> None:
        count = len(self._exchanges)
        for step in range(count):
            index = (self._cursor + step) % count
            request, replies = self._exchanges[index]
            if request == key:
                self._cursor = index + 1
                self._incoming.extend(replies)
                return
        raise LinkError(
            f"{self.name}: this request was never recorded: {text}",
            hint="replay the command that was traced, with the same --id; --trace FILE records one",
            code="replay-miss",
        )

    def _silence(self, deadline: Deadline) -> None:
        if deadline.at != float("inf"):
            self._clock = max(self._clock, deadline.at)

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
        if not self._incoming:
            self._silence(deadline)
            return b""
        data = self._incoming.pop(0)[1]
        if len(data) > size:
            self._incoming.insert(0, (None, data[size:]))
        return data[:size]

    def set_baud(self, baud: int) -> None:
        self.baud = baud


class ReplayFrames(_Replayed, FrameLink):
    """A recorded CAN bus."""

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self._ask((frame.can_id, frame.data), str(frame))

    def receive(self, deadline: Deadline) -> CanFrame | None:
        if not self._incoming:
            self._silence(deadline)
            return None
        can_id, data = self._incoming.pop(0)
        return CanFrame(can_id or 0, data)


def _exchanges(entries: list[Entry]) -> list[tuple[Key, list[Key]]]:
    exchanges: list[tuple[Key, list[Key]]] = []
    for entry in entries:
        if entry.mark == ">":
            exchanges.append(((entry.can_id, entry.data), []))
        elif entry.mark == "<" and exchanges:
            exchanges[-1][1].append((entry.can_id, entry.data))
    return exchanges
