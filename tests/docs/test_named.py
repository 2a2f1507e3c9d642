"""What a text names is there: commands, options, pages, topics and names in Python, in README, guides, helps, messages and hints."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import click

from handctl import guides
from handctl.command.command_tree import root
from handctl.tools.help import _text, _topics
from tests.support.syntax import nodes_of, walk

TOP = Path(__file__).parents[2]
SOURCES = TOP / "src" / "handctl"
HOLE = "\0"
"""What stands for a value in a message."""
OF_OTHERS = {
    "README": {"--dist"},
    "guide development": {"--minutes", "--quick", "--dist", "--peers", "--guide"},
    "system/__init__.py": {"--platform"},
    "tools/port_problems.py": {"--reload"},
}
"""Options of other programs that a text names: pytest, our own tests, mypy, udevadm."""
IN_CODE = ("docgen/", "report/html.py", "charts/curves.py", "devices/ekso/gait_page.py")
"""Strings there are programs of shells, and styles."""
FILES = {"pyz", "exe"}


class CommandLine(NamedTuple):
    """One text that people read, and where it stands."""

    where: str
    text: str


@cache
def command_line() -> tuple[CommandLine, ...]:
    """README, the guides, and each string of the source."""
    found = [CommandLine("README", (TOP / "README.md").read_text(encoding="utf-8"))]
    found += [CommandLine(f"guide {name}", guides.source(name)) for name in guides.names()]
    for path in sorted(SOURCES.rglob("*.py")):
        where = path.relative_to(SOURCES).as_posix()
        if not where.startswith(IN_CODE):
            found += [CommandLine(where, text) for text in _strings(path)]
    return tuple(found)


def _strings(path: Path) -> Iterator[str]:
    inside: set[int] = set()
    for node in nodes_of(path):
        kind = type(node)  # there are half a million of them
        if kind is ast.JoinedStr:
            inside |= {id(part) for part in walk(node) if part is not node}
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else HOLE for part in node.values)
        elif kind is ast.Constant and isinstance(node.value, str) and id(node) not in inside:
            yield re.sub(r"\{\w+\}", HOLE, node.value)


def options(command: click.Command, context: click.Context) -> dict[str, bool]:
    """Each option that a command takes, and whether a value follows it."""
    return {
        name: not param.is_flag
        for param in command.get_params(context)
        if isinstance(param, click.Option)
        for name in (*param.opts, *param.secondary_opts)
    }


def below(command: click.Command, name: str, parent: click.Context | None = None) -> click.Context:
    return click.Context(command, parent, name, **command.context_settings)


def missing(words: list[str]) -> str:
    """The first of the words behind `handctl` that is no command and no option there; "" where all are."""
    context, rest = below(root, "handctl"), list(words)
    shared = options(root, context) | {"-h": False, "--help": False, "--version": False}
    while rest:
        word = rest.pop(0)
        if word.startswith("-"):
            name, equals, _ = word.partition("=")
            known = shared | options(context.command, context)
            if HOLE not in name and name not in known and not re.fullmatch(r"-[0-9.]+", name):
                return word
            if known.get(name) and not equals and rest:
                rest.pop(0)
        elif isinstance(context.command, click.Group):
            if HOLE in word or not word.islower():  # a value, a placeholder
                return ""
            command = context.command.get_command(context, word)
            if command is None:
                return word
            context = below(command, word, context)
    return ""


def test_every_command_that_a_text_names_is_there() -> None:
    lines = [(one.where, line) for one in command_line() for line in re.findall(r"`handctl ([^`\n]+)`", one.text)]
    assert len(lines) > 300
    assert [(where, line, word) for where, line in lines if (word := missing(line.split()))] == []


def test_every_option_that_a_text_names_is_there() -> None:
    known: set[str] = set()

    def collect(context: click.Context) -> None:
        known.update(options(context.command, context))
        if isinstance(context.command, click.Group):
            for name in context.command.list_commands(context):
                command = context.command.get_command(context, name)
                assert command is not None
                collect(below(command, name, context))

    collect(below(root, "handctl"))
    named = {
        (one.where, name) for one in command_line() for name in re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", one.text)
    }
    assert {(where, name) for where, name in named if name not in known | OF_OTHERS.get(where, set())} == set()


def test_every_page_that_a_text_names_is_there() -> None:
    pages = {path.name for path in (TOP / "man").glob("man?/*")}
    named = {
        (one.where, *found) for one in command_line() for found in re.findall(r"\b(handctl[a-z-]*)\(([17])\)", one.text)
    }
    assert {one for one in named if f"{one[1]}.{one[2]}" not in pages} == set()


def test_every_name_in_python_that_a_text_names_is_there() -> None:
    """As somebody reaches it who has typed `import handctl`."""
    handctl = importlib.import_module("handctl")
    named = {name for one in command_line() for name in re.findall(r"`handctl\.(\w+)", one.text)}
    assert {name for name in named - FILES if not hasattr(handctl, name)} == set()


def test_every_module_that_a_text_names_is_there() -> None:
    """Also in docstrings, which send a newcomer on; `gripper` is the family that the guide adds."""
    there = [path.as_posix() for folder in ("src", "tests") for path in (TOP / folder).rglob("*.py")]
    texts = [*command_line(), CommandLine("tests/README", (TOP / "tests/README.md").read_text(encoding="utf-8"))]
    named = [
        (one.where, name)
        for one in texts
        if not one.where.startswith("newfamily/")
        for name in re.findall(r"(?<![\w.-])(?:[a-z0-9_]+/)*[a-z0-9_]+\.py\b", one.text)
        if "gripper" not in name
    ]
    rooms = "command|link|model|record|screen|stop|system|tools"
    dotted = [(one.where, *names) for one in texts for names in re.findall(rf"`({rooms})\.([a-z_]+)\b", one.text)]
    assert len(named) > 60 and len(dotted) > 30
    assert [(where, name) for where, name in named if not any(path.endswith(f"/{name}") for path in there)] == []
    assert [
        (where, room, name)
        for where, room, name in dotted
        if find_spec(f"handctl.{room}.{name}") is None and not hasattr(importlib.import_module(f"handctl.{room}"), name)
    ] == []


def test_what_a_topic_is_said_to_show_is_in_it() -> None:
    """The word of the topic itself, and what stands in backquotes in a sentence that sends the reader there."""
    for topic in _topics():
        body = " ".join(_text([topic]).partition("DESCRIPTION")[2].split()) or _text([topic])
        assert topic.removesuffix("-guide").removesuffix("s") in body.casefold(), topic
    for one in command_line():
        for sentence in re.split(r"(?<=[.:])\s", one.text):
            for topic in re.findall(r"`handctl help ([a-z-]+)` (?:shows|explains) how", sentence):
                shown = _text([topic])
                named = [word for word in re.findall(r"`([^`]+)`", sentence) if not word.startswith("handctl")]
                assert [word for word in named if word not in shown] == [], (one.where, sentence)
