"""The simulators as servers, in processes of their own: pty, TCP, control socket, signals, foreign clients."""

from __future__ import annotations

import json
import math
import os
import select
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
from rh56_sdk import RH56Driver

from handctl.sim.cli import cli
from tests.support.cli import PATIENCE, briefly, in_time, wait_until

READ_ID = bytes.fromhex("EB 90 01 04 11 E8 03 01 02")
ID_IS_1 = bytes.fromhex("90 EB 01 04 11 E8 03 01 02")
READ_VOLTAGE = bytes.fromhex("EB 90 01 04 11 C0 05 02 DD")
VOLTAGE = bytes.fromhex("90 EB 01 05 11 C0 05 2E 02 0C")
DUMP_1 = bytes.fromhex("EB 90 01 04 11 E8 03 0A 0B")
DUMP_2 = bytes.fromhex("EB 90 01 04 11 C0 05 97 72")
SPEED_1 = bytes.fromhex("EB 90 01 04 12 E9 03 01 04")
SAVE = bytes.fromhex("EB 90 01 04 12 ED 03 01 08")
SAVE_ACK = bytes.fromhex("90 EB 01 04 12 ED 03 01 08")
SAVED = bytes.fromhex("90 EB 01 04 11 ED 03 00 06")
SET_INDEX = bytes.fromhex("EB 90 01 05 12 D4 05 2C 01 1E")
SET_INDEX_ACK = bytes.fromhex("90 EB 01 04 12 D4 05 01 F1")


class Server:
    """A running simulator: its process and the link it announced."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "handctl.sim", "exo", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        assert self.process.stdout is not None
        first = self.process.stdout.readline()
        if not first:
            raise AssertionError(f"no ready line: {self.stop()}")
        ready = json.loads(first)
        assert ready["ready"] is True
        self.link: str = ready["link"]

    def port(self, speed: int = 115200) -> serial.Serial:
        return serial.Serial(self.link, speed, timeout=PATIENCE)

    def connect(self) -> socket.socket:
        host, port = self.link.removeprefix("tcp://").rsplit(":", 1)
        client = socket.create_connection((host, int(port)), timeout=PATIENCE)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client

    def stop(self, number: int = signal.SIGTERM) -> tuple[int, str, str]:
        """Exit code, what stdout said after the ready line, stderr."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out.decode(), err.decode()


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


def ask(port: serial.Serial, request: bytes, count: int) -> bytes:
    port.write(request)
    return port.read(count)


