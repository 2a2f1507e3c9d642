"""The simulated BarrettHand as a server: its loop on virtual time, and once a process of its own that is killed."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
import serial
from click.testing import CliRunner

from handctl.sim.cli import cli
from handctl.sim.engine.serve import send_control
from tests.support.cli import PATIENCE, Simulator
from tests.support.virtual import Client, Loop

PROMPT = b"\n\r=> "
READY = ("--pty", "--set", "initialized=1", "--control", "control")


def ask(port: Client, command: str) -> bytes:
    port.write(command.encode() + b"\r")
    return port.read_until(b"=> ")


def test_client_after_client() -> None:
    with Loop("barrett", "--pty") as loop:
        with loop.open(9600) as port:
            assert ask(port, "FGET P") == b"FGET P\n\r1021 2042 3063 404" + PROMPT
            assert ask(port, "C") == b"C\n\rERR 4" + PROMPT
        with loop.open() as port:
            assert ask(port, "FGET S") == b"FGET S\n\r4 4 4 4" + PROMPT
        assert loop.stop() == (0, [], [])
    with Loop("barrett", "--tcp", "127.0.0.1:0") as loop, loop.open() as client:
        client.write(b"VERS\rPGET SN\r")
        assert client.read_until(b"1042" + PROMPT) == b"VERS\n\r4.33" + PROMPT + b"PGET SN\n\r1042" + PROMPT


def test_a_movement_takes_its_time_and_an_abort_stops_it() -> None:
    with Loop("barrett", *READY) as loop, loop.open() as port:
        for command in ("GC", "GO"):
            began = loop.moment
            assert ask(port, command) == command.encode() + PROMPT
            assert 0.79 <= loop.moment - began < 1.5
        ask(port, "GC")
        assert ask(port, "FSET MOV 16") == b"FSET MOV 16" + PROMPT  # 4.4 s for the whole way
        port.write(b"GO\r")
        loop.sleep(1.0)
        port.write(b"\x03")
        assert port.read_until(b"=> ") == b"GO\n\rERR 16384" + PROMPT
        first = ask(port, "FGET P")
        loop.sleep(10.0)
        assert ask(port, "FGET P") == first
        assert 12000 < int(first.split()[2]) < 15000


def test_a_speed_change() -> None:
    """§5.4.1: 13 echo bytes at 9600, then garbage, then silence or garbage at 9600 and the prompt at 38400."""
    with Loop("barrett", "--pty") as loop, loop.open(9600) as port:
        port.write(b"PSET BAUD 384\r")
        assert port.read(13) == b"PSET BAUD 384"
        assert b"=> " not in port.read(100, 1.0)
        port.write(b"\r")
        assert b"=> " not in port.read(100, 1.0)
        port.baudrate = 38400
        port.write(b"\x03")
        assert port.read_until(b"=> ").endswith(PROMPT)
        assert ask(port, "PGET BAUD") == b"PGET BAUD\n\r384" + PROMPT
        # RESET: back to the saved speed; the client follows before the banner comes.
        port.write(b"RESET\r")
        assert port.read(5) == b"RESET"
        port.baudrate = 9600
        assert port.read_until(b"=> ") == b"\n\rBarrettHand Firmware\n\rVersion 4.33" + PROMPT


def test_a_saved_speed_is_that_of_the_terminal() -> None:
    with Loop("barrett", "--pty", "--set", "baud=1200") as loop:
        with loop.open() as port:
            assert port.baudrate == 1200 and ask(port, "") == PROMPT
        with loop.open(9600) as port:
            port.write(b"\x03\r")
            assert b"=> " not in port.read(20, 1.0)


def test_wire_at_the_speed_of_the_hand() -> None:
    """43 characters at 9600 bit/s: 44.8 ms."""
    with Loop("barrett", "--pty", "--wire", "auto") as loop, loop.open(9600) as port:
        ask(port, "")
        expected = b"PGET TEMP PTEMP OTEMP\n\r412\n\r573\n\r0" + PROMPT
        began = loop.moment
        assert ask(port, "PGET TEMP PTEMP OTEMP") == expected
        assert loop.moment - began == pytest.approx((len(expected) + 1) / 960, abs=0.002)


def test_control_and_power() -> None:
    with Loop("barrett", *READY, "--set", "boot=0.2") as loop, loop.open() as port:
        assert loop.tell("block F1") == "ok block F1"
        assert ask(port, "1M 1000") == b"1M 1000\n\rERR 16" + PROMPT
        assert loop.tell("temperature 655") == "ok temperature 655"
        assert ask(port, "PGET TEMP") == b"PGET TEMP\n\r655" + PROMPT
        assert loop.tell("leap").startswith("error unknown command 'leap'")
        loop.signals.power_cycles += 1
        assert port.read_until(b"=> ").startswith(b":\n\rBarrettHand Firmware")
        assert ask(port, "GC") == b"GC\n\rERR 4" + PROMPT


def test_realtime() -> None:
    """§6.4: 20 blocks at 38400, each as long as it lasts on the wire."""
    with Loop("barrett", *READY, "--wire", "auto", "--set", "baud=38400") as loop, loop.open(38400) as port:
        ask(port, "12FSET LCPG 0 LFV 0 LFAP 0")
        ask(port, "4FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 0")
        ask(port, "PSET LFT 1")
        assert port.ask(b"124LOOP\r", 8) == b"124LOOP*"
        assert loop.tell("jump F2 127") == "ok jump F2 127"
        assert port.ask(b"C\x00\x00", 8).hex(" ") == "2a 70 00 77 7f 00 01 9c"
        for _ in range(20):
            began = loop.moment
            assert port.ask(b"C\x00\x00", 8).hex(" ") == "2a 70 00 77 00 00 01 9c"
            assert 9 / 3840 - 0.0002 <= loop.moment - began < 9 / 3840 * 1.5
        port.write(b"\x03")
        assert port.read_until(b"=> ") == PROMPT


def test_a_flood_is_survived() -> None:
    with Loop("barrett", "--tcp", "127.0.0.1:0", "--seed", "5") as loop, loop.open() as client:
        for _ in range(20):
            client.write(bytes(range(14, 256)) * 8)
            client.reset_input_buffer()
        client.write(b"\x03VERS\r")
        assert client.read_until(b"4.33" + PROMPT).endswith(b"VERS\n\r4.33" + PROMPT)
        assert loop.stop() == (0, [], [])


@pytest.mark.real
def test_what_a_kill_leaves_of_settings_and_of_half_a_firmware(tmp_path: Path) -> None:
    control, state = tmp_path / "control", tmp_path / "hand.json"
    words = ("--pty", "--state", state, "--control", control, "--set", "boot=0.3", "--set", "download-version=4.34")

    def tell(command: str) -> str:
        return send_control(str(control), command)

    def command_line(port: serial.Serial, command: str) -> bytes:
        port.write(command.encode() + b"\r")
        return bytes(port.read_until(b"=> "))

    with Simulator(*words, kind="barrett") as server:
        with serial.Serial(server.link, 9600, timeout=PATIENCE) as port:
            command_line(port, "1FSET DP 42")
            command_line(port, "1FSAVE")
        server.stop(signal.SIGKILL)
    with Simulator(*words, kind="barrett") as server:
        assert (tell("eeprom DP"), tell("saves")) == ("ok 42 8500 8500 1575", "ok saves 1 0")
        with serial.Serial(server.link, 9600, timeout=PATIENCE) as port:
            assert command_line(port, "1FGET DP") == b"1FGET DP\n\r42" + PROMPT
            assert tell("power off") == "ok power off"
            port.write(b"X")
            assert tell("power on") == "ok power on"
            assert port.read(1) == b":"
            port.write(bytes.fromhex("FF FF 00 20 02 FF"))
            assert port.read(3) == bytes.fromhex("00 20 02")
            port.write(b"\xaa\xbb")
            assert port.read(2) == b"\xaa\xbb"
            path = tmp_path / "image"
            assert tell(f"save-image {path}").startswith("ok image incomplete, version 4.34, 1 records, 2 bytes, ")
            assert path.read_bytes() == b"\xaa\xbb"
            assert command_line(port, "\rRESET") == b"\rRESET\r\n\rBarrettHand Firmware\n\rVersion 4.34" + PROMPT
            assert command_line(port, "VERS") == b"VERS\n\r4.34" + PROMPT
            assert tell("power-cycle") == "ok power cycled"
            assert port.read(1) == b":"
            port.write(bytes.fromhex("FF FF 00 20 02 FF CC"))
            assert port.read(4) == bytes.fromhex("00 20 02 CC")
        server.stop(signal.SIGKILL)
    with Simulator(*words, kind="barrett") as server:
        assert tell("image").startswith("ok image partial, version 4.34, 0 records, 1 bytes, ranges 2000-2000, ")
        with serial.Serial(server.link, 9600, timeout=PATIENCE) as port:
            assert tell("power-cycle") == "ok power cycled"
            assert port.read_until(b"\r:").startswith(b":\n\rNo firmware")


def test_help_names_options_and_faults() -> None:
    result = CliRunner().invoke(cli, ["barrett", "--help"])
    assert result.exit_code == 0
    for word in ("firmware", "texts", "hctl-clock", "eeprom-worn", "no-abort", "dribble", "--control"):
        assert word in result.output
