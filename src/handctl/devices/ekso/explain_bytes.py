"""Explain recorded bytes of the EksoNR DataPort (ekso §6).

Bytes in, pieces out; knows no link. There is no start byte: a frame is where a command, a length that it may have and a
fitting CRC stand. Both directions have the same shape; the size of the body tells a request from its answer.

For the ledger of writes: the answer repeats command and msgID; its status word says accepted (0) or why not (ekso §6). A bare
acknowledgement, which may be an echo, proves nothing.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from operator import getitem

from handctl.devices.ekso.frames import (
    BEGIN,
    EXCHANGES,
    LENGTH_MODES,
    OVERHEAD,
    READS,
    Command,
    Decoder,
    Exchange,
    Frame,
    crc,
    name_of,
    status_text,
    unpack,
)
from handctl.devices.ekso.parameter_map import CLOCKS, EKSO, MESSAGES, TWICE, Word, boot_ms, boot_text
from handctl.model.explainer import (
    DEVICE,
    HOST,
    CodedValues,
    Cut,
    Cutter,
    ExplainedBytes,
    Known,
    LazySequence,
    Makers,
    Part,
    Value,
    Values,
    stray,
)
from handctl.model.write_ledger import RequestReplyRules
from handctl.wording import plural

LONGEST = max(size for row in EXCHANGES.values() for size in row.answers) + OVERHEAD + max(LENGTH_MODES.values())
BYTES = {"time": ("hours", "minutes", "seconds"), "date": ("year - 2000", "month", "day")}
WRITING = SET_VALUE, CANCEL_ACTION = int(Command.SET_VALUE), int(Command.CANCEL_ACTION)
"""What is answered by a status word. As plain numbers: a recording has millions to compare, and an enum's members take their time."""
WAITING = Cut(0, "waiting")
Explained = tuple[str, Values, Sequence[Part]]
"""A body in words, its values, its parts."""


