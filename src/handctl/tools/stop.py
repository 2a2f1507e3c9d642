"""`handctl stop`: stop a device at once, named by its LINK or its name: `tools.whose` finds out of which family it is."""

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
    """Stop a device at once, even while another handctl command is using it.

    handctl takes the family from the device's name, or from the handctl command that is using the device or used it last.
    Otherwise it looks for a named device on this port, then tries for 0.5 s to detect the device.
    If that fails, use `handctl FAMILY stop`. The other handctl command ends with exit code 130.
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
            "no device given",
            hint="give -p LINK or -d NAME (see `handctl devices list`)",
            code="no-link",
        )
    simulated = settings.port.removeprefix("fake://").partition("?")[0].rstrip("/")
    if settings.port.startswith("fake://") and simulated in FAMILIES:
        return simulated
    from handctl.tools.whose import family_at

    return family_at(run)
