"""Numbers on the command line: types of click that refuse what is none."""

from __future__ import annotations

from typing import Any

import click

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Settings of a command that takes ``-100`` as an argument; `vectors.given` then refuses a mistyped option."""
LONGEST = 1e6
"""Seconds, 11 days: more is a slip of the pen, and more than some clocks of an operating system can wait for."""


class FiniteRange(click.FloatRange):
    """A number in a range; nan and inf are none."""

    what = "a number that can be used"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not float("-inf") < number < float("inf"):
            self.fail(f"{value} is not {self.what}.", param, ctx)
        return number


class Seconds(FiniteRange):
    """A number above 0 that a clock can wait for."""

    what = "a number of seconds"

    def __init__(self) -> None:
        super().__init__(min=0, min_open=True, max=LONGEST)


class Hertz(FiniteRange):
    """Samples a second: 0 for as fast as it goes, or a rate whose period a clock can wait for."""

    what = "a rate"

    def __init__(self) -> None:
        super().__init__(min=0)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        rate = super().convert(value, param, ctx)
        if 0 < rate < 1 / LONGEST:
            self.fail(f"{value} is one sample in more than {LONGEST:.0f} seconds.", param, ctx)
        return rate
