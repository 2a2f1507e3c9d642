"""The serial wire: one question, one answer, reads repeated, writes never, and what is said when no answer comes."""

from __future__ import annotations

import pytest

from handctl.devices.inspire.register_bus import question
from handctl.devices.inspire.serial_bus import HINTS, SerialBus, bad_reply
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.model.result import Journal
from handctl.sim.engine import line_and_faults
from tests.support.each_row import each_row
from tests.support.scripted import Babble, Reply, ScriptedLink, changing, fake_hand, hand_on, hexed, script, unhex

READ_VOLTAGE = "EB 90 01 04 11 C0 05 02 DD"
VOLTAGE = "90 EB 01 05 11 C0 05 2E 02 0C"
READ_ID, ID_IS_1 = "EB 90 01 04 11 E8 03 01 02", "90 EB 01 04 11 E8 03 01 02"
WRITE_INDEX = "EB 90 01 05 12 D4 05 2C 01 1E"
INDEX_ACK = "90 EB 01 04 12 D4 05 01 F1"
LATE_POSITIONS = "90 EB 01 0F 11 0A 06 6E 00 DC 00 4A 01 B8 01 26 02 94 02 3D"


def bus_on(link: ScriptedLink, **options: object) -> SerialBus:
    return hand_on(link, **options).bus


# -- reads ------------------------------------------------------------------------------------------------------------


def test_read_is_one_request_and_one_reply() -> None:
    link = ScriptedLink(script((READ_VOLTAGE, [VOLTAGE])))
    bus = bus_on(link)
    assert hexed(bus.read(1472, 2)) == "2E 02"
    assert [hexed(request) for request in link.sent] == [READ_VOLTAGE]
    assert bus.journal.counters.as_row() == {
        "sent": 1,
        "received": 1,
        "retries": 0,
        "bad_frames": 0,
        "stray_bytes": 0,
    }


@each_row(("retries", "sent"), [(0, 1), (1, 2), (2, 3), (5, 6)])
def test_silent_read_is_repeated_so_often(retries: int, sent: int) -> None:
    link = ScriptedLink(baud=None)
    bus = bus_on(link, retries=retries, timeout=0.3)
    with pytest.raises(NoAnswer) as caught:
        bus.read(1472, 2)
    assert [hexed(request) for request in link.sent] == [READ_VOLTAGE] * sent
    assert bus.journal.counters.retries == retries
    assert link.now() == pytest.approx(0.3 * sent)
    assert caught.value.exit_code == 4
    assert READ_VOLTAGE in caught.value.text
    for word in ("id", "baud rate", "power", "115200", "wiring", "scan"):
        assert word in caught.value.hint


def test_second_attempt_counts_as_a_retry() -> None:
    answers = iter([[], [(0.001, unhex(VOLTAGE))]])
    link = ScriptedLink(lambda request: next(answers))
    bus = bus_on(link)
    assert hexed(bus.read(1472, 2)) == "2E 02"
    assert (len(link.sent), bus.journal.counters.retries) == (2, 1)


def test_retries_of_one_read_can_be_set() -> None:
    link = ScriptedLink()
    with pytest.raises(NoAnswer):
        bus_on(link, retries=7).read(1472, 2, retries=0)
    assert len(link.sent) == 1


def test_read_of_another_id() -> None:
    link = ScriptedLink(script(("EB 90 02 04 11 C0 05 02 DE", ["90 EB 02 05 11 C0 05 2E 02 0D"])))
    bus = bus_on(link)
    assert hexed(bus.read(1472, 2, device_id=2)) == "2E 02"
    assert bus.id == 1


def test_timeout_is_added_to_the_time_on_the_wire() -> None:
    """A byte is 10 bits (exo §2.1): 9 + 260 bytes at 19200 need 140.1 ms."""
    link = ScriptedLink(baud=19200)
    with pytest.raises(NoAnswer):
        bus_on(link, retries=0, timeout=0.05).read(1472, 252)
    assert link.now() == pytest.approx(0.05 + 269 * 10 / 19200)


