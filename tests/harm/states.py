"""The devices of the matrix and the states in which a command may meet them. Written from manuals and dossiers.

A state is made anew for every cell: a simulated device at the end of its cable, brought there by what a person or another
program did before. Motions are slow, so that they still go on when a command has looked at every speed first.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from handctl.families import FAMILIES
from handctl.sim import create
from handctl.sim.engine.can_line import CanLine
from handctl.sim.engine.line_and_faults import Line
from tests.contract.facts import facts_of
from tests.support.rh56_hand import rh56_line

Wire = str
"""serial: bytes at a speed, heard wrongly at another one; tcp: bytes as they are; can: frames."""
Before = Callable[[Any], None]


@dataclass(frozen=True)
class State:
    """One device in one state.

    device   which device it is, for people
    name     in which state
    owner    the family whose device it is; "" when it is of none
    kind     of its simulator
    before   what happened to it before the command comes
    """

    device: str
    name: str
    owner: str
    kind: str
    options: dict[str, str] = field(default_factory=dict)
    before: Before = lambda line: line.advance(1.0)
    wire: Wire = "serial"
    also: tuple[str, ...] = ()
    """Further families whose device it is: a wrist sits on a hand."""

    def of(self, family: str) -> bool:
        """Whether it is a device of this family."""
        return family == self.owner or family in self.also

    @property
    def looping(self) -> bool:
        """Whether a BarrettHand is in RealTime mode."""
        return self.name.startswith("in LOOP")

    @property
    def in_block(self) -> bool:
        """Whether it waits for the rest of a control block."""
        return self.name.endswith("in a block")

    def __str__(self) -> str:
        return f"{self.device}, {self.name}" + ("" if self.wire == "serial" else f", {self.wire}")

    def make(self) -> Line | CanLine:
        """The device, in its state, with the line quiet."""
        line = rh56_line(self.name.split()[0]) if self.kind == "rh56" else create(self.kind, dict(self.options))
        line.advance(0.0)
        self.before(line)
        if not isinstance(line, CanLine):
            line.take()
        return line


def then(*steps: str | bytes | float) -> Before:
    """Bytes sent, seconds passed, control commands of the simulator, in order."""

    def play(line: Any) -> None:
        now = 0.0
        for step in steps:
            if isinstance(step, bytes):
                line.feed(step)
            elif isinstance(step, str):
                line.command(step)
            else:
                now += step
            line.advance(now)

    return play


def _plain(family: str) -> Iterator[State]:
    """The states of a family that has no list of its own, as its facts have them."""
    facts = facts_of(family)
    options = dict(item.split("=", 1) for item in facts.state.split("&") if item)
    for wire in ("serial", "tcp"):
        yield State(family, "at rest", family, family, options, wire=wire)
        if facts.moving:
            yield State(family, "moves", family, family, options, then(0.5, facts.moving, 0.2), wire)


def states() -> list[State]:
    """All of them; every family of the registry has some, of its own or plain ones."""
    own = {family: facts_of(family).states_in for family in FAMILIES}
    plain = [partial(_plain, family) for family, module in own.items() if not module]
    listed = [importlib.import_module(module).states for module in dict.fromkeys(own.values()) if module]
    return [state for make in (*listed, *plain) for state in make()]
