"""`handctl hand network`: the IP address of a tactile hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from handctl.errors import UsageError
from handctl.frame.clikit import Group
from handctl.frame.run import Run
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand


def add_network(group: Group) -> None:
    """Add the command to the family's group."""

    @group.verb("network", "Settings", writes=True)
    @click.argument("address", required=False)
    def network(run: Run, address: str | None) -> Table:
        """Show the IP address of a tactile hand, or give it a new ADDRESS.

        First switch off every other hand that has the old address. handctl asks you to type the new one to confirm.
        The new address is saved and takes effect after a power-cycle. This computer then needs an address in the same network.
        """
        from handctl.devices.inspire.hand import place

        if address is None:
            if run.settings.dry_run:
                raise UsageError(
                    "`handctl hand network` without a value only reads",
                    hint="run it without -n: it does not change anything",
                )
            run.only_reads()
            return place.show_network(run.device())
        octets = place.octets_of(address)
        planner = run.planner()
        steps = planner.plan(place.address_plan(planner, octets))
        steps.append(planner.trigger_step("save", "save to flash"))
        if (plan := run.planned(steps)) is not None:
            return plan
        question = f"This changes the IP address of the hand to {address}, after a power-cycle"
        run.need_answer(question)
        hand: Hand = run.device()
        hand.identify()
        before = ".".join(map(str, place.held(hand)))
        question = f"This changes the IP address of the hand from {before} to {address}, after a power-cycle"
        computer = f"This computer must then have an address such as {place.laptop_for(octets)}, mask 255.255.255.0"
        run.confirm(f"{question}. {computer}. To go back, run `handctl hand network {before}`", steps, word=address)
        return place.change_network(hand, octets, run.guide)
