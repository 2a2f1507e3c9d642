"""The live view of a stream on a terminal: bars, sparklines, minimum and maximum, true rate and counters.

Works over any device's rows: a series is a name with an element. When the window is too low, quantities without a
bar of their own share a line. Imported only when a person looks.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.text import Text

from handctl.result import Row, Sample, Table
from handctl.terminal import console_for

if TYPE_CHECKING:
    from handctl.render import Context, Sink

SPARKS = "▁▂▃▄▅▆▇█"
BAR_PARTS = " ▏▎▍▌▋▊▉█"
HISTORY = 120
FRAMES_PER_SECOND = 12
NARROW = 70
"""Below this width a line has no minimum and maximum and no sparkline."""


class Series:
    """One quantity's element over time."""

    def __init__(self, row: Row, limits: tuple[float, float] | None, decimals: int) -> None:
        self.name = str(row["name"])
        self.part = next((str(row[key]) for key in ("finger", "element", "motor") if row.get(key)), "")
        self.unit = row.get("unit") or ""
        self.limits = limits
        self.decimals = decimals
        self.history: deque[float] = deque(maxlen=HISTORY)
        self.low: float | None = None
        self.high: float | None = None
        self.value: float | None = None
        self.label = ""

    def add(self, row: Row) -> None:
        """Take the value of this moment; a failed read leaves a gap."""
        value = row.get("value")
        self.label = str(row.get("label") or "")
        self.value = value if isinstance(value, int | float) and not isinstance(value, bool) else None
        if self.value is None:
            return
        self.history.append(self.value)
        self.low = self.value if self.low is None else min(self.low, self.value)
        self.high = self.value if self.high is None else max(self.high, self.value)

    def text(self, value: float | None) -> str:
        """A value with its decimals, "?" for a failed read."""
        if value is None:
            return "?"
        return f"{value:.{self.decimals}f}" if self.decimals else f"{value:g}"

    def scale(self) -> tuple[float, float]:
        """The bar's ends: the documented range, widened by what was seen outside it."""
        low, high = self.limits or (0.0, 1.0)
        return min(low, self.low or low), max(high, self.high or high)


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


class View:
    """Draws the latest sample; also a rich renderable, so that the window's size is asked at each drawing."""

    def __init__(self, table: Table, context: Context) -> None:
        self._ranges = table.ranges
        self._flags = table.flags
        self._decimals = table.decimals
        self._context = context
        self._series: dict[tuple[str, str], Series] = {}
        self._count = 0
        self._seconds = 0.0
        self._failed = ""

    def add(self, sample: Sample) -> None:
        """Take a sample."""
        self._count += 1
        self._seconds = sample.t
        self._failed = ""
        for row in sample.rows:
            key = (str(row["name"]), str(row.get("finger") or row.get("element") or row.get("motor") or ""))
            if key not in self._series:
                self._series[key] = Series(row, self._ranges.get(key[0]), self._decimals.get(key[0], 0))
            self._series[key].add(row)
            self._failed = str(row.get("error") or self._failed)

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> RenderResult:
        height = options.max_height
        names: dict[str, list[Series]] = {}
        for series in self._series.values():
            names.setdefault(series.name, []).append(series)
        folded = self._fold(names, height - 4)
        yield self._header()
        for name, group in names.items():
            if name in folded:
                yield self._line(name, group, options.max_width, name in self._flags)
            else:
                for number, series in enumerate(group):
                    yield self._bar_line(name if number == 0 else "", series, options.max_width)
        yield self._footer()

    @staticmethod
    def _fold(names: dict[str, list[Series]], height: int) -> set[str]:
        """Which quantities share one line: those without a range always, then the last ones until all fits."""
        folded = {name for name, group in names.items() if group[0].limits is None}
        for name in reversed(list(names)):
            if sum(1 if n in folded else len(group) for n, group in names.items()) <= height:
                break
            folded.add(name)
        return folded

    def _header(self) -> Text:
        rate = (self._count - 1) / self._seconds if self._count > 1 and self._seconds > 0 else 0.0
        text = Text(f"handctl {self._context.command}  {self._seconds:.1f} s  {rate:.1f} Hz  {self._count} samples")
        if self._context.simulated:
            text.append("  simulated", style="reverse")
        return text

    def _footer(self) -> Text:
        counters = self._context.journal.counters.as_row()
        text = Text("  ".join(f"{key} {value}" for key, value in counters.items()) + "   Ctrl-C ends", style="dim")
        if self._failed:
            text = Text(self._failed.split(";")[0], style="bold red")
        text.truncate(10**6)
        text.no_wrap, text.overflow = True, "ellipsis"
        return text

    @staticmethod
    def _bar_line(name: str, series: Series, width: int) -> Text:
        head = f"{name:<16.16}{series.part:<15.15}"
        value = series.text(series.value)
        span = (
            f"{series.text(series.low)}..{series.text(series.high)}"
            if series.low is not None and series.high is not None
            else ""
        )
        if width < NARROW:  # the number is the last thing to go
            head = f"{name[:8] or '':<9}{series.part[:9]:<10}"
            span = ""
        room = max(0, width - len(head) - 7 - 2 - (15 if span else 0))
        bar_width, spark_width = (room * 3 // 5, room - room * 3 // 5) if span else (room, 0)
        low, high = series.scale()
        text = Text(no_wrap=True, overflow="crop")
        text.append(head)
        text.append(
            "▕" + (bar(series.value, low, high, bar_width) if series.value is not None else " " * bar_width) + "▏",
            style="cyan",
        )
        text.append(f"{value:>6} ", style="bold red" if series.value is None else "bold")
        if span:
            text.append(f"{span:<15}", style="dim")
            text.append(spark(series.history, spark_width), style="green")
        return text

    @staticmethod
    def _line(name: str, group: list[Series], width: int, bits: bool) -> Text:
        text = Text(f"{name:<16.16}", no_wrap=True, overflow="ellipsis")
        if bits and all(series.label == "ok" for series in group):
            text.append("ok", style="green")
            return text
        for series in group:
            if bits and series.label == "ok":
                continue
            shown = series.label if bits else series.text(series.value)
            text.append(f"{series.part} " if series.part else "")
            text.append(f"{shown} ", style="bold red" if bits else "bold")
        text.append(group[0].unit)
        text.truncate(width, overflow="ellipsis")
        return text


def show_live(table: Table, samples: Iterator[Sample], sink: Sink, context: Context) -> None:
    """Draw samples until they end; the last state stays on the screen."""
    console = console_for(sink)
    view = View(table, context)
    drawn = 0.0
    with Live(
        view, console=console, auto_refresh=False, transient=False, redirect_stderr=False, redirect_stdout=False
    ) as live:
        for sample in samples:
            view.add(sample)
            now = time.monotonic()
            if now - drawn >= 1 / FRAMES_PER_SECOND:
                drawn = now
                live.refresh()
        live.refresh()
