"""A link around a simulated device: `fake://exo?seed=1&fault=noise&state=FILE&clock=virtual`.

Begins where the cable would: it hands bytes to a simulator and takes bytes from it. Knows no protocol.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from handctl.errors import LinkError, UsageError
from handctl.link.link_interface import ByteLink, CanFrame, Deadline, FrameLink, Link, Trouble, options_in, unsent
from handctl.number_parsing import number_in
from handctl.system import clock
from handctl.system.user_folders import own_folder, private_folders

VIRTUAL_BEGAN = 1_767_225_600
"""Where the time of day begins on virtual time, unless the LINK says otherwise: 2026-01-01T00:00:00Z."""
STANDSTILL = 1000
"""So many exchanges may cost no virtual time at all: a device behind `wire=` spends what its line takes."""
EXCHANGE = 0.001
"""Seconds that each one beyond those costs, so that whatever is bounded by time ends: no line is quicker for long."""
_OPTIONS = "`handctl sim {kind} -h` lists the options"


def split_url(link: str) -> tuple[str, dict[str, str]]:
    """``fake://exo?seed=1&fault=noise`` -> ("exo", {"seed": "1", "fault": "noise"}). Raises UsageError."""
    kind = link.removeprefix("fake://").partition("?")[0].rstrip("/")
    options = options_in(link, _OPTIONS.format(kind=kind))
    for key, value in options.items():
        if "%" in value:
            from urllib.parse import unquote

            options[key] = unquote(value)
    return kind, options


def carries_frames(link: str) -> bool:
    """Whether this fake:// LINK is a CAN bus."""
    from handctl.sim import carries_frames

    return carries_frames(*split_url(link))


def meaning_of(kind: str, fault: str) -> str:
    """What the simulator of this kind of device does under a fault, in its own words."""
    from handctl.sim import meaning_of

    return meaning_of(kind, fault)


class _Simulated(Link):
    """A simulator in this process, in real time or (`clock=virtual`) in time that jumps from event to event."""

    fake = True

    def __init__(self, link: str, more: Mapping[str, str]) -> None:
        """`more` are options of the simulator beyond those of the LINK."""
        from handctl.sim import create

        self.name = link
        kind, options = split_url(link)
        options.update(more)
        if "transcript" in options:
            from handctl.link.twin_values import values_of

            options["values"] = values_of(kind, options.pop("transcript"))
        said = options.pop("clock", "real")
        kept, _, began = said.partition("@")
        moment = number_in(began) if began else VIRTUAL_BEGAN
        if kept not in ("real", "virtual") or moment is None or (began and kept == "real"):
            raise UsageError(
                f"{link}: clock={said}: expected real or virtual",
                hint="write `clock=virtual`, or leave it out. `clock=virtual@N` begins N seconds after 1970",
            )
        self._began = moment
        try:
            self._line: Any = create(kind, options)  # a Line, or a CanLine for bus=can
        except ValueError as exc:
            raise UsageError(f"{link}: {exc}", hint=_OPTIONS.format(kind=kind)) from exc
        except OSError as exc:
            raise UsageError(
                f"{link}: {exc.filename or ''}: {exc.strerror or exc}", hint="check the file and its folder"
            ) from exc
        self._told = kind, options
        self._virtual: float | None = 0.0 if kept == "virtual" else None
        self._stands: tuple[float, int] = (0.0, 0)  # since when time has stood still, and how much was sent since
        self._closed = False
        self._line.advance(self.now())

    @property
    def twin(self) -> str:
        """What the simulator took of the facts and values of a device, in words, and what it cannot show."""
        from handctl.sim import words_of_twin

        return words_of_twin(*self._told, self._line.values)

    def now(self) -> float:
        return clock.now() if self._virtual is None else self._virtual

    def wall(self) -> float:
        return clock.wall() if self._virtual is None else self._began + self._virtual

    def sleep(self, seconds: float) -> None:
        self._sleep_until(self.now() + max(0.0, seconds))

    def _sleep_until(self, moment: float) -> float:
        """The present moment, then."""
        if self._virtual is None:
            clock.sleep(max(0.0, moment - clock.now()))
            return clock.now()
        if moment > self._virtual:
            self._virtual = moment
        return self._virtual

    def _say(self, feed: Callable[..., object], *what: Any) -> None:
        """Send this. The virtual clock must go on meanwhile."""
        if self._virtual is not None:
            since, count = self._stands
            self._stands = self._virtual, count + 1 if since == self._virtual else 1
            if count >= STANDSTILL:
                self._virtual += EXCHANGE
                self._stands = self._virtual, count
        self._line.advance(self.now())
        if self._line.hung_up:
            raise unsent(self._hung_up())
        try:
            feed(*what)
        except OSError as exc:
            raise self._state_lost(exc) from exc

    def _wait(self, now: float, deadline: Deadline) -> float:
        """Sleep until the simulator may have something, or until `deadline`; the present moment, then."""
        event = self._line.next_event()
        return self._sleep_until(deadline.at if event is None else min(deadline.at, max(event, now)))

    def _hung_up(self) -> LinkError:
        if getattr(self._line, "pulled", False):
            return LinkError(f"{self.name}: the simulated port is gone", hint="the simulator unplugged it", code="lost")
        return LinkError(f"{self.name}: the simulated device hung up", hint="that is the disconnect fault", code="lost")

    def _plugged_in(self) -> bool:
        """Open the port again that was pulled. Raises LinkError while it is not there."""
        self._line.advance(self.now())
        if not getattr(self._line, "pulled", False):
            return False  # it hung up for good: the fault disconnect
        if self._line.away:
            raise LinkError(f"{self.name}: no such port", hint="the simulator unplugged it", code="not-found")
        self._line.reconnect()
        return True

    def power_cycle(self) -> bool:
        self._line.advance(self.now())
        self._line.power_cycle()
        return True

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        try:
            self._line.advance(self.now())
            self._line.close()
        except OSError as exc:
            raise self._state_lost(exc) from exc

    def _state_lost(self, exc: OSError) -> LinkError:
        return LinkError(f"{self.name}: the state file cannot be written: {exc.strerror or exc}", code="state")


