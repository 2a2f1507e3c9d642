"""A child process that outlives this one and acts when it dies, see `link.deadman`: a fork, on Windows a program of its own."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from typing import NamedTuple, NoReturn

NAME, LINE = b"deadman", b"deadman: stops the device when the command that drives it has died"
"""What tools call the child: nothing of its parent's name, so that who kills that by name leaves it."""


class NotAlive(Exception):
    """The child ended at once."""


class Job(NamedTuple):
    """What a child has to do.

    way    the descriptor that it acts through, on Windows the handle
    locks  descriptors that it keeps open, too; on Windows it locks them anew
    act    what it does once its parent is dead, with what it was told last; on Windows it is pickled
    first  what it is told at the beginning, as `message` has it
    bound  seconds for that
    """

    way: int
    locks: Sequence[int]
    act: Callable[[bytes], object]
    first: bytes
    bound: float


HEARTBEAT_TIMEOUT = 0.5
"""Seconds for which a command may hang that drives what does not end by itself, such as currents."""
PULSE = b"\0\0"
"""A message that tells only that the parent lives."""


def message(text: bytes, heartbeat: float) -> bytes:
    """A message to the child: 2 bytes of length, then the `heartbeat` in milliseconds and the text.

    heartbeat   seconds without a message after which a parent that lives counts as dead, 0 = it may be silent
    """
    return (len(text) + 2).to_bytes(2, "big") + round(heartbeat * 1000).to_bytes(2, "big") + text


def _heard(last: bytes, data: bytes) -> tuple[bytes, bytes]:
    """The last whole message in what came, or the one before; and what is less than one."""
    while len(data) >= 2 and len(data) >= (size := 2 + int.from_bytes(data[:2], "big")):
        last, data = data[2:size] or last, data[size:]
    return last, data


class DeadmanChild(NamedTuple):
    """A child as its parent knows it: its number (on Windows its handle), the pipe to it, and the one back."""

    pid: int
    pipe: int
    back: int


READY, ACTS = b"1", b"2"


def can_be() -> bool:
    """Whether there can be such a process."""
    return sys.platform == "win32" or hasattr(os, "fork")


@contextmanager
def unsignalled() -> Iterator[None]:
    """Signals wait until this is over; a child that is forked in here keeps them waiting for good."""
    if sys.platform == "win32":
        from handctl.system import signals

        with signals.held_back(signals.numbers()):
            yield
    else:
        import signal

        before = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


