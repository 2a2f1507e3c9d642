"""`handctl wrist scan`: serial through the common scanner, CAN by probes back to back. Read-only."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import canreg
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import DAMAGED_HINT, NO_ACK_HINT, CanBus, bus_failure, said_damaged
from handctl.devices.inspire.identity import WRIST
from handctl.devices.inspire.scan_report import Target, scan
from handctl.devices.inspire.wrist.device import WIRING_HINT, Wrist
from handctl.errors import HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.link import CanFrame
from handctl.model.guide import Guide
from handctl.model.param import ids_in
from handctl.model.result import Column, Row, Table

TARGET = Target(WRIST, probe=(1020, 2), twin=(1020, 4), value="pitch_raw", silence_hint=WIRING_HINT)
CHUNK = 32
DRAIN_SECONDS = 0.05
TIMED = 3
"""Questions more to the first hand, where the scan ends with it."""
MOST = 4096
"""Ids in one CAN scan at the most; all 16383 would only be traffic for the others on the bus."""


def scan_wrist(
    wrist: Wrist,
    guide: Guide,
    ids: Sequence[int],
    speeds: Sequence[int],
    window: int,
    wait_ms: float | None,
    find_all: bool,
    thorough: bool = True,
) -> Table:
    """Look for wrist modules on the line or the bus of `wrist`."""
    if isinstance(wrist.bus, CanBus):
        return _scan_can(wrist.bus, guide, ids, (wait_ms or 20.0) / 1000, find_all)
    assert isinstance(wrist.bus, Bus)
    return scan(wrist.bus, TARGET, guide, ids, speeds, window, wait_ms, find_all, thorough)


def parse_can_ids(text: str) -> list[int]:
    """``1-254`` -> ids 0..16383 in that order, at most 4096. Raises UsageError."""
    ids = ids_in(text, canreg.check_id)
    if len(ids) > MOST:
        raise UsageError(
            f"--ids {text}: these are {len(ids)} ids, but a scan asks 1 to {MOST}",
            hint="scan in parts, such as --ids 1-254",
        )
    return ids


def _scan_can(bus: CanBus, guide: Guide, ids: Sequence[int], wait: float, find_all: bool) -> Table:
    link = bus.link
    started, errors, damaged = link.now(), link.error_frames, link.damaged
    search = _CanSearch(bus, wait)
    hits: list[tuple[int, bytes]] = []
    cut = False
    for start in range(0, len(ids), CHUNK):
        chunk = ids[start : start + CHUNK]
        guide.progress(f"ids {chunk[0]} to {chunk[-1]}, found {len(hits)}")
        hits += search.confirmed(chunk, last=start + CHUNK >= len(ids))
        if hits and not find_all:
            search.measure(hits[0][0])
            break
        cut = bus.over and start + CHUNK < len(ids)
        if cut:
            break
    guide.done()
    seconds = link.now() - started
    asked = f"id {ids[0]}" if len(ids) == 1 else f"ids {ids[0]} to {ids[-1]}"
    many = "probe" if search.probes == 1 else "probes"
    summary = f"{search.probes} read-only {many} of pitch_actual, {asked}, {seconds:.2f} s"
    if cut:
        summary += ", ended by --deadline before all were asked"
    bus.journal.info("scanned", summary)
    rows: list[Row] = [
        {
            "family": "wrist",
            "link": link.name,
            "baud": None,
            "id": hand_id,
            "pitch_raw": int.from_bytes(data, "little", signed=True),
        }
        for hand_id, data in hits
    ]
    columns = (
        Column("family", "Family"),
        Column("link", "Link"),
        Column("id", "Id", right=True),
        Column("pitch_raw", "pitch_raw", right=True),
    )
    facts = {"probes": search.probes, "seconds": round(seconds, 3), "error_frames": link.error_frames - errors}
    table = Table(rows=rows, columns=columns, extra={"scan": facts})
    if not hits:
        table.failure = search.nothing(summary, errors, link.damaged - damaged, cut)
    return table


class _CanSearch:
    """Probes of ids back to back; a late reply names its id and counts in any later window."""

    def __init__(self, bus: CanBus, wait: float) -> None:
        self._bus = bus
        self._wait = wait
        self._wanted: dict[int, int] = {}
        self._known: set[int] = set()
        self.probes = 0
        self._own = self._short = 0
        self._lone: list[int] = []

    def confirmed(self, ids: Sequence[int], last: bool) -> list[tuple[int, bytes]]:
        """Those of `ids` (and of earlier ones, late) that answer twice."""
        answered = self._ask(ids, self._wait + (DRAIN_SECONDS if last else 0.0))
        hits = []
        for hand_id in sorted(answered):
            if hand_id in self._known:
                continue  # answered twice to an earlier probe
            self._bus.drain()  # only an answer to this very probe confirms
            again = self._timed(hand_id)
            if hand_id in again:
                hits.append((hand_id, again[hand_id]))
                self._known.add(hand_id)
            else:
                self._lone.append(hand_id)
                self._bus.journal.warn(
                    "unconfirmed", f"id {hand_id} answered once, but not when it was asked alone. It is not counted"
                )
        return hits

    def _timed(self, hand_id: int) -> dict[int, bytes]:
        """Ask one id alone: the time of its answer is that of the bus."""
        started, own = self._bus.link.now(), self._own
        answered = self._ask([hand_id], self._wait + DRAIN_SECONDS)
        if answered:
            self._bus.learn(self._bus.link.now() - started, echo=self._own > own)
        return answered

    def measure(self, hand_id: int) -> None:
        """Ask a hand that was found a few times more, for how much the time of an answer varies."""
        for _ in range(TIMED):
            if not self._bus.over:
                self._timed(hand_id)

    def _ask(self, ids: Sequence[int], seconds: float) -> dict[int, bytes]:
        bus = self._bus
        asked = {canreg.read_request(hand_id, 1020, 2, bus.read_flag)[0]: hand_id for hand_id in ids}
        self._wanted.update(asked)
        for identifier in asked:
            bus.link.send(CanFrame(identifier, b"\x02"), bus.deadline(1.0))
        bus.journal.counters.sent += len(asked)
        self.probes += len(asked)
        answered: dict[int, bytes] = {}
        deadline = bus.deadline(seconds)
        while not set(asked.values()) <= set(answered):
            frame = bus.receive(deadline)
            if frame is None:
                break
            if frame.can_id in self._wanted and len(frame.data) == 2:
                answered[self._wanted[frame.can_id]] = frame.data
                bus.journal.counters.received += 1
            elif frame.can_id in self._wanted and frame.data == b"\x02":
                self._own += 1
            elif frame.can_id in self._wanted:
                self._short += 1
            else:
                bus.pass_over(frame)
            if deadline.expired:
                break
        return answered

    def nothing(self, summary: str, errors: int, damaged: int, cut: bool) -> HandctlError:
        """Why nothing was found; `errors` were there before."""
        name = self._bus.link.name
        trouble = self._bus.link.trouble(errors)
        if trouble is not None and trouble.code:
            failure = bus_failure(name, "the probes", trouble)
            failure.text += f" ({summary})"
            return failure
        if self._lone:
            hint = "power-cycle the hand, then scan again: it answers under another id than was asked"
            return ProtocolError(
                f"{name}: id {', '.join(map(str, self._lone))} answered, but not when it was asked ({summary})",
                hint=hint,
                code="wrong-id",
            )
        if self._short:
            hint = "check the bus: this is another kind of device, or the line is disturbed"
            return ProtocolError(
                f"{name}: the answers have another length than was asked ({summary})", hint=hint, code="cut-short"
            )
        if self._own:
            hint = "check the adapter: it is in loopback mode, or hands out the frames that it sends"
            return ProtocolError(f"{name}: only our own frames came back ({summary})", hint=hint, code="echo")
        if damaged:
            text = f"{name}: no wrist, but {said_damaged(damaged, self._bus.link.damage)} ({summary})"
            return ProtocolError(text, hint=DAMAGED_HINT, code="damaged")
        if cut:
            return NoAnswer(f"{name}: no wrist so far ({summary})", hint="give a longer --deadline", code="deadline")
        if trouble is not None:
            text = f"{name}: no wrist answered. The adapter reports no bus error, so another device acknowledged ({summary})"
            return NoAnswer(text, hint=f"scan other ids: --ids 255-4350. If no wrist answers, {NO_ACK_HINT}")
        return NoAnswer(f"{name}: no wrist, complete silence ({summary})", hint=NO_ACK_HINT)
