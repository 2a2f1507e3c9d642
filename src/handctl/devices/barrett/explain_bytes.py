"""Explain recorded bytes of the BarrettHand: GCL lines, RealTime blocks and the boot monitor's records.

Bytes in, pieces out; knows no link. Three languages share the line, and which one is spoken follows from the conversation:

    GCL           barrett §5         a command line, its echo, data, status and prompt
    RealTime      barrett §6         once LOOP was acknowledged: control blocks, feedback blocks, the way out
    boot monitor  dossier 7.2        once "X" was answered by ":": FF, then per record
                                     FF | address low, address high, count | FF | data, each but the FF echoed

The layout of RealTime blocks follows from the flags that were read or set before; until one was seen it counts as the factory
has it.

`BarrettWriteRules` tells the ledger which of these bytes write. A line is acknowledged by its echo and the prompt behind it,
refused by ERR n (barrett §5.1.3). What is no query writes. In RealTime every block with values is a command, and the loop itself
tells which blocks the hand answered. ^C counts where something moves or where it was planned: a connection begins with one.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from operator import getitem
from struct import calcsize

from handctl.devices.barrett.gcl.codec import (
    ABORT,
    CR,
    KINDS,
    MOTORS,
    PROMPT,
    Answer,
    Command,
    Decoder,
    has_prompt,
    kind_of,
    motor_prefix,
    motors_of,
    split,
    values,
)
from handctl.devices.barrett.gcl.connect_table import FILL, LOOPED, QUESTION, SAFE_ABORT
from handctl.devices.barrett.gcl.status_codes import (
    ABORTED,
    NOT_INITIALIZED,
    NOT_REACHED,
    OF_ONE_MOTOR,
    UNKNOWN_COMMAND,
    explain_status,
)
from handctl.devices.barrett.parameter_map import BARRETT, GclParam
from handctl.devices.barrett.realtime.blocks import (
    ACKNOWLEDGE,
    CONTROL,
    FEEDBACK,
    FEEDBACK_ONLY,
    NEITHER,
    UNITS,
    Layout,
    Selection,
    number_of,
    tenths_of,
)
from handctl.errors import HandctlError
from handctl.model.explainer import (
    DEVICE,
    HOST,
    CodedValues,
    ExplainedBytes,
    Explainer,
    Known,
    LazySequence,
    Maker,
    Makers,
    Part,
    Value,
    Values,
    stray,
)
from handctl.model.param import Number
from handctl.model.write_ledger import Frame, WriteRules
from handctl.wording import plural

MOST_KNOWN = 1024
"""Answers that are remembered."""
MARK = QUESTION[:1].decode()
"""The question of a connect without what no motor moves by; ERR 32 is how a hand says that it is there."""
SIMULATED_MOTORS = {"SPREAD": "S"}
"""How the simulator's control commands call a motor, where that is another name."""
NAMES = {"\r": "<CR>", "\n": "<LF>", "\x03": "<^C>"}


def _piece(direction: str, raw: bytes, meaning: str, **more: object) -> ExplainedBytes:
    return ExplainedBytes(direction=direction, raw=raw, meaning=meaning, **more)  # type: ignore[arg-type]


def shown(data: bytes | bytearray) -> str:
    """Bytes as text, with control characters by name: ``FGET P<CR>``."""
    return "".join(NAMES.get(chr(b), chr(b) if 32 <= b < 127 else f"<{b:02X}>") for b in data)


def lines_of(data: bytes) -> list[str]:
    """The lines that hold anything, in printable characters."""
    found = data.replace(b"\r", b"\n").split(b"\n")
    return [shown(line) for line in found if line.strip()]


def line_parts(raw: bytes) -> tuple[Part, ...]:
    """An answer line by line: echo, data, status, prompt."""
    parts: list[Part] = []
    for line in re.findall(rb"[^\r\n]*[\r\n]+|[^\r\n]+", raw):
        text = shown(line.strip(b"\r\n"))
        words = text.split()
        if line.startswith(b"=>"):
            name, text = "prompt", ""
        elif len(words) == 2 and words[0] == "ERR" and words[1].isdecimal() and len(words[1]) < 11 and parts:
            name, text = "status", f"{words[1]}: {explain_status(int(words[1]))}"
        else:
            name = "line" if parts else "echo" if text else "line end"
        parts.append(Part(line, name, text))
    return tuple(parts)


@lru_cache(64)
def motors(prefix: str) -> Sequence[str]:
    """``12S`` -> F1, F2, SPREAD; no prefix = all four."""
    return motors_of(motor_prefix(prefix) if prefix else "")


def command_words(text: str) -> tuple[str, str]:
    """(meaning, problem) of a command line."""
    if not text:
        return "an empty line: requests the prompt", ""
    if text == MARK:
        return f"{MARK}: requests the prompt, and is not a command", ""
    prefix, found, words = split(text)
    if found is None:
        return f"{text}: not a GCL command", "unknown-command"
    who = f" of {' '.join(motors(prefix))}" if found.prefix else ""
    head = f"{text}: "
    if found.name in ("FGET", "PGET"):
        names = ", ".join(_name(word) for word in words)
        return f"{head}read {names or 'nothing'}{who}", ""
    if found.name in ("FSET", "PSET"):
        pairs = zip(words[::2], [*words[1::2], "?"], strict=False)
        return f"{head}set {', '.join(f'{_name(name)} = {_with_unit(name, value)}' for name, value in pairs)}{who}", ""
    return f"{head}{found.doc}{who and f', for {chr(32).join(motors(prefix))}'}", ""


