"""How a program reaches another one of this machine: the way of Windows too, which needs nothing of it."""

from __future__ import annotations

import contextlib
import socket
from pathlib import Path

import pytest

from handctl.system import local_socket
from tests.support.cli import PATIENCE


@pytest.fixture
def loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows: a port and a token in place of a socket with a path."""
    monkeypatch.setattr(local_socket, "_listening", local_socket._on_loopback)
    monkeypatch.setattr(local_socket, "connected", local_socket._over_loopback)


@pytest.mark.real
@pytest.mark.usefixtures("loopback")
def test_who_knows_the_token_is_let_in(tmp_path: Path) -> None:
    path = str(tmp_path / "control")
    listener = local_socket.Listener(path)
    assert (tmp_path / "control").stat().st_mode & 0o777 == 0o600
    with (
        contextlib.closing(local_socket.connected(path, PATIENCE)) as caller,
        contextlib.closing(listener.accept()) as peer,
    ):
        caller.sendall(b"help\n")
        peer.settimeout(PATIENCE)
        assert peer.recv(64) == b"help\n"
    with pytest.raises(BlockingIOError):
        listener.accept()
    listener.close()
    listener.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.real
@pytest.mark.usefixtures("loopback")
def test_who_does_not_know_it_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any program of the machine can open a port of the loopback."""
    monkeypatch.setattr(local_socket, "TOKEN_SECONDS", 0.02)
    path = tmp_path / "control"
    listener = local_socket.Listener(str(path))
    port = int(path.read_bytes().split()[1])
    for said in (b"", b"power-cycle\n", bytes(32)):
        with socket.create_connection(("127.0.0.1", port)) as stranger:
            stranger.sendall(said)
            with pytest.raises(ConnectionRefusedError):
                listener.accept()
    with pytest.raises(FileExistsError):
        local_socket.Listener(str(path))
    listener.close()


@pytest.mark.usefixtures("loopback")
@pytest.mark.parametrize("content", [b"", b"# my notes", b"handctl-local 70000x 1", b"handctl-local"])
def test_a_file_that_leads_nowhere_is_told(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "control").write_bytes(content)
    with pytest.raises(OSError, match="no simulator"):
        local_socket.connected(str(tmp_path / "control"), 1.0)
