"""GCL in words: what a command line asks for, what its answer says (barrett §5). Knows no wire and keeps nothing."""

from __future__ import annotations

from functools import lru_cache

from handctl.devices.barrett.gcl.commands import Command, split
from handctl.devices.barrett.gcl.connecting import QUESTION
from handctl.devices.barrett.gcl.language import Answer, explain_status, motor_prefix, motors_of, values
from handctl.devices.barrett.map import BARRETT, GclParam
from handctl.errors import HandctlError
from handctl.model.param import Number
from handctl.model.piece import Part, Value

MARK = QUESTION[:1].decode()
"""The question of a connect without what no motor moves by; ERR 32 is how a hand says that it is there."""
UNKNOWN_COMMAND = 32
NAMES = {"\r": "<CR>", "\n": "<LF>", "\x03": "<^C>"}


def shown(data: bytes | bytearray) -> str:
    """Bytes as text, with control characters by name: ``FGET P<CR>``."""
    return "".join(NAMES.get(chr(b), chr(b) if 32 <= b < 127 else f"<{b:02X}>") for b in data)


def lines(data: bytes) -> list[str]:
    """The lines that hold anything, in printable characters."""
    found = data.replace(b"\r", b"\n").split(b"\n")
    return [shown(line) for line in found if line.strip()]


def line_parts(raw: bytes) -> tuple[Part, ...]:
    """An answer line by line: echo, data, status, prompt."""
    parts: list[Part] = []
    start = place = 0
    while place < len(raw):
        while place < len(raw) and raw[place] not in (10, 13):
            place += 1
        while place < len(raw) and raw[place] in (10, 13):
            place += 1
        line = raw[start:place]
        text = shown(line.strip(b"\r\n"))
        words = text.split()
        if line.startswith(b"=>"):
            name, text = "prompt", ""
        elif len(words) == 2 and words[0] == "ERR" and words[1].isdecimal() and len(words[1]) < 11 and parts:
            name, text = "status", f"{words[1]}: {explain_status(int(words[1]))}"
        else:
            name = "line" if parts else "echo" if text else "line end"
        parts.append(Part(line, name, text))
        start = place
    return tuple(parts)


def motors(prefix: str) -> list[str]:
    """``12S`` -> F1, F2, SPREAD; no prefix = all four."""
    return motors_of(motor_prefix(prefix) if prefix else "")


@lru_cache(1024)
def command(text: str) -> tuple[str, str]:
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
    return _texts(param, [int(value)])


def answer(text: str, found: Answer) -> tuple[str, tuple[Value, ...], str]:
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


def _gotten(prefix: str, kind: Command, words: list[str], found: Answer) -> tuple[str, tuple[Value, ...], str]:
    who = motors(prefix) if kind.name == "FGET" else [""]
    texts, carried = [], []
    for word, numbers in zip(words, values(found, len(words), len(who)), strict=False):
        param, name = _param(word), _name(word)
        shown_numbers = _texts(param, numbers) if param is not None else " ".join(map(str, numbers))
        texts.append(f"{name} {shown_numbers}")
        for motor, number in zip(who, numbers, strict=True):
            carried.append(Value(f"{name}.{motor}" if motor else name, number, param.unit if param else None))
    motor_text = f" ({' '.join(who)})" if kind.name == "FGET" else ""
    return f"{', '.join(texts)}{motor_text}" if texts else "", tuple(carried), ""


def _texts(param: GclParam, numbers: list[int]) -> str:
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