def receive(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = client.recv(count - len(data))
        if not part:
            break
        data += part
    return data


# -- pty ------------------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_pty_answers_a_serial_client(start: Start) -> None:
    server = start("--pty")
    assert server.link.startswith("/dev/")
    with server.port() as port:
        assert ask(port, READ_ID, 9) == ID_IS_1
        assert ask(port, READ_VOLTAGE, 10) == VOLTAGE
        assert len(ask(port, DUMP_2, 159)) == 159
    assert server.stop() == (0, "", "")


@pytest.mark.real
def test_device_goes_on_while_clients_come_and_go(start: Start) -> None:
    server = start("--pty")
    with server.port() as port:
        assert ask(port, SET_INDEX, 9) == SET_INDEX_ACK
    with server.port() as port:
        assert ask(port, bytes.fromhex("EB 90 01 04 11 D4 05 02 F1"), 10)[7:9] == bytes([0x2C, 0x01])


@pytest.mark.real
def test_client_that_sets_no_speed(start: Start) -> None:
    """Such as a shell redirection: the pty starts at the speed of the device."""
    server = start("--pty", "--set", "baud=57600")
    descriptor = os.open(server.link, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(descriptor, READ_ID)
        assert select.select([descriptor], [], [], PATIENCE)[0]
        assert os.read(descriptor, 100) == ID_IS_1
    finally:
        os.close(descriptor)


@pytest.mark.real
def test_wrong_speed_is_silent_and_the_right_one_works(start: Start) -> None:
    server = start("--pty")
    with server.port(57600) as port:
        with briefly(port):
            assert ask(port, READ_ID, 9) == b""
        port.baudrate = 115200
        assert ask(port, READ_ID, 9) == ID_IS_1
        port.baudrate = 12345
        with briefly(port):
            assert ask(port, READ_ID, 9) == b""


@pytest.mark.real
def test_wrong_speed_can_be_garbage(start: Start) -> None:
    server = start("--pty", "--fault", "garble")
    with server.port(19200) as port:
        heard = ask(port, READ_ID, 3)
        with briefly(port):
            heard += port.read(9)
        assert len(heard) >= 3
        assert heard != ID_IS_1


@pytest.mark.real
def test_speed_change_needs_save_and_power_cycle(start: Start) -> None:
    server = start("--pty")
    with server.port() as port:
        ask(port, SPEED_1, 9)

        def save() -> None:
            assert ask(port, SAVE, 9) == SAVE_ACK
            assert port.read(9) == SAVED

        in_time(save, 0.9, 1.3)
        server.process.send_signal(signal.SIGUSR1)
        with briefly(port):
            wait_until(lambda: ask(port, READ_ID, 9) == b"")
            port.baudrate = 57600
            wait_until(lambda: ask(port, READ_ID, 9) == ID_IS_1)


@pytest.mark.real
def test_wire_time_is_real(start: Start) -> None:
    """The dump in 2 reads is 195 bytes, 16.93 ms at 115200."""
    server = start("--pty", "--wire", "115200")
    with server.port() as port:
        times = [math.inf]
        while min(times) >= 20.0 and len(times) < 500:  # a busy machine is late, never early
            began = time.perf_counter()
            assert len(ask(port, DUMP_1, 18)) == 18
            assert len(ask(port, DUMP_2, 159)) == 159
            times.append((time.perf_counter() - began) * 1000)
    assert 16.92 <= min(times) < 20.0, times


@pytest.mark.real
def test_client_that_does_not_read(start: Start) -> None:
    server = start("--pty")
    with server.port() as port:
        port.write_timeout = PATIENCE
        for _ in range(2000):
            port.write(DUMP_2)
        status = Path(f"/proc/{server.process.pid}/status").read_text()
        memory = next(int(row.split()[1]) for row in status.splitlines() if row.startswith("VmRSS"))
        assert memory < 60000, "kB"
        with briefly(port, 1.0):
            while port.read(65536):
                pass
        assert ask(port, READ_ID, 9) == ID_IS_1


@pytest.mark.real
def test_disconnect_ends_the_pty(start: Start) -> None:
    server = start("--pty", "--fault", "disconnect", "--after", "1")
    with server.port() as port:
        assert ask(port, READ_ID, 9) == ID_IS_1
        assert ask(port, READ_VOLTAGE, 5) == VOLTAGE[:5]
        with pytest.raises((serial.SerialException, OSError)):
            for _ in range(20):
                port.read(1)
    server.process.wait(timeout=PATIENCE)
    code, out, err = server.stop()
    assert (code, out) == (0, "")
    assert err.count("\n") == 1
    assert "disconnect" in err


# -- TCP --------------------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_tcp_serves_one_client_after_the_other(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0")
    assert server.link.startswith("tcp://127.0.0.1:")
    with server.connect() as first:
        first.sendall(SET_INDEX)
        assert receive(first, 9) == SET_INDEX_ACK
        with server.connect() as second:
            second.sendall(READ_ID)
            second.settimeout(0.1)
            with pytest.raises(TimeoutError):
                second.recv(9)
            first.close()
            second.settimeout(PATIENCE)
            assert receive(second, 9) == ID_IS_1
    with serial.serial_for_url(server.link.replace("tcp", "socket"), timeout=PATIENCE) as third:
        assert ask(third, bytes.fromhex("EB 90 01 04 11 D4 05 02 F1"), 10)[7:9] == bytes([0x2C, 0x01])
    assert server.stop(signal.SIGINT) == (0, "", "")


@pytest.mark.real
def test_tcp_disconnect_keeps_listening(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0", "--fault", "disconnect", "--every", "2")
    for _ in range(3):
        with server.connect() as client:
            client.sendall(READ_ID)
            assert receive(client, 9) == ID_IS_1
            client.sendall(READ_VOLTAGE)
            assert receive(client, 10) == VOLTAGE[:5]


@pytest.mark.real
def test_tcp_answer_comes_in_one_piece(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0")
    with server.connect() as client:
        for _ in range(20):
            client.sendall(DUMP_2)
            assert len(client.recv(4096)) == 159


@pytest.mark.real
def test_tcp_client_that_leaves_without_reading(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0", "--set", "turnaround=0.05")
    with server.connect() as client:
        client.sendall(READ_VOLTAGE)
    with server.connect() as client:
        client.sendall(READ_ID)
        assert receive(client, 9) == ID_IS_1  # not the reply to the first one


def test_tcp_port_in_use(start: Start) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = CliRunner().invoke(cli, ["exo", "--tcp", f"127.0.0.1:{taken.getsockname()[1]}"])
    assert done.exit_code == 3
    assert "in use" in done.output


# -- control, state, end ------------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_control_socket(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "control"
    server = start("--pty", "--control", str(path))
    with server.port() as port:
        with socket.socket(socket.AF_UNIX) as control:
            control.connect(str(path))
            control.sendall(b"fault silent\nset 1472 52 03\nnon")
            control.sendall(b"sense\n")
            answers = b""
            while answers.count(b"\n") < 3:
                answers += control.recv(4096)
            rows = answers.decode().splitlines()
            assert rows[:2] == ["ok fault silent", "ok set 1472 52 03"]
            assert rows[2].startswith("error unknown command 'nonsense'")
            with briefly(port):
                assert ask(port, READ_VOLTAGE, 10) == b""
        done = CliRunner().invoke(cli, ["control", str(path), "fault", "none"])
        assert (done.exit_code, done.output) == (0, "fault none\n")
        assert ask(port, READ_VOLTAGE, 10) == bytes.fromhex("90 EB 01 05 11 C0 05 52 03 31")
    refused = CliRunner().invoke(cli, ["control", str(path), "dance"])
    assert refused.exit_code == 3
    assert "unknown command 'dance'" in refused.output
    server.stop()
    assert not path.exists()
    gone = CliRunner().invoke(cli, ["control", str(path), "help"])
    assert gone.exit_code == 3
    assert str(path) in gone.output


@pytest.mark.real
def test_control_path_that_is_taken(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "control"
    path.write_text("not a socket")
    done = CliRunner().invoke(cli, ["exo", "--pty", "--control", str(path)])
    assert done.exit_code == 3
    assert path.read_text() == "not a socket"
    path.unlink()
    start("--pty", "--control", str(path))
    done = CliRunner().invoke(cli, ["exo", "--pty", "--control", str(path)])
    assert done.exit_code == 3
    assert "another simulator" in done.output


@pytest.mark.real
def test_control_socket_of_a_killed_server_is_replaced(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "control"
    killed = start("--pty", "--control", str(path))
    killed.stop(signal.SIGKILL)
    assert path.exists()
    start("--pty", "--control", str(path))
    assert CliRunner().invoke(cli, ["control", str(path), "requests"]).output == "requests 0\n"


@pytest.mark.real
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_state_is_saved_at_the_end(start: Start, tmp_path: Path, number: int) -> None:
    state = tmp_path / "hand.json"
    server = start("--pty", "--state", str(state))
    assert not state.exists()
    assert server.stop(number) == (0, "", "")
    assert json.loads(state.read_text())["kind"] == "exo"


@pytest.mark.real
def test_state_goes_from_server_to_server(start: Start, tmp_path: Path) -> None:
    state = tmp_path / "hand.json"
    server = start("--tcp", "127.0.0.1:0", "--state", str(state))
    with server.connect() as client:
        client.sendall(SET_INDEX)
        assert receive(client, 9) == SET_INDEX_ACK
    server.stop(signal.SIGKILL)
    again = start("--tcp", "127.0.0.1:0", "--state", str(state))
    with again.connect() as client:
        client.sendall(bytes.fromhex("EB 90 01 04 11 D4 05 02 F1"))
        assert receive(client, 10)[7:9] == bytes([0x2C, 0x01])


@pytest.mark.real
def test_duration() -> None:
    took = []
    while not took or (took[-1] >= 1.0 and len(took) < 10):  # a busy machine is late, never early
        server = Server("--pty", "--duration", "0.3")
        ready = time.monotonic()
        server.process.wait(timeout=PATIENCE)
        took.append(time.monotonic() - ready)
        assert server.stop() == (0, "", "")
    assert 0.2 < took[-1] < 1.0, took


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--pty or --tcp"),
        (["--pty", "--tcp", "127.0.0.1:0"], "--pty or --tcp"),
        (["--tcp", "127.0.0.1"], "HOST:PORT"),
        (["--tcp", "127.0.0.1:70000"], "HOST:PORT"),
        (["--pty", "--fault", "dance"], "unknown fault 'dance'"),
        (["--pty", "--set", "dance=1"], "unknown option 'dance'"),
        (["--pty", "--set", "dance"], "KEY=VALUE"),
        (["--pty", "--wire", "fast"], "wire=fast"),
        (["--pty", "--state", "/dev/null/directory/file"], "no directory"),
        (["--pty", "--duration", "-1"], "duration"),
    ],
)
def test_bad_options_are_usage_errors(arguments: list[str], message: str) -> None:
    done = CliRunner().invoke(cli, ["exo", *arguments])
    assert done.exit_code == 2
    assert message in done.output
    assert "ready" not in done.output


def test_help_lists_faults_and_options() -> None:
    done = CliRunner().invoke(cli, ["exo", "--help"])
    assert done.exit_code == 0
    for word in ("bad-checksum", "over-temperature", "result-flag", "turnaround", "--control"):
        assert word in done.output


@pytest.mark.real
def test_faults_from_several_options(start: Start) -> None:
    server = start("--tcp", "127.0.0.1:0", "--fault", "echo", "--fault", "duplicate,bad-checksum")
    with server.connect() as client:
        client.sendall(READ_ID)
        assert receive(client, 27) == READ_ID + 2 * (ID_IS_1[:-1] + b"\x03")
    server.stop()


# -- a foreign client -----------------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_foreign_driver_reads_and_moves_the_hand(start: Start) -> None:
    """pyrh56 is an independent client of the sibling hand; what it reads beyond the exo's registers is 0 here."""
    server = start("--pty", "--wire", "115200")
    with RH56Driver(server.link, timeout=PATIENCE) as hand:
        assert hand.read_angle() == [110, 220, 330, 440, 550, 660]
        assert hand.read_force() == [-11, 12, -13, 14, -15, 0]
        assert hand.read_current() == [21, 22, 23, 24, 25, 0]
        assert hand.read_temperature() == [31, 32, 33, 34, 35, 0]
        assert hand.read_error() == [0, 0, 0, 0, 0, 0]
        assert hand.read_voltage() == 558
        hand.move_to([500, 400, 300, 200, 100, 660])
        assert hand.wait_until_reached([500, 400, 300, 200, 100, None], timeout=PATIENCE, tolerance=0)[:5] == [
            500,
            400,
            300,
            200,
            100,
        ]
        hand.save_parameters()


@pytest.mark.real
def test_foreign_driver_clears_errors(start: Start) -> None:
    server = start("--pty", "--fault", "locked-rotor")
    with RH56Driver(server.link, timeout=PATIENCE) as hand:
        assert hand.read_error() == [1, 0, 0, 0, 0, 0]
        hand.clear_error()
        assert hand.read_error() == [0, 0, 0, 0, 0, 0]


@pytest.mark.real
@pytest.mark.parametrize("fault", ["split", "dribble", "echo", "slow"])
def test_foreign_driver_stands_line_faults(start: Start, fault: str) -> None:
    server = start("--pty", "--fault", fault)
    with RH56Driver(server.link, timeout=PATIENCE) as hand:
        assert hand.read_angle() == [110, 220, 330, 440, 550, 660]


@pytest.mark.real
@pytest.mark.parametrize("verb", ["ping", "state"])
def test_foreign_command_line(start: Start, verb: str) -> None:
    server = start("--pty")
    done = subprocess.run(
        [sys.executable, "-m", "rh56_sdk", "--port", server.link, verb],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_what_does_not_fit_for_a_client_that_does_not_read_is_lost_in_whole_replies(tmp_path: Path) -> None:
    """The loop itself: a place that takes nothing for a while, and a line that gives replies of one size."""
    from handctl.sim.engine import serve

    reply, given, taken = b"<" + b"x" * 9998 + b">", [0], bytearray()

    class Line:
        client_baud = None
        hung_up = False

        def take(self) -> bytes:
            given[0] += 1
            return reply if given[0] < 60 else b""

        def next_event(self) -> float:
            return 0.0

        def __getattr__(self, name: str) -> Callable[..., None]:
            return lambda *_: None

    class Place:
        def write(self, data: bytes) -> int:
            if given[0] < 30:
                return 0
            taken.extend(data[:3333])
            return len(data[:3333])

        def read(self, ready: list[int]) -> bytes:
            signals.stop = given[0] > 200
            return b""

        def readers(self) -> list[int]:
            return []

        def __getattr__(self, name: str) -> Callable[..., None]:
            return lambda *_: None

    with serve.Signals() as signals:
        serve._loop(Line(), Place(), None, signals, None)  # type: ignore[arg-type]
    replies = bytes(taken).split(b">")[:-1]
    assert len(replies) > 6 and {row + b">" for row in replies} == {reply}


@pytest.mark.parametrize("option", ["--state", "--control"])
def test_an_empty_path_is_refused(option: str) -> None:
    refused = CliRunner().invoke(cli, ["exo", "--tcp", "127.0.0.1:0", "--duration", "0.1", option, ""])
    assert refused.exit_code == 2 and "it is empty" in refused.output


@pytest.mark.real
def test_a_state_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    state, panel = folder / "state.json", tmp_path / "panel"
    program = [
        sys.executable,
        "-m",
        "handctl.sim",
        "aidin",
        "--tcp",
        "127.0.0.1:0",
        "--state",
        state,
        "--control",
        panel,
    ]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None and json.loads(server.stdout.readline())["ready"]
        folder.rmdir()
        told = CliRunner().invoke(cli, ["control", str(panel), "bend index 1 2 3"])
        _, err = server.communicate(timeout=30)  # it ends by itself
    for text in (told.output, err):
        assert f"state file {state} cannot be written: No such file" in text
    assert (told.exit_code, server.returncode) == (3, 3)
