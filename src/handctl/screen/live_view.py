"""The live view of a stream: every quantity by finger or joint, its course over time, what is wrong, and the keys.

Works over any device's rows: a series is a name with an element. Quantities that fingers or motors share are one grid,
a row for each of them; all others have a line of their own. What room is left shows the course of the quantities in the
grid. When the window is too low, courses go first, then bars. Imported only when a person looks.
"""

from __future__ import annotations

import contextlib
import sys
from collections import deque
from collections.abc import Generator, Sequence
from datetime import datetime
from itertools import islice, pairwise
from typing import IO, TYPE_CHECKING, NamedTuple

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.text import Text

from handctl import interrupts
from handctl.errors import STOPPED, Interrupted
from handctl.model.reading_limits import severity
from handctl.model.result import Row, Sample, Table
from handctl.screen.csv_output import Wide
from handctl.screen.sanitize import text_shown
from handctl.screen.terminal_tables import console_on, flowing, grid_lines
from handctl.system import clock
from handctl.system.terminal import FINE
from handctl.wording import plural, sentence

if TYPE_CHECKING:
    from handctl.model.reading_limits import Bound
    from handctl.screen.render import Context


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


ENDS = "▕▏" if FINE else "││"
KEPT = 36_000
"""Values of each series: half an hour at 20 Hz."""
SPANS = (10, 30, 60, 300, 1800)
"""Seconds that the courses show, from which + and - choose."""
FRAMES_PER_SECOND = 12
NARROW = 70
"""Below this width a bar's line has no minimum and maximum, no sparkline, and the name stands above it."""
LEAST = 15
"""Room that bar and sparkline need at least, with the ends of the bar; without it the line is that of a narrow window."""
BAR, LONGEST = 12, 60
"""Cells of the shortest and the longest bar in a grid, with its ends."""
SEEN = {"bad": "damaged", "missing": "missing", "skipped": "not shown: newer ones had already arrived"}
"""How a count of values that a device sends unasked is said."""
HIGHEST = 4
"""Lines of a course, where there is room."""
COLUMN = 8
"""Cells of the shortest course in a matrix."""
KEYS = (
    ("q", "quit", "quit (or press Esc). The device stays as it is"),
    ("space", "freeze", "freeze the picture, or continue. A recording is not interrupted"),
    ("r", "record", "record to a new CSV file, or stop recording"),
    ("+ -", "history", "show a longer or shorter period"),
    ("", "stop", "stop the device at once, without asking (capital S)"),
    ("?", "help", "show or hide this help"),
)
"""Key ("" = the stop key of the command), its word for the last line, what it does."""

Key = tuple[str, str, str]
"""Name, part (finger or motor) and element of a series; "" where it has none."""


def key_of(row: Row) -> Key:
    """Which series a row belongs to."""
    part, element = (str(row.get(key) or "") for key in ("finger", "element"))
    part = part or str(row.get("motor") or "")
    return (str(row["name"]), part, element) if part else (str(row["name"]), element, "")


