"""`handctl exo calibrate | force | position`: what moves the hand, and the fingers of who wears it."""

from __future__ import annotations

import click

from handctl.devices.inspire.exo.device import parse_command
from handctl.frame.clikit import Group
from handctl.frame.expect import expect, expected
from handctl.frame.run import Run
from handctl.frame.types import NEGATIVE_NUMBERS, Seconds
from handctl.model.result import Table

FIVE = "LITTLE RING MIDDLE INDEX THUMB | FINGER=VALUE..."


def add_movements(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("calibrate", "Service", writes=True)
    def calibrate(run: Run) -> Table:
        """Calibrate forces and positions, guided step by step.

        Ctrl-C does not stop the hand. To stop it, switch its power off.
        Someone has to wear the hand, and it moves the wearer's fingers.
        """
        from handctl.devices.inspire.exo import motion

        steps = [run.planner().trigger_step("calibrate", "calibrate")]
        if (plan := run.planned(steps)) is not None:
            return plan
        for number, (seconds, text) in enumerate(motion.CALIBRATION_STEPS, 1):
            run.guide.say(f"  step {number}: {text} (waits {seconds} s)")
        run.confirm(
            f"{motion.POWER_OFF} Someone has to wear the hand, and it moves all fingers through the steps above", steps
        )
        return motion.calibrate(run.device(), run.guide)

    @group.verb("force", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, metavar=FIVE)
    def force(run: Run, values: tuple[str, ...]) -> Table:
        """Command forces from -1000 (closes the hand) to 1000 (opens it). Asks first.

        Give all five in order, or name single fingers: `force ring=100`.
        A force stays in effect until you command another one. `force 0 0 0 0 0` releases the hand.
        The result shows the positions from the reply, or the forces if you named single fingers.
        """
        return _command(run, "force", values)

    @group.verb("position", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, metavar=FIVE)
    @click.option(
        "--wait",
        type=Seconds(),
        metavar="S",
        help="Wait up to S seconds for the fingers to stop moving. Ctrl-C makes them hold their position.",
    )
    @expect
    def position(run: Run, values: tuple[str, ...], wait: float | None, expect: str | None) -> Table:
        """Command positions from 0 (bent) to 1000 (open). Asks first.

        Give all five in order, where -1 leaves a finger as it is, or name single fingers: `position ring=900 index=100`.
        The result shows the forces from the reply, or the targets if you named single fingers. With --wait it shows the positions reached.
        """
        return _command(run, "position", values, wait, expect)

    for takes_numbers in (force, position):
        takes_numbers.context_settings.update(NEGATIVE_NUMBERS)


def _command(
    run: Run, which: str, texts: tuple[str, ...], wait: float | None = None, expect: str | None = None
) -> Table:
    from handctl.devices.inspire.exo import motion

    values = parse_command(which, texts)
    ending = expected(expect, waits=wait is not None)
    steps = run.planner().command_steps(which, values)
    if (plan := run.planned(steps)) is not None:
        return plan
    run.confirm(f"This moves a hand that a person may be wearing: {'; '.join(step.meaning for step in steps)}", steps)
    hand = run.device()
    if wait is not None:
        return motion.move(hand, values, run.guide, wait=wait, expect=ending)
    table = motion.command(hand, which, values, run.guide)
    if which == "force" and any(values.values()):
        run.journal.info(
            "stays",
            "the force stays in effect until you command another one",
            hint="`handctl exo force 0 0 0 0 0` releases the hand",
        )
    return table
