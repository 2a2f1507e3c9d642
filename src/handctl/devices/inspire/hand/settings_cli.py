"""`handctl hand id | baud | save | factory-reset | clear-errors`: what a hand keeps, and where it is found."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

from handctl.devices.inspire.hand.typed import map_of
from handctl.errors import CheckFailed, NoAnswer, UsageError
from handctl.frame import stored, verbs
from handctl.frame.clikit import Group
from handctl.frame.run import Run
from handctl.frame.types import OutFile
from handctl.model.param import Element
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

BACKUP = "hand-before-reset.json"


def met(run: Run) -> Hand:
    """The hand, proved to be of a generation that may be written to. Raises NotIdentified, NoAnswer."""
    from handctl.devices.inspire import twins

    hand: Hand = run.device()
    with twins.named(hand):
        hand.identify()
    return hand


def add_settings(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("id", "Settings", writes=True)
    @click.argument("new", required=False, type=int)
    def id_(run: Run, new: int | None) -> Table:
        """Show the id, or give the hand a NEW one (1 to 254).

        A new id is active at once, and `save` makes it permanent. Connect only one hand. Modbus calls the id the unit.
        """
        if new is None:
            _only_reads(run, "id")
            return verbs.get(run, map_of(run.settings), ["id"])
        return _change_id(run, new)

    @group.verb("baud", "Settings", writes=True)
    @click.argument("rate", required=False, type=int)
    @click.option(
        "--save",
        "save_too",
        is_flag=True,
        help="Then save to flash. The new baud rate takes effect only after a save and a power-cycle.",
    )
    @click.option(
        "--verify",
        is_flag=True,
        help="Wait up to 120 s for the power-cycle, then check that the hand replies at the new baud rate.",
    )
    def baud(run: Run, rate: int | None, save_too: bool, verify: bool) -> Table:
        """Show the baud rate code, or set a new RATE in bit/s.

        A serial hand takes 115200, 57600 or 19200, and some take 921600. On CAN it is 1000000 or 500000.
        The new rate takes effect after `save` and a power-cycle.
        """
        from handctl.devices.inspire.hand import place

        if rate is None:
            _only_reads(run, "baud")
            hand: Hand = run.device()
            hand.know()
            return place.show_speed(hand)
        return _change_baud(run, rate, save_too, verify)

    @group.verb("clear-errors", "Service", writes=True)
    def clear_errors(run: Run) -> Table:
        """Clear actuator errors and show which remain. Asks first if a finger may move.

        A finger that an error stopped may then go on to its target.
        An over-temperature error cannot be cleared. It goes away once the actuator has cooled down.
        """
        from handctl.devices.inspire import flash

        steps = [run.planner().trigger_step("clear_errors", "clear errors")]
        if (plan := run.planned(steps)) is not None:
            return plan
        hand = met(run)
        steps = [hand.trigger_step("clear_errors", "clear errors")]
        verbs.ask_released(run, hand, [(Element(hand.map["clear_errors"], 0), 1)], steps)
        return flash.clear_errors(hand)

    @group.verb("save", "Settings", writes=True)
    def save(run: Run) -> Table:
        """Save the present settings to flash and wait for the result (about 1 s)."""
        from handctl.devices.inspire import flash

        steps = [run.planner().trigger_step("save", "save to flash")]
        if (plan := run.planned(steps)) is not None:
            return plan
        run.confirm("This saves the present settings to flash", steps)
        return flash.save(met(run), run.guide)

    @group.verb("factory-reset", "Settings", writes=True)
    @click.option(
        "--backup",
        metavar="FILE",
        type=OutFile(),
        help=f"Write the snapshot to FILE (default: {BACKUP}). An existing file is never overwritten.",
    )
    def factory_reset(run: Run, backup: str | None) -> Table:
        """Restore the factory defaults, after a snapshot of the present settings.

        This may set the id to 1, the baud rate to 115200 bit/s and the network address to 192.168.11.210.
        """
        from handctl.devices.inspire import flash

        steps = [run.planner().trigger_step("factory_reset", "factory reset")]
        if (plan := run.planned(steps)) is not None:
            return plan
        path = backup or BACKUP
        if os.path.exists(path):
            raise UsageError(
                f"{path}: this file already exists, and handctl does not overwrite it",
                hint="choose another file with --backup FILE",
            )
        run.confirm("This restores the factory defaults permanently", steps, word="reset")
        hand = met(run)
        stored.snapshot(run, path)
        return flash.factory_reset(hand)


def _change_id(run: Run, new: int) -> Table:
    from handctl.devices.inspire import procedures, twins
    from handctl.devices.inspire.modbusbus import ModbusBus

    params = map_of(run.settings)
    params["id"].check(new, "id")
    change = [(params.find("id")[1][0], new)]
    steps = run.planner().plan(change)
    if (plan := run.planned(steps)) is not None:
        return plan
    run.confirm(f"This changes the id to {new} at once, on every hand on this line that has the old id", steps)
    hand: Hand = run.device()
    try:
        with twins.named(hand):
            hand.identify()
    except NoAnswer:
        return procedures.change_id(hand, new)  # perhaps it has the new id already
    if isinstance(hand.bus, ModbusBus) and hand.bus.tcp:
        run.journal.info(
            "unit", "over TCP a hand answers to every unit: its id only matters on its serial line or CAN bus"
        )
        return hand.table(hand.write(change))
    return procedures.change_id(hand, new)


def _change_baud(run: Run, rate: int, save_too: bool, verify: bool) -> Table:
    from handctl.devices.inspire import flash
    from handctl.devices.inspire.hand import place

    planner: Hand = run.planner()
    code = place.code_of(planner, rate)
    if verify and not save_too:
        raise UsageError("--verify needs --save: without a save the hand keeps its old baud rate", hint="add --save")
    if verify and not place.is_serial(planner):
        raise UsageError("--verify needs a serial line", hint="leave out --verify, and scan after the power-cycle")
    steps = planner.plan([(map_of(run.settings).find("baud_code")[1][0], code)])
    if save_too:
        steps.append(planner.trigger_step("save", "save to flash"))
    if (plan := run.planned(steps)) is not None:
        return plan
    run.confirm(f"After a save and a power-cycle the hand uses {rate} bit/s only", steps)
    hand = met(run)
    table = place.change_speed(hand, code, rate)
    if save_too or run.offer("Save it to flash now"):
        table.rows += flash.save(hand, run.guide).rows
        if verify or (
            place.is_serial(hand) and run.offer("Wait for the power-cycle and check the hand at the new baud rate")
        ):
            _verify_speed(run, hand, rate, table)
        else:
            run.journal.info(
                "power-cycle",
                "the hand keeps its old baud rate until you power-cycle it",
                hint=f"power-cycle the hand, then use --baud {rate}",
            )
    else:
        run.journal.warn(
            "not-saved",
            f"{rate} bit/s is not saved, so the hand keeps its old baud rate",
            hint=f"run `handctl hand save --id {hand.bus.id}`, then power-cycle the hand",
        )
    return table


def _verify_speed(run: Run, hand: Hand, rate: int, table: Table) -> None:
    from handctl.devices.inspire import procedures

    if procedures.wait_for_speed(hand, rate, run.guide):
        table.rows.append(
            {"name": "verified_baud", "finger": None, "address": None, "value": rate, "unit": "baud", "raw": None}
        )
        return
    table.failure = CheckFailed(
        f"{hand.bus.link.name}: no hand at {rate} bit/s after the power-cycle",
        hint="one edition of the manual says that this baud rate is not kept. `handctl hand scan` tries all ids and baud rates",
        code="not-kept",
    )


def _only_reads(run: Run, name: str) -> None:
    if run.settings.dry_run:
        raise UsageError(
            f"`handctl hand {name}` without a value only reads", hint="run it without -n: it does not change anything"
        )
    run.only_reads()
