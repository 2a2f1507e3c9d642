"""A bus as a server, in a process of its own: several clients at once, on a pty, on TCP and at slcan adapters."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
import serial
from click.testing import CliRunner

from handctl.sim.bus.file import EXAMPLE
from handctl.sim.bus.models import text
from handctl.sim.cli import cli
from tests.support.cli import PATIENCE

ASK_3 = bytes.fromhex("EB 90 03 04 11 E8 03 01 04")
ID_IS_3 = bytes.fromhex("90 EB 03 04 11 E8 03 03 06")
ASK_5 = bytes.fromhex("EB 90 05 04 11 E8 03 01 06")
ID_IS_5 = bytes.fromhex("90 EB 05 04 11 E8 03 05 0A")
TWO = ({"kind": "exo", "id": 3}, {"kind": "wrist", "id": 5})


class Server:
    """A running bus: its process and the links it announced."""

    def __init__(self, *arguments: str) -> None:
        words = [sys.executable, "-m", "handctl.sim", "bus", *arguments]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert self.process.stdout is not None
        ready = json.loads(self.process.stdout.readline() or b'{"ready": false}')
        assert ready["ready"] is True, self.stop()
        self.link: str = ready["link"]
        self.links: list[str] = ready.get("links", [self.link])

    def connect(self, number: int = 0) -> socket.socket:
        host, port = self.links[number].removeprefix("tcp://").rsplit(":", 1)
        client = socket.create_connection((host, int(port)), timeout=PATIENCE)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client

    def stop(self) -> tuple[int, str]:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        _, err = self.process.communicate(timeout=30)
        return self.process.returncode, err.decode()


Start = Callable[..., Server]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    servers: list[Server] = []

    def starter(content: str, *arguments: str) -> Server:
        file = tmp_path / "bus.toml"
        file.write_text(content, encoding="utf-8")
        servers.append(Server(str(file), *arguments))
        return servers[-1]

    yield starter
    for server in servers:
        server.stop()


def receive(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count and (piece := client.recv(count - len(data))):
        data += piece
    return data


@pytest.mark.real
def test_a_pty_and_two_clients_on_tcp_share_the_line(start: Start) -> None:
    server = start(text("half-duplex", TWO), "--pty", "--tcp", "127.0.0.1:0")
    assert len(server.links) == 2 and server.link == server.links[0]
    with (
        serial.Serial(server.link, 115200, timeout=PATIENCE) as port,
        server.connect(1) as one,
        server.connect(1) as two,
    ):
        two.sendall(b"\x00")  # both are in
        assert receive(one, 1) == port.read(1) == b"\x00"
        port.write(ASK_3)
        assert port.read(9) == ID_IS_3
        assert receive(one, 18) == receive(two, 18) == ASK_3 + ID_IS_3
        one.sendall(ASK_5)
        assert receive(one, 9) == ID_IS_5
        assert port.read(18) == receive(two, 18) == ASK_5 + ID_IS_5
        one.close()
        two.sendall(ASK_3)
        assert receive(two, 9) == ID_IS_3
    assert server.stop() == (0, "")


@pytest.mark.real
def test_a_pty_has_a_speed(start: Start) -> None:
    server = start(text("half-duplex", TWO), "--pty")
    assert server.links == [server.link]
    for speed, answer in ((57600, False), (115200, True)):
        with serial.Serial(server.link, speed, timeout=PATIENCE if answer else 0.5) as port:
            port.write(ASK_3)
            assert (port.read(9) == ID_IS_3) is answer


@pytest.mark.real
def test_python_can_talks_to_two_devices_on_one_bus(start: Start) -> None:
    devices = [{"kind": "wrist", "id": 1}, {"kind": "wrist", "id": 2}]
    masters = [{"ask": "10FF0002#02", "every_ms": 20}]
    server = start(text("clean", devices, masters, wire="can"), "--slcan-pty", "--slcan-tcp", "127.0.0.1:0")
    for link in server.links:
        channel = link.removeprefix("can:slcan:")
        with can.Bus(interface="slcan", channel=channel, bitrate=1000000, sleep_after_open=0) as bus:
            bus.send(can.Message(arbitration_id=0x10FF0001, data=[2]))
            heard = {(row.arbitration_id, bytes(row.data)) for _ in range(60) if (row := bus.recv(0.01)) is not None}
        assert (0x10FF0001, b"\xa7\xfe") in heard
        assert {(0x10FF0002, b"\x02"), (0x10FF0002, b"\xaa\xfe")} <= heard
    assert server.stop() == (0, "")


@pytest.mark.real
def test_control_reaches_each_device(start: Start, tmp_path: Path) -> None:
    control = str(tmp_path / "control")
    server = start(text("half-duplex", TWO), "--tcp", "127.0.0.1:0", "--control", control)
    runner = CliRunner()
    assert runner.invoke(cli, ["control", control, "devices"]).output == "1 exo, 2 wrist\n"
    assert runner.invoke(cli, ["control", control, "device", "2", "fault", "silent"]).output == "fault silent\n"
    with server.connect() as client:
        client.sendall(ASK_5 + ASK_3)
        assert receive(client, 9) == ID_IS_3
    assert ASK_3.hex() in runner.invoke(cli, ["control", control, "heard"]).output
    assert "Known: power-cycle" in runner.invoke(cli, ["control", control, "jump"]).output


@pytest.mark.parametrize(
    ("content", "arguments", "complaint"),
    [
        (EXAMPLE, [], "No place to serve at. Give --pty, --tcp HOST:PORT, --slcan-pty or --slcan-tcp HOST:PORT"),
        (EXAMPLE, ["--slcan-pty"], 'wire = "rs485" needs --pty or --tcp HOST:PORT'),
        ('[line]\nwire = "can"', ["--pty"], 'wire = "can" needs --slcan-pty or --slcan-tcp HOST:PORT'),
        ("[line]\nwires = 3", ["--pty"], "[line] unknown key 'wires'. Known: wire, model"),
        (EXAMPLE, ["--pty", "--seed", "x"], "option seed=x: not a whole number"),
        (EXAMPLE.replace("hot", "cold"), ["--pty"], "[[device]] 2 unknown fault 'cold' of the simulated wrist"),
    ],
)
def test_what_cannot_be_served_is_a_usage_error(
    tmp_path: Path, content: str, arguments: list[str], complaint: str
) -> None:
    file = tmp_path / "bus.toml"
    file.write_text(content, encoding="utf-8")
    done = CliRunner().invoke(cli, ["bus", str(file), *arguments, "--duration", "0.1"])
    assert done.exit_code == 2
    assert complaint in " ".join(done.output.split())


def test_no_file_and_a_port_in_use(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["bus", str(tmp_path / "none"), "--pty"])
    assert done.exit_code == 2 and "cannot be read" in done.output
    file = tmp_path / "bus.toml"
    file.write_text(EXAMPLE, encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = CliRunner().invoke(cli, ["bus", str(file), "--tcp", f"127.0.0.1:{taken.getsockname()[1]}"])
    assert done.exit_code == 3 and "in use" in done.output


@pytest.mark.real
def test_the_help_names_every_key_and_its_example_runs(start: Start) -> None:
    text_of = CliRunner().invoke(cli, ["bus", "-h"]).output
    for word in ("wire", "first_byte_lost", "every_ms", "bluetooth", "kind", "slcan-tcp"):
        assert word in text_of
    server = start(EXAMPLE, "--tcp", "127.0.0.1:0", "--duration", "600")
    with server.connect() as client:
        assert receive(client, 9) == bytes.fromhex("EB 90 02 04 30 FC 03 02 37")
