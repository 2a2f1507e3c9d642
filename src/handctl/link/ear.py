"""The wish of another process to stop the device that this one holds: a Unix socket beside the lock file.

Whoever connects wishes the stop. The system tells by a signal (SIGIO), so nobody polls and no thread waits; the handler
runs between two steps of the program, also while that waits for the device or for a reader of its output. It answers
`heard` at once, then one line of JSON with what was sent. Where the system has no such signal there is no ear.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from typing import Any

HEARD_SECONDS = 0.3
"""A holder that does not answer within this is asleep, or blocked."""
STOP_SECONDS = 9.0
"""Longest time from `heard` to the report: the longest stop, with silence at every step."""
LONGEST_PATH = 100
"""Bytes of a socket's name that every system takes."""
MOST = 1 << 16


class Ear:
    """Listens while it is open. `answer` stops the device and says how; `after` is then called with the frame."""

    def __init__(self, lock: str, answer: Callable[[], dict[str, Any]], after: Callable[[Any], None]) -> None:
        """Raises OSError, ImportError, AttributeError where it cannot be."""
        import _socket
        import fcntl
        import signal

        self._answer, self._after = answer, after
        self._busy = False
        self._path = _beside(lock)
        self._socket = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
        try:
            with _reachable(self._path) as path:
                with contextlib.suppress(FileNotFoundError):
                    os.unlink(path)  # of one that was killed: who has the lock has this name
                self._socket.bind(path)
            self._socket.listen(4)
            number = self._socket.fileno()
            signal.signal(signal.SIGIO, self._called)  # first: without a handler the signal ends the program
            fcntl.fcntl(number, fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(number, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)
        except BaseException:
            self._socket.close()
            raise

    def close(self) -> None:
        """Listen no more. May be called twice."""
        if self._socket.fileno() >= 0:
            with contextlib.suppress(OSError), _reachable(self._path) as path:
                os.unlink(path)
            self._socket.close()

    def _called(self, _number: int, frame: Any) -> None:
        if self._busy:
            return
        self._busy = True
        served = False
        try:
            with _one_at_a_time():
                while self._serve():
                    served = True
        finally:
            self._busy = False
        if served:
            self._after(frame)

    def _serve(self) -> bool:
        """Answer one who waits; False when nobody does."""
        import _socket

        try:
            number, _ = self._socket._accept()  # type: ignore[attr-defined]  # what socket.accept itself calls
        except OSError:
            return False
        peer = _socket.socket(fileno=number)
        with contextlib.suppress(OSError):
            peer.setblocking(False)
            peer.send(b"heard\n")
        report = self._answer()
        import json

        with contextlib.suppress(OSError):
            peer.send(json.dumps(report).encode() + b"\n")
        peer.close()
        return True


def ask(lock: str, until: float) -> tuple[bool, dict[str, Any] | None]:
    """Ask who holds `lock` to stop: whether it heard that before `until` (time.monotonic), and its report.

    The report is None when it ended, or fell silent, on the way.
    """
    import _socket  # `socket` costs ten times as much to import
    import json

    try:
        line = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
        with contextlib.closing(line), _reachable(_beside(lock)) as path:
            line.settimeout(max(0.001, until - time.monotonic()))
            line.connect(path)
            came = line.recv(6)
            if not came:
                return False, None
            line.settimeout(STOP_SECONDS)
            with contextlib.suppress(OSError):
                while len(came) < MOST and (chunk := line.recv(4096)):
                    came += chunk
    except (OSError, AttributeError):
        return False, None
    try:
        report = json.loads(came.partition(b"\n")[2])
    except (ValueError, RecursionError):
        report = None
    return True, report if isinstance(report, dict) else None


def _beside(lock: str) -> str:
    folder, _, name = lock.rpartition("/")
    name = name.removeprefix("lock-")
    if len(name) > 60:
        import hashlib

        name = hashlib.sha256(name.encode()).hexdigest()[:32]
    return f"{folder}/stop-{name}"


@contextlib.contextmanager
def _reachable(path: str) -> Iterator[str]:
    """The path of a socket in a form that is short enough."""
    if len(os.fsencode(path)) <= LONGEST_PATH:
        yield path
        return
    folder, _, name = path.rpartition("/")
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{descriptor}/{name}"
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _one_at_a_time() -> Iterator[None]:
    """Ctrl-C and its like wait until the stop has gone out."""
    import signal

    names = ("SIGINT", "SIGQUIT", "SIGTERM", "SIGHUP", "SIGTSTP")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {getattr(signal, name) for name in names})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
