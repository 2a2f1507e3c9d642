"""The log file while it is written: columns, text of every word, time base, segments, gaps, marks, whole rows."""

from __future__ import annotations

import contextlib
import csv
import errno
import json
import os
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from itertools import count, pairwise
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.ekso.parameter_map import DATA, SETTINGS
from handctl.devices.ekso.recording_source import USUAL_MS, EksoSource, RowLayout, parse, text_of
from handctl.errors import HandctlError, Interrupted, LinkError, NoAnswer, OutputError, ProtocolError, UsageError
from handctl.model.device_clock import WITHIN_MS, Moment
from handctl.model.prompts import Prompts
from handctl.record.csv_and_sidecar import changed, file_name, without_interrupts
from handctl.record.csv_columns import clean
from handctl.record.recording_loop import Limits, Loop
from handctl.record.row_source import Sample
from handctl.record.timeline import LEARNED, MOST_PARTED, ClockFit, Timeline
from tests.ekso.recordings import STANDING, Device, opened, recorded, run, steady, words_at
from tests.ekso.support import SETTINGS as GET_SETTINGS
from tests.ekso.support import Unit, ekso_on, frame, pack
from tests.support.each_row import each_row

# Section 7 of the dossier, literally.
COLUMNS = """
host_utc_s, host_mono_s, boot_ms, t_s, segment, seq, rtt_ms,
torso_pitch_deg, torso_roll_deg, right_toe_pressure_raw, right_heel_pressure_raw, left_toe_pressure_raw, left_heel_pressure_raw,
right_hip_x_in, right_hip_y_in, left_hip_x_in, left_hip_y_in, right_hip_current_a, right_hip_angle_deg,
right_knee_current_a, right_knee_angle_deg, left_hip_current_a, left_hip_angle_deg, left_knee_current_a, left_knee_angle_deg,
state_raw, state_name, foot_state_raw, min_state_raw, lcd_button_state_raw, weight_shift,
hmi_data_raw, va_ref_time, mark
"""
STANDING_TEXTS = (
    "4.50,-0.75,95,610,120,480,-4.9,36.00,9.8,36.22,-1.85,22.10,-0.40,8.40,2.10,-6.35,-0.55,3.20,8256,standing (0x2040),"
    "1028,0,0,0.125,1,1.2"
)


def table(path: Path) -> list[dict[str, str]]:
    """The rows of the file."""
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def sidecar(path: Path) -> dict[str, Any]:
    return dict(json.loads(Path(f"{path}.json").read_text(encoding="utf-8")))


# -- columns and texts ------------------------------------------------------------------------------------------------


def test_columns_are_those_of_the_dossier() -> None:
    columns = COLUMNS.replace(",", " ").split()
    assert RowLayout(raw=False).names == tuple(columns)
    raw = RowLayout(raw=True).names
    assert raw[: len(columns)] == tuple(columns)
    assert len(raw) == len(columns) + 27
    assert (raw[len(columns)], raw[-1]) == ("raw_00_torso_pitch", "raw_26_boot_time_low")


