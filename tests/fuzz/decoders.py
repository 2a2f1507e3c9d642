"""One episode for each decoder of frames: what it may raise, what it may give, how much it may keep.

A frame that comes out is checked by sums and lengths written here, not by those of the code under test; behind a gap of
nothing a good frame is always found.
"""

from __future__ import annotations

import binascii
import random
from collections.abc import Iterator

from handctl.devices.aidin import json_codec
from handctl.devices.barrett.firmware import srecords
from handctl.devices.barrett.gcl import codec
from handctl.devices.barrett.realtime import blocks
from handctl.devices.ekso import frames
from handctl.devices.inspire import can_frames, eb90
from handctl.devices.inspire.explain_bytes import InspireExplainer
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import LinkError, ProtocolError, UsageError
from handctl.link import CanFrame, Deadline
from handctl.model.explainer import SIDES
from tests.ekso.support import frame as ekso_frame
from tests.fuzz.support import Chunks, mutated
from tests.support.scripted import unhex

ROUND = 40
"""Chunks between two gaps."""

VOLTAGE = unhex("90 EB 01 05 11 C0 05 52 03 31")
EB90_GOODS = [
    VOLTAGE,
    unhex("EB 90 01 04 11 E8 03 01 02"),
    unhex("90 EB 01 04 11 E8 03 01 02"),
    unhex("90 EB 01 04 12 CE 05 01 EB"),
    unhex("EB 90 01 0B 32 64 00 C8 00 2C 01 90 01 F4 01 1D"),
    b"\x90\xeb\x01\xff\x11\xe8\x03" + bytes(252) + b"\xfc",
]
EB90_LIKELY = unhex("90 EB EB 90 01 04 05 11 12 C0 05 E8 03 FF 00")


class Eb90:
    """The Inspire frame (exo §2.2): header, id, length, flag, sum. `prefixes` empty = any frame of either side."""

    def __init__(self, *prefixes: bytes) -> None:
        self._prefixes = prefixes
        self._chunks = Chunks(EB90_GOODS, EB90_LIKELY, [b"\xeb\x90\x01\xff", b"\x90", VOLTAGE[:7]])
        self._decoder = eb90.Decoder(prefixes)
        self._given = self._taken = 0

    def _frames(self, chunk: bytes) -> Iterator[bytes]:
        self._given += len(chunk)
        self._decoder.feed(chunk)
        while True:
            try:
                frame = self._decoder.next()
            except ProtocolError as exc:
                assert exc.code == "bad-checksum"
                continue
            if frame is None:
                break
            data = frame.encode()
            self._taken += len(data)
            assert data.startswith(self._prefixes or (b"\x90\xeb", b"\xeb\x90"))
            assert len(data) == data[3] + 5
            assert data[-1] == sum(data[2:-1]) % 256
            yield data
        assert self._decoder.pending < 260
        assert self._decoder.skipped + self._taken + self._decoder.pending == self._given

    def __call__(self, source: random.Random) -> int:
        for _ in range(ROUND):
            for _ in self._frames(self._chunks.next(source)):
                pass
        for _ in self._frames(bytes(260)):
            pass
        assert list(self._frames(VOLTAGE)) == [VOLTAGE]
        return ROUND + 2


EKSO_BODIES = {150: 3, 151: 3, 152: 44, 153: 54, 154: 34, 155: 2, 156: 2}
EKSO_LIKELY = bytes([*range(150, 157), 0, 2, 3, 4, 6, 44, 54, 34, 60])


def ekso_goods(source: random.Random) -> list[bytes]:
    """Answers of every command, with every reading of the length byte, and bare acknowledgements."""
    return [
        ekso_frame(command, source.randrange(65536), source.randbytes(size), more)
        for command, full in EKSO_BODIES.items()
        for size in (full, 0)
        for more in (0, 2, 4, 6)
    ]


