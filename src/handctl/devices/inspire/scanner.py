"""Looking for hands: ids 1..254 at the three documented speeds, read-only, never mistaking an echo or noise for one.

A probe reads two bytes of system_voltage: its reply is longer than the request and names its id. Sequential: one
probe, one reply window. Windowed: the probes of k ids back to back, then one window; a late reply still names its id
and counts in any later window, so the shorter wait loses nothing. A window that holds bytes of no frame is asked
again in halves, down to single ids. Every hit counts after a second, equal answer.

Windowing needs a full-duplex line (RS-232, Bluetooth): on RS-485 a reply collides with the probes still being sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from handctl.devices.inspire import eb90
from handctl.devices.inspire.bus import HINTS, SILENCE_HINT, Bus
from handctl.devices.inspire.eb90 import Decoder
from handctl.devices.inspire.exo import ExoHand
from handctl.devices.inspire.registers import BAUD_RATES
from handctl.errors import NoAnswer, ProtocolError, UsageError
from handctl.guide import Guide
from handctl.result import Column, Row, Table

PROBE_ADDRESS, PROBE_COUNT = 1472, 2
DRAIN_SECONDS = 0.05
TRICKLE_SECONDS = 0.2
"""A reply that comes in pieces may outlast its window by this much."""
TWIN_READS = 20
TWIN_ADDRESS, TWIN_COUNT = 1546, 12


@dataclass(slots=True)
class Findings:
    """What a scan saw: `hits` (speed, id, voltage), `twins`, replies with a wrong sum by id (`damaged`), answers under an id that
    does not answer when asked alone (`foreign`), `echo`, bytes of no
    reply (`garbage`), probes and windows used."""

    hits: list[tuple[int | None, int, int]] = field(default_factory=list)
    twins: set[tuple[int | None, int]] = field(default_factory=set)
    unconfirmed: list[tuple[int | None, int]] = field(default_factory=list)
    damaged: dict[int, int] = field(default_factory=dict)
    foreign: int = 0
    echo: bool = False
    garbage: int = 0
    probes: int = 0
    windows: int = 0
    seconds: float = 0.0


class Scanner:
    """Scans one line. `window` = ids per reply window (1 = sequential), `wait` = reply window in seconds."""

    def __init__(self, bus: Bus, guide: Guide, *, window: int, wait: float, find_all: bool) -> None:
        self._bus = bus
        self._guide = guide
        self._window = window
        self._wait = wait
        self._find_all = find_all
        self._decoder = Decoder()
        self.found = Findings()

    def run(self, ids: Sequence[int], speeds: Sequence[int | None]) -> Findings:
        """Scan `ids` at each of `speeds` (None = the link has no speed). The first hit ends it unless all are wanted."""
        link = self._bus.link
        started, first = link.now(), link.baud
        try:
            for speed in self._quick_first(ids, speeds):
                if self.found.hits and not self._find_all:
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
        self._decoder = Decoder([eb90.read_reply_prefix(i, PROBE_ADDRESS, PROBE_COUNT) for i in range(1, 255)])
        answered: dict[int, int] = {}
        # The first probe goes twice: a frame cut by wrong-speed garbage may swallow one.
        groups = [ids[:1]] + [ids[i : i + self._window] for i in range(0, len(ids), self._window)]
        for number, group in enumerate(groups):
            self._guide.progress(
                f"{f'{speed} baud, ' if speed else ''}ids {group[0]}..{group[-1]}, found {len(self.found.hits)}"
                f", {100 * number // len(groups)} %"
            )
            if not self._group(group, answered) and len(group) > 1:
                self._split(group, answered)
            self._confirm(speed, answered, group)
            if self.found.hits and not self._find_all:
                return
            if bus.bound is not None and bus.bound.expired:
                return
        self._collect(answered, DRAIN_SECONDS)
        self._confirm(speed, answered, group)

    def _split(self, group: list[int], answered: dict[int, int]) -> None:
        """Ask a group with garbage again in halves, descending only where garbage shows again."""
        middle = len(group) // 2
        for half in (group[:middle], group[middle:]):
            if half and not self._group(half, answered) and len(half) > 1:
                self._split(half, answered)

    def _group(self, group: list[int], answered: dict[int, int]) -> bool:
        """Probe `group` in one window. False when bytes came that belong to no valid reply."""
        bus = self._bus
        probes = b"".join(eb90.read_request(i, PROBE_ADDRESS, PROBE_COUNT) for i in group)
        wire = bus.wire_seconds(len(probes))
        bus.link.write(probes, bus.link.deadline(self._wait + wire + 1.0).earlier(bus.bound))
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
        deadline = bus.link.deadline(seconds).earlier(bus.bound)
        last = bus.link.deadline(seconds + TRICKLE_SECONDS).earlier(bus.bound)
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
        while True:
            try:
                frame = decoder.next()
            except ProtocolError:
                bus.journal.counters.bad_frames += 1
                self.found.damaged[decoder.rejected[2]] = self.found.damaged.get(decoder.rejected[2], 0) + 1
                continue
            if frame is None:
                break
            answered[frame.id] = int.from_bytes(frame.data, "little", signed=True)
            bus.journal.counters.received += 1
        garbage = decoder.skipped - before
        self.found.garbage += garbage
        bus.journal.counters.stray_bytes += garbage
        return garbage

    def _confirm(self, speed: int | None, answered: dict[int, int], group: list[int]) -> None:
        """Ask each new id again by itself: only a second answer makes a hit; then look for a twin."""
        known = {(hit_speed, device_id) for hit_speed, device_id, _ in self.found.hits}
        for device_id in sorted(answered):
            if (speed, device_id) in known or (speed, device_id) in self.found.unconfirmed:
                continue
            again: dict[int, int] = {}
            for _ in range(2):
                self._group([device_id], again)
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
        answered.clear()

    def _twin(self, device_id: int) -> bool:
        """Two devices with one id: good and bad sums mixed on values that jitter, in 20 reads (RS-232: a Y cable)."""
        bus = self._bus
        wanted, bus.timeout = bus.timeout, min(bus.timeout, max(self._wait, 0.05))
        good = bad = 0
        try:
            for _ in range(TWIN_READS):
                try:
                    bus.read(TWIN_ADDRESS, TWIN_COUNT, device_id=device_id, retries=0)
                    good += 1
                except ProtocolError as exc:
                    bad += exc.code in ("bad-checksum", "garbage")
                except NoAnswer:
                    continue  # a lost reply says nothing about a twin
        finally:
            bus.timeout = wanted
        return bad > 0 and (good > 0 or bad == TWIN_READS)


def rows_of(found: Findings, link_name: str) -> list[Row]:
    """Scan rows by the contract: family, link, baud, id; beside them the voltage reading and a twin suspicion."""
    return [
        {
            "family": "exo",
            "link": link_name,
            "baud": speed,
            "id": device_id,
            "system_voltage": voltage,
            "suspicion": "two devices with this id?" if (speed, device_id) in found.twins else None,
        }
        for speed, device_id, voltage in found.hits
    ]


COLUMNS = (
    Column("family", "Family"),
    Column("link", "Link"),
    Column("baud", "Baud", right=True),
    Column("id", "Id", right=True),
    Column("system_voltage", "Voltage (raw)", right=True),
    Column("suspicion", "Suspicion"),
)


def parse_ids(text: str) -> list[int]:
    """``1-254`` or ``1,2,10-20`` -> ids in that order. Raises UsageError."""
    ids: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise UsageError(f"--ids {text}: expected FROM-TO or a list", hint="e.g. --ids 1-254 or --ids 1,2,7")
        ends = int(first), int(last if dash else first)
        for device_id in ends:
            eb90.check_id(device_id)
        ids += range(ends[0], ends[1] + 1)
    if not ids:
        raise UsageError(f"--ids {text}: no id in it", hint="e.g. --ids 1-254")
    return list(dict.fromkeys(ids))


def parse_speeds(text: str) -> list[int]:
    """``115200,57600`` -> speeds the manual has. Raises UsageError."""
    known = ", ".join(map(str, BAUD_RATES.values()))
    speeds = []
    for part in text.split(","):
        if not part.strip().isdecimal() or int(part) not in BAUD_RATES.values():
            raise UsageError(
                f"--speeds {text}: {part.strip()!r} is not a speed of this hand", hint=f"{known} (exo §2.3.2)"
            )
        speeds.append(int(part))
    return list(dict.fromkeys(speeds))


def default_wait(link_name: str) -> float:
    """Reply window in seconds: 20 ms, or 30 ms where the adapter's latency timer would eat those."""
    import os

    port = os.path.basename(os.path.realpath(link_name))
    try:
        with open(f"/sys/bus/usb-serial/devices/{port}/latency_timer", encoding="ascii") as file:
            return 0.030 if int(file.read()) > 6 else 0.020
    except (OSError, ValueError):
        return 0.020


