"""The wrist by number: what the manual's misprinted examples really do, what is ambiguous, and the hand's own space."""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl import connect
from handctl.devices.inspire.wrist import raw
from handctl.errors import CheckFailed, HandctlError, NoAnswer, NotConfirmed, UsageError
from handctl.link import CanFrame
from tests.inspire.wrist_support import (
    WIRES,
    BabblingFrames,
    ScriptedFrames,
    can,
    fake_port,
    fake_wrist,
    frames,
    wrist_on,
    writes_of,
)
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers
from tests.support.scripted import ScriptedLink, hexed, script, unhex

PRINTED_READ = "EB 90 01 04 30 FC 03 02 36"
PRINTED_WRITE = "EB 90 01 07 31 0E 04 18 FC EB 03 4D"
PRINTED_REPLY = "90 EB 01 05 30 FC 03 00 00 00 00 35"
PRINTED_CAN = "15038001 [4] FC 18 03 EB"

# -- the manual's examples --------------------------------------------------------------------------------------------


@each_row(
    ("printed", "words"),
    [
        (PRINTED_READ, ("wrist §2.2", "1020", "pitch_actual", "EB 90 01 04 30 00 04 04 3D")),
        (PRINTED_WRITE, ("wrist §2.2.1", "yaw -10.00", "pitch +10.03", "EB 90 01 07 31 0E 04 E8 03 18 FC 4A")),
        (PRINTED_REPLY, ("wrist §2.2", "05", "reject")),
    ],
)
def test_misprints_are_explained(printed: str, words: tuple[str, ...]) -> None:
    text = raw.MISPRINTS.get(unhex(printed)) or ""
    result = run("wrist", "raw", *printed.split(), "-n", "--fake", "--json")
    assert (result.code, result.rows[0]["bytes"]) == (0, printed)
    for word in words:
        assert word in text
        assert word in result.rows[0]["meaning"]


@each_row("spelled", ["15038001#FC1803EB", "15038001 [4] FC 18 03 EB"])
def test_the_misprinted_can_data_is_explained(spelled: str) -> None:
    """wrist §2.3.2 prints the high byte first; read low byte first it is yaw +63.96, pitch -53.73."""
    result = run("wrist", "raw", spelled, "-n", "--fake", "--can", "--json")
    assert (result.code, result.rows[0]["bytes"]) == (0, PRINTED_CAN)
    for word in ("wrist §2.3.2", "+63.96", "-53.73", "15038001 [4] E8 03 18 FC"):
        assert word in result.rows[0]["meaning"]


@each_row(
    ("spelled", "words"),
    [
        # 0001 0001 0000 … 0001: 28 bits as printed, four zeros lost
        ("01100001#04", ("wrist §2.3.1", "1088", "11000001 [1] 04")),
        # 1492 beside the binary 1038
        ("15750001#E80318FC", ("wrist §2.3.2", "1492", "15038001 [4] E8 03 18 FC")),
    ],
)
def test_the_misprinted_identifiers_are_explained(spelled: str, words: tuple[str, ...]) -> None:
    """dossier W9: as a number the printed identifier reads 1088 of the hand; "1492" stands beside the binary of 1038."""
    result = run("wrist", "raw", spelled, "-n", "--fake", "--can", "--json")
    assert result.code == 0
    for word in words:
        assert word in result.rows[0]["meaning"]


@each_row("printed", [PRINTED_READ, PRINTED_WRITE])
def test_a_misprint_that_is_sent_is_explained_too(printed: str) -> None:
    result = run("wrist", "raw", printed, "-p", fake_port(), "--yes", "--json")
    assert (result.code, "misprint" in result.codes()) == (0, True)


def test_the_misprinted_write_sets_what_its_bytes_say() -> None:
    wrist, _ = fake_wrist()
    rows = raw.write(wrist, 1038, unhex(PRINTED_WRITE)[7:-1]).rows
    assert [(row["name"], row["value"]) for row in rows] == [("yaw_set", -10.0), ("pitch_set", 10.03)]


@each_row("frame", ["EB 90 01 04 30 00 04 04 3D", "EB 90 01 07 31 0E 04 E8 03 18 FC 4A"])
def test_the_corrected_frames_are_no_misprints(frame: str) -> None:
    assert raw.MISPRINTS.get(unhex(frame)) is None
    assert not raw.explained(raw.plan_raw(unhex(frame), False))


