"""Drives a simulated line in real time behind ports, for one client or for many: one select loop, no threads.

Knows the clock and the control socket, no protocol. A server prints one JSON line when it is ready, then serves until
SIGTERM, SIGINT or the end of its duration; it exits in order, with the state saved.

What is served behaves as a `Line`: `advance`, `feed`, `take`, `next_event`, `hung_up`, `client_baud`, `reconnect`. A place gives
one to each client who comes (`join`) and takes it back (`leave`). What all share is advanced, power-cycled, commanded and closed
once, and is `away` while the adapters of all clients are unplugged.

A port is a pseudo terminal, or a client that came through a TCP port. It has `fileno`, -1 when there is nothing to wait for;
`read`, None when its client has left; `write`, which takes what fits without waiting; `baud`, the serial speed of its client or
None; `hang_up`; `plug`; `close`. One that is `gone` never comes back.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import sys
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from typing import Any

from handctl.sim import model_class
from handctl.sim.engine.can_line import CAN_FAULTS, CAN_OPTIONS, CanLine
from handctl.sim.engine.line_and_faults import LINE_FAULTS, LINE_OPTIONS, Line, Switched
from handctl.sim.engine.simulated_device import Options, Rows, soonest
from handctl.system import clock, local_socket, terminal
from handctl.system.signals import Served as Signals


class ServeError(Exception):
    """The place to serve at cannot be had; the text says what and why, `hint` the next step where it is a special one."""

    def __init__(self, text: str, hint: str = "") -> None:
        super().__init__(text)
        self.hint = hint


class PtyPort:
    """A pseudo terminal. Its slave side is kept open here, so that clients can come and go.

    With `name` a symbolic link leads to it, as /dev/serial/by-id does: the name stays when the terminal is another one.
    """

    gone = False

    def __init__(self, speed: int | None, name: str | None = None) -> None:
        self._speed = speed
        self._name = name
        self._closed = True
        self._open()
        self.link = name or terminal.pseudo_name(self._slave)

    def _open(self) -> None:
        try:
            self._master, self._slave = terminal.pseudo(self._speed)
        except OSError as exc:
            instead = "" if terminal.HERE else "serve on TCP: use --tcp 127.0.0.1:0, for CAN --slcan-tcp 127.0.0.1:0"
            raise ServeError(f"cannot open a pty: {exc.strerror or exc}", instead) from exc
        self._closed = False
        if self._name is not None:
            try:
                if os.path.islink(self._name) and not os.path.exists(self._name):
                    os.unlink(self._name)  # of one that was killed
                os.symlink(terminal.pseudo_name(self._slave), self._name)
            except OSError as exc:
                name, self._name = self._name, None
                self.close()
                raise ServeError(f"cannot make the link {name}: {exc.strerror}") from exc

    def plug(self, present: bool) -> None:
        if present and self._closed:
            self._open()
        elif not present:
            self.close()

    def fileno(self) -> int:
        return -1 if self._closed else self._master

    def read(self) -> bytes | None:
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        if self._closed:
            return len(data)
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def baud(self) -> int:
        """The speed that the client set; -1 for one that has no name."""
        return -1 if self._closed else terminal.speed_of(self._master)

    def hang_up(self) -> None:
        # Closing the master throws away what the client has not read: let it have the first half of the reply. The
        # kernel hands bytes to the slave side a little later, so a count of 0 means nothing at once.
        clock.sleep(0.02)
        patience = clock.now() + 0.2
        while terminal.unread(self._slave) and clock.now() < patience:
            clock.sleep(0.002)
        self.close()

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            os.close(self._master)
            os.close(self._slave)
            if self._name is not None:
                with contextlib.suppress(OSError):
                    os.unlink(self._name)


class TcpDoor:
    """A listening port; who comes gets a place of its own."""

    def __init__(self, host: str, port: int) -> None:
        self.host = host
        self._open(host, port)
        self._port = self._listener.getsockname()[1]
        shown = f"[{host}]" if ":" in host else host
        self.link = f"tcp://{shown}:{self._port}"

    def _open(self, host: str, port: int) -> None:
        try:
            family, kind, proto, _, address = socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )[0]
            self._listener = socket.socket(family, kind, proto)
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind(address)
            self._listener.listen(8)
        except OSError as exc:
            raise ServeError(f"cannot listen on {host}:{port}: {exc.strerror or exc}") from exc
        self._listener.setblocking(False)

    def move(self, host: str) -> None:
        """Listens at this address of the machine instead, or nowhere when the machine does not have it."""
        if host != self.host:
            self._listener.close()
            self.host = host
            with contextlib.suppress(ServeError):
                self._open(host, self._port)
                return
            self._listener.close()

    def fileno(self) -> int:
        """-1 when it listens nowhere."""
        return self._listener.fileno()

    def accept(self) -> TcpClient | None:
        """Whoever waits at the door; None: it has left again."""
        try:
            client, _ = self._listener.accept()
        except (BlockingIOError, ConnectionAbortedError):
            return None
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return TcpClient(client)

    def close(self) -> None:
        self._listener.close()


class TcpClient:
    """One client that came through a door."""

    def __init__(self, client: socket.socket) -> None:
        self._client = client
        self.gone = False

    def fileno(self) -> int:
        return -1 if self.gone else self._client.fileno()

    def read(self) -> bytes | None:
        try:
            return self._client.recv(4096) or None
        except BlockingIOError:
            return b""
        except OSError:
            return None

    def write(self, data: bytes) -> int:
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            return len(data)

    def baud(self) -> None:
        return None

    def hang_up(self) -> None:
        self.gone = True

    def plug(self, present: bool) -> None:
        self.gone = self.gone or not present

    def close(self) -> None:
        self._client.close()


SPIN = 0.0003  # s before an event that are waited for busily: select alone wakes up to 0.1 ms late
REMEMBERED = 256  # chunks of a client's bytes that the control command `heard` tells
UNREAD = 65536  # bytes kept for a client that does not read; what comes beyond is lost, as on a serial line


class Alone:
    """A line for one client at a time, as a place and as what is shared."""

    def __init__(self, line: Any) -> None:
        self.line = line
        self.free = True  # nobody is there: a line without a listener loses its bytes

    def __getattr__(self, name: str) -> Any:
        return getattr(self.line, name)

    def advance(self, now: float) -> None:
        self.line.advance(now)
        if self.free:
            self.line.take()

    def join(self) -> Any:
        self.free = False
        return self.line

    def leave(self, client: Any) -> None:
        self.free = True


class Guest:
    """One client: what is served to it, and where it is."""

    def __init__(self, place: Any, port: PtyPort | TcpClient) -> None:
        self.place = place
        self.served = place.join()
        self.port = port
        self.unsent = bytearray()

    def give(self) -> bool:
        """Passes on what has come; False when it hangs up."""
        taken = self.served.take()
        if len(self.unsent) + len(taken) <= UNREAD or not self.unsent:
            self.unsent += taken  # otherwise lost as it was taken: on a line without a speed that is in whole replies
        if self.unsent and self.port.fileno() >= 0:
            del self.unsent[: self.port.write(bytes(self.unsent))]
        if not self.served.hung_up:
            return True
        self.port.hang_up()
        return False

    def renew(self) -> None:
        """Another client, or its adapter is back: what was on its way is lost."""
        self.served.reconnect()
        self.unsent.clear()


class ControlPort:
    """A Unix socket beside the line: one command a line, one answer a line ("ok …" or "error …").

    Of every device it knows `heard`: what clients have sent since the last time, with the moments.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self._heard: deque[tuple[float, bytes]] = deque(maxlen=REMEMBERED)
        self._clients: dict[int, tuple[local_socket.Peer, bytearray]] = {}
        try:
            local_socket.remove_dead(path)
            self._listener = local_socket.Listener(path)
        except OSError as exc:
            raise ServeError(f"cannot open the control socket {path}: {exc.strerror or exc}") from exc

    def readers(self) -> list[int]:
        return [self._listener.fileno(), *self._clients]

    def serve(self, ready: list[int], line: Any) -> None:
        if self._listener.fileno() in ready:
            with suppress(OSError):
                client = self._listener.accept()
                self._clients[client.fileno()] = (client, bytearray())
        for descriptor in [number for number in ready if number in self._clients]:
            self._serve_client(descriptor, line)

    def _serve_client(self, descriptor: int, line: Any) -> None:
        client, text = self._clients[descriptor]
        try:
            data = client.recv(4096)
            text += data
            while b"\n" in text:
                command, _, rest = bytes(text).partition(b"\n")
                text[:] = rest
                text_of = command.decode("utf-8", "replace")
                answer = self._tell() if text_of.strip() == "heard" else _answer(line, text_of)
                client.send(answer.encode() + b"\n")
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data or len(text) > 4096:
            del self._clients[descriptor]
            client.close()

    def note(self, data: bytes) -> None:
        """A client has sent this, now."""
        self._heard.append((clock.now(), data))

    def _tell(self) -> str:
        told = [[round(moment, 6), data.hex()] for moment, data in self._heard]
        self._heard.clear()
        return f"ok {json.dumps(told)}"

    def close(self) -> None:
        for client, _ in self._clients.values():
            client.close()
        self._listener.close()


