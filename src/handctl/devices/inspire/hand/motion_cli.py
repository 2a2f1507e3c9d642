"""`handctl hand angle | position | force | speed | calibrate`: what moves the hand, and how fast and how firmly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from handctl.devices.inspire.hand.map import DG2
from handctl.devices.inspire.hand.typed import map_of, typed_model
from handctl.devices.inspire.map import ALONE
from handctl.errors import UsageError, joined
from handctl.frame import verbs
from handctl.frame.clikit import Group
from handctl.frame.expect import expect, expected
from handctl.frame.run import Run
from handctl.frame.types import NEGATIVE_NUMBERS, Seconds
from handctl.model.param import COMMAND, Element, Number, Step, given
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

FINGERS = "LITTLE RING MIDDLE INDEX THUMB ROTATION | FINGER=VALUE..."
WAIT = click.option(
    "--wait",
    type=Seconds(),
    metavar="S",
    help="Wait up to S seconds for the fingers to stop moving. Ctrl-C sets their speed to 0.",
)


def add_movements(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("angle", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, metavar=FINGERS)
    @WAIT
    @expect
    def angle(run: Run, values: tuple[str, ...], wait: float | None, expect: str | None) -> Table:
        """Command angles from 0 (closed) to 1000 (open). Asks first.

        Give a value for every finger, where -1 leaves it as it is, or name single fingers: `angle ring=500 index=300`.
        The question shows the present speed and force limit. Change them with `speed` and `force`.
        """
        return write_asked(run, _changes(run, "angle_set", values), wait, expect)

    @group.verb("position", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, metavar=FINGERS)
    @WAIT
    @expect
    def position(run: Run, values: tuple[str, ...], wait: float | None, expect: str | None) -> Table:
        """Command strokes from 0 (open) to 2000 (closed). Asks first.

        Give a value for every finger, where -1 leaves it as it is, or name single fingers: `position ring=900`.
        The manufacturer recommends `angle` instead.
        """
        return write_asked(run, _changes(run, "stroke_set", values), wait, expect)

    @group.verb("force", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, metavar=FINGERS)
    def force(run: Run, values: tuple[str, ...]) -> Table:
        """Set the force limit in grams. Asks first if a finger may move.

        Give a value for every finger, where -1 leaves it as it is, or name single fingers: `force index=300`.
        A closing finger stops when it reaches the limit. It does not hold that force.
        The limit applies from the next movement on. With a higher limit, a finger that stopped may go on to its target.
        """
        return write_asked(run, _changes(run, "force_limit", values))

    @group.verb("speed", "Move", writes=True)
    @click.argument("values", nargs=-1, required=True, metavar=FINGERS)
    def speed(run: Run, values: tuple[str, ...]) -> Table:
        """Set the speed of the next movement, 0 to 1000. Asks first if a finger may move.

        Give a value for every finger, where -1 leaves it as it is, or name single fingers: `speed index=300`.
        At 1000 a finger closes in less than a second. Speed 0 stops a finger, which runs on a little.
        With a new speed, a finger that stopped on its way goes on to its target.
        """
        changes = _changes(run, "speed_set", values)
        table = write_asked(run, changes)
        if any(value == 0 for _, value in changes) and not run.settings.dry_run:
            run.journal.warn(
                "speed-0",
                "a finger with speed 0 does not move again until you set another speed",
                hint="speed 0 does not replace the power switch",
            )
        return table

    @group.verb("calibrate", "Service", writes=True)
    def calibrate(run: Run) -> Table:
        """Calibrate the force sensors. The whole hand moves for about 6 s.

        Ctrl-C does not stop the hand. To stop it, switch its power off.
        The hand must be open and empty, with nothing touching it.
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


def _changes(run: Run, name: str, texts: Sequence[str]) -> list[tuple[Element, Number]]:
    """What is typed for the fingers of the generation that is meant. Raises UsageError."""
    register = map_of(run.settings)[name]
    more = "" if typed_model(run.settings) == DG2 else ". An RH5DG2 has 13: add --model dg2"
    found = given(texts, register.elements, what=run.command, more=f". -1 leaves one as it is{more}")
    elements = [Element(register, index) for index in found]
    return [
        (element, register.parse(text, element.full_name))
        for element, text in zip(elements, found.values(), strict=True)
    ]


def write_asked(
    run: Run, changes: Sequence[tuple[Element, Number]], wait: float | None = None, expect: str | None = None
) -> Table:
    """Write what was checked, and read it back. What moves the hand is shown with speed and force limit, and asked."""
    from handctl.devices.inspire.hand import motion

    ending = expected(expect, waits=wait is not None)
    changes = _without_left(changes)
    planner: Hand = run.planner()
    steps = planner.plan(changes)
    if (plan := run.planned(steps)) is not None:
        return plan
    if any(step.moves or step.strands for step in steps):
        run.need_answer(_consequence(steps))
    hand: Hand = run.device()
    hand.identify()
    before: motion.Before | None = None
    if any(step.moves for step in steps):
        before = motion.fit_to_move(hand)
        question = joined(motion.question(hand, changes, before), motion.also(hand, changes))
        run.confirm(question, hand.plan(changes))
    elif any(step.strands for step in steps):
        run.confirm(_consequence(steps), hand.plan(changes))
    else:
        verbs.ask_released(run, hand, changes, hand.plan(changes))
    if wait is not None:
        return motion.move(hand, changes[0][0].param.name, changes, run.guide, wait=wait, expect=ending, before=before)
    table = hand.table(hand.write(changes))
    if before is not None:
        motion.tell_no_speed(hand, changes, before)
    return table


def _consequence(steps: Sequence[Step]) -> str:
    what = "; ".join(step.meaning for step in steps)
    return f"This moves the hand: {what}" if any(step.moves for step in steps) else f"This changes the hand: {what}"


def _without_left(changes: Sequence[tuple[Element, Number]]) -> list[tuple[Element, Number]]:
    """Without the fingers that are left as they are: nothing is written for them (rh56 §9)."""
    wanted = [(element, value) for element, value in changes if element.param.kind != COMMAND or value != ALONE]
    if not wanted:
        raise UsageError("-1 leaves every finger as it is", hint="give at least one value. Nothing was sent.")
    return wanted
