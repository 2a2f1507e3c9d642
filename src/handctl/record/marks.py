"""Marks from outside: a key, a line on stdin, a datagram on a UDP port of this machine, a stream (`record.lsl`), each with the time at which it came."""

from __future__ import annotations

import queue
import socket
import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TextIO

from handctl.errors import LinkError
from handctl.files import as_text, unmarked
from handctl.system import clock

LONGEST = 200
"""Characters of a mark; the rest is left out."""
MOST = 40
"""Marks of a row, so that no line becomes longer than a reader takes; the next row gets those that came after them."""


class Heard(NamedTuple):
    """A mark, and when this computer heard it: seconds since 1970, and by its steady clock; None = at the row that has it."""

    text: str
    utc_s: float | None = None
    mono_s: float | None = None
    by: str = ""

    def as_row(self) -> dict[str, Any]:
        """For the sidecar."""
        return {"text": self.text, "host_utc_s": self.utc_s, "host_mono_s": self.mono_s, "by": self.by}


def text_of(text: str) -> str:
    """The text of a mark, whatever it came by: what every file can hold, and no more than LONGEST of it."""
    return as_text(text).strip()[:LONGEST]


class Marks:
    """Those that come while it is open. `take` hands them over, each once and in order; it never waits."""

    def __init__(self, keys: Callable[[], str], *, port: int | None = None, lines: TextIO | None = None) -> None:
        """`keys` is asked for what was pressed. Raises LinkError when nobody can listen on the port."""
        self._keys = keys
        self._ahead = clock.wall() - clock.now()
        """What the time of day is ahead of the steady clock, read once as for the rows: it may be set meanwhile."""
        self._came: queue.SimpleQueue[Heard] = queue.SimpleQueue()
        self._socket = _listening(port) if port is not None else None
        if self._socket is not None:
            self._begin(self._datagrams)
        if lines is not None:
            self._begin(lambda: self._lines(lines))

    @staticmethod
    def _begin(work: Callable[[], None]) -> None:
        threading.Thread(target=work, daemon=True).start()

    @property
    def port(self) -> int | None:
        """The UDP port, also where 0 asked for any."""
        return self._socket.getsockname()[1] if self._socket is not None else None

    def hear(self, text: str, by: str, mono_s: float | None = None) -> None:
        """A mark that comes now, or came at `mono_s` by the steady clock."""
        mono_s = clock.now() if mono_s is None else mono_s
        if text := text_of(text):
            self._came.put(Heard(text, round(mono_s + self._ahead, 6), round(mono_s, 6), by))

    def take(self) -> Sequence[Heard]:
        """What has come since the last call."""
        if pressed := self._keys():
            self.hear(pressed, "key")
        found = []
        while not self._came.empty():
            found.append(self._came.get())
        return found

    def close(self) -> None:
        """Nothing is heard any more."""
        if self._socket is not None:
            self._socket.close()

    def _datagrams(self) -> None:
        assert self._socket is not None
        while True:
            try:
                data = self._socket.recv(4 * LONGEST)
            except OSError:
                return
            self.hear(data.decode("utf-8", "replace"), "udp")

    def _lines(self, lines: TextIO) -> None:
        for line in unmarked(lines):
            self.hear(line, "line")


def _listening(port: int) -> socket.socket:
    """Only this machine is heard: a mark from elsewhere has another clock, and nobody else may write into a recording."""
    place = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        place.bind(("127.0.0.1", port))
    except (OSError, OverflowError) as exc:
        place.close()
        raise LinkError(
            f"UDP port {port}: cannot listen: {getattr(exc, 'strerror', None) or exc}",
            hint="another program may use it. Choose another port with --mark-udp",
            code="mark-udp",
        ) from exc
    return place
