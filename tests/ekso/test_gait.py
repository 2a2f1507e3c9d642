"""Strides against walks whose every contact is known: each is found or refused rightly, each figure within one sample."""

from __future__ import annotations

import csv
import json
import shutil
from collections import Counter
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from statistics import mean

import pytest

from handctl.devices.ekso.gait import (
    ALONE,
    HOLE,
    KNEE,
    NO_END,
    ONE_SENSOR,
    SENSORS,
    SIDES,
    STANDING,
    Step,
    Walk,
    compared,
    curve,
    stretches,
    walk_in,
)
from handctl.devices.ekso.gait_page import Band, bands, histogram, timeline
from handctl.devices.ekso.log_reader import LogFile
from tests.ekso.recordings import recorded
from tests.ekso.walks import RATE, Made, Plan, walk
from tests.support.cli import run
from tests.support.each_row import each_row

UNEVEN = {"left_toe": 300.0, "left_heel": 350.0, "right_toe": 2700.0, "right_heel": 2500.0}
LIMP = Plan(stance={"left": 0.70, "right": 0.50}, late=0.40, vary=0.08)
STANDS = Plan(seconds=50, stands=((10.3, 16.3), (30.1, 38.1)))
WALKS = {
    "even": (Plan(), {}),
    "asymmetric": (Plan(stance={"left": 0.68, "right": 0.56}, late=0.44), {}),
    "limping": (LIMP, {}),
    "standing": (STANDS, {STANDING: 4}),
    "a long stand": (Plan(seconds=90, stands=((15.3, 65.3),)), {STANDING: 2}),
    "holes": (Plan(holes=((10.0, 10.2), (30.5, 31.5))), {HOLE: 4}),
    "offsets and gains": (Plan(offset={"left_toe": 180.0, "right_heel": 300.0}, gain=UNEVEN), {}),
    "a dead sensor": (Plan(dead=("left_toe",)), {}),
    "noise": (replace(LIMP, noise=12.0), {}),
    "drift by 30 %": (Plan(seconds=60).drifting(0.3), {}),
    "a limp that drifts": (Plan(seconds=60, stance={"left": 0.7, "right": 0.5}, late=0.4).drifting(0.3), {}),
    "stands that drift": (Plan(seconds=60, stands=((20.3, 40.3),), noise=6.0).drifting(0.3), {STANDING: 2}),
}


def found(plan: Plan) -> tuple[Made, Walk]:
    made = walk(plan)
    return made, walk_in(made.stretches)


@each_row("name", WALKS)
def test_each_stride_is_found_or_refused_rightly(name: str) -> None:
    plan, refused = WALKS[name]
    drifts = plan.drifting(0.3)
    for one in (plan, drifts, replace(plan, rate=2 * RATE), replace(drifts, rate=4 * RATE)):
        made, seen = found(one)
        if one.rate == RATE:  # at a higher one, a foot is seen to leave right before a hole
            assert Counter(step.refused for step in seen.steps if step.refused) == {**refused, NO_END: 2}
        judged_rightly(one, made, seen)
        within_one_sample(one, made, seen)


def judged_rightly(plan: Plan, made: Made, seen: Walk) -> None:
    """Each stride is found within one sample, and refused where it stood; nothing else counts.

    One whose next contact is within the last sample may count or not: noise decides whether the load shows.
    """
    late = 1 / plan.rate
    last = made.stretches[-1].t[-1] - late
    for side, contact, off, end in made.strides:
        if any(contact < until + 0.1 and begin < end for begin, until in plan.holes) or end > last:
            continue
        step = nearest(seen, side, contact)
        assert abs(step.contact - contact) <= late and abs(step.end - end) <= late, (side, contact, step)
        assert (side == "left" and plan.dead) or abs(step.off - off) <= late, (side, off, step)
        assert bool(step.refused) is any(contact <= begin < end for begin, _ in plan.stands), step
    for step in seen.taken:
        assert any(
            side == step.side and abs(step.contact - contact) <= late and abs(step.end - end) <= late
            for side, contact, _, end in made.strides
        ), step


def within_one_sample(plan: Plan, made: Made, seen: Walk) -> None:
    """The figures are those of the strides that count."""
    by = {(one.name, one.side): one.mean for one in seen.figures}
    for side in SIDES:
        counted = [step.contact for step in seen.taken if step.side == side]
        walked = [one for one in made.strides if one[0] == side and min(abs(one[1] - at) for at in counted) < 0.1]
        share = mean((off - contact) / (end - contact) for _, contact, off, end in walked)
        assert abs(by["stride_time", side] - mean(end - contact for _, contact, _, end in walked)) < 1 / plan.rate
        if not (side == "left" and plan.dead):
            assert abs(by["stance_share", side] - 100 * share) < 100 / plan.rate / plan.stride


