"""Served simulators of the RH56 hands, to clients that others wrote: pymodbus, pyrh56, inspire-rh56dftp, python-can.

pymodbus knows no hand. pyrh56 drives a DFX over EB90, inspire-rh56dftp a DFTP over Modbus TCP; nothing of them was written
with this simulator in mind. Each server plays at one real second a second.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest
import serial
from rh56_sdk.driver import RH56Driver

from handctl.sim.engine.serve import send_control
from tests.support.cli import PATIENCE

START = "from handctl.sim.cli import _server; _server('hand')()"
ANYWHERE = "127.0.0.1:0"
ANGLES = [110, 220, 330, 440, 550, 660]


class Server:
    """A running simulator: its process, and the links that it announced."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", START, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        first = self.process.stdout.readline()
        if not first:
            raise AssertionError(f"no ready line: {self.stop()}")
        ready = json.loads(first)
        self.links: list[str] = ready.get("links", [ready["link"]])

    def port_of(self, number: int = 0) -> int:
        return int(self.links[number].rpartition(":")[2])

    def stop(self) -> tuple[int, str]:
        """Exit code and stderr."""
        self.process.terminate()
        _, err = self.process.communicate(timeout=30)
        return self.process.returncode, err


Start = Callable[..., Server]


@pytest.fixture
def start() -> Iterator[Start]:
    servers: list[Server] = []

    def starter(*arguments: str) -> Server:
        servers.append(Server(*arguments))
        return servers[-1]

    yield starter
    for server in servers:
        server.stop()


def over_tcp(port: int) -> Any:
    """A client of pymodbus."""
    from pymodbus.client import ModbusTcpClient

    return ModbusTcpClient("127.0.0.1", port=port)


def over_rtu(port: str, **options: Any) -> Any:
    from pymodbus.client import ModbusSerialClient

    return ModbusSerialClient(port, baudrate=115200, **options)


def signed(values: list[int]) -> list[int]:
    return [value - 65536 if value > 32767 else value for value in values]


def read(client: Any, address: int, count: int, unit: int = 1) -> list[int]:
    answer = client.read_holding_registers(address, count=count, device_id=unit)
    assert not answer.isError(), answer
    values: list[int] = answer.registers
    return values


def until(get: Callable[[], object], wanted: object, seconds: float = PATIENCE) -> None:
    end = time.monotonic() + seconds
    while (found := get()) != wanted:
        assert time.monotonic() < end, found
        time.sleep(0.02)


# -- pymodbus: one hand, two wires ------------------------------------------------------------------------------------


@pytest.mark.real
def test_pymodbus_reads_and_moves_over_rtu_and_tcp(start: Start) -> None:
    server = start("--model", "tp", "--modbus-pty", "--modbus-tcp", ANYWHERE)
    network, pair = over_tcp(server.port_of(0)), over_rtu(server.links[1])
    with network, pair:
        for client in (network, pair):
            assert read(client, 1000, 1) == [1]
            assert read(client, 1546, 6) == ANGLES
            assert signed(read(client, 1582, 6)) == [-11, 12, -13, 14, -15, 16]
            assert read(client, 1618, 3) == [0x201F, 0x2221, 0x2423]
            assert read(client, 1700, 2) == [0xA8C0, 0xD20B]
        live = read(network, 1534, 45)
        assert live == read(pair, 1534, 45)
        assert read(network, 3000, 9, unit=255) == list(range(9))
        assert not network.write_registers(1486, [65535, 65535, 65535, 300, 65535, 65535], device_id=255).isError()
        until(lambda: read(pair, 1546, 6), [110, 220, 330, 300, 550, 660])
        assert not pair.write_register(1492, 440).isError()
        until(lambda: read(network, 1546, 6), ANGLES)
        assert network.read_holding_registers(1546, count=1).registers == [110]
        assert network.read_input_registers(1546, count=1).exception_code == 1
    assert server.stop() == (0, "")


@pytest.mark.real
def test_pymodbus_reads_and_moves_an_f1_by_its_words(start: Start) -> None:
    server = start("--model", "f1", "--modbus-pty")
    with over_rtu(server.links[0]) as client:
        before = read(client, 1064, 6)
        assert len(set(before)) == 6
        assert read(client, 1088, 12) == [2, 1, 2, 3, 2, 0, 31, 32, 33, 34, 35, 36]
        assert not client.write_registers(1040, [65535, 65535, 65535, 1500, 65535, 65535]).isError()
        until(lambda: read(client, 1064, 6), [*before[:3], 1500, *before[4:]], 20.0)


