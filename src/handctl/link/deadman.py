"""A dead man's switch: a child process that holds the link, and stops the device when this process dies.

    with guarding(link, stop, journal.warn):      # one child, there before the first command is sent

However this process dies (kill -9, out of memory, a crash, its whole process group), the system closes its end of a
pipe. The child sees that, completes a frame that was half sent, and calls `stop` with a link of its own to the same
device: the plan that every other way of stopping runs, so it asks where the device is, and sends each step until it is
acknowledged. When the `with` ends, the child is ended before it can send a byte, and is waited for.

A process that is suspended (SIGSTOP) is not dead, and nothing is sent. But where the device does not end by itself what it
was told, `heartbeat` is how long its parent may be silent: then the child stops the device, and the parent, should it wake, ends
as by Ctrl-C. A child that was killed is replaced before the next frame goes out.

The child is a plain fork, without a new program in it. It is there when `guard_link` returns, about 1 ms later, also
where no interpreter can be found or no file be read, and it shares its memory with its parent. What makes a fork
dangerous is avoided: only the forking thread lives on in the child, so the child takes no lock, imports nothing and
starts nothing until it ends by `_exit`. It keeps the link, its pipes, and the lock of the device: nobody is let in before
the stop is out. It is in a session and under a name of its own, ignores every signal that can be ignored, and once it acts
it has three seconds for each device.

Windows has no fork. There the child is a program of its own, which inherits the handle of the port or connection and is sent
its job: `stop` must be picklable. What a driver did not take of a frame is lost there; the stop is repeated anyway.

The child cannot help where everything of this user is killed at once: a service or a container that ends (its control group,
its job), the machine, its power. Where the link is inside a vendor's library, there is none, and a warning says so.
Knows no protocol: families give the stop.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import NamedTuple

from handctl.errors import LinkError
from handctl.link.link_interface import ByteLink, CanFrame, Deadline, FrameLink, Link, RawAccess, nothing, unsent
from handctl.system import clock, deadman_process, descriptors
from handctl.system.deadman_process import DeadmanChild, Job

BOUND_SECONDS = 3.0
"""How long the child may take for each device once it acts: a link that takes no bytes keeps it, and the lock, no longer."""
LARGEST = 4096
"""A message of this size or less goes through a pipe whole or not at all (POSIX: at least 512, Linux 4096)."""

Stop = Callable[[Link], object]
Warn = Callable[[str, str, str], object]


class EarlyWrite(NamedTuple):
    """A write before the stop, and the seconds of silence after it."""

    data: bytes
    pause: float = 0.0


@contextmanager
def guard_link(link: Link, stop: Stop, warn: Warn, *, heartbeat: float = 0.0, beneath: bool = False) -> Iterator[Guard]:
    """Around code that moves a device: guard it with a child process. `warn` is called if the link cannot be guarded.

    A simulator in this process and a transcript need no guard: nothing outlives this process. Raises LinkError when no
    child can be started: then nothing must be driven. Within another guard of the link it takes its place: one child stops
    the device of this one, then the others that are guarded there. With `beneath` it is of no use as long as the other one
    guards the same device, and takes over from that.
    """
    inside = link.fake or link.replayed
    raw_access = None if inside or not deadman_process.can_be() else link.raw_access()
    if not inside and raw_access is None:
        warn(
            "unguarded",
            f"{link.name}: no second process watches this link, so if handctl is killed nothing stops the device",
            "keep its power switch within reach",
        )
    guard, top = Guard(raw_access, stop, warn, link.held, heartbeat), link.guard
    try:
        if beneath and top is not None and top.guards(stop):
            guard.outer, top.outer = top.outer, guard
        else:
            guard.outer = top
            if top is not None:
                top.disarm()
            guard.arm()
            link.guard = guard
        yield guard
    finally:
        guard.disarm()
        if link.guard is guard or link.guard is top is guard.outer:  # it is the one that guards, or could not be armed
            link.guard = guard.outer
            if guard.outer is not None:
                guard.outer.arm()
        elif link.guard is not None:
            link.guard.leave_out(guard)


class Guard:
    """The child of one link; without an `raw_access` nothing is guarded. `held` are descriptors that it keeps open, too.

    outer   the guard that it takes the place of, None = there is none
    """

    def __init__(
        self, raw_access: RawAccess | None, stop: Stop, warn: Warn, held: Sequence[int] = (), heartbeat: float = 0.0
    ) -> None:
        self.outer: Guard | None = None
        self._stop = stop
        self._raw_access, self._warn, self._held, self._heartbeat = raw_access, warn, tuple(held), heartbeat
        self._child: DeadmanChild | None = None
        self._unsent = b""
        self._first: Sequence[EarlyWrite] = ()
        self._told = 0.0

    @property
    def pid(self) -> int | None:
        """The number of its process; None where there is none just now."""
        return self._child.pid if self._child is not None else None

    @property
    def stops(self) -> list[Stop]:
        """What the child does: one stop for each device, first its own, then those of the outer guards."""
        found: list[Stop] = [self._stop]
        if self.outer is not None:
            known = _device(self._stop)
            found += [stop for stop in self.outer.stops if _device(stop) != known]
        return found

    def guards(self, stop: Stop) -> bool:
        """Whether it stops the device that `stop` does."""
        return any(_device(one) == _device(stop) for one in self.stops)

    def leave_out(self, guard: Guard) -> None:
        """This outer one has ended."""
        if self.outer is guard:
            self.outer = guard.outer
        elif self.outer is not None:
            self.outer.leave_out(guard)

    @property
    def _bound(self) -> float:
        return BOUND_SECONDS * len(self.stops)

    def arm(self) -> None:
        """Start the child. Raises LinkError."""
        if self._raw_access is not None:
            self._start()
            self._raw_access.note_unfinished, self._raw_access.before = self.note_unfinished, self._watch

    def follow(self, raw_access: RawAccess | None) -> None:
        """The link was opened again, or is gone (None): the child gets that, and so do the outer guards'. Raises LinkError."""
        guard: Guard | None = self
        while guard is not None:
            guard._raw_access, guard = raw_access, guard.outer
        self.arm()

    def update(self, first: Sequence[EarlyWrite], heartbeat: float | None = None) -> None:
        """From now on these go out before the stop, and this process may be silent for `heartbeat` seconds. Raises LinkError."""
        self._first, self._heartbeat = first, self._heartbeat if heartbeat is None else heartbeat
        if self._child is not None:
            self._tell(self._message())

    def note_unfinished(self, rest: bytes) -> None:
        """A frame is half sent: `rest` is missing, and goes before the stop; b"" once it is out."""
        rest = rest if len(rest) <= LARGEST // 2 else b""  # no frame that drives anything is so long
        if self._child is not None and rest != self._unsent:
            self._unsent = rest
            self._tell(self._message())

    def _message(self) -> bytes:
        return deadman_process.message(_pack(self._unsent, self._first), self._heartbeat)

    def disarm(self) -> None:
        """End the child before it sends anything, and wait for it. May be called twice."""
        if self._child is None:
            return
        if self._raw_access is not None:
            self._raw_access.note_unfinished = self._raw_access.before = nothing
        with deadman_process.unsignalled():
            self._end()

    def _watch(self) -> None:
        """Before a frame: the child must be there, and hears that its parent is. Raises LinkError, KeyboardInterrupt."""
        if self._child is None:
            return
        state = deadman_process.state(self._child)
        if state == "acts":
            child_process, self._child = self._child, None
            deadman_process.finished(child_process, self._bound)
            deadman_process.ended(child_process)
            text = f"this command hung for more than {self._heartbeat:g} s, so the device was stopped"
            self._warn("stood-still", text, "")
            raise KeyboardInterrupt
        if state == "gone":
            self._replace()
        elif self._heartbeat and clock.now() - self._told > self._heartbeat / 10:
            self._tell(deadman_process.PULSE)

    def _tell(self, message: bytes) -> None:
        self._told = clock.now()
        try:
            assert self._child is not None
            os.write(self._child.pipe, message)
        except OSError:  # it was killed, or it does not read
            self._replace()

    def _replace(self) -> None:
        with deadman_process.unsignalled():
            self._end()
        self._start()

    def _start(self) -> None:
        """Fork and wait until the child is ready, with signals blocked so that no child is lost."""
        raw_access = self._raw_access
        assert raw_access is not None
        act = partial(_stop_and_close, raw_access, partial(_stop_each, self.stops))
        self._told = clock.now()
        with deadman_process.unsignalled():
            try:
                self._child = deadman_process.started(
                    Job(raw_access.descriptor, self._held, act, self._message(), self._bound)
                )
            except OSError as exc:
                raise _cannot(exc.strerror or str(exc)) from exc
            except deadman_process.NotAlive as exc:
                raise _cannot("the child ended at once") from exc

    def _end(self) -> None:
        child_process, self._child = self._child, None
        if child_process is not None:
            deadman_process.ended(child_process)


