"""Commands that write or move: exact bytes, confirmation, ranges, and what is in the hand afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.inspire.exo_commands import SAVE, SET, WRITING, Command, prepare
from tests.support.cli import fake, flash, frame, memory, pairs, run, s16, sent, spying, writes
from tests.support.each_row import each_row

RESTORE_ALL = (
    "EB 90 01 0D 12 CE 05 97 00 FC 00 61 01 2C 01 2B 02 42",
    "EB 90 01 0D 12 DA 05 01 00 FE FF 03 00 FC FF 05 00 00",
    "EB 90 01 04 12 E9 03 00 03",
    "EB 90 01 04 12 E8 03 01 03",
)
"""A restore without the device cannot know what already holds: the plan has everything, the id last."""


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


def ids(command: Command) -> str:
    return command.name


# -- dry run ----------------------------------------------------------------------------------------------------------


@each_row("command", WRITING, ids=ids)
@each_row("link", [(), ("--fake",)], ids=["no-device", "fake"])
def test_dry_run_prints_the_exact_bytes_and_sends_nothing(scratch: Path, command: Command, link: Sequence[str]) -> None:
    before = sorted(path.name for path in scratch.iterdir())
    expected = RESTORE_ALL if command.name == "restore" else command.frames
    with spying() as spy:
        result = run("exo", *command.words(scratch), "--dry-run", *link, "--json")
        plain = run("exo", *command.words(scratch), "-n", *link, "--format", "plain")
        table = run("-n", "exo", *command.words(scratch), *link)
    assert result.code == 0
    assert [row["bytes"] for row in result.rows] == list(expected)
    assert [row["step"] for row in result.rows] == list(range(1, len(expected) + 1))
    assert result.json["counters"] == {"sent": 0, "received": 0, "retries": 0, "bad_frames": 0, "stray_bytes": 0}
    assert plain.lines == list(expected)
    assert all(text in table.out for text in expected)
    assert spy.lines == []
    assert sorted(path.name for path in scratch.iterdir()) == before


def test_dry_run_uses_the_id() -> None:
    result = run("exo", "set", "position_set.index=300", "-n", "--id", "7", "--format", "plain")
    assert result.out == "EB 90 07 05 12 D4 05 2C 01 24\n"


def test_dry_run_of_the_dossiers_vectors() -> None:
    for args, expected in (
        (("set", "position_set=500,500,-1,0,500"), "EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0"),
        (("set", "id=2"), "EB 90 01 04 12 E8 03 02 04"),
        (("set", "baud_code=1"), "EB 90 01 04 12 E9 03 01 04"),
        (("baud", "19200"), "EB 90 01 04 12 E9 03 02 05"),
        (("raw", "EB", "90", "01", "04", "11", "E8", "03", "01", "02"), "EB 90 01 04 11 E8 03 01 02"),
        (("raw", "00:FF"), "00 FF"),
        (("write", "1500", "64 00", "--dry-run"), "EB 90 01 05 12 DC 05 64 00 5D"),
        (("write", "1510", "AA", "--undocumented"), "EB 90 01 04 12 E6 05 AA AC"),
    ):
        result = run("exo", *args, "-n", "--format", "plain")
        assert (result.code, result.out) == (0, expected + "\n"), args


def test_settings_of_several_groups_never_share_a_frame() -> None:
    args = ("position_set.thumb=5", "force_set.little=-1000", "position_set.little=0", "position_set.index=4")
    result = run("exo", "set", *args, "-n", "--format", "plain")
    assert result.lines == [
        "EB 90 01 05 12 CE 05 00 00 EB",
        "EB 90 01 07 12 D4 05 04 00 05 00 FC",
        "EB 90 01 05 12 DA 05 18 FC 0B",
    ]


# -- confirmation -----------------------------------------------------------------------------------------------------


@each_row("command", [c for c in WRITING if c.asks], ids=ids)
def test_without_yes_on_a_pipe_nothing_is_written(scratch: Path, command: Command) -> None:
    state, trace = scratch / "state.json", scratch / "trace.txt"
    assert run("exo", "get", "id", "-p", fake(state=state)).code == 0
    before = state.read_text()
    args = ("exo", *command.words(scratch), "-p", fake(state=state), "--json", "--trace", trace)
    with spying() as spy:
        result = run(*args, stdin="y\nyes\nreset\n")
    assert result.code == 8
    assert result.error["code"] == "not-confirmed"
    assert "--yes" in result.error["hint"]
    assert result.rows == []
    assert writes(trace) == [] if trace.exists() else spy.lines == []
    if command.name != "restore":  # which must read to know what differs
        assert result.json["counters"]["sent"] == 0
        assert spy.lines == []
    assert state.read_text() == before
    assert not (scratch / "backup.json").exists()


def test_yes_works_at_every_level(scratch: Path) -> None:
    for args in (("-y", "exo", "set", "force_set.thumb=7"), ("exo", "-y", "set", "force_set.thumb=7"),
                 ("exo", "set", "--yes", "force_set.thumb=7")):  # fmt: skip
        result = run(*args, "-p", fake(), "--json")
        assert (result.code, result.values) == (0, {"force_set.thumb": 7})


def test_commands_that_need_no_confirmation(scratch: Path) -> None:
    for args in (
        ("clear-errors",),
        ("raw", "EB900104 11C00502DD"),
        ("snapshot", scratch / "s.json"),
        ("id",),
        ("baud",),
    ):
        assert run("exo", *args, "-p", fake()).code == 0, args


# -- impossible requests ----------------------------------------------------------------------------------------------

REFUSED = [
    "set position_set.index=1001", "set position_set.index=-2", "set position_set=0,0,0,0,1001",
    "set force_set.little=1001", "set force_set.little=-1001", "set force_set=1,2,3,4,-32768",
    "set id=0", "set id=255", "set baud_code=3", "set baud_code=9600", "set baud_code=-1",
    "set system_voltage=600", "set temperature.index=20", "set position_actual.thumb_rotation=1",
    "set save=1", "set calibrate=1", "set clear_errors=1", "set factory_reset=1",
    "set position_set=1,2", "set position_set=300", "set position_set.index=1,2", "set position_set.index=",
    "set position_set.index=abc", "set position_set.index=3.5", "set position_set.index=1e2",
    "set position_set.thumb_rotation=1", "set position_set.index", "set =5",
    "set force_set.index=1 force_set.index=2", "set force_set=1,2,3,4,5 force_set.index=2",
    "set force_set.index=1 position_set.index=1001",
    "id 0", "id 255", "id 256", "id -1", "id two", "baud 9600", "baud 0", "baud 921600", "baud 57600 --verify",
    "force 1001 0 0 0 0", "force 0 0 0 0 -1001", "force 1 2 3 4", "force 1 2 3 4 5 6", "force a 0 0 0 0",
    "position 0 0 0 0 1001", "position 0 0 0 0 -5", "position 1 2 3 4 5 --wait 0",
    "read 1000 0", "read 1000 253", "read 65535 2", "read 65536 1", "read -1 1", "read 1000 -1",
    "write 1472 0100", "write 1005 01", "write 1006 01", "write 1009 01", "write 1004 01", "write 1000 02",
    "write 1492 2C", "write 1493 2C01", "write 1492 E903", "write 1486 FEFF", "write 1498 17FC", "write 1001 03",
    "write 1496 0000", "write 1494 2C012C01", "write 1484 00002C01", "write 1999 00", "write 1492 zz", "write 1492 2",
    "write 1492 ''", "write 70000 00", "raw zz", "raw EB9", "raw ''",
    "raw EB90010B310C0400000000000000004D",  # a wrist module takes it for a write of 8 bytes at 1036
    "raw EB90010B32F401F401FFFF0000F4011B",  # position command with -1
    "raw EB90010B31E9030000000000000000 29",  # force 1001
    "factory-reset", "scan --ids 0-5", "scan --ids 255", "scan --ids 5-x", "scan --ids ''",
    "watch --count 0", "watch --rate -1",
    "watch --duration 0", "watch factory_reset",
]  # fmt: skip


@each_row("text", REFUSED)
def test_impossible_requests_are_refused_before_anything_is_sent(text: str, tmp_path: Path) -> None:
    import shlex

    trace = tmp_path / "trace.txt"
    with spying() as spy:
        result = run("exo", *shlex.split(text), "-p", fake(), "--yes", "--trace", trace, "--format", "plain")
    assert (result.code, result.out) == (2, ""), result
    assert spy.lines == [] or (spy.requests == 0 and sent(trace) == []), result
    assert "Traceback" not in result.err
    assert result.err.startswith("handctl: error: ")


def test_out_of_range_names_value_range_and_section() -> None:
    result = run("exo", "set", "position_set.index=1001", "-y", "--fake", "--json")
    assert result.error["code"] == "out-of-range"
    assert "position_set.index = 1001" in result.error["text"]
    assert "0..1000" in result.error["hint"] and "-1" in result.error["hint"] and "§2.3.7" in result.error["hint"]


def test_documented_limits_are_accepted() -> None:
    for text in ("position_set.index=-1", "position_set.index=0", "position_set.index=1000", "force_set.index=-1000",
                 "force_set.index=1000", "force_set.index=0x10", "id=254", "baud_code=2"):  # fmt: skip
        result = run("exo", "set", text, "-y", "-p", fake(), "--json")
        assert result.code == 0, result
    assert run("exo", "read", "1000", "252", "-p", fake()).code == 0


# -- what happens -----------------------------------------------------------------------------------------------------


@each_row("command", WRITING, ids=ids)
def test_the_bytes_on_the_wire_are_those_of_the_plan(scratch: Path, command: Command) -> None:
    trace = scratch / "trace.txt"
    result = run("exo", *command.words(scratch), "-y", "-p", fake(), "--trace", trace, "--json")
    assert result.code == 0
    assert [data.hex(" ").upper() for data in writes(trace)] == list(command.frames)


def test_set_get_round_trip(tmp_path: Path) -> None:
    link = fake(state=tmp_path / "state.json")
    assert run("exo", "set", "position_set=500,500,-1,0,500", "force_set.ring=-77", "-y", "-p", link).code == 0
    assert run("exo", "get", "position_set", "--format", "plain", "-p", link).lines == ["500", "500", "-1", "0", "500"]
    assert run("exo", "get", "force_set.ring", "--format", "plain", "-p", link).out == "-77\n"
    assert memory(tmp_path / "state.json", 1486, 22) == s16(500, 500, -1, 0, 500, 0, -61, -77, -63, 64, -65)


def test_a_read_back_that_differs_is_exit_7(tmp_path: Path) -> None:
    """The hand acknowledges a write that it ignores."""
    result = run("exo", "set", "baud_code=1", "-y", "-p", fake(fault="baud-at-1002"), "--json")
    assert result.code == 7
    assert result.error["code"] == "read-back"
    assert "0" in result.error["text"] and "1" in result.error["text"]
    result = run("exo", "baud", "57600", "-y", "-p", fake(fault="baud-at-1002"), "--json")
    assert result.code == 7
    assert "1001" in result.error["hint"] and "1002" in result.error["hint"]


def test_id_show_change_keep(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    link = fake(state=state)
    assert run("exo", "id", "--format", "plain", "-p", link).out == "1\n"
    result = run("exo", "id", "7", "-y", "--json", "-p", link)
    assert (result.code, result.values) == (0, {"id": 7})
    assert (result.rows[0]["before"], result.json["device"]["id"]) == (1, 7)
    assert memory(state, 1000) == b"\x07"
    assert flash(state) == {"id": 1, "speed_code": 0}
    assert run("exo", "get", "id", "-p", link).code == 4
    assert run("exo", "save", "-y", "--id", "7", "-p", link).code == 0
    assert flash(state) == {"id": 7, "speed_code": 0}
    assert run("exo", "get", "id", "--id", "7", "--format", "plain", "-p", link + "&power-cycle=1").out == "7\n"


def test_unsaved_id_is_gone_after_a_power_cycle(tmp_path: Path) -> None:
    link = fake(state=tmp_path / "state.json")
    assert run("exo", "id", "7", "-y", "-p", link).code == 0
    assert run("exo", "get", "id", "--format", "plain", "-p", link + "&power-cycle=1").out == "1\n"


@pytest.mark.parametrize("ack", ["new", "old"])
@pytest.mark.parametrize("new", [2, 144, 235, 254])
def test_id_change_acknowledged_from_either_id(ack: str, new: int) -> None:
    for fault in ("healthy", "noise"):
        result = run("exo", "id", str(new), "-y", "--json", "-p", fake(ack_id=ack, fault=fault))
        assert (result.code, result.values) == (0, {"id": new})
        assert "ack-lost" not in result.codes()
        back = run("exo", "id", "1", "-y", "--json", "--id", str(new), "-p", fake(id=new, ack_id=ack, fault=fault))
        assert (back.code, back.values) == (0, {"id": 1})


def test_the_same_id_again_writes_nothing(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = run("exo", "id", "1", "-y", "--json", "-p", fake(), "--trace", trace)
    assert (result.code, result.values, writes(trace)) == (0, {"id": 1}, [])


def test_set_id_behaves_as_the_id_command() -> None:
    result = run("exo", "set", "id=9", "force_set.index=5", "-y", "--json", "-p", fake())
    assert (result.code, result.values) == (0, {"force_set.index": 5, "id": 9})


@pytest.mark.parametrize("flag", [17, 18])
def test_save_waits_for_its_result(flag: int) -> None:
    with spying() as spy:
        result = run("exo", "save", "-y", "--json", "-p", fake(result_flag=flag))
    assert (result.code, result.rows[0]["value"]) == (0, "saved")
    # Before the write it is looked whether the hand is alone; another result may contradict the first for 2.5 s.
    assert 2.5 <= spy.now < 2.75
    assert run("exo", "save", "-y", "--json", "-p", fake(fault="no-late-frames")).rows[0]["value"] == "accepted"
    failed = run("exo", "save", "-y", "--json", "-p", fake(fault="save-fails", result_flag=flag))
    assert (failed.code, failed.error["code"]) == (6, "save-failed")
    assert "FF" in failed.error["text"]


def test_nothing_is_sent_between_save_and_its_result(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert run("exo", "save", "-y", "-p", fake(), "--trace", trace).code == 0
    assert sent(trace)[-1] == frame(SAVE)


def test_a_foreign_hand_is_not_saved_or_reset(scratch: Path) -> None:
    for args in (("save",), ("factory-reset", "--undocumented-address", "--backup", scratch / "b.json"),
                 ("baud", "57600", "--save")):  # fmt: skip
        trace = scratch / "t.txt"
        result = run("exo", *args, "-y", "--json", "-p", fake(fault="foreign"), "--trace", trace)
        assert (result.code, result.error["code"]) == (7, "not-an-exo")
        assert frame(SAVE) not in sent(trace)
        assert frame("EB 90 01 04 12 EE 03 01 09") not in sent(trace)
    forced = run("exo", "save", "--skip-identity-check", "-y", "--json", "-p", fake(fault="foreign"))
    assert forced.code == 0


def test_raw_write_shows_the_acknowledgement() -> None:
    with spying() as spy:
        result = run("exo", "raw", SET, "-y", "--json", "-p", fake())
    assert result.code == 0
    assert [(r["direction"], r["flag"], r["address"], r["raw"]) for r in result.rows] == [
        ("device", "12", 1492, "90 EB 01 04 12 D4 05 01 F1")
    ]
    assert result.json["received"] == "90 EB 01 04 12 D4 05 01 F1"
    assert spy.byte_at(1492, 2) == s16(300)


def test_force_and_position_report_what_the_hand_answers() -> None:
    result = run("exo", "force", "100", "-100", "0", "1000", "-1000", "-y", "--json", "-p", fake())
    assert result.values == pairs(["position_actual"])
    result = run("exo", "position", "500", "400", "300", "200", "100", "-y", "--json", "-p", fake())
    assert result.values == pairs(["force_actual"])