class Server:
    """What is served, and the places where clients come in."""

    def __init__(self, whole: Any) -> None:
        self._whole = whole
        self._doors: list[tuple[TcpDoor, Any]] = []
        self._guests: list[Guest] = []
        self._away = False
        self.links: list[str] = []

    def at(self, port: PtyPort, link: Callable[[str], str] = str, place: Any = None) -> Server:
        """One more place, for one client; of what all share, or of one part of it. `link` turns its name into what a client
        passes to --port."""
        self._guests.append(Guest(place or self._whole, port))
        self.links.append(link(port.link))
        return self

    def behind(self, door: TcpDoor, link: Callable[[str], str] = str, place: Any = None) -> Server:
        """One more place, for any number of clients, or for one at a time while others wait."""
        self._doors.append((door, place or self._whole))
        self.links.append(link(door.link))
        return self

    def run(self, duration: float | None = None, control: str | None = None) -> None:
        """Returns when asked to stop. Raises ServeError, or OSError for a state file."""
        with ExitStack() as stack:
            signals = stack.enter_context(Signals())
            stack.callback(self._close)
            panel = None if control is None else ControlPort(control)
            if panel is not None:
                stack.callback(panel.close)
            stack.callback(self._whole.close)
            told = {"ready": True, "link": self.links[0], **({"links": self.links} if len(self.links) > 1 else {})}
            try:
                print(json.dumps(told), flush=True)  # noqa: T201 - a server has no renderer
            except OSError as exc:
                raise ServeError(
                    f"stdout cannot be written, so no program can find out that the simulator is ready: {exc.strerror or exc}"
                ) from exc
            self._loop(panel, signals, None if duration is None else clock.now() + duration)

    def _loop(self, panel: ControlPort | None, signals: Signals, end: float | None) -> None:
        while not signals.stop:
            now = clock.now()
            if end is not None and now >= end:
                return
            self._advance(now)
            if not self._give():
                return
            guests = [] if self._away else [guest for guest in self._guests if guest.port.fileno() >= 0]
            readers = [signals.reader, *(guest.port.fileno() for guest in guests)]
            readers += [*(door.fileno() for door, _ in self._open()), *(panel.readers() if panel is not None else ())]
            writers = [guest.port.fileno() for guest in guests if guest.unsent]
            ready = _wait(now, self._next_event(), end, readers, writers)
            for guest in guests:  # a client may change it while an answer is on its way
                guest.served.client_baud = guest.port.baud()
            self._advance(clock.now())
            if signals.reader in ready:
                signals.drain()
            while signals.power_cycles:  # ahead of what clients have sent since
                signals.power_cycles -= 1
                self._whole.power_cycle()
            if panel is not None:
                panel.serve(ready, self._whole)
            heard = self._read(ready)
            if heard and panel is not None:
                panel.note(heard)

    def _advance(self, now: float) -> None:
        self._whole.advance(now)
        for guest in self._guests:
            guest.served.advance(now)

    def _next_event(self) -> float | None:
        served = [self._whole] if isinstance(self._whole, Alone) else [guest.served for guest in self._guests]
        return soonest(*(one.next_event() for one in served))

    def _open(self) -> list[tuple[TcpDoor, Any]]:
        """The doors through which somebody can come now."""
        doors = [] if self._away else self._doors
        return [(door, place) for door, place in doors if door.fileno() >= 0 and getattr(place, "free", True)]

    def _give(self) -> bool:
        """Each client gets its own; False when nobody is there, and nobody can come any more."""
        if getattr(self._whole, "away", False) != self._away:
            self._plug(self._away)
        if self._away:
            return True
        gone = [guest for guest in self._guests if not guest.give()]
        if gone:
            print("simulator: hung up in the middle of an answer (fault disconnect)", file=sys.stderr, flush=True)  # noqa: T201
        self._part(gone)
        return bool(self._guests or self._doors)

    def _plug(self, present: bool) -> None:
        """The adapters come, or go with all that is on its way; a TCP client has to connect again."""
        self._away = not present
        if present:
            self._whole.reconnect()
        for guest in self._guests:
            guest.port.plug(present)
            guest.unsent.clear()
            if present:
                guest.renew()

    def _read(self, ready: list[int]) -> bytes:
        """Passes on what has come in, and lets in who has come."""
        heard, gone = b"", []
        for guest in self._guests:
            data = guest.port.read() if guest.port.fileno() in ready else b""
            if data is None or guest.port.gone:
                gone.append(guest)
            elif data:
                heard += data
                guest.served.feed(data)
        self._part(gone)
        for door, place in self._open():
            if door.fileno() in ready and (port := door.accept()) is not None:
                guest = Guest(place, port)
                guest.renew()
                guest.served.advance(clock.now())
                self._guests.append(guest)
        return heard

    def _part(self, gone: list[Guest]) -> None:
        """Forgets clients that have left; a pseudo terminal that hung up is gone for good."""
        for guest in gone:
            guest.port.close()
            guest.place.leave(guest.served)
            self._guests.remove(guest)

    def _close(self) -> None:
        for one in (*(guest.port for guest in self._guests), *(door for door, _ in self._doors)):
            one.close()


