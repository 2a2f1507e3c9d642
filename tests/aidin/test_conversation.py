"""Finding out how the hand speaks, and feedback key by key, against scripted hands on virtual time."""

from __future__ import annotations

import pytest

from handctl.devices.aidin.exchange_settings import ExchangeMode
from handctl.devices.aidin.parameter_map import AIDIN, FEEDBACK
from handctl.errors import HandctlError, LinkError, NoAnswer, ProtocolError
from handctl.link import Deadline
from tests.aidin.support import Streamer, feedback, hand_on, line, poller, streamer
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import Babble, ScriptedLink

POLL = b"{}\n"


def all_of(name: str) -> list[object]:
    return list(AIDIN[name].each)


def test_a_stream_is_listened_to_and_nothing_is_sent() -> None:
    link = streamer()
    hand = hand_on(link)
    table = hand.dump()
    assert hand.conversation.exchange is ExchangeMode.STREAM
    assert link.sent == []
    assert len(table.rows) == 15 + 20 + 15 + 15 + 30
    assert table.failure is None


def test_a_silent_hand_is_asked_with_the_neutral_object_after_300_ms() -> None:
    link = poller(feedback())
    hand = hand_on(link)
    hand.conversation.connect()
    assert hand.conversation.exchange is ExchangeMode.POLL
    assert link.sent == [POLL]
    assert link.sent_at == [pytest.approx(0.3)]


def test_a_mute_hand_is_asked_twice_and_never_commanded() -> None:
    link = ScriptedLink()
    with refused(NoAnswer, "no-answer"):
        hand_on(link).dump()
    assert link.sent == [POLL, POLL]
    assert link.clock == pytest.approx(0.3 + 2 * 0.5)


def test_timeout_retries_and_deadline_bound_the_search() -> None:
    link = ScriptedLink()
    with pytest.raises(NoAnswer):
        hand_on(link, timeout=0.1, retries=0).dump()
    assert link.sent == [POLL]
    assert link.clock == pytest.approx(0.4)
    link = ScriptedLink()
    with pytest.raises(NoAnswer):
        hand_on(link, bound=link.deadline(0.2)).dump()
    assert link.clock <= 0.2


def test_junk_unasked_is_shown_and_nothing_is_sent() -> None:
    link = ScriptedLink()
    link.put(0.05, b"SSH-2.0-OpenSSH_9.6\r\n")
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).dump()
    assert link.sent == []
    assert "53 53 48 2D 32 2E 30" in caught.value.text and "SSH-2.0-OpenSSH" in caught.value.text


def test_junk_as_an_answer() -> None:
    link = ScriptedLink(lambda _: [(0.01, b"HTTP/1.1 400 Bad Request\r\n\r\n")])
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).dump()
    assert caught.value.code == "garbage"
    assert link.sent == [POLL]


def test_an_echo_is_no_answer() -> None:
    link = ScriptedLink(lambda request: [(0.001, request)])
    with pytest.raises(ProtocolError) as caught:
        hand_on(link).dump()
    assert caught.value.code == "echo"


def test_a_babbling_line_ends() -> None:
    with pytest.raises(HandctlError) as caught:
        hand_on(Babble()).dump()
    assert caught.value.exit_code == 5


class Closing(ScriptedLink):
    """Sends what it has and closes."""

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self._incoming:
            return super().read(deadline, size)
        raise LinkError("scripted: closed")


def test_a_lost_connection_is_a_link_error() -> None:
    with pytest.raises(LinkError) as caught:
        hand_on(Closing()).dump()
    assert "another client" in caught.value.hint
    link = Closing()
    link.put(0.0, line(feedback()))
    with pytest.raises(LinkError) as caught:
        hand_on(link).dump()
    assert "another client" not in caught.value.hint


def test_another_server_that_closes_is_shown() -> None:
    link = Closing()
    link.put(0.0, b"HTTP/1.1 400 Bad Request\r\n\r\n")
    with pytest.raises(ProtocolError, match=r"HTTP/1\.1 400"):
        hand_on(link).dump()


def test_values_by_element() -> None:
    rows = {(row["name"], row["finger"], row["element"]): row for row in hand_on(streamer()).dump().rows}
    assert rows["motor_pos", "index", "m2"]["value"] == 4000
    assert rows["joint_pos", "thumb", "q1"]["value"] == pytest.approx(5.7296)
    assert rows["joint_pos", "thumb", "q1"]["rad"] == 0.1
    assert rows["task_space_pos", "little", "z"]["value"] == 104
    assert rows["current_state", "ring", "m1"]["value"] == 2
    assert rows["sensor_state", "middle", "tz"]["value"] == 0.18
    assert [rows[k]["unit"] for k in (("motor_pos", "thumb", "m1"), ("joint_pos", "thumb", "q1"), ("task_space_pos", "thumb", "x"))] == ["cts", "deg", "mm"]  # fmt: skip


def test_keys_in_objects_of_their_own_are_merged() -> None:
    whole = feedback()
    pieces = [line({key: value}) for key, value in whole.items()]
    asked = ScriptedLink(lambda _: [(0.001 * n, piece) for n, piece in enumerate(pieces)])
    assert hand_on(asked).dump().failure is None
    turns = iter(pieces * 100)
    assert hand_on(Streamer(lambda _: next(turns))).dump().failure is None


