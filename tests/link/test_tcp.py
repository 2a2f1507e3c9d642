"""Bytes over TCP: what connects, what the errors say, IPv6, and a peer that goes away."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.link import ByteLink, open_link, tcp
from tests.support.cli import PATIENCE
from tests.support.each_row import each_row
from tests.support.scripted import unhex

READ_ID, ID_IS_1 = unhex("EB 90 01 04 11 E8 03 01 02"), unhex("90 EB 01 04 11 E8 03 01 02")


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[tcp.TcpLink, socket.socket]]:
    """A link, and the other end of its connection."""
    ours, theirs = (Connection(fileno=end.detach()) for end in socket.socketpair())
    ours.setblocking(False)
    monkeypatch.setattr(tcp, "_connected", lambda _host, _port: ours)
    link = tcp.TcpLink("tcp://192.0.2.7:8000")
    yield link, theirs
    link.close()
    theirs.close()


class Connection(socket.socket):
    """It has no options of TCP, and remembers which were set."""

    def setsockopt(self, *option: Any) -> None:
        self.__dict__.setdefault("options", []).append(option)


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def opening(link: str) -> HandctlError:
    """The error of a link that cannot be opened."""
    with pytest.raises(HandctlError) as caught:
        open_link(link)
    return caught.value


def all_of(link: ByteLink, count: int) -> bytes:
    deadline = link.deadline(PATIENCE)
    data = b""
    while len(data) < count and (chunk := link.read(deadline)):
        data += chunk
    return data


def test_bytes_pass_until_the_other_end_closes(pair: tuple[tcp.TcpLink, socket.socket]) -> None:
    link, peer = pair
    assert (link.baud, link.can_set_baud, link.fake) == (None, False, False)
    link.write(READ_ID, link.deadline(PATIENCE))
    assert peer.recv(100) == READ_ID
    peer.sendall(b"abcdef")
    assert link.read(link.deadline(PATIENCE), 2) == b"ab"
    assert all_of(link, 4) == b"cdef"
    assert link.read(link.deadline(0.0)) == b""
    peer.close()
    with pytest.raises(LinkError) as caught:
        link.read(link.deadline(PATIENCE))
    assert (caught.value.exit_code, caught.value.code) == (3, "lost")


def test_a_peer_that_takes_nothing_is_waited_for_until_the_deadline(
    pair: tuple[tcp.TcpLink, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is left of a frame is owed; that it takes more later is enough."""
    link, peer = pair
    waits: list[float] = []
    took: list[bytes] = []

    def writable(_socket: object, seconds: float) -> bool:
        waits.append(seconds)
        took.append(peer.recv(1 << 20) if len(waits) < 3 else b"")
        return bool(took[-1])

    monkeypatch.setattr(tcp, "writable", writable)
    owed: list[bytes] = []
    link.raw_access().note_unfinished = owed.append
    data = bytes(range(250)) * 100_000
    with pytest.raises(LinkError) as caught:
        link.write(data, link.deadline(PATIENCE))
    assert caught.value.code == "write-timeout" and len(waits) == 3 and max(waits) <= PATIENCE
    assert data.endswith(owed[-1]) and len(owed[0]) > len(owed[1]) > len(owed[2]) > 0
    link.write(b"", link.deadline(PATIENCE))
    assert owed[-1] == b""


