"""`handctl plot`: what is read of a recording, what is drawn of it, and what is refused."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from handctl.charts.curves import ticks
from handctl.errors import UsageError
from handctl.screen.csv_output import column_of, of_column
from handctl.tools.plot import grouped, read
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.page import Page

HEADER = "t_s,speed.index_mA,speed.thumb_mA,state,error\r\n"


def recorded(folder: Path, *rows: str, header: str = HEADER, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_text(header + "".join(f"{row}\r\n" for row in rows), encoding="utf-8")
    return path


def test_a_peak_of_one_row_among_thousands_is_kept(tmp_path: Path) -> None:
    rows = [f"{number / 50},{(number == 7777 and 900) or 3},{number % 2},ok," for number in range(20000)]
    found = read(str(recorded(tmp_path, *rows)))
    index, thumb = found.curves
    assert (found.rows, found.seconds, found.damaged) == (20000, 399.98, 0)
    assert (index.name, index.part, index.unit, index.low, index.high) == ("speed", "index", "mA", 3, 900)
    assert (thumb.low, thumb.high) == (0, 1)
    assert len(index.runs[0]) <= 900
    assert [t for t, _, high in index.runs[0] if high == 900] == [pytest.approx(7777 / 50, abs=0.5)]


def test_holes_by_the_time_alone(tmp_path: Path) -> None:
    moments = [number / 10 for number in (*range(100), *range(150, 250))]
    found = read(str(recorded(tmp_path, *(f"{t},{t},1,ok," for t in moments))))
    assert found.holes == [(9.9, 15.0)]
    assert [len(run) for run in found.curves[0].runs] == [100, 100]


def test_a_log_has_the_holes_and_marks_that_it_was_given(tmp_path: Path) -> None:
    notes = {20: "grasp", 30: "[gap 0.300 s]", 40: "[port lost]; again"}
    rows = [f"{number / 10 + (number >= 40) * 9},{number},1,,{notes.get(number, '')}" for number in range(60)]
    found = read(str(recorded(tmp_path, *rows, header="t_s,speed.index_mA,seq,error,mark\r\n")))
    assert [tuple(round(t, 1) for t in hole) for hole in found.holes] == [(2.9, 3.0), (3.9, 13.0)]
    assert [text for _, text in found.marks] == ["grasp", "[port lost]; again"]
    assert [curve.name for curve in found.curves] == ["speed"]


def test_what_was_not_read_is_a_hole_and_what_is_damaged_is_counted(tmp_path: Path) -> None:
    found = read(str(recorded(tmp_path, "0,1,5,ok,", "1,,5,ok,index: no answer", "2,3,5", "x,3,5,ok,", '3,4,5,"a,b",')))
    assert (found.rows, found.damaged) == (3, 2)
    index, thumb = found.curves
    assert [len(run) for run in index.runs] == [1, 1]
    assert (index.failed, thumb.moved) == (1, False)


@each_row("text", ['"1,234"', "n/a", "nan", "inf", "1e400"])
def test_a_value_that_is_none_leaves_a_hole_and_is_told(text: str, tmp_path: Path) -> None:
    """One such value took its whole curve away without a word, or was a bug of handctl."""
    for at in range(3):
        rows = [f"{t},{text if t == at else t},7,ok," for t in range(3)]
        path = recorded(tmp_path, *rows)
        found = read(str(path))
        assert [(one.count, one.failed) for one in found.curves] == [(2, 1), (3, 0)], "words are no curve"
        assert found.damaged == 1
        assert run("plot", path, "--json").codes()[0] == "damaged"
        assert run("plot", path, "-o", tmp_path / "a.svg").code == 0


@each_row("time", ["nan", "inf"])
def test_a_time_that_is_none_is_damaged(time: str, tmp_path: Path) -> None:
    found = read(str(recorded(tmp_path, "0,1,5,ok,", f"{time},2,5,ok,", "2,3,5,ok,")))
    assert (found.rows, found.damaged, found.seconds) == (2, 1, 2.0)


def test_long_files_are_the_same_curves(tmp_path: Path) -> None:
    header = "t_s,name,motor,value,unit,error\r\n"
    rows = [
        f"{t},{name},{motor},{t * 10},{unit},"
        for t in range(5)
        for name, unit in (("heat", "0.1 °C"), ("way", "cts"))
        for motor in ("F1", "F2")
    ]
    curves = read(str(recorded(tmp_path, *rows, header=header))).curves
    assert [(one.name, one.part, one.unit, one.high) for one in curves] == [
        ("heat", "F1", "°C", 4), ("heat", "F2", "°C", 4), ("way", "F1", "cts", 40), ("way", "F2", "cts", 40)
    ]  # fmt: skip


def test_a_file_that_grew_by_the_clock(tmp_path: Path) -> None:
    """What a timer appends has the time of day, and a moment's rows share it."""
    rows = [f"2026-11-26T{hour:02}:00:00Z,heat,{part},{hour}," for hour in range(20, 24) for part in ("a", "b")]
    found = read(str(recorded(tmp_path, *rows, header="time,name,finger,value,unit\r\n")))
    assert (found.seconds, found.holes) == (10800.0, [])
    assert [(one.part, one.low, one.high, one.count) for one in found.curves] == [("a", 20, 23, 4), ("b", 20, 23, 4)]


