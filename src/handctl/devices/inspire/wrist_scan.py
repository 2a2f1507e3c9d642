"""`handctl wrist scan`: serial through the common scanner, CAN by probes back to back. Read-only."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import canreg
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import NO_ACK_HINT, CanBus
from handctl.devices.inspire.scan_report import Kind, scan
from handctl.devices.inspire.wrist import Wrist
from handctl.errors import NoAnswer, UsageError
from handctl.guide import Guide
from handctl.link import CanFrame
from handctl.result import Column, Row, Table

KIND = Kind("wrist", probe=(1020, 2), twin=(1020, 4), value="pitch_raw")
CHUNK = 32
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
) -> Table:
    """Look for wrist modules on the line or the bus of `wrist`."""
    if isinstance(wrist.bus, CanBus):
        return _scan_can(wrist.bus, guide, ids, (wait_ms or 20.0) / 1000, find_all)
    assert isinstance(wrist.bus, Bus)
    return scan(wrist.bus, KIND, guide, ids, speeds, window, wait_ms, find_all)


def parse_can_ids(text: str) -> list[int]:
    """``1-254`` -> ids 0..16383 in that order, at most 4096. Raises UsageError."""
    ids: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise UsageError(f"--ids {text}: expected FROM-TO or a list", hint="e.g. --ids 1-254")
        ends = int(first), int(last if dash else first)
        for hand_id in ends:
            canreg.check_id(hand_id)
        ids += range(ends[0], ends[1] + 1)
    if not ids or len(ids) > MOST:
        raise UsageError(
            f"--ids {text}: {len(ids)} ids; a scan asks 1 to {MOST}", hint="scan in parts, e.g. --ids 1-254"
        )
    return list(dict.fromkeys(ids))


def _scan_can(bus: CanBus, guide: Guide, ids: Sequence[int], wait: float, find_all: bool) -> Table:
    link = bus.link
    started, errors = link.now(), link.error_frames
    hits: list[tuple[int, bytes]] = []
    probes = 0
    for start in range(0, len(ids), CHUNK):
        chunk = ids[start : start + CHUNK]
        guide.progress(f"ids {chunk[0]}..{chunk[-1]}, found {len(hits)}")
        answered = _ask(bus, chunk, wait)
        probes += len(chunk)
        for hand_id in sorted(answered):
            again = _ask(bus, [hand_id], wait)
            probes += 1
            if hand_id in again:
                hits.append((hand_id, again[hand_id]))
            else:
                bus.journal.warn("unconfirmed", f"id {hand_id} answered once and not again: not counted")
        if (hits and not find_all) or (bus.bound is not None and bus.bound.expired):
            break
    guide.done()
    seconds = link.now() - started
    summary = f"{probes} read-only probes of pitch_actual, ids {ids[0]}..{ids[-1]}, {seconds:.2f} s"
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
    facts = {"probes": probes, "seconds": round(seconds, 3), "error_frames": link.error_frames - errors}
    table = Table(rows=rows, columns=columns, extra={"scan": facts})
    if not hits and link.error_frames > errors:
        table.failure = NoAnswer(
            f"{link.name}: nobody acknowledged anything ({summary})", hint=NO_ACK_HINT, code="no-ack"
        )
    elif not hits:
        table.failure = NoAnswer(f"{link.name}: no wrist, complete silence ({summary})", hint=NO_ACK_HINT)
    return table


def _ask(bus: CanBus, ids: Sequence[int], wait: float) -> dict[int, bytes]:
    """Probe `ids` back to back; who answered with two bytes."""
    bus.drain()
    wanted = {canreg.read_request(hand_id, 1020, 2, bus.read_flag)[0]: hand_id for hand_id in ids}
    for identifier in wanted:
        bus.link.send(CanFrame(identifier, b"\x02"), bus.link.deadline(1.0).earlier(bus.bound))
        bus.journal.counters.sent += 1
    answered: dict[int, bytes] = {}
    deadline = bus.link.deadline(wait).earlier(bus.bound)
    while len(answered) < len(wanted):
        frame = bus.link.receive(deadline)
        if frame is None or deadline.expired:
            break
        if frame.can_id in wanted and len(frame.data) == 2:
            answered[wanted[frame.can_id]] = frame.data
            bus.journal.counters.received += 1
    return answered
