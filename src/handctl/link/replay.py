"""`replay:FILE`: a transcript plays the device. Knows no protocol: it compares bytes.

Each recorded `>` is answered with the `<` lines that followed it. A request is looked up from where the last one was
found, then from the start, so the same command gets the same course and a repeated one gets an answer too.
"""

from __future__ import annotations

from handctl.errors import LinkError, UsageError
from handctl.link import ByteLink, Deadline
from handctl.link.tap import Entry, parse


class ReplayLink(ByteLink):
    """A recorded device, on virtual time: silence that was recorded costs nothing."""

    replayed = True

    def __init__(self, link: str, baud: int | None = None) -> None:
        self.name = link
        self.baud = baud
        path = link.removeprefix("replay:")
        try:
            with open(path, encoding="utf-8") as file:
                entries = parse(file, path)
        except (OSError, UnicodeDecodeError) as exc:
            why = exc.strerror if isinstance(exc, OSError) else "not a text file"
            raise UsageError(f"{link}: cannot read the transcript: {why}") from exc
        self._exchanges = _exchanges(entries)
        if not self._exchanges:
            raise UsageError(f"{link}: the transcript holds no request (no line with >)")
        self._cursor = 0
        self._clock = 0.0
        self._incoming: list[bytes] = []

    def now(self) -> float:
        return self._clock

    def sleep(self, seconds: float) -> None:
        self._clock += max(0.0, seconds)

    def write(self, data: bytes, deadline: Deadline) -> None:
        count = len(self._exchanges)
        for step in range(count):
            index = (self._cursor + step) % count
            request, replies = self._exchanges[index]
            if request == data:
                self._cursor = index + 1
                self._incoming.extend(replies)
                return
        raise LinkError(
            f"{self.name}: this request was never recorded: {data.hex(' ').upper()}",
            hint="replay the command that was traced, with the same --id; `handctl exo dump --trace FILE` records a dump",
            code="replay-miss",
        )

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self._incoming:
            data = self._incoming.pop(0)
            if len(data) > size:
                self._incoming.insert(0, data[size:])
            return data[:size]
        if deadline.at != float("inf"):
            self._clock = max(self._clock, deadline.at)
        return b""

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def close(self) -> None:
        self._incoming.clear()


def _exchanges(entries: list[Entry]) -> list[tuple[bytes, list[bytes]]]:
    exchanges: list[tuple[bytes, list[bytes]]] = []
    for entry in entries:
        if entry.mark == ">":
            exchanges.append((entry.data, []))
        elif entry.mark == "<" and exchanges:
            exchanges[-1][1].append(entry.data)
    return exchanges
