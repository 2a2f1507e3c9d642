"""The hand: what it reads, writes and reads back, how it judges itself, and how rows look (exo §2.3)."""

from __future__ import annotations

import pytest

from handctl.command.get_set_watch import select
from handctl.devices.inspire.exo.device import registers_view, status_view, unhealthy
from handctl.devices.inspire.exo.register_map import EXO
from handctl.errors import CheckFailed, DeviceRefused, LinkError, NoAnswer
from handctl.model.param import Reading
from handctl.model.result import Cell
from handctl.sim.engine import line_and_faults
from tests.support.each_row import each_row
from tests.support.scripted import (
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    script,
    unhex,
    zeros_to_reads,
)

WRITE_EXAMPLE = "EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0"
EXAMPLE_ACK = "90 EB 01 04 12 CE 05 01 EB"
READ_POSITION_SET = "EB 90 01 04 11 CE 05 0A F3"
EXAMPLE_READ = "90 EB 01 0D 11 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 CF"
DEFAULTS_READ = "90 EB 01 0D 11 CE 05 97 00 FC 00 61 01 C6 01 2B 02 DB"
EXAMPLE = "position_set=500,500,-1,0,500"


def changes(*texts: str) -> list[tuple[object, object]]:
    return list(EXO.assignments(texts))


# -- reading ----------------------------------------------------------------------------------------------------------


def test_rows_have_the_keys_of_the_contract() -> None:
    hand, _ = fake_hand()
    rows = hand.table(hand.read(select(EXO, ("system_voltage", "current.index", "error.index")))).rows
    assert rows[0] == {
        "name": "system_voltage", "finger": None, "address": 1472, "value": 558, "unit": None, "raw": "2E 02",
        "label": "raw, scale unknown", "path": "system_voltage",
    }  # fmt: skip
    assert rows[1] == {
        "name": "current", "finger": "index", "address": 1600, "value": 24, "unit": "mA", "raw": "18 00", "label": None,
        "path": "current.index",
    }  # fmt: skip
    assert rows[2] == {
        "name": "error", "finger": "index", "address": 1609, "value": 0, "unit": None, "raw": "00", "label": "ok",
        "path": "error.index", "errors": [],
    }  # fmt: skip


def test_addresses_are_those_of_the_elements() -> None:
    """exo §2.3.7 to §2.3.13, the last printed row of each group; 1609 is the index finger (its own example)."""
    hand, _ = fake_hand()
    rows = {(row["name"], row["finger"]): row["address"] for row in hand.dump().rows}
    assert rows["position_set", "thumb"] == 1494
    assert rows["force_set", "thumb"] == 1506
    assert rows["position_actual", "thumb_rotation"] == 1556
    assert rows["force_actual", "thumb"] == 1590
    assert rows["current", "thumb"] == 1602
    assert rows["error", "index"] == 1609
    assert rows["error", "thumb"] == 1610
    assert rows["temperature", "thumb"] == 1622
    assert len(rows) == 42


def test_the_manuals_error_example() -> None:
    """exo §2.3.12: ERROR(3) = 06 means over temperature and over current of the index finger."""
    hand, _ = fake_hand("fault=faults")
    rows = {row["finger"]: row["label"] for row in hand.table(hand.read(select(EXO, ("error",)))).rows}
    assert rows == {
        "little": "locked_rotor",
        "ring": "over_temperature",
        "middle": "over_current",
        "index": "over_temperature, over_current",
        "thumb": "motor_abnormal, communication",
    }


def test_undefined_error_bits_are_named_as_such() -> None:
    hand, _ = fake_hand("fault=unknown-bits")
    (row,) = hand.table(hand.read(select(EXO, ("error.index",)))).rows
    assert (row["value"], row["raw"], row["label"]) == (160, "A0", "unknown_bit_5, unknown_bit_7")


def test_identity_says_only_what_the_manual_has() -> None:
    hand, _ = fake_hand("id=7", 7)
    assert hand.identity() == {"kind": "exo", "id": 7}


# -- planning and writing ---------------------------------------------------------------------------------------------


