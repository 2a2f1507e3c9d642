"""Looking for a device of this family at a link's present speed, for `handctl scan`: the family's own scan, made quiet."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from handctl.devices.inspire import eb90
from handctl.devices.inspire.asker import Asker
from handctl.devices.inspire.base import RegisterDevice
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.identity import Kind, Look
from handctl.devices.inspire.mishaps import foreign_in
from handctl.devices.inspire.quiet import Span
from handctl.devices.inspire.scan import Sweep
from handctl.devices.inspire.target import Target
from handctl.errors import NoAnswer, ProtocolError
from handctl.link import Deadline, Link
from handctl.model.quest import Quest
from handctl.model.result import Journal, Row

BURST = 8
"""Questions back to back, of which the first is answered while the last are sent."""
ASIDE = 0.02
"""Seconds for a burst to be sent beyond its time on the wire."""


WAIT = 0.12
"""Seconds for the answer of one id, with room for Bluetooth."""


def asked(
    link: Link, journal: Journal, bound: Deadline, ids: Sequence[int], timeout: float | None, target: Target
) -> list[Row]:
    """Rows of whoever answers to `ids` at the link's present speed. Raises what came instead of a device."""
    quest = Quest(ids=ids, baud=getattr(link, "baud", None) or 0, patience=timeout, progress=journal.progress)
    Sweep(link, journal, bound, quest, [target], beside=timeout or WAIT).run()
    if quest.failure is not None and not quest.rows:
        if quest.failure.code == "deadline":
            raise NoAnswer(quest.failure.text, hint=quest.failure.hint)  # it is the search's, which says so itself
        raise quest.failure
    return quest.rows


def identified(device: RegisterDevice, own: Kind) -> tuple[str, str, str]:
    """Status, evidence and remedy of a look at who answers. Raises what the look raises."""
    look = Look(device.bus)
    kind = look.who(own)
    if kind is own:
        return "ok", f"nothing contradicts {own.words}: {look.evidence}", ""
    command = f"use `{kind.command}`, the command for it"
    return "fail", f"this is {kind.words}, not {own.words}: {look.evidence}", command


def ignores_speed(device: RegisterDevice) -> bool:
    """Whether a device that has answered does so at another speed of the port as well. Leaves the port as it was."""
    bus = device.bus
    if not isinstance(bus, Bus) or not bus.link.can_set_baud or bus.link.baud is None:
        return False
    was, line = bus.link.baud, bus.journal.line
    wait = max(0.05, 2 * (bus.round_trip or 0.0) + 0.03)
    bus.link.set_baud(57600 if was == 115200 else 115200)
    try:
        line.speed_matters = all(bus.pace(wait) is None for _ in range(2))
    finally:
        bus.link.set_baud(was)
        bus.pace(wait)  # what the other speed left half read is passed over
    return not line.speed_matters


def measure(device: RegisterDevice, long: Span, probe: Span, unasked: bytes) -> None:
    """Fill the profile of the line with what reading shows; `unasked` is what came before anything was sent.

    A `long` answer is read for its packets. Whatever fails is left open: the series of reads tells that.
    """
    bus = device.bus
    if not isinstance(bus, Bus):
        return
    line = bus.journal.line
    if foreign_in(unasked, b"", lambda _frame: False):
        line.others = True
    if not len(line.trips):
        return
    with suppress(NoAnswer, ProtocolError):
        for _ in range(2):
            bus.read(*long, retries=0)
    asker = Asker(bus, ASIDE, probe)
    line.half_duplex = not any(asker.overlaps(bus.id, BURST) for _ in range(2))
    line.others = bool(line.others)
    bus.drain()


def overheard(data: bytes, *, wrist: bool) -> list[int]:
    """The ids of frames in `data` that were asked or answered by others, of the wrist's flags or of all others."""
    own = (eb90.WRIST_READ, eb90.WRIST_WRITE)
    frames = foreign_in(data, b"", lambda _frame: False)
    return sorted({frame.id for frame in frames if (frame.flag in own) is wrist})
