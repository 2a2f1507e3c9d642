"""One cell: one command line against one device. What changed is found by comparison with a twin that nobody talked to.

The twin is the same device in the same state, and as much time passes for it: what it does by itself is no harm. Both are
compared as they are, field by field, so that a new field of a simulator is looked at without a word here.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from types import MethodType
from typing import Any
from unittest import mock

import handctl.sim
from handctl.link import fake, tcp
from handctl.sim.bus.wire_pair import resample
from tests.harm.excuses import EXCUSES
from tests.harm.lines import Line as CommandLine
from tests.harm.states import State
from tests.search.suite import bounded
from tests.support.cli import run

SETTLE = 0.3
"""Seconds after the end of a command: what it set off has begun."""
SECONDS = 20.0
"""Of real time: a command that takes longer hangs."""

EARS = frozenset({
    "replies", "_inbox", "_heard", "_hear_since", "_lost", "random", "judge", "dirty", "_line", "_open", "_noisy_echo", "hits",
    "_previous", "faults", "reader", "writer", "_streamed", "_next_feedback", "_unwritten", "_merged", "ignored",
    "_event_at", "_asked", "_frozen_boot", "reported", "_switches", "_fidgets", "fidgets", "device",
})  # fmt: skip
"""Fields of the simulators that are hearing and speaking, and are no state of the device."""


class Port:
    """The cable of a device as the host's link sees it: its time begins when the link is opened, its power stays on."""

    def __init__(self, line: Any) -> None:
        self.line = line
        self.fed = 0
        """Bytes, or frames, that reached the cable."""
        self.opened()

    def opened(self) -> Port:
        """A new link: its clock begins at 0."""
        self._start = self.line.now
        return self

    def advance(self, now: float) -> None:
        self.line.advance(self._start + now + 1e-9)  # rounding must not leave an event a hair ahead

    def next_event(self) -> float | None:
        event: float | None = self.line.next_event()
        return None if event is None else event - self._start

    def feed(self, data: bytes) -> None:
        self.fed += len(data)
        self.line.feed(data)

    def feed_frame(self, *frame: Any) -> None:
        self.fed += 1
        self.line.feed_frame(*frame)

    def power_cycle(self) -> None:
        """Nobody turns the switch of a device that was not asked for."""

    def close(self) -> None:
        """The link is closed; the device goes on."""

    @property
    def client_baud(self) -> int | None:
        """The speed of the host's end."""
        return self.line.client_baud  # type: ignore[no-any-return]

    @client_baud.setter
    def client_baud(self, baud: int | None) -> None:
        self.line.client_baud = baud

    def __getattr__(self, name: str) -> Any:
        return getattr(self.line, name)


class _TcpLink(fake.FakeLink):
    """A terminal server, or the AIDIN-hand: bytes pass as they are."""

    can_set_baud = False
    fake = False

    def __init__(self, link: str, tcp_port: int | None = None) -> None:
        super().__init__("fake://tcp?clock=virtual", None, {})
        self.name = link


def cells(state: State, lines: list[CommandLine]) -> Iterator[tuple[CommandLine, str]]:
    """All ways in which these lines are tried on a device."""
    for line in lines:
        if state.in_block and line.family != state.owner:
            continue  # the next bytes are velocities, whoever sends them: only its own family can know that
        for mode in modes(line, state):
            yield line, mode


@contextmanager
def connected(state: State) -> Iterator[Port]:
    """Whatever link is opened meanwhile leads to this device."""
    line = state.make()
    if state.wire == "serial":
        line.device.mishear = resample  # type: ignore[method-assign]
    port = Port(line)
    with (
        mock.patch.object(handctl.sim, "create", lambda kind, options: port.opened()),
        mock.patch.object(tcp, "TcpLink", _TcpLink),
    ):
        yield port


def link_of(state: State) -> str:
    """What is given as --port."""
    if state.wire == "tcp":
        return "tcp://device:6000" if state.options.get("bus") == "modbus-tcp" else "tcp://device:4001"
    return f"fake://{state.kind}?clock=virtual" + ("&bus=can" if state.wire == "can" else "")


# -- what a device is like --------------------------------------------------------------------------------------------


def fingerprint(line: Any) -> dict[str, Any]:
    """Every field of the device by its place, readings as they would be told now."""
    device = line.device
    device.random._state = 1  # readings may have noise: both devices have the same now
    for body in (getattr(device, "hand", None), device):
        if hasattr(body, "publish"):
            body.publish()
            break
    found: dict[str, Any] = {}
    _fields(device, "", found, set())
    return found


SCALARS = frozenset({type(None), bool, int, float, str, bytes})
"""Nearly all fields are of these: they are put down where they are met."""


