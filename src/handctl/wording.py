"""Wording of messages: capital and full stop, plurals, times as text, spelling slips."""

from __future__ import annotations

import time
from collections.abc import Iterable
from functools import lru_cache

from handctl.errors import reworded
from handctl.families import FAMILIES

NAMES = frozenset(
    {"handctl", "stdin", "stdout", "stderr", "socketcan", "slcan", "id", "ids", "maxtorque", "brltty", *FAMILIES}
)
"""Written as they are typed, also where they come first. Another name that is also a word stands in backquotes."""
_typed: set[str] = set()
"""Links and files of this command: one may be called as a word is, such as ``b``."""
IN_NAMES = frozenset("/\\=_~$*<>|@#:.")
"""Characters of paths, links, commands and names in code: behind them a full stop would be read as part."""


def typed_names(*names: str) -> None:
    """The names that a user gave to things of this command: no message may change them."""
    _typed.clear()
    _typed.update(names)


def sentence(text: str) -> str:
    """`text` with a capital where it begins with an ordinary word, and a full stop where it ends without punctuation."""
    first = text.split(" ", 1)[0]
    word = first.rstrip(",;")
    plain = word.replace("-", "").replace("'", "")
    ordinary = plain.isascii() and plain.isalpha() and plain.islower() and word not in NAMES and word not in _typed
    if ordinary and not text.startswith(f"{word}, line "):
        text = reworded(text, text[0].upper() + text[1:])
    return reworded(text, text + ".") if _open(text) else text


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


def near(word: str, known: Iterable[str], most: int = 3) -> list[str]:
    """Those of `known` that may have been meant: one slip of the finger away, or else those that are alike, the best first."""
    names = list(known)
    if found := slips(word, names):
        return found[:most]
    from difflib import get_close_matches

    plain = {name.casefold(): name for name in names}
    return [plain[one] for one in get_close_matches(word.casefold(), plain, n=most, cutoff=0.6)]


def slips(word: str, known: Iterable[str]) -> list[str]:
    """Those of `known` that are one slip away: a letter too many, too few, another one, or two swapped neighbours."""
    return [name for name in known if _slipped(word.casefold(), name.casefold())]


def _slipped(one: str, other: str) -> bool:
    if len(one) > len(other):
        one, other = other, one
    place = next((at for at, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), len(one))
    if len(one) != len(other):
        return len(other) == len(one) + 1 and one[place:] == other[place + 1 :]
    swapped = one[place : place + 2] == other[place : place + 2][::-1] and one[place + 2 :] == other[place + 2 :]
    return swapped or (len(one) > 2 and one[place + 1 :] == other[place + 1 :])


CLAIM = r"(?:[,\x3b:.]?\s*)\b(?:and )?nothing (?:was|has been) (?:sent|written)(?: to the device)?\b"


def honest(text: str) -> str:
    """The text without a claim that nothing was sent or written: something was."""
    import re

    return re.sub(CLAIM, "", text, flags=re.IGNORECASE).strip(" ;,:")