@lru_cache(256)
def _param(word: str) -> GclParam | None:
    try:
        return BARRETT.by_mnemonic(word.upper())
    except KeyError:
        return None


def _name(word: str) -> str:
    param = _param(word)
    return param.name if param is not None else f"{word} (unknown)"


def _with_unit(word: str, value: str) -> str:
    param = _param(word)
    if param is None or not value.lstrip("-").isdecimal() or len(value) > 11:
        return value
    return _texts(param, (int(value),))


def answer_words(text: str, found: Answer) -> tuple[str, Values, str]:
    """(meaning, values, problem) of the data lines of an answer."""
    prefix, kind, words = split(text)
    if kind is not None and kind.name in ("FGET", "PGET") and words:
        try:
            return _gotten(prefix, kind, words, found)
        except HandctlError as exc:
            return f"{exc.text}", (), "bad-line"
    said = " | ".join(found.lines)
    if said:
        return f"{text}: {said}", (), ""
    return (f"{text}: done" if text else "prompt"), (), ""


def _gotten(prefix: str, kind: Command, words: tuple[str, ...], found: Answer) -> tuple[str, Values, str]:
    who = motors(prefix) if kind.name == "FGET" else [""]
    table = list(zip(words, values(found, len(words), len(who)), strict=False))
    texts = []
    for word, numbers in table:
        param = _param(word)
        shown_numbers = _texts(param, tuple(numbers)) if param is not None else " ".join(map(str, numbers))
        texts.append(f"{param.name if param is not None else _name(word)} {shown_numbers}")
    motor_text = f" ({' '.join(who)})" if kind.name == "FGET" else ""
    makers = _makers(tuple(word for word, _ in table), tuple(who))
    carried = CodedValues(makers, [number for _, numbers in table for number in numbers])
    return f"{', '.join(texts)}{motor_text}" if texts else "", carried, ""


@lru_cache(256)
def _makers(words: tuple[str, ...], who: tuple[str, ...]) -> Makers:
    """What makes the numbers of an answer values."""
    return Makers(partial(_value, word, motor) for word in words for motor in who)


def _value(word: str, motor: str, number: int) -> Value:
    param, name = _param(word), _name(word)
    return Value(f"{name}.{motor}" if motor else name, number, param.unit if param else None)


def _written(command: str) -> Iterator[Value]:
    """What FSET and PSET set."""
    prefix, found, words = split(command)
    if found is None or found.name not in ("FSET", "PSET"):
        return
    who = motors(prefix) if found.name == "FSET" else [""]
    for word, value in zip(words[::2], words[1::2], strict=False):
        if value.isdecimal() and len(value) < 11:
            yield from (_value(word, motor, int(value)) for motor in who)


@lru_cache(4096)
def _texts(param: GclParam, numbers: tuple[int, ...]) -> str:
    """Numbers with their unit and, where it says more than they do, what they mean."""
    unit = param.unit or ""
    labels = list(dict.fromkeys(filter(None, (_label(param, number) for number in numbers))))
    text = " ".join(map(str, numbers))
    if unit.startswith("0.1 "):
        text = " ".join(f"{number / 10:.1f}" for number in numbers) + f" {unit[4:]}"
    elif unit and not param.choices:
        text += f" [{unit}]" if unit[0].isdigit() else f" {unit}"
    return f"{text} ({', '.join(labels)})" if labels else text


def _label(param: GclParam, number: Number) -> str | None:
    """What a number means in words; a flag's yes and no say nothing."""
    if param.mnemonic == "S":
        return explain_status(int(number)) if number > 0 else None
    label = param.label(number)
    return None if label in ("yes", "no") else label


# -- RealTime ----------------------------------------------------------------------------------------------------------


LATER = ("LFBP", "LFAIN", "LCT")
"""Flags that only firmware 4.4 has; not set by the factory."""
SHAPING = (*CONTROL.values(), *(flag for flag in FEEDBACK.values() if flag not in LATER))
TOLD = (*SHAPING, *LATER, "LFT")
LEAVE = 0x03
HEADERS = (b"C", b"c", b"A", b"a")
LONGEST_ERROR = 64


class Flags:
    """The flags as far as the recording shows them."""

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
        if not any(name in TOLD for name in words):
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
                if name in TOLD and text.isdecimal() and len(text) < 6:
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


def factory_block(direction: str, data: bytes) -> list[ExplainedBytes]:
    """A block of all four motors with the flags of the factory, as one piece; [] if it has another size."""
    layout, header = Flags().layout(""), data[:1]
    if direction == HOST and header in HEADERS and len(data) == (layout.control_size if header in b"Cc" else 1):
        return [control_piece(BlockWords(layout, control=True), data)]
    if direction == DEVICE and header == b"*" and len(data) in (1, layout.feedback_size):
        return [feedback_piece(BlockWords(layout, control=False), data)]
    binary = any(byte < 32 or byte > 126 for byte in data[1:].rstrip(b"\r\n"))
    if header in (HEADERS[:2] if direction == HOST else (b"*",)) and binary and b"=>" not in data:
        kind = "control" if direction == HOST else "feedback"
        rest = f"{len(data) - 1} data bytes. Their meaning depends on the flags of the loop"
        numbers = " ".join(str(byte - 256 if byte > 127 else byte) for byte in data[1:])
        parts = (Part(header, "header", kind), Part(data[1:], "data", f"as signed bytes: {numbers}"))
        return [_piece(direction, data, f"RealTime {kind} block with {rest}", parts=parts)]
    return []