class Ekso:
    """The DataPort frame (ekso §6): no start byte, a CRC over everything."""

    def __init__(self) -> None:
        self._goods = ekso_goods(random.Random(1))
        self._chunks = Chunks(self._goods, EKSO_LIKELY, [b"\x99\x36", b"\x99", self._goods[0][:4]])
        self._decoder = frames.Decoder()

    def _feed(self, chunk: bytes) -> list[frames.Frame]:
        found = []
        self._decoder.feed(chunk)
        while True:
            try:
                frame = self._decoder.next()
            except ProtocolError as exc:
                assert exc.code in ("bad-checksum", "bad-length")
                continue
            if frame is None:
                break
            assert binascii.crc_hqx(frame.data, 0xFFFF) == 0
            assert frame.data[4:-2] == frame.body
            assert frame.data[1] - len(frame.body) in (0, 2, 4, 6)
            assert frame.data[0] == frame.command
            found.append(frame)
        assert self._decoder.pending < 66
        return found

    def __call__(self, source: random.Random) -> int:
        for _ in range(ROUND):
            if source.random() < 0.2:
                command = source.choice(list(frames.Command))
                body = bytes(frames.EXCHANGES[command].asks)
                self._decoder.expect(frames.encode(command, source.randrange(65536), body))
            self._feed(self._chunks.next(source))
        self._feed(bytes(80))
        good = source.choice(self._goods)
        self._decoder.expect(ekso_frame(good[0], int.from_bytes(good[2:4], "big")))
        assert [frame.data for frame in self._feed(good)] == [good]
        return ROUND + 2


AIDIN_GOODS = [
    b'{"hand_mode":1}',
    b'{"motor_enc":[12,-3,4096],"joint_pos":[1.5,-2.25,0.0]}\n',
    b'{"fingertip_pos":[1,2,3],"hand_mode":5,"maxtorque":800}\r\n',
    b'{"a":{"b":[{"c":1},{}]},"d":"x\\"}{y"}\0',
    b"{}",
]
AIDIN_LIKELY = b'{}[]":,\\ \t\r\n\x000123456789.-+eEtrufalsn'


class Aidin:
    """Flat JSON objects without any frame (aidin, TCP/IP information)."""

    def __init__(self) -> None:
        floods = [b"{", b'{"a":', b"[", b'"', b'{"a":[1,', b'{"' + b"k" * 200, b"1"]
        self._chunks = Chunks(AIDIN_GOODS, AIDIN_LIKELY, floods)
        self._decoder = json_codec.Decoder()

    def _feed(self, chunk: bytes) -> list[dict[str, object]]:
        found = []
        self._decoder.feed(chunk)
        while True:
            try:
                content = self._decoder.next()
            except ProtocolError as exc:
                assert isinstance(exc, json_codec.MalformedObject)
                assert exc.data
                continue
            if content is None:
                break
            found.append(content)
        assert len(self._decoder.pending) <= 65536
        assert not self._decoder.pending or self._decoder.pending[:1] == b"{"
        return found

    def __call__(self, source: random.Random) -> int:
        for _ in range(ROUND):
            for content in self._feed(self._chunks.next(source)):
                assert isinstance(content, dict)
                for value in content.values():
                    try:
                        for number in json_codec.numbers(
                            value, source.randrange(4), int_range=source.choice([None, (0, 9)])
                        ):
                            assert abs(number) < float("inf")
                    except ProtocolError:
                        pass
        # An object cut off behind a comma or colon takes the next one for its own, once for each level.
        for _ in range(3):
            self._feed(b'\n{"hand_mode":3}')
        assert self._feed(b'\n{"hand_mode":4}') == [{"hand_mode": 4}]
        return ROUND + 4


GCL_PIECES = [
    b"FGET P", b"C", b"ERR ", b"ERR 3", b"\n\r", b"\r\n", b"=> ", b"=>", b" ", b"0 1 2 3", b"-1", b"1_0", b"\xff", b"\x03", b"\xb2",
    b"9" * 5000, b"16384", b"fget p", b"\x00", b"X" * 300,
]  # fmt: skip


