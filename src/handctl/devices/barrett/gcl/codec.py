"""The Grasper Control Language's line protocol, commands <-> bytes. Sans I/O: knows no link and no clock.

    host   COMMAND 0D                        barrett §5.1.1
    hand   COMMAND 0A 0D [line 0A 0D]... [ERR n 0A 0D] 3D 3E 20

Every character is echoed, the CR is answered by LF CR, an answer ends with the prompt "=> " on a line of its own.
An error is a sum of powers of two, printed before the prompt (§5.1.3, T3). The manual writes CRLF; hands send LF CR;
both are accepted, and the prompt with or without its space.

The commands (§5.2): what each takes, how long it may last, what it does. What is so of
all commands of a kind stands in KINDS.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from handctl.errors import Hint, ProtocolError, UsageError

CR = b"\r"
ABORT = b"\x03"
PROMPT = b"=>"
BANNER = b"BARRETTHAND FIRMWARE"
"""What a hand says when its firmware starts, in upper case; nothing else of its banner is known (dossier 1.2)."""
DISTURBED = "check the cable and run the command again: data was corrupted on the line"
"""The next step after bytes that cannot be an answer."""
MAX_LINE = 70
MAX_ARGUMENTS = 18
"""Longest lines and argument lists seen to work; the limit is undocumented (dossier 1.4)."""

MOTOR_DIGITS = "1234"
MOTORS = ("F1", "F2", "F3", "SPREAD")


class Command(NamedTuple):
    """One GCL command. `argument` is (lowest, highest) of an optional number, None where it takes none."""

    name: str
    prefix: bool
    kind: str
    doc: str
    source: str
    argument: tuple[int, int] | None = None


_TRAVEL = (0, 20000)

COMMANDS: dict[str, Command] = {
    command.name: command
    for command in (
        Command("C", True, "motion", "close to CT (spread: F1 and F2 move next to F3)", "barrett §5.2.1"),
        Command("HI", True, "init", "initialize: find the open stop (must be the first movement)", "barrett §5.2.1"),
        Command("HOME", True, "motion", "move to 0", "barrett §5.2.1"),
        Command("IC", True, "motion", "close by a distance (default: DS)", "barrett §5.2.1", _TRAVEL),
        Command("IO", True, "motion", "open by a distance (default: DS)", "barrett §5.2.1", _TRAVEL),
        Command("LOOP", True, "loop", "enter RealTime", "barrett §5.2.1, §6"),
        Command("M", True, "motion", "move to a position (default: DP)", "barrett §5.2.1", _TRAVEL),
        Command("O", True, "motion", "open to OT", "barrett §5.2.1"),
        Command("T", True, "set", "motor power off", "barrett §5.2.1"),
        Command("TC", True, "motion", "close under torque control until it stalls", "barrett §5.2.1"),
        Command("TO", True, "motion", "open under torque control until it stalls", "barrett §5.2.1"),
        Command("FSET", True, "set", "set motor parameters in RAM: NAME VALUE pairs", "barrett §5.2.2"),
        Command("FGET", True, "query", "read motor parameters", "barrett §5.2.2"),
        Command("FLOAD", True, "set", "motor parameters from EEPROM to RAM", "barrett §5.2.2"),
        Command("FSAVE", True, "save", "motor parameters from RAM to EEPROM (at most 5,000 times)", "barrett §5.2.2"),
        Command("FDEF", True, "set", "motor parameters to factory values, in RAM", "barrett §5.2.2"),
        Command("FLIST", False, "query", "standard motor parameters", "barrett §5.2.2"),
        Command("FLISTV", True, "query", "standard motor parameters with values", "barrett §5.2.2"),
        Command("FLISTA", False, "query", "all motor parameters", "barrett §5.2.5"),
        Command("FLISTAV", True, "query", "all motor parameters with values", "barrett §5.2.5"),
        Command("PSET", False, "set", "set hand parameters in RAM: NAME VALUE pairs", "barrett §5.2.3"),
        Command("PGET", False, "query", "read hand parameters", "barrett §5.2.3"),
        Command("PLOAD", False, "speed", "hand parameters from EEPROM to RAM (may change the speed)", "barrett §5.2.3"),
        Command("PSAVE", False, "save", "hand parameters from RAM to EEPROM (at most 5,000 times)", "barrett §5.2.3"),
        Command(
            "PDEF", False, "speed", "hand parameters to factory values, in RAM (may change the speed)", "barrett §5.2.3"
        ),
        Command("PLIST", False, "query", "standard hand parameters", "barrett §5.2.3"),
        Command("PLISTV", False, "query", "standard hand parameters with values", "barrett §5.2.3"),
        Command("PLISTA", False, "query", "all hand parameters", "barrett §5.2.5"),
        Command("PLISTAV", False, "query", "all hand parameters with values", "barrett §5.2.5"),
        Command("?", False, "query", "help (?NAME describes a command)", "barrett §5.2.4"),
        Command("A?", False, "query", "help on standard and advanced commands", "barrett §5.2.5"),
        Command("RESET", False, "reset", "restart the firmware: motors uninitialized, saved speed", "barrett §5.2.4"),
        Command("ERR", False, "query", "text for a status code or a sum of codes", "barrett §5.2.4"),
        Command("VERS", False, "query", "firmware version", "barrett §5.2.4"),
    )
}


class Kind(NamedTuple):
    """What is so of every command of a kind.

    seconds   longest wait for the prompt beyond wire time (dossier 1.3)
    question  what is asked before it, "" = nothing
    next      what to read when nothing has acknowledged it
    refused   why the passthrough does not carry it, for it would lose the line; and the next step
    """

    seconds: float
    moves: bool = False
    question: str = ""
    next: str = Hint("{}", "barrett status")
    refused: tuple[str, str] | None = None


SPEED = "The hand may change its baud rate immediately"
KINDS = {
    "query": Kind(3.0),
    "set": Kind(3.0),
    "baud": Kind(3.0, question=SPEED, refused=("PSET BAUD changes the baud rate immediately", "use `handctl barrett baud RATE`, which also switches the port")),
    "speed": Kind(3.0, question=SPEED, next=Hint("run {}, which tries all baud rates", "barrett baud")),
    "save": Kind(15.0, question="This writes the EEPROM, which is rated for 5,000 saves", next=Hint("switch the hand off and on, then run {}", "barrett dump")),
    "reset": Kind(15.0, question=SPEED, next=Hint("{}", "barrett version"), refused=("RESET may change the baud rate", Hint("use {}, which finds the hand again", "barrett reset"))),
    "motion": Kind(20.0, moves=True, next=Hint("{}", "barrett get P S")),
    "init": Kind(30.0, moves=True),
    "loop": Kind(1.5, refused=("LOOP leaves the text protocol", Hint("use {}", "barrett realtime"))),
}  # fmt: skip


def kind_of(text: str, unknown: str = "set") -> str:
    """The kind of the command in a line, "baud" for one that sets the speed; `unknown` for what is no command."""
    _, command, arguments = split(text)
    if command is None:
        return unknown
    return "baud" if command.name == "PSET" and "BAUD" in arguments else command.kind


@lru_cache(1024)
def split(text: str) -> tuple[str, Command | None, tuple[str, ...]]:
    """``12M 5000`` -> ("12", the command M, ("5000",)); an unknown command gives None. No command begins with G or S."""
    words = tuple(text.upper().split())
    if not words:
        return "", None, ()
    head = words[0]
    if head.startswith("?"):
        return "", COMMANDS["?"], (head[1:], *words[1:]) if head[1:] else words[1:]
    size = len(head) - len(head.lstrip("1234GS"))
    return head[:size], COMMANDS.get(head[size:]), words[1:]


def motor_prefix(text: str) -> str:
    """``12S``, ``G``, ``F1,F3``, ``all`` -> GCL digits in order: ``124``, ``123``, ``13``, ``1234``. Raises UsageError."""
    digits: set[str] = set()
    for part in text.upper().replace(",", " ").split():
        if part in ("ALL", "*"):
            digits |= set(MOTOR_DIGITS)
        elif part == "SPREAD":
            digits.add("4")
        else:
            for letter in part.replace("F", ""):
                found = {"G": "123", "S": "4"}.get(letter, letter if letter in MOTOR_DIGITS else "")
                if not found:
                    raise UsageError(
                        f"motors {text}: there is no motor {letter}",
                        hint="use the digits 1 2 3 4, G for the fingers 1 2 3, or S for the spread 4 (barrett T2)",
                    )
                digits |= set(found)
    if not digits:
        raise UsageError("no motor named", hint="name some, such as --motors 12S or --motors G")
    return "".join(sorted(digits))


def motors_of(prefix: str) -> list[str]:
    """``14`` -> ``["F1", "SPREAD"]``; no prefix = all four."""
    return [MOTORS[int(digit) - 1] for digit in (prefix or MOTOR_DIGITS)]


def encode(command: str) -> bytes:
    """A command as it goes out: upper case is left to the caller; printable ASCII, no CR in it. Raises UsageError."""
    if not (command.isascii() and command.isprintable()):
        raise UsageError(
            f"{command!r} contains characters that are not allowed in a GCL command",
            hint="use printable ASCII only (barrett §5.1.1)",
        )
    return command.encode("ascii") + CR


class Answer(NamedTuple):
    """One complete answer: its data lines and its status sum (0 = no ERR line); `said` is the error line where the manual has another."""

    command: str
    lines: tuple[str, ...]
    status: int
    raw: bytes
    said: str = ""


STATUS = re.compile(r"ERR *([0-9]{1,10})(?:[ :,;(-]+([A-Za-z].{2,}))?")
"""A status line. The manual has "ERR n" (§5.1.3) and once "ERR16" (§5.5); a firmware may put its text behind the number."""


def error_form(text: str) -> re.Pattern[str] | None:
    """How a hand spells its status lines, from what it says to an unknown command: a word and 32. None where it says no number."""
    found = re.search(r"([A-Za-z]+[^A-Za-z0-9]*)32(?!\d)", text)
    return re.compile(rf".*?{re.escape(found[1])}([0-9]{{1,10}})(?!\d).*") if found else None


def status_of(line: str, command: str, form: re.Pattern[str] | None = None) -> tuple[int, str] | None:
    """The status in a line and the line itself where the manual has it otherwise; None for data.

    The command ERR lists such lines, texts and all: there only the bare form is a status. `form` is that of this hand.
    """
    line = line.strip()
    found = STATUS.fullmatch(line)
    plain = found is not None and len(line.split()) == 2 and found[2] is None
    if found is None and form is not None:
        found = form.fullmatch(line)
    if found is None or (not plain and (split(command)[1] is None or split(command)[1] is COMMANDS["ERR"])):
        return None
    return int(found[1]), "" if plain else line


class Decoder:
    """Collects the answer to one command: `feed` bytes, `next` gives it once the prompt has come.

    The echo is found first, by exact comparison, and cut off before a status is looked for: the command "ERR 3" echoes
    as a line that looks like one. Bytes before the echo (noise, a stale answer) are counted in `skipped`.
    """

    def __init__(self, command: str, form: re.Pattern[str] | None = None) -> None:
        self._command = command
        self._form = form
        self._sent = command.encode("ascii", "replace").upper()
        self._buffer = bytearray()
        self._folded = bytearray()
        self._seek = self._prompts = 0  # no echo before the one place, no prompt before the other: noise is read once
        self._lead = LinePrefix()
        self.skipped = 0
        self.echoed = False

    def feed(self, data: bytes) -> None:
        self._buffer += data
        self._folded += data.upper()

    @property
    def received(self) -> bytes:
        """Everything so far."""
        return bytes(self._buffer)

    @property
    def size(self) -> int:
        """How much that is."""
        return len(self._buffer)

    def last(self, size: int) -> bytes:
        """The last bytes of it."""
        return bytes(self._buffer[-size:])

    def next(self) -> Answer | None:
        """The answer, or None until its prompt has come."""
        buffer = self._buffer
        start = self._echo_at()
        if start is None:
            return None
        self.echoed = True
        size = start + len(self._sent)
        end = _prompt_at(buffer, size, self._prompts)
        if end is None:
            self._prompts = max(size, len(buffer) - 1)
            return None
        self.skipped = start
        lines = [_text(part) for part in _parts(bytes(buffer[size:end])) if part.strip()]
        if lines and lines[0].upper().encode("ascii", "replace") == self._sent:
            del lines[0]  # the echo once more: a line that echoes too; "ERR 3" must not become a status
        status, said = 0, ""
        data = []
        for line in lines:
            if (found := status_of(line, self._command, self._form)) is None:
                data.append(line)
            else:
                status, said = status | found[0], said or found[1]
        return Answer(self._command, tuple(data), status, bytes(buffer[: end + 3]), said)

    def drop_prompt(self) -> None:
        """Remove the first prompt after the echo: it belonged to an earlier command."""
        start = self._echo_at()
        if start is not None:
            end = _prompt_at(self._buffer, start + len(self._sent), 0)
            if end is not None:
                del self._buffer[end : end + 3], self._folded[end : end + 3]
                self._prompts = 0

    def _echo_at(self) -> int | None:
        """The position of this command's echo: after a line, a prompt or noise, before a line end (or nothing yet).

        Not behind a character that a command can have: that is the end of another, longer command's echo.
        """
        folded, sent = self._folded, self._sent
        place = folded.find(sent, self._seek)
        while place >= 0:
            behind = folded[place + len(sent) : place + len(sent) + 1]
            if bytes(behind) in (b"", b"\n", b"\r") and not 32 <= self._lead.at(folded, place) < 127:
                self._seek = place
                return place
            place = folded.find(sent, place + 1)
        self._seek = max(self._seek, len(folded) - len(sent) + 1)
        return None


class LinePrefix:
    """What stands before a place on its line, blanks and prompts apart. Asked for ever later places: each byte counts once."""

    def __init__(self) -> None:
        self._place = 0
        self._last = self._before = self._byte = -1

    def at(self, data: bytearray, place: int) -> int:
        """The last such byte before `place`, -1 = none."""
        for byte in data[self._place : place]:
            if byte in b"\r\n":
                self._last = -1
            elif byte == PROMPT[1] and self._byte == PROMPT[0]:
                self._last = self._before
            elif byte != 0x20:
                self._before, self._last = self._last, byte
            self._byte = byte
        self._place = max(self._place, place)
        return self._last


def _parts(data: bytes) -> list[bytes]:
    """The text between line ends of any kind."""
    return data.replace(b"\r", b"\n").split(b"\n")


def _text(part: bytes) -> str:
    return part.decode("ascii", "replace")


def whole(answer: Answer) -> Answer:
    """The same answer. Raises ProtocolError where a character of it is none of GCL's: a bit was lost on the line."""
    for line in answer.lines:
        if not line.isascii():
            text = f"{answer.command}: a character was corrupted: {line!r} ({_bytes_of(answer, line)})"
            raise ProtocolError(text, hint=DISTURBED, code="damaged")
    return answer


