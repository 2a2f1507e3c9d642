"""JSON objects <-> bytes of the AIDIN-hand (aidin, TCP/IP information). Sans I/O: knows JSON and the framing, no key and no mode.

Out: one compact object, with its terminator at most 2047 bytes. In: flat objects, glued or cut anywhere, with blanks, line
ends or NUL between them. The manual has no delimiter and no length, so only a closed object counts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from math import inf, isfinite
from typing import Any

from handctl.errors import ProtocolError, UsageError

RECORD_BYTES = "record the bytes with --trace FILE, then read them with `handctl trace show FILE`"
LARGEST_OUT = 2047
"""The hand's buffer has 2048 bytes; whose and of what is not said."""
LONGEST_END = 2
TERMINATORS = {"newline": b"\n", "none": b"", "nul": b"\0", "crlf": b"\r\n"}
"""What may follow an object; white space after an object is JSON, too."""
LARGEST_IN = 65536
LONGEST_STRING = 256
DEEPEST = 8
BETWEEN = b" \t\r\n\0"
NEUTRAL = b"{}"
"""The neutral object: no key, no mode."""

_OUTSIDE = re.compile(rb"[^ \t\r\n0-9+\-.,:\[\]a-zA-Z]")
_INSIDE = re.compile(rb'["\\]|[\x00-\x1f]')
_FLAT = re.compile(
    rb'\{[ \t\r\n0-9+\-.,:\[\]a-zA-Z]*(?:"[^"\\\x00-\x1f]{0,%d}"[ \t\r\n0-9+\-.,:\[\]a-zA-Z]*)*\}'
    % (LONGEST_STRING - 1)
)
"""A whole object of the usual kind, as what the two above find token by token."""

_KEY = re.compile(rb'"[A-Za-z_]\w*"\s*:')

Out = int | float | Sequence[int] | Sequence[float]


class MalformedObject(ProtocolError):
    """Bytes dropped by the decoder, in `data`; `stray`: no object had begun in them; `cut`: one that lost its end."""

    def __init__(self, text: str, data: bytes, *, stray: bool = False, cut: bool = False) -> None:
        super().__init__(text, code="garbage" if stray else "bad-json")
        self.data = data
        self.stray = stray
        self.cut = cut


class WrongNumbers(ProtocolError):
    """An array in which some numbers are none. `numbers` has None in their places, `wrong` why, by place from 0."""

    def __init__(self, numbers: Sequence[int | float | None], wrong: Mapping[int, ProtocolError]) -> None:
        first = next(iter(wrong.values()))
        count = len(numbers)
        text = "; ".join(f"number {place + 1} of {count} {exc.text}" for place, exc in wrong.items())
        super().__init__(text, code=first.code)
        self.numbers = tuple(numbers)
        self.wrong = dict(wrong)


def encode(fields: Mapping[str, Out]) -> bytes:
    """One object without its terminator; integers without, floats always with a decimal point (6 decimals at most).

        {"hand_mode":5,"maxtorque":800}

    Raises UsageError for a number that JSON does not have and for an object that the hand's buffer cannot hold.
    """
    body = ",".join(f'"{key}":{_value(value)}' for key, value in fields.items())
    data = b"{" + body.encode("ascii") + b"}"
    if len(data) + LONGEST_END > LARGEST_OUT:
        raise UsageError(
            f"an object of {len(data)} bytes: the hand accepts at most {LARGEST_OUT}",
            hint="send fewer keys in one object",
            code="too-long",
        )
    return data


def _value(value: Out) -> str:
    if isinstance(value, Sequence):
        return "[" + ",".join(map(str if {*map(type, value)} == {int} else _number, value)) + "]"
    return _number(value)


def _number(value: int | float) -> str:
    if isinstance(value, int):
        return str(int(value))
    if not isfinite(value):
        raise UsageError(f"{value} is not a number that can be sent", hint="nothing was sent", code="not-a-number")
    text = f"{value:.6f}".rstrip("0")
    text = f"{text}0" if text.endswith(".") else text
    return "0.0" if text == "-0.0" else text


