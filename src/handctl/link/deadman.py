"""A dead man's switch: a child process that holds the link, and sends the device's stop when this process dies.

    with guarding(link, stop, journal.warn) as guard:     # one child, armed before the first command is sent
        guard.update(stop)                                # where the stop depends on where the device is

However this process dies (kill -9, out of memory, a crash, its whole process group), the system closes its end of a
pipe. The child sees that, completes a frame that was half sent, and sends the stop. When the `with` ends, the child is
ended before it can send a byte, and is waited for. A process that is suspended (SIGSTOP) is not dead: nothing is sent.

The child is a plain fork, without a new program in it. It is there when `guarding` returns, about 1 ms later, also
where no interpreter can be found or no file be read, and it shares its memory with its parent. What makes a fork
dangerous is avoided: only the forking thread lives on in the child, so the child takes no lock, imports nothing, and
calls the system only (poll, read, write, close) until it ends by `_exit`. It keeps the link, its pipe, and the lock of
the device: nobody is let in before the stop is out. It is in a session of its own, ignores every signal that can be
ignored, and once it acts it has two seconds.

It cannot help where everything of this user is killed at once: a service or a container that ends (its control group),
the machine, its power. Where the system has no fork, or the link is inside a vendor's library, a warning says so.
Knows no protocol: families give the bytes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from handctl.errors import LinkError
from handctl.link.base import Link, Outlet
from handctl.system import child
from handctl.system.child import Orders, Wire

BOUND_SECONDS = 2.0
"""How long the child may take once it acts: a link that takes no bytes keeps it, and the lock, no longer."""
LARGEST = 4096
"""A message of this size or less goes through a pipe whole or not at all (POSIX: at least 512, Linux 4096)."""


class Shot(NamedTuple):
    """One write of the stop, and the seconds of silence behind it. With `can_id` it is the data of that CAN frame."""

    data: bytes
    pause: float = 0.0
    can_id: int | None = None


@contextmanager
def guarding(link: Link, stop: Sequence[Shot], warn: Callable[[str, str, str], object]) -> Iterator[Guard]:
    """Around whatever drives a device and promises to stop it. `warn` is told where the link cannot be guarded.

    A simulator in this process and a transcript need no guard: nothing outlives this process. Raises LinkError when no
    child can be started: then nothing must be driven.
    """
    inside = link.fake or link.replayed
    outlet = None if inside or not child.can_be() else link.outlet()
    guard = Guard(outlet, link.held)
    if not inside and not (outlet and stop):
        why = "no second process can hold this link" if stop else "where it is there is nothing to command"
        warn(
            "unguarded",
            f"{link.name}: {why}: if handctl is killed, nothing stops the device",
            "keep its power switch within reach",
        )
    try:
        guard.arm(stop)
        yield guard
    finally:
        guard.disarm()


class Guard:
    """The child of one link; without an `outlet` nothing is guarded. `held` are descriptors that it keeps open, too."""

    def __init__(self, outlet: Outlet | None, held: Sequence[int] = ()) -> None:
        self._outlet = outlet
        self._held = tuple(held)
        self._pid = 0
        self._pipe = -1
        self._owed = b""
        self._stop: Wire = ()

    def arm(self, stop: Sequence[Shot]) -> None:
        """Start the child. Raises LinkError."""
        if self._outlet is None:
            return
        self._stop = self._wire(stop)
        self._start()
        self._outlet.owes = self.owes

    def update(self, stop: Sequence[Shot]) -> None:
        """From now on this is the stop. Costs some microseconds when it is another one, otherwise none. Raises LinkError."""
        if self._pid and (wire := self._wire(stop)) != self._stop:
            self._stop = wire
            self._tell()

    def owes(self, rest: bytes) -> None:
        """A frame is half sent: `rest` is missing, and goes before the stop; b"" once it is out."""
        rest = rest if len(rest) <= LARGEST // 2 else b""  # no frame that drives anything is so long
        if self._pid and rest != self._owed:
            self._owed = rest
            self._tell()

    def disarm(self) -> None:
        """End the child before it sends anything, and wait for it. May be called twice."""
        if not self._pid:
            return
        if self._outlet is not None:
            self._outlet.owes = nothing
        with child.unsignalled():
            self._end()

    def _wire(self, stop: Sequence[Shot]) -> Wire:
        assert self._outlet is not None
        return tuple((self._outlet.encode(shot.data, shot.can_id), shot.pause) for shot in stop)

    def _tell(self) -> None:
        message = _pack(self._owed, self._stop)
        try:
            os.write(self._pipe, message)
        except OSError:  # it was killed, or it does not read: another one takes its place
            with child.unsignalled():
                self._end()
            self._start()

    def _start(self) -> None:
        """Fork, and see that the child is ready. All at once for signals: nobody must lose sight of a child."""
        assert self._outlet is not None
        orders = (self._owed, self._stop)
        with child.unsignalled():
            try:
                self._pid, self._pipe = child.started(
                    self._outlet.descriptor, self._held, orders, _unpack, BOUND_SECONDS
                )
            except OSError as exc:
                raise _cannot(exc.strerror or str(exc)) from exc
            except child.NotAlive as exc:
                raise _cannot("the child ended at once") from exc

    def _end(self) -> None:
        pid, self._pid = self._pid, 0
        child.ended(pid, self._pipe)


def nothing(rest: bytes) -> None:
    """Nobody needs to know."""


def _cannot(why: str) -> LinkError:
    return LinkError(
        f"the process that stops the device if handctl is killed cannot be started: {why}",
        hint="end other programs, or allow more processes (ulimit -u).",
        code="no-guard",
    )


# -- messages to the child: 2 bytes of length, then the frame's rest and the shots ---------------------------------------


def _pack(owed: bytes, stop: Wire) -> bytes:
    parts = [len(owed).to_bytes(2, "big"), owed]
    for data, pause in stop:
        parts += [len(data).to_bytes(2, "big"), round(pause * 1000).to_bytes(2, "big"), data]
    text = b"".join(parts)
    assert len(text) + 2 <= LARGEST
    return len(text).to_bytes(2, "big") + text


def _unpack(text: bytes) -> Orders:
    size = int.from_bytes(text[:2], "big")
    owed, text = text[2 : 2 + size], text[2 + size :]
    stop = []
    while text:
        size, pause = int.from_bytes(text[:2], "big"), int.from_bytes(text[2:4], "big")
        stop.append((text[4 : 4 + size], pause / 1000))
        text = text[4 + size :]
    return owed, tuple(stop)
