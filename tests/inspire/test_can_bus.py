"""The CAN wire: one question, one answer among the traffic of others; reads repeated, writes never (wrist §2.3)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.wrist.explain_bytes import words
from handctl.errors import HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.link import CanFrame
from handctl.model.result import Journal
from tests.inspire.wrist_support import Arrival, BabblingFrames, ScriptedFrames, can, frames
from tests.support.each_row import each_row
from tests.support.scripted import hexed, unhex

ASK, ANSWER = "10FF0001 [1] 02", "10FF0001 [2] A7 FE"
SET, ACK, COUNTED = "15038001 [4] E8 03 18 FC", "15038001 [0]", "15038001 [1] 04"
ANGLES = unhex("E8 03 18 FC")


def bus_on(link: ScriptedFrames, device_id: int = 1, **options: object) -> CanBus:
    return CanBus(link, device_id, Journal(), **options)  # type: ignore[arg-type]


class Memory:
    """A wrist as a plain memory of 4096 bytes: byte k is k % 251. Answers every read of 1..8 bytes."""

    def __init__(self, before: tuple[str, ...] = ()) -> None:
        self.before = before

    def __call__(self, frame: CanFrame) -> list[Arrival]:
        address, count = frame.can_id >> 14 & 0xFFF, frame.data[0]
        assert 1 <= count <= 8
        answer = CanFrame(frame.can_id, bytes(k % 251 for k in range(address, address + count)))
        return [*((0.0, can(text)) for text in self.before), (0.001, answer)]


# -- reads ------------------------------------------------------------------------------------------------------------


def test_read_is_one_frame_each_way() -> None:
    link = ScriptedFrames(frames((ASK, [ANSWER])))
    bus = bus_on(link)
    assert hexed(bus.read(1020, 2)) == "A7 FE"
    assert link.texts == [ASK]
    counters = bus.journal.counters
    assert (counters.sent, counters.received, counters.retries, counters.stray_bytes) == (1, 1, 0, 0)
    assert counters.foreign_frames == 0


@each_row(
    ("address", "asked", "answer", "value"),
    [
        (1028, "11010001 [1] 02", "11010001 [2] 01 07", "01"),
        (1032, "11020001 [1] 02", "11020001 [2] 1F 22", "1F"),
        (1033, "11020001 [1] 02", "11020001 [2] 1F 22", "22"),
        (4095, "13FF8001 [1] 02", "13FF8001 [2] 05 06", "06"),
    ],
)
def test_one_byte_is_asked_for_as_two(address: int, asked: str, answer: str, value: str) -> None:
    """A 1-byte read of the value 01 equals its own request (dossier 4.12)."""
    link = ScriptedFrames(frames((asked, [answer])))
    assert hexed(bus_on(link).read(address, 1)) == value


def test_the_whole_wrist_is_three_reads() -> None:
    link = ScriptedFrames(
        frames(
            ("10FF0001 [1] 08", ["10FF0001 [8] A7 FE 65 04 6F 00 DE 00"]),
            ("11010001 [1] 08", ["11010001 [8] 00 00 00 00 1F 22 00 00"]),
            ("11030001 [1] 08", ["11030001 [8] 00 00 4C 04 D4 FE BC 02"]),
        )
    )
    data = bus_on(link).read(1020, 24)
    assert hexed(data) == "A7 FE 65 04 6F 00 DE 00 00 00 00 00 1F 22 00 00 00 00 4C 04 D4 FE BC 02"


@given(st.integers(0, 4000), st.integers(1, 90))
def test_spans_are_split_and_put_together(address: int, count: int) -> None:
    link = ScriptedFrames(Memory())
    assert bus_on(link).read(address, count) == bytes(k % 251 for k in range(address, address + count))
    assert len(link.sent) == -(-count // 8)
    assert all(len(frame.data) == 1 and 2 <= frame.data[0] <= 8 for frame in link.sent)


@each_row(("address", "count"), [(1020, 0), (1020, -1), (4096, 2), (-2, 2), (4095, 2), (4090, 16), (4000, 252)])
def test_an_impossible_span_sends_nothing(address: int, count: int) -> None:
    """Addresses have 12 bits (wrist §2.3); also a span whose end lies beyond them is refused before the first frame."""
    link = ScriptedFrames(Memory())
    with pytest.raises(UsageError):
        bus_on(link).read(address, count)
    assert link.sent == []


@each_row(("retries", "sent"), [(0, 1), (1, 2), (2, 3), (5, 6)])
def test_a_silent_read_is_repeated_so_often(retries: int, sent: int) -> None:
    link = ScriptedFrames()
    bus = bus_on(link, retries=retries, timeout=0.3)
    with pytest.raises(NoAnswer) as caught:
        bus.read(1020, 2)
    assert link.texts == [ASK] * sent
    assert bus.journal.counters.retries == retries
    assert link.now() == pytest.approx(0.3 * sent)
    assert (caught.value.code, caught.value.exit_code) == ("no-answer", 4)
    assert ASK in caught.value.text
    for word in ("scan", "id", "power", "120", "500000"):
        assert word in caught.value.hint


def test_second_attempt_counts_as_a_retry() -> None:
    link = ScriptedFrames(frames((ASK, []), (ASK, [(0.001, ANSWER)])))
    bus = bus_on(link)
    assert hexed(bus.read(1020, 2)) == "A7 FE"
    assert bus.journal.counters.retries == 1


def test_retries_of_one_read_can_be_set() -> None:
    link = ScriptedFrames()
    with pytest.raises(NoAnswer):
        bus_on(link, retries=7).read(1020, 2, retries=0)
    assert link.texts == [ASK]


def test_bound_of_the_command_ends_the_retries() -> None:
    link = ScriptedFrames()
    with pytest.raises(NoAnswer):
        bus_on(link, retries=100, timeout=0.3, bound=link.deadline(0.7)).read(1020, 2)
    assert link.now() == pytest.approx(0.7)
    assert len(link.sent) == 3


def test_the_last_ask_before_the_deadline_tells_how_long_it_was_waited_for() -> None:
    """What was asked is told, and not what no longer was: a retry that is not sent is none."""
    link = ScriptedFrames()
    bus = bus_on(link, retries=100, timeout=0.3, bound=link.deadline(0.7))
    with pytest.raises(NoAnswer, match=r"before --deadline passed, after 0\.1 s$") as caught:
        bus.read(1020, 2)
    assert caught.value.code == NoAnswer.default_code
    assert bus.journal.counters.retries == 2


def test_a_long_timeout_does_not_outlast_the_deadline_of_the_command() -> None:
    link = ScriptedFrames()
    with pytest.raises(NoAnswer, match=r"before --deadline passed, after 0\.2 s$"):
        bus_on(link, retries=0, timeout=5.0, bound=link.deadline(0.2)).read(1020, 2)
    assert link.now() == pytest.approx(0.2)


@each_row("what", ["read", "write"])
def test_nothing_is_sent_after_the_deadline_of_the_command(what: str) -> None:
    link = ScriptedFrames()
    bus = bus_on(link, bound=link.deadline(1.0))
    link.sleep(1.5)
    with pytest.raises(NoAnswer) as caught:
        bus.read(1020, 2) if what == "read" else bus.write(1038, ANGLES)
    assert caught.value.code == "deadline"
    assert link.sent == []


@each_row("device_id", [-1, 16384])
def test_bus_refuses_an_id_that_does_not_exist(device_id: int) -> None:
    with pytest.raises(UsageError):
        bus_on(ScriptedFrames(), device_id)


def test_hand_space_by_flags() -> None:
    link = ScriptedFrames(frames(("01840001 [1] 02", ["01840001 [2] C9 03"])))
    assert hexed(bus_on(link, family="hand").read(1552, 2)) == "C9 03"


# -- writes -----------------------------------------------------------------------------------------------------------


@each_row("ack", [ACK, COUNTED])
def test_write_is_one_frame_with_either_acknowledgement(ack: str) -> None:
    """wrist §2.3.2: no data; RH56: one byte, the count (dossier W11)."""
    link = ScriptedFrames(frames((SET, [ack])))
    bus = bus_on(link)
    bus.write(1038, ANGLES)
    assert link.texts == [SET]
    assert (bus.journal.counters.sent, bus.journal.counters.received) == (1, 1)


@each_row("count, code", [("00", 6), ("02", 5), ("03", 5), ("05", 5), ("FF", 5)])
def test_another_count_is_an_error(count: str, code: int) -> None:
    """And none is a refusal."""
    link = ScriptedFrames(frames((SET, [f"15038001 [1] {count}"])))
    with pytest.raises(HandctlError) as caught:
        bus_on(link).write(1038, ANGLES)
    assert caught.value.exit_code == code
    assert f"{int(count, 16)} of 4" in caught.value.text
    assert link.texts == [SET]


@each_row("came, accepted", [("", [True]), ("04", [True]), ("00", [False]), ("02", [])])
def test_what_an_acknowledgement_says_of_a_write(came: str, accepted: list[bool]) -> None:
    """That a part was taken is neither: what the rest does shows when it is read back."""
    rules = words()
    rules.sent(ANGLES, 0x15038001)
    assert [verdict for _, verdict in rules.came(unhex(came), 0x15038001)] == accepted


def test_a_write_is_never_repeated() -> None:
    link = ScriptedFrames()
    bus = bus_on(link, retries=5)
    with pytest.raises(NoAnswer):
        bus.write(1038, ANGLES)
    assert link.texts == [SET]
    assert bus.journal.counters.retries == 0


@each_row("data", ["", "00 01 02 03 04 05 06 07 08"])
def test_an_impossible_write_sends_nothing(data: str) -> None:
    link = ScriptedFrames()
    with pytest.raises(UsageError):
        bus_on(link).write(1038, unhex(data))
    assert link.sent == []


def test_nothing_is_written_to_any() -> None:
    link = ScriptedFrames(Memory())
    bus = bus_on(link, 16383)
    with pytest.raises(UsageError):
        bus.write(1038, ANGLES)
    with pytest.raises(UsageError):
        bus.write_step(1038, ANGLES, "write")
    assert link.sent == []
    assert bus.read(1020, 2) == bytes([1020 % 251, 1021 % 251])


def test_a_step_holds_the_exact_frame() -> None:
    step = bus_on(ScriptedFrames()).write_step(1038, ANGLES, "write both")
    assert (step.can_id, hexed(step.data), step.meaning) == (0x15038001, "E8 03 18 FC", "write both")
    assert step.wire == SET


@each_row("byte", ["02", "07", "FF"])
def test_the_echo_of_one_byte_is_no_acknowledgement(byte: str) -> None:
    """An adapter that hands out what it sends: one byte written is acknowledged empty or with 01 (dossier W11, 4.12)."""
    own = f"04FC4001 [1] {byte}"
    link = ScriptedFrames(frames((own, [own, "04FC4001 [0]"])))
    bus = bus_on(link, family="hand")
    bus.write(1009, unhex(byte))
    assert link.texts == [own]


# -- the traffic of others --------------------------------------------------------------------------------------------

OTHERS = ("10FF0002 [2] 01 00", "00000005 [0]", "1FFFFFFE [8] 01 02 03 04 05 06 07 08", "15038007 [4] E8 03 18 FC")


def test_foreign_frames_are_passed_over_and_counted() -> None:
    link = ScriptedFrames(frames((ASK, [*OTHERS, ANSWER])))
    bus = bus_on(link)
    assert hexed(bus.read(1020, 2)) == "A7 FE"
    counters = bus.journal.counters
    assert (counters.foreign_frames, counters.stray_bytes, counters.received) == (4, 0, 1)
    assert counters.as_row()["foreign_frames"] == 4


def test_frames_of_this_id_that_answer_nothing_are_stray() -> None:
    link = ScriptedFrames(frames((ASK, ["10FF8001 [2] 65 04", ASK, "14FF0001 [2] A7 FE", ANSWER])))
    bus = bus_on(link)
    assert hexed(bus.read(1020, 2)) == "A7 FE"
    assert (bus.journal.counters.foreign_frames, bus.journal.counters.stray_bytes) == (0, 5)


@given(st.lists(st.tuples(st.integers(0, 2**29 - 1), st.binary(max_size=8)), max_size=20), st.integers(1, 30))
def test_no_foreign_frame_becomes_a_value(traffic: list[tuple[int, bytes]], count: int) -> None:
    """Any traffic of others before each answer: the value is right and every frame is counted."""
    others = [CanFrame(identifier, data) for identifier, data in traffic if identifier & 0x3FFF != 1]
    memory = Memory()
    link = ScriptedFrames(lambda frame: [*((0.0, other) for other in others), *memory(frame)])
    bus = bus_on(link)
    assert bus.read(1020, count) == bytes(k % 251 for k in range(1020, 1020 + count))
    assert bus.journal.counters.foreign_frames == len(others) * len(link.sent)


@given(st.lists(st.tuples(st.integers(0, 2**29 - 1), st.binary(max_size=8)), max_size=30), st.booleans())
def test_any_traffic_at_all_ends_in_a_value_or_an_error(traffic: list[tuple[int, bytes]], reads: bool) -> None:
    link = ScriptedFrames(lambda frame: [(0.001, CanFrame(*item)) for item in traffic])
    bus = bus_on(link, retries=0)
    try:
        bus.read(1020, 2) if reads else bus.write(1038, ANGLES)
    except HandctlError as exc:
        assert exc.exit_code in (4, 5, 6)
    assert link.now() <= 0.301
    assert len(link.sent) == 1


def test_what_lay_there_before_the_request_is_no_answer() -> None:
    link = ScriptedFrames(frames((ASK, [ANSWER])))
    link.put(0.0, "10FF0001 [2] FF 7F")
    bus = bus_on(link)
    assert hexed(bus.read(1020, 2)) == "A7 FE"
    assert bus.journal.counters.stray_bytes == 2


def test_a_late_answer_to_the_attempt_before_is_the_same_value() -> None:
    """The same identifier and length: it answers the same question."""
    link = ScriptedFrames(frames((ASK, [(0.35, ANSWER)]), (ASK, [(0.3, ANSWER)])))
    bus = bus_on(link, timeout=0.3)
    assert hexed(bus.read(1020, 2)) == "A7 FE"
    link.sleep(1.0)
    link.answer = frames(("10FF8001 [1] 02", ["10FF8001 [2] 65 04"]))
    assert hexed(bus.read(1022, 2)) == "65 04"
    assert bus.journal.counters.stray_bytes == 2


def test_drain_takes_what_waits_and_ends() -> None:
    link = ScriptedFrames()
    bus = bus_on(link)
    for text in (*OTHERS, ANSWER):
        link.put(0.0, text)
    link.put(0.5, ANSWER)
    bus.drain()
    assert link.now() == 0.0
    assert (bus.journal.counters.foreign_frames, bus.journal.counters.stray_bytes) == (4, 2)
    babbling = BabblingFrames(ANSWER)
    bus_on(babbling).drain()
    assert babbling.now() < 1.0


# -- what came instead ------------------------------------------------------------------------------------------------


@each_row(
    ("came", "code", "exit_code", "words"),
    [
        ((), "no-answer", 4, "no reply"),
        (("10FF0007 [2] A7 FE",), "wrong-id", 5, "id 7 replied"),
        (("10FF0001 [1] 02",), "echo", 5, "only our own frame"),
        (("10FF0001 [1] 02", "10FF0007 [2] A7 FE"), "wrong-id", 5, "id 7 replied"),
        (("10FF0001 [1] A7",), "cut-short", 5, "1 byte"),
        (("10FF0001 [0]",), "cut-short", 5, "0 bytes"),
        (("10FF0001 [4] A7 FE 65 04",), "cut-short", 5, "4 bytes"),
        (("10FF8001 [2] 65 04", "00000003 [0]"), "no-answer", 4, "no reply"),
    ],
)
def test_what_came_instead_is_named(came: tuple[str, ...], code: str, exit_code: int, words: str) -> None:
    link = ScriptedFrames(lambda frame: [(0.001, can(text)) for text in came])
    with pytest.raises(HandctlError) as caught:
        bus_on(link, retries=0).read(1020, 2)
    assert (caught.value.code, caught.value.exit_code) == (code, exit_code)
    for part in ("id 1", "scripted", ASK, words):
        assert part in caught.value.text
    assert caught.value.hint


def test_nobody_acknowledges() -> None:
    """No acknowledge at all differs from "id not present" (dossier §6, §8)."""
    link = ScriptedFrames()
    link.acknowledges = False
    with pytest.raises(NoAnswer) as caught:
        bus_on(link, retries=0).read(1020, 2)
    assert (caught.value.code, caught.value.exit_code) == ("no-ack", 4)
    for word in ("power", "120", "500000"):
        assert word in caught.value.hint


def test_old_error_frames_do_not_count() -> None:
    link = ScriptedFrames()
    link.error_frames = 3
    with pytest.raises(NoAnswer) as caught:
        bus_on(link, retries=0).read(1020, 2)
    assert caught.value.code == "no-answer"


@pytest.mark.parametrize("text", ["10FF0002 [2] 01 00", "10FF0001 [1] 02", "1FFFFFFE [0]", "15038001 [4] E8 03 18 FC"])
@pytest.mark.parametrize("what", ["read", "write"])
def test_a_babbling_bus_ends_too(text: str, what: str) -> None:
    link = BabblingFrames(text)
    bus = bus_on(link, retries=1, timeout=0.3)
    with pytest.raises((NoAnswer, ProtocolError)):
        bus.read(1020, 2) if what == "read" else bus.write(1038, ANGLES)
    assert link.now() < 3.0
