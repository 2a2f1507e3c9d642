"""What differs between two large values, told at once: difflib, which pytest asks, may take hours over a page or a list of some 100 kB.

It cuts short what it shows, but not where `CI` is set.
"""

from __future__ import annotations

from itertools import zip_longest
from typing import Any

from _pytest.assertion import util

LARGE = 20_000
"""Characters of both sides together from which on only the first difference is told."""
AROUND = 60
"""Characters that are shown before and behind it."""


def first_difference(left: object, right: object) -> list[str]:
    """The line in which two texts differ first, or that place in how two other values are written."""
    if isinstance(left, str) and isinstance(right, str):
        lines = zip_longest(left.splitlines(), right.splitlines(), fillvalue="(no such line)")
        for number, (one, other) in enumerate(lines, 1):
            if one != other:
                return [f"line {number} differs", *_around(one, other)]
        return ["the ends of their lines differ"]
    return [f"{type(left).__name__} and {type(right).__name__} differ", *_around(repr(left), repr(right))]


def _around(one: str, other: str) -> list[str]:
    place = next((at for at, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
    first = max(0, place - AROUND)
    return [f"at {place}: {text[first : place + AROUND]!r}" for text in (one, other)]


def size(value: object) -> int:
    return len(value) if isinstance(value, str | bytes) else len(repr(value))


def quickly() -> None:
    """From now on pytest tells of large values so."""
    whole = util.assertrepr_compare

    def told(*args: Any, **how: Any) -> Any:
        left, right, op = how.get("left"), how.get("right"), how.get("op")
        if op == "==" and size(left) + size(right) > LARGE:
            return [f"{size(left):,} characters == {size(right):,} characters", *first_difference(left, right)]
        if op == "not in" and isinstance(right, str) and len(right) > LARGE:
            return [f"{left!r:.200} not in {len(right):,} characters", *_around(right, right.replace(str(left), "", 1))]
        return whole(*args, **how)

    util.assertrepr_compare = told
