"""What other programs take of a log: exact numbers, OpenSim's conventions, and refusal of all that is not a whole log."""

from __future__ import annotations

import csv
import io
import json
import math
import random
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handctl.devices.ekso import log_reader
from handctl.devices.ekso.export_opensim import Exported, motion, table
from handctl.devices.ekso.log_reader import LogFile
from handctl.devices.ekso.parameter_map import DATA
from handctl.errors import UsageError
from tests.ekso.recordings import STANDING, Device, make, opened
from tests.support.cli import run
from tests.support.each_row import each_row


def text_of(export: Exported) -> str:
    return "".join(export.spool.blocks())


def rows_of(export: Exported) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text_of(export).split("\n")[:-1]]


def exported_mot(path: Path, segment: int | None = None, knee_sign: int = 1, rate: float | None = None) -> str:
    return text_of(motion(LogFile(str(path)), segment=segment, knee_sign=knee_sign, rate=rate, tool="handctl 1"))


def parsed_mot(text: str) -> tuple[dict[str, str], list[str], list[list[float]]]:
    """Header keys, column names and numbers, as OpenSim reads them."""
    head, _, body = text.partition("endheader\n")
    keys = dict(line.split("=", 1) for line in head.splitlines() if "=" in line)
    names, *lines = body.splitlines()
    return keys, names.split("\t"), [[float(cell) for cell in line.split("\t")] for line in lines]


def parsed_csv(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text, newline="")))


# -- motion file ------------------------------------------------------------------------------------------------------


def test_a_motion_file_whole(tmp_path: Path) -> None:
    path = make(tmp_path / "gait.csv", [1001, 1023])
    assert exported_mot(path).splitlines() == [
        "name gait.csv",
        "version=1",
        "nRows=2",
        "nColumns=6",
        "inDegrees=yes",
        "source: handctl 1; gait.csv, segment 1; simulated",
        "sign: knee flexion is positive, pelvis_tilt is minus torso_pitch",
        "clock: host UTC in s is 1767225700.000000 + 0.000000 + 1.000000000 * time",
        "endheader",
        "time\tpelvis_tilt\thip_flexion_r\tknee_angle_r\thip_flexion_l\tknee_angle_l",
        "0.000\t-4.50\t22.10\t8.40\t-6.35\t3.20",
        "0.022\t-4.50\t22.10\t8.40\t-6.35\t3.20",
    ]
    keys, names, numbers = parsed_mot(exported_mot(path, knee_sign=-1))
    assert (int(keys["nRows"]), int(keys["nColumns"])) == (len(numbers), len(names))
    assert numbers[0] == [0.0, -4.5, 22.1, -8.4, -6.35, -3.2]


def test_no_negative_zero(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1, 11, 21], [(0,) * 25] * 3)
    for rate in (None, 300.0):
        assert "-0.0" not in exported_mot(path, knee_sign=-1, rate=rate)


def test_segments_are_never_mixed(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1001, 1021, 1041, 301, 331])
    with pytest.raises(UsageError) as found:
        exported_mot(path)
    assert "2 segments" in found.value.text
    assert found.value.hint == "choose one with --segment N (1: 3 rows, 0.0 s, 2: 2 rows, 0.0 s)"
    assert [row[0] for row in parsed_mot(exported_mot(path, 1))[2]] == [0, 0.02, 0.04]
    assert [row[0] for row in parsed_mot(exported_mot(path, 2))[2]] == [0, 0.03]
    with pytest.raises(UsageError, match="no segment 3"):
        exported_mot(path, 3)
    with pytest.raises(UsageError, match="no segment 3"):
        table(LogFile(str(path)), segment=3, si=False)
    assert [row["segment"] for row in parsed_csv(text_of(table(LogFile(str(path)), segment=2, si=False)))] == ["2", "2"]


