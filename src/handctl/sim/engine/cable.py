"""What the line of every simulated device has in common: options, faults, counting, power, control, the state file.

`Line` (line.py) carries bytes, `CanLine` (canline.py) carries CAN frames. Nothing here knows either.
"""

from __future__ import annotations

from handctl.sim.engine.model import NOTHING, Model, Options, Random

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

UNTOUCHED = 0.05  # s from the start until the user of the device does anything: the first look finds it as it was left


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
        self._save = self._options.choice("save", "always", ("always", "changed", "never"))
        used = self._options.choice("use", "off", ("off", "on")) == "on"
        elapsed = self._options.seconds("elapse", 0.0, 1e9) if self._options.text("elapse") is not None else None
        power_cycle = self._options.choice("power-cycle", "0", ("0", "1")) == "1"
        self.device = model(self._options, self._random)
        self.device.judge = self._judge
        self.device.faults = self._faults
        self.device.power(True)
        self.hung_up = False
        self.second = False  # another device than the first of its kind: what it measures differs a little
        self.requests = 0  # requests that the device understood so far
        self._now: float | None = None
        self._closed = False
        self._changed = False
        self._user: Iterator[float] | None = None  # acts, then tells for how many seconds it does nothing else
        self._acts = 0.0  # when it acts next
        self._load(elapsed)
        if used:
            self._user = self.device.user()
            self._save = "never"
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
        if not self._closed:
            self.device.dirty = self.device.dirty or self._changed or self._save == "always"
            self._persist()
        self._closed = True

    # -- inside -----------------------------------------------------------------------------------------------------

    def _drop(self) -> None:
        """Forgets what is on the wire."""
        raise NotImplementedError

    def _pass(self, now: float) -> None:
        """Moves time on to this moment, with all that happens until then."""
        raise NotImplementedError

    def _boot(self, now: float) -> None:
        self.device.boot(now)
        self._acts = now + UNTOUCHED

    def _follow(self, now: float) -> None:
        """Lets the user of the device act at each moment that has come."""
        while self._user is not None and self._acts <= now:
            self._pass(self._acts)
            self._acts += next(self._user)

    def _present(self) -> float:
        return 0.0 if self._now is None else self._now

    def _parse_faults(self, text: str) -> frozenset[str]:
        names = {name.strip().replace("_", "-") for name in text.split(",")} - {"", "none", "healthy"}
        for name in sorted(names):
            if name not in self._known:
                raise ValueError(
                    f"unknown fault {name!r} of the simulated {self.kind}. {_near(name, self._known)}Known: {', '.join(sorted(self._known))}"
                )
        return frozenset(names)

    def _hits(self, number: int) -> frozenset[str]:
        """The faults that befall the request with this number, counted from 1."""
        beyond = number - self._after
        return self._faults if beyond > 0 and beyond % self._every == 0 else NOTHING

    def _judge(self) -> frozenset[str]:
        self.requests += 1
        return self._hits(self.requests)

    def _load(self, elapsed: float | None) -> None:
        if self._state is not None:
            from handctl.sim.engine import statefile

            if statefile.load(self._state, self.device) and elapsed is not None:
                self.device.elapse(elapsed)

    def _persist(self) -> None:
        if self._state is not None and self.device.dirty and self._save != "never":
            from handctl.sim.engine import statefile

            statefile.save(self._state, self.device)
            self._changed = True
        self.device.dirty = False


def _near(name: str, known: Collection[str]) -> str:
    """The one that was meant, if one is near."""
    from difflib import get_close_matches

    near = get_close_matches(name, known, n=1, cutoff=0.6)
    return f"Did you mean {near[0]!r}? " if near else ""
