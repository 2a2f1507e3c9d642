"""`handctl exo …`: the commands of the EH55BF1. Each body checks its arguments, asks a device, returns a Table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from handctl.devices.inspire import eb90
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.exo.motion_cli import add_movements
from handctl.devices.inspire.identity import FamilyGate, kind_of
from handctl.devices.inspire.map import BAUD_RATES, EXO, address_in
from handctl.errors import HandctlError, NoAnswer, UsageError
from handctl.frame import stored, verbs
from handctl.frame.clikit import Group
from handctl.frame.family import Family
from handctl.frame.mapverbs import add_map_verbs
from handctl.frame.run import Run
from handctl.frame.types import OutFile, Seconds
from handctl.model.device import limits_of
from handctl.model.param import Element
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.frame.options import Settings
    from handctl.link import ByteLink
    from handctl.model.result import Journal


def open_exo(link: ByteLink, settings: Settings, journal: Journal) -> ExoHand:
    """An EH55BF1 behind `link` with the options the user gave."""
    bus = Bus(link, settings.id if settings.id is not None else 1, journal, **limits_of(settings, link))
    bus.gate = FamilyGate(kind_of("exo"), settings.assume_identity)
    return ExoHand(bus)


def explain_silence(device: ExoHand, error: HandctlError) -> HandctlError:
    """Whether the silent hand is there at another speed."""
    from handctl.devices.inspire import procedures

    return procedures.explain_silence(device, error)


cli = Group(
    "exo",
    family=Family("exo", open_exo, 115200, explain_silence, ids=True, speeds=tuple(BAUD_RATES.values())),
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
)


# -- reading ------------------------------------------------------------------------------------------------------


@cli.verb("read", "Service")
@click.argument("address")
@click.argument("count", type=int)
def read(run: Run, address: str, count: int) -> Table:
    """Read COUNT bytes (1 to 252) from any ADDRESS. Registers from the manual are decoded."""
    from handctl.devices.inspire.exo import raw as exo_raw

    place = address_in(address)
    eb90.check_span(place, count)
    return exo_raw.read(run.device(), place, count)


# -- writing ------------------------------------------------------------------------------------------------------


@cli.verb("write", "Service", writes=True)
@click.argument("address")
@click.argument("data", metavar="HEX")
@click.option("--undocumented", is_flag=True, help="Allow an address that is not in the manual.")
def write(run: Run, address: str, data: str, undocumented: bool) -> Table:
    """Write bytes to ADDRESS, low byte first, and read them back. Asks first.

    The values are checked against the manual before anything is sent."""
    from handctl.devices.inspire.exo import raw as exo_raw

    place = address_in(address)
    step = exo_raw.plan_write(run.planner(), place, exo_raw.parse_hex(data), undocumented)
    if (plan := run.planned([step])) is not None:
        return plan
    run.confirm(f"This writes to a hand that a person may be wearing: {step.meaning}", [step])
    return exo_raw.write(run.device(), place, exo_raw.parse_hex(data))


@cli.verb("raw", "Service", writes=True)
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
    help="Also send a frame that means something else to another Inspire device, or that has a value out of range.",
)
def raw(run: Run, data: tuple[str, ...], wait: float, force_ambiguous: bool) -> Table:
    """Send exactly these bytes and show the decoded reply. Everything except a read asks first."""
    from handctl.devices.inspire.exo import raw as exo_raw

    frame = exo_raw.parse_hex(" ".join(data))
    step = exo_raw.plan_raw(frame, force_ambiguous)
    if (plan := run.planned([step])) is not None:
        return plan
    if step.moves or step.strands:
        run.confirm(f"This may move or change a hand that a person may be wearing: {step.meaning}", [step])
    hand = run.device()
    with exo_raw.goes_on(hand, step):
        return exo_raw.exchange(hand, frame, wait)


@cli.verb("id", "Settings", writes=True)
@click.argument("new", required=False, type=int)
def id_(run: Run, new: int | None) -> Table:
    """Show the id, or give the hand a NEW one (1 to 254).

    A new id is active at once, and `save` makes it permanent. Connect only one hand.
    """
    from handctl.devices.inspire import procedures

    if new is None:
        _only_reads(run, "id")
        return verbs.get(run, EXO, ["id"])
    EXO["id"].check(new, "id")
    steps = run.planner().plan([(EXO.find("id")[1][0], new)])
    if (plan := run.planned(steps)) is not None:
        return plan
    run.confirm(f"This changes the id to {new} at once, on every hand on this line that has the old id", steps)
    return procedures.change_id(run.device(), new)


@cli.verb("baud", "Settings", writes=True)
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
    """Show the baud rate code, or set a new RATE: 115200, 57600 or 19200 bit/s.

    The new baud rate takes effect after `save` and a power-cycle.
    """
    from handctl.devices.inspire import flash, procedures

    if rate is None:
        _only_reads(run, "baud")
        return verbs.get(run, EXO, ["baud_code"])
    code = procedures.code_of(rate)
    if code is None:
        raise UsageError(
            f"{rate} bit/s is not a baud rate of this hand",
            hint=f"choose one of {', '.join(map(str, BAUD_RATES.values()))} bit/s (exo §2.3.2). Nothing was sent.",
        )
    if verify and not save_too:
        raise UsageError("--verify needs --save: without a save the hand keeps its old baud rate", hint="add --save")
    planner = run.planner()
    steps = planner.plan([(EXO.find("baud_code")[1][0], code)])
    if save_too:
        steps.append(planner.trigger_step("save", "save to flash"))
    if (plan := run.planned(steps)) is not None:
        return plan
    run.confirm(
        f"After a save and a power-cycle the hand uses {rate} bit/s only. A Bluetooth module may stay at the old baud rate: have an "
        "RS-232 cable ready",
        steps,
    )
    hand = run.device()
    table = procedures.change_baud(hand, rate)
    if save_too or run.offer("Save it to flash now"):
        hand.check_identity()
        table.rows += flash.save(hand, run.guide).rows
        if verify or run.offer("Wait for the power-cycle and check the hand at the new baud rate"):
            _verify_speed(run, hand, rate, table)
        else:
            run.journal.info(
                "power-cycle",
                "the hand keeps its old baud rate until you power-cycle it",
                hint=f"power-cycle the hand, then use --baud {rate}",
            )
    else:
        already = any(message.code == "already" for message in run.journal.messages)
        run.journal.warn(
            "not-saved",
            f"{rate} bit/s may not be saved. In that case the hand keeps its old baud rate"
            if already
            else f"{rate} bit/s is not saved, so the hand keeps its old baud rate",
            hint=f"run `handctl exo save --id {hand.bus.id}`, then power-cycle the hand",
        )
    return table  # fmt: skip


def _verify_speed(run: Run, hand: ExoHand, rate: int, table: Table) -> None:
    from handctl.devices.inspire import procedures

    if procedures.wait_for_speed(hand, rate, run.guide):
        table.rows.append(
            {"name": "verified_baud", "finger": None, "address": None, "value": rate, "unit": "baud", "raw": None}
        )
        return
    found = procedures.find_speed(hand.bus)
    where = f"It answers at {found} bit/s" if found else "It does not answer at any of the three baud rates"
    table.failure = NoAnswer(
        f"{hand.bus.link.name}: no hand at {rate} bit/s after the power-cycle. {where}",
        hint="use the RS-232 cable: a Bluetooth module may still use the old baud rate. `handctl exo scan` tries all ids and baud rates",
    )


def _only_reads(run: Run, name: str) -> None:
    if run.settings.dry_run:
        raise UsageError(
            f"`handctl exo {name}` without a value only reads", hint="run it without -n: it does not change anything"
        )


@cli.verb("clear-errors", "Service", writes=True)
def clear_errors(run: Run) -> Table:
    """Clear actuator errors and show which remain. Asks first if a finger may move.

    A finger that an error stopped may then go on to its target.
    An over-temperature error cannot be cleared. It goes away once the actuator has cooled down.
    """
    from handctl.devices.inspire import flash

    steps = [run.planner().trigger_step("clear_errors", "clear errors")]
    if (plan := run.planned(steps)) is not None:
        return plan
    hand = run.device()
    verbs.ask_released(run, hand, [(Element(EXO["clear_errors"], 0), 1)], steps)
    return flash.clear_errors(hand)


SKIP_IDENTITY = click.option("--skip-identity-check", is_flag=True, help="Skip the check that this is an EH55BF1.")


@cli.verb("save", "Settings", writes=True)
@SKIP_IDENTITY
def save(run: Run, skip_identity_check: bool) -> Table:
    """Save the present settings to flash and wait for the result (about 1 s)."""
    from handctl.devices.inspire import flash

    steps = [run.planner().trigger_step("save", "save to flash")]
    if (plan := run.planned(steps)) is not None:
        return plan
    run.confirm(
        "This saves the present settings to flash. According to the manual, only id and baud_code are kept", steps
    )
    hand = run.device()
    if not skip_identity_check:
        hand.check_identity()
    return flash.save(hand, run.guide)


@cli.verb("factory-reset", "Settings", writes=True)
@click.option(
    "--undocumented-address",
    is_flag=True,
    help="Write to address 1006, known from the RH56 hand. The manual of this hand gives no address.",
)
@click.option(
    "--backup",
    metavar="FILE",
    type=OutFile(),
    help="Write the snapshot to FILE (default: exo-before-reset.json). An existing file is never overwritten.",
)
@SKIP_IDENTITY
def factory_reset(run: Run, undocumented_address: bool, backup: str | None, skip_identity_check: bool) -> Table:
    """Restore the factory defaults, after a snapshot of the present settings.

    The manual gives no address for this: see --undocumented-address."""
    import os

    from handctl.devices.inspire import flash

    if not undocumented_address:
        raise UsageError(
            "the manual describes a factory reset but gives no address for it (exo §2.3.5)",
            hint="add --undocumented-address to use 1006, the address of the RH56 hand. Nothing was sent.",
        )
    steps = [run.planner().trigger_step("factory_reset", "factory reset at an undocumented address")]
    if (plan := run.planned(steps)) is not None:
        return plan
    path = backup or "exo-before-reset.json"
    if os.path.exists(path):
        raise UsageError(
            f"{path}: this file already exists, and handctl does not overwrite it",
            hint="choose another file with --backup FILE",
        )
    run.confirm(
        "This restores the factory defaults permanently, at an address that is not in the manual",
        steps,
        word="reset",
    )
    hand = run.device()
    if not skip_identity_check:
        hand.check_identity()
    stored.snapshot(run, path)
    return flash.factory_reset(hand)  # fmt: skip


add_movements(cli)
