"""Registers and frames by number: what is decoded, what is refused, and what may move the hand without being asked."""

from __future__ import annotations

import json

import pytest

from handctl.cli import main
from handctl.devices.inspire import raw as by_number
from handctl.devices.inspire.exo import raw
from handctl.errors import HandctlError, NoAnswer, UsageError
from tests.support.cli import run, spying
from tests.support.each_row import each_row
from tests.support.scripted import (
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    reply_to,
    script,
    unhex,
)

READ_VOLTAGE, VOLTAGE = "EB 90 01 04 11 C0 05 02 DD", "90 EB 01 05 11 C0 05 2E 02 0C"
FORCE = "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B"
INDEX_300 = "EB 90 01 05 12 D4 05 2C 01 1E"


# -- hex --------------------------------------------------------------------------------------------------------------


@each_row("text", ["EB 90 01", "eb9001", "EB:90:01", "EB,90,01", "0xEB 0x90 0x01", " EB  90 01 ", "eb 9001"])
def test_ways_to_write_bytes(text: str) -> None:
    assert by_number.parse_hex(text) == unhex("EB 90 01")


@each_row("text", ["", " ", "E", "EB 9", "EB 9 00 1", "xyz", "EB 90 1", "EBx", "²²", "EB-90"])
def test_what_is_no_hex(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        by_number.parse_hex(text)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("words", [["EB", "9", "00", "1"], ["EB90010", "411C00502DD"], ["E", "B9", "00", "1"]])
def test_half_bytes_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Digits are never regrouped across words: these bytes are sent exactly."""
    assert main(["exo", "raw", *words, "--fake", "--dry-run", "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["rows"] == []


# -- reading ----------------------------------------------------------------------------------------------------------


def test_documented_elements_are_decoded_and_gaps_stay_raw() -> None:
    hand, _ = fake_hand()
    rows = by_number.read(hand, 1472, 18).rows
    assert [(row["name"], row["finger"], row["address"], row["value"], row["raw"]) for row in rows] == [
        ("system_voltage", None, 1472, 558, "2E 02"),
        (None, None, 1474, None, "00 00 00 00 00 00 00 00 00 00 00 00"),
        ("position_set", "little", 1486, 151, "97 00"),
        ("position_set", "ring", 1488, 252, "FC 00"),
    ]
    assert rows[1]["label"] == "undocumented"


def test_an_undocumented_register_stays_raw() -> None:
    """1006 has no address in the manual (exo §2.3.5) and cannot be read."""
    hand, _ = fake_hand()
    rows = by_number.read(hand, 1005, 2).rows
    assert [(row["name"], row["address"], row["raw"]) for row in rows] == [("save", 1005, "00"), (None, 1006, "00")]


@each_row(("address", "count", "raw"), [(1487, 1, "00"), (1486, 1, "97"), (1487, 2, "00 FC")])
def test_halves_of_an_element_are_not_called_undocumented(address: int, count: int, raw: str) -> None:
    """1486..1495 is documented (exo §2.3.7), also where a read cuts an element."""
    hand, _ = fake_hand()
    rows = by_number.read(hand, address, count).rows
    assert " ".join(row["raw"] for row in rows) == raw
    assert all(row["value"] is None for row in rows)
    assert not any(row["label"] == "undocumented" for row in rows)


def test_read_is_one_request_at_its_limits() -> None:
    hand, link = fake_hand()
    assert len(by_number.read(hand, 65284, 252).rows) == 1
    assert len(link.sent) == 1
    for address, count in ((1000, 253), (1000, 0), (65535, 2), (-1, 1)):
        with pytest.raises(UsageError):
            by_number.read(hand, address, count)
    assert len(link.sent) == 1


# -- planning a write -------------------------------------------------------------------------------------------------


@each_row(
    ("address", "data", "frame", "meaning"),
    [
        (1492, "2C 01", INDEX_300, "position_set.index = 300"),
        (
            1492,
            "2C 01 FF FF",
            "EB 90 01 07 12 D4 05 2C 01 FF FF 1E",
            "position_set.index = 300, position_set.thumb = -1",
        ),
        (1498, "18 FC", "EB 90 01 05 12 DA 05 18 FC 0B", "force_set.little = -1000"),
        (1001, "02", "EB 90 01 04 12 E9 03 02 05", "baud_code = 2"),
    ],
)
def test_legal_writes_are_planned(address: int, data: str, frame: str, meaning: str) -> None:
    hand, _ = fake_hand()
    step = by_number.plan_write(hand, address, unhex(data), False)
    assert hexed(step.data) == frame
    assert meaning in step.meaning
    assert step.moves or step.strands


@each_row(
    ("address", "data"),
    [
        pytest.param(1492, "E9 03", id="1001 is out of range, exo §2.3.7"),
        pytest.param(1492, "FE FF", id="-2"),
        pytest.param(1498, "17 FC", id="-1001, exo §2.3.8"),
        pytest.param(1001, "03", id="speed code 3, exo §2.3.2"),
        pytest.param(1000, "05", id="the id has its own command"),
        pytest.param(1004, "01", id="clear errors is a trigger"),
        pytest.param(1005, "01", id="save is a trigger"),
        pytest.param(1006, "01", id="factory reset is a trigger"),
        pytest.param(1009, "01", id="calibrate is a trigger"),
        pytest.param(1472, "00 00", id="read-only, exo §2.3"),
        pytest.param(1546, "00 00", id="read-only, exo §2.3.9"),
        pytest.param(1606, "00", id="read-only, exo §2.3.12"),
        pytest.param(1487, "00 00", id="across two elements"),
        pytest.param(1492, "2C", id="half an element"),
        pytest.param(1492, "2C 01 00", id="one and a half elements"),
        pytest.param(1494, "00 00 00 00", id="past the end of the group"),
        pytest.param(1484, "00 00 00 00", id="into the group from a gap"),
        pytest.param(1000, "01 00", id="two groups"),
        pytest.param(1496, "00 00", id="gap"),
        pytest.param(2000, "00", id="no register"),
        pytest.param(1003, "00 01", id="gap and trigger"),
    ],
)
def test_writes_that_the_manual_does_not_allow(address: int, data: str) -> None:
    hand, link = fake_hand()
    with pytest.raises(UsageError) as caught:
        by_number.plan_write(hand, address, unhex(data), False)
    assert caught.value.exit_code == 2
    assert link.sent == []


def test_undocumented_addresses_need_the_switch_and_count_as_dangerous() -> None:
    hand, _ = fake_hand()
    step = by_number.plan_write(hand, 2000, b"\x07", True)
    assert (hexed(step.data), step.moves, step.strands) == ("EB 90 01 04 12 D0 07 07 F5", True, True)
    for address in (1004, 1005, 1006, 1009, 1484, 1495):
        with pytest.raises(UsageError):
            by_number.plan_write(hand, address, b"\x01\x00\x00\x00", True)


# -- writing ----------------------------------------------------------------------------------------------------------


def test_write_is_read_back() -> None:
    hand, link = fake_hand()
    table = by_number.write(hand, 1492, unhex("2C 01"))
    assert [(row["name"], row["finger"], row["value"]) for row in table.rows] == [("position_set", "index", 300)]
    assert table.failure is None
    assert [hexed(request) for request in link.sent] == [INDEX_300, "EB 90 01 04 11 D4 05 02 F1"]


def test_write_that_did_not_take() -> None:
    hand, _ = fake_hand()
    table = by_number.write(hand, 2000, b"\x07")
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (7, "read-back")
    assert "reads 00 after 07" in table.failure.text
    assert table.rows[0]["raw"] == "00"


def test_lost_ack_of_a_write_is_read_back() -> None:
    hand, link = fake_hand("fault=silent&after=0&every=1")
    with pytest.raises(NoAnswer):
        by_number.write(hand, 1492, unhex("2C 01"))
    assert changing(link.sent) == [INDEX_300]
    hand = hand_on(
        link := ScriptedLink(script((INDEX_300, []), ("EB 90 01 04 11 D4 05 02 F1", ["90 EB 01 05 11 D4 05 2C 01 1D"])))
    )
    assert by_number.write(hand, 1492, unhex("2C 01")).failure is None
    assert codes(hand) == ["ack-lost"]


# -- planning raw bytes -----------------------------------------------------------------------------------------------


MODEL = {"hand": ("--model", "df")}
BOTH = "EB 90 01 05 12 D4 05 2C 01 1E EB 90 01 05 12 D6 05 2C 01 20"
ANGLES = "EB 90 01 05 31 0E 04 64 00 AD EB 90 01 05 31 10 04 64 00 AF"
CUT = "EB 90 01 05 12 D4 05 2C 01 1E EB 90 01"


@each_row(
    ("family", "words", "data", "fault", "states"),
    [
        (family, words, data, fault, states)
        for family, both in (("exo", BOTH), ("hand", BOTH), ("wrist", ANGLES))
        for words in ("raw", "terminal")
        for data, fault, states in (
            (both, "none", ["confirmed"] * 2),
            (both, "silent", ["sent"] * 2),
            (CUT, "none", ["confirmed", "sent"]) if both is BOTH else (both, "none", ["confirmed"] * 2),
        )
    ],
)
def test_each_of_several_frames_is_a_step(family: str, words: str, data: str, fault: str, states: list[str]) -> None:
    """None of what was sent is left over as not sent: who reads that sends it again."""
    link = f"fake://{family}?clock=virtual{'&fault=silent' if fault == 'silent' else ''}"
    result = run(family, words, data, "-y", "--json", "--assume-identity", *MODEL.get(family, ()), "-p", link)
    writes = result.json["writes"]
    if words == "terminal" and fault == "silent":  # it stops what is not known to have been refused
        writes = writes[: len(states)]
    assert [row["state"] for row in writes] == states, result
    assert unhex(" ".join(row["bytes"] for row in writes)) == unhex(data)
    assert all(row["meaning"] for row in writes)


def test_reads_are_harmless() -> None:
    step = raw.plan_raw(unhex(READ_VOLTAGE), False)
    assert (step.moves, step.strands) == (False, False)
    assert "2 bytes at 1472" in step.meaning


@each_row(
    "data",
    [
        pytest.param(INDEX_300, id="write"),
        pytest.param(FORCE, id="force command"),
        pytest.param("EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D", id="position command"),
        pytest.param("EB 90 01 05 12 0E 04 18 FC 3E", id="wrist address with the flag of a hand"),
        pytest.param("EB 90 01 04 77 00 00 00 7C", id="unknown flag"),
        pytest.param("EB 90 01 0B 32 F4 01 90 01", id="the beginning of a command, which other bytes may complete"),
        pytest.param(f"{READ_VOLTAGE} {READ_VOLTAGE}", id="two frames"),
        pytest.param(f"00 {READ_VOLTAGE}", id="junk before"),
        pytest.param(f"{READ_VOLTAGE} 00", id="junk behind"),
        pytest.param(FORCE[3:], id="a command without its first byte, which may have been sent before"),
        pytest.param(FORCE[6:], id="a command without its header"),
        pytest.param(f"90 {FORCE[:2]} {FORCE[6:]}", id="a command with the header of a reply"),
    ],
)
def test_anything_else_asks_first(data: str) -> None:
    step = raw.plan_raw(unhex(data), False)
    assert step.data == unhex(data)
    assert step.moves or step.strands


@each_row(
    ("family", "words", "code"),
    [
        (family, (command, text), code)
        for family in ("exo", "wrist", "hand")
        for command in ("raw", "terminal")
        for text, code in (
            (READ_VOLTAGE, 0),
            *((one, 8) for one in (FORCE[3:], FORCE[6:], "EB", f"90 {FORCE[:2]} {FORCE[6:]}")),
        )
    ],
)
def test_only_a_whole_read_goes_unasked(family: str, words: tuple[str, ...], code: int) -> None:
    with spying() as spy:
        result = run(family, *words, "-p", f"fake://{family}?clock=virtual")
    assert result.code == code, result
    assert code == 0 or sum(line.requests for line in spy.lines) == 0, "nothing went out"


@each_row(
    "data",
    [
        pytest.param(f"EB 90 01 04 11 C0 05 02 00 {FORCE}", id="spoiled read, force command"),
        pytest.param(f"EB 90 01 04 11 C0 05 02 00 {INDEX_300}", id="spoiled read, write"),
        pytest.param(f"EB 90 01 0F 12 {INDEX_300} 00 00 00 00 00", id="write inside a spoiled frame"),
    ],
)
def test_a_bad_frame_does_not_hide_a_good_one(data: str) -> None:
    """The hand drops what does not fit and carries out what follows: a person must be asked (cli contract, 7)."""
    hand, _ = fake_hand()
    before = hexed(hand.bus.read(1486, 22))
    by_number.exchange(hand, unhex(data), 0.5)
    assert hexed(hand.bus.read(1486, 22)) != before, "the simulated hand carries it out"
    step = raw.plan_raw(unhex(data), False)
    assert step.moves or step.strands


def test_one_spoiled_frame_alone_is_harmless() -> None:
    step = raw.plan_raw(unhex("EB 90 01 04 11 C0 05 02 00"), False)
    assert not step.moves and not step.strands
    assert "2 bytes at 1472" in step.meaning and "checksum" in step.meaning


@pytest.mark.parametrize("data", [INDEX_300, FORCE, "EB 90 01 04 12 ED 03 01 08", "EB 90 01 04 77 00 00 00 7C"])
def test_a_command_with_any_checksum_asks_as_with_the_right_one(data: str) -> None:
    """A whole command frame with a wrong sum: a bus error or a lenient device could take it."""
    right = raw.plan_raw(unhex(data), False)
    for wrong in range(256):
        step = raw.plan_raw(unhex(data)[:-1] + bytes([wrong]), False)
        if wrong == 0xEB:  # it might begin a frame
            assert step.moves and step.strands
            continue
        assert (step.moves, step.strands) == (right.moves, right.strands), wrong
        assert right.meaning in step.meaning, wrong
        assert step.data[-1] == wrong and (step.meaning == right.meaning) == (step.data == right.data)


def test_what_is_out_of_range_is_refused_with_a_wrong_checksum_too() -> None:
    with pytest.raises(UsageError, match="1001"):
        raw.plan_raw(unhex("EB 90 01 05 12 D4 05 E9 03 00"), False)
    assert raw.plan_raw(unhex("EB 90 01 05 12 D4 05 E9 03 00"), True).moves


def test_a_spoiled_command_between_other_bytes_asks() -> None:
    step = raw.plan_raw(unhex(f"00 00 {FORCE[:-2]}00 00"), False)
    assert step.moves and step.strands


@each_row(
    ("data", "code"),
    [
        pytest.param("EB 90 01 0B 31 0C 04 00 00 00 00 00 00 00 00 4D", "ambiguous", id="1036 is a wrist address"),
        pytest.param("EB 90 01 0B 31 FC 03 00 00 00 00 00 00 00 00 3C", "ambiguous", id="1020, the first"),
        pytest.param("EB 90 01 0B 31 13 04 00 00 00 00 00 00 00 00 54", "ambiguous", id="1043, the last"),
        pytest.param("EB 90 01 0B 31 E9 03 00 00 00 00 00 00 00 00 29", "out-of-range", id="force 1001"),
        pytest.param("EB 90 01 0B 31 00 00 17 FC 00 00 00 00 00 00 50", "out-of-range", id="force -1001"),
        pytest.param("EB 90 01 0B 32 F4 01 F4 01 FF FF 00 00 F4 01 1B", "out-of-range", id="position -1"),
        pytest.param("EB 90 01 0B 32 E9 03 00 00 00 00 00 00 00 00 2A", "out-of-range", id="position 1001"),
    ],
)
def test_commands_out_of_range_are_refused_unless_forced(data: str, code: str) -> None:
    with pytest.raises(UsageError) as caught:
        raw.plan_raw(unhex(data), False)
    assert caught.value.code == code
    assert "--force-ambiguous" in f"{caught.value.text} {caught.value.hint}" or code == "out-of-range"
    assert raw.plan_raw(unhex(data), True).moves


# -- exchanging -------------------------------------------------------------------------------------------------------


def test_exchange_shows_every_frame() -> None:
    hand, link = fake_hand()
    table = by_number.exchange(hand, unhex("EB 90 01 04 12 ED 03 01 08"), 1.5)
    assert [(row["direction"], row["flag"], row["address"], row["data"]) for row in table.rows] == [
        ("device", "12", 1005, "01"),
        ("device", "11", 1005, "00"),
    ]
    assert table.extra["received"] == "90 EB 01 04 12 ED 03 01 08 90 EB 01 04 11 ED 03 00 06"
    assert [hexed(request) for request in link.sent] == ["EB 90 01 04 12 ED 03 01 08"]
    assert table.failure is None


def test_exchange_decodes_values() -> None:
    hand, _ = fake_hand()
    (row,) = by_number.exchange(hand, unhex("EB 90 01 04 11 0A 06 04 2A"), 0.5).rows
    assert "position_actual.little to ring = 110 220" in row["meaning"]
    (row,) = by_number.exchange(hand, unhex(FORCE), 0.5).rows
    assert row["address"] is None and "110 220 330 440 550 660" in row["meaning"]


def test_exchange_knows_its_own_bytes() -> None:
    hand, _ = fake_hand("fault=echo")
    table = by_number.exchange(hand, unhex(READ_VOLTAGE), 0.5)
    assert [row["direction"] for row in table.rows] == ["host", "device"]
    assert "our own bytes" in table.rows[0]["meaning"] and "system_voltage = 558" in table.rows[1]["meaning"]
    assert table.failure is None


@each_row(("fault", "code"), [("loopback", "echo"), ("bad-checksum", "bad-checksum"), ("silent", "no-answer")])
def test_exchange_names_what_is_wrong(fault: str, code: str) -> None:
    hand, link = fake_hand(f"fault={fault}")
    with pytest.raises(HandctlError) as caught:
        table = by_number.exchange(hand, unhex(READ_VOLTAGE), 0.5)
        raise table.failure  # type: ignore[misc]
    assert caught.value.code == code
    assert len(link.sent) == 1


def test_exchange_sends_any_bytes_once() -> None:
    hand, link = fake_hand()
    with pytest.raises(NoAnswer):
        by_number.exchange(hand, b"\x00\x01\x02", 0.2)
    assert link.sent == [b"\x00\x01\x02"]


def test_exchange_finds_frames_around_a_false_header() -> None:
    def answer(request: bytes) -> list[Reply]:
        return [(0.0, unhex("90 EB 01 FF 11") + reply_to(request, unhex("2E 02")))]

    table = by_number.exchange(hand_on(ScriptedLink(answer)), unhex(READ_VOLTAGE), 0.2)
    assert [row["raw"] for row in table.rows] == [VOLTAGE]


# -- writes by raw bytes, a save by raw bytes ---------------------------------------------------------------------------

SAVE = "EB 90 01 04 12 ED 03 01 08"


@each_row(
    ("data", "words"),
    [
        (SAVE, "save = 1"),
        ("EB 90 01 04 12 EE 03 01 09", "factory_reset = 1"),
        ("EB 90 01 04 12 F1 03 01 0C", "calibrate = 1"),
        (INDEX_300, "position_set.index = 300"),
    ],
)
def test_a_raw_write_is_named_before_it_is_confirmed(data: str, words: str) -> None:
    """Someone may be wearing the hand: 1009 is not a number to say yes to (exo §2.3)."""
    assert words in raw.plan_raw(unhex(data), False).meaning


@each_row(
    "data",
    [
        pytest.param("EB 90 01 05 12 CE 05 E9 03 D7", id="position_set 1001"),
        pytest.param("EB 90 01 05 12 CE 05 FE FF E8", id="position_set -2"),
        pytest.param("EB 90 01 05 12 DA 05 17 FC 0A", id="force_set -1001"),
        pytest.param("EB 90 01 04 12 E8 03 00 02", id="id 0"),
        pytest.param("EB 90 01 04 12 E9 03 03 06", id="baud_code 3"),
        pytest.param("EB 90 FF 04 12 E8 03 02 02", id="to id 255"),
        pytest.param("EB 90 00 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1C", id="to id 0"),
    ],
)
def test_raw_writes_out_of_range_are_refused_unless_forced(data: str) -> None:
    """Out of range is refused (cli contract, 7); ids 0 and 255 are never sent to (dossier, 1.1)."""
    with pytest.raises(UsageError) as caught:
        raw.plan_raw(unhex(data), False)
    assert "--force-ambiguous" in caught.value.hint
    assert raw.plan_raw(unhex(data), True).moves


@each_row("flag", ["17", "18"])
def test_the_result_of_a_raw_save_is_no_refusal(flag: str) -> None:
    """00 is saved, whichever flag the result has (dossier, E12 and 4.3)."""
    hand, _ = fake_hand(f"result-flag={flag}")
    table = by_number.exchange(hand, unhex(SAVE), 2.0)
    assert ["saved" in row["meaning"] for row in table.rows] == [False, True]
    assert table.failure is None


@each_row("flag", ["17", "18"])
def test_a_raw_save_that_failed_is_exit_6(flag: str) -> None:
    hand, _ = fake_hand(f"fault=save-fails&result-flag={flag}")
    table = by_number.exchange(hand, unhex(SAVE), 2.0)
    assert ["not saved" in row["meaning"] for row in table.rows] == [False, True]
    assert table.failure is not None
    assert table.failure.exit_code == 6


def test_bytes_shorter_than_a_frame_with_a_late_answer() -> None:
    link = ScriptedLink(lambda request: [(0.1, unhex("90 EB 01 04 12 ED 03 FF 06"))])
    table = by_number.exchange(hand_on(link), unhex("EB 90 01"), 0.5)
    assert [row["address"] for row in table.rows] == [1005]
    assert table.failure is None


def test_interrupted_raw_bytes_are_told_once_they_went_out() -> None:
    data = unhex("EB 90 01 04 12 F1 03 01 0C")
    hand, step = hand_on(ScriptedLink(lambda request: [])), raw.plan_raw(data, False)
    with pytest.raises(KeyboardInterrupt), by_number.goes_on(hand, step):
        raise KeyboardInterrupt
    with pytest.raises(HandctlError) as caught, by_number.goes_on(hand, step):
        hand.bus.send(data)
        raise KeyboardInterrupt
    assert caught.value.exit_code == 130
    assert "calibrate = 1" in caught.value.text


READ_VOLTAGE = "EB 90 01 04 11 C0 05 02 DD"


@each_row(
    ("family", "frame", "words"),
    [
        ("exo", "EB 90 01 0B 31 F4 01 00 00 00 00 00 00 00 00 32", ("force command", "500 0 0 0 0")),
        ("exo", "EB 90 01 05 12 D4 05 2C 01 1E", ("position_set.index = 300",)),
        ("wrist", "EB 90 01 07 31 0E 04 E8 03 18 FC 4A", ("yaw_set = 10.00", "pitch_set = -10.00")),
        ("hand", "EB 90 01 05 12 D4 05 2C 01 1E", ("angle_set.index = 300",)),
    ],
)
@each_row("around", ["00 {}", "{} 00", READ_VOLTAGE + " {}", "{} EB 90 01"])
def test_a_frame_among_other_bytes_is_planned_as_it_is_alone(
    family: str, frame: str, words: tuple[str, ...], around: str
) -> None:
    """The device acts on it wherever it is in what arrives: the question names it, and what is refused alone is refused."""
    (row,) = run(family, "raw", around.format(frame), "-n", "-p", f"fake://{family}?clock=virtual", "--json").rows
    assert row["moves"]
    for word in words:
        assert word in row["meaning"]


@each_row(
    ("family", "frame", "code"),
    [
        ("exo", "EB 90 01 05 12 D4 05 E9 03 DE", "out-of-range"),
        ("wrist", "EB 90 01 0B 31 0C 04 00 00 00 00 00 00 00 00 4D", "ambiguous"),
        ("wrist", "EB 90 01 04 12 12 09 01 33", "never"),
        ("hand", "EB 90 01 04 12 12 09 01 33", "never"),
        ("hand", "EB 90 01 05 12 D4 05 E9 03 DE", "out-of-range"),
    ],
)
@each_row("around", ["00 {}", READ_VOLTAGE + " {}"])
def test_a_frame_among_other_bytes_is_refused_as_it_is_alone(family: str, frame: str, code: str, around: str) -> None:
    result = run(family, "raw", around.format(frame), "-y", "-p", f"fake://{family}?clock=virtual", "--json")
    assert (result.code, result.error["code"], result.json["counters"]["sent"]) == (2, code, 0)
