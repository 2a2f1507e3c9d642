"""RealTime blocks <-> bytes (barrett §6). Sans I/O: knows no link and no clock, and of the parameters how a position is read.

    control   43 | 63 | 41 | 61     C data, feedback; c data, acknowledgement; A, a the same without data
              then, if C or c, per motor in order: [LCV s8] [LCPG u8]
    feedback  2A    then per motor in order: [LFV s8] [LFS u8] [LFAP u16] [LFDP s8] {4.4: [LFBP u16] [LFAIN u8]}
              then [LFT: 4.3x s16 in 0.1 °C, 4.4 u8 in °C]
    instead   0A 0D "ERR n" 0A 0D "=> "    the hand is back in supervisory mode

Words have their high byte first (dossier 6.2; the manual does not say). 2A is also a data value: an answer is found by its
place in the stream only, never searched for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from struct import Struct
from typing import NamedTuple

from handctl.devices.barrett.gcl.codec import DISTURBED, PROMPT
from handctl.devices.barrett.parameter_map import with_sign
from handctl.errors import ProtocolError, UsageError

ACKNOWLEDGE = 0x2A
DATA_FEEDBACK, DATA_ONLY, FEEDBACK_ONLY, NEITHER = b"C", b"c", b"A", b"a"
Values = dict[int, dict[str, int]]
"""Motor index -> name of CONTROL -> what is sent."""
ERROR_TEXT = 64
"""Longest error answer that is waited for, in bytes."""

CONTROL = {"velocity": "LCV", "gain": "LCPG"}
"""What a control block may carry: name -> flag (barrett §6.2.1)."""
FEEDBACK = {
    "velocity": "LFV",
    "strain": "LFS",
    "position": "LFAP",
    "delta": "LFDP",
    "breakaway_position": "LFBP",
    "analog": "LFAIN",
}
"""What a feedback block may carry per motor, in wire order: name -> flag (barrett §6.2.2; the last two from 4.4 on)."""
FORMS = {
    "velocity": "b",
    "gain": "B",
    "strain": "B",
    "position": "H",
    "delta": "b",
    "breakaway_position": "H",
    "analog": "B",
}
"""How `struct` calls the number of each."""
POSITIONS = ("position", "breakaway_position")
UNITS = {"position": "cts", "delta": "cts", "breakaway_position": "cts"}
LIMITS = {"velocity": (-127, 127), "gain": (0, 255)}
"""What is sent: the vendor sends -127 to 127 although a signed byte reaches -128 (dossier 6.3)."""
CARRIAGE_RETURN = 0x0D


class Selection(NamedTuple):
    """One motor's flags and coefficients: the names of CONTROL and FEEDBACK that its blocks carry."""

    control: tuple[str, ...]
    feedback: tuple[str, ...]
    velocity_factor: int = 1
    velocity_divisor: int = 1
    delta_divisor: int = 1

    def scaled(self, name: str, value: int) -> int:
        """A value of the feedback without its divisor: deltas in counts."""
        return value * {"velocity": self.velocity_divisor, "delta": self.delta_divisor}.get(name, 1)


