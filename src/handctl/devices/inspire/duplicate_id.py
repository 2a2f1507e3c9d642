"""Two devices with one id on a line: look for them before anything is written, and refuse. Read-only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from handctl.devices.inspire.register_bus import TWIN_ID, RegisterBus, Span
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.fast_classes import NamedTuple
from handctl.link import FrameLink

if TYPE_CHECKING:
    from handctl.devices.inspire.register_device import RegisterDevice


ROUNDS = 2
"""Questions for each reading; where some are destroyed, and nothing that both hold alike ..."""
MORE, FEW = 5, 2
"""... so many more of each kind in each order, few where nearly all readings are destroyed."""
BEHIND = 0.015
"""Seconds, and a round trip, in which the answer of a second device comes behind the first."""
MOSTLY, SOME = 0.75, 0.2
"""A share of readings destroyed. `SOME` of them and nothing else, in both orders of asking, is no disturbed line."""
DESTROYED = ("bad-checksum", "cut-short", "garbage", "wrong-id", "first-byte-lost", "stale")
"""Codes of what comes of two answers at once. On CAN whatever ends a read: the bus destroys both."""


Row4 = tuple[str, str, str, str]
"""Check, status, evidence, remedy."""


class Observation(NamedTuple):
    """What the reads show.

    verdict   "one", "two", or "" where answers are missing or damaged, and what both would hold alike as well
    evidence  in words
    """

    verdict: str
    evidence: str


class _Tally:
    """Reads of one kind, and how they ended; whether a `refusal` counts as an answer: it arrives as whole."""

    def __init__(self, *, refusal: bool = False) -> None:
        self.refusal = refusal
        self.asked = self.whole = self.destroyed = self.twice = 0

    @property
    def share(self) -> float:
        """Of those that were destroyed."""
        return self.destroyed / self.asked if self.asked else 0.0


def look_for_duplicate_id(device: RegisterDevice, refusal: bool = False) -> Observation:
    """Whether one device has this id; two may refuse alike to tell it, too. Raises LinkError where the line is lost."""
    bus, alike, readings = device.bus, _Tally(refusal=refusal), _Tally()
    spans, same = _readings(device), _alike(device)
    for place, span in enumerate(spans * ROUNDS, 1):
        _ask(bus, span, readings, behind=True)
        _ask(bus, same, alike)
        if not (alike.whole or alike.destroyed or readings.whole or readings.destroyed):
            break  # silence: nobody is there
        if place == len(spans) > 1 and readings.share >= MOSTLY:
            break  # no need to wait for as many more that are destroyed
    if not readings.twice and readings.destroyed and alike.whole == alike.asked:
        both = [(same, alike), (spans[0], readings)]
        for order in (both, both[::-1]):  # a line that damages every n-th reply now damages both kinds
            for span, tally in order * (FEW if readings.share >= MOSTLY else MORE):
                _ask(bus, span, tally)
    number, asked = bus.id, readings.asked + alike.asked
    if readings.twice:
        text = f"one request got two different replies {readings.twice} of {readings.asked} times"
        return Observation("two", f"{text}: two devices have id {number}")
    if readings.share >= SOME and alike.whole == alike.asked:
        text = f"shared readings arrive intact, but {readings.destroyed} of {readings.asked} readings are destroyed"
        return Observation("two", f"{text}: two devices with id {number} reply at the same time")
    if readings.destroyed or readings.whole < readings.asked or alike.whole < alike.asked:
        missing = asked - readings.whole - alike.whole
        return Observation("", f"{missing} of {asked} replies are missing or corrupted, and not only those of readings")
    return Observation("one", f"{asked} replies arrived intact and alone: one device has id {number}")


@contextmanager
def naming_duplicate_id(device: RegisterDevice) -> Iterator[None]:
    """Around the reads before such a write: where answers are destroyed, two devices are told as what they are."""
    before = device.journal.counters.writes
    try:
        yield
    except HandctlError as exc:
        if exc.code in DESTROYED and device.journal.counters.writes == before:
            refuse_duplicate_id(device)
        raise


def identify_alone(device: RegisterDevice, refusal: bool = False) -> None:
    """Look who is there, and that he is alone, see `refuse_duplicate_id`. Raises NotIdentified, and what that raises."""
    with naming_duplicate_id(device):
        device.identify()
    refuse_duplicate_id(device, refusal)


def refuse_duplicate_id(device: RegisterDevice, refusal: bool = False) -> None:
    """Before a write after which a device is found elsewhere, or keeps what it has. Raises DeviceRefused where two would obey.

    `refusal`: the command reads no id, and a device need not tell it.
    """
    bus = device.bus
    if bus.gate is None or bus.gate.assumed or bus.link.replayed:
        return  # nobody looks
    if bus.wire == "tcp" or ("alone", bus.id) in bus.journal.line.met:
        return
    seen = look_for_duplicate_id(device, refusal)
    if seen.verdict == "two":
        raise DeviceRefused(
            f"{bus.where}: {seen.evidence}, and both would obey the command",
            hint="unplug one of them, then run the command again. Nothing was written.",
            code=TWIN_ID,
        )
    bus.journal.line.met.add(("alone", bus.id))


def same_id(device: RegisterDevice, more: str = "") -> Row4:
    """The row of `handctl doctor`; `more` is a further way out. Raises LinkError where the line is lost."""
    seen = look_for_duplicate_id(device)
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
    """One read, sent once, and whether a second reply follows it."""
    tally.asked += 1
    try:
        data = bus.read(*span, retries=0)
        tally.whole += 1
        if behind and (other := bus.behind(*span, BEHIND + (bus.round_trip or 0.0))) is not None:
            tally.twice += other != data
    except (NoAnswer, ProtocolError) as exc:
        tally.destroyed += exc.code in DESTROYED or isinstance(bus.link, FrameLink)
    except HandctlError as exc:
        refused = isinstance(exc, DeviceRefused) and tally.refusal
        if exc.code == "lost" or not (refused or isinstance(bus.link, FrameLink)):
            raise
        tally.whole += refused
        tally.destroyed += not refused
