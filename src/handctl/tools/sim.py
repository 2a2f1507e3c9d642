"""`handctl sim`: the simulators' own commands, and `forget` for what plain --fake keeps of them."""

from __future__ import annotations

import click

from handctl.families import FAMILIES
from handctl.link import kept
from handctl.sim.cli import SimError, cli

__all__ = ["cli"]


@cli.command("forget", short_help="Begin afresh with --fake: remove what is kept of a simulated device.")
@click.argument("family", type=click.Choice(list(FAMILIES)), metavar=f"[{'|'.join(FAMILIES)}]", required=False)
def forget(family: str | None) -> None:
    """Begin afresh with --fake: remove what is kept of FAMILY, or of all families.

    A simulated device of plain --fake keeps its changes until you log out, so that `init` then `close` works. `watch` and
    `report` show the device in use and change nothing. A LINK fake://... always begins afresh. The exit status is 0 also
    where nothing was kept.
    """
    for kind in [family] if family is not None else FAMILIES:
        try:
            found = kept.forget(kind)
        except OSError as exc:
            raise SimError(
                f"{exc.filename}: cannot be removed: {exc.strerror or exc}", hint="remove the file yourself"
            ) from exc
        click.echo(f"{kind}: removed, it begins afresh" if found else f"{kind}: nothing was kept")