@each_row(("baud", "settable"), [(None, False), (115200, False), (38400, True), (9600, True)])
def test_a_stranger_is_not_asked_first_what_it_would_act_upon(baud: int | None, settable: bool) -> None:
    """E8 03 is the address 1000, and 03 ends a movement of a BarrettHand that hears it as it is: nobody asks that first."""
    link = ScriptedLink(baud=baud)
    link.can_set_baud = settable
    with pytest.raises(NoAnswer) as caught:
        bus_on(link, retries=1).read(1000, 1)
    assert [hexed(request) for request in link.sent] == [READ_VOLTAGE] * 2
    assert READ_VOLTAGE in caught.value.text
    link = ScriptedLink(script((READ_VOLTAGE, [VOLTAGE]), *[(READ_ID, [ID_IS_1])] * 2), baud=baud)
    link.can_set_baud = settable
    bus = bus_on(link)
    assert (bus.read(1000, 1), bus.at().read(1000, 1)) == (b"\x01", b"\x01")
    assert [hexed(request) for request in link.sent] == [READ_VOLTAGE, READ_ID, READ_ID], "once: now it is known"


def test_at_a_speed_that_no_such_device_hears_the_question_itself_goes_first() -> None:
    """With what goes ahead of it there, until somebody has answered."""
    link = ScriptedLink(script((f"00 00 {READ_ID}", [ID_IS_1]), (READ_ID, [ID_IS_1])), baud=57600)
    bus = bus_on(link)
    assert [bus.read(1000, 1), bus.read(1000, 1)] == [b"\x01", b"\x01"]


