"""What README, the guides and the helps point to is there."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import handctl
from handctl import guides
from handctl.families import COMMANDS, FAMILIES
from tests.promises.cells import Cell, commands, needs
from tests.support.cli import run
from tests.support.places import TEXTS

PAGES = {name: path.read_text(encoding="utf-8") for name, path in TEXTS.items()}
TEXT = "\n".join(PAGES.values())
TOPIC = re.compile(r"`handctl help ([a-z][a-z-]*)`")
PAGE = re.compile(r"\bhandctl-[a-z-]+\(7\)")
MODULE = re.compile(r"`handctl\.([a-z_]+)`")


def cells() -> Iterator[Cell]:
    helps = "\n".join(command.help or "" for family in FAMILIES for _, command in commands(family))
    for topic in sorted(set(TOPIC.findall(TEXT + helps))):
        yield Cell(f"handctl help {topic}", lambda _, topic=topic: _shown(topic))
    for page in sorted(set(PAGE.findall(TEXT))):
        yield Cell(f"handctl help '{page}', as it is named", lambda _, page=page: _shown(page))
    for module in sorted(set(MODULE.findall(PAGES["library"]))):
        yield Cell(f"handctl.{module}", partial(_there, module))
    for family in FAMILIES:
        yield Cell(f"{family} in handctl-changes(7)", partial(_listed, family))
        yield Cell(f"{family}: handctl help {family}-guide", lambda _, family=family: _shown(f"{family}-guide"))
    for tool in COMMANDS:
        yield Cell(f"the page of {tool}", lambda _, tool=tool: _shown(tool))


def _shown(topic: str) -> None:
    needs(run("help", topic), 0)


def _there(name: str, _folder: Path) -> None:
    hidden = {key: sys.modules.pop(key) for key in list(sys.modules) if key == f"handctl.{name}" and key in sys.modules}
    kept = handctl.__dict__.pop(name, None)
    try:
        getattr(handctl, name)
    finally:
        sys.modules.update(hidden)
        if kept is not None:
            setattr(handctl, name, kept)


def _listed(family: str, _folder: Path) -> None:
    """By the first words of its help that are a name."""
    names = re.findall(r"[A-Z][A-Za-z]*[A-Z0-9-][A-Za-z0-9-]*", FAMILIES[family].help.partition("(")[0]) or [
        FAMILIES[family].help.split()[1]
    ]
    assert any(name.lower() in guides.source("changes").lower() for name in names), names
