"""Adapters as Windows has them: their drivers, the timer that holds answers back, and where that is changed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.model.result import Journal
from handctl.system import advice
from handctl.system.serial_ports import Driver, usb_of
from handctl.tools import ports
from handctl.tools.doctor import machine_checks
from handctl.tools.port_inventory import Machine
from tests.support.each_row import each_row


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """A laptop with an FTDI adapter on COM3, and one of another make that has no driver."""
    for name in ("set_latency", "find_driver", "set_clock", "set_encoding", "terminal_is_named"):
        real = getattr(advice, name)
        monkeypatch.setattr(advice, name, lambda *words, real=real: real(*words, where="win32"))
    entry: Any = SimpleNamespace(
        device="COM3", vid=0x0403, pid=0x6001, serial_number="A1", product=None, description="USB Serial Port (COM3)"
    )
    return Machine(
        root=Path("/nowhere"), linux=False, listing=lambda: [entry], driver=lambda _path: Driver("FTSER2K", 16),
        without_driver=lambda: [("1a86", "7523"), ("046d", "c52b")],
    )  # fmt: skip


def test_the_timer_is_told_with_where_to_change_it(windows: Machine) -> None:
    journal = Journal()
    (row,) = ports.table(windows, journal).rows
    assert (row["link"], row["usb"], row["driver"], row["latency"]) == ("COM3", "0403:6001:A1", "FTSER2K", 16)
    assert "16 ms" in row["problem"] and "Device Manager" in row["remedy"] and "sudo" not in row["remedy"]
    (message,) = journal.messages
    assert message.code == "no-driver" and "driver" in message.hint and "sudo" not in message.hint, (
        "a mouse is no adapter"
    )


def test_the_doctor_knows_no_linux_there(windows: Machine) -> None:
    checks = machine_checks(windows)
    assert not {"modemmanager", "brltty"} & {check.name for check in checks}
    assert not [check for check in checks if "sudo" in check.remedy or "export" in check.remedy]
    assert [check.status for check in checks if check.name == "adapter"] == ["warning"]


def test_other_systems_have_their_own_advice() -> None:
    assert advice.set_latency("/dev/ttyUSB0", 1, where="linux") == "" == advice.find_driver("a chip", where="linux")
    assert "timedatectl" in advice.set_clock("linux") and "systemsetup" in advice.set_clock("darwin")
    assert advice.terminal_is_named("darwin")


@each_row(
    ("name", "usb"),
    [
        (r"USB\VID_1A86&PID_7523\5&1", ("1a86", "7523")),
        (r"USB\ROOT_HUB30\4", None),
        ("", None),
        (r"USB\VID_1A86&MI_00", None),
    ],
)
def test_the_number_of_a_device_is_in_its_name(name: str, usb: tuple[str, str] | None) -> None:
    assert usb_of(name) == usb
