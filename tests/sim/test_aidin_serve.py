"""The simulated AIDIN-hand as a TCP server for a client that knows nothing of this package: a plain socket and json."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from handctl.sim.cli import cli
from tests.support.cli import PATIENCE, in_time

Start = Callable[..., tuple[str, int]]


@pytest.fixture
def start() -> Iterator[Start]:
    servers: list[subprocess.Popen[str]] = []

    def starter(*arguments: str) -> tuple[str, int]:
        program = [sys.executable, "-m", "handctl.sim", "aidin", "--tcp", "127.0.0.1:0", "--duration", "600"]
        servers.append(subprocess.Popen([*program, *arguments], stdout=subprocess.PIPE, text=True))
        assert servers[-1].stdout is not None
        ready = json.loads(servers[-1].stdout.readline())
        assert ready["ready"] is True
        host, _, port = ready["link"].removeprefix("tcp://").rpartition(":")
        return host, int(port)

    yield starter
    for server in servers:
        server.terminate()
        server.communicate(timeout=30)


class Client:
    """Takes lines of JSON from a socket."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = socket.create_connection(address, timeout=PATIENCE)
        self.rest = b""

    def line(self) -> bytes:
        while b"\n" not in self.rest:
            data = self.socket.recv(2048)
            if not data:
                raise EOFError
            self.rest += data
        row, _, self.rest = self.rest.partition(b"\n")
        return row

    def ask(self, text: str) -> dict[str, Any]:
        self.socket.sendall(text.encode())
        return dict(json.loads(self.line()))


@pytest.mark.real
def test_stream_and_a_move(start: Start) -> None:
    """In real time; homing takes its 3 s on virtual time in test_aidin.py."""
    address, lines = start("--set", "start=open", "--set", "rate=50"), 1
    began = time.perf_counter()
    client = Client(address)
    assert json.loads(client.line())["motor_pos"] == [0] * 15

    def twenty() -> None:
        nonlocal lines
        for _ in range(20):
            client.socket.sendall(b'{"hand_mode":2}\n')
            client.line()
            lines += 1

    in_time(twenty, 0.0, 0.8)
    assert time.perf_counter() - began > 0.8 * (lines - 1) / 50
    target = [20000 + 100 * number for number in range(15)]
    client.socket.sendall(json.dumps({"hand_mode": 10, "hand_TP_cmd": target}).encode())
    for _ in range(150):
        feedback = json.loads(client.line())
        if feedback["motor_pos"] == target:
            break
    assert feedback["motor_pos"] == target
    client.socket.close()


@pytest.mark.real
def test_polling_is_quick_and_nagle_is_slow(start: Start) -> None:
    def polled(least: float, most: float, *options: str) -> None:
        client = Client(start("--set", "exchange=poll", *options))

        def fifteen() -> None:
            for _ in range(15):
                client.ask("{}")

        in_time(fifteen, 15 * least, 15 * most, tries=50)
        client.socket.close()

    polled(0.0, 0.02)
    polled(0.035, PATIENCE, "--set", "chunk=400", "--set", "nagle=1")


@pytest.mark.real
def test_a_second_client_waits_for_the_first_to_leave(start: Start) -> None:
    address = start()
    first, second = Client(address), Client(address)
    assert json.loads(first.line())
    second.socket.settimeout(0.3)
    with pytest.raises(TimeoutError):
        second.line()
    second.socket.settimeout(PATIENCE)
    first.socket.close()
    assert next(iter(json.loads(second.line()))) == "motor_pos"  # begins with a whole object


@pytest.mark.real
def test_disconnect_in_the_middle_and_a_client_after_it(start: Start) -> None:
    address = start("--fault", "disconnect", "--after", "3", "--every", "100")
    client = Client(address)
    with pytest.raises(EOFError):
        while True:
            client.line()
    assert client.rest.startswith(b'{"motor_pos":')
    again = Client(address)
    again.socket.sendall(b'{"hand_mode":3}')
    assert json.loads(again.line())["motor_pos"][0] == 70110


@pytest.mark.real
def test_silence(start: Start) -> None:
    client = Client(start("--fault", "silent"))
    client.socket.sendall(b"{}")
    client.socket.settimeout(0.3)
    with pytest.raises(TimeoutError):
        client.line()


@pytest.mark.real
def test_control_and_garbage_in(start: Start, tmp_path: Path) -> None:
    panel = str(tmp_path / "panel")
    client = Client(start("--control", panel, "--set", "exchange=poll"))
    client.socket.sendall(b"GET / HTTP/1.1\r\n\r\n{\xff}[1,2")
    feedback = client.ask("{}")
    told = CliRunner().invoke(cli, ["control", panel, "touch", "thumb", "1", "2", "3"])
    assert (told.exit_code, told.output) == (0, "touch thumb 1 2 3\n")
    assert client.ask("{}")["sensor_state"][:3] == [1.02, 1.99, 3.35]
    assert feedback["sensor_state"][:3] == [0.02, -0.01, 0.35]
    assert "dropped 17 " in CliRunner().invoke(cli, ["control", panel, "state"]).output


def test_help_names_the_options() -> None:
    text = CliRunner().invoke(cli, ["aidin", "-h"]).output
    for word in ("exchange", "nagle", "unclosed", "dead-motor", "between"):
        assert word in text
    assert CliRunner().invoke(cli, ["aidin"]).exit_code == 2
    refused = CliRunner().invoke(cli, ["aidin", "--tcp", "127.0.0.1:0", "--set", "rate=9999"])
    assert refused.exit_code == 2
    assert "rate=9999: out of range 1 to 1000" in refused.output


def test_there_is_no_serial_wire() -> None:
    refused = CliRunner().invoke(cli, ["aidin", "--pty"])
    assert refused.exit_code == 2 and "No such option" in refused.output
    assert "--pty" not in CliRunner().invoke(cli, ["aidin", "-h"]).output
    assert "No place to serve at. Give --tcp HOST:PORT" in CliRunner().invoke(cli, ["aidin"]).output


@pytest.mark.real
def test_half_an_object_of_a_client_that_left_does_not_swallow_what_the_next_one_sends(start: Start) -> None:
    address = start("--set", "exchange=command")
    with socket.create_connection(address) as killed:
        killed.sendall(b'{"hand_mode":1')
        time.sleep(0.1)
    client = Client(address)
    assert "current_state" in client.ask('{"hand_mode":3}\n')


@pytest.mark.real
def test_a_client_that_reads_again_after_a_long_pause_gets_whole_objects(start: Start) -> None:
    """3.5 MB in 5 s: more than the simulator keeps, and than the system does for so small a window."""
    address = start("--set", "rate=1000")
    with socket.socket() as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.settimeout(5)
        slow.connect(address)
        time.sleep(5.0)
        data = b""
        while data.count(b"\n") < 8000:
            data += slow.recv(1 << 20)
    rows = data.split(b"\n")[:-1]
    assert all(len(json.loads(row)) == 5 for row in rows)


@pytest.mark.real
def test_a_control_command_may_have_negative_numbers(start: Start, tmp_path: Path) -> None:
    panel = str(tmp_path / "panel")
    start("--control", panel)
    told = CliRunner().invoke(cli, ["control", panel, "touch", "thumb", "-1.5", "-2", "3"])
    assert (told.exit_code, told.output) == (0, "touch thumb -1.5 -2 3\n")
