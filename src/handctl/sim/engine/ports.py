"""Where clients of a simulator come in: a pseudo terminal, or a TCP port and each client that came through it.

Knows file descriptors and serial speeds; nothing of the line behind it, and no time but the patience of a hang-up. A port has
`fileno`, -1 when there is nothing to wait for; `read`, None when its client has left; `write`, which takes what fits without
waiting; `baud`, the serial speed of its client or None; `hang_up`; `plug`; `close`. One that is `gone` never comes back.
"""

from __future__ import annotations

import contextlib
import os
import socket

from handctl.system import clock, pseudo


class ServeError(Exception):
    """The place to serve at cannot be had; the text says what and why."""


class PtyPort:
    """A pseudo terminal. Its slave side is kept open here, so that clients can come and go.

    With `name` a symbolic link leads to it, as /dev/serial/by-id does: the name stays when the terminal is another one.
    """

    gone = False

    def __init__(self, speed: int | None, name: str | None = None) -> None:
        self._speed = speed
        self._name = name
        self._closed = True
        self._open()
        self.link = name or pseudo.name(self._slave)

    def _open(self) -> None:
        try:
            self._master, self._slave = pseudo.opened(self._speed)
        except OSError as exc:
            raise ServeError(f"cannot open a pty: {exc.strerror or exc}") from exc
        self._closed = False
        if self._name is not None:
            try:
                if os.path.islink(self._name) and not os.path.exists(self._name):
                    os.unlink(self._name)  # of one that was killed
                os.symlink(pseudo.name(self._slave), self._name)
            except OSError as exc:
                name, self._name = self._name, None
                self.close()
                raise ServeError(f"cannot make the link {name}: {exc.strerror}") from exc

    def plug(self, present: bool) -> None:
        if present and self._closed:
            self._open()
        elif not present:
            self.close()

    def fileno(self) -> int:
        return -1 if self._closed else self._master

    def read(self) -> bytes | None:
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

    def baud(self) -> int:
        """The speed that the client set; -1 for one that has no name."""
        return -1 if self._closed else pseudo.speed_of(self._master)

    def hang_up(self) -> None:
        # Closing the master throws away what the client has not read: let it have the first half of the reply. The
        # kernel hands bytes to the slave side a little later, so a count of 0 means nothing at once.
        clock.sleep(0.02)
        patience = clock.now() + 0.2
        while pseudo.unread(self._slave) and clock.now() < patience:
            clock.sleep(0.002)
        self.close()

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
        return TcpClient(client)

    def close(self) -> None:
        self._listener.close()


class TcpClient:
    """One client that came through a door."""

    def __init__(self, client: socket.socket) -> None:
        self._client = client
        self.gone = False

    def fileno(self) -> int:
        return -1 if self.gone else self._client.fileno()

    def read(self) -> bytes | None:
        try:
            return self._client.recv(4096) or None
        except BlockingIOError:
            return b""
        except OSError:
            return None

    def write(self, data: bytes) -> int:
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return len(data)

    def baud(self) -> None:
        return None

    def hang_up(self) -> None:
        self.gone = True

    def plug(self, present: bool) -> None:
        self.gone = self.gone or not present

    def close(self) -> None:
        self._client.close()
