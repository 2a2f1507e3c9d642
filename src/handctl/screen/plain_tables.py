"""Tables as aligned text, where no terminal shows them: in a pipe or a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from handctl.model.result import Cell, Column, Grid


def text_of(value: Any) -> str:
    """A value as CSV, plain and tables have it: "" for null."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def aligned_lines(grid: Grid, mark: str) -> Iterator[str]:
    """The lines of a grid; its title contains `mark` ("simulated")."""
    lines = [[cell.text if isinstance(cell, Cell) else cell for cell in line] for line in grid.lines]
    lines.insert(0, list(grid.headings))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    columns = [Column("", right=position in grid.right) for position in range(len(widths))]
    if grid.title:
        yield f"{grid.title}{f'  ({mark})' if mark else ''}\n"
    for line in lines:
        yield aligned_line(line, widths, columns)
    for note in grid.notes:
        yield f"{note}\n"


def aligned_line(texts: Sequence[str], widths: Sequence[int], columns: Sequence[Column]) -> str:
    """One line: two spaces between its cells, none behind the last."""
    cells = (
        text.rjust(width) if column.right else text.ljust(width)
        for text, width, column in zip(texts, widths, columns, strict=True)
    )
    return "  ".join(cells).rstrip() + "\n"