def nearest(seen: Walk, side: str, contact: float) -> Step:
    return min((step for step in seen.steps if step.side == side), key=lambda step: abs(step.contact - contact))


@each_row(("plan", "left", "right"), [(Plan(), 0.62, 0.62), (LIMP, 0.70, 0.50)])
def test_figures_are_those_of_the_walk(plan: Plan, left: float, right: float) -> None:
    _, seen = found(plan)
    by = {(one.name, one.side): one for one in seen.figures}
    one_sample = 100 / RATE / 1.2
    assert abs(by["stride_time", "left"].mean - 1.2) < 1 / RATE
    assert abs(by["stance_share", "left"].mean - 100 * left) < one_sample
    assert abs(by["stance_share", "right"].mean - 100 * right) < one_sample
    assert abs(by["cadence", "both"].mean - 100) < 1.5
    assert (by["stance_share_asymmetry", "both"].mean > 20) is (left != right)
    assert (by["stride_variability", "both"].mean > 2) is bool(plan.vary)


def test_a_dead_sensor_is_named_and_its_strides_are_doubtful() -> None:
    _, seen = found(Plan(dead=("left_toe",)))
    assert seen.remarks == ["left_toe_pressure never changes: it is dead, or not connected"]
    assert {(step.side, step.doubt) for step in seen.taken} == {("left", ONE_SENSOR), ("right", "")}


@each_row(
    ("sensor", "drift", "what"),
    [("left_heel", 0.0, "never changes"), ("left_heel", 900.0, "only drifts"), ("left_toe", -600.0, "only drifts")],
)
def test_a_foot_with_one_sensor_has_stride_times_but_no_stance(sensor: str, drift: float, what: str) -> None:
    """A heel that is stuck at full: the toe comes down later, so neither contact nor stance is claimed."""
    plan = Plan(dead=(sensor,), offset={sensor: 900.0}, drift={sensor: drift})
    made, seen = found(plan)
    assert seen.remarks == [f"{sensor}_pressure {what}: it is dead, or not connected"]
    assert {(step.side, step.doubt) for step in seen.taken} == {("left", ONE_SENSOR), ("right", "")}
    assert sum(step.side == "left" for step in seen.taken) >= sum(side == "left" for side, *_ in made.strides) - 1
    by = {(one.name, one.side): one for one in seen.figures}
    assert abs(by["stride_time", "left"].mean - 1.2) < 1 / RATE and ("stance_share", "right") in by
    assert {("stance_share", "left"), ("swing_share", "left"), ("stance_share_asymmetry", "both")}.isdisjoint(by)


def test_a_heel_that_dies_on_the_way_makes_the_strides_behind_doubtful() -> None:
    made = walk(Plan())
    (stretch,) = made.stretches
    for place in range(stretch.at(20.0), len(stretch.t)):
        stretch.signals["left_heel"][place] = 20.0
    seen = walk_in(made.stretches)
    assert all((step.doubt == ONE_SENSOR) is (step.side == "left" and step.end > 20.0) for step in seen.taken)
    share = next(one for one in seen.figures if (one.name, one.side) == ("stance_share", "left"))
    assert abs(share.mean - 62) < 100 / RATE / 1.2 and share.strides < 20


@each_row("plan", [Plan(), Plan(noise=6.0), LIMP, Plan(seconds=90)])
def test_a_sensor_that_sticks_at_full_on_the_way_is_named_and_the_strides_behind_are_doubtful(plan: Plan) -> None:
    """Its foot would stand for the rest of the walk: the other sensor still has the strides."""
    made = walk(plan)
    (stretch,) = made.stretches
    before = walk_in(made.stretches)
    for sensor in (f"{side}_{name}" for side in SIDES for name in SENSORS):
        values = [*stretch.signals[sensor]]
        begin = next(row for row in range(stretch.at(20.0), len(values)) if values[row] > 700)
        values[begin:] = [values[begin]] * (len(values) - begin)
        seen = walk_in([stretch._replace(signals={**stretch.signals, sensor: values})])
        (remark,) = seen.remarks
        assert (
            remark == f"{sensor}_pressure never changes from {stretch.t[begin]:.1f} s on: it is dead, or not connected"
        )
        side, dies = sensor.partition("_")[0], stretch.t[begin]
        assert all((one.doubt == ONE_SENSOR) is (one.side == side and one.end > dies) for one in seen.taken)
        assert len(seen.taken) >= len(before.taken) - 2
        assert Counter(one.refused for one in seen.steps)[STANDING] <= 1


