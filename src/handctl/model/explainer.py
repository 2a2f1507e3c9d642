"""Piece: recorded bytes with their meaning. Explainer: the interface of a family that decodes them. Data; imports nothing.

A family turns the bytes of a transcript into pieces, in the order of each direction; whoever shows, compares or counts
transcripts sees pieces only and knows no protocol.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar, overload

from handctl.fast_classes import NamedTuple, fast_dataclass, field

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
    values: Sequence[Value] = ()
    parts: Sequence[Part] = ()
    kept: dict[str, Any] | None = None

    def keyed(self, *, asks: str = "", answers: str = "") -> ExplainedBytes:
        """The same as another request or answer, with all that is kept of it."""
        same = object.__new__(ExplainedBytes)
        vars(same).update(vars(self), asks=asks, answers=answers)
        return same


class Explainer(Protocol):
    """What a family's `explain` module makes: stateful for one transcript."""

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """Bytes as they were recorded -> the pieces that are complete now, of either direction."""
        ...

    def flush(self) -> list[ExplainedBytes]:
        """The line was interrupted (end, power cycle, another speed): what is held back, as the pieces it is."""
        ...

    def event(self, text: str) -> None:
        """Handle an event of the transcript, after a `flush`: it may say what the bytes after it are."""
        ...

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """Explain single frames from a manual or a scope; `side` "" = decide from the bytes."""
        ...

    def simulated(self, values: Mapping[str, float | str], moments: Mapping[str, float]) -> Iterable[str]:
        """What the simulator is told to show these values: options as NAME=VALUE, and control commands.

        `moments` are the seconds from its start to each value. What has no place in the simulator is told as well: it counts.
        """
        ...

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """Whether a transcript that begins with these bytes looks like this family's."""
        ...


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


class Cutter(ABC):
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

    def event(self, text: str) -> None:  # noqa: B027 - most families need none
        """See Explainer. Nothing in it is for most families."""

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
