"""`handctl barrett realtime`: the RealTime loop as a live view, a stream, or a measurement."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Group
from handctl.command.options import InFile, OutFile, WholeRange, mark_options, streaming, suspendable
from handctl.command.run import PlannedAction, Run
from handctl.devices.barrett.gcl.codec import encode
from handctl.devices.barrett.parameter_map import BARRETT, TRAVEL
from handctl.devices.barrett.realtime.guards import GUARDS
from handctl.devices.barrett.status_and_parameter_views import DOUBT, MOTOR, NAME, UNIT, VALUE
from handctl.errors import UsageError
from handctl.model.param import Step
from handctl.model.result import Column, Table
from handctl.system.deadman_process import HEARTBEAT_TIMEOUT

if TYPE_CHECKING:
    from handctl.devices.barrett.device import BarrettHand
    from handctl.devices.barrett.realtime.loop import RealtimeLoop

COLUMNS = (NAME, MOTOR, VALUE, UNIT, Column("guard", "Guard"), DOUBT)


def add_realtime(group: Group) -> None:
    """Add the command to the family's group."""

    @group.verb("realtime", "Move", writes=True, streams=True)
    @click.option(
        "--motors",
        metavar="12S",
        help="Motors in the loop: digits 1 to 4, G for the fingers, S for the spread (default: all).",
    )
    @click.option(
        "--send",
        metavar="NAMES",
        help="Values in control blocks: velocity, gain. `velocity@12` limits it to some motors.",
    )
    @click.option(
        "--receive",
        metavar="NAMES",
        help="Values in feedback: velocity, strain, position, delta, temperature, none. `strain@12` limits it to some motors "
        "(default: the hand's own flags).",
    )
    @click.option(
        "--angles",
        is_flag=True,
        help="Also show the joint angles in degrees, calculated from the positions. See ANGLES.",
    )
    @click.option(
        "--velocity",
        metavar="V",
        help="Constant control velocity, -127 to 127. Examples: 20 (all motors), 20,5 (in order), F1=20,F2=5.",
    )
    @click.option("--gain", metavar="K", help="Constant proportional gain, 0 to 255, in the same form.")
    @click.option(
        "--control",
        "path",
        metavar="FILE",
        type=InFile(),
        help="Control values as CSV or JSON lines (t, velocity.F1 …). - is stdin. Live lines (without t) are valid for 1 s, then velocity is 0.",
    )
    @click.option(
        "--law",
        "laws",
        multiple=True,
        metavar="LAW",
        help="A control law, such as 'velocity.F1 = clamp((9000 - P.F1)/20, -40, 40)'. Can be repeated. See LAWS.",
    )
    @click.option(
        "--until",
        metavar="CONDITION",
        help="End when this is true, such as 'abs(P.F1 - 9000) < 50'. Same terms as a law.",
    )
    @click.option(
        "--log",
        "file",
        metavar="FILE",
        type=OutFile(additional=(".json",)),
        help="Record the rows to a new FILE (CSV) with a sidecar FILE.json, as `log` does.",
    )
    @mark_options
    @click.option(
        "--measure",
        type=WholeRange(min=2),
        metavar="N",
        help="Exchange N blocks and show only the timing and, if velocity and position are received, the estimated velocity unit.",
    )
    @click.option(
        "--sequential/--overlapped",
        default=None,
        help="Wait for the complete feedback before sending the next block, or only for the `*` that begins it. Default: sequential when driving, overlapped when watching. Overlapped driving starts with a self-test that moves nothing.",
    )
    @click.option(
        "--no-guard",
        "unguarded",
        multiple=True,
        metavar="NAME",
        type=click.Choice([*GUARDS, "all"]),
        help=f"Switch off a guard: {', '.join(GUARDS)}, all. See GUARDS.",
    )
    @click.option("--force", is_flag=True, help="Same as --no-guard opening. This may deform the clutch permanently.")
    @click.option(
        "--delta-unit",
        type=WholeRange(1, 255),
        metavar="N",
        help="Counts per unit of delta (LFDPC). Default: the hand's own setting, or a larger one if the delta of a fast motor would not fit into its byte.",
    )
    @click.option(
        "--init", "initialize", is_flag=True, help="First initialize the motors (HI): the fingers open fully."
    )
    @click.option("--hold", is_flag=True, help="Leave the motors powered at the end.")
    @suspendable(HEARTBEAT_TIMEOUT)
    @streaming(0.0)
    def realtime(
        run: Run,
        motors: str | None,
        send: str | None,
        receive: str | None,
        angles: bool,
        velocity: str | None,
        gain: str | None,
        path: str | None,
        laws: tuple[str, ...],
        until: str | None,
        file: str | None,
        measure: int | None,
        sequential: bool | None,
        unguarded: tuple[str, ...],
        force: bool,
        delta_unit: int | None,
        initialize: bool,
        hold: bool,
        may_suspend: bool,
        rate: float,
        count: int | None,
        duration: float | None,
        **marks: Any,
    ) -> PlannedAction:
        """Run the RealTime loop (LOOP), shown live or written as NDJSON or CSV.

        Without control values nothing moves. With them, each motor keeps its last velocity until the next block. However
        the loop ends, handctl sends velocity 0, leaves the loop, switches the motors off (unless you give --hold), reads the
        positions twice, which must not change, and restores the loop parameters that it changed. A velocity or gain of 13 is sent as 12: its
        byte ends a line of text, so a block with it could move a hand that has left the loop.

        GUARDS, all on while motors are driven: stall sends velocity 0 to a motor that has not moved for the time in
        TSTOP. window sends it to a motor that would leave the range 0 to CT. strain sends it to a motor whose strain is
        above HSG or below LSG. opening refuses to open faster than IVEL allows. heat ends the loop when the temperature
        exceeds 65 °C or OTEMP, whichever is lower. If a guard needs feedback that you did
        not request, handctl reads it without showing it.

        LAWS: a law sets the velocity or the gain of a motor from the block before. P is the position, V the velocity, S the strain and D
        the change of position, each with its motor: P.F1. T is the temperature in °C, N the number of the block, t the time in s, velocity.F1 and
        gain.F1 the values sent last, and any other name a column of the --control file. Use + - * / comparisons, and, or, not, and abs, min, max, clamp,
        sign, floor, round, sqrt, sin, cos. The result is rounded and limited to -127 to 127 (gain: 1 to 255). If it is not a number,
        velocity 0 is sent and the loop ends with exit code 7. No law can override a guard.

        ANGLES: with --angles, each block also has joint_inner and joint_outer of each finger and joint_spread of the spread,
        in degrees. A clutch that lets go locks the inner link, and the loop does not show it. joint_outer is therefore
        given only if the firmware (4.34 or 4.4) reported before the loop that the clutch holds, and only until the finger is
        driven to close. `state` in a row says which of these cases applies, and joint_inner is correct as long as the clutch holds.

        `doubt` in a row says why its value may be wrong: a delta did not fit into its byte, or the bytes after a block did
        not confirm its position in the stream.
        """
        from handctl.devices.barrett.maintenance.fingertips import RANGES
        from handctl.devices.barrett.motion import moved
        from handctl.devices.barrett.realtime import control_values
        from handctl.devices.barrett.realtime.control_laws import Rules
        from handctl.devices.barrett.realtime.enter_and_leave import steps_of
        from handctl.devices.barrett.realtime.loop import RealtimeLoop
        from handctl.devices.barrett.realtime.loop_flags import FlagRequest, refuse_disabled
        from handctl.devices.barrett.realtime.loop_rows import measured

        if measure is not None and angles:
            raise UsageError("--angles cannot be combined with --measure", hint="leave one of them out")
        if measure is not None and (count is not None or duration is not None):
            raise UsageError(
                "--measure cannot be combined with --count or --duration", hint="leave --count and --duration out"
            )
        recorder = _recorder(run, file, marks, rate, count, duration)
        if file is not None and (measure is not None or (path == "-" and marks["mark_stdin"])):
            raise UsageError(
                "--log cannot be combined with --measure, nor --mark-stdin with --control -",
                hint="leave one of them out",
            )
        indices = control_values.loop_motors(motors)
        received, temperature = control_values.received(receive, indices)
        rules = Rules(laws, until, indices, columns=path is not None)
        given = control_values.controls_of(send, velocity, gain, path, indices, run.settings.deadline, rules.columns)
        controls = rules.over(given)
        if isinstance(given, control_values.Live):
            threading.Thread(target=given.listen, daemon=True).start()
        off = set(GUARDS) if "all" in unguarded else {*unguarded, *(["opening"] if force else [])}
        flag_request = FlagRequest(
            tuple(indices),
            received,
            temperature,
            hold,
            frozenset(GUARDS) - off,
            delta_unit,
            not may_suspend,
            rules.needs | (frozenset((index, "position") for index in indices) if angles else frozenset()),
            angles,
        )
        homing = f"{flag_request.prefix}HI"
        first = [Step(f"{homing}: initialize", encode(homing), moves=True)] if initialize else []
        steps = steps_of(run.planner(), flag_request, controls, run.settings.baud)

        def drive(hand: BarrettHand) -> Table:
            run.ledger.plan(
                [*first, *(step for step in steps if step.meaning.startswith(flag_request.prefix + "LOOP"))]
            )
            if motors is None and (initialize or controls is not None):
                refuse_disabled(hand)
            if initialize:
                moved(hand, flag_request.prefix, "HI", None, run.prompts)
            waits = controls is not None if sequential is None else sequential
            loop = RealtimeLoop(
                hand, run.prompts, flag_request, controls, sequential=waits, measuring=measure is not None, rules=rules
            )
            if measure is not None:
                return measured(run, loop, measure, rate)
            if recorder is not None:
                return recorder(hand, loop, {"laws": list(laws), "until": until})
            table = Table(columns=COLUMNS, plain=("name", "motor", "value", "unit"), summary=loop.summary, wide=True)
            table.ranges = {"strain": (0, 255), "position": (0, TRAVEL[0]), **(RANGES if angles else {})}
            table.steer = loop.steer
            table.samples = _guarded(loop, table, rate, count, duration)
            return table

        return PlannedAction(lambda: [*first, *steps], drive)


