"""Looking for hands: one id after the other, never an echo or noise, and always with an end."""

from __future__ import annotations

import pytest

from handctl.devices.inspire.id_search import TURNAROUND
from handctl.devices.inspire.scan import parse_ids
from handctl.errors import NoAnswer, ProtocolError, UsageError
from handctl.model.scan_task import ScanTask
from tests.inspire.scanning import ALL_IDS, scan_hand, scan_on
from tests.support.each_row import each_row
from tests.support.scripted import (
    Babble,
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    reply_to,
    unhex,
)

SPEEDS = [115200, 57600, 19200]
VOLTAGE = unhex("2E 02")
STATES = bytes(12) + unhex("1F 20 21 22 23 00")
"""1606, 18 bytes: no errors, nothing at the status codes of other hands, five temperatures (exo §2.3.12, §2.3.13)."""
TWIN_READ = "EB 90 {id} 04 11 0A 06 0C"


def requests_in(data: bytes) -> list[bytes]:
    """The 9-byte reads of a window, without what goes ahead of them and between them."""
    found = [b"\xeb\x90" + rest[:7] for rest in data.split(b"\xeb\x90")[1:]]
    assert found and all(len(one) == 9 for one in found)
    return found


class Bench:
    """Hands at (speed, id) on one line. `delay` until a reply, `echo` of what is sent, `junk` for some ids."""

    def __init__(self, *hands: tuple[int, int], delay: float = 0.002, echo: bool = False) -> None:
        self.hands = set(hands)
        self.delay = delay
        self.echo = echo
        self.junk: dict[int, bytes] = {}
        self.link = ScriptedLink(self.answer, baud=115200)
        self.asked: list[tuple[int, int]] = []

    def answer(self, data: bytes) -> list[Reply]:
        replies: list[Reply] = [(0.0, data)] if self.echo else []
        for number, request in enumerate(requests_in(data)):
            if request[4] == 0x30:
                continue  # only a wrist answers that
            assert request[4] == 0x11
            moment = (number + 1) * 90 / (self.link.baud or 115200) + self.delay
            if request[5:8] in (unhex("C0 05 02"), unhex("0A 06 02")):
                self.asked.append((self.link.baud or 0, request[2]))
            if (self.link.baud, request[2]) in self.hands:
                data_bytes = {2: VOLTAGE, 18: STATES}.get(request[7], bytes(request[7]))
                replies.append((moment, reply_to(request, data_bytes)))
            if request[2] in self.junk:
                replies.append((moment, self.junk[request[2]]))
        return replies

    def scan(self, **options: object) -> ScanTask:
        return scan_on(self.link, **options)


def hits(table: ScanTask) -> list[tuple[object, object]]:
    return [(row["baud"], row["id"]) for row in table.rows]


# -- finding ----------------------------------------------------------------------------------------------------------

CROWD = [(115200, 1), (115200, 8), (115200, 9), (115200, 100), (115200, 144), (115200, 235), (115200, 254)]


def test_a_crowd_is_found() -> None:
    table = Bench(*CROWD).scan(baud=115200)
    assert hits(table) == CROWD
    assert table.failure is None
    assert table.rows[0] == {
        "family": "exo", "link": "scripted", "baud": 115200, "id": 1, "protocol": "eb90", "model": None,
        "evidence": "system_voltage reads 558, asked twice", "suspicion": None,
    }  # fmt: skip


@pytest.mark.parametrize("echo", [False, True])
def test_hands_are_found_at_every_speed(echo: bool) -> None:
    hands = [(115200, 3), (57600, 180), (19200, 254)]
    bench = Bench(*hands, echo=echo)
    assert hits(bench.scan()) == hands
    assert bench.link.baud == 115200