def scan(
    hand: ExoHand,
    guide: Guide,
    ids: Sequence[int],
    speeds: Sequence[int],
    window: int,
    wait_ms: float | None,
    find_all: bool,
) -> Table:
    """Run a scan and put it into words. Finding nothing is an error that says what was tried and what came instead."""
    bus = hand.bus
    link = bus.link
    wait = wait_ms / 1000 if wait_ms is not None else default_wait(link.name)
    tried: list[int | None] = list(speeds) if link.can_set_baud else [link.baud]
    found = Scanner(bus, guide, window=window, wait=wait, find_all=find_all).run(ids, tried)
    method = "one by one" if window == 1 else f"{window} ids per window"
    speeds_text = ", ".join(str(speed) if speed else "the link's speed" for speed in tried)
    summary = (
        f"{found.probes} probes in {found.windows} windows, {found.seconds:.2f} s; asked for: ids {ids[0]}..{ids[-1]} at "
        f"{speeds_text}, {method} of {wait * 1000:g} ms"
    )
    hand.journal.info("scanned", summary)
    for speed, device_id in found.unconfirmed:
        hand.journal.warn("unconfirmed", f"id {device_id} at {speed} answered once and not again: not counted")
    table = Table(rows=rows_of(found, link.name), columns=COLUMNS, extra={"scan": _facts(found, window, wait)})
    for speed, device_id in sorted(found.twins, key=str):
        hand.journal.warn(
            "twin-id",
            f"id {device_id} at {speed}: good and bad checksums mix on values that jitter: two hands with one id?",
            hint="leave one hand on the line and give it another id",
        )
    if not found.hits:
        table.failure = _nothing(found, link.name, summary)
    elif not find_all:
        hand.journal.info("first", "ended at the first hand; --all looks for more")
    return table