def test_rows_at_a_standstill_are_left_out_and_told(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1001, 1001, 1021])
    found = motion(LogFile(str(path)), segment=None, knee_sign=1, rate=None, tool="x", as_rows=True)
    assert [row["time"] for row in rows_of(found)] == [0.0, 0.02]
    assert found.remarks == ("1 row left out: BootTime did not advance",)


def test_resampling_is_linear_and_never_crosses_a_gap(tmp_path: Path) -> None:
    hips = [0, 200, 400, 1000, 1200]
    rows = [(*STANDING[:11], hip, *STANDING[12:]) for hip in hips]
    path = make(tmp_path / "a.csv", [1, 21, 41, 141, 161], rows)
    numbers = parsed_mot(exported_mot(path, rate=100))[2]
    assert [(row[0], row[2]) for row in numbers] == [
        (0.0, 0.0), (0.01, 1.0), (0.02, 2.0), (0.03, 3.0), (0.04, 4.0), (0.14, 10.0), (0.15, 11.0), (0.16, 12.0),
    ]  # fmt: skip
    assert parsed_mot(exported_mot(path, rate=100))[0]["nRows"] == "8"


def test_a_log_without_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    recording = opened(path, Device([]))
    recording.close()
    recording.finish("limit")
    for export in (lambda: exported_mot(path), lambda: table(LogFile(str(path)), segment=None, si=True)):
        with pytest.raises(UsageError, match="no rows"):
            export()


# -- CSV --------------------------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(data=st.data(), raw=st.booleans())
def test_raw_to_log_to_export_is_exact(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, raw: bool
) -> None:
    words = data.draw(st.lists(st.lists(st.integers(0, 0xFFFF), min_size=25, max_size=25), min_size=1, max_size=5))
    boots = [1 + 20 * i for i in range(len(words))]
    path = make(tmp_path_factory.mktemp("log") / "a.csv", boots, words, raw=raw, mark='a, "b"')
    plain = parsed_csv(text_of(table(LogFile(str(path)), segment=None, si=False)))
    assert text_of(table(LogFile(str(path)), segment=None, si=False)).encode() == path.read_bytes()
    si = parsed_csv(text_of(table(LogFile(str(path)), segment=None, si=True)))
    mot = parsed_mot(exported_mot(path))[2]
    for row, metric, motion_row, sent, boot in zip(plain, si, mot, words, boots, strict=True):
        assert row["boot_ms"] == str(boot)
        for quantity, word in zip(DATA[:25], sent, strict=True):
            number = word - 0x10000 if quantity.signed and word > 0x7FFF else word
            (cell,) = [row[name] for name in row if name.startswith(quantity.name) and name[-5:] != "_name"]
            assert round(float(cell) * 10**quantity.decimals) == number
            ending, factor = {"deg": ("_rad", math.pi / 180), "in": ("_m", 0.0254)}.get(quantity.unit or "", ("", 1.0))
            if ending:
                assert round(float(metric[quantity.name + ending]) / factor * 10**quantity.decimals) == number
        hip = sent[11] - 0x10000 if sent[11] > 0x7FFF else sent[11]
        assert round(motion_row[2] * 100) == hip


def test_si_renames_what_it_converts(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1001])
    (row,) = parsed_csv(text_of(table(LogFile(str(path)), segment=None, si=True)))
    assert {k: v for k, v in row.items() if k.startswith(("torso_pitch", "right_hip", "state", "weight"))} == {
        "torso_pitch_rad": "0.07853982",
        "right_hip_x_m": "-0.12446",
        "right_hip_y_m": "0.914400",
        "right_hip_current_a": "-1.85",
        "right_hip_angle_rad": "0.38571776",
        "state_raw": "8256",
        "state_name": "standing (0x2040)",
        "weight_shift": "0.125",
    }
    assert not [name for name in row if name.endswith(("_deg", "_in"))]
    assert row["t_s"] == "0.000"