def test_the_row_of_the_dossiers_example(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    failure, _, _ = recorded(path, [(0.02, 5_000_001)], raw=True)
    assert failure is None
    lines = path.read_bytes().split(b"\r\n")
    assert lines[0].decode() == ",".join(RowLayout(raw=True).names)
    assert lines[2:] == [b""]
    fields = lines[1].decode().split(",")
    assert fields[1:7] == ["100.018000", "5000001", "0.000", "1", "1", "4.000"]
    assert ",".join(fields[7:33]) == STANDING_TEXTS
    assert fields[33] == ""
    assert fields[34:] == [str(word) for word in STANDING]


@pytest.mark.parametrize("param", {(q.signed, q.decimals): q for q in DATA}.values(), ids=lambda q: q.name)
def test_every_word_of_every_type_comes_back_from_its_text(param: Any) -> None:
    seen = set()
    for word in range(0x10000):
        text = text_of(param, param.raw_of(word))
        assert parse(param, text) & 0xFFFF == word
        seen.add(text)
    assert len(seen) == 0x10000


@each_row(
    ("name", "text"),
    [
        ("torso_pitch", t)
        for t in ("-0.00", "1.5", "1.500", "327.68", "-327.69", "01.00", "nan", "", "1e2", "١.00", "1_0.00")
    ]
    + [("min_state", t) for t in ("-1", "65536", "1.0", "+1", " 1", "0x1")],
)
def test_no_other_spelling_is_taken(name: str, text: str) -> None:
    (param,) = [q for q in DATA if q.name == name]
    with pytest.raises(ValueError):
        parse(param, text)


def test_settings_without_the_wearer() -> None:
    def row_of(words: list[int], *, personal: bool) -> dict[str, Any]:
        unit = Unit()
        unit.on = {GET_SETTINGS: lambda msg_id, _body: [(0.002, frame(GET_SETTINGS, msg_id, pack(words)))]}
        return EksoSource(ekso_on(unit), lambda: False, raw=False, personal=personal).settings()

    words = [*range(8), 0xFFB5, 9, *range(10, 22)]
    row = row_of(words, personal=False)
    assert list(row) == [q.name for q in SETTINGS if q.name != "pilot_id"]
    assert row["forward_shift"] == {"raw": -75, "value": -0.75, "unit": None, "label": None}
    assert row["step_length"] == {"raw": 2, "value": 0.02, "unit": "in", "label": None}
    assert row_of(words, personal=True)["pilot_id"]["raw"] == 19
    other = row_of([*words[:20], 99, 21], personal=False)
    assert changed(row, other) == ["sit_mode"]


def test_marks_are_one_line() -> None:
    assert clean(" heel\r\nstrike\x00\x1b[2J\t2 ") == "heel strike [2J 2"


# -- time -------------------------------------------------------------------------------------------------------------


def places(timeline: Timeline, *points: tuple[int | None, float]) -> list[tuple[int, int, bool | None, int]]:
    found = []
    for boot, mono in points:
        place = timeline.place(boot, Moment(mono, mono))
        timeline.count(place)
        found.append((place.t_ms, place.segment, place.rebooted, place.gap_ms))
    return found


def test_time_is_the_devices() -> None:
    assert places(Timeline(), (5001, 7.0), (5023, 7.05), (5055, 7.06)) == [
        (0, 1, False, 0), (22, 1, False, 0), (54, 1, False, 0),
    ]  # fmt: skip


def test_a_lower_boot_time_is_a_reboot_and_the_host_says_how_long_it_took() -> None:
    line = Timeline(usual_ms=USUAL_MS)
    assert places(line, (5001, 7.0), (5021, 7.02), (301, 47.02), (321, 47.04)) == [
        (0, 1, False, 0), (20, 1, False, 0), (40_020, 2, True, 40_000), (40_040, 2, False, 0),
    ]  # fmt: skip
    assert [(s.number, s.first_row, s.rows, s.first.boot_ms, s.last.boot_ms) for s in line.segments] == [
        (1, 1, 2, 5001, 5021), (2, 3, 2, 301, 321),
    ]  # fmt: skip


def test_a_reboot_is_seen_although_boot_time_is_higher() -> None:
    """The device ran for 1 s, was off, and has run for 3 s since: the host clock went on by 30 s."""
    assert places(Timeline(usual_ms=USUAL_MS), (1001, 0.0), (3001, 30.0))[1] == (30_000, 2, True, 30_000)


def test_the_wrap_of_boot_time_is_no_reboot() -> None:
    top = (1 << 32) - 11
    assert places(Timeline(), (top, 0.0), (9, 0.02)) == [(0, 1, False, 0), (20, 1, False, 0)]


def test_what_a_restart_cannot_have_counted_is_no_proof_of_one() -> None:
    """It fell back, and yet counts 20 s although 20 ms have passed: another device, or its clock was set."""
    top = (1 << 32) - 11
    assert places(Timeline(), (top, 0.0), (20_001, 0.02))[1] == (20, 2, None, 0)
    assert places(Timeline(), (9001, 0.0), (61, 0.02))[1] == (20, 2, True, 0)


FAR = 7_000_001
"""BootTime of a device that has run for long: no restart explains it."""


@each_row(
    ("boot", "seconds", "why", "off_ms"),
    [
        (FAR + 1300, 1.3, (), 0), (FAR + 1350, 1.3, (), 0), (FAR + 1250, 1.3, (), 0),
        (FAR + 1351, 1.3, ("clocks",), 51), (FAR + 1249, 1.3, ("clocks",), -51),
        (FAR + 700_000, 1.3, ("clocks",), 698_700), (FAR - 2, 0.02, ("clocks",), -22), (1251, 1.3, ("restart",), 1251 - FAR - 1300),
    ],
)  # fmt: skip
def test_more_than_50_ms_between_the_clocks_begins_a_segment(
    boot: int, seconds: float, why: tuple[str, ...], off_ms: int
) -> None:
    line = Timeline()
    line.count(line.place(FAR, Moment(5.0, 5.0)))
    place = line.place(boot, Moment(5.0 + seconds, 5.0 + seconds))
    assert (place.why, place.off_ms) == (why, off_ms)
    assert place.t_ms == (boot - FAR if not why else round(seconds * 1000)), "then the host's clock tells the time"


@each_row("ppm", [50_000, -50_000])
def test_a_drift_parts_them_as_well(ppm: int) -> None:
    """1 ms in 20: a segment of 50 ms of it, and the whole is as long as the host says."""
    line = Timeline()
    places(line, *((FAR + round(i * 20 * (1 + ppm / 1e6)), i * 0.02) for i in range(501)))
    assert len(line.segments) == 10 and all(50 <= segment.rows <= 52 for segment in line.segments[:-1])
    assert {segment.rebooted for segment in line.segments} == {False}
    assert abs(line.t_s - 10.0) <= WITHIN_MS / 1000


@each_row(("before", "now"), [(1.0, 0.0), (0.0, 1.0)])
def test_the_round_trip_of_either_row_is_no_contradiction(before: float, now: float) -> None:
    """BootTime was read at any moment of a round trip, of this row or of one before it in the segment."""
    for boot, parted in (
        (FAR + 100, False),
        (FAR + 50, False),
        (FAR + 1150, False),
        (FAR + 49, True),
        (FAR + 1151, True),
    ):
        line = Timeline()
        line.count(line.place(FAR, Moment(5.0, 5.0 + before)))
        sent = 5.0 + before + 0.1
        assert bool(line.place(boot, Moment(sent, sent + now)).why) is parted, boot


def test_a_slow_answer_is_no_reboot() -> None:
    """The process was stopped between request and answer: the middle of both says little."""
    line = Timeline()
    line.count(line.place(1001, Moment(0.0, 0.0)))
    assert line.place(1021, Moment(0.0, 60.0)).why == ()
    assert line.place(1021, Moment(30.0, 30.01)).rebooted


def test_a_clock_that_stands_leaves_the_time_to_the_host() -> None:
    line = Timeline()
    places(line, *((FAR, i * 0.02) for i in range(501)))
    assert abs(line.t_s - 10.0) <= 0.06 and line.standstill > 300
    assert {segment.rebooted for segment in line.segments} == {False}


@each_row("speed", [0.0, 0.5, 0.9, 1.0, 1.1])
def test_the_rate_is_that_of_the_host_s_clock(speed: float) -> None:
    """Also where the device's clock stands still or runs wrong; what lies between two rows at a standstill is no gap."""
    line = Timeline(usual_ms=USUAL_MS)
    places(line, *((FAR + int(i * 25 * speed), i * 0.025) for i in range(201)))
    assert (line.rate_hz(), line.gaps) == (40.0, [])
    assert (line.interval_row() or {})["median"] == pytest.approx(25 * speed or 25, abs=1)


def test_a_clock_that_never_agrees_is_not_asked_for_ever() -> None:
    """Neither memory nor sidecar grow with a log of such a device; its time is the host's."""
    line = Timeline()
    places(line, *((FAR + i * 5000, i * 0.02) for i in range(3000)))
    assert (len(line.segments), line.unfit, line.segments[-1].fit.as_row()) == (MOST_PARTED + 1, True, None)
    assert line.t_s == 59.98 and line.rate_hz() == 50.0


def test_rounding_adds_up_to_nothing() -> None:
    """A third of a millisecond a row, over an hour."""
    line = Timeline()
    places(line, *((None, i / 60) for i in range(60 * 600)))
    assert line.t_s == round((60 * 600 - 1) / 60, 3)


def test_counters_that_fell_show_a_restart() -> None:
    line = Timeline()
    places(line, (FAR, 5.0), (FAR + 20, 5.02), (FAR + 90_000, 5.04))
    assert [segment.rebooted for segment in line.segments] == [False, False]
    line.restarted()
    assert [segment.rebooted for segment in line.segments] == [False, True], "the one that has just begun"
    places(line, (FAR + 90_020, 5.06))
    line.restarted()
    assert places(line, (FAR + 90_040, 5.08))[0][1:3] == (3, True), "or the next row"
    assert line.reboots == 2


def test_a_device_without_a_clock_has_the_host_s() -> None:
    line = Timeline()
    for at, lost in ((5.0, False), (5.1, False), (5.2, False), (5.3, False), (8.3, True), (8.7, False)):
        line.count(line.place(None, Moment(at, at + 0.01), reopened=lost))
    assert [(segment.first.why, segment.rows, segment.rebooted) for segment in line.segments] == [
        ((), 4, False), (("port-lost",), 2, None),
    ]  # fmt: skip
    assert (line.t_s, [hole.length_ms for hole in line.holes], [gap.length_ms for gap in line.gaps]) == (
        3.7,
        [3000],
        [3000, 400],
    )
    assert line.rate_hz() == 10.0


def test_a_gap_is_more_than_three_periods() -> None:
    first = int(3 * USUAL_MS)
    assert [p[3] for p in places(Timeline(usual_ms=USUAL_MS), (1, 0.0), (1 + first, 0.06), (2 + 2 * first, 0.121))] == [
        0,
        0,
        first + 1,
    ]
    line = Timeline()
    places(line, *((i * 10, i / 100) for i in range(LEARNED + 1)))
    assert line.period_ms == 10
    assert line.place(LEARNED * 10 + 30, Moment(0.23, 0.23)).gap_ms == 0
    assert line.place(LEARNED * 10 + 31, Moment(0.231, 0.231)).gap_ms == 31
    slow = Timeline(period_ms=200, usual_ms=USUAL_MS)
    assert [p[3] for p in places(slow, (1, 0.0), (601, 0.6), (1202, 1.201))] == [0, 0, 601]


def test_true_rate_counts_recorded_time_only() -> None:
    line = Timeline(usual_ms=USUAL_MS)
    places(line, *((i * 20, i / 50) for i in range(201)), (94_000, 94.0), (94_020, 94.02), (5, 200.0), (25, 200.02))
    assert line.rate_hz() == 50.0
    assert line.interval_row() == {"median": 20, "p99": 20, "max": 90_000}
    assert [tuple(gap) for gap in line.gaps] == [(94_000, 90_000), (5, 105_980)]


def test_a_frozen_boot_time_is_counted() -> None:
    line = Timeline()
    places(line, (7, 0.0), (7, 0.02), (7, 0.04), (9, 0.06))
    assert line.standstill == 2


def test_the_clock_fit_finds_offset_and_drift() -> None:
    fit = ClockFit()
    for i in range(1000):
        fit.add(i / 50, 0.5 + i / 50 * 1.0001)
    assert fit.as_row() == {"a_s": 0.5, "b": 1.0001, "residual_ms": 0.0}
    assert ClockFit().as_row() is None


def test_the_residual_of_the_clock_fit_is_in_milliseconds() -> None:
    fit = ClockFit()
    for x, off in ((0.0, 0.001), (1.0, -0.001), (2.0, -0.001), (3.0, 0.001)):
        fit.add(x, x + off)
    assert fit.as_row() == {"a_s": 0.0, "b": 1.0, "residual_ms": 1.0}


@given(st.lists(st.tuples(st.integers(0, 0xFFFFFFFF), st.floats(0, 1e5)), min_size=1, max_size=30))
def test_time_never_falls_within_a_segment_and_segments_count_up(points: list[tuple[int, float]]) -> None:
    line = Timeline()
    found = places(line, *points)
    assert all((a[0] <= b[0] and b[2] is False) if a[1] == b[1] else a[1] + 1 == b[1] for a, b in pairwise(found))
    assert sum(segment.rows for segment in line.segments) == len(points)


# -- the loop ---------------------------------------------------------------------------------------------------------


def test_sidecar_at_the_start_and_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    device = Device(steady(1))
    recording = opened(path, device, simulated=True)
    early = sidecar(path)
    assert (early["schema"], early["complete"], early["rows"], early["simulated"]) == (
        "handctl-ekso-log/1", False, None, True,
    )  # fmt: skip
    recording.add(device.sample(), 1)
    recording.finish("limit")
    late = sidecar(path)
    assert (late["complete"], late["rows"], late["ended"]) == (True, 1, "limit")
    assert late["start"]["boot_ms"] == 1001
    assert late["columns"][0] == {
        "column": "torso_pitch_deg", "name": "torso_pitch", "word": 0, "unit": "deg", "type": "s16/100",
    }  # fmt: skip
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "a.csv.json"]


