"""`handctl exo …`: the commands of the EH55BF1. Each body checks its arguments, asks a device, returns a Table."""

from __future__ import annotations

import click

from handctl.command.command_tree import Group
from handctl.command.common_commands import add_map_verbs
from handctl.command.expect import expect, expected
from handctl.command.family import Family
from handctl.command.get_set_watch import going
from handctl.command.options import NEGATIVE_NUMBERS, SECONDS
from handctl.command.run import Asked, PlannedAction, Run
from handctl.devices.inspire import common_cli as verbs
from handctl.devices.inspire.exo import device
from handctl.devices.inspire.exo.device import ExoHand, parse_command
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.register_map import BAUD_RATES, address_in
from handctl.errors import Hint, UsageError
from handctl.model.result import Table

cli = Group(
    "exo",
    family=Family("exo", device.open_exo, 115200, verbs.explain_silence, ids=True, speeds=tuple(BAUD_RATES.values())),
    first=("position", "force", "clear-errors", "calibrate", "scan"),
    help="Inspire EH55BF1 exoskeleton hand, over RS-232 or a Bluetooth serial port. A person may be wearing it. "
    "Commands that move it or change it permanently ask first.",
)


add_map_verbs(
    cli,
    EXO,
    part="FINGER",
    example="position_actual.index temperature",
    setting="position_set.index=300 force_set=0,0,0,0,0",
    set_asks=True,
)


# -- by number ----------------------------------------------------------------------------------------------------


@cli.verb("read", "Service")
@verbs.SPAN
def read(run: Run, address: str, count: int) -> Table:
    """Read COUNT bytes (1 to 252) from any ADDRESS. Registers from the manual are decoded."""
    return verbs.read(run, address, count)


@cli.verb("write", "Service", writes=True, asks=True)
@verbs.BYTES
@verbs.UNDOCUMENTED
def write(run: Run, address: str, data: str, undocumented: bool) -> PlannedAction:
    """Write bytes to ADDRESS, low byte first, and read them back. Asks first.

    The values are checked against the manual before anything is sent."""
    from handctl.devices.inspire import raw as by_number

    place, payload = address_in(address), by_number.parse_hex(data)
    step = by_number.plan_write(run.planner(), place, payload, undocumented)
    question = f"This writes to a hand that a person may be wearing: {step.meaning}"
    return PlannedAction([step], lambda hand: by_number.write(hand, place, payload), question)


@cli.verb("raw", "Service", writes=True, asks=True)
@verbs.FRAME
@verbs.forced(
    help="Also send a frame that means something else to another Inspire device, or that has a value out of range."
)
def raw(run: Run, data: tuple[str, ...], wait: float, force_ambiguous: bool) -> PlannedAction:
    """Send exactly these bytes and show the decoded reply. Everything except a read asks first."""
    from handctl.devices.inspire import raw as by_number
    from handctl.devices.inspire.exo import raw as exo_raw

    frame = by_number.parse_hex(" ".join(data))
    step = exo_raw.plan_raw(frame, force_ambiguous)
    return verbs.send_raw(step, exo_raw.WORN, lambda hand: by_number.exchange(hand, frame, wait))


# -- what it keeps ------------------------------------------------------------------------------------------------


@cli.verb("id", "Settings", writes=True, asks=True)
@click.argument("new", required=False, type=int)
def id_(run: Run, new: int | None) -> Table | PlannedAction:
    """Show the id, or give the hand a NEW one (1 to 254).

    A new id is active at once, and `save` makes it permanent. Connect only one hand.
    """
    return verbs.change_id(run, EXO, new)


@cli.verb("baud", "Settings", writes=True, asks=True)
@verbs.RATE
def baud(run: Run, rate: int | None, save_too: bool, verify: bool) -> Table | PlannedAction:
    """Show the baud rate code, or set a new RATE: 115200, 57600 or 19200 bit/s.

    The new baud rate takes effect after `save` and a power-cycle.
    """
    question = f"After a save and a power-cycle the hand uses {rate} bit/s only. A Bluetooth module may stay at the old baud rate: have an RS-232 cable ready"
    return verbs.change_baud(run, rate, question, save=save_too, verify=verify)


cli.verb("clear-errors", "Service", writes=True)(verbs.clear_errors)
SKIP_IDENTITY = click.option("--skip-identity-check", is_flag=True, help="Skip the check that this is an EH55BF1.")


