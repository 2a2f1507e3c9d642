"""`--expect`: how a movement must end to be a success. One option for every command that moves and waits."""

from __future__ import annotations

import click

from handctl.errors import UsageError
from handctl.model.movement import EXPECTED, REACHED

expect = click.option(
    "--expect",
    type=click.Choice(EXPECTED),
    default=None,
    help="How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. "
    "contact: stopped by an object. any: either of these, or moved and stopped short of the target.",
)


def expected(given: str | None, *, waits: bool = True) -> str:
    """The given result, by default `reached`. Raises UsageError if the command does not wait for the end."""
    if given is not None and not waits:
        raise UsageError(
            f"--expect {given}: without --wait this command does not see how the movement ends",
            hint="add --wait S. Nothing was sent.",
        )
    return given or REACHED
