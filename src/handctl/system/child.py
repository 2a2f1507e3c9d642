"""A process that outlives this one and acts when it dies: a plain fork, see `link.deadman`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

Wire = tuple[tuple[bytes, float], ...]
"""What is written, each with the seconds of silence behind it."""
Orders = tuple[bytes, Wire]
"""The rest of what is half sent, and the wire."""

FULL_SECONDS = 0.2
"""How long it waits for room in a link that is full, before it tries again."""


class NotAlive(Exception):
    """The child ended at once."""


def can_be() -> bool:
    """Whether there can be such a process."""
    return sys.platform != "win32" and hasattr(os, "fork")


@contextmanager
def unsignalled() -> Iterator[None]:
    """Signals wait until this is over; a child that is forked in here keeps them waiting for good."""
    if sys.platform == "win32":
        yield
    else:
        import signal

        before = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


if sys.platform == "win32":

    def started(
        link: int, held: Sequence[int], first: Orders, unpack: Callable[[bytes], Orders], bound: float
    ) -> tuple[int, int]:
        raise OSError("no process can hold a link here")

    def ended(pid: int, pipe: int) -> None: ...

else:
    import gc
    import select
    import signal
    import time
    from typing import NoReturn

    def started(
        link: int, held: Sequence[int], first: Orders, unpack: Callable[[bytes], Orders], bound: float
    ) -> tuple[int, int]:
        """A child that is ready, and the pipe for its orders, each with its length in two bytes before it.

        It keeps `link` and what is `held`. Once this process is dead it writes what it was told last, `first` if nothing,
        within `bound` seconds. To be called `unsignalled`. Raises OSError, NotAlive.
        """
        ends: list[int] = []
        try:
            ends += os.pipe()
            ends += os.pipe()
            parent, pid = os.getpid(), os.fork()
        except OSError:
            for end in ends:
                os.close(end)
            raise
        orders, pipe, ready, told = ends
        if pid == 0:
            _live(link, orders, told, {link, orders, told, *held}, parent, first, unpack, bound)
        os.set_blocking(pipe, False)
        os.close(orders)
        os.close(told)
        alive = os.read(ready, 1)
        os.close(ready)
        if not alive:
            ended(pid, pipe)
            raise NotAlive
        return pid, pipe

    def ended(pid: int, pipe: int) -> None:
        """Kill first, close then: a closed pipe is the order to act."""
        with suppress(ProcessLookupError):
            os.kill(pid, 9)
        with suppress(ChildProcessError):
            os.waitpid(pid, 0)
        os.close(pipe)

    # -- the child -----------------------------------------------------------------------------------------------------

    def _live(
        link: int,
        orders: int,
        told: int,
        keep: set[int],
        parent: int,
        last: Orders,
        unpack: Callable[[bytes], Orders],
        bound: float,
    ) -> NoReturn:
        """The whole life of the child: ready, wait, act, end. Nothing of the parent may run in it again."""
        try:
            gc.disable()  # what the collector would finalize belongs to the parent
            os.setsid()
            os.set_blocking(orders, False)
            _close_all_but(keep)
            os.write(told, b"1")
            os.close(told)
            _act(link, bound, *_last_orders(orders, parent, last, unpack))
        finally:
            os._exit(0)

    def _close_all_but(keep: set[int]) -> None:
        """Pipes and files of the parent end with the parent, not with its child."""
        for name in os.listdir("/dev/fd"):
            if int(name) not in keep:
                with suppress(OSError):
                    os.close(int(name))

    def _last_orders(orders: int, parent: int, last: Orders, unpack: Callable[[bytes], Orders]) -> Orders:
        """Wait until the parent is dead; what it said last.

        Its end of the pipe closes with it. Where a process that it forked holds that end too, the parent itself is watched.
        """
        poll = select.poll()
        poll.register(orders, select.POLLIN)
        if hasattr(os, "pidfd_open"):
            with suppress(OSError):  # an old kernel, or not permitted: the pipe alone then
                poll.register(os.pidfd_open(parent), select.POLLIN)
        rest, dead = b"", False
        while not dead:
            dead = any(descriptor != orders for descriptor, _ in poll.poll()) or os.getppid() != parent
            try:
                chunk = os.read(orders, 1 << 16)
            except BlockingIOError:
                continue
            dead = dead or not chunk
            rest += chunk
            while len(rest) >= 2 and len(rest) >= (size := 2 + int.from_bytes(rest[:2], "big")):
                last, rest = unpack(rest[2:size]), rest[size:]
        return last

    def _act(link: int, bound: float, owed: bytes, stop: Wire) -> None:
        """Complete the frame, send the shots; an error of one does not keep the next from being sent."""
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})
        signal.setitimer(signal.ITIMER_REAL, bound)
        for data, pause in ((owed, 0.0), *stop):
            with suppress(OSError, ValueError):
                _write(link, data)
            with suppress(OSError, ValueError):
                _pass(link, pause)
        os.close(link)  # before the lock: who gets that next must find the port free

    def _write(link: int, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(link, data) :]
            except BlockingIOError:
                select.select([], [link], [], FULL_SECONDS)

    def _pass(link: int, seconds: float) -> None:
        """Let time pass, and throw away what comes: a socket that is closed over unread bytes drops what it has to send."""
        end = time.monotonic() + seconds
        open_ = True
        while (left := end - time.monotonic()) > 0:
            if select.select([link] if open_ else [], [], [], left)[0]:
                open_ = bool(os.read(link, 4096))