def test_a_sensor_that_is_stuck_at_full_in_a_later_segment_is_named_there() -> None:
    first, second = walk(Plan()), walk(Plan(dead=("left_heel",), offset={"left_heel": 920.0}))
    later = second.stretches[0]._replace(number=2)
    seen = walk_in([*first.stretches, later])
    assert seen.remarks == ["left_heel_pressure never changes from 0.0 s on: it is dead, or not connected"]
    assert {(one.segment, one.side, one.doubt) for one in seen.taken} == {
        (1, "left", ""), (1, "right", ""), (2, "left", ONE_SENSOR), (2, "right", ""),
    }  # fmt: skip


def test_a_sensor_that_sticks_at_full_while_nobody_walks_is_not_dead() -> None:
    """A wearer who stands until the end loads it just so."""
    made = walk(Plan(seconds=60, stands=((30.3, 58.0),), noise=0.5))
    (stretch,) = made.stretches
    for name in ("left_heel", "right_heel", "left_toe"):
        values = stretch.signals[name]
        assert isinstance(values, list)
        begin = stretch.at(32.0)
        values[begin:] = [900.0] * (len(values) - begin)
    assert walk_in(made.stretches).remarks == []


def test_a_contact_in_a_hole_is_none() -> None:
    """The foot is in the air before the hole and on the ground behind it."""
    _, seen = found(Plan(holes=((30.6, 31.5),)))
    assert [step.refused for step in seen.steps if step.side == "right" and 29 < step.contact < 32] == [HOLE, HOLE]


def test_a_foot_without_sensors_has_no_strides_and_the_other_keeps_its_own() -> None:
    made, seen = found(Plan(dead=("left_toe", "left_heel")))
    assert {step.side for step in seen.steps} == {"right"}
    assert len(seen.taken) == sum(side == "right" for side, *_ in made.strides)
    assert any("its steps are not known" in remark for remark in seen.remarks)


def test_drift_is_told_with_its_size() -> None:
    _, seen = found(Plan(seconds=120, drift={"right_heel": 300.0}))
    (remark,) = seen.remarks
    assert remark.startswith("right_heel_pressure has drifted by +2")


def test_a_knee_that_does_not_bend_is_the_second_witness() -> None:
    _, seen = found(Plan(stiff=("right",)))
    assert {(step.side, step.doubt) for step in seen.taken} == {("left", ""), ("right", KNEE)}


def test_a_foot_that_steps_twice_is_no_stride() -> None:
    made = walk(Plan(seconds=20))
    (stretch,) = made.stretches
    for name in ("left_toe", "left_heel"):  # the left foot stays up for one of its strides
        for place in range(stretch.at(7.0), stretch.at(9.3)):
            stretch.signals[name][place] = 20.0
    refused = {(step.side, step.refused) for step in walk_in(made.stretches).steps if step.refused not in ("", NO_END)}
    assert ("right", ALONE) in refused


def test_nobody_walks() -> None:
    _, seen = found(Plan(seconds=30, stands=((0.36, 29.0),)))
    assert seen.taken == []


def test_a_curve_begins_and_ends_with_the_contact() -> None:
    _, seen = found(Plan())
    knee = curve(seen, "left", "knee")
    assert len(knee) == 101 and max(range(101), key=lambda point: knee[point][0]) == pytest.approx(
        81, abs=2
    )  # mid-swing
    assert knee[30][0] == pytest.approx(5.0, abs=0.5) and max(deviation for _, deviation in knee) < 5


def test_a_difference_is_clear_only_beyond_its_interval() -> None:
    _, before = found(LIMP)
    _, again = found(Plan(stance=LIMP.stance, late=LIMP.late, vary=LIMP.vary, seed=5))
    _, after = found(Plan(stance={"left": 0.62, "right": 0.62}, vary=0.08))
    assert not any(one.clear for one in compared(before, again) if one.before.name == "stride_time")
    assert {one.before.side for one in compared(before, after) if one.before.name == "stance_share" and one.clear} == {
        "left",
        "right",
    }


@each_row(("seconds", "stride"), [(4, 1.2), (8, 1.2), (30, 1.2), (40, 3.4)])
def test_walks_that_differ_by_chance_alone_seldom_have_a_clear_change(seconds: float, stride: float) -> None:
    walks = [found(Plan(seconds=seconds, stride=stride, vary=0.06, seed=seed, rate=100))[1] for seed in range(1, 11)]
    pairs = list(combinations(walks, 2))
    clear = Counter(
        one.before.name for pair in pairs for one in compared(*pair) if one.clear and one.before.side == "both"
    )
    assert not clear or clear.most_common(1)[0][1] <= 0.12 * len(pairs), clear


