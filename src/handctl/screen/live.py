"""The live view of a stream on a terminal: bars, sparklines, minimum and maximum, true rate and counters.

Works over any device's rows: a series is a name with an element. When the window is too low, quantities without a
bar of their own share a line. Rows that have a finger and an element within it are drawn as a table of numbers, the
fingers side by side. Imported only when a person looks.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Generator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.text import Text

from handctl.model.result import Row, Sample, Table
from handctl.screen.terminal import console_for, flowing, grid_lines
from handctl.system import clock
from handctl.system.terminal import FINE

if TYPE_CHECKING:
    from handctl.screen.render import Context
    from handctl.screen.sink import Sink

SPARKS = "▁▂▃▄▅▆▇█" if FINE else "_.▄█"
BAR_PARTS = " ▏▎▍▌▋▊▉█" if FINE else "    ▌▌▌▌█"
ENDS = "▕▏" if FINE else "││"
HISTORY = 120
FRAMES_PER_SECOND = 12
NARROW = 70
"""Below this width a bar's line has no minimum and maximum, no sparkline, and the name stands above it."""
LEAST = 15
"""Room that bar and sparkline need at least, with the ends of the bar; without it the line is that of a narrow window."""
NOTE = 62
"""About as long is the note after the end: it and the shell's prompt must not push the head out of the window."""

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
        self.history: deque[float] = deque(maxlen=HISTORY)
        self.low: float | None = None
        self.high: float | None = None
        self.value: float | None = None
        self.label = ""
        self.doubtful = False

    @property
    def limits(self) -> tuple[float, float] | None:
        """The bar's documented ends, in the unit that is shown."""
        return None if self._limits is None else (self._limits[0] * self._factor, self._limits[1] * self._factor)

    def add(self, row: Row) -> None:
        """Take the value of this moment; a failed read leaves a gap."""
        value = row.get("scaled", row.get("value"))
        self.label = str(row.get("label") or "")
        self.doubtful = bool(row.get("doubt"))
        if value and row.get("value"):
            self._factor = value / row["value"]
        self.value = value if isinstance(value, int | float) and not isinstance(value, bool) else None
        if self.value is None or self.doubtful:
            return
        self.history.append(self.value)
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

    def scale(self) -> tuple[float, float]:
        """The bar's ends: the documented range, widened by what was seen outside it."""
        low, high = self.limits or (0.0, 1.0)
        lowest, highest = (low if self.low is None else self.low), (high if self.high is None else self.high)
        return min(low, lowest), max(high, highest)


def bar(value: float, low: float, high: float, width: int) -> str:
    """A bar of `width` cells between low and high in eighths; with a negative `low` it grows from the zero line."""
    if high <= low:
        return " " * width
    zero = (0 - low) / (high - low) * width if low < 0 < high else 0.0
    place = (value - low) / (high - low) * width
    if zero:
        start, end = sorted((round(zero), round(place)))
        return (
            (" " * start + "█" * (end - start)).ljust(width)[:width]
            if start != end
            else (" " * start + "│").ljust(width)[:width]
        )
    full, part = divmod(round(place * 8), 8)
    return ("█" * full + (BAR_PARTS[part] if part else "")).ljust(width)[:width]


