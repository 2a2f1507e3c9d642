"""Drives a simulated line in real time behind the places of ports.py, for one client or for many: one select loop, no threads.

Knows the clock and the control socket, no protocol. A server prints one JSON line when it is ready, then serves until
SIGTERM, SIGINT or the end of its duration; it exits in order, with the state saved.

What is served behaves as a `Line`: `advance`, `feed`, `take`, `next_event`, `hung_up`, `client_baud`, `reconnect`. A place gives
one to each client who comes (`join`) and takes it back (`leave`). What all share is advanced, power-cycled, commanded and closed
once, and is `away` while the adapters of all clients are unplugged.
"""

from __future__ import annotations

import json
import select
import sys
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from typing import Any

from handctl.sim.engine.ports import PtyPort, ServeError, TcpClient, TcpDoor
from handctl.system import clock, local
from handctl.system.signals import Served as Signals

__all__ = ["Alone", "ControlPort", "ServeError", "Server", "send_control"]

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

    @property
    def away(self) -> bool:
        return bool(getattr(self.line, "away", False))

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
        self._clients: dict[int, tuple[local.Peer, bytearray]] = {}
        try:
            local.remove_dead(path)
            self._listener = local.Listener(path)
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
        return min([event for one in served if (event := one.next_event()) is not None], default=None)

    def _open(self) -> list[tuple[TcpDoor, Any]]:
        """The doors through which somebody can come now."""
        doors = [] if self._away else self._doors
        return [(door, place) for door, place in doors if door.fileno() >= 0 and getattr(place, "free", True)]

    def _give(self) -> bool:
        """Each client gets its own; False when nobody is there, and nobody can come any more."""
        if self._whole.away != self._away:
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
    times = [when for when in (event, end) if when is not None]
    timeout = max(0.0, min(times) - now - SPIN) if times else None
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
        with closing(local.connected(path, timeout)) as link:
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
