"""Search a serial line for devices, over ids and baud rates. Read-only; never mistakes an echo or noise for a device.

A probe reads two bytes of a register that the id may be asked for on any line (`register_bus.question`): its reply is longer than the
request and names its id. One id is asked at a time, with room for its answer on the wire and no more: so answers collide with
no probe on two wires (RS-485) either, and one that arrives here later still names its id, and counts whenever it comes.

An answer to a probe may be late: that of an earlier speed. So a hit is confirmed by another register and length, which no
earlier probe asked (`FRESH`), at this speed and then at those before; who does not have that is asked for others, and for no more
bytes than at first (`FRESH_SHORT`). The first hit measures the line (`measure`).

At the slower speeds of a line that carries both directions (RS-232) no room is left. A delay that varies may push probes together: with `thorough`, a silent line is asked again with more time between them.

On a CAN bus ids are asked back to back (`CanSearch`), in Modbus RTU one at a time (`RtuSearch`, rh56 §2.2): an answer names its
id, and its sum tells it from an echo, a late one of another protocol, and noise. Late ones count too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

from handctl.devices.inspire import can_frames, eb90, modbus_frames
from handctl.devices.inspire.can_bus import HINTS, NO_ACK_HINT, CanBus, bus_failure, said_damaged
from handctl.devices.inspire.eb90 import Decoder, Frame
from handctl.devices.inspire.identity import NOT_SHOWN, WRIST, IdentityCheck, Kind
from handctl.devices.inspire.modbus_bus import QUIET_SECONDS
from handctl.devices.inspire.register_bus import AHEAD, FRESH, FRESH_SHORT, READS, Span, at_speed, other_speed, question
from handctl.devices.inspire.serial_bus import SerialBus, frames_of_others, headless
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.link import ByteLink, CanFrame, Deadline
from handctl.model.frame_decoder import frames_in
from handctl.model.prompts import Prompts
from handctl.model.result import Journal, LineQuality

LATELY = 4096
"""Bytes sent: those of the last seconds."""
TRICKLE_SECONDS = 0.2
"""A reply that comes in pieces may outlast its window by this much."""


@dataclass(slots=True)
class Findings:
    """What a scan saw: `hits` (speed, id, value of the probed register, None = not read), `twins`, replies with a wrong sum by id (`damaged`), answers under an id that
    does not answer when asked alone (`foreign`), ids whose answers lack their first byte (`headless`), what kind of device each hit is (`kinds`, None =
    unknown), `echo`, bytes of no reply (`garbage`, and the last of them, `came`), whether the deadline of the command `cut` it off, probes used, and the seconds of each
    id where they were asked with more time (`single`). The speed of a hit is None where it does not matter."""

    hits: list[tuple[int | None, int, int | None]] = field(default_factory=list)
    twins: set[tuple[int | None, int]] = field(default_factory=set)
    unconfirmed: list[tuple[int | None, int]] = field(default_factory=list)
    damaged: dict[int, int] = field(default_factory=dict)
    foreign: int = 0
    headless: set[int] = field(default_factory=set)
    kinds: dict[tuple[int | None, int], tuple[Kind | None, str]] = field(default_factory=dict)
    echo: bool = False
    garbage: int = 0
    came: bytes = b""
    cut: bool = False
    probes: int = 0
    single: float | None = None


class Requester:
    """Asks ids on one line. `wait` = reply window in seconds; `probe` is asked of whoever has answered."""

    def __init__(self, bus: SerialBus, wait: float, probe: Span) -> None:
        self._bus = bus
        self._wait = wait
        self._firsts = {*READS[bus.read_flag], probe}
        self._younger = (*FRESH[bus.read_flag], *FRESH_SHORT[bus.read_flag])
        spans = (*sorted(self._firsts), *self._younger)
        self._prefixes = [eb90.read_reply_prefix(eb90.IDS[0], *span, bus.read_flag) for span in spans]
        self._decoder = Decoder(self._prefixes, of_any_id=True)
        self._turn = 0
        self._short = set[int]()  # ids that answer `FRESH_SHORT`, and not `FRESH`
        self._lately = b""  # what was sent: an echo may be as late as an answer
        self._seen: dict[tuple[int, Span], bytes] = {}  # answers that came since they were last waited for
        self.others_at: int | None = None  # the speed at which others were understood
        self.line: LineQuality = bus.journal.line
        self.found = Findings()

    def _set_speed(self, speed: int | None) -> None:
        if speed is not None and self._bus.link.can_set_baud:
            self._bus.link.set_baud(speed)
        self._decoder = Decoder(self._prefixes, of_any_id=True)
        self._bus.drain()

    def _patience(self, otherwise: float) -> float:
        """How long an answer is waited for: by the round trips that were measured."""
        return max(0.02, 1.5 * self.line.worst + 0.03) if len(self.line.trips) else otherwise

    def _first(self, device_id: int, answered: dict[int, int], *, other: bool = False) -> bool:
        """The first question to an id, or the `other` one, and what comes meanwhile. False when bytes came that belong to no valid reply."""
        flag, link = self._bus.read_flag, self._bus.link
        before = AHEAD.get(link.baud if link.can_set_baud else None, b"")
        request = eb90.read_request(device_id, *question(device_id, flag, other=other), flag)
        probe = before + request
        if link.replayed:  # an older recording has other probes
            usual = eb90.read_request(device_id, *question(device_id, flag), flag)
            older = (probe, request, before + usual, usual)
            probe = next(filter(link.is_next_recorded, older), older[-1])
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
            if alone in answered or any(map(self._seen.__contains__, until)):
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
        self.found.headless |= {frame.id for frame in headless(received) if _span(frame) in self._firsts}
        known = {*self._firsts, *self._younger}
        if frames_of_others(received, self._lately, lambda frame: _span(frame) in known):
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

    def _ask(self, device_id: int, waits: Sequence[float], span: Span | None = None, *, first: bool = False) -> bool:
        """Ask one id for `span`, else for a register and length that it was not asked lately, until an answer comes.

        first  it is not known which registers it has: behind the first question it is asked for others
        """
        bus, flag = self._bus, self._bus.read_flag
        asked: dict[tuple[int, Span], float] = {}
        for number, wait in enumerate(waits):
            if self._cut():
                break
            this = span or self._another(short=(first and number > 0) or device_id in self._short)
            asked[device_id, this] = bus.link.now()
            self._seen.pop((device_id, this), None)
            request = eb90.read_request(device_id, *this, flag)
            wire = self._send(request, 1) + bus.wire_seconds(this[1] + 8)
            self._collect({}, wire + wait, request, until=list(asked))
            for each, at in asked.items():
                if each in self._seen:
                    if span is None:
                        self.line.trips.add(bus.link.now() - at)
                        if each[1] in FRESH_SHORT[flag]:
                            self._short.add(device_id)
                    return True
        return False

    def _cut(self) -> bool:
        """Whether the deadline of the command ends the scan with something left to ask."""
        self.found.cut = self._bus.over
        return self.found.cut

    def overlaps(self, device_id: int, count: int, *, short: bool = False) -> bool:
        """Whether the first of several questions without a pause is answered: both directions at once. `short`: it is one of `FRESH_SHORT`."""
        bus = self._bus
        short = short or device_id in self._short
        count = min(count, len(FRESH[bus.read_flag]))
        asked = [(device_id, self._another(short=short and number == 0)) for number in range(count)]
        for each in asked:
            self._seen.pop(each, None)
        requests = b"".join(eb90.read_request(device_id, *span, bus.read_flag) for _, span in asked)
        wire = self._send(requests, len(asked)) + bus.wire_seconds(sum(span[1] + 8 for _, span in asked))
        self._collect({}, wire + self._patience(0.0), requests, until=asked[:1])
        return asked[0] in self._seen

    def _another(self, *, short: bool = False) -> Span:
        """A register and a length that no question has had for long."""
        spans = (FRESH_SHORT if short else FRESH)[self._bus.read_flag]
        self._turn += 1
        return spans[self._turn % len(spans)]


def _span(frame: Frame) -> Span:
    """What a read reply answers."""
    return frame.address or 0, len(frame.data)


# -- passes over ids and speeds ---------------------------------------------------------------------------------------

TURNAROUND = 0.003
"""Seconds from the end of a question to the beginning of its answer on the wire, at the most (inspire, section 6)."""
ROOMLESS = 0.0015
"""Between two probes where no answer can collide: a receiver at 9600 bit/s does not take them for one."""
FIRST_SECONDS = 0.15
"""How long to listen behind id 1 at each speed, time for Bluetooth ..."""
DRAIN_SECONDS = 0.05
"""... behind the last probe of a pass, as long as no round trip was measured ..."""
LATE_SECONDS = 0.52
"""... behind the last probe of all ..."""
SILENCE_SECONDS = 1.0
"""... and behind a pass with more time for each: what has not come then is silence."""
SINGLE_SECONDS = 0.030
"""Between two ids of the pass that follows silence: on the wire, a delay that varies must not push them together."""
MOST_SINGLE = 0.150
"""However slow the line: the answers overlap, and name their ids."""
PROBE_BYTES, ANSWER_BYTES = 9, 10
SAME = (1000, 4)
"""Id and speed: of two devices with one id the answers are alike, so they overlap to a good one (dossier 4.14)."""
AGAIN_AMONG_OTHERS = 2
"""So many passes more where others speak and nothing was found."""
TOGETHER = 8
"""Questions without a pause, by which half duplex shows."""
CONFIRM_SECONDS = (0.3, 0.6, 1.2)
TWIN_READS = 20
TWIN_READS_SLOW = 6
"""On a slow line: each of them takes its round trip."""


class ScanPass(NamedTuple):
    """Ids at one speed: how long each has for its answer (None: room on the wire), how long to listen behind the last, how
    many speeds come after it, and whether something else may be asked behind it."""

    speed: int | None
    ids: Sequence[int]
    wait: float | None
    dwell: float
    more: int = 0
    between: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanRequest:
    """What is wanted of the scan of one line.

    own, probe, twin  who is looked for, and what he is asked, see `scan.Target`
    typed     the user named him: where nothing shows who answers, it is he
    given_ids  the user named the ids: each is asked, also one whose request another device on the line could act on
    find_all  the first hit does not end it
    thorough  silence is asked again, with more patience
    silence   for so many seconds a line is asked on which nobody is heard, None = until all were asked
    between   whether something else was found: asked behind the pass at the speeds `behind`
    patience  seconds for the answer of the first id at the least, and of one that has answered
    both_ways  such a device's line carries both directions at once: at the speeds behind the first no room is left
    additional  so long the first id is waited for, and nothing behind it: others are asked here as well; None = they are not
    """

    own: Kind
    probe: Span
    twin: Span
    find_all: bool
    typed: bool = True
    given_ids: bool = False
    thorough: bool = True
    silence: float | None = None
    between: Callable[[], bool] | None = None
    behind: Collection[int | None] = ()
    patience: float = 0.0
    both_ways: bool = False
    additional: float | None = None


class Scanner(Requester):
    """Scans one line."""

    def __init__(self, bus: SerialBus, prompts: Prompts, want: ScanRequest) -> None:
        super().__init__(bus, TURNAROUND, want.probe)
        self._guide, self._want = prompts, want
        self._until: Deadline | None = None if want.silence is None else bus.link.deadline(want.silence)
        self.left: list[tuple[int | None, int]] = []
        """Speed, and the first id that was not asked there since `silence` was over."""
        self.asked: dict[int | None, set[int]] = {}
        """Speed -> the ids that were asked there."""
        self.unasked: set[tuple[int | None, int]] = set()
        """Speed and id that was not asked there, because another device could act on the request."""
        self._doubted: set[int] = set()  # ids that answered in this pass, and not when asked again
        self._asked: list[int] = []  # speeds, the last one last
        self._judged: set[tuple[int | None, int]] = set()  # whose damaged answers were looked at

    def run(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Findings:
        """Scan `ids` at each of `speeds` (None = the link has no speed). The first hit ends it unless all are wanted."""
        link = self._bus.link
        first = link.baud
        try:
            self._all(ids, speeds)
        finally:
            self._guide.done()
            if first is not None and link.can_set_baud:
                link.set_baud(first)
        return self.found

    def _all(self, ids: Sequence[int], speeds: Sequence[int | None]) -> None:
        awaited = 0
        for each in self._passes(ids, speeds):
            self._pass(each)
            done = bool(self.found.hits) or self._collided(each.speed)
            between = self._want.between if each.between and each.speed in self._want.behind else None
            if between is not None and not (done or self._cut() or self._spent):
                if self._want.additional is None:
                    self._await_late(ids[:1])  # an answer must not come among those in another protocol
                done = bool(self.found.hits) or between()
                awaited = self.found.probes
            if (done and not self._want.find_all) or self._cut():
                break
        unheard = not (self.found.hits or self._want.thorough or awaited == self.found.probes)
        if unheard and self._want.additional is None and not self._cut():
            self._await_late(ids[:1])

    def _await_late(self, ids: Sequence[int]) -> None:
        """Listen for answers to all that was asked so far."""
        self._collect(answered := dict[int, int](), max(LATE_SECONDS, self._want.patience))
        self._confirm(self._asked[-1] if self._asked else None, answered, ids)

    # -- passes --------------------------------------------------------------------------------------------------

    def _passes(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Iterator[ScanPass]:
        """Id 1 at every speed first (factory default), then all, then all with more time where that can matter."""
        rest, patient = ids, self._want.additional
        if patient is None:
            patient = max(FIRST_SECONDS, self._want.patience)
        if not self._want.find_all and 1 in ids and len(ids) > 1:
            rest = [i for i in ids if i != 1]
            for speed in speeds:
                yield ScanPass(speed, [1], DRAIN_SECONDS, patient)
        todo, asked = list(speeds), list[int | None]()
        while todo:
            speed = todo.pop(0)
            measured = len(self.line.trips)
            wait = ROOMLESS if self._want.both_ways and asked else None
            yield ScanPass(speed, rest, wait if len(rest) > 1 else patient, DRAIN_SECONDS, between=True)
            if self.line.speed_matters is False:
                todo.clear()
            elif self.line.slow and not measured:
                todo += asked  # their last answers may have been too late
            asked.append(speed)
        if not self._want.thorough or self._want.additional is not None or self.found.headless:
            return
        if self.found.hits and not (len(ids) > 1 and self._collides()):
            return
        yield from self._single_passes(ids, speeds)

    def _collides(self) -> bool:
        """Whether answers of others may have met a probe: on two wires, with a delay that varies."""
        line, (speed, device_id, _) = self.line, self.found.hits[0]
        if (line.spread or 0.0) <= TURNAROUND:
            return False
        self._set_speed(speed)
        line.half_duplex = not any(self.overlaps(device_id, TOGETHER) for _ in range(2))
        return line.half_duplex

    def _single_passes(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Iterator[ScanPass]:
        """With more time for each. Where others speak, their speed is the likeliest, and a probe may have met their bytes."""
        for number, speed in enumerate(sorted(speeds, key=lambda speed: speed != self.others_at), 1):
            if number > 1 and self.line.speed_matters is False:
                break
            yield self._single(ids, speed)._replace(more=len(speeds) - number)
        for _ in range(AGAIN_AMONG_OTHERS):
            if self.found.hits or self.others_at not in speeds:
                break
            yield self._single(ids, self.others_at)

    def _single(self, ids: Sequence[int], speed: int | None) -> ScanPass:
        """At the pace of the line as far as that is known."""
        wait = SINGLE_SECONDS
        if len(self.line.trips):
            wait = min(MOST_SINGLE, max(0.02, 2 * self.line.worst + 0.01))
        self.found.single = wait
        return ScanPass(speed, ids, wait, SILENCE_SECONDS)

    def _pass(self, this: ScanPass) -> None:
        speed = this.speed
        self._set_speed(speed)
        ids = [number for number in this.ids if self._may_ask(number, speed)]
        if not ids:
            return
        # A question, and room for its answer.
        self._wait = TURNAROUND + self._bus.wire_seconds(ANSWER_BYTES) if this.wait is None else this.wait
        if speed is not None and self._bus.link.can_set_baud:
            self._asked = [*(each for each in self._asked if each != speed), speed]
        self._doubted.clear()
        answered: dict[int, int] = {}
        # The first id is probed twice: a frame cut by wrong-speed garbage may swallow one, and a firmware may lack a register.
        for number, device_id in enumerate([ids[0], *ids]):
            if self._spent:
                self.left.append((speed, device_id))
                return
            self._tell(this, device_id, number / (len(ids) + 1))
            other = number == 1 or (number > 1 and self.found.single is not None)
            self.asked.setdefault(speed, set()).add(device_id)
            whole = self._first(device_id, answered, other=other)
            if not whole and self.found.single and device_id not in answered:
                self._first(device_id, answered, other=other)  # somebody spoke at the same time
            self._confirm(speed, answered, [device_id])
            if (self.found.hits and not self._want.find_all) or (number < len(ids) and self._cut()):
                return
        alone = ids[0] if len(ids) == 1 else 0
        self._collect(answered, max(0.0, self._patience(this.dwell) - self._wait), alone=alone)
        self._confirm(speed, answered, ids[-1:])

    def _may_ask(self, device_id: int, speed: int | None) -> bool:
        """Whether no other device on the line could act on the first question to this id, or the user named it."""
        flag = self._bus.read_flag
        quiet = self._bus.is_quiet(eb90.read_request(device_id, *question(device_id, flag), flag))
        if not (quiet or self._want.given_ids):
            self.unasked.add((speed, device_id))
        return quiet or self._want.given_ids

    def _patience(self, otherwise: float) -> float:
        return max(self._want.patience, super()._patience(otherwise))

    @property
    def _spent(self) -> bool:
        """Whether the line was silent for the longest time allowed."""
        found = self.found
        heard = found.hits or found.damaged or found.headless or found.foreign or len(self.line.trips)
        return self._until is not None and self._until.expired and not heard

    def _tell(self, this: ScanPass, device_id: int, part: float) -> None:
        """How far it is; of the pass with more time, which is long, why and how long, too."""
        at = f"{this.speed} bit/s, " if this.speed else ""
        text = f"{at}id {device_id}, found {len(self.found.hits)}"
        if this.wait is not None and self.found.single:
            asking = len(this.ids) * (this.wait + self._bus.wire_seconds(PROBE_BYTES))
            left = asking * (1.0 - part) + this.dwell + this.more * (asking + this.dwell)
            text += f", {left:.0f} s left. Slowly: it may be half duplex"
        self._guide.progress(text)

    # -- hits ----------------------------------------------------------------------------------------------------

    def _confirm(self, speed: int | None, answered: dict[int, int], group: Sequence[int]) -> None:
        """Ask each new id again by itself: only a younger answer makes a hit; the first one measures the line."""
        for device_id in sorted(answered):
            if self._known(speed, device_id) or device_id in self._doubted:
                continue
            try:
                if self._hit(speed, device_id):
                    continue
                self._doubted.add(device_id)
                if (speed, device_id) not in self.found.unconfirmed:
                    self.found.unconfirmed.append((speed, device_id))
                # The same question once more: does another id answer under this name, or was it a single answer?
                again: dict[int, int] = {}
                for each in group:
                    self._first(each, again)
                self.found.foreign += device_id in again
            finally:
                self._return_to(speed)
        answered.clear()

    def _known(self, speed: int | None, device_id: int) -> bool:
        return any(hit_id == device_id and hit_speed in (speed, None) for hit_speed, hit_id, _ in self.found.hits)

    def _return_to(self, speed: int | None) -> None:
        link = self._bus.link
        if speed is not None and link.can_set_baud and link.baud != speed:
            link.set_baud(speed)

    def _hit(self, speed: int | None, device_id: int) -> bool:
        """Whether this id answers a younger question; then it is entered, with its value, its twin and its kind."""
        bus = self._bus
        at = self._place(speed, device_id)
        if not at:
            return False
        speed = bus.link.baud if len(self._asked) and speed is not None else speed
        if self._known(speed, device_id):
            return True
        patience = self._patience(CONFIRM_SECONDS[0])
        value = None
        if self._ask(device_id, (patience, 2 * patience), self._want.probe):
            value = int.from_bytes(self._seen[device_id, self._want.probe], "little", signed=True)
        self._measure(device_id, speed)
        if self.line.speed_matters is False:
            speed = None
        self.found.hits.append((speed, device_id, value))
        self.found.unconfirmed = [each for each in self.found.unconfirmed if each[1] != device_id]
        with bus.waiting(max(bus.timeout, self._patience(0.0))):
            if self._twin(device_id):
                self.found.twins.add((speed, device_id))
            self.found.kinds[speed, device_id] = self._kind(device_id)
        return True

    def _place(self, speed: int | None, device_id: int) -> bool:
        """Whether this id gives a younger answer, at this speed or at one before; the port stays there."""
        waits = [self._patience(wait) for wait in CONFIRM_SECONDS]
        if self._ask(device_id, waits, first=True):
            return True
        for before in [each for each in reversed(self._asked) if each != speed]:
            self._bus.link.set_baud(before)
            if self._ask(device_id, waits[-1:]):
                return True
        return False

    def _measure(self, device_id: int, speed: int | None) -> None:
        """What the line is, once: asked of the device that was just found."""
        line, link = self.line, self._bus.link
        if line.speed_matters is None and speed is not None and link.can_set_baud and not link.replayed:
            with at_speed(link, other_speed(speed)):
                self._bus.drain()
                line.speed_matters = not self._ask(device_id, (self._patience(0.0),) * 2)
            self._ask(device_id, (self._patience(0.0),) * 2)  # what the other speed left half read is passed over
        if line.others is None:
            line.others = False

    def _kind(self, device_id: int) -> tuple[Kind | None, str]:
        """What a hit is, and what shows it. Nobody but a wrist answers a wrist's question: then nothing more is asked."""
        if self._want.own is WRIST:
            return WRIST, ""
        look = IdentityCheck(self._bus.at(device_id=device_id))
        try:
            return look.who(self._want.own), look.evidence
        except NoAnswer:
            return self._want.own, ""  # it answered before: nothing contradicts it
        except ProtocolError as exc:
            open_ = exc.code == "unknown-device" or (exc.code == NOT_SHOWN and not self._want.typed)
            return (None, exc.text) if open_ else (self._want.own, "")

    def _collided(self, speed: int | None) -> bool:
        """Whether two devices with one id answer at this speed: each answer is damaged, but for those that are alike."""
        bus = self._bus
        with bus.waiting(max(bus.timeout, self._patience(DRAIN_SECONDS))):
            for device_id, damaged in list(self.found.damaged.items()):
                if damaged < 2 or (speed, device_id) in self._judged:
                    continue
                self._judged.add((speed, device_id))
                good = 0
                for _ in range(4):
                    with suppress(NoAnswer, ProtocolError, DeviceRefused):
                        bus.read(*SAME, device_id=device_id, retries=0)
                        good += 1
                if good > 1:
                    self.found.twins.add((speed, device_id))
        return bool(self.found.twins)

    def _twin(self, device_id: int) -> bool:
        """Two devices with one id: good and bad sums mixed on values that jitter, in 20 reads (RS-232: a Y cable)."""
        bus = self._bus
        good = bad = 0
        reads = TWIN_READS_SLOW if self.line.slow else TWIN_READS
        with bus.waiting(min(bus.timeout, max(0.05, self._patience(0.0)))):
            for _ in range(reads):
                with suppress(NoAnswer):  # a lost reply says nothing about a twin
                    try:
                        bus.read(*self._want.twin, device_id=device_id, retries=0)
                        good += 1
                    except ProtocolError as exc:
                        bad += exc.code in ("bad-checksum", "garbage")
        if self.line.others:  # their frames damage answers as well, but not most of them
            return 2 * bad > reads
        return bad > 0 and (good > 0 or bad == reads)