def _wait(now: float, event: float | None, end: float | None, readers: list[int], writers: list[int]) -> list[int]:
    """Sleeps until something comes in, or shortly before the next event; the rest of that is waited for busily."""
    soon = soonest(event, end)
    timeout = None if soon is None else max(0.0, soon - now - SPIN)
    ready, _, _ = select.select(readers, writers, [], timeout)
    return ready


def _answer(line: Any, command: str) -> str:
    try:
        return f"ok {line.command(command)}"
    except (ValueError, OSError) as exc:
        return f"error {exc}"


def send_control(path: str, command: str, timeout: float = 5.0) -> str:
    """Sends one command to the control socket of a running server; returns its answer. Raises ServeError."""
    if "\n" in command:
        raise ServeError("a control command is one line")
    try:
        with closing(local_socket.connected(path, timeout)) as link:
            link.sendall(command.encode() + b"\n")
            answer = b""
            while not answer.endswith(b"\n"):
                data = link.recv(4096)
                if not data:
                    raise ServeError(f"control socket {path}: the simulator ended without an answer")
                answer += data
            return answer.decode("utf-8", "replace").rstrip("\n")
    except OSError as exc:
        raise ServeError(f"control socket {path}: {exc.strerror or exc}") from exc


OF_FIRST = ("state", "save", "elapse", "power-cycle", "use", "unplug")  # options that only the first wire has


