"""Who else has what a link has open: refused by number and name before anything that writes, on every kind of port."""

from __future__ import annotations

import os
import pty
import socket
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from handctl.errors import HandctlError
from handctl.link import open_link
from handctl.link.port_users import OtherUsers, holders, rivals
from tests.support.cli import Simulator, run


@pytest.fixture
def terminal() -> Iterator[str]:
    """A pty whose other end is ours."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    yield os.ttyname(theirs)
    os.close(theirs)
    os.close(ours)


def opening(link: str) -> HandctlError:
    with pytest.raises(HandctlError) as caught:
        open_link(link).close()
    return caught.value


@pytest.fixture
def other() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Another program that has something open, as `what` says in Python, until the test ends."""
    begun: list[subprocess.Popen[str]] = []

    def begin(what: str, *words: str) -> subprocess.Popen[str]:
        code = f"import os,socket,sys; kept = {what}; print('open', flush=True); sys.stdin.read()"
        process = subprocess.Popen(
            [sys.executable, "-c", code, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        begun.append(process)
        assert process.stdout is not None and process.stdout.readline() == "open\n"
        return process

    yield begin
    for process in begun:
        process.communicate()


HAVE_PORT = "os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)"


@pytest.mark.real
def test_who_has_a_pseudo_terminal_open_is_named_and_its_device_is_not(
    terminal: str, other: Callable[..., subprocess.Popen[str]]
) -> None:
    """No lock of any kind; the other program only has it open. Who holds the master is the device: here this process."""
    name = terminal
    link = open_link(name)
    assert rivals(link) == OtherUsers([])
    process = other(HAVE_PORT, name)
    assert [one.pid for one in rivals(link).names] == [process.pid]
    link.close()
    error = opening(name)
    assert (error.exit_code, error.code) == (3, "busy") and f"pid {process.pid}" in error.text
    error = opening(f"can:slcan:{name}")
    assert (error.exit_code, error.code) == (3, "busy") and f"pid {process.pid}" in error.text
    open_link(name, exclusive=False).close()  # a stop goes out all the same


@pytest.mark.real
def test_the_device_behind_a_pseudo_terminal_is_no_rival() -> None:
    """A simulator in a process of its own has both ends open."""
    with Simulator("--pty") as simulator:
        assert holders(simulator.link) == []
        open_link(simulator.link).close()


@pytest.mark.real
def test_who_is_connected_to_the_same_server_is_named(other: Callable[..., subprocess.Popen[str]]) -> None:
    """Reading goes on; what writes is refused, and a stop is not."""
    with Simulator("--tcp", "127.0.0.1:0", kind="aidin") as simulator:
        link = open_link(simulator.link)
        assert rivals(link) == OtherUsers([])
        host, port = simulator.link.removeprefix("tcp://").split(":")
        process = other("socket.create_connection((sys.argv[1], int(sys.argv[2])))", host, port)
        assert [one.pid for one in rivals(link).names] == [process.pid]
        link.close()
        writes = run("aidin", "max-torque", "800", "-y", "--json", "-p", simulator.link)
        assert (writes.code, writes.error["code"]) == (3, "busy") and str(process.pid) in writes.error["text"]
        assert run("aidin", "stop", "-p", simulator.link).code != 3


def system(root: Path, **processes: dict[str, str]) -> Path:
    """A /proc of its own: for each process (p and its number) its descriptors; "ptmx 5" is the master of /dev/pts/5."""
    for name, descriptors in processes.items():
        for number, target in descriptors.items():
            for folder in ("fd", "fdinfo"):
                (root / "proc" / name[1:] / folder).mkdir(parents=True, exist_ok=True)
            master, _, index = target.partition(" ")
            (root / "proc" / name[1:] / "fd" / number[1:]).symlink_to("/dev/ptmx" if index else master)
            (root / "proc" / name[1:] / "fdinfo" / number[1:]).write_text(f"pos:\t0\ntty-index:\t{index}\n")
    return root


def test_who_holds_the_master_is_the_device_of_that_terminal_only(tmp_path: Path) -> None:
    root = system(
        tmp_path,
        p4000001={"d3": "/dev/pts/5", "d4": "ptmx 5"},
        p4000002={"d3": "/dev/pts/5", "d4": "ptmx 6"},
        p4000003={"d3": "/dev/pts/5"},
        p4000004={"d3": "/dev/pts/6"},
    )
    assert [one.pid for one in holders("/dev/pts/5", root)] == [4000002, 4000003]


def test_a_second_connection_to_one_server_is_found_by_its_socket(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One to another server, and what listens or waits to be forgotten, is none."""
    ours, peer = socket.socketpair()
    with ours, peer:
        rows = [(os.fstat(ours.fileno()).st_ino, "0100007F:1F40", "01"), (901, "0100007F:1F40", "01")]
        rows += [(902, "0100007F:1F41", "01"), (903, "0100007F:1F40", "06")]
        lines = [
            f"{n}: 0100007F:9000 {to} {state} 0:0 00:0 0 0 0 {inode} 1" for n, (inode, to, state) in enumerate(rows)
        ]
        system(
            tmp_path, p4000001={"d3": "socket:[901]"}, p4000002={"d3": "socket:[902]"}, p4000003={"d3": "socket:[903]"}
        )
        (tmp_path / "proc" / "net").mkdir()
        (tmp_path / "proc" / "net" / "tcp").write_text("\n".join(["head", *lines]) + "\n")
        monkeypatch.setattr("handctl.link.port_users.ROOT", tmp_path)
        link = SimpleNamespace(raw_access=lambda: SimpleNamespace(descriptor=ours.fileno()), guard=None)
        assert [one.pid for one in rivals(link).names] == [4000001]  # type: ignore[arg-type]