def gcl(source: random.Random) -> int:
    """The BarrettHand's line protocol (barrett §5.1): an Answer, nothing, or a ProtocolError."""
    command = source.choice(["FGET P", "C", "ERR 3"])
    decoder = codec.Decoder(command)
    seen = b""
    for _ in range(10):
        chunk = source.choice(GCL_PIECES) if source.random() < 0.8 else source.randbytes(source.randrange(9))
        seen += chunk
        decoder.feed(chunk)
        answer = decoder.next()
        assert decoder.received == seen
        if answer is not None:
            assert answer.status >= 0
            assert answer.raw in seen
            assert b"=>" in answer.raw
            try:
                table = codec.values(answer, 1, 4)
            except ProtocolError:
                continue
            assert all(len(row) == 4 for row in table)
    decoder.feed(b"\n\r" + command.encode() + b"\n\r1 2 3 4\n\r=> ")
    assert decoder.next() is not None
    if source.random() < 0.1:
        decoder.drop_prompt()
    return 11


LOOP_PIECES = [
    b"*",
    b"\n\r",
    b"\n\rERR 2048\n\r=> ",
    b"ERR ",
    b"=> ",
    b"*\x01\x02\x03\x04",
    b"\x00",
    b"\n" * 80,
    b"9" * 30,
]


def loop(source: random.Random) -> int:
    """RealTime blocks (barrett §6): whole blocks at their place, or the loop is over. Nothing is searched for."""
    control = [name for name in blocks.CONTROL if source.random() < 0.5]
    feedback = [name for name in blocks.FEEDBACK if source.random() < 0.4]
    motors = {index: blocks.Selection(tuple(control), tuple(feedback)) for index in range(source.randrange(1, 5))}
    layout = blocks.Layout(motors, source.randrange(3))
    sizes = {"velocity": 1, "strain": 1, "position": 2, "delta": 1, "breakaway_position": 2, "analog": 1}
    size = 1 + len(motors) * sum(sizes[name] for name in feedback) + layout.temperature
    decoder = blocks.Decoder(layout)
    fed = taken = 0
    for count in range(1, 21):
        asked = source.random() < 0.8
        decoder.expect(asked)
        chunk = b"*" + source.randbytes(size - 1) if source.random() < 0.7 else source.choice(LOOP_PIECES)
        chunk = mutated(source, chunk) if source.random() < 0.05 else chunk
        fed += len(chunk)
        decoder.feed(chunk)
        try:
            while (answer := decoder.next()) is not None:
                if isinstance(answer, blocks.LoopError):
                    assert 0 <= answer.status < 10**10
                    return count
                taken += 1 if answer is True else size
                if isinstance(answer, blocks.Feedback):
                    assert set(answer.motors) == set(motors)
                    assert all(tuple(values) == tuple(feedback) for values in answer.motors.values())
        except ProtocolError as exc:
            assert exc.code in ("unasked", "bad-block")
            return count
        assert len(decoder.received) == fed - taken
        assert len(decoder.received) < max(size, 130)
    return 20


class _Line:
    def __init__(self, address: int, data: bytes) -> None:
        self.address, self.data = address, data