LOST = LinkError("gone", code="lost")
ENDS: dict[str, tuple[list[tuple[float, int | BaseException]], Limits, list[str]]] = {
    # what happens -> the script, when it ends, what is missing
    "as asked": (steady(5), Limits(rows=5), []),
    "Ctrl-C": ([*steady(5), (0.0, KeyboardInterrupt())], Limits(), []),
    "a restart": ([*steady(3), *steady(2, 1)], Limits(rows=5), []),
    "an answer that never came": ([*steady(3), (0.5, NoAnswer("x")), (0.02, 1581)], Limits(rows=4), ["lost"]),
    "silence": ([*steady(3), *[(3.0, NoAnswer("x"))] * 3], Limits(silence=5), ["lost", "no-answer"]),
    "silence until the end": ([*steady(3), *[(0.5, NoAnswer("x"))] * 3], Limits(duration=1.5), ["lost", "no-answer"]),
    "damage until the end": ([*steady(3), *[(0.5, ProtocolError("x"))] * 3], Limits(duration=1.5), ["lost", "bad-answer"]),
    "a port that did not come back": ([*steady(3), (0.0, LOST)], Limits(), ["lost"]),
    "a deadline": ([*steady(3), (0.0, NoAnswer("x", code="deadline"))], Limits(), ["deadline"]),
    "a full disk": ([*steady(3), (0.0, OutputError("full", code="log-file"))], Limits(), ["log-file"]),
}  # fmt: skip


