"""No control block goes out once a stop has been asked for, and none of them could be a command for a hand that has left its loop."""

from __future__ import annotations

import signal
from itertools import product
from typing import Any

import pytest

from handctl.devices.barrett.realtime.blocks import LIMITS, Layout, Selection
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.errors import HandctlError
from handctl.link import transcript
from handctl.link.fake import FakeLink
from handctl.stop import stop_listener
from handctl.stop.device_access import DeviceAccess
from handctl.stop.stop_listener import StopListener
from tests.barrett.commands import fake
from tests.barrett.realtime import Run
from tests.barrett.support import CR, Simulated
from tests.support.cli import Result, run

MOVING = (
    "barrett",
    "realtime",
    "--motors",
    "1",
    "--velocity",
    "60",
    "--receive",
    "position",
    "--count",
    "40",
    "--json",
)
BLOCK = b"C\x3c"
FIFTH = 5


class Peer:
    """Another process that asks for a stop."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []

    def send(self, data: bytes) -> None:
        self.heard.append(data)

    def settimeout(self, seconds: float) -> None:
        """It has said all that it says."""

    def recv(self, size: int) -> bytes:
        return b""

    def close(self) -> None:
        """Nothing to release."""


class Door:
    """Where it knocks, once."""

    def __init__(self, peer: Peer) -> None:
        self._peers = [peer]

    def accept(self) -> Peer:
        if not self._peers:
            raise BlockingIOError
        return self._peers.pop()


class Moment:
    """The stop request: a signal, like that of the socket, at the moment that a test chooses. `wire` has what reached the hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.peer, self.wire, self.blocks = Peer(), list[bytes](), 0
        around, write = DeviceAccess.around, FakeLink.write

        def kept(access: DeviceAccess, link: Any) -> None:
            self.listener = StopListener.__new__(StopListener)
            self.listener._answer = lambda _meant: access.stop("stopped by a test")
            self.listener._after, self.listener._busy, self.listener._peers = access.end, False, []
            self.listener._door = Door(self.peer)  # type: ignore[assignment]
            monkeypatch.setattr(stop_listener, "_open", [self.listener])
            around(access, link)

        def written(link: FakeLink, data: bytes, deadline: Any) -> None:
            self.within(data)
            self.wire.append(bytes(data))
            write(link, data, deadline)

        monkeypatch.setattr(DeviceAccess, "around", kept)
        monkeypatch.setattr(FakeLink, "write", written)

    def within(self, data: bytes) -> None:
        """Called in the innermost step of sending."""

    def comes(self) -> None:
        signal.raise_signal(signal.SIGUSR1)

    def go(self) -> Result:
        before = signal.signal(signal.SIGUSR1, lambda _number, frame: self.listener._called(frame))
        try:
            return run(*MOVING, "-p", fake(wire="auto"))
        finally:
            signal.signal(signal.SIGUSR1, before)


@pytest.fixture
def moment(monkeypatch: pytest.MonkeyPatch) -> Moment:
    return Moment(monkeypatch)


def assert_stopped(moment: Moment, result: Result, blocks: int) -> None:
    """So many blocks went out, all of them before the stop; and the record of writes says the same."""
    first = moment.wire.index(b"\x03", moment.wire.index(b"1LOOP\r"))
    assert moment.wire[:first].count(BLOCK) == blocks
    assert not [data for data in moment.wire[first:] if data[:1] in b"CcAa"], moment.wire[first:]
    assert moment.peer.heard[0] == b"heard\n" and len(moment.peer.heard) == 2
    assert result.code in (6, 130)
    rows = [row["bytes"] for row in result.stream[1]["writes"]]
    assert [row for row in rows if row[:2] in ("43", "63")] == ["43 3C"] and rows.index("43 3C") < rows.index("03")