@each_row("more", [(), ("--si",)])
def test_no_mark_is_a_formula_where_none_is_wanted(more: tuple[str, ...], tmp_path: Path) -> None:
    log = make(tmp_path / "a.csv", [1001, 1021], mark="=1+1")
    for option, text in (((), "=1+1"), (("--no-formulas",), "'=1+1")):
        done = run("ekso", "export", log, "--to", "csv", *more, *option)
        assert [row["mark"] for row in csv.DictReader(done.lines)] == [text, ""]


def test_rows_for_json_are_numbers(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1001], mark="go")
    (row,) = rows_of(table(LogFile(str(path)), segment=None, si=False, as_rows=True))
    assert (row["boot_ms"], row["torso_roll_deg"], row["mark"]) == (1001, -0.75, "go")
    assert json.dumps(row)


# -- what is refused --------------------------------------------------------------------------------------------------


def refusal(path: Path) -> UsageError:
    with pytest.raises(UsageError) as found:
        table(LogFile(str(path)), segment=None, si=False)
    assert found.value.exit_code == 2
    return found.value


@each_row(
    ("line", "old", "new", "what"),
    [
        (1, b"boot_ms", b"boot_s", "column 3 is 'boot_s', but in a log it is 'boot_ms'"),
        (1, b",mark", b",mark,more", "the header continues"),
        (3, b",4.50,", b",4.5,", "torso_pitch_deg: '4.5' is not a number with 2 decimals"),
        (3, b",4.50,", b",444.50,", "torso_pitch_deg: '444.50' does not fit 16 bit"),
        (2, b",1021,", b",", "60 columns instead of 61"),
        (3, b"standing (0x2040)", b"sitting (0x2040)", "state_name: "),
        (3, b",4.50,", b",\xff4.50,", "not comma-separated text"),
        (3, b",4.50,", b',"4.50,', "not comma-separated text"),
        (3, b",0.020,1,", b",0.020,3,", "segment or t_s does not follow"),
        (4, b",0.040,", b",0.010,", "segment or t_s does not follow"),
        (3, b",22.10,", b",22.11,", "raw columns: 2210 does not fit right_hip_angle"),
        (3, b",1041,", b",1043,", "raw columns: they do not fit boot_ms"),
        (3, b",1041,", b",NaN,", "boot_ms: 'NaN' is not a number"),
        (4, b"\r\n", b"", "the row is cut short"),
        (4, b"1061", b"", "boot_ms: "),
    ],
)
def test_a_damaged_log_is_refused_with_its_line(tmp_path: Path, line: int, old: bytes, new: bytes, what: str) -> None:
    path = make(tmp_path / "a.csv", [1021, 1041, 1061], raw=True)
    table(LogFile(str(path)), segment=None, si=False)
    lines = path.read_bytes().splitlines(keepends=True)
    assert old in lines[line - 1]
    lines[line - 1] = lines[line - 1].replace(old, new, 1)
    path.write_bytes(b"".join(lines))
    error = refusal(path)
    assert error.text.startswith(f"{path} line {line}: {what}")
    assert error.code == "damaged-log"


def test_rows_that_are_missing_or_too_many_are_noticed(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1021, 1041, 1061])
    whole = path.read_bytes()
    path.write_bytes(b"".join(whole.splitlines(keepends=True)[:-1]))
    assert refusal(path).text.endswith("line 3: the file ends after 2 rows, its sidecar counts 3")
    path.write_bytes(whole + whole.splitlines(keepends=True)[-1])
    assert "its sidecar counts 3" in refusal(path).text


@each_row("content", ["", "{", "[]", '{"schema": "handctl-snapshot/1"}', '{"schema": "handctl-ekso-log/2"}'])
def test_a_foreign_sidecar_is_refused(tmp_path: Path, content: str) -> None:
    path = make(tmp_path / "a.csv", [1021])
    Path(f"{path}.json").write_text(content)
    assert refusal(path).text.startswith(f"{path}.json line 1: ")