def _bytes_of(answer: Answer, line: str) -> str:
    return next((part for part in _parts(answer.raw) if _text(part) == line), b"").hex(" ").upper()


def _prompt_at(buffer: bytearray, start: int, known: int) -> int | None:
    """The position of a prompt at the start of a line, from `start` on; there is none before `known`."""
    place = buffer.find(PROMPT, max(start, known))
    while place >= 0:
        if place > start and buffer[place - 1] in b"\r\n":
            return place
        place = buffer.find(PROMPT, place + 1)
    return None


def has_colon(data: bytes) -> bool:
    """Whether `data` ends with the boot monitor's ':'. After a quotation mark it is a JSON key: another device."""
    text = data.rstrip(b"\r\n\0 ")
    return text.endswith(b":") and not text[:-1].rstrip().endswith(b'"')


def has_prompt(data: bytes | bytearray) -> bool:
    """Whether `data` ends with a prompt on its own line."""
    tail = data[-5:].strip()
    end = data[-6:].rstrip()  # a tail that ends with a prompt has lost three bytes at the most
    return tail.endswith(PROMPT) and (len(end) == 2 or end[-3:-2] in (b"\n", b"\r"))


def values(answer: Answer, names: int, motors: int) -> list[list[int]]:
    """The numbers of a get: one line per name, one value per motor. Raises ProtocolError for any other shape."""
    table = []
    for line in answer.lines:
        words = line.split()
        numbers = [int(word) for word in words if word.removeprefix("-").isdecimal() and len(word) <= 11]
        if len(numbers) != motors or len(words) != motors:
            raise ProtocolError(
                f"{answer.command}: expected {motors} numbers per line, received {line!r} ({_bytes_of(answer, line)})",
                hint=DISTURBED,
                code="bad-line",
            )
        table.append(numbers)
    if len(table) != names and not answer.status:
        raise ProtocolError(
            f"{answer.command}: expected {names} lines, received {len(table)}: {list(answer.lines)}",
            hint=DISTURBED,
            code="bad-line",
        )
    return table


