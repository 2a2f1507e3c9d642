"""Probes of many ids back to back on a CAN bus. Read-only.

Modbus RTU is asked one id at a time; late answers count too (rh56 §2.2). An answer names its id, and its sum tells it from an
echo, a late one of another protocol, and noise.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from handctl.devices.inspire import canreg, modbus
from handctl.devices.inspire.canbus import HINTS, NO_ACK_HINT, CanBus, bus_failure, said_damaged
from handctl.devices.inspire.modbusbus import QUIET_SECONDS
from handctl.devices.inspire.registers import Span
from handctl.devices.inspire.scanner import FIRST_SECONDS, LATE_SECONDS, TURNAROUND
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.link import ByteLink, CanFrame, Deadline
from handctl.model.result import Journal

CHUNK = 32
WAIT, FIRST, DRAIN, LATE = 0.02, 0.25, 0.05, 0.52
"""Seconds: behind a chunk of ids, the likely one, the last one, and all when nobody has answered."""
TIMED = 3
"""Questions more to the first device, where the scan ends with it."""


class CanSearch:
    """Probes of ids back to back, of a span of two bytes or more; a late reply names its id and counts in any later window."""

    def __init__(self, bus: CanBus, span: Span, what: str) -> None:
        self._bus = bus
        self._spans = (span, (span[0] + 2, span[1]))  # the second confirms: its answer is no late one to the first
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
        found: list[int] = []
        for device_id in ids:  # who is not asked yet may answer under another name
            self._wanted[canreg.read_request(device_id, *self._spans[0], self._bus.read_flag)[0]] = (
                device_id,
                self._spans[0],
            )
        chunks = [ids[:1], *(ids[start : start + CHUNK] for start in range(1, len(ids), CHUNK))]
        for number, chunk in enumerate(chunks):
            last = number + 1 == len(chunks)
            usual = max(wait or (WAIT if number else FIRST), DRAIN + 2 * self._worst if last else 0.0)
            answered = self._ask(chunk, usual)
            if last and not found and not answered:
                answered = self._collect({}, LATE, ())
            for device_id in sorted(answered):
                if device_id not in found and self._confirmed(device_id):
                    found.append(device_id)
                if found and not find_all:
                    for _ in range(TIMED):
                        self._timed(device_id)
                    return found
            self.cut = self._bus.over and not last
            if self.cut:
                break
        return found

    def _confirmed(self, device_id: int) -> bool:
        self._bus.drain()
        if self._timed(device_id):
            return True
        self._lone.append(device_id)
        self._bus.journal.warn(
            "unconfirmed", f"id {device_id} answered once, but not when handctl asked it alone, so it is not counted"
        )
        return False

    def _timed(self, device_id: int) -> bool:
        """Ask one id alone: the time of its answer is that of the bus."""
        if self._bus.over:
            return False
        started, own = self._bus.link.now(), self._own
        answered = self._ask([device_id], max(WAIT + DRAIN, 2 * self._worst), again=True)
        if device_id not in answered:
            return False
        self._bus.learn(self._bus.link.now() - started, echo=self._own > own)
        return True

    def _ask(self, ids: Sequence[int], seconds: float, *, again: bool = False) -> set[int]:
        bus, span = self._bus, self._spans[again]
        for device_id in ids:
            identifier = canreg.read_request(device_id, *span, bus.read_flag)[0]
            self._wanted[identifier] = device_id, span
            self._asked[identifier] = bus.link.now()
            bus.link.send(CanFrame(identifier, bytes([span[1]])), bus.deadline(1.0))
        bus.journal.counters.sent += len(ids)
        self.probes += len(ids)
        return self._collect(set(ids), seconds, self._spans if not again else (span,))

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
        """Why nothing was found."""
        (errors, damaged), what = self._before, self._what
        damaged = self._bus.link.damaged - damaged
        name = self._bus.link.name
        trouble = self._bus.link.trouble(errors)
        if trouble is not None and trouble.code:
            failure = bus_failure(name, "the probes", trouble)
            failure.text += f" ({summary})"
            return failure
        if self._lone:
            hint = "power-cycle the hand, then scan again: it answers under a different id than handctl asked"
            return ProtocolError(
                f"{name}: id {', '.join(map(str, self._lone))} answered, but not when it was asked ({summary})",
                hint=hint,
                code="wrong-id",
            )
        if self._short:
            hint = "check the bus: this may be another kind of device, or the line is disturbed"
            return ProtocolError(
                f"{name}: the answers do not have the requested length ({summary})", hint=hint, code="cut-short"
            )
        if self._own:
            hint = "check the adapter: it may be in loopback mode, or return the frames that it sends"
            return ProtocolError(f"{name}: only our own frames came back ({summary})", hint=hint, code="echo")
        if damaged:
            text = f"{name}: no {what}, but {said_damaged(damaged, self._bus.link.damage)} ({summary})"
            return ProtocolError(text, hint=HINTS["damaged"], code="damaged")
        if self.cut:
            return NoAnswer(f"{name}: no {what} so far ({summary})", hint="use a longer --deadline", code="deadline")
        if trouble is not None:
            text = f"{name}: no {what} answered. The adapter reports no bus error, so another device acknowledged ({summary})"
            return NoAnswer(text, hint=f"scan other ids: --ids 255-4350. If no {what} answers, {NO_ACK_HINT}")
        return NoAnswer(f"{name}: no {what}, complete silence ({summary})", hint=NO_ACK_HINT)


# -- Modbus RTU -------------------------------------------------------------------------------------------------------

PLACE, WORDS = 1546, 2
"""Angles of two fingers (rh56 §3.1), or what an RH56F1 has there: whatever is read shows who answers."""
QUESTION, ANSWER = 8, 5 + 2 * WORDS
HEAD = bytes([modbus.READ, 2 * WORDS])
KEPT = 64


class RtuSearch:
    """`trips` are the seconds from the question to an id to its answer, `damaged` counts answers whose sum is wrong. `beside` as of `Scanner`."""

    def __init__(
        self, link: ByteLink, journal: Journal, bound: Deadline | None, find_all: bool, beside: float | None = None
    ) -> None:
        self._link = link
        self._find_all = find_all
        self._beside = beside
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
        request = modbus.rtu(device_id, modbus.read_request(PLACE, WORDS))
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
        place = self._came.find(HEAD)
        while place >= 0:
            frame = self._came[place - 1 : place - 1 + ANSWER] if place else b""
            if len(frame) == ANSWER and frame[0] in self._asked:
                if modbus.crc(frame[:-2]) == frame[-2:]:
                    self.trips[frame[0]] = self._link.now() - self._asked[frame[0]]
                    self._journal.counters.received += 1
                else:
                    self.damaged[frame[0]] = self.damaged.get(frame[0], 0) + 1
                    self._journal.counters.bad_frames += 1
                self._came = self._came[place - 1 + ANSWER :]
                place = -1
            place = self._came.find(HEAD, place + 1)
