"""Virtual time for what reads the machine's clock: plain --fake, a link, and a simulator's own event loop.

`virtual_time` lets `sleep` move the clock. A `Loop` serves a simulator in this process: its command line, its event loop, its
ports and its control socket are the real ones, on socket pairs in place of terminals and connections. The loop has a thread
of its own, and takes turns with the test: it runs only while the test waits for something, so nothing depends on the machine.
"""

from __future__ import annotations

import io
import json
import os
import select
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from typing import Any, TextIO
from unittest import mock

import click
import serial

from handctl.link.link_interface import Link
from handctl.sim.cli import cli
from handctl.sim.engine import serve
from handctl.system import clock, terminal, waits
from tests.support.cli import PATIENCE

TICK = 0.00002
"""Seconds that a turn of the loop takes while it waits busily."""


class Clock:
    """Time that passes when somebody sleeps."""

    def __init__(self) -> None:
        self.moment = 1000.0
        self._wall = time.time() - self.moment

    def now(self) -> float:
        return self.moment

    def wall(self) -> float:
        return self._wall + self.moment

    def sleep(self, seconds: float) -> None:
        self.moment += max(0.0, seconds)

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Let all of handctl live by it."""
        with (
            mock.patch.object(clock, "now", self.now),
            mock.patch.object(Link, "now", staticmethod(self.now)),  # bound when it was imported
            mock.patch.object(clock, "wall", self.wall),
            mock.patch.object(clock, "sleep", self.sleep),
            mock.patch.object(time, "sleep", self.sleep),
        ):
            yield


@contextmanager
def virtual_time() -> Iterator[Clock]:
    """What sleeps moves the clock, and nobody waits."""
    found = Clock()
    with found.installed():
        yield found


class Answering:
    """A port of pyserial's with somebody behind it who answers at once: what to which bytes, and what was heard."""

    def __init__(self, answer: Callable[[bytes], bytes]) -> None:
        self.answer, self.heard, self.came = answer, b"", b""
        self.is_open = True
        self.write_timeout: float | None = None

    def write(self, data: bytes) -> None:
        self.heard += data
        self.came += self.answer(data)

    def read(self, count: int) -> bytes:
        data, self.came = self.came[:count], self.came[count:]
        return data

    def reset_input_buffer(self) -> None:
        self.came = b""

    def flush(self) -> None:
        """Written is sent."""

    def fileno(self) -> int:
        raise OSError

    def close(self) -> None:
        self.is_open = False


class Signals:
    """What a served simulator hears beside its clients."""

    def __init__(self) -> None:
        self.stop = False
        self.power_cycles = 0
        self._ends = socket.socketpair()
        self.reader = self._ends[0].fileno()

    def drain(self) -> None:
        """Nothing woke it."""

    def __enter__(self) -> Signals:
        return self

    def __exit__(self, *_: object) -> None:
        for end in self._ends:
            end.close()


class _End(socket.socket):
    """One end of a pair; it has no options of TCP."""

    def setsockopt(self, *_: Any) -> None:
        """None of them matters here."""


def _pair() -> tuple[_End, _End]:
    one, two = (_End(fileno=end.detach()) for end in socket.socketpair())
    two.setblocking(False)
    return one, two


class _Door:
    """A listening socket: who comes rings at its descriptor."""

    def __init__(self, address: Any) -> None:
        self.address = address
        self.waiting: deque[_End] = deque()
        self._bell, self._button = socket.socketpair()

    def fileno(self) -> int:
        return self._bell.fileno()

    def getsockname(self) -> Any:
        return self.address

    def ring(self) -> _End:
        """Somebody comes: his end."""
        theirs, ours = _pair()
        theirs.setblocking(False)
        self.waiting.append(theirs)
        self._button.send(b"!")
        return ours

    def accept(self) -> tuple[_End, Any]:
        if not self.waiting:
            raise BlockingIOError
        self._bell.recv(1)
        return self.waiting.popleft(), self.address

    def close(self) -> None:
        for end in (self._bell, self._button, *self.waiting):
            end.close()


