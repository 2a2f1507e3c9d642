"""Several simulated devices, clients and masters on one line: what each hears, and when, in literal bytes on virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.sim import create
from handctl.sim.bus import client_of
from handctl.sim.bus.bus_file import MODELS, read
from handctl.sim.bus.serial_bus import Bus, Client
from handctl.sim.bus.wire_pair import Pair, Receiver
from tests.support.bus_file import text
from tests.support.each_row import each_row

EXO, WRIST = {"kind": "exo"}, {"kind": "wrist"}
ASK_3 = bytes.fromhex("EB 90 03 04 11 E8 03 01 04")  # id of the hand with id 3
ID_IS_3 = bytes.fromhex("90 EB 03 04 11 E8 03 03 06")
ASK_5 = bytes.fromhex("EB 90 05 04 11 E8 03 01 06")
ID_IS_5 = bytes.fromhex("90 EB 05 04 11 E8 03 05 0A")
VOLTAGE_3 = bytes.fromhex("EB 90 03 04 11 C0 05 02 DF")
BYTE = 10 / 115200


def bus_of(folder: Path, content: str) -> Bus:
    file = folder / "bus.toml"
    file.write_text(content, encoding="utf-8")
    client = client_of(read(str(file)))
    assert isinstance(client, Client)
    client.bus.leave(client)
    client.bus.advance(0.0)
    return client.bus


def joined(bus: Bus, baud: int | None = 115200) -> Client:
    client = bus.join()
    client.client_baud = baud
    return client


def run(client: Client, seconds: float) -> list[tuple[float, bytes]]:
    """What this client hears within so many seconds, event by event."""
    end, heard = (client.bus.now or 0.0) + seconds, []
    while True:
        event = client.next_event()
        now = end if event is None else min(event, end)
        client.advance(now)
        if data := client.take():
            heard.append((now, data))
        if now >= end:
            return heard


def bytes_of(heard: list[tuple[float, bytes]]) -> bytes:
    return b"".join(data for _, data in heard)


def ask(client: Client, request: bytes, seconds: float = 1.0) -> bytes:
    client.feed(request)
    return bytes_of(run(client, seconds))


# -- a pair of wires ----------------------------------------------------------------------------------------------------


def heard_by(receiver: Receiver) -> bytes:
    out = bytearray()
    while (byte := receiver.next()) is not None:
        out.append(byte[1])
        receiver.take()
    return bytes(out)


def test_a_receiver_at_the_right_speed_hears_each_byte_at_its_last_bit() -> None:
    pair = Pair()
    receiver = Receiver(pair, None, 9600)
    pair.put("sender", 1.0, 9600, b"\x55\x00\xff")
    assert receiver.next() == pytest.approx((1.0 + 10 / 9600, 0x55, 1.0 + 9.5 / 9600, 1.0 + 30 / 9600))
    assert heard_by(receiver) == b"\x55\x00\xff"


def test_a_receiver_at_half_the_speed_hears_something_else() -> None:
    pair = Pair()
    pair.put("sender", 0.0, 19200, b"\x80")  # low for 8 bits: 4 bits at 9600, the start bit and three more
    assert heard_by(Receiver(pair, None, 9600)) == bytes([0b11111000])
    pair.put("sender", 1.0, 9600, b"\xff")  # low for one bit: two at 19200, the start bit and bit 0
    assert heard_by(Receiver(pair, None, 19200))[-1:] == b"\xfe"


def test_two_who_send_at_once_make_a_wired_and() -> None:
    pair = Pair()
    pair.put("one", 0.0, 9600, b"\xf0\x0f")
    pair.put("two", 0.0, 9600, b"\x3c\xff")
    assert heard_by(Receiver(pair, None, 9600)) == b"\x30\x0f"


def test_who_begins_in_the_middle_of_a_byte_spoils_its_rest() -> None:
    pair = Pair()
    pair.put("one", 0.0, 9600, b"\xff")
    pair.put("two", 4.9 / 9600, 9600, b"\x00")  # low from the end of bit 3 on
    first = heard_by(Receiver(pair, None, 9600))[0]
    assert first == 0b00001111  # the start bit and four more, then the other one


def test_who_sends_hears_nothing_of_the_others_meanwhile() -> None:
    pair = Pair()
    pair.put("me", 0.0, 9600, b"\xff" * 2)
    pair.put("you", 0.0, 9600, b"\x11" * 4)
    assert heard_by(Receiver(pair, "me", 9600)) == b"\x11\x11"
    assert heard_by(Receiver(pair, "me", 9600, echo=True)) == b"\x11" * 4


# -- devices on one line --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", ["rs232", "rs485"])
def test_each_device_answers_to_its_id(tmp_path: Path, wire: str) -> None:
    client = joined(bus_of(tmp_path, text("clean", [EXO | {"id": 3}, EXO | {"id": 5}], wire=wire)))
    client.feed(ASK_5)
    heard = run(client, 0.1)
    assert bytes_of(heard) == ID_IS_5
    assert heard[-1][0] == pytest.approx(18 * BYTE)  # the request, then the answer, at their speed
    assert ask(client, ASK_3) == ID_IS_3


def test_two_devices_with_one_id_destroy_each_other(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}, EXO | {"id": 3}])))
    assert ask(client, ASK_3) == ID_IS_3  # they say the same
    answer = ask(client, VOLTAGE_3)  # 558, 022E hex, and 561, 0231, with their sums 0E and 11
    assert answer == bytes.fromhex("90 EB 03 05 11 C0 05 20 02 00")


def test_two_devices_with_one_id_and_another_turnaround(tmp_path: Path) -> None:
    late = EXO | {"id": 3, "turnaround": 0.0003}
    client = joined(bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}, late])))
    assert ask(client, ASK_3) not in (ID_IS_3, ID_IS_3 * 2, b"")


@each_row("fits", [True, False])
def test_who_asks_on_before_the_answer_is_over_loses_it_on_two_wires(tmp_path: Path, fits: bool) -> None:
    client = joined(bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}, EXO | {"id": 5}], half_duplex=not fits)))
    client.feed(ASK_3)
    run(client, 12 * BYTE)
    answer = ask(client, ASK_5)
    assert (answer == ID_IS_3[-6:] + ID_IS_5) is fits


def test_several_clients_hear_the_line(tmp_path: Path) -> None:
    bus = bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}]))
    one, two = joined(bus), joined(bus)
    assert ask(one, ASK_3) == ID_IS_3
    assert two.take() == ASK_3 + ID_IS_3  # everybody on the two wires
    bus = bus_of(tmp_path, text("clean", [EXO | {"id": 3}]))
    one, two = joined(bus), joined(bus)
    assert ask(one, ASK_3) == ID_IS_3
    assert two.take() == ID_IS_3  # the wire of the devices


def test_a_master_asks_by_itself(tmp_path: Path) -> None:
    master = {"ask": ASK_3.hex(" "), "every_ms": 100}
    client = joined(bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}], [master])))
    heard = run(client, 0.35)
    assert bytes_of(heard) == (ASK_3 + ID_IS_3) * 3
    assert client.bus.command("requests") == "requests 3"


def test_the_first_byte_after_a_sending_is_lost(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("first-byte-lost", [EXO | {"id": 3}])))
    assert ask(client, ASK_3) == ID_IS_3[1:]
    assert ask(client, ASK_3) == ID_IS_3[1:]


def test_a_wrong_speed_is_what_a_uart_makes_of_it(tmp_path: Path) -> None:
    master = {"ask": "80", "every_ms": 100}
    client = joined(bus_of(tmp_path, text("half-duplex", [], [master], baud=19200)), 9600)
    assert bytes_of(run(client, 0.15)) == bytes([0b11111000])
    bus = bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3, "baud": 57600}]))
    assert ask(joined(bus, 115200), ASK_3) == b""
    assert ask(joined(bus, 57600), ASK_3) == ID_IS_3


def test_latency_and_its_spread(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("clean", [EXO | {"id": 3}], latency_ms=80)))
    client.feed(ASK_3)
    heard = run(client, 1.0)
    assert bytes_of(heard) == ID_IS_3
    assert heard[-1][0] == pytest.approx(0.080 + 18 * BYTE, abs=0.0001)
    client = joined(bus_of(tmp_path, text("clean", [EXO | {"id": 3}], latency_ms=80, spread_ms=40)))
    trips = []
    for number in range(30):
        client.advance(float(number))
        client.feed(ASK_3)
        heard = run(client, 0.5)
        assert bytes_of(heard) == ID_IS_3
        trips.append(heard[-1][0] - number - 18 * BYTE)
    assert 0.079 < min(trips) < 0.092 < 0.108 < max(trips) < 0.121


def test_a_speed_change_does_not_overtake_what_was_written(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("clean", [EXO | {"id": 3}], latency_ms=100)))
    client.feed(ASK_3)
    client.client_baud = 57600
    assert bytes_of(run(client, 1.0)) != ID_IS_3  # asked at 115200, heard at 57600
    assert client.bus.command("requests") == "requests 1"


def test_bluetooth_has_packets_and_no_speed(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("bluetooth", [EXO | {"id": 3, "baud": 57600}])), 9600)
    client.feed(bytes.fromhex("EB 90 03 04 11 E8 03 32 35"))  # 50 bytes
    heard = run(client, 1.0)
    assert [len(data) for _, data in heard] == [20, 20, 18]
    assert heard[0][0] > 0.060


def test_a_timer_holds_bytes_back(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("usb-16ms", [EXO | {"id": 3}])))
    client.feed(ASK_3)
    assert run(client, 0.1) == [(pytest.approx(10 * BYTE + 0.016), ID_IS_3)]
    assert ask(client, ASK_3[:-1] + b"\x00") == b""
    client = joined(bus_of(tmp_path, text("usb-16ms", [EXO | {"id": 3, "baud": 115200}])))
    client.feed(bytes.fromhex("EB 90 03 04 11 E8 03 64 67"))  # 100 bytes: a full packet goes at once
    assert [len(data) for _, data in run(client, 0.1)] == [62, 46]


def test_an_adapter_that_hears_itself(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}], echo=True)))
    assert ask(client, ASK_3) == ASK_3 + ID_IS_3


@each_row("model", MODELS)
def test_every_model_lets_a_patient_client_work(tmp_path: Path, model: str) -> None:
    client = joined(bus_of(tmp_path, text(model, [EXO | {"id": 3}, WRIST | {"id": 5}])))
    for _ in range(3):
        assert ask(client, ASK_3).endswith(ID_IS_3[1:])


def test_power_and_control(tmp_path: Path) -> None:
    client = joined(bus_of(tmp_path, text("half-duplex", [EXO | {"id": 3}, WRIST | {"id": 5}])))
    assert client.command("devices") == "1 exo, 2 wrist"
    client.command("power off")
    assert ask(client, ASK_3) == b""
    client.command("power on")
    assert ask(client, ASK_3) == ID_IS_3
    assert client.command("device 1 fault silent") == "fault silent"
    assert ask(client, ASK_3) == b""
    assert ask(client, ASK_5) != b""
    with pytest.raises(ValueError, match=r"there is no device 3\. Known: 1 to 2"):
        client.command("device 3 help")
    with pytest.raises(ValueError, match=r"unknown command 'jump'\. Known: power-cycle"):
        client.command("jump")


# -- the file --------------------------------------------------------------------------------------------------------------


@each_row(
    ("content", "complaint"),
    [
        ("", "[line] wire is missing: one of rs485, rs232, can"),
        ("[line", "not TOML"),
        ("line = 3", "line is a table, [line]"),
        ("[lines]", "unknown table 'lines'. Known: [line], [[device]], [[master]]"),
        ("[line]\nwire = 'rs422'", "[line] wire = 'rs422': one of rs485, rs232, can"),
        ("[line]\nwire = 'rs485'\nspeed = 3", "[line] unknown key 'speed'. Known: wire, model, baud"),
        ("[line]\nmodel = 'wifi'", "[line] model = 'wifi': one of clean, half-duplex"),
        ("[line]\nwire = 'rs485'\nlatency_ms = -1", "[line] latency_ms = -1: a number from 0 to 10000"),
        ("[line]\nwire = 'rs485'\nlatency_ms = nan", "[line] latency_ms = nan: a number from 0 to 10000"),
        ("[line]\nwire = 'rs485'\nhalf_duplex = 1", "[line] half_duplex = 1: true or false"),
        ("[line]\nwire = 'rs485'\nbaud = 0", "[line] baud = 0: a whole number from 50 to 20000000"),
        ("[line]\nwire = 'can'\npacket = 8", "[line] packet belongs to a serial line"),
        ("[line]\nwire = 'rs485'\n[device]\nkind = 'exo'", "each device is a table of its own, [[device]]"),
        ("[line]\nwire = 'rs485'\n[[device]]", "[[device]] 1 kind is missing. Known:"),
        ("[line]\nwire = 'rs485'\n[[device]]\nkind = 'aidin'", "kind = 'aidin': no simulated device on rs485. Known:"),
        (
            "[line]\nwire = 'can'\n[[device]]\nkind = 'exo'",
            "kind = 'exo': no simulated device on can. Known: hand, wrist",
        ),
        (
            "[line]\nwire = 'rs485'\n[[device]]\nkind = 'exo'\nid = 999",
            "[[device]] 1 option id=999: out of range 1 to 254",
        ),
        ("[line]\nwire = 'rs485'\n[[device]]\nkind = 'exo'\nfault = 'x'", "[[device]] 1 unknown fault 'x'"),
        ("[line]\nwire = 'rs485'\n[[device]]\nkind = 'exo'\nwire = 3", "[[device]] 1 wire: give it in [line]"),
        ("[line]\nwire = 'rs485'\n[[device]]\nkind = 'exo'\nid = {}", "[[device]] 1 id: a text or a number"),
        ("[line]\nwire = 'rs485'\n[[master]]\nevery_ms = 3", "[[master]] 1 ask is missing: bytes in hex"),
        ("[line]\nwire = 'rs485'\n[[master]]\nask = 'EB'", "[[master]] 1 every_ms is missing: a number from 1"),
        ("[line]\nwire = 'rs485'\n[[master]]\nask = 'zz'\nevery_ms = 9", "[[master]] 1 ask = 'zz': bytes in hex"),
        ("[line]\nwire = 'can'\n[[master]]\nask = '04'\nevery_ms = 9", "[[master]] 1 ask = '04': ID#DATA in hex"),
    ],
)
def test_a_wrong_file_is_named(tmp_path: Path, content: str, complaint: str) -> None:
    file = tmp_path / "bus.toml"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(ValueError) as caught:
        create("bus", {"file": str(file)})
    assert str(caught.value).startswith(f"{file}: ")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="cannot be read: No such file"):
        create("bus", {"file": str(tmp_path / "none.toml")})
    with pytest.raises(ValueError, match="name the file that describes the bus"):
        create("bus", {})
