"""The simulated line: wire time, line faults, the client's speed. Virtual time, literal bytes, no device but the exo."""

from __future__ import annotations

from itertools import pairwise

import pytest

from handctl.sim import create, kinds
from handctl.sim.engine.line_and_faults import LINE_FAULTS, Line
from handctl.sim.engine.simulated_device import Random
from tests.support.each_row import each_row

READ_ID = bytes.fromhex("EB 90 01 04 11 E8 03 01 02")
ID_IS_1 = bytes.fromhex("90 EB 01 04 11 E8 03 01 02")
READ_VOLTAGE = bytes.fromhex("EB 90 01 04 11 C0 05 02 DD")
VOLTAGE = bytes.fromhex("90 EB 01 05 11 C0 05 2E 02 0C")
READ_POSITIONS = bytes.fromhex("EB 90 01 04 11 0A 06 0C 32")
POSITIONS = bytes.fromhex("90 EB 01 0F 11 0A 06 6E 00 DC 00 4A 01 B8 01 26 02 94 02 3D")
DUMP_1 = bytes.fromhex("EB 90 01 04 11 E8 03 0A 0B")
DUMP_2 = bytes.fromhex("EB 90 01 04 11 C0 05 97 72")
SET_INDEX = bytes.fromhex("EB 90 01 05 12 D4 05 2C 01 1E")
SET_INDEX_ACK = bytes.fromhex("90 EB 01 04 12 D4 05 01 F1")
SAVE = bytes.fromhex("EB 90 01 04 12 ED 03 01 08")
SAVE_ACK = bytes.fromhex("90 EB 01 04 12 ED 03 01 08")
SAVED = bytes.fromhex("90 EB 01 04 11 ED 03 00 06")
BYTE = 10 / 115200


def line_of(**options: object) -> Line:
    """A powered line at time 0; options as in a link, with _ for -."""
    line = create("exo", {name.replace("_", "-"): str(value) for name, value in options.items()})
    line.advance(0.0)
    return line


def ask(line: Line, request: bytes) -> bytes:
    line.feed(request)
    return line.take()


def run(line: Line, until: float = 1e9) -> list[tuple[float, bytes]]:
    """Drives the line from event to event as a server does; what came, and when."""
    came: list[tuple[float, bytes]] = []
    while (event := line.next_event()) is not None and event <= until:
        line.advance(event)
        data = line.take()
        if data:
            came.append((event, data))
        assert line.next_event() is None or line.next_event() > event or data, "an event that leads nowhere"
        if line.hung_up:
            break
    return came


def text(came: list[tuple[float, bytes]]) -> bytes:
    return b"".join(data for _, data in came)


# -- wire time ------------------------------------------------------------------------------------------------------------


def test_no_wire_no_time() -> None:
    line = line_of()
    assert line.next_event() is None
    assert ask(line, READ_ID) == ID_IS_1
    assert line.next_event() is None


@each_row(("speed", "milliseconds"), [(115200, 16.93), (57600, 33.85), (19200, 101.56)])
def test_dump_in_two_reads_takes_its_195_bytes(speed: int, milliseconds: float) -> None:
    line = line_of(wire=speed)
    now, count = 0.0, 0
    for request, size in ((DUMP_1, 18), (DUMP_2, 159)):
        line.feed(request)
        came = run(line)
        assert len(text(came)) == size
        now, count = came[-1][0], count + len(request) + size
        assert now == pytest.approx(count * 10 / speed, abs=1e-9)
    assert count == 195
    assert now * 1000 == pytest.approx(milliseconds, abs=0.01)


def test_byte_is_there_when_its_stop_bit_is_over() -> None:
    line = line_of(wire=115200)
    line.feed(READ_ID)
    for count in range(10):
        line.advance((9 + count) * BYTE - 1e-6)
        early = line.take()
        line.advance((9 + count) * BYTE)
        assert early + line.take() == ID_IS_1[count - 1 : count] if count else early == b""
    assert line.next_event() is None


def test_long_reply_wakes_every_two_milliseconds_and_exactly_at_its_end() -> None:
    line = line_of(wire=115200)
    line.feed(DUMP_2)
    came = run(line)
    assert len(came) == 7
    gaps = [after[0] - before[0] for before, after in pairwise(came)]
    assert all(0.0015 < gap <= 0.002 for gap in gaps), gaps
    assert came[-1][0] == pytest.approx(168 * BYTE, abs=1e-9)


