"""What every wire of a simulated RH56 hand has in common: it leads to one hand, alone or beside other wires."""

from __future__ import annotations

from handctl.sim.engine.model import Model, Options, Random
from handctl.sim.hand.model import Hand, from_options
from handctl.sim.inspire.frames import Asked


class Front(Asked):
    """The hand as one of its wires shows it. A wire beside another one is made with that one's hand."""

    KIND = "hand"
    CONTROL = "handctl.sim.hand.control"
    BUS = ""
    FLAGS = {0: ("", False), 1: ("", True)}  # noqa: RUF012

    def __init__(self, options: Options, random: Random, hand: Hand | None = None) -> None:
        super().__init__(options, random)
        options.choice("bus", self.BUS, (self.BUS,))
        self.alone = hand is None
        self.hand = from_options(options, self.given, random) if hand is None else hand
        self.unit = self.hand.generation.unit

    @property
    def id(self) -> int:  # type: ignore[override]
        return self.hand.number

    def beside(self, model: type[Model]) -> type[Model]:
        """Another wire of this hand, of a class like this one."""
        hand = self.hand

        class Beside(model):  # type: ignore[valid-type, misc]
            def __init__(self, options: Options, random: Random) -> None:
                super().__init__(options, random, hand)

        return Beside

    def boot(self, now: float) -> None:
        super().boot(now)
        if self.alone:
            self.hand.boot(now)

    def advance(self, now: float) -> None:
        self.now = now
        self.hand.advance(max(now, self.hand.now))
        if self.alone and self.hand.dirty:
            self.dirty, self.hand.dirty = True, False

    def elapse(self, seconds: float) -> None:
        self.hand.elapse(seconds)

    def power(self, on: bool) -> None:
        """Late frames are gone; a wire that joins a hand that is on leaves it so."""
        super().power(on)
        self._replies.clear()
        if on != self.hand.powered:
            self.hand.faults = self.faults
            self.hand.power(on)
        self.dirty = self.dirty or on

    def set_faults(self, faults: frozenset[str]) -> None:
        self.faults = faults
        self.hand.set_faults(faults)

    def restored(self) -> None:
        """A state file has changed the hand."""

    def read(self, space: str, address: int, count: int) -> bytes | None:
        return self.hand.read(address, count)

    def write(self, space: str, address: int, data: bytes, hits: frozenset[str]) -> bool | None:
        """A write, after which the state file is another one."""
        self.dirty = True
        return self.hand.write(address, data, hits)

    def second(self, space: str, address: int, data: bytes) -> bytes:
        return self.hand.space.twin(address, data)
