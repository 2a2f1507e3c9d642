"""Looking for wrists: on a serial line as for the other hands, on CAN back to back, bounded, and never one's own frames."""

from __future__ import annotations

from itertools import pairwise

import pytest

from handctl.devices.inspire import scan as target
from handctl.devices.inspire.scan import parse_ids
from handctl.devices.inspire.wrist.probe import TARGET
from handctl.errors import UsageError
from handctl.link import CanFrame
from handctl.model.scan_task import ScanTask
from tests.inspire.scanning import scan_hand
from tests.inspire.wrist_support import (
    WIRES,
    Arrival,
    BabblingFrames,
    ScriptedFrames,
    Wrist,
    can,
    fake_port,
    fake_wrist,
    wrist_on,
    writes_of,
)
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink, hexed

ALL_IDS = list(range(1, 255))
PITCH = b"\xa7\xfe"


def scan(wrist: Wrist, ids: list[int] | None = None, **options: object) -> ScanTask:
    return scan_hand(wrist, TARGET, **{"ids": ids or ALL_IDS, "baud": 115200, **options})


def found(table: ScanTask) -> list[int]:
    return [row["id"] for row in table.rows]


def ended(table: ScanTask) -> tuple[str, int] | None:
    return (table.failure.code, table.failure.exit_code) if table.failure is not None else None


# -- serial -----------------------------------------------------------------------------------------------------------


class Line:
    """Wrists by id on one line. `echo` of what is sent comes first."""

    def __init__(self, *ids: int, echo: bool = False) -> None:
        self.ids, self.echo = ids, echo
        self.link = ScriptedLink(self.answer, baud=115200)
        self.asked: list[int] = []

    def answer(self, data: bytes) -> list[Reply]:
        found = [b"\xeb\x90" + rest[:7] for rest in data.split(b"\xeb\x90")[1:]]
        replies: list[Reply] = [(0.0, data)] if self.echo else []
        for number, request in enumerate(found):
            assert request[:2] == b"\xeb\x90"
            assert request[4] == 0x30, "31 and 32 move an exo"
            address = request[5] + 256 * request[6]
            if (address, request[7]) in ((1024, 2), (1026, 2)):
                quiet = not {0x03, 0x0D, 0xFF} & set(request)
                assert quiet or request[2] in (0x03, 0x0D), "only what a BarrettHand does not act upon goes to anybody"
                self.asked.append(request[2])
            else:
                assert request[2] in self.ids, "its angles are asked of a wrist that has answered"
                assert 1020 <= address <= address + request[7] <= 1028, "what is documented beside them"
            if request[2] in self.ids and self.link.baud == 115200:
                value = (PITCH * 2 + b"\x6f\x00" * 2)[address - 1020 :][: request[7]]
                body = bytes([request[2], request[7] + 3]) + request[4:7] + value
                moment = (number + 1) * 90 / 115200 + 0.002
                replies.append((moment, b"\x90\xeb" + body + bytes([sum(body) % 256])))
        return replies


CROWD = (1, 8, 9, 100, 144, 235, 254)


def test_a_crowd_of_wrists_is_found() -> None:
    line = Line(*CROWD)
    table = scan(wrist_on(line.link))
    assert found(table) == list(CROWD)
    assert table.failure is None
    assert set(line.asked) == set(ALL_IDS)
    assert table.rows[0] == {
        "family": "wrist", "link": "scripted", "baud": 115200, "id": 1, "protocol": "eb90", "model": None,
        "evidence": "pitch_raw reads -345, asked twice", "suspicion": None,
    }  # fmt: skip


def test_one_by_one_never_sends_two_probes_at_once() -> None:
    """On RS-485 a reply would collide with the next probe (dossier §6)."""
    line = Line(5)
    scan(wrist_on(line.link))
    assert all(len(request) == 9 for request in line.link.sent)
    moments = line.link.sent_at
    assert all(later - earlier >= 180 / 115200 for earlier, later in pairwise(moments))
    assert hexed(line.link.sent[0]) == "EB 90 01 04 30 00 04 02 3B"


def test_a_half_duplex_echo_is_no_wrist() -> None:
    assert found(scan(wrist_on(Line(7, echo=True).link))) == [7]
    table = scan(wrist_on(Line(echo=True).link))
    assert (found(table), ended(table)) == ([], ("echo", 5))


def test_the_first_one_ends_it() -> None:
    line = Line(3, 4)
    assert found(scan(wrist_on(line.link), find_all=False)) == [3]
    assert max(line.asked) < 10


