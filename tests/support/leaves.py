"""Every command of the tree, with a command line that click accepts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple
from unittest import mock

import click

from handctl.command.command_tree import Command, root
from handctl.command.options import InFile, OutFile


class Leaf(NamedTuple):
    """A command, and its words up to its own arguments."""

    words: tuple[str, ...]
    command: click.Command


def leaves(command: click.Command, words: tuple[str, ...] = ()) -> Iterator[Leaf]:
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            assert below is not None
            yield from leaves(below, (*words, name))
    elif words[0] != "sim":
        yield Leaf(words, command)


LEAVES = [leaf for leaf in leaves(root) if any(isinstance(p.type, InFile | OutFile) for p in leaf.command.params)]


def own(leaf: Leaf, kind: type) -> list[click.Parameter]:
    return [param for param in leaf.command.params if isinstance(param.type, kind)]


def command_line(leaf: Leaf, paths: dict[str, str]) -> list[str]:
    """The words of a command with these files, and something for whatever else it requires."""
    words = list(leaf.words)
    arguments = [param.name for param in leaf.command.params if isinstance(param, click.Argument)]
    for param in leaf.command.params:
        name = param.name or ""
        if isinstance(param, click.Argument):
            if name in paths:
                words.append(paths[name])
            elif param.required or set(arguments[arguments.index(name) :]) & set(paths):  # the file comes behind it
                other = isinstance(param.type, InFile | OutFile)
                choices = param.type.choices if isinstance(param.type, click.Choice) else ()
                words += [paths["other"] if other else choices[0] if choices else "x=1"] * max(param.nargs, 1)
        elif name in paths:
            words += [param.opts[0], paths[name]]
        elif param.required:
            words += [param.opts[0], "mot" if name == "to" else "1"]
    return words


def taken(words: Sequence[str]) -> bool:
    """Whether these words reach one command with what it takes, or its help; nothing runs. Raises what click refuses."""
    reached: list[click.Context] = []

    def invoke(command: Any, ctx: click.Context) -> None:
        if not isinstance(command, click.Group):
            reached.append(ctx)

    with mock.patch.object(click.Command, "invoke", invoke), mock.patch.object(Command, "invoke", invoke):
        try:
            root.main(list(words), "handctl", standalone_mode=False)
        except click.exceptions.Exit as exc:
            return exc.exit_code == 0
    return [ctx.command_path.split()[0] for ctx in reached] == ["handctl"]
