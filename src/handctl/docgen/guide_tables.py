"""The tables that are generated in README.md and in the guides: devices, commands, questions, links, exit codes.

Each is between `<!-- NAME: … -->` and `<!-- end -->`; everything else of the page is left as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from handctl import guides
from handctl.docgen.man_pages import exit_codes
from handctl.docgen.man_sections import LINKS
from handctl.docgen.promises import exceptions
from handctl.docgen.read_command_tree import Node
from handctl.docgen.readme_commands import VERBS
from handctl.docgen.readme_troubleshooting import SYMPTOMS
from handctl.families import COMMANDS, FAMILIES
from handctl.guides import Heading, Para

SECTION = re.compile(r"(<!-- (?P<name>[a-z-]+): generated[^>]*-->\n).*?(<!-- end -->)", re.DOTALL)

KNOWN = "Sources"
"""The section of a family's guide from which README's table of devices takes two sentences."""


def filled(text: str, tree: Node) -> str:
    """The page with its sections generated again. Raises KeyError for an unknown section."""
    return SECTION.sub(lambda found: found[1] + "\n".join(MAKERS[found["name"]](tree)) + "\n" + found[3], text)


def _known(family: str) -> tuple[str, str, str]:
    """The first two paragraphs of a guide's section KNOWN: what it was tested with, and what the family's bytes rest on."""
    if family not in guides.names():
        return "Not yet run on real hardware.", "The manual.", ""
    text = guides.source(family)
    blocks = list(guides.blocks(text))
    place = next(place for place, block in enumerate(blocks) if isinstance(block, Heading) and block.text == KNOWN)
    said = [block.text for block in blocks[place + 1 : place + 3] if isinstance(block, Para)]
    return said[0][:1].upper() + said[0][1:], said[1], f"{guides.title(text)[0]}(7)"


def _verbs(tree: Node) -> Iterable[str]:
    """Verbs that all devices have, then those of each device."""
    by_family = {
        node.path[0]: [child.path[-1] for child in node.children] for node in tree.children if node.path[0] in FAMILIES
    }
    usual = [name for name in next(iter(by_family.values())) if all(name in names for names in by_family.values())]
    rows = [("every device", usual)]
    rows += [(f"`{name}`", [verb for verb in names if verb not in usual]) for name, names in by_family.items()]
    return _markdown(
        ("device", "commands"), ((device, ", ".join(f"`{verb}`" for verb in verbs)) for device, verbs in rows)
    )


def _asks(tree: Node) -> Iterable[str]:
    """Which commands of each family ask first, and which start immediately, by their rows."""
    rows = []
    for family in [node for node in tree.children if node.path[0] in FAMILIES]:
        first, at_once = [], []
        for leaf in [one for one in family.walk() if one.writes]:
            name = f"`{' '.join(leaf.path[1:])}`"
            asked, _, else_ = leaf.asks.partition("; ") if isinstance(leaf.asks, str) else ("", "", "")
            first += [" ".join(filter(None, (name, asked)))] if leaf.asks else []
            at_once += [" ".join(filter(None, (name, else_)))] if else_ or not leaf.asks else []
        rows.append((f"`{family.path[0]}`", ", ".join(first), ", ".join(at_once)))
    return _markdown(("family", "asks first", "starts immediately"), rows)


MAKERS: dict[str, Callable[[Node], Iterable[str]]] = {
    "devices": lambda _tree: _markdown(
        ("command", "device", "tested with", "sources", "guide"),
        ((f"`handctl {name}`", COMMANDS[name][1], *_known(name)) for name in FAMILIES),
    ),
    "verbs": _verbs,
    "asks": _asks,
    "links": lambda _tree: _markdown(("LINK (`-p`)", "meaning"), ((f"`{name}`", text) for name, text in LINKS)),
    "exit-codes": lambda _tree: _markdown(("exit code", "meaning"), ((str(code), text) for code, text in exit_codes())),
    "symptoms": lambda _tree: _markdown(
        ("message or symptom", "cause", "next step"),
        ((row.said + (f" ({row.code})" if row.code is not None else ""), row.cause, row.step) for row in SYMPTOMS),
    ),
    "usual": lambda _tree: _markdown(("command", "what it does"), ((f"`{row.typed}`", row.does) for row in VERBS)),
    "exceptions": lambda _tree: _markdown(
        ("device", "command, option or link", "what is different"),
        ((f"`{row.family}`", row.where, row.why) for row in exceptions()),
    ),
}


def _markdown(heading: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterable[str]:
    yield f"| {' | '.join(heading)} |"
    yield "|---" * len(heading) + "|"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"