def _device(stop: Stop) -> object:
    """Which device of its link it stops, as a `StopPlan` says."""
    return getattr(stop, "device", None)


def _cannot(why: str) -> LinkError:
    return unsent(
        LinkError(
            f"the process that stops the device if handctl is killed cannot be started: {why}",
            hint="end other programs, or allow more processes (ulimit -u).",
            code="no-guard",
        )
    )


# -- what the child does -------------------------------------------------------------------------------------------------


def _stop_and_close(raw_access: RawAccess, stop: Stop, message: bytes) -> None:
    with suppress(Exception):
        stop_in_child(raw_access, stop, message)
    with suppress(OSError):
        descriptors.close(raw_access.descriptor)  # before the lock: who gets that next must find the port free


def _stop_each(stops: Sequence[Stop], link: Link) -> None:
    """Each is begun before the first one is checked, where it says how: `begun`, which returns what is left of it."""
    left: list[Callable[[], object]] = []
    for stop in stops:
        with suppress(Exception):
            begun = getattr(stop, "begun", None)
            left.append(begun(link).finish if begun is not None else partial(stop, link))
    for finish in left:
        with suppress(Exception):  # whatever goes wrong with one, the next is stopped
            finish()


def stop_in_child(raw_access: RawAccess, stop: Stop, message: bytes) -> None:
    """Complete the frame, send what goes first, and stop; an error of one does not keep the next from being done."""
    unsent, shots = _unpack(message)
    link = RawBytes(raw_access) if raw_access.decode is None else RawFrames(raw_access)
    for data, pause in (EarlyWrite(unsent), *shots):
        with suppress(LinkError):
            link.put(data, link.deadline(BOUND_SECONDS))
        with suppress(LinkError):
            link.sleep_reading(pause)
    stop(link)


