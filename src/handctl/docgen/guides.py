"""The guides as man pages of section 7."""

from __future__ import annotations

import re

from handctl import __version__, guides
from handctl.docgen.roff import Page, bold, escape, marked
from handctl.guides import Code, Heading, Item, Para, Table

REFERENCE = re.compile(r"\b(handctl(?:-[a-z]+)*)\(([17])\)")


def page_names() -> tuple[str, ...]:
    """The pages of section 7, without their section."""
    return tuple(guides.title(guides.source(name))[0] for name in guides.names())


def page(text: str, edition: str) -> str:
    """One guide as roff."""
    name, summary = guides.title(text)
    made = Page(name, edition, f"handctl {__version__}", "handctl manual", section=7)
    made.section("NAME")
    made.para(f"{escape(name)} \\- {escape(summary)}")
    for number, block in enumerate(guides.blocks(text)):
        if not number and not isinstance(block, Heading):
            made.section("DESCRIPTION")
        if isinstance(block, Heading) and block.level == 2:
            made.section(escape(block.text.upper()))
        elif isinstance(block, Heading):
            made.subsection(block.text)
        elif isinstance(block, Para):
            made.para(words(block.text))
        elif isinstance(block, Item):
            made.bullet(words(block.text))
        elif isinstance(block, Code):
            made.literal([f"    {escape(line)}".rstrip() or "\\&" for line in block.lines])
        else:
            _table(made, block)
    made.section("SEE ALSO")
    own = name.removesuffix("-guide")
    first = ["handctl(1)", *([f"{own}(1)"] if own != name else [])]
    others = [*first, *(f"{other}(7)" for other in page_names() if other != name)]
    made.para(",\n".join(words(other) for other in others))
    return made.text


def words(text: str) -> str:
    """Marked text in which the names of pages are bold."""
    made, place = "", 0
    for found in REFERENCE.finditer(text):
        made += marked(text[place : found.start()]) + f"\\%{bold(found[1])}({found[2]})"
        place = found.end()
    return made + marked(text[place:])


def _table(made: Page, table: Table) -> None:
    """The first cell is the tag; of further columns each says its heading."""
    heading, *rows = table.rows
    for first, *rest in rows:
        if len(rest) == 1:
            text = rest[0]
        else:
            text = " ".join(_said(name, cell) for name, cell in zip(heading[1:], rest, strict=True) if cell)
        made.item(words(first) if "`" in first else bold(first), words(text))


def _said(name: str, cell: str) -> str:
    return f"{name[:1].upper()}{name[1:]}: {cell if cell.endswith('.') else cell + '.'}"
