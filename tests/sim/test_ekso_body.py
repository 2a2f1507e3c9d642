"""The simulated EksoNR in motion: postures, leg equations, counters, on virtual time. The figures are those of the
dossier, section 10.
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, radians, sin

import pytest

from handctl.sim.ekso.mechanics import POSTURES, hips
from tests.sim.ekso_bench import Bench, message
from tests.support.each_row import each_row


def signed(word: int) -> int:
    return word - 65536 if word >= 32768 else word


def reading(bench: Bench) -> dict[str, float]:
    """GetData in units; only what this file looks at."""
    words = bench.words(153)
    names = {0: "pitch", 11: "rh", 13: "rk", 15: "lh", 17: "lk", 7: "ry", 9: "ly", 10: "rhc", 12: "rkc", 14: "lhc"}
    values = {name: signed(words[place]) / 100 for place, name in names.items()}
    values |= {"rx": signed(words[6]) / 10, "lx": signed(words[8]) / 10, "lkc": signed(words[16]) / 100}
    values |= {"state": words[18], "lcd": words[21], "boot": words[25] * 65536 + words[26], "shift": signed(words[22])}
    values |= {"pressures": sum(words[2:6])}
    return values


def residuals(values: dict[str, float], upper: float, lower: float) -> float:
    """The worst difference from the leg equations, in steps of the words."""
    worst = 0.0
    for side in "rl":
        thigh = radians(values[side + "h"] - values["pitch"])
        shank = thigh - radians(values[side + "k"])
        forward = -upper * sin(thigh) - lower * sin(shank) + 2.75
        height = upper * cos(thigh) + lower * cos(shank) + 4.0
        worst = max(worst, abs(forward - values[side + "x"]) / 0.1, abs(height - values[side + "y"]) / 0.01)
    return worst


# -- kinematics --------------------------------------------------------------------------------------------------------


@each_row(
    ("pitch", "hip", "knee", "x", "y"),
    [(-10, 78, 103, -101, 2005), (20.8, 68, 54, -78, 3144), (5.8, -1, 0, 67, 3677), (4.5, 22.1, 8.4, -49, 3600)],
)
def test_check_points(pitch: float, hip: float, knee: float, x: int, y: int) -> None:
    forward, height = hips(pitch, hip, knee, 17.0, 16.0)
    assert (round(forward * 10), round(height * 100)) == (x, y)
    bench = Bench()
    bench.line.command("set upper_leg_length 1700")
    bench.line.command("set 201 1600")
    bench.line.command(f"pose {pitch} {hip} {knee}")
    words = bench.words(153)
    assert [signed(word) for word in words[6:10]] == [x, y, x, y]
    assert [words[place] for place in (11, 15)] == [round(hip * 100) % 65536] * 2


@pytest.mark.parametrize("posture", POSTURES)
def test_hips_fit_the_joints(posture: str) -> None:
    bench = Bench(posture=posture)
    for _ in range(60):
        bench.wait(0.21)
        # Rounding of three angles to 0.005 deg moves a hip by half a step of y at most; its own rounding is another.
        assert residuals(reading(bench), 16.8, 16.4) <= 1.1


def test_leg_lengths_move_the_hips() -> None:
    bench = Bench(sway=0)
    before = reading(bench)
    assert bench.set(200, 1780) == (0, 0)
    after = reading(bench)
    assert after["ry"] - before["ry"] == pytest.approx(0.99, abs=0.02)
    assert residuals(after, 17.8, 16.4) <= 1.1


# -- postures -----------------------------------------------------------------------------------------------------------


def test_sitting() -> None:
    bench = Bench(posture="sitting", sway=0)
    values = reading(bench)
    assert values["state"] == 0x1040
    assert (values["pitch"], values["rh"], values["rk"], values["lcd"]) == (-10.0, 78.0, 103.2, 0)
    assert [values[name] for name in ("rhc", "rkc", "lhc", "lkc")] == [0.0] * 4


def test_standing_keeps_still() -> None:
    bench = Bench()
    samples = []
    for _ in range(100):
        samples.append(reading(bench))
        bench.wait(0.1)
    assert {sample["state"] for sample in samples} == {0x2040}
    for name in ("rh", "rk", "lh", "lk"):
        assert max(abs(b[name] - a[name]) for a, b in pairwise(samples)) < 0.1
    assert len({sample["pressures"] for sample in samples}) > 10
    assert all(1.0 <= sample["rhc"] <= 3.0 and 1.0 <= sample["lhc"] <= 3.0 for sample in samples)


@pytest.mark.parametrize("window", [0.1, 0.25, 0.5, 1.0])
def test_fidgeting_is_seen_over_any_window(window: float) -> None:
    bench = Bench(fault="fidget")
    before = reading(bench)
    for _ in range(40):
        bench.wait(window)
        after = reading(bench)
        assert after["state"] == 0x2040
        assert max(abs(after[name] - before[name]) for name in ("rh", "lh")) / window > 5.0
        assert residuals(after, 16.8, 16.4) <= 1.1
        before = after


def test_standing_up_and_sitting_down() -> None:
    bench = Bench(posture="sitting", sway=0)
    bench.line.command("rise")
    seen: list[tuple[float, dict[str, float]]] = []
    while bench.now < 12.0:
        seen.append((bench.now, reading(bench)))
        bench.wait(0.1)
    states = {state: [when for when, values in seen if values["state"] == state] for state in (0x3040, 0x3440, 0x2040)}
    assert sum(len(times) for times in states.values()) == len(seen)
    assert (states[0x3040][0], states[0x3440][0], states[0x2040][0]) == pytest.approx((0.0, 7.8, 11.5), abs=0.11)
    assert seen[0][1]["lcd"] == 0x0010
    rising = [values for _, values in seen if values["state"] == 0x3440]
    leaning = [values for _, values in seen if values["state"] == 0x3040]
    assert all(values["rhc"] == values["lkc"] == 0.0 for values in leaning)
    assert 30.0 < max(abs(b["rk"] - a["rk"]) for a, b in pairwise(rising)) * 10 <= 40.5
    assert -8.0 <= min(values["lkc"] for values in rising) < -7.5
    assert min(values["lhc"] for values in rising) < -5.5
    assert max(values["lhc"] for values in rising) > 3.5
    assert seen[-1][1]["pitch"] == 6.0
    assert seen[-1][1]["rh"] == -1.0
    bench.line.command("sit")
    assert reading(bench)["state"] == 0x3440
    bench.wait(5.0)
    assert reading(bench)["state"] == 0x3040
    bench.wait(7.0)
    assert reading(bench)["state"] == 0x1040
    assert reading(bench)["rh"] == 78.0


def test_cancel_stops_where_it_is() -> None:
    bench = Bench(posture="rising", sway=0)
    bench.wait(9.0)
    assert reading(bench)["state"] == 0x3440
    assert bench.ask(message(156, 1, b"\1\0").hex()) == message(156, 1, b"\0\0").hex(" ").upper()
    before = reading(bench)
    bench.wait(1.0)
    after = reading(bench)
    assert after["state"] == 0x3040
    assert [after[name] for name in ("rh", "rk", "pitch", "lhc")] == [before[n] for n in ("rh", "rk", "pitch", "lhc")]
    bench.line.command("rise")
    bench.wait(3.0)
    assert reading(bench)["state"] == 0x2040


def test_cancel_in_the_chair() -> None:
    bench = Bench(posture="rising")
    bench.ask(message(156, 1, b"\1\0").hex())
    assert reading(bench)["state"] == 0x1040


def test_upright_time_begins_on_arrival() -> None:
    bench = Bench(posture="rising")
    before = bench.words(154)
    bench.now = 14.7  # in one step: 11.5 s on the way, 3.2 s upright
    bench.line.advance(bench.now)
    assert [b - a for a, b in zip(before[:3], bench.words(154)[:3], strict=True)] == [0, 3, 0]
    assert bench.line.command("posture") == "posture standing state 2040"


def test_walking_counts_steps() -> None:
    bench = Bench()
    before = bench.words(154)
    assert bench.line.command("walk on") == "walk on"
    bench.wait(0.75)
    assert reading(bench)["shift"] == 400
    bench.wait(14.35)  # a half step takes the swing time of 1.10 s and 0.40 s
    values = reading(bench)
    assert values["state"] == 0x4440
    after = bench.words(154)
    assert [b - a for a, b in zip(before[:3], after[:3], strict=True)] == [10, 15, 15]
    assert after[11:15] == [143, 147, 11, 12]  # step length 14.75 in cut to tenths, the left one 0.4 less
    bench.line.command("walk off")
    bench.wait(5.0)
    last = bench.words(154)
    assert [b - a for a, b in zip(after[:3], last[:3], strict=True)] == [0, 5, 0]
    assert reading(bench)["shift"] == 1000


def test_walking_starts_from_standing() -> None:
    bench = Bench(posture="sitting")
    with pytest.raises(ValueError, match="it is sitting"):
        bench.line.command("walk on")


def test_counters_wrap() -> None:
    bench = Bench()
    bench.line.device.feedback[0] = 65535
    bench.line.command("walk on")
    bench.wait(1.6)
    assert bench.words(154)[0] == 0
