"""Control laws of the RealTime loop: what they hold, what they cannot override, and what is refused before the first byte."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.barrett.realtime.control_laws import FUNCTIONS, Known, Rules
from handctl.devices.barrett.realtime.control_values import COLUMNS, Controls, Live
from handctl.errors import CheckFailed, UsageError
from handctl.link import fake as links
from tests.barrett.commands import fake
from tests.support.cli import Result, Spy, run, spying
from tests.support.each_row import each_row

PORT = fake(clock="virtual", initialized=1, wire="auto")
HOLDS = "velocity.F1 = clamp((9000 - P.F1)/20, -40, 40)"
BOTH = (0, 1)


def do(*args: str | Path, port: str = PORT, motors: str = "1", **more: Any) -> Result:
    return run("barrett", "realtime", "--motors", motors, *args, "-p", port, "--json", **more)


def values(result: Result, name: str, motor: str | None = "F1") -> list[Any]:
    rows, _ = result.stream
    return [row["value"] for row in rows if (row["name"], row.get("motor")) == (name, motor)]


def worked(text: str, known: Known | None = None, motors: tuple[int, ...] = BOTH, columns: bool = False) -> int:
    rules = Rules([f"velocity.F1 = {text}"], None, motors, columns=columns)
    if known is not None:
        rules.known.__dict__.update(known.__dict__)
    controls = rules.over(None)
    assert controls is not None
    sent = controls.at(0.0)
    assert sent is not None
    return sent[0]["velocity"]


# -- what it does -------------------------------------------------------------------------------------------------------


def test_a_law_holds_a_finger() -> None:
    """F1 at 9000 of 17,900, within 50 counts for 10 s of the hand's time, from wherever it stood."""
    result = do("--law", HOLDS, "--receive", "position", "--duration", "11.5")
    rows, end = result.stream
    assert result.code == 0 and end["loop"]["guard_events"] == []
    at = [(row["t"], row["value"]) for row in rows if row["name"] == "position"]
    held = [value for t, value in at if t >= 1.5]
    assert at[-1][0] - 1.5 >= 9.9 and max(abs(value - 9000) for value in held) < 50
    assert max(map(abs, values(result, "velocity_command"))) == 40
    assert end["stream"]["rate_hz"] >= 0.95 * end["loop"]["line_limit_hz"]["sequential"]


PD = "velocity.F1 = clamp((9000 - P)/4 - D/4, -40, 40)"


@contextmanager
def at_moments(spy: Spy, *moments: tuple[float, str]) -> Iterator[None]:
    """What happens to the simulated hand, each at its second of virtual time: (second, control command)."""
    left, sleep = list(moments), links._Simulated._sleep_until

    def until(link: Any, moment: float) -> float:
        while left and link._virtual is not None and moment >= left[0][0]:
            sleep(link, left[0][0])
            spy.lines[-1].device.command(left.pop(0)[1].split())
        return sleep(link, moment)

    with mock.patch.object(links._Simulated, "_sleep_until", until):
        yield
    assert not left, "it ended before"


def test_a_pd_hold_brings_a_pushed_finger_back() -> None:
    """Pushed by 2500 counts to either side: within 20 counts again 0.4 s later, no farther than 10 beyond its place, and no guard acts."""
    with spying() as spy, at_moments(spy, (2.5, "jump F1 -2500"), (5.6, "jump F1 2500")):
        result = do("--law", PD, "--receive", "position", "--duration", "8.7")
    _, end = result.stream
    assert result.code == 0 and end["loop"]["guard_events"] == []
    at = [(row["t"], row["value"] - 9000) for row in result.stream[0] if row["name"] == "position"]
    pushes = [now[0] for before, now in pairwise(at) if abs(now[1] - before[1]) > 1000]
    assert len(pushes) == 2 and pushes[1] - pushes[0] == pytest.approx(3.1, abs=0.05)
    for push, side in zip(pushes, (-1, 1), strict=True):
        behind = [off for t, off in at if push <= t < push + 3]
        assert behind[0] * side > 2000 and min(off * side for off in behind) >= -10
    calm = [off for t, off in at if t > 2 and not any(push <= t < push + 0.4 for push in pushes)]
    assert max(map(abs, calm)) <= 20


