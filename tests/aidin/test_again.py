"""An AIDIN-hand whose connection is lost while it is driven: it is connected again, and gets the stop mode."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.devices.aidin import device
from handctl.errors import Interrupted, LinkError
from handctl.link.tcp import TcpLink
from handctl.link.transcript import TraceWriter, observed
from handctl.model.command_settings import Settings
from handctl.model.prompts import Prompts
from handctl.stop.device_access import DeviceAccess
from tests.aidin.support import STOP, feedback, hand_on, line
from tests.support.cli import PATIENCE, Result, run
from tests.support.each_row import each_row

pytestmark = [
    pytest.mark.real,
    pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning"),
]  # the server is a thread of this process

LOST = "the connection was lost. handctl reconnected"
TRIED = "tried to reconnect for 1 s"
POWER = "switch the hand's power off if it is still moving"


class Server:
    """A hand that answers each object, and closes its first connection after `objects` of `mode`. `log` is a list a connection.

    listens  it goes on listening then
    mute     on a later connection it says nothing
    """

    def __init__(self, mode: int, objects: int, *, listens: bool = True, mute: bool = False) -> None:
        self.mode, self.objects, self.listens, self.mute = mode, objects, listens, mute
        self.log: list[bytes] = []
        self.closed = threading.Event()
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.name = f"tcp://127.0.0.1:{self.socket.getsockname()[1]}"
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self.socket.accept()
            except OSError:
                return
            self.log.append(b"")
            with connection:
                with contextlib.suppress(OSError):
                    self._talk(connection)
                if not self.listens:
                    self.socket.close()
            self.closed.set()

    def _talk(self, connection: socket.socket) -> None:
        found, flows = 0, len(self.log) > 1
        while data := connection.recv(4096):
            self.log[-1] += data
            for request in data.splitlines():
                mode = json.loads(request).get("hand_mode")
                found += mode == self.mode
                flows = (flows or mode == 41) and mode != 3
                if len(self.log) == 1 and found >= self.objects:
                    return
                if len(self.log) == 1 or not self.mute:
                    connection.sendall(line(feedback(motor_pos=[20000] * 15, current_state=[100 * flows] * 15)))

    def end(self) -> None:
        if self.socket.fileno() >= 0:
            self.socket.shutdown(socket.SHUT_RDWR)
            self.socket.close()
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()


MakeServer = Callable[..., Server]


@pytest.fixture
def serve() -> Iterator[MakeServer]:
    made: list[Server] = []

    def make(mode: int, objects: int, **how: bool) -> Server:
        made.append(Server(mode, objects, **how))
        return made[-1]

    yield make
    for one in made:
        one.end()


WHOLE = ["0"] * 5 + ["100"] + ["0"] * 9
COMMANDS = {
    "currents": (41, ["currents", *WHOLE, "--cap", "300", "--yes"]),
    "joints": (22, ["joints", "index.q3=120"]),
    "encoders": (10, ["encoders", "index.m3=85000"]),
    "fingertips": (32, ["fingertips", "index.z=120"]),
    "home": (1, ["home", "--yes"]),
    "initial": (2, ["initial", "--yes"]),
}


def drive(name: str, server: Server) -> Result:
    return run("aidin", *COMMANDS[name][1], "-p", server.name, "--exchange", "poll", "--json")


def only_stops(server: Server) -> bool:
    """Whether nothing but the stop mode went over the second connection, four times at least, and there was no third."""
    (again,) = server.log[1:]
    return again.startswith(STOP * 4) and not again.replace(STOP, b"")


@each_row("name", COMMANDS)
def test_a_lost_connection_is_opened_again_for_the_stop(name: str, serve: MakeServer) -> None:
    server = serve(COMMANDS[name][0], 4)
    result = drive(name, server)
    server.end()
    assert result.code == 3, result
    assert only_stops(server), server.log
    assert STOP not in server.log[0]
    error = result.error
    assert "closed" in error["text"] and error["code"] == "lost"
    assert error["hint"].startswith(f"{LOST[0].upper()}{LOST[1:]}: stop was sent"), error
    for untrue in ("no stop", "cannot", "goes on"):
        assert untrue not in error["hint"]
    last = [row for row in result.json["writes"] if row["state"] != "not-sent"][-1]
    seen = name == "currents"  # a current flowed before, and none flows now
    assert bytes.fromhex(last["bytes"]) == STOP and last["count"] > 3
    assert (last["state"], bool(last["next"])) == (("confirmed", False) if seen else ("sent", True))


def test_a_hand_that_says_nothing_then_has_not_confirmed_it(serve: MakeServer) -> None:
    server = serve(41, 4, mute=True)
    result = drive("currents", server)
    server.end()
    assert result.code == 3 and only_stops(server)
    hint = result.error["hint"]
    assert hint.startswith(f"{LOST[0].upper()}{LOST[1:]}") and "is not confirmed: the hand sends nothing" in hint


@each_row("name", ["currents", "encoders"])
def test_where_nobody_listens_any_more(name: str, serve: MakeServer) -> None:
    server = serve(COMMANDS[name][0], 4, listens=False)
    begin = time.monotonic()
    result = drive(name, server)
    assert result.code == 3, result
    assert len(server.log) == 1 and STOP not in server.log[0]
    hint = result.error["hint"]
    assert hint.lower().startswith(POWER) and TRIED in hint.lower() and "refused" in hint and LOST not in hint
    assert ("No stop was sent" in hint) == (name == "encoders")
    assert time.monotonic() - begin > device.AGAIN
    assert all(bytes.fromhex(row["bytes"]) != STOP for row in result.json["writes"] if row["state"] != "not-sent")


def driven(server: Server, prompts: Prompts, body: Callable[[], None], link: TcpLink | None = None) -> None:
    """`body` while a hand is guarded whose connection has been closed by then."""
    hand = hand_on(link or TcpLink(server.name))
    try:
        with device.stopped_if_cut_short(hand, prompts, "moving; "):
            hand.conversation.send(device.object_of(device.Mode.INITIAL))
            assert server.closed.wait(PATIENCE)
            body()
    finally:
        hand.link.close()


def test_an_interrupt_that_meets_a_lost_connection_stops_all_the_same(serve: MakeServer) -> None:
    server = serve(2, 1)

    def press() -> None:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        driven(server, Prompts(), press)
    server.end()
    assert caught.value.text.startswith(f"interrupted: moving; {LOST}")
    assert only_stops(server)


class Pressed(TcpLink):
    """Ctrl-C comes at each try to connect again."""

    tries = 0

    def reconnect(self, seconds: float) -> bool:
        self.tries += 1
        signal.raise_signal(signal.SIGINT)
        return super().reconnect(seconds)


@each_row("first", [LinkError, KeyboardInterrupt])
def test_the_second_interrupt_ends_it_at_once(
    first: type[BaseException], serve: MakeServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first one asks for what is being done."""
    server = serve(2, 1, listens=False)
    link = Pressed(server.name)

    def body() -> None:
        raise first("connection closed")

    monkeypatch.setattr(device, "AGAIN", 3 * PATIENCE)
    begin = time.monotonic()
    with pytest.raises((LinkError, Interrupted)) as caught:
        driven(server, TerminalPrompts(quiet=True), body, link)
    assert link.tries == (2 if first is LinkError else 1)
    assert time.monotonic() - begin < PATIENCE
    assert "interrupted while reconnecting" in caught.value.hint.lower()
    assert "power off" in caught.value.text + caught.value.hint and LOST not in caught.value.text + caught.value.hint