def test_one_wake_for_a_request() -> None:
    line = line_of(wire=115200)
    line.feed(READ_ID)
    assert line.next_event() == pytest.approx(9 * BYTE)
    line.advance(9 * BYTE)
    assert line.take() == b""
    assert line.next_event() == pytest.approx(18 * BYTE)


def test_late_driver_gets_the_same_bytes() -> None:
    line = line_of(wire=115200)
    line.feed(DUMP_1 + DUMP_2)
    line.advance(10.0)
    assert len(line.take()) == 18 + 159


def test_requests_queue_on_the_wire_and_replies_overlap_with_requests() -> None:
    """Eight probes back to back, as a windowed scan sends them: the reply to the first comes while others go out."""
    line = line_of(wire=115200)
    probes = b"".join(
        bytes([0xEB, 0x90, number, 4, 0x11, 0xC0, 5, 2, (number + 0xDC) % 256]) for number in (1, 2, 3, 4, 5, 6, 7, 8)
    )
    line.feed(probes)
    came = run(line)
    assert text(came) == VOLTAGE
    assert came[-1][0] == pytest.approx(19 * BYTE)
    line.advance(10.0)
    line.feed(probes[9:] + probes[:9])
    assert run(line)[-1][0] == pytest.approx(10.0 + 82 * BYTE)


def test_write_while_the_last_one_is_still_going_out() -> None:
    line = line_of(wire=115200)
    line.feed(READ_ID[:5])
    line.advance(2 * BYTE)
    line.feed(READ_ID[5:])
    assert run(line)[-1][0] == pytest.approx(18 * BYTE)


def test_replies_queue_on_the_wire() -> None:
    line = line_of(wire=115200, fault="duplicate")
    line.feed(DUMP_2)
    assert run(line)[-1][0] == pytest.approx((9 + 2 * 159) * BYTE)


def test_long_write_on_a_slow_line_is_no_pause() -> None:
    """252 data bytes at 19200 take 135 ms, longer than the pause after which a cut request is forgotten."""
    body = bytes([1, 255, 0x12, 0, 0, *bytes(252)])
    line = line_of(wire=19200)
    line.feed(b"\xeb\x90" + body + bytes([sum(body) % 256]))
    came = run(line)
    assert text(came) == bytes.fromhex("90 EB 01 04 12 00 00 01 18")
    assert came[-1][0] == pytest.approx((260 + 9) * 10 / 19200)


def test_turnaround() -> None:
    line = line_of(wire=115200, turnaround=0.004)
    line.feed(READ_ID)
    assert run(line)[-1][0] == pytest.approx(18 * BYTE + 0.004)
    instant = line_of(turnaround=0.004)
    assert ask(instant, READ_ID) == b""
    assert run(instant) == [(0.004, ID_IS_1)]


def test_wire_at_the_speed_of_the_device() -> None:
    line = line_of(wire="auto", baud=19200)
    line.feed(READ_ID)
    assert run(line)[-1][0] == pytest.approx(18 * 10 / 19200)


def test_time_never_goes_back() -> None:
    line = line_of(turnaround=0.1)
    line.advance(5.0)
    line.feed(READ_ID)
    line.advance(1.0)
    assert line.take() == b""
    assert run(line) == [(5.1, ID_IS_1)]


def test_clock_may_start_anywhere() -> None:
    line = create("exo", {"wire": "115200"})
    line.advance(123456.0)
    line.feed(READ_ID)
    assert run(line)[-1][0] == pytest.approx(123456.0 + 18 * BYTE, abs=1e-8)


# -- faults ---------------------------------------------------------------------------------------------------------------------


def test_silent_loses_the_reply_not_the_request() -> None:
    line = line_of(fault="silent")
    assert ask(line, SET_INDEX) == b""
    assert line.command("get 1492 2") == "2C 01"


def test_deaf_loses_the_request() -> None:
    line = line_of(fault="deaf")
    assert ask(line, SET_INDEX) == b""
    assert line.command("get 1492 2") == "C6 01"


