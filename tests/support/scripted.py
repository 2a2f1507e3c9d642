"""What the tests share: a link that plays a script on virtual time, and hands behind it or behind the simulator."""

from __future__ import annotations

import cProfile
import gc
import random
from collections.abc import Callable, Iterable, Sequence

from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.exo.explain_bytes import words
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.link import ByteLink, Deadline, open_link
from handctl.link.transcript import observed
from handctl.model.prompts import Prompts
from handctl.model.result import Journal, Table

Reply = tuple[float, bytes]
"""Seconds after the request, and the bytes that arrive then."""
Answer = Callable[[bytes], Iterable[Reply]]

TOO_LONG = 3600.0
TOO_MANY_READS = 200_000


def hexed(data: bytes) -> str:
    """Bytes as the transcripts write them."""
    return data.hex(" ").upper()


def unhex(text: str) -> bytes:
    """The bytes of a transcript line."""
    return bytes.fromhex(text)


class ScriptedLink(ByteLink):
    """A device made of a function from request to replies, on virtual time. Records what was sent, and when."""

    name = "scripted"
    can_set_baud = True

    def __init__(self, answer: Answer | None = None, baud: int | None = 115200) -> None:
        self.answer: Answer = answer or (lambda request: ())
        self.baud = baud
        self.clock = 0.0
        self.sent: list[bytes] = []
        self.sent_at: list[float] = []
        self.bauds: list[int] = []
        self.interrupt_at = float("inf")
        self._reads = 0
        self._incoming: list[Reply] = []

    def now(self) -> float:
        return self.clock

    def sleep(self, seconds: float) -> None:
        self._pass_to(self.clock + max(0.0, seconds))

    def _pass_to(self, moment: float) -> None:
        if moment >= self.interrupt_at:
            self.clock, self.interrupt_at = max(self.clock, self.interrupt_at), float("inf")
            raise KeyboardInterrupt
        self.clock = max(self.clock, moment)
        assert self.clock < TOO_LONG, "the command does not end"

    def put(self, delay: float, data: bytes) -> None:
        """Bytes that arrive by themselves."""
        reply = self.clock + delay, data
        late = bool(self._incoming) and reply[0] < self._incoming[-1][0]
        self._incoming.append(reply)
        if late:
            self._incoming.sort(key=lambda reply: reply[0])

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.sent.append(bytes(data))
        self.sent_at.append(self.clock)
        for delay, reply in self.answer(bytes(data)):
            self.put(delay, reply)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        self._reads += 1
        assert self._reads < TOO_MANY_READS, "the command does not end"
        if self._incoming and self._incoming[0][0] <= max(self.clock, deadline.at):
            moment, data = self._incoming.pop(0)
            self._pass_to(moment)
            if data[size:]:
                self._incoming.insert(0, (moment, data[size:]))
            return data[:size]
        self._pass_to(deadline.at)
        return b""

    def set_baud(self, baud: int) -> None:
        self.baud = baud
        self.bauds.append(baud)

    def close(self) -> None:
        self._incoming.clear()


class Babble(ScriptedLink):
    """A line that floods: whenever someone reads, 64 bytes of junk lie there, also when the time is up.

    Any byte occurs in it, so that a frame seems to begin again and again.
    """

    def __init__(self, answer: Answer | None = None, baud: int | None = 115200) -> None:
        super().__init__(answer, baud)
        self.pause = 0.0001
        self._junk = random.Random(1)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        self._reads += 1
        assert self._reads < 200_000, "the command does not end while the line babbles"
        self._pass_to(self.clock + self.pause)
        return self._junk.randbytes(min(64, size))


class RecordedLink(ByteLink):
    """Another link, with every request that passes noted."""

    def __init__(self, inner: ByteLink) -> None:
        self.inner = inner
        self.name, self.fake, self.baud, self.can_set_baud = inner.name, inner.fake, inner.baud, inner.can_set_baud
        self.sent: list[bytes] = []
        self.sent_at: list[float] = []
        self.interrupt_at = float("inf")

    def _check(self) -> None:
        if self.inner.now() >= self.interrupt_at:
            self.interrupt_at = float("inf")
            raise KeyboardInterrupt

    def now(self) -> float:
        return self.inner.now()

    def sleep(self, seconds: float) -> None:
        self._check()
        self.inner.sleep(seconds)

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.sent.append(bytes(data))
        self.sent_at.append(self.now())
        self.inner.write(data, deadline)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        self._check()
        return self.inner.read(deadline, size)

    def set_baud(self, baud: int) -> None:
        self.inner.set_baud(baud)
        self.baud = baud

    def power_cycle(self) -> bool:
        return self.inner.power_cycle()

    def close(self) -> None:
        self.inner.close()


