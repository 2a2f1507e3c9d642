"""Curves as SVG: a small picture of each element for a report, a panel of a whole quantity with axes for `handctl plot`.

A curve is a row of moments with the lowest and highest value of each, and holes. However many samples there were, a picture
has those two of each of its pixels. Colours come from the style of the page, or of the picture itself. Knows no file.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from html import escape as escape_markup
from math import floor, log10
from typing import NamedTuple

from handctl.model.device_picture import BarWithValue, Outline, bars_with_values, title
from handctl.model.result import Row, Sample

# -- the outline of a device: its fingers or joints in their place, with their values ------------------------------


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


WIDTH, HEIGHT, MARGIN = 180, 48, 4
FINEST = 8
"""The picture's height is at least so many steps of the last digit: the flicker of one step must not look like a movement."""
FINEST_PART = 0.01
"""The same where the digits do not tell the step: part of the largest value."""
MOST_LABELS = 3
MOST_PLACES = 2048
"""Of a curve, several times the pixels of its picture; what is longer has the lowest and highest value of some moments at once."""
PARTS = ("finger", "element", "motor")

Place = tuple[float, float, float]
"""A moment, or a pixel, with its lowest and highest value."""


def escape(text: str) -> str:
    """Text for the page: no markup, and nothing that HTML cannot hold."""
    if not text.isprintable():
        lost = {letter for letter in set(text) if not (letter.isprintable() or letter == "\n")}
        text = text.translate(dict.fromkeys(map(ord, lost), "\N{REPLACEMENT CHARACTER}"))
    return escape_markup(text)


class Curve:
    """One element over time: stretches of (seconds, lowest, highest), a new one behind each hole."""

    def __init__(self, name: str, part: str = "", unit: str = "", decimals: int = 0) -> None:
        self.name = name
        self.part = part
        self.unit = unit
        self.decimals = decimals
        self.labels: dict[str, None] = {}
        self.runs: list[list[Place]] = [[]]
        self._places, self._step = 0, 0.0
        self.count = self.failed = 0
        self.low = self.high = self.last = float("nan")

    def add(self, t: float, low: float, high: float, last: float, count: int = 1) -> None:
        """The values of a moment, of which there were `count`."""
        self._put(t, low, high)
        if self._places > MOST_PLACES:
            self._widen(t)
        self.low, self.high = (min(self.low, low), max(self.high, high)) if self.count else (low, high)
        self.count += count
        self.last = last

    def _put(self, t: float, low: float, high: float) -> None:
        """A place of its own, or part of the last one where both are as good as at one moment."""
        before = self.runs[-1] or self.runs[len(self.runs) > 1 and -2]
        apart = t // self._step - before[-1][0] // self._step if self._step and before else 2.0
        if apart <= 1 and not self.runs[-1]:
            self.runs.pop()  # a hole that nobody would see
        if apart < 1:
            start, lowest, highest = before[-1]
            before[-1] = start, min(low, lowest), max(high, highest)
        else:
            self.runs[-1].append((t, low, high))
            self._places += 1

    def _widen(self, t: float) -> None:
        """Half as many places, up to `t`: however long a watch is, it needs no more memory."""
        self._step = max(2 * self._step, 2 * t / MOST_PLACES)
        runs, self.runs, self._places = self.runs, [[]], 0
        for run in runs:
            self.hole()
            for place in run:
                self._put(*place)

    def hole(self) -> None:
        """The curve does not go on from here to the next value."""
        if self.runs[-1]:
            self.runs.append([])

    def take(self, t: float, row: Row) -> None:
        """The row of a moment; where it was not read there is a hole."""
        value = row.get("value")
        if isinstance(value, int | float) and not isinstance(value, bool):
            self.add(t, value, value, value)
        else:
            self.failed += 1
            self.hole()
        if row.get("label"):
            self.labels[str(row["label"])] = None

    @property
    def moved(self) -> bool:
        """Whether it had more than one value."""
        return self.count > 0 and self.low != self.high

    def text(self, value: float) -> str:
        """A value with its decimals."""
        whole = value == int(value) and not self.decimals
        return f"{value:.{self.decimals}f}" if self.decimals or whole else f"{value:.6g}"

    @property
    def meaning(self) -> str:
        """What its values mean in words, as long as that is short."""
        return ", ".join(self.labels) if len(self.labels) <= MOST_LABELS else ""

    @property
    def summary(self) -> str:
        """``min 12, max 15, last 14``, ``14 all the time``, ``not read``."""
        if not self.count:
            return "not read"
        text = f"{self.text(self.last)} all the time"
        if self.moved:
            text = f"min {self.text(self.low)}, max {self.text(self.high)}, last {self.text(self.last)}"
        return f"{text}, {self.failed} of {self.count + self.failed} not read" if self.failed else text

    @property
    def ends(self) -> tuple[float, float]:
        """The lower and the upper end of a picture of it."""
        if not self.count:
            return 0.0, 0.0
        whole = all(value == int(value) for value in (self.low, self.high, self.last))
        finest = FINEST * 10.0**-self.decimals
        if not self.decimals and not whole:
            finest = FINEST_PART * max(abs(self.low), abs(self.high))
        more = max(0.0, finest - (self.high - self.low)) / 2
        return self.low - more, self.high + more