class Series:
    """One quantity's element over time."""

    def __init__(self, row: Row, limits: tuple[float, float] | None, decimals: int) -> None:
        self.name, self.part, self.element = key_of(row)
        self.unit = row.get("scaled_unit") or row.get("unit") or ""
        self._limits = limits
        self._factor = 1.0  # from the wire's unit to a person's
        self.decimals = decimals
        self.bounds: list[Bound] = []
        self.highest: float | None = None
        """The documented value from which on it is bad."""
        self.documented = True
        """Whether the bar's ends are documented, and not ours."""
        self.history: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self.low: float | None = None
        self.high: float | None = None
        self.value: float | None = None
        self.label = ""
        self.doubtful = False

    @property
    def limits(self) -> tuple[float, float] | None:
        """The bar's ends, in the unit that is shown."""
        return None if self._limits is None else (self._limits[0] * self._factor, self._limits[1] * self._factor)

    def add(self, row: Row, t: float) -> None:
        """Take the value of the moment `t`; a failed read leaves a gap."""
        value = row.get("scaled", row.get("value"))
        self.label = text_shown(str(row.get("label") or ""))
        self.doubtful = bool(row.get("doubt"))
        if value and row.get("value"):
            self._factor = value / row["value"]
        self.value = value if isinstance(value, int | float) and not isinstance(value, bool) else None
        if self.value is None or self.doubtful:
            return
        self.history.append((t, self.value))
        self.low = self.value if self.low is None else min(self.low, self.value)
        self.high = self.value if self.high is None else max(self.high, self.value)

    def text(self, value: float | None) -> str:
        """A value with its decimals, "?" for a failed read."""
        if value is None:
            return "?"
        return f"{value:.{self.decimals}f}" if self.decimals else f"{value:.12g}"

    @property
    def span(self) -> str:
        """Lowest and highest value so far, "" before the first."""
        return "" if self.low is None else f"{self.text(self.low)}..{self.text(self.high)}"

    @property
    def state(self) -> int:
        """2 = past a bound that was set or documented, 1 = near one or outside the documented range, 0 = neither."""
        if self.value is None or self.doubtful:
            return 0
        return severity(self.value, self.bounds, self.highest, self.limits if self.documented else None)

    def scale(self) -> tuple[float, float]:
        """The bar's ends: the documented range, widened by what was seen outside it."""
        low, high = self.limits or (0.0, 1.0)
        lowest, highest = (low if self.low is None else self.low), (high if self.high is None else self.high)
        return min(low, lowest), max(high, highest)


class Widths(NamedTuple):
    """Widths in cells of a line with a bar: the window, name, part, value, span (0 in a narrow window)."""

    window: int
    name: int
    part: int
    value: int
    span: int


