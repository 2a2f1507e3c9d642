"""`handctl barrett …`: the commands of the BarrettHand in supervisory mode."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import click

from handctl.command import get_set_watch, snapshots
from handctl.command.command_tree import Group
from handctl.command.common_commands import add_map_verbs
from handctl.command.expect import expect, expected
from handctl.command.family import Family
from handctl.command.options import ALWAYS, SKIP, InFile, WholeRange
from handctl.command.run import Asked, PlannedAction, Run
from handctl.devices.barrett.device import BarrettHand, check_line, step_of
from handctl.devices.barrett.firmware.cli import add_firmware
from handctl.devices.barrett.gcl.codec import COMMANDS, KINDS, SPEED, kind_of, motor_prefix, motors_of
from handctl.devices.barrett.gcl.connect_table import RESTARTED_TEXT
from handctl.devices.barrett.gcl.line import GclLine, Restarted
from handctl.devices.barrett.gcl.status_codes import STATUS_CODES, explain_status, hint_for, split_status
from handctl.devices.barrett.maintenance.cli import add_care_commands
from handctl.devices.barrett.parameter_map import BARRETT, BAUD_CODES, SPEEDS, check_careful
from handctl.devices.barrett.realtime.cli import add_realtime
from handctl.devices.barrett.status_and_parameter_views import GCL, row_of
from handctl.errors import Hint, UsageError
from handctl.files import read_text, state_path, text_lines
from handctl.link import ByteLink
from handctl.model.command_settings import Settings
from handctl.model.device import limits_of
from handctl.model.param import Element, Number, Step
from handctl.model.result import Column, Journal, Table
from handctl.system import terminal

HISTORY = 1000
"""Lines of the prompt that are kept."""
MOTORS_OPTION = click.option(
    "--motors", metavar="12S", help="Motors: digits 1 to 4, G for the fingers, S for the spread (default: all)."
)
FORCE = click.option("--force", is_flag=True, help="Write a value the manual warns about, or save unchanged values.")
HARM = click.option(
    "--force",
    is_flag=True,
    help="Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.",
)


def open_barrett(link: ByteLink, settings: Settings, journal: Journal) -> BarrettHand:
    """A BarrettHand behind `link`. Without --baud its speed is looked for."""
    limits = limits_of(settings, link)
    own = settings.own
    sign = own.get("position_sign", "")
    interrupt = bool(own.get("interrupt"))
    hand = BarrettHand(GclLine(link, journal, **limits, speed=settings.baud, sign=sign, interrupt=interrupt))

    def refuse_harm(line: str) -> None:
        from handctl.devices.barrett.motion import refuse_typed_harm

        refuse_typed_harm(hand, line)

    def count_save() -> None:
        from handctl.devices.barrett.eeprom_saves import Ledger

        Ledger(hand).count({})

    hand.count_save, hand.refuse_harm = count_save, refuse_harm
    return hand


def _recall(name: str) -> int | None:
    from handctl.devices.barrett import state_files

    return state_files.speed_of(name)


def _holds_back(name: str) -> str:
    from handctl.devices.barrett import state_files

    return state_files.holds_back(name)


def _report_checks(run: Run) -> Table:
    """The read-only checks of `diagnose`, for a report."""
    from handctl.devices.barrett.maintenance import diagnose

    hand: BarrettHand = run.device()
    findings, failure = diagnose.examine(diagnose.ExaminedHand(hand), diagnose.USUAL, run.settings.baud)
    return diagnose.table_of(hand, findings, None, failure)


cli = Group(
    "barrett",
    family=Family(
        "barrett", open_barrett, 9600, recall=_recall, holds_back=_holds_back, speeds=SPEEDS, checks=_report_checks
    ),
    first=("version", "errors", "init", "open", "close", "move", "home", "save", "diagnose", "maintenance", "strain"),
    help="Read, move and service a BarrettHand BH8 (RS-232, firmware 4.3x and 4.4). Motors 1 2 3 are the fingers, 4 or S is the spread, G is all fingers.",
)


add_map_verbs(
    cli, BARRETT, typed_asks=False, part="MOTOR", example="P SG.F1 temperature", without=("set", "describe", "restore")
)


def prefix_of(text: str | None) -> str:
    """GCL prefix of a --motors option. Without one all enabled motors move; all four named move disabled ones too."""
    return "" if text is None else motor_prefix(text)


def asked_before(steps: Sequence[Step]) -> tuple[list[Step], str]:
    """The steps that may change the speed of the hand or write its EEPROM, whichever command carries them, and the question."""
    asks = [step for step in steps if step.strands]
    return asks, ". ".join(dict.fromkeys(KINDS[kind_of(step.meaning)].question for step in asks))


def _sends(texts: Sequence[str], do: Callable[[BarrettHand], Table], question: str = "") -> PlannedAction:
    """What sends these lines; it asks what is to be asked before them, or `question`, which says that more exactly."""
    steps = [step_of(text) for text in texts]
    asks, words = asked_before(steps)
    return PlannedAction(steps, do, (question or words) if asks else "", asks=asks)


# -- reading ------------------------------------------------------------------------------------------------------


@cli.verb("describe", "Inspect", offline=True)
@click.argument("names", nargs=-1, metavar="[NAME]...")
def describe(run: Run, names: tuple[str, ...]) -> Table:
    """List all parameters with range, defaults, access and manual section.

    Needs no device.
    """
    table = get_set_watch.describe(BARRETT, names)
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
        GCL,
        *(column for column in table.columns if column.key not in ("address", "type")),
        Column("default_finger", "Default", right=True),
        Column("default_spread", "Spread", right=True),
    )
    return Table(rows=table.rows, columns=columns)


@cli.verb("version", "Inspect")
def version(run: Run) -> Table:
    """Show the firmware version."""
    table = get_set_watch.get(run, BARRETT, ("VERS",))
    table.view, table.columns = None, (Column("value", "Firmware"),)
    return table


@cli.verb("errors", "Inspect", offline=True)
@click.argument("code", required=False, type=WholeRange(0, 1 << 32))
def errors(run: Run, code: int | None) -> Table:
    """Explain status codes as the manual does. CODE can be a sum. Needs no device."""
    codes = sorted(STATUS_CODES) if code is None else split_status(code)
    rows = [{"code": bit, "meaning": explain_status(bit), "next": hint_for(bit) if bit else ""} for bit in codes or [0]]
    columns = (Column("code", "Code", right=True), Column("meaning", "Meaning"), Column("next", "Next step"))
    return Table(rows=rows, columns=columns)


@cli.verb("help", "Inspect")
@click.argument("command", required=False)
def help_(run: Run, command: str | None) -> Table:
    """Show what the hand and the manual say about COMMAND or a parameter."""
    from handctl.devices.barrett.gcl import passthrough

    name = command.upper() if command is not None else ""
    if name and name not in COMMANDS:
        try:
            name = BARRETT.find(name.lower())[0].mnemonic
        except UsageError as exc:
            raise UsageError(
                f"{command!r} is neither a GCL command nor a parameter",
                hint=Hint(f"use one of {' '.join(COMMANDS)}. {{}} lists the parameters", "barrett describe"),
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
@ALWAYS
def set_(
    run: Run, assignments: tuple[str, ...], motors: str | None, force: bool = False, always: bool = False
) -> PlannedAction:
    """Set parameters in RAM and read them back.

    `MCV=80` sets all motors, or those in --motors. `HSG.F1=150` sets one.
    """
    changes = BARRETT.assignments_on(assignments, motors_of(prefix_of(motors)))
    for objection in check_careful(changes, force):
        run.journal.warn("careful", objection)
    steps = run.planner().plan(changes)
    get_set_watch.tell_listed(run, changes, always)
    these = get_set_watch.Unequal(run, changes, always)

    def look(hand: BarrettHand) -> Asked:
        planned = hand.plan(these.look(hand))
        return Asked(SPEED if any(step.strands for step in planned) else "", planned)

    return PlannedAction(steps, these.written, SPEED if any(step.strands for step in steps) else "", look=look)


@cli.verb("baud", "Settings", writes=True, asks=True)
@click.argument("rate", required=False, type=int)
@click.option("--save", "save_too", is_flag=True, help="Also save the baud rate to EEPROM, so the hand starts with it.")
def baud(run: Run, rate: int | None, save_too: bool) -> Table | PlannedAction:
    """Show the baud rate, or change it.

    The hand and the port switch together. handctl then reads the baud rate back.
    """
    from handctl.devices.barrett import eeprom_saves

    if rate is None:
        run.only_reads("a baud rate")
        return get_set_watch.get(run, BARRETT, ("BAUD",))
    code, odd = divmod(rate, 100)
    if odd or code not in BAUD_CODES:
        raise UsageError(
            f"{rate} bit/s is not a baud rate of this hand",
            hint="use 600, 1200, 2400, 4800, 9600, 19200 or 38400 (barrett §5.4.1). Nothing was sent.",
        )
    texts = [f"PSET BAUD {code}", *(["PSAVE"] if save_too else [])]
    more = " and will also start with it" if save_too else ""

    def change(hand: BarrettHand) -> Table:
        ledger = eeprom_saves.Ledger(hand) if save_too else None
        readings = hand.write([(BARRETT.elements("BAUD")[0], code)])
        if ledger is not None:
            hand.do("PSAVE")
            ledger.count_common(baud_rate=code)
            run.journal.info("saved", f"PSAVE was acknowledged: from now on the hand starts at {rate} bit/s")
        else:
            run.journal.info(
                "volatile", "the new baud rate lasts until reset or power-off", hint="use --save to keep it"
            )
        return hand.table(readings)

    return _sends(texts, change, f"The hand switches to {rate} bit/s immediately{more}")


@cli.verb("reset", "Service", writes=True, asks=True)
def reset(run: Run) -> PlannedAction:
    """Restart the firmware, like a power-cycle, and show its banner. Asks first.

    Run `init` afterwards. The hand restarts at its saved baud rate, and handctl looks for it there.
    """

    def restart(hand: BarrettHand) -> Table:
        rows = [row_of("banner", "RESET", None, hand.line.restart(), None)]
        return Table(rows=rows, columns=(Column("value", "Banner"),))

    return _sends(["RESET"], restart)


# -- passthrough --------------------------------------------------------------------------------------------------


@cli.verb("gcl", "Service", writes=True)
@click.argument("commands", nargs=-1, metavar="[COMMAND]...")
@click.option("--keep-going", is_flag=True, help="Keep going after an error.")
@click.option("--file", "path", type=InFile(), metavar="FILE", help="Send the lines of this script.")
@click.option("--force", is_flag=True, help="Send values that `set`, and openings that `open`, would refuse.")
def gcl_(
    run: Run, commands: tuple[str, ...], keep_going: bool, path: str | None, force: bool = False
) -> Table | PlannedAction:
    """Send GCL commands, one per argument.

    --file sends a script: one command per line, each once the hand has replied to the one before. `DELAY 500` waits 500 ms, and # starts a comment.
    A refused line ends the script. Without arguments, handctl opens a prompt on a terminal, or reads a script from stdin. The prompt has history,
    completion for commands and parameters, and ?NAME for help.
    """
    from handctl.devices.barrett import eeprom_saves
    from handctl.devices.barrett.gcl import passthrough

    if path is not None and commands:
        raise UsageError("commands and --file given", hint="leave out one of them")
    if not commands and path is None and run.typed.isatty():
        return _prompt(run, force=force)
    if path is not None:
        texts = text_lines(read_text(path, "a GCL script", passthrough.LONGEST_SCRIPT))
        lines = passthrough.script(texts, force=force)
    else:
        lines = [passthrough.line_of(text, force=force) for text in commands]
        lines = lines or passthrough.script(run.typed, force=force)
    wanted = [line.text for line in lines if line.wait is None]
    if not wanted:
        raise UsageError(
            "no command given",
            hint='give some, such as handctl barrett gcl "HI" "GC" "FGET P", or send a script on stdin',
        )
    for text in wanted:
        for note in check_line(text, force=True):
            run.journal.warn("careful", f"{text}: {note}")
    if waits := [line for line in lines if line.wait is not None]:
        seconds = sum(line.wait or 0 for line in waits)
        deadline = run.settings.deadline
        if deadline is not None and seconds > deadline:
            raise UsageError(
                f"the DELAY lines alone take {seconds:g} s, longer than the --deadline of {deadline:g} s",
                hint="give a longer --deadline. Nothing was sent.",
            )
        at = ", ".join(line.named(line.text) for line in waits)
        run.journal.info("delays", f"handctl waits {seconds:g} s in all between the commands ({at})")

    def send(hand: BarrettHand) -> Table:
        ledger = eeprom_saves.Ledger(hand) if passthrough.saves(wanted) else None
        changes = any(kind_of(text) != "query" for text in wanted)
        hand.line.interrupt = bool(run.settings.own.get("interrupt")) or changes
        table = passthrough.run_all(hand, lines, keep_going=keep_going, prompts=run.prompts, force=force)
        if ledger is not None and passthrough.saves(row["command"] for row in table.rows if not row["status"]):
            ledger.count({})
        return table

    return _sends(wanted, send)


def _prompt(run: Run, *, force: bool) -> Table:
    from handctl.devices.barrett.gcl import passthrough
    from handctl.devices.barrett.motion import refuse_typed_harm

    def before(text: str) -> None:
        for note in check_line(text, force=force):
            run.prompts.say(f"careful: {note}")
        if not force:
            refuse_typed_harm(run.device(), text)
        asks, question = asked_before([step_of(text)])
        if asks:
            run.confirm(question, asks)

    if run.settings.dry_run:
        raise UsageError(
            "the prompt cannot do a dry run, because it sends each line as you type it",
            hint="give the commands as arguments",
        )
    if run.settings.format != "table" or run.settings.output or not sys.stdout.isatty():
        raise UsageError(
            "the prompt must write to an interactive terminal",
            hint="for --json, -o or a redirected stdout, give the commands as arguments or as a script on stdin",
            code="no-terminal",
        )
    with terminal.edited_lines(state_path("gcl-history"), HISTORY, passthrough.candidates):
        return passthrough.interactive(run, run.device(), input, before)


# -- movements (§5.2.1) ---------------------------------------------------------------------------------------------

MOVEMENTS = (
    ("init", "HI", "Initialize the motors (HI): the fingers open fully. Run it after power-on or reset.", ""),
    ("open", "O", "Open to the open target (parameter OT).", ""),
    ("close", "C", "Close to the close target (parameter CT). To grip an object, add --expect contact.", ""),
    (
        "move",
        "M",
        "Move all motors to POSITION in counts (default: the parameter DP), or each motor to its own: F1=9000 F2=500.",
        "POSITION",
    ),
    ("step-open", "IO", "Open by COUNTS (default: the parameter DS).", "COUNTS"),
    ("step-close", "IC", "Close by COUNTS (default: the parameter DS).", "COUNTS"),
    ("home", "HOME", "Move to position 0.", ""),
    ("torque-open", "TO", "Open under torque control until the motors stall.", ""),
    ("torque-close", "TC", "Close under torque control until the motors stall.", ""),
)


def _movement(name: str, gcl_name: str, doc: str, argument: str) -> None:
    def body(
        run: Run, motors: str | None, expect: str | None, values: tuple[str, ...] = (), force: bool = False
    ) -> PlannedAction:
        from handctl.devices.barrett import motion

        goals, ending = motion.goals_of(values, prefix_of(motors), gcl_name), expected(expect)
        return PlannedAction(
            [step_of(motion.command_text(motors, gcl_name, counts)) for motors, counts in goals],
            lambda hand: motion.move_each(hand, goals, gcl_name, run.prompts, force=force, expect=ending),
        )

    body.__doc__ = doc
    command: Callable[..., Any] = MOTORS_OPTION(expect(body))
    if gcl_name != "TC":
        command = HARM(command)
    if argument:
        command = click.argument("values", nargs=-1, metavar=f"[{argument} | MOTOR=VALUE...]")(command)
    cli.verb(name, "Move", writes=True)(command)


for _row in MOVEMENTS:
    _movement(*_row)


@cli.verb("stop", "Move", writes=True, stops=True)
@MOTORS_OPTION
def stop(run: Run, motors: str | None) -> Table:
    """Stop the hand at once, even while another handctl command is using it.

    Sends ^C, which ends the movement of all motors, then T, which switches off all motors or those in --motors, then
    reads the positions twice: they must not change. Never asks.
    """
    from handctl.devices.barrett import motion
    from handctl.devices.barrett.stopper import power_off
    from handctl.model.stop_sequence import stop_sequence_of
    from handctl.stop import stop_command as emergency

    prefix = prefix_of(motors)
    steps = partial(power_off, prefix=prefix)
    return emergency.stop(
        run,
        lambda context: stop_sequence_of("barrett", context, steps),
        otherwise=lambda hand: motion.find_and_power_off(hand, prefix),
    )


# -- RAM, EEPROM, factory values and files (§5.2.2, §5.2.3) ----------------------------------------------------------


@cli.verb("load", "Settings", writes=True, asks=True)
@MOTORS_OPTION
def load(run: Run, motors: str | None) -> PlannedAction:
    """Load the saved settings from EEPROM into RAM (FLOAD, PLOAD).

    The baud rate may change, so handctl asks first and then looks for the hand. With --motors, only the settings of
    those motors are loaded (3FLOAD), and the hand settings and the baud rate stay the same.
    The EEPROM cannot be read, so a load only shows if a value changes, or if RAM then equals handctl's last save.
    """
    from handctl.devices.barrett import load_and_defaults

    commands = _motors_first(motors, "FLOAD", "PLOAD")
    return _sends(commands, lambda hand: load_and_defaults.load(hand, commands))


@cli.verb("defaults", "Settings", writes=True, asks=True)
@MOTORS_OPTION
def defaults(run: Run, motors: str | None) -> PlannedAction:
    """Set all parameters in RAM to their factory values (FDEF, PDEF). Saves nothing.

    The baud rate changes to 9600 bit/s, so handctl asks first. With --motors, only the settings of those motors are
    set (SFDEF), and the hand settings and the baud rate stay the same. handctl reads the values back and compares them
    with the factory values of the manual.
    """
    from handctl.devices.barrett import load_and_defaults

    commands = _motors_first(motors, "FDEF", "PDEF")
    return _sends(commands, lambda hand: load_and_defaults.defaults(hand, commands))


@cli.verb("save", "Settings", writes=True, asks=True)
@MOTORS_OPTION
@FORCE
def save(run: Run, motors: str | None, force: bool) -> PlannedAction:
    """Save the settings from RAM to EEPROM. Asks first.

    The EEPROM is rated for 5,000 saves. handctl counts them and refuses to save what it saved last. With --motors,
    only the settings of those motors are saved (123FSAVE), and the saved hand settings stay the same.
    """
    from handctl.devices.barrett import eeprom_saves

    def keep(hand: BarrettHand) -> Table:
        if motors is None:
            (code,) = hand.numbers(BARRETT.elements("BAUD"))
            _refuse_to_keep(code, force)
        return eeprom_saves.save(hand, force=force, prefix=prefix_of(motors))

    return _sends(_motors_first(motors, "FSAVE", "PSAVE"), keep)


@cli.verb("restore", "Files", writes=True, asks=True)
@click.argument("file", type=InFile())
@click.option("--save", "save_too", is_flag=True, help="Then save to EEPROM.")
@FORCE
@SKIP
def restore(run: Run, file: str, save_too: bool, force: bool, skip: tuple[str, ...] = ()) -> PlannedAction:
    """Restore to RAM the values that differ from a snapshot, and read them back.

    The baud rate is written last. A parameter that this firmware does not have is refused before anything is written,
    unless --skip leaves it out.
    """
    from handctl.devices.barrett import eeprom_saves

    def check(changes: Sequence[tuple[Element, Number]]) -> None:
        for objection in check_careful(changes, force):
            run.journal.warn("careful", objection)
        if save_too:
            for element, value in changes:
                if element.full_name == "baud_rate":
                    _refuse_to_keep(int(value), force)

    act = snapshots.restore(run, BARRETT, file, check=check, skip=skip)

    def whole(hand: BarrettHand) -> Table:
        before = len(hand.journal.messages)
        table = act.do(hand)
        if any(message.code == Restarted.default_code for message in hand.journal.messages[before:]):
            raise Restarted(
                f"{hand.link.name}: {RESTARTED_TEXT}. What was written before that is lost",
                hint="initialize the hand, then restore the snapshot again",
            )
        return table

    if not save_too:
        return act._replace(do=whole)
    saves = [step_of("FSAVE"), step_of("PSAVE")]
    asks, question = asked_before(saves)

    def look(hand: BarrettHand) -> Asked:
        run.confirm(question, asks)  # also when nothing differs: the EEPROM is written all the same
        return act.looked(hand)

    def write(hand: BarrettHand) -> Table:
        table = whole(hand)
        if table.failure is None:  # an interrupted restore has not brought about what was to be saved
            eeprom_saves.save(hand, force=True)
        return table

    steps = lambda: [*act.every(), *(step._replace(strands=False) for step in saves)]  # noqa: E731
    return PlannedAction(steps, write, question, asks=asks, look=look)


def _motors_first(motors: str | None, of_motors: str, of_hand: str) -> list[str]:
    """The command for `motors`; without a choice that for all of them, and the one for the hand's own settings."""
    return [of_motors, of_hand] if motors is None else [prefix_of(motors) + of_motors]


def _refuse_to_keep(code: int, force: bool) -> None:
    """A BAUD other than the factory's is not saved by accident. Raises UsageError."""
    if code != 96 and not force:
        raise UsageError(
            f"BAUD is {code}, so once saved the hand always starts at {code * 100} bit/s",
            hint=Hint("run {} first, or use --force to save it anyway", "barrett baud 9600"),
            code="baud-not-default",
        )


add_realtime(cli)
add_firmware(cli)
add_care_commands(cli)
