"""A bus as a server: several clients at once, on a terminal, on TCP and at slcan adapters."""

from __future__ import annotations

import socket
from pathlib import Path

import can
import pytest
import serial
from click.testing import CliRunner

from handctl.sim.bus.bus_file import EXAMPLE
from handctl.sim.cli import cli
from tests.support.bus_file import text
from tests.support.cli import PATIENCE, Simulator, wait_until
from tests.support.each_row import each_row
from tests.support.virtual import Loop

ASK_3 = bytes.fromhex("EB 90 03 04 11 E8 03 01 04")
ID_IS_3 = bytes.fromhex("90 EB 03 04 11 E8 03 03 06")
ASK_5 = bytes.fromhex("EB 90 05 04 11 E8 03 01 06")
ID_IS_5 = bytes.fromhex("90 EB 05 04 11 E8 03 05 0A")
TWO = ({"kind": "exo", "id": 3}, {"kind": "wrist", "id": 5})


ANY = "127.0.0.1:0"


def file_of(folder: Path, content: str) -> Path:
    path = folder / "bus.toml"
    path.write_text(content, encoding="utf-8")
    return path


def test_a_terminal_and_two_clients_on_tcp_share_the_line(tmp_path: Path) -> None:
    file = file_of(tmp_path, text("half-duplex", TWO))
    with Loop("bus", file, "--pty", "--tcp", ANY) as loop:
        assert len(loop.links) == 2 and loop.link == loop.links[0]
        port, one, two = loop.open(115200), loop.open(link=loop.links[1]), loop.open(link=loop.links[1])
        assert port.ask(ASK_3, 9) == ID_IS_3
        assert one.read(18) == two.read(18) == ASK_3 + ID_IS_3
        assert one.ask(ASK_5, 9) == ID_IS_5
        assert port.read(18) == two.read(18) == ASK_5 + ID_IS_5
        one.close()
        assert two.ask(ASK_3, 9) == ID_IS_3
        port.reset_input_buffer()
        port.baudrate = 57600
        assert port.ask(ASK_3, 9, 1.0) != ID_IS_3, "a terminal has a speed"
        assert loop.stop() == (0, [], [])


def test_control_reaches_each_device(tmp_path: Path) -> None:
    file = file_of(tmp_path, text("half-duplex", TWO))
    with Loop("bus", file, "--tcp", ANY, "--control", "control") as loop:
        assert loop.tell("devices") == "ok 1 exo, 2 wrist"
        assert loop.tell("device 2 fault silent") == "ok fault silent"
        with loop.open() as client:
            assert client.ask(ASK_5 + ASK_3, 100, 1.0) == ID_IS_3
        assert ASK_3.hex() in loop.tell("heard")
        assert "Known: power-cycle" in loop.tell("jump")


def test_the_help_names_every_key_and_its_example_runs(tmp_path: Path) -> None:
    shown = CliRunner().invoke(cli, ["bus", "-h"]).output
    for word in ("wire", "first_byte_lost", "every_ms", "bluetooth", "kind", "slcan-tcp"):
        assert word in shown
    with Loop("bus", file_of(tmp_path, EXAMPLE), "--tcp", ANY) as loop:
        assert loop.open().read(9) == bytes.fromhex("EB 90 02 04 30 FC 03 02 37")


@each_row(
    ("content", "arguments", "complaint"),
    [
        (EXAMPLE, [], "No endpoint given. Give --pty, --tcp HOST:PORT, --slcan-pty or --slcan-tcp HOST:PORT"),
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
def test_foreign_clients_of_one_bus(tmp_path: Path) -> None:
    """pyserial beside a plain socket, then python-can at two adapters of one bus with two devices."""
    with Simulator(file_of(tmp_path, text("half-duplex", TWO)), "--pty", "--tcp", ANY, kind="bus") as server:
        host, _, number = server.links[1].removeprefix("tcp://").rpartition(":")
        with (
            serial.Serial(server.link, 115200, timeout=PATIENCE) as port,
            socket.create_connection((host, int(number)), timeout=PATIENCE) as client,
        ):
            client.sendall(ASK_5)
            heard = b""
            while len(heard) < 9:
                heard += client.recv(9 - len(heard))
            assert heard == ID_IS_5
            assert port.read(18) == ASK_5 + ID_IS_5
    devices = [{"kind": "wrist", "id": 1}, {"kind": "wrist", "id": 2}]
    masters = [{"ask": "10FF0002#02", "every_ms": 20}]
    file = file_of(tmp_path, text("clean", devices, masters, wire="can"))
    with Simulator(file, "--slcan-pty", "--slcan-tcp", ANY, kind="bus") as server:
        wanted = {(0x10FF0001, b"\xa7\xfe"), (0x10FF0002, b"\x02"), (0x10FF0002, b"\xaa\xfe")}
        for link in server.links:
            channel = link.removeprefix("can:slcan:")
            with can.Bus(interface="slcan", channel=channel, bitrate=1000000, sleep_after_open=0) as bus:
                bus.send(can.Message(arbitration_id=0x10FF0001, data=[2]))
                came = set()

                def all_came(bus: can.BusABC = bus, came: set[tuple[int, bytes]] = came) -> bool:
                    if (row := bus.recv(0.01)) is not None:
                        came.add((row.arbitration_id, bytes(row.data)))
                    return came >= wanted

                wait_until(all_came)
        assert server.stop() == (0, "", "")
