"""`handctl sim`: the commands of the simulators with their option --transcript, which needs a decoder, and `forget`, which resets
the saved state of plain --fake.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import click

from handctl.families import FAMILIES
from handctl.link import fake
from handctl.link.twin_values import values_of
from handctl.sim.cli import SimError, cli

__all__ = ["cli"]
TRANSCRIPT = (
    "Show the values of the device that was recorded with `--trace FILE`, as it was left, and reply as quickly."
)


def _serve(kind: str, serve: Callable[..., None], transcript: str | None, **given: Any) -> None:
    """Serve with the values of the transcript, if there is one."""
    if transcript is not None:
        given["values"] = values_of(kind, transcript)
    serve(**given)


for _kind in FAMILIES:
    _command = cli.commands[_kind]
    assert _command.callback is not None
    _command.params.append(click.Option(["--transcript"], metavar="FILE", help=TRANSCRIPT))
    _command.callback = partial(_serve, _kind, _command.callback)


@cli.command("forget", short_help="Reset the devices that --fake simulates.")
@click.argument("family", type=click.Choice(list(FAMILIES)), metavar=f"[{'|'.join(FAMILIES)}]", required=False)
def forget(family: str | None) -> None:
    """Reset the devices that --fake simulates: FAMILY, or all families.

    With plain --fake the simulated device keeps its state until you log out, so `init` then `close` works. `watch` and
    `report` show the device in use and change nothing. A LINK fake://... always starts over. The exit code is 0 even if
    there was nothing to reset.
    """
    for kind in [family] if family is not None else FAMILIES:
        try:
            found = fake.forget(kind)
        except OSError as exc:
            raise SimError(
                f"{exc.filename}: cannot be removed: {exc.strerror or exc}", hint="remove the file yourself"
            ) from exc
        click.echo(f"{kind}: reset" if found else f"{kind}: nothing to reset")
