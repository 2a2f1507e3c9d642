"""Piece: recorded bytes with their meaning. Explainer: the interface of a family that decodes them. Data; imports nothing.

A family turns the bytes of a transcript into pieces, in the order of each direction; whoever shows, compares or counts
transcripts sees pieces only and knows no protocol.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from operator import getitem
from typing import Any, ClassVar, Generic, TypeVar, overload
from weakref import WeakValueDictionary

from handctl.fast_classes import NamedTuple, fast_dataclass, field

K = TypeVar("K")
HOST, DEVICE = "host", "device"
SIDES = (HOST, DEVICE)


class Part(NamedTuple):
    """One field of a frame: its bytes, its name, what it says."""

    raw: bytes
    name: str
    meaning: str


class Value(NamedTuple):
    """One number (or text) that a frame carries, by the name of the family's map."""

    name: str
    value: float | str | None
    unit: str | None = None


MOST_KNOWN = 8 << 20
"""Bytes that all texts of `Known` take together, about."""
ENTRY = 200
"""Bytes of an entry besides the characters of its text."""


class Known(dict[K, str], Generic[K]):
    """What `say` says of a key: a long recording has the same numbers again and again."""

    every: ClassVar[WeakValueDictionary[int, Known[Any]]] = WeakValueDictionary()
    taken: ClassVar[list[int]] = [0]
    """By all of them. In a list: an attribute of a class that changes makes each look into the class slow."""

    def __init__(self, say: Callable[[K], str]) -> None:
        super().__init__()
        self._say = say
        Known.every[id(self)] = self

    def __missing__(self, key: K) -> str:
        text, taken = self._say(key), self.taken
        taken[0] += ENTRY + len(text)
        if taken[0] > MOST_KNOWN:
            taken[0] = 0
            for known in Known.every.values():
                known.clear()
        self[key] = text
        return text


T = TypeVar("T")


