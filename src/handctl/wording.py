"""Wording of messages: capital and full stop, plurals, bytes and times as text, spelling slips."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import lru_cache

from handctl.errors import reworded, typed
from handctl.families import FAMILIES

NAMES = frozenset(
    {"handctl", "stdin", "stdout", "stderr", "socketcan", "slcan", "id", "ids", "maxtorque", "brltty", *FAMILIES}
)
"""Written as they are typed, also where they come first. Another name that is also a word stands in backquotes."""
IN_NAMES = frozenset("/\\=_~$*<>|@#:.")
"""Characters of paths, links, commands and names in code: behind them a full stop would be read as part."""


def sentence(text: str) -> str:
    """`text` with a capital where it begins with an ordinary word, and a full stop where it ends without punctuation."""
    first = text.split(" ", 1)[0]
    word = first.rstrip(",;")
    plain = word.replace("-", "").replace("'", "")
    ordinary = plain.isascii() and plain.isalpha() and plain.islower() and word not in NAMES and word not in typed
    if ordinary and not text.startswith(f"{word}, line "):
        text = reworded(text, text[0].upper() + text[1:])
    return reworded(text, text + ".") if _open(text) else text


def some(texts: Sequence[str], most: int = 4, joint: str = ", ", last: str = " and") -> str:
    """The first of several, and how many more there are."""
    return joint.join(texts[:most]) + (f"{last} {len(texts) - most} more" if len(texts) > most else "")


def frame_text(data: bytes, can_id: int | None) -> str:
    """Bytes as the field writes them: ``EB 90 01 …``, or ``15038001 [4] E8 03 18 FC`` on CAN."""
    text = data.hex(" ").upper()
    return text if can_id is None else f"{can_id:08X} [{len(data)}] {text}".rstrip()


def plural(number: int, noun: str) -> str:
    """``1 finding``, ``2 findings``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _open(text: str) -> bool:
    """Whether a full stop is missing and would not be read as part of the text before it."""
    words = text.split()
    if not words or text[-1] in ".!?:;,…" or text[-1].isspace():
        return False
    last, before = words[-1], words[-2] if len(words) > 1 else ""
    if last[-1] in "`'\")]}%°":
        return True
    if last.startswith("-") or (before.startswith("-") and before != "-"):
        return False
    number = last.replace(".", "", 1).isdecimal() or (last.endswith("/s") and before.replace(".", "", 1).isdecimal())
    return number or not IN_NAMES & set(last)


@lru_cache(8)
def utc(seconds: float, decimals: int = 0) -> str:
    """The time of day as results have it, ISO 8601: seconds since 1970 -> ``2026-11-20T14:05:37Z``, with `decimals` of a second."""
    whole = round(seconds * 10**decimals)
    part = f".{whole % 10**decimals:0{decimals}d}" if decimals else ""
    return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(whole // 10**decimals)) + f"{part}Z"


CLAIM = r"(?:[,\x3b:.]?\s*)\b(?:and )?nothing (?:was|has been) (?:sent|written)(?: to the device)?\b"


def honest(text: str) -> str:
    """The text without a claim that nothing was sent or written: something was."""
    import re

    return re.sub(CLAIM, "", text, flags=re.IGNORECASE).strip(" ;,:")
