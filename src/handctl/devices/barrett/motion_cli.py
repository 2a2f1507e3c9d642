"""`handctl barrett init | open | close | move | … | stop`: the movements of §5.2.1, and the options that they share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

from handctl.devices.barrett.gcl.language import motor_prefix
from handctl.frame.clikit import Group
from handctl.frame.expect import expect, expected
from handctl.frame.run import Run
from handctl.model.param import Step
from handctl.model.result import Table

MOTORS_OPTION = click.option(
    "--motors", metavar="12S", help="Motors: digits 1 to 4, G for the fingers, S for the spread (default: all)."
)
SPEED = "The hand may change its baud rate immediately"
QUESTIONS = {
    **dict.fromkeys(("baud", "speed", "reset"), SPEED),
    "save": "This writes the EEPROM, which is rated for 5,000 saves",
}
"""Kind of a GCL command (`commands`) -> what is asked before it."""
FORCE = click.option("--force", is_flag=True, help="Write a value the manual warns about, or save unchanged values.")


HARM = click.option(
    "--force", is_flag=True, help="Open even if faster than IVEL allows, or if OT and CT reverse the movement."
)


def prefix_of(text: str | None) -> str:
    """GCL prefix of a --motors option. Without one all enabled motors move; all four named move disabled ones too."""
    return "" if text is None else motor_prefix(text)


def step_of(text: str) -> Step:
    """A GCL line as a step of a plan."""
    from handctl.devices.barrett.gcl.commands import kind_of
    from handctl.devices.barrett.gcl.language import encode

    kind = kind_of(text)
    return Step(text, encode(text), moves=kind in ("motion", "init"), strands=kind in QUESTIONS)


def ask(run: Run, texts: Sequence[str], question: str = "") -> None:
    """Ask before GCL that may change the speed of the hand or writes its EEPROM, whichever command carries it.

    `question` says it more exactly. Raises NotConfirmed.
    """
    from handctl.devices.barrett.gcl.commands import kind_of

    asked = [step for text in texts if (step := step_of(text)).strands]
    if asked:
        words = dict.fromkeys(QUESTIONS[kind_of(step.meaning)] for step in asked)
        run.confirm(question or ". ".join(words), asked)


def add_movements(group: Group) -> None:
    """Add the commands to the family's group."""
    for name, gcl_name, doc, argument in MOVEMENTS:
        _movement(group, name, gcl_name, doc, argument)

    @group.verb("stop", "Move", writes=True, stops=True)
    @MOTORS_OPTION
    def stop(run: Run, motors: str | None) -> Table:
        """Stop the hand immediately, even while another handctl is using it.

        Sends ^C, which ends the movement of all motors, then T, which switches off all motors or those in --motors.
        Never asks.
        """
        from handctl.devices.barrett import motion
        from handctl.devices.barrett.stopper import power_off
        from handctl.stop import command as emergency

        prefix = prefix_of(motors)
        return emergency.stop(
            run,
            lambda aim: power_off(aim, prefix),
            otherwise=lambda hand: motion.power_off(hand, prefix),
        )


def _movement(group: Group, name: str, gcl_name: str, doc: str, argument: str) -> None:
    def body(run: Run, motors: str | None, expect: str | None, value: int | None = None, force: bool = False) -> Table:
        from handctl.devices.barrett import motion

        prefix = prefix_of(motors)
        text = motion.command_text(prefix, gcl_name, value)
        if (plan := run.planned([step_of(text)])) is not None:
            return plan
        ending = expected(expect)
        return motion.move(run.device(), prefix, gcl_name, value, run.guide, force=force, expect=ending)

    body.__doc__ = doc
    command: Callable[..., Any] = MOTORS_OPTION(expect(body))
    if gcl_name != "TC":
        command = HARM(command)
    if argument:
        command = click.argument("value", required=False, type=int, metavar=argument)(command)
    group.verb(name, "Move", writes=True)(command)


MOVEMENTS = (
    ("init", "HI", "Initialize the motors (HI): the fingers open fully. Run it after power-on or reset.", ""),
    ("open", "O", "Open to OT.", ""),
    ("close", "C", "Close to CT. To grip an object, add --expect contact.", ""),
    ("move", "M", "Move to POSITION in counts (default: the parameter DP).", "[POSITION]"),
    ("step-open", "IO", "Open by COUNTS (default: the parameter DS).", "[COUNTS]"),
    ("step-close", "IC", "Close by COUNTS (default: the parameter DS).", "[COUNTS]"),
    ("home", "HOME", "Move to position 0.", ""),
    ("torque-open", "TO", "Open under torque control until the motors stall.", ""),
    ("torque-close", "TC", "Close under torque control until the motors stall.", ""),
)