def test_guards_are_stronger_than_a_pd_hold() -> None:
    with spying() as spy, at_moments(spy, (2.5, "jump F1 -2500"), (2.5, "block F1")):
        result = do("--law", PD, "--receive", "position", "--duration", "5")
    (event,) = result.stream[1]["loop"]["guard_events"]
    assert (event["guard"], event["motor"]) == ("stall", "F1")
    assert values(result, "velocity_command")[-1] == 0, "although the law goes on asking for 40"
    result = do("--law", PD.replace("9000", "20000"), "--receive", "position", "--duration", "8")
    assert {event["guard"] for event in result.stream[1]["loop"]["guard_events"]} == {"window"}
    assert max(values(result, "position")) <= 17000 and values(result, "velocity_command")[-1] == 0


def test_it_ends_when_the_condition_is_true() -> None:
    result = do("--law", HOLDS, "--until", "abs(P.F1 - 9000) < 50", "--duration", "9")
    assert result.code == 0 and "until" in result.said
    assert abs(values(result, "position")[-1] - 9000) < 50 <= abs(values(result, "position")[-2] - 9000)
    watched = do("--until", "T > 20 and N >= 0 and t > 0.1", "--receive", "none", "--duration", "9")
    assert watched.code == 0 and "until" in watched.said and watched.stream[0] == []


def test_feedback_that_a_law_needs_is_taken_in_and_not_shown() -> None:
    result = do("--law", "velocity.F1 = P.F1/1000 + S.F1/100 + V.F1 + D.F1 + T/10", "--receive", "none", "--count", "3")
    rows, end = result.stream
    assert result.code == 0 and {row["name"] for row in rows} == {"velocity_command"}
    assert end["loop"]["feedback_bytes"] == 1 + 1 + 1 + 2 + 1 + 2


def test_columns_of_a_file_and_the_values_sent_last(tmp_path: Path) -> None:
    file = tmp_path / "plan.csv"
    file.write_text("t,target,velocity.F2\n0,3000,0\n0.5,4000,5\n2,,\n", encoding="utf-8")
    words = ("--control", file, "--law", "velocity.F1 = clamp((target - P.F1)/20, velocity.F1 - 2, velocity.F1 + 2)")
    result = do(*words, motors="12")
    assert result.code == 0, result
    sent = values(result, "velocity_command")
    assert max(abs(one - other) for one, other in pairwise(sent)) == 2
    assert abs(values(result, "position")[-1] - 4000) < 200
    assert set(values(result, "velocity_command", "F2")) == {0, 5}
    ended = do(*words[:2], "--until", "P.F1 >= 0 and target > 3999", motors="12")
    assert ended.code == 0 and "until" in ended.said
    missing = do(*words[:2], "--law", "velocity.F1 = target + aim", motors="12")
    assert missing.code == 2 and "aim" in missing.err


def test_a_gain_is_never_0_and_results_are_rounded_and_saturated() -> None:
    result = do("--law", "gain = 0.2 - N", "--law", "velocity.F1 = 3000", "--count", "4", motors="12")
    assert result.code == 0 and set(values(result, "gain_command")) == {1} == set(values(result, "gain_command", "F2"))
    assert set(values(result, "velocity_command")) == {127}
    assert worked("-3000") == -127 and worked("2.6") == 3


def test_overlapped_and_measured() -> None:
    assert do("--law", HOLDS, "--overlapped", "--count", "40").code == 0
    measured = do("--law", HOLDS, "--measure", "50")
    assert measured.code == 0 and {"rate", "mean"} <= {row["name"] for row in measured.stream[0]}


def test_a_dry_run_says_that_the_laws_make_the_values() -> None:
    with spying() as spy:
        result = do("--law", "gain.F1 = 5", "--law", HOLDS, "-n")
    assert result.code == 0 and spy.lines == []
    assert [row["bytes"] for row in result.stream[0] if row["moves"]] == ["43 00 01"]


