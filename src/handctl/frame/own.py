"""Options of one family that only some of its commands have: declared in its row, asked for by the command."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

from handctl.families import FAMILIES

OWN = "handctl.own"
"""Key in click's shared meta: the values of such options by the name that they have in `settings.own`."""


class Own(click.Option):
    """`@click.option("--operator", cls=Own, of="ekso")`. `check` raises UsageError for a value that makes no sense."""

    def __init__(self, names: Sequence[str], of: str, check: Callable[[Any], object] | None = None) -> None:
        (option,) = (row for row in FAMILIES[of].options if f"--{row.name}" in names)
        self._check = check
        super().__init__(
            list(names),
            envvar=f"HANDCTL_{option.key.upper()}",
            metavar=option.metavar,
            help=option.help,
            expose_value=False,
            callback=self._remember,
        )

    def _remember(self, ctx: click.Context, param: click.Parameter, value: Any) -> None:
        if value is None:
            return
        if self._check is not None:
            self._check(value)
        ctx.meta.setdefault(OWN, {})[param.name] = value
