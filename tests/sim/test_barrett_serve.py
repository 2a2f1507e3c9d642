"""The simulated BarrettHand as a server in a process of its own, with pyserial and a plain socket as clients."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial
from click.testing import CliRunner

from handctl.sim.cli import cli
from handctl.sim.engine import serve
from tests.support.cli import PATIENCE, briefly, in_time, run, wait_until

PROMPT = b"\n\r=> "


class Server:
    """A running simulator: its process, its link, its control socket."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.control = str(folder / "control")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "handctl.sim", "barrett", "--control", self.control, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        assert self.process.stdout is not None
        first = self.process.stdout.readline()
        if not first:
            raise AssertionError(f"no ready line: {self.stop()}")
        self.link: str = json.loads(first)["link"]

    def port(self, speed: int = 9600) -> serial.Serial:
        return serial.Serial(self.link, speed, timeout=PATIENCE)

    def tell(self, command: str) -> str:
        return serve.send_control(self.control, command)

    def stop(self, number: int = signal.SIGTERM) -> tuple[int, str, str]:
        """Exit code, what stdout said after the ready line, stderr."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out.decode(), err.decode()


Start = Callable[..., Server]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    servers: list[Server] = []

    def starter(*arguments: str) -> Server:
        servers.append(Server(tmp_path, *arguments))
        return servers[-1]

    yield starter
    for server in servers:
        server.stop()


def ask(port: serial.Serial, command: str) -> bytes:
    port.write(command.encode() + b"\r")
    return port.read_until(b"=> ")


@pytest.mark.real
def test_pty(start: Start) -> None:
    server = start("--pty")
    with server.port() as port:
        assert ask(port, "FGET P") == b"FGET P\n\r1021 2042 3063 404" + PROMPT
        assert ask(port, "C") == b"C\n\rERR 4" + PROMPT
    with server.port() as port:
        assert ask(port, "FGET S") == b"FGET S\n\r4 4 4 4" + PROMPT
    assert server.stop() == (0, "", "")


@pytest.mark.real
def test_movement_takes_its_time_and_an_abort_stops_it(start: Start, tmp_path: Path) -> None:
    panel = tmp_path / "panel"
    server = start("--pty", "--set", "initialized=1", "--control", str(panel))
    with server.port() as port:

        def there_and_back() -> None:
            assert ask(port, "GC") == b"GC" + PROMPT
            assert ask(port, "GO") == b"GO" + PROMPT

        in_time(there_and_back, 2 * 0.79, 2 * 1.5)
        ask(port, "GC")
        ask(port, "FSET MOV 5")  # 14 s for the whole way: the abort comes in the middle on a busy machine, too
        port.write(b"GO\r")
        wait_until(lambda: int(run("sim", "control", panel, "motors").out.split()[2]) < 16500)
        port.write(b"\x03")
        assert port.read_until(b"=> ") == b"GO\n\rERR 16384" + PROMPT
        first = ask(port, "FGET P")
        time.sleep(0.2)
        assert ask(port, "FGET P") == first
        place = int(first.split()[2])
        assert 1000 < place < 17000


@pytest.mark.real
def test_tcp(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0")
    host, port = server.link.removeprefix("tcp://").rsplit(":", 1)
    with socket.create_connection((host, int(port)), timeout=PATIENCE) as client:
        client.sendall(b"VERS\rPGET SN\r")
        data = b""
        while data.count(b"=> ") < 2:
            data += client.recv(100)
    assert data == b"VERS\n\r4.33" + PROMPT + b"PGET SN\n\r1042" + PROMPT
    assert server.stop(signal.SIGINT) == (0, "", "")


@pytest.mark.real
def test_speed_change_on_a_pty(start: Start) -> None:
    """§5.4.1: 13 echo bytes at 9600, then garbage, then silence or garbage at 9600 and the prompt at 38400."""
    server = start("--pty")
    with server.port() as port:
        port.write(b"PSET BAUD 384\r")
        assert port.read(13) == b"PSET BAUD 384"
        with briefly(port):
            assert b"=> " not in port.read(100)
            port.write(b"\r")
            assert b"=> " not in port.read(100)
        port.baudrate = 38400
        port.write(b"\x03")
        assert port.read_until(b"=> ").endswith(PROMPT)
        assert ask(port, "PGET BAUD") == b"PGET BAUD\n\r384" + PROMPT
        # RESET: back to the saved speed; the client follows before the banner comes.
        port.write(b"RESET\r")
        assert port.read(5) == b"RESET"
        port.baudrate = 9600
        assert port.read_until(b"=> ") == b"\n\rBarrettHand Firmware\n\rVersion 4.33" + PROMPT


@pytest.mark.real
def test_saved_speed_is_that_of_the_pty(start: Start) -> None:
    server = start("--pty", "--set", "baud=1200")
    with server.port(1200) as port:
        assert ask(port, "") == PROMPT
    with server.port(9600) as port, briefly(port):
        port.write(b"\x03\r")
        assert b"=> " not in port.read(20)


@pytest.mark.real
def test_wire_at_the_speed_of_the_hand(start: Start) -> None:
    """43 characters at 9600 bit/s: 44.8 ms."""
    server = start("--pty", "--wire", "auto")
    command = "PGET TEMP PTEMP OTEMP"
    with server.port() as port:
        ask(port, "")
        expected = b"PGET TEMP PTEMP OTEMP\n\r412\n\r573\n\r0" + PROMPT
        floor = (len(expected) + 1) / 960

        def asked() -> None:
            assert ask(port, command) == expected

        in_time(asked, floor - 0.002, floor + 0.020, tries=50)


@pytest.mark.real
def test_control_and_power(start: Start) -> None:
    server = start("--pty", "--set", "initialized=1", "--set", "boot=0.2")
    with server.port() as port:
        assert server.tell("block F1") == "ok block F1"
        assert ask(port, "1M 1000") == b"1M 1000\n\rERR 16" + PROMPT
        assert server.tell("temperature 655") == "ok temperature 655"
        assert ask(port, "PGET TEMP") == b"PGET TEMP\n\r655" + PROMPT
        assert server.tell("leap").startswith("error unknown command 'leap'")
        server.process.send_signal(signal.SIGUSR1)
        assert port.read_until(b"=> ").startswith(b":\n\rBarrettHand Firmware")
        assert ask(port, "GC") == b"GC\n\rERR 4" + PROMPT


@pytest.mark.real
def test_state_survives_a_kill(start: Start, tmp_path: Path) -> None:
    state = str(tmp_path / "hand.json")
    server = start("--pty", "--state", state)
    with server.port() as port:
        ask(port, "1FSET DP 42")
        ask(port, "1FSAVE")
    server.stop(signal.SIGKILL)
    (tmp_path / "control").unlink()
    server = start("--pty", "--state", state)
    assert server.tell("eeprom DP") == "ok 42 8500 8500 1575"
    assert server.tell("saves") == "ok saves 1 0"
    with server.port() as port:
        assert ask(port, "1FGET DP") == b"1FGET DP\n\r42" + PROMPT


@pytest.mark.real
def test_realtime(start: Start) -> None:
    """§6.4 on a pty: 20 blocks at 38400, at most half again as long as they last on the wire, but for a busy machine."""
    server = start("--pty", "--wire", "auto", "--set", "baud=38400", "--set", "initialized=1")
    with server.port(38400) as port:
        ask(port, "12FSET LCPG 0 LFV 0 LFAP 0")
        ask(port, "4FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 0")
        ask(port, "PSET LFT 1")
        port.write(b"124LOOP\r")
        assert port.read(8) == b"124LOOP*"
        assert server.tell("jump F2 127") == "ok jump F2 127"
        port.write(b"C\x00\x00")
        assert port.read(8).hex(" ") == "2a 70 00 77 7f 00 01 9c"

        def block() -> None:
            port.write(b"C\x00\x00")
            assert port.read(8).hex(" ") == "2a 70 00 77 00 00 01 9c"

        for _ in range(20):
            in_time(block, 9 / 3840 - 0.0002, PATIENCE)
        in_time(block, 9 / 3840 - 0.0002, 9 / 3840 * 1.5, tries=500)
        port.write(b"\x03")
        assert port.read_until(b"=> ") == PROMPT


@pytest.mark.real
def test_download_and_a_kill_in_the_middle_of_another(start: Start, tmp_path: Path) -> None:
    state = str(tmp_path / "hand.json")
    server = start("--pty", "--state", state, "--set", "boot=0.3", "--set", "download-version=4.34")
    with server.port() as port:
        assert server.tell("power off") == "ok power off"
        port.write(b"X")
        assert server.tell("power on") == "ok power on"
        assert port.read(1) == b":"
        port.write(bytes.fromhex("FF FF 00 20 02 FF"))
        assert port.read(3) == bytes.fromhex("00 20 02")
        port.write(b"\xaa\xbb")
        assert port.read(2) == b"\xaa\xbb"
        path = tmp_path / "image"
        assert server.tell(f"save-image {path}").startswith("ok image valid, version 4.34, 1 records, 2 bytes, ")
        assert path.read_bytes() == b"\xaa\xbb"
        port.write(b"\rRESET\r")
        assert port.read_until(b"=> ") == b"\rRESET\r\n\rBarrettHand Firmware\n\rVersion 4.34" + PROMPT
        assert ask(port, "VERS") == b"VERS\n\r4.34" + PROMPT
        assert server.tell("power-cycle") == "ok power cycled"
        assert port.read(1) == b":"
        port.write(bytes.fromhex("FF FF 00 20 02 FF CC"))
        assert port.read(4) == bytes.fromhex("00 20 02 CC")
    server.stop(signal.SIGKILL)
    (tmp_path / "control").unlink()
    server = start("--pty", "--state", state, "--set", "boot=0.3")
    assert server.tell("image").startswith("ok image partial, version 4.34, 0 records, 1 bytes, ranges 2000-2000, ")
    with server.port() as port:
        assert server.tell("power-cycle") == "ok power cycled"
        assert port.read_until(b"\r:").startswith(b":\n\rNo firmware")


@pytest.mark.real
def test_flood_is_survived(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0", "--seed", "5")
    host, port = server.link.removeprefix("tcp://").rsplit(":", 1)
    with socket.create_connection((host, int(port)), timeout=PATIENCE) as client:
        for _ in range(20):
            client.sendall(bytes(range(14, 256)) * 8)
            client.setblocking(False)
            try:
                while client.recv(65536):
                    pass
            except BlockingIOError:
                client.settimeout(PATIENCE)
        client.sendall(b"\x03VERS\r")
        data = b""
        while not data.endswith(b"4.33" + PROMPT):
            part = client.recv(65536)
            assert part
            data += part
    assert server.stop() == (0, "", "")


def test_help_names_options_and_faults() -> None:
    result = CliRunner().invoke(cli, ["barrett", "--help"])
    assert result.exit_code == 0
    for word in ("firmware", "texts", "hctl-clock", "eeprom-worn", "no-abort", "dribble", "--control"):
        assert word in result.output