class FakeLink(_Simulated, ByteLink):
    """A simulated serial line."""

    can_set_baud = True

    def __init__(self, link: str, baud: int | None, more: Mapping[str, str]) -> None:
        super().__init__(link, more)
        self._rest = b""
        self.baud = baud
        self._line.client_baud = baud

    def write(self, data: bytes, deadline: Deadline) -> None:
        self._say(self._line.feed, data)

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        line, now = self._line, self.now()
        while True:
            line.advance(now)
            self._rest += line.take()
            if self._rest:
                data, self._rest = self._rest[:size], self._rest[size:]
                return data
            if line.hung_up:
                raise self._hung_up()
            if now >= deadline.at:
                return b""
            now = self._wait(now, deadline)

    @property
    def speed(self) -> int | None:
        """That of the simulated device, in bit/s; None where its wire has none."""
        found: int | None = self._line.device.speed
        return found

    def set_baud(self, baud: int) -> None:
        self.baud = baud
        self._line.client_baud = baud

    def reopen(self) -> bool:
        self._rest = b""
        return self._plugged_in()

    def reconnect(self, seconds: float) -> bool:
        self._line.advance(self.now())
        self._rest = b""
        if self._line.hung_up:
            return self.look_for(seconds, self._plugged_in)
        self._line.reconnect()
        return True

    def power_cycle(self) -> bool:
        self._rest = b""
        return super().power_cycle()


