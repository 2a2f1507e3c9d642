"""The simulated slcan adapter: command by command then its event loop, both on virtual time; and foreign clients."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import can
import pytest
from can.interfaces.slcan import slcanBus
from click.testing import CliRunner

from handctl.sim import create
from handctl.sim.cli import cli
from handctl.sim.engine.serve import send_control
from handctl.sim.engine.slcan import Adapter, link
from tests.support.cli import PATIENCE, Simulator, wait_until
from tests.support.each_row import each_row
from tests.support.virtual import Loop

PROBE = b"T10FF0001102\r"  # 2 bytes at 1020
PROBE_REPLY = b"T10FF00012A7FE\r"
DUMP = b"T10FF0001108\rT11010001108\rT11030001108\r"
DUMP_REPLY = b"T10FF00018A7FE65046F00DE00\rT110100018000000001F220000\rT11030001800004C04D4FEBC02\r"
MOVE = b"T150380014E80318FC\r"
MOVE_REPLY = b"T150380010\r"
SERIAL_PROBE = bytes.fromhex("EB 90 01 04 30 FC 03 02 36")
SERIAL_PROBE_REPLY = bytes.fromhex("90 EB 01 05 30 FC 03 A7 FE DA")
DUMP_IDS = (0x10FF0001, 0x11010001, 0x11030001)
DUMP_DATA = bytes.fromhex("A7 FE 65 04 6F 00 DE 00 00 00 00 00 1F 22 00 00 00 00 4C 04 D4 FE BC 02")


def adapter_of(setup: bytes = b"", **options: object) -> Adapter:
    """An adapter on virtual time that got these commands; options of the wrist, with _ for -."""
    raw = {name.replace("_", "-"): str(value) for name, value in options.items()}
    adapter = Adapter(create("wrist", {"bus": "can", **raw}))
    adapter.advance(0.0)
    adapter.feed(setup)
    adapter.take()
    return adapter


def opened(**options: object) -> Adapter:
    return adapter_of(b"S8\rO\r", **options)


def ask(adapter: Adapter, request: bytes) -> bytes:
    adapter.feed(request)
    return adapter.take()


# -- command by command --------------------------------------------------------------------------------------------------

OPEN = b"S8\rO\r"
CASES = [
    (b"", b"\r", b"\r"),
    (b"", b"S8\r", b"\r"),
    (b"", b"S6\r", b"\r"),
    (b"", b"S9\r", b"\r"),
    (b"", b"SA\r", b"\a"),
    (b"", b"S\r", b"\a"),
    (b"", b"S88\r", b"\a"),
    (OPEN, b"S8\r", b"\a"),
    (b"", b"s0014\r", b"\r"),
    (b"", b"s001\r", b"\a"),
    (b"", b"s00xx\r", b"\a"),
    (OPEN, b"s0014\r", b"\a"),
    (b"S8\r", b"O\r", b"\r"),
    (b"", b"O\r", b"\r"),
    (OPEN, b"O\r", b"\a"),
    (b"S8\r", b"L\r", b"\r"),
    (OPEN, b"L\r", b"\a"),
    (b"", b"O1\r", b"\a"),
    (OPEN, b"C\r", b"\r"),
    (b"", b"C\r", b"\a"),
    (b"", b"V\r", b"V1013\r"),
    (OPEN, b"V\r", b"V1013\r"),
    (b"", b"v\r", b"v0100\r"),
    (b"", b"N\r", b"NSIM1\r"),
    (OPEN, b"F\r", b"F00\r"),
    (b"", b"F\r", b"\a"),
    (b"", b"Z1\r", b"\r"),
    (b"", b"Z0\r", b"\r"),
    (b"", b"Z2\r", b"\a"),
    (OPEN, b"Z1\r", b"\a"),
    (b"", b"M00000000\r", b"\r"),
    (b"", b"mFFFFFFFF\r", b"\r"),
    (b"", b"M0000000\r", b"\a"),
    (b"", b"mFFFFFFFG\r", b"\a"),
    (OPEN, b"M00000000\r", b"\a"),
    (b"", b"X1\r", b"\a"),
    (b"", b"hello\r", b"\a"),
    (b"", b"\xff\x00\r", b"\a"),
    (b"", b"T" * 5000 + b"\r", b"\a"),
    (OPEN, b"t1230\r", b"z\r"),
    (OPEN, b"t7FF81122334455667788\r", b"z\r"),
    (OPEN, b"t8000\r", b"\a"),
    (OPEN, b"t1231\r", b"\a"),
    (OPEN, b"t123100FF\r", b"\a"),
    (OPEN, b"t1239\r", b"\a"),
    (OPEN, b"t12\r", b"\a"),
    (OPEN, b"t12x0\r", b"\a"),
    (OPEN, b"t1231+1\r", b"\a"),
    (b"", b"t1230\r", b"\a"),
    (b"S8\rL\r", b"t1230\r", b"\a"),
    (OPEN, b"r1238\r", b"z\r"),
    (OPEN, b"r1230\r", b"z\r"),
    (OPEN, b"r12381122334455667788\r", b"\a"),
    (b"", b"r1230\r", b"\a"),
    (OPEN, b"R10FF00012\r", b"Z\r"),
    (OPEN, b"R200000000\r", b"\a"),
    (b"", b"R10FF00012\r", b"\a"),
    (OPEN, PROBE, b"Z\r" + PROBE_REPLY),
    (OPEN, b"T10ff0001102\r", b"Z\r" + PROBE_REPLY),
    (OPEN, MOVE, b"Z\r" + MOVE_REPLY),
    (OPEN, b"T10FF0002102\r", b"Z\r"),
    (OPEN, b"T200000000\r", b"\a"),
    (OPEN, b"T10FF000110\r", b"\a"),
    (OPEN, b"T10FF0001\r", b"\a"),
    (OPEN, b"T10FF000110G\r", b"\a"),
    (b"", PROBE, b"\a"),
    (b"S8\rL\r", PROBE, b"\a"),
    (b"S6\rO\r", PROBE, b"\a"),
    (b"s001C\rO\r", PROBE, b"\a"),
    (b"s0014\rO\r", PROBE, b"Z\r" + PROBE_REPLY),
    (OPEN, PROBE.replace(b"\r", b"\r\n"), b"Z\r" + PROBE_REPLY),
]


@each_row(("setup", "command", "answer"), CASES)
def test_command(setup: bytes, command: bytes, answer: bytes) -> None:
    assert ask(adapter_of(setup), command) == answer
    bytewise = adapter_of(setup)
    assert b"".join(ask(bytewise, bytes([byte])) for byte in command) == answer
    among_others = adapter_of(setup)
    assert ask(among_others, b"V\r" + command + b"V\r") == b"V1013\r" + answer + b"V1013\r"


def test_dump() -> None:
    """Three frames each way, 126 characters with the acknowledgements."""
    heard = ask(opened(), DUMP)
    assert heard.replace(b"Z\r", b"") == DUMP_REPLY
    assert heard.count(b"Z\r") == 3
    assert len(DUMP) + len(heard) == 126


def test_empty_reply_and_count() -> None:
    assert ask(opened(ack_dlc=1), MOVE) == b"Z\rT15038001104\r"


def test_what_python_can_sends_when_it_opens() -> None:
    """C, S8, an empty line, O, O (python-can 4.6.1)."""
    adapter = adapter_of()
    assert ask(adapter, b"C\rS8\r\rO\rO\r") == b"\a\r\r\r\a"
    assert ask(adapter, PROBE) == b"Z\r" + PROBE_REPLY


def test_wrong_bitrate_shows_in_the_status() -> None:
    adapter = adapter_of(b"S6\rO\r")
    assert ask(adapter, PROBE) == b"\a"
    assert ask(adapter, b"F\r") == b"FA4\r"
    assert ask(adapter, b"F\r") == b"F00\r"
    assert ask(adapter, b"C\rS8\rO\r" + PROBE) == b"\r\r\rZ\r" + PROBE_REPLY
    assert ask(adapter_of(b"S6\rO\r", bitrate=500000), PROBE) == b"Z\r" + PROBE_REPLY
    assert ask(adapter_of(b"O\r", bitrate=500000), PROBE) == b"\a"


@each_row(
    ("setup", "bitrate"),
    [
        (b"S0", 10000),
        (b"S1", 20000),
        (b"S2", 50000),
        (b"S3", 100000),
        (b"S4", 125000),
        (b"S5", 250000),
        (b"S6", 500000),
        (b"S7", 800000),
        (b"S8", 1000000),
        (b"S9", 83300),
        (b"s0014", 1000000),
        (b"sC014", 1000000),  # jump width
        (b"s0094", 1000000),  # three samples
        (b"s0023", 1000000),  # other segments, same length
        (b"s001C", 500000),
        (b"s0114", 500000),
        (b"s031C", 125000),
        (b"s3f7f", 5000),
    ],
)
def test_bitrates(setup: bytes, bitrate: int) -> None:
    """Bit timing registers count from a clock of 8 MHz."""
    adapter = adapter_of(setup + b"\rO\r")
    assert adapter.line.client_bitrate == bitrate


def test_unpowered_device_acknowledges_nothing() -> None:
    adapter = opened()
    assert adapter.command("power off") == "power off"
    assert ask(adapter, PROBE) == b"\a"
    adapter.power_cycle()
    assert ask(adapter, PROBE) == b"Z\r" + PROBE_REPLY


def test_timestamps() -> None:
    """Milliseconds since the adapter got power, up to 60 s, in four hex digits behind the data."""
    adapter = adapter_of(b"Z1\rS8\rO\r")
    adapter.advance(0.25)
    assert ask(adapter, PROBE) == b"Z\rT10FF00012A7FE00FA\r"
    adapter.advance(61.0)
    assert ask(adapter, PROBE) == b"Z\rT10FF00012A7FE03E8\r"
    assert ask(adapter, b"C\rZ0\rO\r" + PROBE) == b"\r\r\rZ\r" + PROBE_REPLY
    later = Adapter(create("wrist", {"bus": "can"}))
    later.advance(1000.0)
    later.advance(1000.5)
    assert ask(later, b"Z1\rO\r" + PROBE) == b"\r\rZ\rT10FF00012A7FE01F4\r"


@each_row(
    ("setup", "passes"),
    [
        (b"M00000000\rmFFFFFFFF\r", True),
        (b"M87F80000\rm00000000\r", True),  # 10FF0001 >> 13 is 87F8
        (b"M000087F8\rm00000000\r", True),  # the second filter
        (b"M87F90000\rm00000000\r", False),
        (b"M87F90000\rm00010000\r", True),
        (b"m00000000\r", False),
    ],
)
def test_filter(setup: bytes, passes: bool) -> None:
    assert ask(adapter_of(setup + b"O\r"), PROBE) == b"Z\r" + (PROBE_REPLY if passes else b"")


def test_frames_for_a_closed_channel_are_lost() -> None:
    adapter = opened(fault="late", late=0.1)
    assert ask(adapter, PROBE + b"C\r") == b"Z\r\r"
    adapter.advance(0.2)
    assert adapter.take() == b""
    assert ask(adapter, b"O\r") == b"\r"
    adapter.advance(0.3)
    assert adapter.take() == b""


def test_late_frame_arrives_by_itself() -> None:
    adapter = opened(fault="late")
    assert ask(adapter, PROBE) == b"Z\r"
    assert adapter.next_event() == 0.6
    adapter.advance(0.6)
    assert adapter.take() == PROBE_REPLY
    assert adapter.next_event() is None


def test_wire_time_passes_on_the_bus() -> None:
    adapter = opened(wire=1)
    assert ask(adapter, PROBE) == b"Z\r"
    adapter.advance(0.000157)
    assert adapter.take() == b""
    assert adapter.next_event() == pytest.approx(0.000158)
    adapter.advance(0.000158)
    assert adapter.take() == PROBE_REPLY


def test_bus_off_ends_when_the_channel_is_opened_anew() -> None:
    adapter = opened(fault="bus-off", after=1, every=2)
    assert ask(adapter, PROBE) == b"Z\r" + PROBE_REPLY
    assert ask(adapter, PROBE) == b"Z\r" + PROBE_REPLY
    assert ask(adapter, PROBE + PROBE) == b"\a\a"
    assert ask(adapter, b"F\r") == b"FA4\r"
    assert ask(adapter, b"C\rO\r" + PROBE) == b"\r\r\a"
    adapter.command("fault none")
    assert ask(adapter, b"C\rO\r" + PROBE) == b"\r\rZ\r" + PROBE_REPLY


def test_destroyed_replies_are_bus_errors() -> None:
    adapter = opened(fault="twin-id")
    assert ask(adapter, PROBE) == b"Z\r"
    assert ask(adapter, b"F\rF\r") == b"F80\rF00\r"


def test_echo_and_foreign_traffic() -> None:
    assert ask(opened(fault="echo"), PROBE) == b"Z\r" + PROBE + PROBE_REPLY
    rows = ask(opened(fault="noise", seed=2), PROBE).split(b"\r")
    assert rows[0] == b"Z"
    assert PROBE_REPLY[:-1] in rows[2:-2]
    assert all(len(row) == 10 + 2 * int(row[9:10]) and row.startswith(b"T") for row in rows[1:-1])


def test_disconnect_leaves_after_the_acknowledgement() -> None:
    adapter = opened(fault="disconnect")
    assert ask(adapter, PROBE) == b"Z\r"
    assert adapter.hung_up
    assert ask(adapter, b"C\rV\r") == b""
    adapter.reconnect()
    assert not adapter.hung_up
    assert ask(adapter, b"V\r") == b"V1013\r"


def test_new_client_finds_a_closed_channel() -> None:
    adapter = adapter_of(b"Z1\rS6\rmFFFF0000\rO\rT10FF")
    adapter.reconnect()
    assert ask(adapter, PROBE) == b"\a"
    assert ask(adapter, b"O\r" + PROBE) == b"\rZ\r" + PROBE_REPLY


def test_long_line_is_bounded_and_forgotten() -> None:
    adapter = opened()
    for _ in range(1000):
        adapter.feed(b"T" * 1000)
    assert len(adapter._command) <= 64
    assert ask(adapter, b"\r" + PROBE) == b"\aZ\r" + PROBE_REPLY


def test_link() -> None:
    assert link("/dev/pts/7") == "can:slcan:/dev/pts/7"
    assert link("tcp://127.0.0.1:41234") == "can:slcan:socket://127.0.0.1:41234"


# -- served -----------------------------------------------------------------------------------------------------------

TCP = ("--slcan-tcp", "127.0.0.1:0")
CHANNEL = b"\r\r"


@each_row(("place", "form"), [(["--slcan-pty"], "can:slcan:/dev/"), (TCP, "can:slcan:socket://127.0.0.1:")])
def test_client_after_client(place: list[str], form: str) -> None:
    """At any speed of the port, or where the client sets none; each finds a closed channel."""
    with Loop("wrist", *place) as loop:
        assert loop.link.startswith(form)
        for turn, speed in enumerate((None, 115200, 9600, 2000000, -1)):
            with loop.open(speed if "pty" in place[0] else None) as one:
                one.reset_input_buffer()
                one.write(b"C\r")
                assert one.read(1) in b"\r\a"
                assert one.ask(b"V\r", 6) == b"V1013\r"
                assert one.ask(OPEN + b"T150400012%02X00\r" % turn, 15) == CHANNEL + b"Z\rT150400010\r"
                one.write(b"T10FF00")  # and leaves in the middle
            with loop.open() as other:
                if "pty" in place[0]:
                    other.write(b"\rC\r")  # nobody tells a terminal that its client has gone
                    other.reset_input_buffer()
                assert other.ask(OPEN + b"T11040001102\r", 19) == CHANNEL + b"Z\rT110400012%02X00\r" % turn
        assert loop.stop() == (0, [], [])


def test_a_wrong_bitrate_and_foreign_frames_get_no_reply() -> None:
    with Loop("wrist", *TCP) as loop:
        with loop.open() as client:
            assert client.ask(b"S6\rO\r" + PROBE, 100, 1.0) == CHANNEL + b"\a"
        with loop.open() as client:
            foreign = b"T10FF0002102\rt1231" + b"02\rR10FF00012\r"
            assert client.ask(OPEN + foreign, 100, 1.0) == CHANNEL + b"Z\rz\rZ\r"
            assert client.ask(PROBE, 100, 1.0) == b"Z\r" + PROBE_REPLY


def test_several_clients_are_on_one_bus() -> None:
    with Loop("wrist", *TCP) as loop:
        one, two, other = loop.open(), loop.open(), loop.open()
        assert one.ask(OPEN, 2) == two.ask(OPEN, 2) == other.ask(b"S6\rO\r", 2) == CHANNEL
        assert one.ask(PROBE, 100, 0.1) == b"Z\r" + PROBE_REPLY
        assert two.read(100, 0.1) == PROBE + PROBE_REPLY, "what the other one sent, and the reply"
        assert two.ask(PROBE, 100, 0.1) == b"Z\r" + PROBE_REPLY
        assert other.read(100, 0.1) == b"", "at another bitrate"
        one.close()
        assert two.ask(PROBE, 100, 0.1) == b"Z\r" + PROBE_REPLY
        two.close()
        assert loop.open().ask(OPEN + PROBE, 100, 0.1) == CHANNEL + b"Z\r" + PROBE_REPLY


def test_clients_acknowledge_each_other() -> None:
    with Loop("wrist", *TCP, "--control", "control") as loop:
        assert loop.tell("power off").startswith("ok ")
        one, two = loop.open(), loop.open()
        assert one.ask(OPEN + PROBE, 100, 0.1) == CHANNEL + b"\a", "nobody is there"
        assert two.ask(OPEN, 2) == CHANNEL
        assert one.ask(PROBE, 100, 0.1) == b"Z\r"
        assert two.read(100, 0.1) == PROBE


def test_an_answer_comes_in_one_piece_without_delay() -> None:
    with Loop("wrist", *TCP) as loop, loop.open() as client:
        assert client.ask(OPEN, 2) == CHANNEL
        for _ in range(20):
            began = loop.moment
            client.write(PROBE)
            assert client.some() == b"Z\r" + PROBE_REPLY and loop.moment - began < 0.0005


def test_a_dump_over_the_emulated_bus_takes_its_time() -> None:
    """0.618 ms on the bus for three frames each way, one after the other."""
    with Loop("wrist", *TCP, "--wire", "1") as loop, loop.open() as client:
        assert client.ask(OPEN, 2) == CHANNEL
        began = loop.moment
        for request, reply in zip(DUMP.split(b"\r"), DUMP_REPLY.split(b"\r")[:3], strict=False):
            client.write(request + b"\r")
            assert client.read_until(reply + b"\r").endswith(reply + b"\r")
        assert loop.moment - began == pytest.approx(0.000618, abs=0.0001)


def test_a_serial_wrist_at_its_speed() -> None:
    with Loop("wrist", "--pty", "--wire", "115200") as loop, loop.open() as port:
        assert loop.link.startswith("/dev/")
        began = loop.moment
        assert port.ask(bytes.fromhex("EB 90 01 04 30 FC 03 18 4C"), 32)[7:31] == DUMP_DATA
        assert loop.moment - began == pytest.approx(0.003558, abs=0.0001)
        port.baudrate = 57600
        assert port.ask(SERIAL_PROBE, 10, 1.0) == b""
        port.baudrate = 115200
        assert port.ask(SERIAL_PROBE, 10) == SERIAL_PROBE_REPLY


def test_disconnect_closes_the_adapter() -> None:
    with Loop("wrist", *TCP, "--fault", "disconnect", "--every", "2") as loop:
        for _ in range(2):
            with loop.open() as client:
                assert client.ask(b"O\r" + PROBE, 100, 0.1) == b"\rZ\r" + PROBE_REPLY
                assert client.ask(PROBE, 100, 0.1) == b"Z\r"
                with pytest.raises(EOFError):
                    client.read()
    with Loop("wrist", "--slcan-pty", "--fault", "disconnect") as loop, loop.open() as port:
        assert port.ask(b"O\r" + PROBE, 100, 1.0) == b"\rZ\r" and port.gone
        code, _, (complaint,) = loop.stop()
        assert code == 0 and "disconnect" in complaint


def test_control_and_state_go_across_wires(tmp_path: Path) -> None:
    state = tmp_path / "wrist.json"
    with Loop("wrist", "--slcan-pty", "--state", state, "--control", "control") as loop:
        with loop.open() as port:
            assert port.ask(OPEN + b"T150380016000000000000\r", 17) == CHANNEL + b"Z\r" + MOVE_REPLY
            assert loop.tell("set 1024 0102") == "ok set 1024 01 02"
            assert port.ask(b"T11000001102\r", 17) == b"Z\rT1100000120102\r"
            loop.signals.power_cycles += 1
            assert port.ask(b"T11000001102\r", 17) == b"Z\rT1100000126F00\r"
        assert loop.stop() == (0, [], [])
    with Loop("wrist", "--tcp", "127.0.0.1:0", "--state", state) as loop:
        assert loop.link.startswith("tcp://127.0.0.1:")
        assert loop.open().ask(SERIAL_PROBE, 10) == bytes.fromhex("90 EB 01 05 30 FC 03 00 00 35")


def test_faults_of_the_adapter_are_options_and_commands() -> None:
    with Loop("wrist", *TCP, "--fault", "queue,no-ack", "--control", "control") as loop, loop.open() as client:
        assert client.ask(b"O\r" + PROBE, 100, 0.1) == b"\rZ\r"
        assert loop.tell("fault bel") == "ok fault bel"
        assert client.ask(PROBE, 100, 0.1) == b"\a"
        assert loop.open().ask(b"O\r" + PROBE, 100, 0.1) == b"\r\a", "of who comes later, too"


# -- python-can -------------------------------------------------------------------------------------------------------


def bus_at(server: Simulator, bitrate: int = 1000000) -> slcanBus:
    channel = server.link.removeprefix("can:slcan:")
    bus = can.Bus(interface="slcan", channel=channel, bitrate=bitrate, sleep_after_open=0)
    assert isinstance(bus, slcanBus)
    return bus


def frame(identifier: int, *data: int) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=True)


def exchange(bus: can.BusABC, identifier: int, *data: int) -> bytes:
    """Answers to sent frames show up as empty reads: read until a frame comes."""
    bus.send(frame(identifier, *data))
    came: list[can.Message] = []
    wait_until(lambda: came.extend(filter(None, [bus.recv(0.01)])) or came)
    (message,) = came
    assert (message.arbitration_id, message.is_extended_id, message.is_remote_frame) == (identifier, True, False)
    return bytes(message.data)


@pytest.mark.real
@each_row("place", [["--slcan-pty"], TCP])
def test_python_can_reads_and_moves_the_wrist(place: list[str]) -> None:
    with Simulator(*place, kind="wrist") as server:
        with bus_at(server) as bus:
            assert exchange(bus, 0x10FF0001, 2) == b"\xa7\xfe"
            assert b"".join(exchange(bus, identifier, 8) for identifier in DUMP_IDS) == DUMP_DATA
            assert exchange(bus, 0x15048001, 100, 0) == b""
            assert exchange(bus, 0x15038001, 0xE8, 0x03, 0x18, 0xFC) == b""
            wait_until(lambda: exchange(bus, 0x10FF0001, 4) == b"\x18\xfc\xe8\x03")
            assert bus.get_version(PATIENCE) == (10, 13) and bus.get_serial_number(PATIENCE) == "SIM1"
        with bus_at(server) as bus:
            assert exchange(bus, 0x10FF0001, 4) == b"\x18\xfc\xe8\x03"
        assert server.stop() == (0, "", "")


@pytest.mark.real
def test_the_tools_of_python_can_hear_and_play(tmp_path: Path) -> None:
    """Its filters too; and a terminal that hangs up is an error there."""
    control, log = tmp_path / "control", tmp_path / "move.log"
    log.write_text("(0.000000) can0 15048001#6400\n(0.010000) can0 15038001#E80318FC\n")

    def tool(name: str, *arguments: str) -> subprocess.Popen[str]:
        where = ["--bus-kwargs", "sleep_after_open=0", "-i", "slcan", "-c", server.link.removeprefix("can:slcan:")]
        words = [sys.executable, "-u", "-m", f"can.{name}", *where, *arguments]
        return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)

    with Simulator(*TCP, "--control", control, "--fault", "noise", "--set", "traffic=200", kind="wrist") as server:
        with bus_at(server) as bus:
            bus.set_filters([{"can_id": 0x10FF0001, "can_mask": 0x1FFFFFFF, "extended": True}])
            assert exchange(bus, 0x10FF0001, 2) == b"\xa7\xfe"
        player = tool("player", str(log))
        player.communicate(timeout=PATIENCE)
        assert player.returncode == 0
        assert send_control(str(control), "get 1038 6") == "ok E8 03 18 FC 64 00"
        logger = tool("logger")
        assert logger.stdout is not None
        try:
            heard = [row for row in (logger.stdout.readline() for _ in range(50)) if "ID:" in row]
        finally:
            logger.send_signal(signal.SIGINT)
            logger.communicate(timeout=PATIENCE)
        assert len(heard) > 40 and all(" X Rx " in row for row in heard), heard
    with Simulator("--slcan-pty", "--fault", "disconnect", kind="wrist") as server:
        with pytest.raises(can.CanOperationError), bus_at(server) as bus:
            bus.send(frame(0x10FF0001, 2))
            wait_until(lambda: bus.recv(0.01))
        server.process.wait(timeout=PATIENCE)
        code, out, err = server.stop()
        assert (code, out) == (0, "") and "disconnect" in err


# -- options ----------------------------------------------------------------------------------------------------------


@each_row(
    ("arguments", "message"),
    [
        ([], "--slcan-pty or --slcan-tcp"),
        (["--pty", "--slcan-pty"], "More than one endpoint given. Give either --pty or"),
        (["--slcan-pty", "--slcan-tcp", "127.0.0.1:0"], "More than one endpoint given. Give either --pty or"),
        (["--slcan-tcp", "127.0.0.1"], "HOST:PORT"),
        (["--slcan-pty", "--set", "bus=serial"], "bus=serial"),
        (["--pty", "--set", "bus=can"], "bus=can"),
        (["--pty", "--set", "bus=usb"], "bus=usb"),
        (["--slcan-pty", "--fault", "bad-checksum"], "unknown fault 'bad-checksum'"),
        (["--pty", "--fault", "no-ack"], "unknown fault 'no-ack'"),
        (["--slcan-pty", "--set", "baud=115200"], "unknown option 'baud'"),
    ],
)
def test_bad_options_are_usage_errors(arguments: list[str], message: str) -> None:
    done = CliRunner().invoke(cli, ["wrist", *arguments])
    assert done.exit_code == 2
    assert message in done.output
    assert "ready" not in done.output


def test_help_lists_both_wires() -> None:
    done = CliRunner().invoke(cli, ["wrist", "--help"])
    assert done.exit_code == 0
    for word in (
        "--slcan-pty",
        "--slcan-tcp",
        "bad-checksum",
        "no-ack",
        "bel",
        "bus-off",
        "ack-dlc",
        "result-flag",
        "no-wrist",
        "traffic",
    ):
        assert word in done.output
    assert "slcan" not in CliRunner().invoke(cli, ["exo", "--help"]).output


# -- faults of the adapter ------------------------------------------------------------------------------------------------


def faulty(*faults: str, **options: object) -> Adapter:
    adapter = opened(**options)
    adapter.faults = frozenset(faults)
    return adapter


def test_a_frame_that_no_one_acknowledges_is_tried_again_and_again() -> None:
    adapter = opened(fault="no-ack")
    assert ask(adapter, PROBE) == b"\a"
    assert ask(adapter, b"F\rF\r") == b"FA4\rF00\r"
    adapter.faults = frozenset(["queue"])
    assert ask(adapter, PROBE) == b"Z\r"
    assert ask(adapter, b"F\rF\rF\r") == b"FA4\rFA0\rFA0\r"
    assert ask(adapter, b"C\rO\rF\r") == b"\r\rF00\r"


def test_after_bus_off_no_error_is_added() -> None:
    adapter = opened(fault="bus-off")
    assert ask(adapter, PROBE) == b"\a"
    assert ask(adapter, b"F\rF\r") == b"FA4\rF02\r"
    assert ask(adapter, PROBE + b"F\r") == b"\aF02\r"


def test_an_adapter_that_refuses_every_frame() -> None:
    adapter = faulty("bel")
    assert ask(adapter, PROBE + b"F\rF\r") == b"\aF02\rF00\r"


def test_an_adapter_that_only_queues() -> None:
    assert ask(faulty("queue"), PROBE) == b"Z\r" + PROBE_REPLY
    assert ask(faulty("queue", fault="no-ack"), PROBE + b"F\rF\r") == b"Z\rFA4\rFA0\r"


def test_an_adapter_that_reports_errors_unasked() -> None:
    assert ask(faulty("reports", fault="no-ack"), PROBE + PROBE) == b"\ae1a\rsp000128\r\ae1a\r"
    assert ask(faulty("reports", "queue", fault="bus-off"), PROBE + PROBE) == b"Z\rsb000256\rZ\r"


def test_an_adapter_without_version_and_status() -> None:
    assert ask(faulty("no-status"), b"V\rv\rN\rF\r" + PROBE) == b"\a\a\a\aZ\r" + PROBE_REPLY


def test_damaged_lines_and_no_adapter() -> None:
    (line,) = ask(faulty("damaged-lines"), PROBE).removeprefix(b"Z\r").splitlines()
    assert len(line) == len(PROBE_REPLY) - 2
    assert ask(faulty("no-adapter"), b"V\r" + PROBE) == b""


def test_frames_at_another_bitrate_are_bus_errors_to_who_listens() -> None:
    adapter = adapter_of(b"S6\rL\r", traffic=100)
    adapter.advance(0.1)
    assert ask(adapter, b"F\r") == b"F80\r"
    adapter = adapter_of(b"S8\rL\r", traffic=100)
    adapter.advance(0.1)
    assert ask(adapter, b"F\r").endswith(b"F00\r")
    assert adapter.take() == b""