@dataclass(frozen=True)
class Layout:
    """The structure of the blocks, frozen when the loop is entered.

    motors       index (0..2 fingers, 3 spread) -> what its blocks carry; ascending
    temperature  bytes of the temperature at the end of the feedback: 0, 1 (firmware 4.4) or 2 (4.3x)
    """

    motors: Mapping[int, Selection]
    temperature: int = 0

    @cached_property
    def control_names(self) -> Sequence[tuple[int, str]]:
        """Motor and name of each value of a control block with data, in its order."""
        return [(index, name) for index, motor in self.motors.items() for name in motor.control]

    @cached_property
    def feedback_names(self) -> Sequence[tuple[int, str]]:
        """The same of a feedback block, without the temperature."""
        return [(index, name) for index, motor in self.motors.items() for name in motor.feedback]

    @cached_property
    def control_form(self) -> Struct:
        """The values of a control block with data, behind its header."""
        return Struct(">x" + "".join(FORMS[name] for _, name in self.control_names))

    @cached_property
    def feedback_form(self) -> Struct:
        """The same of a feedback block, the temperature last."""
        return Struct(">x" + "".join(FORMS[name] for _, name in self.feedback_names) + ("", "B", "h")[self.temperature])

    @property
    def control_size(self) -> int:
        """Bytes of a control block with data, header included."""
        return self.control_form.size

    @property
    def feedback_size(self) -> int:
        """Bytes of a feedback block, `*` included."""
        return self.feedback_form.size

    def control(self, values: Mapping[int, Mapping[str, int]], *, feedback: bool = True) -> bytes:
        """A control block with data: motor index -> {"velocity": -127..127, "gain": 0..255}. Raises UsageError."""
        block = bytearray(DATA_FEEDBACK if feedback else DATA_ONLY)
        for index, motor in self.motors.items():
            for name in motor.control:
                block.append(as_sent(check_control(name, values[index][name])) & 0xFF)
        return bytes(block)

    def decode(self, block: bytes) -> Feedback:
        """The values of a whole feedback block."""
        motors: dict[int, dict[str, int]] = {index: {} for index in self.motors}
        numbers = self.feedback_form.unpack(block)
        for (index, name), number in zip(self.feedback_names, numbers, strict=False):
            motors[index][name] = number_of(index, name, number)
        return Feedback(motors, tenths_of(numbers[-1], self.temperature) if self.temperature else None)


def number_of(index: int, name: str, number: int) -> int:
    """What a number of a block means: positions are sent as words without a sign."""
    return with_sign(index, number) if name in POSITIONS else number


def tenths_of(number: int, size: int) -> int:
    """The temperature of a block in 0.1 °C; one byte has whole degrees."""
    return number if size == 2 else number * 10


class Feedback(NamedTuple):
    """One feedback block: raw numbers per motor index, and the temperature in 0.1 °C if it carries one."""

    motors: dict[int, dict[str, int]]
    temperature: int | None


class LoopError(NamedTuple):
    """`ERR n` in place of an acknowledgement, 0 for a bare prompt: the hand is back in supervisory mode."""

    status: int


def check_control(name: str, value: int) -> int:
    """The value, or UsageError when a control byte cannot carry it; never clamped."""
    low, high = LIMITS[name]
    if not low <= value <= high:
        raise UsageError(
            f"{name} {value} is out of range",
            hint=f"use {low} to {high}, one byte (barrett §6.2.1){'. LCVC multiplies it' if name == 'velocity' else ''}",
            code="out-of-range",
        )
    return value


def as_sent(value: int) -> int:
    """The value that a block carries for this one: 12 for 13, whose byte is a carriage return.

    A hand that has left its loop, by an error that is still on its way to us, takes a block for text: `43 0D` is the line C,
    and closes all motors. A block without that byte ends no line.
    """
    return value - (value == CARRIAGE_RETURN)


def still(values: Values) -> Values:
    """The same with velocity 0; gains stay."""
    return {
        index: {name: 0 if name == "velocity" else value for name, value in names.items()}
        for index, names in values.items()
    }