class EksoExplainer(Cutter):
    """One conversation; remembers the length convention that was met, and the last request to know an echo."""

    def __init__(self) -> None:
        super().__init__()
        self._mode = "body"
        self._asked = b""
        self._alike: dict[tuple[str, str, bytes], ExplainedBytes] = {}
        """Of the frames of reads: direction, length convention, beginning, which has the size -> one of them."""

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer."""
        return can_id is None and self.cut(bytearray(data), "", final=True).problem == ""

    def simulated(self, values: Mapping[str, float | str], moments: Mapping[str, float]) -> Iterator[str]:
        """See Explainer: settings by their ParameterID, words of the other messages by their place, both clocks."""
        for word in EKSO:
            value = values.get(word.name)
            if isinstance(value, int | float) and word.name not in TWICE:
                place = f"set {word.id or word.name}" if word.message == "settings" else f"{word.message} {word.word}"
                yield f"{place} {word.to_raw(value)}"
        high, low = (values.get(name) for name in ("boot_time_high", "boot_time_low"))
        if isinstance(high, int | float) and isinstance(low, int | float):
            began = (int(high) << 16) + int(low) - round(1000 * moments["boot_time_low"])
            yield f"boot {began % (1 << 32)}"
        if "date" in values and "time" in values:
            from datetime import datetime, timedelta

            with suppress(ValueError, OverflowError):  # a damaged clock
                shown = datetime.fromisoformat(f"{values['date']}T{values['time']}")
                yield f"rtc {shown - timedelta(seconds=int(moments['time'])):%Y-%m-%dT%H:%M:%S}"

    # -- finding frames -----------------------------------------------------------------------------------------------

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer."""
        held = self._buffers[direction]
        whole = bytes(held) + data if held else data
        alike = self._alike.get((direction, self._mode, whole[:2]))
        missing = 0 if alike is None else len(alike.raw) - len(whole)
        if missing > 0 and BEGIN.search(whole, 1) is None:  # more is to come, and nothing else has begun inside it
            held += data
            return []
        if alike is None or missing or whole == self._asked or crc(whole):
            return super().feed(direction, data)
        held.clear()
        return [self._another(alike, whole)]

    def _another(self, alike: ExplainedBytes, raw: bytes) -> ExplainedBytes:
        """A frame that differs from one told before in msgID and body only."""
        command, msg_id, mode = raw[0], int.from_bytes(raw[2:4], "big"), self._mode
        inner: Sequence[Part] = ()
        piece = object.__new__(ExplainedBytes)
        vars(piece).update(vars(alike), raw=raw, fields={**alike.fields, "msg_id": msg_id})
        if alike.direction == HOST:
            self._asked, piece.asks = raw, f"{command} {msg_id}"
        else:
            piece.meaning, piece.values, inner = _told(DEVICE, command, raw[4:-2])
            piece.answers = f"{command} {msg_id}"
        piece.parts = LazySequence(lambda: _parts(raw, mode, alike.direction == DEVICE, inner))
        return piece

    def cut(self, buffer: bytearray, side: str, *, final: bool) -> Cut:
        first = self._at(buffer, 0, side)
        if first is not None and not first.problem:
            return first
        place, end = 0, LONGEST if first is not None else len(buffer)
        while begins := BEGIN.search(buffer, place + 1, end):
            place = begins.start()
            found = self._at(buffer, place, side)
            if found is None or (found.problem and (first is not None or final)):
                continue
            if first is None or (not found.problem and (first.problem == "waiting" or place < first.size)):
                return Cut(place, "stray" if first is None else "cut-short")
        if first is None:
            return Cut(len(buffer), "stray")
        if first.problem == "waiting":
            return Cut(len(buffer), "cut-short") if final else WAITING
        return first

    def _at(self, buffer: bytearray, place: int, side: str) -> Cut | None:
        """The data at `place`: a frame, one with a wrong CRC or length, an incomplete one ("waiting"), or nothing."""
        if buffer[place] not in EXCHANGES:
            return None
        there, sizes = len(buffer) - place, _sizes(buffer[place], side)
        if there < 4:
            return WAITING
        readings, waits = _readings(self._mode, buffer[place + 1]), False
        for mode, size in readings:
            total = size + OVERHEAD
            if there < total:
                waits = waits or size in sizes
            elif crc(bytes(buffer[place : place + total])) == 0:
                return Cut(total, "" if size in sizes else "bad-length", mode)
        if waits:
            return WAITING
        fitting = [(mode, size) for mode, size in readings if size in sizes and size + OVERHEAD <= there]
        return Cut(fitting[0][1] + OVERHEAD, "bad-checksum", fitting[0][0]) if fitting else None

    def side_of(self, raw: bytes, cut: Cut) -> str:
        """A body of the size of a request is taken for one."""
        size = len(raw) - OVERHEAD
        return HOST if cut.mode and raw[0] in EXCHANGES and size in _sizes(raw[0], HOST) and not _reply(raw) else DEVICE

    # -- words --------------------------------------------------------------------------------------------------------

    def piece(self, direction: str, raw: bytes, cut: Cut) -> ExplainedBytes:
        if cut.problem == "stray":
            return stray(direction, raw)
        if cut.problem in ("cut-short", "waiting"):
            return stray(
                direction, raw, f"the beginning of a frame, cut off after {plural(len(raw), 'byte')}", "cut-short"
            )
        command, msg_id, body = raw[0], int.from_bytes(raw[2:4], "big"), raw[4:-2]
        name, (words, values, parts) = name_of(command), _told(direction, command, body)
        problem, frame, extra = cut.problem, not cut.problem, ""
        if problem == "bad-checksum":
            extra = f"bad CRC {raw[-2:].hex().upper()}, should be {crc(raw[:-2]):04X}. It would say: "
        elif problem == "bad-length":
            sizes = sorted(_sizes(command, direction))
            extra = f"{len(body)} body bytes, {' or '.join(map(str, sizes))} expected. CRC right: "
        elif direction == DEVICE and raw == self._asked:
            problem, extra = "echo", "our own bytes, or an acknowledgement without a body: "
        elif direction == DEVICE and command in WRITING and not body:
            problem, extra = "acknowledged", "no status, so not a success: "
        elif direction == DEVICE and _is_status(command, body) and body[1]:
            problem = "refused"
        if frame:
            self._mode = cut.mode
        if direction == HOST:
            self._asked = raw
        key = f"{command} {msg_id}" if frame and problem != "echo" else ""
        answer = direction == DEVICE
        piece = ExplainedBytes(
            direction=direction, raw=raw, meaning=f"{extra}{words}", problem=problem, frame=frame, values=values,
            title=problem if not frame else f"{name} answer" if answer else name,
            asks="" if answer else key, answers=key if answer else "",
            fields={"command": command, "name": name, "msg_id": msg_id, "length_mode": cut.mode},
            parts=LazySequence(lambda: _parts(raw, cut.mode, answer, parts)),
        )  # fmt: skip
        if not problem and EXCHANGES[command].words and bool(body) == answer:
            self._alike[direction, cut.mode, raw[:2]] = piece
        return piece