class View:
    """Draws the latest sample; also a rich renderable, so that the window's size is asked at each drawing."""

    def __init__(self, table: Table, context: Context) -> None:
        self._table = table
        self._rows: list[Row] = []
        self._context = context
        self._link = "" if table.cards else text_shown(context.settings.device or context.link_name()).partition("?")[0]
        self._series: dict[Key, Series] = {}
        self._count = self._lost = 0
        self._seconds = 0.0
        self._failed = ""
        self.keyed = False
        self.frozen = False
        self.helps = False
        self.noted = ""
        """What the last line but one says of a recording."""
        self._span = SPANS[1]

    def zoom(self, step: int) -> None:
        """Show a longer time (1) or a shorter one (-1)."""
        self._span = SPANS[min(max(0, SPANS.index(self._span) + step), len(SPANS) - 1)]

    def add(self, sample: Sample) -> None:
        self._count += 1
        self._lost += all(row.get("error") for row in sample.rows)
        if self.frozen:
            return
        self._seconds = sample.t
        self._failed = ""
        self._rows = list(sample.rows)
        for row in sample.rows if not self._table.pictures else ():
            key = key_of(row)
            if key not in self._series:
                limits = self._table.ranges.get(key[0]) or self._table.scales.get(key[0])
                self._series[key] = Series(row, limits, self._table.decimals.get(key[0], 0))
                self._series[key].documented = key[0] in self._table.ranges
                self._series[key].bounds = [bound for bound in self._table.bounds if row.get("path") in bound.paths]
                self._series[key].highest = self._table.highest.get(str(row.get("path")))
            self._series[key].add(row, sample.t)
            self._failed = text_shown(str(row.get("error") or self._failed))

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width
        header, footer = self._header(width), self._footer(width)
        room = max(1, options.max_height - len(header) - len(footer))
        body = self._help(width) if self.helps else self._body(width, room)
        if len(body) > room:
            hidden = len(body) - room + 1
            body[room - 1 :] = flowing(
                [Text(f"+ {hidden} lines: enlarge the window or name quantities", style="yellow")], width
            )[:1]
        blank = [Text("")] * (room - len(body)) if self.keyed else []  # the keys are the last line of the window
        yield from (*header, *body, *blank, *footer)

    @property
    def keys(self) -> tuple[tuple[str, str, str], ...]:
        """Those that do something here."""
        stop = self._context.stop_key
        return tuple((key or stop, word, text) for key, word, text in KEYS if key or stop)

    def _help(self, width: int) -> list[Text]:
        return [
            line
            for key, _, text in self.keys
            for line in flowing([Text(word) for word in text.split()], width, head=f"{key:<7}")
        ]

    def _body(self, width: int, height: int) -> list[Text]:
        """All quantities. What does not fit loses its bar, the last one first; single values without a bar then share lines."""
        if self._table.pictures:
            return self._picture(width, height)
        groups: dict[str, list[Series]] = {}
        for series in self._series.values():
            groups.setdefault(series.name, []).append(series)
        grid = self._grid(groups, width)
        inside = {name for name in groups if grid and self._in_grid(groups[name])}
        words = [line for name, group in groups.items() if grid and name not in inside and self._spoken(group)
                 for line in self._by_word(group, width)]  # fmt: skip
        rest = {n: group for n, group in groups.items() if n not in inside and not (grid and self._spoken(group))}
        below = self._lines(rest, width, max(1, height - len(grid) - len(words))) if rest else []
        spare = 0 if grid else self._sparks(groups, width)
        if (below_sparks := axis(self._span, spare)) and len(below) < height:
            below.append(Text(f"{'':{width - spare}}{below_sparks}", style="dim"))
        if grid and len(grid) + len(words) + len(below) > height:  # too low for a grid
            return self._lines(groups, width, height)
        body = [*grid, *words, *below]
        numbers = [group for group in groups.values() if not self._worded(group) and not group[0].element]
        lacking = [group for group in numbers if group[0].name in inside or not (spare and group[0].limits)]
        courses = self._courses(numbers if not grid else lacking, width, height - len(body), 1 if grid else 2)
        return body + (courses or self._courses(lacking, width, height - len(body), 1))

    def _in_grid(self, group: Sequence[Series]) -> bool:
        """Whether a quantity is a column of the grid: one number for each of several fingers or motors."""
        return len(group) > 1 and all(one.part and not one.element for one in group) and not self._spoken(group)

    def _spoken(self, group: Sequence[Series]) -> bool:
        """Whether a quantity is told in words, a word for each of several fingers or motors."""
        return len(group) > 1 and not group[0].element and self._worded(group)

    def _grid(self, groups: dict[str, list[Series]], width: int) -> list[Text]:
        """Fingers or motors below each other, their quantities side by side, as many with a bar as there is room for.

        Nothing where the window is too narrow, or there is one quantity.
        """
        shared = [group for group in groups.values() if self._in_grid(group)]
        parts = list(dict.fromkeys(one.part for group in shared for one in group))
        label = max(map(len, parts), default=0) + 1
        heads = [_stacked(heading(group[0])) for group in shared]
        cells = [
            max(*map(len, head), *(len(one.text(one.value)) for one in group), *(len(one.span) and 6 for one in group))
            for group, head in zip(shared, heads, strict=True)
        ]
        room = width - label - sum(cells) - len(cells)
        if len(shared) < 2 or room < 0:
            return []
        ranged = [number for number, group in enumerate(shared) if group[0].limits is not None]
        ranged = ranged[: room // (BAR + 1)]
        bars = dict.fromkeys(ranged, min(room // len(ranged) - 1, LONGEST)) if ranged else {}
        bad = {one.part for group in groups.values() if self._alarming(group) for one in group if one.label != "ok"}
        lines = [Text(" " * label), Text(" " * label)]
        lines += [Text.assemble((f"{part:<{label}}", "bold red" if part in bad else "")) for part in parts]
        for number, group in enumerate(shared):
            by = {one.part: one for one in group}
            long = bars.get(number, 0)
            for line, word in zip(lines, heads[number], strict=False):
                line.append(f" {word:>{cells[number] + (long + 1 if long else 0)}}", style="dim")
            for line, part in zip(lines[2:], parts, strict=True):
                self._cell(line, by.get(part), cells[number], long)
        return lines if lines[0].plain.strip() else lines[1:]

    def _courses(self, groups: Sequence[Sequence[Series]], width: int, room: int, least: int) -> list[Text]:
        """How quantities went: the value, lowest and highest so far, the values of the last seconds, with a time axis.

        As many as there is room for; up to HIGHEST lines for each of them if there is more, and none if fewer than `least`.
        """
        chosen: list[list[Series]] = []
        used = 2  # the axis, and a blank line before single values
        for group in groups:
            drawn = [one for one in group if one.low is not None]
            need = len(drawn) + (2 if len(drawn) > 1 else 0)
            if used + need > room:
                break
            chosen += [drawn] if drawn else []
            used += need
        many = sum(map(len, chosen))
        high = min(HIGHEST, 1 + (room - used) // many) if many else 0
        if high < least or (least > 1 and len(chosen) < len(groups)):
            return []
        every = [(part_name(one) if len(group) > 1 else heading(one), one) for group in chosen for one in group]
        label = max(len(name) for name, _ in every) + 1
        value = max(6, *(len(one.text(one.value)) for _, one in every), 0)
        span = max(len(one.span) for _, one in every) + 1 if width >= NARROW else 0
        left = label + value + 1 + span
        lines: list[Text] = []
        if width - left < LEAST:
            return []
        for number, group in enumerate(chosen):
            if len(group) > 1:
                lines += [Text(""), Text(heading(group[0]), style="dim")]
            elif not number or len(chosen[number - 1]) > 1:
                lines.append(Text(""))
            for one in group:
                name = part_name(one) if len(group) > 1 else heading(one)
                for row, cells in enumerate(chart(one.history, self._seconds, self._span, width - left, high)):
                    lines.append(Text(" " * left if row else f"{name:<{label}}{one.text(one.value):>{value}} "))
                    lines[-1].append("" if row or not span else f"{one.span:<{span}}", style="dim")
                    lines[-1].append(cells, style=TONES[one.state])
        return [*lines, Text(" " * left + axis(self._span, width - left), style="dim")]

    @staticmethod
    def _cell(line: Text, one: Series | None, width: int, long: int) -> None:
        """A value in the grid, behind its bar."""
        if one is None:
            line.append(" " * (width + 1 + (long + 1 if long else 0)))
            return
        sound = one.value is not None and not one.doubtful
        if long:
            drawn = bar(one.value, *one.scale(), long - 2) if sound and one.value is not None else ""
            said = drawn or one.label[: long - 2].ljust(long - 2)
            line.append(f" {ENDS[0]}{said}{ENDS[1]}", style=TONES[one.state] if sound else "dim")
        line.append(f" {one.text(one.value):>{width}}", style=tone_of(one))

    def _by_word(self, group: Sequence[Series], width: int) -> list[Text]:
        """What several fingers say, a piece for each word: those that something is wrong with come first."""
        said: dict[str, list[str]] = {}
        for one in group:
            said.setdefault(one.label if one.value is not None else "?", []).append(one.part)
        alarming = group[0].name in self._table.flags
        if alarming and list(said) == ["ok"]:
            return flowing([Text("ok", style="green")], width, head=f"{group[0].name} ")
        if alarming:
            said.pop("ok", None)
            order = list(self._table.remedies)
            said = dict(
                sorted(
                    said.items(),
                    key=lambda pair: min(
                        [order.index(w) for w in pair[0].split(", ") if w in order], default=len(order)
                    ),
                )
            )
        items = [
            Text.assemble((f"{', '.join(parts)}: ", ""), (word, "bold red" if alarming or word == "?" else "bold"))
            for word, parts in said.items()
        ]
        return flowing(items, width, head=f"{group[0].name} ", gap=2)

    def _remedy(self) -> str:
        """The most urgent error, who has it, and what to do about it."""
        for name, remedy in self._table.remedies.items():
            if who := [
                key_of(row)[1] for row in self._rows if name in row.get("errors", ()) or row.get("label") == name
            ]:
                parts = ", ".join(filter(None, who))
                return f"{parts + ': ' if parts else ''}{sentence(remedy.meaning)} {sentence(remedy.hint)}"
        return ""

    def _lines(self, groups: dict[str, list[Series]], width: int, height: int) -> list[Text]:
        """Quantities that are in no grid. What does not fit loses its bar, the last one first; single values then share lines."""
        widths = self._widths(groups, width)
        folded = {name: self._values(group, widths) for name, group in groups.items()}
        bars = {name: self._bars(group, widths) for name, group in groups.items()}
        drawn = {name for name, group in groups.items() if group[0].limits is not None and not self._worded(group)}
        short = {n: self._short(g[0]) for n, g in groups.items() if len(g) == 1 and not self._alarming(g)}
        order = list(groups)

        def lines(share: bool) -> list[Text]:
            together = [name for name in order if share and name in short and name not in drawn]
            alone = [name for name in order if name not in together]
            shown = [line for name in alone for line in (bars if name in drawn else folded)[name]]
            return shown + (flowing([short[name] for name in together], width, gap=2) if together else [])

        body = lines(share=False)
        for name in ("", *reversed(order)):
            if len(body) <= height:
                return body
            drawn.discard(name)
            body = lines(share=True)
        if len(body) > height:  # errors must not be among what has no room
            order.sort(key=lambda name: not self._alarming(groups[name]))
            body = lines(share=True)
        return body

    def _picture(self, width: int, height: int) -> list[Text]:
        """The first picture that fits, or the last one."""
        lines: list[Text] = []
        for picture in self._table.pictures if self._rows else ():
            lines = [line for grid in picture(self._rows) for line in grid_lines(grid)]
            if len(lines) <= height and all(line.cell_len <= width for line in lines):
                break
        return lines

    def _short(self, series: Series) -> Text:
        """A quantity with one value, as one piece."""
        value = series.label if self._worded([series]) and series.value is not None else series.text(series.value)
        return Text.assemble(f"{series.name} ", (value, tone_of(series)), f" {series.unit}" if series.unit else "")

    def _alarming(self, group: Sequence[Series]) -> bool:
        return any(
            series.value is None or (series.name in self._table.flags and series.label != "ok") for series in group
        )

    def _worded(self, group: Sequence[Series]) -> bool:
        """Whether to show words instead of numbers: for bits, and for a quantity without a unit whose elements all have labels."""
        return group[0].name in self._table.flags or (not group[0].unit and all(series.label for series in group))

    def _widths(self, groups: dict[str, list[Series]], width: int) -> Widths:
        every = list(self._series.values())
        name = max((len(heading(group[0])) + 1 for group in groups.values()), default=0)
        part = max((len(part_name(series)) + 1 for series in every if part_name(series)), default=0)
        value = max(6, *(len(series.text(series.value)) for series in every), 0)
        span = max(14, *(len(series.span) for series in every), 0) + 1
        wide = width >= NARROW and name + part + value + span + LEAST <= width
        return Widths(width, name, part, value, span if wide else 0)

    def next(self) -> None:
        """Show the next device, where there are several."""

    def _header(self, width: int) -> list[Text]:
        rate = (self._count - 1) / self._seconds if self._count > 1 and self._seconds > 0 else 0.0
        items = [
            f"handctl {self._context.command}",
            f"{self._seconds:.1f} s",
            f"{rate:.1f} Hz",
            plural(self._count, "sample"),
        ]
        texts = [Text(item) for item in items]
        if self.frozen:
            texts.append(Text("frozen", style="bold yellow"))
        if self._context.simulated:
            texts.append(Text("simulated", style="reverse"))
        lost = [Text(f"{self._lost} lost", style="bold red" if self._lost else "")]
        link = [Text(self._link)] if self._link else []
        lines: list[Text] = []
        for place, spare in ((link, lost), ([], lost), ([], [] if not self._lost else lost)):
            lines = flowing([texts[0], *place, *texts[1:4], *spare, *texts[4:]], width, gap=2)
            if len(lines) == 1:
                break
        return lines

    def _footer(self, width: int) -> list[Text]:
        said = [Text(word, style="bold red") for word in self._failed.split(";")[0].split()]
        past = [Text(text, style="bold red") for text in self._past()]
        counted = self._context.journal.counters.quality()
        counts = [Text(f"{plural(n, 'value')} {SEEN[key]}", style="dim") for key, n in counted.items() if n]
        noted, remedy = ([Text(word, style="yellow") for word in text.split()] for text in (self.noted, self._remedy()))
        told = [
            line
            for items, gap in ((said, 1), (past, 2), (remedy, 1), (counts, 2), (noted, 1))
            if items
            for line in flowing(items, width, gap=gap)
        ]
        keys = [Text.assemble((key, "bold"), f" {word}") for key, word, _ in self.keys if self.keyed]
        return [*told, *flowing([*keys, *([] if keys else [Text("Ctrl-C ends", style="dim")])], width, gap=2)]

    @property
    def state(self) -> int:
        """2 = a value is past its limit, was not read, or an error is set; 1 = one is near its limit; 0 = neither."""
        return 2 if self.wrong() else max((one.state for one in self._series.values()), default=0)

    def wrong(self) -> list[Text]:
        """What needs a person, each as one piece: errors by finger, failed reads, what is past its limit."""
        groups: dict[tuple[str, str], list[str]] = {}
        for one in self._series.values():
            if one.value is None or (one.name in self._table.flags and one.label != "ok"):
                word = "not read" if one.value is None else one.label
                groups.setdefault((one.name, word), []).append(part_name(one))
        said = [f"{' '.join((name, ', '.join(parts))).strip()}: {word}" for (name, word), parts in groups.items()]
        return [Text(text, style="bold red") for text in (*said, *self._past())]

    def spans(self) -> list[Text]:
        """Each quantity with its lowest and highest value of now, as one piece."""
        groups: dict[str, list[Series]] = {}
        for one in self._series.values():
            if one.value is not None and one.name not in self._table.flags and not one.doubtful:
                groups.setdefault(one.name, []).append(one)
        pieces = []
        for name, group in groups.items():
            if self._worded(group):
                pieces.append(Text(f"{name} {', '.join(dict.fromkeys(one.label for one in group))}"))
                continue
            low, high = min(group, key=lambda one: one.value or 0.0), max(group, key=lambda one: one.value or 0.0)
            both = low.text(low.value) if low is high else f"{low.text(low.value)}..{high.text(high.value)}"
            worst, unit = max(one.state for one in group), f" {group[0].unit}" if group[0].unit else ""
            pieces.append(Text.assemble(f"{name} ", (f"{both}{unit}", TONES[worst] if worst else "bold")))
        return pieces

    def _past(self) -> list[str]:
        """What is past its limit, the farthest first."""
        far = [
            (bound.beyond(one.value) / (abs(bound.high or bound.low or 0) or 1), one, bound)
            for one in self._series.values()
            for bound in one.bounds
            if one.value is not None and bound.beyond(one.value)
        ]
        return [
            f"{one.name}{f'.{one.part}' if one.part else ''} {one.text(one.value)} {one.unit} (limit: {bound.words})"
            for _, one, bound in sorted(far, key=lambda item: -item[0])
        ]

    def _bars(self, group: Sequence[Series], widths: Widths) -> list[Text]:
        """A quantity with a bar per element."""
        now, span = self._seconds, self._span
        lines = []
        long = widths.name + widths.part + widths.value + 3 + LEAST // 2 > widths.window
        above = not widths.span and (long or any(part_name(series) for series in group))
        if above:
            lines.append(Text(heading(group[0])))
        for number, series in enumerate(group):
            head = heading(series) if number == 0 and not above else ""
            text = Text(" " * 2 if above else f"{head:<{widths.name}}", no_wrap=True, overflow="crop")
            if widths.span or above:
                text.append(f"{part_name(series):<{widths.part}}")
            room = max(0, widths.window - text.cell_len - widths.value - 3 - widths.span)
            bar_width = room * 3 // 5 if widths.span else room
            low, high = series.scale()
            sound = series.value is not None and not series.doubtful
            drawn = bar(series.value, low, high, bar_width) if sound and series.value is not None else ""
            empty = series.label[:bar_width] if series.doubtful else ""
            tone = TONES[series.state] if sound else "dim"
            text.append(f"{ENDS[0]}{drawn or empty.ljust(bar_width)}{ENDS[1]}", style=tone)
            value = f"{series.text(series.value):>{widths.value}} "
            text.append(value, style=tone_of(series))
            if widths.span:
                text.append(f"{series.span:<{widths.span}}", style="dim")
                text.append(spark(series.history, now, span, room - bar_width), style="green")
            lines.append(text)
        return lines

    def _sparks(self, groups: dict[str, list[Series]], width: int) -> int:
        """Cells of the sparklines behind the bars; 0 = there are none."""
        widths = self._widths(groups, width)
        drawn = any(group[0].limits is not None and not self._worded(group) for group in groups.values())
        room = widths.window - widths.name - widths.part - widths.value - 3 - widths.span
        return room - room * 3 // 5 if widths.span and drawn else 0

    def _values(self, group: Sequence[Series], widths: Widths) -> list[Text]:
        """A quantity as values one after the other, a line per finger where fingers have several; as many as needed."""
        name, unit = group[0].name, group[0].unit
        worded = self._worded(group)
        if name in self._table.flags and all(series.label == "ok" for series in group):
            return flowing([Text("ok", style="green")], widths.window, head=f"{name:<{widths.name}}")
        lines: list[Text] = [] if worded else self._matrix(group, widths)
        for part in dict.fromkeys(series.part if series.element else "" for series in group) if not lines else ():
            items = []
            for series in group:
                if (series.element and series.part != part) or (name in self._table.flags and series.label == "ok"):
                    continue
                shown = series.label if worded and series.value is not None else series.text(series.value)
                label = series.element or series.part
                items.append(
                    Text.assemble(f"{label} " if label else "", (shown, tone_of(series, name in self._table.flags)))
                )
            if items and unit:
                items[-1].append(f" {unit}")
            first = name if not lines else ""
            lines += flowing(items, widths.window, head=f"{first:<{widths.name}}{f'{part} ' if part else ''}")
        return lines

    def _matrix(self, group: Sequence[Series], widths: Widths) -> list[Text]:
        """A quantity of several elements per finger: a column per finger, with its course where there is room.

        [] when the window is too narrow for it.
        """
        parts = list(dict.fromkeys(series.part for series in group))
        by = {(series.part, series.element): series for series in group}
        if not group[0].element or len(by) != len(parts) * len({series.element for series in group}):
            return []
        width = max(len(text) for series in group for text in (series.part, series.text(series.value))) + 1
        elements = list(dict.fromkeys(series.element for series in group))
        label, name = widths.name, heading(group[0])
        lines = []
        if label + width * len(parts) > widths.window:
            label = max(len(element) for element in elements) + 1
            lines.append(Text(name))
            name = ""
        if label + width * len(parts) > widths.window:
            return []
        spare = (widths.window - label) // len(parts) - width - 1
        spare = spare if spare >= COLUMN else 0
        lines.append(Text(f"{name:<{label}}"))
        for part in parts:
            lines[-1].append(f"{part:>{width}}")
            lines[-1].append(f" {axis(self._span, spare):<{spare}}" if spare else "", style="dim")
        for element in elements:
            lines.append(Text(f"{element:>{label}}" if name else f"{element:<{label}}"))
            for part in parts:
                series = by[part, element]
                lines[-1].append(f"{series.text(series.value):>{width}}", style=tone_of(series))
                drawn = f" {spark(series.history, self._seconds, self._span, spare)}" if spare else ""
                lines[-1].append(drawn, style=TONES[series.state])
        return lines


TONES = ("cyan", "bold yellow", "bold red")
"""Styles of a bar, by the state of its value."""


def tone_of(series: Series, alarming: bool = False) -> str:
    """The style of a value: red for a failed read, for bits that are set, and past a limit; yellow near one."""
    if series.value is None or alarming:
        return "bold red"
    return TONES[series.state] if series.state else "bold"


def _stacked(text: str) -> tuple[str, str]:
    """A heading on two lines, the unit in the second one."""
    name, _, unit = text.partition(" ")
    first, dash, last = name.rpartition("_")
    return (first + dash, f"{last} {unit}".strip()) if dash else (name if unit else "", unit or name)


def heading(series: Series) -> str:
    """A quantity's name, with its unit if that is not shown with the values."""
    united = series.unit and (series.limits is not None or series.element)
    return f"{series.name} [{series.unit}]" if united else series.name


def part_name(series: Series) -> str:
    """Which element of its quantity a series is: ``little``, ``thumb m1``, "" for the only one."""
    return f"{series.part} {series.element}".strip()


class LiveRecorder:
    """What the key r records: a CSV file, a row a sample, that did not exist before."""

    def __init__(self, view: View, kind: str) -> None:
        self._view, self._kind = view, kind
        self._file: IO[str] | None = None
        self._sheet: Wide | None = None
        self._rows = 0
        self.path = ""

    def switch(self) -> None:
        """Begin a recording, or end it."""
        if self._file is not None:
            self.end()
            return
        self.path = f"{self._kind}-{datetime.now().astimezone():%Y%m%d-%H%M%S}.csv"
        try:
            self._file = open(self.path, "x", encoding="utf-8", newline="")  # noqa: SIM115 - closed by `end`
        except OSError as exc:
            self._view.noted = f"cannot record to {self.path}: {exc.strerror or exc}"
            return
        self._sheet, self._rows = None, 0
        self._view.noted = f"recording to {self.path}"

    def add(self, sample: Sample) -> None:
        """Take a sample, where a recording goes on."""
        if self._file is None:
            return
        moment = {"t_s": round(sample.t, 6)}
        if self._sheet is None:
            self._sheet = Wide(sample.rows, moment)
        try:
            with interrupts.handing_over():  # the key that ends the view may come now
                self._file.write(self._sheet.line(sample.rows, str, moment))
                self._file.flush()
                self._rows += 1
        except OSError as exc:
            self.end(f": {exc.strerror or exc}")

    def end(self, why: str = "") -> str:
        """End the recording; what was recorded, "" = nothing."""
        if self._file is None:
            return ""
        with contextlib.suppress(OSError):
            self._file.close()
        self._file = None
        self._view.noted = f"recorded {plural(self._rows, 'row')} to {self.path}{why}"
        return self._view.noted


def watched(view: View, samples: Generator[Sample, None, None], context: Context) -> Generator[Sample, None, None]:
    """The samples, drawn as they pass on a screen of their own, which is given back at the end."""
    console = console_on(sys.stdout, context.settings.color)
    tape = LiveRecorder(view, context.command.split()[0])
    drawn, quit_, busy = 0.0, False, False
    live = Live(view, console=console, auto_refresh=False, screen=True, redirect_stderr=False, redirect_stdout=False)

    def draw() -> None:
        nonlocal busy
        if not busy:  # a key may come while a picture is drawn: the next one shows what it did
            busy = True
            try:
                live.refresh()
            finally:
                busy = False

    def pressed(key: str) -> bool:
        nonlocal quit_
        if key in ("q", "Q", "\x1b"):
            quit_ = True
            return True
        if key == " ":
            view.frozen = not view.frozen
        elif key in ("r", "R"):
            tape.switch()
        elif key in ("+", "=", "-"):
            view.zoom(-1 if key == "-" else 1)
        elif key == "\t":
            view.next()
        elif key == "?":
            view.helps = not view.helps
        else:
            return False
        draw()
        return False

    try:
        with context.viewed(pressed) as view.keyed, live, contextlib.closing(samples):
            try:
                for sample in samples:
                    view.add(sample)
                    tape.add(sample)
                    yield sample
                    now = clock.now()
                    if now - drawn >= 1 / FRAMES_PER_SECOND:
                        drawn = now
                        draw()
                draw()
            except (KeyboardInterrupt, Interrupted) as exc:
                if not quit_ or getattr(exc, "code", "") == STOPPED:
                    raise
                interrupts.reset_interrupts()
    finally:
        if said := tape.end() or (view.noted if tape.path else ""):
            context.journal.info("recorded", said)
