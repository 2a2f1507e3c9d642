"""The interface of a family's module `probe`, which detects its device."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Protocol, cast

from handctl.command.family import load
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline, Link, is_can
from handctl.model.result import Journal, Row

if TYPE_CHECKING:
    from handctl.command.family import Family


BITRATES = (1_000_000, 500_000, 250_000, 125_000, 800_000)
"""Those of a CAN bus, in bit/s. Those of hands first: 1 Mbit/s (wrist §2.3), 500 kbit/s on sibling hands."""


class FamilyProbe(Protocol):
    """The module of one family. Nothing in it writes to the device or moves it.

    WIRES   kinds of link it may be on: "serial", "tcp", "can"
    SPEEDS  bit/s of its serial port, the usual one first; () = it has none
    PING    what `ping` reads, for people
    """

    WIRES: tuple[str, ...]
    SPEEDS: tuple[int, ...]
    PING: str

    def probe(
        self, link: Any, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
    ) -> list[Row]:
        """Look at the link's present speed: rows with the `evidence`, with `id` where it has one, and with what else of a
        scan's row is not as it was asked. `timeout` is the silence allowed per reply in seconds, None = the family's own.

        Raises NoAnswer on silence; ProtocolError whose code names what came instead (echo, garbage …); LinkError.
        """

    def ping(self, device: Any) -> None:
        """The cheapest documented read, asked once. Raises NoAnswer, ProtocolError, LinkError."""

    # sweep(link, journal, bound, quest, targets) looks for all ids of one maker's families at once, each by its TARGET.
    # ECHOES: the device itself sends back what it receives.
    # ASIDE: on a serial line that others may be on it is asked by `sweep` alone, which comes behind them.
    # parse_ids(text, wire) -> the ids of --ids; raises UsageError.
    # overheard(data) -> ids that others ask, where a family knows its own frames in what comes unasked.
    # measure(device, unasked) fills the profile of a serial line by reading, where a family can.
    # further(device, answered) -> rows (name, status, evidence, remedy): what else a family checks, by reading.
    # address_of(device) -> its address on a network, as it holds it, "" = none.
    # fingerprint(device) -> readings that tell two resting devices with one address apart.
    # identify(device) -> (status, evidence, remedy) has a family whose questions other devices answer, too.


def probe_of(family: str) -> FamilyProbe:
    """The probe of a family by name."""
    return cast(FamilyProbe, load(family, "probe"))


def family_of(name: str) -> Family:
    """How the shared machinery opens that family's device."""
    return cast("Family", load(name, "cli").cli.family)


def usual_ports(families: Iterable[str] = FAMILIES) -> list[int]:
    """The TCP ports on which devices of these families listen, each once: what a tcp:// without a port may mean."""
    return list(dict.fromkeys(port for name in families if (port := family_of(name).tcp_port) is not None))


def on_can() -> list[str]:
    """The families whose device may be on a CAN bus."""
    return [family for family in FAMILIES if "can" in probe_of(family).WIRES]


def wire_of(link: str) -> str:
    """Which kind of link a LINK is: "serial", "tcp" or "can"."""
    if is_can(link):
        return "can"
    simulated = link.removeprefix("fake://").partition("?")[0]
    if link.startswith("fake://") and simulated in FAMILIES:
        return probe_of(simulated).WIRES[0]
    return "tcp" if link.startswith("tcp://") else "serial"


def has_speed(link: Link) -> bool:
    """Whether this end's speed can be changed and means something."""
    return bool(getattr(link, "can_set_baud", False))


def set_speed(link: Link, speed: int | None) -> None:
    """Change it where it is another one, and can be changed; None = as it is."""
    if speed is not None and has_speed(link) and getattr(link, "baud", None) != speed:
        link.set_baud(speed)  # type: ignore[attr-defined]


def listened(link: ByteLink, deadline: Deadline) -> bytes:
    """What comes without having been asked for just now."""
    came = b""
    while len(came) < 256 and not deadline.expired:
        came += link.read(deadline)
    return came
