"""AIDIN-hand at the edges: damage counted to three, the user's own silence, objects without an end, stop proved afresh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

from handctl.devices.aidin import device, homing_and_bias, motion
from handctl.devices.aidin.conversation import LISTEN_LONGEST
from handctl.devices.aidin.motion import currents, parse
from handctl.devices.aidin.parameter_map import CURRENTS, ENCODERS
from handctl.errors import CheckFailed, Interrupted, NoAnswer, ProtocolError, UsageError
from handctl.link import Deadline
from handctl.model.prompts import InterruptCount, Prompts
from tests.aidin.support import (
    STOP,
    Streamer,
    feedback,
    hand_on,
    line,
    objects,
    poller,
    simulated,
    stopped,
    stopped_behind,
    streamer,
)
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import ScriptedLink

DAMAGED = b'{"motor_pos":[nope]}\n'


@each_row("count", [2, 3])
def test_three_damaged_objects_in_a_row_end_it_and_two_do_not(count: int) -> None:
    link = ScriptedLink()
    link.put(0.0, line(feedback()) + DAMAGED * count)
    conversation = hand_on(link).conversation
    if count < 3:
        conversation.connect()
        assert conversation.feedback.complete()
    else:
        with refused(ProtocolError, "bad-json", "3 corrupted objects") as caught:
            conversation.connect()
        assert caught.value.code == "bad-json"
    assert conversation.journal.counters.bad_frames == count


def test_damage_that_is_not_in_a_row_does_not_add_up() -> None:
    link = ScriptedLink()
    link.put(0.0, (DAMAGED * 2 + line(feedback())) * 4)
    conversation = hand_on(link).conversation
    conversation.connect()
    assert (conversation.journal.counters.bad_frames, conversation.journal.counters.received) == (8, 4)


@pytest.mark.parametrize("timeout", [None, 0.3])
def test_a_stream_that_stops_while_something_moves_is_told_after_the_timeout(timeout: float | None) -> None:
    link = Streamer(lambda t: line(feedback()) if t <= 1.0 else b"")
    conversation = hand_on(link, timeout=timeout).conversation
    conversation.connect()
    with refused(NoAnswer, "no-answer"):
        for _ in range(200):
            conversation.tick(STOP.strip())
    assert link.clock - 1.0 == pytest.approx(timeout or 1.0, abs=0.05)


def test_an_object_without_an_end_is_not_listened_to_for_ever() -> None:
    begin = b'{"motor_pos":['
    link = Streamer(lambda t: begin if t == 0 else b"1")
    with pytest.raises(ProtocolError):
        hand_on(link).dump()
    assert LISTEN_LONGEST <= link.clock <= LISTEN_LONGEST + 0.1
    assert link.sent == []


def test_an_answer_without_an_end_is_not_waited_for_for_ever() -> None:
    begin = b'{"motor_pos":['
    link = Streamer(lambda _t: b"" if not link.sent else b"1" if said else said.append(1) or begin)
    said: list[int] = []
    with pytest.raises(ProtocolError, match="7B 22 6D 6F 74") as caught:
        hand_on(link, retries=0).dump()
    assert caught.value.exit_code == 5, "something came"
    assert link.sent == [b"{}\n"]
    assert link.clock <= 0.3 + LISTEN_LONGEST + 0.1


@each_row("retries", [0, 2])
def test_a_polled_hand_that_falls_silent_gets_one_object_more_than_retries(retries: int) -> None:
    link = poller(lambda request: None if request == STOP else feedback())
    conversation = hand_on(link, retries=retries).conversation
    conversation.connect()
    with refused(NoAnswer, "no-answer"):
        for _ in range(20):
            conversation.tick(STOP.strip())
    assert link.sent.count(STOP) == 1 + retries


def test_a_bug_of_ours_while_something_moves_stops_the_hand() -> None:
    link = streamer()
    with pytest.raises(ZeroDivisionError), device.stopped_if_cut_short(hand_on(link), Prompts()):
        raise ZeroDivisionError
    assert len(link.sent) > 3 and set(link.sent) == {STOP}


def test_currents_told_before_the_stop_do_not_confirm_it() -> None:
    link = Streamer(lambda _t: b"" if STOP in link.sent else line(feedback(current_state=[0] * 15)))
    hand = hand_on(link)
    hand.conversation.connect()
    assert "is not confirmed" in stopped(link).text
    assert set(link.sent) == {STOP} and len(link.sent) > 3, "and it was sent on"


def test_currents_that_never_flowed_confirm_nothing() -> None:
    told = stopped(streamer(feedback(current_state=[0] * 15)))
    assert told.error is None and told.evidence == ""


class Watched(Prompts):
    """Knows whether Ctrl-C waits at the moment."""

    waits = False

    @contextmanager
    def without_interrupts(self) -> Iterator[None]:
        self.waits = True
        try:
            yield
        finally:
            self.waits = False


def test_a_second_ctrl_c_waits_until_stop_is_sent() -> None:
    link, prompts = streamer(feedback()), Watched()
    write, waited = link.write, []

    def note(data: bytes, deadline: Deadline) -> None:
        if data == STOP:
            waited.append(prompts.waits)
        write(data, deadline)

    link.write = note  # type: ignore[method-assign]
    with pytest.raises(Interrupted), device.stopped_if_cut_short(hand_on(link), prompts):
        raise KeyboardInterrupt
    assert len(waited) > 3 and all(waited)


# -- what counts as arrived -------------------------------------------------------------------------------------------


def after_command(after: Sequence[bytes]) -> Streamer:
    """A hand that stands at index.m2 = 5000; once it is sent there it says `after`, the last of it for ever."""
    there = line(feedback(motor_pos=[1000 * n if n != 4 else 5000 for n in range(15)]))
    said = iter(after)

    def content(_t: float) -> bytes:
        return next(said, after[-1]) if any(b"5000" in data for data in link.sent) else there

    link = Streamer(content)
    return link


def test_what_was_told_before_the_end_of_the_ramp_is_no_arrival() -> None:
    link = after_command([b""])
    hand = hand_on(link)
    with refused(NoAnswer, "no-answer") as caught:
        motion.move(hand, parse(ENCODERS, ["index.m2=5000"]), Prompts(), assume_homed=True)
    assert "no stop was sent" in caught.value.hint
    assert "reached" not in [message.code for message in hand.journal.messages]


def test_a_key_that_has_gone_bad_is_no_arrival() -> None:
    there = line(feedback(motor_pos=[1000 * n if n != 4 else 5000 for n in range(15)]))
    hand = hand_on(after_command([there, there, there, line(feedback(motor_pos=[0] * 14))]))
    with pytest.raises(ProtocolError, match="motor_pos"):
        raise (
            motion.move(hand, parse(ENCODERS, ["index.m2=5000"]), Prompts(), assume_homed=True).failure
            or AssertionError
        )
    assert "reached" not in [message.code for message in hand.journal.messages]


@pytest.mark.parametrize("period", [0.02, 0.25])
def test_the_initial_position_is_not_reached_before_the_motors_stand(period: float) -> None:
    """Within 1 % of the origin, but still on the way through it: of a slow stream two readings show that, not one twice."""
    link = Streamer(lambda t: line(feedback(motor_pos=[max(0, round(4000 * (0.6 - t)))] * 15)), period)
    table = homing_and_bias.initial(hand_on(link), Prompts(), assume_homed=True)
    assert {row["value"] for row in table.rows} == {0}
    assert link.sent_at[-1] > 0.6


def test_counts_are_rounded_not_cut() -> None:
    goal = parse(ENCODERS, ["index.m2=5000"])
    assert goal.wire([999.6, 0.4, 1000.0] * 5) == (1000, 0, 1000) * 5


# -- currents beyond the cap --------------------------------------------------------------------------------------------


def test_the_cap_holds_for_negative_currents_too() -> None:
    assert parse(CURRENTS, ["index.m1=-300"], cap=300).named == {3: -300}
    with pytest.raises(UsageError, match="cap of 300") as caught:
        parse(CURRENTS, ["index.m1=-301"], cap=300)
    assert caught.value.code == "beyond-cap"
    link = streamer(feedback(current_state=[-301] + [0] * 14))
    with refused(CheckFailed, "beyond-cap", "thumb.m1 -301"):
        currents(hand_on(link), parse(CURRENTS, ["index.m3=100"]), Prompts(), seconds=1.0, cap=300)
    assert link.sent == []


def test_a_second_ctrl_c_does_not_wait_for_the_way_back_to_0() -> None:
    """It is counted meanwhile, and the stop mode sent at once."""

    class Pressed(Prompts):
        @contextmanager
        def count_interrupts(self) -> Iterator[InterruptCount]:
            presses = InterruptCount()
            presses.count = 1
            yield presses

    hand, link = simulated(start="homed")
    link.interrupt_at = link.now() + 0.9
    with pytest.raises(Interrupted):
        currents(hand, parse(CURRENTS, ["index.m3=100"]), Pressed(), seconds=1.0, cap=300, ramp_down=True)
    told = [data["hand_TT_cmd"][5] for data in objects(link.sent) if data["hand_mode"] == 41]  # type: ignore[index]
    assert told[-1] == max(told) > 40
    stopped_behind(link.sent)
