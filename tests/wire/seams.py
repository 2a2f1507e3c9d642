"""Where the golden wire takes hold of handctl: whatever it patches or imports of the source's inside is named here.

A simulated link is spoken to and listened to at four methods. Behind a frame, where the program listens or sleeps next, a
`Place` acts: Ctrl-C, or the wish of another handctl. `mortal` makes a simulated link one that could outlive this process,
and has its child act on it.
"""

from __future__ import annotations

import os
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

from handctl import report
from handctl.link import deadman, port_users
from handctl.link.fake import FakeFrames, FakeLink
from handctl.link.link_interface import RawAccess
from handctl.stop.device_access import DeviceAccess
from handctl.system import deadman_process
from handctl.tools import doctor, port_inventory

SPEAKS = ((FakeLink, "write"), (FakeFrames, "send"))
LISTENS = ((FakeLink, "read"), (FakeFrames, "receive"))
WAITS = (*LISTENS, (FakeLink, "sleep"), (FakeFrames, "sleep"))
THIS_MACHINE = (
    (doctor, "machine_checks", list),
    (report, "environment", list),
    (port_inventory, "source", str),
    (port_users, "rivals", lambda: port_users.OtherUsers([])),
)
"""What tells of the machine: says nothing here."""
EVENTS = ((FakeLink, "set_baud"), (FakeLink, "reopen"), (FakeLink, "power_cycle"), (FakeFrames, "power_cycle"))


@dataclass(frozen=True)
class Passed:
    """What passed on a link: ">" out, "<" in, "!" an event, "+" the end of the process. `link` counts from 0."""

    mark: str
    data: bytes
    can_id: int | None = None
    at: float = 0.0
    text: str = ""
    link: int = 0


@dataclass
class Wire:
    """What passed on the links of one run, in order; `place` is called where the program listens or sleeps."""

    place: Callable[[Wire], None] | None = None
    passed: list[Passed] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    """How many of each mark have passed."""
    links: list[Any] = field(default_factory=list)
    hold: DeviceAccess | None = None
    over: bool = False
    """Nothing more is noted: the process is taken for dead."""

    def frames(self) -> list[Passed]:
        """What was sent."""
        return [one for one in self.passed if one.mark == ">"]

    def number(self, link: Any) -> int:
        """A link by its first use."""
        for number, known in enumerate(self.links):
            if known is link:
                return number
        self.links.append(link)
        return len(self.links) - 1

    def note(self, mark: str, link: Any, data: Any, text: str = "") -> None:
        if self.over:
            return
        at = round(link.now(), 3)
        self.counts[mark] += 1
        raw, can_id = getattr(data, "data", data), getattr(data, "can_id", None)
        self.passed.append(Passed(mark, bytes(raw), can_id, at, text, self.number(link)))

    # -- in place of the methods of a link --

    def speaking(self, speak: Any) -> Any:
        def spoken(link: Any, data: Any, *args: Any) -> Any:
            self.note(">", link, data)  # also of a link that is lost: that is what it tried
            return speak(link, data, *args)

        return spoken

    def listening(self, listen: Any) -> Any:
        def listened(link: Any, *args: Any, **more: Any) -> Any:
            if data := listen(link, *args, **more):
                self.note("<", link, data)
            return data

        return listened

    def waiting(self, wait: Any) -> Any:
        def waited(link: Any, *args: Any, **more: Any) -> Any:
            if self.place is not None:
                self.place(self)
            return wait(link, *args, **more)

        return waited

    def telling(self, name: str, do: Any) -> Any:
        def done(link: Any, *args: Any) -> Any:
            self.note("!", link, b"", " ".join([name.replace("_", "-"), *map(str, args)]))
            return do(link, *args)

        return done

    def keeping(self, around: Any) -> Any:
        def kept(hold: DeviceAccess, link: Any) -> Any:
            self.hold = hold
            return around(hold, link)

        return kept


