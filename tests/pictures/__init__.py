"""The README's pictures, drawn by the real renderer from simulated devices: `python -m tests.pictures` writes them.

Every byte is determined: seeds, virtual time, a fixed id in the SVG, and a template of our own that needs nothing from
the network (rich's own fetches a font).
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest import mock
from xml.etree import ElementTree

from rich.console import Console
from rich.terminal_theme import TerminalTheme

from handctl.model.result import Sample
from handctl.screen import live_view
from tests.support.screen import screen

HERE = Path(__file__).parent
PICTURES: dict[str, tuple[int, int, tuple[str, ...]]] = {
    # file name -> columns, rows, command line; @ is a simulated hand in the middle of a movement
    "exo-status": (72, 24, ("exo", "status", "-p", "fake://exo?seed=7&clock=virtual&fault=faults")),
    "exo-watch": (100, 26, ("exo", "watch", "--rate", "20", "--count", "13", "-p", "@")),
    "barrett-status": (80, 24, ("barrett", "status", "-p", "fake://barrett?seed=7&clock=virtual&initialized=1")),
}
MOVING = ("position_set.little=900", "position_set.ring=700", "position_set.index=100", "position_set.thumb=0")
"""Written before the live view starts: a movement takes longer than one command, the state file carries it on."""

THEME = TerminalTheme(
    (22, 27, 34),
    (201, 209, 217),
    [(72, 79, 88), (255, 123, 114), (63, 185, 80), (210, 153, 34), (88, 166, 255), (188, 140, 255), (57, 197, 207), (177, 186, 196)],
)  # fmt: skip

TEMPLATE = (
    "<!-- python -m tests.pictures, rich "
    + version("rich")
    + """ -->
<svg class="rich-terminal" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">
    <style>
    .{unique_id}-matrix {{
        font-family: "DejaVu Sans Mono", "Fira Code", Menlo, Consolas, monospace;
        font-size: {char_height}px;
        line-height: {line_height}px;
        font-variant-east-asian: full-width;
    }}
    .{unique_id}-title {{ font-size: 18px; font-weight: bold; font-family: "DejaVu Sans", Helvetica, Arial, sans-serif; }}
    {styles}
    </style>
    <defs>
    <clipPath id="{unique_id}-clip-terminal">
      <rect x="0" y="0" width="{terminal_width}" height="{terminal_height}" />
    </clipPath>
    {lines}
    </defs>
    {chrome}
    <g transform="translate({terminal_x}, {terminal_y})" clip-path="url(#{unique_id}-clip-terminal)">
    {backgrounds}
    <g class="{unique_id}-matrix">
    {matrix}
    </g>
    </g>
</svg>
"""
)


def draw(name: str) -> str:
    """One picture as SVG."""
    columns, rows, command = PICTURES[name]
    recorder = Console(
        record=True, width=columns, height=rows, force_terminal=True, color_system="truecolor",
        highlight=False, markup=False, emoji=False, legacy_windows=False, file=io.StringIO(),
    )  # fmt: skip

    def draw_last(view: live_view.View, samples: Iterator[Sample], _context: Any) -> Iterator[Sample]:
        for sample in samples:
            view.add(sample)
            yield sample
        recorder.print(view)

    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch("handctl.screen.terminal_tables.console_on", lambda _file, _color: recorder),
        mock.patch("handctl.screen.live_view.watched", draw_last),
    ):
        link = f"fake://exo?seed=7&clock=virtual&jitter=1&state={folder}/state.json"
        if "@" in command:
            assert screen("exo", "set", *MOVING, "--yes", "-p", link.replace("&jitter=1", ""), "-q", "--json").code == 0
        done = screen(*(link if word == "@" else word for word in command), columns=columns, rows=rows)
        assert done.code == 0, done.err
    recorder.print()  # else the clip of the last line cuts its descenders
    title = "handctl " + " ".join(command[:2])
    svg = recorder.export_svg(title=title, theme=THEME, code_format=TEMPLATE, unique_id=name)
    return "\n".join(line.rstrip() for line in svg.splitlines()) + "\n"


def words(svg: str) -> str:
    """What a picture says, without white space and rules: the same for every version of rich."""
    root = ElementTree.fromstring(svg)  # noqa: S314 - our own
    texts = ("".join(element.itertext()) for element in root.iter("{http://www.w3.org/2000/svg}text"))
    return "".join("".join(texts).replace("─", "").split())
