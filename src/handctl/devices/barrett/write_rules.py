"""Which bytes write to a BarrettHand, what acknowledges them, and what to read if nothing does (see `write_ledger`).

A line is acknowledged by its echo and the prompt behind it, refused by ERR n (barrett §5.1.3). What is no query writes.
In RealTime every block with values is a command, and the loop itself tells which blocks the hand answered. ^C counts where
something moves or where it was planned: a connection begins with one.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.barrett.gcl.codec import ABORT, CR, KINDS, Decoder, has_prompt, kind_of, split
from handctl.devices.barrett.gcl.connect_table import FILL, LOOPED, QUESTION, SAFE_ABORT
from handctl.devices.barrett.realtime.blocks import ACKNOWLEDGE, FEEDBACK_ONLY, NEITHER
from handctl.model.write_ledger import Frame

LONGEST = 4096
"""Bytes that are kept of an answer."""


class BarrettWriteRules:
    """One connection."""

    def __init__(self) -> None:
        self._number = 0
        self._key: Hashable = None
        self._kind = ""
        self._decoder: Decoder | None = None
        self._echo = b""
        self._tail = b""
        self._loop = self._moves = self._stopping = False

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteRules."""
        if data in (QUESTION, FILL, LOOPED):  # of the connect: no state of the hand carries them out
            self._decoder = None
            return ()
        if data.strip(SAFE_ABORT) == b"":
            return self._aborted(data)
        if self._loop:
            return () if data in (FEEDBACK_ONLY, NEITHER) else (Frame(data, None, data, group="block"),)
        if _asks(data):
            self._decoder = None
            return ()
        text = data.removesuffix(CR).decode("ascii", "replace").strip()
        self._number += 1
        self._key, self._kind = self._number, kind_of(text)
        self._decoder = Decoder(text)
        self._echo = text.encode("ascii", "replace").upper()
        self._tail, self._stopping = b"", False
        self._moves = self._moves or KINDS[self._kind].moves
        self._loop = self._kind == "loop"
        return (Frame(data, self._key, data),)

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteRules."""
        if self._stopping:
            self._tail = (self._tail + data)[-16:]
            if not has_prompt(b"\n" + self._tail.lstrip()):
                return ()
            self._stopping = self._moves = False
            return ((ABORT, True),)
        if self._decoder is None:
            return ()
        if self._kind == "loop":
            return self._entered(data)
        self._decoder.feed(data)
        answer = self._decoder.next()
        if answer is None:
            if len(self._decoder.received) > LONGEST:
                self._decoder = None
            return ()
        self._decoder = None
        if answer.lines and not answer.status and self._kind != "reset":
            return ()  # perhaps a spoiled ERR: it says nothing
        self._moves = False
        return ((self._key, not answer.status),)

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteRules."""
        return None if _asks(data) else data

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        text = data.removesuffix(CR).decode("ascii", "replace")
        _, known, words = split(text)
        if known is not None and known.name in ("FSET", "PSET") and words:
            return f"`handctl barrett get {' '.join(words[::2])}`"
        return KINDS[kind_of(text)].next

    def _aborted(self, data: bytes) -> Sequence[Frame]:
        """^C: what it interrupts is not acknowledged any more; the prompt that follows may be of either."""
        moving = self._moves or self._loop
        self._loop, self._decoder = False, None
        self._tail, self._stopping = b"", True
        return (Frame(data, ABORT, data, group="^C", unasked=not moving),)

    def _entered(self, data: bytes) -> Iterable[tuple[Hashable, bool]]:
        """The reply to LOOP: * after the echo, or ERR and the prompt."""
        self._tail = (self._tail + data)[-LONGEST:]
        size = len(self._echo)
        if self._tail[:size].upper() == self._echo and self._tail[size : size + 1] == bytes([ACKNOWLEDGE]):
            self._decoder = None
            return ((self._key, True),)
        if b"ERR" in self._tail and has_prompt(self._tail):
            self._decoder, self._loop = None, False
            return ((self._key, False),)
        return ()


def _asks(data: bytes) -> bool:
    """Whether it is an empty line or a query."""
    text = data.removesuffix(CR).decode("ascii", "replace").strip()
    return not text or kind_of(text) == "query"


words = BarrettWriteRules
