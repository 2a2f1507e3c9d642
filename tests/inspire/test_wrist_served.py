"""`handctl sim wrist` as a server on serial and as a CAN adapter, with handctl and foreign programs as its clients."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
import serial

from handctl.sim.engine.serve import send_control
from tests.inspire.wrist_commands import POWER_ON, SETTINGS, prepare, sent_frames, written_frames
from tests.support.cli import (
    PATIENCE,
    Result,
    Simulator,
    clean_environment,
    frame,
    kept,
    run,
    run_program,
    s16,
)
from tests.support.cli import (
    start as started,
)
from tests.support.each_row import each_row

Start = Callable[..., Simulator]
PLACES: dict[str, tuple[str, ...]] = {
    "pty": ("--pty",),
    "tcp": ("--tcp", "127.0.0.1:0"),
    "slcan-pty": ("--slcan-pty",),
    "slcan-tcp": ("--slcan-tcp", "127.0.0.1:0"),
}
SLCAN = ("slcan-pty", "slcan-tcp")


@pytest.fixture
def start() -> Iterator[Start]:
    running: list[Simulator] = []

    def starter(place: str, *args: str | Path) -> Simulator:
        running.append(Simulator(*PLACES[place], *args, kind="wrist"))
        return running[-1]

    yield starter
    for simulator in running:
        simulator.stop()


@pytest.fixture(scope="module")
def links() -> Iterator[dict[str, str]]:
    """Healthy wrists, one a place, that several tests read from."""
    simulators = {place: Simulator(*args, kind="wrist") for place, args in PLACES.items()}
    yield {place: simulator.link for place, simulator in simulators.items()}
    for simulator in simulators.values():
        simulator.stop()


places = each_row("place", PLACES)


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulator that a busy machine keeps waiting for more than a second is an adapter all the same."""
    monkeypatch.setattr("handctl.link.slcan.ANSWER_SECONDS", 10.0)


# -- serving ----------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_the_ready_line_is_the_link_to_use(start: Start) -> None:
    patterns = {
        "pty": r"/dev/\S+", "tcp": r"tcp://127\.0\.0\.1:\d+",
        "slcan-pty": r"can:slcan:/dev/\S+", "slcan-tcp": r"can:slcan:socket://127\.0\.0\.1:\d+",
    }  # fmt: skip
    for place, number in zip(PLACES, (signal.SIGTERM, signal.SIGINT) * 2, strict=True):
        simulator = start(place)
        assert re.fullmatch(patterns[place], simulator.link)
        assert simulator.stop(number) == (0, "", "")


# -- handctl as the client --------------------------------------------------------------------------------------------


@pytest.mark.real
@places
def test_dump_is_the_same_as_in_process(links: dict[str, str], place: str) -> None:
    served = run_program("wrist", "dump", "-p", links[place], "--json")
    assert (served.code, served.err) == (0, "")
    assert served.rows == run("wrist", "dump", "-p", "fake://wrist?clock=virtual", "--json").rows
    assert served.json["device"] == {
        "kind": "wrist",
        "link": links[place],
        "fake": False,
        "id": 1,
        "model": "wrist module",
    }
    counters = served.json["counters"]
    asked = (
        3 if place in SLCAN else 2 if place == "tcp" else 1
    )  # behind TCP may be any speed: a harmless question comes first
    assert counters["sent"] - counters["retries"] == asked  # a busy machine may answer late


@pytest.mark.real
@places
def test_status_and_scan(links: dict[str, str], place: str) -> None:
    status = run("wrist", "status", "--check", "-p", links[place], "--json")
    assert status.values == {name: value for name, (_, value, _, _) in POWER_ON.items()}
    scan = run("wrist", "scan", "-p", links[place], "--json")
    (row,) = scan.rows
    speed = 115200 if place == "pty" else None
    assert (row["family"], row["link"], row["baud"], row["id"]) == ("wrist", links[place], speed, 1)
    assert run("wrist", "hand-read", "1472", "2", "-p", links[place], "--format", "plain").out == "32 02\n"
    rows, end = run("wrist", "watch", "yaw_set", "--count", "5", "--rate", "50", "-p", links[place], "--json").stream
    assert ([row["value"] for row in rows], end["stream"]["samples"]) == ([11.0] * 5, 5)


