"""`handctl plot`: the curves of recordings as one picture, without a device."""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from handctl import __version__
from handctl.command.command_tree import Command
from handctl.command.options import InFile
from handctl.command.run import Run
from handctl.errors import UsageError
from handctl.model.result import Column, Row, Table
from handctl.wording import near, plural

if TYPE_CHECKING:
    from handctl.charts.curves import Curve
    from handctl.tools.plot_read import Plotted

COLUMNS = (
    Column("file", "File"), Column("name", "Name"), Column("part", "Part"), Column("unit", "Unit"), Column("min", "Min", right=True),
    Column("max", "Max", right=True), Column("moved", "Moved"),
)  # fmt: skip
MOST_PARTS = 8
"""A quantity of more elements has a picture for each finger."""
LETTERS = 150
"""Of a line below the pictures of an SVG, which does not wrap."""


@click.command("plot", cls=Command, offline=True)
@click.argument("files", type=InFile(additional=(".json",)), nargs=-1, required=True, metavar="FILE...")
@click.option(
    "--only", "names", multiple=True, metavar="NAME", help="Plot only this quantity or element, such as temperature.index. Several: A,B, or repeat it."
)  # fmt: skip
@click.option("--open", "opens", is_flag=True, help="Open the plot in the browser.")
def cli(run: Run, files: Sequence[str], names: Sequence[str], opens: bool) -> Table | None:
    """Plot recordings, as -o FILE.svg or as an HTML page with -o FILE.html.

    FILE is a CSV file that `watch`, `log` or `realtime` wrote. The plots of several files are stacked and share their
    axes. Values that never changed are listed, not drawn. --json prints the lowest and highest values instead.
    """
    from handctl.tools.plot_read import read

    rows_only = run.settings.format in ("json", "ndjson", "csv", "plain")
    if not (rows_only or opens or run.settings.output) and sys.stdout.isatty():
        raise UsageError("no output file given", hint="add -o plot.svg, -o plot.html or --open", code="no-output")
    found = [read(file) for file in files]
    _keep(found, [name for text in names for name in text.split(",")])
    for one in found:
        if one.damaged:
            run.journal.warn("damaged", f"{one.path}: {plural(one.damaged, 'row')} could not be read and are left out")
    rows = [_row(one, curve) for one in found for curve in one.curves]
    moved = sum(row["moved"] for row in rows)
    run.journal.info(
        "plotted", f"{plural(sum(one.rows for one in found), 'row')}, {moved} of {plural(len(rows), 'curve')} moved"
    )
    table = Table(rows=rows, columns=COLUMNS)
    if opens or not rows_only:
        whole = opens or str(run.settings.output).lower().endswith((".html", ".htm"))
        text = drawn(found, whole=whole)
        if opens:
            _open(run, text)
            run.settings = run.settings._replace(output=None)
        else:
            table.text = lambda _: text
    return table


def _row(one: Plotted, curve: Curve) -> Row:
    return {
        "file": one.path, "name": curve.name, "part": curve.part or None, "unit": curve.unit or None, "min": curve.low,
        "max": curve.high, "moved": curve.moved,
    }  # fmt: skip


def _keep(found: Sequence[Plotted], names: Sequence[str]) -> None:
    """Leave only the curves of these names. Raises UsageError."""
    known = {name for one in found for curve in one.curves for name in (curve.name, f"{curve.name}.{curve.part}")}
    for name in names:
        if name not in known:
            like = near(name, known) or sorted({curve.name for one in found for curve in one.curves})
            raise UsageError(
                f"{', '.join(one.path for one in found)}: no column {name!r}",
                hint=f"use a name that the file has: {', '.join(like)}",
                code="no-column",
            )
    for one in found if names else ():
        one.curves = [curve for curve in one.curves if {curve.name, f"{curve.name}.{curve.part}"} & set(names)]


# -- the picture ----------------------------------------------------------------------------------------------------


