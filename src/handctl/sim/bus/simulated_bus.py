"""What a byte line and a CAN bus have in common: the devices and masters of the file, power, control commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from handctl.number_parsing import number_in
from handctl.sim import model_class
from handctl.sim.bus.bus_file import Plan
from handctl.sim.engine.line_and_faults import PLUG_COMMANDS, Cable, Plug, Switched
from handctl.sim.engine.simulated_device import Model, Random, soonest

SOON = 0.000000001  # s, rounding
IDLE = 0.001  # s until a device is asked again that says that it acts now, and does not
BEHIND = 5.0  # s; a master does not catch up with more
HELP = " | ".join((
    "power-cycle", "power on|off", "fault NAME[,NAME]|none", "requests", "devices", *PLUG_COMMANDS,
    "device NUMBER COMMAND, of the device with this number in the file, from 1",
))  # fmt: skip


class Master:
    """Somebody else who asks at regular intervals and does not look whether the line is free."""

    def __init__(self, data: bytes, identifier: int, every: float) -> None:
        self.data = data
        self.identifier = identifier
        self.every = every
        self._due: float | None = None

    @property
    def due(self) -> float:
        """When it asks next."""
        return self._due or 0.0

    def wait(self, now: float) -> None:
        """Time has come to this moment: the first question is asked one interval behind the start."""
        if self._due is None:
            self._due = now + self.every
        elif now - self._due > BEHIND:
            self._due = now

    def asked(self) -> None:
        self._due = self.due + self.every


Wire = TypeVar("Wire", bound=Cable)


class SimulatedBus(Switched, Generic[Wire]):
    """The devices of a file, each at a cable of its own, and the masters."""

    now = 0.0
    begun = False  # the moment of power-on is past

    def __init__(self, plan: Plan, cable: Callable[[type[Model], dict[str, str]], Wire]) -> None:
        """Raises ValueError for options that a device does not know."""
        self.plan = plan
        self.random = Random(plan.seed)
        self.masters = [Master(*row) for row in plan.masters]
        self.adapters = Plug(plan.unplug)  # of all clients
        self.plugs = [Plug(each) for each in plan.plugs]  # of the devices
        self._all_plugs = [self.adapters, *self.plugs]
        self.lines: list[Wire] = []
        for number, (kind, raw) in enumerate(plan.devices, 1):
            try:
                self.lines.append(cable(model_class(kind, raw.get("bus", "serial")), raw))
            except ValueError as exc:
                raise ValueError(f"{plan.path}: [[device]] {number} {exc}") from exc
            self.lines[-1].second = kind in [before for before, _ in plan.devices[: number - 1]]

    @property
    def away(self) -> bool:
        """Whether the clients' adapters are unplugged."""
        return self.adapters.used and self.adapters.out(self.now)

    def advance(self, now: float) -> None:
        """Moves time on; the first call is the moment of power-on. A time before the last one is taken as the last."""
        if not self.begun:
            self.now, self.begun = now, True
            for plug in self._all_plugs:
                plug.begin(now)
        for master in self.masters:
            master.wait(now)
        while (event := self._next()) is not None and event <= now + SOON:
            self.now = max(event, self.now)
            self._happen(self.now)
        self.now = max(now, self.now)
        self._settle(self.now)

    def half(self) -> float:
        """Seconds of one way between client and bus: half of the latency, and of its spread by chance."""
        way: float = self.plan.latency / 2 + self.plan.spread / 2 * self.random.between(0, 1000) / 1000
        return way

    def pulls(self) -> float | None:
        """When a plug goes out or in next."""
        first = None
        for plug in self._all_plugs:
            if plug.used:
                first = soonest(first, plug.next_event(self.now))
        return first

    def power(self, on: bool) -> None:
        """All devices."""
        for line in self.lines:
            line.power(on)
        self._switched(on)
        self._changed()

    @property
    def requests(self) -> int:  # type: ignore[override]
        return sum(line.requests for line in self.lines)

    def fault(self, names: str) -> str:
        """Of all devices."""
        return next(iter([line.fault(names) for line in self.lines]), "none")

    def further(self, words: list[str]) -> str:
        match words:
            case ["unplug" | "replug", *_]:
                return self.adapters.command(words, self.now)
            case ["devices"]:
                return ", ".join(f"{number} {line.kind}" for number, line in enumerate(self.lines, 1)) or "none"
            case ["device", number, *more] if more:
                return self._one(number, more)
            case ["help"]:
                return HELP
        raise ValueError(f"unknown command {' '.join(words)!r}. Known: {HELP}")

    def _one(self, number: str, words: list[str]) -> str:
        if not 1 <= (number_in(number) or 0) <= len(self.lines):
            raise ValueError(f"there is no device {number}. Known: 1 to {len(self.lines)}")
        place = int(number) - 1
        if words[0] in ("unplug", "replug"):  # of its plug at the bus
            answer = self.plugs[place].command(words, self.now)
        else:
            answer = self.lines[place].command(" ".join(words))
        self._changed()
        return answer

    def close(self) -> None:
        for line in self.lines:
            line.close()

    # -- what the wires do ----------------------------------------------------------------------------------------------

    def _next(self) -> float | None:
        """When something happens next; None: nothing is due."""
        raise NotImplementedError

    def _happen(self, now: float) -> None:
        """Everything that is due at this moment."""
        raise NotImplementedError

    def _settle(self, now: float) -> None:
        """Time has come to this moment, at which nothing was due."""
        raise NotImplementedError

    def _switched(self, on: bool) -> None:
        """All devices were switched."""

    def _changed(self) -> None:
        """A device may have something to say."""