@pytest.mark.real
@each_row("place", ["slcan-pty"])
def test_move_and_what_it_leaves(start: Start, tmp_path: Path, place: str) -> None:
    """Every further verb works on the moved wrist."""
    prepare(tmp_path)
    link, trace = start(place).link, tmp_path / "t.txt"

    def do(*args: str | Path) -> Result:
        result = run("wrist", *args, "-p", link, "--json")
        assert result.code == 0, result
        return result

    args = ("--pitch", "-10", "--yaw", "10", "--time", "300")
    assert do("move", *args, "--trace", trace).values == {"pitch_actual": -10.0, "yaw_actual": 10.0}
    serial_frame, can_frame = "EB 90 01 09 31 0E 04 E8 03 18 FC 2C 01 79", "15038001 [6] E8 03 18 FC 2C 01"
    assert written_frames(trace) == [can_frame if place in SLCAN else serial_frame]
    assert do("get", *SETTINGS).values == {"yaw_set": 10.0, "pitch_set": -10.0, "move_time": 300}
    assert do("snapshot", tmp_path / "s.json").code == 0
    assert do("center", "--time", "100").values == {"pitch_actual": 0.0, "yaw_actual": 0.0}
    assert run("wrist", "diff", tmp_path / "s.json", "--setpoints", "-p", link).code == 7
    assert do("restore", tmp_path / "s.json", "--setpoints", "-y").values["yaw_set"] == 10.0
    assert do("diff", tmp_path / "s.json", "--setpoints").rows == []
    assert do("hand-write", "1486", "F401", "-y").rows[0]["raw"] == "F4 01"
    assert do("set", "move_time=1234", "-y").values == {"move_time": 1234}, "asked while the axes are on their way"


@pytest.mark.real
def test_a_wrong_bitrate_is_named(links: dict[str, str], start: Start) -> None:
    for place in SLCAN:
        slow = start(place, "--set", "bitrate=500000").link
        result = run("wrist", "get", "pitch_actual", "-p", slow, "--json", "--timeout", "0.1", "--retries", "0")
        assert result.code == 4
        assert "bitrate" in result.error["hint"] and "500000" in result.error["hint"]
        right = run("wrist", "get", "pitch_actual", "-p", f"{slow}?bitrate=500000", "--format", "plain")
        assert right.out == "-3.45\n"
    fast = f"{links['slcan-pty']}?bitrate=500000"
    assert run("wrist", "get", "pitch_actual", "-p", fast, "--timeout", "0.1", "--retries", "0").code == 4
    assert run("wrist", "get", "pitch_actual", "-p", links["slcan-pty"]).code == 0


@pytest.mark.real
def test_a_wrong_serial_speed(start: Start) -> None:
    link = start("pty", "--set", "baud=57600").link
    result = run("wrist", "get", "pitch_actual", "-p", link, "--json", "--timeout", "0.1")
    assert result.code in (4, 5)
    assert "wrist scan" in result.error["hint"]
    assert run("wrist", "get", "pitch_actual", "-p", link, "--baud", "57600", "--format", "plain").out == "-3.45\n"