class BlockWords:
    """What the blocks of one direction say."""

    def __init__(self, layout: Layout, *, control: bool) -> None:
        names = layout.control_names if control else layout.feedback_names
        self._form = layout.control_form if control else layout.feedback_form
        self._makers, self._texts = _numbers(tuple(names), 0 if control else layout.temperature)
        self._sizes = [calcsize(code) for code in self._form.format[2:]]

    def told(self, block: bytes) -> tuple[str, Values, Iterable[Part]]:
        """A block in words, its values, its parts."""
        numbers = self._form.unpack(block)
        values = CodedValues(self._makers, numbers)
        return "".join(map(getitem, self._texts, numbers)).removeprefix(", "), values, self._parts(block, values)

    def _parts(self, block: bytes, values: Values) -> Iterator[Part]:
        place = 1
        for value, size in zip(values, self._sizes, strict=True):
            yield Part(block[place : place + size], value.name, _shown(value))
            place += size


@lru_cache(64)
def _numbers(names: tuple[tuple[int, str], ...], temperature: int) -> tuple[Makers, list[Known[int]]]:
    """What makes the numbers of a block values, and words: each once, as a loop has thousands of blocks."""
    makers: list[Maker] = [partial(_number, index, name) for index, name in names]
    before = [-1, *(index for index, _ in names)]
    begins = [f", {MOTORS[index]} " if index != last else " " for (index, _), last in zip(names, before, strict=False)]
    if temperature:
        makers.append(lambda number: Value("temperature", tenths_of(number, temperature) / 10, "°C"))
        begins.append(", ")
    return Makers(makers), [Known(partial(_field, *each)) for each in zip(begins, makers, strict=True)]


def _number(index: int, name: str, number: int) -> Value:
    return Value(f"{name}.{MOTORS[index]}", number_of(index, name, number), UNITS.get(name))


def _shown(value: Value) -> str:
    return f"{value.value} {value.unit}" if value.unit else str(value.value)


def _field(begin: str, make: Maker, number: int) -> str:
    """A number with its name, behind that of its motor where it is the first."""
    value = make(number)
    assert value is not None
    return f"{begin}{value.name.partition('.')[0]} {_shown(value)}"


def control_piece(words: BlockWords, block: bytes) -> ExplainedBytes:
    """A control block, complete."""
    header = chr(block[0])
    full = header in "CA"
    told, values, parts = words.told(block) if len(block) > 1 else ("", (), ())
    asked = Part(block[:1], "header", "reply with feedback" if full else "reply with * only")
    back = "feedback" if full else "acknowledgement"
    return _piece(
        HOST, block, f"{header}: {told or 'no control values'}, requests {back}",
        title=f"block {header}", values=values, parts=LazySequence(lambda: (asked, *parts)), fields={"header": header},
        kept={},
    )  # fmt: skip


def feedback_piece(words: BlockWords, block: bytes) -> ExplainedBytes:
    """A feedback block, complete; or a bare acknowledgement."""
    if len(block) == 1:
        return _piece(DEVICE, block, "* acknowledgement")
    told, values, parts = words.told(block)
    return _piece(
        DEVICE, block, f"* {told or 'no feedback values'}", title="feedback", values=values,
        parts=LazySequence(lambda: (Part(block[:1], "acknowledgement", "*"), *parts)), kept={},
    )  # fmt: skip


