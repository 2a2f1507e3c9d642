"""The outline of a device as SVG: its fingers or joints in their place, with their values. Colours come from the page's style."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.charts.curves import escape
from handctl.model.outline import BarWithValue, Outline, bars_with_values, title
from handctl.model.result import Row

ACROSS, DOWN, WIDE, EDGE = 62, 17, 26, 34
"""Of a bar: from one to the next, a row, its width; and the room for words above and below."""
LEAST = 6 * ACROSS
"""A picture of few bars is no larger than that of a hand."""


def outline_svg(outline: Outline, by: str, rows: Sequence[Row], words: str = "") -> str:
    """The picture, coloured by one of its quantities; `words` in front of its name. "" where no row is of a bar."""
    bars = bars_with_values(outline, by, rows)
    if not any(one.row for one in bars):
        return ""
    top = max(0, *(one.bar.foot + max(0, one.bar.length) for one in bars))
    low = min(-outline.palm, *(one.bar.foot + min(0, one.bar.length) for one in bars))
    palm = [number for number, one in enumerate(bars) if one.bar.foot == 0]
    width, height = ACROSS * len(bars), (top - low) * DOWN + 2 * EDGE
    across = max(width, LEAST)
    said = f"{words} {title(outline, by, rows)}".strip()
    pieces = []
    if outline.palm and palm:
        x, size = palm[0] * ACROSS + 6, (palm[-1] - palm[0] + 1) * ACROSS - 12
        pieces.append(
            f'<rect class="palm" x="{x}" y="{EDGE + top * DOWN}" width="{size}" height="{outline.palm * DOWN}" rx="10"/>'
        )
    for number, one in enumerate(bars):
        pieces.append(_bar(one, number * ACROSS + ACROSS / 2, EDGE + (top - one.bar.foot) * DOWN))
    told = ", ".join(f"{one.bar.part} {one.text}" for one in bars)
    return (
        f'<figure class="outline"><svg viewBox="{(width - across) / 2:g} 0 {across} {height}" role="img" aria-label="{escape(f"{said}: {told}")}">'
        f"{''.join(pieces)}</svg><figcaption>{escape(said)}<span>{escape(outline.note)}</span></figcaption></figure>\n"
    )


def _bar(one: BarWithValue, middle: float, foot: float) -> str:
    """One bar with its value at the tip and its name at the other end."""
    long = abs(one.bar.length) * DOWN - 3
    up = one.bar.length > 0
    full = max(WIDE / 2, long * one.share)

    def box(size: float, name: str) -> str:
        y = foot - size if up else foot + 3
        return f'<rect class="{name}" x="{middle - WIDE / 2:g}" y="{y:g}" width="{WIDE}" height="{size:g}" rx="{WIDE / 2:g}"/>'

    tip = foot - long - 6 if up else foot + long + 16
    name = foot + 14 if up else foot - 4
    part = one.bar.part.replace("thumb_", "")
    return (
        f"{box(long, 'free')}{box(full, f'{one.tone} bar')}"
        f'<text class="value" x="{middle:g}" y="{tip:g}">{escape(one.text)}</text>'
        f'<text x="{middle:g}" y="{name:g}">{escape(part)}</text>'
    )