def test_the_simulator_is_found() -> None:
    for device_id in (1, 2, 8, 9, 100, 144, 180, 235, 254):
        for fault in ("", "&fault=echo", "&fault=noise", "&fault=dribble", "&fault=split"):
            hand, link = fake_hand(f"id={device_id}{fault}")
            table = scan_hand(hand, baud=115200)
            assert hits(table) == [(115200, device_id)], (device_id, fault)
            assert changing(link.sent) == []


def test_a_late_reply_names_its_id_in_a_later_window() -> None:
    """Also that of the very last id, for which no further window comes."""
    table = Bench((115200, 7), (115200, 200), (115200, 254), delay=0.035).scan(baud=115200)
    assert hits(table) == [(115200, 7), (115200, 200), (115200, 254)]


def test_the_first_hand_ends_the_scan() -> None:
    bench = Bench((115200, 1), (115200, 2))
    assert hits(bench.scan(find_all=False)) == [(115200, 1)]
    assert {device_id for _, device_id in bench.asked} == {1}


def test_id_1_is_asked_at_every_speed_before_all_others() -> None:
    bench = Bench((19200, 1), (115200, 2))
    assert hits(bench.scan(find_all=False)) == [(19200, 1)]
    assert {device_id for _, device_id in bench.asked} == {1}
    assert list(dict.fromkeys(speed for speed, _ in bench.asked)) == SPEEDS


def test_a_hit_counts_only_after_a_second_answer() -> None:
    bench = Bench((115200, 5))
    plain = bench.answer

    def once(data: bytes) -> list[Reply]:
        replies = plain(data)
        if replies:
            bench.hands.clear()
        return replies

    bench.link.answer = once
    hand = hand_on(bench.link)
    table = scan_hand(hand, baud=115200)
    assert table.rows == []
    assert "unconfirmed" in codes(hand)
    assert table.failure is not None


def test_only_reads_of_two_bytes_are_sent_to_look() -> None:
    bench = Bench()
    bench.scan(silence=60.0)
    asked = [request for data in bench.link.sent for request in requests_in(data)]
    usual = {hexed(request[3:8]) for request in asked if request[2] not in (0x01, 0x23, 0x27, 0x31)}
    assert usual == {"04 11 C0 05 02"}
    # The first id is asked the other question as well, and with patience every id: a firmware may lack a register.
    assert {hexed(request[3:8]) for request in asked if request[2] == 1} == {"04 11 C0 05 02", "04 11 0A 06 02"}
    bench.scan()
    asked = [request for data in bench.link.sent for request in requests_in(data)]
    others = {request[2] for request in asked if hexed(request[3:8]) == "04 11 0A 06 02"}
    assert set(ALL_IDS) - others == {3, 13, 216, 220, 230}  # ids or sums upon which a BarrettHand acts
    # The sum of these three would be FF, 03 and 0D, upon which a BarrettHand acts.
    others = {hexed(request[3:8]) for request in asked if request[2] in (0x23, 0x27, 0x31)}
    assert others == {"04 11 0A 06 02"}


def test_link_without_a_speed_is_scanned_once() -> None:
    bench = Bench((115200, 5))
    bench.link.can_set_baud = False
    assert hits(bench.scan()) == [(115200, 5)]
    assert bench.link.bauds == []


def test_link_without_any_baud_has_null() -> None:
    bench = Bench()
    bench.link.baud, bench.link.can_set_baud = None, False
    plain = bench.answer
    bench.link.answer = lambda data: [
        (0.0, reply_to(r, (VOLTAGE * 9)[: r[7]])) for r in requests_in(data) if r[2] == 5 and r[4] == 0x11
    ]
    assert hits(bench.scan()) == [(None, 5)]
    assert plain


# -- what is no hand --------------------------------------------------------------------------------------------------


def test_an_echo_is_never_a_hand() -> None:
    table = Bench(echo=True).scan()
    assert table.rows == []
    assert isinstance(table.failure, ProtocolError)
    assert (table.failure.exit_code, table.failure.code) == (5, "echo")
    assert "TX-RX short" in table.failure.hint