# -- CAN --------------------------------------------------------------------------------------------------------------

CHUNK = 32
WAIT, FIRST, DRAIN, LATE = 0.02, 0.25, 0.05, 0.52
"""Seconds: behind a chunk of ids, the likely one, the last one, and all when nobody has answered."""
TIMED = 3
"""Questions more to the first device, where the scan ends with it."""


class CanSearch:
    """Probes of ids back to back, of a span of two bytes or more; a late reply names its id and counts in any later window.

    Another register confirms: its answer is no late one to the first. Who does not have the next one is asked for those that
    every device of the family has; so are all, where the first is answered by nobody.
    """

    def __init__(self, bus: CanBus, span: Span, what: str) -> None:
        self._bus = bus
        others = [one for one in (*bus.first_questions, *FRESH_SHORT[bus.space][:2]) if one[0] != span[0]]
        self._spans = (span, (span[0] + 2, span[1]), *others)
        self._what = what
        self._wanted: dict[int, tuple[int, Span]] = {}
        self._asked: dict[int, float] = {}
        self._worst = 0.0
        self.values: dict[int, bytes] = {}
        self.probes = 0
        self.cut = False
        self._own = self._short = 0
        self._lone: list[int] = []
        self._before = bus.link.error_frames, bus.link.damaged

    def run(self, ids: Sequence[int], find_all: bool, wait: float | None = None) -> list[int]:
        """The ids that answer twice; only the first unless `find_all`."""
        for span in (self._spans[0], self._spans[2]):
            found = self._pass(ids, find_all, wait, span)
            trouble = self._bus.link.trouble(self._before[0])
            if found or self._lone or self._bus.over or (trouble is not None and trouble.code):
                break
        return found

    def _pass(self, ids: Sequence[int], find_all: bool, wait: float | None, span: Span) -> list[int]:
        """All ids once, asked for one span."""
        found: list[int] = []
        for device_id in ids:  # who is not asked yet may answer under another name
            self._wanted[can_frames.read_request(device_id, *span, self._bus.read_flag)[0]] = device_id, span
        chunks = [ids[:1], *(ids[start : start + CHUNK] for start in range(1, len(ids), CHUNK))]
        for number, chunk in enumerate(chunks):
            last = number + 1 == len(chunks)
            usual = max(wait or (WAIT if number else FIRST), DRAIN + 2 * self._worst if last else 0.0)
            answered = self._ask(chunk, usual, span)
            if last and not found and not answered:
                answered = self._collect({}, LATE, ())
            for device_id in sorted(answered):
                confirmed = None if device_id in found else self._confirmed(device_id, span)
                if confirmed is not None:
                    found.append(device_id)
                    for _ in range(0 if find_all else TIMED):
                        self._timed(device_id, confirmed)
                if found and not find_all:
                    return found
            self.cut = self._bus.over and not last
            if self.cut:
                break
        return found

    def _confirmed(self, device_id: int, asked: Span) -> Span | None:
        """What this id answers beside what it was `asked`, when it is asked alone; None = nothing, and it is told."""
        for span in self._spans[1:]:
            self._bus.drain()
            if span != asked and self._timed(device_id, span):
                return span
        self._lone.append(device_id)
        self._bus.journal.warn(
            "unconfirmed", f"id {device_id} replied once, but not when handctl asked it alone, so it is not counted"
        )
        return None

    def _timed(self, device_id: int, span: Span) -> bool:
        """Ask one id alone: the time of its answer is that of the bus."""
        if self._bus.over:
            return False
        started, own = self._bus.link.now(), self._own
        answered = self._ask([device_id], max(WAIT + DRAIN, 2 * self._worst), span)
        if device_id not in answered:
            return False
        self._bus.learn(self._bus.link.now() - started, echo=self._own > own)
        return True

    def _ask(self, ids: Sequence[int], seconds: float, span: Span) -> set[int]:
        bus = self._bus
        for device_id in ids:
            identifier = can_frames.read_request(device_id, *span, bus.read_flag)[0]
            self._wanted[identifier] = device_id, span
            self._asked[identifier] = bus.link.now()
            bus.link.send(CanFrame(identifier, bytes([span[1]])), bus.deadline(1.0))
        bus.journal.counters.sent += len(ids)
        self.probes += len(ids)
        return self._collect(set(ids), seconds, self._spans if span == self._spans[0] else (span,))

    def _collect(self, wanted: Collection[int], seconds: float, spans: Collection[Span]) -> set[int]:
        """Listen for answers, until all of `wanted` have come: they count where they answer one of `spans`, () = any."""
        bus, answered = self._bus, set[int]()
        deadline = bus.deadline(seconds)
        while not wanted or not answered.issuperset(wanted):
            frame = bus.receive(deadline)
            if frame is None:
                break
            device_id, span = self._wanted.get(frame.can_id, (0, (0, 0)))
            if not span[1]:
                bus.pass_over(frame)
            elif len(frame.data) == span[1]:
                bus.journal.counters.received += 1
                self._worst = max(self._worst, bus.link.now() - self._asked.get(frame.can_id, bus.link.now()))
                if span == self._spans[0]:
                    self.values[device_id] = frame.data
                if not spans or span in spans:
                    answered.add(device_id)
            elif frame.data == bytes([span[1]]):
                self._own += 1
            else:
                self._short += 1
            if deadline.expired:
                break
        return answered

    @property
    def errors(self) -> int:
        """Error frames since it began."""
        return self._bus.link.error_frames - self._before[0]

    def nothing(self, summary: str) -> HandctlError:
        (errors, damaged), what, link = self._before, self._what, self._bus.link
        damaged, name, trouble = link.damaged - damaged, link.name, link.trouble(errors)
        if trouble is not None and trouble.code:
            failure = bus_failure(name, "the probes", trouble)
            failure.text += f" ({summary})"
            return failure
        code, text, hint = "", "", ""
        if self._lone:
            code, text = "wrong-id", f"id {', '.join(map(str, self._lone))} replied, but to a request for another id"
            hint = "power-cycle the hand, then scan again: it responds with a different id than handctl asked"
        elif self._short:
            code, text = "cut-short", "the replies do not have the requested length"
            hint = "check the bus: this may be another kind of device, or the line is disturbed"
        elif self._own:
            code, text = "echo", "only our own frames came back"
            hint = "check the adapter: it may be in loopback mode, or return the frames that it sends"
        elif damaged:
            code, text = "damaged", f"no {what}, but {said_damaged(damaged, link.damage)}"
            hint = HINTS["damaged"]
        if code:
            return ProtocolError(f"{name}: {text} ({summary})", hint=hint, code=code)
        if self.cut:
            return NoAnswer(f"{name}: no {what} so far ({summary})", hint="use a longer --deadline", code="deadline")
        if trouble is not None:
            text = f"{name}: no {what} replied. The adapter reports no bus error, so another device acknowledged ({summary})"
            return NoAnswer(text, hint=f"scan other ids: --ids 255-4350. If no {what} replies, {NO_ACK_HINT}")
        return NoAnswer(f"{name}: no {what}, complete silence ({summary})", hint=NO_ACK_HINT)