def test_noise_surrounds_the_reply() -> None:
    heard = [ask(line_of(fault="noise", seed=seed), READ_VOLTAGE) for seed in range(40)]
    assert len(set(heard)) == 40
    assert all(VOLTAGE in data and not data.startswith(VOLTAGE) and not data.endswith(VOLTAGE) for data in heard)
    junk = b"".join(data.replace(VOLTAGE, b"") for data in heard)
    assert junk.count(0x90) + junk.count(0xEB) > len(junk) // 3
    assert any(b"\x90\xeb" in data[: data.index(VOLTAGE)] for data in heard), "a false header before the reply"


def test_truncate() -> None:
    heard = [ask(line_of(fault="truncate", seed=seed), READ_VOLTAGE) for seed in range(40)]
    assert all(data == VOLTAGE[: len(data)] and 1 <= len(data) <= 9 for data in heard)
    assert len({len(data) for data in heard}) > 5


def test_dribble() -> None:
    line = line_of(fault="dribble")
    line.feed(READ_ID)
    came = run(line)
    assert [data for _, data in came] == [ID_IS_1[at : at + 1] for at in range(9)]
    assert came[-1][0] == pytest.approx(0.027)


def test_split() -> None:
    pieces = set()
    for seed in range(10):
        line = line_of(fault="split", seed=seed)
        line.feed(READ_POSITIONS)
        came = run(line)
        assert text(came) == POSITIONS
        assert came[-1][0] < 0.2
        pieces.add(tuple(len(data) for _, data in came))
    assert len(pieces) == 10
    assert all(len(row) > 1 for row in pieces)


def test_bad_checksum() -> None:
    assert ask(line_of(fault="bad-checksum"), READ_VOLTAGE) == VOLTAGE[:-1] + b"\x0d"


def test_wrong_id_is_a_valid_frame() -> None:
    assert ask(line_of(fault="wrong-id"), READ_ID) == bytes.fromhex("90 EB 02 04 11 E8 03 01 03")


def test_twin_id_wires_both_replies_together() -> None:
    """Voltages 558 and 561; two equal replies stay perfect."""
    line = line_of(fault="twin-id")
    assert ask(line, READ_VOLTAGE) == bytes.fromhex("90 EB 01 05 11 C0 05 20 02 0C")
    assert ask(line, READ_ID) == ID_IS_1
    assert ask(line, SET_INDEX) == SET_INDEX_ACK
    heard = ask(line, READ_POSITIONS)
    assert len(heard) == len(POSITIONS)
    assert heard != POSITIONS
    # 110..660 and 113..663, with the sums 3D and 4F
    assert heard == bytes.fromhex("90 EB 01 0F 11 0A 06 60 00 DC 00 48 01 B8 01 20 02 94 02 0D")
    force = ask(line, bytes.fromhex("EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B"))
    assert force[:7] == bytes.fromhex("90 EB 01 0D 31 60 00")


def test_echo_comes_first() -> None:
    line = line_of(fault="echo")
    assert ask(line, READ_ID) == READ_ID + ID_IS_1
    assert ask(line, b"hello") == b"hello"
    wired = line_of(fault="echo", wire=115200)
    wired.feed(READ_ID)
    wired.advance(5 * BYTE)
    assert wired.take() == READ_ID[:5]
    assert run(wired)[-1][0] == pytest.approx(18 * BYTE)


def test_loopback_is_no_device() -> None:
    line = line_of(fault="loopback")
    line.client_baud = 300
    assert ask(line, SET_INDEX) == SET_INDEX
    assert line.command("get 1492 2") == "C6 01"


def test_duplicate() -> None:
    assert ask(line_of(fault="duplicate"), READ_ID) == ID_IS_1 + ID_IS_1


def test_late() -> None:
    line = line_of(fault="late")
    assert ask(line, READ_ID) == b""
    assert run(line) == [(0.6, ID_IS_1)]
    shorter = line_of(fault="late", late=0.05)
    shorter.feed(READ_ID)
    assert run(shorter) == [(0.05, ID_IS_1)]


def test_late_reply_comes_into_a_later_exchange() -> None:
    line = line_of(fault="late", every=2)
    assert ask(line, READ_VOLTAGE) == VOLTAGE
    assert ask(line, READ_POSITIONS) == b""
    assert ask(line, READ_ID) == ID_IS_1
    assert run(line) == [(0.6, POSITIONS)]


def test_slow() -> None:
    line = line_of(fault="slow")
    line.feed(READ_ID)
    assert run(line) == [(0.02, ID_IS_1)]


