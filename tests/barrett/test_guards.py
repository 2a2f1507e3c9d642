"""The guards of the RealTime loop: on the simulated hand on virtual time, and by themselves (barrett §5.3.4, §5.5, §6)."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.barrett.parameter_map import BEYOND, TRAVEL, implausible
from handctl.devices.barrett.realtime.control_values import Change, Controls, Schedule
from handctl.devices.barrett.realtime.guards import GUARDS, Guards, Limits
from handctl.errors import CheckFailed, ProtocolError, UsageError
from tests.barrett.commands import fake
from tests.barrett.realtime import Names, Run, assert_left
from tests.barrett.support import CR, Simulated, codes
from tests.support.cli import run
from tests.support.each_row import each_row

ONE: Names = {0: ("strain", "position")}
WIRE = "wire=auto&baud=38400"


def at(velocity: int, motor: int = 0) -> Controls:
    return Controls({motor: ("velocity",)}, {(motor, "velocity"): velocity})


def driven(velocity: int | Controls, *, query: str = WIRE, line: str = "", first: str = "", **more: Any) -> Run:
    """One motor under a constant velocity; `line` is typed before, `first` is a control command."""
    link = Simulated(f"initialized=1&{query}", 38400 if "baud=38400" in query else 9600)
    link.sleep(0.01)
    if line:
        link.feed(line.encode() + CR)
        link.sleep(0.2)
    controls = velocity if isinstance(velocity, Controls) else at(velocity)
    more = {"receive": ONE, "temperature": False, "motors": (0,), "delta_unit": None, **more}
    loop = Run(link=link, controls=controls, **more)
    if first:
        loop.control(first)
    return loop


def events(loop: Run) -> list[dict[str, Any]]:
    return list(loop.loop.summary()["loop"]["guard_events"])


def commands_of(loop: Run) -> list[int]:
    return [int.from_bytes(data[1:2], "big", signed=True) for data in loop.inside if data[:1] == b"C"]


# -- each guard on the simulated hand ---------------------------------------------------------------------------------


def test_a_stalled_finger_is_released_after_tstop() -> None:
    """It was driven into its stop as long as it was told: 6 s (§5.5 case 1 does not act in the loop)."""
    near = "position F1 16000"
    loop = driven(100, line="1FSET CT 60000", first=near).go(None, duration=0.5)
    assert loop.error is None
    loop = driven(100, guards=set(GUARDS) - {"window"}, first=near).go(None, duration=0.5)
    (event,) = events(loop)
    assert (event["guard"], event["motor"]) == ("stall", "F1") and 17700 < event["value"] < 17900
    assert 30 < event["after_ms"] < 45
    sent = commands_of(loop)
    place = sent.index(0)
    assert set(sent[:place]) == {100} and set(sent[place:]) == {0}
    held = [row["guard"] for sample in loop.samples for row in sample.rows if row["name"] == "velocity_command"]
    assert held[-1] == "stall" and held[0] is None and loop.error is None
    assert "guard-stall" in codes(loop.hand)
    assert_left(loop, zero=False, power_off=False)


def test_an_obstacle_is_a_stall() -> None:
    loop = driven(60, first="obstacle F1 3000").go(None, duration=0.5)
    (event,) = events(loop)
    assert event["guard"] == "stall" and 3000 < event["value"] < 3500 and event["after_ms"] < 45
    assert commands_of(loop)[-1] == 0


@pytest.mark.parametrize(("velocity", "start", "limit"), [(127, 9000, 17000), (-127, 9000, 0), (20, 16000, 17000)])
def test_a_motor_stays_in_its_window(velocity: int, start: int, limit: int) -> None:
    """0..CT: velocity 0 before the edge, not behind it."""
    loop = driven(velocity, first=f"position F1 {start}").go(None, duration=0.6)
    (event,) = events(loop)
    assert (event["guard"], event["limit"]) == ("window", limit)
    last = loop.values("position", "F1")[-1]
    assert 0 <= last <= 17000 and abs(last - limit) < 800, last
    assert loop.error is None and commands_of(loop)[-1] == 0


@pytest.mark.parametrize(("line", "first", "velocity"), [
    ("1FSET HSG 150", "obstacle F1 2000", 100), ("1FSET LSG 100", "strain F1 90", 40), ("1FSET HSG 150", "strain F1 255", 40),
])  # fmt: skip
def test_a_strain_limit_holds_in_the_loop(line: str, first: str, velocity: int) -> None:
    """HSG and LSG act in movement commands only (§5.3.1); the strain is read for the guard, and not shown."""
    loop = driven(velocity, line=line, first=first, receive={0: ("position",)}).go(None, duration=1.0)
    (event,) = events(loop)
    assert event["guard"] == "strain" and event["limit"] in (150, 100)
    assert commands_of(loop)[-1] == 0 and not loop.values("strain", "F1")
    assert loop.flags() == loop.before


def test_an_opening_motor_is_relieved() -> None:
    """Above HSG it may open: that is the way out."""
    loop = driven(-40, line="1FSET HSG 130", first="position F1 9000", guards=set(GUARDS))
    loop.control("obstacle F1 8900")
    loop.go(None, duration=0.3)
    assert events(loop) == [] and set(commands_of(loop)) == {-40}


def test_an_opening_slam_is_refused() -> None:
    """LCVC 8 x 127 opens at 63.5 counts a sample, IVEL allows 18.75 (§5.3.4): nothing is entered."""
    loop = driven(-127, line="1FSET LCVC 8", first="position F1 9000").go(10)
    assert isinstance(loop.error, UsageError) and loop.error.code == "opening-speed"
    assert "63.5" in loop.error.text and "18.75" in loop.error.text
    assert "1LOOP" not in loop.link.commands and loop.flags() == loop.before
    slow = driven(-37, line="1FSET LCVC 8", first="position F1 9000").go(10)  # 296 of 300
    assert slow.error is None
    closing = driven(127, line="1FSET LCVC 8").go(10)
    assert closing.error is None
    forced = driven(-127, line="1FSET LCVC 8", first="position F1 9000", guards=set(GUARDS) - {"opening"}).go(3)
    assert forced.error is None
    raised = driven(-127, line="1FSET LCVC 8 IVEL 4080", first="position F1 9000").go(3)
    assert isinstance(raised.error, UsageError), "an IVEL that is too high is no licence"


def test_a_late_opening_slam_of_a_live_line_leaves_the_loop() -> None:
    class Sudden(Controls):
        live = True

        def extremes(self, index: int) -> tuple[int, int]:
            return -127, 127

        def at(self, seconds: float) -> Any:
            return {0: {"velocity": 20 if seconds < 0.1 else -127}}

    loop = driven(Sudden({0: ("velocity",)}, {}), line="1FSET LCVC 8").go(None, duration=1.0)
    assert isinstance(loop.error, CheckFailed) and loop.error.code == "opening-speed"
    assert -127 not in commands_of(loop)
    assert "1T" in loop.after and loop.stands()


def test_a_hot_board_ends_the_loop_and_keeps_it_from_beginning() -> None:
    cold = driven(10)
    cold.link.sleep(0.1)
    stream = cold.loop.run(rate=0.0, count=None, duration=5.0)
    next(stream)
    cold.control("temperature 655")
    with pytest.raises(CheckFailed) as caught:
        for _ in stream:
            pass
    assert caught.value.code == "guard-heat" and "65.5" in caught.value.text
    assert "1T" in cold.after and cold.stands() and cold.flags() == cold.before
    hot = driven(10, query=f"{WIRE}&fault=hot").go(3)
    assert isinstance(hot.error, CheckFailed) and hot.error.code == "guard-heat"
    assert "1LOOP" not in hot.link.commands


def test_a_board_that_does_not_say_its_temperature_is_not_driven() -> None:
    """The end of the scale is a sensor that is not connected: without it, heat cannot be detected."""
    lost = driven(10, query=f"{WIRE}&temperature=-550").go(3)
    assert isinstance(lost.error, CheckFailed) and lost.error.code == "guard-heat"
    assert "1LOOP" not in lost.link.commands
    loop = driven(10)
    stream = loop.loop.run(rate=0.0, count=None, duration=5.0)
    next(stream)
    loop.control("temperature -550")
    with pytest.raises(CheckFailed) as caught:
        list(stream)
    assert caught.value.code == "guard-heat" and loop.stands()


def test_a_position_that_cannot_be_ends_the_loop() -> None:
    loop = driven(10)
    stream = loop.loop.run(rate=0.0, count=None, duration=5.0)
    next(stream)
    loop.control("jump F1 25000")
    rows = []
    with pytest.raises(CheckFailed) as caught:
        for sample in stream:
            rows += sample.rows
    assert caught.value.code == "guard-window"
    doubted = [row for row in rows if row["name"] == "position" and row["doubt"]]
    assert [row["value"] > 18000 for row in doubted] == [True]


def test_every_guard_can_be_switched_off_by_name() -> None:
    """With all off nothing is added to the blocks and nothing held: the hand as it was."""
    loop = driven(100, guards=(), receive={0: ("delta",)}, delta_unit=1, first="position F1 16000").go(
        None, duration=0.5
    )
    assert events(loop) == [] and set(commands_of(loop)) == {100}
    assert loop.loop.session.layout.feedback_size == 2
    result = run("barrett", "realtime", "--motors", "1", "--velocity", "100", "--no-guard", "all", "--count", "2",
                 "-p", fake(wire="auto", initialized=1), "--json")  # fmt: skip
    assert (result.code, result.stream[1]["loop"]["guards"]) == (0, [])


def test_a_motor_held_may_turn_back() -> None:
    rows: list[tuple[float, Change]] = [
        (0.0, {(0, "velocity"): 127}), (1.0, {(0, "velocity"): -60}), (1.2, {(0, "velocity"): 60}), (1.25, {}),
    ]  # fmt: skip
    controls = Schedule({0: ("velocity",)}, rows, {})
    loop = driven(controls, first="position F1 15000").go(None)
    assert [event["guard"] for event in events(loop)] == ["window"]
    assert list(dict.fromkeys(commands_of(loop))) == [127, 0, -60, 60]


def test_a_hand_that_is_watched_has_no_guards_and_no_further_questions() -> None:
    loop = Run().go(2)
    assert loop.loop.summary()["loop"]["guards"] == []
    assert not any("TSTOP" in line or "OTEMP" in line for line in loop.link.commands)


# -- deltas -----------------------------------------------------------------------------------------------------------


def test_the_delta_unit_is_raised_as_velocity_and_rate_need_it() -> None:
    """19 of 20 deltas were saturated, the position 7000 counts behind; now none, and the flag is put back."""
    for baud in (9600, 38400):
        loop = driven(127, query=f"wire=auto&baud={baud}", receive={0: ("delta",)}).go(None, duration=0.4)
        summary = loop.loop.summary()["loop"]
        assert summary["saturated_deltas"] == 0 and summary["guard_events"] == []
        truth = int(loop.control("motors").split()[2])
        assert abs(loop.values("position", "F1")[-1] - truth) < 700  # what it went on to its stop
        assert loop.control("ram LFDPC") == "1 1 1 1"


def test_a_saturated_delta_is_marked_and_told() -> None:
    names: Names = {0: ("velocity", "strain", "delta")}
    loop = driven(127, query="wire=auto", receive=names, temperature=True, delta_unit=1, guards=()).go(20)
    assert loop.loop.summary()["loop"]["saturated_deltas"] >= 15 and "saturated" in codes(loop.hand)
    marked = [row for sample in loop.samples for row in sample.rows if row["doubt"]]
    assert {row["name"] for row in marked} == {"delta", "position"}
    assert all("saturated" in row["doubt"] for row in marked)
    assert len(marked) == 2 * loop.loop.summary()["loop"]["saturated_deltas"]


def test_what_lfdpd_drops_stays_lost() -> None:
    link = Simulated("initialized=1&loop-jump=500,0,0,0")
    link.feed(b"PSET LFDPD 1" + CR)
    loop = Run(link=link, receive={0: ("delta",)}, temperature=False, motors=(0,)).go(4)
    doubts = [row["doubt"] for sample in loop.samples for row in sample.rows if row["name"] == "position"]
    assert "saturated" in doubts[0] and all("dropped" in doubt for doubt in doubts[1:])


# -- framing ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", ["loop-drop", "loop-extra"])
@pytest.mark.parametrize("drives", [True, False])
@pytest.mark.parametrize("rate", [0.0, 10.0])
def test_no_sample_behind_a_lost_or_added_byte_is_given_out_as_data(fault: str, drives: bool, rate: float) -> None:
    """Position 60202, strain 5, no error: that was the sample after it. Now each is proved, or says that it is not."""
    controls = at(10) if drives else None
    query = f"fault={fault}&loop-after=4&wire=auto"
    loop = Run(query, controls=controls, receive={0: ("strain", "position")}, temperature=False, motors=(0,))
    loop.go(30, rate=rate)
    assert isinstance(loop.error, ProtocolError)
    sound = [sample for sample in loop.samples if not any(row["doubt"] for row in sample.rows)]
    assert len(sound) >= 3
    for sample in sound:
        values = {row["name"]: row["value"] for row in sample.rows}
        assert values["strain"] == 112 and values["position"] < 1000, values
    assert len(loop.samples) - len(sound) <= 1


def test_the_last_sample_is_proved_by_velocity_0() -> None:
    loop = driven(20).go(5)
    assert len(loop.samples) == 5 and not any(row["doubt"] for sample in loop.samples for row in sample.rows)
    assert [data[:1] for data in loop.inside[:-1]] == [b"C"] * 5 + [b"c"] and loop.inside[-1] == b"\0\x03"


def test_a_paced_sample_does_not_wait_for_the_next_block() -> None:
    """At 2 Hz the proof is silence: the sample is there before the next block goes out."""
    loop = Run("wire=auto", receive={0: ("position",)}, temperature=False, motors=(0,))
    stream = loop.loop.run(rate=2.0, count=None, duration=3.0)
    sample = next(stream)
    assert loop.link.now() - (loop.loop.intake.start + sample.t) < 0.1
    assert len([data for data in loop.inside if data == b"A"]) == 1
    stream.close()  # type: ignore[attr-defined]


# -- by themselves ----------------------------------------------------------------------------------------------------

FREE = Limits(speed=244.0, factor=1, stall=0.03, window=(0, 17000))


@given(
    st.lists(st.tuples(st.integers(-127, 127), st.floats(0.002, 0.2)), min_size=1, max_size=40),
    st.integers(0, 17000),
)
def test_no_command_leads_out_of_the_window(steps: list[tuple[int, float]], start: int) -> None:
    """Whatever is commanded, at whatever pace up to the one announced, an ideal motor stays within."""
    guards = Guards({0: FREE}, {0: start}, GUARDS, 650, 0.0)
    now, place, force = 0.0, float(start), 0
    for velocity, seconds in steps:
        values, _ = guards.allow({0: {"velocity": velocity}}, now, seconds)
        force = values[0]["velocity"]
        now += seconds
        place += force * FREE.speed * seconds
        assert -1 <= place <= 17001
        guards.see(0, round(place), None, force, now, now)


@given(st.integers(1, 127), st.floats(0.003, 0.04))
def test_a_motor_that_follows_is_never_stalled(velocity: int, cycle: float) -> None:
    guards = Guards({0: FREE}, {0: 0}, GUARDS, 650, 0.0)
    for number in range(60):
        now = number * cycle
        guards.see(0, int(velocity * 244.0 * now / 4), None, velocity, now, now)
    assert [event for event in guards.events if event.guard == "stall"] == []


@given(st.integers(1, 127), st.floats(0.003, 0.04), st.lists(st.integers(-1, 1), min_size=60, max_size=60))
def test_a_motor_that_trembles_is_stalled(velocity: int, cycle: float, jitter: list[int]) -> None:
    guards = Guards({0: FREE}, {0: 9000}, GUARDS, 650, 0.0)
    for number, step in enumerate(jitter):
        guards.see(0, 9000 + step, None, velocity, number * cycle, number * cycle)
    (event,) = [event for event in guards.events if event.guard == "stall"]
    assert event.after <= max(0.03, 8 / (velocity * 244.0)) + 3 * cycle + 0.001


@each_row("index", [0, 3])
def test_what_is_plausible(index: int) -> None:
    most = TRAVEL[index == 3]
    assert not implausible(index, most + BEYOND) and not implausible(index, -BEYOND)
    assert implausible(index, most + BEYOND + 1) and implausible(index, -BEYOND - 1)