class LoopWords:
    """One stay in RealTime."""

    def __init__(self, layout: Layout, known: bool) -> None:
        self._control_size, self._feedback_size = layout.control_size, layout.feedback_size
        self._control = lru_cache(MOST_KNOWN)(partial(control_piece, BlockWords(layout, control=True)))
        self._feedback = lru_cache(MOST_KNOWN)(partial(feedback_piece, BlockWords(layout, control=False)))
        self._known = known
        self._out = b""
        self._asked: deque[tuple[str, bool]] = deque(maxlen=64)
        self._count = 0
        self.leaving = False

    @property
    def summary(self) -> str:
        """``control 9 bytes, feedback 21 bytes``, and whether the flags were seen."""
        sizes = f"control {self._control_size} bytes, feedback {self._feedback_size} bytes"
        return sizes + ("" if self._known else " (factory flags, because none were read before)")

    def flush(self) -> list[ExplainedBytes]:
        """What is left of an unfinished block."""
        raw, self._out = self._out, b""
        return [stray(HOST, raw, "an unfinished control block", "cut-short")] if raw else []

    def host(self, data: bytes) -> tuple[list[ExplainedBytes], bytes]:
        """Blocks from the host, and what follows a ^C."""
        data, pieces = self._out + data, []
        while data and not self.leaving:
            header = data[0]
            if header == LEAVE:
                pieces.append(_piece(HOST, b"\x03", "^C: leave RealTime", asks="leave"))
                data, self.leaving = data[1:], True
            elif header in b"CcAa":
                size = self._control_size if header in b"Cc" else 1
                if len(data) < size:
                    break
                block, data = data[:size], data[size:]
                self._count += 1
                key = f"block {self._count}"
                self._asked.append((key, header in b"CA"))
                pieces.append(self._control(block).keyed(asks=key))
            else:
                why = f"{shown(data)}: not the start of a block. The hand leaves RealTime with ERR 2048"
                pieces.append(stray(HOST, data, why, "bad-block"))
                data = b""
        self._out, rest = (b"", data) if self.leaving else (data, b"")
        return pieces, rest

    def device(self, data: bytes) -> tuple[list[ExplainedBytes], bytes, bool]:
        """Answers of the hand, what is not complete yet, and whether RealTime is over."""
        pieces: list[ExplainedBytes] = []
        while data:
            if data[0] == ACKNOWLEDGE and self._asked:
                key, full = self._asked[0]
                size = self._feedback_size if full else 1
                if len(data) < size:
                    break
                self._asked.popleft()
                pieces.append(self._feedback(data[:size]).keyed(answers=key))
                data = data[size:]
            elif data[0] in (0x0A, 0x0D):
                end = data.find(PROMPT)
                if end < 0 and len(data) <= LONGEST_ERROR:
                    break
                return [*pieces, self._end(data, end)], data[len(data) if end < 0 else _behind(data, end) :], end >= 0
            else:
                why = "unexpected bytes" if data[0] == ACKNOWLEDGE else "* or an error was expected here"
                end = data.find(b"\n") if self.leaving else -1
                raw = data[:end] if end > 0 else data
                pieces.append(stray(DEVICE, raw, why, "bad-block"))
                data = data[len(raw) :]
        return pieces, data, False

    def _end(self, data: bytes, end: int) -> ExplainedBytes:
        """The prompt in the place of an acknowledgement: the hand is back in supervisory mode."""
        if end < 0:
            return stray(DEVICE, data, "ERR and a prompt were expected here", "bad-block")
        words = data[:end].split()
        status = int(words[1]) if len(words) == 2 and words[1].isdigit() and len(words[1]) < 11 else 0
        why = f"ERR {status}: {explain_status(status)}. " if status else ""
        key = "leave" if self.leaving else self._asked[0][0] if self._asked else ""
        raw, problem = data[: _behind(data, end)], "refused" if status else ""
        meaning = f"{why}RealTime has ended, prompt"
        return _piece(DEVICE, raw, meaning, answers=key, problem=problem, fields={"status": status})


def _behind(data: bytes, end: int) -> int:
    """The position after the prompt, with its blank if that has arrived."""
    return end + 3 if data[end + 2 : end + 3] == b" " else end + 2


# -- the boot monitor --------------------------------------------------------------------------------------------------


TRIGGER = 0xFF
HEAD = 5
"""Bytes of a record before its data: trigger, address, count, trigger."""


def record_parts(raw: bytes) -> tuple[Part, ...]:
    """A whole record field by field."""
    address, count = int.from_bytes(raw[1:3], "little"), raw[3]
    return (
        Part(raw[:1], "trigger", "not echoed"), Part(raw[1:2], "address low", f"{raw[1]:02X}"),
        Part(raw[2:3], "address high", f"address {address:04X}h"), Part(raw[3:4], "count", f"{count} data bytes"),
        Part(raw[4:5], "trigger", "not echoed"), Part(raw[5:], "data", f"{address:04X}h to {address + count - 1:04X}h"),
    )  # fmt: skip


def record_piece(raw: bytes, key: str = "") -> ExplainedBytes:
    """A whole record."""
    address, count = int.from_bytes(raw[1:3], "little"), raw[3]
    return _piece(
        HOST, raw, f"download record: {count} bytes at {address:04X}h", asks=key,
        fields={"address": address, "count": count}, parts=record_parts(raw),
    )  # fmt: skip


def records(data: bytes) -> list[ExplainedBytes]:
    """The pieces of download bytes as the host sends them, from a trigger on; [] if they are none."""
    pieces: list[ExplainedBytes] = []
    if data[:2] == b"\xff\xff" and _whole(data[1:]):
        pieces.append(_piece(HOST, data[:1], "the first trigger of a download"))
        data = data[1:]
    while data:
        size = _whole(data)
        if not size:
            return []
        pieces.append(record_piece(data[:size]))
        data = data[size:]
    return pieces


def _whole(data: bytes) -> int:
    """Bytes of the record that begins here, 0 = none."""
    if len(data) < HEAD + 1 or data[0] != TRIGGER or data[4] != TRIGGER or not data[3]:
        return 0
    return HEAD + data[3] if len(data) >= HEAD + data[3] else 0


