"""`export --to bids|c3d|mcap|xdf` and `log --check`: each file is read by a library that nobody here wrote. Values, units, times, marks and holes.

The recording has a device clock that is 200 ppm slow, a gap, a restart with a pause, and marks with times of their own.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import cache
from importlib import import_module
from pathlib import Path
from statistics import linear_regression
from typing import Any

import pytest

from handctl.command.log_command import _first
from handctl.devices.ekso.log_reader import LogFile
from handctl.model.device_clock import Moment
from handctl.record.exports import absent
from handctl.record.marks import Heard, Marks
from handctl.record.row_source import Sample
from tests.ekso.recordings import STANDING, Device, opened, words_at
from tests.support.cli import Result, run
from tests.support.each_row import each_row

SLOW = 1 + 200e-6
"""Seconds of the host for one of the device."""
RATE = 50
GAP, PAUSE = 0.5, 2.0


def _rows() -> Iterator[tuple[float, int]]:
    """Seconds since the row before by the host, BootTime: 100 rows, a gap, 100 rows, a restart, 50 rows."""
    for number in range(200):
        step = 0 if not number else 20 if number != 100 else int(GAP * 1000)
        yield step / 1000 * SLOW, 1001 + 20 * number + (480 if number >= 100 else 0)
    for number in range(50):
        yield (0.02 if number else PAUSE) * SLOW, 301 + 20 * number


def walk(path: Path, *, rows: int = 250, closed: bool = True, asked: float | None = RATE) -> Path:
    device = Device([])
    recording = opened(path, device, simulated=True, asked={"rate_hz": asked})
    for number, (step, boot) in enumerate(list(_rows())[:rows]):
        device.clock += step
        words = [(word + 3 * number) & 0xFFFF if at < 18 else word for at, word in enumerate(STANDING)]
        if number == 30:
            recording.pending = [Heard("go, é", round(device.wall() - 0.007, 6), None, "udp")]
        if number == 220:
            recording.pending = [Heard("turn")]
        trip = 0.002 + 0.002 * (number % 3)
        moment = Moment(device.clock - trip / 2, device.clock + trip / 2)
        recording.add(Sample(moment, words_at(boot, words), boot), number + 1)
    recording.close()
    if closed:
        recording.finish("limit")
    return path


@cache
def _walked() -> dict[str, bytes]:
    """The files of the whole walk, written once."""
    with tempfile.TemporaryDirectory() as folder:
        return {path.name: path.read_bytes() for path in walk(Path(folder) / "walk.csv").parent.iterdir()}


def given(folder: Path) -> Path:
    """A log of the whole walk for the test alone."""
    for name, data in _walked().items():
        (folder / name).write_bytes(data)
    return folder / "walk.csv"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return given(tmp_path)


def recorded(log: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(log.open(encoding="utf-8", newline="")))


def fitted(rows: list[dict[str, str]]) -> list[float]:
    """The host's time of each row by a line through those of its segment, seconds since 1970."""
    found: list[float] = []
    for segment in dict.fromkeys(row["segment"] for row in rows):
        own = [row for row in rows if row["segment"] == segment]
        first = float(own[0]["host_mono_s"])
        times = [float(row["t_s"]) - float(own[0]["t_s"]) for row in own]
        line = linear_regression(times, [float(row["host_mono_s"]) - first for row in own])
        utc = float(own[0]["host_utc_s"])
        found += [utc + line.intercept + line.slope * time for time in times]
    return found


def exported(log: Path, kind: str, *args: str) -> tuple[Path, Result]:
    out = log.with_name(f"out.{kind}")
    done = run("ekso", "export", log, "--to", kind, "-o", out, *args, "--json")
    assert done.code == 0, done
    return out, done


def units(log: Path) -> dict[str, str]:
    return {channel.column: channel.unit for channel in LogFile(str(log)).channels}


# -- xdf ------------------------------------------------------------------------------------------------------------------