@each_row("content", [b"", b"\x00" * 100_000, b"a,b\r\n1,2\r\n", b"\xef\xbb\xbfhost_utc", b"name x\nversion=1\n"])
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    assert refusal(path).text.startswith(f"{path} line 1: column 1 is ")


def test_a_missing_file_and_a_directory(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "none.csv").text
    assert "cannot be read" in refusal(tmp_path).text


def test_noise_never_gives_another_error(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1021, 1041, 1061], raw=True)
    whole = path.read_bytes()
    random.seed(1)
    for _ in range(300):
        data = bytearray(whole)
        for _ in range(random.randint(1, 3)):
            data[random.randrange(len(data))] = random.randrange(256)
        path.write_bytes(data)
        try:
            table(LogFile(str(path)), segment=None, si=True)
        except UsageError as exc:
            assert " line " in exc.text


# -- logs that were never closed --------------------------------------------------------------------------------------


def test_a_log_that_was_killed_is_exported_up_to_its_last_whole_row(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1021, 1041, 1061], complete=False)
    found = table(LogFile(str(path)), segment=None, si=False)
    assert (found.length, found.remarks) == (
        3,
        (f"{path} was never closed, because handctl was killed or is still running",),
    )
    path.write_bytes(path.read_bytes()[:-20])
    found = table(LogFile(str(path)), segment=None, si=False)
    assert found.length == 2
    assert found.remarks[0].endswith("Its last row was unfinished and was skipped")
    assert parsed_mot(exported_mot(path))[0]["nRows"] == "2"


def test_without_its_sidecar_a_log_is_taken_with_a_warning(tmp_path: Path) -> None:
    path = make(tmp_path / "a.csv", [1021])
    Path(f"{path}.json").unlink()
    assert table(LogFile(str(path)), segment=None, si=False).remarks == (
        f"{path}.json is missing, so nothing shows that the log is complete",
    )


# -- hours ------------------------------------------------------------------------------------------------------------


def test_a_closed_log_of_segments_is_refused_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make(tmp_path / "a.csv", [1001, 1021, 1041, 301, 331])
    monkeypatch.setattr(LogFile, "blocks", lambda _: pytest.fail("it was read"))
    for segment, what in ((None, "2 segments"), (3, "no segment 3")):
        with pytest.raises(UsageError, match=what) as found:
            exported_mot(path, segment)
        assert found.value.hint.rstrip(")").endswith("1: 3 rows, 0.0 s, 2: 2 rows, 0.0 s")
    with pytest.raises(UsageError, match="no segment 3"):
        table(LogFile(str(path)), segment=3, si=False)


def test_ordinary_rows_are_checked_by_column(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    moving = [(*STANDING[:18], 0x2440, *STANDING[19:]), STANDING] * 3  # its name has a comma, so it is quoted
    path = make(tmp_path / "a.csv", range(1001, 1121, 20), moving, raw=True)
    assert b'"standing, moving (0x2440)"' in path.read_bytes()
    monkeypatch.setattr(LogFile, "_slowly", lambda *_: pytest.fail("checked one by one"))
    assert text_of(table(LogFile(str(path)), segment=None, si=False)).encode() == path.read_bytes()


@each_row("size", [1, 300, 701, 5000])
def test_rows_are_the_same_however_the_file_is_read(tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make(tmp_path / "a.csv", [1001, 1021, 1021, 1041, 301, 331], raw=True, mark='a, "b"')
    monkeypatch.setattr(log_reader, "CHUNK", size)
    monkeypatch.setattr(log_reader.log_reader, "MOST_KNOWN", 2)
    assert text_of(table(LogFile(str(path)), segment=None, si=False)).encode() == path.read_bytes()
    assert [row[0] for row in parsed_mot(exported_mot(path, 1))[2]] == [0, 0.02, 0.04]
    path.write_bytes(path.read_bytes().replace(b",0.040,1,", b",0.010,1,"))
    assert refusal(path).text.startswith(f"{path} line 5: segment or t_s does not follow")
