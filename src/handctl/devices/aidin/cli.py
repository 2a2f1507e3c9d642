"""`handctl aidin …`: the commands of the AIDIN-hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from handctl.command.command_tree import Group
from handctl.command.common_commands import add_map_verbs
from handctl.command.expect import expect, expected
from handctl.command.family import Family
from handctl.command.options import NEGATIVE_NUMBERS, FiniteRange, suspendable
from handctl.command.run import PlannedAction, Run
from handctl.devices.aidin.conversation import Conversation
from handctl.devices.aidin.device import AidinHand, object_of, step_of
from handctl.devices.aidin.exchange_settings import exchange_settings_of
from handctl.devices.aidin.parameter_map import AIDIN, ANGLES, CURRENTS, ENCODERS, TIPS, Mode, Target
from handctl.errors import Hint, UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink
from handctl.model.command_settings import Settings
from handctl.model.device import Gate, limits_of
from handctl.model.param import Step
from handctl.model.result import Journal
from handctl.system.deadman_process import HEARTBEAT_TIMEOUT

RECOMMENDED = 700
CAP = 300.0


def open_aidin(link: ByteLink, settings: Settings, journal: Journal) -> AidinHand:
    """An AIDIN-hand behind `link`; nothing is sent until something is asked."""
    conversation = Conversation(link, journal, **limits_of(settings, link), way=exchange_settings_of(settings))
    conversation.gate = Gate(settings.assume_identity)
    return AidinHand(conversation)


cli = Group(
    "aidin",
    family=Family("aidin", open_aidin, tcp_port=FAMILIES["aidin"].tcp_port, check=exchange_settings_of),
    help=f"Check and move an AIDIN-hand over TCP (-p tcp://HOST, default port {FAMILIES['aidin'].tcp_port}).",
)
add_map_verbs(
    cli, AIDIN, part="PART", example="joint_pos.index sensor_state.fz", without=("set", "snapshot", "diff", "restore")
)


def _step(run: Run, meaning: str, mode: Mode, **data: int) -> Step:
    return step_of(meaning, object_of(mode, **data), exchange_settings_of(run.settings).end)


ASSUME = click.option(
    "--assume-homed", is_flag=True, help="Continue even if the encoders are out of range, as they are before homing."
)


@cli.verb("home", "Move", writes=True, asks=True)
def home(run: Run) -> PlannedAction:
    """DRIVE ALL FINGERS OPEN for 3.5 s, then make that position the origin.

    Asks first. Ctrl-C stops the hand. Home the hand after every power-on, because its encoders are incremental.
    """
    from handctl.devices.aidin import homing_and_bias

    return PlannedAction(
        [_step(run, f"homing, every 20 ms for {homing_and_bias.HOLD:g} s with nothing else in between", Mode.HOMING)],
        lambda hand: homing_and_bias.home(hand, run.prompts),
        f"All fingers will OPEN for {homing_and_bias.HOLD:g} s and drop any held object. Keep clear",
    )


@cli.verb("initial", "Move", writes=True, asks=True)
@ASSUME
def initial(run: Run, assume_homed: bool) -> PlannedAction:
    """Open all fingers to the origin set by homing. Asks first. Ctrl-C stops the hand."""
    from handctl.devices.aidin import homing_and_bias

    return PlannedAction(
        [_step(run, "initial position, every 20 ms until it is reached", Mode.INITIAL)],
        lambda hand: homing_and_bias.initial(hand, run.prompts, assume_homed=assume_homed),
        "All fingers will OPEN to their origin and drop any held object",
    )


@cli.verb("bias", "Settings", writes=True)
def bias(run: Run) -> PlannedAction:
    """Set the sensors to 0. Touch nothing: any load is subtracted from all later values."""
    from handctl.devices.aidin import homing_and_bias

    return PlannedAction(
        [_step(run, f"sensor bias, every 20 ms for {homing_and_bias.BIAS_SECONDS:g} s", Mode.BIAS)],
        homing_and_bias.bias,
    )


@cli.verb("max-torque", "Settings", writes=True, asks=True)
@click.argument("value", metavar="N")
def max_torque(run: Run, value: str) -> PlannedAction:
    """Set the maximum torque (output current), 0 to 1000 in units of 0.1 %.

    Asks first: the hand does not report its targets, and if you raise the limit, a finger may continue its movement.
    700 to 1000 is recommended.

    It cannot be read back."""
    from handctl.devices.aidin import homing_and_bias

    param = AIDIN["maxtorque"]
    number = int(param.parse(value))
    seconds = homing_and_bias.MAX_TORQUE_SECONDS
    steps = [_step(run, f"maximum torque, every 20 ms for {seconds:g} s", Mode.MAXTORQUE, maxtorque=number)]
    if number < RECOMMENDED:
        run.journal.warn("low-torque", f"maxtorque {number}: 700 to 1000 is recommended ({param.source})")
    question = (
        "Fingers that a lower limit has held back may MOVE to their targets, which the hand does not report. Keep clear"
        if number
        else "Without torque the fingers do not move, and may drop a held object"
    )
    return PlannedAction(steps, lambda hand: homing_and_bias.max_torque(hand, number), question)


@cli.verb("check", "Service", writes=True, asks=True)
def check(run: Run) -> PlannedAction:
    """Move each motor a little and back, one after the other, and report findings.

    Asks first. Ctrl-C stops the hand. The hand must be homed, open and empty: `handctl aidin home` or `initial` opens it.
    Reads the sensors for 2 s at rest, then moves each motor by 4 % of its stroke. The table is as in `doctor`.
    The exit code is 7 if a check warns or fails.
    """
    from handctl.devices.aidin import motor_and_sensor_check as checking

    return PlannedAction(
        lambda: checking.plan(run.device, exchange_settings_of(run.settings).end),
        lambda hand: checking.check(hand, run.prompts),
        checking.QUESTION,
    )


# -- targets --------------------------------------------------------------------------------------------------------


def _values(body: Callable[..., Any]) -> Callable[..., Any]:
    return click.argument("values", nargs=-1, required=True, metavar="VALUES | FINGER.ELEMENT=VALUE...")(body)


def _move(
    run: Run, target: Target, values: tuple[str, ...], assume_homed: bool, expect: str | None, *, rad: bool = False
) -> PlannedAction:
    from handctl.devices.aidin import motion
    from handctl.devices.aidin.motion import parse

    goal = parse(target, values, rad=rad)
    ending = expected(expect)
    return PlannedAction(
        lambda: motion.plan(run.device, goal, exchange_settings_of(run.settings).end),
        lambda hand: motion.move(hand, goal, run.prompts, assume_homed=assume_homed, expect=ending),
    )


@cli.verb("encoders", "Move", writes=True)
@_values
@ASSUME
@expect
def encoders(run: Run, values: tuple[str, ...], assume_homed: bool, expect: str | None) -> PlannedAction:
    """Move motors to encoder counts.

    Give all 15 (thumb, index, middle, ring, little, each m1 m2 m3), or only some, as NAME=VALUE: `encoders index.m3=85000`.
    The others keep their position. The hand must be homed.
    A whole stroke takes five seconds. Ctrl-C stops and switches the motor power off.
    """
    return _move(run, ENCODERS, values, assume_homed, expect)


@cli.verb("joints", "Move", writes=True)
@_values
@click.option("--rad", is_flag=True, help="Values are in radians, not degrees.")
@ASSUME
@expect
def joints(run: Run, values: tuple[str, ...], rad: bool, assume_homed: bool, expect: str | None) -> PlannedAction:
    """Move joints to angles in degrees.

    Give all 15 (thumb, index, middle, ring, little, each q1 q2 q3) or 20 (with q4), or only some, as NAME=VALUE:
    `joints index.q3=160 thumb.q1=10`. The others keep their position. q3 is the angle between two links (180 is
    straight), and q4 follows q3. The hand must be homed.
    Joints move at 60 degrees per second. Ctrl-C stops and switches the motor power off.
    """
    return _move(run, ANGLES, values, assume_homed, expect, rad=rad)


@cli.verb("fingertips", "Move", writes=True)
@_values
@ASSUME
@expect
def fingertips(run: Run, values: tuple[str, ...], assume_homed: bool, expect: str | None) -> PlannedAction:
    """Move fingertips to coordinates in mm.

    Give all 15 (thumb, index, middle, ring, little, each x y z in its finger's own frame), or only some, as NAME=VALUE:
    `fingertips index.z=120`. The others keep their position. The hand must be homed.
    Fingertips move at 60 mm per second. Ctrl-C stops and switches the motor power off.
    """
    return _move(run, TIPS, values, assume_homed, expect)


@cli.verb("currents", "Move", writes=True, asks=True)
@_values
@click.option(
    "--cap", type=FiniteRange(0, 1000), default=CAP, show_default=True, metavar="N", help="Refuse currents above N."
)
@click.option(
    "--duration",
    type=FiniteRange(0, 60, min_open=True),
    default=1.0,
    show_default=True,
    metavar="S",
    help="How long the currents flow after the ramp.",
)
@click.option("--ramp-down", is_flag=True, help="Make Ctrl-C ramp the currents down to 0 before it stops.")
@suspendable(HEARTBEAT_TIMEOUT)
def currents(
    run: Run, values: tuple[str, ...], cap: float, duration: float, ramp_down: bool, may_suspend: bool
) -> PlannedAction:
    """Drive motors by current: NO POSITION LIMIT.

    The fingers push as far as they can. Asks first. Ctrl-C stops immediately, and the fingers then move freely. With
    --ramp-down, Ctrl-C ramps down, and a second Ctrl-C stops immediately.
    Give all 15 (thumb, index, middle, ring, little, each m1 m2 m3), or only some, as NAME=VALUE.
    First sets the maximum torque to 1000, as the manual requires, and leaves it there. Then ramps up by 200 per
    second, holds, ramps down to 0 and stops.
    """
    from handctl.devices.aidin import motion
    from handctl.devices.aidin.homing_and_bias import MAX_TORQUE_SECONDS
    from handctl.devices.aidin.motion import parse

    goal = parse(CURRENTS, values, cap=cap)
    lasting = f"every 20 ms for {MAX_TORQUE_SECONDS:g} s"
    first = _step(run, f"maximum torque 1000, {lasting}", Mode.MAXTORQUE, maxtorque=1000)
    last = _step(run, "stop, sent 3 times", Mode.STOP)
    if not run.settings.dry_run and not any(goal.named.values()) and goal.names_all:
        raise UsageError(
            "all currents are 0, so there is nothing to do", hint=Hint("to switch the motors off, use {}", "aidin stop")
        )
    heartbeat = 0.0 if may_suspend else HEARTBEAT_TIMEOUT
    return PlannedAction(
        lambda: [first, *motion.plan(run.device, goal, exchange_settings_of(run.settings).end), last],
        lambda hand: motion.currents(
            hand, goal, run.prompts, seconds=duration, cap=cap, ramp_down=ramp_down, heartbeat=heartbeat
        ),
        f"The motors will be driven by CURRENT for {duration:g} s: the fingers push without a position limit, "
        "and the maximum torque stays at 1000",
        asks=[first, last],
    )


for _name in ("max-torque", "encoders", "joints", "fingertips", "currents"):
    cli.commands[_name].context_settings = dict(NEGATIVE_NUMBERS)