def _parts(raw: bytes, mode: str, answer: bool, inner: Sequence[Part]) -> Iterator[Part]:
    """A frame field by field, around the parts of its body."""
    more = LENGTH_MODES.get(mode, 0)
    counts = "" if not more else ", counts the whole frame" if more == OVERHEAD else f", counts {more} more"
    yield Part(raw[:1], "command", f"{raw[0]} {name_of(raw[0])}{', answer' if answer else ''}")
    yield Part(raw[1:2], "length", f"{len(raw) - OVERHEAD} body bytes{counts}")
    yield Part(raw[2:4], "msgID", str(int.from_bytes(raw[2:4], "big")))
    yield from inner
    yield Part(raw[-2:], "CRC", f"wrong, should be {crc(raw[:-2]):04X}" if crc(raw) else "right")


@cache
def _readings(met: str, length: int) -> Sequence[tuple[str, int]]:
    """(convention, size of the body) that a length byte may mean: the one that was met first."""
    modes = sorted(LENGTH_MODES, key=lambda name: name != met)
    return [(mode, size) for mode in modes if 0 <= (size := length - LENGTH_MODES[mode]) <= LONGEST - OVERHEAD]


@cache
def _sizes(command: int, side: str) -> frozenset[int]:
    """Body sizes that a command may have, sent by `side` ("" = either)."""
    row = EXCHANGES[command]
    own = {row.asks} if row.asks is not None else {*row.answers}
    return frozenset(own if side == HOST else {0, *row.answers, *own})


def _reply(raw: bytes) -> bool:
    """A CancelAction of two bytes is a request with a word other than 0, an answer with a status of 0 to 3."""
    if raw[0] != CANCEL_ACTION or len(raw) != OVERHEAD + 2:
        return EXCHANGES[raw[0]].asks is None
    return raw[4:6] in (b"\0\0", b"\0\2", b"\0\3") or (raw[5] == 1 and raw[4] > 1)


def _is_status(command: int, body: bytes) -> bool:
    """Whether the body of an answer is a status word."""
    return command in WRITING and len(body) == 2


