"""`handctl shell`: commands at a prompt, on one open link."""

from __future__ import annotations

import click

from handctl.families import FAMILIES
from handctl.frame.clikit import Command
from handctl.frame.run import Run


@click.command("shell", cls=Command, writes=True)
@click.argument("family", required=False, type=click.Choice(list(FAMILIES)), metavar="[FAMILY]")
@click.pass_context
def cli(context: click.Context, family: str | None) -> None:
    """Type commands at a prompt. The link stays open between them.

    A line is a command without `handctl`. With FAMILY or -d the family may be left out too. TAB completes commands and
    quantities, and the history is kept. A port that was lost is opened again by the next line. Ctrl-C stops a movement,
    Ctrl-D ends the shell.
    """
    from handctl.frame.shell import shell

    run: Run = context.obj
    shell(run, context, family or "")
