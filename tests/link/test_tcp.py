"""Bytes over TCP: what connects, what the errors say, IPv6, and a peer that goes away."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.link import ByteLink, open_link, tcp
from tests.support.cli import PATIENCE
from tests.support.each_row import each_row
from tests.support.scripted import unhex

READ_ID, ID_IS_1 = unhex("EB 90 01 04 11 E8 03 01 02"), unhex("90 EB 01 04 11 E8 03 01 02")


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


@pytest.mark.real
def test_tcp_carries_bytes(listener: socket.socket) -> None:
    link = open_link(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    peer, _ = listener.accept()
    with peer:
        assert (link.baud, link.can_set_baud, link.fake) == (None, False, False)
        link.write(READ_ID, link.deadline(PATIENCE))
        assert peer.recv(100) == READ_ID
        peer.sendall(b"abcdef")
        assert link.read(link.deadline(PATIENCE), 2) == b"ab"
        assert all_of(link, 4) == b"cdef"
        assert link.read(link.deadline(0.02)) == b""
    with pytest.raises(LinkError) as caught:
        link.read(link.deadline(PATIENCE))
    assert (caught.value.exit_code, caught.value.code) == (3, "lost")
    link.close()


@pytest.mark.real
def test_tcp_reset_is_a_lost_link(listener: socket.socket) -> None:
    import struct

    link = open_link(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    peer, _ = listener.accept()
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    with pytest.raises(LinkError) as caught:
        for _ in range(100):
            link.write(READ_ID, link.deadline(PATIENCE))
            link.read(link.deadline(0.1))
    assert caught.value.code == "lost"
    link.close()


@pytest.mark.real
def test_tcp_peer_that_takes_nothing(listener: socket.socket) -> None:
    link = open_link(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    peer, _ = listener.accept()
    with peer, pytest.raises(LinkError) as caught:
        link.write(bytes(50_000_000), link.deadline(0.1))
    assert caught.value.code == "write-timeout"
    link.close()


@pytest.mark.real
def test_tcp_refused() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))  # nobody else's meanwhile, and no one listens
        error = opening(f"tcp://127.0.0.1:{server.getsockname()[1]}")
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


@pytest.mark.real
def test_reading_waits_for_bytes_that_come_later(listener: socket.socket) -> None:
    link = open_link(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    peer, _ = listener.accept()
    timer = threading.Timer(0.05, lambda: peer.sendall(ID_IS_1))
    timer.start()
    assert link.read(link.deadline(PATIENCE)) == ID_IS_1
    timer.join()
    peer.close()
    link.close()


@pytest.mark.real
def test_options_of_the_socket(listener: socket.socket) -> None:
    link = tcp.TcpLink(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    assert link._socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    link.close()


@pytest.mark.real
@pytest.mark.parametrize("known", [True, False])
def test_quick_acknowledges_are_asked_for_before_each_wait(listener: socket.socket, known: bool, monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    link = tcp.TcpLink(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    asked: list[tuple[int, int, int]] = []

    class Noted:
        def __getattr__(self, name: str) -> object:
            return getattr(inner, name)

        def setsockopt(self, *option: int) -> None:
            asked.append(option)  # type: ignore[arg-type]

    inner, link._socket = link._socket, Noted()  # type: ignore[assignment]
    monkeypatch.setattr(tcp, "QUICKACK", 12 if known else None)
    for _ in range(2):
        assert link.read(link.deadline(0)) == b""
    assert asked == [(socket.IPPROTO_TCP, 12, 1)] * (2 if known else 0)
    link.close()


@pytest.mark.real
def test_who_may_be_in_the_way_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = open_link(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        server.accept()[0].close()
        with pytest.raises(LinkError) as caught:
            link.read(link.deadline(PATIENCE))
    link.close()
    refused = opening(link.name)
    assert all(
        "Another program may hold the device: many serve one client only" in error.hint
        for error in (caught.value, refused)
    )


def test_an_address_that_does_not_answer_is_given_up_after_3_s(monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(_socket: socket.socket, _address: tuple[str, int], seconds: float) -> None:
        assert seconds == 3
        raise TimeoutError

    monkeypatch.setattr(tcp, "connect", connect)
    error = opening("tcp://192.0.2.7:8000")
    assert (error.exit_code, error.code, "3 s" in error.text) == (3, "connect-timeout", True)


@pytest.mark.real
def test_a_host_with_several_addresses(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first that takes a connection is taken; where none does, the last says why."""
    number = listener.getsockname()[1]

    def lookup(*_: object) -> list[tuple[object, ...]]:
        return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", (host, number)) for host in hosts]

    monkeypatch.setattr(socket, "getaddrinfo", lookup)
    hosts = ["127.0.0.9", "127.0.0.1"]
    link = open_link(f"tcp://hand:{number}")
    assert link._socket.getpeername() == ("127.0.0.1", number)  # type: ignore[attr-defined]
    link.close()
    hosts = ["127.0.0.8", "127.0.0.9"]
    assert opening(f"tcp://hand:{number}").code == "refused"


def test_a_wish_to_end_while_it_connects_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[socket.socket] = []

    def connect(found: socket.socket, _address: object, _seconds: float) -> None:
        made.append(found)
        raise KeyboardInterrupt

    monkeypatch.setattr(tcp, "connect", connect)
    with pytest.raises(KeyboardInterrupt):
        open_link("tcp://127.0.0.1:9")
    assert [found.fileno() for found in made] == [-1]  # closed, and no second address was tried
