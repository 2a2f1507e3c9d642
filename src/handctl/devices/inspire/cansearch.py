"""Probes of many ids back to back on a CAN bus. Read-only."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from handctl.devices.inspire import canreg
from handctl.devices.inspire.canbus import DAMAGED_HINT, NO_ACK_HINT, CanBus, bus_failure, said_damaged
from handctl.devices.inspire.quiet import Span
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.link import CanFrame

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
            return ProtocolError(text, hint=DAMAGED_HINT, code="damaged")
        if self.cut:
            return NoAnswer(f"{name}: no {what} so far ({summary})", hint="use a longer --deadline", code="deadline")
        if trouble is not None:
            text = f"{name}: no {what} answered. The adapter reports no bus error, so another device acknowledged ({summary})"
            return NoAnswer(text, hint=f"scan other ids: --ids 255-4350. If no {what} answers, {NO_ACK_HINT}")
        return NoAnswer(f"{name}: no {what}, complete silence ({summary})", hint=NO_ACK_HINT)
