"""`handctl shell`: commands at a prompt, on one open link."""

from __future__ import annotations

import click

from handctl.command.command_tree import Command
from handctl.command.run import Run
from handctl.families import FAMILIES


@click.command("shell", cls=Command, writes=True)
@click.argument("family", required=False, type=click.Choice(list(FAMILIES)), metavar="[FAMILY]")
def cli(run: Run, family: str | None) -> None:
    """Type commands at a prompt. The link stays open between them.

    Type each command without `handctl`. If you give FAMILY or -d, leave out the family too. TAB completes commands and
    quantities, and the history is kept. `sleep S` waits S seconds. If the port was lost, the next line opens it again. Ctrl-C stops a movement,
    Ctrl-D ends the shell.
    """
    from handctl.command.batch_and_shell import shell

    shell(run, family or "")