class NotedGuide(Prompts):
    """Keeps what a procedure tells the person."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.shown: list[str] = []

    def say(self, text: str) -> None:
        self.said.append(text)

    def progress(self, text: str, safety: str = "") -> None:
        self.shown.append(text)


def script(*exchanges: tuple[str, Sequence[str | Reply]], free: bool = False) -> Answer:
    """Exactly these requests, in this order, each with its replies (hex, or (delay, bytes)).

    With `free` a request may come at any time, any number of times; unknown ones meet silence.
    """
    rows = [
        (unhex(request), [reply if isinstance(reply, tuple) else (0.0, unhex(reply)) for reply in replies])
        for request, replies in exchanges
    ]
    position = iter(rows)

    def answer(request: bytes) -> list[Reply]:
        if free:
            return next((replies for known, replies in rows if known == request), [])
        expected = next(position, None)
        assert expected is not None, f"one request too many: {hexed(request)}"
        assert hexed(request) == hexed(expected[0])
        return expected[1]

    return answer


def hand_on(link: ByteLink, device_id: int = 1, **options: object) -> ExoHand:
    """A hand behind `link`; options are those of SerialBus."""
    return ExoHand(SerialBus(link, device_id, Journal(), **options))  # type: ignore[arg-type]


def observed_hand(link: ByteLink, **options: object) -> ExoHand:
    """The same, with a ledger that sees the link."""
    hand = hand_on(link, **options)
    hand.journal.ledger.words = words()
    observed(link, hand.journal.ledger)
    return hand


def fake_link(query: str = "", baud: int | None = 115200) -> RecordedLink:
    """The simulator on virtual time, recorded."""
    return RecordedLink(open_link(f"fake://exo?clock=virtual{'&' if query else ''}{query}", baud=baud))


def fake_hand(query: str = "", device_id: int = 1, **options: object) -> tuple[ExoHand, RecordedLink]:
    """A hand in front of the simulator, and its recorded link."""
    link = fake_link(query)
    return hand_on(link, device_id, **options), link


def changing(requests: Iterable[bytes]) -> list[str]:
    """The requests that write or move: all but reads (flag 11, and 30 for the wrist's registers)."""
    return [hexed(request) for request in requests if request.lstrip(b"\0")[4] not in (0x11, 0x30)]


def codes(hand: ExoHand) -> list[str]:
    """Codes of the messages that a command left."""
    return [message.code for message in hand.journal.messages]


def message(hand: ExoHand, code: str) -> str:
    """Text and hint of the one message with this code."""
    (found,) = [entry for entry in hand.journal.messages if entry.code == code]
    return f"{found.text} {found.hint}"


def reply_to(request: bytes, data: bytes) -> bytes:
    """The reply that carries `data` for a read request; made by hand, not by the code under test."""
    body = bytes([request[2], len(data) + 3, 0x11]) + request[5:7] + data
    return b"\x90\xeb" + body + bytes([sum(body) % 256])


def zeros_to_reads(request: bytes) -> list[Reply]:
    """An answer that gives zeros to every read, and silence to anything else."""
    return [(0.0, reply_to(request, bytes(request[7])))] if request[4] == 0x11 else []


def values(table: Table) -> list[object]:
    """The values of all rows."""
    return [row["value"] for row in table.rows]


def calls_of(work: Callable[[], object]) -> int:
    """How many functions `work` calls: what it costs, whatever else the machine does and whatever ran before.

    No garbage collection comes in between: Hypothesis has a function called at each.
    """
    profile, collects = cProfile.Profile(), gc.isenabled()
    gc.disable()
    profile.enable()
    try:
        work()
    finally:
        profile.disable()
        if collects:
            gc.enable()
    return sum(entry.callcount for entry in profile.getstats())
