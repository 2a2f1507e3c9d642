"""The types of options and arguments: numbers, whose messages say what they accept, and files.

Every parameter that takes a file has one of these types, so the check that no output is also an input finds them all.
"""

from __future__ import annotations

from typing import Any

import click

from handctl.errors import UsageError
from handctl.light import NamedTuple

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Settings of a command that takes ``-100`` as an argument; `model.param.given` then refuses a mistyped option."""
LONGEST = 1e6
"""Seconds, 11 days: more is a slip of the pen, and more than some clocks of an operating system can wait for."""


def in_words(kind: click.IntRange | click.FloatRange) -> str:
    """The limits of a number: ``above 0, up to 1000000``."""
    low = "" if kind.min is None else f"above {kind.min:g}" if kind.min_open else f"{kind.min:g}"
    high = "" if kind.max is None else f"below {kind.max:.10g}" if kind.max_open else f"{kind.max:.10g}"
    if low and high:
        return f"{low}, up to {high}" if kind.min_open and not kind.max_open else f"{low} to {high}"
    return f"{low if kind.min_open else f'{low} or more'}" if low else f"{high} or less"


class FiniteRange(click.FloatRange):
    """A finite number in a range."""

    def _describe_range(self) -> str:
        return in_words(self)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            number = float(value)
        except ValueError:
            self.fail(f"{value} is not a number.", param, ctx)
        if not float("-inf") < number < float("inf"):
            self.fail(f"{value} is not a finite number.", param, ctx)
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value} is out of range: {in_words(self)}.", param, ctx)


class WholeRange(click.IntRange):
    """A whole number in a range."""

    def _describe_range(self) -> str:
        return in_words(self)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            int(value)
        except ValueError:
            self.fail(f"{value} is not a whole number.", param, ctx)
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value} is out of range: {in_words(self)}.", param, ctx)


class Seconds(FiniteRange):
    """A number above 0 that a clock can wait for."""

    def __init__(self) -> None:
        super().__init__(min=0, min_open=True, max=LONGEST)


class Hertz(FiniteRange):
    """Samples a second: 0 for as fast as it goes, or a rate whose period a clock can wait for."""

    def __init__(self) -> None:
        super().__init__(min=0)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        rate = super().convert(value, param, ctx)
        if 0 < rate < 1 / LONGEST:
            self.fail(f"{value} is one sample in more than {LONGEST:.0f} seconds.", param, ctx)
        return rate


# -- files ----------------------------------------------------------------------------------------------------------


class InFile(click.Path):
    """A file that a command reads. `beside`: suffixes of files read with it."""

    def __init__(self, *, additional: tuple[str, ...] = ()) -> None:
        super().__init__(dir_okay=False)
        self.additional = additional


class OutFile(click.Path):
    """A file that a command writes. `beside`: suffixes of files written with it. `grows`: it is only appended to."""

    def __init__(self, *, additional: tuple[str, ...] = (), grows: bool = False) -> None:
        super().__init__()  # a folder is refused where it is known what is to be written
        self.additional = additional
        self.grows = grows


class Named(NamedTuple):
    """A file of this run: its name for the user, its path, whether it is only appended to."""

    label: str
    path: str
    grows: bool = False


def files_of(ctx: click.Context) -> tuple[list[Named], list[Named]]:
    """The files that the parameters of this command name: inputs, outputs."""
    inputs: list[Named] = []
    outputs: list[Named] = []
    for param in ctx.command.params:
        kind, given = param.type, ctx.params.get(param.name or "")
        if not isinstance(kind, InFile | OutFile):
            continue
        label = param.get_usage_pieces(ctx)[0] if isinstance(param, click.Argument) else param.opts[0]
        group = inputs if isinstance(kind, InFile) else outputs
        for path in given if isinstance(given, tuple) else (given,):
            if path and path != "-":
                grows = getattr(kind, "grows", False)
                group += [Named(label, f"{path}{ending}", grows) for ending in ("", *kind.additional)]
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
