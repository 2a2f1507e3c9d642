"""Read requests to many ids at once, and the answers that come, late ones too: what a scan does on the wire. Read-only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

from handctl.devices.inspire import eb90
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.eb90 import Decoder, Frame
from handctl.devices.inspire.identity import Kind
from handctl.devices.inspire.mishaps import beheaded, foreign_in
from handctl.devices.inspire.quiet import FRESH, READS, Span, ahead, question
from handctl.errors import ProtocolError
from handctl.model.frames import frames_in
from handctl.model.profile import Profile

LATELY = 4096
"""Bytes sent: those of the last seconds."""
TRICKLE_SECONDS = 0.2
"""A reply that comes in pieces may outlast its window by this much."""


@dataclass(slots=True)
class Findings:
    """What a scan saw: `hits` (speed, id, value of the probed register), `twins`, replies with a wrong sum by id (`damaged`), answers under an id that
    does not answer when asked alone (`foreign`), ids whose answers lack their first byte (`beheaded`), what kind of device each hit is (`kinds`, None =
    unknown), `echo`, bytes of no reply (`garbage`, and the last of them, `came`), whether the deadline of the command `cut` it off, probes used, and the seconds of each
    id where they were asked with more time (`single`). The speed of a hit is None where it does not matter."""

    hits: list[tuple[int | None, int, int]] = field(default_factory=list)
    twins: set[tuple[int | None, int]] = field(default_factory=set)
    unconfirmed: list[tuple[int | None, int]] = field(default_factory=list)
    damaged: dict[int, int] = field(default_factory=dict)
    foreign: int = 0
    beheaded: set[int] = field(default_factory=set)
    kinds: dict[tuple[int | None, int], tuple[Kind | None, str]] = field(default_factory=dict)
    echo: bool = False
    garbage: int = 0
    came: bytes = b""
    cut: bool = False
    probes: int = 0
    seconds: float = 0.0
    single: float | None = None


@cache
def _prefixes(spans: tuple[Span, ...], flag: int) -> tuple[bytes, ...]:
    """With what the answers of all ids begin."""
    return tuple(eb90.read_reply_prefix(i, *span, flag) for i in range(1, 255) for span in spans)


class Asker:
    """Asks ids on one line. `wait` = reply window in seconds; `probe` is asked of whoever has answered."""

    def __init__(self, bus: Bus, wait: float, probe: Span) -> None:
        self._bus = bus
        self._wait = wait
        self._firsts = {*READS[bus.read_flag], probe}
        self._prefixes = _prefixes((*sorted(self._firsts), *FRESH[bus.read_flag]), bus.read_flag)
        self._decoder = Decoder(self._prefixes)
        self._fresh = 0
        self._lately = b""  # what was sent: an echo may be as late as an answer
        self._seen: dict[tuple[int, Span], bytes] = {}  # answers that came since they were last waited for
        self.others_at: int | None = None  # the speed at which others were understood
        self.line: Profile = bus.journal.line
        self.found = Findings()

    def _set_speed(self, speed: int | None) -> None:
        if speed is not None and self._bus.link.can_set_baud:
            self._bus.link.set_baud(speed)
        self._decoder = Decoder(self._prefixes)
        self._bus.drain()

    def _patience(self, otherwise: float) -> float:
        """How long an answer is waited for: by the round trips that were measured."""
        return max(0.02, 1.5 * self.line.worst + 0.03) if len(self.line.trips) else otherwise

    def _first(self, device_id: int, answered: dict[int, int]) -> bool:
        """The first question to an id, and what comes meanwhile. False when bytes came that belong to no valid reply."""
        flag, link = self._bus.read_flag, self._bus.link
        request = eb90.read_request(device_id, *question(device_id, flag), flag)
        probe = ahead(link.baud if link.can_set_baud else None) + request
        if link.replayed and not link.recorded_next(probe):
            probe = request  # an older recording
        wire = self._send(probe, 1)
        return self._collect(answered, wire + self._wait, probe, alone=device_id)

    def _send(self, probes: bytes, count: int) -> float:
        """Send so many probes; returns the seconds that they need on the wire."""
        bus = self._bus
        wire = bus.wire_seconds(len(probes))
        bus.link.write(probes, bus.deadline(self._wait + wire + 1.0))
        self._lately = (self._lately + probes)[-LATELY:]
        bus.journal.counters.sent += count
        self.found.probes += count
        return wire

    def _collect(
        self,
        answered: dict[int, int],
        seconds: float,
        sent: bytes = b"",
        *,
        alone: int = 0,
        until: Sequence[tuple[int, Span]] = (),
    ) -> bool:
        """Listen for replies of any id (a late one still names its own). False when bytes of no reply came.

        A reply that has begun may go on into the next window; the window is extended while it trickles in. With
        `alone` the answer of that id ends the window, with `until` any of these.
        """
        bus = self._bus
        deadline = bus.deadline(seconds)
        last = bus.deadline(seconds + TRICKLE_SECONDS)
        garbage, decoder = 0, self._decoder
        echo, received = sent, b""
        while not last.expired:
            chunk = bus.link.read(deadline)
            if not chunk:
                break
            same = min(len(chunk), len(echo))
            if same and chunk[:same] == echo[:same]:
                chunk, echo = chunk[same:], echo[same:]
                self.found.echo = self.found.echo or not echo
            elif same:
                echo = b""  # an echo comes first and whole, or there is none
            decoder.feed(chunk)
            received += chunk
            garbage += self._take(answered)
            if alone in answered or any(each in self._seen for each in until):
                break
            if decoder.pending and deadline.remaining < self._wait:
                deadline = bus.link.deadline(self._wait).earlier(last)
        if garbage and len(received) < 65536:
            self._judge(received, sent)
        if sent and received:
            self.line.echo = self.found.echo
        return not garbage

    def _judge(self, received: bytes, sent: bytes) -> None:
        """Whose bytes of no reply are: an answer without its first byte, or another conversation."""
        self.found.came = (self.found.came + received)[-256:]
        self.found.beheaded |= {frame.id for frame in beheaded(received) if _span(frame) in self._firsts}
        known = {*self._firsts, *FRESH[self._bus.read_flag]}
        if foreign_in(received, self._lately, lambda frame: _span(frame) in known):
            self.line.others, self.others_at = True, self._bus.link.baud

    def _take(self, answered: dict[int, int]) -> int:
        """Enter the replies that are complete; returns how many bytes belonged to none."""
        bus, decoder = self._bus, self._decoder
        before = decoder.skipped
        for frame in frames_in(decoder, self._damaged):
            if _span(frame) in self._firsts:
                answered[frame.id] = int.from_bytes(frame.data, "little", signed=True)
            self._seen[frame.id, _span(frame)] = frame.data
            bus.journal.counters.received += 1
        garbage = decoder.skipped - before
        self.found.garbage += garbage
        bus.journal.counters.stray_bytes += garbage
        return garbage

    def _damaged(self, _error: ProtocolError) -> None:
        self._bus.journal.counters.bad_frames += 1
        named = self._decoder.rejected[2]
        self.found.damaged[named] = self.found.damaged.get(named, 0) + 1

    def _ask(self, device_id: int, waits: Sequence[float], span: Span | None = None) -> bool:
        """Ask one id for `span`, else for a register and length that it was not asked lately, until an answer comes."""
        bus, flag = self._bus, self._bus.read_flag
        asked: dict[tuple[int, Span], float] = {}
        for wait in waits:
            if self._cut():
                break
            this = span or self._another()
            asked[device_id, this] = bus.link.now()
            self._seen.pop((device_id, this), None)
            request = eb90.read_request(device_id, *this, flag)
            wire = self._send(request, 1) + bus.wire_seconds(this[1] + 8)
            self._collect({}, wire + wait, request, until=list(asked))
            for each, at in asked.items():
                if each in self._seen:
                    if span is None:
                        self.line.trips.add(bus.link.now() - at)
                    return True
        return False

    def _cut(self) -> bool:
        """Whether the deadline of the command ends the scan with something left to ask."""
        self.found.cut = self._bus.over
        return self.found.cut

    def overlaps(self, device_id: int, count: int) -> bool:
        """Whether the first of several questions without a pause is answered: both directions at once."""
        bus = self._bus
        asked = [(device_id, self._another()) for _ in range(min(count, len(FRESH[bus.read_flag])))]
        for each in asked:
            self._seen.pop(each, None)
        requests = b"".join(eb90.read_request(device_id, *span, bus.read_flag) for _, span in asked)
        wire = self._send(requests, len(asked)) + bus.wire_seconds(sum(span[1] + 8 for _, span in asked))
        self._collect({}, wire + self._patience(0.0), requests, until=asked[:1])
        return asked[0] in self._seen

    def _another(self) -> Span:
        """A register and a length that no question has had for long."""
        spans = FRESH[self._bus.read_flag]
        self._fresh += 1
        return spans[self._fresh % len(spans)]


def _span(frame: Frame) -> Span:
    """What a read reply answers."""
    return frame.address or 0, len(frame.data)