class Client:
    """Somebody at a served port. It has of pyserial's `Serial` what python-can and handctl's links use."""

    def __init__(
        self, loop: Loop, end: socket.socket, terminal: Terminal | None = None, timeout: float = PATIENCE
    ) -> None:
        self._loop, self._end, self._terminal = loop, end, terminal
        self._came = bytearray()
        self.gone = False
        self.is_open = True
        self.timeout: float | None = timeout
        self.write_timeout: float | None = None

    @property
    def baudrate(self) -> int:
        assert self._terminal is not None
        return self._terminal.speed

    @baudrate.setter
    def baudrate(self, speed: int) -> None:
        assert self._terminal is not None
        self._terminal.speed = speed

    def write(self, data: bytes) -> int:
        """Waits, so that the other end has it at this moment."""
        view = memoryview(bytes(data))
        while view:
            try:
                view = view[self._end.send(view) :]
            except BlockingIOError:
                self._loop.sleep(0.0)
            except OSError:
                self.gone = True
                raise serial.SerialException("the other end has gone") from None
        self._loop.sleep(0.0)
        return len(data)

    def _take(self) -> None:
        while not self.gone:
            try:
                data = self._end.recv(65536)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            self.gone = not data
            self._came += data

    @property
    def in_waiting(self) -> int:
        self._loop.sleep(0.0)
        self._take()
        return len(self._came)

    def read(self, count: int = 1, seconds: float | None = None) -> bytes:
        """So many bytes, or fewer when they have not come within `seconds`, or the other end has gone."""

        def there() -> bool:
            self._take()
            return self.gone or len(self._came) >= count

        if not there():
            patience = self.timeout if seconds is None else seconds
            self._loop.until(there, PATIENCE if patience is None else patience)
        data, self._came[:count] = bytes(self._came[:count]), b""
        if not data and self.gone:
            raise EOFError("the other end has gone")
        return data

    def hangs_up(self, seconds: float = 1.0) -> bool:
        """Whether the other end goes, whatever comes before."""

        def gone() -> bool:
            self.reset_input_buffer()
            return self.gone

        return self._loop.until(gone, seconds)

    def some(self, seconds: float | None = None) -> bytes:
        """What comes first, in one piece."""
        first = self.read(1, seconds)
        return first + (self.read(len(self._came)) if self._came else b"")

    def read_until(self, end: bytes) -> bytes:
        data = b""
        while not data.endswith(end) and (more := self.read(1)):
            data += more
        return data

    def ask(self, request: bytes, count: int, seconds: float | None = None) -> bytes:
        """What comes after a request."""
        self.write(request)
        return self.read(count, seconds)

    def reset_input_buffer(self) -> None:
        self._take()
        self._came.clear()

    def flush(self) -> None:
        """What is written has gone."""

    def fileno(self) -> Client:
        """What the slcan adapter's bus gives to `wait`, which stands for the system's there."""
        return self

    def __int__(self) -> int:
        raise io.UnsupportedOperation("nothing waits for it but the loop")

    def wait(self, seconds: float) -> bool:
        """Until something has come, or the other end has gone; whether it is so."""

        def there() -> bool:
            self._take()
            return self.gone or bool(self._came)

        return there() or self._loop.until(there, seconds)

    def close(self) -> None:
        if self.is_open:
            self.is_open = False
            self._end.close()
            self._loop.sleep(0.0)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Terminal:
    """A pseudo-terminal: the speed that a client has set, and the client's end."""

    def __init__(self, name: str, speed: int | None, end: int) -> None:
        self.name, self.speed, self.end = name, speed or 38400, end


