"""`handctl barrett maintenance | strain | fingertips | diagnose`: the commands of care. Bodies live in their modules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from handctl.command import get_set_watch
from handctl.command.command_tree import Group
from handctl.command.options import BOUNDS, OutFile, WholeRange, watch_options
from handctl.command.run import Asked, PlannedAction, Run
from handctl.devices.barrett.gcl.codec import motor_prefix
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.errors import Hint, NotConfirmed, OutputError, UsageError
from handctl.files import why_unwritable
from handctl.model.param import Step
from handctl.model.result import Column, Table

if TYPE_CHECKING:
    from handctl.devices.barrett.device import BarrettHand

LIGHT_STEPS = ("power-on", "firmware", "settings", "temperature", "init", "strain", "origin", "position-at-stop", "finger-speed", "spread-speed", "highest-speed", "early-breakaway", "breakaway", "grease")  # fmt: skip
"""Names of `first_light.steps_for`, here so that help needs no more: a test holds them together."""
PROCEDURE_NAMES = ("lubrication", "fasteners", "pretension", "strain", "firmware")
HAND_NAME = click.option(
    "--hand", "name", default="", metavar="NAME", help="Name for this hand in the journal if its serial number is 0."
)


def _live(run: Run, live: bool, **only: Any) -> None:
    """Make this run a stream, or refuse what `only` a stream has without --live. Raises UsageError."""
    given = [f"--{name}" for name, value in only.items() if value]
    if given and not live:
        raise UsageError(f"without --live this command does not take {', '.join(given)}", hint="add --live")
    run.streams = live


GREASED_HELP = "Record points as greased today: all, worm, spur, motor-spur, palm, or spur.F1 for one finger. Separate points with commas."


def _procedure(name: str) -> Table:
    from handctl.devices.barrett.maintenance import symptoms

    found = symptoms.PROCEDURES[name]
    rows = [
        {"step": number, "text": text, "source": f"barrett {source}"}
        for number, (text, source) in enumerate(found.steps, 1)
    ]
    return Table(
        rows=rows,
        columns=(Column("step", "Step", right=True), Column("text", found.title), Column("source", "Section")),
        text=lambda _: "\n".join(symptoms.lines(name)) + "\n",
    )


def add_care_commands(group: Group) -> None:
    """Add the commands to the family's group."""

    @group.verb("maintenance", "Service")
    @click.option("--greased", metavar="POINT", is_flag=False, flag_value="all", help=GREASED_HELP)
    @click.option(
        "--steps",
        type=click.Choice(PROCEDURE_NAMES),
        help="List the steps of a procedure, with manual sections. Needs no device.",
    )
    @click.option("--check", is_flag=True, help="Exit with code 7 if anything is due or too hot.")
    @HAND_NAME
    def maintenance(run: Run, greased: str | None, steps: str | None, check: bool, name: str) -> Table:
        """Show the strokes of each motor and any maintenance that is due (§7).

        Lists the greasing points, fasteners, pretension and temperatures. The greasing journal is a file on this
        computer. Nothing is written to the hand.
        """
        if steps is not None:
            return _procedure(steps)
        from handctl.devices.barrett.maintenance import lubrication

        points = lubrication.chosen_points(greased) if greased is not None else []
        hand = run.device()
        care = lubrication.MaintenanceLog(hand, name)
        if points:
            care.grease(points)
        return lubrication.table_of(hand, care, check=check)

    @group.verb("strain", "Service", writes=True)
    @click.option(
        "--open",
        "open_first",
        is_flag=True,
        help="MOVES the hand: initialize it, free the spread and open the fingers first.",
    )
    @click.option(
        "--live",
        is_flag=True,
        help="Show the readings live while you turn the potentiometer. The bar spans 100 to 140.",
    )
    @click.option("--check", is_flag=True, help="Exit with code 7 if a reading is outside 100 to 140.")
    @watch_options
    @BOUNDS
    def strain(
        run: Run,
        open_first: bool,
        live: bool,
        check: bool,
        limits: tuple[str, ...] = (),
        until: tuple[str, ...] = (),
        **timing: Any,
    ) -> Table | PlannedAction:
        """Measure the strain gauges without load, and show how to adjust them (§7.4).

        Checks 20 readings per finger against 100 to 140. Read-only. The gauges are unloaded only when the fingers
        are open; --open opens them first (HI, ST, GO).
        """
        from handctl.devices.barrett.maintenance import strain_gauges as gauges
        from handctl.devices.barrett.maintenance import symptoms

        _live(run, live, count=timing["count"], duration=timing["duration"], limit=limits, until=until)
        if live and check:
            raise UsageError("--check and --live cannot be combined", hint="leave one out")
        bounds = get_set_watch.bounds_of(run, BARRETT, limits, until)

        def measure(hand: BarrettHand) -> Table:
            if open_first:
                gauges.prepare(hand, run.prompts)
            if not live:
                return gauges.table(hand, check=check)
            for line in symptoms.lines("strain") if run.settings.format == "table" else []:
                run.prompts.say(line)
            return get_set_watch.within(bounds, gauges.stream(hand, **timing))

        if not open_first:
            run.only_reads("--open")
            return measure(run.device())
        run.streams = live and not run.settings.dry_run
        return PlannedAction(gauges.preparation_steps, measure)

    @group.verb("fingertips", "Inspect", offline_when=lambda typed: typed["positions"] is not None)
    @click.option(
        "--positions",
        nargs=4,
        type=WholeRange(0, 20000),
        metavar="F1 F2 F3 SPREAD",
        help="Use these counts instead of the hand's. Needs no device.",
    )
    @click.option(
        "--breakaway", multiple=True, metavar="FINGER=COUNTS", help="With --positions: the clutch broke away at COUNTS."
    )
    @click.option("--live", is_flag=True, help="Keep reading: a live view on a terminal, otherwise a stream.")
    @watch_options
    @BOUNDS
    def fingertips(
        run: Run,
        positions: tuple[int, int, int, int] | None,
        breakaway: tuple[str, ...],
        live: bool,
        limits: tuple[str, ...] = (),
        until: tuple[str, ...] = (),
        **timing: Any,
    ) -> Table:
        """Show each fingertip's position in mm and its joint angles (§9.5, §9.6).

        Read-only. Positions are measured from the centre of the palm. The angles depend on whether a clutch has broken
        away, which firmware 4.34 and later reports. With older firmware handctl assumes that none has.
        """
        from handctl.devices.barrett.maintenance import fingertips as tips

        _live(run, live, count=timing["count"], duration=timing["duration"], until=until)

        if positions is not None:
            if live or limits:
                raise UsageError("--positions cannot be combined with --live or --limit", hint="leave one out")
            return tips.offline(positions, tips.breakaways(breakaway))
        if breakaway:
            raise UsageError(
                "--breakaway needs --positions",
                hint="leave it out: firmware 4.34 and later report the breakaway themselves",
            )
        bounds = get_set_watch.bounds_of(run, tips.named, limits, until)
        hand = run.device()
        return get_set_watch.within(bounds, tips.stream(hand, **timing) if live else tips.now(hand))

    @group.verb("diagnose", "Service", writes=True, asks="with `--move`", offline_when=lambda typed: typed["listed"])
    @click.argument("symptom", required=False)
    @click.option("--list", "listed", is_flag=True, help="List the symptoms in the manual. Needs no device.")
    @click.option(
        "--move", is_flag=True, help="MOVES the hand: also run the movements that test the symptom. Asks first."
    )
    @click.option("--motors", metavar="123", default="G", show_default=True, help="Fingers that --move may move.")
    @HAND_NAME
    def diagnose(
        run: Run, symptom: str | None, listed: bool, move: bool, motors: str, name: str
    ) -> Table | PlannedAction:
        """Run the manual's troubleshooting checks (§8). With SYMPTOM, also list the steps to do by hand.

        The exit code is 7 if a check warns or fails, or if the hand does not answer.
        """
        from handctl.devices.barrett.maintenance import diagnose as doctor

        if listed:
            return doctor.list_table()
        entry = doctor.symptom_of(symptom) if symptom is not None else None
        names = entry.trials if entry is not None else ()
        digits = motor_prefix(motors)
        if move and (not names or "4" in digits):
            raise UsageError(
                "--move needs a symptom with test movements, and fingers to move",
                hint=Hint(
                    "{} shows the symptoms. Fingers are 1, 2, 3 or G. Nothing was sent.", "barrett diagnose --list"
                ),
            )

        def examine(hand: BarrettHand) -> Table:
            patient = doctor.ExaminedHand(hand, name)
            wanted = [*doctor.USUAL, *(entry.checks if entry is not None else ())]
            findings, failure = doctor.examine(patient, wanted, run.settings.baud)
            answers = findings[0].status == "ok" and failure is None
            if move and answers:
                findings += doctor.run_all(patient, names, digits, run.prompts)
            else:
                findings += doctor.not_run(names, "no communication" if not answers else "moves the hand: --move")
            return doctor.table_of(hand, findings, symptom, failure)

        if not move:
            run.only_reads("--move")
            return examine(run.device())
        return PlannedAction(
            doctor.steps(names, digits), examine, "This moves the hand. Keep people and things out of its reach"
        )

    @group.verb("first-light", "Service", writes=True, asks=True)
    @click.argument("link", required=False)
    @click.option(
        "--skip",
        type=click.Choice(LIGHT_STEPS),
        multiple=True,
        metavar="STEP",
        help=f"Skip this step. Can be repeated. Steps: {', '.join(LIGHT_STEPS)}.",
    )
    @click.option(
        "--repeat",
        type=WholeRange(2, 20),
        default=2,
        show_default=True,
        metavar="N",
        help="Repeat each reading step N times. All of them must agree.",
    )
    @click.option(
        "--identify", is_flag=True, help="Keep the serial number and other identifying data in the facts file."
    )
    @click.option(
        "--keep",
        "path",
        type=OutFile(),
        metavar="FILE",
        help="Also keep the facts in FILE (JSON), as `prove -o` does, for --facts and `prove diff`.",
    )
    @HAND_NAME
    def first_light(
        run: Run, link: str | None, skip: tuple[str, ...], repeat: int, identify: bool, path: str | None, name: str
    ) -> PlannedAction:
        """Bring a hand from the cupboard into use, step by step. MOVES the hand.

        Listens while you switch the power on, then checks firmware, settings, temperature, HI, strain, origin, speeds, the
        clutches (firmware 4.34 and later) and greasing. Each step asks first, and what moves says what will move. A step
        that fails is a row of the result, and the next one is offered. The first sign of harm
        ends the run, and the hand is stopped if a movement was agreed to. Even with --yes, nothing moves while the hand is too hot or has a harmful setting, and HI comes first.
        """
        from handctl.devices.barrett.maintenance import first_light as light
        from handctl.devices.barrett.probe import ping
        from handctl.model import facts_file
        from handctl.model.proofs import READ, table_of

        run.reach(link)
        if path is not None and (why := why_unwritable(path)):
            raise OutputError(
                f"{path}: cannot be written: {why}", hint="choose another file for --keep. Nothing was sent."
            )
        attended = run.asks and run.prompts.present
        steps = light.steps_for(name, attended=attended)
        wanted = [step for step in steps if step.proof.name not in skip]
        question = light.QUESTION if any(step.proof.question for step in wanted) else ""

        def carry_out(hand: BarrettHand) -> Table:
            def ask(step: light.LightStep) -> bool:
                proof = step.proof
                if proof.level == READ:
                    text = f"{proof.name}: {proof.how}. Press Enter to start or s to skip."
                    return not run.asks or run.prompts.text(text).casefold() not in ("s", "skip")
                try:
                    run.confirm(f"{proof.name}: {proof.question}", proof.steps(hand))
                except NotConfirmed:
                    return False
                return True

            hour = light.FirstLight(hand, run.prompts, ask, lambda: ping(hand), attended=attended)
            hour.run(steps, skip, repeat)
            lost = facts_file.keep(path, hand, hour.outcomes, identify=identify) if path is not None else None
            table = table_of(hour.outcomes, hand.kind)
            table.failure = light.verdict_of(hour) or lost
            return table

        def plan() -> list[Step]:
            return [write for step in wanted for write in step.proof.steps(run.planner())]

        return PlannedAction(plan, carry_out, question, look=lambda _hand: Asked())
