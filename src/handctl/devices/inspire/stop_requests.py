"""Shared parts of the stop sequences of this maker's devices: requests and writes on each wire, and checks for movement.

Knows no device: its stopper says which registers tell where it is, and where it is to go.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from itertools import zip_longest
from typing import NamedTuple

from handctl.devices.inspire import can_frames, eb90, modbus_frames
from handctl.devices.inspire.register_bus import ahead, question
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.stop_repetition import after_late_replies, repeat_until_answered
from handctl.model.stop_sequence import BETWEEN, Pieces, StopContext, StopStep, silence

QUICK = 0.05
"""Seconds for an answer that tells one of this maker's devices from another: it must not hold up a stop."""
SHOWN = 16
"""Bytes of what came instead of an answer that a sentence holds."""

READS = "read where it is, or is to be"

EB90, RTU, TCP, CAN = "EB90", "Modbus RTU", "Modbus TCP", "CAN"
TAKEN, REFUSED = 0, -1
"""What an answer says of a write; above 0 it is the exception of Modbus."""

Read = Generator[StopStep, Pieces, list[int] | None]


def answer(pieces: Pieces, prefix: bytes) -> eb90.Frame | None:
    """The last frame that begins with `prefix`, of those that came whole and undamaged."""
    decoder = eb90.Decoder([prefix])
    decoder.feed(b"".join(pieces))
    return next(reversed(decoder.finish()), None)


def asks(number: int, flag: int) -> tuple[Step, bytes]:
    """The first request to an id that no other device could act on, and the beginning of its reply."""
    span = question(number, flag)
    return Step("ask who is there", eb90.read_request(number, *span, flag)), eb90.read_reply_prefix(number, *span, flag)


def lead(context: StopContext) -> bytes:
    """Bytes sent before a frame to an unidentified device: another device may hear it at a different baud rate."""
    return b"" if context.proven or context.can else ahead(context.speed)


class Wire(NamedTuple):
    """How a device is read and written while it is stopped.

    wrist  the register space is that of a wrist
    first  goes ahead of what it asks
    """

    context: StopContext
    name: str = EB90
    wrist: bool = False
    first: bytes = b""

    def asking(self, address: int, count: int, meaning: str = READS) -> tuple[Step, Callable[[Pieces], bytes | None]]:
        """The question for so many bytes, and what finds them in what comes."""
        number = self.context.number
        if self.name == CAN:
            flag = can_frames.READ_WRIST if self.wrist else can_frames.READ_HAND
            can_id, data = can_frames.read_request(number, address, count, flag)
            return Step(meaning, data, can_id=can_id), lambda pieces: next(
                (piece for piece in reversed(pieces) if len(piece) == count), None
            )
        if self.name == EB90:
            flag = eb90.WRIST_READ if self.wrist else eb90.READ
            prefix = eb90.read_reply_prefix(number, address, count, flag)
            step = Step(meaning, eb90.read_request(number, address, count, flag))
            return step, lambda pieces: frame.data if (frame := answer(pieces, prefix)) is not None else None
        pdu = modbus_frames.read_request(address, count // 2)

        def found(pieces: Pieces) -> bytes | None:
            told = self._answer(pieces, pdu)
            return modbus_frames.to_memory(told.data) if told is not None and told.exception is None else None

        return Step(meaning, self._framed(pdu)), found

    def writing(self, address: int, data: bytes, meaning: str) -> tuple[Step, Callable[[Pieces], int | None]]:
        """A write, and what judges it in what comes; None = nothing came that does."""
        number = self.context.number
        if self.name == CAN:
            flag = can_frames.WRITE_WRIST if self.wrist else can_frames.WRITE_HAND
            can_id, payload = can_frames.write_request(number, address, data, flag)

            def counted(pieces: Pieces) -> int | None:
                # empty, or the number of bytes taken; longer is our own frame, or a late answer to a read
                short = next((piece for piece in pieces if len(piece) < 2), None)
                return None if short is None else TAKEN if short in (b"", bytes([len(data)])) else REFUSED

            return Step(meaning, payload, moves=True, can_id=can_id), counted
        if self.name == EB90:
            flag = eb90.WRIST_WRITE if self.wrist else eb90.WRITE
            prefix = eb90.write_ack_prefix(number, address, flag)

            def acknowledged(pieces: Pieces) -> int | None:
                frame = answer(pieces, prefix)
                return None if frame is None else TAKEN if frame.data == bytes([eb90.ACCEPTED]) else REFUSED

            return Step(meaning, eb90.write_request(number, address, data, flag), moves=True), acknowledged
        pdu = modbus_frames.write_request(address, modbus_frames.to_memory(data))

        def answered(pieces: Pieces) -> int | None:
            told = self._answer(pieces, pdu)
            return None if told is None else told.exception or TAKEN

        return Step(meaning, self._framed(pdu), moves=True), answered

    def memory(self, address: int, count: int) -> Generator[StopStep, Pieces, bytes | None]:
        """So many bytes, asked again for a second; None where nothing answers."""
        step, found = self.asking(address, count)
        heard = yield from repeat_until_answered(self.context, step, found, reads=True, ahead=self.first)
        return (yield from after_late_replies(self.context, heard))

    def values(self, address: int, count: int) -> Read:
        """So many signed 16-bit registers."""
        data = yield from self.memory(address, 2 * count)
        return eb90.unpack_s16(data) if data is not None else None

    def _framed(self, pdu: bytes) -> bytes:
        return modbus_frames.tcp(1, pdu) if self.name == TCP else modbus_frames.rtu(self.context.number, pdu)

    def _answer(self, pieces: Pieces, pdu: bytes) -> modbus_frames.Answer | None:
        decoder = modbus_frames.TcpDecoder() if self.name == TCP else modbus_frames.RtuDecoder(self.context.number, pdu)
        decoder.feed(b"".join(pieces))
        return next((one for one in frames_in(decoder) if modbus_frames.answers(one.pdu, pdu)), None)


def seen_since(
    places: Callable[[], Read],
    targets: Callable[[], Read],
    wanted: Sequence[int | None],
    still: int,
    held: Sequence[int] = (),
) -> Generator[StopStep, Pieces, str]:
    """After a silence: what is commanded now, and whether it moves. What speaks against a stop, in words; "" = nothing.

    `wanted` is what the stop has commanded, None where it has not; `still` the most that standing places differ by; `held`
    the places where it is to stay: on a slow line it still comes back to these.
    """
    yield from silence()
    told = yield from targets()
    if told is not None and any(one not in (None, now) for one, now in zip(wanted, told, strict=False)):
        return f"it is commanded to {' '.join(map(str, told))}"
    before = yield from places()
    if before is None:
        return ""
    yield from silence(BETWEEN)
    now = yield from places()
    if now is None:
        return ""
    back = [abs(there - place) < abs(here - place) for here, there, place in zip(before, now, held, strict=False)]
    moved = [abs(there - here) > still for here, there in zip(before, now, strict=True)]
    if any(one and not other for one, other in zip_longest(moved, back, fillvalue=False)):
        return f"it moves: {' '.join(map(str, before))}, then {' '.join(map(str, now))}"
    return ""


def instead(heard: Pieces) -> str:
    """What came where no answer did, in words: our own frames, which an echo brings back, or others; "" for silence."""
    came = b"".join(heard)
    if not came:
        return ""
    rest = came
    while rest.startswith(eb90.HOST) and len(rest) >= eb90.OVERHEAD:
        rest = rest[rest[3] + eb90.OVERHEAD :]  # byte 3 is the length
    return f"{came[:SHOWN].hex(' ').upper()} arrived instead" if rest else "only our own bytes came back"