def test_stale_sends_the_previous_reply_first() -> None:
    line = line_of(fault="stale")
    assert ask(line, READ_POSITIONS) == POSITIONS
    assert ask(line, READ_VOLTAGE) == POSITIONS + VOLTAGE
    assert ask(line, READ_ID) == VOLTAGE + ID_IS_1


def test_disconnect_in_the_middle_of_a_reply() -> None:
    line = line_of(fault="disconnect", after=1)
    assert ask(line, READ_ID) == ID_IS_1
    assert not line.hung_up
    assert ask(line, READ_VOLTAGE) == VOLTAGE[:5]
    assert line.hung_up
    assert ask(line, READ_ID) == b""
    assert line.next_event() is None
    line.reconnect()
    assert not line.hung_up
    assert ask(line, READ_ID) == ID_IS_1[:4]


def test_disconnect_on_a_wire_waits_for_the_half() -> None:
    line = line_of(fault="disconnect", wire=115200)
    line.feed(READ_VOLTAGE)
    came = run(line)
    assert came == [(pytest.approx(14 * BYTE), VOLTAGE[:5])]
    assert line.hung_up


def test_faults_combine() -> None:
    line = line_of(fault="echo,duplicate,bad-checksum")
    assert ask(line, READ_VOLTAGE) == READ_VOLTAGE + 2 * (VOLTAGE[:-1] + b"\x0d")


def test_faults_reach_the_late_frame_of_their_request() -> None:
    line = line_of(fault="bad-checksum")
    assert ask(line, SAVE) == SAVE_ACK[:-1] + b"\x09"
    assert [data for _, data in run(line)] == [SAVED[:-1] + b"\x07"]
    healthy = line_of(fault="bad-checksum", after=1)
    assert ask(healthy, SAVE) == SAVE_ACK
    assert run(healthy) == [(1.0, SAVED)]


@each_row("fault", sorted(LINE_FAULTS))
@each_row("wire", [None, 115200])
def test_every_fault_ends_and_repeats_with_its_seed(fault: str, wire: int | None) -> None:
    rows = []
    for _ in range(2):
        line = line_of(fault=fault, seed=5, **({"wire": wire} if wire else {}))
        line.feed(READ_VOLTAGE + SET_INDEX)
        first = line.take()
        rows.append((first, run(line, until=100.0)))
        assert line.next_event() is None
    assert rows[0] == rows[1]


# -- which requests ---------------------------------------------------------------------------------------------------------------


def hit(line: Line, count: int) -> str:
    return "".join("-" if ask(line, READ_ID) else "X" for _ in range(count))


def test_after_and_every() -> None:
    assert hit(line_of(fault="silent", after=3), 8) == "---XXXXX"
    assert hit(line_of(fault="silent", every=3), 8) == "--X--X--"
    assert hit(line_of(fault="silent", after=2, every=2), 8) == "---X-X-X"


def test_only_requests_that_are_understood_count() -> None:
    line = line_of(fault="silent", after=2)
    ask(line, b"\x00\xff" + READ_ID[:-1] + b"\x77")
    ask(line, bytes.fromhex("EB 90 09 04 11 E8 03 01 0A"))
    line.advance(1.0)
    assert line.command("requests") == "requests 0"
    assert hit(line, 3) == "--X"
    assert line.command("requests") == "requests 3"


def test_echo_obeys_after() -> None:
    line = line_of(fault="echo", after=1)
    assert ask(line, READ_ID) == ID_IS_1
    assert ask(line, READ_ID) == READ_ID + ID_IS_1


# -- the client's speed --------------------------------------------------------------------------------------------------------------


def test_wrong_speed_is_silence() -> None:
    line = line_of()
    line.client_baud = 57600
    assert ask(line, SET_INDEX) == b""
    assert line.next_event() is None
    assert line.requests == 0
    line.client_baud = 115200
    assert ask(line, READ_ID) == ID_IS_1
    assert line.command("get 1492 2") == "C6 01"


def test_unknown_speed_is_never_wrong() -> None:
    line = line_of(baud=19200)
    line.client_baud = None
    assert ask(line, READ_ID) == ID_IS_1


def test_first_speed_option() -> None:
    line = line_of(baud=57600)
    line.client_baud = 57600
    assert ask(line, bytes.fromhex("EB 90 01 04 11 E9 03 01 03")) == bytes.fromhex("90 EB 01 04 11 E9 03 01 03")


