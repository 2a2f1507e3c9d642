"""Two devices with one id on one line: seen by reading what differs between two units, again and again (inspire §4.14).

Both hear each question. Their answers come together and damage each other, but for what both hold alike: then the id itself
arrives whole and readings do not. Or they come one behind the other, and differ. Two that read the same at each moment
cannot be told from one. Read-only.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.link import FrameLink

if TYPE_CHECKING:
    from handctl.devices.inspire.base import RegisterDevice
    from handctl.devices.inspire.quiet import Span
    from handctl.devices.inspire.registers import RegisterBus

ROUNDS = 2
"""Questions for each reading; where they leave it open ..."""
MORE = 10
"""... so many more for the first of them, and for what both hold alike."""
BEHIND = 0.015
"""Seconds, and a round trip, in which the answer of a second device comes behind the first."""
MOSTLY = 0.75
"""This share of readings destroyed, and nothing else, is no disturbed line; with more questions a fifth is enough."""
SOME = 0.2
DESTROYED = ("bad-checksum", "cut-short", "garbage", "wrong-id", "first-byte-lost", "stale")
"""Codes of what comes of two answers at once. On CAN whatever ends a read: the bus destroys both."""


Row4 = tuple[str, str, str, str]
"""Check, status, evidence, remedy."""


class Seen(NamedTuple):
    """What the reads show.

    verdict   "one", "two", or "" where answers are missing or damaged, and what both would hold alike as well
    evidence  in words
    """

    verdict: str
    evidence: str


class _Tally:
    """Reads of one kind, and how they ended."""

    def __init__(self) -> None:
        self.asked = self.whole = self.destroyed = self.twice = 0

    @property
    def share(self) -> float:
        """Of those that were destroyed."""
        return self.destroyed / self.asked if self.asked else 0.0


def look(device: RegisterDevice) -> Seen:
    """Whether one device has this id. Raises LinkError where the line is lost."""
    bus, alike, readings = device.bus, _Tally(), _Tally()
    spans, same = _readings(device), _alike(device)
    for span in spans * ROUNDS:
        _ask(bus, same, alike)
        _ask(bus, span, readings, behind=True)
        if not (alike.whole or alike.destroyed or readings.whole or readings.destroyed):
            break  # silence: nobody is there
    if not readings.twice and readings.destroyed and alike.whole == alike.asked and readings.share < MOSTLY:
        for _ in range(MORE):
            _ask(bus, spans[0], readings)
            _ask(bus, same, alike)
    number, asked = bus.id, readings.asked + alike.asked
    if readings.twice:
        text = f"one request got two different answers {readings.twice} of {readings.asked} times"
        return Seen("two", f"{text}: two devices have id {number}")
    enough = MOSTLY if readings.asked <= len(spans) * ROUNDS else SOME
    if readings.share >= enough and alike.whole == alike.asked:
        text = f"shared readings arrive intact, but {readings.destroyed} of {readings.asked} readings are destroyed"
        return Seen("two", f"{text}: two devices with id {number} answer at once")
    if readings.destroyed or readings.whole < readings.asked or alike.whole < alike.asked:
        missing = asked - readings.whole - alike.whole
        return Seen("", f"{missing} of {asked} answers are missing or damaged, not those of readings alone")
    return Seen("one", f"{asked} answers arrived intact and alone: one device has id {number}")


@contextmanager
def named(device: RegisterDevice) -> Iterator[None]:
    """Around the reads before such a write: where answers are destroyed, two devices are told as what they are."""
    before = device.journal.counters.writes
    try:
        yield
    except HandctlError as exc:
        if exc.code in DESTROYED and device.journal.counters.writes == before:
            refuse(device)
        raise


def identify(device: RegisterDevice) -> None:
    """Look who is there, and that he is alone. Raises NotIdentified, and what `refuse` raises."""
    with named(device):
        device.identify()
    refuse(device)


def refuse(device: RegisterDevice) -> None:
    """Before a write after which a device is found elsewhere, or keeps what it has. Raises DeviceRefused where two would obey."""
    bus = device.bus
    if bus.gate is None or bus.gate.assumed or bus.link.replayed:
        return  # nobody looks
    if bus.wire == "tcp" or ("alone", bus.id) in bus.journal.line.met:
        return
    seen = look(device)
    if seen.verdict == "two":
        raise DeviceRefused(
            f"{bus.where}: {seen.evidence}, and both would obey the command",
            hint="unplug one of them, then run the command again. Nothing was written.",
            code="twin-id",
        )
    bus.journal.line.met.add(("alone", bus.id))


def same_id(device: RegisterDevice, more: str = "") -> Row4:
    """The row of `handctl doctor`; `more` is a further way out. Raises LinkError where the line is lost."""
    seen = look(device)
    if seen.verdict == "two":
        new = f": `handctl {device.kind} id 2`" if device.map.get("id") is not None else ""
        return "same_id", "fail", seen.evidence, f"unplug one of them, then change the id of the other{new}{more}"
    return "same_id", "ok" if seen.verdict else "skipped", seen.evidence, ""


def _readings(device: RegisterDevice) -> list[Span]:
    """What is measured, in words: it differs from one unit to the next. In one frame each where the wire is CAN."""
    found = []
    for name in device.live:
        register = device.map.get(name)
        if register is not None and register.size == 2:
            found.append((register.address, min(len(register.span), device.bus.max_count)))
    return found[:4]


def _alike(device: RegisterDevice) -> Span:
    """What two devices with one id hold alike: the id, or the error bits of two that are well."""
    register = device.map.get("id") or device.map["error_1"]
    return register.address, max(2, register.size) if isinstance(device.link, FrameLink) else register.size


def _ask(bus: RegisterBus, span: Span, tally: _Tally, *, behind: bool = False) -> None:
    """One read, asked once, and whether another answer comes behind it."""
    tally.asked += 1
    try:
        data = bus.read(*span, retries=0)
        tally.whole += 1
        if behind and (other := bus.behind(*span, BEHIND + (bus.round_trip or 0.0))) is not None:
            tally.twice += other != data
    except (NoAnswer, ProtocolError) as exc:
        tally.destroyed += exc.code in DESTROYED or isinstance(bus.link, FrameLink)
    except HandctlError as exc:
        if exc.code == "lost" or not isinstance(bus.link, FrameLink):
            raise
        tally.destroyed += 1