class Curves:
    """The curves of a stream of any length. `count`: of its samples; `seconds`: of the last one."""

    def __init__(self, decimals: Mapping[str, int]) -> None:
        self._decimals = decimals
        self._found: dict[tuple[str, str], Curve] = {}
        self.count, self.seconds = 0, 0.0

    def take(self, sample: Sample) -> None:
        """The rows of a moment."""
        self.count, self.seconds = self.count + 1, sample.t
        for row in sample.rows:
            name, part = str(row["name"]), " ".join(str(row[key]) for key in PARTS if row.get(key))
            if (name, part) not in self._found:
                unit = str(row.get("unit") or "")
                self._found[name, part] = Curve(name, part, unit, self._decimals.get(name, 0))
            self._found[name, part].take(sample.t, row)

    @property
    def groups(self) -> dict[str, list[Curve]]:
        """Quantity -> its elements' curves, in the order of the rows."""
        groups: dict[str, list[Curve]] = {}
        for curve in self._found.values():
            groups.setdefault(curve.name, []).append(curve)
        return groups


def unchanged(curves: Iterable[Curve], words: Collection[str] = ()) -> str:
    """The curves that had one value all the time, in a line: each value once where all parts have the same.

    Of the quantities in `words` the label is shown.
    """
    values: dict[str, dict[str, str]] = {}
    for curve in curves:
        if not curve.moved:
            value = f"{curve.text(curve.last)} {curve.unit}".strip() if curve.count else "not read"
            worded = curve.meaning if curve.name in words else ""
            values.setdefault(curve.name, {})[curve.part] = worded or value
    return "; ".join(f"{name} {_listed(texts)}" for name, texts in values.items())


def _listed(texts: Mapping[str, str]) -> str:
    """Values by part: one where all are the same, their number where they are many."""
    alike = set(texts.values())
    if len(alike) == 1:
        return alike.pop()
    return f"({len(texts)} values)" if len(texts) > TONES else ", ".join(map(" ".join, texts.items()))


def draw(curve: Curve, seconds: float) -> str:
    """A small picture of a curve over `seconds`."""
    label = f"{curve.name} {curve.part}".strip() + f" over {seconds:.1f} s: {curve.summary}"
    box = Box(MARGIN, MARGIN + 1, WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN - 2, seconds, *curve.ends)
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label)}">'
        f'<path class="axis" d="M{MARGIN} {HEIGHT - 1}H{WIDTH - MARGIN}"/>{box.line(curve)}</svg>'
    )


