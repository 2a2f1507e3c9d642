"""FILE as a parameter of a command: whether it is read or written, and the check that no output is an input.

Every parameter that takes a file has one of these types, so that the check, and the tests, know all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import click

from handctl.errors import UsageError


class InFile(click.Path):
    """A file that a command reads. `beside` are the endings of files read with it."""

    def __init__(self, *, beside: tuple[str, ...] = ()) -> None:
        super().__init__(dir_okay=False)
        self.beside = beside


class OutFile(click.Path):
    """A file that a command writes. `beside` are the endings of files written with it; a record only `grows`."""

    def __init__(self, *, beside: tuple[str, ...] = (), grows: bool = False) -> None:
        super().__init__()  # a folder is refused where it is known what is to be written
        self.beside = beside
        self.grows = grows


class Named(NamedTuple):
    """A file of this run: what the user calls it, where it is, whether it is only added to."""

    label: str
    path: str
    grows: bool = False


def files_of(ctx: click.Context) -> tuple[list[Named], list[Named]]:
    """The files that the parameters of this command name: inputs, outputs."""
    inputs: list[Named] = []
    outputs: list[Named] = []
    for param in ctx.command.params:
        kind, path = param.type, ctx.params.get(param.name or "")
        if not isinstance(kind, InFile | OutFile) or not path or path == "-":
            continue
        label = param.get_usage_pieces(ctx)[0] if isinstance(param, click.Argument) else param.opts[0]
        group = inputs if isinstance(kind, InFile) else outputs
        group += [Named(label, f"{path}{ending}", getattr(kind, "grows", False)) for ending in ("", *kind.beside)]
    return inputs, outputs


def refuse_clashes(inputs: list[Named], outputs: list[Named]) -> None:
    """Raise UsageError when an output is an input or another output, under whatever name, or a file that handctl keeps.

    Called before any of them is opened: an input is never lost.
    """
    from handctl.files import clash, state_path

    kept = str(state_path(""))
    for position, output in enumerate(outputs):
        for other in (*inputs, *outputs[:position]):
            if clash(output.path, other.path):
                same = "" if output.path == other.path else f" ({other.path})"
                raise UsageError(
                    f"{output.label} {output.path}: the same file as {other.label}{same}",
                    hint="name another file. Nothing was opened, and nothing was sent.",
                    code="same-file",
                )
        if not output.grows and _inside(output.path, kept):
            raise UsageError(
                f"{output.label} {output.path}: handctl keeps its own records in {kept}",
                hint="name a file in another folder. Nothing was opened, and nothing was sent.",
                code="same-file",
            )


def _inside(path: str, folder: str) -> bool:
    import os

    return os.path.realpath(path).startswith(os.path.join(os.path.realpath(folder), ""))