def _facts(found: Findings, window: int, wait: float) -> dict[str, object]:
    return {
        "window": window,
        "reply_window_ms": round(wait * 1000, 3),
        "probes": found.probes,
        "windows": found.windows,
        "seconds": round(found.seconds, 3),
        "echo": found.echo,
        "garbage_bytes": found.garbage,
    }


def _nothing(found: Findings, name: str, summary: str) -> NoAnswer | ProtocolError:
    twice = [device_id for device_id, count in found.damaged.items() if count >= 2]
    if twice:
        return ProtocolError(
            f"{name}: id {', '.join(map(str, twice))} answered, but each time with a wrong checksum ({summary})",
            hint="two hands with one id, or a disturbed line: leave one hand on the line, check cable and ground",
            code="bad-checksum",
        )
    if found.foreign:
        ids = ", ".join(str(device_id) for _, device_id in found.unconfirmed)
        return ProtocolError(
            f"{name}: answers under id {ids} came, but not when that id was asked ({summary})",
            hint=HINTS["wrong-id"],
            code="wrong-id",
        )
    if found.echo:
        return ProtocolError(
            f"{name}: no hand, only our own bytes came back ({summary})", hint=HINTS["echo"], code="echo"
        )
    if found.garbage:
        return ProtocolError(
            f"{name}: no hand, but {found.garbage} bytes that form no valid answer ({summary})",
            hint=HINTS["garbage"],
            code="garbage",
        )
    return NoAnswer(
        f"{name}: no hand, complete silence ({summary})",
        hint=SILENCE_HINT.replace("--id 1 at 115200, `handctl exo scan`, ", ""),
    )
