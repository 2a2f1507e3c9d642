"""Where clients of a simulator come in: a pseudo terminal, or a TCP port for one client at a time.

Knows file descriptors and serial speeds; nothing of the line behind it, and no time but the patience of a hang-up.
"""

from __future__ import annotations

import contextlib
import os
import socket
from typing import Protocol

from handctl.system import clock, terminal


class ServeError(Exception):
    """The place to serve at cannot be had; the text says what and why."""


class Port(Protocol):
    """Where clients come in."""

    @property
    def link(self) -> str:
        """What a client passes to --port."""

    def readers(self) -> list[int]: ...

    def read(self, ready: list[int]) -> bytes | None:
        """What came in; b"" nothing, None: a new client took the place of the old one."""

    def write(self, data: bytes) -> int:
        """Writes what fits without waiting, returns how much."""

    def writer(self) -> int | None: ...

    def baud(self) -> int | None:
        """The serial speed of the client, None if the link has none."""

    def hang_up(self) -> bool:
        """Drops the client; True when nobody can come any more."""

    def plug(self, present: bool) -> None:
        """Unplugs it, with its client, or plugs it in again."""

    def close(self) -> None: ...


class PtyPort:
    """A pseudo terminal. Its slave side is kept open here, so that clients can come and go.

    With `name` a symbolic link leads to it, as /dev/serial/by-id does: the name stays when the terminal is another one.
    """

    def __init__(self, speed: int | None, name: str | None = None) -> None:
        self._speed = speed
        self._name = name
        self._closed = True
        self._open()
        self.link = name or terminal.pseudo_name(self._slave)

    def _open(self) -> None:
        try:
            self._master, self._slave = terminal.pseudo(self._speed)
        except OSError as exc:
            raise ServeError(f"cannot open a pty: {exc.strerror or exc}") from exc
        self._closed = False
        if self._name is not None:
            try:
                if os.path.islink(self._name) and not os.path.exists(self._name):
                    os.unlink(self._name)  # of one that was killed
                os.symlink(terminal.pseudo_name(self._slave), self._name)
            except OSError as exc:
                name, self._name = self._name, None
                self.close()
                raise ServeError(f"cannot make the link {name}: {exc.strerror}") from exc

    def plug(self, present: bool) -> None:
        if present and self._closed:
            self._open()
        elif not present:
            self.close()

    def readers(self) -> list[int]:
        return [] if self._closed else [self._master]

    def read(self, ready: list[int]) -> bytes:
        if self._closed or self._master not in ready:
            return b""
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        if self._closed:
            return len(data)
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def writer(self) -> int:
        return self._master

    def baud(self) -> int:
        """The speed that the client set; -1 for one that has no name."""
        return -1 if self._closed else terminal.speed_of(self._master)

    def hang_up(self) -> bool:
        # Closing the master throws away what the client has not read: let it have the first half of the reply. The
        # kernel hands bytes to the slave side a little later, so a count of 0 means nothing at once.
        clock.sleep(0.02)
        patience = clock.now() + 0.2
        while terminal.unread(self._slave) and clock.now() < patience:
            clock.sleep(0.002)
        self.close()
        return True

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            os.close(self._master)
            os.close(self._slave)
            if self._name is not None:
                with contextlib.suppress(OSError):
                    os.unlink(self._name)


class TcpDoor:
    """A listening port; who comes gets a place of its own."""

    def __init__(self, host: str, port: int) -> None:
        self.host = host
        self._open(host, port)
        self._port = self._listener.getsockname()[1]
        shown = f"[{host}]" if ":" in host else host
        self.link = f"tcp://{shown}:{self._port}"

    def _open(self, host: str, port: int) -> None:
        try:
            family, kind, proto, _, address = socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            self._listener = socket.socket(family, kind, proto)
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind(address)
            self._listener.listen(8)
        except OSError as exc:
            raise ServeError(f"cannot listen on {host}:{port}: {exc.strerror or exc}") from exc
        self._listener.setblocking(False)

    def move(self, host: str) -> None:
        """Listens at this address of the machine instead, or nowhere when the machine does not have it."""
        if host != self.host:
            self._listener.close()
            self.host = host
            with contextlib.suppress(ServeError):
                self._open(host, self._port)
                return
            self._listener.close()

    def fileno(self) -> int:
        """-1 when it listens nowhere."""
        return self._listener.fileno()

    def accept(self) -> TcpClient | None:
        """Whoever waits at the door; None: it has left again."""
        try:
            client, _ = self._listener.accept()
        except (BlockingIOError, ConnectionAbortedError):
            return None
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return TcpClient(client, self.link)

    def close(self) -> None:
        self._listener.close()


class TcpClient:
    """One client that came through a door."""

    def __init__(self, client: socket.socket, link: str) -> None:
        self._client = client
        self.link = link
        self.gone = False

    def readers(self) -> list[int]:
        return [] if self.gone else [self._client.fileno()]

    def read(self, ready: list[int]) -> bytes | None:
        """None: it has left."""
        if self.gone:
            return None
        if not ready:
            return b""
        try:
            data = self._client.recv(4096)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        return data or None

    def write(self, data: bytes) -> int:
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return len(data)

    def writer(self) -> int | None:
        return None if self.gone else self._client.fileno()

    def baud(self) -> None:
        return None

    def hang_up(self) -> bool:
        self.gone = True
        return True

    def plug(self, present: bool) -> None:
        if not present:
            self.hang_up()

    def close(self) -> None:
        self._client.close()


class TcpPort:
    """A listening port that serves one client at a time; others wait until it leaves."""

    def __init__(self, host: str, port: int) -> None:
        self._door = TcpDoor(host, port)
        self._client: TcpClient | None = None
        self.link = self._door.link

    def readers(self) -> list[int]:
        return [self._door.fileno()] if self._client is None else self._client.readers()

    def read(self, ready: list[int]) -> bytes | None:
        if not ready:
            return b""
        if self._client is None:
            self._client = self._door.accept()
            return b"" if self._client is None else None
        data = self._client.read(ready)
        if data is None:
            self.hang_up()
        return data or b""

    def write(self, data: bytes) -> int:
        if self._client is None:
            return len(data)  # nobody there: a line without a listener loses its bytes
        count = self._client.write(data)
        if self._client.gone:
            self.hang_up()
        return count

    def writer(self) -> int | None:
        return None if self._client is None else self._client.writer()

    def baud(self) -> None:
        return None

    def hang_up(self) -> bool:
        if self._client is not None:
            self._client.close()
            self._client = None
        return False

    def plug(self, present: bool) -> None:
        if not present:
            self.hang_up()

    def close(self) -> None:
        self.hang_up()
        self._door.close()