def test_a_loopback_of_the_simulator_is_never_a_hand() -> None:
    hand, _ = fake_hand("fault=loopback")
    table = scan_hand(hand, baud=115200)
    assert table.rows == []
    assert table.failure is not None
    assert table.failure.code == "echo"


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_never_a_hand(seed: int) -> None:
    import random

    source = random.Random(seed)
    likely = unhex("90 EB EB 90 01 04 05 11 C0 05 02 2E")
    link = ScriptedLink(lambda data: [(0.004, bytes(source.choices(likely, k=source.randrange(30))))], baud=115200)
    table = scan_on(link, ids=list(range(1, 60)))
    assert table.rows == []
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (5, "garbage")


@pytest.mark.parametrize(
    "reply",
    [
        pytest.param("90 EB 00 05 11 C0 05 2E 02 0B", id="id 0"),
        pytest.param("90 EB FF 05 11 C0 05 2E 02 0A", id="id 255"),
        pytest.param("90 EB 05 04 11 C0 05 2E 0D", id="one byte"),
        pytest.param("90 EB 05 05 11 C1 05 2E 02 11", id="other address"),
        pytest.param("90 EB 05 05 12 C0 05 2E 02 11", id="a write ack"),
        pytest.param("90 EB 05 05 11 C0 05 2E 02 11", id="bad sum"),
        pytest.param("90 EB 05 00 05", id="length 0"),
    ],
)
def test_other_frames_are_never_a_hand(reply: str) -> None:
    link = ScriptedLink(lambda data: [(0.004, unhex(reply))], baud=115200)
    table = scan_on(link, ids=list(range(1, 17)))
    assert table.rows == []
    assert table.failure is not None


def test_silence_is_no_answer() -> None:
    table = Bench().scan()
    assert isinstance(table.failure, NoAnswer)
    assert table.failure.code == "no-answer" and "1 to 254" in table.failure.text
    assert "power" in table.failure.hint


# -- bounds -----------------------------------------------------------------------------------------------------------


def test_each_id_has_room_for_its_answer_on_the_wire_and_no_more() -> None:
    bench = Bench()
    table = bench.scan(baud=115200, silence=9.0)
    assert (table.facts["probes"], bench.asked[0], bench.asked[1]) == (255, (115200, 1), (115200, 1))
    assert bench.link.now() == pytest.approx(255 * (190 / 115200 + TURNAROUND) + 0.05 + 0.52, abs=0.05)
    assert table.left == [
        "all ids a second time, with more room for each reply, as a half-duplex line needs whose delay varies: --all does that"
    ]


def test_a_silent_line_is_asked_for_so_long_and_what_was_left_is_told() -> None:
    bench = Bench()
    table = bench.scan(ids=(), find_all=False, silence=1.9)
    assert bench.link.now() <= 2.6
    assert table.failure is not None and table.failure.code == "no-answer"
    assert table.left[0].startswith("ids ") and "to 254 of exo at 57600" in table.left[0]
    assert table.left[1].startswith("ids 2 to 254 of exo at 19200")


def test_whoever_is_heard_is_asked_on() -> None:
    """A line that is not silent has no such bound: the hand answers at the last speed."""
    assert hits(Bench((19200, 1)).scan(ids=(), find_all=False, silence=0.5)) == [(19200, 1)]


def test_hands_among_garbage_are_found() -> None:
    bench = Bench((115200, 9), (115200, 12), (115200, 16))
    bench.junk.update({11: unhex("90 EB 0C FF 11"), 13: unhex("90")})
    assert hits(bench.scan(baud=115200)) == [(115200, 9), (115200, 12), (115200, 16)]


def test_the_deadline_of_the_command_ends_the_scan() -> None:
    bench = Bench()
    hand = hand_on(bench.link, bound=bench.link.deadline(0.3))
    table = scan_hand(hand)
    assert table.rows == []
    assert bench.link.now() < 0.6
    assert table.failure is not None
    assert (table.failure.code, table.failure.exit_code) == ("deadline", 4)
    assert "silence" not in table.failure.text, "most ids were not asked"


