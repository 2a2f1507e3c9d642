"""`handctl barrett …`: the commands of the BarrettHand in supervisory mode."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from handctl.devices.barrett.care.cli import add_care_commands
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.firmware.cli import add_firmware
from handctl.devices.barrett.gcl.language import MOTORS, motor_prefix
from handctl.devices.barrett.gcl.line import GclLine
from handctl.devices.barrett.map import BARRETT, SPEEDS, check_careful
from handctl.devices.barrett.motion_cli import FORCE, MOTORS_OPTION, SPEED, add_movements, ask, step_of
from handctl.devices.barrett.realtime.cli import add_realtime
from handctl.devices.barrett.store_cli import add_store_commands
from handctl.errors import UsageError
from handctl.frame import verbs
from handctl.frame.clikit import Group
from handctl.frame.family import Family
from handctl.frame.mapverbs import add_map_verbs
from handctl.frame.run import Run
from handctl.frame.types import WholeRange
from handctl.model.device import limits_of
from handctl.model.result import Column, Table

if TYPE_CHECKING:
    from handctl.frame.options import Settings
    from handctl.link import ByteLink
    from handctl.model.result import Journal


def open_barrett(link: ByteLink, settings: Settings, journal: Journal) -> BarrettHand:
    """A BarrettHand behind `link`. Without --baud its speed is looked for."""
    limits = limits_of(settings, link)
    return BarrettHand(
        GclLine(link, journal, **limits, speed=settings.baud, interrupt=bool(settings.own.get("interrupt")))
    )


def _recall(name: str) -> int | None:
    from handctl.devices.barrett.gcl import lastspeed

    return lastspeed.speed_of(name)


cli = Group(
    "barrett",
    family=Family("barrett", open_barrett, 9600, recall=_recall, speeds=SPEEDS),
    first=("version", "errors", "init", "open", "close", "move", "home", "save", "diagnose", "maintenance", "strain"),
    help="Read, move and service a BarrettHand BH8 (RS-232, firmware 4.3x and 4.4). Motors 1 2 3 are the fingers, 4 or S is the spread, G is all fingers.",
)


def _report_checks(run: Run) -> Table:
    """The read-only checks of `diagnose`, for a report."""
    from handctl.devices.barrett.care import diagnose
    from handctl.devices.barrett.care.checks import Patient

    hand: BarrettHand = run.device()
    patient = Patient(hand, simulated=lambda: run.simulated, name="")
    findings, failure = diagnose.examine(patient, diagnose.USUAL, run.settings.baud)
    return diagnose.table_of(hand, findings, None, failure)


add_map_verbs(
    cli,
    BARRETT,
    part="MOTOR",
    example="P SG.F1 temperature",
    without=("set", "describe", "restore"),
    checks=_report_checks,
)


# -- reading ------------------------------------------------------------------------------------------------------


@cli.verb("describe", "Look", offline=True)
@click.argument("names", nargs=-1, metavar="[NAME]...")
def describe(run: Run, names: tuple[str, ...]) -> Table:
    """List all parameters with range, defaults, access and manual section.

    Needs no device.
    """
    table = verbs.describe(BARRETT, names)
    for row in table.rows:
        param, _ = BARRETT.find(row["name"])
        finger, spread = param.default or (None, None)
        row |= {
            "parameter": param.mnemonic,
            "default_finger": finger,
            "default_spread": None if param.is_global else spread,
            "advanced": param.advanced,
        }
    columns = (
        Column("parameter", "GCL"),
        *(column for column in table.columns if column.key not in ("address", "type")),
        Column("default_finger", "Default", right=True),
        Column("default_spread", "Spread", right=True),
    )
    return Table(rows=table.rows, columns=columns)


@cli.verb("version", "Look")
def version(run: Run) -> Table:
    """Show the firmware version."""
    table = verbs.get(run, BARRETT, ["VERS"])
    table.view, table.columns = None, (Column("value", "Firmware"),)
    return table


@cli.verb("errors", "Look", offline=True)
@click.argument("code", required=False, type=WholeRange(0, 1 << 32))
def errors(run: Run, code: int | None) -> Table:
    """Explain status codes as the manual does. CODE can be a sum. Needs no device."""
    from handctl.devices.barrett.gcl.language import ERRORS, explain_status, hint_for, split_status

    codes = sorted(ERRORS) if code is None else split_status(code)
    rows = [{"code": bit, "meaning": explain_status(bit), "next": hint_for(bit)} for bit in codes] or [
        {"code": 0, "meaning": "ready", "next": ""}
    ]
    return Table(
        rows=rows,
        columns=(Column("code", "Code", right=True), Column("meaning", "Meaning"), Column("next", "Next step")),
    )


@cli.verb("help", "Look")
@click.argument("command", required=False)
def help_(run: Run, command: str | None) -> Table:
    """Show what the hand and the manual say about COMMAND or a parameter."""
    from handctl.devices.barrett.gcl import passthrough
    from handctl.devices.barrett.gcl.commands import COMMANDS

    name = command.upper() if command is not None else ""
    if name and name not in COMMANDS:
        try:
            name = BARRETT.find(name.lower())[0].mnemonic
        except UsageError as exc:
            raise UsageError(
                f"{command!r} is neither a GCL command nor a parameter",
                hint=f"use one of {' '.join(COMMANDS)}. `handctl barrett describe` lists the parameters",
            ) from exc
    text = f"?{name}"
    row = passthrough.row_of(run.device().line.read(text))
    row["manual"] = passthrough.explain_help(text)
    return Table(
        rows=[row],
        columns=(*passthrough.COLUMNS, Column("manual", "In the manual")),
        text=lambda rows: f"{passthrough.as_text(rows)}in the manual:\n{rows[0]['manual']}\n",
        plain=("text",),
    )


# -- writing parameters ---------------------------------------------------------------------------------------------


@cli.verb("set", "Settings", writes=True)
@click.argument("assignments", nargs=-1, required=True, metavar="NAME[.MOTOR]=VALUE...")
@MOTORS_OPTION
@FORCE
def set_(run: Run, assignments: tuple[str, ...], motors: str | None, force: bool) -> Table:
    """Set parameters in RAM and read them back.

    `MCV=80` sets all motors, or those in --motors. `HSG.F1=150` sets one.
    """
    chosen = [MOTORS[int(digit) - 1] for digit in motor_prefix(motors)] if motors is not None else list(MOTORS)
    changes = BARRETT.assignments_on(assignments, chosen)
    for objection in check_careful(changes, force):
        run.journal.warn("careful", objection)
    steps = run.planner().plan(changes)
    if (plan := run.planned(steps)) is not None:
        return plan
    if any(step.strands for step in steps):
        run.confirm(SPEED, steps)
    hand: BarrettHand = run.device()
    return hand.table(hand.write(changes))


@cli.verb("baud", "Settings", writes=True)
@click.argument("rate", required=False, type=int)
@click.option("--save", "save_too", is_flag=True, help="Also save the baud rate to EEPROM, so the hand starts with it.")
def baud(run: Run, rate: int | None, save_too: bool) -> Table:
    """Show the baud rate, or change it.

    The hand and the port switch together. handctl then reads the baud rate back.
    """
    from handctl.devices.barrett import eeprom
    from handctl.devices.barrett.gcl import speed

    if rate is None:
        if run.settings.dry_run:
            raise UsageError("`handctl barrett baud` without a baud rate only reads", hint="run it without -n")
        run.only_reads()
        return verbs.get(run, BARRETT, ["BAUD"])
    code = speed.code_of(rate)
    texts = [f"PSET BAUD {code}", *(["PSAVE"] if save_too else [])]
    if (plan := run.planned([step_of(text) for text in texts])) is not None:
        return plan
    ask(
        run, texts, f"The hand switches to {rate} bit/s immediately{' and will also start with it' if save_too else ''}"
    )
    hand: BarrettHand = run.device()
    ledger = eeprom.Ledger(hand, simulated=run.simulated) if save_too else None
    readings = hand.write([(BARRETT.find("BAUD")[1][0], code)])
    if ledger is not None:
        hand.do("PSAVE")
        ledger.count_common(baud_rate=code)
        run.journal.info("saved", f"PSAVE was acknowledged: from now on the hand starts at {rate} bit/s")
    else:
        run.journal.info("volatile", "the new baud rate lasts until reset or power-off", hint="use --save to keep it")
    return hand.table(readings)


@cli.verb("reset", "Service", writes=True)
def reset(run: Run) -> Table:
    """Restart the firmware, like a power-cycle, and show its banner. Asks first.

    Run `init` afterwards. The hand restarts at its saved baud rate, and handctl looks for it there.
    """
    from handctl.devices.barrett.gcl import speed

    if (plan := run.planned([step_of("RESET")])) is not None:
        return plan
    ask(run, ["RESET"])
    banner = speed.reset(run.device().line)
    return Table(
        rows=[{"name": "banner", "parameter": "RESET", "motor": None, "value": banner, "unit": None}],
        columns=(Column("value", "Banner"),),
    )


# -- passthrough --------------------------------------------------------------------------------------------------


@cli.verb("gcl", "Service", writes=True)
@click.argument("commands", nargs=-1, metavar="[COMMAND]...")
@click.option("--keep-going", is_flag=True, help="Keep going after an error.")
def gcl_(run: Run, commands: tuple[str, ...], keep_going: bool) -> Table:
    """Send GCL commands, one per argument.

    Without arguments, handctl opens a prompt on a terminal, or reads a script from stdin. The prompt has history,
    completion for commands and parameters, and ?NAME for help.
    """
    from handctl.devices.barrett import eeprom
    from handctl.devices.barrett.gcl import passthrough

    if not commands and run.typed.isatty():
        return _prompt(run)
    wanted = list(commands) if commands else passthrough.script(run.typed)
    if not wanted:
        raise UsageError(
            "no command given",
            hint='give some, such as handctl barrett gcl "HI" "GC" "FGET P", or send a script on stdin',
        )
    for text in wanted:
        passthrough.refuse(text)
        step_of(text)
        for note in passthrough.notes(text):
            run.journal.warn("careful", f"{text}: {note}")
    if (plan := run.planned([step_of(text) for text in wanted])) is not None:
        return plan
    ask(run, wanted)
    ledger = eeprom.Ledger(run.device(), simulated=run.simulated) if passthrough.saves(wanted) else None
    hand = run.device()
    hand.line.interrupt = bool(run.settings.own.get("interrupt")) or not passthrough.only_asks(wanted)
    table = passthrough.run_all(hand, wanted, keep_going=keep_going)
    if ledger is not None and passthrough.saves(row["command"] for row in table.rows if not row["status"]):
        ledger.count_unknown()
    return table


def _prompt(run: Run) -> Table:
    from handctl.devices.barrett.gcl import passthrough, prompt

    if run.settings.dry_run:
        raise UsageError(
            "the prompt cannot do a dry run, because it sends each line as you type it",
            hint="give the commands as arguments",
        )
    if run.settings.format != "table" or run.settings.output or not sys.stdout.isatty():
        raise UsageError(
            "the prompt needs a terminal as its output",
            hint="for --json, -o or a redirected stdout, give the commands as arguments or as a script on stdin",
            code="no-terminal",
        )
    history = prompt.line_reader()
    try:
        return passthrough.interactive(run, run.device(), input, lambda text: ask(run, [text]))
    finally:
        prompt.leave(history)


add_movements(cli)
add_store_commands(cli)
add_realtime(cli)
add_firmware(cli)
add_care_commands(cli)
