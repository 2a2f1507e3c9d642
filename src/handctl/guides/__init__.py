"""The guides: one text a subject in a small subset of Markdown, read by man page and `handctl help` alike.

The first line of each is `# PAGE(7): summary`. Below stand headings, paragraphs, lists, tables and fenced lines; nothing
is nested. This module reads the subset into plain blocks and knows neither roff nor a terminal.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.resources import files
from typing import Literal, NamedTuple

TITLE = re.compile(r"# (?P<page>handctl-[a-z-]+)\(7\): (?P<summary>.+)")


class Heading(NamedTuple):
    """`## text` has level 2, `### text` level 3."""

    level: int
    text: str


class Para(NamedTuple):
    """A paragraph on one line; `this` is to be typed, **this** not to be overlooked."""

    text: str


class Item(NamedTuple):
    """One entry of a list, on one line."""

    text: str


class Table(NamedTuple):
    """Rows of cells, the headings first."""

    rows: tuple[tuple[str, ...], ...]


class Code(NamedTuple):
    """Lines that keep their breaks, and the language that the fence names."""

    lines: tuple[str, ...]
    language: str = ""


Block = Heading | Para | Item | Table | Code


def names() -> tuple[str, ...]:
    """The guides in the order of the alphabet, as they are asked for: `exo`, `links`."""
    found = (entry.name for entry in files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".md") for name in found if name.endswith(".md")))


def source(name: str) -> str:
    """The text of a guide. Raises FileNotFoundError."""
    return files(__name__).joinpath(f"{name}.md").read_text(encoding="utf-8")


def title(text: str) -> tuple[str, str]:
    """The man page's name without its section, and the summary. Raises ValueError."""
    found = TITLE.fullmatch(text.partition("\n")[0])
    if not found:
        raise ValueError("a guide begins with `# handctl-NAME(7): summary`")
    return found["page"], found["summary"]


def blocks(text: str) -> Iterator[Block]:
    """What stands below the title, in order."""
    lines = text.splitlines()[1:]
    kind: Literal["", "para", "item", "table"] = ""
    held: list[str] = []
    place = 0

    def given() -> Iterator[Block]:
        if kind == "table":
            yield Table(tuple(_cells(row) for row in held if not re.fullmatch(r"[|: -]+", row)))
        elif kind:
            yield (Para if kind == "para" else Item)(" ".join(held))
        held.clear()

    while place < len(lines):
        line = lines[place]
        place += 1
        if line.startswith("```"):
            yield from given()
            kind = ""
            end = lines.index("```", place)
            yield Code(tuple(lines[place:end]), line[3:])
            place = end + 1
        elif line.startswith("<!--"):
            continue
        elif not line or line.startswith("#"):
            yield from given()
            kind = ""
            if line:
                marks, _, words = line.partition(" ")
                yield Heading(len(marks), words)
        else:
            new: Literal["", "para", "item", "table"] = (
                "item" if line.startswith("- ") else "table" if line.startswith("|") else "para"
            )
            if new == "item" or (new != kind and not (kind == "item" and line.startswith("  "))):
                yield from given()
                kind = new
            held.append(line.strip().removeprefix("- ") if kind != "table" else line)
    yield from given()


def _cells(row: str) -> tuple[str, ...]:
    cells = re.split(r"(?<!\\)\|", row.strip().removeprefix("|").removesuffix("|"))
    return tuple(cell.strip().replace("\\|", "|") for cell in cells)