def test_nothing_is_sent_after_the_deadline() -> None:
    bench = Bench()
    bound = bench.link.deadline(0.3)
    scan_hand(
        hand_on(bench.link, bound=bound),
    )
    assert max(bench.link.sent_at) <= bound.at


def test_a_deadline_that_was_long_enough_is_not_blamed() -> None:
    bench = Bench()
    table = scan_hand(hand_on(bench.link, bound=bench.link.deadline(40.0)))
    assert table.failure is not None
    assert table.failure.code == "no-answer"


def test_a_twin_on_a_link_without_a_speed_is_told_without_one() -> None:
    hand, _ = fake_hand("fault=twin-id&jitter=1")
    hand.link.baud, hand.link.can_set_baud = None, False
    scan_hand(hand, ids=[1])
    assert not any("None" in entry.text for entry in hand.journal.messages)


def test_a_flood_ends_too() -> None:
    link = Babble(baud=115200)
    link.pause = 0.0005
    table = scan_on(link, ids=[1, 2], baud=115200)
    assert table.rows == []
    assert link.now() < 60.0


def test_the_speed_of_the_port_is_restored_after_an_interrupt() -> None:
    bench = Bench()
    bench.link.interrupt_at = 1.5
    with pytest.raises(KeyboardInterrupt):
        bench.scan()
    assert bench.link.bauds[-1] == 115200


# -- twins ------------------------------------------------------------------------------------------------------------


def test_two_hands_with_one_id_are_suspected() -> None:
    """Presence probes agree, jittering positions do not: good and bad sums mix (dossier 4.14)."""
    bench = Bench((115200, 6))
    plain, count = bench.answer, [0]

    def answer(data: bytes) -> list[Reply]:
        replies = plain(data)
        if data[7] == 12:
            count[0] += 1
            if count[0] % 3:
                return [(delay, reply[:-1] + bytes([reply[-1] ^ 1])) for delay, reply in replies]
        return replies

    bench.link.answer = answer
    hand = hand_on(bench.link)
    table = scan_hand(hand, ids=[6])
    assert hits(table) == [(115200, 6)]
    assert table.rows[0]["suspicion"]
    assert "twin-id" in codes(hand)
    assert count[0] == 20


def test_one_hand_is_not_suspected() -> None:
    hand, _ = fake_hand("jitter=1")
    table = scan_hand(hand, ids=[1, 2])
    assert [row["suspicion"] for row in table.rows] == [None]
    assert codes(hand) == ["scanned"]


def test_twins_of_the_simulator_are_suspected() -> None:
    """Every other reply is two replies at once."""
    hand, _ = fake_hand("fault=twin-id&every=2")
    table = scan_hand(hand, ids=[1])
    assert hits(table) == [(115200, 1)]
    assert table.rows[0]["suspicion"]


# -- arguments --------------------------------------------------------------------------------------------------------


@each_row(
    ("text", "ids"),
    [
        ("1", [1]), ("1-3", [1, 2, 3]), ("7,3,5", [7, 3, 5]), ("1,10-12,2", [1, 10, 11, 12, 2]), ("254", [254]),
        ("1-2,2-3", [1, 2, 3]), (" 4 , 5 ", [4, 5]), ("1-254", ALL_IDS), ("9-9", [9]),
    ],
)  # fmt: skip
def test_ids(text: str, ids: list[int]) -> None:
    assert parse_ids(text, "serial") == ids


@each_row(
    "text",
    ["", "0", "255", "0-5", "250-255", "x", "1-", "-5", "1,,2", "1-2-3", "5-3", "1,5-3", "1.5", "99999999999999999999",
     "1-99999999999999999999", "1-10000000000000000000"],
)  # fmt: skip
def test_ids_that_do_not_exist(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_ids(text, "serial")
    assert caught.value.exit_code == 2
