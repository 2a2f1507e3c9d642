"""Control values of the RealTime loop: constant, with times, live; what is refused, and with which line."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, count

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handctl.devices.barrett.realtime.control_values import (
    Change,
    Controls,
    Live,
    Schedule,
    Values,
    constant,
    loop_motors,
    parse,
)
from handctl.errors import UsageError
from tests.support.each_row import each_row

F1, F2, F3, SPREAD = range(4)
BOTH = [F1, F2]


def rows(text: str, motors: list[int] | None = None, start: Change | None = None) -> Controls:
    return parse(text.splitlines(keepends=True), "in.csv", BOTH if motors is None else motors, start or {})


def at(controls: Controls, seconds: float) -> Values | None:
    """The values now, as a copy: the controls keep theirs."""
    found = controls.at(seconds)
    return None if found is None else {index: dict(names) for index, names in found.items()}


def velocities(controls: Controls, *moments: float) -> list[tuple[int, ...] | None]:
    found = [at(controls, moment) for moment in moments]
    return [values and tuple(names["velocity"] for names in values.values()) for values in found]


# -- constant ---------------------------------------------------------------------------------------------------------


def test_constant_values_stay() -> None:
    controls = Controls({F1: ("velocity", "gain"), F2: ("velocity",)}, {(F1, "velocity"): 20, (F1, "gain"): 10})
    expected = {F1: {"velocity": 20, "gain": 10}, F2: {"velocity": 0}}  # a velocity that is not given is 0
    assert [at(controls, seconds) for seconds in (0.0, 1.0, 1e6)] == [expected] * 3
    assert not controls.live


def test_a_gain_is_never_made_up() -> None:
    with pytest.raises(UsageError) as caught:
        Controls({F1: ("velocity",), F3: ("gain",)}, {})
    assert "F3" in caught.value.text and "--gain" in str(caught.value.hint)


@each_row(
    ("text", "motors", "expected"),
    [
        ("20", [0, 1, 3], {0: 20, 1: 20, 3: 20}),
        ("20,-127", [0, 3], {0: 20, 3: -127}),
        (" 20 , 5 ", [1, 2], {1: 20, 2: 5}),
        ("F1=20,F3=-5", [0, 1, 2], {0: 20, 2: -5}),
        ("spread=7", [3], {3: 7}),
        ("S=1,1=2", [0, 3], {3: 1, 0: 2}),
        ("0", [2], {2: 0}),
        ("+5", [2], {2: 5}),
    ],
)
def test_constant(text: str, motors: list[int], expected: dict[int, int]) -> None:
    assert constant(text, "velocity", motors) == {(index, "velocity"): value for index, value in expected.items()}


@each_row(
    "text",
    ["", "x", "1.5", "1,2,3", "F1=", "F1=1,5", "F3=1", "G=1", "128", "-128", "1_0", "0x10", "²", "1e2", "--5", "F1=1,F9=2",
     "9" * 5000],
)  # fmt: skip
def test_constants_that_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
        constant(text, "velocity", BOTH)


def test_motors_of_the_loop() -> None:
    assert [loop_motors(text) for text in (None, "124", "S1", "G", "21")] == [
        [0, 1, 2, 3], [0, 1, 3], [0, 3], [0, 1, 2], [0, 1],
    ]  # fmt: skip
    for text in ("", "5", "x", "12a"):
        with pytest.raises(UsageError):
            loop_motors(text)


# -- with times -------------------------------------------------------------------------------------------------------


def test_csv_with_times() -> None:
    """A value holds until the next one; the last row ends the loop."""
    controls = rows("t,velocity.F1,velocity.F2\n0.0,20,20\n1.5,0,-20\n2,,5\n")
    assert isinstance(controls, Schedule) and not controls.live
    assert controls.carries == {F1: ("velocity",), F2: ("velocity",)}
    assert velocities(controls, 0.0, 1.499, 1.5, 1.9) == [(20, 20), (20, 20), (0, -20), (0, -20)]
    assert velocities(controls, 2.0) in ([(0, 5)], [None])
    assert velocities(controls, 2.001) == [None]


def test_several_rows_at_once() -> None:
    """A slow line: what was due meanwhile is made up for, in order."""
    controls = rows("t,velocity\n0,1\n0.1,2\n0.2,3\n9,0\n")
    assert velocities(controls, 0.25, 8.9) == [(3, 3), (3, 3)]


def test_json_lines_are_the_same() -> None:
    text = (
        '{"t": 0, "velocity.F1": 20, "velocity.F2": 20}\n\n{"t": 1.5, "velocity.F1": 0, "velocity.2": -20}\n{"t": 2}\n'
    )
    assert velocities(rows(text), 0.0, 1.5) == [(20, 20), (0, -20)]


def test_comments_spaces_and_line_ends() -> None:
    text = "# a comment\r\n\r\n t , velocity.f1 , gain.1 \r\n 0 , +20 , 10 \r\n# more\r\n1,5,\r\n2,0,0"
    controls = rows(text.replace(" t ", "t"), [F1])
    assert at(controls, 0.0) == {F1: {"velocity": 20, "gain": 10}}
    assert at(controls, 1.0) == {F1: {"velocity": 5, "gain": 10}}


def test_a_name_without_a_motor_is_for_all() -> None:
    controls = rows("t,velocity,gain.F2\n0,-127,255\n1,0,0\n", [F1, F2])
    assert at(controls, 0.0) == {F1: {"velocity": -127}, F2: {"velocity": -127, "gain": 255}}


def test_what_the_options_give_is_the_start() -> None:
    controls = rows("t,velocity\n0,1\n1,2\n", [F1], {(F1, "gain"): 7})
    assert at(controls, 0.5) == {F1: {"velocity": 1, "gain": 7}}
    assert controls.carries == {F1: ("velocity", "gain")}


BAD = [
    ("", "in.csv"),
    ("\n\n# nothing\n", "in.csv"),
    ("t,velocity\n", "rows"),
    ("t,speed\n0,1\n", "line 1"),
    ("t,velocity.F3\n0,1\n", "line 1"),
    ("t,velocity.\n0,1\n", "line 1"),
    ("t,velocity\n0,1,2\n", "line 2"),
    ("t,velocity\n0,1\n1\n", "line 3"),
    ("t,velocity\n0,1\n\n1,x\n", "line 4"),
    ("t,velocity\n0,1\n1,1.5\n", "line 3"),
    ("t,velocity\n0,1\n1,128\n", "line 3"),
    ("t,velocity\n0,1\n1,-128\n", "line 3"),
    ("t,velocity,gain\n0,1,-1\n", "line 2"),
    ("t,velocity\n0,1\n-1,2\n", "line 3"),
    ("t,velocity\n0,1\nnan,2\n", "line 3"),
    ("t,velocity\n0,1\ninf,2\n", "line 3"),
    ("t,velocity\n1,1\n0.5,2\n", "before"),
    ("t,velocity\n0,1\n,2\n", "time"),
    ("velocity\n1\n", None),
    ('{"velocity": 1}\n{"t": 1, "velocity": 1}\n', None),
    ('{"t": 0, "velocity": 1\n', "line 1"),
    ('{"t": 0, "velocity": 1}\n[1]\n', "line 2"),
    ('{"t": 0, "velocity": 1}\n5\n', "line 2"),
    ('{"t": 0, "velocity": true}\n', "line 1"),
    ('{"t": 0, "velocity": 1.0}\n', "line 1"),
    ('{"t": 0, "velocity": null}\n', "line 1"),
    ('{"t": true, "velocity": 1}\n', "line 1"),
    ('{"t": [], "velocity": 1}\n', "line 1"),
    ('{"t": 0, "velocity.F1": 1}\n{"t": 1, "velocity.F2": 1}\n', "first row"),
    ('{"t": 0, "velocity": 1}\n' + "[" * 5000 + "\n", "line 2"),
    ('{"t": 0, "velocity": ' + "9" * 5000 + "}\n", "line 1"),
]


@each_row(("text", "word"), [(text, word) for text, word in BAD if word], ids=lambda text: repr(text)[:30])
def test_rows_that_are_refused_before_the_hand_is_touched(text: str, word: str) -> None:
    with pytest.raises(UsageError) as caught:
        rows(text)
    assert caught.value.exit_code == 2
    assert word in caught.value.text, caught.value.text
    assert "in.csv" in caught.value.text


LINES = ["t,velocity", "t,velocity.F1,gain.F1", "velocity", "0,1", "5,-20", "1.5,300", "7", "0,1,9", "# note", "",
         '{"t": 0, "velocity": 3}', '{"velocity.F1": 5}', '{"t": 2}']  # fmt: skip


@given(st.text('t,velocity.F12gan=0-9\n\r"{}: #', max_size=60) | st.lists(st.sampled_from(LINES)).map("\n".join))
@example("t,velocity\n0,1\n5,-20")
def test_any_text(text: str) -> None:
    """Rows or UsageError, nothing else."""
    try:
        controls = rows(text)
        for seconds in (0.0, 5.0, 50.0):
            values = controls.at(seconds)
            for names in (values or {}).values():
                assert all(-127 <= value <= 255 for value in names.values())
    except UsageError as exc:
        assert exc.text


@given(st.lists(st.tuples(st.floats(0, 100), st.integers(-127, 127)), min_size=1, max_size=20), st.floats(0, 120))
def test_any_schedule(points: list[tuple[float, int]], moment: float) -> None:
    """The value is that of the last row whose time has come; behind the last row it is over."""
    points.sort(key=lambda point: point[0])
    controls = rows("t,velocity\n" + "".join(f"{when!r},{value}\n" for when, value in points), [F1])
    due = [value for when, value in points if when <= moment]
    if moment < points[-1][0]:
        assert velocities(controls, moment) == [(due[-1] if due else points[0][1],)]
    else:
        controls.at(moment)
        assert controls.at(moment + 1e-9) is None


# -- live -------------------------------------------------------------------------------------------------------------


def live(*lines: str | BaseException) -> Live:
    """Live controls; whoever has the first row listens no further by itself."""

    def come() -> Iterator[str]:
        for line in lines:
            if isinstance(line, BaseException):
                raise line
            yield line

    controls = parse(come(), "stdin", BOTH, {})
    assert isinstance(controls, Live) and controls.live
    return controls


def test_live_lines_count_when_they_come() -> None:
    controls = live("velocity.F1,velocity.F2\n", "20,30\n", "0,\n", "1,2\n")
    assert velocities(controls, 0.0, 1.0) == [(20, 30), (20, 30)]  # nobody has listened yet
    assert velocities(controls, 1.01, 99.0) == [(0, 0), (0, 0)]  # too long: who controls may hang
    controls.listen()
    assert velocities(controls, 99.0) == [None]  # and here the input ends


def test_a_stale_live_line_keeps_its_gain_and_a_fresh_one_goes_on() -> None:
    controls = live("velocity.F1,gain.F1\n", "20,30\n", "5,\n")
    assert isinstance(controls, Live)
    controls._arrived.append({(0, "velocity"): 7})
    assert controls.at(3.0) == {0: {"velocity": 7, "gain": 30}, 1: {}}
    assert controls.at(4.5) == {0: {"velocity": 0, "gain": 30}, 1: {}}
    controls._arrived.append({(0, "velocity"): 9})
    assert controls.at(4.6) == {0: {"velocity": 9, "gain": 30}, 1: {}}


def test_a_live_line_is_taken_over_by_the_next_block() -> None:
    seen: list[list[tuple[int, ...] | None]] = []

    def come() -> Iterator[str]:
        yield from ("velocity.F1,velocity.F2\n", "20,30\n")
        for line in ("0,\n", ",-5\n", "7,8\n"):
            yield line
            seen.append(velocities(controls, 0.0, 1.0))  # the line before was handed over when this one is asked for

    controls = parse(come(), "stdin", BOTH, {})
    assert isinstance(controls, Live)
    controls.listen()
    assert seen == [[wanted, wanted] for wanted in ((0, 30), (0, -5), (7, 8))]
    assert velocities(controls, 0.0) == [None]


@each_row(
    ("line", "word"),
    [
        ("1,2,3\n", "line 3"),
        ("x,1\n", "line 3"),
        ("128,1\n", "line 3"),
        ("1,\r2\n", "line 3 is not CSV"),
        (OSError(5, "lost"), "read"),
    ],
)
def test_a_bad_live_line_ends_it(line: str | BaseException, word: str) -> None:
    controls = live("velocity.F1,velocity.F2\n", "20,30\n", line, "9,9\n")
    controls.listen()
    with pytest.raises(UsageError) as caught:
        controls.at(0.0)
    assert word in caught.value.text


def test_a_live_line_cannot_change_the_blocks() -> None:
    controls = live('{"velocity.F1": 5}\n', '{"velocity.F2": 5}\n')
    controls.listen()
    with pytest.raises(UsageError, match="first row"):
        controls.at(0.0)


def test_live_lines_without_a_first_one_are_refused() -> None:
    for lines in ([], ["velocity\n"], ["velocity\n", "x\n"]):
        with pytest.raises(UsageError):
            parse(lines, "stdin", BOTH, {})


def test_rows_with_times_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe may have more of them without end."""
    monkeypatch.setattr("handctl.devices.barrett.realtime.control_values.MOST_ROWS", 3)
    endless = ("1,20\n" for _ in count())
    with pytest.raises(UsageError, match="more than 3 rows"):
        parse(chain(["t,velocity\n"], endless), "in.csv", BOTH, {})