@pytest.mark.parametrize("known", [True, False])
def test_options_of_the_socket(
    pair: tuple[tcp.TcpLink, socket.socket], known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No delay from the start; where the system has quick acknowledges they are asked for before each wait."""
    link, _ = pair
    options = link._socket.__dict__["options"]
    assert (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1) in options and (
        socket.SOL_SOCKET,
        socket.SO_KEEPALIVE,
        1,
    ) in options
    options.clear()
    monkeypatch.setattr(tcp, "QUICKACK", 12 if known else None)
    for _ in range(2):
        assert link.read(link.deadline(0)) == b""
    assert options == [(socket.IPPROTO_TCP, 12, 1)] * (2 if known else 0)


@pytest.mark.real
def test_connections_of_the_system(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes, a read that waits for what comes later, a reset, a port that refuses, and the first address that takes one."""
    number = listener.getsockname()[1]
    link = open_link(f"tcp://127.0.0.1:{number}")
    peer, _ = listener.accept()
    assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)  # type: ignore[attr-defined]
    assert link._socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)  # type: ignore[attr-defined]
    link.write(READ_ID, link.deadline(PATIENCE))
    assert peer.recv(100) == READ_ID

    waited, readable = threading.Event(), tcp.readable

    def waits(found: socket.socket, seconds: float) -> bool:
        waited.set()
        return readable(found, seconds)

    def answer() -> None:
        if waited.wait(PATIENCE):
            peer.sendall(ID_IS_1)

    monkeypatch.setattr(tcp, "readable", waits)
    thread = threading.Thread(target=answer)
    thread.start()
    assert link.read(link.deadline(PATIENCE)) == ID_IS_1
    thread.join(PATIENCE)
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    with pytest.raises(LinkError) as caught:
        link.read(link.deadline(PATIENCE))
    assert caught.value.code == "lost"
    link.close()

    def lookup(*_: object) -> list[tuple[object, ...]]:
        return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", (host, number)) for host in hosts]

    with monkeypatch.context() as patched:
        patched.setattr(socket, "getaddrinfo", lookup)
        hosts = ["127.0.0.9", "127.0.0.1"]
        link = open_link(f"tcp://hand:{number}")
        assert link._socket.getpeername() == ("127.0.0.1", number)  # type: ignore[attr-defined]
        link.close()
        hosts = ["127.0.0.8", "127.0.0.9"]
        error = opening(f"tcp://hand:{number}")
    assert (error.exit_code, error.code) == (3, "refused")


@pytest.mark.real
def test_tcp_over_ipv6() -> None:
    try:
        server = socket.create_server(("::1", 0), family=socket.AF_INET6)
    except OSError:
        error = opening("tcp://[::1]:8000")
        assert error.exit_code == 3
        return
    with server:
        link = open_link(f"tcp://[::1]:{server.getsockname()[1]}")
        peer, _ = server.accept()
        with peer:
            link.write(READ_ID, link.deadline(PATIENCE))
            assert peer.recv(100) == READ_ID
        link.close()


@each_row(
    "link",
    ["tcp://", "tcp://host", "tcp://host:", "tcp://:80", "tcp://host:0", "tcp://host:65536", "tcp://host:x",
     "tcp://host:1:2", "tcp://[::1]", "tcp://[::1", "tcp://::1:80", "tcp://host:-1", "tcp://[::1]80"],
)  # fmt: skip
def test_tcp_addresses_that_are_none(link: str) -> None:
    error = opening(link)
    assert isinstance(error, UsageError)
    assert link in error.text


def test_tcp_addresses() -> None:
    from handctl.link.tcp import split_address

    assert split_address("tcp://192.168.1.20:8000") == ("192.168.1.20", 8000)
    assert split_address("tcp://[fe80::1]:9") == ("fe80::1", 9)
    assert split_address("tcp://name:65535/") == ("name", 65535)
    assert split_address("tcp://name", 8000) == ("name", 8000)
    assert split_address("tcp://[::1]", 8000) == ("::1", 8000)


def test_an_address_that_does_not_answer_is_given_up_after_3_s(monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(_socket: socket.socket, _address: tuple[str, int], seconds: float) -> None:
        assert seconds == 3
        raise TimeoutError

    monkeypatch.setattr(tcp, "connect", connect)
    error = opening("tcp://192.0.2.7:8000")
    assert (error.exit_code, error.code, "3 s" in error.text) == (3, "connect-timeout", True)


def test_a_wish_to_end_while_it_connects_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[socket.socket] = []

    def connect(found: socket.socket, _address: object, _seconds: float) -> None:
        made.append(found)
        raise KeyboardInterrupt

    monkeypatch.setattr(tcp, "connect", connect)
    with pytest.raises(KeyboardInterrupt):
        open_link("tcp://127.0.0.1:9")
    assert [found.fileno() for found in made] == [-1]  # closed, and no second address was tried