def spark(history: deque[float], width: int) -> str:
    """The last `width` values as a sparkline, scaled to what they span."""
    values = list(history)[-width:]
    if not values:
        return " " * width
    low, high = min(values), max(values)
    step = (high - low) or 1.0
    return "".join(SPARKS[int((value - low) / step * (len(SPARKS) - 1))] for value in values).rjust(width)


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
        self._ranges = table.ranges
        self._flags = table.flags
        self._decimals = table.decimals
        self._pictures = table.pictures
        self._rows: list[Row] = []
        self._context = context
        self._series: dict[Key, Series] = {}
        self._count = 0
        self._seconds = 0.0
        self._failed = ""
        self.keyed = False

    def add(self, sample: Sample) -> None:
        self._count += 1
        self._seconds = sample.t
        self._failed = ""
        self._rows = list(sample.rows)
        for row in sample.rows if not self._pictures else ():
            key = key_of(row)
            if key not in self._series:
                self._series[key] = Series(row, self._ranges.get(key[0]), self._decimals.get(key[0], 0))
            self._series[key].add(row)
            self._failed = str(row.get("error") or self._failed)

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width
        header, footer = self._header(width), self._footer(width)
        below = 1 + -(-NOTE // width)
        room = max(1, options.max_height - len(header) - len(footer) - below)
        body = self._body(width, room)
        if len(body) > room:
            hidden = len(body) - room + 1
            body[room - 1 :] = flowing(
                [Text(f"+ {hidden} lines: enlarge the window or name quantities", style="yellow")], width
            )[:1]
        yield from (*header, *body, *footer)

    def _body(self, width: int, height: int) -> list[Text]:
        """All quantities. What does not fit loses its bar, the last one first; single values without a bar then share lines."""
        if self._pictures:
            return self._picture(width, height)
        groups: dict[str, list[Series]] = {}
        for series in self._series.values():
            groups.setdefault(series.name, []).append(series)
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
        for picture in self._pictures if self._rows else ():
            lines = [line for grid in picture(self._rows) for line in grid_lines(grid)]
            if len(lines) <= height and all(line.cell_len <= width for line in lines):
                break
        return lines

    def _short(self, series: Series) -> Text:
        """A quantity with one value, as one piece."""
        value = series.label if self._worded([series]) and series.value is not None else series.text(series.value)
        return Text.assemble(f"{series.name} ", (value, tone_of(series)), f" {series.unit}" if series.unit else "")

    def _alarming(self, group: Sequence[Series]) -> bool:
        return any(series.value is None or (series.name in self._flags and series.label != "ok") for series in group)

    def _worded(self, group: Sequence[Series]) -> bool:
        """Whether to show words instead of numbers: for bits, and for a quantity without a unit whose elements all have labels."""
        return group[0].name in self._flags or (not group[0].unit and all(series.label for series in group))

    def _widths(self, groups: dict[str, list[Series]], width: int) -> Widths:
        every = list(self._series.values())
        name = max((len(heading(group[0])) + 1 for group in groups.values()), default=0)
        part = max((len(part_name(series)) + 1 for series in every if part_name(series)), default=0)
        value = max(6, *(len(series.text(series.value)) for series in every), 0)
        span = max(14, *(len(series.span) for series in every), 0) + 1
        wide = width >= NARROW and name + part + value + span + LEAST <= width
        return Widths(width, name, part, value, span if wide else 0)

    def _header(self, width: int) -> list[Text]:
        rate = (self._count - 1) / self._seconds if self._count > 1 and self._seconds > 0 else 0.0
        items = [
            f"handctl {self._context.command}",
            f"{self._seconds:.1f} s",
            f"{rate:.1f} Hz",
            f"{self._count} samples",
        ]
        texts = [Text(item) for item in items]
        if self.keyed:
            texts.append(Text("s stops the device", style="bold"))
        if self._context.simulated:
            texts.append(Text("simulated", style="reverse"))
        return flowing(texts, width, gap=2)

    def _footer(self, width: int) -> list[Text]:
        if self._failed:
            words = self._failed.split(";")[0].split()
            return flowing([Text(word, style="bold red") for word in words], width)
        counted = self._context.journal.counters
        nothing = {
            key for key, value in counted.quality().items() if not value
        }  # of these 0 says no more than their absence
        shown = {key: value for key, value in counted.as_row().items() if isinstance(value, int) and key not in nothing}
        items = [Text(f"{key} {value}", style="dim") for key, value in shown.items()]
        lines = flowing(items, width, gap=2)
        reminded = flowing([*items, Text("Ctrl-C ends", style="dim")], width, gap=2)
        return reminded if len(reminded) == len(lines) else lines

    @staticmethod
    def _bars(group: Sequence[Series], widths: Widths) -> list[Text]:
        """A quantity with a bar per element."""
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
            text.append(f"{ENDS[0]}{drawn or empty.ljust(bar_width)}{ENDS[1]}", style="cyan" if sound else "dim")
            value = f"{series.text(series.value):>{widths.value}} "
            text.append(value, style="bold red" if series.value is None else "bold")
            if widths.span:
                text.append(f"{series.span:<{widths.span}}", style="dim")
                text.append(spark(series.history, room - bar_width), style="green")
            lines.append(text)
        return lines

    def _values(self, group: Sequence[Series], widths: Widths) -> list[Text]:
        """A quantity as values one after the other, a line per finger where fingers have several; as many as needed."""
        name, unit = group[0].name, group[0].unit
        worded = self._worded(group)
        if name in self._flags and all(series.label == "ok" for series in group):
            return flowing([Text("ok", style="green")], widths.window, head=f"{name:<{widths.name}}")
        lines: list[Text] = [] if worded else self._matrix(group, widths)
        for part in dict.fromkeys(series.part if series.element else "" for series in group) if not lines else ():
            items = []
            for series in group:
                if (series.element and series.part != part) or (name in self._flags and series.label == "ok"):
                    continue
                shown = series.label if worded and series.value is not None else series.text(series.value)
                label = series.element or series.part
                items.append(Text.assemble(f"{label} " if label else "", (shown, tone_of(series, name in self._flags))))
            if items and unit:
                items[-1].append(f" {unit}")
            first = name if not lines else ""
            lines += flowing(items, widths.window, head=f"{first:<{widths.name}}{f'{part} ' if part else ''}")
        return lines

    @staticmethod
    def _matrix(group: Sequence[Series], widths: Widths) -> list[Text]:
        """A quantity of several elements per finger: a column per finger; [] when the window is too narrow for it."""
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
        lines.append(Text(f"{name:<{label}}" + "".join(f"{part:>{width}}" for part in parts)))
        for element in elements:
            lines.append(Text(f"{element:>{label}}" if name else f"{element:<{label}}"))
            for part in parts:
                series = by[part, element]
                lines[-1].append(f"{series.text(series.value):>{width}}", style=tone_of(series))
        return lines


def tone_of(series: Series, alarming: bool = False) -> str:
    """The style of a value: red for a failed read and for bits that are set."""
    return "bold red" if series.value is None or alarming else "bold"


def heading(series: Series) -> str:
    """A quantity's name, with its unit if that is not shown with the values."""
    united = series.unit and (series.limits is not None or series.element)
    return f"{series.name} [{series.unit}]" if united else series.name


def part_name(series: Series) -> str:
    """Which element of its quantity a series is: ``little``, ``thumb m1``, "" for the only one."""
    return f"{series.part} {series.element}".strip()


def show_live(table: Table, samples: Generator[Sample, None, None], sink: Sink, context: Context) -> None:
    """Draw samples until they end; the last state stays on the screen."""
    console = console_for(sink)
    view = View(table, context)
    drawn = 0.0
    with (
        context.stop_key() as keyed,
        Live(
            view, console=console, auto_refresh=False, transient=False, redirect_stderr=False, redirect_stdout=False
        ) as live,
        contextlib.closing(samples),  # the device is left before the last state is drawn: a terminal may take nothing
    ):
        view.keyed = keyed
        for sample in samples:
            view.add(sample)
            sink.samples += 1
            now = clock.now()
            if now - drawn >= 1 / FRAMES_PER_SECOND:
                drawn = now
                live.refresh()
        live.refresh()
