"""Current control of the AIDIN-hand: the ramps, and that every way out takes the currents to 0 and stops."""

from __future__ import annotations

import itertools

import pytest

from handctl.devices.aidin.exchange_settings import ExchangeMode, ExchangeSettings
from handctl.devices.aidin.motion import Goal, currents, parse
from handctl.devices.aidin.parameter_map import CURRENTS
from handctl.errors import CheckFailed, HandctlError, Interrupted, NoAnswer, ProtocolError
from handctl.model.prompts import Prompts
from tests.aidin.support import (  # fmt: skip
    AT_ORIGIN,
    STOP,
    Content,
    Notes,
    Streamer,
    feedback,
    hand_on,
    line,
    objects,
    poller,
    simulated,
    stopped_behind,
    streamer,
)
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import RecordedLink, ScriptedLink

STILL: Content = {**AT_ORIGIN, "current_state": [0] * 15}
WHOLE = ["0"] * 5 + ["100"] + ["0"] * 9


def goal(*texts: str) -> Goal:
    return parse(CURRENTS, texts or ["index.m3=100"])


def flow(sent: list[bytes]) -> list[int]:
    """What index.m3 was told, object by object."""
    return [data["hand_TT_cmd"][5] for data in objects(sent) if data["hand_mode"] == 41]  # type: ignore[index]


def steps(values: list[int]) -> int:
    return max(abs(b - a) for a, b in itertools.pairwise(values))


def test_currents() -> None:
    hand, link = simulated(start="homed")
    table = currents(hand, goal(*WHOLE), Prompts(), seconds=1.0, cap=300)
    sent = objects(link.sent)
    modes = [data["hand_mode"] for data in sent]
    assert list(dict.fromkeys(modes)) == [5, 41, 3]
    assert {data["maxtorque"] for data in sent if data["hand_mode"] == 5} == {1000}
    told = flow(link.sent)
    assert told[0] == 4 and max(told) == 100 and told[-1] == 0
    assert steps(told) <= 4  # 200 a second
    assert 50 <= told.count(100) <= 55
    assert modes[-3:] == [3, 3, 3]
    assert len(table.rows) == 15 and all("target" in row for row in table.rows)


@pytest.mark.parametrize("after", [0.5, 1.0, 1.9])
def test_interrupted_currents_go_back_to_0_where_that_was_asked_for(after: float) -> None:
    hand, link = simulated(start="homed")
    link.interrupt_at = link.now() + after
    prompts = Notes()
    with pytest.raises(Interrupted):
        currents(hand, goal(), prompts, seconds=1.0, cap=300, ramp_down=True)
    told = flow(link.sent)
    assert told[-1] == 0 and steps(told) <= 8  # the object that was being sent may be left out
    assert 4 <= max(told) <= 100
    assert b'"hand_mode":41' in stopped_behind(link.sent)
    assert any("Press Ctrl-C again to stop" in text for text in prompts.lines)


def test_interrupted_currents_are_stopped_at_once() -> None:
    """No ramp, unless it was asked for: the stop mode is the next object."""
    hand, link = simulated(start="homed")
    link.interrupt_at = pressed = link.now() + 1.0
    with pytest.raises(Interrupted) as caught:
        currents(hand, goal(), Prompts(), seconds=1.0, cap=300)
    told = flow(link.sent)
    assert told[-1] == max(told) == 100
    assert b'"hand_mode":41' in stopped_behind(link.sent)
    assert link.sent_at[link.sent.index(STOP)] - pressed < 0.05
    assert caught.value.exit_code == 130


def test_interrupted_before_any_current_flows() -> None:
    hand, link = simulated(start="homed")
    link.interrupt_at = link.now() + 0.1
    with pytest.raises(Interrupted):
        currents(hand, goal(), Prompts(), seconds=1.0, cap=300)
    assert set(flow(link.sent)) <= {0}
    stopped_behind(link.sent)


class Twice(RecordedLink):
    """Ctrl-C, and another one 0.1 s later."""

    def _check(self) -> None:
        if self.inner.now() >= self.interrupt_at:
            self.interrupt_at = self.inner.now() + 0.1 if self.interrupt_at < 1.0 else float("inf")
            raise KeyboardInterrupt


def test_interrupted_twice_stops_at_once() -> None:
    _, link = simulated(start="homed")
    twice = Twice(link)
    twice.interrupt_at = 0.9
    with pytest.raises(Interrupted):
        currents(hand_on(twice), goal(), Prompts(), seconds=1.0, cap=300, ramp_down=True)
    told = flow(twice.sent)
    assert max(told) > 60 and 40 < told[-1] < max(told)
    stopped_behind(twice.sent)


def test_currents_that_lose_feedback_are_stopped() -> None:
    good = line(STILL)
    link = Streamer(lambda t: good if t < 0.8 else b"\n")
    with pytest.raises(HandctlError) as caught:
        currents(hand_on(link), goal(), Prompts(), seconds=5.0, cap=300)
    assert link.sent[-3:] == [STOP] * 3
    assert caught.value.exit_code == 4


def test_currents_that_are_kept_stay_below_the_cap() -> None:
    link = streamer(feedback(current_state=[301] + [0] * 14))
    with refused(CheckFailed, "beyond-cap", "thumb.m1 301"):
        currents(hand_on(link), goal(), Prompts(), seconds=1.0, cap=300)
    assert link.sent == []


COMMANDED = ExchangeSettings(exchange=ExchangeMode.COMMAND)


def test_a_hand_that_answers_commands_needs_the_whole_vector() -> None:
    link = poller(STILL)
    with pytest.raises(NoAnswer, match="that you did not give are unknown"):
        currents(hand_on(link, way=COMMANDED), goal(), Prompts(), seconds=0.1, cap=300)
    assert link.sent == []
    hand, recorded = simulated(start="homed", exchange="command")
    hand.conversation.way = COMMANDED
    table = currents(hand, goal(*WHOLE), Prompts(), seconds=0.3, cap=300)
    assert table.failure is None
    assert b"{}\n" not in recorded.sent


@each_row("content", [None, {**STILL, "current_state": [0] * 14}], ids=["mute", "damaged"])
def test_nothing_flows_unless_currents_are_told(content: Content | None) -> None:
    """Maximum torque has been set then, and nothing else."""
    link = ScriptedLink() if content is None else poller(content)
    with pytest.raises((NoAnswer, ProtocolError)):
        currents(hand_on(link, way=COMMANDED), goal(*WHOLE), Prompts(), seconds=0.3, cap=300)
    assert {data["hand_mode"] for data in objects(link.sent)} == {5, 3}
    assert link.sent[-3:] == [STOP] * 3


def test_currents_that_still_flow_behind_the_stop_are_told() -> None:
    """The hand is asked after the stop, not believed: what it says then is what is shown."""
    flowing: Content = {**AT_ORIGIN, "current_state": [0] * 5 + [100] + [0] * 9}
    hand = hand_on(Streamer(lambda _t: line(flowing)))
    currents(hand, goal(*WHOLE), Prompts(), seconds=0.2, cap=300)
    told = {message.code: message.text for message in hand.journal.messages}
    assert "currents up to 100" in told["not-stopped"] and "stopped" not in told, told
