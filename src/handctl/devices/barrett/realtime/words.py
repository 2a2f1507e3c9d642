"""RealTime blocks in words (barrett §6): the flags that shape them, control blocks, feedback blocks, the way out."""

from __future__ import annotations

from collections import deque

from handctl.devices.barrett.gcl.commands import split
from handctl.devices.barrett.gcl.language import MOTORS, PROMPT, Answer, explain_status, values
from handctl.devices.barrett.gcl.words import motors, shown
from handctl.devices.barrett.realtime.blocks import ACKNOWLEDGE, CONTROL, FEEDBACK, Feedback, Layout, Selection
from handctl.errors import HandctlError
from handctl.model.piece import DEVICE, HOST, Part, Piece, Value, stray

LATER = ("LFBP", "LFAIN", "LCT")
"""Flags that only firmware 4.4 has; not set by the factory."""
SHAPING = (*CONTROL.values(), *(flag for flag in FEEDBACK.values() if flag not in LATER))
UNITS = {"position": "cts", "delta": "cts", "breakaway_position": "cts"}
LEAVE = 0x03
LONGEST_ERROR = 64


class Flags:
    """The flags as the conversation told them so far."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], int] = {}

    @property
    def complete(self) -> bool:
        """Whether any of them was seen at all; otherwise blocks are read as the factory has them."""
        return any(name in SHAPING for name, _ in self._known)

    def note(self, command: str, answer: Answer) -> None:
        """Learn from an answer to FGET, FSET, PGET or PSET."""
        prefix, kind, words = split(command)
        if kind is None or kind.name not in ("FGET", "FSET", "PGET", "PSET") or answer.status:
            return
        if not any(name in SHAPING or name in LATER or name == "LFT" for name in words):
            return
        who = motors(prefix) if kind.name[0] == "F" else [""]
        if kind.name.endswith("SET"):
            rows = [(name, [value] * len(who)) for name, value in zip(words[::2], words[1::2], strict=False)]
        else:
            try:
                table = values(answer, len(words), len(who))
            except HandctlError:
                return
            rows = [(name, [str(number) for number in numbers]) for name, numbers in zip(words, table, strict=True)]
        for name, texts in rows:
            for motor, text in zip(who, texts, strict=True):
                if (name in SHAPING or name in (*LATER, "LFT")) and text.isdecimal() and len(text) < 6:
                    self._known[(name, motor)] = int(text)

    def layout(self, prefix: str) -> Layout:
        """The blocks of a loop over these motors."""
        selected = {}
        for motor in motors(prefix):
            selected[MOTORS.index(motor)] = Selection(
                tuple(name for name, flag in CONTROL.items() if self._known.get((flag, motor), 1)),
                tuple(
                    name for name, flag in FEEDBACK.items() if self._known.get((flag, motor), int(flag not in LATER))
                ),
            )
        temperature = 0
        if self._known.get(("LFT", "")):
            temperature = 1 if any(name == "LCT" for name, _ in self._known) else 2
        return Layout(selected, temperature)


def factory_block(direction: str, data: bytes) -> list[Piece]:
    """A block of all four motors with the flags of the factory, as one piece; [] if it has another size."""
    layout = Flags().layout("")
    if direction == HOST and data[:1] in (b"C", b"c") and len(data) == layout.control_size:
        return [control_piece(layout, data, "")]
    if direction == DEVICE and data[:1] == b"*" and len(data) == layout.feedback_size:
        return [feedback_piece(layout, data, "")]
    if direction == HOST and len(data) == 1 and data in b"Aa":
        return [control_piece(layout, data, "")]
    if direction == DEVICE and data == b"*":
        return [Piece(direction=DEVICE, raw=data, meaning="* acknowledgement")]
    known = {HOST: (b"C", b"c"), DEVICE: (b"*",)}[direction]
    binary = any(byte < 32 or byte > 126 for byte in data[1:].rstrip(b"\r\n"))
    if data[:1] in known and binary and b"=>" not in data:
        kind = "control" if direction == HOST else "feedback"
        rest = f"{len(data) - 1} data bytes. Their meaning depends on the flags of the loop"
        numbers = " ".join(str(byte - 256 if byte > 127 else byte) for byte in data[1:])
        parts = (Part(data[:1], "header", kind), Part(data[1:], "data", f"as signed bytes: {numbers}"))
        return [Piece(direction=direction, raw=data, meaning=f"RealTime {kind} block with {rest}", parts=parts)]
    return []


def control_piece(layout: Layout, block: bytes, key: str) -> Piece:
    """A control block, complete."""
    header, place = chr(block[0]), 1
    parts = [Part(block[:1], "header", "reply with feedback" if header in "CA" else "reply with * only")]
    carried, texts = [], []
    for index, motor in layout.motors.items() if len(block) > 1 else ():
        own = []
        for name in motor.control:
            raw = block[place : place + 1]
            place += 1
            number = int.from_bytes(raw, "big", signed=name == "velocity")
            own.append(f"{name} {number}")
            carried.append(Value(f"{name}.{MOTORS[index]}", number))
            parts.append(Part(raw, f"{name}.{MOTORS[index]}", str(number)))
        texts.append(f"{MOTORS[index]} {' '.join(own)}" if own else "")
    data = ", ".join(filter(None, texts)) or "no control values"
    back = "feedback" if header in "CA" else "acknowledgement"
    return Piece(
        direction=HOST, raw=block, meaning=f"{header}: {data}, requests {back}", title=f"block {header}", asks=key,
        values=tuple(carried), parts=tuple(parts), fields={"header": header},
    )  # fmt: skip


def feedback_piece(layout: Layout, block: bytes, key: str) -> Piece:
    """A feedback block, complete."""
    feedback: Feedback = layout.decode(block)
    place, parts = 1, [Part(block[:1], "acknowledgement", "*")]
    carried, texts = [], []
    for index, found in feedback.motors.items():
        own = []
        for name, number in found.items():
            size = 2 if name in ("position", "breakaway_position") else 1
            unit = UNITS.get(name)
            text = f"{number} {unit}" if unit else str(number)
            own.append(f"{name} {text}")
            carried.append(Value(f"{name}.{MOTORS[index]}", number, unit))
            parts.append(Part(block[place : place + size], f"{name}.{MOTORS[index]}", text))
            place += size
        texts.append(f"{MOTORS[index]} {' '.join(own)}" if own else "")
    if feedback.temperature is not None:
        celsius = feedback.temperature / 10
        texts.append(f"temperature {celsius:.1f} °C")
        carried.append(Value("temperature", celsius, "°C"))
        parts.append(Part(block[place:], "temperature", f"{celsius:.1f} °C"))
    return Piece(
        direction=DEVICE, raw=block, meaning=f"* {', '.join(filter(None, texts)) or 'no feedback values'}",
        title="feedback", answers=key, values=tuple(carried), parts=tuple(parts),
    )  # fmt: skip


class LoopWords:
    """One stay in RealTime."""

    def __init__(self, layout: Layout, known: bool) -> None:
        self._layout = layout
        self._known = known
        self._out = bytearray()
        self._asked: deque[tuple[str, bool]] = deque(maxlen=64)
        self._count = 0
        self.leaving = False

    @property
    def summary(self) -> str:
        """``control 9 bytes, feedback 21 bytes``, and whether the flags were seen."""
        sizes = f"control {self._layout.control_size} bytes, feedback {self._layout.feedback_size} bytes"
        return sizes + ("" if self._known else " (factory flags, because none were read before)")

    def flush(self) -> list[Piece]:
        """What is left of an unfinished block."""
        raw = bytes(self._out)
        self._out.clear()
        return [stray(HOST, raw, "an unfinished control block", "cut-short")] if raw else []

    def host(self, data: bytes) -> tuple[list[Piece], bytes]:
        """Blocks from the host, and what follows a ^C."""
        self._out += data
        pieces = []
        while self._out and not self.leaving:
            header = self._out[0]
            if header == LEAVE:
                pieces.append(Piece(direction=HOST, raw=b"\x03", meaning="^C: leave RealTime", asks="leave"))
                del self._out[:1]
                self.leaving = True
            elif chr(header) in "CcAa":
                size = self._layout.control_size if chr(header) in "Cc" else 1
                if len(self._out) < size:
                    break
                block = bytes(self._out[:size])
                del self._out[:size]
                self._count += 1
                key = f"block {self._count}"
                self._asked.append((key, chr(header) in "CA"))
                pieces.append(control_piece(self._layout, block, key))
            else:
                raw = bytes(self._out)
                self._out.clear()
                why = f"{shown(raw)}: not the start of a block. The hand leaves RealTime with ERR 2048"
                pieces.append(stray(HOST, raw, why, "bad-block"))
        rest = bytes(self._out) if self.leaving else b""
        if self.leaving:
            self._out.clear()
        return pieces, rest

    def device(self, data: bytes) -> tuple[list[Piece], bytes, bool]:
        """Answers of the hand, what is not complete yet, and whether RealTime is over."""
        pieces: list[Piece] = []
        while data:
            if data[0] in (0x0A, 0x0D):
                end = data.find(PROMPT)
                if end < 0 and len(data) <= LONGEST_ERROR:
                    return pieces, data, False
                return [*pieces, self._end(data, end)], data[len(data) if end < 0 else _behind(data, end) :], end >= 0
            if data[0] != ACKNOWLEDGE or not self._asked:
                why = "unexpected bytes" if data[0] == ACKNOWLEDGE else "* or an error was expected here"
                end = data.find(b"\n") if self.leaving else -1
                raw = data[:end] if end > 0 else data
                pieces.append(stray(DEVICE, raw, why, "bad-block"))
                data = data[len(raw) :]
                continue
            key, full = self._asked[0]
            size = self._layout.feedback_size if full else 1
            if len(data) < size:
                return pieces, data, False
            self._asked.popleft()
            block, data = data[:size], data[size:]
            if size > 1:
                pieces.append(feedback_piece(self._layout, block, key))
            else:
                pieces.append(Piece(direction=DEVICE, raw=block, meaning="* acknowledgement", answers=key))
        return pieces, data, False

    def _end(self, data: bytes, end: int) -> Piece:
        """The prompt in the place of an acknowledgement: the hand is back in supervisory mode."""
        if end < 0:
            return stray(DEVICE, data, "ERR and a prompt were expected here", "bad-block")
        words = data[:end].split()
        status = int(words[1]) if len(words) == 2 and words[1].isdigit() and len(words[1]) < 11 else 0
        why = f"ERR {status}: {explain_status(status)}. " if status else ""
        key = "leave" if self.leaving else self._asked[0][0] if self._asked else ""
        return Piece(
            direction=DEVICE, raw=data[: _behind(data, end)], meaning=f"{why}RealTime has ended, prompt", answers=key,
            problem="refused" if status else "", fields={"status": status},
        )  # fmt: skip


def _behind(data: bytes, end: int) -> int:
    """Behind the prompt, with its blank if that has come."""
    return end + 3 if data[end + 2 : end + 3] == b" " else end + 2
