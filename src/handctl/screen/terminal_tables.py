"""Finished grids on a terminal, through rich. Imported only when a person looks."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import zip_longest
from typing import IO, TYPE_CHECKING

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
TIGHT = 10
"""The same where prose stands below its line already."""
LEAST = 4
"""Columns that must stay side by side for a table to be one."""


class _Console(Console):
    """A console that lets a closed pipe through instead of ending the process."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def console_on(file: IO[str], color: str) -> Console:
    """A console on a file that obeys --color (first) and NO_COLOR."""
    return _Console(
        file=file,
        no_color=color == "never" or (color == "auto" and bool(os.environ.get("NO_COLOR"))),
        force_terminal=True if color == "always" else None,
        legacy_windows=None if file.isatty() else False,  # no console to ask: colours that are wanted are codes
        highlight=False,
        markup=False,
        emoji=False,
    )


def print_grids(grids: Sequence[Grid], sink: Sink, mark: str) -> None:
    """Print `grids`; the first title contains `mark` ("simulated")."""
    console = console_on(sink.file, sink.color)
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
                for line in with_prose_below(grid, console) or stacked(grid, console):
                    console.print(line)
            for note in grid.notes:
                for line in hanging(Text(note, style="dim"), console, len(note) - len(note.lstrip())):
                    console.print(line)
    except BrokenPipeError:
        sink.broken = True
    except OSError as exc:
        raise OutputError(f"stdout: cannot be written: {exc.strerror or exc}") from exc


def grid_lines(grid: Grid) -> list[Text]:
    """A grid of short texts as lines, each cell as wide as its column."""
    lines = [[Text(heading, style="bold") for heading in grid.headings], *map(_cells, grid.lines)]
    widths = [max(line[i].cell_len for line in lines) for i in range(len(grid.headings))]
    drawn = [Text(grid.title)] if grid.title else []
    for line in lines:
        for i, cell in enumerate(line):
            cell.align("right" if i in grid.right else "left", widths[i])
        drawn.append(Text(" " * GAP, no_wrap=True, overflow="crop").join(line))
        drawn[-1].rstrip()
    return drawn


def _cells(line: Sequence[str | Cell]) -> list[Text]:
    return [cell_text(cell) for cell in line]


def fitting(grid: Grid, width: int, prose: int = PROSE) -> list[int]:
    """Widths of the columns in a terminal of `width`; [] when they do not fit.

    Every cell is whole where there is room; else prose is wrapped at its spaces. A name or a number is never broken.
    """
    lines = [grid.headings, *([cell_text(cell).plain for cell in line] for line in grid.lines)]
    natural = [max(len(line[i]) for line in lines) for i in range(len(grid.headings))]
    widths = list(natural)
    for i in texts(grid, prose):
        widths[i] = max(prose, *(len(word) for line in lines for word in line[i].split()))
    spare = width - sum(widths) - GAP * (len(widths) - 1)
    if spare < 0:
        return []
    while spare and widths != natural:
        narrowest = min((i for i in range(len(widths)) if widths[i] < natural[i]), key=widths.__getitem__)
        widths[narrowest] += 1
        spare -= 1
    return widths


def texts(grid: Grid, prose: int = PROSE) -> list[int]:
    """The columns that hold prose, which may be wrapped: never the first one."""
    lines = [[cell_text(cell).plain for cell in line] for line in grid.lines]
    return [
        i
        for i in range(1, len(grid.headings))
        if i not in grid.right
        and any(" " in line[i] for line in lines)
        and max(len(line[i]) for line in [grid.headings, *lines]) > prose
    ]


def with_prose_below(grid: Grid, console: Console) -> list[Text]:
    """The grid as a table, with the prose of each line below it; [] when that is no table either.

    Of the columns of prose, then of the others, the last ones go below, as few as do.
    """
    prose, below = texts(grid), set[int]()
    others = [i for i in range(1, len(grid.headings)) if i not in prose] if prose else []
    for one in (*reversed(prose), *reversed(others)):
        below.add(one)
        kept = [i for i in range(len(grid.headings)) if i not in below]
        table = only(grid, kept)
        widths = fitting(table, console.width) or fitting(table, console.width, TIGHT)
        if widths and len(kept) >= LEAST:
            return _table_lines(grid, table, widths, sorted(below), console)
    return []


def _table_lines(grid: Grid, table: Grid, widths: Sequence[int], below: Sequence[int], console: Console) -> list[Text]:
    def side_by_side(cells: Sequence[Text]) -> list[Text]:
        wrapped = [list(cell.wrap(console, width)) for cell, width in zip(cells, widths, strict=True)]
        lines = []
        for additional in zip_longest(*wrapped):
            for i, piece in enumerate(pieces := [piece or Text() for piece in additional]):
                piece.align("right" if i in table.right else "left", widths[i])
            lines.append(Text(" " * GAP).join(pieces))
            lines[-1].rstrip()
        return lines

    shown = side_by_side([Text(heading, style="bold") for heading in table.headings])
    shown.append(Text("─" * (sum(widths) + GAP * (len(widths) - 1))))
    for line, cells in zip(grid.lines, table.lines, strict=True):
        shown += side_by_side([cell_text(cell) for cell in cells])
        said = Text()
        for i in below:
            text = cell_text(line[i])
            if not text.plain:
                continue
            pair = Text.assemble(" " * GAP, (f"{grid.headings[i]}: " if grid.headings[i] else "", "dim"), text)
            if said and said.cell_len + pair.cell_len > console.width:
                shown.append(said)
                said = Text()
            *whole, said = hanging(said.append_text(pair), console, GAP)
            shown += whole
        shown += [said] if said else []
    return shown


def only(grid: Grid, kept: Sequence[int]) -> Grid:
    """The grid with these columns."""
    return grid._replace(
        headings=tuple(grid.headings[i] for i in kept),
        lines=tuple(tuple(line[i] for i in kept) for line in grid.lines),
        right=frozenset(position for position, i in enumerate(kept) if i in grid.right),
    )


def without_empty(grid: Grid) -> Grid:
    """The grid without the columns that hold nothing."""
    return only(
        grid, [i for i in range(len(grid.headings)) if i == 0 or any(cell_text(line[i]).plain for line in grid.lines)]
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
    """`head` and the items after it, on as many lines as needed; further lines are indented.

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