def test_adjacent_elements_share_a_frame() -> None:
    hand, _ = fake_hand()
    steps = hand.plan(
        changes("position_set.little=1", "position_set.ring=2", "position_set.index=4", "force_set.little=5")
    )
    assert [hexed(step.data) for step in steps] == [
        "EB 90 01 07 12 CE 05 01 00 02 00 F0",
        "EB 90 01 05 12 D4 05 04 00 F5",
        "EB 90 01 05 12 DA 05 05 00 FC",
    ]
    assert all(step.moves for step in steps)
    assert "position_set.ring = 2" in steps[0].meaning


def test_id_and_speed_strand() -> None:
    hand, _ = fake_hand()
    steps = hand.plan(changes("id=2", "baud_code=1"))
    assert [(hexed(step.data), step.moves, step.strands) for step in steps] == [
        ("EB 90 01 04 12 E8 03 02 04", False, True),
        ("EB 90 01 04 12 E9 03 01 04", False, True),
    ]


def test_write_is_read_back() -> None:
    hand = hand_on(link := ScriptedLink(script((WRITE_EXAMPLE, [EXAMPLE_ACK]), (READ_POSITION_SET, [EXAMPLE_READ]))))
    readings = hand.write(changes(EXAMPLE))
    assert [reading.value for reading in readings] == [500, 500, -1, 0, 500]
    assert len(link.sent) == 2


def test_a_write_that_did_not_take_is_a_failed_check() -> None:
    hand = hand_on(ScriptedLink(script((WRITE_EXAMPLE, [EXAMPLE_ACK]), (READ_POSITION_SET, [DEFAULTS_READ]))))
    with pytest.raises(CheckFailed) as caught:
        hand.write(changes(EXAMPLE))
    assert (caught.value.exit_code, caught.value.code) == (7, "read-back")
    assert "position_set.little reads 151 after 500 was written" in caught.value.text
    assert "position_set.thumb reads 555 after 500 was written" in caught.value.text


@each_row("lost", [None, "90 EB 01 04 12 CE 05 01 EC", "90 EB 02 04 12 CE 05 01 EC", "90 EB 01", "55"])
def test_a_lost_ack_is_cleared_up_by_reading(lost: str | None) -> None:
    hand = hand_on(
        link := ScriptedLink(script((WRITE_EXAMPLE, [lost] if lost else []), (READ_POSITION_SET, [EXAMPLE_READ])))
    )
    assert [reading.value for reading in hand.write(changes(EXAMPLE))] == [500, 500, -1, 0, 500]
    assert changing(link.sent) == [WRITE_EXAMPLE]
    assert codes(hand) == ["ack-lost"]


def test_a_lost_write_is_not_sent_again() -> None:
    hand = hand_on(link := ScriptedLink(script((WRITE_EXAMPLE, []), (READ_POSITION_SET, [DEFAULTS_READ]))))
    with pytest.raises(CheckFailed):
        hand.write(changes(EXAMPLE))
    assert changing(link.sent) == [WRITE_EXAMPLE]


@each_row(
    "fault",
    [*sorted(line_and_faults.LINE_FAULTS), "strict"],
)
@each_row("seed", [0, 3])
def test_whatever_happens_each_write_goes_out_once(fault: str, seed: int) -> None:
    hand, link = fake_hand(f"fault={fault}&seed={seed}&every=2")
    try:
        hand.write(changes("position_set.index=300", "force_set=1,2,3,4,5"))
    except Exception as exc:  # noqa: BLE001 - whatever happens
        assert getattr(exc, "exit_code", None) in (3, 4, 5, 6, 7), exc
    written = changing(link.sent)
    assert len(written) == len(set(written))
    assert len(written) <= 2


def test_refusal_stops_and_tells_what_was_written() -> None:
    hand, link = fake_hand("fault=refuse&after=1")
    with pytest.raises(DeviceRefused) as caught:
        hand.write(changes("position_set.index=300", "force_set.index=5", "force_set.little=5"))
    assert len(changing(link.sent)) == 2
    assert "already written: position_set.index" in caught.value.hint
    assert caught.value.exit_code == 6


def test_lost_link_tells_what_was_written() -> None:
    hand, _ = fake_hand("fault=disconnect&after=1")
    with pytest.raises(LinkError) as caught:
        hand.write(changes("position_set.index=300", "force_set.index=5"))
    assert "Already written: position_set.index" in caught.value.hint