@pytest.mark.real
def test_pymodbus_meets_another_id_and_a_bad_sum_with_silence(start: Start) -> None:
    from pymodbus import ModbusException

    server = start("--modbus-pty", "--fault", "bad-checksum", "--after", "1")
    with over_rtu(server.links[0], timeout=0.1, retries=0) as client:
        with pytest.raises(ModbusException):
            client.read_holding_registers(1546, count=6, device_id=2)
        assert read(client, 1546, 6) == ANGLES
        with pytest.raises(ModbusException):
            client.read_holding_registers(1546, count=6)


@pytest.mark.real
def test_several_clients_of_one_hand(start: Start, tmp_path: Path) -> None:
    from pymodbus import ModbusException

    control = str(tmp_path / "control")
    server = start("--modbus-tcp", ANYWHERE, "--control", control)
    clients = [over_tcp(server.port_of()) for _ in range(3)]
    assert all(client.connect() for client in clients)
    for _ in range(5):
        for client in clients:
            assert read(client, 1546, 6) == ANGLES
    clients[0].close()
    assert read(clients[1], 1546, 6) == ANGLES
    assert send_control(control, "requests") == "ok requests 16"
    send_control(control, "fault two-clients-drop")
    late = over_tcp(server.port_of())
    late.connect()
    assert read(late, 1546, 6) == ANGLES
    with pytest.raises((ModbusException, OSError)):
        read(clients[1], 1546, 6)
    for client in (*clients, late):
        client.close()


# -- other people's drivers of the hand -----------------------------------------------------------------------------------


@pytest.mark.real
def test_inspire_rh56dftp_reads_and_moves_a_tp(start: Start) -> None:
    from inspire_rh56dftp.client import InspireHand
    from inspire_rh56dftp.registers import TACTILE_REGIONS

    server = start("--model", "tp", "--modbus-tcp", ANYWHERE, "--fault", "txid-off")
    hand = InspireHand("127.0.0.1", server.port_of(), min_send_interval_s=0.0)
    assert list(hand.read_holding(1546, 6)) == ANGLES
    for name, address, count, (rows, columns) in TACTILE_REGIONS:
        assert rows * columns == count
        first = (address - 3000) // 2
        assert list(hand.read_holding(address, count, name)) == list(range(first, first + count))
    assert hand.send_raw([500] * 6)
    until(lambda: list(hand.read_holding(1546, 6)), [500] * 6)
    hand.open_hand()
    until(lambda: list(hand.read_holding(1546, 6)), [1000, 1000, 1000, 1000, 1000, 0])  # its own idea of open
    hand.close()


@pytest.mark.real
def test_pyrh56_reads_and_moves_a_df(start: Start) -> None:
    server = start("--model", "df", "--pty", "--set", "speed=1000", "--wire", "115200")
    with RH56Driver(server.links[0]) as hand:
        assert hand.read_angle() == ANGLES
        assert hand.read_force() == [-11, 12, -13, 14, -15, 16]
        assert hand.read_temperature() == [31, 32, 33, 34, 35, 36]
        assert hand.read_error() == [0] * 6
        assert hand.read_voltage() == 558
        hand.move_to([500, 400, 300, 200, 100, 600])
        assert hand.wait_until_reached([500, 400, 300, 200, 100, 600], timeout=PATIENCE, tolerance=0)
        hand.save_parameters()


# -- bytes and frames -------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_bytes_over_tcp_and_both_protocols_on_them(start: Start) -> None:
    server = start("--model", "df", "--tcp", ANYWHERE)
    assert server.links[0].startswith("socket://")
    with serial.serial_for_url(server.links[0], timeout=PATIENCE) as port:
        port.write(bytes.fromhex("EB 90 01 04 11 C0 05 02 DD"))
        assert port.read(10).hex(" ").upper() == "90 EB 01 05 11 C0 05 2E 02 0C"
        time.sleep(0.01)
        port.write(bytes.fromhex("01 03 03 E8 00 01 04 7A"))
        assert port.read(7).hex(" ").upper() == "01 03 02 00 01 79 84"