# -- Modbus RTU -------------------------------------------------------------------------------------------------------

PLACE, WORDS = 1546, 2
"""Angles of two fingers (rh56 §3.1), or what an RH56F1 has there: whatever is read shows who answers."""
QUESTION, ANSWER = 8, 5 + 2 * WORDS
ANSWERS = re.compile(rb".%c%c.{%d}" % (modbus_frames.READ, 2 * WORDS, ANSWER - 3), re.DOTALL)
REFUSALS = re.compile(rb"(?=(.\x%x.{3}))" % (modbus_frames.READ | modbus_frames.FAILED), re.DOTALL)
KEPT = 64


class RtuSearch:
    """`trips` are the seconds from the question to an id to its answer, `damaged` counts answers whose sum is wrong. `additional` as of `Scanner`."""

    def __init__(
        self, link: ByteLink, journal: Journal, bound: Deadline | None, find_all: bool, additional: float | None = None
    ) -> None:
        self._link = link
        self._find_all = find_all
        self._beside = additional
        self._journal = journal
        self._bound = bound
        self._asked: dict[int, float] = {}
        self._came = b""
        self.trips: dict[int, float] = {}
        self.damaged: dict[int, int] = {}
        self.probes = 0

    def run(self, ids: Sequence[int], tell: Callable[[int], None], more: float = 0.0) -> list[int]:
        """The ids that answer, the first of them alone unless all are wanted. The first is asked with patience, each other
        one with `more` seconds than its answer needs."""
        wire = (QUESTION + ANSWER) * 10 / self._link.baud if self._link.baud else 0.0
        for number, device_id in enumerate(ids):
            if self._done or (self._bound is not None and self._bound.expired):
                break
            tell(device_id)
            self._ask(device_id)
            first = FIRST_SECONDS if self._beside is None else self._beside
            self._listen(first if number == 0 else wire + TURNAROUND + QUIET_SECONDS + more)
        if not self._done and self._beside is None:
            self._listen(LATE_SECONDS)
        return list(self.trips)

    @property
    def _done(self) -> bool:
        return bool(self.trips) and not self._find_all

    def _ask(self, device_id: int) -> None:
        link = self._link
        request = modbus_frames.rtu(device_id, modbus_frames.read_request(PLACE, WORDS))
        link.write(request, link.deadline(1.0))
        self._asked[device_id] = link.now()
        self._journal.counters.sent += 1
        self.probes += 1

    def _listen(self, seconds: float) -> None:
        link = self._link
        deadline = link.deadline(seconds)
        if self._bound is not None:
            deadline = deadline.earlier(self._bound)
        while not self._done and (chunk := link.read(deadline)):
            self._came += chunk
            self._take()
            self._came = self._came[-KEPT:]
            if deadline.expired:
                break

    def _take(self) -> None:
        """Whole answers to questions that were asked here, wherever they begin."""
        place = 0
        while found := ANSWERS.search(self._came, place):
            frame, place = found[0], found.start() + 1
            if frame[0] not in self._asked:
                continue
            if modbus_frames.crc(frame[:-2]) == frame[-2:]:
                self._heard(frame[0])
            else:
                self.damaged[frame[0]] = self.damaged.get(frame[0], 0) + 1
                self._journal.counters.bad_frames += 1
            self._came, place = self._came[found.end() :], 0
        self._take_refusals()

    def _take_refusals(self) -> None:
        """Who lacks that place and says so is there as well; not who is silent to a gateway."""
        for frame in REFUSALS.findall(self._came):
            known = frame[0] in self._asked and frame[0] not in self.trips
            theirs = known and frame[2] not in (modbus_frames.NO_PATH, modbus_frames.NO_TARGET)
            if theirs and modbus_frames.crc(frame[:-2]) == frame[-2:]:
                self._heard(frame[0])

    def _heard(self, device_id: int) -> None:
        self.trips[device_id] = self._link.now() - self._asked[device_id]
        self._journal.counters.received += 1