class MonitorWords:
    """One download. A record is explained once it is complete, its echo once every byte has come back.

    Whether the monitor echoes the triggers too is found out with the first echo.
    """

    def __init__(self) -> None:
        self._out = bytearray()
        self._back = bytearray()
        self._awaited: deque[tuple[int, str]] = deque()
        """(byte, "" | "trigger" | "first") of everything that was sent and may come back."""
        self._ends: deque[tuple[str, int, int]] = deque()
        """(key, address, bytes) of the records on their way."""
        self._begun = False
        self._echoes: bool | None = None
        self._count = 0

    def flush(self) -> list[ExplainedBytes]:
        """What is not complete."""
        pieces = self._told()
        if self._out:
            pieces.append(
                stray(HOST, bytes(self._out), f"an unfinished record: {plural(len(self._out), 'byte')}", "cut-short")
            )
        self._out.clear()
        self._awaited.clear()
        return pieces

    def host(self, data: bytes) -> tuple[list[ExplainedBytes], bytes]:
        """Records, and what follows the download: anything but a trigger where a record begins."""
        pieces: list[ExplainedBytes] = []
        for place, byte in enumerate(data):
            if not self._out and byte != TRIGGER:
                return pieces, data[place:]
            if not self._begun:
                self._begun = True
                self._awaited.append((byte, "first"))
                pieces.append(_piece(HOST, b"\xff", "the first trigger of a download"))
                continue
            self._out.append(byte)
            size = len(self._out)
            self._awaited.append((byte, "trigger" if size in (1, HEAD) else ""))
            if size == HEAD and not self._out[3]:
                pieces.append(stray(HOST, bytes(self._out), "a record without data"))
                self._out.clear()
            elif size > HEAD and size == HEAD + self._out[3]:
                self._count += 1
                key = f"record {self._count}"
                self._ends.append((key, int.from_bytes(self._out[1:3], "little"), size))
                pieces.append(record_piece(bytes(self._out), key))
                self._out.clear()
        return pieces, b""

    def device(self, data: bytes) -> list[ExplainedBytes]:
        """Echoes. One that differs is explained together with the byte sent."""
        pieces: list[ExplainedBytes] = []
        for byte in data:
            self._decide(byte)
            while self._awaited and self._awaited[0][1] and not self._echoes:
                self._awaited.popleft()
            if not self._awaited:
                pieces += self._odd(byte, f"{byte:02X} arrived although nothing was expected")
                continue
            sent, kind = self._awaited.popleft()
            if byte != sent:
                pieces += self._odd(byte, f"wrong echo: sent {sent:02X}, received {byte:02X}")
            elif kind == "first":
                pieces.append(_piece(DEVICE, bytes([byte]), "echo of the first trigger"))
            else:
                self._back.append(byte)
                pieces += self._whole_echo()
        return pieces + self._whole_echo()

    def _decide(self, byte: int) -> None:
        """With the first echo: a trigger that comes back, unless the first address byte looks the same."""
        if self._echoes is None and self._awaited:
            first = next((sent for sent, kind in self._awaited if not kind), None)
            self._echoes = byte == TRIGGER and bool(self._awaited[0][1]) and first != TRIGGER

    def _whole_echo(self) -> list[ExplainedBytes]:
        """The echo of the oldest record, once it is complete."""
        if not self._ends:
            return []
        key, address, size = self._ends[0]
        size -= 0 if self._echoes else 2
        if len(self._back) < size:
            return []
        self._ends.popleft()
        raw = bytes(self._back[:size])
        del self._back[:size]
        text = f"echo of the record at {address:04X}h: {size} bytes, all correct"
        return [_piece(DEVICE, raw, text, answers=key)]

    def _odd(self, byte: int, text: str) -> list[ExplainedBytes]:
        """A byte that is not an echo; the record's echo can no longer be complete."""
        return [*self._told(), _piece(DEVICE, bytes([byte]), text, problem="wrong-echo")]

    def _told(self) -> list[ExplainedBytes]:
        """The echoes so far, before something else is explained."""
        raw = bytes(self._back)
        self._back.clear()
        if raw and self._ends:
            self._ends.popleft()
        return [_piece(DEVICE, raw, f"echoes: {len(raw)} bytes")] if raw else []


# -- the frames of the three protocols in words -----------------------------------------------------------------------


_ENDS = re.compile(rb"[\r\x03]")
OFFERS = (b"X", b"XX")
OFFER = "X: requests a download from the boot monitor"
LONGEST_COMMAND = 256
LONGEST_ANSWER = 16384
WAITING = 8
"""Commands whose answer is waited for: a hand answers one at a time."""


class Asked:
    """A command on its way: what was sent, the key that its answer bears, and the decoder, which has read all that came."""

    def __init__(self, command: str, key: str) -> None:
        self.command = command
        self.key = key
        self.decoder = Decoder(command)


