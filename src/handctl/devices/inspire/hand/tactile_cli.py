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
        "--watch", "live", is_flag=True, help="Keep reading: a live picture on a terminal, otherwise a stream of rows."
    )
    @streaming(5.0)
    def tactile(
        run: Run, zones: tuple[str, ...], live: bool, rate: float, count: int | None, duration: float | None
    ) -> Table:
        """Show the tactile sensors of an RH56DFTP. Only reads.

        It has 17 zones with 1062 values from 0 to 4095. ZONE is a zone such as `index_tip`, a finger, or `palm`.
        On a terminal this draws a picture, otherwise it prints a row for each value. `--watch -o FILE.csv` records a log.
        """
        from handctl.devices.inspire.hand import tactile as skin

        chosen = skin.chosen(zones)
        if not live and (count is not None or duration is not None):
            raise UsageError("--count and --duration need --watch", hint="add --watch")
        run.streams = live
        hand = run.device()
        if live:
            return skin.watch(hand, chosen, rate=rate, count=count, duration=duration)
        return skin.tactile(hand, chosen, wide=get_terminal_size().columns >= SIDE_BY_SIDE)
