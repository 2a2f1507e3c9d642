"""Joint angles of the RealTime loop: the link ratios of §9.5, and what a clutch that may have let go leaves unknown."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from handctl.devices.barrett.realtime.joint_angles import AFTER, BEFORE, UNKNOWN, Angles
from tests.barrett.commands import fake
from tests.support.cli import Result, run
from tests.support.each_row import each_row


def loop(*args: str | Path, **options: Any) -> Result:
    return run("barrett", "realtime", "--angles", *args, "-p", fake(**{"firmware": "4.34", **options}), "--json")


def last(result: Result) -> dict[tuple[str, str], tuple[Any, str | None]]:
    """Angle and state of each joint in the last block."""
    rows, end = result.stream
    assert end["exit_code"] == 0, result.err
    return {
        (row["name"], row["motor"]): (row["value"], row.get("state"))
        for row in rows
        if row["name"].startswith("joint_") and row["unit"] == "°"
    }


@each_row(
    "index,position,inner,outer",
    [(0, 8500, 68.0, 22.6667), (1, 17000, 136.0, 45.3333), (2, 17500, 140.0, 46.6667), (0, -50, -0.4, -0.1333)],
)
def test_the_ratios_of_the_links_while_the_clutch_holds(index: int, position: int, inner: float, outer: float) -> None:
    rows = list(Angles({}, [0, 1, 2]).rows({index: position}, {}))
    assert [(row["value"], row["state"]) for row in rows] == [(inner, BEFORE), (outer, BEFORE)]


def test_the_spread_and_a_clutch_that_has_let_go() -> None:
    assert [row["value"] for row in Angles().rows({3: 1575}, {})] == [90.0]
    rows = list(Angles({0: 6000}).rows({0: 10000}, {}))
    assert [(row["value"], row["state"]) for row in rows] == [(48.0, AFTER), (None, AFTER)], "the inner link stands"
    rows = list(Angles({0: 6000}).rows({0: 5000}, {}))
    assert [row["value"] for row in rows] == [40.0, None]


def test_a_watched_hand_that_reports_its_clutches() -> None:
    found = last(loop("--receive", "strain", "--motors", "1S", "--count", "3"))
    assert found == {
        ("joint_inner", "F1"): (0.0, BEFORE), ("joint_outer", "F1"): (0.0, BEFORE), ("joint_spread", "SPREAD"): (0.0, None),
    }  # fmt: skip


def test_firmware_without_bd_leaves_the_outer_joint_empty_and_says_so() -> None:
    result = loop("--motors", "1", "--count", "3", firmware="4.33")
    assert last(result)["joint_outer", "F1"] == (None, UNKNOWN)
    assert result.said.count("breakaway-unknown") == 1


def test_the_outer_joint_of_a_finger_that_is_driven_to_close_is_unknown() -> None:
    found = last(
        loop("--motors", "12", "--velocity", "F1=40,F2=-1", "--count", "20", "--no-guard", "window", wire="auto")
    )
    inner, state = found["joint_inner", "F1"]
    assert (found["joint_outer", "F1"], state) == ((None, UNKNOWN), UNKNOWN) and inner > 0
    assert found["joint_outer", "F2"][1] == BEFORE, "opening breaks nothing"


def test_a_clutch_that_had_let_go_before_the_loop(tmp_path: Path) -> None:
    link = fake(firmware="4.34", fault="breakaway", state=tmp_path / "hand.json")
    assert run("barrett", "close", "--motors", "3", "-p", link).code == 0
    result = run("barrett", "realtime", "--angles", "--motors", "3", "--count", "2", "-p", link, "--json")
    assert last(result) == {("joint_inner", "F3"): (16.0, AFTER), ("joint_outer", "F3"): (None, AFTER)}  # BP 2000
    assert "breakaway" in result.said


def test_a_log_has_degrees_in_its_heading_and_empty_fields(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    law = ("--law", "velocity.F1 = clamp((2000 - P.F1)/20, -40, 40)", "--duration", "0.2")
    assert loop("--motors", "14", "--receive", "position", *law, "--log", path, wire="auto").code == 0
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    assert {"joint_inner.F1_°", "joint_outer.F1_°", "joint_spread.SPREAD_°"} <= set(rows[0])
    assert rows[-1]["joint_outer.F1_°"] == "" and rows[-1]["error"] == ""
    assert abs(float(rows[-1]["joint_inner.F1_°"]) - int(rows[-1]["position.F1_cts"]) / 125) < 1e-3
    assert run("barrett", "log", "--check", path).code == 0


def test_angles_of_a_measurement_are_refused() -> None:
    assert loop("--measure", "5").code == 2
