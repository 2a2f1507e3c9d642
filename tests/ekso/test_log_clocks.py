"""What a log claims of two clocks that disagree, against the truth of the simulator: durations, restarts, holes, segments."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from handctl.model.device_clock import WITHIN_MS
from handctl.record.timeline import ClockFit
from handctl.sim.ekso.mechanics import SIZES, Unrest
from handctl.sim.engine.simulated_device import Random
from tests.ekso.commands import unit
from tests.support.cli import Result, run

LATE_S = 0.002
"""A tick of BootTime."""
SECONDS = 16
SEEDS = (1, 2, 13)
PULLED = ((4.4, 1.3), (9.2, 0.7))
"""Moments at which the cable is pulled, and for how long."""


@pytest.mark.parametrize("pulled", [False, True], ids=["plugged", "pulled"])
@pytest.mark.parametrize("size", SIZES)
def test_what_a_log_claims_is_the_truth(size: str, pulled: bool, tmp_path: Path) -> None:
    for seed in SEEDS:
        path = tmp_path / f"{seed}.csv"
        more = {"unplug": ",".join(f"{at}:{away}" for at, away in PULLED)} if pulled else {}
        done = run(
            "ekso", "log", path, "--duration", SECONDS, "--rate", "20", "--json",
            "-p", unit(disagree=size, seed=seed, **more),
        )  # fmt: skip
        judged(done, path, Unrest.drawn(size, Random(seed)), PULLED if pulled else ())


def judged(done: Result, path: Path, truth: Unrest, pulled: tuple[tuple[float, float], ...]) -> None:
    """Each claim of one log against what happened."""
    assert done.code == 0, done
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    about: dict[str, Any] = json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))
    at = [float(row["host_mono_s"]) for row in rows]
    shown = f"{truth.drift} {truth.events} {about['segments']}"
    assert abs(about["duration_s"] - (at[-1] - at[0])) <= WITHIN_MS / 1000 + LATE_S, shown
    segments = {segment["first_row"]: segment for segment in about["segments"]}
    for number, (before, after) in enumerate(pairwise(at), 2):
        events = [(kind, ms) for moment, kind, ms in truth.events if before < moment <= after]
        restarted = any(kind == "restart" for kind, _ in events)
        jumped = sum(ms for _, ms in events)
        begun = segments.get(number)
        assert bool(begun and begun["rebooted"]) is restarted, (number, before, events, shown)
        if abs(jumped) > 2 * WITHIN_MS or restarted:
            assert begun is not None, (number, events, shown)
        if begun is not None and not events and "clocks" in begun["why"]:
            assert abs(begun["clock_off_s"]) <= 0.06 + abs(truth.drift) / 1e6 * (after - before), (
                number,
                "drift alone",
                shown,
            )
    apart = [row for row in range(2, len(at) + 1) if any(at[row - 2] <= moment < at[row - 1] for moment, _ in pulled)]
    assert [hole["row"] for hole in about["holes"]] == apart, shown
    for hole in about["holes"]:
        before, after = at[hole["row"] - 2], at[hole["row"] - 1]
        assert all(moment + away <= after for moment, away in pulled if before <= moment < after)
        assert hole["length_s"] == pytest.approx(after - before, abs=0.0011)
        restarts = [kind for moment, kind, _ in truth.events if kind == "restart" and before < moment <= after]
        assert hole["rebooted"] in ((True,) if restarts else (False, None)), shown
        if hole["rebooted"] is None:
            assert "clocks" in segments[hole["row"]]["why"]
    assert about["complete"] is (not about["missing"]) and ("port-lost" in about["missing"]) is bool(pulled)
    for first, second in pairwise(rows):
        if first["segment"] == second["segment"]:
            apart = (
                float(second["t_s"])
                - float(first["t_s"])
                - (float(second["host_mono_s"]) - float(first["host_mono_s"]))
            )
            assert abs(apart) <= WITHIN_MS / 1000 + LATE_S


def test_the_residual_has_its_digits_after_two_hours() -> None:
    """Rows that are late by 1 ms in turn, on a clock that drifts by 20 ppm: however they are taken."""
    x = [at * 0.03 for at in range(240_000)]
    y = [time * 1.00002 + 0.001 * (-1) ** at for at, time in enumerate(x)]
    fit, many = ClockFit(), ClockFit()
    for at in range(0, len(x), 1000):
        many.extend(x[at : at + 1000], y[at : at + 1000])
    for one, other in zip(x[::10], y[::10], strict=True):
        fit.add(one, other)
    assert many.as_row() == {"a_s": 0.0, "b": 1.00002, "residual_ms": 1.0}
    assert fit.as_row() == {"a_s": 0.001, "b": 1.00002, "residual_ms": 0.0}
