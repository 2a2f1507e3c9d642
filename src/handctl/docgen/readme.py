"""The tables of README.md that say what the code says: commands, verbs by device, links, exit codes.

Each stands between `<!-- NAME: … -->` and `<!-- end -->`; everything else of the page is left as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from handctl.docgen.man import exit_codes
from handctl.docgen.texts import LINKS
from handctl.docgen.tree import Node
from handctl.families import COMMANDS, FAMILIES

SECTION = re.compile(r"(<!-- (?P<name>[a-z-]+): generated[^>]*-->\n).*?(<!-- end -->)", re.DOTALL)


def filled(text: str, tree: Node) -> str:
    """The page with its generated sections made anew. Raises KeyError for a section that nobody makes."""
    return SECTION.sub(lambda found: found[1] + "\n".join(MAKERS[found["name"]](tree)) + "\n" + found[3], text)


def _commands(_tree: Node) -> Iterable[str]:
    return _table(("command", "what"), ((f"`handctl {name}`", text) for name, (_, text) in COMMANDS.items()))


def _verbs(tree: Node) -> Iterable[str]:
    """Verbs that all devices have stand once, then those of each."""
    by_family = {
        node.path[0]: [child.path[-1] for child in node.children] for node in tree.children if node.path[0] in FAMILIES
    }
    usual = [name for name in next(iter(by_family.values())) if all(name in names for names in by_family.values())]
    rows = [("every device", usual)]
    rows += [(f"`{name}`", [verb for verb in names if verb not in usual]) for name, names in by_family.items()]
    return _table(("device", "verbs"), ((device, ", ".join(f"`{verb}`" for verb in verbs)) for device, verbs in rows))


def _links(_tree: Node) -> Iterable[str]:
    return _table(("LINK (`-p`)", "what"), ((f"`{name}`", text) for name, text in LINKS))


def _exit_codes(_tree: Node) -> Iterable[str]:
    return _table(("exit code", "meaning"), ((str(code), text) for code, text in exit_codes()))


MAKERS: dict[str, Callable[[Node], Iterable[str]]] = {
    "commands": _commands,
    "verbs": _verbs,
    "links": _links,
    "exit-codes": _exit_codes,
}


def _table(heading: tuple[str, str], rows: Iterable[tuple[str, str]]) -> Iterable[str]:
    yield f"| {heading[0]} | {heading[1]} |"
    yield "|---|---|"
    for first, second in rows:
        yield f"| {first} | {second.replace('|', chr(92) + '|')} |"
