"""The DataPort frame, bytes <-> frames (ekso §6). Sans I/O: knows no link, no clock, no field names.

     byte    1          2          3        4        5 .. N-2          N-1      N
           command    length     msgID    msgID    body, S bytes     CRC      CRC
           150..156   S          high     low      words high first  high     low
           |<------------------ covered by the CRC ----------------->|

Both directions have this shape; an answer repeats command and msgID. There is no start byte: a frame is found by its
command, its length, its msgID and its CRC. The manual does not say what the length byte counts. Sent is S, the bytes of
the body (`body`), unless told otherwise; received is whatever fits: S, S + 2 (`n-4`), S + 4 (`n-2`) or S + 6 (`frame`).

The CRC is CRC-CCITT: x^16 + x^12 + x^5 + 1, start FFFF, not reflected, no final XOR, 29B1 over "123456789".
"""

from __future__ import annotations

import re
import struct
from binascii import crc_hqx
from collections.abc import Iterator
from enum import IntEnum
from functools import lru_cache
from typing import Any, NamedTuple

from handctl.errors import ProtocolError, UsageError
from handctl.model.frame_decoder import Stream

OVERHEAD = 6
LENGTH_MODES: dict[str, int] = {"body": 0, "n-4": 2, "n-2": 4, "frame": 6}
"""What the length byte counts -> how much more than S it says."""
DEFAULT_CANCEL_WORD = 0x0100
"""Command word of CancelAction: any but 0 will do (ekso §6); this is what clients in the field send."""


class Command(IntEnum):
    """The commands of the manual (ekso §6). Others exist in the field, one of them starts movements: never sent."""

    GET_TIME = 150
    GET_DATE = 151
    GET_SETTINGS = 152
    GET_DATA = 153
    GET_FEEDBACK = 154
    SET_VALUE = 155
    CANCEL_ACTION = 156


class Exchange(NamedTuple):
    """One request of the DataPort and its answer.

    command  its number, in request and answer
    name     as the manual spells it
    asks     bytes of the body of its request; None = not in the manual, met in the field: known so that it can be dropped whole
    answers  bytes that the body of its answer may have; 0, the bare acknowledgement, may come for any
    words    what its answer holds, by the name that this has in `parameter_map`; "" = a status word
    """

    command: int
    name: str
    asks: int | None
    answers: tuple[int, ...]
    words: str = ""

    @property
    def writes(self) -> bool:
        """Whether it changes something: commands that return only a status, and unknown ones."""
        return not self.words


START_MOVEMENT = 157
"""Met in the field, not in the manual. handctl never sends it."""
EXCHANGES = {
    row.command: row
    for row in (
        Exchange(Command.GET_TIME, "GetTime", 0, (3, 4), "time"),
        Exchange(Command.GET_DATE, "GetDate", 0, (3, 4), "date"),
        Exchange(Command.GET_SETTINGS, "GetSettings", 0, (44,), "settings"),
        Exchange(Command.GET_DATA, "GetData", 0, (54,), "data"),
        Exchange(Command.GET_FEEDBACK, "GetFeedback", 0, (34,), "feedback"),
        Exchange(Command.SET_VALUE, "SetValue", 4, (2,)),
        Exchange(Command.CANCEL_ACTION, "CancelAction", 2, (2,)),
        *(
            Exchange(command, f"command {command}", None, (size,))
            for command, size in ((START_MOVEMENT, 2), (158, 6), (159, 2), (160, 2))
        ),
    )
}
READS = {row.words: Command(row.command) for row in EXCHANGES.values() if row.words}
"""Name in `parameter_map` -> what asks for it."""
STATUS = {
    0: "accepted",
    1: "refused in the present state",
    2: "value out of range",
    3: "value or command not allowed",
}
"""Low byte of the status word. The manual gives the word without values; these are from clients in the field."""


class Frame(NamedTuple):
    """One frame with a good CRC. `mode` is what its length byte counted, `data` the frame as it stood on the wire."""

    command: int
    msg_id: int
    body: bytes
    mode: str
    data: bytes

    @property
    def words(self) -> tuple[int, ...]:
        """The body as signed 16-bit words, high byte first."""
        return unpack(self.body)

    @property
    def status(self) -> int:
        """The status word of the answer to what writes; its low byte 0 = accepted."""
        return int.from_bytes(self.body[:2], "big")

    @property
    def key(self) -> tuple[int, int]:
        """Command and msgID, which an answer repeats."""
        return self.command, self.msg_id

    def answers(self, request: bytes) -> bool:
        """Whether it is the answer to a request. A bare acknowledgement, and our own bytes coming back, prove nothing."""
        return self.key == key_of(request) and bool(self.body) and self.data != request


def key_of(request: bytes) -> tuple[int, int]:
    """Command and msgID of a request."""
    return request[0], int.from_bytes(request[2:4], "big")


def id_after(msg_id: int) -> int:
    """The msgID of the next request: 0 comes after 65535."""
    return (msg_id + 1) & 0xFFFF


def crc(data: bytes) -> int:
    """CRC-CCITT as the manual has it; 0000 over a whole good frame."""
    return crc_hqx(data, 0xFFFF)


