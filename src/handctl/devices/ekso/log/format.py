"""The log file's book: its columns, how a word becomes text and text becomes the word again, the sidecar's name.

One row per good GetData. The quantities come from the map; only the two words that make BootTime and the one that is
also told in words are named here. Knows no device, no clock and no file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from handctl.devices.ekso.log.timeline import Place
from handctl.devices.ekso.map import DATA, Word, state_text

SCHEMA = "handctl-ekso-log/1"
LEAD = ("host_utc_s", "host_mono_s", "boot_ms", "t_s", "segment", "seq", "rtt_ms")
LEAD_DECIMALS = (6, 6, 0, 3, 0, 0, 3)
MARK = "mark"
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


class Stamp(NamedTuple):
    """When a row was taken.

    utc_s   host clock of the day, the middle between request and answer, seconds since 1970
    place   the other clocks, and the segment, which is counted from 1
    seq     number of the request; a request without an answer leaves a hole
    """

    utc_s: float
    place: Place
    seq: int

    def texts(self) -> list[str]:
        """The texts of the leading columns."""
        place = self.place
        return [
            f"{self.utc_s:.6f}",
            f"{place.mono_s:.6f}",
            str(place.boot_ms),
            f"{place.t_ms / 1000:.3f}",
            str(place.segment),
            str(self.seq),
            f"{place.rtt_ms:.3f}",
        ]


class RowLayout:
    """The columns of one file: those of GetData in wire order, with `raw` also its words as they came."""

    def __init__(self, *, raw: bool) -> None:
        self.shown = tuple(quantity for quantity in DATA if quantity.name not in BOOT_WORDS)
        self.columns = tuple(column_of(quantity) for quantity in self.shown)
        self.raw = raw
        names = list(LEAD)
        for quantity in self.shown:
            names += [column_of(quantity), f"{NAMED}_name"] if quantity.name == NAMED else [column_of(quantity)]
        names.append(MARK)
        if raw:
            names += [f"raw_{quantity.word:02d}_{quantity.name}" for quantity in DATA]
        self.names = tuple(names)

    @property
    def header(self) -> str:
        """The first line."""
        return ",".join(self.names) + "\r\n"

    def as_rows(self) -> list[dict[str, str | int | None]]:
        """The columns of GetData as the sidecar explains them."""
        return [
            {"column": column, "name": q.name, "word": q.word, "unit": q.unit, "type": q.type_name}
            for q, column in zip(self.shown, self.columns, strict=True)
        ]

    def line(self, stamp: Stamp, words: Sequence[int], mark: str) -> str:
        """One row."""
        texts = stamp.texts()
        for quantity in self.shown:
            number = quantity.raw_of(words[quantity.word])
            texts.append(text_of(quantity, number))
            if quantity.name == NAMED:
                texts.append(quoted(state_text(number)))
        texts.append(quoted(mark))
        if self.raw:
            texts += [str(word & 0xFFFF) for word in words]
        return ",".join(texts) + "\r\n"


def quoted(text: str) -> str:
    """A text as a CSV field (RFC 4180)."""
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text


def clean(text: str) -> str:
    """A mark as one line: control characters, line ends of any kind among them, become spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


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