def test_id_is_written_last_and_the_hand_is_followed() -> None:
    hand, link = fake_hand()
    readings = hand.write(changes("id=5", "position_set.index=300"))
    assert {reading.element.full_name: reading.value for reading in readings} == {"id": 5, "position_set.index": 300}
    assert hand.bus.id == 5
    assert changing(link.sent) == ["EB 90 01 05 12 D4 05 2C 01 1E", "EB 90 01 04 12 E8 03 05 07"]


def test_nothing_there_after_a_write_is_no_answer() -> None:
    hand, link = fake_hand("fault=deaf")
    with pytest.raises(NoAnswer):
        hand.write(changes("position_set.index=300"))
    assert changing(link.sent) == ["EB 90 01 05 12 D4 05 2C 01 1E"]


# -- commands ---------------------------------------------------------------------------------------------------------


def test_force_command_shows_positions() -> None:
    hand, link = fake_hand()
    rows = hand.command("force", [100, -100, 0, 1000, -1000]).rows
    assert [(row["name"], row["finger"], row["value"]) for row in rows] == [
        ("position_actual", "little", 110), ("position_actual", "ring", 220), ("position_actual", "middle", 330),
        ("position_actual", "index", 440), ("position_actual", "thumb", 550), ("position_actual", "thumb_rotation", 660),
    ]  # fmt: skip
    assert [hexed(request) for request in link.sent] == ["EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B"]


def test_position_command_shows_forces() -> None:
    hand, link = fake_hand()
    rows = hand.command("position", [500, 400, 300, 200, 100]).rows
    assert [(row["name"], row["finger"], row["value"], row["raw"]) for row in rows] == [
        ("force_actual", "little", -11, "F5 FF"), ("force_actual", "ring", 12, "0C 00"),
        ("force_actual", "middle", -13, "F3 FF"), ("force_actual", "index", 14, "0E 00"),
        ("force_actual", "thumb", -15, "F1 FF"),
    ]  # fmt: skip
    assert [hexed(request) for request in link.sent] == ["EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D"]


def test_force_command_does_not_take_the_reply_of_a_position_command() -> None:
    """Length 0B is a position reply; the force reply has 0D (exo §2.2.1, §2.2.2)."""
    hand = hand_on(ScriptedLink(lambda request: [(0.0, unhex("90 EB 01 0B 31 F5 FF 0C 00 F3 FF 0E 00 F1 FF 2D"))]))
    with pytest.raises(Exception) as caught:
        hand.command("force", [0] * 5)
    assert getattr(caught.value, "exit_code", None) == 5


# -- judging ----------------------------------------------------------------------------------------------------------


def test_a_healthy_hand_passes() -> None:
    hand, _ = fake_hand()
    table = hand.status(check=True)
    assert table.failure is None
    assert codes(hand) == []


def test_every_finding_names_finger_and_cause() -> None:
    hand, _ = fake_hand("fault=faults")
    table = hand.status(check=True)
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (7, "unhealthy")
    for part in (
        "Little: locked_rotor (0x01)",
        "Index: over_temperature, over_current (0x06)",
        "Thumb: motor_abnormal",
    ):
        assert part in table.failure.text
    assert "goes away as it cools, now 78 °C" in table.failure.text
    assert codes(hand) == ["unhealthy"] * 5


def test_without_check_findings_are_messages_only() -> None:
    hand, _ = fake_hand("fault=faults")
    assert hand.status(check=False).failure is None
    assert codes(hand) == ["unhealthy"] * 5


@each_row(
    ("name", "raw", "found"),
    [
        ("system_voltage", 0, True), ("system_voltage", 1, False), ("system_voltage", -1, True), ("system_voltage", -32768, True), ("position_actual.index", 1000, False),
        ("position_actual.index", 1001, True), ("position_actual.index", -1, True), ("temperature.index", 100, False),
        ("temperature.index", 101, True), ("current.index", -1, True), ("error.index", 0, False),
        ("error.index", 128, True), ("position_set.index", -1, False), ("position_set.index", -2, True),
        ("id", 0, True), ("id", 255, True), ("baud_code", 3, True), ("force_actual.index", -1001, True),
    ],
)  # fmt: skip
def test_ranges_of_the_manual_are_the_measure(name: str, raw: int, found: bool) -> None:
    (element,) = EXO.find(name)[1]
    assert bool(unhealthy([Reading(element, raw)])) is found


