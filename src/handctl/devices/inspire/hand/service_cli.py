"""`handctl hand read | write | raw`: registers and frames by number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from handctl.devices.inspire.hand.settings_cli import met
from handctl.devices.inspire.map import address_in
from handctl.errors import joined
from handctl.frame.clikit import Group
from handctl.frame.run import Run
from handctl.frame.types import Seconds
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand


def add_service(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("read", "Service")
    @click.argument("address")
    @click.argument("count", type=int)
    def read(run: Run, address: str, count: int) -> Table:
        """Read COUNT bytes (1 to 252) from any ADDRESS. Registers from the manual are decoded.

        On an RH56F1 or RH5DG2 each address holds a word of two bytes.
        """
        from handctl.devices.inspire import eb90
        from handctl.devices.inspire.exo import raw as exo_raw

        place = address_in(address)
        eb90.check_span(place, count)
        hand: Hand = run.device()
        hand.know()
        return hand.answered(lambda: exo_raw.read(hand, place * hand.bus.per, count))

    @group.verb("write", "Service", writes=True)
    @click.argument("address")
    @click.argument("data", metavar="HEX")
    @click.option("--undocumented", is_flag=True, help="Allow an address that is not in the manual.")
    def write(run: Run, address: str, data: str, undocumented: bool) -> Table:
        """Write bytes to ADDRESS, low byte first, and read them back. Asks first.

        The values are checked against the documented ranges before anything is sent."""
        from handctl.devices.inspire.exo import raw as exo_raw
        from handctl.devices.inspire.hand import motion
        from handctl.devices.inspire.hand import raw as hand_raw

        payload, planner = exo_raw.parse_hex(data), run.planner()
        place = address_in(address) * planner.bus.per
        step = hand_raw.plan_write(planner, place, payload, undocumented)
        if (plan := run.planned([step])) is not None:
            return plan
        question = f"This writes to the hand: {step.meaning}"
        run.need_answer(question)
        hand = met(run)
        changes = hand_raw.changes_of(hand, place, payload)
        if step.moves:
            question = motion.question(hand, changes, motion.fit_to_move(hand))
        also = motion.also(hand, changes)
        run.confirm(joined(question, also), [hand_raw.plan_write(hand, place, payload, undocumented)])
        if also:
            hand.will_move()
        return exo_raw.write(hand, place, payload)

    @group.verb("raw", "Service", writes=True)
    @click.argument("data", nargs=-1, required=True, metavar="HEX...")
    @click.option(
        "--wait",
        type=Seconds(),
        default=0.5,
        show_default=True,
        metavar="S",
        help="Listen for S seconds after the last byte.",
    )
    @click.option(
        "--force-ambiguous",
        is_flag=True,
        help="Also send a frame that resets the hand, starts a stored movement or has a value out of range.",
    )
    def raw(run: Run, data: tuple[str, ...], wait: float, force_ambiguous: bool) -> Table:
        """Send exactly these EB90 or Modbus bytes and show the decoded reply.

        Everything except a read asks first."""
        from handctl.devices.inspire.exo import raw as exo_raw
        from handctl.devices.inspire.hand import raw as hand_raw

        frame = exo_raw.parse_hex(" ".join(data))
        hand_raw.choose_wire(run, frame)
        step = hand_raw.plan(run.planner(), frame, force_ambiguous)
        if (plan := run.planned([step])) is not None:
            return plan
        if step.moves or step.strands:
            run.confirm(f"This may move or change the hand: {step.meaning}", [step])
        hand: Hand = run.device()
        with exo_raw.goes_on(hand, step):
            return hand_raw.exchange(hand, frame, wait)
