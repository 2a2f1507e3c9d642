"""A recording of any family goes into every format, and comes back with its numbers."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from handctl.model.export_formats import FORMATS
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
def test_a_log_of_another_family_is_refused(kind: str, tmp_path: Path) -> None:
    other = next(one for one in FAMILIES if one != kind)
    path = log(other, tmp_path)
    done = run(kind, "export", path, "--to", "xdf", "-o", tmp_path / "out.xdf", "--json")
    assert (done.code, done.error["code"]) == (2, "damaged-log") and not (tmp_path / "out.xdf").exists()
