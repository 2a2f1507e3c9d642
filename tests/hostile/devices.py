"""Devices that mean no good. Each is the real simulator of a family with somebody between it and the host.

What that one does to an answer knows no protocol, so that a new family is in the suite by itself: it is text or JSON where it
reads as such, and bytes otherwise. What comes unasked comes at the pace of a serial line, on virtual time.
"""

from __future__ import annotations

import json
import random
import re
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from handctl.families import FAMILIES
from handctl.sim import create
from handctl.sim.engine.can_line import CanLine
from tests.harm.states import State

CONTROLS = (
    "\x1b]52;c;cm0gLXJm\x07", "\x1b]0;owned\x1b\\", "\x1b[2J\x1b[H", "\x9b31m", "\x9d0;owned\x9c", "\u202egpj.exe",
    "\u2066x\u2069", "a\u200bb", "ok\rbad", "\x08\x7f", "\u2028x",
)  # fmt: skip
"""Clipboard, title, clear-screen, the same in C1, text turned round, isolated and invisible, a line written over."""
ESCAPES = "".join(CONTROLS)
RAW = ESCAPES.encode("utf-8") + b"\x9b2J\xff\xfe"
DEEP, LONG, MANY = 100_000, 100_000, 50_000
PACE = 0.1
"""Seconds between two pieces of what comes unasked."""
CHUNK = 256

RATE = 250_000
"""Bytes a second that pass the line at the most: a deadline is over by its clock, however much comes."""
PIECE = 10_000
BACKLOG = 500_000
"""Bytes on their way to the host; a device that has more to say says less."""

Pieces = list[tuple[float, bytes]]
"""(seconds after the one before, bytes)."""