@each_row("name", ENDS)
def test_a_whole_log_is_complete_and_no_other(name: str, tmp_path: Path) -> None:
    script, limits, missing = ENDS[name]
    path = tmp_path / f"{name}.csv"
    recorded(path, script, limits=limits)
    about = sidecar(path)
    assert (about["complete"], about["closed"], about["missing"]) == (not missing, True, missing)
    assert about["rows"] == len(table(path))


@each_row(("code", "missing"), [(errno.EIO, ["not-synced", "log-file"]), (errno.EINVAL, ["not-synced"])])
def test_what_is_not_on_the_disk_is_not_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, missing: list[str]
) -> None:
    """A disk that fails, or a file system that cannot tell; the sidecar is written all the same."""
    path, fsync, failed = tmp_path / "a.csv", os.fsync, list[int]()
    recording = opened(path, Device(steady(3)))
    assert Loop(recording, Limits(rows=3), list, Prompts(), {}).run() is None

    def fails(file: int) -> None:
        if not failed:
            failed.append(file)
            raise OSError(code, os.strerror(code))
        fsync(file)

    monkeypatch.setattr(os, "fsync", fails)
    with nullcontext() if code == errno.EINVAL else pytest.raises(OutputError):
        recording.finish("limit")
    assert (sidecar(path)["complete"], sidecar(path)["missing"]) == (False, missing)


def test_every_row_is_in_the_file_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    device = Device(steady(3))
    recording = opened(path, device)
    for seq in (1, 2, 3):
        recording.add(device.sample(), seq)
        assert len(table(path)) == seq
    recording.close()


