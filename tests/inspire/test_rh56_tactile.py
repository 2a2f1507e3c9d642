"""`handctl hand tactile`: 17 zones as a picture, as rows, as a stream."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from handctl.devices.inspire.hand.tactile import ZONES
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.screen import screen

TP = "fake://hand?model=tp&clock=virtual"
TCP = f"{TP}&bus=modbus-tcp"


def test_every_value_has_its_zone_row_and_column() -> None:
    """The golden hand shows value i at index i (rh56 §10)."""
    result = run("hand", "tactile", "-p", TCP, "--model", "tp", "--json")
    assert result.code == 0, result
    assert [row["value"] for row in result.rows] == list(range(1062))
    at = {(row["zone"], row["row"], row["column"]): row for row in result.rows}
    assert len(at) == 1062
    assert at["little_tip", 1, 2]["value"] == 1 and at["little_tip", 2, 1]["value"] == 3
    assert at["little_tip", 1, 2]["address"] == 3002
    palm = {place: row["value"] for place, row in at.items() if place[0] == "palm"}
    assert [palm["palm", 8, 1], palm["palm", 1, 1], palm["palm", 8, 2]] == [950, 957, 958], (
        "by columns, from the bottom"
    )
    assert at["thumb_pad", 12, 8]["value"] == 949


def test_the_whole_hand_takes_at_most_17_reads_over_tcp() -> None:
    result = run("hand", "tactile", "-p", TCP, "--model", "tp", "--json")
    assert result.json["counters"]["sent"] <= 17


@pytest.mark.parametrize("words", [(), ("--protocol", "eb90"), ("--protocol", "modbus")])
def test_every_wire_shows_the_same(words: tuple[str, ...]) -> None:
    result = run("hand", "tactile", "-p", TP, *words, "--json")
    assert [row["value"] for row in result.rows] == list(range(1062))


def test_over_can_what_lies_too_far_is_said() -> None:
    result = run("hand", "tactile", "-p", f"{TP}&bus=can", "--json")
    zones = {row["zone"] for row in result.rows}
    assert zones == {zone.name for zone in ZONES if zone.address + zone.size <= 4096}
    assert "beyond-can" in result.codes()
    assert run("hand", "tactile", "palm", "-p", f"{TP}&bus=can").code == 2


def test_zones_are_chosen_by_name_or_finger() -> None:
    result = run("hand", "tactile", "palm", "index", "-p", TCP, "--json")
    assert list(dict.fromkeys(row["zone"] for row in result.rows)) == ["index_tip", "index_nail", "index_pad", "palm"]
    result = run("hand", "tactile", "elbow", "-p", TCP, "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0)
    assert "little_tip" in result.error["hint"]


@each_row("model", ["df", "f1", "dg2"])
def test_another_generation_is_refused(model: str) -> None:
    result = run("hand", "tactile", "-p", f"fake://hand?model={model}&clock=virtual", "--json")
    assert (result.code, result.error["code"]) == (6, "not-on-model")
    read = run("hand", "read", "3000", "68", "-p", f"fake://hand?model={model}&clock=virtual", "--json")
    assert ("`handctl hand read 3000 68`" in result.error["hint"]) is (model != "df")
    assert read.code == 0 or model == "df", read


def test_broken_cells_are_no_numbers_and_silent_zones_are_said() -> None:
    result = run("hand", "tactile", "-p", f"{TCP}&fault=tactile-saturated", "--json")
    invalid = [row for row in result.rows if row["label"] == "invalid"]
    assert invalid and all(row["value"] is None for row in invalid)
    result = run("hand", "tactile", "-p", f"{TCP}&fault=tactile-dead", "--json")
    told = next(message for message in result.json["messages"] if message["code"] == "no-contact")
    assert "middle_tip" in told["text"] and "palm" in told["text"] and told["code"] == "no-contact"


def test_plain_csv_and_a_stream(tmp_path: Path) -> None:
    result = run("hand", "tactile", "little_tip", "-p", TCP, "--csv")
    rows = list(csv.DictReader(io.StringIO(result.out)))
    assert [(row["zone"], row["row"], row["column"], row["value"]) for row in rows][:2] == [
        ("little_tip", "1", "1", "0"),
        ("little_tip", "1", "2", "1"),
    ]
    log = tmp_path / "skin.csv"
    result = run("hand", "tactile", "little_tip", "--watch", "--count", "3", "--rate", "0", "-p", TCP, "-o", log)
    assert result.code == 0, result
    lines = log.read_text().splitlines()
    assert lines[0].split(",")[:3] == ["t_s", "tactile.little_tip.r1c1", "tactile.little_tip.r1c2"]
    assert [line.split(",")[1:10] for line in lines[1:]] == 3 * [["0", "1", "2", "3", "4", "5", "6", "7", "8"]]
    samples, end = run(
        "hand", "tactile", "little_tip", "--watch", "--count", "2", "--rate", "0", "-p", TCP, "--json"
    ).stream
    assert (len(samples), end["stream"]["samples"]) == (18, 2)
    result = run("hand", "tactile", "--count", "2", "-p", TCP, "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0)


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_a_picture_fits_the_window(columns: int) -> None:
    shown = screen("hand", "tactile", "-p", TCP, columns=columns, rows=60)
    assert shown.code == 0
    text, lines = shown.text, shown.lines
    assert all(len(line) <= columns for line in lines)
    assert "…" not in text and "simulated" in text
    shaded = "".join(line for line in lines if line and not set(line.replace(" ", "")) - set(".:-=+*#%@?"))
    assert len(shaded.replace(" ", "")) == 1062, "a character for each value"


def test_a_picture_on_a_pipe_has_the_fingers_side_by_side() -> None:
    result = run("hand", "tactile", "-p", TCP)
    lines = result.out.splitlines()
    assert "little    ring      middle    index     thumb" in lines
    assert lines[2].split() == [".::", ":::", ":::", "---", "---"]
    assert any(line.startswith("Each character is one value") for line in lines)


@pytest.mark.parametrize(("rows", "seen"), [(60, "palm"), (24, "little_tip")])
def test_a_live_picture_and_a_line_a_zone_where_it_does_not_fit(rows: int, seen: str) -> None:
    shown = screen("hand", "tactile", "--watch", "--rate", "20", "--count", "2", "-p", TCP, rows=rows)
    assert shown.code == 0
    assert any(line.startswith(seen) for line in shown.display), shown.display
    assert not any("enlarge the window" in line for line in shown.display)
    assert sum("of 9 " in line for line in shown.display) == (0 if rows == 60 else 6)


def test_a_log_has_zones_next_to_other_quantities(tmp_path: Path) -> None:
    path = tmp_path / "grasp.csv"
    done = run("hand", "log", path, "force_actual.index", "tactile.index", "tactile.palm", "--count", "3", "-p", TCP)
    assert done.code == 0, done
    rows = list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"))))
    cells = [name for name in rows[0] if name.startswith("tactile.")]
    assert "force_actual.index_g" in rows[0] and len(cells) == 9 + 96 + 80 + 112
    assert (rows[2]["tactile.palm.r8c1"], rows[2]["tactile.palm.r8c2"], rows[2]["error"]) == ("950", "958", "")


@each_row(("name", "code"), [("tactile.elbow", "unknown-name"), ("tactil", "unknown-name")])
def test_a_log_of_a_zone_that_is_not_there_makes_no_file(tmp_path: Path, name: str, code: str) -> None:
    done = run("hand", "log", tmp_path / "a.csv", name, "--count", "1", "-p", TCP, "--json")
    assert (done.code, done.error["code"], list(tmp_path.iterdir())) == (2, code, [])


def test_a_log_of_a_hand_without_zones_says_so(tmp_path: Path) -> None:
    done = run(
        "hand",
        "log",
        tmp_path / "a.csv",
        "tactile",
        "--count",
        "1",
        "-p",
        "fake://hand?clock=virtual&model=df",
        "--json",
    )
    assert (done.code, done.error["code"], list(tmp_path.iterdir())) == (6, "not-on-model", [])
