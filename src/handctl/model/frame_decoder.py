"""The interface of every family's frame decoder, and the complete frames in a block of bytes. Knows no protocol, does no I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, Protocol, TypeVar

from handctl.errors import ProtocolError

F = TypeVar("F")
F_co = TypeVar("F_co", covariant=True)


class Decoder(Protocol[F_co]):
    """Takes what the other side sends, in pieces of any size."""

    def feed(self, data: bytes) -> None:
        """More bytes."""

    def next(self) -> F_co | None:
        """The next frame, None when none is whole. Raises ProtocolError for one that is no frame, and drops it."""


class Stream(Generic[F]):
    """Base of a decoder: bytes that came and are not consumed yet. `skipped` counts those that belonged to no frame."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.skipped = 0

    def feed(self, data: bytes) -> None:
        """More bytes."""
        self._buffer += data

    def next(self) -> F | None:
        """The next frame, see Decoder."""
        raise NotImplementedError

    def rest(self) -> bytes:
        """Take out what has not been consumed."""
        rest = bytes(self._buffer)
        self._buffer.clear()
        return rest

    @property
    def pending(self) -> int:
        """Bytes held back because they may still become a frame."""
        return len(self._buffer)

    def finish(self) -> list[F]:
        """The stream has ended: whole frames that a false, never completed header was hiding."""
        found: list[F] = []
        while self._buffer:
            found += frames_in(self)
            if self._buffer:
                del self._buffer[:1]
                self.skipped += 1
        return found


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