# -- what a law cannot do -------------------------------------------------------------------------------------------------


def test_full_speed_into_the_stop_is_held_by_the_window() -> None:
    result = do("--law", "velocity.F1 = 127", "--duration", "3")
    (event,) = result.stream[1]["loop"]["guard_events"]
    assert event["guard"] == "window" and max(values(result, "position")) <= 17000
    assert values(result, "velocity_command")[-1] == 0


def test_full_speed_into_the_stop_is_released_by_the_stall_guard() -> None:
    result = do("--law", "velocity.F1 = 127", "--no-guard", "window", "--duration", "3")
    (event,) = result.stream[1]["loop"]["guard_events"]
    assert event["guard"] == "stall" and event["after_ms"] < 45 and values(result, "velocity_command")[-1] == 0


@each_row(
    ("text", "blocks"),
    [
        ("sqrt(P.F1 - 99999)", 0),
        ("100/(P.F1 - P.F1)", 0),
        ("1e308*10", 0),
        ("1e999", 0),
        ("1e308*10 - 1e308*10", 0),
        ("20 + 0/(5 - N)", 5),
        ("20 + 0*sqrt(5.5 - N)", 6),
    ],
)
def test_what_is_no_number_is_never_sent_and_ends_the_loop(text: str, blocks: int, tmp_path: Path) -> None:
    """Velocity 0 is the last value, the motors are switched off, and the exit code is 7."""
    trace = tmp_path / "t.txt"
    result = do("--law", f"velocity.F1 = {text}", "--duration", "3", "--trace", trace)
    assert result.code == 7 and "law" in result.said, result
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if " > " in line]
    sent = [bytes.fromhex("".join(words[2:])) for words in lines]
    assert [data for data in sent if data[:1] == b"C"] == [b"C\x14"] * blocks
    assert (b"c\x00" in sent) is bool(blocks) and b"1T\r" in sent


def test_an_alternating_sign_stays_in_its_window() -> None:
    result = do("--law", "velocity.F1 = 127 * sign(0.5 - (N - 2*floor(N/2)))", "--duration", "2")
    assert result.code == 0 and all(0 <= value <= 17000 for value in values(result, "position"))
    assert "guard-window" in result.said


def test_an_opening_slam_ends_the_loop(tmp_path: Path) -> None:
    """LCVC 8 x 127 is more than IVEL allows (§5.3.4): the value is never sent."""
    port = fake(clock="virtual", initialized=1, wire="auto", state=tmp_path / "s.json")
    assert run("barrett", "set", "LCVC.F1=8", "--force", "-p", port).code == 0
    result = do("--law", "velocity.F1 = 20 - 147*(N > 3)", "--duration", "2", port=port)
    assert result.code == 7 and "opening-speed" in result.said
    assert set(values(result, "velocity_command")) == {160}


# -- what is refused ------------------------------------------------------------------------------------------------------


