"""What recorded bytes of the EksoNR DataPort mean: frames in words, by the words of its messages (ekso §6).

Bytes in, pieces out; knows no link. There is no start byte: a frame is where a command, a length that it may have and a
fitting CRC stand. Both directions have the same shape; the size of the body tells a request from its answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from handctl.devices.ekso.frames import (
    ANSWER_SIZES,
    LENGTH_MODES,
    OVERHEAD,
    REQUEST_SIZES,
    Command,
    crc,
    name_of,
    status_text,
    unpack,
)
from handctl.devices.ekso.map import EKSO, MESSAGES, Word, boot_ms, boot_text
from handctl.model.piece import DEVICE, HOST, Cut, Cutter, Later, Part, Piece, Value, stray
from handctl.sentence import plural

LONGEST = max(size for sizes in ANSWER_SIZES.values() for size in sizes) + OVERHEAD + max(LENGTH_MODES.values())
ORDER = ("body", "n-4", "n-2", "frame")
WORDS = {Command.GET_SETTINGS: "settings", Command.GET_DATA: "data", Command.GET_FEEDBACK: "feedback"}
COMMANDS = {int(command): sizes for command, sizes in ANSWER_SIZES.items()}


class EksoExplainer(Cutter):
    """One conversation; remembers the length convention that was met, and the last request to know an echo."""

    def __init__(self) -> None:
        super().__init__()
        self._mode = "body"
        self._asked = b""

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer."""
        return can_id is None and self.cut(bytearray(data), "", final=True).problem == ""

    # -- finding frames -----------------------------------------------------------------------------------------------

    def cut(self, buffer: bytearray, side: str, *, final: bool) -> Cut:
        first = self._at(buffer, 0, side)
        if first is not None and not first.problem:
            return first
        for place in range(1, min(len(buffer), LONGEST) if first is not None else len(buffer)):
            found = self._at(buffer, place, side)
            if found is None or (found.problem and (first is not None or final)):
                continue
            if first is None or (not found.problem and (first.problem == "waiting" or place < first.size)):
                return Cut(place, "stray" if first is None else "cut-short")
        if first is None:
            return Cut(len(buffer), "stray")
        if first.problem == "waiting":
            return Cut(len(buffer), "cut-short") if final else Cut(0, "waiting")
        return first

    def _at(self, buffer: bytearray, place: int, side: str) -> Cut | None:
        """What stands at `place`: a frame, one with a wrong CRC or length, a beginning ("waiting"), or nothing."""
        if buffer[place] not in COMMANDS:
            return None
        view = bytes(buffer[place : place + LONGEST])
        if len(view) < 4:
            return Cut(0, "waiting")
        sizes = _sizes(view[0], side)
        readings = [(mode, view[1] - LENGTH_MODES[mode]) for mode in sorted(ORDER, key=lambda name: name != self._mode)]
        readings = [(mode, size) for mode, size in readings if 0 <= size <= LONGEST - OVERHEAD]
        waits = False
        for mode, size in readings:
            total = size + OVERHEAD
            if len(view) < total:
                waits = waits or size in sizes
            elif crc(view[:total]) == 0:
                return Cut(total, "" if size in sizes else "bad-length", mode)
        if waits:
            return Cut(0, "waiting")
        fitting = [(mode, size) for mode, size in readings if size in sizes and size + OVERHEAD <= len(view)]
        return Cut(fitting[0][1] + OVERHEAD, "bad-checksum", fitting[0][0]) if fitting else None

    def side_of(self, raw: bytes, cut: Cut) -> str:
        """A body of the size of a request is taken for one."""
        size = len(raw) - OVERHEAD
        return HOST if cut.mode and raw[0] in COMMANDS and size in _sizes(raw[0], HOST) and not _reply(raw) else DEVICE

    # -- words --------------------------------------------------------------------------------------------------------

    def piece(self, direction: str, raw: bytes, cut: Cut) -> Piece:
        if cut.problem == "stray":
            return stray(direction, raw)
        if cut.problem in ("cut-short", "waiting"):
            return stray(
                direction, raw, f"the beginning of a frame, cut off after {plural(len(raw), 'byte')}", "cut-short"
            )
        command, msg_id, body = raw[0], int.from_bytes(raw[2:4], "big"), raw[4:-2]
        words, values = _words(direction, command, body)
        problem, frame, extra = cut.problem, not cut.problem, ""
        if problem == "bad-checksum":
            right = crc(raw[:-2])
            extra = f"bad CRC {raw[-2:].hex().upper()}, should be {right:04X}. It would say: "
        elif problem == "bad-length":
            sizes = sorted(_sizes(command, direction))
            extra = f"{len(body)} body bytes, {' or '.join(map(str, sizes))} expected. CRC right: "
        elif direction == DEVICE and raw == self._asked:
            problem, extra = "echo", "our own bytes, or an acknowledgement without a body: "
        elif direction == DEVICE and status_of(command, body) not in (None, 0):
            problem = "refused"
        elif direction == DEVICE and not body and command in (Command.SET_VALUE, Command.CANCEL_ACTION):
            problem, extra = "acknowledged", "no status, so not a success: "
        if frame:
            self._mode = cut.mode
        if direction == HOST:
            self._asked = raw
        key = f"{command} {msg_id}" if frame and problem != "echo" else ""
        return Piece(
            direction=direction, raw=raw, meaning=f"{extra}{words}", problem=problem, frame=frame, values=values,
            title=problem if not frame else f"{name_of(command)} {'answer' if direction == DEVICE else ''}".strip(),
            asks=key if direction == HOST else "", answers=key if direction == DEVICE else "",
            fields={"command": command, "name": name_of(command), "msg_id": msg_id, "length_mode": cut.mode},
            parts=Later(lambda: _parts(direction, raw, cut)),
        )  # fmt: skip