def test_an_error_wins_over_findings() -> None:
    def answer(request: bytes) -> list[Reply]:
        return [] if request[5:7] == b"\x46\x06" else zeros_to_reads(request)

    hand = hand_on(ScriptedLink(answer))
    hand.bus.retries = 0
    table = hand.table(hand.read(select(EXO, ("error", "baud_code"))))
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (4, "no-answer")
    assert "error" in table.failure.text


# -- identity ---------------------------------------------------------------------------------------------------------


@each_row("fault", ["healthy", "faults", "fresh", "hot", "block-silent"])
def test_a_sick_or_fresh_exo_is_still_an_exo(fault: str) -> None:
    hand, link = fake_hand(f"fault={fault}")
    hand.check_identity()
    assert changing(link.sent) == []


def test_foreign_registers_fail_the_identity_check() -> None:
    """1005 saves here and is the factory reset of another hand of the maker: look first."""
    hand, link = fake_hand("fault=foreign")
    with pytest.raises(CheckFailed) as caught:
        hand.check_identity()
    assert (caught.value.exit_code, caught.value.code) == (7, "not-an-exo")
    assert caught.value.code == "not-an-exo" and "EH55BF1" in caught.value.text
    assert "system_voltage = 0" in caught.value.text
    assert "--skip-identity-check" in caught.value.hint
    assert changing(link.sent) == []


# -- finding for restore ----------------------------------------------------------------------------------------------


def test_restore_finds_the_hand_at_its_old_or_its_stored_id() -> None:
    hand, _ = fake_hand("id=9")
    hand.find_for_restore({"id": 9})
    assert hand.bus.id == 9
    assert "found" in codes(hand)
    hand, _ = fake_hand()
    hand.find_for_restore({"id": 9})
    assert hand.bus.id == 1
    assert codes(hand) == []


def test_restore_without_a_stored_id_asks_nobody() -> None:
    hand, link = fake_hand()
    hand.find_for_restore({})
    hand.find_for_restore({"id": 1})
    assert link.sent == []


def test_restore_on_a_line_with_echo_finds_the_hand_too() -> None:
    """An echo is no device (dossier 4.11): the probe of the free id must not end the search."""
    hand, _ = fake_hand("id=9&fault=echo")
    hand.find_for_restore({"id": 9})
    assert hand.bus.id == 9


# -- for people -------------------------------------------------------------------------------------------------------


def test_register_view_is_one_line_a_register() -> None:
    hand, _ = fake_hand("fault=faults")
    (grid,) = registers_view(hand.dump().rows)
    lines = {line[0]: line for line in grid.lines}
    assert len(lines) == 13
    assert lines["position_actual"][2:9] == ("", "110", "220", "330", "440", "550", "660")
    assert lines["system_voltage"][2] == "558"
    assert lines["error"][6] == Cell("06", "bad")
    assert "error index: over_temperature, over_current" in grid.notes
    assert "system_voltage: raw, scale unknown" in grid.notes


def test_status_view_has_a_line_per_finger() -> None:
    hand, _ = fake_hand("fault=fresh")
    table = hand.status(check=False)
    (grid,) = status_view(table.rows)
    assert [line[0] for line in grid.lines] == ["little", "ring", "middle", "index", "thumb", grid.lines[5][0]]
    assert grid.lines[3][:4] == ("index", "440", Cell("-", "dim"), "14")
    assert "rotation" in str(grid.lines[5][0])
    assert grid.lines[5][1] == "660"
    assert "id 1" in grid.title
    assert "115200 bit/s" in grid.title
    assert "558" in grid.title


def test_a_failed_read_is_a_question_mark() -> None:
    hand, _ = fake_hand()
    readings = [Reading(element, None, b"", NoAnswer("no answer")) for element in EXO["current"].each]
    table = hand.table(readings)
    assert all("value" not in row and row["error"] == "no answer" for row in table.rows)
    (grid,) = registers_view(table.rows)
    assert Cell("?", "bad") in grid.lines[0]
    assert "current: no answer" in grid.notes