def _fields(value: Any, path: str, found: dict[str, Any], seen: set[int]) -> None:
    match value:
        case None | bool() | int() | float() | str() | bytes():
            found[path] = value
        case bytearray():
            found[path] = bytes(value)
        case MethodType():
            found[path] = value.__name__
        case dict():
            for key, item in value.items():
                _fields(item, f"{path}[{key if isinstance(key, str | int) else type(key).__name__}]", found, seen)
        case list() | tuple():
            found[f"{path}#"] = len(value)
            for number, item in enumerate(value):
                if type(item) in SCALARS:
                    found[f"{path}[{number}]"] = item
                else:
                    _fields(item, f"{path}[{number}]", found, seen)
        case set() | frozenset():
            found[path] = sorted(map(str, value))
        case _ if type(value).__module__.startswith(("handctl.sim", "tests.")) and id(value) not in seen:
            seen.add(id(value))
            names = [
                *getattr(value, "__dict__", ()),
                *(n for t in type(value).__mro__ for n in getattr(t, "__slots__", ())),
            ]
            for name in names:
                if name in EARS or name == "mishear":
                    continue
                item = getattr(value, name, None)
                if type(item) in SCALARS:
                    found[f"{path}.{name}"] = item
                else:
                    _fields(item, f"{path}.{name}", found, seen)


def changes(line: Any, twin: Any) -> list[str]:
    """What is different in a device from its twin, as ``place: was -> is``."""
    now, was = fingerprint(line), fingerprint(twin)
    return [
        f"{place.lstrip('.')}: {_short(was.get(place), now.get(place))} -> {_short(now.get(place), was.get(place))}"
        for place in sorted(now.keys() | was.keys())
        if not _same(now.get(place), was.get(place))
    ]


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, float) or isinstance(other, float):
        numbers = isinstance(one, int | float) and isinstance(other, int | float)
        return numbers and isclose(one, other, rel_tol=1e-6, abs_tol=0.01)
    return bool(one == other)


def _short(value: Any, other: Any) -> str:
    """A value; of long bytes the part that differs."""
    if isinstance(value, bytes) and isinstance(other, bytes) and len(value) > 16 and value != other:
        at = next((n for n, (a, b) in enumerate(zip(value, other, strict=False)) if a != b), 0)
        return f"[{at}] {value[at : at + 8].hex(' ')}"
    return repr(value)


# -- a cell -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cell:
    """What one command line did to one device. `harm` is empty when all is well."""

    state: State
    line: CommandLine
    mode: str
    code: int | None
    fed: int
    harm: str = ""
    excused: str = ""


PLAIN, YES, DRY = "plain", "confirmed", "dry run"


def modes(line: CommandLine, state: State) -> Iterator[str]:
    """How a line is tried: as it is; confirmed, unless that is what the device is for; as a dry run."""
    # `stop` knows its device by name, lock or simulator, and that of a hand knows every RH56 that shows itself
    own = state.of(line.family) or line.path == ("stop",) or (line.path[-1:] == ("stop",) and line.family == state.kind)
    if line.asks or not (line.writes and own):
        yield PLAIN
    if line.asks and not own:
        yield YES
    if line.writes and own:
        yield DRY


def words_of(line: CommandLine, state: State, mode: str, scratch: Path) -> list[str]:
    """The command line as it is typed."""
    words = line.can if state.wire == "can" and line.can else line.words
    folder = scratch / (line.family or "exo")
    more = {PLAIN: [], YES: ["--yes"], DRY: ["-n"]}[mode]
    return [*(word.replace("{dir}", str(folder)) for word in words), "-p", link_of(state), *more]


def try_cell(state: State, line: CommandLine, mode: str, scratch: Path) -> Cell:
    """Run one line against one device and judge it."""
    with connected(state) as port:
        with bounded(SECONDS, f"{line} ({state}, {mode})"):
            done = run(
                *words_of(line, state, mode, scratch),
                env={"XDG_STATE_HOME": str(scratch / "state"), "XDG_RUNTIME_DIR": str(scratch)},
            )
        changed: list[str] = []
        if port.fed:
            twin = state.make()
            end = port.line.now + SETTLE
            for one in (port.line, twin):
                one.advance(end)
            changed = changes(port.line, twin)
    text = done.out + done.err
    harm, excused = judge(state, line, mode, done.code, port.fed, changed, text)
    return Cell(state, line, mode, done.code, port.fed, harm, excused)


def judge(
    state: State, line: CommandLine, mode: str, code: int, fed: int, changed: list[str], text: str
) -> tuple[str, str]:
    """What harm was done, and which exception what looks like harm is. Both may be empty."""
    if code == 1 or "Traceback" in text:
        return f"our own bug: {text.strip()[-200:]}", ""
    if fed and (mode == DRY or code == 8 or (mode == PLAIN and line.asks)):
        return f"{fed} bytes were sent without a confirmation", ""
    excuse = next((one for one in EXCUSES if one.grants(state, line)), None)
    if changed:
        fits = excuse is not None and excuse.fits(changed, text)
        return ("", excuse.why) if fits and excuse is not None else (_told(changed), "")
    if excuse is not None and fed:
        return f"nothing changed, so this cell needs its excuse no more: {excuse.why}", ""
    if line.writes and code == 0 and mode != DRY and not state.of(line.family) and fed:
        return "a write to a stranger is called a success", ""
    return "", ""


def _told(changed: list[str]) -> str:
    return "; ".join(changed[:4]) + (f" and {len(changed) - 4} more" if len(changed) > 4 else "")