def _sizes(command: int, side: str) -> set[int]:
    """Body sizes that a command may have, sent by `side` ("" = either)."""
    asked = REQUEST_SIZES.get(command) if command in REQUEST_SIZES else None  # type: ignore[call-overload]
    own = {asked} if asked is not None else set(COMMANDS[command])
    if side == HOST:
        return own
    return {0, *COMMANDS[command], *own}


def _reply(raw: bytes) -> bool:
    """A CancelAction of two bytes is a request with a word other than 0, an answer with a status of 0 to 3."""
    if raw[0] != Command.CANCEL_ACTION or len(raw) != OVERHEAD + 2:
        return raw[0] not in list(REQUEST_SIZES)
    return raw[4:6] in (b"\0\0", b"\0\2", b"\0\3") or (raw[5] == 1 and raw[4] > 1)


def status_of(command: int, body: bytes) -> int | None:
    """The code of a status word, None where the answer has none."""
    return body[1] if command in (Command.SET_VALUE, Command.CANCEL_ACTION) and len(body) == 2 else None


def _words(direction: str, command: int, body: bytes) -> tuple[str, Sequence[Value]]:
    name = name_of(command)
    if command not in list(REQUEST_SIZES):
        return f"{name}, not in the manual: {body.hex(' ').upper()}", ()
    if direction == HOST:
        return _request(name, command, body)
    if not body:
        return f"{name}: acknowledged, without a body", ()
    if command in (Command.GET_TIME, Command.GET_DATE) and len(body) in (3, 4):
        text = _moment(command, body)
        return f"{name}: {text}", (Value("time" if command == Command.GET_TIME else "date", text),)
    if status_of(command, body) is not None:
        word = int.from_bytes(body, "big")
        return f"{name}: {status_text(word)}", (Value("status", word),)
    if command in WORDS:
        words = MESSAGES[WORDS[Command(command)]]
        numbers = unpack(body)
        if len(numbers) == len(words):
            text = ", ".join(
                [
                    _told(word, number)
                    for word, number in zip(words, numbers, strict=True)
                    if not word.name.startswith("boot_time")
                ]
            )
            values = Later(
                lambda: [
                    Value(word.name, word.value_of(number), word.unit)
                    for word, number in zip(words, numbers, strict=True)
                ]
            )
            boot = f", boot {boot_text(boot_ms(numbers))}" if words[-1].name == "boot_time_low" else ""
            return f"{name}: {text}{boot}", values
    return f"{name}: {body.hex(' ').upper()}", ()


