"""`handctl hand angle | position | force | speed | calibrate`: what moves the hand, and how fast and how firmly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from handctl.devices.inspire.exo.motion_cli import NEGATIVE_NUMBERS, Signed
from handctl.devices.inspire.hand.map import DG2
from handctl.devices.inspire.hand.typed import map_of, typed_model
from handctl.errors import UsageError
from handctl.frame.clikit import Group
from handctl.frame.numbers import Seconds
from handctl.frame.run import Run
from handctl.model.param import COMMAND, Element, Number, Step
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

FINGERS = "LITTLE RING MIDDLE INDEX THUMB ROTATION"
LEFT = -1
"""Leaves a finger as it is."""
WAIT = click.option(
    "--wait",
    type=Seconds(),
    metavar="S",
    help="Watch for up to S seconds until the fingers stand still. Ctrl-C sets the speed to 0.",
)


def add_movements(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("angle", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, type=Signed(), metavar=FINGERS)
    @WAIT
    def angle(run: Run, values: tuple[int, ...], wait: float | None) -> Table:
        """Command angles from 0 (closed) to 1000 (open). -1 leaves a finger as it is. Asks first.

        The question shows the speed and the force limit that are set. `speed` and `force` change them.
        """
        return write_asked(run, _changes(run, "angle_set", values), wait)

    @group.verb("position", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, type=Signed(), metavar=FINGERS)
    @WAIT
    def position(run: Run, values: tuple[int, ...], wait: float | None) -> Table:
        """Command strokes from 0 (open) to 2000 (closed). -1 leaves a finger as it is. Asks first.

        The maker advises `angle` instead.
        """
        return write_asked(run, _changes(run, "stroke_set", values), wait)

    @group.verb("force", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, type=Signed(), metavar=FINGERS)
    def force(run: Run, values: tuple[int, ...]) -> Table:
        """Set the force limit in grams. -1 leaves a finger as it is.

        A closing finger stops at this threshold. It does not hold that force. It counts from the next movement on.
        """
        return write_asked(run, _changes(run, "force_limit", values))

    @group.verb("speed", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, type=Signed(), metavar=FINGERS)
    def speed(run: Run, values: tuple[int, ...]) -> Table:
        """Set the speed of the next movement from 0 to 1000. -1 leaves a finger as it is.

        At 1000 a finger closes in less than a second. Speed 0 stops a finger, with some run-on.
        """
        table = write_asked(run, _changes(run, "speed_set", values))
        if 0 in values and not run.settings.dry_run:
            run.journal.warn(
                "speed-0",
                "a finger with speed 0 does not move again before it has another speed",
                hint="speed 0 does not replace the power switch",
            )
        return table

    @group.verb("calibrate", "Service", writes=True)
    def calibrate(run: Run) -> Table:
        """Calibrate the force sensors. The whole hand moves for about 6 s.

        Ctrl-C does not stop the hand. To stop it, switch its power off.
        The hand must be open and empty, and nothing may touch it.
        """
        from handctl.devices.inspire.hand import calibration, motion

        steps = [run.planner().trigger_step("calibrate_force", "calibrate the force sensors")]
        if (plan := run.planned(steps)) is not None:
            return plan
        question = f"{calibration.POWER_OFF} The whole hand opens and closes. It must be open and empty"
        run.need_answer(question)
        hand: Hand = run.device()
        motion.fit_to_move(hand)
        run.confirm(question, [hand.trigger_step("calibrate_force", "calibrate the force sensors")])
        return calibration.calibrate(hand, run.guide)

    for takes_numbers in (angle, position, force, speed):
        takes_numbers.context_settings.update(NEGATIVE_NUMBERS)


def _changes(run: Run, name: str, values: Sequence[int]) -> list[tuple[Element, Number]]:
    """One value for each finger of the generation that is meant. Raises UsageError."""
    register = map_of(run.settings)[name]
    if len(values) != register.count:
        more = "" if typed_model(run.settings) == DG2 else ". An RH5DG2 has 13: add --model dg2"
        raise UsageError(
            f"{len(values)} values for {register.count} fingers",
            hint=f"give {' '.join(register.elements)}. -1 leaves one as it is{more}",
        )
    changes: list[tuple[Element, Number]] = []
    for index, value in enumerate(values):
        element = Element(register, index)
        register.check(value, element.full_name)
        changes.append((element, value))
    return changes


def write_asked(run: Run, changes: Sequence[tuple[Element, Number]], wait: float | None = None) -> Table:
    """Write what was checked, and read it back. What moves the hand is shown with speed and force limit, and asked."""
    from handctl.devices.inspire.hand import motion

    changes = _without_left(changes)
    steps = run.planner().plan(changes)
    if (plan := run.planned(steps)) is not None:
        return plan
    if any(step.moves or step.strands for step in steps):
        run.need_answer(_consequence(steps))
    hand: Hand = run.device()
    hand.identify()
    if any(step.moves for step in steps):
        run.confirm(motion.question(hand, changes, motion.fit_to_move(hand)), hand.plan(changes))
    elif any(step.strands for step in steps):
        run.confirm(_consequence(steps), hand.plan(changes))
    if wait is not None:
        return motion.move(hand, changes[0][0].param.name, changes, run.guide, wait=wait)
    return hand.table(hand.write(changes))


def _consequence(steps: Sequence[Step]) -> str:
    what = "; ".join(step.meaning for step in steps)
    return f"This moves the hand: {what}" if any(step.moves for step in steps) else f"This changes the hand: {what}"


def _without_left(changes: Sequence[tuple[Element, Number]]) -> list[tuple[Element, Number]]:
    """Without the fingers that are left as they are: nothing is written for them (rh56 §9)."""
    wanted = [(element, value) for element, value in changes if element.param.kind != COMMAND or value != LEFT]
    if not wanted:
        raise UsageError("-1 leaves every finger as it is", hint="give at least one value. Nothing was sent.")
    return wanted
