"""What stands in the way of a stop for a moment: a refusal that passes, replies that come late, one after the other, or in pieces.

The device is a simulator behind a link on virtual time, which holds back, replaces or cuts its replies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from handctl.devices.inspire import modbus_frames
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.link import ByteLink, open_link
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import Sent, StopContext, Stopped, exchange_steps, stop_sequence_of
from handctl.stop.stop_listener import STOP_SECONDS
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink
from tests.support.stop import BEYOND, RELEASE, summed

SPEEDS = {"barrett": 9600}
Alter = Callable[[ScriptedLink, bytes, bytes], Sequence[Reply]]
"""Link, request and its reply -> what arrives."""


def through(query: str, alter: Alter) -> ScriptedLink:
    """A simulator behind a link that alters its replies."""
    inner = open_link(f"fake://{query}&clock=virtual", baud=SPEEDS.get(query.partition("?")[0], 115200))
    assert isinstance(inner, ByteLink)

    def answer(request: bytes) -> Sequence[Reply]:
        if (late := link.clock - inner.now()) > 0:
            inner.sleep(late)
        inner.write(request, inner.deadline(1))
        reply = b""
        while chunk := inner.read(inner.deadline(0.05)):
            reply += chunk
        return alter(link, request, reply) if reply else []

    link = ScriptedLink(answer, inner.baud)
    return link


def stopped(family: str, link: ScriptedLink, *, proven: bool = False, **own: object) -> tuple[Stopped, list[Sent]]:
    sent: list[Sent] = []
    settings = Settings(own=own, wire="modbus-tcp" if family == "hand" else None)
    context = StopContext(settings, speed=SPEEDS.get(family, 115200), proven=proven)
    return exchange_steps(link, stop_sequence_of(family, context), sent), sent


def one_at_a_time(seconds: float) -> Alter:
    """It takes so long for each request, and hears the next one afterwards."""
    free = [0.0]

    def alter(link: ScriptedLink, _request: bytes, reply: bytes) -> Sequence[Reply]:
        free[0] = max(free[0], link.clock) + seconds
        return [(free[0] - link.clock, reply)]

    return alter


@each_row("seconds", [0.1, 0.2, 0.25, 0.4, 0.6])
@each_row("family", ["exo", "wrist"])
def test_a_device_that_answers_each_request_late_is_stopped(family: str, seconds: float) -> None:
    """Repetitions of a step must not outrun its answers: each was acknowledged (dossier 4.x: 45 to 200 ms over Bluetooth)."""
    link = through(f"{family}?seed=1", one_at_a_time(seconds))
    result, sent = stopped(family, link, proven=True)
    assert result.error is None, result
    writes = [one for one in sent if not one.reads]
    hold = writes[-1].step.data
    assert [one.step.data for one in writes].count(hold) == 1, "a hold from a place read once goes out once"
    assert len(writes) <= 7, writes


@each_row("seconds", [0.002, 0.1, 0.2, 0.3, 0.45, 0.6])
@each_row("family", ["exo", "wrist"])
def test_a_hold_that_is_never_acknowledged_ends_before_anybody_gives_up(family: str, seconds: float) -> None:
    """What needs no position goes out at once, each hold from a position read anew, and on a slow line there are fewer of them."""
    hold, first = (0x32, 0x31) if family == "exo" else (0x31, 0x31)
    link = through(f"{family}?seed=1", lambda _link, request, reply: [] if request[4] == hold else [(seconds, reply)])
    result, _ = stopped(family, link)
    assert result.error in (NoAnswer, ProtocolError), result
    at = [when for when, data in zip(link.sent_at, link.sent, strict=True) if data[4] == first]
    holds = [place for place, data in enumerate(link.sent) if data[4] == hold]
    assert at[0] <= (0.06 if family == "exo" else 2 * seconds + 0.01), "the first stop goes out at once"
    assert len(holds) >= (7 if seconds <= 0.1 else 2) and link.clock < 6.0 < STOP_SECONDS, (len(holds), link.clock)
    assert all(link.sent[place - 1][4] != hold for place in holds)


def test_one_lost_reply_does_not_make_a_line_slow() -> None:
    """Nothing comes behind the reply to the repetition: it is not waited for longer than once."""
    lost: list[bytes] = []

    def alter(_link: ScriptedLink, request: bytes, reply: bytes) -> Sequence[Reply]:
        if request == RELEASE and not lost:
            lost.append(request)
            return []
        return [(0.002, reply)]

    link = through("exo?seed=1", alter)
    assert stopped("exo", link, proven=True)[0].error is None
    release, again, hold = link.sent_at[:3]
    assert (link.sent[0], link.sent[1]) == (RELEASE, RELEASE)
    assert again - release < 0.2 and hold - again < 0.01, "the hold goes out at once"


def refusing(times: int, refusal: Callable[[bytes], bytes], which: Callable[[bytes], bool]) -> Alter:
    """The first of these requests are refused, so often."""
    left = [times]

    def alter(_link: ScriptedLink, request: bytes, reply: bytes) -> Sequence[Reply]:
        if which(request) and left[0]:
            left[0] -= 1
            return [(0.002, refusal(request))]
        return [(0.002, reply)]

    return alter


def exception(code: int) -> Callable[[bytes], bytes]:
    return lambda request: modbus_frames.tcp(1, bytes([request[7] | 0x80, code]))


def writes_modbus(request: bytes) -> bool:
    return request[7] != modbus_frames.READ


SPEED = "hand?model=tp&bus=modbus-tcp"


@each_row("code", [4, 5, 6])
def test_an_exception_of_a_hand_that_passes_does_not_end_its_stop(code: int) -> None:
    """Modbus exceptions 04, 05 and 06 are transient (rh56): speed 0 goes out again, and no faster than without a reply."""
    link = through(SPEED, refusing(3, exception(code), writes_modbus))
    result, _ = stopped("hand", link, proven=True, model="tp")
    assert result.error is None, result
    times = [at for at, data in zip(link.sent_at, link.sent, strict=True) if writes_modbus(data)]
    assert len(times) == 4 and 0.4 < times[-1] - times[0] < 0.6, times


def test_a_hand_that_only_ever_says_05_is_stopped_if_its_speeds_are_0() -> None:
    """Acknowledge: it does what it was told."""
    link = through(SPEED, refusing(99, exception(5), writes_modbus))
    result, _ = stopped("hand", link, proven=True, model="tp")
    assert result.error is None and result.evidence == "read back", result


def test_a_hand_that_failed_and_kept_its_speed_was_not_stopped() -> None:
    """04, and no write arrives: the speeds read what they were."""
    inner = through(SPEED, lambda _link, _request, reply: [(0.002, reply)])
    link = ScriptedLink(
        lambda request: [(0.002, exception(4)(request))] if writes_modbus(request) else inner.answer(request)
    )
    result, _ = stopped("hand", link, proven=True, model="tp")
    assert result.error is DeviceRefused, result


def test_a_hand_that_refuses_for_good_was_not_stopped() -> None:
    link = through(SPEED, refusing(99, exception(6), writes_modbus))
    result, _ = stopped("hand", link, proven=True, model="tp")
    assert result.error is DeviceRefused, result
    times = [at for at, data in zip(link.sent_at, link.sent, strict=True) if writes_modbus(data)]
    assert 0.8 < times[-1] - times[0] < 1.1, "each step until it is acknowledged or its second is over"


@each_row("times", [1, 99])
def test_a_wrist_that_refuses_its_hold_is_read_and_held_anew(times: int) -> None:
    def refusal(request: bytes) -> bytes:
        return summed(f"90EB0104{request[4:7].hex()}00")

    link = through("wrist?seed=1", refusing(times, refusal, lambda request: request[4:7] == bytes.fromhex("310E04")))
    result, _ = stopped("wrist", link, proven=True)
    assert result.error is (None if times == 1 else DeviceRefused), result
    holds = [place for place, data in enumerate(link.sent) if data[4] == 0x31]
    assert all(link.sent[place - 1][4:7] == bytes.fromhex("30FC03") for place in holds), "the place is read before each"
    assert len(holds) == 2 if times == 1 else 0.8 < link.sent_at[holds[-1]] - link.sent_at[holds[0]] < 1.1, holds


@each_row(("taken", "error"), [("00", DeviceRefused), ("01", None)])
def test_a_hold_of_some_fingers_counts_only_when_it_was_accepted(taken: str, error: type | None) -> None:
    """A finger that reads no position: the others are held by their registers, whose acknowledgement may refuse (exo §2.2.4)."""
    held: list[bytes] = []

    def answer(request: bytes) -> Sequence[Reply]:
        if request == RELEASE:
            return [(0.01, summed(BEYOND))]
        if request[4:7] == bytes.fromhex("12CE05"):
            held.append(request)
            return [(0.01, summed(f"90EB010412CE05{taken}"))]
        values = {"11CE05": held[-1][7:17].hex() if held else "", "11DA05": "00" * 10, "110A06": BEYOND[10:]}
        found = values.get(request[4:7].hex().upper())
        return [(0.01, summed(f"90EB01{3 + len(found) // 2:02X}{request[4:7].hex()}{found}"))] if found else []

    result, _ = stopped("exo", ScriptedLink(answer), proven=True)
    if error is None:
        assert "refused" not in result.text and result.error is not DeviceRefused, result
    else:
        assert result.error is error and len(held) > 1, result


def test_a_cancel_that_is_refused_goes_out_again() -> None:
    """Until its second is over; the last word decides."""
    good: list[bytes] = []

    def alter(_link: ScriptedLink, _request: bytes, reply: bytes) -> Sequence[Reply]:
        good.append(reply)
        return [(0.002, reply)]

    for fault, error in (("", None), ("&fault=refuse", DeviceRefused)):
        link = through(f"ekso?seed=1{fault}", alter)
        result, _ = stopped("ekso", link)
        assert result.error is error, result
        assert len(link.sent) == 1 if error is None else 0.8 < link.sent_at[-1] - link.sent_at[0] < 1.1, link.sent_at


@each_row("times", [1, 99])
def test_power_that_a_barrett_hand_does_not_switch_off_at_once_is_asked_for_again(times: int) -> None:
    link = through(
        "barrett?initialized=1", refusing(times, lambda request: request + b"\nERR 128\r\n=> ", b"T\r".__eq__)
    )
    result, sent = stopped("barrett", link)
    assert result.error is (None if times == 1 else DeviceRefused), result
    assert [one.step.data for one in sent].count(b"T\r") == (2 if times == 1 else 3)


@each_row("cut", [1, 3, 6, 9])
@each_row("between", [0.02, 0.08])
def test_a_reply_in_two_pieces_is_one(cut: int, between: float) -> None:
    """A stop over TCP gives its first question 50 ms: the rest of the reply to it then stands before the next one."""
    free = [0.0]

    def alter(link: ScriptedLink, _request: bytes, reply: bytes) -> Sequence[Reply]:
        begins = max(free[0], link.clock) - link.clock + 0.002
        free[0] = link.clock + begins + between
        return [(begins, reply[:cut]), (begins + between, reply[cut:])]

    link = through(SPEED, alter)
    result, sent = stopped("hand", link)
    assert result.error is None, result
    assert sum(not one.reads for one in sent) == 1, "the acknowledgement was heard"
