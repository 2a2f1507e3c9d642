"""Looking for devices on a serial line: ids and speeds, read-only, never mistaking an echo or noise for a device.

A probe reads two bytes of a register that the id may be asked for on any line (`quiet`): its reply is longer than the
request and names its id. Sequential: one
probe, one reply window. Windowed: the probes of k ids back to back, then one window; a late reply still names its id
and counts in any later window, so the shorter wait loses nothing. A window that holds bytes of no frame is asked
again in halves, down to single ids. Every hit counts after a second answer, to the question whose value is shown.

Windowing needs a full-duplex line (RS-232, Bluetooth): on RS-485 a reply collides with the probes still being sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from handctl.devices.inspire import eb90
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.eb90 import Decoder
from handctl.devices.inspire.identity import WRIST, Kind, Look
from handctl.devices.inspire.quiet import READS, Span, question
from handctl.errors import NoAnswer, ProtocolError
from handctl.model.frames import frames_in
from handctl.model.guide import Guide

DRAIN_SECONDS = 0.05
TRICKLE_SECONDS = 0.2
"""A reply that comes in pieces may outlast its window by this much."""
TWIN_READS = 20


@dataclass(slots=True)
class Findings:
    """What a scan saw: `hits` (speed, id, value of the probed register), `twins`, replies with a wrong sum by id (`damaged`), answers under an id that
    does not answer when asked alone (`foreign`), what kind of device each hit is (`kinds`, None = unknown), `echo`, bytes of no
    reply (`garbage`), whether the deadline of the command `cut` it off, probes and windows used."""

    hits: list[tuple[int | None, int, int]] = field(default_factory=list)
    twins: set[tuple[int | None, int]] = field(default_factory=set)
    unconfirmed: list[tuple[int | None, int]] = field(default_factory=list)
    damaged: dict[int, int] = field(default_factory=dict)
    foreign: int = 0
    kinds: dict[tuple[int | None, int], tuple[Kind | None, str]] = field(default_factory=dict)
    echo: bool = False
    garbage: int = 0
    cut: bool = False
    probes: int = 0
    windows: int = 0
    seconds: float = 0.0


class Scanner:
    """Scans one line. `window` = ids per reply window (1 = sequential), `wait` = reply window in seconds."""

    def __init__(
        self, bus: Bus, guide: Guide, *, window: int, wait: float, find_all: bool, probe: Span, twin: Span, own: Kind
    ) -> None:
        self._own = own
        self._probe, self._twin_span = probe, twin
        self._bus = bus
        self._guide = guide
        self._window = window
        self._wait = wait
        self._find_all = find_all
        self._decoder = Decoder()
        self._address: int | None = None  # of the reply that is waited for, None = any first question
        self.found = Findings()

    def run(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Findings:
        """Scan `ids` at each of `speeds` (None = the link has no speed). The first hit ends it unless all are wanted."""
        link = self._bus.link
        started, first = link.now(), link.baud
        try:
            for speed in self._quick_first(ids, speeds):
                if (self.found.hits and not self._find_all) or self._cut():
                    break
                self._speed(*speed)
        finally:
            self._guide.done()
            if first is not None and link.can_set_baud:
                link.set_baud(first)
        self.found.seconds = link.now() - started
        return self.found

    def _quick_first(self, ids: Sequence[int], speeds: Sequence[int | None]) -> list[tuple[int | None, list[int]]]:
        """Id 1 at every speed first (factory default), then all ids; unless the whole line is wanted anyway."""
        if self._find_all or 1 not in ids or len(ids) == 1:
            return [(speed, list(ids)) for speed in speeds]
        return [(speed, [1]) for speed in speeds] + [(speed, [i for i in ids if i != 1]) for speed in speeds]

    def _speed(self, speed: int | None, ids: list[int]) -> None:
        bus = self._bus
        if speed is not None and bus.link.can_set_baud:
            bus.link.set_baud(speed)
        bus.drain()
        spans = dict.fromkeys((*READS[bus.read_flag], self._probe))
        prefixes = [eb90.read_reply_prefix(i, *span, bus.read_flag) for i in range(1, 255) for span in spans]
        self._decoder = Decoder(prefixes)
        answered: dict[int, int] = {}
        # The first probe goes twice: a frame cut by wrong-speed garbage may swallow one.
        groups = [ids[:1]] + [ids[i : i + self._window] for i in range(0, len(ids), self._window)]
        for number, group in enumerate(groups):
            self._guide.progress(
                f"{f'{speed} bit/s, ' if speed else ''}ids {group[0]} to {group[-1]}, found {len(self.found.hits)}"
                f", {100 * number // len(groups)} %"
            )
            if not self._group(group, answered) and len(group) > 1:
                self._split(group, answered)
            self._confirm(speed, answered, group)
            if (self.found.hits and not self._find_all) or (number < len(groups) - 1 and self._cut()):
                return
        self._address = None
        self._collect(answered, DRAIN_SECONDS)
        self._confirm(speed, answered, group)

    def _cut(self) -> bool:
        """Whether the deadline of the command ends the scan with something left to ask."""
        self.found.cut = self._bus.over
        return self.found.cut

    def _split(self, group: list[int], answered: dict[int, int]) -> None:
        """Ask a group with garbage again in halves, descending only where garbage shows again."""
        middle = len(group) // 2
        for half in (group[:middle], group[middle:]):
            if half and not self._group(half, answered) and len(half) > 1:
                self._split(half, answered)

    def _group(self, group: list[int], answered: dict[int, int], span: Span | None = None) -> bool:
        """Probe `group` in one window, each id by its first question or by `span`, which alone counts as answered then.

        False when bytes came that belong to no valid reply.
        """
        bus, flag = self._bus, self._bus.read_flag
        self._address = span[0] if span is not None else None
        probes = b"".join(eb90.read_request(i, *(span or question(i, flag)), flag) for i in group)
        wire = bus.wire_seconds(len(probes))
        bus.link.write(probes, bus.deadline(self._wait + wire + 1.0))
        bus.journal.counters.sent += len(group)
        self.found.probes += len(group)
        self.found.windows += 1
        return self._collect(answered, wire + self._wait, probes, alone=len(group) == 1)

    def _collect(self, answered: dict[int, int], seconds: float, sent: bytes = b"", *, alone: bool = False) -> bool:
        """Listen for replies of any id (a late one still names its own). False when bytes of no reply came.

        A reply that has begun may go on into the next window; the window is extended while it trickles in. With
        `alone` the one answer that can come ends the window.
        """
        bus = self._bus
        deadline = bus.deadline(seconds)
        last = bus.deadline(seconds + TRICKLE_SECONDS)
        garbage, decoder = 0, self._decoder
        echo = sent
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
            before = len(answered)
            garbage += self._take(answered)
            if alone and len(answered) > before:
                break
            if decoder.pending and deadline.remaining < self._wait:
                deadline = bus.link.deadline(self._wait).earlier(last)
        return not garbage

    def _take(self, answered: dict[int, int]) -> int:
        """Enter the replies that are complete; returns how many bytes belonged to none."""
        bus, decoder = self._bus, self._decoder
        before = decoder.skipped
        for frame in frames_in(decoder, self._damaged):
            if self._address in (None, frame.address):
                answered[frame.id] = int.from_bytes(frame.data, "little", signed=True)
            bus.journal.counters.received += 1
        garbage = decoder.skipped - before
        self.found.garbage += garbage
        bus.journal.counters.stray_bytes += garbage
        return garbage

    def _damaged(self, _error: ProtocolError) -> None:
        self._bus.journal.counters.bad_frames += 1
        named = self._decoder.rejected[2]
        self.found.damaged[named] = self.found.damaged.get(named, 0) + 1

    def _confirm(self, speed: int | None, answered: dict[int, int], group: list[int]) -> None:
        """Ask each new id again by itself: only a second answer makes a hit; then look for a twin."""
        known = {(hit_speed, device_id) for hit_speed, device_id, _ in self.found.hits}
        for device_id in sorted(answered):
            if (speed, device_id) in known or (speed, device_id) in self.found.unconfirmed:
                continue
            again: dict[int, int] = {}
            for _ in range(2):
                self._group([device_id], again, self._probe)
                if device_id in again:
                    break
            if device_id not in again:
                self.found.unconfirmed.append((speed, device_id))
                # The whole group once more: does another id answer under this name, or was it a single answer?
                self._group(group, again)
                self.found.foreign += device_id in again
                continue
            self.found.hits.append((speed, device_id, again[device_id]))
            if self._twin(device_id):
                self.found.twins.add((speed, device_id))
            self.found.kinds[speed, device_id] = self._kind(device_id)
        answered.clear()

    def _kind(self, device_id: int) -> tuple[Kind | None, str]:
        """What a hit is, and what shows it. Nobody but a wrist answers a wrist's question: then nothing more is asked."""
        if self._own is WRIST:
            return WRIST, ""
        look = Look(self._bus.at(device_id=device_id))
        try:
            return look.who(self._own), look.evidence
        except NoAnswer:
            return self._own, ""  # it answered before: nothing speaks against it
        except ProtocolError as exc:
            return (None, exc.text) if exc.code == "unknown-device" else (self._own, "")

    def _twin(self, device_id: int) -> bool:
        """Two devices with one id: good and bad sums mixed on values that jitter, in 20 reads (RS-232: a Y cable)."""
        bus = self._bus
        wanted, bus.timeout = bus.timeout, min(bus.timeout, max(self._wait, 0.05))
        good = bad = 0
        try:
            for _ in range(TWIN_READS):
                try:
                    bus.read(*self._twin_span, device_id=device_id, retries=0)
                    good += 1
                except ProtocolError as exc:
                    bad += exc.code in ("bad-checksum", "garbage")
                except NoAnswer:
                    continue  # a lost reply says nothing about a twin
        finally:
            bus.timeout = wanted
        return bad > 0 and (good > 0 or bad == TWIN_READS)
