"""One simulated device with several wires at once, and one of them with several clients: what is done on one shows on all.

Each wire, and each client of a wire that takes several, is a line of its own, with its own faults. The first one keeps the state file and takes the control commands of the device.
"""

from __future__ import annotations

from handctl.sim import model_class
from handctl.sim.engine.can import CAN_FAULTS, CAN_OPTIONS, CanLine
from handctl.sim.engine.line import LINE_FAULTS, LINE_OPTIONS, Line

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.engine.model import Model, Rows
    from handctl.sim.engine.ports import TcpDoor

OF_FIRST = ("state", "save", "elapse", "power-cycle", "use", "unplug")  # options that only the first wire has


class Wires:
    """The device with its wires. Raises ValueError for an option or a fault that none of them knows."""

    away = False

    def __init__(self, kind: str, raw: dict[str, str], buses: list[str]) -> None:
        self.kind = kind
        self._raw = {name.replace("_", "-"): text for name, text in raw.items()}
        self.lines: list[Line | CanLine] = []
        self.door: TcpDoor | None = None  # moves to the address that the device has
        self._heard = 0  # requests at ends that are gone
        models = {bus: model_class(kind, bus) for bus in buses}
        self._options = {bus: {*_cable(bus)[0], *model.OPTIONS} for bus, model in models.items()}
        self._faults = {bus: {*_cable(bus)[1], *model.FAULTS} for bus, model in models.items()}
        self._buses: dict[Line | CanLine, str] = {}
        known: set[str] = set().union(*self._options.values())
        for name in self._raw:
            if name not in known:
                raise ValueError(f"unknown option {name!r} of the simulated {kind}. Known: {', '.join(sorted(known))}")
        self._check(self._raw.get("fault", ""))
        for bus in buses:
            self.add(bus)

    def add(self, bus: str) -> Line | CanLine:
        """One more end of this wire."""
        raw = {name: text for name, text in self._raw.items() if name in self._options[bus]}
        raw["bus"] = bus
        model: type[Model] = model_class(self.kind, bus)
        if self.lines:
            raw = {name: text for name, text in raw.items() if name not in OF_FIRST}
            model = self.lines[0].device.beside(model)
        if "fault" in raw:
            raw["fault"] = ",".join(self._known(raw["fault"], bus)) or "none"
        line: Line | CanLine = CanLine(model, raw) if bus == "can" else Line(model, raw)
        self.lines.append(line)
        self._buses[line] = bus
        return line

    def reconnect(self) -> None:
        """Its adapters never went away."""

    def drop(self, line: Line | CanLine) -> None:
        """That end is gone."""
        if line in self.lines[1:]:
            self.lines.remove(line)
            self._heard += line.requests
            del self._buses[line]

    def _known(self, faults: str, bus: str) -> list[str]:
        names = [name.strip().replace("_", "-") for name in faults.split(",")]
        return [name for name in names if name in self._faults[bus]]

    def _check(self, faults: str) -> None:
        known: set[str] = set().union(*self._faults.values())
        for name in faults.split(","):
            if name.strip().replace("_", "-") not in {*known, "", "none"}:
                raise ValueError(
                    f"unknown fault {name!r} of the simulated {self.kind}. Known: {', '.join(sorted(known))}"
                )

    # -- as what the server has in front of its clients -------------------------------------------------------------------

    def advance(self, now: float) -> None:
        for line in list(self.lines):
            line.advance(now)
        if self.door is not None:
            self.door.move(self.lines[0].device.host)

    def power_cycle(self) -> None:
        for on in (False, True):
            for line in self.lines:
                line.power(on)

    def command(self, text: str) -> str:
        """A control command; returns one line, raises ValueError."""
        match text.split():
            case ["power-cycle"]:
                self.power_cycle()
                return "power cycled"
            case ["power", "on" | "off" as state]:
                for line in self.lines:
                    line.power(state == "on")
                return f"power {state}"
            case ["fault", _, *_] as words:
                faults = ",".join(words[1:])
                self._check(faults)
                self._raw["fault"] = faults
                for line in self.lines:
                    line.command(f"fault {','.join(self._known(faults, self._buses[line])) or 'none'}")
                return f"fault {faults}"
            case ["requests"]:
                return f"requests {self._heard + sum(line.requests for line in self.lines)}"
        return self.lines[0].command(text)

    def close(self) -> None:
        for line in self.lines:
            line.close()


class Each:
    """A wire of which every client has an end of his own."""

    def __init__(self, wires: Wires, bus: str) -> None:
        self.wires = wires
        self.bus = bus
        self.clients: list[Line] = []

    def join(self) -> Line:
        line = self.wires.add(self.bus)
        assert isinstance(line, Line)
        if line.device.one_client:
            for other in self.clients:
                other.hung_up = True
        self.clients.append(line)
        return line

    def leave(self, client: Line) -> None:
        self.clients.remove(client)
        self.wires.drop(client)


def _cable(bus: str) -> tuple[Rows, dict[str, str]]:
    return (CAN_OPTIONS, CAN_FAULTS) if bus == "can" else (LINE_OPTIONS, LINE_FAULTS)
