"""`handctl barrett load | defaults | save | restore`: RAM, EEPROM, factory values and files (barrett §5.2.2, §5.2.3)."""

from __future__ import annotations

from collections.abc import Sequence

import click

from handctl.devices.barrett.map import BARRETT, check_careful
from handctl.devices.barrett.motion_cli import FORCE, MOTORS_OPTION, ask, prefix_of, step_of
from handctl.errors import UsageError
from handctl.frame import stored
from handctl.frame.clikit import Group
from handctl.frame.run import Run
from handctl.frame.types import InFile
from handctl.model.param import Element, Number, Step
from handctl.model.result import Table


def add_store_commands(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("load", "Settings", writes=True)
    @MOTORS_OPTION
    def load(run: Run, motors: str | None) -> Table:
        """Load the saved settings from EEPROM into RAM (FLOAD, PLOAD).

        The baud rate may change, so handctl asks first and then looks for the hand. With --motors, only the settings of
        those motors are loaded (3FLOAD), and the hand settings and the baud rate stay the same.
        """
        return _plain_commands(run, _motors_first(motors, "FLOAD", "PLOAD"))

    @group.verb("defaults", "Settings", writes=True)
    @MOTORS_OPTION
    def defaults(run: Run, motors: str | None) -> Table:
        """Set all parameters in RAM to their factory values (FDEF, PDEF). Saves nothing.

        The baud rate changes to 9600 bit/s, so handctl asks first. With --motors, only the settings of those motors are
        set (SFDEF), and the hand settings and the baud rate stay the same.
        """
        return _plain_commands(run, _motors_first(motors, "FDEF", "PDEF"))

    @group.verb("save", "Settings", writes=True)
    @MOTORS_OPTION
    @FORCE
    def save(run: Run, motors: str | None, force: bool) -> Table:
        """Save the settings from RAM to EEPROM. Asks first.

        The EEPROM is rated for 5,000 saves. handctl counts them and refuses a save that changes nothing. With --motors,
        only the settings of those motors are saved (123FSAVE), and the saved hand settings stay the same.
        """
        from handctl.devices.barrett import eeprom
        from handctl.devices.barrett.device import BarrettHand

        prefix = prefix_of(motors)
        steps = save_steps(motors)
        if (plan := run.planned(steps)) is not None:
            return plan
        ask(run, [step.meaning for step in steps])
        hand: BarrettHand = run.device()
        if motors is None:
            (speed,) = hand.read(BARRETT.find("BAUD")[1])
            if speed.error is not None:
                raise speed.error
            _refuse_to_keep(int(speed.value or 0), force)
        return eeprom.save(hand, force=force, simulated=run.simulated, prefix=prefix)

    @group.verb("restore", "Files", writes=True)
    @click.argument("file", type=InFile())
    @click.option("--save", "save_too", is_flag=True, help="Then save to EEPROM.")
    @FORCE
    def restore(run: Run, file: str, save_too: bool, force: bool) -> Table:
        """Write the values that differ from a snapshot to RAM and read them back.

        The baud rate is written last.
        """
        from handctl.devices.barrett import eeprom

        def check(changes: Sequence[tuple[Element, Number]]) -> None:
            for objection in check_careful(changes, force):
                run.journal.warn("careful", objection)
            if save_too:
                for element, value in changes:
                    if element.full_name == "baud_rate":
                        _refuse_to_keep(int(value), force)
                if not run.settings.dry_run:  # also when nothing differs: the EEPROM is written all the same
                    ask(run, [step.meaning for step in save_steps(None)])

        table = stored.restore(run, BARRETT, file, check=check)
        if save_too and run.settings.dry_run:
            table.rows += [
                {"step": number, "bytes": step.wire, "meaning": step.meaning, "moves": False, "strands": False}
                for number, step in enumerate(save_steps(None), len(table.rows) + 1)
            ]
        elif save_too:
            eeprom.save(run.device(), force=True, simulated=run.simulated)
        return table


def _motors_first(motors: str | None, of_motors: str, of_hand: str) -> list[str]:
    """The command for `motors`; without a choice that for all of them, and the one for the hand's own settings."""
    return [of_motors, of_hand] if motors is None else [prefix_of(motors) + of_motors]


def save_steps(motors: str | None) -> list[Step]:
    """The exact bytes of a save."""
    return [step_of(text) for text in _motors_first(motors, "FSAVE", "PSAVE")]


def _plain_commands(run: Run, commands: list[str]) -> Table:
    from handctl.devices.barrett.gcl import passthrough

    if (plan := run.planned([step_of(text) for text in commands])) is not None:
        return plan
    ask(run, commands)
    return passthrough.run_all(run.device(), commands, keep_going=False)


def _refuse_to_keep(code: int, force: bool) -> None:
    """A BAUD other than the factory's is not saved by accident. Raises UsageError."""
    if code != 96 and not force:
        raise UsageError(
            f"BAUD is {code}, so once saved the hand always starts at {code * 100} bit/s",
            hint="run `handctl barrett baud 9600` first, or use --force to save it anyway",
            code="baud-not-default",
        )