@pytest.mark.real
def test_slcan_beside_modbus_tcp(start: Start) -> None:
    server = start("--model", "tp", "--slcan-tcp", ANYWHERE, "--modbus-tcp", ANYWHERE)
    assert server.links[1].startswith("can:slcan:")
    channel = server.links[1].removeprefix("can:slcan:")
    with can.Bus(interface="slcan", channel=channel, bitrate=1000000, sleep_after_open=0) as bus:
        bus.send(can.Message(arbitration_id=0x01930001, data=[6], is_extended_id=True))
        end = time.monotonic() + PATIENCE
        while (answer := bus.recv(0.2)) is None:
            assert time.monotonic() < end
        assert (answer.arbitration_id, answer.data.hex()) == (0x01930001, "020102030200")
    with over_tcp(server.port_of(0)) as client:
        assert read(client, 1612, 3) == [0x0102, 0x0302, 0x0002]


@pytest.mark.real
def test_921600_is_another_speed_than_115200(start: Start) -> None:
    server = start("--model", "tp", "--pty", "--set", "baud=921600")
    for speed, answered in ((115200, False), (921600, True)):
        with serial.Serial(server.links[0], speed, timeout=PATIENCE if answered else 0.5) as port:
            port.write(bytes.fromhex("EB 90 01 04 11 E8 03 01 02"))
            assert bool(port.read(9)) == answered


@pytest.mark.real
def test_a_client_that_leaves_in_the_middle(start: Start) -> None:
    server = start("--modbus-tcp", ANYWHERE)
    for _ in range(3):
        with socket.create_connection(("127.0.0.1", server.port_of()), timeout=PATIENCE) as client:
            client.sendall(bytes.fromhex("00 01 00 00 00 06 FF 03 06"))
    with over_tcp(server.port_of()) as client:
        assert read(client, 1546, 6) == ANGLES


@pytest.mark.real
def test_the_server_moves_with_the_ip_address_of_the_hand(start: Start, tmp_path: Path) -> None:
    control = str(tmp_path / "control")
    server = start("--modbus-tcp", ANYWHERE, "--set", "ip=127.0.0.1", "--control", control)
    with over_tcp(server.port_of()) as client:
        assert read(client, 1700, 2) == [0x007F, 0x0100]
        assert not client.write_registers(1700, [0x007F, 0x0200]).isError()
        assert not client.write_register(1005, 1).isError()
        assert send_control(control, "ip") == "ok 127.0.0.1"
        send_control(control, "power-cycle")
        assert send_control(control, "ip") == "ok 127.0.0.2"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", server.port_of()), timeout=PATIENCE)
    with socket.create_connection(("127.0.0.2", server.port_of()), timeout=PATIENCE) as there:
        there.sendall(bytes.fromhex("00 01 00 00 00 06 FF 03 06 A4 00 02"))
        assert there.recv(64).hex(" ").upper().endswith("00 7F 02 00")
        there.sendall(bytes.fromhex("00 02 00 00 00 0B FF 10 06 A4 00 02 04 33 C6 07 64"))
        there.sendall(bytes.fromhex("00 03 00 00 00 06 FF 06 03 ED 00 01"))
        assert there.recv(64)
        until(lambda: "save=2" in send_control(control, "acts"), True)
    send_control(control, "power-cycle")
    assert send_control(control, "ip") == "ok 198.51.100.7"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", server.port_of()), timeout=PATIENCE)
    assert server.stop() == (0, "")


@pytest.mark.real
def test_two_hands_with_one_ip_address(start: Start) -> None:
    server = start("--modbus-tcp", ANYWHERE, "--fault", "twin-ip")
    seen = []
    for _ in range(4):
        with over_tcp(server.port_of()) as client:
            seen.append(read(client, 1546, 6))
    assert seen[0] == seen[2] == ANGLES
    assert seen[1] == seen[3] == [angle + 3 for angle in ANGLES]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "No place to serve at. Give either --pty or --tcp"),
        (["--pty", "--modbus-pty"], "More than one place to serve at"),
        (["--modbus-pty", "--set", "speaks=eb90"], "speaks=eb90: --modbus-pty serves Modbus RTU alone"),
        (["--model", "df", "--modbus-tcp", ANYWHERE], "a hand of generation df has no Ethernet"),
        (["--modbus-tcp", ANYWHERE, "--pty", "--fault", "nothing"], "unknown fault 'nothing'"),
        (["--model", "rh56", "--pty"], "'rh56' is not one of 'df', 'tp', 'f1', 'dg2'"),
    ],
)
def test_words_that_are_refused(words: list[str], text: str) -> None:
    from click.testing import CliRunner

    from handctl.sim.cli import _server

    done = CliRunner().invoke(_server("hand"), words)
    assert done.exit_code == 2
    assert text in done.output