class Box(NamedTuple):
    """Where a curve is drawn: the place and size of its rectangle, and the seconds and values that this spans."""

    left: float
    top: float
    width: float
    height: float
    seconds: float
    low: float
    high: float

    def x(self, t: float) -> float:
        """The place of a moment."""
        return self.left + (t / self.seconds if self.seconds > 0 else 0.5) * self.width

    def y(self, value: float) -> float:
        """The place of a value."""
        span = self.high - self.low
        return self.top + (1 - (value - self.low) / span if span > 0 else 0.5) * self.height

    def line(self, curve: Curve, tone: str = "curve") -> str:
        """The curve: of each pixel the lowest and the highest value; a dot where there is one alone."""
        return "".join(self._stretch(run, tone) for run in curve.runs if run)

    def _stretch(self, run: Sequence[Place], tone: str) -> str:
        cells: dict[int, Place] = {}
        for t, low, high in run:
            x = self.x(t)
            _, lowest, highest = cells.get(int(x), (x, low, high))
            cells[int(x)] = (x if len(run) <= self.width else int(x), min(low, lowest), max(high, highest))
        places: list[str] = []
        for x, low, high in cells.values():
            places += (f"{x:.5g},{self.y(end):.4g}" for end in ((low,) if low == high else (low, high)))
        if len(places) == 1:
            across, down = places[0].split(",")
            return f'<circle class="{tone}" cx="{across}" cy="{down}" r="1.5"/>'
        return f'<polyline class="{tone}" points="{" ".join(places)}"/>'


# -- panels with axes -----------------------------------------------------------------------------------------------


SIDE, TALL, LEFT, RIGHT, HEAD, FOOT = 960, 120, 70, 14, 26, 22
"""A picture's width, a panel's height, and the room around panels."""
PIXELS = SIDE - LEFT - RIGHT
MOST_LETTERS = 40
"""Of a mark in a picture; what is longer is shown where the pointer rests on it."""
MINUTES = 300
"""From so many seconds on, times are minutes and seconds."""
TONES = 8
"""Curves of one picture: each has a colour."""
STYLE = (
    "text{font:12px system-ui,sans-serif;fill:var(--fg,#1c2126)}.small{font-size:11px;fill:var(--dim,#57606a)}"
    ".head{font-weight:600;font-size:14px}.axis{stroke:var(--line,#d4d9df);fill:none}.hole{fill:var(--dim,#57606a);opacity:.18}"
    ".mark{stroke:var(--dim,#57606a);stroke-dasharray:3 3}.end{text-anchor:end}.mid{text-anchor:middle}"
    ".said{paint-order:stroke;stroke:var(--bg,#fff);stroke-width:3px}"
    "polyline{fill:none;stroke-width:1.2;stroke-linejoin:round;stroke-opacity:.85}"
    + "".join(
        f".c{number}{{stroke:{tone}}}circle.c{number},rect.c{number},polygon.c{number}{{fill:{tone}}}"
        for number, tone in enumerate(
            ("#2f74c0", "#d9730d", "#2e9e5b", "#b8439a", "#8a6d00", "#7b5cd6", "#c43c3c", "#0f8f99")
        )
    )
)
"""Of a picture with panels; the tones are seen on white and on black."""


class Strip(NamedTuple):
    """What one recording adds to a picture: its name ("" = it is the only one), curves by part, holes and marks in seconds."""

    name: str
    curves: Mapping[str, Curve]
    holes: Sequence[tuple[float, float]] = ()
    marks: Sequence[tuple[float, str]] = ()


