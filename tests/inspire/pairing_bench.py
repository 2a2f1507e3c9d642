"""Two simulated RH56 hands and whoever stands beside them: unplugs cables, switches power, sees which hand moves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import LinkError
from handctl.link import ByteLink, FrameLink, Link, open_link
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from tests.support.bus_file import text


class Person(Prompts):
    """Does what `acts` has, one for each time that something is to be done, and says which hand has moved.

    hands  name -> the simulated hand
    """

    interactive = present = True

    def __init__(self, hands: dict[str, Any], acts: Sequence[Callable[[], object]] = ()) -> None:
        self.hands = hands
        self.acts = list(acts)
        self.asked: list[str] = []
        self.seen = {name: hand.acts["move"] for name, hand in hands.items()}
        self.interrupts: int | None = None
        """Progress lines until Ctrl-C; None = never."""

    def moved(self) -> list[str]:
        """The hands that were made to move since the last question."""
        now = {name: hand.acts["move"] for name, hand in self.hands.items()}
        moved = [name for name in now if now[name] != self.seen[name]]
        self.seen = now
        return moved

    def progress(self, text: str, safety: str = "") -> None:
        if self.interrupts is not None and safety:
            self.interrupts -= 1
            if self.interrupts < 0:
                self.interrupts = None
                raise KeyboardInterrupt

    def choose(self, question: str, words: Sequence[str]) -> str:
        self.asked.append(question)
        moved = self.moved()
        return moved[0] if len(moved) == 1 and moved[0] in words else ""

    def wait_for_enter(self, text: str) -> bool:
        self.asked.append(text)
        if not self.acts:
            return False
        self.acts.pop(0)()
        return True


class Desk:
    """The command around a pairing, and the links that it may open."""

    def __init__(self, link: str, prompts: Prompts) -> None:
        self.name, self.prompts = link, prompts
        self.journal = Journal()
        self.network: dict[str, Link] = {}
        """LINK -> what answers there; a LINK that is not in it cannot be opened."""
        self.confirmed: list[tuple[str, str]] = []
        self.steps: list[Step] = []

    def hand(self, number: int | None = None) -> Hand:
        return self.at(self.name, number)

    def again(self) -> Hand:
        return self.at(self.name)

    def elsewhere(self, link: str) -> Hand:
        return self.at(link)

    def at(self, link: str, number: int | None = None) -> Hand:
        if link not in self.network:
            raise LinkError(f"{link}: cannot connect", code="cannot-open")
        return hand_behind(self.network[link], self.journal, number or 1, tcp=link.startswith("tcp://"))

    def confirm(self, question: str, steps: Sequence[Step], word: str = "") -> None:
        self.confirmed.append((question, word))
        self.steps += steps


def hand_behind(link: Link, journal: Journal, number: int = 1, *, tcp: bool = False) -> Hand:
    """The host's hand at the other end of a link."""
    bus: SerialBus | CanBus | ModbusBus
    if isinstance(link, FrameLink):
        bus = CanBus(link, number, journal, family="hand")
    elif tcp and isinstance(link, ByteLink):
        bus = ModbusBus(link, number, journal, tcp=True)
    else:
        assert isinstance(link, ByteLink)
        bus = SerialBus(link, number, journal)
    other = (
        ModbusBus(link, number, journal, tcp=False)
        if isinstance(bus, SerialBus) and isinstance(link, ByteLink)
        else None
    )
    gate = ModelGate(None, False)
    for one in (bus, other):
        if one is not None:
            one.gate = gate
    return Hand(bus, gate, other)


def simulated(link: Link) -> Any:
    """The simulated hand behind a fake:// link."""
    return link._line.device.hand  # type: ignore[attr-defined]


def fake_hand(**options: object) -> Link:
    """A link to one simulated hand on virtual time."""
    return open_link(
        "fake://hand?" + "&".join(["clock=virtual", *(f"{name}={value}" for name, value in options.items())])
    )


class OneLine:
    """Two hands on one RS-485 pair."""

    def __init__(self, folder: Path, *devices: dict[str, Any], model: str = "half-duplex", **line: Any) -> None:
        file = folder / "bus.toml"
        file.write_text(text(model, [{"kind": "hand", **one} for one in devices], **line), encoding="utf-8")
        self.name = f"fake://bus?clock=virtual&file={file}"
        self.link = open_link(self.name)
        self.bus = self.link._line.bus  # type: ignore[attr-defined]
        self.hands = [line.device.hand for line in self.bus.lines]

    def desk(self, names: Sequence[str], *acts: Callable[[], object]) -> Desk:
        """Whoever sits there: `names` of the hands in the order of the line."""
        desk = Desk(self.name, Person(dict(zip(names, self.hands, strict=True)), acts))
        desk.network[self.name] = self.link
        return desk

    def plug(self, number: int, *, out: bool) -> Callable[[], object]:
        """Take the data cable of a device out of the bus, or put it back."""
        return lambda: self.bus.command(f"device {number} {'unplug' if out else 'replug'}")
