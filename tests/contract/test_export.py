"""A recording of any family goes into every format, and comes back with its numbers."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from handctl.model.export_formats import FORMATS
from handctl.record.log_reader import LogFile
from tests.support.cli import run


def log(kind: str, folder: Path) -> Path:
    path = folder / f"{kind}.csv"
    done = run(kind, "log", path, "--count", "5", "--rate", "20", "--mark", "go", "-p", f"fake://{kind}?clock=virtual")
    assert done.code == 0, done
    return path


@pytest.mark.parametrize("kind", FAMILIES)
def test_what_was_recorded_comes_back(kind: str, tmp_path: Path) -> None:
    pyxdf = pytest.importorskip("pyxdf")
    path, out = log(kind, tmp_path), tmp_path / "out.xdf"
    assert run(kind, "export", path, "--to", "xdf", "-o", out).code == 0
    data, marks = pyxdf.load_xdf(out, dejitter_timestamps=False)[0]
    rows = list(csv.DictReader(path.open(encoding="utf-8", newline="")))
    told = json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))["columns"]
    channels = {one["label"][0]: one["unit"][0] or "" for one in data["info"]["desc"][0]["channels"][0]["channel"]}
    assert channels.items() >= {one["column"]: one["unit"] or "" for one in told}.items()
    for number, name in enumerate(channels):
        wanted = [float(row[name]) if row[name] else math.nan for row in rows]
        assert list(data["time_series"][:, number]) == pytest.approx(wanted, rel=0, abs=0, nan_ok=True), name
    assert list(data["time_stamps"]) == pytest.approx([float(row["host_mono_s"]) for row in rows], abs=0.002)
    assert [text for (text,) in marks["time_series"]] == ["go"] and marks["time_stamps"][0] == data["time_stamps"][0]


@pytest.mark.parametrize("kind", FAMILIES)
def test_every_format_and_check(kind: str, tmp_path: Path) -> None:
    path = log(kind, tmp_path)
    for form, one in FORMATS.items():
        if one.library:
            pytest.importorskip(one.library)
        done = run(kind, "export", path, "--to", form, "-o", tmp_path / f"out.{form}", "--json")
        assert done.code == 0 and done.rows[0]["rows"] == 5, (form, done)
    done = run(kind, "log", "--check", path, "--json")
    assert (done.code, [row["rows"] for row in done.rows]) == (0, [5])


@pytest.mark.parametrize("kind", FAMILIES)
def test_ordinary_rows_are_checked_at_once_and_a_damaged_one_by_line(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, out = log(kind, tmp_path), tmp_path / "out.xdf"
    with monkeypatch.context() as patch:
        patch.setattr(LogFile, "_slowly", lambda *_: pytest.fail("checked one by one"))
        assert run(kind, "export", path, "--to", "xdf", "-o", out).code == 0
    lines = path.read_bytes().splitlines(keepends=True)
    for column in (0, 5, 7):  # the host's time, the round trip, the first number of the device
        cells = lines[3].split(b",")
        cells[column] += b"x"
        path.write_bytes(b"".join([*lines[:3], b",".join(cells), *lines[4:]]))
        done = run(kind, "export", path, "--to", "xdf", "-o", out, "--json")
        assert (done.code, done.error["code"]) == (2, "damaged-log") and f"{path} line 4: " in done.error["text"]


@pytest.mark.parametrize("kind", FAMILIES)
def test_a_log_of_another_family_is_refused(kind: str, tmp_path: Path) -> None:
    other = next(one for one in FAMILIES if one != kind)
    path = log(other, tmp_path)
    done = run(kind, "export", path, "--to", "xdf", "-o", tmp_path / "out.xdf", "--json")
    assert (done.code, done.error["code"]) == (2, "damaged-log") and not (tmp_path / "out.xdf").exists()


@pytest.mark.parametrize("kind", FAMILIES)
def test_the_sidecar_of_another_recording_is_refused(kind: str, tmp_path: Path) -> None:
    path = log(kind, tmp_path)
    sidecar = Path(f"{path}.json")
    other = json.loads(sidecar.read_text(encoding="utf-8"))
    other["start"]["utc"] = "2020-01-01T00:00:00.000+00:00"
    sidecar.write_text(json.dumps(other), encoding="utf-8")
    for words in (("log", "--check", path), ("export", path, "--to", "xdf", "-o", tmp_path / "out.xdf")):
        done = run(kind, *words, "--json")
        assert (done.code, done.error["code"]) == (2, "damaged-log")
    assert not (tmp_path / "out.xdf").exists()


@pytest.mark.parametrize("heard", [True, False])
def test_a_mark_of_a_person_is_no_break_and_stays_in_its_row(heard: bool, tmp_path: Path) -> None:
    path = log("exo", tmp_path)
    rows = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\r\n".join([*rows[:4], f"{rows[4]}[port lost]", rows[5]]) + "\r\n", encoding="utf-8", newline="")
    sidecar = Path(f"{path}.json")
    about = json.loads(sidecar.read_text(encoding="utf-8"))
    text = "[port lost]\n\tyes" if heard else "[port lost]"
    about["marks"].append({"row": 4, "text": "[port lost]", **({"heard": [{"text": text}]} if heard else {})})
    sidecar.write_text(json.dumps(about), encoding="utf-8")
    assert run("exo", "log", "--check", path, "--json").rows[0]["begins"] == "start"
    assert run("exo", "export", path, "--to", "bids", "-o", tmp_path / "out").code == 0
    (events,) = (tmp_path / "out").rglob("*_events.tsv")
    lines = [line.split("\t") for line in events.read_text(encoding="utf-8").splitlines()]
    assert [line[2:] for line in lines[1:]] == [["mark", "go", "1"], ["mark", " ".join(text.split()), "4"]]
