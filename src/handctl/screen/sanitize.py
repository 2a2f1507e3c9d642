"""Make text safe to show: terminal, CSV, plain values, messages. JSON is not changed here: it is lossless.

A device, a file, the environment and a peer may hold anything: an escape sequence that fills the clipboard, a bidi mark
that turns a line round, a byte that is not UTF-8. `shown` spells such characters out. `encodable` names what stands in
for a character that the encoding of stdout or stderr lacks. Imports next to nothing: help loads it.
"""

from __future__ import annotations

import codecs
import contextlib
import sys

from handctl.system.waits import CHANGES_LINE_ENDS

_NAMED = {"\t": "\\t", "\n": "\\n", "\r": "\\r"}
_SUBSTITUTES = {
    "°": "deg ", "…": "...", "§": "sec.", "×": "x", "·": ".", "→": "->", "±": "+-", "−": "-", "–": "-", "—": "-",
    "≤": "<=", "≥": ">=", "≈": "~", "µ": "u", "²": "^2", "‘": "'", "’": "'", "“": '"', "”": '"',
    **dict.fromkeys("█▉▊▋▌", "#"), **dict.fromkeys("▍▎▏▕│┃", "|"), **dict.fromkeys("─━", "-"),
    **dict(zip("▁▂▃▄▅▆▇", "__..--=", strict=True)),
}  # fmt: skip
LONGEST = 3000
"""Characters of a line of a message: what came may be of any length, and a screen is not. JSON has all of it."""
FORMULA = ("=", "+", "-", "@")
"""A spreadsheet takes a cell that begins so for a formula."""


def shown(text: str, keep: str = "") -> str:
    """`text` with control characters, C1, bidi and zero-width marks, and bytes that are no text, spelled out: ``\\x1b``.

    Characters in `keep` stay, such as a newline in a text of several lines.
    """
    if text.isprintable() or (keep and text.translate(dict.fromkeys(map(ord, keep))).isprintable()):
        return text
    return text.translate({ord(one): _spelled(one) for one in set(text) if not (one.isprintable() or one in keep)})


def short(line: str) -> str:
    """A line for people, of at most LONGEST characters and what is said of the rest."""
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 200]} … ({len(line)} characters) … {line[-100:]}"


def text_shown(text: str) -> str:
    """The same for a finished text of several lines, such as a file for another program: tabs and both line ends stay."""
    if text.replace("\r\n", "").replace("\n", "").replace("\t", "").isprintable():
        return text
    return "\r\n".join(shown(part, keep="\n\t") for part in text.split("\r\n"))


def _spelled(letter: str) -> str:
    number = ord(letter)
    if letter.isspace() and number >= 0xA0 and number not in (0x2028, 0x2029):
        return " "  # a space of another width
    if 0xDC80 <= number <= 0xDCFF:
        number -= 0xDC00  # a byte of an argument, a path or a variable that is not UTF-8
    if letter in _NAMED:
        return _NAMED[letter]
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"


def text_of(value: object) -> str:
    """A value as CSV, plain and tables have it: "" for null."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)


def value_shown(value: object) -> object:
    """The same for what a row may hold: texts, and lists or dicts with texts in them."""
    if isinstance(value, str):
        return shown(value)
    if isinstance(value, list | tuple):
        return [value_shown(one) for one in value]
    if isinstance(value, dict):
        return {shown(str(key)): value_shown(one) for key, one in value.items()}
    return value


def encodable(error: UnicodeError) -> tuple[str, int]:
    """An error handler for streams: the substitute of each character that the encoding lacks (``deg `` for the degree sign).

    A character without one is spelled out.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = error.object[error.start : error.end]
    return "".join(_SUBSTITUTES.get(letter) or _spelled(letter) for letter in letters), error.end


def no_formula(text: str) -> str:
    """`text` for a CSV cell with a quote before what a spreadsheet would calculate; numbers stay numbers."""
    if not text.startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


# -- stdout and stderr of this process ---------------------------------------------------------------------------------


ERRORS = "handctl"
"""Name of our error handler for streams."""


def substitute_what_is_missing() -> None:
    """A character that the encoding of stdout or stderr lacks gets a substitute, never an error.

    On Windows, pipes and files get UTF-8 and plain line ends too.
    """
    codecs.register_error(ERRORS, encodable)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            plain = {"encoding": "utf-8", "newline": "\n"} if CHANGES_LINE_ENDS and not stream.isatty() else {}
            reconfigure(errors=ERRORS, **plain)


def utf8_stdout() -> None:
    """From now on stdout is UTF-8 with plain newlines, whatever the locale says: JSON is that everywhere."""
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None and ((sys.stdout.encoding or "").lower() != "utf-8" or CHANGES_LINE_ENDS):
        with contextlib.suppress(OSError):  # it flushes: what cannot be written is told when the data are
            reconfigure(encoding="utf-8", errors="strict", newline="\n")
