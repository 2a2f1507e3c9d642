"""Which map recorded bytes of an RH56 hand belong to: that of byte addresses, or one of a generation that counts words.

The bytes themselves tell it, by what they answer to reads (rh56 §1.1), or an event of the recording does. Until then the
byte map is taken, and what an address means on the others is said beside it: a save of one is the factory reset of the
next. Knows no frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from handctl.devices.inspire.identity import At, within
from handctl.devices.inspire.map import Register
from handctl.devices.inspire.spans import describe, span_name
from handctl.model.param import ParamMap

EVENT = "generation "
"""A recording says so when handctl knows it: ``! generation f1``."""
NO_NAME = "undocumented"
MOST = 32
"""Answers that are remembered: they are asked for one behind the other."""


class Generation(NamedTuple):
    """One map: how events name it, how people do, bytes at one address, and what shows it in answers to reads."""

    names: tuple[str, ...]
    words: str
    params: ParamMap[Register]
    per: int
    shows: Callable[[At], str]


class Generations:
    """What is known of one conversation. The first of `known` is taken until another one shows itself."""

    def __init__(self, known: Sequence[Generation]) -> None:
        self._known = known
        self.now = known[0]
        self.sure = len(known) == 1
        self._answers: dict[int, bytes] = {}

    def event(self, text: str) -> bool:
        """An event of the recording; whether it names a generation."""
        name = text.removeprefix(EVENT).strip()
        found = next((one for one in self._known if text.startswith(EVENT) and name in one.names), None)
        if found is not None:
            self.now, self.sure = found, True
        return found is not None

    def answer(self, address: int, data: bytes) -> bool:
        """What a read at `address`, as the frame has it, was answered; whether another map holds from here on."""
        if self.sure:
            return False
        self._answers.pop(address, None)
        self._answers[address] = data
        if len(self._answers) > MOST:
            del self._answers[next(iter(self._answers))]
        shown = [one for one in self._known if one.shows(self._at(one.per))]
        if len(shown) != 1:
            return False
        before, self.now, self.sure = self.now, shown[0], True
        return self.now is not before

    def _at(self, per: int) -> At:
        held = within([(per * address, data) for address, data in self._answers.items()])
        return lambda address, count: held(per * address, count)

    def beside(self, address: int, count: int, *, writes: bool, data: bytes = b"") -> str:
        """What this address holds on the others, while it is not sure which generation it is; "" = nothing else."""
        if self.sure:
            return ""
        own = span_name(self.now.params, address * self.now.per, count)
        if not writes and own != NO_NAME:
            return ""
        told: dict[str, list[str]] = {}
        for one in self._known:
            name = span_name(one.params, address * one.per, count)
            if one is self.now or name in (own, NO_NAME):
                continue
            text = describe(one.params, address * one.per, data) if data and not writes else name
            told.setdefault(text, []).append(one.words)
        return "".join(f". On {' and '.join(who)}: {text}" for text, who in told.items())