def test_xdf(log: Path) -> None:
    pyxdf = pytest.importorskip("pyxdf")
    out, done = exported(log, "xdf")
    assert done.rows == [{"file": str(out), "rows": 250, "seconds": pytest.approx(7.44, abs=0.05)}]
    data, marks = pyxdf.load_xdf(out)[0]
    rows = recorded(log)
    labels = [channel["label"][0] for channel in data["info"]["desc"][0]["channels"][0]["channel"]]
    told = {
        channel["label"][0]: channel["unit"][0] or "" for channel in data["info"]["desc"][0]["channels"][0]["channel"]
    }
    assert units(log).items() <= told.items()
    for number, label in enumerate(labels):
        assert list(data["time_series"][:, number]) == [float(row[label]) for row in rows], label
    ahead = float(rows[0]["host_utc_s"]) - float(rows[0]["host_mono_s"])
    assert list(data["time_stamps"]) == pytest.approx([utc - ahead for utc in fitted(rows)], abs=2e-6)
    texts = [text for (text,) in marks["time_series"]]
    assert texts == ["go, é", "[gap 0.500 s]", "[reboot]", "[gap 2.000 s]", "turn"]
    assert marks["time_stamps"][0] == pytest.approx(float(rows[30]["host_mono_s"]) - 0.007, abs=2e-6)
    assert marks["time_stamps"][2] == pytest.approx(fitted(rows)[200] - ahead, abs=2e-6)


def test_only_an_even_stream_has_a_nominal_rate(tmp_path: Path) -> None:
    pyxdf = pytest.importorskip("pyxdf")
    rates = []
    for rows in (90, 250):
        out, _ = exported(walk(tmp_path / f"{rows}.csv", rows=rows), "xdf")
        rates.append(float(pyxdf.load_xdf(out)[0][0]["info"]["nominal_srate"][0]))
    assert rates == [RATE, 0]


# -- c3d ------------------------------------------------------------------------------------------------------------------