# -- what a raw frame would do ----------------------------------------------------------------------------------------


@each_row(
    ("frame", "moves", "words"),
    [
        ("EB 90 01 04 30 00 04 04 3D", False, ("4 bytes at 1024", "current_1024")),
        ("EB 90 01 04 11 C0 05 02 DD", False, ("2 bytes at 1472", "hand")),
        ("EB 90 01 07 31 0E 04 E8 03 18 FC 4A", True, ("write", "yaw_set")),
        ("EB 90 01 04 12 E8 03 02 04", True, ("write", "1000", "hand")),
        ("EB 90 01 04 30 00 04 04 3E", True, ("unknown",)),
        ("EB 90 01", True, ("unknown",)),
    ],
)
def test_meaning_of_raw_bytes(frame: str, moves: bool, words: tuple[str, ...]) -> None:
    step = raw.plan_raw(unhex(frame), False)
    assert (hexed(step.data), step.moves) == (frame, moves)
    for word in words:
        assert word in step.meaning


EIGHT = "EB 90 01 0B 31 0C 04 00 00 00 00 00 00 00 00 4D"


@each_row("frame", [EIGHT, "EB 90 01 05 12 0E 04 18 FC 3E", "EB 90 01 05 12 FC 03 18 FC 2B"])
def test_frames_that_fit_two_devices_are_refused(frame: str) -> None:
    """dossier X1: an exo force command; X2: current limits and power-on speeds of the hand."""
    with pytest.raises(UsageError) as caught:
        raw.plan_raw(unhex(frame), False)
    assert (caught.value.code, caught.value.exit_code) == ("ambiguous", 2)
    step = raw.plan_raw(unhex(frame), True)
    assert (hexed(step.data), step.moves) == (frame, True)
    assert "None" not in step.meaning


@each_row("frame", ["EB 90 01 05 12 14 04 F4 01 25", "EB 90 01 05 11 0E 04 18 FC 3D"])
def test_the_guard_ends_where_the_wrist_ends(frame: str) -> None:
    """1044 lies beside it; flag 11 writes nothing."""
    assert raw.plan_raw(unhex(frame), False).data == unhex(frame)


@each_row(
    ("frame", "on_can", "code"),
    [
        ("EB 90 01 05 12 FA 03 00 00 15", "04FE8001 [2] 00 00", "never"),  # 1018
        ("EB 90 01 04 12 12 09 01 33", "", "never"),  # 2322 runs a stored sequence
        ("EB 90 01 04 12 EE 03 01 09", "04FB8001 [1] 01", "never"),  # 1006 restores the factory defaults
        ("EB 90 01 04 12 F0 03 01 0B", "04FC0001 [1] 01", "never"),  # 1008 starts a gesture
        ("EB 90 01 05 12 14 04 18 FC 44", "05050001 [2] 18 FC", "out-of-range"),
    ],
)
def test_frames_to_the_hand_are_refused_as_its_own_commands_refuse_them(frame: str, on_can: str, code: str) -> None:
    for plan, typed in ((raw.plan_raw, unhex(frame)), (raw.plan_can, can(on_can) if on_can else None)):
        if typed is None:
            continue
        with pytest.raises(UsageError) as caught:
            plan(typed, False)  # type: ignore[operator]
        assert caught.value.code == code
        plan(typed, True)  # type: ignore[operator]


@each_row(
    ("text", "moves", "strands"),
    [
        ("11000001 [1] 04", False, False), ("01840001 [1] 02", False, False), ("15038001 [4] E8 03 18 FC", True, False),
        ("05738001 [2] F4 01", True, True), ("08000001 [1] 01", True, True), ("11000001 [2] 04 00", True, True),
    ],
)  # fmt: skip
def test_meaning_of_can_frames(text: str, moves: bool, strands: bool) -> None:
    step = raw.plan_can(can(text), False)
    assert (step.wire, step.moves, step.strands) == (text, moves, strands)