def test_lost_requests_leave_holes_and_a_gap(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    script = [*steady(3), (1.5, NoAnswer("x")), (1.5, ProtocolError("y")), (0.02, 4161), (0.02, 4181)]
    failure, recording, _ = recorded(path, script)
    assert failure is None
    assert [(row["seq"], row["mark"]) for row in table(path)] == [
        ("1", ""), ("2", ""), ("3", ""), ("6", "[gap 3.120 s]"), ("7", ""),
    ]  # fmt: skip
    assert (recording.lost, sidecar(path)["gaps"]) == (2, [[4161, 3120]])
    assert recording.as_row()["gaps"] == 1


@each_row("boot", [65_521, 65_530, 131_066, 6_553_593])
@each_row("rows", [1, 3])
def test_a_clock_whose_two_words_do_not_belong_together_is_no_restart(tmp_path: Path, boot: int, rows: int) -> None:
    """Right behind a carry the high word is old for some rows: 65.536 s back, and forth again."""
    times = [boot - 100 + 20 * n for n in range(40)]
    carry = next(n for n, one in enumerate(times) if one >> 16 != times[0] >> 16)
    torn = [one - 65_536 * (carry <= n < carry + rows) for n, one in enumerate(times)]
    failure, recording, _ = recorded(tmp_path / "a.csv", [(0.02, one) for one in torn])
    about = sidecar(tmp_path / "a.csv")
    assert failure is None and recording.timeline.reboots == 0
    assert [segment["rebooted"] for segment in about["segments"]] == [False, False, False]
    assert [segment["why"] for segment in about["segments"]] == [[], ["clocks"], ["clocks"]]
    assert about["duration_s"] == pytest.approx(0.78, abs=0.06)


def test_a_restart_is_one_at_any_time_but_that() -> None:
    for boot, wanted in ((5_000, True), (65_536 + 500, True), (65_536 + 5, None)):
        line = Timeline()
        for n in range(3):
            line.count(line.place(boot - 40 + 20 * n, Moment(0.02 * n, 0.02 * n + 0.004)))
        assert line.place(11, Moment(0.06, 0.064)).rebooted is wanted, boot


@each_row(
    "seconds, code",
    [(0.3, None), (1.5, 4)],
)
def test_a_device_that_is_silent_until_the_end_leaves_a_gap_there(
    tmp_path: Path, seconds: float, code: int | None
) -> None:
    """Also the time behind the last row is told; a second of it is no log that ended as asked."""
    path = tmp_path / "a.csv"
    script = [*steady(LEARNED + 2), *[(0.025, NoAnswer("nothing"))] * 200]
    start = 0.02 * (LEARNED + 2)
    failure, recording, _ = recorded(path, script, limits=Limits(duration=start + seconds))
    assert (failure.exit_code if failure is not None else None) == code
    about = sidecar(path)
    gaps = [length for _, length in about["gaps"]]
    assert (len(gaps), recording.as_row()["gaps"]) == ((1, 1))
    assert all(length == pytest.approx(seconds * 1000, abs=100) for length in gaps)
    assert (about["complete"], about["ended"]) == (False, "limit" if code is None else "no-answer")
    assert about["duration_s"] == pytest.approx(start - 0.02, abs=0.03), "rows end where they end"


def test_a_log_without_a_row_is_a_failure(tmp_path: Path) -> None:
    failure, recording, _ = recorded(tmp_path / "a.csv", [(0.5, NoAnswer("x"))] * 9, limits=Limits(duration=2))
    assert isinstance(failure, NoAnswer) and recording.rows == 0


def test_ctrl_c_in_silence_leaves_a_gap_at_the_end(tmp_path: Path) -> None:
    script = [*steady(3), (2.0, NoAnswer("x")), (0.0, KeyboardInterrupt())]
    failure, _, _ = recorded(tmp_path / "a.csv", script, limits=Limits())
    assert isinstance(failure, Interrupted)
    assert [length for _, length in sidecar(tmp_path / "a.csv")["gaps"]] == [2050]


def test_silence_ends_a_log_but_not_at_once(tmp_path: Path) -> None:
    script = [*steady(2), *[(1.5, NoAnswer("nothing"))] * 40]
    failure, recording, device = recorded(tmp_path / "a.csv", script, limits=Limits(silence=6))
    assert isinstance(failure, NoAnswer)
    assert (recording.rows, recording.lost) == (2, 4)
    assert len(device.script) == 36


@each_row("error", [LinkError("gone"), NoAnswer("over", code="deadline")])
def test_a_lost_link_and_a_deadline_end_it_at_once(tmp_path: Path, error: HandctlError) -> None:
    failure, recording, _ = recorded(tmp_path / "a.csv", [*steady(2), (0.0, error)], limits=Limits())
    assert failure is error
    assert (recording.rows, recording.lost) == (2, 0), "what was not sent is not lost"


def gone(seconds: float, restarts: bool, device: Device) -> Callable[[], bool]:
    """A port that is gone for so long from the first look."""
    back: list[float] = []

    def reopen() -> bool:
        if not back:
            back.append(device.clock + seconds)
        if device.clock < back[0]:
            raise LinkError("no such port", code="not-found")
        device.script = [(0.02, 101 if restarts else 1001 + round((device.clock - 100) * 1000)), *steady(1, 90_001)]
        back.clear()
        return True

    return reopen


@each_row("restarts", [False, True])
def test_a_lost_port_that_comes_back_is_a_hole_and_a_segment(tmp_path: Path, restarts: bool) -> None:
    path = tmp_path / "a.csv"
    device = Device([*steady(3), (0.0, LinkError("the port is gone", code="lost"))])
    recording = opened(path, device)
    device.again = gone(1.95, restarts, device)
    failure = run(recording, Limits(rows=4, silence=5))
    recording.finish("limit")
    assert (failure, recording.rows, device.asked, recording.lost) == (None, 4, 1, 1)
    last = table(path)[-1]
    about = sidecar(path)
    (hole,) = about["holes"]
    assert (last["segment"], last["seq"]) == ("2", "5"), "the request that broke has a number, but no row"
    assert hole["row"] == 4 and hole["rebooted"] is restarts
    assert 1.95 <= hole["length_s"] <= 2.1
    assert float(last["t_s"]) == pytest.approx(0.04 + hole["length_s"])
    assert last["mark"] == f"[port lost]; {'[reboot]; ' * restarts}[gap {hole['length_s']:.3f} s]"
    assert [length for _, length in about["gaps"]] == [round(hole["length_s"] * 1000)]
    assert [segment["rows"] for segment in about["segments"]] == [3, 1]
    assert (about["rate_hz"], recording.timeline.reboots) == (50.0, int(restarts))


@each_row(
    ("limits", "when"),
    [(Limits(silence=5), "within the 5 s of --silence"), (Limits(duration=3), "the end of --duration")],
)
def test_a_port_that_stays_away_ends_the_log_in_time(tmp_path: Path, limits: Limits, when: str) -> None:
    path = tmp_path / "a.csv"
    device = Device([*steady(3), (0.0, LinkError("the port is gone", code="lost"))])
    recording = opened(path, device)
    device.again = gone(60, False, device)
    failure = run(recording, limits)
    recording.finish("limit")
    assert isinstance(failure, LinkError) and failure.code == "lost"
    assert when in failure.text and "no such port" in failure.text
    assert 100 + min(limits.silence + 0.06, limits.duration or 99) <= device.clock + 1e-6 <= 105.2
    assert len(table(path)) == 3
    assert sidecar(path)["holes"] == [{"row": None, "segment": None, "length_s": None, "rebooted": None}]


def test_ctrl_c_and_the_deadline_end_the_wait_for_a_port(tmp_path: Path) -> None:
    for number, end in enumerate((KeyboardInterrupt(), NoAnswer("over", code="deadline"))):
        looks = [LinkError("no such port", code="not-found"), end]

        def reopen(looks: list[BaseException] = looks) -> bool:
            raise looks.pop(0)

        failure, recording, _ = recorded(
            tmp_path / f"{number}.csv", [*steady(3), (0.0, LinkError("gone", code="lost"))],
            limits=Limits(), reopen=reopen,
        )  # fmt: skip
        assert isinstance(failure, Interrupted if number == 0 else NoAnswer)
        assert (recording.rows, len(table(tmp_path / f"{number}.csv"))) == (3, 3)


def test_whenever_ctrl_c_comes_a_port_that_was_closed_is_a_hole(tmp_path: Path) -> None:
    """Interrupted at each line of the wait in turn: the port is closed by the first call of `reopen`."""
    tried = 0
    for number in count():
        closed: list[bool] = []

        def reopen(closed: list[bool] = closed) -> bool:
            closed.append(True)
            raise LinkError("no such port", code="not-found")

        with interrupted_at("wait_for_port", number) as left:
            failure, recording, _ = recorded(
                tmp_path / f"{number}.csv", [*steady(3), (0.0, LinkError("gone", code="lost"))],
                limits=Limits(silence=0.2), reopen=reopen,
            )  # fmt: skip
        if not left:
            break
        tried += bool(closed)
        assert isinstance(failure, Interrupted)
        assert not closed or [hole.row for hole in recording.timeline.holes] == [None], number
    assert tried > 5


@contextlib.contextmanager
def interrupted_at(function: str, number: int) -> Iterator[list[int]]:
    """Raise KeyboardInterrupt at this line, in the order in which they are run, of a function. The list is filled once it was."""
    raised: list[int] = []
    lines = count()

    def lines_of(frame: FrameType, event: str, _: object) -> Any:
        if event == "line" and not raised and next(lines) == number:
            raised.append(frame.f_lineno)
            raise KeyboardInterrupt
        return lines_of

    before = sys.gettrace()
    sys.settrace(lambda frame, _event, _arg: lines_of if frame.f_code.co_name == function else None)
    try:
        yield raised
    finally:
        sys.settrace(before)


def test_a_reboot_is_a_segment(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    script = [*steady(2), (1.5, NoAnswer("x")), (0.5, 301), (0.02, 321)]
    _, _, device = recorded(path, script)
    assert [(row["segment"], row["t_s"], row["mark"]) for row in table(path)] == [
        ("1", "0.000", ""), ("1", "0.020", ""), ("2", "2.070", "[reboot]; [gap 2.050 s]"), ("2", "2.090", ""),
    ]  # fmt: skip
    assert device.asked == 1, "what the restart may have changed is read"
    assert [(s["segment"], s["rows"], s["boot_ms"]) for s in sidecar(path)["segments"]] == [
        (1, 2, [1001, 1021]), (2, 2, [301, 321]),
    ]  # fmt: skip


def test_marks_stand_in_both_files_and_none_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    texts = iter(['start, "quoted"', "", "while lost", "k", ""])
    script = [*steady(2), (0.01, NoAnswer("x")), (0.01, 1061), (0.02, LinkError("gone"))]
    recorded(path, script, limits=Limits(), mark=lambda: next(texts))
    assert [row["mark"] for row in table(path)] == ['start, "quoted"', "", "while lost; k"]
    assert [(m["row"], m["boot_ms"], m["text"]) for m in sidecar(path)["marks"]] == [
        (1, 1001, 'start, "quoted"'), (3, 1061, "while lost; k"),
    ]  # fmt: skip
    texts = iter(["", "too late"])
    recorded(tmp_path / "b.csv", [*steady(1), (0, LinkError("gone"))], limits=Limits(), mark=lambda: next(texts))
    assert sidecar(tmp_path / "b.csv")["marks"] == [{"row": None, "boot_ms": 1001, "t_s": 0.0, "text": "too late"}]


def test_rate_paces_the_requests_and_never_hurries(tmp_path: Path) -> None:
    script = [(0.01, 1001), (0.01, 1101), (0.35, 1301), (0.01, 1551), (0.01, 1651)]
    _, recording, device = recorded(tmp_path / "a.csv", list(script), limits=Limits(rate=10, rows=5))
    assert device.asked_at == [100.0, 100.1, 100.2, 100.6, 100.7], "on the ticks: the late answer hurries nothing"
    assert (recording.rows, recording.skipped) == (5, 3)


def test_after_a_stall_no_tick_is_polled_twice(tmp_path: Path) -> None:
    """The machine slept in the middle of the third tick, and again for less than a tick."""

    class Stalls(Device):
        def __init__(self) -> None:
            super().__init__([])
            self.naps = [0.0, 0.0, 0.0753, 0.0, 0.012, 0.0]

        def sleep(self, seconds: float) -> None:
            super().sleep(seconds + (self.naps.pop(0) if self.naps and seconds > 0 else 0.0))

        def sample(self) -> Sample:
            self.asked_at.append(round(self.clock, 6))
            self.clock += 0.001
            boot = 1 + 2 * int(self.clock * 500)
            return Sample(Moment(self.clock - 0.001, self.clock), words_at(boot), boot)

    device = Stalls()
    recording = opened(tmp_path / "a.csv", device, rate=50)
    limits = Limits(rate=50, rows=8)
    assert run(recording, limits) is None
    recording.close()
    assert device.asked_at == [100.0, 100.02, 100.04, 100.14, 100.18, 100.2, 100.22, 100.24]
    assert (recording.skipped, recording.timeline.standstill) == (5, 0)
    boots = [int(row["boot_ms"]) for row in table(tmp_path / "a.csv")]
    assert all(later - earlier >= 18 for earlier, later in pairwise(boots))


@pytest.mark.parametrize(("answers_in", "skipped"), [(0.022, 9), (0.019, 0)])
def test_a_device_somewhat_slower_than_the_rate_is_asked_as_it_answers(
    tmp_path: Path, answers_in: float, skipped: int
) -> None:
    class Slow(Device):
        def sample(self) -> Sample:
            sent = self.clock
            made = super().sample()
            return made._replace(moment=Moment(sent, made.moment.answered))

    device = Slow([(answers_in, 1001 + 2 * i) for i in range(50)])
    recording = opened(tmp_path / "a.csv", device, rate=50)
    limits = Limits(rate=50, rows=50)
    run(recording, limits)
    recording.close()
    ticks = [round((moment - 100.0) * 50 - 0.499) for moment in device.asked_at]
    assert len(set(ticks)) == 50, "never two in one tick"
    assert recording.skipped == skipped
    assert device.clock - 100.0 < 50 * answers_in * 1.1


def test_feedback_is_asked_once_a_second_and_only_changes_are_kept(tmp_path: Path) -> None:
    steps = iter([7, 7, 8, 9])
    asked: list[float] = []

    def feedback() -> tuple[int, ...]:
        asked.append(round(device.clock, 3))
        return (next(steps), 40, 30, *range(100, 112), 0, 1001 + round((device.clock - 100.02) * 1000))

    path = tmp_path / "a.csv"
    device = Device(steady(160))
    recording = opened(path, device, rate=50)
    limits = Limits(rows=160)
    device.feedback = feedback
    run(recording, limits)
    recording.finish("limit")
    assert asked == pytest.approx([100.02, 101.03, 102.05, 103.06], abs=0.025)
    kept = sidecar(path)["feedback"]
    assert (kept["answered"], kept["unanswered"]) == (4, 0)
    assert kept["words"][11] == {"name": "left_step_length", "word": 11, "unit": "in", "type": "s16/10"}
    first, *later = kept["timeline"]
    assert len(first["changed"]) == 15
    assert (first["changed"]["steps_taken"], first["changed"]["left_step_length"]) == (7, 10.8)
    assert [entry["changed"] for entry in later] == [{"steps_taken": 8}, {"steps_taken": 9}]
    for entry in later:
        assert (entry["segment"], entry["t_s"]) == (1, (entry["boot_ms"] - 1001) / 1000)
        assert 0 <= entry["t_s"] - float(table(path)[entry["row"] - 1]["t_s"]) <= 0.02


def test_a_feedback_without_an_answer_costs_no_row_and_rests(tmp_path: Path) -> None:
    asked: list[float] = []

    def feedback() -> tuple[int, ...]:
        asked.append(round(device.clock))
        raise NoAnswer("nothing")

    device = Device(steady(600))
    recording = opened(tmp_path / "a.csv", device)
    limits = Limits(rows=600)
    device.feedback = feedback
    failure = run(recording, limits)
    recording.close()
    assert (failure, recording.rows, recording.lost, device.line.unanswered) == (None, 600, 0, 2)
    assert asked == [100, 110]


def test_duration_ends_it(tmp_path: Path) -> None:
    _, recording, device = recorded(tmp_path / "a.csv", steady(200), limits=Limits(duration=0.99))
    assert (recording.rows, round(device.clock, 6)) == (50, 101.0)
    _, recording, device = recorded(tmp_path / "b.csv", steady(200), limits=Limits(duration=1.0, rate=2))
    assert (recording.rows, round(device.clock, 6)) == (2, 101.0)


# -- whole rows, whatever happens -------------------------------------------------------------------------------------


def test_ctrl_c_leaves_whole_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    failure, recording, _ = recorded(path, [*steady(3), (0.0, KeyboardInterrupt())], limits=Limits())
    assert isinstance(failure, Interrupted)
    assert recording.rows == len(table(path)) == 3


@each_row("where", ["ask_ahead", "made", "line", "on_row"])
def test_ctrl_c_behind_an_answer_leaves_its_row_once(tmp_path: Path, where: str) -> None:
    device = Device(steady(9))
    recording = opened(tmp_path / "a.csv", device)
    of: Any = {"ask_ahead": device, "made": device, "line": device.layout, "on_row": recording}[where]
    usual, calls = getattr(of, where), iter(range(9))

    def interrupted(*args: Any) -> Any:
        if next(calls) == 2:
            raise KeyboardInterrupt
        return usual(*args) if usual else None

    setattr(of, where, interrupted)
    assert isinstance(run(recording, Limits()), Interrupted)
    assert [row["seq"] for row in table(tmp_path / "a.csv")] == ["1", "2", "3"] and recording.rows == 3


def test_a_signal_waits_for_the_row() -> None:
    def stop(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    steps = []
    old = signal.signal(signal.SIGTERM, stop)
    try:
        with pytest.raises(KeyboardInterrupt), without_interrupts():
            signal.raise_signal(signal.SIGTERM)
            steps.append("the row is written")
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) & {signal.SIGINT, signal.SIGTERM} == set()
    finally:
        signal.signal(signal.SIGTERM, old)
    assert steps == ["the row is written"]


def test_a_full_disk_takes_back_the_broken_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    device = Device(steady(100))
    recording = opened(path, device)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, hard))
    try:
        failure = run(recording, Limits())
        recording.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert isinstance(failure, OutputError)
    assert str(path) in failure.text
    data = path.read_bytes()
    assert data.endswith(b"\r\n")
    assert 2500 < len(data) <= 3000
    assert len(table(path)) == recording.rows == sum(s.rows for s in recording.timeline.segments) > 5


