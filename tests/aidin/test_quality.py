"""The quality of what an AIDIN-hand sends, key by key: one bad number hides no other, and nothing that was bad is lost sight of."""

from __future__ import annotations

import csv
import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from handctl.devices.aidin.exchange_settings import ExchangeMode
from handctl.devices.aidin.parameter_map import FEEDBACK
from handctl.errors import ProtocolError
from handctl.link import ByteLink
from tests.aidin.support import Content, Streamer, feedback, hand_on, line, poller, streamer
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink

POLL = b"{}\n"
KEYS = [param.key for param in FEEDBACK]
ODD = [math.nan, math.inf, -math.inf, None, "1", True, [], 10**400]


def with_odd(key: str, place: int, odd: object) -> Content:
    content = feedback()
    array = list(content[key])  # type: ignore[call-overload]
    array[place] = odd
    return {**content, key: array}


@each_row("odd", ODD, ids=lambda odd: repr(odd)[:8])
@each_row("param", FEEDBACK, ids=lambda param: param.key)
@each_row("polled", [False, True])
def test_one_bad_number_is_its_own_error(param: object, odd: object, polled: bool) -> None:
    """Each other number of the array is shown; the bad one is named as `get` takes it."""
    for place in (0, param.count // 2, param.count - 1):  # type: ignore[attr-defined]
        content = with_odd(param.key, place, odd)  # type: ignore[attr-defined]
        hand = hand_on(poller(content) if polled else streamer(content))
        rows = hand.dump().rows
        (bad,) = [row for row in rows if "error" in row]
        element = param.each[place]  # type: ignore[type-var]
        assert (bad["finger"], bad["element"]) == tuple(element.part.split("."))
        assert element.full_name in bad["error"]
        assert len(rows) == 95


@each_row("number", [1e308, -1e308, 1.7e308, 10**307])
def test_an_angle_that_is_finite_in_radians_alone_is_refused(number: float) -> None:
    """It is infinite in degrees. Two that make a sum of 0 are as bad."""
    content = feedback()
    angles = list(content["joint_pos"])  # type: ignore[call-overload]
    angles[4:6] = [number, -number]
    rows = hand_on(streamer({**content, "joint_pos": angles})).dump().rows
    assert [f"{row['finger']}.{row['element']}" for row in rows if "error" in row] == ["index.q1", "index.q2"]
    with pytest.raises(ProtocolError, match="not finite") as caught:
        hand_on(streamer({**content, "joint_pos": angles})).conversation.need(FEEDBACK[1])
    assert caught.value.exit_code == 5


def test_a_command_does_not_drive_by_an_array_with_a_bad_number() -> None:
    hand = hand_on(streamer(with_odd("motor_pos", 7, math.nan)))
    with pytest.raises(ProtocolError, match=r"middle\.m2.*not finite"):
        hand.conversation.need(FEEDBACK[0])


def test_a_key_that_comes_twice_in_one_object_is_damage() -> None:
    """Which of the two is right, nobody knows."""
    good = line(feedback())
    twice = good.replace(b'{"motor_pos"', b'{"motor_pos":[1],"motor_pos"', 1)
    assert json.loads(twice)["motor_pos"] == feedback()["motor_pos"]
    said = iter([good, twice])
    link = Streamer(lambda _t: next(said, good))
    hand = hand_on(link)
    hand.dump()
    link.sleep(0.1)
    hand.dump()
    assert hand.journal.counters.bad_frames == 1
    with pytest.raises(ProtocolError, match=r"motor_pos.* twice"):
        hand_on(streamer_of(lambda _t: twice)).dump()


def streamer_of(content: Callable[[float], bytes], period: float = 0.01) -> Streamer:
    return Streamer(content, period)


def test_what_was_bad_now_and_then_is_counted_key_by_key() -> None:
    """A third of the objects has a bad number in one key, a fifth lacks another."""
    bad, lacks = line(with_odd("sensor_state", 20, math.nan)), feedback()
    del lacks["joint_pos"]
    number = 0

    def content(_t: float) -> bytes:
        nonlocal number
        number += 1
        return bad if number % 3 == 0 else line(lacks) if number % 5 == 0 else line(feedback())

    link = Streamer(content)
    hand = hand_on(link)
    for _ in range(20):
        assert hand.dump().failure is None
        link.sleep(0.05)
    hand.conversation.drain()
    counters = hand.journal.counters.as_row()
    keys = counters["keys"]
    assert keys["sensor_state"]["bad"] == counters["bad"] == number // 3
    assert keys["joint_pos"]["missing"] == counters["missing"] == number // 5 - number // 15
    assert counters["received"] == number
    for key in KEYS:  # what was neither bad nor missing was shown, or it is counted as skipped
        found = keys[key]
        assert found["skipped"] >= number - 20 - found["bad"] - found["missing"] - 12


@each_row("hertz", [1, 2, 3, 5])
@each_row("phase", [0.0, 0.31, 0.55, 0.85])
def test_a_slow_stream_is_read_and_known_for_one(hertz: int, phase: float) -> None:
    """Whatever an empty object seems to have been answered with: what comes unasked is a stream."""
    link = Streamer(lambda _t: line(feedback()), 1 / hertz)
    link._next = phase / hertz
    hand = hand_on(link)
    assert hand.status(check=False).failure is None
    (how,) = [entry.text for entry in hand.journal.messages if entry.code == "exchange"]
    assert "streams" in how
    for _ in range(5):
        assert hand.dump().failure is None
    assert hand.conversation.exchange is ExchangeMode.STREAM


def test_a_hand_that_answers_is_not_asked_again_to_find_out() -> None:
    """What the first answer told is what is shown: no second exchange, and no wait."""
    link = poller(feedback())
    hand_on(link).dump()
    assert link.sent == [POLL]
    assert link.clock < 0.5


def test_another_server_is_shown_with_what_it_says() -> None:
    """It is JSON, and not ours coming back."""
    said = line({"error": "motor fault"})
    empty = line({})
    with pytest.raises(ProtocolError) as caught:
        hand_on(streamer_of(lambda _t: empty, 0.1)).dump()  # type: ignore[arg-type]
    assert caught.value.came == b"{}", "an empty object that came before anything was sent is no echo"
    links: list[ByteLink] = [streamer_of(lambda _t: said, 0.1), ScriptedLink(lambda _request: [(0.01, said)])]
    for link in links:
        with pytest.raises(ProtocolError) as caught:
            hand_on(link).dump()  # type: ignore[arg-type]
        assert "motor fault" in caught.value.text and "echo" not in caught.value.hint
        assert "a report from the hand itself" in caught.value.hint
        assert caught.value.came == said.strip()


def test_a_quantity_that_cannot_be_read_does_not_end_with_0() -> None:
    """Whatever else could be read beside it."""
    link = "fake://aidin?clock=virtual&start=homed&fault=wrong-length"
    done = run("aidin", "watch", "--count", "2", "--json", "-p", link)
    rows, end = done.stream
    assert done.code == 5 and end["stream"]["samples"] == 2 and len(rows) > 10
    assert end["counters"]["keys"]["motor_pos"]["bad"] > 0


def test_a_hand_whose_every_object_is_damaged_is_told_what_is_wrong_with_it() -> None:
    twice = line(feedback()).replace(b'{"motor_pos"', b'{"motor_pos":[1],"motor_pos"', 1)
    with pytest.raises(
        ProtocolError,
        match=r"feedback, but not as the manual describes \(an object that contains 'motor_pos' twice\): ",
    ):
        hand_on(ScriptedLink(lambda _: [(0.01, twice)])).dump()


@pytest.mark.parametrize(("options", "step"), [("merge=5", 100), ("objects=separate", 100), ("rate=400&merge=10", 25)])
def test_a_log_has_a_row_for_each_object_of_a_stream(options: str, step: int, tmp_path: Path) -> None:
    """An encoder that loses 10,000 counts a second shows an object that was passed over, however many came at once."""
    link = f"fake://aidin?clock=virtual&start=homed&fault=creep&motor=0&creep=10000&{options}"
    path = tmp_path / "a.csv"
    done = run("aidin", "log", path, "motor_pos.thumb.m1", "--count", "60", "-p", link, "--json")
    assert (done.code, done.rows[0]["rows"]) == (0, 60), done
    places = [int(row["motor_pos.thumb.m1_cts"]) for row in csv.DictReader(path.open(encoding="utf-8", newline=""))]
    assert {before - after for before, after in itertools.pairwise(places)} == {step}
    counted = json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))["counters"]["keys"]
    assert counted["motor_pos"] == {"bad": 0, "missing": 0, "skipped": 0}


