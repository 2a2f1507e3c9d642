"""The command tree as plain data: the options and arguments of each command.

Reads click commands and parameter maps; knows no shell and no page. A family that follows the conventions of the
others (its module has a `cli` and a ParamMap of its kind) is taken up without a word here.
"""

from __future__ import annotations

import enum
import inspect
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import click

from handctl.command.command_tree import root
from handctl.command.family import map_of
from handctl.command.options import SharedOption
from handctl.families import COMMANDS
from handctl.model.param import Param


class Value(NamedTuple):
    """The possible values at one place of a command line.

    kind    "none" (anything), "choice" (one of `words`), "file", "dir", "link", "device" (a named one),
            or names of the map of `family`: "read", "set" (NAME=VALUE), "name" (all)
    """

    kind: str
    words: tuple[str, ...] = ()
    family: str = ""

    @property
    def token(self) -> str:
        """The value as one word without spaces, as the shells' tables have it: ``choice:a,b``, ``read:exo``, ``file``."""
        detail = ",".join(self.words) if self.kind == "choice" else self.family
        return f"{self.kind}:{detail}" if detail else self.kind


class Option(NamedTuple):
    """One option. `value` is None for a flag; `shared` options work at any level, `section` is theirs in the help."""

    names: tuple[str, ...]
    value: Value | None
    metavar: str
    help: str
    section: str
    shared: bool
    env: str


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument: how it is written, what it takes, whether it repeats."""

    metavar: str
    value: Value
    repeats: bool


class Section(NamedTuple):
    """A titled list below a command's help, e.g. the faults of a simulator."""

    title: str
    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Node:
    """One command or group. `path` is () for the root; `summary` is one line, `help` its paragraphs."""

    path: tuple[str, ...]
    summary: str
    help: str
    writes: bool
    asks: bool | str
    options: tuple[Option, ...]
    arguments: tuple[Argument, ...]
    sections: tuple[Section, ...]
    children: tuple[Node, ...]
    params: tuple[Param, ...] = field(default=())

    @property
    def name(self) -> str:
        """``exo dump``, or ``""`` for the root."""
        return " ".join(self.path)

    @property
    def shared(self) -> tuple[Option, ...]:
        """Its options that work at any level; the root's are those of every device. A wire belongs to one family."""
        return tuple(option for option in self.options if option.shared)

    def walk(self) -> Iterator[Node]:
        """This node and all below it, in order."""
        yield self
        for child in self.children:
            yield from child.walk()


@cache
def read_tree() -> Node:
    """The whole program, which stays as it is. Imports every family and every tool."""
    return _node(root, None, "handctl", ())


def _node(command: click.Command, parent: click.Context | None, name: str, path: tuple[str, ...]) -> Node:
    ctx = click.Context(command, parent, name, **command.context_settings)
    children = []
    if isinstance(command, click.Group):
        for name in command.list_commands(ctx):
            child = command.get_command(ctx, name)
            if child is not None and not child.hidden:
                children.append(_node(child, ctx, name, (*path, name)))
    recorder = _Recorder()
    command.format_epilog(ctx, recorder)
    sections, params = tuple(recorder.sections), command.get_params(ctx)
    return Node(
        path=path,
        summary=_summary(command, path),
        help=inspect.cleandoc(command.help or "").partition("\f")[0].strip(),
        writes=bool(getattr(command, "writes", False)),
        asks=getattr(command, "asks", False),
        options=tuple(_option(p, path, sections) for p in params if isinstance(p, click.Option) and not p.hidden),
        arguments=tuple(
            Argument(param.get_usage_pieces(ctx)[0], _value(param, path), param.nargs != 1)
            for param in params
            if isinstance(param, click.Argument)
        ),
        sections=sections,
        children=tuple(children),
        params=found.every if len(path) == 1 and (found := map_of(path[0])) is not None else (),
    )


def _summary(command: click.Command, path: tuple[str, ...]) -> str:
    if len(path) == 1:
        return COMMANDS[path[0]][1]
    text = command.short_help or inspect.cleandoc(command.help or "").partition("\n\n")[0]
    return " ".join(text.split())


class _Recorder(click.HelpFormatter):
    """Keeps what a command writes below its options instead of formatting it."""

    def __init__(self) -> None:
        super().__init__()
        self.sections: list[Section] = []
        self._title = ""

    def write_heading(self, heading: str) -> None:
        self._title = heading

    def write_dl(self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2) -> None:
        self.sections.append(Section(self._title, tuple(rows)))


def _option(option: click.Option, path: tuple[str, ...], sections: Sequence[Section]) -> Option:
    shared = isinstance(option, SharedOption)
    names = tuple(sorted((*option.opts, *option.secondary_opts), key=lambda name: name.startswith("--")))
    takes = not (option.is_flag or option.count)
    value = _value(option, path) if takes else None
    if value is not None and value.kind == "none" and "--fault" in names:
        faults = (name for section in sections if section.title.startswith("Fault") for name, _ in section.rows)
        value = Value("choice", tuple(dict.fromkeys(faults)))
    choices = "|".join(value.words) if value is not None and value.kind == "choice" else ""
    metavar = (option.metavar or choices or str(option.name).upper()) if takes else ""
    text = " ".join((option.help or "").split())
    if takes and option.show_default and option.default is not None:
        text += f" Default: {f'{option.default:g}' if isinstance(option.default, float) else option.default}."
    env = f"HANDCTL_{str(option.name).upper()}" if isinstance(option, SharedOption) and not option.typed else ""
    return Option(names, value, metavar, text, getattr(option, "section", "Options"), shared, env)


def _value(param: click.Parameter, path: tuple[str, ...]) -> Value:
    """What `param` takes, by its type; where that says nothing, by the word of its metavar."""
    kind = param.type
    if isinstance(kind, click.Choice):
        return Value("choice", tuple(str(c.name if isinstance(c, enum.Enum) else c) for c in kind.choices))
    if isinstance(kind, click.Path):
        return Value("file" if kind.file_okay else "dir")
    metavar = param.metavar or str(param.name).upper()
    word = re.sub(r"^\W+", "", metavar)
    match (re.match(r"[A-Z]*", word) or [""])[0]:
        case "FILE" | "PATH":
            return Value("file")
        case "LINK" | "PORT":
            return Value("link")
        case "NAME":
            return _name(param, path, metavar)
    return Value("none")


def _name(param: click.Parameter, path: tuple[str, ...], metavar: str) -> Value:
    """A NAME: of a quantity in a family with a map, of a device in the options and in `devices`."""
    if isinstance(param, click.Option):
        return Value("device") if "--device" in param.opts else Value("none")
    if path[0] == "devices" and path[-1] != "add":
        return Value("device")
    if map_of(path[0]) is None:
        return Value("none")
    kind = "set" if "=" in metavar else "name" if path[-1] == "describe" else "read"
    return Value(kind, family=path[0])