@lru_cache(maxsize=4)
def encode(command: Command, msg_id: int, body: bytes = b"", mode: str = "body") -> bytes:
    """A request. Raises UsageError for a command, a msgID, a size or a length convention that does not exist."""
    if command not in EXCHANGES or len(body) != EXCHANGES[command].asks:
        raise UsageError(
            f"command {int(command)} with {len(body)} body bytes does not exist (ekso §6)",
            hint="use a command of the manual",
        )
    if not 0 <= msg_id <= 0xFFFF:
        raise UsageError(f"msgID {msg_id} does not fit 16 bits", hint="use 0 to 65535")
    if mode not in LENGTH_MODES:
        raise UsageError(f"unknown --length-mode {mode!r}", hint=f"use one of {', '.join(LENGTH_MODES)}")
    head = bytes([command, len(body) + LENGTH_MODES[mode]]) + msg_id.to_bytes(2, "big") + body
    return head + crc(head).to_bytes(2, "big")


def set_value_body(parameter_id: int, raw: int) -> bytes:
    """ParameterID and scaled value of a SetValue; negative values as two's complement (ekso §6, ParameterID table)."""
    if not 200 <= parameter_id <= 219 or not -0x8000 <= raw <= 0xFFFF:
        raise UsageError(
            f"ParameterID {parameter_id} with raw value {raw} cannot be sent",
            hint="use a ParameterID from 200 to 219 and a 16-bit value",
        )
    return struct.pack(">HH", parameter_id, raw & 0xFFFF)


def cancel_body(word: int = DEFAULT_CANCEL_WORD) -> bytes:
    """Command word of a CancelAction, any value but 0 (ekso §6). Raises UsageError."""
    if not 1 <= word <= 0xFFFF:
        raise UsageError(f"command word {word} is not allowed", hint="1 to 65535: any non-zero value (ekso §6)")
    return struct.pack(">H", word)


