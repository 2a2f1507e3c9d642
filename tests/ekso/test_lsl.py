"""`log --lsl` against another process on the Lab Streaming Layer, where pylsl is installed; and what is said where it is not."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.cli import run

COMPARED_S = 0.8
"""After so long the library has compared the clocks of both programs; it waits for that before it hands on a first mark."""


def test_without_the_extra_it_says_what_to_install_and_makes_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    path = tmp_path / "a.csv"
    done = run("ekso", "log", path, "--lsl", "--count", "1", "-p", "fake://ekso?clock=virtual", "--json")
    assert (done.code, done.error["code"]) == (2, "no-extra") and "handctl[lsl]" in done.error["hint"]
    assert not path.exists()


@pytest.mark.real
def test_rows_and_marks_are_sent_and_marks_received_with_their_times(tmp_path: Path) -> None:
    lsl = pytest.importorskip("pylsl")
    path = tmp_path / "a.csv"
    other = lsl.StreamOutlet(lsl.StreamInfo("other", "Markers", 1, 0, lsl.cf_string, "other"))
    line = [sys.executable, "-m", "handctl", "ekso", "log", str(path), "--lsl", "--rate", "50", "--count", "300"]
    logs = subprocess.Popen(
        [*line, "--mark-stdin", "-q", "-p", "fake://ekso?posture=walking"], stdin=subprocess.PIPE, text=True
    )
    rows, marks = (
        lsl.StreamInlet(lsl.resolve_byprop("name", name, timeout=20)[0])
        for name in ("handctl ekso", "handctl ekso marks")
    )
    rows.open_stream(20)
    marks.open_stream(20)
    info = rows.info(20)
    first = info.desc().child("channels").child("channel")
    assert (info.channel_count(), info.nominal_srate()) == (25, 50)
    assert [first.child_value(key) for key in ("label", "unit")] == ["torso_pitch_deg", "deg"]
    assert other.wait_for_consumers(20)
    time.sleep(COMPARED_S)
    at = lsl.local_clock()
    other.push_sample(["elsewhere"], at)
    assert logs.stdin is not None
    logs.stdin.write("here\n")
    logs.stdin.flush()
    assert marks.pull_sample(timeout=20)[0] == ["here"]
    values, stamp = rows.pull_sample(timeout=20)
    logs.communicate(timeout=30)
    assert logs.returncode == 0
    recorded = list(csv.DictReader(path.open(encoding="utf-8", newline="")))
    row = min(recorded, key=lambda row: abs(float(row["host_mono_s"]) - stamp))
    assert abs(float(row["host_mono_s"]) - stamp) < 0.001 and float(row["torso_pitch_deg"]) == values[0]
    marked = json.loads(Path(f"{path}.json").read_text())["marks"]
    heard = {one["text"]: (one, mark["row"]) for mark in marked for one in mark["heard"]}
    (elsewhere, number), (here, _) = heard["elsewhere"], heard["here"]
    assert (elsewhere["by"], here["by"]) == ("lsl", "line")
    assert abs(elsewhere["host_mono_s"] - at) < 1 / 50
    assert abs(float(recorded[number - 1]["host_mono_s"]) - at) < COMPARED_S / 3