def test_every_id_but_two_has_a_quiet_first_question() -> None:
    """Counted here: no 03, 0D or FF in the nine bytes, the sum included."""
    for flag, addresses in ((0x11, (1472, 1546)), (0x30, (1024, 1026))):
        for device_id in range(1, 255):
            address, count = question(device_id, flag)
            assert address in addresses and count == 2
            body = bytes([device_id, 4, flag, address % 256, address // 256, 2])
            quiet = not {0x03, 0x0D, 0xFF} & {*body, sum(body) % 256}
            assert quiet == (device_id not in (3, 13)), device_id


def test_no_wire_time_where_the_link_has_no_speed() -> None:
    link = ScriptedLink(baud=None)
    with pytest.raises(NoAnswer):
        bus_on(link, retries=0, timeout=0.05).read(1472, 252)
    assert link.now() == pytest.approx(0.05)


def test_bound_of_the_command_ends_the_retries() -> None:
    link = ScriptedLink()
    bus = bus_on(link, retries=100, timeout=0.3, bound=link.deadline(0.7))
    with pytest.raises(NoAnswer):
        bus.read(1472, 2)
    assert link.now() == pytest.approx(0.7)
    assert len(link.sent) == 3


@each_row("device_id", [0, 255, -1, 256])
def test_bus_refuses_an_id_that_does_not_exist(device_id: int) -> None:
    with pytest.raises(UsageError):
        SerialBus(ScriptedLink(), device_id, Journal())


def test_impossible_read_sends_nothing() -> None:
    link = ScriptedLink()
    with pytest.raises(UsageError):
        bus_on(link).read(1472, 253)
    assert link.sent == []


# -- stale and late replies -------------------------------------------------------------------------------------------


def test_what_lay_in_the_input_before_the_request_is_dropped() -> None:
    link = ScriptedLink(script((READ_VOLTAGE, [VOLTAGE])))
    link.put(0.0, unhex("90 EB 01 05 11 C0 05 FF 7F 5A"))
    bus = bus_on(link)
    assert hexed(bus.read(1472, 2)) == "2E 02"
    assert bus.journal.counters.stray_bytes == 10


def test_late_reply_of_another_question_is_skipped_and_counted() -> None:
    link = ScriptedLink(script((READ_VOLTAGE, [(0.1, unhex(LATE_POSITIONS)), (0.2, unhex(VOLTAGE))])))
    bus = bus_on(link)
    assert hexed(bus.read(1472, 2)) == "2E 02"
    assert bus.journal.counters.stray_bytes == 20
    assert bus.journal.counters.retries == 0


def test_reply_after_the_timeout_is_not_taken_for_the_next_question() -> None:
    def answer(request: bytes) -> list[Reply]:
        return [(0.4, unhex(VOLTAGE))] if hexed(request) == READ_VOLTAGE else []

    bus = bus_on(ScriptedLink(answer), retries=0)
    for _ in range(2):
        with pytest.raises(NoAnswer):
            bus.read(1472, 2)
        with pytest.raises(HandctlError) as caught:
            bus.read(1474, 2)
        assert caught.value.code == "stale"


def test_bad_frames_are_counted() -> None:
    link = ScriptedLink(script((READ_VOLTAGE, ["90 EB 01 05 11 C0 05 2E 02 0D", VOLTAGE])))
    bus = bus_on(link)
    assert hexed(bus.read(1472, 2)) == "2E 02"
    assert bus.journal.counters.bad_frames == 1


# -- writes -----------------------------------------------------------------------------------------------------------


def test_write_is_one_request_and_one_ack() -> None:
    link = ScriptedLink(script((WRITE_INDEX, [INDEX_ACK])))
    bus = bus_on(link)
    bus.write(1492, unhex("2C 01"))
    assert [hexed(request) for request in link.sent] == [WRITE_INDEX]
    assert (bus.journal.counters.received, bus.journal.counters.stray_bytes) == (1, 0)


@each_row("byte", ["00", "02", "FF"])
def test_other_ack_bytes_are_a_refusal(byte: str) -> None:
    total = (0x01 + 0x04 + 0x12 + 0xD4 + 0x05 + int(byte, 16)) % 256
    link = ScriptedLink(script((WRITE_INDEX, [f"90 EB 01 04 12 D4 05 {byte} {total:02X}"])))
    with pytest.raises(DeviceRefused) as caught:
        bus_on(link).write(1492, unhex("2C 01"))
    assert caught.value.exit_code == 6
    assert f"replied {byte} instead of 01" in caught.value.text


FAULTS: dict[str, str | None] = {
    "silence": None,
    "bad checksum": "90 EB 01 04 12 D4 05 01 F2",
    "other id": "90 EB 02 04 12 D4 05 01 F2",
    "echo": WRITE_INDEX,
    "cut short": "90 EB 01 04 12",
    "stale": LATE_POSITIONS,
    "garbage": "00 55 AA",
    "refusal": "90 EB 01 04 12 D4 05 00 F0",
}


@each_row("fault", FAULTS)
def test_a_write_goes_out_once_whatever_comes_back(fault: str) -> None:
    reply = FAULTS[fault]
    link = ScriptedLink(lambda request: [(0.001, unhex(reply))] if reply else [])
    with pytest.raises(HandctlError):
        bus_on(link, retries=5).write(1492, unhex("2C 01"))
    assert [hexed(request) for request in link.sent] == [WRITE_INDEX]


@each_row("fault", FAULTS)
def test_a_command_goes_out_once_whatever_comes_back(fault: str) -> None:
    reply = FAULTS[fault]
    link = ScriptedLink(lambda request: [(0.001, unhex(reply))] if reply else [])
    with pytest.raises(HandctlError):
        bus_on(link, retries=5).command(0x32, [500, 400, 300, 200, 100])
    assert [hexed(request) for request in link.sent] == ["EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D"]


LINE_FAULTS = sorted(line_and_faults.LINE_FAULTS)


@each_row("fault", LINE_FAULTS)
@each_row("seed", [0, 1])
def test_under_every_fault_of_the_simulator_a_write_goes_out_once(fault: str, seed: int) -> None:
    hand, link = fake_hand(f"fault={fault}&seed={seed}", retries=3)
    try:
        hand.bus.write(1492, unhex("2C 01"))
    except HandctlError as exc:
        assert exc.exit_code in (3, 4, 5, 6)
    assert [hexed(request) for request in link.sent] == [WRITE_INDEX]


@each_row("fault", ["noise", "dribble", "split", "echo", "duplicate", "stale", "slow"])
@each_row("seed", range(5))
def test_these_faults_do_not_hide_the_answer(fault: str, seed: int) -> None:
    hand, link = fake_hand(f"fault={fault}&seed={seed}")
    for _ in range(4):
        assert hexed(hand.bus.read(1472, 2)) == "2E 02"
        assert hexed(hand.bus.read(1546, 12)) == "6E 00 DC 00 4A 01 B8 01 26 02 94 02"
    assert hand.bus.journal.counters.retries == 0
    assert len(link.sent) == 8


@each_row(
    ("fault", "code", "exit_code"),
    [
        ("silent", "no-answer", 4),
        ("deaf", "no-answer", 4),
        ("bad-checksum", "bad-checksum", 5),
        ("wrong-id", "wrong-id", 5),
        ("twin-id", "bad-checksum", 5),
        ("loopback", "echo", 5),
        ("disconnect", "lost", 3),
    ],
)
def test_faults_of_the_simulator_are_named(fault: str, code: str, exit_code: int) -> None:
    hand, link = fake_hand(f"fault={fault}")
    with pytest.raises(HandctlError) as caught:
        hand.bus.read(1472, 2)
    assert (caught.value.code, caught.value.exit_code) == (code, exit_code)
    assert changing(link.sent) == []


@each_row("what", ["write", "command"])
def test_nothing_is_written_after_the_deadline_of_the_command(what: str) -> None:
    """--deadline bounds the whole command (cli contract, section 2): a worn hand must not move after it."""
    link = ScriptedLink()
    bus = bus_on(link, bound=link.deadline(1.0))
    link.sleep(1.5)
    with pytest.raises(NoAnswer):
        if what == "write":
            bus.write(1492, unhex("2C 01"))
        else:
            bus.command(0x32, [500, 400, 300, 200, 100])
    assert link.sent == []


def test_acknowledgement_of_a_further_id_counts() -> None:
    link = ScriptedLink(script(("EB 90 01 04 12 E8 03 02 04", ["90 EB 02 04 12 E8 03 01 04"])))
    bus = bus_on(link)
    bus.write(1000, b"\x02", acknowledged_by=(2,))
    assert bus.journal.counters.received == 1
    link = ScriptedLink(script(("EB 90 01 04 12 E8 03 02 04", ["90 EB 03 04 12 E8 03 01 05"])))
    with pytest.raises(ProtocolError) as caught:
        bus_on(link).write(1000, b"\x02", acknowledged_by=(2,))
    assert caught.value.code == "wrong-id"


# -- listening --------------------------------------------------------------------------------------------------------

SAVED = "90 EB 01 04 11 ED 03 00 06"


def test_listening_sends_nothing_and_ends_in_time() -> None:
    link = ScriptedLink()
    assert bus_on(link).listen([unhex(SAVED)[:7]], 2.5) is None
    assert (link.sent, link.now()) == ([], 2.5)


def test_listening_finds_a_frame_in_pieces_and_noise() -> None:
    link = ScriptedLink()
    link.put(0.9, unhex("90 EB 01"))
    link.put(1.0, unhex(SAVED)[:4])
    link.put(1.2, unhex(SAVED)[4:])
    bus = bus_on(link)
    frame = bus.listen([unhex(SAVED)[:7]], 2.5)
    assert frame is not None
    assert hexed(frame.data) == "00"
    assert (link.now(), bus.journal.counters.stray_bytes) == (1.2, 3)


@pytest.mark.parametrize("what", ["read", "write", "command", "listen", "raw"])
def test_a_babbling_line_ends_too(what: str) -> None:
    """No command hangs: every wait has a deadline (cli contract, section 5)."""
    from handctl.devices.inspire import raw

    link = Babble()
    hand = hand_on(link, retries=1, timeout=0.3, bound=link.deadline(30.0))
    calls = {
        "read": lambda: hand.bus.read(1472, 2),
        "write": lambda: hand.bus.write(1492, unhex("2C 01")),
        "command": lambda: hand.bus.command(0x31, [0] * 5),
        "listen": lambda: hand.bus.listen([unhex(SAVED)[:7]], 2.5),
        "raw": lambda: raw.exchange(hand, unhex(READ_VOLTAGE), 0.5),
    }
    if what in ("listen", "raw"):
        calls[what]()
    else:
        with pytest.raises(ProtocolError) as caught:
            calls[what]()
        assert caught.value.code in ("garbage", "bad-checksum")
        assert link.clock < 1.0  # two attempts of 0.3 s, each with a drain: nothing in a flood makes one of them longer
    assert link.now() < 31.0


def one_byte_at_a_time(answer: str, pause: float) -> ScriptedLink:
    return ScriptedLink(
        lambda request: [(pause * (at + 1), unhex(answer)[at : at + 1]) for at in range(len(unhex(answer)))]
    )


@each_row("retries", [0, 2])
def test_a_reply_that_is_still_arriving_is_no_wrong_speed(retries: int) -> None:
    """Good bytes, one each 150 ms: in a second attempt, too, where only its rest comes."""
    bus = bus_on(one_byte_at_a_time(VOLTAGE, 0.15), timeout=0.3, retries=retries)
    with pytest.raises(ProtocolError) as caught:
        bus.read(1472, 2)
    assert (caught.value.code, caught.value.exit_code) == ("slow", 5)
    assert "--timeout" in caught.value.hint
    assert hexed(bus_on(one_byte_at_a_time(VOLTAGE, 0.15), timeout=2.0, retries=0).read(1472, 2)) == "2E 02"


def test_what_has_ended_is_not_still_arriving() -> None:
    """A reply that is cut, bytes of another speed, noise that goes on, and --deadline."""
    for answer, pause, options, code in (
        (VOLTAGE[:17], 0.0, {}, "cut-short"),
        ("F8 80 00 78", 0.0, {}, "garbage"),
        ("F8 80 00 78 " * 20, 0.05, {}, "garbage"),
        (VOLTAGE, 0.15, {"bound": 0.5}, "cut-short"),
    ):
        link = one_byte_at_a_time(answer, pause)
        bound = {"bound": link.deadline(options["bound"])} if options else {}
        with pytest.raises(ProtocolError) as caught:
            bus_on(link, timeout=0.3, retries=0, **bound).read(1472, 2)
        assert caught.value.code == code


# -- explaining -------------------------------------------------------------------------------------------------------


@each_row(
    ("received", "code"),
    [
        pytest.param(READ_VOLTAGE, "echo", id="own bytes"),
        pytest.param("90 EB 07 05 11 C0 05 2E 02 12", "wrong-id", id="another id"),
        pytest.param(f"{READ_VOLTAGE} 90 EB 07 05 11 C0 05 2E 02 12", "wrong-id", id="echo, then another id"),
        pytest.param("90 EB 01 05 11 C0 05 2F 02 0C", "bad-checksum", id="flipped bit"),
        pytest.param("90 EB 01 05 11 C0 05 20 02 0C", "bad-checksum", id="two devices"),
        pytest.param("00 00 90 EB 01 05 11 C0 05 2F 02 0C 00", "bad-checksum", id="flipped bit in noise"),
        pytest.param("90 EB 01 05 11 C0 05", "cut-short", id="cut"),
        pytest.param("90 EB 01", "cut-short", id="cut after three"),
        pytest.param(f"{READ_VOLTAGE} 90 EB 01 05 11", "cut-short", id="echo, then cut"),
        pytest.param(LATE_POSITIONS, "stale", id="another question"),
        pytest.param("90 EB 01 04 11 C0 05 2E 09", "fewer-bytes", id="another length"),
        pytest.param("90 EB 01 04 12 ED 03 01 08", "stale", id="an ack"),
        pytest.param("EB 90 01 04 11 E8 03 01 02", "stale", id="the request of a second master"),
        pytest.param("90 90 EB A7 EB 90 64 18 EB", "garbage", id="junk of a wrong speed that holds a header"),
        pytest.param("00 90 EB", "cut-short", id="cut after the header"),
        pytest.param("00 FF 55", "garbage", id="noise"),
        pytest.param("F8", "garbage", id="one byte"),
        pytest.param("90", "garbage", id="half a header"),
    ],
)
def test_what_came_instead_is_named(received: str, code: str) -> None:
    found, text = bad_reply(unhex(READ_VOLTAGE), unhex(received))
    assert found == code
    assert text
    assert HINTS[found]


def test_error_says_who_what_was_sent_and_what_came() -> None:
    link = ScriptedLink(lambda request: [(0.0, unhex("90 EB 07 05 11 C0 05 2E 02 12"))], baud=57600)
    with pytest.raises(ProtocolError) as caught:
        bus_on(link, retries=0).read(1472, 2)
    assert caught.value.exit_code == 5
    for part in ("id 1", "scripted", "57600", "id 7 replied", READ_VOLTAGE, "90 EB 07 05 11 C0 05 2E 02 12"):
        assert part in caught.value.text
    assert "--id" in caught.value.hint
