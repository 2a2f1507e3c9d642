"""What is done otherwise on macOS, with the system's name faked where the module asks for it when it is called."""

from __future__ import annotations

import fcntl
import glob
import os
import sys
from pathlib import Path

import pytest

from handctl.link import serial
from handctl.system import disk, serial_ports


@pytest.fixture
def macos(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")


@pytest.mark.usefixtures("macos")
@pytest.mark.parametrize("known", [True, False])
def test_what_is_on_the_disk_is_on_it_for_good(known: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """fsync there ends at the disk's own buffer; a file system without the better call gets fsync."""
    done: list[object] = []

    def call(descriptor: int, what: int) -> None:
        if not known:
            raise OSError
        done.append(what)

    monkeypatch.setattr(fcntl, "F_FULLFSYNC", 51, raising=False)
    monkeypatch.setattr(fcntl, "fcntl", call)
    monkeypatch.setattr(os, "fsync", lambda _descriptor: done.append("fsync"))
    with open(tmp_path / "log", "wb") as file:
        disk.sync(file.fileno())
    assert done == ([51] if known else ["fsync"])


@pytest.mark.usefixtures("macos")
def test_the_adapters_are_named_and_what_is_always_there_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    there = ["/dev/cu.usbserial-A1", "/dev/cu.Bluetooth-Incoming-Port", "/dev/cu.debug-console", "/dev/cu.usbmodem11"]
    monkeypatch.setattr(glob, "glob", lambda pattern: there if pattern == "/dev/cu.*" else [])
    assert serial_ports.present(list) == ["/dev/cu.usbmodem11", "/dev/cu.usbserial-A1"]
    assert serial._ports_hint("/dev/cu.usbserial-9") == "use one of /dev/cu.usbmodem11, /dev/cu.usbserial-A1"


@pytest.mark.usefixtures("macos")
def test_one_lock_for_both_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their numbers differ; whoever opens one has the other."""
    real = os.stat
    monkeypatch.setattr(
        os, "stat", lambda path, **more: real("/dev/null" if str(path).startswith("/dev/") else path, **more)
    )
    assert (
        serial_ports.place("/dev/tty.usbserial-A1")
        == serial_ports.place("/dev/cu.usbserial-A1")
        == "/dev/cu.usbserial-A1"
    )


@pytest.mark.usefixtures("macos")
def test_a_busy_port_names_who_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_ports, "of_lsof", lambda path: [(4711, "screen")])
    assert [str(one) for one in serial.holders("/dev/cu.usbserial-A1")] == ["screen (pid 4711)"]
    assert serial_ports.held_by_name("/dev/cu.usbserial-A1")
