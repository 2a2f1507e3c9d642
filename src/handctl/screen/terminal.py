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
from handctl.model.result import Cell, Grid

if TYPE_CHECKING:
    from handctl.screen.render import Sink

TONES = {"": "", "good": "green", "warn": "yellow", "bad": "bold red", "dim": "dim"}
"""Meaning -> style. A meaning is always told by a word too, never by colour alone."""
GAP = 2
"""Spaces between columns, and the indent of what continues a line."""
PROSE = 20
"""A text column is not made narrower than this; a shorter one is not wrapped."""


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
                title.append(" " * GAP if grid.title else "").append(mark, style="reverse")
            if title:
                console.print(title)
            widths = fitting(grid, console.width)
            if not widths:
                grid = without_empty(grid)  # noqa: PLW2901 - the same grid, narrower
                widths = fitting(grid, console.width)
            if widths:
                console.print(grid_table(grid, widths))
            else:
                for line in stacked(grid, console):
                    console.print(line)
            for note in grid.notes:
                for line in hanging(Text(note, style="dim"), console, len(note) - len(note.lstrip())):
                    console.print(line)
    except BrokenPipeError:
        sink.broken = True
    except OSError as exc:
        raise OutputError(f"stdout: cannot be written: {exc.strerror or exc}") from exc


def fitting(grid: Grid, width: int) -> list[int]:
    """Widths of the columns in a terminal of `width`; [] when they do not fit.

    Every cell is whole where there is room; else prose is wrapped at its spaces. A name or a number is never broken.
    """
    lines = [grid.headings, *([cell_text(cell).plain for cell in line] for line in grid.lines)]
    natural = [max(len(line[i]) for line in lines) for i in range(len(grid.headings))]
    widths = list(natural)
    for i in range(1, len(widths)):
        if natural[i] > PROSE and i not in grid.right and any(" " in line[i] for line in lines):
            widths[i] = max(PROSE, *(len(word) for line in lines for word in line[i].split()))
    spare = width - sum(widths) - GAP * (len(widths) - 1)
    if spare < 0:
        return []
    while spare and widths != natural:
        narrowest = min((i for i in range(len(widths)) if widths[i] < natural[i]), key=widths.__getitem__)
        widths[narrowest] += 1
        spare -= 1
    return widths


def without_empty(grid: Grid) -> Grid:
    """The grid without the columns that hold nothing."""
    kept = [i for i in range(len(grid.headings)) if i == 0 or any(cell_text(line[i]).plain for line in grid.lines)]
    return grid._replace(
        headings=tuple(grid.headings[i] for i in kept),
        lines=tuple(tuple(line[i] for i in kept) for line in grid.lines),
        right=frozenset(position for position, i in enumerate(kept) if i in grid.right),
    )


def grid_table(grid: Grid, widths: Sequence[int]) -> RichTable:
    """A rich table of a grid: a rule below the head, two spaces between columns (80 columns are not many)."""
    table = RichTable(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
    for position, (heading, width) in enumerate(zip(grid.headings, widths, strict=True)):
        table.add_column(Text(heading), justify="right" if position in grid.right else "left", width=width)
    for line in grid.lines:
        table.add_row(*(cell_text(cell) for cell in line))
    return table


def stacked(grid: Grid, console: Console) -> list[Text]:
    """A grid that is too wide, line by line: the first cell, then `heading: value` pairs as many as fit.

    A further column with the first one's heading begins a line of its own. Values are wrapped at spaces, none is cut.
    """
    shown: list[Text] = []
    for line in grid.lines:
        current = Text(cell_text(line[0]).plain, style="bold")
        for heading, cell in zip(grid.headings[1:], line[1:], strict=True):
            text = cell_text(cell)
            if not text.plain:
                continue
            if heading and heading == grid.headings[0]:
                shown.append(current)
                current = Text(text.plain, style="bold")
                continue
            pair = Text(f"{heading}: " if heading else "", style="dim", end="").append_text(text)
            if current and current.cell_len + GAP + pair.cell_len <= console.width:
                current = Text.assemble(current, " " * GAP, pair)
                continue
            if current:
                shown.append(current)
            *whole, current = hanging(Text.assemble(" " * GAP, pair), console, GAP)
            shown += whole
        shown.append(current)
    return shown


def hanging(text: Text, console: Console, indent: int) -> list[Text]:
    """A text wrapped at spaces, its further lines indented by GAP more than `indent` unless a word needs the room."""
    room = console.width - indent - GAP
    if text.cell_len <= console.width or max(map(len, text.plain.split()), default=0) > room:
        return list(text.wrap(console, console.width))
    first, *_ = text.wrap(console, console.width)
    rest = text[len(first.plain) :]
    rest = rest[len(rest.plain) - len(rest.plain.lstrip()) :]
    lines = [first, *(Text.assemble(" " * (indent + GAP), line) for line in rest.wrap(console, room))]
    for line in lines:
        line.rstrip()
    return lines


def flowing(items: Sequence[Text], width: int, *, head: str = "", gap: int = 1) -> list[Text]:
    """Items one after the other behind `head`, on as many lines as they need; further lines are indented like it.

    Where the head takes more than half of the width, further lines are indented by GAP only.
    """
    indent = len(head) if len(head) <= width // 2 else GAP if head else 0
    pieces = [piece for item in items for piece in ([item] if item.cell_len <= width - indent else item.split(" "))]
    lines, empty = [Text(head)], True
    for piece in pieces:
        space = 0 if empty else gap
        if lines[-1].cell_len + space + piece.cell_len > width and (not empty or lines[-1].plain.strip()):
            lines.append(Text(" " * indent))
            space = 0
        lines[-1].append(" " * space).append_text(piece)
        empty = False
    return lines


def cell_text(cell: str | Cell) -> Text:
    """A cell with its tone."""
    return Text(cell.text, style=TONES[cell.tone]) if isinstance(cell, Cell) else Text(cell)