@cli.verb("save", "Settings", writes=True, asks=True)
@SKIP_IDENTITY
def save(run: Run, skip_identity_check: bool) -> PlannedAction:
    """Save the present settings to flash and wait for the result (about 1 s)."""
    question = "This saves the present settings to flash. According to the manual, only id and baud_code are kept"
    return verbs.save(run, question, looks=not skip_identity_check)


@cli.verb("factory-reset", "Settings", writes=True, asks=True)
@click.option(
    "--undocumented-address",
    is_flag=True,
    help="Write to address 1006, known from the RH56 hand. The manual of this hand gives no address.",
)
@verbs.backup_option(help=verbs.BACKUP_HELP.format("exo"))
@SKIP_IDENTITY
def factory_reset(run: Run, undocumented_address: bool, backup: str | None, skip_identity_check: bool) -> PlannedAction:
    """Restore the factory defaults, after a snapshot of the present settings.

    The manual gives no address for this: see --undocumented-address."""
    if not undocumented_address:
        raise UsageError(
            "the manual describes a factory reset but gives no address for it (exo §2.3.5)",
            hint="add --undocumented-address to use 1006, the address of the RH56 hand. Nothing was sent.",
        )
    meaning = "factory reset at an undocumented address"
    question = "This restores the factory defaults permanently, at an address that is not in the manual"
    return verbs.factory_reset(run, meaning, question, backup, looks=not skip_identity_check)


# -- what moves it ------------------------------------------------------------------------------------------------

FIVE = "LITTLE RING MIDDLE INDEX THUMB | FINGER=VALUE..."


@cli.verb("calibrate", "Service", writes=True, asks=True)
def calibrate(run: Run) -> PlannedAction:
    """Calibrate forces and positions, guided step by step.

    Ctrl-C does not stop the hand. To stop it, switch its power off.
    Someone has to wear the hand, and it moves the wearer's fingers.
    """
    from handctl.devices.inspire.exo import calibration

    steps = [run.planner().trigger_step("calibrate", "calibrate")]
    if not run.settings.dry_run:
        calibration.say_steps(run.prompts)
    return PlannedAction(steps, lambda hand: calibration.calibrate(hand, run.prompts), calibration.QUESTION)


@cli.verb("force", "Move", writes=True, asks=True, context_settings=NEGATIVE_NUMBERS)
@click.argument("values", nargs=-1, required=True, metavar=FIVE)
def force(run: Run, values: tuple[str, ...]) -> PlannedAction:
    """Command forces from -1000 (closes the hand) to 1000 (opens it). Asks first.

    Give all five in order, or name individual fingers: `force ring=100`.
    A force stays in effect until you command another one. `force 0 0 0 0 0` releases the hand.
    The result shows what the reply contains: the positions or, if you named individual fingers, the forces.
    """
    return _command(run, "force", values)


@cli.verb("position", "Move", writes=True, asks=True, context_settings=NEGATIVE_NUMBERS)
@click.argument("values", nargs=-1, required=True, metavar=FIVE)
@click.option(
    "--wait",
    type=SECONDS,
    metavar="S",
    help="Wait up to S seconds for the fingers to stop moving. Ctrl-C makes them hold their position.",
)
@expect
def position(run: Run, values: tuple[str, ...], wait: float | None, expect: str | None) -> PlannedAction:
    """Command positions from 0 (bent) to 1000 (open). Asks first.

    Give all five in order, where -1 leaves a finger as it is, or name individual fingers: `position ring=900
    index=100`. The result shows what the reply contains: the forces or, if you named individual fingers, the targets.
    With --wait it shows the positions reached.
    """
    return _command(run, "position", values, wait, expect)


def _command(
    run: Run, which: str, texts: tuple[str, ...], wait: float | None = None, expect: str | None = None
) -> PlannedAction:
    values = parse_command(which, texts)
    ending = expected(expect, waits=wait is not None)
    steps = run.planner().command_steps(which, values)

    def look(hand: ExoHand) -> Asked:
        return Asked(question, steps, going(run, hand, device.changes_of(which, values), "Finger"))

    def act(hand: ExoHand) -> Table:
        if wait is not None:
            return device.move(hand, values, run.prompts, wait=wait, expect=ending)
        table = device.command(hand, which, values, run.prompts)
        if which == "force" and any(values.values()):
            run.journal.info(
                "stays",
                "the force stays in effect until you command another one",
                hint=Hint("{} releases the hand", "exo force 0 0 0 0 0"),
            )
        return table

    question = "This moves a hand that a person may be wearing"
    meanings = "; ".join(step.meaning for step in steps)
    return PlannedAction(steps, act, f"{question}: {meanings}", look=look)
