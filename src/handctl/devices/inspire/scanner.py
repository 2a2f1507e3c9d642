"""Looking for devices on a serial line: ids and speeds, read-only, never mistaking an echo or noise for a device.

A probe reads two bytes of a register that the id may be asked for on any line (`quiet`): its reply is longer than the
request and names its id. The first pass asks k ids back to back, then waits one window; a late reply still names its id
and counts in any later window, so the shorter wait loses nothing. A window that holds bytes of no frame is asked
again in halves, down to single ids.

An answer to a probe may be late: that of an earlier speed. So a hit is confirmed by another register and length, which no
earlier probe asked (`fresh`), at this speed and then at those before. The first hit measures the line (`measure`).

Windows need a line that carries both directions at once (RS-232). On RS-485 a reply collides with the probes still being
sent: a pass without a hit, or one that meets such a line, is followed by one that asks one id at a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from handctl.devices.inspire.asker import Asker, Findings
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.identity import WRIST, Kind, Look
from handctl.devices.inspire.quiet import Span
from handctl.errors import NoAnswer, ProtocolError
from handctl.model.guide import Guide

DRAIN_SECONDS = 0.05
"""How long to listen behind the last probe of a pass in windows, as long as no round trip was measured ..."""
FIRST_SECONDS = 0.25
"""... behind id 1 at each speed: time for Bluetooth ..."""
SILENCE_SECONDS = 1.0
"""... and behind a pass of one id at a time: what has not come then is silence."""
TWICE_SECONDS = 0.005
"""Between the first probe of a pass in windows and the same in its window: the second one has the time for an answer."""
SINGLE_SECONDS = 0.030
"""Between two ids of the pass that follows silence: on the wire, a delay that varies must not push them together."""
MOST_SINGLE = 0.150
"""However slow the line: the answers overlap, and name their ids."""
PROBE_BYTES = 9
AGAIN_AMONG_OTHERS = 2
"""So many passes more where others speak and nothing was found."""
CONFIRM_SECONDS = (0.3, 0.6, 1.2)
TWIN_READS = 20
TWIN_READS_SLOW = 6
"""On a slow line: each of them takes its round trip."""


class Pass(NamedTuple):
    """Ids at one speed: how many a window, how long a window waits, how long to listen behind the last probe, how many
    speeds come after it."""

    speed: int | None
    ids: Sequence[int]
    window: int
    wait: float
    dwell: float
    more: int = 0


class Scanner(Asker):
    """Scans one line. `window` = ids per reply window (1 = sequential), `wait` = reply window in seconds; `thorough`: silence is asked again, with
    more patience."""

    def __init__(
        self,
        bus: Bus,
        guide: Guide,
        *,
        window: int,
        wait: float,
        find_all: bool,
        probe: Span,
        twin: Span,
        own: Kind,
        thorough: bool = True,
    ) -> None:
        super().__init__(bus, wait, probe)
        self._own = own
        self._probe, self._twin_span = probe, twin
        self._guide = guide
        self._window = window
        self._usual = wait
        self._find_all = find_all
        self._thorough = thorough
        self._doubted: set[int] = set()  # ids that answered in this pass, and not when asked again
        self._asked: list[int] = []  # speeds, the last one last

    def run(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Findings:
        """Scan `ids` at each of `speeds` (None = the link has no speed). The first hit ends it unless all are wanted."""
        link = self._bus.link
        started, first = link.now(), link.baud
        try:
            for each in self._passes(ids, speeds):
                self._pass(each)
                if (self.found.hits and not self._find_all) or self._cut():
                    break
        finally:
            self._guide.done()
            if first is not None and link.can_set_baud:
                link.set_baud(first)
        self.found.seconds = link.now() - started
        return self.found

    # -- passes --------------------------------------------------------------------------------------------------

    def _passes(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Iterator[Pass]:
        """Id 1 at every speed first (factory default), then all in windows, then one at a time where that can matter."""
        rest, usual = ids, self._usual
        if not self._find_all and 1 in ids and len(ids) > 1:
            rest = [i for i in ids if i != 1]
            for speed in speeds:
                yield Pass(speed, [1], 1, usual, FIRST_SECONDS)
        alone = self._window == 1
        dwell = SILENCE_SECONDS if alone and len(ids) > 1 and self._thorough else DRAIN_SECONDS
        todo, asked = list(speeds), list[int | None]()
        while todo and not self._singly:
            speed = todo.pop(0)
            measured = len(self.line.trips)
            yield Pass(speed, rest, self._window, usual, dwell)
            if self.line.speed_matters is False:
                todo.clear()
            elif self.line.slow and not measured:
                todo += asked  # their last answers may have been too late
            asked.append(speed)
        if alone or self.found.beheaded or not self._thorough or (self.found.hits and not self._singly):
            return
        yield from self._single_passes(ids, speeds)

    def _single_passes(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Iterator[Pass]:
        """One id at a time. Where others speak, their speed is the likeliest, and a probe may have met their bytes."""
        for number, speed in enumerate(sorted(speeds, key=lambda speed: speed != self.others_at), 1):
            if number > 1 and self.line.speed_matters is False:
                break
            yield self._single(ids, speed)._replace(more=len(speeds) - number)
        for _ in range(AGAIN_AMONG_OTHERS):
            if self.found.hits or self.others_at not in speeds:
                break
            yield self._single(ids, self.others_at)

    def _single(self, ids: Sequence[int], speed: int | None) -> Pass:
        """One id at a time, at the pace of the line as far as that is known."""
        if not len(self.line.trips):
            wait = max(SINGLE_SECONDS, 1.5 * self._usual)
        else:
            wait = min(MOST_SINGLE, max(self._usual, 2 * self.line.worst + 0.01))
        self.found.single = wait
        return Pass(speed, ids, 1, wait, SILENCE_SECONDS)

    @property
    def _singly(self) -> bool:
        """Whether windows do not fit what was measured: answers collide with the next probes."""
        return self._window > 1 and self.line.half_duplex is True

    def _pass(self, this: Pass) -> None:
        speed, ids = this.speed, this.ids
        self._wait = this.wait
        self._set_speed(speed)
        if speed is not None and self._bus.link.can_set_baud:
            self._asked = [*(each for each in self._asked if each != speed), speed]
        self._doubted.clear()
        answered: dict[int, int] = {}
        # The first probe goes twice: a frame cut by wrong-speed garbage may swallow one.
        groups = [ids[:1]] + [ids[i : i + this.window] for i in range(0, len(ids), this.window)]
        for number, group in enumerate(groups):
            self._tell(this, group, number / len(groups))
            self._wait = this.wait if number or this.window == 1 else min(this.wait, TWICE_SECONDS)
            whole = self._group(group, answered)
            if not whole and len(group) > 1:
                self._split(group, answered)
            elif not whole and self.found.single and group[0] not in answered:
                self._group(group, answered)  # somebody spoke at the same time
            self._confirm(speed, answered, group)
            if (self.found.hits and not self._find_all) or (number < len(groups) - 1 and self._cut()):
                return
            if this.window > 1 and self._singly:
                return
        self._collect(answered, max(0.0, self._patience(this.dwell) - this.wait), alone=len(ids) == 1)
        self._confirm(speed, answered, group)

    def _tell(self, this: Pass, group: Sequence[int], part: float) -> None:
        """How far it is; of one id at a time, which is long, why and how long, too."""
        at = f"{this.speed} bit/s, " if this.speed else ""
        found = f"found {len(self.found.hits)}"
        if not self.found.single:
            self._guide.progress(f"{at}ids {group[0]} to {group[-1]}, {found}, {100 * part:.0f} %")
            return
        asking = len(this.ids) * (this.wait + self._bus.wire_seconds(PROBE_BYTES))
        left = asking * (1.0 - part) + this.dwell + this.more * (asking + this.dwell)
        why = "half duplex" if self._singly else "may be half duplex"
        self._guide.progress(f"{at}id {group[0]}, {found}, {left:.0f} s left. One at a time: {why}")

    def _split(self, group: Sequence[int], answered: dict[int, int]) -> None:
        """Ask a group with garbage again in halves, descending only where garbage shows again."""
        middle = len(group) // 2
        for half in (group[:middle], group[middle:]):
            if half and not self._group(half, answered) and len(half) > 1:
                self._split(half, answered)

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
                # The whole group once more: does another id answer under this name, or was it a single answer?
                again: dict[int, int] = {}
                self._group(group, again)
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
        if not self._ask(device_id, (patience, 2 * patience), self._probe):
            return False
        value = int.from_bytes(self._seen[device_id, self._probe], "little", signed=True)
        self._measure(device_id, speed)
        if self.line.speed_matters is False:
            speed = None
        self.found.hits.append((speed, device_id, value))
        self.found.unconfirmed = [each for each in self.found.unconfirmed if each[1] != device_id]
        wanted, bus.timeout = bus.timeout, max(bus.timeout, self._patience(0.0))
        try:
            if self._twin(device_id):
                self.found.twins.add((speed, device_id))
            self.found.kinds[speed, device_id] = self._kind(device_id)
        finally:
            bus.timeout = wanted
        return True

    def _place(self, speed: int | None, device_id: int) -> bool:
        """Whether this id gives a younger answer, at this speed or at one before; the port stays there."""
        waits = [self._patience(wait) for wait in CONFIRM_SECONDS]
        if self._ask(device_id, waits):
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
            other = 57600 if speed == 115200 else 115200
            link.set_baud(other)
            self._bus.drain()
            line.speed_matters = not self._ask(device_id, (self._patience(0.0),) * 2)
            link.set_baud(speed)
            self._ask(device_id, (self._patience(0.0),) * 2)  # what the other speed left half read is passed over
        if line.half_duplex is None and self._window > 1 and (self._find_all or self.found.single):
            line.half_duplex = not any(self.overlaps(device_id, self._window) for _ in range(2))
        if line.others is None:
            line.others = False

    def _kind(self, device_id: int) -> tuple[Kind | None, str]:
        """What a hit is, and what shows it. Nobody but a wrist answers a wrist's question: then nothing more is asked."""
        if self._own is WRIST:
            return WRIST, ""
        look = Look(self._bus.at(device_id=device_id))
        try:
            return look.who(self._own), look.evidence
        except NoAnswer:
            return self._own, ""  # it answered before: nothing contradicts it
        except ProtocolError as exc:
            return (None, exc.text) if exc.code == "unknown-device" else (self._own, "")

    def _twin(self, device_id: int) -> bool:
        """Two devices with one id: good and bad sums mixed on values that jitter, in 20 reads (RS-232: a Y cable)."""
        bus = self._bus
        wanted, bus.timeout = bus.timeout, min(bus.timeout, max(self._usual, 0.05, self._patience(0.0)))
        good = bad = 0
        reads = TWIN_READS_SLOW if self.line.slow else TWIN_READS
        try:
            for _ in range(reads):
                try:
                    bus.read(*self._twin_span, device_id=device_id, retries=0)
                    good += 1
                except ProtocolError as exc:
                    bad += exc.code in ("bad-checksum", "garbage")
                except NoAnswer:
                    continue  # a lost reply says nothing about a twin
        finally:
            bus.timeout = wanted
        if self.line.others:  # their frames damage answers as well, but not most of them
            return 2 * bad > reads
        return bad > 0 and (good > 0 or bad == reads)
