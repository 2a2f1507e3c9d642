"""Bars, sparklines and their time axis out of characters. Knows no device and no terminal."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice, pairwise

from handctl.system.terminal import FINE

SPARKS = "▁▂▃▄▅▆▇█" if FINE else "_.▄█"
BAR_PARTS = " ▏▎▍▌▋▊▉█" if FINE else "    ▌▌▌▌█"
HELD = 1.5
"""A value is shown for so many times the usual interval of its series: beyond it a value was lost."""


def bar(value: float, low: float, high: float, width: int) -> str:
    """A bar of `width` cells between low and high in eighths; with a negative `low` it grows from the zero line."""
    if high <= low:
        return " " * width
    place = (value - low) / (high - low) * width
    if low < 0 < high:
        zero = min(int(-low / (high - low) * width), width - 1)
        cells = round(abs(value) / (high - low) * width)
        drawn = f"{' ' * zero}│{'█' * cells}" if value > 0 else f"{' ' * (zero - cells)}{'█' * min(cells, zero)}│"
        return drawn.ljust(width)[:width]
    full, part = divmod(round(place * 8), 8)
    return ("█" * full + (BAR_PARTS[part] if part else "")).ljust(width)[:width]


def spark(history: Sequence[tuple[float, float]], now: float, span: float, width: int) -> str:
    """The values of the last `span` seconds as a sparkline of `width` cells, scaled to what they span; a gap is blank."""
    return chart(history, now, span, width, 1)[0]


def chart(history: Sequence[tuple[float, float]], now: float, span: float, width: int, high: int) -> list[str]:
    """The same, `high` lines high. What is read more seldom than a cell lasts holds until the next value, if that is in time."""
    cells: list[float | None] = [None] * width
    low, later, after, held = float("inf"), now, width, HELD * _usual(history)
    for t, value in reversed(history):
        place = width - 1 - int((now - t) / span * width)
        if place < 0:
            break
        known = cells[place]
        cells[place] = value if known is None else max(known, value)  # a peak between two cells is not lost
        if later - t <= held:
            cells[place + 1 : after] = [value] * (after - place - 1)
        low, later, after = min(low, value), t, place
    top, levels = max((value for value in cells if value is not None), default=0.0), len(SPARKS)
    low = min(low, top)
    step = (top - low) or 1.0
    places = [-1 if v is None else int((v - low) / step * (levels * high - 1)) for v in cells]
    below = [levels * line for line in reversed(range(high))]
    return ["".join(SPARKS[min(at - under, levels - 1)] if at >= under else " " for at in places) for under in below]


def _usual(history: Sequence[tuple[float, float]]) -> float:
    """Seconds between two of the last values, usually; 0 before there are two."""
    last = [t for t, _ in islice(reversed(history), 10)]
    return sorted(later - t for later, t in pairwise(last))[(len(last) - 2) // 2] if len(last) > 1 else 0.0


def axis(span: float, width: int) -> str:
    """The time axis below sparklines of `width` cells."""
    whole, half = (f"-{seconds:g} s" if seconds < 120 else f"-{seconds / 60:g} min" for seconds in (span, span / 2))
    left = max(1, width // 2 - len(whole))
    last = width - len(whole) - left - len(half)
    if last < len(" now"):
        return f"{whole}{'now':>{width - len(whole)}}" if width > len(whole) + len("now") else ""
    return f"{whole}{' ' * left}{half}{'now':>{last}}"