@each_row("fault", ["garble", "noise"])
def test_garbage_at_a_wrong_speed(fault: str) -> None:
    line = line_of(fault=fault)
    line.client_baud = 9600
    heard = ask(line, READ_ID)
    assert 3 <= len(heard) <= 12
    assert ID_IS_1 not in heard
    assert line.requests == 0


def test_garble_leaves_the_right_speed_alone() -> None:
    line = line_of(fault="garble")
    line.client_baud = 115200
    assert ask(line, READ_ID) == ID_IS_1


# -- power, control, bounds ----------------------------------------------------------------------------------------------------------


def test_power_off_takes_what_was_on_the_wire() -> None:
    line = line_of(wire=115200)
    line.feed(DUMP_2)
    line.advance(50 * BYTE)
    assert len(line.take()) == 41
    line.power(False)
    assert line.take() == b""
    assert line.next_event() is None
    line.feed(READ_ID)
    assert line.next_event() is None
    line.power(True)
    line.feed(READ_ID)
    assert text(run(line)) == ID_IS_1


def test_commands_of_the_line() -> None:
    line = line_of()
    assert line.command("fault silent, echo") == "fault echo,silent"
    assert ask(line, READ_ID) == READ_ID
    assert line.command("fault none") == "fault none"
    assert ask(line, READ_ID) == ID_IS_1
    line.feed(SET_INDEX)
    line.take()
    assert line.command("power-cycle") == "power cycled"
    assert line.command("get 1492 2") == "C6 01"
    assert "temperature" in line.command("help")


def test_client_that_writes_without_end_does_not_make_it_grow() -> None:
    line = line_of(wire=50)
    for _ in range(100):
        line.feed(bytes(4096))
    assert sum(len(segment.data) for segment in line._rx) <= 65536


@each_row(
    ("options", "message"),
    [
        ({"falt": "noise"}, "unknown option 'falt'.*Known: .*fault"),
        ({"fault": "noize"}, "unknown fault 'noize'.*Known: .*noise"),
        ({"fault": "noise,,none,noize"}, "unknown fault 'noize'"),
        ({"seed": "one"}, "seed=one: not a whole number"),
        ({"seed": "-1"}, "seed=-1: out of range"),
        ({"after": "-1"}, "after=-1"),
        ({"every": "0"}, "every=0"),
        ({"wire": "fast"}, "wire=fast"),
        ({"wire": "0"}, "wire=0: out of range"),
        ({"turnaround": "nan"}, "turnaround=nan"),
        ({"late": "x"}, "late=x: not a number"),
        ({"id": "0"}, "id=0: out of range 1 to 254"),
        ({"id": "255"}, "id=255"),
        ({"baud": "9600"}, "baud=9600: not one of 115200, 57600, 19200"),
        ({"result-flag": "11"}, "result-flag=11: not one of 17, 18"),
        ({"ack-id": "both"}, "ack-id=both"),
        ({"jitter": "yes"}, "jitter=yes"),
        ({"power-cycle": "2"}, "power-cycle=2"),
        ({"calibration": "-1"}, "calibration=-1"),
    ],
)
def test_bad_options(options: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        create("exo", options)
    assert "\n" not in str(caught.value)


def test_unknown_kind() -> None:
    for name in ("toaster", "engine", "inspire", "cli", "../exo", ""):
        with pytest.raises(ValueError, match=rf"no simulated device '{name}'\. Known: {', '.join(kinds())}"):
            create(name, {})
    assert "exo" in kinds()


def test_clock_is_the_business_of_the_caller() -> None:
    assert ask(line_of(clock="virtual"), READ_ID) == ID_IS_1


def test_random_numbers_are_the_same_everywhere() -> None:
    numbers = Random(1)
    assert [numbers.between(0, 999) for _ in range(4)] == [602, 355, 838, 531]
    assert {Random(seed).between(1, 6) for seed in range(100)} == {1, 2, 3, 4, 5, 6}


def test_a_client_that_changed_its_speed_after_asking_hears_no_answer() -> None:
    line = line_of(turnaround=0.3)
    line.client_baud = 115200
    assert ask(line, READ_ID) == b""
    line.client_baud = 57600
    line.advance(0.5)
    assert line.take() == b"" and line.requests == 1
    line.client_baud = 115200
    line.feed(READ_ID)
    line.advance(1.0)
    assert line.take() == ID_IS_1