class FakeFrames(_Simulated, FrameLink):
    """A simulated CAN bus."""

    def __init__(self, link: str, more: Mapping[str, str]) -> None:
        super().__init__(link, more)
        self._arrived: list[tuple[int, bytes]] = []

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self._say(self._line.feed_frame, frame.can_id, frame.data)
        if not self._line.acknowledged:
            self.error_frames += 1

    def trouble(self, before: int = 0) -> Trouble | None:
        if self._line.bus_off:
            return Trouble("bus-off", "The simulated controller reports it")
        return super().trouble(before)

    def only_listen(self, bitrate: int) -> bool | None:
        self._line.advance(self.now())
        self._line.client_bitrate, self._line.taking_part, self._line.bus_errors = bitrate, False, 0
        self._line.take_frames()  # what came before at another bitrate
        self._arrived.clear()
        return True

    def bus_errors(self) -> bool:
        self._line.advance(self.now())
        found, self._line.bus_errors = self._line.bus_errors, 0
        return bool(found)

    def resume(self) -> None:
        self._line.client_bitrate, self._line.taking_part = None, True

    def reconnect(self, seconds: float) -> bool:
        self._line.advance(self.now())
        if not self._line.hung_up:
            return False
        self._arrived.clear()
        return self.look_for(seconds, self._plugged_in)

    def receive(self, deadline: Deadline) -> CanFrame | None:
        now = self.now()
        while True:
            self._line.advance(now)
            self._arrived += self._line.take_frames()
            if self._arrived:
                return CanFrame(*self._arrived.pop(0))
            if self._line.hung_up:
                raise self._hung_up()
            if now >= deadline.at:
                return None
            now = self._wait(now, deadline)

    def power_cycle(self) -> bool:
        self._arrived.clear()
        return super().power_cycle()


# -- what plain --fake keeps from one command to the next -----------------------------------------------------------


class Kept:
    """What one command has of a simulated device that is kept.

    path     of the state file, "" where there is no place for one
    before   the state file as this command found it (inode, time), None without one
    """

    def __init__(self, link: str, *, writes: bool) -> None:
        """`writes`: what this command does to the device is kept."""
        self.kind, _, _query = link.removeprefix("fake://").partition("?")
        self._writes = writes
        self.path = _path(_file_name(link), make=writes)
        self.before = self._stamp()

    def options(self) -> dict[str, str]:
        """Those of the simulator."""
        if not self.path or not (self._writes or self.before):
            return {}
        age = max(0.0, time.time() - self.before[1] / 1e9) if self.before else 0.0
        return {"state": self.path, "save": "changed" if self._writes else "never", "elapse": f"{min(age, 1e9):.3f}"}

    def discard(self) -> None:
        """The state file is of no use: this command resets it."""
        if self._writes:
            with contextlib.suppress(OSError):
                os.unlink(self.path)
        self.before = None
        if os.path.lexists(self.path):
            self.path = ""

    @property
    def begun(self) -> bool:
        """Whether this command is the first whose doing is kept."""
        return self.before is None and self._stamp() is not None

    @property
    def text(self) -> str:
        """A note about the saved state of the device, and how to reset it."""
        state = "has the state that it was left in" if self.before is not None else "keeps its state until you log out"
        return f"the simulated {self.kind} {state}. `handctl sim forget {self.kind}` resets it"

    def _stamp(self) -> tuple[int, int] | None:
        try:
            found = os.stat(self.path)
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns


def forget(kind: str) -> bool:
    """Remove what is kept of a simulated device, on every wire, and what a killed command left of it; whether there was any.

    Raises OSError.
    """
    found = False
    begin = _file_name(f"fake://{kind}").removesuffix(".json")
    for folder in _folders():
        for name in os.listdir(folder):
            if name.startswith((f"{begin}.json", f"{begin}-")):
                with contextlib.suppress(FileNotFoundError):
                    os.unlink(os.path.join(folder, name))
                    found = True
    return found


def _file_name(link: str) -> str:
    """One for each device, model and wire: ``sim-exo.json``, ``sim-wrist-can.json``, ``sim-hand-df.json``."""
    kind, _, more = link.removeprefix("fake://").partition("?")
    said = [word.partition("=")[2] for word in more.split("&") if word]
    return f"sim-{'-'.join([kind, *said])}.json"


def _path(name: str, *, make: bool) -> str:
    """The path of the file, or where it can be created; "" if nowhere."""
    for folder in _folders():
        if os.path.lexists(path := os.path.join(folder, name)):
            return path
    return os.path.join(folder, name) if make and (folder := next(_folders(make=True), "")) else ""


def _folders(*, make: bool = False) -> Iterator[str]:
    """Those that are this user's."""
    for folder in private_folders():
        with contextlib.suppress(OSError):
            if own_folder(folder, make=make):
                yield folder