def transfer(source: random.Random) -> int:
    """A firmware record and its echoes (barrett §3.7): done only when every byte came back as it was sent."""
    data = source.randbytes(source.randrange(1, 40))
    address = source.randrange(0x10000)
    echoes = source.random() < 0.5
    one = srecords.Transfer(_Line(address, data), window=source.randrange(1, 5), triggers_echo=echoes)
    wrong_at = source.randrange(2 * len(data) + 12)
    back, sent, chunks = bytearray(), bytearray(), 0
    while not one.done:
        out = one.take()
        sent += out
        answer = bytearray(out if echoes else out.removeprefix(b"\xff") if one_begins(sent, out) else out)
        if wrong_at < len(answer):
            answer = bytearray(mutated(source, bytes(answer)))
        wrong_at -= len(answer)
        chunks += 1
        back += answer
        try:
            one.feed(bytes(answer))
        except ProtocolError as exc:
            assert exc.code in ("extra-byte", "wrong-echo")
            return chunks
        if not out and not answer:
            return chunks  # an echo was lost: the caller's deadline ends it
    whole = b"\xff" + bytes([address & 255, address >> 8, len(data)]) + b"\xff" + data
    assert bytes(sent) == whole
    assert bytes(back) == (whole if echoes else whole[1:4] + data)
    return chunks


def one_begins(sent: bytearray, out: bytes) -> bool:
    """Whether `out`, the last of `sent`, begins with a trigger: the first byte of all, or the one behind the head."""
    return len(sent) - len(out) in (0, 4)


def canreg_words(source: random.Random) -> int:
    """CAN identifiers and data (wrist §2.3), alone and told as a conversation."""
    words = InspireExplainer(WRIST)
    for _ in range(20):
        can_id = source.randrange(1 << 29)
        if source.random() < 0.7:
            can_id = source.choice((0, 1, 4, 5, 7)) << 26 | source.randrange(990, 1100) << 14 | source.randrange(3)
        access = can_frames.parse_identifier(can_id)
        assert (access.flag << 26) + (access.address << 14) + access.hand_id == can_id
        data = source.randbytes(source.randrange(9)) if source.random() < 0.6 else bytes([source.randrange(9)])
        for piece in (*words.feed(source.choice(SIDES), data, can_id), *words.decode(data, "", can_id)):
            assert (piece.can_id, piece.raw) == (can_id, data)
            assert piece.meaning
    try:
        can_id, data = can_frames.write_request(
            source.randrange(-1, 1 << 15), source.randrange(-1, 5000), source.randbytes(source.randrange(10))
        )
    except UsageError:
        return 20
    assert can_id >> 26 == 5
    assert 1 <= len(data) <= 8
    return 20


SLCAN_GOODS = [
    b"T1100000120403\r",
    b"T5000000180011223344556677\r",
    b"t1232AABB\r",
    b"R110000012\r",
    b"\r",
    b"z\r",
    b"Z\r",
    b"\x07",
    b"F04\r",
]


class Slcan:
    """Text of an slcan adapter, through python-can and our link: frames of a CAN bus, or a LinkError."""

    def __init__(self) -> None:
        self._chunks = Chunks(SLCAN_GOODS, b"TtRrdDbBx0123456789ABCDEFabcdef\r\r\x07 \xff_+-")
        self._open()

    def _open(self) -> None:
        from handctl.link.can import CanLink

        self._link = CanLink("can:slcan:loop://", exclusive=False)  # an echo is not an adapter
        self._wire = self._link._bus.serialPortOrig  # type: ignore[attr-defined]
        self._wire.reset_input_buffer()

    def _frames(self, chunk: bytes) -> list[CanFrame]:
        found = []
        self._wire.write(chunk)
        while self._wire.in_waiting or not {b"\r"[0], 7}.isdisjoint(self._link._bus._buffer):  # type: ignore[attr-defined]
            try:
                frame = self._link.receive(Deadline(lambda: 1.0, 0.0))
            except LinkError as exc:
                assert exc.code == "lost"
                self._open()  # the command is over; the next one opens the adapter anew
                return []
            if frame is not None:
                assert 0 <= frame.can_id < 1 << 29
                assert len(frame.data) <= 8
                found.append(frame)
        return found

    def __call__(self, source: random.Random) -> int:
        for _ in range(20):
            self._frames(self._chunks.next(source)[:200])
        self._frames(b"\r")
        assert self._frames(SLCAN_GOODS[0]) == [CanFrame(0x11000001, b"\x04\x03")]
        return 22
