"""Served simulators of the RH56 hands: their loop on virtual time, then clients that others wrote.

pymodbus knows no hand. pyrh56 drives a DFX over EB90, inspire-rh56dftp a DFTP over Modbus TCP; nothing of them was written
with this simulator in mind. A server in a process of its own plays at one real second a second.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from rh56_sdk.driver import RH56Driver

from handctl.sim.engine.serve import send_control
from tests.support.cli import PATIENCE, Simulator, wait_until
from tests.support.each_row import each_row
from tests.support.virtual import Client, Loop

ANYWHERE = "127.0.0.1:0"
ANGLES = [110, 220, 330, 440, 550, 660]
READ_ID, ID_IS_1 = bytes.fromhex("EB 90 01 04 11 E8 03 01 02"), bytes.fromhex("90 EB 01 04 11 E8 03 01 02")
ASK_ANGLES = bytes.fromhex("00 01 00 00 00 06 FF 03 06 0A 00 06")


def angles(client: Client) -> list[int]:
    """The angles, over Modbus TCP."""
    answer = client.ask(ASK_ANGLES, 21, 1.0)
    assert answer[:9] == bytes.fromhex("00 01 00 00 00 0F FF 03 0C"), answer
    return list(struct.unpack(">6H", answer[9:]))


# -- the loop ---------------------------------------------------------------------------------------------------------


def test_another_id_and_a_bad_sum_meet_silence_on_modbus_rtu() -> None:
    request = bytes.fromhex("01 03 06 0A 00 06 E5 42")
    with Loop("hand", "--modbus-pty", "--fault", "bad-checksum", "--after", "1") as loop, loop.open() as port:
        assert port.ask(bytes.fromhex("02 03 06 0A 00 06 E5 71"), 1, 1.0) == b""
        healthy = port.ask(request, 17)
        assert healthy[:3] == bytes.fromhex("01 03 0C") and list(struct.unpack(">6H", healthy[3:15])) == ANGLES
        loop.sleep(0.1)
        bad = port.ask(request, 17)
        assert bad[:15] == healthy[:15] and bad[15:] != healthy[15:]


def test_several_clients_of_one_hand() -> None:
    with Loop("hand", "--modbus-tcp", ANYWHERE, "--control", "control") as loop:
        clients = [loop.open() for _ in range(3)]
        for _ in range(5):
            assert [angles(client) for client in clients] == [ANGLES] * 3
        clients[0].close()
        assert angles(clients[1]) == ANGLES
        assert loop.tell("requests") == "ok requests 16"
        loop.tell("fault two-clients-drop")
        assert angles(loop.open()) == ANGLES
        with pytest.raises(EOFError):
            clients[1].read()


def test_bytes_over_tcp_and_both_protocols_on_them() -> None:
    with Loop("hand", "--model", "df", "--tcp", ANYWHERE) as loop, loop.open() as port:
        assert loop.link.startswith("socket://")
        assert port.ask(bytes.fromhex("EB 90 01 04 11 C0 05 02 DD"), 10).hex(" ") == "90 eb 01 05 11 c0 05 2e 02 0c"
        loop.sleep(0.01)
        assert port.ask(bytes.fromhex("01 03 03 E8 00 01 04 7A"), 7).hex(" ") == "01 03 02 00 01 79 84"


def test_slcan_beside_modbus_tcp() -> None:
    with Loop("hand", "--model", "tp", "--slcan-tcp", ANYWHERE, "--modbus-tcp", ANYWHERE) as loop:
        network, bus = loop.links
        assert bus.startswith("can:slcan:")
        adapter = loop.open(link=bus)
        assert adapter.ask(b"S8\rO\rT01930001106\r", 27) == b"\r\rZ\rT019300016020102030200\r"
        answer = loop.open(link=network).ask(bytes.fromhex("00 01 00 00 00 06 FF 03 06 4C 00 03"), 15)
        assert answer.endswith(bytes.fromhex("0102 0302 0002"))


def test_921600_is_another_speed_than_115200() -> None:
    with Loop("hand", "--model", "tp", "--pty", "--set", "baud=921600") as loop:
        for speed, answer in ((115200, b""), (921600, ID_IS_1)):
            with loop.open(speed) as port:
                assert port.ask(READ_ID, 9, 1.0) == answer


def test_a_client_that_leaves_in_the_middle() -> None:
    with Loop("hand", "--modbus-tcp", ANYWHERE) as loop:
        for _ in range(3):
            with loop.open() as client:
                client.write(ASK_ANGLES[:9])
        assert angles(loop.open()) == ANGLES


def test_the_server_moves_with_the_ip_address_of_the_hand() -> None:
    with Loop("hand", "--modbus-tcp", ANYWHERE, "--set", "ip=127.0.0.1", "--control", "control") as loop:
        port = int(loop.link.rpartition(":")[2])
        with loop.open() as client:
            assert client.ask(bytes.fromhex("00 01 00 00 00 06 FF 03 06 A4 00 02"), 13).endswith(b"\x00\x7f\x01\x00")
            client.ask(bytes.fromhex("00 02 00 00 00 0B FF 10 06 A4 00 02 04 00 7F 02 00"), 12)
            client.ask(bytes.fromhex("00 03 00 00 00 06 FF 06 03 ED 00 01"), 12)
            assert loop.tell("ip") == "ok 127.0.0.1"
            loop.tell("power-cycle")
            assert loop.tell("ip") == "ok 127.0.0.2"
        with pytest.raises(ConnectionRefusedError):
            loop.open()
        with loop.come(("127.0.0.2", port)) as there:
            assert there.ask(bytes.fromhex("00 01 00 00 00 06 FF 03 06 A4 00 02"), 13).endswith(b"\x00\x7f\x02\x00")
            there.ask(bytes.fromhex("00 02 00 00 00 0B FF 10 06 A4 00 02 04 33 C6 07 64"), 12)
            there.ask(bytes.fromhex("00 03 00 00 00 06 FF 06 03 ED 00 01"), 12)
            assert "save=2" in loop.tell("acts")
        loop.tell("power-cycle")
        assert loop.tell("ip") == "ok 198.51.100.7"
        with pytest.raises(ConnectionRefusedError):
            loop.come(("127.0.0.2", port))
        assert loop.stop() == (0, [], [])


def test_two_hands_with_one_ip_address() -> None:
    with Loop("hand", "--modbus-tcp", ANYWHERE, "--fault", "twin-ip") as loop:
        other = [angle + 3 for angle in ANGLES]
        assert [angles(loop.open()) for _ in range(4)] == [ANGLES, other] * 2


@each_row(
    ("words", "text"),
    [
        ([], "No endpoint given. Give either --pty or --tcp"),
        (["--pty", "--modbus-pty"], "More than one endpoint given"),
        (["--modbus-pty", "--set", "speaks=eb90"], "speaks=eb90: --modbus-pty serves only Modbus RTU"),
        (["--model", "df", "--modbus-tcp", ANYWHERE], "a hand of generation df has no Ethernet"),
        (["--modbus-tcp", ANYWHERE, "--pty", "--fault", "nothing"], "unknown fault 'nothing'"),
        (["--model", "rh56", "--pty"], "'rh56' is not one of 'df', 'tp', 'f1', 'dg2'"),
    ],
)
def test_words_that_are_refused(words: list[str], text: str) -> None:
    from click.testing import CliRunner

    from handctl.sim.cli import _server

    done = CliRunner().invoke(_server("hand"), words)
    assert done.exit_code == 2
    assert text in done.output


# -- other people's clients -------------------------------------------------------------------------------------------


def over_tcp(port: str) -> Any:
    """A client of pymodbus."""
    from pymodbus.client import ModbusTcpClient

    return ModbusTcpClient("127.0.0.1", port=int(port.rpartition(":")[2]), timeout=PATIENCE)


def over_rtu(port: str) -> Any:
    from pymodbus.client import ModbusSerialClient

    return ModbusSerialClient(port, baudrate=115200, timeout=PATIENCE)


def signed(values: list[int]) -> list[int]:
    return [value - 65536 if value > 32767 else value for value in values]


def read(client: Any, address: int, count: int, unit: int = 1) -> list[int]:
    answer = client.read_holding_registers(address, count=count, device_id=unit)
    assert not answer.isError(), answer
    values: list[int] = answer.registers
    return values


@pytest.mark.real
def test_pymodbus_reads_and_moves_over_rtu_and_tcp() -> None:
    with Simulator("--model", "tp", "--modbus-pty", "--modbus-tcp", ANYWHERE, kind="hand") as server:
        network, pair = over_tcp(server.links[0]), over_rtu(server.links[1])
        with network, pair:
            for client in (network, pair):
                assert read(client, 1000, 1) == [1]
                assert read(client, 1546, 6) == ANGLES
                assert signed(read(client, 1582, 6)) == [-11, 12, -13, 14, -15, 16]
                assert read(client, 1618, 3) == [0x201F, 0x2221, 0x2423]
                assert read(client, 1700, 2) == [0xA8C0, 0xD20B]
            assert read(network, 1534, 45) == read(pair, 1534, 45)
            assert read(network, 3000, 9, unit=255) == list(range(9))
            assert not network.write_registers(1486, [65535, 65535, 65535, 300, 65535, 65535], device_id=255).isError()
            wait_until(lambda: read(pair, 1546, 6) == [110, 220, 330, 300, 550, 660])
            assert not pair.write_register(1492, 440).isError()
            wait_until(lambda: read(network, 1546, 6) == ANGLES)
            assert network.read_holding_registers(1546, count=1).registers == [110]
            assert network.read_input_registers(1546, count=1).exception_code == 1
        assert server.stop() == (0, "", "")
    with Simulator("--model", "f1", "--modbus-pty", kind="hand") as server, over_rtu(server.link) as client:
        before = read(client, 1064, 6)
        assert len(set(before)) == 6
        assert read(client, 1088, 12) == [2, 1, 2, 3, 2, 0, 31, 32, 33, 34, 35, 36]
        assert not client.write_registers(1040, [65535, 65535, 65535, 1500, 65535, 65535]).isError()
        wait_until(lambda: read(client, 1064, 6) == [*before[:3], 1500, *before[4:]])


@pytest.mark.real
def test_drivers_of_the_hand_read_and_move_it(tmp_path: Path) -> None:
    from inspire_rh56dftp.client import InspireHand
    from inspire_rh56dftp.registers import TACTILE_REGIONS

    control = str(tmp_path / "control")
    words = ("--model", "tp", "--modbus-tcp", ANYWHERE, "--fault", "txid-off", "--control", control)
    with Simulator(*words, kind="hand") as server:
        hand = InspireHand("127.0.0.1", int(server.link.rpartition(":")[2]), min_send_interval_s=0.0)
        assert list(hand.read_holding(1546, 6)) == ANGLES
        for name, address, count, (rows, columns) in TACTILE_REGIONS:
            assert rows * columns == count
            first = (address - 3000) // 2
            assert list(hand.read_holding(address, count, name)) == list(range(first, first + count))
        assert hand.send_raw([500] * 6)
        wait_until(lambda: list(hand.read_holding(1546, 6)) == [500] * 6)
        hand.open_hand()
        wait_until(
            lambda: list(hand.read_holding(1546, 6)) == [1000, 1000, 1000, 1000, 1000, 0]
        )  # its own idea of open
        hand.close()
        assert int(send_control(control, "requests").split()[2]) > len(TACTILE_REGIONS)
    df = ("--model", "df", "--pty", "--set", "speed=1000", "--wire", "115200")
    with Simulator(*df, kind="hand") as server, RH56Driver(server.link, timeout=PATIENCE) as driver:
        assert driver.read_angle() == ANGLES
        assert driver.read_force() == [-11, 12, -13, 14, -15, 16]
        assert driver.read_temperature() == [31, 32, 33, 34, 35, 36]
        assert driver.read_error() == [0] * 6
        assert driver.read_voltage() == 558
        driver.move_to([500, 400, 300, 200, 100, 600])
        assert driver.wait_until_reached([500, 400, 300, 200, 100, 600], timeout=PATIENCE, tolerance=0)
        driver.save_parameters()