class BarrettExplainer(Explainer):
    """One conversation."""

    def __init__(self) -> None:
        self._typed = bytearray()
        self._came = bytearray()
        self._asked: deque[Asked] = deque(maxlen=WAITING)
        self._flags = Flags()
        self._loop: LoopWords | None = None
        self._monitor: MonitorWords | None = None
        self._count = 0
        self._offered = False  # X was sent, and something else happened since: the power switch, say

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. There is no CAN."""
        return self._from_host(data) if direction == HOST else self._from_hand(data)

    def flush(self) -> list[ExplainedBytes]:
        """See Explainer. What was spoken before is over."""
        pieces = []
        for inner in (self._loop, self._monitor):
            if inner is not None:
                pieces += inner.flush()
        self._loop = self._monitor = None
        for direction, buffer in ((HOST, self._typed), (DEVICE, self._came)):
            raw = bytes(buffer)
            buffer.clear()
            if direction == HOST and raw in OFFERS:
                self._offered = True
                pieces.append(_piece(HOST, raw, OFFER))
                continue
            if direction == DEVICE and self._asked and _changes_speed(self._asked[0].command, raw):
                meaning = f"echo of {self._asked[0].command}: the rest of the reply comes at the new baud rate"
                pieces.append(_piece(DEVICE, raw, meaning, answers=self._asked[0].key))
                continue
            if direction == DEVICE and raw == b":":
                pieces.append(_piece(DEVICE, raw, "the boot monitor has started: the hand was switched on"))
                continue
            block = factory_block(direction, raw) if raw and b"=>" not in raw else []
            pieces += block  # a recording that begins inside RealTime
            if raw and not block:
                what = "a command without its CR" if direction == HOST else "a reply without its prompt"
                pieces.append(stray(direction, raw, f"{what}: {shown(raw)}", "cut-short"))
        self._asked.clear()
        return pieces

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. Blocks are read with factory flags, all four motors."""
        direction = side or _side(data)
        whole = records(data) or factory_block(direction, data)
        if whole:
            return whole
        if direction == DEVICE:
            first = data.replace(b"\r", b"\n").partition(b"\n")[0].decode("ascii", "replace")
            if first.isascii() and split(first)[1] is not None:
                self._asked.append(Asked(first, ""))
        return [*self.feed(direction, data), *self.flush()]

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer. Printable ASCII with line ends; a ^C."""
        return can_id is None and all(32 <= byte < 127 or byte in (3, 10, 13) for byte in data) and data[:1] != b"{"

    # -- from the host ------------------------------------------------------------------------------------------------

    def _from_host(self, data: bytes) -> list[ExplainedBytes]:
        pieces: list[ExplainedBytes] = []
        while data:
            if self._monitor is not None:
                found, data = self._monitor.host(data)
                pieces += found
                if data:
                    pieces += self._monitor.flush()
                    self._monitor = None
            elif self._loop is not None and not self._loop.leaving:
                found, data = self._loop.host(data)
                pieces += found
            else:
                room = LONGEST_COMMAND - 1 - len(self._typed)
                end = _ENDS.search(data, 0, room)
                plain = end.start() if end is not None else min(room, len(data))
                if plain:
                    self._typed += data[:plain]
                    self._offered = False
                if data[plain:]:
                    pieces += self._typed_byte(data[plain])
                data = data[plain + 1 :]
        return pieces

    def _typed_byte(self, byte: int) -> list[ExplainedBytes]:
        pieces: list[ExplainedBytes] = []
        if byte == CR[0]:
            command = self._typed.decode("ascii", "replace")
            raw = bytes(self._typed) + b"\r"
            self._typed.clear()
            return [self._command(command, raw)]
        if byte == ABORT[0]:
            if self._typed:
                pieces.append(stray(HOST, bytes(self._typed), f"an unfinished command: {shown(self._typed)}"))
                self._typed.clear()
            key = "" if self._asked else self._expect("")
            return [*pieces, _piece(HOST, b"\x03", "^C: abort", asks=key)]
        self._typed.append(byte)
        self._offered = False
        if len(self._typed) >= LONGEST_COMMAND:
            pieces.append(stray(HOST, bytes(self._typed)))
            self._typed.clear()
        return pieces

    def _expect(self, command: str) -> str:
        self._count += 1
        key = f"gcl {self._count}"
        self._asked.append(Asked(command, key))
        return key

    def _command(self, command: str, raw: bytes) -> ExplainedBytes:
        if command.strip("\0") == MARK:
            meaning, _ = command_words(MARK)
            return _piece(HOST, raw, meaning, asks=self._expect(command.lstrip("\0")))
        if not (command.isascii() and command.isprintable()):
            return stray(HOST, raw, f"not a command: {shown(raw)}")
        if not command and self._asked and self._came:
            return _piece(HOST, raw, "an empty line")  # to an answer that has already begun, e.g. behind a new speed
        return _command(command, raw).keyed(asks=self._expect(command))

    def simulated(self, values: Mapping[str, float | str], moments: Mapping[str, float]) -> Iterator[str]:
        """See Explainer: places, strain and temperature of the body; every other parameter goes to RAM."""
        if (found := [int(values[name]) for motor in MOTORS if (name := f"status.{motor}") in values]) and not any(
            code & NOT_INITIALIZED for code in found
        ):
            yield "initialized=1"
        shown = {param for name in values if (param := BARRETT.get(name.partition(".")[0])) is not None}
        if firmware := max((param.since for param in shown), default=""):  # 4.33 and before have no such parameter
            yield f"firmware={firmware}"
        for name, value in values.items():
            base, _, motor = name.partition(".")
            if (param := BARRETT.get(base)) is None:
                continue
            who = SIMULATED_MOTORS.get(motor, motor)
            match param.mnemonic:
                case "P" | "SG" as word:
                    yield f"{'position' if word == 'P' else 'strain'} {who} {value}"
                case "TEMP":
                    yield f"temperature {value}"
                case "UPSECS":
                    yield f"ram UPSECS - {max(0, int(value) - int(moments[name]))}"
                case word:
                    yield f"ram {word} {who or '-'} {value}"

    # -- from the hand ------------------------------------------------------------------------------------------------

    def _from_hand(self, data: bytes) -> list[ExplainedBytes]:
        pieces: list[ExplainedBytes] = []
        if self._monitor is not None:
            data = bytes(self._came) + data
            self._came.clear()
            return self._monitor.device(data)
        if not self._came and len(self._asked) == 1 and self._loop is None and data[:1] != b":":
            asked = self._asked[0]
            if (answer := _at_once(asked.command, data)) is not None:
                self._asked.clear()
                return [self._answer(asked, answer)]
        self._came += data
        while self._came:
            if self._loop is not None:
                found, rest, over = self._loop.device(bytes(self._came))
                pieces += found
                self._came[:] = rest
                if over:
                    pieces += self._loop.flush()
                    self._loop = None
                    continue
                break
            found = self._next()
            if not found:
                break
            pieces += found
            if self._monitor is not None:
                return [*pieces, *self._from_hand(b"")]
        if len(self._came) > LONGEST_ANSWER:
            pieces.append(stray(DEVICE, bytes(self._came)))
            self._take(pieces[-1])
        return pieces

    def _next(self) -> list[ExplainedBytes]:
        """The next whole answer in supervisory mode."""
        came = bytes(self._came)
        if came[:1] == b":" and (self._offered or bytes(self._typed) in OFFERS):
            return self._handed_over()
        for place, asked in enumerate(self._asked):
            kind = split(asked.command)[1]
            if kind is not None and kind.kind == "loop":
                entered = self._entered(came, asked, place)
                if entered:
                    return entered
            decoder = asked.decoder
            decoder.feed(came[decoder.size :])
            answer = decoder.next()
            if answer is None:
                continue
            if decoder.skipped:
                return [self._take(_before(came[: decoder.skipped]))]
            for _ in range(place + 1):
                self._asked.popleft()
            return [self._take(self._answer(asked, answer))]
        unasked = None if self._asked else self._unasked(came)
        return [] if unasked is None else [unasked]

    def _take(self, piece: ExplainedBytes) -> ExplainedBytes:
        for asked in self._asked:
            asked.decoder = Decoder(asked.command)
        del self._came[: len(piece.raw)]
        return piece

    def _unasked(self, came: bytes) -> ExplainedBytes | None:
        """A prompt alone: at power-on, after a reset, or the blank of a prompt that was cut off."""
        if came == BLANK:
            return self._take(_before(came))
        end = came.find(b"=>")
        if end < 0 or (end and came[end - 1] not in (10, 13)):
            return None
        raw, lines = came[: _behind(came, end)], lines_of(came[:end])
        text = f"prompt, after {' | '.join(lines)}" if lines else "prompt"
        return self._take(_piece(DEVICE, raw, text, parts=line_parts(raw)))

    def _answer(self, asked: Asked, answer: Answer) -> ExplainedBytes:
        self._flags.note(asked.command, answer)
        return _answer(asked.command, answer).keyed(answers=asked.key)

    def _entered(self, came: bytes, asked: Asked, place: int) -> list[ExplainedBytes]:
        """The echo of LOOP with the acknowledgement right after it (barrett §6.1)."""
        sent = asked.command.upper().encode("ascii", "replace")
        start = came.upper().find(sent)
        if start < 0 or came[start + len(sent) : start + len(sent) + 1] != b"*":
            return []
        if start:
            return [self._take(_before(came[:start]))]
        for _ in range(place + 1):
            self._asked.popleft()
        self._loop = LoopWords(self._flags.layout(split(asked.command)[0]), self._flags.complete)
        meaning = f"in RealTime: {self._loop.summary}"
        parts = (Part(came[: len(sent)], "echo", asked.command), Part(b"*", "acknowledgement", "in RealTime"))
        entered = self._take(_piece(DEVICE, came[: len(sent) + 1], meaning, answers=asked.key, parts=parts))
        ahead = bytes(self._typed)
        self._typed.clear()
        return [entered, *self._from_host(ahead)]

    def _handed_over(self) -> list[ExplainedBytes]:
        """The boot monitor answers "X" with ":" once the hand is switched on (dossier 7.2)."""
        typed = bytes(self._typed)
        self._typed.clear()
        self._asked.clear()
        self._offered = False
        self._monitor = MonitorWords()
        asks = "monitor" if typed else ""
        offer = [_piece(HOST, typed, OFFER, asks=asks)] if typed else []
        return [*offer, self._take(_piece(DEVICE, b":", "the boot monitor is ready for a download", answers=asks))]


BLANK = b" "


def _before(raw: bytes) -> ExplainedBytes:
    """What came ahead of an echo: the blank of a prompt, which a slow adapter hands on behind the next command, or bytes of nothing."""
    return _piece(DEVICE, raw, "the space of the prompt") if raw == BLANK else stray(DEVICE, raw)


@lru_cache(256)
def _command(command: str, raw: bytes) -> ExplainedBytes:
    """A command line; a recording holds few, each a thousand times."""
    meaning, problem = command_words(command)
    parts = (Part(raw[:-1], "command", command), Part(raw[-1:], "CR", ""))
    values, fields = LazySequence(lambda: _written(command)), {"command": command}
    return _piece(HOST, raw, meaning, problem=problem, fields=fields, parts=parts, values=values, kept={})


@lru_cache(MOST_KNOWN)
def _at_once(command: str, came: bytes) -> Answer | None:
    """The answer to a command where it came whole and alone; a recording holds the same ones again and again."""
    kind = split(command)[1]
    if kind is not None and kind.kind == "loop":
        return None
    decoder = Decoder(command)
    decoder.feed(came)
    answer = decoder.next()
    return None if answer is None or decoder.skipped or len(_raw_of(answer)) != len(came) else answer


def _raw_of(answer: Answer) -> bytes:
    """Its bytes, with the space of the prompt where it has come."""
    return answer.raw if answer.raw.endswith(b"=> ") else answer.raw[: answer.raw.rfind(b"=>") + 2]


@lru_cache(MOST_KNOWN)
def _answer(command: str, answer: Answer) -> ExplainedBytes:
    """Its answer."""
    raw = _raw_of(answer)
    meaning, values, problem = answer_words(command, answer)
    if command.startswith(MARK) and answer.status == UNKNOWN_COMMAND:
        meaning = "prompt: the hand is connected"
    elif answer.status:
        problem = "refused" if answer.status != 16384 else ""
        status = f"ERR {answer.status}: {explain_status(answer.status)}"
        meaning = f"{meaning}. {status}" if answer.lines else status
    return _piece(
        DEVICE, raw, meaning, problem=problem, fields={"command": command, "status": answer.status}, values=values,
        title=f"reply to {command}", parts=LazySequence(lambda: line_parts(raw)), kept={},
    )  # fmt: skip


def _changes_speed(command: str, came: bytes) -> bool:
    """Whether `came` is the echo of a command after which the port's baud rate was changed (dossier 1.2)."""
    return came.upper() == command.upper().encode("ascii", "replace") and "BAUD" in command.upper().split()