def test_a_disk_that_is_full_at_once_leaves_nothing(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OutputError, match="cannot be written"):
            opened(tmp_path / "a.csv", Device([]))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


@each_row("taken", ["a.csv", "a.csv.json"])
def test_an_existing_file_is_never_touched_without_force(tmp_path: Path, taken: str) -> None:
    (tmp_path / taken).write_text("mine")
    with pytest.raises(UsageError, match="exists"):
        opened(tmp_path / "a.csv", Device([]))
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [(taken, "mine")]
    opened(tmp_path / "a.csv", Device([]), force=True).close()
    assert table(tmp_path / "a.csv") == []


def test_a_file_that_cannot_be_made_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No such file or directory"):
        opened(tmp_path / "none" / "a.csv", Device([]))


def test_a_directory_gets_a_file_named_after_the_moment(tmp_path: Path) -> None:
    name = Path(file_name(str(tmp_path), "ekso"))
    assert name.parent == tmp_path
    assert name.match("ekso-2*T*Z.csv")
    assert file_name("gait.csv", "ekso") == "gait.csv"


# -- the next request goes out before the row is written ----------------------------------------------------------------


class Eager(Device):
    """Counts the rows of the file at each request that is sent ahead; the port is lost at the one numbered `lost`."""

    def __init__(self, path: Path, count: int, lost: int = 0) -> None:
        super().__init__(steady(count))
        self.path, self.lost = path, lost
        self.rows: list[int] = []

    def ask_ahead(self) -> None:
        self.rows.append(self.path.read_bytes().count(b"\n") - 1)
        if len(self.rows) == self.lost:
            raise LinkError("the port is gone", code="lost")


@each_row(
    ("limits", "rows"),
    [
        (Limits(rows=4), [0, 1, 2]),
        (Limits(rows=4, rate=50.0), []),
        (Limits(rows=4, over=lambda rows, seconds: False), []),
    ],
    ids=["free", "rate", "until"],
)
def test_the_line_works_while_a_row_is_written_and_nothing_is_asked_for_nobody(
    tmp_path: Path, limits: Limits, rows: list[int]
) -> None:
    path = tmp_path / "a.csv"
    device = Eager(path, 4)
    assert run(opened(path, device, rate=limits.rate), limits) is None
    assert (device.rows, len(table(path))) == (rows, 4)


def test_a_port_that_is_lost_by_then_costs_no_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    failure = run(opened(path, Eager(path, 5, lost=3)), Limits(rows=5))
    assert isinstance(failure, LinkError) and len(table(path)) == 3
