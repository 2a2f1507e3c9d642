"""`handctl exo calibrate | force | position`: what moves the hand, and the fingers of who wears it."""

from __future__ import annotations

from typing import Any

import click

from handctl.devices.inspire.exo.device import check_command
from handctl.frame.clikit import Group
from handctl.frame.numbers import Seconds
from handctl.frame.run import Run
from handctl.model.result import Table


class Signed(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A whole number that may be negative; the range is the manual's."""

    name = "integer"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            if "_" in str(value):  # Python's grouping, which `set` does not take either
                raise ValueError(value)
            return int(value)
        except (TypeError, ValueError):
            self.fail(f"{value!r} is not a whole number", param, ctx)


NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Lets `-100` be an argument; a mistyped option then fails as "not a whole number"."""


def add_movements(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("calibrate", "Service", writes=True)
    def calibrate(run: Run) -> Table:
        """Run the calibration of forces and positions, guided step by step.

        Ctrl-C does not stop the hand. To stop it, switch its power off.
        The hand must be worn, and it moves the wearer's fingers.
        """
        from handctl.devices.inspire.exo import motion

        steps = [run.planner().trigger_step("calibrate", "calibrate")]
        if (plan := run.planned(steps)) is not None:
            return plan
        for number, (seconds, text) in enumerate(motion.CALIBRATION_STEPS, 1):
            run.guide.say(f"  step {number}: {text} (waits {seconds} s)")
        run.confirm(
            f"{motion.POWER_OFF} The hand must be worn, and it moves all fingers through the steps above", steps
        )
        return motion.calibrate(run.device(), run.guide)

    @group.verb("force", "Move", writes=True)
    @click.argument("values", nargs=5, type=Signed(), metavar="LITTLE RING MIDDLE INDEX THUMB")
    def force(run: Run, values: tuple[int, ...]) -> Table:
        """Command forces from -1000 to 1000. A positive force opens the hand, a negative force closes it.

        Shows the positions in the answer. A force stays until another is commanded. `force 0 0 0 0 0` releases the hand.
        """
        return _command(run, "force", values)

    @group.verb("position", "Move", writes=True)
    @click.argument("values", nargs=5, type=Signed(), metavar="LITTLE RING MIDDLE INDEX THUMB")
    @click.option(
        "--wait",
        type=Seconds(),
        metavar="S",
        help="Watch for up to S seconds until the fingers stand still. Ctrl-C holds them where they are.",
    )
    def position(run: Run, values: tuple[int, ...], wait: float | None) -> Table:
        """Command positions from 0 (bent) to 1000 (open).

        Shows the forces in the answer. With --wait it shows the positions that were reached.
        """
        return _command(run, "position", values, wait)  # fmt: skip

    for takes_numbers in (force, position):
        takes_numbers.context_settings.update(NEGATIVE_NUMBERS)


def _command(run: Run, which: str, values: tuple[int, ...], wait: float | None = None) -> Table:
    from handctl.devices.inspire.exo import motion

    check_command(which, values)
    step = run.planner().command_step(which, list(values))
    if (plan := run.planned([step])) is not None:
        return plan
    run.confirm(f"This moves a hand that a person may be wearing: {step.meaning}", [step])
    hand = run.device()
    if wait is not None:
        return motion.move(hand, list(values), run.guide, wait=wait)
    table = motion.command(hand, which, list(values), run.guide)
    if which == "force" and any(values):
        run.journal.info(
            "stays",
            "the force stays until another is commanded",
            hint="`handctl exo force 0 0 0 0 0` releases the hand",
        )
    return table
