"""What the line of every simulated device has in common: options, faults, counting, power, control, the state file.

`Line` (line.py) carries bytes, `CanLine` (canline.py) carries CAN frames. Nothing here knows either.
"""

from __future__ import annotations

from handctl.sim.engine.model import NOTHING, Model, Options, Random

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Mapping


class Cable:
    """A simulated device at the end of a cable that has options and faults of its own."""

    def __init__(
        self, model: type[Model], raw: dict[str, str], options: Mapping[str, str], faults: Mapping[str, str]
    ) -> None:
        """`options` and `faults` are those of the cable, name -> help."""
        self._options = Options(model.KIND, raw, [*options, *model.OPTIONS])
        self.kind = model.KIND
        self._random = Random(self._options.integer("seed", 0, 0, 4294967295))
        self._known = {**faults, **model.FAULTS}
        self._after = self._options.integer("after", 0, 0, 1000000000)
        self._every = self._options.integer("every", 1, 1, 1000000000)
        self._turnaround = self._options.seconds("turnaround", 0.0, 60.0)
        self._late = self._options.seconds("late", 0.6, 3600.0)
        self._state = self._options.text("state")
        self._faults = self._parse_faults(self._options.text("fault") or "")
        power_cycle = self._options.choice("power-cycle", "0", ("0", "1")) == "1"
        self.device = model(self._options, self._random)
        self.device.judge = self._judge
        self.device.faults = self._faults
        self.device.power(True)
        self.hung_up = False
        self.requests = 0  # requests that the device understood so far
        self._now: float | None = None
        self._closed = False
        self._load()
        if power_cycle:
            self.device.power(False)
            self.device.power(True)
        self.device.set_faults(self._faults)
        self.device.dirty = False

    def reconnect(self) -> None:
        """A new client: what was on the wire is lost, the device goes on."""
        self.hung_up = False
        self._drop()

    # -- power and control ----------------------------------------------------------------------------------------

    def power_cycle(self) -> None:
        self.power(False)
        self.power(True)

    def power(self, on: bool) -> None:
        """Off: whatever was on the wire or still to come is gone."""
        if not on:
            self._drop()
        if on != self.device.powered:
            self.device.power(on)
        self._persist()

    def command(self, text: str) -> str:
        """A control command for the simulator; returns one line, raises ValueError."""
        words = text.split()
        if words == ["power-cycle"]:
            self.power_cycle()
            return "power cycled"
        if words in (["power", "on"], ["power", "off"]):
            self.power(words[1] == "on")
            return f"power {words[1]}"
        if words[:1] == ["fault"] and len(words) > 1:
            self._faults = self._parse_faults(",".join(words[1:]))
            self.device.set_faults(self._faults)
            return f"fault {','.join(sorted(self._faults)) or 'none'}"
        if words == ["requests"]:
            return f"requests {self.requests}"
        if not words or words == ["help"]:
            return f"power-cycle | power on|off | fault NAME[,NAME]|none | requests | {self.device.command(['help'])}"
        answer = self.device.command(words)
        self._persist()
        return answer

    def close(self) -> None:
        """Writes the state file, if there is one."""
        if self._state is not None and not self._closed:
            self.device.dirty = True
            self._persist()
        self._closed = True

    # -- inside -----------------------------------------------------------------------------------------------------

    def _drop(self) -> None:
        """Forgets what is on the wire."""
        raise NotImplementedError

    def _present(self) -> float:
        return 0.0 if self._now is None else self._now

    def _parse_faults(self, text: str) -> frozenset[str]:
        names = {name.strip().replace("_", "-") for name in text.split(",")} - {"", "none", "healthy"}
        for name in sorted(names):
            if name not in self._known:
                raise ValueError(
                    f"unknown fault {name!r} of the simulated {self.kind}; known: {', '.join(sorted(self._known))}"
                )
        return frozenset(names)

    def _hits(self, number: int) -> frozenset[str]:
        """The faults that befall the request with this number, counted from 1."""
        beyond = number - self._after
        return self._faults if beyond > 0 and beyond % self._every == 0 else NOTHING

    def _judge(self) -> frozenset[str]:
        self.requests += 1
        return self._hits(self.requests)

    def _load(self) -> None:
        if self._state is not None:
            from handctl.sim.engine import statefile

            statefile.load(self._state, self.device)

    def _persist(self) -> None:
        if self._state is not None and self.device.dirty:
            from handctl.sim.engine import statefile

            statefile.save(self._state, self.device)
        self.device.dirty = False
