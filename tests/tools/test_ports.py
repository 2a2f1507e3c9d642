"""`handctl ports` on small systems made of files: what is there, who holds it, what to do; and on this machine."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from handctl.model.result import Journal, Row
from handctl.tools import port_inventory as machine_module
from handctl.tools import ports
from handctl.tools.port_inventory import Machine
from tests.support.cli import Result, run
from tests.support.machine import System

FTDI = ("0403", "6001", "A50285BI", "FT232R USB UART")
CH340 = ("1a86", "7523", "", "USB Serial")


@pytest.fixture
def system(tmp_path: Path) -> System:
    return System(tmp_path)


def shown(machine: Machine, *args: str) -> Result:
    """`handctl ports` on that machine."""
    with mock.patch.object(ports, "Machine", lambda: machine):
        return run("ports", *args)


def rows(system: System) -> list[Row]:
    return ports.table(system.machine(), Journal()).rows


def test_an_ftdi_adapter_with_all_that_is_known_of_it(system: System) -> None:
    system.tty("ttyUSB0", usb=FTDI, driver="ftdi_sio", by_id="usb-FTDI_A50285BI-if00-port0", latency=16)
    (row,) = rows(system)
    assert row | {"remedy": None, "problem": None} == {
        "kind": "serial", "link": "/dev/ttyUSB0", "by_id": "/dev/serial/by-id/usb-FTDI_A50285BI-if00-port0",
        "usb": "0403:6001:A50285BI", "chip": "FTDI FT232R", "driver": "ftdi_sio", "product": "FT232R USB UART",
        "state": "free", "holder": None, "permitted": True, "latency": 16, "bitrate": None,
        "may_be": "exo, wrist or barrett behind an adapter", "problem": None, "remedy": None,
    }  # fmt: skip
    assert row["problem"] == "the adapter holds the end of every reply back for up to 16 ms (latency timer)"
    assert "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer" in row["remedy"]
    assert 'SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"' in row["remedy"]


def test_a_timer_of_1_ms_is_no_problem(system: System) -> None:
    system.tty("ttyUSB0", usb=FTDI, driver="ftdi_sio", latency=1)
    assert [(row["latency"], row["problem"], row["remedy"]) for row in rows(system)] == [(1, None, None)]


def test_a_port_of_another_group_names_group_and_rule(system: System) -> None:
    system.tty("ttyUSB0", usb=CH340, driver="ch341-uart")
    system.denied.add("/dev/ttyUSB0")
    (row,) = rows(system)
    assert (row["state"], row["permitted"]) == ("not permitted", False)
    assert "sudo usermod -aG dialout $USER, then log in again" in row["remedy"]
    rule = 'SUBSYSTEM=="tty", ATTRS{idVendor}=="1a86", ATTRS{idProduct}=="7523", MODE="0660", TAG+="uaccess"'
    assert rule in row["remedy"]
    assert "/etc/udev/rules.d/70-handctl.rules" in row["remedy"]


def test_who_is_in_the_group_already_logs_in_again(system: System) -> None:
    system.tty("ttyUSB0", usb=CH340)
    system.denied.add("/dev/ttyUSB0")
    system.user = "lee"
    (row,) = rows(system)
    assert row["remedy"] == "you are in group dialout already, but not in this session: log out and in again"


def test_a_port_of_root_without_usb_is_opened_up(system: System) -> None:
    system.tty("ttyAMA0")
    system.denied.add("/dev/ttyAMA0")
    system.write("/etc/group", f"root:x:{(system.root / 'dev/ttyAMA0').stat().st_gid}:\n")
    (row,) = rows(system)
    assert row["remedy"].startswith("the port belongs to root: sudo chmod a+rw /dev/ttyAMA0")


def test_a_held_port_names_its_holder(system: System) -> None:
    system.tty("ttyUSB0", usb=CH340)
    system.tty("ttyUSB1", usb=FTDI, bus="1-2")
    system.process(4711, "screen", opened="/dev/ttyUSB0")
    system.process(4712, "bash", opened="/dev/pts/3")
    assert [(row["link"], row["state"], row["holder"]) for row in rows(system)] == [
        ("/dev/ttyUSB0", "in use", "screen (pid 4711)"),
        ("/dev/ttyUSB1", "free", None),
    ]


def test_what_has_no_hardware_is_no_port(system: System) -> None:
    system.tty("ttyS0")
    system.tty("ttyS1")
    system.write("/sys/class/tty/ttyS0/type", "0\n")
    system.write("/sys/class/tty/ttyS1/type", "4\n")
    (system.root / "sys/class/tty/tty1").mkdir()
    (system.root / "sys/class/tty/ttyUSB9").mkdir()
    assert [(row["link"], row["chip"]) for row in rows(system)] == [("/dev/ttyS1", "UART of the board")]


def test_ports_are_sorted_as_people_count(system: System) -> None:
    for number in (10, 2, 1):
        system.tty(f"ttyACM{number}", usb=("2341", "0043"), driver="cdc_acm", bus=f"1-{number}")
    assert [row["link"] for row in rows(system)] == ["/dev/ttyACM1", "/dev/ttyACM2", "/dev/ttyACM10"]
    assert rows(system)[0]["may_be"] == "ekso, or an slcan adapter with a wrist (can:slcan:PORT)"


@pytest.mark.parametrize(
    ("vid", "pid", "name", "may_be"),
    [
        ("0403", "6015", "FTDI FT-X", "exo, wrist or barrett"),
        ("10c4", "ea60", "CP210x", "exo, wrist or barrett"),
        ("067b", "2303", "Prolific PL2303", "exo, wrist or barrett"),
        ("0403", "ffff", "FTDI", "exo, wrist or barrett"),
        ("16d0", "117e", "CANable (slcan)", "wrist on CAN: can:slcan:PORT"),
        ("dead", "beef", "USB serial", "exo, wrist or barrett"),
    ],
)
def test_chips(system: System, vid: str, pid: str, name: str, may_be: str) -> None:
    system.tty("ttyUSB0", usb=(vid, pid), driver="x")
    (row,) = rows(system)
    assert row["chip"] == name
    assert row["may_be"].startswith(may_be)


def test_can_interfaces(system: System) -> None:
    system.can("can0", "up", driver="gs_usb")
    system.can("can1", "down")
    system.can("can2", "up")
    system.can("vcan0", "down")
    system.write("/sys/class/net/eth0/type", "1\n")
    timing = [
        {"ifname": name, "linkinfo": {"info_data": {"bittiming": {"bitrate": rate}}}}
        for name, rate in (("can0", 1000000), ("can2", 250000))
    ]
    system.ip = json.dumps([{"ifname": "eth0"}, *timing])
    found = {row["link"]: row for row in rows(system)}
    assert [(link, row["state"], row["bitrate"], row["driver"]) for link, row in found.items()] == [
        ("can:socketcan:can0", "up", 1000000, "gs_usb"),
        ("can:socketcan:can1", "down", None, None),
        ("can:socketcan:can2", "up", 250000, None),
        ("can:socketcan:vcan0", "down", None, None),
    ]
    assert found["can:socketcan:can0"]["problem"] is None
    assert found["can:socketcan:can1"]["remedy"] == "run `sudo ip link set can1 up type can bitrate 1000000`"
    assert found["can:socketcan:can2"]["remedy"].startswith("run `sudo ip link set can2 down; sudo ip link set can2 up")
    assert found["can:socketcan:vcan0"]["problem"] is None


@pytest.mark.parametrize(
    "text", ["", "not json", "{}", '[{"ifname": "can0"}]', '[{"linkinfo": {"info_data": {"bittiming": 1}}}]']
)
def test_an_ip_tool_that_tells_nothing(system: System, text: str) -> None:
    system.can("can0", "up")
    system.ip = text
    assert [(row["state"], row["bitrate"]) for row in rows(system)] == [("up", None)]


def test_the_ip_tool_is_not_asked_where_there_is_no_can(system: System) -> None:
    system.tty("ttyUSB0", usb=FTDI)
    asked: list[int] = []
    ports.table(system.machine(run_ip=lambda: asked.append(1) or ""), Journal())  # type: ignore[func-returns-value]
    assert asked == []


def test_modem_manager_is_told_to_ignore_these_adapters(system: System) -> None:
    system.tty("ttyUSB0", usb=FTDI)
    system.process(812, "ModemManager")
    answer = shown(system.machine(), "--json")
    assert answer.code == 0
    (message,) = answer.json["messages"]
    assert (message["level"], message["code"]) == ("warning", "modemmanager")
    assert message["text"] == "ModemManager (pid 812) writes AT commands to serial ports that are plugged in."
    assert 'ATTRS{idVendor}=="0403", ATTRS{idProduct}=="6001", ENV{ID_MM_DEVICE_IGNORE}="1"' in message["hint"]


def test_brltty_and_the_adapter_it_took_away(system: System) -> None:
    system.tty("ttyUSB0", usb=CH340)
    system.usb("1-5", "10c4", "ea60")
    system.process(813, "brltty")
    messages = {message["code"]: message for message in shown(system.machine(), "--json").json["messages"]}
    assert messages["brltty"]["text"] == "brltty (pid 813) takes adapters for braille displays (1a86:7523)."
    assert messages["no-driver"]["text"] == "CP210x (10c4:ea60) is plugged in but has no serial port."
    assert messages["no-driver"]["hint"].startswith("Run `sudo apt remove brltty` if brltty is installed")


def test_nothing_plugged_in_is_no_error(system: System) -> None:
    answer = shown(system.machine(), "--json")
    assert (answer.code, answer.rows, answer.codes()) == (0, [], ["none"])


def test_another_system_has_pyserials_list() -> None:
    listed = [
        SimpleNamespace(device="COM3", vid=0x0403, pid=0x6001, serial_number="A1", product=None, description="USB Serial Port"),
        SimpleNamespace(device="COM1", vid=None, pid=None, serial_number=None, product=None, description="n/a"),
    ]  # fmt: skip
    (first, second) = ports.table(Machine(root=Path("/nowhere"), linux=False, listing=lambda: listed), Journal()).rows
    assert (first["link"], first["usb"], first["chip"], first["product"], first["state"]) == (
        "COM3", "0403:6001:A1", "FTDI FT232R", "USB Serial Port", "free",
    )  # fmt: skip
    assert (second["link"], second["usb"], second["product"]) == ("COM1", None, None)


def test_the_table_fits_80_columns_and_names_the_next_step(system: System) -> None:
    system.tty("ttyUSB0", usb=FTDI, driver="ftdi_sio", by_id="usb-FTDI_A50285BI-if00-port0", latency=16)
    system.tty("ttyUSB1", usb=CH340, driver="ch341-uart", bus="1-2")
    system.denied.add("/dev/ttyUSB1")
    system.can("can0", "up", driver="gs_usb")
    answer = shown(system.machine())
    assert answer.code == 0
    table = answer.lines[: answer.lines.index(next(line for line in answer.lines if line.startswith("ttyUSB0:")))]
    assert max(map(len, table)) <= 80
    assert "ttyUSB0: /dev/serial/by-id/usb-FTDI_A50285BI-if00-port0" in answer.out
    assert (
        "ttyUSB1: /dev/ttyUSB1: no permission to read and write\n  Next: the port belongs to group dialout"
        in answer.out
    )


@pytest.mark.parametrize("form", ["plain", "csv"])
def test_other_formats(system: System, form: str) -> None:
    system.tty("ttyUSB0", usb=FTDI, latency=16)
    answer = shown(system.machine(), "--format", form)
    if form == "plain":
        assert answer.out == "/dev/ttyUSB0\n"
    else:
        assert answer.lines[0].startswith(
            "kind,link,by_id,usb,chip,driver,product,state,holder,permitted,latency_ms,bitrate"
        )


def test_a_by_id_name_is_found_as_its_port(system: System) -> None:
    system.tty("ttyUSB0", usb=FTDI, by_id="usb-x")
    port = system.machine().port("/dev/serial/by-id/usb-x")
    assert port is not None
    assert port.path == "/dev/ttyUSB0"
    assert system.machine().port("/dev/ttyUSB7") is None


def test_stale_locks(system: System) -> None:
    system.process(77, "minicom")
    system.write("/run/lock/LCK..ttyUSB0", "       999\n")
    system.write("/run/lock/LCK..ttyUSB1", "        77\n")
    system.write("/run/lock/other", "5\n")
    system.link("/var/lock", system.root / "run/lock")
    assert system.machine().stale_locks() == [("/run/lock/LCK..ttyUSB0", 999)]


def test_no_port_is_opened(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither by us nor by what we call: a device file is never opened, only looked at."""
    system.tty("ttyUSB0", usb=FTDI, latency=16)
    opened: list[str] = []
    real = Path.open

    def note(self: Path, *args: Any, **more: Any) -> Any:
        opened.append(str(self.relative_to(system.root)))
        return real(self, *args, **more)

    monkeypatch.setattr(Path, "open", note)
    ports.table(system.machine(), Journal())
    assert opened
    assert not [name for name in opened if name.startswith("dev/")]


@pytest.mark.real
def test_this_machine_and_its_ip_tool_answer_in_time() -> None:
    answer = run("ports", "--json")
    assert answer.code == 0
    assert all(row["link"] for row in answer.rows)
    assert isinstance(machine_module._run_ip(), str)