@pytest.mark.parametrize(
    ("fault", "code", "exit_code"),
    [("silent", "no-answer", 4), ("no-wrist", "no-answer", 4), ("loopback", "echo", 5), ("bad-checksum", "bad-checksum", 5)],
)  # fmt: skip
def test_nothing_found_on_the_line_says_what_came(fault: str, code: str, exit_code: int) -> None:
    wrist, link = fake_wrist("serial", f"fault={fault}")
    table = scan(wrist)
    assert (found(table), ended(table)) == ([], (code, exit_code))
    assert table.failure is not None
    assert "exo" not in table.failure.text + table.failure.hint
    assert writes_of(link) == []
    assert link.now() < 20.0


# -- CAN --------------------------------------------------------------------------------------------------------------


class Bus:
    """Wrists by id on one bus, in front of foreign frames."""

    def __init__(self, *ids: int, traffic: tuple[str, ...] = (), delay: float = 0.001) -> None:
        self.ids, self.traffic, self.delay = ids, traffic, delay
        self.link = ScriptedFrames(self.answer)

    def answer(self, frame: CanFrame) -> list[Arrival]:
        assert frame.can_id >> 14 in (4 << 12 | 1020, 4 << 12 | 1022, 4 << 12 | 1024), f"no probe: {frame}"
        assert frame.data == b"\x02", "one byte could be a twin of its answer"
        arrivals: list[Arrival] = [(0.0, can(text)) for text in self.traffic]
        if frame.can_id & 0x3FFF in self.ids:
            arrivals.append((self.delay, CanFrame(frame.can_id, PITCH)))
        return arrivals


@each_row("ids", [(1,), (1, 2, 31, 32, 33, 64, 254), (254,)])
def test_wrists_on_a_bus(ids: tuple[int, ...]) -> None:
    bus = Bus(*ids)
    table = scan(wrist_on(bus.link))
    assert (found(table), table.failure) == (list(ids), None)
    assert (table.rows[0]["family"], table.rows[0]["baud"], table.rows[0]["id"]) == ("wrist", None, ids[0])
    assert table.rows[0]["evidence"] == "pitch_raw reads -345, asked twice"
    assert {frame.can_id & 0x3FFF for frame in bus.link.sent} == set(ALL_IDS)
    assert table.facts["probes"] == 254 + len(ids)


def test_ids_beyond_a_byte() -> None:
    bus = Bus(0, 255, 16383)
    assert found(scan(wrist_on(bus.link), [0, 1, 255, 256, 16383])) == [0, 255, 16383]


def test_a_scan_is_bounded_and_says_what_it_did() -> None:
    bus = Bus()
    wrist = wrist_on(bus.link)
    table = scan(wrist)
    assert ended(table) == ("no-answer", 4)
    assert bus.link.now() <= 2 * (0.25 + 254 / 32 * 0.02 + 0.52 + 0.05)
    assert len(bus.link.sent) == 2 * 254  # for the pitch, then for a current: a firmware may lack a register
    (said,) = [entry.text for entry in wrist.journal.messages if entry.code == "scanned"]
    for part in ("508", "read-only", "pitch_raw", "ids 1 to 254"):
        assert part in said


def test_the_first_hit_ends_it() -> None:
    bus = Bus(3, 200)
    assert found(scan(wrist_on(bus.link), find_all=False)) == [3]
    assert len(bus.link.sent) < 64


def test_a_late_answer_counts() -> None:
    assert found(scan(wrist_on(Bus(7, 250, delay=0.03).link), patience=0.02)) == [7, 250]


def test_an_answer_once_and_never_again_is_no_hit() -> None:
    answered: list[int] = []

    def once(frame: CanFrame) -> list[Arrival]:
        if frame.can_id & 0x3FFF == 9 and not answered:
            answered.append(9)
            return [(0.001, CanFrame(frame.can_id, PITCH))]
        return []

    wrist = wrist_on(ScriptedFrames(once))
    table = scan(wrist)
    assert found(table) == []
    assert table.failure is not None
    assert "unconfirmed" in [entry.code for entry in wrist.journal.messages]


@pytest.mark.parametrize(
    "text",
    [
        "10FF0003 [1] 02",  # a probe: somebody else scans, or an echo
        "10FF0003 [0]",
        "10FF0003 [8] 00 00 00 00 00 00 00 00",
        "10FF8003 [2] 65 04",  # yaw of id 3
        "00FF0003 [2] DD 05",  # 1020 of the hand
        "10FF03E7 [2] A7 FE",  # id 999, not asked
    ],
)
def test_foreign_traffic_is_never_a_hit(text: str) -> None:
    table = scan(wrist_on(Bus(traffic=(text,)).link))
    assert found(table) == []
    assert table.failure is not None
    assert found(scan(wrist_on(Bus(5, traffic=(text,)).link))) == [5]


def test_foreign_frames_are_counted() -> None:
    wrist = wrist_on(Bus(5, traffic=("1FFFFFFE [2] 01 02",)).link)
    scan(wrist)
    assert wrist.journal.counters.foreign_frames == 255