def _told(direction: str, command: int, body: bytes) -> Explained:
    row = EXCHANGES[command]
    words = MESSAGES.get(row.words, ())
    if direction == DEVICE and words and len(body) == 2 * len(words):
        return _message(row, words, body)
    shown = body.hex(" ").upper()
    plain = [Part(body, "command word" if command == CANCEL_ACTION else "body", "")] if body else []
    if row.asks is None:
        return f"{row.name}, not in the manual: {shown}", (), plain
    if direction == HOST:
        if command == SET_VALUE and len(body) == 4:
            return _setting(body)
        if command == CANCEL_ACTION and len(body) == 2:
            return f"{row.name}: command word {body.hex().upper()}", (), plain
        return f"{row.name}: {shown}" if body else f"request {row.name}", (), plain
    if not body:
        return f"{row.name}: acknowledged, without a body", (), plain
    if _is_status(command, body):
        word = int.from_bytes(body, "big")
        return f"{row.name}: {status_text(word)}", (Value("status", word),), [Part(body, "status", status_text(word))]
    if row.words in BYTES and len(body) in (3, 4):
        text = next(clock.form for clock in CLOCKS if clock.name == row.words).format(*body[:3])
        parts = [Part(body[i : i + 1], name, str(body[i])) for i, name in enumerate(BYTES[row.words])]
        return f"{row.name}: {text}", (Value(row.words, text),), parts + [Part(body[3:], "pad", "")] * (len(body) == 4)
    return f"{row.name}: {shown}", (), plain


def _message(row: Exchange, words: Sequence[Word], body: bytes) -> Explained:
    """The words of an answer; the time since power-on, which stands at the end of two of them, as one."""
    numbers, clock = unpack(body), words[-1].name == "boot_time_low"
    shown = _known(row.words)
    text = ", ".join(map(getitem, shown[:-2] if clock else shown, numbers))
    boot = f", boot {boot_text(boot_ms(numbers))}" if clock else ""
    parts = LazySequence(
        lambda: [
            Part(body[2 * word.word :][:2], word.name, word.shown(word.value_of(number)))
            for word, number in zip(words, numbers, strict=True)
        ]
    )
    return f"{row.name}: {text}{boot}", CodedValues(_makers(row.words), numbers), parts


@cache
def _makers(message: str) -> Makers:
    """For each word of a message what makes its number a value."""
    return Makers(partial(_value, word) for word in MESSAGES[message])


@cache
def _known(message: str) -> list[Known[int]]:
    """For each word of a message what its number is in words."""
    return [Known(partial(_shown, word)) for word in MESSAGES[message]]


def _shown(word: Word, number: int) -> str:
    """A word of a message with its name."""
    return f"{word.name} {word.shown(word.value_of(number))}"


def _value(word: Word, number: int) -> Value:
    """The same as a number."""
    return Value(word.name, word.value_of(number), word.unit)


def _setting(body: bytes) -> Explained:
    """What a SetValue sets."""
    number, raw = int.from_bytes(body[:2], "big"), int.from_bytes(body[2:], "big")
    word = next((word for word in EKSO if word.id == number), None)
    if word is None:
        parts = [Part(body[:2], "ParameterID", f"{number} unknown"), Part(body[2:], "value", body[2:].hex().upper())]
        return f"SetValue: ParameterID {number} (not in the manual) = {raw}", (), parts
    value = word.value_of(raw)
    parts = [Part(body[:2], "ParameterID", f"{number} {word.name}"), Part(body[2:], "value", word.shown(value))]
    return f"SetValue: {word.name} = {word.shown(value)}", (Value(word.name, value, word.unit),), parts


explainer = EksoExplainer


# -- which of these bytes write, and what acknowledges them -----------------------------------------------------------


CRC_BYTES = 2


class EksoWriteRules(RequestReplyRules[Frame]):
    """One connection."""

    def key(self, request: bytes) -> Hashable:
        return request[:1] + request[2:4] if request and request[0] not in READS.values() else None

    def same(self, request: bytes) -> Hashable:
        """The bytes without the running msgID and the sum over it."""
        return request[:2] + request[4:-CRC_BYTES]

    def decoder(self, request: bytes) -> Decoder:
        decoder = Decoder()
        decoder.expect(request)
        return decoder

    def verdict(self, frame: Frame, request: bytes) -> tuple[Hashable, bool] | None:
        """CancelAction and its answer are of one length: what equals the request is an echo."""
        if not frame.answers(request) or len(frame.body) != 2:
            return None
        return self.key(request), frame.status & 0xFF == 0

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        return "`handctl ekso feedback`" if data[0] == CANCEL_ACTION else "`handctl ekso settings`"


words = EksoWriteRules
