"""What every simulated device shares: its contract with the line, replies, options, a small random generator.

Knows nothing of any wire format. Time is always passed in (seconds, monotone); nothing here reads a clock or sleeps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import cached_property
from importlib import import_module
from itertools import repeat

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from typing import Any, ClassVar, Protocol

    class Control(Protocol):
        """A module that knows a device from outside: its control commands, what a state file keeps of it, its use."""

        HELP: str  # the commands

        def command(self, device: Any, words: list[str]) -> str | None:
            """One control command: the answer, "" when there is no such command, None when it has changed the device. Raises
            ValueError."""

        def snapshot(self, device: Any) -> dict[str, Any]:
            """What a state file keeps."""

        def restore(self, device: Any, state: dict[str, Any]) -> None:
            """Takes a snapshot back; KeyError, TypeError or ValueError when it does not fit."""

        def use(self, device: Any) -> Iterator[float]:
            """Somebody who uses the device: each step acts on it, and tells the seconds until the next one."""


class Rows(dict[str, tuple[object, str]]):
    """Options, name -> (form, help). A form is False or True (0 or 1, the default), words to choose from (the first is the
    default, or the one before them), (default, lowest, highest) of whole numbers, the same with a default such as "0,0,0" of as many numbers,
    (default, most) of seconds, or None: any text."""

    @cached_property
    def defaults(self) -> dict[str, Any]:
        """Their values where none is given, made once for all simulators."""
        return {name: _default(form) for name, (form, _) in self.items()}


NOTHING: frozenset[str] = frozenset()


def soonest(*times: float | None) -> float | None:
    """The first of these moments; None: there is none."""
    first = None
    for when in times:
        if when is not None and (first is None or when < first):
            first = when
    return first


class Random:
    """Xorshift generator of 32 bits: the same seed gives the same run on every Python version."""

    def __init__(self, seed: int) -> None:
        self._state = (seed * 2654435761 + 2463534242) % 4294967296 or 1

    def between(self, low: int, high: int) -> int:
        """A whole number, both ends included."""
        state = self._state
        state ^= (state << 13) % 4294967296
        state ^= state >> 17
        state ^= (state << 5) % 4294967296
        self._state = state
        return low + (state >> 3) % (high - low + 1)

    def junk(self, count: int, liked: bytes) -> bytes:
        """`count` bytes; every second one, about, is one of `liked` (the header bytes of the protocol)."""
        return bytes(
            liked[self.between(0, len(liked) - 1)] if liked and self.between(0, 1) else self.between(0, 255)
            for _ in range(count)
        )


class Options:
    """The raw strings of a link, read with their ranges. Every complaint is a ValueError of one line."""

    def __init__(self, kind: str, raw: dict[str, str], *known: Collection[str]) -> None:
        self.kind = kind
        self.raw = {name.replace("_", "-"): text for name, text in raw.items()}
        for name in self.raw:
            if not any(name in names for names in known):
                names = sorted(set().union(*known))
                raise ValueError(f"unknown option {name!r} of the simulated {kind}. Known: {', '.join(names)}")

    def text(self, name: str) -> str | None:
        return self.raw.get(name)

    def choice(self, name: str, default: str, allowed: tuple[str, ...]) -> str:
        text = self.raw.get(name, default)
        if text not in allowed:
            raise ValueError(f"option {name}={text}: not one of {', '.join(allowed)}")
        return text

    def integer(self, name: str, default: int | None, low: int, high: int) -> Any:
        span = f"{low} to {high}"
        return self._number(name, default, int, low, high, f"not a whole number ({span})", f"out of range {span}")

    def seconds(self, name: str, default: float | None, high: float) -> Any:
        beyond = f"out of range 0 to {high:g} seconds"
        return self._number(name, default, float, 0.0, high, "not a number of seconds", beyond)

    def _number(
        self, name: str, default: float | None, kind: type[float], low: float, high: float, no_number: str, beyond: str
    ) -> Any:
        text = self.raw.get(name)
        if text is None:
            return default
        try:
            value = kind(text)
        except ValueError:
            raise ValueError(f"option {name}={text}: {no_number}") from None
        if not low <= value <= high:
            raise ValueError(f"option {name}={text}: {beyond}")
        return value

    def read(self, rows: Rows) -> dict[str, Any]:
        """The values of these options, each by its form."""
        given = [name for name in rows if name in self.raw]
        return {**rows.defaults, **{name: self._given(name, rows[name][0]) for name in given}}

    def _given(self, name: str, form: Any) -> Any:
        match form:
            case bool():
                return self.choice(name, "", ("1", "0") if form else ("0", "1")) == "1"
            case (default, tuple(words)):
                return self.choice(name, default, words)
            case (str(), str(), *_):
                return self.choice(name, form[0], form)
            case (str(default), int(low), int(high)):
                return self._numbers(name, default, low, high)
            case (default, int(low), int(high)):
                return self.integer(name, default, low, high)
            case (default, float(high)):
                return self.seconds(name, default, high)
        return self.text(name)

    def _numbers(self, name: str, default: str, low: int, high: int) -> tuple[int, ...]:
        """As many whole numbers as the default has, with commas between."""
        text = self.raw.get(name) or default
        numbers = [Options(self.kind, {name: part}, [name]).integer(name, 0, low, high) for part in text.split(",")]
        if len(numbers) != default.count(",") + 1:
            raise ValueError(f"option {name}={text}: not {default.count(',') + 1} numbers, such as {default}")
        return tuple(numbers)


def _default(form: Any) -> Any:
    """The value of an option that is not given."""
    match form:
        case (str(default), int(), int()):
            return tuple(map(int, default.split(",")))
        case (default, *_):
            return default
    return form


class Reply:
    """One frame that leaves the device: not before `due`; `hits` are the faults that befall it."""

    def __init__(self, due: float, data: bytes, hits: frozenset[str]) -> None:
        self.due = due
        self.data = data
        self.hits = hits


class Model:
    """A device without its wire, powered off when made.

    `Line` sets `judge` and `faults`, calls `power(True)`, then `boot` once, then `advance`, `feed` and `take` in time
    order.
    """

    KIND = ""
    OPTIONS: ClassVar[Rows] = Rows()  # in addition to those of the line
    FAULTS: ClassVar[dict[str, str]] = {}  # name -> help; states of the device, in addition to the faults of the line
    CONTROL = ""  # name of the module that is its Control, loaded on use
    HEADER = b""  # bytes that start frames here; noise is made of them to trap naive framers
    absent = False  # whether its port is gone: that of a device with USB inside goes with a restart
    host = ""  # the IP address that it has in the network
    one_client = False  # whether it drops a client when another one comes, where several can come
    speed: int | None = None  # the speed of the wire in force, bit/s; None: it has none

    def __init__(self, options: Options, random: Random) -> None:
        self.random = random
        self.given = options.read(self.OPTIONS)
        self.now = 0.0
        self.powered = False
        self.dirty = False  # something that a state file keeps has changed
        self.faults: frozenset[str] = NOTHING
        self.judge: Callable[[], frozenset[str]] = lambda: NOTHING  # asked once for each request that is understood
        self.hits_of: Callable[[int], frozenset[str]] = lambda _number: NOTHING  # the faults of the N-th, from 1
        self.replies: list[Reply] = []  # made since the last `take`

    def boot(self, now: float) -> None:
        """The first moment of simulated time."""
        self.now = now

    def advance(self, now: float) -> None:
        self.now = now

    def feed(self, data: bytes) -> None:
        """Bytes that reached the device at the present time."""

    def due(self, pending: bytes) -> int | None:
        """How many of these bytes, still on the wire, the device needs before it acts; None: it will not.

        Lets the line feed a request at the exact time of its last bit without waking for each byte.
        """
        return 1 if pending else None

    def together(self, pending: bytes) -> int | None:
        """The same of bytes that all come at one moment."""
        return self.due(pending)

    def take(self) -> list[Reply]:
        """The replies made since the last call; some may be due in the future."""
        if replies := self.replies:
            self.replies = []
        return replies

    def next_event(self) -> float | None:
        """When the device acts by itself next, apart from replies that are already due."""
        return None

    def beside(self, model: type[Model]) -> type[Model]:
        """The model of another wire of this very device."""
        raise ValueError(f"a simulated {self.KIND} has one wire")

    def reconnected(self) -> None:
        """A new client came. A device with a connection of its own, unlike one behind a serial adapter, notices that."""

    def power(self, on: bool) -> None:
        self.powered = on
        self.replies.clear()

    def set_faults(self, faults: frozenset[str]) -> None:
        """The faults now present, those of the line included."""
        self.faults = faults

    def mishear(self, data: bytes, sent: int, heard: int) -> bytes | None:
        """What a UART at the speed `heard` makes of bytes at the speed `sent`, in either direction.

        None: not simulated; the device then hears nothing.
        """
        return None

    def spoil(self, data: bytes) -> bytes:
        """The frame with a check value that does not fit; where that is the last byte, another one."""
        return data[:-1] + bytes([(data[-1] + 1) % 256])

    def readdress(self, data: bytes) -> bytes:
        """The frame as another device on the line would have sent it: valid, but with another id."""
        return data

    def twin(self, data: bytes) -> bytes:
        """The frame as a second device with the same id would have sent it, live values a little different."""
        return data

    def command(self, words: list[str]) -> str:
        """A control command of this device; returns one line, raises ValueError."""
        if not self.CONTROL:
            raise ValueError(f"unknown command {' '.join(words)!r}")
        control = self._control()
        answer = self.about if words == ["help"] else control.command(self, words)
        if answer == "":
            raise ValueError(f"unknown command {' '.join(words)!r}. Known: {control.HELP}")
        self.dirty = self.dirty or answer is None
        return " ".join(words) if answer is None else answer

    @property
    def about(self) -> str:
        """Its control commands."""
        return self._control().HELP

    def snapshot(self) -> dict[str, Any]:
        """What a state file keeps."""
        return self._control().snapshot(self) if self.CONTROL else {}

    def restore(self, state: dict[str, Any]) -> None:
        """Takes a snapshot back; KeyError, TypeError or ValueError when it does not fit."""
        if self.CONTROL:
            self._control().restore(self, state)

    def elapse(self, seconds: float) -> None:
        """So much time has passed since the state was written that was just restored; what was moving has arrived.

        Called before `boot`.
        """
        self.advance(self.now + seconds)

    def user(self) -> Iterator[float]:
        """Somebody who uses the device: each step acts on it, and tells the seconds until the next one."""

        return self._control().use(self) if self.CONTROL else repeat(3600.0)

    def _control(self) -> Control:

        control: Any = import_module(self.CONTROL)
        return control  # type: ignore[no-any-return]
