"""`handctl ekso log` and `handctl ekso export` as a user meets them, with the simulated device behind them."""

from __future__ import annotations

import csv
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from datetime import datetime
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import pexpect
import pytest

from handctl.link.fake import FakeLink
from handctl.link.link_interface import Deadline
from tests.support.cli import PATIENCE, Result, clean_environment, program, run, wait_until
from tests.support.each_row import each_row


def ekso(**options: object) -> str:
    """A simulated device on virtual time; names may use _ for -."""
    said = {"clock": "virtual", **options}
    return "fake://ekso?" + "&".join(f"{k.replace('_', '-')}={v}" for k, v in said.items())


def log(path: Path, *args: str, env: dict[str, str] | None = None, **options: object) -> Result:
    return run("ekso", "log", path, *args, "--json", "-p", ekso(**options), env=env)


def table(path: Path) -> list[dict[str, str]]:
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def sidecar(path: Path) -> dict[str, Any]:
    return dict(json.loads(Path(f"{path}.json").read_text(encoding="utf-8")))


def export(path: Path, *args: str | Path) -> Result:
    return run("ekso", "export", path, *args)


# -- log --------------------------------------------------------------------------------------------------------------


def test_the_values_of_the_dossier_reach_the_file(tmp_path: Path) -> None:
    path = tmp_path / "gait.csv"
    done = log(path, "--count", "3", "--rate", "50", "--raw", "--mark", "go", preset="vectors", sway=0)
    assert done.code == 0
    (row,) = done.rows
    assert (row["file"], row["rows"], row["rate"], row["duration"]) == (str(path), 3, 50.0, 0.04)
    assert (row["lost"], row["gaps"], row["segments"], row["marks"]) == (0, 0, 1, 1)
    rows = table(path)
    first = rows[0]
    assert [first[name] for name in ("torso_pitch_deg", "torso_roll_deg", "left_hip_x_in", "right_hip_y_in")] == [
        "4.50", "-0.75", "9.8", "36.00",
    ]  # fmt: skip
    assert (first["right_knee_current_a"], first["left_hip_angle_deg"], first["raw_01_torso_roll"]) == (
        "-0.40", "-6.35", "65461",
    )  # fmt: skip
    assert (first["state_raw"], first["state_name"], first["mark"]) == ("8256", "standing (0x2040)", "go")
    assert [row["t_s"] for row in rows] == ["0.000", "0.020", "0.040"]
    assert int(first["raw_25_boot_time_high"]) << 16 | int(first["raw_26_boot_time_low"]) == int(first["boot_ms"])
    about = sidecar(path)
    assert (about["complete"], about["simulated"], about["rows"], about["ended"]) == (True, True, 3, "limit")
    assert about["settings_before"] == about["settings_after"]
    assert about["settings_before"]["forward_shift"] == {"raw": -75, "value": -0.75, "unit": None, "label": None}
    assert about["settings_before"]["walk_mode"]["label"] == "ProStep"
    assert "pilot_id" not in about["settings_before"]
    assert about["counters"]["answered"] >= 5
    assert about["device_time"]["device"].startswith("2026-11-20T14:05:")
    assert about["tool"]["name"] == "handctl"


def test_the_time_of_day_is_that_of_the_link(tmp_path: Path) -> None:
    """As a replay or a simulator on virtual time has it, not as this machine does."""
    path = tmp_path / "a.csv"
    assert log(path, "--count", "3", "--rate", "1", clock="virtual@1767311998").code == 0
    about = sidecar(path)
    assert about["start"]["utc"].startswith("2026-01-01T23:59:5") and about["end"]["utc"].startswith(
        "2026-01-02T00:00:0"
    )
    host = datetime.fromisoformat(about["device_time"]["host_local"]).astimezone()
    assert round(host.timestamp()) in range(1767311998, 1767312000)


