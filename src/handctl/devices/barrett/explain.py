"""Explain recorded bytes of the BarrettHand: GCL lines, RealTime blocks and the boot monitor's records.

Bytes in, pieces out; knows no link. Three languages share the line: which one is spoken follows from the conversation
(LOOP was acknowledged; "X" was answered by ":"). The layout of RealTime blocks follows from the flags that were read or
set before; until one was seen it counts as the factory has it.
"""

from __future__ import annotations

import re
from collections import deque

from handctl.devices.barrett import frame_text
from handctl.devices.barrett.frame_text import Flags, LoopWords, MonitorWords, records
from handctl.devices.barrett.gcl.codec import Answer, Decoder, explain_status, split
from handctl.model.explainer import DEVICE, HOST, ExplainedBytes, Later, Part, stray

CR, ABORT = 0x0D, 0x03
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


class BarrettExplainer:
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
            block = frame_text.factory_block(direction, raw) if raw and b"=>" not in raw else []
            pieces += block  # a recording that begins inside RealTime
            if raw and not block:
                what = "a command without its CR" if direction == HOST else "a reply without its prompt"
                pieces.append(stray(direction, raw, f"{what}: {frame_text.shown(raw)}", "cut-short"))
        self._asked.clear()
        return pieces

    def event(self, text: str) -> None:
        """See Explainer. Nothing in it concerns this family."""

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. Blocks are read with factory flags, all four motors."""
        direction = side or _side(data)
        whole = records(data) or frame_text.factory_block(direction, data)
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
        if byte == CR:
            command = self._typed.decode("ascii", "replace")
            raw = bytes(self._typed) + b"\r"
            self._typed.clear()
            return [self._command(command, raw)]
        if byte == ABORT:
            if self._typed:
                pieces.append(
                    stray(HOST, bytes(self._typed), f"an unfinished command: {frame_text.shown(self._typed)}")
                )
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
        if command.strip("\0") == frame_text.MARK:
            meaning, _ = frame_text.command(frame_text.MARK)
            return _piece(HOST, raw, meaning, asks=self._expect(command.lstrip("\0")))
        if not (command.isascii() and command.isprintable()):
            return stray(HOST, raw, f"not a command: {frame_text.shown(raw)}")
        if not command and self._asked and self._came:
            return _piece(HOST, raw, "an empty line")  # to an answer that has already begun, e.g. behind a new speed
        fields = {"command": command}
        parts = (Part(raw[:-1], "command", command), Part(raw[-1:], "CR", ""))
        key = self._expect(command)
        meaning, problem = frame_text.command(command)
        return _piece(HOST, raw, meaning, problem=problem, asks=key, fields=fields, parts=parts)

    # -- from the hand ------------------------------------------------------------------------------------------------

    def _from_hand(self, data: bytes) -> list[ExplainedBytes]:
        pieces: list[ExplainedBytes] = []
        if self._monitor is not None:
            data = bytes(self._came) + data
            self._came.clear()
            return self._monitor.device(data)
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
                return [self._take(stray(DEVICE, came[: decoder.skipped]))]
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
        if came == b" ":
            return self._take(_piece(DEVICE, came, "the space of the prompt"))
        end = came.find(b"=>")
        if end < 0 or (end and came[end - 1] not in (10, 13)):
            return None
        size = end + 3 if came[end + 2 : end + 3] == b" " else end + 2
        lines = frame_text.lines(came[:end])
        text = f"prompt, after {' | '.join(lines)}" if lines else "prompt"
        return self._take(_piece(DEVICE, came[:size], text, parts=frame_text.line_parts(came[:size])))

    def _answer(self, asked: Asked, answer: Answer) -> ExplainedBytes:
        raw = answer.raw if answer.raw.endswith(b"=> ") else answer.raw[: answer.raw.rfind(b"=>") + 2]
        self._flags.note(asked.command, answer)
        meaning, values, problem = frame_text.answer(asked.command, answer)
        if asked.command.startswith(frame_text.MARK) and answer.status == frame_text.UNKNOWN_COMMAND:
            meaning = "prompt: the hand is connected"
        elif answer.status:
            problem = "refused" if answer.status != 16384 else ""
            status = f"ERR {answer.status}: {explain_status(answer.status)}"
            meaning = f"{meaning}. {status}" if answer.lines else status
        fields = {"command": asked.command, "status": answer.status}
        return _piece(
            DEVICE, raw, meaning, problem=problem, answers=asked.key, fields=fields, values=values,
            title=f"reply to {asked.command}", parts=Later(lambda: frame_text.line_parts(raw)),
        )  # fmt: skip

    def _entered(self, came: bytes, asked: Asked, place: int) -> list[ExplainedBytes]:
        """The echo of LOOP with the acknowledgement right after it (barrett §6.1)."""
        sent = asked.command.upper().encode("ascii", "replace")
        start = came.upper().find(sent)
        if start < 0 or came[start + len(sent) : start + len(sent) + 1] != b"*":
            return []
        if start:
            return [self._take(stray(DEVICE, came[:start]))]
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


def _piece(direction: str, raw: bytes, meaning: str, **more: object) -> ExplainedBytes:
    return ExplainedBytes(direction=direction, raw=raw, meaning=meaning, **more)  # type: ignore[arg-type]


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
