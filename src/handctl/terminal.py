"""Finished grids on a terminal, through rich. Imported only when a person looks."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from handctl.errors import OutputError
from handctl.result import Cell, Grid

if TYPE_CHECKING:
    from handctl.render import Sink

TONES = {"": "", "good": "green", "warn": "yellow", "bad": "bold red", "dim": "dim"}
"""Meaning -> style. A meaning is always told by a word too, never by colour alone."""


class _Console(Console):
    """A console that lets a closed pipe through instead of ending the process."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def console_for(sink: Sink) -> Console:
    """A console on the sink that obeys --color (first) and NO_COLOR."""
    never = sink.color == "never" or (sink.color == "auto" and bool(os.environ.get("NO_COLOR")))
    return _Console(
        file=sink.file,
        no_color=never,
        force_terminal=True if sink.color == "always" else None,
        highlight=False,
        markup=False,
        emoji=False,
    )


def print_grids(grids: Sequence[Grid], sink: Sink, mark: str) -> None:
    """Print `grids`; `mark` ("simulated") stands in the first title."""
    console = console_for(sink)
    try:
        for number, grid in enumerate(grids):
            if number:
                console.print()
            title = Text(grid.title)
            if mark and number == 0:
                title.append(f"  {mark}" if grid.title else mark, style="reverse")
            if title:
                console.print(title)
            if width_of(grid) <= console.width:
                console.print(grid_table(grid))
            else:
                for line in stacked(grid, console.width):
                    console.print(line)
            for note in grid.notes:
                console.print(Text(note, style="dim"))
    except BrokenPipeError:
        sink.broken = True
    except OSError as exc:
        raise OutputError(f"stdout: cannot be written: {exc.strerror or exc}") from exc


def width_of(grid: Grid) -> int:
    """Columns that the grid needs with every cell whole."""
    lines = [grid.headings, *([cell_text(cell).plain for cell in line] for line in grid.lines)]
    return sum(max(len(line[i]) for line in lines) + 2 for i in range(len(grid.headings))) - 2


def grid_table(grid: Grid) -> RichTable:
    """A rich table of a grid: a rule below the head, two spaces between columns (80 columns are not many)."""
    table = RichTable(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
    for position, heading in enumerate(grid.headings):
        table.add_column(Text(heading), justify="right" if position in grid.right else "left", no_wrap=True)
    for line in grid.lines:
        table.add_row(*(cell_text(cell) for cell in line))
    return table


def stacked(grid: Grid, width: int) -> list[Text]:
    """A grid that is too wide, line by line: the first cell, then `heading value` pairs as many as fit. No value is cut."""
    shown: list[Text] = []
    for line in grid.lines:
        current = Text(cell_text(line[0]).plain, style="bold")
        for heading, cell in zip(grid.headings[1:], line[1:], strict=True):
            text = cell_text(cell)
            if not text.plain:
                continue
            pair = Text(f"{heading} ", style="").append_text(text)
            if len(current) + 2 + len(pair) > width:
                shown.append(current)
                current = Text()
            current = current + Text("  ") + pair if current or shown else pair
        shown.append(current)
    return shown


def cell_text(cell: str | Cell) -> Text:
    """A cell with its tone."""
    return Text(cell.text, style=TONES[cell.tone]) if isinstance(cell, Cell) else Text(cell)
