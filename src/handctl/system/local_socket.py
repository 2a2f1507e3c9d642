"""Sockets between processes of the same user on this machine.

`_socket` is what `socket` is made of, and costs a tenth of its time to import.
"""

from __future__ import annotations

import _socket
import contextlib
import errno
import os
import stat
import sys
from collections.abc import Callable, Iterator
from typing import Any

LONGEST_PATH = 100
"""Bytes of a socket's name that every system takes."""
Peer = _socket.socket


TOKEN_SECONDS = 0.3
"""For the first words of who comes, where they must prove that they may."""


class Listener:
    """A listening socket at `path`. `accept` takes a connection and does not wait.

    On Windows that is a port of the loopback and a file at `path`, which only its user can read: it holds the port, and a
    token that who comes says first.
    """

    def __init__(self, path: str, clients: int = 8) -> None:
        """Raises OSError, also where `path` is there already."""
        self.path = path
        self._socket, self._token = _listening(path)
        with _or_closed(self._socket):
            self._socket.listen(clients)
            self._socket.setblocking(False)

    def fileno(self) -> int:
        """For select; -1 once it is closed."""
        return self._socket.fileno()

    def accept(self) -> Peer:
        """Raises OSError if no connection is waiting."""
        number, _ = self._socket._accept()  # type: ignore[attr-defined]  # what socket.accept itself calls
        peer = Peer(fileno=number)
        if self._token:
            said = b""
            peer.settimeout(TOKEN_SECONDS)
            with contextlib.suppress(OSError):
                while len(said) < len(self._token) and (more := peer.recv(len(self._token) - len(said))):
                    said += more
            if said != self._token:
                peer.close()
                raise ConnectionRefusedError(errno.ECONNREFUSED, "it does not know the token")
        peer.setblocking(False)
        return peer

    def close(self) -> None:
        """Reached no more. May be called twice."""
        if self._socket.fileno() >= 0:
            with contextlib.suppress(OSError):
                remove(self.path)
            self._socket.close()


@contextlib.contextmanager
def _or_closed(peer: Peer) -> Iterator[None]:
    """What fails in here leaves nothing open."""
    try:
        yield
    except BaseException:
        peer.close()
        raise


def _listening(path: str) -> tuple[Peer, bytes]:
    """A socket that leads to `path`, and the token of who may come; b"" where the system keeps others off."""
    if sys.platform == "win32":
        return _on_loopback(path)
    found = Peer(_socket.AF_UNIX, _socket.SOCK_STREAM)
    with _or_closed(found), _reachable(path) as short:
        found.bind(short)
    return found, b""


def _on_loopback(path: str) -> tuple[Peer, bytes]:
    """The way of Windows. Raises OSError, FileExistsError too."""
    import secrets

    token = secrets.token_hex(16).encode()
    found = Peer(_socket.AF_INET, _socket.SOCK_STREAM)
    with _or_closed(found):
        found.bind(("127.0.0.1", 0))
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        try:
            os.write(descriptor, b"%s %d %s" % (MARK, found.getsockname()[1], token))
        finally:
            os.close(descriptor)
    return found, token


MARK = b"handctl-local"
"""First word of the file that leads to a listener."""


def _over_loopback(path: str, seconds: float) -> Peer:
    """A connection to `_on_loopback`. Raises OSError."""
    with open(path, "rb") as file:
        words = file.read(200).split()
    if len(words) != 3 or words[0] != MARK or not words[1].isdigit():
        raise OSError(errno.EINVAL, "no simulator or handctl command can be reached there")
    found = Peer(_socket.AF_INET, _socket.SOCK_STREAM)
    with _or_closed(found):
        found.settimeout(seconds)
        found.connect(("127.0.0.1", int(words[1])))
        found.sendall(words[2])
    return found


def connected(path: str, seconds: float) -> Peer:
    """A connection to who listens at `path`, which waits `seconds` for it and for what it says. Raises OSError."""
    if sys.platform == "win32":
        return _over_loopback(path, seconds)
    found = Peer(_socket.AF_UNIX, _socket.SOCK_STREAM)
    with _or_closed(found), _reachable(path) as short:
        found.settimeout(seconds)
        found.connect(short)
    return found


def remove(path: str) -> None:
    """Take away what leads to a listener that has gone. Raises OSError."""
    with _reachable(path) as short:
        os.unlink(short)


def remove_dead(path: str) -> None:
    """Take away what a killed listener left; anything else there is left alone. Raises OSError where one listens."""
    try:
        if not _is_ours(path):
            return
    except FileNotFoundError:
        return
    try:
        connected(path, 5.0).close()
    except ConnectionRefusedError:
        os.unlink(path)
    else:
        raise OSError(errno.EADDRINUSE, "another simulator listens there")


def _is_ours(path: str) -> bool:
    """Whether the file belongs to a listener, running or not. Raises OSError."""
    if sys.platform != "win32":
        return stat.S_ISSOCK(os.stat(path).st_mode)
    with open(path, "rb") as file:
        return file.read(len(MARK)) == MARK


def tell_at_once(listener: Listener, called: Callable[[Any], None]) -> None:
    """From now on each connection runs `called` in the main thread, between two of its steps, with its frame.

    Raises OSError, ValueError where it cannot be.
    """
    if sys.platform == "win32":
        _watch(listener, called)
        return
    import fcntl
    import signal

    number = listener.fileno()
    _listening_here[:] = [*(one for one in _listening_here if one[0].fileno() >= 0), (listener, called)]
    signal.signal(signal.SIGIO, _call_all)  # first: without a handler the signal ends the program
    fcntl.fcntl(number, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(number, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)


_listening_here: list[tuple[Listener, Callable[[Any], None]]] = []
"""The listeners of this process: one signal tells of all of them, and not which one is meant."""


def _call_all(_number: int, frame: Any) -> None:
    """Each is called, also where one of them raises."""
    with contextlib.ExitStack() as calls:
        for listener, called in _listening_here:
            if listener.fileno() >= 0:
                calls.callback(called, frame)


def _watch(listener: Listener, called: Callable[[Any], None]) -> None:
    """A thread that waits in place of the system."""
    import select
    import threading
    import time

    from handctl.system.signals import Bell

    bell = Bell(called)

    def wait() -> None:
        with contextlib.suppress(OSError, ValueError):  # it was closed
            while select.select([listener.fileno()], [], [], WATCH_SECONDS)[0]:
                bell.ring()
                time.sleep(WATCH_SECONDS)

    def watch() -> None:
        while listener.fileno() >= 0:
            wait()

    threading.Thread(target=watch, daemon=True).start()


WATCH_SECONDS = 0.1
"""Between two looks whether a listener was closed, or whether somebody still waits."""


@contextlib.contextmanager
def _reachable(path: str) -> Iterator[str]:
    """The path of a socket in a form that is short enough."""
    if sys.platform == "win32" or len(os.fsencode(path)) <= LONGEST_PATH:
        yield path
        return
    folder, _, name = path.rpartition("/")
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{descriptor}/{name}"
    finally:
        os.close(descriptor)
