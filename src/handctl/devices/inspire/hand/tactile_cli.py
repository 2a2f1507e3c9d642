"""`handctl hand tactile`: the skin of a tactile hand, once or as a stream."""

from __future__ import annotations

from shutil import get_terminal_size

import click

from handctl.errors import UsageError
from handctl.frame.clikit import Group, streaming
from handctl.frame.run import Run
from handctl.model.result import Table

SIDE_BY_SIDE = 60
"""Columns of a window in which the fingers stand side by side."""


def add_tactile(group: Group) -> None:
    """Add the command to the family's group."""

    @group.verb("tactile", "Look")
    @click.argument("zones", nargs=-1, metavar="[ZONE]...")
    @click.option(
        "--watch", "live", is_flag=True, help="Go on: a live picture on a terminal, a stream of rows elsewhere."
    )
    @streaming(5.0)
    def tactile(
        run: Run, zones: tuple[str, ...], live: bool, rate: float, count: int | None, duration: float | None
    ) -> Table:
        """Show the tactile sensors of an RH56DFTP: 17 zones, 1062 values of 0 to 4095. Only reads.

        A picture on a terminal, a row for each value elsewhere. ZONE is one such as `index_tip`, or a finger, or `palm`.
        `--watch -o FILE.csv` makes a log.
        """
        from handctl.devices.inspire.hand import tactile as skin

        chosen = skin.chosen(zones)
        if not live and (count is not None or duration is not None):
            raise UsageError("--count and --duration need a stream", hint="add --watch")
        run.streams = live
        hand = run.device()
        if live:
            return skin.watch(hand, chosen, rate=rate, count=count, duration=duration)
        return skin.tactile(hand, chosen, wide=get_terminal_size().columns >= SIDE_BY_SIDE)