def test_a_stop_in_the_middle_of_a_block_waits_for_it(moment: Moment) -> None:
    """The bytes are on their way: they go out whole, and are noted, before the first byte of the stop."""

    def within(data: bytes) -> None:
        moment.blocks += data == BLOCK
        if data == BLOCK and moment.blocks == FIFTH:
            moment.comes()

    moment.within = within  # type: ignore[method-assign]
    assert_stopped(moment, moment.go(), FIFTH)


def test_a_block_that_was_begun_before_a_stop_does_not_follow_it(
    moment: Moment, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The method that sends was entered already; Ctrl-C is only counted there, so nothing but the link keeps the block back."""
    whole = transcript._whole

    def entered(link: Any) -> Any:
        if moment.wire.count(BLOCK) == FIFTH and not moment.blocks:
            moment.blocks = 1
            moment.comes()
        return whole(link)

    monkeypatch.setattr(transcript, "_whole", entered)
    assert_stopped(moment, moment.go(), FIFTH)


# -- blocks that would be text ----------------------------------------------------------------------------------------


def test_no_block_ends_a_line_of_text() -> None:
    """A carriage return anywhere in a block makes a GCL line of what stands before it: `43 0D` closes all motors."""
    layout = Layout({0: Selection(("velocity", "gain"), ())})
    velocities, gains = (range(low, high + 1) for low, high in (LIMITS["velocity"], LIMITS["gain"]))
    pairs = [(velocity, 20) for velocity in velocities] + [(20, gain) for gain in gains]
    for (velocity, gain), feedback in product(pairs, (True, False)):
        block = layout.control({0: {"velocity": velocity, "gain": gain}}, feedback=feedback)
        assert CR not in block
        assert block[1:] == bytes([(velocity - (velocity == 13)) & 0xFF, gain - (gain == 13)])


def test_what_is_sent_in_place_of_13_is_told() -> None:
    result = run(*MOVING[:5], "13", *MOVING[6:], "-p", fake(wire="auto"))
    rows, closing = result.stream
    commanded = [row["value"] for row in rows if row["name"] == "velocity_command"]
    assert (result.code, set(commanded)) == (0, {12})
    assert [message["code"] for message in closing["messages"]].count("sent-as-12") == 1


def thrown_out(velocity: int, rate: float = 0.0) -> tuple[Run, list[bytes]]:
    """A loop that drives F1, a stray byte behind its third block, and what was sent from there to the first ^C."""
    link = Simulated("initialized=1&wire=auto")
    loop = Run(
        link=link,
        motors=(0,),
        receive={0: ("position",)},
        controls=Controls({0: ("velocity",)}, {(0, "velocity"): velocity}),
    )
    samples = loop.loop.run(rate=rate, count=20, duration=None)
    try:
        for number, sample in enumerate(samples, 1):
            loop.samples.append(sample)
            if number == 3:
                link.feed(b"\x58")
                here = len(link.sent)
    except HandctlError as exc:
        loop.error = exc
    return loop, link.sent[here : link.sent.index(b"\x03", here)]


@pytest.mark.parametrize("velocity", [13, 67])
def test_a_stray_byte_makes_no_command_of_the_next_block(velocity: int) -> None:
    """It ends the loop (2048). What was on its way by then is text, and closes nothing."""
    loop, _ = thrown_out(velocity)
    assert isinstance(loop.error, HandctlError) and loop.error.code == "err-2048", loop.error
    assert all(f"{motor} P 0 S" in loop.control("motors") for motor in ("F2", "F3", "S")) and loop.stands()
    assert b"1T\r" in loop.link.sent and loop.loop.failure is None


def test_a_hand_that_has_left_its_loop_is_sent_no_block() -> None:
    """Its error has come by the time the next block is due: neither that block nor one of velocity 0 goes out."""
    for rate in (10.0, 50.0):
        loop, sent = thrown_out(20, rate)
        assert isinstance(loop.error, HandctlError) and loop.error.code == "err-2048", (rate, loop.error)
        assert not sent, (rate, sent)
        assert loop.loop.failure is None and loop.stands()
