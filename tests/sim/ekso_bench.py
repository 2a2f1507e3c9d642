"""The simulated EksoNR in virtual time, fed bytes by hand; messages written out from the design document."""

from __future__ import annotations

from binascii import crc_hqx

from handctl.sim import create
from handctl.sim.engine.line_and_faults import Line

GET_TIME = "96 00 00 C8 3D 82"
TIME_4 = "96 04 00 C8 0E 05 25 00 31 2A"
GET_DATE = "97 00 00 C9 5B 17"
DATE_4 = "97 04 00 C9 1A 0B 14 00 20 5B"
GET_SETTINGS = "98 00 00 CA BF 9A"
SETTINGS = (
    "98 2C 00 CA 06 A4 06 40 06 0E 00 C8 00 5A 00 32 01 F4 01 2C FF B5 00 7D 00 02 00 01 00 03 00 00 00 0A 00 0C 00 02"
    " 00 03 00 04 00 07 00 01 00 02 72 E5"
)
GET_DATA = "99 00 00 CB D9 0F"
GET_FEEDBACK = "9A 00 00 CC 32 34"
SET_STEP = "9B 04 00 CD 00 CA 06 0E 5E FE"
SET_OK = "9B 02 00 CD 00 00 23 33"
SET_WRONG_STATE = "9B 02 00 CD 20 01 35 F4"
CANCEL = "9C 02 00 CF 01 00 B6 23"
CANCEL_OK = "9C 02 00 CF 00 00 85 12"
UNASKED = "A0 02 00 00 00 01 BB 9A"
POWER_ON = [  # GetSettings of the preset clinic, all as raw words
    *(1680, 1640, 1475, 175, 110, 65, 1250, 820, 65536 - 150, 85),
    *(3, 1, 0, 2, 8, 14, 4, 5, 6, 4711, 0, 2),
]


def message(command: int, ident: int, body: bytes = b"") -> bytes:
    data = bytes([command, len(body), ident >> 8, ident & 255]) + body
    return data + crc_hqx(data, 0xFFFF).to_bytes(2, "big")


def words_of(body: bytes) -> list[int]:
    return [int.from_bytes(body[at : at + 2], "big") for at in range(0, len(body), 2)]


class Bench:
    """A line on virtual time; options as in a link, with _ for -."""

    def __init__(self, **options: object) -> None:
        self.line: Line = create("ekso", {name.replace("_", "-"): str(value) for name, value in options.items()})
        self.now = 0.0
        self.line.advance(0.0)

    def ask(self, request: str) -> str:
        self.line.feed(bytes.fromhex(request))
        return self.heard()

    def heard(self) -> str:
        return self.line.take().hex(" ").upper()

    def wait(self, seconds: float) -> str:
        """Lets time pass in steps of 10 ms at most; returns what came."""
        came = []
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = min(end, self.now + max(0.01, seconds / 500))
            self.line.advance(self.now)
            came.append(self.heard())
        return " ".join(filter(None, came))

    def words(self, command: int) -> list[int]:
        """The words of a good answer to a read."""
        self.line.feed(message(command, 7))
        data = self.line.take()
        assert data == message(command, 7, data[4:-2])
        return words_of(data[4:-2])

    def set(self, parameter: int, raw: int) -> tuple[int, int]:
        """State byte and status code of a SetValue."""
        body = parameter.to_bytes(2, "big") + (raw % 65536).to_bytes(2, "big")
        self.line.feed(message(155, 7, body))
        data = self.line.take()
        assert data == message(155, 7, data[4:6])
        return data[4], data[5]
