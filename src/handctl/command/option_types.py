"""The types of options and arguments: numbers and their ranges, seconds, rates, files that are read and files that are written."""

from __future__ import annotations

import os
from typing import Any

import click

from handctl.errors import UsageError
from handctl.fast_classes import NamedTuple

# -- numbers, whose messages say what they accept --------------------------------------------------------------------

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Settings of a command that takes ``-100`` as an argument; `model.param.given` then refuses a mistyped option."""
LONGEST = 1e6
"""Seconds, 11 days: more is a slip of the pen, and more than some clocks of an operating system can wait for."""


def range_in_words(kind: click.IntRange | click.FloatRange) -> str:
    """The limits of a number: ``above 0, up to 1000000``."""
    low = "" if kind.min is None else f"above {kind.min:g}" if kind.min_open else f"{kind.min:g}"
    high = "" if kind.max is None else f"below {kind.max:.10g}" if kind.max_open else f"{kind.max:.10g}"
    if low and high:
        return f"{low}, up to {high}" if kind.min_open and not kind.max_open else f"{low} to {high}"
    return f"{low if kind.min_open else f'{low} or more'}" if low else f"{high} or less"


def _convert(self: Any, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
    """As the range of click that this is one of, in our words."""
    try:
        number = self.number(value)
    except ValueError:
        self.fail(f"{value} is not a {self.noun}.", param, ctx)
    if not float("-inf") < number < float("inf"):
        self.fail(f"{value} is not a finite number.", param, ctx)
    try:
        return self.range.convert(self, value, param, ctx)
    except click.BadParameter:
        self.fail(f"{value} is out of range: {range_in_words(self)}.", param, ctx)


class FiniteRange(click.FloatRange):
    """A finite number in a range."""

    number, noun, range = float, "number", click.FloatRange
    _describe_range, convert = range_in_words, _convert


class WholeRange(click.IntRange):
    """A whole number in a range."""

    number, noun, range = int, "whole number", click.IntRange
    _describe_range, convert = range_in_words, _convert


SECONDS = FiniteRange(min=0, min_open=True, max=LONGEST)
"""A number above 0 that a clock can wait for."""


class Hertz(FiniteRange):
    """Samples a second: 0 for as fast as it goes, or a rate whose period a clock can wait for."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        rate = super().convert(value, param, ctx)
        if 0 < rate < 1 / LONGEST:
            self.fail(f"{value} is one sample in more than {LONGEST:.0f} seconds.", param, ctx)
        return rate


# -- files ----------------------------------------------------------------------------------------------------------


class _File(click.Path):
    """`additional`: suffixes of files that belong to it. `grows`: it is only appended to."""

    reads = False

    def __init__(self, *, additional: tuple[str, ...] = (), grows: bool = False) -> None:
        super().__init__(
            dir_okay=not self.reads
        )  # of one to write a folder is refused where it is known what is written
        self.additional = additional
        self.grows = grows


class InFile(_File):
    """A file that a command reads."""

    reads = True


class OutFile(_File):
    """A file that a command writes. "-" is stdout for --output alone, and no file of that name."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "-":
            if getattr(param, "key", "") == "output":
                return None
            self.fail("this cannot go to stdout: give the name of a file (./- for a file called -).", param, ctx)
        from handctl.system.disk import is_device

        if is_device(value):
            self.fail(f"{value} is a device, not a file. To connect to it, use -p {value}.", param, ctx)
        return super().convert(value, param, ctx)


class NamedFile(NamedTuple):
    """A file of this run: its name for the user, its path, whether it is only appended to."""

    label: str
    path: str
    grows: bool = False


def files_of(ctx: click.Context) -> tuple[list[NamedFile], list[NamedFile]]:
    """The files that the parameters of this command name: inputs, outputs."""
    inputs: list[NamedFile] = []
    outputs: list[NamedFile] = []
    for param in ctx.command.params:
        kind, given = param.type, ctx.params.get(param.name or "")
        if not isinstance(kind, InFile | OutFile):
            continue
        label = param.get_usage_pieces(ctx)[0] if isinstance(param, click.Argument) else param.opts[0]
        group = inputs if isinstance(kind, InFile) else outputs
        for path in given if isinstance(given, tuple) else (given,):
            if path and path != "-":
                group += [NamedFile(label, f"{path}{ending}", kind.grows) for ending in ("", *kind.additional)]
                if group is inputs and os.path.islink(path):  # what belongs to the file itself is no output, either
                    group += [NamedFile(label, f"{os.path.realpath(path)}{ending}") for ending in kind.additional]
    return inputs, outputs


def refuse_clashes(inputs: list[NamedFile], outputs: list[NamedFile]) -> None:
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
        if not output.grows and os.path.realpath(output.path).startswith(os.path.join(os.path.realpath(kept), "")):
            raise UsageError(
                f"{output.label} {output.path}: handctl keeps its own records in {kept}",
                hint="name a file in another folder. Nothing was opened, and nothing was sent.",
                code="same-file",
            )
