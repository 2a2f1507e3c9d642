"""Shared parts of the stop sequences of this maker's devices: requests and writes on each wire, and checks for movement.

Knows no device: its stopper says which registers tell where it is, and where it is to go.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import NamedTuple

from handctl.devices.inspire import can_frames, eb90, modbus_frames
from handctl.devices.inspire.modbus_frames import TCP
from handctl.devices.inspire.register_bus import AHEAD, question
from handctl.errors import CheckFailed
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.stop_check import check_standing
from handctl.model.stop_repetition import after_late_replies, repeat_until_answered
from handctl.model.stop_sequence import SILENCE, Pieces, Read, StopContext, Stopped, StopStep, did_not_last, silence

QUICK = 0.05
"""Seconds for an answer that tells one of this maker's devices from another: it must not hold up a stop."""
SHOWN = 16
"""Bytes of what came instead of an answer that a sentence holds."""

READS = "read where it is, or is to be"

EB90, CAN = "eb90", "can"
TAKEN, REFUSED = 0, -1
"""What an answer says of a write; above 0 it is the exception of Modbus."""


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
    return b"" if context.proven or context.can else AHEAD.get(context.speed, b"")


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

        return Step(meaning, modbus_frames.framed(self.name, number, 1, pdu)), found

    def writing(self, address: int, data: bytes, meaning: str) -> tuple[Step, Callable[[Pieces], int | None]]:
        """A write, and what judges it in what comes; None = nothing came that does."""
        number = self.context.number
        if self.name == CAN:
            flag = can_frames.WRITE_WRIST if self.wrist else can_frames.WRITE_HAND
            can_id, payload = can_frames.write_request(number, address, data, flag)

            def counted(pieces: Pieces) -> int | None:
                # empty, or the number of bytes taken; longer is our own frame, or a late answer to a read
                short = next((piece for piece in reversed(pieces) if len(piece) < 2), None)
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

        return Step(meaning, modbus_frames.framed(self.name, number, 1, pdu), moves=True), answered

    def memory(self, address: int, count: int) -> Generator[StopStep, Pieces, bytes | None]:
        """So many bytes, asked again for a second; None where nothing answers."""
        step, found = self.asking(address, count)
        heard = yield from repeat_until_answered(self.context, step, found, reads=True, ahead=self.first)
        return (yield from after_late_replies(self.context, heard))

    def values(self, address: int, count: int) -> Read:
        """So many signed 16-bit registers."""
        data = yield from self.memory(address, 2 * count)
        return eb90.unpack_s16(data) if data is not None else None

    def _answer(self, pieces: Pieces, pdu: bytes) -> modbus_frames.Answer | None:
        """The last answer to `pdu` in what came."""
        data = b"".join(pieces)
        if self.name == TCP:
            # the rest of a reply that came in pieces may stand before it, and a header has no mark of its own
            sizes = ((start, modbus_frames.tcp_size(data[start : start + 8])) for start in range(len(data)))
            whole = [data[start : start + size] for start, size in sizes if 0 < size <= len(data) - start]
            found = [modbus_frames.Answer(frame[6], frame[modbus_frames.MBAP :]) for frame in whole]
        else:
            decoder = modbus_frames.RtuDecoder(self.context.number, pdu)
            decoder.feed(data)
            found = list(frames_in(decoder))
        return next((one for one in reversed(found) if modbus_frames.answers(one.pdu, pdu)), None)


def hold_target(reading: int, low: int, high: int, near: int) -> int | None:
    """Where to hold an axis that reads `reading`; None if that is no position of it.

    Both ends are ends of travel (exo §2.2.1, wrist §1), so an axis that reads at most `near` past one is at that end. It is
    held there: left alone, it would go on to its last target. `near` is the distance within which a target counts as reached.
    """
    target = min(max(reading, low), high)
    return target if abs(reading - target) <= near else None


class Axes(NamedTuple):
    """The axes that a stop holds, in the order in which they are read: names, readings, targets of the hold, and how to show one.

    A target is None for an axis whose reading is no position: it is left alone.
    """

    names: Sequence[str]
    readings: Sequence[int]
    targets: Sequence[int | None]
    shown: Callable[[int], str] = str

    @property
    def left(self) -> str:
        """The axes that are not held, with their readings; "" = none."""
        return self._named(lambda reading, target: target is None)

    @property
    def at_end(self) -> str:
        """What to add to the words of the hold: the axes that are held at an end, which they read past; "" = none."""
        named = self._named(lambda reading, target: target not in (None, reading))
        return f" ({named}: at the end of its range)" if named else ""

    def _named(self, which: Callable[[int, int | None], bool]) -> str:
        found = zip(self.names, self.readings, self.targets, strict=True)
        return ", ".join(
            f"{name} reads {self.shown(reading)}" for name, reading, target in found if which(reading, target)
        )

    def judge(self, stopped: Stopped, again: Sequence[int | None], power: str) -> Stopped:
        """The result of the stop, which says which axes are not held. An error unless each was seen standing at a position.

        `again` has the targets for their readings behind the stop, which stood still; [] where they were not seen.
        """
        if self.left:
            text = f"{stopped.text}. Not held, because its reading is no position: {self.left}"
            if stopped.error is None and again and None not in again:
                return stopped._replace(text=f"{text}. {SILENCE:g} s later it stands still at a position")
            return Stopped(text, stopped.hint or power, stopped.error or CheckFailed)
        lost = ", ".join(name for name, target in zip(self.names, again, strict=False) if target is None)
        if stopped.error is None and lost:
            text = f"{stopped.text}. {SILENCE:g} s later the reading is no position, so nothing shows that it stands still: {lost}"
            return Stopped(text, power, CheckFailed)
        return stopped


def check_again(
    stopped: Stopped,
    places: Callable[[], Read],
    targets: Callable[[], Read],
    wanted: Sequence[int | None],
    noise: int,
    held: Sequence[int | None] = (),
) -> Generator[StopStep, Pieces, tuple[Stopped, list[int]]]:
    """After a silence: what is commanded now, and whether it stands still. The result of the stop, and the last positions.

    `wanted` is what the stop has commanded, None where it has not; `noise` and `held` as in `stands_still`.
    """
    yield from silence()
    told = yield from targets()
    if told is not None and any(one not in (None, now) for one, now in zip(wanted, told, strict=False)):
        return did_not_last(stopped, f"it is commanded to {' '.join(map(str, told))}"), []
    return (yield from check_standing(stopped, places, noise, held))


def instead(heard: Pieces) -> str:
    """What came where no answer did, in words: our own frames, which an echo brings back, or others; "" for silence."""
    came = b"".join(heard)
    if not came:
        return ""
    rest = came
    while rest.startswith(eb90.HOST) and len(rest) >= eb90.OVERHEAD:
        rest = rest[rest[3] + eb90.OVERHEAD :]  # byte 3 is the length
    return f"{came[:SHOWN].hex(' ').upper()} arrived instead" if rest else "only our own bytes came back"
