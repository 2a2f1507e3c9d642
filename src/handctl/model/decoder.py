"""The interface of every family's frame decoder, and the complete frames in a block of bytes. Knows no protocol, does no I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol, TypeVar

from handctl.errors import ProtocolError

F = TypeVar("F")
F_co = TypeVar("F_co", covariant=True)


class Decoder(Protocol[F_co]):
    """Takes what the other side sends, in pieces of any size."""

    def feed(self, data: bytes) -> None:
        """More bytes."""

    def next(self) -> F_co | None:
        """The next frame, None when none is whole. Raises ProtocolError for one that is no frame, and drops it."""


def frames_in(decoder: Decoder[F], damaged: Callable[[ProtocolError], object] = lambda _error: None) -> Iterator[F]:
    """The frames that are complete now. Invalid bytes are skipped and reported to `damaged`."""
    while True:
        try:
            frame = decoder.next()
        except ProtocolError as exc:
            damaged(exc)
            continue
        if frame is None:
            return
        yield frame