def test_a_row_that_repeats_the_one_before_is_no_sample() -> None:
    """A device that measures 25 times a second and is asked 100 times: the error of a sample is that of 1/25 s."""
    made = walk(Plan(rate=25))
    (seen,) = made.stretches
    t = [seen.t[0] + number / 100 for number in range(4 * len(seen.t))]
    often = seen._replace(t=t, signals={name: [value for value in values for _ in range(4)] for name, values in seen.signals.items()})  # fmt: skip
    fine = {one.name: one.fine for one in walk_in([often]).figures if one.side == "left"}
    assert fine["stride_time"] == pytest.approx(1 / 25) and fine["stance_share"] == pytest.approx(
        200 / 25 / 1.2, rel=0.05
    )


def test_one_stride_says_nothing_of_the_next_one() -> None:
    _, before = found(Plan(seconds=2.6))
    _, after = found(Plan(seconds=3.0, stride=1.4))
    changes = {(one.before.name, one.before.side): one for one in compared(before, after)}
    assert changes["stride_time", "left"].after.strides == 1 and changes["stride_time", "left"].change > 0.1
    assert not any(one.clear for one in changes.values())
    assert changes["stride_time", "left"].error is None and changes["cadence", "both"].error is None


@each_row("stride", [2.6, 3.4, 4.0, 5.0, 8.0])
def test_a_slow_walk_is_no_drift(stride: float) -> None:
    for seconds in (30, 40, 45):
        assert found(Plan(seconds=seconds, stride=stride))[1].remarks == []


def test_a_timeline_of_hours_stays_small_and_keeps_each_refusal() -> None:
    spans = [(float(t), t + 1.0, "standing" if t % 1000 == 7 else "") for t in range(7200)]
    text = timeline("a walk", [("left", spans)], ["standing"], 0, 7200)
    assert text.count("<title>standing") == 8 and len(text) < 20_000


def test_a_histogram_counts_each_value_once() -> None:
    text = histogram("Stride time", "s", [("left", [1.0, 1.0, 1.03, 1.5]), ("right", [])], 0.02)
    assert sorted(found.split(" ")[0] for found in text.split("<title>")[1:]) == ["1", "1", "2"]
    assert ">0.98<" in text and ">1.08<" in text, "bins begin at round values"
    one = histogram("Stride time", "s", [("left", [3.004, 2.996, 3.004])], 0.02)
    assert (
        "2 from 3.000 s" in one
        and "1 from 2.980 s" in one
        and all(f">{edge}<" in one for edge in ("2.96", "2.98", "3.00", "3.02"))
    )
    assert histogram("Stride time", "s", [("left", [])], 0.02) == bands("Knee", [Band("left", [])]) == ""


# -- as a command -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made once, because a recorded walk takes its time."""
    path = tmp_path_factory.mktemp("walk") / "walk.csv"
    assert run("ekso", "log", path, "--duration", "15", "-p", "fake://ekso?clock=virtual&posture=walking").code == 0
    return path