def batches(verb: str, words: Iterable[tuple[str, ...]]) -> list[tuple[str, list[tuple[str, ...]]]]:
    """Split `words` (names, or name-value pairs) into command lines of at most 70 characters and 18 arguments."""
    lines: list[tuple[str, list[tuple[str, ...]]]] = []
    for item in words:
        text, items = lines[-1] if lines else ("", [])
        longer = " ".join([text, *item])
        if items and len(longer) <= MAX_LINE and sum(map(len, items)) + len(item) <= MAX_ARGUMENTS:
            lines[-1] = (longer, [*items, item])
        else:
            lines.append((" ".join([verb, *item]), [item]))
    return lines


def sign(data: bytes) -> str:
    """What in `data` shows a BarrettHand: its prompt, or an ERR line, at the beginning of a line (barrett §5.2)."""
    for line in data.replace(b"\r", b"\n").split(b"\n"):
        if line.startswith(PROMPT) or (line.startswith(b"ERR ") and line[4:].strip().isdigit()):
            return f"the line {line[:20].decode('ascii', 'replace').strip()!r} of a BarrettHand"
    return ""


def status_in(came: bytes) -> int:
    """The status of an answer whose echo is not looked at, 0 when it has none."""
    words = came.split()
    place = words.index(b"ERR") if b"ERR" in words else -1
    number = words[place + 1] if 0 <= place < len(words) - 1 else b"0"
    return int(number) if number.isdigit() and len(number) <= 10 else 0
