"""What the tests of the EksoNR share: a scripted unit on virtual time, frames made by hand, a port in front of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.device import Ekso
from handctl.model.result import Journal
from tests.support.scripted import Reply, ScriptedLink

TIME, DATE, SETTINGS, DATA, FEEDBACK, SET, CANCEL = range(150, 157)
SETTING_WORDS = [1700, 1600, 1550, 200, 90, 50, 500, 300, -75, 125, 2, 1, 3, 0, 10, 12, 2, 3, 4, 7, 1, 2]
DATA_WORDS = [450, -75, 95, 610, 120, 480, -49, 3600, 98, 3622, -185, 2210, -40, 840, 210, -635, -55, 320]
DATA_WORDS += [0x2040, 0x0404, 0, 0, 125, 1, 12, 0, 0]
FEEDBACK_WORDS = [312, 1240, 655, 425, 300, 450, 315, 600, 700, 620, 710, 152, 156, 9, 9, 0, 0]
WORD_OF = {
    **{200 + word: word for word in range(10)},
    210: 11,
    211: 20,
    212: 10,
    213: 12,
    214: 21,
    215: 13,
    216: 14,
    217: 16,
    218: 15,
    219: 17,
}
"""ParameterID -> word of GetSettings, typed from the manual's two tables."""
SITTING, STANDING, RISING, DRIVING, UNKNOWN = 0x1040, 0x2040, 0x3040, 0x3440, 0x4440


def crc(data: bytes) -> int:
    """CRC-CCITT, FFFF, bit by bit."""
    register = 0xFFFF
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1 ^ 0x1021 if register & 0x8000 else register << 1) & 0xFFFF
    return register


def frame(command: int, msg_id: int, body: bytes = b"", more: int = 0) -> bytes:
    """A frame made by hand; `more` is what its length byte says beyond the body."""
    head = bytes([command, len(body) + more, msg_id >> 8, msg_id & 0xFF]) + body
    return head + crc(head).to_bytes(2, "big")


def pack(words: Iterable[int]) -> bytes:
    """16-bit words, high byte first."""
    return b"".join((word & 0xFFFF).to_bytes(2, "big") for word in words)


class Unit(ScriptedLink):
    """An EksoNR on virtual time that takes every setting. `boot` is in ms; `turn` is its time to answer.

    `on` maps a command to a function (msg_id, body) -> replies that is asked first; None lets the unit answer.
    """

    name = "unit"

    def __init__(self) -> None:
        super().__init__(self._reply)
        self.settings = list(SETTING_WORDS)
        self.data = list(DATA_WORDS)
        self.feedback = list(FEEDBACK_WORDS)
        self.boot0 = 5_000_001
        self.boot_rate = 1.0
        self.turn = 0.002
        self.status = 0
        self.effect = True
        self.on: dict[int, Callable[[int, bytes], list[Reply] | None]] = {}
        self.moving: dict[int, float] = {}

    @property
    def boot(self) -> list[int]:
        """The two words of BootTime now."""
        value = int(self.boot0 + self.clock * 1000 * self.boot_rate) % 2**32
        return [value >> 16, value & 0xFFFF]

    def set_to(self, parameter: int, raw: int) -> None:
        """Take a SetValue."""
        word = WORD_OF[parameter]
        self.settings[word] = raw - 65536 if word in (8, 9) and raw >= 32768 else raw

    def _reply(self, request: bytes) -> list[Reply]:
        command, msg_id, body = request[0], int.from_bytes(request[2:4], "big"), request[4:-2]
        assert crc(request) == 0
        assert command in range(150, 157), "a command that must never be sent"
        if command in self.on:
            replies = self.on[command](msg_id, body)
            if replies is not None:
                return replies
        return [(self.turn, frame(command, msg_id, self.body_of(command, body)))]

    def body_of(self, command: int, body: bytes = b"") -> bytes:
        """What a healthy unit answers."""
        if command == SET:
            if self.status == 0 and self.effect:
                self.set_to(int.from_bytes(body[:2], "big"), int.from_bytes(body[2:], "big"))
            return pack([self.status])
        if command == CANCEL:
            return pack([self.status])
        moved = [word + round(self.moving.get(place, 0) * self.clock * 100) for place, word in enumerate(self.data)]
        return {
            TIME: bytes([14, 5, 37, 0]),
            DATE: bytes([26, 11, 20, 0]),
            SETTINGS: pack(self.settings),
            DATA: pack([*moved[:25], *self.boot]),
            FEEDBACK: pack([*self.feedback[:15], *self.boot]),
        }[command]

    def commands(self) -> list[int]:
        """Command bytes sent so far."""
        return [request[0] for request in self.sent]

    def written(self) -> list[bytes]:
        """Bodies of the SetValue requests sent so far."""
        return [request[4:-2] for request in self.sent if request[0] == SET]


def port_on(link: ScriptedLink, **options: Any) -> DataPort:
    """A port behind `link`; options are those of DataPort."""
    return DataPort(link, Journal(), **options)


def ekso_on(link: ScriptedLink, **options: Any) -> Ekso:
    """A device behind `link`."""
    return Ekso(port_on(link, **options))


def codes(journal: Journal) -> list[str]:
    """Codes of the messages that were left."""
    return [message.code for message in journal.messages]


def in_pieces(data: bytes, how: str) -> Sequence[bytes]:
    """`data` whole, byte by byte, or in threes."""
    size = {"whole": max(1, len(data)), "bytes": 1, "threes": 3}[how]
    return [data[at : at + size] for at in range(0, len(data), size)]