def _side(data: bytes) -> str:
    """Who sends such bytes: an answer has a prompt or a line feed, a block of the hand begins with *."""
    if data[:1] == b"*" or data == b":" or b"=>" in data:
        return DEVICE
    text = all(32 <= byte < 127 or byte in (10, 13) for byte in data)
    return DEVICE if text and b"\n" in data else HOST


explainer = BarrettExplainer


# -- which of these bytes write, and what acknowledges them -----------------------------------------------------------


LONGEST = 4096
"""Bytes that are kept of an answer."""


BLOCK, BLOCK_NEXT = "a control block of the RealTime loop", "`handctl barrett status`"


class BarrettWriteRules(WriteRules):
    """One connection."""

    def __init__(self) -> None:
        self._number = 0
        self._key: Hashable = None
        self._kind = ""
        self._decoder: Decoder | None = None
        self._echo = b""
        self._tail = b""
        self._loop = self._moves = self._stopping = False

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteRules."""
        if data in (QUESTION, FILL, LOOPED):  # of the connect: no state of the hand carries them out
            self._decoder = None
            return ()
        if data.strip(SAFE_ABORT) == b"":
            return self._aborted(data)
        if self._loop:
            if data in (FEEDBACK_ONLY, NEITHER):
                return ()
            return (Frame(data, None, data, group="block", meaning=BLOCK, next=BLOCK_NEXT),)
        if _asks(data):
            self._decoder = None
            return ()
        text = data.removesuffix(CR).decode("ascii", "replace").strip()
        self._number += 1
        self._key, self._kind = self._number, kind_of(text)
        self._decoder = Decoder(text)
        self._echo = text.encode("ascii", "replace").upper()
        self._tail, self._stopping = b"", False
        self._moves = self._moves or KINDS[self._kind].moves
        self._loop = self._kind == "loop"
        return (Frame(data, self._key, data),)

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteRules."""
        if self._stopping:
            self._tail = (self._tail + data)[-16:]
            if not has_prompt(b"\n" + self._tail.lstrip()):
                return ()
            self._stopping = self._moves = False
            return ((ABORT, True),)
        if self._decoder is None:
            return ()
        if self._kind == "loop":
            return self._entered(data)
        self._decoder.feed(data)
        answer = self._decoder.next()
        if answer is None:
            if len(self._decoder.received) > LONGEST:
                self._decoder = None
            return ()
        self._decoder = None
        if answer.lines and not answer.status and self._kind != "reset":
            return ()  # perhaps a spoiled ERR: it says nothing
        self._moves = False
        if KINDS[self._kind].moves and _carried_out(answer):
            return ()  # its status tells how it ended: no acknowledgement, and no refusal
        return ((self._key, not answer.status),)

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteRules."""
        return None if _asks(data) else data

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        text = data.removesuffix(CR).decode("ascii", "replace")
        _, known, words = split(text)
        if known is not None and known.name in ("FSET", "PSET") and words:
            return f"`handctl barrett get {' '.join(words[::2])}`"
        return KINDS[kind_of(text)].next

    def _aborted(self, data: bytes) -> Sequence[Frame]:
        """^C: what it interrupts is not acknowledged any more; the prompt that follows may be of either."""
        moving = self._moves or self._loop
        self._loop, self._decoder = False, None
        self._tail, self._stopping = b"", True
        return (Frame(data, ABORT, data, group="^C", unasked=not moving),)

    def _entered(self, data: bytes) -> Iterable[tuple[Hashable, bool]]:
        """The reply to LOOP: * after the echo, or ERR and the prompt. The blank of the prompt before may come ahead of it."""
        self._tail = (self._tail + data).lstrip(BLANK)[-LONGEST:]
        size = len(self._echo)
        if self._tail[:size].upper() == self._echo and self._tail[size : size + 1] == bytes([ACKNOWLEDGE]):
            self._decoder = None
            return ((self._key, True),)
        if b"ERR" in self._tail and has_prompt(self._tail):
            self._decoder, self._loop = None, False
            return ((self._key, False),)
        return ()


def _carried_out(answer: Answer) -> bool:
    """Whether the status is one with which a movement was made, or may have been made by some of its motors."""
    if answer.status & (NOT_REACHED | ABORTED):
        return True
    return bool(answer.status & OF_ONE_MOTOR) and len(motors(split(answer.command)[0])) > 1


def _asks(data: bytes) -> bool:
    """Whether it is an empty line, the question of a connect, or a query."""
    text = data.removesuffix(CR).decode("ascii", "replace").strip()
    return text in ("", MARK) or kind_of(text) == "query"


words = BarrettWriteRules