BAD = {
    "short": ({"motor_pos": [1] * 14}, "motor_pos", "bad-length"),
    "long": ({"task_space_pos": [1.0] * 16}, "task_space_pos", "bad-length"),
    "text": ({"motor_pos": ["1"] + [2] * 14}, "motor_pos", "bad-type"),
    "nan": ({"joint_pos": [float("nan")] + [1.0] * 19}, "joint_pos", "not-finite"),
    "half": ({"current_state": [0.5] * 15}, "current_state", "bad-type"),
    "beyond int16": ({"current_state": [40000] * 15}, "current_state", "bad-type"),
}


ONE_ODD = [BAD["text"][0]["motor_pos"], BAD["nan"][0]["joint_pos"]]


@each_row("polled", [False, True], ids=["stream", "poll"])
@each_row(("changes", "key", "code"), BAD.values(), ids=BAD)
def test_a_bad_key_is_refused_by_itself(changes: dict[str, object], key: str, code: str, polled: bool) -> None:
    content = {k: v for k, v in feedback(**changes).items() if v is not None}
    table = hand_on(poller(content) if polled else streamer(content)).dump()
    wrong = [row for row in table.rows if "error" in row]
    assert {row["key"] for row in wrong} == {key}
    assert len(wrong) == (1 if changes[key] in ONE_ODD else AIDIN[key].count)  # one bad number hides no other
    assert all("value" in row for row in table.rows if row["key"] != key)
    assert len(table.rows) == 95
    assert table.failure is not None and table.failure.exit_code == 5
    assert (table.failure.code, key in table.failure.text) == (code, True)


@each_row("polled", [False, True], ids=["stream", "poll"])
def test_a_key_that_does_not_come_is_left_out(polled: bool) -> None:
    content = {key: value for key, value in feedback().items() if key != "current_state"}
    hand = hand_on(poller(content) if polled else streamer(content))
    table = hand.dump()
    assert table.failure is None
    assert {row["key"] for row in table.rows} == {*content}
    assert "not-on-this-firmware" in [message.code for message in hand.journal.messages]


def test_one_bad_object_is_passed_over() -> None:
    turns = iter([line(feedback()), line(feedback(motor_pos=[1])), b'{"motor_pos":[1,2', *[line(feedback())] * 50])
    hand = hand_on(Streamer(lambda _: next(turns)))
    hand.conversation.connect()
    assert hand.dump().failure is None
    assert hand.journal.counters.bad_frames == 1


def test_three_damaged_objects_in_a_row() -> None:
    with refused(ProtocolError, "bad-json", "3 corrupted objects") as caught:
        hand_on(Streamer(lambda _: b'{"motor_pos":[1,2\n')).dump()
    assert caught.value.code == "bad-json"


def test_only_values_from_now_on_count() -> None:
    """A fast stream between two looks: what lies there is old."""
    link = Streamer(lambda t: line(feedback(motor_pos=[round(t * 1000)] * 15)), period=0.001)
    hand = hand_on(link)
    hand.conversation.connect()
    for _ in range(3):
        link.clock += 0.1
        began = link.clock
        (reading, *_) = hand.read(AIDIN["motor_pos"].each)
        assert reading.value is not None and reading.value >= round(began * 1000) - 1


def test_a_stream_that_stops_is_told() -> None:
    link = streamer()
    hand = hand_on(link)
    hand.conversation.connect()
    link._next = float("inf")
    began = link.clock
    with refused(NoAnswer, "no-answer"):
        hand.dump()
    assert link.clock - began <= 1.01


def test_nothing_is_driven_on_by_a_key_that_is_wrong_three_times() -> None:
    made = iter([feedback()] + [feedback(motor_pos=[1])] * 9)
    hand = hand_on(poller(lambda _: next(made)))
    hand.conversation.connect()
    for _ in range(2):
        hand.conversation.tick(POLL, by=AIDIN["motor_pos"])
    with pytest.raises(ProtocolError) as caught:
        hand.conversation.tick(POLL, by=AIDIN["motor_pos"])
    assert caught.value.code == "bad-length"
    assert hand.link.now() < 1.0  # the bound for a key that is missing


def test_a_poll_is_repeated_and_only_one_is_under_way() -> None:
    lost = iter([False, True, True, False])

    link = poller(lambda _: None if next(lost) else feedback())
    hand = hand_on(link)
    assert hand.dump().failure is None  # what the first answer told, no second question
    assert hand.dump().failure is None
    assert hand.journal.counters.retries == 2
    assert all(b - a >= 0.2 for a, b in zip(link.sent_at[1:], link.sent_at[2:], strict=False))


def test_unknown_keys_are_named_once() -> None:
    hand = hand_on(streamer(feedback(battery=87, firmware="x")))
    hand.dump()
    hand.dump()
    texts = [message.text for message in hand.journal.messages if message.code == "unknown-keys"]
    assert texts == ["keys that are not in the manual: battery, firmware"]


def test_parts_are_read_alone() -> None:
    """What is wrong with another key does not matter."""
    hand = hand_on(streamer(feedback(motor_pos=[])))
    readings = hand.read(AIDIN["joint_pos"].each[:2])
    assert [reading.error for reading in readings] == [None, None]


def test_status_names_what_is_unhealthy() -> None:
    good = hand_on(streamer(feedback())).status(True)
    assert good.failure is None
    far = hand_on(streamer(feedback(motor_pos=[-90000] + [0] * 14))).status(True)
    assert far.failure is not None and far.failure.exit_code == 7
    assert "thumb.m1 -90000" in far.failure.text
    degrees = hand_on(streamer(feedback(joint_pos=[10.0, 5.0, 118.0, 118.0] + [0.0, 5.0, 165.0, 165.0] * 4))).status(
        True
    )
    assert degrees.failure is not None and "possibly degrees" in degrees.failure.text
    assert len(FEEDBACK) == 5