@contextmanager
def watched(wire: Wire) -> Iterator[None]:
    """All simulated links of the block are those of `wire`."""
    with ExitStack() as stack:

        def patch(owner: Any, name: str, made: Callable[[Any], Any]) -> None:
            stack.enter_context(mock.patch.object(owner, name, made(getattr(owner, name))))

        for owner, name in SPEAKS:
            patch(owner, name, wire.speaking)
        for owner, name in LISTENS:
            patch(owner, name, wire.listening)
        for owner, name in WAITS:
            patch(owner, name, wire.waiting)
        for owner, name in EVENTS:
            patch(owner, name, lambda do, name=name: wire.telling(name, do))
        patch(DeviceAccess, "around", wire.keeping)
        for owner, name, nothing in THIS_MACHINE:
            patch(owner, name, lambda _own, nothing=nothing: lambda *_args: nothing())
        yield


def ctrl_c(_wire: Wire) -> None:
    """As pressed on a terminal."""
    signal.raise_signal(signal.SIGINT)


def other_handctl(wire: Wire) -> None:
    """As `handctl stop` of another process has it done by who holds the device."""
    assert wire.hold is not None, "nothing holds the link"
    wire.hold.stop("stopped, as another handctl asked for it")
    wire.hold.end(sys._getframe())


class Place:
    """Does something once, at the first wait behind the n-th frame; of a command that sends none, behind the n-th that came."""

    def __init__(self, behind: int, mark: str, do: Callable[[Wire], None]) -> None:
        self.behind, self.mark, self.do = behind, mark, do
        self.done = False

    def __call__(self, wire: Wire) -> None:
        if not self.done and wire.counts[self.mark] >= self.behind:
            self.done = True
            self.do(wire)


# -- the death of the process ---------------------------------------------------------------------------------------------


class Dead(BaseException):
    """This process has ended."""


class Child:
    """In place of the process that stops a device when this one dies: no process, but what it is told, and what it does."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self._job: deadman_process.Job | None = None
        self._told = -1

    def started(self, job: deadman_process.Job) -> deadman_process.DeadmanChild:
        self._job = job
        self._told, pipe = os.pipe()
        os.set_blocking(self._told, False)
        return deadman_process.DeadmanChild(1, pipe, -1)

    def ended(self, heir: deadman_process.DeadmanChild) -> None:
        os.close(heir.pipe)
        os.close(self._told)
        self._job = None

    def act(self, wire: Wire) -> None:
        """The process dies: what the child does then. Raises Dead, so that the command ends at once; how it does is not looked at."""
        if self._job is None:
            wire.passed.append(Passed("+", b"", text="the process dies, and nobody is there for it"))
        else:
            wire.passed.append(Passed("+", b"", text="the process dies, and its child acts"))
            self._job.act(self._last())
        wire.over = True
        raise Dead

    def _last(self) -> bytes:
        assert self._job is not None
        last, rest = self._job.first[4:], b""
        with suppress(BlockingIOError):
            rest = os.read(self._told, 1 << 16)
        while rest:
            size = 2 + int.from_bytes(rest[:2], "big")
            last, rest = rest[4:size] or last, rest[size:]
        return last


class Way(RawAccess):
    """Out of a simulated link, for a child of the same process."""

    link: Any

    @classmethod
    def of(cls, link: Any) -> Way:
        way = cls(-1, decode=(lambda _data: ([], b"")) if isinstance(link, FakeFrames) else None)
        way.link = link
        return way


def raw_access(link: Any) -> Way:
    """In place of the method of a simulated link."""
    return Way.of(link)


def raw(way: Way) -> Any:
    """The link of the child: the simulated one itself."""
    link = way.link
    link.put = lambda data, deadline: link.write(data, deadline) if data else None
    link.sleep_reading = link.sleep
    return link


@contextmanager
def mortal(wire: Wire, heir: Child) -> Iterator[None]:
    """Simulated links are taken for real ones, and whoever guards one has `heir`. To be entered behind `watched`."""
    with ExitStack() as stack:
        for owner, _ in SPEAKS:
            stack.enter_context(mock.patch.object(owner, "fake", False))
            stack.enter_context(mock.patch.object(owner, "raw_access", raw_access))
        for name, made in (("can_be", lambda: True), ("started", heir.started), ("ended", heir.ended)):
            stack.enter_context(mock.patch.object(deadman_process, name, made))
        for name in ("RawBytes", "RawFrames"):
            stack.enter_context(mock.patch.object(deadman, name, raw))
        yield
