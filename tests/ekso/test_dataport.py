"""The line to the EksoNR on virtual time: retries, msgIDs, late and unasked frames, resynchronisation, errors by name."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.ekso.dataport import QUIET
from handctl.devices.ekso.frames import Command
from handctl.errors import HandctlError, LinkError, NoAnswer, NotIdentified, ProtocolError
from handctl.link import Deadline
from handctl.model.device import Gate
from tests.ekso.support import DATA, SET, SETTING_WORDS, SETTINGS, TIME, Unit, codes, frame, pack, port_on
from tests.support.each_row import each_row
from tests.support.scripted import Babble, Reply, ScriptedLink

TIME_BODY = bytes([14, 5, 37, 0])
Faulty = Callable[[int, bytes], "list[Reply] | None"]


def test_a_read_is_one_request() -> None:
    unit = Unit()
    port = port_on(unit)
    assert port.settings_raw() == tuple(SETTING_WORDS)
    assert unit.sent == [frame(SETTINGS, 1)]
    assert port.journal.counters.as_row() == {
        "sent": 1, "received": 1, "retries": 0, "bad_frames": 0, "stray_bytes": 0,
    }  # fmt: skip
    assert unit.sent_at == [pytest.approx(QUIET)], "only after the line has been quiet"
    assert port.moment.answered - port.moment.sent == pytest.approx(unit.turn)


def test_message_ids_count_up_and_wrap() -> None:
    unit = Unit()
    port = port_on(unit, first_id=65534)
    for _ in range(4):
        port.read(Command.GET_TIME)
    assert unit.sent == [frame(TIME, 65534), frame(TIME, 65535), frame(TIME, 0), frame(TIME, 1)]


def test_reads_are_repeated_with_a_new_id_and_writes_never() -> None:
    """Before anybody has answered, an id is left out whose frame holds what another device acts upon: here 03, ^C."""
    unit = Unit()
    unit.baud = None
    unit.on = dict.fromkeys((TIME, SET), lambda _msg_id, _body: [])
    port = port_on(unit)
    with pytest.raises(NoAnswer) as caught:
        port.read(Command.GET_TIME)
    assert unit.sent == [frame(TIME, 1), frame(TIME, 2), frame(TIME, 4)]
    assert "no reply to GetTime" in caught.value.text
    assert [port.journal.counters.retries, port.counts.timeouts] == [2, 3]
    with pytest.raises(NoAnswer):
        port.exchange(Command.SET_VALUE, pack([202, 1550]))
    assert unit.sent[3:] == [frame(SET, 5, pack([202, 1550]))]
    assert unit.clock == pytest.approx(4 * 0.5 + 4 * QUIET)


def test_retries_and_timeout_are_the_users() -> None:
    unit = Unit()
    unit.baud = None
    unit.on = {TIME: lambda _msg_id, _body: []}
    with pytest.raises(NoAnswer, match=r"within 0\.1 s"):
        port_on(unit, retries=0, timeout=0.1).read(Command.GET_TIME)
    assert (len(unit.sent), unit.clock) == (1, pytest.approx(0.1 + QUIET))


def test_a_late_answer_is_dropped_and_the_next_one_taken() -> None:
    """Late by half a second and more, then in time: it must not pass for the answer to the next request."""
    unit = Unit()
    delays = iter([0.51, 0.002])
    bodies = iter([bytes([1, 1, 1, 0]), TIME_BODY])
    unit.on = {TIME: lambda msg_id, _body: [(next(delays), frame(TIME, msg_id, next(bodies)))]}
    port = port_on(unit)
    assert port.read(Command.GET_TIME).body == TIME_BODY
    assert (port.counts.late, port.counts.timeouts, port.journal.counters.foreign_frames) == (1, 1, 1)
    assert codes(port.journal) == ["late"]


def test_always_late_says_so() -> None:
    unit = Unit()
    unit.on = {TIME: lambda msg_id, _body: [(0.6, frame(TIME, msg_id, TIME_BODY))]}
    with pytest.raises(ProtocolError) as caught:
        port_on(unit).read(Command.GET_TIME)
    assert caught.value.code == "late"
    assert "--timeout" in caught.value.hint


def test_duplicates_and_unasked_frames_are_counted_apart() -> None:
    unit = Unit()
    unasked = frame(160, 0, b"\x00\x01")
    unit.on = {TIME: lambda msg_id, _body: [(0.001, unasked), (0.002, frame(TIME, msg_id, TIME_BODY) * 2)]}
    port = port_on(unit)
    for _ in range(3):
        assert port.read(Command.GET_TIME).body == TIME_BODY
    assert (port.counts.unsolicited, port.counts.duplicates, port.counts.late) == (3, 2, 0)
    assert port.journal.counters.foreign_frames == 5
    assert port.journal.counters.stray_bytes == 0
    assert codes(port.journal) == ["unsolicited", "duplicate"]


def test_what_lay_on_the_line_before_is_discarded() -> None:
    """Also an answer to an earlier process with our own first msgID."""
    unit = Unit()
    unit.put(0.0, frame(TIME, 1, bytes([9, 9, 9, 0])))
    unit.put(0.015, b"\x96\x04\x00")
    port = port_on(unit)
    assert port.read(Command.GET_TIME).body == TIME_BODY
    assert unit.sent_at == [pytest.approx(0.015 + QUIET)]
    assert (port.counts.late, port.journal.counters.stray_bytes) == (1, 3)


def test_after_a_bad_frame_the_line_is_left_to_settle() -> None:
    unit = Unit()
    good = [b"\x00", b""]

    def answer(msg_id: int, _body: bytes) -> list[Reply]:
        spoilt = good.pop(0) if good else b""
        data = frame(TIME, msg_id, TIME_BODY)
        if not spoilt:
            return [(0.002, data)]
        return [(0.002, data[:-1] + b"\x00"), (0.05, b"\x55\x66")]

    unit.on = {TIME: answer}
    port = port_on(unit)
    assert port.read(Command.GET_TIME).body == TIME_BODY
    assert (port.counts.crc_errors, port.journal.counters.bad_frames, port.journal.counters.retries) == (1, 1, 1)
    assert port.journal.counters.stray_bytes == 12
    assert unit.sent_at[1] - unit.sent_at[0] < 0.2, "a broken reply need not be waited for to the end"


FAULTS: dict[str, tuple[str, Faulty]] = {
    "echo": ("echo", lambda msg_id, _: [(0.001, frame(TIME, msg_id))]),
    "crc": ("bad-checksum", lambda msg_id, _: [(0.001, frame(TIME, msg_id, TIME_BODY)[:-1] + b"\x00")]),
    "size": ("bad-length", lambda msg_id, _: [(0.001, frame(TIME, msg_id, bytes(20)))]),
    "other id": ("wrong-id", lambda msg_id, _: [(0.001, frame(TIME, msg_id + 1, TIME_BODY))]),
    "unasked": ("unsolicited", lambda _msg_id, _: [(0.001, frame(160, 0, b"\x00\x01"))]),
    "cut": ("cut-short", lambda msg_id, _: [(0.001, frame(TIME, msg_id, TIME_BODY)[:-3])]),
    "other command": ("wrong-command", lambda msg_id, _: [(0.001, frame(DATA, msg_id, bytes(40)))]),
    "garbage": ("garbage", lambda _msg_id, _: [(0.001, b"\x17\xb6\x7b\x24")]),
}


@each_row(("code", "fault"), FAULTS.values(), ids=FAULTS)
def test_what_comes_instead_of_an_answer_has_a_name(code: str, fault: Faulty) -> None:
    unit = Unit()
    unit.on = {TIME: fault}
    port = port_on(unit, retries=1)
    with pytest.raises(ProtocolError) as caught:
        port.read(Command.GET_TIME)
    assert (caught.value.code, caught.value.exit_code) == (code, 5)
    assert caught.value.hint
    assert "Sent 96 00 00 02" in caught.value.text
    assert len(unit.sent) == 2


def test_an_echoing_line_with_a_device_works() -> None:
    unit = Unit()
    unit.on = {
        TIME: lambda msg_id, _: [(0.001, frame(TIME, msg_id)), (0.004, frame(TIME, msg_id, TIME_BODY))],
        SET: lambda msg_id, body: [(0.001, frame(SET, msg_id, body)), (0.004, frame(SET, msg_id, bytes(2)))],
    }
    port = port_on(unit)
    assert port.read(Command.GET_TIME).body == TIME_BODY
    assert port.exchange(Command.SET_VALUE, pack([202, 1550])).body == bytes(2)
    assert codes(port.journal) == ["echo"]


def test_an_answer_byte_by_byte() -> None:
    unit = Unit()

    def slowly(msg_id: int, _body: bytes) -> list[Reply]:
        data = frame(DATA, msg_id, bytes(54))
        return [(0.003 * (at + 1), data[at : at + 1]) for at in range(len(data))]

    unit.on = {DATA: slowly}
    assert port_on(unit).read(Command.GET_DATA).words == (0,) * 27
    assert len(unit.sent) == 1


def test_a_babbling_line_ends_every_wait() -> None:
    link = Babble()
    port = port_on(link, retries=1)
    with pytest.raises(ProtocolError) as caught:
        port.read(Command.GET_TIME)
    assert caught.value.code == "garbage"
    assert link.clock < 5


def test_the_deadline_of_the_command_bounds_everything() -> None:
    unit = Unit()
    unit.on = {TIME: lambda _msg_id, _body: []}
    port = port_on(unit, bound=Deadline(unit.now, 0.7))
    with pytest.raises(NoAnswer):
        port.read(Command.GET_TIME)
    assert unit.clock <= 0.71
    with pytest.raises(NoAnswer) as caught:
        port.exchange(Command.SET_VALUE, pack([202, 1550]))
    assert caught.value.code == "deadline"
    assert SET not in unit.commands()


def test_a_lost_link_is_not_retried() -> None:
    class Lost(ScriptedLink):
        def read(self, deadline: Deadline, size: int = 4096) -> bytes:
            if self.sent:
                raise LinkError("lost", code="lost")
            return super().read(deadline, size)

    link = Lost()
    with pytest.raises(LinkError):
        port_on(link).read(Command.GET_TIME)
    assert len(link.sent) == 1


@given(st.lists(st.one_of(st.binary(max_size=70), st.integers(0, 4)), min_size=1, max_size=6))
def test_whatever_a_device_does_ends_in_an_answer_or_an_error(parts: list[bytes | int]) -> None:
    """Numbers stand for the right answer, whole or without its last bytes; bytes for anything."""

    def answer(msg_id: int, _body: bytes) -> list[Reply]:
        good = frame(TIME, msg_id, TIME_BODY)
        return [(0.01 * at, part if isinstance(part, bytes) else good[: 10 - part]) for at, part in enumerate(parts)]

    unit = Unit()
    unit.on = {TIME: answer}
    port = port_on(unit, retries=1)
    try:
        found = port.read(Command.GET_TIME)
    except HandctlError as exc:
        assert exc.exit_code in (4, 5)
        assert 1 <= len(unit.sent) <= 2
    else:
        assert len(found.body) in (3, 4)
        assert found.msg_id in (1, 2)
    if parts[0] == 0:
        assert unit.sent == [frame(TIME, 1)]
    assert unit.clock < 3


# -- samples ----------------------------------------------------------------------------------------------------------


def test_samples_as_fast_as_the_device_answers() -> None:
    unit = Unit()
    port = port_on(unit)
    taken = [(port.read(Command.GET_DATA).words, port.moment.middle) for _ in range(50)]
    assert [words[:2] for words, _ in taken] == [(450, -75)] * 50
    moments = [moment for _, moment in taken]
    assert moments[0] == pytest.approx(QUIET + unit.turn / 2)
    assert [b - a for a, b in pairwise(moments)] == [pytest.approx(unit.turn)] * 49


# -- length conventions -----------------------------------------------------------------------------------------------


@each_row(("mode", "more"), [("body", 0), ("n-4", 2), ("n-2", 4), ("frame", 6)])
def test_a_convention_is_found_with_reads_only(mode: str, more: int) -> None:
    unit = Unit()

    def answer(request: bytes) -> list[Reply]:
        if request[1] != len(request) - 6 + more:
            return []
        return [(0.002, frame(request[0], int.from_bytes(request[2:4], "big"), TIME_BODY, more=more))]

    unit.answer = answer
    port = port_on(unit)
    assert port.detect_length_mode() == mode
    assert set(unit.commands()) == {TIME}
    gaps = [b - a for a, b in pairwise(unit.sent_at)]
    assert all(gap >= 0.5 for gap in gaps), "a swallowed request must be over before the next"
    assert port.answer_mode == mode
    unit.sent.clear()
    port.read(Command.GET_TIME)
    assert unit.sent[0][1] == more
    assert codes(port.journal) == ([] if mode == "body" else ["length-convention"])


def test_no_convention_fits() -> None:
    unit = Unit()
    unit.on = {TIME: lambda _msg_id, _body: []}
    port = port_on(unit)
    with pytest.raises(NoAnswer):
        port.detect_length_mode()
    assert port.mode == "body"
    assert [request[1] for request in unit.sent] == [0, 6, 4, 2]


@each_row(("timeout", "gap"), [(0.1, 0.6), (0.5, 1.0), (3.0, 3.5)])
def test_the_line_rests_for_half_a_second_whatever_the_timeout(timeout: float, gap: float) -> None:
    unit = Unit()
    unit.on = {TIME: lambda _msg_id, _body: []}
    with pytest.raises(NoAnswer):
        port_on(unit, timeout=timeout).detect_length_mode()
    assert [b - a for a, b in pairwise(unit.sent_at)] == [pytest.approx(gap, abs=0.05)] * 3


def test_looking_for_a_convention_ends_at_the_deadline() -> None:
    unit = Unit()
    unit.on = {TIME: lambda _msg_id, _body: []}
    port = port_on(unit, timeout=3.0, bound=unit.deadline(1.0))
    with pytest.raises(NoAnswer) as caught:
        port.detect_length_mode()
    assert unit.clock == pytest.approx(1.0)
    assert "no reply to GetTime (96 00 00 01 75 E7) before --deadline passed" in caught.value.text
    assert (len(unit.sent), port.mode) == (1, "body")


@each_row(("seconds", "requests"), [(0.3, 1), (5.0, 2)])
def test_an_answer_that_waited_too_long_is_no_present_value(seconds: float, requests: int) -> None:
    unit = Unit()
    port = port_on(unit)
    port.read(Command.GET_TIME)
    unit.sent.clear()
    port.send_ahead(Command.GET_DATA)
    unit.sleep(seconds)
    words = port.read(Command.GET_DATA).words
    age = unit.clock * 1000 + unit.boot0 - ((words[25] & 0xFFFF) << 16 | words[26] & 0xFFFF)
    assert age == pytest.approx(300 if requests == 1 else 0, abs=10)
    assert unit.commands() == [DATA] * requests
    assert port.counts.late == 0, "it came in time, and nobody took it"


def test_nothing_is_looked_for_between_an_answer_and_what_is_asked_ahead() -> None:
    """The line has nothing to do until that is sent. What came late meanwhile is counted all the same, and taken for no answer."""
    unit = Unit()
    port = port_on(unit)
    first = port.read(Command.GET_DATA)
    unit.put(0.0, first.data + b"\x55\x66")
    seen = []
    unit.read, read = lambda *given: seen.append(len(unit.sent)) or read(*given), unit.read  # type: ignore[method-assign, func-returns-value]
    port.send_ahead(Command.GET_DATA)
    assert (seen, len(unit.sent)) == ([], 2)
    assert port.read(Command.GET_DATA).msg_id == first.msg_id + 1
    assert (port.counts.duplicates, port.journal.counters.stray_bytes, port.counts.late) == (1, 2, 0)
    assert codes(port.journal) == ["duplicate"]


@each_row(("turn", "next_at"), [(0.01, 0.03), (0.2, 0.22), (9.0, 0.5)])
def test_the_answer_that_ctrl_c_did_not_wait_for_passes_before_the_next_request(turn: float, next_at: float) -> None:
    """One request at a time (ekso section 6); and what then comes is no fault of the line."""
    unit = Unit()
    port = port_on(unit)
    port.read(Command.GET_TIME)
    unit.on = {DATA: lambda msg_id, _body: [(0.006, b"\0"), (turn, frame(DATA, msg_id, unit.body_of(DATA)))]}
    unit.interrupt_at = unit.clock + 0.005
    with pytest.raises(KeyboardInterrupt):
        port.read(Command.GET_DATA)
    assert port.settings_raw() == tuple(SETTING_WORDS)
    assert unit.sent_at[2] - unit.sent_at[1] == pytest.approx(next_at, abs=0.006)
    assert (codes(port.journal), port.counts.late, port.journal.counters.as_row().get("foreign_frames")) == (
        [],
        0,
        None,
    )
    assert port.journal.counters.stray_bytes == 0


def test_what_was_asked_ahead_passes_before_another_request() -> None:
    unit = Unit()
    port = port_on(unit)
    port.read(Command.GET_TIME)
    unit.turn = 0.044
    port.send_ahead(Command.GET_DATA)
    port.read(Command.GET_TIME)
    assert unit.sent_at[2] - unit.sent_at[1] == pytest.approx(0.064, abs=0.001)
    assert port.counts.late == 0


def test_nothing_is_written_to_a_line_on_which_no_eksonr_has_answered() -> None:
    """What acts is sent behind an answer only; where the time has no answer, not a byte of it goes out."""
    unit = Unit()
    unit.on = {TIME: lambda _msg_id, _body: []}
    port = port_on(unit)
    port.gate = Gate()
    with pytest.raises(NotIdentified):
        port.exchange(Command.CANCEL_ACTION, b"\x01\x00")
    assert unit.sent and {data[0] for data in unit.sent} == {TIME}
