"""`handctl batch`: many commands on one open link, from a script or from stdin."""

from __future__ import annotations

import click

from handctl.command.command_tree import Command
from handctl.command.options import InFile
from handctl.command.run import Run
from handctl.model.result import Table


@click.command("batch", cls=Command, writes=True, streams=True)
@click.argument("file", type=InFile(), default="-", metavar="[FILE]")
@click.option(
    "--keep-going",
    is_flag=True,
    help="Continue after a line that failed. The exit code is still that of the first failure.",
)
def cli(run: Run, file: str, keep_going: bool) -> Table | None:
    """Run many commands on one open link, from FILE or stdin.

    Write each command on its own line, without `handctl`. `#` starts a comment, and `sleep S` waits S seconds. Options such as -p, -d, --yes and --json
    apply to every line that does not set its own. handctl checks all lines before it sends anything. If some lines
    need confirmation, it lists them and asks once. The exit code is that of the first line that failed.
    """
    from handctl.command.batch_and_shell import batch

    return batch(run, file, keep_going=keep_going)