def test_a_babbling_bus_ends() -> None:
    link = BabblingFrames("1FFFFFFE [2] 01 02")
    table = scan(wrist_on(link))
    assert found(table) == []
    assert link.now() < 10.0


def test_the_deadline_ends_a_scan() -> None:
    bus = Bus()
    wrist = wrist_on(bus.link, bound=bus.link.deadline(0.05))
    assert ended(scan(wrist)) == ("deadline", 4)
    assert bus.link.now() <= 0.1
    assert len(bus.link.sent) < 254


@each_row(
    ("fault", "code", "exit_code"),
    [
        ("silent", "no-answer", 4), ("no-wrist", "no-answer", 4), ("no-ack", "no-ack", 4), ("bus-off", "bus-off", 3),
        ("loopback", "echo", 5), ("wrong-id", "wrong-id", 5), ("truncate", "cut-short", 5),
    ],
)  # fmt: skip
def test_nothing_found_on_the_bus_says_what_came(fault: str, code: str, exit_code: int) -> None:
    """Errors 4 and 5 distinguish silence, echo and wrong id (cli contract, section 5)."""
    wrist, link = fake_wrist("can", f"fault={fault}&id=7")
    table = scan(wrist)
    assert (found(table), ended(table)) == ([], (code, exit_code))
    assert writes_of(link) == []


@pytest.mark.parametrize(
    "query", ["fault=echo", "fault=noise", "fault=duplicate", "fault=slow", "traffic=900&wire=auto"]
)
def test_a_disturbed_bus_still_shows_the_wrist(query: str) -> None:
    wrist, _ = fake_wrist("can", f"{query}&id=77")
    assert found(scan(wrist)) == [77]


# -- ids and the command line -----------------------------------------------------------------------------------------


@each_row(
    ("text", "ids"),
    [
        ("1", [1]), ("1-3", [1, 2, 3]), ("0,16383", [0, 16383]), ("7,5-6,5", [7, 5, 6]), (" 1 , 2 ", [1, 2]),
        ("300-302", [300, 301, 302]),
    ],
)  # fmt: skip
def test_lists_of_ids(text: str, ids: list[int]) -> None:
    assert parse_ids(text, "can") == ids


def test_4096_ids_at_the_most() -> None:
    """All 16383 would only be traffic for the others on the bus."""
    assert parse_ids("1-4096", "can") == list(range(1, 4097))
    assert target.MOST_CAN_IDS == 4096
    for text in ("1-4097", "0-16383"):
        with pytest.raises(UsageError) as caught:
            parse_ids(text, "can")
        assert "4096" in caught.value.text


@each_row("text", ["", "a", "1-", "-1", "1--2", "1-b", "5-1", "16384", "1-16384", "1;2", "1.5"])
def test_impossible_lists_of_ids(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_ids(text, "can")
    assert caught.value.exit_code == 2


@each_row("wire", WIRES)
def test_scan_at_the_command_line(wire: str) -> None:
    result = run("wrist", "scan", "--ids", "1-20", "-p", fake_port(wire, "id=12"), "--json")
    assert result.code == 0
    (row,) = result.rows
    assert (row["family"], row["id"]) == ("wrist", 12)
    assert "pitch_raw reads -345" in row["evidence"]
    assert row["baud"] == (115200 if wire == "serial" else None)
    assert row["link"] == fake_port(wire, "id=12")


@each_row(("wire", "ids"), [("serial", "0-3"), ("serial", "255"), ("can", "16384"), ("can", "0-16383")])
def test_impossible_ids_send_nothing(wire: str, ids: str) -> None:
    result = run("wrist", "scan", "--ids", ids, "-p", fake_port(wire), "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0)


def test_a_given_speed_is_the_one_that_is_asked() -> None:
    """--baud is not passed over; without it the speeds of the hand behind it are asked, too (RH56 §2.4.2)."""
    port = "fake://wrist?baud=57600&clock=virtual"
    for more in (("--baud", "57600"), ()):
        (row,) = run("wrist", "scan", "--ids", "1-3", *more, "-p", port, "--json").rows
        assert row["baud"] == 57600
    assert run("wrist", "scan", "--ids", "1-3", "--baud", "115200", "-p", port, "--json").code == 4


@each_row("command", [("scan",), ("wrist", "scan"), ("wrist", "dump")], ids=" ".join)
def test_a_bus_tells_what_was_measured_of_it(command: tuple[str, ...]) -> None:
    line = run(*command, "-p", "fake://wrist?bus=can&wire=auto&turnaround=0.004&clock=virtual", "--json").json["line"]
    assert 4.0 <= line["round_trip_ms"] <= 5.0
    assert 0.0 <= line["spread_ms"] <= 1.0
    assert (line["speed_matters"], line["half_duplex"]) == (None, None)
    assert (line["echo"], line["others"]) == (False, False)
