"""An explainer that cuts recorded bytes into frames: the part that knows no protocol. See `model.piece.Explainer`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import NamedTuple

from handctl.model.piece import DEVICE, HOST, Piece


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
    def piece(self, direction: str, raw: bytes, cut: Cut) -> Piece:
        """What a stretch means."""

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[Piece]:
        """See Explainer. There is no CAN."""
        self._buffers[direction] += data
        return list(self._pieces(self._buffers[direction], direction))

    def flush(self) -> list[Piece]:
        """See Explainer."""
        return [piece for side in self._buffers for piece in self._pieces(self._buffers[side], side, final=True)]

    def event(self, text: str) -> None:  # noqa: B027 - most families need none
        """See Explainer. Nothing in it is for most families."""

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[Piece]:
        """See Explainer."""
        return list(self._pieces(bytearray(data), "", side, final=True))

    def _pieces(self, buffer: bytearray, side: str, told: str = "", *, final: bool = False) -> Iterator[Piece]:
        while buffer and (cut := self.cut(buffer, side, final=final)).size:
            raw = bytes(buffer[: cut.size])
            del buffer[: cut.size]
            yield self.piece(side or told or self.side_of(raw, cut), raw, cut)
