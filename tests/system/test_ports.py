"""Ports as Windows and macOS have them, with their names faked."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.system import serial_ports
from tests.support.each_row import each_row

WINDOWS = "could not open port 'COM7': {}"


@each_row(
    ("words", "number"),
    [
        (WINDOWS.format("FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)"), errno.ENOENT),
        (WINDOWS.format("PermissionError(13, 'Access is denied.', None, 5)"), errno.EBUSY),
        (WINDOWS.format("PermissionError(13, 'Zugriff verweigert (5)', None, 5)"), errno.EBUSY),
        (WINDOWS.format("PermissionError(13, 'The process cannot access the file', None, 32)"), errno.EBUSY),
        (WINDOWS.format("OSError(22, 'The semaphore timeout period has expired.', None, 121)"), errno.ETIMEDOUT),
        (WINDOWS.format("OSError(22, 'A device attached to the system is not functioning.', None, 31)"), errno.EIO),
        (
            "Cannot configure port, something went wrong. Original message: OSError(22, 'The parameter is incorrect.', None, 87)",
            errno.EINVAL,
        ),
        ("FileNotFoundError(2, 'no such file')", errno.ENOENT),
        ("the driver says nothing", None),
    ],
)
def test_what_pyserial_says_on_windows(words: str, number: int | None) -> None:
    assert serial_ports.of_windows(words) == number


def test_a_port_of_windows_is_listed_with_what_it_is() -> None:
    def port(**more: Any) -> Any:
        return SimpleNamespace(
            **{"device": "COM3", "vid": None, "pid": None, "serial_number": None, "manufacturer": None, "product": None,
               "description": "n/a", **more},
        )  # fmt: skip

    assert serial_ports.described(port(vid=0x0403, pid=0x6001, serial_number="A1", manufacturer="FTDI")) == (
        "COM3  FTDI  usb:0403:6001:A1"
    )
    assert serial_ports.described(port(vid=0x10C4, pid=0xEA60)) == "COM3  usb:10C4:EA60"
    assert serial_ports.described(port(description="Communications Port (COM1)")) == "COM3  Communications Port (COM1)"


def test_the_two_names_of_a_port_of_macos_are_one_place() -> None:
    assert (
        serial_ports.cu_name("/dev/tty.usbserial-A1")
        == serial_ports.cu_name("/dev/cu.usbserial-A1")
        == "/dev/cu.usbserial-A1"
    )
    assert serial_ports.cu_name("/dev/ttyUSB0") == "/dev/ttyUSB0"


@pytest.mark.real
def test_who_has_a_port_of_macos_is_asked_of_lsof(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    port = tmp_path / "port"
    port.touch()
    lsof = tmp_path / "lsof"
    lsof.write_text(
        f"#!/bin/sh\necho \"$@\" >{tmp_path}/asked\nprintf 'p4711\\ncscreen\\nf5\\np{os.getpid()}\\ncpython\\n'\n"
    )
    lsof.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert serial_ports.of_lsof(str(port)) == [(4711, "screen")]
    assert (tmp_path / "asked").read_text().split()[:3] == ["-F", "pc", "--"]
    lsof.unlink()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert serial_ports.of_lsof(str(port)) == [], "a machine without it"
