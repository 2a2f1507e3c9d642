"""`handctl barrett maintenance | strain | fingertips | diagnose` on the simulator: rows, exit codes, what is sent."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.barrett.commands import fake, sent_lines, written_lines
from tests.support.cli import Result, run
from tests.support.each_row import each_row

STATUSES = {"ok", "warning", "fail", "skipped"}


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def do(*args: str | Path, port: str | None = None, **more: Any) -> Result:
    return run("barrett", *args, "-p", port or fake(), "--json", **more)


def checks(result: Result) -> dict[str, str]:
    rows = result.rows
    for row in rows:
        assert set(row) - {"command"} == {"check", "status", "evidence", "remedy", "source"}
        assert row["status"] in STATUSES
    return {row["check"]: row["status"] for row in rows}


# -- nothing moves, nothing is written --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "args",
    [
        ("maintenance",),
        ("maintenance", "--greased", "palm"),
        ("strain",),
        ("strain", "--live", "--count", "2"),
        ("fingertips",),
        ("fingertips", "--live", "--count", "2"),
        ("diagnose",),
        ("diagnose", "sticks-open"),
        ("diagnose", "erratic", "--yes"),
    ],
)
def test_reading_writes_nothing(tmp_path: Path, args: tuple[str, ...]) -> None:
    trace = tmp_path / "t.txt"
    result = do(*args, "--trace", trace)
    assert result.code in (0, 7), result
    assert sent_lines(trace) and written_lines(trace) == []


@each_row(
    "args",
    [
        ("maintenance", "-n"),
        ("strain", "-n"),
        ("fingertips", "-n"),
        ("diagnose", "-n"),
        ("maintenance", "--greased", "nose"),
        ("strain", "--count", "3"),
        ("strain", "--live", "--check"),
        ("fingertips", "--duration", "1"),
        ("fingertips", "--positions", "1", "2", "3", "20001"),
        ("fingertips", "--positions", "1", "2", "3"),
        ("fingertips", "--positions", "1", "2", "3", "4", "--live"),
        ("fingertips", "--breakaway", "F1=1"),
        ("diagnose", "toothache"),
        ("diagnose", "--move"),
        ("diagnose", "erratic", "--move"),
        ("diagnose", "sticks-open", "--move", "--motors", "S"),
    ],
)
def test_usage(tmp_path: Path, args: tuple[str, ...]) -> None:
    trace = tmp_path / "t.txt"
    assert do(*args, "--trace", trace).code == 2
    assert not trace.exists() or sent_lines(trace) == []


def test_offline_needs_no_device() -> None:
    for args in (
        ("fingertips", "--positions", "8500", "8500", "8500", "1575"),
        ("maintenance", "--steps", "lubrication"),
        ("diagnose", "--list"),
    ):
        result = run("barrett", *args, "--json")
        assert result.code == 0 and result.rows, result


# -- fingertips -------------------------------------------------------------------------------------------------------


def test_fingertips_of_given_positions() -> None:
    result = run(
        "barrett", "fingertips", "--positions", "10000", "10000", "10000", "0", "--breakaway", "F2=6000", "--json"
    )
    at = {(row["motor"], row["name"]): row["value"] for row in result.rows}
    assert [at["F2", name] for name in ("tip_x", "tip_y", "tip_z")] == [25, -44.4598, 146.9213]
    assert [at["F1", name] for name in ("joint_spread", "joint_inner", "joint_outer")] == [0, 80, 26.6667]
    assert {(row["motor"], row["state"]) for row in result.rows} == {
        ("F1", "before breakaway"), ("F2", "after breakaway"), ("F3", "before breakaway"),
    }  # fmt: skip
    assert {row["name"]: row["limit"] for row in result.rows if "limit" in row} == {
        "joint_spread": 180, "joint_inner": 140, "joint_outer": 48,
    }  # fmt: skip
    assert all({"name", "parameter", "motor", "value", "unit"} <= set(row) for row in result.rows)


def test_fingertips_of_the_hand_for_people() -> None:
    result = run("barrett", "fingertips", "-p", fake(firmware="4.34"))
    assert result.code == 0
    assert [line.split() for line in result.lines[1:4]] == [
        ["F1", "0", "0.00", "0.00", "0.00", "-25.0", "-142.9", "132.4"],
        ["F2", "0", "0.00", "0.00", "0.00", "25.0", "-142.9", "132.4"],
        ["F3", "0", "0.00", "0.00", "0.00", "0.0", "142.9", "132.4"],
    ]
    assert "before breakaway\n" in result.out and "(simulated)" in result.out
    assert max(map(len, result.lines[:4])) <= 80
    assert "assumed before breakaway" in run("barrett", "fingertips", "-p", fake()).out


def test_fingertips_beyond_a_limit_are_marked() -> None:
    result = run("barrett", "fingertips", "--positions", "17800", "0", "0", "0")
    assert "142.40!" in result.out and "F1 joint_inner" in result.out


@pytest.mark.parametrize("what", ["fingertips", "strain"])
def test_streams(what: str) -> None:
    result = do(what, "--live", "--count", "3", "--rate", "5")
    rows, end = result.stream
    assert result.code == 0
    assert sorted({row["t"] for row in rows}) == [0, 0.2, 0.4]
    assert (end["stream"]["samples"], end["stream"]["failed"]) == (3, 0)
    silent = do(what, "--live", "--count", "3", port=fake(fault="deaf"))
    assert silent.code == 4
    assert set(json.loads(silent.lines[-1])) == {"end"}
    lines = run("barrett", what, "--live", "--count", "2", "-p", fake(), "--csv").lines
    assert lines[0].startswith("t_s,name,") and len(lines) > 10


# -- strain -----------------------------------------------------------------------------------------------------------


def test_strain() -> None:
    result = do("strain", "--check")
    assert result.code == 0
    assert [(row["motor"], row["value"], row["status"]) for row in result.rows] == [
        ("F1", 112, "ok"), ("F2", 119, "ok"), ("F3", 126, "ok"),
    ]  # fmt: skip
    off = do("strain", port=fake(fault="strain-offset"))
    assert (off.code, off.rows[2]["value"], off.rows[2]["status"]) == (0, 188, "warning")
    checked = run("barrett", "strain", "--check", "-p", fake(fault="strain-offset"))
    assert checked.code == 7
    assert "potentiometer" in checked.out and "§7.4 step 5" in checked.out
    none = do("strain", "--check", port=fake(fault="no-gauges"))
    assert (none.code, {row["status"] for row in none.rows}, none.rows[0]["value"]) == (0, {"skipped"}, None)


def test_strain_opens_first(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert "not-open" in do("strain", port=fake(initialized=0)).codes()
    result = do("strain", "--open", "--trace", trace, port=fake(initialized=0))
    assert (result.code, result.codes()) == (0, [])
    assert written_lines(trace) == ["HI", "4T", "123O"]
    dry = do("strain", "--open", "-n")
    assert [row["bytes"] for row in dry.rows] == ["48 49 0D", "34 54 0D", "31 32 33 4F 0D"]
    hot = do("strain", "--open", port=fake(fault="over-temperature"))
    assert (hot.code, hot.error["code"]) == (6, "err-8192")


# -- maintenance ------------------------------------------------------------------------------------------------------


def test_maintenance_and_its_journal() -> None:
    first = do("maintenance")
    assert (first.code, first.codes()) == (0, ["never-greased"])
    due = {row["point"]: row for row in first.rows if "point" in row}
    assert len(due) == 10 and {row["status"] for row in due.values()} == {"fail"}
    assert due["spur.F1"]["value"] == 5956 and due["spur.F1"]["label"].endswith("overdue by 956")
    assert do("maintenance", "--check").code == 7
    some = do("maintenance", "--greased", "worm,palm")
    assert {row["point"] for row in some.rows if row.get("greased")} == {"worm.F1", "worm.F2", "worm.F3", "palm.SPREAD"}
    everything = do("maintenance", "--greased", "--check")
    assert {row["value"] for row in everything.rows if "point" in row} == {0}
    assert everything.code == 0, "OTEMP is off, which is the factory's value: advice, no finding"


def test_maintenance_for_people() -> None:
    result = run("barrett", "maintenance", "-p", fake())
    assert ["F1", "104233", "5956", "2978"] in [line.split() for line in result.lines]
    assert "overdue by 956" in result.out and "§7.1" in result.out and "§7.2" in result.out
    steps = run("barrett", "maintenance", "--steps", "pretension").out
    assert "15 oz-in" in steps and "§7.1 step 2" in steps


def test_damaged_journal(tmp_path: Path) -> None:
    (tmp_path / "handctl").mkdir()
    (tmp_path / "handctl" / "barrett-greasing.json").write_text("{")
    assert do("maintenance").code == 2


# -- diagnose ---------------------------------------------------------------------------------------------------------


def test_diagnose_of_a_fresh_hand() -> None:
    result = do("diagnose", port=fake(initialized=0))
    got = checks(result)
    assert result.code == 7
    assert {name: status for name, status in got.items() if status != "ok"} == {
        "odometer.F1": "fail", "odometer.F2": "fail", "odometer.F3": "fail", "odometer.SPREAD": "fail",
    }  # fmt: skip
    assert result.error["code"] == "findings"


def test_diagnose_passes_a_factory_new_hand(tmp_path: Path) -> None:
    """Just switched on, no HI, OTEMP 0, nothing travelled: there is nothing to be done about it."""
    state = tmp_path / "s.json"
    do("maintenance", port=fake(state=state, initialized=0))
    content = json.loads(state.read_text(encoding="utf-8"))
    for motor in content["motors"]:
        motor["counts"] = 0
    state.write_text(json.dumps(content), encoding="utf-8")
    result = do("diagnose", port=fake(state=state, initialized=0))
    assert (result.code, set(checks(result).values())) == (0, {"ok"}), result
    rows = {row["check"]: row for row in result.rows}
    assert "after HI" in rows["can_move"]["evidence"] and "OTEMP" in rows["over_temperature_limit"]["remedy"]


def test_diagnose_of_a_cared_for_hand_is_0(tmp_path: Path) -> None:
    port = fake(state=tmp_path / "hand.json")
    assert do("maintenance", "--greased", port=port).code == 0
    assert do("set", "OTEMP=650", port=port).code == 0
    assert do("save", "-y", port=port).code == 0
    result = do("diagnose", port=port)
    assert (result.code, set(checks(result).values())) == (0, {"ok"}), result


@pytest.mark.parametrize(
    ("fault", "check", "status"),
    [("no-motor", "status.F3", "fail"), ("hot", "temperature", "fail"), ("strain-offset", "strain.F3", "warning"),
     ("no-gauges", "strain", "skipped"), ("no-board", "status.F2", "fail")],
)  # fmt: skip
def test_diagnose_finds(fault: str, check: str, status: str) -> None:
    result = do("diagnose", port=fake(fault=fault))
    assert (result.code, checks(result)[check]) == (7, status)


@pytest.mark.parametrize(("fault", "code"), [("deaf", 7), ("loopback", 7), ("disconnect", 3)])
def test_diagnose_without_a_line_has_rows_all_the_same(fault: str, code: int) -> None:
    result = do("diagnose", "no-communication", port=fake(fault=fault))
    got = checks(result)
    assert (result.code, got["communication"], got["strain"]) == (code, "fail", "skipped")
    assert got["by_hand.6"] == "skipped"


def test_a_port_that_cannot_be_opened_is_3() -> None:
    result = do("diagnose", port="/dev/does-not-exist")
    assert (result.code, result.rows) == (3, [])


def test_diagnose_moves_only_when_told_to(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    still = do("diagnose", "wrong-direction", "--trace", trace)
    assert (checks(still)["direction"], written_lines(trace)) == ("skipped", [])
    asked = do("diagnose", "wrong-direction", "--move", "--trace", trace)
    assert (asked.code, written_lines(trace) if trace.exists() else []) == (8, [])
    moved = do(
        "diagnose", "wrong-direction", "--move", "--motors", "1", "-y", "--trace", trace, port=fake(fault="reversed")
    )
    assert (moved.code, checks(moved)["direction.F1"]) == (7, "fail")
    lines = ["1IC 200", "1IO 200", "1HI", "1IC 200", "1IO 200"]
    assert written_lines(trace) == lines
    dry = do("diagnose", "wrong-direction", "--move", "--motors", "1", "-n")
    assert [bytes.fromhex(row["bytes"]).decode() for row in dry.rows] == [f"{line}\r" for line in lines]


def test_diagnose_for_people() -> None:
    result = run("barrett", "diagnose", "tip-backlash", "-p", fake())
    assert result.code == 7
    assert "Then, by hand:" in result.out and "(barrett §7.1)" in result.out
    listed = run("barrett", "diagnose", "--list")
    assert listed.code == 0 and len(listed.lines) == 18