class Spoiler:
    """Between a device and the host. What it does to the device's answers, and what it says by itself."""

    asked = False
    """What it says by itself begins with the first request, so that the link is open and the command in the middle."""

    def __init__(self, header: bytes = b"") -> None:
        self.random = random.Random(1)
        self.header = header
        """How a frame of this device begins."""

    def answer(self, data: bytes) -> Pieces:
        """What the host gets in place of an answer."""
        return [(0.0, data)]

    def unasked(self) -> bytes:
        """The next piece of what comes by itself; b"" is nothing."""
        return b""

    def frame(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """The same on a CAN bus: an answer is a frame."""
        return [(can_id, piece[:8]) for _, piece in self.answer(data)]


def spoiler(
    answer: Callable[[bytes], bytes | Pieces] = lambda data: data, begin: bytes = b"", endless: bytes = b""
) -> Callable[[bytes], Spoiler]:
    """A Spoiler of a function: answers pass it; `begin`, then `endless` again and again come unasked."""

    class Made(Spoiler):
        _began = False

        def answer(self, data: bytes) -> Pieces:
            made = answer(data)
            return [(0.0, made)] if isinstance(made, bytes) else made

        def unasked(self) -> bytes:
            if begin and not self._began:
                self._began = True
                return begin
            return endless

    return Made


def _as_json(data: bytes) -> Any:
    try:
        return json.loads(data)
    except ValueError:
        return None


def _json_or(change: Callable[[dict[str, Any]], str], text: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """Change an answer of JSON objects, one a line, as such; anything else by `text`."""

    def answer(data: bytes) -> bytes:
        parts = data.splitlines(keepends=True)
        objects = [_as_json(part) for part in parts]
        if not any(isinstance(one, dict) for one in objects):
            return text(data)
        return b"".join(
            change(one).encode("utf-8", "surrogatepass") + b"\n" if isinstance(one, dict) else part
            for one, part in zip(objects, parts, strict=True)
        )

    return answer


def _told(content: dict[str, Any]) -> str:
    """Escapes in keys and values, as JSON allows them."""
    more = {f"k{number}{text}": text for number, text in enumerate(CONTROLS)}
    return json.dumps({**content, **more, "error": ESCAPES})


def _instead(value: str) -> Callable[[dict[str, Any]], str]:
    """The first values replaced by this text of JSON."""
    return lambda content: "{" + ", ".join(f"{json.dumps(key)}: {value}" for key in list(content)[:3]) + "}"


def _one_value(value: str) -> Callable[[dict[str, Any]], str]:
    """The second element of each array, and each single value, replaced by this text of JSON; of a long one the first."""

    def change(content: dict[str, Any]) -> str:
        parts = []
        for number, (key, held) in enumerate(content.items()):
            text = value if not number or len(value) < 1000 else json.dumps(held)
            if text is value and isinstance(held, list) and len(held) > 1:
                text = "[" + ", ".join(json.dumps(one) if n != 1 else value for n, one in enumerate(held)) + "]"
            parts.append(f"{json.dumps(key)}: {text}")
        return "{" + ", ".join(parts) + "}"

    return change


def _numbers(by: bytes) -> Callable[[bytes], bytes]:
    return lambda data: re.sub(rb"(?<![A-Za-z\d])\d+", lambda _: by, data)


def _in_lines(data: bytes) -> bytes:
    """Escapes wherever a text has a space or the end of a line, and in front."""
    return RAW + re.sub(rb"[ \r\n]+", lambda found: RAW + found[0], data)


def _behind_words(data: bytes) -> bytes:
    """Escapes at the end of each line that ends in a word, so that what is checked in an answer is right."""
    return re.sub(rb"(?<=[a-z.)])(?=[\r\n])", RAW.replace(b"\r", b""), data)


def _again(encoding: str) -> Callable[[bytes], bytes]:
    return lambda data: (data.decode("latin-1") + "°é手").encode(encoding, "replace")


def _key_bomb(content: dict[str, Any]) -> str:
    return json.dumps({**content, **{f"key{number}": number for number in range(MANY)}})


def _same_keys(content: dict[str, Any]) -> str:
    """Every key twice."""
    text = json.dumps(content)
    return f"{text[:-1]}, {text[1:]}"


class Stale(Spoiler):
    """The right answer, to the question before."""

    _before = b"\x00"

    def answer(self, data: bytes) -> Pieces:
        data, self._before = self._before, data
        return [(0.0, data)]


class Fixed(Spoiler):
    """The first answer, to every question."""

    _first = b""

    def answer(self, data: bytes) -> Pieces:
        self._first = self._first or data
        return [(0.0, self._first)]


class Noise(Spoiler):
    """Random bytes without end."""

    def unasked(self) -> bytes:
        return self.random.randbytes(CHUNK)

    def frame(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        return [(can_id, data)]


class LateNoise(Noise):
    """The same, once the host has asked."""

    asked = True


class Headers(Spoiler):
    """Beginnings of frames without end, each right and none with a rest."""

    def unasked(self) -> bytes:
        return (self.header or b"\n") * (CHUNK // len(self.header or b"\n"))


class Junk(Spoiler):
    """The right answer, then 16 kB of junk."""

    def answer(self, data: bytes) -> Pieces:
        return [(0.0, data), (0.0, self.random.randbytes(16_384))]


class Slow(Spoiler):
    """The right answer, a byte a second."""

    def answer(self, data: bytes) -> Pieces:
        return [(1.0, bytes([one])) for one in data]

    def frame(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        return [(can_id, bytes([one])) for one in data]


NESTED = b"[" * DEEP + b"]" * DEEP
OBJECTS = b'{"a":' * DEEP + b"1" + b"}" * DEEP

KINDS: dict[str, Callable[[bytes], Spoiler]] = {
    "escapes inside": spoiler(_json_or(_told, _in_lines)),
    "escapes behind words": spoiler(_json_or(_told, _behind_words)),
    "escapes before": spoiler(lambda data: RAW + data),
    "escapes without end": spoiler(endless=RAW * 4 + b"\r\n"),
    "nesting": spoiler(_json_or(_one_value(NESTED.decode()), lambda data: NESTED + data)),
    "objects in objects": spoiler(_json_or(_instead(OBJECTS.decode()), lambda data: OBJECTS + data)),
    "digits": spoiler(_json_or(_one_value("9" * LONG), _numbers(b"9" * 5_000))),
    "50,000 keys": spoiler(_json_or(_key_bomb, lambda data: b" 7" * MANY + data)),
    "keys twice": spoiler(_json_or(_same_keys, lambda data: data + data)),
    "no numbers": spoiler(_json_or(_one_value("NaN"), _numbers(b"nan"))),
    "numbers past all bounds": spoiler(_json_or(_one_value("-1e999"), _numbers(b"-1e999"))),
    "digits of other scripts": spoiler(_json_or(_one_value('"\u0663"'), _numbers(b"\xb2\xd9\xa3"))),
    "null, true and texts": spoiler(_json_or(_instead('[null, true, "1", {}, []]'), _numbers(b"None"))),
    "a string without end": spoiler(begin=b'{"joint_pos": "', endless=b"x" * CHUNK),
    "a byte a second": Slow,
    "UTF-16": spoiler(_again("utf-16")),
    "UTF-8 with a mark": spoiler(lambda data: b"\xef\xbb\xbf" + data),
    "GBK": spoiler(_again("gbk")),
    "EBCDIC": spoiler(_again("cp500")),
    "the question before": Stale,
    "always the first answer": Fixed,
    "junk behind": Junk,
    "noise without end": Noise,
    "noise once asked": LateNoise,
    "headers without end": Headers,
    "nothing but NUL": spoiler(lambda data: bytes(len(data)), endless=bytes(CHUNK)),
    "a thousand times": spoiler(lambda data: data * 1000),
}  # fmt: skip
"""Kind of hostility -> what makes it."""


class Hostile:
    """The cable of a device with a Spoiler in the middle, as `FakeLink` drives one: time is passed in."""

    def __init__(self, line: Any, spoil: Spoiler) -> None:
        self.line = line
        self.spoil = spoil
        self._ready: deque[tuple[float, bytes]] = deque()
        self._behind = 0
        self._frames: list[tuple[int, bytes]] = []
        self._asked = not spoil.asked
        self._next = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.line, name)

    def __setattr__(self, name: str, value: Any) -> None:
        target = self.__dict__.get("line") if name == "client_baud" else None
        if target is not None:
            setattr(target, name, value)
        else:
            object.__setattr__(self, name, value)

    def _now(self) -> float:
        return self.line.now  # type: ignore[no-any-return]

    def advance(self, now: float) -> None:
        """Time goes on, and what is to come unasked has come."""
        self.line.advance(now)
        if not self._asked or self._now() < self._next:
            return
        if piece := self.spoil.unasked():
            self._next = self._now() + PACE
            if isinstance(self.line, CanLine):
                self._frames.append((self.spoil.random.getrandbits(29), piece[:8]))
            else:
                self._send(0.0, piece)
        else:
            self._next = float("inf")

    def next_event(self) -> float | None:
        """When there may be something."""
        times = [self._ready[0][0]] if self._ready else []
        if self._asked and self._next < float("inf"):
            times.append(self._next)
        own = self.line.next_event()
        return min([*times, own] if own is not None else times, default=None)

    def feed(self, data: bytes) -> None:
        """What the host sends."""
        self._ask()
        self.line.feed(data)

    def feed_frame(self, *frame: Any) -> None:
        """The same on a CAN bus."""
        self._ask()
        self.line.feed_frame(*frame)

    def _ask(self) -> None:
        if not self._asked:
            self._asked, self._next = True, self._now()

    def take(self) -> bytes:
        """What has arrived at the host by now."""
        answer = self.line.take()
        if answer and self._behind <= BACKLOG:  # to spoil what would not be sent costs a second a command
            for delay, piece in self.spoil.answer(answer):
                self._send(delay, piece)
        out = []
        while self._ready and self._ready[0][0] <= self._now():
            out.append(self._ready.popleft()[1])
            self._behind -= len(out[-1])
        return b"".join(out)

    def _send(self, delay: float, data: bytes) -> None:
        """On its way to the host, `delay` after what is on its way already."""
        if self._behind > BACKLOG:
            return
        moment = max(self._now(), self._ready[-1][0] if self._ready else 0.0) + delay
        for at in range(0, len(data), PIECE):
            self._ready.append((moment, data[at : at + PIECE]))
            moment += len(self._ready[-1][1]) / RATE
        self._behind += len(data)

    def take_frames(self) -> list[tuple[int, bytes]]:
        """The same on a CAN bus."""
        spoiled = [one for frame in self.line.take_frames() for one in self.spoil.frame(*frame)]
        out, self._frames = [*self._frames, *spoiled], []
        return out


@dataclass(frozen=True)
class Place:
    """Where a device of one family, spoiled in one way, hangs: what `tests.harm.cell` asks of a state."""

    kind: str
    hostility: str
    wire: str

    @property
    def options(self) -> dict[str, str]:
        """Those of its simulator."""
        return {**READY.get(self.kind, {}), **bus_of(self.kind, self.wire)}

    def make(self) -> Hostile:
        """The device, awake."""
        line = create(self.kind, self.options)
        line.advance(0.0)
        line.advance(1.0)
        if not isinstance(line, CanLine):
            line.take()
        return Hostile(line, KINDS[self.hostility](line.device.HEADER))

    def __str__(self) -> str:
        wire = f", {self.wire}" if bus_of(self.kind, self.wire) else ""
        return f"{self.kind}{wire}, {self.hostility}"


def bus_of(kind: str, wire: str) -> dict[str, str]:
    """The option of the simulator for a wire that is not its first one."""
    from handctl.tools.family_probe import family_of

    if wire == "tcp" and "modbus-tcp" in family_of(kind).wires:
        return {"bus": "modbus-tcp"}
    return {"bus": "can"} if wire == "can" else {}


READY = {"barrett": {"initialized": "1"}, "aidin": {"start": "homed", "rate": "20"}, "ekso": {"sway": "0"}}
"""Options of a simulator that is ready to do what it is asked."""


def places() -> Iterator[Place]:
    """Every family and wire, spoiled in every way."""
    from handctl.tools.family_probe import family_of

    for name in FAMILIES:
        family = family_of(name)
        streams = ["tcp"] if family.tcp_port is not None else []
        streams += ["serial"] if "serial" in family.wires or not streams else []
        for wire in (*streams, *(["can"] if "can" in family.wires else [])):
            for hostility in KINDS:
                yield Place(name, hostility, wire)


__all__ = ["CONTROLS", "ESCAPES", "KINDS", "RAW", "Hostile", "Place", "State", "places"]
