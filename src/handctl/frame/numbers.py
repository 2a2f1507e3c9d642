"""Numbers on the command line: types of click that say in words which numbers they accept."""

from __future__ import annotations

from typing import Any

import click

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Settings of a command that takes ``-100`` as an argument; `vectors.given` then refuses a mistyped option."""
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
