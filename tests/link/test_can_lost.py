"""A CAN adapter that goes away while something moves: it is looked for, and the stop goes out over the one that was open.

On python-can's `virtual` interface, and on a simulated slcan adapter behind a port that is plugged out and in.
"""

from __future__ import annotations

import errno
import os
import select
import subprocess
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import can
import pytest
import serial

from handctl.errors import LinkError, NoAnswer
from handctl.link import CanFrame, open_link
from handctl.link.can import CanLink
from handctl.link.slcan import SlcanBus
from handctl.sim import create
from handctl.sim.engine.slcan import Adapter
from tests.support.cli import PATIENCE, clean_environment, run, start
from tests.support.each_row import each_row
from tests.support.virtual import Clock, virtual_time

HOLD = CanFrame(0x15038001, b"\x65\x04\x6e\x01")
CHANNEL = "handctl-lost"


@pytest.fixture
def time_jumps() -> Iterator[Clock]:
    """Nobody waits in earnest."""
    with virtual_time() as clock:
        yield clock


def failing(error: Exception) -> Callable[..., Any]:
    def fail(*_: Any, **__: Any) -> Any:
        raise error

    return fail


class Plugged:
    """A virtual bus whose adapter is pulled, and there again after so many looks."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, interface: str = "virtual") -> None:
        self.other = can.Bus(interface="virtual", channel=CHANNEL)
        self.away = 0
        self.looks = 0
        self.errors = [can.CanInitializationError("no such device"), OSError(errno.ENODEV, "none"), ValueError("none")]
        self._open = can.Bus
        monkeypatch.setattr("handctl.link.can.can.Bus", self.opened)
        link = open_link(f"can:{interface}:{CHANNEL}")
        assert isinstance(link, CanLink)
        self.link, self._patch = link, monkeypatch

    def opened(self, **options: Any) -> Any:
        self.looks += 1
        if self.away:
            self.away -= 1
            raise self.errors[self.away % len(self.errors)]
        return self._open(**{**options, "interface": "virtual"})

    def pull(self, looks: int, error: Exception | None = None) -> None:
        """Out, for so many looks."""
        self.away, self.looks = looks, 0
        error = error or can.CanOperationError("gone", errno.ENODEV)
        self._patch.setattr(self.link._bus, "_recv_internal", failing(error))
        self._patch.setattr(self.link._bus, "send", failing(error))

    def heard(self) -> list[tuple[int, bytes]]:
        """What came to the other end."""
        found = []
        while (message := self.other.recv(0.0)) is not None:
            found.append((message.arbitration_id, bytes(message.data)))
        return found


@each_row("looks", [0, 1, 5])
def test_an_adapter_that_is_back_takes_the_stop(looks: int, time_jumps: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    bus = Plugged(monkeypatch)
    bus.pull(looks)
    with pytest.raises(LinkError):
        bus.link.send(HOLD, bus.link.deadline(PATIENCE))
    assert bus.link.reconnect(1.0) is True
    bus.link.send(HOLD, bus.link.deadline(PATIENCE))
    assert (bus.heard(), bus.looks) == ([tuple(HOLD)], looks + 1)
    bus.link.close()


def test_an_adapter_that_stays_away_is_looked_for_no_longer_than_asked(
    time_jumps: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing of what was to be sent reaches whatever has its descriptor by then."""
    bus = Plugged(monkeypatch)
    bus.pull(1000)
    gone, began = bus.link._bus, time_jumps.now()
    with pytest.raises(LinkError) as caught:
        bus.link.reconnect(1.0)
    assert caught.value.code == "cannot-open" and 1.0 <= time_jumps.now() - began < 1.2
    monkeypatch.setattr(gone, "send", failing(AssertionError("the lost bus was used")))
    with pytest.raises(LinkError) as caught:
        bus.link.send(HOLD, bus.link.deadline(1.0))
    assert (caught.value.code, caught.value.unsent, bus.link.raw_access()) == ("cannot-send", True, None)
    with pytest.raises(LinkError):
        bus.link.receive(bus.link.deadline(1.0))
    bus.link.close()
    bus.link.close()
    assert bus.heard() == []