def test_the_pilot_is_written_only_on_request(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    assert log(path, "--count", "1", "--include-pilot-id", preset="vectors").code == 0
    assert sidecar(path)["settings_after"]["pilot_id"]["value"] == 7


def test_as_fast_as_the_line_carries_it(tmp_path: Path) -> None:
    """GetData takes 66 bytes: 174.5 Hz at 115200."""
    done = log(tmp_path / "a.csv", "--duration", "2", wire=115200)
    assert 0.95 * 174.5 <= done.rows[0]["rate"] <= 175.5
    assert done.rows[0]["gaps"] == 0


def test_a_device_on_a_grid_has_no_gaps(tmp_path: Path) -> None:
    done = log(tmp_path / "a.csv", "--duration", "5", wire=115200, quantum=20)
    assert done.rows[0]["gaps"] == 0
    assert 40 <= done.rows[0]["rate"] <= 51


def test_a_reboot_makes_a_segment(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(path, "--count", "80", "--rate", "50", fault="reboot", every=60)
    assert done.code == 0
    assert done.rows[0]["segments"] == 2
    assert "rebooted" in done.codes()
    rows = table(path)
    assert {row["segment"] for row in rows} == {"1", "2"}
    (border,) = [i for i, row in enumerate(rows) if row["mark"].startswith("[reboot]; [gap ")]
    before, after = rows[border - 1], rows[border]
    assert int(after["boot_ms"]) < int(before["boot_ms"])
    elapsed = float(after["host_mono_s"]) - float(before["host_mono_s"])
    assert float(after["t_s"]) - float(before["t_s"]) == pytest.approx(elapsed, abs=0.002)
    assert [s["settings_changed"] for s in sidecar(path)["segments"]] == [None, []]


def pulls(seed: int, count: int = 10) -> list[tuple[float, float]]:
    """Moments at which the port goes, and for how long, at random; at least half a second of port between two."""
    random = Random(seed)
    at, found = 0.3, []
    for _ in range(count):
        at += random.uniform(0.5, 4.0)
        found.append((round(at, 4), round(random.uniform(0.01, 3.0), 4)))
        at += found[-1][1]
    return found


@pytest.mark.parametrize("rate", [0, 25])
def test_ten_unplugs_at_random_in_one_log(tmp_path: Path, rate: int) -> None:
    unplugged(tmp_path, rate, 0)


def unplugged(tmp_path: Path, rate: int, seed: int) -> None:
    """Pull the cable ten times at places of this seed: one whole log, and each hole is told."""
    path = tmp_path / "a.csv"
    plan = pulls(seed)
    length = plan[-1][0] + plan[-1][1] + 2
    asked = ("--duration", str(length), "--rate", str(rate), "--silence", "4")
    done = log(path, *asked, wire=115200, quantum=20, unplug=",".join(f"{at}:{away}" for at, away in plan))
    assert done.code == 0, done
    assert sorted(found.name for found in tmp_path.iterdir()) == ["a.csv", "a.csv.json"], "one file"
    (row,), rows, about = done.rows, table(path), sidecar(path)
    assert (row["holes"], row["segments"], done.codes().count("port-lost")) == (10, 11, 10)
    assert row["rows"] == len(rows) == about["rows"] == sum(segment["rows"] for segment in about["segments"])
    assert int(rows[-1]["seq"]) == row["rows"] + row["lost"]
    marked = [number for number, line in enumerate(rows, 1) if line["mark"].startswith("[port lost]; [gap ")]
    assert marked == [hole["row"] for hole in about["holes"]]
    for (_, away), hole in zip(plan, about["holes"], strict=True):
        assert away <= hole["length_s"] <= away + 0.4
        assert hole["rebooted"] is False
    steps = [float(b["t_s"]) - float(a["t_s"]) for a, b in pairwise(rows)]
    missing = sum(gap for _, gap in about["gaps"]) / 1000
    assert sum(steps) == pytest.approx(row["duration"], abs=0.001)
    assert row["rate"] == pytest.approx((len(rows) - 1 - len(about["gaps"])) / (row["duration"] - missing), abs=0.1)
    assert len({line["boot_ms"] for line in rows}) == len(rows), "no two rows at one moment"
    assert export(path, "--format", "csv").raw == path.read_bytes()
    assert export(path, "--format", "mot", "--segment", "11").code == 0


def test_a_restart_on_usb_takes_the_port_away_and_is_ridden_over(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(path, "--count", "300", "--rate", "50", usb=1, startup=1.7, fault="reboot", every=160)
    assert done.code == 0
    assert done.rows[0]["holes"] == done.rows[0]["segments"] - 1 >= 1
    assert {"port-lost", "rebooted"} <= set(done.codes())
    marks = [line["mark"] for line in table(path) if line["mark"]]
    assert len(marks) == done.rows[0]["holes"]
    assert all(mark.startswith("[port lost]; [reboot]; [gap ") for mark in marks)
    assert [segment["settings_changed"] for segment in sidecar(path)["segments"]][:2] == [None, []]


def test_a_port_that_does_not_come_back_ends_the_log_with_all_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(path, "--rate", "50", "--silence", "3", unplug="2.013:90")
    assert (done.code, done.error["code"]) == (3, "lost")
    assert "within the 3 s of --silence" in done.error["text"]
    assert done.rows[0]["rows"] == len(table(path)) == sidecar(path)["rows"] == 100
    assert (sidecar(path)["complete"], sidecar(path)["closed"], sidecar(path)["ended"]) == (False, True, "lost")
    done = log(tmp_path / "b.csv", "--rate", "50", "--deadline", "3", unplug="2.013:90")
    assert (done.code, done.error["code"]) == (4, "deadline")
    assert done.rows[0]["rows"] == len(table(tmp_path / "b.csv")) == 100
    done = log(tmp_path / "c.csv", "--rate", "50", fault="disconnect", after=30)
    assert (done.code, done.error["code"]) == (3, "lost"), "what hangs up for good ends the log at once"


def test_an_end_while_the_lost_port_is_closed_leaves_the_hole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGTERM may come between the last row and the first look for the port."""

    def interrupted(_hold: object) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr("handctl.stop.device_access.DeviceAccess.reopen", interrupted)
    path = tmp_path / "a.csv"
    done = log(path, "--rate", "50", "--silence", "3", unplug="2.013:90")
    assert done.code == 130
    assert [hole["row"] for hole in sidecar(path)["holes"]] == [None]


def test_lost_answers_are_retried_told_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(path, "--count", "30", "--rate", "50", "--retries", "0", fault="silent", after=15, every=10)
    assert done.code == 0
    (row,) = done.rows
    assert (row["rows"], row["lost"]) == (30, row["gaps"])
    assert row["lost"] >= 2
    assert {"gap", "lost"} <= set(done.codes())
    assert sum(line["mark"].startswith("[gap 0.5") for line in table(path)) == row["gaps"]
    assert int(table(path)[-1]["seq"]) == 30 + row["lost"]
    assert sidecar(path)["counters"]["timeouts"] == row["lost"]


def test_steps_and_walking_time_are_in_the_log(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    assert log(path, "--duration", "8", "--rate", "50", use="on").code == 0
    feedback = sidecar(path)["feedback"]
    assert 8 <= feedback["answered"] <= 10
    first, *later = feedback["timeline"]
    assert {"steps_taken", "upright_time", "walk_time", "left_step_length", "right_step_length"} <= set(
        first["changed"]
    )
    for name in ("steps_taken", "walk_time"):
        seen = [entry["changed"][name] for entry in feedback["timeline"] if name in entry["changed"]]
        assert seen[-1] > seen[0] and seen == sorted(set(seen)), name
    rows = table(path)
    for entry in later:
        assert 0 <= entry["t_s"] - float(rows[entry["row"] - 1]["t_s"]) < 0.1


def test_changes_at_the_pendant_are_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(path, "--count", "2", fault="pendant")
    assert "settings-changed" in done.codes()
    about = sidecar(path)
    assert about["settings_changed"] == ["target_sounds"]
    words = [about[key]["target_sounds"]["label"] for key in ("settings_before", "settings_after")]
    (told,) = [message["text"] for message in done.json["messages"] if message["code"] == "settings-changed"]
    assert f"target_sounds {words[0]} -> {words[1]}" in told and words[0] != words[1]


def test_a_frozen_clock_is_told(tmp_path: Path) -> None:
    done = log(tmp_path / "a.csv", "--count", "5", "--rate", "50", fault="frozen-clock")
    assert "boot-time-still" in done.codes()


@pytest.mark.parametrize(("options", "code"), [({"fault": "silent"}, 4), ({"fault": "bad-checksum"}, 5)])
def test_a_device_that_never_answers_leaves_no_file(tmp_path: Path, options: dict[str, str], code: int) -> None:
    done = log(tmp_path / "a.csv", "--duration", "1", **options)
    assert done.code == code
    assert list(tmp_path.iterdir()) == []


def test_a_device_that_falls_silent_ends_the_log(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = log(path, "--silence", "5", "--rate", "50", fault="silent", after=30)
    assert done.code == 4
    assert done.rows[0]["rows"] == len(table(path)) > 10
    assert (sidecar(path)["complete"], sidecar(path)["closed"], sidecar(path)["ended"]) == (False, True, "no-answer")
    assert sidecar(path)["settings_after"] is None
    assert "settings-unread" in done.codes()


def test_the_deadline_of_the_command_ends_it(tmp_path: Path) -> None:
    done = log(tmp_path / "a.csv", "--deadline", "1", "--rate", "50")
    assert (done.code, done.error["code"]) == (4, "deadline")
    assert 30 <= done.rows[0]["rows"] <= 52


def test_nothing_is_overwritten_without_force(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("mine")
    done = log(path, "--count", "1")
    assert (done.code, done.error["code"], path.read_text()) == (2, "file-exists", "mine")
    assert done.json["counters"]["sent"] == 0
    assert log(path, "--count", "1", "--force").code == 0
    assert len(table(path)) == 1


@each_row("place", ["/dev/full", "pipe"])
def test_a_log_is_a_file_also_with_force(tmp_path: Path, place: str) -> None:
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for a reader
    path = tmp_path / "a.csv"
    path.symlink_to(place)
    done = log(path, "--count", "1", "--force")
    assert (done.code, done.error["code"], done.json["counters"]["sent"]) == (2, "log-file", 0)
    assert path.is_symlink(), "nothing is removed"
    assert sorted(found.name for found in tmp_path.iterdir()) == ["a.csv", "pipe"]


def test_a_directory_and_a_path_that_does_not_exist(tmp_path: Path) -> None:
    done = log(tmp_path, "--count", "1")
    assert Path(done.rows[0]["file"]).parent == tmp_path
    assert log(tmp_path / "none" / "a.csv", "--count", "1").code == 1


def test_a_log_only_reads(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    assert log(tmp_path / "a.csv", "--count", "3", "--trace", str(trace)).code == 0
    commands = {line.split()[2] for line in trace.read_text().splitlines() if " > " in line}
    assert commands == {"96", "97", "98", "99", "9A"}
    assert log(tmp_path / "b.csv", "-n").code == 2


def test_a_full_disk_is_one_clear_error_and_the_rows_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        done = log(path, "--rate", "50")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert (done.code, done.error["code"]) == (1, "log-file")
    assert done.error["text"].startswith(f"{path}: cannot be written: ")
    assert done.rows[0]["rows"] == len(table(path)) > 50
    assert (sidecar(path)["complete"], sidecar(path)["missing"], sidecar(path)["rows"]) == (
        False,
        ["log-file"],
        len(table(path)),
    )
    exported = export(path, "--format", "csv")
    assert exported.code == 0 and "is incomplete: log-file" in exported.err


def test_a_clock_that_runs_ahead_makes_no_log_longer(tmp_path: Path) -> None:
    """5 s further at each request: the log took 5 s all the same."""
    path = tmp_path / "a.csv"
    done = log(path, "--duration", "5", "--rate", "20", fault="clock-jump")
    assert done.code == 0 and "clocks-parted" in done.codes() and "rebooted" not in done.codes()
    assert done.rows[0]["duration"] == pytest.approx(4.95, abs=0.05)
    assert done.rows[0]["segments"] == len(table(path)) and sidecar(path)["complete"] is True


# -- ended from outside -----------------------------------------------------------------------------------------------


def started(path: Path, *args: str) -> subprocess.Popen[bytes]:
    """A running log of its own process, with at least 20 rows in the file."""
    process = subprocess.Popen(
        program("ekso", "log", path, "--rate", "100", "--fake", *args),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, env=clean_environment(),
    )  # fmt: skip
    wait_until(lambda: path.exists() and path.read_bytes().count(b"\n") > 20)
    return process


def test_each_row_is_in_the_file_before_the_next_one_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill loses no more than the row that is under way."""
    path, seen, write = tmp_path / "a.csv", list[int](), FakeLink.write

    def ask(link: FakeLink, data: bytes, deadline: Deadline) -> None:
        if path.exists():
            seen.append(path.read_bytes().count(b"\n"))
        write(link, data, deadline)

    monkeypatch.setattr(FakeLink, "write", ask)
    assert log(path, "--count", "20", "--rate", "100").code == 0
    assert set(seen) >= set(range(1, 21))


@pytest.mark.real
def test_kill_9_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    process = started(path)
    process.kill()
    process.communicate(timeout=PATIENCE)
    assert path.read_bytes().endswith(b"\r\n")
    assert len(table(path)) >= 20
    about = sidecar(path)
    assert (about["complete"], about["rows"]) == (False, None)
    assert len(about["settings_before"]) == 21
    done = export(path, "--format", "csv")
    assert done.code == 0
    assert done.raw == path.read_bytes()


@pytest.mark.real
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_log_as_it_should(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "a.csv"
    process = started(path, "--json")
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    done = Result(130, out, err)
    assert done.rows[0]["rows"] == len(table(path)) == sidecar(path)["rows"]
    assert sidecar(path)["ended"] == "interrupted"
    assert sidecar(path)["settings_after"] is not None
    assert export(path, "--format", "mot").code == 0


@pytest.fixture
def on_a_terminal(tmp_path: Path) -> Iterator[pexpect.spawn]:
    """A log into a.csv, running on a terminal."""
    child = pexpect.spawn(
        sys.executable,
        ["-m", "handctl", "ekso", "log", "a.csv", "--rate", "50", "--fake"],
        cwd=str(tmp_path),
        env=clean_environment({"TERM": "xterm"}),
        encoding="utf-8",
        timeout=PATIENCE,
        dimensions=(24, 100),
    )
    child.expect("Any key sets a mark")
    child.expect(r"\d+ rows")
    yield child
    child.close(force=True)


def _longer(path: Path, rows: int) -> bool:
    return len(table(path)) > rows


@pytest.mark.real
def test_keys_on_a_terminal_set_marks(tmp_path: Path, on_a_terminal: pexpect.spawn) -> None:
    path = tmp_path / "a.csv"
    for keys in (" ", "h", "\x1b[A"):
        before = len(table(path))
        on_a_terminal.send(keys)
        wait_until(partial(_longer, path, before + 2))
    on_a_terminal.sendintr()
    on_a_terminal.expect("File")
    on_a_terminal.expect(pexpect.EOF)
    on_a_terminal.close()
    assert on_a_terminal.exitstatus == 130
    notes = [note for row in table(path) for note in row["mark"].split("; ")]
    assert [note for note in notes if note and not note.startswith("[gap")] == ["mark 1", "h"], "but for a busy machine"
    assert [mark["text"] for mark in sidecar(path)["marks"]] == ["mark 1", "h"]


@pytest.mark.real
def test_a_terminal_that_is_closed_ends_a_log_as_ctrl_c_does(tmp_path: Path, on_a_terminal: pexpect.spawn) -> None:
    path = tmp_path / "a.csv"
    on_a_terminal.ptyproc.fileobj.close()
    wait_until(lambda: sidecar(path)["closed"])
    assert sidecar(path)["rows"] == len(table(path)) > 0
    assert sidecar(path)["ended"] == "interrupted"


# -- export -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def gait(tmp_path: Path) -> Path:
    """A short log."""
    path = tmp_path / "gait.csv"
    assert log(path, "--count", "3", "--rate", "50", preset="vectors", sway=0).code == 0
    return path


def test_a_motion_file_on_stdout_and_in_a_file(gait: Path, tmp_path: Path) -> None:
    done = export(gait, "--format", "mot")
    assert done.code == 0
    assert done.lines[:5] == ["name gait.csv", "version=1", "nRows=3", "nColumns=6", "inDegrees=yes"]
    assert done.lines[-1] == "0.040\t-4.50\t22.10\t8.40\t-6.35\t3.20"
    assert "knee-sign" in done.said
    assert "simulator" in done.err
    signed = export(gait, "--format", "mot", "--knee-sign", "-1", "-o", tmp_path / "gait.mot")
    assert (signed.code, signed.out) == (0, "")
    assert "knee flexion" not in signed.err
    assert (tmp_path / "gait.mot").read_text().splitlines()[-1] == "0.040\t-4.50\t22.10\t-8.40\t-6.35\t-3.20"


def test_csv_in_si_units_and_as_json(gait: Path) -> None:
    assert export(gait, "--format", "csv").raw == gait.read_bytes()
    assert export(gait, "--csv").raw == gait.read_bytes()
    assert "right_hip_y_m" in export(gait, "--format", "csv", "--si").lines[0]
    done = export(gait, "--format", "mot", "--json")
    assert done.rows[2] == {
        "time": 0.04, "pelvis_tilt": -4.5, "hip_flexion_r": 22.1, "knee_angle_r": 8.4, "hip_flexion_l": -6.35,
        "knee_angle_l": 3.2,
    }  # fmt: skip
    assert done.json["device"] == {"kind": "ekso", "link": "fake://ekso", "fake": True, "id": None}
    assert export(gait, "--format", "csv", "--si", "--json").rows[0]["torso_pitch_rad"] == 0.07853982


@pytest.mark.parametrize("value", ["csv", "plain"])
def test_the_environment_does_not_change_a_motion_file(gait: Path, value: str) -> None:
    done = run("ekso", "export", gait, "--to", "mot", env={"HANDCTL_FORMAT": value})
    assert (done.out, done.code) == (
        run("ekso", "export", gait, "--format", "mot", env={"HANDCTL_FORMAT": value}).out,
        0,
    )
    assert done.lines[0] == "name gait.csv"


@pytest.mark.parametrize(
    "args",
    [
        (), ("--format", "mot", "--si"), ("--format", "csv", "--rate", "10"), ("--format", "csv", "--knee-sign", "1"),
        ("--format", "mot", "--segment", "2"), ("--format", "mot", "--rate", "0"), ("--format", "xml"),
        ("--format", "mot", "-n"),
    ],
)  # fmt: skip
def test_impossible_exports(gait: Path, args: tuple[str, ...]) -> None:
    done = export(gait, *args)
    assert (done.code, done.out) == (2, "")


def test_the_log_itself_is_never_the_output(gait: Path) -> None:
    before = gait.read_bytes()
    for target in (gait, Path(f"{gait}.json")):
        assert export(gait, "--format", "mot", "-o", target).code == 2
    assert gait.read_bytes() == before


def test_a_damaged_log_leaves_no_output(gait: Path, tmp_path: Path) -> None:
    gait.write_bytes(gait.read_bytes().replace(b",4.50,", b",4.5O,", 1))
    done = export(gait, "--format", "csv", "--si", "-o", tmp_path / "out.csv", "--json")
    assert done.code == 2
    assert "line 2: torso_pitch_deg" in done.err
    assert not (tmp_path / "out.csv").exists() or json.loads((tmp_path / "out.csv").read_text())["ok"] is False


@pytest.mark.parametrize(
    "how", [("--duration", "3", "--rate", "33"), ("--count", "700"), ("--count", "300", "--rate", "100")]
)
def test_a_replay_reads_the_feedback_where_the_recording_did(how: tuple[str, ...], tmp_path: Path) -> None:
    """A second has passed a row earlier or later by the times of a transcript: then another request would have that msgID."""
    first, again, trace = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "a.trace"
    assert log(first, *how, "--trace", str(trace), posture="walking").code == 0
    done = run("ekso", "log", again, *how, "--json", "-p", f"replay:{trace}")
    assert done.code == 0, done
    rows, replayed = table(first), table(again)
    assert [row["right_knee_angle_deg"] for row in rows] == [row["right_knee_angle_deg"] for row in replayed]
    told, retold = (json.loads(Path(f"{path}.json").read_text())["feedback"] for path in (first, again))
    assert told["answered"] == retold["answered"] > 2 and not retold["unanswered"]