class Decoder:
    """Bytes in any pieces -> objects. Keeps at most LARGEST_IN bytes once `next` has returned None."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.taken = self.used = b""
        """The bytes of the object that `next` gave last; all that it used up last, with blanks and what is damaged."""
        self._restart()

    def _restart(self) -> None:
        self._position = self._depth = 0
        self._string = -1  # where the string began in which the scan is, -1 = in none

    @property
    def pending(self) -> bytes:
        """The beginning of an object that has not been closed yet."""
        return bytes(self._buffer)

    def feed(self, data: bytes) -> None:
        """Take bytes as they arrived."""
        self._buffer += data

    def next(self) -> dict[str, object] | None:
        """The next object, None when more bytes are needed.

        Raises MalformedObject, a ProtocolError, for bytes that make none; they are dropped up to the next ``{``.
        """
        self.used = b""
        end = None
        if self._position == 0:
            self._skip()
            if not self._buffer:
                return None
            end = found.end() if (found := _FLAT.match(self._buffer)) else None
        end = end or self._scan()
        if end is None:
            return None
        data = bytes(self._buffer[:end])
        try:
            content = _parse(data)
        except Twice as exc:
            raise self._drop(str(exc)) from exc
        if content is None:
            raise self._drop("an object that is not JSON")
        self.taken = data
        self._use(end)
        self._restart()
        return content

    def _use(self, size: int) -> bytes:
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        self.used += data
        return data

    def _skip(self) -> None:
        if self._buffer.startswith(b"{"):
            return
        rest = self._buffer.lstrip(BETWEEN)
        self._use(len(self._buffer) - len(rest))
        if rest and rest[:1] != b"{":
            place = rest.find(b"{")
            data = self._use(len(rest) if place < 0 else place)
            raise MalformedObject(
                f"{len(data)} byte{'s' * (len(data) != 1)} without the beginning of a JSON object", data, stray=True
            )

    def _scan(self) -> int | None:
        """Where the object ends that the buffer begins with, None when it is not closed yet."""
        buffer = self._buffer
        while True:
            found = (_OUTSIDE if self._string < 0 else _INSIDE).search(buffer, self._position)
            if self._string >= 0 and (found.start() if found else len(buffer)) - self._string > LONGEST_STRING:
                raise self._drop("a string without an end", cut=True)
            if found is None:
                self._position = max(self._position, len(buffer))
                if len(buffer) > LARGEST_IN:
                    raise self._drop(
                        f"an object without an end in {len(buffer)} byte{'s' * (len(buffer) != 1)}", cut=True
                    )
                return None
            token, place, self._position = found[0], found.start(), found.end()
            if self._string >= 0:
                if token == b"\\":
                    self._position += 1
                elif token == b'"':
                    self._string = -1
                else:
                    raise self._drop("a string without an end", cut=True)
            elif token == b'"':
                self._string = place
            elif token == b"{":
                self._open(place)
            elif token == b"}":
                self._depth -= 1
                if self._depth == 0:
                    return self._position
            else:
                raise self._drop("an object that is not JSON")

    def _open(self, place: int) -> None:
        """Count an opening brace. The hand's objects are flat; inside one, a brace must at least stand where JSON has it.

        What was cut off behind a comma takes the next object for a part of itself, until the one after it shows the
        mistake; then the next one is still in the buffer.
        """
        before = bytes(self._buffer[max(0, place - 64) : place]).rstrip()
        if self._depth >= DEEPEST:
            raise self._drop("objects within objects", place)
        if self._depth and not before.endswith((b":", b",", b"[")):
            raise self._drop("an object that was cut off", cut=True)
        self._depth += 1

    def _drop(self, what: str, place: int = 0, *, cut: bool = False) -> MalformedObject:
        """Drop the header only, or up to `place`, so that an object that begins within the rest is still found."""
        place = place or self._buffer.find(b"{", 1)
        data = self._use(len(self._buffer) if place < 0 else place)
        self._restart()
        return MalformedObject(f"{what}: {data[:48]!r}", data, cut=cut)


class Twice(Exception):
    """A key occurs twice in one object, so its value is unknown."""


def _parse(data: bytes) -> dict[str, object] | None:
    """Of bytes that begin with ``{`` and have no NUL behind it, so that they can only be UTF-8."""
    try:
        content = _json().decode(data.decode("utf-8", "surrogatepass"))
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


@cache
def _json() -> Any:
    from json import JSONDecoder

    return JSONDecoder(object_pairs_hook=_each_once)


def _each_once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    content = dict(pairs)
    if len(content) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise Twice(f"an object that contains {_shown(twice)} twice")
    return content


def numbers(
    value: object, count: int, *, int_range: tuple[int, int] | None = None, most: float = inf
) -> tuple[int, ...] | tuple[float, ...]:
    """The numbers of one key: an array of `count`; with `int_range` integers of that range (12.0 is one, too).

    `most`: the largest number that is still finite in the unit to which it is converted.

    Raises ProtocolError naming what is wrong; the other keys of the object may be right all the same, and the other
    numbers of a WrongNumbers.
    """
    if not isinstance(value, list):
        raise ProtocolError(
            f"expected an array of {count} numbers, found {_shown(value)}", hint=RECORD_BYTES, code="bad-type"
        )
    if len(value) != count:
        raise ProtocolError(f"expected {count} numbers, found {len(value)}", hint=RECORD_BYTES, code="bad-length")
    kinds = {*map(type, value)}
    if int_range is None and kinds == {float} and isfinite(sum(value)) and -most <= min(value) and max(value) <= most:
        return tuple(value)  # as nearly all are; what is not is looked at below
    if int_range is not None and kinds == {int} and int_range[0] <= min(value) and max(value) <= int_range[1]:
        return tuple(value)
    found: list[int | float | None] = []
    wrong: dict[int, ProtocolError] = {}
    for place, single in enumerate(value):
        try:
            number = _checked(single, int_range, most)
            found.append(int(number) if int_range is not None else number)
        except ProtocolError as exc:
            found.append(None)
            wrong[place] = exc
    if wrong:
        raise WrongNumbers(found, wrong)
    return tuple(found)  # type: ignore[return-value]  # none is None


def _checked(single: object, int_range: tuple[int, int] | None, most: float) -> float:
    if isinstance(single, bool) or not isinstance(single, int | float):
        raise ProtocolError(f"is not a number: {_shown(single)}", hint=RECORD_BYTES, code="bad-type")
    try:
        number = float(single)
    except OverflowError:
        number = inf
    if not isfinite(number) or abs(number) > most:
        raise ProtocolError(f"is not finite: {_shown(single)}", hint=RECORD_BYTES, code="not-finite")
    if int_range is not None and (number != int(number) or not int_range[0] <= number <= int_range[1]):
        raise ProtocolError(
            f"is {_shown(single)}, not an integer from {int_range[0]} to {int_range[1]}",
            hint=RECORD_BYTES,
            code="bad-type",
        )
    return number


def _shown(value: object) -> str:
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 1 << 64:
        return "a very long integer"  # its digits may be more than Python prints
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def sign(data: bytes) -> str:
    """What in `data` shows an AIDIN-hand: JSON, which no other family speaks."""
    found = _KEY.search(data)
    return f"JSON ({found.group().decode('ascii', 'replace')} …)" if found else ""
