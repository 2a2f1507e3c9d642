"""What the parts of the simulated BarrettHand see of the whole: GCL, RealTime mode, boot monitor, texts, states, faults.

For the type checker only: the whole is device.py, which is made of these parts.
"""

from __future__ import annotations

from typing import Protocol

from handctl.sim.barrett.hand import Hand
from handctl.sim.barrett.memory import Memory
from handctl.sim.engine.model import Random, Reply


class Monitor(Protocol):
    """The boot monitor, for who puts the hand into it. `until` is when it does something by itself."""

    until: float | None

    def erase(self) -> None:
        """The firmware is gone."""


class Loop(Protocol):
    """RealTime mode, for who leaves the hand in it."""

    def block(self, velocity: int) -> bytes:
        """A control block."""


class Board(Protocol):
    """The hand without its wire; each member is described in device.py."""

    memory: Memory
    hand: Hand
    random: Random
    now: float
    speed: int | None
    powered: bool
    dirty: bool
    hits: frozenset[str]
    faults: frozenset[str]
    fastest: int
    texts: str
    most_arguments: int
    loop_after: int
    loop_code: int
    lfv_per_10_ms: bool
    heat_stops_all: bool
    write_time: float
    usual_temperature: int
    no_load: tuple[int, ...]

    @property
    def version(self) -> str: ...
    @property
    def worn(self) -> bool: ...
    @property
    def monitor(self) -> Monitor: ...
    @property
    def loop(self) -> Loop | None: ...

    def judge(self) -> frozenset[str]: ...
    def power(self, on: bool) -> None: ...
    def settle(self) -> None: ...
    def reset(self) -> None: ...
    def restart(self, began: float) -> None: ...
    def hang(self) -> None: ...
    def feed(self, data: bytes) -> None: ...
    def take(self) -> list[Reply]: ...
    def post(self, data: bytes) -> None: ...
    def enter_loop(self, motors: tuple[int, ...]) -> None: ...
    def leave_loop(self, code: int) -> None: ...
    def read(self, name: str, number: int) -> int: ...
    def read_common(self, name: str) -> int: ...
