"""`set` a second time: what is there already is not written, what acts always is, and rows say what was there before."""

from __future__ import annotations

from typing import Any

from tests.support.cli import Result, run
from tests.support.each_row import each_row


def done(family: str, *words: str) -> Result:
    return run(family, "set", *words, "--yes", "--json", "-p", f"fake://{family}?clock=virtual")


def held(family: str, name: str) -> list[str]:
    """NAME=VALUE for all that a quantity holds now."""
    rows = run(family, "get", name, "--json", "-p", f"fake://{family}?clock=virtual").rows
    return [f"{row['path']}={row['value']}" for row in rows]


@each_row(("family", "name"), [("exo", "id"), ("exo", "baud_code"), ("barrett", "MCV"), ("barrett", "BAUD"),
                               ("hand", "default_speed")])  # fmt: skip
def test_a_setting_that_is_there_is_not_written(family: str, name: str) -> None:
    same = done(family, *held(family, name))
    assert (same.code, same.json["writes"], same.codes()[-1]) == (0, [], "equal")
    assert not any(row["changed"] for row in same.rows) and all(row["before"] == row["value"] for row in same.rows)
    again = done(family, *held(family, name), "--always")
    assert again.json["writes"] and not any(row["changed"] for row in again.rows)


@each_row(("family", "name"), [("exo", "position_set.index"), ("exo", "force_set"), ("wrist", "pitch_set"),
                               ("hand", "force_limit.ring"), ("hand", "speed_set")])  # fmt: skip
def test_what_acts_is_always_written(family: str, name: str) -> None:
    same = done(family, *held(family, name))
    assert same.code == 0 and same.json["writes"], same
    assert all(row["changed"] and row["before"] == row["value"] for row in same.rows)


def test_only_what_differs_is_written() -> None:
    some = done("barrett", "MCV.F1=80", "MCV.SPREAD=60")
    assert [write["meaning"] for write in some.json["writes"]] == ["1FSET MCV 80"]
    assert [(row["before"], row["value"], row["changed"]) for row in some.rows] == [(100, 80, True), (60, 60, False)]


def test_one_read_comes_before_and_one_behind() -> None:
    plain, same = done("barrett", "MCV=80", "HSG=150"), done("barrett", "MCV.SPREAD=60", "HSG=256")
    assert (plain.json["counters"]["sent"], same.json["counters"]["sent"]) == (3, 1)


def test_a_worn_setting_says_what_was_there() -> None:
    link = ("--yes", "--operator", "me", "--json", "-p", "fake://ekso?clock=virtual&posture=standing")
    rows: list[Any] = run("ekso", "get", "step_length", "--json", *link[-2:]).rows
    same = run("ekso", "set", f"step_length={rows[0]['value']}", *link)
    assert (same.code, same.json["writes"], same.rows[0]["changed"]) == (0, [], False)


@each_row("family", ["exo", "barrett", "hand"])
def test_a_dry_run_lists_all(family: str) -> None:
    name = {"exo": "baud_code", "barrett": "MCV", "hand": "default_speed"}[family]
    plan = run(family, "set", *held(family, name), "-n", "--json")
    assert plan.code == 0 and plan.rows and "plan" in plan.codes()
