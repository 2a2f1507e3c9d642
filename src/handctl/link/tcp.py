"""Bytes over TCP. The only user of `socket` below `link`."""

from __future__ import annotations

import contextlib
import socket
import struct

from handctl.errors import LinkError, UsageError
from handctl.link.link_interface import ByteLink, Deadline, RawAccess, unsent
from handctl.number_parsing import number_in
from handctl.system.waits import connect, readable, writable

CONNECT_SECONDS = 3.0
QUICKACK = getattr(socket, "TCP_QUICKACK", None)
"""Linux: acknowledge what arrives at once. The system forgets it again, so it is asked for before each wait."""
TAKEN = "Check whether another program is using the device: many devices accept only one client"


def split_address(link: str, default_port: int | None = None) -> tuple[str, int]:
    """``tcp://host:port`` or ``tcp://[::1]:port`` -> (host, port). Raises UsageError."""
    text = link.removeprefix("tcp://").rstrip("/")
    if text.startswith("["):
        host, _, rest = text[1:].partition("]")
        port = rest[1:] if rest.startswith(":") else rest and "?"
    else:
        host, _, port = text.partition(":")
    if host and not port and default_port is not None:
        return host, default_port
    number = number_in(port) or 0
    if not host or not 0 < number < 65536:
        raise UsageError(
            f"{link}: expected tcp://HOST:PORT with a port 1 to 65535", hint="write for example tcp://192.168.1.20:8000"
        )
    return host, number


def _connected(host: str, port: int) -> socket.socket:
    """A connection to the first address of the host that takes one. Raises OSError, that of the last address."""
    failed = OSError(f"{host} has no address")
    for family, kind, protocol, _, address in socket.getaddrinfo(host, port, 0, socket.SOCK_STREAM):
        try:
            found = socket.socket(family, kind, protocol)
            try:
                connect(found, address, CONNECT_SECONDS)
            except BaseException:
                found.close()
                raise
        except OSError as exc:
            failed = exc
        else:
            return found
    raise failed


HERE = ("localhost", "ip6-localhost", "ip6-loopback", "0.0.0.0", "::", "::1")  # noqa: S104 - nothing is bound
"""What leads to this machine beside 127.0.0.1."""


class TcpLink(ByteLink):
    """One TCP connection with TCP_NODELAY: a request is a packet, never held back.

    A peer that writes an answer in small pieces without TCP_NODELAY waits for our acknowledge before the second one,
    which costs 40 ms an exchange; quick acknowledges, where the system has them, cure that.
    """

    def __init__(self, link: str, default_port: int | None = None) -> None:
        self.name = link
        host, port = split_address(link, default_port)
        try:
            self._socket = _connected(host, port)
        except TimeoutError as exc:
            raise LinkError(
                f"{link}: no connection within {CONNECT_SECONDS:g} s",
                hint=f"check the address and that {host} is reachable: `ping {host}`",
                code="connect-timeout",
            ) from exc
        except ConnectionRefusedError as exc:
            raise LinkError(
                f"{link}: connection refused",
                hint=f"check the port number and that the device is on. {TAKEN}",
                code="refused",
            ) from exc
        except socket.gaierror as exc:
            raise LinkError(
                f"{link}: the host name {host} does not resolve ({exc.strerror or exc})",
                hint=f"check the spelling of {host}, or give its IP address, such as tcp://192.168.1.20:{port}",
                code="cannot-open",
            ) from exc
        except OSError as exc:
            raise LinkError(
                f"{link}: cannot connect: {exc.strerror or exc}",
                hint=f"check the network of this computer and that {host} is reachable: `ping {host}`",
                code="cannot-open",
            ) from exc
        self._peer: tuple[object, ...] = (host, port)
        with contextlib.suppress(OSError):
            self._peer = self._socket.getpeername()  # to look a name up may take seconds
        self._set_up()

    def _set_up(self) -> None:
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._raw_access = RawAccess(self._socket.fileno())

    def write(self, data: bytes, deadline: Deadline) -> None:
        self._raw_access.before()
        view = memoryview(data)
        while view:
            try:
                view = view[self._socket.send(view) :]
            except BlockingIOError as exc:
                self._raw_access.note_unfinished(bytes(view) if len(view) < len(data) else b"")
                if not writable(self._socket, deadline.remaining):
                    stuck = LinkError(
                        f"{self.name}: the other end no longer accepts data",
                        hint="check the device or its serial server, then run the command again",
                        code="write-timeout",
                    )
                    raise unsent(stuck, len(view) == len(data)) from exc
            except OSError as exc:
                raise unsent(self._lost(exc), len(view) == len(data)) from exc
        self._raw_access.note_unfinished(b"")

    def reconnect(self, seconds: float) -> bool:
        """See Link. Data still in flight on the old connection must not arrive after what is sent next."""
        with contextlib.suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._socket.close()
        self._socket = socket.socket(self._socket.family)
        try:
            self._set_up()
            connect(self._socket, self._peer, max(seconds, 0.001))
        except OSError as exc:
            raise LinkError(
                f"{self.name}: cannot connect again: {exc.strerror or exc}", hint=TAKEN, code="cannot-open"
            ) from exc
        return True

    def raw_access(self) -> RawAccess:
        return self._raw_access

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        try:
            if QUICKACK is not None:
                self._socket.setsockopt(socket.IPPROTO_TCP, QUICKACK, 1)
            if not readable(self._socket, deadline.remaining):
                return b""
            data = self._socket.recv(size)
        except BlockingIOError:
            return b""
        except OSError as exc:
            raise self._lost(exc) from exc
        if not data:
            raise self._lost(None)
        return data

    def _lost(self, exc: OSError | None) -> LinkError:
        why = f": {exc.strerror or exc}" if exc is not None else " by the other end"
        return LinkError(
            f"{self.name}: connection closed{why}",
            hint=f"run the command again. {TAKEN}",
            code="lost",
        )

    def close(self) -> None:
        self._socket.close()


def plain_host(name: str) -> str:
    """One spelling of a host: an address written in full, and 127.0.0.1 for all that leads to this machine.

    A name is not looked up: that may take seconds, and which of its addresses answers is not known before.
    """
    name = name.removeprefix("[").removesuffix("]").rstrip(".")
    try:
        number = socket.inet_pton(socket.AF_INET6, name)
        mapped = number.startswith(bytes(10) + b"\xff\xff")
        name = socket.inet_ntoa(number[12:]) if mapped else socket.inet_ntop(socket.AF_INET6, number)
    except (OSError, ValueError):  # ValueError: no text that could be sent
        with contextlib.suppress(OSError, ValueError):
            name = socket.inet_ntoa(socket.inet_aton(name))  # 127.1 and 0 are addresses, too; anything else is a name
    return "127.0.0.1" if name in HERE else name