@pytest.fixture
def log(tmp_path: Path, walked: Path) -> Path:
    shutil.copytree(walked.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / walked.name


def test_the_command_lists_every_stride(log: Path) -> None:
    done = run("ekso", "gait", log, "--steps", log.with_name("steps.csv"), "--json")
    assert done.code == 0, done
    rows = {(row["name"], row["side"]): row["value"] for row in done.rows if "not counted" not in row["unit"]}
    assert rows["stride_time", "left"] == rows["stride_time", "right"] == 3.0 and rows["cadence", "both"] == 40.0
    steps = list(csv.DictReader(log.with_name("steps.csv").open(encoding="utf-8")))
    assert Counter(step["verdict"] for step in steps)["counted"] == rows["strides", "both"] == 8
    assert "simulated" in done.codes()


def test_a_log_that_is_not_whole_is_told(log: Path) -> None:
    """Killed, with its last row cut: with its sidecar or without it."""
    about = Path(f"{log}.json")
    about.write_text(about.read_text().replace('"closed": true', '"closed": false'))
    log.write_bytes(log.read_bytes()[:-20])
    for _ in range(2):
        done = run("ekso", "gait", log, "--json")
        assert (done.code, done.codes().count("log")) == (0, 1), done
        assert "Its last row was unfinished and was skipped" in done.out
        about.unlink(missing_ok=True)


def test_the_page_has_the_curves_the_figures_and_every_refusal(log: Path) -> None:
    page = log.with_name("gait.html")
    done = run("ekso", "gait", log, "--page", page, "--json")
    text = page.read_text(encoding="utf-8")
    assert done.code == 0 and text.count("<figure>") == 5 and text.count("<polygon") == 8
    assert "not a diagnosis" in text and "Simulated" in text and "<script" not in text
    assert "incomplete" not in text
    reasons = [row for row in done.rows if row["unit"].startswith("not counted: ")]
    assert reasons and all(row["unit"].removeprefix("not counted: ") in text for row in reasons)
    assert "<td>step_length</td><td>14.75 in</td>" in text
    assert json.loads(Path(f"{log}.json").read_text())["start"]["utc"] in text


def test_the_page_says_what_is_not_whole_and_not_where_the_log_is(log: Path) -> None:
    about, page = Path(f"{log}.json"), log.with_name("gait.html")
    about.write_text(about.read_text().replace('"missing": []', '"missing": ["lost"]'))
    assert run("ekso", "gait", log, log, "--page", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert "after: walk.csv is incomplete: lost" in text and str(log.parent) not in text


def test_the_page_of_two_logs_has_both_and_the_settings_that_differ(log: Path) -> None:
    content = json.loads(Path(f"{log}.json").read_text())
    later = log.with_name("later.csv")
    later.write_bytes(log.read_bytes())
    content["settings_before"]["step_length"] |= {"raw": 1600, "value": 16.0}
    Path(f"{later}.json").write_text(json.dumps(content))
    page = log.with_name("gait.html")
    assert run("ekso", "gait", log, later, "--page", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert text.count("<figure>") == 10 and text.count("<td>differs</td>") == 1 and "<h3>after</h3>" in text


def test_two_logs_show_what_was_set_in_between(log: Path) -> None:
    sidecar = Path(f"{log}.json")
    later = log.with_name("later.csv")
    later.write_bytes(log.read_bytes())
    content = json.loads(sidecar.read_text())
    content["settings_before"]["step_length"] |= {"raw": 1600, "value": 16.0}
    Path(f"{later}.json").write_text(json.dumps({**content, "file": "later.csv"}))
    done = run("ekso", "gait", log, later, "--json")
    assert done.code == 0 and done.rows[0] == {"name": "setting: step_length", "before": 14.75, "after": 16.0}
    assert {row["clear"] for row in done.rows[1:]} == {"no"}


@each_row(("content", "code"), [("", 2), ("a,b\n1,2\n", 2), (None, 2)])
def test_what_is_no_log_is_refused(tmp_path: Path, content: str | None, code: int) -> None:
    path = tmp_path / "x.csv"
    if content is not None:
        path.write_text(content)
    done = run("ekso", "gait", path)
    assert done.code == code and "Traceback" not in done.err


def test_a_log_without_a_walk_is_exit_7(tmp_path: Path) -> None:
    path = tmp_path / "still.csv"
    assert run("ekso", "log", path, "--duration", "5", "-p", "fake://ekso?clock=virtual").code == 0
    done = run("ekso", "gait", path, "--json")
    assert (done.code, done.error["code"]) == (7, "no-stride")


def test_strides_are_listed_where_none_counts(tmp_path: Path) -> None:
    path, steps = tmp_path / "short.csv", tmp_path / "steps.csv"
    assert run("ekso", "log", path, "--duration", "3", "-p", "fake://ekso?clock=virtual&posture=walking").code == 0
    done = run("ekso", "gait", path, "--steps", steps, "--json")
    assert (done.code, done.error["code"]) == (7, "no-stride")
    with steps.open(encoding="utf-8", newline="") as file:
        verdicts = [row["verdict"] for row in csv.DictReader(file)]
    assert verdicts and "counted" not in verdicts


def test_what_the_recorder_calls_no_gap_is_none_for_gait(tmp_path: Path) -> None:
    """An interval of just three periods: in seconds it is a little more, or a little less."""
    path = tmp_path / "even.csv"
    steps = [66 if number > 30 and number % 9 == 8 else 22 for number in range(300)]
    recorded(path, [(step / 1000, 1001 + sum(steps[: at + 1])) for at, step in enumerate(steps)])
    rows = list(csv.DictReader(path.open(encoding="utf-8", newline="")))
    moments = [round(float(row["t_s"]) * 1000) for row in rows]
    assert max(b - a for a, b in pairwise(moments)) == 66 and not any("gap" in row["mark"] for row in rows)
    (stretch,) = stretches(LogFile(str(path)))
    assert list(stretch.gaps) == [] and any(b - a > 3 * 0.022 for a, b in pairwise(stretch.t))
