"""Simulated devices of the other families that are not the one of the manual: another frame, an item less, another number.

As `odd_barrett`: what is changed is what the simulator sends, behind its back, and the host meets it as a device that is
like this. A change takes what would be sent, and returns what is sent instead.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from handctl.sim.aidin.json_text import Writer
from handctl.sim.ekso import device as ekso
from handctl.sim.hand import device as hand
from handctl.sim.hand.registers import Hand
from handctl.sim.inspire import frames
from tests.support.swap import swapped

Change = Callable[[bytes], bytes]
Span = tuple[int, int]
"""Address and count of bytes."""


def as_it_is(data: bytes) -> bytes:
    """Nothing is changed."""
    return data


class _Once:
    """A change of the first thing that is sent only."""

    def __init__(self, change: Change) -> None:
        self._change, self._done = change, False

    def __call__(self, data: bytes) -> bytes:
        if self._done:
            return data
        self._done = True
        return self._change(data)


@contextmanager
def odd_registers(
    *,
    every: Change = as_it_is,
    first: Change = as_it_is,
    without: Collection[Span] = (),
    most: int = 0,
    short: bool = False,
    exception: int = 0,
    holds: Mapping[int, bytes] | None = None,
) -> Iterator[None]:
    """While it lasts every simulated device with registers is like this.

    every, first  what all its answers, or the first, become on the wire
    without       spans that it does not have: a read that touches one is not answered, on Modbus refused
    most          bytes of its longest read, 0 = as it is
    short         such a read is answered as far as it goes
    exception     of Modbus, in place of 02
    holds         address -> the bytes that a read shows there
    """
    once, made = _Once(first), frames.Reply

    def reply(when: float, data: bytes, *more: Any) -> Any:
        return made(when, once(every(data)), *more)

    def reading(read: Callable[..., bytes | None]) -> Callable[..., bytes | None]:
        def shown(self: Any, *where: Any) -> bytes | None:
            address, count = where[-2:]
            ends = [start for start, size in without if start < address + count and address < start + size]
            if most and count > most:
                ends.append(address + most)
            data = read(self, *where)
            if data is None or (ends and (not short or min(ends) <= address)):
                return None
            found = bytearray(data)
            for start, new in (holds or {}).items():
                for place, byte in enumerate(new, start - address):
                    if 0 <= place < len(found):
                        found[place] = byte
            return bytes(found[: min(ends) - address] if ends else found)

        return shown

    refused = hand._exception

    def excepted(function: int, code: int) -> bytes:
        return refused(function, exception if exception and code == hand.BAD_ADDRESS else code)

    with swapped(
        (frames, "Reply", reply),
        (hand, "Reply", reply),
        (frames.Asked, "read", reading(frames.Asked.read)),
        (Hand, "read", reading(Hand.read)),
        (hand, "_exception", excepted),
    ):
        yield


@contextmanager
def odd_ekso(
    *,
    every: Change = as_it_is,
    first: Change = as_it_is,
    body: Callable[[int, bytes], bytes | None] = lambda _command, data: data,
) -> Iterator[None]:
    """While it lasts every simulated EksoNR is like this; `body` is what an answer to a command holds, None = silence."""
    once, made, answer = _Once(first), ekso.Reply, ekso.Device._answer

    def reply(when: float, data: bytes, *more: Any) -> Any:
        return made(when, once(every(data)), *more)

    def answered(self: Any, command: int, *more: Any) -> bytes | None:
        data = answer(self, command, *more)
        return None if data is None else body(command, data)

    with swapped((ekso, "Reply", reply), (ekso.Device, "_answer", answered)):
        yield


@contextmanager
def odd_aidin(
    *,
    content: Callable[[dict[str, Any]], object] = lambda data: data,
    text: Callable[[str], str] = lambda data: data,
    first: Change = as_it_is,
) -> Iterator[None]:
    """While it lasts every simulated AIDIN-hand sends this: the object, then its text; `first` concerns the first one."""
    once, feedback = _Once(first), Writer.feedback

    def sent(self: Any, *more: Any) -> bytes:
        data = json.loads(feedback(self, *more))
        return once((text(json.dumps(content(data))) + "\n").encode())

    with swapped((Writer, "feedback", sent)):
        yield
