"""One episode for each decoder of Modbus: what it may give, how much it may keep. Sums and lengths are those of this file."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator

from handctl.devices.inspire.modbus_frames import Answer, RtuDecoder, TcpDecoder, answers
from handctl.errors import ProtocolError
from tests.fuzz.support import Chunks
from tests.support.odd_hands import crc, rtu, tcp
from tests.support.scripted import unhex

ROUND = 40
READ = unhex("03 06 0A 00 06")
ANGLES = unhex("03 0C 00 6E 00 DC 01 4A 01 B8 02 26 02 94")
REFUSED = unhex("83 02")
WRITE = unhex("10 05 CE 00 06 0C FF FF FF FF FF FF 01 2C FF FF FF FF")
TAKEN = unhex("10 05 CE 00 06")
LIKELY = unhex("01 03 0C 06 0A 00 06 83 02 10 05 CE 90 FF 07")


class Rtu:
    """The answer to one request in a stream without marks: unit, function, size and CRC."""

    def __init__(self, request: bytes = READ, good: bytes = ANGLES) -> None:
        self._request, self._good = request, rtu(1, good)
        goods = [self._good, rtu(1, request), rtu(1, REFUSED), rtu(2, good), rtu(1, TAKEN)]
        self._chunks = Chunks(goods, LIKELY, [b"\x01\x03\x0c", b"\x01", b"\x01\x83"])
        self._decoder = RtuDecoder(1, request)
        self._given = self._taken = 0

    def _answers(self, chunk: bytes) -> Iterator[Answer]:
        self._given += len(chunk)
        self._decoder.feed(chunk)
        while True:
            try:
                answer = self._decoder.next()
            except ProtocolError as exc:
                assert exc.code == "bad-checksum" and exc.hint
                continue
            if answer is None:
                break
            frame = bytes([answer.unit]) + answer.pdu
            assert answer.unit == 1 and answers(answer.pdu, self._request) and len(frame) + 2 <= 256
            self._taken += len(frame) + 2
            yield answer
        assert self._decoder.pending < 260
        assert self._decoder.skipped + self._taken + self._decoder.pending == self._given

    def __call__(self, source: random.Random) -> int:
        for _ in range(ROUND):
            for _ in self._answers(self._chunks.next(source)):
                pass
        for _ in self._answers(bytes(260)):
            pass
        (answer,) = self._answers(self._good)
        assert rtu(answer.unit, answer.pdu) == self._good and self._good[-2:] == crc(self._good[:-2])
        return ROUND + 2


class Tcp:
    """Answers in a TCP stream: two zeros and a length that fits; what follows anything else has no known beginning."""

    def __init__(self) -> None:
        self._chunks = Chunks(
            [tcp(1, ANGLES), tcp(2, REFUSED), tcp(3, TAKEN), tcp(4, READ)],
            LIKELY, [b"\0\1\0\0\0\x0f\xff\x03", b"\0", b"\xff\xff\0\0\0\xfe"],
        )  # fmt: skip

    def _answers(self, decoder: TcpDecoder, chunk: bytes) -> Iterator[Answer]:
        decoder.feed(chunk)
        while True:
            try:
                answer = decoder.next()
            except ProtocolError as exc:
                assert exc.code == "garbage" and exc.hint and decoder.pending == 0
                continue
            if answer is None:
                break
            assert answer.transaction is not None and 2 <= len(answer.pdu) <= 253
            yield answer
        assert decoder.pending < 2048 + 260

    def __call__(self, source: random.Random) -> int:
        decoder = TcpDecoder()  # each question has one of its own
        for _ in range(ROUND):
            for answer in self._answers(decoder, self._chunks.next(source)):
                assert struct.pack(">H", answer.transaction) != b""
        decoder.rest()
        (answer,) = self._answers(decoder, tcp(9, ANGLES))
        assert (answer.transaction, answer.pdu) == (9, ANGLES)
        return ROUND + 1
