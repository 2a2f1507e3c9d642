"""Questions in Modbus RTU to many ids of a line, one at a time, and the answers that come, late ones too. Read-only (rh56 §2.2).

An answer names its id, and its sum tells it from an echo, a late one of another protocol, and noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from handctl.devices.inspire import modbus
from handctl.devices.inspire.modbusbus import QUIET_SECONDS
from handctl.devices.inspire.scanner import FIRST_SECONDS, LATE_SECONDS, TURNAROUND
from handctl.link import ByteLink, Deadline
from handctl.model.result import Journal

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