@lru_cache(4096)
def _told(word: Word, number: int) -> str:
    """A word of a message with its name; a long recording says the same again and again."""
    return f"{word.name} {word.shown(word.value_of(number))}"


def _request(name: str, command: int, body: bytes) -> tuple[str, Sequence[Value]]:
    if command == Command.SET_VALUE and len(body) == 4:
        number, raw = int.from_bytes(body[:2], "big"), int.from_bytes(body[2:], "big")
        word = _parameter(number)
        if word is None:
            return f"{name}: ParameterID {number} (not in the manual) = {raw}", ()
        value = word.value_of(raw)
        return f"{name}: {word.name} = {word.shown(value)}", (Value(word.name, value, word.unit),)
    if command == Command.CANCEL_ACTION and len(body) == 2:
        return f"{name}: command word {body.hex().upper()}", ()
    return f"request {name}" if not body else f"{name}: {body.hex(' ').upper()}", ()


def _parameter(number: int) -> Word | None:
    return next((word for word in EKSO if word.id == number), None)


def _moment(command: int, body: bytes) -> str:
    if command == Command.GET_TIME:
        return "{:02d}:{:02d}:{:02d}".format(*body[:3])
    return "20{:02d}-{:02d}-{:02d}".format(*body[:3])


def _parts(direction: str, raw: bytes, cut: Cut) -> tuple[Part, ...]:
    command, body, right = raw[0], raw[4:-2], crc(raw[:-2])
    counted = {"body": "", "n-4": ", counts 2 more", "n-2": ", counts 4 more", "frame": ", counts the whole frame"}
    found = [
        Part(raw[:1], "command", f"{command} {name_of(command)}{', answer' if direction == DEVICE else ''}"),
        Part(raw[1:2], "length", f"{len(body)} body bytes{counted.get(cut.mode, '')}"),
        Part(raw[2:4], "msgID", str(int.from_bytes(raw[2:4], "big"))),
        *_body_parts(direction, command, body),
    ]
    verdict = "right" if int.from_bytes(raw[-2:], "big") == right else f"wrong, should be {right:04X}"
    return (*found, Part(raw[-2:], "CRC", verdict))


def _body_parts(direction: str, command: int, body: bytes) -> list[Part]:
    if not body:
        return []
    if command in WORDS and direction == DEVICE:
        words = MESSAGES[WORDS[Command(command)]]
        if len(body) == 2 * len(words):
            return [
                Part(body[2 * word.word : 2 * word.word + 2], word.name, word.shown(word.value_of(number)))
                for word, number in zip(words, unpack(body), strict=True)
            ]
    if command == Command.SET_VALUE and direction == HOST and len(body) == 4:
        number = int.from_bytes(body[:2], "big")
        word = _parameter(number)
        shown = word.shown(word.value_of(int.from_bytes(body[2:], "big"))) if word else body[2:].hex().upper()
        return [
            Part(body[:2], "ParameterID", f"{number} {word.name if word else 'unknown'}"),
            Part(body[2:], "value", shown),
        ]
    if command in (Command.GET_TIME, Command.GET_DATE) and direction == DEVICE and len(body) in (3, 4):
        names = ("hours", "minutes", "seconds") if command == Command.GET_TIME else ("year - 2000", "month", "day")
        found = [Part(body[i : i + 1], name, str(body[i])) for i, name in enumerate(names)]
        return found + ([Part(body[3:], "pad", "")] if len(body) == 4 else [])
    if status_of(command, body) is not None and direction == DEVICE:
        return [Part(body, "status", status_text(int.from_bytes(body, "big")))]
    return [Part(body, "command word" if command == Command.CANCEL_ACTION else "body", "")]


explainer = EksoExplainer