def _unread(text: str, code: str) -> LinkError:
    """An error in the child. It is never shown, so it has no next step."""
    return LinkError(text, code=code)


class _Raw(Link):
    """A descriptor of the system, without the library that has opened it."""

    def __init__(self, raw_access: RawAccess) -> None:
        self._raw_access, self.elsewhere = raw_access, raw_access.elsewhere

    def put(self, data: bytes, deadline: Deadline) -> None:
        """Bytes as they are. Raises LinkError."""
        while data:
            try:
                data = data[descriptors.write(self._raw_access.descriptor, data, deadline.remaining) :]
            except BlockingIOError:
                raise _unread("the link does not accept data", "write-timeout") from None
            except OSError as exc:
                raise _unread("the link is lost", "lost") from exc

    def got(self, deadline: Deadline) -> bytes:
        """Bytes as they are; b"" for silence. Raises LinkError."""
        try:
            data = descriptors.read(self._raw_access.descriptor, LARGEST, deadline.remaining)
        except BlockingIOError:
            return b""
        except OSError as exc:
            raise _unread("the link is lost", "lost") from exc
        if not data:
            raise _unread("the link is lost", "lost")
        return data

    def sleep_reading(self, seconds: float) -> None:
        """Let time pass, and throw away what comes: a socket that is closed over unread bytes drops what it has to send."""
        end = self.deadline(seconds)
        while not end.expired:
            self.got(end)

    def close(self) -> None:
        """The child closes it."""


class RawBytes(_Raw, ByteLink):
    """The link of a child: a port or a connection."""

    def __init__(self, raw_access: RawAccess) -> None:
        super().__init__(raw_access)
        self.baud, self.can_set_baud = raw_access.baud, raw_access.baud is not None

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.put(self._raw_access.encode(data, None), deadline)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        return self.got(deadline)


class RawFrames(_Raw, FrameLink):
    """The same on a CAN bus."""

    def __init__(self, raw_access: RawAccess) -> None:
        super().__init__(raw_access)
        self._rest = b""
        self._frames: list[CanFrame] = []

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self.put(self._raw_access.encode(frame.data, frame.can_id), deadline)

    def receive(self, deadline: Deadline) -> CanFrame | None:
        assert self._raw_access.decode is not None
        while not self._frames:
            data = self.got(deadline)
            if not data:
                return None
            frames, self._rest = self._raw_access.decode(self._rest + data)
            self._frames += frames
        return self._frames.pop(0)


# -- what the child is told: the frame's rest and the shots ----------------------------------------------------------------


def _pack(unsent: bytes, first: Sequence[EarlyWrite]) -> bytes:
    parts = [len(unsent).to_bytes(2, "big"), unsent]
    for data, pause in first:
        parts += [len(data).to_bytes(2, "big"), round(pause * 1000).to_bytes(2, "big"), data]
    text = b"".join(parts)
    assert len(text) + 4 <= LARGEST
    return text


def _unpack(text: bytes) -> tuple[bytes, list[EarlyWrite]]:
    size = int.from_bytes(text[:2], "big")
    unsent, text = text[2 : 2 + size], text[2 + size :]
    first = []
    while text:
        size, pause = int.from_bytes(text[:2], "big"), int.from_bytes(text[2:4], "big")
        first.append(EarlyWrite(text[4 : 4 + size], pause / 1000))
        text = text[4 + size :]
    return unsent, first