@each_row(
    ("interface", "error", "kind", "unsent"),
    [
        ("virtual", can.CanOperationError("Transmit buffer full"), LinkError, False),
        ("socketcan", can.CanOperationError("Transmit buffer full"), LinkError, True),
        ("socketcan", can.CanOperationError("No buffer space", errno.ENOBUFS), NoAnswer, True),
        ("virtual", can.CanTimeoutError("the adapter does not accept data"), LinkError, False),
    ],
)
def test_a_bus_that_takes_no_frame_is_no_lost_adapter(
    interface: str, error: Exception, kind: type[Exception], unsent: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bus off, error passive, a full queue: opening it again would drop what is queued, the stop too."""
    bus = Plugged(monkeypatch, interface)
    before, bus.looks = bus.link._bus, 0
    monkeypatch.setattr(before, "send", failing(error))
    with pytest.raises(kind) as caught:
        bus.link.send(HOLD, bus.link.deadline(0.01))
    assert getattr(caught.value, "unsent", None) is unsent
    assert bus.link.reconnect(1.0) is False
    assert bus.link._bus is before and bus.looks == 0
    bus.link.close()


def test_an_interface_that_is_back_and_down_is_waited_for(time_jumps: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """It comes back down; the system sets it up a moment later."""
    bus, states = Plugged(monkeypatch, "socketcan"), iter([False, False, True])
    bus.pull(1, can.CanOperationError("Network is down", errno.ENETDOWN))
    monkeypatch.setattr("handctl.link.can._is_up", lambda channel: next(states))
    with pytest.raises(LinkError) as caught:
        bus.link.send(HOLD, bus.link.deadline(PATIENCE))
    assert caught.value.code == "down"
    assert bus.link.reconnect(1.0) is True
    bus.link.send(HOLD, bus.link.deadline(PATIENCE))
    assert (bus.heard(), bus.looks) == ([tuple(HOLD)], 4)
    bus.link.close()


# -- an adapter on a serial port --------------------------------------------------------------------------------------


class Usb:
    """The USB socket of a simulated slcan adapter, on virtual time: pulled out `at` a second for so long.

    What is plugged in then is `behind`, a wrist unless another one was given; `ports` are those that were opened.
    """

    def __init__(self, clock: Clock, at: float, seconds: float) -> None:
        self.clock = clock
        self._at, self._until = clock.now() + at, clock.now() + at + seconds
        self.adapter = self.behind = Adapter(create("wrist", {"bus": "can"}))
        self.name = b""
        self.ports: list[Port] = []

    @property
    def out(self) -> bool:
        return self._at <= self.clock.now() < self._until

    def open(self, *_: Any, **__: Any) -> Port:
        if self.out:
            raise serial.SerialException("no such port")
        if self.clock.now() >= self._until:
            self.adapter = self.behind
        self.adapter.advance(self.clock.now())
        self.adapter.reconnect()
        self.ports.append(Port(self))
        return self.ports[-1]


class Port:
    """One opening of it."""

    def __init__(self, usb: Usb) -> None:
        self._usb, self._adapter, self.heard = usb, usb.adapter, b""
        self.is_open, self.lost = True, False
        self.write_timeout: float | None = None

    def _there(self) -> Any:
        self.lost = self.lost or self._usb.out
        self._adapter.advance(self._usb.clock.now())
        if self.lost or not self.is_open:
            raise serial.SerialException("the device is gone")
        return self._adapter

    def write(self, data: bytes) -> None:
        self._there().feed(data)
        self.heard += data

    def read(self, _count: int) -> bytes:
        data: bytes = self._there().take()
        if self._usb.name:
            data = data.replace(b"NSIM1", b"N" + self._usb.name)
        return data

    def reset_input_buffer(self) -> None:
        self._there().take()

    def flush(self) -> None:
        """Written is sent."""

    def fileno(self) -> int:
        raise OSError

    def close(self) -> None:
        self.is_open = False


@pytest.fixture
def socket_of(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[float, float], Usb]]:
    """Where LINK leads: the socket is pulled so many seconds after the start."""
    with virtual_time() as clock:

        def made(at: float, seconds: float) -> Usb:
            usb = Usb(clock, at, seconds)
            monkeypatch.setattr("serial.serial_for_url", usb.open)
            monkeypatch.setattr("handctl.link.can._lock", lambda *_: None)
            return usb

        yield made


LINK = "can:slcan:/dev/ttyACM91"
MOVE = ("wrist", "move", "--pitch", "20", "--time", "3000", "-p", LINK, "--json")


def test_a_wrist_behind_an_adapter_that_bounces_is_asked_and_gets_its_stop(
    socket_of: Callable[[float, float], Usb],
) -> None:
    usb = socket_of(1.0, 0.4)
    result = run(*MOVE)
    assert result.code == 3 and "handctl has stopped it" in result.err, result
    first, then = usb.ports
    assert not first.is_open and b"T1503" not in first.heard
    lines = [line for line in then.heard.split(b"\r") if line.startswith(b"T")]
    assert lines[0] == b"T10FF0001104", "where it is comes before the command to stay there"
    assert lines[1].startswith(b"T150380014"), lines
    assert {one["state"] for one in result.json["writes"]} == {"confirmed"}


def test_an_adapter_that_stays_away_ends_as_before(socket_of: Callable[[float, float], Usb]) -> None:
    usb = socket_of(1.0, 1e6)
    result = run(*MOVE)
    assert (result.code, result.error["code"]) == (3, "lost"), result
    assert "has stopped" not in result.err and "power off" in result.err
    assert len(usb.ports) == 1 and not usb.ports[0].is_open, (
        "an open one keeps its name from the adapter that comes back"
    )
    assert [one["state"] for one in result.json["writes"]] == ["confirmed"], "no stop was sent"


def test_another_adapter_in_its_place_gets_no_frame(socket_of: Callable[[float, float], Usb]) -> None:
    """It leads to another bus. It was asked who it is, and is let go of."""
    usb = socket_of(1.0, 0.4)
    usb.behind = Adapter(create("wrist", {"bus": "can"}))
    opened = usb.open

    def another(*given: Any, **named: Any) -> Port:
        usb.name = b"" if not usb.ports else b"OTHR"
        return opened(*given, **named)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("serial.serial_for_url", another)
        result = run(*MOVE)
    assert result.code == 3 and "has stopped" not in result.err and "power off" in result.err, result
    assert len(usb.ports) > 1
    for port in usb.ports[1:]:
        assert not port.is_open and b"T1" not in port.heard, port.heard


def test_who_does_not_answer_as_a_wrist_behind_it_gets_no_command(socket_of: Callable[[float, float], Usb]) -> None:
    usb = socket_of(1.0, 0.4)
    usb.behind = Adapter(create("hand", {"bus": "can"}))
    result = run(*MOVE)
    assert result.code == 3 and "has stopped" not in result.err and "power off" in result.err, result
    (then,) = usb.ports[1:]
    assert {line for line in then.heard.split(b"\r") if line.startswith(b"T")} == {b"T10FF0001104"}, then.heard


def test_a_port_of_an_adapter_that_is_gone_is_closed(time_jumps: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can leaves it open where the adapter takes no C."""
    bus = SlcanBus("loop://", bitrate=1_000_000, meet=False, sleep_after_open=0.0)
    port = bus.serialPortOrig
    monkeypatch.setattr(port, "write", failing(serial.SerialException("gone")))
    with pytest.raises(can.CanOperationError):
        bus.shutdown()
    assert not port.is_open


@pytest.mark.real
def test_the_stop_of_a_process_with_its_guard_goes_out_over_a_terminal_that_comes_back(tmp_path: Path) -> None:
    """The adapter goes behind the tenth question of a movement, and is back under its name at once."""
    name = tmp_path / "tty"
    adapter = Adapter(create("wrist", {"bus": "can"}))
    began, heard, ends = time.monotonic(), [b"", b""], list[int]()

    def plug() -> None:
        ends[:] = os.openpty()
        tty.setraw(ends[1])
        name.symlink_to(os.ttyname(ends[1]))

    def serve(part: int, until: Callable[[], bool]) -> None:
        while not until():
            adapter.advance(time.monotonic() - began)
            if select.select([ends[0]], [], [], 0.002)[0]:
                with suppress(OSError):
                    heard[part] += (data := os.read(ends[0], 4096))
                    adapter.feed(data)
            os.write(ends[0], adapter.take())

    plug()
    words = ("wrist", "move", "--pitch", "20", "--time", "5000", "-p", f"can:slcan:{name}", "--json")
    with start(words, clean_environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        serve(0, lambda: heard[0].partition(b"T1504")[2].count(b"T10FF") >= 10 or process.poll() is not None)
        for end in ends:
            os.close(end)
        name.unlink()
        adapter.reconnect()
        plug()
        serve(1, lambda: process.poll() is not None)
        told = process.communicate(timeout=PATIENCE)
    for end in ends:
        os.close(end)
    assert process.returncode == 3, told
    frames = [line for line in heard[1].split(b"\r") if line.startswith(b"T")]
    assert frames[0] == b"T10FF0001104" and frames[1].startswith(b"T150380014"), (frames, told)
