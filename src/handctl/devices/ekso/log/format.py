"""The columns of a log of GetData: how a word becomes text, and text becomes the word again.

One row per good GetData. The quantities come from the map; only the two words that make BootTime and the one that is
also told in words are named here. Knows no device, no clock and no file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

from handctl.devices.ekso.map import DATA, Word, state_text
from handctl.record.source import MARK, Layout, Stamp, lead, quoted

LEAD = lead("boot_ms")
"""Names and decimals of the leading columns."""
SUFFIXES = {"deg": "deg", "in": "in", "A": "a"}
"""Unit -> ending of a column's name. A quantity with decimals and another unit has none, one without decimals is raw."""
BOOT_WORDS = ("boot_time_high", "boot_time_low")
NAMED = "state"
"""The quantity that is also told in words, in a column of its own."""


def column_of(quantity: Word) -> str:
    """Name of its column, the unit in it: ``torso_pitch_deg``."""
    if not quantity.decimals:
        return f"{quantity.name}_raw"
    suffix = SUFFIXES.get(quantity.unit or "")
    return f"{quantity.name}_{suffix}" if suffix else quantity.name


def text_of(quantity: Word, number: int) -> str:
    """The text of an integer in the field's own sign, with exactly as many decimals as the wire has."""
    return f"{number / 10**quantity.decimals:.{quantity.decimals}f}" if quantity.decimals else str(number)


def parse(quantity: Word, text: str) -> int:
    """The integer (see `Word.raw_of`) whose text this is. Raises ValueError for any other spelling."""
    number = parse_fixed(text, quantity.decimals)
    if text_of(quantity, quantity.raw_of(number)) != text:
        raise ValueError(f"{text!r} does not fit 16 bit")
    return number


def parse_fixed(text: str, decimals: int) -> int:
    """A number with exactly `decimals` decimals, as an integer of its last decimal. Raises ValueError."""
    pattern = rf"-?[0-9]+\.[0-9]{{{decimals}}}" if decimals else "-?[0-9]+"
    if len(text) > 32 or not re.fullmatch(pattern, text, re.ASCII):
        raise ValueError(f"{text!r} is not a number with {decimals} decimals")
    return int(text.replace(".", ""))


class RowLayout(Layout):
    """The columns of one file: those of GetData in wire order, with `raw` also its words as they came."""

    def __init__(self, *, raw: bool) -> None:
        self.shown = tuple(quantity for quantity in DATA if quantity.name not in BOOT_WORDS)
        self.columns = tuple(column_of(quantity) for quantity in self.shown)
        self.raw = raw
        names = [name for name, _ in LEAD]
        for quantity in self.shown:
            names += [column_of(quantity), f"{NAMED}_name"] if quantity.name == NAMED else [column_of(quantity)]
        names.append(MARK)
        if raw:
            names += [f"raw_{quantity.word:02d}_{quantity.name}" for quantity in DATA]
        self.names = tuple(names)

    def as_rows(self) -> list[dict[str, Any]]:
        """The columns of GetData as the sidecar explains them."""
        return [
            {"column": column, "name": q.name, "word": q.word, "unit": q.unit, "type": q.type_name}
            for q, column in zip(self.shown, self.columns, strict=True)
        ]

    def line(self, stamp: Stamp, values: Sequence[int], mark: str) -> str:
        """One row of the 27 words."""
        texts = stamp.texts()
        for quantity in self.shown:
            number = quantity.raw_of(values[quantity.word])
            texts.append(text_of(quantity, number))
            if quantity.name == NAMED:
                texts.append(quoted(state_text(number)))
        texts.append(quoted(mark))
        if self.raw:
            texts += [str(word & 0xFFFF) for word in values]
        return ",".join(texts) + "\r\n"


def to_si(column: str, quantity: Word | None) -> tuple[str, Callable[[int], str] | None]:
    """Name of a column in SI units, and how a number becomes text there; None = it stays as it is.

    Inches become metres, exactly; degrees radians with 8 decimals, which still tell neighbouring words apart.
    """
    if quantity is None or quantity.unit not in ("deg", "in") or not quantity.decimals:
        return column, None
    decimals = quantity.decimals
    if quantity.unit == "in":
        return f"{quantity.name}_m", lambda number: f"{number * 254 / 10 ** (decimals + 4):.{decimals + 4}f}"
    return f"{quantity.name}_rad", lambda number: f"{math.radians(number / 10**decimals):.8f}"