def drawn(found: Sequence[Plotted], *, whole: bool) -> str:
    """The SVG of all quantities that moved, or the page with it."""
    from handctl.charts.curves import SIDE, STYLE, Strip, escape, picture, unchanged

    seconds = max(one.seconds for one in found)
    named = [os.path.basename(one.path) for one in found]
    titles: dict[str, list[Strip]] = {}
    for one, name in zip(found, named, strict=True):
        for title, curves in grouped(one.curves).items():
            moving = {part: curve for part, curve in curves.items() if curve.moved}
            if moving:
                titles.setdefault(title, []).append(Strip(name, moving, one.holes, one.marks))
    head = " and ".join(
        f"{name} ({'simulated, ' if one.simulated else ''}{plural(one.rows, 'row')})"
        for name, one in zip(named, found, strict=True)
    )
    lines = [(name, unchanged(one.curves)) for name, one in zip(named, found, strict=True)]
    still = [f"{name} unchanged: {text}" for name, text in lines if text]
    pieces, top = [], 56
    for title, strips in titles.items():
        text, height = picture(title, strips, seconds, top=0 if whole else top)
        pieces.append(text)
        top += height + 14
    if whole:
        from handctl.report.html import plain_page

        return plain_page(
            head,
            [*map(_outlines, found), *pieces, *(f'<p class="note">{escape(line)}</p>\n' for line in still)],
            STYLE,
            __version__,
        )
    folded = [(14 if later else 0, line) for text in still for later, line in enumerate(textwrap.wrap(text, LETTERS))]
    below = "".join(
        f'<text class="small" x="{left}" y="{top + 16 * number}">{escape(line)}</text>\n'
        for number, (left, line) in enumerate(folded, 1)
    )
    high = top + 16 * len(folded) + 24
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-16 0 {SIDE + 32} {high}" width="{SIDE + 32}" height="{high}">\n'
        f"<style>{STYLE}</style>\n"
        f'<rect x="-16" width="100%" height="100%" fill="#fff"/>\n<text class="head" x="0" y="32">{escape(head)}</text>\n'
        f"{''.join(pieces)}{below}</svg>\n"
    )


def _outlines(one: Plotted) -> str:
    """The device of a log with the highest values of each finger, in its last position; "" where none is known."""
    from handctl.charts.outline import outline_svg
    from handctl.model.outline import outline_of

    outline = outline_of(one.kind) if one.kind else None
    if outline is None:
        return ""
    bent = outline.bend[0].partition(".")[0] if outline.bend else ""
    errors = outline.errors.partition("{")[0].rstrip("._")
    rows: list[Row] = [
        {
            "path": f"{curve.name}.{curve.part}" if curve.part else curve.name,
            "value": curve.last if curve.name == bent else max(curve.low, curve.high, key=abs),
            "unit": curve.unit or None,
            **({"errors": ["set"] if curve.high else []} if errors and curve.name.startswith(errors) else {}),
        }
        for curve in one.curves
    ]
    name = os.path.basename(one.path)
    figures = (outline_svg(outline, by, rows, f"{name}: highest") for by in outline.measures if by != "error")
    return f'<div class="outlines">{"".join(figures)}</div>\n'


def grouped(curves: Sequence[Curve]) -> dict[str, dict[str, Curve]]:
    """Heading -> part -> curve. A quantity of many elements has a picture a finger.

    Names without a part that end with the same word and unit share one: ``left_hip_angle`` and ``right_hip_angle``.
    """
    places: dict[str, list[tuple[str, Curve]]] = {}
    words: dict[tuple[str, str], int] = {}
    for curve in curves:
        if not curve.part:
            words[_word(curve)] = words.get(_word(curve), 0) + 1
    for curve in curves:
        name, part = curve.name, curve.part
        if not part and words[_word(curve)] > 1:
            name, part = _word(curve)[0], name.replace(_word(curve)[0], "").strip("_").replace("_", " ")
        places.setdefault(f"{name} [{curve.unit}]" if curve.unit else name, []).append((part, curve))
    found: dict[str, dict[str, Curve]] = {}
    for title, group in places.items():
        for part, curve in group:
            finger, _, element = part.partition(".")
            split = len(group) > MOST_PARTS and element
            found.setdefault(f"{finger}: {title}" if split else title, {})[element if split else part] = curve
    return found


def _word(curve: Curve) -> tuple[str, str]:
    """The word by which names are one quantity, and the unit: the last, or the first where the last is a number."""
    first, *rest = curve.name.split("_")
    return (first if not rest or rest[-1].isdecimal() else rest[-1]), curve.unit


def _open(run: Run, text: str) -> None:
    """Write the page and show it. Raises OutputError."""
    import tempfile
    import webbrowser
    from pathlib import Path

    from handctl.files import atomic_write, writing

    path = run.settings.output or os.path.join(tempfile.mkdtemp(prefix="handctl-"), "plot.html")
    with writing(path, hint="choose another file"), atomic_write(path) as file:
        file.write(text)
    if not webbrowser.open(Path(path).resolve().as_uri()):
        run.journal.warn("no-browser", "no browser could be started", hint=f"open {path} yourself")