@pytest.mark.real
@each_row("place", ["pty", "slcan-pty"])
def test_the_second_opener_is_told_that_the_port_is_busy(start: Start, place: str) -> None:
    link = start(place).link
    first = started(
        ["wrist", "watch", "yaw_set", "-p", link, "--json"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert first.stdout is not None
    first.stdout.readline()
    try:
        second = run_program("wrist", "get", "yaw_set", "-p", link, "--json")
        assert (second.code, second.error["code"]) == (3, "busy"), second
        assert link in second.error["text"]
    finally:
        first.send_signal(signal.SIGINT)
        out, _ = first.communicate(timeout=30)
    assert first.returncode == 130
    assert all(json.loads(line).get("value", 11.0) == 11.0 for line in out.splitlines())
    assert run("wrist", "get", "yaw_set", "-p", link).code == 0


@pytest.mark.real
@places
def test_a_server_that_goes_away_is_exit_3(start: Start, place: str) -> None:
    simulator = start(place)
    process = started(
        ["wrist", "watch", "yaw_set", "--rate", "100", "-p", simulator.link, "--json"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    first = process.stdout.readline()
    with kept(simulator.link):
        simulator.process.send_signal(signal.SIGKILL)
        out, err = process.communicate(timeout=30)
        result = Result(process.returncode, first + out, err)
        rows, end = result.stream
        assert result.code == 3, result
        assert all(row.get("value") == 11.0 for row in rows)
        assert end["messages"][-1]["level"] == "error"
        assert "Traceback" not in result.err
        assert run("wrist", "get", "yaw_set", "-p", simulator.link).code == 3


@pytest.mark.real
@places
def test_an_adapter_that_hangs_up_is_exit_3(start: Start, place: str) -> None:
    result = run("wrist", "dump", "-p", start(place, "--fault", "disconnect").link, "--json")
    assert (result.code, result.error["code"]) == (3, "lost")


@pytest.mark.real
def test_errors_of_the_bus(start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each condition has its own code and its own next step, whichever way the adapter has of saying so."""
    monkeypatch.setattr("handctl.link.slcan.ANSWER_SECONDS", 1.0)  # one of them is silence
    panel = tmp_path / "panel"
    link = start("slcan-pty", "--control", panel).link
    for fault, exit_code, code in (
        ("no-ack", 4, "no-ack"), ("no-ack,queue", 4, "no-ack"), ("no-ack,no-status", 4, "bel"), ("no-ack,reports", 4, "no-ack"),
        ("bus-off", 3, "bus-off"), ("bus-off,queue", 3, "bus-off"), ("bus-off,reports", 3, "bus-off"), ("bel", 3, "refused"),
        ("twin-id", 4, "bus-errors"), ("damaged-lines", 5, "damaged"), ("no-adapter", 3, "not-slcan"),
        ("silent", 4, "no-answer"), ("loopback", 5, "echo"),
    ):  # fmt: skip
        assert send_control(str(panel), f"fault {fault}").startswith("ok")
        wait = "0.3" if exit_code == 4 else "1.5"  # a reply may come late
        result = run("wrist", "get", "yaw_actual", "-p", link, "--timeout", wait, "--retries", "0", "--json")
        assert (result.code, result.error["code"]) == (exit_code, code), (fault, result)
        assert result.error["hint"], fault
        if code in ("no-ack", "bel", "no-answer"):
            assert "termination" in result.error["hint"] and "500000" in result.error["hint"], fault
        send_control(str(panel), "fault none")


@pytest.mark.real
def test_a_busy_bus_does_not_disturb(start: Start, tmp_path: Path) -> None:
    link, trace = start("slcan-tcp", "--set", "traffic=500", "--wire", "1").link, tmp_path / "t.txt"
    result = run("wrist", "dump", "-p", link, "--json", "--trace", trace)
    assert result.values == {name: value for name, (_, value, _, _) in POWER_ON.items()}
    moved = run("wrist", "move", "--yaw", "5", "--time", "150", "-p", link, "--json")
    assert (moved.code, moved.values["yaw_actual"]) == (0, 5.0)
    assert moved.json["counters"]["foreign_frames"] > 30


# -- foreign clients --------------------------------------------------------------------------------------------------


def plain_bus(link: str) -> can.BusABC:
    return can.Bus(interface="slcan", channel=link.removeprefix("can:slcan:"), bitrate=1000000, sleep_after_open=0)


def ask(bus: can.BusABC, identifier: int, *data: int) -> bytes:
    bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=True))
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        message = bus.recv(0.1)
        if message is not None:
            assert (message.arbitration_id, message.is_extended_id) == (identifier, True)
            return bytes(message.data)
    raise AssertionError("no answer")


@pytest.mark.real
@each_row("place", SLCAN)
def test_a_plain_python_can_bus(start: Start, place: str) -> None:
    """1020 and 1024 with the identifiers of the manual (wrist §2.3.1), a write, and what handctl then reads."""
    link = start(place).link
    with plain_bus(link) as bus:
        assert ask(bus, 0x10FF0001, 2) == s16(-345)
        assert ask(bus, 0x11000001, 4) == s16(111, 222)
        assert ask(bus, 0x15038001, 0xE8, 0x03, 0x18, 0xFC) == b""
        assert ask(bus, 0x11038001, 6) == s16(1000, -1000, 700)
    assert run("wrist", "get", "yaw_set", "pitch_set", "-p", link, "--format", "plain").lines == ["10.0", "-10.0"]
    assert run("wrist", "move", "--pitch", "-5", "--yaw", "5", "--time", "100", "-p", link).code == 0
    with plain_bus(link) as bus:
        assert ask(bus, 0x10FF0001, 4) == s16(-500, 500)


@pytest.mark.real
def test_pyserial_on_both_wires(links: dict[str, str]) -> None:
    """On CAN `T` and 8 digits of the identifier, the form a person types at an slcan adapter."""
    with serial.Serial(links["pty"], 115200, timeout=PATIENCE) as port:
        port.write(frame("EB 90 01 04 30 00 04 04 3D"))
        assert port.read(12) == frame("90 EB 01 07 30 00 04 6F 00 DE 00 89")
    with serial.Serial(links["slcan-pty"].removeprefix("can:slcan:"), 115200, timeout=PATIENCE) as port:
        port.write(b"\rC\rS8\rO\rT11000001104\r")
        data = b""
        while b"T11000001" not in data or not data.endswith(b"\r"):
            more = port.read(1)
            assert more, data
            data += more
    assert b"T1100000146F00DE00\r" in data


@pytest.mark.real
def test_handctl_and_a_foreign_client_take_turns(links: dict[str, str], tmp_path: Path) -> None:
    """An answer that nobody fetched belongs to nobody."""
    trace = tmp_path / "t.txt"
    for _ in range(3):
        with plain_bus(links["slcan-pty"]) as bus:
            bus.send(can.Message(arbitration_id=0x10FF0001, data=[2], is_extended_id=True))
        result = run("wrist", "get", "yaw_set", "-p", links["slcan-pty"], "--json", "--trace", trace)
        assert result.values == {"yaw_set": 11.0}, result
    assert sent_frames(trace) == ["11038001 [1] 02"]