@each_row("text", ["05038001 [2] 18 FC", "04FF0001 [1] 00", "0504C001 [1] 00"])
def test_hand_writes_at_wrist_addresses_are_refused_on_can(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        raw.plan_can(can(text), False)
    assert caught.value.code == "ambiguous"
    assert raw.plan_can(can(text), True).wire == text


@each_row(
    ("text", "frame"),
    [
        ("15038001#E80318FC", "15038001 [4] E8 03 18 FC"), ("15038001 [4] E8 03 18 FC", "15038001 [4] E8 03 18 FC"),
        ("15038001 E8 03 18 FC", "15038001 [4] E8 03 18 FC"), ("11000001#04", "11000001 [1] 04"),
        ("11000001 # 04", "11000001 [1] 04"), ("  11000001#04 ", "11000001 [1] 04"), ("15038001#", "15038001 [0]"),
        ("15038001 [0]", "15038001 [0]"), ("15038001", "15038001 [0]"), ("0#00", "00000000 [1] 00"),
        ("1fffffff#ff", "1FFFFFFF [1] FF"),
    ],
)  # fmt: skip
def test_spellings_of_a_can_frame(text: str, frame: str) -> None:
    assert str(raw.parse_can(text)) == frame


@each_row(
    "text",
    ["", "#04", "xyz#04", "11000001#0", "11000001#zz", "20000000#04", "-1#04", "11000001#" + "00" * 9,
     "11000001 [2] 04", "1100_0001#04"],
)  # fmt: skip
def test_what_is_no_can_frame(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        raw.parse_can(text)
    assert caught.value.exit_code == 2
    assert "11000001#04" in caught.value.hint


# -- raw exchanges ----------------------------------------------------------------------------------------------------


def test_raw_can_shows_the_answer_and_the_traffic() -> None:
    link = ScriptedFrames(
        frames(("11000001 [1] 04", ["11000001 [1] 04", "00000005 [1] 07", (0.1, "11000001 [4] 6F 00 DE 00")]))
    )
    rows = raw.exchange_can(wrist_on(link), can("11000001 [1] 04"), 0.5).rows
    assert [(row["direction"], row["id"], row["raw"]) for row in rows] == [
        ("own", 1, "11000001 [1] 04"),
        ("other", 5, "00000005 [1] 07"),
        ("device", 1, "11000001 [4] 6F 00 DE 00"),
    ]
    assert "current_1024 = 111 mA" in rows[2]["meaning"], "decoded, as on the serial wire"
    assert link.now() == pytest.approx(0.5)


def test_raw_can_without_an_answer_is_exit_4_and_bounded() -> None:
    for link in (ScriptedFrames(), BabblingFrames("00000005 [1] 07")):
        with pytest.raises(NoAnswer):
            raw.exchange_can(wrist_on(link), can("11000001 [1] 04"), 0.5)
        assert link.now() < 1.0
        assert len(link.sent) == 1


@each_row("wire", WIRES)
def test_raw_read_at_the_command_line(wire: str) -> None:
    frame = ["EB", "90", "01", "04", "30", "00", "04", "04", "3D"] if wire == "serial" else ["11000001#04"]
    (row,) = run("wrist", "raw", *frame, "-p", fake_port(wire), "--json").rows
    assert (row["direction"], row["address"], row["data"]) == ("device", 1024, "6F 00 DE 00")


@each_row("wire", WIRES)
def test_raw_write_asks_first(wire: str) -> None:
    frame = "EB 90 01 07 31 0E 04 E8 03 18 FC 4A" if wire == "serial" else "15038001#E80318FC"
    result = run("wrist", "raw", frame, "-p", fake_port(wire), "--json")
    assert (result.code, result.json["counters"]["sent"]) == (8, 0)
    assert run("wrist", "raw", frame, "-p", fake_port(wire), "--yes").code == 0


@each_row("wire", WIRES)
def test_a_recorded_raw_command_can_be_replayed(wire: str, tmp_path: Path) -> None:
    frame = "EB 90 01 04 30 00 04 04 3D" if wire == "serial" else "11000001#04"
    trace = tmp_path / "trace"
    first = run("wrist", "raw", frame, "-p", fake_port(wire), "--trace", trace, "--json")
    again = run("wrist", "raw", frame, "-p", f"replay:{trace}", "--json")
    assert (first.code, again.code) == (0, 0)
    assert first.rows == again.rows


def test_a_raw_read_of_the_hand_is_not_named_after_the_wrist() -> None:
    """dossier X2: 1020 through flag 11 is a current limit of the hand."""
    frame = "EB 90 01 04 11 FC 03 02 17"
    (row,) = run("wrist", "raw", frame, "-p", fake_port(), "--json").rows
    assert (row["flag"], row["address"], row["data"]) == ("11", 1020, "DD 05")
    assert "pitch_actual" not in row["meaning"]


# -- write by address -------------------------------------------------------------------------------------------------


@each_row(
    ("address", "data", "wire"),
    [
        (1038, "E8 03", "EB 90 01 05 31 0E 04 E8 03 34"), (1042, "F4 01", "EB 90 01 05 31 12 04 F4 01 42"),
        (1038, "E8 03 18 FC", "EB 90 01 07 31 0E 04 E8 03 18 FC 4A"),
        (1038, "E8 03 18 FC E8 03", "EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37"),
    ],
)  # fmt: skip
def test_write_by_address(address: int, data: str, wire: str) -> None:
    wrist, link = fake_wrist()
    step = raw.plan_write(wrist, address, unhex(data))
    assert (step.wire, step.moves) == (wire, True)
    rows = raw.write(wrist, address, unhex(data)).rows
    assert writes_of(link) == [wire]
    assert " ".join(row["raw"] for row in rows) == data


@each_row(
    ("address", "data", "words"),
    [
        (1038, "E8", "1 byte is"), (1038, "E8 03 18", "3 bytes"), (1036, "00 " * 8, "8 bytes"), (1038, "00 " * 8, "8 bytes"),
        (1038, "", "0 bytes"), (1020, "00 00", "read-only"), (1028, "00 00", "read-only"), (1039, "00 00", "not a documented"),
        (1036, "00 00", "not a documented"), (1042, "E8 03 00 00", "not a documented"), (1044, "00 00", "not a documented"),
        (1038, "FC 18", "63.96"), (1040, "03 EB", "-53.73"), (1042, "00 00", "out of range"), (1042, "FF FF", "out of range"),
        (5000, "00 00", "not a documented"),
    ],
)  # fmt: skip
def test_writes_that_are_refused(address: int, data: str, words: str) -> None:
    wrist, link = fake_wrist()
    with pytest.raises(UsageError) as caught:
        raw.plan_write(wrist, address, unhex(data))
    assert words in caught.value.text
    assert link.sent == []


@each_row("wire", WIRES)
def test_an_eight_byte_write_is_refused_at_the_command_line(wire: str) -> None:
    result = run("wrist", "write", "1036", "00" * 8, "-p", fake_port(wire), "--yes", "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0)


# -- the hand behind it -----------------------------------------------------------------------------------------------


@each_row("wire", WIRES)
def test_hand_read_and_wrist_read_of_one_address(wire: str) -> None:
    port = fake_port(wire)
    (hand,) = run("wrist", "hand-read", "1020", "2", "-p", port, "--json").rows
    (wrist,) = run("wrist", "read", "1020", "2", "-p", port, "--json").rows
    assert (hand["raw"], hand["name"], hand["value"], hand["label"]) == ("DD 05", None, None, "hand space")
    assert (wrist["raw"], wrist["name"], wrist["value"]) == ("A7 FE", "pitch_actual", -3.45)


@each_row("wire", WIRES)
def test_hand_space_is_read_over_more_than_one_frame(wire: str) -> None:
    wrist, _ = fake_wrist(wire)
    (row,) = raw.hand_read(wrist, 1546, 12).rows
    assert row["raw"] == "99 03 A5 03 B1 03 C9 03 BD 03 D5 03"


@each_row(
    ("address", "data", "code"),
    [
        (1020, "00 00", "ambiguous"), (1043, "00", "ambiguous"), (1019, "00 00", "ambiguous"), (1018, "00 " * 8, "ambiguous"),
        (1038, "18 FC", "ambiguous"), (1044, "F4 01", ""), (1486, "F4 01", ""), (1559, "00", "undocumented"),
    ],
)  # fmt: skip
@each_row("wire", WIRES)
def test_the_hand_is_guarded_where_the_wrist_lies(wire: str, address: int, data: str, code: str) -> None:
    wrist, link = fake_wrist(wire)
    hand, bytes_ = raw.carrier(wrist), unhex(data)
    if code:
        with pytest.raises(UsageError) as caught:
            raw.plan_hand_writes(hand, address, bytes_, force=False, undocumented=False)
        assert caught.value.code == code
    if address not in (1018, 1019, 1043):  # never, or a part of a register
        (step,) = raw.plan_hand_writes(hand, address, bytes_, force=True, undocumented=True)
        assert (step.moves, step.strands) == (address in (1486, 1559), address in (1038, 1559))
        flag = step.data[4] if step.can_id is None else step.can_id >> 26
        assert flag == (0x12 if wire == "serial" else 1)
    assert link.sent == []


@each_row("wire", WIRES)
@each_row(
    ("written", "code"),
    [
        ("2322 01", "never"), ("1008 01", "never"), ("1003 01", "never"), ("1007 01", "never"),
        ("1000 05", "usage"), ("1004 01", "usage"), ("1005 01", "usage"), ("1006 01", "usage"), ("1009 01", "usage"),
        ("1486 E903", "out-of-range"), ("1546 0000", "usage"), ("1487 01", "usage"),
    ],
)  # fmt: skip
def test_hand_write_refuses_what_the_commands_of_the_hand_refuse(wire: str, written: str, code: str) -> None:
    """What resets, saves, calibrates, renames or starts a stored movement: also with every option that allows more."""
    for options in ((), ("--force-ambiguous", "--undocumented")):
        for family in ("hand", "wrist"):
            verb = ["wrist", "hand-write"] if family == "wrist" else ["hand", "write"]
            more = options if family == "wrist" else options[1:]
            result = run(*verb, *written.split(), *more, "-p", fake_port(wire), "--yes", "--json")
            assert (result.code, result.json["counters"]["sent"]) == (2, 0), (family, options)
            assert result.error["code"] == code, (family, options)


@each_row(
    ("address", "data", "asked"),
    [
        (1486, "0A00", ("1 of 6 fingers", "little", "921", "10")),
        (1488, "E803", ("1 of 6 fingers", "ring", "933", "1000")),
        (1559, "00", ("UNDOCUMENTED",)),
        (1044, "F401", ("default_force.little = 500",)),
    ],
)
@each_row("wire", WIRES)
def test_hand_write_names_what_moves_as_the_hand_does(
    wire: str, address: int, data: str, asked: tuple[str, ...]
) -> None:
    questions: list[str] = []

    def answer(question: str, _steps: object) -> bool:
        questions.append(question)
        return False

    with connect("wrist", fake_port(wire)) as wrist, pytest.raises(NotConfirmed):
        wrist.hand_write(address, data, undocumented=True, confirm=answer)
    (question,) = questions
    for word in asked:
        assert word in question


def test_hand_write_moves_no_hand_that_reports_a_fault() -> None:
    with odd_registers(holds={1606: b"\x01"}):
        result = run("wrist", "hand-write", "1488", "F401", "-p", fake_port("serial"), "--yes", "--json")
    assert (result.code, result.error["code"]) == (7, "not-fit")
    assert [entry["state"] for entry in result.json["writes"]] == ["not-sent"]


@pytest.mark.parametrize("wire", WIRES)
def test_hand_write_asks_and_is_read_back(wire: str) -> None:
    port = fake_port(wire)
    refused = run("wrist", "hand-write", "1486", "F401", "-p", port, "--json")
    assert (refused.code, refused.json["counters"]["sent"]) == (8, 0)
    (row,) = run("wrist", "hand-write", "1486", "F401", "-p", port, "--yes", "--json").rows
    assert (row["address"], row["raw"]) == (1486, "F4 01")
    guarded = run("wrist", "hand-write", "1038", "18FC", "-p", port, "--yes", "--json")
    assert (guarded.code, guarded.json["counters"]["sent"]) == (2, 0)


TWELVE = "F401E803F401E803F401E803"


@pytest.mark.parametrize("wire", WIRES)
def test_twelve_bytes_are_one_serial_frame_and_two_of_can(wire: str) -> None:
    """Reading splits, so does writing (wrist §2.3.2): each frame has its row, and is read back before the next."""
    result = run("wrist", "hand-write", "1486", TWELVE, "-p", fake_port(wire), "--yes", "--json")
    (row,) = result.rows
    assert (result.code, row["address"], row["raw"]) == (0, 1486, unhex(TWELVE).hex(" ").upper())
    writes = result.json["writes"]
    assert [(entry["step"], entry["state"]) for entry in writes] == [(1, "confirmed"), (2, "confirmed")][: len(writes)]
    carried = [entry["bytes"].partition("] ")[2] for entry in writes]
    assert carried == (["F4 01 E8 03 F4 01 E8 03", "F4 01 E8 03"] if wire == "can" else [""])


def test_frames_of_a_long_write_meet_at_even_addresses() -> None:
    wrist, link = fake_wrist("can")
    steps = raw.plan_hand_writes(raw.carrier(wrist), 1559, bytes(12), force=False, undocumented=True)
    assert [len(step.data) for step in steps] == [7, 5]
    assert [step.can_id >> 14 & 0xFFF for step in steps if step.can_id is not None] == [1559, 1566]
    assert link.sent == []


def test_a_long_write_ends_at_the_first_frame_that_does_not_read_back() -> None:
    answers = frames(
        ("05738001 [8] F4 01 E8 03 F4 01 E8 03", [(0.0, "05738001 [0]")]),
        ("01738001 [1] 08", [(0.0, "01738001 [8] F4 01 00 00 F4 01 E8 03")]),
    )
    link = ScriptedFrames(answers)
    table = raw.hand_write(raw.carrier(wrist_on(link)), 1486, unhex(TWELVE))
    assert isinstance(table.failure, CheckFailed)
    assert "The 4 bytes behind it were not sent" in table.failure.text
    assert len(link.sent) == 2
    assert table.rows[0]["raw"] == "F4 01 00 00 F4 01 E8 03"


@each_row(("fault", "code"), [("silent", 4), ("wrong-id", 5)])
def test_the_hand_behind_a_wrist_is_no_exo(fault: str, code: int) -> None:
    answer = run("wrist", "hand-read", "1000", "1", "-p", fake_port("serial", f"fault={fault}"), "--json")
    assert answer.code == code
    assert "exo" not in answer.error["hint"]


def test_hand_write_that_did_not_take() -> None:
    link = ScriptedLink(
        script(
            ("EB 90 01 05 12 CE 05 F4 01 E0", ["90 EB 01 04 12 CE 05 01 EB"]),
            ("EB 90 01 04 11 CE 05 02 EB", ["90 EB 01 05 11 CE 05 A1 00 8B"]),
        )
    )
    failure = raw.hand_write(raw.carrier(wrist_on(link)), 1486, unhex("F4 01")).failure
    assert isinstance(failure, CheckFailed)
    assert "A1 00" in failure.text and "F4 01" in failure.text


def test_reading_past_the_last_can_address_sends_nothing() -> None:
    result = run("wrist", "read", "4090", "16", "-p", fake_port("can"), "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0)


@each_row("wire", WIRES)
def test_no_wrist_on_this_hand(wire: str) -> None:
    """Silence for the wrist's registers, answers for the hand's (dossier 4.15)."""
    wrist, _ = fake_wrist(wire, "fault=no-wrist", retries=0)
    with pytest.raises(NoAnswer):
        wrist.dump()
    assert raw.hand_read(wrist, 1472, 2).rows[0]["raw"] == "32 02"


@each_row("wire", WIRES)
def test_a_raw_read_names_a_hand_without_a_wrist(wire: str) -> None:
    result = run("wrist", "read", "1020", "24", "-p", fake_port(wire, "fault=no-wrist"), "--json")
    assert (result.code, result.error["code"]) == (6, "other-device"), result


@each_row("data", [b"", b"\x00", bytes(8)])
@each_row("flag", range(8))
def test_every_can_frame_has_a_meaning_or_a_refusal(flag: int, data: bytes) -> None:
    for address in (0, 1019, 1020, 1038, 1043, 1044, 4095):
        try:
            step = raw.plan_can(CanFrame(flag << 26 | address << 14 | 1, data), False)
        except HandctlError as exc:
            assert isinstance(exc, UsageError)
            assert flag in (1, 5)
        else:
            assert step.meaning
            assert step.moves or (flag in (0, 4) and len(data) == 1)