class LazySequence(Sequence[T], Generic[T]):
    """The result of `make`, created on first use: a long recording is mostly shown without values and parts."""

    def __init__(self, make: Callable[[], Iterable[T]]) -> None:
        self._make = make
        self._made: tuple[T, ...] | None = None

    def _all(self) -> tuple[T, ...]:
        if self._made is None:
            self._made = tuple(self._make())
        return self._made

    def texts(self, say: Callable[[T], str]) -> Iterable[str]:
        """What `say` says of each."""
        return map(say, self)

    def __iter__(self) -> Iterator[T]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[T, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self._all()[index]

    def __eq__(self, other: object) -> bool:
        return self._all() == (other._all() if isinstance(other, LazySequence) else other)

    def __hash__(self) -> int:
        return hash(self._all())

    def __repr__(self) -> str:
        return repr(self._all())


Maker = Callable[[Any], Value | None]
"""Makes the value of a code as the wire has it; None where that says nothing."""


class Makers:
    """One maker for each code of a message, and what is said of the codes."""

    def __init__(self, makers: Iterable[Maker]) -> None:
        self.makers = tuple(makers)
        self._known: dict[Callable[[Value], str], list[Known[Any]]] = {}

    def known(self, say: Callable[[Value], str]) -> list[Known[Any]]:
        """For each code what `say` says of its value, "" where there is none."""
        if say not in self._known:
            self._known[say] = [_known_text(make, say) for make in self.makers]
        return self._known[say]


@lru_cache(4096)
def _known_text(make: Maker, say: Callable[[Value], str]) -> Known[Any]:
    return Known(lambda code: "" if (value := make(code)) is None else say(value))


class CodedValues(LazySequence[Value]):
    """The values of codes. What is said of the same code again is looked up."""

    def __init__(self, makers: Makers, codes: Sequence[Any]) -> None:
        self._made = None
        self._makers, self._codes = makers, codes

    def _make(self) -> Iterator[Value]:
        made = (make(code) for make, code in zip(self._makers.makers, self._codes, strict=True))
        return (value for value in made if value is not None)

    def texts(self, say: Callable[[Value], str]) -> Iterable[str]:
        """See LazySequence."""
        return filter(None, map(getitem, self._makers.known(say), self._codes))


Values = tuple[Value, ...] | LazySequence[Value]


@fast_dataclass(kw_only=True)
class ExplainedBytes:
    """A frame, or bytes that belong to none. Never changed: where a recording says the same again, it is the same one.

    direction  "host" or "device": who sent it
    raw        its bytes; on CAN the data of the frame `can_id`. All pieces of a direction joined are all its bytes
    meaning    in words: names, values with units, status words
    problem    code of what is wrong with it, "" = nothing: stray, bad-checksum, cut-short, echo, refused …
    frame      False for bytes that form no whole, valid frame
    title      the meaning without its values, for pairing it with its like in another transcript; "" = the meaning
    asks       key of the answer that a request expects, "" = none
    answers    key of the request that this answers, "" = it comes by itself
    fields     family fields for scripts: id, flag, address, command …
    values     the numbers in it
    parts      all its bytes, field by field; of a JSON object its keys, without bytes
    kept       what is made of one that comes again, by its use; None for others
    """

    direction: str
    raw: bytes
    meaning: str
    problem: str = ""
    frame: bool = True
    can_id: int | None = None
    title: str = ""
    asks: str = ""
    answers: str = ""
    fields: Mapping[str, int | str | None] = field(default_factory=dict)
    values: Values = ()
    parts: Sequence[Part] = ()
    kept: dict[str, Any] | None = None

    def keyed(self, *, asks: str = "", answers: str = "") -> ExplainedBytes:
        """The same as another request or answer, with all that is kept of it."""
        same = object.__new__(ExplainedBytes)
        same.__dict__ = all_of_it = self.__dict__.copy()  # quicker than to fill it
        all_of_it["asks"], all_of_it["answers"] = asks, answers
        return same


class Explainer(ABC):
    """What a family's `explain` module makes: stateful for one transcript."""

    @abstractmethod
    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """Bytes as they were recorded -> the pieces that are complete now, of either direction."""

    @abstractmethod
    def flush(self) -> list[ExplainedBytes]:
        """The line was interrupted (end, power cycle, another speed): what is held back, as the pieces it is."""

    def event(self, text: str) -> None:  # noqa: B027 - nothing in it is for most families
        """Handle an event of the transcript, after a `flush`: it may say what the bytes after it are."""

    @abstractmethod
    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """Explain single frames from a manual or a scope; `side` "" = decide from the bytes."""

    def simulated(self, values: Mapping[str, float | str], moments: Mapping[str, float]) -> Iterable[str]:
        """What the simulator is told to show these values: options as NAME=VALUE, and control commands.

        `moments` are the seconds from its start to each value. What has no place in the simulator is told as well: it counts.
        A family whose simulator is set to nothing says nothing.
        """
        return ()

    @abstractmethod
    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """Whether a transcript that begins with these bytes looks like this family's."""


def stray(direction: str, data: bytes, why: str = "", problem: str = "stray") -> ExplainedBytes:
    """Bytes of no frame."""
    count = f"{len(data)} byte{'s' if len(data) != 1 else ''}"
    return ExplainedBytes(
        direction=direction, raw=data, frame=False, problem=problem, title=problem,
        meaning=why or f"{count} of no frame", parts=(Part(data, problem, why or f"{count} of no frame"),),
    )  # fmt: skip


# -- cutting recorded bytes into frames -----------------------------------------------------------------------------


class Cut(NamedTuple):
    """A stretch at the beginning of a buffer.

    size     in bytes, 0 = wait for more
    problem  what is wrong with it, "" = a valid frame
    mode     in which of several ways it is one, for its family
    """

    size: int
    problem: str = ""
    mode: str = ""


class Cutter(Explainer):
    """One conversation. A family says where a frame ends, who sends such a one, and what it means."""

    def __init__(self) -> None:
        self._buffers = {HOST: bytearray(), DEVICE: bytearray()}

    @abstractmethod
    def cut(self, buffer: bytearray, side: str, *, final: bool) -> Cut:
        """The next stretch of what `side` has sent, "" = either; `final` when nothing will follow, then never of size 0."""

    @abstractmethod
    def side_of(self, raw: bytes, cut: Cut) -> str:
        """Who sends such a stretch."""

    @abstractmethod
    def piece(self, direction: str, raw: bytes, cut: Cut) -> ExplainedBytes:
        """What a stretch means."""

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. There is no CAN."""
        self._buffers[direction] += data
        return self._pieces(self._buffers[direction], direction)

    def flush(self) -> list[ExplainedBytes]:
        """See Explainer."""
        return [piece for side in self._buffers for piece in self._pieces(self._buffers[side], side, final=True)]

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer."""
        return self._pieces(bytearray(data), "", side, final=True)

    def _pieces(self, buffer: bytearray, side: str, told: str = "", *, final: bool = False) -> list[ExplainedBytes]:
        found: list[ExplainedBytes] = []
        while buffer and (cut := self.cut(buffer, side, final=final)).size:
            raw = bytes(buffer[: cut.size])
            del buffer[: cut.size]
            found.append(self.piece(side or told or self.side_of(raw, cut), raw, cut))
        return found
