"""What may have been meant by a name that is not known."""

from __future__ import annotations

from collections.abc import Iterable


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
