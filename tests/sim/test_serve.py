"""The simulators as servers: their event loop on virtual time, and processes of their own where a system or a foreign client counts."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import serial
from click.testing import CliRunner
from rh56_sdk import RH56Driver

from handctl.sim.cli import cli
from handctl.sim.engine.serve import UNREAD, send_control
from tests.support.cli import PATIENCE, Simulator, briefly, run, wait_until
from tests.support.each_row import each_row
from tests.support.virtual import Loop

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
READ_INDEX = bytes.fromhex("EB 90 01 04 11 D4 05 02 F1")
ANY = "127.0.0.1:0"


# -- the loop at a pseudo-terminal ------------------------------------------------------------------------------------


def test_the_device_goes_on_while_clients_come_and_go() -> None:
    with Loop("exo", "--pty") as loop:
        with loop.open() as port:
            assert port.ask(SET_INDEX, 9) == SET_INDEX_ACK
            port.write(READ_ID)  # nobody fetches the answer
        with loop.open() as port:
            port.reset_input_buffer()
            assert port.ask(READ_INDEX, 10)[7:9] == bytes([0x2C, 0x01])
        assert loop.stop() == (0, [], [])


def test_a_wrong_speed_is_silence_or_garbage() -> None:
    with Loop("exo", "--pty") as loop, loop.open(57600) as port:
        assert port.ask(READ_ID, 9, 1.0) == b""
        port.baudrate = 115200
        assert port.ask(READ_ID, 9) == ID_IS_1
        port.baudrate = -1  # one without a name
        assert port.ask(READ_ID, 9, 1.0) == b""
    with Loop("exo", "--pty", "--fault", "garble") as loop, loop.open(19200) as port:
        heard = port.ask(READ_ID, 9, 1.0)
        assert len(heard) >= 3 and heard != ID_IS_1


def test_a_speed_change_needs_save_and_power_cycle() -> None:
    with Loop("exo", "--pty") as loop, loop.open() as port:
        port.ask(SPEED_1, 9)
        assert port.ask(SAVE, 9) == SAVE_ACK
        asked = loop.moment
        assert port.read(9) == SAVED
        assert loop.moment - asked == pytest.approx(1.0, abs=0.001)
        assert port.ask(READ_ID, 9) == ID_IS_1
        loop.signals.power_cycles += 1
        assert port.ask(READ_ID, 9, 1.0) == b""
        port.baudrate = 57600
        assert port.ask(READ_ID, 9) == ID_IS_1


def test_wire_time_passes() -> None:
    """The dump in 2 reads is 195 bytes, 16.93 ms at 115200."""
    with Loop("exo", "--pty", "--wire", "115200") as loop, loop.open() as port:
        began = loop.moment
        assert len(port.ask(DUMP_1, 18)) == 18 and len(port.ask(DUMP_2, 159)) == 159
        assert loop.moment - began == pytest.approx(0.01693, abs=0.0001)


def test_what_a_client_does_not_read_is_bounded() -> None:
    with Loop("exo", "--pty") as loop, loop.open() as port:
        for _ in range(4000):
            port.write(DUMP_2)
        kept = len(port.read(4000 * 159, 1.0))
        assert UNREAD // 2 < kept < 4000 * 159 / 2 and kept % 159 == 0, "as much as waits, in whole replies"
        assert port.ask(READ_ID, 9) == ID_IS_1


@each_row("words", [["--duration", "0.3"], ["--duration", "0.3", "--wire", "115200"]])
def test_it_ends_by_itself_at_its_time(words: list[str]) -> None:
    with Loop("exo", "--pty", *words) as loop:
        began = loop.moment
        assert not loop.until(lambda: False) and loop.ended
        assert loop.moment - began == pytest.approx(0.3, abs=0.001)
        assert loop.stop() == (0, [], [])


def test_a_disconnect_ends_a_terminal_and_leaves_a_listener() -> None:
    with Loop("exo", "--pty", "--fault", "disconnect", "--after", "1") as loop, loop.open() as port:
        assert port.ask(READ_ID, 9) == ID_IS_1
        assert port.ask(READ_VOLTAGE, 10) == VOLTAGE[:5]
        with pytest.raises(EOFError):
            port.read()
        code, told, (complaint,) = loop.stop()
        assert (code, told) == (0, []) and "disconnect" in complaint
    with Loop("exo", "--tcp", ANY, "--fault", "disconnect", "--every", "2") as loop:
        for _ in range(3):
            with loop.open() as client:
                assert client.ask(READ_ID, 9) == ID_IS_1
                assert client.ask(READ_VOLTAGE, 10) == VOLTAGE[:5]


def test_faults_from_several_options() -> None:
    with Loop("exo", "--tcp", ANY, "--fault", "echo", "--fault", "duplicate,bad-checksum") as loop:
        assert loop.open().ask(READ_ID, 27) == READ_ID + 2 * (ID_IS_1[:-1] + b"\x03")


# -- the loop behind a listener ---------------------------------------------------------------------------------------


def test_one_client_after_the_other() -> None:
    with Loop("exo", "--tcp", ANY) as loop:
        first, second = loop.open(), loop.open()
        assert first.ask(SET_INDEX, 9) == SET_INDEX_ACK
        assert second.ask(READ_ID, 9, 10.0) == b""
        first.close()
        assert second.read(9) == ID_IS_1, "what waited is answered"
        second.close()
        assert loop.open().ask(READ_INDEX, 10)[7:9] == bytes([0x2C, 0x01])
        assert loop.stop() == (0, [], [])


def test_an_answer_comes_in_one_piece() -> None:
    with Loop("exo", "--tcp", ANY) as loop, loop.open() as client:
        for _ in range(20):
            client.write(DUMP_2)
            assert len(client.some()) == 159


def test_a_client_that_left_without_reading_leaves_no_reply_to_the_next() -> None:
    with Loop("exo", "--tcp", ANY, "--set", "turnaround=0.05") as loop:
        with loop.open() as client:
            client.write(READ_VOLTAGE)
        with loop.open() as client:
            assert client.ask(READ_ID, 9) == ID_IS_1


def test_a_port_in_use() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        done = CliRunner().invoke(cli, ["exo", "--tcp", f"127.0.0.1:{taken.getsockname()[1]}"])
    assert done.exit_code == 3
    assert "in use" in done.output


# -- control, state, end ----------------------------------------------------------------------------------------------


def test_control() -> None:
    with Loop("exo", "--pty", "--control", "control") as loop, loop.open() as port:
        with loop.come("control") as control:
            control.write(b"fault silent\nset 1472 52 03\nnon")
            assert control.some() == b"ok fault silent\nok set 1472 52 03\n"
            assert control.ask(b"sense\n", 200, 0.0).startswith(b"error unknown command 'nonsense'")
            assert port.ask(READ_VOLTAGE, 10, 1.0) == b""
        done = CliRunner().invoke(cli, ["control", "control", "fault", "none"])
        assert (done.exit_code, done.output) == (0, "fault none\n")
        assert port.ask(READ_VOLTAGE, 10) == bytes.fromhex("90 EB 01 05 11 C0 05 52 03 31")
        refused = CliRunner().invoke(cli, ["control", "control", "dance"])
        assert refused.exit_code == 3 and "unknown command 'dance'" in refused.output


def test_what_clients_have_sent_is_told_once_with_its_moments() -> None:
    with Loop("exo", "--pty", "--control", "control") as loop, loop.open() as port:
        port.write(READ_ID)
        loop.sleep(1.5)
        port.write(READ_VOLTAGE)
        (first, one), (second, other) = json.loads(loop.tell("heard").removeprefix("ok "))
        assert [one, other] == [READ_ID.hex(), READ_VOLTAGE.hex()]
        assert second - first == pytest.approx(1.5, abs=0.001)
        assert loop.tell("heard") == "ok []"


def test_an_endless_control_command_is_given_up() -> None:
    with Loop("exo", "--pty", "--control", "control") as loop, loop.come("control") as control:
        control.write(b"x" * 3000)
        control.write(b"x" * 3000)
        with pytest.raises(EOFError):
            control.read()
        assert loop.tell("requests") == "ok requests 0"


def test_a_state_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()
    with Loop("aidin", "--tcp", ANY, "--state", folder / "state.json", "--control", "control") as loop:
        folder.rmdir()
        told = loop.tell("bend index 1 2 3")
        assert loop.until(lambda: loop.ended), "by itself"
        for text in (told, *loop.complained):
            assert f"state file {folder / 'state.json'} cannot be written: No such file" in text
        assert told.startswith("error ") and loop.code == 3


@each_row(
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


def test_what_does_not_fit_for_a_client_that_does_not_read_is_lost_in_whole_replies(tmp_path: Path) -> None:
    """The loop itself: a place that takes nothing for a while, and a line that gives replies of one size."""
    from handctl.sim.engine import serve

    reply, given, taken = b"<" + b"x" * 9998 + b">", [0], bytearray()

    class Line:
        away = hung_up = False

        def take(self) -> bytes:
            given[0] += 1
            return reply if given[0] < 60 else b""

        def next_event(self) -> float:
            return 0.0

        def __getattr__(self, name: str) -> Callable[..., None]:
            return lambda *_: None

    class Place:
        gone, link = False, ""

        def write(self, data: bytes) -> int:
            if given[0] < 30:
                return 0
            taken.extend(data[:3333])
            return len(data[:3333])

        def baud(self) -> None:
            signals.stop = given[0] > 200

        def fileno(self) -> int:
            return quiet.fileno()

        def __getattr__(self, name: str) -> Callable[..., None]:
            return lambda *_: None

    quiet, other = socket.socketpair()
    with serve.Signals() as signals, quiet, other:
        server = serve.Server(serve.Alone(Line())).at(Place())  # type: ignore[arg-type]
        server._loop(None, signals, None)
    replies = bytes(taken).split(b">")[:-1]
    assert len(replies) > 6 and {row + b">" for row in replies} == {reply}


@each_row("option", ["--state", "--control"])
def test_an_empty_path_is_refused(option: str) -> None:
    refused = CliRunner().invoke(cli, ["exo", "--tcp", "127.0.0.1:0", "--duration", "0.1", option, ""])
    assert refused.exit_code == 2 and "it is empty" in refused.output


# -- processes --------------------------------------------------------------------------------------------------------


def ask(port: serial.Serial, request: bytes, count: int) -> bytes:
    port.write(request)
    return port.read(count)


def receive(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count and (part := client.recv(count - len(data))):
        data += part
    return data


def connected(link: str) -> socket.socket:
    host, port = link.removeprefix("tcp://").rsplit(":", 1)
    return socket.create_connection((host, int(port)), timeout=PATIENCE)


@pytest.mark.real
def test_a_terminal_of_the_system(tmp_path: Path) -> None:
    """Its speed, as pyserial sets it; power by a signal; its control socket, and its end."""
    control, state = tmp_path / "control", tmp_path / "hand.json"
    with Simulator("--pty", "--set", "baud=57600", "--control", control, "--state", state) as server:
        assert server.link.startswith("/dev/")
        descriptor = os.open(server.link, os.O_RDWR | os.O_NOCTTY)  # as a shell does: it sets no speed
        os.write(descriptor, READ_ID)
        assert select.select([descriptor], [], [], PATIENCE)[0] and os.read(descriptor, 100) == ID_IS_1
        os.close(descriptor)
        with serial.Serial(server.link, 57600, timeout=PATIENCE) as port:
            assert ask(port, READ_ID, 9) == ID_IS_1 and ask(port, READ_VOLTAGE, 10) == VOLTAGE
            assert len(ask(port, DUMP_2, 159)) == 159
            for speed in (115200, 12345):
                port.baudrate = speed
                with briefly(port):
                    assert ask(port, READ_ID, 9) == b""
            port.baudrate = 57600
            assert ask(port, bytes.fromhex("EB 90 01 04 12 E9 03 00 03"), 9)
            assert ask(port, SAVE, 18) == SAVE_ACK + SAVED
            server.process.send_signal(signal.SIGUSR1)
            port.baudrate = 115200
            wait_until(lambda: ask(port, READ_ID, 9) == ID_IS_1)
        assert server.stop() == (0, "", "")
    assert json.loads(state.read_text())["kind"] == "exo" and not control.exists()
    gone = CliRunner().invoke(cli, ["control", str(control), "help"])
    assert gone.exit_code == 3 and str(control) in gone.output


@pytest.mark.real
def test_a_listener_of_the_system_and_what_a_kill_leaves(tmp_path: Path) -> None:
    """The next client, the next server with its state, and the socket of the one that was killed."""
    control, words = tmp_path / "control", ("--tcp", ANY, "--state", tmp_path / "hand.json", "--control")
    control.write_text("not a socket")
    taken = run("sim", "exo", *words, control)
    assert taken.code == 3 and control.read_text() == "not a socket"
    control.unlink()
    with Simulator(*words, control) as server:
        assert server.link.startswith("tcp://127.0.0.1:")
        taken = run("sim", "exo", *words, control)
        assert taken.code == 3 and "another simulator" in taken.err
        with connected(server.link) as first, connected(server.link) as second:
            second.sendall(READ_ID)
            first.sendall(SET_INDEX)
            assert receive(first, 9) == SET_INDEX_ACK
            first.close()
            assert receive(second, 9) == ID_IS_1
        with serial.serial_for_url(server.link.replace("tcp", "socket"), timeout=PATIENCE) as third:
            assert ask(third, READ_INDEX, 10)[7:9] == bytes([0x2C, 0x01])
        server.stop(signal.SIGKILL)
    assert control.exists()
    with Simulator(*words, control) as server:
        assert run("sim", "control", control, "requests").out == "requests 0\n"
        with connected(server.link) as client:
            client.sendall(READ_INDEX)
            assert receive(client, 10)[7:9] == bytes([0x2C, 0x01])
        assert server.stop(signal.SIGINT) == (0, "", "")


@pytest.mark.real
def test_a_terminal_that_hangs_up() -> None:
    """The client still gets what was on its way, then the end; the server ends in order."""
    with Simulator("--pty", "--fault", "disconnect", "--after", "1") as server:
        with serial.Serial(server.link, 115200, timeout=PATIENCE) as port:
            assert ask(port, READ_ID, 9) == ID_IS_1
            assert ask(port, READ_VOLTAGE, 5) == VOLTAGE[:5]
            with pytest.raises((serial.SerialException, OSError)):
                port.read(1)
        server.process.wait(timeout=PATIENCE)
        code, out, err = server.stop()
    assert (code, out, err.count("\n")) == (0, "", 1) and "disconnect" in err


# -- a foreign client -------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_a_foreign_driver_reads_and_moves_the_hand(tmp_path: Path) -> None:
    """pyrh56 is an independent client of the sibling hand; what it reads beyond the exo's registers is 0 here."""
    control = str(tmp_path / "control")
    with Simulator("--pty", "--wire", "115200", "--control", control) as server:
        with RH56Driver(server.link, timeout=PATIENCE) as hand:
            assert hand.read_angle() == [110, 220, 330, 440, 550, 660]
            assert hand.read_force() == [-11, 12, -13, 14, -15, 0]
            assert hand.read_current() == [21, 22, 23, 24, 25, 0]
            assert hand.read_temperature() == [31, 32, 33, 34, 35, 0]
            assert hand.read_error() == [0, 0, 0, 0, 0, 0]
            assert hand.read_voltage() == 558
            hand.move_to([500, 400, 300, 200, 100, 660])
            target = [500, 400, 300, 200, 100]
            assert hand.wait_until_reached([*target, None], timeout=PATIENCE, tolerance=0)[:5] == target
            hand.save_parameters()
        for fault in ("split", "dribble", "echo", "slow"):
            assert send_control(control, f"fault {fault}") == f"ok fault {fault}"
            with RH56Driver(server.link, timeout=PATIENCE) as hand:
                assert hand.read_angle()[:5] == target, fault
        for verb in ("ping", "state"):
            words = [sys.executable, "-m", "rh56_sdk", "--port", server.link, verb]
            done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, check=False)
            assert done.returncode == 0, done.stdout + done.stderr
    with Simulator("--pty", "--fault", "locked-rotor") as server, RH56Driver(server.link, timeout=PATIENCE) as hand:
        assert hand.read_error() == [1, 0, 0, 0, 0, 0]
        hand.clear_error()
        assert hand.read_error() == [0, 0, 0, 0, 0, 0]