@each_row(
    ("words", "column"),
    [
        (("--law", "velocity.F3 = 4"), "column 1"),
        (("--law", "t = 4"), "column 1"),
        (("--law", "velocity.F1"), "column 13"),
        (("--law", "velocity.F1 = P.F3"), "column 15"),
        (("--law", "velocity.F1 = 3 + foo"), "column 19"),
        (("--law", "velocity.F1 = __import__('os')"), "column 15"),
        (("--law", "velocity.F1 = (1).real"), "column 15"),
        (("--law", "velocity.F1 = 'a'"), "column 15"),
        (("--law", "velocity.F1 = P.F1 +"), "column 21"),
        (("--law", "velocity.F1 ="), "column 14"),
        (("--law", "velocity.F1 = 9**9"), "column 15"),
        (("--law", "velocity.F1 = clamp(1, 2)"), "column 15"),
        (("--law", "velocity.F1 = max(*P)"), "column 15"),
        (("--law", "velocity.F1 = [x for x in 3]"), "column 15"),
        (("--law", "velocity.F1 = lambda: 3"), "column 15"),
        (("--law", "velocity.F1 = π"), "column 15"),
        (("--law", "velocity.F1 = " + "-" * 400 + "1"), "column"),
        (("--law", "velocity.F1 = " + "(" * 250 + "1" + ")" * 40), "column"),
        (("--law", "position.F1 = 3"), "column 1"),
        (("--law", "velocity.F1 = gain.F1"), "gain.F1"),
        (("--law", HOLDS, "--law", "velocity = 3"), "velocity.F1"),
        (("--law", HOLDS, "--velocity", "20"), "velocity.F1"),
        (("--law", "gain.F2 = 3", "--gain", "F2=20"), "gain.F2"),
        (("--law", HOLDS, "--send", "velocity"), "velocity.F1"),
        (("--until", "P.F1"), "comparison"),
        (("--until", "P > 3"), "column 1"),
        (("--until", "P.F1 > target"), "column 8"),
    ],
)
def test_what_is_refused_before_the_first_byte(words: tuple[str, ...], column: str) -> None:
    with spying() as spy:
        result = do(*words, motors="12")
    assert result.code == 2 and spy.lines == [] and column in result.err, result


# -- the arithmetic ---------------------------------------------------------------------------------------------------------


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_the_arithmetic_is_that_of_the_formula(a: float, b: float) -> None:
    known = Known()
    known.feedback = {(0, "position"): a, (1, "position"): b}
    wanted = {
        "P.F1 + P.F2": a + b, "P.F1 - P.F2*2": a - b * 2, "clamp(P.F1, -9, P.F2*0 + 9)": min(max(a, -9), 9),
        "-P.F1": -a, "min(P.F1, P.F2)": min(a, b), "abs(P.F1) / 3": abs(a) / 3, "sin(P.F1)*10": math.sin(a) * 10,
        "P.F1 > P.F2": a > b, "not P.F1 <= 3 or P.F2 == 3": not a <= 3 or b == 3, "50*(P.F1 > 0 and P.F2 > 0)": 50 * (a > 0 and b > 0),
        "floor(P.F1/10) + round(P.F2/10) + sign(P.F1)": math.floor(a / 10) + round(b / 10) + (a > 0) - (a < 0),
        "sqrt(abs(P.F1)) + cos(0) + max(P.F1, 1, 2) * 0": math.sqrt(abs(a)) + 1,
    }  # fmt: skip
    for text, value in wanted.items():
        assert worked(text, known) == max(-127, min(127, round(value))), text
    assert all(any(name in text for text in wanted) for name in FUNCTIONS)


def test_names_are_of_the_block_before() -> None:
    known = Known()
    known.feedback = {(1, "strain"): 7.0, (0, "temperature"): 41.2}
    known.sent = {0: {"velocity": 11}}
    known.number, known.seconds = 6, 0.0
    assert worked("S.F2 + velocity.F1 + N + T", known) == round(7 + 11 + 6 + 41.2)
    assert worked("velocity + N*0", known) == 11  # without a motor: the law's own
    with pytest.raises(CheckFailed):
        worked("P.F1")  # nothing has come


def test_a_value_of_another_source_is_refused() -> None:
    rules = Rules(["velocity.F1 = 1"], None, BOTH, columns=False)
    with pytest.raises(UsageError):
        rules.over(Controls({0: ("velocity",), 1: ()}, {}))


def test_a_source_that_has_fallen_silent_stops_the_laws() -> None:
    """Live lines are valid for 1 s: what a law makes of old ones is no command either."""
    rules = Rules(["velocity.F1 = target"], None, BOTH, columns=True)
    source = Live({0: (), 1: ("velocity",), COLUMNS: ("target",)}, iter([(None, {(COLUMNS, "target"): 30.0})]), {})
    controls = rules.over(source)
    assert controls is not None and rules.columns == {"target"}
    assert controls.at(0.5) == {0: {"velocity": 30}, 1: {"velocity": 0}}
    assert controls.at(1.5) == {0: {"velocity": 0}, 1: {"velocity": 0}}
