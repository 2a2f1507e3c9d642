"""`handctl barrett realtime`: the RealTime loop as a live view, a stream, or a measurement."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from handctl.errors import UsageError
from handctl.files import is_pipe, read_text
from handctl.frame.clikit import Group, streaming, suspendable
from handctl.frame.run import Run
from handctl.frame.types import InFile, WholeRange
from handctl.model.result import Column, Table

if TYPE_CHECKING:
    from handctl.devices.barrett.realtime.flags import Wish
    from handctl.devices.barrett.realtime.loop import RealtimeLoop
    from handctl.devices.barrett.realtime.schedule import Controls
    from handctl.model.param import Step

COLUMNS = (
    Column("name", "Name"),
    Column("motor", "Motor"),
    Column("value", "Value", right=True),
    Column("unit", "Unit"),
    Column("guard", "Guard"),
    Column("doubt", "Doubt"),
)
GUARDS = ("stall", "window", "strain", "opening", "heat")
"""Names of `guards.GUARDS`, here so that help needs no more: a test holds them together."""


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
    @click.option("--velocity", metavar="V", help="Constant control velocity, -127 to 127: 20, or 20,5, or F1=20,F2=5.")
    @click.option("--gain", metavar="K", help="Constant proportional gain, 0 to 255, in the same form.")
    @click.option(
        "--control",
        "path",
        metavar="FILE",
        type=InFile(),
        help="Control values as CSV or JSON lines (t, velocity.F1 …). - is stdin. Live lines (without t) are valid for 1 s, then velocity is 0.",
    )
    @click.option("--measure", type=WholeRange(min=2), metavar="N", help="Exchange N blocks and show only the timing.")
    @click.option(
        "--sequential/--overlapped",
        default=None,
        help="Wait for the whole feedback before the next block, or only for its *. Default: sequential when driving, overlapped when watching. Overlapped driving starts with a self-test that moves nothing.",
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
        help="Counts per unit of delta (LFDPC). Default: the hand's own, or more if velocity and rate need it.",
    )
    @click.option(
        "--init", "initialize", is_flag=True, help="First initialize the motors (HI): the fingers open fully."
    )
    @click.option("--hold", is_flag=True, help="Leave the motors powered at the end.")
    @suspendable
    @streaming(0.0)
    def realtime(
        run: Run,
        motors: str | None,
        send: str | None,
        receive: str | None,
        velocity: str | None,
        gain: str | None,
        path: str | None,
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
    ) -> Table:
        """Exchange RealTime blocks (LOOP): live view, NDJSON or CSV.

        Without control values nothing moves. With them, each motor keeps its last velocity until the next block. However
        the loop ends, handctl sends velocity 0, leaves the loop, switches the motors off (unless you give --hold), and
        restores the flags.

        GUARDS, all on while motors are driven: stall sends velocity 0 to a motor that has not moved for TSTOP. window
        sends it to a motor that would leave the range 0 to CT. strain sends it above HSG or below LSG. opening refuses
        to open faster than IVEL allows. heat ends the loop above 65 °C or OTEMP. If a guard needs feedback that you did
        not request, handctl reads it without showing it.

        `doubt` in a row says why its value may be wrong: a delta did not fit into its byte, or the bytes after a block did
        not confirm its position in the stream.
        """
        from handctl.devices.barrett.realtime.flags import Wish, refuse_disabled
        from handctl.devices.barrett.realtime.loop import RealtimeLoop
        from handctl.devices.barrett.realtime.measure import measured
        from handctl.devices.barrett.realtime.schedule import loop_motors

        if measure is not None and (count is not None or duration is not None):
            raise UsageError(
                "--measure cannot be combined with --count or --duration", hint="leave --count and --duration out"
            )
        indices = loop_motors(motors)
        received, temperature = _received(receive, indices)
        controls = _controls(send, velocity, gain, path, indices, run.settings.deadline)
        off = set(GUARDS) if "all" in unguarded else {*unguarded, *(["opening"] if force else [])}
        wish = Wish(tuple(indices), received, temperature, hold, frozenset(GUARDS) - off, delta_unit, not may_suspend)
        first = _initialization(wish) if initialize else []
        steps = _steps(run, wish, controls)
        if run.settings.dry_run:
            return run.dry_run([*first, *steps])
        run.ledger.plan([*first, *(step for step in steps if step.meaning.startswith(wish.prefix + "LOOP"))])
        if motors is None and (initialize or controls is not None):
            refuse_disabled(run.device())
        if initialize:
            _initialize(run, wish)
        if sequential is None:
            sequential = controls is not None
        loop = RealtimeLoop(
            run.device(), run.guide, wish, controls, sequential=sequential, measuring=measure is not None
        )
        if measure is not None:
            return measured(run, loop, measure, rate)
        table = Table(
            columns=COLUMNS,
            plain=("name", "motor", "value", "unit"),
            summary=loop.summary,
            ranges={"strain": (0, 255), "position": (0, 17800)},
            wide=True,
        )
        table.samples = _guarded(loop, table, rate, count, duration)
        return table


def _initialization(wish: Wish) -> list[Step]:
    from handctl.devices.barrett.gcl.language import encode
    from handctl.model.param import Step

    text = f"{wish.prefix}HI"
    return [Step(f"{text}: initialize", encode(text), moves=True)]


def _initialize(run: Run, wish: Wish) -> None:
    from handctl.devices.barrett import motion

    failure = motion.move(run.device(), wish.prefix, "HI", None, run.guide).failure
    if failure is not None:
        raise failure


def _guarded(loop: RealtimeLoop, table: Table, rate: float, count: int | None, duration: float | None) -> Iterator[Any]:
    """The loop's samples; what failed while leaving becomes the table's failure."""
    try:
        yield from loop.run(rate=rate, count=count, duration=duration)
    finally:
        table.failure = loop.failure


def _received(text: str | None, motors: list[int]) -> tuple[dict[int, tuple[str, ...]] | None, bool | None]:
    """What --receive asks for: per motor, and whether with the temperature."""
    from handctl.devices.barrett.realtime.blocks import FEEDBACK, selections

    if text is None:
        return None, None
    names = [part.strip() for part in text.split(",") if part.strip()]
    temperature = any(name.lower() == "temperature" for name in names)
    rest = [name for name in names if name.lower() != "temperature"]
    return selections(rest, FEEDBACK, motors, "--receive"), temperature


def _controls(
    send: str | None,
    velocity: str | None,
    gain: str | None,
    path: str | None,
    motors: list[int],
    seconds: float | None,
) -> Controls | None:
    """Where control values come from, None when nothing is to be sent. Raises UsageError."""
    from handctl.devices.barrett.realtime import schedule
    from handctl.devices.barrett.realtime.blocks import CONTROL, selections

    carried = selections(send.split(","), CONTROL, motors, "--send") if send is not None else None
    start: schedule.Change = {}
    for name, text in (("velocity", velocity), ("gain", gain)):
        if text is not None:
            given = motors if carried is None else [index for index in motors if name in carried[index]]
            if not given:
                raise UsageError(f"--{name} without {name} in --send {send}", hint="leave --send out, or add it there")
            start.update(schedule.constant(text, name, given))
    if path is not None:
        controls = _from_file(path, motors, start, seconds)
        if carried is not None and carried != controls.carries:
            raise UsageError(
                f"--send {send} does not fit the columns of {path}",
                hint="leave --send out: the columns name the values",
            )
        return controls
    if carried is None:
        carried = {index: tuple(name for name in CONTROL if (index, name) in start) for index in motors}
    return schedule.Controls(carried, start) if any(carried.values()) else None


def _from_file(path: str, motors: list[int], start: dict[tuple[int, str], int], seconds: float | None) -> Controls:
    """Control values of a file, or of a pipe or stdin that is waited for `seconds`."""
    from handctl.devices.barrett.realtime import schedule
    from handctl.devices.barrett.realtime.intake import Lines

    if path == "-" or is_pipe(path):
        lines = Lines(path, seconds)
        controls = schedule.read(lines, "stdin" if path == "-" else path, motors, start)
        lines.begun = True
        if isinstance(controls, schedule.Live):
            import threading

            threading.Thread(target=controls.listen, daemon=True).start()
        return controls
    text = io.StringIO(read_text(path, "a control file", 16_000_000).removeprefix("\ufeff"), newline="")
    controls = schedule.read(text, path, motors, start)
    if controls.live:
        raise UsageError(f"{path}: no column t", hint="add times, or send the lines on stdin with --control -")
    return controls


# -- dry run ------------------------------------------------------------------------------------------------------


def _steps(run: Run, wish: Wish, controls: Controls | None) -> list[Step]:
    """The exact bytes as far as they do not depend on what the hand holds."""
    from handctl.devices.barrett.gcl.connecting import abort_at
    from handctl.devices.barrett.gcl.language import encode
    from handctl.devices.barrett.map import BARRETT
    from handctl.devices.barrett.realtime.blocks import Layout, Selection
    from handctl.devices.barrett.realtime.flags import asked_flags
    from handctl.model.param import Element, Step

    changes = [
        (Element(BARRETT.by_mnemonic(name), index), value)
        for (name, index), value in asked_flags(wish, controls).items()
        if value or not BARRETT.by_mnemonic(name).since  # a hand that does not know the flag has it off
    ]
    steps = [
        Step(f"{step.meaning}  (only flags that differ are written)", step.data) for step in run.planner().plan(changes)
    ]
    entry = f"{wish.prefix}LOOP"
    steps.append(Step(f"{entry}: enter RealTime", encode(entry)))
    values = controls.first if controls is not None else None
    if controls is None or values is None:
        steps.append(Step("request feedback, repeatedly", b"A"))
    else:
        layout = Layout({index: Selection(controls.carries[index], ()) for index in wish.motors})
        zero = {index: {**names, **({"velocity": 0} if "velocity" in names else {})} for index, names in values.items()}
        steps.append(Step("first control block", layout.control(values), moves=True))
        steps.append(Step("last control block: velocity 0", layout.control(zero, feedback=False)))
    steps.append(Step("leave RealTime", abort_at(run.settings.baud)))
    if controls is not None and not wish.hold:
        steps.append(Step(f"{wish.prefix}T: motor power off", encode(f"{wish.prefix}T")))
    return steps
