"""Readings that a timer adds to one CSV file: the header once, whole rows only, and the time of day in a column."""

from __future__ import annotations

import csv
import io
import re
import subprocess
import sys
from pathlib import Path

import pytest

from handctl.errors import OutputError
from handctl.files import appended
from tests.support.cli import PATIENCE, run
from tests.support.each_row import each_row

LINK = "fake://exo?clock=virtual"
ADD = ("--csv", "--append", "--time", "-o")
MOMENT = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}(.[0-9]{3})?Z")


def rows_in(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text, newline="")))


@each_row(("more", "lines"), [((), 5), (("--wide",), 1)])
def test_the_header_is_written_once(more: tuple[str, ...], lines: int, tmp_path: Path) -> None:
    path = tmp_path / f"{lines}.csv"
    for count in (1, 2, 3):
        assert run("exo", "get", "temperature", *ADD, str(path), *more, "-p", LINK).code == 0
        rows = rows_in(path.read_bytes().decode())
        assert len(rows) == count * lines and all(MOMENT.fullmatch(row["time"]) for row in rows)
        assert {row.get("value") or row.get("temperature.ring_°C") for row in rows[-lines:]} >= {"32"}


def test_a_file_with_other_columns_is_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    run("exo", "get", "temperature", *ADD, str(path), "--wide", "-p", LINK)
    before = path.read_bytes()
    done = run("exo", "get", "current", *ADD, str(path), "--wide", "-p", LINK)
    assert (done.code, done.said, path.read_bytes()) == (1, ["columns"], before)


def test_nothing_is_added_where_nobody_answers(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    run("exo", "get", "temperature", *ADD, str(path), "-p", LINK)
    before = path.read_bytes()
    assert run("exo", "get", "temperature", *ADD, str(path), "-p", f"{LINK}&fault=silent").code == 4
    assert path.read_bytes() == before


def test_what_was_not_read_has_the_same_columns(tmp_path: Path) -> None:
    path, link = tmp_path / "x.csv", "fake://aidin?clock=virtual&start=homed"
    codes = [
        run("aidin", "get", "motor_pos", "joint_pos", *ADD, str(path), "-p", link + fault).code
        for fault in ("", "&fault=wrong-length")
    ]
    rows = rows_in(path.read_bytes().decode())
    assert codes == [0, 5] and {bool(row["error"]) for row in rows} == {False, True}
    assert all((row["value"] == "") is bool(row["error"]) for row in rows)


def test_a_row_that_finds_no_room_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(b"a,b\r\n1,2")
    with appended(path) as file:
        file.write("a,b\r\n3,4\r\n")
    assert path.read_bytes() == b"a,b\r\n1,2\r\n3,4\r\n"

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("handctl.files.disk.sync", full)
    with pytest.raises(OSError), appended(path) as file:
        file.write("a,b\r\n5,6\r\n")
    assert path.read_bytes() == b"a,b\r\n1,2\r\n3,4\r\n"


def test_a_file_that_begins_alike_is_another_one(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(b"a,bc\r\n")
    with pytest.raises(OutputError), appended(path) as file:
        file.write("a,b\r\n1,2\r\n")


@each_row("words", [
    "get temperature --append", "get temperature --append --csv", "get temperature --append -o x.csv",
    "watch --count 1 --append --csv -o x.csv", "get temperature --time",
])  # fmt: skip
def test_what_makes_no_sense_is_refused(words: str, tmp_path: Path) -> None:
    done = run("exo", *words.replace("x.csv", str(tmp_path / "x.csv")).split(), "-p", LINK)
    assert (done.code, done.said, list(tmp_path.iterdir())) == (2, ["usage"], [])


def test_a_stream_tells_the_time_of_day() -> None:
    words = ("exo", "watch", "system_voltage", "--count", "3", "--time", "-p", LINK)
    rows, end = run(*words, "--json").stream
    first = rows[0]
    assert (first["time"], first["t"]) == (end["started"], 0) and rows[1]["time"] > first["time"]
    for more in ("--long", "--wide"):
        line = rows_in(run(*words, "--csv", more).out)[0]
        assert MOMENT.fullmatch(line["time"]) and list(line)[:2] == ["time", "t_s"]


def test_plain_and_json_have_it_too() -> None:
    words = ("exo", "get", "id", "--time", "-p", LINK)
    (row,) = run(*words, "--json").rows
    time, value = run(*words, "--format", "plain").out.split("\t")
    assert MOMENT.fullmatch(row["time"]) and MOMENT.fullmatch(time) and int(value) == row["value"] == 1


@pytest.mark.real
def test_jobs_at_once_do_not_mix_their_rows(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    words = ("exo", "dump", *ADD, str(path), "-p", LINK)
    jobs = [subprocess.Popen([sys.executable, "-m", "handctl", *words]) for _ in range(6)]
    assert [job.wait(PATIENCE) for job in jobs] == [0] * 6
    rows = rows_in(path.read_bytes().decode())
    assert len(rows) % 6 == 0 and len({tuple(row) for row in rows}) == 1
    assert [row["name"] for row in rows] == [row["name"] for row in rows[: len(rows) // 6]] * 6


@each_row("family", ("exo", "ekso"))
def test_a_recording_into_a_folder_that_is_missing_is_refused_before_anything_is_sent(
    family: str, tmp_path: Path
) -> None:
    done = run(family, "log", f"{tmp_path}/logs/", "--count", "1", "-p", f"fake://{family}?clock=virtual", "--json")
    assert (done.code, done.error["code"], done.json["counters"]["sent"]) == (2, "log-file", 0)