def unpack(body: bytes, signs: str = "") -> tuple[int, ...]:
    """The 16-bit words of a body, high byte first: signed, or each with its own of `signs`, h for signed and H for unsigned."""
    return struct.unpack(">" + (signs or "h" * (len(body) // 2)), body[: len(body) // 2 * 2])


def name_of(command: int) -> str:
    """``GetData`` for 153, ``command 160`` for what the manual does not have."""
    return EXCHANGES[command].name if command in EXCHANGES else f"command {command}"


def status_text(word: int) -> str:
    """A status word in words; the high byte, the state at the refusal, means something with code 1 only."""
    code = word & 0xFF
    text = STATUS.get(code, f"unknown ({code})")
    return f"{text}, state 0x{word >> 8 & 0xFF:02X}" if code == 1 else text


def differences(request: bytes, received: bytes) -> list[str]:
    """How one frame in place of the reply to a read differs from that, in ways that a firmware may have; [] = it is none."""
    data, sizes = received.removeprefix(request), EXCHANGES[request[0]].answers
    if len(data) <= OVERHEAD or data[0] ^ request[0] not in (0, 0x40, 0x80):
        return []
    found = [f"bit {(data[0] ^ request[0]).bit_length() - 1} of the command inverted"] if data[0] != request[0] else []
    asked, told = key_of(request)[1], int.from_bytes(data[2:4], "big")
    if told != asked:
        ways = {int.from_bytes(request[3:1:-1], "big"): "the msgID with its low byte first", 0: "msgID 0"}
        found.append(ways.get(told, ""))
    size, right = len(data) - OVERHEAD, crc(data[:-2]).to_bytes(2, "big")
    if data[-2:] != right:
        checks = {
            right[::-1]: "the CRC with its low byte first",
            bytes(255 - byte for byte in right): "an inverted CRC",
            (sum(data[:-2]) & 0xFFFF).to_bytes(2, "big"): "a sum in place of the CRC",
        }
        found.append(checks.get(data[-2:], ""))
    if size not in sizes:
        more = size - sizes[-1]
        found.append(f"{abs(more)} {BODY_BYTES} too {'many' if more > 0 else 'few'}")
    if data[1] - size not in LENGTH_MODES.values():
        odd = "the length in words" if data[1] == size // 2 else f"a length byte that is {data[1] - size:+d}"
        found.append(odd if data[1] else "length byte 0")
    return [] if "" in found else found


BODY_BYTES = "body bytes"
ORDERS = {
    met: sorted(LENGTH_MODES.items(), key=lambda item: (item[0] != met, -item[1])) for met in (None, *LENGTH_MODES)
}
"""Conventions in the order they are tried, by the one met before."""
BEGIN = re.compile(b"[%s]" % re.escape(bytes(EXCHANGES)))


class Decoder(Stream[Frame]):
    """Finds frames in a stream: `expect` the answer to a request, `feed` bytes, call `next` until it returns None.

    Every place where a known command stands may begin a frame; it is one when its length allows a size that this
    command has and the CRC fits. What begins like the expected answer but is none raises ProtocolError and costs one
    byte, never the buffer. Our own request coming back is returned as a frame too (`data` tells).

    `skipped` counts bytes that belonged to no frame; `mode` is the length convention that was met last.
    """

    def __init__(self) -> None:
        super().__init__()
        self._expected: tuple[int, int] | None = None
        self._request = b""
        self._sizes: tuple[int, ...] = ()
        """Of the body of the expected answer."""
        self.mode: str | None = None

    def expect(self, request: bytes) -> None:
        """What follows shall answer `request`; bytes that are still held are kept."""
        self._request = request
        self._expected = key_of(request)
        self._sizes = EXCHANGES[request[0]].answers

    def clear(self) -> None:
        """Drop what is held."""
        self._drop(len(self._buffer), stray=len(self._buffer))

    def next(self) -> Frame | None:
        """The next frame, or None until more bytes come. Raises ProtocolError for a broken answer."""
        size, mode = len(self._buffer) - OVERHEAD, self.mode
        if size in self._sizes and mode is not None:  # as it mostly comes: the line waits for the next request
            data, request = bytes(self._buffer), self._request
            head = bytes([request[0], size + LENGTH_MODES[mode]]) + request[2:4]
            if data.startswith(head) and not crc(data):
                self._buffer.clear()
                return Frame(data[0], int.from_bytes(data[2:4], "big"), data[4:-2], mode, data)
        keep, at = len(self._buffer), -1
        while place := BEGIN.search(self._buffer, at + 1):
            at = place.start()
            found = self._look(at)
            if isinstance(found, Frame):
                self._drop(at + len(found.data), stray=at)
                self.mode = found.mode
                return found
            if isinstance(found, ProtocolError):
                self._drop(at + 1, stray=at + 1)
                raise found
            if found:
                keep = min(keep, at)
                if self._is_mine(at):
                    break  # the answer has begun: what looks like a frame inside it is none
        self._drop(keep, stray=keep)
        return None

    def _drop(self, count: int, *, stray: int) -> None:
        del self._buffer[:count]
        self.skipped += stray

    def _is_mine(self, at: int) -> bool:
        return len(self._buffer) >= at + 4 and key_of(bytes(self._buffer[at : at + 4])) == self._expected

    def _look(self, at: int) -> Frame | ProtocolError | bool:
        """The data at `at`: a frame, a damaged reply, a possible beginning (True), or nothing (False)."""
        sizes = EXCHANGES[self._buffer[at]].answers
        view = bytes(self._buffer[at : at + OVERHEAD + max(sizes) + 6])
        if len(view) < 4:
            return True
        msg_id = int.from_bytes(view[2:4], "big")
        echo = len(self._request)
        if echo and view[:echo] == self._request:
            return Frame(view[0], msg_id, view[4 : echo - 2], self.mode or "body", self._request)
        may_grow = self._request.startswith(view)
        fitting = [(mode, size) for mode, size in self._readings(view[1]) if size == 0 or size in sizes]
        for mode, size in fitting:
            total = size + OVERHEAD
            if len(view) < total:
                may_grow = True
            elif crc(view[:total]) == 0:
                return Frame(view[0], msg_id, view[4 : total - 2], mode, view[:total])
        if may_grow or not self._is_mine(at):
            return may_grow
        return _broken(view, fitting)

    def _readings(self, length: int) -> Iterator[tuple[str, int]]:
        """(convention, size of the body) that a length byte may mean: the one met before first, then short to long."""
        return ((mode, length - more) for mode, more in ORDERS[self.mode] if length >= more)


def _broken(view: bytes, fitting: list[tuple[str, int]]) -> ProtocolError:
    name = name_of(view[0])
    shown: Any = view[: fitting[0][1] + OVERHEAD] if fitting else view
    if not fitting:
        sizes = " or ".join(str(size) for size in EXCHANGES[view[0]].answers)
        return ProtocolError(
            f"length byte {view[1]} does not match any reply to {name} ({sizes} body bytes), in {shown.hex(' ').upper()}",
            code="bad-length",
        )
    return ProtocolError(
        f"bad CRC {shown[-2:].hex().upper()}, expected {crc(shown[:-2]):04X}, in {shown.hex(' ').upper()}",
        code="bad-checksum",
    )


def never_sent(data: bytes) -> str:
    """What in `data` no EksoNR may receive, whoever sends it: a whole frame of the command that starts a movement; "" = nothing.

    A frame has no start byte: it may begin anywhere, and by either convention of its length.
    """
    for at, byte in enumerate(data):
        if byte != START_MOVEMENT or len(data) < at + OVERHEAD:
            continue
        ends = [at + OVERHEAD + data[at + 1] - more for more in LENGTH_MODES.values() if data[at + 1] >= more]
        if any(end <= len(data) and crc(data[at:end]) == 0 for end in ends):
            return f"command {START_MOVEMENT} of an EksoNR, which starts a movement"
    return ""


def sign(data: bytes) -> str:
    """What in `data` shows an EksoNR: a whole answer with a body and a good CRC."""
    decoder = Decoder()
    decoder.feed(data)
    found = [frame for frame in decoder.finish() if frame.body]
    return f"the DataPort's reply to {name_of(found[0].command)}" if found else ""
