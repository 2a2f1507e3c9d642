"""Drives a simulated line in real time behind one of the places of ports.py: one select loop, no threads.

Knows the clock and the control socket, no protocol. A server prints one JSON line when it is ready, then serves until
SIGTERM, SIGINT or the end of its duration; it exits in order, with the state saved.
"""

from __future__ import annotations

import json
import select
import sys
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from typing import Protocol

from handctl.sim.engine.ports import Port, PtyPort, ServeError, TcpPort
from handctl.system import clock, local
from handctl.system.signals import Served as Signals

__all__ = [
    "ControlPort",
    "ServeError",
    "Served",
    "send_control",
    "serve_both",
    "serve_pty",
    "serve_tcp",
    "tell_hung_up",
]

SPIN = 0.0003  # s before an event that are waited for busily: select alone wakes up to 0.1 ms late
REMEMBERED = 256  # chunks of a client's bytes that the control command `heard` tells
UNREAD = 65536  # bytes kept for a client that does not read; what comes beyond is lost, as on a serial line


class Served(Protocol):
    """What is served: a `Line`, or another device that takes and gives bytes, such as an slcan adapter."""

    client_baud: int | None

    @property
    def hung_up(self) -> bool: ...

    def advance(self, now: float) -> None: ...

    def feed(self, data: bytes) -> None: ...

    def take(self) -> bytes: ...

    def next_event(self) -> float | None: ...

    def reconnect(self) -> None: ...

    def power_cycle(self) -> None: ...

    def command(self, text: str) -> str: ...

    def close(self) -> None: ...


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

    def serve(self, ready: list[int], line: Served) -> None:
        if self._listener.fileno() in ready:
            with suppress(OSError):
                client = self._listener.accept()
                self._clients[client.fileno()] = (client, bytearray())
        for descriptor in [number for number in ready if number in self._clients]:
            self._serve_client(descriptor, line)

    def _serve_client(self, descriptor: int, line: Served) -> None:
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


def serve_pty(
    line: Served,
    speed: int | None,
    *,
    duration: float | None = None,
    control: str | None = None,
    link: Callable[[str], str] = str,
    name: str | None = None,
) -> None:
    """Serves the line on a new pty at this speed; returns when asked to stop. Raises ServeError, or OSError for a state
    file. `link` turns the name of the pty into what a client passes to --port; `name` is a symbolic link to it.
    """
    _serve(line, lambda: PtyPort(speed, name), duration, control, link)


def serve_tcp(
    line: Served,
    host: str,
    port: int,
    *,
    duration: float | None = None,
    control: str | None = None,
    link: Callable[[str], str] = str,
) -> None:
    """Serves the line on a TCP port (0: any free one); returns when asked to stop."""
    _serve(line, lambda: TcpPort(host, port), duration, control, link)


class Both(Served, Port, Protocol):
    """Line and port in one."""


def serve_both(both: Both, *, duration: float | None = None, control: str | None = None) -> None:
    """Serves what is a line and a port in one; returns when asked to stop."""
    _serve(both, lambda: both, duration, control, str)


def _serve(
    line: Served,
    open_port: Callable[[], Port],
    duration: float | None,
    control: str | None,
    link: Callable[[str], str],
) -> None:
    with ExitStack() as stack:
        signals = stack.enter_context(Signals())
        port = open_port()
        stack.callback(port.close)
        panel = None if control is None else ControlPort(control)
        if panel is not None:
            stack.callback(panel.close)
        stack.callback(line.close)
        try:
            links = getattr(port, "links", [])
            told = {"ready": True, "link": link(port.link), **({"links": links} if len(links) > 1 else {})}
            print(json.dumps(told), flush=True)  # noqa: T201 - a server has no renderer
        except OSError as exc:
            raise ServeError(
                f"stdout cannot be written, so no program can find out that the simulator is ready: {exc.strerror or exc}"
            ) from exc
        _loop(line, port, panel, signals, None if duration is None else clock.now() + duration)


def _loop(line: Served, port: Port, panel: ControlPort | None, signals: Signals, end: float | None) -> None:
    unsent = bytearray()
    while not signals.stop:
        now = clock.now()
        if end is not None and now >= end:
            return
        line.advance(now)
        taken = line.take()
        if len(unsent) + len(taken) <= UNREAD or not unsent:
            unsent += taken  # otherwise lost as it was taken: on a line without a speed that is in whole replies
        if unsent:
            del unsent[: port.write(bytes(unsent))]
        if getattr(line, "pulled", False) is True and isinstance(port, PtyPort | TcpPort):  # a line alone on its port
            away = bool(getattr(line, "away", False))
            port.plug(not away)
            unsent.clear()
            if not away:
                line.reconnect()
        elif line.hung_up:
            tell_hung_up()
            if port.hang_up():
                return
            line.reconnect()
            unsent.clear()
        readers = [signals.reader, *port.readers(), *(panel.readers() if panel is not None else ())]
        ready = _wait(now, line.next_event(), end, readers, port.writer() if unsent else None)
        line.client_baud = port.baud()  # a client may change it while an answer is on its way
        line.advance(clock.now())
        if signals.reader in ready:
            signals.drain()
        while signals.power_cycles:  # ahead of what clients have sent since
            signals.power_cycles -= 1
            line.power_cycle()
        if panel is not None:
            panel.serve(ready, line)
        data = port.read([descriptor for descriptor in port.readers() if descriptor in ready])
        if data is None:
            line.reconnect()
            unsent.clear()
        elif data:
            if panel is not None:
                panel.note(data)
            line.feed(data)


def tell_hung_up() -> None:
    """Says on stderr why a client is gone."""
    print("simulator: hung up in the middle of an answer (fault disconnect)", file=sys.stderr, flush=True)  # noqa: T201


def _wait(now: float, event: float | None, end: float | None, readers: list[int], writer: int | None) -> list[int]:
    """Sleeps until something comes in, or shortly before the next event; the rest of that is waited for busily."""
    times = [when for when in (event, end) if when is not None]
    timeout = max(0.0, min(times) - now - SPIN) if times else None
    ready, _, _ = select.select(readers, [] if writer is None else [writer], [], timeout)
    return ready


def _answer(line: Served, command: str) -> str:
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
