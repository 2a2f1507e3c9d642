"""`handctl stop`: stop a device at once, named by its LINK or its name. The family is told by the lock of who has it."""

from __future__ import annotations

import click

from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.frame.clikit import Command
from handctl.frame.family import load
from handctl.frame.run import Run
from handctl.model.result import Table


@click.command("stop", cls=Command, writes=True, stops=True)
@click.pass_obj
def cli(run: Run) -> Table:
    """Stop a device at once, also while another handctl has it: -p LINK or -d NAME. Asks nothing.

    Which family it is of is told by its name, or by the lock of the handctl that has it or had it last and was killed.
    Elsewhere `handctl FAMILY stop` stops it. Exit 130 in the other handctl.
    """
    from handctl.stop import command

    kind = _kind(run)
    run.family = load(kind, "cli").cli.family
    return command.stop(run)


def _kind(run: Run) -> str:
    """The family of the device that was named. Raises UsageError where nothing tells it."""
    settings = run.settings
    if settings.kind is not None:
        return settings.kind
    if settings.port is None:
        raise UsageError(
            "which device is to be stopped?",
            hint="-p LINK or -d NAME (see `handctl devices list`); `handctl FAMILY stop --fake` stops a simulated one",
            code="no-link",
        )
    simulated = settings.port.removeprefix("fake://").partition("?")[0].rstrip("/")
    if settings.port.startswith("fake://") and simulated in FAMILIES:
        return simulated
    from handctl.link.lock import last_holder

    holder = last_holder(settings.port)
    if holder is not None and holder.family in FAMILIES:
        return holder.family
    families = ", ".join(FAMILIES)
    raise UsageError(
        f"{settings.port}: no handctl has it, so nothing tells which family it is of",
        hint=f"`handctl FAMILY stop -p {settings.port}` stops it at once; FAMILY is {families}",
        code="no-family",
    )
