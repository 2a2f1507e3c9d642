"""Parse numbers strictly. Python accepts the digits of every script, and raises for more than 4,300 of them."""

from __future__ import annotations

MOST = 18
"""Digits: more than any number here has, and none that two programs take for different ones."""


def number_in(text: str) -> int | None:
    """The number that these digits are, from 0; None when they are no ASCII digits, or more than `MOST`."""
    return int(text) if text.isascii() and text.isdigit() and len(text) <= MOST else None


def real_in(text: str) -> float:
    """The number that this is; nan, which lies in no range, when it is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def whole(text: str, low: int, high: int) -> int:
    """A whole number from low to high, as a control command or a state file has it. Raises ValueError."""
    digits = number_in(text.removeprefix("-"))
    number = -digits if digits is not None and text.startswith("-") else digits
    if number is None or not low <= number <= high:
        raise ValueError(f"{text!r} is not a whole number from {low} to {high}")
    return number


def typed_number(text: str, decimals: int = 0) -> int | float:
    """The number that a person typed: a whole one, also in hex (``0x1F``), or one with at most `decimals`. Raises ValueError."""
    if "_" in text:
        raise ValueError(text)  # Python's digit grouping is nobody's input
    if not decimals:
        return int(text, 0) if text.lower().lstrip("+-").startswith("0x") else int(text, 10)
    from decimal import Decimal, InvalidOperation

    try:
        value = Decimal(text)
    except InvalidOperation as exc:
        raise ValueError(text) from exc
    if not value.is_finite() or abs(value) > 10**9 or value != round(value, decimals):
        raise ValueError(text)
    return float(value)