class _Peer:
    """Somebody at the control socket."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def sendall(self, data: bytes) -> None:
        self._client.write(data)

    def recv(self, _count: int) -> bytes:
        try:
            return self._client.some()
        except EOFError:
            return b""

    def close(self) -> None:
        self._client.close()


class Loop(Clock):
    """`handctl sim WORDS` in this process; `link` is what it announced."""

    def __init__(self, *words: object) -> None:
        super().__init__()
        self.signals = Signals()
        self.told: list[str] = []
        self.complained: list[str] = []
        self._doors: dict[Any, _Door] = {}
        self._terminals: list[Terminal] = []
        self._by_master: dict[int, Terminal] = {}
        self._horizon = self.moment
        self._due: float | None = None
        self._ours, self._theirs = threading.Lock(), threading.Lock()  # whose turn it is
        for turn in (self._ours, self._theirs):
            turn.acquire()
        self._ended = False
        self._failed: BaseException | None = None
        self.code: int | None = None
        self._words = [str(word) for word in words]
        self._patches = ExitStack()
        self._thread = threading.Thread(target=self._serve)

    # -- the test's side ----------------------------------------------------------------------------------------------

    def __enter__(self) -> Loop:
        def listen(door: Any, host: str, port: int) -> None:
            door._listener = self._listener(host, port)

        enter = self._patches.enter_context
        enter(self.installed())
        defer_unused_modules = SimpleNamespace(
            pseudo=self._opened, pseudo_name=self._name, speed_of=self._speed_of, unread=terminal.unread
        )
        enter(mock.patch.object(serve, "terminal", defer_unused_modules))
        enter(mock.patch.object(serve.TcpDoor, "_open", listen))
        enter(mock.patch.object(serve, "Signals", lambda: self.signals))
        enter(mock.patch.object(serve, "select", SimpleNamespace(select=self._select)))
        enter(mock.patch.object(serve, "print", self._print, create=True))
        local = SimpleNamespace(remove_dead=lambda _path: None, Listener=self._control, connected=self._connected)
        enter(mock.patch.object(serve, "local_socket", local))
        enter(mock.patch.object(serial, "serial_for_url", self._for_url))
        self._thread.start()
        assert self._ours.acquire(timeout=PATIENCE), "the loop does not wait for anything"
        if self._ended:
            self.__exit__()
            raise AssertionError(f"the simulator did not start: {self.complained}") from self._failed
        ready = json.loads(self.told.pop(0))
        assert ready["ready"] is True
        self.link: str = ready["link"]
        self.links: list[str] = ready.get("links", [self.link])
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.stop()
        finally:
            self._patches.close()
            for terminal in self._terminals:
                if terminal.end >= 0:
                    os.close(terminal.end)

    def stop(self) -> tuple[int | None, list[str], list[str]]:
        """End it; exit code, what it said on stdout behind the ready line, and on stderr."""
        self.signals.stop = True
        while not self._ended:
            self.sleep(0.0)
        self._thread.join(PATIENCE)
        return self.code, self.told, self.complained

    @property
    def ended(self) -> bool:
        """Whether it has ended by itself."""
        return self._ended

    def sleep(self, seconds: float) -> None:
        """Let the loop run for so long."""
        if threading.current_thread() is self._thread:  # the loop itself sleeps
            super().sleep(seconds)
            return
        end = self.moment + max(0.0, seconds)
        self._run(end)
        if self._ended:
            self.moment = max(self.moment, end)

    def until(self, what: Callable[[], bool], seconds: float = PATIENCE) -> bool:
        """Let the loop run from event to event until something is so, or for `seconds`; whether it is so."""
        end = self.moment + seconds
        self._run(self.moment)
        while not what():
            if self._ended or self.moment >= end:
                return False
            self._run(end if self._due is None else min(self._due, end))
        return True

    def open(self, speed: int | None = None, link: str | None = None) -> Client:
        """Somebody comes to the port."""
        place = (link or self.link).removeprefix("can:slcan:")
        if "://" not in place:
            name = os.readlink(place) if os.path.islink(place) else place
            terminal = next(one for one in self._terminals if one.name == name)
            if speed is not None:
                terminal.speed = speed
            end = socket.socket(fileno=os.dup(terminal.end))
            end.setblocking(False)
            return Client(self, end, terminal)
        host, _, number = place.partition("://")[2].rpartition(":")
        return self.come((host, int(number)))

    def come(self, address: Any) -> Client:
        """Somebody comes to a listening port. Raises ConnectionRefusedError."""
        door = self._doors.get(address)
        if door is None or door.fileno() < 0:
            raise ConnectionRefusedError(address)
        client = Client(self, door.ring())
        self.sleep(0.0)
        return client

    def tell(self, command: str) -> str:
        """What it answers at its control socket."""
        return serve.send_control("control", command)

    def _run(self, horizon: float) -> None:
        """Give the loop its turn, until nothing is left for it to do before this moment."""
        if self._ended:
            return
        self._horizon = max(self.moment, horizon)
        self._theirs.release()
        assert self._ours.acquire(timeout=PATIENCE), "the loop does not wait for anything"
        if self._failed is not None:
            failed, self._failed = self._failed, None
            raise failed

    # -- what stands for the system ---------------------------------------------------------------------------------------

    def _for_url(self, url: str, **options: Any) -> Client:
        slcan: Any = sys.modules.get("handctl.link.slcan")
        if slcan is not None and slcan.readable is waits.readable:
            self._patches.enter_context(mock.patch.object(slcan, "readable", Client.wait))
        try:
            client = self.open(link=url)
        except ConnectionRefusedError as exc:
            raise serial.SerialException(f"could not open port {url}") from exc
        client.timeout = options.get("timeout")
        return client

    def _opened(self, speed: int | None) -> tuple[int, int]:
        theirs, ours = _pair()
        theirs.setblocking(False)
        terminal = Terminal(f"/dev/pts/served-{len(self._terminals)}", speed, os.dup(ours.fileno()))
        self._terminals.append(terminal)
        master, slave = theirs.detach(), ours.detach()
        self._by_master[master] = self._by_master[slave] = terminal
        return master, slave

    def _name(self, slave: int) -> str:
        return self._by_master[slave].name

    def _speed_of(self, master: int) -> int:
        return self._by_master[master].speed

    def _listener(self, host: str, port: int) -> _Door:
        if not host.startswith("127."):
            raise serve.ServeError(f"cannot listen on {host}:{port}: the machine does not have it")
        address = (host, port or 40000 + len(self._doors))
        self._doors[address] = _Door(address)
        return self._doors[address]

    def _control(self, _path: str) -> Any:
        door = self._doors["control"] = _Door("control")
        return SimpleNamespace(fileno=door.fileno, accept=lambda: door.accept()[0], close=door.close)

    def _connected(self, _path: str, _seconds: float) -> _Peer:
        return _Peer(self.come("control"))

    def _print(self, text: str, file: TextIO | None = None, flush: bool = False) -> None:
        (self.told if file is None else self.complained).append(text)

    # -- the loop's side --------------------------------------------------------------------------------------------------

    def _serve(self) -> None:
        try:
            cli.main(self._words, standalone_mode=False)
            self.code = 0
        except click.ClickException as exc:
            self.code = exc.exit_code
            self.complained.append(exc.format_message())
        except BaseException as exc:  # noqa: BLE001 - the test shows it
            self._failed = exc
        finally:
            self._ended = True
            self._ours.release()

    def _select(self, readers: list[int], writers: list[int], _failing: list[int], timeout: float | None) -> Any:
        """As the system's, in virtual time; whatever has to be waited for is waited for in the test's turn."""
        due = None if timeout is None else self.moment + timeout
        while True:
            ready = select.select(readers, writers, [], 0)
            if any(ready) or self.signals.stop or self.signals.power_cycles:
                return ready
            if due is not None and due <= self._horizon:
                self.moment = max(due, self.moment + TICK)
                return ready
            self.moment = max(self.moment, self._horizon)
            self._due = due
            self._ours.release()
            self._theirs.acquire()