class Decoder:
    """Splits the hand's bytes into answers, in the order of the blocks that asked for them.

    `expect` is called for each block sent; `next` gives one answer: a Feedback, True for a bare acknowledgement, or a
    LoopError; None until it is complete.
    """

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._buffer = bytearray()
        self._expected: list[bool] = []

    def expect(self, feedback: bool) -> None:
        """A block was sent that asks for feedback, or for an acknowledgement only."""
        self._expected.append(feedback)

    @property
    def outstanding(self) -> int:
        """Blocks whose answer is not complete."""
        return len(self._expected)

    @property
    def acknowledged(self) -> bool:
        """Whether the first byte of the oldest outstanding answer is the acknowledgement."""
        return bool(self._buffer) and self._buffer[0] == ACKNOWLEDGE

    @property
    def complete(self) -> bool:
        """Whether the whole answer to the oldest outstanding block has come."""
        size = self._layout.feedback_size if self._expected and self._expected[0] else 1
        return len(self._buffer) >= size

    @property
    def received(self) -> bytes:
        """Bytes of answers that are not complete."""
        return bytes(self._buffer)

    def feed(self, data: bytes) -> None:
        self._buffer += data

    def next(self) -> Feedback | LoopError | bool | None:
        """One complete answer. Raises ProtocolError when the bytes can be none."""
        if not self._buffer:
            return None
        if self._buffer[0] in (0x0A, 0x0D):
            return self._error()
        if not self._expected:
            raise ProtocolError(f"RealTime: unexpected bytes: {self._shown()}", hint=DISTURBED, code="unasked")
        if self._buffer[0] != ACKNOWLEDGE:
            raise ProtocolError(
                f"RealTime: expected 2A (*) or an error, received {self._shown()}",
                hint="check the cable and run the command again: bytes were lost or changed, so the loop had to end",
                code="bad-block",
            )
        size = self._layout.feedback_size if self._expected[0] else 1
        if len(self._buffer) < size:
            return None
        block = bytes(self._buffer[:size])
        del self._buffer[:size]
        return self._layout.decode(block) if self._expected.pop(0) else True

    def _error(self) -> LoopError | None:
        text = bytes(self._buffer)
        end = text.find(PROMPT)
        if end < 0:
            if len(text) > ERROR_TEXT:
                raise ProtocolError(
                    f"RealTime: expected ERR and a prompt, received {self._shown()}", hint=DISTURBED, code="bad-block"
                )
            return None
        words = text[:end].split()
        del self._buffer[:]
        self._expected.clear()
        if not words:
            return LoopError(0)
        if len(words) == 2 and words[0] == b"ERR" and words[1].isdigit() and len(words[1]) <= 10:
            return LoopError(int(words[1]))
        came = text[:48].hex(" ").upper()
        raise ProtocolError(f"RealTime: expected ERR and a number, received {came}", hint=DISTURBED, code="bad-block")

    def _shown(self) -> str:
        return bytes(self._buffer[:48]).hex(" ").upper()


def cycles(control: int, feedback: int, baud: int) -> dict[str, float]:
    """Shortest cycle in seconds for blocks of these sizes at `baud`, 10 bits a byte (dossier 12).

    sequential   the whole control block, then the whole feedback
    overlapped   feedback begins at the header, the next block is sent when it is complete
    pipelined    the next block is sent as soon as the acknowledgement is seen (barrett §6.1 allows it)
    """
    byte = 10 / baud
    return {
        "sequential": (control + feedback) * byte,
        "overlapped": (1 + max(feedback, control - 1)) * byte,
        "pipelined": max(control, feedback, 2) * byte,
    }


def selections(
    texts: Sequence[str], known: Mapping[str, str], motors: Sequence[int], option: str
) -> dict[int, tuple[str, ...]]:
    """``["strain@12", "delta"]`` -> what each of `motors` carries, in wire order. Raises UsageError.

    A name without ``@MOTORS`` is for every motor; ``none`` for nothing at all.
    """
    chosen: dict[int, set[str]] = {index: set() for index in motors}
    for text in texts:
        name, at, which = text.partition("@")
        name = name.strip().lower()
        if name == "none" and not at:
            continue
        if name not in known:
            raise UsageError(
                f"{option}: {name!r} is not one of {', '.join(known)}",
                hint=f"write {option} {next(iter(known))}, or {next(iter(known))}@12 for some motors only",
            )
        digits = which.upper().replace("S", "4").replace("G", "123") if at else ""
        if at and (not digits or not set(digits) <= set("1234")):
            raise UsageError(f"{option} {text}: there is no motor {which!r}", hint=f"write it as {name}@12S")
        wanted = {int(digit) - 1 for digit in digits} if at else set(motors)
        if not wanted <= set(motors):
            raise UsageError(f"{option}: {text!r} names a motor that --motors leaves out", hint="add it to --motors")
        for index in wanted:
            chosen[index].add(name)
    return {index: tuple(name for name in known if name in names) for index, names in chosen.items()}


def velocity_unit(points: list[tuple[float, int, int]]) -> float | None:
    """Counts per second for one unit of LFV, fitted to position over time; None without enough motion.

    The manual gives LFV no unit (dossier 6.3): this is how to find it on a hand.
    """
    pairs = [
        (velocity, (later - earlier) / (end - begin))
        for (begin, earlier, _), (end, later, velocity) in pairwise(points)
        if end > begin and velocity
    ]
    weight = sum(velocity * velocity for velocity, _ in pairs)
    return sum(velocity * speed for velocity, speed in pairs) / weight if len(pairs) >= 10 and weight else None