def test_the_wish_of_another_process_opens_it_again_too(serve: MakeServer) -> None:
    server, lines = serve(2, 1), list[str]()
    link = observed(TcpLink(server.name), TraceWriter(lines.append))
    hold = DeviceAccess(SimpleNamespace(prompts=Prompts(), settings=Settings(), writes=False, opened=None, session=None, family=SimpleNamespace(kind="aidin")), None)  # type: ignore[arg-type]  # fmt: skip
    hold.link = link
    hand = hand_on(link)  # type: ignore[arg-type]
    hand.conversation.send(device.object_of(device.Mode.INITIAL))
    assert server.closed.wait(PATIENCE)
    told = hold.stop("stopped")
    link.close()
    server.end()
    assert not told["error"] and "connected again after the connection was lost: stop was sent" in told["text"], told
    assert server.log[1].startswith(STOP * 3) and server.log[1].replace(STOP, b"") == b""
    events = [text.split(" ", 2)[2].strip() for text in lines if " ! " in text]
    assert events == ["disconnect", "reconnect"]


def test_nothing_is_sent_where_nothing_was_driven(serve: MakeServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """The child that is to stop the hand cannot be started: the link is not lost."""
    server = serve(2, 1)

    def full() -> int:
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("handctl.link.deadman.os.fork", full)
    hand = hand_on(TcpLink(server.name))
    with pytest.raises(LinkError) as caught, device.stopped_if_cut_short(hand, Prompts()):
        raise AssertionError("driven")
    hand.link.close()
    server.end()
    assert caught.value.code == "no-guard" and LOST not in caught.value.hint
    assert server.log in ([], [b""])