if sys.platform == "win32":
    import _winapi
    import msvcrt
    from types import SimpleNamespace

    from handctl.system import clock

    START_SECONDS = 20.0
    """For the child to be ready: a busy machine, and a scanner of viruses that looks at each file."""
    BY_NAME = ("deadman", "inherited")
    """The arguments with which a handctl.exe without a Python beside it becomes the child."""
    BY_PATH = "import sys; sys.path[:] = sys.argv[1:]; from handctl.system.deadman_process import live; live()"
    PIPE_NOWAIT = 1

    def started(job: Job) -> DeadmanChild:
        """A child that is ready. Once this process is dead it acts. To be called `unsignalled`. Raises OSError, NotAlive."""
        import pickle

        locks = [msvcrt.get_osfhandle(lock) for lock in job.locks]
        task = pickle.dumps(job._replace(locks=locks))
        (orders, pipe), (back, told) = os.pipe(), os.pipe()
        ends = [msvcrt.get_osfhandle(end) for end in (orders, told)]
        try:
            process = _created(ends, [*ends, job.way, *locks])
        except OSError:
            os.close(pipe)
            os.close(back)
            raise
        finally:
            os.close(orders)
            os.close(told)
        heir = DeadmanChild(process, pipe, back)
        with suppress(OSError):
            os.write(pipe, task)
            end = clock.now() + START_SECONDS
            while state(heir) == "lives" and clock.now() < end:
                clock.sleep(0.001)
            if state(heir) == "acts" and os.read(back, 1) == READY:
                _winapi.SetNamedPipeHandleState(msvcrt.get_osfhandle(pipe), PIPE_NOWAIT, None, None)
                return heir
        ended(heir)
        raise NotAlive

    def _created(ends: list[int], handles: list[int]) -> int:
        """A process with these handles and no others, its stdin and stdout the `ends`; its handle. Raises OSError.

        It has no console: neither Ctrl-C nor closing the window reaches it. It leaves the job of this process where it may.
        """
        from subprocess import list2cmdline

        program, words = sys.executable, [*BY_NAME]
        if not getattr(sys, "frozen", False):
            program = getattr(sys, "_base_executable", program)  # that of a virtual environment starts another one
            words = ["-I", "-S", "-c", BY_PATH, *(os.path.abspath(place) for place in sys.path)]
        startup = SimpleNamespace(
            dwFlags=0x100, wShowWindow=0, hStdInput=ends[0], hStdOutput=ends[1], hStdError=0, lpAttributeList={"handle_list": handles}
        )  # fmt: skip
        alone = _winapi.DETACHED_PROCESS | _winapi.CREATE_NEW_PROCESS_GROUP
        for handle in handles:
            os.set_handle_inheritable(handle, True)
        try:
            for job in (_winapi.CREATE_BREAKAWAY_FROM_JOB, 0):
                with suppress(PermissionError) if job else nullcontext():
                    process, thread, *_ = _winapi.CreateProcess(
                        program, list2cmdline([program, *words]), None, None, True, alone | job, dict(os.environ), None, startup
                    )  # fmt: skip
                    break
        finally:
            for handle in handles:
                os.set_handle_inheritable(handle, False)
        _winapi.CloseHandle(thread)
        return process

    def ended(heir: DeadmanChild) -> None:
        """Kill first, close then: a closed pipe is the order to act."""
        with suppress(OSError):
            _winapi.TerminateProcess(heir.pid, 0)
        _winapi.WaitForSingleObject(heir.pid, 5000)
        _winapi.CloseHandle(heir.pid)
        os.close(heir.pipe)
        os.close(heir.back)

    def state(heir: DeadmanChild) -> str:
        """``lives``, ``acts`` where it took this process for dead, or ``gone``."""
        try:
            waiting = _winapi.PeekNamedPipe(msvcrt.get_osfhandle(heir.back))[0]
        except OSError:
            return "gone"
        return "acts" if waiting else "lives"

    def finished(heir: DeadmanChild, seconds: float) -> None:
        """Wait until a child that acts has done so."""
        _winapi.WaitForSingleObject(heir.pid, round(seconds * 1000))

    # -- the child -----------------------------------------------------------------------------------------------------

    def live() -> NoReturn:
        """The whole life of the child: ready, wait, act, end."""
        import pickle
        import threading

        from handctl.system import file_locks

        try:
            job: Job = pickle.load(sys.stdin.buffer)  # noqa: S301 - of our parent
            os.write(1, READY)
            last = _last_message(job.first)
            with suppress(OSError):
                os.write(1, ACTS)
            bound = threading.Timer(job.bound, os._exit, (0,))
            bound.daemon = True
            bound.start()
            for lock in job.locks:
                with suppress(OSError):
                    file_locks.whole(msvcrt.open_osfhandle(lock, 0))
            job.act(last)
        finally:
            os._exit(0)

    def _last_message(first: bytes) -> bytes:
        """Wait until the parent is dead, or silent for too long. Returns its last text."""
        import queue
        import threading

        came: queue.SimpleQueue[bytes] = queue.SimpleQueue()

        def hear() -> None:
            with suppress(OSError):
                while data := os.read(0, 1 << 16):
                    came.put(data)
            came.put(b"")

        threading.Thread(target=hear, daemon=True).start()
        last, rest = first[2:], b""
        with suppress(queue.Empty):
            while data := came.get(timeout=int.from_bytes(last[:2], "big") / 1000 or None):
                last, rest = _heard(last, rest + data)
        return last[2:]

else:
    import gc
    import select
    import signal

    def started(job: Job) -> DeadmanChild:
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
        heir = DeadmanChild(pid, pipe, back)
        os.set_blocking(pipe, False)
        os.close(orders)
        os.close(told)
        if not os.read(back, 1):
            ended(heir)
            raise NotAlive
        os.set_blocking(back, False)
        return heir

    def ended(heir: DeadmanChild) -> None:
        """Kill first, close then: a closed pipe is the order to act."""
        with suppress(ProcessLookupError):
            os.kill(heir.pid, 9)
        with suppress(ChildProcessError):
            os.waitpid(heir.pid, 0)
        os.close(heir.pipe)
        os.close(heir.back)

    def state(heir: DeadmanChild) -> str:
        """``lives``, ``acts`` where it took this process for dead, or ``gone``."""
        try:
            told = os.read(heir.back, 1)
        except BlockingIOError:
            return "lives"
        return "acts" if told == ACTS else "gone"

    def finished(heir: DeadmanChild, seconds: float) -> None:
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
            _close_all_but({orders, told, job.way, *job.locks})
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
            last, rest = _heard(last, rest + chunk)
        return last[2:]
