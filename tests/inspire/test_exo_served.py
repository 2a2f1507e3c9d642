"""`handctl sim exo` as a server, with handctl and foreign programs as its clients, in real time."""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial
from rh56_sdk import RH56Driver

from tests.support.cli import (
    PATIENCE,
    POWER_ON,
    Result,
    Simulator,
    clean_environment,
    frame,
    kept,
    pairs,
    run,
    run_program,
    sent,
)
from tests.support.cli import (
    start as started,
)
from tests.support.each_row import each_row

Start = Callable[..., Simulator]
PLACES: dict[str, tuple[str, ...]] = {"pty": ("--pty",), "tcp": ("--tcp", "127.0.0.1:0")}


@pytest.fixture
def start() -> Iterator[Start]:
    running: list[Simulator] = []

    def starter(*args: str | Path) -> Simulator:
        running.append(Simulator(*args))
        return running[-1]

    yield starter
    for simulator in running:
        simulator.stop()


@pytest.fixture(scope="module")
def pty() -> Iterator[str]:
    """A healthy hand on a pty that several tests read from."""
    with Simulator("--pty") as simulator:
        yield simulator.link


def control(path: Path, *words: str) -> str:
    done = run("sim", "control", path, *words)
    assert done.code == 0, done
    return done.out.strip()


# -- serving ----------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_the_ready_line_and_the_orderly_end(start: Start) -> None:
    on_pty, on_tcp = start("--pty"), start("--tcp", "127.0.0.1:0")
    assert re.fullmatch(r"/dev/\S+", on_pty.link)
    assert re.fullmatch(r"tcp://127\.0\.0\.1:\d+", on_tcp.link)
    assert on_pty.stop(signal.SIGTERM) == (0, "", "")
    assert on_tcp.stop(signal.SIGINT) == (0, "", "")


@each_row("args", [("--pty", "--tcp", "127.0.0.1:0"), (), ("--tcp", "nowhere"), ("--pty", "--fault", "nosuch"),
                   ("--pty", "--set", "nosuch=1"), ("--pty", "--seed", "x")])  # fmt: skip
def test_impossible_servers_are_usage_errors(args: tuple[str, ...]) -> None:
    done = run("sim", "exo", *args)
    assert (done.code, done.out) == (2, "")


# -- handctl as the client --------------------------------------------------------------------------------------------


@pytest.mark.real
def test_dump_on_a_pty_is_the_same_as_in_process(pty: str) -> None:
    served = run_program("exo", "dump", "-p", pty, "--json")
    assert served.code == 0
    assert served.rows == run("exo", "dump", "-p", "fake://exo?clock=virtual", "--json").rows
    assert served.json["device"] == {"kind": "exo", "link": pty, "fake": False, "id": 1, "model": "EH55BF1"}
    counters = served.json["counters"]
    assert counters["sent"] - counters["retries"] == 2  # a busy machine may answer late


@pytest.mark.real
def test_a_wrong_speed_is_found_and_named(start: Start) -> None:
    link = start("--pty", "--set", "baud=57600").link
    result = run("exo", "get", "id", "-p", link, "--json")
    assert (result.code, result.error["code"]) == (5, "wrong-speed"), result
    assert "--baud 57600" in result.error["hint"]
    assert run("exo", "get", "id", "-p", link, "--baud", "57600", "--format", "plain").out == "1\n"
    assert run("exo", "scan", "-p", link, "--json").rows[0]["baud"] == 57600


