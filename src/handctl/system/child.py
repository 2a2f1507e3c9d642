"""A child process that outlives this one and acts when it dies: a plain fork, see `link.deadman`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import NamedTuple

NAME, LINE = b"deadman", b"deadman: stops the device when the command that drives it has died"
"""What tools call the child: nothing of its parent's name, so that who kills that by name leaves it."""


class NotAlive(Exception):
    """The child ended at once."""


class Job(NamedTuple):
    """What a child has to do.

    keep   descriptors that stay open in it
    act    what it does once its parent is dead, with what it was told last
    first  what it is told at the beginning, as `message` has it
    bound  seconds for that
    """

    keep: Sequence[int]
    act: Callable[[bytes], object]
    first: bytes
    bound: float


PULSE = b"\0\0"
"""A message that tells only that the parent lives."""


def message(text: bytes, beat: float) -> bytes:
    """A message to the child: 2 bytes of length, then the `beat` in milliseconds and the text.

    beat   seconds without a message after which a parent that lives counts as dead, 0 = it may be silent
    """
    return (len(text) + 2).to_bytes(2, "big") + round(beat * 1000).to_bytes(2, "big") + text


class Heir(NamedTuple):
    """A child as its parent knows it: its number, the pipe to it, and the one back."""

    pid: int
    pipe: int
    back: int


READY, ACTS = b"1", b"2"


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

    def started(job: Job) -> Heir:
        raise OSError("handctl starts no such process on Windows")

    def ended(heir: Heir) -> None: ...

    def state(heir: Heir) -> str:
        return "lives"

    def finished(heir: Heir, seconds: float) -> None: ...

else:
    import gc
    import select
    import signal
    from typing import NoReturn

    def started(job: Job) -> Heir:
        """A child that is ready. Once this process is dead it acts. To be called `unsignalled`. Raises OSError, NotAlive."""
        ends: list[int] = []
        try:
            ends += os.pipe()
            ends += os.pipe()
            parent, pid = os.getpid(), os.fork()
        except OSError:
            for end in ends:
                os.close(end)
            raise
        orders, pipe, back, told = ends
        if pid == 0:
            _live(job, orders, told, parent)
        heir = Heir(pid, pipe, back)
        os.set_blocking(pipe, False)
        os.close(orders)
        os.close(told)
        if not os.read(back, 1):
            ended(heir)
            raise NotAlive
        os.set_blocking(back, False)
        return heir

    def ended(heir: Heir) -> None:
        """Kill first, close then: a closed pipe is the order to act."""
        with suppress(ProcessLookupError):
            os.kill(heir.pid, 9)
        with suppress(ChildProcessError):
            os.waitpid(heir.pid, 0)
        os.close(heir.pipe)
        os.close(heir.back)

    def state(heir: Heir) -> str:
        """``lives``, ``acts`` where it took this process for dead, or ``gone``."""
        try:
            told = os.read(heir.back, 1)
        except BlockingIOError:
            return "lives"
        return "acts" if told == ACTS else "gone"

    def finished(heir: Heir, seconds: float) -> None:
        """Wait until a child that acts has done so."""
        select.select([heir.back], [], [], seconds)

    # -- the child -----------------------------------------------------------------------------------------------------

    def _live(job: Job, orders: int, told: int, parent: int) -> NoReturn:
        """The whole life of the child: ready, wait, act, end. Nothing of the parent may run in it again."""
        try:
            gc.disable()  # what the collector would finalize belongs to the parent
            os.setsid()
            with suppress(OSError, ValueError, IndexError):
                _rename()
            os.set_blocking(orders, False)
            _close_all_but({orders, told, *job.keep})
            os.write(told, READY)
            last = _last_message(orders, parent, job.first)
            with suppress(OSError):
                os.write(told, ACTS)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})
            signal.setitimer(signal.ITIMER_REAL, job.bound)
            job.act(last)
        finally:
            os._exit(0)

    def _rename() -> None:
        """Another name and another command line, where the system has them as files (Linux)."""
        start, size = _arguments()
        for name, text, place in (("comm", NAME, 0), ("mem", LINE[: size - 1].ljust(size, b"\0"), start)):
            file = os.open(f"/proc/self/{name}", os.O_WRONLY)
            try:
                if place:
                    os.lseek(file, place, os.SEEK_SET)
                os.write(file, text)
            finally:
                os.close(file)

    def _arguments() -> tuple[int, int]:
        """Where this process keeps its command line, and how many bytes that has (proc(5): arg_start, arg_end)."""
        file = os.open("/proc/self/stat", os.O_RDONLY)
        try:
            fields = os.read(file, 4096).rpartition(b")")[2].split()
        finally:
            os.close(file)
        start, end = int(fields[45]), int(fields[46])
        return start, end - start

    def _close_all_but(keep: set[int]) -> None:
        """Pipes and files of the parent end with the parent, not with its child."""
        for name in os.listdir("/dev/fd"):
            if int(name) not in keep:
                with suppress(OSError):
                    os.close(int(name))

    def _last_message(orders: int, parent: int, first: bytes) -> bytes:
        """Wait until the parent is dead, or silent for too long. Returns its last text.

        Its end of the pipe closes with it. Where a process that it forked holds that end too, the parent itself is watched.
        """
        poll = select.poll()
        poll.register(orders, select.POLLIN)
        if hasattr(os, "pidfd_open"):
            with suppress(OSError):  # an old kernel, or not permitted: the pipe alone then
                poll.register(os.pidfd_open(parent), select.POLLIN)
        last, rest, dead = first[2:], b"", False
        while not dead:
            ready = poll.poll(int.from_bytes(last[:2], "big") or None)
            dead = not ready or any(descriptor != orders for descriptor, _ in ready) or os.getppid() != parent
            try:
                chunk = os.read(orders, 1 << 16)
            except BlockingIOError:
                continue
            dead = dead or not chunk
            rest += chunk
            while len(rest) >= 2 and len(rest) >= (size := 2 + int.from_bytes(rest[:2], "big")):
                last, rest = rest[2:size] or last, rest[size:]
        return last[2:]
