"""The simulated AIDIN-hand as a TCP server for a client that knows nothing of this package: plain bytes and json."""

from __future__ import annotations

import json
import socket
from typing import Any

import pytest
from click.testing import CliRunner

from handctl.sim.cli import cli
from tests.support.cli import PATIENCE, Simulator
from tests.support.virtual import Client, Loop

TCP = ("--tcp", "127.0.0.1:0")


def line(client: Client) -> dict[str, Any]:
    """The next one."""
    return dict(json.loads(client.read_until(b"\n")))


def ask(client: Client, text: str) -> dict[str, Any]:
    client.write(text.encode())
    return line(client)


def test_stream_and_a_move() -> None:
    """20 lines a second; homing takes its 3 s in test_aidin.py."""
    with Loop("aidin", *TCP, "--set", "start=open", "--set", "rate=20") as loop, loop.open() as client:
        assert line(client)["motor_pos"] == [0] * 15
        began = loop.moment
        for _ in range(20):
            ask(client, '{"hand_mode":2}\n')
        assert loop.moment - began == pytest.approx(20 / 20, abs=0.001)
        target = [20000 + 100 * number for number in range(15)]
        client.write(json.dumps({"hand_mode": 10, "hand_TP_cmd": target}).encode())
        assert target in [line(client)["motor_pos"] for _ in range(60)]


@pytest.mark.parametrize(
    ("options", "seconds"), [((), 0.0), (("--set", "chunk=400", "--set", "nagle=1"), 0.04)], ids=["quick", "nagle"]
)
def test_polling_is_quick_and_nagle_is_slow(options: tuple[str, ...], seconds: float) -> None:
    with Loop("aidin", *TCP, "--set", "exchange=poll", *options) as loop, loop.open() as client:
        began = loop.moment
        for _ in range(15):
            ask(client, "{}")
        assert (loop.moment - began) / 15 == pytest.approx(seconds, abs=0.002)


def test_a_second_client_waits_for_the_first_to_leave() -> None:
    with Loop("aidin", *TCP) as loop:
        first, second = loop.open(), loop.open()
        assert line(first)
        assert second.read(1, 1.0) == b""
        first.close()
        assert next(iter(line(second))) == "motor_pos", "it begins with a whole object"


def test_disconnect_in_the_middle_and_a_client_after_it() -> None:
    with Loop("aidin", *TCP, "--fault", "disconnect", "--after", "3", "--every", "100") as loop:
        with loop.open() as client:
            rest = client.read(1 << 20).rpartition(b"\n")[2]
            assert client.gone and rest.startswith(b'{"motor_pos":')
        assert ask(loop.open(), '{"hand_mode":3}')["motor_pos"][0] == 70110


def test_silence() -> None:
    with Loop("aidin", *TCP, "--fault", "silent") as loop:
        assert loop.open().ask(b"{}", 1, 1.0) == b""


def test_control_and_garbage_in() -> None:
    with Loop("aidin", *TCP, "--control", "control", "--set", "exchange=poll") as loop, loop.open() as client:
        client.write(b"GET / HTTP/1.1\r\n\r\n{\xff}[1,2")
        feedback = ask(client, "{}")
        told = CliRunner().invoke(cli, ["control", "control", "touch", "thumb", "1", "2", "3"])
        assert (told.exit_code, told.output) == (0, "touch thumb 1 2 3\n")
        assert ask(client, "{}")["sensor_state"][:3] == [1.02, 1.99, 3.35]
        assert feedback["sensor_state"][:3] == [0.02, -0.01, 0.35]
        assert "dropped 17 " in loop.tell("state")
        told = CliRunner().invoke(cli, ["control", "control", "touch", "thumb", "-1.5", "-2", "3"])
        assert (told.exit_code, told.output) == (0, "touch thumb -1.5 -2 3\n")


def test_half_an_object_of_a_client_that_left_does_not_swallow_what_the_next_one_sends() -> None:
    with Loop("aidin", *TCP, "--set", "exchange=command") as loop:
        with loop.open() as killed:
            killed.write(b'{"hand_mode":1')
        assert "current_state" in ask(loop.open(), '{"hand_mode":3}\n')


def test_a_client_that_reads_again_after_a_long_pause_gets_whole_objects() -> None:
    """700 kB in a second: more than the simulator keeps, and than a connection does."""
    with Loop("aidin", *TCP, "--set", "rate=1000") as loop, loop.open() as slow:
        loop.sleep(1.0)
        rows = slow.read(1 << 20, 0.1).split(b"\n")[:-1]
        assert len(rows) > 100 and all(len(json.loads(row)) == 5 for row in rows)


@pytest.mark.real
def test_connections_of_the_system() -> None:
    """A stream, and a second client."""
    with Simulator(*TCP, kind="aidin") as server:
        host, _, port = server.link.removeprefix("tcp://").rpartition(":")
        for _ in range(2):
            with socket.create_connection((host, int(port)), timeout=PATIENCE) as client:
                data = b""
                while data.count(b"\n") < 10:
                    data += client.recv(1 << 20)
                assert all(len(json.loads(row)) == 5 for row in data.split(b"\n")[:-1])
        assert server.stop() == (0, "", "")


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
    assert "No endpoint given. Give --tcp HOST:PORT" in CliRunner().invoke(cli, ["aidin"]).output
