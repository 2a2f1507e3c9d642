"""Devices that nobody here simulates: RH56 hands of every generation, a wrist without its hand, JSON, echo, noise.

Written from dossier rh56.md (sections 1.1, 2.1, 3, 10) and inspire.md alone, by other means than the host: the frame is
taken apart with `struct`, registers are a book of their own. Each keeps what was written to it in `written`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any

from handctl.link import CanFrame, Deadline, FrameLink
from tests.support.scripted import Reply, ScriptedLink


def requests(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """(id, flag, what follows) of each whole host frame with a fitting sum."""
    place = data.find(b"\xeb\x90")
    while place >= 0 and len(data) >= place + 6:
        number, length, flag = struct.unpack_from("<BBB", data, place + 2)
        body = data[place + 5 : place + 4 + length]
        if (
            len(data) > place + 4 + length
            and sum(data[place + 2 : place + 4 + length]) % 256 == data[place + 4 + length]
        ):
            yield number, flag, body
            place += length + 4
        place = data.find(b"\xeb\x90", place + 1)


def reply(number: int, flag: int, body: bytes) -> bytes:
    frame = struct.pack("<BBB", number, len(body) + 1, flag) + body
    return b"\x90\xeb" + frame + bytes([sum(frame) % 256])


class Memory:
    """A device of registers: `book` holds (address, struct layout, values); `unit` bytes belong to one address."""

    def __init__(
        self, *books: tuple[int, str, tuple[int, ...]], unit: int = 1, flags: tuple[int, int] = (0x11, 0x12),
        gaps: str = "zeros",
    ) -> None:  # fmt: skip
        self.bytes = bytearray(16384)
        self.known = bytearray(16384)
        self.unit, self.flags, self.gaps = unit, flags, gaps
        for address, layout, values in books:
            size = struct.calcsize(layout)
            struct.pack_into(layout, self.bytes, address * unit, *values)
            self.known[address * unit : address * unit + size] = b"\x01" * size
        self.written: list[str] = []

    def read(self, address: int, count: int) -> bytes | None:
        place = address * self.unit
        if self.gaps == "silent" and not all(self.known[place : place + count]):
            return None
        return bytes(self.bytes[place : place + count])

    def write(self, address: int, data: bytes) -> None:
        self.written.append(f"{address}: {data.hex(' ').upper()}")
        self.bytes[address * self.unit : address * self.unit + len(data)] = data


DF = (
    (1000, "<2B", (1, 0)), (1002, "<2B", (0, 0)), (1004, "<3B", (0, 0, 0)), (1009, "<B", (0,)),
    (1020, "<6h", (901, 902, 903, 904, 905, 906)), (1032, "<6h", (701, 702, 703, 704, 705, 706)),
    (1044, "<6h", (501, 502, 503, 504, 505, 506)), (1472, "<h", (558,)),
    (1474, "<6h", (111, 222, 333, 444, 555, 666)), (1486, "<6h", (-1,) * 6),
    (1498, "<6h", (401, 402, 403, 404, 405, 406)), (1522, "<6h", (601, 602, 603, 604, 605, 606)),
    (1534, "<6h", (211, 322, 433, 544, 655, 766)), (1546, "<6h", (110, 220, 330, 440, 550, 660)),
    (1582, "<6h", (-11, 12, -13, 14, -15, 16)), (1594, "<6h", (21, -22, 23, 24, 25, 26)), (1606, "<6B", (0,) * 6),
    (1612, "<6B", (2, 1, 2, 3, 2, 0)), (1618, "<6B", (31, 32, 33, 34, 35, 36)),
)  # fmt: skip
"""The golden hand of rh56 §10."""
FRESH = (*(row for row in DF if row[0] != 1612), (1612, "<6B", (255,) * 6))
"""As it comes out of power-up (rh56 §6)."""
OPENING = (*(row for row in DF if row[0] != 1612), (1612, "<6B", (0,) * 6))
"""All fingers open: every status code is 0, and only the sixth temperature is left to tell."""
TP = (*(row for row in DF if row[0] not in (1020, 1472)), (1700, "<4B", (192, 168, 11, 210)),
      (3000, "<9h", tuple(range(9))))  # fmt: skip
F1 = (
    (1000, "<2h", (1, 0)), (1016, "<6h", (901,) * 6), (1022, "<6h", (2000,) * 6), (1028, "<6h", (500,) * 6),
    (1034, "<6h", (0,) * 6), (1040, "<6h", (-1,) * 6), (1064, "<6h", (1000, 1000, 1000, 1000, 1400, 1000)),
    (1082, "<6h", (0,) * 6), (1088, "<6h", (2, 1, 2, 3, 2, 0)), (1094, "<6h", (31, 32, 33, 34, 35, 36)),
)  # fmt: skip
DG2 = (
    (1000, "<2h", (1, 0)), (1024, "<13h", (900,) * 13), (1080, "<13h", (-1,) * 13),
    (1136, "<13h", tuple(range(1200, 1213))), (1178, "<13h", (0,) * 13), (1192, "<13h", (2,) * 13),
    (1206, "<13h", tuple(range(31, 44))),
)  # fmt: skip
WRIST = (
    (1020, "<4h", (-345, 1125, 111, 222)), (1028, "<6B", (0, 0, 0, 0, 31, 34)), (1038, "<3h", (1100, -300, 700)),
)  # fmt: skip

SPACES: dict[str, tuple[Callable[[], Memory], ...]] = {
    "rh56": (lambda: Memory(*DF),),
    "rh56-fresh": (lambda: Memory(*FRESH),),
    "rh56-opening": (lambda: Memory(*OPENING),),
    "rh56-tactile": (lambda: Memory(*TP),),
    "rh56-silent-gaps": (lambda: Memory(*DF, gaps="silent"),),
    "rh56f1": (lambda: Memory(*F1, unit=2),),
    "rh56f1-silent-gaps": (lambda: Memory(*F1, unit=2, gaps="silent"),),
    "rh5dg2": (lambda: Memory(*DG2, unit=2),),
    "rh5dg2-silent-gaps": (lambda: Memory(*DG2, unit=2, gaps="silent"),),
    "wrist-only": (lambda: Memory(*WRIST, flags=(0x30, 0x31)),),
    "wrist-with-hand": (lambda: Memory(*DF), lambda: Memory(*WRIST, flags=(0x30, 0x31))),
    "wrist-with-opening-hand": (lambda: Memory(*OPENING), lambda: Memory(*WRIST, flags=(0x30, 0x31))),
}
"""What answers at id 1 on a serial line."""


class Line(ScriptedLink):
    """One device of SPACES on a serial line, which takes `latency` seconds for an answer; `echo`: our bytes come first."""

    def __init__(self, name: str, baud: int | None = 115200, *, latency: float = 0.004, echo: bool = False) -> None:
        super().__init__(self._answer, baud)
        self.spaces = [make() for make in SPACES[name]]
        self._latency, self._echo = latency, echo

    @property
    def written(self) -> list[str]:
        return [entry for space in self.spaces for entry in space.written]

    def _answer(self, data: bytes) -> list[Reply]:
        replies = [(0.0, data)] if self._echo else []
        for number, flag, body in requests(data):
            for space in self.spaces:
                came = self._from(space, flag, body) if number == 1 else None
                if came is not None:
                    replies.append((self._latency, reply(number, flag, body[:2] + came)))
        return replies

    def _from(self, space: Memory, flag: int, body: bytes) -> bytes | None:
        read, write = space.flags
        address = int.from_bytes(body[:2], "little")
        if flag == read and len(body) == 3:
            return space.read(address, body[2])
        if flag == write:
            space.write(address, body[2:])
            return b"\x01"
        if flag in (0x31, 0x32) and read == 0x11:
            space.written.append(f"flag {flag:02X}: {body.hex(' ').upper()}")
        return None


class CanLine(FrameLink):
    """The same behind CAN (inspire §1.2): flags 0/1 hand, 4/5 wrist; on virtual time."""

    name = "scripted"

    def __init__(self, name: str) -> None:
        self.spaces = {4 if space.flags[0] == 0x30 else 0: space for space in (make() for make in SPACES[name])}
        self.sent: list[CanFrame] = []
        self.clock = 0.0
        self._incoming: list[CanFrame] = []

    @property
    def written(self) -> list[str]:
        return [entry for space in self.spaces.values() for entry in space.written]

    def now(self) -> float:
        return self.clock

    def sleep(self, seconds: float) -> None:
        self.clock += max(0.0, seconds)

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self.sent.append(frame)
        flag, address, number = frame.can_id >> 26, frame.can_id >> 14 & 0xFFF, frame.can_id & 0x3FFF
        space = self.spaces.get(flag & 4)
        if number != 1 or space is None:
            return
        if flag & 1:
            space.write(address, frame.data)
            self._incoming.append(CanFrame(frame.can_id, bytes([len(frame.data)])))
        else:
            data = space.read(address, frame.data[0])
            self._incoming += [] if data is None else [CanFrame(frame.can_id, data)]

    def receive(self, deadline: Deadline) -> CanFrame | None:
        if self._incoming:
            self.clock += 0.001
            return self._incoming.pop(0)
        self.clock = max(self.clock, deadline.at)
        return None

    def close(self) -> None:
        self._incoming.clear()


class Streamer(ScriptedLink):
    """Talks all the time: the same text again and again, whatever is asked; every reader gets a piece of it."""

    def __init__(self, text: bytes) -> None:
        super().__init__(None, 115200)
        self._text, self._at = text, 0

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if deadline.at < self.clock + 0.002:  # what is read without waiting has been read already
            self._pass_to(max(self.clock, deadline.at))
            return b""
        self._pass_to(self.clock + 0.002)
        start = self._at % len(self._text)
        self._at += 64
        return (self._text * 3)[start : start + min(size, 64)]


def silence(_request: bytes) -> list[Reply]:
    return []


def echo(request: bytes) -> list[Reply]:
    return [(0.001, request)]


STRANGERS: dict[str, Callable[[], Any]] = {
    **{name: lambda name=name: Line(name) for name in SPACES},
    "rh56 with echo": lambda: Line("rh56", echo=True),
    "wrist-only with echo": lambda: Line("wrist-only", echo=True),
    "wrist-with-opening-hand, slow": lambda: Line("wrist-with-opening-hand", latency=0.15),
    "silence": lambda: ScriptedLink(silence, 115200),
    "echo": lambda: ScriptedLink(echo, 115200),
    "garbage": lambda: ScriptedLink(lambda _request: [(0.001, b"\x55\xaa\x90" * 8)], 115200),
    "json": lambda: Streamer(b'{"motor_pos": [0, 0, 0], "joint_pos": [1.5, 2.0]}\n'),
    "prompt": lambda: ScriptedLink(lambda _request: [(0.002, b"\r\n=> ")], 115200),
    "dataport": lambda: Streamer(bytes.fromhex("960300010E0525E40E")),
}  # fmt: skip