@pytest.mark.real
def test_the_second_opener_is_told_that_the_port_is_busy(start: Start) -> None:
    link = start("--pty").link
    first = started(
        ["exo", "watch", "id", "-p", link, "--json"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert first.stdout is not None
    first.stdout.readline()
    try:
        second = run_program("exo", "get", "id", "-p", link, "--json")
        assert (second.code, second.error["code"]) == (3, "busy")
        assert link in second.error["text"]
    finally:
        first.send_signal(signal.SIGINT)
        first.communicate(timeout=30)
    assert first.returncode == 130
    assert run_program("exo", "get", "id", "-p", link).code == 0


@pytest.mark.real
@each_row("where, number", [(PLACES["pty"], signal.SIGKILL), (PLACES["tcp"], signal.SIGTERM)])
def test_a_server_that_goes_away_is_exit_3(start: Start, where: tuple[str, ...], number: signal.Signals) -> None:
    simulator = start(*where)
    process = started(
        ["exo", "watch", "id", "--rate", "100", "-p", simulator.link, "--json"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    first = process.stdout.readline()
    with kept(simulator.link):
        simulator.process.send_signal(number)
        out, err = process.communicate(timeout=30)
        result = Result(process.returncode, first + out, err)
        rows, end = result.stream
        assert result.code == 3, result
        assert all(row.get("value") == 1 for row in rows)
        assert end["messages"][-1]["code"] == "lost"
        assert "Traceback" not in result.err
        assert run("exo", "get", "id", "-p", simulator.link).code == 3


@pytest.mark.real
@each_row("where", PLACES.values())
def test_a_line_that_hangs_up_is_exit_3(start: Start, where: tuple[str, ...]) -> None:
    link = start(*where, "--fault", "disconnect", "--after", "1").link
    result = run("exo", "dump", "-p", link, "--json")
    assert (result.code, result.error["code"]) == (3, "lost")


@pytest.mark.real
def test_pyserial_urls_reach_the_server(start: Start, tmp_path: Path) -> None:
    tcp = start("--tcp", "127.0.0.1:0").link.removeprefix("tcp://")
    assert run("exo", "get", "id", "-p", f"socket://{tcp}", "--format", "plain").out == "1\n"
    link = start("--pty").link
    log = tmp_path / "spy.txt"
    assert run("exo", "get", "id", "-p", f"spy://{link}?file={log}", "--format", "plain").out == "1\n"
    assert "EB 90 01 04 11 E8 03 01" in log.read_text()


@pytest.mark.real
def test_speed_change_save_power_cycle(start: Start, tmp_path: Path) -> None:
    """Through the control socket: the hand speaks the new speed only after save and a power cycle."""
    panel = tmp_path / "panel"
    link = start("--pty", "--control", panel).link
    assert run("exo", "baud", "19200", "-y", "--save", "-p", link).code == 0
    assert run("exo", "get", "baud_code", "-p", link, "--format", "plain").out == "2\n"
    control(panel, "power-cycle")
    silent = run("exo", "get", "id", "-p", link, "--json")
    assert (silent.code, silent.error["code"]) == (5, "wrong-speed")
    assert "--baud 19200" in silent.error["hint"]
    assert run("exo", "get", "id", "-p", link, "--baud", "19200", "--format", "plain").out == "1\n"


@pytest.mark.real
def test_verify_waits_for_the_operator(start: Start, tmp_path: Path) -> None:
    panel = tmp_path / "panel"
    link = start("--pty", "--control", panel).link
    process = started(
        ["exo", "baud", "57600", "--save", "--verify", "-y", "-p", link, "--json"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stderr is not None
    asked = b""
    while b"Switch the hand's power off and on" not in asked:
        line = process.stderr.readline()
        assert line, asked
        asked += line
    control(panel, "power-cycle")
    out, err = process.communicate(timeout=30)
    result = Result(process.returncode, out, err)
    assert (result.code, result.rows[-1]["value"]) == (0, 57600)


@pytest.mark.real
def test_power_off_and_faults_from_the_panel(start: Start, tmp_path: Path) -> None:
    panel = tmp_path / "panel"
    link = start("--pty", "--control", panel).link
    control(panel, "power", "off")
    assert run("exo", "get", "id", "-p", link, "--timeout", "0.1", "--retries", "0", "--baud", "115200").code == 4
    control(panel, "power", "on")
    control(panel, "set", "1606", "01")
    control(panel, "temperature", "thumb", "72")
    result = run("exo", "status", "--check", "-p", link, "--json")
    assert result.code == 7
    assert (result.values["error.little"], result.values["error.thumb"]) == (1, 2)
    assert result.values["temperature.thumb"] in (71, 72)  # it cools
    control(panel, "fault", "bad-checksum")
    assert run("exo", "get", "id", "-p", link, "--baud", "115200", "--json").error["code"] == "bad-checksum"
    control(panel, "fault", "none")
    assert run("exo", "get", "id", "-p", link).code == 0


def test_wire_time_of_a_dump(tmp_path: Path) -> None:
    """Two transactions of 195 bytes take 16.93 ms at 115200 (dossier §6); the host adds none."""
    trace = tmp_path / "t.txt"
    dump = run("exo", "dump", "-p", "fake://exo?clock=virtual&wire=115200", "--trace", trace, "--json")
    assert dump.json["counters"]["sent"] == 2
    times = [float(line.split()[0]) for line in trace.read_text().splitlines() if not line.startswith("#")]
    assert 0.0165 <= times[-1] - times[0] <= 0.0174


# -- foreign clients --------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_pyrh56_reads_the_same_hand_that_handctl_changed(start: Start) -> None:
    link = start("--pty").link
    assert run("exo", "position", "700", "600", "500", "400", "300", "--wait", "3", "-y", "-p", link).code == 0
    driver = RH56Driver(link, timeout=PATIENCE)
    driver.connect(verify=False)
    try:
        assert driver.read_angle() == [700, 600, 500, 400, 300, 660]
        assert driver.read_force()[:5] == [-11, 12, -13, 14, -15]
        assert driver.read_error()[:5] == [0, 0, 0, 0, 0]
        assert driver.read_temperature()[:5] == [31, 32, 33, 34, 35]
    finally:
        driver.disconnect()
    assert run("exo", "get", "position_actual.little", "-p", link, "--format", "plain").out == "700\n"


@pytest.mark.real
def test_pyserial_a_shell_and_a_plain_socket(pty: str, start: Start) -> None:
    with serial.Serial(pty, 115200, timeout=PATIENCE) as port:
        port.write(frame("EB 90 01 04 11 0A 06 0C 32"))
        assert port.read(20) == frame("90 EB 01 0F 11 0A 06 6E 00 DC 00 4A 01 B8 01 26 02 94 02 3D")
        port.write(frame("EB 90 01 04 11 46 06 05 67"))
        assert port.read(13) == frame("90 EB 01 08 11 46 06 00 00 00 00 00 66")
    descriptor = os.open(pty, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(descriptor, frame("EB 90 01 04 11 E8 03 01 02"))
        came = b""
        while len(came) < 9 and select.select([descriptor], [], [], PATIENCE)[0]:
            came += os.read(descriptor, 100)
        assert came == frame("90 EB 01 04 11 E8 03 01 02")
    finally:
        os.close(descriptor)
    host, port_number = start("--tcp", "127.0.0.1:0").link.removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port_number)), timeout=PATIENCE) as client:
        client.sendall(frame("EB 90 01 04 11 C0 05 02 DD"))
        data = b""
        while len(data) < 10:
            data += client.recv(100)
    assert data == frame("90 EB 01 05 11 C0 05 2E 02 0C")


@pytest.mark.real
def test_handctl_and_a_foreign_client_take_turns(pty: str, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    for _ in range(3):
        with serial.Serial(pty, 115200, timeout=PATIENCE) as port:
            port.write(frame("EB 90 01 04 11 C0 05 02 DD"))  # asked, and its answer left unread
        result = run("exo", "get", "temperature", "-p", pty, "--json", "--trace", trace)
        assert result.values == pairs(["temperature"])
    assert sent(trace) == [frame("EB 90 01 04 11 52 06 05 73"), frame("EB 90 01 04 11 46 06 12 74")]  # then who answers
    assert POWER_ON["temperature"][0] == 1618
