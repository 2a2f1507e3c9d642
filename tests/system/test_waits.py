"""Waiting for sockets as Windows must, where Ctrl-C does not end a wait in the system: this part runs here too, with real sockets."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import select
import socket
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

from handctl.system import waits
from handctl.system.clock import SLICE
from tests.support.cli import PATIENCE

pytestmark = pytest.mark.real


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module as Windows loads it."""
    spec = importlib.util.find_spec(waits.__name__)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    with monkeypatch.context() as only:
        only.setattr(sys, "platform", "win32")
        spec.loader.exec_module(found)
    monkeypatch.setattr(ctypes, "WinError", lambda code: OSError(code, os.strerror(code)), raising=False)
    return found


@pytest.fixture
def client() -> Iterator[socket.socket]:
    with socket.socket() as found:
        yield found


@pytest.fixture
def full() -> Iterator[tuple[str, int]]:
    """The address of a server that is too busy to answer."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        address = server.getsockname()
        with socket.create_connection(address):
            yield address


@pytest.fixture
def waited(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long each look into the system was to take."""
    found: list[float] = []
    real = select.select

    def noted(reads: Any, writes: Any, fails: Any, seconds: float) -> Any:
        found.append(seconds)
        return real(reads, writes, fails, seconds)

    monkeypatch.setattr(select, "select", noted)
    return found


def test_a_connection(windows: ModuleType, client: socket.socket) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        windows.connect(client, server.getsockname(), PATIENCE)
        assert not client.getblocking()
        peer, _ = server.accept()
        with peer:
            peer.sendall(b"hand")
            assert windows.readable(client, PATIENCE) and client.recv(10) == b"hand"
            assert windows.writable(client, PATIENCE) and not windows.readable(client, 0)


def test_a_refusal_is_one(windows: ModuleType, client: socket.socket) -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))  # nobody else's meanwhile, and no one listens
        with pytest.raises(ConnectionRefusedError):
            windows.connect(client, server.getsockname(), PATIENCE)


def test_no_wait_is_longer_than_a_slice(
    windows: ModuleType, client: socket.socket, full: tuple[str, int], waited: list[float]
) -> None:
    with pytest.raises(TimeoutError):
        windows.connect(client, full, 25 * SLICE)  # a busy machine overshoots some
    assert len(waited) > 3 and max(waited) <= SLICE


def test_between_two_slices_a_wish_to_end_is_heard(
    windows: ModuleType, client: socket.socket, full: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def pressed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(select, "select", pressed)
    with pytest.raises(KeyboardInterrupt):
        windows.connect(client, full, 600.0)
