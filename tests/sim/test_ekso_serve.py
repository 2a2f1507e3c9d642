"""The simulated EksoNR as a server in a process of its own, with pyserial and a plain socket as clients."""

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

from handctl.sim.engine import serve
from tests.sim.ekso_bench import (
    CANCEL,
    CANCEL_OK,
    DATE_4,
    GET_DATE,
    GET_SETTINGS,
    GET_TIME,
    SET_OK,
    SET_STEP,
    SETTINGS,
    TIME_4,
    message,
)
from tests.support.cli import PATIENCE, briefly

pytestmark = pytest.mark.real


class Server:
    """A running simulator: its process, its link, its control socket."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.control = str(folder / "control")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "handctl.sim", "ekso", "--duration", "600", "--control", self.control, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        assert self.process.stdout is not None
        first = self.process.stdout.readline()
        if not first:
            raise AssertionError(f"no ready line: {self.stop()}")
        self.link: str = json.loads(first)["link"]

    def stop(self) -> tuple[int, str, str]:
        """Exit code, what stdout said after the ready line, stderr."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
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


def ask(port: serial.Serial, request: str, count: int) -> str:
    port.write(bytes.fromhex(request))
    return port.read(count).hex(" ").upper()


def test_pty(start: Start) -> None:
    server = start("--pty", "--set", "preset=vectors")
    with serial.Serial(server.link, 115200, timeout=PATIENCE) as port:
        assert ask(port, GET_SETTINGS, 50) == SETTINGS
        assert ask(port, SET_STEP, 8) == SET_OK
        assert ask(port, CANCEL, 8) == CANCEL_OK
        assert serve.send_control(server.control, "counts") == "ok set 1 cancel 1 violations 0"
        assert serve.send_control(server.control, "posture sitting") == "ok posture sitting"
        assert ask(port, message(153, 1).hex(), 60)[120:125] == "10 40"
        assert serve.send_control(server.control, "jump").startswith("error unknown command")
    assert server.stop() == (0, "", "")


def test_tcp(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0", "--set", "preset=vectors")
    host, number = server.link.removeprefix("tcp://").rsplit(":", 1)
    with socket.create_connection((host, int(number)), timeout=PATIENCE) as client:
        client.sendall(bytes.fromhex(GET_DATE))
        assert client.recv(100).hex(" ").upper() == DATE_4


def test_another_speed_is_not_understood(start: Start) -> None:
    server = start("--pty")
    with serial.Serial(server.link, 9600, timeout=PATIENCE) as port:
        with briefly(port):
            assert ask(port, GET_TIME, 10) == ""
        port.baudrate = 115200
        assert len(ask(port, GET_TIME, len(bytes.fromhex(TIME_4)))) == len(TIME_4)


def test_boot_time_follows_the_clock(start: Start) -> None:
    """Through a 115200 line, with a client that does nothing else."""
    server = start("--pty", "--wire", "115200")
    with serial.Serial(server.link, 115200, timeout=PATIENCE) as port:
        ticks, asked, answered = [], [], []
        for number in range(40):
            asked.append(time.monotonic())
            port.write(message(153, number))
            data = port.read(60)
            answered.append(time.monotonic())
            assert data == message(153, number, data[4:-2])
            ticks.append(int.from_bytes(data[54:58], "big"))
    assert answered[-1] - asked[0] >= 40 * 66 * 10 / 115200
    # each tick is that of a moment between question and answer, however long these lie apart
    passed = (ticks[-1] - ticks[0]) / 1000
    assert asked[-1] - answered[0] - 0.01 <= passed <= answered[-1] - asked[0] + 0.01
    assert all(tick % 2 == 1 for tick in ticks)