def _recorder(
    run: Run, file: str | None, marks: dict[str, Any], rate: float, count: int | None, duration: float | None
) -> Callable[[BarrettHand, RealtimeLoop, dict[str, Any]], Table] | None:
    """What records a loop into FILE, None = nothing is recorded. Raises UsageError for what cannot be, before anything is sent."""
    if file is None:
        if given := [name for name, value in marks.items() if value not in (None, False, "")]:
            raise UsageError(f"--{given[0].replace('_', '-')} needs --log", hint="add --log FILE")
        return None
    from handctl.command import log_command

    wishes = log_command.RequestedOptions(duration, count, rate, silence=0.0, force=None, **marks)
    log_command.place_of(run, file, wishes)

    def recorded(hand: BarrettHand, loop: RealtimeLoop, about: dict[str, Any]) -> Table:
        samples = loop.run(rate=rate, count=count, duration=duration, outline=True)
        source = log_command.StreamSource(
            hand, samples, lambda: loop.intake.moment, lambda: {"realtime": {**about, **loop.summary()}}
        )
        try:
            table = log_command.log(run, file, wishes, BARRETT, lambda _again: source)
        finally:
            source.ended()
        table.failure = loop.failure or table.failure
        return table

    return recorded


def _guarded(loop: RealtimeLoop, table: Table, rate: float, count: int | None, duration: float | None) -> Iterator[Any]:
    """The loop's samples; what failed while leaving becomes the table's failure."""
    try:
        yield from loop.run(rate=rate, count=count, duration=duration)
    finally:
        table.failure = loop.failure