def test_c3d(log: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    out, done = exported(log, "c3d")
    assert "resampled" in done.said
    content = ezc3d.c3d(str(out))
    points, analogs = content["data"]["points"], content["data"]["analogs"][0]
    residuals = content["data"]["meta_points"]["residuals"][0]
    named = {name: list(content["parameters"][name]["LABELS"]["value"]) for name in ("POINT", "ANALOG")}
    told = dict(zip(named["ANALOG"], content["parameters"]["ANALOG"]["UNITS"]["value"], strict=True))
    assert told == units(log) | {"recorded": ""} and content["header"]["points"]["frame_rate"] == RATE
    assert list(content["parameters"]["POINT"]["UNITS"]["value"]) == ["deg"] * 6
    rows = recorded(log)
    times = fitted(rows)
    assert points.shape[2] == int((times[-1] - times[0]) * RATE) + 1 == residuals.shape[1]
    angle, code = named["POINT"].index("left_knee_angle_deg"), named["ANALOG"].index("state_raw")
    for frame in range(points.shape[2]):
        at = times[0] + frame / RATE
        after = next(number for number, time in enumerate(times) if time >= at - 1e-9)
        before = after if abs(times[after] - at) < 1e-9 else after - 1
        hole = before != after and after in (100, 200)
        assert residuals[angle, frame] == (-1 if hole else 0) and analogs[-1, frame] == (not hole), frame
        if hole:
            continue
        one, other = (float(rows[number]["left_knee_angle_deg"]) for number in (before, after))
        part = (at - times[before]) / (times[after] - times[before]) if after > before else 0
        assert points[0, angle, frame] == pytest.approx(one + (other - one) * part, abs=2e-3)
        assert analogs[code, frame] in {float(rows[number]["state_raw"]) for number in (before, after)}
    events = content["parameters"]["EVENT"]
    assert list(events["LABELS"]["value"]) == ["mark", "gap", "break", "gap", "mark"]
    assert list(events["DESCRIPTIONS"]["value"]) == ["go, é", "gap 0.500 s", "reboot", "gap 2.000 s", "turn"]
    assert events["TIMES"]["value"][1][0] == pytest.approx(float(rows[30]["host_utc_s"]) - 0.007 - times[0], abs=1e-5)
    assert len(content["parameters"]["HANDCTL"]["CLOCK_FIT"]["value"]) == 2


def test_c3d_of_one_segment_at_another_rate(log: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    out, done = exported(log, "c3d", "--segment", "2", "--rate", "200")
    content = ezc3d.c3d(str(out))
    assert content["data"]["points"].shape[2] == int(0.98 * SLOW * 200) + 1
    assert set(content["data"]["meta_points"]["residuals"][0].flatten()) == {0} and done.rows[0]["rows"] == 50


def test_a_long_c3d_has_all_its_frames(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    out, _ = exported(walk(tmp_path / "a.csv", rows=2, asked=None), "c3d", "--rate", "1000")
    assert ezc3d.c3d(str(out))["data"]["points"].shape[2] == 21
    out.unlink()
    pause = walk(tmp_path / "b.csv")
    text = pause.read_text(encoding="utf-8").splitlines(keepends=True)
    pause.write_text(
        "".join(_later(line, 62.0) if number > 200 else line for number, line in enumerate(text)),
        encoding="utf-8",
        newline="",
    )
    out, _ = exported(pause, "c3d", "--rate", "1000")
    assert ezc3d.c3d(str(out))["data"]["points"].shape[2] > 69_000


def _later(line: str, seconds: float) -> str:
    fields = line.split(",", 2)
    return f"{float(fields[0]) + seconds:.6f},{float(fields[1]) + seconds:.6f},{fields[2]}"


# -- mcap -----------------------------------------------------------------------------------------------------------------


def test_mcap(log: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    out, _ = exported(log, "mcap")
    rows = recorded(log)
    times = fitted(rows)
    with out.open("rb") as file:
        found = list(reader.make_reader(file).iter_messages(log_time_order=False))
        file.seek(0)
        (about,) = reader.make_reader(file).iter_metadata()
    schema = json.loads(found[0][0].data)["properties"]
    assert {name: schema[name]["unit"] for name in units(log)} == units(log)
    data = [message for _, channel, message in found if channel.topic == "/ekso/data"]
    assert len(data) == len(rows)
    for row, time, message in zip(rows, times, data, strict=True):
        said = json.loads(message.data)
        numbers = {name: value for name, value in said.items() if not isinstance(value, str)}
        assert numbers == {name: float(row[name]) for name in numbers}
        assert (said["state_name"], said["mark"]) == (row["state_name"], row["mark"])
        assert abs(message.log_time / 1e9 - time) < 2e-6
        assert abs(message.publish_time / 1e9 - float(row["host_utc_s"])) < 2e-6
    marks = [json.loads(message.data) for _, channel, message in found if channel.topic == "/ekso/marks"]
    assert [(mark["kind"], mark["row"]) for mark in marks] == [
        ("mark", 31), ("gap", 101), ("break", 201), ("gap", 201), ("mark", 221),
    ]  # fmt: skip
    assert json.loads(about.metadata["log"])["rows"] == 250


def test_mcap_reads_every_spelling_of_a_number_back(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    path, spellings = tmp_path / "a.csv", ["", "007", "-0.50", "1_0", "+4", ".5", "5.", "1e3", "12.0"]
    assert run("wrist", "log", path, "--count", len(spellings), "-p", "fake://wrist?clock=virtual").code == 0
    head, *lines = path.read_bytes().decode().removesuffix("\r\n").split("\r\n")
    rows = [line.split(",") for line in lines]
    for row, text in zip(rows, spellings, strict=True):
        row[1], row[6], row[7] = f"00{row[1]}", text, "12.50"
    path.write_bytes("\r\n".join([head, *map(",".join, rows), ""]).encode())
    out = tmp_path / "a.mcap"
    assert run("wrist", "export", path, "--to", "mcap", "-o", out).code == 0
    with out.open("rb") as file:
        said = [json.loads(message.data) for _, _, message in reader.make_reader(file).iter_messages()]
    names = head.split(",")
    assert [one[names[6]] for one in said] == [float(text) if text else None for text in spellings]
    for number, name in enumerate(names[:6]):
        assert [one[name] for one in said] == [float(row[number]) for row in rows], name
    assert {one[names[7]] for one in said} == {12.5} and {one["mark"] for one in said} == {""}


def test_a_damaged_mcap_is_noticed_by_readers_that_ask_for_no_checksum(log: Path) -> None:
    reader, zstandard = pytest.importorskip("mcap.reader"), pytest.importorskip("zstandard")
    out, _ = exported(log, "mcap")
    data = bytearray(out.read_bytes())
    with out.open("rb") as file:
        (chunk,) = reader.make_reader(file).get_summary().chunk_indexes
    data[chunk.chunk_start_offset + chunk.chunk_length - 9] ^= (
        1  # in the last block, before the four bytes of the checksum
    )
    out.write_bytes(data)
    with out.open("rb") as file, pytest.raises(zstandard.ZstdError):
        list(reader.make_reader(file, validate_crcs=False).iter_messages())


def test_rows_and_marks_are_on_the_clock_fit_of_the_sidecar(log: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    segments: list[dict[str, Any]] = json.loads(Path(f"{log}.json").read_text())["segments"]
    _edit(log, segments=[segments[0] | {"clock_fit": segments[0]["clock_fit"] | {"a_s": 0.25}}, segments[1]])
    out, _ = exported(log, "mcap")
    with out.open("rb") as file:
        found = list(reader.make_reader(file).iter_messages())
    times = {(channel.topic, message.sequence): message.log_time for _, channel, message in found}
    gap = next(message for _, channel, message in found if b'"gap"' in message.data)
    assert gap.log_time == times["/ekso/data", 101]


# -- bids -----------------------------------------------------------------------------------------------------------------


def _tsv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines(), delimiter="\t"))


def test_bids(log: Path) -> None:
    out, _ = exported(log, "bids")
    rows = recorded(log)
    times = fitted(rows)
    for run_, begin, end in ((1, 0, 200), (2, 200, 250)):
        stem = out / "sub-01" / "motion" / f"sub-01_task-recording_tracksys-ekso_run-{run_}"
        channels = _tsv(Path(f"{stem}_channels.tsv"))
        told = {one["name"]: "" if one["units"] == "n/a" else one["units"] for one in channels}
        assert units(log).items() <= told.items()
        assert {one["name"] for one in channels if one["type"] == "JNTANG"} == {
            f"{side}_{joint}_angle_deg" for side in ("left", "right") for joint in ("hip", "knee")
        }
        names = [one["name"] for one in channels]
        lines = [line.split("\t") for line in Path(f"{stem}_motion.tsv").read_text(encoding="utf-8").splitlines()]
        assert len(lines) == end - begin
        for line, row, time in zip(lines, rows[begin:end], times[begin:end], strict=True):
            assert line[1:] == [row[name] for name in names[1:]]
            assert float(line[0]) == pytest.approx(time - times[begin], abs=2e-6)
        about = json.loads(Path(f"{stem}_motion.json").read_text(encoding="utf-8"))
        assert about["SamplingFrequency"] == RATE and about["ClockFit"]["clock_fit"]["b"] == pytest.approx(
            SLOW, abs=1e-6
        )
    events = out / "sub-01" / "motion" / "sub-01_task-recording_run-1_events.tsv"
    found = _tsv(events)
    assert [(one["trial_type"], one["text"], one["duration"]) for one in found] == [
        ("mark", "go, é", "0.000"), ("gap", "gap 0.500 s", "0.500"),
    ]  # fmt: skip
    assert float(found[0]["onset"]) == pytest.approx(float(rows[30]["host_utc_s"]) - 0.007 - times[0], abs=2e-6)


@pytest.mark.real
def test_the_bids_validator_finds_no_error(log: Path) -> None:
    pytest.importorskip("bids_validator_deno")
    out, _ = exported(log, "bids")
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:  # it reads nothing below /dev
        said = subprocess.run(
            [
                Path(sys.executable).with_name("bids-validator-deno"),
                shutil.copytree(out, f"{folder}/bids"),
                "--format",
                "json",
            ],
            capture_output=True,
            check=False,
        )
    assert [one for one in json.loads(said.stdout)["issues"]["issues"] if one["severity"] == "error"] == []


def test_a_mark_after_the_last_row_is_an_event_as_well(log: Path) -> None:
    said = json.loads(Path(f"{log}.json").read_text())
    at = float(recorded(log)[-1]["host_utc_s"]) + 0.5
    _edit(
        log,
        marks=[*said["marks"], {"row": None, "text": "end", "heard": [{"text": "end", "host_utc_s": at, "by": "udp"}]}],
    )
    out, _ = exported(log, "bids")
    last = _tsv(out / "sub-01" / "motion" / "sub-01_task-recording_run-2_events.tsv")[-1]
    assert (last["text"], float(last["onset"])) == ("end", pytest.approx(0.98 * SLOW + 0.5, abs=0.003))


def test_a_dataset_is_never_overwritten(log: Path) -> None:
    out, _ = exported(log, "bids")
    before = sorted(out.rglob("*"))
    assert run("ekso", "export", log, "--to", "bids", "-o", out).code == 1 and sorted(out.rglob("*")) == before
    file = log.with_name("there")
    file.write_text("mine")
    done = run("ekso", "export", log, "--to", "bids", "-o", file, "--json")
    assert (done.code, done.error["code"], file.read_text()) == (2, "file-exists", "mine")


# -- mot and parquet ------------------------------------------------------------------------------------------------------


def test_opensim_takes_a_motion_file(log: Path) -> None:
    opensim = pytest.importorskip("opensim")
    out, _ = (
        log.with_name("out.mot"),
        run("ekso", "export", log, "--to", "mot", "--segment", "1", "-o", log.with_name("out.mot")),
    )
    table = opensim.TimeSeriesTable(str(out))
    rows = recorded(log)[:200]
    assert list(table.getIndependentColumn()) == [float(row["t_s"]) for row in rows]
    column = table.getDependentColumn("knee_angle_l")
    assert [round(column[at], 2) for at in range(200)] == [float(row["left_knee_angle_deg"]) for row in rows]


def test_parquet_has_the_time_by_the_fit(log: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    out, _ = exported(log, "parquet")
    assert parquet.read_table(out).column("host_fit_s").to_pylist() == pytest.approx(fitted(recorded(log)), abs=2e-6)


def test_parquet_of_several_row_groups_is_the_same(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their numbers are packed in memory that the one before has used."""
    parquet = pytest.importorskip("pyarrow.parquet")
    whole = parquet.read_table(exported(log, "parquet")[0])
    monkeypatch.setattr("handctl.record.exports.parquet.GROUP", 1)
    monkeypatch.setattr("handctl.devices.ekso.log_reader.CHUNK", 4096)
    file = parquet.ParquetFile(exported(log, "parquet")[0])
    assert file.num_row_groups > 5 and file.read().equals(whole)


def test_a_module_is_absent_only_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("colorsys", "tabnanny"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with absent(["colorsys", "json"], tabnanny=json, csv=json):
        with pytest.raises(ImportError):
            import_module("colorsys")
        assert import_module("json") is json
        assert (import_module("tabnanny"), import_module("csv")) == (json, csv), "what is loaded stays"
    assert import_module("colorsys")
    assert "tabnanny" not in sys.modules


# -- what holds for all ---------------------------------------------------------------------------------------------------


def test_an_unclosed_log_has_its_fit_from_the_rows(tmp_path: Path) -> None:
    pyxdf = pytest.importorskip("pyxdf")
    path = walk(tmp_path / "cut.csv", closed=False)
    with path.open("ab") as file:
        file.write(b"17")
    out, done = exported(path, "xdf")
    rows = recorded(path)[:250]
    ahead = float(rows[0]["host_utc_s"]) - float(rows[0]["host_mono_s"])
    stamps = pyxdf.load_xdf(out)[0][0]["time_stamps"]
    assert list(stamps) == pytest.approx([utc - ahead for utc in fitted(rows)], abs=2e-6) and "log" in done.said


@each_row(
    ("kind", "args", "code"),
    [
        ("mcap", (), "no-extra"),
        ("xdf", ("-o", "-"), "no-output"),
        ("c3d", ("--segment", "3"), "segment"),
        ("xdf", ("--segment", "3"), "segment"),
        ("mcap", ("--rate", "50"), None),
        ("bids", ("--si",), None),
        ("c3d", ("--knee-sign", "1"), None),
    ],
)
def test_impossible_exports_leave_nothing(
    log: Path, monkeypatch: pytest.MonkeyPatch, kind: str, args: tuple[str, ...], code: str | None
) -> None:
    monkeypatch.setitem(sys.modules, "mcap", None)
    out = log.with_name("x.out")
    done = run("ekso", "export", log, "--to", kind, "-o", out, *args, "--json")
    assert done.code == 2 and (code is None or done.error["code"] == code) and not out.exists()


@each_row("kind", ["bids", "c3d", "xdf"])
def test_a_damaged_log_leaves_nothing(log: Path, kind: str) -> None:
    log.write_bytes(log.read_bytes().replace(b",0x", b",1x").replace(b"standing", b"sitting", 1))
    before = set(log.parent.iterdir())
    done = run("ekso", "export", log, "--to", kind, "-o", log.with_name("x.out"), "--json")
    assert (done.code, done.error["code"]) == (2, "damaged-log") and set(log.parent.iterdir()) == before


@each_row(
    "edit",
    [
        {"columns": [1]},
        {"marks": {"row": 1}},
        {"marks": [{"row": [1]}]},
        {"marks": [{"row": 31, "heard": [{"host_utc_s": "now"}]}]},
        {"segments": [{"segment": 1, "clock_fit": {"a_s": 0.0}}]},
        {"segments": [{"segment": 1, "clock_fit": {"a_s": 0.0, "b": float("inf")}}]},
        {"asked": [50]},
        {"rate_hz": "50"},
        {"rate_hz": -50.0},
        {"start": 1.5},
        {"end": [1]},
        {"settings_before": {"step_length": {"value": float("nan")}}},
        {"missing": 1},
        {"tool": "\ud800"},
    ],
)
def test_a_sidecar_of_another_shape_is_refused(log: Path, edit: dict[str, Any]) -> None:
    _edit(log, **edit)
    for args in (("export", log, "--to", "xdf", "-o", log.with_name("x.out")), ("log", "--check", log)):
        done = run("ekso", *args, "--json")
        assert (done.code, done.error["code"]) == (2, "damaged-log"), edit
    assert not log.with_name("x.out").exists()


NO_UTF8 = "caf\udce9"
"""The mark of older recordings: a line on standard input with a byte that is no UTF-8."""


def test_a_mark_with_a_byte_that_is_no_utf8_is_read(log: Path) -> None:
    heard = {"text": NO_UTF8, "host_utc_s": None, "host_mono_s": None, "by": "line"}
    others = json.loads(Path(f"{log}.json").read_text(encoding="utf-8"))["marks"][1:]
    _edit(log, marks=[{"row": 31, "boot_ms": None, "t_s": None, "text": "go, é", "heard": [heard]}, *others])
    assert b"udce9" in Path(f"{log}.json").read_bytes()
    assert run("ekso", "log", "--check", log).code == 0
    out, _ = exported(log, "bids")
    assert all("\udce9" not in path.read_text(encoding="utf-8") for path in out.rglob("*.tsv"))


@each_row("by", ["option", "key", "line", "udp", "lsl"])
def test_each_way_keeps_a_mark_that_is_no_utf8_as_text(by: str) -> None:
    """A datagram is decoded byte by byte; the others have what the system made of the byte."""
    with closing(Marks(lambda: NO_UTF8 if by == "key" else "")) as marks:
        if by in ("udp", "line"):
            marks.hear(
                NO_UTF8.encode("utf-8", "surrogateescape").decode("utf-8", "replace") if by == "udp" else NO_UTF8, by
            )
        elif by == "lsl":
            marks.hear(NO_UTF8, by, 1.0)
        (mark,) = _first(NO_UTF8 if by == "option" else "", marks.take)()
    assert mark.text == "caf\ufffd" and mark.as_row()["text"].encode("utf-8")


@each_row("seconds", [-2.0, 1e10])
def test_a_host_clock_that_cannot_be_is_refused(log: Path, seconds: float) -> None:
    lines = log.read_bytes().decode().splitlines(keepends=True)
    lines[40] = _later(lines[40], seconds)
    log.write_bytes("".join(lines).encode())
    for args in (("export", log, "--to", "c3d", "-o", log.with_name("x.out")), ("log", "--check", log)):
        done = run("ekso", *args, "--json")
        assert (done.code, done.error["code"]) == (2, "damaged-log") and not log.with_name("x.out").exists()


# -- log --check ----------------------------------------------------------------------------------------------------------


def checked(log: Path) -> Result:
    return run("ekso", "log", "--check", log, "--json")


def test_check_shows_each_break_and_the_fit(log: Path) -> None:
    done = checked(log)
    assert done.code == 0
    first, second = done.rows
    assert (first["begins"], first["rows"], first["gaps"], first["row"]) == ("start", 200, 1, 1)
    assert (second["begins"], second["rows"], second["gaps"], second["row"]) == ("reboot", 50, 0, 201)
    assert second["pause"] == pytest.approx(PAUSE, abs=0.01) and first["duration"] == 4.46
    assert first["drift"] == pytest.approx(200, abs=1) and abs(first["apart"]) < 1
    fit = json.loads(Path(f"{log}.json").read_text())["segments"][0]["clock_fit"]
    assert (first["a_s"], first["b"], first["residual"]) == (fit["a_s"], fit["b"], fit["residual_ms"])


def _edit(log: Path, **keys: Any) -> None:
    path = Path(f"{log}.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | keys))


def test_check_finds_what_is_not_whole(log: Path) -> None:
    _edit(log, missing=["lost"])
    done = checked(log)
    assert (done.code, done.error["code"]) == (7, "log") and len(done.rows) == 2
    Path(f"{log}.json").unlink()
    assert checked(log).code == 7


def test_check_finds_a_sidecar_that_does_not_fit(log: Path) -> None:
    segments: list[dict[str, Any]] = json.loads(Path(f"{log}.json").read_text())["segments"]
    _edit(log, segments=[segments[0] | {"clock_fit": segments[0]["clock_fit"] | {"b": 1.01}}, segments[1]])
    assert checked(log).code == 7
    _edit(log, segments=[segments[0] | {"rows": 199}, segments[1]])
    assert checked(log).code == 7
    _edit(log, segments=segments)
    assert checked(log).code == 0


@each_row(("late", "code"), [(0.045, 0), (0.075, 7)])
def test_check_finds_clocks_that_part_within_a_segment(log: Path, late: float, code: int) -> None:
    lines = log.read_bytes().decode().splitlines(keepends=True)
    lines[150:201] = [_later(line, late) for line in lines[150:201]]
    log.write_bytes("".join(lines).encode())
    Path(f"{log}.json").write_text(json.dumps(json.loads(Path(f"{log}.json").read_text()) | {"segments": [
        one | {"clock_fit": None} for one in json.loads(Path(f"{log}.json").read_text())["segments"]]}))  # fmt: skip
    assert checked(log).code == code


def _columns(log: Path, change: Callable[[int, dict[str, str]], dict[str, str]]) -> None:
    """Write the rows with what `change` makes of the cells of each, counted from 1."""
    with log.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        rows = [cells | change(number, cells) for number, cells in enumerate(reader, 1)]
        names = list(reader.fieldnames or ())
    with log.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)


EDITED: dict[str, tuple[Callable[[int, dict[str, str]], dict[str, str]], int]] = {
    "boot_ms of the rest": (lambda n, row: {"boot_ms": str(int(row["boot_ms"]) + 60 * (120 <= n <= 200))}, 7),
    "boot_ms of one row": (lambda n, row: {"boot_ms": "5" if n == 120 else row["boot_ms"]}, 7),
    "boot_ms of a segment": (lambda n, row: {"boot_ms": str(int(row["boot_ms"]) + (n > 200))}, 7),
    "host_utc_s": (lambda n, row: {"host_utc_s": f"{float(row['host_utc_s']) - 86400 * (n > 99):.6f}"}, 2),
    "seq beyond 64 bit": (lambda n, row: {"seq": "9" * 19 if n == 250 else row["seq"]}, 2),
    "seq twice": (lambda n, row: {"seq": "99" if n == 100 else row["seq"]}, 2),
    "seq of the first": (lambda n, row: {"seq": "7" if n == 1 else row["seq"]}, 2),
    "a mark more": (lambda n, row: {"mark": "go" if n == 120 else row["mark"]}, 7),
    "a mark less": (lambda n, row: {"mark": "" if n == 31 else row["mark"]}, 7),
    "another mark": (lambda n, row: {"mark": "stop" if n == 31 else row["mark"]}, 7),
    "a mark behind a note": (lambda n, row: {"mark": f"{row['mark']}; go" if n == 201 else row["mark"]}, 7),
    "nothing": (lambda n, row: {}, 0),
}


@each_row(("change", "code"), EDITED.values(), ids=EDITED)
def test_check_finds_what_was_edited(
    tmp_path: Path, change: Callable[[int, dict[str, str]], dict[str, str]], code: int
) -> None:
    log = given(tmp_path)
    _columns(log, change)
    done = checked(log)
    assert done.code == code, done
    if code == 2:
        assert run("ekso", "export", log, "--to", "xdf", "-o", log.with_name("x.out")).code == 2
        assert run("ekso", "gait", log).code == 2


@each_row("edit", ["a row less", "half a row", "a count", "the end", "a segment"])
def test_check_finds_what_is_not_as_its_sidecar_says(tmp_path: Path, edit: str) -> None:
    log = given(tmp_path)
    whole, about = log.read_bytes(), json.loads(Path(f"{log}.json").read_text(encoding="utf-8"))
    if edit == "a row less":
        log.write_bytes(b"".join(whole.splitlines(keepends=True)[:-1]))
    elif edit == "half a row":
        log.write_bytes(whole[:-40])
    else:
        first = about["segments"][0] | {"boot_ms": [1001, 1]}
        _edit(log, **{
            "a count": {"rows": 3}, "the end": {"end": about["end"] | {"boot_ms": 5}},
            "a segment": {"segments": [first, *about["segments"][1:]]},
        }[edit])  # fmt: skip
    done = checked(log)
    assert (done.code, done.error["code"]) == (7, "log"), done


def test_check_records_nothing(log: Path) -> None:
    before = {path: path.read_bytes() for path in log.parent.iterdir()}
    assert checked(log).code == 0 and {path: path.read_bytes() for path in log.parent.iterdir()} == before
    assert run("ekso", "log", "--check", log, "--duration", "1").code == 2
    done = run("ekso", "log", "--check", log.with_name("none.csv"), "--json")
    assert done.code == 2 and not log.with_name("none.csv").exists()