class Wires(Switched):
    """A device with several wires: what is done on one shows on all. Each wire, and each client of the first, is a line of its
    own, with its own faults; the first line keeps the state file and takes the control commands of the device.
    """

    def __init__(self, kind: str, raw: dict[str, str], buses: list[str]) -> None:
        """Raises ValueError for an option or a fault that none of them knows."""
        self.kind = kind
        self.lines: list[Line | CanLine] = []
        self.door: TcpDoor | None = None  # moves to the address that the device has
        self._models = {bus: model_class(kind, bus) for bus in buses}
        self._options = {bus: {*_cable(bus)[1], *model.OPTIONS} for bus, model in self._models.items()}
        self._faults = {bus: {*_cable(bus)[2], *model.FAULTS} for bus, model in self._models.items()}
        self._buses: dict[Line | CanLine, str] = {}
        self._raw = Options(kind, raw, set().union(*self._options.values())).raw
        self._check(self._raw.get("fault", ""))
        for bus in buses:
            self.add(bus)

    def add(self, bus: str) -> Line | CanLine:
        """One more end of this wire."""
        raw = {name: text for name, text in self._raw.items() if name in self._options[bus]}
        model = self._models[bus]
        if self.lines:
            raw = {name: text for name, text in raw.items() if name not in OF_FIRST}
            model = self.lines[0].device.beside(model)
        if "fault" in raw:
            raw["fault"] = ",".join(self._known(raw["fault"], bus)) or "none"
        self.lines.append(_cable(bus)[0](model, {**raw, "bus": bus}))
        self._buses[self.lines[-1]] = bus
        return self.lines[-1]

    def _known(self, faults: str, bus: str) -> list[str]:
        names = [name.strip().replace("_", "-") for name in faults.split(",")]
        return [name for name in names if name in self._faults[bus]]

    def _check(self, faults: str) -> None:
        known: set[str] = set().union(*self._faults.values())
        for name in faults.split(","):
            if name.strip().replace("_", "-") not in {*known, "", "none"}:
                raise ValueError(
                    f"unknown fault {name!r} of the simulated {self.kind}. Known: {', '.join(sorted(known))}"
                )

    # -- as what the server has in front of its clients -------------------------------------------------------------------

    def join(self) -> Line | CanLine:
        """A client of the first wire."""
        line = self.add(next(iter(self._models)))
        if line.device.one_client:
            for other in self.lines[1:-1]:
                other.hung_up = other.hung_up or self._buses[other] == self._buses[line]
        return line

    def leave(self, line: Line | CanLine) -> None:
        self.lines.remove(line)
        self.gone += line.requests

    def reconnect(self) -> None:
        """Its adapters never went away."""

    def advance(self, now: float) -> None:
        for line in list(self.lines):
            line.advance(now)
        if self.door is not None:
            self.door.move(self.lines[0].device.host)

    gone = 0  # requests at ends that are no more

    @property
    def requests(self) -> int:  # type: ignore[override]
        return self.gone + sum(line.requests for line in self.lines)

    def power(self, on: bool) -> None:
        for line in self.lines:
            line.power(on)

    def fault(self, names: str) -> str:
        self._check(names)
        self._raw["fault"] = names
        for line in self.lines:
            line.fault(",".join(self._known(names, self._buses[line])) or "none")
        return names

    def further(self, words: list[str]) -> str:
        return self.lines[0].command(" ".join(words))

    def close(self) -> None:
        for line in self.lines:
            line.close()


def _cable(bus: str) -> tuple[type[Line] | type[CanLine], Rows, dict[str, str]]:
    return (CanLine, CAN_OPTIONS, CAN_FAULTS) if bus == "can" else (Line, LINE_OPTIONS, LINE_FAULTS)