def test_a_log_with_a_rate_takes_the_newest_object(tmp_path: Path) -> None:
    link = "fake://aidin?clock=virtual&start=homed&fault=creep&motor=0&creep=10000"
    path = tmp_path / "a.csv"
    assert run("aidin", "log", path, "motor_pos.thumb.m1", "--count", "10", "--rate", "10", "-p", link).code == 0
    places = [int(row["motor_pos.thumb.m1_cts"]) for row in csv.DictReader(path.open(encoding="utf-8", newline=""))]
    assert {before - after for before, after in itertools.pairwise(places)} <= {900, 1000, 1100}


@pytest.mark.parametrize(("fault", "code"), [("not-json", 5), ("unclosed", 0), ("extra-key", 0), ("silent", 4)])
def test_a_log_of_a_stream_that_turns_to_other_data_ends(fault: str, code: int, tmp_path: Path) -> None:
    link = f"fake://aidin?clock=virtual&start=homed&fault={fault}&after=20"
    done = run("aidin", "log", tmp_path / "a.csv", "--count", "40", "--silence", "5", "-p", link, "--json")
    assert done.code == code and done.rows[0]["rows"] >= 15, done


def test_objects_that_are_cut_off_are_damage_and_no_other_form() -> None:
    """Their keys are the manual's: the line has lost the rest."""
    result = run("aidin", "get", "joint_pos", "-p", "fake://aidin?clock=virtual&start=homed&fault=truncate", "--json")
    assert (result.code, result.error["code"]) == (5, "bad-json")
