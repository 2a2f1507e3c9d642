"""The one watcher of a movement, fed with readings: when it has ended, and what became of each axis."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from handctl.errors import UsageError
from handctl.model.movement import Arrival, AxisReading, Goal, Stillness, Watch, by_whom, failure_of_arrivals
from handctl.model.param import given
from tests.support.each_row import each_row

STILL = Stillness(samples=3, seconds=0.2)
GOAL = Goal("a", 100, near=5)


def fed(goal: Goal, still: Stillness, *values: AxisReading | int | None, period: float = 0.1) -> tuple[list[bool], str]:
    """Whether the movement had ended behind each reading, and the verdict behind the last."""
    watch = Watch([goal], still, 0.0)
    seen = [one if isinstance(one, AxisReading) else AxisReading(one) for one in values]
    ended = [watch.note(number * period, {"a": one}) for number, one in enumerate(seen)]
    return ended, watch.arrivals()[0].verdict


@each_row(
    ("values", "ended", "verdict"),
    [
        ((0, 50, 100, 100, 100), [False] * 4 + [True], "reached"),
        ((90, 100, 110), [False] * 3, "moving"),  # it passes by its target
        ((50, 100), [False] * 2, "moving"),
        ((0, 97, 97, 97), [False, False, False, True], "reached"),
        ((0, 94, 94, 94), [False, False, False, True], "short"),
        ((0, 50, 60), [False, False, False], "moving"),
        ((0, 50, 50), [False, False, False], "moving"),
        ((50,), [False], "moving"),  # one reading shows no rest
        ((97,), [False], "reached"),
        ((50, AxisReading(60, blocked="hot"), AxisReading(70, blocked="hot")), [False] * 3, "moving"),
        ((None, None), [False, False], "unread"),
        ((50, AxisReading(50, blocked="locked")), [False, True], "blocked"),
        (
            (50, AxisReading(50, moves=False), AxisReading(50, moves=False, contact="it pushes")),
            [False, False, True],
            "contact",
        ),
        ((50, AxisReading(50, moves=True), AxisReading(50, moves=True)), [False, False, True], "unmoved"),
        ((101, 99, 101, 99), [False] * 4, "moving"),  # near, but it does not stand
    ],
)
def test_when_an_axis_has_ended(values: tuple[AxisReading | int | None, ...], ended: list[bool], verdict: str) -> None:
    assert fed(GOAL, STILL, *values) == (ended, verdict)


@each_row(
    ("goal", "still", "values", "ended", "verdict"),
    [
        (GOAL._replace(speed=0), STILL, (50, 50, 50), [False, False, True], "no-speed"),
        (GOAL._replace(speed=0), STILL, (50, 60), [False, False], "moving"),
        (GOAL._replace(patience=0.5), STILL, (50, 50, 50, 50, 50, 50), [False] * 5 + [True], "unmoved"),
        (GOAL._replace(jitter=2), STILL, (101, 99, 101), [False, False, True], "reached"),
        (GOAL, STILL._replace(samples=9, seconds=0.15), (97, 97, 97), [False, False, True], "reached"),  # a slow line
        (GOAL, STILL._replace(dead=0.15), (100, 100, 100), [False, False, True], "reached"),
        (GOAL, STILL._replace(least=0.35), (97, 97, 97, 97, 97), [False] * 4 + [True], "reached"),
        (GOAL, STILL._replace(grace=0.35), (50, 50, 50, 50, 50), [False] * 4 + [True], "unmoved"),
        (GOAL, STILL._replace(grace=0.35), (97, 97, 97), [False, False, True], "reached"),
        # short of the target the longer time counts, whether it has begun or pauses, unless the device reports why
        (GOAL, STILL._replace(short=0.45), (50, 50, 50, 50, 50, 50), [False] * 5 + [True], "unmoved"),
        (GOAL, STILL._replace(short=0.45), (50, 50, 50, 50), [False] * 4, "moving"),
        (GOAL, STILL._replace(short=0.45), (10, 50, 50, 50, 50, 60), [False] * 6, "moving"),
        (GOAL, STILL._replace(short=0.45), (97, 97, 97), [False, False, True], "reached"),
        (GOAL._replace(speed=0), STILL._replace(short=0.45), (50, 50, 50), [False, False, True], "no-speed"),
        (
            GOAL,
            STILL._replace(short=0.45),
            (10, *[AxisReading(50, moves=False)] * 3),
            [False] * 3 + [True],
            "short",
        ),
        (GOAL, STILL._replace(short=0.45), [AxisReading(50, moves=False)] * 4, [False] * 4, "moving"),
        (GOAL, STILL._replace(least=0.35), (100, 100, 100), [False, False, True], "reached"),
    ],
)
def test_what_a_family_knows_of_its_movements(
    goal: Goal, still: Stillness, values: Sequence[AxisReading | int], ended: list[bool], verdict: str
) -> None:
    assert fed(goal, still, *values) == (ended, verdict)


def test_what_was_read_once_more_counts() -> None:
    """A fault counts for each of them: also for one that moves on."""
    watch = Watch([GOAL, GOAL._replace(name="b")], STILL, 0.0)
    for now in (0.0, 0.1, 0.2):
        watch.note(now, {"a": AxisReading(50), "b": AxisReading(100)})
    assert watch.short == ["a"] and not watch.reached
    deeper = dict.fromkeys("ab", AxisReading(None, blocked="hot"))
    assert [(one.verdict, one.why) for one in watch.arrivals(deeper)] == [("blocked", "hot")] * 2
    watch.note(0.3, {"a": AxisReading(60), "b": AxisReading(101)})
    assert [(one.verdict, one.why) for one in watch.arrivals(deeper)] == [("moving", "hot")] * 2


@each_row(
    ("start", "rest", "now", "verdict"),
    [
        (0, (10, 10), AxisReading(50, currents=(10, 210)), "contact"),
        (0, (10, 10), AxisReading(50, currents=(10, -210)), "contact"),
        (0, (10, 10), AxisReading(50, currents=(10, 199)), "short"),
        (0, (10, 150), AxisReading(50, currents=(10, 249)), "short"),
        (0, (111, 222), AxisReading(50, currents=(111, 222)), "short"),
        (0, (222, 111), AxisReading(50, currents=(111, 222)), "contact"),  # each by itself
        (0, (), AxisReading(50, currents=(900, 900)), "short"),  # what it drew at rest is not known
        (0, (0, 0), AxisReading(106, currents=(900, 0)), "astray"),
        (0, (0, 0), AxisReading(105), "reached"),
        (60, (0, 0), AxisReading(54, contact="force reached"), "astray"),
        (60, (0, 0), AxisReading(55, contact="force reached"), "contact"),
        (None, (), AxisReading(106), "short"),
    ],
)
def test_what_counts_as_contact_or_short(
    start: int | None, rest: tuple[int, ...], now: AxisReading, verdict: str
) -> None:
    """Against what was read before the movement, where that is known. A push is 200 here."""
    before = {"a": AxisReading(start, currents=rest)}
    watch = Watch([GOAL], STILL._replace(pushing=200), 0.0, before)
    for number in range(4):
        watch.note(number * 0.1, {"a": now if number else AxisReading(now.value and now.value - 7)})
    assert watch.arrivals({"a": now})[0].verdict == verdict


@each_row(
    ("start", "direct", "verdict"),
    [
        (0, True, "short"),
        (46, True, "short"),
        (48, True, "unmoved"),  # as a resting one
        (None, True, "unmoved"),
        (60, True, "astray"),
        (60, False, "short"),
    ],
)
def test_what_was_over_before_the_first_reading_has_moved(start: int | None, direct: bool, verdict: str) -> None:
    """It was commanded long before, as by a ramp, or was quick."""
    watch = Watch([GOAL._replace(jitter=3, direct=direct)], STILL, 0.0, {"a": AxisReading(start)})
    for number in range(4):
        watch.note(number * 0.1, {"a": AxisReading(50)})
    assert watch.arrivals()[0].verdict == verdict


@each_row(
    ("told", "why"),
    [(None, ""), (100, "its target is unchanged, so it does not obey, or something else moves it"), (40, "its target is 40 now, so another program is commanding it")],
)  # fmt: skip
def test_by_whose_target_an_axis_went_astray(told: int | None, why: str) -> None:
    assert by_whom(Arrival(GOAL, 120, "astray"), told).why == why


@each_row(
    ("verdicts", "codes"),
    [
        # what is expected, in the order reached, contact, any -> the code of the failure
        (("reached", "reached"), (None, "no-contact", None)),
        (("reached", "contact"), ("not-reached", None, None)),
        (("contact", "short"), ("not-reached", "not-reached", None)),
        (("contact", "blocked"), ("blocked", "blocked", "blocked")),
        (("contact", "moving"), ("still-moving",) * 3),
        (("short", "no-speed"), ("no-speed",) * 3),
        (("reached", "unmoved"), ("not-reached",) * 3),  # a movement that never began has no end
        (("reached", "unread"), ("unread",) * 3),
        (("blocked", "astray"), ("astray",) * 3),
    ],
)
def test_what_is_expected(verdicts: tuple[str, ...], codes: tuple[str | None, ...]) -> None:
    arrivals = [Arrival(Goal(name, 100), 50, verdict) for name, verdict in zip("ab", verdicts, strict=True)]
    for expect, code in zip(("reached", "contact", "any"), codes, strict=True):
        failure = failure_of_arrivals("here", arrivals, expect)
        assert (failure.code if failure else None) == code, expect
        assert failure is None or failure.exit_code == (6 if code == "astray" else 7)


def test_a_movement_without_a_target_ends_where_it_meets_something() -> None:
    stalled = [Arrival(Goal("a", None), 50, "contact")]
    assert [failure_of_arrivals("here", stalled, expect) for expect in ("reached", "contact", "any")] == [None] * 3


NAMES = ("little", "ring", "index")


@each_row(
    ("texts", "found"),
    [
        (("1", "2", "3"), {0: "1", 1: "2", 2: "3"}),
        (("-1", "2", "-1"), {0: "-1", 1: "2", 2: "-1"}),
        (("index=7", "RING=-3"), {1: "-3", 2: "7"}),
    ],
)
def test_a_vector_in_order_or_by_name(texts: tuple[str, ...], found: dict[int, str]) -> None:
    assert given(texts, NAMES, what="it") == found


@each_row(
    ("texts", "code"),
    [
        (("1", "2"), "wrong-count"),
        (("1", "2", "3", "4"), "wrong-count"),
        (("index=7", "2"), "mixed"),
        (("index=7", "index=8"), "twice"),
        (("thumb=7",), "unknown-name"),
        (("--wiat", "5", "1"), "usage"),
    ],
)
def test_what_is_no_vector(texts: tuple[str, ...], code: str) -> None:
    with pytest.raises(UsageError) as caught:
        given(texts, NAMES, what="it")
    assert caught.value.code == code


@each_row(
    ("texts", "next_step"),
    [(("ring", "7"), "ring=7"), (("Ring", "7", "index", "3"), "Ring=7 index=3"), (("index",), "index=VALUE")],
)
def test_a_name_and_its_value_need_an_equals_sign(texts: tuple[str, ...], next_step: str) -> None:
    with pytest.raises(UsageError) as caught:
        given(texts, NAMES, what="it")
    assert (caught.value.code, next_step in caught.value.hint) == ("wrong-count", True)


def test_several_orders_of_a_whole_vector() -> None:
    assert given(("1", "2"), NAMES, what="it", orders=[(0, 1, 2), (0, 2)]) == {0: "1", 2: "2"}