@each_row(
    ("header", "rows", "code"),
    [
        ("", (), "no-rows"),
        (HEADER, (), "no-rows"),
        ("name,value\r\n", ("a,1",), "no-time"),
        ("a;b\r\n", ("1;2",), "no-time"),
        (HEADER, ("\0",), "no-rows"),
        (HEADER.replace("\r\n", "\r"), ("0,1\r",), "no-time"),
        (HEADER, ('"0"\r,1',), "no-rows"),
    ],
)
def test_what_is_no_recording(header: str, rows: tuple[str, ...], code: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        read(str(recorded(tmp_path, *rows, header=header)))
    assert (refused.value.code, bool(refused.value.hint)) == (code, True)


@pytest.mark.parametrize("family", ["exo", "wrist", "barrett", "aidin", "ekso", "hand"])
def test_what_every_family_records_is_drawn(family: str, tmp_path: Path) -> None:
    """Each live quantity of each family, wide and long, has a curve with its unit."""
    at = f"fake://{family}?clock=virtual"
    for words, name in (
        (("-o", tmp_path / "w.csv"), "w.csv"),
        (("--csv", "--long", "-o", tmp_path / "l.csv"), "l.csv"),
    ):
        assert run(family, "watch", "--count", "3", "-p", at, *words).code == 0
        done = run("plot", tmp_path / name, "--json")
        assert done.code == 0
        with open(tmp_path / "w.csv", encoding="utf-8", newline="") as file:
            columns = [column for column in next(csv.reader(file)) if column not in ("t_s", "error", "doubt")]
        assert {(row["name"], row["part"]) for row in done.rows} == {
            (name, part or None) for name, part, _ in map(of_column, columns)
        }
    picture = run("plot", tmp_path / "w.csv", "-o", tmp_path / "w.svg")
    assert (picture.code, picture.out) == (0, "")
    assert (tmp_path / "w.svg").read_text(encoding="utf-8").startswith("<svg xmlns")


@each_row("family", ["exo", "wrist", "barrett", "aidin", "ekso", "hand"])
def test_a_heading_says_what_it_is_of(family: str) -> None:
    from handctl.model.param import scale_of

    for row in run(family, "describe", "--json").rows:
        for part in ("", ".little", ".thumb_rotation", ".index.m1"):
            unit = row.get("unit") or ""
            shown = {"name": row["name"], "unit": unit, "path": f"{row['name']}{part}"}
            scale = scale_of(unit)
            assert of_column(column_of(shown)) == (row["name"], part[1:], scale.unit if scale else unit)


def test_a_log_shows_its_device_with_the_highest_values(tmp_path: Path) -> None:
    log = tmp_path / "l.csv"
    assert run("hand", "log", log, "--count", "3", "-p", "fake://hand?clock=virtual&fault=faults").code == 0
    assert run("plot", log, "-o", tmp_path / "l.html").code == 0
    text = (tmp_path / "l.html").read_text(encoding="utf-8")
    assert Page(text).count["figure"] == 2
    assert text.count('class="bad bar"') == 10  # five fingers with an error bit, in both pictures
    assert "(simulated, 3 rows)" in text


def test_two_files_are_above_each_other(tmp_path: Path) -> None:
    one = recorded(tmp_path, "0,1,5,ok,", "9,2,5,ok,")
    other = recorded(tmp_path, "0,1,5,ok,", "5,7,5,ok,", name="b<.csv")
    done = run("plot", one, other, "-o", tmp_path / "both.html")
    assert done.code == 0
    text = (tmp_path / "both.html").read_text(encoding="utf-8")
    assert Page(text).count["svg"] == 1
    assert text.count("<polyline") == 2
    assert "b<" not in text and "http://" not in text.replace("http://www.w3.org/2000/svg", "")
    assert "thumb" not in re.findall(r"<svg.*?</svg>", text, re.DOTALL)[0]


@each_row(
    ("more", "exit_code", "code"),
    [
        (("--only", "sped"), 2, "no-column"),
        (("-o", "{dir}/a.csv"), 2, "same-file"),
        (("-o", "{dir}/a.csv.json"), 2, "same-file"),
    ],
)
def test_what_cannot_be_meant(more: tuple[str, ...], exit_code: int, code: str, tmp_path: Path) -> None:
    path = recorded(tmp_path, "0,1,5,ok,", "9,2,5,ok,")
    before = path.read_bytes()
    done = run("plot", path, *(word.format(dir=tmp_path) for word in more), "--json")
    assert (done.code, done.error["code"]) == (exit_code, code)
    assert path.read_bytes() == before
    assert not list(tmp_path.glob("*.svg"))


def test_a_picture_that_cannot_be_written(tmp_path: Path) -> None:
    done = run("plot", recorded(tmp_path, "0,1,5,ok,"), "-o", tmp_path / "none" / "x.svg")
    assert (done.code, done.out) == (1, "")


def test_names_of_one_kind_share_a_picture(tmp_path: Path) -> None:
    header = "t_s,left_hip_angle_deg,right_hip_angle_deg,torso_pitch_deg,current_1024_mA,current_1026_mA\r\n"
    found = read(str(recorded(tmp_path, "0,1,2,3,4,5", "1,2,3,4,5,6", header=header)))
    assert {title: list(parts) for title, parts in grouped(found.curves).items()} == {
        "angle [deg]": ["left hip", "right hip"], "torso_pitch [deg]": [""], "current [mA]": ["1024", "1026"]
    }  # fmt: skip


@each_row(
    ("low", "high", "found"),
    [(0, 10, [0, 5, 10]), (-3, 3, [-2, 0, 2]), (31, 42, [35, 40]), (7, 7, [7]), (0, 0.9, [0, 0.5])],
)
def test_ticks_are_round(low: float, high: float, found: list[float]) -> None:
    assert ticks(low, high, 3) == found


def test_several_names_and_a_long_line_of_what_stayed(tmp_path: Path) -> None:
    names = [f"quantity_number_{number}" for number in range(12)]
    header = ",".join(("t_s", *names, "a", "b", "c")) + "\r\n"
    still = ",".join("7" for _ in names)
    path = recorded(tmp_path, f"0,{still},1,1,1", f"1,{still},2,2,2", header=header)
    assert {row["name"] for row in run("plot", path, "--only", "a,b", "--only", "c", "--json").rows} == {"a", "b", "c"}
    text = run("plot", path).out
    assert "\ufffd" not in text and re.findall(r'class="small" x="(\d+)"', text) == ["0", "14"]
