"""Simulated BarrettHands that are not the one of the manual: another text, a parameter less, another way to print a number.

What is changed is what the simulator sends, behind its back: the host meets it as a device that is like this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from handctl.sim.barrett import gcl
from handctl.sim.barrett.device import Device
from tests.support.swap import swapped

Change = Callable[[bytes], bytes]
FIRST = "!\0"


def as_it_is(data: bytes) -> bytes:
    """Nothing is changed."""
    return data


@contextmanager
def odd(
    *, first: Change = as_it_is, nul: bytes = b"\0", every: Change = as_it_is, without: str = "", **values: str
) -> Iterator[None]:
    """While it lasts every simulated hand is like this.

    first    what its answer to the first question becomes, from behind the echo
    nul      the echo of NUL
    every    what every answer becomes
    without  a parameter that it does not have
    values   parameter -> what it prints in place of each value
    """
    run, finish, hear, get, value = Device._run, Device._reply, Device.feed, gcl._get, gcl.values
    asked: dict[int, str] = {}

    def noted(self: Device) -> None:
        asked[id(self)] = self._line.decode("latin-1")
        run(self)

    def reply(self: Device, lines: list[bytes], code: int) -> None:
        finish(self, lines, code)
        data = every(self.replies[-1].data)
        self.replies[-1].data = first(data) if asked.get(id(self), "").endswith(FIRST) else data

    def heard(self: Device, data: bytes) -> None:
        hear(self, data)
        for echo in self.replies if 0 in data else ():
            echo.data = echo.data.replace(b"\0", nul)

    def got(device: Any, names: list[str], bank: Any, numbers: Any) -> Any:
        if without not in names:
            return get(device, names, bank, numbers)
        answer = get(device, names[: names.index(without)], bank, numbers)
        answer.code = 64
        return answer

    def printed(device: Any, name: str, bank: Any, numbers: Any) -> str:
        text = value(device, name, bank, numbers)
        return " ".join([values[name]] * len(text.split())) if name in values else text

    with swapped(
        (Device, "_run", noted),
        (Device, "_reply", reply),
        (Device, "feed", heard),
        (gcl, "_get", got),
        (gcl, "values", printed),
    ):
        yield


def replaced(old: bytes, new: bytes) -> Change:
    """The change of one text into another."""
    return lambda data: data.replace(old, new)