def picture(title: str, strips: Sequence[Strip], seconds: float, top: int = 0) -> tuple[str, int]:
    """The SVG of a quantity, a panel for each recording with the same axes; and its height."""
    parts = list(dict.fromkeys(part for strip in strips for part in strip.curves))
    drawn = [curve for strip in strips for curve in strip.curves.values() if curve.count]
    low, high = min(curve.ends[0] for curve in drawn), max(curve.ends[1] for curve in drawn)
    pieces = [f'<text class="head" x="0" y="14">{escape(title)}</text>']
    legend, x = [part for part in parts if part], 12 + 8 * len(title)
    for part in legend:
        pieces.append(f'<rect class="c{parts.index(part) % TONES}" x="{x}" y="5" width="10" height="10"/>')
        pieces.append(f'<text x="{x + 14}" y="14">{escape(part)}</text>')
        x += 30 + 7 * len(part)
    for number, strip in enumerate(strips):
        box = Box(
            LEFT, HEAD + number * (TALL + 10), PIXELS, TALL, seconds, low - (high - low) / 20, high + (high - low) / 20
        )
        lines = [box.line(curve, f"c{parts.index(part) % TONES}") for part, curve in strip.curves.items()]
        pieces += [*_axes(strip, box), *lines, *_words(strip, box, named=len(strips) > 1)]
    bottom = HEAD + len(strips) * (TALL + 10) - 10
    for t in times(seconds):
        x_ = LEFT + (t / seconds * PIXELS if seconds else PIXELS / 2)
        pieces.append(f'<text class="small mid" x="{x_:.1f}" y="{bottom + 14}">{moment(t, seconds)}</text>')
    height = bottom + FOOT
    label = f"{title}: {', '.join(legend) or 'one curve'}, {moment(seconds, seconds)}"
    place = f' y="{top}" width="{SIDE}" height="{height}"' if top else ""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg"{place} viewBox="0 0 {SIDE} {height}" role="img" '
        f'aria-label="{escape(label)}">{"".join(pieces)}</svg>\n',
        height,
    )


def _axes(strip: Strip, box: Box) -> Iterator[str]:
    """What is below the curves: values, and the holes of a recording."""
    for value in ticks(box.low, box.high, 4):
        y = box.y(value)
        yield f'<path class="axis" d="M{box.left} {y:.1f}H{box.left + box.width}"/>'
        yield f'<text class="small end" x="{box.left - 6}" y="{y + 4:.1f}">{value:.6g}</text>'
    for start, end in strip.holes:
        x = box.x(start)
        size = f'x="{x:.1f}" y="{box.top}" width="{max(1.0, box.x(end) - x):.1f}" height="{box.height}"'
        yield f'<rect class="hole" {size}><title>no rows from {start:.3f} s to {end:.3f} s</title></rect>'


def _words(strip: Strip, box: Box, *, named: bool) -> Iterator[str]:
    """What is above the curves: marks, and which recording it is."""
    bottom = box.top + box.height
    for t, text in strip.marks:
        x, late = box.x(t), box.x(t) > box.left + box.width * 0.8
        yield f'<path class="mark" d="M{x:.1f} {box.top}V{bottom}"><title>{escape(text)}, {t:.3f} s</title></path>'
        place = f'class="small said{" end" if late else ""}" x="{x + (-3 if late else 3):.1f}" y="{box.top + 10}"'
        yield f"<text {place}>{escape(text[:MOST_LETTERS])}</text>"
    if named:
        yield f'<text class="small said" x="{box.left + 4}" y="{bottom - 5}">{escape(strip.name)}</text>'


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round values between `low` and `high`, at most about `most`."""
    if not high > low:
        return [low]
    rough = (high - low) / most
    base: float = 10.0 ** floor(log10(rough))
    step = next(base * times for times in (1, 2, 5, 10) if base * times >= rough * 0.999)
    first = -floor(1e-9 - low / step)
    return [round(number * step, 12) for number in range(first, floor(high / step + 1e-9) + 1)]


def times(seconds: float) -> list[float]:
    """Round moments from 0 to `seconds`, about eight of them."""
    step = next((step for step in (60, 120, 300, 600, 1800, 3600, 7200, 14400) if step * 9 >= seconds), 86400)
    return ticks(0, seconds, 8) if seconds < MINUTES else [float(t) for t in range(0, int(seconds) + 1, step)]


def moment(t: float, seconds: float) -> str:
    """A time since the start: seconds, or minutes and seconds where a recording is long."""
    return f"{t:g} s" if seconds < MINUTES else f"{int(t // 60)}:{int(t % 60):02} min"
